//! Images of radiance as environment maps.
//!
//! In: an equirectangular image, whose texel at u, v is seen along d with u = atan2(d.z, d.x) /
//! 2 pi + 0.5 and v = acos(d.y) / pi, v = 0 the top row; or the square of `math.equal_area`. Out:
//! rows of an octahedral level, four texels mixed. Arc tangents are a polynomial of + and * alone.

const std = @import("std");
const decode = @import("../../decode.zig");
const Level = @import("levels.zig").Level;
const math = @import("../../math.zig");
const Texel = @import("../../world.zig").EnvironmentTexel;
const assert = std.debug.assert;

const Projection = @import("../../scene.zig").EnvironmentMap.Projection;

const lane_count = 8;
const Lanes = @Vector(lane_count, f32);

/// Radiance of a texel at most.
const radiance_max = 1e9;

/// An image, rows from the top.
pub const Sky = struct {
    width: u32,
    height: u32,
    projection: Projection = .equirectangular,
    /// More of them where it has been shrunk.
    texels: []Texel,

    /// Of decoded texels, whose bytes are codes of sRGB. Frees nothing. An octahedral image has to
    /// be a square.
    pub fn init(
        gpa: std.mem.Allocator,
        from: *const decode.Texels,
        projection: Projection,
    ) error{OutOfMemory}!Sky {
        assert(projection != .octahedral or from.width == from.height);
        const texels = try gpa.alloc(Texel, @as(usize, from.width) * from.height);
        const channel_count = from.channel_count;
        // Grey, perhaps with alpha, or colour.
        const places: [3]usize = if (channel_count < 3) .{ 0, 0, 0 } else .{ 0, 1, 2 };
        for (texels, 0..) |*texel, index| {
            var color: [3]f32 = undefined;
            for (&color, places) |*channel, place| {
                const at_index = index * channel_count + place;
                channel.* = radiance(switch (from.data) {
                    .bytes => |bytes| math.srgb.decoded[bytes[at_index]],
                    .floats => |floats| floats[at_index],
                });
            }
            texel.* = .{ color[0], color[1], color[2], 0 };
        }
        return .{
            .width = from.width,
            .height = from.height,
            .projection = projection,
            .texels = texels,
        };
    }

    /// Frees everything.
    pub fn deinit(sky: *Sky, gpa: std.mem.Allocator) void {
        gpa.free(sky.texels);
        sky.* = undefined;
    }

    /// Texels along the sides of an octahedral level whose texels are nowhere much wider.
    pub fn levelSize(sky: *const Sky, size_min: u32, size_max: u32) u32 {
        const enough = if (sky.projection == .octahedral) sky.width else 2 * sky.width;
        var size = size_min;
        while (size < size_max and size < enough) size *= 2;
        return size;
    }

    /// Halves an image in place that is wider than a level can hold, and so often that it no more
    /// is. Nothing where a side is odd.
    pub fn shrink(sky: *Sky, width_max: u32) void {
        while (sky.width > width_max and sky.width % 2 == 0 and sky.height % 2 == 0) {
            const width = sky.width / 2;
            for (0..sky.height / 2) |row| for (0..width) |column| {
                const upper = sky.texels[2 * row * sky.width + 2 * column ..][0..2];
                const lower = sky.texels[(2 * row + 1) * sky.width + 2 * column ..][0..2];
                const sum = (upper[0] + upper[1]) + (lower[0] + lower[1]);
                // What is written has been read.
                sky.texels[row * width + column] = sum * @as(Texel, @splat(0.25));
            };
            sky.width = width;
            sky.height /= 2;
        }
    }

    /// Fills a row of a level.
    pub fn resampleRow(sky: *const Sky, level: Level, row: usize) void {
        if (sky.projection == .octahedral) return sky.resampleRowOfSquare(level, row);
        assert(level.size % lane_count == 0);
        var column: usize = 0;
        while (column < level.size) : (column += lane_count) {
            var point: [3][lane_count]f32 = undefined;
            for (0..lane_count) |lane| {
                const middle = level.pointAt(column + lane, row);
                for (&point, middle) |*axis, component| axis[lane] = component;
            }
            const x: Lanes = point[0];
            const y: Lanes = point[1];
            const z: Lanes = point[2];
            const pi: Lanes = @splat(std.math.pi);
            const u = arcTangent(z, x) / (pi + pi) + @as(Lanes, @splat(0.5));
            const v = arcTangent(@sqrt(x * x + z * z), y) / pi;
            const columns: [lane_count]f32 = u;
            const rows: [lane_count]f32 = v;
            for (columns, rows, 0..) |across, down, lane| {
                level.at(column + lane, row).* = sky.at(across, down);
            }
        }
    }

    fn resampleRowOfSquare(sky: *const Sky, level: Level, row: usize) void {
        for (0..level.size) |column| {
            const point = level.pointAt(column, row);
            const direction = math.vec3d.normalize(.{ point[0], point[1], point[2] }).?;
            level.at(column, row).* = sky.atSquare(math.equal_area.toSquare(direction));
        }
    }

    /// Four texels mixed, across the edges of the square.
    fn atSquare(sky: *const Sky, place: [2]f64) Texel {
        const side: f64 = @floatFromInt(sky.width);
        const across = place[0] * side - 0.5;
        const down = place[1] * side - 0.5;
        const column: i64 = @intFromFloat(@floor(across));
        const row: i64 = @intFromFloat(@floor(down));
        const share_right: Texel = @splat(@floatCast(across - @floor(across)));
        const share_below: Texel = @splat(@floatCast(down - @floor(down)));
        var mixed: [2]Texel = undefined;
        for (&mixed, [2]i64{ row, row + 1 }) |*to, at_row| {
            const left = sky.texelOfSquare(column, at_row);
            const right = sky.texelOfSquare(column + 1, at_row);
            to.* = left + (right - left) * share_right;
        }
        return mixed[0] + (mixed[1] - mixed[0]) * share_below;
    }

    /// A texel of the square or of the ring around it: each edge goes on in its other half.
    fn texelOfSquare(sky: *const Sky, column: i64, row: i64) Texel {
        const last: i64 = sky.width - 1;
        var x = column;
        var y = row;
        if (x < 0 or x > last) {
            x = if (x < 0) 0 else last;
            y = last - y;
        }
        if (y < 0 or y > last) {
            y = if (y < 0) 0 else last;
            x = last - x;
        }
        return sky.texels[@intCast(y * (last + 1) + x)];
    }

    /// Four texels mixed, around the image to the sides.
    fn at(sky: *const Sky, u: f32, v: f32) Texel {
        const width: f32 = @floatFromInt(sky.width);
        const height: f32 = @floatFromInt(sky.height);
        // From the middle of the last texel of the row before on.
        const across = u * width + 0.5;
        const down = @min(@max(v * height - 0.5, 0), height - 1);
        const right: u32 = @intFromFloat(across);
        const row: u32 = @intFromFloat(down);
        const next_column = if (right < sky.width) right else right - sky.width;
        const column = if (next_column > 0) next_column - 1 else sky.width - 1;
        const next_row = @min(row + 1, sky.height - 1);
        const share_right: Texel = @splat(across - @as(f32, @floatFromInt(right)));
        const share_below: Texel = @splat(down - @as(f32, @floatFromInt(row)));
        const upper = sky.texels[row * sky.width ..];
        const lower = sky.texels[next_row * sky.width ..];
        const above = upper[column] + (upper[next_column] - upper[column]) * share_right;
        const below = lower[column] + (lower[next_column] - lower[column]) * share_right;
        return above + (below - above) * share_below;
    }
};

/// Radiance as it may be: finite and not negative.
fn radiance(value: f32) f32 {
    if (!(value > 0)) return 0;
    return math.flushDenormal(if (value < radiance_max) value else radiance_max);
}

/// Angle of (x, y) from the x axis, -pi..pi, to 1e-7 (Abramowitz and Stegun 1964, 4.4.49).
fn arcTangent(y: Lanes, x: Lanes) Lanes {
    const coefficients = [_]f32{
        0.0028662257, -0.0161657367, 0.0429096138, -0.0752896400,
        0.1065626393, -0.1420889944, 0.1999355085, -0.3333314528,
        1,
    };
    const zero: Lanes = @splat(0);
    const size_x = @abs(x);
    const size_y = @abs(y);
    const is_steep = size_y > size_x;
    const larger = @select(f32, is_steep, size_y, size_x);
    const smaller = @select(f32, is_steep, size_x, size_y);
    const ratio = smaller / @select(f32, larger > zero, larger, @as(Lanes, @splat(1)));
    const squared = ratio * ratio;
    var sum: Lanes = @splat(coefficients[0]);
    inline for (coefficients[1..]) |next| sum = sum * squared + @as(Lanes, @splat(next));
    const flat = sum * ratio;
    const steep = @as(Lanes, @splat(std.math.pi / 2.0)) - flat;
    const first = @select(f32, is_steep, steep, flat);
    const upper = @select(f32, x < zero, @as(Lanes, @splat(std.math.pi)) - first, first);
    return @select(f32, y < zero, -upper, upper);
}

test "a square is looked up without a seam" {
    const gpa = std.testing.allocator;
    const side = 64;
    const texels = try gpa.alloc(Texel, side * side);
    defer gpa.free(texels);
    for (texels, 0..) |*texel, index| {
        const direction = math.equal_area.fromSquare(.{
            (@as(f64, @floatFromInt(index % side)) + 0.5) / side,
            (@as(f64, @floatFromInt(index / side)) + 0.5) / side,
        });
        inline for (direction, 0..) |component, axis| texel[axis] = @floatCast(1 + component);
        texel[3] = 0;
    }
    const sky: Sky = .{
        .width = side,
        .height = side,
        .projection = .octahedral,
        .texels = texels,
    };
    var random_state: std.Random.DefaultPrng = .init(11);
    const random = random_state.random();
    for (0..2000) |_| {
        var point: math.Vec3d = undefined;
        for (&point) |*component| component.* = random.float(f64) - 0.5;
        const direction = math.vec3d.normalize(point) orelse continue;
        const found = sky.atSquare(math.equal_area.toSquare(direction));
        inline for (direction, 0..) |component, axis| {
            try std.testing.expectApproxEqAbs(1 + component, found[axis], 0.03);
        }
    }
}

test "angles all around" {
    for (0..100) |index| {
        const angle = (@as(f32, @floatFromInt(index)) + 0.5) / 100 * 2 * std.math.pi - std.math.pi;
        const found = arcTangent(@splat(3 * @sin(angle)), @splat(3 * @cos(angle)));
        try std.testing.expectApproxEqAbs(angle, found[0], 1e-6);
    }
    try std.testing.expectEqual(0, arcTangent(@splat(0), @splat(0))[0]);
}
