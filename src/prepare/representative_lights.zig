//! Stratified resampling (Kitagawa 1996): a few lights that stand for very many.
//!
//! In: punctual lights in world space. Out: some of them, brighter by what they stand for, so that
//! there is as much light as before. Those that have a share of all light or more stay as they are.
//! The others are cut, in the order of the file, in which neighbours mostly are near to each other,
//! into strata of as much light, and of each one is chosen, by its light. Lights that are somewhere
//! and directional ones are chosen apart, for their light has other units. The same lights always
//! give the same choice.

const std = @import("std");
const world = @import("../world.zig");
const emitters = @import("emitters.zig");
const assert = std.debug.assert;
const Allocator = std.mem.Allocator;
const Light = world.Light;

/// At most so many of more lights, from `arena`; none shines if none did. Asserts that no light is
/// an emitter.
pub fn choose(
    gpa: Allocator,
    arena: Allocator,
    lights: []const Light,
    count_max: usize,
) error{OutOfMemory}![]const Light {
    assert(lights.len > count_max);
    var choice: Choice = .{
        .lights = lights,
        .luminances = try gpa.alloc(f64, lights.len),
        .order = undefined,
        .chosen = try .initCapacity(arena, count_max),
    };
    defer gpa.free(choice.luminances);
    choice.order = try gpa.alloc(u32, lights.len);
    defer gpa.free(choice.order);
    var far_count: usize = 0;
    for (lights) |*light| far_count += @intFromBool(light.kind == .directional);
    const near_count = lights.len - far_count;
    const far_room = @min(far_count, @max(count_max / 4, count_max -| near_count));
    choice.add(.near, count_max - far_room);
    choice.add(.far, far_room);
    // A file whose lights are all black has lights all the same.
    return if (choice.chosen.items.len > 0) choice.chosen.items else lights[0..count_max];
}

const Choice = struct {
    lights: []const Light,
    /// By light, those of the kind under way that are still to be chosen; 0 of others.
    luminances: []f64,
    /// Room for numbers of lights.
    order: []u32,
    chosen: std.ArrayList(Light),

    const Kind = enum { near, far };

    /// Chooses at most `room` lights of a kind.
    fn add(choice: *Choice, kind: Kind, room: usize) void {
        var count: usize = 0;
        var sum: f64 = 0;
        for (choice.lights, choice.luminances, 0..) |*light, *luminance, number| {
            assert(light.kind != .emitter);
            luminance.* = 0;
            if ((light.kind == .directional) != (kind == .far)) continue;
            const color = light.intensity;
            luminance.* = emitters.luminanceOf(.{ color[0], color[1], color[2] });
            if (luminance.* == 0) continue;
            sum += luminance.*;
            choice.order[count] = @intCast(number);
            count += 1;
        }
        const left = choice.addBrightest(choice.order[0..count], sum, room);
        if (left > 0) choice.addOfStrata(left);
    }

    /// Takes those as they are that have a share or more of all light that is left. Returns how
    /// much room is left.
    fn addBrightest(choice: *Choice, order: []u32, sum: f64, room: usize) usize {
        std.sort.pdq(u32, order, @as([]const f64, choice.luminances), isBrighter);
        var left = room;
        var rest = sum;
        for (order) |number| {
            const luminance = choice.luminances[number];
            const fits = order.len <= room;
            if (left == 0 or (!fits and luminance * @as(f64, @floatFromInt(left)) < rest)) break;
            choice.chosen.appendAssumeCapacity(choice.lights[number]);
            choice.luminances[number] = 0;
            rest -= luminance;
            left -= 1;
        }
        return left;
    }

    fn isBrighter(luminances: []const f64, a: u32, b: u32) bool {
        if (luminances[a] != luminances[b]) return luminances[a] > luminances[b];
        return a < b;
    }

    /// Takes one light of each of so many strata of those that are left.
    fn addOfStrata(choice: *Choice, count: usize) void {
        var whole: f64 = 0;
        for (choice.luminances) |luminance| whole += luminance;
        if (whole == 0) return;
        const step = whole / @as(f64, @floatFromInt(count));
        var numbers: std.Random.SplitMix64 = .init(0);
        var target = step * fraction(&numbers);
        var stratum: usize = 0;
        var sum: f64 = 0;
        for (choice.lights, choice.luminances) |*light, luminance| {
            sum += luminance;
            var hit_count: f64 = 0;
            while (stratum < count and target < sum) {
                hit_count += 1;
                stratum += 1;
                target = step * (@as(f64, @floatFromInt(stratum)) + fraction(&numbers));
            }
            if (hit_count == 0) continue;
            choice.chosen.appendAssumeCapacity(light.*);
            const brighter = &choice.chosen.items[choice.chosen.items.len - 1];
            for (&brighter.intensity) |*channel| {
                const scaled = channel.* * (hit_count * step / luminance);
                channel.* = @floatCast(@min(scaled, std.math.floatMax(f32)));
            }
        }
    }

    /// In 0..1.
    fn fraction(numbers: *std.Random.SplitMix64) f64 {
        return @as(f64, @floatFromInt(numbers.next() >> 11)) * 0x1p-53;
    }
};

fn lightForTest(kind: Light.Kind, place: f32, intensity: f32) Light {
    return .{
        .kind = kind,
        .from_receiver = false,
        .position = .{ place, 0, 0 },
        .direction = .{ 0, 0, -1 },
        .intensity = .{ intensity, 0.5 * intensity, 0 },
        .range_inv_squared = 0,
        .cone_scale = 0,
        .cone_offset = 1,
    };
}

test "few lights have the light of many, where these are; bright ones stay as they are" {
    const gpa = std.testing.allocator;
    var arena: std.heap.ArenaAllocator = .init(gpa);
    defer arena.deinit();
    var random: std.Random.DefaultPrng = .init(3);
    const lights = try gpa.alloc(Light, 20_000);
    defer gpa.free(lights);
    for (lights, 0..) |*light, index| {
        const intensity = random.random().float(f32);
        light.* = lightForTest(.point, @as(f32, @floatFromInt(index)) / 20_000, intensity);
    }
    lights[77] = lightForTest(.point, 9, 1000);
    lights[78].intensity = @splat(0);
    lights[79] = lightForTest(.directional, 0, 3);
    const chosen = try choose(gpa, arena.allocator(), lights, 64);
    try std.testing.expect(chosen.len <= 64);
    var sums: [2]f64 = @splat(0);
    var middles: [2]f64 = @splat(0);
    for ([_][]const Light{ lights, chosen }, &sums, &middles) |some, *sum, *middle| {
        for (some) |*light| {
            if (light.kind != .point or light.position[0] > 1) continue;
            sum.* += light.intensity[0];
            middle.* += @as(f64, light.intensity[0]) * light.position[0];
        }
        middle.* /= sum.*;
    }
    try std.testing.expectApproxEqRel(sums[0], sums[1], 1e-5);
    try std.testing.expectApproxEqAbs(middles[0], middles[1], 0.01);
    try std.testing.expectEqualDeep(lights[77], chosen[0]);
    try std.testing.expectEqualDeep(lights[79], chosen[chosen.len - 1]);
    const again = try choose(gpa, arena.allocator(), lights, 64);
    try std.testing.expectEqualDeep(chosen, again);
}

test "room is for whichever kind has more; black lights are lights" {
    const gpa = std.testing.allocator;
    var arena: std.heap.ArenaAllocator = .init(gpa);
    defer arena.deinit();
    var lights: [40]Light = undefined;
    for (&lights, 0..) |*light, index|
        light.* = lightForTest(if (index < 3) .point else .directional, 0, 1);
    const chosen = try choose(gpa, arena.allocator(), &lights, 16);
    try std.testing.expect(chosen.len > 8 and chosen.len <= 16);
    try std.testing.expectEqualDeep(lights[0..3], chosen[0..3]);
    var sum: f64 = 0;
    for (chosen[3..]) |*light| sum += light.intensity[0];
    try std.testing.expectApproxEqRel(37, sum, 1e-5);
    for (&lights) |*light| light.intensity = @splat(0);
    try std.testing.expectEqual(16, (try choose(gpa, arena.allocator(), &lights, 16)).len);
}
