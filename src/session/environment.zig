//! The environment of a session: its map is made once for as many views as have the same.

const std = @import("std");
const parse_resource = @import("../parse/resource.zig");
const prepare = @import("../prepare.zig");
const scene_file = @import("../scene.zig");
const settings = @import("../settings.zig");
const Allocator = std.mem.Allocator;
const Diagnostic = @import("../diagnostic.zig").Diagnostic;
const Identity = @import("../identity.zig").Identity;
const Pool = @import("../parallel.zig").Pool;
const Reason = @import("../diagnostic.zig").Message;
const Scene = scene_file.Scene;
const vec3 = @import("../math.zig").vec3;

/// `InvalidInput`: the user's own file is no image; `InputOutput`: it cannot be read.
pub const Error = prepare.EnvironmentError || parse_resource.Error;

/// The map that was made last.
pub const Environment = struct {
    made: ?prepare.OwnedEnvironmentMap = null,
    /// What it was made of.
    source: settings.Environment.Source = .none,

    /// Frees everything.
    pub fn deinit(environment: *Environment) void {
        environment.drop();
    }

    /// Forgets the map of a scene that is gone.
    pub fn dropScene(environment: *Environment) void {
        if (environment.source == .default) environment.drop();
    }

    fn drop(environment: *Environment) void {
        if (environment.made) |*made| made.deinit();
        environment.* = .{};
    }

    /// How the scene is surrounded by what the user chose. The user's own file must be an image;
    /// where the scene's is none, a warning says so. It must not be `output`, which is about to be
    /// replaced. `has_ambient`: the user chose light from everywhere.
    pub fn choose(
        environment: *Environment,
        gpa: Allocator,
        io: std.Io,
        pool: *Pool,
        scene: *const Scene,
        choice: *const settings.Environment,
        has_ambient: bool,
        output: ?Identity,
        diagnostic: *Diagnostic,
    ) Error!prepare.EnvironmentSettings {
        const source = sourceFor(scene, choice.source, has_ambient);
        var chosen: prepare.EnvironmentSettings = .{
            .is_default = choice.source == .default and source == .studio,
            .is_studio = source == .studio,
            .scale = @splat(choice.intensity),
            .rotation_deg = choice.rotation_deg,
        };
        if (!isSame(source, environment.source)) {
            environment.drop();
            environment.made = switch (source) {
                .none => null,
                .studio => try make(gpa, pool, .studio, diagnostic),
                .white => try make(gpa, pool, .white, diagnostic),
                .file => |path| try fromFile(gpa, io, pool, path, output, diagnostic),
                .default => try ofScene(gpa, pool, scene, diagnostic),
            };
            environment.source = source;
        }
        if (environment.made) |*made| chosen.map = &made.map;
        if (source == .default) if (scene.environment) |*from| {
            chosen.scale = vec3.mul(chosen.scale, from.scale);
            chosen.to_map = from.rotation;
        };
        return chosen;
    }
};

/// What is to be made; `default`: the scene's own.
fn sourceFor(
    scene: *const Scene,
    chosen: settings.Environment.Source,
    has_ambient: bool,
) settings.Environment.Source {
    if (chosen != .default) return chosen;
    if (scene.environment != null) return .default;
    if (scene.ambient != null) return .none;
    return if (has_ambient and scene.lights.len > 0) .none else .studio;
}

fn isSame(left: settings.Environment.Source, right: settings.Environment.Source) bool {
    if (std.meta.activeTag(left) != std.meta.activeTag(right)) return false;
    return left != .file or std.mem.eql(u8, left.file, right.file);
}

fn fromFile(
    gpa: Allocator,
    io: std.Io,
    pool: *Pool,
    path: []const u8,
    output: ?Identity,
    diagnostic: *Diagnostic,
) Error!prepare.OwnedEnvironmentMap {
    errdefer diagnostic.place.set("{s}", .{path});
    var opened = try parse_resource.open(gpa, io, path, .{ .output = output }, diagnostic);
    defer opened.close();
    return make(gpa, pool, .{ .image = .{ .bytes = opened.main.bytes } }, diagnostic);
}

/// Null where the scene's image is none.
fn ofScene(
    gpa: Allocator,
    pool: *Pool,
    scene: *const Scene,
    diagnostic: *Diagnostic,
) Error!?prepare.OwnedEnvironmentMap {
    const map = &scene.environment.?;
    const image = &scene.images[map.image];
    var reason: Reason = .{};
    var source: prepare.EnvironmentSource =
        .{ .image = .{ .bytes = image.bytes, .projection = map.projection } };
    if (map.projection == .cube) {
        for (map.faces, &source.image.faces) |face, *bytes| bytes.* = scene.images[face].bytes;
    }
    return prepare.makeEnvironment(gpa, source, pool, &reason) catch |err| {
        if (err != error.InvalidImage) return @errorCast(err);
        diagnostic.warn("{s}: the environment is not shown: {s}", .{ image.name, reason.text() });
        return null;
    };
}

fn make(
    gpa: Allocator,
    pool: *Pool,
    source: prepare.EnvironmentSource,
    diagnostic: *Diagnostic,
) Error!prepare.OwnedEnvironmentMap {
    const reason = &diagnostic.message;
    return prepare.makeEnvironment(gpa, source, pool, reason) catch |err| switch (err) {
        error.InvalidImage => error.InvalidInput,
        else => |other| other,
    };
}
