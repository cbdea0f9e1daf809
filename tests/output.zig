//! Tests of the output stage through a decoder that is not its own: what stb_image reads is what
//! was meant.

const std = @import("std");
const raylane = @import("raylane");
const stb_image = @import("stb_image");
const testing = std.testing;
const Image = raylane.image.Image;
const srgb = raylane.math.srgb;

/// A decoded picture; freed by `deinit`.
const Decoded = struct {
    width: usize,
    height: usize,
    channel_count: usize,
    pixels: []u8,

    fn init(file: []const u8) !Decoded {
        var width: c_int = 0;
        var height: c_int = 0;
        var channels: c_int = 0;
        const pixels = stb_image.stbi_load_from_memory(
            file.ptr,
            @intCast(file.len),
            &width,
            &height,
            &channels,
            0,
        );
        if (pixels == null) return error.NotDecoded;
        var decoded: Decoded = .{
            .width = @intCast(width),
            .height = @intCast(height),
            .channel_count = @intCast(channels),
            .pixels = undefined,
        };
        decoded.pixels = pixels[0 .. decoded.width * decoded.height * decoded.channel_count];
        return decoded;
    }

    fn deinit(decoded: *Decoded) void {
        stb_image.stbi_image_free(decoded.pixels.ptr);
        decoded.* = undefined;
    }
};

const Settings = struct {
    format: raylane.settings.Format = .png,
    exposure: raylane.settings.Exposure = .{ .ev = 0 },
    transparent: bool = false,
    thread_count: usize = 1,
};

/// Writes the image as a PNG and decodes it.
fn roundTrip(image: *const Image, settings: Settings) !Decoded {
    const file = try written(image, settings);
    defer testing.allocator.free(file);
    return .init(file);
}

/// The file that the image becomes; the caller frees it.
fn written(image: *const Image, settings: Settings) ![]u8 {
    const gpa = testing.allocator;
    const io = testing.io;
    var folder = testing.tmpDir(.{});
    defer folder.cleanup();
    var path_buffer: [std.fs.max_path_bytes]u8 = undefined;
    const folder_path = path_buffer[0..try folder.dir.realPath(io, &path_buffer)];
    const path = try std.fs.path.join(gpa, &.{ folder_path, "a.png" });
    defer gpa.free(path);

    var diagnostic: raylane.diagnostic.Diagnostic = .{};
    var temporaries: raylane.output.TemporaryFiles = .{};
    var target: raylane.output.Target = try .openFile(io, &temporaries, path, &diagnostic);
    var pool: raylane.parallel.Pool = .init(settings.thread_count);
    defer pool.deinit();
    try raylane.output.write(gpa, image, .{
        .format = settings.format,
        .exposure = settings.exposure,
        .transparent = settings.transparent,
        .pool = &pool,
    }, &target, &diagnostic);
    return folder.dir.readFileAlloc(io, "a.png", gpa, .unlimited);
}

/// A picture with noise, flat parts and gradients, the latter two of which compress.
fn testImage(gpa: std.mem.Allocator, width: u32, height: u32) !Image {
    const image: Image = try .init(gpa, width, height);
    var random = std.Random.DefaultPrng.init(width * 31 + height);
    for (image.pixels, 0..) |*pixel, index| {
        const x: f32 = @floatFromInt(index % width);
        const alpha = random.random().float(f32);
        pixel.* = switch (index / 64 % 3) {
            0 => .{ random.random().float(f32) * alpha, 0, random.random().float(f32), alpha },
            1 => .{ 0.25, 0.5, 0.125, 1 },
            else => .{ x / @as(f32, @floatFromInt(width)), 0, 0, 0.5 },
        };
    }
    return image;
}

test "an opaque PNG holds the encoded colours" {
    const sizes = [_][2]u32{
        .{ 1, 1 }, .{ 1, 300 }, .{ 300, 1 }, .{ 65, 33 }, .{ 257, 191 }, .{ 30_000, 3 },
    };
    for (sizes) |size| {
        var image = try testImage(testing.allocator, size[0], size[1]);
        defer image.deinit(testing.allocator);
        var decoded = try roundTrip(&image, .{ .exposure = .{ .ev = 1 } });
        defer decoded.deinit();
        try testing.expectEqual(size[0], decoded.width);
        try testing.expectEqual(size[1], decoded.height);
        try testing.expectEqual(3, decoded.channel_count);
        for (image.pixels, 0..) |pixel, index| {
            for (0..3) |channel| {
                const expected = srgb.encode(pixel[channel] * 2);
                try testing.expectEqual(expected, decoded.pixels[index * 3 + channel]);
            }
        }
    }
}

test "the bytes do not depend on the number of threads" {
    var image = try testImage(testing.allocator, 500, 400);
    defer image.deinit(testing.allocator);
    for (std.enums.values(raylane.settings.Format)) |format| {
        const alone = try written(&image, .{ .format = format });
        defer testing.allocator.free(alone);
        for ([_]usize{ 2, 7, 256 }) |thread_count| {
            const file = try written(&image, .{ .format = format, .thread_count = thread_count });
            defer testing.allocator.free(file);
            try testing.expectEqualSlices(u8, alone, file);
        }
    }
}

test "a transparent PNG holds alpha and colours that are not premultiplied" {
    var image = try testImage(testing.allocator, 70, 40);
    defer image.deinit(testing.allocator);
    image.pixels[0] = .{ 0, 0, 0, 0 };
    var decoded = try roundTrip(&image, .{ .transparent = true });
    defer decoded.deinit();
    try testing.expectEqual(4, decoded.channel_count);
    for (image.pixels, 0..) |pixel, index| {
        const bytes = decoded.pixels[index * 4 ..][0..4];
        const alpha: f32 = @as(f32, @floatFromInt(bytes[3])) / 255;
        try testing.expectApproxEqAbs(pixel[3], alpha, 0.5001 / 255.0);
        for (0..3) |channel| {
            const expected: u8 = if (bytes[3] == 0) 0 else srgb.encode(pixel[channel] / pixel[3]);
            try testing.expectEqual(expected, bytes[channel]);
        }
    }
}

test "what does not compress is stored, and decoded all the same" {
    var image: Image = try .init(testing.allocator, 200, 200);
    defer image.deinit(testing.allocator);
    var random = std.Random.DefaultPrng.init(9);
    for (image.pixels) |*pixel| {
        for (pixel[0..3]) |*value| value.* = srgb.decoded[random.random().int(u8)];
        pixel[3] = 1;
    }
    var decoded = try roundTrip(&image, .{});
    defer decoded.deinit();
    for (image.pixels, 0..) |pixel, index| {
        for (0..3) |channel| {
            const expected = srgb.encode(pixel[channel]);
            try testing.expectEqual(expected, decoded.pixels[index * 3 + channel]);
        }
    }
}

test "the automatic exposure makes 95 % of the pixels no brighter than 0.8" {
    var image: Image = try .init(testing.allocator, 100, 1);
    defer image.deinit(testing.allocator);
    for (image.pixels, 0..) |*pixel, index| {
        const gray: f32 = @floatFromInt(index + 1);
        pixel.* = .{ gray, gray, gray, 1 };
    }
    var decoded = try roundTrip(&image, .{ .exposure = .auto });
    defer decoded.deinit();
    // The 95th of a hundred pixels lies at 0.8 itself.
    try testing.expectEqual(srgb.encode(0.8), decoded.pixels[94 * 3]);
    try testing.expect(decoded.pixels[95 * 3] > srgb.encode(0.8));
}
