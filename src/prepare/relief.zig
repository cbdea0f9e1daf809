//! Normals of a height map, by central differences (Blinn 1978).
//!
//! In: the texels of an image, gray for heights; what has colours holds normals already. Out:
//! texels of tangent-space normals, x along u, y against the rows. The whole range of heights is
//! taken as `height_max` of the image's width, for files do not say; a material scales the normals.
//! Rows and columns go around at the borders.

const std = @import("std");
const huge_pages = @import("../huge_pages.zig");
const Allocator = std.mem.Allocator;
const Texels = @import("../decode.zig").Texels;

/// Of the image's width.
const height_max = 0.02;

/// Mean difference of an image's channels, in shares of their range, from which it has colours.
const color_min = 0.06;

/// What comes of an image that may hold heights has so many channels.
pub const channel_count = 3;

/// Puts normals in the place of heights; other images stay.
pub fn toNormals(gpa: Allocator, texels: *Texels) error{OutOfMemory}!void {
    if (hasColors(texels)) return;
    const width: usize = texels.width;
    const height: usize = texels.height;
    const memory = try huge_pages.alloc(gpa, u8, channel_count * width * height);
    // Texels are squares: a step of one is 1 / width either way.
    const slope: f32 = height_max / 2.0 * @as(f32, @floatFromInt(texels.width));
    for (0..height) |y| {
        const above = (if (y == 0) height else y) - 1;
        const below = if (y + 1 == height) 0 else y + 1;
        for (0..width) |x| {
            const left = (if (x == 0) width else x) - 1;
            const right = if (x + 1 == width) 0 else x + 1;
            const across = heightAt(texels, right, y) - heightAt(texels, left, y);
            const downwards = heightAt(texels, x, below) - heightAt(texels, x, above);
            memory[channel_count * (y * width + x) ..][0..channel_count].* =
                encode(-slope * across, slope * downwards);
        }
    }
    texels.deinit(gpa);
    texels.* = .{
        .width = @intCast(width),
        .height = @intCast(height),
        .channel_count = channel_count,
        .data = .{ .bytes = memory },
        .memory = memory,
    };
}

/// Channel 0 of a texel, of 0 to 1.
fn heightAt(texels: *const Texels, x: usize, y: usize) f32 {
    return valueAt(texels, (y * texels.width + x) * texels.channel_count);
}

fn valueAt(texels: *const Texels, index: usize) f32 {
    return switch (texels.data) {
        .bytes => |all| @as(f32, @floatFromInt(all[index])) / 255,
        .floats => |all| if (all[index] < 1) all[index] else 1,
    };
}

fn hasColors(texels: *const Texels) bool {
    const count = texels.channel_count;
    if (count < 3) return false;
    const texel_count = @as(usize, texels.width) * texels.height;
    var sum: f64 = 0;
    for (0..texel_count) |texel| {
        const red = valueAt(texels, count * texel);
        sum += @abs(red - valueAt(texels, count * texel + 1));
        sum += @abs(red - valueAt(texels, count * texel + 2));
    }
    return sum >= color_min * 2 * @as(f64, @floatFromInt(texel_count));
}

/// The codes of (x, y, 1) at unit length.
fn encode(x: f32, y: f32) [channel_count]u8 {
    const length = @sqrt(x * x + y * y + 1);
    var codes: [channel_count]u8 = undefined;
    for (&codes, [_]f32{ x, y, 1 }) |*code, value| {
        code.* = @intFromFloat((value / length * 0.5 + 0.5) * 255 + 0.5);
    }
    return codes;
}

fn testTexels(comptime count: u8, codes: []const u8) !Texels {
    const memory = try huge_pages.alloc(std.testing.allocator, u8, codes.len);
    @memcpy(memory, codes);
    return .{
        .width = 4,
        .height = @intCast(codes.len / count / 4),
        .channel_count = count,
        .data = .{ .bytes = memory },
        .memory = memory,
    };
}

test "what rises to the right looks to the left, what rises downwards looks up" {
    const gpa = std.testing.allocator;
    var ramp = try testTexels(1, &.{ 0, 50, 150, 200, 0, 50, 150, 200 });
    try toNormals(gpa, &ramp);
    defer ramp.deinit(gpa);
    try std.testing.expectEqual(3, ramp.channel_count);
    // (150 - 0) / 255 / 2 of two hundredths of four texels: a slope of 0.0235.
    try std.testing.expectEqual([3]u8{ 125, 128, 255 }, ramp.data.bytes[3..6].*);
    try std.testing.expect(ramp.data.bytes[0] > 128); // Around the border.
    var rows: [12]u8 = undefined;
    for (&rows, 0..) |*code, index| code.* = @intCast(index / 4 * 100);
    var column = try testTexels(1, &rows);
    try toNormals(gpa, &column);
    defer column.deinit(gpa);
    try std.testing.expect(column.data.bytes[3 * 4 + 1] > 128);
    try std.testing.expectEqual(128, column.data.bytes[3 * 4]);
}

test "normals stay, gray in three channels does not" {
    const gpa = std.testing.allocator;
    const codes = [_]u8{ 128, 128, 255, 128, 128, 255, 120, 128, 255, 128, 99, 255 };
    var normals = try testTexels(3, &codes);
    try toNormals(gpa, &normals);
    defer normals.deinit(gpa);
    try std.testing.expectEqual(99, normals.data.bytes[10]);
    var gray = try testTexels(3, &.{ 9, 9, 9, 9, 9, 10, 9, 9, 9, 9, 8, 9 });
    try toNormals(gpa, &gray);
    defer gray.deinit(gpa);
    try std.testing.expectEqual([3]u8{ 128, 128, 255 }, gray.data.bytes[0..3].*);
}
