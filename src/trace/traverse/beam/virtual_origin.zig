//! Beams among rays of which nothing is known: those whose lines meet in a point, with directions
//! that are linear in the pixel. A plane mirror makes such rays of the eye's, and so do mirrors of
//! mirrors; what goes on behind holes and blended surfaces is some, too.
//!
//! In: the rays of a bundle. Out: nearest hits of those that are a beam, and which are left. A
//! block of 4x4 pixels whose corners fit suggests a point and a grid of directions; then every ray
//! is measured against them, and how far off they are is what the beam's bounds have to allow for
//! (`edges.Spread`): nothing depends on how good the guess is but how much is left in doubt.

const std = @import("std");
const world_file = @import("../../../world.zig");
const TestCounts = @import("../../../statistics.zig").TestCounts;
const kernel_file = @import("../kernel.zig");
const bundle_file = @import("../bundle.zig");
const edges_file = @import("edges.zig");
const found_file = @import("tile_depth_buffer.zig");
const primary = @import("primary.zig");
const Grid = @import("grid.zig").Grid;
const Starts = @import("starts.zig").Starts;
const vec3 = @import("../../../math.zig").vec3;

const side = kernel_file.beam_side;
const subtile_side = kernel_file.subtile_side;
/// Beams of fewer rays are not worth their set-up.
const rays_min = 48;
/// Guesses that are measured, for each bundle.
const guess_max = 4;
/// How far a ray may be off its pixel, in pixels.
const apart_max = 0.02;
/// How far a ray may be off anyway, in roundings of its direction, and of places in the scene.
const roundings_max = 16;
/// Directions shorter or longer are left out: their squares might leave the range of floats.
const length_range = [2]f64{ 1e-6, 1e6 };

/// Finds nearest hits of beams, and returns which rays these have, if there are any; of the others
/// nothing changes. `shares` is null, or where barycentric weights go, as in `primary.trace`.
pub fn trace(
    comptime Kernel: type,
    geometry: *const world_file.Geometry,
    bundle: *bundle_file.Bundle(Kernel),
    shares: ?*[Kernel.group_count][2]Kernel.Rays.F32,
    counts: *TestCounts,
) ?bundle_file.Part(Kernel) {
    // In place: it is too large to be handed around.
    var measured: Measured(Kernel) = undefined;
    var beams: ?bundle_file.Part(Kernel) = null;
    var guess_count: u32 = 0;
    for (0..Kernel.subtile_count) |block| {
        const guess = Guess.of(Kernel, geometry, bundle, block, &beams) orelse continue;
        measured.measure(&guess, bundle, &beams);
        guess_count += 1;
        if (measured.starts.ray_count >= rays_min and measured.isWithinReach(geometry)) {
            const active = bundle_file.narrow(Kernel, bundle, &measured.members, true);
            measured.starts.bound(bundle);
            const starts = &measured.starts;
            const grid = &measured.grid;
            const went = primary
                .traceBehind(Kernel, geometry, grid, starts, bundle, shares, counts);
            bundle_file.restore(Kernel, bundle, &active);
            // Others of the bundle would hardly do better.
            if (!went) break;
            if (beams) |*all| {
                for (all, measured.members) |*beam, members| beam.* = beam.bitOr(members);
            } else {
                beams = measured.members;
            }
        }
        if (guess_count == guess_max) break;
    }
    return beams;
}

/// Rays of a group that are in no beam and may be in one: beams know no limits.
inline fn leftOf(
    comptime Kernel: type,
    bundle: *const bundle_file.Bundle(Kernel),
    beams: *const ?bundle_file.Part(Kernel),
    index: usize,
) Kernel.Rays.Mask {
    const group = &bundle.groups[index];
    const endless = group.active.bitAnd(group.closest.t.eq(.splat(std.math.inf(f32))));
    return if (beams.*) |*part| endless.andNot(part[index]) else endless;
}

/// A point and a grid of directions.
const Guess = struct {
    grid: Grid,
    /// By how much a ray's direction may be off.
    turn_max: f32,
    /// By how much its line may miss the point, in metres: this times t of its start, and this.
    miss_max: [2]f32,

    const Wide = @Vector(3, f64);

    /// From the corners of a block, or null where these have no point in common.
    fn of(
        comptime Kernel: type,
        geometry: *const world_file.Geometry,
        bundle: *const bundle_file.Bundle(Kernel),
        block: usize,
        beams: *const ?bundle_file.Part(Kernel),
    ) ?Guess {
        var full: Kernel.Rays.Mask = .splat(true);
        inline for (0..Kernel.subtile_groups) |row| {
            const index = block * Kernel.subtile_groups + row;
            full = full.bitAnd(leftOf(Kernel, bundle, beams, index));
        }
        if (!full.all()) return null;
        const across = subtile_side - 1;
        const places = [4]usize{ 0, across, across * subtile_side, across * subtile_side + across };
        var origins: [4]Wide = undefined;
        var directions: [4]Wide = undefined;
        for (places, &origins, &directions) |place, *origin, *direction| {
            const index = block * Kernel.subtile_groups + place / Kernel.ray_count;
            const line = &bundle.groups[index].line;
            direction.* = wide(Kernel, &line.direction, place % Kernel.ray_count);
            origin.* = wide(Kernel, &line.origin, place % Kernel.ray_count);
        }
        const third: Wide = @splat(1.0 / @as(f64, across));
        const right = (directions[1] - directions[0]) * third;
        const down = (directions[2] - directions[0]) * third;
        const bend = directions[3] - directions[2] - directions[1] + directions[0];
        const step = apart_max * @sqrt(@min(dot(right, right), dot(down, down)));
        const length = @sqrt(dot(directions[0], directions[0]));
        if (!(length > length_range[0] and length < length_range[1])) return null;
        const anyway = roundings_max * @as(f64, edges_file.unit_roundoff);
        const turn_max = step + anyway * length;
        if (!(dot(bend, bend) <= across * across * turn_max * turn_max)) return null;
        const origin = meet(origins[0], directions[0], origins[3], directions[3]) orelse
            return null;
        // A third line must come near to where the two do.
        const offset = origins[1] - origin;
        const t = dot(offset, directions[1]) / dot(directions[1], directions[1]);
        const miss = offset - @as(Wide, @splat(t)) * directions[1];
        const miss_max = [2]f64{ step, anyway * edges_file.reachMax(geometry.pad) };
        const miss_most = miss_max[0] * @abs(t) + miss_max[1];
        if (!(dot(miss, miss) <= miss_most * miss_most)) return null;
        const column: f64 = @floatFromInt(block % (side / subtile_side) * subtile_side);
        const row: f64 = @floatFromInt(block / (side / subtile_side) * subtile_side);
        const first = directions[0] - right * @as(Wide, @splat(column)) -
            down * @as(Wide, @splat(row));
        return .{
            .grid = .{
                .origin = narrow(origin),
                .corner = narrow(first),
                .right = narrow(right),
                .down = narrow(down),
                .deviation_roundings = undefined,
            },
            .turn_max = @floatCast(turn_max),
            .miss_max = .{ @floatCast(miss_max[0]), @floatCast(miss_max[1]) },
        };
    }

    /// The point of the first line that is nearest to the second, or null if they are parallel.
    fn meet(from: Wide, along: Wide, other_from: Wide, other_along: Wide) ?Wide {
        const between = from - other_from;
        const cosine = dot(along, other_along);
        const other_squared = dot(other_along, other_along);
        const denominator = dot(along, along) * other_squared - cosine * cosine;
        const t = (cosine * dot(other_along, between) - other_squared * dot(along, between)) /
            denominator;
        if (!(denominator > 0) or !(@abs(t) < edges_file.reach_limit)) return null;
        return from + @as(Wide, @splat(t)) * along;
    }

    fn dot(a: Wide, b: Wide) f64 {
        return @reduce(.Add, a * b);
    }

    fn wide(comptime Kernel: type, vector: *const Kernel.Rays.Vec3, lane: usize) Wide {
        return .{ vector.x.lane(lane), vector.y.lane(lane), vector.z.lane(lane) };
    }

    fn narrow(vector: Wide) [3]f32 {
        return .{ @floatCast(vector[0]), @floatCast(vector[1]), @floatCast(vector[2]) };
    }
};

/// How rays lie about a guess.
fn Measured(comptime Kernel: type) type {
    const Rays = Kernel.Rays;
    const F32 = Rays.F32;
    const Vec3 = Rays.Vec3;
    return struct {
        grid: Grid,
        starts: Starts(Kernel),
        /// The greatest t of a start.
        t_max: f32,
        /// Rays that are near enough.
        members: [Kernel.group_count]Rays.Mask,

        const Self = @This();
        const Found = found_file.Found(Kernel);

        /// Measures the rays that are left. A ray's own point is its start less t times its
        /// direction, for the t that is computed here, whatever its rounding.
        fn measure(
            measured: *Self,
            guess: *const Guess,
            bundle: *const bundle_file.Bundle(Kernel),
            beams: *const ?bundle_file.Part(Kernel),
        ) void {
            const grid = &guess.grid;
            const origin: Vec3 = .splat(grid.origin);
            const right: Vec3 = .splat(grid.right);
            const down: Vec3 = .splat(grid.down);
            const turn_max: F32 = .splat(guess.turn_max * guess.turn_max);
            const inf = std.math.inf(f32);
            var turned: F32 = .zero();
            var missed: F32 = .zero();
            var t_least: F32 = .splat(inf);
            var t_greatest: F32 = .zero();
            measured.starts.ray_count = 0;
            var blocks: u32 = 0;
            for (&measured.members, &bundle.groups, 0..) |*members, *group, index| {
                const direction = group.line.direction;
                const x = F32.fromArray(Kernel.lane_x)
                    .add(.splat(@floatFromInt(Kernel.pixelX(index, 0))));
                const y = F32.fromArray(Kernel.lane_y)
                    .add(.splat(@floatFromInt(Kernel.pixelY(index, 0))));
                const expected = Vec3.splat(grid.corner).add(right.scale(x)).add(down.scale(y));
                const turn = direction.sub(expected);
                const turn_squared = turn.dot(turn);
                const offset = group.line.origin.sub(origin);
                const t = offset.dot(direction).div(direction.dot(direction)).maxFast(.zero());
                const miss = offset.sub(direction.scale(t));
                const miss_squared = miss.dot(miss);
                const miss_max = t.mul(.splat(guess.miss_max[0])).add(.splat(guess.miss_max[1]));
                const fits = leftOf(Kernel, bundle, beams, index)
                    .bitAnd(turn_squared.le(turn_max))
                    .bitAnd(miss_squared.le(miss_max.mul(miss_max)));
                members.* = fits;
                measured.starts.t[index] = t;
                const bits = fits.bits();
                measured.starts.ray_count += @popCount(bits);
                const block: u5 = @intCast(index / Kernel.subtile_groups);
                blocks |= @as(u32, @intFromBool(bits != 0)) << block;
                turned = turned.maxFast(.select(fits, turn_squared, .zero()));
                missed = missed.maxFast(.select(fits, miss_squared, .zero()));
                t_least = t_least.minFast(.select(fits, t, .splat(inf)));
                t_greatest = t_greatest.maxFast(.select(fits, t, .zero()));
            }
            if (blocks == 0) return;
            measured.starts.area = .of(blocks);
            measured.starts.t_min = t_least.reduceMin();
            measured.t_max = t_greatest.reduceMax();
            measured.bound(grid, @sqrt(turned.reduceMax()), @sqrt(missed.reduceMax()));
        }

        /// Bounds by how far directions are turned at most and lines miss the point, as computed.
        fn bound(measured: *Self, grid: *const Grid, turn: f32, miss: f32) void {
            const unit = edges_file.unit_roundoff;
            // Of squares, sums and roots.
            const rounded = 1 + 16 * unit;
            const size = vec3.length1(grid.corner) + grid.spread();
            measured.grid = grid.*;
            // What is expected rounds twice a product and a sum.
            measured.grid.deviation_roundings = rounded * turn / unit + 4 * size;
            const distance = rounded * (measured.t_max * (grid.longest() + turn) + miss);
            measured.starts.spread = .{
                // The start from the origin, and t times its direction, are rounded.
                .apart = rounded * miss + 4 * unit * distance,
                .distance = distance,
            };
        }

        /// Whether no corner of the scene is farther from a start than `Geometry.pad` allows for.
        fn isWithinReach(measured: *const Self, geometry: *const world_file.Geometry) bool {
            const root = &geometry.tree.get(Kernel.width).nodes[0];
            const grid = &measured.grid;
            const last: f32 = side - 1;
            const turned =
                measured.t_max * grid.deviation_roundings * edges_file.unit_roundoff;
            var farthest_squared: f32 = 0;
            for (0..3) |axis| {
                const lower = @reduce(.Min, @as(@Vector(Kernel.width, f32), root.bounds[0][axis]));
                const upper = @reduce(.Max, @as(@Vector(Kernel.width, f32), root.bounds[1][axis]));
                // Starts are within the hull of the outermost ones.
                var farthest: f32 = 0;
                for (0..8) |corner| {
                    const direction = grid.corner[axis] +
                        (if (corner & 1 == 0) 0 else last * grid.right[axis]) +
                        (if (corner & 2 == 0) 0 else last * grid.down[axis]);
                    const t = if (corner & 4 == 0) measured.starts.t_min else measured.t_max;
                    const at = grid.origin[axis] + t * direction;
                    farthest = @max(farthest, upper - at, at - lower);
                }
                farthest += 2 * measured.starts.spread.apart + turned;
                farthest_squared += farthest * farthest;
            }
            const reach = edges_file.reachMax(geometry.pad);
            return farthest_squared <= reach * reach;
        }
    };
}
