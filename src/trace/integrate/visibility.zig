//! Visibility: what rays see, and how much of a light comes through what stands in its way.
//!
//! In: bundles of rays. Out: closest hits, the interactions there, the transmittance of shadow rays
//! in lanes. Integrators ask here and nowhere else. Light goes straight through what transmits or
//! blends, weakened by each surface in order (`multi_hit.zig`); where no material of a scene lets
//! light pass, the first hit of any kind decides.

const std = @import("std");
const world_file = @import("../../world.zig");
const statistics = @import("../../statistics.zig");
const ray_file = @import("../traverse/ray.zig");
const bundle_file = @import("../traverse/bundle.zig");
const boundaries_file = @import("boundaries.zig");
const passage_file = @import("passage.zig");
const path_file = @import("path.zig");
const dispatch = @import("../traverse/dispatch.zig");
const multi_hit = @import("../traverse/multi_hit.zig");
const triangle = @import("../traverse/triangle.zig");
const interaction_file = @import("../shade/interaction.zig");
const layers_file = @import("../shade/layers.zig");
const material_file = @import("../shade/material.zig");
const sampling = @import("../shade/sampling.zig");
const texturing = @import("../shade/texturing.zig");
const transmission = @import("../shade/transmission.zig");
const Grid = @import("../traverse/beam/grid.zig").Grid;
const Frame = world_file.Frame;
const Light = world_file.Light;

/// Surfaces that one ray goes on through without a bounce (holes, blended or culled ones); beyond
/// them a ray that looks for surfaces leaves the scene, and one that looks for light is stopped.
pub const transparency_depth_max = 255;

/// Surfaces that weaken a shadow ray before the rest counts as opaque.
pub const attenuation_count_max = 67;

/// Light of which no more is left is all gone: 16 surfaces that let a half pass.
const transmittance_min = 0x1p-16;

comptime {
    // Whoever passes all hits of four searches has been weakened too often, unless some were holes.
    std.debug.assert(4 * multi_hit.hits_max == attenuation_count_max + 1);
    std.debug.assert(transparency_depth_max % multi_hit.hits_max == 0);
}

/// Stands for the lights of shadow rays that have none in common.
const no_light: Light = .{
    .kind = .directional,
    .from_receiver = true,
    .position = @splat(0),
    .direction = @splat(0),
    .intensity = @splat(0),
    .range_inv_squared = 0,
    .cone_scale = 0,
    .cone_offset = 1,
};

/// One thread's view of a scene.
pub fn Visibility(comptime Kernel: type) type {
    const Rays = Kernel.Rays;
    const F32 = Rays.F32;
    const Vec3 = Rays.Vec3;
    const Mask = Rays.Mask;
    const group_count = Kernel.group_count;
    const Bundle = bundle_file.Bundle(Kernel);
    const Coherence = dispatch.Coherence;

    return struct {
        frame: *const Frame,
        tests: statistics.TestCounts,
        cuts: statistics.CutCounts,
        hits: multi_hit.HitLists(Kernel),
        /// By group, of the path under way; undefined in frames without volumes.
        boundaries: [group_count]boundaries_file.Boundaries(Kernel),
        /// By group, of the shadow rays under way; undefined in frames where nothing transmits.
        passages: [group_count]passage_file.Passage(Kernel),

        const Self = @This();

        /// In place: it is too large to be handed around.
        pub fn init(visibility: *Self, frame: *const Frame) void {
            visibility.frame = frame;
            visibility.tests = .{};
            visibility.cuts = .{};
            visibility.hits.geometry = frame.geometry;
            visibility.hits.materials = frame.materials;
        }

        /// Finds what the rays of a path see first. A grid says that they are primary ones.
        /// Returns those whose hits are near to each other.
        pub fn closest(
            visibility: *Self,
            path: *path_file.PathState(Kernel),
            grid: ?*const Grid,
        ) Coherence {
            const frame = visibility.frame;
            const tests = &visibility.tests;
            const coherence =
                dispatch.closestHit(Kernel, frame.geometry, &path.bundle, grid, tests);
            if (frame.materials.volumes.len > 0)
                boundaries_file.search(Kernel, visibility, path);
            return coherence;
        }

        /// Transmittance of shadow rays (`shadowRay`) of this light to vertices, in the lanes of
        /// active rays; which rays are active is undefined afterwards. Coherent ones end near to
        /// each other.
        pub fn transmittance(
            visibility: *Self,
            bundle: *Bundle,
            light: *const Light,
            vertices: anytype,
            coherence: Coherence,
            transmittances: *[group_count]Vec3,
        ) void {
            const materials = visibility.frame.materials;
            if (!materials.has_transparency and !materials.has_holes)
                return visibility.occluded(bundle, light, coherence, transmittances);
            transmittances.* = @splat(.splat(.{ 1, 1, 1 }));
            visibility.occlusionPrepass(bundle, light, coherence, transmittances);
            var limits: [group_count]ray_file.Hit(Rays) = undefined;
            for (&limits, &bundle.groups) |*limit, *ray|
                limit.* = shadowLimit(Rays, light, ray.line.direction);
            visibility.attenuated(bundle, light, &limits, vertices, null, transmittances);
        }

        /// The same of shadow rays that have no light in common: each has a direction and an end of
        /// its own, `closest` of the bundle. What scatters light stops it: it goes through what
        /// alpha leaves open and smooth panes, and in the lanes of `straight` as if straight
        /// through smooth boundaries of volumes.
        pub fn transmittanceOfEach(
            visibility: *Self,
            bundle: *Bundle,
            vertices: anytype,
            straight: *const [group_count]Mask,
            transmittances: *[group_count]Vec3,
        ) void {
            const materials = visibility.frame.materials;
            if (!materials.has_transparency and !materials.has_holes)
                return visibility.occluded(bundle, &no_light, .none, transmittances);
            var limits: [group_count]ray_file.Hit(Rays) = undefined;
            for (&limits, &bundle.groups) |*limit, *ray| limit.* = ray.closest;
            transmittances.* = @splat(.splat(.{ 1, 1, 1 }));
            visibility.attenuated(bundle, &no_light, &limits, vertices, straight, transmittances);
        }

        /// Light is stopped by anything: the quick path of scenes where all is opaque.
        fn occluded(
            visibility: *Self,
            bundle: *Bundle,
            light: *const Light,
            coherence: Coherence,
            transmittances: *[group_count]Vec3,
        ) void {
            const geometry = visibility.frame.geometry;
            dispatch.anyHit(Kernel, geometry, bundle, light, coherence, &visibility.tests);
            for (&bundle.groups, transmittances) |*ray, *value| {
                if (ray.active.none()) continue;
                const free = ray.closest.primitive.eq(.splat(ray_file.no_primitive));
                value.* = .select(free, .splat(.{ 1, 1, 1 }), .splat(.{ 0, 0, 0 }));
            }
        }

        /// Light is weakened by what it goes through, from the nearest to the farthest.
        fn attenuated(
            visibility: *Self,
            bundle: *Bundle,
            light: *const Light,
            limits: *const [group_count]ray_file.Hit(Rays),
            vertices: anytype,
            straight: ?*const [group_count]Mask,
            transmittances: *[group_count]Vec3,
        ) void {
            const frame = visibility.frame;
            const passages = &visibility.passages;
            const transmits = frame.materials.has_transmission;
            if (transmits) for (passages) |*passage| passage.start(frame);
            visibility.weaken(bundle, light, limits, vertices, straight, transmittances);
            if (transmits and frame.materials.volumes.len > 0)
                passage_file.absorb(Kernel, passages, bundle, limits, transmittances);
        }

        /// By surfaces.
        fn weaken(
            visibility: *Self,
            bundle: *Bundle,
            light: *const Light,
            limits: *const [group_count]ray_file.Hit(Rays),
            vertices: anytype,
            straight: ?*const [group_count]Mask,
            transmittances: *[group_count]Vec3,
        ) void {
            const none: Vec3 = .splat(.{ 0, 0, 0 });
            var weakened_counts: [group_count]F32 = @splat(.zero());
            for (0..transparency_depth_max / multi_hit.hits_max) |_| {
                for (&bundle.groups, limits) |*ray, limit| ray.closest = limit;
                visibility.hits.trace(bundle, &visibility.tests);
                var any_left = false;
                for (&bundle.groups, transmittances, 0..) |*ray, *value, group| {
                    if (ray.active.none()) continue;
                    visibility.attenuate(
                        ray,
                        light,
                        vertices[group].point.cone_width,
                        if (straight) |lanes| lanes[group] else null,
                        group,
                        value,
                        &weakened_counts[group],
                    );
                    any_left = any_left or ray.active.any();
                }
                if (!any_left) return;
            }
            for (&bundle.groups, transmittances) |*ray, *value| {
                value.* = .select(ray.active, none, value.*);
                visibility.cuts.shadow += ray.active.popCount();
            }
        }

        /// Decides the shadow rays that meet nothing, and those that a search for any hit finds to
        /// meet what no light passes; others stay active. A beam tells quickly; rays by themselves
        /// would take as long as to find what they meet.
        fn occlusionPrepass(
            visibility: *Self,
            bundle: *Bundle,
            light: *const Light,
            coherence: Coherence,
            transmittances: *[group_count]Vec3,
        ) void {
            if (Kernel.variant.traversal != .beam or coherence == .none) return;
            const geometry = visibility.frame.geometry;
            dispatch.anyHit(Kernel, geometry, bundle, light, .all, &visibility.tests);
            for (&bundle.groups, transmittances) |*ray, *value| {
                if (ray.active.none()) continue;
                const primitive = ray.closest.primitive;
                const free = ray.active.bitAnd(primitive.eq(.splat(ray_file.no_primitive)));
                const met = ray.active.andNot(free);
                const stopped: Mask = .fromBits(visibility.hits.stopping(primitive, met));
                value.* = .select(stopped, .splat(.{ 0, 0, 0 }), value.*);
                ray.active = met.andNot(stopped);
            }
        }

        /// Takes shadow rays of a group through the surfaces that they hit; those that stay active
        /// go on.
        fn attenuate(
            visibility: *Self,
            ray: *ray_file.Ray(Rays),
            light: *const Light,
            cone_width: F32,
            straight: ?Mask,
            group: usize,
            value: *Vec3,
            weakened_count: *F32,
        ) void {
            const one: F32 = .splat(1);
            const none: Vec3 = .splat(.{ 0, 0, 0 });
            const stopped: Mask = .fromBits(visibility.hits.stopped[group]);
            value.* = .select(stopped.bitAnd(ray.active), none, value.*);
            ray.active = ray.active.andNot(stopped);
            const passage = &visibility.passages[group];
            const frame = visibility.frame;
            const transmits = frame.materials.has_transmission;
            if (transmits)
                passage.take(&visibility.hits, group, ray.line.direction, ray.active);
            for (0..multi_hit.hits_max) |index| {
                const next = visibility.hits.at(group, index, ray.active);
                ray.active = ray.active.andNot(next.primitive.eq(.splat(ray_file.no_primitive)));
                if (ray.active.none()) return;
                ray.tnear = next;
                const passing: F32 = if (transmits) .fromArray(passage.passing[index]) else one;
                var through = attenuationAt(Rays, frame, ray, light, cone_width, next, passing);
                if (straight) |lanes| through
                    .sharpen(clearLanes(Rays, frame, next.primitive, ray.active, lanes));
                if (transmits) through.hide(.fromBits(passage.hidden[index]));
                value.* = .select(ray.active, value.mul(through.share), value.*);
                weakened_count.* =
                    weakened_count.add(F32.select(through.weakens, one, .zero()));
                const limit: F32 = .splat(attenuation_count_max);
                const ended = weakened_count.gt(limit).bitAnd(ray.active);
                const dark = value.x.max(value.y).max(value.z).le(.splat(transmittance_min));
                visibility.cuts.shadow += ended.andNot(dark).popCount();
                const left = ray.active.andNot(ended).andNot(dark);
                value.* = .select(ray.active.andNot(left), none, value.*);
                ray.active = left;
            }
        }
    };
}

/// Of lanes asked for, those whose triangles light goes straight through, or in those of `straight`
/// as if.
fn clearLanes(
    comptime Rays: type,
    frame: *const Frame,
    primitives: Rays.I32,
    asked: Rays.Mask,
    straight: Rays.Mask,
) Rays.Mask {
    if (!frame.materials.has_transmission) return .splat(false);
    const numbers = primitives.toArray();
    const bent = straight.bits();
    var clear: u32 = 0;
    var bits = asked.bits();
    while (bits != 0) : (bits &= bits - 1) {
        const lane = @ctz(bits);
        const is_straight = bent >> @intCast(lane) & 1 != 0;
        const is_clear = switch (clarityOf(frame, @intCast(numbers[lane]))) {
            .scattering => false,
            .bending => is_straight,
            .pane => true,
        };
        clear |= @as(u32, @intFromBool(is_clear)) << @intCast(lane);
    }
    return .fromBits(clear);
}

/// What a surface does to light that comes through: not in one direction, in another, or straight.
pub const Clarity = enum { scattering, bending, pane };

/// That of a triangle, whatever its textures say.
pub fn clarityOf(frame: *const Frame, primitive: u32) Clarity {
    const material = &frame.materials.all[frame.geometry.face(primitive).material];
    if (!material.transmits()) return .scattering;
    const Single = ray_file.Single;
    const alpha: Single.F32 = .splat(material.roughness * material.roughness);
    const ior: Single.F32 = .splat(material.ior);
    const is_thin = material.volume == 0;
    const width = if (is_thin)
        transmission.thinAlpha(Single, alpha, ior)
    else
        transmission.equalAlpha(Single, alpha, ior);
    if (width.lane(0) > sampling.sharp_alpha_least) return .scattering;
    return if (is_thin) .pane else .bending;
}

/// What active rays lose at the triangles that they hit.
fn attenuationAt(
    comptime Rays: type,
    frame: *const Frame,
    ray: *const ray_file.Ray(Rays),
    light: *const Light,
    cone_width: Rays.F32,
    hit: ray_file.Hit(Rays),
    passing: Rays.F32,
) material_file.Attenuation(Rays) {
    const F32 = Rays.F32;
    const Corners = interaction_file.Corners(Rays);
    const geometry = frame.geometry;
    const all = frame.materials.all;
    // Without vertex colours and textures it is the material's alone.
    if (!geometry.hasColors() and !frame.hasTextures()) {
        const numbers = Corners.materialsOf(geometry, hit.primitive, ray.active);
        return .of(&.of(all, numbers, ray.active), .white, passing);
    }
    const corners: Corners = .of(geometry, hit.primitive, ray.active);
    const weights = triangle.edgeFunctionsOf(Rays, corners.position, ray.line);
    const barycentrics = weights.barycentrics();
    const materials: material_file.Materials(Rays) =
        .of(all, corners.material, ray.active);
    const color = corners.colorAt(geometry, barycentrics);
    if (!frame.hasTextures()) return .of(&materials, color, passing);
    // As wide as what the shadow falls on is seen; a cone with its apex in the light.
    const share: F32 = if (light.kind == .directional)
        .splat(1)
    else if (light.from_receiver)
        F32.splat(1).sub(hit.t)
    else
        hit.t;
    const place: texturing.Place(Rays) = .{
        .asked = ray.active,
        .primitive = hit.primitive,
        .barycentrics = barycentrics,
        .axes = .ofCorners(
            corners.position,
            ray.line.direction.normalize(),
            cone_width.mul(share),
        ),
    };
    const colored = texturing.colored(Rays, frame, &materials, &place, color);
    const clear = texturing.transmission(Rays, frame, &materials, &place);
    return .of(&materials, colored, passing.mul(clear));
}

/// The points that the rays of a group of a `PathState` see. Asserts that some active ray hit
/// something.
pub fn findInteraction(
    comptime Lanes: type,
    frame: *const Frame,
    path: anytype,
    group: usize,
    point: *interaction_file.Interaction(Lanes),
) void {
    const ray = &path.bundle.groups[group];
    const missed = ray.closest.primitive.eq(.splat(ray_file.no_primitive));
    const hit = ray.active.andNot(missed);
    std.debug.assert(hit.any());
    const corners: interaction_file.Corners(Lanes) =
        .of(frame.geometry, ray.closest.primitive, hit);
    point.* = interaction_file.resolve(Lanes, frame, &corners, &hitOf(Lanes, ray, &corners, hit));
    if (!frame.needsFootprints()) return;
    // What rough surfaces on the way blur, textures are looked up as wide.
    const rough = path.roughness[group].mul(path.roughness[group]);
    const spread = path.cone_spread[group];
    const widened = spread.add(rough.copySign(spread));
    const cone = [2]Lanes.F32{ path.cone_width[group], widened };
    addFootprint(Lanes, frame, ray, cone, point);
}

/// A group's hits in these lanes.
pub inline fn hitOf(
    comptime Lanes: type,
    ray: *const ray_file.Ray(Lanes),
    corners: *const interaction_file.Corners(Lanes),
    hit: Lanes.Mask,
) interaction_file.Hit(Lanes) {
    const weights = triangle.edgeFunctionsOf(Lanes, corners.position, ray.line);
    return .{
        .mask = hit,
        .origin = ray.line.origin,
        .direction = ray.line.direction,
        .t = ray.closest.t,
        .barycentrics = weights.barycentrics(),
    };
}

/// What depends on the cones of rays. It gathers what hits are made of once more, so that the
/// compiler keeps it in registers where there are no cones.
noinline fn addFootprint(
    comptime Lanes: type,
    frame: *const Frame,
    ray: *const ray_file.Ray(Lanes),
    cone: [2]Lanes.F32,
    point: *interaction_file.Interaction(Lanes),
) void {
    const primitive = ray.closest.primitive;
    const corners: interaction_file.Corners(Lanes) = .of(frame.geometry, primitive, point.hit);
    const hit = hitOf(Lanes, ray, &corners, point.hit);
    texturing.apply(Lanes, frame, &corners, &hit, primitive, cone, point);
}

/// The further lobes at points (`findInteraction`), in frames in which materials have some.
pub fn findLayers(
    comptime Lanes: type,
    frame: *const Frame,
    ray: *const ray_file.Ray(Lanes),
    point: *interaction_file.Interaction(Lanes),
    layers: *layers_file.Layers(Lanes),
) void {
    const primitive = ray.closest.primitive;
    const corners: interaction_file.Corners(Lanes) = .of(frame.geometry, primitive, point.hit);
    const hit = hitOf(Lanes, ray, &corners, point.hit);
    layers_file.find(Lanes, frame, &.{
        .corners = &corners,
        .hit = &hit,
        .primitive = primitive,
    }, point, layers);
}

/// The shadow rays of points off surfaces (`Interaction.offsetOrigin`), which never hit the
/// triangle whose surface it is. Those of point and spot lights run from the light, so that all of
/// them share an origin, but for those of `Light.from_receiver`.
pub fn shadowRay(
    comptime Lanes: type,
    light: *const Light,
    point: Lanes.Vec3,
    primitive: Lanes.I32,
    active: Lanes.Mask,
) ray_file.Ray(Lanes) {
    const source: Lanes.Vec3 = .splat(light.position);
    const line: ray_file.Line(Lanes) = if (light.kind == .directional)
        .init(point, Lanes.Vec3.splat(light.direction).neg())
    else if (light.from_receiver)
        .init(point, source.sub(point))
    else
        .init(source, point.sub(source));
    return .{
        .line = line,
        .tnear = .start(),
        .closest = shadowLimit(Lanes, light, line.direction),
        .skip = primitive,
        .active = active,
    };
}

/// Where shadow rays leave what they go through, at the latest.
pub fn shadowEnd(light: *const Light) f32 {
    return if (light.kind == .directional) std.math.inf(f32) else 1;
}

/// Where shadow rays end: those with a light of some radius run from what they light.
fn shadowLimit(
    comptime Lanes: type,
    light: *const Light,
    direction: Lanes.Vec3,
) ray_file.Hit(Lanes) {
    if (light.kind == .directional) return .before(.splat(std.math.inf(f32)));
    if (light.radius == 0) return .before(.splat(1));
    std.debug.assert(light.from_receiver);
    const length = direction.length().max(.splat(1e-20));
    return .before(Lanes.F32.splat(1).sub(Lanes.F32.splat(light.radius).div(length)).max(.zero()));
}
