//! WebP, lossy and lossless, by libwebp.
//!
//! In: a file with one image. Out: its texels, RGB or RGBA. Compiled are the library's versions in
//! plain C, which every target has, for they alone are promised to give the same bits.

const std = @import("std");
const Allocator = std.mem.Allocator;
const huge_pages = @import("../huge_pages.zig");
const memory_account = @import("../memory_account.zig");
const texels = @import("texels.zig");
const Info = texels.Info;
const Reason = texels.Reason;
const Texels = texels.Texels;
const invalid = texels.invalid;

/// Whether a file starts as WebP does.
pub fn isWebp(file: []const u8) bool {
    return file.len >= 12 and std.mem.eql(u8, file[0..4], "RIFF") and
        std.mem.eql(u8, file[8..12], "WEBP");
}

/// The header, with limits checked.
pub fn info(file: []const u8, reason: *Reason) error{InvalidImage}!Info {
    var features: Features = undefined;
    if (rl_webp_info(file.ptr, file.len, &features)) |text| return invalid(reason, "{s}", .{text});
    if (features.is_animated) return invalid(reason, "animated WebP is not supported", .{});
    const width: u32 = @intCast(features.width);
    const height: u32 = @intCast(features.height);
    // A lossless image of one colour takes no bytes for its pixels.
    try texels.checkSize(width, height, texels.pixel_count_max, reason);
    return .{
        .format = .webp,
        .width = width,
        .height = height,
        .channel_count = if (features.has_alpha) 4 else 3,
        .is_float = false,
    };
}

/// The texels; the caller frees them.
pub fn decode(gpa: Allocator, file: []const u8, reason: *Reason) texels.Error!Texels {
    const header = try info(file, reason);
    const byte_count = @as(usize, header.width) * header.height * header.channel_count;
    const memory = try huge_pages.alloc(gpa, u8, byte_count);
    errdefer huge_pages.free(gpa, memory);
    var heap: memory_account.LibraryHeap = .{ .gpa = gpa };
    defer heap.deinit();
    const hooks = heap.hooks();
    var text: [*:0]const u8 = "bad header";
    switch (rl_webp_decode(
        &hooks,
        file.ptr,
        file.len,
        header.channel_count,
        @intCast(header.width),
        @intCast(header.height),
        memory.ptr,
        &text,
    )) {
        .done => {},
        .exhausted => return error.OutOfMemory,
        .broken => return invalid(reason, "{s}", .{text}),
    }
    return .{
        .width = header.width,
        .height = header.height,
        .channel_count = header.channel_count,
        .data = .{ .bytes = memory },
        .memory = memory,
    };
}

const Features = extern struct { width: c_int, height: c_int, has_alpha: bool, is_animated: bool };

extern fn rl_webp_info(file: [*]const u8, file_bytes: usize, features: *Features) ?[*:0]const u8;

extern fn rl_webp_decode(
    memory: *const memory_account.Hooks,
    file: [*]const u8,
    file_bytes: usize,
    channels: c_int,
    width: c_int,
    height: c_int,
    pixels: [*]u8,
    reason: *[*:0]const u8,
) enum(c_int) { done, exhausted, broken };
