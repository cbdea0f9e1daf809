//! Tone mapping: exposed radiance to linear light that a display can show.
//!
//! In: colours of several pixels, each channel a vector, at least 0. Out: the same by one of four
//! curves. + - * / and comparisons alone, the powers from series: the same bits on every target.

const std = @import("std");
const settings = @import("../settings.zig");

/// Exposed radiance at most, so that no curve overflows: white for all of them.
const exposed_max = 1e6;

/// Colours of the display, each channel 0..1. What is not a number counts as 0.
pub fn map(
    comptime mapping: settings.ToneMapping,
    comptime count: usize,
    exposed: [3]@Vector(count, f32),
) [3]@Vector(count, f32) {
    const Curve = Curves(count);
    var color: [3]@Vector(count, f32) = undefined;
    inline for (&color, exposed) |*to, from| to.* = Curve.clamp(from, exposed_max);
    color = switch (mapping) {
        .neutral => Curve.neutral(color),
        .aces => Curve.aces(color),
        .agx => Curve.agx(color),
        .linear => color,
    };
    inline for (&color) |*channel| channel.* = Curve.clamp(channel.*, 1);
    return color;
}

fn Curves(comptime count: usize) type {
    return struct {
        const V = @Vector(count, f32);
        const Color = [3]V;

        inline fn of(value: f32) V {
            return @splat(value);
        }

        inline fn min(a: V, b: V) V {
            return @select(f32, a < b, a, b);
        }

        inline fn max(a: V, b: V) V {
            return @select(f32, a > b, a, b);
        }

        /// Within 0..limit.
        inline fn clamp(value: V, limit: f32) V {
            return min(max(value, of(0)), of(limit));
        }

        /// The product of a matrix, by rows, and a colour.
        inline fn transform(comptime matrix: [3][3]f32, color: Color) Color {
            var result: Color = undefined;
            inline for (&result, matrix) |*to, row| {
                to.* = (of(row[0]) * color[0] + of(row[1]) * color[1]) + of(row[2]) * color[2];
            }
            return result;
        }

        /// Khronos PBR Neutral (its specification of 2024): base colours up to 0.8 come out as they
        /// are, less what a dielectric reflects; brighter ones are compressed and lose saturation.
        fn neutral(color: Color) Color {
            const reflected = 0.04;
            const compression_start = 0.8 - reflected;
            const desaturation = 0.15;
            const least = min(min(color[0], color[1]), color[2]);
            const small = least - of(1.0 / (4.0 * reflected)) * least * least;
            const offset = @select(f32, least < of(2 * reflected), small, of(reflected));
            var shifted: Color = undefined;
            inline for (&shifted, color) |*to, from| to.* = from - offset;

            const peak = max(max(shifted[0], shifted[1]), shifted[2]);
            const room: f32 = 1 - compression_start;
            const new_peak = of(1) - of(room * room) / (peak + of(room - compression_start));
            const share = of(1) / (of(desaturation) * (peak - new_peak) + of(1));
            const is_bright = peak >= of(compression_start);
            // Where it is not bright the peak may be 0.
            const gain = new_peak / max(peak, of(compression_start));
            var result: Color = undefined;
            inline for (&result, shifted) |*to, from| {
                const compressed = from * gain * share + new_peak * (of(1) - share);
                to.* = @select(f32, is_bright, compressed, from);
            }
            return result;
        }

        /// S. Hill's fit of the ACES reference rendering transform and its output transform for
        /// sRGB, with the exposure of 1/0.6 that three.js gives it.
        fn aces(color: Color) Color {
            var exposed: Color = undefined;
            inline for (&exposed, color) |*to, from| to.* = from * of(1.0 / 0.6);
            var fitted = transform(.{
                .{ 0.59719, 0.35458, 0.04823 },
                .{ 0.07600, 0.90834, 0.01566 },
                .{ 0.02840, 0.13383, 0.83777 },
            }, exposed);
            inline for (&fitted) |*v| {
                const above = v.* * (v.* + of(0.0245786)) - of(0.000090537);
                const below = v.* * (of(0.983729) * v.* + of(0.4329510)) + of(0.238081);
                v.* = above / below;
            }
            return transform(.{
                .{ 1.60475, -0.53108, -0.07367 },
                .{ -0.10208, 1.10813, -0.00605 },
                .{ -0.00327, -0.07276, 1.07602 },
            }, fitted);
        }

        /// B. Wrensch's fit of T. Sobotka's AgX, in Rec. 2020 primaries as three.js and Blender.
        fn agx(color: Color) Color {
            const ev_min = -12.47393;
            const ev_max = 4.026069;
            var curved = transform(agx_inset, transform(rec2020_of_srgb, color));
            inline for (&curved) |*v| {
                const stops = log2(max(v.*, of(1e-10)));
                const x = clamp((stops - of(ev_min)) * of(1.0 / (ev_max - ev_min)), 1);
                var sum = of(15.5);
                inline for (.{ -40.14, 31.96, -6.868, 0.4298, 0.1191, -0.00232 }) |coefficient| {
                    sum = sum * x + of(coefficient);
                }
                v.* = sum;
            }
            var light = transform(comptime inverse(agx_outset_inverse), curved);
            inline for (&light) |*v| {
                const power = exp2(of(2.2) * log2(max(v.*, of(1e-10))));
                v.* = @select(f32, v.* > of(1e-10), power, of(0));
            }
            return transform(srgb_of_rec2020, light);
        }

        /// The logarithm to base 2 of normal numbers, within 2 ulps of the larger of it and 1.
        fn log2(x: V) V {
            const bits: @Vector(count, u32) = @bitCast(x);
            // The mantissa in 0.75..1.5, so that the logarithm of 1 is 0 whichever side it is from.
            const from_below = bits -% @as(@Vector(count, u32), @splat(0x3f400000));
            const exponent: @Vector(count, i32) =
                @as(@Vector(count, i32), @bitCast(from_below)) >>
                @as(@Vector(count, u5), @splat(23));
            const mantissa_bits = bits -% (@as(@Vector(count, u32), @bitCast(exponent)) <<
                @as(@Vector(count, u5), @splat(23)));
            const m: V = @bitCast(mantissa_bits);
            // log m = 2 artanh s, |s| <= 0.2: what is left out is below 2^-26.
            const s = (m - of(1)) / (m + of(1));
            const ss = s * s;
            var sum = of(2.0 / 11.0 / std.math.ln2);
            inline for (.{ 9.0, 7.0, 5.0, 3.0, 1.0 }) |odd| {
                sum = sum * ss + of(2.0 / odd / std.math.ln2);
            }
            return s * sum + @as(V, @floatFromInt(exponent));
        }

        /// 2 to the power of x, -100..100, with a relative error of a few ulps.
        fn exp2(x: V) V {
            // Truncated from above 0: rounded to the nearest.
            const biased: @Vector(count, i32) = @intFromFloat(x + of(127.5));
            const whole = biased - @as(@Vector(count, i32), @splat(127));
            const rest = x - @as(V, @floatFromInt(whole)); // Within a half.
            var sum = of(1);
            comptime var n = 8;
            inline while (n >= 1) : (n -= 1) {
                sum = of(1) + sum * rest * of(std.math.ln2 / @as(f32, n));
            }
            const power: V = @bitCast(biased << @as(@Vector(count, u5), @splat(23)));
            return sum * power;
        }
    };
}

/// From Rec. 2020 primaries to those of sRGB (ITU-R BT.2407).
const srgb_of_rec2020: [3][3]f32 = .{
    .{ 1.6605, -0.5876, -0.0728 },
    .{ -0.1246, 1.1329, -0.0083 },
    .{ -0.0182, -0.1006, 1.1187 },
};
const rec2020_of_srgb = inverse(srgb_of_rec2020);
const agx_inset: [3][3]f32 = .{
    .{ 0.856627153315983, 0.0951212405381588, 0.0482516061458583 },
    .{ 0.137318972929847, 0.761241990602591, 0.101439036467562 },
    .{ 0.11189821299995, 0.0767994186031903, 0.811302368396859 },
};
const agx_outset_inverse: [3][3]f32 = .{
    .{ 0.899796955911611, 0.0871996192028351, 0.013003424885555 },
    .{ 0.11142098895748, 0.875575586156966, 0.0130034248855548 },
    .{ 0.11142098895748, 0.0871996192028349, 0.801379391839686 },
};

/// By Cramer's rule.
fn inverse(comptime matrix: [3][3]f32) [3][3]f32 {
    var adjugate: [3][3]f64 = undefined;
    for (0..3) |row| for (0..3) |column| {
        const a = .{ (column + 1) % 3, (column + 2) % 3 };
        const b = .{ (row + 1) % 3, (row + 2) % 3 };
        adjugate[row][column] = @as(f64, matrix[a[0]][b[0]]) * matrix[a[1]][b[1]] -
            @as(f64, matrix[a[0]][b[1]]) * matrix[a[1]][b[0]];
    };
    var determinant: f64 = 0;
    for (0..3) |index| determinant += matrix[0][index] * adjugate[index][0];
    var result: [3][3]f32 = undefined;
    for (&result, adjugate) |*to, from| {
        for (to, from) |*value, part| value.* = @floatCast(part / determinant);
    }
    return result;
}

const aces_of_grey: [3]f32 = .{ 0.213105, 0.213105, 0.213103 };
const aces_of_orange: [3]f32 = .{ 1.000000, 0.670759, 0.241900 };
const agx_of_grey: [3]f32 = .{ 0.214524, 0.214520, 0.214515 };
const agx_of_orange: [3]f32 = .{ 0.988769, 0.523761, 0.332398 };

/// Maps one colour.
fn mapOne(comptime mapping: settings.ToneMapping, color: [3]f32) [3]f32 {
    const mapped = map(mapping, 1, .{ .{color[0]}, .{color[1]}, .{color[2]} });
    return .{ mapped[0][0], mapped[1][0], mapped[2][0] };
}

fn expectColor(comptime mapping: settings.ToneMapping, color: [3]f32, expected: [3]f32) !void {
    const found = mapOne(mapping, color);
    errdefer std.debug.print("{t} {any}: {any}\n", .{ mapping, color, found });
    for (expected, found) |wanted, value| try std.testing.expectApproxEqAbs(wanted, value, 2e-5);
}

test "neutral keeps base colours, less what is reflected, and whitens highlights" {
    try expectColor(.neutral, .{ 0.5, 0.3, 0.2 }, .{ 0.46, 0.26, 0.16 });
    try expectColor(.neutral, .{ 0.04, 0.04, 0.04 }, .{ 0.01, 0.01, 0.01 });
    try expectColor(.neutral, .{ 0, 0.5, 0 }, .{ 0, 0.5, 0 });
    // By hand: peak 0.96, new peak 1 - 0.0576 / 0.44, no colour to lose.
    try expectColor(.neutral, .{ 1, 1, 1 }, @splat(0.8690909));
    // By hand: peak 10, new peak 1 - 0.0576 / 9.48, share 1 / 2.4.
    const new_peak = 1 - 0.0576 / 9.48;
    const share = 1.0 / (0.15 * (10.0 - new_peak) + 1);
    try expectColor(.neutral, .{ 10, 0, 0 }, .{
        new_peak, new_peak * (1 - share), new_peak * (1 - share),
    });
}

test "aces and agx at values that were worked out in double precision" {
    try expectColor(.aces, .{ 0.18, 0.18, 0.18 }, aces_of_grey);
    try expectColor(.aces, .{ 4, 0.5, 0.05 }, aces_of_orange);
    try expectColor(.agx, .{ 0.18, 0.18, 0.18 }, agx_of_grey);
    try expectColor(.agx, .{ 4, 0.5, 0.05 }, agx_of_orange);
}

test "linear is cut off at 1" {
    try expectColor(.linear, .{ 0.25, 1, 1.5 }, .{ 0.25, 1, 1 });
}

test "every curve rises from black to white and takes anything" {
    inline for (comptime std.enums.values(settings.ToneMapping)) |mapping| {
        var previous: f32 = -1;
        var gray: f32 = 0x1p-14;
        while (gray < 64) : (gray *= 1.01) {
            const mapped = mapOne(mapping, @splat(gray));
            try std.testing.expect(mapped[1] >= previous);
            previous = mapped[1];
        }
        try std.testing.expect(previous > 0.97);
        const inf = std.math.inf(f32);
        const least = std.math.floatTrueMin(f32);
        for ([_]f32{ 0, -1, std.math.nan(f32), -inf, inf, 1e38, least }) |odd| {
            for (mapOne(mapping, .{ odd, 1, odd })) |value| {
                try std.testing.expect(value >= 0 and value <= 1);
            }
        }
        for (mapOne(mapping, @splat(0))) |value| try std.testing.expect(value < 1e-4);
        for (mapOne(mapping, @splat(inf))) |value| try std.testing.expect(value > 0.97);
    }
}

test "logarithm and power are near to the library's" {
    var random = std.Random.DefaultPrng.init(5);
    const Curve = Curves(1);
    for (0..20_000) |_| {
        const x = (random.random().float(f32) - 0.5) * 150;
        const power = Curve.exp2(.{x})[0];
        try std.testing.expectApproxEqRel(@as(f32, @floatCast(@exp2(@as(f64, x)))), power, 1e-6);
        const back = Curve.log2(.{power})[0];
        try std.testing.expectApproxEqAbs(@log2(@as(f64, power)), back, 3e-7 * (1 + @abs(x)));
    }
    try std.testing.expectEqual(0, Curve.log2(.{1})[0]);
    try std.testing.expectEqual(1, Curve.exp2(.{0})[0]);
}
