//! Small scenes made in memory, and the way from a scene to a picture, for the other tests.
//!
//! In: quads, spheres and triangles with materials. Out: a `Scene`, or the linear image that some
//! variant makes of it.

const std = @import("std");
const raylane = @import("raylane");
const Affine = raylane.math.Affine;
const Scene = raylane.scene.Scene;
const Image = raylane.image.Image;
const Session = raylane.session.Session;
const World = raylane.world.World;
const vec3 = raylane.math.vec3;
const gpa = std.testing.allocator;

/// A scene of simple things; node 0 is the world's origin.
pub const Builder = struct {
    scene: raylane.scene.Builder,

    pub fn init() !Builder {
        var builder: Builder = .{ .scene = .init(gpa) };
        _ = try builder.addNode(.identity);
        return builder;
    }

    /// A root node.
    pub fn addNode(builder: *Builder, local: Affine) !u32 {
        return builder.scene.addNode(raylane.scene.none, .of(local));
    }

    /// Triangles with flat faces, or with the given normals.
    pub fn addMesh(
        builder: *Builder,
        material: raylane.scene.Material,
        positions: []const [3]f32,
        normals: ?[]const [3]f32,
        triangles: []const [3]u32,
    ) !void {
        const arena = builder.scene.arena();
        const mesh = try builder.scene.addMesh(.{
            .positions = try arena.dupe([3]f32, positions),
            .normals = if (normals) |n| try arena.dupe([3]f32, n) else null,
            .triangles = try arena.dupe([3]u32, triangles),
            .material = try builder.scene.addMaterial(material),
        });
        try builder.scene.addInstance(mesh, 0);
    }

    /// The parallelogram center +- across +- upward; its front is across x upward.
    pub fn addQuad(
        builder: *Builder,
        material: raylane.scene.Material,
        center: [3]f32,
        across: [3]f32,
        upward: [3]f32,
    ) !void {
        const left = vec3.sub(center, across);
        const right = vec3.add(center, across);
        try builder.addMesh(material, &.{
            vec3.sub(left, upward),  vec3.sub(right, upward),
            vec3.add(right, upward), vec3.add(left, upward),
        }, null, &.{ .{ 0, 1, 2 }, .{ 0, 2, 3 } });
    }

    /// A closed sphere of `rows` x 2 `rows` cells with smooth normals.
    pub fn addSphere(
        builder: *Builder,
        material: raylane.scene.Material,
        center: [3]f32,
        radius: f32,
        comptime rows: u32,
    ) !void {
        const columns = 2 * rows;
        const ring_count = rows - 1;
        var normals: [ring_count * columns + 2][3]f32 = undefined;
        var triangles: std.ArrayList([3]u32) = .empty;
        const arena = builder.scene.arena();
        const elementary = raylane.math.elementary;
        for (0..ring_count) |ring| for (0..columns) |column| {
            const polar = std.math.pi * @as(f64, @floatFromInt(ring + 1)) / rows;
            const turn = 2 * std.math.pi * @as(f64, @floatFromInt(column)) / columns;
            normals[ring * columns + column] = .{
                @floatCast(elementary.sin(polar) * elementary.sin(turn)),
                @floatCast(elementary.cos(polar)),
                @floatCast(elementary.sin(polar) * elementary.cos(turn)),
            };
        };
        const north = ring_count * columns;
        const south = north + 1;
        normals[north] = .{ 0, 1, 0 };
        normals[south] = .{ 0, -1, 0 };
        for (0..columns) |column_index| {
            const column: u32 = @intCast(column_index);
            const next = (column + 1) % columns;
            try triangles.append(arena, .{ north, column, next });
            const last = (ring_count - 1) * columns;
            try triangles.append(arena, .{ south, last + next, last + column });
            for (0..ring_count - 1) |ring_index| {
                const upper: u32 = @intCast(ring_index * columns);
                const lower = upper + columns;
                try triangles.append(arena, .{ upper + column, lower + column, lower + next });
                try triangles.append(arena, .{ upper + column, lower + next, upper + next });
            }
        }
        var positions: [normals.len][3]f32 = undefined;
        for (&positions, normals) |*position, normal| {
            position.* = vec3.add(center, vec3.scale(normal, radius));
        }
        try builder.addMesh(material, &positions, &normals, triangles.items);
    }

    /// A point light.
    pub fn addPointLight(builder: *Builder, position: [3]f32, intensity: f32) !void {
        const node = try builder.addNode(.translate(position));
        try builder.scene.addLight(.{ .kind = .point, .node = node, .intensity = intensity });
    }

    /// A camera at `eye` that looks along -z with a vertical angle of 2 atan(`half_height`).
    pub fn addCamera(builder: *Builder, eye: [3]f32, half_height: f32) !void {
        try builder.scene.addCamera(.{
            .name = "",
            .node = try builder.addNode(.translate(eye)),
            .projection = .{ .perspective = .{
                .y_fov_rad = 2 * std.math.atan(half_height),
                .aspect = null,
            } },
        });
    }

    /// The scene, checked; the builder is used up.
    pub fn finish(builder: *Builder) !Scene {
        const scene = try builder.scene.finish();
        scene.check();
        return scene;
    }
};

/// How a test wants its picture.
pub const Options = struct {
    integrator: raylane.settings.Integrator = .whitted,
    width: u32 = 32,
    height: u32 = 32,
    depth_max: u32 = 6,
    sample_count: u32 = 1,
    tile_size: u32 = 16,
    thread_count: usize = 1,
    tree_quality: raylane.settings.TreeQuality = .default,
    sharing: raylane.prepare.SharingRule = .{},
    ambient: ?f32 = null,
    environment: raylane.settings.Environment = .{ .source = .none },
    background: ?[3]f32 = null,
    transparent: bool = false,
    floor: raylane.settings.Floor = .none,
    /// The background is the environment.
    see_environment: bool = false,
    /// Without it, all is radiance.
    display_referred: bool = false,
    /// Index into `variant.compiled`.
    variant: usize = 0,
    /// That pictures of the pose may have.
    layers: std.EnumSet(raylane.settings.Layer) = .empty,
    shade: ?raylane.settings.Shade = null,
};

/// The world of a scene in the given width of tree.
pub fn prepare(scene: *const Scene, lanes: u8, options: Options) !World {
    var diagnostic: raylane.diagnostic.Diagnostic = .{};
    var session: Session = .init(gpa, std.testing.io, options.thread_count, &diagnostic);
    defer session.deinit();
    try view(&session, scene, lanes, options);
    defer session.world = null; // The caller's now.
    return session.world.?;
}

/// Makes a session ready to trace a scene by variants of the given width of tree.
pub fn view(session: *Session, scene: *const Scene, lanes: u8, options: Options) !void {
    const mode = raylane.simd.setFlushToZero();
    defer raylane.simd.setFloatControl(mode);
    session.adopt(scene.*, .borrowed);
    try session.pose(.{
        .lanes = lanes,
        .tree_quality = options.tree_quality,
        .sharing = options.sharing,
        .layers = options.layers,
        .view = .{ .shade = options.shade },
    });
    try look(session, options);
}

/// Chooses another view of what a session has posed.
pub fn look(session: *Session, options: Options) !void {
    const mode = raylane.simd.setFlushToZero();
    defer raylane.simd.setFloatControl(mode);
    try session.view(.{
        .resolution = .{ options.width, options.height },
        .ambient = options.ambient,
        .environment = options.environment,
        .floor = options.floor,
        .display_referred = options.display_referred,
        .shade = options.shade,
        .background = if (options.see_environment)
            .env
        else if (options.transparent)
            .transparent
        else if (options.background) |color| .{ .linear = color } else .default,
    });
}

/// Traces what a session sees. The image is the session's.
pub fn trace(session: *Session, options: Options) !*Image {
    const layers: raylane.film.Layers = .init(.{ .color = true });
    if (session.film) |*film| {
        if (film.image.width != options.width or film.image.height != options.height) {
            film.deinit(gpa);
            session.film = null;
        }
    }
    if (session.film == null)
        session.film = try .init(gpa, options.width, options.height, layers);
    // Every pixel must be written.
    @memset(session.film.?.image.pixels, @splat(std.math.nan(f32)));
    try session.render(.{
        .integrator = options.integrator,
        .variant = options.variant,
        .sample_count = options.sample_count,
        .depth = options.depth_max,
        .tile_size = options.tile_size,
    });
    try std.testing.expectEqual(0, session.traced.non_finite_count);
    return &session.film.?.image;
}

/// The picture of a scene.
pub fn render(scene: *const Scene, options: Options) !Image {
    var diagnostic: raylane.diagnostic.Diagnostic = .{};
    var session: Session = .init(gpa, std.testing.io, options.thread_count, &diagnostic);
    defer session.deinit();
    try view(&session, scene, raylane.variant.compiled[options.variant].lanes, options);
    defer session.film = null; // The caller's now.
    return (try trace(&session, options)).*;
}

/// A box, open towards the camera, with a lamp of some size, a pane that blends and a metal.
pub fn addBox(builder: *Builder, lamp_side: f32) !void {
    try builder.addCamera(.{ 0, 0, 3 }, 0.4);
    const white = matte(.{ 0.8, 0.8, 0.8 });
    try builder.addQuad(white, .{ 0, -1, 0 }, .{ 1, 0, 0 }, .{ 0, 0, -1 });
    try builder.addQuad(white, .{ 0, 1, 0 }, .{ 1, 0, 0 }, .{ 0, 0, 1 });
    try builder.addQuad(white, .{ 0, 0, -1 }, .{ 1, 0, 0 }, .{ 0, 1, 0 });
    const red = matte(.{ 0.8, 0.1, 0.1 });
    try builder.addQuad(red, .{ -1, 0, 0 }, .{ 0, 0, -1 }, .{ 0, 1, 0 });
    var metal = matte(.{ 0.9, 0.8, 0.5 });
    metal.metallic = 1;
    metal.roughness = 0.4;
    try builder.addQuad(metal, .{ 1, 0, 0 }, .{ 0, 0, 1 }, .{ 0, 1, 0 });
    var lamp = matte(.{ 0, 0, 0 });
    lamp.emissive = .{ 5, 5, 5 };
    const half = 0.5 * lamp_side;
    try builder.addQuad(lamp, .{ 0, 0.9, 0 }, .{ half, 0, 0 }, .{ 0, 0, half });
    var pane = matte(.{ 0.2, 0.5, 0.9 });
    pane.alpha_mode = .blend;
    pane.base_color[3] = 0.5;
    try builder.addQuad(pane, .{ 0.3, 0, 0 }, .{ 0.4, 0, 0.3 }, .{ 0, 0.5, 0 });
}

/// Expects one picture of every variant that has the integrator, by one and two threads and with
/// small tiles.
pub fn expectOnePicture(scene: *const Scene, base: Options) !void {
    var first: ?u64 = null;
    for (raylane.variant.compiled, 0..) |variant, index| {
        if (raylane.variant.litIndexOf(index) == null) continue;
        var options = base;
        options.variant = index;
        for ([_]usize{ 2, 1 }, [_]u32{ 16, 5 }) |thread_count, tile_size| {
            // Other threads and tiles once will do.
            if (tile_size != 16 and index > 0) continue;
            var diagnostic: raylane.diagnostic.Diagnostic = .{};
            var session: Session = .init(gpa, std.testing.io, thread_count, &diagnostic);
            defer session.deinit();
            options.tile_size = tile_size;
            try view(&session, scene, variant.lanes, options);
            const image = try trace(&session, options);
            if (first) |hash| try std.testing.expectEqual(hash, image.hash());
            first = first orelse image.hash();
        }
    }
}

/// How many of `count` random things are enough here: under an emulator, which is some twenty times
/// slower and whose machine has the same random things tested natively elsewhere, a quarter.
pub fn enough(count: usize) usize {
    const is_emulated = std.testing.environ.getPosix("RAYLANE_EMULATED") != null;
    return if (is_emulated) @divCeil(count, 4) else count;
}

/// A material without reflection, lit or shining by itself only.
pub fn matte(color: [3]f32) raylane.scene.Material {
    return .{
        .base_color = .{ color[0], color[1], color[2], 1 },
        .metallic = 0,
        .roughness = 1,
        .ior = 1,
        .double_sided = true,
    };
}

/// A material that shows one colour whatever the light.
pub fn flat(color: [3]f32) raylane.scene.Material {
    var material = matte(color);
    material.unlit = true;
    return material;
}

test "a sphere is closed and faces outward" {
    var builder: Builder = try .init();
    try builder.addSphere(matte(.{ 1, 1, 1 }), .{ 0, 0, 0 }, 1, 6);
    var scene = try builder.finish();
    defer scene.deinit();
    const mesh = scene.meshes[0];
    try std.testing.expectEqual(2 * 12 * 5, mesh.triangles.len);
    for (mesh.triangles) |t| {
        const a = mesh.positions[t[0]];
        const b = mesh.positions[t[1]];
        const c = mesh.positions[t[2]];
        const normal = vec3.cross(vec3.sub(b, a), vec3.sub(c, a));
        try std.testing.expect(vec3.dot(normal, vec3.add(a, vec3.add(b, c))) > 0);
    }
}
