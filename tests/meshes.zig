//! Tests of compressed meshes: one grid in every codec, and streams that are broken.
//!
//! The grid is that of meshes/make.py, known in integers. What codecs keep has to come out, what
//! they round has to come near, and everything has to have the same hash on every machine.

const std = @import("std");
const raylane = @import("raylane");
const testing = std.testing;
const gpa = testing.allocator;
const io = testing.io;
const Diagnostic = raylane.diagnostic.Diagnostic;
const Message = raylane.diagnostic.Message;
const Mesh = raylane.scene.Mesh;
const draco = raylane.decode.draco;
const meshopt = raylane.decode.meshopt;

const columns = 9;
const rows = 7;
const vertex_count = columns * rows;
const triangle_count = 2 * (columns - 1) * (rows - 1);

const Case = struct {
    name: []const u8,
    layout: meshopt.Layout,
    /// XXH64 of the elements.
    hash: u64,
};

fn attributes(
    name: []const u8,
    stride: u8,
    filter: meshopt.Filter,
    hash: u64,
) Case {
    return .{ .name = name, .layout = .{
        .mode = .attributes,
        .filter = filter,
        .count = vertex_count,
        .stride = stride,
    }, .hash = hash };
}

fn indices(name: []const u8, mode: meshopt.Mode, count: u64, stride: u8, hash: u64) Case {
    return .{ .name = name, .layout = .{
        .mode = mode,
        .filter = .none,
        .count = count,
        .stride = stride,
    }, .hash = hash };
}

/// Each filter also of numbers that were not made for it.
const cases = [_]Case{
    attributes("positions.bin", 8, .none, 0xfa8de6f4aaccb056),
    attributes("positions.bin", 8, .octahedral, 0x39e3308f16ca71e0),
    attributes("positions.bin", 8, .quaternion, 0xa14bd6d498b89682),
    attributes("positions.bin", 8, .exponential, 0x9a4d4a2c13c2913b),
    attributes("positions.bin", 8, .color, 0x6acd227e4c4e7e50),
    attributes("normals.bin", 4, .octahedral, 0x91d6a5668ee6038a),
    attributes("normals.bin", 4, .color, 0xeab7db7e5657e0e2),
    attributes("texcoords.bin", 8, .exponential, 0x64072edd5ecefbdb),
    attributes("colors.bin", 4, .color, 0xef3ff7de0128150b),
    attributes("colors.bin", 4, .octahedral, 0x9928fd2a45758b79),
    indices("triangles.bin", .triangles, 3 * triangle_count, 2, 0x3423eac53e81ce10),
    indices("triangles.bin", .triangles, 3 * triangle_count, 4, 0xdd631a22fbadec48),
    indices("indices.bin", .indices, vertex_count, 2, 0xdc6bfe4e1a950acb),
    indices("indices.bin", .indices, vertex_count, 4, 0x61f67e1d70f7cc6a),
};

/// A file of tests/meshes; the caller frees it.
fn meshFile(name: []const u8) ![]u8 {
    var folder = try std.Io.Dir.cwd().openDir(io, "tests/meshes", .{});
    defer folder.close(io);
    return folder.readFileAlloc(io, name, gpa, .unlimited);
}

/// The hash of a stream's elements; null where it is broken.
fn meshoptHash(layout: meshopt.Layout, stream: []const u8, reason: *Message) !?u64 {
    meshopt.check(layout, stream, reason) catch return null;
    const out = try gpa.alignedAlloc(u8, meshopt.alignment, @intCast(layout.bytes()));
    defer gpa.free(out);
    meshopt.decode(layout, stream, out, reason) catch return null;
    return std.hash.XxHash64.hash(0, out);
}

/// The hash of a mesh's triangles and attributes; null where it is broken.
fn dracoHash(stream: []const u8, reason: *Message) !?u64 {
    var mesh: draco.Mesh = undefined;
    mesh.init(gpa, stream, 1 << 20, reason) catch |err| switch (err) {
        error.InvalidStream => return null,
        error.OutOfMemory => |failure| return failure,
    };
    defer mesh.deinit();
    var hash: std.hash.XxHash64 = .init(0);
    const triangles = try gpa.alloc([3]u32, mesh.triangleCount());
    defer gpa.free(triangles);
    mesh.triangles(triangles);
    hash.update(std.mem.sliceAsBytes(triangles));
    for ([_]u8{ 4, 2, 3, 3 }, 0..) |width, id| for ([_]draco.Component{ .u8, .f32 }) |component| {
        const bytes: usize = if (component == .u8) 1 else 4;
        const size = bytes * width * mesh.vertexCount();
        const out = try gpa.alignedAlloc(u8, .@"4", size);
        defer gpa.free(out);
        if (!mesh.attribute(@intCast(id), component, width, out)) continue;
        hash.update(&[2]u8{ @intCast(id), @intCast(bytes) });
        hash.update(out);
    };
    return hash.final();
}

fn expectHash(name: []const u8, expected: u64, found: ?u64) !void {
    errdefer std.debug.print("{s}: 0x{?x:0>16}\n", .{ name, found });
    try testing.expectEqual(expected, found);
}

test "every codec gives the same numbers on every machine" {
    var failed: usize = 0;
    for (cases) |case| {
        const stream = try meshFile(case.name);
        defer gpa.free(stream);
        var reason: Message = .{};
        const found = try meshoptHash(case.layout, stream, &reason);
        expectHash(case.name, case.hash, found) catch {
            failed += 1;
        };
    }
    if (draco.is_held) for ([_]struct { []const u8, u64 }{
        .{ "edgebreaker.drc", 0xaa21464aaaa0c817 },
        .{ "sequential.drc", 0x0de820397dbeec3d },
    }) |case| {
        const stream = try meshFile(case[0]);
        defer gpa.free(stream);
        var reason: Message = .{};
        expectHash(case[0], case[1], try dracoHash(stream, &reason)) catch {
            failed += 1;
        };
    };
    try testing.expectEqual(0, failed);
}

/// Changes a stream and cuts it, and expects it to be broken with a reason, or the same each time.
fn expectStable(
    stream: []const u8,
    context: anytype,
    comptime hashOf: anytype,
) !void {
    var random_state: std.Random.DefaultPrng = .init(22);
    const random = random_state.random();
    for (0..stream.len + 400) |round| {
        // Memory of its own, so that what is read behind the end is found.
        const length = if (round < stream.len) round else stream.len;
        const changed = try gpa.dupe(u8, stream[0..length]);
        defer gpa.free(changed);
        if (length == stream.len) for (0..random.intRangeAtMost(usize, 1, 4)) |_| {
            changed[random.uintLessThan(usize, changed.len)] = random.int(u8);
        };
        var reason: Message = .{};
        const first = try hashOf(context, changed, &reason);
        if (length < stream.len) try testing.expectEqual(null, first);
        if (first == null) try testing.expect(reason.text().len > 0);
        try testing.expectEqual(first, try hashOf(context, changed, &reason));
    }
}

test "streams that are cut are broken, and changed ones are alike in every run" {
    for (cases) |case| {
        const stream = try meshFile(case.name);
        defer gpa.free(stream);
        errdefer std.debug.print("{s}\n", .{case.name});
        try expectStable(stream, case.layout, meshoptHash);
    }
    if (draco.is_held) for ([_][]const u8{ "edgebreaker.drc", "sequential.drc" }) |name| {
        const stream = try meshFile(name);
        defer gpa.free(stream);
        errdefer std.debug.print("{s}\n", .{name});
        try expectStable(stream, {}, struct {
            fn hashOf(_: void, changed: []const u8, reason: *Message) !?u64 {
                return dracoHash(changed, reason);
            }
        }.hashOf);
    };
}

fn near(expected: f32, found: f32, tolerance: f32) !void {
    errdefer std.debug.print("{d}, not {d}\n", .{ found, expected });
    try testing.expect(@abs(expected - found) <= tolerance);
}

test "meshopt: a scene of buffer views in all modes, without their plain buffers" {
    var said: Diagnostic = .{};
    errdefer std.debug.print("{s}\n", .{said.message.text()});
    var scene = try raylane.parse.parse(gpa, io, "tests/meshes/meshopt.gltf", .{}, &said);
    defer scene.deinit();
    scene.check();
    try testing.expectEqual(0, said.warning_count);
    const grid = &scene.meshes[0];
    for (0..vertex_count) |vertex| {
        const x: f32 = @floatFromInt(vertex % columns);
        const y: f32 = @floatFromInt(vertex / columns);
        try testing.expectEqual([3]f32{ 100 * x, 100 * y, 10 * x * y }, grid.positions[vertex]);
        const across = (9 * x - 36) / 127;
        const upward = (9 * y - 27) / 127;
        const toward = 1 - @abs(across) - @abs(upward); // Never folded.
        const length = @sqrt(across * across + upward * upward + toward * toward);
        for (grid.normals.?[vertex], [3]f32{ across, upward, toward }) |found, expected| {
            try near(expected / length, found, 0.51 / 127.0);
        }
        const orange = 4 * x;
        const green = 4 * y - 12;
        for (grid.colors.?[vertex], [4]f32{
            128 + orange - green, 128 + green, 128 - orange - green, 255,
        }) |found, expected| try near(expected / 255, found, 1e-6);
    }
    try expectGrid(grid, 100);
    for (scene.meshes[1].segments, 0..) |segment, index| {
        try testing.expectEqual([2]u32{ snake(index), snake(index + 1) }, segment);
    }
}

/// A vertex of the line that goes there and back.
fn snake(index: usize) u32 {
    const row = index / columns;
    const column = index % columns;
    return @intCast(row * columns + if (row % 2 == 0) column else columns - 1 - column);
}

/// Every triangle is half of a cell whose sides are `size`, and none stands twice.
fn expectGrid(mesh: *const Mesh, size: f32) !void {
    try testing.expectEqual(triangle_count, mesh.triangles.len);
    var seen: [triangle_count]bool = @splat(false);
    for (mesh.triangles) |triangle| {
        var sum: [2]f32 = @splat(0);
        var least: [2]f32 = @splat(std.math.floatMax(f32));
        for (triangle) |corner| for (0..2) |axis| {
            const place = @round(mesh.positions[corner][axis] / size);
            sum[axis] += place;
            least[axis] = @min(least[axis], place);
        };
        // The first half of a cell has one corner in each direction from its least.
        const is_second = sum[0] - 3 * least[0] == 2;
        const steps: f32 = if (is_second) 2 else 1;
        try testing.expectEqual(steps, sum[0] - 3 * least[0]);
        try testing.expectEqual(steps, sum[1] - 3 * least[1]);
        const cell: usize = @intFromFloat(least[0] + least[1] * (columns - 1));
        const index = 2 * cell + @intFromBool(is_second);
        try testing.expect(!seen[index]);
        seen[index] = true;
    }
}

test "Draco: a scene of two meshes, or a build that says that it cannot" {
    var said: Diagnostic = .{};
    const result = raylane.parse.parse(gpa, io, "tests/meshes/draco.gltf", .{}, &said);
    if (!draco.is_held) {
        try testing.expectError(error.InvalidInput, result);
        try testing.expectEqualStrings("the required extension 'KHR_draco_mesh_compression' " ++
            "needs a build with Draco (-Ddraco)", said.message.text());
        return;
    }
    errdefer std.debug.print("{s}\n", .{said.message.text()});
    var scene = try result;
    defer scene.deinit();
    scene.check();
    try testing.expectEqual(0, said.warning_count);
    for (scene.meshes) |*mesh| {
        for (mesh.positions, mesh.normals.?, mesh.colors.?) |position, normal, color| {
            const x = @round(position[0]);
            const y = @round(position[1]);
            // Eleven bits of a side of 8.
            for (position, [3]f32{ x, y, x * y / 16 }) |found, expected| {
                try near(expected, found, 0.002);
            }
            for (normal, [3]f32{ 0, 0.6, 0.8 }) |found, expected| try near(expected, found, 0.01);
            const expected = [4]f32{ 20 * x, 30 * y, 5, 255 };
            for (color, expected) |found, of_255| try near(of_255 / 255, found, 1e-6);
        }
        try expectGrid(mesh, 1);
    }
}

fn parseAndFree(allocator: std.mem.Allocator, path: []const u8) !void {
    var said: Diagnostic = .{};
    var scene = try raylane.parse.parse(allocator, io, path, .{}, &said);
    scene.deinit();
}

test "every allocation may fail while compressed meshes are read" {
    const fails = testing.checkAllAllocationFailures;
    try fails(gpa, parseAndFree, .{"tests/meshes/meshopt.gltf"});
    if (draco.is_held) try fails(gpa, parseAndFree, .{"tests/meshes/draco.gltf"});
}
