//! Stage 3: World -> Film. Rays are traced by all threads, a tile at a time.
//!
//! In: the frame, which nothing changes meanwhile, and settings. Out: every pixel of the film, and
//! how many rays it took. Nothing is allocated while rays are traced and no lock is taken. The
//! picture is the same bits for every variant, thread count and tile size.

const std = @import("std");
const choices = @import("settings.zig");
const world_file = @import("world.zig");
const variant_file = @import("variant.zig");
const adaptive = @import("trace/integrate/adaptive.zig");
const interleave = @import("trace/integrate/interleave.zig");
const tiles = @import("trace/integrate/tiles.zig");
const visibility = @import("trace/integrate/visibility.zig");
const Film = @import("film.zig").Film;
const Surroundings = @import("film.zig").Surroundings;
const assert = std.debug.assert;
const Allocator = std.mem.Allocator;
const Frame = world_file.Frame;
const Variant = variant_file.Variant;

/// How kernels are found.
pub const link = @import("trace/link.zig");
/// Whitted's ray tracing, by one kernel.
pub const Whitted = @import("trace/integrate/whitted.zig").Whitted;
/// Instant radiosity, by one kernel.
pub const Lights = @import("trace/integrate/instant_radiosity.zig").InstantRadiosity;
/// Path tracing, by one kernel.
pub const PathTracer = @import("trace/integrate/path_tracer.zig").PathTracer;
/// What primary rays see, by one kernel that counts tests.
pub const AovIntegrator = @import("trace/integrate/aov.zig").AovIntegrator;
/// What it makes.
pub const Aov = @import("trace/integrate/aov.zig").Aov;
/// The comptime shape of a tracer; with the files below for tests and benchmarks of traversal.
pub const kernel = @import("trace/traverse/kernel.zig");
/// Rays in lanes.
pub const ray = @import("trace/traverse/ray.zig");
/// The exact triangle test.
pub const triangle = @import("trace/traverse/triangle.zig");
/// One ray in the lanes of a tree.
pub const traversal_ray = @import("trace/traverse/traversal_ray.zig");
/// One ray after the other through the tree.
pub const single = @import("trace/traverse/single.zig");
/// Incoherent rays as a stream.
pub const stream = @import("trace/traverse/stream.zig");
/// The first few hits of rays.
pub const multi_hit = @import("trace/traverse/multi_hit.zig");
/// A few rays that go much the same way.
pub const interval_packet = @import("trace/traverse/interval_packet.zig");
/// The way through the tree, and what rays want to know.
pub const walk = @import("trace/traverse/walk.zig");
/// A bundle of rays through the tree.
pub const bundle = @import("trace/traverse/bundle.zig");
/// Rays from one point as a beam.
pub const eye_rays = @import("trace/traverse/beam/eye_rays.zig");
/// The directions of a beam's rays.
pub const Grid = @import("trace/traverse/beam/grid.zig").Grid;
/// The parts of beams whose bounds are tested.
pub const beam = struct {
    pub const frustum = @import("trace/traverse/beam/frustum.zig");
    pub const members = @import("trace/traverse/beam/members.zig");
    pub const pixel_window = @import("trace/traverse/beam/pixel_window.zig");
    pub const projected_triangle = @import("trace/traverse/beam/projected_triangle.zig");
    pub const shadow_plane = @import("trace/traverse/beam/shadow_plane.zig");
    pub const shadow_receivers = @import("trace/traverse/beam/shadow_receivers.zig");
};
/// What single lights bring to points, and those points.
pub const light = @import("trace/shade/light.zig");
pub const interaction = @import("trace/shade/interaction.zig");
/// The light list in lanes, and the tree of it.
pub const light_sampling = @import("trace/shade/light_sampling.zig");
pub const light_tree = @import("trace/shade/light_tree.zig");
/// Surfaces that one ray goes on through without a bounce, and that weaken light on its way.
pub const transparency_depth_max = visibility.transparency_depth_max;
pub const attenuation_count_max = visibility.attenuation_count_max;
/// Volumes that a ray is in at a time.
pub const nested_max = @import("trace/shade/volumes.zig").nested_max;
/// What tests of traversal ask of a kernel.
pub const searches = @import("trace/traverse/searches.zig");
/// A bundle in the variant's own way.
pub const dispatch = @import("trace/traverse/dispatch.zig");

/// The searches of a kernel, where the build has kernels show them.
pub fn searchesOf(comptime Kernel: type) *const searches.Searches(Kernel) {
    const Face = searches.Searches(Kernel);
    return @extern(*const Face, .{ .name = link.symbolOf(Face, Kernel.variant, "searches") });
}

/// A kernel's face.
pub const Integrator = tiles.Integrator;
pub const Settings = tiles.Settings;
pub const Course = tiles.Course;
pub const Standing = tiles.Standing;
pub const Statistics = tiles.Statistics;
pub const Error = tiles.Error;

/// What has to be traced around the pixels that are asked for.
pub fn surroundingsOf(render: *const choices.Render) Surroundings {
    const is_filtered = render.integrator == .lights and render.lights.is_interleaved;
    return .{
        .margin = if (is_filtered) interleave.reach else 0,
        .step = if (render.noise != null) adaptive.block_side else 1,
    };
}

/// Traces the picture with variant `variant_index` of `variant.compiled`. Asserts that the film has
/// the layout's size, without one the view's, the tree the variant's width, and that the variant
/// holds the integrator. The film may hold an earlier picture.
pub fn trace(
    gpa: Allocator,
    variant_index: usize,
    frame: *const Frame,
    film: *Film,
    settings: Settings,
) Error!Statistics {
    return run(false, gpa, variant_index, frame, film, &settings);
}

/// The same with boxes and triangles counted, which takes longer: for a second pass, untimed.
/// Asserts that the integrator is Whitted's.
pub fn traceCounting(
    gpa: Allocator,
    variant_index: usize,
    frame: *const Frame,
    film: *Film,
    settings: Settings,
) Error!Statistics {
    return run(true, gpa, variant_index, frame, film, &settings);
}

/// Leaves hits on the film's layer of origins, see `tiles.fillHits`.
pub fn fillHits(
    gpa: Allocator,
    variant_index: usize,
    frame: *const Frame,
    film: *Film,
    settings: Settings,
) Error!void {
    return tiles.fillHits(aovIntegratorOf(variant_index), gpa, frame, film, &settings);
}

/// Makes a picture of what `settings.aov` names, of colours of the display: not one of hits, and
/// the film has a layer for those colours.
pub fn traceAov(
    gpa: Allocator,
    variant_index: usize,
    frame: *const Frame,
    film: *Film,
    settings: Settings,
) Error!Statistics {
    assert(settings.aov != .hits and film.layers.contains(.display));
    return tiles.render(aovIntegratorOf(variant_index), gpa, frame, film, &settings);
}

fn aovIntegratorOf(variant_index: usize) *const Integrator {
    return (comptime integratorsOf("aov", counting_variants))[variant_index];
}

/// By variant, those that count its tests.
const counting_variants: []const Variant = list: {
    var list: [variant_file.compiled.len]Variant = variant_file.compiled[0..].*;
    for (&list) |*variant| variant.* = variant_file.countingOf(variant.*);
    const all = list;
    break :list &all;
};

fn run(
    comptime counting: bool,
    gpa: Allocator,
    variant_index: usize,
    frame: *const Frame,
    film: *Film,
    settings: *const Settings,
) Error!Statistics {
    const view = frame.view;
    if (settings.layout) |layout|
        assert(layout.width == view.width and layout.height == view.height)
    else
        assert(film.image.width == view.width and film.image.height == view.height);
    assert(settings.sample_count >= 1 and choices.depth.holds(settings.depth_max));
    const whitted = comptime if (counting)
        integratorsOf("counting", counting_variants)
    else
        integratorsOf("whitted", variant_file.compiled);
    const integrator = switch (settings.integrator) {
        .whitted => whitted[variant_index],
        inline .lights, .path => |which| integrator: {
            assert(!counting);
            const list = comptime integratorsOf(@tagName(which), variant_file.lit);
            break :integrator list[variant_file.litIndexOf(variant_index).?];
        },
    };
    return tiles.render(integrator, gpa, frame, film, settings);
}

/// By variant.
fn integratorsOf(
    comptime what: []const u8,
    comptime variants: []const Variant,
) [variants.len]*const Integrator {
    comptime {
        @setEvalBranchQuota(1_000_000); // For the names.
        var list: [variants.len]*const Integrator = undefined;
        for (&list, variants) |*to, variant| {
            const symbol = link.symbolOf(Integrator, variant, what);
            to.* = @extern(*const Integrator, .{ .name = symbol });
        }
        return list;
    }
}

test {
    _ = link;
    _ = kernel;
    _ = ray;
    _ = triangle;
    _ = single;
    _ = traversal_ray;
    _ = stream;
    _ = @import("trace/traverse/stack.zig");
    _ = bundle;
    _ = dispatch;
    _ = @import("trace/integrate/environment_lights.zig");
    _ = interleave;
    _ = @import("trace/integrate/light_emission.zig");
    _ = @import("trace/integrate/virtual_lights.zig");
    _ = @import("trace/integrate/camera.zig");
    _ = @import("trace/integrate/numbers.zig");
    _ = @import("trace/integrate/path.zig");
    _ = @import("trace/integrate/path_records.zig");
    _ = tiles;
    _ = adaptive;
    _ = @import("trace/traverse/beam/budget.zig");
    _ = @import("trace/traverse/beam/tile_depth_buffer.zig");
    _ = @import("trace/traverse/beam/grid.zig");
    _ = beam.pixel_window;
    _ = @import("trace/integrate/sampler.zig");
    _ = @import("trace/integrate/sobol.zig");
    _ = @import("trace/shade/cosine.zig");
    _ = @import("trace/shade/exponential.zig");
    _ = @import("trace/shade/iridescence.zig");
    _ = light;
    _ = light_sampling;
    _ = @import("trace/shade/emission.zig");
    _ = @import("trace/shade/environment_sampling.zig");
    _ = @import("trace/shade/offset.zig");
    _ = @import("trace/shade/albedo.zig");
    _ = @import("trace/shade/anisotropy.zig");
    _ = @import("trace/shade/bsdf.zig");
    _ = @import("trace/shade/chi_squared.zig");
    _ = @import("trace/shade/microfacet.zig");
    _ = @import("trace/shade/coating.zig");
    _ = @import("trace/shade/interface.zig");
    _ = @import("trace/shade/passing.zig");
    _ = @import("trace/shade/scatter.zig");
    _ = @import("trace/shade/sheen.zig");
    _ = @import("trace/shade/phase.zig");
    _ = @import("trace/shade/transmission.zig");
    _ = @import("trace/shade/unique.zig");
    _ = @import("trace/shade/volumes.zig");
    _ = @import("trace/shade/texture.zig");
    _ = @import("trace/shade/ray_cone.zig");
    _ = @import("trace/shade/lookups.zig");
    _ = @import("trace/shade/texturing.zig");
    _ = @import("trace/shade/normal_map.zig");
    _ = multi_hit;
}
