//! The light list of a frame: what of its light is chosen at random, and how often.
//!
//! In: a frame. Out: triangles that emit and lights at points in a tree, directional lights by
//! irradiance, the environment by radiance. Triangles that shine to both sides count as such, but
//! behind for a part where they are taken for closed (`emitters.zig`). What emits below a clear
//! coat is left out: rays find it by chance.

const std = @import("std");
const math = @import("../math.zig");
const parallel = @import("../parallel.zig");
const simd = @import("../simd.zig");
const world = @import("../world.zig");
const distribution = @import("environment/distribution.zig");
const emitters = @import("emitters.zig");
const light_tree = @import("light_tree.zig");
const Allocator = std.mem.Allocator;
const Bounds = light_tree.Bounds;
const Vec3d = math.Vec3d;
const vec3d = math.vec3d;
const luminanceOf = emitters.luminanceOf;
const pi = std.math.pi;

/// How often what is behind a closed surface is chosen, for as much light in front.
const closed_back = 0.25;

pub const Error = error{OutOfMemory} || parallel.Error;

/// A light list and its memory.
pub const OwnedLightSampler = struct {
    arena: std.heap.ArenaAllocator,
    sampler: world.LightSampler,

    /// Frees everything.
    pub fn deinit(owned: *OwnedLightSampler) void {
        owned.arena.deinit();
        owned.* = undefined;
    }
};

/// Makes the list of a frame, which must not change as long as it is used; without surfaces that
/// emit where these are not asked for.
pub fn make(
    gpa: Allocator,
    frame: *const world.Frame,
    has_emitters: bool,
    pool: *parallel.Pool,
) Error!OwnedLightSampler {
    const mode = simd.setFlushToZero();
    defer simd.setFloatControl(mode);
    return makeOf(gpa, frame, has_emitters, pool);
}

/// Not inlined, so that no arithmetic moves before the mode is set.
noinline fn makeOf(
    gpa: Allocator,
    frame: *const world.Frame,
    has_emitters: bool,
    pool: *parallel.Pool,
) Error!OwnedLightSampler {
    var arena_state: std.heap.ArenaAllocator = .init(gpa);
    errdefer arena_state.deinit();
    const arena = arena_state.allocator();
    var collector: Collector = .{ .gpa = gpa, .frame = frame };
    defer collector.deinit();
    if (has_emitters) try collector.addEmitters();
    const emitter_count = collector.leaves.items.len;
    for (frame.all_lights, 0..) |*light, number| try collector.addLight(light, @intCast(number));
    const leaves = try arena.dupe(world.LightLeaf, collector.leaves.items);
    const nodes = try light_tree.build(gpa, arena, collector.bounds.items, leaves);
    var sampler: world.LightSampler = .{
        .environment = null,
        .ambient_share = 0,
        .environment_irradiance = 0,
        .directional_irradiance = 0,
        .directional = &.{},
        .tree = .{ .nodes = nodes, .leaves = leaves, .emitter_count = emitter_count },
    };
    try addDirectional(arena, frame.all_lights, &sampler);
    try addEnvironment(arena, frame.environment, pool, &sampler);
    return .{ .arena = arena_state, .sampler = sampler };
}

const Collector = struct {
    gpa: Allocator,
    frame: *const world.Frame,
    bounds: std.ArrayList(Bounds) = .empty,
    leaves: std.ArrayList(world.LightLeaf) = .empty,

    fn deinit(collector: *Collector) void {
        collector.bounds.deinit(collector.gpa);
        collector.leaves.deinit(collector.gpa);
    }

    fn add(
        collector: *Collector,
        bounds: Bounds,
        leaf: world.LightLeaf,
    ) error{OutOfMemory}!void {
        // What is nothing in single precision, or everything, cannot be weighed.
        if (!(bounds.intensity >= std.math.floatMin(f32))) return;
        if (!(bounds.intensity < std.math.floatMax(f32))) return;
        try collector.bounds.append(collector.gpa, bounds);
        try collector.leaves.append(collector.gpa, leaf);
    }

    fn addEmitters(collector: *Collector) error{OutOfMemory}!void {
        const frame = collector.frame;
        var finder: emitters.Finder = .{
            .gpa = collector.gpa,
            .geometry = frame.geometry,
            .materials = frame.materials,
            .textures = frame.textures,
        };
        defer finder.deinit();
        if (!finder.glows()) return;
        _ = try finder.measure();
        for (finder.runs.items) |run| {
            for (frame.geometry.triangles[run.first..run.end], run.first..) |*triangle, index| {
                if (triangle.isDropped()) continue;
                try collector.addTriangle(&finder, triangle, @intCast(index), run.is_two_sided);
            }
        }
    }

    fn addTriangle(
        collector: *Collector,
        finder: *const emitters.Finder,
        triangle: *const world.Triangle,
        index: u32,
        is_open: bool,
    ) error{OutOfMemory}!void {
        const geometry = collector.frame.geometry;
        const material = &collector.frame.materials.all[triangle.material];
        // What a coat leaves of the light depends on the way: only rays that hit the triangle know.
        const layers = collector.frame.materials.layers;
        if (layers.len > 0 and layers[triangle.material].clearcoat > 0) return;
        const is_two_sided = material.double_sided > 0 or material.volume > 0;
        const corners = finder.cornersOf(triangle);
        const doubled = emitters.facingOf(&corners);
        var box: math.Box3 = .empty;
        for (triangle.corner) |vertex| box = box.include(geometry.positions[vertex]);
        const radiance = luminanceOf(finder.emitted(triangle, &emitters.whole)) / pi;
        const is_shared = geometry.shared.runs.len > 0;
        try collector.add(.{
            .box = box,
            .axis = vec3d.normalize(doubled) orelse return,
            .cos_spread = 1,
            .cos_emission = 0,
            .intensity = radiance * 0.5 * vec3d.length(doubled),
            .back = if (is_open) 1 else if (is_two_sided) closed_back else 0,
        }, .{
            .path = 0,
            .is_emitter = true,
            .is_two_sided = is_two_sided,
            .is_hidden = material.is_hidden_lamp,
            .number = if (is_shared) geometry.shared.numberOf(index) else index,
        });
    }

    fn addLight(
        collector: *Collector,
        light: *const world.Light,
        number: u32,
    ) error{OutOfMemory}!void {
        var cos_spread: f64 = -1;
        var cos_emission: f64 = 0;
        switch (light.kind) {
            .point => {},
            .spot => {
                // Where the cone begins to fade, and where it ends.
                const scale: f64 = light.cone_scale;
                const outer = -light.cone_offset / scale;
                const inner = @min(1, @max(-1, outer + 1 / scale));
                const sines = (1 - inner * inner) * @max(0, 1 - outer * outer);
                cos_spread = inner;
                cos_emission = @min(1, inner * outer + @sqrt(sines));
                // So that rounding leaves no part of the cone out.
                cos_emission -= 1e-6;
            },
            .directional, .emitter => return,
        }
        try collector.add(.{
            .box = .{ .lower = light.position, .upper = light.position },
            .axis = .{ light.direction[0], light.direction[1], light.direction[2] },
            .cos_spread = cos_spread,
            .cos_emission = cos_emission,
            .intensity = luminanceOf(.{
                light.intensity[0], light.intensity[1], light.intensity[2],
            }),
            .back = 0,
            .reach = if (light.range_inv_squared > 0)
                // A little more, for rounding.
                1.001 / @sqrt(@as(f64, light.range_inv_squared))
            else
                std.math.inf(f64),
        }, .{ .path = 0, .is_emitter = false, .number = number });
    }
};

fn addDirectional(
    arena: Allocator,
    lights: []const world.Light,
    sampler: *world.LightSampler,
) error{OutOfMemory}!void {
    var total: f64 = 0;
    var count: usize = 0;
    for (lights) |*light| {
        const lux = directionalLux(light);
        total += lux;
        count += @intFromBool(lux > 0);
    }
    const choices = try arena.alloc(world.DirectionalChoice, count);
    var sum: f64 = 0;
    count = 0;
    for (lights, 0..) |*light, number| {
        const lux = directionalLux(light);
        if (!(lux > 0)) continue;
        sum += lux;
        choices[count] = .{
            .light = @intCast(number),
            .share = @floatCast(lux / total),
            .share_end = @floatCast(sum / total),
        };
        count += 1;
    }
    sampler.directional = choices;
    sampler.directional_irradiance = @floatCast(@min(total, std.math.floatMax(f32)));
}

/// Of luminance; 0 of other lights.
fn directionalLux(light: *const world.Light) f64 {
    if (light.kind != .directional) return 0;
    return luminanceOf(.{ light.intensity[0], light.intensity[1], light.intensity[2] });
}

fn addEnvironment(
    arena: Allocator,
    environment: *const world.Environment,
    pool: *parallel.Pool,
    sampler: *world.LightSampler,
) Error!void {
    const even = environment.ambient * @as(f32, pi);
    sampler.environment_irradiance = even;
    sampler.ambient_share = 1;
    const map = environment.map orelse return;
    const scale = environment.scale;
    const factor: f32 = @floatCast(luminanceOf(.{ scale[0], scale[1], scale[2] }));
    if (!(factor > 0)) return;
    const found = try distribution.make(arena, &map.radiance[0], pool) orelse return;
    const kept = try arena.create(world.EnvironmentDistribution);
    kept.* = found;
    sampler.environment = kept;
    // The mean radiance over the sphere of 4 pi times pi.
    const mapped = 0.25 * kept.total() * factor;
    sampler.environment_irradiance += mapped;
    sampler.ambient_share = even / (even + mapped);
}
