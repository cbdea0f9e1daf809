//! Light paths of instant radiosity (Keller 1997), traced in bundles: what they leave on diffuse
//! surfaces.
//!
//! In: where paths start (`light_emission.zig`), what the camera sees. Out: candidates for virtual
//! lights (`virtual_lights.zig`), with the flux that leaves them. At a surface a path goes straight
//! on through what is clear, as shadow rays do, or leaves it by the cosine or as a mirror would
//! have it, or ends: by Russian roulette over what the surface does with light, so that its flux
//! keeps its colour.

const std = @import("std");
const math = @import("../../math.zig");
const ray_file = @import("../traverse/ray.zig");
const bsdf_file = @import("../shade/bsdf.zig");
const emission = @import("light_emission.zig");
const ByLane = @import("by_lane.zig").ByLane;
const Candidate = @import("virtual_lights.zig").Candidate;
const vec3 = math.vec3;
const Vec3 = math.Vec3;

/// Paths of a piece of work: as many as the largest bundle has rays.
pub const piece_paths = 256;
/// Surfaces that a path meets at most.
const segment_max = 8;
/// Candidates of a path at most.
pub const bounce_max = 6;
/// Growth of a path's cone by distance: textures are averaged over what a virtual light stands for.
const cone_spread = 0.1;

comptime {
    std.debug.assert(4 + 3 * segment_max <= emission.number_count_max);
}

/// What one thread's trees do for all.
pub fn LightPaths(comptime Kernel: type, comptime Tree: type) type {
    const Rays = Kernel.Rays;
    const Mask = Rays.Mask;
    const lanes = Kernel.ray_count;
    const batch = Kernel.group_count * lanes;
    const Lane3 = ByLane(Rays);
    const Surface = SurfaceOf(Kernel, Tree);
    return struct {
        /// Before rays are traced that start outside of everything.
        pub fn start(tree: *Tree) void {
            const path = &tree.path;
            path.start();
            path.depth = 0;
            path.transparency_depth = 0;
            path.cone_width = @splat(.zero());
            path.cone_spread = @splat(.splat(cone_spread));
        }

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
            focus: math.Box3,
            candidates: [][bounce_max]Candidate,
        ) void {
            for (0..piece_paths / batch) |index| {
                const first: u32 = @intCast(piece * piece_paths + index * batch);
                if (first >= path_count) return;
                const end = @min(first + batch, path_count);
                for (candidates[first..end]) |*of_path| for (of_path) |*one| {
                    one.flux = @splat(0);
                };
                traceBatch(tree, sources, first, end, focus, candidates);
            }
        }

        fn traceBatch(
            tree: *Tree,
            sources: []const emission.Source,
            first: u32,
            end: u32,
            focus: math.Box3,
            candidates: [][bounce_max]Candidate,
        ) void {
            var state: State = undefined;
            const boxes: emission.Boxes = .{
                .scene = tree.frame.geometry.bounds,
                .focus = focus,
            };
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
                    const one = emission.start(emission.sourceOf(sources, path), &boxes, numbers);
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
            Surface.find(tree, group, &surface);
            var origin: Lane3 = .of(ray.line.origin);
            var direction: Lane3 = .of(ray.line.direction);
            var bent: u32 = 0;
            var straight: u32 = 0;
            var bits = hit.andNot(surface.culled).bits();
            while (bits != 0) : (bits &= bits - 1) {
                const lane: u5 = @intCast(@ctz(bits));
                const at = group * lanes + lane;
                const number = first + @as(u32, @intCast(at));
                if (state.bounces[at] < tree.settings.depth_max)
                    leave(&surface, state, lane, at, &candidates[number]);
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

        /// Leaves a candidate where a path ends, if light leaves it there.
        fn leave(
            surface: *const Surface,
            state: *State,
            lane: usize,
            at: usize,
            candidates: *[bounce_max]Candidate,
        ) void {
            if (state.counts[at] == bounce_max or !surface.seen.lane(lane)) return;
            const arriving = vec3.mul(state.flux[at], surface.throughput.at(lane));
            const flux = vec3.mul(arriving, surface.albedo.at(lane));
            if (!(vec3.maxComponent(flux) > 0)) return;
            candidates[state.counts[at]] = .{
                .position = surface.position.at(lane),
                .normal = surface.normal.at(lane),
                .flux = flux,
            };
            state.counts[at] += 1;
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
    };
}

/// What the surfaces that rays of a group meet do with light, in lanes.
fn SurfaceOf(comptime Kernel: type, comptime Tree: type) type {
    const Rays = Kernel.Rays;
    const F32 = Rays.F32;
    const lanes = Kernel.ray_count;
    const Lane3 = ByLane(Rays);
    return struct {
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
        seen: Rays.Mask,
        culled: Rays.Mask,

        fn find(tree: *Tree, group: usize, surface: *@This()) void {
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
}
