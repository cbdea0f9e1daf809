//! Spectra as linear RGB: tables of wavelengths, black bodies, CIE XYZ, and names.
//!
//! In: numbers as PBRT gives them. Out: linear RGB with sRGB's primaries, not clipped; a spectrum
//! that is 1 everywhere has luminance 1, and the pink tint of the equal-energy white, as in PBRT.
//! The observer is the fit of Wyman, Sloan and Shirley, "Simple analytic approximations to the CIE
//! XYZ color matching functions" (2013), the multi-lobe one; elementary functions are our own.

const std = @import("std");
const math = @import("../../math.zig");
const elementary = math.elementary;
const Vec3 = math.Vec3;

/// Wavelengths summed over, in nanometres.
const wavelength_min = 380;
const wavelength_max = 780;
const wavelength_step = 5;

/// A Gaussian with two widths.
const Lobe = struct { height: f64, middle: f64, left: f64, right: f64 };

const x_lobes = [_]Lobe{
    .{ .height = 1.056, .middle = 599.8, .left = 37.9, .right = 31.0 },
    .{ .height = 0.362, .middle = 442.0, .left = 16.0, .right = 26.7 },
    .{ .height = -0.065, .middle = 501.1, .left = 20.4, .right = 26.2 },
};
const y_lobes = [_]Lobe{
    .{ .height = 0.821, .middle = 568.8, .left = 46.9, .right = 40.5 },
    .{ .height = 0.286, .middle = 530.9, .left = 16.3, .right = 31.1 },
};
const z_lobes = [_]Lobe{
    .{ .height = 1.217, .middle = 437.0, .left = 11.8, .right = 36.0 },
    .{ .height = 0.681, .middle = 459.0, .left = 26.0, .right = 13.8 },
};

fn observe(lobes: []const Lobe, wavelength: f64) f64 {
    var sum: f64 = 0;
    for (lobes) |lobe| {
        const width = if (wavelength < lobe.middle) lobe.left else lobe.right;
        const distance = (wavelength - lobe.middle) / width;
        sum += lobe.height * elementary.exp(-0.5 * distance * distance);
    }
    return sum;
}

/// CIE XYZ to linear RGB with the primaries of sRGB (Rec. 709).
pub fn fromXyz(xyz: [3]f64) Vec3 {
    const x, const y, const z = xyz;
    return finite(.{
        3.240479 * x - 1.537150 * y - 0.498535 * z,
        -0.969256 * x + 1.875991 * y + 0.041556 * z,
        0.055648 * x - 0.204043 * y + 1.057311 * z,
    });
}

/// A space of linear RGB; all of them have D65 for white here, ACES' own is adapted (Bradford).
pub const Space = enum {
    srgb,
    @"dci-p3",
    rec2020,
    @"aces2065-1",

    /// By the name that PBRT's ColorSpace has for it.
    pub fn named(name: []const u8) ?Space {
        return std.meta.stringToEnum(Space, name);
    }

    /// Linear RGB with the primaries of sRGB.
    pub fn toOurs(space: Space, rgb: Vec3) Vec3 {
        const rows: [3]Vec3 = switch (space) {
            .srgb => return rgb,
            .@"dci-p3" => .{
                .{ 1.224940, -0.224940, 0 },
                .{ -0.042057, 1.042057, 0 },
                .{ -0.019638, -0.078636, 1.098274 },
            },
            .rec2020 => .{
                .{ 1.660491, -0.587641, -0.072850 },
                .{ -0.124550, 1.132900, -0.008350 },
                .{ -0.018151, -0.100579, 1.118730 },
            },
            .@"aces2065-1" => .{
                .{ 2.521686, -1.134131, -0.387555 },
                .{ -0.276480, 1.372719, -0.096239 },
                .{ -0.015378, -0.152975, 1.168353 },
            },
        };
        var result: Vec3 = undefined;
        for (&result, rows) |*to, row| to.* = math.vec3.dot(row, rgb);
        return finite(.{ result[0], result[1], result[2] });
    }
};

/// In f32, what is too large as the largest, denormals as zeros.
fn finite(rgb: [3]f64) Vec3 {
    const largest: f64 = std.math.floatMax(f32);
    var result: Vec3 = undefined;
    for (rgb, &result) |from, *to| {
        const bounded = if (from < largest) if (from > -largest) from else -largest else largest;
        to.* = math.flushDenormal(@floatCast(bounded));
    }
    return result;
}

/// RGB of a spectrum given as a function of the wavelength.
fn integrate(context: anytype, comptime valueAt: fn (@TypeOf(context), f64) f64) Vec3 {
    var xyz: [3]f64 = .{ 0, 0, 0 };
    var whole: f64 = 0;
    var wavelength: u32 = wavelength_min;
    while (wavelength <= wavelength_max) : (wavelength += wavelength_step) {
        const at: f64 = @floatFromInt(wavelength);
        const value = valueAt(context, at);
        const y = observe(&y_lobes, at);
        xyz[0] += value * observe(&x_lobes, at);
        xyz[1] += value * y;
        xyz[2] += value * observe(&z_lobes, at);
        whole += y;
    }
    for (&xyz) |*component| component.* /= whole;
    return fromXyz(xyz);
}

/// RGB of pairs of wavelength and value, in the order of rising wavelengths: straight lines
/// between them, the outermost values beyond. Null where it is no such list.
pub fn fromPairs(pairs: []const f32) ?Vec3 {
    if (pairs.len < 2 or pairs.len % 2 != 0) return null;
    var index: usize = 2;
    while (index < pairs.len) : (index += 2) {
        if (!(pairs[index] > pairs[index - 2])) return null;
    }
    return integrate(pairs, interpolate);
}

fn interpolate(pairs: []const f32, wavelength: f64) f64 {
    if (wavelength <= pairs[0]) return pairs[1];
    if (wavelength >= pairs[pairs.len - 2]) return pairs[pairs.len - 1];
    var low: usize = 0;
    var high = pairs.len / 2 - 1;
    while (high - low > 1) {
        const middle = (low + high) / 2;
        if (pairs[2 * middle] <= wavelength) low = middle else high = middle;
    }
    const from: f64 = pairs[2 * low];
    const share = (wavelength - from) / (pairs[2 * high] - from);
    return (1 - share) * pairs[2 * low + 1] + share * pairs[2 * high + 1];
}

/// RGB of a black body of that temperature in kelvin, its brightest wavelength at 1; black where
/// it is not above 0.
pub fn fromBlackbody(temperature: f32) Vec3 {
    if (!(temperature > 0)) return .{ 0, 0, 0 };
    return integrate(@as(f64, temperature), planck);
}

/// Planck's law over its own maximum (Wien's law). Wavelength in nanometres.
fn planck(temperature: f64, wavelength: f64) f64 {
    const x = 1.4387769e7 / (wavelength * temperature);
    // At the maximum x is 4.965114, and the law is x^5 / (e^x - 1) but for constants.
    const x_peak = 4.965114231744276;
    if (x > 600) return 0;
    const ratio = x / x_peak;
    const ratio_squared = ratio * ratio;
    const growth = (elementary.exp(x_peak) - 1) / (elementary.exp(x) - 1);
    return ratio_squared * ratio_squared * ratio * growth;
}

/// Spectra that PBRT knows by name: index of refraction (eta) and absorption (k) of metals,
/// refraction of glasses at the sodium line, and standard illuminants, of luminance 1.
pub fn fromName(name: []const u8) ?Vec3 {
    if (named.get(name)) |known| return known;
    const x, const y = illuminants.get(name) orelse return null;
    return fromXyz(.{ x / y, 1, (1 - x - y) / y });
}

/// Their chromaticities for the observer of 2 degrees: CIE 15:2004, tables T.3 and T.6.1; D60 as
/// in ACES.
const illuminants: std.StaticStringMap([2]f64) = .initComptime(.{
    .{ "illum-acesD60", .{ 0.32168, 0.33767 } },
    .{ "stdillum-A", .{ 0.44758, 0.40745 } },
    .{ "stdillum-D50", .{ 0.34567, 0.35851 } },
    .{ "stdillum-D65", .{ 0.31272, 0.32903 } },
    .{ "stdillum-F1", .{ 0.3131, 0.3371 } },
    .{ "stdillum-F2", .{ 0.3721, 0.3751 } },
    .{ "stdillum-F3", .{ 0.4091, 0.3941 } },
    .{ "stdillum-F4", .{ 0.4402, 0.4031 } },
    .{ "stdillum-F5", .{ 0.3138, 0.3452 } },
    .{ "stdillum-F6", .{ 0.3779, 0.3882 } },
    .{ "stdillum-F7", .{ 0.3129, 0.3292 } },
    .{ "stdillum-F8", .{ 0.3458, 0.3586 } },
    .{ "stdillum-F9", .{ 0.3741, 0.3727 } },
    .{ "stdillum-F10", .{ 0.3458, 0.3588 } },
    .{ "stdillum-F11", .{ 0.3805, 0.3769 } },
    .{ "stdillum-F12", .{ 0.4370, 0.4042 } },
});

const named: std.StaticStringMap(Vec3) = .initComptime(.{
    .{ "metal-Ag-eta", Vec3{ 0.1552, 0.1166, 0.1383 } },
    .{ "metal-Ag-k", Vec3{ 4.8283, 3.1222, 2.1470 } },
    .{ "metal-Al-eta", Vec3{ 1.6574, 0.8803, 0.5212 } },
    .{ "metal-Al-k", Vec3{ 9.2238, 6.2695, 4.8370 } },
    .{ "metal-Au-eta", Vec3{ 0.1431, 0.3749, 1.4424 } },
    .{ "metal-Au-k", Vec3{ 3.9831, 2.3857, 1.6032 } },
    .{ "metal-Cu-eta", Vec3{ 0.2004, 0.9240, 1.1022 } },
    .{ "metal-Cu-k", Vec3{ 3.9129, 2.4528, 2.1421 } },
    .{ "metal-CuZn-eta", Vec3{ 0.444, 0.527, 1.094 } },
    .{ "metal-CuZn-k", Vec3{ 3.695, 2.765, 1.829 } },
    .{ "metal-MgO-eta", Vec3{ 1.735, 1.741, 1.754 } },
    .{ "metal-MgO-k", Vec3{ 0, 0, 0 } },
    .{ "metal-TiO2-eta", Vec3{ 2.58, 2.65, 2.81 } },
    .{ "metal-TiO2-k", Vec3{ 0, 0, 0 } },
    .{ "glass-BK7", Vec3{ 1.5168, 1.5168, 1.5168 } },
    .{ "glass-BAF10", Vec3{ 1.67, 1.67, 1.67 } },
    .{ "glass-FK51A", Vec3{ 1.4866, 1.4866, 1.4866 } },
    .{ "glass-LASF9", Vec3{ 1.8503, 1.8503, 1.8503 } },
    .{ "glass-F5", Vec3{ 1.6034, 1.6034, 1.6034 } },
    .{ "glass-F10", Vec3{ 1.6237, 1.6237, 1.6237 } },
    .{ "glass-F11", Vec3{ 1.6206, 1.6206, 1.6206 } },
});

/// What a medium does to light on a way of a millimetre: scattering is the reduced one.
pub const Medium = struct { scattered: Vec3, absorbed: Vec3 };

/// Media that PBRT knows by name (Jensen et al. 2001, "A practical model for subsurface light
/// transport", figure 5); null for those of other sources.
pub fn mediumNamed(name: []const u8) ?Medium {
    const row = media.get(name) orelse return null;
    return .{ .scattered = row[0..3].*, .absorbed = row[3..6].* };
}

const media: std.StaticStringMap([6]f32) = .initComptime(.{
    .{ "Apple", .{ 2.29, 2.39, 1.97, 0.0030, 0.0034, 0.046 } },
    .{ "Chicken1", .{ 0.15, 0.21, 0.38, 0.015, 0.077, 0.19 } },
    .{ "Chicken2", .{ 0.19, 0.25, 0.32, 0.018, 0.088, 0.20 } },
    .{ "Cream", .{ 7.38, 5.47, 3.15, 0.0002, 0.0028, 0.0163 } },
    .{ "Ketchup", .{ 0.18, 0.07, 0.03, 0.061, 0.97, 1.45 } },
    .{ "Marble", .{ 2.19, 2.62, 3.00, 0.0021, 0.0041, 0.0071 } },
    .{ "Potato", .{ 0.68, 0.70, 0.55, 0.0024, 0.0090, 0.12 } },
    .{ "Skimmilk", .{ 0.70, 1.22, 1.90, 0.0014, 0.0025, 0.0142 } },
    .{ "Skin1", .{ 0.74, 0.88, 1.01, 0.032, 0.17, 0.48 } },
    .{ "Skin2", .{ 1.09, 1.59, 1.79, 0.013, 0.070, 0.145 } },
    .{ "Spectralon", .{ 11.6, 20.4, 14.9, 0, 0, 0 } },
    .{ "Wholemilk", .{ 2.55, 3.21, 3.77, 0.0011, 0.0024, 0.014 } },
});

/// Luminance of linear RGB (Rec. 709).
pub fn luminance(rgb: Vec3) f32 {
    return 0.212671 * rgb[0] + 0.715160 * rgb[1] + 0.072169 * rgb[2];
}

test "a spectrum of ones has luminance one and the tint of the equal-energy white" {
    const white = fromPairs(&.{ 400, 1, 700, 1 }).?;
    try std.testing.expectApproxEqAbs(1, luminance(white), 1e-3);
    const expected: Vec3 = .{ 1.205, 0.948, 0.909 };
    for (expected, white) |a, b| try std.testing.expectApproxEqAbs(a, b, 0.02);
    const red = fromPairs(&.{ 380, 0, 590, 0, 610, 1, 780, 1 }).?;
    try std.testing.expect(red[0] > 4 * @abs(red[1]) and red[0] > 4 * @abs(red[2]));
    for ([_][]const f32{ &.{}, &.{1}, &.{ 500, 1, 400, 1 }, &.{ 500, 1, 500, 2 } }) |bad| {
        try std.testing.expectEqual(null, fromPairs(bad));
    }
}

test "illuminants have luminance 1, and the daylight of 6500 K is white" {
    for (illuminants.keys()) |name|
        try std.testing.expectApproxEqAbs(1, luminance(fromName(name).?), 1e-3);
    for (fromName("stdillum-D65").?) |channel| try std.testing.expectApproxEqAbs(1, channel, 2e-3);
    const warm = fromName("stdillum-A").?;
    try std.testing.expect(warm[0] > 1.5 and warm[2] < 0.4);
    try std.testing.expectEqual(null, fromName("stdillum-Q"));
}

test "white is white in every space, and their primaries are beyond ours" {
    for (std.enums.values(Space)) |space| {
        for (space.toOurs(.{ 1, 1, 1 })) |channel|
            try std.testing.expectApproxEqAbs(1, channel, 2e-6);
        const red = space.toOurs(.{ 1, 0, 0 });
        try std.testing.expect(red[0] >= 1 and red[1] <= 0 and red[2] <= 0);
        try std.testing.expectEqual(space, Space.named(@tagName(space)).?);
    }
}

test "black bodies turn from red to blue" {
    const warm = fromBlackbody(2700);
    try std.testing.expect(warm[0] > 2 * warm[2]);
    const cold = fromBlackbody(12000);
    try std.testing.expect(cold[2] > cold[0]);
    try std.testing.expectApproxEqAbs(1, planck(5000, 2.8977719e6 / 5000.0), 1e-6);
    for ([_]f32{ 0, -1, 1e-30, 1e30 }) |temperature| {
        try std.testing.expect(math.vec3.isFinite(fromBlackbody(temperature)));
    }
}
