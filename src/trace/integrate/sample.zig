//! The sample under way of a bundle's pixels: sums of what their primary rays see.
//!
//! In: light, already weighed by the throughput of its path. Out: the sums on the film. Colours of
//! the display, which unlit surfaces that are seen directly have, and what guides denoisers, are
//! kept apart where the film has layers for them.

const film_file = @import("../../film.zig");
const camera = @import("camera.zig");
const features_file = @import("features.zig");
const path_file = @import("path.zig");
const Film = film_file.Film;
const Rectangle = film_file.Rectangle;

/// The sample of one bundle.
pub fn Sample(comptime Kernel: type) type {
    const Rays = Kernel.Rays;
    const F32 = Rays.F32;
    const Vec3 = Rays.Vec3;
    const group_count = Kernel.group_count;
    const none: Vec3 = .splat(.{ 0, 0, 0 });
    return struct {
        number: u32,
        radiance: [group_count]Vec3,
        /// Share of the primary ray that left the scene.
        escaped: [group_count]F32,
        /// The background is left clear.
        transparent: bool,
        /// Colours of the display are kept apart from radiance.
        keeps_display: bool,
        /// What the primary ray sees of such colours, and its share of them.
        displayed: [group_count]Vec3,
        display_share: [group_count]F32,
        /// For layers of what is seen.
        features: features_file.Features(Kernel),

        const Self = @This();

        /// Nothing seen yet.
        pub fn start(sample: *Self, number: u32, layers: film_file.Layers) void {
            sample.number = number;
            sample.transparent = layers.contains(.alpha);
            sample.keeps_display = layers.contains(.display);
            sample.radiance = @splat(none);
            sample.escaped = @splat(.zero());
            sample.features.start(layers);
            if (!sample.keeps_display) return;
            sample.displayed = @splat(none);
            sample.display_share = @splat(.zero());
        }

        /// Adds radiance.
        pub inline fn add(sample: *Self, group: usize, radiance: Vec3) void {
            sample.radiance[group] = sample.radiance[group].add(radiance);
        }

        /// Adds what primary rays that left the scene see in front of `background`.
        pub fn addEscaped(
            sample: *Self,
            group: usize,
            throughput: Vec3,
            background: [3]f32,
        ) void {
            sample.escaped[group] = sample.escaped[group].add(throughput.x);
            const seen: [3]f32 = if (sample.transparent) .{ 0, 0, 0 } else background;
            sample.add(group, throughput.mul(.splat(seen)));
        }

        /// Adds what surfaces show by themselves: their colour where they are unlit, else `glow`.
        pub fn addSurface(
            sample: *Self,
            group: usize,
            vertex: *const path_file.Vertex(Rays),
            glow: Vec3,
            depth: u32,
        ) void {
            const material = &vertex.point.material;
            const shown: Vec3 = .select(material.unlit, material.base_color, glow);
            const arriving = vertex.throughput.mul(shown);
            if (!sample.keeps_display or depth > 0) return sample.add(group, arriving);
            sample.add(group, .select(material.unlit, none, arriving));
            const color: Vec3 = .select(material.unlit, arriving, none);
            const share: F32 = .select(material.unlit, vertex.throughput.x, .zero());
            sample.displayed[group] = sample.displayed[group].add(color);
            sample.display_share[group] = sample.display_share[group].add(share);
        }

        /// Adds the sums to the film.
        pub fn expose(sample: *const Self, film: *Film, rectangle: Rectangle) void {
            const place: camera.Place = .{ .rectangle = rectangle, .sample = sample.number };
            camera.expose(Kernel, film, .color, place, &sample.radiance, &sample.escaped);
            if (sample.features.kept) sample.features.expose(film, place);
            if (!sample.keeps_display) return;
            const share = &sample.display_share;
            camera.expose(Kernel, film, .display, place, &sample.displayed, share);
        }
    };
}
