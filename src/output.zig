//! Stage 4: `Image` -> file.
//!
//! In: a finished picture. Out: a file in one of nine formats, whole and in its place, or nothing
//! at all. Colours are made by all threads; the bytes depend on the picture and the settings alone.

const std = @import("std");
const choices = @import("settings.zig");
const Allocator = std.mem.Allocator;
const Diagnostic = @import("diagnostic.zig").Diagnostic;
const Image = @import("image.zig").Image;
const huge_pages = @import("huge_pages.zig");
const parallel = @import("parallel.zig");
const layer_picture = @import("output/layer_picture.zig");
const layers_file = @import("output/layers.zig");
const Manifest = @import("manifest.zig").Manifest;
const stb_image_write = @import("output/stb_image_write.zig");
const webp = @import("output/webp.zig");
const target_file = @import("output/target.zig");
const y4m = @import("output/y4m.zig");
const encode_file = @import("output/encode.zig");
const exposure_file = @import("output/exposure.zig");
const assert = std.debug.assert;

pub const Target = target_file.Target;
/// Which open descriptor a path stands for.
pub const descriptorOf = target_file.descriptorOf;
/// What a target fails with.
pub const TargetError = target_file.Error;
/// What is behind a picture.
pub const Background = @import("output/background.zig").Background;
/// What is written: the layers of a film.
pub const Picture = encode_file.Picture;
/// What a file may hold besides the picture.
pub const Further = layers_file.Further;
/// Writes channels of any kind with texts beside them.
pub const openexr = @import("output/openexr.zig");
/// Exports what libwebp calls.
pub const exportWebpFunctions = webp.exportFunctions;
/// Makes colours of a layer.
pub const paintLayer = layer_picture.paint;
/// Rows of a picture that has more.
pub const Extent = encode_file.Extent;
/// How many pixels look like nothing.
pub const Tally = encode_file.Tally;
/// The exposure that suits a picture.
pub const meter = exposure_file.meter;
/// See `meter`.
pub const Metered = exposure_file.Metered;
/// What an exposure multiplies radiance by.
pub const exposureScale = exposure_file.scaleOf;
/// What targets create until they are in place.
pub const TemporaryFiles = @import("output/temporary.zig").TemporaryFiles;

/// Pixels on a side at most, where the format counts them in two bytes.
fn sideMax(format: choices.Format) u32 {
    return switch (format) {
        .jpg, .tga => 65_535,
        .exr => openexr.width_max,
        .webp => webp.side_max,
        else => std.math.maxInt(u31),
    };
}

fn formOf(
    format: choices.Format,
    transparent: bool,
    exr_kind: choices.ExrKind,
) encode_file.Form {
    return switch (format) {
        .png, .tga, .webp => if (transparent) .rgba else .rgb,
        .jpg, .bmp, .ppm, .y4m => .rgb,
        .hdr => .radiance,
        .pfm => .linear,
        .exr => switch (exr_kind) {
            .half => if (transparent) .half_alpha else .half,
            .float => if (transparent) .linear_alpha else .linear,
        },
    };
}

pub const Settings = struct {
    format: choices.Format = .png,
    /// In stops, of the formats that are not linear.
    exposure_ev: f32 = 0,
    /// Of the same formats.
    tone_mapping: choices.ToneMapping = .linear,
    /// Keep alpha, where the format has it.
    transparent: bool = false,
    background: Background = .none,
    /// Which of a picture's rows these are; null: all.
    rows: ?Extent = null,
    /// Within `settings.jpeg_quality`.
    jpeg_quality: u8 = choices.jpeg_quality.default,
    /// Within `settings.webp_quality`; null: without loss.
    webp_quality: ?u8 = null,
    /// Of the colours in an OpenEXR file.
    exr_kind: choices.ExrKind = .half,
    /// Of a film.
    frame_rate: choices.FrameRate = .{},
    /// The film has frames already.
    is_continued: bool = false,
    /// Layers of the picture's size, each once at most; only a file in OpenEXR holds them.
    further: []const Further = &.{},
    /// What such a file is to have; null: no layer has numbers.
    manifest: ?*const Manifest = null,
    pool: *parallel.Pool,
};

/// The diagnostic says why, unless the pool's work was cancelled.
pub const Error = error{ OutOfMemory, InputOutput } || parallel.Error;

/// A PNG file of RGB bytes, rows from the top; the caller frees it. Asserts that it is not larger
/// than `check` allows.
pub fn encodePng(
    gpa: Allocator,
    width: u32,
    height: u32,
    pixels: []align(4) const u8,
) error{OutOfMemory}![]u8 {
    return stb_image_write.encode(gpa, .png, .{
        .width = width,
        .height = height,
        .channel_count = 3,
        .pixels = pixels,
        .quality = choices.jpeg_quality.default,
    });
}

/// Refuses a picture that the format cannot hold; best asked before it is rendered.
pub fn check(
    format: choices.Format,
    transparent: bool,
    width: u32,
    height: u32,
    diagnostic: *Diagnostic,
) error{InputOutput}!void {
    if (@max(width, height) > sideMax(format)) return diagnostic.fail(
        error.InputOutput,
        "a {t} file has {d} pixels on a side at most",
        .{ format, sideMax(format) },
    );
    const channel_count: u64 = channelCount(formOf(format, transparent, .half));
    const by_library = switch (format) {
        .ppm, .pfm, .y4m, .webp => false,
        .png, .jpg, .tga, .bmp, .hdr, .exr => true,
    };
    const value_count = (width * channel_count + 1) * height;
    if (by_library and value_count > stb_image_write.value_count_max) return diagnostic.fail(
        error.InputOutput,
        "{d}x{d} pixels are too many for a {t} file; .ppm and .pfm hold them",
        .{ width, height, format },
    );
}

fn channelCount(form: encode_file.Form) u8 {
    return switch (form) {
        .rgba, .half_alpha, .linear_alpha => 4,
        .rgb, .linear, .radiance, .half => 3,
    };
}

/// Whether a format keeps radiance as it is, without exposure and tone mapping.
pub fn isLinear(format: choices.Format) bool {
    return switch (formOf(format, false, .half)) {
        .linear, .linear_alpha, .radiance, .half, .half_alpha => true,
        .rgb, .rgba => false,
    };
}

/// Encodes the picture and moves it to its place. Closes the target in any case. Returns how many
/// pixels look like nothing, of the formats that are not linear.
pub fn write(
    gpa: Allocator,
    picture: Picture,
    settings: Settings,
    target: *Target,
    diagnostic: *Diagnostic,
) Error!Tally {
    defer target.abandon();
    const format = settings.format;
    const image = picture.image;
    try check(format, settings.transparent, image.width, image.height, diagnostic);
    const form = formOf(format, settings.transparent, settings.exr_kind);
    var work: Work = .{
        .rows = .{
            .picture = picture,
            .form = form,
            .scale = exposure_file.scaleOf(settings.exposure_ev),
            .tone_mapping = settings.tone_mapping,
            .background = settings.background,
            .extent = settings.rows orelse .{ .first = 0, .of = image.height },
        },
        .from_bottom = format == .pfm,
    };
    const pixels = try work.run(gpa, settings.pool);
    defer huge_pages.free(gpa, pixels);

    var buffer: [48]u8 = undefined;
    const size = .{ image.width, image.height };
    // Two numbers of 10 digits and 10 bytes more fit.
    switch (format) {
        .ppm => try target.finish(&.{
            std.mem.print(&buffer, "P6\n{d} {d}\n255\n", size) catch unreachable, pixels,
        }, diagnostic),
        // A negative scale says little-endian.
        .pfm => try target.finish(&.{
            std.mem.print(&buffer, "PF\n{d} {d}\n-1.0\n", size) catch unreachable, pixels,
        }, diagnostic),
        .y4m => try writeFrame(gpa, size, pixels, &settings, target, diagnostic),
        inline .png, .jpg, .tga, .bmp, .hdr => |coded| {
            const file = try stb_image_write.encode(gpa, @field(
                stb_image_write.Codec,
                @tagName(coded),
            ), .{
                .width = image.width,
                .height = image.height,
                .channel_count = channelCount(form),
                .pixels = pixels,
                .quality = settings.jpeg_quality,
            });
            defer gpa.free(file);
            try target.finish(&.{file}, diagnostic);
        },
        .webp => try writeWebp(gpa, size, pixels, &settings, target, diagnostic),
        .exr => {
            var channels: layers_file.Channels = .{};
            channels.addPicture(pixels, channelCount(form), settings.exr_kind);
            for (settings.further) |*further| channels.addLayer(further);
            try writeExr(gpa, image, channels.all(), &settings, target, diagnostic);
        },
    }
    return work.tally;
}

fn writeWebp(
    gpa: Allocator,
    size: [2]u32,
    pixels: []align(4) const u8,
    settings: *const Settings,
    target: *Target,
    diagnostic: *Diagnostic,
) Error!void {
    const file = try webp.encode(gpa, .{
        .width = size[0],
        .height = size[1],
        .channel_count = channelCount(formOf(.webp, settings.transparent, .half)),
        .pixels = pixels,
        .quality = settings.webp_quality,
    });
    defer gpa.free(file);
    return target.finish(&.{file}, diagnostic);
}

/// Encodes channels as an OpenEXR file and moves it to its place. Closes the target in any case.
pub fn writeChannels(
    gpa: Allocator,
    picture: openexr.Picture,
    target: *Target,
    diagnostic: *Diagnostic,
) Error!void {
    defer target.abandon();
    const file = try openexr.encode(gpa, picture);
    defer gpa.free(file);
    try target.finish(&.{file}, diagnostic);
}

fn writeFrame(
    gpa: Allocator,
    size: [2]u32,
    pixels: []const u8,
    settings: *const Settings,
    target: *Target,
    diagnostic: *Diagnostic,
) Error!void {
    const planes = try y4m.planes(gpa, pixels);
    defer gpa.free(planes);
    var buffer: [y4m.header_bytes_max]u8 = undefined;
    const header = y4m.header(&buffer, size, settings.frame_rate, !settings.is_continued);
    return target.finish(&.{ header, planes }, diagnostic);
}

/// A file of these channels, of an image's size.
fn writeExr(
    gpa: Allocator,
    image: *const Image,
    channels: []const openexr.Channel,
    settings: *const Settings,
    target: *Target,
    diagnostic: *Diagnostic,
) Error!void {
    const text = if (settings.manifest) |manifest| try manifest.text(gpa) else null;
    defer if (text) |some| gpa.free(some);
    return writeChannels(gpa, .{
        .width = image.width,
        .height = image.height,
        .channels = channels,
        .attributes = if (text) |some|
            &.{.{ .name = layers_file.manifest_name, .text = some }}
        else
            &.{},
    }, target, diagnostic);
}

/// Encodes a layer alone and moves it to its place: its channels in OpenEXR, its numbers as they
/// are in the other linear formats, else colours (`paintLayer`). Closes the target in any case.
pub fn writeLayer(
    gpa: Allocator,
    further: *const Further,
    settings: Settings,
    target: *Target,
    diagnostic: *Diagnostic,
) Error!void {
    defer target.abandon();
    const from = further.image;
    try check(settings.format, false, from.width, from.height, diagnostic);
    if (settings.format == .exr) {
        var channels: layers_file.Channels = .{};
        channels.addLayer(further);
        return writeExr(gpa, from, channels.all(), &settings, target, diagnostic);
    }
    var chosen = settings;
    chosen.transparent = false;
    chosen.background = .none;
    var image: Image = try .init(gpa, from.width, from.height);
    defer image.deinit(gpa);
    if (isLinear(settings.format)) {
        layer_picture.copy(further, &image);
        _ = try write(gpa, .{ .image = &image }, chosen, target, diagnostic);
        return;
    }
    var display: Image = try .init(gpa, from.width, from.height);
    defer display.deinit(gpa);
    @memset(image.pixels, .{ 0, 0, 0, 1 });
    try layer_picture.paint(gpa, further, &display);
    _ = try write(gpa, .{ .image = &image, .display = &display }, chosen, target, diagnostic);
}

const Work = struct {
    rows: encode_file.Rows,
    from_bottom: bool,
    bytes: []align(64) u8 = &.{},
    tally: Tally = .{},

    /// All rows, by all threads; the caller frees them.
    fn run(work: *Work, gpa: Allocator, pool: *parallel.Pool) Error![]align(64) u8 {
        comptime assert(@import("builtin").cpu.arch.endian() == .little);
        const height = work.rows.picture.image.height;
        const byte_count = std.math.mul(usize, work.rows.byteCount(), height) catch
            return error.OutOfMemory;
        work.bytes = try huge_pages.alloc(gpa, u8, byte_count);
        errdefer huge_pages.free(gpa, work.bytes);
        try pool.forEach(height, work, Work.encodeRow);
        return work.bytes;
    }

    fn encodeRow(work: *Work, y: usize, _: usize) void {
        const row_bytes = work.rows.byteCount();
        const place = if (work.from_bottom) work.rows.picture.image.height - 1 - y else y;
        const bytes = work.bytes[place * row_bytes ..][0..row_bytes];
        const tally = work.rows.encode(@intCast(y), bytes);
        // Sums of whole numbers, whatever their order.
        inline for (comptime std.meta.fieldNames(Tally)) |name| {
            _ = @atomicRmw(u32, &@field(work.tally, name), .Add, @field(tally, name), .monotonic);
        }
    }
};

test {
    _ = openexr;
    _ = y4m;
    _ = stb_image_write;
    _ = webp;
    _ = layers_file;
    _ = layer_picture;
    _ = target_file;
    _ = @import("output/temporary.zig");
    _ = @import("output/background.zig");
    _ = @import("output/tonemap.zig");
    _ = encode_file;
    _ = exposure_file;
}

const TestSettings = struct {
    format: choices.Format = .png,
    exposure_ev: f32 = 0,
    transparent: bool = false,
    background: Background = .none,
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
    _ = try write(gpa, .{ .image = image }, .{
        .format = settings.format,
        .exposure_ev = settings.exposure_ev,
        .transparent = settings.transparent,
        .background = settings.background,
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
        .exposure_ev = -1,
        .transparent = true,
    });
    defer gpa.free(ppm_file);
    try std.testing.expectEqualSlices(u8, "P6\n2 1\n255\n" ++
        .{ 99, 137, 0, 188, 255, 255 }, ppm_file);

    const pfm_file = try writeForTest(folder.dir, "a.pfm", &image, .{
        .format = .pfm,
        .exposure_ev = 3,
        .background = .{ .srgb = .{ 0, 0, 255 } },
    });
    defer gpa.free(pfm_file);
    const linear = [_]f32{ 0.25, 0.5, 0.5, 1, 2, 4 };
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
        const settings: Settings = .{ .format = format, .pool = &pool };
        const picture: Picture = .{ .image = &image };
        const result = write(failing.allocator(), picture, settings, &target, &diagnostic);
        try std.testing.expectError(error.OutOfMemory, result);
        var entries = folder.dir.iterate();
        try std.testing.expectEqual(null, try entries.next(io));
    }
}
