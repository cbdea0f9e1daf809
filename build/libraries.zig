//! The third-party libraries: a row each, with what is compiled of them, and how.
//!
//! In: the folder that vendor/fetch fills. Out: their C files in a module of ours, and the notices
//! that have to go with a program that holds them. All are compiled without contraction, so that
//! every target computes the same bits, and get their memory from whoever calls them, by the hooks
//! of src/memory_account.h or by cgltf's. Debug and safe builds trap undefined behaviour in them,
//! and indices past the bounds of arrays, but for what `Library.tolerated` names.

const std = @import("std");
const LazyPath = std.Build.LazyPath;
const Module = std.Build.Module;

/// Of C++: the language without its run-time library, and how Zig sets up that library's headers.
const cpp_flags: []const []const u8 = &.{
    "-std=c++17",
    "-ffp-contract=off",
    "-fno-exceptions",
    "-fno-rtti",
    "-fno-c++-static-destructors",
    "-fno-threadsafe-statics",
    "-w",
    "-DNDEBUG",
    "-D_LIBCPP_ABI_VERSION=1",
    "-D_LIBCPP_ABI_NAMESPACE=__1",
    "-D_LIBCPP_HAS_THREADS=1",
    "-D_LIBCPP_HAS_MONOTONIC_CLOCK",
    "-D_LIBCPP_HAS_MUSL_LIBC=1",
    "-D_LIBCPP_HAS_FILESYSTEM=1",
    "-D_LIBCPP_HAS_LOCALIZATION",
    "-D_LIBCPP_HAS_UNICODE",
    "-D_LIBCPP_HAS_WIDE_CHARACTERS",
    "-D_LIBCPP_HAS_VENDOR_AVAILABILITY_ANNOTATIONS=0",
    "-D_LIBCPP_DISABLE_VISIBILITY_ANNOTATIONS",
    "-D_LIBCPP_PSTL_BACKEND_SERIAL",
};

const Language = enum { c, cpp };

/// What is compiled into libraries besides their code.
pub const Instruments = struct {
    /// Undefined behaviour ends the program.
    traps: bool = false,
    /// Which code has run is counted, for fuzzing.
    counts: bool = false,

    fn flags(instruments: Instruments, language: Language) []const []const u8 {
        const trapping: []const []const u8 = switch (language) {
            .c => &.{"-fsanitize=local-bounds"},
            .cpp => &.{
                "-fsanitize=local-bounds",
                "-D_LIBCPP_HARDENING_MODE=_LIBCPP_HARDENING_MODE_EXTENSIVE",
                "-D_LIBCPP_ASSERTION_SEMANTIC_DEFAULT=_LIBCPP_ASSERTION_SEMANTIC_QUICK_ENFORCE",
            },
        };
        const plain: []const []const u8 = switch (language) {
            .c => &.{"-fno-sanitize=undefined"},
            .cpp => &.{
                "-fno-sanitize=undefined",
                "-D_LIBCPP_HARDENING_MODE=_LIBCPP_HARDENING_MODE_NONE",
                "-D_LIBCPP_ASSERTION_SEMANTIC_DEFAULT=_LIBCPP_ASSERTION_SEMANTIC_IGNORE",
            },
        };
        return if (instruments.traps) trapping else plain;
    }

    fn counting(instruments: Instruments) []const []const u8 {
        return if (instruments.counts)
            &.{"-fsanitize-coverage=inline-8bit-counters,pc-table"}
        else
            &.{};
    }
};

/// One library; vendor/libraries.json says where it comes from, under the same name.
pub const Library = struct {
    name: []const u8,
    /// Its own C files, below the folder that vendor/fetch fills.
    files: []const []const u8 = &.{},
    /// C files of ours: the implementation of what is a header only, and the call that we make.
    shims: []const []const u8 = &.{},
    /// One in C++ that includes the library's own files.
    cpp_shim: ?[]const u8 = null,
    /// Folders below that one from where its own files are included.
    includes: []const []const u8 = &.{},
    /// A folder of ours with headers that it would otherwise have from elsewhere.
    own_headers: ?[]const u8 = null,
    /// Definitions, and what else a library needs the compiler to be told.
    flags: []const []const u8 = &.{},
    /// Undefined behaviour that does no harm on any of our targets, and why: flags that let it pass
    /// where all other traps.
    tolerated: []const []const u8 = &.{},
    /// More of its C files, which alone need what is tolerated; none: all do.
    tolerant_files: []const []const u8 = &.{},

    /// Compiles what is C of the library into `module`.
    pub fn addTo(
        library: Library,
        module: *Module,
        headers: LazyPath,
        instruments: Instruments,
    ) void {
        // Headers of one in C++ are not for the others, with which it would share the module.
        if (library.files.len + library.shims.len == 0) return;
        const b = module.owner;
        const is_tolerant = library.tolerant_files.len == 0;
        const flags = library.allFlags(b, .c, instruments, is_tolerant);
        module.addIncludePath(headers);
        for (library.includes) |folder| module.addIncludePath(headers.path(b, folder));
        if (library.own_headers) |folder| module.addIncludePath(b.path(folder));
        module.addCSourceFiles(.{
            .root = headers,
            .files = library.files,
            .flags = flags,
            .language = .c,
        });
        module.addCSourceFiles(.{ .files = library.shims, .flags = flags });
        if (is_tolerant) return;
        module.addCSourceFiles(.{
            .root = headers,
            .files = library.tolerant_files,
            .flags = library.allFlags(b, .c, instruments, true),
            .language = .c,
        });
    }

    /// Compiles what is C++ of it into `root`, an empty module: that sees the headers of Zig's C++
    /// library, whose code, which takes two minutes to compile, nothing is linked with.
    pub fn addCppTo(
        library: Library,
        shim: []const u8,
        root: *Module,
        headers: LazyPath,
        instruments: Instruments,
    ) void {
        const b = root.owner;
        for ([_][]const u8{ "libcxx/include", "libcxxabi/include" }) |folder| {
            // Before those of the libc, which it includes.
            root.addIncludePath(LazyPath.zig_lib.path(b, folder));
        }
        root.addIncludePath(headers);
        for (library.includes) |folder| root.addIncludePath(headers.path(b, folder));
        if (library.own_headers) |folder| root.addIncludePath(b.path(folder));
        const flags = library.allFlags(b, .cpp, instruments, true);
        root.addCSourceFile(.{ .file = b.path(shim), .flags = flags });
    }

    fn allFlags(
        library: Library,
        b: *std.Build,
        language: Language,
        instruments: Instruments,
        is_tolerant: bool,
    ) []const []const u8 {
        return std.mem.concat(b.allocator, []const u8, &.{
            if (language == .c) &.{ "-std=c11", "-ffp-contract=off" } else cpp_flags,
            instruments.flags(language),
            instruments.counting(),
            library.flags,
            if (instruments.traps and is_tolerant) library.tolerated else &.{},
        }) catch @panic("OOM");
    }
};

/// The transcoder to RGBA alone: no other format, and none of the codecs that compute with floats.
pub const basisu: Library = .{
    .name = "basisu",
    .cpp_shim = "src/decode/basisu.cpp",
    .own_headers = "src/decode/basisu",
    .flags = &.{
        "-fno-strict-aliasing",
        "-DBASISD_SUPPORT_KTX2=0",
        "-DBASISD_SUPPORT_KTX2_ZSTD=0",
        "-DBASISD_SUPPORT_DXT1=0",
        "-DBASISD_SUPPORT_DXT5A=0",
        "-DBASISD_SUPPORT_BC7=0",
        "-DBASISD_SUPPORT_BC7_MODE5=0",
        "-DBASISD_SUPPORT_PVRTC1=0",
        "-DBASISD_SUPPORT_PVRTC2=0",
        "-DBASISD_SUPPORT_ETC2_EAC_A8=0",
        "-DBASISD_SUPPORT_ETC2_EAC_RG11=0",
        "-DBASISD_SUPPORT_ASTC=0",
        "-DBASISD_SUPPORT_XUASTC=0",
        "-DBASISD_SUPPORT_ATC=0",
        "-DBASISD_SUPPORT_FXT1=0",
        "-DBASISD_SUPPORT_UASTC_HDR=0",
    },
};

pub const cgltf: Library = .{ .name = "cgltf", .shims = &.{"src/parse/cgltf.c"} };

pub const libdeflate: Library = .{
    .name = "libdeflate",
    .files = &.{
        "libdeflate/lib/adler32.c",
        "libdeflate/lib/arm/cpu_features.c",
        "libdeflate/lib/crc32.c",
        "libdeflate/lib/deflate_compress.c",
        "libdeflate/lib/deflate_decompress.c",
        "libdeflate/lib/utils.c",
        "libdeflate/lib/x86/cpu_features.c",
        "libdeflate/lib/zlib_compress.c",
        "libdeflate/lib/zlib_decompress.c",
    },
    .shims = &.{"src/decode/gzip.c"},
};

/// The decoder of meshes, an option.
pub const draco: Library = .{
    .name = "draco",
    .cpp_shim = "src/decode/draco.cpp",
    .includes = &.{"draco/src"},
    .own_headers = "src/decode/draco",
    .flags = &.{"-fno-aligned-allocation"},
};

/// Decoder and encoder in plain C. Threads are ours, but its tables are set up under locks. Its one
/// place of allocations is given names of ours, and so are the functions of the C library's
/// mathematics that the encoder decides by.
pub const libwebp: Library = .{
    .name = "libwebp",
    .files = &.{
        "libwebp/src/dec/alpha_dec.c",
        "libwebp/src/dec/buffer_dec.c",
        "libwebp/src/dec/frame_dec.c",
        "libwebp/src/dec/io_dec.c",
        "libwebp/src/dec/quant_dec.c",
        "libwebp/src/dec/tree_dec.c",
        "libwebp/src/dec/vp8_dec.c",
        "libwebp/src/dec/vp8l_dec.c",
        "libwebp/src/dec/webp_dec.c",
        "libwebp/src/dsp/alpha_processing.c",
        "libwebp/src/dsp/cost.c",
        "libwebp/src/dsp/cpu.c",
        "libwebp/src/dsp/dec.c",
        "libwebp/src/dsp/dec_clip_tables.c",
        "libwebp/src/dsp/enc.c",
        "libwebp/src/dsp/filters.c",
        "libwebp/src/dsp/lossless.c",
        "libwebp/src/dsp/lossless_enc.c",
        "libwebp/src/dsp/rescaler.c",
        "libwebp/src/dsp/ssim.c",
        "libwebp/src/dsp/upsampling.c",
        "libwebp/src/dsp/yuv.c",
        "libwebp/src/enc/alpha_enc.c",
        "libwebp/src/enc/analysis_enc.c",
        "libwebp/src/enc/backward_references_cost_enc.c",
        "libwebp/src/enc/backward_references_enc.c",
        "libwebp/src/enc/config_enc.c",
        "libwebp/src/enc/cost_enc.c",
        "libwebp/src/enc/filter_enc.c",
        "libwebp/src/enc/frame_enc.c",
        "libwebp/src/enc/histogram_enc.c",
        "libwebp/src/enc/iterator_enc.c",
        "libwebp/src/enc/near_lossless_enc.c",
        "libwebp/src/enc/picture_csp_enc.c",
        "libwebp/src/enc/picture_enc.c",
        "libwebp/src/enc/picture_rescale_enc.c",
        "libwebp/src/enc/picture_tools_enc.c",
        "libwebp/src/enc/quant_enc.c",
        "libwebp/src/enc/syntax_enc.c",
        "libwebp/src/enc/token_enc.c",
        "libwebp/src/enc/tree_enc.c",
        "libwebp/src/enc/vp8l_enc.c",
        "libwebp/src/enc/webp_enc.c",
        "libwebp/src/utils/bit_reader_utils.c",
        "libwebp/src/utils/bit_writer_utils.c",
        "libwebp/src/utils/color_cache_utils.c",
        "libwebp/src/utils/filters_utils.c",
        "libwebp/src/utils/huffman_encode_utils.c",
        "libwebp/src/utils/huffman_utils.c",
        "libwebp/src/utils/palette.c",
        "libwebp/src/utils/quant_levels_dec_utils.c",
        "libwebp/src/utils/quant_levels_utils.c",
        "libwebp/src/utils/random_utils.c",
        "libwebp/src/utils/rescaler_utils.c",
        "libwebp/src/utils/thread_utils.c",
        "libwebp/src/utils/utils.c",
    },
    .shims = &.{ "src/decode/webp.c", "src/output/webp.c" },
    .includes = &.{"libwebp"},
    .flags = &.{
        "-DWEBP_USE_THREAD",   "-DWEBP_DISABLE_STATS",    "-U__SSE2__",
        "-U__SSE4_1__",        "-U__AVX2__",              "-U__ARM_NEON__",
        "-U__aarch64__",       "-Dmalloc=rl_webp_malloc", "-Dcalloc=rl_webp_calloc",
        "-Dfree=rl_webp_free", "-Dlog=rl_webp_log",       "-Dpow=rl_webp_pow",
        // Coefficients of broken files are more than its transform's products hold.
        "-fwrapv",
    },
    // It adds to a pointer before it looks whether memory came.
    .tolerated = &.{"-fno-sanitize=pointer-overflow"},
    .tolerant_files = &.{"libwebp/src/enc/predictor_enc.c"},
};

/// The decoders, without SIMD.
pub const meshopt: Library = .{
    .name = "meshopt",
    .cpp_shim = "src/decode/meshopt.cpp",
    .flags = &.{"-DMESHOPTIMIZER_NO_SIMD"},
};

/// Numbers that no integer holds become the nearest one, as which cell a vertex is in.
pub const mikktspace: Library = .{
    .name = "mikktspace",
    .shims = &.{"src/prepare/mikktspace.c"},
    .flags = &.{ "-fno-math-errno", "-fno-strict-float-cast-overflow" },
    // Its sort rotates a seed by 0 to 31 bits, and so shifts it by 32 the other way where that is
    // 0: the seed comes out as it was, whether a machine makes nothing or all of that shift.
    .tolerated = &.{ "-fno-sanitize=shift-exponent", "-fno-sanitize=float-cast-overflow" },
};

/// Scan lines, and the compressions that lose nothing, and PXR24.
pub const openexr: Library = .{
    .name = "openexr",
    .files = &.{
        "openexr/src/lib/OpenEXRCore/attributes.c",
        "openexr/src/lib/OpenEXRCore/base.c",
        "openexr/src/lib/OpenEXRCore/bytes.c",
        "openexr/src/lib/OpenEXRCore/channel_list.c",
        "openexr/src/lib/OpenEXRCore/chunk.c",
        "openexr/src/lib/OpenEXRCore/coding.c",
        "openexr/src/lib/OpenEXRCore/compression.c",
        "openexr/src/lib/OpenEXRCore/context.c",
        "openexr/src/lib/OpenEXRCore/decoding.c",
        "openexr/src/lib/OpenEXRCore/encoding.c",
        "openexr/src/lib/OpenEXRCore/float_vector.c",
        "openexr/src/lib/OpenEXRCore/internal_huf.c",
        "openexr/src/lib/OpenEXRCore/internal_piz.c",
        "openexr/src/lib/OpenEXRCore/internal_pxr24.c",
        "openexr/src/lib/OpenEXRCore/internal_rle.c",
        "openexr/src/lib/OpenEXRCore/internal_structs.c",
        "openexr/src/lib/OpenEXRCore/internal_zip.c",
        "openexr/src/lib/OpenEXRCore/memory.c",
        "openexr/src/lib/OpenEXRCore/opaque.c",
        "openexr/src/lib/OpenEXRCore/pack.c",
        "openexr/src/lib/OpenEXRCore/parse_header.c",
        "openexr/src/lib/OpenEXRCore/part.c",
        "openexr/src/lib/OpenEXRCore/part_attr.c",
        "openexr/src/lib/OpenEXRCore/preview.c",
        "openexr/src/lib/OpenEXRCore/std_attr.c",
        "openexr/src/lib/OpenEXRCore/string.c",
        "openexr/src/lib/OpenEXRCore/string_vector.c",
        "openexr/src/lib/OpenEXRCore/unpack.c",
        "openexr/src/lib/OpenEXRCore/validation.c",
        "openexr/src/lib/OpenEXRCore/write_header.c",
    },
    .shims = &.{
        "src/decode/openexr.c",
        "src/decode/openexr/left_out.c",
        "src/output/openexr.c",
    },
    .includes = &.{ "libdeflate", "openexr/src/lib/OpenEXRCore" },
    .own_headers = "src/decode/openexr",
    .flags = &.{ "-D_GNU_SOURCE", "-w" },
};

/// Inflates by libdeflate. A palette that is shorter than its indices is on the stack.
pub const stb_image: Library = .{
    .name = "stb_image",
    .shims = &.{"src/decode/stb_image.c"},
    .flags = &.{"-ftrivial-auto-var-init=zero"},
};

/// For tests that decode pictures, of formats as well that the program does not.
pub const stb_image_of_tests: Library = .{
    .name = "stb_image",
    .files = &.{"stb_image.h"},
    .flags = &.{
        "-DSTB_IMAGE_IMPLEMENTATION", "-DSTBI_NO_STDIO",  "-DSTBI_MAX_DIMENSIONS=65536",
        "-DSTBI_ONLY_PNG",            "-DSTBI_ONLY_JPEG", "-DSTBI_ONLY_TGA",
        "-DSTBI_ONLY_BMP",            "-DSTBI_ONLY_HDR",
    },
};

/// Compresses by libdeflate.
pub const stb_image_write: Library = .{
    .name = "stb_image_write",
    .shims = &.{"src/output/stb_image_write.c"},
    // The bits of a JPEG file leave a signed number at its upper end.
    .tolerated = &.{"-fno-sanitize=shift"},
};

pub const zstd: Library = .{
    .name = "zstd",
    .files = &.{"zstd/zstddeclib.c"},
    .shims = &.{"src/decode/zstd.c"},
};

/// What every program holds.
const program = [_]Library{
    basisu,     cgltf,   libdeflate, libwebp,         meshopt,
    mikktspace, openexr, stb_image,  stb_image_write, zstd,
};

/// What is a choice of the build, and of its command line. Releases hold it.
pub const Optional = struct {
    draco: bool,

    /// The names by which vendor/fetch knows them.
    pub fn names(optional: Optional) []const []const u8 {
        return if (optional.draco) &.{draco.name} else &.{};
    }
};

/// What a program holds.
pub fn held(optional: Optional) []const Library {
    return if (optional.draco) &(program ++ [_]Library{draco}) else &program;
}

/// A module with `text`: the project's licence, and the notices of what a program is made of.
pub fn licenses(
    b: *std.Build,
    headers: LazyPath,
    of: []const Library,
    is_musl: bool,
) *Module {
    var texts: std.ArrayList(LazyPath) = .empty;
    texts.append(b.allocator, b.path("LICENSE")) catch @panic("OOM");
    for (of) |library| {
        const notice = headers.path(b, b.fmt("{s}.notice", .{library.name}));
        texts.append(b.allocator, notice) catch @panic("OOM");
    }
    if (is_musl) {
        const notice = LazyPath.zig_lib.path(b, "libc/musl/COPYRIGHT");
        texts.append(b.allocator, notice) catch @panic("OOM");
    }
    const files = b.addWriteFiles();
    var source: []const u8 = "pub const text: []const u8 = \"\"";
    for (texts.items, 0..) |text, index| {
        _ = files.addCopyFile(text, b.fmt("{d}", .{index}));
        const rule = if (index == 0) "" else " ++ \"\\n----\\n\\n\"";
        source = b.fmt("{s}{s} ++\n    @embedFile(\"{d}\")", .{ source, rule, index });
    }
    const root = files.add("licenses.zig", b.fmt("{s};\n", .{source}));
    return b.createModule(.{ .root_source_file = root });
}
