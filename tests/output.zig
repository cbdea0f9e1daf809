//! Tests of the output stage through a decoder that is not its own: what stb_image reads is what
//! was meant.

const std = @import("std");
const raylane = @import("raylane");
const stb_image = @import("stb_image.zig");
const testing = std.testing;
const Image = raylane.image.Image;
const srgb = raylane.math.srgb;

/// A decoded picture of bytes or floats; freed by `deinit`.
fn Decoded(comptime Channel: type) type {
    return struct {
        width: usize,
        height: usize,
        channel_count: usize,
        pixels: []Channel,

        fn init(file: []const u8) !@This() {
            var width: c_int = 0;
            var height: c_int = 0;
            var channels: c_int = 0;
            const load = switch (Channel) {
                u8 => stb_image.stbi_load_from_memory,
                f32 => stb_image.stbi_loadf_from_memory,
                else => comptime unreachable,
            };
            const length: c_int = @intCast(file.len);
            const pixels = load(file.ptr, length, &width, &height, &channels, 0) orelse
                return error.NotDecoded;
            const count: usize = @intCast(width * height * channels);
            return .{
                .width = @intCast(width),
                .height = @intCast(height),
                .channel_count = @intCast(channels),
                .pixels = pixels[0..count],
            };
        }

        fn deinit(decoded: *@This()) void {
            stb_image.stbi_image_free(decoded.pixels.ptr);
            decoded.* = undefined;
        }
    };
}

const Settings = struct {
    format: raylane.settings.Format = .png,
    exposure_ev: f32 = 0,
    tone_mapping: raylane.settings.ToneMapping = .linear,
    transparent: bool = false,
    background: raylane.output.Background = .none,
    jpeg_quality: u8 = raylane.settings.jpeg_quality.default,
    webp_quality: ?u8 = null,
    exr_kind: raylane.settings.ExrKind = .half,
    thread_count: usize = 1,
};

/// Writes the image and decodes it.
fn roundTrip(image: *const Image, settings: Settings) !Decoded(u8) {
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
    _ = try raylane.output.write(gpa, .{ .image = image }, .{
        .format = settings.format,
        .exposure_ev = settings.exposure_ev,
        .tone_mapping = settings.tone_mapping,
        .transparent = settings.transparent,
        .background = settings.background,
        .jpeg_quality = settings.jpeg_quality,
        .webp_quality = settings.webp_quality,
        .exr_kind = settings.exr_kind,
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

const odd_sizes = [_][2]u32{
    .{ 1, 1 }, .{ 1, 300 }, .{ 300, 1 }, .{ 65, 33 }, .{ 257, 191 }, .{ 30_000, 3 },
};

test "PNG, TGA and BMP hold the encoded colours" {
    for (odd_sizes) |size| for ([_]raylane.settings.Format{ .png, .tga, .bmp }) |format| {
        errdefer std.debug.print("{t} {d}x{d}\n", .{ format, size[0], size[1] });
        var image = try testImage(testing.allocator, size[0], size[1]);
        defer image.deinit(testing.allocator);
        var decoded = try roundTrip(&image, .{
            .format = format,
            .exposure_ev = 1,
            // Alpha is left out where the format has none.
            .transparent = format == .bmp,
        });
        defer decoded.deinit();
        try testing.expectEqual(size[0], decoded.width);
        try testing.expectEqual(size[1], decoded.height);
        try testing.expectEqual(3, decoded.channel_count);
        for (image.pixels, 0..) |pixel, index| {
            for (0..3) |channel| {
                // Mapped where it is, then mixed with black.
                const whole = pixel[channel] / pixel[3] * 2;
                const expected = srgb.encode(@min(whole, 1) * pixel[3]);
                try testing.expectEqual(expected, decoded.pixels[index * 3 + channel]);
            }
        }
    };
}

test "JPEG comes near to the colours, nearer with more quality" {
    for (odd_sizes) |size| {
        var image: Image = try .init(testing.allocator, size[0], size[1]);
        defer image.deinit(testing.allocator);
        // Gradients, which a JPEG can hold.
        for (image.pixels, 0..) |*pixel, index| {
            const x: f32 = @floatFromInt(index % size[0]);
            const y: f32 = @floatFromInt(index / size[0]);
            pixel.* = .{ x / 1000, y / 1000, (x + y) / 2000, 1 };
            for (pixel[0..3]) |*value| value.* -= @floor(value.*);
        }
        var errors: [3]f64 = @splat(0);
        for (&errors, [_]u8{ 1, 90, 100 }) |*sum, quality| {
            var decoded = try roundTrip(&image, .{
                .format = .jpg,
                .jpeg_quality = quality,
                .transparent = true,
            });
            defer decoded.deinit();
            try testing.expectEqual([3]usize{ size[0], size[1], 3 }, [3]usize{
                decoded.width, decoded.height, decoded.channel_count,
            });
            for (image.pixels, 0..) |pixel, index| for (0..3) |channel| {
                const expected: f64 = @floatFromInt(srgb.encode(pixel[channel]));
                const found: f64 = @floatFromInt(decoded.pixels[index * 3 + channel]);
                sum.* += @abs(expected - found);
            };
            sum.* /= @floatFromInt(image.pixels.len * 3);
        }
        errdefer std.debug.print("{d}x{d}: {any}\n", .{ size[0], size[1], errors });
        try testing.expect(errors[1] < 4 and errors[2] < 1.5);
        try testing.expect(errors[2] <= errors[1] and errors[1] <= errors[0]);
    }
}

test "HDR holds radiance to its eight bits, whatever the exposure" {
    const sizes = odd_sizes ++ .{ .{ 7, 5 }, .{ 8, 5 } };
    for (sizes) |size| {
        var image = try testImage(testing.allocator, size[0], size[1]);
        defer image.deinit(testing.allocator);
        // What no exponent holds, or what is none.
        image.pixels[0] = .{ std.math.floatMax(f32), 1, -1, 1 };
        image.pixels[image.pixels.len - 1] = .{ -2, 0, std.math.floatMin(f32), 0 };
        const file = try written(&image, .{
            .format = .hdr,
            .exposure_ev = 2,
            .transparent = true,
        });
        defer testing.allocator.free(file);
        var decoded: Decoded(f32) = try .init(file);
        defer decoded.deinit();
        try testing.expectEqual([3]usize{ size[0], size[1], 3 }, [3]usize{
            decoded.width, decoded.height, decoded.channel_count,
        });
        for (image.pixels, 0..) |pixel, index| {
            const largest = @min(@max(pixel[0], pixel[1], pixel[2]), 0x1.fep127);
            for (pixel[0..3], decoded.pixels[index * 3 ..][0..3]) |wanted, found| {
                try testing.expect(found >= 0 and found <= @max(wanted, 0));
                // One of 256 steps up to the power of two above the largest.
                const held = @min(@max(wanted, 0), 0x1.fep126);
                try testing.expect(found >= held - largest / 128 - 1e-32);
            }
        }
    }
}

test "PFM holds every bit, rows from the bottom" {
    var image = try testImage(testing.allocator, 2, 3);
    defer image.deinit(testing.allocator);
    image.pixels[0] = .{ std.math.floatTrueMin(f32), -1, 1e30, 0.25 };
    const file = try written(&image, .{ .format = .pfm, .exposure_ev = 3 });
    defer testing.allocator.free(file);
    const header = "PF\n2 3\n-1.0\n";
    try testing.expectStringStartsWith(file, header);
    try testing.expectEqual(header.len + 2 * 3 * 3 * 4, file.len);
    for ([_]usize{ 4, 5, 2, 3, 0, 1 }, 0..) |pixel, place| for (0..3) |channel| {
        const at = header.len + (place * 3 + channel) * 4;
        const bits: u32 = @bitCast(image.pixels[pixel][channel]);
        try testing.expectEqual(bits, std.mem.readInt(u32, file[at..][0..4], .little));
    };
}

test "OpenEXR holds radiance to its eleven bits, with alpha where there is no background" {
    for (odd_sizes) |size| for ([_]bool{ false, true }) |transparent| {
        errdefer std.debug.print("{d}x{d}\n", .{ size[0], size[1] });
        var image = try testImage(testing.allocator, size[0], size[1]);
        defer image.deinit(testing.allocator);
        image.pixels[0] = .{ 1e30, 0.5, 65_504, 1 };
        const file = try written(&image, .{
            .format = .exr,
            .exposure_ev = 3,
            .transparent = transparent,
            .background = if (transparent) .none else .{ .srgb = .{ 255, 0, 0 } },
        });
        defer testing.allocator.free(file);
        var reason: raylane.decode.Reason = .{};
        var texels = try raylane.decode.decode(testing.allocator, file, &reason);
        defer texels.deinit(testing.allocator);
        const channel_count: usize = if (transparent) 4 else 3;
        try testing.expectEqual([3]usize{ size[0], size[1], channel_count }, [3]usize{
            texels.width, texels.height, texels.channel_count,
        });
        for (image.pixels, 0..) |pixel, index| {
            const found = texels.data.floats[index * channel_count ..][0..channel_count];
            for (found, 0..) |value, channel| {
                const behind: f32 = if (!transparent and channel == 0) 1 - pixel[3] else 0;
                const wanted = @min(pixel[channel] + behind, 65_504);
                try testing.expectApproxEqAbs(wanted, value, wanted / 2048 + 1e-7);
            }
        }
    };
}

test "OpenEXR of floats holds every bit" {
    var image = try testImage(testing.allocator, 5, 40);
    defer image.deinit(testing.allocator);
    image.pixels[0] = .{ 1e30, 0, std.math.floatMin(f32), 0.5 };
    const file =
        try written(&image, .{ .format = .exr, .exr_kind = .float, .transparent = true });
    defer testing.allocator.free(file);
    var reason: raylane.decode.Reason = .{};
    var texels = try raylane.decode.decode(testing.allocator, file, &reason);
    defer texels.deinit(testing.allocator);
    const floats = std.mem.bytesAsSlice(f32, std.mem.sliceAsBytes(image.pixels));
    for (texels.data.floats, floats) |found, wanted| try testing.expectEqual(wanted, found);
}

test "WebP holds the encoded colours, or comes near to them, and alpha in any case" {
    for (odd_sizes[0..4]) |size| for ([_]?u8{ null, 90 }) |quality| {
        errdefer std.debug.print("{d}x{d}\n", .{ size[0], size[1] });
        var image: Image = try .init(testing.allocator, size[0], size[1]);
        defer image.deinit(testing.allocator);
        for (image.pixels, 0..) |*pixel, index| {
            const x: f32 = @floatFromInt(index % size[0]);
            const alpha: f32 = if (index / 40 % 2 == 0) 1 else 0.5;
            pixel.* = .{ x / 1000 * alpha, 0.25 * alpha, 0.5 * alpha, alpha };
        }
        const file = try written(&image, .{
            .format = .webp,
            .webp_quality = quality,
            .transparent = true,
        });
        defer testing.allocator.free(file);
        var reason: raylane.decode.Reason = .{};
        var texels = try raylane.decode.decode(testing.allocator, file, &reason);
        defer texels.deinit(testing.allocator);
        const has_alpha = image.pixels.len > 40;
        const channel_count: usize = if (has_alpha) 4 else 3;
        try testing.expectEqual(channel_count, texels.channel_count);
        var sum: f64 = 0;
        for (image.pixels, 0..) |pixel, index| {
            const codes = texels.data.bytes[index * channel_count ..][0..channel_count];
            const code_of_alpha: u8 = if (pixel[3] == 1) 255 else 128;
            if (has_alpha) try testing.expectEqual(code_of_alpha, codes[3]);
            for (codes[0..3], pixel[0..3]) |code, value| {
                const expected = srgb.encode(value / pixel[3]);
                if (quality == null) try testing.expectEqual(expected, code);
                sum += @abs(@as(f64, @floatFromInt(code)) - @as(f64, @floatFromInt(expected)));
            }
        }
        try testing.expect(sum / @as(f64, @floatFromInt(3 * image.pixels.len)) < 6);
    };
}

/// Colours and alpha of integers alone: no random numbers, no rounding.
fn checkers(gpa: std.mem.Allocator) !Image {
    const image: Image = try .init(gpa, 61, 47);
    for (image.pixels, 0..) |*pixel, index| {
        const x = index % 61;
        const y = index / 61;
        const alpha: f32 = if ((x / 8 + y / 8) % 2 == 0) 1 else 0.5;
        for (pixel[0..3], [_]usize{ x * 4 + y, y * 5, x * y }) |*value, code| {
            value.* = srgb.decoded[code % 256] * alpha;
        }
        pixel[3] = alpha;
    }
    return image;
}

test "every format has the same bytes on every machine" {
    var image = try checkers(testing.allocator);
    defer image.deinit(testing.allocator);
    const expected = [_]struct { raylane.settings.Format, u64 }{
        .{ .png, 0xd9aa232445eb57fd },  .{ .jpg, 0xf6f4e06efab8dc20 },
        .{ .tga, 0x27a4b70272305b9a },  .{ .bmp, 0xc0a9f1c2ed9ec202 },
        .{ .hdr, 0x7e1e5a338bf0dcc9 },  .{ .ppm, 0x90c7a2393d5f932d },
        .{ .pfm, 0x1434cae8ac8e82c3 },  .{ .exr, 0x44df47690cac64bf },
        .{ .webp, 0x7fc894f2550bb7fb },
    };
    for (expected) |case| for ([_]usize{ 1, 3 }) |thread_count| {
        const file = try written(&image, .{
            .format = case[0],
            .transparent = true,
            .thread_count = thread_count,
        });
        defer testing.allocator.free(file);
        const hash = std.hash.XxHash64.hash(0, file);
        errdefer std.debug.print("{t}: 0x{x}, {d} bytes\n", .{ case[0], hash, file.len });
        try testing.expectEqual(case[1], hash);
    };
}

test "WebP that loses information has the same bytes on every machine" {
    var image = try checkers(testing.allocator);
    defer image.deinit(testing.allocator);
    const file =
        try written(&image, .{ .format = .webp, .webp_quality = 60, .transparent = true });
    defer testing.allocator.free(file);
    const hash = std.hash.XxHash64.hash(0, file);
    errdefer std.debug.print("0x{x}, {d} bytes\n", .{ hash, file.len });
    try testing.expectEqual(0xa4577ee66282d42c, hash);
}

test "what a format cannot hold is refused" {
    const Case = struct { raylane.settings.Format, u32, u32, ?[]const u8 };
    for ([_]Case{
        .{ .png, 65_536, 4096, null },
        .{ .png, 16_384, 16_384, null },
        .{ .hdr, 16_384, 16_384, null },
        .{ .jpg, 65_535, 1, null },
        .{ .jpg, 65_536, 1, "a jpg file has 65535 pixels on a side at most" },
        .{ .tga, 1, 65_536, "a tga file has 65535 pixels" },
        .{ .bmp, 65_536, 1, null },
        .{ .png, 65_536, 65_536, "65536x65536 pixels are too many for a png file" },
        .{ .bmp, 30_000, 30_000, "too many for a bmp file; .ppm and .pfm hold them" },
        .{ .hdr, 30_000, 30_000, "too many for a hdr file" },
        .{ .pfm, 65_536, 65_536, null },
        .{ .webp, 16_384, 1, "a webp file has 16383 pixels" },
    }) |case| {
        var diagnostic: raylane.diagnostic.Diagnostic = .{};
        const result = raylane.output.check(case[0], false, case[1], case[2], &diagnostic);
        const needle = case[3] orelse {
            try result;
            continue;
        };
        try testing.expectError(error.InputOutput, result);
        const text = diagnostic.message.text();
        errdefer std.debug.print("{s}\n", .{text});
        try testing.expect(std.mem.find(u8, text, needle) != null);
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

test "a transparent PNG or TGA holds alpha and colours that are not premultiplied" {
    var image = try testImage(testing.allocator, 70, 40);
    defer image.deinit(testing.allocator);
    image.pixels[0] = .{ 0, 0, 0, 0 };
    for ([_]raylane.settings.Format{ .png, .tga }) |format| {
        var decoded = try roundTrip(&image, .{ .format = format, .transparent = true });
        defer decoded.deinit();
        try testing.expectEqual(4, decoded.channel_count);
        for (image.pixels, 0..) |pixel, index| {
            const bytes = decoded.pixels[index * 4 ..][0..4];
            const alpha: f32 = @as(f32, @floatFromInt(bytes[3])) / 255;
            try testing.expectApproxEqAbs(pixel[3], alpha, 0.5001 / 255.0);
            for (0..3) |channel| {
                const expected: u8 =
                    if (bytes[3] == 0) 0 else srgb.encode(pixel[channel] / pixel[3]);
                try testing.expectEqual(expected, bytes[channel]);
            }
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

test "every tone mapping has the same bytes on every machine" {
    var image = try checkers(testing.allocator);
    defer image.deinit(testing.allocator);
    // From black to well above white.
    for (image.pixels) |*pixel| {
        for (pixel[0..3]) |*value| value.* *= 8 * value.*;
    }
    const expected = [_]struct { raylane.settings.ToneMapping, u64 }{
        .{ .neutral, 0x2c8351a8f3a0abff }, .{ .aces, 0x35fcff03d22687e7 },
        .{ .agx, 0xc2e1eb3f42ed55e8 },     .{ .linear, 0xf38969dfafae228d },
    };
    for (expected) |case| {
        const file = try written(&image, .{
            .format = .ppm,
            .tone_mapping = case[0],
            .background = .gradient,
        });
        defer testing.allocator.free(file);
        const hash = std.hash.XxHash64.hash(0, file);
        errdefer std.debug.print("{t}: 0x{x}\n", .{ case[0], hash });
        try testing.expectEqual(case[1], hash);
    }
}

test "a background comes out as it was typed, in every format that keeps codes" {
    var image: Image = try .init(testing.allocator, 19, 3);
    defer image.deinit(testing.allocator);
    @memset(image.pixels, .{ 0, 0, 0, 0 });
    for ([_]raylane.settings.Format{ .png, .tga, .bmp }) |format| {
        for ([_][3]u8{ .{ 0, 1, 2 }, .{ 255, 254, 128 }, .{ 11, 12, 13 } }) |codes| {
            var decoded = try roundTrip(&image, .{
                .format = format,
                .exposure_ev = 5,
                .tone_mapping = .agx,
                .background = .{ .srgb = codes },
            });
            defer decoded.deinit();
            for (0..image.pixels.len) |index| {
                try testing.expectEqual(codes, decoded.pixels[index * 3 ..][0..3].*);
            }
        }
    }
}
