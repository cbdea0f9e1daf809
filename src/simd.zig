//! The SIMD mathematics library: `F32`, `I32`, `Mask` and `Vec3` of some lanes, in one backend.
//!
//! In: a comptime backend and lane count. Out: value types with equal surfaces in every backend,
//! which a comptime check holds; the same bits from every exact operation, on every target, in
//! threads that called `setFlushToZero`. Inexact ones (`mulAdd`, `minFast`, `maxFast`, those named
//! `OrNegative`, `isNegative`) are for culling only, never for what reaches a pixel.
//!
//! Every operation is inline and counts as one evaluated branch: a function with some hundreds of
//! them starts with `@setEvalBranchQuota`.

const std = @import("std");
const assert = std.debug.assert;
const variant = @import("variant.zig");
const flush_to_zero = @import("simd/flush_to_zero.zig");
const vec3 = @import("simd/vec3.zig");

const scalar = @import("simd/scalar.zig");
const vector = @import("simd/vector.zig");
const intrinsics = @import("simd/intrinsics.zig");

const Backend = variant.Backend;

/// A thread's floating-point control register.
pub const FloatControl = flush_to_zero.FloatControl;
/// Reads the calling thread's.
pub const floatControl = flush_to_zero.floatControl;
/// Puts a state back that was read before.
pub const setFloatControl = flush_to_zero.setFloatControl;
/// Makes denormals zeros in the calling thread; returns the state before.
pub const setFlushToZero = flush_to_zero.setFlushToZero;

/// The lane types of a backend. One lane is always the scalar backend, so that code for single
/// values exists once. Asserts (comptime) that `lanes` is 1, 4, 8 or 16, and 4 for intrinsics.
pub fn Lanes(comptime backend: Backend, comptime lanes: comptime_int) type {
    return LanesOf(if (lanes == 1) .scalar else backend, lanes);
}

fn LanesOf(comptime chosen: Backend, comptime lanes: comptime_int) type {
    if (lanes != 1 and lanes != 4 and lanes != 8 and lanes != 16) {
        @compileError("lanes are 1, 4, 8 or 16");
    }
    const Operations = BackendOf(chosen);
    return struct {
        pub const backend = chosen;
        pub const count = lanes;
        pub const F32 = Operations.F32x(lanes);
        pub const I32 = Operations.I32x(lanes);
        pub const Mask = Operations.Mask(lanes);
        pub const Vec3 = vec3.Vec3x(F32, Mask);

        /// The least lane of every vector, that of `vectors[l]` in lane l, by a third of the
        /// instructions of as many reductions. For culling only, as `minFast`. Asserts (comptime)
        /// that the number of lanes is a power of two.
        pub inline fn minOfEach(vectors: *const [lanes]F32) F32 {
            return ofEach(lanes, F32.minFast, vectors, 0, 1);
        }

        /// The same of the greatest.
        pub inline fn maxOfEach(vectors: *const [lanes]F32) F32 {
            return ofEach(lanes, F32.maxFast, vectors, 0, 1);
        }

        /// What is left of `vectors[first + i * step]`, i below `vector_count`, in turns in the
        /// lanes: of two such by twice the step, halves side by side, and `join` of them.
        inline fn ofEach(
            comptime vector_count: usize,
            comptime join: fn (F32, F32) callconv(.@"inline") F32,
            vectors: *const [lanes]F32,
            comptime first: usize,
            comptime step: usize,
        ) F32 {
            if (vector_count == 1) return vectors[first];
            comptime assert(vector_count % 2 == 0);
            const even = ofEach(vector_count / 2, join, vectors, first, 2 * step);
            const odd = ofEach(vector_count / 2, join, vectors, first + step, 2 * step);
            return join(even.interleaveLow(odd), even.interleaveHigh(odd));
        }
    };
}

fn BackendOf(comptime backend: Backend) type {
    return switch (backend) {
        .scalar => scalar,
        .vector => vector,
        .intrinsics => intrinsics,
    };
}

const lane_types = [_][]const u8{ "F32x", "I32x", "Mask" };

// Every backend has what the reference has, of the same type, and nothing more.
comptime {
    @setEvalBranchQuota(100_000);
    for (std.enums.values(Backend)) |backend| {
        for (lane_types) |lane_type| {
            requireDeclarations(.scalar, backend, lane_type);
            requireDeclarations(backend, .scalar, lane_type);
        }
    }
}

/// Fails to compile unless `candidate` declares what `reference` does in the type of this name.
fn requireDeclarations(
    comptime reference: Backend,
    comptime candidate: Backend,
    comptime lane_type: []const u8,
) void {
    const Wanted = @field(BackendOf(reference), lane_type)(4);
    const Found = @field(BackendOf(candidate), lane_type)(4);
    for (@typeInfo(Wanted).@"struct".decl_names) |name| {
        const place = "simd backend " ++ @tagName(candidate) ++ ": " ++ lane_type ++ "." ++ name;
        if (!@hasDecl(Found, name)) @compileError(place ++ " is missing");
        const wanted = @TypeOf(@field(Wanted, name));
        const found = @TypeOf(@field(Found, name));
        if (!sameSurface(reference, wanted, candidate, found)) {
            @compileError(place ++ " should be " ++ @typeName(wanted));
        }
    }
}

/// Whether two types differ in nothing but whose lane types they name.
fn sameSurface(
    comptime a_backend: Backend,
    comptime a: ?type,
    comptime b_backend: Backend,
    comptime b: ?type,
) bool {
    const A = a orelse return b == null;
    const B = b orelse return false;
    if (A == B) return true;
    for (lane_types) |lane_type| {
        if (A == @field(BackendOf(a_backend), lane_type)(4)) {
            return B == @field(BackendOf(b_backend), lane_type)(4);
        }
    }
    if (@typeInfo(A) == .pointer and @typeInfo(B) == .pointer) {
        return sameSurface(a_backend, std.meta.Child(A), b_backend, std.meta.Child(B));
    }
    if (@typeInfo(A) != .@"fn" or @typeInfo(B) != .@"fn") return false;
    const a_fn = @typeInfo(A).@"fn";
    const b_fn = @typeInfo(B).@"fn";
    if (a_fn.param_types.len != b_fn.param_types.len) return false;
    for (a_fn.param_types, b_fn.param_types) |a_param, b_param| {
        if (!sameSurface(a_backend, a_param, b_backend, b_param)) return false;
    }
    return sameSurface(a_backend, a_fn.return_type, b_backend, b_fn.return_type);
}

test {
    _ = @import("simd/agreement.zig");
    _ = flush_to_zero;
}
