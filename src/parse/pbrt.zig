//! PBRT scenes: a text in the dialects of PBRT's versions 2 and 3, and of 4 as far as they differ
//! in names, becomes a `Scene`.
//!
//! In: a path. Out: a checked `Scene`; nothing of the text remains. docs/pbrt.md tells what is
//! read, and what stands for what is not.

const std = @import("std");
const file = @import("file.zig");
const limits = @import("pbrt/limits.zig");
const Allocator = std.mem.Allocator;
const Assembly = @import("pbrt/assembly.zig");
const Diagnostic = @import("../diagnostic.zig").Diagnostic;
const Identity = @import("../identity.zig").Identity;
const Input = @import("pbrt/input.zig");
const Reader = @import("pbrt/reader.zig");
const Scene = @import("../scene.zig").Scene;
const Settings = @import("../settings.zig").Load;

/// See parse.zig.
pub const Error = Input.Error;

/// Reads the file at `path`; see `parse.parse`.
pub fn parse(
    gpa: Allocator,
    io: std.Io,
    path: []const u8,
    settings: Settings,
    diagnostic: *Diagnostic,
) Error!Scene {
    var reason: []const u8 = "";
    const opened = file.open(io, .cwd(), path, settings.output, &reason) catch
        return diagnostic.fail(error.InputOutput, "{s}", .{reason});
    const loaded = load: {
        defer opened.close(io);
        const identity: ?Identity = .of(opened.handle);
        const limit = limits.file_bytes_max;
        const bytes = file.readTerminated(gpa, io, opened, limit, &reason) catch |err|
            return switch (err) {
                error.OutOfMemory => error.OutOfMemory,
                error.TooLarge => diagnostic.fail(
                    error.InvalidInput,
                    "is over the limit of {d} bytes",
                    .{limit},
                ),
                else => diagnostic.fail(error.InputOutput, "{s}", .{reason}),
            };
        break :load Text{ .name = path, .bytes = bytes, .identity = identity };
    };
    const folder_path = std.fs.path.dirname(path) orelse ".";
    const folder = std.Io.Dir.cwd().openDir(io, folder_path, .{}) catch {
        gpa.free(loaded.bytes);
        return diagnostic.fail(error.InputOutput, "its folder cannot be opened", .{});
    };
    defer folder.close(io);
    return read(gpa, io, loaded, folder, std.fs.path.dirname(path) orelse "", settings, diagnostic);
}

/// A text to start from. `read` takes over the bytes.
const Text = struct { name: []const u8, bytes: [:0]u8, identity: ?Identity };

/// Reads a text that is in memory; what it names is looked for in `folder`.
pub fn parseBytes(
    gpa: Allocator,
    io: std.Io,
    bytes: []const u8,
    folder: std.Io.Dir,
    settings: Settings,
    diagnostic: *Diagnostic,
) Error!Scene {
    const copy = try gpa.dupeSentinel(u8, bytes, 0);
    const text: Text = .{ .name = "text", .bytes = copy, .identity = null };
    return read(gpa, io, text, folder, "", settings, diagnostic);
}

fn read(
    gpa: Allocator,
    io: std.Io,
    text: Text,
    folder: std.Io.Dir,
    folder_name: []const u8,
    settings: Settings,
    diagnostic: *Diagnostic,
) Error!Scene {
    var input: Input = .{
        .gpa = gpa,
        .io = io,
        .folder = folder,
        .folder_name = folder_name,
        .settings = settings,
        .diagnostic = diagnostic,
        .bytes_read = text.bytes.len,
    };
    defer input.deinit();
    try input.push(text.name, text.bytes, text.identity);
    var scene: Scene = .init(gpa);
    errdefer scene.deinit();
    var names: std.heap.ArenaAllocator = .init(gpa);
    defer names.deinit();
    var assembly: Assembly = .{ .gpa = gpa, .input = &input, .scene = &scene };
    defer assembly.deinit();
    var reader: Reader = .{
        .input = &input,
        .arena = names.allocator(),
        .assembly = &assembly,
        .colors = .{ .arena = names.allocator(), .input = &input },
        .maker = .{ .input = &input, .arena = scene.arena.allocator() },
    };
    defer reader.deinit();
    try reader.run();
    try reader.finish(&scene);
    if (scene.triangleCount() == 0) diagnostic.warn("nothing to render: no triangles", .{});
    return scene;
}

test {
    _ = @import("pbrt/colors.zig");
    _ = @import("pbrt/lights.zig");
    _ = @import("pbrt/materials.zig");
    _ = @import("pbrt/number.zig");
    _ = @import("pbrt/parameters.zig");
    _ = @import("pbrt/shapes.zig");
    _ = @import("pbrt/spectra.zig");
    _ = @import("pbrt/transform.zig");
    _ = @import("pbrt/view.zig");
    _ = Assembly;
    _ = Input;
    _ = Reader;
}
