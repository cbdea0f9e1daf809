//! One exported function an operation of the SIMD library, so that lowering.py can count what each
//! becomes.
//!
//! In: the module `choice`, which names backend and lanes. Out: an object whose functions are named
//! `F32.add` and so on, take lane values in registers and return them there. With one lane, which
//! is the scalar backend, registers hold single values.

const simd = @import("simd");
const choice = @import("choice");

const L = simd.Lanes(choice.backend, choice.lanes);

const shifts = struct {
    pub inline fn shiftLeft(a: L.I32) L.I32 {
        return a.shiftLeft(7);
    }
    pub inline fn shiftRight(a: L.I32) L.I32 {
        return a.shiftRight(7);
    }
};

/// How a value of the library's type passes in registers.
fn Register(comptime T: type) type {
    if (T == L.F32) return if (L.count == 1) f32 else @Vector(L.count, f32);
    if (T == L.I32) return if (L.count == 1) i32 else @Vector(L.count, i32);
    if (T == L.Mask) return if (L.count == 1) bool else @FieldType(L.Mask, "v");
    if (T == usize) return u32;
    return T;
}

inline fn unwrapped(value: anytype) Register(@TypeOf(value)) {
    const T = @TypeOf(value);
    if (T == L.F32 or T == L.I32 or T == L.Mask) return if (L.count == 1) value.v[0] else value.v;
    return value;
}

inline fn wrapped(comptime T: type, value: Register(T)) T {
    if (T == L.F32 or T == L.I32 or T == L.Mask) {
        return .{ .v = if (L.count == 1) .{value} else value };
    }
    return value;
}

/// The operation as a C function of one, two or three registers.
fn Exported(comptime operation: anytype) type {
    const signature = @typeInfo(@TypeOf(operation)).@"fn";
    const P = signature.param_types;
    const Result = Register(signature.return_type.?);
    return switch (P.len) {
        1 => struct {
            fn call(a: Register(P[0].?)) callconv(.c) Result {
                return unwrapped(operation(wrapped(P[0].?, a)));
            }
        },
        2 => struct {
            fn call(a: Register(P[0].?), b: Register(P[1].?)) callconv(.c) Result {
                return unwrapped(operation(wrapped(P[0].?, a), wrapped(P[1].?, b)));
            }
        },
        3 => struct {
            fn call(
                a: Register(P[0].?),
                b: Register(P[1].?),
                c: Register(P[2].?),
            ) callconv(.c) Result {
                return unwrapped(operation(
                    wrapped(P[0].?, a),
                    wrapped(P[1].?, b),
                    wrapped(P[2].?, c),
                ));
            }
        },
        else => @compileError("no operation has so many operands"),
    };
}

fn exportAll(
    comptime prefix: []const u8,
    comptime Operations: type,
    comptime names: []const []const u8,
) void {
    for (names) |name| {
        @export(&Exported(@field(Operations, name)).call, .{ .name = prefix ++ "." ++ name });
    }
}

const Ray = extern struct { direction_inverse: [3]f32, origin_scaled: [3]f32, near: [3]u32 };

/// One ray against the boxes of a wide node: the kernel of single-ray traversal. Returns the boxes
/// hit between `enter` and `leave`, a bit each.
fn slab(comptime fast: bool, planes: *const [6][L.count]f32, ray: *const Ray) u32 {
    var enter: L.F32 = .zero();
    var leave: L.F32 = .splat(1000);
    for (0..3) |axis| {
        const inverse: L.F32 = .splat(ray.direction_inverse[axis]);
        const origin: L.F32 = .splat(ray.origin_scaled[axis]);
        const near = L.F32.load(&planes[ray.near[axis]]).mul(inverse).sub(origin);
        const far = L.F32.load(&planes[ray.near[axis] ^ 1]).mul(inverse).sub(origin);
        enter = if (fast) near.maxFast(enter) else near.max(enter);
        leave = if (fast) far.minFast(leave) else far.min(leave);
    }
    return enter.le(leave).bits();
}

const Hits = struct { t: L.F32, triangle: L.I32, active: L.Mask };

/// Planes of triangles against as many rays as there are lanes: masks are carried from one to the
/// next, tested and select.
fn nearest(hits: *Hits, directions: *const L.Vec3, planes: [*]const [4]f32, count: usize) void {
    for (planes[0..count], 0..) |plane, index| {
        const slope = L.Vec3.splat(plane[0..3].*).dot(directions.*);
        const t = L.F32.splat(plane[3]).div(slope);
        const hit = t.gt(.zero()).bitAnd(t.lt(hits.t)).bitAnd(hits.active);
        if (hit.none()) continue;
        hits.t = .select(hit, t, hits.t);
        hits.triangle = .select(hit, .splat(@intCast(index)), hits.triangle);
        hits.active = hits.active.andNot(t.lt(.splat(1)));
    }
}

const kernels = struct {
    fn slabExact(planes: *const [6][L.count]f32, ray: *const Ray) callconv(.c) u32 {
        return slab(false, planes, ray);
    }
    fn slabFast(planes: *const [6][L.count]f32, ray: *const Ray) callconv(.c) u32 {
        return slab(true, planes, ray);
    }
    fn nearestHit(
        hits: *Hits,
        directions: *const L.Vec3,
        planes: [*]const [4]f32,
        count: usize,
    ) callconv(.c) void {
        return nearest(hits, directions, planes, count);
    }
};

comptime {
    @setEvalBranchQuota(100_000);
    for (.{ "slabExact", "slabFast", "nearestHit" }) |name| {
        @export(&@field(kernels, name), .{ .name = "Kernel." ++ name });
    }
    exportAll("F32", L.F32, &.{
        "load",  "store",     "splat",     "add",
        "sub",   "mul",       "div",       "sqrt",
        "neg",   "abs",       "copySign",  "mulAdd",
        "min",   "max",       "minFast",   "maxFast",
        "eq",    "lt",        "le",        "gt",
        "ge",    "select",    "reduceMin", "reduceMax",
        "toI32", "reduceSum",
    });
    exportAll("F32", L.F32, &.{
        "minOrNegative", "maxOrNegative", "isNegative", "leOrNegative",
    });
    if (L.count > 1) exportAll("F32", L.F32, &.{ "interleaveLow", "interleaveHigh" });
    exportAll("I32", L.I32, &.{
        "add", "sub", "mul", "min", "max",    "bitAnd", "bitOr", "bitXor",
        "eq",  "lt",  "le",  "gt",  "select", "toF32",
    });
    exportAll("I32", shifts, &.{ "shiftLeft", "shiftRight" });
    exportAll("Mask", L.Mask, &.{
        "fromBits", "bitAnd", "bitOr", "bitNot", "andNot",
        "any",      "all",    "none",  "bits",   "popCount",
    });
}
