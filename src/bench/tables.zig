//! The results as the thesis's tables, for people.
//!
//! In: `Results`. Out: for each scene its times, tests, rays and joules by variant, each a mean
//! with half the width of its 95 % interval; then what all scenes have in common. Numbers of
//! figures and tables are those of the thesis.

const std = @import("std");
const results_file = @import("results.zig");
const statistics = @import("statistics.zig");
const Estimate = statistics.Estimate;
const Results = results_file.Results;
const Scene = results_file.Scene;
const Variant = results_file.Variant;
const Writer = std.Io.Writer;

const Error = Writer.Error;

/// Writes all tables.
pub fn write(results: *const Results, writer: *Writer) Error!void {
    try writeHead(results, writer);
    for (results.scenes) |*scene| {
        try writeScene(scene, writer);
        try writeTimes(scene, writer);
        try writeRays(scene, writer);
        try writeTests(scene, writer);
        try writeEnergy(scene, writer);
        try writeBounces(scene, writer);
    }
    try writeScaling(results, writer);
    try writeSummary(results, writer);
    try writeEnergySource(results, writer);
}

fn writeHead(results: *const Results, writer: *Writer) Error!void {
    const settings = &results.settings;
    try writer.print("raylane {s}, {s}, {s}, compiled for {s} ({s}) by Zig {s}, {s}\n", .{
        results.version,        results.machine.processor,  results.machine.system,
        results.build.cpu,      results.build.architecture, results.build.zig,
        results.build.optimize,
    });
    try writer.print("{d} x {d}, {d} a pixel, {s}, depth {d}, ", .{
        settings.width,      settings.height, settings.samples,
        settings.integrator, settings.depth,
    });
    try writer.print("{d} threads of {d} processors, {d:.0} s\n", .{
        settings.threads, results.machine.processor_count, results.duration_s,
    });
    try writer.print(
        "Mean and half width of the 95 % interval; ratios are to {s}, higher is better.\n",
        .{results.reference},
    );
}

fn writeScene(scene: *const Scene, writer: *Writer) Error!void {
    try writer.print("\n{s}: {d} triangles, {d} rounds ({s}), image {s} by all variants\n", .{
        scene.scene,
        scene.triangles,
        scene.rounds,
        switch (scene.ended_by) {
            .precision => "until intervals of render times were narrow",
            .rounds => "as asked for",
            .time => "until the time was over",
        },
        scene.image_hash,
    });
}

fn writeTimes(scene: *const Scene, writer: *Writer) Error!void {
    try writer.writeAll("\nRender time (figures 5.1, 5.3), time to build the BVH (5.2, 5.4)\n");
    try heads(writer, &.{ "render ms", "ratio", "build ms", "ratio" });
    const reference = &scene.variants[0];
    for (scene.variants) |*variant| {
        try writer.print("{s:<24}", .{variant.name});
        try cell(writer, statistics.estimate(variant.trace_ms));
        try cell(writer, statistics.ratio(reference.trace_ms, variant.trace_ms));
        try cell(writer, statistics.estimate(variant.bvh_build_ms));
        try cell(writer, statistics.ratio(reference.bvh_build_ms, variant.bvh_build_ms));
        try writer.writeByte('\n');
    }
}

/// Ratios are those of render times: all variants trace the same rays.
fn writeRays(scene: *const Scene, writer: *Writer) Error!void {
    const rays = &scene.rays;
    try writer.print(
        "\nRays a second (C.5; ratios, C.6, as of render time): {d} primary, {d} shadow, " ++
            "{d} secondary\n",
        .{ rays.primary, rays.shadow, rays.secondary },
    );
    try heads(writer, &.{ "primary M/s", "shadow M/s", "secondary M/s" });
    for (scene.variants) |*variant| {
        try writer.print("{s:<24}", .{variant.name});
        inline for (.{ rays.primary, rays.shadow, rays.secondary }) |count| {
            try cell(writer, statistics.rate(float(count) * 1e-3, variant.trace_ms));
        }
        try writer.writeByte('\n');
    }
}

/// As in the thesis every lane counts, idle ones too.
fn writeTests(scene: *const Scene, writer: *Writer) Error!void {
    if (scene.variants[0].tests.box_issued == 0) return; // Not counted.
    try writer.writeAll("\nTests a second, idle lanes with them (C.1 to C.4); boxes for each " ++
        "triangle (C.8)\n");
    try heads(writer, &.{ "triangles M/s", "ratio", "boxes M/s", "ratio", "box/tri." });
    const reference = &scene.variants[0];
    for (scene.variants) |*variant| {
        const tests = &variant.tests;
        try writer.print("{s:<24}", .{variant.name});
        inline for (.{ "triangle_issued", "box_issued" }) |which| {
            const count = float(@field(tests, which));
            const of_reference = float(@field(reference.tests, which));
            try cell(writer, statistics.rate(count * 1e-3, variant.trace_ms));
            const times = statistics.ratio(reference.trace_ms, variant.trace_ms);
            try cell(writer, scaled(times, count, of_reference));
        }
        if (tests.triangle_issued > 0) {
            const ratio = float(tests.box_issued) / float(tests.triangle_issued);
            try writer.print("{d:>10.2}", .{ratio});
        }
        try writer.writeByte('\n');
    }
}

/// An estimate times `upper / lower`; null without a denominator.
fn scaled(estimate: ?Estimate, upper: f64, lower: f64) ?Estimate {
    const value = estimate orelse return null;
    if (lower == 0) return null;
    const factor = upper / lower;
    return .{
        .mean = value.mean * factor,
        .half_width = if (value.half_width) |half_width| half_width * factor else null,
    };
}

fn writeEnergy(scene: *const Scene, writer: *Writer) Error!void {
    const reference = scene.variants[0].energy orelse return;
    const rays = float(scene.rays.primary + scene.rays.shadow + scene.rays.secondary) * 1e-3;
    try writer.writeAll("\nEnergy of a frame, less the machine at rest: the whole of it (tables " ++
        "5.2 to 5.5), tracing\nalone; rays for each joule (C.7)\n");
    try heads(writer, &.{ "whole J", "ratio", "tracing J", "ratio", "k rays/J" });
    for (scene.variants) |*variant| {
        const joules = variant.energy orelse continue;
        try writer.print("{s:<24}", .{variant.name});
        try cell(writer, statistics.estimate(joules.whole_j));
        try cell(writer, statistics.ratio(reference.whole_j, joules.whole_j));
        try cell(writer, statistics.estimate(joules.trace_j));
        try cell(writer, statistics.ratio(reference.trace_j, joules.trace_j));
        try cell(writer, statistics.rate(rays, joules.trace_j));
        try writer.writeByte('\n');
    }
}

/// Frames of one depth less those of one bounce less, round by round.
fn writeBounces(scene: *const Scene, writer: *Writer) Error!void {
    if (scene.bounces.len == 0) return;
    try writer.writeAll("\nWhat each bounce costs, shading with it: frames of a depth less " ++
        "those of one bounce less\n");
    try writer.print("{s:<24}{s:>8}{s:>12}{s:>12}", .{ "variant", "bounce", "rays", "shadow" });
    for ([_][]const u8{ "ms", "M rays/s", "mJ", "k rays/J" }) |head| {
        try writer.print("{s:>20}", .{head});
    }
    try writer.writeByte('\n');
    for (scene.bounces, 0..) |*bounce, index| {
        const before: ?*const results_file.Bounce =
            if (bounce.depth == 0) null else &scene.bounces[index - 1];
        try writer.print("{s:<24}{d:>8}{d:>12}{d:>12}", .{
            bounce.variant, bounce.depth, bounce.closest, bounce.shadow,
        });
        const rays = float(bounce.closest + bounce.shadow) * 1e-3;
        const times = statistics.difference(bounce.frame_ms, if (before) |b| b.frame_ms else &.{});
        const joules = statistics.difference(bounce.frame_j, if (before) |b| b.frame_j else &.{});
        try cell(writer, times);
        try cell(writer, rateOf(rays, times));
        try cell(writer, scaled(joules, 1e3, 1));
        try cell(writer, rateOf(rays, joules));
        try writer.writeByte('\n');
    }
}

/// `work` for each of what was estimated, with an interval of the same share of it; null where it
/// is not known to be more than nothing.
fn rateOf(work: f64, maybe: ?Estimate) ?Estimate {
    const estimate = maybe orelse return null;
    if (!(estimate.mean > 0) or estimate.relative() >= 1) return null;
    const rate = work / estimate.mean;
    return .{ .mean = rate, .half_width = rate * estimate.relative() };
}

fn writeScaling(results: *const Results, writer: *Writer) Error!void {
    if (results.scaling.len == 0) return;
    try writer.print("\nScaling (figure 5.5): {s}\n", .{results.scaling[0].scene});
    try writer.print("{s:<24}", .{"threads"});
    try writer.print("{s:>9}{s:>20}{s:>20}\n", .{ "", "render ms", "ratio to 1 thread" });
    var alone = &results.scaling[0];
    for (results.scaling) |*row| {
        if (row.threads == 1) alone = row;
        try writer.print("{s:<24}{d:>9}", .{ row.variant, row.threads });
        try cell(writer, statistics.estimate(row.trace_ms));
        try cell(writer, statistics.ratio(alone.trace_ms, row.trace_ms));
        try writer.writeByte('\n');
    }
}

/// The ratios of all scenes beside each other, and their geometric mean.
fn writeSummary(results: *const Results, writer: *Writer) Error!void {
    if (results.scenes.len < 2) return;
    try writer.print("\nRender time of {s} over that of each variant (figure 5.3)\n", .{
        results.reference,
    });
    try writer.print("{s:<24}", .{""});
    for (results.scenes) |*scene| {
        const name = scene.scene;
        const start = if (std.mem.findScalarLast(u8, name, '/')) |at| at + 1 else 0;
        const short = std.mem.cutPrefix(u8, name[start..], "builtin:") orelse name[start..];
        try writer.print("{s:>12}", .{short[0..@min(short.len, 11)]});
    }
    try writer.writeAll("  geom. mean\n");
    for (results.scenes[0].variants, 0..) |*variant, index| {
        try writer.print("{s:<24}", .{variant.name});
        var logarithms: f64 = 0;
        for (results.scenes) |*scene| {
            const reference = scene.variants[0].trace_ms;
            const ratio = statistics.ratio(reference, scene.variants[index].trace_ms).?.mean;
            logarithms += @log(ratio);
            try writer.print("{d:>12.2}", .{ratio});
        }
        try writer.print("{d:>12.2}\n", .{@exp(logarithms / float(results.scenes.len))});
    }
    try writer.writeAll("The thesis, NEON packets of 2x2 on Cortex-A9 and A15: 2.0 to 3.5.\n");
}

fn writeEnergySource(results: *const Results, writer: *Writer) Error!void {
    const energy = &results.energy;
    const source = energy.source orelse {
        try writer.print("\nEnergy (tables 5.1 to 5.5, C.7): not measurable here: {s}\n", .{
            energy.reason orelse "",
        });
        return;
    };
    try writer.print("\nEnergy by {s} ({s}):\n", .{ source, energy.scope orelse "" });
    for (energy.rails) |rail| try writer.print("  {s}\n", .{rail});
    if (energy.idle_w) |idle_w| try writer.print(
        "At rest (table 5.1) {d:.3} W, over {d:.1} s. ",
        .{ idle_w, energy.idle_s },
    );
    try writer.print("{d} readings took {d:.3} s, of which {d:.3} s computing.\n", .{
        energy.readings, energy.reading_s, energy.processor_s,
    });
    if (energy.reason) |reason| try writer.print("Lost: {s}\n", .{reason});
}

fn heads(writer: *Writer, names: []const []const u8) Error!void {
    try writer.print("{s:<24}", .{"variant"});
    for (names) |name| try writer.print("{s:>20}", .{name});
    try writer.writeByte('\n');
}

/// A mean and its interval in 20 columns, with as many digits as a reader can use.
fn cell(writer: *Writer, maybe: ?Estimate) Error!void {
    const estimate = maybe orelse return writer.print("{s:>20}", .{"-"});
    const magnitude = @abs(estimate.mean);
    inline for (.{ 1000, 100, 10, 0 }, 0..) |least, digits| {
        if (magnitude >= least) {
            const number = std.fmt.comptimePrint("{{d:>11.{d}}}", .{digits});
            try writer.print(number, .{estimate.mean});
            const half_width = estimate.half_width orelse return writer.writeAll("         ");
            return writer.print(" ±" ++ std.fmt.comptimePrint("{{d:<7.{d}}}", .{digits}), .{
                half_width,
            });
        }
    }
    return writer.print("{s:>20}", .{"-"}); // Not a number.
}

fn float(count: u64) f64 {
    return @floatFromInt(count);
}

const testing = std.testing;

fn resultsForTest(scenes: []const Scene) Results {
    return .{
        .version = "0",
        .started_unix_s = 0,
        .machine = .{ .processor = "P", .processor_count = 2, .system = "S" },
        .build = .{
            .zig = "0.17.1",
            .optimize = "fast",
            .architecture = "x86_64",
            .cpu = "C",
            .cpu_features = &.{},
        },
        .settings = .{
            .width = 8,
            .height = 8,
            .samples = 1,
            .depth = 3,
            .threads = 2,
            .bvh = "default",
            .time_limit_s = 1,
            .rounds = 2,
            .precision = 0.02,
        },
        .reference = "scalar-single-4",
        .energy = .{ .reason = "hwmon: no sensor" },
        .scenes = scenes,
        .scaling = &.{
            .{ .scene = "s", .variant = "v", .threads = 1, .trace_ms = &.{ 8, 8 } },
            .{ .scene = "s", .variant = "v", .threads = 2, .trace_ms = &.{ 4, 4 } },
        },
    };
}

const variant_for_test: Variant = .{
    .name = "scalar-single-4",
    .tests = .{ .box_issued = 4000, .triangle_issued = 1000 },
    .parse_ms = &.{ 1, 1 },
    .prepare_ms = &.{ 1, 1 },
    .bvh_build_ms = &.{ 2, 2 },
    .trace_ms = &.{ 10, 10 },
    .energy = .{
        .whole_j = &.{ 3, 3 },
        .whole_gross_j = &.{ 4, 4 },
        .whole_s = &.{ 1, 1 },
        .trace_j = &.{ 2, 2 },
        .trace_gross_j = &.{ 3, 3 },
        .trace_s = &.{ 1, 1 },
    },
};

/// Expects these cells, in this order, in the row of vector-beam-4 below a title.
fn expectRow(text: []const u8, title: []const u8, cells: []const []const u8) !void {
    const name = if (std.mem.eql(u8, title, "Scaling")) "v " else "vector-beam-4";
    const at = std.mem.find(u8, text, title) orelse return error.NoTable;
    const row_at = std.mem.findPos(u8, text, at, name) orelse return error.NoRow;
    var row = std.mem.sliceTo(text[row_at + name.len ..], '\n');
    errdefer std.debug.print("{s}\n", .{row});
    for (cells) |expected| {
        const found = std.mem.find(u8, row, expected) orelse return error.NoCell;
        row = row[found + expected.len ..];
    }
}

test "ratios, rates and joules come out as they should" {
    var quick = variant_for_test;
    quick.name = "vector-beam-4";
    quick.trace_ms = &.{ 4, 4 };
    quick.tests = .{ .box_issued = 2000, .triangle_issued = 1000 };
    quick.energy.?.trace_j = &.{ 0.5, 0.5 };
    const variants = [_]Variant{ variant_for_test, quick };
    const scene: Scene = .{
        .scene = "builtin:s",
        .triangles = 5,
        .image_hash = "00",
        .rays = .{ .primary = 1000, .shadow = 2000 },
        .rounds = 2,
        .ended_by = .time,
        .variants = &variants,
    };
    var out: Writer.Allocating = .init(testing.allocator);
    defer out.deinit();
    const results = resultsForTest(&.{ scene, scene });
    try write(&results, &out.writer);
    const text = out.written();
    try expectRow(text, "Render time (", &.{ "4.000 ±0.000", "2.500", "2.000", "1.000" });
    try expectRow(text, "Rays a second", &.{ "0.250", "0.500", "0.000" });
    try expectRow(text, "Tests a second", &.{ "0.250", "2.500", "0.500", "1.250", "2.00" });
    try expectRow(text, "Energy of a frame", &.{ "3.000", "1.000", "0.500", "4.000", "6.000" });
    try expectRow(text, "Scaling", &.{ "1", "8.000", "1.000" });
    try expectRow(text, "(figure 5.3)\n", &.{ "2.50", "2.50", "2.50" });
    try testing.expect(std.mem.find(u8, text, "not measurable here: hwmon: no sensor") != null);
    try testing.expect(std.mem.find(u8, text, "until the time was over") != null);
}

test "cells are as wide as their heads, whatever is in them" {
    for ([_]?Estimate{
        null,
        .{ .mean = 0, .half_width = null },
        .{ .mean = 123456.7, .half_width = 1.25 },
        .{ .mean = -0.5, .half_width = 0.001 },
        .{ .mean = std.math.nan(f64), .half_width = null },
    }) |estimate| {
        var buffer: [64]u8 = undefined;
        var writer: Writer = .fixed(&buffer);
        try cell(&writer, estimate);
        try testing.expectEqual(20, try std.unicode.utf8CountCodepoints(writer.buffered()));
    }
}
