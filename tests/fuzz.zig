//! Tests of the fuzzers: a few executions of each target, the files of earlier findings, and that
//! what is changed of a file keeps what counts and checks its parts.

const std = @import("std");
const Campaign = campaign_file.Campaign;
const Mutator = @import("../fuzz/mutate.zig").Mutator;
const Name = @import("../fuzz/names.zig").Name;
const campaign_file = @import("../fuzz/campaign.zig");
const raylane = @import("raylane");
const targets = @import("../fuzz/targets.zig");
const expect = std.testing.expect;
const gpa = std.testing.allocator;
const io = std.testing.io;

/// Executions of each target.
const step_count = 100;

test "a short campaign of every target finds nothing" {
    if (std.testing.environ.getPosix("RAYLANE_EMULATED") != null) return error.SkipZigTest;
    var arena: std.heap.ArenaAllocator = .init(gpa);
    defer arena.deinit();
    var beside = std.testing.tmpDir(.{});
    defer beside.cleanup();
    try campaign_file.fill(beside.dir, io);
    for (targets.list) |*target| {
        errdefer std.debug.print("fuzz:{t}\n", .{target.name});
        var campaign: Campaign = try .init(target, gpa, io, beside.dir, &.{}, 1);
        defer campaign.deinit();
        const seeds = try campaign_file.seedsOf(arena.allocator(), io, target);
        try expect(seeds.len > 0);
        for (seeds) |seed| try campaign.addSeed(seed);
        // What a campaign begins with is whole.
        try expect(campaign.outcomes.get(.read) > 0);
        for (0..step_count) |_| try campaign.step();
    }
}

test "what was found once is not found again" {
    var arena_state: std.heap.ArenaAllocator = .init(gpa);
    defer arena_state.deinit();
    const arena = arena_state.allocator();
    var beside = std.testing.tmpDir(.{});
    defer beside.cleanup();
    try campaign_file.fill(beside.dir, io);
    var folder = try std.Io.Dir.cwd().openDir(io, "fuzz/findings", .{ .iterate = true });
    defer folder.close(io);
    const manifest = try folder.readFileAlloc(io, "manifest.tsv", arena, .limited(1 << 20));
    var lines = std.mem.tokenizeScalar(u8, manifest, '\n');
    var listed_count: usize = 0;
    while (lines.next()) |line| : (listed_count += 1) {
        errdefer std.debug.print("{s}\n", .{line});
        var columns = std.mem.splitScalar(u8, line, '\t');
        const file = columns.next().?;
        const name = std.meta.stringToEnum(Name, columns.next().?).?;
        const outcome = std.meta.stringToEnum(targets.Outcome, columns.next().?).?;
        // A build without Draco has no such target.
        const target = targets.named(name) orelse continue;
        const input = try folder.readFileAlloc(io, file, arena, .limited(1 << 20));
        for ([_]bool{ false, true }) |guarded| {
            var campaign: Campaign = try .init(target, gpa, io, beside.dir, &.{}, 0);
            defer campaign.deinit();
            _ = try campaign.execute(input, .{ .guarded = guarded, .draws = true });
            try std.testing.expectEqual(1, campaign.outcomes.get(outcome));
        }
    }
    var file_count: usize = 0;
    var entries = folder.iterate();
    while (try entries.next(io)) |_| file_count += 1;
    try std.testing.expectEqual(listed_count + 1, file_count);
}

test "a changed PNG has checksums that fit, and a changed GLB lengths" {
    var arena: std.heap.ArenaAllocator = .init(gpa);
    defer arena.deinit();
    const cwd: std.Io.Dir = .cwd();
    const limit: std.Io.Limit = .limited(1 << 16);
    const png = try cwd.readFileAlloc(io, "tests/images/rgba.png", arena.allocator(), limit);
    const glb = try cwd.readFileAlloc(io, "fuzz/corpus/glb/plain.glb", arena.allocator(), limit);
    var random: std.Random.DefaultPrng = .init(2);
    const mutator: Mutator = .{
        .arena = arena.allocator(),
        .random = random.random(),
        .others = &.{ png, glb },
    };
    const container = @import("../fuzz/mutate/container.zig");
    var mended_count: usize = 0;
    for (0..100) |_| {
        const changed = try container.change(.glb, &mutator, glb);
        const length = std.mem.readInt(u32, changed[8..12], .little);
        if (length == changed.len) mended_count += 1;
        const picture = try container.change(.png, &mutator, png);
        var reason: raylane.decode.Reason = .{};
        _ = raylane.decode.info(picture, &reason) catch {};
        try expect(std.mem.find(u8, reason.text(), "checksum") == null);
    }
    // The others are cut.
    try expect(mended_count > 60);
}

test "same seed, same inputs" {
    var arena: std.heap.ArenaAllocator = .init(gpa);
    defer arena.deinit();
    for (std.enums.values(@import("../fuzz/mutate.zig").Structure)) |structure| {
        var results: [2][]const u8 = undefined;
        for (&results) |*result| {
            var random: std.Random.DefaultPrng = .init(3);
            const mutator: Mutator = .{
                .arena = arena.allocator(),
                .random = random.random(),
                .others = &.{"{\"a\":[1,2]}"},
            };
            result.* = "{\"b\":{\"c\":[0,-1.5,\"d\"]}} 1 2 3";
            for (0..50) |_| result.* = try mutator.mutate(structure, result.*);
        }
        try std.testing.expectEqualStrings(results[0], results[1]);
    }
}
