//! The benchmark's results as plain data, a table and JSON.
//!
//! In: measurements. Out: text. Keys of the JSON object have their unit last; times are null where
//! instructions were counted instead, and `first_tag` says which of the counter's tags are whose.

const std = @import("std");
const raylane = @import("raylane");
const phases = @import("phases.zig");
const observer = @import("observer.zig");
const Phase = phases.Phase;
const Quality = raylane.settings.TreeQuality;
const Writer = std.Io.Writer;

/// The least and the middle of some repetitions.
pub const Spread = struct {
    min: f64,
    median: f64,

    /// Sorts the values. Asserts that there is one.
    pub fn of(values: []f64) Spread {
        std.mem.sort(f64, values, {}, std.sort.asc(f64));
        return .{ .min = values[0], .median = values[values.len / 2] };
    }
};

/// A tree of one quality and width.
pub const Build = struct {
    bvh: Quality,
    lanes: u8,
    first_tag: u32,
    time_ms: ?Spread,
    mtriangles_per_s: ?f64,
    bytes_per_triangle: f64,
    sah_cost: f64,
    nodes: usize,
    blocks: usize,
};

/// One phase of a picture.
pub const PhaseCost = struct {
    rays: u64,
    time_ms: ?Spread,
    mrays_per_s: ?f64,
};

/// One variant's pictures, through a tree of one quality.
pub const Run = struct {
    name: []const u8,
    bvh: Quality,
    first_tag: u32,
    frame_ms: ?Spread,
    mrays_per_s: ?f64,
    generation: PhaseCost,
    primary: PhaseCost,
    shading: PhaseCost,
    shadow: PhaseCost,
    bounce: PhaseCost,
    bounce_shadow: PhaseCost,
    bounce_shading: PhaseCost,
    hits: u64,
    occluded: u64,
    t_sum: f64,
    reflections: u64,
    reflection_hits: u64,
    reflection_occluded: u64,
    hash: []const u8,
};

/// All that was measured.
pub const Report = struct {
    scene: []const u8,
    triangles: usize,
    size: u32,
    depth: u32,
    threads: u32,
    build_threads: u32,
    repetitions: u32,
    builds: []const Build,
    runs: []const Run,
};

/// Rays that a phase is about: the pixels, the hits or the reflections.
pub fn rayCount(phase: Phase, pixel_count: u64, counts: *const observer.Counts) u64 {
    return switch (phase) {
        .generation, .primary, .shading => pixel_count,
        .shadow => counts.hits,
        .bounce, .bounce_shading => counts.reflections,
        .bounce_shadow => counts.reflection_hits,
        .other, .build => 0,
    };
}

/// One object, and a line end.
pub fn writeJson(writer: *Writer, report: *const Report) Writer.Error!void {
    try writer.print("{f}\n", .{std.json.fmt(report, .{ .whitespace = .indent_1 })});
}

/// For people.
pub fn writeTable(writer: *Writer, report: *const Report) Writer.Error!void {
    try writer.print("{s}: {d} triangles, {d}x{d} pixels, {d} bounces, {d} threads, " ++
        "{d} repetitions\n", .{
        report.scene, report.triangles, report.size,        report.size,
        report.depth, report.threads,   report.repetitions,
    });
    for (report.builds) |*build| try writeBuild(writer, build);
    for (report.runs) |*run| try writeRun(writer, run);
}

fn writeBuild(writer: *Writer, build: *const Build) Writer.Error!void {
    try writer.print("\ntree {d} wide, {t}", .{ build.lanes, build.bvh });
    if (build.time_ms) |time| try writer.print(": {d:.2} ms (median {d:.2}), {d:.2} Mtris/s", .{
        time.min, time.median, build.mtriangles_per_s.?,
    });
    try writer.print("\n  {d:.1} bytes a triangle, SAH cost {d:.2}, {d} nodes, {d} blocks\n", .{
        build.bytes_per_triangle, build.sah_cost, build.nodes, build.blocks,
    });
}

fn writeRun(writer: *Writer, run: *const Run) Writer.Error!void {
    try writer.print("\n{s}, {t}\n", .{ run.name, run.bvh });
    if (run.frame_ms) |time| {
        try writer.print("  {s:<15}{s:>10}{s:>10}{s:>10}{s:>10}\n", .{
            "", "min ms", "median", "rays", "Mrays/s",
        });
        try writer.print("  {s:<15}{d:>10.2}{d:>10.2}{s:>10}{d:>10.2}\n", .{
            "frame", time.min, time.median, "", run.mrays_per_s.?,
        });
    }
    inline for (phases.frame_phases) |phase| {
        const cost = @field(run, @tagName(phase));
        if (cost.rays > 0) if (cost.time_ms) |time| {
            try writer.print("  {s:<15}{d:>10.2}{d:>10.2}{d:>10}{d:>10.2}\n", .{
                @tagName(phase), time.min, time.median, cost.rays, cost.mrays_per_s.?,
            });
        };
    }
    try writer.print("  {d} hits, {d} in shadow, sum of t {d:.1}\n", .{
        run.hits, run.occluded, run.t_sum,
    });
    if (run.reflections > 0) try writer.print("  {d} reflections, {d} hits, {d} in shadow\n", .{
        run.reflections, run.reflection_hits, run.reflection_occluded,
    });
    try writer.print("  hash {s}\n", .{run.hash});
}
