//! Refit of a wide BVH to triangles that have moved (Wald, Boulos and Shirley 2007).
//!
//! In: a tree and where its triangles are now. Out: the same tree with packs and boxes as a build
//! would write them there, and what it costs by the surface area heuristic. A box is that of whole
//! triangles, each grown by its pad, grown once by its margin, so that rays find in it what they
//! find in a new tree: only how fast depends on how well the old one still fits. A triangle that is
//! dropped leaves its pack and has its lane again when it is not.
//!
//! I. Wald, S. Boulos, P. Shirley, "Ray Tracing Deformable Scenes Using Dynamic Bounding Volume
//! Hierarchies" (2007), section 3.

const std = @import("std");
const math = @import("../../math.zig");
const parallel = @import("../../parallel.zig");
const world = @import("../../world.zig");
const bvh_input = @import("input.zig");
const bvh_wide = @import("wide.zig");
const split = @import("split.zig");
const assert = std.debug.assert;
const Allocator = std.mem.Allocator;
const Box = split.Box;
const Input = bvh_input.Input;
const Part = bvh_wide.Part;

/// A tree is worth keeping until it costs this many times what it cost when it was built.
pub const cost_ratio_max = 1.3;

/// How many packs ahead triangles are fetched, and their corners half as many.
const prefetch_distance = 2;

/// What a refit came to.
pub const Outcome = struct {
    /// As `TreeStatistics.sah_cost`.
    sah_cost: f64,
    /// Triangles in the packs.
    kept_count: usize,
};

/// A tree that may be fitted again.
pub const AnyRefit = union(enum) {
    w4: Refit(4),
    w8: Refit(8),
    w16: Refit(16),

    /// See `Refit.deinit`.
    pub fn deinit(any: *AnyRefit, gpa: Allocator) void {
        switch (any.*) {
            inline else => |*refit| refit.deinit(gpa),
        }
    }

    /// See `Refit.run`.
    pub fn run(any: *AnyRefit, gpa: Allocator, input: *const Input) bvh_input.Error!Outcome {
        switch (any.*) {
            inline else => |*refit| return refit.run(gpa, input),
        }
    }

    /// The tree as rays have it.
    pub fn tree(any: *const AnyRefit) world.AnyTree {
        return switch (any.*) {
            .w4 => |*refit| .{ .w4 = refit.built.tree() },
            .w8 => |*refit| .{ .w8 = refit.built.tree() },
            .w16 => |*refit| .{ .w16 = refit.built.tree() },
        };
    }

    /// When it was built.
    pub fn statistics(any: *const AnyRefit) world.TreeStatistics {
        return switch (any.*) {
            inline else => |*refit| refit.built.statistics,
        };
    }
};

/// A tree of one width that may be fitted again.
pub fn Refit(comptime width: u32) type {
    return struct {
        built: bvh_wide.Built(width),
        /// By pack and lane: the number of the triangle that the build put there, or `none`. Empty
        /// until the first refit.
        numbers: [][width]u32 = &.{},
        /// Of a refit: boxes of packs and of nodes without their margins, and sums of parts.
        pack_boxes: []Box = &.{},
        node_boxes: []Box = &.{},
        sums: []Sum = &.{},

        const Self = @This();
        const Node = world.Node(width);
        const Pack = world.TrianglePack(width);
        const Sum = struct { area: f64, kept_count: usize };

        /// Frees what refits need; the tree is not owned.
        pub fn deinit(refit: *Self, gpa: Allocator) void {
            gpa.free(refit.numbers);
            gpa.free(refit.pack_boxes);
            gpa.free(refit.node_boxes);
            gpa.free(refit.sums);
            refit.* = undefined;
        }

        /// Fits the tree to `input`, whose triangles are numbered as those it was built of. Returns
        /// what it costs now. Its memory comes from `gpa` and is kept for the next time.
        pub fn run(refit: *Self, gpa: Allocator, input: *const Input) bvh_input.Error!Outcome {
            const built = &refit.built;
            if (refit.sums.len == 0) try refit.prepare(gpa);
            var work: Work = .{ .refit = refit, .input = input };
            try input.pool.forEach(built.parts.len, &work, Work.fitPart);
            // What is above all others.
            refit.sums[0].area += work.fitNodes(&built.parts[0]);
            var outcome: Outcome = .{ .sah_cost = 0, .kept_count = 0 };
            for (refit.sums) |*sum| {
                outcome.sah_cost += sum.area;
                outcome.kept_count += sum.kept_count;
            }
            const root_area = areaOf(refit.node_boxes[0]);
            outcome.sah_cost = if (root_area > 0)
                outcome.sah_cost / root_area
            else
                @floatFromInt(built.nodes.len + built.packs.len);
            return outcome;
        }

        fn prepare(refit: *Self, gpa: Allocator) error{OutOfMemory}!void {
            const built = &refit.built;
            assert(refit.numbers.len == 0);
            errdefer {
                const kept = refit.built;
                refit.deinit(gpa);
                refit.* = .{ .built = kept };
            }
            refit.numbers = try gpa.alloc([width]u32, built.packs.len);
            refit.pack_boxes = try gpa.alloc(Box, built.packs.len);
            refit.node_boxes = try gpa.alloc(Box, built.nodes.len);
            refit.sums = try gpa.alloc(Sum, built.parts.len);
            for (refit.numbers, built.packs) |*numbers, *pack| numbers.* = pack.primitive;
        }

        const Work = struct {
            refit: *Self,
            input: *const Input,

            fn fitPart(work: *Work, turn: usize, _: usize) void {
                const parts = work.refit.built.parts;
                const pool = work.input.pool;
                const index = parallel.interleave(turn, parts.len, pool.thread_count);
                const sum = &work.refit.sums[index];
                sum.* = .{ .area = 0, .kept_count = work.fitPacks(&parts[index]) };
                if (index > 0) sum.area = work.fitNodes(&parts[index]);
            }

            /// Writes the packs of a part. Returns how many triangles they hold.
            fn fitPacks(work: *const Work, part: *const Part) usize {
                const refit = work.refit;
                var kept_count: usize = 0;
                for (part.pack_begin..part.pack_end) |index| {
                    work.prefetch(index, part.pack_end);
                    const pack = &refit.built.packs[index];
                    var box = split.box_empty;
                    var filled: usize = 0;
                    for (refit.numbers[index]) |number| {
                        if (number == world.none) break;
                        const triangle = &work.input.triangles[number];
                        if (triangle.isDropped()) continue;
                        box = split.join(
                            box,
                            split.reference(work.input.grownBox(triangle), number),
                        );
                        pack.primitive[filled] = number;
                        for (triangle.corner, &pack.corner) |vertex, *corner| {
                            const position = work.input.positions[vertex];
                            inline for (position, corner) |coordinate, *lanes| {
                                lanes[filled] = coordinate;
                            }
                        }
                        filled += 1;
                    }
                    clearFrom(pack, filled);
                    refit.pack_boxes[index] = box;
                    kept_count += filled;
                }
                return kept_count;
            }

            /// Triangles and their corners lie scattered.
            inline fn prefetch(work: *const Work, index: usize, end: usize) void {
                const triangles = work.input.triangles;
                if (index + 2 * prefetch_distance >= end) return;
                for (work.refit.numbers[index + 2 * prefetch_distance]) |number| {
                    if (number == world.none) break;
                    @prefetch(&triangles[number], .{});
                }
                for (work.refit.numbers[index + prefetch_distance]) |number| {
                    if (number == world.none) break;
                    for (triangles[number].corner) |vertex| {
                        @prefetch(&work.input.positions[vertex], .{});
                    }
                }
            }

            /// Writes the boxes of the nodes of a part, those below before those above. Returns
            /// the sum of their areas and those of the leaves, each times its cost.
            fn fitNodes(work: *const Work, part: *const Part) f64 {
                const refit = work.refit;
                var sum: f64 = 0;
                var index = part.node_end;
                while (index > part.node_begin) {
                    index -= 1;
                    const node = &refit.built.nodes[index];
                    var joined = split.box_empty;
                    for (node.child, 0..) |child, slot| {
                        if (child == world.Child.missing) continue;
                        var box = split.box_empty;
                        if (child.pack_count == 0) {
                            assert(child.target > index);
                            box = refit.node_boxes[child.target];
                        } else {
                            const first, const end = child.packs();
                            for (refit.pack_boxes[first..end]) |below| box = split.join(box, below);
                            const count: f64 = @floatFromInt(child.pack_count);
                            sum += count * bvh_wide.pack_cost * areaOf(box);
                        }
                        work.setBox(node, slot, box);
                        joined = split.join(joined, box);
                    }
                    refit.node_boxes[index] = joined;
                    sum += bvh_wide.node_cost * areaOf(joined);
                }
                return sum;
            }

            fn setBox(work: *const Work, node: *Node, slot: usize, from: Box) void {
                var box: math.Box3 = .empty;
                if (!isEmpty(from)) {
                    box = split.toBox3(from);
                    box = box.grow(work.input.padding.marginOfBox(box));
                }
                node.setChildBox(slot, box);
            }
        };

        fn clearFrom(pack: *Pack, filled: usize) void {
            for (filled..width) |lane| {
                pack.primitive[lane] = world.none;
                for (&pack.corner) |*corner| {
                    for (corner) |*lanes| lanes[lane] = 0;
                }
            }
        }
    };
}

/// Of triangles that are all dropped.
fn isEmpty(box: Box) bool {
    return box[0] == std.math.inf(f32);
}

/// Half the surface area; 0 of the empty box.
fn areaOf(box: Box) f64 {
    return if (isEmpty(box)) 0 else split.halfArea(box);
}

const testing = std.testing;

/// Triangles that move, and the world that a tree over them is checked in.
const TestSoup = struct {
    positions: []math.Vec3,
    triangles: []world.Triangle,
    pool: *parallel.Pool,

    /// Small triangles here and there, some of them without an area.
    fn scatter(soup: *const TestSoup, random: std.Random, dropped_share: f32) void {
        for (soup.triangles, 0..) |*triangle, number| {
            const first: u32 = @intCast(3 * number);
            triangle.* = .{ .corner = .{ first, first + 1, first + 2 }, .material = 0 };
            var at: math.Vec3 = undefined;
            for (&at) |*coordinate| coordinate.* = 10 * random.floatNorm(f32);
            for (soup.positions[first..][0..3]) |*position| for (position, at) |*to, middle| {
                to.* = middle + random.float(f32);
            };
            if (random.float(f32) < dropped_share) triangle.material = world.none;
        }
    }

    fn geometry(soup: *const TestSoup) world.Geometry {
        var made: world.Geometry = .empty;
        made.positions = soup.positions;
        made.normals = soup.positions;
        made.triangles = soup.triangles;
        for (soup.triangles) |triangle| {
            made.dropped_count += @intFromBool(triangle.isDropped());
            if (triangle.isDropped()) continue;
            var box: math.Box3 = .empty;
            for (triangle.corner) |vertex| box = box.include(soup.positions[vertex]);
            made.bounds = made.bounds.join(box);
            made.centroid_bounds = made.centroid_bounds.include(box.centerTwice());
        }
        made.padding = .init(soup.positions[0], made.bounds);
        return made;
    }

    fn input(soup: *const TestSoup, made: *const world.Geometry) Input {
        return .{
            .positions = made.positions,
            .triangles = made.triangles,
            .centroid_bounds = made.centroid_bounds,
            .padding = made.padding,
            .pool = soup.pool,
        };
    }

    /// Fits the tree and checks it. Returns what came of it.
    fn fit(soup: *const TestSoup, any: *AnyRefit) !Outcome {
        const gpa = testing.allocator;
        var checked: world.World = .init(gpa);
        defer checked.deinit();
        checked.geometry = soup.geometry();
        const outcome = try any.run(gpa, &soup.input(&checked.geometry));
        checked.geometry.tree = any.tree();
        checked.facts.tree = any.statistics();
        checked.materials.all = &.{undefined};
        try @import("check.zig").check(gpa, &checked);
        return outcome;
    }
};

fn testWidth(
    comptime width: u32,
    count: usize,
    dropped_shares: []const f32,
    pool: *parallel.Pool,
) !void {
    const gpa = testing.allocator;
    var random_state: std.Random.DefaultPrng = .init(count);
    const random = random_state.random();
    const soup: TestSoup = .{
        .positions = try gpa.alloc(math.Vec3, 3 * count),
        .triangles = try gpa.alloc(world.Triangle, count),
        .pool = pool,
    };
    defer gpa.free(soup.positions);
    defer gpa.free(soup.triangles);
    soup.scatter(random, 0);
    const there = try gpa.dupe(math.Vec3, soup.positions);
    defer gpa.free(there);
    const geometry = soup.geometry();
    var arena: std.heap.ArenaAllocator = .init(gpa);
    defer arena.deinit();
    const built = try bvh_wide.build(gpa, arena.allocator(), &soup.input(&geometry), width);
    const nodes = try gpa.dupe(world.Node(width), built.nodes);
    defer gpa.free(nodes);
    const packs = try gpa.dupe(world.TrianglePack(width), built.packs);
    defer gpa.free(packs);
    var any = @unionInit(AnyRefit, std.fmt.comptimePrint("w{d}", .{width}), .{ .built = built });
    defer any.deinit(gpa);

    // Anywhere else, some or all of it gone.
    for (dropped_shares) |dropped_share| {
        soup.scatter(random, dropped_share);
        const outcome = try soup.fit(&any);
        try testing.expectEqual(count - soup.geometry().dropped_count, outcome.kept_count);
    }
    // And back: the very tree that was built.
    soup.scatter(random, 0);
    @memcpy(soup.positions, there);
    const outcome = try soup.fit(&any);
    try testing.expectApproxEqRel(built.statistics.sah_cost, outcome.sah_cost, 1e-5);
    const bytes = std.mem.sliceAsBytes;
    try testing.expect(std.mem.eql(u8, bytes(nodes), bytes(built.nodes)));
    try testing.expect(std.mem.eql(u8, bytes(packs), bytes(built.packs)));
}

test "a refitted tree holds its triangles as tightly as a new one, wherever they go" {
    var pool: parallel.Pool = .init(2);
    defer pool.deinit();
    inline for (.{ 4, 8, 16 }) |width| {
        for ([_]usize{ 1, 5, 70, 500 }) |count| {
            try testWidth(width, count, &.{ 0, 0.4, 1, 0.1 }, &pool);
        }
    }
    // Of several parts.
    try testWidth(16, 8500, &.{0.1}, &pool);
}
