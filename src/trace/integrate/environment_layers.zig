//! The environment's light on a coat and, through thin surfaces, from behind; what lobes have in
//! common.
//!
//! In: vertices with further lobes, lights that are hidden in part. Out: what those lobes make of
//! the environment: smooth integrals, times the share that arrives (`environment.zig`).

const world_file = @import("../../world.zig");
const bsdf_file = @import("../shade/bsdf.zig");
const environment_file = @import("../shade/environment.zig");
const lights_file = @import("environment_lights.zig");
const path_file = @import("path.zig");
const EnvironmentLight = lights_file.EnvironmentLight;

/// Square of GGX's alpha of the narrowest lobe that lights are weighed by.
pub const lobe_alpha_squared_min = 0.2;

/// Where light that a rough surface sends to the view mostly comes from: rather from above than
/// where a mirror would have it from (Lagarde and de Rousiers 2014, Moving Frostbite to Physically
/// Based Rendering, section 4.9.3).
pub fn dominant(
    comptime Lanes: type,
    normal: Lanes.Vec3,
    mirrored: Lanes.Vec3,
    alpha: Lanes.F32,
) Lanes.Vec3 {
    const one: Lanes.F32 = .splat(1);
    const smoothness = one.sub(alpha).max(.zero());
    const share = smoothness.mul(smoothness.sqrt().add(alpha));
    return normal.add(mirrored.sub(normal).scale(share)).normalize();
}

/// Weight of a light in a lobe around a direction; `alpha_term` is GGX's alpha squared less 1.
pub inline fn glossyWeight(
    comptime Lanes: type,
    cosine: Lanes.F32,
    alpha_term: Lanes.F32,
) Lanes.F32 {
    const half = cosine.add(.splat(1)).mul(.splat(0.5));
    const slope = half.mul(alpha_term).add(.splat(1));
    return Lanes.F32.splat(1).div(slope.mul(slope));
}

/// Of the light that would arrive, the share that does; all of it where no light tells.
pub inline fn openness(
    comptime Lanes: type,
    whole: Lanes.Vec3,
    hidden: Lanes.Vec3,
) Lanes.Vec3 {
    const one: Lanes.F32 = .splat(1);
    return .{
        .x = one.sub(shareOf(Lanes, hidden.x, whole.x)),
        .y = one.sub(shareOf(Lanes, hidden.y, whole.y)),
        .z = one.sub(shareOf(Lanes, hidden.z, whole.z)),
    };
}

/// A part of a sum; 0 where the sum is nothing.
pub inline fn shareOf(comptime Lanes: type, part: Lanes.F32, whole: Lanes.F32) Lanes.F32 {
    const F32 = Lanes.F32;
    const known = whole.gt(.splat(1e-12));
    const share = part.div(F32.select(known, whole, .splat(1)));
    return F32.select(known, share, .zero());
}

/// Slopes that divide GGX's along one direction into equal parts, in units of alpha: its marginal
/// distribution up to a slope x is 1/2 + x / (2 sqrt(1 + x^2)). One side; the others mirror them.
const slopes = slopes: {
    var list: [4]f32 = undefined;
    for (&list, 0..) |*slope, part| {
        const share = (@as(f64, @floatFromInt(part)) + 0.5) / @as(f64, list.len);
        slope.* = @floatCast(share / @sqrt(1 - share * share));
    }
    break :slopes list;
};

/// What a stretched lobe sees, in its lanes; `even` in others: mirror images about normals along the
/// tangent, each as rough as the lobe is across.
pub noinline fn stretched(
    comptime Lanes: type,
    environment: *const world_file.Environment,
    vertex: *const path_file.Vertex(Lanes),
    asked: Lanes.Mask,
    even: Lanes.Vec3,
) Lanes.Vec3 {
    const stretch = &vertex.bsdf.stretch;
    const lanes = stretch.lanes.bitAnd(asked);
    if (lanes.none()) return even;
    const point = &vertex.point;
    // Across the lobe, and between two neighbours along it.
    const step = stretch.alphas[0].mul(.splat(0.5 / @as(f32, slopes.len)));
    const alpha = stretch.alphas[1].max(step);
    const roughness = alpha.max(.zero()).sqrt();
    var sum: Lanes.Vec3 = .splat(.{ 0, 0, 0 });
    inline for (slopes) |slope| inline for (.{ -1, 1 }) |side| {
        const lean = stretch.alphas[0].mul(.splat(slope * side));
        const normal = point.normal.add(stretch.tangent.scale(lean)).normalize();
        const mirrored = bsdf_file.mirrored(Lanes, point, normal);
        const direction = dominant(Lanes, normal, mirrored, alpha);
        sum = sum.add(environment_file
            .radiance(Lanes, environment, direction, roughness, .zero(), lanes));
    };
    const mean = sum.scale(.splat(0.5 / @as(f32, slopes.len)));
    return .select(lanes, mean, even);
}

/// What the further lobes of a group get of the lights.
pub fn Receiver(comptime Lanes: type) type {
    const F32 = Lanes.F32;
    const Vec3 = Lanes.Vec3;
    const Vertex = path_file.Vertex(Lanes);
    return struct {
        /// Unit direction that the coat's lobe is around, and of its GGX's alpha the square less 1.
        lobe: Vec3,
        alpha_term: F32,
        whole: Sums,
        hidden: Sums,

        const Self = @This();

        /// Weighted by what lights add to the coat's lobe, and by what to the diffuse one behind.
        const Sums = struct {
            coat: Vec3,
            back: Vec3,

            const zero: Sums = .{ .coat = .splat(.{ 0, 0, 0 }), .back = .splat(.{ 0, 0, 0 }) };
        };

        /// No light yet.
        pub noinline fn start(receiver: *Self, vertex: *const Vertex) void {
            const coating = &vertex.bsdf.coating;
            const alpha = coating.roughness.mul(coating.roughness);
            const mirrored = bsdf_file.mirrored(Lanes, &vertex.point, coating.normal);
            receiver.lobe = dominant(Lanes, coating.normal, mirrored, alpha);
            receiver.alpha_term = alpha.mul(alpha).max(.splat(lobe_alpha_squared_min))
                .sub(.splat(1));
            receiver.whole = .zero;
            receiver.hidden = .zero;
        }

        /// Adds shares of what a light gives to the front and to the back.
        pub noinline fn addLight(
            receiver: *const Self,
            sums: *Sums,
            vertex: *const Vertex,
            light: *const EnvironmentLight,
            front: Vec3,
            back: Vec3,
        ) void {
            const to_light: Vec3 = .splat(light.to_light);
            const irradiance: Vec3 = .splat(light.irradiance);
            const cosine = receiver.lobe.dot(to_light).max(.splat(-1)).min(.splat(1));
            const glossy = glossyWeight(Lanes, cosine, receiver.alpha_term);
            sums.coat = sums.coat.add(front.mul(irradiance).scale(glossy));
            const behind = vertex.point.normal.dot(to_light).neg().max(.zero());
            sums.back = sums.back.add(back.mul(irradiance).scale(behind));
        }

        /// Radiance towards the view for the light that arrives.
        pub noinline fn scatter(
            receiver: *const Self,
            environment: *const world_file.Environment,
            vertex: *const Vertex,
            lit: Lanes.Mask,
            coat_traced: Lanes.Mask,
        ) Vec3 {
            const bsdf = &vertex.bsdf;
            const coating = &bsdf.coating;
            const none: Vec3 = .splat(.{ 0, 0, 0 });
            var sum = none;
            const coated = lit.andNot(coat_traced).bitAnd(coating.albedo.gt(.zero()));
            if (coated.any()) {
                const seen = environment_file.radiance(
                    Lanes,
                    environment,
                    receiver.lobe,
                    coating.roughness,
                    .zero(),
                    coated,
                ).mul(openness(Lanes, receiver.whole.coat, receiver.hidden.coat));
                sum = .select(coated, seen.scale(coating.albedo), none);
            }
            const back = bsdf.back_albedo;
            const lit_behind = lit.bitAnd(back.x.max(back.y).max(back.z).gt(.zero()));
            if (lit_behind.none()) return sum;
            const behind = environment_file
                .irradiance(Lanes, environment, vertex.point.normal.neg(), lit_behind)
                .mul(openness(Lanes, receiver.whole.back, receiver.hidden.back));
            return sum.add(.select(lit_behind, back.mul(behind), none));
        }
    };
}
