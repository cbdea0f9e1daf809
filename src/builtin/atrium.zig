//! An open court between two storeys of arcades, in the kind of Renaissance palaces.
//!
//! The court lies about the origin, 21 by 12 metres between the axes of its columns, in bays of 3
//! metres; y = 0 is its pavement. Every side is built in the space of a wall: x along the arcade
//! from one corner pier to the next, y up, z out into the court. Sun, a weaker light from the
//! zenith, and ambient light.

const std = @import("std");
const geometry = @import("geometry.zig");
const masonry = @import("masonry.zig");
const sky = @import("sky.zig");
const elementary = @import("../math.zig").elementary;
const MeshBuilder = @import("mesh_builder.zig");
const placing = @import("placing.zig");
const scene_data = @import("../scene.zig");
const Arch = masonry.Arch;
const Outline = masonry.Outline;
const Place = geometry.Place;
const Point = geometry.Point;
const Builder = scene_data.Builder;
const Material = scene_data.Material;
const Scene = scene_data.Scene;
const Allocator = std.mem.Allocator;

const half_x = 10.5;
const half_z = 6.0;
const bay = 3.0;
/// Half the thickness of the walls above the arches.
const wall_half = 0.25;
/// From the axis of the columns to the outer wall of the galleries.
const gallery_depth = 3.0;
/// Middle of a gallery, from the axis of the columns.
const gallery_middle = (gallery_depth + wall_half) / 2.0;

/// Heights of one storey of the arcade.
const Storey = struct {
    /// Where columns stand and where they end, and arches spring.
    column_bottom: f64,
    spring: f64,
    /// Where the wall above the arches ends.
    wall_top: f64,
    arch: Arch,
    /// Section of the archivolt: distance from the intrados and how far it stands out.
    archivolt: []const [2]f64,
};

const ground: Storey = .{
    .column_bottom = 0.3,
    .spring = 3.4,
    .wall_top = 5.1,
    .arch = .{ .half_span = 1.2, .half_segments = 8 },
    .archivolt = &.{
        .{ 0, 0.03 },   .{ 0.12, 0.03 },
        .{ 0.2, 0.09 }, .{ 0.27, 0.09 },
        .{ 0.27, 0 },
    },
};

const upper: Storey = .{
    .column_bottom = 6.5,
    .spring = 8.5,
    .wall_top = 10.1,
    .arch = .{ .half_span = 1.25, .half_segments = 8 },
    .archivolt = &.{ .{ 0, 0.03 }, .{ 0.09, 0.03 }, .{ 0.18, 0.07 }, .{ 0.18, 0 } },
};

/// How far walls reach past their corners, so that no ray slips through where they meet.
const overlap = 0.05;

const floor_ground = ground.column_bottom;
const floor_upper = 5.5;
const ceiling_upper = 9.95;

/// What has a material of its own.
const Part = enum { stone, wall, pavement, wood, roof, water, leaves };
const Parts = @import("mesh_set.zig").MeshSet(Part);

const materials: std.EnumArray(Part, Material) = .init(.{
    .stone = .{ .base_color = .{ 0.72, 0.63, 0.50, 1 }, .metallic = 0, .roughness = 0.8 },
    .wall = .{ .base_color = .{ 0.78, 0.62, 0.42, 1 }, .metallic = 0, .roughness = 0.9 },
    .pavement = .{ .base_color = .{ 0.74, 0.66, 0.56, 1 }, .metallic = 0, .roughness = 0.6 },
    .wood = .{ .base_color = .{ 0.22, 0.12, 0.06, 1 }, .metallic = 0, .roughness = 0.6 },
    .roof = .{ .base_color = .{ 0.58, 0.24, 0.13, 1 }, .metallic = 0, .roughness = 0.9 },
    .water = .{ .base_color = .{ 0.02, 0.06, 0.07, 1 }, .metallic = 0, .roughness = 0 },
    .leaves = .{
        .base_color = .{ 0.10, 0.22, 0.05, 1 },
        .metallic = 0,
        .roughness = 0.9,
        .double_sided = true,
    },
});

/// The scene, owned by the caller.
pub fn build(gpa: Allocator) Allocator.Error!Scene {
    var builder: Builder = .init(gpa);
    errdefer builder.deinit();
    var parts: Parts = .init(builder.arena());
    for (0..4) |side| {
        const along_x = side % 2 == 0;
        const length: f64 = if (along_x) 2 * half_x else 2 * half_z;
        const place = Place.identity.turned(@intCast(side)).moved(.{
            -length / 2,
            0,
            if (along_x) -half_z else -half_x,
        });
        try addSide(&parts, place, if (along_x) 7 else 4);
    }
    try addCourtMouldings(&parts);
    try addPavement(parts.get(.pavement));
    try addFountain(&parts);
    for ([_][2]f64{ .{ -1, -1 }, .{ -1, 1 }, .{ 1, -1 }, .{ 1, 1 } }) |sign| {
        try addShrub(&parts, .{ 3.0 * sign[0], 0, 3.0 * sign[1] });
    }
    try addShrub(&parts, .{ 8.5, 0, -4 });
    try addShrub(&parts, .{ 8.5, 0, 4 });
    try parts.finish(&builder, materials);

    try sky.add(&builder, .{
        .radius = 60,
        .azimuth_deg = 20,
        .half_width_deg = 118,
        .elevation_min_deg = -5,
        .elevation_max_deg = 60,
        .low_color = .{ 0.75, 0.86, 0.95 },
        .high_color = .{ 0.16, 0.34, 0.68 },
    });
    try placing.addDirectionalLight(&builder, .{ -0.5, 0.82, 0.42 }, .{ 1, 0.9, 0.74 }, 4.4);
    try placing.addDirectionalLight(&builder, .{ -0.15, 0.97, -0.15 }, .{ 0.7, 0.85, 1 }, 0.7);
    try placing.addPointLight(&builder, .{ 0.4, 1.1, -3.9 }, .{ 1, 0.82, 0.6 }, 9);
    const lantern: Point = .{ -3, 2.9, half_z + gallery_middle };
    try placing.addPointLight(&builder, lantern, .{ 1, 0.72, 0.42 }, 7);
    builder.scene.ambient = 0.21;
    try placing.addCamera(&builder, .{
        .name = "court",
        .eye = .{ -9.1, 1.75, 1.7 },
        .target = .{ 3, 3.5, -0.7 },
        .y_fov_deg = 60,
        .resolution = .{ 1024, 683 },
    });
    return builder.finish();
}

/// One side of the court, both storeys, with the gallery behind and the corner at its left end.
fn addSide(parts: *Parts, place: Place, bays: usize) Allocator.Error!void {
    parts.setPlace(place);
    try addGalleryWalls(parts, place, bays);
    for (0..bays + 1) |index| {
        const x = bay * @as(f64, @floatFromInt(index));
        try addTransverseArch(parts, place.moved(.{ x, ground.spring, -gallery_middle }));
        if (index == bays) break; // What stands on this corner belongs to the next side.
        const at_column = place.moved(.{ x, 0, 0 });
        if (index == 0) {
            try addCornerPier(parts, at_column);
        } else {
            try addGroundColumn(parts.get(.stone), at_column);
            try addUpperColumn(parts.get(.stone), at_column);
        }
        try addBay(parts, place.moved(.{ x + bay / 2.0, 0, 0 }));
    }
    // The corner of the gallery has a vault of its own.
    const corner: Point = .{ -gallery_middle, ground.spring, -gallery_middle };
    parts.get(.wall).place = place.moved(corner);
    try masonry.groinVault(parts.get(.wall), vaultOver(1.5));
}

/// The vault of a bay over a gallery that is twice `half_depth` deep.
fn vaultOver(half_depth: f64) masonry.Vault {
    const arch: Arch = .{ .half_span = 1, .half_segments = 4 };
    return .{ .arch = arch, .half_x = bay / 2.0, .half_z = half_depth, .rise = 1.5 };
}

/// What stands between two columns; x = 0 is the middle of the bay.
fn addBay(parts: *Parts, place: Place) Allocator.Error!void {
    for ([_]Storey{ ground, upper }) |storey| {
        parts.setPlace(place.moved(.{ 0, storey.spring, 0 }));
        try addArcadeArch(parts, storey);
    }
    parts.get(.wall).place = place.moved(.{ 0, ground.spring, -gallery_middle });
    try masonry.groinVault(parts.get(.wall), vaultOver(gallery_middle - wall_half));
    try addBalustrade(parts.get(.stone), place.moved(.{ 0, floor_upper, 0 }));
    try addBeams(parts.get(.wood), place);
}

/// Arch, archivolt, keystone and the wall above, at the springing line.
fn addArcadeArch(parts: *Parts, storey: Storey) Allocator.Error!void {
    var section: Outline = .from(.{ storey.archivolt[storey.archivolt.len - 1][0], -wall_half });
    section.line(&.{.{ 0, -wall_half }});
    for (storey.archivolt) |point| section.line(&.{.{ point[0], wall_half + point[1] }});
    try masonry.archBand(parts.get(.stone), .{ .arch = storey.arch, .section = section.points() });
    const distance = storey.archivolt[storey.archivolt.len - 1][0];
    for ([_]f64{ wall_half, -wall_half }) |z| {
        try masonry.spandrel(parts.get(.wall), .{
            .arch = storey.arch,
            .distance = distance,
            .half_width = bay / 2.0,
            .top = storey.wall_top - storey.spring,
            .z = z,
        });
    }
    // The keystone: a wedge that stands out at the crown.
    const bottom = storey.arch.crown(0) - 0.04;
    const top = storey.wall_top - storey.spring;
    const front = wall_half + 0.16;
    const stone = parts.get(.stone);
    try stone.quad(
        .{ -0.1, bottom, front - 0.04 },
        .{ 0.1, bottom, front - 0.04 },
        .{ 0.15, top, front },
        .{ -0.15, top, front },
    );
    for ([_]f64{ -1, 1 }) |sign| {
        const outer_bottom: Point = .{ sign * 0.1, bottom, front - 0.04 };
        const outer_top: Point = .{ sign * 0.15, top, front };
        const inner_bottom: Point = .{ sign * 0.1, bottom, wall_half - 0.1 };
        const inner_top: Point = .{ sign * 0.15, top, wall_half };
        if (sign > 0) {
            try stone.quad(outer_bottom, inner_bottom, inner_top, outer_top);
        } else {
            try stone.quad(inner_bottom, outer_bottom, outer_top, inner_top);
        }
    }
    try stone.quad(
        .{ -0.1, bottom, wall_half - 0.1 },
        .{ 0.1, bottom, wall_half - 0.1 },
        .{ 0.1, bottom, front - 0.04 },
        .{ -0.1, bottom, front - 0.04 },
    );
}

/// The band that divides two vaults, from a column to the outer wall; its middle is the origin.
fn addTransverseArch(parts: *Parts, place: Place) Allocator.Error!void {
    parts.get(.stone).place = place.turned(1);
    try masonry.archBand(parts.get(.stone), .{
        .arch = .{ .half_span = 1.2, .half_segments = 8 },
        .section = &.{ .{ 0.35, -0.2 }, .{ 0, -0.2 }, .{ 0, 0.2 }, .{ 0.35, 0.2 } },
    });
    // The pilaster that carries it on the wall.
    var outline: Outline = .from(.{ 0.28, floor_ground });
    outline.line(&.{ .{ 0.28, floor_ground + 0.3 }, .{ 0.2, floor_ground + 0.35 } });
    outline.line(&.{ .{ 0.2, ground.spring - 0.16 }, .{ 0.28, ground.spring - 0.08 } });
    outline.line(&.{.{ 0.28, ground.spring }});
    outline.line(&.{.{ 0, ground.spring }});
    parts.get(.stone).place = place.moved(.{ 0, -ground.spring, gallery_middle - gallery_depth });
    try parts.get(.stone).prism(outline.points());
}

/// A column of the ground storey, with an attic base, entasis and a capital of leaves.
fn addGroundColumn(stone: *MeshBuilder, place: Place) Allocator.Error!void {
    stone.place = place.moved(.{ 0, ground.column_bottom, 0 });
    try stone.prism(&.{ .{ 0.36, 0 }, .{ 0.36, 0.13 }, .{ 0.28, 0.13 } });
    var outline: Outline = .from(.{ 0.3, 0.13 });
    outline.torus(0.055, 0.11, 2);
    outline.line(&.{ .{ 0.285, 0.25 }, .{ 0.265, 0.29 }, .{ 0.28, 0.325 } });
    outline.torus(0.035, 0.07, 2);
    outline.line(&.{ .{ 0.255, 0.4 }, .{ 0.25, 0.45 } });
    outline.curve(.{ 0.252, 1.5 }, .{ 0.212, 2.45 }, 3);
    outline.line(&.{ .{ 0.242, 2.48 }, .{ 0.212, 2.51 } });
    outline.curve(.{ 0.2, 2.8 }, .{ 0.33, 2.97 }, 3);
    try stone.revolve(outline.points(), 12);
    try addLeaves(stone, 2.52, 0.215, 0.4);
    var abacus: Outline = .from(.{ 0.3, 2.95 });
    abacus.line(&.{ .{ 0.34, 2.95 }, .{ 0.34, 3.0 }, .{ 0.37, 3.04 } });
    abacus.line(&.{ .{ 0.37, 3.1 }, .{ 0.2, 3.1 } });
    try stone.prism(abacus.points());
}

/// A ring of eight leaves that stand close to a capital and curl outwards at their tips.
fn addLeaves(stone: *MeshBuilder, bottom: f64, radius: f64, height: f64) Allocator.Error!void {
    // Height and distance from the bell as shares of the leaf's height, half width in turns.
    const shape = [_][3]f64{
        .{ 0, 0.03, 0.05 },
        .{ 0.6, 0.1, 0.056 },
        .{ 1.0, 0.34, 0.04 },
        .{ 0.92, 0.5, 0.012 },
    };
    for (0..8) |leaf| {
        const middle = @as(f64, @floatFromInt(leaf)) / 8;
        var points: [3 * shape.len]Point = undefined;
        for (shape, 0..) |row, index| {
            for ([_]f64{ -1, 0, 1 }, 0..) |across, column| {
                const azimuth_rad = 2 * std.math.pi * (middle + across * row[2]);
                const ridge: f64 = if (across == 0) 0.02 else 0;
                const distance = radius + height * row[1] + ridge;
                points[3 * index + column] = .{
                    distance * elementary.sin(azimuth_rad),
                    bottom + height * row[0],
                    distance * elementary.cos(azimuth_rad),
                };
            }
        }
        try stone.patch(.{ .points = &points, .columns = 3, .crease_cos = 0.6 });
    }
}

/// A column of the upper storey on its pedestal.
fn addUpperColumn(stone: *MeshBuilder, place: Place) Allocator.Error!void {
    stone.place = place.moved(.{ 0, floor_upper, 0 });
    try addPedestal(stone, 0.27);
    stone.place = place.moved(.{ 0, upper.column_bottom, 0 });
    try stone.prism(&.{ .{ 0.24, 0 }, .{ 0.24, 0.09 }, .{ 0.2, 0.09 } });
    var outline: Outline = .from(.{ 0.2, 0.09 });
    outline.torus(0.035, 0.08, 2);
    outline.curve(.{ 0.16, 0.2 }, .{ 0.16, 0.26 }, 2);
    outline.curve(.{ 0.162, 0.9 }, .{ 0.135, 1.6 }, 3);
    outline.line(&.{ .{ 0.16, 1.625 }, .{ 0.135, 1.65 }, .{ 0.14, 1.74 } });
    outline.curve(.{ 0.22, 1.76 }, .{ 0.22, 1.88 }, 2);
    try stone.revolve(outline.points(), 8);
    try stone.prism(&.{ .{ 0.2, 1.87 }, .{ 0.26, 1.87 }, .{ 0.26, 2.0 }, .{ 0.1, 2.0 } });
}

/// A block of the height of the balustrade.
fn addPedestal(stone: *MeshBuilder, half: f64) Allocator.Error!void {
    try stone.prism(&.{
        .{ half + 0.04, 0 }, .{ half + 0.04, 0.12 }, .{ half, 0.16 },
        .{ half, 0.84 },     .{ half + 0.05, 0.9 },  .{ half + 0.05, 1.0 },
        .{ 0.05, 1.0 },
    });
}

/// The square pier on a corner, through both storeys.
fn addCornerPier(parts: *Parts, place: Place) Allocator.Error!void {
    const stone = parts.get(.stone);
    stone.place = place;
    var outline: Outline = .from(.{ 0.46, ground.column_bottom });
    outline.line(&.{.{ 0.46, 0.46 }});
    outline.torus(0.03, 0.1, 2);
    outline.line(&.{ .{ 0.4, 0.6 }, .{ 0.4, 2.9 }, .{ 0.44, 2.94 }, .{ 0.4, 2.98 } });
    outline.line(&.{.{ 0.4, 3.15 }});
    outline.curve(.{ 0.42, 3.24 }, .{ 0.5, 3.28 }, 3);
    outline.line(&.{ .{ 0.5, 3.4 }, .{ wall_half, 3.4 }, .{ wall_half, floor_upper } });
    try stone.prism(outline.points());
    stone.place = place.moved(.{ 0, floor_upper, 0 });
    try addPedestal(stone, 0.34);
    stone.place = place;
    var above: Outline = .from(.{ 0.32, 6.5 });
    above.line(&.{ .{ 0.32, 6.62 }, .{ 0.28, 6.68 }, .{ 0.28, 8.2 }, .{ 0.31, 8.23 } });
    above.line(&.{ .{ 0.28, 8.26 }, .{ 0.28, 8.34 }, .{ 0.36, 8.4 }, .{ 0.36, 8.5 } });
    above.line(&.{ .{ wall_half, 8.5 }, .{ wall_half, upper.wall_top } });
    try stone.prism(above.points());
}

/// Rails and balusters between two pedestals, on the floor of the upper gallery.
fn addBalustrade(stone: *MeshBuilder, place: Place) Allocator.Error!void {
    const reach = bay / 2.0 - 0.27;
    stone.place = place;
    try masonry.moulding(stone, &.{
        .{ 0.14, 0 },    .{ 0.14, 0.1 }, .{ 0.11, 0.13 }, .{ -0.11, 0.13 },
        .{ -0.14, 0.1 }, .{ -0.14, 0 },
    }, -reach, reach);
    try masonry.moulding(stone, &.{
        .{ -0.1, 0.86 }, .{ 0.1, 0.86 },  .{ 0.16, 0.92 },  .{ 0.16, 0.98 },
        .{ 0.13, 1.0 },  .{ -0.13, 1.0 }, .{ -0.16, 0.98 }, .{ -0.16, 0.92 },
        .{ -0.1, 0.86 },
    }, -reach, reach);
    const outline = [_][2]f64{
        .{ 0.07, 0.13 },  .{ 0.07, 0.19 },  .{ 0.045, 0.23 }, .{ 0.085, 0.35 },
        .{ 0.036, 0.62 }, .{ 0.045, 0.78 }, .{ 0.07, 0.8 },   .{ 0.07, 0.86 },
    };
    const count = 6;
    for (0..count) |index| {
        const share = (@as(f64, @floatFromInt(index)) + 0.5) / count;
        stone.place = place.moved(.{ -reach + 2 * reach * share, 0, 0 });
        try stone.revolve(&outline, 6);
    }
}

/// The beams of the upper gallery's ceiling, across one bay.
fn addBeams(wood: *MeshBuilder, place: Place) Allocator.Error!void {
    const count = 5;
    for (0..count) |index| {
        const share = (@as(f64, @floatFromInt(index)) + 0.5) / count;
        wood.place = place.moved(.{ bay * (share - 0.5), 0, 0 });
        try addBeam(wood, -gallery_depth, -wall_half);
    }
}

/// A beam along z below the upper ceiling.
fn addBeam(wood: *MeshBuilder, z0: f64, z1: f64) Allocator.Error!void {
    const top = ceiling_upper;
    const bottom = ceiling_upper - 0.2;
    const x = 0.08;
    try wood.quad(.{ -x, bottom, z0 }, .{ x, bottom, z0 }, .{ x, bottom, z1 }, .{ -x, bottom, z1 });
    try wood.quad(.{ x, bottom, z1 }, .{ x, bottom, z0 }, .{ x, top, z0 }, .{ x, top, z1 });
    try wood.quad(.{ -x, bottom, z0 }, .{ -x, bottom, z1 }, .{ -x, top, z1 }, .{ -x, top, z0 });
}

/// The outer walls of the galleries, with doors in turns below and above.
fn addGalleryWalls(parts: *Parts, place: Place, bays: usize) Allocator.Error!void {
    const length = bay * @as(f64, @floatFromInt(bays));
    const seed: u32 = @intCast(bays);
    parts.get(.wall).place = place;
    try masonry.blocks(parts.get(.wall), .{
        .lower = .{ -gallery_depth - overlap, floor_ground - overlap },
        .upper = .{ length + gallery_depth + overlap, ground.wall_top },
        .z = -gallery_depth,
        .block_width = 1.0,
        .course_height = 0.48,
        .variation = 0.2,
        .seed = seed,
    });
    try masonry.blocks(parts.get(.wall), .{
        .lower = .{ -gallery_depth - overlap, floor_upper - overlap },
        .upper = .{ length + gallery_depth + overlap, ceiling_upper + overlap },
        .z = -gallery_depth,
        .block_width = 1.2,
        .course_height = 0.64,
        .variation = 0.12,
        .seed = seed + 100,
    });
    for (0..bays) |index| {
        const x = bay * (@as(f64, @floatFromInt(index)) + 0.5);
        const on_wall = place.moved(.{ x, 0, -gallery_depth });
        const below = index % 2 == 0;
        const floor: f64 = if (below) floor_ground else floor_upper;
        try addDoor(parts, on_wall.moved(.{ 0, floor, 0 }), 0.62, if (below) 2.5 else 2.3);
    }
}

/// A closed door in a moulded frame.
fn addDoor(parts: *Parts, place: Place, half_width: f64, height: f64) Allocator.Error!void {
    parts.setPlace(place);
    try parts.get(.wood).box(.{ -half_width, 0, -0.1 }, .{ half_width, height, 0.02 });
    for ([_]f64{ -1, 1 }) |side| {
        const middle = side * half_width / 2;
        const panel = half_width / 2 - 0.08;
        for ([_][2]f64{ .{ 0.15, 0.75 }, .{ 0.9, 1.5 }, .{ 1.65, height - 0.12 } }) |range| {
            try parts.get(.wood).box(
                .{ middle - panel, range[0], -0.1 },
                .{ middle + panel, range[1], 0.05 },
            );
        }
        const jamb = side * (half_width + 0.1);
        try parts.get(.stone).box(.{ jamb - 0.11, 0, -0.1 }, .{ jamb + 0.11, height + 0.2, 0.08 });
    }
    parts.get(.stone).place = place.moved(.{ 0, height, 0 });
    try parts.get(.stone).box(.{ -half_width, 0, -0.1 }, .{ half_width, 0.2, 0.08 });
    const reach = half_width + 0.35;
    try masonry.moulding(parts.get(.stone), &.{
        .{ 0, 0.2 }, .{ 0.12, 0.2 }, .{ 0.12, 0.28 }, .{ 0.24, 0.38 }, .{ 0.24, 0.46 }, .{ 0, 0.5 },
    }, -reach, reach);
}

/// Steps, cornices, floors and ceilings that run all round the court, and the roof's edge.
fn addCourtMouldings(parts: *Parts) Allocator.Error!void {
    parts.setPlace(.identity);
    const stone = parts.get(.stone);
    try masonry.courtMoulding(stone, &.{
        .{ 1.0, 0 }, .{ 1.0, 0.15 }, .{ 0.7, 0.15 }, .{ 0.7, 0.3 }, .{ 0, 0.3 },
    }, half_x, half_z);

    const face_x = half_x - wall_half;
    const face_z = half_z - wall_half;
    var entablature: Outline = .from(.{ 0, ground.wall_top - 0.04 });
    entablature.line(&.{ .{ 0.05, ground.wall_top - 0.04 }, .{ 0.05, 5.16 }, .{ 0.09, 5.18 } });
    entablature.line(&.{.{ 0.09, 5.28 }});
    entablature.curve(.{ 0.22, 5.28 }, .{ 0.24, 5.38 }, 4);
    entablature.line(&.{ .{ 0.3, 5.38 }, .{ 0.3, 5.5 }, .{ -0.1, 5.5 } });
    try masonry.courtMoulding(stone, entablature.points(), face_x, face_z);

    var cornice: Outline = .from(.{ 0, upper.wall_top - 0.04 });
    cornice.line(&.{ .{ 0.06, upper.wall_top - 0.04 }, .{ 0.06, 10.2 } });
    cornice.curve(.{ 0.16, 10.2 }, .{ 0.16, 10.3 }, 3);
    cornice.line(&.{ .{ 0.16, 10.46 }, .{ 0.48, 10.46 }, .{ 0.48, 10.56 } });
    cornice.curve(.{ 0.52, 10.66 }, .{ 0.62, 10.68 }, 4);
    cornice.line(&.{ .{ 0.62, 10.72 }, .{ 0, 10.76 } });
    try masonry.courtMoulding(stone, cornice.points(), face_x, face_z);

    const reach = gallery_depth + wall_half;
    const floor = [_][2]f64{ .{ reach, floor_upper }, .{ 0, floor_upper } };
    const outer_x = half_x + gallery_depth;
    const outer_z = half_z + gallery_depth;
    try masonry.courtMoulding(parts.get(.pavement), &floor, outer_x, outer_z);
    const ceiling = [_][2]f64{ .{ 0, ceiling_upper }, .{ reach, ceiling_upper } };
    try masonry.courtMoulding(parts.get(.wood), &ceiling, outer_x, outer_z);
    const slope = [_][2]f64{ .{ reach + 0.5, 10.74 }, .{ 0, 12.4 } };
    try masonry.courtMoulding(parts.get(.roof), &slope, outer_x, outer_z);
    for (0..4) |side| {
        const along_x = side % 2 == 0;
        const half_length: f64 = if (along_x) face_x else face_z;
        const distance: f64 = if (along_x) face_z else face_x;
        const place = Place.identity.turned(@intCast(side)).moved(.{ 0, 0, -distance });
        try addEaves(parts, place, half_length);
    }
}

/// Modillions below the cornice and rows of tiles above it, along one side.
fn addEaves(parts: *Parts, place: Place, half_length: f64) Allocator.Error!void {
    const modillions: usize = @intFromFloat(half_length * 4);
    for (0..modillions) |index| {
        const share = (@as(f64, @floatFromInt(index)) + 0.5) / @as(f64, @floatFromInt(modillions));
        parts.get(.stone).place = place.moved(.{ half_length * (2 * share - 1), 10.3, 0 });
        try addModillion(parts.get(.stone));
    }
    const tiles: usize = @intFromFloat(half_length * 7);
    for (0..tiles) |index| {
        const share = (@as(f64, @floatFromInt(index)) + 0.5) / @as(f64, @floatFromInt(tiles));
        parts.get(.roof).place = place.moved(.{ half_length * (2 * share - 1), 10.74, 0.72 });
        const shade = 1 - 0.35 * masonry.scatter(@intCast(index + tiles * 1000));
        parts.get(.roof).tint = .{ shade, shade, shade };
        try addTileRow(parts.get(.roof));
    }
    parts.get(.roof).tint = .{ 1, 1, 1 };
}

/// A bracket under the cornice, against the wall at z = 0.16.
fn addModillion(stone: *MeshBuilder) Allocator.Error!void {
    var corners: [2][4]Point = undefined;
    for (&corners, [_]f64{ -0.07, 0.07 }) |*side, x| {
        side.* = .{ .{ x, 0, 0.16 }, .{ x, 0.06, 0.42 }, .{ x, 0.16, 0.42 }, .{ x, 0.16, 0.16 } };
    }
    const left, const right = corners;
    try stone.quad(left[0], right[0], right[1], left[1]);
    try stone.quad(left[1], right[1], right[2], left[2]);
    try stone.quad(left[0], left[1], left[2], left[3]);
    try stone.quad(right[1], right[0], right[3], right[2]);
}

/// A row of cover tiles as a half pipe that climbs from the eaves, with its closed end.
fn addTileRow(roof: *MeshBuilder) Allocator.Error!void {
    const line: Arch = .{ .half_span = 0.1, .half_segments = 2 };
    var curve: [5]Point = undefined;
    line.curve(0, &curve);
    var points: [10]Point = undefined;
    for (curve, 0..) |point, index| {
        points[index] = point;
        points[5 + index] = .{ point[0], point[1] + 1.6, -4 };
    }
    try roof.patch(.{ .points = &points, .columns = 5, .crease_cos = 0.5 });
    const first = try roof.vertex(curve[0], null);
    for (curve[1..]) |point| _ = try roof.vertex(point, null);
    for (1..4) |index| {
        const corner: u32 = first + @as(u32, @intCast(index));
        try roof.triangle(first, corner + 1, corner);
    }
}

/// Slabs of two stones in the court, checkers in the galleries.
fn addPavement(pavement: *MeshBuilder) Allocator.Error!void {
    pavement.place = .identity;
    defer pavement.tint = .{ 1, 1, 1 };
    try addTiles(pavement, 0, half_x - 1, half_z - 1, 0.5, null);
    try addTiles(pavement, floor_ground, half_x + gallery_depth, half_z + gallery_depth, 0.75, .{
        half_x,
        half_z,
    });
}

/// Square tiles over a rectangle about the origin, but for a hole in its middle.
fn addTiles(
    pavement: *MeshBuilder,
    y: f64,
    reach_x: f64,
    reach_z: f64,
    size: f64,
    hole: ?[2]f64,
) Allocator.Error!void {
    const columns: usize = @intFromFloat(2 * reach_x / size + 0.5);
    const rows: usize = @intFromFloat(2 * reach_z / size + 0.5);
    for (0..rows) |row| {
        const z = -reach_z + size * @as(f64, @floatFromInt(row));
        for (0..columns) |column| {
            const x = -reach_x + size * @as(f64, @floatFromInt(column));
            if (hole) |half| {
                const inside_x = @abs(x + size / 2) < half[0];
                if (inside_x and @abs(z + size / 2) < half[1]) continue;
            }
            // Bands join opposite columns of the court, a metre wide.
            const band = @abs(@rem(@abs(x + size / 2) + bay, bay) - bay / 2.0) < size or
                @abs(@rem(@abs(z + size / 2) + bay / 2.0, bay) - bay / 2.0) < size;
            const dark = if (hole == null) band else (row + column) % 2 == 0;
            const number: u32 = @intCast(row * 977 + column);
            const shade = (1 - 0.22 * masonry.scatter(number)) * @as(f32, if (dark) 0.6 else 1);
            pavement.tint = if (dark) .{ shade, shade * 0.82, shade * 0.72 } else @splat(shade);
            try masonry.slab(pavement, .{ x, y, z }, size);
        }
    }
}

/// The fountain in the middle: an octagonal basin and a bowl on a baluster.
fn addFountain(parts: *Parts) Allocator.Error!void {
    parts.setPlace(.identity);
    const stone = parts.get(.stone);
    var basin: Outline = .from(.{ 2.1, 0 });
    basin.line(&.{ .{ 2.1, 0.14 }, .{ 1.75, 0.14 }, .{ 1.75, 0.24 }, .{ 1.64, 0.28 } });
    basin.line(&.{.{ 1.6, 0.66 }});
    basin.curve(.{ 1.72, 0.68 }, .{ 1.74, 0.76 }, 3);
    basin.line(&.{ .{ 1.74, 0.82 }, .{ 1.42, 0.82 }, .{ 1.42, 0.4 } });
    try stone.polygonPrism(basin.points(), 8);
    try parts.get(.water).polygonPrism(&.{ .{ 1.45, 0.7 }, .{ 0, 0.7 } }, 8);

    var stem: Outline = .from(.{ 0.34, 0.5 });
    stem.line(&.{ .{ 0.34, 0.78 }, .{ 0.28, 0.82 } });
    stem.torus(0.04, 0.08, 2);
    stem.curve(.{ 0.1, 0.98 }, .{ 0.14, 1.16 }, 3);
    stem.curve(.{ 0.3, 1.3 }, .{ 0.16, 1.5 }, 4);
    stem.curve(.{ 0.1, 1.6 }, .{ 0.2, 1.64 }, 3);
    stem.curve(.{ 0.72, 1.68 }, .{ 0.86, 1.92 }, 5);
    stem.line(&.{ .{ 0.92, 1.94 }, .{ 0.92, 1.98 }, .{ 0.84, 1.98 } });
    stem.curve(.{ 0.7, 1.84 }, .{ 0.14, 1.84 }, 3);
    stem.curve(.{ 0.08, 2.0 }, .{ 0.12, 2.12 }, 2);
    stem.curve(.{ 0.2, 2.26 }, .{ 0.06, 2.36 }, 3);
    stem.curve(.{ 0.07, 2.5 }, .{ 0, 2.56 }, 3);
    try stone.revolve(stem.points(), 24);
    try parts.get(.water).revolve(&.{ .{ 0.8, 1.93 }, .{ 0, 1.93 } }, 24);
}

/// A clipped shrub in a pot.
fn addShrub(parts: *Parts, origin: Point) Allocator.Error!void {
    parts.setPlace(.translate(origin));
    var pot: Outline = .from(.{ 0.26, 0 });
    pot.line(&.{ .{ 0.3, 0.04 }, .{ 0.27, 0.1 } });
    pot.curve(.{ 0.38, 0.3 }, .{ 0.4, 0.54 }, 4);
    pot.line(&.{ .{ 0.46, 0.56 }, .{ 0.46, 0.66 }, .{ 0.38, 0.66 }, .{ 0.36, 0.58 } });
    pot.line(&.{.{ 0, 0.58 }});
    try parts.get(.roof).revolve(pot.points(), 12);
    try parts.get(.wood).revolve(&.{ .{ 0.05, 0.55 }, .{ 0.035, 1.2 } }, 6);
    try addCrown(parts.get(.leaves), .{ 0, 1.5, 0 }, 0.52);
}

/// Leaves as small facets, thrown about a ball.
fn addCrown(leaves: *MeshBuilder, center: Point, radius: f64) Allocator.Error!void {
    const count = 216;
    for (0..count) |index| {
        // Evenly over the sphere: each step turns by the golden angle and goes down by the same.
        const height = 1 - 2 * (@as(f64, @floatFromInt(index)) + 0.5) / count;
        const azimuth_rad = 2.399963229728653 * @as(f64, @floatFromInt(index));
        const ring = @sqrt(1 - height * height);
        const outward: Point = .{
            ring * elementary.cos(azimuth_rad),
            height,
            ring * elementary.sin(azimuth_rad),
        };
        const number: u32 = @intCast(index);
        const wild: Point = .{
            masonry.scatter(3 * number) - 0.5,
            masonry.scatter(3 * number + 1) - 0.5,
            masonry.scatter(3 * number + 2) - 0.5,
        };
        const normal = geometry.normalize(outward + geometry.scale(wild, 1.3));
        const side = geometry.normalize(geometry.cross(normal, .{ 0.36, 0.48, 0.8 }));
        const tip = geometry.cross(normal, side);
        const size = 0.13;
        const depth = radius * (0.85 + 0.15 * @as(f64, masonry.scatter(number + 5000)));
        const middle = center + geometry.scale(outward, depth);
        const shade = 0.55 + 0.45 * masonry.scatter(number + 9000);
        leaves.tint = .{ shade, shade, shade };
        try leaves.quad(
            middle - geometry.scale(tip, size),
            middle + geometry.scale(side, size / 2.0),
            middle + geometry.scale(tip, size),
            middle - geometry.scale(side, size / 2.0),
        );
    }
}
