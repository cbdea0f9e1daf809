//! Pearson's chi-squared test of directions against their density, for tests of lobes.
//!
//! In: a lobe that samples directions and knows their density. Out: a failed test where the two do
//! not belong together. Directions are counted in cells of equal solid angle of the whole sphere
//! and compared with the density's integral over each; cells that expect few are one. The limit is
//! that of one in a thousand by Wilson and Hilferty 1931 ("The Distribution of Chi-Square").

const std = @import("std");
const testing = std.testing;

const height_count = 20;
const azimuth_count = 16;
const sample_count = 20_000;
/// Points a side of a cell that the density is integrated over.
const point_count = 8;
/// Fewer expected make a cell's share of chi-squared no longer chi-squared.
const expected_least = 5;
/// Of the normal distribution, which exceeds it once in a thousand times.
const quantile = 3.09;

/// Fails unless `lobe.sample(numbers: [3]f32) [3]f32`, unit vectors in a frame whose z the cells'
/// circles of equal height are about, has the density `lobe.pdf(direction: [3]f32) f32` per
/// steradian; if it is optional, as often as it is not null. Narrow lobes, of less than a tenth of
/// a radian, are beyond the cells.
pub fn expectDistributed(lobe: anytype) !void {
    const result: Result = .of(lobe);
    errdefer std.debug.print("{}\n", .{result});
    try testing.expect(result.isLikely());
}

const Result = struct {
    chi_squared: f64 = 0,
    freedom: f64 = 0,
    few_expected: f64 = 0,
    few_observed: f64 = 0,

    fn of(lobe: anytype) Result {
        var observed: [height_count * azimuth_count]u32 = @splat(0);
        var random = std.Random.DefaultPrng.init(1);
        for (0..sample_count) |_| {
            var numbers: [3]f32 = undefined;
            for (&numbers) |*number| number.* = random.random().float(f32);
            const found: ?[3]f32 = lobe.sample(numbers);
            if (found) |direction| observed[cellOf(direction)] += 1;
        }
        var result: Result = .{};
        for (integrate(lobe), observed) |expected, count| {
            if (expected < expected_least) {
                result.few_expected += expected;
                result.few_observed += @floatFromInt(count);
            } else {
                result.add(expected, @floatFromInt(count));
            }
        }
        if (result.few_expected >= expected_least) {
            result.add(result.few_expected, result.few_observed);
        }
        // The density's integral is known, so one cell is what the others leave.
        result.freedom -= 1;
        return result;
    }

    fn add(result: *Result, expected: f64, observed: f64) void {
        const off = observed - expected;
        result.chi_squared += off * off / expected;
        result.freedom += 1;
    }

    fn isLikely(result: Result) bool {
        // As many as hardly ever come where so few are expected.
        if (result.few_expected < expected_least and result.few_observed > 4 * expected_least) {
            return false;
        }
        if (result.freedom < 5) return false;
        const spread = 2 / (9 * result.freedom);
        const root = 1 - spread + quantile * @sqrt(spread);
        return result.chi_squared <= result.freedom * root * root * root;
    }
};

fn cellOf(direction: [3]f32) usize {
    const height = (direction[2] + 1) / 2 * height_count;
    const turn = std.math.atan2(direction[1], direction[0]) / (2 * std.math.pi) + 0.5;
    const row: usize = @intFromFloat(std.math.clamp(height, 0, height_count - 1));
    const column: usize = @intFromFloat(std.math.clamp(turn * azimuth_count, 0, azimuth_count - 1));
    return row * azimuth_count + column;
}

/// Samples that each cell expects.
fn integrate(lobe: anytype) [height_count * azimuth_count]f64 {
    var expected: [height_count * azimuth_count]f64 = @splat(0);
    const rows = height_count * point_count;
    const columns = azimuth_count * point_count;
    for (0..rows) |row| for (0..columns) |column| {
        const z = (@as(f32, @floatFromInt(row)) + 0.5) / rows * 2 - 1;
        const turn = (@as(f32, @floatFromInt(column)) + 0.5) / columns - 0.5;
        const radius = @sqrt(1 - z * z);
        const angle = turn * 2 * std.math.pi;
        const density = lobe.pdf(.{ radius * @cos(angle), radius * @sin(angle), z });
        const solid_angle = 4 * std.math.pi / @as(f64, rows * columns);
        expected[row / point_count * azimuth_count + column / point_count] +=
            density * solid_angle * sample_count;
    };
    return expected;
}

/// Directions of the upper half sphere, even ones.
const Half = struct {
    /// What the density is said to be, times 1 / (2 pi), by height.
    slope: f32,

    fn sample(_: *const Half, numbers: [3]f32) [3]f32 {
        const radius = @sqrt(1 - numbers[0] * numbers[0]);
        const angle = numbers[1] * 2 * std.math.pi;
        return .{ radius * @cos(angle), radius * @sin(angle), numbers[0] };
    }

    fn pdf(half: *const Half, direction: [3]f32) f32 {
        if (direction[2] < 0) return 0;
        return (1 + half.slope * (direction[2] - 0.5)) / (2 * std.math.pi);
    }
};

test "even directions are even, and not quite even ones are found out" {
    try expectDistributed(&Half{ .slope = 0 });
    try testing.expect(!Result.of(&Half{ .slope = 0.3 }).isLikely());
    try testing.expect(!Result.of(&Half{ .slope = 2 }).isLikely());
}
