//! Instant radiosity in beams (Keller 1997; Wald et al. 2002, "Interactive Global Illumination
//! using Fast Ray Tracing"): light that has bounced diffusely comes from virtual point lights.
//!
//! In: the frame, a bundle's place in the picture. Out: samples on the film, see `ray_tree.zig`.
//! Before the picture light paths are traced and virtual lights chosen (`light_selection.zig`); the
//! sky is as many directional lights as all samples have. Each pixel of any 3x3 has a ninth of a
//! sample's, and after the picture gets what its neighbours found (`interleave.zig`). So that
//! shadow rays still are beams, a bundle's pixels are every third. The lights are the same for all
//! pixels, so there is no noise, and nothing depends on threads. The scene's punctual lights,
//! mirrors and glass are as Whitted has them; surfaces that emit have virtual lights on them.

const std = @import("std");
const world_file = @import("../../world.zig");
const dispatch = @import("../traverse/dispatch.zig");
const environment_file = @import("environment.zig");
const environment_lights = @import("environment_lights.zig");
const emission = @import("light_emission.zig");
const interleave = @import("interleave.zig");
const interleaved_light = @import("interleaved_light.zig");
const light_selection = @import("light_selection.zig");
const tiles = @import("tiles.zig");
const EnvironmentLight = environment_lights.EnvironmentLight;
const EnvironmentLights = environment_lights.EnvironmentLights;
const Film = @import("../../film.zig").Film;
const Frame = world_file.Frame;
const Layers = interleave.Layers;
const Layout = @import("../../film.zig").Layout;
const RayTree = @import("ray_tree.zig").RayTree;
const Rectangle = @import("../../film.zig").Rectangle;

/// Directions of the sky that light paths come from, however many lights the sky has: what few of
/// them let into a room is noise that no number of lights takes away.
const path_sky_count = 1 << 10;
/// Rows that are filtered at once.
const band_rows = 8;

/// One thread's integrator.
pub fn InstantRadiosity(comptime Kernel: type) type {
    return RayTree(Kernel, Lighting(Kernel));
}

/// A part of a sample's lights at every vertex.
fn Lighting(comptime Kernel: type) type {
    const Rays = Kernel.Rays;
    const Vec3 = Rays.Vec3;
    const group_count = Kernel.group_count;
    return struct {
        shared: *Shared,
        /// Of the bundle's pixels.
        part: usize,
        light: interleaved_light.InterleavedLight(Kernel),
        /// Where primary rays see something, and how it lies.
        guided: [group_count]Rays.Mask,
        normal: [group_count]Vec3,
        distance: [group_count]Rays.F32,

        const Self = @This();
        const Tree = InstantRadiosity(Kernel);
        const ones: [group_count]Rays.F32 = @splat(.splat(1));

        pub const has_ambient = false;
        pub const stride = interleave.side;
        pub const Shared = SharedOf(Kernel);

        pub fn init(lighting: *Self, _: *const Frame, settings: *const tiles.Settings) void {
            lighting.shared = @ptrCast(@alignCast(settings.shared.?));
        }

        /// Pixels of one part, or a part of the area where all have all lights.
        pub fn partOf(lighting: *const Self, area: Rectangle, index: usize) ?Rectangle {
            const column: u32 = @intCast(index % stride);
            const row: u32 = @intCast(index / stride);
            var part = area;
            if (lighting.shared.layers.is_interleaved) {
                part.step = stride;
                part.x0 += (column + stride - area.x0 % stride) % stride;
                part.y0 += (row + stride - area.y0 % stride) % stride;
            } else {
                part.x0 += column * Kernel.bundle_width;
                part.y0 += row * Kernel.bundle_height;
                part.x1 = @min(part.x1, part.x0 + Kernel.bundle_width);
                part.y1 = @min(part.y1, part.y0 + Kernel.bundle_height);
            }
            return if (part.x0 < part.x1 and part.y0 < part.y1) part else null;
        }

        pub fn start(lighting: *Self, rectangle: Rectangle) void {
            lighting.part = interleave.partOf(rectangle.x0, rectangle.y0);
            lighting.light.start(lighting.shared.sky.len > 0);
            lighting.guided = @splat(.splat(false));
            lighting.normal = @splat(.splat(.{ 0, 0, 0 }));
            lighting.distance = @splat(.zero());
        }

        pub fn addLights(lighting: *Self, tree: *Tree, coherence: dispatch.Coherence) void {
            const shared = lighting.shared;
            const vertices = tree.receivers();
            const sample = tree.sample.number;
            if (tree.path.depth == 0) lighting.guide(tree);
            lighting.light.find(&vertices);
            tree.countShadow(if (shared.sky.len > 0) lighting.light.addSky(
                &tree.visibility,
                shared.sources,
                shared.sky_sets.of(EnvironmentLight, shared.sky, sample, lighting.part),
                &vertices,
                coherence,
                &tree.sample.radiance,
            ) else environment_file.addLight(
                Kernel,
                &tree.visibility,
                &EnvironmentLights.none,
                sample,
                &vertices,
                coherence,
                &tree.sample.radiance,
            ));
            tree.addDirect(shared.direct, coherence);
            for (shared.selection.of(sample, lighting.part)) |*one| {
                tree.countShadow(lighting.light
                    .addVirtual(&tree.visibility, one, &vertices, coherence));
            }
        }

        fn guide(lighting: *Self, tree: *const Tree) void {
            for (&tree.vertices, 0..) |*vertex, group| {
                const fresh = vertex.seen.andNot(lighting.guided[group]);
                if (fresh.none()) continue;
                lighting.guided[group] = lighting.guided[group].bitOr(fresh);
                const normal = &lighting.normal[group];
                const distance = &lighting.distance[group];
                normal.* = .select(fresh, vertex.point.normal_geometric, normal.*);
                distance.* = .select(fresh, vertex.point.distance, distance.*);
            }
        }

        pub fn expose(lighting: *Self, rectangle: Rectangle, sample: u32) void {
            const layers = &lighting.shared.layers;
            const light = &lighting.light;
            put(layers, layers.guide, rectangle, sample, &lighting.normal, &lighting.distance);
            inline for (.{ "bounced", "albedo" }) |name| {
                const one = comptime std.mem.eql(u8, name, "albedo");
                const count: ?*const [group_count]Rays.F32 = if (one) &ones else null;
                put(layers, @field(layers, name), rectangle, sample, &@field(light, name), count);
            }
            if (layers.open.len > 0) inline for (.{ "arriving", "shining", "open" }) |name| {
                put(layers, @field(layers, name), rectangle, sample, &@field(light, name), null);
            };
        }

        fn put(
            layers: *const Layers,
            layer: []Layers.Pixel,
            rectangle: Rectangle,
            sample: u32,
            colors: *const [group_count]Vec3,
            fourth: ?*const [group_count]Rays.F32,
        ) void {
            for (colors, 0..) |*color, group| {
                const x = color.x.toArray();
                const y = color.y.toArray();
                const z = color.z.toArray();
                const none: Rays.F32 = .zero();
                const w = (if (fourth) |all| all[group] else none).toArray();
                for (0..Kernel.ray_count) |lane| {
                    const column = rectangle.x0 + rectangle.step * Kernel.pixelX(group, lane);
                    const row = rectangle.y0 + rectangle.step * Kernel.pixelY(group, lane);
                    if (column >= rectangle.x1 or row >= rectangle.y1) continue;
                    const at = layers.indexOf(&rectangle, column, row);
                    Layers.add(layer, at, sample, .{ x[lane], y[lane], z[lane], w[lane] });
                }
            }
        }
    };
}

/// What all threads share: the lights, and the layers that are filtered.
fn SharedOf(comptime Kernel: type) type {
    return struct {
        gpa: std.mem.Allocator,
        frame: *const Frame,
        settings: *const tiles.Settings,
        layers: Layers,
        sky_sets: interleave.Sets,
        /// In the order of `sky_sets`.
        sky: []EnvironmentLight,
        /// Small strong sources of the environment.
        sources: []EnvironmentLight,
        /// The scene's lights but those that stand for surfaces, which virtual ones do.
        direct: []const world_file.Light,
        selection: Selection,

        const Self = @This();
        const Tree = InstantRadiosity(Kernel);
        const Selection = light_selection.LightSelection(Kernel, Tree);
        const Step = enum { place, filter };

        pub const steps_before: u32 = Selection.step_count;
        pub const step_count: u32 = steps_before + 2;

        pub fn init(
            gpa: std.mem.Allocator,
            frame: *const Frame,
            settings: *const tiles.Settings,
        ) error{OutOfMemory}!*Self {
            const shared = try gpa.create(Self);
            errdefer gpa.destroy(shared);
            const lights = &settings.lights;
            const samples = settings.sample_count;
            const environment = frame.environment;
            shared.* = .{
                .gpa = gpa,
                .frame = frame,
                .settings = settings,
                .layers = undefined,
                .sky_sets = .init(lights.sky_count, samples, lights.is_interleaved),
                .sky = &.{},
                .sources = &.{},
                .direct = directOf(frame),
                .selection = .init(gpa, frame, settings),
            };
            errdefer shared.freeLights();
            const has_map_shadows = environment.map != null and environment.shadow_count > 0;
            const has_even_sky = environment.map == null and environment.ambient > 0;
            if (has_map_shadows)
                shared.sources = try gpa.alloc(EnvironmentLight, environment.map.?.sources.len);
            if (has_map_shadows or has_even_sky)
                shared.sky = try gpa.alloc(EnvironmentLight, shared.sky_sets.count());
            try shared.placeStarts();
            const has_sky = shared.sky.len > 0;
            shared.layers = try .init(gpa, settings.layout.?, has_sky, lights.is_interleaved);
            return shared;
        }

        pub fn deinit(shared: *Self, gpa: std.mem.Allocator) void {
            shared.layers.deinit(gpa);
            shared.freeLights();
            gpa.destroy(shared);
        }

        fn freeLights(shared: *Self) void {
            const gpa = shared.gpa;
            gpa.free(shared.sky);
            gpa.free(shared.sources);
            shared.selection.deinit();
        }

        /// Makes the sky's lights, and says where light paths start.
        fn placeStarts(shared: *Self) error{OutOfMemory}!void {
            const gpa = shared.gpa;
            const environment = shared.frame.environment;
            for (shared.sources, 0..) |*source, index| source.* = environment_lights
                .ofSource(environment, &environment.map.?.sources[index]);
            for (0..shared.sky.len) |number| shared.sky[shared.sky_sets.indexOf(number)] =
                shared.skyPiece(number, shared.sky.len, shared.sky_sets.weightOf(number));
            const sky_count: usize = if (shared.sky.len > 0) path_sky_count else 0;
            const near = [_][]const world_file.Light{ shared.direct, shared.frame.emission };
            const near_count = near[0].len + near[1].len;
            const count = near_count + shared.sources.len + sky_count;
            const starts = try gpa.alloc(emission.Source, count);
            shared.selection.starts = starts;
            for (starts[0..near[0].len], near[0]) |*start, light| start.* = .{ .light = light };
            const rest = starts[near[0].len..];
            for (rest[0..near[1].len], near[1]) |*start, light| start.* = .{ .light = light };
            const far = starts[near_count..];
            for (far[0..shared.sources.len], shared.sources) |*start, *source|
                start.* = .{ .light = parallel(source) };
            for (far[shared.sources.len..], 0..) |*start, number|
                start.* = .{ .light = parallel(&shared.skyPiece(number, sky_count, 1)) };
            try shared.selection.prepare();
        }

        fn skyPiece(
            shared: *const Self,
            number: usize,
            count: usize,
            weight: f64,
        ) EnvironmentLight {
            const environment = shared.frame.environment;
            const share: f32 = @floatCast(weight);
            return if (environment.map == null)
                environment_lights.evenPieceOf(environment, number, count, share)
            else
                environment_lights.pieceOf(environment, number, count, share);
        }

        fn directOf(frame: *const Frame) []const world_file.Light {
            if (frame.emission.len == 0) return frame.lights;
            var count = frame.lights.len;
            while (count > 0 and frame.lights[count - 1].kind == .emitter) count -= 1;
            return frame.lights[0..count];
        }

        /// A light of the environment by itself.
        fn parallel(one: *const EnvironmentLight) world_file.Light {
            var light = one.source;
            for (&light.intensity, one.irradiance) |*to, channel| to.* = channel * std.math.pi;
            return light;
        }

        pub fn pieces(shared: *const Self, number: u32) u32 {
            if (number < steps_before) return shared.selection.pieces(number);
            return bandCount(shared.settings.layout.?);
        }

        pub fn work(shared: *Self, tree: *Tree, number: u32, piece: u32, film: *Film) u64 {
            if (number < steps_before) {
                shared.selection.work(tree, number, piece);
                return 0;
            }
            switch (@as(Step, @fromBackingInt(@intCast(number - steps_before)))) {
                .place => shared.place(piece),
                .filter => return shared.filter(piece, film),
            }
            return 0;
        }

        fn place(shared: *Self, band: u32) void {
            const part = bandOf(shared.settings.layout.?, band);
            shared.layers.placeAll(shared.frame.view, part.pixels);
        }

        fn filter(shared: *Self, band: u32, film: *Film) u64 {
            const part = bandOf(shared.settings.layout.?, band);
            const view = shared.frame.view;
            const correction = &shared.selection.matrix.correction;
            return shared.layers.finish(film, view, &part.window, part.pixels, correction);
        }
    };
}

/// How many pieces what is filtered is cut into: windows, or bands of rows where there is but one.
fn bandCount(layout: *const Layout) u32 {
    return switch (layout.form) {
        .window => @divCeil(layout.film_height, band_rows),
        .share => layout.count(),
    };
}

/// A piece, and the window that it is of.
const Band = struct { window: Rectangle, pixels: Rectangle };

fn bandOf(layout: *const Layout, number: u32) Band {
    const is_window = layout.form == .window;
    const window = layout.windowAt(if (is_window) 0 else number).traced;
    var band: Band = .{ .window = window, .pixels = window };
    if (is_window) {
        band.pixels.y0 += number * band_rows;
        band.pixels.y1 = @min(band.pixels.y0 + band_rows, band.pixels.y1);
    }
    return band;
}
