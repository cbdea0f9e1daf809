//! The metallic-roughness material of glTF 2.0 at points in lanes.
//!
//! In: the materials' numbers, the vertex colours at the points. Out: the parameters of the BSDF,
//! and what a surface lets straight through.

const std = @import("std");
const world_file = @import("../../world.zig");
const simd = @import("../../simd.zig");
const Unique = @import("unique.zig").Unique;

/// A material in lanes: fields of `world.Material`, base colour times the vertex colour.
pub fn Material(comptime Lanes: type) type {
    return struct {
        base_color: Lanes.Vec3,
        emissive: Lanes.Vec3,
        metallic: Lanes.F32,
        roughness: Lanes.F32,
        dielectric_f0: Lanes.F32,
        ior: Lanes.F32,
        transmission: Lanes.F32,
        /// Share of the light from all sides that arrives.
        occlusion: Lanes.F32,
        unlit: Lanes.Mask,
        volume: Lanes.Mask,
    };
}

/// A vertex colour in lanes, linear.
pub fn Color(comptime Lanes: type) type {
    return struct {
        rgb: Lanes.Vec3,
        alpha: Lanes.F32,

        /// That of a mesh without colours.
        pub const white: @This() = .{ .rgb = .splat(.{ 1, 1, 1 }), .alpha = .splat(1) };
    };
}

/// Some of a scene's materials in lanes.
pub fn Materials(comptime Lanes: type) type {
    return Records(Lanes, world_file.Material);
}

/// Some records of floats, put into lanes a field at a time: mostly there is one for all.
pub fn Records(comptime Lanes: type, comptime Record: type) type {
    return struct {
        all: []const Record,
        used: Unique(Lanes),

        const Self = @This();

        /// Those with these numbers in the lanes asked for.
        pub inline fn of(
            all: []const Record,
            numbers: Lanes.I32,
            asked: Lanes.Mask,
        ) Self {
            return .{ .all = all, .used = .of(numbers, asked) };
        }

        /// A field of one float.
        pub inline fn float(materials: *const Self, comptime name: []const u8) Lanes.F32 {
            return materials.pick(name, null);
        }

        /// A field of three floats, or the first three of more.
        pub inline fn color(materials: *const Self, comptime name: []const u8) Lanes.Vec3 {
            return .{
                .x = materials.pick(name, 0),
                .y = materials.pick(name, 1),
                .z = materials.pick(name, 2),
            };
        }

        /// A field of two floats.
        pub inline fn pair(materials: *const Self, comptime name: []const u8) [2]Lanes.F32 {
            return .{ materials.pick(name, 0), materials.pick(name, 1) };
        }

        /// A field, or a component of one.
        inline fn pick(
            materials: *const Self,
            comptime name: []const u8,
            comptime component: ?usize,
        ) Lanes.F32 {
            @setEvalBranchQuota(20_000);
            const used = &materials.used;
            var value: Lanes.F32 = .splat(materials.one(used.numbers[0], name, component));
            for (used.numbers[1..used.count], used.lanes[1..used.count]) |number, lanes| {
                value = .select(lanes, .splat(materials.one(number, name, component)), value);
            }
            return value;
        }

        inline fn one(
            materials: *const Self,
            number: u32,
            comptime name: []const u8,
            comptime component: ?usize,
        ) f32 {
            const value = &@field(materials.all[number], name);
            return if (component) |index| value[index] else value.*;
        }
    };
}

/// All that scattering depends on.
pub inline fn load(
    comptime Lanes: type,
    materials: *const Materials(Lanes),
    vertex_color: Lanes.Vec3,
) Material(Lanes) {
    const zero: Lanes.F32 = .zero();
    return .{
        .base_color = materials.color("base_color").mul(vertex_color),
        .emissive = materials.color("emissive"),
        .metallic = materials.float("metallic"),
        .roughness = materials.float("roughness"),
        .dielectric_f0 = materials.float("dielectric_f0"),
        .ior = materials.float("ior"),
        .transmission = materials.float("transmission"),
        .occlusion = .splat(1),
        .unlit = materials.float("unlit").gt(zero),
        .volume = materials.float("volume").gt(zero),
    };
}

/// What a surface shows that blends is left out where it is worth no more: in a file of many such
/// layers each would be shaded for a step of a millionth.
const opacity_min = 0x1p-16;

/// How much of the light is stopped at a surface, 0..1: 0 in holes, alpha where it blends.
pub inline fn opacity(
    comptime Lanes: type,
    materials: *const Materials(Lanes),
    vertex_alpha: Lanes.F32,
) Lanes.F32 {
    const F32 = Lanes.F32;
    const alpha = materials.pick("base_color", 3).mul(vertex_alpha);
    const blends = materials.float("blend").gt(.zero());
    const cutoff = materials.float("alpha_cutoff");
    const hole = alpha.lt(cutoff).bitAnd(cutoff.ge(.zero()));
    var clamped = alpha.max(.zero()).min(.splat(1));
    const faint = blends.bitAnd(clamped.le(.splat(opacity_min)));
    if (faint.any()) {
        const glow = materials.color("emissive");
        const shown = glow.x.max(glow.y).max(glow.z).max(.splat(1)).mul(clamped);
        clamped = .select(shown.le(.splat(opacity_min)), .zero(), clamped);
    }
    const solid = F32.select(hole, .zero(), .splat(1));
    return F32.select(blends, clamped, solid);
}

/// What a surface does to light that goes straight through it.
pub fn Attenuation(comptime Lanes: type) type {
    return struct {
        /// Share that comes out.
        share: Lanes.Vec3,
        /// Lanes where the surface is there at all: not in holes.
        weakens: Lanes.Mask,
        /// Of the share, what alpha leaves open, and what goes through in the base colour.
        open: Lanes.F32,
        clear: Lanes.Vec3,

        /// Past what alpha leaves open, and in the base colour through what transmits, by a share
        /// that textures and reflection leave of it.
        pub inline fn of(
            materials: *const Materials(Lanes),
            color: Color(Lanes),
            passing: Lanes.F32,
        ) @This() {
            const one: Lanes.F32 = .splat(1);
            const stopped = opacity(Lanes, materials, color.alpha);
            const white: Lanes.Vec3 = .splat(.{ 1, 1, 1 });
            const base = materials.color("base_color").mul(color.rgb).min(white);
            const clear = materials.float("transmission")
                .mul(one.sub(materials.float("metallic"))).mul(passing);
            const rest = one.sub(stopped);
            // Scattered, but as much of it, which is taken to go straight on.
            const solid = one.sub(materials.float("transmission"))
                .mul(one.sub(materials.float("metallic")));
            const diffuse = materials.color("diffuse_through").scale(solid);
            const through = base.scale(clear).add(diffuse);
            return .{
                .share = through.scale(stopped).add(.{ .x = rest, .y = rest, .z = rest }),
                .weakens = stopped.gt(.zero()),
                .open = rest,
                .clear = base.scale(clear.mul(stopped)),
            };
        }

        /// Only what is not scattered comes out: what alpha leaves open and, in these lanes, what
        /// goes through.
        pub inline fn sharpen(attenuation: *@This(), lanes: Lanes.Mask) void {
            const open = attenuation.open;
            const clear: Lanes.Vec3 = .select(lanes, attenuation.clear, .splat(.{ 0, 0, 0 }));
            attenuation.share = clear.add(.{ .x = open, .y = open, .z = open });
        }

        /// Surfaces in these lanes are not there.
        pub inline fn hide(attenuation: *@This(), lanes: Lanes.Mask) void {
            attenuation.share = .select(lanes, .splat(.{ 1, 1, 1 }), attenuation.share);
            attenuation.weakens = attenuation.weakens.andNot(lanes);
        }
    };
}

test "what blends and stops less light than can be seen is a hole, but for what glows through it" {
    const Single = simd.Lanes(.scalar, 1);
    for ([_]struct { f32, f32, f32 }{
        .{ 1e-6, 0, 0 },
        .{ 1e-6, 1, 0 },
        .{ 1e-6, 1000, 1e-6 },
        .{ 2e-5, 0, 2e-5 },
        .{ opacity_min, 0, 0 },
        .{ -1, 1000, 0 },
        .{ 2, 0, 1 },
    }) |one| {
        var material = std.mem.zeroes(world_file.Material);
        material.base_color[3] = one[0];
        material.emissive[1] = one[1];
        material.blend = 1;
        const materials: Materials(Single) = .of(&.{material}, .splat(0), .splat(true));
        try std.testing.expectEqual(one[2], opacity(Single, &materials, .splat(1)).lane(0));
    }
}
