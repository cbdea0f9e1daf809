//! Beams among rays of which nothing is known: those whose lines meet in a point, with directions
//! that are linear in the pixel. A plane mirror makes such rays of the eye's, and so do mirrors of
//! mirrors; what goes on behind holes and blended surfaces is some, too.
//!
//! In: the rays of a bundle. Out: nearest hits of those that are a beam, and which are left. A
//! block of 4x4 pixels whose corners fit suggests a point and a grid of directions; then every ray
//! is measured against them, and how far off they are is what the beam's bounds have to allow for
//! (`edges.Spread`): nothing depends on how good the guess is but how much is left in doubt.

const std = @import("std");
const world_file = @import("../../world.zig");
const TestCounts = @import("../../statistics.zig").TestCounts;
const kernel_file = @import("../kernel.zig");
const packet = @import("../packet.zig");
const edges_file = @import("edges.zig");
const found_file = @import("found.zig");
const primary = @import("primary.zig");
const vec3 = @import("../../math.zig").vec3;
const Starts = @import("starts.zig").Starts;
const Grid = primary.Grid;

const side = kernel_file.beam_side;
const block_side = kernel_file.block_side;
/// Beams of fewer rays are not worth their set-up.
const rays_min = 48;
/// Guesses that are measured, for each bundle.
const guess_max = 4;
/// How far a ray may be off its pixel, in pixels.
const apart_max = 0.02;
/// How far a ray may be off anyway, in roundings of its direction, and of places in the scene.
const roundings_max = 16;

/// Finds nearest hits of beams, and returns which rays these have; of the others nothing changes.
/// `shares` is null, or where barycentric weights of hits go, as in `primary.trace`.
pub fn trace(
    comptime Kernel: type,
    world: *const world_file.World,
    bundle: *packet.Bundle(Kernel),
    shares: ?*[Kernel.group_count][2]Kernel.Rays.F32,
    counts: *TestCounts,
) [Kernel.group_count]Kernel.Rays.Mask {
    const Rays = Kernel.Rays;
    const groups = &bundle.groups;
    var active: [Kernel.group_count]Rays.Mask = undefined;
    var left: [Kernel.group_count]Rays.Mask = undefined;
    for (&active, &left, groups) |*mask, *rest, *group| {
        mask.* = group.active;
        // Beams know no limits.
        rest.* = group.active.bitAnd(group.nearest.t.eq(.splat(std.math.inf(f32))));
    }
    var beams: [Kernel.group_count]Rays.Mask = @splat(.splat(false));
    var guess_count: u32 = 0;
    // In place: it is too large to be handed around.
    var measured: Measured(Kernel) = undefined;
    for (0..Kernel.block_count) |block| {
        if (!isFull(Kernel, &left, block)) continue;
        const guess = Guess.of(Kernel, world, bundle, block) orelse continue;
        measured.measure(world, &guess, bundle, &left);
        guess_count += 1;
        if (measured.ray_count >= rays_min and measured.isWithinReach(world)) {
            for (groups, measured.members) |*group, members| group.active = members;
            measured.starts.bound(bundle);
            const starts = &measured.starts;
            const grid = &measured.grid;
            if (primary.traceBehind(Kernel, world, grid, starts, bundle, shares, counts)) {
                for (&left, &beams, measured.members) |*rest, *beam, members| {
                    rest.* = rest.andNot(members);
                    beam.* = beam.bitOr(members);
                }
            }
        }
        if (guess_count == guess_max) break;
    }
    for (groups, active) |*group, mask| group.active = mask;
    return beams;
}

fn isFull(
    comptime Kernel: type,
    left: *const [Kernel.group_count]Kernel.Rays.Mask,
    block: usize,
) bool {
    const groups = left[block * Kernel.block_groups ..][0..Kernel.block_groups];
    var all = groups[0];
    inline for (groups[1..]) |mask| all = all.bitAnd(mask);
    return all.all();
}

/// A point and a grid of directions.
const Guess = struct {
    grid: Grid,
    /// The shorter step of the two.
    step: f32,

    const Wide = @Vector(3, f64);

    /// From the corners of a block, or null where these have no point in common.
    fn of(
        comptime Kernel: type,
        world: *const world_file.World,
        bundle: *const packet.Bundle(Kernel),
        block: usize,
    ) ?Guess {
        const across = block_side - 1;
        const places = [4]usize{ 0, across, across * block_side, across * block_side + across };
        var origins: [4]Wide = undefined;
        var directions: [4]Wide = undefined;
        for (places, &origins, &directions) |place, *origin, *direction| {
            const index = block * Kernel.block_groups + place / Kernel.ray_count;
            const line = &bundle.groups[index].line;
            direction.* = wide(Kernel, &line.direction, place % Kernel.ray_count);
            origin.* = wide(Kernel, &line.origin, place % Kernel.ray_count);
        }
        const third: Wide = @splat(1.0 / @as(f64, across));
        const right = (directions[1] - directions[0]) * third;
        const down = (directions[2] - directions[0]) * third;
        const bend = directions[3] - directions[2] - directions[1] + directions[0];
        const step = @sqrt(@min(dot(right, right), dot(down, down)));
        const length = @sqrt(dot(directions[0], directions[0]));
        const unit: f64 = edges_file.unit_roundoff;
        const bend_max = across * apart_max * step + roundings_max * unit * length;
        if (!(dot(bend, bend) <= bend_max * bend_max)) return null;
        const origin = meet(origins[0], directions[0], origins[3], directions[3]) orelse
            return null;
        // A third line must come near to where the two do.
        const offset = origins[1] - origin;
        const t = dot(offset, directions[1]) / dot(directions[1], directions[1]);
        const miss = offset - @as(Wide, @splat(t)) * directions[1];
        const reach = edges_file.reachMax(world.pad);
        const miss_max = apart_max * step * @abs(t) + roundings_max * unit * reach;
        if (!(dot(miss, miss) <= miss_max * miss_max)) return null;
        const column: f64 = @floatFromInt(block % (side / block_side) * block_side);
        const row: f64 = @floatFromInt(block / (side / block_side) * block_side);
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
            .step = @floatCast(step),
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
        ray_count: u32,

        const Self = @This();
        const Found = found_file.Found(Kernel);

        /// Measures the rays in `left`. A ray's own point is its start less t times its direction,
        /// for the t that is computed here, whatever its rounding.
        fn measure(
            measured: *Self,
            world: *const world_file.World,
            guess: *const Guess,
            bundle: *const packet.Bundle(Kernel),
            left: *const [Kernel.group_count]Rays.Mask,
        ) void {
            const grid = &guess.grid;
            const unit = edges_file.unit_roundoff;
            const origin: Vec3 = .splat(grid.origin);
            const right: Vec3 = .splat(grid.right);
            const down: Vec3 = .splat(grid.down);
            const step: F32 = .splat(apart_max * guess.step);
            const anyway: F32 =
                .splat(roundings_max * unit * edges_file.reachMax(world.pad));
            const length = @sqrt(vec3.dot(grid.corner, grid.corner));
            const deviation_max: F32 =
                .splat(apart_max * guess.step + roundings_max * unit * length);
            const deviation_limit = deviation_max.mul(deviation_max);
            const inf = std.math.inf(f32);
            var deviation: F32 = .zero();
            var apart: F32 = .zero();
            var t_least: F32 = .splat(inf);
            var t_greatest: F32 = .zero();
            measured.ray_count = 0;
            var blocks: u32 = 0;
            for (&measured.members, &bundle.groups, left, 0..) |*members, *group, rest, index| {
                const direction = group.line.direction;
                const x = F32.fromArray(Found.lane_x)
                    .add(.splat(@floatFromInt(Kernel.pixelX(index, 0))));
                const y = F32.fromArray(Found.lane_y)
                    .add(.splat(@floatFromInt(Kernel.pixelY(index, 0))));
                const expected = Vec3.splat(grid.corner).add(right.scale(x)).add(down.scale(y));
                const off = direction.sub(expected);
                const off_squared = off.dot(off);
                const offset = group.line.origin.sub(origin);
                const t = offset.dot(direction).div(direction.dot(direction)).maxFast(.zero());
                const miss = offset.sub(direction.scale(t));
                const miss_squared = miss.dot(miss);
                const miss_max = step.mul(t).add(anyway);
                const fits = rest.bitAnd(off_squared.le(deviation_limit))
                    .bitAnd(miss_squared.le(miss_max.mul(miss_max)));
                members.* = fits;
                measured.starts.t[index] = t;
                const bits = fits.bits();
                measured.ray_count += @popCount(bits);
                const block: u5 = @intCast(index / Kernel.block_groups);
                blocks |= @as(u32, @intFromBool(bits != 0)) << block;
                deviation = deviation.maxFast(.select(fits, off_squared, .zero()));
                apart = apart.maxFast(.select(fits, miss_squared, .zero()));
                t_least = t_least.minFast(.select(fits, t, .splat(inf)));
                t_greatest = t_greatest.maxFast(.select(fits, t, .zero()));
            }
            if (blocks == 0) return;
            measured.grid = grid.*;
            var size: f32 = 0;
            for (grid.corner ++ grid.right ++ grid.down) |component| size += @abs(component);
            // What is expected rounds twice a product and a sum.
            measured.grid.deviation_roundings =
                1.01 * @sqrt(deviation.reduceMax()) / unit + 4 * size;
            measured.starts.t_min = t_least.reduceMin();
            measured.t_max = t_greatest.reduceMax();
            const missed = 1.01 * @sqrt(apart.reduceMax());
            const distance = 1.01 * measured.t_max * size + missed;
            measured.starts.spread = .{
                .apart = missed + 4 * unit * distance,
                .distance = distance,
            };
            measured.starts.area = .of(blocks);
        }

        /// Whether no corner of the scene is farther from a start than `World.pad` allows for.
        fn isWithinReach(measured: *const Self, world: *const world_file.World) bool {
            const root = &world.tree.get(Kernel.width).nodes[0];
            const grid = &measured.grid;
            const last: f32 = side - 1;
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
                farthest += 2 * measured.starts.spread.apart;
                farthest_squared += farthest * farthest;
            }
            const reach = edges_file.reachMax(world.pad);
            return farthest_squared <= reach * reach;
        }
    };
}
