//! Nested volumes by priority (Schmidt and Budge 2002, "Simple Nested Dielectrics in Ray Traced
//! Images").
//!
//! In: the volumes that a ray is in, the boundaries that it meets in one place. Out: which volume
//! is on either side. Where several overlap, the one of the lowest rank is there; a boundary that
//! has the same on both sides is hidden, and rays go on as if it were not there. So a liquid may
//! reach into the glass that holds it. Boundaries in the same place count as one, in whatever order
//! rays meet them: between the volumes before the first and behind the last.

const std = @import("std");
const Volume = @import("../../world.zig").Volume;

/// Volumes that a ray is in at the same time; of more the last in rank are forgotten.
pub const nested_max = 4;

/// The volumes that a ray is in.
pub const Nesting = struct {
    /// Rising; `Volume.air` behind the last.
    ranks: [nested_max]u16,

    /// In none.
    pub const air: Nesting = .{ .ranks = @splat(Volume.air) };

    /// Another volume would be one too many.
    pub inline fn isFull(nesting: *const Nesting) bool {
        return nesting.ranks[nested_max - 1] != Volume.air;
    }

    /// Rank of the volume that is there.
    pub inline fn top(nesting: *const Nesting) u16 {
        return nesting.ranks[0];
    }

    fn entered(nesting: Nesting, rank: u16) Nesting {
        var result = nesting;
        var next = rank;
        for (&result.ranks) |*place| {
            if (next < place.*) std.mem.swap(u16, &next, place);
        }
        return result;
    }

    /// Null where the ray is not in that volume.
    fn left(nesting: Nesting, rank: u16) ?Nesting {
        const at = std.mem.findScalar(u16, &nesting.ranks, rank) orelse return null;
        var result: Nesting = .air;
        @memcpy(result.ranks[0..at], nesting.ranks[0..at]);
        @memcpy(result.ranks[at .. nested_max - 1], nesting.ranks[at + 1 ..]);
        return result;
    }
};

/// A surface that a ray goes through.
pub const Crossing = struct {
    rank: u16,
    /// The ray comes from inside.
    is_leaving: bool,
};

/// Boundaries in one place: between these volumes.
pub const Boundary = struct {
    before: Nesting,
    beyond: Nesting,

    /// Those of surfaces in one place.
    pub fn cross(nesting: Nesting, crossings: []const Crossing) Boundary {
        var boundary: Boundary = .{ .before = nesting, .beyond = nesting };
        boundary.take(crossings);
        return boundary;
    }

    /// Goes through surfaces in one place, in order. Neighbours in a mesh that meet in an edge
    /// which a ray hits count as one, and a volume that a ray leaves without having entered it, as
    /// it does where it starts inside, has been there all the time.
    pub fn take(boundary: *Boundary, crossings: []const Crossing) void {
        for (crossings, 0..) |crossing, index| {
            for (crossings[0..index]) |earlier| {
                if (std.meta.eql(earlier, crossing)) break;
            } else boundary.crossOne(crossing);
        }
    }

    fn crossOne(boundary: *Boundary, crossing: Crossing) void {
        const beyond = boundary.beyond;
        if (!crossing.is_leaving) {
            boundary.beyond = beyond.entered(crossing.rank);
        } else if (beyond.left(crossing.rank)) |rest| {
            boundary.beyond = rest;
        } else {
            boundary.before = boundary.before.entered(crossing.rank);
        }
    }

    /// The same volume is on both sides.
    pub fn isHidden(boundary: *const Boundary) bool {
        return boundary.before.top() == boundary.beyond.top();
    }

    /// Index of refraction before it over that beyond.
    pub fn eta(boundary: *const Boundary, volumes: []const Volume) f32 {
        return Volume.iorOf(volumes, boundary.before.top()) /
            Volume.iorOf(volumes, boundary.beyond.top());
    }

    /// Reflectance at normal incidence, ((a - b) / (a + b))^2; null between air and the volume of
    /// one material, whose own it is then.
    pub fn f0(boundary: *const Boundary, volumes: []const Volume, rank: u16) ?f32 {
        const before = boundary.before.top();
        const beyond = boundary.beyond.top();
        if (before == Volume.air and beyond == rank) return null;
        if (beyond == Volume.air and before == rank) return null;
        const a = Volume.iorOf(volumes, before);
        const b = Volume.iorOf(volumes, beyond);
        const root = (a - b) / (a + b);
        return root * root;
    }
};

fn testVolume(ior: f32) Volume {
    return .{
        .ior = ior,
        .sigma_t = @splat(1),
        .sigma_s = @splat(0),
        .scatter_anisotropy = 0,
        .nests = true,
    };
}

const test_volumes = [_]Volume{
    testVolume(1.5),
    testVolume(1.25),
};
const glass_in: Crossing = .{ .rank = 0, .is_leaving = false };
const glass_out: Crossing = .{ .rank = 0, .is_leaving = true };
const wine_in: Crossing = .{ .rank = 1, .is_leaving = false };
const wine_out: Crossing = .{ .rank = 1, .is_leaving = true };

fn expectBoundary(
    before: u16,
    beyond: u16,
    nesting: Nesting,
    crossings: []const Crossing,
) !Nesting {
    const boundary: Boundary = .cross(nesting, crossings);
    try std.testing.expectEqual(before, boundary.before.top());
    try std.testing.expectEqual(beyond, boundary.beyond.top());
    try std.testing.expectEqual(before == beyond, boundary.isHidden());
    return boundary.beyond;
}

test "wine that overlaps its glass: its boundary inside the glass is hidden" {
    const air = Volume.air;
    var nesting = try expectBoundary(air, 0, .air, &.{glass_in});
    nesting = try expectBoundary(0, 0, nesting, &.{wine_in});
    nesting = try expectBoundary(0, 1, nesting, &.{glass_out});
    nesting = try expectBoundary(1, 0, nesting, &.{glass_in});
    nesting = try expectBoundary(0, 0, nesting, &.{wine_out});
    nesting = try expectBoundary(0, air, nesting, &.{glass_out});
    try std.testing.expectEqual(Nesting.air, nesting);
}

test "wine that touches its glass: one boundary, in whatever order" {
    const air = Volume.air;
    const glass = try expectBoundary(air, 0, .air, &.{glass_in});
    const wine = try expectBoundary(0, 1, glass, &.{ glass_out, wine_in });
    try std.testing.expectEqual(wine, try expectBoundary(0, 1, glass, &.{ wine_in, glass_out }));
    _ = try expectBoundary(1, 0, wine, &.{ wine_out, glass_in });
    _ = try expectBoundary(1, 0, wine, &.{ glass_in, wine_out });
    // An edge that two triangles share.
    _ = try expectBoundary(0, air, glass, &.{ glass_out, glass_out, glass_out });
    const boundary: Boundary = .cross(glass, &.{ glass_out, wine_in });
    try std.testing.expectEqual(1.2, boundary.eta(&test_volumes));
    const root: f32 = 0.25 / 2.75;
    try std.testing.expectEqual(root * root, boundary.f0(&test_volumes, 0).?);
    const single: Boundary = .cross(.air, &.{glass_in});
    try std.testing.expectEqual(1.0 / 1.5, single.eta(&test_volumes));
    try std.testing.expectEqual(null, single.f0(&test_volumes, 0));
}

test "what is left without having been entered was there before; what is too much is forgotten" {
    const air = Volume.air;
    try std.testing.expectEqual(Nesting.air, try expectBoundary(0, air, .air, &.{glass_out}));
    var way: Boundary = .cross(.air, &.{wine_out});
    for ([_]Crossing{ glass_in, wine_in, glass_out }) |crossing| way.take(&.{crossing});
    try std.testing.expectEqual([4]u16{ 1, air, air, air }, way.before.ranks);
    try std.testing.expectEqual([4]u16{ 1, air, air, air }, way.beyond.ranks);
    var nesting: Nesting = .air;
    for ([_]u16{ 7, 3, 9, 5, 1, 3 }) |rank| nesting = nesting.entered(rank);
    try std.testing.expectEqual([4]u16{ 1, 3, 3, 5 }, nesting.ranks);
    for ([_]u16{ 3, 1, 9, 5, 7, 3 }) |rank| nesting = nesting.left(rank) orelse nesting;
    try std.testing.expectEqual(Nesting.air, nesting);
}
