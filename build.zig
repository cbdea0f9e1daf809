//! Builds Raylane: one static `raylane`, its tests on every target, and its tools.
//!
//! In: the command line's options, the sources, the files that `vendor/fetch` checks. Out: the
//! steps at the top of `build`; `zig build` alone installs a fast, native, static program. What is
//! wired once a target stands in build/package.zig, what only tests need in build/tests.zig.

const std = @import("std");
const builtin = @import("builtin");
const manifest = @import("build.zig.zon");
const Package = @import("build/package.zig");
const Tests = @import("build/tests.zig");
const fuzz = @import("build/fuzz.zig");
const libraries = @import("build/libraries.zig");
const release = @import("build/release.zig");
const variants = @import("build/variants.zig");
const Compile = std.Build.Step.Compile;
const Run = std.Build.Step.Run;

comptime {
    // Not a floor: language and std change with every release, and so may the generated code.
    if (!std.mem.eql(u8, builtin.zig_version_string, manifest.minimum_zig_version)) @compileError(
        "Raylane needs Zig " ++ manifest.minimum_zig_version ++ ", this is Zig " ++
            builtin.zig_version_string ++ "; ./zigw fetches the right one",
    );
}

/// Declares the steps and options of `zig build`.
pub fn build(b: *std.Build) void {
    const steps = .{
        .install = b.getInstallStep(),
        .run = b.step("run", "Render: zig build run -- SCENE [-o OUT]"),
        .@"test" = b.step("test", "Run all tests, here and under qemu, and count them"),
        .test_unit = b.step("test:unit", "Run the unit tests of this machine"),
        .test_integration = b.step("test:integration", "Run its tests of rays and pictures"),
        .test_fmt = b.step("test:fmt", "Check the formatting"),
        .test_tidy = b.step("test:tidy", "Check the style of the source tree"),
        .test_report = b.step("test:report", "Test the tools in Python"),
        .test_release = b.step("test:release", "Test what is released on old and new processors"),
        .check = b.step("check", "Compile the program, its benchmarks and tests, write nothing"),
        .@"asm" = b.step("asm", "Write its assembly before linking to zig-out/raylane.s"),
        .scenes = b.step("scenes", "Regenerate scenes/cornell.gltf"),
        .bench_rays = b.step("bench:rays", "Time rays: zig build bench:rays -- SCENE [options]"),
        .bench_parse = b.step("bench:parse", "Time parsing: zig build bench:parse -- SCENE.pbrt"),
        .bench_poses = b.step("bench:poses", "Posed triangles: -- SCENE ANIMATION SECONDS"),
        .bench_frames = b.step("bench:frames", "Time frames in motion: -- SCENE [FRAMES [SIZE]]"),
        .bench_structures = b.step("bench:structures", "Trees beside each other: -- SCENE"),
        .bench_light = b.step("bench:light", "Rays by bounce and traversal: -- SCENE [options]"),
        .compare = b.step("compare", "One program with all variants beside one for each: -- SCENE"),
        .lowering = b.step("lowering", "Regenerate docs/lowering.md from the compiler"),
        .release = b.step("release", "Build programs for all processors, and packages of them"),
        .vendor = b.step("vendor", "Fetch and check the third-party files"),
    };
    const query = b.standardTargetOptionsQueryOnly(.{});
    const optimize = b.option(std.lang.Optimize, "optimize", "debug, safe, fast (default), small");
    const optional: libraries.Optional = .{
        .draco = b.option(bool, "draco", "Read meshes compressed by Draco (releases do)") orelse
            false,
    };
    const options, const all = variantOptions(b, optional);
    const filters = b.option([]const []const u8, "test-filter", "Only tests with this in the name");
    const vendor = addVendor(b, optional);
    steps.vendor.dependOn(vendor.step);
    const target = resolve(b, query);
    const package: Package = .init(b, target, optimize orelse .fast, vendor.headers, options);

    const program = package.program();
    steps.install.dependOn(&b.addInstallArtifact(program, .{}).step);
    addRun(steps.run, program);
    steps.@"asm".dependOn(&b.addInstallFile(package.assembly(), "raylane.s").step);

    inline for (.{ "rays", "parse", "poses", "structures", "light" }) |name| {
        const benchmark = package.benchmark(name, "bench/" ++ name ++ ".zig");
        addBenchmark(steps.check, @field(steps, "bench_" ++ name), benchmark);
    }
    addBenchmark(steps.check, steps.bench_frames, package.renderer("frames", "bench/frames.zig"));
    addCompare(steps.compare, .init(b, target, optimize orelse .fast, vendor.headers, all));

    const tests: Tests = .init(b, resolve(b, .{}), filters orelse &.{});
    const test_packages: TestPackages = .{
        .owner = b,
        .optimize = optimize orelse .safe,
        .headers = vendor.headers,
        .options = all,
    };
    const targets = test_packages.targets(query);
    tests.addAll(steps.@"test", targets);
    tests.addHere(steps.test_unit, steps.test_integration, targets[0]);
    tests.addFormat(steps.test_fmt);
    tests.addTidy(steps.test_tidy);
    tests.addReport(steps.test_report, targets[0]);
    tests.addCheck(steps.check, targets[0]);
    steps.check.dependOn(&package.program().step);
    fuzz.add(.init(b, resolve(b, .{}), optimize orelse .safe, vendor.headers, fuzzed(options)));
    release.add(steps.release, steps.test_release, addVendor(b, release.optional).headers);
    addScenes(steps.scenes, .init(b, resolve(b, .{}), .safe, vendor.headers, options));
    addLowering(steps.lowering);
}

/// Of fuzzers: one variant, whose libraries count what has run.
fn fuzzed(options: Package.Options) Package.Options {
    var result = options;
    result.extent = .one;
    result.is_fuzzed = true;
    return result;
}

/// The choice of variants, for programs that are used and for those that compare variants.
fn variantOptions(b: *std.Build, optional: libraries.Optional) [2]Package.Options {
    var options: Package.Options = .{
        .backend = b.option(variants.Backend, "backend", "Arithmetic of the default variant") orelse
            .vector,
        .traversal = b.option(variants.Traversal, "traversal", "Its bundles of rays") orelse .beam,
        .lanes = b.option(u8, "lanes", "Its SIMD width: 4, 8 or 16 (default: the target's)"),
        .extent = undefined,
        .optional = optional,
    };
    const description = "Hold that variant (one), the scalar reference beside it (few), each " ++
        "backend and traversal (some), or all";
    const extent = b.option(variants.Extent, "variants", description);
    options.extent = extent orelse .few;
    var all = options;
    all.extent = extent orelse .all;
    all.shows_searches = true;
    return .{ options, all };
}

/// Makes `step` write the scenes that come with Raylane.
fn addScenes(step: *std.Build.Step, package: Package) void {
    const b = step.owner;
    const run = b.addRunArtifact(package.addProgram("make-scenes", "scenes/make.zig"));
    run.setCwd(b.path("."));
    run.addArg("scenes/cornell.gltf");
    step.dependOn(&run.step);
}

/// Makes `step` build a program for each variant and compare them with the one that holds all, on
/// the scene that follows `--`.
fn addCompare(step: *std.Build.Step, package: Package) void {
    const b = step.owner;
    const run = b.addSystemCommand(&.{"python3"});
    run.addFileArg(b.path("bench/compare.py"));
    run.setCwd(b.path("."));
    run.has_side_effects = true;
    run.addArtifactArg2(package.program(), .{ .prefix = "", .make_absolute = true });
    const description = "Only variants with this in their names";
    const wanted = b.option([]const u8, "compare", description) orelse "";
    for (package.held) |variant| {
        const name = variant.name(b.allocator);
        if (std.mem.find(u8, name, wanted) == null) continue;
        const single: Package = .init(b, package.target, package.optimize, package.headers, .{
            .backend = variant.backend,
            .traversal = variant.traversal,
            .lanes = variant.lanes,
            .extent = .one,
            .optional = package.optional,
        });
        run.addArtifactArg2(single.program(), .{
            .prefix = b.fmt("{s}=", .{name}),
            .make_absolute = true,
        });
    }
    run.addArg("--");
    run.addPassthruArgs();
    step.dependOn(&run.step);
}

/// Makes `step` write docs/lowering.md: what the compiler makes of the SIMD library.
fn addLowering(step: *std.Build.Step) void {
    const b = step.owner;
    const lowering = b.addSystemCommand(&.{ "python3", "bench/lowering.py" });
    lowering.setCwd(b.path("."));
    lowering.addFileArg(.zig_exe);
    lowering.addArg("docs/lowering.md");
    lowering.has_side_effects = true;
    step.dependOn(&lowering.step);
}

/// The step that puts the third-party files in place, and the folder of copies that depends on it.
fn addVendor(
    b: *std.Build,
    optional: libraries.Optional,
) struct { step: *std.Build.Step, headers: std.Build.LazyPath } {
    const fetch = b.addSystemCommand(&.{"python3"});
    fetch.setName("vendor/fetch");
    fetch.addFileArg(b.path("vendor/fetch"));
    fetch.addArgs(optional.names());
    // It looks at files that a user may have put there, so it runs each time (0.1 s).
    fetch.has_side_effects = true;
    const copies = b.addWriteFiles();
    copies.step.dependOn(&fetch.step);
    const headers = copies.addCopyDirectory(b.path("vendor/include"), "include", .{});
    return .{ .step = &fetch.step, .headers = headers };
}

/// Fills in what a bare `-Dtarget=` leaves open: a static libc, and a NEON CPU for ARMv7.
fn resolve(b: *std.Build, query: std.Target.Query) std.Build.ResolvedTarget {
    var filled = query;
    const arch = query.cpu_arch orelse b.graph.host.result.cpu.arch;
    const os = query.os_tag orelse b.graph.host.result.os.tag;
    if (query.abi == null and os == .linux) filled.abi = if (arch == .arm) .musleabihf else .musl;
    if (query.cpu_model == .determined_by_arch_os) {
        if (query.cpu_arch == null) filled.cpu_model = .native;
        if (query.cpu_arch == .arm) {
            filled.cpu_model = .{ .explicit = &std.Target.arm.cpu.cortex_a15 };
        }
    }
    return b.resolveTargetQuery(filled);
}

/// What the targets of the tests have in common.
const TestPackages = struct {
    owner: *std.Build,
    optimize: std.lang.Optimize,
    headers: std.Build.LazyPath,
    options: Package.Options,

    /// The chosen target, or else this machine, AArch64 and ARMv7, the first of them first.
    /// qemu is told which CPU to be, so that an instruction too new for it does not pass.
    fn targets(packages: TestPackages, chosen: std.Target.Query) []const Tests.Target {
        const host = packages.owner.graph.host.result.cpu.arch;
        var list: std.ArrayList(Tests.Target) = .empty;
        if (chosen.cpu_arch) |arch| {
            const emulator = packages.owner.fmt("qemu-{t}", .{arch});
            packages.add(&list, @tagName(arch), chosen, &.{emulator});
            return list.items;
        }
        packages.add(&list, "native", chosen, &.{});
        for ([_]std.Target.Query{
            .{ .cpu_arch = .aarch64, .os_tag = .linux, .cpu_model = .baseline },
            .{ .cpu_arch = .arm, .os_tag = .linux },
        }, [_][]const []const u8{
            &.{ "qemu-aarch64", "-cpu", "cortex-a53" },
            &.{ "qemu-arm", "-cpu", "cortex-a15" },
        }) |query, emulator| {
            const arch = query.cpu_arch.?;
            if (arch != host) packages.add(&list, @tagName(arch), query, emulator);
        }
        return list.items;
    }

    fn add(
        packages: TestPackages,
        list: *std.ArrayList(Tests.Target),
        name: []const u8,
        query: std.Target.Query,
        emulator: []const []const u8,
    ) void {
        const b = packages.owner;
        const target = resolve(b, query);
        const is_here = target.result.cpu.arch == b.graph.host.result.cpu.arch;
        var options = packages.options;
        // Traces of the stack are of the first target; -Dtarget= makes another one it.
        options.is_stripped = list.items.len != 0;
        // Each backend with each traversal is this machine's to test. Under qemu, some of AArch64
        // show that the bits agree, those of NEON's intrinsics too, and two of ARMv7 are enough.
        if (!is_here and options.extent == .all) {
            options.extent = if (target.result.cpu.arch == .arm) .few else .some;
        }
        const package: Package = .init(b, target, packages.optimize, packages.headers, options);
        list.append(b.allocator, .{
            .name = name,
            .package = package,
            .emulator = if (is_here) &.{} else b.graph.dupeStrings(emulator),
        }) catch @panic("OOM");
    }
};

/// Makes `step` install a benchmark and run it with the arguments that follow `--`, and `check`
/// compile it.
fn addBenchmark(check: *std.Build.Step, step: *std.Build.Step, benchmark: *Compile) void {
    step.dependOn(&step.owner.addInstallArtifact(benchmark, .{}).step);
    addRun(step, benchmark);
    check.dependOn(&benchmark.step);
}

/// Runs a program with the arguments that follow `--`.
fn addRun(step: *std.Build.Step, program: *Compile) void {
    const run = runOn(step.owner, program);
    run.addPassthruArgs();
    step.dependOn(&run.step);
}

/// Runs a program where it is, or under qemu-user when it is built for another machine.
fn runOn(b: *std.Build, program: *Compile) *Run {
    const arch = program.rootModuleTarget().cpu.arch;
    if (arch == b.graph.host.result.cpu.arch) return b.addRunArtifact(program);
    const run = b.addSystemCommand(&.{b.fmt("qemu-{t}", .{arch})});
    run.addArtifactArg(program);
    return run;
}
