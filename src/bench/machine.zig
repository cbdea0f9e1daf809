//! What the benchmark ran on: the machine as the system describes it, the program as it was built.

const std = @import("std");
const builtin = @import("builtin");
const energy = @import("../energy.zig");
const results = @import("results.zig");
const Allocator = std.mem.Allocator;
const Io = std.Io;

/// Bytes of /proc/cpuinfo that are looked at: the first processor is enough.
const text_bytes_max = 16 << 10;

/// Describes this machine; texts live in `arena`.
pub fn describe(arena: Allocator, io: Io) error{OutOfMemory}!results.Machine {
    var buffer: [text_bytes_max]u8 = undefined;
    const names = std.posix.uname();
    return .{
        .processor = try processor(arena, io, &buffer),
        .processor_count = std.Thread.getCpuCount() catch 1,
        .system = try arena.print("{s} {s} {s}", .{
            std.mem.sliceTo(&names.sysname, 0),
            std.mem.sliceTo(&names.release, 0),
            std.mem.sliceTo(&names.machine, 0),
        }),
    };
}

/// On x86 the model, elsewhere the board.
fn processor(arena: Allocator, io: Io, buffer: []u8) error{OutOfMemory}![]const u8 {
    if (energy.readSystemFile(io, "/proc/cpuinfo", buffer)) |text| {
        if (field(text, "model name")) |model| return arena.dupe(u8, model);
    } else |_| {}
    const board = energy.readSystemFile(io, "/sys/firmware/devicetree/base/model", buffer) catch
        return builtin.cpu.model.name;
    const name = std.mem.trim(u8, board, " \n\x00");
    return if (std.unicode.utf8ValidateSlice(name)) arena.dupe(u8, name) else "unknown";
}

/// The value of the first line `name : value`.
fn field(text: []const u8, name: []const u8) ?[]const u8 {
    var lines = std.mem.splitScalar(u8, text, '\n');
    while (lines.next()) |line| {
        const key, const value = std.mem.cut(u8, line, ":") orelse continue;
        if (!std.mem.eql(u8, std.mem.trim(u8, key, " \t"), name)) continue;
        const trimmed = std.mem.trim(u8, value, " \t");
        return if (std.unicode.utf8ValidateSlice(trimmed)) trimmed else null;
    }
    return null;
}

/// How this program was built.
pub const build: results.Build = .{
    .zig = builtin.zig_version_string,
    .optimize = @tagName(builtin.mode),
    .architecture = @tagName(builtin.cpu.arch),
    .cpu = builtin.cpu.model.name,
    .cpu_features = features,
};

const features: []const []const u8 = list: {
    @setEvalBranchQuota(100_000);
    var list: []const []const u8 = &.{};
    for (builtin.cpu.arch.allFeaturesList(), 0..) |feature, index| {
        if (builtin.cpu.features.isEnabled(@intCast(index))) list = list ++ .{feature.name};
    }
    break :list list;
};

test "a field of /proc/cpuinfo" {
    const text = "processor\t: 0\nmodel name\t: Some  CPU @ 2:1\nmodel name\t: other\n";
    try std.testing.expectEqualStrings("Some  CPU @ 2:1", field(text, "model name").?);
    try std.testing.expectEqual(null, field(text, "model"));
}

test "the machine has a name" {
    var arena: std.heap.ArenaAllocator = .init(std.testing.allocator);
    defer arena.deinit();
    const machine = try describe(arena.allocator(), std.testing.io);
    try std.testing.expect(machine.processor.len > 0 and machine.processor_count >= 1);
    try std.testing.expect(build.cpu.len > 0);
}
