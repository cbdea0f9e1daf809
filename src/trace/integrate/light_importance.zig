//! How much candidates for virtual lights matter to what the camera sees (after Georgiev and
//! Slusallek 2010, "Simple and Robust Iterative Importance Sampling of Virtual Point Lights").
//!
//! In: candidates (`light_paths.zig`). Out: their weights. Of what a candidate gives the points
//! that the camera sees four shadow rays, to those that get much of it, say how much arrives. It
//! matters by its shares of what all give each point, squared and summed: chosen by the root of
//! that the variance is least, as a share of the light that there is.

const std = @import("std");
const world_file = @import("../../world.zig");
const math = @import("../../math.zig");
const bundle_file = @import("../traverse/bundle.zig");
const ray_file = @import("../traverse/ray.zig");
const dispatch = @import("../traverse/dispatch.zig");
const camera = @import("camera.zig");
const ByLane = @import("by_lane.zig").ByLane;
const Candidate = @import("virtual_lights.zig").Candidate;
const Grid = @import("light_correction.zig").Grid;
const LightPaths = @import("light_paths.zig").LightPaths;
const vec3 = math.vec3;
const Vec3 = math.Vec3;

/// Points that candidates are weighed by, along the long side of a picture, and their factor in a
/// picture of so many pixels there.
const points_side = 16;
const dense_max = 2;
const dense_pixels = 512;
/// Points that the camera sees, at most, and those that candidates are weighed by.
pub const point_max = few_max * dense_max * dense_max;
pub const few_max = points_side * points_side;
/// Shadow rays of a candidate.
const shadow_count = 4;
/// Candidates of a piece of work.
pub const piece_candidates = 256 / shadow_count;
/// Share of what a candidate would give that counts though no shadow ray found it to: one that is
/// chosen all the same gets by so much more flux, and is a bright spot on what it does light.
const hidden_share = 0.2;

/// Where points are in a picture: next to no pixel is one in small ones.
pub fn gridOf(view: *const world_file.View) Grid {
    const side = points_side * denseOf(view);
    const long: u32 = @max(view.width, view.height);
    return .{ .side = side, .step = @max(1, @min(long / 4, @max(2, long / side))) };
}

fn denseOf(view: *const world_file.View) u32 {
    const long: u32 = @max(view.width, view.height);
    return if (long < dense_pixels) 1 else dense_max;
}

/// A point that the camera sees.
pub const Point = struct {
    position: Vec3,
    normal: Vec3,
    primitive: i32,
    /// Luminance of what is seen of white light that falls on it.
    albedo: f32,
    /// Where in the grid it is seen.
    row: usize,
    column: usize,
    /// Points are in the order of rows, however rays are bundled; the few come first.
    order: usize = 0,

    fn isBefore(_: void, point: Point, other: Point) bool {
        return point.order < other.order;
    }

    fn sortBy(point: *Point, dense: usize) void {
        point.order = point.row * points_side * dense_max + point.column;
        if (!point.isOfFew(dense)) point.order += point_max;
    }

    fn isOfFew(point: *const Point, dense: usize) bool {
        return point.row % dense == 0 and point.column % dense == 0;
    }
};

/// What one thread's trees do for it.
pub fn LightImportance(comptime Kernel: type, comptime Tree: type) type {
    const Rays = Kernel.Rays;
    const I32 = Rays.I32;
    const V = Rays.Vec3;
    const lanes = Kernel.ray_count;
    const batch = Kernel.group_count * lanes;
    const Lane3 = ByLane(Rays);
    return struct {
        /// Finds points that the camera sees, evenly over the picture. Returns how many.
        pub fn see(tree: *Tree, points: *[point_max]Point) usize {
            const view = tree.frame.view;
            const grid = gridOf(view);
            const step = grid.step;
            var count: usize = 0;
            for (0..grid.side / Kernel.bundle_height) |row| {
                for (0..grid.side / Kernel.bundle_width) |column| {
                    const x: u32 = @intCast(column * Kernel.bundle_width * step + step / 2);
                    const y: u32 = @intCast(row * Kernel.bundle_height * step + step / 2);
                    if (x >= view.width or y >= view.height) continue;
                    camera.primaryRays(Kernel, view, .{
                        .x0 = x,
                        .y0 = y,
                        .x1 = view.width,
                        .y1 = view.height,
                        .step = step,
                    }, .{ .x = 0.5, .y = 0.5 }, &tree.path.bundle);
                    LightPaths(Kernel, Tree).start(tree);
                    _ = tree.visibility.closest(&tree.path, null);
                    for (&tree.vertices, 0..) |*vertex, group| {
                        vertex.find(&tree.visibility, &tree.path, group);
                        if (vertex.seen.none()) continue;
                        const more = points[count..];
                        const corner = [2]usize{
                            column * Kernel.bundle_width, row * Kernel.bundle_height,
                        };
                        count += takePoints(tree, group, corner, more);
                    }
                }
            }
            const dense = denseOf(view);
            for (points[0..count]) |*point| point.sortBy(dense);
            std.mem.sort(Point, points[0..count], {}, Point.isBefore);
            return count;
        }

        /// Those that candidates are weighed by.
        pub fn fewOf(tree: *const Tree, points: []const Point) []const Point {
            const dense = denseOf(tree.frame.view);
            const count = for (points, 0..) |*point, index| {
                if (!point.isOfFew(dense)) break index;
            } else points.len;
            return points[0..count];
        }

        fn takePoints(
            tree: *const Tree,
            group: usize,
            corner: [2]usize,
            points: []Point,
        ) usize {
            const vertex = &tree.vertices[group];
            const point = &vertex.point;
            const albedo = vertex.throughput
                .mul(vertex.bsdf.diffuse_albedo.add(vertex.bsdf.specular_albedo))
                .dot(.splat(.{ 0.2126, 0.7152, 0.0722 })).toArray();
            const off = Lane3.of(point.offsetOrigin(point.normal_geometric, .zero()));
            const normal = Lane3.of(point.normal_geometric);
            const primitive = tree.path.bundle.groups[group].closest.primitive.toArray();
            const lit = vertex.seen.andNot(point.material.unlit);
            var count: usize = 0;
            for (0..lanes) |lane| {
                if (!lit.lane(lane)) continue;
                points[count] = .{
                    .position = off.at(lane),
                    .normal = normal.at(lane),
                    .primitive = primitive[lane],
                    .albedo = albedo[lane],
                    .row = corner[1] + Kernel.pixelY(group, lane),
                    .column = corner[0] + Kernel.pixelX(group, lane),
                };
                count += 1;
            }
            return count;
        }

        /// Makes the share of what some candidates would give that arrives their weights, and adds
        /// what the points get of them to `sums`.
        pub fn weigh(
            tree: *Tree,
            points: []const Point,
            candidates: []Candidate,
            radius: f32,
            sums: *[few_max]f64,
        ) void {
            var first: usize = 0;
            const step = @max(1, batch / shadow_count);
            while (first < candidates.len) : (first += step) {
                const some = candidates[first..@min(first + step, candidates.len)];
                if (batch < shadow_count)
                    weighOne(tree, points, &some[0], radius, sums)
                else
                    weighBatch(tree, points, some, radius, sums);
            }
        }

        fn weighBatch(
            tree: *Tree,
            points: []const Point,
            candidates: []Candidate,
            radius: f32,
            sums: *[few_max]f64,
        ) void {
            var rays: Shadows = .none;
            for (candidates, 0..) |*candidate, index| {
                for (targetsOf(points, candidate, radius), 0..) |chosen, part| {
                    if (chosen) |point| rays.put(index * shadow_count + part, candidate, point);
                }
            }
            const shares = rays.trace(tree, &any_point, .none);
            for (candidates, 0..) |*candidate, index| {
                const of_it = shares[index * shadow_count ..][0..shadow_count];
                addGains(points, candidate, radius, of_it, sums);
            }
        }

        /// What points get of a candidate, as luminance.
        pub fn measure(
            tree: *Tree,
            points: []const Point,
            candidate: *const Candidate,
            gains: []f32,
        ) void {
            const luminance: f32 = @floatCast(candidate.luminance());
            const radius = @sqrt(candidate.disk);
            @memset(gains, 0);
            var first: usize = 0;
            while (first < points.len) : (first += batch) {
                const some = points[first..@min(first + batch, points.len)];
                const own = gains[first..][0..some.len];
                var rays: Shadows = .none;
                var is_dark = true;
                for (some, own, 0..) |*point, *gain, at| {
                    gain.* = luminance * gainOf(point, candidate, radius);
                    if (!(gain.* > 0)) continue;
                    rays.put(at, candidate, point);
                    is_dark = false;
                }
                if (is_dark) continue;
                var from = any_point;
                from.position = candidate.position;
                from.from_receiver = tree.frame.geometry.isCoarseAt(candidate.position);
                const shares = rays.trace(tree, &from, .all);
                for (own, shares[0..own.len]) |*gain, share| gain.* *= share;
            }
        }

        /// `weighBatch` of one by one, in bundles that are too small.
        fn weighOne(
            tree: *Tree,
            points: []const Point,
            candidate: *Candidate,
            radius: f32,
            sums: *[few_max]f64,
        ) void {
            var shares: [shadow_count]f32 = @splat(0);
            for (targetsOf(points, candidate, radius), &shares) |chosen, *share| {
                var rays: Shadows = .none;
                if (chosen) |point| rays.put(0, candidate, point);
                share.* = rays.trace(tree, &any_point, .none)[0];
            }
            addGains(points, candidate, radius, &shares, sums);
        }

        /// Shadow rays of a bundle, each from another candidate.
        const Shadows = struct {
            origin: [Kernel.group_count]Lane3,
            target: [Kernel.group_count]Lane3,
            skip: [Kernel.group_count][lanes]i32,
            active: [Kernel.group_count]u32,

            const none: Shadows = .{
                .origin = @splat(.splat(.{ 0, 0, 0 })),
                .target = @splat(.splat(.{ 1, 1, 1 })),
                .skip = @splat(@splat(ray_file.no_primitive)),
                .active = @splat(0),
            };

            fn put(
                rays: *Shadows,
                at: usize,
                candidate: *const Candidate,
                point: *const Point,
            ) void {
                const group = at / lanes;
                const lane = at % lanes;
                rays.origin[group].put(lane, candidate.position);
                rays.target[group].put(lane, point.position);
                rays.skip[group][lane] = point.primitive;
                rays.active[group] |= @as(u32, 1) << @intCast(lane);
            }

            /// Luminance of what arrives, as a share. Coherent ones come from the light's place.
            fn trace(
                rays: *const Shadows,
                tree: *Tree,
                light: *const world_file.Light,
                coherence: dispatch.Coherence,
            ) [batch]f32 {
                var shares: [batch]f32 = @splat(0);
                var bundle: bundle_file.Bundle(Kernel) = undefined;
                for (&bundle.groups, 0..) |*ray, group| {
                    const origin = rays.origin[group].toLanes();
                    const way = rays.target[group].toLanes().sub(origin);
                    const skip: I32 = .fromArray(rays.skip[group]);
                    ray.* = .endless(.init(origin, way), skip, .fromBits(rays.active[group]));
                    ray.closest = .before(.splat(1));
                    tree.vertices[group].point.cone_width = .zero();
                }
                var arriving: [Kernel.group_count]V = undefined;
                tree.visibility
                    .transmittance(&bundle, light, &tree.vertices, coherence, &arriving);
                for (arriving, rays.active, 0..) |share, active, group| {
                    if (active == 0) continue;
                    const seen = share.dot(.splat(.{ 0.2126, 0.7152, 0.0722 })).toArray();
                    for (0..lanes) |lane| {
                        if (active >> @intCast(lane) & 1 == 0) continue;
                        shares[group * lanes + lane] = seen[lane];
                    }
                }
                return shares;
            }
        };
    };
}

/// What a point gets of each unit of a candidate's flux, in any unit, where nothing is in the way:
/// a disk of this radius bounds what is near.
inline fn gainOf(point: *const Point, candidate: *const Candidate, radius: f32) f32 {
    const way = vec3.sub(point.position, candidate.position);
    const squared = vec3.dot(way, way);
    const leaving = vec3.dot(way, candidate.normal);
    const arriving = -vec3.dot(way, point.normal);
    if (!(leaving > 0 and arriving > 0)) return 0;
    return point.albedo * leaving * arriving / (squared * (squared + radius * radius));
}

/// The points that a candidate's shadow rays go to.
fn targetsOf(
    points: []const Point,
    candidate: *const Candidate,
    radius: f32,
) [shadow_count]?*const Point {
    var gains: [few_max]f32 = undefined;
    var total: f64 = 0;
    for (points, gains[0..points.len]) |*point, *gain| {
        gain.* = gainOf(point, candidate, radius);
        total += gain.*;
    }
    var targets: [shadow_count]?*const Point = @splat(null);
    if (!(total > 0)) return targets;
    for (&targets, 0..) |*target, index| {
        const share = (@as(f64, @floatFromInt(index)) + 0.5) / shadow_count;
        var left = share * total;
        for (points, gains[0..points.len]) |*point, gain| {
            if (gain == 0) continue;
            target.* = point;
            left -= gain;
            if (left < 0) break;
        }
    }
    return targets;
}

/// Makes the share of a candidate's light that arrives its weight, and adds what points get of it.
fn addGains(
    points: []const Point,
    candidate: *Candidate,
    radius: f32,
    shares: *const [shadow_count]f32,
    sums: *[few_max]f64,
) void {
    var arriving: f64 = 0;
    for (shares) |share| arriving += share;
    candidate.weight = hidden_share + (1 - hidden_share) * arriving / shadow_count;
    const flux = candidate.luminance() * candidate.weight;
    for (points, sums[0..points.len]) |*point, *sum|
        sum.* += flux * gainOf(point, candidate, radius);
}

/// Part of what points get in the mean that is added to what each gets: where there is next to no
/// light at all it is not seen how much.
const least_share = 0.1;

/// Turns what each point gets into what its shares count.
pub fn invertGains(sums: []f64) void {
    var total: f64 = 0;
    for (sums) |sum| total += sum;
    const least = least_share * total / @as(f64, @floatFromInt(@max(1, sums.len)));
    for (sums) |*sum| sum.* = if (least > 0) 1 / (sum.* + least) else 0;
}

/// Gives candidates whose weights say how much arrives their final ones.
pub fn finishWeights(
    points: []const Point,
    inverse_gains: []const f64,
    candidates: []Candidate,
    radius: f32,
) void {
    for (candidates) |*candidate| {
        var squares: f64 = 0;
        for (points, inverse_gains[0..points.len]) |*point, inverse| {
            const share = gainOf(point, candidate, radius) * inverse;
            squares += share * share;
        }
        candidate.weight *= candidate.luminance() * @sqrt(squares);
    }
}

/// Stands for where shadow rays come from, of which only the kind counts.
const any_point: world_file.Light = .{
    .kind = .point,
    .from_receiver = false,
    .position = @splat(0),
    .direction = .{ 0, 0, -1 },
    .intensity = @splat(0),
    .range_inv_squared = 0,
    .cone_scale = 0,
    .cone_offset = 1,
};
