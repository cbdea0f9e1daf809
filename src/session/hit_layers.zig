//! Layers made of hits: positions, texture coordinates, and what of the file each pixel shows, with
//! a manifest of the names.
//!
//! In: the film's layer of hits (`integrate/survey.zig`), the geometry, the origins of triangles.
//! Out: an image for each kind of layer that is asked for, and a text in JSON. By all threads.

const std = @import("std");
const film_file = @import("../film.zig");
const math = @import("../math.zig");
const parallel = @import("../parallel.zig");
const prepare = @import("../prepare.zig");
const settings = @import("../settings.zig");
const world = @import("../world.zig");
const Image = film_file.Image;
const Text = @import("../report.zig").Text;
const Allocator = std.mem.Allocator;
const Run = prepare.Origins.Run;
const Stringify = std.json.Stringify;
const HitLayers = @This();

/// In the world's axes, in metres, and fourth 1 where there is something; 0 where there is nothing.
position: ?Image = null,
/// As the first set of the file has them, before any transform; 0 where there are none.
texcoord: ?Image = null,
/// Bits of the numbers of node, material and primitive, `world.none` where there is none; unused.
origin: ?Image = null,
/// Names by number, of what is in `origin`.
manifest: ?[:0]const u8 = null,

/// What hits are looked up in.
pub const Source = struct {
    geometry: *const world.Geometry,
    /// What was subtracted from all places.
    shift: math.Vec3d,
    /// Null: no layer of numbers is asked for.
    origins: ?*const prepare.Origins,
};

/// Whether a layer is made of hits.
pub fn isMadeOfHits(layer: settings.Layer) bool {
    return switch (layer) {
        .uv, .position, .node, .material, .primitive => true,
        .depth, .normal, .albedo, .alpha, .cost, .variance => false,
    };
}

/// Makes those that are asked for; `deinit` frees them.
pub fn make(
    gpa: Allocator,
    pool: *parallel.Pool,
    hits: *const Image,
    source: Source,
    wanted: std.EnumSet(settings.Layer),
) (error{OutOfMemory} || parallel.Error)!HitLayers {
    const numbers: std.EnumSet(settings.Layer) =
        .init(.{ .node = true, .material = true, .primitive = true });
    const has_numbers = wanted.intersectWith(numbers).count() > 0;
    var layers: HitLayers = .{};
    errdefer layers.deinit(gpa);
    if (wanted.contains(.position)) layers.position = try .init(gpa, hits.width, hits.height);
    if (wanted.contains(.uv)) layers.texcoord = try .init(gpa, hits.width, hits.height);
    if (has_numbers) layers.origin = try .init(gpa, hits.width, hits.height);
    const work: Work = .{ .hits = hits, .source = source, .layers = &layers };
    try pool.forEach(hits.height, &work, Work.row);
    if (has_numbers) layers.manifest = try manifestOf(gpa, hits, source.origins.?);
    return layers;
}

/// Frees them.
pub fn deinit(layers: *HitLayers, gpa: Allocator) void {
    inline for (.{ "position", "texcoord", "origin" }) |name| {
        if (@field(layers, name)) |*image| image.deinit(gpa);
    }
    if (layers.manifest) |text| gpa.free(text);
    layers.* = .{};
}

/// The image that a layer is in, which was asked for.
pub fn imageOf(layers: *const HitLayers, layer: settings.Layer) *const Image {
    return switch (layer) {
        .position => &layers.position.?,
        .uv => &layers.texcoord.?,
        .node, .material, .primitive => &layers.origin.?,
        else => unreachable, // Asserts `isMadeOfHits`.
    };
}

const Work = struct {
    hits: *const Image,
    source: Source,
    layers: *const HitLayers,

    fn row(work: *const Work, y: usize, _: usize) void {
        const width = work.hits.width;
        for (y * width..(y + 1) * width) |at| work.pixel(at);
    }

    fn pixel(work: *const Work, at: usize) void {
        const hit = work.hits.pixels[at];
        const triangle: u32 = @bitCast(hit[0]);
        const is_hit = triangle != film_file.no_triangle;
        const geometry = work.source.geometry;
        const weights = hit[1..3].*;
        const nothing: [4]f32 = @splat(0);
        if (work.layers.position) |*image| image.pixels[at] = if (is_hit) there: {
            const place = geometry.face(triangle).positionAt(geometry, weights);
            var position: [4]f32 = .{ 0, 0, 0, 1 };
            for (position[0..3], place, work.source.shift) |*to, near, shift| {
                to.* = @floatCast(near + shift);
            }
            break :there position;
        } else nothing;
        if (work.layers.texcoord) |*image| image.pixels[at] = if (is_hit) there: {
            const u, const v = geometry.face(triangle).texcoordAt(geometry, 0, weights);
            break :there .{ u, v, 0, 0 };
        } else nothing;
        if (work.layers.origin) |*image| {
            const none: Run = .{
                .first = 0,
                .node = world.none,
                .mesh = world.none,
                .primitive = world.none,
                .material = world.none,
            };
            const run = if (is_hit) work.source.origins.?.runOf(triangle) else &none;
            const words: [4]u32 = .{ run.node, run.material, run.primitive, 0 };
            image.pixels[at] = @bitCast(words);
        }
    }
};

/// What of the file can be seen, in JSON: names of nodes and materials by their numbers, and of
/// the mesh at each node.
fn manifestOf(
    gpa: Allocator,
    hits: *const Image,
    origins: *const prepare.Origins,
) error{OutOfMemory}![:0]const u8 {
    var nodes: std.AutoArrayHashMapUnmanaged(u32, u32) = .empty;
    defer nodes.deinit(gpa);
    var materials: std.AutoArrayHashMapUnmanaged(u32, u32) = .empty;
    defer materials.deinit(gpa);
    var before: ?*const Run = null;
    for (hits.pixels) |hit| {
        const triangle: u32 = @bitCast(hit[0]);
        if (triangle == film_file.no_triangle) continue;
        const run = origins.runOf(triangle);
        if (before == run) continue;
        before = run;
        if (run.node != world.none) try nodes.put(gpa, run.node, run.mesh);
        if (run.material != world.none) try materials.put(gpa, run.material, run.material);
    }
    var text: std.Io.Writer.Allocating = .init(gpa);
    defer text.deinit();
    var json: Stringify = .{ .writer = &text.writer };
    writeManifest(&json, origins, &nodes, &materials) catch return error.OutOfMemory;
    return gpa.dupeSentinel(u8, text.written(), 0);
}

fn writeManifest(
    json: *Stringify,
    origins: *const prepare.Origins,
    nodes: *std.AutoArrayHashMapUnmanaged(u32, u32),
    materials: *std.AutoArrayHashMapUnmanaged(u32, u32),
) Stringify.Error!void {
    const names = &origins.names;
    const Order = struct {
        keys: []const u32,

        pub fn lessThan(order: @This(), a: usize, b: usize) bool {
            return order.keys[a] < order.keys[b];
        }
    };
    nodes.sort(Order{ .keys = nodes.keys() });
    materials.sort(Order{ .keys = materials.keys() });
    try json.beginObject();
    try json.objectField("none");
    try json.write(world.none);
    try json.objectField("node");
    try writeNames(json, nodes.keys(), nodes.keys(), names.nodes);
    try json.objectField("mesh");
    try writeNames(json, nodes.keys(), nodes.values(), names.meshes);
    try json.objectField("material");
    try writeNames(json, materials.keys(), materials.keys(), names.materials);
    try json.endObject();
}

/// By key, the name that a number has; an empty one where it has none.
fn writeNames(
    json: *Stringify,
    keys: []const u32,
    numbers: []const u32,
    names: []const []const u8,
) Stringify.Error!void {
    try json.beginObject();
    for (keys, numbers) |key, number| {
        var digits: [10]u8 = undefined;
        try json.objectField(std.mem.print(&digits, "{d}", .{key}) catch unreachable);
        try json.write(Text{ .bytes = if (number < names.len) names[number] else "" });
    }
    try json.endObject();
}

test "pixels show where they are, what they are of, and its names" {
    const gpa = std.testing.allocator;
    var pool: parallel.Pool = .init(1);
    defer pool.deinit();
    var origins: prepare.Origins = .{
        .arena = .init(gpa),
        .runs = &.{
            .{ .first = 0, .node = 4, .mesh = 0, .primitive = 0, .material = 1 },
            .{ .first = 1, .node = 2, .mesh = 0, .primitive = 3, .material = world.none },
        },
        .names = .{
            .nodes = &.{ "", "", "\"a\"\xff", "", "" },
            .meshes = &.{"m"},
            .materials = &.{ "p", "q" },
        },
    };
    defer origins.deinit();
    var geometry: world.Geometry = .empty;
    geometry.positions = &.{ .{ 0, 0, 0 }, .{ 4, 0, 0 }, .{ 0, 8, 1 } };
    geometry.texcoords[0] = &.{ .{ 0, 1 }, .{ 2, 1 }, .{ 0, 3 } };
    geometry.triangles = &.{
        .{ .corner = .{ 0, 1, 2 }, .material = 0 }, .{ .corner = .{ 2, 1, 0 }, .material = 0 },
    };
    var hits: Image = try .init(gpa, 3, 1);
    defer hits.deinit(gpa);
    for (hits.pixels, [_]u32{ 1, 0, film_file.no_triangle }) |*pixel, triangle| {
        pixel.* = .{ @bitCast(triangle), 0.25, 0.5, 0 };
    }
    var layers: HitLayers = try .make(gpa, &pool, &hits, .{
        .geometry = &geometry,
        .shift = .{ 100, 0, 0 },
        .origins = &origins,
    }, .full);
    defer layers.deinit(gpa);
    const places = [_][4]f32{ .{ 101, 2, 0.25, 1 }, .{ 101, 4, 0.5, 1 }, @splat(0) };
    try std.testing.expectEqualSlices([4]f32, &places, layers.imageOf(.position).pixels);
    const texcoords = [_][4]f32{ .{ 0.5, 1.5, 0, 0 }, .{ 0.5, 2, 0, 0 }, @splat(0) };
    try std.testing.expectEqualSlices([4]f32, &texcoords, layers.imageOf(.uv).pixels);
    const none = world.none;
    for (
        [_][4]u32{ .{ 2, none, 3, 0 }, .{ 4, 1, 0, 0 }, .{ none, none, none, 0 } },
        layers.imageOf(.node).pixels,
    ) |numbers, pixel| try std.testing.expectEqual(numbers, @as([4]u32, @bitCast(pixel)));
    const expected = "{\"none\":4294967295,\"node\":{\"2\":\"\\\"a\\\"\u{fffd}\",\"4\":\"\"}," ++
        "\"mesh\":{\"2\":\"m\",\"4\":\"m\"},\"material\":{\"1\":\"q\"}}";
    try std.testing.expectEqualStrings(expected, layers.manifest.?);
}
