//! Stage 2: `Scene` -> `World`.
//!
//! In: what a file says, and what the user wants to see of it. Out: triangles in world space,
//! a bounding volume hierarchy over them, materials, lights, and a camera. All of it but the tree's
//! width is a function of the scene and the settings alone: not of the threads, nor of the machine.

const std = @import("std");
const builtin = @import("builtin");
const choices = @import("settings.zig");
const math = @import("math.zig");
const parallel = @import("parallel.zig");
const scene = @import("scene.zig");
const simd = @import("simd.zig");
const statistics = @import("statistics.zig");
const world = @import("world.zig");
const Diagnostic = @import("diagnostic.zig").Diagnostic;
const alpha = @import("prepare/alpha.zig");
const animate = @import("prepare/animate.zig");
const bvh_input = @import("prepare/bvh/input.zig");
const bvh_refit = @import("prepare/bvh/refit.zig");
const bvh_wide = @import("prepare/bvh/wide.zig");
const check = @import("prepare/bvh/check.zig");
const deform = @import("prepare/deform.zig");
const Drawn = @import("prepare/drawn.zig");
const flatten = @import("prepare/flatten.zig");
const emitter_lights = @import("prepare/emitter_lights.zig");
const extent_file = @import("prepare/extent.zig");
const emission_points = @import("prepare/emission_points.zig");
const emitters = @import("prepare/emitters.zig");
const environment = @import("prepare/environment.zig");
const sharing_file = @import("prepare/instances.zig");
const join = @import("prepare/bvh/join.zig");
const light = @import("prepare/light.zig");
const light_sampler = @import("prepare/light_sampler.zig");
const material = @import("prepare/material.zig");
const motion_file = @import("prepare/motion.zig");
const place_file = @import("prepare/pose.zig");
const reference_file = @import("prepare/reference.zig");
const representative_lights = @import("prepare/representative_lights.zig");
const tangents = @import("prepare/tangents.zig");
const texture = @import("prepare/texture.zig");
const strokes = @import("prepare/strokes.zig");
const view_file = @import("prepare/view.zig");
const assert = std.debug.assert;
const Allocator = std.mem.Allocator;
const Clock = std.Io.Clock;
const Progress = @import("progress.zig").Progress;
const Scene = scene.Scene;
const StageTimes = statistics.StageTimes;
const TreeQuality = choices.TreeQuality;
const World = world.World;

/// What is made once of a scene, for all of its poses.
pub const Loaded = struct {
    textures: texture.TextureSet,
    arena: std.heap.ArenaAllocator,
    /// What of the scene is drawn: meshes with the tangents that textures need, without what can
    /// be seen nowhere.
    parts: alpha.Parts,

    /// Frees everything.
    pub fn deinit(loaded: *Loaded) void {
        loaded.textures.deinit();
        loaded.arena.deinit();
        loaded.* = undefined;
    }
};

/// How textures are made, and by whom.
pub const LoadSettings = texture.Settings;

/// `SceneTooLarge`: the textures are; the diagnostic says more.
pub const LoadError = texture.Error;

/// How the geometry is made ready, and by whom.
pub const PoseSettings = struct {
    /// Width of the tree's nodes and triangle packs: 4, 8 or 16.
    lanes: u8,
    pool: *parallel.Pool,
    tree_quality: TreeQuality = .default,
    /// When instances share their meshes.
    sharing: SharingRule = .{},
    /// Diameter of points and width of lines, in pixels of the automatic view.
    point_size: f32 = choices.point_size.default,
    /// The first set of texture coordinates is there, whatever textures want.
    keeps_texcoords: bool = false,
    /// What decides how large these are.
    view: WantedView = .{},
};

/// What of the file each triangle is.
pub const Origins = @import("prepare/origins.zig");

/// Of the triangles of a world that was made with this cache. `from` is the scene that it shows.
pub fn originsOf(
    gpa: Allocator,
    from: *const Scene,
    loaded: *const Loaded,
    cache: *const PoseCache,
) error{OutOfMemory}!Origins {
    return .init(gpa, from, &loaded.parts, cache.plan.detail);
}

/// See `PoseSettings`.
pub const SharingRule = sharing_file.Rule;

/// See `PoseSettings`.
pub const WantedView = view_file.Wanted;

/// The box of what a scene draws.
pub const extentOf = extent_file.of;
/// See `extentOf`.
pub const Extent = extent_file.Extent;
/// Width and height of the picture that is made where nobody says more.
pub const pictureSize = view_file.pictureSize;
/// Bytes that textures take.
pub const planTextures = texture.plan;

/// Which meshes of a scene its instances share, unless the user says; false: none.
pub fn chooseShared(
    gpa: Allocator,
    from: *const Scene,
    chosen: []bool,
) error{OutOfMemory}!bool {
    return sharing_file.choose(gpa, &.{
        .sources = &.{},
        .materials = from.materials,
        .meshes = from.meshes,
        .instances = from.instances,
    }, .{}, chosen);
}

/// What is seen of it, and in what light.
pub const ViewSettings = struct {
    camera: choices.Camera = .default,
    viewpoint: choices.Viewpoint = .{},
    /// Width and height in pixels, at least 1 each.
    resolution: ?[2]u32 = null,
    /// Where there is no resolution, pixels of the longer side.
    long_side: ?u32 = null,
    /// Radiance from everywhere, at least 0.
    ambient: ?f32 = null,
    /// Linear RGB.
    background: ?math.Vec3 = null,
    environment: light.EnvironmentSettings = .{},
    floor: choices.Floor = .none,
    emitters: bool = true,
    /// What primary rays see in its place.
    backdrop: ?light.EnvironmentSettings = null,
    /// What is framed in place of the world.
    motion: ?*const Motion = null,
    /// Of an earlier view, with the shift of this pose.
    reference: ?*const Reference = null,
};

/// `SceneTooLarge`: more than some 2 billion triangles or vertices; the diagnostic says more.
pub const PoseError = error{ OutOfMemory, SceneTooLarge } || parallel.Error;

/// `CameraUnknown`: no camera has that name or index; the diagnostic says more.
pub const ViewError = error{ OutOfMemory, CameraUnknown };

/// `AnimationUnknown`: none has that name or index; the diagnostic says more.
pub const AnimateError = animate.Error;

pub const Error = LoadError || PoseError || ViewError || AnimateError;

/// A scene at a moment of its animations, for `pose` and `view`.
pub const AnimatedScene = animate.Posed;
/// Makes one.
pub const animateScene = animate.pose;
/// All moments of animations at once.
pub const Motion = motion_file;
/// What the pictures of a film have of one of them.
pub const Reference = reference_file;

/// Makes what does not depend on where things are: textures, and tangents for them. The memory is
/// the result's and comes from `gpa`. Fills `texture_ns` of `times`.
pub fn load(
    gpa: Allocator,
    io: std.Io,
    from: *const Scene,
    settings: LoadSettings,
    diagnostic: *Diagnostic,
    times: *StageTimes,
) LoadError!Loaded {
    const mode = simd.setFlushToZero();
    defer simd.setFloatControl(mode);
    const start = Clock.awake.now(io);
    var textures = try texture.load(gpa, from, settings, diagnostic);
    errdefer textures.deinit();
    var arena: std.heap.ArenaAllocator = .init(gpa);
    errdefer arena.deinit();
    const instances = try visibleInstances(arena.allocator(), &textures, from);
    const meshes = try tangents.make(
        gpa,
        arena.allocator(),
        from,
        instances,
        &textures,
        settings.pool,
        diagnostic,
    );
    const parts = try alpha.split(
        gpa,
        arena.allocator(),
        from.materials,
        meshes,
        instances,
        &textures,
        settings.pool,
    );
    times.texture_ns = nanoseconds(start.durationTo(Clock.awake.now(io)));
    return .{ .textures = textures, .arena = arena, .parts = parts };
}

/// Those whose material is all holes, or all clear, are as good as not there.
fn visibleInstances(
    arena: Allocator,
    textures: *const texture.TextureSet,
    from: *const Scene,
) error{OutOfMemory}![]const scene.Instance {
    var visible: std.ArrayList(scene.Instance) = try .initCapacity(arena, from.instances.len);
    for (from.instances) |instance| {
        const index = from.meshes[instance.mesh].material;
        if (material.isVisible(&from.materials[index], &textures.materials[index])) {
            visible.appendAssumeCapacity(instance);
        }
    }
    return visible.items;
}

/// What of the vertices the materials ask for.
fn attributesOf(
    textures: *const texture.TextureSet,
    settings: *const PoseSettings,
) flatten.Attributes {
    var attributes: flatten.Attributes = .{};
    attributes.texcoord_sets[0] = settings.keeps_texcoords;
    for (textures.lookups) |lookup| attributes.texcoord_sets[lookup.texcoord_set] = true;
    for (textures.materials) |use| if (use.tangents != null) {
        attributes.tangents = true;
    };
    return attributes;
}

/// Makes environment maps.
pub const makeEnvironment = environment.make;
/// See `makeEnvironment`.
pub const EnvironmentError = environment.Error;
/// See `makeEnvironment`.
pub const EnvironmentSource = environment.Source;
/// See `makeEnvironment`.
pub const OwnedEnvironmentMap = environment.OwnedMap;
/// Makes light lists.
pub const makeLightSampler = light_sampler.make;
/// See `emission_points.zig`.
pub const findEmission = emission_points.find;
/// See `makeLightSampler`.
pub const OwnedLightSampler = light_sampler.OwnedLightSampler;
/// How a map is placed around the scene.
pub const EnvironmentSettings = light.EnvironmentSettings;

/// A world, and what of it the next pose has a use for.
pub const Posed = struct {
    world: World,
    cache: PoseCache,

    /// Frees both.
    pub fn deinit(posed: *Posed) void {
        posed.cache.deinit();
        posed.world.deinit();
    }
};

/// What a pose leaves for the next one of the same scene: how triangles are numbered, arrays to be
/// written again, a tree to be fitted. The memory of arrays and tree is the world's.
pub const PoseCache = struct {
    gpa: Allocator,
    /// Its memory is the world's.
    sharing: sharing_file.Sharing,
    plan: flatten.Plan,
    arrays: flatten.Arrays,
    /// What was subtracted from all places.
    shift: math.Vec3d = @splat(0),
    tree: ?bvh_refit.AnyRefit = null,
    lanes: u8,
    tree_quality: TreeQuality,
    point_size: f32,
    keeps_texcoords: bool,

    /// Frees it.
    pub fn deinit(cache: *PoseCache) void {
        if (cache.tree) |*tree| tree.deinit(cache.gpa);
        cache.plan.deinit(cache.gpa);
        cache.* = undefined;
    }

    /// Whether a pose with these settings can use it. Which instances share a mesh depends on where
    /// they stand.
    pub fn fits(cache: *const PoseCache, settings: *const PoseSettings) bool {
        return cache.sharing.instances.len == 0 and cache.lanes == settings.lanes and
            cache.tree_quality == settings.tree_quality and
            cache.point_size == settings.point_size and
            cache.keeps_texcoords == settings.keeps_texcoords;
    }
};

/// Places what is in a scene, as it stands, and builds the tree over it: a world in which nothing
/// shines and that is seen by nobody yet. Its memory comes from `gpa` by way of arenas: its few
/// large arrays are a block of `gpa` each, of which an arena asks for half as much again but
/// touches only what is used. What was loaded of the scene has to live as long. Fills `prepare_ns`
/// and `bvh_build_ns` of `times`.
pub fn pose(
    gpa: Allocator,
    io: std.Io,
    from: *const Scene,
    loaded: *const Loaded,
    settings: PoseSettings,
    diagnostic: *Diagnostic,
    times: *StageTimes,
) PoseError!Posed {
    assert(settings.lanes == 4 or settings.lanes == 8 or settings.lanes == 16);
    const start = Clock.awake.now(io);
    var posed: Posed = .{ .world = .init(gpa), .cache = undefined };
    errdefer posed.world.deinit();
    const parts = &loaded.parts;
    const point_size = settings.point_size;
    const attributes = attributesOf(&loaded.textures, &settings);
    const snapshot: Snapshot = try .of(posed.world.pose_arena.allocator(), from, loaded);
    const sharing = try shareMeshes(&posed.world, gpa, &snapshot, loaded, settings);
    var plan: flatten.Plan = try .init(gpa, sharing.flat, parts.meshes, point_size, diagnostic);
    errdefer plan.deinit(gpa);
    try expectRoom(gpa, plan.with_room.triangle_count);
    posed.cache = .{
        .gpa = gpa,
        .sharing = sharing,
        .plan = plan,
        .arrays = try plan.alloc(posed.world.arena.allocator(), attributes),
        .lanes = settings.lanes,
        .tree_quality = settings.tree_quality,
        .point_size = point_size,
        .keeps_texcoords = settings.keeps_texcoords,
    };
    const planned_ns = nanoseconds(start.durationTo(Clock.awake.now(io)));
    try placeAll(
        &posed.world,
        &posed.cache,
        io,
        from,
        &snapshot,
        loaded,
        settings,
        diagnostic,
        times,
    );
    times.prepare_ns += planned_ns;
    return posed;
}

/// Below, it is soon known without being asked.
const expected_bytes_min = 1 << 30;

/// Fails where there is no room for the tree over so many triangles and these themselves: before
/// they are placed, which takes long where they are too many.
fn expectRoom(gpa: Allocator, triangle_count: u32) error{OutOfMemory}!void {
    const each = @sizeOf(world.Triangle) + bvh_wide.build_triangle_bytes;
    const bytes = std.math.cast(usize, @as(u64, triangle_count) * each) orelse
        return error.OutOfMemory;
    if (bytes < expected_bytes_min) return;
    // Not touched.
    const room = gpa.rawAlloc(bytes, .@"64", @returnAddress()) orelse return error.OutOfMemory;
    gpa.rawFree(room[0..bytes], .@"64", @returnAddress());
}

/// Where a scene's nodes are, and what is drawn of it.
const Snapshot = struct {
    place: place_file.Pose,
    drawn: Drawn,

    /// As the scene stands. Not inlined, see `chooseView`.
    noinline fn of(
        arena: Allocator,
        from: *const Scene,
        loaded: *const Loaded,
    ) error{OutOfMemory}!Snapshot {
        const mode = simd.setFlushToZero();
        defer simd.setFloatControl(mode);
        return .{
            .place = try place_file.compose(arena, from),
            .drawn = try .of(arena, from, &loaded.parts, &loaded.textures),
        };
    }
};

/// What instances share, where they do. Not inlined, see `chooseView`.
noinline fn shareMeshes(
    posed: *World,
    gpa: Allocator,
    snapshot: *const Snapshot,
    loaded: *const Loaded,
    settings: PoseSettings,
) PoseError!sharing_file.Sharing {
    const mode = simd.setFlushToZero();
    defer simd.setFloatControl(mode);
    return sharing_file.share(
        gpa,
        posed.arena.allocator(),
        &snapshot.drawn.parts,
        attributesOf(&loaded.textures, &settings),
        &snapshot.place,
        &.{
            .rule = settings.sharing,
            .lanes = settings.lanes,
            .quality = settings.tree_quality,
            .pool = settings.pool,
        },
    );
}

/// Makes a world that `pose` made of the scene what it would be if `pose` had been called now: but
/// for the shape of the tree, which no picture depends on. Nodes, weights and materials in motion
/// may be others; meshes and instances are the same, and `cache` fits the settings. Where this
/// fails, world and cache are of no use but to be freed.
pub fn poseAgain(
    posed: *World,
    cache: *PoseCache,
    io: std.Io,
    from: *const Scene,
    loaded: *const Loaded,
    settings: PoseSettings,
    diagnostic: *Diagnostic,
    times: *StageTimes,
) PoseError!void {
    assert(cache.fits(&settings));
    const start = Clock.awake.now(io);
    _ = posed.pose_arena.reset(.retain_capacity);
    const snapshot: Snapshot = try .of(posed.pose_arena.allocator(), from, loaded);
    const composed_ns = nanoseconds(start.durationTo(Clock.awake.now(io)));
    try placeAll(posed, cache, io, from, &snapshot, loaded, settings, diagnostic, times);
    times.prepare_ns += composed_ns;
}

fn placeAll(
    posed: *World,
    cache: *PoseCache,
    io: std.Io,
    from: *const Scene,
    snapshot: *const Snapshot,
    loaded: *const Loaded,
    settings: PoseSettings,
    diagnostic: *Diagnostic,
    times: *StageTimes,
) PoseError!void {
    const mode = simd.setFlushToZero();
    defer simd.setFloatControl(mode);
    const start = Clock.awake.now(io);
    Progress.begin(settings.pool.progress, .{ .stage = .geometry });
    const gpa = cache.gpa;
    const arena = posed.pose_arena.allocator();
    const place = &snapshot.place;
    const parts = &snapshot.drawn.parts;
    cache.shift = place.shift;
    var soup = try cache.plan.place(
        gpa,
        arena,
        &cache.arrays,
        if (cache.sharing.instances.len > 0) cache.sharing.flat else parts.instances,
        parts.meshes,
        place,
        settings.pool,
        diagnostic,
    );
    var geometry = geometryOf(&soup, place, &cache.sharing);
    if (soup.strokes.spheres.len > 0) {
        const materials = parts.materials;
        const pixel = try view_file.pixelSize(gpa, from, materials, &geometry, &settings.view);
        try strokes.draw(gpa, &soup, pixel * settings.point_size / 2, settings.pool);
        geometry = geometryOf(&soup, place, &cache.sharing);
    }
    geometry.shared = try sharing_file.numberAll(
        gpa,
        arena,
        &cache.sharing,
        parts,
        &soup,
        attributesOf(&loaded.textures, &settings),
    );
    const materials = try material.place(arena, parts, &snapshot.drawn.textures, &geometry);
    const tree_start = Clock.awake.now(io);
    const tree_facts = try fitTree(&posed.tree_arena, cache, &geometry, settings);
    const end = Clock.awake.now(io);
    times.prepare_ns = nanoseconds(start.durationTo(tree_start));
    times.bvh_build_ns = nanoseconds(tree_start.durationTo(end));
    posed.* = .{
        .arena = posed.arena,
        .tree_arena = posed.tree_arena,
        .pose_arena = posed.pose_arena,
        .view_arena = posed.view_arena,
        .geometry = geometry,
        .node_maps = place.maps,
        .materials = materials,
        .textures = loaded.textures.textures,
        .facts = .{
            .tree = tree_facts,
            .degenerate_count = soup.dropped_count + cache.sharing.dropped_count,
            .stroke_triangle_count = soup.triangles.len - soup.surface_count -
                soup.dropped_stroke_count,
        },
    };
    if (builtin.mode == .debug) try check.check(gpa, posed);
}

/// All but the tree.
fn geometryOf(
    soup: *const flatten.TriangleSoup,
    place: *const place_file.Pose,
    sharing: *const sharing_file.Sharing,
) world.Geometry {
    const bounds = soup.bounds.join(sharing.bounds);
    var geometry: world.Geometry = .{
        .tree = world.Geometry.empty.tree,
        .positions = soup.positions,
        .normals = soup.normals,
        .colors = soup.colors,
        .tangents = soup.tangents,
        .triangles = soup.triangles,
        .dropped_count = soup.dropped_count + soup.dropped_stroke_count,
        .surface_count = soup.surface_count,
        .spheres = soup.strokes.spheres,
        .sphere_radius = soup.sphere_radius,
        .bounds = bounds,
        .centroid_bounds = soup.centroid_bounds,
        .padding = .init(place_file.round(place.center), bounds),
        .size = @floatCast(place.size),
    };
    for (&geometry.texcoords, soup.texcoords) |*to, set| to.* = set;
    return geometry;
}

/// Brings `motion` up to all that these animations show, where it is not that already; null where
/// there are none. `from` is the scene at rest, `cache` that of the pose that is shown.
pub fn gatherMotion(
    gpa: Allocator,
    from: *const Scene,
    loaded: *const Loaded,
    running: animate.Running,
    cache: *const PoseCache,
    pool: *parallel.Pool,
    motion: *?Motion,
) PoseError!void {
    if (motion.*) |*known| {
        if (std.meta.eql(known.shift, cache.shift)) return;
        known.deinit();
        motion.* = null;
    }
    const mode = simd.setFlushToZero();
    defer simd.setFloatControl(mode);
    const parts = &loaded.parts;
    motion.* =
        try .gather(gpa, from, parts, &loaded.textures, running, cache.shift, pool);
}

fn nanoseconds(duration: std.Io.Duration) u64 {
    return @intCast(@max(duration.toNanoseconds(), 0));
}

/// Chooses camera, size and light of a world that was made of this scene, in place of those that
/// it had: the tree stays as it is. Adds to `prepare_ns` of `times`.
pub fn view(
    seen: *World,
    io: std.Io,
    from: *const Scene,
    settings: ViewSettings,
    diagnostic: *Diagnostic,
    times: *StageTimes,
) ViewError!void {
    const mode = simd.setFlushToZero();
    defer simd.setFloatControl(mode);
    const start = Clock.awake.now(io);
    try chooseView(seen, from, settings, diagnostic);
    times.prepare_ns += nanoseconds(start.durationTo(Clock.awake.now(io)));
}

/// Not inlined, so that no arithmetic moves before the mode is set.
noinline fn chooseView(
    seen: *World,
    from: *const Scene,
    settings: ViewSettings,
    diagnostic: *Diagnostic,
) ViewError!void {
    const gpa = seen.view_arena.child_allocator;
    seen.lights = &.{};
    seen.all_lights = null;
    _ = seen.view_arena.reset(.retain_capacity);
    const arena = seen.view_arena.allocator();
    const reference = settings.reference;
    const kept = if (reference) |first| first.view else null;
    const chosen = kept orelse try chooseCamera(seen, from, &settings, diagnostic);
    const facing = if (reference) |first| &first.facing else &chosen.camera;
    seen.view = .{ .camera = chosen.camera, .width = chosen.width, .height = chosen.height };
    try placeLights(seen, from, diagnostic);
    const shining = if (settings.emitters or from.has_area_lights)
        try emittersOf(gpa, seen, from)
    else
        &.{};
    if (from.has_area_lights) seen.lights = try std.mem.concat(arena, world.Light, &.{
        seen.lights, shining,
    });
    // What shines from everywhere is a light too.
    seen.facts.own_light_count = seen.lights.len;
    const has_map = settings.environment.map != null;
    const lights_are_default = seen.lights.len == 0 and from.ambient == null and !has_map;
    if (lights_are_default) seen.lights = try light.placeRig(arena, facing);
    seen.facts.emitter_count = if (from.has_area_lights) 0 else shining.len;
    if (seen.facts.emitter_count > 0) seen.lights = try std.mem.concat(arena, world.Light, &.{
        seen.lights, shining,
    });
    seen.environment = light.environment(
        lights_are_default,
        from.ambient,
        settings.ambient,
        settings.background orelse from.background,
    );
    light.addMap(&seen.environment, &settings.environment, facing);
    if (settings.floor == .shadow) seen.environment.floor_height = if (reference) |first|
        first.floor_height
    else
        light.floorOf(&seen.geometry);
    if (settings.backdrop) |*chosen_backdrop| {
        const backdrop = try arena.create(world.Environment);
        backdrop.* = .{ .ambient = 0, .background = @splat(0) };
        light.addMap(backdrop, chosen_backdrop, facing);
        seen.environment.backdrop = backdrop;
    }
    seen.facts.camera_is_default = chosen.camera_is_default;
    seen.facts.lights_are_default = lights_are_default;
    seen.facts.environment_is_default = settings.environment.is_default;
}

/// Punctual lights, or those that stand for too many of them.
fn placeLights(
    seen: *World,
    from: *const Scene,
    diagnostic: *Diagnostic,
) error{OutOfMemory}!void {
    const arena = seen.view_arena.allocator();
    const most = choices.punctual_light_count_max;
    seen.lights = try light.place(arena, from.lights, seen.node_maps, &seen.geometry, diagnostic);
    if (seen.lights.len <= most) return;
    const all = seen.lights;
    const gpa = seen.view_arena.child_allocator;
    seen.lights = try representative_lights.choose(gpa, arena, all, most);
    seen.all_lights = all;
    diagnostic.warn("{d} lights: {d} of them stand for all, but for --integrator path", .{
        all.len, seen.lights.len,
    });
}

fn chooseCamera(
    seen: *const World,
    from: *const Scene,
    settings: *const ViewSettings,
    diagnostic: *Diagnostic,
) ViewError!view_file.View {
    const gpa = seen.view_arena.child_allocator;
    // The scene as triangles refer to it: with a material for each of the world's.
    const sources = seen.materials.sources;
    var shown = from.*;
    const materials = try gpa.alloc(scene.Material, sources.len);
    defer gpa.free(materials);
    for (materials, sources) |*to, source| to.* = from.materials[source];
    shown.materials = materials;
    const framed = framedOf(&seen.geometry, settings.motion);
    const wanted: view_file.Wanted = .{
        .camera = settings.camera,
        .viewpoint = settings.viewpoint,
        .resolution = settings.resolution,
        .long_side = settings.long_side,
    };
    return view_file.choose(gpa, &shown, seen.node_maps, &framed, &wanted, diagnostic);
}

fn framedOf(geometry: *const world.Geometry, motion: ?*const Motion) world.Geometry {
    const all = motion orelse return geometry.*;
    var framed = all.geometry;
    framed.sphere_radius = geometry.sphere_radius;
    return framed;
}

/// Lights that stand for surfaces which emit: made once for a pose.
fn emittersOf(
    gpa: Allocator,
    seen: *World,
    from: *const Scene,
) error{OutOfMemory}![]const world.Light {
    if (seen.emitters) |made| return made;
    const pieces = try emitters.find(gpa, &seen.geometry, &seen.materials, &seen.textures);
    defer gpa.free(pieces);
    var count: usize = emitter_lights.count_default;
    if (from.has_area_lights) {
        count = 0;
        for (from.materials) |*one| {
            if (math.vec3.maxComponent(one.emissive) > 0)
                count += emitter_lights.count_default;
        }
        count = @min(count, emitter_lights.count_max);
    }
    const arena = seen.pose_arena.allocator();
    seen.emitters = try emitter_lights.make(gpa, arena, pieces, &seen.geometry, .{
        .count_max = count,
        .cuts_round = from.has_area_lights,
    });
    return seen.emitters.?;
}

/// Gives a geometry that has all else the tree that an earlier pose left, or a new one where that
/// costs too much, or triangles are to be seen that it does not have. Returns facts about it. Not
/// inlined, see `chooseView`.
noinline fn fitTree(
    arena: *std.heap.ArenaAllocator,
    cache: *PoseCache,
    geometry: *world.Geometry,
    settings: PoseSettings,
) PoseError!world.TreeStatistics {
    if (cache.tree) |*tree| {
        const fitted = try tree.run(cache.gpa, &inputOf(geometry, settings, null));
        var facts = tree.statistics();
        const kept_count = geometry.triangles.len - geometry.dropped_count;
        const is_good = fitted.sah_cost <= bvh_refit.cost_ratio_max * facts.sah_cost;
        if (is_good and fitted.kept_count == kept_count) {
            facts.sah_cost = fitted.sah_cost;
            geometry.tree = tree.tree();
            return facts;
        }
        tree.deinit(cache.gpa);
        cache.tree = null;
    }
    _ = arena.reset(.retain_capacity);
    cache.tree = try growTree(cache.gpa, arena.allocator(), geometry, settings);
    geometry.tree = cache.tree.?.tree();
    var facts = cache.tree.?.statistics();
    if (cache.sharing.boxes.len > 0)
        try joinClusters(arena.allocator(), cache, geometry, settings, &facts);
    return facts;
}

/// Puts the clusters of instances above and beside the tree of what is flattened.
fn joinClusters(
    arena: Allocator,
    cache: *const PoseCache,
    geometry: *world.Geometry,
    settings: PoseSettings,
    facts: *world.TreeStatistics,
) PoseError!void {
    const input = inputOf(geometry, settings, null);
    const boxes = cache.sharing.boxes;
    switch (geometry.tree) {
        inline else => |*tree, tag| {
            const width = comptime std.fmt.parseInt(u32, @tagName(tag)[1..], 10) catch unreachable;
            sharing_file.renumber(width, tree, geometry);
            const depth_max = join.depthMax(width);
            tree.* = try join.join(cache.gpa, arena, &input, boxes, width, tree, depth_max, facts);
        },
    }
    facts.bytes += cache.sharing.bytes;
}

/// Gives a geometry that has all else a tree of `settings.lanes`, whose memory comes from `arena`.
/// Returns facts about it. For benchmarks of the build.
pub fn buildTree(
    gpa: Allocator,
    arena: Allocator,
    geometry: *world.Geometry,
    settings: PoseSettings,
) PoseError!world.TreeStatistics {
    const tree = try growTree(gpa, arena, geometry, settings);
    geometry.tree = tree.tree();
    return tree.statistics();
}

/// Not inlined, see `chooseView`.
noinline fn growTree(
    gpa: Allocator,
    arena: Allocator,
    geometry: *const world.Geometry,
    settings: PoseSettings,
) PoseError!bvh_refit.AnyRefit {
    const kept = if (geometry.dropped_count > 0) try listKept(gpa, geometry) else null;
    defer if (kept) |numbers| gpa.free(numbers);
    const input = inputOf(geometry, settings, kept);
    Progress.begin(settings.pool.progress, bvh_wide.workOf(input.count(), input.quality));
    return switch (settings.lanes) {
        4 => .{ .w4 = .{ .built = try bvh_wide.build(gpa, arena, &input, 4) } },
        8 => .{ .w8 = .{ .built = try bvh_wide.build(gpa, arena, &input, 8) } },
        16 => .{ .w16 = .{ .built = try bvh_wide.build(gpa, arena, &input, 16) } },
        else => unreachable, // Asserted at the door.
    };
}

fn inputOf(
    geometry: *const world.Geometry,
    settings: PoseSettings,
    kept: ?[]const u32,
) bvh_wide.Input {
    return .{
        .positions = geometry.positions,
        .triangles = geometry.triangles,
        .kept = kept,
        .centroid_bounds = geometry.centroid_bounds,
        .padding = geometry.padding,
        .pool = settings.pool,
        .quality = settings.tree_quality,
    };
}

/// The numbers of the triangles that are not dropped.
fn listKept(gpa: Allocator, geometry: *const world.Geometry) error{OutOfMemory}![]u32 {
    const kept = try gpa.alloc(u32, geometry.triangles.len - geometry.dropped_count);
    var count: usize = 0;
    for (geometry.triangles, 0..) |*triangle, number| {
        if (triangle.isDropped()) continue;
        kept[count] = @intCast(number);
        count += 1;
    }
    assert(count == kept.len);
    return kept;
}

/// A scene for tests: one node, one mesh, made in the scene's own arena.
const TestScene = struct {
    fn init(
        gpa: std.mem.Allocator,
        positions: []const math.Vec3,
        triangles: []const [3]u32,
    ) !Scene {
        var from: Scene = .init(gpa);
        errdefer from.deinit();
        const arena = from.arena.allocator();
        from.nodes = try arena.dupe(scene.Node, &.{.{ .parent = scene.none, .local = .identity }});
        from.materials = try arena.dupe(scene.Material, &.{.{}});
        from.meshes = try arena.dupe(scene.Mesh, &.{.{
            .positions = try arena.dupe(math.Vec3, positions),
            .triangles = try arena.dupe([3]u32, triangles),
            .material = 0,
        }});
        from.instances = try arena.dupe(scene.Instance, &.{.{ .mesh = 0, .node = 0 }});
        from.check();
        return from;
    }

    /// Triangles with three corners of their own each.
    fn soup(gpa: std.mem.Allocator, corners: []const [3]math.Vec3) !Scene {
        const triangles = try gpa.alloc([3]u32, corners.len);
        defer gpa.free(triangles);
        for (triangles, 0..) |*triangle, index| {
            const first: u32 = @intCast(3 * index);
            triangle.* = .{ first, first + 1, first + 2 };
        }
        const positions: [*]const math.Vec3 = @ptrCast(corners.ptr);
        return init(gpa, positions[0 .. 3 * corners.len], triangles);
    }
};

/// A scene, loaded and posed.
const TestPose = struct {
    pool: parallel.Pool,
    diagnostic: Diagnostic = .{},
    times: StageTimes = .{},
    loaded: Loaded = undefined,
    posed: Posed = undefined,

    fn init(made: *TestPose, gpa: Allocator, from: *const Scene) !void {
        made.* = .{ .pool = .init(2) };
        errdefer made.pool.deinit();
        const io = std.testing.io;
        const pool = &made.pool;
        made.loaded = try load(gpa, io, from, .{ .pool = pool }, &made.diagnostic, &made.times);
        errdefer made.loaded.deinit();
        made.posed = try pose(
            gpa,
            io,
            from,
            &made.loaded,
            made.settings(),
            &made.diagnostic,
            &made.times,
        );
    }

    fn again(made: *TestPose, from: *const Scene) !void {
        try poseAgain(
            &made.posed.world,
            &made.posed.cache,
            std.testing.io,
            from,
            &made.loaded,
            made.settings(),
            &made.diagnostic,
            &made.times,
        );
    }

    fn settings(made: *TestPose) PoseSettings {
        return .{ .lanes = 4, .pool = &made.pool };
    }

    fn deinit(made: *TestPose) void {
        made.posed.deinit();
        made.loaded.deinit();
        made.pool.deinit();
    }
};

const TestSettings = struct {
    lanes: u8,
    thread_count: usize,
    tree_quality: TreeQuality = .default,
};

fn prepareForTest(gpa: Allocator, from: *const Scene, settings: PoseSettings) !World {
    var diagnostic: Diagnostic = .{};
    var times: StageTimes = .{};
    // Without textures the world keeps nothing of it.
    var loaded = try load(gpa, std.testing.io, from, .{
        .pool = settings.pool,
    }, &diagnostic, &times);
    defer loaded.deinit();
    assert(loaded.textures.lookups.len == 0);
    var posed = try pose(gpa, std.testing.io, from, &loaded, settings, &diagnostic, &times);
    posed.cache.deinit();
    var result = posed.world;
    errdefer result.deinit();
    try view(&result, std.testing.io, from, .{}, &diagnostic, &times);
    return result;
}

fn testPrepare(from: *const Scene, settings: TestSettings) !World {
    var pool: parallel.Pool = .init(settings.thread_count);
    defer pool.deinit();
    return prepareForTest(std.testing.allocator, from, .{
        .lanes = settings.lanes,
        .pool = &pool,
        .tree_quality = settings.tree_quality,
    });
}

/// Prepares and checks in all widths and qualities and with several thread counts, which must all
/// agree. Returns how many triangles are in the tree.
fn testEverywhere(from: *const Scene) !usize {
    var kept: usize = 0;
    for ([_]u8{ 4, 8, 16 }) |lanes| for (std.enums.values(TreeQuality)) |quality| {
        kept = try testThreads(from, lanes, quality);
    };
    return kept;
}

fn testThreads(from: *const Scene, lanes: u8, quality: TreeQuality) !usize {
    var settings: TestSettings = .{ .lanes = lanes, .thread_count = 1, .tree_quality = quality };
    var reference = try testPrepare(from, settings);
    defer reference.deinit();
    try check.check(std.testing.allocator, &reference);
    for ([_]usize{ 2, 7 }) |thread_count| {
        settings.thread_count = thread_count;
        var other = try testPrepare(from, settings);
        defer other.deinit();
        try expectSameBytes(reference.geometry.positions, other.geometry.positions);
        try expectSameBytes(reference.geometry.normals, other.geometry.normals);
        try expectSameBytes(reference.geometry.colors, other.geometry.colors);
        try expectSameBytes(reference.geometry.triangles, other.geometry.triangles);
        switch (lanes) {
            inline 4, 8, 16 => |width| {
                const a = reference.geometry.tree.get(width);
                const b = other.geometry.tree.get(width);
                try expectSameBytes(a.nodes, b.nodes);
                try expectSameBytes(a.packs, b.packs);
            },
            else => unreachable,
        }
        try std.testing.expectEqual(reference.facts.tree, other.facts.tree);
        try std.testing.expectEqual(reference.geometry.padding, other.geometry.padding);
        try std.testing.expectEqual(reference.view.camera, other.view.camera);
    }
    return reference.geometry.triangles.len - reference.geometry.dropped_count;
}

fn expectSameBytes(a: anytype, b: @TypeOf(a)) !void {
    try std.testing.expectEqual(a.len, b.len);
    try std.testing.expect(std.mem.eql(u8, std.mem.sliceAsBytes(a), std.mem.sliceAsBytes(b)));
}

test "room for a tree that takes long is asked for before, that for others is not" {
    try expectRoom(std.testing.failing_allocator, 1 << 20);
    const many = std.math.maxInt(u32);
    try std.testing.expectError(
        error.OutOfMemory,
        expectRoom(std.testing.failing_allocator, many),
    );
}

test "an empty scene has one node, a camera and the default lights" {
    const gpa = std.testing.allocator;
    var from: Scene = .init(gpa);
    defer from.deinit();
    try std.testing.expectEqual(0, try testEverywhere(&from));
    var result = try testPrepare(&from, .{ .lanes = 4, .thread_count = 1 });
    defer result.deinit();
    try std.testing.expectEqual(1, result.geometry.tree.w4.nodes.len);
    try std.testing.expectEqual(0, result.facts.tree.depth);
    try std.testing.expect(result.facts.camera_is_default and result.facts.lights_are_default);
    try std.testing.expectEqual(3, result.lights.len);
}

test "one triangle is a root with one leaf" {
    const gpa = std.testing.allocator;
    var from = try TestScene.soup(gpa, &.{.{ .{ 0, 0, 0 }, .{ 1, 0, 0 }, .{ 0, 1, 0 } }});
    defer from.deinit();
    try std.testing.expectEqual(1, try testEverywhere(&from));
    var result = try testPrepare(&from, .{ .lanes = 4, .thread_count = 1 });
    defer result.deinit();
    try std.testing.expectEqual(1, result.facts.tree.depth);
    try std.testing.expectEqual(2, result.facts.tree.sah_cost);
    try std.testing.expectEqual(128 + 160, result.facts.tree.bytes);
    try std.testing.expectEqual(@as(u32, 0), result.geometry.tree.w4.packs[0].primitive[0]);
}

test "random soups of all sizes, in all widths, by any number of threads" {
    const gpa = std.testing.allocator;
    var random_state: std.Random.DefaultPrng = .init(11);
    const random = random_state.random();
    for ([_]usize{ 2, 4, 5, 16, 17, 64, 333, 10_000 }) |count| {
        const corners = try gpa.alloc([3]math.Vec3, count);
        defer gpa.free(corners);
        for (corners) |*triangle| {
            var middle: math.Vec3 = undefined;
            for (&middle) |*coordinate| coordinate.* = random.float(f32) * 10;
            for (triangle) |*corner| {
                for (corner, middle) |*coordinate, at| coordinate.* = at + random.float(f32);
            }
        }
        var from = try TestScene.soup(gpa, corners);
        defer from.deinit();
        try std.testing.expectEqual(count, try testEverywhere(&from));
    }
}

test "a grid cuts large soups, even ones and heaps in a void" {
    const gpa = std.testing.allocator;
    const count = 20_000;
    const corners = try gpa.alloc([3]math.Vec3, count);
    defer gpa.free(corners);
    const Kind = enum { even, heap, coincident, flat_line };
    var random_state: std.Random.DefaultPrng = .init(5);
    const random = random_state.random();
    for (std.enums.values(Kind)) |kind| {
        for (corners, 0..) |*triangle, index| {
            // All but a few within a cell that is one of thousands.
            const reach: f32 = if (kind == .heap and index % 1000 > 0) 1e-4 else 1;
            var at: math.Vec3 = undefined;
            for (&at) |*coordinate| coordinate.* = random.float(f32) * reach;
            if (kind == .coincident) at = .{ 1, 2, 3 };
            if (kind == .flat_line) at = .{ at[0], 0, 0 };
            const size = 0.01 * reach;
            triangle.* = .{ at, .{ at[0] + size, at[1], at[2] }, .{ at[0], at[1] + size, at[2] } };
        }
        var from = try TestScene.soup(gpa, corners);
        defer from.deinit();
        for ([_]TreeQuality{ .fast, .default }) |quality| {
            try std.testing.expectEqual(count, try testThreads(&from, 8, quality));
        }
    }
}

test "more care, less cost" {
    const gpa = std.testing.allocator;
    const corners = try gpa.alloc([3]math.Vec3, 5000);
    defer gpa.free(corners);
    var random_state: std.Random.DefaultPrng = .init(23);
    const random = random_state.random();
    // Of all sizes: what cuts by the middle do worst at.
    for (corners) |*triangle| {
        const size = std.math.pow(f32, 10, -3 * random.float(f32));
        var at: math.Vec3 = undefined;
        for (&at) |*coordinate| coordinate.* = random.float(f32) * 3;
        for (triangle) |*corner| {
            for (corner, at) |*coordinate, middle| {
                coordinate.* = middle + size * random.floatNorm(f32);
            }
        }
    }
    var from = try TestScene.soup(gpa, corners);
    defer from.deinit();
    for ([_]u8{ 4, 16 }) |lanes| {
        var costs: std.enums.EnumArray(TreeQuality, f64) = .initFill(0);
        for (std.enums.values(TreeQuality)) |quality| {
            const settings: TestSettings = .{
                .lanes = lanes,
                .thread_count = 1,
                .tree_quality = quality,
            };
            var made = try testPrepare(&from, settings);
            defer made.deinit();
            costs.set(quality, made.facts.tree.sah_cost);
        }
        try std.testing.expect(costs.get(.high) < 0.97 * costs.get(.default));
        try std.testing.expect(costs.get(.default) < 1.02 * costs.get(.fast));
    }
}

test "nasty soups" {
    const gpa = std.testing.allocator;
    const count = 2000;
    const corners = try gpa.alloc([3]math.Vec3, count);
    defer gpa.free(corners);
    const Kind = enum { coincident, line, concentric, huge_and_tiny, powers, flat };
    for (std.enums.values(Kind)) |kind| {
        for (corners, 0..) |*triangle, index| {
            const at: f32 = @floatFromInt(index);
            triangle.* = switch (kind) {
                .coincident => .{ .{ 1, 2, 3 }, .{ 4, 5, 6 }, .{ 7, 8, 1 } },
                .line => .{ .{ at, 0, 0 }, .{ at + 1, 0, 0 }, .{ at, 1, 0 } },
                .concentric => .{ .{ -at - 1, 0, 1 }, .{ at + 1, 0, -1 }, .{ 0, 0, 0.5 } },
                .huge_and_tiny => if (index == count / 2)
                    .{ .{ -1e9, 0, -1e9 }, .{ 1e9, 0, -1e9 }, .{ 0, 0, 1e9 } }
                else
                    .{ .{ at, 0, 0 }, .{ at, 1e-3, 0 }, .{ at, 0, 1e-3 } },
                // Halves over and over: cuts that take one triangle each, were they let.
                .powers => powers: {
                    const size = std.math.ldexp(@as(f32, 1), -@as(i32, @intCast(index % 60)));
                    break :powers .{ .{ size, 0, 0 }, .{ 0, size, 0 }, .{ 0, 0, size } };
                },
                .flat => .{ .{ at, 5, 0 }, .{ at, 5, 1 }, .{ at + 1, 5, 0 } },
            };
        }
        var from = try TestScene.soup(gpa, corners);
        defer from.deinit();
        try std.testing.expectEqual(count, try testEverywhere(&from));
    }
}

test "triangles without area or a finite place are counted, not drawn" {
    const gpa = std.testing.allocator;
    var from = try TestScene.soup(gpa, &.{
        .{ .{ 0, 0, 0 }, .{ 1, 1, 1 }, .{ 1, 1, 1 } },
        .{ .{ 0, 0, 0 }, .{ 1, 2, 3 }, .{ 2, 4, 6 } },
        .{ .{ 0, 0, 0 }, .{ 1e-25, 0, 0 }, .{ 0, 1e-25, 0 } },
        .{ .{ 0, 0, 0 }, .{ 3e38, 0, 0 }, .{ 0, 3e38, 0 } },
        .{ .{ 0, 0, 0 }, .{ 1, 0, 0 }, .{ 0, 1, 0 } },
    });
    defer from.deinit();
    try std.testing.expectEqual(1, try testEverywhere(&from));
    var result = try testPrepare(&from, .{ .lanes = 4, .thread_count = 2 });
    defer result.deinit();
    try std.testing.expectEqual(4, result.facts.degenerate_count);
    for (result.geometry.triangles, 0..) |triangle, number| {
        try std.testing.expectEqual(number < 4, triangle.isDropped());
    }
    try std.testing.expectEqual(@as(u32, 14), result.geometry.triangles[4].corner[2]);
    // A node that throws everything beyond all numbers leaves nothing.
    from.nodes = &.{.{ .parent = scene.none, .local = .{
        .x = .{ 3e38, 3e38, 0 },
        .y = .{ 3e38, 3e38, 0 },
        .z = .{ 0, 0, 1 },
        .translation = .{ 3e38, 3e38, 0 },
    } }};
    try std.testing.expectEqual(0, try testEverywhere(&from));
}

test "a mirroring node keeps fronts and normals outward" {
    const gpa = std.testing.allocator;
    var from = try TestScene.soup(gpa, &.{.{ .{ 0, 0, 0 }, .{ 1, 0, 0 }, .{ 0, 1, 0 } }});
    defer from.deinit();
    const arena = from.arena.allocator();
    from.nodes = &.{
        .{ .parent = scene.none, .local = .fromTrs(.{ 9, 0, 0 }, .{ 0, 0, 0, 1 }, .{ -2, 1, 1 }) },
        .{ .parent = scene.none, .local = .fromTrs(.{ 0, 0, 0 }, .{ 0, 0, 0, 1 }, .{ 1, 1, -1 }) },
        .{ .parent = scene.none, .local = .fromTrs(.{ 0, 0, 0 }, .{ 0, 0, 0, 1 }, .{ 1, 1, 0 }) },
    };
    from.instances = &.{
        .{ .mesh = 0, .node = 0 },
        .{ .mesh = 0, .node = 1 },
        .{ .mesh = 0, .node = 2 },
    };
    const mesh = try arena.create(scene.Mesh);
    mesh.* = from.meshes[0];
    mesh.normals = &.{ .{ 0, 0, 1 }, .{ 0.6, 0, 0.8 }, .{ 0, 0, 0 } };
    from.meshes = mesh[0..1];
    var result = try testPrepare(&from, .{ .lanes = 4, .thread_count = 1 });
    defer result.deinit();
    // Mirrored across x = 0, the front still faces +z; across z = 0, it faces -z.
    for ([_]f32{ 1, -1, 1 }, 0..) |sign, index| {
        const corner = result.geometry.triangles[index].corner;
        const a = result.geometry.positions[corner[0]];
        const normal = math.vec3.cross(
            math.vec3.sub(result.geometry.positions[corner[1]], a),
            math.vec3.sub(result.geometry.positions[corner[2]], a),
        );
        try std.testing.expect(normal[2] * sign > 0);
        try std.testing.expect(result.geometry.normals[3 * index][2] * sign > 0);
        try std.testing.expectEqual(math.Vec3{ 0, 0, 0 }, result.geometry.normals[3 * index + 2]);
    }
    // The tilted normal stays perpendicular to the stretched soup it belongs to.
    const tilted = result.geometry.normals[1];
    try std.testing.expectApproxEqRel(@as(f32, -0.6 / 0.8 / 2.0), tilted[0] / tilted[2], 1e-6);
    try std.testing.expectEqual(math.Vec3{ 7, 0, 0 }, result.geometry.positions[1]);
}

/// A grid of 150 x 150 vertices with all that deforms it.
fn makeDeformed(from: *Scene) !void {
    const arena = from.arena.allocator();
    const side = 150;
    const count = side * side;
    const positions = try arena.alloc(math.Vec3, count);
    const deltas = try arena.alloc(math.Vec3, count);
    const colors = try arena.alloc([4]f32, count);
    const joints = try arena.alloc([4]u16, count);
    const weights = try arena.alloc([4]f32, count);
    for (positions, deltas, colors, joints, weights, 0..) |*at, *delta, *color, *four, *of, index| {
        const x: f32 = @floatFromInt(index % side);
        const y: f32 = @floatFromInt(index / side);
        at.* = .{ x, y, 0 };
        delta.* = .{ y / 64, x / 32, x * y / 512 };
        color.* = .{ x / side, y / side, 0.5, 1 };
        four.* = .{ 0, 1, 0, 1 };
        of.* = .{ x, y, 1, 2 };
    }
    const grid = try arena.alloc([3]u32, (side - 1) * (side - 1));
    for (grid, 0..) |*triangle, index| {
        const first: u32 = @intCast(index / (side - 1) * side + index % (side - 1));
        triangle.* = .{ first, first + 1, first + side };
    }
    const target: scene.MorphTarget = .{ .positions = deltas, .normals = deltas, .colors = colors };
    from.meshes = try arena.dupe(scene.Mesh, &.{.{
        .positions = positions,
        .normals = positions,
        .colors = colors,
        .morph_targets = try arena.dupe(scene.MorphTarget, &.{ target, .{}, target }),
        .joint_sets = try arena.dupe(scene.JointSet, &.{
            .{ .joints = joints, .weights = weights },
            .{ .joints = joints, .weights = colors },
        }),
        .triangles = grid,
        .material = 0,
    }});
    const above: math.AffineD = .fromTrs(.{ 3, 4, 5 }, .{ 0.6, 0, 0, 0.8 }, .{ 1, 2, 1 });
    const below: math.AffineD = .fromTrs(.{ 0, 0, 9 }, .{ 0, 0.6, 0.8, 0 }, .{ 0.1, 1, 3 });
    from.nodes = try arena.dupe(scene.Node, &.{
        .{ .parent = scene.none, .local = above }, .{ .parent = 0, .local = below },
    });
    from.skins = try arena.dupe(scene.Skin, &.{.{
        .joints = &.{ 1, 0 },
        .inverse_bind_maps = try arena.dupe(math.AffineD, &.{ above, .identity }),
    }});
    from.instances = &.{
        .{ .mesh = 0, .node = 0, .morph_weights = &.{ 0.3, 1, -0.7 } },
        .{ .mesh = 0, .node = 0, .morph_weights = &.{ 0.3, 1, -0.7 }, .skin = 0 },
        .{ .mesh = 0, .node = 1, .skin = 0 },
        .{ .mesh = 0, .node = 1, .morph_weights = &.{ 0, 1, 0 } },
    };
    from.materials = &.{.{}};
    from.check();
}

test "deformed vertices are the same by any number of threads" {
    var from: Scene = .init(std.testing.allocator);
    defer from.deinit();
    try makeDeformed(&from);
    const kept = try testThreads(&from, 4, .fast);
    try std.testing.expectEqual(4 * 149 * 149, kept);
    var result = try testPrepare(&from, .{ .lanes = 4, .thread_count = 2 });
    defer result.deinit();
    const mesh = &from.meshes[0];
    const place = try place_file.compose(std.testing.allocator, &from);
    defer place.deinit(std.testing.allocator);
    const used_count = mesh.positions.len - 1; // No triangle has the last corner.
    for (from.instances, 0..) |*instance, number| for (0..used_count) |vertex| {
        const at = deform.place(mesh, instance, place.maps, place.joint_maps, vertex);
        const found = result.geometry.positions[number * used_count + vertex];
        try std.testing.expectEqual(place_file.round(at), found);
    };
}

test "tangents of deformed meshes go with the joints" {
    const gpa = std.testing.allocator;
    var from = try TestScene.soup(gpa, &.{.{ .{ 0, 0, 0 }, .{ 1, 0, 0 }, .{ 0, 1, 0 } }});
    defer from.deinit();
    const arena = from.arena.allocator();
    from.images = &.{.{
        .name = "flat",
        .bytes = try texture.TestImage.png(arena, 1, 1, 3, &@as([3]u8, .{ 128, 128, 255 })),
    }};
    from.textures = &.{.{ .image = 0 }};
    from.materials = &.{.{ .normal_texture = .{ .texture = 0 }, .normal_scale = 0.5 }};
    var meshes: [1]scene.Mesh = .{from.meshes[0]};
    meshes[0].texcoords[0] = &.{ .{ 0, 0 }, .{ 1, 0 }, .{ 0, 1 } };
    meshes[0].normals = &@as([3]math.Vec3, @splat(.{ 0, 0, 1 }));
    meshes[0].tangents = &@as([3][4]f32, @splat(.{ 1, 0, 0, 1 }));
    meshes[0].morph_targets = &.{.{
        .tangents = &@as([3]math.Vec3, @splat(.{ 0, 1, 0 })),
        .texcoords = .{ &@as([3][2]f32, @splat(.{ 1, 2 })), null, null, null },
    }};
    meshes[0].joint_sets = &.{.{
        .joints = &@as([3][4]u16, @splat(@splat(0))),
        .weights = &@as([3][4]f32, @splat(.{ 1, 0, 0, 0 })),
    }};
    from.meshes = &meshes;
    from.nodes = &.{.{ .parent = scene.none, .local = .scale(.{ -3, 4, 1 }) }};
    from.skins = &.{.{ .joints = &.{0}, .inverse_bind_maps = &.{.identity} }};
    from.instances = &.{.{ .mesh = 0, .node = 0, .morph_weights = &.{1}, .skin = 0 }};
    from.check();
    var made: TestPose = undefined;
    try made.init(gpa, &from);
    defer made.deinit();
    const result = &made.posed.world;
    for (result.geometry.tangents, result.geometry.normals) |tangent, normal| {
        for ([4]f32{ -0.6, 0.8, 0, -1 }, tangent) |wanted, found| {
            try std.testing.expectApproxEqAbs(wanted, found, 1e-6);
        }
        try std.testing.expectEqual(math.Vec3{ 0, 0, 1 }, normal);
    }
    try std.testing.expectEqual([2]f32{ 2, 2 }, result.geometry.texcoords[0][1]);
}

test "colours are white where a mesh has none" {
    const gpa = std.testing.allocator;
    var from = try TestScene.soup(gpa, &.{.{ .{ 0, 0, 0 }, .{ 1, 0, 0 }, .{ 0, 1, 0 } }});
    defer from.deinit();
    var plain = try testPrepare(&from, .{ .lanes = 4, .thread_count = 1 });
    try std.testing.expectEqual(0, plain.geometry.colors.len);
    plain.deinit();
    var meshes = [_]scene.Mesh{ from.meshes[0], from.meshes[0] };
    meshes[1].colors = &.{ .{ 1, 0, 0, 1 }, .{ 0, 1, 0, 1 }, .{ 0, 0, 1, 0.5 } };
    from.meshes = &meshes;
    from.instances = &.{ .{ .mesh = 0, .node = 0 }, .{ .mesh = 1, .node = 0 } };
    var result = try testPrepare(&from, .{ .lanes = 4, .thread_count = 1 });
    defer result.deinit();
    try std.testing.expectEqual([4]f32{ 1, 1, 1, 1 }, result.geometry.colors[2]);
    try std.testing.expectEqual([4]f32{ 0, 0, 1, 0.5 }, result.geometry.colors[5]);
}

test "texture coordinates and tangents are placed where a texture asks for them" {
    const gpa = std.testing.allocator;
    var from = try TestScene.soup(gpa, &.{.{ .{ 0, 0, 0 }, .{ 1, 0, 0 }, .{ 0, 1, 0 } }});
    defer from.deinit();
    const arena = from.arena.allocator();
    const texels: [3]u8 = .{ 128, 128, 255 };
    from.images = &.{.{
        .name = "flat",
        .bytes = try texture.TestImage.png(arena, 1, 1, 3, &texels),
    }};
    from.textures = &.{.{ .image = 0 }};
    from.materials = &.{
        .{ .normal_texture = .{ .texture = 0, .texcoord_set = 1 }, .normal_scale = 0.5 },
        .{},
    };
    var meshes: [2]scene.Mesh = @splat(from.meshes[0]);
    meshes[0].texcoords = .{ &.{ .{ 9, 9 }, .{ 9, 9 }, .{ 9, 9 } }, &.{
        .{ 0, 0 }, .{ 1, 0 }, .{ 0, 1 },
    }, null, null };
    meshes[0].normals = &.{ .{ 0, 0, 1 }, .{ 0, 0, 1 }, .{ 0, 0, 1 } };
    meshes[0].tangents = &.{ .{ 1, 0, 0, 1 }, .{ 0, 1, 0, -1 }, .{ 0.6, 0.8, 0, 1 } };
    meshes[1].material = 1;
    from.meshes = &meshes;
    from.nodes = &.{
        .{ .parent = scene.none, .local = .scale(.{ 2, 1, 1 }) },
        .{ .parent = scene.none, .local = .scale(.{ -3, 1, 1 }) },
    };
    from.instances = &.{
        .{ .mesh = 0, .node = 0 }, .{ .mesh = 0, .node = 1 }, .{ .mesh = 1, .node = 0 },
    };
    from.check();
    var made: TestPose = undefined;
    try made.init(gpa, &from);
    defer made.deinit();
    const placed_world = &made.posed.world;
    const geometry = &placed_world.geometry;
    for ([_]usize{ 0, 2, 3 }) |set| try std.testing.expectEqual(0, geometry.texcoords[set].len);
    for ([_]usize{ 0, 3 }) |first| {
        const placed = geometry.texcoords[1][first..][0..3];
        try std.testing.expectEqualSlices([2]f32, meshes[0].texcoords[1].?, placed);
    }
    for (geometry.texcoords[1][6..]) |none| try std.testing.expectEqual([2]f32{ 0, 0 }, none);
    try std.testing.expectEqual(9, geometry.tangents.len);
    for (geometry.tangents[6..]) |none| {
        try std.testing.expectEqual([4]f32{ 0, 0, 0, 1 }, none);
    }
    // The bitangent goes where the node takes it.
    for (meshes[0].tangents.?, 0..) |tangent, vertex| for ([_]f32{ 2, -3 }, 0..) |scale, node| {
        const normal = math.vec3.normalize(geometry.normals[3 * node + vertex]).?;
        const placed = geometry.tangents[3 * node + vertex];
        const direction = math.vec3.normalize(placed[0..3].*).?;
        const expected = math.vec3.normalize(.{ scale * tangent[0], tangent[1], 0 }).?;
        const bitangent = math.vec3.scale(math.vec3.cross(normal, direction), placed[3]);
        const sources: math.Vec3 = .{ -tangent[1] * tangent[3], tangent[0] * tangent[3], 0 };
        const mapped: math.Vec3 = .{ scale * sources[0], sources[1], 0 };
        try std.testing.expect(math.vec3.dot(bitangent, mapped) > 0.5);
        for (expected, direction) |a, b| try std.testing.expectApproxEqAbs(a, b, 1e-6);
    };
    const used = &placed_world.materials.all[0];
    try std.testing.expectEqual(0.5, used.normal_scale);
    try std.testing.expectEqual(1, used.lookup_count);
    const lookup = &placed_world.materials.lookups[used.first_lookup];
    try std.testing.expectEqual(1, lookup.texcoord_set);
    const texture_of = &placed_world.frame().textures.all[lookup.texture];
    try std.testing.expectEqualSlices(u8, &texels, texture_of.levels[0].texels);
    try std.testing.expectEqual(0, placed_world.materials.all[1].lookup_count);
}

test "layers are there where a drawn material has some, and tangents for what has a direction" {
    const gpa = std.testing.allocator;
    var from = try TestScene.soup(gpa, &.{.{ .{ 0, 0, 0 }, .{ 1, 0, 0 }, .{ 0, 1, 0 } }});
    defer from.deinit();
    from.materials = &.{ .{ .clearcoat_roughness = 1 }, .{ .anisotropy = 0.5 } };
    var meshes: [2]scene.Mesh = @splat(from.meshes[0]);
    meshes[1].material = 1;
    for (&meshes) |*mesh| mesh.texcoords[0] = &.{ .{ 0, 0 }, .{ 1, 0 }, .{ 0, 1 } };
    from.meshes = &meshes;
    const instances = [_]scene.Instance{ .{ .mesh = 0, .node = 0 }, .{ .mesh = 1, .node = 0 } };
    for (1..3) |drawn_count| {
        from.instances = instances[0..drawn_count];
        from.check();
        var made: TestPose = undefined;
        try made.init(gpa, &from);
        defer made.deinit();
        const result = &made.posed.world;
        const layers = result.materials.layers;
        if (drawn_count == 1) {
            try std.testing.expectEqual(0, layers.len);
            try std.testing.expectEqual(0, result.geometry.tangents.len);
            continue;
        }
        try std.testing.expectEqual(world.Layers{}, layers[0]);
        try std.testing.expectEqual(world.Layers{ .present = 1, .anisotropy = 0.5 }, layers[1]);
        for (result.geometry.tangents[0..3]) |none| {
            try std.testing.expectEqual([4]f32{ 0, 0, 0, 1 }, none);
        }
        // Of TEXCOORD_0, whose v grows downwards in textures, upwards here.
        for (result.geometry.tangents[3..6]) |tangent| {
            try std.testing.expectEqual([4]f32{ 1, 0, 0, -1 }, tangent);
        }
    }
}

test "loading that runs out of memory is an error that leaks nothing" {
    const gpa = std.testing.allocator;
    var from = try TestScene.soup(gpa, &.{.{ .{ 0, 0, 0 }, .{ 1, 0, 0 }, .{ 0, 1, 0 } }});
    defer from.deinit();
    const arena = from.arena.allocator();
    from.images = &.{.{
        .name = "flat",
        .bytes = try texture.TestImage.png(arena, 1, 1, 3, &.{ 128, 128, 255 }),
    }};
    from.textures = &.{.{ .image = 0 }};
    from.materials = &.{.{ .normal_texture = .{ .texture = 0 } }};
    var meshes: [1]scene.Mesh = .{from.meshes[0]};
    meshes[0].texcoords[0] = &.{ .{ 0, 0 }, .{ 1, 0 }, .{ 0, 1 } };
    from.meshes = &meshes;
    const one = struct {
        fn one(failing: std.mem.Allocator, scene_from: *const Scene) !void {
            var pool: parallel.Pool = .init(1);
            defer pool.deinit();
            var diagnostic: Diagnostic = .{};
            var times: StageTimes = .{};
            const io = std.testing.io;
            var loaded =
                try load(failing, io, scene_from, .{ .pool = &pool }, &diagnostic, &times);
            defer loaded.deinit();
            // Made, since the mesh has none: v grows downwards in textures, upwards here.
            for (loaded.parts.meshes[0].tangents.?) |tangent| {
                try std.testing.expectEqual([4]f32{ 1, 0, 0, -1 }, tangent);
            }
        }
    }.one;
    try std.testing.checkAllAllocationFailures(gpa, one, .{&from});
}

test "what can be seen nowhere is not drawn" {
    const gpa = std.testing.allocator;
    var from = try TestScene.soup(gpa, &.{.{ .{ 0, 0, 0 }, .{ 1, 0, 0 }, .{ 0, 1, 0 } }});
    defer from.deinit();
    from.materials = &.{
        .{ .alpha_mode = .blend, .base_color = .{ 1, 1, 1, 0 } },
        .{ .alpha_mode = .mask, .base_color = .{ 1, 1, 1, 0.9 } },
    };
    var meshes: [2]scene.Mesh = @splat(from.meshes[0]);
    meshes[1].material = 1;
    from.meshes = &meshes;
    from.instances = &.{ .{ .mesh = 0, .node = 0 }, .{ .mesh = 1, .node = 0 } };
    var result = try testPrepare(&from, .{ .lanes = 4, .thread_count = 1 });
    defer result.deinit();
    try std.testing.expectEqual(1, result.geometry.triangles.len);
    try std.testing.expectEqual(1, result.geometry.triangles[0].material);
    // No place of the other is a hole.
    try std.testing.expect(!result.materials.has_holes and !result.materials.has_transparency);
}

test "many instances keep their order over many chunks, and triangles their numbers" {
    const gpa = std.testing.allocator;
    // Good, without area, good: moved apart by the node.
    var from = try TestScene.soup(gpa, &.{
        .{ .{ 0, 0, 0 }, .{ 1, 0, 0 }, .{ 0, 1, 0 } },
        .{ .{ 0, 0, 0 }, .{ 1, 0, 0 }, .{ 2, 0, 0 } },
        .{ .{ 0, 0, 1 }, .{ 1, 0, 1 }, .{ 0, 1, 1 } },
    });
    defer from.deinit();
    const arena = from.arena.allocator();
    const count = 13_000;
    const nodes = try arena.alloc(scene.Node, count);
    for (nodes, 0..) |*node, index| node.* = .{
        .parent = scene.none,
        .local = .fromTrs(.{ @floatFromInt(index), 0, 0 }, .{ 0, 0, 0, 1 }, .{ 1, 1, 1 }),
    };
    var meshes = [_]scene.Mesh{ from.meshes[0], from.meshes[0] };
    meshes[1].triangles = &.{};
    from.meshes = &meshes;
    const instances = try arena.alloc(scene.Instance, count);
    for (instances, 0..) |*instance, index| instance.* = .{
        .mesh = @intFromBool(index % 5 == 0), // Every fifth shows nothing.
        .node = @intCast(index),
    };
    from.nodes = nodes;
    from.instances = instances;
    for ([_]usize{ 1, 3 }) |thread_count| {
        var result = try testPrepare(&from, .{ .lanes = 8, .thread_count = thread_count });
        defer result.deinit();
        const shown_count = count - count / 5;
        try std.testing.expectEqual(3 * shown_count, result.geometry.triangles.len);
        try std.testing.expectEqual(shown_count, result.facts.degenerate_count);
        for (result.geometry.triangles, 0..) |triangle, index| {
            const shown = index / 3; // Four in five, from node 1 on.
            const at: f32 = @floatFromInt(shown + shown / 4 + 1);
            const corner = result.geometry.positions[triangle.corner[1]];
            const height: f32 = @floatFromInt(index % 3 / 2);
            try std.testing.expectEqual(math.Vec3{ at + 1, 0, height }, corner);
            try std.testing.expectEqual(index % 3 == 1, triangle.isDropped());
        }
    }
}

test "a mesh brings only the vertices from its first to its last" {
    const gpa = std.testing.allocator;
    var positions: [100]math.Vec3 = @splat(.{ 0, 0, 0 });
    positions[50] = .{ 0, 0, 5 };
    positions[52] = .{ 1, 0, 5 };
    positions[51] = .{ 0, 1, 5 };
    var from = try TestScene.init(gpa, &positions, &.{.{ 50, 52, 51 }});
    defer from.deinit();
    var result = try testPrepare(&from, .{ .lanes = 4, .thread_count = 1 });
    defer result.deinit();
    try std.testing.expectEqual(3, result.geometry.positions.len);
    try std.testing.expectEqual([3]u32{ 0, 2, 1 }, result.geometry.triangles[0].corner);
    try std.testing.expectEqual(math.Vec3{ 1, 0, 5 }, result.geometry.positions[2]);
}

test "a tree is fitted until it costs 1.3 times what it did, and is then built anew" {
    const gpa = std.testing.allocator;
    const side = 20;
    var corners: [side * side][3]math.Vec3 = undefined;
    var moves: [3 * corners.len]math.Vec3 = undefined;
    for (&corners, 0..) |*triangle, index| {
        const x: f32 = @floatFromInt(index % side);
        const y: f32 = @floatFromInt(index / side);
        triangle.* = .{ .{ x, y, 0 }, .{ x + 1, y, 0 }, .{ x, y + 1, 0 } };
        // Every other one goes to the other end.
        const across: f32 = if (index % 2 == 0) 0 else side - 1 - 2 * x;
        for (moves[3 * index ..][0..3]) |*move| move.* = .{ across, 0, 0 };
    }
    var from = try TestScene.soup(gpa, &corners);
    defer from.deinit();
    var mesh = from.meshes[0];
    mesh.morph_targets = &.{.{ .positions = &moves }};
    from.meshes = (&mesh)[0..1];
    var weights: [1]f32 = .{0};
    from.instances = &.{.{ .mesh = 0, .node = 0, .morph_weights = &weights }};
    from.check();
    var made: TestPose = undefined;
    try made.init(gpa, &from);
    defer made.deinit();
    const again = &made.posed.world;
    const built = again.facts.tree.sah_cost;
    for ([_]f32{ 0.01, 1, 1.01, 0 }, [_]bool{ true, false, true, false }) |weight, is_fitted| {
        weights[0] = weight;
        try made.again(&from);
        try check.check(gpa, again);
        try std.testing.expectEqual(is_fitted, made.posed.cache.tree.?.w4.sums.len > 0);
        var fresh: TestPose = undefined;
        try fresh.init(gpa, &from);
        defer fresh.deinit();
        const anew = &fresh.posed.world;
        try expectSameBytes(anew.geometry.positions, again.geometry.positions);
        const cost = again.facts.tree.sah_cost;
        const new_cost = anew.facts.tree.sah_cost;
        if (!is_fitted) try std.testing.expectEqual(new_cost, cost);
        try std.testing.expect(cost <= 1.3 * @max(built, new_cost));
    }
}

test "memory that runs out is an error that leaks nothing" {
    const gpa = std.testing.allocator;
    // Enough of them to be cut by a grid and by all threads first.
    const corners = try gpa.alloc([3]math.Vec3, 17_000);
    defer gpa.free(corners);
    for (corners, 0..) |*triangle, index| {
        const at: f32 = @floatFromInt(index);
        triangle.* = .{ .{ at, 0, 0 }, .{ at + 1, 0, 0 }, .{ at, 1, 0 } };
    }
    var from = try TestScene.soup(gpa, corners);
    defer from.deinit();
    const one = struct {
        fn one(failing: std.mem.Allocator, scene_from: *const Scene) !void {
            var pool: parallel.Pool = .init(1);
            defer pool.deinit();
            var result = try prepareForTest(failing, scene_from, .{
                .lanes = 4,
                .pool = &pool,
                .tree_quality = .high,
            });
            result.deinit();
        }
    }.one;
    try std.testing.checkAllAllocationFailures(gpa, one, .{&from});
}

test "memory that runs out while meshes are shared leaks nothing" {
    const gpa = std.testing.allocator;
    var corners: [40][3]math.Vec3 = undefined;
    for (&corners, 0..) |*triangle, index| {
        const at: f32 = @floatFromInt(index);
        triangle.* = .{ .{ at, 0, 0 }, .{ at + 1, 0, 0 }, .{ at, 1, 0 } };
    }
    var from = try TestScene.soup(gpa, &corners);
    defer from.deinit();
    from.nodes = &.{
        .{ .parent = scene.none, .local = .identity },
        .{ .parent = scene.none, .local = .translate(.{ 0, 0, 3 }) },
        // Leaves all triangles out.
        .{ .parent = scene.none, .local = .scale(.{ 0, 1, 1 }) },
    };
    from.instances = &.{
        .{ .mesh = 0, .node = 0 }, .{ .mesh = 0, .node = 1 }, .{ .mesh = 0, .node = 2 },
    };
    const one = struct {
        fn one(failing: std.mem.Allocator, scene_from: *const Scene) !void {
            var pool: parallel.Pool = .init(1);
            defer pool.deinit();
            var result = try prepareForTest(failing, scene_from, .{
                .lanes = 4,
                .pool = &pool,
                .sharing = .{ .saved_min = 0, .triangle_min = 1 },
            });
            defer result.deinit();
            try std.testing.expectEqual(2, result.geometry.shared.instances.len);
            try std.testing.expectEqual(40, result.geometry.triangles.len);
            try std.testing.expectEqual(120, result.geometry.triangleCount());
        }
    }.one;
    try std.testing.checkAllAllocationFailures(gpa, one, .{&from});
}

test "memory that runs out when a scene is posed again is an error that leaks nothing" {
    const gpa = std.testing.allocator;
    var from = try TestScene.soup(gpa, &.{.{ .{ 0, 0, 0 }, .{ 1, 0, 0 }, .{ 0, 1, 0 } }});
    defer from.deinit();
    const nodes = try from.arena.allocator().alloc(scene.Node, 2);
    nodes[0] = from.nodes[0];
    from.nodes = nodes;
    from.instances = &.{ .{ .mesh = 0, .node = 0 }, .{ .mesh = 0, .node = 1 } };
    const one = struct {
        fn one(failing: std.mem.Allocator, shown: *const Scene, second: *scene.Node) !void {
            var pool: parallel.Pool = .init(1);
            defer pool.deinit();
            var diagnostic: Diagnostic = .{};
            var times: StageTimes = .{};
            const io = std.testing.io;
            var loaded = try load(failing, io, shown, .{ .pool = &pool }, &diagnostic, &times);
            defer loaded.deinit();
            const settings: PoseSettings = .{ .lanes = 4, .pool = &pool };
            second.* = .{ .parent = scene.none, .local = .scale(@splat(0)) };
            var posed = try pose(failing, io, shown, &loaded, settings, &diagnostic, &times);
            defer posed.deinit();
            // Fitted; with a triangle that the tree lacks; and fitted again.
            for ([_]f64{ 0, 1, 2 }) |scale| {
                second.local = .scale(@splat(scale));
                const cache = &posed.cache;
                const again = &posed.world;
                try poseAgain(again, cache, io, shown, &loaded, settings, &diagnostic, &times);
                const dropped: u32 = if (scale > 0) 0 else 1;
                try std.testing.expectEqual(dropped, again.geometry.dropped_count);
            }
        }
    }.one;
    try std.testing.checkAllAllocationFailures(gpa, one, .{ &from, &nodes[1] });
}

test {
    _ = animate;
    _ = representative_lights;
    _ = reference_file;
    _ = Drawn;
    _ = motion_file;
    _ = environment;
    _ = bvh_wide;
    _ = alpha;
    _ = check;
    _ = join;
    _ = deform;
    _ = emitter_lights;
    _ = flatten;
    _ = strokes;
    _ = light;
    _ = emission_points;
    _ = light_sampler;
    _ = material;
    _ = place_file;
    _ = tangents;
    _ = texture;
    _ = extent_file;
    _ = Origins;
    _ = @import("prepare/relief.zig");
    _ = @import("prepare/layers.zig");
    _ = @import("prepare/texture_use.zig");
    _ = @import("prepare/pyramid.zig");
    _ = view_file;
    _ = @import("prepare/framing.zig");
    _ = @import("prepare/mikktspace.zig");
    _ = @import("prepare/volumes.zig");
    _ = @import("prepare/bvh/split.zig");
    _ = bvh_input;
    _ = @import("prepare/bvh/build.zig");
    _ = @import("prepare/bvh/cells.zig");
    _ = @import("prepare/bvh/reinsert.zig");
    _ = bvh_refit;
}
