//! Stage 1: a scene file becomes a `Scene`.
//!
//! In: the path of a file, or standard input: glTF 2.0 (JSON or binary), PBRT, OBJ, STL or PLY, or
//! gzip of it. Out: a checked `Scene`, or one line that says what is wrong. What format it is,
//! its contents tell, and that is found out here and nowhere else.

const std = @import("std");
const Diagnostic = @import("diagnostic.zig").Diagnostic;
const File = @import("scene.zig").File;
const Scene = @import("scene.zig").Scene;
const gzip = @import("decode.zig").gzip;
const format_file = @import("parse/format.zig");
const gltf = @import("parse/gltf.zig");
const obj = @import("parse/obj.zig");
const pbrt = @import("parse/pbrt.zig");
const ply_scene = @import("parse/ply_scene.zig");
const progress_file = @import("progress.zig");
const settings_file = @import("settings.zig");
const stl = @import("parse/stl.zig");
const Settings = settings_file.Load;
const Allocator = std.mem.Allocator;
const Resources = @import("parse/resource.zig");

/// Extensions of glTF: what becomes of each.
pub const extensions = @import("parse/gltf/extensions.zig");

/// `InputOutput`: a file is missing or cannot be read. `InvalidInput`: it is read, but it is not
/// what it should be, or it needs what is not supported. `SceneUnknown`,
/// `MaterialVariantUnknown`: none of its scenes, or variants, is the one that is asked for.
pub const Error = Resources.Error || error{ SceneUnknown, MaterialVariantUnknown };

/// What messages call the scene that the user names so.
pub fn title(path: []const u8) []const u8 {
    const is_input = std.mem.eql(u8, path, settings_file.standard_input);
    return if (is_input) "standard input" else path;
}

/// Reads the scene at `path`. On an error the diagnostic holds one line without the path in it;
/// what is odd but harmless becomes warnings there. The caller frees the scene with `deinit`.
pub fn parse(
    gpa: Allocator,
    io: std.Io,
    path: []const u8,
    settings: Settings,
    diagnostic: *Diagnostic,
) Error!Scene {
    var opened = try Resources.open(gpa, io, path, settings, diagnostic);
    defer opened.close();
    return read(&opened, path, diagnostic);
}

/// Reads a file that is in memory and is called `name`; what it names is looked for in `folder`.
/// Otherwise like `parse`.
pub fn parseNamed(
    gpa: Allocator,
    io: std.Io,
    name: []const u8,
    bytes: []const u8,
    folder: std.Io.Dir,
    settings: Settings,
    diagnostic: *Diagnostic,
) Error!Scene {
    const copy = try gpa.dupeSentinel(u8, bytes, 0);
    var opened: Resources.Scene = .{
        .main = .{ .bytes = copy, .identity = null },
        .resources = .{
            .gpa = gpa,
            .io = io,
            .folder = folder,
            .settings = settings,
            .bytes_read = bytes.len,
        },
    };
    defer gpa.free(opened.main.bytes);
    return read(&opened, name, diagnostic);
}

/// Reads what has been opened, by its contents.
fn read(opened: *Resources.Scene, path: []const u8, diagnostic: *Diagnostic) Error!Scene {
    diagnostic.strict = opened.resources.settings.strict;
    const gpa = opened.resources.gpa;
    var arena: std.heap.ArenaAllocator = .init(gpa);
    defer arena.deinit();
    var listing: Resources.Listing = .{ .arena = arena.allocator() };
    opened.resources.listing = &listing;
    defer opened.resources.listing = null;
    try listing.add(std.fs.path.basename(path), opened.main.bytes.len);
    try unpack(opened, path, diagnostic);
    const main = &opened.main;
    const resources = &opened.resources;
    const settings = &resources.settings;
    const format = settings.format orelse try formatOf(main.bytes, path, diagnostic);
    if (format != .gltf and format != .glb) try checkOnly(settings.*, diagnostic);
    var scene = try switch (format) {
        .gltf, .glb => gltf.read(resources, main.bytes, diagnostic),
        .pbrt => pbrt.read(resources, title(path), main.*, diagnostic),
        .obj => obj.read(resources, path, main.bytes, diagnostic),
        .stl => stl.read(resources, main.bytes, diagnostic),
        .ply => ply_scene.read(resources, main.bytes, diagnostic),
    };
    errdefer scene.deinit();
    try diagnostic.failIfRefused();
    const triangle_count = placedCount(&scene);
    const triangle_count_max = resources.triangleCountMax();
    if (triangle_count > triangle_count_max) return diagnostic.invalid(
        "it places {d} triangles, more than {d} (see --max-triangles)",
        .{ triangle_count, triangle_count_max },
    );
    scene.file.byte_count = resources.bytes_read;
    scene.file.files = try filesOf(scene.arena.allocator(), &listing);
    return scene;
}

/// Triangles of a point, or of a line's piece, at the least.
const stroke_triangle_count = 8;

/// Triangles that all instances are, points and lines counted.
fn placedCount(scene: *const Scene) u64 {
    var count: u64 = 0;
    for (scene.instances) |instance| {
        const mesh = &scene.meshes[instance.mesh];
        const stroke_count = @as(u64, mesh.points.len) + mesh.segments.len;
        count +|= mesh.triangles.len + stroke_triangle_count * stroke_count;
    }
    return count;
}

/// What was read, in memory from `arena`.
fn filesOf(
    arena: Allocator,
    listing: *const Resources.Listing,
) Allocator.Error![]const File.Source {
    const files = try arena.alloc(File.Source, listing.byte_counts.count());
    const paths = listing.byte_counts.keys();
    for (files, paths, listing.byte_counts.values()) |*file, path, byte_count| {
        file.* = .{ .path = try arena.dupe(u8, path), .byte_count = byte_count };
    }
    return files;
}

/// Puts what a gzip file holds in its place.
fn unpack(opened: *Resources.Scene, path: []const u8, diagnostic: *Diagnostic) Error!void {
    const packed_bytes = opened.main.bytes;
    if (!gzip.isGzip(packed_bytes)) return;
    opened.main.bytes = opened.resources.inflate(
        packed_bytes,
        Resources.file_bytes_max,
        &diagnostic.message,
    ) catch |err| switch (err) {
        error.OutOfMemory => |failure| return failure,
        error.InvalidGzip => return error.InvalidInput,
    };
    if (!std.ascii.endsWithIgnoreCase(path, ".gz") and
        !std.mem.eql(u8, path, settings_file.standard_input))
        diagnostic.forgive("is gzip without being called so", .{});
    opened.resources.gpa.free(packed_bytes);
}

/// What a file is to be read as, or what else it is.
fn formatOf(
    bytes: []const u8,
    path: []const u8,
    diagnostic: *Diagnostic,
) Error!settings_file.SceneFormat {
    return switch (format_file.recognize(bytes, path)) {
        .format => |format| format,
        .gzip => diagnostic.invalid("is a gzip file within another one; unpack it", .{}),
        .foreign => |what| diagnostic.invalid("is {s}", .{what}),
        .unknown => diagnostic.invalid(
            "is no glTF, PBRT, OBJ, STL or PLY file by its contents (see --format-in)",
            .{},
        ),
    };
}

/// Whether what has but one scene, without a name, and no variants is asked for that.
pub fn checkOnly(
    settings: Settings,
    diagnostic: *Diagnostic,
) error{ SceneUnknown, MaterialVariantUnknown }!void {
    const is_only = switch (settings.scene) {
        .default => true,
        .index => |index| index == 0,
        .name => false,
    };
    if (!is_only) return diagnostic.fail(error.SceneUnknown, "there is but one scene, 0", .{});
    if (settings.material_variant != .default)
        return diagnostic.fail(error.MaterialVariantUnknown, "it has no material variants", .{});
}

/// Reads a glTF file that is in memory, JSON or binary, whatever it seems to be. Otherwise like
/// `parseNamed`.
pub fn parseBytes(
    gpa: Allocator,
    io: std.Io,
    bytes: []const u8,
    folder: std.Io.Dir,
    settings: Settings,
    diagnostic: *Diagnostic,
) Error!Scene {
    var own = settings;
    own.format = .gltf;
    return parseNamed(gpa, io, "text", bytes, folder, own, diagnostic);
}

/// The same for a PBRT text.
pub fn parsePbrt(
    gpa: Allocator,
    io: std.Io,
    bytes: []const u8,
    folder: std.Io.Dir,
    settings: Settings,
    diagnostic: *Diagnostic,
) Error!Scene {
    var own = settings;
    own.format = .pbrt;
    return parseNamed(gpa, io, "text", bytes, folder, own, diagnostic);
}

test {
    _ = Resources;
    _ = @import("parse/cgltf.zig");
    _ = @import("parse/file_search.zig");
    _ = format_file;
    _ = gltf;
    _ = pbrt;
    _ = @import("parse/number.zig");
    _ = @import("parse/orientation.zig");
    _ = @import("parse/plain.zig");
    _ = @import("parse/ply.zig");
    _ = obj;
    _ = ply_scene;
    _ = @import("parse/polygon.zig");
    _ = stl;
    _ = @import("parse/stream.zig");
}

test "what does not exist is of no format" {
    const gpa = std.testing.allocator;
    const io = std.testing.io;
    var diagnostic: Diagnostic = .{};
    for ([_][]const u8{ "does not exist.glb", "a.pbrt", "A.PBRT" }) |path| {
        const missing = parse(gpa, io, path, .{}, &diagnostic);
        try std.testing.expectError(error.InputOutput, missing);
    }
}

test "the text of a PBRT scene tells how far it is read" {
    const Reading = struct {
        stage: ?progress_file.Stage = null,

        fn begun(context: *anyopaque, work: *const progress_file.Work) void {
            const reading: *@This() = @ptrCast(@alignCast(context));
            reading.stage = work.stage;
        }
    };
    var reading: Reading = .{};
    var progress: progress_file.Progress = .{ .context = &reading, .begun = Reading.begun };
    var diagnostic: Diagnostic = .{};
    const text = "WorldBegin Shape \"sphere\" WorldEnd";
    const gpa = std.testing.allocator;
    const io = std.testing.io;
    var scene = try parsePbrt(gpa, io, text, .cwd(), .{ .progress = &progress }, &diagnostic);
    defer scene.deinit();
    try std.testing.expectEqual(.parsing, reading.stage.?);
    try std.testing.expectEqual(text.len + 1, progress.total.load(.monotonic));
    const done = progress.done.load(.monotonic);
    try std.testing.expect(done > "WorldBegin Shape".len and done <= text.len);
}
