//! Data 2: what rays meet, as immutable aligned arrays.
//!
//! `prepare` fills it, `trace` reads it; nothing in it changes while rays are traced, so threads
//! share it without locks. World space, right-handed, y up. Its parts change at different times:
//! geometry with the pose, the view with the camera, the others with neither.

const std = @import("std");
const math = @import("math.zig");
const environment_file = @import("world/environment.zig");
/// Where instances stand.
pub const placement = @import("world/placement.zig");
/// Meshes that several instances share.
pub const instances = @import("world/instances.zig");
const geometry_file = @import("world/geometry.zig");
const materials_file = @import("world/materials.zig");
const textures_file = @import("world/textures.zig");
const light_sampler_file = @import("world/light_sampler.zig");
const view_file = @import("world/view.zig");

pub const AnyTree = geometry_file.AnyTree;
pub const Camera = view_file.Camera;
pub const Child = geometry_file.Child;
pub const DirectionalChoice = light_sampler_file.DirectionalChoice;
pub const Environment = environment_file.Environment;
pub const EnvironmentDistribution = light_sampler_file.EnvironmentDistribution;
pub const EnvironmentLevel = environment_file.EnvironmentLevel;
pub const Cursor = instances.Cursor;
pub const EnvironmentMap = environment_file.EnvironmentMap;
pub const EnvironmentPart = environment_file.EnvironmentPart;
pub const EnvironmentSource = environment_file.EnvironmentSource;
pub const EnvironmentTexel = environment_file.EnvironmentTexel;
pub const Face = instances.Face;
pub const Geometry = geometry_file.Geometry;
pub const Layers = @import("world/layers.zig").Layers;
pub const Lookup = textures_file.Lookup;
pub const Light = @import("world/light.zig").Light;
pub const LightLeaf = light_sampler_file.LightLeaf;
pub const LightNode = light_sampler_file.LightNode;
pub const LightSampler = light_sampler_file.LightSampler;
pub const LightTree = light_sampler_file.LightTree;
pub const Material = materials_file.Material;
pub const Materials = materials_file.Materials;
pub const Node = geometry_file.Node;
pub const Padding = @import("world/padding.zig").Padding;
pub const Placement = placement.Placement;
pub const Slot = textures_file.Slot;
pub const Sphere = geometry_file.Sphere;
pub const Texture = textures_file.Texture;
pub const TextureLevel = textures_file.Level;
pub const Textures = textures_file.Textures;
pub const Tree = geometry_file.Tree;
pub const TreeStatistics = geometry_file.TreeStatistics;
pub const Triangle = geometry_file.Triangle;
pub const TrianglePack = geometry_file.TrianglePack;
pub const View = view_file.View;
pub const Volume = @import("world/volume.zig").Volume;
pub const Wrap = textures_file.Wrap;
pub const cache_line_bytes = geometry_file.cache_line_bytes;
pub const light_tree_depth_max = light_sampler_file.light_tree_depth_max;
pub const light_tree_width = light_sampler_file.light_tree_width;
pub const none = geometry_file.none;
pub const tree_depth_max = geometry_file.tree_depth_max;
pub const walk_depth_max = geometry_file.walk_depth_max;

/// All that tracing a picture takes.
pub const Frame = struct {
    geometry: *const Geometry,
    materials: *const Materials,
    textures: *const Textures,
    lights: []const Light,
    /// The punctual ones among them, or all those that they stand for where these are many more
    /// (`settings.punctual_light_count_max`): for integrators that choose lights at random.
    all_lights: []const Light = &.{},
    environment: *const Environment,
    view: *const View,
    /// For integrators that choose lights at random; null: nobody asked for it.
    light_sampler: ?*const LightSampler = null,
    /// Points on surfaces that emit, with the flux of all of these, in the place of `lights` of the
    /// kind `emitter`: for integrators that have virtual lights. None: nobody asked for them.
    emission: []const Light = &.{},

    /// Whether what is seen depends on how wide rays are: they have cones then.
    pub inline fn needsFootprints(frame: *const Frame) bool {
        const environment = frame.environment;
        return frame.hasTextures() or environment.map != null or environment.backdrop != null;
    }

    /// Whether a material has any.
    pub inline fn hasLayers(frame: *const Frame) bool {
        return frame.materials.layers.len > 0;
    }

    /// Whether a material has any.
    pub inline fn hasTextures(frame: *const Frame) bool {
        return frame.materials.lookups.len > 0;
    }
};

/// What was found on the way, for messages and the report; tracing does not read it.
pub const Facts = struct {
    tree: TreeStatistics,
    /// No camera of the file was used: the view was framed on what there is.
    camera_is_default: bool = false,
    /// The file has no light that shines: the lights are three fixed to the camera.
    lights_are_default: bool = false,
    /// The light is the studio's, for want of any other.
    environment_is_default: bool = false,
    /// Lights of the file that shine.
    own_light_count: usize = 0,
    /// Lights that stand for surfaces which emit, the last of all: those of them that are not among
    /// the file's own.
    emitter_count: usize = 0,
    /// Triangles left out because they have no area or no finite place.
    degenerate_count: u64,
    /// Triangles that points and lines became.
    stroke_triangle_count: u64 = 0,
};

/// Everything that tracing needs, and its memory.
pub const World = struct {
    /// Of arrays that all poses write, of the tree, of what else a pose makes, and of the view.
    arena: std.heap.ArenaAllocator,
    tree_arena: std.heap.ArenaAllocator,
    pose_arena: std.heap.ArenaAllocator,
    view_arena: std.heap.ArenaAllocator,
    geometry: Geometry,
    /// Where the nodes of the scene are: for cameras and lights, which are placed by the view.
    node_maps: []const math.AffineD,
    materials: Materials,
    /// Made once a scene, by `prepare.load`, as are the lookups of the materials; not owned.
    textures: Textures,
    lights: []const Light = &.{},
    /// See `Frame`; null: `lights` has them all.
    all_lights: ?[]const Light = null,
    /// In the place of all surfaces that emit; null: not made yet.
    emitters: ?[]const Light = null,
    environment: Environment = .{ .ambient = 0, .background = @splat(0) },
    view: View = .nowhere,
    facts: Facts,

    /// A world with nothing in it; its memory is to come from `gpa`.
    pub fn init(gpa: std.mem.Allocator) World {
        return .{
            .arena = .init(gpa),
            .tree_arena = .init(gpa),
            .pose_arena = .init(gpa),
            .view_arena = .init(gpa),
            .geometry = .empty,
            .node_maps = &.{},
            .materials = .{
                .all = &.{},
                .has_transparency = false,
                .has_holes = false,
                .occluders = &.{},
            },
            .textures = .{ .all = &.{} },
            .facts = .{
                .tree = .{ .node_count = 0, .depth = 0, .sah_cost = 0, .bytes = 0 },
                .degenerate_count = 0,
            },
        };
    }

    /// What tracing takes; the world has to stay where it is meanwhile.
    pub fn frame(world: *const World) Frame {
        return .{
            .geometry = &world.geometry,
            .materials = &world.materials,
            .textures = &world.textures,
            .lights = world.lights,
            .all_lights = world.all_lights orelse world.lights,
            .environment = &world.environment,
            .view = &world.view,
        };
    }

    /// Frees everything.
    pub fn deinit(world: *World) void {
        world.arena.deinit();
        world.tree_arena.deinit();
        world.pose_arena.deinit();
        world.view_arena.deinit();
        world.* = undefined;
    }
};

test {
    _ = geometry_file;
    _ = Padding;
}
