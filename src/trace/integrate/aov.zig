//! What primary rays see, without any light: arbitrary output variables (AOVs) of
//! hits, normals or texture coordinates.
//!
//! In: the frame, a bundle's place in the picture. Out: on the film's layer of origins, of all
//! surfaces that the first sample's ray goes through, the one that it sees the largest share of,
//! the nearest of those alike; or samples of colours of the display.

const std = @import("std");
const film_file = @import("../../film.zig");
const math = @import("../../math.zig");
const statistics = @import("../../statistics.zig");
const world_file = @import("../../world.zig");
const ray_file = @import("../traverse/ray.zig");
const interaction_file = @import("../shade/interaction.zig");
const camera = @import("camera.zig");
const path_file = @import("path.zig");
const tiles = @import("tiles.zig");
const visibility_file = @import("visibility.zig");
const Film = film_file.Film;
const Frame = world_file.Frame;
const Grid = @import("../traverse/beam/grid.zig").Grid;
const OwnFrame = @import("../traverse/own_frame.zig").OwnFrame;
const Rectangle = film_file.Rectangle;

/// What is left on the film in place of light.
pub const Aov = enum {
    /// Hits, by the first sample alone.
    hits,
    /// A picture of unit normals in the world's axes: code 128 is 0, 255 is 1.
    normals,
    /// A picture of texture coordinates of the first set, less what is whole: u is red, v green.
    texcoords,
};

/// One thread's integrator.
pub fn AovIntegrator(comptime Kernel: type) type {
    const Rays = Kernel.Rays;
    const F32 = Rays.F32;
    const I32 = Rays.I32;
    const Vec3 = Rays.Vec3;
    const group_count = Kernel.group_count;
    const Vertex = path_file.Vertex(Rays);

    return struct {
        const Self = @This();

        /// See `tiles.zig`.
        pub const width = Kernel.bundle_width;
        /// See `tiles.zig`.
        pub const height = Kernel.bundle_height;
        /// See `tiles.zig`.
        pub const counts_tests = false;

        frame: *const Frame,
        own_frame: OwnFrame(Kernel),
        settings: *const tiles.Settings,
        rays: statistics.RayCounts,
        visibility: visibility_file.Visibility(Kernel),
        /// Directions of the rays of the sample under way, where they share an origin.
        grid: ?Grid,
        stack: path_file.PathStack(Kernel),
        /// Of the step under way.
        path: path_file.PathState(Kernel),
        vertices: [group_count]Vertex,
        /// Of the sample under way: the largest share so far, and what has it.
        largest: [group_count]F32,
        primitive: [group_count]I32,
        weights: [group_count][2]F32,
        /// Colours of the display, and the share of the pixel that has some.
        color: [group_count]Vec3,
        share: [group_count]F32,

        /// To be freed by `deinit`.
        pub fn init(
            gpa: std.mem.Allocator,
            shared_frame: *const Frame,
            settings: *const tiles.Settings,
        ) error{OutOfMemory}!*Self {
            const aovs = try gpa.create(Self);
            errdefer gpa.destroy(aovs);
            const frame = try aovs.own_frame
                .init(gpa, shared_frame, settings.pool.thread_count);
            errdefer aovs.own_frame.deinit(gpa);
            aovs.stack = try .init(gpa, 0, frame.hasLayers());
            aovs.frame = frame;
            aovs.settings = settings;
            aovs.rays = .{};
            aovs.visibility.init(frame);
            for (&aovs.vertices) |*vertex| vertex.init();
            return aovs;
        }

        /// Frees everything.
        pub fn deinit(aovs: *Self, gpa: std.mem.Allocator) void {
            aovs.stack.deinit(gpa);
            aovs.own_frame.deinit(gpa);
            gpa.destroy(aovs);
        }

        /// What all passes so far took.
        pub fn counts(aovs: *const Self) tiles.Counts {
            return .{ .rays = aovs.rays, .tests = aovs.visibility.tests };
        }

        /// Adds some samples of each pixel of a bundle to the film.
        pub fn pass(
            aovs: *Self,
            rectangle: Rectangle,
            first_sample: u32,
            sample_count: u32,
            film: *Film,
        ) void {
            for (first_sample..first_sample + sample_count) |sample| {
                const place: camera.Place =
                    .{ .rectangle = rectangle, .sample = @intCast(sample) };
                aovs.trace(place);
                aovs.expose(film, place);
            }
        }

        fn trace(aovs: *Self, place: camera.Place) void {
            aovs.largest = @splat(.zero());
            aovs.primitive = @splat(.splat(ray_file.no_primitive));
            aovs.weights = @splat(@splat(.zero()));
            aovs.color = @splat(.splat(.{ 0, 0, 0 }));
            aovs.share = @splat(.zero());
            aovs.pushPrimary(place);
            while (aovs.stack.pop()) |path| {
                aovs.path = path.*;
                const is_first = path.transparency_depth == 0;
                const grid = if (aovs.grid) |*grid| grid else null;
                _ = aovs.visibility.closest(&aovs.path, if (is_first) grid else null);
                for (&aovs.vertices, 0..) |*vertex, group| {
                    vertex.find(&aovs.visibility, &aovs.path, group);
                    if (vertex.seen.any()) aovs.put(group, vertex);
                }
                aovs.stack.pushRest(&aovs.path, &aovs.vertices);
            }
        }

        fn pushPrimary(aovs: *Self, place: camera.Place) void {
            const view = aovs.frame.view;
            const offset = aovs.settings.offsets[place.sample];
            aovs.grid = camera.grid(view, place.rectangle, offset);
            const path = aovs.stack.push(0, 0);
            camera.primaryRays(Kernel, view, place.rectangle, offset, &path.bundle);
            path.start();
            if (aovs.frame.needsFootprints())
                path.startCones(camera.footprint(view, aovs.settings.sample_count));
            aovs.rays.count(0, .{ .closest = place.rectangle.pixelCount() });
        }

        /// Takes what rays of a group see.
        fn put(aovs: *Self, group: usize, vertex: *const Vertex) void {
            const ray = &aovs.path.bundle.groups[group];
            const share: F32 = .select(vertex.seen, vertex.throughput.x, .zero());
            aovs.share[group] = aovs.share[group].add(share);
            const corners: interaction_file.Corners(Rays) =
                .of(aovs.frame.geometry, ray.closest.primitive, vertex.seen);
            const hit = visibility_file.hitOf(Rays, ray, &corners, vertex.seen);
            const weights = hit.barycentrics[1..3].*;
            switch (aovs.settings.aov) {
                .hits => {
                    const is_larger = share.gt(aovs.largest[group]);
                    const primitive = &aovs.primitive[group];
                    primitive.* = .select(is_larger, ray.closest.primitive, primitive.*);
                    for (&aovs.weights[group], weights) |*to, weight| {
                        to.* = .select(is_larger, weight, to.*);
                    }
                    aovs.largest[group] = aovs.largest[group].max(share);
                },
                .normals => {
                    const half: Vec3 = .splat(.{ 0.5, 0.5, 0.5 });
                    aovs.paint(group, share, vertex.point.normal.mul(half).add(half));
                },
                .texcoords => {
                    const places = aovs.texcoords(ray.closest.primitive, weights, vertex.seen);
                    aovs.paint(group, share, places);
                },
            }
        }

        /// Adds colours, whose codes are 0..1 in lanes of a share above 0.
        fn paint(aovs: *Self, group: usize, share: F32, codes: Vec3) void {
            var channels = [3][Kernel.ray_count]f32{
                codes.x.toArray(), codes.y.toArray(), codes.z.toArray(),
            };
            const shares = share.toArray();
            for (&channels) |*channel| for (channel, shares) |*value, weight| {
                value.* = if (weight > 0) math.srgb.decoded[codeOf(value.*)] else 0;
            };
            const color: Vec3 = .{
                .x = .fromArray(channels[0]),
                .y = .fromArray(channels[1]),
                .z = .fromArray(channels[2]),
            };
            aovs.color[group] = aovs.color[group].add(color.scale(share));
        }

        fn codeOf(value: f32) u8 {
            // What is not a number is 0.
            return if (value > 0) @intFromFloat(@min(value, 1) * 255 + 0.5) else 0;
        }

        fn texcoords(aovs: *const Self, primitive: I32, weights: [2]F32, seen: Rays.Mask) Vec3 {
            const geometry = aovs.frame.geometry;
            const numbers = primitive.toArray();
            const second = weights[0].toArray();
            const third = weights[1].toArray();
            var places: [2][Kernel.ray_count]f32 = @splat(@splat(0));
            var rest = seen.bits();
            while (rest != 0) : (rest &= rest - 1) {
                const lane = @ctz(rest);
                const face = geometry.face(@intCast(numbers[lane]));
                const at = face.texcoordAt(geometry, 0, .{ second[lane], third[lane] });
                for (&places, at) |*to, value| to[lane] = value - @floor(value);
            }
            return .{ .x = .fromArray(places[0]), .y = .fromArray(places[1]), .z = .zero() };
        }

        fn expose(aovs: *const Self, film: *Film, place: camera.Place) void {
            if (aovs.settings.aov == .hits) return aovs.exposeHits(film, place.rectangle);
            const none: [group_count]Vec3 = @splat(.splat(.{ 0, 0, 0 }));
            var escaped: [group_count]F32 = undefined;
            for (&escaped, aovs.share) |*to, share| to.* = F32.splat(1).sub(share);
            camera.expose(Kernel, film, .color, place, &none, &escaped);
            camera.expose(Kernel, film, .display, place, &aovs.color, &aovs.share);
        }

        fn exposeHits(aovs: *const Self, film: *Film, rectangle: Rectangle) void {
            const image = film.imageOf(.origin).?;
            for (&aovs.primitive, &aovs.weights, 0..) |*primitive, *weights, group| {
                const numbers = primitive.toArray();
                const second = weights[0].toArray();
                const third = weights[1].toArray();
                for (numbers, 0..) |number, lane| {
                    const x = rectangle.x0 + rectangle.step * Kernel.pixelX(group, lane);
                    const y = rectangle.y0 + rectangle.step * Kernel.pixelY(group, lane);
                    if (x >= rectangle.x1 or y >= rectangle.y1) continue;
                    const bits: f32 = @bitCast(number);
                    const column, const row = rectangle.placeOf(x, y);
                    image.at(column, row).* = .{ bits, second[lane], third[lane], 0 };
                }
            }
        }

        comptime {
            // Bits of a number that there is none for.
            std.debug.assert(@as(u32, @bitCast(@as(i32, ray_file.no_primitive))) ==
                film_file.no_triangle);
        }
    };
}
