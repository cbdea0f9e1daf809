//! Which of several names a misspelt one was meant to be.

const std = @import("std");

/// Changes of one character, up to which a name counts as misspelt.
const misspelling_distance_max = 2;

/// The candidate that `name` was most likely meant to be.
pub fn nearest(name: []const u8, candidates: []const []const u8) ?[]const u8 {
    var best: ?[]const u8 = null;
    var best_distance: usize = misspelling_distance_max + 1;
    for (candidates) |candidate| {
        const distance = editDistance(name, candidate) orelse continue;
        // Where all of it would change, it is another name.
        if (distance >= best_distance or distance >= name.len) continue;
        best_distance = distance;
        best = candidate;
    }
    return best;
}

/// Insertions, removals and replacements between two names (Wagner and Fischer 1974); null where
/// they are too long or too different in length to be of interest.
fn editDistance(a: []const u8, b: []const u8) ?usize {
    const length_max = 32;
    if (a.len > length_max or b.len > length_max) return null;
    if (@max(a.len, b.len) - @min(a.len, b.len) > misspelling_distance_max) return null;
    var row: [length_max + 1]usize = undefined;
    for (row[0 .. b.len + 1], 0..) |*cell, column| cell.* = column;
    for (a, 1..) |a_byte, line| {
        var diagonal = row[0];
        row[0] = line;
        for (b, 1..) |b_byte, column| {
            const replaced = diagonal + @intFromBool(a_byte != b_byte);
            diagonal = row[column];
            row[column] = @min(replaced, @min(diagonal, row[column - 1]) + 1);
        }
    }
    return row[b.len];
}

test nearest {
    try std.testing.expectEqualStrings("man", nearest("mna", &.{ "info", "man" }).?);
    try std.testing.expectEqual(null, nearest("a", &.{ "info", "man" }));
    try std.testing.expectEqual(null, nearest("scene.glb", &.{ "info", "man" }));
}

test editDistance {
    try std.testing.expectEqual(0, editDistance("", ""));
    try std.testing.expectEqual(1, editDistance("", "a"));
    try std.testing.expectEqual(2, editDistance("ab", "ba"));
    try std.testing.expectEqual(3, editDistance("abc", "xyz"));
    try std.testing.expectEqual(null, editDistance("a", "abcd"));
}
