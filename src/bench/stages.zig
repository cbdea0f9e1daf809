//! One scene on its way through the stages, again and again: what the benchmark measures.
//!
//! In: a scene's name, the settings, a meter if there is one. Out: times of each stage, counts, the
//! hash of the image. Nothing is written.

const std = @import("std");
const energy = @import("../energy.zig");
const parse = @import("../parse.zig");
const prepare_file = @import("../prepare.zig");
const rounds = @import("rounds.zig");
const statistics = @import("../statistics.zig");
const trace_file = @import("../trace.zig");
const variant_file = @import("../variant.zig");
const Diagnostic = @import("../diagnostic.zig").Diagnostic;
const Identity = @import("../identity.zig").Identity;
const Film = @import("../film.zig").Film;
const World = @import("../world.zig").World;
const Allocator = std.mem.Allocator;
const Io = std.Io;

/// What is the same for all variants.
pub const Settings = struct {
    scene: []const u8,
    allow_outside: bool,
    output: ?Identity,
    width: u32,
    height: u32,
    thread_count: usize,
    sample_count: u32,
    depth: u32,
    tree_quality: prepare_file.TreeQuality,
};

pub const Stages = struct {
    gpa: Allocator,
    io: Io,
    settings: Settings,
    diagnostic: *Diagnostic,
    meter: ?*energy.Meter,
    progress: std.Progress.Node,
    film: Film,
    world: ?World = null,
    triangle_count: u64 = 0,
    /// By variant; tests depend on traversal and lanes alone.
    counts: [variant_file.compiled.len]?statistics.TestCounts = @splat(null),

    pub const Error = parse.Error || prepare_file.Error || trace_file.Error;

    /// Takes memory for the film.
    pub fn init(
        gpa: Allocator,
        io: Io,
        settings: Settings,
        diagnostic: *Diagnostic,
        meter: ?*energy.Meter,
        progress: std.Progress.Node,
    ) error{OutOfMemory}!Stages {
        return .{
            .gpa = gpa,
            .io = io,
            .settings = settings,
            .diagnostic = diagnostic,
            .meter = meter,
            .progress = progress,
            .film = try .init(gpa, settings.width, settings.height, .init(.{ .color = true })),
        };
    }

    pub fn deinit(stages: *Stages) void {
        if (stages.world) |*world| world.deinit();
        stages.film.deinit(stages.gpa);
        stages.* = undefined;
    }

    /// Reads the scene and builds the tree of a variant's width.
    pub fn prepare(stages: *Stages, variant: usize) Error!rounds.Prepared {
        const settings = &stages.settings;
        if (stages.world) |*world| world.deinit();
        stages.world = null;
        var times: statistics.StageTimes = .{};
        const start_ns = stages.now();
        var scene = try parse.parse(stages.gpa, stages.io, settings.scene, .{
            .allow_outside = settings.allow_outside,
            .output = settings.output,
        }, stages.diagnostic);
        defer scene.deinit();
        stages.triangle_count = scene.triangleCount();
        const parsed_ns = stages.now();
        stages.world = try prepare_file.prepare(stages.gpa, stages.io, &scene, .{
            .lanes = variant_file.compiled[variant].lanes,
            .thread_count = settings.thread_count,
            .tree_quality = settings.tree_quality,
            .resolution = .{ settings.width, settings.height },
        }, stages.diagnostic, &times);
        return .{
            .parse_ns = parsed_ns - start_ns,
            .prepare_ns = times.prepare_ns,
            .bvh_build_ns = times.bvh_build_ns,
        };
    }

    /// Traces the image by a variant for whose width the tree was built.
    pub fn trace(stages: *Stages, variant: usize, thread_count: usize) Error!rounds.Traced {
        const start_ns = stages.now();
        const frame = stages.world.?.frame();
        const settings = stages.traceSettings(thread_count);
        const traced = try trace_file.trace(stages.gpa, variant, &frame, &stages.film, settings);
        return .{ .trace_ns = stages.now() - start_ns, .rays = traced.rays };
    }

    /// Tests of boxes and triangles, by a pass that is not timed.
    pub fn count(stages: *Stages, variant: usize) Error!statistics.TestCounts {
        const compiled = variant_file.compiled;
        for (compiled, stages.counts) |other, counted| {
            if (other.traversal != compiled[variant].traversal) continue;
            if (other.lanes != compiled[variant].lanes) continue;
            if (counted) |tests| return tests;
        }
        const frame = stages.world.?.frame();
        const settings = stages.traceSettings(stages.settings.thread_count);
        const traced = try trace_file
            .traceCounting(stages.gpa, variant, &frame, &stages.film, settings);
        stages.counts[variant] = traced.tests;
        return traced.tests.?;
    }

    fn traceSettings(stages: *const Stages, thread_count: usize) trace_file.Settings {
        return .{
            .thread_count = thread_count,
            .sample_count = stages.settings.sample_count,
            .depth_max = stages.settings.depth,
        };
    }

    pub fn hash(stages: *const Stages) u64 {
        return stages.film.image.hash();
    }

    /// A clock that never goes back, in nanoseconds.
    pub fn now(stages: *const Stages) u64 {
        return @intCast(Io.Clock.awake.now(stages.io).nanoseconds);
    }

    pub fn mark(stages: *const Stages) ?energy.Mark {
        return (stages.meter orelse return null).mark();
    }

    pub fn between(
        stages: *const Stages,
        from: energy.Mark,
        to: energy.Mark,
    ) ?energy.Interval {
        return stages.meter.?.between(from, to);
    }

    pub fn windowNs(stages: *const Stages) u64 {
        const meter = stages.meter orelse return 0;
        if (meter.isLost()) return 0;
        return @as(u64, meter.source.window_ms) * std.time.ns_per_ms;
    }

    pub fn name(_: *const Stages, variant: usize) []const u8 {
        return variant_file.names[variant];
    }

    pub fn step(stages: *const Stages) void {
        stages.progress.completeOne();
    }
};
