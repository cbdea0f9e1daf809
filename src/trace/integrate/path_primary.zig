//! Where paths begin and end: primary rays from the camera, samples on the film.
//!
//! In: the frame, an area of pixels. Out: records of paths whose primary rays have been traced, as
//! beams where the variant has these; in the end their light.

const std = @import("std");
const dispatch = @import("../traverse/dispatch.zig");
const ray_file = @import("../traverse/ray.zig");
const camera = @import("camera.zig");
const floor = @import("floor.zig");
const path_features = @import("path_features.zig");
const records_file = @import("path_records.zig");
const Film = @import("../../film.zig").Film;
const PathTracer = @import("path_tracer.zig").PathTracer;
const Record = records_file.Record;
const Rectangle = @import("../../film.zig").Rectangle;

/// Starts the paths of some samples with their primary rays. Returns how many there are.
pub fn start(comptime Kernel: type, tracer: *PathTracer(Kernel), sample_count: u32) usize {
    const all = tracer.step.rectangle;
    var count: usize = 0;
    for (0..sample_count) |sample| {
        var y = all.y0;
        while (y < all.y1) : (y += Kernel.bundle_height) {
            var x = all.x0;
            while (x < all.x1) : (x += Kernel.bundle_width) {
                const part: Rectangle = .{
                    .x0 = x,
                    .y0 = y,
                    .x1 = @min(x + Kernel.bundle_width, all.x1),
                    .y1 = @min(y + Kernel.bundle_height, all.y1),
                };
                trace(Kernel, tracer, part, @intCast(sample));
                count = take(Kernel, tracer, part, @intCast(sample), count);
            }
        }
    }
    tracer.rays.count(0, .{ .closest = count });
    return count;
}

fn trace(
    comptime Kernel: type,
    tracer: *PathTracer(Kernel),
    part: Rectangle,
    sample: u32,
) void {
    const frame = tracer.frame;
    const path = &tracer.step.path;
    const number = tracer.step.first_sample + sample;
    const offset = tracer.settings.offsets[number];
    camera.primaryRays(Kernel, frame.view, part, offset, &path.bundle);
    path.start();
    if (frame.needsFootprints())
        path.startCones(camera.footprint(frame.view, tracer.settings.sample_count));
    tracer.floor_light = @splat(.splat(1));
    if (frame.environment.floor_height != null) {
        path.depth = 0;
        tracer.rays.shadow += floor.lightShare(
            Kernel,
            &tracer.visibility,
            &tracer.environment_lights,
            number,
            path,
            &tracer.floor_points,
            &tracer.floor_light,
        );
    }
    const grid = camera.grid(frame.view, part, offset);
    const known = if (grid) |*one| one else null;
    const tests = &tracer.visibility.tests;
    _ = dispatch.closestHit(Kernel, frame.geometry, &path.bundle, known, tests);
}

/// Makes records of the primary rays of a bundle. Returns how many paths there are then.
fn take(
    comptime Kernel: type,
    tracer: *PathTracer(Kernel),
    part: Rectangle,
    sample: u32,
    first: usize,
) usize {
    const Rays = Kernel.Rays;
    const path = &tracer.step.path;
    const has_cones = tracer.frame.needsFootprints();
    var count = first;
    for (&path.bundle.groups, 0..) |*ray, group| {
        const origins: records_file.Stored(Rays) = .of(ray.line.origin);
        const directions: records_file.Stored(Rays) = .of(ray.line.direction);
        const ts = ray.closest.t.toArray();
        const primitives = ray.closest.primitive.toArray();
        var bits = ray.active.bits();
        while (bits != 0) : (bits &= bits - 1) {
            const lane = @ctz(bits);
            const number = Record.numberOf(
                sample,
                part.x0 - tracer.step.rectangle.x0 + Kernel.pixelX(group, lane),
                part.y0 - tracer.step.rectangle.y0 + Kernel.pixelY(group, lane),
            );
            tracer.records[number] = .{
                .origin = origins.at(lane),
                .direction = directions.at(lane),
                .start_t = 0,
                .start_primitive = std.math.maxInt(i32),
                .t = ts[lane],
                .primitive = primitives[lane],
                .skip = ray_file.no_primitive,
                .throughput = .{ 1, 1, 1 },
                .sigma_t = .{ 0, 0, 0 },
                .nesting = .air,
                .cone_width = if (has_cones) path.cone_width[group].lane(lane) else 0,
                .cone_spread = if (has_cones) path.cone_spread[group].lane(lane) else 0,
                .scatter_pdf = 0,
                .receiver = .{ 0, 0, 0 },
                .receiver_normal = .{ 0, 0, 0 },
                .depth = 0,
                .scatter_count = 0,
                .transparency_depth = 0,
                .radiance = .{ 0, 0, 0 },
                .escaped = 0,
                .displayed = .{ 0, 0, 0 },
                .display_share = 0,
                .floor_light = tracer.floor_light[group].lane(lane),
            };
            if (tracer.step.keeps_features) tracer.step.features[number] = .start;
            tracer.live[count] = number;
            count += 1;
        }
    }
    return count;
}

/// Adds a sample of each pixel to the film; what is not a number is none.
pub fn expose(step: anytype, sample: u32, film: *Film) void {
    const all = step.rectangle;
    const number = step.first_sample + sample;
    for (all.y0..all.y1) |y| for (all.x0..all.x1) |x| {
        const place = Record.numberOf(sample, @intCast(x - all.x0), @intCast(y - all.y0));
        const record = &step.records[place];
        const column, const row = all.placeOf(@intCast(x), @intCast(y));
        var light = record.radiance;
        if (!std.math.isFinite(light[0] + light[1] + light[2])) light = .{ 0, 0, 0 };
        film.add(column, row, number, light ++ .{record.escaped});
        if (step.keeps_features)
            path_features.expose(&step.features[place], film, column, row, number);
        if (!step.keeps_display) continue;
        const shown = record.displayed ++ .{record.display_share};
        film.addApart(.display, column, row, number, shown);
    };
}
