//! Vectors of three floats in lanes: one struct of three lane values (structure of arrays).
//!
//! In: any backend's float and mask types. Out: the same bits whatever the backend, since every
//! formula is written here once, with its order of operations fixed, from exact operations only.

/// A three-dimensional vector in each lane of `F32`, selected by `Mask`.
pub fn Vec3x(comptime F32: type, comptime Mask: type) type {
    return struct {
        x: F32,
        y: F32,
        z: F32,

        const Self = @This();
        pub const count = F32.count;

        /// The same vector in every lane.
        pub inline fn splat(vector: [3]f32) Self {
            return .{ .x = .splat(vector[0]), .y = .splat(vector[1]), .z = .splat(vector[2]) };
        }

        /// a + b.
        pub inline fn add(a: Self, b: Self) Self {
            return .{ .x = a.x.add(b.x), .y = a.y.add(b.y), .z = a.z.add(b.z) };
        }

        /// a - b.
        pub inline fn sub(a: Self, b: Self) Self {
            return .{ .x = a.x.sub(b.x), .y = a.y.sub(b.y), .z = a.z.sub(b.z) };
        }

        /// Component by component.
        pub inline fn mul(a: Self, b: Self) Self {
            return .{ .x = a.x.mul(b.x), .y = a.y.mul(b.y), .z = a.z.mul(b.z) };
        }

        /// Every component times `factor`.
        pub inline fn scale(a: Self, factor: F32) Self {
            return .{ .x = a.x.mul(factor), .y = a.y.mul(factor), .z = a.z.mul(factor) };
        }

        /// -a, by the sign bits.
        pub inline fn neg(a: Self) Self {
            return .{ .x = a.x.neg(), .y = a.y.neg(), .z = a.z.neg() };
        }

        /// Component by component.
        pub inline fn abs(a: Self) Self {
            return .{ .x = a.x.abs(), .y = a.y.abs(), .z = a.z.abs() };
        }

        /// (x x' + y y') + z z'.
        pub inline fn dot(a: Self, b: Self) F32 {
            return a.x.mul(b.x).add(a.y.mul(b.y)).add(a.z.mul(b.z));
        }

        /// y z' - z y' and so on around. Exactly antisymmetric but for the sign of zeros.
        pub inline fn cross(a: Self, b: Self) Self {
            return .{
                .x = a.y.mul(b.z).sub(a.z.mul(b.y)),
                .y = a.z.mul(b.x).sub(a.x.mul(b.z)),
                .z = a.x.mul(b.y).sub(a.y.mul(b.x)),
            };
        }

        /// sqrt(dot(a, a)); infinite where the square overflows.
        pub inline fn length(a: Self) F32 {
            return a.dot(a).sqrt();
        }

        /// a times (1 / length): one division and three multiplications. The components of a
        /// vector whose square flushes to zero are NaN or infinite: the caller masks it.
        pub inline fn normalize(a: Self) Self {
            return a.scale(F32.splat(1).div(a.length()));
        }

        /// Component by component, with `F32.min`'s rule for NaN and zeros.
        pub inline fn min(a: Self, b: Self) Self {
            return .{ .x = a.x.min(b.x), .y = a.y.min(b.y), .z = a.z.min(b.z) };
        }

        /// Component by component, with `F32.max`'s rule for NaN and zeros.
        pub inline fn max(a: Self, b: Self) Self {
            return .{ .x = a.x.max(b.x), .y = a.y.max(b.y), .z = a.z.max(b.z) };
        }

        /// The vector of `a` in the lanes where the mask is set, else of `b`.
        pub inline fn select(mask: Mask, a: Self, b: Self) Self {
            return .{
                .x = F32.select(mask, a.x, b.x),
                .y = F32.select(mask, a.y, b.y),
                .z = F32.select(mask, a.z, b.z),
            };
        }

        /// The vector in one lane; goes through memory. Asserts `lane_index < count`.
        pub inline fn lane(a: Self, lane_index: usize) [3]f32 {
            return .{ a.x.lane(lane_index), a.y.lane(lane_index), a.z.lane(lane_index) };
        }

        /// The same of a vector that lies in memory, of which nothing else is read.
        pub inline fn laneIn(a: *const Self, lane_index: usize) [3]f32 {
            return .{ a.x.laneIn(lane_index), a.y.laneIn(lane_index), a.z.laneIn(lane_index) };
        }
    };
}
