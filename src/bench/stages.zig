//! One scene on its way through the stages, again and again: what the benchmark measures.
//!
//! In: a scene's name, the settings, a meter if there is one. Out: times of each stage, counts, the
//! hash of the image. Nothing is written.

const std = @import("std");
const energy = @import("../energy.zig");
const rounds = @import("rounds.zig");
const settings_file = @import("../settings.zig");
const statistics = @import("../statistics.zig");
const variant_file = @import("../variant.zig");
const Diagnostic = @import("../diagnostic.zig").Diagnostic;
const Progress = @import("../progress.zig").Progress;
const Session = @import("../session.zig").Session;
const Allocator = std.mem.Allocator;
const Io = std.Io;

/// What is the same for all variants.
pub const Settings = struct {
    scene: []const u8,
    load: settings_file.Load,
    tree_quality: settings_file.TreeQuality,
    view: settings_file.View,
    integrator: settings_file.Integrator,
    sample_count: u32,
    depth: u32,
};

pub const Stages = struct {
    session: Session,
    settings: Settings,
    meter: ?*energy.Meter,
    /// Told of every rendering.
    progress: ?*Progress,
    /// By variant; tests depend on traversal and lanes alone.
    counts: [variant_file.compiled.len]?statistics.TestCounts = @splat(null),

    pub const Error = Session.Error;

    /// Must stay where it is.
    pub fn init(
        gpa: Allocator,
        io: Io,
        settings: Settings,
        thread_count: usize,
        diagnostic: *Diagnostic,
        meter: ?*energy.Meter,
        progress: ?*Progress,
    ) Stages {
        return .{
            .session = .init(gpa, io, thread_count, diagnostic),
            .settings = settings,
            .meter = meter,
            .progress = progress,
        };
    }

    pub fn deinit(stages: *Stages) void {
        stages.session.deinit();
        stages.* = undefined;
    }

    /// Reads the scene and builds the tree of a variant's width.
    pub fn prepare(stages: *Stages, variant: usize) Error!rounds.Prepared {
        const session = &stages.session;
        const settings = &stages.settings;
        try session.load(settings.scene, settings.load);
        try session.pose(.{
            .lanes = variant_file.compiled[variant].lanes,
            .tree_quality = settings.tree_quality,
        });
        try session.view(settings.view);
        session.dropScene();
        return .{
            .parse_ns = session.times.parse_ns,
            .prepare_ns = session.times.prepare_ns,
            .bvh_build_ns = session.times.bvh_build_ns,
        };
    }

    /// Traces the image by a variant for whose width the tree was built.
    pub fn trace(stages: *Stages, variant: usize, thread_count: usize) Error!rounds.Traced {
        const session = &stages.session;
        const all_count = session.pool.thread_count;
        session.pool.thread_count = thread_count;
        defer session.pool.thread_count = all_count;
        try session.render(stages.renderSettings(variant));
        return .{ .trace_ns = session.times.trace_ns, .rays = session.traced.rays };
    }

    /// Bounces at most, from now on.
    pub fn setDepth(stages: *Stages, depth: u32) void {
        stages.settings.depth = depth;
    }

    /// Tests of boxes and triangles, by a pass that is not timed; those of Whitted's integrator,
    /// which alone counts them.
    pub fn count(stages: *Stages, variant: usize) Error!statistics.TestCounts {
        if (stages.settings.integrator != .whitted) return .{};
        const compiled = variant_file.compiled;
        for (compiled, stages.counts) |other, counted| {
            if (other.traversal != compiled[variant].traversal) continue;
            if (other.lanes != compiled[variant].lanes) continue;
            if (counted) |tests| return tests;
        }
        const tests = try stages.session.countTests(stages.renderSettings(variant));
        stages.counts[variant] = tests;
        return tests;
    }

    fn renderSettings(stages: *const Stages, variant: usize) settings_file.Render {
        return .{
            .integrator = stages.settings.integrator,
            .variant = variant,
            .sample_count = stages.settings.sample_count,
            .depth = stages.settings.depth,
        };
    }

    pub fn hash(stages: *const Stages) u64 {
        return stages.session.film.?.hash();
    }

    /// A clock that never goes back, in nanoseconds.
    pub fn now(stages: *const Stages) u64 {
        return @intCast(Io.Clock.awake.now(stages.session.io).nanoseconds);
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
        Progress.add(stages.progress, 1);
    }
};
