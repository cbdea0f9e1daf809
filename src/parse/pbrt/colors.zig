//! Parameters that may be a colour, a spectrum or a texture: one linear RGB, or one number.
//!
//! Where a constant is needed, a texture is its mean. What stands for what is not read is said once
//! a kind. docs/pbrt.md has the table.

const std = @import("std");
const quote = @import("../../diagnostic.zig").quote;
const number = @import("../number.zig");
const spectra = @import("spectra.zig");
const Input = @import("input.zig");
const Parameters = @import("parameters.zig");
const Textures = @import("textures.zig");
const Texture = Textures.Texture;
const Error = Input.Error;
const math = @import("../../math.zig");
const Vec3 = math.Vec3;

const Colors = @This();

/// Lives as long as the scene is read.
arena: std.mem.Allocator,
input: *Input,
textures: Textures,
/// Spectra by the name of their file.
files: std.StringHashMapUnmanaged(?Vec3) = .empty,
/// What RGB of the text is in.
space: spectra.Space = .srgb,
/// The film is one of version 4, whose lights are as bright as "scale" says, whatever the luminance
/// of their spectrum: it counts as 1.
is_version_4: bool = false,

/// The colour of that name, or `default` where it is absent or not read.
pub fn rgb(
    colors: *Colors,
    parameters: *const Parameters,
    name: []const u8,
    default: Vec3,
) Error!Vec3 {
    const parameter = parameters.find(name) orelse return default;
    return try colors.valueOf(parameters, parameter) orelse default;
}

/// The number of that name, or `default` where it is absent or not read.
pub fn float(
    colors: *Colors,
    parameters: *const Parameters,
    name: []const u8,
    default: f32,
) Error!f32 {
    const value = try colors.rgb(parameters, name, @splat(default));
    return (value[0] + value[1] + value[2]) / 3;
}

/// The texture of that name, constants included; null where it is absent or not there.
pub fn texture(
    colors: *Colors,
    parameters: *const Parameters,
    name: []const u8,
) Error!?Texture {
    const parameter = parameters.find(name) orelse return null;
    if (parameter.type == .texture) return colors.textureOf(parameters, parameter);
    return .{ .mean = try colors.valueOf(parameters, parameter) orelse return null };
}

fn textureOf(
    colors: *Colors,
    parameters: *const Parameters,
    parameter: *const Parameters.Parameter,
) Error!?Texture {
    const strings = parameters.stringsOf(parameter);
    if (strings.len == 0)
        return colors.input.fail(parameter.offset, "{f} has no name", .{quote(parameter.name)});
    if (colors.textures.named.get(strings[0])) |known| return known;
    try colors.input.forgive(
        parameter.offset,
        "texture that is not there",
        "texture {f} is not defined: the default of {f} stands for it",
        .{ quote(strings[0]), quote(parameter.name) },
    );
    return null;
}

fn valueOf(
    colors: *Colors,
    parameters: *const Parameters,
    parameter: *const Parameters.Parameter,
) Error!?Vec3 {
    const input = colors.input;
    const values = parameters.floatsOf(parameter);
    const strings = parameters.stringsOf(parameter);
    switch (parameter.type) {
        .rgb => if (values.len >= 3) return colors.space.toOurs(values[0..3].*),
        .xyz => if (values.len >= 3)
            return spectra.fromXyz(.{ values[0], values[1], values[2] }),
        .float => if (values.len >= 1) return @splat(values[0]),
        .integer => {
            const integers = parameters.integersOf(parameter);
            if (integers.len >= 1) return @splat(@as(f32, @floatFromInt(integers[0])));
        },
        .blackbody => if (values.len >= 1) {
            // Temperature and scale; the newest dialect has the temperature alone.
            const color = spectra.fromBlackbody(values[0]);
            return math.vec3.scale(color, if (values.len >= 2) values[1] else 1);
        },
        .spectrum => {
            if (strings.len >= 1) return colors.spectrumFile(parameter.offset, strings[0]);
            if (values.len == 1) return @splat(values[0]);
            return try colors.pairs(parameter.offset, values) orelse return input.fail(
                parameter.offset,
                "a spectrum is pairs of rising wavelengths and values",
                .{},
            );
        },
        .texture => {
            const known = try colors.textureOf(parameters, parameter) orelse return null;
            if (known.picture != null) try input.warn(
                parameter.offset,
                parameter.name,
                "{f}: a picture counts as its mean, taken as {d}",
                .{ quote(parameter.name), known.mean[0] },
            );
            return known.mean;
        },
        else => {},
    }
    return input.fail(parameter.offset, "{f} is no colour", .{quote(parameter.name)});
}

/// A spectrum by name, or from a file of pairs; null with a warning where it cannot be read.
fn spectrumFile(colors: *Colors, position: u64, name: []const u8) Error!?Vec3 {
    if (spectra.fromName(name)) |known| return known;
    const input = colors.input;
    if (colors.files.get(name)) |known| return known;
    var value: ?Vec3 = null;
    if (input.readFile(position, name)) |file| {
        defer input.gpa.free(file.bytes);
        const text = try input.withoutMark(position, name, file.bytes);
        value = try colors.parsePairs(position, text);
        if (value == null) try input.warn(
            position,
            "spectrum file",
            "{f} is no list of wavelengths and values: a default stands for it",
            .{quote(name)},
        );
    } else |err| switch (err) {
        error.OutOfMemory => return err,
        error.InvalidInput, error.InputOutput => {
            // A texture's worth: the picture does without it, unless it lies outside.
            if (err == error.InvalidInput) return err;
            input.diagnostic.place.length = 0;
            try input.warn(
                position,
                "spectrum file",
                "spectrum {f} cannot be read: a default stands for it",
                .{quote(name)},
            );
        },
    }
    try colors.files.put(colors.arena, try colors.arena.dupe(u8, name), value);
    return value;
}

/// Numbers between which there is white space, and perhaps a comma.
fn parsePairs(colors: *Colors, position: u64, bytes: [:0]const u8) Error!?Vec3 {
    const gpa = colors.input.gpa;
    const text = try gpa.dupeSentinel(u8, bytes, 0);
    defer gpa.free(text);
    std.mem.replaceScalar(u8, text, ',', ' ');
    var values: std.ArrayList(f32) = .empty;
    defer values.deinit(gpa);
    var cursor: usize = 0;
    while (true) {
        cursor = Input.skip(text, cursor);
        if (cursor == text.len) return colors.pairs(position, values.items);
        const value = number.float(text, &cursor) catch return null;
        try values.append(gpa, value);
    }
}

/// The colour of wavelengths and values, which version 3 takes in any order, and without the last
/// of an odd number; null: there is none.
fn pairs(colors: *Colors, position: u64, values: []const f32) Error!?Vec3 {
    if (spectra.fromPairs(values)) |known| return known;
    if (values.len < 2) return null;
    const gpa = colors.input.gpa;
    const sorted = try gpa.alloc([2]f32, values.len / 2);
    defer gpa.free(sorted);
    for (sorted, 0..) |*pair, index| pair.* = values[2 * index ..][0..2].*;
    std.mem.sort([2]f32, sorted, {}, isShorter);
    var count: usize = 1;
    for (sorted[1..]) |pair| {
        if (pair[0] == sorted[count - 1][0]) continue;
        sorted[count] = pair;
        count += 1;
    }
    try colors.input.forgive(
        position,
        "spectrum",
        "a spectrum is pairs of rising wavelengths and values",
        .{},
    );
    return spectra.fromPairs(@ptrCast(sorted[0..count]));
}

fn isShorter(_: void, a: [2]f32, b: [2]f32) bool {
    return a[0] < b[0];
}
