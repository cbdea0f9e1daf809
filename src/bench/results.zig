//! What the benchmark found, as plain data: the JSON file is this, and the tables come from it.
//!
//! Keys grow in number but never change their meaning. Samples of a variant have the same index in
//! the same round; units stand at the end of the names.

const statistics = @import("../statistics.zig");

/// One run of the benchmark.
pub const Results = struct {
    format: []const u8 = "raylane-bench-1",
    /// Of the program.
    version: []const u8,
    started_unix_s: i64,
    duration_s: f64 = 0,
    machine: Machine,
    build: Build,
    settings: Settings,
    /// What ratios are of: the scalar single-ray tracer where it was measured.
    reference: []const u8,
    energy: Energy,
    scenes: []const Scene = &.{},
    scaling: []const Scaling = &.{},
};

pub const Machine = struct {
    /// As the system calls it.
    processor: []const u8,
    processor_count: usize,
    system: []const u8,
};

/// How the program was compiled.
pub const Build = struct {
    zig: []const u8,
    optimize: []const u8,
    architecture: []const u8,
    cpu: []const u8,
    cpu_features: []const []const u8,
};

pub const Settings = struct {
    width: u32,
    height: u32,
    samples: u32,
    depth: u32,
    integrator: []const u8 = "whitted",
    threads: usize,
    bvh: []const u8,
    time_limit_s: u32,
    /// Null: until intervals are narrow.
    rounds: ?usize,
    /// Half width of the 95 % interval of the render time over its mean, at which it is narrow.
    precision: f64,
};

/// How energy was measured, or why not.
pub const Energy = struct {
    /// Null: not measurable.
    source: ?[]const u8 = null,
    /// Why not, or why not to the end.
    reason: ?[]const u8 = null,
    scope: ?[]const u8 = null,
    rails: []const []const u8 = &.{},
    period_ms: u32 = 0,
    window_ms: u32 = 0,
    /// Power of the machine at rest, before the first scene.
    idle_w: ?f64 = null,
    idle_s: f64 = 0,
    /// What the measuring itself took.
    readings: u64 = 0,
    reading_s: f64 = 0,
    processor_s: f64 = 0,
};

/// Why a scene's rounds ended.
pub const End = enum { precision, rounds, time };

pub const Scene = struct {
    scene: []const u8,
    triangles: u64,
    /// In hexadecimal; the same for all variants.
    image_hash: []const u8,
    rays: statistics.RayCounts,
    rounds: usize,
    ended_by: End,
    variants: []const Variant,
    /// By variant and depth, where an integrator was asked for.
    bounces: []const Bounce = &.{},
};

/// Frames of one variant with at most `depth` bounces; a sample a round.
pub const Bounce = struct {
    variant: []const u8,
    depth: u32,
    /// Rays that look for surfaces, and shadow rays, which frames of one bounce less have not.
    closest: u64,
    shadow: u64,
    frame_ms: []const f64,
    /// Less what the machine takes at rest; empty where energy is not measured.
    frame_j: []const f64,
};

/// One variant in one scene; a sample a round.
pub const Variant = struct {
    name: []const u8,
    tests: statistics.TestCounts,
    parse_ms: []const f64,
    prepare_ms: []const f64,
    bvh_build_ms: []const f64,
    trace_ms: []const f64,
    energy: ?Joules,
};

/// Energy of one frame, a sample a round, less what the machine takes at rest; `gross` with it.
/// `whole` is parsing, preparing, tracing and the image's hash; `trace` is tracing alone.
pub const Joules = struct {
    whole_j: []const f64,
    whole_gross_j: []const f64,
    whole_s: []const f64,
    trace_j: []const f64,
    trace_gross_j: []const f64,
    trace_s: []const f64,
};

/// Render times of one variant by one number of threads.
pub const Scaling = struct {
    scene: []const u8,
    variant: []const u8,
    threads: usize,
    trace_ms: []const f64,
};
