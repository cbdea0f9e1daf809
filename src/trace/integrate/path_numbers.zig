//! The numbers that paths in lanes decide by: Sobol points (`sobol.zig`), in dimensions by purpose.
//!
//! In: pixels, samples, bounces. Out: numbers in 0..1. A path has a number whatever became of it
//! before, so that neighbours stay alike as long as they can.

const Sobol = @import("sobol.zig").Sobol;
const position_dimension = @import("sampler.zig").position_dimension;

/// What two numbers are for.
pub const Purpose = enum(i32) { light, light_point, lobe, lobe_direction, chance, medium };

/// Behind the dimensions of all bounces: of surfaces that are gone straight through.
const first_passage = 1 << 16;

/// Of the paths of a group.
pub fn PathNumbers(comptime Lanes: type) type {
    const I32 = Lanes.I32;
    return struct {
        sobol: Sobol(Lanes),
        /// Bounces up to here.
        depth: I32,

        /// Of samples of pixels.
        pub fn init(x: I32, y: I32, sample: I32, depth: I32) @This() {
            return .{ .sobol = .init(x, y, sample), .depth = depth };
        }

        /// Two numbers for a vertex.
        pub fn at(numbers: *const @This(), purpose: Purpose) [2]Lanes.F32 {
            const first: I32 = .splat(position_dimension + 1 + @backingInt(purpose));
            // Eight for each bounce.
            return numbers.sobol.pair(numbers.depth.shiftLeft(3).add(first));
        }

        /// One for a surface that may be gone straight through, behind so many others.
        pub fn atPassage(numbers: *const @This(), count: I32) Lanes.F32 {
            const bounce = numbers.depth.shiftLeft(8);
            return numbers.sobol.pair(bounce.add(count).add(.splat(first_passage)))[0];
        }
    };
}
