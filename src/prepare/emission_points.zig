//! Points on surfaces that emit, where virtual lights may be: some of many pieces, by their flux.
//!
//! In: a frame, whose surfaces are cut into pieces (`emitters.zig`). Out: lights of the kind
//! `emitter`, each a piece's middle just off its surface, with the flux of all pieces: one at each
//! of equal steps of it (systematic sampling), so that they are spread evenly over what emits.

const std = @import("std");
const emitters = @import("emitters.zig");
const vec3 = @import("../math.zig").vec3;
const vec3d = @import("../math.zig").vec3d;
const world = @import("../world.zig");
const Allocator = std.mem.Allocator;
const Piece = emitters.Piece;

/// Points at most.
const count_max = 1024;
/// How far off a piece its point is, in square roots of its area, and in sizes of the scene.
const lift = 1e-3;
const lift_least = 0x1p-18;

/// The points; the caller frees them.
pub fn find(gpa: Allocator, frame: *const world.Frame) error{OutOfMemory}![]const world.Light {
    const geometry = frame.geometry;
    const pieces = try emitters.find(gpa, geometry, frame.materials, frame.textures);
    defer gpa.free(pieces);
    return choose(gpa, pieces, geometry, count_max);
}

fn choose(
    gpa: Allocator,
    pieces: []const Piece,
    geometry: *const world.Geometry,
    most: usize,
) error{OutOfMemory}![]const world.Light {
    var total: f64 = 0;
    for (pieces) |*piece| total += piece.luminance();
    if (!(total > 0) or !std.math.isFinite(total)) return &.{};
    const count = @min(pieces.len, most);
    const step = total / @as(f64, @floatFromInt(count));
    var lights: std.ArrayList(world.Light) = try .initCapacity(gpa, count);
    defer lights.deinit(gpa);
    var sum: f64 = 0;
    var next: usize = 0;
    for (pieces) |*piece| {
        sum += piece.luminance();
        const first = next;
        while (next < count) : (next += 1) {
            if ((@as(f64, @floatFromInt(next)) + 0.5) * step >= sum) break;
        }
        // All where they are few.
        const flux = if (pieces.len <= most)
            piece.luminance()
        else
            @as(f64, @floatFromInt(next - first)) * step;
        if (flux > 0) lights.appendAssumeCapacity(lightOf(piece, flux, geometry));
    }
    return lights.toOwnedSlice(gpa);
}

fn lightOf(piece: *const Piece, flux: f64, geometry: *const world.Geometry) world.Light {
    const off = @max(lift * @sqrt(piece.area), lift_least * geometry.size);
    const position = vec3.add(piece.position, vec3.scale(piece.normal, off));
    const scale = flux / piece.luminance() / std.math.pi;
    return .{
        .kind = .emitter,
        .from_receiver = geometry.isCoarseAt(position),
        .position = position,
        .direction = piece.normal,
        .intensity = vec3d.toSingle(vec3d.scale(piece.flux, scale)),
        .range_inv_squared = 0,
        .cone_scale = 1,
        .cone_offset = 0,
    };
}

test "points have the flux of all pieces, more of them where there is more" {
    const gpa = std.testing.allocator;
    var pieces: [100]Piece = undefined;
    for (&pieces, 0..) |*piece, index| piece.* = .{
        .position = .{ @floatFromInt(index), 0, 0 },
        .normal = .{ 0, 1, 0 },
        .flux = @splat(if (index < 50) 3 else 1),
        .area = 1,
        .radius = 1,
    };
    var geometry: world.Geometry = .empty;
    geometry.size = 1;
    for ([_]usize{ 100, 20 }) |most| {
        const lights = try choose(gpa, &pieces, &geometry, most);
        defer gpa.free(lights);
        var flux: f64 = 0;
        var before: usize = 0;
        for (lights) |*light| {
            flux += std.math.pi * light.intensity[0];
            before += @intFromBool(light.position[0] < 49.5);
            try std.testing.expect(light.position[1] > 0);
        }
        try std.testing.expectApproxEqRel(200, flux, 1e-5);
        try std.testing.expectEqual(most, lights.len);
        try std.testing.expectEqual(@as(usize, if (most == 100) 50 else 15), before);
    }
    for (&pieces) |*piece| piece.flux = @splat(0);
    try std.testing.expectEqual(0, (try choose(gpa, &pieces, &geometry, 9)).len);
}
