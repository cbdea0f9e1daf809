//! OpenEXR: pictures of scan lines, by OpenEXRCore and libdeflate.
//!
//! In: a file of one part with the channels R, G, B, or Y, and A where there is one, of halves or
//! floats; not compressed, or by RLE, ZIP, ZIPS, PIZ or PXR24. Out: its data window as floats,
//! colours as they are, that is multiplied by alpha. The header is read here before the library
//! sees the file (OpenEXR File Layout, header and attributes): what is not supported has a reason.

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
pub const signature = "\x76\x2f\x31\x01";

/// What is not finite becomes it: the largest half.
const value_max: f32 = 65_504;

/// Deflate's best case, and more than that of the others.
const inflation_max = 1040;

const Compression = enum(u8) { none, rle, zips, zip, piz, pxr24, b44, b44a, dwaa, dwab, _ };

/// Of channels.
pub const Names = []const [*:0]const u8;

const Header = struct { width: u32, height: u32, names: Names };

/// Channels by name, as far as they matter.
const Channels = struct {
    r: bool = false,
    g: bool = false,
    b: bool = false,
    y: bool = false,
    a: bool = false,

    fn names(channels: Channels) ?Names {
        if (channels.r and channels.g and channels.b)
            return if (channels.a) &.{ "R", "G", "B", "A" } else &.{ "R", "G", "B" };
        if (channels.y) return if (channels.a) &.{ "Y", "A" } else &.{"Y"};
        return null;
    }
};

/// The header, with limits checked.
pub fn info(file: []const u8, reason: *Reason) error{InvalidImage}!Info {
    const header = try parse(file, reason);
    return .{
        .format = .exr,
        .width = header.width,
        .height = header.height,
        .channel_count = @intCast(header.names.len),
        .is_float = true,
    };
}

/// The texels; the caller frees them.
pub fn decode(gpa: Allocator, file: []const u8, reason: *Reason) texels.Error!Texels {
    const header = try parse(file, reason);
    const count = @as(usize, header.width) * header.height * header.names.len;
    const bytes = std.math.mul(usize, count, @sizeOf(f32)) catch return error.OutOfMemory;
    const memory = try huge_pages.alloc(gpa, u8, bytes);
    errdefer huge_pages.free(gpa, memory);
    const floats: []f32 = @ptrCast(memory);
    try readFloats(gpa, file, header.names, header.width, header.height, floats, reason);
    for (floats) |*value| {
        // Of a NaN, zero.
        value.* = if (value.* > 0) (if (value.* < std.math.inf(f32)) value.* else value_max) else 0;
    }
    return .{
        .width = header.width,
        .height = header.height,
        .channel_count = @intCast(header.names.len),
        .data = .{ .floats = floats },
        .memory = memory,
    };
}

/// The named channels of all pixels, side by side.
fn readFloats(
    gpa: Allocator,
    file: []const u8,
    names: Names,
    width: u32,
    height: u32,
    floats: []f32,
    reason: *Reason,
) texels.Error!void {
    var heap: memory_account.LibraryHeap = .{ .gpa = gpa };
    defer heap.deinit();
    const hooks = heap.hooks();
    var text: [*:0]const u8 = undefined;
    return switch (rl_exr_decode(
        &hooks,
        file.ptr,
        file.len,
        names.ptr,
        @intCast(names.len),
        @intCast(width),
        @intCast(height),
        floats.ptr,
        &text,
    )) {
        .done => {},
        .exhausted => error.OutOfMemory,
        .broken => invalid(reason, "{s}", .{text}),
    };
}

/// Floats of a part of a picture, and what its header says of it.
pub const Part = struct {
    /// Size of the picture: the display window.
    whole: [2]u32,
    /// Upper left pixel, and size: the data window.
    origin: [2]u32,
    width: u32,
    height: u32,
    /// Of the attribute that is asked for, in the file; null: it has none.
    text: ?[]const u8,
    /// The attribute that lists channels.
    channels: []const u8,
};

/// The header of a part with a text as one of its attributes; `side_limit` and `pixel_limit` bound
/// its size.
pub fn partInfo(
    file: []const u8,
    text_name: []const u8,
    side_limit: u32,
    pixel_limit: u64,
    reason: *Reason,
) error{InvalidImage}!Part {
    const header = try scan(file, text_name, reason);
    var channels: Channels = .{};
    const pixel_bytes = try parseChannels(header.channels, &channels, reason);
    const window = header.window orelse return invalid(reason, "bad header", .{});
    const display = header.display orelse return invalid(reason, "bad header", .{});
    const is_inside = display[0] == 0 and display[1] == 0 and window[0] >= 0 and window[1] >= 0 and
        window[0] <= window[2] and window[1] <= window[3] and window[2] <= display[2] and
        window[3] <= display[3] and display[2] < side_limit and display[3] < side_limit;
    if (!is_inside) return invalid(reason, "its windows are not those of a part", .{});
    const width: u32, const height: u32 =
        .{ @intCast(window[2] - window[0] + 1), @intCast(window[3] - window[1] + 1) };
    const most = inflation_max * @as(u64, file.len) / pixel_bytes;
    if (@as(u64, width) * height > @min(most, pixel_limit)) return invalid(
        reason,
        "{d}x{d} pixels are more than its bytes can hold",
        .{ width, height },
    );
    return .{
        .whole = .{ @intCast(display[2] + 1), @intCast(display[3] + 1) },
        .origin = .{ @intCast(window[0]), @intCast(window[1]) },
        .width = width,
        .height = height,
        .text = header.text,
        .channels = header.channels,
    };
}

/// Floats of these channels of all pixels of a part, as they are, side by side; the caller frees
/// them by `huge_pages.free`. The part is the file's.
pub fn decodePart(
    gpa: Allocator,
    file: []const u8,
    part: *const Part,
    names: Names,
    reason: *Reason,
) texels.Error![]align(64) f32 {
    for (names) |name| if (!try hasFloats(part.channels, std.mem.span(name), reason))
        return invalid(reason, "it has no channel {s} of floats", .{name});
    const row = std.math.mul(usize, part.width, names.len) catch return error.OutOfMemory;
    const count = std.math.mul(usize, row, part.height) catch return error.OutOfMemory;
    const floats = try huge_pages.alloc(gpa, f32, count);
    errdefer huge_pages.free(gpa, floats);
    try readFloats(gpa, file, names, part.width, part.height, floats, reason);
    return floats;
}

fn hasFloats(list: []const u8, wanted: []const u8, reason: *Reason) error{InvalidImage}!bool {
    var rest: Rest = .{ .bytes = list };
    while (true) {
        const name = try rest.text(reason);
        if (name.len == 0) return false;
        const kind = try rest.word(reason);
        _ = try rest.take(4, reason);
        const is_sampled = try rest.word(reason) == 1 and try rest.word(reason) == 1;
        if (std.mem.eql(u8, name, wanted)) return kind == 2 and is_sampled;
    }
}

/// What headers have that matters here.
const Scan = struct {
    window: ?[4]i32 = null,
    display: ?[4]i32 = null,
    channels: []const u8 = "",
    text: ?[]const u8 = null,
};

fn scan(file: []const u8, text_name: []const u8, reason: *Reason) error{InvalidImage}!Scan {
    if (!std.mem.startsWith(u8, file, signature)) return invalid(reason, "not OpenEXR", .{});
    var rest: Rest = .{ .bytes = file };
    _ = try rest.take(signature.len, reason);
    const version = try rest.word(reason);
    const is_deep = version & 0x800 != 0;
    const has_parts = version & 0x1000 != 0;
    if (version & 0xff != 2 or is_deep) return invalid(reason, "deep EXR is not supported", .{});
    if (has_parts) return invalid(reason, "EXR of several parts is not supported", .{});
    if (version & 0x200 != 0) return invalid(reason, "tiled EXR is not supported", .{});
    var found: Scan = .{};
    var compression: ?Compression = null;
    while (true) {
        const name = try rest.text(reason);
        if (name.len == 0) break;
        const kind = try rest.text(reason);
        const value = try rest.take(try rest.word(reason), reason);
        if (std.mem.eql(u8, name, "channels")) {
            found.channels = value;
        } else if (std.mem.eql(u8, name, text_name) and std.mem.eql(u8, kind, "string")) {
            found.text = value;
        } else if (std.mem.eql(u8, name, "compression")) {
            if (value.len != 1) return invalid(reason, "bad header", .{});
            compression = @fromBackingInt(value[0]);
        } else if (std.mem.eql(u8, name, "dataWindow")) {
            if (value.len != 16) return invalid(reason, "bad header", .{});
            found.window = @bitCast(value[0..16].*);
        } else if (std.mem.eql(u8, name, "displayWindow")) {
            if (value.len != 16) return invalid(reason, "bad header", .{});
            found.display = @bitCast(value[0..16].*);
        }
    }
    switch (compression orelse return invalid(reason, "bad header", .{})) {
        .none, .rle, .zips, .zip, .piz, .pxr24 => {},
        .b44, .b44a, .dwaa, .dwab => |kind| return invalid(
            reason,
            "compression {t} is not supported",
            .{kind},
        ),
        _ => |kind| return invalid(
            reason,
            "compression {d} is not supported",
            .{@backingInt(kind)},
        ),
    }
    return found;
}

fn parse(file: []const u8, reason: *Reason) error{InvalidImage}!Header {
    const header = try scan(file, "", reason);
    var channels: Channels = .{};
    const pixel_bytes = try parseChannels(header.channels, &channels, reason);
    const names = channels.names() orelse
        return invalid(reason, "it has no channels R, G and B, nor Y", .{});
    const edges = header.window orelse return invalid(reason, "bad header", .{});
    const width = @as(i64, edges[2]) - edges[0] + 1;
    const height = @as(i64, edges[3]) - edges[1] + 1;
    const most = inflation_max * @as(u64, file.len) / pixel_bytes;
    try texels.checkSize(@intCast(@max(width, 0)), @intCast(@max(height, 0)), most, reason);
    return .{ .width = @intCast(width), .height = @intCast(height), .names = names };
}

/// Notes the channels that there are; bytes of a pixel in all of them.
fn parseChannels(
    list: []const u8,
    channels: *Channels,
    reason: *Reason,
) error{InvalidImage}!u64 {
    var rest: Rest = .{ .bytes = list };
    var pixel_bytes: u64 = 0;
    while (true) {
        const name = try rest.text(reason);
        if (name.len == 0) break;
        const kind = try rest.word(reason);
        // Whether it is perceptually linear, and nothing.
        _ = try rest.take(4, reason);
        const is_sampled = try rest.word(reason) == 1 and try rest.word(reason) == 1;
        pixel_bytes += if (kind == 1) 2 else 4;
        const is_wanted = is_sampled and (kind == 1 or kind == 2) and name.len == 1;
        if (is_wanted) switch (name[0]) {
            'R' => channels.r = true,
            'G' => channels.g = true,
            'B' => channels.b = true,
            'Y' => channels.y = true,
            'A' => channels.a = true,
            else => {},
        };
    }
    if (pixel_bytes == 0) return invalid(reason, "it has no channels", .{});
    return pixel_bytes;
}

/// What is left of a header.
const Rest = struct {
    bytes: []const u8,

    fn take(rest: *Rest, length: usize, reason: *Reason) error{InvalidImage}![]const u8 {
        if (length > rest.bytes.len) return invalid(reason, "cut short", .{});
        defer rest.bytes = rest.bytes[length..];
        return rest.bytes[0..length];
    }

    fn word(rest: *Rest, reason: *Reason) error{InvalidImage}!u32 {
        return std.mem.readInt(u32, (try rest.take(4, reason))[0..4], .little);
    }

    /// Up to its zero, which is taken as well.
    fn text(rest: *Rest, reason: *Reason) error{InvalidImage}![]const u8 {
        const length = std.mem.findScalar(u8, rest.bytes, 0) orelse
            return invalid(reason, "cut short", .{});
        defer rest.bytes = rest.bytes[length + 1 ..];
        return rest.bytes[0..length];
    }
};

extern fn rl_exr_decode(
    memory: *const memory_account.Hooks,
    file: [*]const u8,
    file_bytes: usize,
    names: [*]const [*:0]const u8,
    count: c_int,
    width: c_int,
    height: c_int,
    pixels: [*]f32,
    reason: *[*:0]const u8,
) enum(c_int) { done, exhausted, broken };
