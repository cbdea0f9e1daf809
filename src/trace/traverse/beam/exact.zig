//! The exact triangle test where a beam is in doubt, and for what it has found.
//!
//! In: rays of a bundle, triangles by their slot. Out: whether and where one is hit, by
//! `triangle.zig` alone, so that beams give the bits that every other traversal gives.

const std = @import("std");
const world_file = @import("../../../world.zig");
const ray_file = @import("../ray.zig");
const triangle = @import("../triangle.zig");
const assert = std.debug.assert;

/// Where a triangle stands in the tree: pack times width plus lane. Of a ray without a hit: -1.
pub const Slot = i32;
/// See `Slot`.
pub const no_slot: Slot = -1;

/// The pack and lane of a slot.
inline fn place(comptime width: u32, slot: Slot) struct { pack: u32, lane: u32 } {
    const number: u32 = @intCast(slot);
    return .{ .pack = number / width, .lane = number % width };
}

/// Number of the triangle in a slot.
pub inline fn primitiveAt(
    comptime width: u32,
    tree: *const world_file.Tree(width),
    slot: Slot,
) i32 {
    const at = place(width, slot);
    return @bitCast(tree.packs[at.pack].primitive[at.lane]);
}

/// A corner of the triangle in a slot.
inline fn cornerAt(
    comptime width: u32,
    tree: *const world_file.Tree(width),
    slot: Slot,
    corner: usize,
) [3]f32 {
    const at = place(width, slot);
    const components = &tree.packs[at.pack].corner[corner];
    return .{ components[0][at.lane], components[1][at.lane], components[2][at.lane] };
}

/// The corners of the triangle in a slot, the same in all lanes.
pub inline fn splat(
    comptime Kernel: type,
    tree: *const world_file.Tree(Kernel.width),
    slot: Slot,
) [3]Kernel.Rays.Vec3 {
    var corners: [3]Kernel.Rays.Vec3 = undefined;
    inline for (&corners, 0..) |*corner, index| {
        corner.* = .splat(cornerAt(Kernel.width, tree, slot, index));
    }
    return corners;
}

/// The exact test of a group's rays with the triangle in a slot.
pub fn meet(
    comptime Kernel: type,
    geometry: *const world_file.Geometry,
    group: *const ray_file.Ray(Kernel.Rays),
    slot: Slot,
) triangle.WeightedIntersection(Kernel.Rays) {
    @branchHint(.cold);
    const corners = splat(Kernel, geometry.tree.get(Kernel.width), slot);
    return triangle.intersect(Kernel.Rays, corners, group.line, &geometry.padding);
}

/// Of rays that hit the triangle in `slot` at `t`, those whose own triangles in `others` do not
/// come first, in the order of `ray.Hit`. Rays without one have no slot; the others do hit theirs.
pub fn comeFirst(
    comptime Kernel: type,
    geometry: *const world_file.Geometry,
    group: *const ray_file.Ray(Kernel.Rays),
    rays: Kernel.Rays.Mask,
    t: Kernel.Rays.F32,
    slot: Slot,
    others: *const [Kernel.ray_count]Slot,
) Kernel.Rays.Mask {
    @branchHint(.cold);
    const Rays = Kernel.Rays;
    const met = rays.bitAnd(Rays.I32.load(others).gt(.splat(no_slot)));
    if (met.none()) return rays;
    const tree = geometry.tree.get(Kernel.width);
    const gathered = gather(Kernel, tree, others);
    const other = triangle.intersect(Rays, gathered.corners, group.line, &geometry.padding);
    assert(met.andNot(other.mask).none());
    const number: Rays.I32 = .splat(primitiveAt(Kernel.width, tree, slot));
    const first = t.lt(other.t).bitOr(t.eq(other.t).bitAnd(gathered.primitive.gt(number)));
    return rays.andNot(met.andNot(first));
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
