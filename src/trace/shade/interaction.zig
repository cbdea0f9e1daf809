//! Surface interactions: from a hit back to position, normals and material in lanes.
//!
//! In: triangles and barycentrics of hits. Out: what shading needs. The position is a corner plus
//! the mix of the edges, which lies on the triangle whatever the ray's length (Pharr, Jakob and
//! Humphreys, "Physically Based Rendering", 4th edition, section 6.8.4), and rounds but once at the
//! magnitude of coordinates: a scene far from the origin keeps its corners clean.

const world_file = @import("../../world.zig");
const material_file = @import("material.zig");
const offset = @import("offset.zig");
const Nesting = @import("volumes.zig").Nesting;
const Unique = @import("unique.zig").Unique;
const Frame = world_file.Frame;
const Geometry = world_file.Geometry;

/// Hits in lanes.
pub fn Hit(comptime Lanes: type) type {
    return struct {
        /// Lanes that hit something, one at least.
        mask: Lanes.Mask,
        /// Of the rays, the direction not normalised.
        origin: Lanes.Vec3,
        direction: Lanes.Vec3,
        /// In units of the direction.
        t: Lanes.F32,
        /// Weights of corners 0, 1, 2, by the edge functions that decided the hit.
        barycentrics: [3]Lanes.F32,
    };
}

/// Points on surfaces in lanes.
pub fn Interaction(comptime Lanes: type) type {
    return struct {
        /// Lanes that hit something.
        hit: Lanes.Mask,
        position: Lanes.Vec3,
        /// Unit normal of the triangle on the side that the ray came from.
        normal_geometric: Lanes.Vec3,
        /// Unit normal for shading, on the same side.
        normal: Lanes.Vec3,
        /// Unit vector towards where the ray came from.
        view: Lanes.Vec3,
        /// Length of the ray to here, in metres.
        distance: Lanes.F32,
        /// Lanes that see the back of the triangle.
        back: Lanes.Mask,
        /// Lanes where the back is not shown: single-sided and no volume.
        culled: Lanes.Mask,
        /// See `material.opacity`.
        opacity: Lanes.F32,
        /// How far off rays have to start, see `offset.errorUlps`.
        error_ulps: Lanes.F32,
        /// And how far at most.
        offset_max: Lanes.F32,
        /// Width of the ray's cone in metres, negative behind a focus, and how much the surface
        /// bulges towards the ray, see `ray_cone.zig`; undefined in frames without footprints.
        cone_width: Lanes.F32,
        curvature: Lanes.F32,
        /// Where the boundary of a volume has the same volume on both sides: it is not there.
        hidden: Lanes.Mask,
        /// At boundaries of volumes: the index of refraction on the side of the view over that
        /// beyond, what light loses beyond per metre, and the volumes that are there; undefined in
        /// frames without volumes.
        eta: Lanes.F32,
        sigma_beyond: Lanes.Vec3,
        beyond: [Lanes.count]Nesting,
        material: material_file.Material(Lanes),

        /// The position off the surface by what rounding may do, on the side that `away`, the
        /// geometric normal or its opposite, points to; for a ray that starts there, or that
        /// comes from `other_distance` away.
        pub fn offsetOrigin(
            point: *const @This(),
            away: Lanes.Vec3,
            other_distance: Lanes.F32,
        ) Lanes.Vec3 {
            const length = offset
                .length(Lanes, point.error_ulps, other_distance, point.offset_max);
            return point.position.add(away.scale(length));
        }
    };
}

/// What the corners of triangles have, in lanes.
pub fn Corners(comptime Lanes: type) type {
    return struct {
        position: [3]Lanes.Vec3,
        normal: [3]Lanes.Vec3,
        /// Undefined where the scene has none.
        color: [3][4]Lanes.F32,
        material: Lanes.I32,

        const Self = @This();

        /// A triangle at a time: neighbours mostly see the same. A lane that is not asked for has
        /// one that another does.
        pub inline fn of(geometry: *const Geometry, primitive: Lanes.I32, asked: Lanes.Mask) Self {
            const triangles: Unique(Lanes) = .of(primitive, asked);
            var corners: Self = undefined;
            for (0..triangles.count) |index| {
                corners.put(geometry, triangles.numbers[index], triangles.lanes[index]);
            }
            return corners;
        }

        /// The numbers of the materials alone.
        pub inline fn materialsOf(
            geometry: *const Geometry,
            primitive: Lanes.I32,
            asked: Lanes.Mask,
        ) Lanes.I32 {
            var numbers = primitive.toArray();
            var rest = asked.bits();
            while (rest != 0) : (rest &= rest - 1) {
                const number = &numbers[@ctz(rest)];
                number.* = @intCast(geometry.face(@intCast(number.*)).material);
            }
            return .fromArray(numbers);
        }

        /// The vertex colour between the corners; white where the scene has none.
        pub inline fn colorAt(
            corners: *const Self,
            geometry: *const Geometry,
            barycentrics: [3]Lanes.F32,
        ) material_file.Color(Lanes) {
            if (!geometry.hasColors()) return .white;
            var channels: [4]Lanes.F32 = undefined;
            inline for (&channels, 0..) |*channel, index| {
                const a = corners.color[0][index].mul(barycentrics[0]);
                const b = corners.color[1][index].mul(barycentrics[1]);
                const c = corners.color[2][index].mul(barycentrics[2]);
                channel.* = a.add(b).add(c);
            }
            return .{
                .rgb = .{ .x = channels[0], .y = channels[1], .z = channels[2] },
                .alpha = channels[3],
            };
        }

        inline fn put(
            corners: *Self,
            geometry: *const Geometry,
            number: u32,
            lanes: Lanes.Mask,
        ) void {
            const face = geometry.face(number);
            inline for (0..3) |corner| {
                const position = face.position(geometry, corner);
                corners.position[corner] =
                    .select(lanes, .splat(position), corners.position[corner]);
                const normal = face.normal(geometry, corner);
                corners.normal[corner] = .select(lanes, .splat(normal), corners.normal[corner]);
                if (geometry.hasColors()) {
                    const color = face.color(geometry, corner);
                    inline for (&corners.color[corner], color) |*channel, value| {
                        channel.* = .select(lanes, .splat(value), channel.*);
                    }
                }
            }
            const material: Lanes.I32 = .splat(@intCast(face.material));
            corners.material = .select(lanes, material, corners.material);
        }
    };
}

/// The points of hits on the triangles with these corners.
pub inline fn resolve(
    comptime Lanes: type,
    frame: *const Frame,
    all: *const Corners(Lanes),
    hit: *const Hit(Lanes),
) Interaction(Lanes) {
    const F32 = Lanes.F32;
    const corners = all.position;
    const barycentrics = hit.barycentrics;
    const edges = [2]Lanes.Vec3{ corners[1].sub(corners[0]), corners[2].sub(corners[0]) };
    const along = edges[0].scale(barycentrics[1]).add(edges[1].scale(barycentrics[2]));
    const position = corners[0].add(along);
    const plane = edges[0].cross(edges[1]);
    const face = unit(Lanes, plane);
    const back = face.dot(hit.direction).gt(.zero());
    const normal_geometric: Lanes.Vec3 = .select(back, face.neg(), face);
    const smooth = mix(Lanes, barycentrics, all.normal);
    const direction_length = hit.direction.length();
    const distance = hit.t.mul(direction_length);
    const color = all.colorAt(frame.geometry, barycentrics);
    const materials: material_file.Materials(Lanes) =
        .of(frame.materials.all, all.material, hit.mask);
    const material = material_file.load(Lanes, &materials, color.rgb);
    const shows_back = materials.float("double_sided").gt(.zero());
    return .{
        .hit = hit.mask,
        .position = position,
        .normal_geometric = normal_geometric,
        .normal = shadingNormal(Lanes, smooth, normal_geometric),
        .view = hit.direction.neg().scale(F32.splat(1).div(direction_length)),
        .distance = distance,
        .back = back,
        .culled = back.andNot(shows_back).andNot(material.volume),
        .opacity = material_file.opacity(Lanes, &materials, color.alpha),
        .error_ulps = offset.errorUlps(Lanes, corners, position, face, plane, distance),
        .offset_max = padsOf(Lanes, &frame.geometry.padding, corners, hit.origin)
            .mul(.splat(offset.pads_max)),
        .cone_width = undefined,
        .curvature = undefined,
        .hidden = .splat(false),
        .eta = undefined,
        .sigma_beyond = undefined,
        .beyond = undefined,
        .material = material,
    };
}

/// What the test that found a hit was padded by: for the triangle and for the ray's origin.
inline fn padsOf(
    comptime Lanes: type,
    padding: *const world_file.Padding,
    corners: [3]Lanes.Vec3,
    origin: Lanes.Vec3,
) Lanes.F32 {
    const lower = corners[0].min(corners[1]).min(corners[2]);
    const upper = corners[0].max(corners[1]).max(corners[2]);
    const pad = padding.ofBoxes(Lanes, lower, upper, .splat(padding.center));
    return pad.add(padding.shiftOf(Lanes, origin));
}

/// What corners have, between them.
pub inline fn mix(
    comptime Lanes: type,
    barycentrics: [3]Lanes.F32,
    corners: [3]Lanes.Vec3,
) Lanes.Vec3 {
    const first_two = corners[0].scale(barycentrics[0]).add(corners[1].scale(barycentrics[1]));
    return first_two.add(corners[2].scale(barycentrics[2]));
}

/// Unit length for vectors whose squares may leave the range of floats.
pub inline fn unit(comptime Lanes: type, vector: Lanes.Vec3) Lanes.Vec3 {
    const size = vector.abs();
    const largest = size.x.max(size.y).max(size.z);
    return vector.scale(Lanes.F32.splat(1).div(largest)).normalize();
}

/// The interpolated normal at unit length, on the side of the geometric one; that one itself where
/// the vertices have none (zero).
pub fn shadingNormal(
    comptime Lanes: type,
    smooth: Lanes.Vec3,
    normal_geometric: Lanes.Vec3,
) Lanes.Vec3 {
    const normal = unit(Lanes, usableNormal(Lanes, smooth, normal_geometric));
    const opposite = normal.dot(normal_geometric).lt(.zero());
    return .select(opposite, normal.neg(), normal);
}

/// Interpolated normals, or others where vertices have none (zero).
pub inline fn usableNormal(
    comptime Lanes: type,
    smooth: Lanes.Vec3,
    other: Lanes.Vec3,
) Lanes.Vec3 {
    const size = smooth.abs();
    const usable = size.x.max(size.y).max(size.z).gt(.splat(1e-15));
    return .select(usable, smooth, other);
}
