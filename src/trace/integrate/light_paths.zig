//! Light paths of instant radiosity (Keller 1997), traced in bundles: what they leave on diffuse
//! surfaces, and how much of that the camera sees.
//!
//! In: where paths start (`light_emission.zig`). Out: candidates for virtual lights
//! (`virtual_lights.zig`), with the flux that leaves them and how much they matter. At a
//! surface a path goes straight on through what is clear, as shadow rays do, or leaves it by the
//! cosine or as a mirror would have it, or ends: by Russian roulette over what the surface does
//! with light, so that its flux keeps its colour. Of what a candidate gives
//! the points that the camera sees two shadow rays, to those that get much of it, say how much
//! arrives. It matters by its shares of what all give each point, squared and summed: chosen by the
//! root of that the variance is least, as a share of the light that there is.

const std = @import("std");
const world_file = @import("../../world.zig");
const math = @import("../../math.zig");
const bundle_file = @import("../traverse/bundle.zig");
const ray_file = @import("../traverse/ray.zig");
const bsdf_file = @import("../shade/bsdf.zig");
const camera = @import("camera.zig");
const emission = @import("light_emission.zig");
const Candidate = @import("virtual_lights.zig").Candidate;
const vec3 = math.vec3;
const Vec3 = math.Vec3;

/// Paths of a piece of work: as many as the largest bundle has rays.
pub const piece_paths = 256;
/// Surfaces that a path meets at most.
const segment_max = 8;
/// Candidates of a path at most.
pub const bounce_max = 6;
/// Points that the camera sees along each side of the picture.
const points_side = 16;
/// In all.
pub const point_max = points_side * points_side;
/// Shadow rays of a candidate.
const shadow_count = 2;
/// Candidates of a piece of work.
pub const piece_candidates = 256 / shadow_count;
/// Share of what a candidate would give that counts though no shadow ray found it to.
const hidden_share = 0.03;
/// Growth of a path's cone by distance: textures are averaged over what a virtual light stands for.
const cone_spread = 0.1;

comptime {
    std.debug.assert(4 + 3 * segment_max <= emission.number_count_max);
}

/// A point that the camera sees.
pub const Point = struct {
    position: Vec3,
    normal: Vec3,
    primitive: i32,
    /// Luminance of what is seen of white light that falls on it.
    albedo: f32,
};

/// What one thread's trees do for all.
pub fn LightPaths(comptime Kernel: type, comptime Tree: type) type {
    const Rays = Kernel.Rays;
    const F32 = Rays.F32;
    const I32 = Rays.I32;
    const Mask = Rays.Mask;
    const V = Rays.Vec3;
    const lanes = Kernel.ray_count;
    const batch = Kernel.group_count * lanes;
    return struct {
        /// Finds points that the camera sees, evenly over the picture. Returns how many.
        pub fn see(tree: *Tree, points: *[point_max]Point) usize {
            const view = tree.frame.view;
            const step = @max(1, @max(view.width, view.height) / points_side);
            var count: usize = 0;
            for (0..points_side / Kernel.bundle_height) |row| {
                for (0..points_side / Kernel.bundle_width) |column| {
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
                    start(tree);
                    _ = tree.visibility.closest(&tree.path, null);
                    for (&tree.vertices, 0..) |*vertex, group| {
                        vertex.find(&tree.visibility, &tree.path, group);
                        if (vertex.seen.any()) count += takePoints(tree, group, points[count..]);
                    }
                }
            }
            return count;
        }

        /// Before rays are traced that start outside of everything.
        fn start(tree: *Tree) void {
            const path = &tree.path;
            path.start();
            path.depth = 0;
            path.transparency_depth = 0;
            path.cone_width = @splat(.zero());
            path.cone_spread = @splat(.splat(cone_spread));
        }

        fn takePoints(tree: *const Tree, group: usize, points: []Point) usize {
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
                };
                count += 1;
            }
            return count;
        }

        /// Vectors lane by lane.
        const Lane3 = struct {
            x: [lanes]f32,
            y: [lanes]f32,
            z: [lanes]f32,

            fn of(v: V) Lane3 {
                return .{ .x = v.x.toArray(), .y = v.y.toArray(), .z = v.z.toArray() };
            }

            fn at(all: *const Lane3, lane: usize) Vec3 {
                return .{ all.x[lane], all.y[lane], all.z[lane] };
            }

            fn put(all: *Lane3, lane: usize, v: Vec3) void {
                all.x[lane] = v[0];
                all.y[lane] = v[1];
                all.z[lane] = v[2];
            }

            fn toLanes(all: *const Lane3) V {
                return .{
                    .x = .fromArray(all.x),
                    .y = .fromArray(all.y),
                    .z = .fromArray(all.z),
                };
            }
        };

        /// What paths under way are worth.
        const State = struct {
            flux: [batch]Vec3,
            /// Surfaces that it has left by another way than straight on.
            bounces: [batch]u32,
            /// Candidates that it has left.
            counts: [batch]u32,
        };

        /// Traces some paths; each fills in its candidates, from the first to where one has no
        /// flux.
        pub fn trace(
            tree: *Tree,
            sources: []const emission.Source,
            piece: u32,
            path_count: u32,
            candidates: [][bounce_max]Candidate,
        ) void {
            for (0..piece_paths / batch) |index| {
                const first: u32 = @intCast(piece * piece_paths + index * batch);
                if (first >= path_count) return;
                const end = @min(first + batch, path_count);
                for (candidates[first..end]) |*of_path| for (of_path) |*one| {
                    one.flux = @splat(0);
                };
                traceBatch(tree, sources, first, end, candidates);
            }
        }

        fn traceBatch(
            tree: *Tree,
            sources: []const emission.Source,
            first: u32,
            end: u32,
            candidates: [][bounce_max]Candidate,
        ) void {
            var state: State = undefined;
            const box = tree.frame.geometry.bounds;
            for (&tree.path.bundle.groups, 0..) |*ray, group| {
                var origin: Lane3 = undefined;
                var direction: Lane3 = undefined;
                var active: u32 = 0;
                for (0..lanes) |lane| {
                    const at = group * lanes + lane;
                    const path = first + @as(u32, @intCast(at));
                    origin.put(lane, @splat(0));
                    direction.put(lane, .{ 0, 0, 1 });
                    if (path >= end) continue;
                    var numbers: [4]f64 = undefined;
                    for (&numbers, 0..) |*number, dimension|
                        number.* = emission.numberOf(path, @intCast(dimension));
                    const one = emission.start(emission.sourceOf(sources, path), box, numbers);
                    origin.put(lane, one.origin);
                    direction.put(lane, one.direction);
                    state.flux[at] = one.flux;
                    state.bounces[at] = 0;
                    state.counts[at] = 0;
                    active |= @as(u32, 1) << @intCast(lane);
                }
                const line: ray_file.Line(Rays) = .init(origin.toLanes(), direction.toLanes());
                ray.* = .endless(line, .splat(ray_file.no_primitive), .fromBits(active));
            }
            start(tree);
            for (0..segment_max) |segment| {
                _ = tree.visibility.closest(&tree.path, null);
                var any_left = false;
                for (0..Kernel.group_count) |group| {
                    advance(tree, &state, group, @intCast(segment), first, candidates);
                    any_left = any_left or tree.path.bundle.groups[group].active.any();
                }
                if (!any_left) return;
            }
        }

        /// What the surfaces that rays of a group meet do with light, in lanes.
        const Surface = struct {
            albedo: Lane3,
            mirrored: Lane3,
            transmitted: Lane3,
            /// Share that comes to the surface and is not let past by its alpha.
            throughput: Lane3,
            opacity: [lanes]f32,
            position: Lane3,
            normal: Lane3,
            mirror: Lane3,
            primitive: [lanes]i32,
            seen: Mask,
            culled: Mask,

            fn of(tree: *Tree, group: usize, surface: *Surface) void {
                const vertex = &tree.vertices[group];
                const point = &vertex.point;
                const bsdf = &vertex.bsdf;
                // What is so rough that it looks diffuse counts as that.
                const rough = point.material.roughness.sub(.splat(0.25)).mul(.splat(2))
                    .max(.zero()).min(.splat(1));
                var albedo = bsdf.diffuse_albedo.add(bsdf.specular_albedo.scale(rough));
                if (bsdf.layered) albedo = albedo.add(bsdf.coating.sheen_albedo);
                const smooth = bsdf.specular_albedo.scale(F32.splat(1).sub(rough));
                surface.albedo = .of(albedo);
                surface.mirrored = .of(smooth);
                surface.transmitted = .of(bsdf.mirror.transmitted);
                surface.throughput = .of(vertex.throughput);
                surface.opacity = point.opacity.toArray();
                surface.position = .of(point.offsetOrigin(point.normal_geometric, .zero()));
                surface.normal = .of(point.normal_geometric);
                surface.mirror = .of(bsdf_file.reflect(Rays, point));
                surface.primitive = tree.path.bundle.groups[group].closest.primitive.toArray();
                surface.seen = vertex.seen.andNot(point.material.unlit);
                surface.culled = point.culled.bitOr(point.material.unlit);
            }
        };

        /// Leaves candidates where rays of a group end, and takes these on from there.
        fn advance(
            tree: *Tree,
            state: *State,
            group: usize,
            segment: u32,
            first: u32,
            candidates: [][bounce_max]Candidate,
        ) void {
            const path = &tree.path;
            const ray = &path.bundle.groups[group];
            const vertex = &tree.vertices[group];
            vertex.find(&tree.visibility, path, group);
            const missed = ray.closest.primitive.eq(.splat(ray_file.no_primitive));
            const hit = ray.active.andNot(missed);
            ray.active = hit;
            if (hit.none()) return;
            var surface: Surface = undefined;
            Surface.of(tree, group, &surface);
            var origin: Lane3 = .of(ray.line.origin);
            var direction: Lane3 = .of(ray.line.direction);
            var bent: u32 = 0;
            var straight: u32 = 0;
            var bits = hit.andNot(surface.culled).bits();
            while (bits != 0) : (bits &= bits - 1) {
                const lane: u5 = @intCast(@ctz(bits));
                const at = group * lanes + lane;
                const number = first + @as(u32, @intCast(at));
                const may_leave = state.counts[at] < bounce_max and
                    state.bounces[at] < tree.settings.depth_max;
                if (may_leave and surface.seen.lane(lane)) {
                    const arriving = vec3.mul(state.flux[at], surface.throughput.at(lane));
                    const flux = vec3.mul(arriving, surface.albedo.at(lane));
                    if (vec3.maxComponent(flux) > 0) {
                        candidates[number][state.counts[at]] = .{
                            .position = surface.position.at(lane),
                            .normal = surface.normal.at(lane),
                            .flux = flux,
                        };
                        state.counts[at] += 1;
                    }
                }
                switch (goOn(&surface, state, lane, at, number, segment)) {
                    .end => {},
                    .straight => straight |= @as(u32, 1) << lane,
                    .diffuse, .mirror => |way| {
                        const dimension = 4 + 3 * segment;
                        const around = emission.aroundNormal(surface.normal.at(lane), .{
                            emission.numberOf(number, dimension + 1),
                            emission.numberOf(number, dimension + 2),
                        });
                        origin.put(lane, surface.position.at(lane));
                        direction.put(lane, if (way == .mirror)
                            surface.mirror.at(lane)
                        else
                            math.vec3d.toSingle(around));
                        bent |= @as(u32, 1) << lane;
                    },
                }
            }
            const through: Mask = .fromBits(straight);
            passVolumes(tree, group, through);
            const next: ray_file.Ray(Rays) = .endless(
                .init(origin.toLanes(), direction.toLanes()),
                .select(through, ray.skip, ray.closest.primitive),
                .fromBits(bent | straight),
            );
            const passed = ray.closest;
            ray.* = next;
            ray.tnear.t = .select(through, passed.t, ray.tnear.t);
            ray.tnear.primitive = .select(through, passed.primitive, ray.tnear.primitive);
        }

        /// Takes rays that go straight on into what they enter.
        fn passVolumes(tree: *Tree, group: usize, through: Mask) void {
            if (tree.frame.materials.volumes.len == 0) return;
            const path = &tree.path;
            const point = &tree.vertices[group].point;
            const bounds = through.bitAnd(point.material.volume.bitOr(point.hidden));
            const sigma = &path.sigma_t[group];
            sigma.* = .select(bounds, point.sigma_beyond, sigma.*);
            var bits = bounds.bits();
            while (bits != 0) : (bits &= bits - 1) {
                const lane = @ctz(bits);
                path.nestings[group][lane] = point.beyond[lane];
            }
        }

        const Way = enum { end, straight, diffuse, mirror };

        /// Where a path goes on from a surface, and with what flux.
        fn goOn(
            surface: *const Surface,
            state: *State,
            lane: usize,
            at: usize,
            number: u32,
            segment: u32,
        ) Way {
            const flux = &state.flux[at];
            const past: Vec3 = @splat(1 - surface.opacity[lane]);
            const seen = surface.seen.lane(lane);
            const here: Vec3 = if (seen) surface.throughput.at(lane) else @splat(0);
            const shares = [_]Vec3{
                past,
                vec3.mul(here, surface.transmitted.at(lane)),
                vec3.mul(here, surface.mirrored.at(lane)),
                vec3.mul(here, surface.albedo.at(lane)),
            };
            const ways = [_]Way{ .straight, .straight, .mirror, .diffuse };
            var sum: f32 = 0;
            for (shares) |share| sum += vec3.maxComponent(share);
            const most: f64 = if (sum > 1) sum else 1;
            var left = emission.numberOf(number, 4 + 3 * segment) * most;
            for (shares, ways) |share, way| {
                const chance = vec3.maxComponent(share);
                left -= chance;
                if (left >= 0) continue;
                flux.* = vec3.scale(vec3.mul(flux.*, share), @floatCast(most / chance));
                if (way != .straight) state.bounces[at] += 1;
                return way;
            }
            return .end;
        }

        /// Finds how much of what some candidates would give arrives, their weights for now, and
        /// adds what the points get of them to `sums`.
        pub fn weigh(
            tree: *Tree,
            points: []const Point,
            candidates: []Candidate,
            radius: f32,
            sums: *[point_max]f64,
        ) void {
            var first: usize = 0;
            while (first < candidates.len) : (first += batch / shadow_count + batch % shadow_count) {
                if (batch < shadow_count) {
                    weighOne(tree, points, &candidates[first], radius, sums);
                    continue;
                }
                const end = @min(first + batch / shadow_count, candidates.len);
                weighBatch(tree, points, candidates[first..end], radius, sums);
            }
        }

        fn weighBatch(
            tree: *Tree,
            points: []const Point,
            candidates: []Candidate,
            radius: f32,
            sums: *[point_max]f64,
        ) void {
            var rays: Shadows = .none;
            for (candidates, 0..) |*candidate, index| {
                for (targetsOf(points, candidate, radius), 0..) |chosen, part| {
                    if (chosen) |point| rays.put(index * shadow_count + part, candidate, point);
                }
            }
            const shares = rays.trace(tree);
            for (candidates, 0..) |*candidate, index| {
                const of_it = shares[index * shadow_count ..][0..shadow_count];
                addGains(points, candidate, radius, of_it, sums);
            }
        }

        /// The same of one by one, in bundles that are too small.
        fn weighOne(
            tree: *Tree,
            points: []const Point,
            candidate: *Candidate,
            radius: f32,
            sums: *[point_max]f64,
        ) void {
            var shares: [shadow_count]f32 = @splat(0);
            for (targetsOf(points, candidate, radius), &shares) |chosen, *share| {
                var rays: Shadows = .none;
                if (chosen) |point| rays.put(0, candidate, point);
                share.* = rays.trace(tree)[0];
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
                .origin = @splat(.{ .x = @splat(0), .y = @splat(0), .z = @splat(0) }),
                .target = @splat(.{ .x = @splat(1), .y = @splat(1), .z = @splat(1) }),
                .skip = @splat(@splat(ray_file.no_primitive)),
                .active = @splat(0),
            };

            fn put(rays: *Shadows, at: usize, candidate: *const Candidate, point: *const Point) void {
                const group = at / lanes;
                const lane = at % lanes;
                rays.origin[group].put(lane, candidate.position);
                rays.target[group].put(lane, point.position);
                rays.skip[group][lane] = point.primitive;
                rays.active[group] |= @as(u32, 1) << @intCast(lane);
            }

            /// Luminance of what arrives, as a share.
            fn trace(rays: *const Shadows, tree: *Tree) [batch]f32 {
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
                    .transmittance(&bundle, &any_point, &tree.vertices, .none, &arriving);
                for (arriving, rays.active, 0..) |share, active, group| {
                    if (active == 0) continue;
                    const seen = share.dot(.splat(.{ 0.2126, 0.7152, 0.0722 })).toArray();
                    for (0..lanes) |lane| {
                        if (active >> @intCast(lane) & 1 != 0) shares[group * lanes + lane] = seen[lane];
                    }
                }
                return shares;
            }
        };
    };
}

/// What a point gets of each unit of a candidate's flux, in any unit, where nothing is in the way: a
/// disk of this radius bounds what is near.
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
    var gains: [point_max]f32 = undefined;
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
    sums: *[point_max]f64,
) void {
    var arriving: f64 = 0;
    for (shares) |share| arriving += share;
    candidate.weight = hidden_share + (1 - hidden_share) * arriving / shadow_count;
    const flux = candidate.luminance() * candidate.weight;
    for (points, sums[0..points.len]) |*point, *sum| sum.* += flux * gainOf(point, candidate, radius);
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
