//! Which pixels of a picture a film has, and where: all of them, a crop, or one share of tiles.
//!
//! In: the picture's size, the part that is asked for, and what has to be traced around it. Out:
//! windows of the picture, each with its place on the film. Tiles of the picture's own grid are
//! ordered along a curve (Morton 1966) and dealt out in rounds, each of which begins with another
//! share by chance (`Random`): each share has one of any few neighbours, and no pattern of the
//! picture's is all in one of them. On the film a share's tiles lie side by side, so that it is no
//! larger than what it shows.

const std = @import("std");
const settings = @import("../settings.zig");
const Diagnostic = @import("../diagnostic.zig").Diagnostic;
const Rectangle = @import("../film.zig").Rectangle;
const assert = std.debug.assert;

/// Sides of tiles, the first of which that gives each share enough of them, else the last.
/// Multiples of what integrators take at once, and of blocks that get more samples.
const tile_sides = [_]u32{ 144, 48, 16 };
/// Tiles of a share, so that shares take much the same time.
const share_tile_count = 32;

/// What is traced besides a window's own pixels, for these depend on it.
pub const Surroundings = struct {
    /// So many pixels all around.
    margin: u32 = 0,
    /// And out to multiples of it on the picture; a divisor of the sides of tiles.
    step: u32 = 1,
};

/// Pixels that belong together, of the picture, with their place on the film.
pub const Window = struct {
    /// Those that are asked for.
    own: Rectangle,
    /// Those that are traced: the film has room for them.
    traced: Rectangle,
};

/// A part of a picture.
pub const Layout = struct {
    /// Of the whole picture.
    width: u32,
    height: u32,
    /// Of the film.
    film_width: u32,
    film_height: u32,
    around: Surroundings,
    form: Form,

    /// What windows there are.
    pub const Form = union(enum) {
        /// One.
        window: [4]u32,
        share: Share,
    };

    /// One share of the tiles.
    pub const Share = struct {
        /// From 1 to `count`.
        number: u32,
        count: u32,
        side: u32,
        /// Tiles of a row of the picture, and of the film.
        columns: u32,
        film_columns: u32,
        /// Tiles by row and column of the picture, in the order in which the film has them.
        tiles: []const u32,
    };

    /// All of a picture.
    pub fn whole(width: u32, height: u32) Layout {
        return ofWindow(width, height, .{ 0, 0, width, height }, .{});
    }

    /// A part of a picture; `deinit` frees it. The diagnostic says why there is none.
    pub fn init(
        gpa: std.mem.Allocator,
        width: u32,
        height: u32,
        part: settings.Part,
        around: Surroundings,
        diagnostic: *Diagnostic,
    ) error{ OutOfMemory, PartUnknown }!Layout {
        switch (part) {
            .whole => return .whole(width, height),
            .crop => |crop| {
                const window = crop.pixelsOf(width, height);
                const is_some = window[0] < window[2] and window[1] < window[3];
                if (is_some and window[2] <= width and window[3] <= height)
                    return ofWindow(width, height, window, around);
                return diagnostic.fail(
                    error.PartUnknown,
                    "there are no pixels {d},{d},{d},{d} in a picture of {d}x{d}",
                    .{ window[0], window[1], window[2], window[3], width, height },
                );
            },
            .tile => |tile| {
                const side = sideFor(width, height, tile.count);
                const total = tilesAcross(width, side) * tilesAcross(height, side);
                if (tile.count > total) return diagnostic.fail(
                    error.PartUnknown,
                    "a picture of {d}x{d} has {d} tiles, too few for {d} parts",
                    .{ width, height, total, tile.count },
                );
                return ofShare(gpa, width, height, tile, side, around);
            },
        }
    }

    fn ofWindow(width: u32, height: u32, own: [4]u32, around: Surroundings) Layout {
        const traced = outset(own, around, width, height);
        return .{
            .width = width,
            .height = height,
            .film_width = traced[2] - traced[0],
            .film_height = traced[3] - traced[1],
            .around = around,
            .form = .{ .window = own },
        };
    }

    fn ofShare(
        gpa: std.mem.Allocator,
        width: u32,
        height: u32,
        tile: settings.Part.Tile,
        side: u32,
        around: Surroundings,
    ) error{OutOfMemory}!Layout {
        assert(side % around.step == 0 and tile.number >= 1 and tile.number <= tile.count);
        const columns = tilesAcross(width, side);
        const tiles = try deal(gpa, columns, tilesAcross(height, side), tile);
        // As square as it may be, for formats bound either side.
        const film_columns: u32 = @ceil(@sqrt(@as(f64, @floatFromInt(tiles.len))));
        const film_rows: u32 = @intCast(@divCeil(tiles.len, film_columns));
        return .{
            .width = width,
            .height = height,
            .film_width = film_columns * (side + 2 * around.margin),
            .film_height = film_rows * (side + 2 * around.margin),
            .around = around,
            .form = .{ .share = .{
                .number = tile.number,
                .count = tile.count,
                .side = side,
                .columns = columns,
                .film_columns = film_columns,
                .tiles = tiles,
            } },
        };
    }

    /// Frees it.
    pub fn deinit(layout: *Layout, gpa: std.mem.Allocator) void {
        switch (layout.form) {
            .window => {},
            .share => |share| gpa.free(share.tiles),
        }
        layout.* = undefined;
    }

    /// How many windows there are.
    pub fn count(layout: *const Layout) u32 {
        return switch (layout.form) {
            .window => 1,
            .share => |share| @intCast(share.tiles.len),
        };
    }

    /// One of them.
    pub fn windowAt(layout: *const Layout, number: u32) Window {
        const width, const height = .{ layout.width, layout.height };
        switch (layout.form) {
            .window => |own| {
                const traced = outset(own, layout.around, width, height);
                const shift = [2]u32{ 0 -% traced[0], 0 -% traced[1] };
                return .{ .own = placed(own, shift), .traced = placed(traced, shift) };
            },
            .share => |share| {
                const side = share.side;
                const x = share.tiles[number] % share.columns * side;
                const y = share.tiles[number] / share.columns * side;
                const own = [4]u32{ x, y, @min(x + side, width), @min(y + side, height) };
                const margin = layout.around.margin;
                const room = side + 2 * margin;
                const shift = [2]u32{
                    number % share.film_columns * room + margin -% x,
                    number / share.film_columns * room + margin -% y,
                };
                const traced = outset(own, layout.around, width, height);
                return .{ .own = placed(own, shift), .traced = placed(traced, shift) };
            },
        }
    }

    /// Whether the film has the picture's pixels, where they are in it.
    pub fn isWhole(layout: *const Layout) bool {
        return layout.film_width == layout.width and layout.film_height == layout.height and
            layout.form == .window and !layout.hasSurroundings();
    }

    /// Whether the film has pixels that nobody asked for.
    pub fn hasSurroundings(layout: *const Layout) bool {
        return switch (layout.form) {
            .window => |own| layout.film_width != own[2] - own[0] or
                layout.film_height != own[3] - own[1],
            .share => layout.around.margin > 0,
        };
    }

    /// The same part without what is around it; it has no memory of its own.
    pub fn bare(layout: *const Layout) Layout {
        var same = layout.*;
        same.around = .{};
        switch (layout.form) {
            .window => |own| {
                same.film_width = own[2] - own[0];
                same.film_height = own[3] - own[1];
            },
            .share => |share| {
                const room = share.side + 2 * layout.around.margin;
                same.film_width = layout.film_width / room * share.side;
                same.film_height = layout.film_height / room * share.side;
            },
        }
        return same;
    }

    /// How many pixels are traced.
    pub fn tracedCount(layout: *const Layout) u64 {
        var sum: u64 = 0;
        for (0..layout.count()) |number| {
            sum += layout.windowAt(@intCast(number)).traced.pixelCount();
        }
        return sum;
    }

    /// How many pixels are asked for.
    pub fn ownCount(layout: *const Layout) u64 {
        var sum: u64 = 0;
        for (0..layout.count()) |number| {
            sum += layout.windowAt(@intCast(number)).own.pixelCount();
        }
        return sum;
    }
};

fn placed(edges: [4]u32, shift: [2]u32) Rectangle {
    return .{ .x0 = edges[0], .y0 = edges[1], .x1 = edges[2], .y1 = edges[3], .shift = shift };
}

fn outset(own: [4]u32, around: Surroundings, width: u32, height: u32) [4]u32 {
    const margin, const step = .{ around.margin, around.step };
    return .{
        (own[0] -| margin) / step * step,
        (own[1] -| margin) / step * step,
        @min(std.mem.alignForward(u32, own[2] + margin, step), width),
        @min(std.mem.alignForward(u32, own[3] + margin, step), height),
    };
}

fn tilesAcross(length: u32, side: u32) u32 {
    return @divCeil(length, side);
}

fn sideFor(width: u32, height: u32, share_count: u32) u32 {
    for (tile_sides[0 .. tile_sides.len - 1]) |side| {
        const total = @as(u64, tilesAcross(width, side)) * tilesAcross(height, side);
        if (total >= @as(u64, share_count) * share_tile_count) return side;
    }
    return tile_sides[tile_sides.len - 1];
}

/// The tiles of one share, in the order of the curve.
fn deal(
    gpa: std.mem.Allocator,
    columns: u32,
    rows: u32,
    tile: settings.Part.Tile,
) error{OutOfMemory}![]const u32 {
    const total = columns * rows;
    var tiles: std.ArrayList(u32) = .empty;
    errdefer tiles.deinit(gpa);
    try tiles.ensureTotalCapacityPrecise(gpa, @divCeil(total, tile.count));
    const side: u64 = std.math.ceilPowerOfTwoAssert(u32, @max(columns, rows));
    var rank: u32 = 0;
    var code: u64 = 0;
    while (code < side * side) : (code += 1) {
        const x, const y = .{ evenBits(code), evenBits(code >> 1) };
        if (x >= columns or y >= rows) continue;
        const round, const place = .{ rank / tile.count, rank % tile.count };
        if (ownerOf(round, place, tile.count) == tile.number - 1)
            tiles.appendAssumeCapacity(y * columns + x);
        rank += 1;
    }
    return tiles.toOwnedSlice(gpa);
}

/// Who gets a tile of a round.
fn ownerOf(round: u32, place: u32, share_count: u32) u32 {
    var random: std.Random.SplitMix64 = .init(round);
    const turn = random.next() % share_count;
    return @intCast((place + turn) % share_count);
}

/// Every second bit, from the lowest.
fn evenBits(code: u64) u32 {
    var bits = code & 0x5555_5555_5555_5555;
    inline for (.{
        .{ 1, 0x3333_3333_3333_3333 },  .{ 2, 0x0f0f_0f0f_0f0f_0f0f },
        .{ 4, 0x00ff_00ff_00ff_00ff },  .{ 8, 0x0000_ffff_0000_ffff },
        .{ 16, 0x0000_0000_ffff_ffff },
    }) |step| bits = (bits | bits >> step[0]) & step[1];
    return @intCast(bits);
}

const testing = std.testing;

/// Adds 1 to each pixel that windows have, on the picture and on the film.
fn countPixels(layout: *const Layout, picture: []u8, film: []u8) !void {
    for (0..layout.count()) |number| {
        const window = layout.windowAt(@intCast(number));
        const own, const traced = .{ window.own, window.traced };
        try testing.expect(traced.x0 <= own.x0 and traced.x1 >= own.x1);
        try testing.expect(traced.y0 <= own.y0 and traced.y1 >= own.y1);
        for (own.y0..own.y1) |y| for (own.x0..own.x1) |x| {
            picture[y * layout.width + x] += 1;
        };
        const on_film = traced.onFilm();
        try testing.expect(on_film.x1 <= layout.film_width);
        try testing.expect(on_film.y1 <= layout.film_height);
        for (on_film.y0..on_film.y1) |y| for (on_film.x0..on_film.x1) |x| {
            film[y * layout.film_width + x] += 1;
        };
    }
}

test "the shares of a picture are all of it, each pixel once, on small films" {
    var diagnostic: Diagnostic = .{};
    const sizes = [_][3]u32{ .{ 40, 25, 1 }, .{ 40, 25, 5 }, .{ 300, 17, 7 }, .{ 16, 90, 6 } };
    for (sizes) |case| for ([_]Surroundings{ .{}, .{ .margin = 2 }, .{ .step = 16 } }) |around| {
        const width, const height, const share_count = case;
        var picture: [300 * 100]u8 = @splat(0);
        var pixel_count: u64 = 0;
        for (1..share_count + 1) |number| {
            const part: settings.Part =
                .{ .tile = .{ .number = @intCast(number), .count = share_count } };
            var layout: Layout =
                try .init(testing.allocator, width, height, part, around, &diagnostic);
            defer layout.deinit(testing.allocator);
            var film: [200 * 200]u8 = @splat(0);
            try countPixels(&layout, &picture, &film);
            for (film) |times| try testing.expect(times <= 1);
            pixel_count += layout.ownCount();
            try testing.expect(layout.tracedCount() >= layout.ownCount());
            const room = 16 + 2 * around.margin;
            const tile_count = @divCeil(width, 16) * @divCeil(height, 16);
            const most = @divCeil(tile_count, share_count);
            const bound = (most + std.math.sqrt(most) + 2) * room * room;
            try testing.expect(layout.film_width * layout.film_height <= bound);
            const own = layout.bare();
            try testing.expectEqual(around.margin > 0, layout.hasSurroundings());
            try testing.expect(!own.hasSurroundings() and own.ownCount() == own.tracedCount());
        }
        try testing.expectEqual(@as(u64, width) * height, pixel_count);
        for (picture[0 .. width * height]) |times| try testing.expectEqual(1, times);
    };
}

test "a crop is a window, and what is around it ends where the picture does" {
    var diagnostic: Diagnostic = .{};
    const part: settings.Part = .{ .crop = .{ .pixels = .{ 3, 17, 40, 20 } } };
    var layout: Layout = try .init(testing.allocator, 45, 21, part, .{
        .margin = 2,
        .step = 16,
    }, &diagnostic);
    defer layout.deinit(testing.allocator);
    const window = layout.windowAt(0);
    try testing.expectEqual(37 * 3, window.own.pixelCount());
    const traced = window.traced;
    const edges = [4]u32{ traced.x0, traced.y0, traced.x1, traced.y1 };
    try testing.expectEqual([4]u32{ 0, 0, 45, 21 }, edges);
    try testing.expect(layout.hasSurroundings() and !layout.isWhole());
    const bare = layout.bare();
    try testing.expectEqual([2]u32{ 37, 3 }, .{ bare.film_width, bare.film_height });
    try testing.expectEqual(0, bare.windowAt(0).own.onFilm().x0);
    try testing.expect(Layout.whole(45, 21).isWhole());

    const shares: settings.Part.Crop = .{ .shares = .{ 0, 0.25, 0.5, 1 } };
    try testing.expectEqual([4]u32{ 0, 3, 4, 10 }, shares.pixelsOf(8, 10));
    for ([_]settings.Part{
        .{ .crop = .{ .pixels = .{ 0, 0, 46, 21 } } },
        .{ .crop = .{ .shares = .{ 0.5, 0, 0.5, 1 } } },
        .{ .tile = .{ .number = 1, .count = 7 } },
    }) |bad| {
        const result = Layout.init(testing.allocator, 45, 21, bad, .{}, &diagnostic);
        try testing.expectError(error.PartUnknown, result);
    }
}

test "tiles are large where there are many, and shares have as many" {
    var diagnostic: Diagnostic = .{};
    for ([_][2]u32{ .{ 1, 144 }, .{ 3, 144 }, .{ 16, 48 }, .{ 100, 16 } }) |case| {
        var least: u32 = std.math.maxInt(u32);
        var most: u32 = 0;
        for (1..case[0] + 1) |number| {
            const part: settings.Part =
                .{ .tile = .{ .number = @intCast(number), .count = case[0] } };
            var layout: Layout =
                try .init(testing.allocator, 1500, 1400, part, .{}, &diagnostic);
            defer layout.deinit(testing.allocator);
            try testing.expectEqual(case[1], layout.form.share.side);
            least = @min(least, layout.count());
            most = @max(most, layout.count());
        }
        try testing.expect(least > 0 and most - least <= 1);
    }
}
