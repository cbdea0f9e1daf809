//! Light from all around: pictures that follow from a formula, and directions.
//!
//! In: images of radiance, written as Radiance files. Out: what surfaces, mirrors and eyes make of
//! them, by every variant.

const std = @import("std");
const fixture = @import("fixture.zig");
const raylane = @import("raylane");
const variants = @import("variants.zig");
const Builder = fixture.Builder;
const Image = raylane.image.Image;
const Session = raylane.session.Session;
const expect = std.testing.expect;
const gpa = std.testing.allocator;

/// An equirectangular image in a file of its own.
pub const Sky = struct {
    folder: std.testing.TmpDir,
    path: []u8,

    const width = 64;
    const height = 32;
    const Texels = [width * height][3]f32;

    /// Of these texels, as far as 8 bits and an exponent hold them.
    pub fn init(texels: *const Texels) !Sky {
        var sky: Sky = .{ .folder = std.testing.tmpDir(.{}), .path = undefined };
        errdefer sky.folder.cleanup();
        const io = std.testing.io;
        var bytes: std.Io.Writer.Allocating = .init(gpa);
        defer bytes.deinit();
        const writer = &bytes.writer;
        try writer.writeAll("#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n");
        try writer.print("-Y {d} +X {d}\n", .{ height, width });
        for (texels) |texel| {
            const largest = @max(texel[0], texel[1], texel[2]);
            if (largest < 1e-30) {
                try writer.writeAll(&.{ 0, 0, 0, 0 });
                continue;
            }
            const exponent = std.math.frexp(largest).exponent;
            for (texel) |channel| {
                try writer.writeByte(@intFromFloat(std.math.ldexp(channel, 8 - exponent)));
            }
            try writer.writeByte(@intCast(exponent + 128));
        }
        try sky.folder.dir.writeFile(io, .{ .sub_path = "sky.hdr", .data = bytes.written() });
        var buffer: [std.fs.max_path_bytes]u8 = undefined;
        const folder_path = buffer[0..try sky.folder.dir.realPath(io, &buffer)];
        sky.path = try std.fs.path.join(gpa, &.{ folder_path, "sky.hdr" });
        return sky;
    }

    /// Deletes the file.
    pub fn deinit(sky: *Sky) void {
        gpa.free(sky.path);
        sky.folder.cleanup();
    }

    /// One colour everywhere.
    pub fn plain(color: [3]f32) Texels {
        return @splat(color);
    }

    /// Has it around a scene.
    pub fn around(sky: *const Sky) raylane.settings.Environment {
        return .{ .source = .{ .file = sky.path } };
    }
};

fn sphere(material: raylane.scene.Material) !raylane.scene.Scene {
    var builder: Builder = try .init();
    try builder.addSphere(material, .{ 0, 0, -5 }, 2, 16);
    try builder.addCamera(.{ 0, 0, 0 }, 0.5);
    return builder.finish();
}

test "furnace: in a white environment what absorbs nothing cannot be seen" {
    var sky: Sky = try .init(&Sky.plain(@splat(1)));
    defer sky.deinit();
    for ([_]u32{ 0, 4 }) |shadow_count| {
        var options: fixture.Options = .{
            .width = 20,
            .height = 20,
            .environment = sky.around(),
            .see_environment = true,
            .sample_count = 4,
        };
        options.environment.shadow_count = shadow_count;
        var diagnostic: raylane.diagnostic.Diagnostic = .{};
        // Keeps the environment, which takes longer than a picture.
        var session: Session = .init(gpa, std.testing.io, 1, &diagnostic);
        defer session.deinit();
        var matte = fixture.matte(.{ 1, 1, 1 });
        for (0..7) |step| {
            if (step > 0) {
                matte.metallic = 1;
                matte.roughness = 0.2 * @as(f32, @floatFromInt(step - 1));
            }
            var scene = try sphere(matte);
            defer scene.deinit();
            try fixture.view(&session, &scene, raylane.variant.default.lanes, options);
            for ((try fixture.trace(&session, options)).pixels) |pixel| {
                const tolerance: f32 = if (step == 0) 0.01 else 0.02;
                for (pixel) |channel| try std.testing.expectApproxEqAbs(1, channel, tolerance);
            }
        }
    }
}

/// The picture of nothing but the sky along -z, by a wide angle.
fn look(environment: raylane.settings.Environment) !Image {
    var builder: Builder = try .init();
    try builder.addQuad(fixture.matte(.{ 0, 0, 0 }), .{ 0, 0, 5 }, .{ 1, 0, 0 }, .{ 0, 1, 0 });
    try builder.addCamera(.{ 0, 0, 0 }, 1);
    var scene = try builder.finish();
    defer scene.deinit();
    return fixture.render(&scene, .{
        .width = 64,
        .height = 64,
        .environment = environment,
        .see_environment = true,
    });
}

/// Where the picture is brightest, in -1..1.
fn brightest(image: *const Image) [2]f32 {
    var best: f32 = 0;
    var place: [2]f32 = undefined;
    for (0..image.height) |y| for (0..image.width) |x| {
        const value = image.at(@intCast(x), @intCast(y)).*[1];
        if (value <= best) continue;
        best = value;
        place = .{
            (@as(f32, @floatFromInt(x)) + 0.5) / @as(f32, @floatFromInt(image.width)) * 2 - 1,
            1 - (@as(f32, @floatFromInt(y)) + 0.5) / @as(f32, @floatFromInt(image.height)) * 2,
        };
    };
    return place;
}

test "a texel is seen where u and v say, and turns counter-clockwise from above" {
    const column = 20;
    const row = 11;
    var texels = Sky.plain(@splat(0));
    texels[row * Sky.width + column] = .{ 4, 8, 2 };
    var sky: Sky = try .init(&texels);
    defer sky.deinit();
    const u = (column + 0.5) / @as(f32, Sky.width);
    const v = (row + 0.5) / @as(f32, Sky.height);
    for ([_]f32{ 0, 30, -12 }) |turn_deg| {
        // u = atan2(z, x) / 2 pi + 0.5; counter-clockwise from above takes x to -z.
        const longitude = (u - 0.5) * 2 * std.math.pi - turn_deg * std.math.pi / 180.0;
        const colatitude = v * std.math.pi;
        const depth = -@sin(colatitude) * @sin(longitude);
        const expected = [2]f32{
            @sin(colatitude) * @cos(longitude) / depth,
            @cos(colatitude) / depth,
        };
        try expect(@abs(expected[0]) < 0.9 and @abs(expected[1]) < 0.9);
        var environment = sky.around();
        environment.rotation_deg = turn_deg;
        environment.intensity = 2;
        var image = try look(environment);
        defer image.deinit(gpa);
        const found = brightest(&image);
        for (expected, found) |wanted, seen| {
            try std.testing.expectApproxEqAbs(wanted, seen, 0.07);
        }
        const at_x: u32 = @intFromFloat((found[0] + 1) * 32);
        const at_y: u32 = @intFromFloat((1 - found[1]) * 32);
        const pixel = image.at(at_x, at_y).*;
        try expect(pixel[1] > 10 and pixel[1] <= 16);
        try std.testing.expectApproxEqRel(pixel[1] / 2, pixel[0], 0.01);
        try std.testing.expectApproxEqRel(pixel[1] / 4, pixel[2], 0.01);
    }
}

test "primary rays leave alpha, mirrors see the sky" {
    var sky: Sky = try .init(&Sky.plain(.{ 1, 0.5, 0.25 }));
    defer sky.deinit();
    var mirror = fixture.matte(.{ 1, 1, 1 });
    mirror.metallic = 1;
    mirror.roughness = 0;
    var scene = try sphere(mirror);
    defer scene.deinit();
    var image = try fixture.render(&scene, .{
        .environment = sky.around(),
        .background = .{ 0, 0, 1 },
    });
    defer image.deinit(gpa);
    const middle = image.at(16, 16).*;
    for ([_]f32{ 1, 0.5, 0.25 }, middle[0..3]) |wanted, seen| {
        try std.testing.expectApproxEqAbs(wanted, seen, 0.01);
    }
    try std.testing.expectEqual([4]f32{ 0, 0, 1, 1 }, image.at(0, 0).*);
}

/// A plane under a box, lit by a sky with a sun, seen from the side.
fn boxScene() !raylane.scene.Scene {
    const white = fixture.matte(.{ 0.8, 0.8, 0.8 });
    var builder: Builder = try .init();
    try builder.addQuad(white, .{ 0, -1, -5 }, .{ 20, 0, 0 }, .{ 0, 0, -20 });
    try builder.addQuad(white, .{ 0, -0.5, -5 }, .{ 1.2, 0, 0 }, .{ 0, 0, -1.2 });
    try builder.addQuad(white, .{ 0, -0.4, -5 }, .{ 1.2, 0, 0 }, .{ 0, 0, -1.2 });
    try builder.addSphere(fixture.matte(.{ 1, 0.2, 0.2 }), .{ 0, 0.3, -5 }, 0.6, 12);
    try builder.addCamera(.{ 0, 0, 0 }, 0.7);
    return builder.finish();
}

test "it is darker below a box than beside it, and every variant says so alike" {
    var texels = Sky.plain(.{ 0.5, 0.6, 0.9 });
    texels[4 * Sky.width + 40] = .{ 300, 280, 200 };
    var sky: Sky = try .init(&texels);
    defer sky.deinit();
    var scene = try boxScene();
    defer scene.deinit();
    var options: fixture.Options = .{
        .width = 32,
        .height = 24,
        .sample_count = 4,
        .environment = sky.around(),
    };
    var shaded = try fixture.render(&scene, options);
    defer shaded.deinit(gpa);
    const below = shaded.at(16, 15).*;
    const beside = shaded.at(2, 15).*;
    for (below[0..3], beside[0..3]) |dark, bright| try expect(dark < 0.45 * bright);
    options.thread_count = 3;
    try variants.expectAllVariants(&scene, options, shaded.hash());
    var image = try fixture.render(&scene, .{
        .width = 32,
        .height = 24,
        .environment = .{ .source = .{ .file = sky.path }, .shadow_count = 0 },
    });
    defer image.deinit(gpa);
    try std.testing.expectApproxEqRel(image.at(2, 15).*[1], image.at(16, 15).*[1], 0.01);
}

const Lamp = struct { position: [3]f32 = .{ -4, 1, -4 }, intensity: f32 };

/// A mirror and a matte sphere by a lamp on their left, or without any.
fn spheres(lamp: ?Lamp) !raylane.scene.Scene {
    var mirror = fixture.matte(.{ 0.9, 0.8, 0.7 });
    mirror.metallic = 1;
    mirror.roughness = 0;
    var builder: Builder = try .init();
    try builder.addSphere(mirror, .{ 0.9, 0, -5 }, 0.8, 12);
    try builder.addSphere(fixture.matte(.{ 0.8, 0.8, 0.8 }), .{ -0.9, 0, -5 }, 0.8, 12);
    if (lamp) |light| try builder.addPointLight(light.position, light.intensity);
    try builder.addCamera(.{ 0, 0, 0 }, 0.4);
    return builder.finish();
}

/// A picture, and the exposure for it.
const Exposed = struct { image: Image, ev: f32 };

/// The picture of spheres.
fn expose(lamp: ?Lamp, options: fixture.Options) !Exposed {
    var diagnostic: raylane.diagnostic.Diagnostic = .{};
    var session: Session = .init(gpa, std.testing.io, options.thread_count, &diagnostic);
    defer session.deinit();
    return exposeIn(&session, lamp, options);
}

/// The same in a session, which keeps its environment.
fn exposeIn(session: *Session, lamp: ?Lamp, options: fixture.Options) !Exposed {
    var scene = try spheres(lamp);
    defer scene.deinit();
    const lanes = raylane.variant.compiled[options.variant].lanes;
    try fixture.view(session, &scene, lanes, options);
    const image = (try fixture.trace(session, options)).*;
    session.film = null; // The caller's now.
    return .{ .image = image, .ev = if (session.metered) |metered| metered.ev else 0 };
}

test "around lights of the scene there is a tenth of the studio, as the exposure shows it" {
    const common: fixture.Options = .{ .width = 48, .height = 48, .sample_count = 2 };
    var dark = common;
    dark.environment = .{ .source = .none };
    var studio = common;
    studio.environment = .{ .intensity = 2 };
    var surrounded = try expose(null, studio);
    defer surrounded.image.deinit(gpa);
    var ev_before: f32 = undefined;
    var diagnostic: raylane.diagnostic.Diagnostic = .{};
    var sessions = [2]Session{
        .init(gpa, std.testing.io, 1, &diagnostic), .init(gpa, std.testing.io, 3, &diagnostic),
    };
    defer for (&sessions) |*session| session.deinit();
    for ([_]f32{ 0.5, 50 }) |intensity| {
        var lit = try expose(.{ .intensity = intensity }, dark);
        defer lit.image.deinit(gpa);
        var hash: ?u64 = null;
        for (0..raylane.variant.compiled.len) |variant| for (&sessions) |*session| {
            var options = studio;
            options.variant = variant;
            var both = try exposeIn(session, .{ .intensity = intensity }, options);
            defer both.image.deinit(gpa);
            try std.testing.expectEqual(hash orelse both.image.hash(), both.image.hash());
            if (hash == null and intensity == 50)
                try std.testing.expectApproxEqAbs(ev_before - @log2(100.0), both.ev, 0.011);
            hash = both.image.hash();
            ev_before = both.ev;
            const share = 0.1 / @exp2(both.ev);
            for (lit.image.pixels, surrounded.image.pixels, both.image.pixels) |own, around, sum| {
                for (own, around, sum, 0..) |light, studio_light, seen, channel| {
                    if (channel == 3) continue;
                    const expected = light + share * studio_light;
                    try std.testing.expectApproxEqAbs(expected, seen, 1e-4 * (expected + share));
                }
            }
        };
        // The middle of the mirror, where the light is not.
        try std.testing.expectEqual([4]f32{ 0, 0, 0, 1 }, lit.image.at(37, 24).*);
    }
    try expect(surrounded.image.at(37, 24).*[1] > 0.02);
}

test "there is all of the studio where lights of the scene light nothing" {
    const options: fixture.Options = .{ .environment = .{ .source = .studio } };
    var studio = try expose(null, options);
    // Within the matte one.
    const lamp: Lamp = .{ .position = .{ -0.9, 0, -5 }, .intensity = 5 };
    defer studio.image.deinit(gpa);
    var lit = try expose(lamp, .{ .environment = .{} });
    defer lit.image.deinit(gpa);
    try std.testing.expectEqual(studio.image.hash(), lit.image.hash());
    try std.testing.expectEqual(0, lit.ev);
    // Who asks for other light from everywhere gets that alone.
    var ambient = try expose(lamp, .{ .environment = .{}, .ambient = 0.25 });
    defer ambient.image.deinit(gpa);
    var plain = try expose(lamp, .{ .ambient = 0.25 });
    defer plain.image.deinit(gpa);
    try std.testing.expectEqual(plain.image.hash(), ambient.image.hash());
}

test "a floor shows the shadow on it alone" {
    var texels = Sky.plain(.{ 0.5, 0.5, 0.5 });
    texels[2 * Sky.width + 40] = .{ 200, 200, 200 };
    var sky: Sky = try .init(&texels);
    defer sky.deinit();
    var builder: Builder = try .init();
    try builder.addSphere(fixture.matte(.{ 0.8, 0.8, 0.8 }), .{ 0, -0.4, -5 }, 0.6, 12);
    try builder.addCamera(.{ 0, 0, 0 }, 0.7);
    var scene = try builder.finish();
    defer scene.deinit();
    var options: fixture.Options = .{
        .width = 64,
        .height = 48,
        .sample_count = 1,
        .transparent = true,
        .environment = sky.around(),
    };
    var bare = try fixture.render(&scene, options);
    defer bare.deinit(gpa);
    options.floor = .shadow;
    var image = try fixture.render(&scene, options);
    defer image.deinit(gpa);
    // Below the sphere, far off, and above the horizon; the sphere itself is as before.
    const below = image.at(32, 31).*;
    try expect(below[3] > 0.4 and below[3] <= 1);
    try std.testing.expectEqual([3]f32{ 0, 0, 0 }, below[0..3].*);
    try expect(image.at(2, 40).*[3] < 0.1);
    try std.testing.expectEqual(0, image.at(32, 2).*[3]);
    try std.testing.expectEqual(bare.at(32, 26).*, image.at(32, 26).*);
    try variants.expectAllVariants(&scene, options, image.hash());
}

test "a file that is no image or not there is an error in one line" {
    var scene = try boxScene();
    defer scene.deinit();
    const Expected = struct { path: []const u8, err: anyerror, text: []const u8 };
    for ([_]Expected{
        .{ .path = "no such.hdr", .err = error.InputOutput, .text = "does not exist" },
        .{ .path = "build.zig", .err = error.InvalidInput, .text = "no image format" },
    }) |expected| {
        var diagnostic: raylane.diagnostic.Diagnostic = .{};
        var session: raylane.session.Session = .init(gpa, std.testing.io, 1, &diagnostic);
        defer session.deinit();
        const result = fixture.view(&session, &scene, raylane.variant.compiled[0].lanes, .{
            .environment = .{ .source = .{ .file = expected.path } },
        });
        try std.testing.expectError(expected.err, result);
        try std.testing.expectEqualStrings(expected.path, diagnostic.place.text());
        const text = diagnostic.message.text();
        try expect(std.mem.find(u8, text, expected.text) != null);
    }
}
