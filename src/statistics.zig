//! What a frame cost, as plain counters that the stages fill and the report prints.
//!
//! A leaf that every stage may import. Counters are 64 bits wide and kept by thread while rays are
//! traced; `add` sums them up afterwards.

const std = @import("std");

/// Wall-clock time of each stage in nanoseconds.
pub const StageTimes = struct {
    parse_ns: u64 = 0,
    /// Decoding images, and all that is made of them.
    texture_ns: u64 = 0,
    /// All of `prepare` but the tree.
    prepare_ns: u64 = 0,
    bvh_build_ns: u64 = 0,
    trace_ns: u64 = 0,
    denoise_ns: u64 = 0,
    output_ns: u64 = 0,
    /// From the first to the last of them, what lies between included.
    total_ns: u64 = 0,
};

/// Rays by what they are for. Continuing behind a hole or a blended surface is not a new ray.
pub const RayCounts = struct {
    primary: u64 = 0,
    shadow: u64 = 0,
    /// Reflected and refracted.
    secondary: u64 = 0,
    /// By bounces up to where they start, where the integrator tells: those that look for surfaces,
    /// and those that look for light from where they end.
    by_bounce: [bounce_count]ByBounce = @splat(.{}),

    /// Bounces that are told apart; the last stands for all beyond, too.
    pub const bounce_count = 9;
    pub const ByBounce = struct { closest: u64 = 0, shadow: u64 = 0 };

    /// Adds another thread's counts.
    pub fn add(counts: *RayCounts, other: RayCounts) void {
        counts.primary += other.primary;
        counts.shadow += other.shadow;
        counts.secondary += other.secondary;
        for (&counts.by_bounce, other.by_bounce) |*to, more| {
            to.closest += more.closest;
            to.shadow += more.shadow;
        }
    }

    /// Counts rays after so many bounces.
    pub fn count(counts: *RayCounts, depth: u32, more: ByBounce) void {
        (if (depth == 0) &counts.primary else &counts.secondary).* += more.closest;
        counts.shadow += more.shadow;
        const to = &counts.by_bounce[@min(depth, bounce_count - 1)];
        to.closest += more.closest;
        to.shadow += more.shadow;
    }
};

/// Intersection tests. "Issued" is the thesis's tally: every lane of every instruction counts.
/// "Useful" counts the lanes that held both a ray under way and a box or triangle.
pub const TestCounts = struct {
    box_issued: u64 = 0,
    box_useful: u64 = 0,
    triangle_issued: u64 = 0,
    triangle_useful: u64 = 0,

    /// Adds another thread's counts.
    pub fn add(counts: *TestCounts, other: TestCounts) void {
        addEach(counts, other);
    }
};

/// What was left out, so that there is a bound to what a pixel costs.
pub const CutCounts = struct {
    /// Rays that went straight on through as many surfaces as they may.
    passing: u64 = 0,
    /// Shadow rays that more surfaces weaken than are counted: how many may depend on the variant
    /// where something opaque is behind these.
    shadow: u64 = 0,
    /// Boundaries that rays hit in more volumes at once than are told apart.
    nested: u64 = 0,

    /// Adds another thread's counts.
    pub fn add(counts: *CutCounts, other: CutCounts) void {
        addEach(counts, other);
    }
};

/// Adds numbers field by field.
fn addEach(counts: anytype, other: @TypeOf(counts.*)) void {
    inline for (@typeInfo(@TypeOf(other)).@"struct".field_names) |name|
        @field(counts, name) += @field(other, name);
}

test "counts of two threads add up" {
    var rays: RayCounts = .{ .primary = 1, .shadow = 2, .secondary = 3 };
    rays.add(.{ .primary = 10, .shadow = 20, .secondary = 30 });
    try std.testing.expectEqual(RayCounts{ .primary = 11, .shadow = 22, .secondary = 33 }, rays);
    var tests: TestCounts = .{ .box_useful = 1 };
    tests.add(.{ .box_issued = 4, .box_useful = 1, .triangle_issued = 4, .triangle_useful = 3 });
    try std.testing.expectEqual(2, tests.box_useful);
    var cuts: CutCounts = .{ .passing = 1, .nested = 5 };
    cuts.add(.{ .passing = 10, .shadow = 3 });
    try std.testing.expectEqual(CutCounts{ .passing = 11, .shadow = 3, .nested = 5 }, cuts);
}
