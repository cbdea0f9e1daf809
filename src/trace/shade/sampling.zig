//! Importance sampling of a surface's BSDF in lanes: one lobe by its share of the albedo, then a
//! direction in it.
//!
//! In: a BSDF, its point, numbers in 0..1. Out: unit vectors towards light and their density. The
//! specular lobes (the base's, also stretched, and a coat's) give mirror images of the view about
//! visible normals (`microfacet.zig`), light in the surface and on fibres the cosine, light from
//! behind the cosine on that side, panes the lobe of `transmission.zig`. So far as weights of
//! samples go, one density stands for all lobes: the mean of theirs by share (the balance heuristic
//! of Veach and Guibas 1995). Everything is + - * / sqrt in a fixed order.

const std = @import("std");
const simd = @import("../../simd.zig");
const bsdf_file = @import("bsdf.zig");
const chi_squared = @import("chi_squared.zig");
const microfacet = @import("microfacet.zig");
const test_surface = @import("test_surface.zig");
const transmission = @import("transmission.zig");
const Bsdf = @import("bsdf.zig").Bsdf;
const Interaction = @import("interaction.zig").Interaction;

/// A unit vector towards light for three numbers in 0..1, the first of which chooses the lobe. It
/// has the density `pdf` but for what the microfacets of panes scatter. Directions on the side
/// that the lobe is not on bring nothing.
pub fn sample(
    comptime Lanes: type,
    bsdf: *const Bsdf(Lanes),
    point: *const Interaction(Lanes),
    numbers: [3]Lanes.F32,
) Lanes.Vec3 {
    const shares: Shares(Lanes) = .of(bsdf, point);
    const disc = microfacet.disc(Lanes, .{ numbers[1], numbers[2] });
    const across = microfacet.tangents(Lanes, point.normal);
    const view = local(Lanes, across, point.view, bsdf.cos_view);
    const reflected = mirrored(Lanes, view, .{ bsdf.alpha, bsdf.alpha }, disc);
    const height = Lanes.F32.splat(1).sub(disc[0].mul(disc[0])).sub(disc[1].mul(disc[1]));
    const cosine = height.max(.zero()).sqrt();
    const scattered: Lanes.Vec3 = .{ .x = disc[0], .y = disc[1], .z = cosine };
    const is_specular = numbers[0].lt(shares.specular);
    const chosen: Lanes.Vec3 = .select(is_specular, reflected, scattered);
    var way = turn(Lanes, across, point.normal, chosen);
    if (bsdf.sees_behind) way = further(Lanes, bsdf, point, &shares, numbers, way);
    return way;
}

/// That of a lobe of layers or behind the surface where the first number chooses one, else `way`.
noinline fn further(
    comptime Lanes: type,
    bsdf: *const Bsdf(Lanes),
    point: *const Interaction(Lanes),
    shares: *const Shares(Lanes),
    numbers: [3]Lanes.F32,
    way: Lanes.Vec3,
) Lanes.Vec3 {
    const number = numbers[0];
    const disc = microfacet.disc(Lanes, .{ numbers[1], numbers[2] });
    var found = way;
    if (bsdf.layered) {
        const stretch = &bsdf.stretch;
        if (stretch.lanes.any()) {
            const axes = [2]Lanes.Vec3{ stretch.tangent, stretch.bitangent };
            const image = mirrored(Lanes, stretch.view, stretch.highlights(), disc);
            const lanes = stretch.lanes.bitAnd(number.lt(shares.specular));
            found = .select(lanes, turn(Lanes, axes, point.normal, image), found);
        }
        const coating = &bsdf.coating;
        const across = microfacet.tangents(Lanes, coating.normal);
        const view = local(Lanes, across, point.view, coating.cos_view);
        const image = mirrored(Lanes, view, .{ coating.alpha, coating.alpha }, disc);
        const on_coat = number.ge(shares.specular).bitAnd(number.lt(shares.to_coat));
        found = .select(on_coat, turn(Lanes, across, coating.normal, image), found);
        const is_behind = number.ge(shares.to_coat).bitAnd(number.lt(shares.to_behind));
        // The base's own direction by the cosine, mirrored at the surface.
        const along = point.normal.dot(way);
        const beyond = way.sub(point.normal.scale(along.add(along)));
        found = .select(is_behind, beyond, found);
    }
    const in_pane = number.ge(shares.to_behind).bitAnd(number.lt(shares.to_pane));
    if (in_pane.none()) return found;
    const boundary = transmission.boundaryOf(Lanes, point, bsdf.alpha, point.eta);
    const through = boundary.sample(.{ numbers[1], numbers[2] }).to_light;
    return .select(in_pane, through, found);
}

/// Density of `sample` by solid angle, per steradian, on the whole sphere. Its integral is 1 less
/// the share of what the microfacets of panes scatter, see `transmission.Direction`.
pub fn pdf(
    comptime Lanes: type,
    bsdf: *const Bsdf(Lanes),
    point: *const Interaction(Lanes),
    to_light: Lanes.Vec3,
) Lanes.F32 {
    const shares: Shares(Lanes) = .of(bsdf, point);
    const half = point.view.add(to_light).normalize();
    var specular = visible(Lanes, &.{
        .normal = point.normal,
        .cos_view = bsdf.cos_view,
        .smith_view = bsdf.smith_view,
        .alpha = bsdf.alpha,
    }, half);
    if (bsdf.layered and bsdf.stretch.lanes.any()) {
        const stretched = bsdf.stretch.visible(point, half);
        specular = .select(bsdf.stretch.lanes, stretched, specular);
    }
    const along = point.normal.dot(to_light);
    const inverse_pi: Lanes.F32 = .splat(1.0 / std.math.pi);
    const diffuse = along.max(.zero()).mul(inverse_pi);
    const rest = Lanes.F32.splat(1).sub(shares.to_pane);
    var density = specular.mul(shares.specular).add(diffuse.mul(rest));
    if (!bsdf.sees_behind) return density;
    if (bsdf.layered) {
        const coat = visible(Lanes, &.{
            .normal = bsdf.coating.normal,
            .cos_view = bsdf.coating.cos_view,
            .smith_view = bsdf.coating.smith_view,
            .alpha = bsdf.coating.alpha,
        }, half);
        density = density.add(coat.mul(shares.to_coat.sub(shares.specular)));
        const behind = along.neg().max(.zero()).mul(inverse_pi);
        density = density.add(behind.mul(shares.to_behind.sub(shares.to_coat)));
    }
    const share = shares.to_pane.sub(shares.to_behind);
    const paned = share.gt(.zero());
    if (paned.none()) return density;
    const boundary = transmission.boundaryOf(Lanes, point, bsdf.alpha, point.eta);
    const through = boundary.pdf(to_light).mul(share);
    return density.add(.select(paned, through, .zero()));
}

/// Up to which number each lobe is chosen, 0..1: the base's specular lobe first, then the coat,
/// diffuse light from behind, panes; light from the front by the cosine takes the rest. Without
/// layers and transmission all are the first.
fn Shares(comptime Lanes: type) type {
    const F32 = Lanes.F32;
    const Vec3 = Lanes.Vec3;
    return struct {
        specular: F32,
        to_coat: F32,
        to_behind: F32,
        to_pane: F32,

        inline fn of(bsdf: *const Bsdf(Lanes), point: *const Interaction(Lanes)) @This() {
            const ones: Vec3 = .splat(.{ 1, 1, 1 });
            const specular = bsdf.specular_albedo.dot(ones);
            var whole = specular.add(bsdf.diffuse_albedo.dot(ones));
            var coat = specular;
            var behind = specular;
            if (bsdf.layered) {
                coat = specular.add(bsdf.coating.albedo.mul(.splat(3)));
                behind = coat.add(bsdf.back_albedo.dot(ones));
                whole = whole.add(bsdf.coating.sheen_albedo.dot(ones)).add(behind.sub(specular));
            }
            var pane = behind;
            if (bsdf.sees_behind) {
                const through = bsdf.mirror.transmitted.dot(ones);
                const thin = F32.select(point.material.volume, .zero(), through);
                pane = behind.add(thin);
                whole = whole.add(thin);
            }
            const bounded = whole.max(.splat(1e-12));
            return .{
                .specular = specular.div(bounded),
                .to_coat = coat.div(bounded),
                .to_behind = behind.div(bounded),
                .to_pane = pane.div(bounded),
            };
        }
    };
}

/// Even microfacets from one direction.
fn Facets(comptime Lanes: type) type {
    return struct {
        normal: Lanes.Vec3,
        cos_view: Lanes.F32,
        /// See `microfacet.smith`.
        smith_view: Lanes.F32,
        alpha: Lanes.F32,
    };
}

/// Density of mirror images about visible normals, by their half vector.
inline fn visible(
    comptime Lanes: type,
    facets: *const Facets(Lanes),
    half: Lanes.Vec3,
) Lanes.F32 {
    const cos_half = facets.normal.dot(half).min(.splat(1));
    const a = facets.alpha.mul(facets.alpha);
    const seen = facets.cos_view.add(facets.smith_view);
    const density = microfacet.distribution(Lanes, cos_half, a).div(seen.add(seen));
    return .select(cos_half.gt(.zero()), density, .zero());
}

/// A view in the frame of tangents and normal, to which it has at least this cosine.
inline fn local(
    comptime Lanes: type,
    across: [2]Lanes.Vec3,
    view: Lanes.Vec3,
    cosine: Lanes.F32,
) Lanes.Vec3 {
    const components: Lanes.Vec3 = .{
        .x = across[0].dot(view),
        .y = across[1].dot(view),
        .z = cosine,
    };
    return components.normalize();
}

/// Mirror image of a view about a normal that it sees, for a point of the disc, all in the frame.
inline fn mirrored(
    comptime Lanes: type,
    view: Lanes.Vec3,
    alphas: [2]Lanes.F32,
    disc: [2]Lanes.F32,
) Lanes.Vec3 {
    const half = microfacet.visibleNormalOf(Lanes, view, alphas, disc);
    const twice = view.dot(half).mul(.splat(2));
    return half.scale(twice).sub(view);
}

/// Out of the frame, as a unit vector.
inline fn turn(
    comptime Lanes: type,
    across: [2]Lanes.Vec3,
    normal: Lanes.Vec3,
    way: Lanes.Vec3,
) Lanes.Vec3 {
    return across[0].scale(way.x).add(across[1].scale(way.y))
        .add(normal.scale(way.z)).normalize();
}

const Single = simd.Lanes(.scalar, 1);

/// A surface of all lobes that are asked for, off the axes so that frames are in it.
const Surface = struct {
    point: Interaction(Single),
    bsdf: Bsdf(Single),

    const Change = struct {
        cosine: f32 = 0.8,
        metallic: f32 = 0,
        roughness: f32 = 0.7,
        transmission: f32 = 0,
        coat: f32 = 0,
        sheen: f32 = 0,
        anisotropy: f32 = 0,
        diffuse_transmission: f32 = 0,
    };

    fn of(change: Change) Surface {
        const axes = [3]Single.Vec3{
            .splat(.{ 0.8, -0.6, 0 }), .splat(.{ 0.36, 0.48, -0.8 }), .splat(.{ 0.48, 0.64, 0.6 }),
        };
        var surface: Surface = undefined;
        const point = &surface.point;
        point.* = test_surface.pointAt(Single, .{ 0, 1, 0 });
        point.normal = axes[1];
        point.normal_geometric = axes[1];
        const sine = @sqrt(1 - change.cosine * change.cosine);
        point.view = axes[0].scale(.splat(sine)).add(axes[1].scale(.splat(change.cosine)));
        point.material.metallic = .splat(change.metallic);
        point.material.roughness = .splat(change.roughness);
        point.material.transmission = .splat(change.transmission);
        var layers = test_surface.layersOf(Single);
        layers.clearcoat = .splat(change.coat);
        layers.clearcoat_roughness = .splat(0.5);
        layers.clearcoat_normal = axes[1].add(axes[2].scale(.splat(0.3))).normalize();
        layers.sheen_color = .splat(@splat(change.sheen));
        layers.sheen_roughness = .splat(0.6);
        layers.anisotropy = .splat(change.anisotropy);
        layers.tangent = axes[2];
        layers.diffuse_transmission = .splat(change.diffuse_transmission);
        surface.bsdf.albedo = .unknown;
        surface.bsdf.becomeLayered(point, &layers);
        return surface;
    }

    pub fn sample(surface: *const Surface, numbers: [3]f32) [3]f32 {
        const lanes: [3]Single.F32 = .{
            .splat(numbers[0]), .splat(numbers[1]), .splat(numbers[2]),
        };
        return surface.bsdf.sample(&surface.point, lanes).lane(0);
    }

    pub fn pdf(surface: *const Surface, to_light: [3]f32) f32 {
        return surface.bsdf.pdf(&surface.point, .splat(to_light)).lane(0);
    }

    fn eval(surface: *const Surface, to_light: [3]f32) f32 {
        const way: Single.Vec3 = .splat(to_light);
        const behind = bsdf_file.behind(Single, &surface.point, way, surface.bsdf.back_albedo
            .add(surface.bsdf.mirror.transmitted)).lane(0);
        const seen = if (behind)
            surface.bsdf.evalBehind(&surface.point, way, surface.bsdf.mirror.transmitted)
        else
            surface.bsdf.eval(&surface.point, way);
        return seen.x.lane(0);
    }

    fn albedo(surface: *const Surface) f32 {
        const bsdf = &surface.bsdf;
        return bsdf.specular_albedo.add(bsdf.diffuse_albedo).add(bsdf.coating.sheen_albedo)
            .add(bsdf.back_albedo).add(bsdf.mirror.transmitted).x.add(bsdf.coating.albedo).lane(0);
    }
};

const changes = [_]Surface.Change{
    .{ .metallic = 0.5, .roughness = 0.6, .sheen = 1, .anisotropy = 0.6 },
    // A pane so smooth that its microfacets scatter next to nothing.
    .{
        .roughness = 0.28,
        .transmission = 0.5,
        .coat = 1,
        .sheen = 0.5,
        .diffuse_transmission = 0.5,
    },
};

test "samples of layered surfaces have their density, by chi-squared" {
    for (changes) |change| {
        errdefer std.debug.print("{any}\n", .{change});
        try chi_squared.expectDistributed(&Surface.of(change));
    }
}

test "the mean weight of samples is the albedo of all lobes" {
    const count = 2048;
    const scattering: Surface.Change = .{ .coat = 0.5, .transmission = 0.6, .sheen = 0.5 };
    for (changes ++ .{scattering}) |change| {
        const surface: Surface = .of(change);
        var sum: f64 = 0;
        for (0..count) |index| {
            // Points spread evenly by powers of one number
            // (Roberts 2018, "The Unreasonable Effectiveness of Quasirandom Sequences").
            var numbers: [3]f32 = undefined;
            for (&numbers, [_]f64{ 0.8191725134, 0.6710436067, 0.5497004779 }) |*number, step| {
                const whole = 0.5 + step * @as(f64, @floatFromInt(index));
                number.* = @floatCast(@min(whole - @floor(whole), 0.999999));
            }
            const way = surface.sample(numbers);
            const density = surface.pdf(way);
            try std.testing.expect(density > 0);
            sum += surface.eval(way) / density / count;
        }
        errdefer std.debug.print("{any}\n", .{change});
        try std.testing.expectApproxEqRel(surface.albedo(), sum, 0.03);
    }
}

test "every lobe is chosen by its share of the albedo" {
    const all: Surface.Change = .{
        .coat = 1,
        .sheen = 0.5,
        .transmission = 0.5,
        .diffuse_transmission = 0.5,
    };
    const surface: Surface = .of(all);
    const shares: Shares(Single) = .of(&surface.bsdf, &surface.point);
    const whole = surface.albedo();
    const coat = surface.bsdf.coating.albedo.lane(0);
    const behind = surface.bsdf.back_albedo.x.lane(0);
    const pane = surface.bsdf.mirror.transmitted.x.lane(0);
    try std.testing.expect(coat > 0 and behind > 0 and pane > 0);
    const found = [_]Single.F32{
        shares.to_coat.sub(shares.specular),
        shares.to_behind.sub(shares.to_coat),
        shares.to_pane.sub(shares.to_behind),
        Single.F32.splat(1).sub(shares.to_pane),
    };
    const diffuse = surface.bsdf.diffuse_albedo.add(surface.bsdf.coating.sheen_albedo).x.lane(0);
    for (found, [_]f32{ coat, behind, pane, diffuse }) |share, part| {
        try std.testing.expectApproxEqAbs(part / whole, share.lane(0), 1e-5);
    }
}

const Four = simd.Lanes(.scalar, 4);

test "a lane without layers has the bits of the plain BSDF beside one with all" {
    for ([_]f32{ 0, 0.4, 1 }) |metallic| for ([_]f32{ 0, 0.5 }) |clear| {
        var point = test_surface.pointAt(Four, .{ 0.6, 0.8, 0 });
        point.material.base_color = .splat(.{ 0.9, 0.3, 0.5 });
        point.material.metallic = .splat(metallic);
        point.material.roughness = .splat(0.4);
        point.material.transmission = .splat(clear);
        var layers = test_surface.layersOf(Four);
        layers.present = Four.F32.iota().lt(.splat(2));
        inline for (.{
            "clearcoat",   "clearcoat_roughness", "sheen_roughness",
            "iridescence", "anisotropy",          "diffuse_transmission",
        }) |name| @field(layers, name) = .splat(0.7);
        layers.specular = .splat(0.3);
        layers.specular_color = .splat(.{ 1, 0.2, 0.1 });
        layers.sheen_color = .splat(.{ 1, 1, 1 });
        var mixed: Bsdf(Four) = undefined;
        mixed.albedo = .unknown;
        mixed.becomeLayered(&point, &layers);
        const plain: Bsdf(Four) = .of(&point);
        const behind: Four.Vec3 = .splat(.{ 0.36, -0.8, 0.48 });
        const light: Four.Vec3 = .splat(.{ -0.48, 0.8, 0.36 });
        const numbers: [3]Four.F32 = .{ .splat(0.9), .splat(0.3), .splat(0.2) };
        const pairs = [_][2]Four.Vec3{
            .{ plain.specular_albedo, mixed.specular_albedo },
            .{ plain.diffuse_albedo, mixed.diffuse_albedo },
            .{ plain.mirror.reflected, mixed.mirror.reflected },
            .{ plain.mirror.transmitted, mixed.mirror.transmitted },
            .{ plain.back_albedo, mixed.back_albedo },
            .{ plain.evalLobes(&point, light).diffuse, mixed.evalLobes(&point, light).diffuse },
            .{ plain.evalLobes(&point, light).specular, mixed.evalLobes(&point, light).specular },
            .{
                plain.evalBehind(&point, behind, plain.mirror.transmitted),
                mixed.evalBehind(&point, behind, mixed.mirror.transmitted),
            },
            .{ plain.sample(&point, numbers), mixed.sample(&point, numbers) },
        };
        for (pairs, 0..) |pair, index| {
            errdefer std.debug.print("pair {d}\n", .{index});
            try std.testing.expectEqual(bitsOf(pair[0].lane(3)), bitsOf(pair[1].lane(3)));
        }
        for ([_]Four.Vec3{ light, behind }) |way| {
            const density = plain.pdf(&point, way).lane(3);
            try std.testing.expectEqual(density, mixed.pdf(&point, way).lane(3));
        }
        // The other lanes are something else.
        try std.testing.expect(pairs[0][0].x.lane(1) != pairs[0][1].x.lane(1));
    };
}

fn bitsOf(components: [3]f32) [3]u32 {
    return @bitCast(components);
}
