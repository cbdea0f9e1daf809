//! Ray stream traversal (Tsakok 2009) of incoherent rays, with active masks of 64 bits.
//!
//! In: rays of a bundle that are in no packet. Out: their hits, in the bundle. Each is tested by
//! itself against all boxes of a node, one ray right after the other, and those that enter a child
//! go on to it as a stream, of one at last. What a ray by itself waits for, the end of a chain of
//! arithmetic, a branch on how many children it enters, all share. While a node or a leaf is
//! visited, the next that waits is on its way from memory.
//!
//! J. Tsakok, "Faster Incoherent Rays: Multi-BVH Ray Stream Tracing" (2009), section 3, with
//! masks, not lists.

const std = @import("std");
const world_file = @import("../../world.zig");
const TestCounts = @import("../../statistics.zig").TestCounts;
const ray_file = @import("ray.zig");
const traversal_ray = @import("traversal_ray.zig");
const bundle_file = @import("bundle.zig");
const multi_hit = @import("multi_hit.zig");
const single = @import("single.zig");
const stack_file = @import("stack.zig");
const walk = @import("walk.zig");
const assert = std.debug.assert;
const Query = walk.Query;
const Geometry = world_file.Geometry;
const Place = bundle_file.Place;

/// Active mask: rays of a stream, a bit each.
const Set = u64;
const rays_max = @bitSizeOf(Set);
/// A lane holds a word of a mask.
const word_bits = 32;
const word_count = rays_max / word_bits;

/// Where hits go that are more than one a ray.
pub fn Lists(comptime Kernel: type, comptime query: Query) type {
    return if (query == .multi_hit) *multi_hit.HitLists(Kernel) else void;
}

/// Collects the rays of a bundle.
pub fn Stream(comptime Kernel: type, comptime query: Query) type {
    const Boxes = Kernel.Boxes;
    const Rays = Kernel.Rays;
    const F32 = Boxes.F32;
    const I32 = Boxes.I32;
    const TraversalRay = traversal_ray.TraversalRay(Kernel);
    return struct {
        geometry: *const Geometry,
        bundle: *bundle_file.Bundle(Kernel),
        lists: Lists(Kernel, query),
        rays: [rays_max]TraversalRay,
        places: [rays_max]Place,
        count: usize,
        /// Those that have a hit, or of several hits one that stops them.
        found: Set,

        const Self = @This();
        const Node = world_file.Node(Kernel.width);
        const Pack = world_file.TrianglePack(Kernel.width);
        /// A child still to be visited, and by whom.
        const Entry = struct { child: world_file.Child, set: Set };
        /// Entries at most: that the next leaves the stack before children of the present one come
        /// onto it makes two ways down the tree at a time, each of which leaves siblings behind.
        const entries_max = 2 * Kernel.stack_max + Kernel.width;

        /// For rays of this bundle. In place: it is too large to be handed around.
        pub fn init(
            stream: *Self,
            geometry: *const Geometry,
            bundle: *bundle_file.Bundle(Kernel),
            lists: Lists(Kernel, query),
        ) void {
            stream.geometry = geometry;
            stream.bundle = bundle;
            stream.lists = lists;
            stream.count = 0;
            stream.found = 0;
        }

        /// Takes the active rays of some groups, of which `views` are the views, from the given one
        /// of the bundle on. Hits may be kept now or later, see `finish`; which rays are active is
        /// for the caller to set again.
        pub fn take(
            stream: *Self,
            first_group: usize,
            views: []const bundle_file.Precalculations(Rays),
            counts: *TestCounts,
        ) void {
            const groups = stream.bundle.groups[first_group..][0..views.len];
            for (groups, views, first_group..) |*group, *view, number| {
                if (group.active.none()) continue;
                const fusable = group.active.bitAnd(view.fusable);
                var bits = fusable.bits();
                while (bits != 0) : (bits &= bits - 1) {
                    if (stream.count == rays_max) stream.finish(counts);
                    const lane = @ctz(bits);
                    stream.rays[stream.count] = .of(Rays, true, group, view, lane);
                    stream.places[stream.count] = .{ .group = @intCast(number), .lane = lane };
                    stream.count += 1;
                }
                const others = group.active.andNot(fusable);
                if (others.none()) continue;
                group.active = others;
                if (query == .multi_hit)
                    stream.lists.traceEach(stream.bundle, number, view, counts)
                else
                    single.traceEach(Kernel, query, stream.geometry, group, view, counts);
            }
        }

        /// Traces all rays that were taken and keeps their hits.
        pub fn finish(stream: *Self, counts: *TestCounts) void {
            if (stream.count == 0) return;
            stream.travel(counts);
            var rest: Set = if (query == .multi_hit) 0 else stream.found;
            while (rest != 0) : (rest &= rest - 1) {
                const ray = &stream.rays[@ctz(rest)];
                const place = stream.places[@ctz(rest)];
                const closest = &stream.bundle.groups[place.group].closest;
                var ts = closest.t.toArray();
                var primitives = closest.primitive.toArray();
                ts[place.lane] = ray.limit;
                primitives[place.lane] = ray.closest_primitive;
                closest.* = .{ .t = .fromArray(ts), .primitive = .fromArray(primitives) };
            }
            stream.count = 0;
            stream.found = 0;
        }

        fn travel(stream: *Self, counts: *TestCounts) void {
            const tree = stream.geometry.tree.get(Kernel.width);
            var entries: [entries_max]Entry = undefined;
            var entry_count: usize = 0;
            const all = @as(Set, std.math.maxInt(Set)) >> @intCast(rays_max - stream.count);
            var entry: Entry = .{ .child = .root, .set = all };
            while (true) {
                const next = stream.pop(&entries, &entry_count);
                const set = stream.looking(entry.set);
                if (entry.child.pack_count > 0) {
                    if (entry.child.isCluster()) {
                        @branchHint(.unlikely);
                        stream.enterCluster(set, entry.child.target, counts);
                        entry = next orelse stream.pop(&entries, &entry_count) orelse return;
                        continue;
                    }
                    const first, const end = entry.child.packs();
                    stream.intersect(set, tree.packs[first..end], counts);
                } else if (set != 0) {
                    assert(entry_count + Kernel.width <= entries_max);
                    const node = &tree.nodes[entry.child.target];
                    entry_count = stream.enter(set, node, &entries, entry_count, counts);
                }
                entry = next orelse stream.pop(&entries, &entry_count) orelse return;
            }
        }

        /// The next child that any ray still has to visit, on its way here from memory.
        inline fn pop(stream: *const Self, entries: []const Entry, entry_count: *usize) ?Entry {
            while (entry_count.* > 0) {
                entry_count.* -= 1;
                const entry = entries[entry_count.*];
                if (stream.looking(entry.set) == 0) continue;
                stream.geometry.tree.get(Kernel.width).prefetch(entry.child);
                return entry;
            }
            return null;
        }

        /// Those of a mask that have not yet found what they look for.
        inline fn looking(stream: *const Self, set: Set) Set {
            return if (query == .closest_hit) set else set & ~stream.found;
        }

        /// One active ray after the other through the tree of an instance's cluster.
        noinline fn enterCluster(
            stream: *Self,
            set: Set,
            reference: u32,
            counts: *TestCounts,
        ) void {
            const geometry = stream.geometry;
            const tree = walk.clusterOf(Kernel, geometry, reference).tree();
            var rest = set;
            while (rest != 0) : (rest &= rest - 1) {
                const number = @ctz(rest);
                const ray = &stream.rays[number];
                var search: Search = if (query == .multi_hit)
                    .of(stream.lists, stream.places[number], ray)
                else
                    .of(ray, &geometry.padding);
                if (walk.walkTree(Kernel, geometry, tree, &search, counts))
                    stream.found |= @as(Set, 1) << @intCast(number);
            }
        }

        /// Of a ray by itself.
        const Search = if (query == .multi_hit)
            multi_hit.HitLists(Kernel).Search(true)
        else
            single.Search(Kernel, query, true);

        /// One active ray after the other against the triangles of a leaf.
        inline fn intersect(
            stream: *Self,
            set: Set,
            packs: []const Pack,
            counts: *TestCounts,
        ) void {
            var rest = set;
            while (rest != 0) : (rest &= rest - 1) {
                const number = @ctz(rest);
                const ray = &stream.rays[number];
                for (packs) |*pack| {
                    const found = if (query == .multi_hit)
                        stream.lists.take(stream.places[number], ray, pack, counts)
                    else
                        ray.intersect(pack, &stream.geometry.padding, counts);
                    if (!found) continue;
                    stream.found |= @as(Set, 1) << @intCast(number);
                    if (query == .multi_hit) break;
                }
            }
        }

        /// Pushes the children that active rays enter, the one that any of them enters first on
        /// top. Returns the new count.
        inline fn enter(
            stream: *const Self,
            set: Set,
            node: *const Node,
            entries: []Entry,
            entry_count: usize,
            counts: *TestCounts,
        ) usize {
            const inf: F32 = .splat(std.math.inf(f32));
            var near = inf;
            // By child, whose rays they are.
            var words: [word_count]I32 = undefined;
            inline for (&words, 0..) |*word, index| {
                word.* = .zero();
                var rest: u32 = @truncate(set >> index * word_bits);
                while (rest != 0) : (rest &= rest - 1) {
                    const ray = &stream.rays[index * word_bits + @ctz(rest)];
                    const range = ray.slabsOf().meet(true, node, ray.limit, counts);
                    const met = range.isMet();
                    near = near.minFast(.select(met, range.near, inf));
                    const bit: i32 = @bitCast(rest & (~rest + 1));
                    word.* = word.bitOr(.select(met, .splat(bit), .zero()));
                }
            }
            const met = near.lt(inf);
            var sets: [word_count][Kernel.width]i32 = undefined;
            for (&sets, words) |*array, word| array.* = word.toArray();
            const ranks: stack_file.Ranks(Boxes) = .of(met, near);
            var rest = met.bits();
            const count = entry_count + @popCount(rest);
            while (rest != 0) : (rest &= rest - 1) {
                const child = @ctz(rest);
                var entered: Set = 0;
                for (sets, 0..) |array, index| {
                    const word: Set = @as(u32, @bitCast(array[child]));
                    entered |= word << @intCast(index * word_bits);
                }
                entries[entry_count + ranks.farther(child)] =
                    .{ .child = node.child[child], .set = entered };
            }
            return count;
        }
    };
}
