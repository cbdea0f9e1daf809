//! Shadow rays of one light as few beams (Heckbert and Hanrahan 1984): which points does it not
//! reach?
//!
//! In: a bundle whose active rays come from a point light, or go parallel to a directional one.
//! Out: which of them meet anything. A beam is a set of rays, which end in points on a plane
//! (shadow_plane.zig), and is cut in two where depth jumps. A beam that is too wide, by the
//! triangles it meets and has still to visit, or has few rays, leaves them to interval packets.

const world_file = @import("../../../world.zig");
const TestCounts = @import("../../../statistics.zig").TestCounts;
const bundle_file = @import("../bundle.zig");
const interval_packet = @import("../interval_packet.zig");
const members_file = @import("members.zig");
const shadow_plane = @import("shadow_plane.zig");
const traverse = @import("traverse.zig");
const Budget = @import("budget.zig").Budget;
const Members = members_file.Members;
const ShadowReceivers = @import("shadow_receivers.zig").ShadowReceivers;

/// Cuts of a beam at most, one after the other.
const cut_depth_max = 1;
/// Beams of fewer rays are not worth their set-up.
const beam_rays_min = 8;

/// Finds which rays meet anything; `closest.primitive` of those becomes one that they meet. Asserts
/// that all active rays start at the light's place, or go against its direction.
pub fn trace(
    comptime Kernel: type,
    geometry: *const world_file.Geometry,
    light: *const world_file.Light,
    bundle: *bundle_file.Bundle(Kernel),
    counts: *TestCounts,
) void {
    // In place: it is too large to be handed around.
    var set: ShadowReceivers(Kernel) = undefined;
    set.geometry = geometry;
    set.bundle = bundle;
    var budget: interval_packet.PacketBudget = .{};
    // A cut leaves two sets for one; rays that do not fit leave one more, at most 3 times.
    var waiting: [4 * cut_depth_max + 8]struct { members: Members, depth: u32 } = undefined;
    waiting[0] = .{ .members = members_file.activeOf(Kernel, bundle), .depth = 0 };
    var waiting_count: usize = 1;
    while (waiting_count > 0) {
        waiting_count -= 1;
        var members = waiting[waiting_count].members;
        const depth = waiting[waiting_count].depth;
        if (members_file.count(&members) < beam_rays_min or waiting_count + 3 > waiting.len) {
            traceApart(Kernel, &set, &members, &budget, counts);
            continue;
        }
        const rest = shadow_plane.place(Kernel, &set, light, &members);
        if (members_file.count(&members) == 0) {
            traceApart(Kernel, &set, &rest, &budget, counts);
            continue;
        }
        if (members_file.count(&rest) > 0) {
            waiting[waiting_count] = .{ .members = rest, .depth = depth };
            waiting_count += 1;
        }
        const half = if (depth < cut_depth_max) shadow_plane.cut(Kernel, &set, &members) else null;
        if (half) |below| {
            const part = members_file.split(&members, &below);
            waiting[waiting_count] = .{ .members = part, .depth = depth + 1 };
            waiting[waiting_count + 1] = .{ .members = members, .depth = depth + 1 };
            waiting_count += 2;
            continue;
        }
        shadow_plane.encloseRays(Kernel, &set);
        const packs: Budget = .of(Kernel.width, members_file.count(&members));
        if (!traverse.trace(Kernel, &set, packs, counts)) {
            traceApart(Kernel, &set, &set.left(&members), &budget, counts);
        }
    }
}

/// Rays of a set without a beam.
fn traceApart(
    comptime Kernel: type,
    set: *ShadowReceivers(Kernel),
    members: *const Members,
    budget: *interval_packet.PacketBudget,
    counts: *TestCounts,
) void {
    const groups = &set.bundle.groups;
    var active: [Kernel.group_count]Kernel.Rays.Mask = undefined;
    for (&active, groups, 0..) |*mask, *group, index| {
        mask.* = group.active;
        group.active = members_file.groupOf(Kernel, members, index);
    }
    interval_packet.trace(Kernel, .any_hit, set.geometry, set.bundle, budget, counts);
    for (active, groups) |mask, *group| group.active = mask;
}
