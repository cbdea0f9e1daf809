//! Active masks of a bundle's rays, a bit each.
//!
//! In: masks by group. Out: the rays of a beam, taken apart and counted without lanes.

const kernel_file = @import("../kernel.zig");
const bundle_file = @import("../bundle.zig");

/// A bit for each pixel of each subtile.
pub const Members = [kernel_file.beam_subtiles]u16;

/// How many rays a mask has.
pub fn count(members: *const Members) u32 {
    return @popCount(@as(@Int(.unsigned, kernel_file.beam_pixels), @bitCast(members.*)));
}

/// The active rays of a bundle.
pub fn activeOf(comptime Kernel: type, bundle: *const bundle_file.Bundle(Kernel)) Members {
    var members: Members = @splat(0);
    for (&bundle.groups, 0..) |*group, index| {
        setGroup(Kernel, &members, index, group.active.bits());
    }
    return members;
}

/// Adds those of a group's rays whose bit is set.
pub inline fn setGroup(comptime Kernel: type, members: *Members, group: usize, bits: u32) void {
    const shift: u4 = @intCast(group % Kernel.subtile_groups * Kernel.ray_count);
    members[group / Kernel.subtile_groups] |= @as(u16, @truncate(bits)) << shift;
}

/// A group's part of a mask.
pub inline fn groupOf(
    comptime Kernel: type,
    members: *const Members,
    group: usize,
) Kernel.Rays.Mask {
    const shift: u4 = @intCast(group % Kernel.subtile_groups * Kernel.ray_count);
    const all: u16 = @intCast((@as(u32, 1) << Kernel.ray_count) - 1);
    return .fromBits(members[group / Kernel.subtile_groups] >> shift & all);
}

/// Takes the rays of one mask out of another and returns those that were in both.
pub fn split(from: *Members, part: *const Members) Members {
    var both = part.*;
    for (&both, from) |*one, *rest| {
        one.* &= rest.*;
        rest.* &= ~one.*;
    }
    return both;
}
