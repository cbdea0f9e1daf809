//! The light list of integrators that choose lights at random: where the environment is bright, a
//! tree over all lights that are somewhere, and directional lights by their irradiance.

const math = @import("../math.zig");
const geometry_file = @import("geometry.zig");
const Vec3 = math.Vec3;

/// How bright an environment map is by direction: a quadtree over the octahedral square.
pub const EnvironmentDistribution = struct {
    /// Levels from one cell to `size` cells along each side, each in Morton order, so that the four
    /// parts of cell i of a level, left and right of the upper row and of the lower one, are
    /// 4 i ... 4 i + 3 of the next. Luminance times solid angle of what the four texels that are
    /// mixed give over a cell, so that none is 0 where something is seen.
    weights: []const f32,
    /// A power of two.
    size: u32,

    /// Luminance times solid angle of all directions; > 0.
    pub fn total(distribution: *const EnvironmentDistribution) f32 {
        return distribution.weights[0];
    }
};

/// Children of a node.
pub const light_tree_width = 4;
/// Levels of nodes at most: a path takes two bits for each.
pub const light_tree_depth_max = 32;

/// What light may come from each child of a node, structure of arrays. Lights shine from within a
/// sphere along axes in a cone, and around each axis in another cone.
pub const LightNode = struct {
    /// [axis][child], of the sphere.
    center: [3][light_tree_width]f32,
    radius: [light_tree_width]f32,
    /// [axis][child], unit vector in the middle of the axes.
    axis: [3][light_tree_width]f32,
    /// Cosine and sine of the largest angle between that and an axis.
    cos_spread: [light_tree_width]f32,
    sin_spread: [light_tree_width]f32,
    /// Cosine of the largest angle between an axis and its light.
    cos_emission: [light_tree_width]f32,
    /// The sum of the largest intensities, in candela of luminance; 0: there is no child.
    intensity: [light_tree_width]f32,
    /// In metres, how far light goes at most.
    reach: [light_tree_width]f32,
    /// Share of the intensity behind: 0 where all lights are one-sided.
    back: [light_tree_width]f32,
    /// Number of a node or of a leaf, see `leaf_bit`.
    child: [light_tree_width]u32,

    /// In `child`: a leaf.
    pub const leaf_bit: u32 = 1 << 31;

    /// Without children.
    pub const empty: LightNode = .{
        .center = @splat(@splat(0)),
        .radius = @splat(0),
        .axis = .{ @splat(0), @splat(0), @splat(1) },
        .cos_spread = @splat(1),
        .sin_spread = @splat(0),
        .cos_emission = @splat(0),
        .intensity = @splat(0),
        .reach = @splat(0),
        .back = @splat(0),
        .child = @splat(0),
    };
};

/// A light of the tree.
pub const LightLeaf = struct {
    /// The children on the way to it from the root, two bits each, the first the lowest.
    path: u64,
    /// A triangle that emits, else a light of `Frame.all_lights`.
    is_emitter: bool,
    /// Of emitters: seen from behind as well.
    is_two_sided: bool = false,
    /// Of emitters: no ray ever hits it.
    is_hidden: bool = false,
    /// Of the triangle, or of the light.
    number: u32,
};

/// A tree over lights that are somewhere.
pub const LightTree = struct {
    /// Node 0 is the root; empty without lights.
    nodes: []const LightNode,
    /// Emitters first, by number.
    leaves: []const LightLeaf,
    emitter_count: usize,

    /// The leaf of a triangle; null: it is none of the tree's.
    pub fn leafOf(tree: *const LightTree, primitive: u32) ?*const LightLeaf {
        var low: usize = 0;
        var high = tree.emitter_count;
        while (low < high) {
            const middle = low + (high - low) / 2;
            if (tree.leaves[middle].number < primitive) low = middle + 1 else high = middle;
        }
        if (low == tree.emitter_count or tree.leaves[low].number != primitive) return null;
        return &tree.leaves[low];
    }
};

/// A directional light.
pub const DirectionalChoice = struct {
    /// Its number in `Frame.all_lights`.
    light: u32,
    /// Share of the irradiance of all of them, and the sum of shares up to its own.
    share: f32,
    share_end: f32,
};

/// All lights of a frame; made for it alone.
pub const LightSampler = struct {
    /// Null: the environment is the same all around, or there is none.
    environment: ?*const EnvironmentDistribution,
    /// Share of the environment's light that comes from all sides alike.
    ambient_share: f32,
    /// On a plane, in lux of luminance: by the mean of the environment, by all directional lights
    /// together.
    environment_irradiance: f32,
    directional_irradiance: f32,
    directional: []const DirectionalChoice,
    tree: LightTree,
};
