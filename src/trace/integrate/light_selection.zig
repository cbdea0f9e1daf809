//! Which virtual lights a picture has, and what they miss (after Hašan, Pellacini and Bala 2007,
//! "Matrix Row-Column Sampling for the Many-Light Problem").
//!
//! In: where light paths start. Out: lights by set and part, see `interleave.Sets`, and what they
//! give points that the camera sees beside what many more give these (`light_correction.zig`).
//! Light paths leave candidates (`light_paths.zig`), as do points on surfaces that emit; some of
//! them are kept by what they give few points (`light_importance.zig`). Where these are many more
//! than lights are asked for, it is found what they give many points, with all shadows, and lights
//! are chosen of them by that (`virtual_lights.zig`). All in steps that threads share.

const std = @import("std");
const math = @import("../../math.zig");
const world_file = @import("../../world.zig");
const emission = @import("light_emission.zig");
const interleave = @import("interleave.zig");
const light_importance = @import("light_importance.zig");
const light_matrix = @import("light_matrix.zig");
const light_paths = @import("light_paths.zig");
const tiles = @import("tiles.zig");
const virtual_lights = @import("virtual_lights.zig");
const Allocator = std.mem.Allocator;
const Box3 = math.Box3;
const Candidate = virtual_lights.Candidate;
const Frame = world_file.Frame;
const Light = world_file.Light;
const LightMatrix = light_matrix.LightMatrix;

/// Paths that lights are looked for by: one for so many pixels, within bounds.
const path_pixels = 4;
const path_count_min = 1 << 11;
const path_count_max = 1 << 16;
/// How far around what the camera sees parallel light is looked for above all, in extents of it.
const focus_margin = 1.0 / 8.0;
/// Candidates that are weighed.
const weighed_max = 1 << 14;
/// Candidates of which it is found what they give all points: one for so many pixels, so many at
/// most, and at least so many for each light.
const measured_pixels = 16;
const measured_max = 1 << 12;
const measured_least = 2;
/// Of a piece of work.
const piece_measured = 16;
/// In this order.
const Step = enum {
    see,
    trace,
    gather,
    weigh,
    sum,
    finish,
    keep,
    measure,
    add,
    rate,
    choose,
    compare,
};

/// The lights, and what finds them.
pub fn LightSelection(comptime Kernel: type, comptime Tree: type) type {
    return struct {
        gpa: Allocator,
        frame: *const Frame,
        settings: *const tiles.Settings,
        sets: interleave.Sets,
        /// In the order of `sets`: room, and what of it is used, which is all or nothing.
        room: []Light = &.{},
        lights: []const Light = &.{},
        /// Where light paths start.
        starts: []emission.Source = &.{},
        path_count: u32 = 0,
        /// Around what the camera sees.
        focus: Box3,
        /// Of points that emit, and of light paths.
        candidates: []Candidate = &.{},
        found: []Candidate = &.{},
        /// In the order of the curve.
        chosen: []Candidate = &.{},
        rows: []u32 = &.{},
        /// What candidates give all points.
        matrix: LightMatrix = .none,
        points: [light_importance.point_max]light_importance.Point,
        point_count: usize = 0,
        /// What few get of all candidates, and of those of a piece of work.
        sums: Sums,
        piece_sums: []Sums = &.{},

        const Self = @This();
        const Sums = [light_importance.few_max]f64;
        const Paths = light_paths.LightPaths(Kernel, Tree);
        const Importance = light_importance.LightImportance(Kernel, Tree);

        /// Before the picture.
        pub const step_count: u32 = std.enums.values(Step).len;

        /// Without starts yet, to be freed by `deinit`.
        pub fn init(gpa: Allocator, frame: *const Frame, settings: *const tiles.Settings) Self {
            const lights = &settings.lights;
            const samples = settings.sample_count;
            return .{
                .gpa = gpa,
                .frame = frame,
                .settings = settings,
                .sets = .init(lights.virtual_count, samples, lights.is_interleaved),
                .focus = frame.geometry.bounds,
                .points = undefined,
                .sums = undefined,
            };
        }

        /// Frees everything, the starts too.
        pub fn deinit(selection: *Self) void {
            const gpa = selection.gpa;
            inline for (.{
                "room", "starts", "candidates", "chosen", "rows", "piece_sums",
            }) |name| gpa.free(@field(selection, name));
            selection.matrix.deinit(gpa);
        }

        /// Takes room for light paths if there are to be any, once there are starts.
        pub fn prepare(selection: *Self) error{OutOfMemory}!void {
            const gpa = selection.gpa;
            const frame = selection.frame;
            const light_count = selection.sets.count();
            const box = frame.geometry.bounds;
            if (light_count == 0 or box.isEmpty()) return;
            const pixel_count = @as(u64, frame.view.width) * frame.view.height;
            const path_count = std.math
                .clamp(pixel_count / path_pixels, path_count_min, path_count_max);
            if (selection.settings.depth_max > 0) selection.path_count =
                emission.shareOut(selection.starts, box, @intCast(path_count));
            const candidate_count = selection.emittingCount() +
                @as(usize, selection.path_count) * light_paths.bounce_max;
            if (candidate_count == 0) return;
            selection.candidates = try gpa.alloc(Candidate, candidate_count);
            selection.room = try gpa.alloc(Light, light_count);
            selection.chosen = try gpa.alloc(Candidate, light_count);
            selection.rows = try gpa.alloc(u32, light_count);
            const piece_count = @divCeil(weighed_max, light_importance.piece_candidates);
            selection.piece_sums = try gpa.alloc(Sums, piece_count);
            const measured: usize = @min(pixel_count / measured_pixels, measured_max);
            if (measured < measured_least * light_count) return;
            selection.matrix = try .init(gpa, measured, light_importance.gridOf(frame.view));
        }

        fn emittingCount(selection: *const Self) usize {
            return selection.frame.emission.len;
        }

        /// Those of a sample of pixels in this part.
        pub fn of(selection: *const Self, sample: u32, part: usize) []const Light {
            return selection.sets.of(Light, selection.lights, sample, part);
        }

        pub fn pieces(selection: *const Self, number: u32) u32 {
            if (selection.candidates.len == 0) return 0;
            return switch (@as(Step, @fromBackingInt(@intCast(number)))) {
                .see, .gather, .sum, .keep, .choose => 1,
                .trace => @divCeil(selection.path_count, light_paths.piece_paths),
                // Where nothing is seen first that light falls on, flux alone counts.
                .weigh, .finish => if (selection.point_count == 0) 0 else selection
                    .pieceCount(light_importance.piece_candidates),
                .measure, .rate => if (selection.isMeasured())
                    selection.pieceCount(piece_measured)
                else
                    0,
                .add, .compare => if (selection.isMeasured()) @intCast(
                    @divCeil(selection.point_count, light_matrix.piece_points),
                ) else 0,
            };
        }

        pub fn work(selection: *Self, tree: *Tree, number: u32, piece: u32) void {
            const seen = selection.points[0..selection.point_count];
            const few = Importance.fewOf(tree, seen);
            const radius = selection.frame.geometry.size / 64;
            const part = selection.ofPiece(piece, light_importance.piece_candidates);
            switch (@as(Step, @fromBackingInt(@intCast(number)))) {
                .see => selection.see(tree),
                .trace => Paths.trace(
                    tree,
                    selection.starts,
                    piece,
                    selection.path_count,
                    selection.focus,
                    selection.ofPaths(),
                ),
                .gather => selection.gather(),
                .weigh => {
                    const sums = &selection.piece_sums[piece];
                    sums.* = @splat(0);
                    Importance.weigh(tree, few, part, radius, sums);
                },
                .sum => {
                    const piece_count = selection.pieceCount(light_importance.piece_candidates);
                    selection.sumUp(few.len, piece_count);
                    light_importance.invertGains(selection.sums[0..few.len]);
                },
                .finish => light_importance.finishWeights(few, &selection.sums, part, radius),
                .keep => selection.keep(),
                .measure => selection.measure(tree, piece),
                .add => selection.matrix.addUp(selection.frame.view, selection.found, seen, piece),
                .rate => {
                    const part_measured = selection.ofPiece(piece, piece_measured);
                    selection.matrix.rate(part_measured, piece * piece_measured, seen);
                },
                .choose => selection.choose(),
                .compare => if (selection.lights.len > 0)
                    selection.matrix
                        .compare(selection.found, selection.chosen, selection.rows, seen, piece),
            }
        }

        fn isMeasured(selection: *const Self) bool {
            return selection.matrix.gains.len > 0 and selection.point_count > 0;
        }

        fn pieceCount(selection: *const Self, size: usize) u32 {
            return @intCast(@divCeil(selection.found.len, size));
        }

        fn ofPiece(selection: *Self, piece: u32, size: usize) []Candidate {
            const first = @min(piece * size, selection.found.len);
            return selection.found[first..@min(first + size, selection.found.len)];
        }

        fn ofPaths(selection: *Self) [][light_paths.bounce_max]Candidate {
            const first = selection.candidates.ptr + selection.emittingCount();
            const all: [*][light_paths.bounce_max]Candidate = @ptrCast(first);
            return all[0..selection.path_count];
        }

        fn see(selection: *Self, tree: *Tree) void {
            selection.point_count = Importance.see(tree, &selection.points);
            var seen: Box3 = .empty;
            for (selection.points[0..selection.point_count]) |*point|
                seen = seen.include(point.position);
            const box = selection.frame.geometry.bounds;
            if (seen.isEmpty()) return;
            const around = focus_margin * math.vec3.maxComponent(seen.extent());
            const grown = seen.grow(around);
            for (0..3) |axis| {
                selection.focus.lower[axis] = @max(grown.lower[axis], box.lower[axis]);
                selection.focus.upper[axis] = @min(grown.upper[axis], box.upper[axis]);
            }
        }

        /// Puts all candidates together, and keeps those that are weighed.
        fn gather(selection: *Self) void {
            const all = selection.candidates;
            var count: usize = 0;
            for (selection.frame.emission) |*light| {
                all[count] = .{
                    .position = light.position,
                    .normal = light.direction,
                    .flux = math.vec3.scale(light.intensity, std.math.pi),
                };
                all[count].weight = all[count].luminance();
                count += 1;
            }
            for (selection.ofPaths()) |of_path| for (of_path) |one| {
                if (!(one.luminance() > 0)) break;
                all[count] = one;
                all[count].weight = one.luminance();
                count += 1;
            };
            virtual_lights.sortAlongCurve(all[0..count], selection.frame.geometry.bounds);
            selection.found = all[0..virtual_lights.thin(all[0..count], weighed_max)];
        }

        fn sumUp(selection: *Self, point_count: usize, piece_count: usize) void {
            for (selection.sums[0..point_count], 0..) |*sum, index| {
                sum.* = 0;
                for (selection.piece_sums[0..piece_count]) |*sums| sum.* += sums[index];
            }
        }

        /// Keeps those that are measured.
        fn keep(selection: *Self) void {
            if (selection.matrix.gains.len == 0) return;
            const count = selection.matrix.rowCount();
            const found = selection.found;
            selection.found = found[0..virtual_lights.thin(found, count)];
        }

        fn measure(selection: *Self, tree: *Tree, piece: u32) void {
            const first = piece * piece_measured;
            for (selection.ofPiece(piece, piece_measured), first..) |*candidate, row| {
                const size = selection.frame.geometry.size;
                candidate.disk = virtual_lights.diskOf(candidate, selection.found, size);
                const points = selection.points[0..selection.point_count];
                const gains = selection.matrix.gainsOf(row, points.len);
                Importance.measure(tree, points, candidate, gains);
            }
        }

        fn choose(selection: *Self) void {
            const chosen = selection.chosen;
            if (!virtual_lights.choose(selection.found, chosen, selection.rows)) return;
            const geometry = selection.frame.geometry;
            for (chosen) |*one|
                one.disk = virtual_lights.diskOf(one, chosen, geometry.size);
            virtual_lights.toLights(chosen, &selection.sets, geometry, selection.room);
            selection.lights = selection.room;
        }
    };
}
