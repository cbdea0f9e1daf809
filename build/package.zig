//! One build of Raylane for one target: the library module with all it imports, and the program.
//!
//! In: the target, the optimisation mode, the variant options, the checked third-party headers.
//! Out: modules and programs that share nothing with those of another target. Third-party C is
//! compiled without the undefined-behaviour sanitizer, ours with it outside fast mode; floating
//! point is never contracted, so that every target computes the same bits.

const std = @import("std");
const manifest = @import("../build.zig.zon");
const Module = std.Build.Module;
const LazyPath = std.Build.LazyPath;
const Package = @This();

owner: *std.Build,
target: std.Build.ResolvedTarget,
optimize: std.lang.Optimize,
headers: LazyPath,
/// The library, `@import("raylane")`.
raylane: *Module,

/// How four floats are added; `src/variant.zig` says what each means.
pub const Backend = enum { scalar, vector, intrinsics };
/// How rays are bundled; `src/variant.zig` says what each means.
pub const Traversal = enum { single, packet2x2, beam };
/// Whether the program holds the default variant only.
pub const Variants = enum { one, all };

/// The choice of variants, from the command line.
pub const Options = struct {
    backend: Backend,
    traversal: Traversal,
    /// Null: what the target's registers hold.
    lanes: ?u8,
    variants: Variants,
};

const own_c_flags: []const []const u8 = &.{
    "-std=c11", "-O3", "-ffp-contract=off", "-fno-math-errno", "-Wall", "-Wextra", "-Werror",
};
const third_party_c_flags: []const []const u8 = &.{
    "-std=c11", "-ffp-contract=off", "-fno-sanitize=undefined",
};

/// Declares the modules for `target`; `headers` is the folder of the third-party headers.
pub fn init(
    b: *std.Build,
    target: std.Build.ResolvedTarget,
    optimize: std.lang.Optimize,
    headers: LazyPath,
    options: Options,
) Package {
    const config = b.addOptions();
    config.addOption([]const u8, "version", manifest.version);
    config.addOption(Backend, "backend", options.backend);
    config.addOption(Traversal, "traversal", options.traversal);
    config.addOption(u8, "lanes", options.lanes orelse defaultLanes(target.result.cpu, options));
    config.addOption(Variants, "variants", options.variants);

    var package: Package = .{
        .owner = b,
        .target = target,
        .optimize = optimize,
        .headers = headers,
        .raylane = undefined,
    };
    package.raylane = b.createModule(.{
        .root_source_file = b.path("src/raylane.zig"),
        .target = target,
        .optimize = optimize,
        .link_libc = true,
        // A failed test tells where its error came from, in safe mode too.
        .error_tracing = if (optimize == .safe) true else null,
        .omit_frame_pointer = if (optimize == .fast) true else null,
        .imports = &.{.{ .name = "config", .module = config.createModule() }},
    });
    package.addThirdParty(package.raylane, b.path("src/parse/cgltf.c"), &.{});
    package.raylane.addCSourceFile(.{
        .file = b.path("src/simd/intrinsics.c"),
        .flags = own_c_flags,
    });
    return package;
}

/// The program, linked in one piece with the C intrinsics inlined in fast mode.
pub fn program(package: Package) *std.Build.Step.Compile {
    const exe = package.addProgram("raylane", "src/main.zig");
    if (package.optimize == .fast) exe.lto = .full;
    return exe;
}

/// A benchmark: compiled and linked like the program, but with its symbols, for profilers.
pub fn benchmark(package: Package, name: []const u8, root: []const u8) *std.Build.Step.Compile {
    const exe = package.addProgram(name, root);
    exe.root_module.strip = false;
    if (package.optimize == .fast) exe.lto = .full;
    return exe;
}

/// A program of its own that imports `raylane`: the renderer, or a tool beside it.
pub fn addProgram(package: Package, name: []const u8, root: []const u8) *std.Build.Step.Compile {
    const b = package.owner;
    return b.addExecutable(.{ .name = name, .root_module = b.createModule(.{
        .root_source_file = b.path(root),
        .target = package.target,
        .optimize = package.optimize,
        .strip = package.optimize == .fast,
        .omit_frame_pointer = if (package.optimize == .fast) true else null,
        .imports = &.{.{ .name = "raylane", .module = package.raylane }},
    }) });
}

/// stb_image as a module, for tests that decode pictures.
pub fn stbImage(package: Package) *Module {
    const b = package.owner;
    const module = b.createModule(.{
        .root_source_file = b.path("tests/stb_image.zig"),
        .target = package.target,
        .optimize = package.optimize,
        .link_libc = true,
    });
    package.addThirdParty(module, package.headers.path(b, "stb_image.h"), &.{
        "-DSTB_IMAGE_IMPLEMENTATION", "-DSTBI_ONLY_PNG",             "-DSTBI_ONLY_JPEG",
        "-DSTBI_NO_STDIO",            "-DSTBI_MAX_DIMENSIONS=32768",
    });
    return module;
}

fn addThirdParty(
    package: Package,
    module: *Module,
    implementation: LazyPath,
    defines: []const []const u8,
) void {
    const b = package.owner;
    module.addIncludePath(package.headers);
    module.addCSourceFile(.{
        .file = implementation,
        .language = .c,
        .flags = b.graph.dupeStrings(std.mem.concat(
            b.allocator,
            []const u8,
            &.{ third_party_c_flags, defines },
        ) catch @panic("OOM")),
    });
}

/// As many lanes as the registers hold; the C intrinsics and 2x2 packets have 4 only.
fn defaultLanes(cpu: std.Target.Cpu, options: Options) u8 {
    if (options.backend == .intrinsics or options.traversal == .packet2x2) return 4;
    if (!cpu.arch.isX86()) return 4;
    if (std.Target.x86.featureSetHas(cpu.features, .avx512f)) return 16;
    if (std.Target.x86.featureSetHas(cpu.features, .avx)) return 8;
    return 4;
}
