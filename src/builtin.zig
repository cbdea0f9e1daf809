//! Scenes made by the program itself: `builtin:NAME` in place of a file.
//!
//! Each is computed from a few numbers, with the same bits on every target, so that pictures,
//! measurements and tests need no files.

const std = @import("std");
const math = @import("math.zig");
const diagnostic_data = @import("diagnostic.zig");
const Diagnostic = diagnostic_data.Diagnostic;
const scene_data = @import("scene.zig");
const Scene = scene_data.Scene;
const Allocator = std.mem.Allocator;
const atrium = @import("builtin/atrium.zig");
const cornell = @import("builtin/cornell.zig");
const handles = @import("builtin/handles.zig");
const nave = @import("builtin/nave.zig");

/// Why there is no scene.
pub const Error = error{ OutOfMemory, InvalidInput };

const Entry = struct { name: []const u8, build: *const fn (gpa: Allocator) Allocator.Error!Scene };

const entries = [_]Entry{
    .{ .name = "cornell", .build = cornell.build },
    .{ .name = "atrium", .build = atrium.build },
    .{ .name = "nave", .build = nave.build },
    .{ .name = "handles", .build = handles.build },
};

/// The names that `build` knows.
pub const names: []const []const u8 = blk: {
    var list: [entries.len][]const u8 = undefined;
    for (entries, &list) |entry, *name| name.* = entry.name;
    const constant = list;
    break :blk &constant;
};

/// The scene called `name`, owned by the caller. An unknown name is `InvalidInput`, and the
/// diagnostic lists the known ones.
pub fn build(gpa: Allocator, name: []const u8, diagnostic: *Diagnostic) Error!Scene {
    for (entries) |entry| {
        if (std.mem.eql(u8, entry.name, name)) return entry.build(gpa);
    }
    const known = comptime blk: {
        var list: []const u8 = names[0];
        for (names[1..]) |other| list = list ++ ", " ++ other;
        break :blk list;
    };
    return diagnostic.invalid(
        "no built-in scene is called {f}; there are: {s}",
        .{ diagnostic_data.quote(name), known },
    );
}

test "an unknown name is an error that names the known ones" {
    var diagnostic: Diagnostic = .{};
    for ([_][]const u8{ "", "Cornell", "cornell ", "\x00\xff" }) |name| {
        try std.testing.expectError(
            error.InvalidInput,
            build(std.testing.allocator, name, &diagnostic),
        );
        try std.testing.expect(std.mem.find(u8, diagnostic.message.text(), names[0]) != null);
    }
}

/// XXH64 of the meshes: positions, normals, colours and vertex indices, little-endian.
fn meshesHash(scene: *const Scene) u64 {
    var hash: std.hash.XxHash64 = .init(0);
    for (scene.meshes) |mesh| {
        for (mesh.positions) |position| hashWords(&hash, &@as([3]u32, @bitCast(position)));
        for (mesh.normals orelse &.{}) |normal| hashWords(&hash, &@as([3]u32, @bitCast(normal)));
        for (mesh.colors orelse &.{}) |color| hashWords(&hash, &@as([4]u32, @bitCast(color)));
        for (mesh.triangles) |triangle| hashWords(&hash, &triangle);
    }
    return hash.final();
}

fn hashWords(hash: *std.hash.XxHash64, words: []const u32) void {
    for (words) |word| {
        var bytes: [4]u8 = undefined;
        std.mem.writeInt(u32, &bytes, word, .little);
        hash.update(&bytes);
    }
}

test "every scene is whole, bounded, and the same on every target" {
    const hashes = [_]u64{
        0x424356fb6a824f6e,
        0xb0f688535d649c4a,
        0x06da2e742e1efca3,
        0x22cd95aa30894669,
    };
    const triangle_counts = [_]usize{ 3_978, 66_862, 81_466, 190_392 };
    for (names, hashes, triangle_counts) |name, hash, triangle_count| {
        var diagnostic: Diagnostic = .{};
        var scene = try build(std.testing.allocator, name, &diagnostic);
        defer scene.deinit();
        scene.check();
        try std.testing.expectEqual(0, scene.camera_default);
        try std.testing.expect(scene.cameras[0].name.len > 0 and scene.lights.len > 0);
        var box: math.Box3 = .empty;
        for (scene.meshes) |mesh| {
            for (mesh.positions) |position| box = box.include(position);
            for (mesh.triangles) |triangle| try std.testing.expect(hasArea(mesh, triangle));
        }
        for (box.extent()) |extent| try std.testing.expect(extent > 1 and extent < 200);
        try std.testing.expectEqual(hash, meshesHash(&scene));
        try std.testing.expectEqual(triangle_count, scene.triangleCount());
    }
}

fn hasArea(mesh: scene_data.Mesh, triangle: [3]u32) bool {
    const a = mesh.positions[triangle[0]];
    const ab = math.vec3.sub(mesh.positions[triangle[1]], a);
    const ac = math.vec3.sub(mesh.positions[triangle[2]], a);
    return math.vec3.length(math.vec3.cross(ab, ac)) > 0;
}
