//! All of an animation at once, for framing: what is drawn, posed at many moments.
//!
//! In: a scene, what is loaded of it, and which animations run. Out: a geometry that holds the
//! triangles of all moments, in which framing finds every place that something comes to. The
//! moments are the times of all keys and, as long as there are few, the middles between them; where
//! the scene is large or keys are many, they are fewer and evenly spread. Neither a moment that is
//! shown nor the threads have a say, so that all pictures of an animation have one frame.

const std = @import("std");
const animate = @import("animate.zig");
const flatten = @import("flatten.zig");
const parallel = @import("../parallel.zig");
const pose_file = @import("pose.zig");
const scene = @import("../scene.zig");
const world = @import("../world.zig");
const Allocator = std.mem.Allocator;
const Diagnostic = @import("../diagnostic.zig").Diagnostic;
const Drawn = @import("drawn.zig");
const Parts = @import("alpha.zig").Parts;
const TextureSet = @import("texture.zig").TextureSet;
const Vec3d = @import("../math.zig").Vec3d;
const Motion = @This();

arena: std.heap.ArenaAllocator,
geometry: world.Geometry,
/// What has been subtracted from all places.
shift: Vec3d,

/// Moments at most.
pub const moment_count_max = 256;

/// Below so many, there is one more between any two.
const moment_count_few = 64;

/// Vertices, nodes and pairs of triangles of all moments at most, unless there are two moments.
const element_count_max = 4 << 20;

/// Frees everything.
pub fn deinit(motion: *Motion) void {
    motion.arena.deinit();
    motion.* = undefined;
}

/// Gathers; null where nothing moves. `shift` is what was subtracted from all places of the pose
/// that is shown.
pub fn gather(
    gpa: Allocator,
    from: *const scene.Scene,
    parts: *const Parts,
    textures: *const TextureSet,
    running: animate.Running,
    shift: Vec3d,
    pool: *parallel.Pool,
) flatten.Error!?Motion {
    const all = try timesOf(gpa, from, running);
    defer gpa.free(all);
    if (all.len == 0) return null;
    var element_count: u64 = from.nodes.len;
    for (parts.instances) |*instance| {
        const mesh = &parts.meshes[instance.mesh];
        element_count += @max(mesh.positions.len, mesh.triangles.len / 2);
    }
    var motion: Motion = .{ .arena = .init(gpa), .geometry = .empty, .shift = shift };
    errdefer motion.deinit();
    var scratch_state: std.heap.ArenaAllocator = .init(gpa);
    defer scratch_state.deinit();
    const scratch = scratch_state.allocator();
    var unheard: Diagnostic = .{}; // The pose that is shown says what there is to say.
    const plan: flatten.Plan = try .init(scratch, parts.instances, parts.meshes, 1, &unheard);
    var gathered: Gathered = .{
        .arena = motion.arena.allocator(),
        .arrays = try plan.alloc(scratch, .{}),
        .plan = plan,
    };
    const count = momentCount(all.len, element_count);
    for (0..count) |index| {
        const place = if (count == 1) 0 else index * (all.len - 1) / (count - 1);
        try gathered.add(gpa, from, parts, textures, .{
            .running = running,
            .time_s = all[place],
        }, shift, pool);
    }
    motion.geometry.positions = gathered.positions.items;
    motion.geometry.colors = gathered.colors.items;
    motion.geometry.triangles = gathered.triangles.items;
    motion.geometry.surface_count = @intCast(gathered.triangles.items.len);
    motion.geometry.spheres = gathered.spheres.items;
    return motion;
}

/// How many of the moments are posed, each of so many elements.
fn momentCount(all: usize, element_count: u64) usize {
    const most = @max(2, element_count_max / @max(element_count, 1));
    return @min(all, most);
}

const Gathered = struct {
    arena: Allocator,
    plan: flatten.Plan,
    /// Of one moment after the other.
    arrays: flatten.Arrays,
    positions: std.ArrayList([3]f32) = .empty,
    colors: std.ArrayList([4]f32) = .empty,
    triangles: std.ArrayList(world.Triangle) = .empty,
    spheres: std.ArrayList(world.Sphere) = .empty,

    fn add(
        gathered: *Gathered,
        gpa: Allocator,
        from: *const scene.Scene,
        parts: *const Parts,
        textures: *const TextureSet,
        moment: animate.Moment,
        shift: Vec3d,
        pool: *parallel.Pool,
    ) flatten.Error!void {
        var scratch_state: std.heap.ArenaAllocator = .init(gpa);
        defer scratch_state.deinit();
        const scratch = scratch_state.allocator();
        const shown = try animate.at(scratch, from, moment);
        const drawn: Drawn = try .of(scratch, &shown, parts, textures);
        const place = try pose_file.composeShifted(scratch, &shown, shift);
        var unheard: Diagnostic = .{};
        const soup = try gathered.plan.place(
            gpa,
            scratch,
            &gathered.arrays,
            drawn.parts.instances,
            drawn.parts.meshes,
            &place,
            pool,
            &unheard,
        );
        const first: u32 = @intCast(gathered.positions.items.len);
        const own = soup.positions[0..soup.room.vertex_first];
        if (first + own.len > flatten.element_count_max) return error.SceneTooLarge;
        const arena = gathered.arena;
        try gathered.positions.appendSlice(arena, own);
        if (soup.colors.len > 0) try gathered.colors.appendSlice(arena, soup.colors[0..own.len]);
        for (soup.triangles[0..soup.surface_count]) |triangle| {
            if (triangle.isDropped()) continue;
            var moved = triangle;
            for (&moved.corner) |*corner| corner.* += first;
            try gathered.triangles.append(arena, moved);
        }
        for (soup.strokes.spheres) |sphere| try gathered.spheres.append(arena, .{
            .center = sphere.center + first,
            .material = sphere.material,
        });
    }
};

/// The moments, ascending; the caller frees them.
fn timesOf(
    gpa: Allocator,
    from: *const scene.Scene,
    running: animate.Running,
) error{OutOfMemory}![]const f64 {
    var times: std.ArrayList(f64) = .empty;
    defer times.deinit(gpa);
    var known: Lists = .empty;
    defer known.deinit(gpa);
    for (from.animations, 0..) |*animation, index| switch (running) {
        .none => {},
        .one => |one| if (one == index) try appendTimes(gpa, animation, &known, &times),
        .all => try appendTimes(gpa, animation, &known, &times),
    };
    std.mem.sortUnstable(f64, times.items, {}, std.sort.asc(f64));
    var count: usize = 0;
    for (times.items) |time| {
        if (count > 0 and times.items[count - 1] == time) continue;
        times.items[count] = time;
        count += 1;
    }
    times.shrinkRetainingCapacity(count);
    while (times.items.len > 1 and times.items.len < moment_count_few) {
        const few = times.items.len;
        try times.resize(gpa, 2 * few - 1);
        var index = few - 1;
        while (index > 0) : (index -= 1) {
            const behind = times.items[index];
            times.items[2 * index] = behind;
            times.items[2 * index - 1] = (times.items[index - 1] + behind) / 2;
        }
    }
    const kept = @min(times.items.len, moment_count_max);
    const all = try gpa.alloc(f64, kept);
    for (all, 0..) |*time, index| {
        time.* = times.items[if (kept == 1) 0 else index * (times.items.len - 1) / (kept - 1)];
    }
    return all;
}

/// Lists of times by their address: most channels share them.
const Lists = std.AutoHashMapUnmanaged([*]const f32, void);

fn appendTimes(
    gpa: Allocator,
    animation: *const scene.Animation,
    known: *Lists,
    times: *std.ArrayList(f64),
) error{OutOfMemory}!void {
    for (animation.channels) |*channel| {
        const own = channel.sampler.times;
        const entry = try known.getOrPut(gpa, own.ptr);
        if (entry.found_existing) continue;
        for (own) |time| try times.append(gpa, time);
    }
}

const testing = std.testing;

fn testChannel(times: []const f32, values: []const f32) scene.Channel {
    return .{ .target = .{ .translation = 0 }, .sampler = .{
        .times = times,
        .values = values,
        .width = 3,
        .interpolation = .linear,
    } };
}

test "one moment is enough, and large scenes have two" {
    try testing.expectEqual(1, momentCount(1, 8));
    try testing.expectEqual(65, momentCount(65, 0));
    try testing.expectEqual(4, momentCount(65, element_count_max / 4));
    try testing.expectEqual(2, momentCount(65, std.math.maxInt(u64)));
}

test "moments are the keys of what runs, and the middles between few" {
    const zeros: [600 * 3]f32 = @splat(0);
    var many: [600]f32 = undefined;
    for (&many, 0..) |*time, index| time.* = @floatFromInt(index);
    var from: scene.Scene = .init(testing.allocator);
    defer from.deinit();
    from.animations = &.{
        .{ .channels = &.{
            testChannel(&.{ 0, 2 }, zeros[0..6]), testChannel(&.{1}, zeros[0..3]),
        } },
        .{ .channels = &.{testChannel(&many, &zeros)} },
        .{ .channels = &.{testChannel(&.{7}, zeros[0..3])} },
    };
    const few = try timesOf(testing.allocator, &from, .{ .one = 0 });
    defer testing.allocator.free(few);
    try testing.expectEqual(65, few.len);
    for (few, 0..) |time, index| {
        try testing.expectEqual(@as(f64, @floatFromInt(index)) / 32, time);
    }
    const most = try timesOf(testing.allocator, &from, .{ .one = 1 });
    defer testing.allocator.free(most);
    try testing.expectEqual(moment_count_max, most.len);
    try testing.expectEqual(0, most[0]);
    try testing.expectEqual(599, most[most.len - 1]);
    const one = try timesOf(testing.allocator, &from, .{ .one = 2 });
    defer testing.allocator.free(one);
    try testing.expectEqualSlices(f64, &.{7}, one);
    const none = try timesOf(testing.allocator, &from, .none);
    defer testing.allocator.free(none);
    try testing.expectEqual(0, none.len);
}
