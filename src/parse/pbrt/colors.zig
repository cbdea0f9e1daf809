//! Parameters that may be a colour, a spectrum or a texture: one linear RGB, or one number.
//!
//! Scenes have no textures yet, so that a texture is its mean. What stands for what is not read,
//! image files above all, is said once a kind. docs/pbrt.md has the table.

const std = @import("std");
const quote = @import("../../diagnostic.zig").quote;
const number = @import("number.zig");
const spectra = @import("spectra.zig");
const Input = @import("input.zig");
const Parameters = @import("parameters.zig");
const Error = Input.Error;
const Vec3 = @import("../../math.zig").Vec3;

const Colors = @This();

/// Mean of an image that is not read.
const image_mean = 0.5;

/// Lives as long as the scene is read.
arena: std.mem.Allocator,
input: *Input,
textures: std.StringHashMapUnmanaged(Vec3) = .empty,
/// Spectra by the name of their file.
files: std.StringHashMapUnmanaged(?Vec3) = .empty,

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

fn valueOf(
    colors: *Colors,
    parameters: *const Parameters,
    parameter: *const Parameters.Parameter,
) Error!?Vec3 {
    const input = colors.input;
    const values = parameters.floatsOf(parameter);
    const strings = parameters.stringsOf(parameter);
    switch (parameter.type) {
        .rgb => if (values.len >= 3) return values[0..3].*,
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
            const scale = if (values.len >= 2) values[1] else 1;
            return .{ color[0] * scale, color[1] * scale, color[2] * scale };
        },
        .spectrum => {
            if (strings.len >= 1) return colors.spectrumFile(parameter.offset, strings[0]);
            if (values.len == 1) return @splat(values[0]);
            return spectra.fromPairs(values) orelse return input.fail(
                parameter.offset,
                "a spectrum is pairs of rising wavelengths and values",
                .{},
            );
        },
        .texture => if (strings.len >= 1) {
            if (colors.textures.get(strings[0])) |value| return value;
            try input.warn(
                parameter.offset,
                "texture that is not there",
                "texture {f} is not defined: the default of {f} stands for it",
                .{ quote(strings[0]), quote(parameter.name) },
            );
            return null;
        },
        else => {},
    }
    return input.fail(parameter.offset, "{f} is no colour", .{quote(parameter.name)});
}

/// A spectrum by name, or from a file of pairs; null with a warning where it cannot be read.
fn spectrumFile(colors: *Colors, position: usize, name: []const u8) Error!?Vec3 {
    if (spectra.fromName(name)) |known| return known;
    const input = colors.input;
    if (colors.files.get(name)) |known| return known;
    var value: ?Vec3 = null;
    if (input.readFile(position, name)) |file| {
        defer input.gpa.free(file.bytes);
        value = try colors.parsePairs(file.bytes);
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

fn parsePairs(colors: *Colors, bytes: [:0]const u8) Error!?Vec3 {
    const gpa = colors.input.gpa;
    var pairs: std.ArrayList(f32) = .empty;
    defer pairs.deinit(gpa);
    var cursor: usize = 0;
    while (true) {
        cursor = Input.skip(bytes, cursor);
        if (cursor == bytes.len) return spectra.fromPairs(pairs.items);
        const value = number.float(bytes, &cursor) catch return null;
        try pairs.append(gpa, value);
    }
}

/// The mean of a texture: `Texture "name" "type" "class" ...`.
pub fn mean(colors: *Colors, class: []const u8, parameters: *const Parameters) Error!Vec3 {
    const input = colors.input;
    const white: Vec3 = @splat(1);
    const Class = enum { constant, scale, mix, directionmix, checkerboard, dots, imagemap, bilerp };
    const known = std.meta.stringToEnum(Class, class) orelse {
        try input.warnHere(
            class,
            "Texture {f} is not supported: its mean is taken as {d}",
            .{ quote(class), image_mean },
        );
        return @splat(image_mean);
    };
    switch (known) {
        .constant, .scale, .mix => {},
        .imagemap => try input.warnHere(
            class,
            "Texture {f}: images are not read, their mean is taken as {d}",
            .{ quote(class), image_mean },
        ),
        else => try input.warnHere(class, "Texture {f} is shown as its mean", .{quote(class)}),
    }
    switch (known) {
        .constant => return colors.rgb(parameters, "value", white),
        .scale => {
            const first_name = if (parameters.find("tex1") != null) "tex1" else "tex";
            const second_name = if (parameters.find("tex2") != null) "tex2" else "scale";
            const first = try colors.rgb(parameters, first_name, white);
            const second = try colors.rgb(parameters, second_name, white);
            return .{ first[0] * second[0], first[1] * second[1], first[2] * second[2] };
        },
        .mix, .directionmix, .checkerboard => {
            const black: Vec3 = @splat(0);
            const is_mix = known == .mix;
            const first = try colors.rgb(parameters, "tex1", if (is_mix) black else white);
            const second = try colors.rgb(parameters, "tex2", if (is_mix) white else black);
            const amount = if (known == .mix) try colors.float(parameters, "amount", 0.5) else 0.5;
            return blend(first, second, amount);
        },
        .dots => {
            const inside = try colors.rgb(parameters, "inside", white);
            const outside = try colors.rgb(parameters, "outside", @splat(0));
            return blend(inside, outside, 0.5);
        },
        .bilerp => {
            var sum: Vec3 = @splat(0);
            const corners = [_][]const u8{ "v00", "v01", "v10", "v11" };
            for (corners, 0..) |corner, index| {
                const value = try colors.rgb(parameters, corner, @splat(@floatFromInt(index % 2)));
                for (&sum, value) |*component, part| component.* += 0.25 * part;
            }
            return sum;
        },
        .imagemap => return @splat(image_mean * parameters.float("scale", 1)),
    }
}

fn blend(first: Vec3, second: Vec3, amount: f32) Vec3 {
    var result: Vec3 = undefined;
    for (&result, first, second) |*to, a, b| to.* = (1 - amount) * a + amount * b;
    return result;
}
