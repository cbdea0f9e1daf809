//! One build of Raylane for one target: the library module with all it imports, and the program.
//!
//! In: the target, the optimisation mode, the variant options, the checked third-party headers.
//! Out: modules and programs that share nothing with those of another target. Our C is compiled
//! with the undefined-behaviour sanitizer outside fast mode; floating point is never contracted,
//! so that every target computes the same bits. Third-party C is in libraries.zig.

const std = @import("std");
const libraries = @import("libraries.zig");
const manifest = @import("../build.zig.zon");
const Module = std.Build.Module;
const LazyPath = std.Build.LazyPath;
const Compile = std.Build.Step.Compile;
const variants = @import("variants.zig");
const Variant = variants.Variant;
const Package = @This();

owner: *std.Build,
target: std.Build.ResolvedTarget,
optimize: std.lang.Optimize,
headers: LazyPath,
is_stripped: bool,
is_fuzzed: bool,
optional: libraries.Optional,
/// The library, `@import("raylane")`.
raylane: *Module,
shows_searches: bool,
part: Part,
/// The variants of its programs, the default one first, and those that count for them.
held: []const Variant,
counting: []const Variant,
/// Those that hold the integrators besides Whitted's.
lit: []const Variant,
/// A kernel of each: see `addKernels`.
kernels: []const *Compile,
intrinsics: *Compile,
/// The third-party libraries.
third_party: []const *Compile,
config: *Module,

/// The choice of variants, from the command line.
pub const Options = struct {
    backend: variants.Backend,
    traversal: variants.Traversal,
    /// Null: what the target's registers hold.
    lanes: ?u8,
    extent: variants.Extent,
    /// Whether kernels show their searches, for tests of traversal.
    shows_searches: bool = false,
    part: Part = .whole,
    /// Whether its programs do without what debuggers and traces of the stack read.
    is_stripped: bool = false,
    /// Whether the library and the C in it count which of their code has run.
    is_fuzzed: bool = false,
    optional: libraries.Optional,
};

/// What of a program it is. One for all processors has a part for each level of them, and one that
/// these share: libraries, and the kernels of the reference (see src/trace/link.zig).
pub const Part = union(enum) {
    whole,
    /// With its name in src/processor.zig.
    level: []const u8,
    shared,
};

const own_c_flags: []const []const u8 = &.{
    "-std=c11", "-O3", "-ffp-contract=off", "-fno-math-errno", "-Wall", "-Wextra", "-Werror",
};

/// Declares the modules for `target`; `headers` is the folder of the third-party headers.
pub fn init(
    b: *std.Build,
    target: std.Build.ResolvedTarget,
    optimize: std.lang.Optimize,
    headers: LazyPath,
    options: Options,
) Package {
    const default: Variant = .{
        .backend = options.backend,
        .traversal = options.traversal,
        .lanes = options.lanes orelse defaultLanes(target.result.cpu, options),
    };
    const held = variants.held(b.allocator, target.result.cpu, default, options.extent);
    const counting = variants.counting(b.allocator, held);
    var package: Package = .{
        .owner = b,
        .target = target,
        .optimize = optimize,
        .headers = headers,
        .is_stripped = options.is_stripped,
        .is_fuzzed = options.is_fuzzed,
        .optional = options.optional,
        .shows_searches = options.shows_searches,
        .part = options.part,
        .held = held,
        .counting = counting,
        .lit = variants.lit(b.allocator, held, options.extent),
        .raylane = undefined,
        .config = undefined,
        .intrinsics = undefined,
        .third_party = undefined,
        .kernels = undefined,
    };
    const config = package.configOf(.{
        .variants = held,
        .counting = counting,
        .lit = package.lit,
        .are_all = options.extent == .all,
    });
    config.addOption(bool, "has_draco", options.optional.draco); // Not for kernels to know.
    package.config = config.createModule();
    package.third_party = package.libraryArchives();
    package.raylane = package.withLibrary("src/raylane.zig");
    package.intrinsics = package.intrinsicsObject();
    package.kernels = package.kernelObjects();
    return package;
}

/// All tests of the library as the root of a program; the C that they need besides is the caller's.
pub fn tests(package: Package) *Module {
    const root = package.withLibrary("tests.zig");
    const raylane = package.moduleOf("tests/raylane.zig");
    raylane.addImport("tests", root);
    root.addImport("raylane", raylane);
    return root;
}

/// A module that holds the library, with all that this imports.
fn withLibrary(package: Package, path: []const u8) *Module {
    const root = package.moduleOf(path);
    if (package.is_fuzzed) root.fuzz = true;
    root.addImport("config", package.config);
    const held = libraries.held(package.optional);
    const is_musl = package.target.result.isMuslLibC();
    root.addImport("licenses", libraries.licenses(package.owner, package.headers, held, is_musl));
    if (package.part == .whole) package.addThirdParty(root);
    return root;
}

fn addThirdParty(package: Package, root: *Module) void {
    for (package.third_party) |each| root.addObjectFile(each.getEmittedBin());
}

/// The third-party libraries that a program holds: an archive of all that is C, for the compiler
/// would else compile it with each program, and one of each that is C++.
fn libraryArchives(package: Package) []const *Compile {
    const arena = package.owner.allocator;
    var list: std.ArrayList(*Compile) = .empty;
    const c = package.moduleOfLibraries();
    for (libraries.held(package.optional)) |library| {
        library.addTo(c, package.headers, package.instruments());
        const shim = library.cpp_shim orelse continue;
        const cpp = package.moduleOfLibraries();
        library.addCppTo(shim, cpp, package.headers, package.instruments());
        list.append(arena, package.archive(library.name, cpp)) catch @panic("OOM");
    }
    list.append(arena, package.archive("libraries", c)) catch @panic("OOM");
    return list.items;
}

/// What is compiled into the third-party libraries. Stripped programs, as those of tests that are
/// emulated, have no traps: these take time, and what they find does not depend on the target.
pub fn instruments(package: Package) libraries.Instruments {
    const is_checked = package.optimize == .debug or package.optimize == .safe;
    return .{
        .traps = package.is_fuzzed or (is_checked and !package.is_stripped),
        .counts = package.is_fuzzed,
    };
}

/// Of C that is not ours. What it traps needs no library that explains it.
fn moduleOfLibraries(package: Package) *Module {
    const module = package.moduleOfC();
    if (package.instruments().traps) module.sanitize_c = .trap;
    return module;
}

fn moduleOfC(package: Package) *Module {
    return package.owner.createModule(.{
        .target = package.target,
        .optimize = package.optimize,
        .link_libc = true,
        .strip = if (package.is_stripped) true else null,
        .unwind_tables = if (package.is_stripped) .none else null,
        .omit_frame_pointer = if (package.optimize == .fast) true else null,
    });
}

/// What our Zig code has in common wherever it is compiled.
fn moduleOf(package: Package, root: []const u8) *Module {
    return package.owner.createModule(.{
        .root_source_file = package.owner.path(root),
        .target = package.target,
        .optimize = package.optimize,
        .link_libc = true,
        .strip = if (package.is_stripped) true else null,
        .unwind_tables = if (package.is_stripped) .none else null,
        // A failed test tells where its error came from, in safe mode too. Modules of one program
        // must agree: where the root has no trace, std takes an error for unreachable.
        .error_tracing = if (package.optimize == .safe) true else null,
        .omit_frame_pointer = if (package.optimize == .fast) true else null,
    });
}

/// The variants that our code is told of, as in `Package`.
const Held = struct {
    variants: []const Variant,
    counting: []const Variant = &.{},
    lit: []const Variant = &.{},
    are_all: bool = false,
};

fn configOf(package: Package, told: Held) *std.Build.Step.Options {
    const b = package.owner;
    const options = b.addOptions();
    options.addOption([]const u8, "version", manifest.version);
    options.addOption([]const []const u8, "variants", package.names(told.variants));
    options.addOption([]const []const u8, "counting", package.names(told.counting));
    options.addOption([]const []const u8, "lit", package.names(told.lit));
    options.addOption(bool, "are_all", told.are_all);
    options.addOption([]const u8, "level", switch (package.part) {
        .level => |name| name,
        .whole, .shared => "",
    });
    options.addOption(bool, "shows_searches", package.shows_searches);
    return options;
}

fn names(package: Package, list: []const Variant) []const []const u8 {
    const arena = package.owner.allocator;
    const result = arena.alloc([]const u8, list.len) catch @panic("OOM");
    for (result, list) |*name, variant| name.* = variant.name(arena);
    return result;
}

/// The C intrinsics. In fast mode what is linked is LLVM's code, as it is of the kernels that call
/// them, and the linker inlines one into the other.
fn intrinsicsObject(package: Package) *Compile {
    const b = package.owner;
    const object = package.archive("intrinsics", package.moduleOfC());
    object.root_module.addCSourceFile(.{
        .file = b.path("src/simd/intrinsics.c"),
        .flags = own_c_flags,
    });
    if (package.optimize == .fast) object.lto = .full;
    return object;
}

/// One object for each variant, one more for each that counts, and one for each that holds further
/// integrators, so that these change nothing of Whitted's: they are compiled side by side, and
/// shared by all programs of the package.
fn kernelObjects(package: Package) []*Compile {
    const arena = package.owner.allocator;
    var list: std.ArrayList(*Compile) = .empty;
    for ([_]Kind{ .whitted, .counting, .lit }) |kind| {
        const part = switch (kind) {
            .whitted => package.held,
            .counting => package.counting,
            .lit => package.lit,
        };
        for (part) |variant| {
            const is_held = switch (package.part) {
                .whole => true,
                .level => variant.traversal != .single,
                .shared => variant.traversal == .single and kind != .lit,
            };
            if (is_held) list.append(arena, package.kernel(variant, kind)) catch @panic("OOM");
        }
    }
    return list.items;
}

/// Assembly of the default variant's kernel, by a compile step of its own: whoever is asked for
/// assembly generates code twice.
pub fn assembly(package: Package) LazyPath {
    return package.kernel(package.held[0], .whitted).getEmittedAsm();
}

/// What an object of a variant holds.
const Kind = enum { whitted, counting, lit };

fn kernel(package: Package, variant: Variant, kind: Kind) *Compile {
    const b = package.owner;
    const root = package.moduleOf("src/kernel.zig");
    const own: []const Variant = &.{variant};
    const config = package.configOf(.{
        .variants = own,
        .counting = if (kind == .counting) own else &.{},
        .lit = if (kind == .lit) own else &.{},
    });
    root.addImport("config", config.createModule());
    // What LLVM does for a debugger is two fifths of its time.
    root.strip = package.optimize != .debug;
    const name = b.fmt("kernel-{s}-{t}", .{ variant.name(b.allocator), kind });
    const object = package.archive(name, root);
    if (package.optimize == .fast and variant.backend == .intrinsics) object.lto = .full;
    return object;
}

/// An object in an archive, so that programs that do not refer to it do without.
fn archive(package: Package, name: []const u8, root: *Module) *Compile {
    return package.owner.addLibrary(.{ .linkage = .static, .name = name, .root_module = root });
}

/// Links a program with its kernels, and with the intrinsics for them and for itself.
pub fn addKernels(package: Package, root: *Module) void {
    for (package.kernels) |object| root.addObjectFile(object.getEmittedBin());
    root.addObjectFile(package.intrinsics.getEmittedBin());
}

/// The program.
pub fn program(package: Package) *Compile {
    return package.renderer("raylane", "src/main.zig");
}

/// A program of `levels`, the lowest first, and what they share; it chooses among them at start.
/// All else in it is compiled for `target`.
pub fn dispatcher(
    shared: Package,
    target: std.Build.ResolvedTarget,
    levels: []const Package,
) *Compile {
    const b = shared.owner;
    var start = shared;
    start.target = target;
    const level_names = b.allocator.alloc([]const u8, levels.len) catch @panic("OOM");
    for (level_names, levels) |*name, level| name.* = level.part.level;
    const told = start.configOf(.{ .variants = shared.held });
    told.addOption([]const []const u8, "levels", level_names);
    start.config = told.createModule();
    start.raylane = start.withLibrary("src/raylane.zig");
    start.raylane.no_builtin = true; // See src/memory_functions.zig.
    const exe = start.addProgram("raylane", "src/release.zig");
    const root = exe.root_module;
    root.addImport("config", start.config);
    shared.addThirdParty(root);
    for (shared.kernels) |object| root.addObjectFile(object.getEmittedBin());
    for (levels) |level| {
        for (level.kernels) |object| root.addObjectFile(object.getEmittedBin());
        root.addObjectFile(level.whole().getEmittedBin());
        root.addObjectFile(level.memoryFunctions().getEmittedBin());
    }
    return exe;
}

/// How a level copies memory: fast, however small the rest of it is.
fn memoryFunctions(package: Package) *Compile {
    const root = package.moduleOf("src/memory_functions.zig");
    root.addImport("config", package.config);
    root.optimize = .fast;
    root.no_builtin = true;
    return package.archive(package.owner.fmt("memory-{s}", .{package.part.level}), root);
}

/// All but the kernels of a level.
fn whole(package: Package) *Compile {
    const root = package.moduleOf("src/level.zig");
    root.addImport("raylane", package.raylane);
    return package.archive(package.owner.fmt("level-{s}", .{package.part.level}), root);
}

/// A program that renders.
pub fn renderer(package: Package, name: []const u8, root: []const u8) *Compile {
    const exe = package.addProgram(name, root);
    package.addKernels(exe.root_module);
    return exe;
}

/// A benchmark: the traversal that it times is compiled with it, in one piece with the C intrinsics
/// inlined in fast mode, and it has its symbols, for profilers.
pub fn benchmark(package: Package, name: []const u8, root: []const u8) *Compile {
    const exe = package.addProgram(name, root);
    exe.root_module.strip = false;
    exe.root_module.addObjectFile(package.intrinsics.getEmittedBin());
    if (package.optimize == .fast) exe.lto = .full;
    return exe;
}

/// A program of its own that imports `raylane`: the renderer, or a tool beside it.
pub fn addProgram(package: Package, name: []const u8, root: []const u8) *Compile {
    const module = package.moduleOf(root);
    module.strip = package.is_stripped or package.optimize == .fast;
    module.addImport("raylane", package.raylane);
    return package.owner.addExecutable(.{ .name = name, .root_module = module });
}

/// As many lanes as the registers hold; the C intrinsics and 2x2 packets have 4 only.
fn defaultLanes(cpu: std.Target.Cpu, options: Options) u8 {
    if (options.backend == .intrinsics or options.traversal == .packet2x2) return 4;
    if (!cpu.arch.isX86()) return 4;
    if (std.Target.x86.featureSetHas(cpu.features, .avx512f)) return 16;
    if (std.Target.x86.featureSetHas(cpu.features, .avx)) return 8;
    return 4;
}
