//! Parts of pictures: each has the whole's pixels, all together make the whole's file, and what is
//! no part of the same picture is refused by name.
//!
//! In: a small picture by all integrators, whole, cropped and dealt out. Out: bytes of files beside
//! each other.

const std = @import("std");
const builtin = @import("builtin");
const raylane = @import("raylane");
const testing = std.testing;
const Diagnostic = raylane.diagnostic.Diagnostic;
const Session = raylane.session.Session;
const Target = raylane.output.Target;
const settings = raylane.settings;
const gpa = testing.allocator;

const width = 20;
const height = 18;

/// A session with a view, and a folder for what it writes.
const Bench = struct {
    session: Session,
    diagnostic: Diagnostic,
    temporaries: raylane.output.TemporaryFiles,
    folder: testing.TmpDir,
    path_buffer: [std.fs.max_path_bytes]u8,
    path_length: usize,

    /// In place.
    fn init(bench: *Bench, view: settings.View) !void {
        bench.diagnostic = .{};
        bench.temporaries = .{};
        bench.folder = testing.tmpDir(.{});
        bench.path_length = try bench.folder.dir.realPath(testing.io, &bench.path_buffer);
        const session = &bench.session;
        session.* = .init(gpa, testing.io, 2, &bench.diagnostic);
        try session.load("builtin:cornell", .{});
        try session.pose(.{ .lanes = raylane.variant.compiled[0].lanes });
        try bench.look(view);
    }

    fn look(bench: *Bench, view: settings.View) !void {
        try bench.session.view(view);
        bench.session.identify("1.0");
    }

    fn deinit(bench: *Bench) void {
        bench.session.deinit();
        bench.folder.cleanup();
    }

    /// The caller frees it.
    fn pathOf(bench: *const Bench, name: []const u8) ![]const u8 {
        const folder = bench.path_buffer[0..bench.path_length];
        return std.fs.path.join(gpa, &.{ folder, name });
    }

    fn open(bench: *Bench, name: []const u8) !Target {
        const path = try bench.pathOf(name);
        defer gpa.free(path);
        return .openFile(testing.io, &bench.temporaries, path, &bench.diagnostic);
    }

    fn render(
        bench: *Bench,
        choices: settings.Render,
        part: settings.Part,
        name: []const u8,
        write: settings.Write,
    ) !void {
        var chosen = choices;
        chosen.part = part;
        chosen.is_merged = part != .whole and write.format == .exr;
        try bench.session.render(chosen);
        var target = try bench.open(name);
        try bench.session.write(&target, write);
    }

    /// Merges files into one.
    fn merge(
        bench: *Bench,
        names: []const []const u8,
        output: []const u8,
        format: settings.Format,
    ) !void {
        var paths: [4][]const u8 = undefined;
        var count: usize = 0;
        defer for (paths[0..count]) |path| gpa.free(path);
        for (names) |name| {
            paths[count] = try bench.pathOf(name);
            count += 1;
        }
        const pool = &bench.session.pool;
        bench.diagnostic = .{};
        var merged = try raylane.merge.run(gpa, testing.io, paths[0..count], .{
            .version = "1.0",
            .pool = pool,
        }, &bench.diagnostic);
        defer merged.deinit();
        var target = try bench.open(output);
        try merged.write(format, pool, &target, &bench.diagnostic);
    }

    fn expectSame(bench: *const Bench, first: []const u8, second: []const u8) !void {
        const limit: std.Io.Limit = .limited(1 << 20);
        const one = try bench.folder.dir.readFileAlloc(testing.io, first, gpa, limit);
        defer gpa.free(one);
        const other = try bench.folder.dir.readFileAlloc(testing.io, second, gpa, limit);
        defer gpa.free(other);
        try testing.expectEqualSlices(u8, one, other);
    }

    /// Merging fails, and says why and of which file.
    fn expectRefused(
        bench: *Bench,
        names: []const []const u8,
        file: []const u8,
        why: []const u8,
    ) !void {
        errdefer std.debug.print("{s}: {s}\n", .{
            bench.diagnostic.place.text(), bench.diagnostic.message.text(),
        });
        try testing.expectError(error.InvalidInput, bench.merge(names, "no.png", .png));
        try testing.expect(std.mem.endsWith(u8, bench.diagnostic.place.text(), file));
        try testing.expect(std.mem.find(u8, bench.diagnostic.message.text(), why) != null);
        const result = bench.folder.dir.access(testing.io, "no.png", .{});
        try testing.expectError(error.FileNotFound, result);
    }
};

const crops = [_]settings.Part{
    .{ .crop = .{ .pixels = .{ 0, 0, 3, height } } },
    .{ .crop = .{ .pixels = .{ 3, 0, width, height } } },
};

fn tile(number: u32, count: u32) settings.Part {
    return .{ .tile = .{ .number = number, .count = count } };
}

test "parts by all integrators have the whole's pixels, and merge into its files" {
    var bench: Bench = undefined;
    try bench.init(.{ .resolution = .{ width, height }, .environment = .{ .source = .none } });
    defer bench.deinit();
    for ([_]settings.Render{
        .{ .sample_count = 1, .layers = .init(.{ .depth = true }) },
        .{
            .integrator = .lights,
            .sample_count = 1,
            .depth = 1,
            .lights = .{ .virtual_count = 9, .sky_count = 9 },
        },
        .{ .integrator = .path, .sample_count = 2, .depth = 1, .denoise = true },
    }, 0..) |choices, index| {
        // Emulated it takes long, and which pixels are traced is no matter of lanes.
        if (builtin.cpu.arch == .arm and index > 0) continue;
        const format: settings.Format = if (index == 0) .exr else .png;
        const write: settings.Write = .{ .format = format };
        try bench.render(choices, .whole, "whole", write);
        if (choices.integrator != .lights) try expectCrops(&bench, choices, format);
        if (choices.integrator == .path) continue;
        for ([_][]const u8{ "1", "2" }, 1..) |name, number|
            try bench.render(choices, tile(@intCast(number), 2), name, .{ .format = .exr });
        try bench.merge(&.{ "2", "1" }, "merged", format);
        try bench.expectSame("whole", "merged");
    }
}

/// After the whole has been rendered: that its crops are cut from it, alone and merged.
fn expectCrops(bench: *Bench, choices: settings.Render, format: settings.Format) !void {
    var whole = bench.session.film.?;
    bench.session.film = null;
    defer whole.deinit(gpa);
    for (crops, [_][]const u8{ "1", "2" }) |part, name| {
        try bench.render(choices, part, name, .{ .format = .exr });
        const own = part.crop.pixels;
        if (choices.denoise) {
            var alone = choices;
            alone.part = part;
            try bench.session.render(alone);
        }
        const film = &bench.session.film.?;
        for (own[1]..own[3]) |y| for (own[0]..own[2]) |x| {
            const found = film.image.at(@intCast(x - own[0]), @intCast(y - own[1])).*;
            try testing.expectEqual(whole.image.at(@intCast(x), @intCast(y)).*, found);
        };
    }
    try bench.merge(&.{ "2", "1" }, "merged", format);
    try bench.expectSame("whole", "merged");
}

test "a crop in other formats is cut from the whole, its background and exposure as well" {
    var bench: Bench = undefined;
    try bench.init(.{
        .resolution = .{ 32, 18 },
        .camera = .auto,
        .environment = .{ .source = .none },
    });
    defer bench.deinit();
    const choices: settings.Render = .{ .sample_count = 1, .depth = 0 };
    const write: settings.Write = .{ .format = .ppm, .exposure = .auto };
    try bench.render(choices, .whole, "whole", write);
    const shares: settings.Part = .{ .crop = .{ .shares = .{ 0.25, 0.5, 1, 1 } } };
    try bench.render(choices, shares, "crop", write);
    const report = bench.session.report(choices);
    try testing.expectEqual([2]u32{ 24, 9 }, .{ report.width, report.height });
    try testing.expectEqual(1, report.sample_mean);
    var buffers: [2][4096]u8 = undefined;
    const dir = bench.folder.dir;
    const whole = try dir.readFile(testing.io, "whole", &buffers[0]);
    const crop = try dir.readFile(testing.io, "crop", &buffers[1]);
    const head = "P6\n32 18\n255\n".len;
    try testing.expectEqual("P6\n24 9\n255\n".len + 24 * 9 * 3, crop.len);
    for (0..9) |row| {
        const from = whole[head + ((9 + row) * 32 + 8) * 3 ..][0 .. 24 * 3];
        const to = crop["P6\n24 9\n255\n".len + row * 24 * 3 ..][0 .. 24 * 3];
        try testing.expectEqualSlices(u8, from, to);
    }
}

test "what is not all of one picture is refused, and says which file and why" {
    var bench: Bench = undefined;
    const dark: settings.Environment = .{ .source = .none };
    const view: settings.View = .{ .resolution = .{ width, height }, .environment = dark };
    try bench.init(view);
    defer bench.deinit();
    const choices: settings.Render = .{ .sample_count = 1, .depth = 0 };
    const write: settings.Write = .{ .format = .exr };
    for (crops, [_][]const u8{ "a", "b" }) |part, name|
        try bench.render(choices, part, name, write);
    const wide: settings.Part = .{ .crop = .{ .pixels = .{ 2, 7, width, height } } };
    try bench.render(choices, wide, "wide", write);
    try bench.render(choices, tile(1, 2), "1", write);
    try bench.render(choices, tile(2, 2), "2", write);
    try bench.render(choices, tile(3, 3), "third", write);
    try bench.render(choices, tile(2, 2), "dark", .{ .format = .exr, .exposure = .{ .ev = -1 } });
    try bench.render(choices, .whole, "whole", write);
    bench.session.identity.?.version = "0.9";
    try bench.render(choices, tile(2, 2), "old", write);
    bench.session.identity.?.version = "1.0";
    bench.session.identity.?.scene += 1;
    try bench.render(choices, tile(2, 2), "scene", write);
    bench.session.identity.?.scene -= 1;
    bench.session.traced.is_partial = true;
    var target = try bench.open("stopped");
    try bench.session.write(&target, write);
    try bench.look(.{ .resolution = .{ width, height - 1 }, .environment = dark });
    try bench.render(choices, tile(2, 2), "size", write);
    const dir = bench.folder.dir;
    try dir.writeFile(testing.io, .{ .sub_path = "text", .data = "P6\n" });
    var buffer: [1 << 16]u8 = undefined;
    const first = try dir.readFile(testing.io, "a", &buffer);
    first[std.mem.find(u8, first, "[0,0,3,18]").? + "[0,0,".len] = '2';
    try dir.writeFile(testing.io, .{ .sub_path = "changed", .data = first });
    const second = try dir.readFile(testing.io, "2", &buffer);
    try dir.writeFile(testing.io, .{ .sub_path = "cut", .data = second[0 .. second.len / 2] });
    second[std.mem.find(u8, second, "{\"version\"").?] = '[';
    try dir.writeFile(testing.io, .{ .sub_path = "damaged", .data = second });

    try bench.merge(&.{ "1", "2" }, "all.png", .png);
    for ([_]struct { []const []const u8, []const u8, []const u8 }{
        .{ &.{"1"}, "", "part 2 of 2 is missing" },
        .{ &.{"third"}, "", "2 of 3 parts are missing, the first is 1" },
        .{ &.{ "1", "2", "1" }, "1", "it is part 1 of 2, as" },
        .{ &.{ "1", "third" }, "third", "one of 3 parts, where" },
        .{ &.{ "1", "dark" }, "dark", "with other options than" },
        .{ &.{ "1", "old" }, "old", "written by version '0.9', this is 1.0" },
        .{ &.{ "1", "scene" }, "scene", "of another scene than" },
        .{ &.{ "1", "size" }, "size", "of another size than" },
        .{ &.{ "1", "stopped" }, "stopped", "stopped before it was finished" },
        .{ &.{ "1", "a" }, "a", "it is a crop, where" },
        .{ &.{"a"}, "", "306 of 360 pixels are in none" },
        .{ &.{ "a", "wide" }, "wide", "it has pixels that" },
        .{ &.{ "1", "whole" }, "whole", "has no attribute raylane:part" },
        .{ &.{ "text", "1" }, "text", "no part of a picture: not OpenEXR" },
        .{ &.{ "1", "cut" }, "cut", "" },
        .{ &.{ "changed", "b" }, "changed", "its pixels are not those" },
        .{ &.{ "1", "damaged" }, "damaged", "attribute raylane:part is damaged" },
    }) |case| try bench.expectRefused(case[0], case[1], case[2]);
    for ([_]settings.Part{
        .{ .crop = .{ .pixels = .{ 0, 0, width + 1, 1 } } }, tile(1, 7),
    }) |part| {
        const result = bench.session.checkWrite(write, part);
        try testing.expectError(error.PartUnknown, result);
    }
}
