//! How far two pictures are from each other, by the field's measures.
//!
//! In: two image files. Out: the largest difference, RMSE, PSNR, SSIM and FLIP, as text
//! and JSON, and a picture of where they differ. Everything is about sRGB values in 0..1, as a
//! display shows them (`compare/picture.zig`), and the same on every target.

const std = @import("std");
const flip = @import("compare/flip.zig");
const heat = @import("math.zig").magma;
const elementary = @import("math/elementary.zig");
const parse_resource = @import("parse/resource.zig");
const picture_file = @import("compare/picture.zig");
const settings = @import("settings.zig");
const ssim = @import("compare/ssim.zig");
const Allocator = std.mem.Allocator;
const Diagnostic = @import("diagnostic.zig").Diagnostic;
const Identity = @import("identity.zig").Identity;

/// `InputOutput`: the file cannot be read; `InvalidInput`: it is no image.
pub const Error = parse_resource.Error;

pub const Picture = picture_file.Picture;
/// Linear light behind what is transparent.
pub const grey = picture_file.grey;

/// The image at a path, of radiance made brighter by `exposure_ev` stops; an error if that is the
/// file `output`, which is about to be replaced.
pub fn read(
    gpa: Allocator,
    io: std.Io,
    path: []const u8,
    output: ?Identity,
    exposure_ev: f32,
    diagnostic: *Diagnostic,
) Error!Picture {
    var opened = try parse_resource.open(gpa, io, path, .{ .output = output }, diagnostic);
    defer opened.close();
    const scale: f32 = @floatCast(elementary.exp(exposure_ev * std.math.ln2));
    const file = opened.main.bytes;
    return Picture.of(gpa, file, scale, &diagnostic.message) catch |err| switch (err) {
        error.InvalidImage => error.InvalidInput,
        error.OutOfMemory => error.OutOfMemory,
    };
}

/// Of all pixels together.
pub const Metrics = struct {
    /// Largest difference of a channel.
    max: f64,
    /// Root of the mean squared difference of all channels.
    rmse: f64,
    /// Peak signal-to-noise ratio, -20 log10 of that; infinite where nothing differs.
    psnr_db: f64,
    /// See `ssim.mean`.
    ssim: f64,
    /// Mean of FLIP's map.
    flip: f64,

    /// The one of this name.
    pub fn of(metrics: *const Metrics, metric: settings.Metric) f64 {
        return switch (metric) {
            .max => metrics.max,
            .rmse => metrics.rmse,
            .psnr => metrics.psnr_db,
            .ssim => metrics.ssim,
            .flip => metrics.flip,
        };
    }

    /// Whether a metric is worse than this value.
    pub fn isBeyond(metrics: *const Metrics, metric: settings.Metric, value: f64) bool {
        return switch (metric) {
            .max, .rmse, .flip => metrics.of(metric) > value,
            .psnr, .ssim => metrics.of(metric) < value,
        };
    }
};

/// What was found; `map` is FLIP's, freed by `deinit`.
pub const Comparison = struct {
    width: u32,
    height: u32,
    metrics: Metrics,
    map: []f32,

    /// Asserts that both have one size.
    pub fn of(
        gpa: Allocator,
        first: *const Picture,
        second: *const Picture,
    ) error{OutOfMemory}!Comparison {
        std.debug.assert(first.width == second.width and first.height == second.height);
        const map = try gpa.alloc(f32, first.encoded[0].len);
        errdefer gpa.free(map);
        var metrics = differences(first, second);
        metrics.ssim = try ssim.mean(gpa, first, second);
        try flip.evaluate(gpa, first, second, map);
        var sum: f64 = 0;
        for (map) |value| sum += value;
        metrics.flip = sum / @as(f64, @floatFromInt(map.len));
        return .{
            .width = first.width,
            .height = first.height,
            .metrics = metrics,
            .map = map,
        };
    }

    pub fn deinit(comparison: *Comparison, gpa: Allocator) void {
        gpa.free(comparison.map);
        comparison.* = undefined;
    }

    /// RGB bytes of the map in colours; the caller frees them.
    pub fn heatMap(comparison: *const Comparison, gpa: Allocator) error{OutOfMemory}![]align(4) u8 {
        const bytes = try gpa.alignedAlloc(u8, .@"4", 3 * comparison.map.len);
        heat.fill(comparison.map, bytes);
        return bytes;
    }

    /// One line a metric.
    pub fn writeText(
        comparison: *const Comparison,
        writer: *std.Io.Writer,
    ) std.Io.Writer.Error!void {
        const metrics = &comparison.metrics;
        try writer.print("max   {d:.4}\nRMSE  {d:.5}\n", .{ metrics.max, metrics.rmse });
        try writer.print("PSNR  {d:.2} dB\nSSIM  {d:.5}\n", .{ metrics.psnr_db, metrics.ssim });
        try writer.print("FLIP  {d:.5}\n", .{metrics.flip});
    }

    /// One object; PSNR is null where it is infinite.
    pub fn writeJson(
        comparison: *const Comparison,
        names: [2][]const u8,
        writer: *std.Io.Writer,
    ) std.Io.Writer.Error!void {
        const metrics = &comparison.metrics;
        const is_finite = std.math.isFinite(metrics.psnr_db);
        try writer.print("{f}\n", .{std.json.fmt(.{
            .format = "raylane-compare-1",
            .images = names,
            .width = comparison.width,
            .height = comparison.height,
            .max = metrics.max,
            .rmse = metrics.rmse,
            .psnr_db = if (is_finite) metrics.psnr_db else null,
            .ssim = metrics.ssim,
            .flip = metrics.flip,
        }, .{ .whitespace = .indent_2 })});
    }
};

/// Without SSIM and FLIP.
fn differences(first: *const Picture, second: *const Picture) Metrics {
    var largest: f32 = 0;
    var sum: f64 = 0;
    for (first.encoded, second.encoded) |a_plane, b_plane| for (a_plane, b_plane) |a, b| {
        largest = @max(largest, @abs(a - b));
        sum += @as(f64, a - b) * (a - b);
    };
    const mean = sum / @as(f64, @floatFromInt(3 * first.encoded[0].len));
    return .{
        .max = largest,
        .rmse = @sqrt(mean),
        .psnr_db = -10.0 / std.math.ln10 * elementary.log(mean),
        .ssim = undefined,
        .flip = undefined,
    };
}

test {
    _ = flip;
    _ = picture_file;
    _ = ssim;
    _ = @import("compare/filter.zig");
    _ = @import("compare/netpbm.zig");
}

test "a constant offset, and nothing at all" {
    const gpa = std.testing.allocator;
    var first: Picture = try .solid(gpa, 12, 8, .{ 0.2, 0.3, 0.4 });
    defer first.deinit(gpa);
    var second: Picture = try .solid(gpa, 12, 8, .{ 0.2, 0.3, 0.4 });
    defer second.deinit(gpa);
    var same: Comparison = try .of(gpa, &first, &second);
    defer same.deinit(gpa);
    try std.testing.expectEqual(0, same.metrics.max);
    try std.testing.expectEqual(0, same.metrics.rmse);
    try std.testing.expectEqual(std.math.inf(f64), same.metrics.psnr_db);
    try std.testing.expectApproxEqAbs(1, same.metrics.ssim, 1e-6);
    try std.testing.expectEqual(0, same.metrics.flip);
    for (second.encoded) |plane| for (plane) |*value| {
        value.* += 0.1;
    };
    var other: Comparison = try .of(gpa, &first, &second);
    defer other.deinit(gpa);
    try std.testing.expectApproxEqAbs(0.1, other.metrics.max, 1e-6);
    try std.testing.expectApproxEqAbs(0.1, other.metrics.rmse, 1e-6);
    try std.testing.expectApproxEqAbs(20, other.metrics.psnr_db, 1e-4);
    try std.testing.expect(other.metrics.isBeyond(.rmse, 0.09));
    try std.testing.expect(!other.metrics.isBeyond(.rmse, 0.11));
    try std.testing.expect(other.metrics.isBeyond(.psnr, 21));
    try std.testing.expect(!same.metrics.isBeyond(.psnr, 100));

    var text: std.Io.Writer.Allocating = .init(gpa);
    defer text.deinit();
    try same.writeJson(.{ "a.png", "b.png" }, &text.writer);
    try std.testing.expect(std.mem.find(u8, text.written(), "\"psnr_db\": null") != null);
    const bytes = try same.heatMap(gpa);
    defer gpa.free(bytes);
    for (bytes) |byte| try std.testing.expectEqual(0, byte);
}

test "a pattern, by the figures of the authors' own FLIP and of SSIM's definition in f64" {
    const gpa = std.testing.allocator;
    const header = "P6 32 24 255\n";
    var files: [2][header.len + 32 * 24 * 3]u8 = undefined;
    for (&files, 0..) |*file, other| {
        file[0..header.len].* = header.*;
        for (0..24) |y| for (0..32) |x| {
            const red = x * 8 + y * 3 * other;
            const blue = x * y * (1 + 6 * other) + 40 * other;
            const pixel: [3]u8 = .{ @truncate(red), @truncate(y * 10), @truncate(blue) };
            file[header.len + (y * 32 + x) * 3 ..][0..3].* = pixel;
        };
    }
    var pictures: [2]Picture = undefined;
    for (&pictures, &files) |*picture, *file| {
        var reason: @import("diagnostic.zig").Message = .{};
        picture.* = try .of(gpa, file, 1, &reason);
    }
    defer for (&pictures) |*picture| picture.deinit(gpa);
    var comparison: Comparison = try .of(gpa, &pictures[0], &pictures[1]);
    defer comparison.deinit(gpa);
    try std.testing.expectApproxEqAbs(0.51309, comparison.metrics.flip, 2e-5);
    try std.testing.expectApproxEqAbs(0.785597, comparison.metrics.ssim, 2e-6);
}
