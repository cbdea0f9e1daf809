//! What the tests of commands share.

const std = @import("std");
const Diagnostic = @import("../diagnostic.zig").Diagnostic;

/// Expects a usage error that says `needle`, in one line that points to the help of the command.
pub fn expectUsage(
    comptime command: []const u8,
    comptime parse: anytype,
    needle: []const u8,
    arguments: []const [:0]const u8,
) !void {
    var diagnostic: Diagnostic = .{};
    try std.testing.expectError(error.UsageInvalid, parse(arguments, &diagnostic));
    const text = diagnostic.message.text();
    errdefer std.debug.print("{s}\n", .{text});
    try std.testing.expect(std.mem.find(u8, text, needle) != null);
    try std.testing.expectStringEndsWith(text, "(see raylane " ++ command ++ " --help)");
}

/// Expects lines that a terminal shows whole; returns their number.
pub fn expectFits(help: []const u8) !usize {
    var count: usize = 0;
    var lines = std.mem.splitScalar(u8, help, '\n');
    while (lines.next()) |line| : (count += 1) try std.testing.expect(line.len <= 80);
    return count;
}
