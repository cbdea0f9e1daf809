//! Parts of a picture -> the picture, the same bits as if it had been rendered at once.
//!
//! In: files that parts were written to (`part.zig`), which may be anybody's. Out: a finished film
//! and how it is to be written. First all headers are read: whether the parts are of one picture,
//! and each pixel of it is in one of them. Only then is there memory for the film, which is no more
//! than what the files can hold; their pixels are read one file after the other. What needs the
//! whole, denoising, comes last.

const std = @import("std");
const decode = @import("decode.zig");
const denoise = @import("denoise.zig");
const film_file = @import("film.zig");
const huge_pages = @import("huge_pages.zig");
const output = @import("output.zig");
const parallel = @import("parallel.zig");
const parse_resource = @import("parse/resource.zig");
const part_file = @import("part.zig");
const settings = @import("settings.zig");
const Allocator = std.mem.Allocator;
const Diagnostic = @import("diagnostic.zig").Diagnostic;
const Film = film_file.Film;
const Identity = @import("identity.zig").Identity;
const Layout = film_file.Layout;
const Manifest = @import("manifest.zig").Manifest;
const Record = part_file.Record;
const openexr = decode.openexr;
const quote = @import("diagnostic.zig").quote;

/// `InvalidInput`: the files are not the parts of one picture.
pub const Error = parse_resource.Error || parallel.Error;

/// What is to be merged.
pub const Settings = struct {
    /// Of the program.
    version: []const u8,
    pool: *parallel.Pool,
    /// The file that is about to be replaced.
    output: ?Identity = null,
};

/// A picture that was rendered in parts.
pub const Merged = struct {
    gpa: Allocator,
    arena: std.heap.ArenaAllocator,
    film: Film,
    /// Of the first part: what all have in common.
    record: Record,
    /// Of all of them.
    manifest: ?Manifest,

    /// Frees everything.
    pub fn deinit(merged: *Merged) void {
        merged.film.deinit(merged.gpa);
        merged.arena.deinit();
        merged.* = undefined;
    }

    /// Refuses what a file cannot hold.
    pub fn checkWrite(
        merged: *const Merged,
        format: settings.Format,
        diagnostic: *Diagnostic,
    ) error{InputOutput}!void {
        const record = &merged.record;
        if (format != .exr and record.further.len > 0) return diagnostic.fail(
            error.InputOutput,
            "the parts have layers, which are not in a {t} file, but in an exr file",
            .{format},
        );
        const width, const height = .{ record.width, record.height };
        return output.check(format, record.transparent, width, height, diagnostic);
    }

    /// Encodes the picture and moves it to its place. Closes the target in any case.
    pub fn write(
        merged: *const Merged,
        format: settings.Format,
        pool: *parallel.Pool,
        target: *output.Target,
        diagnostic: *Diagnostic,
    ) output.Error!void {
        defer target.abandon();
        try merged.checkWrite(format, diagnostic);
        const record = &merged.record;
        var room: [std.enums.values(settings.Layer).len]output.Further = undefined;
        const further = room[0..record.further.len];
        for (further, record.further) |*to, layer| to.* = .{
            .layer = layer,
            .image = merged.film.imageOf(film_file.layerOf(layer)).?,
        };
        _ = try output.write(merged.gpa, .{
            .image = &merged.film.image,
            .display = merged.film.imageOf(.display),
        }, .{
            .format = format,
            .exposure_ev = if (output.isLinear(format)) 0 else record.exposure_ev,
            .tone_mapping = record.tone_mapping,
            .transparent = record.transparent,
            .background = record.background,
            .jpeg_quality = record.jpeg_quality,
            .webp_quality = record.webp_quality,
            .manifest = if (merged.manifest) |*manifest| manifest else null,
            .exr_kind = record.exr_kind,
            .frame_rate = record.frame_rate,
            .further = further,
            .pool = pool,
        }, target, diagnostic);
    }
};

/// Reads the parts, at least one. Where the diagnostic's place is empty, what it says is of all.
pub fn run(
    gpa: Allocator,
    io: std.Io,
    paths: []const []const u8,
    chosen: Settings,
    diagnostic: *Diagnostic,
) Error!Merged {
    var arena: std.heap.ArenaAllocator = .init(gpa);
    errdefer arena.deinit();
    var merger: Merger = .{
        .gpa = gpa,
        .arena = arena.allocator(),
        .io = io,
        .paths = paths,
        .chosen = chosen,
        .diagnostic = diagnostic,
        .records = try arena.allocator().alloc(Record, paths.len),
    };
    for (0..paths.len) |index| try merger.readRecord(index);
    try merger.checkCover();
    var record = merger.records[0];
    var manifest: ?Manifest = null;
    for (merger.records) |*other| {
        record.sample_count = @max(record.sample_count, other.sample_count);
        const names = if (other.manifest) |*names| names.manifestOf() else continue;
        const before: Manifest = manifest orelse .{};
        manifest = try before.joinedWith(merger.arena, &names);
    }
    var film: Film = try .init(gpa, record.width, record.height, record.layerSet());
    errdefer film.deinit(gpa);
    for (0..paths.len) |index| try merger.place(index, &film);
    if (record.denoise) {
        if (record.sample_count >= denoise.sample_count_min)
            try denoise.run(gpa, &film, chosen.pool)
        else
            diagnostic.warn(denoise.too_few_samples, .{});
    }
    return .{
        .gpa = gpa,
        .arena = arena,
        .film = film,
        .record = record,
        .manifest = manifest,
    };
}

const Merger = struct {
    gpa: Allocator,
    arena: Allocator,
    io: std.Io,
    paths: []const []const u8,
    chosen: Settings,
    diagnostic: *Diagnostic,
    /// By path.
    records: []Record,

    /// A part's file, and what its header says.
    const Opened = struct {
        file: parse_resource.Scene,
        part: openexr.Part,

        fn bytes(opened: *const Opened) []const u8 {
            return opened.file.main.bytes;
        }
    };

    fn readRecord(merger: *Merger, index: usize) Error!void {
        errdefer merger.blame(index);
        const diagnostic = merger.diagnostic;
        var opened = try merger.open(index);
        defer opened.file.close();
        const text = try merger.arena.dupe(u8, opened.part.text.?);
        const record = try part_file.read(merger.arena, text, merger.chosen.version, diagnostic);
        merger.records[index] = record;
        if (record.is_partial)
            return diagnostic.invalid("it was stopped before it was finished", .{});
        var layout = try merger.layoutOf(&record);
        defer layout.deinit(merger.gpa);
        if (!isOf(&opened.part, &layout)) return diagnostic.invalid(
            "its pixels are not those that its attribute {s} tells of",
            .{part_file.attribute_name},
        );
        const first = &merger.records[0];
        if (record.differenceFrom(first)) |how|
            return diagnostic.invalid("{s} {f}", .{ how, quote(merger.paths[0]) });
        if (std.meta.activeTag(record.part) != first.part) return diagnostic.invalid(
            "it is a {t}, where {f} is a {t}",
            .{ record.part, quote(merger.paths[0]), first.part },
        );
        if (record.part == .tile and record.part.tile.count != first.part.tile.count)
            return diagnostic.invalid("it is one of {d} parts, where {f} is one of {d}", .{
                record.part.tile.count, quote(merger.paths[0]), first.part.tile.count,
            });
    }

    fn blame(merger: *const Merger, index: usize) void {
        merger.diagnostic.place.set("{s}", .{merger.paths[index]});
    }

    fn open(merger: *const Merger, index: usize) Error!Opened {
        const diagnostic = merger.diagnostic;
        const path = merger.paths[index];
        var file = try parse_resource
            .open(merger.gpa, merger.io, path, .{ .output = merger.chosen.output }, diagnostic);
        errdefer file.close();
        const part = openexr.partInfo(
            file.main.bytes,
            part_file.attribute_name,
            settings.side.max,
            settings.pixel_count_max,
            &diagnostic.message,
        ) catch {
            const why = diagnostic.message;
            return diagnostic.invalid("it is no part of a picture: {s}", .{why.text()});
        };
        if (part.text == null) return diagnostic.invalid(
            "it is no part of a picture: it has no attribute {s}",
            .{part_file.attribute_name},
        );
        return .{ .file = file, .part = part };
    }

    fn layoutOf(merger: *const Merger, record: *const Record) Error!Layout {
        return Layout.init(
            merger.gpa,
            record.width,
            record.height,
            record.part,
            .{},
            merger.diagnostic,
        ) catch |err| switch (err) {
            error.PartUnknown => error.InvalidInput,
            error.OutOfMemory => error.OutOfMemory,
        };
    }

    /// Refuses what is there twice or not at all.
    fn checkCover(merger: *Merger) Error!void {
        return switch (merger.records[0].part) {
            .whole => unreachable, // No record is.
            .tile => |tile| merger.checkTiles(tile.count),
            .crop => merger.checkCrops(),
        };
    }

    fn checkTiles(merger: *Merger, count: u32) Error!void {
        const diagnostic = merger.diagnostic;
        const by_number = try merger.arena.alloc(?usize, count);
        @memset(by_number, null);
        for (merger.records, 0..) |*record, index| {
            const number = record.part.tile.number;
            if (by_number[number - 1]) |other| {
                merger.blame(index);
                return diagnostic.invalid("it is part {d} of {d}, as {f} is", .{
                    number, count, quote(merger.paths[other]),
                });
            }
            by_number[number - 1] = index;
        }
        const missing = std.mem.findScalar(?usize, by_number, null) orelse return;
        const missing_count = std.mem.countScalar(?usize, by_number, null);
        if (missing_count == 1)
            return diagnostic.invalid("part {d} of {d} is missing", .{ missing + 1, count });
        return diagnostic.invalid("{d} of {d} parts are missing, the first is {d}", .{
            missing_count, count, missing + 1,
        });
    }

    fn checkCrops(merger: *Merger) Error!void {
        const diagnostic = merger.diagnostic;
        var covered: u64 = 0;
        for (merger.records, 0..) |*record, index| {
            const own = record.part.crop.pixels;
            for (merger.records[0..index], 0..) |*before, other_index| {
                const other = before.part.crop.pixels;
                const is_apart = own[0] >= other[2] or other[0] >= own[2] or
                    own[1] >= other[3] or other[1] >= own[3];
                if (is_apart) continue;
                merger.blame(index);
                return diagnostic.invalid(
                    "it has pixels that {f} has as well",
                    .{quote(merger.paths[other_index])},
                );
            }
            covered += @as(u64, own[2] - own[0]) * (own[3] - own[1]);
        }
        const first = &merger.records[0];
        const total = @as(u64, first.width) * first.height;
        if (covered < total) return diagnostic.invalid(
            "{d} of {d} pixels are in none of the parts",
            .{ total - covered, total },
        );
    }

    /// Reads a part's pixels into the film.
    fn place(merger: *Merger, index: usize, film: *Film) Error!void {
        errdefer merger.blame(index);
        const gpa = merger.gpa;
        const diagnostic = merger.diagnostic;
        const record = &merger.records[index];
        var opened = try merger.open(index);
        defer opened.file.close();
        var layout = try merger.layoutOf(record);
        defer layout.deinit(gpa);
        // It may be another file by now.
        if (!isOf(&opened.part, &layout))
            return diagnostic.invalid("it changed while it was read", .{});
        var names: [part_file.channel_count_max][*:0]const u8 = undefined;
        var images: [part_file.channel_count_max / 4]*film_file.Image = undefined;
        var count: usize = 0;
        for (record.layers) |layer| {
            if (layer == .alpha) continue;
            images[count] = switch (layer) {
                .color => &film.image,
                else => &film.apart.getPtr(layer).*.?,
            };
            for (names[4 * count ..][0..4], part_file.channelNames(layer)) |*to, name| to.* = name;
            count += 1;
        }
        const floats = openexr.decodePart(
            gpa,
            opened.bytes(),
            &opened.part,
            names[0 .. 4 * count],
            &diagnostic.message,
        ) catch |err| return switch (err) {
            error.InvalidImage => error.InvalidInput,
            error.OutOfMemory => error.OutOfMemory,
        };
        defer huge_pages.free(gpa, floats);
        scatter(&layout, floats, images[0..count]);
    }
};

/// Whether a file has the pixels of a part.
fn isOf(part: *const openexr.Part, layout: *const Layout) bool {
    const is_size = part.width == layout.film_width and part.height == layout.film_height;
    return is_size and switch (layout.form) {
        .window => |own| part.origin[0] == own[0] and part.origin[1] == own[1] and
            part.whole[0] == layout.width and part.whole[1] == layout.height,
        .share => true,
    };
}

/// Puts the pixels of a part, which has four floats for each image, where they are in the picture.
fn scatter(layout: *const Layout, floats: []const f32, images: []const *film_file.Image) void {
    for (0..layout.count()) |number| {
        const own = layout.windowAt(@intCast(number)).own;
        const on_film = own.onFilm();
        for (own.y0..own.y1, on_film.y0..) |y, row| {
            const start = row * layout.film_width + on_film.x0;
            for (own.x0..own.x1, start..) |x, at| {
                const pixel = floats[4 * images.len * at ..][0 .. 4 * images.len];
                for (images, 0..) |image, layer| {
                    image.at(@intCast(x), @intCast(y)).* = pixel[4 * layer ..][0..4].*;
                }
            }
        }
    }
}
