//! Iridescence: reflectance of a thin film on a surface by Belcour and Barla 2017, in lanes.
//!
//! In: cosines, index and thickness of the film, the surface's reflectance f0 at normal incidence.
//! Out: reflectance in linear Rec. 709, and what f0 gives the same by Schlick's approximation, for
//! lobes that know f0 alone. Formulas: KHR_materials_iridescence, of "A Practical Extension to
//! Microfacet Theory for the Modeling of Varying Iridescence", with Schlick's approximation at both
//! boundaries: the waves' interference is a Fourier series, of which each term is one evaluation of
//! the observer's sensitivities, Gaussians of the phase. Of two terms, for shifts are 0 or pi:
//! the second has twice the phase, so its cosine is 2 c^2 - 1 and its Gaussian the fourth power.
//!
//! At a thickness of 0, and an index of 1, there is no film, though by the text's formulas, which
//! have Schlick's reflectance of 1 at grazing incidence twice, there is: over the first 20 nm, and
//! up to an index of 1.065, the surface's own reflectance goes over into theirs. Everything is
//! + - * / sqrt in a fixed order and integer operations on bits.

const std = @import("std");
const simd = @import("../../simd.zig");
const cosine = @import("cosine.zig");
const exponential = @import("exponential.zig");
const microfacet = @import("microfacet.zig");

/// From here on, in nanometres, a film is as thick as it is.
const whole_thickness_nm = 20;

/// Film's reflectance at normal incidence from which on it is a film.
const whole_reflectance = 0.001;

/// Optical path, in nanometres, from which on interference does not show: e to less than -87.
const path_max_nm = 30_000;

/// Reflectance of a surface with a film on it, linear Rec. 709, 0..1. `cos_view` is that of the
/// angle outside, where the index is 1; `film_ior` >= 1; `f0` is the surface's without film.
pub fn reflectance(
    comptime Lanes: type,
    cos_view: Lanes.F32,
    film_ior: Lanes.F32,
    thickness_nm: Lanes.F32,
    f0: Lanes.Vec3,
) Lanes.Vec3 {
    @setEvalBranchQuota(10_000);
    const F32 = Lanes.F32;
    const one: F32 = .splat(1);
    const ratio = film_ior.sub(one).div(film_ior.add(one));
    const film_f0 = ratio.mul(ratio);
    const weight = schlickWeight(Lanes, cos_view);
    const first = schlick(Lanes, film_f0, weight);
    const sin_squared = one.sub(cos_view.mul(cos_view)).div(film_ior.mul(film_ior));
    const cos_inside = one.sub(sin_squared).max(.zero()).sqrt();
    const weight_inside = schlickWeight(Lanes, cos_inside);
    const path_nm = film_ior.mul(cos_inside).mul(thickness_nm).mul(.splat(2));
    const sensitivity: Sensitivity(Lanes) = .of(path_nm.min(.splat(path_max_nm)));
    var constant: Lanes.Vec3 = undefined;
    var amplitudes: [2]Lanes.Vec3 = undefined;
    var shifted: Lanes.Vec3 = undefined;
    inline for (.{ "x", "y", "z" }) |channel| {
        const second = secondBoundary(Lanes, @field(f0, channel), film_ior);
        const reflected = schlick(Lanes, second.f0, weight_inside);
        const both = first.mul(reflected).max(.splat(1e-5)).min(.splat(0.9999));
        const passing = one.sub(first);
        const inside = passing.mul(passing).mul(reflected).div(one.sub(both));
        @field(constant, channel) = first.add(inside);
        const round = both.sqrt();
        const amplitude = inside.sub(passing).mul(round).mul(.splat(2));
        @field(amplitudes[0], channel) = amplitude;
        @field(amplitudes[1], channel) = amplitude.mul(round);
        // The film's upper side shifts by pi, the surface as well where it is less dense. The text
        // gives the shift of red to X, that of green to Y, that of blue to Z.
        const value = @field(sensitivity.xyz[0], channel);
        @field(shifted, channel) = F32.select(second.is_less_dense, value, value.neg());
    }
    const whole = constant.add(amplitudes[0].mul(rec709OfXyz(Lanes, shifted)))
        .add(amplitudes[1].mul(rec709OfXyz(Lanes, sensitivity.xyz[1])));
    const presence = smoothStep(Lanes, thickness_nm.div(.splat(whole_thickness_nm)))
        .mul(film_f0.mul(.splat(1.0 / whole_reflectance)).min(one));
    var result: Lanes.Vec3 = undefined;
    inline for (.{ "x", "y", "z" }) |channel| {
        const bare = schlick(Lanes, @field(f0, channel), weight);
        const covered = @field(whole, channel).max(.zero()).min(one);
        @field(result, channel) = bare.add(covered.sub(bare).mul(presence));
    }
    return result;
}

/// The reflectance at normal incidence, 0..1, that by Schlick's approximation gives this
/// reflectance at this angle, or the nearest to it.
pub fn schlickF0(
    comptime Lanes: type,
    reflected: Lanes.Vec3,
    cos_view: Lanes.F32,
) Lanes.Vec3 {
    const one: Lanes.F32 = .splat(1);
    const weight = schlickWeight(Lanes, cos_view);
    const rest = one.sub(weight).max(.splat(1e-6));
    var f0: Lanes.Vec3 = undefined;
    inline for (.{ "x", "y", "z" }) |channel| {
        const value = @field(reflected, channel).sub(weight).div(rest);
        @field(f0, channel) = value.max(.zero()).min(one);
    }
    return f0;
}

inline fn schlickWeight(comptime Lanes: type, cos_angle: Lanes.F32) Lanes.F32 {
    return microfacet.power5(Lanes, Lanes.F32.splat(1).sub(cos_angle).max(.zero()));
}

inline fn schlick(comptime Lanes: type, f0: Lanes.F32, weight: Lanes.F32) Lanes.F32 {
    return f0.add(Lanes.F32.splat(1).sub(f0).mul(weight));
}

inline fn smoothStep(comptime Lanes: type, x: Lanes.F32) Lanes.F32 {
    const bounded = x.max(.zero()).min(.splat(1));
    return bounded.mul(bounded).mul(Lanes.F32.splat(3).sub(bounded.add(bounded)));
}

fn Boundary(comptime Lanes: type) type {
    return struct { f0: Lanes.F32, is_less_dense: Lanes.Mask };
}

/// The one of film and surface, for the surface's f0 without film: its index is
/// (1 + sqrt(f0)) / (1 - sqrt(f0)), also of metals.
inline fn secondBoundary(
    comptime Lanes: type,
    surface_f0: Lanes.F32,
    film_ior: Lanes.F32,
) Boundary(Lanes) {
    const one: Lanes.F32 = .splat(1);
    // More than 0, as in the text, for the index to be more than 1.
    const root = surface_f0.add(.splat(1e-4)).min(one).sqrt();
    const surface = one.add(root);
    const film = one.sub(root).mul(film_ior);
    const ratio = surface.sub(film).div(surface.add(film));
    return .{ .f0 = ratio.mul(ratio), .is_less_dense = surface.lt(film) };
}

/// Linear Rec. 709.
inline fn rec709OfXyz(comptime Lanes: type, xyz: Lanes.Vec3) Lanes.Vec3 {
    return .{
        .x = xyz.dot(.splat(.{ 3.2404542, -1.5371385, -0.4985314 })),
        .y = xyz.dot(.splat(.{ -0.9692660, 1.8760108, 0.0415560 })),
        .z = xyz.dot(.splat(.{ 0.0556434, -0.2040259, 1.0572252 })),
    };
}

/// Fourier transforms of the observer's X, Y and Z at an optical path and at twice of it.
fn Sensitivity(comptime Lanes: type) type {
    return struct {
        xyz: [2]Lanes.Vec3,

        const F32 = Lanes.F32;
        /// Value at a path of 0, frequency in radians a nanometre, variance in 1 / nm^2.
        const Gaussian = struct { height: f32, frequency: f32, variance: f32 };
        const gaussians = [_]Gaussian{
            gaussian(5.4856e-13, 1.6810e6, 4.3278e9), // X's red
            gaussian(4.4201e-13, 1.7953e6, 9.3046e9), // Y
            gaussian(5.2481e-13, 2.2084e6, 6.6121e9), // Z
            gaussian(9.7470e-14, 2.2399e6, 4.5282e9), // X's blue
        };

        /// Of the text's value, position and variance, by 2 pi metres.
        fn gaussian(value: f64, position: f64, variance: f64) Gaussian {
            const phase = 2 * std.math.pi * 1e-9;
            return .{
                .height = @floatCast(value * @sqrt(2 * std.math.pi * variance) / 1.0685e-7),
                .frequency = @floatCast(position * phase),
                .variance = @floatCast(variance * phase * phase),
            };
        }

        inline fn of(path_nm: F32) @This() {
            const squared = path_nm.mul(path_nm);
            var values: [2][gaussians.len]F32 = undefined;
            inline for (gaussians, 0..) |part, index| {
                const turn = cosine.cos(Lanes, path_nm.mul(.splat(part.frequency)));
                const fall = exponential.expNegative(Lanes, squared.mul(.splat(-part.variance)));
                const fall_squared = fall.mul(fall);
                const turn_twice = turn.mul(turn).mul(.splat(2)).sub(.splat(1));
                const height: F32 = .splat(part.height);
                values[0][index] = turn.mul(fall).mul(height);
                values[1][index] = turn_twice.mul(fall_squared.mul(fall_squared)).mul(height);
            }
            var sensitivity: @This() = undefined;
            inline for (&sensitivity.xyz, values) |*xyz, value| {
                xyz.* = .{ .x = value[0].add(value[3]), .y = value[1], .z = value[2] };
            }
            return sensitivity;
        }
    };
}

const Single = simd.Lanes(.scalar, 1);

/// The text's formulas as they stand there, in f64; `f0` below 0.9999.
fn exactReflectance(cos_outside: f64, ior: f64, thickness_nm: f64, f0: [3]f64) [3]f64 {
    const first_f0 = std.math.pow(f64, (ior - 1) / (ior + 1), 2);
    const r12 = exactSchlick(first_f0, cos_outside);
    const cos_inside = @sqrt(1 - (1 - cos_outside * cos_outside) / (ior * ior));
    const path = 2 * ior * thickness_nm * cos_inside;
    var phi: [3]f64 = undefined;
    var sum: [3]f64 = undefined;
    var amplitude: [3]f64 = undefined;
    var round: [3]f64 = undefined;
    for (0..3) |k| {
        const root = @sqrt(f0[k] + 0.0001);
        const base_ior = (1 + root) / (1 - root);
        const ratio = (base_ior - ior) / (base_ior + ior);
        const r23 = exactSchlick(ratio * ratio, cos_inside);
        phi[k] = if (base_ior < ior) 2.0 * std.math.pi else std.math.pi;
        const r123 = std.math.clamp(r12 * r23, 1e-5, 0.9999);
        const rs = (1 - r12) * (1 - r12) * r23 / (1 - r123);
        round[k] = @sqrt(r123);
        sum[k] = r12 + rs;
        amplitude[k] = rs - (1 - r12);
    }
    for (1..3) |m| {
        const order: f64 = @floatFromInt(m);
        const shift = [3]f64{ order * phi[0], order * phi[1], order * phi[2] };
        const sensitivity = exactSensitivity(order * path, shift);
        for (0..3) |k| {
            amplitude[k] *= round[k];
            sum[k] += amplitude[k] * 2 * sensitivity[k];
        }
    }
    return sum;
}

fn exactSchlick(f0: f64, cos_angle: f64) f64 {
    return f0 + (1 - f0) * std.math.pow(f64, 1 - cos_angle, 5);
}

fn exactSensitivity(path_nm: f64, shift: [3]f64) [3]f64 {
    const phase = 2 * std.math.pi * path_nm * 1e-9;
    const heights = [_]f64{ 5.4856e-13, 4.4201e-13, 5.2481e-13, 9.7470e-14 };
    const positions = [_]f64{ 1.6810e6, 1.7953e6, 2.2084e6, 2.2399e6 };
    const variances = [_]f64{ 4.3278e9, 9.3046e9, 6.6121e9, 4.5282e9 };
    var xyz: [3]f64 = @splat(0);
    for (heights, positions, variances, 0..) |height, position, variance, index| {
        const k = index % 3;
        xyz[k] += height * @sqrt(2 * std.math.pi * variance) *
            @cos(position * phase + shift[k]) * @exp(-variance * phase * phase) / 1.0685e-7;
    }
    return .{
        3.2404542 * xyz[0] - 1.5371385 * xyz[1] - 0.4985314 * xyz[2],
        -0.9692660 * xyz[0] + 1.8760108 * xyz[1] + 0.0415560 * xyz[2],
        0.0556434 * xyz[0] - 0.2040259 * xyz[1] + 1.0572252 * xyz[2],
    };
}

fn reflectanceAt(cos_outside: f32, ior: f32, thickness_nm: f32, f0: [3]f32) [3]f32 {
    const lanes = .{ Single.F32.splat(cos_outside), Single.F32.splat(ior) };
    return reflectance(Single, lanes[0], lanes[1], .splat(thickness_nm), .splat(f0)).lane(0);
}

test "the text's formulas in f64, from 20 nm on" {
    const colors = [_][3]f32{ .{ 0.04, 0.04, 0.04 }, .{ 0, 0.02, 0.3 }, .{ 0.95, 0.64, 0.54 } };
    for (colors) |f0| for ([_]f32{ 1.1, 1.3, 1.8, 2.5 }) |ior| {
        for ([_]f32{ 20, 100, 233, 400, 800, 1500, 20_000, 1e9 }) |thickness_nm| {
            for ([_]f32{ 0, 0.01, 0.2, 0.5, 0.8, 1 }) |cos_outside| {
                const wanted = exactReflectance(cos_outside, ior, thickness_nm, .{
                    f0[0], f0[1], f0[2],
                });
                const found = reflectanceAt(cos_outside, ior, thickness_nm, f0);
                for (wanted, found) |w, f| {
                    try std.testing.expectApproxEqAbs(std.math.clamp(w, 0, 1), f, 1e-5);
                }
            }
        }
    };
}

test "without a film the surface has its own reflectance, and films begin smoothly" {
    const f0 = [3]f32{ 0.04, 0.2, 0.9 };
    for ([_]f32{ 0, 0.1, 0.5, 1 }) |cos_outside| {
        const none = [_][3]f32{
            reflectanceAt(cos_outside, 1.3, 0, f0),
            reflectanceAt(cos_outside, 1, 400, f0),
        };
        for (none) |found| for (found, f0) |value, bare| {
            try std.testing.expectApproxEqAbs(exactSchlick(bare, cos_outside), value, 1e-6);
        };
        var before = none[0];
        for (1..61) |step| {
            const thickness_nm = 0.5 * @as(f32, @floatFromInt(step));
            const found = reflectanceAt(cos_outside, 1.3, thickness_nm, f0);
            for (found, before) |value, last| {
                try std.testing.expectApproxEqAbs(last, value, 0.01);
            }
            before = found;
        }
    }
}

test "every reflectance is between 0 and 1, of perfect mirrors and at the edges as well" {
    for ([_]f32{ 0, 0.9998, 0.9999, 1 }) |f0| for ([_]f32{ 1, 1.5, 1000 }) |ior| {
        for ([_]f32{ 0, 1, 300, 3e38 }) |thickness_nm| for ([_]f32{ 0, 1e-4, 0.5, 1 }) |angle| {
            for (reflectanceAt(angle, ior, thickness_nm, @splat(f0))) |value| {
                try std.testing.expect(value >= 0 and value <= 1);
            }
        };
    };
}

test "f0 of a reflectance by Schlick's approximation and back" {
    for ([_]f32{ 0.05, 0.4, 0.9, 1 }) |cos_outside| for ([_]f32{ 0, 0.04, 0.5, 1 }) |f0| {
        const reflected: f32 = @floatCast(exactSchlick(f0, cos_outside));
        const found = schlickF0(Single, .splat(@splat(reflected)), .splat(cos_outside));
        try std.testing.expectApproxEqAbs(f0, found.x.lane(0), 1e-5);
    };
    // Less than Schlick's least, more than all, and no rest that f0 makes a difference of.
    const at = struct {
        fn at(reflected: f32, cos_outside: f32) f32 {
            return schlickF0(Single, .splat(@splat(reflected)), .splat(cos_outside)).y.lane(0);
        }
    }.at;
    try std.testing.expectEqual(0, at(0.1, 0.2));
    try std.testing.expectEqual(1, at(1.2, 0.7));
    try std.testing.expectEqual(0, at(1, 0));
}
