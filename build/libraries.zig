//! The third-party C libraries: a row each, with what is compiled of them, and how.
//!
//! In: the folder that vendor/fetch fills. Out: their C files in a module of ours, and the notices
//! that have to go with a program that holds them. All are compiled without the sanitizer of
//! undefined behaviour and without contraction, so that every target computes the same bits, and
//! get their memory from whoever calls them, by the hooks of src/memory_account.h or by cgltf's.

const std = @import("std");
const LazyPath = std.Build.LazyPath;
const Module = std.Build.Module;

/// One library; vendor/libraries.json says where it comes from, under the same name.
pub const Library = struct {
    name: []const u8,
    /// Its own C files, below the folder that vendor/fetch fills.
    files: []const []const u8 = &.{},
    /// C files of ours: the implementation of what is a header only, and the call that we make.
    shims: []const []const u8 = &.{},
    /// Definitions, and what else a library needs the compiler to be told.
    flags: []const []const u8 = &.{},

    /// Compiles the library into `module`.
    pub fn addTo(library: Library, module: *Module, headers: LazyPath) void {
        const b = module.owner;
        const flags = std.mem.concat(b.allocator, []const u8, &.{
            &.{ "-std=c11", "-ffp-contract=off", "-fno-sanitize=undefined" }, library.flags,
        }) catch @panic("OOM");
        module.addIncludePath(headers);
        module.addCSourceFiles(.{
            .root = headers,
            .files = library.files,
            .flags = flags,
            .language = .c,
        });
        module.addCSourceFiles(.{ .files = library.shims, .flags = flags });
    }
};

pub const cgltf: Library = .{ .name = "cgltf", .shims = &.{"src/parse/cgltf.c"} };

pub const libdeflate: Library = .{ .name = "libdeflate", .files = &.{
    "libdeflate/lib/adler32.c",
    "libdeflate/lib/arm/cpu_features.c",
    "libdeflate/lib/crc32.c",
    "libdeflate/lib/deflate_compress.c",
    "libdeflate/lib/deflate_decompress.c",
    "libdeflate/lib/utils.c",
    "libdeflate/lib/x86/cpu_features.c",
    "libdeflate/lib/zlib_compress.c",
    "libdeflate/lib/zlib_decompress.c",
} };

pub const mikktspace: Library = .{
    .name = "mikktspace",
    .shims = &.{"src/prepare/mikktspace.c"},
    .flags = &.{"-fno-math-errno"},
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
};

/// What the program holds.
pub const program = [_]Library{ cgltf, libdeflate, mikktspace, stb_image, stb_image_write };

/// A module with `text`: the project's licence, and the notices of what a program is made of.
pub fn licenses(b: *std.Build, headers: LazyPath, is_musl: bool) *Module {
    var texts: std.ArrayList(LazyPath) = .empty;
    texts.append(b.allocator, b.path("LICENSE")) catch @panic("OOM");
    for (program) |library| {
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
