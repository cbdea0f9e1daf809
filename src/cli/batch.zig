//! The command line of several pictures: which inputs, frames and views, what their names are.

const std = @import("std");
const arguments_file = @import("arguments.zig");
const batch = @import("../batch.zig");
const settings = @import("../settings.zig");
const Message = @import("../diagnostic.zig").Message;
const quote = @import("../diagnostic.zig").quote;
const template = batch.template;

/// What is asked for besides a picture's own options.
pub const Batch = struct {
    /// Scenes and folders that are named.
    input_count: usize = 1,
    /// Pictures that are there already stay.
    skip_existing: bool = false,
    /// Files side by side; null: as suits the pictures.
    job_count: ?u32 = null,
    /// A range in which `batch.frames.check` finds nothing wrong; null: one moment.
    frames: ?[]const u8 = null,
    /// Whose exposure and framing all have; null: the first.
    reference_frame: ?i32 = null,
    /// Views around the scene; null: one view.
    view_count: ?u32 = null,
    /// A range of them; null: all.
    views: ?[]const u8 = null,

    /// Whether there may be more than one picture of a file, or its name is made for it.
    pub fn hasMany(chosen: *const Batch) bool {
        return chosen.frames != null or chosen.view_count != null;
    }
};

/// Whether the names of pictures are made of something: by a template, or in a folder.
pub fn isMade(output: []const u8) bool {
    return template.isTemplate(output) or std.mem.endsWith(u8, output, "/");
}

/// The template that pictures are named by, where `output` is none itself: for a folder, in it.
/// Memory is of an arena.
pub fn templateOf(
    arena: std.mem.Allocator,
    chosen: *const Batch,
    output: ?[]const u8,
    format: settings.Format,
) error{OutOfMemory}![]const u8 {
    const folder = output orelse "";
    if (output != null and !std.mem.endsWith(u8, folder, "/")) return folder;
    const is_film = format == .y4m;
    return arena.print("{s}{{model}}{s}{s}.{t}", .{
        folder,
        if (chosen.frames != null and !is_film) "_{frame:4}" else "",
        if (chosen.view_count != null and !is_film) "_{view:3}" else "",
        format,
    });
}

/// What of a template the other options do not go with; null: nothing.
pub fn contradiction(chosen: *const Batch, output: []const u8, message: *Message) bool {
    if (!template.isTemplate(output)) return false;
    if (template.check(output)) |fault| {
        switch (fault) {
            .unknown => |name| message.set("no placeholder {{{s}}} in {f}; there are {s}", .{
                name, quote(output), template.Field.list,
            }),
            .width => |inside| message.set("{{{s}}} in {f}: a width is 1 to 9, of a number", .{
                inside, quote(output),
            }),
            .brace => message.set("a brace in {f} without its other one; {{{{ is a brace", .{
                quote(output),
            }),
        }
        return true;
    }
    if (chosen.frames == null and template.holds(output, .frame)) {
        message.set("'{{frame}}' in {f} needs '--frames'", .{quote(output)});
        return true;
    }
    if (chosen.view_count == null and template.holds(output, .view)) {
        message.set("'{{view}}' in {f} needs '--turntable'", .{quote(output)});
        return true;
    }
    return false;
}

/// `24`, `23.976` or `30000/1001`: above 0, up to 1000.
pub fn frameRateOf(text: []const u8) ?settings.FrameRate {
    const any: settings.Range = .{ .min = 1, .max = 1_000_000 };
    var rate: settings.FrameRate = .{};
    if (std.mem.findScalar(u8, text, '/')) |slash| {
        rate.numerator = arguments_file.integer(text[0..slash], any) orelse return null;
        rate.denominator = arguments_file.integer(text[slash + 1 ..], any) orelse return null;
    } else {
        const digits_max = 6;
        const point = std.mem.findScalar(u8, text, '.') orelse text.len;
        const decimals = text[@min(point + 1, text.len)..];
        if (point == 0 or point > digits_max or decimals.len > digits_max) return null;
        var digits: [2 * digits_max]u8 = undefined;
        @memcpy(digits[0..point], text[0..point]);
        @memcpy(digits[point..][0..decimals.len], decimals);
        rate.numerator = arguments_file.integer(digits[0 .. point + decimals.len], .{
            .min = 1,
            .max = 1_000_000_000,
        }) orelse return null;
        for (0..decimals.len) |_| rate.denominator *= 10;
    }
    return if (rate.numerator <= 1000 * @as(u64, rate.denominator)) rate else null;
}

const testing = std.testing;

test frameRateOf {
    const Case = struct { []const u8, u32, u32 };
    for ([_]Case{
        .{ "24", 24, 1 },
        .{ "23.976", 23_976, 1000 },
        .{ "30000/1001", 30_000, 1001 },
        .{ "0.5", 5, 10 },
        .{ "1000", 1000, 1 },
        .{ "12.", 12, 1 },
        .{ "1/1000000", 1, 1_000_000 },
    }) |case| {
        const rate = frameRateOf(case[0]).?;
        try testing.expectEqual(case[1], rate.numerator);
        try testing.expectEqual(case[2], rate.denominator);
    }
    for ([_][]const u8{
        "",   "0",   "-1", "1001", "24/0",       "0/1",    "/",     "1/",
        ".5", "0.0", "x",  "1e3",  "24.1234567", "1000.5", "1.2.3", "12345678",
    }) |text| try testing.expectEqual(null, frameRateOf(text));
}

test templateOf {
    var arena_state: std.heap.ArenaAllocator = .init(testing.allocator);
    defer arena_state.deinit();
    const arena = arena_state.allocator();
    const many: Batch = .{ .frames = "1-2", .view_count = 3 };
    const Case = struct { []const u8, Batch, ?[]const u8, settings.Format };
    for ([_]Case{
        .{ "{model}.png", .{}, null, .png },
        .{ "a/{model}.jpg", .{}, "a/", .jpg },
        .{ "a/{model}_{frame:4}_{view:3}.exr", many, "a/", .exr },
        .{ "{model}.y4m", many, null, .y4m },
        .{ "{camera}.png", many, "{camera}.png", .png },
        .{ "a.png", .{}, "a.png", .png },
    }) |case| {
        const made = try templateOf(arena, &case[1], case[2], case[3]);
        try testing.expectEqualStrings(case[0], made);
    }
}
