//! Direct lighting (next event estimation): one shadow ray a vertex and light.
//!
//! In: a light, the vertices of a bundle's paths. Out: the light that they scatter towards the eye,
//! added to the radiance of their samples. The same for any integrator. Emitters have a size, which
//! makes highlights wider, as alpha grows by half of the tangent that they are seen under (Karis
//! 2013, "Real Shading in Unreal Engine 4", "Specular D Modification"); where reflections are
//! traced, these see the emitters themselves.

const world_file = @import("../../world.zig");
const bundle_file = @import("../traverse/bundle.zig");
const dispatch = @import("../traverse/dispatch.zig");
const bsdf_file = @import("../shade/bsdf.zig");
const light_file = @import("../shade/light.zig");
const microfacet = @import("../shade/microfacet.zig");
const path_file = @import("path.zig");
const visibility_file = @import("visibility.zig");

/// Lanes whose traced rays see emitters, which are not to be seen in highlights again.
pub fn Traced(comptime Kernel: type) type {
    return struct {
        base: *const [Kernel.group_count]Kernel.Rays.Mask,
        coat: *const [Kernel.group_count]Kernel.Rays.Mask,
    };
}

/// Adds the light of one source, as far as it arrives. Vertices of coherent rays are near to each
/// other. Returns how many shadow rays it took.
pub fn addLight(
    comptime Kernel: type,
    visibility: *visibility_file.Visibility(Kernel),
    light: *const world_file.Light,
    path: *const path_file.PathState(Kernel),
    vertices: *const [Kernel.group_count]path_file.Vertex(Kernel.Rays),
    traced: *const Traced(Kernel),
    coherence: dispatch.Coherence,
    radiance: *[Kernel.group_count]Kernel.Rays.Vec3,
) u64 {
    const Rays = Kernel.Rays;
    const Vec3 = Rays.Vec3;
    const zero: Rays.F32 = .zero();
    var bundle: bundle_file.Bundle(Kernel) = undefined;
    var unshadowed: [Kernel.group_count]Vec3 = undefined;
    var active: [Kernel.group_count]Rays.Mask = undefined;
    var ray_count: u64 = 0;
    for (vertices, &bundle.groups, &active, 0..) |*vertex, *ray, *arrives, group| {
        arrives.* = .splat(false);
        ray.active = arrives.*;
        if (vertex.seen.none()) continue;
        const point = &vertex.point;
        const arrival = light_file.arrive(Rays, light, point);
        const front = point.normal.dot(arrival.to_light).gt(zero)
            .bitAnd(point.normal_geometric.dot(arrival.to_light).gt(zero));
        var lit = front;
        var away = point.normal_geometric;
        // Through panes rays see the emitters themselves.
        const passing: Vec3 = if (light.kind == .emitter)
            .splat(.{ 0, 0, 0 })
        else
            vertex.bsdf.mirror.transmitted;
        var behind: Rays.Mask = .splat(false);
        if (vertex.bsdf.sees_behind) {
            const albedo = vertex.bsdf.back_albedo.add(passing);
            behind = bsdf_file.behind(Rays, point, arrival.to_light, albedo);
            lit = front.bitOr(behind);
            away = .select(behind, away.neg(), away);
        }
        lit = lit.bitAnd(vertex.seen).andNot(point.material.unlit);
        if (lit.none()) continue;
        var response = if (light.kind == .emitter)
            toEmitter(Rays, vertex, light.disk, &arrival, .{
                traced.base[group], traced.coat[group],
            })
        else
            vertex.bsdf.eval(point, arrival.to_light);
        if (behind.any()) {
            const through = vertex.bsdf.evalBehind(point, arrival.to_light, passing);
            response = .select(front, response, through);
        }
        const worth = vertex.throughput.mul(response).mul(arrival.irradiance);
        unshadowed[group] = worth;
        const shines = worth.x.gt(zero).bitOr(worth.y.gt(zero)).bitOr(worth.z.gt(zero));
        arrives.* = lit.bitAnd(shines);
        const primitive = path.bundle.groups[group].closest.primitive;
        const end = point.offsetOrigin(away, arrival.distance);
        ray.* = visibility_file.shadowRay(Rays, light, end, primitive, arrives.*);
        ray_count += arrives.popCount();
    }
    if (ray_count == 0) return 0;
    var transmittances: [Kernel.group_count]Vec3 = undefined;
    visibility.transmittance(&bundle, light, vertices, coherence, &transmittances);
    for (active, transmittances, unshadowed, radiance) |arrives, transmittance, worth, *sum| {
        if (arrives.none()) continue;
        const light_seen = worth.mul(transmittance);
        sum.* = sum.add(.select(arrives, light_seen, .splat(.{ 0, 0, 0 })));
    }
    return ray_count;
}

/// The BSDF times cosine for light of an emitter, but for the lobes of base and coat that are
/// traced.
fn toEmitter(
    comptime Lanes: type,
    vertex: *const path_file.Vertex(Lanes),
    disk: f32,
    arrival: *const light_file.Arrival(Lanes),
    traced: [2]Lanes.Mask,
) Lanes.Vec3 {
    const F32 = Lanes.F32;
    const none: Lanes.Vec3 = .splat(.{ 0, 0, 0 });
    var wide = vertex.bsdf;
    const grown = F32.splat(0.5 * @sqrt(disk)).div(arrival.distance);
    wide.alpha = wide.alpha.add(grown).min(.splat(1));
    wide.smith_view = microfacet.smith(Lanes, wide.cos_view, wide.alpha.mul(wide.alpha));
    wide.f0 = .select(traced[0], none, wide.f0);
    wide.f90 = .select(traced[0], .zero(), wide.f90);
    wide.multiple = .select(traced[0], none, wide.multiple);
    if (wide.layered) {
        const coating = &wide.coating;
        coating.alpha = coating.alpha.add(grown).min(.splat(1));
        const squared = coating.alpha.mul(coating.alpha);
        coating.smith_view = microfacet.smith(Lanes, coating.cos_view, squared);
        coating.weight = .select(traced[1], .zero(), coating.weight);
        for (&wide.stretch.alphas) |*alpha| alpha.* = alpha.add(grown).min(.splat(1));
    }
    return wide.eval(&vertex.point, arrival.to_light);
}
