//! The library's face: one scene on its way to pictures, stage by stage.
//!
//! In: what the user may choose (`settings`). `load` reads a scene, `pose` places what is in it,
//! `view` chooses camera, size and light, `render` traces, `write` encodes. Each may be called
//! again and keeps what the ones before it made: another view needs no reading, another picture of
//! the same view no tree. The session owns the threads, the scene and what is made of it; nothing
//! is global.

const std = @import("std");
const builtin_scenes = @import("builtin.zig");
const denoise = @import("denoise.zig");
const math = @import("math.zig");
const output = @import("output.zig");
const parallel = @import("parallel.zig");
const parse = @import("parse.zig");
const prepare = @import("prepare.zig");
const settings = @import("settings.zig");
const srgb = math.srgb;
const statistics = @import("statistics.zig");
const trace = @import("trace.zig");
const variant = @import("variant.zig");
const Clay = @import("session/clay.zig");
const Environment = @import("session/environment.zig").Environment;
const Manifest = @import("manifest.zig").Manifest;
const hit_layers = @import("session/hit_layers.zig");
const emission = @import("session/emission.zig");
const course_file = @import("session/course.zig");
const Diagnostic = @import("diagnostic.zig").Diagnostic;
const film_file = @import("film.zig");
const fingerprint = @import("session/fingerprint.zig");
const part_file = @import("part.zig");
const Film = film_file.Film;
const Identity = @import("identity.zig").Identity;
const Progress = @import("progress.zig").Progress;
const Report = @import("report.zig").Report;
const memoryPeakBytes = @import("report.zig").memoryPeakBytes;
const Scene = @import("scene.zig").Scene;
const Frame = @import("world.zig").Frame;
const Light = @import("world.zig").Light;
const World = @import("world.zig").World;
const Allocator = std.mem.Allocator;
const Io = std.Io;
const assert = std.debug.assert;

/// A picture of work under way.
pub const ProgressImage = @import("session/progress_image.zig").ProgressImage;

/// Why there is no scene.
pub const LoadError = parse.Error;

/// Reads a file, or builds the scene that `builtin:NAME` means. The caller frees it.
pub fn loadScene(
    gpa: Allocator,
    io: Io,
    name: []const u8,
    choices: settings.Load,
    diagnostic: *Diagnostic,
) LoadError!Scene {
    var scene = if (std.mem.cutPrefix(u8, name, settings.builtin_prefix)) |builtin_name| builtin: {
        try parse.checkOnly(choices, diagnostic);
        break :builtin try builtin_scenes.build(gpa, builtin_name, diagnostic);
    } else try parse.parse(gpa, io, name, choices, diagnostic);
    errdefer scene.deinit();
    const is_z_up = if (choices.up_axis) |axis| axis == .z else scene.is_z_up;
    if (is_z_up) try scene.turn(z_to_y);
    return scene;
}

/// A quarter turn about x.
const z_to_y: math.AffineD = .{
    .x = .{ 1, 0, 0 },
    .y = .{ 0, 0, -1 },
    .z = .{ 0, 1, 0 },
    .translation = .{ 0, 0, 0 },
};

/// How the tree over the placed geometry is built.
pub const Pose = struct {
    /// Width of the tree: the variant's that is to render.
    lanes: u8,
    tree_quality: settings.TreeQuality = .default,
    /// When instances share their meshes.
    sharing: prepare.SharingRule = .{},
    animation: settings.Animation = .{},
    /// What `view` will be asked for: points and lines are as large as its pixels want them, and
    /// stay so until the next pose. What `shade` wants is there for the next views.
    view: settings.View = .{},
    /// What these want is there for the next pictures.
    layers: std.EnumSet(settings.Layer) = .empty,

    fn keepsTexcoords(pose: *const Pose) bool {
        return pose.layers.contains(.uv) or pose.view.shade == .uv;
    }

    fn keepsOrigins(pose: *const Pose) bool {
        const layers = &pose.layers;
        return layers.contains(.node) or layers.contains(.material) or
            layers.contains(.primitive);
    }
};

/// What the pictures of a film have of one of them: a film neither jumps nor flickers.
pub const Reference = struct {
    view: prepare.Reference,
    /// What the light of surfaces that emit is worth; null: it was not weighed.
    emission: ?emission.Weight,
    /// In stops, of formats that are exposed.
    exposure_ev: f32,
    is_metered: bool,
    /// What a dimmed studio is multiplied by.
    studio_scale: ?f32,
};

/// One scene, its threads, and what has been made so far. Must stay where it is.
pub const Session = struct {
    gpa: Allocator,
    io: Io,
    /// What the stages have to say: the line of an error, and warnings.
    diagnostic: *Diagnostic,
    pool: parallel.Pool,
    /// Where pictures are shown on which `render` is at work; the caller's.
    progress_image: ?*ProgressImage = null,
    /// Set, it ends what `render` traces when every pixel has a sample.
    stop: ?*const std.atomic.Value(bool) = null,
    /// Of the latest call of each stage.
    times: statistics.StageTimes = .{},
    /// When `load` began.
    start: Io.Timestamp = .{ .nanoseconds = 0 },

    scene: ?Scene = null,
    ownership: Ownership = .owned,
    facts: Facts = .{},
    texture_side_max: u32 = settings.texture_side.default,
    texture_pixel_count_max: u64 = settings.texture_pixel_count_max,
    /// Made by the first `pose` of a scene.
    loaded: ?prepare.Loaded = null,
    /// The scene as it is posed.
    posed: ?prepare.AnimatedScene = null,
    /// All that moves, where a view frames it: until something else does.
    motion: ?prepare.Motion = null,
    seen: settings.View = .{},
    world: ?World = null,
    /// What the next pose has a use for; there with the world.
    pose_cache: ?prepare.PoseCache = null,
    /// Of the world's triangles, where layers want them.
    origins: ?prepare.Origins = null,
    environment: Environment = .{},
    /// The studio, where it is seen but something else lights the scene.
    backdrop: Environment = .{},
    /// The file that the picture is to replace.
    output: ?Identity = null,
    film: ?Film = null,
    /// Names of what a layer of it has numbers of; the memory is that of `origins`.
    manifest: ?Manifest = null,
    /// Which pixels the film has.
    layout: ?film_file.Layout = null,
    /// What parts say of what they are of.
    identity: ?PictureIdentity = null,
    /// Of the scene, once it is known.
    scene_fingerprint: ?u64 = null,
    traced: trace.Statistics = .{},
    /// What the film was traced with.
    rendered: settings.Render = .{},
    /// What the view shows, for the exposure; null: not metered yet.
    metered: ?output.Metered = null,
    /// What `view` and `render` take from another picture; the caller's.
    reference: ?*const Reference = null,
    /// What the light of surfaces that emit is worth in the view; null: not weighed.
    weight: ?emission.Weight = null,
    /// What it was written with, where that is not linear.
    appearance: ?Report.Appearance = null,

    pub const Error = LoadError || prepare.Error || @import("session/environment.zig").Error ||
        PartError;

    /// `PartUnknown`: the picture has no such part.
    pub const PartError = error{ OutOfMemory, PartUnknown };

    /// See `identify`.
    const PictureIdentity = struct { version: []const u8, scene: u64, moment: u64 };

    /// Whether the scene is freed with the session, or only looked at: then it must live on until
    /// the last `view`.
    pub const Ownership = enum { owned, borrowed };

    /// What is known of a scene without having it.
    const Facts = struct {
        triangle_count: u64 = 0,
        sample_count: ?u32 = null,
        depth: ?u32 = null,
        has_background: bool = false,
        has_area_lights: bool = false,
        /// Something drawn has colours of the display.
        has_unlit: bool = false,
    };

    /// A session with `thread_count` threads, the caller's among them; null: as many as there are
    /// processors.
    pub fn init(gpa: Allocator, io: Io, thread_count: ?usize, diagnostic: *Diagnostic) Session {
        return .{
            .gpa = gpa,
            .io = io,
            .diagnostic = diagnostic,
            .pool = .init(thread_count orelse processorCount()),
        };
    }

    /// Frees everything and ends the threads.
    pub fn deinit(session: *Session) void {
        session.dropWorld();
        session.dropLoaded();
        session.dropScene();
        if (session.film) |*film| film.deinit(session.gpa);
        if (session.layout) |*layout| layout.deinit(session.gpa);
        session.environment.deinit();
        session.backdrop.deinit();
        session.pool.deinit();
        session.* = undefined;
    }

    /// Makes the stage under way, and those that follow, end with `error.Canceled`. Any thread may
    /// call it.
    pub fn cancel(session: *Session) void {
        session.pool.cancelled.store(true, .monotonic);
    }

    /// Reads a scene in place of the one before.
    pub fn load(session: *Session, name: []const u8, choices: settings.Load) Error!void {
        session.dropWorld();
        session.dropScene();
        const start = Io.Clock.awake.now(session.io);
        Progress.begin(session.pool.progress, .{ .stage = .reading });
        var told = choices;
        told.progress = session.pool.progress;
        const scene = try loadScene(session.gpa, session.io, name, told, session.diagnostic);
        session.adopt(scene, .owned);
        session.output = choices.output;
        session.texture_side_max = choices.texture_side_max;
        session.texture_pixel_count_max = choices.texture_pixel_count_max;
        session.start = start;
        session.times.parse_ns = session.since(start);
    }

    /// Takes a scene that is in memory, in place of the one before.
    pub fn adopt(session: *Session, scene: Scene, ownership: Ownership) void {
        session.dropWorld();
        session.dropLoaded();
        session.dropScene();
        session.start = Io.Clock.awake.now(session.io);
        session.environment.dropScene();
        session.scene_fingerprint = null;
        session.scene = scene;
        session.ownership = ownership;
        session.facts = .{
            .triangle_count = scene.triangleCount(),
            .sample_count = scene.sample_count,
            .depth = scene.depth,
            .has_background = scene.background != null,
            .has_area_lights = scene.has_area_lights,
            .has_unlit = for (scene.instances) |instance| {
                if (scene.materials[scene.meshes[instance.mesh].material].unlit) break true;
            } else false,
        };
    }

    /// Frees the scene and all that is made of it. Threads, film and environments stay for another.
    pub fn drop(session: *Session) void {
        session.dropWorld();
        session.dropLoaded();
        session.dropScene();
        session.reference = null;
    }

    /// Notes what parts of pictures of this view, by a program of this version, are to say of what
    /// they are of. Before the scene is dropped; asserts that there is a view.
    pub fn identify(session: *Session, version: []const u8) void {
        const known = session.scene_fingerprint;
        const scene = known orelse fingerprint.ofScene(&session.scene.?);
        session.scene_fingerprint = scene;
        const is_file = session.seen.environment.source == .file;
        const around = if (is_file) fingerprint.of(session.environment.made.?.map) else 0;
        session.identity = .{
            .version = version,
            .scene = fingerprint.of([2]u64{ scene, around }),
            .moment = fingerprint.of(session.posed.?.moment),
        };
    }

    /// Frees the scene, for which there is no use after the last `view`.
    pub fn dropScene(session: *Session) void {
        session.dropPosed();
        session.dropMotion();
        if (session.ownership == .owned) if (session.scene) |*scene| scene.deinit();
        session.scene = null;
    }

    /// Has the next view read its environment's file again.
    pub fn forgetEnvironment(session: *Session) void {
        session.environment.deinit();
    }

    fn dropPosed(session: *Session) void {
        if (session.posed) |*posed| posed.deinit();
        session.posed = null;
    }

    fn dropMotion(session: *Session) void {
        if (session.motion) |*motion| motion.deinit();
        session.motion = null;
    }

    fn dropWorld(session: *Session) void {
        if (session.world) |*world| world.deinit();
        session.world = null;
        if (session.pose_cache) |*cache| cache.deinit();
        session.pose_cache = null;
        if (session.origins) |*origins| origins.deinit();
        session.origins = null;
        session.manifest = null;
    }

    fn dropLoaded(session: *Session) void {
        if (session.loaded) |*loaded| loaded.deinit();
        session.loaded = null;
    }

    /// Refuses a picture that the scene wants larger than it may be, or with more samples, before
    /// anything is made of it. Asserts that there is a scene.
    pub fn checkWishes(
        session: *const Session,
        seen: *const settings.View,
        choices: *const settings.Render,
    ) error{SceneTooLarge}!void {
        const scene = &session.scene.?;
        const is_own = seen.resolution == null and seen.long_side == null;
        const size = seen.resolution orelse if (is_own) scene.resolution else null;
        const width, const height = size orelse return;
        const pixel_count = @as(u64, width) * height;
        const pixel_count_max: u64 = seen.pixel_count_max orelse if (is_own)
            settings.scene_pixel_count_max
        else
            settings.pixel_count_max;
        try session.checkPixels(width, height, pixel_count_max);
        const has_own_count = choices.sample_count == null and choices.noise == null and
            choices.time_budget_s == null and seen.shade != .cost;
        const sample_count = if (has_own_count) scene.sample_count orelse return else return;
        const sample_count_max = settings.scene_sample_count_max;
        if (pixel_count * sample_count > sample_count_max) return session.diagnostic.fail(
            error.SceneTooLarge,
            "it wants {d} samples of each of {d}x{d} pixels, over {d} in all (see --spp and -r)",
            .{ sample_count, width, height, sample_count_max },
        );
    }

    /// Refuses a picture larger than the user allows, whose size a camera decides.
    fn checkSize(session: *const Session) error{SceneTooLarge}!void {
        const seen = &session.world.?.view;
        const pixel_count_max = session.seen.pixel_count_max orelse return;
        return session.checkPixels(seen.width, seen.height, pixel_count_max);
    }

    fn checkPixels(
        session: *const Session,
        width: u32,
        height: u32,
        pixel_count_max: u64,
    ) error{SceneTooLarge}!void {
        if (@as(u64, width) * height <= pixel_count_max) return;
        return session.diagnostic.fail(
            error.SceneTooLarge,
            "a picture of {d}x{d} is asked for, of more than {d} pixels (see --max-pixels and -r)",
            .{ width, height, pixel_count_max },
        );
    }

    /// Places the geometry at a moment of the scene's animations and builds the tree over it; the
    /// first time, decodes the textures. It may be called again, also where nodes, weights and
    /// materials of a borrowed scene have changed since, and nothing else: arrays are written once
    /// more, and the tree is fitted. Asserts that there is a scene.
    pub fn pose(session: *Session, chosen: Pose) Error!void {
        errdefer session.dropWorld();
        const scene = &session.scene.?;
        if (session.loaded == null) {
            session.loaded = try prepare.load(session.gpa, session.io, scene, .{
                .pool = &session.pool,
                .side_max = session.texture_side_max,
                .pixel_count_max = session.texture_pixel_count_max,
            }, session.diagnostic, &session.times);
            try session.diagnostic.failIfRefused();
        }
        const loaded = &session.loaded.?;
        const shown = try session.animate(chosen.animation);
        const pose_settings: prepare.PoseSettings = .{
            .lanes = chosen.lanes,
            .pool = &session.pool,
            .tree_quality = chosen.tree_quality,
            .sharing = chosen.sharing,
            .point_size = chosen.view.point_size,
            .keeps_texcoords = chosen.keepsTexcoords(),
            .view = .{
                .camera = chosen.view.camera,
                .viewpoint = chosen.view.viewpoint,
                .resolution = chosen.view.resolution,
                .long_side = chosen.view.long_side,
            },
        };
        const has_origins = session.origins != null or !chosen.keepsOrigins();
        if (session.pose_cache) |*cache| if (has_origins and cache.fits(&pose_settings)) {
            return prepare.poseAgain(
                &session.world.?,
                cache,
                session.io,
                shown,
                loaded,
                pose_settings,
                session.diagnostic,
                &session.times,
            );
        };
        session.dropWorld();
        const posed = try prepare.pose(
            session.gpa,
            session.io,
            shown,
            loaded,
            pose_settings,
            session.diagnostic,
            &session.times,
        );
        session.world = posed.world;
        session.pose_cache = posed.cache;
        if (chosen.keepsOrigins()) session.origins =
            try prepare.originsOf(session.gpa, shown, loaded, &session.pose_cache.?);
    }

    /// The scene at a moment, until the next one.
    fn animate(session: *Session, chosen: settings.Animation) Error!*const Scene {
        const scene = &session.scene.?;
        const posed = try prepare.animateScene(session.gpa, scene, chosen, session.diagnostic);
        if (session.posed) |*before| {
            const is_same = std.meta.eql(before.moment.running, posed.moment.running);
            if (!is_same) session.dropMotion();
        }
        session.dropPosed();
        session.posed = posed;
        return &session.posed.?.scene;
    }

    /// Chooses what is seen, from where and by what light; the tree stays. Asserts that there is a
    /// pose.
    pub fn view(session: *Session, chosen: settings.View) Error!void {
        if (session.pool.cancelled.load(.monotonic)) return error.Canceled;
        var choices = chosen;
        if (choices.shade == .ao) {
            choices.environment.source = .white;
            choices.environment.intensity = Clay.radiance;
            choices.ambient = null;
            choices.emitters = false;
        }
        session.seen = choices;
        session.seen.background = session.backgroundOf(&choices);
        const background = session.seen.background;
        // Until it is chosen anew.
        session.world.?.environment.map = null;
        session.world.?.environment.backdrop = null;
        const start = Io.Clock.awake.now(session.io);
        Progress.begin(session.pool.progress, .{ .stage = .view });
        var environment = try session.chooseFor(&session.environment, &choices.environment);
        environment.is_seen = background == .env or background == .studio;
        environment.shadow_count = choices.shadowCount();
        var backdrop: ?prepare.EnvironmentSettings = null;
        if (background == .studio and !environment.is_studio) {
            var studio = choices.environment;
            studio.source = .studio;
            backdrop = try session.chooseFor(&session.backdrop, &studio);
            backdrop.?.is_seen = true;
        }
        if (choices.frames_all) try prepare.gatherMotion(
            session.gpa,
            &session.scene.?,
            &session.loaded.?,
            session.posed.?.moment.running,
            &session.pose_cache.?,
            &session.pool,
            &session.motion,
        );
        session.times.prepare_ns += session.since(start);
        session.weight = null;
        const shift = session.pose_cache.?.shift;
        const reference = if (session.reference) |first| first.view.shiftedBy(shift) else null;
        try prepare.view(&session.world.?, session.io, &session.posed.?.scene, .{
            .camera = choices.camera,
            .viewpoint = choices.viewpoint,
            .resolution = choices.resolution,
            .long_side = choices.long_side,
            .ambient = choices.ambient,
            .background = radianceOf(background),
            .environment = environment,
            .floor = choices.floor,
            .emitters = choices.emitters,
            .backdrop = backdrop,
            .motion = if (!choices.frames_all) null else if (session.motion) |*motion|
                motion
            else
                null,
            .reference = if (reference) |*first| first else null,
        }, session.diagnostic, &session.times);
        return session.checkSize();
    }

    /// The view as what other pictures of a film go by that are rendered and written like this.
    /// Asserts that there is a view, which is to be chosen anew before it is rendered.
    pub fn refer(
        session: *Session,
        choices: settings.Render,
        written: settings.Write,
    ) Error!Reference {
        session.reference = null;
        session.rendered = choices;
        session.metered = null;
        try session.weighEmitters();
        try session.dimStudio();
        const world = &session.world.?;
        // The file of a part says how all of the picture is exposed.
        const is_exposed = !output.isLinear(written.format) or choices.noise != null or
            choices.is_merged;
        return .{
            .view = session.framing(),
            .emission = session.weight,
            .exposure_ev = if (is_exposed) try session.exposureOf(written.exposure) else 0,
            .is_metered = session.isMetered(written.exposure),
            .studio_scale = if (session.isStudioDimmed()) world.environment.scale[0] else null,
        };
    }

    fn chooseFor(
        session: *Session,
        environment: *Environment,
        chosen: *const settings.Environment,
    ) Error!prepare.EnvironmentSettings {
        return environment.choose(
            session.gpa,
            session.io,
            &session.pool,
            &session.scene.?,
            chosen,
            session.seen.ambient != null,
            session.output,
            session.diagnostic,
        );
    }

    /// How the view is framed. Asserts that there is one.
    pub fn framing(session: *const Session) prepare.Reference {
        const world = &session.world.?;
        const is_framed = world.facts.camera_is_default or
            session.seen.viewpoint.replacesCamera();
        return .of(world, is_framed, session.pose_cache.?.shift);
    }

    /// Traces the picture. Asserts that there is a view, and a tree of the variant's width.
    pub fn render(session: *Session, choices: settings.Render) Error!void {
        const film = try session.sizedFilm(choices);
        const start = Io.Clock.awake.now(session.io);
        session.rendered = choices;
        session.appearance = null;
        session.metered = null;
        session.times.denoise_ns = 0;
        session.manifest = null;
        const shade = session.seen.shade;
        if (shade == null) {
            try session.weighEmitters();
            try session.dimStudio();
        }
        var frame = session.world.?.frame();
        var clay: ?Clay =
            if (shade == .ao) try .init(session.gpa, &session.world.?) else null;
        defer if (clay) |*made| made.deinit();
        if (clay) |*made| made.applyTo(&frame);
        var lights = try session.makeLightSampler(choices.integrator, &frame);
        defer if (lights) |*made| made.deinit();
        if (lights) |*made| frame.light_sampler = &made.sampler;
        frame.emission = try session.findEmission(choices.integrator, &frame);
        defer session.gpa.free(frame.emission);
        try session.traceInRounds(&frame, film, choices);
        session.times.trace_ns = session.since(start);
        if (session.traced.non_finite_count > 0) session.diagnostic.warn(
            "{d} pixels came out as not a number and were made black",
            .{session.traced.non_finite_count},
        );
        session.warnOfCuts();
        if (choices.denoise and !choices.is_merged) try session.denoiseFilm();
        try session.cutFilm();
        try session.fillHits(&frame);
        if (shade == .cost) try session.paintCost();
    }

    /// Says what was left out of the picture lest it take too long.
    fn warnOfCuts(session: *Session) void {
        const cuts = &session.traced.cuts;
        const diagnostic = session.diagnostic;
        if (cuts.passing > 0) diagnostic.warn(
            "{d} rays met more than {d} blended or open surfaces in a row; " ++
                "in place of what is behind these they see the background",
            .{ cuts.passing, trace.transparency_depth_max },
        );
        if (cuts.shadow > 0) diagnostic.warn(
            "some light goes through more than {d} surfaces on its way and was left out",
            .{trace.attenuation_count_max},
        );
        if (cuts.nested > 0) diagnostic.warn(
            "some rays are in more than {d} volumes at a time; others were taken for not there",
            .{trace.nested_max},
        );
    }

    /// Leaves of the film what was asked for.
    fn cutFilm(session: *Session) error{OutOfMemory}!void {
        const layout = &session.layout.?;
        if (!layout.hasSurroundings()) return;
        const cut = try session.film.?.cut(session.gpa, layout);
        session.film.?.deinit(session.gpa);
        session.film = cut;
        layout.* = layout.bare();
    }

    /// Makes layers of what the picture's first samples see, if the film has any.
    fn fillHits(session: *Session, frame: *const Frame) trace.Error!void {
        const film = &session.film.?;
        if (!film.layers.contains(.origin)) return;
        const start = Io.Clock.awake.now(session.io);
        const choices = &session.rendered;
        var chosen = session.traceSettings(choices.*);
        chosen.sample_count = @max(session.traced.sample_count, 1);
        chosen.layout = &session.layout.?;
        try trace.fillHits(session.gpa, choices.variant, frame, film, chosen);
        const origins = if (session.origins) |*origins| origins else null;
        if (origins) |made| {
            const arena = made.arena.allocator();
            session.manifest =
                try hit_layers.manifestOf(arena, film.imageOf(.origin).?, made);
        }
        try hit_layers.fill(film, .{
            .geometry = frame.geometry,
            .shift = session.pose_cache.?.shift,
            .origins = origins,
        }, &session.pool);
        session.times.trace_ns += session.since(start);
    }

    /// Makes the picture a map of what it took.
    fn paintCost(session: *Session) error{OutOfMemory}!void {
        const film = &session.film.?;
        const display = film.imageOf(.display).?;
        try output.paintLayer(session.gpa, &session.furtherOf(.cost), display);
        @memset(film.image.pixels, .{ 0, 0, 0, 1 });
    }

    fn denoiseFilm(session: *Session) denoise.Error!void {
        if (session.traced.sample_count < denoise.sample_count_min)
            return session.diagnostic.warn(denoise.too_few_samples, .{});
        const start = Io.Clock.awake.now(session.io);
        try denoise.run(session.gpa, &session.film.?, &session.pool);
        session.times.denoise_ns = session.since(start);
    }

    fn traceInRounds(
        session: *Session,
        frame: *const Frame,
        film: *Film,
        choices: settings.Render,
    ) trace.Error!void {
        var chosen = session.traceSettings(choices);
        chosen.stop = session.stop;
        chosen.layout = &session.layout.?;
        if (choices.noise) |noise| chosen.noise = .{
            .error_max = noise.error_max,
            .exposure_scale = output.exposureScale(try session.exposureOf(noise.exposure)),
        };
        var course: course_file.Course = .{
            .io = session.io,
            .start = Io.Clock.awake.now(session.io),
        };
        if (choices.time_budget_s) |budget_s| {
            const budget_ns: u64 = @intFromFloat(@as(f64, budget_s) * std.time.ns_per_s);
            if (choices.integrator.isOpen()) {
                course.budget_ns = budget_ns;
            } else if (try session.traceOne(frame, film, &chosen, budget_ns)) return;
        }
        if (session.progress_image) |image| {
            // Now, for what is metered is traced with other lights.
            _ = try session.appearanceOf(image.choices);
            try image.size(session.gpa, film);
            course.viewer = .{ .context = session, .show = showProgress };
            course.interval_ns = image.interval_ns;
            course.due_ns = image.interval_ns;
        }
        defer if (session.progress_image) |image| image.dropFilm(session.gpa);
        if (course.budget_ns != null or course.viewer != null) chosen.course = course.asked();
        try session.traceFilm(frame, film, chosen);
    }

    fn traceFilm(
        session: *Session,
        frame: *const Frame,
        film: *Film,
        chosen: trace.Settings,
    ) trace.Error!void {
        const gpa = session.gpa;
        const index = session.rendered.variant;
        var adjusted = chosen;
        if (session.seen.shade) |shade| switch (shade) {
            .normal => adjusted.aov = .normals,
            .uv => adjusted.aov = .texcoords,
            .ao, .cost => {},
        };
        session.traced = if (adjusted.aov != .hits)
            try trace.traceAov(gpa, index, frame, film, adjusted)
        else if (film.layers.contains(.cost))
            try trace.traceCounting(gpa, index, frame, film, adjusted)
        else
            try trace.trace(gpa, index, frame, film, adjusted);
    }

    /// Traces a picture of one sample, to find how many fit into the time, and chooses so many;
    /// true: no more than the one.
    fn traceOne(
        session: *Session,
        frame: *const Frame,
        film: *Film,
        chosen: *trace.Settings,
        budget_ns: u64,
    ) trace.Error!bool {
        const start = Io.Clock.awake.now(session.io);
        var one = chosen.*;
        one.sample_count = 1;
        try session.traceFilm(frame, film, one);
        const sample_ns = session.since(start);
        const count = course_file.fitting(budget_ns -| sample_ns, sample_ns);
        chosen.sample_count = @intCast(@min(chosen.sample_count, count));
        return chosen.sample_count <= 1 or session.traced.is_partial;
    }

    fn showProgress(context: *anyopaque, standing: *const trace.Standing) void {
        const session: *Session = @ptrCast(@alignCast(context));
        const image = session.progress_image.?;
        standing.copyTo(&image.film.?) catch return;
        const appearance = session.appearanceOf(image.choices) catch return;
        const chosen = session.outputSettings(image.choices, appearance);
        const layout = &session.layout.?;
        if (!layout.hasSurroundings())
            return image.write(session.gpa, &image.film.?, chosen, session.diagnostic);
        var cut = image.film.?.cut(session.gpa, layout) catch return;
        defer cut.deinit(session.gpa);
        image.write(session.gpa, &cut, chosen, session.diagnostic);
    }

    /// The list of an integrator that chooses lights at random; null for others.
    fn makeLightSampler(
        session: *Session,
        integrator: settings.Integrator,
        frame: *const Frame,
    ) Error!?prepare.OwnedLightSampler {
        if (integrator != .path) return null;
        const has_emitters = session.seen.emitters or session.facts.has_area_lights;
        return try prepare.makeLightSampler(session.gpa, frame, has_emitters, &session.pool);
    }

    /// Points on surfaces that emit, for an integrator of virtual lights; none for others, or where
    /// these surfaces do not light the scene.
    fn findEmission(
        session: *Session,
        integrator: settings.Integrator,
        frame: *const Frame,
    ) Error![]const Light {
        if (integrator != .lights) return &.{};
        for (frame.lights) |*light| {
            if (light.kind == .emitter) return prepare.findEmission(session.gpa, frame);
        }
        return &.{};
    }

    /// Traces the same picture again to count intersection tests, without timing.
    pub fn countTests(session: *Session, choices: settings.Render) Error!statistics.TestCounts {
        var chosen = session.traceSettings(choices);
        chosen.sample_count = session.traced.sample_count;
        chosen.layout = &session.layout.?;
        const counted = try trace.traceCounting(
            session.gpa,
            choices.variant,
            &session.world.?.frame(),
            &session.film.?,
            chosen,
        );
        session.traced.tests = counted.tests;
        return counted.tests.?;
    }

    /// Refuses a part that the view does not have, and what a file cannot hold of it; best asked
    /// before `render`.
    pub fn checkWrite(
        session: *Session,
        choices: settings.Write,
        part: settings.Part,
    ) (error{InputOutput} || PartError)!void {
        const seen = &session.world.?.view;
        var layout: film_file.Layout =
            try .init(session.gpa, seen.width, seen.height, part, .{}, session.diagnostic);
        defer layout.deinit(session.gpa);
        return output.check(
            choices.format,
            session.seen.background == .transparent,
            layout.film_width,
            layout.film_height,
            session.diagnostic,
        );
    }

    /// Encodes the picture and moves it to its place; a part that is to be merged in OpenEXR, as
    /// `merge` takes it. Closes the target in any case. Asserts that there is a picture, and that
    /// `identify` has been called for a part.
    pub fn write(
        session: *Session,
        target: *output.Target,
        choices: settings.Write,
    ) output.Error!void {
        defer target.abandon();
        if (session.rendered.is_merged) return session.writePart(target, choices);
        session.appearance = try session.appearanceOf(choices);
        const start = Io.Clock.awake.now(session.io);
        const film = &session.film.?;
        var further: [std.enums.values(settings.Layer).len]output.Further = undefined;
        var chosen = session.outputSettings(choices, session.appearance);
        if (!choices.layers_apart) {
            chosen.further = session.furtherLayers(&further);
            chosen.manifest = if (session.manifest) |*manifest| manifest else null;
        }
        Progress.begin(session.pool.progress, .{ .stage = .writing });
        const tally = try output.write(session.gpa, .{
            .image = &film.image,
            .display = film.imageOf(.display),
        }, chosen, target, session.diagnostic);
        session.times.output_ns = session.since(start);
        session.times.total_ns = session.since(session.start);
        if (session.rendered.part == .whole) session.hint(tally);
    }

    fn writePart(
        session: *Session,
        target: *output.Target,
        choices: settings.Write,
    ) output.Error!void {
        const film = &session.film.?;
        const layout = &session.layout.?;
        const ev = try session.exposureOf(choices.exposure);
        const start = Io.Clock.awake.now(session.io);
        const chosen = session.outputSettings(choices, null);
        var layers: [std.enums.values(film_file.Layer).len]film_file.Layer = undefined;
        var further: [std.enums.values(settings.Layer).len]settings.Layer = undefined;
        const identity = &session.identity.?;
        try part_file.write(session.gpa, film, layout, &.{
            .version = identity.version,
            .width = layout.width,
            .height = layout.height,
            .part = session.partOf(),
            .scene = part_file.hexOf(identity.scene),
            .options = part_file.hexOf(session.optionsFingerprint(choices)),
            .sample_count = session.traced.sample_count,
            .is_partial = session.traced.is_partial,
            .layers = listOf(film_file.Layer, film.layers, &layers),
            .further = listOf(settings.Layer, session.rendered.layers, &further),
            .denoise = session.rendered.denoise,
            .exposure_ev = ev,
            .tone_mapping = chosen.tone_mapping,
            .transparent = chosen.transparent,
            .background = chosen.background,
            .manifest = if (session.manifest) |*manifest| .of(manifest) else null,
            .jpeg_quality = chosen.jpeg_quality,
            .webp_quality = chosen.webp_quality,
            .exr_kind = chosen.exr_kind,
            .frame_rate = chosen.frame_rate,
        }, target, session.diagnostic);
        session.times.output_ns = session.since(start);
        session.times.total_ns = session.since(session.start);
    }

    /// What the film has, of crops the pixels.
    fn partOf(session: *const Session) settings.Part {
        return switch (session.rendered.part) {
            .crop => .{ .crop = .{ .pixels = session.layout.?.form.window } },
            .whole, .tile => session.rendered.part,
        };
    }

    /// Of all that the picture depends on besides what was read.
    fn optionsFingerprint(session: *const Session, choices: settings.Write) u64 {
        var seen = session.seen;
        // A file's contents count, not its name.
        if (seen.environment.source == .file) seen.environment.source = .{ .file = "" };
        const rendered = &session.rendered;
        return fingerprint.of(.{
            session.identity.?.moment,
            if (session.reference) |reference| fingerprint.of(reference.*) else 0,
            session.texture_side_max,
            seen,
            rendered.integrator,
            rendered.lights,
            session.sampleCount(rendered.*),
            rendered.noise,
            session.depthOf(rendered.*),
            rendered.denoise,
            rendered.layers,
            choices.exposure,
            choices.tone_mapping,
            choices.jpeg_quality,
            choices.webp_quality,
            choices.exr_kind,
        });
    }

    /// Encodes a layer alone, as numbers or as colours, whichever the format holds, and moves it to
    /// its place. Closes the target in any case. Asserts that the picture was made with the layer.
    pub fn writeLayer(
        session: *Session,
        layer: settings.Layer,
        target: *output.Target,
        choices: settings.Write,
    ) output.Error!void {
        defer target.abandon();
        const start = Io.Clock.awake.now(session.io);
        var chosen = session.outputSettings(choices, null);
        chosen.manifest = if (session.manifest) |*manifest| manifest else null;
        const further = session.furtherOf(layer);
        try output.writeLayer(session.gpa, &further, chosen, target, session.diagnostic);
        session.times.output_ns += session.since(start);
    }

    /// Null: the format keeps radiance as it is.
    fn appearanceOf(session: *Session, choices: settings.Write) trace.Error!?Report.Appearance {
        if (output.isLinear(choices.format)) return null;
        if (session.seen.shade != null)
            return .{ .exposure_ev = 0, .is_automatic = false, .tone_mapping = .linear };
        return .{
            .exposure_ev = try session.exposureOf(choices.exposure),
            .is_automatic = session.isMetered(choices.exposure),
            .tone_mapping = choices.tone_mapping,
        };
    }

    fn outputSettings(
        session: *Session,
        choices: settings.Write,
        appearance: ?Report.Appearance,
    ) output.Settings {
        return .{
            .format = choices.format,
            .exposure_ev = if (appearance) |chosen| chosen.exposure_ev else 0,
            .tone_mapping = if (session.seen.shade == null) choices.tone_mapping else .linear,
            .transparent = session.seen.background == .transparent,
            .background = session.behind(),
            .jpeg_quality = @intCast(choices.jpeg_quality),
            .webp_quality = if (choices.webp_quality) |quality| @intCast(quality) else null,
            .rows = session.rowsWritten(),
            .exr_kind = choices.exr_kind,
            .frame_rate = choices.frame_rate,
            .is_continued = choices.is_continued,
            .pool = &session.pool,
        };
    }

    /// Null: all.
    fn rowsWritten(session: *const Session) ?output.Extent {
        const layout = &session.layout.?;
        return switch (layout.form) {
            .window => |own| .{ .first = own[1], .of = layout.height },
            .share => null,
        };
    }

    /// Layers that were asked for, in `room`.
    fn furtherLayers(session: *const Session, room: []output.Further) []const output.Further {
        var count: usize = 0;
        var chosen = session.rendered.layers.iterator();
        while (chosen.next()) |layer| : (count += 1) room[count] = session.furtherOf(layer);
        return room[0..count];
    }

    fn furtherOf(session: *const Session, layer: settings.Layer) output.Further {
        const image = session.film.?.imageOf(film_file.layerOf(layer)).?;
        return .{ .layer = layer, .image = image };
    }

    fn isMetered(session: *const Session, exposure: settings.Exposure) bool {
        if (session.reference) |reference| return reference.is_metered;
        return switch (exposure) {
            .ev => false,
            .auto => true,
            .default => session.world.?.facts.own_light_count > 0,
        };
    }

    /// In stops: as chosen, or metered. That time counts as tracing.
    fn exposureOf(session: *Session, exposure: settings.Exposure) trace.Error!f32 {
        if (session.seen.shade != null) return 0;
        if (session.reference) |reference| return reference.exposure_ev;
        if (!session.isMetered(exposure)) return if (exposure == .ev) exposure.ev else 0;
        const start = Io.Clock.awake.now(session.io);
        const metered = try session.meter();
        session.times.trace_ns += session.since(start);
        return metered.ev;
    }

    /// The studio is around lights that the scene has itself, so that what they do not reach is no
    /// hole.
    fn isStudioDimmed(session: *const Session) bool {
        const facts = &session.world.?.facts;
        return facts.environment_is_default and facts.own_light_count > 0;
    }

    /// Makes the studio's light a share of its usual one as it is seen with the exposure for the
    /// scene's own lights, whichever exposure is chosen; all of it where these light next to
    /// nothing.
    fn dimStudio(session: *Session) trace.Error!void {
        if (session.reference) |reference| {
            const scale = reference.studio_scale orelse return;
            const environment = &session.world.?.environment;
            if (session.world.?.facts.environment_is_default) environment.scale = @splat(scale);
            return;
        }
        if (!session.isStudioDimmed()) return;
        const metered = try session.meter();
        const share: f32 = if (metered.is_black) 1 else studio_share;
        const intensity = session.seen.environment.intensity;
        const scale = share * intensity / output.exposureScale(metered.ev);
        session.world.?.environment.scale = @splat(scale);
    }

    /// Meters a small picture of the view, so that the result does not depend on the pixels that
    /// are to be written, without a studio that is dimmed by it.
    fn meter(session: *Session) trace.Error!output.Metered {
        if (session.metered) |metered| return metered;
        const world = &session.world.?;
        const around = world.environment;
        defer world.environment = around;
        if (session.isStudioDimmed()) {
            world.environment.map = null;
            world.environment.is_seen = false;
        }
        var film = try session.traceSmall();
        defer film.deinit(session.gpa);
        const display = film.imageOf(.display);
        session.metered = try output.meter(session.gpa, &film.image, display);
        return session.metered.?;
    }

    /// The view in a small picture with alpha, which the caller frees.
    fn traceSmall(session: *Session) trace.Error!Film {
        const world = &session.world.?;
        const whole = world.view;
        defer world.view = whole;
        const longest: f32 = @floatFromInt(@max(whole.width, whole.height));
        const scale = @min(1, @as(f32, meter_side) / longest);
        inline for (.{ &world.view.width, &world.view.height }) |side| {
            side.* = @max(1, @as(u32, @intFromFloat(@as(f32, @floatFromInt(side.*)) * scale)));
        }
        var layers = session.layersOf();
        layers.insert(.alpha);
        var film: Film = try .init(session.gpa, world.view.width, world.view.height, layers);
        errdefer film.deinit(session.gpa);
        var chosen = session.traceSettings(session.rendered);
        chosen.integrator = .whitted;
        chosen.sample_count = 1;
        chosen.progress = null;
        const variant_index = session.rendered.variant;
        _ = try trace.trace(session.gpa, variant_index, &world.frame(), &film, chosen);
        return film;
    }

    /// Leaves out the lights of surfaces that emit where they hardly show beside what lights the
    /// view anyway. Where they are more than half of its light, they are lights of the scene's own,
    /// in place of the default ones.
    fn weighEmitters(session: *Session) trace.Error!void {
        const world = &session.world.?;
        const facts = &world.facts;
        if (facts.emitter_count == 0) return;
        const count = facts.emitter_count;
        const all = world.lights;
        const others = all[0 .. all.len - count];
        const known = if (session.reference) |reference| reference.emission else null;
        const share = known orelse try session.weigh(others, all[others.len..]);
        session.weight = share;
        world.lights = if (share.shows) all else others;
        facts.emitter_count = 0;
        if (!share.prevails) return;
        facts.own_light_count += count;
        if (!facts.lights_are_default) return;
        facts.lights_are_default = false;
        world.lights = all[others.len..];
        world.environment.ambient = session.seen.ambient orelse 0;
    }

    /// Weighs some of the lights against the others, and all else that shines.
    fn weigh(
        session: *Session,
        others: []const Light,
        own: []const Light,
    ) trace.Error!emission.Weight {
        const world = &session.world.?;
        const all = world.lights;
        defer world.lights = all;
        world.lights = others;
        var besides = try session.traceSmall();
        defer besides.deinit(session.gpa);
        const around = world.environment;
        defer world.environment = around;
        world.environment.map = null;
        world.environment.ambient = 0;
        world.lights = &.{};
        var glow = try session.traceSmall();
        defer glow.deinit(session.gpa);
        world.lights = own;
        var lit = try session.traceSmall();
        defer lit.deinit(session.gpa);
        return emission.weigh(besides.image.pixels, glow.image.pixels, lit.image.pixels);
    }

    /// Says so where the picture shows next to nothing, and what may help.
    fn hint(session: *Session, tally: output.Tally) void {
        if (session.seen.shade != null) return;
        const total = session.film.?.image.pixels.len;
        if (isNearlyAll(tally.clear, total)) return session.hintOf(
            "background",
            tally.clear,
            total,
            if (session.world.?.facts.camera_is_default)
                "--orbit and --fov choose another view"
            else
                "--camera auto shows all there is",
        );
        const is_automatic = if (session.appearance) |chosen| chosen.is_automatic else true;
        if (isNearlyAll(tally.black, tally.covered)) return session.hintOf(
            "black",
            tally.black,
            tally.covered,
            if (is_automatic)
                "--env studio or --ambient gives it light"
            else
                "--exposure auto makes it brighter",
        );
        if (isNearlyAll(tally.white, tally.covered)) return session.hintOf(
            "white",
            tally.white,
            tally.covered,
            if (is_automatic)
                "a lower --exposure makes it darker"
            else
                "--exposure auto makes it darker",
        );
    }

    fn isNearlyAll(count: u64, total: u64) bool {
        return count * 100 > total * 95;
    }

    fn hintOf(
        session: *Session,
        what: []const u8,
        count: u64,
        total: u64,
        help: []const u8,
    ) void {
        session.diagnostic.warn("{d} % of what the picture shows is {s}; {s}", .{
            count * 100 / total, what, help,
        });
    }

    /// What the picture took; what the user called things is the caller's to fill in.
    pub fn report(session: *const Session, choices: settings.Render) Report {
        const layout = &session.layout.?;
        const tree = &session.world.?.facts.tree;
        const textures = &session.loaded.?.textures;
        return .{
            .triangle_count = session.facts.triangle_count +
                session.world.?.facts.stroke_triangle_count,
            .width = if (layout.form == .window) layout.film_width else layout.width,
            .height = if (layout.form == .window) layout.film_height else layout.height,
            .part = session.partOf(),
            .sample_count = session.traced.sample_count,
            .sample_mean = float(session.traced.sample_sum) / float(session.traced.pixel_count),
            .is_partial = session.traced.is_partial,
            .is_timed = choices.time_budget_s != null,
            .depth = session.depthOf(choices),
            .thread_count = session.pool.thread_count,
            .variant = variant.names[choices.variant],
            .times = session.times,
            .rays = session.traced.rays,
            .tests = session.traced.tests,
            .textures = .{
                .count = textures.textures.all.len,
                .bytes = textures.byte_count,
            },
            .bvh = .{
                .node_count = tree.node_count,
                .depth = tree.depth,
                .sah_cost = tree.sah_cost,
                .bytes = tree.bytes,
            },
            .memory_peak_bytes = memoryPeakBytes(),
            .image_hash = session.film.?.hash(),
            .appearance = session.appearance,
            .manifest = session.manifest,
        };
    }

    /// Samples a pixel that `render` takes at most. Asserts that there is a view.
    pub fn sampleCount(session: *const Session, choices: settings.Render) u32 {
        if (choices.sample_count) |count| return count;
        // One tells as much of what rays cost.
        if (session.seen.shade == .cost) return 1;
        if (choices.noise != null) return settings.noise_sample_count;
        if (choices.time_budget_s != null) return settings.sample_count.max;
        const seen = &session.world.?.view;
        return session.facts.sample_count orelse
            settings.samplesFor(choices.integrator, seen.width, seen.height);
    }

    fn depthOf(session: *const Session, choices: settings.Render) u32 {
        return choices.depth orelse session.facts.depth orelse
            settings.depthFor(choices.integrator);
    }

    fn traceSettings(session: *Session, choices: settings.Render) trace.Settings {
        return .{
            .pool = &session.pool,
            .integrator = choices.integrator,
            .lights = choices.lights,
            .sample_count = session.sampleCount(choices),
            .depth_max = session.depthOf(choices),
            .tile_size = choices.tile_size,
            .progress = session.pool.progress,
            .cancel = &session.pool.cancelled,
        };
    }

    /// The background that is chosen: the scene's own environment where that is to be seen and
    /// nothing else is asked for.
    fn backgroundOf(session: *const Session, choices: *const settings.View) settings.Background {
        const is_own = choices.environment.source == .default;
        const is_seen = if (session.scene.?.environment) |*map| map.is_seen else false;
        const shows_own = choices.background == .default and is_own and is_seen;
        return if (shows_own) .env else choices.background;
    }

    /// What the film keeps: alpha where the background is no radiance, and colours of the display
    /// where there are some.
    fn layersOf(session: *const Session) film_file.Layers {
        const seen = &session.seen;
        const facts = &session.facts;
        if (seen.shade) |shade| if (shade != .ao)
            return .init(.{ .color = true, .alpha = true, .display = true });
        return .init(.{
            .color = true,
            .alpha = switch (seen.background) {
                .transparent => true,
                .srgb => seen.display_referred,
                .default => seen.display_referred and !facts.has_background,
                .env, .studio, .linear => false,
            },
            .display = seen.display_referred and facts.has_unlit,
        });
    }

    /// What is behind the film where that has alpha.
    fn behind(session: *const Session) output.Background {
        if (!session.seen.display_referred) return .none;
        return switch (session.seen.background) {
            .default => if (session.facts.has_background) .none else .gradient,
            .srgb => |codes| .{ .srgb = codes },
            .transparent, .env, .studio, .linear => .none,
        };
    }

    /// A film of the view's size.
    fn sizedFilm(session: *Session, choices: settings.Render) PartError!*Film {
        const view_size = &session.world.?.view;
        var layers = session.layersOf();
        if (choices.denoise) layers.setUnion(denoise.needed);
        var further = choices.layers.iterator();
        while (further.next()) |layer| layers.insert(film_file.layerOf(layer));
        // Where hits are before they become numbers.
        if (layers.contains(.position) or layers.contains(.texcoord)) layers.insert(.origin);
        if (session.seen.shade == .cost) layers.insert(.cost);
        const layout: film_file.Layout = try .init(
            session.gpa,
            view_size.width,
            view_size.height,
            choices.part,
            surroundingsOf(&choices),
            session.diagnostic,
        );
        if (session.layout) |*before| before.deinit(session.gpa);
        session.layout = layout;
        const width, const height = .{ layout.film_width, layout.film_height };
        if (session.film) |*film| {
            if (film.become(width, height, layers)) return film;
            film.deinit(session.gpa);
            session.film = null;
        }
        session.film = try .init(session.gpa, width, height, layers);
        // Between tiles that the picture's edge cuts there are pixels that nobody writes.
        if (layout.form == .share) session.film.?.clear();
        return &session.film.?;
    }

    fn since(session: *const Session, start: Io.Timestamp) u64 {
        return @intCast(start.untilNow(session.io, .awake).toNanoseconds());
    }
};

fn float(count: u64) f64 {
    return @floatFromInt(count);
}

/// What has to be traced around the pixels that are asked for.
fn surroundingsOf(choices: *const settings.Render) film_file.Surroundings {
    assert(choices.is_merged or choices.part != .tile);
    var around = trace.surroundingsOf(choices);
    if (choices.denoise and !choices.is_merged) around.margin += denoise.reach;
    return around;
}

/// The members of a set, in `room`.
fn listOf(comptime T: type, set: std.EnumSet(T), room: []T) []const T {
    var count: usize = 0;
    var all = set;
    var members = all.iterator();
    while (members.next()) |member| : (count += 1) room[count] = member;
    return room[0..count];
}

/// Threads where nobody says how many.
pub fn processorCount() usize {
    return @min(std.Thread.getCpuCount() catch 1, parallel.thread_count_max);
}

/// Pixels on the long side of the picture that is metered.
const meter_side = 64;

/// Share of its usual light that the studio has around lights of the scene.
const studio_share = 0.1;

/// The radiance of a background; null: as the lights or the scene have it.
fn radianceOf(background: settings.Background) ?[3]f32 {
    return switch (background) {
        .default, .env, .studio => null,
        .transparent => .{ 0, 0, 0 },
        .linear => |color| color,
        .srgb => |codes| .{
            srgb.decoded[codes[0]], srgb.decoded[codes[1]], srgb.decoded[codes[2]],
        },
    };
}

const testing = std.testing;

/// A session that is ready to trace the built-in scene.
fn openForTest(session: *Session) !void {
    try session.load("builtin:cornell", .{});
    try session.pose(.{ .lanes = variant.compiled[0].lanes });
}

test "a scene is built in or in a file" {
    var diagnostic: Diagnostic = .{};
    var session: Session = .init(testing.allocator, testing.io, 1, &diagnostic);
    defer session.deinit();
    try testing.expectError(error.InvalidInput, session.load("builtin:no such", .{}));
    try testing.expect(diagnostic.message.text().len > 0);
    try testing.expectError(error.InputOutput, session.load("no such.glb", .{}));
    try session.load("builtin:cornell", .{});
    try testing.expectEqual(session.scene.?.triangleCount(), session.facts.triangle_count);
}

test "a scene that is loaded once gives each view the picture it has alone" {
    const views = [_]settings.View{
        .{ .resolution = .{ 24, 16 } },
        .{ .resolution = .{ 9, 13 }, .camera = .auto, .background = .{ .srgb = .{ 255, 0, 0 } } },
        .{ .resolution = .{ 24, 16 } },
    };
    var diagnostic: Diagnostic = .{};
    var hashes: [views.len]u64 = undefined;
    for (views, &hashes) |view, *hash| {
        var session: Session = .init(testing.allocator, testing.io, 2, &diagnostic);
        defer session.deinit();
        try openForTest(&session);
        try session.view(view);
        session.dropScene();
        try session.render(.{});
        hash.* = session.film.?.image.hash();
    }
    try testing.expectEqual(hashes[0], hashes[2]);
    try testing.expect(hashes[0] != hashes[1]);
    var session: Session = .init(testing.allocator, testing.io, 2, &diagnostic);
    defer session.deinit();
    try openForTest(&session);
    for (views, hashes) |view, hash| {
        try session.view(view);
        // The same picture again needs nothing before it.
        for (0..2) |_| {
            try session.render(.{});
            try testing.expectEqual(hash, session.film.?.image.hash());
        }
    }
    const tests = try session.countTests(.{});
    try testing.expect(tests.box_issued > 0 and session.film.?.image.hash() == hashes[2]);
    const made = session.report(.{ .depth = 2 });
    try testing.expectEqual(2, made.depth);
    try testing.expectEqual(24 * 16 * settings.sample_count_small, made.rays.primary);
    try testing.expectEqual(hashes[2], made.image_hash);
}

test "layers leave the picture as it is, and places are as far away as depths say" {
    var diagnostic: Diagnostic = .{};
    var session: Session = .init(testing.allocator, testing.io, 2, &diagnostic);
    defer session.deinit();
    try session.load("builtin:cornell", .{});
    const layers: std.EnumSet(settings.Layer) = .full;
    try session.pose(.{ .lanes = variant.compiled[0].lanes, .layers = layers });
    const seen: settings.View = .{
        .resolution = .{ 8, 8 },
        .camera = .auto,
        .environment = .{ .source = .none },
        .background = .transparent,
    };
    try session.view(seen);
    try session.render(.{ .sample_count = 2 });
    const hash = session.film.?.hash();
    try session.render(.{ .sample_count = 2, .layers = layers });
    try testing.expectEqual(hash, session.film.?.hash());
    try testing.expect(session.report(.{}).manifest != null);
    const camera = &session.world.?.view.camera;
    const forward = math.vec3.normalize(camera.forward).?;
    const alpha = session.furtherOf(.alpha);
    var hit_count: usize = 0;
    for (session.film.?.imageOf(.position).?.pixels, 0..) |place, at| {
        if (place[3] == 0) continue;
        // Depths of other samples of the pixel are much the same.
        const shifted = math.vec3.sub(place[0..3].*, camera.origin);
        const depth = math.vec3.dot(shifted, forward);
        if (alpha.valuesAt(at)[0] < 1) continue;
        try testing.expectApproxEqRel(session.furtherOf(.depth).valuesAt(at)[0], depth, 0.5);
        hit_count += 1;
    }
    try testing.expect(hit_count > 8);
}

test "every stage ends when it is cancelled, and no file is left" {
    var folder = testing.tmpDir(.{ .iterate = true });
    defer folder.cleanup();
    const io = testing.io;
    var path_buffer: [std.fs.max_path_bytes]u8 = undefined;
    const folder_path = path_buffer[0..try folder.dir.realPath(io, &path_buffer)];
    const path = try std.fs.path.join(testing.allocator, &.{ folder_path, "a.png" });
    defer testing.allocator.free(path);

    var diagnostic: Diagnostic = .{};
    var session: Session = .init(testing.allocator, io, 2, &diagnostic);
    defer session.deinit();
    var temporaries: output.TemporaryFiles = .{};
    var target: output.Target = try .openFile(io, &temporaries, path, &diagnostic);
    defer target.abandon();
    try openForTest(&session);
    try session.view(.{ .resolution = .{ 512, 512 } });
    // As soon as the first tile is there, from another thread.
    const Canceller = struct {
        fn run(cancelled: *Session, first: *const volatile f32) void {
            while (std.math.isNan(first.*)) std.atomic.spinLoopHint();
            cancelled.cancel();
        }
    };
    const image = &(try session.sizedFilm(.{})).image;
    @memset(image.pixels, @splat(std.math.nan(f32)));
    const first: *const volatile f32 = &image.pixels[0][3];
    const canceller = try std.Thread.spawn(.{}, Canceller.run, .{ &session, first });
    const result = session.render(.{ .tile_size = 4, .sample_count = 64 });
    canceller.join();
    try testing.expectError(error.Canceled, result);
    // Some tiles were traced, others were not.
    try testing.expect(std.math.isNan(image.pixels[image.pixels.len - 1][3]));
    try testing.expectError(error.Canceled, session.write(&target, .{}));
    try testing.expectError(error.Canceled, session.view(.{ .resolution = .{ 4, 4 } }));
    var entries = folder.dir.iterate();
    try testing.expectEqual(null, try entries.next(io));
}

/// A session and a folder for its pictures.
const TestFolder = struct {
    folder: testing.TmpDir,
    path: []const u8,
    temporaries: output.TemporaryFiles = .{},
    diagnostic: Diagnostic = .{},

    fn init() !TestFolder {
        const folder = testing.tmpDir(.{ .iterate = true });
        var buffer: [std.fs.max_path_bytes]u8 = undefined;
        const length = try folder.dir.realPath(testing.io, &buffer);
        return .{ .folder = folder, .path = try testing.allocator.dupe(u8, buffer[0..length]) };
    }

    fn deinit(self: *TestFolder) void {
        testing.allocator.free(self.path);
        self.folder.cleanup();
    }

    /// The caller frees it.
    fn pathOf(self: *const TestFolder, name: []const u8) ![]const u8 {
        return std.fs.path.join(testing.allocator, &.{ self.path, name });
    }

    /// The caller frees it.
    fn read(self: *const TestFolder, name: []const u8) ![]const u8 {
        const limit: Io.Limit = .limited(1 << 20);
        return self.folder.dir.readFileAlloc(testing.io, name, testing.allocator, limit);
    }
};

test "a time budget's picture is that of as many samples, and one that is stopped has some" {
    var diagnostic: Diagnostic = .{};
    var session: Session = .init(testing.allocator, testing.io, 2, &diagnostic);
    defer session.deinit();
    try openForTest(&session);
    try session.view(.{ .resolution = .{ 12, 8 }, .environment = .{ .source = .none } });
    var stop: std.atomic.Value(bool) = .init(true);
    for ([_]settings.Integrator{ .whitted, .path }) |integrator| {
        try session.render(.{
            .integrator = integrator,
            .sample_count = 3,
            .time_budget_s = 0.05,
        });
        const timed = session.report(.{ .time_budget_s = 0.05 });
        try testing.expect(timed.sample_count >= 1 and timed.sample_count <= 3);
        try session.render(.{ .integrator = integrator, .sample_count = timed.sample_count });
        try testing.expectEqual(timed.image_hash, session.film.?.hash());

        session.stop = &stop;
        defer session.stop = null;
        try session.render(.{ .integrator = integrator, .sample_count = 3 });
        const stopped = session.report(.{});
        try testing.expect(stopped.is_partial and stopped.sample_count == 1);
        try testing.expectEqual(1, stopped.sample_mean);
    }
    const stopped_hash = session.film.?.hash();
    try session.render(.{ .integrator = .path, .sample_count = 1 });
    try testing.expectEqual(stopped_hash, session.film.?.hash());
}

test "a picture of work under way is the one of the samples so far, in a whole file" {
    const gpa = testing.allocator;
    var folder: TestFolder = try .init();
    defer folder.deinit();
    var session: Session = .init(gpa, testing.io, 2, &folder.diagnostic);
    defer session.deinit();
    try openForTest(&session);
    try session.view(.{ .resolution = .{ 12, 8 }, .environment = .{ .source = .none } });
    const choices: settings.Write = .{ .format = .ppm, .exposure = .auto };
    const shown_path = try folder.pathOf("shown.ppm");
    defer gpa.free(shown_path);
    var image: ProgressImage = try .open(
        testing.io,
        &folder.temporaries,
        shown_path,
        choices,
        &folder.diagnostic,
    );
    defer image.close();
    image.interval_ns = 0;
    session.progress_image = &image;
    try session.render(.{ .integrator = .path, .sample_count = 3 });
    const whole_hash = session.film.?.hash();
    session.progress_image = null;
    try session.render(.{ .integrator = .path, .sample_count = 3 });
    try testing.expectEqual(whole_hash, session.film.?.hash());

    // It was shown for the last time before the last round, of the third sample.
    try session.render(.{ .integrator = .path, .sample_count = 2 });
    const path = try folder.pathOf("two.ppm");
    defer gpa.free(path);
    var target: output.Target =
        try .openFile(testing.io, &folder.temporaries, path, &folder.diagnostic);
    try session.write(&target, choices);
    const wanted = try folder.read("two.ppm");
    defer gpa.free(wanted);
    const shown = try folder.read("shown.ppm");
    defer gpa.free(shown);
    try testing.expectEqualSlices(u8, wanted, shown);
    var entries = folder.folder.dir.iterate();
    var count: usize = 0;
    while (try entries.next(testing.io)) |_| count += 1;
    try testing.expectEqual(2, count);
}
