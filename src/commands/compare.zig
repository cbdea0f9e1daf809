//! `raylane compare`: how far two images are apart, and which thresholds they pass.

const std = @import("std");
const console = @import("console.zig");
const raylane = @import("raylane");
const signals = @import("../signals.zig");
const Account = raylane.memory_account.Account;
const Allocator = std.mem.Allocator;
const Confinement = @import("confine.zig").Confinement;
const Diagnostic = raylane.diagnostic.Diagnostic;
const ExitCode = @import("exit_code.zig").ExitCode;
const Io = std.Io;
const Target = raylane.output.Target;
const cli = raylane.cli;
const printable = raylane.diagnostic.printable;

/// Compares two images, prints how far they are apart, and says which thresholds they pass.
pub fn run(gpa: Allocator, io: Io, options: *const cli.Compare, diagnostic: *Diagnostic) ExitCode {
    if (options.output) |name| if (cli.isStdout(name) and console.isTerminal(io)) return .usage;
    var account: Account = .initFor(gpa, io, null);
    var confinement: Confinement = .init(io, options.sandbox);
    for (options.images) |path| confinement.addFile(path);
    if (options.output) |path| confinement.addOutput(path);
    if (confinement.enter(diagnostic)) |code| return code;
    const allocator = account.allocator();
    var target: ?Target = openMap(io, options.output, diagnostic) catch {
        const text = diagnostic.message.text();
        console.say(io, "raylane: {f}: {s}\n", .{ printable(options.output.?), text });
        return .failed;
    };
    defer if (target) |*map| map.abandon();
    const replaced = if (target) |*map| map.replaces else null;
    var pictures: [2]raylane.compare.Picture = undefined;
    var count: usize = 0;
    defer for (pictures[0..count]) |*picture| picture.deinit(allocator);
    for (&pictures, options.images) |*picture, name| {
        const ev = options.exposure_ev;
        picture.* = raylane.compare.read(
            allocator,
            io,
            name,
            replaced,
            ev,
            diagnostic,
        ) catch |err| {
            return console.fail(&account, io, name, err, diagnostic);
        };
        count += 1;
    }
    const first = &pictures[0];
    const second = &pictures[1];
    if (first.width != second.width or first.height != second.height) {
        console.say(io, "raylane: {f}: {d}x{d} pixels, where {f} has {d}x{d}\n", .{
            printable(options.images[1]), second.width, second.height,
            printable(options.images[0]), first.width,  first.height,
        });
        return .invalid;
    }
    const map = if (target) |*map| map else null;
    return printComparison(allocator, io, options, .{ first, second }, map, diagnostic) catch
        console.outOfMemory(io);
}

/// Where the picture of the differences goes; null: there is none.
fn openMap(io: Io, path: ?[]const u8, diagnostic: *Diagnostic) raylane.output.TargetError!?Target {
    const name = path orelse return null;
    if (cli.isStdout(name)) return Target.openStdout(io);
    return try Target.openFile(io, &signals.temporary_files, name, diagnostic);
}

fn printComparison(
    gpa: Allocator,
    io: Io,
    options: *const cli.Compare,
    pictures: [2]*const raylane.compare.Picture,
    map: ?*Target,
    diagnostic: *Diagnostic,
) error{ OutOfMemory, WriteFailed }!ExitCode {
    var comparison: raylane.compare.Comparison = try .of(gpa, pictures[0], pictures[1]);
    defer comparison.deinit(gpa);
    if (map) |target| {
        writeHeatMap(gpa, target, &comparison, diagnostic) catch |err| {
            if (err == error.OutOfMemory) return error.OutOfMemory;
            const name = printable(options.output.?);
            console.say(io, "raylane: {f}: {s}\n", .{ name, diagnostic.message.text() });
            return .failed;
        };
    }
    var text: Io.Writer.Allocating = .init(gpa);
    defer text.deinit();
    const to_stdout = options.output == null or !cli.isStdout(options.output.?);
    switch (options.stats orelse if (to_stdout) cli.Stats.text else .none) {
        .none => {},
        .text => try comparison.writeText(&text.writer),
        .json => try comparison.writeJson(options.images, &text.writer),
    }
    if (!to_stdout) {
        console.say(io, "{s}", .{text.written()});
    } else if (text.written().len > 0 and console.print(io, text.written()) != .ok) return .failed;
    var exit_code: ExitCode = .ok;
    for (std.enums.values(raylane.settings.Metric)) |metric| {
        const threshold = options.thresholds.get(metric) orelse continue;
        if (!comparison.metrics.isBeyond(metric, threshold)) continue;
        exit_code = .differ;
        console.say(io, "raylane: {f}: {t} is {d:.5}, the threshold {d}\n", .{
            printable(options.images[1]), metric, comparison.metrics.of(metric), threshold,
        });
    }
    return exit_code;
}

fn writeHeatMap(
    gpa: Allocator,
    target: *Target,
    comparison: *const raylane.compare.Comparison,
    diagnostic: *Diagnostic,
) error{ OutOfMemory, InputOutput }!void {
    const pixels = try comparison.heatMap(gpa);
    defer gpa.free(pixels);
    const width = comparison.width;
    const height = comparison.height;
    try raylane.output.check(.png, false, width, height, diagnostic);
    const file = try raylane.output.encodePng(gpa, width, height, pixels);
    defer gpa.free(file);
    return target.finish(&.{file}, diagnostic);
}
