//! The rays of a tile: 16x16 pixels, in groups of as many as a lane value holds.
//!
//! What the workload hands to a tracer and gets back. The order of pixels is the variant's own:
//! that of beams, or for the thesis's packets squares of 2x2.

const std = @import("std");
const raylane = @import("raylane");
const ray_file = raylane.trace.ray;

/// Pixels along a side of a tile.
pub const side = raylane.trace.kernel.beam_side;
/// Rays in a batch.
pub const ray_count = side * side;
/// Of `primitive`: nothing was hit.
pub const none: i32 = ray_file.no_primitive;

/// In and out of a tracer.
pub fn Batch(comptime Kernel: type) type {
    return struct {
        /// Laid out as a beam's bundle.
        groups: [group_count]ray_file.Ray(Lanes),
        /// Barycentric weights of the second and the third corner of what was hit; not of shadow
        /// rays.
        barycentrics: [group_count][2]Lanes.F32,

        pub const Lanes = Kernel.Boxes;
        pub const group_count = ray_count / Lanes.count;
        const Self = @This();
        const Bundle = raylane.trace.bundle.Bundle(Kernel);

        /// As a bundle of the traversal `beam`.
        pub fn bundle(batch: *Self) *Bundle {
            comptime std.debug.assert(@sizeOf(Bundle) == @sizeOf(@FieldType(Self, "groups")));
            return @ptrCast(&batch.groups);
        }

        /// What was hit by the ray of a pixel, or null.
        pub fn hitAt(batch: *const Self, column: usize, row: usize) ?struct { u32, f32 } {
            const index = order[row][column];
            const group = &batch.groups[index / Lanes.count];
            const lane = index % Lanes.count;
            const primitive = group.closest.primitive.lane(lane);
            if (!group.active.lane(lane) or primitive == none) return null;
            return .{ @intCast(primitive), group.closest.t.lane(lane) };
        }

        /// Whether a pixel has a ray.
        pub fn isActive(batch: *const Self, column: usize, row: usize) bool {
            const index = order[row][column];
            return batch.groups[index / Lanes.count].active.lane(index % Lanes.count);
        }

        /// Column and row of each ray within the tile.
        pub const places: [ray_count][2]u32 = places: {
            @setEvalBranchQuota(20_000);
            var list: [ray_count][2]u32 = undefined;
            for (&list, 0..) |*place, index| place.* = if (Kernel.variant.traversal == .packet2x2)
                morton(index)
            else
                .{
                    BeamKernel.pixelX(index / Lanes.count, index % Lanes.count),
                    BeamKernel.pixelY(index / Lanes.count, index % Lanes.count),
                };
            break :places list;
        };

        const BeamKernel = raylane.trace.kernel.Kernel(.{
            .backend = Kernel.variant.backend,
            .traversal = .beam,
            .lanes = Kernel.variant.lanes,
        }, false);

        /// By row and column, where a pixel's ray is.
        const order: [side][side]u32 = order: {
            var table: [side][side]u32 = undefined;
            for (places, 0..) |place, index| table[place[1]][place[0]] = index;
            break :order table;
        };
    };
}

fn morton(index: usize) [2]u32 {
    var column: u32 = 0;
    var row: u32 = 0;
    for (0..4) |bit| {
        column |= @as(u32, @intCast(index >> 2 * bit & 1)) << bit;
        row |= @as(u32, @intCast(index >> 2 * bit + 1 & 1)) << bit;
    }
    return .{ column, row };
}
