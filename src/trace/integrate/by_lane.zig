//! Vectors lane by lane, for work that is done one by one.

/// As many as there are lanes.
pub fn ByLane(comptime Lanes: type) type {
    const lanes = Lanes.count;
    return struct {
        x: [lanes]f32,
        y: [lanes]f32,
        z: [lanes]f32,

        const Self = @This();

        /// Those of some lanes.
        pub fn of(v: Lanes.Vec3) Self {
            return .{ .x = v.x.toArray(), .y = v.y.toArray(), .z = v.z.toArray() };
        }

        /// All the same.
        pub fn splat(v: [3]f32) Self {
            return .{ .x = @splat(v[0]), .y = @splat(v[1]), .z = @splat(v[2]) };
        }

        /// One.
        pub fn at(all: *const Self, lane: usize) [3]f32 {
            return .{ all.x[lane], all.y[lane], all.z[lane] };
        }

        /// Changes one.
        pub fn put(all: *Self, lane: usize, v: [3]f32) void {
            all.x[lane] = v[0];
            all.y[lane] = v[1];
            all.z[lane] = v[2];
        }

        /// In lanes again.
        pub fn toLanes(all: *const Self) Lanes.Vec3 {
            return .{
                .x = .fromArray(all.x),
                .y = .fromArray(all.y),
                .z = .fromArray(all.z),
            };
        }
    };
}
