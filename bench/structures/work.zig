//! The rays: one a pixel, a shadow ray and a mirror ray a hit, tile by tile.
//!
//! In: a setup, and a tracer with `trace(query, group)`. Out: counts and a hash of all hits. Rays
//! of a tile are made first and traced then, so that phases are marked a few times a tile.

const std = @import("std");
const raylane = @import("raylane");
const phases = @import("../rays/phases.zig");
const workload = @import("../rays/workload.zig");
const ray_file = raylane.trace.ray;
const vec3 = raylane.math.vec3;
const Vec3 = raylane.math.Vec3;

const side = 16;
const ray_count = side * side;

/// What came of a picture.
pub const Counts = struct {
    primary: u64 = 0,
    hits: u64 = 0,
    occluded: u64 = 0,
    reflection_hits: u64 = 0,
    hash: u64 = 0,
};

/// One ray as the workload has it.
const Course = struct { origin: Vec3, direction: Vec3, skip: i32, limit: f32 };
/// What it hit; `primitive` is `no_primitive` for nothing.
const Hit = struct { t: f32, primitive: i32 };

/// Traces a picture of `setup.size` pixels, a multiple of 16, each side.
pub fn run(
    comptime Lanes: type,
    tracer: anytype,
    setup: *const workload.Setup,
    marks: *phases.Marks,
) Counts {
    var counts: Counts = .{};
    var hasher: std.hash.XxHash64 = .init(0);
    var y: u32 = 0;
    while (y < setup.size) : (y += side) {
        var x: u32 = 0;
        while (x < setup.size) : (x += side) {
            runTile(Lanes, tracer, setup, marks, .{ x, y }, &counts, &hasher);
        }
    }
    marks.to(.other);
    counts.hash = hasher.final();
    return counts;
}

fn runTile(
    comptime Lanes: type,
    tracer: anytype,
    setup: *const workload.Setup,
    marks: *phases.Marks,
    corner: [2]u32,
    counts: *Counts,
    hasher: *std.hash.XxHash64,
) void {
    marks.to(.generation);
    var courses: [ray_count]?Course = undefined;
    var hits: [ray_count]Hit = undefined;
    for (&courses, 0..) |*course, index| course.* = primaryCourse(setup, corner, index);
    counts.primary += ray_count;
    traceAll(Lanes, .closest_hit, tracer, &courses, &hits, marks, .primary);

    var shadows: [ray_count]?Course = undefined;
    var mirrors: [ray_count]?Course = undefined;
    for (&courses, &hits, &shadows, &mirrors) |course, hit, *shadow, *mirror| {
        hasher.update(std.mem.asBytes(&hit));
        shadow.*, mirror.* = if (hit.primitive == ray_file.no_primitive)
            .{ null, null }
        else
            bounce(setup, course.?, hit);
        counts.hits += @intFromBool(shadow.* != null);
    }
    traceAll(Lanes, .any_hit, tracer, &shadows, &hits, marks, .shadow);
    for (&shadows, &hits) |shadow, hit| {
        const is_dark = shadow != null and hit.primitive != ray_file.no_primitive;
        counts.occluded += @intFromBool(is_dark);
        hasher.update(if (is_dark) "1" else "0");
    }
    traceAll(Lanes, .closest_hit, tracer, &mirrors, &hits, marks, .bounce);
    for (&mirrors, &hits) |mirror, hit| if (mirror != null) {
        hasher.update(std.mem.asBytes(&hit));
        counts.reflection_hits += @intFromBool(hit.primitive != ray_file.no_primitive);
    };
}

/// Squares of 2x2 pixels, one after the other.
fn primaryCourse(setup: *const workload.Setup, corner: [2]u32, index: usize) Course {
    const square = index / 4;
    const x: f32 = @floatFromInt(corner[0] + square % (side / 2) * 2 + index % 2);
    const y: f32 = @floatFromInt(corner[1] + square / (side / 2) * 2 + index / 2 % 2);
    const across = vec3.scale(setup.across, x);
    const down = vec3.scale(setup.down, y);
    return .{
        .origin = setup.eye,
        .direction = vec3.add(setup.corner, vec3.add(across, down)),
        .skip = ray_file.no_primitive,
        .limit = std.math.inf(f32),
    };
}

/// The shadow ray, from the light, and the mirror ray of a hit.
fn bounce(setup: *const workload.Setup, course: Course, hit: Hit) struct { Course, Course } {
    var normal: Vec3 = setup.normals[@intCast(hit.primitive + 1)][0..3].*;
    if (vec3.dot(normal, course.direction) > 0) normal = vec3.neg(normal);
    const surface = vec3.add(course.origin, vec3.scale(course.direction, hit.t));
    const point = vec3.add(surface, vec3.scale(normal, setup.offset));
    const along = 2 * vec3.dot(course.direction, normal);
    return .{ .{
        .origin = setup.light,
        .direction = vec3.sub(point, setup.light),
        .skip = hit.primitive,
        .limit = workload.shadow_end,
    }, .{
        .origin = point,
        .direction = vec3.sub(course.direction, vec3.scale(normal, along)),
        .skip = hit.primitive,
        .limit = std.math.inf(f32),
    } };
}

fn traceAll(
    comptime Lanes: type,
    comptime query: raylane.trace.walk.Query,
    tracer: anytype,
    courses: *const [ray_count]?Course,
    hits: *[ray_count]Hit,
    marks: *phases.Marks,
    phase: phases.Phase,
) void {
    var groups: [ray_count / Lanes.count]ray_file.Ray(Lanes) = undefined;
    marks.to(.generation);
    for (&groups, 0..) |*group, index| {
        group.* = gather(Lanes, courses[index * Lanes.count ..][0..Lanes.count]);
    }
    marks.to(phase);
    for (&groups) |*group| tracer.trace(query, group);
    marks.to(.shading);
    for (&groups, 0..) |*group, index| for (0..Lanes.count) |lane| {
        hits[index * Lanes.count + lane] = .{
            .t = group.closest.t.lane(lane),
            .primitive = group.closest.primitive.lane(lane),
        };
    };
}

fn gather(comptime Lanes: type, courses: *const [Lanes.count]?Course) ray_file.Ray(Lanes) {
    var origins: [3][Lanes.count]f32 = @splat(@splat(0));
    var directions: [3][Lanes.count]f32 = @splat(@splat(1));
    var limits: [Lanes.count]f32 = @splat(0);
    var skips: [Lanes.count]i32 = @splat(ray_file.no_primitive);
    var active: u32 = 0;
    for (courses, 0..) |maybe, lane| {
        const course = maybe orelse continue;
        for (0..3) |axis| {
            origins[axis][lane] = course.origin[axis];
            directions[axis][lane] = course.direction[axis];
        }
        limits[lane] = course.limit;
        skips[lane] = course.skip;
        active |= @as(u32, 1) << @intCast(lane);
    }
    return .{
        .line = .init(vectors(Lanes, &origins), vectors(Lanes, &directions)),
        .tnear = .start(),
        .closest = .before(.fromArray(limits)),
        .skip = .fromArray(skips),
        .active = .fromBits(active),
    };
}

fn vectors(comptime Lanes: type, axes: *const [3][Lanes.count]f32) Lanes.Vec3 {
    return .{
        .x = .fromArray(axes[0]),
        .y = .fromArray(axes[1]),
        .z = .fromArray(axes[2]),
    };
}
