//! What a batch is to make: files, frames and views, and a name for each picture.
//!
//! In: scene files, what is asked for, a template of names. Out: a plan in which no two pictures
//! have one name, as far as that is known before files are read, or what is wrong with it.

const std = @import("std");
const diagnostic = @import("../diagnostic.zig");
const frames_file = @import("frames.zig");
const template_file = @import("template.zig");
const Allocator = std.mem.Allocator;
const File = @import("inputs.zig").File;
const Message = diagnostic.Message;
const quote = diagnostic.quote;

/// What is asked for.
pub const Wanted = struct {
    /// A range of frames, in which `frames.check` finds nothing wrong; null: a single moment.
    frames: ?[]const u8 = null,
    /// Views around the scene; null: a single view.
    view_count: ?u32 = null,
    /// A range of these; null: all.
    views: ?[]const u8 = null,
    /// In which `template.check` finds nothing wrong; null: all go to standard output.
    template: ?[]const u8 = null,
    /// Pictures by the same name follow each other in one file.
    is_film: bool = false,
};

/// Numbers of frames and views, ascending; one that is not asked for is 0.
pub const Plan = struct {
    files: []const File,
    frames: []const i32,
    views: []const i32,
    template: ?[]const u8,

    /// Pictures of one file, for each of its cameras and variants.
    pub fn pictureCount(plan: *const Plan) usize {
        return plan.frames.len * plan.views.len;
    }

    /// Whether there is a placeholder for it.
    pub fn names(plan: *const Plan, field: template_file.Field) bool {
        return template_file.holds(plan.template orelse return false, field);
    }
};

/// `UsageInvalid`: the message says why.
pub const Error = error{ OutOfMemory, UsageInvalid };

/// Plans. Memory is of an arena; files and texts have to live as long.
pub fn make(
    arena: Allocator,
    files: []const File,
    wanted: *const Wanted,
    message: *Message,
) Error!Plan {
    const plan: Plan = .{
        .files = files,
        .frames = if (wanted.frames) |text|
            try numbers(arena, "--frames", text, message)
        else
            &.{0},
        .views = try viewsOf(arena, wanted, message),
        .template = wanted.template,
    };
    if (plan.template) |template| try checkNames(arena, &plan, template, wanted, message);
    return plan;
}

fn numbers(
    arena: Allocator,
    comptime option: []const u8,
    text: []const u8,
    message: *Message,
) Error![]const i32 {
    return frames_file.expand(arena, text) catch |err| switch (err) {
        error.OutOfMemory => error.OutOfMemory,
        error.Overlap => refuse(message, "option '" ++ option ++ "': {f} {s}", .{
            quote(text), frames_file.Fault.overlap.text(),
        }),
    };
}

fn viewsOf(arena: Allocator, wanted: *const Wanted, message: *Message) Error![]const i32 {
    const count = wanted.view_count orelse return &.{0};
    if (wanted.views) |text| {
        const chosen = try numbers(arena, "--views", text, message);
        if (chosen[0] >= 0 and chosen[chosen.len - 1] < count) return chosen;
        return refuse(message, "option '--views': {f} is not within 0-{d}", .{
            quote(text), count - 1,
        });
    }
    const all = try arena.alloc(i32, count);
    for (all, 0..) |*view, index| view.* = @intCast(index);
    return all;
}

/// Each picture needs a name of its own.
fn checkNames(
    arena: Allocator,
    plan: *const Plan,
    template: []const u8,
    wanted: *const Wanted,
    message: *Message,
) Error!void {
    const repeats = wanted.is_film;
    if (plan.frames.len > 1 and !repeats and !plan.names(.frame))
        return refuse(message, "{d} frames need {{frame}} in the name {f}", .{
            plan.frames.len, quote(template),
        });
    if (plan.views.len > 1 and !repeats and !plan.names(.view))
        return refuse(message, "{d} views need {{view}} in the name {f}", .{
            plan.views.len, quote(template),
        });
    if (plan.files.len > 1 and !plan.names(.model))
        return refuse(message, "{d} scenes need {{model}} in the name {f}", .{
            plan.files.len, quote(template),
        });
    var known: std.StringHashMapUnmanaged(usize) = .empty;
    for (plan.files, 0..) |file, index| {
        const entry = try known.getOrPut(arena, file.model());
        if (!entry.found_existing) {
            entry.value_ptr.* = index;
            continue;
        }
        return refuse(message, "{f} and {f} would have the same picture {f}", .{
            quote(plan.files[entry.value_ptr.*].path),
            quote(file.path),
            quote(try nameOf(arena, template, file.model())),
        });
    }
}

fn nameOf(arena: Allocator, template: []const u8, model: []const u8) error{OutOfMemory}![]const u8 {
    var name: std.Io.Writer.Allocating = .init(arena);
    template_file.write(template, &.{
        .model = model,
        .camera = "CAMERA",
        .material_variant = "VARIANT",
        .layer = "LAYER",
    }, &name.writer) catch return error.OutOfMemory;
    return name.written();
}

fn refuse(message: *Message, comptime format: []const u8, arguments: anytype) error{UsageInvalid} {
    message.set(format, arguments);
    return error.UsageInvalid;
}

const testing = std.testing;

fn expectRefused(needle: []const u8, files: []const File, wanted: Wanted) !void {
    var arena: std.heap.ArenaAllocator = .init(testing.allocator);
    defer arena.deinit();
    var message: Message = .{};
    const result = make(arena.allocator(), files, &wanted, &message);
    try testing.expectError(error.UsageInvalid, result);
    errdefer std.debug.print("{s}\n", .{message.text()});
    try testing.expect(std.mem.find(u8, message.text(), needle) != null);
}

test "every picture has a name of its own, or there is no plan" {
    const one = [_]File{.{ .path = "a.glb" }};
    const two = [_]File{ .{ .path = "a.glb" }, .{ .path = "x/b.obj" } };
    const same = [_]File{ .{ .path = "x/a.glb" }, .{ .path = "a.gltf" } };
    var arena: std.heap.ArenaAllocator = .init(testing.allocator);
    defer arena.deinit();
    var message: Message = .{};
    const plan = try make(arena.allocator(), &two, &.{
        .frames = "3,1-2",
        .view_count = 4,
        .views = "1-3:2",
        .template = "{model}_{frame}_{view}.png",
    }, &message);
    try testing.expectEqualSlices(i32, &.{ 1, 2, 3 }, plan.frames);
    try testing.expectEqualSlices(i32, &.{ 1, 3 }, plan.views);
    try testing.expectEqual(6, plan.pictureCount());
    try testing.expect(plan.names(.view) and !plan.names(.camera));
    _ = try make(arena.allocator(), &one, &.{
        .frames = "1-9",
        .template = "a.y4m",
        .is_film = true,
    }, &message);
    _ = try make(arena.allocator(), &same, &.{ .frames = "1-9" }, &message);
    try expectRefused("9 frames need {frame} in the name 'a.png'", &one, .{
        .frames = "1-9",
        .template = "a.png",
    });
    try expectRefused("4 views need {view}", &one, .{ .view_count = 4, .template = "a.png" });
    try expectRefused("2 scenes need {model}", &two, .{ .template = "a.png" });
    try expectRefused("'x/a.glb' and 'a.gltf' would have the same picture 'a_CAMERA.png'", &same, .{
        .template = "{model}_{camera}.png",
    });
    try expectRefused("'--frames': '1-2,2' has ranges that overlap", &one, .{ .frames = "1-2,2" });
    try expectRefused("'--views': '4' is not within 0-3", &one, .{ .view_count = 4, .views = "4" });
}
