//! Hierarchical rasterisation (Greene 1996, "Hierarchical Polygon Tiling with Coverage Masks") of
//! one triangle over the rays of a beam: over subtiles of 4x4 pixels, then over those it touches.
//!
//! In: bounds of a triangle's edge functions and nearness, linear over the rays of a set. Out: to
//! the set, which rays meet it. What bounds leave in doubt, an edge or a depth too close to tell,
//! the exact test decides. Of a set it needs
//!
//!     query                      whether the closest hit is looked for, or any
//!     subtilesOf(decisive, coverage, slot)
//!                                the subtiles where the triangle may be seen, a bit each
//!     rowsOf(coverage, subtile)  an iterator over the groups of rays in a subtile: `group`,
//!                                `values()` of the four forms there, `next()`
//!     lower(group), upper(group) bounds of the nearness of what is known to be met; infinite where
//!                                there is no ray, or none any more
//!     withoutOwn(rays, group, coverage)
//!                                rays that do not leave this triangle out
//!     accept(group, rays, slot, lower, upper), boundSubtile(subtile)
//!                                keeps what was met, with bounds of its nearness

const std = @import("std");
const exact = @import("exact.zig");
const edges_file = @import("edges.zig");
const Linear = @import("projected_triangle.zig").Linear;

/// Coefficients of one triangle over the rays of a set; or of several, in lanes or in arrays.
pub fn Coverage(comptime Set: type, comptime Float: type, comptime Int: type) type {
    return struct {
        /// Three edge functions, then nearness: upper bounds.
        form: [4]Linear(Float),
        /// How far below them lower bounds are: by as much for edge functions, by a factor and then
        /// as much for nearness.
        slack: Float,
        shrink: Float,
        drop: Float,
        /// Where it may be seen, in terms of the set.
        window: Set.Window(Float, Int),
        primitive: Int,
    };
}

/// Tests a triangle against the rays of a set. Not `decisive`: seen edge-on, or out of all measure.
pub inline fn cover(
    comptime Kernel: type,
    comptime decisive: bool,
    set: anytype,
    coverage: *const Coverage(@TypeOf(set.*), f32, i32),
    slot: exact.Slot,
) void {
    var subtiles = set.subtilesOf(decisive, coverage, slot);
    while (subtiles != 0) : (subtiles &= subtiles - 1) {
        coverSubtile(Kernel, decisive, set, coverage, slot, @ctz(subtiles));
    }
}

/// Rays that meet a triangle, with bounds of its nearness.
fn Met(comptime Rays: type) type {
    return struct { mask: Rays.Mask, lower: Rays.F32, upper: Rays.F32 };
}

inline fn coverSubtile(
    comptime Kernel: type,
    comptime decisive: bool,
    set: anytype,
    coverage: *const Coverage(@TypeOf(set.*), f32, i32),
    slot: exact.Slot,
    subtile: u32,
) void {
    var rows = set.rowsOf(coverage, subtile);
    var changed = false;
    if (@TypeOf(set.*).query == .any_hit) {
        // Of a light all rows of a subtile are met, in code of their own each.
        inline for (0..Kernel.subtile_groups) |row| {
            if (coverRow(Kernel, decisive, set, coverage, slot, &rows)) changed = true;
            if (row + 1 < Kernel.subtile_groups) _ = rows.next();
        }
    } else while (true) {
        if (coverRow(Kernel, decisive, set, coverage, slot, &rows)) changed = true;
        if (!rows.next()) break;
    }
    if (changed) set.boundSubtile(subtile);
}

/// Tests a triangle against a group of rays. Returns whether any may have met it.
inline fn coverRow(
    comptime Kernel: type,
    comptime decisive: bool,
    set: anytype,
    coverage: *const Coverage(@TypeOf(set.*), f32, i32),
    slot: exact.Slot,
    rows: anytype,
) bool {
    const Mask = Kernel.Rays.Mask;
    const value = rows.values();
    const known = set.lower(rows.group);
    const least = value[0].minOrNegative(value[1]).minOrNegative(value[2]);
    var possible = if (decisive)
        value[3].gt(known).andNot(least.isNegative())
    else
        mayTouch(Kernel.Rays, value, coverage.slack)
            .bitAnd(known.lt(.splat(std.math.inf(f32))));
    if (possible.none()) return false;
    possible = set.withoutOwn(possible, rows.group, coverage);
    const lower = value[3].mulAdd(.splat(coverage.shrink), .splat(-coverage.drop));
    const before: Mask = if (decisive)
        possible.bitAnd(lower.gt(set.upper(rows.group)))
    else
        .splat(false);
    const certain = before.bitAnd(least.gt(.splat(coverage.slack)));
    var met: Met(Kernel.Rays) = .{ .mask = certain, .lower = lower, .upper = value[3] };
    const doubtful = possible.andNot(certain);
    if (doubtful.any()) met = decide(Kernel, set, slot, rows.group, doubtful, before, met);
    // From the eye it mostly does, and a branch would be one more to foresee.
    if (@TypeOf(set.*).query != .closest_hit and met.mask.none()) return false;
    set.accept(rows.group, met.mask, slot, met.lower, met.upper);
    return true;
}

/// Rays that a triangle of unknown orientation may touch: unless some edge function is surely
/// negative and another surely positive.
inline fn mayTouch(comptime Rays: type, value: [4]Rays.F32, slack: f32) Rays.Mask {
    var negative: Rays.Mask = .splat(false);
    var positive: Rays.Mask = .splat(false);
    for (value[0..3]) |edge| {
        negative = negative.bitOr(edge.lt(.zero()));
        positive = positive.bitOr(edge.gt(.splat(slack)));
    }
    return negative.bitAnd(positive).bitNot();
}

/// Asks the exact test about rays that a triangle comes near to, and adds those that meet it. Where
/// it is known to come `before` what has been found, nothing else is asked.
fn decide(
    comptime Kernel: type,
    set: anytype,
    slot: exact.Slot,
    group: u32,
    doubtful: Kernel.Rays.Mask,
    before: Kernel.Rays.Mask,
    certain: Met(Kernel.Rays),
) Met(Kernel.Rays) {
    @branchHint(.unlikely);
    const Set = @TypeOf(set.*);
    const F32 = Kernel.Rays.F32;
    const ray = &set.bundle.groups[group];
    const hit = exact.meet(Kernel, set.geometry, ray, slot);
    const met = hit.mask.bitAnd(doubtful);
    const nearer = certain.mask.bitOr(met.bitAnd(before));
    const unclear = met.bitAnd(hit.t.gt(.zero())).andNot(before);
    if (Set.query == .any_hit) return .{
        .mask = nearer.bitOr(unclear.bitAnd(hit.t.lt(ray.closest.t))),
        .lower = undefined,
        .upper = undefined,
    };
    const slots = set.buffer.of("slot", group);
    const first = exact.comeFirst(Kernel, set.geometry, ray, unclear, hit.t, slot, slots);
    const inverse = F32.splat(1).div(hit.t);
    const below = inverse.mul(.splat(1 - 4 * edges_file.unit_roundoff));
    const above = inverse.mul(.splat(1 + 4 * edges_file.unit_roundoff));
    return .{
        .mask = nearer.bitOr(first),
        .lower = .select(first, below, certain.lower),
        .upper = .select(first, above, certain.upper),
    };
}
