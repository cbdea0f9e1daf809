//! Light through rough boundaries: microfacet refraction (Walter et al. 2007, "Microfacet Models
//! for Refraction through Rough Surfaces") in lanes, thick and thin.
//!
//! In: a view, normals, indices of refraction, GGX's alpha, numbers in 0..1. Out: directions behind
//! the boundary, their densities, the lobe. By the texts of KHR_materials_volume (microfacets that
//! refract), of KHR_materials_transmission (walls without volume: the lobe of reflection mirrored
//! to the other side) and of KHR_materials_dispersion. No lobe has Fresnel's factor or a colour in
//! it, and radiance is that over the square of the index, so it keeps its value from one side to
//! the other. Everything is + - * / sqrt in a fixed order.

const std = @import("std");
const simd = @import("../../simd.zig");
const microfacet = @import("microfacet.zig");
const Interaction = @import("interaction.zig").Interaction;

/// Least cosine between a normal and a view, which shading normals may turn away.
const cosine_least = 1e-4;

/// Least square of the generalised half vector, |index_1 view + index_2 light| over index_2: where
/// indices differ by less than 1e-3 light goes straight on, in no lobe that floats can tell.
const half_squared_least = 1e-6;

/// Index of refraction for which the lobe of a thin wall is as wide as that of reflection.
const thin_ior = 1.5;

/// Light that is bent.
pub fn Refraction(comptime Lanes: type) type {
    return struct {
        /// Away from the view; a unit vector unless totally reflected.
        direction: Lanes.Vec3,
        /// All light is reflected.
        total: Lanes.Mask,
        /// Cosine to the normal beyond; 0 where all light is reflected.
        cos_beyond: Lanes.F32,
    };
}

/// Snell's law about a normal on the side of the view, both unit vectors. `eta` is the index of
/// refraction on that side over that on the other.
pub inline fn refract(
    comptime Lanes: type,
    view: Lanes.Vec3,
    normal: Lanes.Vec3,
    eta: Lanes.F32,
) Refraction(Lanes) {
    const one: Lanes.F32 = .splat(1);
    const cos_view = normal.dot(view).max(.splat(cosine_least)).min(one);
    const sin_squared = one.sub(cos_view.mul(cos_view));
    const cos_squared = one.sub(eta.mul(eta).mul(sin_squared));
    const cos_beyond = cos_squared.max(.zero()).sqrt();
    const turned = normal.scale(eta.mul(cos_view).sub(cos_beyond));
    return .{
        .direction = view.neg().scale(eta).add(turned),
        .total = cos_squared.lt(.zero()),
        .cos_beyond = cos_beyond,
    };
}

/// Indices of refraction of red, green and blue light (KHR_materials_dispersion): green has that of
/// the material, red and blue lie half of (ior - 1) / V to either side. `dispersion` is 20 / V.
pub inline fn dispersedIors(
    comptime Lanes: type,
    ior: Lanes.F32,
    dispersion: Lanes.F32,
) [3]Lanes.F32 {
    const one: Lanes.F32 = .splat(1);
    const half_spread = ior.sub(one).mul(dispersion).mul(.splat(0.5 / 20.0));
    return .{ ior.sub(half_spread).max(one), ior, ior.add(half_spread) };
}

/// `eta` of a boundary for light of one channel, whose index this is: the boundary's is `ior`, the
/// green channel's. `eta` as for `refract`.
pub inline fn dispersedEta(
    comptime Lanes: type,
    eta: Lanes.F32,
    ior: Lanes.F32,
    channel_ior: Lanes.F32,
) Lanes.F32 {
    const stretch = channel_ior.div(ior);
    return .select(eta.gt(.splat(1)), eta.mul(stretch), eta.div(stretch));
}

/// GGX's alpha of a thin wall's lobe, for that of its surface. Two faces bend light by (ior - 1)
/// times what their slopes differ by, so the width of the lobe goes with that: nothing for an index
/// of 1, which has no boundary, and for the default of 1.5 the width of the reflection, which the
/// text wants; higher ones are not wider than it.
pub inline fn thinAlpha(
    comptime Lanes: type,
    alpha: Lanes.F32,
    ior: Lanes.F32,
) Lanes.F32 {
    const width = ior.sub(.splat(1)).mul(.splat(1 / (thin_ior - 1.0)));
    return alpha.mul(width.max(.zero()).min(.splat(1)));
}

/// GGX's alpha of the reflection whose lobe is as wide as that of light through a boundary between
/// volumes, seen along the normal: a slope turns a reflection by twice its angle, refraction by
/// that times the difference of the indices over the one behind. `eta` as for `refract`.
pub inline fn equalAlpha(
    comptime Lanes: type,
    alpha: Lanes.F32,
    eta: Lanes.F32,
) Lanes.F32 {
    const width = eta.sub(.splat(1)).abs().mul(.splat(0.5));
    return alpha.mul(width.min(.splat(1)));
}

/// A direction that light comes from.
pub fn Direction(comptime Lanes: type) type {
    return struct {
        /// Unit vector; behind the boundary by the triangle's normal, or in front if reflected.
        to_light: Lanes.Vec3,
        /// Lanes where the microfacet sends light on to others, by total reflection or to its own
        /// side: scattered by the cosine instead, which `pdf` does not have in it.
        scattered: Lanes.Mask,
    };
}

/// A rough boundary from one direction.
pub fn RoughBoundary(comptime Lanes: type) type {
    return struct {
        /// Unit vectors: towards the viewer, and on that side the normals for shading and of the
        /// triangle.
        view: Vec3,
        normal: Vec3,
        normal_geometric: Vec3,
        /// See `refract`; no matter where thin.
        eta: F32,
        /// Walls without volume.
        thin: Mask,
        /// Of the microfacets, and of thin walls `thinAlpha`.
        alpha: F32,

        const Self = @This();
        const F32 = Lanes.F32;
        const Vec3 = Lanes.Vec3;
        const Mask = Lanes.Mask;

        /// A microfacet that the view sees.
        pub const Facet = struct {
            /// Two axes across the normal, the third.
            across: [2]Vec3,
            /// Unit vectors in this frame: the view and the microfacet's normal.
            view: Vec3,
            half: Vec3,
            /// Where on the disc it is.
            disc: [2]F32,

            /// The direction in which the microfacet reflects the view, in the frame.
            pub inline fn mirrored(of: *const Facet) Vec3 {
                const twice = of.view.dot(of.half).mul(.splat(2));
                return of.half.scale(twice).sub(of.view);
            }
        };

        /// One of those that the view sees, for two numbers in 0..1.
        pub inline fn facet(boundary: *const Self, numbers: [2]F32) Facet {
            const across = microfacet.tangents(Lanes, boundary.normal);
            const local: Vec3 = .{
                .x = across[0].dot(boundary.view),
                .y = across[1].dot(boundary.view),
                .z = boundary.cosView(),
            };
            const view = local.normalize();
            const disc = microfacet.disc(Lanes, numbers);
            const half = microfacet.visibleNormal(Lanes, view, boundary.alpha, disc);
            return .{ .across = across, .view = view, .half = half, .disc = disc };
        }

        /// Directions for two numbers in 0..1, distributed as `pdf` says but for what is scattered.
        /// If each brings the share of light that the boundary lets through in all, energy is kept.
        pub fn sample(boundary: *const Self, numbers: [2]F32) Direction(Lanes) {
            return boundary.pass(&boundary.facet(numbers));
        }

        /// `sample` through one microfacet.
        pub inline fn pass(boundary: *const Self, of: *const Facet) Direction(Lanes) {
            const bent = refract(Lanes, of.view, of.half, boundary.eta);
            const mirrored = of.mirrored();
            const through: Vec3 = .{ .x = mirrored.x, .y = mirrored.y, .z = mirrored.z.neg() };
            const chosen: Vec3 = .select(boundary.thin, through, bent.direction);
            const direction = turn(of.across, boundary.normal, chosen).normalize();
            const scattered = bent.total.andNot(boundary.thin)
                .bitOr(chosen.z.ge(.zero()))
                .bitOr(boundary.normal_geometric.dot(direction).ge(.zero()));
            return .{
                .to_light = .select(scattered, boundary.scatter(of.disc), direction),
                .scattered = scattered,
            };
        }

        /// A microfacet's mirror image of the view. What goes to the other side is scattered in
        /// front of the triangle.
        pub inline fn reflect(boundary: *const Self, of: *const Facet) Direction(Lanes) {
            const image = of.mirrored();
            const direction = turn(of.across, boundary.normal, image).normalize();
            const scattered = image.z.le(.zero())
                .bitOr(boundary.normal_geometric.dot(direction).le(.zero()));
            return .{
                .to_light = .select(scattered, boundary.scatter(of.disc).neg(), direction),
                .scattered = scattered,
            };
        }

        /// Behind the triangle by the cosine, for a point of the unit disc.
        pub inline fn scatter(boundary: *const Self, disc: [2]F32) Vec3 {
            const normal = boundary.normal_geometric;
            const squared = disc[0].mul(disc[0]).add(disc[1].mul(disc[1]));
            const height = F32.splat(1).sub(squared).max(.splat(cosine_least)).sqrt();
            const local: Vec3 = .{ .x = disc[0], .y = disc[1], .z = height.neg() };
            return turn(microfacet.tangents(Lanes, normal), normal, local).normalize();
        }

        inline fn turn(across: [2]Vec3, normal: Vec3, local: Vec3) Vec3 {
            return across[0].scale(local.x).add(across[1].scale(local.y))
                .add(normal.scale(local.z));
        }

        pub inline fn cosView(boundary: *const Self) F32 {
            return boundary.normal.dot(boundary.view).max(.splat(cosine_least)).min(.splat(1));
        }

        /// Density of `sample` by solid angle, per steradian, on the whole sphere: the lobe that
        /// lights are seen in with the energy of the samples. Its integral is 1 less the share of
        /// what is scattered. Alpha is greater than 0; lobes of indices within 1e-3 of each other
        /// are 0.
        pub fn pdf(boundary: *const Self, to_light: Vec3) F32 {
            const cos_view = boundary.cosView();
            const squared = boundary.alpha.mul(boundary.alpha);
            const seen = cos_view.add(microfacet.smith(Lanes, cos_view, squared));
            return boundary.density(to_light).div(seen);
        }

        /// The lobe of light that meets one microfacet, BTDF times the light's cosine: equation 21
        /// of Walter et al. with the light's index above, Smith's height-correlated term, Fresnel's
        /// factor 1; of thin walls the lobe of reflection, mirrored. Over the square of the light's
        /// index and its cosine the thick one is reciprocal. Its integral over the sphere is 1 less
        /// what microfacets hide or send to others; of thin walls that is `missing` of
        /// `albedo.zig`. Alpha as for `pdf`.
        pub fn eval(boundary: *const Self, to_light: Vec3) F32 {
            const cos_view = boundary.cosView();
            const squared = boundary.alpha.mul(boundary.alpha);
            const cos_light = boundary.normal.dot(to_light).neg().max(.zero()).min(.splat(1));
            const smith_view = microfacet.smith(Lanes, cos_view, squared);
            const view_term = smith_view.mul(cos_light);
            const light_term = microfacet.smith(Lanes, cos_light, squared).mul(cos_view);
            return boundary.density(to_light).mul(cos_light)
                .div(view_term.add(light_term).max(.splat(1e-12)));
        }

        /// Twice the density of the normals that send light on to the view, by the solid angle of
        /// the light and projected to the view; 0 where none do.
        inline fn density(boundary: *const Self, to_light: Vec3) F32 {
            const one: F32 = .splat(1);
            const zero: F32 = .zero();
            const normal = boundary.normal;
            const along = normal.dot(to_light);
            const mirrored = to_light.sub(normal.scale(along.add(along)));
            const bending = boundary.view.scale(boundary.eta).add(to_light).neg();
            const sum: Vec3 = .select(boundary.thin, boundary.view.add(mirrored), bending);
            const squares = sum.dot(sum).max(.splat(half_squared_least));
            // Where light comes from the thinner side the sum points to the other one.
            const sign = one.copySign(normal.dot(sum));
            const half = sum.scale(sign.div(squares.sqrt()));
            const cos_half = normal.dot(half).min(one);
            const view_half = boundary.view.dot(half);
            const light_half = to_light.dot(half).neg();
            // Solid angle of normals by that of light: equation 17, and 14 for thin walls.
            const thick = view_half.mul(light_half).div(squares);
            const spread = F32.select(boundary.thin, .splat(0.25), thick);
            const squared = boundary.alpha.mul(boundary.alpha);
            const slopes = microfacet.distribution(Lanes, cos_half, squared);
            const bent = light_half.gt(zero).bitAnd(sum.dot(sum).gt(.splat(half_squared_least)));
            const faced = boundary.thin.bitOr(bent).bitAnd(view_half.gt(zero));
            const behind = along.lt(zero)
                .bitAnd(boundary.normal_geometric.dot(to_light).lt(zero));
            const both = slopes.mul(spread);
            return .select(faced.bitAnd(behind), both.add(both), zero);
        }
    };
}

/// The boundary at points, with this alpha of their surface and this ratio of indices.
pub fn boundaryOf(
    comptime Lanes: type,
    point: *const Interaction(Lanes),
    alpha: Lanes.F32,
    eta: Lanes.F32,
) RoughBoundary(Lanes) {
    const material = &point.material;
    const pane = thinAlpha(Lanes, alpha, material.ior);
    return .{
        .view = point.view,
        .normal = point.normal,
        .normal_geometric = point.normal_geometric,
        .eta = eta,
        .thin = material.volume.bitNot(),
        .alpha = .select(material.volume, alpha, pane),
    };
}

const Single = simd.Lanes(.scalar, 1);
const Albedo = @import("albedo.zig").Albedo(Single);
const TestBoundary = RoughBoundary(Single);

/// Seen at a cosine, from the side with `eta` times the index of the other; null where thin.
fn testBoundary(cosine: f32, eta: ?f32, roughness: f32) TestBoundary {
    const normal: Single.Vec3 = .splat(.{ 0.36, 0.48, -0.8 });
    const across: Single.Vec3 = .splat(.{ 0.8, -0.6, 0 });
    const sine = @sqrt(1 - cosine * cosine);
    return .{
        .view = normal.scale(.splat(cosine)).add(across.scale(.splat(sine))),
        .normal = normal,
        .normal_geometric = normal,
        .eta = .splat(eta orelse 1),
        .thin = .splat(eta == null),
        .alpha = .splat(roughness * roughness),
    };
}

/// Where light would come from if the boundary were smooth.
fn testStraight(boundary: *const TestBoundary) Single.Vec3 {
    if (boundary.thin.lane(0)) return boundary.view.neg();
    return refract(Single, boundary.view, boundary.normal, boundary.eta).direction;
}

const iors = [_]f32{ 1.1, 1.5, 2.4 };

test "Snell's law on both sides, total reflection, grazing light, an index of 1" {
    const up: Single.Vec3 = .splat(.{ 0, 1, 0 });
    for (iors) |ior| for ([_]f32{ ior, 1 / ior }) |eta| {
        for ([_]f32{ 1e-4, 0.1, 0.4, 0.7, 0.95, 1 }) |cosine| {
            const sine = @sqrt(1 - cosine * cosine);
            const bent = refract(Single, .splat(.{ sine, cosine, 0 }), up, .splat(eta));
            try std.testing.expectEqual(sine * eta > 1, bent.total.lane(0));
            if (bent.total.lane(0)) {
                try std.testing.expectEqual(0, bent.cos_beyond.lane(0));
                continue;
            }
            try std.testing.expectApproxEqAbs(-sine * eta, bent.direction.x.lane(0), 1e-6);
            try std.testing.expectApproxEqAbs(1, bent.direction.length().lane(0), 1e-5);
            const cos_beyond = bent.cos_beyond.lane(0);
            try std.testing.expectApproxEqAbs(-cos_beyond, bent.direction.y.lane(0), 1e-6);
        }
    };
    const straight = refract(Single, .splat(.{ 0.6, 0.8, 0 }), up, .splat(1));
    try std.testing.expectApproxEqAbs(-0.6, straight.direction.x.lane(0), 1e-6);
    try std.testing.expectApproxEqAbs(-0.8, straight.direction.y.lane(0), 1e-6);
}

test "dispersion: half of the spread to either side of green, never below 1" {
    const crown = dispersedIors(Single, .splat(1.52), .splat(20.0 / 59.0));
    try std.testing.expectApproxEqAbs(0.52 / 59.0, crown[2].sub(crown[0]).lane(0), 1e-6);
    try std.testing.expectEqual(1.52, crown[1].lane(0));
    const none = dispersedIors(Single, .splat(2.4), .splat(0));
    for (none) |ior| try std.testing.expectEqual(2.4, ior.lane(0));
    try std.testing.expectEqual(1, dispersedIors(Single, .splat(1.5), .splat(60))[0].lane(0));
}

test "thin walls blur as reflections do at an index of 1.5, and not at 1" {
    for ([_][2]f32{ .{ 1, 0 }, .{ 1.25, 0.2 }, .{ 1.5, 0.4 }, .{ 2.4, 0.4 } }) |case| {
        const alpha = thinAlpha(Single, .splat(0.4), .splat(case[0]));
        try std.testing.expectApproxEqAbs(case[1], alpha.lane(0), 1e-6);
    }
}

test "a refracted lobe is as wide as the reflection of equal alpha" {
    for (iors) |ior| for ([_]f32{ ior, 1 / ior }) |eta| {
        const boundary = testBoundary(1, eta, 0.2);
        var mirror = testBoundary(1, null, 0.2);
        mirror.alpha = equalAlpha(Single, boundary.alpha, boundary.eta);
        for ([_]f32{ 0.1, 0.3, 0.6 }) |number| {
            const numbers = [2]Single.F32{ .splat(number), .splat(0.45) };
            const straight = boundary.view.neg();
            const bent = boundary.sample(numbers).to_light.sub(straight).length();
            const other = mirror.sample(numbers).to_light.sub(straight).length();
            try std.testing.expectApproxEqRel(other.lane(0), bent.lane(0), 0.02);
        }
    };
}

test "samples: their density is pdf by chi-squared, never in front of the triangle" {
    for ([_]struct { f32, ?f32, f32 }{
        .{ 0.6, 1.0 / 1.5, 0.6 },
        .{ 0.9, 1.5, 0.5 },
        .{ 0.3, 1.0 / 2.4, 1 },
        .{ 0.5, null, 0.7 },
    }) |case| {
        const boundary = testBoundary(case[0], case[1], case[2]);
        errdefer std.debug.print("cosine {d}, eta {?d}, roughness {d}\n", case);
        try expectSampled(&boundary);
    }
}

/// Cells of the sphere, fine around the smooth direction: rings by the fourth root of 1 - cosine.
const Cells = struct {
    const rings = 16;
    const sectors = 16;

    fn of(boundary: *const TestBoundary, direction: Single.Vec3) usize {
        const axis = testStraight(boundary);
        const across = microfacet.tangents(Single, axis);
        const height = axis.dot(direction).lane(0);
        const x = @sqrt(@sqrt(@max(1 - height, 0) / 2));
        const angle = std.math
            .atan2(direction.dot(across[1]).lane(0), direction.dot(across[0]).lane(0));
        const turns = (angle / std.math.pi + 1) / 2 * sectors;
        const ring: usize = @intFromFloat(std.math.clamp(x * rings, 0, rings - 1));
        return ring * sectors + @as(usize, @intFromFloat(std.math.clamp(turns, 0, sectors - 1)));
    }

    /// The density integrated over one.
    fn share(boundary: *const TestBoundary, cell: usize) f64 {
        const steps = 6;
        const axis = testStraight(boundary);
        var sum: f64 = 0;
        for (0..steps) |i| for (0..steps) |j| {
            const ring: f32 = @floatFromInt(cell / sectors * steps + i);
            const sector: f32 = @floatFromInt(cell % sectors * steps + j);
            const x = (ring + 0.5) / (rings * steps);
            const angle = ((sector + 0.5) / (sectors * steps) * 2 - 1) * std.math.pi;
            const way = testDirection(axis, angle, 1 - 2 * x * x * x * x);
            sum += boundary.pdf(way).lane(0) * 8 * x * x * x;
        };
        return sum / (steps * steps) * 2 * std.math.pi / (rings * sectors);
    }
};

/// At an angle around an axis and a cosine to it.
fn testDirection(axis: Single.Vec3, angle: f32, cosine: f32) Single.Vec3 {
    const across = microfacet.tangents(Single, axis);
    const radius = @sqrt(@max(1 - cosine * cosine, 0));
    return across[0].scale(.splat(radius * @cos(angle)))
        .add(across[1].scale(.splat(radius * @sin(angle)))).add(axis.scale(.splat(cosine)));
}

fn expectSampled(boundary: *const TestBoundary) !void {
    var random = std.Random.DefaultPrng.init(5);
    const source = random.random();
    var counts: [Cells.rings * Cells.sectors]f64 = @splat(0);
    const sample_count = 8000;
    var scattered: f64 = 0;
    for (0..sample_count) |_| {
        const numbers = [2]Single.F32{ .splat(source.float(f32)), .splat(source.float(f32)) };
        const found = boundary.sample(numbers);
        const behind = boundary.normal_geometric.dot(found.to_light).lane(0);
        try std.testing.expect(behind < 0);
        if (found.scattered.lane(0)) {
            scattered += 1;
            continue;
        }
        counts[Cells.of(boundary, found.to_light)] += 1;
    }
    var chi_squared: f64 = 0;
    var whole: f64 = 0;
    var freedom: f64 = 0;
    for (counts, 0..) |count, cell| {
        const share = Cells.share(boundary, cell);
        whole += share;
        const expected = share * sample_count;
        if (expected < 5) continue;
        chi_squared += (count - expected) * (count - expected) / expected;
        freedom += 1;
    }
    try std.testing.expectApproxEqAbs(1 - scattered / sample_count, whole, 0.015);
    try std.testing.expect(freedom > 50);
    // Five standard deviations of chi-squared.
    try std.testing.expect(chi_squared < freedom + 5 * @sqrt(2 * freedom));
}

/// The lobe over the side that light comes from, dense around the smooth direction.
fn integrate(boundary: *const TestBoundary) f64 {
    const axis = testStraight(boundary);
    const across = microfacet.tangents(Single, axis);
    const behind = boundary.normal.neg();
    const steps = 80;
    const sectors = 32;
    var sum: f64 = 0;
    for (0..sectors) |j| {
        const angle = (@as(f32, @floatFromInt(j)) + 0.5) / sectors * 2 * std.math.pi;
        const away = across[0].scale(.splat(@cos(angle)))
            .add(across[1].scale(.splat(@sin(angle))));
        const heights = [2]f64{ behind.dot(axis).lane(0), behind.dot(away).lane(0) };
        const horizon = std.math.atan2(heights[0], -heights[1]);
        for (0..steps) |i| {
            const x = (@as(f64, @floatFromInt(i)) + 0.5) / steps;
            const opening = horizon * x * x * x;
            const to_light = axis.scale(.splat(@floatCast(@cos(opening))))
                .add(away.scale(.splat(@floatCast(@sin(opening)))));
            const weight = @sin(opening) * horizon * 3 * x * x;
            sum += weight * boundary.eval(to_light).lane(0);
        }
    }
    return sum * 2 * std.math.pi / (steps * sectors);
}

/// Mean of what samples bring if all light behind is white.
fn weigh(boundary: *const TestBoundary) f64 {
    const steps = 40;
    var sum: f64 = 0;
    for (0..steps) |i| for (0..steps) |j| {
        const u = (@as(f32, @floatFromInt(i)) + 0.5) / steps;
        const v = (@as(f32, @floatFromInt(j)) + 0.5) / steps;
        const found = boundary.sample(.{ .splat(u), .splat(v) });
        if (found.scattered.lane(0)) continue;
        const density = boundary.pdf(found.to_light).lane(0);
        sum += boundary.eval(found.to_light).lane(0) / density;
    };
    return sum / (steps * steps);
}

test "the lobe's integral is the mean of the samples' weights" {
    for ([_]f32{ 0.1, 0.4, 0.7, 1 }) |roughness| for (iors) |ior| {
        for ([_][2]f32{ .{ 1 / ior, 0.9 }, .{ 1 / ior, 0.5 }, .{ ior, 0.95 } }) |case| {
            const boundary = testBoundary(case[1], case[0], roughness);
            errdefer std.debug.print("roughness {d}, eta and cosine {any}\n", .{ roughness, case });
            const share = weigh(&boundary);
            try std.testing.expectApproxEqRel(share, integrate(&boundary), 0.015);
            try std.testing.expect(share > 0.1 and share <= 1.0001);
        }
    };
}

test "what a thin wall loses is what reflection loses" {
    for ([_]f32{ 0.1, 0.4, 0.7, 1 }) |roughness| for ([_]f32{ 0.3, 0.6, 1 }) |cosine| {
        const boundary = testBoundary(cosine, null, roughness);
        const missing = Albedo.of(boundary.alpha).at(.splat(cosine)).missing.lane(0);
        try std.testing.expectApproxEqRel(1 - missing, integrate(&boundary), 0.015);
    };
}

test "reciprocity: light and view change places, but for the square of the index" {
    var random = std.Random.DefaultPrng.init(9);
    const source = random.random();
    var seen: usize = 0;
    for (0..500) |_| {
        const eta: ?f32 = if (source.boolean()) 0.4 + source.float(f32) * 2 else null;
        const there = testBoundary(0.05 + 0.95 * source.float(f32), eta, 0.4 + 0.6 *
            source.float(f32));
        const angle = source.float(f32) * 2 * std.math.pi;
        const light = testDirection(there.normal, angle, -0.05 - 0.95 * source.float(f32));
        var back = there;
        back.view = light;
        back.normal = there.normal.neg();
        back.normal_geometric = back.normal;
        back.eta = Single.F32.splat(1).div(there.eta);
        const first = there.eval(light).lane(0) * there.cosView().lane(0);
        const second = back.eval(there.view).lane(0) * back.cosView().lane(0);
        const squared = there.eta.lane(0) * there.eta.lane(0);
        try std.testing.expectApproxEqRel(second, first * squared, 2e-3);
        if (first > 0) seen += 1;
    }
    try std.testing.expect(seen > 200);
}

test "smooth boundaries bend all light alike, an index of 1 none, and no lobe for either" {
    for ([_]?f32{ 1.0 / 1.5, 1, null }) |eta| for ([_]f32{ 0, 1 }) |roughness| {
        if (roughness > 0 and eta != 1) continue;
        const boundary = testBoundary(0.6, eta, roughness);
        const straight = testStraight(&boundary);
        for ([_]f32{ 0, 0.2, 0.5, 0.9 }) |number| {
            const found = boundary.sample(.{ .splat(number), .splat(0.4) });
            for (straight.lane(0), found.to_light.lane(0)) |wanted, component| {
                try std.testing.expectApproxEqAbs(wanted, component, 1e-5);
            }
            if (eta == 1 and roughness > 0) {
                try std.testing.expectEqual(0, boundary.eval(found.to_light).lane(0));
                try std.testing.expectEqual(0, boundary.pdf(found.to_light).lane(0));
            }
        }
    };
}

test "grazing views and tilted normals: finite, behind the triangle" {
    for ([_]f32{ 0, 1e-4, 0.02, 0.5 }) |cosine| for ([_]?f32{ 0.4, 0.999, 1.5, null }) |eta| {
        for ([_]f32{ 0.05, 0.3, 1 }) |roughness| for ([_]f32{ 0, 0.8 }) |tilt| {
            var boundary = testBoundary(cosine, eta, roughness);
            const away = Single.Vec3.splat(.{ 0.8, -0.6, 0 }).scale(.splat(-tilt));
            boundary.normal = boundary.normal.add(away).normalize();
            for ([_]f32{ 0, 0.01, 0.5, 0.7, 1 }) |u| for ([_]f32{ 0, 0.5, 1 }) |v| {
                const found = boundary.sample(.{ .splat(u), .splat(v) });
                try std.testing.expect(
                    boundary.normal_geometric.dot(found.to_light).lane(0) < 0,
                );
                try std.testing.expectApproxEqAbs(1, found.to_light.length().lane(0), 1e-5);
                const density = boundary.pdf(found.to_light).lane(0);
                const lobe = boundary.eval(found.to_light).lane(0);
                try std.testing.expect(density >= 0 and std.math.isFinite(density));
                try std.testing.expect(lobe >= 0 and std.math.isFinite(lobe));
            };
            try std.testing.expectEqual(0, boundary.eval(boundary.view).lane(0));
        };
    };
}
