//! What the primary rays of a sample see: albedo, normal and depth, for denoisers and compositing.
//!
//! In: vertices and escapes of paths that have only met smooth surfaces. Out: sums on the film's
//! layers. What smooth surfaces mirror or let through is seen in them, as it is in the picture: a
//! denoiser that knew but the mirror would blur it.

const film_file = @import("../../film.zig");
const world_file = @import("../../world.zig");
const vec3 = @import("../../math.zig").vec3;
const camera = @import("camera.zig");
const path_file = @import("path.zig");
const Film = film_file.Film;

/// Surfaces up to this roughness show what they mirror, and what is behind them.
pub const smooth_roughness_max = 0.1;

/// Whether a film keeps any.
pub fn areKept(layers: film_file.Layers) bool {
    return layers.contains(.albedo) or layers.contains(.normal) or layers.contains(.depth);
}

/// Of one sample of a bundle.
pub fn Features(comptime Kernel: type) type {
    const Rays = Kernel.Rays;
    const F32 = Rays.F32;
    const Vec3 = Rays.Vec3;
    const group_count = Kernel.group_count;
    const PathState = path_file.PathState(Kernel);
    const Vertex = path_file.Vertex(Rays);
    return struct {
        /// Undefined where it is not set, and to be left alone.
        kept: bool,
        albedo: [group_count]Vec3,
        normal: [group_count]Vec3,
        depth: [group_count]F32,
        depth_share: [group_count]F32,

        const Self = @This();
        const none: Vec3 = .splat(.{ 0, 0, 0 });
        const white: Vec3 = .splat(.{ 1, 1, 1 });

        /// Nothing seen yet.
        pub fn start(features: *Self, layers: film_file.Layers) void {
            features.kept = areKept(layers);
            if (!features.kept) return;
            features.albedo = @splat(none);
            features.normal = @splat(none);
            features.depth = @splat(.zero());
            features.depth_share = @splat(.zero());
        }

        /// Lanes of paths that still show what primary rays see.
        pub inline fn seeing(path: *const PathState, group: usize) Rays.Mask {
            return path.roughness[group].le(.splat(smooth_roughness_max));
        }

        /// Adds what a group of rays sees in lanes: a share of the light, 0 where rays do not see
        /// it, of surfaces of an albedo, at most 1 is counted, that face a direction.
        pub fn add(features: *Self, group: usize, share: Vec3, albedo: Vec3, normal: Vec3) void {
            const seen = share.mul(albedo.min(white));
            features.albedo[group] = features.albedo[group].add(seen);
            const weight = meanOf(share);
            features.normal[group] = features.normal[group].add(normal.scale(weight));
        }

        /// Adds the depth that primary rays have at vertices.
        pub fn addDepth(
            features: *Self,
            group: usize,
            view: *const world_file.View,
            vertex: *const Vertex,
        ) void {
            const forward: Vec3 = .splat(vec3.normalize(view.camera.forward).?);
            const point = &vertex.point;
            const share = meanOf(vertex.throughput);
            const depth = point.distance.mul(point.view.dot(forward).neg());
            const seen = F32.select(vertex.seen, depth.mul(share), .zero());
            features.depth[group] = features.depth[group].add(seen);
            features.depth_share[group] = features.depth_share[group].add(share);
        }

        /// Adds vertices of an integrator that goes on along all of `traced`, the shares of
        /// mirrored and transmitted light, in lanes in which these show what is there.
        pub fn addVertex(
            features: *Self,
            group: usize,
            path: *const PathState,
            vertex: *const Vertex,
            traced: Vec3,
        ) void {
            const lanes = vertex.seen.bitAnd(seeing(path, group));
            if (lanes.none()) return;
            const share: Vec3 = .select(lanes, vertex.throughput, none);
            const own = albedoOf(vertex).sub(traced).max(none);
            // Of the light that comes from here all is from it but what it shows.
            const facing = vertex.point.normal.scale(F32.splat(1).sub(meanOf(traced)));
            features.add(group, share, own, facing);
        }

        /// Adds rays that left the scene, worth a share of the light.
        pub fn addEscaped(
            features: *Self,
            group: usize,
            path: *const PathState,
            share: Vec3,
        ) void {
            features.add(group, .select(seeing(path, group), share, none), white, none);
        }

        /// Share of white light from everywhere that vertices send to the view, and what they emit.
        pub fn albedoOf(vertex: *const Vertex) Vec3 {
            const bsdf = &vertex.bsdf;
            const material = &vertex.point.material;
            var albedo = bsdf.diffuse_albedo.add(bsdf.specular_albedo)
                .add(bsdf.mirror.transmitted).add(material.emissive);
            if (bsdf.layered) {
                const coat = bsdf.coating.albedo;
                albedo = albedo.add(.{ .x = coat, .y = coat, .z = coat })
                    .add(bsdf.coating.sheen_albedo).add(bsdf.back_albedo);
            }
            return .select(material.unlit, material.base_color, albedo.min(white));
        }

        inline fn meanOf(share: Vec3) F32 {
            return share.dot(.splat(@splat(1.0 / 3.0)));
        }

        /// Adds the sums to the film's layers that are kept.
        pub noinline fn expose(features: *const Self, film: *Film, place: camera.Place) void {
            const zero: [group_count]F32 = @splat(.zero());
            if (film.layers.contains(.albedo))
                camera.expose(Kernel, film, .albedo, place, &features.albedo, &zero);
            if (film.layers.contains(.normal))
                camera.expose(Kernel, film, .normal, place, &features.normal, &zero);
            if (!film.layers.contains(.depth)) return;
            var depth: [group_count]Vec3 = undefined;
            for (&depth, features.depth) |*to, from| {
                to.* = .{ .x = from, .y = .zero(), .z = .zero() };
            }
            camera.expose(Kernel, film, .depth, place, &depth, &features.depth_share);
        }
    };
}
