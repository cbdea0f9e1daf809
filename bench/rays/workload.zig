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
};

/// How a picture is made.
pub const Settings = struct {
    /// Bounces at most.
    depth_max: u32,
    pool: *raylane.parallel.Pool,
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
        const Batch = batch_file.Batch(Kernel);
        const Vec3x = Lanes.Vec3;
        const group_count = Batch.group_count;

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
            assert(observer == null or settings.pool.thread_count == 1);
            var workload: Self = .{
                .setup = setup,
                .settings = settings,
                .world = world,
                .pixels = pixels,
                .observer = observer,
            };
            const start = std.Io.Clock.awake.now(io);
            const start_ticks = phases.ticks();
            settings.pool.run(&workload, work);
            const ticks: f64 = @floatFromInt(phases.ticks() - start_ticks);
            const total_ns: u64 = @intCast(start.untilNow(io, .awake).toNanoseconds());

            var times: Times = .{ .total_ns = total_ns, .by_phase_ns = .initFill(0) };
            for (workload.spent[0..settings.pool.thread_count]) |*spent| {
                for (&times.by_phase_ns.values, spent.values) |*sum, part| {
                    sum.* += @as(f64, @floatFromInt(part));
                }
            }
            const thread_count: f64 = @floatFromInt(settings.pool.thread_count);
            const tick_ns = @as(f64, @floatFromInt(total_ns)) / (ticks * thread_count);
            for (&times.by_phase_ns.values) |*sum| sum.* *= tick_ns;
            return times;
        }

        fn work(workload: *Self, thread_index: usize) void {
            processors.pin(workload.settings.processors, thread_index);
            var worker: Worker = .{
                .shared = workload,
                .tracer = .{ .world = workload.world, .light = .{
                    .kind = .point,
                    .from_receiver = false,
                    .position = workload.setup.light,
                    .direction = .{ 0, 0, -1 },
                    .intensity = .{ 1, 1, 1 },
                    .range_inv_squared = 0,
                    .cone_scale = 0,
                    .cone_offset = 1,
                } },
                .marks = .init(workload.settings.mode),
                .rays = undefined,
                .shadows = undefined,
                .brightness = undefined,
                .color = undefined,
            };
            worker.prepare();
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
            brightness: [group_count]F32,
            color: [group_count]F32,

            /// What stays the same from tile to tile.
            fn prepare(worker: *Worker) void {
                const setup = worker.shared.setup;
                for (&worker.rays.groups, &worker.shadows.groups) |*ray, *shadow| {
                    ray.tnear = .start();
                    ray.skip = .splat(batch_file.none);
                    ray.line.origin = .splat(setup.eye);
                    shadow.* = ray.*;
                    shadow.line.origin = .splat(setup.light);
                }
            }

            /// One tile, from its first pixel on.
            fn render(worker: *Worker, x: u32, y: u32) void {
                const observer = worker.shared.observer;
                worker.marks.to(.generation);
                const grid = worker.generate(x, y);
                worker.marks.to(.primary);
                worker.prefetchPixels(x, y);
                worker.tracer.primary(&worker.rays, &grid);
                if (observer) |o| o.sawPrimary(&worker.rays);
                worker.marks.to(.shading);
                var depth: u32 = 0;
                while (true) : (depth += 1) {
                    const last = depth == worker.shared.settings.depth_max;
                    worker.tracer.weighHits(&worker.rays);
                    if (!worker.shade(depth, last)) break;
                    worker.marks.to(if (depth == 0) .shadow else .bounce_shadow);
                    worker.tracer.occluded(&worker.shadows, depth > 0);
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

            fn generate(worker: *Worker, x: u32, y: u32) raylane.trace.Grid {
                const setup = worker.shared.setup;
                const column: f32 = @floatFromInt(x);
                const row: f32 = @floatFromInt(y);
                var first: Vec3 = undefined;
                for (&first, setup.corner, setup.across, setup.down) |*to, corner, a, d| {
                    to.* = corner + (a * column + d * row);
                }
                const bounces = worker.shared.settings.depth_max > 0;
                const across: Vec3x = .splat(setup.across);
                const down: Vec3x = .splat(setup.down);
                for (&worker.rays.groups, 0..) |*ray, index| {
                    const places = &place_table[index];
                    const spread = across.scale(.load(&places[0]))
                        .add(down.scale(.load(&places[1])));
                    ray.line.direction = Vec3x.splat(first).add(spread);
                    ray.closest = .before(.splat(std.math.inf(f32)));
                    ray.active = .splat(true);
                    if (bounces) ray.line.origin = .splat(setup.eye);
                    worker.color[index] = .zero();
                }
                var size: f32 = 0;
                for (first ++ setup.across ++ setup.down) |component| size += @abs(component);
                return .{
                    .origin = setup.eye,
                    .corner = first,
                    .right = setup.across,
                    .down = setup.down,
                    // Two products and two sums; steps are up to 15 long.
                    .deviation_ulps = 4 * size,
                };
            }

            /// Columns and rows of each group's pixels.
            const place_table: [group_count][2][Lanes.count]f32 = table: {
                @setEvalBranchQuota(20_000);
                var table: [group_count][2][Lanes.count]f32 = undefined;
                for (Batch.places, 0..) |place, index| {
                    const group = &table[index / Lanes.count];
                    group[0][index % Lanes.count] = @floatFromInt(place[0]);
                    group[1][index % Lanes.count] = @floatFromInt(place[1]);
                }
                break :table table;
            };

            /// Makes shadow rays to the hits, and turns the rays into their reflections unless
            /// these are the last. Returns whether there is any hit.
            fn shade(worker: *Worker, depth: u32, last: bool) bool {
                // A copy, which nothing that is written can change.
                const setup = worker.shared.setup.*;
                const weight: f32 = if (depth == 0) 1 else bounce_weight;
                var any: Lanes.Mask = .splat(false);
                for (0..group_count) |group| {
                    any = any.bitOr(worker.shadeGroup(&setup, group, weight, last));
                }
                return any.any();
            }

            inline fn shadeGroup(
                worker: *Worker,
                setup: *const Setup,
                group: usize,
                weight: f32,
                last: bool,
            ) Lanes.Mask {
                const ray = &worker.rays.groups[group];
                const shadow = &worker.shadows.groups[group];
                const direction = ray.line.direction;
                const hit = ray.active.andNot(ray.closest.primitive.lt(.zero()));
                const t = F32.select(hit, ray.closest.t, .zero());
                const outward = normalsOf(setup.normals, ray.closest.primitive);
                const sign = F32.splat(1).copySign(outward.dot(direction).neg());
                const normal = outward.scale(sign);
                const point = ray.line.origin.add(direction.scale(t))
                    .add(normal.scale(.splat(setup.offset)));
                const from_light = point.sub(.splat(setup.light));
                const cosine = normal.dot(from_light).neg().max(.zero());
                const brightness = cosine.div(from_light.length()).mul(.splat(weight));

                worker.brightness[group] = .select(hit, brightness, .zero());
                shadow.line.direction = from_light;
                shadow.closest = .before(.splat(shadow_end));
                shadow.active = hit;
                if (last) return hit;

                const along = normal.dot(direction).mul(.splat(2));
                ray.line = .init(point, direction.sub(normal.scale(along)));
                ray.closest = .before(.splat(std.math.inf(f32)));
                ray.active = hit;
                return hit;
            }

            /// Unit normals of triangles; anything where there is none.
            inline fn normalsOf(normals: []align(16) const [4]f32, primitives: I32) Vec3x {
                const numbers = primitives.toArray();
                if (primitives.eq(.splat(numbers[0])).all()) {
                    const normal = &normals[@intCast(numbers[0] + 1)];
                    return .splat(normal[0..3].*);
                }
                // Four rows of four floats at a time.
                const Four = raylane.simd.Lanes(Kernel.variant.backend, 4);
                var arrays: [3][Lanes.count]f32 = undefined;
                inline for (0..Lanes.count / 4) |part| {
                    var rows: [4]Four.F32 = undefined;
                    inline for (&rows, 0..) |*row, lane| {
                        const number = numbers[part * 4 + lane];
                        row.* = .loadAligned(@alignCast(&normals[@intCast(number + 1)]));
                    }
                    const columns = transposed(Four.F32, rows);
                    inline for (&arrays, columns[0..3]) |*axis, column| {
                        column.store(axis[part * 4 ..][0..4]);
                    }
                }
                return .{
                    .x = .load(&arrays[0]),
                    .y = .load(&arrays[1]),
                    .z = .load(&arrays[2]),
                };
            }

            fn addLight(worker: *Worker) void {
                const lit: F32 = .splat(1);
                for (&worker.shadows.groups, worker.brightness, &worker.color) |*s, b, *color| {
                    const free = s.closest.primitive.lt(.zero());
                    color.* = color.add(b.mul(.select(free, lit, .splat(shadow_share))));
                }
            }

            /// The picture does not fit into the inner caches, and its rows are on different pages.
            fn prefetchPixels(worker: *const Worker, x: u32, y: u32) void {
                const size = worker.shared.setup.size;
                for (0..side) |row| {
                    @prefetch(&worker.shared.pixels[(y + row) * size + x], .{ .rw = .write });
                }
            }

            /// From the order of groups to rows.
            fn write(worker: *const Worker, x: u32, y: u32) void {
                const size = worker.shared.setup.size;
                const all = worker.shared.pixels;
                const span = if (Kernel.variant.traversal == .packet2x2) 2 else 4;
                inline for (0..group_count) |group| {
                    const colors = worker.color[group].toArray();
                    inline for (0..Lanes.count / span) |part| {
                        const place = Batch.places[group * Lanes.count + part * span];
                        const first = @as(usize, y + place[1]) * size + x + place[0];
                        const pixels = all[first..][0..span];
                        pixels.* = colors[part * span ..][0..span].*;
                    }
                }
            }
        };
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

/// Rows to columns: lane r of result c is lane c of `rows[r]`.
inline fn transposed(comptime F32: type, rows: [4]F32) [4]F32 {
    const even_low = rows[0].interleaveLow(rows[2]);
    const even_high = rows[0].interleaveHigh(rows[2]);
    const odd_low = rows[1].interleaveLow(rows[3]);
    const odd_high = rows[1].interleaveHigh(rows[3]);
    return .{
        even_low.interleaveLow(odd_low),
        even_low.interleaveHigh(odd_low),
        even_high.interleaveLow(odd_high),
        even_high.interleaveHigh(odd_high),
    };
}
