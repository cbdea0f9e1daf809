//! Triangles by what their texture's alpha leaves of them: all, nothing, or some.
//!
//! In: a scene's meshes and textures. Out: meshes without the triangles of which nothing is seen,
//! and those that are seen whole in a mesh of their own, whose material is the same but opaque: it
//! stops rays at once, and looks no alpha up. A triangle is as its texels are in the finest level,
//! within the box of its texture coordinates and what is mixed with it: found in a pyramid of the
//! least and the largest alpha of blocks (Williams 1983, with minima and maxima for averages).

const std = @import("std");
const parallel = @import("../parallel.zig");
const scene = @import("../scene.zig");
const texture = @import("texture.zig");
const texture_use = @import("texture_use.zig");
const world = @import("../world.zig");
const assert = std.debug.assert;
const Allocator = std.mem.Allocator;
const Mesh = scene.Mesh;
const TextureSet = texture.TextureSet;

pub const Error = error{OutOfMemory} || parallel.Error;

/// What is drawn, in place of what the scene has.
pub const Parts = struct {
    /// By index: the scene's material that it was made of. The scene's come first.
    sources: []const u32,
    materials: []const scene.Material,
    meshes: []const Mesh,
    instances: []const scene.Instance,
};

/// Splits the meshes that `instances` show. The set gets the lookups of the new materials. New
/// arrays come from `arena`, what is needed meanwhile from `gpa`; threads share both.
pub fn split(
    gpa: Allocator,
    arena: Allocator,
    materials: []const scene.Material,
    meshes: []const Mesh,
    instances: []const scene.Instance,
    set: *TextureSet,
    pool: *parallel.Pool,
) Error!Parts {
    var work: Work = .{
        .arena = arena,
        .materials = materials,
        .meshes = meshes,
        .set = set,
        .bounds = try gpa.alloc(?Bounds, set.textures.all.len),
    };
    defer gpa.free(work.bounds);
    @memset(work.bounds, null);
    defer work.tasks.deinit(gpa);
    defer for (work.bounds) |*bounds| if (bounds.*) |*made| made.deinit(gpa);
    try work.collect(gpa, instances);
    try pool.forEach(work.tasks.items.len, &work, Work.run);
    if (work.exhausted.load(.monotonic)) return error.OutOfMemory;
    return work.finish(gpa, instances);
}

/// A mesh and what becomes of it.
const Task = struct {
    mesh: u32,
    lookup: *const world.Lookup,
    limits: Limits,
    some: []const [3]u32 = &.{},
    whole: []const [3]u32 = &.{},
};

/// Codes of alpha, by what they mean on a material.
const Limits = struct {
    /// What is all of it or more is whole: 256 for nothing.
    whole: u16,
    /// What is all below it is not there: 0 for nothing.
    seen: u16,

    fn of(material: *const scene.Material, vertices: texture.AlphaRange) Limits {
        const factor = material.base_color[3];
        return switch (material.alpha_mode) {
            .@"opaque" => unreachable, // Looks no alpha up.
            .mask => .{
                .whole = code(material.alpha_cutoff, factor * vertices.least),
                .seen = code(material.alpha_cutoff, factor * vertices.largest),
            },
            .blend => .{
                .whole = if (factor * vertices.least >= 1) 255 else 256,
                .seen = if (factor * vertices.largest > 0) 1 else 256,
            },
        };
    }

    /// The least code that times the factor reaches the cutoff.
    fn code(cutoff: f32, factor: f32) u16 {
        const least = @as(f64, cutoff) / factor * 255;
        if (!(least <= 255)) return 256;
        return if (least > 0) @intFromFloat(@ceil(least)) else 0;
    }
};

/// Shared by the threads.
const Work = struct {
    arena: Allocator,
    materials: []const scene.Material,
    meshes: []const Mesh,
    set: *TextureSet,
    /// By texture.
    bounds: []?Bounds,
    tasks: std.ArrayList(Task) = .empty,
    exhausted: std.atomic.Value(bool) = .init(false),

    /// Which meshes there are to split.
    fn collect(
        work: *Work,
        gpa: Allocator,
        instances: []const scene.Instance,
    ) error{OutOfMemory}!void {
        const is_listed = try gpa.alloc(bool, work.meshes.len);
        defer gpa.free(is_listed);
        @memset(is_listed, false);
        for (instances) |instance| {
            if (is_listed[instance.mesh]) continue;
            is_listed[instance.mesh] = true;
            const mesh = &work.meshes[instance.mesh];
            if (mesh.triangles.len == 0) continue;
            if (work.materials[mesh.material].in_motion) continue;
            const lookup = work.alphaLookup(mesh.material) orelse continue;
            if (hasAlphaInMotion(mesh, lookup.texcoord_set)) continue;
            const bounds = &work.bounds[lookup.texture];
            if (bounds.* == null) {
                bounds.* = try .init(gpa, &work.set.textures.all[lookup.texture].levels[0]);
            }
            const material = &work.materials[mesh.material];
            try work.tasks.append(gpa, .{
                .mesh = instance.mesh,
                .lookup = lookup,
                .limits = .of(material, work.set.materials[mesh.material].vertex_alpha),
            });
        }
    }

    /// Of the one texture that alpha is in, beside colours; null: it is in none, or elsewhere.
    fn alphaLookup(work: *const Work, material: u32) ?*const world.Lookup {
        var found: ?*const world.Lookup = null;
        for (work.set.lookupsOf(material)) |*lookup| {
            if (lookup.slot != .base_color) continue;
            switch (lookup.channels[3]) {
                texture_use.missing => {},
                3 => found = lookup,
                else => return null, // A number of its own.
            }
        }
        return found;
    }

    fn run(work: *Work, index: usize, _: usize) void {
        work.sort(&work.tasks.items[index]) catch |err| switch (err) {
            error.OutOfMemory => work.exhausted.store(true, .monotonic),
        };
    }

    fn sort(work: *Work, task: *Task) error{OutOfMemory}!void {
        const mesh = &work.meshes[task.mesh];
        const bounds = &work.bounds[task.lookup.texture].?;
        const sorted = try work.arena.alloc([3]u32, mesh.triangles.len);
        var some_count: usize = 0;
        var whole_count: usize = 0;
        for (mesh.triangles) |triangle| {
            switch (bounds.classify(task.lookup, mesh, triangle, task.limits)) {
                .nothing => {},
                .some => {
                    sorted[some_count] = triangle;
                    some_count += 1;
                },
                .whole => {
                    whole_count += 1;
                    sorted[sorted.len - whole_count] = triangle;
                },
            }
        }
        task.some = sorted[0..some_count];
        const whole = sorted[sorted.len - whole_count ..];
        std.mem.reverse([3]u32, whole); // As the mesh has them.
        task.whole = whole;
    }

    fn finish(
        work: *Work,
        gpa: Allocator,
        instances: []const scene.Instance,
    ) error{OutOfMemory}!Parts {
        const arena = work.arena;
        var parts: Building = .{ .work = work };
        try parts.materials.appendSlice(arena, work.materials);
        try parts.uses.appendSlice(arena, work.set.materials);
        try parts.lookups.appendSlice(arena, work.set.lookups);
        try parts.meshes.appendSlice(arena, work.meshes);
        for (0..work.materials.len) |index| try parts.sources.append(arena, @intCast(index));
        parts.opaque_of = try gpa.alloc(u32, work.materials.len);
        defer gpa.free(parts.opaque_of);
        @memset(parts.opaque_of, scene.none);
        const whole_mesh = try gpa.alloc(u32, work.meshes.len);
        defer gpa.free(whole_mesh);
        @memset(whole_mesh, scene.none);
        for (work.tasks.items) |*task| {
            const mesh = &parts.meshes.items[task.mesh];
            mesh.triangles = task.some;
            if (task.whole.len == 0) continue;
            var whole = mesh.*;
            whole.triangles = task.whole;
            whole.material = try parts.opaqueMaterial(mesh.material);
            whole_mesh[task.mesh] = @intCast(parts.meshes.items.len);
            try parts.meshes.append(arena, whole);
        }
        var drawn: std.ArrayList(scene.Instance) = .empty;
        for (instances) |instance| {
            if (!parts.meshes.items[instance.mesh].isEmpty()) {
                try drawn.append(arena, instance);
            }
            if (whole_mesh[instance.mesh] == scene.none) continue;
            var whole_instance = instance;
            whole_instance.mesh = whole_mesh[instance.mesh];
            try drawn.append(arena, whole_instance);
        }
        work.set.materials = parts.uses.items;
        work.set.lookups = parts.lookups.items;
        return .{
            .sources = parts.sources.items,
            .materials = parts.materials.items,
            .meshes = parts.meshes.items,
            .instances = drawn.items,
        };
    }
};

/// Whether morph targets may change what a vertex shows of its texture, or of its alpha.
fn hasAlphaInMotion(mesh: *const Mesh, texcoord_set: u32) bool {
    for (mesh.morph_targets) |*target| {
        if (target.colors != null or target.texcoords[texcoord_set] != null) return true;
    }
    return false;
}

/// The parts while they become more.
const Building = struct {
    work: *const Work,
    sources: std.ArrayList(u32) = .empty,
    materials: std.ArrayList(scene.Material) = .empty,
    uses: std.ArrayList(texture.MaterialUse) = .empty,
    lookups: std.ArrayList(world.Lookup) = .empty,
    meshes: std.ArrayList(Mesh) = .empty,
    /// By material of the scene: the opaque one, or `scene.none`.
    opaque_of: []u32 = &.{},

    /// The number of a material that is as this one, but opaque.
    fn opaqueMaterial(parts: *Building, source: u32) error{OutOfMemory}!u32 {
        const known = &parts.opaque_of[source];
        if (known.* != scene.none) return known.*;
        const arena = parts.work.arena;
        known.* = @intCast(parts.materials.items.len);
        var material = parts.work.materials[source];
        material.alpha_mode = .@"opaque";
        var use = parts.work.set.materials[source];
        use.first_lookup = @intCast(parts.lookups.items.len);
        use.alpha = .{};
        for (parts.work.set.lookupsOf(source)) |lookup| {
            var without = lookup;
            if (lookup.slot == .base_color) without.channels[3] = texture_use.missing;
            try parts.lookups.append(arena, without);
        }
        try parts.sources.append(arena, source);
        try parts.materials.append(arena, material);
        try parts.uses.append(arena, use);
        return known.*;
    }
};

/// What is seen of a triangle.
const Share = enum { nothing, some, whole };

/// Texels or blocks along an axis, the last included.
const Span = struct { first: u32, last: u32 };

/// The least and the largest alpha of blocks of an image.
const Bounds = struct {
    texels: world.TextureLevel,
    /// Blocks of 8x8 texels, and then of 2x2 blocks of the one before, to a single one.
    levels: [level_count_max]Blocks,
    level_count: u8,
    memory: [][2]u8,

    const level_count_max = 14;
    const block_side = 8;
    /// Along an axis: blocks that are looked at first, and at most in all.
    const few = 4;
    const many = 16;
    /// Places that are more texels away, or sums of such, have too few digits for parts of one.
    const distance_max: f32 = 1 << 19;

    const Blocks = struct { columns: u32, rows: u32, codes: [][2]u8 };

    fn init(gpa: Allocator, texels: *const world.TextureLevel) error{OutOfMemory}!Bounds {
        var bounds: Bounds = .{
            .texels = texels.*,
            .levels = undefined,
            .level_count = 0,
            .memory = undefined,
        };
        var total: usize = 0;
        var columns = @divCeil(texels.width, block_side);
        var rows = @divCeil(texels.height, block_side);
        while (true) {
            bounds.levels[bounds.level_count] = .{
                .columns = columns,
                .rows = rows,
                .codes = undefined,
            };
            bounds.level_count += 1;
            total += @as(usize, columns) * rows;
            if (columns == 1 and rows == 1) break;
            columns = @divCeil(columns, 2);
            rows = @divCeil(rows, 2);
        }
        bounds.memory = try gpa.alloc([2]u8, total);
        @memset(bounds.memory, .{ 255, 0 });
        var rest = bounds.memory;
        for (bounds.levels[0..bounds.level_count]) |*level| {
            level.codes = rest[0 .. level.columns * level.rows];
            rest = rest[level.codes.len..];
        }
        bounds.fill();
        return bounds;
    }

    fn deinit(bounds: *const Bounds, gpa: Allocator) void {
        gpa.free(bounds.memory);
    }

    fn fill(bounds: *Bounds) void {
        const texels = &bounds.texels;
        for (0..texels.height) |y| for (0..texels.width) |x| {
            const alpha = texels.texels[4 * (y * texels.width + x) + 3];
            const first = &bounds.levels[0];
            join(&first.codes[y / block_side * first.columns + x / block_side], .{ alpha, alpha });
        };
        for (bounds.levels[1..bounds.level_count], 0..) |*to, before| {
            const from = &bounds.levels[before];
            for (0..from.rows) |y| for (0..from.columns) |x| {
                const block = from.codes[y * from.columns + x];
                join(&to.codes[y / 2 * to.columns + x / 2], block);
            };
        }
    }

    fn join(to: *[2]u8, other: [2]u8) void {
        to.* = .{ @min(to[0], other[0]), @max(to[1], other[1]) };
    }

    fn classify(
        bounds: *const Bounds,
        lookup: *const world.Lookup,
        mesh: *const Mesh,
        triangle: [3]u32,
        limits: Limits,
    ) Share {
        const sizes = [2]u32{ bounds.texels.width, bounds.texels.height };
        var spans: [2][2]Span = undefined;
        var counts: [2]usize = undefined;
        for (&spans, &counts, lookup.transform, lookup.wrap, sizes) |*to, *count, row, wrap, size| {
            var low = std.math.inf(f32);
            var high = -std.math.inf(f32);
            for (triangle) |vertex| {
                const set = mesh.texcoords[lookup.texcoord_set];
                const at: [2]f32 = if (set) |all| all[vertex] else .{ 0, 0 };
                const parts = [3]f32{ row[0] * at[0], row[1] * at[1], row[2] };
                const extent = @abs(parts[0]) + @abs(parts[1]) + @abs(parts[2]);
                if (!(extent * @as(f32, @floatFromInt(size)) <= distance_max)) return .some;
                const coordinate = parts[0] + parts[1] + parts[2];
                low = @min(low, coordinate);
                high = @max(high, coordinate);
            }
            count.* = spansOf(low, high, size, wrap, to);
        }
        var codes: [2]u8 = .{ 255, 0 };
        for ([_]u32{ few, many }) |count_max| {
            codes = .{ 255, 0 };
            for (spans[0][0..counts[0]]) |columns| for (spans[1][0..counts[1]]) |rows| {
                join(&codes, bounds.within(columns, rows, count_max));
            };
            if (codes[0] >= limits.whole) return .whole;
            if (codes[1] < limits.seen) return .nothing;
        }
        return .some;
    }

    /// Bounds over a rectangle, or over one around it that is made of few blocks.
    fn within(bounds: *const Bounds, columns: Span, rows: Span, count_max: u32) [2]u8 {
        var codes: [2]u8 = .{ 255, 0 };
        const longest = @max(columns.last - columns.first, rows.last - rows.first) + 1;
        if (longest <= count_max) {
            for (rows.first..rows.last + 1) |y| for (columns.first..columns.last + 1) |x| {
                const alpha = bounds.texels.texels[4 * (y * bounds.texels.width + x) + 3];
                join(&codes, .{ alpha, alpha });
            };
            return codes;
        }
        var level: u5 = 0;
        while (true) : (level += 1) {
            const side = @as(u32, block_side) << level;
            const wide = columns.last / side - columns.first / side;
            const high = rows.last / side - rows.first / side;
            if (@max(wide, high) < count_max) break;
        }
        const side = @as(u32, block_side) << level;
        const blocks = &bounds.levels[level];
        for (rows.first / side..rows.last / side + 1) |y| {
            for (columns.first / side..columns.last / side + 1) |x| {
                join(&codes, blocks.codes[y * blocks.columns + x]);
            }
        }
        return codes;
    }

    /// The texels that lookups between two coordinates mix, with a little more on either side for
    /// rounding. Returns how many spans they are.
    fn spansOf(low: f32, high: f32, size: u32, wrap: world.Wrap, spans: *[2]Span) usize {
        const scale: f32 = @floatFromInt(size);
        const first: i64 = @intFromFloat(@floor(low * scale - 0.75));
        const last: i64 = @intFromFloat(@floor(high * scale + 0.75));
        const length: i64 = size;
        const all: Span = .{ .first = 0, .last = size - 1 };
        if (wrap == .clamp_to_edge) {
            spans[0] = .{
                .first = @intCast(std.math.clamp(first, 0, length - 1)),
                .last = @intCast(std.math.clamp(last, 0, length - 1)),
            };
            return 1;
        }
        spans[0] = all;
        if (last - first >= length) return 1;
        const tile = @divFloor(first, length);
        const from: u32 = @intCast(first - tile * length);
        const to: u32 = @intCast(last - tile * length);
        if (to < size) {
            const is_turned = wrap == .mirrored_repeat and @mod(tile, 2) == 1;
            spans[0] = if (is_turned)
                .{ .first = size - 1 - to, .last = size - 1 - from }
            else
                .{ .first = from, .last = to };
            return 1;
        }
        // Over an edge of the image; where it is mirrored there, all of it will do.
        if (wrap == .mirrored_repeat) return 1;
        spans.* = .{ .{ .first = from, .last = size - 1 }, .{ .first = 0, .last = to - size } };
        return 2;
    }
};

const testing = std.testing;

fn testLookup(wrap: world.Wrap) world.Lookup {
    return .{
        .slot = .base_color,
        .texture = 0,
        .wrap = @splat(wrap),
        .magnify_linear = true,
        .minify_linear = true,
        .has_mips = true,
        .mip_linear = true,
        .texcoord_set = 1,
        .transform = .{ .{ 1, 0, 0 }, .{ 0, 1, 0 } },
        .channels = .{ 0, 1, 2, 3 },
    };
}

fn testMesh(coordinates: *const [3][2]f32) Mesh {
    return .{
        .positions = &.{ .{ 0, 0, 0 }, .{ 1, 0, 0 }, .{ 0, 1, 0 } },
        .texcoords = .{ null, coordinates, null, null },
        .triangles = &.{.{ 0, 1, 2 }},
        .material = 0,
    };
}

fn testTexels(width: u32, height: u32, alpha: []const u8, texels: []u8) world.TextureLevel {
    for (alpha, 0..) |code, texel| texels[4 * texel ..][0..4].* = .{ 1, 2, 3, code };
    return .{ .width = width, .height = height, .texels = texels[0 .. 4 * alpha.len] };
}

test "left there is nothing, right there is all, by every wrap" {
    const side = 64;
    var alpha: [side * side]u8 = undefined;
    for (&alpha, 0..) |*code, texel| code.* = if (texel % side < side / 2) 0 else 255;
    var texels: [4 * alpha.len]u8 = undefined;
    const level = testTexels(side, side, &alpha, &texels);
    const bounds: Bounds = try .init(testing.allocator, &level);
    defer bounds.deinit(testing.allocator);
    const limits: Limits = .{ .whole = 128, .seen = 128 };
    const Case = struct { world.Wrap, [2]f32, Share };
    for ([_]Case{
        .{ .repeat, .{ 0.1, 0.4 }, .nothing },
        .{ .repeat, .{ 0.6, 0.9 }, .whole },
        .{ .repeat, .{ 0.6, 0.99 }, .some }, // The next image begins with nothing.
        .{ .repeat, .{ 0.4, 0.6 }, .some },
        .{ .repeat, .{ 7.1, 7.4 }, .nothing },
        .{ .repeat, .{ -2.4, -2.1 }, .whole },
        .{ .repeat, .{ -2.1, -1.9 }, .some },
        .{ .repeat, .{ 0.6, 1.9 }, .some },
        .{ .repeat, .{ 0.1, 2000 }, .some },
        .{ .clamp_to_edge, .{ 0.6, 50 }, .whole },
        .{ .clamp_to_edge, .{ -50, 0.4 }, .nothing },
        .{ .clamp_to_edge, .{ -3, -2 }, .nothing },
        .{ .mirrored_repeat, .{ 0.6, 0.9 }, .whole },
        .{ .mirrored_repeat, .{ 1.1, 1.4 }, .whole },
        .{ .mirrored_repeat, .{ 1.6, 1.9 }, .nothing },
        .{ .mirrored_repeat, .{ -0.4, -0.1 }, .nothing },
        .{ .mirrored_repeat, .{ 0.9, 1.1 }, .some },
        .{ .repeat, .{ std.math.nan(f32), 0.4 }, .some },
    }) |case| {
        const u = case[1];
        const coordinates = [3][2]f32{ .{ u[0], 0.2 }, .{ u[1], 0.3 }, .{ u[0], 0.7 } };
        const mesh = testMesh(&coordinates);
        const lookup = testLookup(case[0]);
        const share = bounds.classify(&lookup, &mesh, .{ 0, 1, 2 }, limits);
        try testing.expectEqual(case[2], share);
    }
}

test "what has no digits left for texels is looked at again when it is hit" {
    var alpha: [64 * 64]u8 = undefined;
    for (&alpha, 0..) |*code, texel| code.* = if (texel % 64 < 32) 0 else 255;
    var texels: [4 * alpha.len]u8 = undefined;
    const level = testTexels(64, 64, &alpha, &texels);
    const bounds: Bounds = try .init(testing.allocator, &level);
    defer bounds.deinit(testing.allocator);
    const limits: Limits = .{ .whole = 128, .seen = 128 };
    // A float at 10^6 has steps of 4 texels, whatever is taken away behind it.
    for ([_]f32{ 0, 1e6 }, [_]Share{ .whole, .some }) |far, share| {
        const coordinates = [3][2]f32{
            .{ far + 0.625, 0 }, .{ far + 0.75, 0 }, .{ far + 0.75, 1 },
        };
        const mesh = testMesh(&coordinates);
        var lookup = testLookup(.repeat);
        lookup.transform[0][2] = -far;
        try testing.expectEqual(share, bounds.classify(&lookup, &mesh, .{ 0, 1, 2 }, limits));
    }
}

test "no texel that a lookup mixes is overlooked, and small triangles are told exactly" {
    var random_state: std.Random.DefaultPrng = .init(23);
    const random = random_state.random();
    var alpha: [53 * 37]u8 = undefined;
    var texels: [4 * alpha.len]u8 = undefined;
    var counts: std.enums.EnumArray(Share, u32) = .initFill(0);
    for (0..3000) |round| {
        const width = random.intRangeAtMost(u32, 1, 53);
        const height = random.intRangeAtMost(u32, 1, 37);
        // Mostly one value, at some places another.
        const usual: u8 = if (round % 2 == 0) 255 else 0;
        const used = alpha[0 .. width * height];
        for (used) |*code| code.* = if (random.uintLessThan(u32, 400) == 0) 255 - usual else usual;
        const level = testTexels(width, height, used, &texels);
        const bounds: Bounds = try .init(testing.allocator, &level);
        defer bounds.deinit(testing.allocator);
        const size: f32 = if (round % 3 == 0) 1 else 0.2;
        var coordinates: [3][2]f32 = undefined;
        const middle = [2]f32{ 3 * random.float(f32) - 1, 3 * random.float(f32) - 1 };
        for (&coordinates) |*at| {
            for (at, middle) |*value, around| value.* = around + size * random.float(f32);
        }
        const mesh = testMesh(&coordinates);
        const lookup = testLookup(random.enumValue(world.Wrap));
        const limits: Limits = .{ .whole = 200, .seen = 100 };
        const share = bounds.classify(&lookup, &mesh, .{ 0, 1, 2 }, limits);
        counts.getPtr(share).* += 1;
        if (share == .some) continue;
        const expected: u8 = if (share == .whole) 255 else 0;
        for (0..50) |_| {
            var weights: [3]f32 = undefined;
            for (&weights) |*weight| weight.* = random.float(f32);
            const sum = weights[0] + weights[1] + weights[2];
            var at: [2]f32 = .{ 0, 0 };
            for (coordinates, weights) |corner, weight| {
                for (&at, corner) |*to, value| to.* += value * weight / sum;
            }
            const x = firstMixed(at[0], width);
            const y = firstMixed(at[1], height);
            for ([_]i64{ x, x + 1 }) |column_at| for ([_]i64{ y, y + 1 }) |row_at| {
                const column = wrapped(column_at, width, lookup.wrap[0]);
                const row = wrapped(row_at, height, lookup.wrap[1]);
                try testing.expectEqual(expected, used[row * width + column]);
            };
        }
    }
    for (std.enums.values(Share)) |share| try testing.expect(counts.get(share) > 300);
}

fn firstMixed(coordinate: f32, size: u32) i64 {
    return @intFromFloat(@floor(coordinate * @as(f32, @floatFromInt(size)) - 0.5));
}

fn wrapped(at: i64, size: u32, wrap: world.Wrap) usize {
    const length: i64 = size;
    return @intCast(switch (wrap) {
        .clamp_to_edge => std.math.clamp(at, 0, length - 1),
        .repeat => @mod(at, length),
        .mirrored_repeat => mirrored: {
            const within = @mod(at, 2 * length);
            break :mirrored if (within < length) within else 2 * length - 1 - within;
        },
    });
}

test "limits follow from cutoff, factor and vertices" {
    const mask: scene.Material = .{ .alpha_mode = .mask, .base_color = .{ 1, 1, 1, 0.8 } };
    const half = Limits.of(&mask, .{ .least = 0.5, .largest = 1 });
    try testing.expectEqual(Limits{ .whole = 256, .seen = 160 }, half);
    var blend = mask;
    blend.alpha_mode = .blend;
    try testing.expectEqual(Limits{ .whole = 256, .seen = 1 }, Limits.of(&blend, .{}));
    blend.base_color[3] = 1;
    try testing.expectEqual(Limits{ .whole = 255, .seen = 1 }, Limits.of(&blend, .{}));
    var all = mask;
    all.alpha_cutoff = 0;
    try testing.expectEqual(Limits{ .whole = 0, .seen = 0 }, Limits.of(&all, .{}));
}

/// A triangle at nothing, one over the edge, one in the middle of what is whole, of one mesh.
fn loadAndSplit(gpa: Allocator, file: []const u8) !void {
    const view: scene.TextureView = .{ .texture = 0 };
    var from: scene.Scene = .init(gpa);
    defer from.deinit();
    const set: [9][2]f32 = .{
        .{ 0.1, 0.1 }, .{ 0.3, 0.1 }, .{ 0.1, 0.3 }, .{ 0.1, 0.1 }, .{ 0.8, 0.1 },
        .{ 0.1, 0.3 }, .{ 0.7, 0.7 }, .{ 0.9, 0.7 }, .{ 0.9, 0.9 },
    };
    const positions: [9][3]f32 = @splat(.{ 0, 0, 0 });
    from.images = &.{.{ .name = "a", .bytes = file }};
    from.textures = &.{.{ .image = 0 }};
    from.materials = &.{
        .{}, .{ .base_color_texture = view, .alpha_mode = .mask, .occlusion_texture = view },
    };
    from.meshes = &.{ .{
        .positions = &positions,
        .texcoords = .{ &set, null, null, null },
        .triangles = &.{ .{ 6, 7, 8 }, .{ 0, 1, 2 }, .{ 3, 4, 5 } },
        .morph_targets = &.{.{}},
        .material = 1,
    }, .{
        .positions = &positions,
        .triangles = &.{.{ 0, 1, 2 }},
        .material = 0,
    } };
    from.nodes = &.{.{ .parent = scene.none, .local = .identity }};
    from.instances = &.{
        .{ .mesh = 0, .node = 0, .morph_weights = &.{0.5} }, .{ .mesh = 1, .node = 0 },
    };
    var pool: parallel.Pool = .init(1);
    defer pool.deinit();
    var diagnostic: @import("../diagnostic.zig").Diagnostic = .{};
    var textures = try texture.load(gpa, &from, .{ .pool = &pool }, &diagnostic);
    defer textures.deinit();
    var arena: std.heap.ArenaAllocator = .init(gpa);
    defer arena.deinit();
    const parts = try split(
        gpa,
        arena.allocator(),
        from.materials,
        from.meshes,
        from.instances,
        &textures,
        &pool,
    );
    try testing.expectEqualSlices(u32, &.{ 0, 1, 1 }, parts.sources);
    try testing.expectEqual(.@"opaque", parts.materials[2].alpha_mode);
    try testing.expectEqual(3, parts.instances.len);
    const drawn = [_]u32{ 0, 2, 1 };
    for (parts.instances, drawn) |instance, mesh| try testing.expectEqual(mesh, instance.mesh);
    for (parts.instances, [_]usize{ 1, 1, 0 }) |instance, count| {
        try testing.expectEqual(count, instance.morph_weights.len);
    }
    const expected = [_][3]u32{ .{ 3, 4, 5 }, .{ 0, 1, 2 }, .{ 6, 7, 8 } };
    for (parts.meshes, expected, [_]u32{ 1, 0, 2 }) |mesh, triangle, material| {
        try testing.expectEqualSlices([3]u32, &.{triangle}, mesh.triangles);
        try testing.expectEqual(material, mesh.material);
    }
    const before = textures.lookupsOf(1);
    const after = textures.lookupsOf(2);
    try testing.expectEqual(2, after.len);
    try testing.expectEqual(3, before[0].channels[3]);
    try testing.expectEqual(texture_use.missing, after[0].channels[3]);
    try testing.expectEqual(before[0].texture, after[0].texture);
    try testing.expectEqual(before[1], after[1]);
}

test hasAlphaInMotion {
    var target: scene.MorphTarget = .{};
    var mesh: Mesh = .{ .positions = &.{}, .triangles = &.{}, .material = 0 };
    try testing.expect(!hasAlphaInMotion(&mesh, 1));
    mesh.morph_targets = (&target)[0..1];
    target.positions = &.{};
    target.texcoords[0] = &.{};
    try testing.expect(!hasAlphaInMotion(&mesh, 1));
    try testing.expect(hasAlphaInMotion(&mesh, 0));
    target.colors = &.{};
    try testing.expect(hasAlphaInMotion(&mesh, 1));
}

test "a mesh becomes what is seen whole and what is seen in part" {
    var files: std.heap.ArenaAllocator = .init(testing.allocator);
    defer files.deinit();
    const side = 32;
    var texels: [4 * side * side]u8 = undefined;
    for (0..side * side) |texel| {
        texels[4 * texel ..][0..4].* = .{ 1, 2, 3, if (texel % side < side / 2) 0 else 255 };
    }
    const file = try texture.TestImage.png(files.allocator(), side, side, 4, &texels);
    try testing.checkAllAllocationFailures(testing.allocator, loadAndSplit, .{file});
}
