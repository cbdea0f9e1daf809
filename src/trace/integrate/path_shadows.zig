//! Shadow rays of paths: each to a light of its own, collected until lanes are full of them.
//!
//! In: points in lanes, the light that they would send on. Out: what of it arrives, added to the
//! radiance of their paths. They are traced sorted by direction.

const std = @import("std");
const bundle_file = @import("../traverse/bundle.zig");
const records_file = @import("path_records.zig");
const visibility_file = @import("visibility.zig");
const assert = std.debug.assert;
const Record = records_file.Record;

/// A shadow ray under way.
const ShadowRecord = struct {
    origin: [3]f32,
    direction: [3]f32,
    /// Only what comes before counts, in units of the direction.
    end: f32,
    skip: i32,
    /// Of the path where the ray starts, in metres.
    cone_width: f32,
    /// 1: goes as if straight, see `Visibility.transmittanceOfEach`.
    straight: f32,
    /// What arrives unless something is in the way.
    light: [3]f32,
    /// Whose it is.
    path: u32,
};

/// Those of all paths under way, one each at most.
pub fn PathShadows(comptime Kernel: type) type {
    const Rays = Kernel.Rays;
    const F32 = Rays.F32;
    const Vec3 = Rays.Vec3;
    const Mask = Rays.Mask;
    const group_count = Kernel.group_count;
    const Visibility = visibility_file.Visibility(Kernel);
    return struct {
        records: []ShadowRecord,
        count: usize,
        /// Numbers of the records in the order in which they are traced, room to sort them, and by
        /// what.
        order: []u32,
        room: []u32,
        keys: []u16,
        /// Of the bundle under way.
        bundle: bundle_file.Bundle(Kernel),
        straight: [group_count]Mask,
        points: [group_count]Point,
        light: [group_count]Vec3,
        transmittances: [group_count]Vec3,

        const Self = @This();
        const Point = struct { point: struct { cone_width: F32 } };

        /// Shadow rays in lanes.
        pub const Ray = struct {
            lanes: Mask,
            origin: Vec3,
            direction: Vec3,
            end: F32,
            skip: Rays.I32,
            cone_width: F32,
            straight: Mask,
            light: Vec3,
        };

        /// To be freed by `deinit`.
        pub fn init(shadows: *Self, gpa: std.mem.Allocator) error{OutOfMemory}!void {
            const most = records_file.path_count_max;
            shadows.records = try gpa.alloc(ShadowRecord, most);
            errdefer gpa.free(shadows.records);
            shadows.order = try gpa.alloc(u32, most);
            errdefer gpa.free(shadows.order);
            shadows.room = try gpa.alloc(u32, most);
            errdefer gpa.free(shadows.room);
            shadows.keys = try gpa.alloc(u16, most);
            shadows.count = 0;
        }

        /// Frees everything.
        pub fn deinit(shadows: *Self, gpa: std.mem.Allocator) void {
            gpa.free(shadows.keys);
            gpa.free(shadows.room);
            gpa.free(shadows.order);
            gpa.free(shadows.records);
            shadows.* = undefined;
        }

        /// Takes the rays of a group of paths.
        pub fn take(shadows: *Self, ray: *const Ray, numbers: *const [Rays.count]u32) void {
            const Stored = records_file.Stored(Rays);
            const origins: Stored = .of(ray.origin);
            const directions: Stored = .of(ray.direction);
            const lights: Stored = .of(ray.light);
            const ends = ray.end.toArray();
            const skips = ray.skip.toArray();
            const widths = ray.cone_width.toArray();
            const straights = F32.select(ray.straight, .splat(1), .zero()).toArray();
            var bits = ray.lanes.bits();
            while (bits != 0) : (bits &= bits - 1) {
                const lane = @ctz(bits);
                shadows.records[shadows.count] = .{
                    .origin = origins.at(lane),
                    .direction = directions.at(lane),
                    .end = ends[lane],
                    .skip = skips[lane],
                    .cone_width = widths[lane],
                    .straight = straights[lane],
                    .light = lights.at(lane),
                    .path = numbers[lane],
                };
                shadows.count += 1;
            }
        }

        /// Traces all rays that were taken and adds what arrives.
        pub fn trace(shadows: *Self, visibility: *Visibility, paths: []Record) void {
            const order = shadows.order[0..shadows.count];
            const keys = shadows.keys[0..shadows.count];
            for (order, keys, shadows.records[0..shadows.count], 0..) |*to, *key, *record, at| {
                to.* = @intCast(at);
                key.* = records_file.wayOf(record.direction);
            }
            records_file.sort(order, keys, shadows.room);
            const most = group_count * Rays.count;
            var first: usize = 0;
            while (first < order.len) : (first += most) {
                const rest = order[first..];
                shadows.traceBundle(visibility, paths, rest[0..@min(rest.len, most)]);
            }
            shadows.count = 0;
        }

        fn traceBundle(
            shadows: *Self,
            visibility: *Visibility,
            paths: []Record,
            numbers: []const u32,
        ) void {
            var groups: [group_count][Rays.count]u32 = undefined;
            var active: [group_count]Mask = undefined;
            for (&groups, &active, 0..) |*group, *lanes, index| {
                lanes.* = .splat(false);
                const start = index * Rays.count;
                if (start < numbers.len)
                    lanes.* = .fromBits(records_file.groupOf(Rays, numbers[start..], group));
                shadows.load(index, group, lanes.*);
            }
            const transmittances = &shadows.transmittances;
            visibility.transmittanceOfEach(
                &shadows.bundle,
                &shadows.points,
                &shadows.straight,
                transmittances,
            );
            for (&groups, active, shadows.light, transmittances) |*group, lanes, light, share| {
                if (lanes.none()) continue;
                var owners: [Rays.count]u32 = undefined;
                for (&owners, group) |*owner, number| owner.* = shadows.records[number].path;
                const arriving = light.mul(share);
                records_file.addVectors(Rays, paths, &owners, "radiance", lanes, arriving);
            }
        }

        fn load(shadows: *Self, group: usize, numbers: *const [Rays.count]u32, lanes: Mask) void {
            const ray = &shadows.bundle.groups[group];
            ray.active = lanes;
            shadows.straight[group] = .splat(true);
            if (lanes.none()) return;
            const all = shadows.records;
            const floats = records_file.floats;
            const vectors = records_file.vectors;
            ray.* = .{
                .line = .init(
                    vectors(Rays, all, numbers, "origin"),
                    vectors(Rays, all, numbers, "direction"),
                ),
                .tnear = .start(),
                .closest = .before(floats(Rays, all, numbers, "end")),
                .skip = records_file.integers(Rays, all, numbers, "skip"),
                .active = lanes,
            };
            shadows.points[group].point.cone_width = floats(Rays, all, numbers, "cone_width");
            shadows.straight[group] = floats(Rays, all, numbers, "straight").gt(.zero());
            shadows.light[group] = vectors(Rays, all, numbers, "light");
        }
    };
}
