//! Names of what layers have numbers of: nodes, the meshes at them, and materials.
//!
//! In: names by number, those that a picture shows. Out: a text in JSON; manifests of the parts of
//! a picture make that of the whole.

const std = @import("std");
const Text = @import("json_text.zig").Text;
const Allocator = std.mem.Allocator;
const Stringify = std.json.Stringify;

/// What stands for no thing.
pub const none: u32 = std.math.maxInt(u32);

/// A number, and what has it.
pub const Entry = struct {
    number: u32,
    /// Empty where it has none.
    name: []const u8,

    fn isBefore(_: void, left: Entry, right: Entry) bool {
        return left.number < right.number;
    }
};

/// Each list by number, which is in it once.
pub const Manifest = struct {
    node: []const Entry = &.{},
    /// By number of the node.
    mesh: []const Entry = &.{},
    material: []const Entry = &.{},

    /// Of two, with lists from `arena`.
    pub fn joinedWith(
        manifest: *const Manifest,
        arena: Allocator,
        other: *const Manifest,
    ) error{OutOfMemory}!Manifest {
        var joined: Manifest = .{};
        inline for (.{ "node", "mesh", "material" }) |name| {
            const lists = .{ @field(manifest, name), @field(other, name) };
            @field(joined, name) = try sorted(arena, try std.mem.concat(arena, Entry, &lists));
        }
        return joined;
    }

    /// As files have it; the caller frees it.
    pub fn text(manifest: *const Manifest, gpa: Allocator) error{OutOfMemory}![:0]const u8 {
        var writing: std.Io.Writer.Allocating = .init(gpa);
        defer writing.deinit();
        var json: Stringify = .{ .writer = &writing.writer };
        manifest.jsonStringify(&json) catch return error.OutOfMemory;
        return gpa.dupeSentinel(u8, writing.written(), 0);
    }

    /// Called by `Stringify`.
    pub fn jsonStringify(manifest: *const Manifest, json: *Stringify) Stringify.Error!void {
        try json.beginObject();
        try json.objectField("none");
        try json.write(none);
        inline for (.{ "node", "mesh", "material" }) |name| {
            try json.objectField(name);
            try json.beginObject();
            for (@field(manifest, name)) |entry| {
                var digits: [10]u8 = undefined;
                const number = std.mem.print(&digits, "{d}", .{entry.number}) catch unreachable;
                try json.objectField(number);
                try json.write(Text{ .bytes = entry.name });
            }
            try json.endObject();
        }
        try json.endObject();
    }
};

/// Entries by number, the first of each.
pub fn sorted(arena: Allocator, entries: []Entry) error{OutOfMemory}![]const Entry {
    std.sort.block(Entry, entries, {}, Entry.isBefore);
    var unique: std.ArrayList(Entry) = .empty;
    for (entries) |entry| {
        const last = unique.getLastOrNull();
        if (last != null and last.?.number == entry.number) continue;
        try unique.append(arena, entry);
    }
    return unique.items;
}

test "parts make the whole, whatever is in a name" {
    var arena_state: std.heap.ArenaAllocator = .init(std.testing.allocator);
    defer arena_state.deinit();
    const arena = arena_state.allocator();
    const left: Manifest = .{
        .node = &.{ .{ .number = 2, .name = "\"a\"\xff" }, .{ .number = 4, .name = "" } },
        .mesh = &.{.{ .number = 2, .name = "m" }},
    };
    const right: Manifest = .{
        .node = &.{ .{ .number = 3, .name = "b" }, .{ .number = 4, .name = "" } },
        .mesh = &.{.{ .number = 3, .name = "m" }},
        .material = &.{.{ .number = 0, .name = "p" }},
    };
    for ([_][2]*const Manifest{ .{ &left, &right }, .{ &right, &left } }) |pair| {
        const joined = try pair[0].joinedWith(arena, pair[1]);
        const expected = "{\"none\":4294967295," ++
            "\"node\":{\"2\":\"\\\"a\\\"\u{fffd}\",\"3\":\"b\",\"4\":\"\"}," ++
            "\"mesh\":{\"2\":\"m\",\"3\":\"m\"},\"material\":{\"0\":\"p\"}}";
        try std.testing.expectEqualStrings(expected, try joined.text(arena));
    }
}
