//! An image file as a display shows it: what is compared.
//!
//! In: a file in memory, of any kind that `decode` reads, or of `netpbm.zig`. Out: planes of sRGB
//! values in 0..1, and of linear light. What is transparent is laid over middle grey in linear
//! light; radiance is exposed and clipped, without a tone curve.

const std = @import("std");
const decode = @import("../decode.zig");
const elementary = @import("../math/elementary.zig");
const netpbm = @import("netpbm.zig");
const srgb = @import("../math/srgb.zig");
const Allocator = std.mem.Allocator;

/// Linear light behind what is transparent.
pub const grey = 0.18;

/// Planes of one size.
pub const Picture = struct {
    width: u32,
    height: u32,
    /// Red, green and blue, rows from the top.
    encoded: [3][]f32,
    /// See `encoded`.
    linear: [3][]f32,
    memory: []f32,

    /// Undefined planes.
    pub fn init(gpa: Allocator, width: u32, height: u32) error{OutOfMemory}!Picture {
        const count = std.math.mul(usize, width, height) catch return error.OutOfMemory;
        const total = std.math.mul(usize, 6, count) catch return error.OutOfMemory;
        const memory = try gpa.alloc(f32, total);
        var picture: Picture = .{
            .width = width,
            .height = height,
            .encoded = undefined,
            .linear = undefined,
            .memory = memory,
        };
        for (&picture.encoded, &picture.linear, 0..) |*encoded, *linear, channel| {
            encoded.* = memory[2 * channel * count ..][0..count];
            linear.* = memory[(2 * channel + 1) * count ..][0..count];
        }
        return picture;
    }

    /// Of one colour in linear light, 0 to 1.
    pub fn solid(
        gpa: Allocator,
        width: u32,
        height: u32,
        rgb: [3]f32,
    ) error{OutOfMemory}!Picture {
        var picture: Picture = try .init(gpa, width, height);
        for (0..picture.linear[0].len) |index| picture.setLinear(index, rgb);
        return picture;
    }

    pub fn deinit(picture: *Picture, gpa: Allocator) void {
        gpa.free(picture.memory);
        picture.* = undefined;
    }

    /// A file; of radiance, times `scale`.
    pub fn of(
        gpa: Allocator,
        file: []const u8,
        scale: f32,
        reason: *decode.Reason,
    ) decode.Error!Picture {
        if (netpbm.kindOf(file) != null) {
            return ofNetpbm(gpa, try netpbm.read(file, reason), scale);
        }
        var texels = try decode.decode(gpa, file, reason);
        defer texels.deinit(gpa);
        var picture: Picture = try .init(gpa, texels.width, texels.height);
        const channels = texels.channel_count;
        for (0..picture.linear[0].len) |index| switch (texels.data) {
            .bytes => |bytes| picture.setCodes(index, bytes[index * channels ..][0..channels]),
            .floats => |floats| {
                const values = floats[index * channels ..][0..channels];
                picture.setRadiance(index, colourOf(f32, values), alphaOf(values), scale);
            },
        };
        return picture;
    }

    fn ofNetpbm(gpa: Allocator, file: netpbm.File, scale: f32) error{OutOfMemory}!Picture {
        var picture: Picture = try .init(gpa, file.width, file.height);
        for (0..picture.linear[0].len) |index| switch (file.kind) {
            .ppm => picture.setCodes(index, file.values[3 * index ..][0..3]),
            .pfm => {
                const rgb = file.floatsAt(index % file.width, index / file.width);
                picture.setRadiance(index, rgb, 1, scale);
            },
        };
        return picture;
    }

    /// Linear light of a pixel.
    pub fn linearAt(picture: *const Picture, index: usize) [3]f32 {
        const linear = &picture.linear;
        return .{ linear[0][index], linear[1][index], linear[2][index] };
    }

    /// sRGB codes of 8 bits with straight alpha, in 1 to 4 channels.
    fn setCodes(picture: *Picture, index: usize, codes: []const u8) void {
        const colour = colourOf(u8, codes);
        const alpha = if (codes.len % 2 == 0) codes[codes.len - 1] else 255;
        if (alpha == 255) {
            for (colour, 0..) |code, channel| {
                picture.encoded[channel][index] = @as(f32, @floatFromInt(code)) / 255;
                picture.linear[channel][index] = srgb.decoded[code];
            }
            return;
        }
        const share = @as(f32, @floatFromInt(alpha)) / 255;
        var rgb: [3]f32 = undefined;
        for (&rgb, colour) |*value, code| {
            value.* = srgb.decoded[code] * share + grey * (1 - share);
        }
        picture.setLinear(index, rgb);
    }

    /// Radiance, premultiplied with its alpha. What is no number counts as 0.
    fn setRadiance(picture: *Picture, index: usize, colour: [3]f32, alpha: f32, scale: f32) void {
        var rgb: [3]f32 = undefined;
        const behind = grey * (1 - std.math.clamp(alpha, 0, 1));
        for (&rgb, colour) |*value, radiance| {
            const finite = if (std.math.isNan(radiance)) 0 else radiance;
            value.* = finite * scale + behind;
        }
        picture.setLinear(index, rgb);
    }

    fn setLinear(picture: *Picture, index: usize, rgb: [3]f32) void {
        for (rgb, 0..) |value, channel| {
            const clipped = std.math.clamp(value, 0, 1);
            picture.linear[channel][index] = clipped;
            picture.encoded[channel][index] = encode(clipped);
        }
    }
};

/// Gray is all three.
fn colourOf(comptime Value: type, values: []const Value) [3]Value {
    return if (values.len < 3) @splat(values[0]) else values[0..3].*;
}

fn alphaOf(values: []const f32) f32 {
    return if (values.len % 2 == 0) values[values.len - 1] else 1;
}

/// The sRGB transfer function, not rounded to a code. Asserts 0 <= linear <= 1.
fn encode(linear: f32) f32 {
    if (linear <= 0.0031308) return 12.92 * linear;
    return @floatCast(1.055 * elementary.pow(linear, 1.0 / 2.4) - 0.055);
}

test "codes, radiance and what is transparent" {
    const gpa = std.testing.allocator;
    var reason: decode.Reason = .{};
    var ppm: Picture = try .of(gpa, "P6 1 1 255 \x00\x80\xff", 1, &reason);
    defer ppm.deinit(gpa);
    try std.testing.expectApproxEqAbs(0.21586, ppm.linear[1][0], 1e-5);
    try std.testing.expectEqual(1, ppm.encoded[2][0]);
    const floats = [_]f32{ 0.1, std.math.nan(f32), 7 };
    var pfm: Picture = try .of(gpa, "PF 1 1 -1.0 " ++ std.mem.asBytes(&floats), 2, &reason);
    defer pfm.deinit(gpa);
    try std.testing.expectEqual([3]f32{ 0.2, 0, 1 }, pfm.linearAt(0));
    try std.testing.expectApproxEqAbs(0.48453, pfm.encoded[0][0], 1e-5);
    pfm.setCodes(0, &.{ 255, 255, 255, 51 });
    try std.testing.expectApproxEqAbs(0.2 + 0.18 * 0.8, pfm.linear[0][0], 1e-6);
    pfm.setCodes(0, &.{ 255, 0 });
    try std.testing.expectApproxEqAbs(0.18, pfm.linear[2][0], 1e-6);
    for (0..256) |code| {
        const value = encode(srgb.decoded[code]) * 255;
        try std.testing.expectApproxEqAbs(@as(f32, @floatFromInt(code)), value, 1e-3);
    }
}
