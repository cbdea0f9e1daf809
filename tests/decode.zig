//! Tests of the decoders: one picture in every kind of file, and files that are broken.
//!
//! The picture is that of images/make.py, known in integers. What is not lossless must come near to
//! it, and everything to the same hash on every machine.

const std = @import("std");
const raylane = @import("raylane");
const testing = std.testing;
const decode = raylane.decode;

const width = 29;
const height = 17;

/// Red, green, blue and alpha; gray is red.
fn value(x: usize, y: usize, channel: usize) u8 {
    return @intCast(switch (channel) {
        0 => x * 9,
        1 => y * 15,
        2 => 255 - x * 4 - y * 7,
        else => 255 - x * 5 - y * 3,
    });
}

fn colourOf(x: usize, y: usize, channel_count: usize) [4]u8 {
    const gray = value(x, y, 0);
    const alpha = value(x, y, 3);
    return switch (channel_count) {
        1 => .{ gray, 0, 0, 0 },
        2 => .{ gray, alpha, 0, 0 },
        else => .{ gray, value(x, y, 1), value(x, y, 2), alpha },
    };
}

fn coarse(comptime bits: u8) fn (usize, usize, usize) [4]u8 {
    return struct {
        fn colour(x: usize, y: usize, _: usize) [4]u8 {
            return .{ (value(x, y, 0) >> (8 - bits)) * (255 / ((1 << bits) - 1)), 0, 0, 0 };
        }
    }.colour;
}

fn keyed(x: usize, y: usize, channel_count: usize) [4]u8 {
    var colour = colourOf(x, y, channel_count);
    colour[3] = if (x == 0 and y == 0) 0 else 255;
    return colour;
}

fn paletteEntry(index: usize) [4]u8 {
    const step: u8 = @intCast(index);
    return .{ step * 17, 255 - step * 17, step * 9, if (index < 5) step * 50 else 255 };
}

fn palette(x: usize, y: usize, _: usize) [4]u8 {
    return paletteEntry((x + y * 2) % 14);
}

/// Every other index is past the palette.
fn paletteShort(x: usize, y: usize, _: usize) [4]u8 {
    return if (x % 2 == 1) @splat(0) else paletteEntry((x + y * 2) % 14);
}

const Case = struct {
    name: []const u8,
    channel_count: u8,
    colour: *const fn (usize, usize, usize) [4]u8 = colourOf,
    /// How far a value may be off.
    tolerance: u8 = 0,
    /// XXH64 of the decoded bytes.
    hash: u64,
};

const cases = [_]Case{
    .{ .name = "gray.png", .channel_count = 1, .hash = 0x5411275c17aacf2f },
    .{ .name = "gray-1.png", .channel_count = 1, .colour = coarse(1), .hash = 0x621a9c0b058c87a1 },
    .{ .name = "gray-4.png", .channel_count = 1, .colour = coarse(4), .hash = 0x9cc0c3bbb6abac50 },
    .{ .name = "gray-16.png", .channel_count = 1, .hash = 0x5411275c17aacf2f },
    .{ .name = "gray-alpha.png", .channel_count = 2, .hash = 0xae8b9505d01f4349 },
    .{ .name = "rgb.png", .channel_count = 3, .hash = 0x2fd8946056d73724 },
    .{ .name = "rgb-16.png", .channel_count = 3, .hash = 0x2fd8946056d73724 },
    .{ .name = "rgb-interlaced.png", .channel_count = 3, .hash = 0x2fd8946056d73724 },
    .{ .name = "rgb-key.png", .channel_count = 4, .colour = keyed, .hash = 0xbb588158b2331d76 },
    .{ .name = "rgba.png", .channel_count = 4, .hash = 0x31ad9ef0ab1d105e },
    .{ .name = "palette.png", .channel_count = 3, .colour = palette, .hash = 0xb02fd0adf6d94c29 },
    .{
        .name = "palette-alpha.png",
        .channel_count = 4,
        .colour = palette,
        .hash = 0x64dbd75b49826bec,
    },
    .{
        .name = "palette-short.png",
        .channel_count = 3,
        .colour = paletteShort,
        .hash = 0x0fe44cdbc2278a11,
    },
    .{ .name = "gray.jpg", .channel_count = 1, .tolerance = 5, .hash = 0xfc240fb86da3026e },
    .{ .name = "rgb.jpg", .channel_count = 3, .tolerance = 12, .hash = 0xf83c7d110405b750 },
    .{ .name = "rgb-444.jpg", .channel_count = 3, .tolerance = 10, .hash = 0x2179568d67e442e4 },
    .{
        .name = "rgb-progressive.jpg",
        .channel_count = 3,
        .tolerance = 10,
        .hash = 0x5f935426124a561c,
    },
    .{ .name = "rgb-restart.jpg", .channel_count = 3, .tolerance = 12, .hash = 0xf83c7d110405b750 },
    .{ .name = "rgb-lossless.webp", .channel_count = 3, .hash = 0x2fd8946056d73724 },
    .{ .name = "rgba-lossless.webp", .channel_count = 4, .hash = 0x31ad9ef0ab1d105e },
    .{ .name = "rgb.webp", .channel_count = 3, .tolerance = 12, .hash = 0xb6b775057d00f942 },
    .{ .name = "rgba.webp", .channel_count = 4, .tolerance = 12, .hash = 0xf1b4da5b3a717064 },
    .{ .name = "etc1s-rgb.ktx2", .channel_count = 3, .tolerance = 60, .hash = 0x8becb1709dd20155 },
    .{ .name = "etc1s-rgba.ktx2", .channel_count = 4, .tolerance = 60, .hash = 0xdce9258b242c8117 },
    .{ .name = "uastc-rgb.ktx2", .channel_count = 3, .tolerance = 16, .hash = 0x9da1f0f5e633f562 },
    .{ .name = "uastc-rgba.ktx2", .channel_count = 4, .tolerance = 16, .hash = 0x6c7edda434a49513 },
    .{ .name = "uastc-mips.ktx2", .channel_count = 3, .tolerance = 16, .hash = 0x9da1f0f5e633f562 },
};

/// A file of tests/images; the caller frees it.
fn imageFile(name: []const u8) ![]u8 {
    var folder = try std.Io.Dir.cwd().openDir(testing.io, "tests/images", .{});
    defer folder.close(testing.io);
    return folder.readFileAlloc(testing.io, name, testing.allocator, .unlimited);
}

fn expectCase(case: Case) !void {
    const file = try imageFile(case.name);
    defer testing.allocator.free(file);
    var reason: decode.Reason = .{};
    errdefer std.debug.print("{s}: {s}\n", .{ case.name, reason.text() });
    const info = try decode.info(file, &reason);
    var texels = try decode.decode(testing.allocator, file, &reason);
    defer texels.deinit(testing.allocator);
    const size = [3]u32{ width, height, case.channel_count };
    try testing.expectEqual(size, [3]u32{ texels.width, texels.height, texels.channel_count });
    try testing.expectEqual(size, [3]u32{ info.width, info.height, info.channel_count });
    try testing.expect(!info.is_float);
    const bytes = texels.data.bytes;
    for (0..height) |y| for (0..width) |x| {
        const colour = case.colour(x, y, case.channel_count);
        const at = (y * width + x) * case.channel_count;
        for (colour[0..case.channel_count], bytes[at..][0..case.channel_count]) |wanted, found| {
            errdefer std.debug.print("({d}, {d}): {d}, not {d}\n", .{ x, y, found, wanted });
            try testing.expect(@abs(@as(i32, wanted) - found) <= case.tolerance);
        }
    };
    const hash = std.hash.XxHash64.hash(0, bytes);
    errdefer std.debug.print("0x{x:0>16}\n", .{hash});
    try testing.expectEqual(case.hash, hash);
}

test "every kind of file has the same colours on every machine" {
    var failed: usize = 0;
    for (cases) |case| expectCase(case) catch {
        failed += 1;
    };
    try testing.expectEqual(0, failed);
}

test "Radiance HDR comes as floats, exactly" {
    for ([_]struct { []const u8, usize }{
        .{ "rle.hdr", width }, .{ "flat.hdr", width }, .{ "narrow.hdr", 5 },
    }) |case| {
        const file = try imageFile(case[0]);
        defer testing.allocator.free(file);
        var reason: decode.Reason = .{};
        errdefer std.debug.print("{s}: {s}\n", .{ case[0], reason.text() });
        const info = try decode.info(file, &reason);
        var texels = try decode.decode(testing.allocator, file, &reason);
        defer texels.deinit(testing.allocator);
        try testing.expectEqual(decode.Info{
            .format = .hdr,
            .width = @intCast(case[1]),
            .height = height,
            .channel_count = 3,
            .is_float = true,
        }, info);
        for (texels.data.floats, 0..) |found, index| {
            const x = index / 3 % case[1];
            const y = index / 3 / case[1];
            const mantissa: f32 = @floatFromInt(value(x, y, index % 3));
            // An exponent byte of 120 + y, eight bits of mantissa.
            const exponent: i32 = @intCast(y);
            try testing.expectEqual(std.math.ldexp(mantissa, exponent + 120 - 136), found);
        }
    }
}

test "OpenEXR comes as floats, exactly" {
    for ([_]struct { []const u8, u8 }{
        .{ "rgb.exr", 3 },     .{ "rgba.exr", 4 }, .{ "rgba-piz.exr", 4 },
        .{ "rgb-piz.exr", 3 }, .{ "gray.exr", 1 }, .{ "gray-alpha.exr", 2 },
    }) |case| {
        const file = try imageFile(case[0]);
        defer testing.allocator.free(file);
        var reason: decode.Reason = .{};
        errdefer std.debug.print("{s}: {s}\n", .{ case[0], reason.text() });
        const info = try decode.info(file, &reason);
        var texels = try decode.decode(testing.allocator, file, &reason);
        defer texels.deinit(testing.allocator);
        try testing.expectEqual(decode.Info{
            .format = .exr,
            .width = width,
            .height = height,
            .channel_count = case[1],
            .is_float = true,
        }, info);
        for (texels.data.floats, 0..) |found, index| {
            const x = index / case[1] % width;
            const y = index / case[1] / width;
            const expected: f32 = @floatFromInt(colourOf(x, y, case[1])[index % case[1]]);
            try testing.expectEqual(expected, found);
        }
    }
}

test "what is no radiance in OpenEXR becomes one" {
    const file = try imageFile("wild.exr");
    defer testing.allocator.free(file);
    var reason: decode.Reason = .{};
    var texels = try decode.decode(testing.allocator, file, &reason);
    defer texels.deinit(testing.allocator);
    for (texels.data.floats, 0..) |found, index| {
        const expected = [_]f32{ 0, 65_504, 0, 1 };
        try testing.expectEqual(expected[index % width % 4], found);
    }
}

const names = blk: {
    var list: []const []const u8 = &.{
        "rle.hdr",     "flat.hdr", "narrow.hdr",     "rgb.exr",  "rgba.exr", "rgba-piz.exr",
        "rgb-piz.exr", "gray.exr", "gray-alpha.exr", "wild.exr",
    };
    for (cases) |case| list = list ++ .{case.name};
    break :blk list;
};

test "a file that is cut anywhere is broken, and says why" {
    for (names) |name| {
        const whole = try imageFile(name);
        defer testing.allocator.free(whole);
        errdefer std.debug.print("{s}\n", .{name});
        for (0..whole.len) |length| {
            // Memory of its own, so that what is read behind the end is found.
            const file = try testing.allocator.dupe(u8, whole[0..length]);
            defer testing.allocator.free(file);
            errdefer std.debug.print("{d} bytes of {d}\n", .{ length, whole.len });
            try expectBroken(file);
        }
    }
}

fn expectBroken(file: []const u8) !void {
    var reason: decode.Reason = .{};
    var texels = decode.decode(testing.allocator, file, &reason) catch |err| {
        try testing.expectEqual(error.InvalidImage, err);
        try testing.expect(reason.text().len > 0);
        for (reason.text()) |byte| try testing.expect(std.ascii.isPrint(byte));
        return;
    };
    texels.deinit(testing.allocator);
    return error.Decoded;
}

/// What becomes of a file: the hash of its texels, or null where it is broken.
fn outcome(file: []const u8) !?u64 {
    var reason: decode.Reason = .{};
    var texels = decode.decode(testing.allocator, file, &reason) catch |err| {
        try testing.expectEqual(error.InvalidImage, err);
        try testing.expect(reason.text().len > 0);
        for (reason.text()) |byte| try testing.expect(std.ascii.isPrint(byte));
        return null;
    };
    defer texels.deinit(testing.allocator);
    switch (texels.data) {
        .bytes => |bytes| return std.hash.XxHash64.hash(0, bytes),
        .floats => |floats| {
            for (floats) |float| try testing.expect(std.math.isFinite(float) and float >= 0);
            return std.hash.XxHash64.hash(0, std.mem.sliceAsBytes(floats));
        },
    }
}

test "bytes that are changed break a file or not, but in every run alike" {
    var random_state: std.Random.DefaultPrng = .init(20);
    const random = random_state.random();
    for (names) |name| {
        const whole = try imageFile(name);
        defer testing.allocator.free(whole);
        const file = try testing.allocator.dupe(u8, whole);
        defer testing.allocator.free(file);
        errdefer std.debug.print("{s}\n", .{name});
        for (0..300) |_| {
            @memcpy(file, whole);
            for (0..random.intRangeAtMost(usize, 1, 4)) |_| {
                file[random.uintLessThan(usize, file.len)] = random.int(u8);
            }
            repairSums(file);
            const first = try outcome(file);
            dirtyStack();
            try testing.expectEqual(first, try outcome(file));
        }
    }
}

/// Makes the checksums of a PNG's chunks right, so that its decoder sees what was changed.
fn repairSums(file: []u8) void {
    if (!std.mem.startsWith(u8, file, "\x89PNG")) return;
    var rest = file[8..];
    while (rest.len >= 12) {
        const length = std.mem.readInt(u32, rest[0..4], .big);
        if (length > rest.len - 12) return;
        const sum = std.hash.Crc32.hash(rest[4..][0 .. length + 4]);
        std.mem.writeInt(u32, rest[length + 8 ..][0..4], sum, .big);
        rest = rest[length + 12 ..];
    }
}

/// Leaves other values where the next call's variables will be.
noinline fn dirtyStack() void {
    var bytes: [64 << 10]u8 = undefined;
    @memset(&bytes, 0xa5);
    std.mem.doNotOptimizeAway(&bytes);
}

test "random bytes behind a signature are no image" {
    var random_state: std.Random.DefaultPrng = .init(21);
    const random = random_state.random();
    var file: [600]u8 = undefined;
    for ([_][]const u8{
        "\x89PNG\r\n\x1a\n",            "\xff\xd8\xff",
        "RIFF\xf0\x00\x00\x00WEBPVP8L", "#?RADIANCE\n",
        "#?RGBE\n",                     "",
    }) |signature| for (0..500) |_| {
        const length = random.intRangeAtMost(usize, signature.len, file.len);
        random.bytes(file[0..length]);
        @memcpy(file[0..signature.len], signature);
        try expectBroken(file[0..length]);
    };
}

fn expectReason(file: []const u8, expected: []const u8) !void {
    var reason: decode.Reason = .{};
    const result = decode.decode(testing.allocator, file, &reason);
    if (result) |decoded| {
        var texels = decoded;
        texels.deinit(testing.allocator);
        return error.Decoded;
    } else |err| try testing.expectEqual(error.InvalidImage, err);
    try testing.expectEqualStrings(expected, reason.text());
}

test "what the decoders do not look at is looked at" {
    const png = try imageFile("rgb.png");
    defer testing.allocator.free(png);
    // Within IDAT, and behind it within the checksum of deflate's container.
    png[60] +%= 1;
    try expectReason(png, "wrong checksum");
    repairSums(png);
    try expectReason(png, "bad compressed data");
    png[60] -%= 1;
    png[png.len - 17] +%= 1;
    repairSums(png);
    try expectReason(png, "bad compressed data");

    const jpeg = try imageFile("rgb-progressive.jpg");
    defer testing.allocator.free(jpeg);
    const scan = std.mem.findLast(u8, jpeg, "\xff\xda").?;
    var many: std.ArrayList(u8) = .empty;
    defer many.deinit(testing.allocator);
    try many.appendSlice(testing.allocator, jpeg[0..scan]);
    for (0..200) |_| try many.appendSlice(testing.allocator, jpeg[scan .. jpeg.len - 2]);
    try many.appendSlice(testing.allocator, "\xff\xd9");
    try expectReason(many.items, "more than 200 scans");
    try expectReason(jpeg[0..scan], "cut short");
}

/// A KTX 2 file of 2x1 pixels without anything but its one level.
fn ktx2(buffer: *[128]u8, vk_format: u32, layers: u32, compression: u32, level: []const u8) []u8 {
    const start = 80 + 24;
    @memset(buffer, 0);
    @memcpy(buffer[0..12], "\xabKTX 20\xbb\r\n\x1a\n");
    for ([_]u32{ vk_format, 1, 2, 1, 0, layers, 1, 1, compression }, 3..) |word, index| {
        std.mem.writeInt(u32, buffer[index * 4 ..][0..4], word, .little);
    }
    for ([_]u64{ start, level.len, level.len }, 0..) |long, index| {
        std.mem.writeInt(u64, buffer[80 + index * 8 ..][0..8], long, .little);
    }
    @memcpy(buffer[start..][0..level.len], level);
    return buffer[0 .. start + level.len];
}

test "KTX 2 of plain bytes comes in the order of RGBA, and what is not supported has a reason" {
    var buffer: [128]u8 = undefined;
    for ([_]struct { u32, []const u8, []const u8 }{
        .{ 9, "\x01\x02", "\x01\x02" },
        .{ 22, "\x01\x02\x03\x04", "\x01\x02\x03\x04" },
        .{ 30, "\x01\x02\x03\x04\x05\x06", "\x03\x02\x01\x06\x05\x04" },
        .{ 44, "\x01\x02\x03\x04\x05\x06\x07\x08", "\x03\x02\x01\x04\x07\x06\x05\x08" },
    }) |case| {
        const file = ktx2(&buffer, case[0], 0, 0, case[1]);
        var reason: decode.Reason = .{};
        errdefer std.debug.print("{s}\n", .{reason.text()});
        var texels = try decode.decode(testing.allocator, file, &reason);
        defer texels.deinit(testing.allocator);
        try testing.expectEqual(case[1].len / 2, texels.channel_count);
        try testing.expectEqualSlices(u8, case[2], texels.data.bytes);
    }
    const none = "\x01\x02";
    try expectReason(ktx2(&buffer, 145, 0, 0, none), "Vulkan format 145 is not supported");
    try expectReason(ktx2(&buffer, 9, 2, 0, none), "arrays, cubes and volumes are not supported");
    try expectReason(ktx2(&buffer, 9, 0, 3, none), "supercompression 3 is not supported");
    try expectReason(ktx2(&buffer, 9, 0, 0, "\x01"), "its first level has the wrong size");
    try expectReason(ktx2(&buffer, 9, 0, 2, none), "bad compressed data");
}

test "sizes that cannot be true are refused before memory is asked for" {
    var buffer: [200]u8 = undefined;
    const png = "\x89PNG\r\n\x1a\n\x00\x00\x00\x0dIHDR\x00\x00\x75\x30\x00\x00\x75\x30" ++
        "\x08\x00\x00\x00\x00\xff\xff\xff\xff\x00\x00\x00\x00IDAT\x35\xaf\x06\x1e";
    const jpeg = "\xff\xd8\xff\xc0\x00\x0b\x08\x3e\x80\x3e\x80\x01\x01\x11\x00";
    const hdr = "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 3000 +X 3000\n";
    const wide = "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 99999\n";
    const negative = "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y -1 +X -9\n";
    for ([_]struct { []const u8, []const u8 }{
        .{ png, "30000x30000 pixels, more than 134217728" },
        .{ jpeg, "16000x16000 pixels, more than 134217728" },
        .{ hdr, "3000x3000 pixels are more than its bytes can hold" },
        .{ wide, "99999x1 pixels, more than 32768 on a side" },
        .{ negative, "it has no pixels" },
    }) |case| {
        const file = try std.mem.print(&buffer, "{s}", .{case[0]});
        var reason: decode.Reason = .{};
        try testing.expectError(error.InvalidImage, decode.info(file, &reason));
        try testing.expectEqualStrings(case[1], reason.text());
        const result = decode.decode(testing.failing_allocator, file, &reason);
        try testing.expectError(error.InvalidImage, result);
    }
}

const Decoding = struct {
    files: [names.len][]u8,
    hashes: [names.len]?u64,
    failure: std.atomic.Value(bool) = .init(false),

    fn all(decoding: *Decoding, first: usize) void {
        for (0..4 * names.len) |step| {
            const index = (first + step) % names.len;
            const hash = outcome(decoding.files[index]) catch null;
            if (hash != decoding.hashes[index]) decoding.failure.store(true, .monotonic);
        }
    }
};

test "threads decode at once, on the stacks that they have" {
    var decoding: Decoding = .{ .files = undefined, .hashes = undefined };
    var count: usize = 0;
    defer for (decoding.files[0..count]) |file| testing.allocator.free(file);
    for (names, 0..) |name, index| {
        decoding.files[index] = try imageFile(name);
        count += 1;
        decoding.hashes[index] = try outcome(decoding.files[index]);
        try testing.expect(decoding.hashes[index] != null);
    }
    var threads: [4]std.Thread = undefined;
    for (&threads, 0..) |*thread, index| thread.* = try std.Thread.spawn(
        .{ .stack_size = raylane.parallel.stack_bytes },
        Decoding.all,
        .{ &decoding, index * 7 },
    );
    for (threads) |thread| thread.join();
    try testing.expect(!decoding.failure.load(.monotonic));
}

test "memory that runs out is an error, whenever it does" {
    for (names) |name| {
        const file = try imageFile(name);
        defer testing.allocator.free(file);
        for (0..100) |fail_index| {
            var failing: testing.FailingAllocator = .init(testing.allocator, .{
                .fail_index = fail_index,
            });
            var reason: decode.Reason = .{};
            var texels = decode.decode(failing.allocator(), file, &reason) catch |err| {
                try testing.expectEqual(error.OutOfMemory, err);
                continue;
            };
            texels.deinit(failing.allocator());
            try testing.expect(fail_index > 0);
            break;
        } else return error.NeverEnoughMemory;
    }
}
