//! The test suites, on this machine and under qemu, and the line that counts them.
//!
//! In: the targets to test, with a `Package` for each. Out: steps that run suites and close with
//! the count. A suite is a program with `tests/runner.zig` as its main, or a part of one;
//! `tests/launch.zig` runs it and keeps its log, whatever becomes of it; `tests/summary.zig` adds
//! up the logs. Suites run every time: what they read (scenes, pictures, the source tree) is more
//! than the build knows of.

const std = @import("std");
const libraries = @import("libraries.zig");
const Package = @import("package.zig");
const Compile = std.Build.Step.Compile;
const LazyPath = std.Build.LazyPath;
const Tests = @This();

owner: *std.Build,
/// This machine with a static libc, for the programs that do not depend on the target.
host: std.Build.ResolvedTarget,
launch: *Compile,
summary: *Compile,
/// Only tests whose name contains one of these; all where there is none.
filters: []const []const u8,

/// A machine that Raylane is tested for.
pub const Target = struct {
    name: []const u8,
    package: Package,
    /// The program, with its arguments, that runs foreign executables here; empty for this machine.
    emulator: []const []const u8,
};

/// Declares the programs of the test machinery.
pub fn init(
    b: *std.Build,
    host: std.Build.ResolvedTarget,
    filters: []const []const u8,
) Tests {
    var tests: Tests = .{
        .owner = b,
        .host = host,
        .launch = undefined,
        .summary = undefined,
        .filters = filters,
    };
    const launch = tests.hostModule("launch");
    tests.launch = b.addExecutable(.{ .name = "launch", .root_module = launch });
    const summary = tests.hostModule("summary");
    tests.summary = b.addExecutable(.{ .name = "summary", .root_module = summary });
    return tests;
}

/// Makes `step` run everything for `targets` and close with the count.
pub fn addAll(tests: Tests, step: *std.Build.Step, targets: []const Target) void {
    var logs: std.ArrayList(LazyPath) = .empty;
    const arena = tests.owner.allocator;
    logs.appendSlice(arena, &.{
        tests.format(),                 tests.tidy(),           tests.machinery(),
        tests.report(),                 tests.fetcher(),        tests.robustness(),
        tests.packages("Layout", null), tests.farm(targets[0]),
    }) catch @panic("OOM");
    if (targets[0].emulator.len == 0) {
        const own = targets[0].package.program();
        logs.appendSlice(arena, &.{
            tests.packages("Deb", own), tests.packages("Wheel", own),
        }) catch @panic("OOM");
    }
    for (targets) |target| {
        const tested = tests.ofLibrary(target.package, null);
        logs.appendSlice(arena, &.{
            tests.runOn(.unit, target, tested),
            tests.runOn(.integration, target, tested),
            tests.commandLine(target),
        }) catch @panic("OOM");
    }
    tests.close(step, logs.items, .with_sources);
}

/// Makes the steps run the unit tests of `target`, and those of traversal against brute force and
/// of whole pictures.
pub fn addHere(
    tests: Tests,
    unit_step: *std.Build.Step,
    integration_step: *std.Build.Step,
    target: Target,
) void {
    const unit = tests.ofLibrary(target.package, .unit);
    tests.close(unit_step, &.{tests.runOn(.unit, target, unit)}, .with_sources);
    const integration = tests.ofLibrary(target.package, .integration);
    tests.close(integration_step, &.{tests.runOn(.integration, target, integration)}, .logs_only);
}

/// Makes `step` check the formatting.
pub fn addFormat(tests: Tests, step: *std.Build.Step) void {
    tests.close(step, &.{tests.format()}, .logs_only);
}

/// Makes `step` check the style of the source tree.
pub fn addTidy(tests: Tests, step: *std.Build.Step) void {
    tests.close(step, &.{tests.tidy()}, .logs_only);
}

/// Makes `step` test the tools in Python: of the benchmark, of vendoring, of packages, and farm/
/// with the program of `target`.
pub fn addReport(tests: Tests, step: *std.Build.Step, target: Target) void {
    tests.close(step, &.{
        tests.report(),                 tests.fetcher(),    tests.robustness(),
        tests.packages("Layout", null), tests.farm(target),
    }, .logs_only);
}

/// Makes `step` compile the test programs of `target` without a file as the result.
pub fn addCheck(tests: Tests, step: *std.Build.Step, target: Target) void {
    step.dependOn(&tests.ofLibrary(target.package, null).step);
    step.dependOn(&tests.hostProgram("cli").step);
    step.dependOn(&target.package.renderer("fuzz", "fuzz/main.zig").step);
}

fn format(tests: Tests) LazyPath {
    const run, const log = tests.start("fmt", "sources");
    run.addArgs(&.{ "--one", "--", tests.owner.graph.zig_exe, "fmt", "--check", "." });
    return log;
}

fn tidy(tests: Tests) LazyPath {
    const run, const log = tests.start("tidy", "sources");
    run.addArg("--");
    run.addArtifactArg(tests.hostProgram("tidy"));
    return log;
}

/// The report of the benchmark; its figures are tested where matplotlib is installed.
fn report(tests: Tests) LazyPath {
    const run, const log = tests.start("report", "sources");
    run.addArgs(&.{ "--one", "--needs=python3", "--", "python3", "-m", "unittest", "discover" });
    run.addArgs(&.{ "-s", "bench/reporting", "-t", "bench" });
    return log;
}

/// What fetches the third-party files; each kind of package is tested where its tool is installed.
fn fetcher(tests: Tests) LazyPath {
    const run, const log = tests.start("fetch", "sources");
    run.addArgs(&.{ "--one", "--needs=python3", "--", "python3", "-m", "unittest", "discover" });
    run.addArgs(&.{ "-s", "vendor" });
    return log;
}

/// What damages files, measures and judges in tests/robustness.
fn robustness(tests: Tests) LazyPath {
    const run, const log = tests.start("robustness", "sources");
    run.addArgs(&.{ "--one", "--needs=python3", "--", "python3", "-m", "unittest", "discover" });
    run.addArgs(&.{ "-s", "tests/robustness" });
    return log;
}

/// Several machines: what needs Dask is tested where its environment can be made.
fn farm(tests: Tests, target: Target) LazyPath {
    const run, const log = tests.start("farm", "sources");
    run.addArg("--needs=python3");
    if (target.emulator.len == 0) run.addArtifactArg2(target.package.program(), .{
        .prefix = "--env=RAYLANE_PROGRAM=",
        .make_absolute = true,
    });
    run.addArgs(&.{ "--", "python3", "farm/tests/run.py", ".zig-cache/farm" });
    return log;
}

/// What wraps programs up, and packages of this machine's program, installed where nothing else is.
fn packages(tests: Tests, class: []const u8, packaged: ?*Compile) LazyPath {
    const name = std.ascii.allocLowerString(tests.owner.allocator, class) catch @panic("OOM");
    const run, const log = tests.start(name, if (packaged == null) "sources" else "native");
    run.addArgs(&.{ "--one", "--needs=python3" });
    if (packaged) |one| run.addArtifactArg2(one, .{
        .prefix = "--env=RAYLANE_PROGRAM=",
        .make_absolute = true,
    });
    run.addArgs(&.{ "--", "python3", "-B", "build/test_packages.py", class });
    return log;
}

fn machinery(tests: Tests) LazyPath {
    const run, const log = tests.start("summary", "host");
    run.addArg("--");
    run.addArtifactArg(tests.hostProgram("summary"));
    return log;
}

/// The command line's tests run here; they start the target's program, under its emulator.
fn commandLine(tests: Tests, target: Target) LazyPath {
    const b = tests.owner;
    const run, const log = tests.start("cli", target.name);
    if (target.emulator.len != 0) {
        run.addArg(b.fmt("--needs={s}", .{target.emulator[0]}));
        const command = std.mem.join(b.allocator, " ", target.emulator) catch @panic("OOM");
        run.addArg(b.fmt("--env=RAYLANE_EMULATOR={s}", .{command}));
    }
    run.addArg(b.fmt("--env=RAYLANE_OPTIMIZE={t}", .{target.package.optimize}));
    run.addArtifactArg2(target.package.program(), .{
        .prefix = "--env=RAYLANE_PROGRAM=",
        .make_absolute = true,
    });
    run.addArg("--");
    run.addArtifactArg(tests.hostProgram("cli"));
    return log;
}

/// What tests of the library are of: a file of its own, or what others see of it.
const Part = enum {
    unit,
    integration,

    /// How the names of its tests begin: with the folder.
    fn prefix(part: Part) []const u8 {
        return switch (part) {
            .unit => "src.",
            .integration => "tests.",
        };
    }
};

/// The program of one part; null: of all, for all are compiled in little more time than one.
fn ofLibrary(tests: Tests, package: Package, part: ?Part) *Compile {
    const root = package.tests();
    libraries.stb_image_of_tests.addTo(root, package.headers, .{});
    package.addKernels(root);
    var own = tests;
    if (part) |one| {
        if (tests.filters.len == 0) own.filters = tests.owner.dupeStrings(&.{one.prefix()});
        return own.program(@tagName(one), root);
    }
    return own.program("library", root);
}

/// A test program of this machine whose root is `tests/NAME.zig`.
fn hostProgram(tests: Tests, name: []const u8) *Compile {
    return tests.program(name, tests.hostModule(name));
}

fn hostModule(tests: Tests, name: []const u8) *std.Build.Module {
    const b = tests.owner;
    return b.createModule(.{
        .root_source_file = b.path(b.fmt("tests/{s}.zig", .{name})),
        .target = tests.host,
        .optimize = .debug,
        .link_libc = true,
    });
}

fn program(tests: Tests, name: []const u8, root: *std.Build.Module) *Compile {
    const b = tests.owner;
    return b.addTest(.{
        .name = b.fmt("test-{s}", .{name}),
        .root_module = root,
        .filters = tests.filters,
        .test_runner = .{ .path = b.path("tests/runner.zig"), .mode = .simple },
    });
}

fn runOn(tests: Tests, part: Part, target: Target, tested: *Compile) LazyPath {
    const run, const log = tests.start(@tagName(part), target.name);
    if (target.emulator.len != 0) {
        run.addArg(tests.owner.fmt("--needs={s}", .{target.emulator[0]}));
        run.addArg("--env=RAYLANE_EMULATED=1");
    }
    run.addArg("--");
    run.addArgs(target.emulator);
    run.addArtifactArg(tested);
    run.addArg(part.prefix());
    return log;
}

/// Begins the command line of `launch`: options, `--` and the command are the caller's to add.
fn start(
    tests: Tests,
    suite: []const u8,
    target: []const u8,
) struct { *std.Build.Step.Run, LazyPath } {
    const b = tests.owner;
    const run = b.addRunArtifact(tests.launch);
    run.setName(b.fmt("test {s} {s}", .{ suite, target }));
    run.setCwd(b.path("."));
    // Checked, not inherited, so that suites run side by side.
    run.expectExitCode(0);
    run.has_side_effects = true;
    const log = run.addOutputFileArg(b.fmt("{s}-{s}.log", .{ suite, target }));
    run.addArgs(&.{ suite, target });
    return .{ run, log };
}

const Scope = enum { logs_only, with_sources };

/// Makes `step` print the sum of `logs`; with sources, it looks for files whose tests did not run.
fn close(tests: Tests, step: *std.Build.Step, logs: []const LazyPath, scope: Scope) void {
    const b = tests.owner;
    const run = b.addRunArtifact(tests.summary);
    run.setName("count tests");
    run.setCwd(b.path("."));
    run.has_side_effects = true;
    if (scope == .with_sources and tests.filters.len == 0) run.addArg("--sources=src");
    for (logs) |log| run.addFileArg(log);
    step.dependOn(&run.step);
}
