//! Building a light tree (Conty Estevez and Kulla 2018, "Importance Sampling of Many Lights with
//! Adaptive Tree Splitting"), top down, by buckets of centres along the axes.
//!
//! In: bounds of lights. Out: nodes of up to four children, the path to each light. What is cut is
//! weighed by intensity, squared extent and the measure of the directions that it shines to: that
//! of a cone whose axes have as long a mean as the lights' have. A node's children are found by
//! cutting in two what weighs the most.

const std = @import("std");
const math = @import("../math.zig");
const world = @import("../world.zig");
const Allocator = std.mem.Allocator;
const Box3 = math.Box3;
const Node = world.LightNode;
const Vec3 = math.Vec3;
const Vec3d = math.Vec3d;
const vec3d = math.vec3d;
const elementary = math.elementary;
const assert = std.debug.assert;

/// What bounds a light; see `world.LightNode`.
pub const Bounds = struct {
    box: Box3,
    /// Unit vector.
    axis: Vec3d,
    cos_spread: f64,
    cos_emission: f64,
    /// In candela, > 0 and finite as f32.
    intensity: f64,
    back: f64,
    /// In metres; infinite without a range.
    reach: f64 = std.math.inf(f64),

    fn center(bounds: *const Bounds, axis: usize) f64 {
        return 0.5 * (@as(f64, bounds.box.lower[axis]) + bounds.box.upper[axis]);
    }

    /// Mean of directions that are even in the cone: all its axes' sum.
    fn mean(bounds: *const Bounds) Vec3d {
        return vec3d.scale(bounds.axis, 0.5 * (1 + bounds.cos_spread));
    }
};

const bucket_count = 12;
const width = world.light_tree_width;
/// From this level on lights are cut by number, so that no path is too long.
const halving_depth = world.light_tree_depth_max / 2;

/// The nodes over lights, from `arena`; sets the paths of their leaves, which are as many.
pub fn build(
    gpa: Allocator,
    arena: Allocator,
    bounds: []const Bounds,
    leaves: []world.LightLeaf,
) error{OutOfMemory}![]const Node {
    assert(bounds.len == leaves.len and bounds.len < Node.leaf_bit);
    if (bounds.len == 0) return &.{};
    const order = try gpa.alloc(u32, bounds.len);
    defer gpa.free(order);
    for (order, 0..) |*number, index| number.* = @intCast(index);
    var builder: Builder = .{ .gpa = gpa, .bounds = bounds, .order = order, .leaves = leaves };
    defer builder.nodes.deinit(gpa);
    defer builder.pending.deinit(gpa);
    for (&builder.measures, 0..) |*measure, index| {
        measure.* = measureOf(@as(f64, @floatFromInt(index)) / measure_steps);
    }
    try builder.add(.{ .range = .{ .first = 0, .end = bounds.len }, .depth = 0, .path = 0 });
    var index: usize = 0;
    while (index < builder.pending.items.len) : (index += 1) try builder.fill(index);
    return arena.dupe(Node, builder.nodes.items);
}

const Range = struct { first: usize, end: usize };
const Pending = struct { range: Range, depth: u8, path: u64 };

/// Sums over some lights.
const Sum = struct {
    box: Box3 = .empty,
    mean: Vec3d = .{ 0, 0, 0 },
    intensity: f64 = 0,

    fn add(sum: *Sum, bounds: *const Bounds) void {
        sum.join(&.{
            .box = bounds.box,
            .mean = vec3d.scale(bounds.mean(), bounds.intensity),
            .intensity = bounds.intensity,
        });
    }

    fn join(sum: *Sum, other: *const Sum) void {
        sum.box = sum.box.join(other.box);
        sum.mean = vec3d.add(sum.mean, other.mean);
        sum.intensity += other.intensity;
    }
};

const Part = struct { range: Range, cost: f64 };

const Builder = struct {
    gpa: Allocator,
    bounds: []const Bounds,
    /// Numbers of lights; those of a node follow each other.
    order: []u32,
    leaves: []world.LightLeaf,
    nodes: std.ArrayList(Node) = .empty,
    /// What each node is of.
    pending: std.ArrayList(Pending) = .empty,
    /// See `measureOf`.
    measures: [measure_steps + 1]f64 = undefined,

    fn add(builder: *Builder, pending: Pending) error{OutOfMemory}!void {
        try builder.nodes.append(builder.gpa, .empty);
        try builder.pending.append(builder.gpa, pending);
    }

    /// Finds the children of a node.
    fn fill(builder: *Builder, index: usize) error{OutOfMemory}!void {
        const pending = builder.pending.items[index];
        var parts: [width]Part = undefined;
        parts[0] = builder.partOf(pending.range);
        var count: usize = 1;
        while (count < width) : (count += 1) {
            const is_halved = pending.depth >= halving_depth;
            const heaviest = heaviestOf(parts[0..count], is_halved) orelse break;
            const range = parts[heaviest].range;
            const middle = builder.cut(range, is_halved);
            parts[heaviest] = builder.partOf(.{ .first = range.first, .end = middle });
            parts[count] = builder.partOf(.{ .first = middle, .end = range.end });
        }
        for (parts[0..count], 0..) |*part, slot| {
            const range = part.range;
            const path = pending.path | @as(u64, slot) << @intCast(2 * pending.depth);
            builder.put(&builder.nodes.items[index], slot, range);
            const child = &builder.nodes.items[index].child[slot];
            if (range.end - range.first == 1) {
                const leaf = builder.order[range.first];
                child.* = leaf | Node.leaf_bit;
                builder.leaves[leaf].path = path;
            } else {
                child.* = @intCast(builder.nodes.items.len);
                try builder.add(.{ .range = range, .depth = pending.depth + 1, .path = path });
            }
        }
    }

    /// Null: none can be cut.
    fn heaviestOf(parts: []const Part, by_number: bool) ?usize {
        var found: ?usize = null;
        for (parts, 0..) |*part, index| {
            const count = part.range.end - part.range.first;
            if (count == 1) continue;
            const before = &parts[found orelse index];
            const is_heavier = if (by_number)
                count > before.range.end - before.range.first
            else
                part.cost > before.cost;
            if (found == null or is_heavier) found = index;
        }
        return found;
    }

    fn partOf(builder: *const Builder, range: Range) Part {
        var sum: Sum = .{};
        for (builder.order[range.first..range.end]) |number| sum.add(&builder.bounds[number]);
        return .{ .range = range, .cost = builder.costOf(&sum) };
    }

    /// Intensity times squared extent times measure of directions.
    fn costOf(builder: *const Builder, sum: *const Sum) f64 {
        if (!(sum.intensity > 0)) return 0;
        const extent = extentOf(sum.box);
        const length = vec3d.length(sum.mean) / sum.intensity * measure_steps;
        const whole = @min(@floor(length), measure_steps - 1);
        const step: usize = @intFromFloat(whole);
        const lower = builder.measures[step];
        const measure = lower + (builder.measures[step + 1] - lower) * (length - whole);
        return sum.intensity * measure * vec3d.dot(extent, extent);
    }

    /// Parts some lights in two, none of them empty; returns where the second starts.
    fn cut(builder: *Builder, range: Range, is_halved: bool) usize {
        const order = builder.order[range.first..range.end];
        var centers: [2]Vec3d = .{ @splat(std.math.inf(f64)), @splat(-std.math.inf(f64)) };
        for (order) |number| for (0..3) |axis| {
            const center = builder.bounds[number].center(axis);
            centers[0][axis] = @min(centers[0][axis], center);
            centers[1][axis] = @max(centers[1][axis], center);
        };
        const extent = vec3d.sub(centers[1], centers[0]);
        const widest = vec3d.maxComponent(extent);
        const half = range.first + (range.end - range.first) / 2;
        if (is_halved or !(widest > 0)) return half;
        var best: ?Plane = null;
        for (0..3) |axis| {
            // Thin slices are long.
            if (!(extent[axis] > 1e-3 * widest)) continue;
            const buckets: Buckets = .{
                .axis = axis,
                .lower = centers[0][axis],
                .scale = bucket_count / extent[axis],
            };
            const plane = builder.bestPlane(order, buckets, widest / extent[axis]);
            if (best == null or plane.cost < best.?.cost) best = plane;
        }
        const plane = best.?;
        var count: usize = 0;
        for (order, 0..) |number, index| {
            if (plane.buckets.of(&builder.bounds[number]) >= plane.bucket) continue;
            std.mem.swap(u32, &order[count], &order[index]);
            count += 1;
        }
        assert(count > 0 and count < order.len);
        return range.first + count;
    }

    /// Where to cut along an axis: the first and last bucket always have some light.
    fn bestPlane(builder: *const Builder, order: []const u32, buckets: Buckets, factor: f64) Plane {
        var sums: [bucket_count]Sum = @splat(.{});
        for (order) |number| {
            const bounds = &builder.bounds[number];
            sums[buckets.of(bounds)].add(bounds);
        }
        var below: Sum = .{};
        var costs: [bucket_count - 1]f64 = undefined;
        for (&costs, sums[0 .. bucket_count - 1]) |*cost, *sum| {
            below.join(sum);
            cost.* = builder.costOf(&below);
        }
        var above: Sum = .{};
        var best: Plane = .{ .buckets = buckets, .bucket = 1, .cost = std.math.inf(f64) };
        var bucket: usize = bucket_count - 1;
        while (bucket > 0) : (bucket -= 1) {
            above.join(&sums[bucket]);
            const cost = factor * (costs[bucket - 1] + builder.costOf(&above));
            if (!(cost < best.cost)) continue;
            best.bucket = bucket;
            best.cost = cost;
        }
        return best;
    }

    /// Writes what bounds a child.
    fn put(builder: *const Builder, node: *Node, slot: usize, range: Range) void {
        var box: Box3 = .empty;
        var sum: Vec3d = .{ 0, 0, 0 };
        var intensity: f64 = 0;
        var back: f64 = 0;
        var reach: f64 = 0;
        var cos_emission: f64 = 1;
        const order = builder.order[range.first..range.end];
        for (order) |number| {
            const bounds = &builder.bounds[number];
            box = box.join(bounds.box);
            sum = vec3d.add(sum, bounds.axis);
            intensity += bounds.intensity;
            back = @max(back, bounds.back);
            reach = @max(reach, bounds.reach);
            cos_emission = @min(cos_emission, bounds.cos_emission);
        }
        const middle = vec3d.normalize(sum);
        const axis = middle orelse Vec3d{ 0, 0, 1 };
        var cos_spread: f64 = if (middle == null) -1 else 1;
        for (order) |number| {
            cos_spread = @min(cos_spread, cosineOfSum(axis, &builder.bounds[number]));
        }
        for (0..3) |component| {
            const center = 0.5 * (@as(f64, box.lower[component]) + box.upper[component]);
            node.center[component][slot] = @floatCast(center);
        }
        for (&node.axis, vec3d.toSingle(axis)) |*to, component| to[slot] = component;
        node.radius[slot] = @floatCast(0.5 * vec3d.length(extentOf(box)));
        node.cos_spread[slot] = @floatCast(cos_spread);
        node.sin_spread[slot] = @floatCast(@sqrt(@max(0, 1 - cos_spread * cos_spread)));
        node.cos_emission[slot] = @floatCast(cos_emission);
        node.intensity[slot] = @floatCast(@min(intensity, std.math.floatMax(f32)));
        node.back[slot] = @floatCast(back);
        node.reach[slot] = @floatCast(reach);
    }
};

const Plane = struct { buckets: Buckets, bucket: usize, cost: f64 };

const Buckets = struct {
    axis: usize,
    lower: f64,
    scale: f64,

    fn of(buckets: Buckets, bounds: *const Bounds) usize {
        const place = (bounds.center(buckets.axis) - buckets.lower) * buckets.scale;
        return @intFromFloat(@min(@max(place, 0), bucket_count - 1));
    }
};

fn extentOf(box: Box3) Vec3d {
    var extent: Vec3d = undefined;
    for (&extent, box.lower, box.upper) |*to, lower, upper| to.* = @as(f64, upper) - lower;
    return extent;
}

/// Cosine of a light's spread and the angle of its axis to another together, of pi at most.
fn cosineOfSum(axis: Vec3d, bounds: *const Bounds) f64 {
    const cosine = @min(1, @max(-1, vec3d.dot(axis, bounds.axis)));
    if (cosine <= -bounds.cos_spread) return -1;
    const sines = (1 - cosine * cosine) * (1 - bounds.cos_spread * bounds.cos_spread);
    return cosine * bounds.cos_spread - @sqrt(@max(0, sines));
}

const measure_steps = 64;

/// Measure of the directions that flat lights shine to whose mean axis has a length of 0..1:
/// equation 1 of the reference, for emission of a quarter turn and a cone that has such a mean.
fn measureOf(length: f64) f64 {
    const pi = std.math.pi;
    const cosine = 2 * length - 1;
    const angle = elementary.acos(cosine);
    const sine = elementary.sin(angle);
    const end = @min(angle + pi / 2.0, pi);
    const rest = 2 * end * sine - elementary.cos(angle - 2 * end) - 2 * angle * sine + cosine;
    return 2 * pi * (1 - cosine) + pi / 2.0 * rest;
}
