//! Changes of JSON: values and the elements that they stand in.
//!
//! The text need not be JSON any more: whatever is between brackets, commas and colons outside of
//! strings is an element, and what follows its colon, if it has one, its value.

const std = @import("std");
const Allocator = std.mem.Allocator;
const Mutator = @import("../mutate.zig").Mutator;
const text = @import("text.zig");

/// Elements that are looked at, and how deep they may lie in each other.
const element_count_max = 1 << 12;
const depth_max = 128;
/// Most copies of an element.
const copy_count_max = 64;

/// `"key":value`, or a value alone; `value` is where that begins.
const Element = struct { start: usize, value: usize, end: usize };

/// Changes one thing.
pub fn change(mutator: *const Mutator, input: []const u8) Allocator.Error![]const u8 {
    const elements = try elementsOf(mutator.arena, input);
    if (elements.len == 0) return mutator.changeBytes(input);
    const index = mutator.below(elements.len);
    const element = elements[index];
    const whole = input[element.start..element.end];
    switch (mutator.below(14)) {
        0, 1, 2, 3 => return changeNumber(mutator, input),
        4 => {
            const has_comma = element.end < input.len and input[element.end] == ',';
            const end = element.end + @intFromBool(has_comma);
            return mutator.replaced(input, element.start, end, "");
        },
        5 => {
            const piece = try std.mem.concat(mutator.arena, u8, &.{ ",", whole });
            const copies = try text.repeated(mutator, piece, mutator.lengthBelow(copy_count_max));
            return mutator.replaced(input, element.end, null, copies);
        },
        6, 7 => {
            const from = elements[mutator.below(elements.len)];
            const value = input[from.value..from.end];
            return mutator.replaced(input, element.value, element.end, value);
        },
        8, 9 => {
            const other = mutator.anyOther();
            const found = try elementsOf(mutator.arena, other);
            if (found.len == 0) return input;
            const from = found[mutator.below(found.len)];
            if (mutator.random.boolean()) {
                const value = other[from.value..from.end];
                return mutator.replaced(input, element.value, element.end, value);
            }
            const own = other[from.start..from.end];
            const piece = try std.mem.concat(mutator.arena, u8, &.{ own, "," });
            return mutator.replaced(input, element.start, null, piece);
        },
        10, 11 => {
            const value = odd_values[mutator.below(odd_values.len)];
            return mutator.replaced(input, element.value, element.end, value);
        },
        12 => return mutator.replaced(
            input,
            element.start,
            element.end,
            try mutator.changeBytes(whole),
        ),
        else => return text.change(mutator, input),
    }
}

/// Puts another number in the place of one.
pub fn changeNumber(mutator: *const Mutator, input: []const u8) Allocator.Error![]const u8 {
    const elements = try elementsOf(mutator.arena, input);
    if (elements.len == 0) return mutator.changeBytes(input);
    const index = mutator.below(elements.len);
    for (0..elements.len) |step| {
        const element = elements[(index + step) % elements.len];
        const value = input[element.value..element.end];
        if (!text.isNumber(value)) continue;
        const number = try text.numberFor(mutator, value);
        return mutator.replaced(input, element.value, element.end, number);
    }
    return mutator.changeBytes(input);
}

fn elementsOf(arena: Allocator, input: []const u8) Allocator.Error![]const Element {
    var elements: std.ArrayList(Element) = .empty;
    var open: [depth_max]Element = undefined;
    var depth: usize = 0;
    var at: usize = 0;
    while (at < input.len and elements.items.len < element_count_max) : (at += 1) {
        switch (input[at]) {
            '"' => at = stringEnd(input, at),
            '[', '{' => {
                if (depth == depth_max) break;
                open[depth] = begun(input, at + 1);
                depth += 1;
            },
            ':' => if (depth > 0) {
                open[depth - 1].value = spaceEnd(input, at + 1);
            },
            ',', ']', '}' => |byte| if (depth > 0) {
                var element = open[depth - 1];
                element.end = at;
                element.value = @min(element.value, at);
                if (element.end > element.start) try elements.append(arena, element);
                if (byte == ',') open[depth - 1] = begun(input, at + 1) else depth -= 1;
            },
            else => {},
        }
    }
    return elements.items;
}

/// An element whose end and value are not known yet.
fn begun(input: []const u8, at: usize) Element {
    const start = spaceEnd(input, at);
    return .{ .start = start, .value = start, .end = start };
}

fn spaceEnd(input: []const u8, start: usize) usize {
    var at = start;
    while (at < input.len and std.ascii.isWhitespace(input[at])) at += 1;
    return at;
}

/// Where the quote is that ends a string, or the text.
fn stringEnd(input: []const u8, start: usize) usize {
    var at = start + 1;
    while (at < input.len) : (at += 1) switch (input[at]) {
        '\\' => at += 1,
        '"' => return at,
        else => {},
    };
    return input.len;
}

const deep: [200]u8 = @splat('[');

const odd_values = [_][]const u8{
    "null", "true",  "false",    "{}",              "[]",          "\"\"",
    "0",    "-1",    "\"0\"",    "[[]]",            "{\"\":null}", "\"\\ud800\"",
    &deep,  "[0,0]", "[0,0,0]",  "\"a%2e%2e/%00\"", "[1e39]",      "\"data:,\"",
    "NaN",  "1e400", "5121",     "\"VEC3\"",        "\"SCALAR\"",  "5126",
    "5123", "5125",  "\"MAT4\"", "\"\\u0000\"",     "[0,0,0,0]",   "2147483648",
};
