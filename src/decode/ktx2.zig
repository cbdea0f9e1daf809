//! KTX 2 textures: Basis Universal (ETC1S, UASTC) by its transcoder, and plain 8-bit formats.
//!
//! In: a file. Out: the texels of its first mip level, in the channels that the file says it has.
//! The container is read here, every offset against the file's length (KTX File Format
//! Specification, version 2.0: sections 3 and 4, and BasisLZ in Khronos Data Format 1.3); only data
//! of the right size gets to a library. Not supported: other block formats, floats, arrays, cubes,
//! volumes.

const std = @import("std");
const Allocator = std.mem.Allocator;
const huge_pages = @import("../huge_pages.zig");
const memory_account = @import("../memory_account.zig");
const texels = @import("texels.zig");
const Info = texels.Info;
const Reason = texels.Reason;
const Texels = texels.Texels;
const invalid = texels.invalid;

/// What the file starts with.
pub const signature = "\xabKTX 20\xbb\r\n\x1a\n";

const header_bytes = 80;
const level_bytes = 24;

/// Which of RGBA a decoded pixel's channels are.
const Channels = []const u8;

/// How the pixels are stored, before compression of the level as a whole.
const Storage = union(enum) {
    etc1s: struct { has_alpha: bool },
    uastc,
    /// Bytes a pixel, in the order of `channels`.
    plain: u8,
};

const Compression = enum(u32) { none = 0, basis_lz = 1, zstandard = 2, zlib = 3, _ };

const Header = struct {
    width: u32,
    height: u32,
    storage: Storage,
    channels: Channels,
    compression: Compression,
    level_count: u32,
    /// Of the first level, as stored.
    level: []const u8,
    /// Of the first level, before compression.
    level_raw_bytes: u64,
    /// What BasisLZ shares among levels.
    shared: []const u8,
};

/// The header, with limits checked.
pub fn info(file: []const u8, reason: *Reason) error{InvalidImage}!Info {
    const header = try parse(file, reason);
    return .{
        .format = .ktx2,
        .width = header.width,
        .height = header.height,
        .channel_count = @intCast(header.channels.len),
        .is_float = false,
    };
}

/// The texels; the caller frees them.
pub fn decode(gpa: Allocator, file: []const u8, reason: *Reason) texels.Error!Texels {
    const header = try parse(file, reason);
    const pixel_count = @as(usize, header.width) * header.height;
    const stored_channels: usize = switch (header.storage) {
        .plain => |bytes| bytes,
        else => 4,
    };
    const memory = try huge_pages.alloc(gpa, u8, pixel_count * stored_channels);
    errdefer huge_pages.free(gpa, memory);
    var heap: memory_account.LibraryHeap = .{ .gpa = gpa };
    defer heap.deinit();
    const hooks = heap.hooks();
    switch (header.storage) {
        .plain => try inflate(&hooks, header, memory, reason),
        .uastc => {
            // Blocks are read as words, and a file may lie at any address.
            const is_plain = header.compression == .none;
            const is_ready = is_plain and std.mem.isAligned(@intFromPtr(header.level.ptr), 4);
            const copied_bytes = if (is_plain) header.level.len else header.level_raw_bytes;
            const raw = try huge_pages.alloc(gpa, u8, @intCast(if (is_ready) 0 else copied_bytes));
            defer huge_pages.free(gpa, raw);
            if (!is_ready) try inflate(&hooks, header, raw, reason);
            const level = if (is_ready) header.level else raw;
            try transcode(&hooks, &.{
                .width = header.width,
                .height = header.height,
                .level = level.ptr,
                .level_bytes = @intCast(level.len),
                .pixels = memory.ptr,
            }, reason);
        },
        .etc1s => |etc1s| {
            const image = try basisLz(header, etc1s.has_alpha, memory, reason);
            try transcode(&hooks, &image, reason);
        },
    }
    const bytes = select(memory, stored_channels, header.channels);
    return .{
        .width = header.width,
        .height = header.height,
        .channel_count = @intCast(header.channels.len),
        .data = .{ .bytes = bytes },
        .memory = memory,
    };
}

/// The wanted channels of each pixel, moved together where they stand.
fn select(memory: []u8, stored: usize, channels: Channels) []u8 {
    const count = memory.len / stored;
    const is_whole = stored == channels.len and for (channels, 0..) |channel, index| {
        if (channel != index) break false;
    } else true;
    if (is_whole) return memory;
    for (0..count) |pixel| {
        var colour: [4]u8 = undefined;
        @memcpy(colour[0..stored], memory[pixel * stored ..][0..stored]);
        for (channels, 0..) |channel, index| {
            memory[pixel * channels.len + index] = colour[channel];
        }
    }
    return memory[0 .. count * channels.len];
}

/// The level before compression, into `out` of exactly its size.
fn inflate(
    hooks: *const memory_account.Hooks,
    header: Header,
    out: []u8,
    reason: *Reason,
) texels.Error!void {
    switch (header.compression) {
        .none => @memcpy(out, header.level),
        .zstandard => switch (rl_zstd_decode(
            hooks,
            header.level.ptr,
            header.level.len,
            out.ptr,
            out.len,
        )) {
            .done => {},
            .exhausted => return error.OutOfMemory,
            .broken => return invalid(reason, "bad compressed data", .{}),
        },
        else => unreachable,
    }
}

fn transcode(
    hooks: *const memory_account.Hooks,
    image: *const BasisImage,
    reason: *Reason,
) texels.Error!void {
    return switch (rl_basis_decode(hooks, image)) {
        .done => {},
        .exhausted => error.OutOfMemory,
        .broken => invalid(reason, "bad compressed data", .{}),
    };
}

/// What a BasisLZ image consists of: codebooks that its levels share, and slices in the level.
fn basisLz(
    header: Header,
    has_alpha: bool,
    pixels: []u8,
    reason: *Reason,
) error{InvalidImage}!BasisImage {
    const shared = header.shared;
    const head_bytes = 20;
    const description_bytes = 20;
    const start = head_bytes + description_bytes * @as(u64, header.level_count);
    if (shared.len < start) return invalid(reason, "cut short", .{});
    const sizes = [3]u32{ word(shared, 4), word(shared, 8), word(shared, 12) };
    const end = start + @as(u64, sizes[0]) + sizes[1] + sizes[2];
    if (end > shared.len) return invalid(reason, "cut short", .{});
    const endpoints = shared[@intCast(start)..];
    const selectors = endpoints[sizes[0]..];
    const tables = selectors[sizes[1]..];
    const slices = shared[head_bytes..];
    const image: BasisImage = .{
        .width = header.width,
        .height = header.height,
        .level = header.level.ptr,
        .level_bytes = @intCast(header.level.len),
        .pixels = pixels.ptr,
        .endpoint_count = std.mem.readInt(u16, shared[0..2], .little),
        .selector_count = std.mem.readInt(u16, shared[2..4], .little),
        .endpoints = endpoints.ptr,
        .selectors = selectors.ptr,
        .tables = tables.ptr,
        .endpoints_bytes = sizes[0],
        .selectors_bytes = sizes[1],
        .tables_bytes = sizes[2],
        .colour_offset = word(slices, 4),
        .colour_bytes = word(slices, 8),
        .alpha_offset = if (has_alpha) word(slices, 12) else 0,
        .alpha_bytes = if (has_alpha) word(slices, 16) else 0,
    };
    for ([_]u64{
        @as(u64, image.colour_offset) + image.colour_bytes,
        @as(u64, image.alpha_offset) + image.alpha_bytes,
    }) |slice_end| if (slice_end > header.level.len) return invalid(reason, "cut short", .{});
    const is_empty = image.endpoint_count == 0 or image.selector_count == 0 or
        image.colour_bytes == 0 or (has_alpha and image.alpha_bytes == 0) or
        std.mem.findScalar(u32, &sizes, 0) != null;
    if (is_empty) return invalid(reason, "it has no pixels", .{});
    return image;
}

fn parse(file: []const u8, reason: *Reason) error{InvalidImage}!Header {
    if (file.len < header_bytes + level_bytes) return invalid(reason, "cut short", .{});
    const vk_format = word(file, 12);
    const level_count = @max(word(file, 40), 1);
    const compression: Compression = @fromBackingInt(word(file, 44));
    // Depth, layers, faces.
    if (word(file, 28) > 1 or word(file, 32) > 1 or word(file, 36) != 1)
        return invalid(reason, "arrays, cubes and volumes are not supported", .{});
    if (level_count > 32) return invalid(reason, "{d} mip levels", .{level_count});
    const width = word(file, 20);
    const height = word(file, 24);
    try texels.checkSize(width, height, texels.pixel_count_max, reason);
    const index = file[header_bytes..];
    const description = try part(file, word(file, 48), word(file, 52), reason);
    const storage, const channels = try storageOf(vk_format, description, reason);
    const header: Header = .{
        .width = width,
        .height = height,
        .storage = storage,
        .channels = channels,
        .compression = compression,
        .level_count = level_count,
        .level = try part(file, long(index, 0), long(index, 8), reason),
        .level_raw_bytes = if (compression == .none) long(index, 8) else long(index, 16),
        .shared = try part(file, long(file, 64), long(file, 72), reason),
    };
    const blocks = (@as(u64, width) + 3) / 4 * ((@as(u64, height) + 3) / 4);
    const is_compression_known = switch (compression) {
        .none, .zstandard => storage != .etc1s,
        .basis_lz => storage == .etc1s,
        else => false,
    };
    if (!is_compression_known) return invalid(
        reason,
        "supercompression {d} is not supported",
        .{@backingInt(compression)},
    );
    const expected = switch (storage) {
        .plain => |bytes| @as(u64, width) * height * bytes,
        .uastc => blocks * 16,
        .etc1s => return header,
    };
    if (header.level_raw_bytes != expected)
        return invalid(reason, "its first level has the wrong size", .{});
    return header;
}

/// From the Vulkan format, or for Basis Universal from the data format descriptor.
fn storageOf(
    vk_format: u32,
    description: []const u8,
    reason: *Reason,
) error{InvalidImage}!struct { Storage, Channels } {
    switch (vk_format) {
        0 => {},
        // R8, R8G8, R8G8B8, B8G8R8, R8G8B8A8, B8G8R8A8: linear and sRGB.
        9, 15 => return .{ .{ .plain = 1 }, &.{0} },
        16, 22 => return .{ .{ .plain = 2 }, &.{ 0, 1 } },
        23, 29 => return .{ .{ .plain = 3 }, &.{ 0, 1, 2 } },
        30, 36 => return .{ .{ .plain = 3 }, &.{ 2, 1, 0 } },
        37, 43 => return .{ .{ .plain = 4 }, &.{ 0, 1, 2, 3 } },
        44, 50 => return .{ .{ .plain = 4 }, &.{ 2, 1, 0, 3 } },
        else => return invalid(reason, "Vulkan format {d} is not supported", .{vk_format}),
    }
    const sample_start = 28;
    const sample_bytes = 16;
    if (description.len < sample_start + sample_bytes) return invalid(reason, "cut short", .{});
    const model = description[12];
    const channel = description[sample_start + 3] & 15;
    const has_second = description.len >= sample_start + 2 * sample_bytes;
    const gray: Channels = if (has_second) &.{ 0, 3 } else &.{0};
    const colours: Channels = if (has_second) &.{ 0, 1, 2, 3 } else &.{ 0, 1, 2 };
    switch (model) {
        // The channels are RGB, and RRR and GGG where there is one; the second sample is alpha.
        163 => return .{
            .{ .etc1s = .{ .has_alpha = has_second } },
            if (channel == 3 or channel == 4) gray else colours,
        },
        166 => return .{
            .uastc,
            switch (channel) {
                // RGB, RGBA, RRR, RRRG, RG.
                0 => &.{ 0, 1, 2 },
                4 => &.{0},
                5 => &.{ 0, 3 },
                6 => &.{ 0, 1 },
                else => &.{ 0, 1, 2, 3 },
            },
        },
        else => return invalid(reason, "colour model {d} is not supported", .{model}),
    }
}

/// A part of the file, within it.
fn part(
    file: []const u8,
    offset: u64,
    length: u64,
    reason: *Reason,
) error{InvalidImage}![]const u8 {
    if (offset > file.len or length > file.len - offset) return invalid(reason, "cut short", .{});
    return file[@intCast(offset)..][0..@intCast(length)];
}

fn word(bytes: []const u8, offset: usize) u32 {
    return std.mem.readInt(u32, bytes[offset..][0..4], .little);
}

fn long(bytes: []const u8, offset: usize) u64 {
    return std.mem.readInt(u64, bytes[offset..][0..8], .little);
}

/// In the order of basisu.cpp.
const BasisImage = extern struct {
    width: u32,
    height: u32,
    level: [*]const u8,
    level_bytes: u32,
    pixels: [*]u8,
    endpoint_count: u32 = 0,
    selector_count: u32 = 0,
    endpoints: ?[*]const u8 = null,
    selectors: ?[*]const u8 = null,
    tables: ?[*]const u8 = null,
    endpoints_bytes: u32 = 0,
    selectors_bytes: u32 = 0,
    tables_bytes: u32 = 0,
    colour_offset: u32 = 0,
    colour_bytes: u32 = 0,
    alpha_offset: u32 = 0,
    alpha_bytes: u32 = 0,
};

const Outcome = enum(c_int) { done, exhausted, broken };

extern fn rl_basis_decode(
    memory: *const memory_account.Hooks,
    image: *const BasisImage,
) Outcome;

extern fn rl_zstd_decode(
    memory: *const memory_account.Hooks,
    in: [*]const u8,
    in_bytes: usize,
    out: [*]u8,
    out_bytes: usize,
) Outcome;
