//! Quick compression for the filtered rows of a picture, in the DEFLATE format (RFC 1951).
//!
//! In: a stretch of bytes and how many of them a pixel has. Out: one block of it, with a Huffman
//! code of its own or stored, and an empty stored block, so that it ends on a byte and any other
//! stretch can follow. Repeats are sought one byte, one pixel and two pixels back and nowhere else:
//! filtered rows of rendered pictures are small numbers, whose codes are short, and long runs.
//! Repeats from further back were 14 % larger files in 16 pictures, and a hash table to find them.

const std = @import("std");
const huffman = @import("huffman.zig");
const Allocator = std.mem.Allocator;
const Code = huffman.Code;
const assert = std.debug.assert;

/// Bytes of a stretch at most: counts of symbols must fit.
pub const stretch_bytes_max = 1 << 22;
/// Shorter repeats cost as much as the bytes themselves.
const repeat_length_min = 8;
const repeat_length_max = 258;
/// Four such codes fit into the bit buffer beside what a byte may leave in it.
const literal_code_length_max = 14;

/// Bytes as they are, then a repeat.
const Repeat = struct {
    literal_count: u32,
    length: u16,
    /// Into `Distances`.
    distance_index: u16,
};

/// The memory of one thread.
pub const Workspace = struct {
    repeats: []Repeat,

    /// For stretches up to `byte_count`, which must be `stretch_bytes_max` at most.
    pub fn init(gpa: Allocator, byte_count: usize) error{OutOfMemory}!Workspace {
        assert(byte_count <= stretch_bytes_max);
        return .{ .repeats = try gpa.alloc(Repeat, byte_count / repeat_length_min) };
    }

    /// Frees the memory.
    pub fn deinit(workspace: *Workspace, gpa: Allocator) void {
        gpa.free(workspace.repeats);
        workspace.* = undefined;
    }
};

/// Bytes that `compress` may need for a stretch, some of which it only touches.
pub fn boundOf(byte_count: usize) usize {
    return byte_count + stored_header_bytes * (byte_count / stored_bytes_max + 2) + @sizeOf(u64);
}

/// Compresses a stretch of pixels of 3 or 4 bytes. Returns the part of `out` that it takes; asserts
/// that this is at least `boundOf` long. The same bytes on every target.
pub fn compress(workspace: *Workspace, bytes: []const u8, pixel_bytes: u8, out: []u8) []u8 {
    assert(bytes.len <= stretch_bytes_max and out.len >= boundOf(bytes.len));
    const distances: Distances = .init(pixel_bytes);
    var counts: Counts = .{};
    const repeats = findRepeats(workspace, bytes, &distances, &counts);
    const codes: Codes = .init(&counts);
    var writer: BitWriter = .{ .out = out };
    if (codes.bitCount(&counts) < storedBitCount(bytes.len)) {
        codes.write(&writer);
        writeSymbols(&writer, &codes, &distances, bytes, repeats);
    } else {
        writer.stored(bytes);
    }
    writer.stored("");
    return out[0..writer.position];
}

/// How far back repeats are sought, in bytes: flat runs, and runs of one pixel or of two.
const Distances = struct {
    bytes: [3]usize,
    symbols: [3]Symbol,

    fn init(pixel_bytes: usize) Distances {
        assert(pixel_bytes == 3 or pixel_bytes == 4);
        var distances: Distances = .{
            .bytes = .{ 1, pixel_bytes, 2 * pixel_bytes },
            .symbols = undefined,
        };
        for (&distances.symbols, distances.bytes) |*symbol, distance| symbol.* = switch (distance) {
            // RFC 1951, section 3.2.5.
            1 => .{ .index = 0 },
            3 => .{ .index = 2 },
            4 => .{ .index = 3 },
            6 => .{ .index = 4, .extra_bits = 1, .extra_length = 1 },
            8 => .{ .index = 5, .extra_bits = 1, .extra_length = 1 },
            else => unreachable,
        };
        return distances;
    }

    fn largest(distances: *const Distances) usize {
        return distances.bytes[distances.bytes.len - 1];
    }
};

/// A symbol of the format with the plain bits that follow its code.
const Symbol = struct {
    index: u16,
    extra_bits: u8 = 0,
    extra_length: u8 = 0,
};

const literal_symbol_count = 286;
const end_symbol = 256;
const length_symbol_first = 257;
const distance_symbol_count = 30;

/// Symbols of the repeats of each length, from 3 (RFC 1951, section 3.2.5).
const length_symbols: [repeat_length_max - 2]Symbol = table: {
    var table: [repeat_length_max - 2]Symbol = undefined;
    var length: usize = 3;
    for (0..28) |index| {
        const extra_length = if (index < 4) 0 else index / 4 - 1;
        for (0..1 << extra_length) |extra| {
            if (length == repeat_length_max) break;
            table[length - 3] = .{
                .index = length_symbol_first + index,
                .extra_bits = extra,
                .extra_length = extra_length,
            };
            length += 1;
        }
    }
    // The longest has a code of its own.
    table[repeat_length_max - 3] = .{ .index = length_symbol_first + 28 };
    break :table table;
};

/// How often each symbol occurs in a stretch.
const Counts = struct {
    literals: [literal_symbol_count]u32 = @splat(0),
    distances: [distance_symbol_count]u32 = @splat(0),
    /// Plain bits behind codes.
    extra_bit_count: u64 = 0,

    fn addRepeat(counts: *Counts, length: Symbol, distance: Symbol) void {
        counts.literals[length.index] += 1;
        counts.distances[distance.index] += 1;
        counts.extra_bit_count += length.extra_length + distance.extra_length;
    }
};

/// Cuts the stretch into bytes and repeats, and counts the symbols.
fn findRepeats(
    workspace: *Workspace,
    bytes: []const u8,
    distances: *const Distances,
    counts: *Counts,
) []const Repeat {
    // By place modulo 4: the same byte often occurs twice in a row, and would wait for itself.
    var literals: [4][256]u32 = @splat(@splat(0));
    var count: usize = 0;
    var literal_begin: usize = 0;
    var position = distances.largest();
    while (position + repeat_length_min <= bytes.len) {
        var skip: usize = repeat_length_min;
        const index: usize = for (distances.bytes, 0..) |distance, index| {
            const difference = differenceOf(bytes, position, distance);
            if (difference == 0) break index;
            // No repeat begins before the last byte that differs.
            skip = @min(skip, repeat_length_min - @clz(difference) / 8);
        } else {
            position += skip;
            continue;
        };
        const length = repeatLength(bytes, position, distances.bytes[index]);
        countLiterals(&literals, bytes[literal_begin..position]);
        counts.addRepeat(length_symbols[length - 3], distances.symbols[index]);
        workspace.repeats[count] = .{
            .literal_count = @intCast(position - literal_begin),
            .length = @intCast(length),
            .distance_index = @intCast(index),
        };
        count += 1;
        position += length;
        literal_begin = position;
    }
    countLiterals(&literals, bytes[literal_begin..]);
    for (counts.literals[0..256], 0..) |*sum, byte| {
        for (&literals) |*part| sum.* += part[byte];
    }
    counts.literals[end_symbol] = 1;
    return workspace.repeats[0..count];
}

/// Not 0 in each of 8 bytes that differs from the one `distance` before it.
inline fn differenceOf(bytes: []const u8, position: usize, distance: usize) u64 {
    const here = std.mem.readInt(u64, bytes[position..][0..8], .little);
    return here ^ std.mem.readInt(u64, bytes[position - distance ..][0..8], .little);
}

/// How long the repeat is; at least 8 bytes of it are known.
fn repeatLength(bytes: []const u8, position: usize, distance: usize) usize {
    const length_max = @min(repeat_length_max, bytes.len - position);
    var length: usize = repeat_length_min;
    while (length + 8 <= length_max) : (length += 8) {
        const difference = differenceOf(bytes, position + length, distance);
        if (difference != 0) return length + @ctz(difference) / 8;
    }
    while (length < length_max) : (length += 1) {
        if (bytes[position + length] != bytes[position + length - distance]) break;
    }
    return length;
}

inline fn countLiterals(counts: *[4][256]u32, bytes: []const u8) void {
    var rest = bytes;
    while (rest.len >= 4) : (rest = rest[4..]) {
        inline for (counts, rest[0..4]) |*part, byte| part[byte] += 1;
    }
    for (rest) |byte| counts[0][byte] += 1;
}

/// The Huffman codes of a block, and how its head describes them.
const Codes = struct {
    literals: [literal_symbol_count]Code,
    distances: [distance_symbol_count]Code,
    head: Head,

    fn init(counts: *Counts) Codes {
        var lengths: [literal_symbol_count + distance_symbol_count]u8 = undefined;
        const literal_lengths = lengths[0..literal_symbol_count];
        const distance_lengths = lengths[literal_symbol_count..];
        huffman.findLengths(&counts.literals, literal_code_length_max, literal_lengths);
        huffman.findLengths(&counts.distances, huffman.length_limit, distance_lengths);
        var codes: Codes = .{
            .literals = undefined,
            .distances = undefined,
            .head = .init(literal_lengths, distance_lengths),
        };
        huffman.findCodes(literal_lengths, &codes.literals);
        huffman.findCodes(distance_lengths, &codes.distances);
        return codes;
    }

    /// Of the whole block.
    fn bitCount(codes: *const Codes, counts: *const Counts) u64 {
        var sum = codes.head.bitCount() + counts.extra_bit_count;
        for (&codes.literals, &counts.literals) |code, count| sum += @as(u64, code.length) * count;
        for (&codes.distances, &counts.distances) |code, count| {
            sum += @as(u64, code.length) * count;
        }
        return sum;
    }

    fn write(codes: *const Codes, writer: *BitWriter) void {
        writer.put(block_dynamic, 3);
        codes.head.write(writer);
    }
};

/// The lengths of the codes, as the head of a block holds them (RFC 1951, section 3.2.7): runs of
/// them shortened, and that in a Huffman code again.
const Head = struct {
    literal_count: usize,
    distance_count: usize,
    symbols: [literal_symbol_count + distance_symbol_count]Symbol = undefined,
    symbol_count: usize = 0,
    /// Of the code of the lengths.
    lengths: [19]u8,
    codes: [19]Code,

    const repeat_last = 16;
    const zeros_few = 17;
    const zeros_many = 18;
    /// Lengths that are seldom used come last, so that they can be left away.
    const order = [19]u8{ 16, 17, 18, 0, 8, 7, 9, 6, 10, 5, 11, 4, 12, 3, 13, 2, 14, 1, 15 };

    fn init(literal_lengths: []const u8, distance_lengths: []const u8) Head {
        var head: Head = .{
            .literal_count = usedCount(literal_lengths, 257),
            .distance_count = usedCount(distance_lengths, 1),
            .lengths = undefined,
            .codes = undefined,
        };
        head.addRuns(literal_lengths[0..head.literal_count]);
        head.addRuns(distance_lengths[0..head.distance_count]);
        var counts: [19]u32 = @splat(0);
        for (head.symbols[0..head.symbol_count]) |symbol| counts[symbol.index] += 1;
        huffman.findLengths(&counts, 7, &head.lengths);
        huffman.findCodes(&head.lengths, &head.codes);
        return head;
    }

    /// How many there are without the zeros at the end, but at least `least`.
    fn usedCount(lengths: []const u8, least: usize) usize {
        var count = lengths.len;
        while (count > least and lengths[count - 1] == 0) count -= 1;
        return count;
    }

    /// Shortens runs; one never goes on from the one list into the other.
    fn addRuns(head: *Head, lengths: []const u8) void {
        var rest = lengths;
        var last: ?u8 = null;
        while (rest.len > 0) {
            const length = rest[0];
            const run = runOf(rest);
            const symbol: Symbol, const taken: usize = if (length == 0 and run > 10)
                .{ symbolOf(zeros_many, @min(run, 138) - 11, 7), @min(run, 138) }
            else if (length == 0 and run > 2)
                .{ symbolOf(zeros_few, run - 3, 3), run }
            else if (length == last and run > 2)
                .{ symbolOf(repeat_last, @min(run, 6) - 3, 2), @min(run, 6) }
            else
                .{ symbolOf(length, 0, 0), 1 };
            head.symbols[head.symbol_count] = symbol;
            head.symbol_count += 1;
            last = length;
            rest = rest[taken..];
        }
    }

    fn symbolOf(index: u16, extra_bits: usize, extra_length: u8) Symbol {
        return .{
            .index = index,
            .extra_bits = @intCast(extra_bits),
            .extra_length = extra_length,
        };
    }

    fn runOf(lengths: []const u8) usize {
        for (lengths, 0..) |length, index| if (length != lengths[0]) return index;
        return lengths.len;
    }

    fn orderCount(head: *const Head) usize {
        var count = order.len;
        while (count > 4 and head.lengths[order[count - 1]] == 0) count -= 1;
        return count;
    }

    fn bitCount(head: *const Head) u64 {
        var sum: u64 = 3 + 5 + 5 + 4 + 3 * head.orderCount();
        for (head.symbols[0..head.symbol_count]) |symbol| {
            sum += head.lengths[symbol.index] + symbol.extra_length;
        }
        return sum;
    }

    fn write(head: *const Head, writer: *BitWriter) void {
        writer.put(head.literal_count - 257, 5);
        writer.put(head.distance_count - 1, 5);
        writer.put(head.orderCount() - 4, 4);
        for (order[0..head.orderCount()]) |index| {
            writer.put(head.lengths[index], 3);
            writer.flush();
        }
        for (head.symbols[0..head.symbol_count]) |symbol| {
            writer.putSymbol(&head.codes, symbol);
            writer.flush();
        }
    }
};

/// Heads of blocks in 3 bits, the lowest of which would say that a block is the last.
const block_stored = 0b000;
const block_dynamic = 0b100;
const stored_bytes_max = 65535;
const stored_header_bytes = 5;

/// Of `byte_count` bytes that are stored, at most.
fn storedBitCount(byte_count: usize) u64 {
    return 8 * (byte_count + stored_header_bytes * @divCeil(byte_count, stored_bytes_max));
}

fn writeSymbols(
    writer: *BitWriter,
    codes: *const Codes,
    distances: *const Distances,
    bytes: []const u8,
    repeats: []const Repeat,
) void {
    var rest = bytes;
    for (repeats) |repeat| {
        writer.putLiterals(&codes.literals, rest[0..repeat.literal_count]);
        writer.putSymbol(&codes.literals, length_symbols[repeat.length - 3]);
        writer.putSymbol(&codes.distances, distances.symbols[repeat.distance_index]);
        writer.flush();
        rest = rest[repeat.literal_count + repeat.length ..];
    }
    writer.putLiterals(&codes.literals, rest);
    writer.putSymbol(&codes.literals, .{ .index = end_symbol });
    writer.flush();
}

/// Bits, the lowest of a byte first.
const BitWriter = struct {
    out: []u8,
    position: usize = 0,
    buffer: u64 = 0,
    /// Bits in the buffer, less than 8 after a flush.
    bit_count: u6 = 0,

    /// Asserts nothing: the caller flushes before there are 64 bits.
    inline fn put(writer: *BitWriter, bits: u64, bit_count: u8) void {
        writer.buffer |= bits << writer.bit_count;
        writer.bit_count += @intCast(bit_count);
    }

    inline fn putSymbol(writer: *BitWriter, codes: []const Code, symbol: Symbol) void {
        const code = codes[symbol.index];
        assert(code.length > 0);
        writer.put(code.bits, code.length);
        writer.put(symbol.extra_bits, symbol.extra_length);
    }

    inline fn putLiterals(
        writer: *BitWriter,
        codes: *const [literal_symbol_count]Code,
        bytes: []const u8,
    ) void {
        comptime assert(7 + 4 * literal_code_length_max < 64);
        var rest = bytes;
        while (rest.len >= 4) : (rest = rest[4..]) {
            inline for (rest[0..4]) |byte| writer.put(codes[byte].bits, codes[byte].length);
            writer.flush();
        }
        for (rest) |byte| writer.put(codes[byte].bits, codes[byte].length);
        writer.flush();
    }

    /// Moves whole bytes out of the buffer.
    inline fn flush(writer: *BitWriter) void {
        std.mem.writeInt(u64, writer.out[writer.position..][0..8], writer.buffer, .little);
        writer.position += writer.bit_count >> 3;
        writer.buffer >>= writer.bit_count & ~@as(u6, 7);
        writer.bit_count &= 7;
    }

    /// Writes bytes as they are, in stored blocks, one at least. Ends on a byte.
    fn stored(writer: *BitWriter, bytes: []const u8) void {
        var rest = bytes;
        while (true) {
            const part = rest[0..@min(rest.len, stored_bytes_max)];
            writer.put(block_stored, 3);
            writer.flush();
            if (writer.bit_count > 0) writer.position += 1;
            writer.buffer = 0;
            writer.bit_count = 0;
            const out = writer.out[writer.position..];
            std.mem.writeInt(u16, out[0..2], @intCast(part.len), .little);
            std.mem.writeInt(u16, out[2..4], ~@as(u16, @intCast(part.len)), .little);
            @memcpy(out[4..][0..part.len], part);
            writer.position += 4 + part.len;
            rest = rest[part.len..];
            if (rest.len == 0) return;
        }
    }
};

/// What a decoder makes of a stretch: the block that `compress` leaves open is closed here.
fn decompressed(gpa: Allocator, compressed: []const u8) ![]u8 {
    // An empty stored block that is the last one.
    const stream = try std.mem.concat(gpa, u8, &.{ compressed, &.{ 1, 0, 0, 0xff, 0xff } });
    defer gpa.free(stream);
    var reader: std.Io.Reader = .fixed(stream);
    var window: [std.compress.flate.max_window_len]u8 = undefined;
    var decompress: std.compress.flate.Decompress = .init(&reader, .raw, &window);
    return decompress.reader.allocRemaining(gpa, .unlimited);
}

/// Compresses, decodes and compares. Returns the size.
fn expectRoundTrip(bytes: []const u8, pixel_bytes: u8) !usize {
    const gpa = std.testing.allocator;
    var workspace: Workspace = try .init(gpa, bytes.len);
    defer workspace.deinit(gpa);
    const out = try gpa.alloc(u8, boundOf(bytes.len));
    defer gpa.free(out);
    const compressed = compress(&workspace, bytes, pixel_bytes, out);
    const decoded = try decompressed(gpa, compressed);
    defer gpa.free(decoded);
    try std.testing.expectEqualSlices(u8, bytes, decoded);
    return compressed.len;
}

test "noise is stored, in as many blocks as it takes" {
    const gpa = std.testing.allocator;
    var random = std.Random.DefaultPrng.init(3);
    const bytes = try gpa.alloc(u8, 2 * stored_bytes_max + 1);
    defer gpa.free(bytes);
    random.random().bytes(bytes);
    for ([_]usize{ 0, 1, 7, 8, 15, 100 }) |count| {
        const size = try expectRoundTrip(bytes[0..count], 3);
        try std.testing.expect(size <= count + 2 * stored_header_bytes);
    }
    for ([_]usize{ stored_bytes_max, stored_bytes_max + 1, bytes.len }) |count| {
        const block_count = @divCeil(count, stored_bytes_max);
        const expected = count + stored_header_bytes * (block_count + 1);
        try std.testing.expectEqual(expected, try expectRoundTrip(bytes[0..count], 4));
    }
}

test "repeats of every length and distance, everywhere" {
    var bytes: [700]u8 = undefined;
    for ([_]u8{ 3, 4 }) |pixel_bytes| {
        for ([_]usize{ 1, pixel_bytes, 2 * pixel_bytes, 5 }) |distance| {
            for (0..300) |length| {
                var random = std.Random.DefaultPrng.init(length);
                random.random().bytes(&bytes);
                const begin = 20 + length % 11;
                for (begin..begin + length) |place| bytes[place] = bytes[place - distance];
                // Some end with the repeat.
                const end = if (length % 2 == 0) begin + length else bytes.len;
                _ = try expectRoundTrip(bytes[0..end], pixel_bytes);
            }
        }
    }
}

test "runs and small numbers take little" {
    const gpa = std.testing.allocator;
    const bytes = try gpa.alloc(u8, 100_000);
    defer gpa.free(bytes);
    @memset(bytes, 0);
    try std.testing.expect(try expectRoundTrip(bytes, 3) < 300);
    var random = std.Random.DefaultPrng.init(4);
    for (bytes) |*byte| byte.* = @as(u8, @clz(random.random().int(u16))) *% 255;
    // About two bits each.
    try std.testing.expect(try expectRoundTrip(bytes, 4) < bytes.len / 8 * 2 + 300);
}

test "codes as long as they get" {
    const gpa = std.testing.allocator;
    // Each byte half as often as the one before it: an unlimited code would have 20 bits.
    var bytes: std.ArrayList(u8) = .empty;
    defer bytes.deinit(gpa);
    for (0..20) |byte| {
        for (0..@as(usize, 1) << @intCast(19 - byte)) |_| try bytes.append(gpa, @intCast(byte));
    }
    var random = std.Random.DefaultPrng.init(5);
    random.random().shuffle(u8, bytes.items);
    // Two bits each would do.
    const size = try expectRoundTrip(bytes.items, 3);
    try std.testing.expect(size < bytes.items.len * 2 / 8 * 101 / 100);
}
