//! A picture of work under way, in a file that is replaced as a whole each time.
//!
//! In: films of the work so far. Out: the file, encoded as the output is. What goes wrong with it
//! once the work has begun is a warning, and ends no more than this.

const std = @import("std");
const output = @import("../output.zig");
const settings = @import("../settings.zig");
const film_file = @import("../film.zig");
const Diagnostic = @import("../diagnostic.zig").Diagnostic;
const Film = film_file.Film;
const Io = std.Io;

/// One file.
pub const ProgressImage = struct {
    io: Io,
    temporaries: *output.TemporaryFiles,
    path: []const u8,
    /// How it is encoded: as the output.
    choices: settings.Write,
    /// From one picture to the next.
    interval_ns: u64 = 2 * std.time.ns_per_s,
    /// For the next picture; null: to be opened.
    target: ?output.Target,
    /// Where the work so far is made a picture.
    film: ?Film = null,
    has_failed: bool = false,

    /// Opens the file, so that an error comes before the work. It is to be closed by `close`.
    pub fn open(
        io: Io,
        temporaries: *output.TemporaryFiles,
        path: []const u8,
        choices: settings.Write,
        diagnostic: *Diagnostic,
    ) output.TargetError!ProgressImage {
        return .{
            .io = io,
            .temporaries = temporaries,
            .path = path,
            .choices = choices,
            .target = try .openFile(io, temporaries, path, diagnostic),
        };
    }

    /// Leaves the latest picture.
    pub fn close(image: *ProgressImage) void {
        if (image.target) |*target| target.abandon();
        image.target = null;
    }

    /// Makes room for pictures. To be freed by `dropFilm`.
    pub fn size(image: *ProgressImage, gpa: std.mem.Allocator, film: *const Film) !void {
        const kept: film_file.Layers = .init(.{ .color = true, .alpha = true, .display = true });
        const layers = film.layers.intersectWith(kept);
        image.film = try .init(gpa, film.image.width, film.image.height, layers);
    }

    /// Frees the room.
    pub fn dropFilm(image: *ProgressImage, gpa: std.mem.Allocator) void {
        if (image.film) |*film| film.deinit(gpa);
        image.film = null;
    }

    /// Writes a film, as `chosen`.
    pub fn write(
        image: *ProgressImage,
        gpa: std.mem.Allocator,
        film: *const Film,
        chosen: output.Settings,
        diagnostic: *Diagnostic,
    ) void {
        if (image.has_failed) return;
        // What it says would be taken for what ends the program.
        var own: Diagnostic = .{};
        image.tryWrite(gpa, film, chosen, &own) catch |err| {
            image.has_failed = true;
            if (err != error.Canceled) diagnostic.warn("no more pictures of work under way: {s}", .{
                if (err == error.OutOfMemory) "out of memory" else own.message.text(),
            });
        };
    }

    fn tryWrite(
        image: *ProgressImage,
        gpa: std.mem.Allocator,
        film: *const Film,
        chosen: output.Settings,
        own: *Diagnostic,
    ) output.Error!void {
        if (image.target == null)
            image.target = try .openFile(image.io, image.temporaries, image.path, own);
        defer image.close();
        _ = try output.write(gpa, .{
            .image = &film.image,
            .display = film.imageOf(.display),
        }, chosen, &image.target.?, own);
    }
};
