//! Resolution of a beam's hits, exactly: t of what each ray has found.
//!
//! In: a triangle's slot for each ray. Out: hits in the bundle, by the expressions of triangle.zig,
//! bit for bit. Rays of a beam mostly have the same longest axis and the same signs, and neighbours
//! hit the same triangle: then what depends on the triangle and a common origin alone is computed
//! once, and what is left for each ray are its slopes, three edge functions and one division.

const std = @import("std");
const world_file = @import("../../../world.zig");
const ray_file = @import("../ray.zig");
const bundle_file = @import("../bundle.zig");
const box = @import("../box.zig");
const triangle = @import("../triangle.zig");
const kernel_file = @import("../kernel.zig");
const edges_file = @import("edges.zig");
const exact = @import("exact.zig");
const TileDepthBuffer = @import("tile_depth_buffer.zig").TileDepthBuffer;
const Grid = @import("grid.zig").Grid;
const assert = std.debug.assert;

/// Puts the hits of the triangles found into the bundle.
pub fn resolve(
    comptime Kernel: type,
    geometry: *const world_file.Geometry,
    grid: *const Grid,
    buffer: *TileDepthBuffer(Kernel),
    bundle: *bundle_file.Bundle(Kernel),
) void {
    const course = Course.of(grid);
    switch (course.axis orelse 3) {
        inline 0...2 => |axis| {
            UniformOctant(Kernel, axis).run(geometry, &course, grid, buffer, bundle);
        },
        else => apart(Kernel, geometry, buffer, bundle),
    }
}

/// What the rays of a beam have in common.
const Course = struct {
    /// The longest axis of all, or null; then signs mean nothing.
    axis: ?u2,
    /// By axis, whether all directions point down it.
    negative: [3]bool,

    /// Directions are linear over the pixels, so that the corners tell.
    fn of(grid: *const Grid) Course {
        const last: f32 = kernel_file.beam_side - 1;
        var course: Course = .{ .axis = null, .negative = @splat(false) };
        const margin = 2 * edges_file.unit_roundoff * grid.deviation_ulps + 1e-20;
        for (0..4) |index| {
            var direction: [3]f32 = undefined;
            var longest: u2 = 0;
            for (&direction, grid.corner, grid.right, grid.down, 0..) |*to, d, right, down, axis| {
                to.* = d + (if (index & 1 == 0) 0 else last * right) +
                    (if (index & 2 == 0) 0 else last * down);
                if (@abs(to.*) > @abs(direction[longest])) longest = @intCast(axis);
            }
            if (index > 0 and course.axis != longest)
                return .{ .axis = null, .negative = undefined };
            course.axis = longest;
            for (direction, &course.negative, 0..) |component, *negative, axis| {
                const length = @abs(component);
                const shorter = axis == longest or length + margin < @abs(direction[longest]);
                const same = index == 0 or negative.* == (component < 0);
                if (!shorter or !same or !(length > margin))
                    return .{ .axis = null, .negative = undefined };
                negative.* = component < 0;
            }
        }
        return course;
    }
};

/// Every group with its own longest axes and signs.
fn apart(
    comptime Kernel: type,
    geometry: *const world_file.Geometry,
    buffer: *TileDepthBuffer(Kernel),
    bundle: *bundle_file.Bundle(Kernel),
) void {
    const Rays = Kernel.Rays;
    buffer.spreadAll();
    for (&bundle.groups, 0..) |*group, index| {
        const own = buffer.of("slot", index);
        const there = Rays.I32.loadAligned(own).gt(.splat(exact.no_slot));
        if (there.none()) continue;
        const gathered = exact.gather(Kernel, geometry, own);
        const hit = triangle.intersect(Rays, gathered.corners, group.line, &geometry.padding);
        assert(there.andNot(hit.mask).none());
        group.closest = .{
            .t = .select(there, hit.t, group.closest.t),
            .primitive = .select(there, gathered.primitive, group.closest.primitive),
        };
    }
}

/// All groups alike.
fn UniformOctant(comptime Kernel: type, comptime axis: u2) type {
    const Rays = Kernel.Rays;
    const F32 = Rays.F32;
    const Vec3 = Rays.Vec3;
    return struct {
        /// Triangles in lanes as seen from the rays' origin.
        const Placed = struct {
            /// Turned corners from the origin.
            offsets: [3]Vec3,
            /// Corners of the grown box from there.
            lower: Vec3,
            upper: Vec3,

            inline fn of(
                padding: *const world_file.Padding,
                corners: [3]Vec3,
                origin: [3]f32,
                shift_length: f32,
            ) Placed {
                const from: Vec3 = .splat(origin);
                const shift: Vec3 = .splat(@splat(shift_length));
                const a = turn(corners[0]);
                const b = turn(corners[1]);
                const c = turn(corners[2]);
                const center: Vec3 = .splat(turned(padding.center));
                const lower, const upper = triangle.boundsOf(Rays, .{ a, b, c }, padding, center);
                return .{
                    .offsets = .{ a.sub(from), b.sub(from), c.sub(from) },
                    .lower = lower.sub(from.add(shift)),
                    .upper = upper.sub(from.sub(shift)),
                };
            }
        };

        fn run(
            geometry: *const world_file.Geometry,
            course: *const Course,
            grid: *const Grid,
            buffer: *TileDepthBuffer(Kernel),
            bundle: *bundle_file.Bundle(Kernel),
        ) void {
            const padding = &geometry.padding;
            const origin = turned(grid.origin);
            const shift = padding.shiftOf(ray_file.Single, .splat(grid.origin)).lane(0);
            const down = turned(course.negative);
            var last: Last = .{};
            for (0..Kernel.subtile_count) |subtile| {
                const whole = buffer.isWhole(subtile);
                const subtile_slot = buffer.subtile_slot[subtile];
                if (whole and subtile_slot == exact.no_slot) continue;
                const first = subtile * Kernel.subtile_groups;
                for (first..first + Kernel.subtile_groups) |index| {
                    const group = &bundle.groups[index];
                    const own = buffer.of("slot", index);
                    const lanes: Rays.I32 = .loadAligned(own);
                    if (whole or lanes.eq(.splat(own[0])).all()) {
                        const slot = if (whole) subtile_slot else own[0];
                        if (slot == exact.no_slot) continue;
                        if (slot != last.slot) last = .{
                            .slot = slot,
                            .placed = .of(
                                padding,
                                exact.splat(Kernel, geometry, slot),
                                origin,
                                shift,
                            ),
                            .primitive = .splat(exact.primitiveAt(Kernel.width, geometry, slot)),
                        };
                        const hit = intersect(group, &last.placed, down, .splat(true));
                        group.closest = .{ .t = hit.t, .primitive = last.primitive };
                        continue;
                    }
                    const there = lanes.gt(.splat(exact.no_slot));
                    const gathered = exact.gather(Kernel, geometry, own);
                    const each: Placed = .of(padding, gathered.corners, origin, shift);
                    const hit = intersect(group, &each, down, there);
                    assert(there.andNot(hit.mask).none());
                    group.closest = .{
                        .t = .select(there, hit.t, group.closest.t),
                        .primitive = .select(there, gathered.primitive, group.closest.primitive),
                    };
                }
            }
        }

        /// The triangle that was met last, in all lanes: mostly the next rays meet it, too.
        const Last = struct {
            slot: exact.Slot = exact.no_slot,
            placed: Placed = undefined,
            primitive: Rays.I32 = undefined,
        };

        fn turned(values: anytype) @TypeOf(values) {
            return .{
                values[ray_file.turnedIndex(axis, 0)],
                values[ray_file.turnedIndex(axis, 1)],
                values[axis],
            };
        }

        inline fn turn(vector: Vec3) Vec3 {
            const components = turned([3]F32{ vector.x, vector.y, vector.z });
            return .{ .x = components[0], .y = components[1], .z = components[2] };
        }

        /// The hits of the rays in `found`.
        inline fn intersect(
            group: *const ray_file.Ray(Rays),
            placed: *const Placed,
            down: [3]bool,
            found: Rays.Mask,
        ) triangle.WeightedIntersection(Rays) {
            const direction = turn(group.line.direction);
            const one: F32 = .splat(1);
            const depth_inv = one.div(direction.z);
            const seen = triangle.projectOffsets(Rays, placed.offsets, .{
                .x = direction.x.div(direction.z),
                .y = direction.y.div(direction.z),
                .z = depth_inv,
            });
            var weights = triangle.edgeFunctions(Rays, seen);
            const inside = triangle.resolveTies(Rays, seen, &weights, group.active);
            const plane = triangle.locatePlane(Rays, seen, weights);
            const point = direction.scale(plane.t);
            if (found.andNot(isWithin(point, placed)).none()) return .{
                .mask = inside.bitAnd(plane.mask),
                .t = plane.t,
                .weights = weights,
            };
            const negative = [3]Rays.Mask{ .splat(down[0]), .splat(down[1]), .splat(down[2]) };
            const near = box.select3(Rays, negative, placed.upper, placed.lower);
            const far = box.select3(Rays, negative, placed.lower, placed.upper);
            const range = box.slab(Rays, near, far, .{
                .x = one.div(direction.x),
                .y = one.div(direction.y),
                .z = depth_inv,
            });
            const hit = triangle.locateWithin(Rays, seen, weights, range);
            return .{ .mask = inside.bitAnd(hit.mask), .t = hit.t, .weights = weights };
        }

        /// Points so far within the box that t is surely within the range that the slab test gives:
        /// that is off by 3 u of a face's distance, the point by 1 u, and no component is longer
        /// than the last. Spares two divisions.
        inline fn isWithin(point: Vec3, placed: *const Placed) Rays.Mask {
            const above = point.sub(placed.lower);
            const below = placed.upper.sub(point);
            const least = above.x.minOrNegative(above.y).minOrNegative(above.z)
                .minOrNegative(below.x.minOrNegative(below.y).minOrNegative(below.z));
            const margin = point.z.abs()
                .mulAdd(.splat(16 * edges_file.unit_roundoff), .splat(1e-36));
            return least.gt(margin);
        }
    };
}
