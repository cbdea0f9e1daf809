//! Stage 4: `Image` -> file.
//!
//! In: a finished frame. Out: a PNG, PPM or PFM, either the whole file in its place or nothing at
//! all. Encoded by all threads; the bytes depend on the frame and the settings alone.

const std = @import("std");
const choices = @import("settings.zig");
const Allocator = std.mem.Allocator;
const Diagnostic = @import("diagnostic.zig").Diagnostic;
const Image = @import("image.zig").Image;
const parallel = @import("parallel.zig");
const pfm = @import("output/pfm.zig");
const png = @import("output/png.zig");
const ppm = @import("output/ppm.zig");
const target_file = @import("output/target.zig");
const tonemap = @import("output/tonemap.zig");

pub const Target = target_file.Target;
/// What a target fails with.
pub const TargetError = target_file.Error;
/// What targets create until they are in place.
pub const TemporaryFiles = @import("output/temporary.zig").TemporaryFiles;

pub const Settings = struct {
    format: choices.Format = .png,
    exposure: choices.Exposure = .{ .ev = 0 },
    /// Keep alpha, where the format has it; otherwise the picture is over black.
    transparent: bool = false,
    pool: *parallel.Pool,
};

/// The diagnostic says why, unless the pool's work was cancelled.
pub const Error = error{ OutOfMemory, InputOutput } || parallel.Error;

/// Encodes the frame and moves it to its place. Closes the target in any case.
pub fn write(
    gpa: Allocator,
    image: *const Image,
    settings: Settings,
    target: *Target,
    diagnostic: *Diagnostic,
) Error!void {
    defer target.abandon();
    const has_alpha = settings.transparent and settings.format == .png;
    const rows: tonemap.Rows = .{
        .image = image,
        .scale = if (settings.format == .pfm) 1 else switch (settings.exposure) {
            .ev => |ev| tonemap.scaleOf(ev),
            .auto => try tonemap.autoScale(gpa, image),
        },
        .channel_count = if (has_alpha) 4 else 3,
    };
    return switch (settings.format) {
        .png => encode(png.Encoder, gpa, rows, settings, target, diagnostic),
        .ppm => encode(ppm.Encoder, gpa, rows, settings, target, diagnostic),
        .pfm => encode(pfm.Encoder, gpa, rows, settings, target, diagnostic),
    };
}

/// Encodes by all threads, then writes.
fn encode(
    comptime Encoder: type,
    gpa: Allocator,
    rows: tonemap.Rows,
    settings: Settings,
    target: *Target,
    diagnostic: *Diagnostic,
) Error!void {
    var encoder: Encoder = try .init(gpa, rows, settings.pool.thread_count);
    defer encoder.deinit(gpa);
    try settings.pool.forEach(encoder.stretch_count, &encoder, Encoder.encodeStretch);
    return target.finish(encoder.finish(), diagnostic);
}

test {
    _ = @import("output/checksum.zig");
    _ = @import("output/deflate.zig");
    _ = @import("output/filter.zig");
    _ = @import("output/huffman.zig");
    _ = pfm;
    _ = png;
    _ = ppm;
    _ = target_file;
    _ = @import("output/temporary.zig");
    _ = tonemap;
}

const TestSettings = struct {
    format: choices.Format = .png,
    exposure: choices.Exposure = .{ .ev = 0 },
    transparent: bool = false,
};

/// What `write` leaves in a file called `name`; the caller frees it.
fn writeForTest(
    folder: std.Io.Dir,
    name: []const u8,
    image: *const Image,
    settings: TestSettings,
) ![]u8 {
    var pool: parallel.Pool = .init(1);
    defer pool.deinit();
    const gpa = std.testing.allocator;
    const io = std.testing.io;
    var path_buffer: [std.fs.max_path_bytes]u8 = undefined;
    const folder_path = path_buffer[0..try folder.realPath(io, &path_buffer)];
    const path = try std.fs.path.join(gpa, &.{ folder_path, name });
    defer gpa.free(path);
    var diagnostic: Diagnostic = .{};
    var temporaries: TemporaryFiles = .{};
    var target: Target = try .openFile(io, &temporaries, path, &diagnostic);
    try write(gpa, image, .{
        .format = settings.format,
        .exposure = settings.exposure,
        .transparent = settings.transparent,
        .pool = &pool,
    }, &target, &diagnostic);
    return folder.readFileAlloc(io, name, gpa, .unlimited);
}

test "the same frame in every format" {
    const gpa = std.testing.allocator;
    var folder = std.testing.tmpDir(.{});
    defer folder.cleanup();
    var image: Image = try .init(gpa, 2, 1);
    defer image.deinit(gpa);
    image.pixels[0] = .{ 0.25, 0.5, 0, 0.5 };
    image.pixels[1] = .{ 1, 2, 4, 1 };

    const ppm_file = try writeForTest(folder.dir, "a.ppm", &image, .{
        .format = .ppm,
        .exposure = .{ .ev = -1 },
        .transparent = true,
    });
    defer gpa.free(ppm_file);
    try std.testing.expectEqualSlices(u8, "P6\n2 1\n255\n" ++
        .{ 99, 137, 0, 188, 255, 255 }, ppm_file);

    const pfm_file = try writeForTest(folder.dir, "a.pfm", &image, .{
        .format = .pfm,
        .exposure = .auto,
    });
    defer gpa.free(pfm_file);
    const linear = [_]f32{ 0.25, 0.5, 0, 1, 2, 4 };
    try std.testing.expectEqualSlices(u8, "PF\n2 1\n-1.0\n", pfm_file[0..12]);
    try std.testing.expectEqualSlices(u8, std.mem.asBytes(&linear), pfm_file[12..]);

    for ([_]bool{ false, true }) |transparent| {
        const file = try writeForTest(folder.dir, "a.png", &image, .{ .transparent = transparent });
        defer gpa.free(file);
        // The colour type in the header: RGB is 2, RGBA 6.
        try std.testing.expectEqual(@as(u8, if (transparent) 6 else 2), file[25]);
    }
}

test "memory that runs out leaves no file, whenever it does" {
    var folder = std.testing.tmpDir(.{ .iterate = true });
    defer folder.cleanup();
    const io = std.testing.io;
    var image: Image = try .init(std.testing.allocator, 3, 3);
    defer image.deinit(std.testing.allocator);
    @memset(image.pixels, .{ 1, 1, 1, 1 });
    var path_buffer: [std.fs.max_path_bytes]u8 = undefined;
    const folder_path = path_buffer[0..try folder.dir.realPath(io, &path_buffer)];
    const path = try std.fs.path.join(std.testing.allocator, &.{ folder_path, "a" });
    defer std.testing.allocator.free(path);
    var pool: parallel.Pool = .init(1);
    defer pool.deinit();
    for (std.enums.values(choices.Format)) |format| {
        var failing: std.testing.FailingAllocator = .init(std.testing.allocator, .{
            .fail_index = 0,
        });
        var diagnostic: Diagnostic = .{};
        var temporaries: TemporaryFiles = .{};
        var target: Target = try .openFile(io, &temporaries, path, &diagnostic);
        const settings: Settings = .{ .format = format, .exposure = .auto, .pool = &pool };
        const result = write(failing.allocator(), &image, settings, &target, &diagnostic);
        try std.testing.expectError(error.OutOfMemory, result);
        var entries = folder.dir.iterate();
        try std.testing.expectEqual(null, try entries.next(io));
    }
}
