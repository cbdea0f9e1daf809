//! The workload: a picture by primary rays, shadow rays to one point light, and mirror bounces.
//!
//! In: a `Setup`. Out: a grey picture and what it took. The brightness of a hit is one Lambert term
//! of the triangle's own normal on the side that the ray came from, a tenth of it in shadow, times
//! `bounce_weight` after a bounce: so little besides traversal that traversal is what is measured.
//! All that is done for each pixel is done in lanes.

const std = @import("std");
const raylane = @import("raylane");
const batch_file = @import("batch.zig");
const phases = @import("phases.zig");
const tracer_file = @import("tracer.zig");
const observer_file = @import("observer.zig");
const processors = @import("processors.zig");
const Batch = batch_file.Batch;
const Marks = phases.Marks;
const Observer = observer_file.Observer;
const Vec3 = raylane.math.Vec3;
const assert = std.debug.assert;
const ray_count = batch_file.ray_count;
const side = batch_file.side;

const bounce_weight = 0.3;
const shadow_share = 0.1;
/// Where shadow rays end, on their way from the light to the point they are for.
pub const shadow_end = 0.9999;

/// What rays meet and where they come from, in metres; the same for all variants.
pub const Setup = struct {
    /// Pixels along each side of the picture, a multiple of `side`.
    size: u32,
    eye: Vec3,
    /// Direction through the middle of the upper left pixel.
    corner: Vec3,
    /// From a pixel's direction to its neighbour's on the right and below.
    across: Vec3,
    down: Vec3,
    light: Vec3,
    /// How far points are moved off their surfaces along the normal.
    offset: f32,
    /// Unit normals of the triangles, in `normals[1..]`; the first stands for no hit.
    normals: []align(16) const [4]f32,
    /// [axis][ray]: by how much directions differ from that of the tile's first pixel.
    spread: *align(64) const batch_file.Vectors,
};

/// How a picture is made.
pub const Settings = struct {
    /// Bounces at most.
    depth_max: u32,
    thread_count: usize,
    mode: phases.Mode,
    processors: []const u32,
};

/// What a picture took.
pub const Times = struct {
    total_ns: u64,
    /// Of all threads together, over their number.
    by_phase_ns: std.enums.EnumArray(phases.Phase, f64),
};

/// The workload by one variant.
pub fn Workload(comptime Kernel: type) type {
    return struct {
        setup: *const Setup,
        settings: Settings,
        world: *const raylane.world.World,
        /// size * size, row by row.
        pixels: []f32,
        observer: ?*Observer,
        next: std.atomic.Value(u32) = .init(0),
        spent: [raylane.parallel.thread_count_max]phases.Ticks = undefined,

        const Self = @This();
        const Lanes = Kernel.Boxes;
        const F32 = Lanes.F32;
        const I32 = Lanes.I32;

        /// Makes the picture. With an observer, asserts one thread.
        pub fn run(
            io: std.Io,
            setup: *const Setup,
            settings: Settings,
            world: *const raylane.world.World,
            pixels: []f32,
            observer: ?*Observer,
        ) Times {
            assert(pixels.len == @as(usize, setup.size) * setup.size);
            assert(observer == null or settings.thread_count == 1);
            var workload: Self = .{
                .setup = setup,
                .settings = settings,
                .world = world,
                .pixels = pixels,
                .observer = observer,
            };
            const start = std.Io.Clock.awake.now(io);
            const start_ticks = phases.ticks();
            raylane.parallel.run(settings.thread_count, &workload, work);
            const ticks: f64 = @floatFromInt(phases.ticks() - start_ticks);
            const total_ns: u64 = @intCast(start.untilNow(io, .awake).toNanoseconds());

            var times: Times = .{ .total_ns = total_ns, .by_phase_ns = .initFill(0) };
            for (workload.spent[0..settings.thread_count]) |*spent| {
                for (&times.by_phase_ns.values, spent.values) |*sum, part| {
                    sum.* += @as(f64, @floatFromInt(part));
                }
            }
            const thread_count: f64 = @floatFromInt(settings.thread_count);
            const tick_ns = @as(f64, @floatFromInt(total_ns)) / (ticks * thread_count);
            for (&times.by_phase_ns.values) |*sum| sum.* *= tick_ns;
            return times;
        }

        fn work(workload: *Self, thread_index: usize) void {
            processors.pin(workload.settings.processors, thread_index);
            var worker: Worker = .{
                .shared = workload,
                .tracer = .{ .world = workload.world },
                .marks = .init(workload.settings.mode),
                .rays = undefined,
                .shadows = undefined,
                .normal = undefined,
                .brightness = undefined,
                .color = undefined,
            };
            worker.rays.skip = @splat(batch_file.none);
            worker.shadows.skip = @splat(batch_file.none);
            // Tiles in Morton order of the smallest square of a power of two that holds them all.
            const columns = workload.setup.size / side;
            const square = std.math.ceilPowerOfTwoAssert(u32, columns);
            while (true) {
                const index = workload.next.fetchAdd(1, .monotonic);
                if (index >= square * square) break;
                const column = everyOther(index);
                const row = everyOther(index >> 1);
                if (column < columns and row < columns) worker.render(column * side, row * side);
            }
            worker.marks.to(.other);
            workload.spent[thread_index] = worker.marks.spent;
        }

        /// One thread's rays and what is known of their hits.
        const Worker = struct {
            shared: *Self,
            tracer: tracer_file.Tracer(Kernel),
            marks: Marks,
            rays: Batch,
            shadows: Batch,
            normal: batch_file.Vectors align(64),
            brightness: [ray_count]f32 align(64),
            color: [ray_count]f32 align(64),

            /// One tile, from its first pixel on.
            fn render(worker: *Worker, x: u32, y: u32) void {
                const setup = worker.shared.setup;
                const observer = worker.shared.observer;
                worker.marks.to(.generation);
                worker.generate(x, y);
                worker.marks.to(.primary);
                worker.tracer.primary(&worker.rays, setup.eye);
                if (observer) |o| o.sawPrimary(&worker.rays);
                worker.marks.to(.shading);
                var depth: u32 = 0;
                while (true) : (depth += 1) {
                    const last = depth == worker.shared.settings.depth_max;
                    if (!worker.shade(depth, last)) break;
                    worker.marks.to(if (depth == 0) .shadow else .bounce_shadow);
                    worker.tracer.occluded(&worker.shadows, setup.light);
                    if (observer) |o| o.sawShadows(&worker.shadows, depth);
                    worker.marks.to(if (depth == 0) .shading else .bounce_shading);
                    worker.addLight();
                    if (last) break;
                    worker.marks.to(.bounce);
                    worker.tracer.reflect(&worker.rays);
                    if (observer) |o| o.sawReflections(&worker.rays);
                    worker.marks.to(.bounce_shading);
                }
                worker.marks.to(.shading);
                worker.write(x, y);
                worker.marks.to(.other);
            }

            fn generate(worker: *Worker, x: u32, y: u32) void {
                const setup = worker.shared.setup;
                const rays = &worker.rays;
                const column: f32 = @floatFromInt(x);
                const row: f32 = @floatFromInt(y);
                var first: Vec3 = undefined;
                for (&first, setup.corner, setup.across, setup.down) |*to, corner, a, d| {
                    to.* = corner + (a * column + d * row);
                }
                for (0..3) |axis| {
                    const start: F32 = .splat(first[axis]);
                    var at: usize = 0;
                    while (at < ray_count) : (at += Lanes.count) {
                        const spread: F32 = .load(setup.spread[axis][at..][0..Lanes.count]);
                        start.add(spread).store(rays.direction[axis][at..][0..Lanes.count]);
                    }
                }
                rays.t = @splat(std.math.inf(f32));
                rays.active = @splat(-1);
                worker.color = @splat(0);
            }

            /// Makes shadow rays to the hits, and turns the rays into their reflections unless
            /// these are the last. Returns whether there is any hit.
            fn shade(worker: *Worker, depth: u32, last: bool) bool {
                worker.gatherNormals();
                const weight: f32 = if (depth == 0) 1 else bounce_weight;
                const apex: ?Vec3 = if (depth == 0) worker.shared.setup.eye else null;
                var any: Lanes.Mask = .splat(false);
                var at: usize = 0;
                while (at < ray_count) : (at += Lanes.count) {
                    const hit = worker.shadeLanes(at, apex, weight, last);
                    any = any.bitOr(hit);
                }
                return any.any();
            }

            inline fn shadeLanes(
                worker: *Worker,
                at: usize,
                apex: ?Vec3,
                weight: f32,
                last: bool,
            ) Lanes.Mask {
                const count = Lanes.count;
                const setup = worker.shared.setup;
                const rays = &worker.rays;
                const shadows = &worker.shadows;
                const direction = tracer_file.loadVec3(Lanes, &rays.direction, at);
                const origin: Lanes.Vec3 = if (apex) |point|
                    .splat(point)
                else
                    tracer_file.loadVec3(Lanes, &rays.origin, at);
                const primitive: I32 = .load(rays.primitive[at..][0..count]);
                const active = I32.load(rays.active[at..][0..count]).lt(.zero());
                const hit = active.andNot(primitive.lt(.zero()));
                const t = F32.select(hit, .load(rays.t[at..][0..count]), .zero());

                const outward = tracer_file.loadVec3(Lanes, &worker.normal, at);
                const sign = F32.splat(1).copySign(outward.dot(direction).neg());
                const normal = outward.scale(sign);
                const away = normal.scale(.splat(setup.offset));
                const point = origin.add(direction.scale(t)).add(away);
                const from_light = point.sub(.splat(setup.light));
                const cosine = normal.dot(from_light).neg().max(.zero());
                const brightness = cosine.div(from_light.length()).mul(.splat(weight));

                const yes: I32 = .select(hit, .splat(-1), .zero());
                F32.select(hit, brightness, .zero()).store(worker.brightness[at..][0..count]);
                storeVec3(&shadows.direction, at, from_light);
                F32.splat(shadow_end).store(shadows.t[at..][0..count]);
                yes.store(shadows.active[at..][0..count]);
                if (last) return hit;

                const along = normal.dot(direction).mul(.splat(2));
                storeVec3(&rays.origin, at, point);
                storeVec3(&rays.direction, at, direction.sub(normal.scale(along)));
                F32.splat(std.math.inf(f32)).store(rays.t[at..][0..count]);
                yes.store(rays.active[at..][0..count]);
                return hit;
            }

            /// Normals of the hit triangles, four rows of four floats at a time.
            fn gatherNormals(worker: *Worker) void {
                const Four = raylane.simd.Lanes(Kernel.variant.backend, 4);
                const normals = worker.shared.setup.normals;
                var at: usize = 0;
                while (at < ray_count) : (at += 4) {
                    var rows: [4]Four.F32 = undefined;
                    inline for (&rows, 0..) |*row, lane| {
                        const primitive = worker.rays.primitive[at + lane];
                        row.* = .loadAligned(@alignCast(&normals[@intCast(primitive + 1)]));
                    }
                    const columns = Four.transpose4x4(rows);
                    inline for (&worker.normal, columns[0..3]) |*axis, column| {
                        column.store(axis[at..][0..4]);
                    }
                }
            }

            fn addLight(worker: *Worker) void {
                const count = Lanes.count;
                var at: usize = 0;
                while (at < ray_count) : (at += count) {
                    const free = I32.load(worker.shadows.primitive[at..][0..count]).lt(.zero());
                    const share: F32 = .select(free, .splat(1), .splat(shadow_share));
                    const brightness: F32 = .load(worker.brightness[at..][0..count]);
                    const color: F32 = .load(worker.color[at..][0..count]);
                    color.add(brightness.mul(share)).store(worker.color[at..][0..count]);
                }
            }

            /// Morton order to rows: four colours are a square of pixels.
            fn write(worker: *const Worker, x: u32, y: u32) void {
                const size = worker.shared.setup.size;
                var index: usize = 0;
                while (index < ray_count) : (index += 4) {
                    const column, const row = batch_file.place(index);
                    const first = @as(usize, y + row) * size + x + column;
                    const pixels = worker.shared.pixels[first..];
                    pixels[0..2].* = worker.color[index..][0..2].*;
                    pixels[size..][0..2].* = worker.color[index + 2 ..][0..2].*;
                }
            }
        };

        inline fn storeVec3(to: *batch_file.Vectors, at: usize, vector: Lanes.Vec3) void {
            vector.x.store(to[0][at..][0..Lanes.count]);
            vector.y.store(to[1][at..][0..Lanes.count]);
            vector.z.store(to[2][at..][0..Lanes.count]);
        }
    };
}

/// Bits 0, 2, 4, ... side by side: half of a Morton code.
fn everyOther(code: u32) u32 {
    var bits = code & 0x5555_5555;
    bits = (bits | bits >> 1) & 0x3333_3333;
    bits = (bits | bits >> 2) & 0x0f0f_0f0f;
    bits = (bits | bits >> 4) & 0x00ff_00ff;
    return (bits | bits >> 8) & 0x0000_ffff;
}
