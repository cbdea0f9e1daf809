//! Layers made of hits: positions, texture coordinates, and what of the file each pixel shows, with
//! the names of that.
//!
//! In: a film whose layer of origins has hits (`integrate/aov.zig`), the geometry, the origins
//! of triangles. Out: the layers that the film has of these. By all threads.

const std = @import("std");
const film_file = @import("../film.zig");
const math = @import("../math.zig");
const manifest_file = @import("../manifest.zig");
const parallel = @import("../parallel.zig");
const prepare = @import("../prepare.zig");
const world = @import("../world.zig");
const Allocator = std.mem.Allocator;
const Film = film_file.Film;
const Image = film_file.Image;
const Manifest = manifest_file.Manifest;
const Run = prepare.Origins.Run;

/// What hits are looked up in.
pub const Source = struct {
    geometry: *const world.Geometry,
    /// What was subtracted from all places.
    shift: math.Vec3d,
    /// Null: nobody asks for numbers, and there are none.
    origins: ?*const prepare.Origins,
};

/// Makes the layers; where there are hits, there are numbers afterwards.
pub fn fill(film: *const Film, source: Source, pool: *parallel.Pool) parallel.Error!void {
    const work: Work = .{ .film = film, .source = source };
    try pool.forEach(film.image.height, &work, Work.row);
}

const Work = struct {
    film: *const Film,
    source: Source,

    fn row(work: *const Work, y: usize, _: usize) void {
        const width = work.film.image.width;
        for (y * width..(y + 1) * width) |at| work.pixel(at);
    }

    fn pixel(work: *const Work, at: usize) void {
        const own = &work.film.imageOf(.origin).?.pixels[at];
        const triangle: u32 = @bitCast(own[0]);
        const weights = own[1..3].*;
        const is_hit = triangle != film_file.no_triangle;
        const geometry = work.source.geometry;
        if (work.film.imageOf(.position)) |image| {
            image.pixels[at] = @splat(0);
            if (is_hit) {
                const place = geometry.face(triangle).positionAt(geometry, weights);
                for (image.pixels[at][0..3], place, work.source.shift) |*to, near, shift| {
                    to.* = @floatCast(near + shift);
                }
                image.pixels[at][3] = 1;
            }
        }
        if (work.film.imageOf(.texcoord)) |image| {
            image.pixels[at] = @splat(0);
            if (is_hit) image.pixels[at][0..2].* =
                geometry.face(triangle).texcoordAt(geometry, 0, weights);
        }
        const none = world.none;
        var numbers: [4]u32 = .{ none, none, none, 0 };
        if (is_hit) if (work.source.origins) |origins| {
            const run = origins.runOf(triangle);
            numbers = .{ run.node, run.material, run.primitive, 0 };
        };
        own.* = @bitCast(numbers);
    }
};

/// Names of what hits show; lists are from `arena`, names the origins'.
pub fn manifestOf(
    arena: Allocator,
    hits: *const Image,
    origins: *const prepare.Origins,
) error{OutOfMemory}!Manifest {
    var seen: std.AutoArrayHashMapUnmanaged(*const Run, void) = .empty;
    defer seen.deinit(arena);
    var before: ?*const Run = null;
    for (hits.pixels) |hit| {
        const triangle: u32 = @bitCast(hit[0]);
        if (triangle == film_file.no_triangle) continue;
        const run = origins.runOf(triangle);
        if (before == run) continue;
        before = run;
        try seen.put(arena, run, {});
    }
    const names = &origins.names;
    var manifest: Manifest = .{};
    inline for (.{
        .{ "node", "node", "node", names.nodes },
        .{ "mesh", "node", "mesh", names.meshes },
        .{ "material", "material", "material", names.materials },
    }) |row| {
        var entries: std.ArrayList(manifest_file.Entry) = .empty;
        for (seen.keys()) |run| {
            const number = @field(run, row[2]);
            if (@field(run, row[1]) == world.none) continue;
            try entries.append(arena, .{
                .number = @field(run, row[1]),
                .name = if (number < row[3].len) row[3][number] else "",
            });
        }
        @field(manifest, row[0]) = try manifest_file.sorted(arena, entries.items);
    }
    return manifest;
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
            .nodes = &.{ "", "", "a", "", "" },
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
    const layers: film_file.Layers =
        .init(.{ .color = true, .origin = true, .position = true, .texcoord = true });
    var film: Film = try .init(gpa, 3, 1, layers);
    defer film.deinit(gpa);
    const hits = film.imageOf(.origin).?;
    for (hits.pixels, [_]u32{ 1, 0, film_file.no_triangle }) |*pixel, triangle| {
        pixel.* = .{ @bitCast(triangle), 0.25, 0.5, 0 };
    }
    const manifest = try manifestOf(origins.arena.allocator(), hits, &origins);
    try fill(&film, .{
        .geometry = &geometry,
        .shift = .{ 100, 0, 0 },
        .origins = &origins,
    }, &pool);
    const places = [_][4]f32{ .{ 101, 2, 0.25, 1 }, .{ 101, 4, 0.5, 1 }, @splat(0) };
    try std.testing.expectEqualSlices([4]f32, &places, film.imageOf(.position).?.pixels);
    const texcoords = [_][4]f32{ .{ 0.5, 1.5, 0, 0 }, .{ 0.5, 2, 0, 0 }, @splat(0) };
    try std.testing.expectEqualSlices([4]f32, &texcoords, film.imageOf(.texcoord).?.pixels);
    const none = world.none;
    for (
        [_][4]u32{ .{ 2, none, 3, 0 }, .{ 4, 1, 0, 0 }, .{ none, none, none, 0 } },
        hits.pixels,
    ) |numbers, pixel| try std.testing.expectEqual(numbers, @as([4]u32, @bitCast(pixel)));
    const expected: Manifest = .{
        .node = &.{ .{ .number = 2, .name = "a" }, .{ .number = 4, .name = "" } },
        .mesh = &.{ .{ .number = 2, .name = "m" }, .{ .number = 4, .name = "m" } },
        .material = &.{.{ .number = 1, .name = "q" }},
    };
    try std.testing.expectEqualDeep(expected, manifest);
}
