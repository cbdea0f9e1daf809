//! The exact test where a beam is in doubt, and for what it has found.
//!
//! In: rays of a bundle, triangles by their slot. Out: whether and where one is hit, by
//! `triangle.zig` alone, so that beams give the bits that every other traversal gives.

const std = @import("std");
const world_file = @import("../../world.zig");
const ray_file = @import("../ray.zig");
const triangle = @import("../triangle.zig");
const assert = std.debug.assert;

/// Where a triangle stands in the tree: block times width plus lane. Of a ray without a hit: -1.
pub const Slot = i32;
/// See `Slot`.
pub const no_slot: Slot = -1;

/// The block and lane of a slot.
pub inline fn place(comptime width: u32, slot: Slot) struct { block: u32, lane: u32 } {
    const number: u32 = @intCast(slot);
    return .{ .block = number / width, .lane = number % width };
}

/// Number of the triangle in a slot.
pub inline fn primitiveAt(
    comptime width: u32,
    tree: *const world_file.Tree(width),
    slot: Slot,
) i32 {
    const at = place(width, slot);
    return @bitCast(tree.blocks[at.block].primitive[at.lane]);
}

/// A corner of the triangle in a slot.
pub inline fn cornerAt(
    comptime width: u32,
    tree: *const world_file.Tree(width),
    slot: Slot,
    corner: usize,
) [3]f32 {
    const at = place(width, slot);
    const components = &tree.blocks[at.block].corner[corner];
    return .{ components[0][at.lane], components[1][at.lane], components[2][at.lane] };
}

/// t of the exact hit of one ray with the triangle in a slot, or null.
pub fn hitAt(
    comptime Kernel: type,
    tree: *const world_file.Tree(Kernel.width),
    pad: f32,
    group: *const ray_file.Ray(Kernel.Rays),
    lane: usize,
    slot: Slot,
) ?f32 {
    @branchHint(.cold);
    const Single = ray_file.Single;
    const line: ray_file.Line(Single) = .init(
        .splat(group.line.origin.lane(lane)),
        .splat(group.line.direction.lane(lane)),
    );
    var corners: [3]Single.Vec3 = undefined;
    for (&corners, 0..) |*corner, index| {
        corner.* = .splat(cornerAt(Kernel.width, tree, slot, index));
    }
    const hit = triangle.intersect(Single, corners, line, pad);
    return if (hit.mask.lane(0)) hit.t.lane(0) else null;
}

/// Where rays pass within the edges of a triangle, and where they hit it.
pub fn Meeting(comptime Lanes: type) type {
    return struct { inside: Lanes.Mask, mask: Lanes.Mask, t: Lanes.F32 };
}

/// The exact test of some rays of a group with the triangle in a slot.
pub fn meet(
    comptime Kernel: type,
    tree: *const world_file.Tree(Kernel.width),
    pad: f32,
    group: *const ray_file.Ray(Kernel.Rays),
    rays: Kernel.Rays.Mask,
    slot: Slot,
) Meeting(Kernel.Rays) {
    @branchHint(.cold);
    const Rays = Kernel.Rays;
    const axis: ray_file.LongAxis(Rays) = .of(group.line.direction);
    const view: ray_file.View(Rays) = .init(group.line, axis);
    var corners: [3]Rays.Vec3 = undefined;
    for (&corners, 0..) |*corner, index| {
        corner.* = axis.turn(.splat(cornerAt(Kernel.width, tree, slot, index)));
    }
    const seen = triangle.project(Rays, corners, &view);
    var weights = triangle.weigh(Rays, seen);
    const agreeing = weights.agree().bitAnd(rays);
    const inside = triangle.settle(Rays, seen, &weights, agreeing);
    const hit = triangle.locate(Rays, seen, weights, corners, &view, pad);
    return .{ .inside = inside, .mask = hit.mask, .t = hit.t };
}

/// Whether one ray passes within the edges of the triangle in a slot, which is all that is left to
/// ask where the depth is certain.
pub fn insideAt(
    comptime Kernel: type,
    tree: *const world_file.Tree(Kernel.width),
    group: *const ray_file.Ray(Kernel.Rays),
    lane: usize,
    slot: Slot,
) bool {
    const Single = ray_file.Single;
    const direction = group.line.direction.lane(lane);
    const origin = group.line.origin.lane(lane);
    const along: ray_file.LongAxis(Single) = .of(.splat(direction));
    const axis = along.uniform(.splat(true)).?;
    const a = ray_file.turnedIndex(axis, 0);
    const b = ray_file.turnedIndex(axis, 1);
    const shear: Single.Vec3 = .splat(.{
        direction[a] / direction[axis], direction[b] / direction[axis], 1,
    });
    var offsets: [3]Single.Vec3 = undefined;
    for (&offsets, 0..) |*offset, index| {
        const corner = cornerAt(Kernel.width, tree, slot, index);
        offset.* = .splat(.{
            corner[a] - origin[a], corner[b] - origin[b], corner[axis] - origin[axis],
        });
    }
    const seen = triangle.projectOffsets(Single, offsets, shear);
    var weights = triangle.weigh(Single, seen);
    const agreeing = weights.agree();
    if (!agreeing.lane(0)) return false;
    return triangle.settle(Single, seen, &weights, agreeing).lane(0);
}

/// Corners and number of the triangle of each lane.
pub fn Gathered(comptime Lanes: type) type {
    return struct { corners: [3]Lanes.Vec3, primitive: Lanes.I32 };
}

/// The triangles in slots; of slot 0 in lanes where there is none.
pub inline fn gather(
    comptime Kernel: type,
    tree: *const world_file.Tree(Kernel.width),
    slots: *const [Kernel.ray_count]Slot,
) Gathered(Kernel.Rays) {
    var components: [3][3][Kernel.ray_count]f32 = undefined;
    var numbers: [Kernel.ray_count]i32 = undefined;
    for (slots, 0..) |slot, lane| {
        const there = if (slot == no_slot) 0 else slot;
        inline for (&components, 0..) |*corner, index| {
            const position = cornerAt(Kernel.width, tree, there, index);
            inline for (corner, position) |*component, value| component[lane] = value;
        }
        numbers[lane] = primitiveAt(Kernel.width, tree, there);
    }
    var gathered: Gathered(Kernel.Rays) = .{
        .corners = undefined,
        .primitive = .fromArray(numbers),
    };
    inline for (&gathered.corners, components) |*corner, component| corner.* = .{
        .x = .fromArray(component[0]),
        .y = .fromArray(component[1]),
        .z = .fromArray(component[2]),
    };
    return gathered;
}
