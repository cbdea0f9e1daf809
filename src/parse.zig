//! Stage 1: a scene file becomes a `Scene`.
//!
//! In: the path of a glTF 2.0 file, JSON or binary, or `builtin:NAME`. Out: a checked `Scene`, or
//! one line that says what is wrong. The format is chosen here and nowhere else.

const std = @import("std");
const Diagnostic = @import("diagnostic.zig").Diagnostic;
const Scene = @import("scene.zig").Scene;
const gltf = @import("parse/gltf.zig");
const Allocator = std.mem.Allocator;

/// Scenes that need no file.
pub const builtin = @import("parse/builtin.zig");

/// `InputOutput`: a file is missing or cannot be read. `InvalidInput`: it is read, but it is not
/// what it should be, or it needs what is not supported.
pub const Error = error{ OutOfMemory, InputOutput, InvalidInput };

/// What the user allows a file to do.
pub const Settings = gltf.Settings;

const builtin_prefix = "builtin:";

/// Reads the scene at `path`. On an error the diagnostic holds one line without the path in it;
/// what is odd but harmless becomes warnings there. The caller frees the scene with `deinit`.
pub fn parse(
    gpa: Allocator,
    io: std.Io,
    path: []const u8,
    settings: Settings,
    diagnostic: *Diagnostic,
) Error!Scene {
    if (std.mem.startsWith(u8, path, builtin_prefix)) {
        return builtin.build(gpa, path[builtin_prefix.len..], diagnostic);
    }
    if (std.ascii.endsWithIgnoreCase(path, ".pbrt")) {
        return diagnostic.fail(error.InvalidInput, "PBRT scenes are not read, only glTF 2.0", .{});
    }
    return gltf.parse(gpa, io, path, settings, diagnostic);
}

/// Reads a glTF file that is in memory, JSON or binary; what it names is looked for in `folder`.
/// Otherwise like `parse`.
pub const parseBytes = gltf.parseBytes;

test {
    _ = builtin;
    _ = gltf;
}

test "a scene is chosen by its prefix or its extension" {
    const gpa = std.testing.allocator;
    const io = std.testing.io;
    var diagnostic: Diagnostic = .{};
    for ([_][]const u8{ "builtin:no such", "a.pbrt", "A.PBRT" }) |path| {
        try std.testing.expectError(error.InvalidInput, parse(gpa, io, path, .{}, &diagnostic));
        try std.testing.expect(diagnostic.message.text().len > 0);
    }
    const missing = parse(gpa, io, "does not exist.glb", .{}, &diagnostic);
    try std.testing.expectError(error.InputOutput, missing);
}
