//! The pictures of one scene file in a batch: a session led from variant to camera, to frame, to
//! view, that makes anew only what has changed.
//!
//! In: a file, a plan, a session. Out: pictures by the names of the plan's template. What is
//! metered and framed automatically is so for one of them, the first unless the user says, and all
//! the others go by it.

const std = @import("std");
const batch_file = @import("batch.zig");
const console = @import("console.zig");
const facts = @import("facts.zig");
const raylane = @import("raylane");
const signals = @import("../signals.zig");
const stages = @import("stages.zig");
const Allocator = std.mem.Allocator;
const Batch = batch_file.Batch;
const Io = std.Io;
const Options = raylane.cli.Options;
const Progress = raylane.progress.Progress;
const Report = raylane.report.Report;
const Session = raylane.session.Session;
const Target = raylane.output.Target;
const printable = raylane.diagnostic.printable;
const settings = raylane.settings;
const template = raylane.batch.template;

/// See above. Must stay where it is.
pub const Pictures = struct {
    batch: *Batch,
    session: *Session,
    arena: std.heap.ArenaAllocator,
    file_index: u32,
    /// Of the picture under way.
    options: Options,
    values: template.Values,
    name: Io.Writer.Allocating,
    /// Of the picture under way, and how many have been begun.
    number: u32 = 0,
    begun_count: u32 = 0,
    start: Io.Timestamp,
    /// The first picture's place, open before the scene is read.
    ahead: ?Target = null,
    /// A file that takes several frames, one behind the other.
    film: ?Film = null,
    /// The frame that the session shows; null: none.
    posed: ?Posed = null,
    /// Nothing has been made of the scene since it was read.
    is_fresh: bool = false,
    /// Warnings that the user has seen.
    warning_count: usize = 0,

    const Film = struct { target: Target, name: []const u8, size: [2]u32 = .{ 0, 0 } };
    const Posed = struct { frame: i32, camera: settings.Camera };
    pub const Error = stages.Error;

    pub fn init(batch: *Batch, session: *Session, index: u32) Pictures {
        const gpa = session.gpa;
        const file = &batch.plan.files[index];
        var options = batch.options.*;
        options.scene = file.path;
        return .{
            .batch = batch,
            .session = session,
            .arena = .init(gpa),
            .file_index = index,
            .options = options,
            .values = .{ .model = file.model(), .layer = "color" },
            .name = .init(gpa),
            .start = Io.Clock.awake.now(batch.io),
        };
    }

    /// Frees everything; a film that is not finished is gone.
    pub fn deinit(pictures: *Pictures) void {
        if (pictures.ahead) |*target| target.abandon();
        if (pictures.film) |*film| film.target.abandon();
        pictures.name.deinit();
        pictures.arena.deinit();
    }

    /// Renders all of them.
    pub fn run(pictures: *Pictures) Error!void {
        const plan = &pictures.batch.plan;
        const load = &pictures.options.load;
        const is_known = !plan.names(.camera) and !plan.names(.material_variant);
        if (is_known) {
            if (!try pictures.wantsAny()) return;
            try pictures.openAhead();
        }
        if (!plan.names(.material_variant) or load.material_variant != .default) {
            try pictures.read();
            pictures.values.material_variant = try pictures.variantName();
            try pictures.runVariant();
        } else {
            try pictures.read();
            const names = try pictures.copyNames(pictures.session.scene.?.material_variants);
            if (names.len == 0) {
                pictures.values.material_variant = "default";
                try pictures.runVariant();
            } else for (names, 0..) |name, index| {
                load.material_variant = .{ .index = @intCast(index) };
                pictures.values.material_variant = name;
                try pictures.read();
                try pictures.runVariant();
            }
        }
        try pictures.finishFilm();
    }

    /// What messages call the place of the picture under way.
    pub fn place(pictures: *Pictures) []const u8 {
        return if (pictures.options.toStdout()) "standard output" else pictures.name.written();
    }

    /// Says the warnings that have not been said yet.
    pub fn sayWarnings(pictures: *Pictures) void {
        const diagnostic = pictures.session.diagnostic;
        const warnings = diagnostic.warnings[0..diagnostic.warning_count];
        if (!pictures.options.quiet) for (warnings[pictures.warning_count..]) |*warning|
            console.sayOf(pictures.batch.io, pictures.options.scene, "warning: {s}", .{
                warning.text(),
            });
        pictures.warning_count = warnings.len;
    }

    fn read(pictures: *Pictures) Error!void {
        const session = pictures.session;
        var load = pictures.options.load;
        if (pictures.ahead) |*target| load.output = target.replaces;
        session.reference = null;
        session.pool.thread_count = pictures.batch.threadCount();
        pictures.posed = null;
        pictures.is_fresh = true;
        try session.load(pictures.options.scene, load);
    }

    /// Names as parts of file names: by their index where they have none of their own.
    fn copyNames(
        pictures: *Pictures,
        names: []const []const u8,
    ) error{OutOfMemory}![]const []const u8 {
        const arena = pictures.arena.allocator();
        const copies = try arena.alloc([]const u8, names.len);
        for (copies, names, 0..) |*copy, name, index| {
            const is_alone = for (names, 0..) |other, place_of| {
                if (place_of != index and std.mem.eql(u8, other, name)) break false;
            } else true;
            copy.* = if (is_alone and name.len > 0)
                try arena.dupe(u8, name)
            else
                try arena.print("{d}", .{index});
        }
        return copies;
    }

    fn variantName(pictures: *Pictures) error{OutOfMemory}![]const u8 {
        const names = pictures.session.scene.?.material_variants;
        return switch (pictures.options.load.material_variant) {
            .default => "default",
            .name => |name| name,
            .index => |index| (try pictures.copyNames(names))[index],
        };
    }

    /// For each camera that the template asks for.
    fn runVariant(pictures: *Pictures) Error!void {
        const arena = pictures.arena.allocator();
        const cameras = pictures.session.scene.?.cameras;
        const all = try arena.alloc([]const u8, cameras.len);
        for (all, cameras) |*name, *camera| name.* = camera.name;
        const names = try pictures.copyNames(all);
        const camera = &pictures.options.view.camera;
        const asked = pictures.batch.options.view.camera;
        if (!pictures.batch.plan.names(.camera)) return pictures.runCamera();
        defer camera.* = asked;
        if (asked == .default and names.len > 0) {
            for (names, 0..) |name, index| {
                camera.* = .{ .index = @intCast(index) };
                pictures.values.camera = name;
                try pictures.runCamera();
            }
            return;
        }
        pictures.values.camera = switch (asked) {
            .default, .auto => "auto",
            .name => |name| name,
            // One that is not there is an error of the view.
            .index => |index| if (index < names.len) names[index] else "",
        };
        return pictures.runCamera();
    }

    /// All frames and views by one camera.
    fn runCamera(pictures: *Pictures) Error!void {
        if (!try pictures.wantsAny()) {
            pictures.number += @intCast(pictures.batch.plan.pictureCount());
            return;
        }
        const plan = &pictures.batch.plan;
        const chosen = &pictures.options.batch;
        const has_reference = plan.pictureCount() > 1 or chosen.reference_frame != null;
        var reference: Reference = .{};
        if (has_reference) reference = try pictures.refer();
        defer pictures.session.reference = null;
        for (plan.frames) |frame| for (plan.views, 0..) |view, index| {
            if (pictures.batch.isStopped()) return;
            defer pictures.number += 1;
            const count = plan.pictureCount();
            const progress = pictures.session.pool.progress;
            Progress.beginPicture(progress, pictures.number % count + 1, count);
            try pictures.setName(frame, view);
            if (pictures.isSkipped()) {
                pictures.batch.add(.skipped, 1);
                continue;
            }
            try pictures.pose(frame);
            if (has_reference) reference.turnTo(index);
            pictures.session.reference = if (has_reference) &reference.chosen else null;
            try pictures.make(view);
        };
    }

    const Reference = struct {
        chosen: raylane.session.Reference = undefined,
        /// How each view is framed, where that would change with the frame.
        framings: []const raylane.prepare.Reference = &.{},

        fn turnTo(reference: *Reference, view: usize) void {
            const framed = &reference.chosen.view;
            framed.view = if (reference.framings.len > 0) reference.framings[view].view else null;
        }
    };

    /// What all pictures of this camera have of the first one.
    fn refer(pictures: *Pictures) Error!Reference {
        const session = pictures.session;
        const plan = &pictures.batch.plan;
        const chosen = &pictures.options.batch;
        try pictures.pose(chosen.reference_frame orelse plan.frames[0]);
        session.reference = null;
        const is_moving = chosen.frames != null;
        const framings = try pictures.arena.allocator()
            .alloc(raylane.prepare.Reference, if (is_moving) plan.views.len else 0);
        // The first of all comes last, for it is what `refer` goes by.
        var index = framings.len;
        while (index > 0) {
            index -= 1;
            try session.view(pictures.viewOf(plan.views[index]));
            framings[index] = session.framing();
        }
        if (framings.len == 0 or plan.views[0] != 0) try session.view(pictures.viewOf(0));
        return .{
            .chosen = try session.refer(pictures.options.render, pictures.options.write),
            .framings = framings,
        };
    }

    /// Shows a frame, unless that is what is shown.
    fn pose(pictures: *Pictures, frame: i32) Error!void {
        const options = &pictures.options;
        const session = pictures.session;
        if (options.batch.frames != null)
            options.animation.time_s = options.write.frame_rate.timeOf(frame);
        if (pictures.posed) |posed| {
            const has_points = session.world.?.geometry.spheres.len > 0;
            const is_same = std.meta.eql(posed.camera, options.view.camera);
            // Points are as large as the camera's picture has pixels.
            if (posed.frame == frame and (is_same or !has_points)) return;
        }
        session.pool.thread_count = pictures.batch.threadCount();
        try stages.pose(session, options);
        pictures.posed = .{ .frame = frame, .camera = options.view.camera };
    }

    /// One of the views around the scene.
    fn viewOf(pictures: *const Pictures, view: i32) settings.View {
        var chosen = pictures.options.view;
        const count = pictures.options.batch.view_count orelse return chosen;
        const orbit = &chosen.viewpoint.orbit.?;
        orbit.theta_degrees += @floatCast(360 * @as(f64, @floatFromInt(view)) /
            @as(f64, @floatFromInt(count)));
        return chosen;
    }

    /// Renders the picture that is named, and says so.
    fn make(pictures: *Pictures, view: i32) Error!void {
        const session = pictures.session;
        const options = &pictures.options;
        var target = try pictures.open();
        defer target.abandon();
        try session.view(pictures.viewOf(view));
        pictures.sayWarnings();
        if (pictures.begun_count == 1) facts.say(pictures.batch.io, options, session);
        try stages.check(session, options);
        if (pictures.isAlone()) session.dropScene();
        session.pool.thread_count = pictures.batch.threadCount();
        try session.render(options.render);
        try pictures.sizeFilm();
        // First, so that where there is the picture there are its layers.
        try pictures.writeLayers();
        try stages.write(session, &target, options, null);
        const report = try stages.report(session, options, pictures.place());
        pictures.batch.add(.written, 1);
        try pictures.say(&report);
    }

    /// Layers in files of their own, where the names say so.
    fn writeLayers(pictures: *Pictures) Error!void {
        const values = &pictures.values;
        const write = &pictures.options.write;
        if (!write.layers_apart) return;
        const color = values.layer;
        var layers = pictures.options.render.layers.iterator();
        while (layers.next()) |layer| {
            values.layer = @tagName(layer);
            try pictures.setName(values.frame, values.view);
            if (pictures.isSkipped()) continue;
            try pictures.claim();
            var target = try pictures.openFile();
            try stages.write(pictures.session, &target, &pictures.options, layer);
        }
        values.layer = color;
        try pictures.setName(values.frame, values.view);
    }

    /// Whether nothing else is to be made of the file.
    fn isAlone(pictures: *const Pictures) bool {
        const plan = &pictures.batch.plan;
        return plan.pictureCount() == 1 and !plan.names(.camera) and !plan.names(.material_variant);
    }

    fn setName(pictures: *Pictures, frame: i32, view: i32) error{OutOfMemory}!void {
        pictures.values.frame = frame;
        pictures.values.view = view;
        pictures.name.clearRetainingCapacity();
        const text = pictures.batch.plan.template orelse return;
        template.write(text, &pictures.values, &pictures.name.writer) catch
            return error.OutOfMemory;
    }

    /// Whether the picture that is named is there, and is to stay.
    fn isSkipped(pictures: *Pictures) bool {
        if (!pictures.options.batch.skip_existing or pictures.options.toStdout()) return false;
        const path = pictures.name.written();
        // A film is there when all of it is.
        if (pictures.film) |*film| if (std.mem.eql(u8, film.name, path)) return false;
        return if (Io.Dir.cwd().access(pictures.batch.io, path, .{})) true else |_| false;
    }

    /// Whether there is a picture to be made by this camera and variant. If not, they are counted.
    fn wantsAny(pictures: *Pictures) error{OutOfMemory}!bool {
        if (!pictures.options.batch.skip_existing) return true;
        const plan = &pictures.batch.plan;
        for (plan.frames) |frame| for (plan.views) |view| {
            try pictures.setName(frame, view);
            if (!pictures.isSkipped()) return true;
        };
        pictures.batch.add(.skipped, plan.pictureCount());
        return false;
    }

    /// Opens the place of the first picture, so that an error comes before the work.
    fn openAhead(pictures: *Pictures) Error!void {
        if (pictures.options.toStdout()) return;
        const plan = &pictures.batch.plan;
        for (plan.frames) |frame| for (plan.views) |view| {
            try pictures.setName(frame, view);
            if (pictures.isSkipped()) continue;
            pictures.ahead = try pictures.openFile();
            return;
        };
    }

    /// The place of the picture that is named.
    fn open(pictures: *Pictures) Error!Target {
        const is_film = pictures.options.write.format == .y4m;
        pictures.options.write.is_continued = is_film and pictures.begun_count > 0;
        pictures.begun_count += 1;
        if (pictures.options.toStdout()) return .openStdout(pictures.batch.io);
        const path = pictures.name.written();
        if (pictures.film) |*film| {
            if (std.mem.eql(u8, film.name, path)) return film.target.part();
            try pictures.finishFilm();
        }
        pictures.options.write.is_continued = false;
        try pictures.claim();
        const target = pictures.ahead orelse try pictures.openFile();
        pictures.ahead = null;
        if (!is_film) return target;
        pictures.film = .{
            .target = target,
            .name = try pictures.arena.allocator().dupe(u8, path),
        };
        return pictures.film.?.target.part();
    }

    /// Makes the name this picture's, which nobody else may have.
    fn claim(pictures: *Pictures) Error!void {
        const is_own = try pictures.batch.claim(pictures.name.written(), .{
            .file = pictures.file_index,
            .number = pictures.number,
        });
        if (!is_own) return pictures.session.diagnostic.fail(
            error.OutputFailed,
            "it is the name of another picture, too",
            .{},
        );
    }

    fn openFile(pictures: *Pictures) error{OutputFailed}!Target {
        const io = pictures.batch.io;
        const path = pictures.name.written();
        if (std.fs.path.dirname(path)) |folder| makeFolders(io, folder);
        const diagnostic = pictures.session.diagnostic;
        return Target.openFile(io, &signals.temporary_files, path, diagnostic) catch
            error.OutputFailed;
    }

    /// All frames of a film have one size.
    fn sizeFilm(pictures: *Pictures) error{OutputFailed}!void {
        const film = if (pictures.film) |*film| film else return;
        const view = &pictures.session.world.?.view;
        const size: [2]u32 = .{ view.width, view.height };
        if (film.size[0] == 0) film.size = size;
        if (std.meta.eql(film.size, size)) return;
        return pictures.session.diagnostic.fail(
            error.OutputFailed,
            "a film of {d}x{d} pixels has no place for a frame of {d}x{d}",
            .{ film.size[0], film.size[1], size[0], size[1] },
        );
    }

    fn finishFilm(pictures: *Pictures) error{OutputFailed}!void {
        const film = if (pictures.film) |*film| film else return;
        defer pictures.film = null;
        film.target.finish(&.{}, pictures.session.diagnostic) catch return error.OutputFailed;
    }

    /// A line, and the report where that is asked for.
    fn say(pictures: *Pictures, measured: *const Report) error{OutOfMemory}!void {
        const batch = pictures.batch;
        const options = &pictures.options;
        const now = Io.Clock.awake.now(batch.io);
        const taken_ns: u64 = @intCast(pictures.start.durationTo(now).toNanoseconds());
        pictures.start = now;
        const seconds = @as(f64, @floatFromInt(taken_ns)) / std.time.ns_per_s;
        // Not among lines for programs.
        const is_told = options.progress.form == .json and options.progress.file == null;
        if (!options.quiet and !is_told) console.sayOf(
            batch.io,
            options.scene,
            "{f}, {d}x{d}, {d:.2} s",
            .{ printable(measured.output), measured.width, measured.height, seconds },
        );
        var warnings: [raylane.diagnostic.warning_count_max][]const u8 = undefined;
        var report = measured.*;
        report.warnings = pictures.session.diagnostic.warningTexts(&warnings);
        report.times.total_ns = taken_ns;
        if (!pictures.is_fresh) {
            report.times.parse_ns = 0;
            report.times.texture_ns = 0;
        }
        pictures.is_fresh = false;
        var text: Io.Writer.Allocating = .init(pictures.session.gpa);
        defer text.deinit();
        const written = switch (options.stats orelse .none) {
            .none => return,
            .text => raylane.report.writeText(&report, &text.writer),
            .json => raylane.report.writeJson(&report, &text.writer),
        };
        written catch return error.OutOfMemory;
        if (options.toStdout())
            console.say(batch.io, "{s}", .{text.written()})
        else
            batch.print(text.written());
    }
};

/// Makes a folder and those above it, as far as that goes: where one is missing, opening a file in
/// it says so.
pub fn makeFolders(io: Io, folder: []const u8) void {
    const cwd: Io.Dir = .cwd();
    if (cwd.access(io, folder, .{})) return else |_| {}
    for (1..folder.len + 1) |end| {
        if (end < folder.len and folder[end] != '/') continue;
        cwd.createDir(io, folder[0..end], .default_dir) catch {}; // It may be there.
    }
}
