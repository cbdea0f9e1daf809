//! The nave of a church with pointed arches, ribbed vaults, aisles and a polygonal apse.
//!
//! The nave runs along x, from its west wall at x = -15 to the apse at x = 15, with piers on
//! z = -4.75 and 4.75; y = 0 is the floor. Both sides are built in the space of their arcade: x
//! along it, y up, z out into the nave. The sun falls in from the south-west; lamps hang in the
//! nave, and one shines on the altar.

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

const bay = 5.0;
const bay_count = 6;
const half_length = bay * bay_count / 2.0;
/// From the middle of the nave to the axes of the piers.
const pier_z = 4.75;
/// Half the thickness of the nave's walls.
const wall_half = 0.5;
const nave_half = pier_z - wall_half;
/// From the axes of the piers to the outer walls.
const aisle_depth = 4.5;
const aisle_middle = (aisle_depth + wall_half) / 2.0;
const aisle_half = (aisle_depth - wall_half) / 2.0;

/// Heights where arches spring and what lies between.
const arcade_spring = 4.2;
const triforium_bottom = 7.6;
const triforium_spring = 8.75;
const triforium_top = 9.5;
const window_sill = 9.95;
const window_spring = 11.6;
const vault_spring = 9.6;
const vault_rise = 4.6;
const wall_top = vault_spring + vault_rise + 0.1;
const aisle_rise = 3.15;

const arcade: Arch = .{ .half_span = 1.75, .offset = 0.9, .half_segments = 8 };
const clerestory: Arch = .{ .half_span = 0.9, .offset = 0.6, .half_segments = 8 };
/// The line of all vaults, stretched to their spans.
const vault: Arch = .{ .half_span = 1, .offset = 0.4, .half_segments = 8 };

/// What has a material of its own.
const Part = enum { stone, wall, floor, wood, gold, cloth, glass, flame };
const Parts = @import("mesh_set.zig").MeshSet(Part);

const materials: std.EnumArray(Part, Material) = .init(.{
    .stone = .{ .base_color = .{ 0.68, 0.59, 0.47, 1 }, .metallic = 0, .roughness = 0.8 },
    .wall = .{ .base_color = .{ 0.80, 0.72, 0.59, 1 }, .metallic = 0, .roughness = 0.9 },
    .floor = .{ .base_color = .{ 0.62, 0.57, 0.50, 1 }, .metallic = 0, .roughness = 0.2 },
    .wood = .{ .base_color = .{ 0.25, 0.13, 0.06, 1 }, .metallic = 0, .roughness = 0.5 },
    .gold = .{ .base_color = .{ 0.9, 0.63, 0.24, 1 }, .metallic = 1, .roughness = 0.2 },
    .cloth = .{ .base_color = .{ 0.75, 0.73, 0.7, 1 }, .metallic = 0, .roughness = 1 },
    .glass = .{ .metallic = 0, .unlit = true },
    .flame = .{ .metallic = 0, .emissive = .{ 3, 1.9, 0.8 } },
});

/// The scene, owned by the caller.
pub fn build(gpa: Allocator) Allocator.Error!Scene {
    var builder: Builder = .init(gpa);
    errdefer builder.deinit();
    var parts: Parts = .init(builder.arena());
    try addSide(&parts, Place.translate(.{ -half_length, 0, -pier_z }));
    try addSide(&parts, Place.identity.turned(2).moved(.{ -half_length, 0, -pier_z }));
    try addVaults(&parts);
    try addApse(&parts);
    try addEndWalls(parts.get(.wall));
    try addFloor(&parts);
    try addChoir(&parts);
    for (0..10) |row| {
        const x = -11.5 + 1.45 * @as(f64, @floatFromInt(row));
        for ([_]f64{ -2.35, 2.35 }) |z| try addPew(parts.get(.wood), .translate(.{ x, 0, z }));
    }
    const lamps = [_]Point{ .{ -5, 5.4, 0 }, .{ 5, 5.4, 0 } };
    for (lamps) |lamp| try addChandelier(&parts, .translate(lamp));
    try parts.finish(&builder, materials);

    try sky.add(&builder, .{
        .radius = 60,
        .azimuth_deg = 40,
        .half_width_deg = 130,
        .elevation_min_deg = -5,
        .elevation_max_deg = 75,
        .low_color = .{ 0.85, 0.92, 1 },
        .high_color = .{ 0.4, 0.6, 0.95 },
    });
    try placing.addDirectionalLight(&builder, .{ -0.42, 0.6, 0.62 }, .{ 1, 0.86, 0.64 }, 9);
    for (lamps) |lamp| {
        // Beside the rod, so that its knob does not darken the crown of the vault.
        const flames = lamp + Point{ -0.3, 0.8, 0 };
        try placing.addPointLight(&builder, flames, .{ 1, 0.78, 0.52 }, 30);
    }
    try placing.addPointLight(&builder, .{ 14.2, 4.5, 0 }, .{ 1, 0.85, 0.65 }, 20);
    builder.scene.ambient = 0.12;
    try placing.addCamera(&builder, .{
        .name = "nave",
        .eye = .{ -14, 2.3, 0.5 },
        .target = .{ 4, 5.2, -0.2 },
        .y_fov_deg = 62,
        .resolution = .{ 1024, 683 },
    });
    return builder.finish();
}

/// Arcade, wall and aisle of one side.
fn addSide(parts: *Parts, place: Place) Allocator.Error!void {
    for (0..bay_count + 1) |index| {
        const x = bay * @as(f64, @floatFromInt(index));
        try addPier(parts.get(.stone), place.moved(.{ x, 0, 0 }));
        try addRespond(parts.get(.stone), place.moved(.{ x, 0, -aisle_depth }));
        // The arch across the aisle.
        parts.get(.stone).place = place.moved(.{ x, arcade_spring, -aisle_middle }).turned(1);
        try masonry.addRib(parts.get(.stone), .{
            .arch = aisle_vault,
            .half_across = aisle_half,
            .rise = aisle_rise,
            .section = &transverse_section,
        });
    }
    for (0..bay_count) |index| {
        const x = bay * (@as(f64, @floatFromInt(index)) + 0.5);
        try addArcadeBay(parts, place.moved(.{ x, 0, 0 }));
        try addTriforium(parts, place.moved(.{ x, 0, 0 }));
        try addClerestory(parts, place.moved(.{ x, 0, 0 }));
        try addAisleBay(parts, place.moved(.{ x, 0, 0 }), @intCast(index));
    }
    parts.get(.stone).place = place.moved(.{ 0, 0, wall_half });
    for ([_]f64{ triforium_bottom, triforium_top }) |y| {
        try masonry.moulding(parts.get(.stone), &.{
            .{ 0, y - 0.14 },    .{ 0.07, y - 0.12 }, .{ 0.14, y - 0.03 }, .{ 0.14, y + 0.04 },
            .{ 0.02, y + 0.12 }, .{ 0, y + 0.12 },
        }, 0, 2 * half_length);
    }
}

const transverse_section = [_][2]f64{
    .{ 0.05, -0.22 }, .{ -0.12, -0.22 }, .{ -0.28, -0.12 },
    .{ -0.28, 0.12 }, .{ -0.12, 0.22 },  .{ 0.05, 0.22 },
};

const diagonal_section = [_][2]f64{
    .{ 0.05, -0.12 }, .{ -0.08, -0.12 }, .{ -0.2, -0.05 },
    .{ -0.2, 0.05 },  .{ -0.08, 0.12 },  .{ 0.05, 0.12 },
};

/// A pier: a core with eight shafts on a common base, and three thin shafts that climb from its
/// capital to the nave's vault.
fn addPier(stone: *MeshBuilder, place: Place) Allocator.Error!void {
    stone.place = place;
    try stone.polygonPrism(&.{
        .{ 0.95, 0 }, .{ 0.95, 0.32 }, .{ 0.86, 0.4 }, .{ 0.86, 0.52 }, .{ 0.4, 0.52 },
    }, 8);
    try stone.revolve(&.{ .{ 0.55, 0.5 }, .{ 0.55, arcade_spring } }, 16);
    var shaft: Outline = .from(.{ 0.17, 0.52 });
    shaft.torus(0.03, 0.08, 2);
    shaft.line(&.{ .{ 0.13, 0.66 }, .{ 0.13, 3.5 }, .{ 0.16, 3.54 }, .{ 0.13, 3.58 } });
    shaft.curve(.{ 0.13, 3.85 }, .{ 0.22, 3.98 }, 3);
    for (0..8) |index| {
        const azimuth_rad = std.math.pi / 4.0 * @as(f64, @floatFromInt(index));
        stone.place = place.moved(.{
            0.58 * elementary.sin(azimuth_rad), 0, 0.58 * elementary.cos(azimuth_rad),
        });
        try stone.revolve(shaft.points(), 8);
    }
    stone.place = place;
    try stone.polygonPrism(&.{
        .{ 0.7, 3.96 },          .{ 0.82, 3.98 },         .{ 0.9, 4.08 },
        .{ 0.9, arcade_spring }, .{ 0.3, arcade_spring },
    }, 8);
    for ([_][2]f64{ .{ -0.24, 0.1 }, .{ 0, 0.15 }, .{ 0.24, 0.1 } }) |thin| {
        const x, const radius = thin;
        const top = vault_spring - 0.16;
        var outline: Outline = .from(.{ radius + 0.06, arcade_spring });
        outline.line(&.{ .{ radius, arcade_spring + 0.15 }, .{ radius, top - 0.54 } });
        outline.line(&.{ .{ radius + 0.03, top - 0.5 }, .{ radius, top - 0.46 } });
        outline.curve(.{ radius, top - 0.14 }, .{ radius + 0.12, top }, 3);
        stone.place = place.moved(.{ x, 0, wall_half + 0.06 });
        try stone.revolve(outline.points(), 8);
    }
    stone.place = place.moved(.{ 0, 0, wall_half });
    try stone.prism(&.{
        .{ 0.3, vault_spring - 0.18 }, .{ 0.4, vault_spring - 0.1 },
        .{ 0.4, vault_spring },        .{ 0.1, vault_spring },
    });
}

/// The half pier on the outer wall that carries the aisle's vault; the wall is at z = 0.
fn addRespond(stone: *MeshBuilder, place: Place) Allocator.Error!void {
    stone.place = place;
    try stone.prism(&.{
        .{ 0.5, 0 }, .{ 0.5, 0.4 }, .{ 0.42, 0.5 }, .{ 0.42, 0.52 }, .{ 0.1, 0.52 },
    });
    var shaft: Outline = .from(.{ 0.3, 0.52 });
    shaft.torus(0.04, 0.1, 2);
    shaft.line(&.{ .{ 0.24, 0.68 }, .{ 0.24, 3.5 }, .{ 0.28, 3.54 }, .{ 0.24, 3.58 } });
    shaft.curve(.{ 0.24, 3.85 }, .{ 0.38, 3.98 }, 3);
    try stone.revolve(shaft.points(), 12);
    try stone.prism(&.{
        .{ 0.36, 3.96 },         .{ 0.46, 4.06 }, .{ 0.46, arcade_spring },
        .{ 0.1, arcade_spring },
    });
}

/// The arch between two piers and the wall above it, up to the triforium.
fn addArcadeBay(parts: *Parts, place: Place) Allocator.Error!void {
    parts.setPlace(place.moved(.{ 0, arcade_spring, 0 }));
    try masonry.archBand(parts.get(.stone), .{ .arch = arcade, .section = &.{
        .{ 0.6, -0.5 }, .{ 0.34, -0.5 }, .{ 0.3, -0.36 }, .{ 0.14, -0.32 },
        .{ 0, -0.16 },  .{ 0, 0.16 },    .{ 0.14, 0.32 }, .{ 0.3, 0.36 },
        .{ 0.34, 0.5 }, .{ 0.46, 0.5 },  .{ 0.5, 0.58 },  .{ 0.6, 0.58 },
        .{ 0.62, 0.5 },
    } });
    try masonry.spandrel(parts.get(.wall), .{
        .arch = arcade,
        .distance = 0.6,
        .half_width = bay / 2.0,
        .top = triforium_bottom - arcade_spring,
        .z = wall_half,
    });
    try masonry.spandrel(parts.get(.wall), .{
        .arch = arcade,
        .distance = 0.34,
        .half_width = bay / 2.0,
        .top = aisle_rise + 0.2,
        .z = -wall_half,
    });
}

/// A row of small blind arches on colonnettes.
fn addTriforium(parts: *Parts, place: Place) Allocator.Error!void {
    const wall = parts.get(.wall);
    const stone = parts.get(.stone);
    parts.setPlace(place);
    const depth = 0.22;
    const back = wall_half - depth;
    try masonry.rectangle(
        wall,
        .{ -bay / 2.0, triforium_bottom },
        .{ bay / 2.0, triforium_top },
        back,
    );
    const count = 5;
    const half_width = 0.42;
    const arch: Arch = .{ .half_span = 0.32, .offset = 0.16, .half_segments = 4 };
    const reach = half_width * count;
    for ([_]f64{ -1, 1 }) |side| {
        const inner = side * reach;
        const outer = side * bay / 2.0;
        const lower = if (side < 0) outer else inner;
        const upper = if (side < 0) inner else outer;
        try masonry.rectangle(
            wall,
            .{ lower, triforium_bottom },
            .{ upper, triforium_top },
            wall_half,
        );
        // The reveal of the first and the last niche.
        const a: Point = .{ inner, triforium_bottom, wall_half };
        const b: Point = .{ inner, triforium_bottom, back };
        const up: Point = .{ 0, triforium_spring - triforium_bottom, 0 };
        if (side < 0) {
            try wall.quad(a, b, b + up, a + up);
        } else {
            try wall.quad(b, a, a + up, b + up);
        }
    }
    for (0..count) |index| {
        const x = half_width * (2 * @as(f64, @floatFromInt(index)) + 1) - reach;
        parts.setPlace(place.moved(.{ x, triforium_spring, 0 }));
        try masonry.archBand(stone, .{ .arch = arch, .section = &.{
            .{ 0, back }, .{ 0, wall_half }, .{ 0.04, wall_half + 0.04 }, .{ 0.1, wall_half },
        } });
        try masonry.spandrel(wall, .{
            .arch = arch,
            .distance = 0.1,
            .half_width = half_width,
            .top = triforium_top - triforium_spring,
            .z = wall_half,
        });
    }
    var outline: Outline = .from(.{ 0.1, triforium_bottom });
    outline.line(&.{ .{ 0.1, triforium_bottom + 0.16 }, .{ 0.06, triforium_bottom + 0.22 } });
    outline.line(&.{ .{ 0.06, triforium_spring - 0.24 }, .{ 0.12, triforium_spring - 0.08 } });
    outline.line(&.{ .{ 0.12, triforium_spring }, .{ 0, triforium_spring } });
    for (0..count + 1) |index| {
        const x = half_width * 2 * @as(f64, @floatFromInt(index)) - reach;
        stone.place = place.moved(.{ x, 0, wall_half - 0.1 });
        try stone.revolve(outline.points(), 6);
    }
}

/// The wall of one bay above the triforium, with its window.
fn addClerestory(parts: *Parts, place: Place) Allocator.Error!void {
    try addWindow(parts, .{
        .place = place.moved(.{ 0, window_spring, 0 }),
        .wall = .{
            .arch = clerestory,
            .distance = 0.25,
            .half_width = bay / 2.0,
            .bottom = triforium_top - window_spring,
            .sill = window_sill - window_spring,
            .top = wall_top - window_spring,
            .z = wall_half,
        },
        .back = -wall_half,
    });
}

const Window = struct {
    /// The middle of the springing line.
    place: Place,
    /// The opening is wider in front by its `distance`.
    wall: masonry.PiercedWall,
    back: f64,
    /// Null: no panes.
    glass_seed: ?u32 = null,
};

/// The wall's front, reveals, tracery of two lights and a ring, bars, and panes if there are any.
fn addWindow(parts: *Parts, window: Window) Allocator.Error!void {
    const stone = parts.get(.stone);
    const wall = window.wall;
    const splay = wall.distance;
    parts.setPlace(window.place);
    try masonry.piercedWall(parts.get(.wall), wall);
    const middle = (wall.z + window.back) / 2;
    try masonry.archBand(stone, .{
        .arch = wall.arch,
        .leg = -wall.sill,
        .section = &.{
            .{ 0, window.back },
            .{ 0, middle },
            .{ splay, wall.z },
            .{ splay + 0.06, wall.z + 0.05 },
            .{ splay + 0.12, wall.z },
        },
    });
    const half = wall.arch.half_span;
    const sill = [_][2]f64{
        .{ half + splay, wall.z },
        .{ half, middle },
        .{ half, window.back },
    };
    for (sill[0..2], sill[1..]) |near, far| {
        const y = wall.sill;
        try stone.quad(
            .{ -near[0], y, near[1] },
            .{ near[0], y, near[1] },
            .{ far[0], y, far[1] },
            .{ -far[0], y, far[1] },
        );
    }
    try addTracery(stone, window, middle);
    const seed = window.glass_seed orelse return;
    parts.setPlace(window.place.moved(.{ 0, 0, middle - 0.08 }));
    try addPanes(parts, wall, seed);
}

/// Two lights and a ring, in the plane `z`.
fn addTracery(stone: *MeshBuilder, window: Window, z: f64) Allocator.Error!void {
    const half = window.wall.arch.half_span;
    const light: Arch = .{
        .half_span = half / 2 - 0.05,
        .offset = (half / 2 - 0.05) * 0.7,
        .half_segments = 4,
    };
    for ([_]f64{ -1, 1 }) |side| {
        stone.place = window.place.moved(.{ side * half / 2, -0.1, z });
        try masonry.archBand(stone, .{
            .arch = light,
            .leg = -window.wall.sill - 0.1,
            .section = &.{
                .{ 0.05, -0.06 }, .{ 0, -0.04 },   .{ 0, 0.04 },
                .{ 0.05, 0.06 },  .{ 0.09, 0.06 },
            },
        });
    }
    // The ring stands between the heads of the lights and that of the window.
    const ring_radius = half * 0.36;
    const ring_y = (light.crown(0) - 0.1 + window.wall.arch.crown(0)) / 2 + 0.04;
    var ring = window.place.moved(.{ 0, ring_y, z });
    ring.y = ring.z;
    ring.z = -window.place.y;
    stone.place = ring;
    try stone.revolve(&.{
        .{ ring_radius - 0.05, -0.06 }, .{ ring_radius - 0.05, 0.06 },
    }, 16);
}

/// Coloured panes in a grid behind the tracery, wider and higher than the opening needs.
fn addPanes(parts: *Parts, wall: masonry.PiercedWall, seed: u32) Allocator.Error!void {
    const glass = parts.get(.glass);
    const palette = [_][3]f32{
        .{ 0.05, 0.12, 0.75 }, .{ 0.04, 0.25, 0.85 }, .{ 0.75, 0.04, 0.05 }, .{ 0.95, 0.62, 0.1 },
        .{ 0.1, 0.45, 0.18 },  .{ 0.2, 0.08, 0.5 },   .{ 0.9, 0.85, 0.6 },   .{ 0.03, 0.08, 0.55 },
    };
    const half = wall.arch.half_span;
    const columns = 8;
    const height = -wall.sill + wall.arch.crown(0);
    const rows: usize = @intFromFloat(height / 0.22);
    defer glass.tint = .{ 1, 1, 1 };
    for (0..rows) |row| {
        const y0 = height * @as(f64, @floatFromInt(row)) / @as(f64, @floatFromInt(rows));
        const y1 = height * @as(f64, @floatFromInt(row + 1)) / @as(f64, @floatFromInt(rows));
        for (0..columns) |column| {
            const x0 = half * (2 * @as(f64, @floatFromInt(column)) / columns - 1);
            const x1 = half * (2 * @as(f64, @floatFromInt(column + 1)) / columns - 1);
            // Mirrored about the middle, as figures and ornaments are.
            const mirrored = if (column < columns / 2) column else columns - 1 - column;
            const number: u32 = @intCast(row * 16 + mirrored);
            const choice = masonry.scatter(seed *% 4096 +% number);
            const color = palette[@intFromFloat(choice * palette.len)];
            const shade = 0.6 + 0.4 * masonry.scatter(number +% seed *% 77 +% 999);
            glass.tint = .{ color[0] * shade, color[1] * shade, color[2] * shade };
            try masonry.rectangle(glass, .{ x0, y0 + wall.sill }, .{ x1, y1 + wall.sill }, 0);
        }
    }
}

const aisle_vault: Arch = .{ .half_span = 1, .offset = 0.4, .half_segments = 4 };

/// Vault, outer wall and window of one bay of an aisle.
fn addAisleBay(parts: *Parts, place: Place, seed: u32) Allocator.Error!void {
    const vault_place = place.moved(.{ 0, arcade_spring, -aisle_middle });
    try addVault(parts, vault_place, .{
        .arch = aisle_vault,
        .half_x = bay / 2.0,
        .half_z = aisle_half,
        .rise = aisle_rise,
    });

    const spring = 4.0;
    try addWindow(parts, .{
        .place = place.moved(.{ 0, spring, -aisle_depth }),
        .wall = .{
            .arch = .{ .half_span = 0.75, .offset = 0.5, .half_segments = 8 },
            .distance = 0.3,
            .half_width = bay / 2.0,
            .bottom = 1.0 - spring,
            .sill = 2.0 - spring,
            .top = arcade_spring + aisle_rise + 0.1 - spring,
            .z = 0,
        },
        .back = -0.7,
    });
    parts.get(.stone).place = place.moved(.{ 0, 0, -aisle_depth });
    try masonry.blocks(parts.get(.stone), .{
        .lower = .{ -bay / 2.0, -0.05 },
        .upper = .{ bay / 2.0, 1.0 },
        .block_width = 0.83,
        .course_height = 0.5,
        .variation = 0.2,
        .seed = seed,
    });
    try masonry.moulding(parts.get(.stone), &.{
        .{ 0, 0.92 }, .{ 0.1, 0.98 }, .{ 0.1, 1.06 }, .{ 0, 1.14 },
    }, -bay / 2.0, bay / 2.0);
}

/// A vault and the two ribs below its groins.
fn addVault(parts: *Parts, place: Place, shape: masonry.Vault) Allocator.Error!void {
    parts.get(.wall).place = place;
    try masonry.groinVault(parts.get(.wall), shape);
    const stone = parts.get(.stone);
    const half_x = shape.half_x;
    const half_z = shape.half_z;
    const half_diagonal = @sqrt(half_x * half_x + half_z * half_z);
    for ([_]f64{ -1, 1 }) |side| {
        const cosine = half_x / half_diagonal;
        const sine = side * half_z / half_diagonal;
        stone.place = .{
            .x = geometry.scale(place.x, cosine) + geometry.scale(place.z, sine),
            .y = place.y,
            .z = geometry.scale(place.z, cosine) - geometry.scale(place.x, sine),
            .translation = place.translation,
        };
        try masonry.addRib(stone, .{
            .arch = shape.arch,
            .half_across = half_diagonal,
            .rise = shape.rise,
            .section = &diagonal_section,
        });
    }
}

/// The vaults of the nave with their ribs and bosses.
fn addVaults(parts: *Parts) Allocator.Error!void {
    for (0..bay_count + 1) |index| {
        const x = bay * @as(f64, @floatFromInt(index)) - half_length;
        parts.get(.stone).place = Place.translate(.{ x, vault_spring, 0 }).turned(1);
        try masonry.addRib(parts.get(.stone), .{
            .arch = vault,
            .half_across = nave_half,
            .rise = vault_rise,
            .section = &transverse_section,
        });
        if (index == bay_count) break;
        const middle: Place = .translate(.{ x + bay / 2.0, vault_spring, 0 });
        try addVault(parts, middle, .{
            .arch = vault,
            .half_x = bay / 2.0,
            .half_z = nave_half,
            .rise = vault_rise,
        });
        try addBoss(parts.get(.stone), middle);
    }
}

/// The stone where ribs meet, hanging below the crown of a vault.
fn addBoss(stone: *MeshBuilder, place: Place) Allocator.Error!void {
    stone.place = place.moved(.{ 0, vault_rise - 0.34, 0 });
    try stone.revolve(&.{
        .{ 0, 0 }, .{ 0.14, 0.02 }, .{ 0.2, 0.08 }, .{ 0.3, 0.12 }, .{ 0.3, 0.3 },
    }, 12);
}

const apse_side_count = 5;

/// The east end: half of a decagon with tall windows, and the ribs that meet above its middle.
fn addApse(parts: *Parts) Allocator.Error!void {
    const center: Point = .{ half_length, 0, 0 };
    const half_angle_rad = std.math.pi / 2.0 / @as(f64, apse_side_count);
    const half_width = nave_half * elementary.sin(half_angle_rad);
    const distance = nave_half * elementary.cos(half_angle_rad);
    for (0..apse_side_count) |side| {
        const turns = 2 * @as(f64, @floatFromInt(side)) + 1 - apse_side_count;
        const azimuth_rad = turns * half_angle_rad;
        const outward: Point = .{ elementary.cos(azimuth_rad), 0, elementary.sin(azimuth_rad) };
        const on_wall: Place = .{
            .x = .{ -outward[2], 0, outward[0] },
            .y = .{ 0, 1, 0 },
            .z = -outward,
            .translation = center + geometry.scale(outward, distance),
        };
        try addApseWall(parts, on_wall, half_width, @intCast(side));
        try addApseWeb(parts, on_wall, half_width, distance);
    }
    for (0..apse_side_count + 1) |corner| {
        const turns = 2 * @as(f64, @floatFromInt(corner)) - apse_side_count;
        const azimuth_rad = turns * half_angle_rad;
        const outward: Point = .{ elementary.cos(azimuth_rad), 0, elementary.sin(azimuth_rad) };
        try addApseRib(parts.get(.stone), center, outward);
    }
    try addBoss(parts.get(.stone), .translate(.{ half_length, vault_spring, 0 }));
}

/// A shaft in a corner of the apse and the rib that it carries to the middle.
fn addApseRib(stone: *MeshBuilder, center: Point, outward: Point) Allocator.Error!void {
    stone.place = .translate(center + geometry.scale(outward, nave_half));
    var outline: Outline = .from(.{ 0.24, 0 });
    outline.line(&.{ .{ 0.24, 0.5 }, .{ 0.16, 0.6 }, .{ 0.16, vault_spring - 0.6 } });
    outline.line(&.{ .{ 0.2, vault_spring - 0.56 }, .{ 0.16, vault_spring - 0.52 } });
    outline.curve(.{ 0.16, vault_spring - 0.3 }, .{ 0.32, vault_spring - 0.1 }, 3);
    outline.line(&.{ .{ 0.32, vault_spring }, .{ 0.05, vault_spring } });
    try stone.revolve(outline.points(), 10);
    stone.place = .{
        .x = -outward,
        .y = .{ 0, 1, 0 },
        .z = geometry.cross(-outward, .{ 0, 1, 0 }),
        .translation = center + Point{ 0, vault_spring, 0 },
    };
    try masonry.addRib(stone, .{
        .arch = vault,
        .half_across = nave_half,
        .rise = vault_rise,
        .section = &diagonal_section,
        .part = .left,
    });
}

fn addApseWall(parts: *Parts, place: Place, half_width: f64, seed: u32) Allocator.Error!void {
    const spring = 7.4;
    try addWindow(parts, .{
        .place = place.moved(.{ 0, spring, 0 }),
        .wall = .{
            .arch = .{ .half_span = 0.75, .offset = 0.6, .half_segments = 8 },
            .distance = 0.2,
            .half_width = half_width,
            .bottom = -spring,
            .sill = 3.2 - spring,
            .top = vault_spring - spring,
            .z = 0,
        },
        .back = -0.7,
        .glass_seed = seed + 1,
    });
    parts.get(.stone).place = place;
    for ([_]f64{ 2.8, vault_spring }) |y| {
        try masonry.moulding(parts.get(.stone), &.{
            .{ 0, y - 0.12 }, .{ 0.1, y - 0.04 }, .{ 0.1, y + 0.04 }, .{ 0, y + 0.14 },
        }, -half_width, half_width);
    }
}

/// The web of the apse's vault above one wall, and the rib on its left.
fn addApseWeb(parts: *Parts, place: Place, half_width: f64, distance: f64) Allocator.Error!void {
    const rows = vault.half_segments + 1;
    const columns = 3;
    var line: [2 * masonry.half_segment_max + 1]Point = undefined;
    vault.curve(0, line[0..vault.pointCount()]);
    const y_scale = vault_rise / vault.crown(0);
    const wall = parts.get(.wall);
    const points = try wall.patchPoints(rows, columns);
    for (0..rows) |row| {
        const share = -line[row][0];
        for (0..columns) |column| {
            const across = @as(f64, @floatFromInt(column)) - 1;
            points[row * columns + column] = .{
                across * half_width * share,
                line[row][1] * y_scale,
                distance * (1 - share),
            };
        }
    }
    wall.place = place.moved(.{ 0, vault_spring, 0 });
    try wall.patch(.{ .points = points, .columns = columns });
}

/// The flat walls at both ends of aisles and nave.
fn addEndWalls(wall: *MeshBuilder) Allocator.Error!void {
    const outer = pier_z + aisle_depth + 0.05;
    wall.place = Place.identity.turned(3).moved(.{ 0, 0, -half_length });
    try masonry.blocks(wall, .{
        .lower = .{ -outer, -0.05 },
        .upper = .{ outer, wall_top },
        .block_width = 1.4,
        .course_height = 0.75,
        .variation = 0.12,
        .seed = 5,
    });
    wall.place = Place.identity.turned(1).moved(.{ 0, 0, -half_length });
    for ([_][2]f64{ .{ -outer, -nave_half }, .{ nave_half, outer } }) |range| {
        try masonry.blocks(wall, .{
            .lower = .{ range[0], -0.05 },
            .upper = .{ range[1], wall_top },
            .block_width = 1.0,
            .course_height = 0.6,
            .variation = 0.12,
            .seed = 6,
        });
    }
}

/// Marble slabs: a pale path with dark lozenges in the nave, checkers in the aisles.
fn addFloor(parts: *Parts) Allocator.Error!void {
    const floor = parts.get(.floor);
    floor.place = .identity;
    defer floor.tint = .{ 1, 1, 1 };
    const size = 0.75;
    const columns: usize = @intFromFloat(2 * half_length / size);
    const half_rows = 13;
    for (0..columns) |column| {
        const x = size * @as(f64, @floatFromInt(column)) - half_length;
        for (0..2 * half_rows) |row| {
            const z = size * (@as(f64, @floatFromInt(row)) - half_rows);
            const dark = (row + column) % 2 == 0;
            const number: u32 = @intCast(row * 1013 + column);
            const shade = (1 - 0.2 * masonry.scatter(number)) * @as(f32, if (dark) 0.42 else 1);
            floor.tint = if (dark) .{ shade, shade * 0.78, shade * 0.68 } else @splat(shade);
            try masonry.slab(floor, .{ x, 0, z }, size);
        }
    }
}

/// Steps to the choir, the altar with its candles and cross.
fn addChoir(parts: *Parts) Allocator.Error!void {
    parts.setPlace(.identity);
    const stone = parts.get(.stone);
    for (0..3) |step| {
        const number: f64 = @floatFromInt(step);
        try stone.box(
            .{ 9.2 + 0.4 * number, 0.16 * number, -4.1 },
            .{ 19.5, 0.16 * (number + 1), 4.1 },
        );
    }
    for (0..2) |step| {
        const number: f64 = @floatFromInt(step);
        const half = 2.6 - 0.4 * number;
        try stone.box(
            .{ 14.0 + 0.4 * number, 0.48 + 0.16 * number, -half },
            .{ 17.4, 0.48 + 0.16 * (number + 1), half },
        );
    }
    try stone.box(.{ 15.5, 0.8, -1.5 }, .{ 16.5, 1.72, 1.5 });
    try parts.get(.cloth).box(.{ 15.38, 1.72, -1.7 }, .{ 16.62, 1.8, 1.7 });
    try parts.get(.cloth).box(.{ 15.45, 1.3, -1.15 }, .{ 15.6, 1.74, 1.15 });
    var candlestick: Outline = .from(.{ 0.12, 1.8 });
    candlestick.line(&.{ .{ 0.12, 1.84 }, .{ 0.04, 1.92 } });
    candlestick.torus(0.03, 0.08, 2);
    candlestick.line(&.{ .{ 0.03, 2.2 }, .{ 0.09, 2.28 }, .{ 0.09, 2.3 }, .{ 0.02, 2.3 } });
    for ([_]f64{ -1.35, -0.95, -0.55, 0.55, 0.95, 1.35 }) |z| {
        parts.setPlace(.translate(.{ 16.2, 0, z }));
        try parts.get(.gold).revolve(candlestick.points(), 10);
        try addCandle(parts, Place.translate(.{ 16.2, 2.3, z }), 0.4);
    }
    parts.setPlace(.identity);
    try parts.get(.gold).box(.{ 16.15, 1.8, -0.2 }, .{ 16.35, 1.9, 0.2 });
    try parts.get(.gold).box(.{ 16.2, 1.9, -0.045 }, .{ 16.29, 3.3, 0.045 });
    try parts.get(.gold).box(.{ 16.2, 2.75, -0.36 }, .{ 16.29, 2.84, 0.36 });
    // The arms of the cross are seen from below as well.
    try parts.get(.gold).quad(
        .{ 16.2, 2.75, -0.36 },
        .{ 16.29, 2.75, -0.36 },
        .{ 16.29, 2.75, 0.36 },
        .{ 16.2, 2.75, 0.36 },
    );
}

/// A candle with its flame.
fn addCandle(parts: *Parts, place: Place, height: f64) Allocator.Error!void {
    parts.setPlace(place);
    try parts.get(.cloth).revolve(&.{ .{ 0.03, 0 }, .{ 0.03, height }, .{ 0, height } }, 6);
    parts.get(.flame).place = place.moved(.{ 0, height, 0 });
    try parts.get(.flame).revolve(&.{ .{ 0.01, 0 }, .{ 0.028, 0.05 }, .{ 0, 0.14 } }, 6);
}

/// A bench, 2.9 metres long across the nave, its seat towards the altar.
fn addPew(wood: *MeshBuilder, place: Place) Allocator.Error!void {
    wood.place = place;
    const half = 1.4;
    try wood.box(.{ 0, 0.4, -half }, .{ 0.42, 0.45, half });
    try wood.box(.{ -0.06, 0.12, -half }, .{ 0, 0.88, half });
    try wood.box(.{ -0.09, 0.88, -half }, .{ 0.05, 0.93, half });
    for ([_]f64{ -half, half }) |z| {
        try wood.box(.{ -0.1, 0, z - 0.04 }, .{ 0.46, 0.62, z + 0.04 });
        try wood.box(.{ -0.1, 0.6, z - 0.045 }, .{ 0.06, 1.05, z + 0.045 });
    }
    try wood.box(.{ -0.34, 0.02, -half }, .{ -0.16, 0.16, half });
}

/// A ring of candles on a long rod.
fn addChandelier(parts: *Parts, place: Place) Allocator.Error!void {
    const radius = 1.0;
    parts.setPlace(place);
    try parts.get(.gold).revolve(&.{
        .{ radius - 0.05, 0.06 },  .{ radius - 0.04, -0.06 }, .{ radius, -0.1 },
        .{ radius + 0.04, -0.06 }, .{ radius + 0.05, 0.06 },  .{ radius - 0.05, 0.06 },
    }, 32);
    const top = vault_spring + vault_rise - place.translation[1];
    try parts.get(.gold).revolve(&.{ .{ 0.02, 1.3 }, .{ 0.02, top } }, 5);
    try parts.get(.gold).revolve(&.{
        .{ 0, 1.16 }, .{ 0.08, 1.22 }, .{ 0.1, 1.3 }, .{ 0.06, 1.38 }, .{ 0, 1.42 },
    }, 10);
    const count = 12;
    for (0..count) |index| {
        const azimuth_rad = 2 * std.math.pi * @as(f64, @floatFromInt(index)) / count;
        const direction: Point = .{ elementary.cos(azimuth_rad), 0, elementary.sin(azimuth_rad) };
        const foot = geometry.scale(direction, radius);
        parts.setPlace(place.moved(foot));
        try parts.get(.gold).revolve(&.{ .{ 0.03, 0.06 }, .{ 0.07, 0.12 }, .{ 0.03, 0.13 } }, 8);
        try addCandle(parts, place.moved(foot + Point{ 0, 0.12, 0 }), 0.22);
        if (index % 3 != 0) continue;
        // A thin bar from the ring up to the knob.
        const side: Point = .{ -direction[2] * 0.012, 0, direction[0] * 0.012 };
        const knob: Point = .{ 0, 1.3, 0 };
        parts.setPlace(place);
        try parts.get(.gold).quad(foot + side, foot - side, knob - side, knob + side);
        try parts.get(.gold).quad(foot - side, foot + side, knob + side, knob - side);
    }
}
