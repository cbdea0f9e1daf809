//! Interleaved sampling (Keller and Heidrich 2001): each pixel of any 3x3 has another ninth of a
//! sample's lights, and a filter gives each what its neighbours found (after Wald, Kollig, Benthin,
//! Keller and Slusallek 2002, "Interactive Global Illumination using Fast Ray Tracing").
//!
//! In: by pixel the sums over its samples of light that arrives, of what it is weighed by, and of
//! where it arrives. Out: that light on the film. What is filtered is a quotient, of light that
//! arrives and the albedo it is multiplied by, or of the sky's light that arrives and all of it:
//! both change slowly over a surface, and what changes quickly, the pixel's own albedo and the
//! smooth integral of the sky, is multiplied in afterwards. A pixel that has like neighbours in all
//! ninths thus has the light of all lights, without noise. Neighbours are like where they lie on
//! much the same plane; pixels that see several surfaces take what all of theirs have.

const std = @import("std");
const vec3 = @import("../../math.zig").vec3;
const film_file = @import("../../film.zig");
const world_file = @import("../../world.zig");
const Allocator = std.mem.Allocator;
const Correction = @import("light_correction.zig").Correction;
const Film = film_file.Film;
const Layout = film_file.Layout;
const Rectangle = film_file.Rectangle;
const Vec3 = [3]f32;

/// Pixels that share a sample's lights, along each side.
pub const side = 3;
/// How far away neighbours are that a pixel gets light of, along each side.
pub const reach = 2;
/// In all.
pub const part_count = side * side;
/// Parts that like neighbours have, at least, the pixel's own among them.
const like_least = 4;
/// Sets that samples take turns with, at most.
const set_count_max = 16;

/// Lights in sets, one a sample, which are cut in parts, one a pixel.
pub const Sets = struct {
    set_count: usize,
    /// Lights of a part.
    part_size: usize,
    sample_count: u32,
    /// Pixels have a part each; else all of a set.
    is_interleaved: bool,

    /// With at least so many lights in a set.
    pub fn init(light_count: u32, sample_count: u32, is_interleaved: bool) Sets {
        return .{
            .set_count = @min(sample_count, set_count_max),
            .part_size = @divCeil(light_count, part_count),
            .sample_count = sample_count,
            .is_interleaved = is_interleaved,
        };
    }

    /// In all sets.
    pub fn count(sets: *const Sets) usize {
        return sets.set_count * part_count * sets.part_size;
    }

    /// Where a light is in the order of sets and their parts: of lights in a row each is another
    /// part's, and of those of a part each another set's, so that those of a pixel are far apart.
    pub fn indexOf(sets: *const Sets, number: usize) usize {
        const part = number % part_count;
        const within = number / part_count / sets.set_count;
        return (sets.setOf(number) * part_count + part) * sets.part_size + within;
    }

    fn setOf(sets: *const Sets, number: usize) usize {
        return number / part_count % sets.set_count;
    }

    /// How much more a light counts where it is one of a pixel's, than one of all.
    pub fn weightOf(sets: *const Sets, number: usize) f64 {
        const set = sets.setOf(number);
        const uses = (sets.sample_count - set - 1) / sets.set_count + 1;
        const total: f64 = @floatFromInt(sets.sample_count);
        const among: f64 = if (sets.is_interleaved) part_count else 1;
        return among * total / @as(f64, @floatFromInt(uses));
    }

    /// Those of a sample of pixels in this part.
    pub fn of(
        sets: *const Sets,
        comptime T: type,
        all: []const T,
        sample: u32,
        part: usize,
    ) []const T {
        if (all.len == 0) return all;
        const first = sample % sets.set_count * part_count;
        if (!sets.is_interleaved)
            return all[first * sets.part_size ..][0 .. part_count * sets.part_size];
        return all[(first + part) * sets.part_size ..][0..sets.part_size];
    }
};

/// By pixel of the film the sums over its samples.
pub const Layers = struct {
    width: u32,
    is_interleaved: bool,
    /// Geometric normal of what is seen first, and how far away it is.
    guide: []Pixel,
    /// Light of virtual lights, and the albedo that it was multiplied by; fourth, how many samples
    /// there are.
    bounced: []Pixel,
    albedo: []Pixel,
    /// The sky's light that arrives by its lights and all of it by these; none without a map.
    arriving: []Pixel,
    shining: []Pixel,
    /// And by its integral.
    open: []Pixel,
    /// What `placeRow` makes of the guide: a unit normal, 0 where several surfaces are seen, and
    /// the distance in lengths of the camera's ray.
    place: []Pixel,

    /// Four floats, of which colours have three.
    pub const Pixel = @Vector(4, f32);
    /// Names of the layers.
    pub const Name = enum { guide, bounced, albedo, arriving, shining, open, place };

    /// To be freed by `deinit`.
    pub fn init(
        gpa: Allocator,
        layout: *const Layout,
        has_sky: bool,
        is_interleaved: bool,
    ) error{OutOfMemory}!Layers {
        var layers: Layers = .{
            .width = layout.film_width,
            .is_interleaved = is_interleaved,
            .guide = &.{},
            .bounced = &.{},
            .albedo = &.{},
            .arriving = &.{},
            .shining = &.{},
            .open = &.{},
            .place = &.{},
        };
        errdefer layers.deinit(gpa);
        const count = @as(usize, layout.film_width) * layout.film_height;
        inline for (@typeInfo(Name).@"enum".field_names) |name| {
            const is_sky = std.mem.eql(u8, name, "arriving") or
                std.mem.eql(u8, name, "shining") or std.mem.eql(u8, name, "open");
            if (has_sky or !is_sky) @field(layers, name) = try gpa.alloc(Pixel, count);
        }
        return layers;
    }

    /// Frees everything.
    pub fn deinit(layers: *Layers, gpa: Allocator) void {
        inline for (@typeInfo(Name).@"enum".field_names) |name| gpa.free(@field(layers, name));
    }

    /// Adds a sample to a pixel of a layer; number 0 begins it anew.
    pub inline fn add(layer: []Pixel, at: usize, number: u32, value: Pixel) void {
        layer[at] = if (number == 0) value else layer[at] + value;
    }

    /// Where a pixel of a rectangle is in the layers.
    pub inline fn indexOf(layers: *const Layers, part: *const Rectangle, x: u32, y: u32) usize {
        const column, const row = part.placeOf(x, y);
        return @as(usize, row) * layers.width + column;
    }

    /// Finds how what pixels see lies. Before `finish` of them and those within `reach`.
    pub fn placeAll(layers: *const Layers, view: *const world_file.View, part: Rectangle) void {
        for (part.y0..part.y1) |row| for (part.x0..part.x1) |column| {
            const x: u32, const y: u32 = .{ @intCast(column), @intCast(row) };
            const at = layers.indexOf(&part, x, y);
            const sums = layers.guide[at];
            const count = layers.albedo[at][3];
            const size = vec3.length(.{ sums[0], sums[1], sums[2] });
            const length = if (view.camera.orthographic)
                vec3.length(view.camera.forward)
            else
                vec3.length(wayOf(view, x, y));
            const scale = if (size > plain_min * count) 1 / size else 0;
            layers.place[at] = .{
                sums[0] * scale,
                sums[1] * scale,
                sums[2] * scale,
                sums[3] / count / length,
            };
        };
    }

    /// Adds what the layers have to finished pixels of a part of a window. Returns how many came
    /// out as not a number; these are black.
    pub fn finish(
        layers: *const Layers,
        film: *Film,
        view: *const world_file.View,
        window: *const Rectangle,
        part: Rectangle,
        correction: *const Correction,
    ) u64 {
        var non_finite_count: u64 = 0;
        for (part.y0..part.y1) |row| for (part.x0..part.x1) |column| {
            const x: u32, const y: u32 = .{ @intCast(column), @intCast(row) };
            const light = layers.lightOf(view, window, x, y, correction);
            const at = layers.indexOf(window, x, y);
            const pixel = &film.image.pixels[at];
            const count = layers.albedo[at][3];
            const added = light / @as(Pixel, @splat(count));
            const sum = added[0] + added[1] + added[2];
            if (!std.math.isFinite(sum)) {
                pixel.* = .{ 0, 0, 0, 1 };
                non_finite_count += 1;
                continue;
            }
            inline for (0..3) |channel| pixel[channel] += added[channel];
        };
        return non_finite_count;
    }

    /// What a pixel's samples have together of the light that is filtered.
    fn lightOf(
        layers: *const Layers,
        view: *const world_file.View,
        window: *const Rectangle,
        x: u32,
        y: u32,
        correction: *const Correction,
    ) Pixel {
        const at = layers.indexOf(window, x, y);
        const sums = if (layers.is_interleaved)
            layers.gather(view, window, x, y)
        else
            Sums.of(layers, at);
        var light = layers.albedo[at] * quotient(sums.bounced, sums.albedo, 0);
        light *= correction.of(&.of(layers, view, window, x, y), x, y);
        if (layers.open.len > 0)
            light += layers.open[at] * quotient(sums.arriving, sums.shining, 1);
        light[3] = 0;
        return light;
    }

    inline fn quotient(part: Pixel, whole: Pixel, unknown: f32) Pixel {
        const known = whole > @as(Pixel, @splat(1e-20));
        const one: Pixel = @splat(1);
        const otherwise: Pixel = @splat(unknown);
        return @select(f32, known, part / @select(f32, known, whole, one), otherwise);
    }

    const Sums = struct {
        bounced: Pixel,
        albedo: Pixel,
        arriving: Pixel,
        shining: Pixel,

        fn of(layers: *const Layers, at: usize) Sums {
            const has_sky = layers.open.len > 0;
            const nothing: Pixel = @splat(0);
            return .{
                .bounced = layers.bounced[at],
                .albedo = layers.albedo[at],
                .arriving = if (has_sky) layers.arriving[at] else nothing,
                .shining = if (has_sky) layers.shining[at] else nothing,
            };
        }

        fn add(sums: *Sums, other: *const Sums, weight: f32) void {
            const share: Pixel = @splat(weight);
            sums.bounced += other.bounced * share;
            sums.albedo += other.albedo * share;
            sums.arriving += other.arriving * share;
            sums.shining += other.shining * share;
        }

        const none: Sums = .{
            .bounced = @splat(0),
            .albedo = @splat(0),
            .arriving = @splat(0),
            .shining = @splat(0),
        };
    };

    /// What a pixel and its neighbours have of all parts.
    fn gather(
        layers: *const Layers,
        view: *const world_file.View,
        window: *const Rectangle,
        x: u32,
        y: u32,
    ) Sums {
        const own = layers.place[layers.indexOf(window, x, y)];
        const is_plain = own[0] != 0 or own[1] != 0 or own[2] != 0;
        var sums: Sums = .none;
        // Too few are like it: better light of what is around than noise.
        if (!is_plain or layers.gatherLike(view, window, x, y, true, &sums) < like_least) {
            sums = .none;
            _ = layers.gatherLike(view, window, x, y, false, &sums);
        }
        return sums;
    }

    /// Adds what each part has, between those of its pixels that are near: by a tent as wide as
    /// they are apart, so that all of a part weigh 1 together. Returns how many parts are found.
    fn gatherLike(
        layers: *const Layers,
        view: *const world_file.View,
        window: *const Rectangle,
        x: u32,
        y: u32,
        by_place: bool,
        sums: *Sums,
    ) u32 {
        const tent = [2 * reach + 1]f32{ 1.0 / 3.0, 2.0 / 3.0, 1, 2.0 / 3.0, 1.0 / 3.0 };
        const place: Place = .of(layers, view, window, x, y);
        var parts: [part_count]Sums = @splat(.none);
        var weights: [part_count]f32 = @splat(0);
        for (tent, 0..) |by_row, row_step| for (tent, 0..) |by_column, column_step| {
            const row = @as(usize, y) + row_step;
            const column = @as(usize, x) + column_step;
            if (row < window.y0 + reach or column < window.x0 + reach) continue;
            const other_x: u32 = @intCast(column - reach);
            const other_y: u32 = @intCast(row - reach);
            if (other_x >= window.x1 or other_y >= window.y1) continue;
            const is_own = other_x == x and other_y == y;
            if (by_place and !is_own) {
                if (!place.isLike(&.of(layers, view, window, other_x, other_y))) continue;
            }
            const part = partOf(other_x, other_y);
            const weight = by_row * by_column;
            parts[part].add(&.of(layers, layers.indexOf(window, other_x, other_y)), weight);
            weights[part] += weight;
        };
        var found: u32 = 0;
        for (&parts, weights) |*part, weight| {
            if (weight == 0) continue;
            sums.add(part, 1 / weight);
            found += 1;
        }
        return found;
    }
};

/// The part of a pixel.
pub fn partOf(x: u32, y: u32) usize {
    return y % side * side + x % side;
}

/// Length of the mean normal, at least, where a pixel's samples see much the same.
const plain_min = 0.97;
/// Cosine between normals that are like.
const cosine_min = 0.9;
/// How far off the plane a neighbour may be, in distances between pixels.
pub const off_max = 2.5;

/// From the middle of the picture to a pixel, where the camera's forward ends.
inline fn sidewaysOf(view: *const world_file.View, x: u32, y: u32) Vec3 {
    const columns: f32 = @floatFromInt(view.width);
    const rows: f32 = @floatFromInt(view.height);
    const across = (2 * @as(f32, @floatFromInt(x)) + 1) / columns - 1;
    const upward = 1 - (2 * @as(f32, @floatFromInt(y)) + 1) / rows;
    return vec3.add(vec3.scale(view.camera.right, across), vec3.scale(view.camera.up, upward));
}

inline fn wayOf(view: *const world_file.View, x: u32, y: u32) Vec3 {
    return vec3.add(view.camera.forward, sidewaysOf(view, x, y));
}

/// Where a pixel's samples see something.
pub const Place = struct {
    /// From the camera's origin.
    position: Vec3,
    /// See `Layers.place`.
    normal: Vec3,
    /// How far off a neighbour may be.
    off: f32,

    inline fn of(
        layers: *const Layers,
        view: *const world_file.View,
        window: *const Rectangle,
        x: u32,
        y: u32,
    ) Place {
        const place = layers.place[layers.indexOf(window, x, y)];
        const camera = &view.camera;
        const distance = place[3];
        const width = 2 * off_max / @as(f32, @floatFromInt(view.width));
        const across = width * vec3.length(camera.right);
        const sideways = sidewaysOf(view, x, y);
        return .{
            .position = if (camera.orthographic)
                vec3.add(sideways, vec3.scale(camera.forward, distance))
            else
                vec3.scale(vec3.add(camera.forward, sideways), distance),
            .normal = .{ place[0], place[1], place[2] },
            .off = if (camera.orthographic) across else across * distance,
        };
    }

    inline fn isLike(place: *const Place, other: *const Place) bool {
        if (!(vec3.dot(place.normal, other.normal) > cosine_min)) return false;
        const off = vec3.dot(place.normal, vec3.sub(other.position, place.position));
        return @abs(off) < place.off;
    }
};

test "every light is in one part of one set, and counts for all samples together as one" {
    const cases = [_]struct { u32, u32, bool }{
        .{ 96, 4, true }, .{ 32, 1, true }, .{ 1, 3, true }, .{ 20, 37, true }, .{ 20, 5, false },
    };
    for (cases) |case| {
        const sets: Sets = .init(case[0], case[1], case[2]);
        var numbers: [2000]usize = undefined;
        const all = numbers[0..sets.count()];
        for (0..all.len) |number| all[sets.indexOf(number)] = number;
        var weights: [2000]f64 = @splat(0);
        for (0..case[1]) |sample| for (0..part_count) |part| {
            for (sets.of(usize, all, @intCast(sample), part)) |number|
                weights[number] += sets.weightOf(number);
        };
        for (weights[0..all.len]) |weight| {
            const samples: f64 = @floatFromInt(case[1] * part_count);
            try std.testing.expectApproxEqRel(samples, weight, 1e-9);
        }
    }
}

test "like neighbours share light, so that each pixel of a plane has that of all parts" {
    const gpa = std.testing.allocator;
    var view: world_file.View = .nowhere;
    view.width = 12;
    view.height = 9;
    const layout: Layout = .whole(view.width, view.height);
    const window = layout.windowAt(0).traced;
    var layers: Layers = try .init(gpa, &layout, true, true);
    defer layers.deinit(gpa);
    var film: Film = try .init(gpa, view.width, view.height, .init(.{ .color = true }));
    defer film.deinit(gpa);
    // A wall on the left, a floor on the right; each part finds other light, of different albedos.
    for (0..view.height) |y| for (0..view.width) |x| {
        const at = y * view.width + x;
        const is_left = x < 6;
        const normal: Vec3 = if (is_left) .{ 0, 0, 1 } else .{ 0, 1, 0 };
        const share: f32 = @floatFromInt(partOf(@intCast(x), @intCast(y)));
        const albedo: f32 = @floatFromInt(1 + (x + y) % 4);
        const light: f32 = if (is_left) share else 100 + share;
        const open: f32 = if (is_left) 2 else 8;
        Layers.add(layers.guide, at, 0, .{ normal[0], normal[1], normal[2], 2 });
        Layers.add(layers.bounced, at, 0, @splat(light * albedo));
        Layers.add(layers.albedo, at, 0, .{ albedo, albedo, albedo, 1 });
        Layers.add(layers.arriving, at, 0, @splat(albedo * share));
        Layers.add(layers.shining, at, 0, @splat(albedo * 8));
        Layers.add(layers.open, at, 0, @splat(open));
        film.add(@intCast(x), @intCast(y), 0, .{ 1, 1, 1, 0 });
    };
    layers.placeAll(&view, window);
    try std.testing.expectEqual(0, layers.finish(&film, &view, &window, window, &.none));
    for (0..view.height) |y| for (0..view.width) |x| {
        const found = film.image.at(@intCast(x), @intCast(y)).*[0];
        const albedo: f32 = @floatFromInt(1 + (x + y) % 4);
        const light: f32 = if (x < 6) 4 else 104;
        const open: f32 = if (x < 6) 2 else 8;
        // Parts whose pixels are darker count less in a quotient of sums.
        const expected = 1 + light * albedo + open * 0.5;
        try std.testing.expectApproxEqAbs(expected, found, 1.5 * albedo + 0.2 * open);
        // No light crosses the edge.
        if (x < 6) try std.testing.expect(found < 1 + 8 * albedo + open);
    };
}
