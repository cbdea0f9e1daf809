//! Colours by their names, as in CSS (Color Module Level 4, section 6.1).
//!
//! In: a name. Out: codes of red, green and blue.

const std = @import("std");

/// Names and what they stand for, in the order of the alphabet.
const table =
    \\aliceblue f0f8ff  antiquewhite faebd7  aqua 00ffff  aquamarine 7fffd4  azure f0ffff
    \\beige f5f5dc  bisque ffe4c4  black 000000  blanchedalmond ffebcd  blue 0000ff
    \\blueviolet 8a2be2  brown a52a2a  burlywood deb887  cadetblue 5f9ea0  chartreuse 7fff00
    \\chocolate d2691e  coral ff7f50  cornflowerblue 6495ed  cornsilk fff8dc  crimson dc143c
    \\cyan 00ffff  darkblue 00008b  darkcyan 008b8b  darkgoldenrod b8860b  darkgray a9a9a9
    \\darkgreen 006400  darkgrey a9a9a9  darkkhaki bdb76b  darkmagenta 8b008b
    \\darkolivegreen 556b2f  darkorange ff8c00  darkorchid 9932cc  darkred 8b0000
    \\darksalmon e9967a  darkseagreen 8fbc8f  darkslateblue 483d8b  darkslategray 2f4f4f
    \\darkslategrey 2f4f4f  darkturquoise 00ced1  darkviolet 9400d3  deeppink ff1493
    \\deepskyblue 00bfff  dimgray 696969  dimgrey 696969  dodgerblue 1e90ff  firebrick b22222
    \\floralwhite fffaf0  forestgreen 228b22  fuchsia ff00ff  gainsboro dcdcdc
    \\ghostwhite f8f8ff  gold ffd700  goldenrod daa520  gray 808080  green 008000
    \\greenyellow adff2f  grey 808080  honeydew f0fff0  hotpink ff69b4  indianred cd5c5c
    \\indigo 4b0082  ivory fffff0  khaki f0e68c  lavender e6e6fa  lavenderblush fff0f5
    \\lawngreen 7cfc00  lemonchiffon fffacd  lightblue add8e6  lightcoral f08080
    \\lightcyan e0ffff  lightgoldenrodyellow fafad2  lightgray d3d3d3  lightgreen 90ee90
    \\lightgrey d3d3d3  lightpink ffb6c1  lightsalmon ffa07a  lightseagreen 20b2aa
    \\lightskyblue 87cefa  lightslategray 778899  lightslategrey 778899  lightsteelblue b0c4de
    \\lightyellow ffffe0  lime 00ff00  limegreen 32cd32  linen faf0e6  magenta ff00ff
    \\maroon 800000  mediumaquamarine 66cdaa  mediumblue 0000cd  mediumorchid ba55d3
    \\mediumpurple 9370db  mediumseagreen 3cb371  mediumslateblue 7b68ee
    \\mediumspringgreen 00fa9a  mediumturquoise 48d1cc  mediumvioletred c71585
    \\midnightblue 191970  mintcream f5fffa  mistyrose ffe4e1  moccasin ffe4b5
    \\navajowhite ffdead  navy 000080  oldlace fdf5e6  olive 808000  olivedrab 6b8e23
    \\orange ffa500  orangered ff4500  orchid da70d6  palegoldenrod eee8aa  palegreen 98fb98
    \\paleturquoise afeeee  palevioletred db7093  papayawhip ffefd5  peachpuff ffdab9
    \\peru cd853f  pink ffc0cb  plum dda0dd  powderblue b0e0e6  purple 800080
    \\rebeccapurple 663399  red ff0000  rosybrown bc8f8f  royalblue 4169e1  saddlebrown 8b4513
    \\salmon fa8072  sandybrown f4a460  seagreen 2e8b57  seashell fff5ee  sienna a0522d
    \\silver c0c0c0  skyblue 87ceeb  slateblue 6a5acd  slategray 708090  slategrey 708090
    \\snow fffafa  springgreen 00ff7f  steelblue 4682b4  tan d2b48c  teal 008080
    \\thistle d8bfd8  tomato ff6347  turquoise 40e0d0  violet ee82ee  wheat f5deb3
    \\white ffffff  whitesmoke f5f5f5  yellow ffff00  yellowgreen 9acd32
;

/// All names.
pub const names: [148][]const u8 = names: {
    @setEvalBranchQuota(100_000);
    var words = std.mem.tokenizeAny(u8, table, " \n");
    var all: [148][]const u8 = undefined;
    for (&all) |*name| {
        name.* = words.next().?;
        _ = words.next().?; // Its codes.
    }
    break :names all;
};

/// The codes of a name, in either case; null where there is no such colour.
pub fn named(name: []const u8) ?[3]u8 {
    var words = std.mem.tokenizeAny(u8, table, " \n");
    while (words.next()) |word| {
        const digits = words.next().?;
        if (std.ascii.eqlIgnoreCase(word, name)) return hexadecimal(digits);
    }
    return null;
}

/// The codes of six digits, two a channel, or of three that count twice.
pub fn hexadecimal(digits: []const u8) ?[3]u8 {
    const step: usize = switch (digits.len) {
        3 => 1,
        6 => 2,
        else => return null,
    };
    var codes: [3]u8 = undefined;
    for (&codes, 0..) |*code, channel| {
        const first = digits[channel * step];
        const last = digits[channel * step + step - 1];
        _ = std.fmt.hexToBytes(code[0..1], &.{ first, last }) catch return null;
    }
    return codes;
}

test named {
    try std.testing.expectEqual([3]u8{ 255, 0, 0 }, named("red").?);
    try std.testing.expectEqual([3]u8{ 0x66, 0x33, 0x99 }, named("RebeccaPurple").?);
    try std.testing.expectEqual([3]u8{ 0x9a, 0xcd, 0x32 }, named("yellowgreen").?);
    for ([_][]const u8{ "", "ff0000", "reddish", "re", " " }) |name| {
        try std.testing.expectEqual(null, named(name));
    }
    var words = std.mem.tokenizeAny(u8, table, " \n");
    var previous: []const u8 = "";
    var count: usize = 0;
    while (words.next()) |word| : (count += 1) {
        try std.testing.expect(std.mem.order(u8, previous, word) == .lt);
        try std.testing.expectEqual(6, words.next().?.len);
        try std.testing.expect(named(word) != null);
        previous = word;
    }
    try std.testing.expectEqual(names.len, count);
    try std.testing.expectEqualStrings(previous, names[names.len - 1]);
}

test hexadecimal {
    try std.testing.expectEqual([3]u8{ 0xff, 0x08, 0xa0 }, hexadecimal("fF08a0").?);
    try std.testing.expectEqual([3]u8{ 0xff, 0x00, 0xaa }, hexadecimal("f0a").?);
    for ([_][]const u8{ "", "f", "ffff", "fffffff", "ggg", "+12345", "12 456" }) |text| {
        try std.testing.expectEqual(null, hexadecimal(text));
    }
}
