//! What a path tracer asks of a surface, in lanes: directions that light comes from, what they are
//! worth, and their density for multiple importance sampling.
//!
//! In: points, their BSDF, numbers in 0..1. Out: samples, and for light from elsewhere the BSDF
//! times cosine with the density that a sample has there. A lobe is chosen by its share of the
//! albedo for the view, weighed by what the channels of the path are worth; the specular lobes give
//! mirror images about visible normals (`sampling.zig`), fibres the whole hemisphere, light in the
//! surface the cosine, what comes through `passing.zig`. One density stands for all lobes that have
//! one: the mean of theirs by share (the balance heuristic of Veach and Guibas 1995). Lobes that
//! are narrower than `sampling.sharp_alpha_least` are directions. So a white surface weighs 1 in
//! the mean. Everything is + - * / sqrt in a fixed order.

const std = @import("std");
const simd = @import("../../simd.zig");
const bsdf_file = @import("bsdf.zig");
const chi_squared = @import("chi_squared.zig");
const microfacet = @import("microfacet.zig");
const sampling = @import("sampling.zig");
const test_surface = @import("test_surface.zig");
const Bsdf = @import("bsdf.zig").Bsdf;
const Interaction = @import("interaction.zig").Interaction;
const Layers = @import("layers.zig").Layers;
const Passing = @import("passing.zig").Passing;

/// A direction that paths go on to.
pub fn Sample(comptime Lanes: type) type {
    return struct {
        /// Unit vector towards light; undefined where the path ends.
        to_light: Lanes.Vec3,
        /// What light from there counts: BSDF times cosine over density.
        weight: Lanes.Vec3,
        /// Density by solid angle, per steradian; 0 where `is_delta`.
        pdf: Lanes.F32,
        /// The direction is in no lobe that `Scatter.eval` has: emitters that are met there count
        /// in full.
        is_delta: Lanes.Mask,
        /// The path goes on behind the triangle.
        crosses: Lanes.Mask,
        /// Nothing goes on.
        is_end: Lanes.Mask,
    };
}

/// Light from a direction.
pub fn Seen(comptime Lanes: type) type {
    return struct {
        /// BSDF times cosine.
        value: Lanes.Vec3,
        /// Density of `Scatter.sample` by solid angle, per steradian: 0 for what is a direction.
        pdf: Lanes.F32,
    };
}

/// Probabilities of the lobes.
fn Shares(comptime Lanes: type) type {
    const F32 = Lanes.F32;
    const Vec3 = Lanes.Vec3;
    return struct {
        specular: F32,
        coat: F32,
        sheen: F32,
        behind: F32,
        through: F32,
        /// What the others leave.
        cosine: F32,

        /// Those of a BSDF whose specular lobe inside volumes is that of `passing`; `worth` weighs
        /// the channels.
        fn become(
            shares: *@This(),
            bsdf: *const Bsdf(Lanes),
            passing: *const Passing(Lanes),
            worth: Vec3,
        ) void {
            const specular =
                F32.select(passing.inside, .zero(), bsdf.specular_albedo.dot(worth));
            var whole = specular.add(bsdf.diffuse_albedo.dot(worth));
            shares.coat = .zero();
            shares.sheen = .zero();
            shares.behind = .zero();
            shares.through = .zero();
            if (bsdf.layered) {
                const coat = worth.x.add(worth.y).add(worth.z).mul(bsdf.coating.albedo);
                shares.coat = coat;
                shares.sheen = bsdf.coating.sheen_albedo.dot(worth);
                shares.behind = bsdf.back_albedo.dot(worth);
                whole = whole.add(coat).add(shares.sheen).add(shares.behind);
            }
            if (passing.any) {
                shares.through = passing.share(worth);
                whole = whole.add(shares.through);
            }
            const scale = F32.splat(1).div(whole.max(.splat(1e-12)));
            shares.specular = specular.mul(scale);
            shares.coat = shares.coat.mul(scale);
            shares.sheen = shares.sheen.mul(scale);
            shares.behind = shares.behind.mul(scale);
            shares.through = shares.through.mul(scale);
            shares.cosine = F32.splat(1).sub(shares.specular).sub(shares.coat).sub(shares.sheen)
                .sub(shares.behind).sub(shares.through).max(.zero());
        }
    };
}

/// A direction, a lobe at a time.
fn Chosen(comptime Lanes: type) type {
    const Vec3 = Lanes.Vec3;
    const Mask = Lanes.Mask;
    return struct {
        to_light: Vec3,
        /// Lanes in no lobe that `Scatter.eval` has, and what they are worth.
        alone: Mask,
        weight: Vec3,

        inline fn put(chosen: *@This(), lanes: Mask, to_light: Vec3) void {
            chosen.to_light = .select(lanes, to_light, chosen.to_light);
        }

        inline fn putAlone(chosen: *@This(), lanes: Mask, weight: Vec3, odds: Lanes.F32) void {
            const inverse = Lanes.F32.splat(1).div(odds.max(.splat(1e-12)));
            chosen.alone = chosen.alone.bitOr(lanes);
            chosen.weight = .select(lanes, weight.scale(inverse), chosen.weight);
        }
    };
}

/// Surfaces at points.
pub fn Scatter(comptime Lanes: type) type {
    const F32 = Lanes.F32;
    const Vec3 = Lanes.Vec3;
    const Mask = Lanes.Mask;
    return struct {
        point: *const Interaction(Lanes),
        bsdf: *const Bsdf(Lanes),
        /// Lanes that scatter: that are seen and not unlit.
        scatters: Mask,
        /// Lanes whose specular lobe, and whose coat's, is a direction.
        sharp: Mask,
        coat_sharp: Mask,
        /// Lanes with a lobe narrower than highlights of light without size are, and what was taken
        /// out of the BSDF.
        narrow: Mask,
        taken: struct { f0: Vec3, f90: F32, multiple: Vec3, coat_weight: F32 },
        passing: Passing(Lanes),
        shares: Shares(Lanes),

        const Self = @This();
        const none: Vec3 = .splat(.{ 0, 0, 0 });
        const inverse_pi: F32 = .splat(1.0 / std.math.pi);

        /// Becomes that of points. `bsdf` is theirs, and changes: its lobes get the roughness that
        /// the surface has, and those that are here elsewhere are taken out of it. `throughput` is
        /// what the channels of paths are worth. All has to stay where it is.
        pub noinline fn become(
            scatter: *Self,
            point: *const Interaction(Lanes),
            bsdf: *Bsdf(Lanes),
            layers: *const Layers(Lanes),
            seen: Mask,
            throughput: Vec3,
        ) void {
            const material = &point.material;
            scatter.point = point;
            scatter.bsdf = bsdf;
            scatter.scatters = seen.andNot(material.unlit);
            sampling.sharpen(Lanes, point, bsdf);
            const largest = throughput.x.max(throughput.y).max(throughput.z);
            const worth = throughput.scale(F32.splat(1).div(largest.max(.splat(1e-30))));
            const passing = &scatter.passing;
            passing.become(point, bsdf, layers, worth);
            scatter.sharp = sampling.isSharp(Lanes, material.roughness);
            const least: F32 = .splat(bsdf_file.highlight_roughness_least);
            scatter.narrow = material.roughness.lt(least);
            scatter.taken.f0 = bsdf.f0;
            scatter.taken.f90 = bsdf.f90;
            scatter.taken.multiple = bsdf.multiple;
            if (bsdf.layered) {
                scatter.sharp = scatter.sharp.andNot(bsdf.stretch.lanes);
                const coating = &bsdf.coating;
                const has_coat = coating.weight.gt(.zero());
                scatter.narrow = scatter.narrow
                    .bitOr(has_coat.bitAnd(coating.roughness.lt(least)));
                scatter.taken.coat_weight = coating.weight;
                scatter.coat_sharp = sampling.isSharp(Lanes, coating.roughness);
                coating.weight = .select(scatter.coat_sharp, .zero(), coating.weight);
            }
            if (passing.any) {
                const denser = material.volume.bitAnd(point.eta.gt(.splat(1)));
                scatter.sharp = scatter.sharp.bitOr(denser.bitAnd(passing.sharp))
                    .andNot(passing.inside);
            }
            gather(Lanes, bsdf);
            const gone = scatter.sharp.bitOr(passing.inside);
            bsdf.f0 = .select(gone, none, bsdf.f0);
            bsdf.f90 = .select(gone, .zero(), bsdf.f90);
            scatter.shares.become(bsdf, passing, worth);
        }

        /// A direction for four numbers in 0..1: the lobe, two for the direction in it, and what
        /// becomes of light at a boundary.
        pub noinline fn sample(scatter: *const Self, numbers: [4]F32) Sample(Lanes) {
            const point = scatter.point;
            var chosen: Chosen(Lanes) = .{
                .to_light = undefined,
                .alone = .splat(false),
                .weight = none,
            };
            scatter.sampleBase(numbers, &chosen);
            if (scatter.bsdf.layered) scatter.sampleLayers(numbers, &chosen);
            if (scatter.passing.any) scatter.sampleThrough(numbers, &chosen);
            const above = point.normal_geometric.dot(chosen.to_light);
            var weight = chosen.weight;
            var pdf: F32 = .zero();
            if (chosen.alone.bitNot().bitAnd(scatter.scatters).any()) {
                const seen = scatter.eval(chosen.to_light);
                const inverse = F32.splat(1).div(seen.pdf.max(.splat(1e-30)));
                const shown = seen.pdf.gt(.zero()).andNot(chosen.alone);
                weight = .select(shown, seen.value.scale(inverse), weight);
                pdf = .select(shown, seen.pdf, .zero());
            }
            const largest = weight.x.max(weight.y).max(weight.z);
            return .{
                .to_light = chosen.to_light,
                .weight = weight,
                .pdf = pdf,
                .is_delta = chosen.alone,
                .crosses = above.lt(.zero()),
                .is_end = largest.gt(.zero()).bitAnd(scatter.scatters).bitNot(),
            };
        }

        /// The specular lobe, else the cosine's.
        fn sampleBase(scatter: *const Self, numbers: [4]F32, chosen: *Chosen(Lanes)) void {
            const point = scatter.point;
            const bsdf = scatter.bsdf;
            const disc = microfacet.disc(Lanes, .{ numbers[1], numbers[2] });
            const across = microfacet.tangents(Lanes, point.normal);
            const height = F32.splat(1).sub(disc[0].mul(disc[0])).sub(disc[1].mul(disc[1]));
            const cosine = height.max(.zero()).sqrt();
            const spread: Vec3 = .{ .x = disc[0], .y = disc[1], .z = cosine };
            const is_specular = numbers[0].lt(scatter.shares.specular);
            const facets = sampling.baseOf(Lanes, point, bsdf);
            const image = facets.mirrored(across, point.view, disc);
            const local: Vec3 = .select(is_specular, image, spread);
            chosen.to_light = sampling.turn(Lanes, across, point.normal, local);
            if (bsdf.layered and bsdf.stretch.lanes.any()) {
                const lanes = is_specular.bitAnd(bsdf.stretch.lanes);
                chosen.put(lanes, bsdf.stretch.sample(point, disc));
            }
            const sharp = is_specular.bitAnd(scatter.sharp);
            if (sharp.none()) return;
            chosen.put(sharp, bsdf_file.reflect(Lanes, point));
            chosen.putAlone(sharp, bsdf.mirror.reflected, scatter.shares.specular);
        }

        noinline fn sampleLayers(
            scatter: *const Self,
            numbers: [4]F32,
            chosen: *Chosen(Lanes),
        ) void {
            const point = scatter.point;
            const coating = &scatter.bsdf.coating;
            const shares = &scatter.shares;
            const number = numbers[0];
            const to_coat = shares.specular.add(shares.coat);
            const to_sheen = to_coat.add(shares.sheen);
            const to_behind = to_sheen.add(shares.behind);
            const disc = microfacet.disc(Lanes, .{ numbers[1], numbers[2] });
            const squared = disc[0].mul(disc[0]).add(disc[1].mul(disc[1])).min(.splat(1));
            const across = microfacet.tangents(Lanes, point.normal);
            const on_coat = number.ge(shares.specular).bitAnd(number.lt(to_coat));
            const axes = microfacet.tangents(Lanes, coating.normal);
            const facets = sampling.coatOf(Lanes, coating);
            const image = facets.mirrored(axes, point.view, disc);
            chosen.put(on_coat, sampling.turn(Lanes, axes, coating.normal, image));
            const sharp = on_coat.bitAnd(scatter.coat_sharp);
            chosen.put(sharp, bsdf_file.mirrored(Lanes, point, coating.normal));
            const coat = coating.albedo;
            chosen.putAlone(sharp, .{ .x = coat, .y = coat, .z = coat }, shares.coat);
            const even = sampling.evenOf(Lanes, disc);
            const on_fibres = number.ge(to_coat).bitAnd(number.lt(to_sheen));
            chosen.put(on_fibres, sampling.turn(Lanes, across, point.normal, even));
            const below: Vec3 = .{
                .x = disc[0],
                .y = disc[1],
                .z = F32.splat(1).sub(squared).sqrt().neg(),
            };
            const is_behind = number.ge(to_sheen).bitAnd(number.lt(to_behind));
            chosen.put(is_behind, sampling.turn(Lanes, across, point.normal, below));
        }

        fn sampleThrough(scatter: *const Self, numbers: [4]F32, chosen: *Chosen(Lanes)) void {
            const shares = &scatter.shares;
            const from = shares.specular.add(shares.coat).add(shares.sheen).add(shares.behind);
            const lanes = numbers[0].ge(from).bitAnd(numbers[0].lt(from.add(shares.through)));
            if (lanes.none()) return;
            const found = scatter.passing.sample(.{ numbers[1], numbers[2], numbers[3] });
            chosen.put(lanes, found.to_light);
            chosen.putAlone(lanes.bitAnd(found.alone), found.weight, shares.through);
        }

        /// Light from a direction, a unit vector, that has a density.
        pub noinline fn eval(scatter: *const Self, to_light: Vec3) Seen(Lanes) {
            const point = scatter.point;
            const bsdf = scatter.bsdf;
            const shares = &scatter.shares;
            const lobes = bsdf.evalLobes(point, to_light);
            const front = point.normal_geometric.dot(to_light).gt(.zero());
            const along = point.normal.dot(to_light);
            const half = point.view.add(to_light).normalize();
            const even = sampling.baseOf(Lanes, point, bsdf).pdf(half);
            var images = even;
            if (bsdf.layered and bsdf.stretch.lanes.any()) {
                const stretched = bsdf.stretch.visible(point, half);
                images = .select(bsdf.stretch.lanes, stretched, images);
            }
            images = .select(scatter.sharp, .zero(), images);
            const cosine = along.max(.zero()).mul(inverse_pi);
            var seen: Seen(Lanes) = .{
                .value = .select(front, lobes.diffuse.add(lobes.specular), none),
                .pdf = images.mul(shares.specular).add(cosine.mul(shares.cosine)),
            };
            if (bsdf.layered) scatter.addLayers(&seen, along, half, to_light);
            if (!scatter.passing.any) return seen;
            const through = scatter.passing.eval(point, to_light, even, half);
            seen.value = seen.value.add(through.value);
            seen.pdf = seen.pdf.add(through.pdf.mul(shares.through));
            return seen;
        }

        /// The value of `eval` in `lanes` where light has no size: no sample meets it, and narrow
        /// lobes show it as highlights as wide as they are for other integrators
        /// (`bsdf.highlight_roughness_least`). Elsewhere `value`.
        pub noinline fn evalPoint(
            scatter: *const Self,
            to_light: Vec3,
            lanes: Mask,
            value: Vec3,
        ) Vec3 {
            const point = scatter.point;
            const front = point.normal_geometric.dot(to_light).gt(.zero());
            const narrow = lanes.bitAnd(scatter.narrow).bitAnd(front);
            if (narrow.none()) return value;
            const taken = &scatter.taken;
            var wide = scatter.bsdf.*;
            wide.f0 = .select(scatter.sharp, taken.f0, wide.f0);
            wide.f90 = .select(scatter.sharp, taken.f90, wide.f90);
            wide.multiple = .select(scatter.sharp, taken.multiple, wide.multiple);
            if (wide.layered) wide.coating.weight = taken.coat_weight;
            sampling.widen(Lanes, point, &wide);
            const lobes = wide.evalLobes(point, to_light);
            return .select(narrow, lobes.diffuse.add(lobes.specular), value);
        }

        fn addLayers(
            scatter: *const Self,
            seen: *Seen(Lanes),
            along: F32,
            half: Vec3,
            to_light: Vec3,
        ) void {
            const point = scatter.point;
            const bsdf = scatter.bsdf;
            const shares = &scatter.shares;
            const back = bsdf.evalBack(point, to_light);
            const front = point.normal_geometric.dot(to_light).ge(.zero());
            seen.value = seen.value.add(.select(front, none, back));
            const coat = sampling.coatOf(Lanes, &bsdf.coating).pdf(half);
            const rough = F32.select(scatter.coat_sharp, .zero(), coat).mul(shares.coat);
            const even: F32 = .splat(0.5 / std.math.pi);
            const sheen = F32.select(along.gt(.zero()), even, .zero()).mul(shares.sheen);
            const behind = along.neg().max(.zero()).mul(inverse_pi).mul(shares.behind);
            seen.pdf = seen.pdf.add(rough).add(sheen).add(behind);
        }
    };
}

/// Puts light that microfacets send on more than once into the lobe of what they send on
/// once (Turquin 2019, "Practical multiple scattering compensation for microfacet models"),
/// as path tracers do that others compare with: Kulla and Conty's lobe is as wide as the
/// hemisphere, and brings colours of all of it.
fn gather(comptime Lanes: type, bsdf: *Bsdf(Lanes)) void {
    const again = bsdf.multiple.scale(bsdf.albedo.missing_mean.mul(.splat(std.math.pi)));
    const whole = bsdf.specular_albedo;
    const once = whole.sub(again).max(.splat(@splat(1e-6)));
    const gain: Lanes.Vec3 = .{
        .x = whole.x.div(once.x),
        .y = whole.y.div(once.y),
        .z = whole.z.div(once.z),
    };
    bsdf.f0 = bsdf.f0.mul(gain);
    bsdf.f90 = bsdf.f90.mul(gain.dot(.splat(@splat(1.0 / 3.0))));
    bsdf.multiple = .splat(.{ 0, 0, 0 });
}

const Single = simd.Lanes(.scalar, 1);

/// What surfaces of all lobes may have.
const Change = struct {
    cosine: f32 = 0.8,
    color: [3]f32 = .{ 1, 1, 1 },
    metallic: f32 = 0,
    roughness: f32 = 0.7,
    transmission: f32 = 0,
    /// Of a boundary of a volume; null where thin.
    eta: ?f32 = null,
    dispersion: f32 = 0,
    coat: f32 = 0,
    coat_roughness: f32 = 0.5,
    coat_tilt: f32 = 0.3,
    sheen: f32 = 0,
    anisotropy: f32 = 0,
    iridescence: f32 = 0,
    diffuse_transmission: f32 = 0,
    throughput: [3]f32 = .{ 1, 1, 1 },
    /// How far the normal for shading is bent away from the triangle's.
    tilt: f32 = 0,
    is_layered: bool = true,
    unlit: bool = false,
};

/// Surfaces in lanes, off the axes so that frames are in it.
fn Surface(comptime Lanes: type) type {
    return struct {
        point: Interaction(Lanes),
        layers: Layers(Lanes),
        bsdf: Bsdf(Lanes),
        scatter: Scatter(Lanes),
        /// Of all lobes, as the BSDF has it for the view.
        albedo: Lanes.Vec3,

        const Self = @This();
        const Changes = [Lanes.count]Change;

        fn become(surface: *Self, lanes: Changes) void {
            surface.place(lanes);
            const layers = &surface.layers;
            layers.* = test_surface.layersOf(Lanes);
            layers.present = maskOf(lanes, "is_layered");
            layers.clearcoat = floatOf(lanes, "coat");
            layers.clearcoat_roughness = floatOf(lanes, "coat_roughness");
            layers.clearcoat_normal = axes[1].add(axes[2].scale(floatOf(lanes, "coat_tilt")))
                .normalize();
            const sheen = floatOf(lanes, "sheen");
            layers.sheen_color = .{ .x = sheen, .y = sheen, .z = sheen };
            layers.sheen_roughness = .splat(0.6);
            layers.tangent = axes[2];
            inline for (.{
                "anisotropy", "iridescence", "dispersion", "diffuse_transmission",
            }) |name| @field(layers, name) = floatOf(lanes, name);
            const bsdf = &surface.bsdf;
            bsdf.albedo = .unknown;
            const is_layered = layers.present.any();
            if (is_layered)
                bsdf.becomeLayered(&surface.point, layers)
            else
                bsdf.become(&surface.point);
            surface.albedo = bsdf.specular_albedo.add(bsdf.diffuse_albedo).add(bsdf.back_albedo)
                .add(bsdf.mirror.transmitted);
            if (is_layered) {
                const coat = bsdf.coating.albedo;
                surface.albedo = surface.albedo.add(bsdf.coating.sheen_albedo)
                    .add(.{ .x = coat, .y = coat, .z = coat });
            }
            const throughput = colorOf(lanes, "throughput");
            surface.scatter.become(&surface.point, bsdf, layers, .splat(true), throughput);
        }

        const axes = [3]Lanes.Vec3{
            .splat(.{ 0.8, -0.6, 0 }), .splat(.{ 0.36, 0.48, -0.8 }), .splat(.{ 0.48, 0.64, 0.6 }),
        };

        fn place(surface: *Self, lanes: Changes) void {
            const point = &surface.point;
            point.* = test_surface.pointAt(Lanes, .{ 0, 1, 0 });
            point.normal_geometric = axes[1];
            point.normal = axes[1].sub(axes[0].scale(floatOf(lanes, "tilt"))).normalize();
            const cosine = floatOf(lanes, "cosine");
            const sine = Lanes.F32.splat(1).sub(cosine.mul(cosine)).sqrt();
            point.view = axes[0].scale(sine).add(axes[1].scale(cosine));
            const material = &point.material;
            material.base_color = colorOf(lanes, "color");
            inline for (.{ "metallic", "roughness", "transmission" }) |name| {
                @field(material, name) = floatOf(lanes, name);
            }
            material.unlit = maskOf(lanes, "unlit");
            var etas: [Lanes.count]f32 = undefined;
            var volumes: [Lanes.count]bool = undefined;
            for (&etas, &volumes, lanes) |*eta, *volume, change| {
                eta.* = change.eta orelse 1;
                volume.* = change.eta != null;
            }
            material.volume = .fromArray(volumes);
            point.eta = .fromArray(etas);
        }

        fn floatOf(lanes: Changes, comptime name: []const u8) Lanes.F32 {
            var array: [Lanes.count]f32 = undefined;
            for (&array, lanes) |*to, change| to.* = @field(change, name);
            return .fromArray(array);
        }

        fn maskOf(lanes: Changes, comptime name: []const u8) Lanes.Mask {
            var array: [Lanes.count]bool = undefined;
            for (&array, lanes) |*to, change| to.* = @field(change, name);
            return .fromArray(array);
        }

        fn colorOf(lanes: Changes, comptime name: []const u8) Lanes.Vec3 {
            var channels: [3][Lanes.count]f32 = undefined;
            for (lanes, 0..) |change, lane| {
                for (&channels, @field(change, name)) |*to, channel| to[lane] = channel;
            }
            return .{
                .x = .fromArray(channels[0]),
                .y = .fromArray(channels[1]),
                .z = .fromArray(channels[2]),
            };
        }

        fn draw(surface: *const Self, numbers: [4]f32) Sample(Lanes) {
            var all: [4]Lanes.F32 = undefined;
            for (&all, numbers) |*to, number| to.* = .splat(number);
            return surface.scatter.sample(all);
        }

        fn eval(surface: *const Self, to_light: [3]f32) Seen(Lanes) {
            return surface.scatter.eval(.splat(to_light));
        }

        /// Of lane 0, by channel.
        fn meanWeight(surface: *const Self, count: usize) [3]f64 {
            var sums: [3]f64 = @splat(0);
            for (0..count) |index| {
                const found = surface.draw(numbersOf(index));
                if (found.is_end.lane(0)) continue;
                for (&sums, found.weight.lane(0)) |*sum, channel| {
                    sum.* += channel / @as(f64, @floatFromInt(count));
                }
            }
            return sums;
        }
    };
}

/// Points of Halton 1960 ("On the Efficiency of Certain Quasi-Random Sequences of Points").
fn numbersOf(index: usize) [4]f32 {
    var numbers: [4]f32 = undefined;
    for (&numbers, [_]usize{ 5, 2, 3, 7 }) |*number, base| {
        var rest = index;
        var digit: f64 = 1;
        var sum: f64 = 0;
        while (rest > 0) : (rest /= base) {
            digit /= @floatFromInt(base);
            sum += digit * @as(f64, @floatFromInt(rest % base));
        }
        number.* = @floatCast(sum);
    }
    return numbers;
}

/// Of every lobe, alone and with others.
const changes = [_]Change{
    .{ .roughness = 0.4, .is_layered = false },
    .{ .metallic = 1, .roughness = 1 },
    .{ .metallic = 1, .roughness = 0.2, .cosine = 0.1 },
    .{ .metallic = 0.5, .roughness = 0.6, .sheen = 1, .anisotropy = 0.6 },
    .{ .roughness = 0.02, .coat = 1, .coat_roughness = 0 },
    .{ .roughness = 0.5, .coat = 1, .sheen = 0.5, .diffuse_transmission = 0.6 },
    .{ .roughness = 0, .transmission = 1 },
    .{ .roughness = 0.8, .transmission = 0.5, .is_layered = false },
    .{ .roughness = 0, .transmission = 1, .eta = 1.0 / 1.5 },
    .{ .roughness = 0, .transmission = 1, .eta = 1.5, .is_layered = false },
    .{ .roughness = 0, .transmission = 1, .eta = 1.5, .cosine = 0.3 },
    .{ .roughness = 0.5, .transmission = 1, .eta = 1.0 / 1.5, .is_layered = false },
    .{ .roughness = 0.5, .transmission = 1, .eta = 1.5, .is_layered = false },
    .{ .roughness = 0.7, .transmission = 1, .eta = 1.5, .cosine = 0.4 },
    .{ .roughness = 0.5, .transmission = 0.5, .eta = 1.5, .cosine = 0.9 },
    .{ .roughness = 0.5, .transmission = 1, .eta = 1.0 / 1.5, .dispersion = 2 },
    .{ .roughness = 0.3, .transmission = 1, .eta = 1.5, .dispersion = 2, .coat = 0.5 },
    .{ .roughness = 0, .transmission = 1, .eta = 1.5, .dispersion = 1 },
    .{ .roughness = 0.4, .transmission = 0.7, .eta = 1, .diffuse_transmission = 0.5 },
};

test "white furnace: the mean weight of every lobe's samples is its albedo" {
    var surface: Surface(Single) = undefined;
    for (changes) |change| {
        surface.become(.{change});
        errdefer std.debug.print("{any}\n", .{change});
        // Channels together, for one alone may be chosen.
        const weight = surface.meanWeight(1024);
        const albedo = surface.albedo.dot(.splat(.{ 1, 1, 1 })).lane(0);
        try std.testing.expectApproxEqAbs(albedo, weight[0] + weight[1] + weight[2], 0.03);
    }
}

test "weight times density is the BSDF times cosine, and no weight is far from the mean" {
    var surface: Surface(Single) = undefined;
    var seen: [3]usize = @splat(0);
    for (changes) |change| {
        surface.become(.{change});
        errdefer std.debug.print("{any}\n", .{change});
        var worst: f32 = 0;
        for (0..64) |index| {
            const found = surface.draw(numbersOf(index));
            if (found.is_end.lane(0)) continue;
            const way = found.to_light.lane(0);
            const weight = found.weight.lane(0);
            try std.testing.expectApproxEqAbs(1, found.to_light.length().lane(0), 1e-5);
            worst = @max(worst, @max(weight[0], weight[1], weight[2]));
            const above = surface.point.normal_geometric.dot(found.to_light).lane(0);
            try std.testing.expectEqual(above < 0, found.crosses.lane(0));
            seen[@intFromBool(found.crosses.lane(0))] += 1;
            if (found.is_delta.lane(0)) {
                try std.testing.expectEqual(0, found.pdf.lane(0));
                seen[2] += 1;
                continue;
            }
            const there = surface.eval(way);
            try std.testing.expectEqual(there.pdf.lane(0), found.pdf.lane(0));
            for (weight, there.value.lane(0)) |part, value| {
                try std.testing.expectApproxEqRel(value, part * found.pdf.lane(0), 1e-5);
            }
        }
        const channels: f32 = if (change.dispersion > 0) 3 else 1;
        // Of rough metals what is scattered again makes up for more than half.
        try std.testing.expect(worst < 3 * channels);
    }
    for (seen) |count| try std.testing.expect(count > 100);
}

/// For `chi_squared.zig`, whose three numbers become four: the low bits of one are another.
const Distributed = struct {
    surface: *const Surface(Single),

    pub fn sample(lobe: *const Distributed, numbers: [3]f32) ?[3]f32 {
        const shifted = numbers[1] * 4096;
        const last = shifted - @floor(shifted);
        const all = [4]f32{ numbers[0], numbers[1], numbers[2], last };
        const found = lobe.surface.draw(all);
        return if (found.is_delta.lane(0)) null else found.to_light.lane(0);
    }

    pub fn pdf(lobe: *const Distributed, to_light: [3]f32) f32 {
        return lobe.surface.eval(to_light).pdf.lane(0);
    }
};

test "samples have their density, by chi-squared" {
    const some = [_]Change{
        .{
            .metallic = 0.3,
            .sheen = 1,
            .anisotropy = 0.6,
            .coat = 1,
            .transmission = 0.5,
            .diffuse_transmission = 0.5,
        },
        .{ .transmission = 1, .eta = 1.5, .cosine = 0.6, .dispersion = 5, .sheen = 0.5 },
    };
    var surface: Surface(Single) = undefined;
    for (some) |change| {
        surface.become(.{change});
        errdefer std.debug.print("{any}\n", .{change});
        try chi_squared.expectDistributed(&Distributed{ .surface = &surface });
    }
}

test "every lobe is chosen by its share of the albedo" {
    var surface: Surface(Single) = undefined;
    const all: Change = .{
        .coat = 1,
        .sheen = 0.5,
        .transmission = 0.5,
        .diffuse_transmission = 0.5,
    };
    surface.become(.{all});
    const whole = surface.albedo.x.lane(0);
    const bsdf = &surface.bsdf;
    const shares = &surface.scatter.shares;
    for ([_]Single.F32{ shares.coat, shares.sheen, shares.behind, shares.through }, [_]Single.F32{
        bsdf.coating.albedo, bsdf.coating.sheen_albedo.x,
        bsdf.back_albedo.x,  bsdf.mirror.transmitted.x,
    }) |share, albedo| {
        try std.testing.expect(albedo.lane(0) > 0.01);
        try std.testing.expectApproxEqAbs(albedo.lane(0) / whole, share.lane(0), 1e-5);
    }
    const base = bsdf.specular_albedo.add(bsdf.diffuse_albedo).x.lane(0);
    const rest = shares.specular.add(shares.cosine).lane(0);
    try std.testing.expectApproxEqAbs(base / whole, rest, 1e-5);
    // Red light alone: blue lobes are not worth a ray.
    surface.become(.{.{
        .transmission = 0.5,
        .color = .{ 0, 0, 1 },
        .throughput = .{ 1, 0, 0 },
    }});
    try std.testing.expectEqual(0, surface.scatter.shares.through.lane(0));
}

test "edges: finite, of unit length, never more than the lobes have" {
    const roughnesses = [_]f32{ 0, 1e-3, 0.032, 0.1, 1 };
    const cosines = [_]f32{ 0, 1e-3, 0.4, 1 };
    const corners = [_][4]f32{
        .{ 0, 0, 0, 0 },           .{ 0.9999999, 0.5, 0.5, 0 },
        .{ 0.5, 0.9999999, 0, 1 }, .{ 0.9999999, 0, 0.9999999, 0.9999999 },
    };
    var surface: Surface(Single) = undefined;
    for ([_]?f32{ null, 1, 0.999, 1.003, 1.0 / 1.5, 2.4 }) |eta| {
        for (0..roughnesses.len * cosines.len) |index| {
            const roughness = roughnesses[index / cosines.len];
            const cosine = cosines[index % cosines.len];
            const change: Change = .{
                .eta = eta,
                .roughness = roughness,
                .cosine = cosine,
                .transmission = 1,
                .tilt = if (cosine > 0.5) 0.8 else 0,
                .dispersion = if (cosine > 0.3) 1 else 0,
                .is_layered = cosine > 0.3,
            };
            surface.become(.{change});
            errdefer std.debug.print("{any}\n", .{change});
            for (corners) |numbers| try expectSane(&surface, numbers);
            const view = surface.point.view.lane(0);
            for ([_][3]f32{ view, .{ -view[0], -view[1], -view[2] } }) |way| {
                const seen = surface.eval(way);
                try std.testing.expect(isSane(seen.pdf.lane(0)));
                for (seen.value.lane(0)) |part| try std.testing.expect(isSane(part));
            }
        }
    }
}

fn isSane(value: f32) bool {
    return std.math.isFinite(value) and value >= 0;
}

fn expectSane(surface: *const Surface(Single), numbers: [4]f32) !void {
    const found = surface.draw(numbers);
    try std.testing.expect(isSane(found.pdf.lane(0)));
    for (found.weight.lane(0)) |part| try std.testing.expect(isSane(part) and part < 30);
    if (found.is_end.lane(0)) return;
    try std.testing.expectApproxEqAbs(1, found.to_light.length().lane(0), 1e-5);
    const above = surface.point.normal_geometric.dot(found.to_light).lane(0);
    try std.testing.expect(found.is_delta.lane(0) or above != 0);
}

test "total reflection inside: nothing comes through, but where microfacets let it" {
    var surface: Surface(Single) = undefined;
    for ([_]f32{ 0, 0.6 }) |roughness| {
        const change: Change =
            .{ .transmission = 1, .eta = 1.5, .cosine = 0.5, .roughness = roughness };
        surface.become(.{change});
        var passed: usize = 0;
        for (0..200) |index| {
            const found = surface.draw(numbersOf(index));
            if (roughness == 0) try std.testing.expect(found.is_delta.lane(0));
            try std.testing.expectApproxEqAbs(1, found.weight.x.lane(0), 1e-4);
            if (found.crosses.lane(0)) passed += 1;
        }
        if (roughness == 0) try std.testing.expectEqual(0, passed);
        if (roughness > 0) try std.testing.expect(passed > 10 and passed < 150);
    }
}

test "paths end at unlit and at black surfaces" {
    var surface: Surface(Single) = undefined;
    const black: Change = .{ .metallic = 1, .color = @splat(0), .cosine = 1 };
    for ([_]Change{ .{ .unlit = true }, black }) |one| {
        surface.become(.{one});
        for (0..16) |index| {
            const found = surface.draw(numbersOf(index));
            if (one.unlit) try std.testing.expect(found.is_end.lane(0));
            try std.testing.expect(found.is_end.lane(0) or found.weight.x.lane(0) < 0.2);
        }
    }
}

test "reciprocity, but for what is scattered more than once: light and view change places" {
    var surface: Surface(Single) = undefined;
    for ([_]f32{ 0.06, 0.3, 1 }, [_]f32{ 0.01, 0.05, 0.4 }) |roughness, again| for (0..8) |index| {
        const change: Change = .{ .roughness = roughness, .metallic = 0.5 };
        surface.become(.{change});
        const found = surface.draw(numbersOf(index));
        if (found.is_end.lane(0)) continue;
        const view = surface.point.view;
        const cosines = [2]f32{
            surface.point.normal.dot(view).lane(0),
            surface.point.normal.dot(found.to_light).lane(0),
        };
        const there = surface.eval(found.to_light.lane(0)).value.x.lane(0) / cosines[1];
        surface.point.view = found.to_light;
        const bsdf = &surface.bsdf;
        bsdf.becomeLayered(&surface.point, &surface.layers);
        surface.scatter
            .become(&surface.point, bsdf, &surface.layers, .splat(true), .splat(.{ 1, 1, 1 }));
        const back = surface.eval(view.lane(0)).value.x.lane(0) / cosines[0];
        try std.testing.expectApproxEqRel(there, back, again);
    };
}

test "every lane has the bits that its surface has alone" {
    const Four = simd.Lanes(.vector, 4);
    var together: Surface(Four) = undefined;
    var alone: Surface(Single) = undefined;
    var first: usize = 0;
    while (first + 4 <= changes.len) : (first += 3) {
        const four = changes[first..][0..4].*;
        together.become(four);
        for (0..12) |index| {
            const all = together.draw(numbersOf(index));
            for (four, 0..) |change, lane| {
                alone.become(.{change});
                const one = alone.draw(numbersOf(index));
                errdefer std.debug.print("{any}\n", .{change});
                try std.testing.expectEqual(one.is_end.lane(0), all.is_end.lane(lane));
                if (one.is_end.lane(0)) continue;
                try std.testing.expectEqual(one.to_light.lane(0), all.to_light.lane(lane));
                try std.testing.expectEqual(one.weight.lane(0), all.weight.lane(lane));
                try std.testing.expectEqual(one.pdf.lane(0), all.pdf.lane(lane));
                try std.testing.expectEqual(one.is_delta.lane(0), all.is_delta.lane(lane));
                try std.testing.expectEqual(one.crosses.lane(0), all.crosses.lane(lane));
            }
        }
    }
}

test "light without size has the highlights of narrow lobes that other integrators give it" {
    var surface: Surface(Single) = undefined;
    const way = [3]f32{ 0.6, 0.0, -0.8 };
    for ([_]Change{
        .{ .roughness = 0, .metallic = 1, .is_layered = false },
        .{ .roughness = 0.04, .coat = 1, .coat_roughness = 0 },
        .{ .roughness = 0.3, .anisotropy = 0.5 },
    }) |change| {
        surface.become(.{change});
        const seen = surface.eval(way).value;
        const none = surface.scatter.evalPoint(.splat(way), .splat(false), seen).lane(0);
        try std.testing.expectEqual(seen.lane(0), none);
        const found = surface.scatter.evalPoint(.splat(way), .splat(true), seen).lane(0);
        var fresh: Bsdf(Single) = undefined;
        fresh.albedo = .unknown;
        if (change.is_layered)
            fresh.becomeLayered(&surface.point, &surface.layers)
        else
            fresh.become(&surface.point);
        const wanted = fresh.eval(&surface.point, .splat(way)).lane(0);
        // They have another lobe for what is scattered more than once.
        for (wanted, found) |a, b| try std.testing.expectApproxEqRel(a, b, 0.02);
        try std.testing.expect(found[0] > 0);
        try std.testing.expectEqual(change.roughness < 0.05, found[0] != seen.x.lane(0));
    }
}
