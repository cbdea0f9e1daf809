//! The test suites, on this machine and under qemu, and the line that counts them.
//!
//! In: the targets to test, with a `Package` for each. Out: steps that run suites and close with
//! the count. A suite is a program with `tests/runner.zig` as its main; `tests/launch.zig` runs it
//! and keeps its log, whatever becomes of it; `tests/summary.zig` adds up the logs. Suites run
//! every time: what they read (scenes, pictures, the source tree) is more than the build knows of.

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
        tests.format(), tests.tidy(), tests.machinery(), tests.report(), tests.fetcher(),
    }) catch @panic("OOM");
    for (targets) |target| {
        logs.appendSlice(arena, &.{
            tests.unit(target), tests.integration(target), tests.commandLine(target),
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
    tests.close(unit_step, &.{tests.unit(target)}, .with_sources);
    tests.close(integration_step, &.{tests.integration(target)}, .logs_only);
}

/// Makes `step` check the formatting.
pub fn addFormat(tests: Tests, step: *std.Build.Step) void {
    tests.close(step, &.{tests.format()}, .logs_only);
}

/// Makes `step` check the style of the source tree.
pub fn addTidy(tests: Tests, step: *std.Build.Step) void {
    tests.close(step, &.{tests.tidy()}, .logs_only);
}

/// Makes `step` test the tools in Python: the report of the benchmark, and vendor/fetch.
pub fn addReport(tests: Tests, step: *std.Build.Step) void {
    tests.close(step, &.{ tests.report(), tests.fetcher() }, .logs_only);
}

/// Makes `step` compile the test programs of `target` without a file as the result.
pub fn addCheck(tests: Tests, step: *std.Build.Step, target: Target) void {
    step.dependOn(&tests.unitProgram(target).step);
    step.dependOn(&tests.integrationProgram(target).step);
    step.dependOn(&tests.hostProgram("cli").step);
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

fn machinery(tests: Tests) LazyPath {
    const run, const log = tests.start("summary", "host");
    run.addArg("--");
    run.addArtifactArg(tests.hostProgram("summary"));
    return log;
}

fn unit(tests: Tests, target: Target) LazyPath {
    return tests.runOn("unit", target, tests.unitProgram(target));
}

fn integration(tests: Tests, target: Target) LazyPath {
    return tests.runOn("integration", target, tests.integrationProgram(target));
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

fn unitProgram(tests: Tests, target: Target) *Compile {
    const root = target.package.library();
    target.package.addKernels(root);
    return tests.program("unit", root);
}

fn integrationProgram(tests: Tests, target: Target) *Compile {
    const b = tests.owner;
    const root = b.createModule(.{
        .root_source_file = b.path("tests/integration.zig"),
        .target = target.package.target,
        .optimize = target.package.optimize,
        .error_tracing = target.package.raylane.error_tracing,
        .strip = target.package.raylane.strip,
        .imports = &.{.{ .name = "raylane", .module = target.package.raylane }},
    });
    libraries.stb_image_of_tests.addTo(root, target.package.headers);
    target.package.addKernels(root);
    return tests.program("integration", root);
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

fn runOn(tests: Tests, suite: []const u8, target: Target, tested: *Compile) LazyPath {
    const run, const log = tests.start(suite, target.name);
    if (target.emulator.len != 0) {
        run.addArg(tests.owner.fmt("--needs={s}", .{target.emulator[0]}));
        run.addArg("--env=RAYLANE_EMULATED=1");
    }
    run.addArg("--");
    run.addArgs(target.emulator);
    run.addArtifactArg(tested);
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
