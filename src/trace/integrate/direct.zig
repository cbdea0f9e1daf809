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
const light_file = @import("../shade/light.zig");
const microfacet = @import("../shade/microfacet.zig");
const path_file = @import("path.zig");
const visibility_file = @import("visibility.zig");

/// Adds the light of one source, as far as it arrives. Vertices of coherent rays are near to each
/// other; the reflection of `traced` ones sees emitters. Returns how many shadow rays it took.
pub fn addLight(
    comptime Kernel: type,
    visibility: *visibility_file.Visibility(Kernel),
    light: *const world_file.Light,
    path: *const path_file.PathState(Kernel),
    vertices: *const [Kernel.group_count]path_file.Vertex(Kernel.Rays),
    traced: *const [Kernel.group_count]Kernel.Rays.Mask,
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
        if (vertex.bsdf.sees_behind) {
            const behind = vertex.bsdf.isBehind(point, arrival.to_light);
            lit = front.bitOr(behind);
            away = .select(behind, away.neg(), away);
        }
        lit = lit.bitAnd(vertex.seen).andNot(point.material.unlit);
        if (lit.none()) continue;
        var response = if (light.kind == .emitter)
            toEmitter(Rays, vertex, light.disk, &arrival, traced[group])
        else
            vertex.bsdf.eval(point, arrival.to_light);
        if (vertex.bsdf.sees_behind)
            response = .select(front, response, vertex.bsdf.evalBehind(point, arrival.to_light));
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

/// The BSDF times cosine for light of an emitter.
fn toEmitter(
    comptime Lanes: type,
    vertex: *const path_file.Vertex(Lanes),
    disk: f32,
    arrival: *const light_file.Arrival(Lanes),
    traced: Lanes.Mask,
) Lanes.Vec3 {
    var wide = vertex.bsdf;
    const tangent = Lanes.F32.splat(@sqrt(disk)).div(arrival.distance);
    wide.alpha = wide.alpha.add(tangent.mul(.splat(0.5))).min(.splat(1));
    wide.smith_view = microfacet.smith(Lanes, wide.cos_view, wide.alpha.mul(wide.alpha));
    const lobes = wide.evalLobes(&vertex.point, arrival.to_light);
    return lobes.diffuse.add(.select(traced, .splat(.{ 0, 0, 0 }), lobes.specular));
}
