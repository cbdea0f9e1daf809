//! Glass and what it holds: pictures whose middle is known from Beer's and Fresnel's laws.
//!
//! Slabs lie across the axis, so that rays along it do not bend: what a ray or light loses is a
//! product of what boundaries reflect and volumes absorb.

const std = @import("std");
const fixture = @import("fixture.zig");
const raylane = @import("raylane");
const Builder = fixture.Builder;
const Material = raylane.scene.Material;
const gpa = std.testing.allocator;
const variants = @import("variants.zig");

/// Of the walls of glass, of the wine in it, and of the boundary between.
const glass_ior = 1.5;
const wine_ior = 1.33;
const glass_passes = 1 - squared((glass_ior - 1.0) / (glass_ior + 1.0));
const wine_passes = 1 - squared((wine_ior - 1.0) / (wine_ior + 1.0));
const between_passes = 1 - squared((glass_ior - wine_ior) / (glass_ior + wine_ior));

/// Shares that are left after a metre.
const glass_color = [3]f32{ 0.9, 0.8, 0.7 };
const wine_color = [3]f32{ 0.6, 0.3, 0.2 };

fn squared(x: f32) f32 {
    return x * x;
}

fn clear(ior: f32, color: [3]f32) Material {
    var material = fixture.matte(.{ 1, 1, 1 });
    material.roughness = 0;
    material.transmission = 1;
    material.volume = true;
    material.double_sided = false;
    material.ior = ior;
    material.attenuation_color = color;
    material.attenuation_distance = 1;
    return material;
}

/// A slab between two heights on the axis, open at its far sides.
fn addSlab(builder: *Builder, material: Material, front: f32, back: f32) !void {
    try builder.addQuad(material, .{ 0, 0, front }, .{ 9, 0, 0 }, .{ 0, 9, 0 });
    try builder.addQuad(material, .{ 0, 0, back }, .{ -9, 0, 0 }, .{ 0, 9, 0 });
}

/// A glass that holds wine, cut along the axis: its wine reaches into the walls by `overlap`.
fn addWineGlass(builder: *Builder, overlap: f32, is_wine_first: bool) !void {
    const wine = clear(wine_ior, wine_color);
    const glass = clear(glass_ior, glass_color);
    if (is_wine_first) try addSlab(builder, wine, -4 + overlap, -6 - overlap);
    try addSlab(builder, glass, -3, -4);
    try addSlab(builder, glass, -6, -7.5);
    if (!is_wine_first) try addSlab(builder, wine, -4 + overlap, -6 - overlap);
}

/// What comes through that glass: glass wins where both are.
fn throughWineGlass(channel: usize) f32 {
    const glass = std.math.pow(f32, glass_color[channel], 2.5);
    const wine = std.math.pow(f32, wine_color[channel], 2);
    return squared(glass_passes) * squared(between_passes) * glass * wine;
}

fn middleOf(builder: *Builder, depth_max: u32) ![4]f32 {
    var scene = try builder.finish();
    defer scene.deinit();
    var image = try fixture.render(&scene, .{
        .width = 1,
        .height = 1,
        .ambient = 0,
        .depth_max = depth_max,
    });
    defer image.deinit(gpa);
    return image.at(0, 0).*;
}

test "wine in a glass: a product of four boundaries and three ways, whether they overlap or touch" {
    for ([_]f32{ 0.01, 0 }) |overlap| for ([_]bool{ false, true }) |is_wine_first| {
        var builder: Builder = try .init();
        try addWineGlass(&builder, overlap, is_wine_first);
        const wall = fixture.flat(.{ 1, 1, 1 });
        try builder.addQuad(wall, .{ 0, 0, -8 }, .{ 9, 0, 0 }, .{ 0, 9, 0 });
        try builder.addCamera(.{ 0, 0, 0 }, 1);
        const pixel = try middleOf(&builder, 4);
        errdefer std.debug.print("overlap {d}, {}, {any}\n", .{ overlap, is_wine_first, pixel });
        for (pixel[0..3], 0..) |seen, channel| {
            try std.testing.expectApproxEqRel(throughWineGlass(channel), seen, 5e-4);
        }
    };
}

/// What a wall at -8 that is seen from -7.9 scatters of light of `kind` from above, or a surface
/// at -7 of all in between.
fn lit(kind: anytype, comptime add: fn (*Builder) anyerror!void, wall_z: f32) ![4]f32 {
    var builder: Builder = try .init();
    try add(&builder);
    const wall = fixture.matte(.{ 1, 1, 1 });
    try builder.addQuad(wall, .{ 0, 0, wall_z }, .{ 9, 0, 0 }, .{ 0, 9, 0 });
    const node = try builder.addNode(.translate(.{ 0, 0, 2 }));
    try builder.scene.addLight(.{ .kind = kind, .node = node, .intensity = 100 });
    try builder.addCamera(.{ 0, 0, wall_z + 0.1 }, 1);
    return middleOf(&builder, 0);
}

const shadowers = struct {
    fn nothing(_: *Builder) !void {}

    fn slab(builder: *Builder) !void {
        try addSlab(builder, clear(glass_ior, glass_color), -3, -5);
    }

    fn pane(builder: *Builder) !void {
        var material = clear(glass_ior, glass_color);
        material.volume = false;
        material.base_color = .{ 0.5, 0.25, 2, 1 };
        try builder.addQuad(material, .{ 0, 0, -3 }, .{ 9, 0, 0 }, .{ 0, 9, 0 });
    }

    fn overlapping(builder: *Builder) !void {
        try addWineGlass(builder, 0.01, false);
    }

    fn touching(builder: *Builder) !void {
        try addWineGlass(builder, 0, false);
    }

    fn ball(builder: *Builder) !void {
        try builder.addSphere(clear(glass_ior, glass_color), .{ 0, 0, -4 }, 1, 16);
    }

    fn coloredPane(builder: *Builder) !void {
        var material = clear(glass_ior, .{ 1, 1, 1 });
        material.base_color = .{ 0.5, 0.5, 0.5, 1 };
        material.attenuation_distance = std.math.inf(f32);
        try addSlab(builder, material, -3, -5);
    }
};

fn expectLit(
    comptime add: fn (*Builder) anyerror!void,
    wall_z: f32,
    expected: [3]f32,
) !void {
    const Kind = @FieldType(raylane.scene.Light, "kind");
    for ([_]Kind{ .directional, .point }) |kind| {
        const free = try lit(kind, shadowers.nothing, wall_z);
        const dimmed = try lit(kind, add, wall_z);
        errdefer std.debug.print("{t}: {any} of {any}\n", .{ kind, dimmed, free });
        for (free[0..3], dimmed[0..3], expected) |whole, part, share| {
            try std.testing.expectApproxEqRel(share, part / whole, 1e-4);
        }
    }
}

fn absorbed(passes: f32, distance: f32) [3]f32 {
    var shares: [3]f32 = undefined;
    for (&shares, glass_color) |*share, color| {
        share.* = passes * std.math.pow(f32, color, distance);
    }
    return shares;
}

test "light through a slab, through half of it, and through a ball" {
    const passes = squared(glass_passes);
    try expectLit(shadowers.slab, -8, absorbed(passes, 2));
    // It ends inside.
    try expectLit(shadowers.slab, -4.5, absorbed(glass_passes, 1.5));
    try expectLit(shadowers.ball, -8, absorbed(passes, 2));
    try expectLit(shadowers.coloredPane, -8, @splat(0.25 * passes));
    // Colours never add light.
    try expectLit(shadowers.pane, -8, .{ 0.5 * glass_passes, 0.25 * glass_passes, glass_passes });
}

test "light through wine in a glass, whether they overlap or touch" {
    var expected: [3]f32 = undefined;
    for (&expected, 0..) |*share, channel| share.* = throughWineGlass(channel);
    try expectLit(shadowers.overlapping, -8, expected);
    try expectLit(shadowers.touching, -8, expected);
}

test "surfaces that do not close, and more volumes than are kept, do no harm in any variant" {
    var builder: Builder = try .init();
    var random = std.Random.DefaultPrng.init(5);
    const numbers = random.random();
    for (0..24) |index| {
        const shade = 0.3 + 0.02 * @as(f32, @floatFromInt(index));
        const material = clear(1 + numbers.float(f32), .{ shade, 0.9, 0.8 });
        const center = [3]f32{
            numbers.float(f32) - 0.5, numbers.float(f32) - 0.5, -3 - numbers.float(f32),
        };
        if (index % 2 == 0)
            try builder.addSphere(material, center, 0.3 + numbers.float(f32), 5)
        else
            try builder.addQuad(material, center, .{ 0.5, 0, shade }, .{ 0, 0.7, 0 });
    }
    try builder.addQuad(fixture.matte(.{ 1, 1, 1 }), .{ 0, 0, -6 }, .{ 9, 0, 0 }, .{ 0, 9, 0 });
    try builder.addPointLight(.{ 1, 3, 1 }, 300);
    // Inside of one of them.
    try builder.addCamera(.{ 0, 0, -2.8 }, 1);
    var scene = try builder.finish();
    defer scene.deinit();
    const options: fixture.Options = .{ .width = 13, .height = 11, .ambient = 0.2, .depth_max = 9 };
    var image = try fixture.render(&scene, options);
    defer image.deinit(gpa);
    for (image.pixels) |pixel| for (pixel) |channel| {
        try std.testing.expect(channel >= 0 and channel < 20);
    };
    try variants.expectAllVariants(&scene, options, image.hash());
}

/// A slab from -3 to -5 that bends no light and scatters some.
const fog_color = [3]f32{ 0.8, 0.4, 0.1 };
const fog_albedo = [3]f32{ 0.3, 0.9, 0.6 };

fn fog(color: [3]f32, albedo: [3]f32, anisotropy: f32) Material {
    var material = clear(1, color);
    material.multiscatter_color = albedo;
    material.scatter_anisotropy = anisotropy;
    return material;
}

/// Henyey and Greenstein's phase function of a cosine of 1 or -1.
fn phaseOf(cosine: f64, g: f64) f64 {
    return (1 - g * g) / (4 * std.math.pi * std.math.pow(f64, 1 + g * g - 2 * g * cosine, 1.5));
}

/// What the slab scatters to the eye of light of irradiance 1 along the axis, by the midpoint rule:
/// once, and the octaves that stand for the rest.
fn scatteredBySlab(channel: usize, g: f64, is_forward: bool) f64 {
    const sigma_t = -@log(@as(f64, fog_color[channel]));
    const multi: f64 = fog_albedo[channel];
    const root = @sqrt(9.59217 + 41.6808 * multi + 17.7126 * multi * multi);
    const albedo = 1 - std.math.pow(f64, 4.09712 + 4.20863 * multi - root, 2);
    const steps = 2000;
    var sum: f64 = 0;
    for (0..steps) |step| {
        const s = (@as(f64, @floatFromInt(step)) + 0.5) * 2 / steps;
        const cosine: f64 = if (is_forward) 1 else -1;
        const depth = sigma_t * if (is_forward) 2 - s else s;
        var arriving = @exp(-depth) * phaseOf(cosine, g);
        var weight: f64 = 1;
        for (1..5) |octave| {
            const half = std.math.pow(f64, 0.5, @floatFromInt(octave));
            weight *= albedo;
            const gained = @exp(-depth * half) - @exp(-depth * 2 * half);
            arriving += weight * gained * phaseOf(cosine, g * half);
        }
        sum += @exp(-sigma_t * s) * sigma_t * albedo * arriving * 2 / steps;
    }
    return sum;
}

test "a slab that scatters light from before or behind it: an integral over its depth" {
    for ([_]f32{ 0, 0.5 }) |g| for ([_]bool{ false, true }) |is_forward| {
        var builder: Builder = try .init();
        try addSlab(&builder, fog(fog_color, fog_albedo, g), -3, -5);
        const turn: [4]f32 = if (is_forward) .{ 0, 1, 0, 0 } else .{ 0, 0, 0, 1 };
        const node = try builder.addNode(.fromTrs(.{ 0, 0, 0 }, turn, .{ 1, 1, 1 }));
        try builder.scene.addLight(.{ .kind = .directional, .node = node, .intensity = 10 });
        try builder.addCamera(.{ 0, 0, 0 }, 1e-3);
        var scene = try builder.finish();
        defer scene.deinit();
        var image = try fixture.render(&scene, .{
            .width = 3,
            .height = 3,
            .ambient = 0,
            .depth_max = 2,
            .sample_count = 256,
        });
        defer image.deinit(gpa);
        for (0..3) |channel| {
            var mean: f32 = 0;
            for (image.pixels) |pixel| mean += pixel[channel] / 9;
            const expected: f32 = @floatCast(10 * scatteredBySlab(channel, g, is_forward));
            errdefer std.debug.print("g {d}, {}, channel {d}\n", .{ g, is_forward, channel });
            try std.testing.expectApproxEqRel(expected, mean, 5e-3);
        }
    };
}

test "furnace: what scatters all light cannot be seen in light from everywhere" {
    for ([_]f32{ 1, 0.5 }) |albedo| {
        var builder: Builder = try .init();
        const material = fog(@splat(0.3), @splat(albedo), -0.5);
        try builder.addSphere(material, .{ 0, 0, -5 }, 2, 12);
        try builder.addPointLight(.{ 0, 0, 0 }, 0);
        try builder.addCamera(.{ 0, 0, 0 }, 0.5);
        var scene = try builder.finish();
        defer scene.deinit();
        const options: fixture.Options = .{
            .width = 16,
            .height = 16,
            .ambient = 1,
            .background = .{ 1, 1, 1 },
        };
        var image = try fixture.render(&scene, options);
        defer image.deinit(gpa);
        for (image.pixels) |pixel| for (pixel) |channel| {
            try std.testing.expect(channel > 0 and channel < 1.0001);
            if (albedo == 1) try std.testing.expectApproxEqAbs(1, channel, 1e-4);
        };
        try std.testing.expect(albedo == 1 or image.at(8, 8).*[2] < 0.95);
        try variants.expectAllVariants(&scene, options, image.hash());
    }
}
