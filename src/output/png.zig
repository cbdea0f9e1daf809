//! PNG, 8 bits a channel, RGB or RGBA (W3C, "Portable Network Graphics", second edition).
//!
//! In: rows of sRGB bytes. Out: the parts of the file. Rows are cut into stretches, each of which
//! any thread filters and compresses by itself, into a chunk of its own. Where the cuts are depends
//! on the size alone, and so do the bytes.

const std = @import("std");
const Allocator = std.mem.Allocator;
const Image = @import("../image.zig").Image;
const Rows = @import("tonemap.zig").Rows;
const checksum = @import("checksum.zig");
const deflate = @import("deflate.zig");
const filter = @import("filter.zig");
const Adler32 = checksum.Adler32;
const assert = std.debug.assert;

/// Filtered bytes of a stretch, unless one row is longer: few enough for a small cache, enough for
/// a Huffman code of their own (96 KiB: files 0.1 % smaller; 32 KiB: 0.8 % larger).
const stretch_bytes = 64 << 10;

const signature = "\x89PNG\r\n\x1a\n";
/// DEFLATE with the usual window, compressed in a hurry (RFC 1950).
const stream_head = "\x78\x01";
/// A last block of nothing, which ends the stream but for its checksum.
const stream_end = "\x03\x00";

/// A file in the making: `encodeStretch` is called for each stretch, by any thread and in any
/// order, then `finish`.
pub const Encoder = struct {
    rows: Rows,
    stretch_count: usize,
    rows_per_stretch: u32,
    /// Holds all that is below.
    arena: std.heap.ArenaAllocator.State,
    /// By stretch: a chunk is written to its slot.
    slots: []u8,
    slot_bytes: usize,
    adlers: []Adler32,
    /// By thread.
    workspaces: []Workspace,
    head: []u8,
    tail: []u8,
    /// The head, a chunk for each stretch, the tail.
    parts: [][]const u8,

    /// Takes the memory for `thread_count` threads. Asserts that a row has less than 4 MiB.
    pub fn init(gpa: Allocator, rows: Rows, thread_count: usize) error{OutOfMemory}!Encoder {
        const row_bytes = rows.byteCount();
        assert(thread_count >= 1 and row_bytes < deflate.stretch_bytes_max);
        const image = rows.image;
        const row_count: u32 = @intCast(@max(1, stretch_bytes / (row_bytes + 1)));
        const rows_per_stretch = @min(row_count, image.height);
        const filtered_bytes = (row_bytes + 1) * rows_per_stretch;
        const stretch_count = @divCeil(image.height, rows_per_stretch);
        const slot_bytes = chunkBytes(stream_head.len + deflate.boundOf(filtered_bytes));

        var arena_state: std.heap.ArenaAllocator = .init(gpa);
        errdefer arena_state.deinit();
        const arena = arena_state.allocator();
        const workspaces = try arena.alloc(Workspace, @min(thread_count, stretch_count));
        for (workspaces) |*workspace| workspace.* = try .init(arena, row_bytes, filtered_bytes);
        const slots_bytes = std.math.mul(usize, stretch_count, slot_bytes) catch
            return error.OutOfMemory;
        return .{
            .rows = rows,
            .stretch_count = stretch_count,
            .rows_per_stretch = rows_per_stretch,
            .slots = try arena.alloc(u8, slots_bytes),
            .slot_bytes = slot_bytes,
            .adlers = try arena.alloc(Adler32, stretch_count),
            .workspaces = workspaces,
            .head = try arena.alloc(u8, signature.len + chunkBytes(13)),
            .tail = try arena.alloc(u8, chunkBytes(stream_end.len + 4) + chunkBytes(0)),
            .parts = try arena.alloc([]const u8, stretch_count + 2),
            .arena = arena_state.state,
        };
    }

    /// Frees everything.
    pub fn deinit(encoder: *Encoder, gpa: Allocator) void {
        encoder.arena.promote(gpa).deinit();
        encoder.* = undefined;
    }

    /// Filters and compresses one stretch with the memory of the thread.
    pub fn encodeStretch(encoder: *Encoder, stretch_index: usize, thread_index: usize) void {
        const workspace = &encoder.workspaces[thread_index];
        const y_begin = @as(u32, @intCast(stretch_index)) * encoder.rows_per_stretch;
        const y_end = @min(y_begin + encoder.rows_per_stretch, encoder.rows.image.height);
        const filtered = workspace.filterRows(encoder.rows, y_begin, y_end);
        encoder.adlers[stretch_index] = .of(filtered);

        const slot = encoder.slots[stretch_index * encoder.slot_bytes ..][0..encoder.slot_bytes];
        const stream = slot[chunk_head_bytes..];
        const head: []const u8 = if (stretch_index == 0) stream_head else "";
        @memcpy(stream[0..head.len], head);
        const compressed = deflate.compress(
            &workspace.deflate,
            filtered,
            encoder.rows.channel_count,
            stream[head.len..],
        );
        encoder.parts[1 + stretch_index] = sealChunk(slot, "IDAT", head.len + compressed.len);
    }

    /// The parts of the file, one after another, when all stretches are done. They are the
    /// encoder's.
    pub fn finish(encoder: *Encoder) []const []const u8 {
        const image = encoder.rows.image;
        const head = encoder.head;
        @memcpy(head[0..signature.len], signature);
        const header = head[signature.len + chunk_head_bytes ..];
        std.mem.writeInt(u32, header[0..4], image.width, .big);
        std.mem.writeInt(u32, header[4..8], image.height, .big);
        // Bits a channel; RGB or RGBA; and the only compression, filters and order that fit here.
        header[8..13].* = .{ 8, if (encoder.rows.channel_count == 4) 6 else 2, 0, 0, 0 };
        assert(sealChunk(head[signature.len..], "IHDR", 13).len == head.len - signature.len);
        encoder.parts[0] = head;

        const row_bytes = encoder.rows.byteCount() + 1;
        var adler: Adler32 = .{};
        for (encoder.adlers, 0..) |next, index| {
            const y_begin = index * encoder.rows_per_stretch;
            const row_count = @min(image.height - y_begin, encoder.rows_per_stretch);
            adler = adler.join(next, row_bytes * row_count);
        }
        const end = encoder.tail[chunk_head_bytes..];
        @memcpy(end[0..stream_end.len], stream_end);
        std.mem.writeInt(u32, end[stream_end.len..][0..4], adler.value(), .big);
        const last = sealChunk(encoder.tail, "IDAT", stream_end.len + 4);
        _ = sealChunk(encoder.tail[last.len..], "IEND", 0);
        encoder.parts[encoder.parts.len - 1] = encoder.tail;
        return encoder.parts;
    }
};

/// Length and type.
const chunk_head_bytes = 8;

/// Of a chunk with that much in it.
fn chunkBytes(content_bytes: usize) usize {
    return chunk_head_bytes + content_bytes + 4;
}

/// Puts the head and the checksum around what a chunk holds. Returns the chunk.
fn sealChunk(slot: []u8, name: *const [4]u8, content_bytes: usize) []u8 {
    std.mem.writeInt(u32, slot[0..4], @intCast(content_bytes), .big);
    slot[4..8].* = name.*;
    const checked = slot[4 .. chunk_head_bytes + content_bytes];
    std.mem.writeInt(u32, slot[4 + checked.len ..][0..4], checksum.crc32(checked), .big);
    return slot[0..chunkBytes(content_bytes)];
}

/// The memory of one thread.
const Workspace = struct {
    /// Two rows as `filter` wants them.
    rows: [2][]u8,
    filtered: []u8,
    deflate: deflate.Workspace,

    fn init(
        arena: Allocator,
        row_bytes: usize,
        filtered_bytes: usize,
    ) error{OutOfMemory}!Workspace {
        var workspace: Workspace = .{
            .rows = undefined,
            .filtered = try arena.alloc(u8, filtered_bytes),
            .deflate = try .init(arena, filtered_bytes),
        };
        for (&workspace.rows) |*row| {
            row.* = try arena.alloc(u8, filter.margin + row_bytes);
            @memset(row.*[0..filter.margin], 0);
        }
        return workspace;
    }

    /// Rows y_begin to y_end, each with the number of its filter in front.
    fn filterRows(workspace: *Workspace, rows: Rows, y_begin: u32, y_end: u32) []const u8 {
        var above, var row = workspace.rows;
        if (y_begin == 0) {
            @memset(above[filter.margin..], 0);
        } else {
            rows.encode(y_begin - 1, above[filter.margin..]);
        }
        const filtered_row_bytes = rows.byteCount() + 1;
        for (y_begin..y_end) |y| {
            rows.encode(@intCast(y), row[filter.margin..]);
            filter.apply(
                .{ .memory = row },
                .{ .memory = above },
                rows.channel_count,
                workspace.filtered[(y - y_begin) * filtered_row_bytes ..][0..filtered_row_bytes],
            );
            std.mem.swap([]u8, &row, &above);
        }
        return workspace.filtered[0 .. (y_end - y_begin) * filtered_row_bytes];
    }
};

/// The whole file; the caller frees it.
fn encodeForTest(image: *const Image, channel_count: u8) ![]u8 {
    const gpa = std.testing.allocator;
    const rows: Rows = .{ .image = image, .scale = 1, .channel_count = channel_count };
    var encoder: Encoder = try .init(gpa, rows, 1);
    defer encoder.deinit(gpa);
    var index = encoder.stretch_count;
    while (index > 0) {
        index -= 1;
        encoder.encodeStretch(index, 0);
    }
    return std.mem.concat(gpa, u8, encoder.finish());
}

test "a picture of one pixel, byte by byte" {
    const gpa = std.testing.allocator;
    var image: Image = try .init(gpa, 1, 1);
    defer image.deinit(gpa);
    image.pixels[0] = .{ 0, 0.5, 1, 1 };
    const file = try encodeForTest(&image, 3);
    defer gpa.free(file);
    const expected = signature ++ "\x00\x00\x00\x0dIHDR" ++
        "\x00\x00\x00\x01\x00\x00\x00\x01\x08\x02\x00\x00\x00" ++ "\x90\x77\x53\xde" ++
        // A stored block of 4 bytes, and an empty one.
        "\x00\x00\x00\x10IDAT" ++ "\x78\x01" ++ "\x00\x04\x00\xfb\xff" ++ "\x00\x00\xbc\xff" ++
        "\x00\x00\x00\xff\xff";
    try std.testing.expectStringStartsWith(file, expected);
    const end = "\x00\x00\x00\x00IEND\xae\x42\x60\x82";
    try std.testing.expectStringEndsWith(file, end);
}

test "every chunk has its checksum, and the stream its own" {
    const gpa = std.testing.allocator;
    var random = std.Random.DefaultPrng.init(5);
    for ([_][2]u32{ .{ 1, 1 }, .{ 7, 1 }, .{ 1, 9 }, .{ 33, 17 }, .{ 256, 256 } }) |size| {
        for ([_]u8{ 3, 4 }) |channel_count| {
            var image: Image = try .init(gpa, size[0], size[1]);
            defer image.deinit(gpa);
            for (image.pixels) |*pixel| {
                for (pixel) |*value| value.* = random.random().float(f32);
            }
            const file = try encodeForTest(&image, channel_count);
            defer gpa.free(file);
            var stream: std.ArrayList(u8) = .empty;
            defer stream.deinit(gpa);
            var rest: []const u8 = file[signature.len..];
            while (rest.len > 0) {
                const length = std.mem.readInt(u32, rest[0..4], .big);
                const stored = std.mem.readInt(u32, rest[8 + length ..][0..4], .big);
                try std.testing.expectEqual(std.hash.Crc32.hash(rest[4 .. 8 + length]), stored);
                if (std.mem.eql(u8, rest[4..8], "IDAT")) {
                    try stream.appendSlice(gpa, rest[8..][0..length]);
                }
                rest = rest[chunkBytes(length)..];
            }
            // The decoder checks the stream's checksum.
            var reader: std.Io.Reader = .fixed(stream.items);
            var window: [std.compress.flate.max_window_len]u8 = undefined;
            var decompress: std.compress.flate.Decompress = .init(&reader, .zlib, &window);
            const filtered = try decompress.reader.allocRemaining(gpa, .unlimited);
            defer gpa.free(filtered);
            try std.testing.expectEqual((size[0] * channel_count + 1) * size[1], filtered.len);
        }
    }
}

test "memory that runs out is an error, whenever it does" {
    const gpa = std.testing.allocator;
    var image: Image = try .init(gpa, 3, 3);
    defer image.deinit(gpa);
    for (0..100) |fail_index| {
        var failing: std.testing.FailingAllocator = .init(gpa, .{ .fail_index = fail_index });
        const rows: Rows = .{ .image = &image, .scale = 1, .channel_count = 3 };
        var encoder = Encoder.init(failing.allocator(), rows, 2) catch |err| {
            try std.testing.expectEqual(error.OutOfMemory, err);
            continue;
        };
        encoder.deinit(failing.allocator());
        break;
    } else return error.NeverEnoughMemory;
}
