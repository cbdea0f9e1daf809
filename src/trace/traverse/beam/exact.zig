//! The exact triangle test where a beam is in doubt, and for what it has found.
//!
//! In: rays of a bundle, triangles by their slot. Out: whether and where one is hit, by
//! `triangle.zig` alone, so that beams give the bits that every other traversal gives.

const std = @import("std");
const world_file = @import("../../../world.zig");
const ray_file = @import("../ray.zig");
const triangle = @import("../triangle.zig");
const assert = std.debug.assert;

/// Where a triangle stands in the tree: pack times width plus lane. Behind all of these, those of
/// instances by their number. Of a ray without a hit: -1.
pub const Slot = i32;
/// See `Slot`.
pub const no_slot: Slot = -1;

/// Stands for the slots of a pack that is not the tree's own.
const mapped: Slot = -2;

/// The first slot of a pack.
pub inline fn firstSlot(
    comptime width: u32,
    tree: *const world_file.Tree(width),
    pack: *const world_file.TrianglePack(width),
) Slot {
    const Pack = world_file.TrianglePack(width);
    const offset = @intFromPtr(pack) -% @intFromPtr(tree.packs.ptr);
    if (offset >= tree.packs.len * @sizeOf(Pack)) return mapped;
    return @intCast(@divExact(offset, @sizeOf(Pack)) * width);
}

/// The slot of a triangle, by the first one of its pack.
pub inline fn slotOf(
    geometry: *const world_file.Geometry,
    comptime width: u32,
    first: Slot,
    lane: usize,
    primitive: i32,
) Slot {
    if (first == mapped) return ownCount(geometry, width) + primitive;
    return first + @as(Slot, @intCast(lane));
}

/// Slots of the tree's own packs.
inline fn ownCount(geometry: *const world_file.Geometry, comptime width: u32) Slot {
    return @intCast(geometry.tree.get(width).packs.len * width);
}

/// The number of a triangle of an instance; null: it is the tree's own.
inline fn sharedAt(geometry: *const world_file.Geometry, comptime width: u32, slot: Slot) ?u32 {
    if (geometry.shared.runs.len == 0) return null;
    const own_count = ownCount(geometry, width);
    return if (slot < own_count) null else @intCast(slot - own_count);
}

/// The pack and lane of a slot.
inline fn place(comptime width: u32, slot: Slot) struct { pack: u32, lane: u32 } {
    const number: u32 = @intCast(slot);
    return .{ .pack = number / width, .lane = number % width };
}

/// Number of the triangle in a slot.
pub inline fn primitiveAt(
    comptime width: u32,
    geometry: *const world_file.Geometry,
    slot: Slot,
) i32 {
    if (sharedAt(geometry, width, slot)) |number| return @intCast(number);
    const at = place(width, slot);
    return @bitCast(geometry.tree.get(width).packs[at.pack].primitive[at.lane]);
}

/// A corner of the triangle in a slot.
inline fn cornerAt(
    comptime width: u32,
    geometry: *const world_file.Geometry,
    slot: Slot,
    corner: usize,
) [3]f32 {
    if (sharedAt(geometry, width, slot)) |number|
        return geometry.face(number).position(geometry, corner);
    const at = place(width, slot);
    const components = &geometry.tree.get(width).packs[at.pack].corner[corner];
    return .{ components[0][at.lane], components[1][at.lane], components[2][at.lane] };
}

/// The corners of the triangle in a slot, the same in all lanes.
pub inline fn splat(
    comptime Kernel: type,
    geometry: *const world_file.Geometry,
    slot: Slot,
) [3]Kernel.Rays.Vec3 {
    var corners: [3]Kernel.Rays.Vec3 = undefined;
    inline for (&corners, 0..) |*corner, index| {
        corner.* = .splat(cornerAt(Kernel.width, geometry, slot, index));
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
    const corners = splat(Kernel, geometry, slot);
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
    const gathered = gather(Kernel, geometry, others);
    const other = triangle.intersect(Rays, gathered.corners, group.line, &geometry.padding);
    assert(met.andNot(other.mask).none());
    const number: Rays.I32 = .splat(primitiveAt(Kernel.width, geometry, slot));
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
    geometry: *const world_file.Geometry,
    slots: *const [Kernel.ray_count]Slot,
) Gathered(Kernel.Rays) {
    var components: [3][3][Kernel.ray_count]f32 = undefined;
    var numbers: [Kernel.ray_count]i32 = undefined;
    for (slots, 0..) |slot, lane| {
        const there = if (slot == no_slot) 0 else slot;
        inline for (&components, 0..) |*corner, index| {
            const position = cornerAt(Kernel.width, geometry, there, index);
            inline for (corner, position) |*component, value| component[lane] = value;
        }
        numbers[lane] = primitiveAt(Kernel.width, geometry, there);
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
