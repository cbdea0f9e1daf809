//! Environment maps: from an image, or from the studio, to all that lookups need.
//!
//! In: an image of radiance, or none. Out: an octahedral pyramid of radiance, what
//! lobes of eight roughnesses and of the cosine make of it, and its light cut into parts. By all
//! threads; the result does not depend on how many.

const std = @import("std");
const decode = @import("../decode.zig");
const math = @import("../math.zig");
const parallel = @import("../parallel.zig");
const simd = @import("../simd.zig");
const scene = @import("../scene.zig");
const world = @import("../world.zig");
const cube = @import("environment/cube.zig");
const filter = @import("environment/filter.zig");
const parts_file = @import("environment/parts.zig");
const studio = @import("environment/studio.zig");
const Level = @import("environment/levels.zig").Level;
const Sky = @import("environment/sky.zig").Sky;
const Allocator = std.mem.Allocator;
const Map = world.EnvironmentMap;

/// Texels along the sides of the finest levels.
const size_max = 1024;
const studio_size = 128;
/// Of the levels for lobes, by roughness: 1/8, 2/8 ... 1.
const glossy_sizes = [_]u32{ 256, 128, 64, 64, 32, 32, 32, 32 };
const diffuse_size = 32;
/// Of the level that lights are cut from.
const parts_size = 64;

pub const Error = error{OutOfMemory} || parallel.Error;

/// Where the radiance comes from.
pub const Source = union(enum) {
    studio,
    /// Radiance of 1 from everywhere.
    white,
    image: Image,

    /// A file, and how its image shows directions.
    pub const Image = struct {
        bytes: []const u8,
        projection: scene.EnvironmentMap.Projection = .equirectangular,
        /// Of a cube all files, of which `bytes` is the first.
        faces: [6][]const u8 = @splat(""),
    };
};

/// A map and its memory.
pub const OwnedMap = struct {
    arena: std.heap.ArenaAllocator,
    map: Map,

    /// Frees everything.
    pub fn deinit(owned: *OwnedMap) void {
        owned.arena.deinit();
        owned.* = undefined;
    }
};

/// Makes a map. On `InvalidImage` the reason says why.
pub fn make(
    gpa: Allocator,
    source: Source,
    pool: *parallel.Pool,
    reason: *decode.Reason,
) (Error || decode.Error)!OwnedMap {
    const mode = simd.setFlushToZero();
    defer simd.setFloatControl(mode);
    var sky: ?Sky = switch (source) {
        .studio, .white => null,
        .image => |*image| try readSky(gpa, image, reason),
    };
    defer if (sky) |*image| image.deinit(gpa);
    return makeOf(gpa, if (sky) |*image| image else null, source == .white, pool);
}

fn readSky(gpa: Allocator, image: *const Source.Image, reason: *decode.Reason) decode.Error!Sky {
    if (image.projection == .cube) return cube.read(gpa, &image.faces, size_max, reason);
    var texels = try decode.decode(gpa, image.bytes, reason);
    defer texels.deinit(gpa);
    if (image.projection == .octahedral and texels.width != texels.height) {
        reason.set("an equal-area map has to be a square, not {d} by {d}", .{
            texels.width, texels.height,
        });
        return error.InvalidImage;
    }
    return .init(gpa, &texels, image.projection);
}

/// Of the studio or white, where there is no image; that is changed. Not inlined, so that no
/// arithmetic moves before the mode is set.
noinline fn makeOf(
    gpa: Allocator,
    sky: ?*Sky,
    is_white: bool,
    pool: *parallel.Pool,
) Error!OwnedMap {
    var arena_state: std.heap.ArenaAllocator = .init(gpa);
    errdefer arena_state.deinit();
    const arena = arena_state.allocator();
    const pyramid = try makePyramid(arena, sky, is_white, pool);
    var scratch: std.heap.ArenaAllocator = .init(gpa);
    defer scratch.deinit();
    const tree: filter.Tree = try .init(scratch.allocator(), pyramid);
    const convolved = try convolveAll(arena, &tree, pyramid[0].size, pool);
    const glossy = try arena.alloc(world.EnvironmentLevel, glossy_sizes.len);
    for (glossy, convolved[0..glossy.len]) |*to, level| to.* = level.finished();
    const radiance = try arena.alloc(world.EnvironmentLevel, pyramid.len);
    for (radiance, pyramid) |*to, level| to.* = level.finished();
    const parts = try parts_file.make(arena, tree.levelOf(parts_size));
    return .{
        .arena = arena_state,
        .map = .{
            .radiance = radiance,
            .glossy = glossy,
            .diffuse = convolved[glossy.len].finished(),
            .parts = parts.parts,
            .sources = parts.sources,
        },
    };
}

/// The radiance, from the finest level to one of `filter.Tree.size_min`.
fn makePyramid(
    arena: Allocator,
    sky: ?*Sky,
    is_white: bool,
    pool: *parallel.Pool,
) Error![]const Level {
    if (sky) |image| image.shrink(2 * size_max);
    const size = if (sky) |image| image.levelSize(parts_size, size_max) else studio_size;
    const count = std.math.log2_int(u32, size / filter.Tree.size_min) + 1;
    const pyramid = try arena.alloc(Level, count);
    for (pyramid, 0..) |*level, index| level.* = try .init(arena, size >> @intCast(index));
    const First = struct {
        sky: ?*const Sky,
        is_white: bool,
        level: Level,

        fn fillRow(first: *const @This(), row: usize, _: usize) void {
            if (first.sky) |image| return image.resampleRow(first.level, row);
            for (0..first.level.size) |column| {
                const value = if (first.is_white)
                    1
                else
                    studio.radiance(first.level.pointAt(column, row));
                first.level.at(column, row).* = .{ value, value, value, 0 };
            }
        }
    };
    const first: First = .{ .sky = sky, .is_white = is_white, .level = pyramid[0] };
    try pool.forEach(size, &first, First.fillRow);
    const Halving = struct {
        finer: Level,
        level: Level,

        fn fillRow(halving: *const @This(), row: usize, _: usize) void {
            halving.level.halveRow(halving.finer, row);
        }
    };
    for (pyramid[0 .. count - 1], pyramid[1..]) |finer, level| {
        const halving: Halving = .{ .finer = finer, .level = level };
        try pool.forEach(level.size, &halving, Halving.fillRow);
    }
    for (pyramid) |level| level.closeBorder();
    return pyramid;
}

/// What lobes make of the radiance, by roughness, and last what the cosine does.
fn convolveAll(
    arena: Allocator,
    tree: *const filter.Tree,
    finest_size: u32,
    pool: *parallel.Pool,
) Error![]const Level {
    var convolution: Convolution = .{ .tree = tree, .levels = undefined };
    const levels = try arena.alloc(Level, glossy_sizes.len + 1);
    for (levels[0..glossy_sizes.len], glossy_sizes) |*level, size| {
        level.* = try .init(arena, @min(size, finest_size));
    }
    levels[glossy_sizes.len] = try .init(arena, diffuse_size);
    convolution.levels = levels;
    var row_count: usize = 0;
    for (levels) |level| row_count += level.size / filter.block_height;
    try pool.forEach(row_count, &convolution, Convolution.fillRows);
    for (levels) |level| level.closeBorder();
    return levels;
}

const Convolution = struct {
    tree: *const filter.Tree,
    levels: []const Level,

    /// Some rows of one of the levels.
    fn fillRows(convolution: *const Convolution, index: usize, _: usize) void {
        var first = index * filter.block_height;
        for (convolution.levels, 1..) |level, number| {
            if (first >= level.size) {
                first -= level.size;
                continue;
            }
            const lobe: filter.Lobe = if (number > glossy_sizes.len)
                .cosine
            else
                .{ .ggx = @as(f32, @floatFromInt(number)) / glossy_sizes.len };
            var column: usize = 0;
            while (column < level.size) : (column += filter.block_width) {
                filter.convolve(convolution.tree, lobe, level, column, first);
            }
            return;
        }
    }
};

const testing = std.testing;

/// The mean of a level's texels over directions, each weighted, as is the whole.
fn meanOf(
    level: world.EnvironmentLevel,
    context: anytype,
    weigh: fn (@TypeOf(context), direction: math.Vec3) f64,
) [3]f64 {
    const whole: Level = .{ .size = level.size, .texels = @constCast(level.texels) };
    var sum: [3]f64 = @splat(0);
    var total: f64 = 0;
    for (0..level.size) |row| for (0..level.size) |column| {
        const direction = math.vec3.normalize(whole.pointAt(column, row)).?;
        const weight = weigh(context, direction) * whole.solidAngleAt(column, row);
        const texel = whole.at(column, row).*;
        inline for (&sum, 0..) |*channel, index| channel.* += weight * texel[index];
        total += weight;
    };
    for (&sum) |*channel| channel.* /= total;
    return sum;
}

test "the studio has no hue, and a white sphere is 0.75 in the mean" {
    var pool: parallel.Pool = .init(2);
    defer pool.deinit();
    var owned = try makeOf(testing.allocator, null, false, &pool);
    defer owned.deinit();
    const towards = struct {
        fn weigh(_: void, direction: math.Vec3) f64 {
            return if (direction[2] > 0) direction[2] else 0;
        }
    }.weigh;
    const mean = meanOf(owned.map.diffuse, {}, towards);
    try testing.expectApproxEqAbs(0.75, mean[0], 0.002);
    try testing.expectEqual(mean[0], mean[1]);
    try testing.expectEqual(mean[0], mean[2]);
}

/// A sky with a gradient, a small sun and a coloured lamp; freed by the caller.
fn testSky(gpa: Allocator) !Sky {
    const texels = try gpa.alloc(world.EnvironmentTexel, 128 * 64);
    for (texels, 0..) |*texel, index| {
        const height = @as(f32, @floatFromInt(index / 128)) / 64;
        texel.* = .{ 0.2, 0.3 * height, 1 - height, 0 };
    }
    texels[20 * 128 + 37] = .{ 2000, 1500, 1000, 0 };
    for (40..44) |row| for (80..90) |column| {
        texels[row * 128 + column] = .{ 8, 2, 1, 0 };
    };
    return .{ .width = 128, .height = 64, .texels = texels };
}

test "lobes and irradiance are those of all texels, and the light in parts is the map's" {
    const gpa = testing.allocator;
    var pool: parallel.Pool = .init(2);
    defer pool.deinit();
    var sky = try testSky(gpa);
    defer sky.deinit(gpa);
    var owned = try makeOf(gpa, &sky, false, &pool);
    defer owned.deinit();
    const map = &owned.map;
    const Case = struct {
        normal: math.Vec3,
        alpha_squared: ?f32,

        fn weigh(case: @This(), direction: math.Vec3) f64 {
            const cosine = math.vec3.dot(case.normal, direction);
            if (cosine <= 0) return 0;
            const a = case.alpha_squared orelse return cosine;
            const slope = (1 + cosine) / 2 * (a - 1) + 1;
            return cosine / (slope * slope);
        }
    };
    for (0..9) |number| {
        const level = if (number < 8) map.glossy[number] else map.diffuse;
        const whole: Level = .{ .size = level.size, .texels = @constCast(level.texels) };
        const roughness = @as(f32, @floatFromInt(number + 1)) / 8;
        for ([_]usize{ 3, 10, 17, 28 }) |place| {
            const column = place * level.size / 32;
            const row = (31 - place * 7 % 32) * level.size / 32;
            const case: Case = .{
                .normal = math.vec3.normalize(whole.pointAt(column, row)).?,
                .alpha_squared = if (number < 8)
                    std.math.pow(f32, roughness, 4)
                else
                    null,
            };
            const expected = meanOf(map.radiance[0], case, Case.weigh);
            const found = whole.at(column, row).*;
            inline for (expected, 0..) |channel, index| {
                errdefer std.debug.print("{d} {d}: {any} {any}\n", .{
                    number, place, expected, found,
                });
                try testing.expectApproxEqRel(channel, found[index], 0.05);
            }
        }
    }
    const everywhere = struct {
        fn weigh(_: void, _: math.Vec3) f64 {
            return 1;
        }
    }.weigh;
    const mean = meanOf(map.radiance[0], {}, everywhere);
    try testing.expectEqual(1, map.sources.len);
    const rest = map.parts[map.parts.len - 1].energy;
    for (mean, rest, map.sources[0].energy) |channel, part, source| {
        try testing.expectApproxEqRel(channel * 4 * std.math.pi, part + source, 2e-3);
    }
}

test "the map does not depend on how many threads make it" {
    const gpa = testing.allocator;
    var hashes: [2]u64 = undefined;
    for (&hashes, [_]usize{ 1, 5 }) |*hash, thread_count| {
        var pool: parallel.Pool = .init(thread_count);
        defer pool.deinit();
        var sky = try testSky(gpa);
        defer sky.deinit(gpa);
        var owned = try makeOf(gpa, &sky, false, &pool);
        defer owned.deinit();
        var hasher: std.hash.Wyhash = .init(0);
        for (owned.map.radiance) |level| hasher.update(std.mem.sliceAsBytes(level.texels));
        for (owned.map.glossy) |level| hasher.update(std.mem.sliceAsBytes(level.texels));
        hasher.update(std.mem.sliceAsBytes(owned.map.diffuse.texels));
        hasher.update(std.mem.sliceAsBytes(owned.map.parts));
        hash.* = hasher.final();
    }
    try testing.expectEqual(hashes[0], hashes[1]);
}

test {
    _ = @import("environment/levels.zig");
    _ = cube;
    _ = @import("environment/sky.zig");
    _ = parts_file;
}
