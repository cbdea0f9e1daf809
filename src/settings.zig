//! What a user may choose: values, limits and defaults, each once.
//!
//! A leaf. The command line fills these structs, as any other way to ask for a picture would; the
//! session hands them to the stages; help, messages and checks take their numbers from here.

const std = @import("std");
const Identity = @import("identity.zig").Identity;
const progress = @import("progress.zig");

/// Whole numbers to choose from.
pub const Range = struct {
    min: u32,
    max: u32,
    /// Where neither the user nor the scene says.
    default: u32 = 0,

    /// Whether the number is one of them.
    pub fn holds(range: Range, number: anytype) bool {
        return number >= range.min and number <= range.max;
    }

    /// `1 to 256`, for help and messages.
    pub fn text(comptime range: Range) []const u8 {
        return std.fmt.comptimePrint("{d} to {d}", .{ range.min, range.max });
    }

    /// `1 to 256 (default: 3)`.
    pub fn textWithDefault(comptime range: Range) []const u8 {
        return std.fmt.comptimePrint("{s} (default: {d})", .{ range.text(), range.default });
    }
};

/// Whether the process keeps itself from what it does not need: where the system can, or it is an
/// error where the system cannot, or not at all.
pub const Sandbox = enum { auto, on, off };

/// Longest line of a job, in bytes.
pub const job_bytes_max = 1 << 20;
/// Pixels on the side of one that a size is given in.
pub const pixel_ratio: Range = .{ .min = 1, .max = 8, .default = 1 };
/// Threads; by default as many as there are processors.
pub const thread_count: Range = .{ .min = 1, .max = 256 };
/// Samples a pixel; in small pictures each pixel has more to show.
pub const sample_count: Range = .{ .min = 1, .max = 4096, .default = 4 };
/// See `samplesFor`.
pub const sample_count_small = 8;
/// Samples of pixels that stay noisy, unless the user says.
pub const noise_sample_count = 1024;
/// See `Noise`.
pub const noise_error: struct { min: f32, max: f32 } = .{ .min = 0.0001, .max = 1 };
/// Seconds that tracing may take.
pub const time_budget_s: struct { min: f32, max: f32 } = .{ .min = 0.01, .max = 1_000_000 };
/// Of path tracing, whose samples are single paths.
pub const sample_count_path = 64;
/// Pictures whose long side has fewer pixels are small.
pub const side_small = 512;
/// Bounces after the primary ray: reflections and refractions in a row.
pub const depth: Range = .{ .min = 0, .max = 32, .default = 6 };
/// The same of path tracing, where light that surfaces scatter bounces, too.
pub const depth_path = 16;
/// Straight pieces that a full circle becomes.
pub const tessellation: Range = .{ .min = 4, .max = 1024, .default = 32 };
/// Longest side of a texture, in texels; larger images are halved until they fit.
pub const texture_side: Range = .{ .min = 1, .max = 32_768, .default = 32_768 };
/// Sides of tiles, in pixels: multiples of `tile_size_step`.
pub const tile_size: Range = .{ .min = 4, .max = 512, .default = 32 };
pub const tile_size_step = 4;
/// Sides of pictures, in pixels; by default the longer one has so many, unless the scene says.
pub const side: Range = .{ .min = 1, .max = 65_536, .default = 1024 };
/// Pixels of a picture.
pub const pixel_count_max = 1 << 28;
/// The same where a scene asks for them, unless the user allows another number.
pub const scene_pixel_count_max = 1 << 26;
/// Samples of all pixels together that a scene may ask for; `--spp` asks for any number.
pub const scene_sample_count_max = 1 << 33;
/// Triangles that a scene may place, each instance counted, unless the user allows another number:
/// so many, or one for each byte that is read, whichever is more.
pub const triangle_count_max = 1 << 25;
/// Pixels of all images of a scene before they are halved, unless the user allows another number.
pub const texture_pixel_count_max = 1 << 30;
/// Seconds that a scene may take.
pub const time_max_s: struct { min: f32, max: f32 } = .{ .min = 0.01, .max = 1_000_000 };
/// Share of these after which what does not look at the time is ended with the program.
pub const time_grace = 0.05;
/// The longer side where it alone is given: a square one has as many pixels as there may be.
pub const long_side: Range = .{ .min = 1, .max = 1 << 14, .default = side.default };
/// Parts of a picture that are tiles.
pub const part_count: Range = .{ .min = 1, .max = 1 << 16 };
/// Quality of a WebP that loses information.
pub const webp_quality: Range = .{ .min = 1, .max = 100 };
/// Frames of a film, and pictures that are numbered.
pub const frame_count_max = 1_000_000;
/// Files that are rendered side by side.
pub const job_count: Range = .{ .min = 1, .max = 64 };
/// Views around a scene.
pub const view_count: Range = .{ .min = 1, .max = 36_000 };
/// Quality of a JPEG.
pub const jpeg_quality: Range = .{ .min = 1, .max = 100, .default = 90 };
/// Largest exposure either way, in stops.
pub const exposure_ev_max = 64;
/// Directional lights a sample that stand for an environment, to find how much of it arrives.
pub const environment_shadow_count: Range = .{ .min = 0, .max = 64, .default = 4 };
/// And where they are all the light there is.
pub const occlusion_shadow_count = 16;
/// And where a floor catches their shadows, unless the user says.
pub const floor_shadow_count = 16;
/// Punctual lights that a point is lit by one after the other; of more, so many stand for all.
pub const punctual_light_count_max = 1024;
/// See `Lights`.
pub const virtual_light_count: Range = .{ .min = 0, .max = 1024, .default = 96 };
/// See `Lights`.
pub const sky_light_count: Range = .{ .min = 1, .max = 1024, .default = 32 };
/// What automatic exposure chooses lies between these: far enough down for surfaces in the sun, of
/// 100,000 lx, and for lamps close by, but not so far up that what is all but black is enlarged.
pub const exposure_auto_ev_min = -24;
pub const exposure_auto_ev_max = 10;
/// Measures of how far two pictures are from each other.
pub const Metric = enum { max, rmse, psnr, ssim, flip };
/// Radiance from everywhere in scenes without lights.
pub const ambient_default: f32 = 0.35;

/// Names of scenes that need no file begin with this.
pub const builtin_prefix = "builtin:";

/// File formats of images, by their extensions.
pub const Format = enum {
    png,
    jpg,
    tga,
    bmp,
    /// Radiance RGBE: linear, 8 bits and a common exponent.
    hdr,
    /// Netpbm's binary format: RGB of 8 bits.
    ppm,
    /// Its relative for floats, linear: the picture itself, bit for bit, without alpha.
    pfm,
    /// Lossless, unless a quality is asked for.
    webp,
    /// OpenEXR: linear, halves or floats, with alpha where the background is transparent.
    exr,
    /// YUV4MPEG2: frames of a film, one after the other.
    y4m,
};

/// What colours are in an OpenEXR file.
pub const ExrKind = enum { half, float };

/// What is known of pixels besides their colours, for other programs: channels of an OpenEXR file,
/// or files of their own.
pub const Layer = enum {
    /// Distance from the camera's plane in metres.
    depth,
    /// Unit normal in the world's axes.
    normal,
    /// Share of white light that what is seen sends to the camera.
    albedo,
    /// Texture coordinates of the first set.
    uv,
    /// Numbers that the file gives to the node, to the material, and to the primitive of the mesh.
    node,
    material,
    primitive,
    /// Share of the pixel that surfaces cover.
    alpha,
    /// Place in the world's axes in metres.
    position,
    /// Tests of rays with boxes and triangles.
    cost,
    /// Variance of the mean of the pixel's samples, before it is denoised.
    variance,
};

/// Quick looks, in place of what light makes of a scene.
pub const Shade = enum {
    /// Ambient occlusion: light from everywhere on white clay.
    ao,
    /// Unit normals in the world's axes as colours.
    normal,
    /// Texture coordinates as colours.
    uv,
    /// Tests of rays with boxes and triangles as a heat map.
    cost,
};

/// Care taken over the tree of the scene: time to build it against time to trace rays through it.
/// The picture is the same in any case.
pub const TreeQuality = enum {
    /// Cut between the cells of a grid as long as there are several, then along the longest axis.
    fast,
    /// Cut at the best of the planes along all three axes.
    default,
    /// That, and then each subtree moved to where it costs the least.
    high,
};

/// What becomes of instances of one mesh: memory against time to trace. The picture is the same in
/// any case.
pub const Instances = enum {
    /// Shared where that saves much memory.
    auto,
    /// Shared wherever they can be.
    share,
    /// Each with triangles of its own.
    flatten,
};

/// Which camera to look through.
pub const Camera = union(enum) {
    /// The file's own, else automatic.
    default,
    /// All of the scene in view.
    auto,
    index: u32,
    name: []const u8,
};

/// Whole vertical angle of view, in degrees.
pub const fov_degrees: struct { min: f32, max: f32 } = .{ .min = 0.01, .max = 179 };

/// Where a camera stands about its target (as model-viewer's `camera-orbit`):
/// eye = target + radius (sin phi sin theta, cos phi, sin phi cos theta).
pub const Orbit = struct {
    /// To the right of +z; finite.
    theta_degrees: f32,
    /// From straight above: 0 to 180.
    phi_degrees: f32,
    radius: Radius = .default,

    /// Above 0.
    pub const Radius = union(enum) {
        metres: f32,
        /// Of the distance that shows all of the model.
        share: f32,

        pub const default: Radius = .{ .share = 1 };
    };
};

/// Where a turntable begins: as the automatic view does of what has no better front.
pub const orbit_turntable: Orbit = .{ .theta_degrees = 30, .phi_degrees = 70 };

/// A camera of the user's own; what is null follows from a framing of the scene. Numbers are
/// finite; not both `eye` and `orbit`; `orthographic` without `fov_degrees`.
pub const Viewpoint = struct {
    eye: ?[3]f32 = null,
    target: ?[3]f32 = null,
    /// What is upwards in the picture, not zero; null: y.
    up: ?[3]f32 = null,
    orbit: ?Orbit = null,
    /// Within `fov_degrees`; by itself, it changes the camera that is there.
    fov_degrees: ?f32 = null,
    orthographic: bool = false,

    /// Whether it stands in place of the file's camera.
    pub fn replacesCamera(viewpoint: *const Viewpoint) bool {
        return viewpoint.eye != null or viewpoint.target != null or viewpoint.up != null or
            viewpoint.orbit != null or viewpoint.orthographic;
    }
};

/// Diameter of points and width of lines, in pixels at the distance from which the automatic view
/// looks at the middle of the scene.
pub const point_size: struct { min: f32, max: f32, default: f32 } =
    .{ .min = 0.1, .max = 100, .default = 1.5 };

/// Which of the things to take that a file counts and may name.
pub const Choice = union(enum) {
    /// What the file itself shows.
    default,
    index: u32,
    name: []const u8,
};

/// What of a scene moves, and when it is seen.
pub const Animation = struct {
    which: Which = .default,
    /// Since the start of all animations, finite. Before the first key and after the last all
    /// stands still.
    time_s: f32 = 0,

    pub const Which = union(enum) {
        /// None: the scene at rest, unless something of it is not meant to be seen like that.
        default,
        all,
        index: u32,
        name: []const u8,
    };
};

/// The axis of a scene that points up.
pub const UpAxis = enum { y, z };

/// File formats of scenes, by their extensions.
pub const SceneFormat = enum { gltf, glb, pbrt, obj, stl, ply };

/// Name of a scene that comes from standard input.
pub const standard_input = "-";

/// What is seen where there is nothing.
pub const Background = union(enum) {
    /// The scene's own, else a quiet gradient.
    default,
    /// What lights the scene from all around.
    env,
    /// The studio, whatever lights the scene.
    studio,
    transparent,
    /// Codes of red, green and blue, as they are to be in the picture.
    srgb: [3]u8,
    /// Radiance of red, green and blue, finite and >= 0.
    linear: [3]f32,
};

/// What the scene stands on.
pub const Floor = enum {
    none,
    /// A plane below all that there is, of which nothing is seen but the shadow on it.
    shadow,
};

/// Light from all around.
pub const Environment = struct {
    source: Source = .default,
    /// Multiplies its radiance, finite and >= 0.
    intensity: f32 = 1,
    /// Turn about y in degrees, counter-clockwise from above; null: none, but the studio turns with
    /// the camera.
    rotation_deg: ?f32 = null,
    /// Within `environment_shadow_count`; null: its default, or with a floor, on which each light's
    /// shadow can be seen, `floor_shadow_count`.
    shadow_count: ?u32 = null,

    pub const Source = union(enum) {
        /// The scene's, or the studio: dimmed where the scene has lights of its own.
        default,
        none,
        studio,
        /// As much from everywhere, for quick looks.
        white,
        /// An image by its name.
        file: []const u8,
    };
};

/// How radiance becomes brightness.
pub const Exposure = union(enum) {
    /// Automatic where the scene has lights of its own, else 0.
    default,
    /// Stops: radiance 2^-ev is white before tone mapping. |ev| <= `exposure_ev_max`.
    ev: f32,
    /// By what the view shows, between `exposure_auto_ev_min` and `exposure_auto_ev_max`.
    auto,
};

/// How exposed radiance becomes what a display can show.
pub const ToneMapping = enum {
    /// Khronos PBR Neutral.
    neutral,
    /// A fit of ACES's reference rendering and output transforms.
    aces,
    /// A fit of AgX.
    agx,
    /// Cut off at 1.
    linear,
};

/// The settings of the thesis, which `--thesis` and the benchmark begin with.
pub const thesis: struct {
    resolution: [2]u32,
    sample_count: u32,
    depth: u32,
    exposure: Exposure,
    tone_mapping: ToneMapping,
} = .{
    .resolution = .{ 1024, 1024 },
    .sample_count = 1,
    .depth = 3,
    .exposure = .{ .ev = 0 },
    .tone_mapping = .linear,
};

/// Samples a pixel of a picture, where nobody says how many.
pub fn samplesFor(integrator: Integrator, width: u32, height: u32) u32 {
    if (integrator == .path) return sample_count_path;
    return if (@max(width, height) < side_small) sample_count_small else sample_count.default;
}

/// Bounces at most, where nobody says how many.
pub fn depthFor(integrator: Integrator) u32 {
    return if (integrator == .path) depth_path else depth.default;
}

/// How a scene is read.
pub const Load = struct {
    /// Whether a scene may name files outside of its own folder.
    allow_outside: bool = false,
    /// Whether what is wrong with a file, but can be read all the same, is an error.
    strict: bool = false,
    /// Whether a file is drawn that requires extensions which are not known.
    force: bool = false,
    /// Within `tessellation`.
    tessellation: u32 = tessellation.default,
    /// Within `texture_side`.
    texture_side_max: u32 = texture_side.default,
    /// Pixels of all images together.
    texture_pixel_count_max: u64 = texture_pixel_count_max,
    /// Triangles that are placed, each instance counted; null: see `triangleCountMax`.
    triangle_count_max: ?u64 = null,
    scene: Choice = .default,
    material_variant: Choice = .default,
    /// Null: what the file's contents and its name tell.
    format: ?SceneFormat = null,
    /// Where it is not y, the scene is turned about x until it is; null: as the format has it.
    up_axis: ?UpAxis = null,
    /// A file that is about to be replaced: a scene that is read from it is refused.
    output: ?Identity = null,
    /// Told how far reading has come; null: nobody is.
    progress: ?*progress.Progress = null,

    /// For a scene of so many bytes: large files may have many triangles, small ones not.
    pub fn triangleCountMax(load: *const Load, byte_count: u64) u64 {
        return load.triangle_count_max orelse @max(triangle_count_max, byte_count);
    }
};

/// How the work under way is shown.
pub const ProgressForm = enum { auto, json, none };

/// And where.
pub const Progress = struct {
    form: ProgressForm = .auto,
    /// Of JSON, an open descriptor; null: standard error.
    file: ?u32 = null,
};
/// Descriptors for it.
pub const progress_file: Range = .{ .min = 1, .max = 1 << 16 };

/// What is seen of a scene, and by what light.
pub const View = struct {
    camera: Camera = .default,
    /// Asserted to be empty but for `fov_degrees` with a camera by index or name.
    viewpoint: Viewpoint = .{},
    /// What is framed is all that the animations that run show at any time.
    frames_all: bool = false,
    /// Width and height in pixels; null: the scene's, or its camera's aspect.
    resolution: ?[2]u32 = null,
    /// Within `long_side`, where there is no `resolution`; null: the scene's, or the default.
    long_side: ?u32 = null,
    /// Of the picture; null: `pixel_count_max`, and `scene_pixel_count_max` where the scene says
    /// its size.
    pixel_count_max: ?u64 = null,
    /// Radiance from everywhere, finite and >= 0; null: as the lights have it.
    ambient: ?f32 = null,
    environment: Environment = .{},
    floor: Floor = .none,
    /// Surfaces that emit light what is around them, as far as it shows; without it only where the
    /// file calls them lights.
    emitters: bool = true,
    background: Background = .default,
    /// Colours of unlit surfaces and of the background are the display's, neither exposed nor tone
    /// mapped; without it, as in the thesis, they are radiance, and the background's default comes
    /// with the lights.
    display_referred: bool = true,
    /// Within `point_size`.
    point_size: f32 = point_size.default,
    /// Null: what light makes of it. Asserts that the integrator is Whitted's.
    shade: ?Shade = null,

    /// Directional lights a sample that stand for the environment.
    pub fn shadowCount(view: *const View) u32 {
        if (view.environment.shadow_count) |count| return count;
        if (view.shade == .ao) return occlusion_shadow_count;
        return if (view.floor == .shadow) floor_shadow_count else environment_shadow_count.default;
    }
};

/// How light finds its way from where it starts to the eye.
pub const Integrator = enum {
    /// Whitted's ray tracing (1980): light that comes straight, mirrors and glass; the rest is
    /// smooth light from all around, less what is in its way.
    whitted,
    /// Instant radiosity (Keller 1997): light that has bounced, too, as of many points.
    lights,
    /// Path tracing (Kajiya 1986): all light, with noise that ends as samples grow.
    path,

    /// Whether a sample is the same whatever the number of them, so that more can be added to a
    /// picture.
    pub fn isOpen(integrator: Integrator) bool {
        return integrator == .path;
    }
};

/// How much noise may be left in a block of pixels, for it to get no more samples.
pub const Noise = struct {
    /// Standard error of pixels, of the square root of radiance that is exposed, 1 being white;
    /// within `noise_error`.
    error_max: f32,
    /// What is chosen for the picture.
    exposure: Exposure = .default,
};

/// Lights of `Integrator.lights` in each sample; samples take turns with sets of them.
pub const Lights = struct {
    /// Virtual point lights, within `virtual_light_count`.
    virtual_count: u32 = virtual_light_count.default,
    /// Directional lights that stand for the environment, within `sky_light_count`.
    sky_count: u32 = sky_light_count.default,
    /// Each pixel of any 3x3 has another ninth of them, and a filter evens that out; else each has
    /// all.
    is_interleaved: bool = true,
};

/// Which pixels of a picture are rendered: they are the same as in all of it.
pub const Part = union(enum) {
    whole,
    crop: Crop,
    tile: Tile,

    /// A rectangle: left, upper, right and lower edge.
    pub const Crop = union(enum) {
        /// The first of each, and the end behind the last.
        pixels: [4]u32,
        /// Of the picture's sides, 0 to 1.
        shares: [4]f32,

        /// In pixels of a picture of that size; a share's is the nearest, so that crops that touch
        /// leave none out.
        pub fn pixelsOf(crop: Crop, width: u32, height: u32) [4]u32 {
            const shares = switch (crop) {
                .pixels => |pixels| return pixels,
                .shares => |shares| shares,
            };
            var pixels: [4]u32 = undefined;
            for (&pixels, shares, [_]u32{ width, height, width, height }) |*pixel, share, length| {
                pixel.* = @round(@as(f64, share) * @as(f64, @floatFromInt(length)));
            }
            return pixels;
        }
    };

    /// One of `count` shares of tiles that are spread all over the picture, from 1 on.
    pub const Tile = struct { number: u32, count: u32 };

    /// `crop 0,0,4,3` or `tile 1/2`.
    pub fn format(part: Part, writer: *std.Io.Writer) std.Io.Writer.Error!void {
        switch (part) {
            .whole => try writer.writeAll("whole"),
            .crop => |crop| switch (crop) {
                inline else => |edges| try writer.print("crop {d},{d},{d},{d}", .{
                    edges[0], edges[1], edges[2], edges[3],
                }),
            },
            .tile => |tile| try writer.print("tile {d}/{d}", .{ tile.number, tile.count }),
        }
    }
};

/// How rays are traced.
pub const Render = struct {
    part: Part = .whole,
    /// It is to be merged with the others: what needs all of the picture is left to that. Of tiles
    /// always.
    is_merged: bool = false,
    integrator: Integrator = .whitted,
    lights: Lights = .{},
    /// Index into `variant.compiled`.
    variant: usize = 0,
    /// With `noise` or `time_budget_s`, the most. Null: the scene's, or by `samplesFor`; with
    /// these `noise_sample_count`, or as many as there may be.
    sample_count: ?u32 = null,
    /// Null: all pixels have as many samples. For integrators that are open.
    noise: ?Noise = null,
    /// Seconds to trace for, within `time_budget_s`; null: however long it takes.
    time_budget_s: ?f32 = null,
    /// Null: the scene's, or by `depthFor`.
    depth: ?u32 = null,
    tile_size: u32 = tile_size.default,
    /// Filter the noise out, where there are two samples a pixel at least.
    denoise: bool = false,
    /// Kept beside the picture.
    layers: std.EnumSet(Layer) = .empty,
};

/// Frames of a film a second, as a fraction of numbers of 1 or more.
pub const FrameRate = struct {
    numerator: u32 = 24,
    denominator: u32 = 1,

    /// When a frame is seen, in seconds.
    pub fn timeOf(rate: FrameRate, frame: i32) f32 {
        const numerator: f64 = @floatFromInt(rate.numerator);
        const denominator: f64 = @floatFromInt(rate.denominator);
        return @floatCast(@as(f64, @floatFromInt(frame)) * denominator / numerator);
    }
};

/// How a picture is encoded.
pub const Write = struct {
    format: Format = .png,
    /// Of a format that holds a film.
    frame_rate: FrameRate = .{},
    /// The film has frames already.
    is_continued: bool = false,
    exposure: Exposure = .default,
    tone_mapping: ToneMapping = .neutral,
    /// Within `jpeg_quality`.
    jpeg_quality: u32 = jpeg_quality.default,
    /// Within `webp_quality`; null: without loss.
    webp_quality: ?u32 = null,
    exr_kind: ExrKind = .half,
    /// Layers are in files of their own.
    layers_apart: bool = false,
};

test FrameRate {
    const film: FrameRate = .{ .numerator = 24_000, .denominator = 1001 };
    try std.testing.expectEqual(1.001, film.timeOf(24));
    try std.testing.expectEqual(-0.5, (FrameRate{}).timeOf(-12));
}

test "files may have as many triangles as bytes, and small ones many" {
    const load: Load = .{};
    try std.testing.expectEqual(triangle_count_max, load.triangleCountMax(100));
    try std.testing.expectEqual(1 << 30, load.triangleCountMax(1 << 30));
    const asked: Load = .{ .triangle_count_max = 7 };
    try std.testing.expectEqual(7, asked.triangleCountMax(1 << 30));
}

test Range {
    try std.testing.expect(depth.holds(0) and depth.holds(32) and !depth.holds(33));
    try std.testing.expectEqualStrings("1 to 256", comptime thread_count.text());
}
