//! XXH64 of plain data, value by value: the same for the same contents, wherever they lie.
//!
//! In: numbers, enums, optionals, unions, structs, arrays and slices of these. Out: 64 bits, the
//! same on every target.

const std = @import("std");
const Scene = @import("../scene.zig").Scene;
const scene_file = @import("../scene.zig");
const XxHash64 = std.hash.XxHash64;

/// Of all that is in a value.
pub fn of(value: anytype) u64 {
    comptime std.debug.assert(@import("builtin").cpu.arch.endian() == .little);
    var hash: XxHash64 = .init(0);
    add(&hash, @TypeOf(value), &value);
    return hash.final();
}

/// Of what a scene file holds, with the images that it names: neither of what it says of itself nor
/// of how files are called.
pub fn ofScene(scene: *const Scene) u64 {
    var hash: XxHash64 = .init(0);
    inline for (@typeInfo(Scene).@"struct".field_names) |name| {
        if (comptime std.mem.eql(u8, name, "images")) {
            for (scene.images) |*image| {
                add(&hash, []const u8, &image.bytes);
                add(&hash, bool, &image.is_relief);
            }
        } else if (comptime !std.mem.eql(u8, name, "arena") and !std.mem.eql(u8, name, "file")) {
            add(&hash, @FieldType(Scene, name), &@field(scene, name));
        }
    }
    return hash.final();
}

fn add(hash: *XxHash64, comptime T: type, value: *const T) void {
    switch (@typeInfo(T)) {
        .void => {},
        .bool => addNumber(hash, @intFromBool(value.*)),
        .int => |int| addNumber(hash, if (int.signedness == .signed)
            @bitCast(@as(i64, value.*))
        else
            value.*),
        .float => |float| addNumber(hash, @as(@Int(.unsigned, float.bits), @bitCast(value.*))),
        .@"enum" => addNumber(hash, @backingInt(value.*)),
        .optional => |optional| {
            addNumber(hash, @intFromBool(value.* != null));
            if (value.*) |*child| add(hash, optional.child, child);
        },
        .array => |array| addAll(hash, array.child, value),
        .vector => |vector| addAll(hash, vector.child, &@as([vector.len]vector.child, value.*)),
        .pointer => |pointer| switch (pointer.size) {
            .slice => {
                addNumber(hash, value.len);
                addAll(hash, pointer.child, value.*);
            },
            .one => add(hash, pointer.child, value.*),
            else => @compileError("a pointer to nobody knows how many"),
        },
        .@"struct" => |fields| if (fields.layout == .@"packed") {
            addNumber(hash, @backingInt(value.*));
        } else inline for (fields.field_names, fields.field_types) |name, Field| {
            add(hash, Field, &@field(value, name));
        },
        .@"union" => switch (value.*) {
            inline else => |*payload, tag| {
                addNumber(hash, @backingInt(tag));
                add(hash, @TypeOf(payload.*), payload);
            },
        },
        else => @compileError("no contents: " ++ @typeName(T)),
    }
}

fn addNumber(hash: *XxHash64, number: u64) void {
    hash.update(std.mem.asBytes(&number));
}

fn addAll(hash: *XxHash64, comptime T: type, all: []const T) void {
    if (comptime isDense(T)) return hash.update(std.mem.sliceAsBytes(all));
    for (all) |*one| add(hash, T, one);
}

/// Whether all bits of a value are contents, of the same size on every target.
fn isDense(comptime T: type) bool {
    return switch (@typeInfo(T)) {
        .int => |int| T != usize and T != isize and @sizeOf(T) * 8 == int.bits,
        .float => |float| @sizeOf(T) * 8 == float.bits,
        .array => |array| isDense(array.child),
        .vector => |vector| isDense(vector.child) and
            @sizeOf(T) == vector.len * @sizeOf(vector.child),
        else => false,
    };
}

test "equal contents have one fingerprint, others have others" {
    const Kind = union(enum) { none, name: []const u8, place: [2]f32 };
    const Thing = struct { size: usize = 3, kind: Kind = .none, more: ?*const u8 = null };
    var name = "ab".*;
    const byte: u8 = 7;
    const things = [_]Thing{
        .{},
        .{ .size = 4 },
        .{ .kind = .{ .name = "ab" } },
        .{ .kind = .{ .name = "ba" } },
        .{ .kind = .{ .place = .{ 0, 1 } } },
        .{ .more = &byte },
        .{ .kind = .{ .name = "" } },
    };
    for (things, 0..) |thing, index| for (things, 0..) |other, other_index| {
        try std.testing.expectEqual(index == other_index, of(thing) == of(other));
    };
    try std.testing.expectEqual(of(things[2]), of(Thing{ .kind = .{ .name = &name } }));
}

test "a scene's fingerprint is its contents, not its names of files" {
    var scene: Scene = .init(std.testing.allocator);
    defer scene.deinit();
    const images = [_]scene_file.Image{
        .{ .name = "a.png", .bytes = "1" }, .{ .name = "b.png", .bytes = "1" },
        .{ .name = "a.png", .bytes = "2" },
    };
    var found: [3]u64 = undefined;
    for (&found, 0..) |*print, index| {
        scene.images = images[index..][0..1];
        print.* = ofScene(&scene);
    }
    try std.testing.expectEqual(found[0], found[1]);
    try std.testing.expect(found[0] != found[2]);
    scene.ambient = 1;
    try std.testing.expect(ofScene(&scene) != found[2]);
}
