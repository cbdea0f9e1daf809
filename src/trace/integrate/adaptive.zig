//! Adaptive sampling: where a picture has noise, and when a part of it has little enough.
//!
//! In: sums of samples on the film, after passes. Out: which blocks of pixels get more. Blocks are
//! those of the whole picture's grid, and each is judged by its own samples alone, where these are
//! a power of two: the first half of them and the second are two pictures, and half their
//! difference is a measure of the error of the mean (Dammertz et al. 2010, "A Hierarchical
//! Automatic Stopping Condition for Monte Carlo Global Illumination"). So it does not matter who
//! traces what, in which passes.

const std = @import("std");
const film_file = @import("../../film.zig");
const Film = film_file.Film;
const Layout = film_file.Layout;
const Rectangle = film_file.Rectangle;
const assert = std.debug.assert;

/// Pixels on the side of a block.
pub const block_side = 16;

/// Samples before which no block is judged: what has not been met by then is not expected.
pub const sample_count_min = 16;

/// How much of it may be left.
pub const Noise = struct {
    /// Root of the mean square of a block's standard errors, in square roots of radiance, which
    /// are near to what a display's codes are; white is 1, and what is beyond it is white.
    error_max: f32,
    /// What radiance is multiplied with to be seen.
    exposure_scale: f32,
};

/// All blocks of a film, on which windows begin with whole ones of the picture's grid. Those of a
/// tile are changed by whoever has the tile.
pub const Blocks = struct {
    noise: Noise,
    width: u32,
    columns: u32,
    states: []State,
    /// By pixel: sums of samples when these were a power of two for the last time.
    first_half: []@Vector(4, f32),
    active_count: std.atomic.Value(u32),

    const State = struct {
        sample_count: u32 = 0,
        is_active: bool = true,
    };

    /// To be freed by `deinit`.
    pub fn init(
        gpa: std.mem.Allocator,
        layout: *const Layout,
        noise: Noise,
    ) error{OutOfMemory}!Blocks {
        const width, const height = .{ layout.film_width, layout.film_height };
        const columns = @divCeil(width, block_side);
        const states = try gpa.alloc(State, @as(usize, columns) * @divCeil(height, block_side));
        errdefer gpa.free(states);
        @memset(states, .{});
        var active_count: u32 = 0;
        for (0..layout.count()) |number| {
            const traced = layout.windowAt(@intCast(number)).traced;
            assert(traced.x0 % block_side == 0 and traced.y0 % block_side == 0);
            active_count += @divCeil(traced.x1 - traced.x0, block_side) *
                @divCeil(traced.y1 - traced.y0, block_side);
        }
        return .{
            .noise = noise,
            .width = width,
            .columns = columns,
            .states = states,
            .first_half = try gpa.alloc(@Vector(4, f32), @as(usize, width) * height),
            .active_count = .init(active_count),
        };
    }

    /// Frees everything.
    pub fn deinit(blocks: *Blocks, gpa: std.mem.Allocator) void {
        gpa.free(blocks.first_half);
        gpa.free(blocks.states);
        blocks.* = undefined;
    }

    /// The blocks of a tile of the film, which has only whole ones but at the picture's edge, row
    /// by row.
    pub fn of(blocks: *const Blocks, tile: Rectangle) Iterator {
        assert(tile.x0 % block_side == 0 and tile.y0 % block_side == 0);
        return .{ .blocks = blocks, .tile = tile, .x = tile.x0, .y = tile.y0 };
    }

    /// See `of`.
    pub const Iterator = struct {
        blocks: *const Blocks,
        tile: Rectangle,
        x: u32,
        y: u32,

        /// Null: there are no more.
        pub fn next(iterator: *Iterator) ?Block {
            const tile = &iterator.tile;
            if (iterator.x >= tile.x1) {
                iterator.x = tile.x0;
                iterator.y += block_side;
            }
            if (iterator.y >= tile.y1) return null;
            const x, const y = .{ iterator.x, iterator.y };
            iterator.x += block_side;
            return .{
                .state = &iterator.blocks.states[
                    y / block_side * iterator.blocks.columns + x / block_side
                ],
                .rectangle = .{
                    .x0 = x,
                    .y0 = y,
                    .x1 = @min(x + block_side, tile.x1),
                    .y1 = @min(y + block_side, tile.y1),
                },
            };
        }

        /// The next ones side by side that get more samples, as one rectangle.
        pub fn nextActive(iterator: *Iterator) ?Rectangle {
            var run: ?Rectangle = null;
            while (true) {
                const before = iterator.*;
                const block = iterator.next() orelse return run;
                if (run) |*rectangle| {
                    const is_beside = block.rectangle.y0 == rectangle.y0 and
                        block.rectangle.x0 == rectangle.x1;
                    if (!is_beside or !block.state.is_active) {
                        iterator.* = before;
                        return rectangle.*;
                    }
                    rectangle.x1 = block.rectangle.x1;
                } else if (block.state.is_active) run = block.rectangle;
            }
        }
    };

    /// One of them.
    pub const Block = struct { state: *State, rectangle: Rectangle };

    /// How many of some blocks had a pass, and how many of those get no more.
    pub const Judged = struct { active_before: usize = 0, finished: usize = 0 };

    /// After a pass over the active blocks of a tile: which of them get more.
    pub fn judge(blocks: *Blocks, tile: Rectangle, film: *const Film, sample_count: u32) Judged {
        var judged: Judged = .{};
        var all = blocks.of(tile);
        while (all.next()) |block| {
            if (!block.state.is_active) continue;
            judged.active_before += 1;
            block.state.sample_count = sample_count;
            if (!std.math.isPowerOfTwo(sample_count)) continue;
            if (sample_count >= sample_count_min) {
                const found = blocks.errorOf(block.rectangle, film, sample_count);
                if (found < blocks.noise.error_max) {
                    block.state.is_active = false;
                    judged.finished += 1;
                    _ = blocks.active_count.fetchSub(1, .monotonic);
                    continue;
                }
            }
            for (block.rectangle.y0..block.rectangle.y1) |y| {
                const from = y * blocks.width + block.rectangle.x0;
                const to = y * blocks.width + block.rectangle.x1;
                for (blocks.first_half[from..to], film.image.pixels[from..to]) |*sum, pixel| {
                    sum.* = pixel;
                }
            }
        }
        return judged;
    }

    /// Not a number where a pixel is not.
    fn errorOf(
        blocks: *const Blocks,
        rectangle: Rectangle,
        film: *const Film,
        sample_count: u32,
    ) f32 {
        const V4 = @Vector(4, f32);
        const half: V4 = @splat(blocks.noise.exposure_scale /
            @as(f32, @floatFromInt(sample_count / 2)));
        var squares: V4 = @splat(0);
        for (rectangle.y0..rectangle.y1) |y| for (rectangle.x0..rectangle.x1) |x| {
            const at = y * blocks.width + x;
            const all: V4 = film.image.pixels[at];
            const first = blocks.first_half[at];
            const difference = shown(first * half) - shown((all - first) * half);
            squares += difference * difference;
        };
        const pixel_count = (rectangle.x1 - rectangle.x0) * (rectangle.y1 - rectangle.y0);
        const sum = (squares[0] + squares[1]) + squares[2];
        return @sqrt(sum / @as(f32, @floatFromInt(3 * 4 * pixel_count)));
    }

    fn shown(radiance: @Vector(4, f32)) @Vector(4, f32) {
        const black: @Vector(4, f32) = @splat(0);
        const white: @Vector(4, f32) = @splat(1);
        const light = @select(f32, radiance < black, black, radiance);
        return @sqrt(@select(f32, light > white, white, light));
    }
};

test "blocks of a picture, those of tiles, and those side by side that are active" {
    const gpa = std.testing.allocator;
    const noise: Noise = .{ .error_max = 0.1, .exposure_scale = 1 };
    var blocks: Blocks = try .init(gpa, &.whole(70, 40), noise);
    defer blocks.deinit(gpa);
    try std.testing.expectEqual(5 * 3, blocks.states.len);
    var all = blocks.of(.{ .x0 = 32, .y0 = 16, .x1 = 70, .y1 = 40 });
    var count: usize = 0;
    while (all.next()) |block| : (count += 1) {
        const rectangle = block.rectangle;
        const wanted = &blocks.states[rectangle.y0 / 16 * 5 + rectangle.x0 / 16];
        try std.testing.expectEqual(wanted, block.state);
        block.state.is_active = count != 1;
    }
    try std.testing.expectEqual(6, count);
    var active = blocks.of(.{ .x0 = 32, .y0 = 16, .x1 = 70, .y1 = 40 });
    for ([_]Rectangle{
        .{ .x0 = 32, .y0 = 16, .x1 = 48, .y1 = 32 },
        .{ .x0 = 64, .y0 = 16, .x1 = 70, .y1 = 32 },
        .{ .x0 = 32, .y0 = 32, .x1 = 70, .y1 = 40 },
    }) |wanted| try std.testing.expectEqual(wanted, active.nextActive().?);
    try std.testing.expectEqual(null, active.nextActive());
}

test "the error of a block is that of its mean, as it is shown" {
    const gpa = std.testing.allocator;
    var film: Film = try .init(gpa, 32, 16, .init(.{ .color = true }));
    defer film.deinit(gpa);
    var random: std.Random.DefaultPrng = .init(7);
    // The first block is quiet, and what the second has is no number.
    var blocks: Blocks =
        try .init(gpa, &.whole(32, 16), .{ .error_max = 0.014, .exposure_scale = 4 });
    defer blocks.deinit(gpa);
    const left: Rectangle = .{ .x0 = 0, .y0 = 0, .x1 = 16, .y1 = 16 };
    const tile: Rectangle = .{ .x0 = 0, .y0 = 0, .x1 = 32, .y1 = 16 };
    // Passes of blocks, and those that they are spared.
    var pieces: usize = 0;
    for (0..64) |number| {
        for (0..16) |y| for (0..32) |x| {
            const value = 0.09 + 0.03 * random.random().floatNorm(f32);
            const sample: f32 = if (x < 16) value else std.math.nan(f32);
            film.add(@intCast(x), @intCast(y), @intCast(number), @splat(sample));
        };
        const count: u32 = @intCast(number + 1);
        if (count == 64) {
            // The root's slope, of the standard error of 64 samples.
            const wanted = 4 * 0.03 / @sqrt(64.0) / (2 * @sqrt(4 * 0.09));
            const found = blocks.errorOf(left, &film, 64);
            try std.testing.expectApproxEqRel(wanted, found, 0.1);
        }
        const judged = blocks.judge(tile, &film, count);
        pieces += judged.active_before + judged.finished * (64 - count);
    }
    try std.testing.expectEqual(2 * 64, pieces);
    for (blocks.states, [_]bool{ false, true }) |state, is_active| {
        const wanted: Blocks.State = .{ .sample_count = 64, .is_active = is_active };
        try std.testing.expectEqual(wanted, state);
    }
    try std.testing.expectEqual(1, blocks.active_count.load(.monotonic));
}
