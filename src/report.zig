//! What a frame cost, as text for people and as JSON for programs, or why there is none.
//!
//! In: plain values that the session collects. Out: a few aligned lines, or one JSON object in one
//! line, whose keys docs/json.md and docs/stats.schema.json describe. They grow in number but never
//! change their meaning.

const std = @import("std");
const Stringify = std.json.Stringify;
const Writer = std.Io.Writer;
const Diagnostic = @import("diagnostic.zig").Diagnostic;
const printable = @import("diagnostic.zig").printable;
const Manifest = @import("manifest.zig").Manifest;
const json_text = @import("json_text.zig");
const settings = @import("settings.zig");
const statistics = @import("statistics.zig");

/// What a job of `raylane serve` is known by; null: there are no jobs.
pub const Id = ?std.json.Value;
/// See `json_text.zig`.
pub const Text = json_text.Text;
/// See `json_text.zig`.
pub const Texts = json_text.Texts;

/// One frame.
pub const Report = struct {
    id: Id = null,
    /// Of the program.
    version: []const u8 = "",
    /// As on the command line.
    scene: []const u8 = "",
    /// Where the image went, as on the command line.
    output: []const u8 = "",
    triangle_count: u64,
    /// Of a crop, if it is one.
    width: u32,
    height: u32,
    /// A crop in pixels.
    part: settings.Part = .whole,
    /// Samples a pixel, of those that have the most.
    sample_count: u32,
    /// Of all pixels.
    sample_mean: f64,
    /// The work was stopped before its end.
    is_partial: bool = false,
    /// The time chose how many samples: so many give the same picture again.
    is_timed: bool = false,
    /// Most bounces.
    depth: u32,
    thread_count: usize,
    variant: []const u8,
    times: statistics.StageTimes,
    rays: statistics.RayCounts,
    /// Null: not counted.
    tests: ?statistics.TestCounts,
    textures: Textures = .{},
    bvh: Bvh,
    memory_peak_bytes: u64,
    image_hash: u64,
    /// Null: the picture keeps radiance as it is.
    appearance: ?Appearance = null,
    /// Names of what layers have numbers of; null: there are no such layers.
    manifest: ?Manifest = null,
    warnings: []const []const u8 = &.{},

    /// What images became.
    pub const Textures = struct { count: u64 = 0, bytes: u64 = 0 };
    /// How radiance became what a display can show.
    pub const Appearance = struct {
        exposure_ev: f32,
        /// The exposure was metered.
        is_automatic: bool,
        tone_mapping: settings.ToneMapping,
    };

    /// Facts about the tree.
    pub const Bvh = struct {
        node_count: u64,
        /// Levels of nodes.
        depth: u32,
        sah_cost: f64,
        bytes: u64,
    };

    /// Samples with which all else being equal the picture is the same; null: it is either known,
    /// or none does.
    fn again(report: *const Report) ?u32 {
        return if (report.is_timed and !report.is_partial) report.sample_count else null;
    }

    /// Which part of a picture it is, in `room` for four numbers; null: all of it.
    fn partText(report: *const Report, room: []u8) ?[]const u8 {
        if (report.part == .whole) return null;
        return std.mem.print(room, "{f}", .{report.part}) catch unreachable;
    }

    fn rayCount(report: *const Report) u64 {
        return report.rays.primary + report.rays.shadow + report.rays.secondary;
    }
};

/// The largest amount of memory that this program has held so far.
pub fn memoryPeakBytes() u64 {
    // The other figure is the process's, which may have been its launcher before.
    const kibibytes = highWaterKibibytes() orelse
        std.posix.getrusage(std.posix.rusage.SELF).maxrss;
    return @as(u64, @intCast(kibibytes)) * 1024;
}

fn highWaterKibibytes() ?isize {
    const folder = std.posix.AT.FDCWD;
    const file = std.posix.openat(folder, "/proc/self/status", .{ .CLOEXEC = true }, 0) catch
        return null;
    defer _ = std.c.close(file);
    var buffer: [4096]u8 = undefined;
    const text = buffer[0 .. std.posix.read(file, &buffer) catch return null];
    return statusKibibytes(text, "VmHWM");
}

/// The number of a line `NAME:   NUMBER kB`.
fn statusKibibytes(text: []const u8, comptime name: []const u8) ?isize {
    _, const rest = std.mem.cut(u8, text, "\n" ++ name ++ ":") orelse return null;
    const digits, _ = std.mem.cut(u8, rest, " kB\n") orelse return null;
    return std.fmt.parseInt(u31, std.mem.trimStart(u8, digits, " \t"), 10) catch null;
}

fn writeTimes(times: *const statistics.StageTimes, writer: *Writer) Writer.Error!void {
    inline for (.{
        .{ "parse", times.parse_ns },
        .{ "textures", times.texture_ns },
        .{ "prepare", times.prepare_ns },
        .{ "BVH build", times.bvh_build_ns },
        .{ "trace", times.trace_ns },
        .{ "denoise", times.denoise_ns },
        .{ "output", times.output_ns },
        .{ "total", times.total_ns },
    }) |row| {
        const is_left_out = row[1] == 0 and comptime std.mem.eql(u8, row[0], "denoise");
        if (!is_left_out)
            try writer.print("{s:<9} {d:>12.3} ms\n", .{ row[0], milliseconds(row[1]) });
    }
}

/// Writes the report as lines for people.
pub fn writeText(report: *const Report, writer: *Writer) Writer.Error!void {
    const times = &report.times;
    try writer.print("scene        {f}, {d} triangles\n", .{
        printable(report.scene), report.triangle_count,
    });
    var part: [64]u8 = undefined;
    const shown = report.partText(&part);
    try writer.print("image        {f}, {d} x {d}{s}{s}, {d} {s} a pixel", .{
        printable(report.output),
        report.width,
        report.height,
        if (shown == null) "" else ", ",
        shown orelse "",
        report.sample_count,
        if (report.sample_count == 1) "sample" else "samples",
    });
    if (report.sample_mean != float(report.sample_count))
        try writer.print(" at most, {d:.1} on average", .{report.sample_mean});
    try writer.print(", depth {d}{s}\n", .{
        report.depth, if (report.is_partial) ", not finished" else "",
    });
    if (report.again()) |count| try writer.print("again        --spp {d}\n", .{count});
    if (report.appearance) |appearance| try writer.print("exposure     {d} EV{s}, {t}\n", .{
        appearance.exposure_ev,
        if (appearance.is_automatic) " (automatic)" else "",
        appearance.tone_mapping,
    });
    try writer.print("tracer       {s}, {d} {s}\n\n", .{
        report.variant,
        report.thread_count,
        if (report.thread_count == 1) "thread" else "threads",
    });
    try writeTimes(times, writer);

    try writer.print("\nrays         {d}", .{report.rayCount()});
    try writeRate(writer, report.rayCount(), times.trace_ns);
    try writer.print("\n             {d} primary, {d} shadow, {d} secondary\n", .{
        report.rays.primary, report.rays.shadow, report.rays.secondary,
    });
    if (report.tests) |tests| {
        inline for (.{
            .{ "box tests   ", tests.box_issued, tests.box_useful },
            .{ "triangles   ", tests.triangle_issued, tests.triangle_useful },
        }) |row| {
            try writer.print("{s} {d} tested", .{ row[0], row[1] });
            try writeRate(writer, row[1], times.trace_ns);
            try writer.print(", {d} useful", .{row[2]});
            if (row[1] > 0) try writer.print(" ({d:.1} %)", .{100 * float(row[2]) / float(row[1])});
            try writer.writeByte('\n');
        }
    } else {
        try writer.writeAll("tests        not counted: --count-tests does, in a second pass\n");
    }
    try writer.print("BVH          {d} nodes, depth {d}, SAH cost {d:.2}, ", .{
        report.bvh.node_count, report.bvh.depth, report.bvh.sah_cost,
    });
    try writeBytes(writer, report.bvh.bytes);
    if (report.textures.count > 0) {
        try writer.print("\ntextures     {d}, ", .{report.textures.count});
        try writeBytes(writer, report.textures.bytes);
    }
    try writer.writeAll("\nmemory       ");
    try writeBytes(writer, report.memory_peak_bytes);
    try writer.writeAll(" at most\n");
    try writer.print("image hash   {x:0>16}\n", .{report.image_hash});
}

/// A size in bytes, KiB or MiB, whichever is readable.
pub fn writeBytes(writer: *Writer, bytes: u64) Writer.Error!void {
    if (bytes < 1 << 10) return writer.print("{d} bytes", .{bytes});
    const is_large = bytes >= 1 << 20;
    const unit: f64 = if (is_large) 1 << 20 else 1 << 10;
    try writer.print("{d:.1} {s}", .{ float(bytes) / unit, if (is_large) "MiB" else "KiB" });
}

/// `, x M/s` where a rate has a meaning.
fn writeRate(writer: *Writer, count: u64, time_ns: u64) Writer.Error!void {
    if (time_ns == 0) return;
    try writer.print(", {d:.2} M/s", .{float(count) * 1e3 / float(time_ns)});
}

/// Writes the report as one JSON object and a line end.
pub fn writeJson(report: *const Report, writer: *Writer) Writer.Error!void {
    const times = &report.times;
    const cost = report.bvh.sah_cost;
    var part: [64]u8 = undefined;
    var hash: [16]u8 = undefined;
    var hash_writer: Writer = .fixed(&hash);
    try hash_writer.print("{x:0>16}", .{report.image_hash});
    var json: Stringify = .{ .writer = writer };
    try json.beginObject();
    if (report.id) |id| try writeFields(&json, .{ .id = id });
    try writeFields(&json, .{
        .version = Text{ .bytes = report.version },
        .@"error" = null,
        .scene = Text{ .bytes = report.scene },
        .output = Text{ .bytes = report.output },
        .triangles = report.triangle_count,
        .width = report.width,
        .height = report.height,
        .part = report.partText(&part),
        .samples = report.sample_count,
        .samples_mean = report.sample_mean,
        .partial = report.is_partial,
        .spp_again = report.again(),
        .depth = report.depth,
        .threads = report.thread_count,
        .variant = Text{ .bytes = report.variant },
        .exposure_ev = if (report.appearance) |appearance| appearance.exposure_ev else null,
        .tonemap = if (report.appearance) |appearance| appearance.tone_mapping else null,
        .time_ms = .{
            .parse = milliseconds(times.parse_ns),
            .textures = milliseconds(times.texture_ns),
            .prepare = milliseconds(times.prepare_ns),
            .bvh_build = milliseconds(times.bvh_build_ns),
            .trace = milliseconds(times.trace_ns),
            .denoise = milliseconds(times.denoise_ns),
            .output = milliseconds(times.output_ns),
            .total = milliseconds(times.total_ns),
        },
        .rays = report.rays,
        .tests = report.tests,
        .textures = report.textures,
        .bvh = .{
            .nodes = report.bvh.node_count,
            .depth = report.bvh.depth,
            // JSON has no infinity, which the cost of a degenerate tree may reach.
            .sah_cost = if (std.math.isFinite(cost)) cost else null,
            .bytes = report.bvh.bytes,
        },
        .memory_peak_bytes = report.memory_peak_bytes,
        .image_hash = Text{ .bytes = &hash },
        .manifest = report.manifest,
        .warnings = Texts{ .list = report.warnings },
    });
    try json.endObject();
    try writer.writeByte('\n');
}

/// The fields of a structure as keys of the object that is open.
pub fn writeFields(json: *Stringify, fields: anytype) Writer.Error!void {
    inline for (comptime std.meta.fieldNames(@TypeOf(fields))) |name| {
        try json.objectField(name);
        try json.write(@field(fields, name));
    }
}

/// Why there is no picture.
pub const Failure = struct {
    id: Id = null,
    /// Of the program.
    version: []const u8,
    /// As on the command line; null: none was understood.
    scene: ?[]const u8 = null,
    /// Where the picture would have gone.
    output: ?[]const u8 = null,
    problem: Problem,
    warnings: []const []const u8 = &.{},
};

/// What was wrong, and where.
pub const Problem = struct {
    message: []const u8,
    /// Empty: no file's.
    file: []const u8 = "",
    /// From 1, as far as known.
    line: ?u32 = null,
    column: ?u32 = null,
    /// Of the program, where it ends by it.
    exit_code: u8,

    /// Of the error that a diagnostic holds; `file` where that names no other.
    pub fn of(diagnostic: *const Diagnostic, file: []const u8, exit_code: u8) Problem {
        const message = diagnostic.message.text();
        var problem: Problem = .{ .message = message, .file = file, .exit_code = exit_code };
        var place = diagnostic.place.text();
        if (place.len == 0) {
            // Formats whose text is one file begin with it.
            const line = std.mem.cutPrefix(u8, message, "JSON line ") orelse
                std.mem.cutPrefix(u8, message, "line ") orelse return problem;
            const end = std.mem.findNone(u8, line, "0123456789") orelse line.len;
            problem.line = std.fmt.parseInt(u32, line[0..end], 10) catch null;
            return problem;
        }
        problem.column = cutNumber(&place);
        problem.line = cutNumber(&place);
        problem.file = place;
        return problem;
    }

    /// Called by `Stringify`.
    pub fn jsonStringify(problem: *const Problem, json: *Stringify) Writer.Error!void {
        try json.write(.{
            .message = Text{ .bytes = problem.message },
            .file = if (problem.file.len > 0) Text{ .bytes = problem.file } else null,
            .line = problem.line,
            .column = problem.column,
            .exit_code = problem.exit_code,
        });
    }
};

/// The number behind the last colon of a place, which loses both.
fn cutNumber(place: *[]const u8) ?u32 {
    const colon = std.mem.findScalarLast(u8, place.*, ':') orelse return null;
    const number = std.fmt.parseInt(u32, place.*[colon + 1 ..], 10) catch return null;
    place.* = place.*[0..colon];
    return number;
}

/// Writes what is known of a picture that there is not as one JSON object and a line end.
pub fn writeFailure(failure: *const Failure, writer: *Writer) Writer.Error!void {
    var json: Stringify = .{ .writer = writer };
    try json.beginObject();
    if (failure.id) |id| try writeFields(&json, .{ .id = id });
    try writeFields(&json, .{
        .version = Text{ .bytes = failure.version },
        .@"error" = &failure.problem,
        .scene = if (failure.scene) |scene| Text{ .bytes = scene } else null,
        .output = if (failure.output) |output| Text{ .bytes = output } else null,
        .warnings = Texts{ .list = failure.warnings },
    });
    try json.endObject();
    try writer.writeByte('\n');
}

fn milliseconds(time_ns: u64) f64 {
    return float(time_ns) / 1e6;
}

fn float(count: u64) f64 {
    return @floatFromInt(count);
}

const report_for_test: Report = .{
    .version = "0.1.0",
    .scene = "a \"b\"\n\xff.glb",
    .output = "a.png",
    .triangle_count = 34,
    .width = 1024,
    .height = 768,
    .sample_count = 1,
    .sample_mean = 1,
    .depth = 6,
    .thread_count = 4,
    .variant = "vector-beam-4",
    .times = .{
        .parse_ns = 1_500_000,
        .texture_ns = 250_000,
        .prepare_ns = 1,
        .bvh_build_ns = 0,
        .trace_ns = 2_000_000,
        .output_ns = 12_345_678_901,
        .total_ns = 12_349_178_902,
    },
    .rays = .{ .primary = 786_432, .shadow = 1000, .secondary = 68 },
    .tests = .{
        .box_issued = 4000,
        .box_useful = 3000,
        .triangle_issued = 0,
        .triangle_useful = 0,
    },
    .textures = .{ .count = 2, .bytes = 7 << 10 },
    .bvh = .{ .node_count = 5, .depth = 3, .sah_cost = 12.3456, .bytes = 3 << 10 },
    .memory_peak_bytes = 5 << 20,
    .image_hash = 0xabc,
    .appearance = .{ .exposure_ev = -9.31, .is_automatic = true, .tone_mapping = .neutral },
    .warnings = &.{ "one", "two" },
};

fn expectText(expected: []const u8, report: *const Report) !void {
    var text: Writer.Allocating = .init(std.testing.allocator);
    defer text.deinit();
    try writeText(report, &text.writer);
    try std.testing.expectEqualStrings(expected, text.written());
}

test "the text, with and without tests counted" {
    const head =
        \\scene        a "b"??.glb, 34 triangles
        \\image        a.png, 1024 x 768, 1 sample a pixel, depth 6
        \\exposure     -9.31 EV (automatic), neutral
        \\tracer       vector-beam-4, 4 threads
        \\
        \\parse            1.500 ms
        \\textures         0.250 ms
        \\prepare          0.000 ms
        \\BVH build        0.000 ms
        \\trace            2.000 ms
        \\output       12345.679 ms
        \\total        12349.179 ms
        \\
        \\rays         787500, 393.75 M/s
        \\             786432 primary, 1000 shadow, 68 secondary
        \\
    ;
    const tail =
        \\BVH          5 nodes, depth 3, SAH cost 12.35, 3.0 KiB
        \\textures     2, 7.0 KiB
        \\memory       5.0 MiB at most
        \\image hash   0000000000000abc
        \\
    ;
    var report = report_for_test;
    try expectText(head ++
        \\box tests    4000 tested, 2.00 M/s, 3000 useful (75.0 %)
        \\triangles    0 tested, 0.00 M/s, 0 useful
        \\
    ++ tail, &report);
    report.tests = null;
    try expectText(head ++
        \\tests        not counted: --count-tests does, in a second pass
        \\
    ++ tail, &report);
}

test "the JSON has every key and nothing else" {
    const Parsed = struct {
        version: []const u8,
        @"error": ?u8,
        scene: []const u8,
        output: []const u8,
        triangles: u64,
        width: u32,
        height: u32,
        part: ?[]const u8,
        samples: u32,
        samples_mean: f64,
        partial: bool,
        spp_again: ?u32,
        depth: u32,
        threads: u32,
        variant: []const u8,
        exposure_ev: ?f32,
        tonemap: ?[]const u8,
        time_ms: struct {
            parse: f64,
            textures: f64,
            prepare: f64,
            bvh_build: f64,
            trace: f64,
            denoise: f64,
            output: f64,
            total: f64,
        },
        rays: statistics.RayCounts,
        tests: ?statistics.TestCounts,
        textures: struct { count: u64, bytes: u64 },
        bvh: struct { nodes: u64, depth: u32, sah_cost: ?f64, bytes: u64 },
        memory_peak_bytes: u64,
        image_hash: []const u8,
        manifest: ?struct {
            none: u32,
            node: struct { @"1": []const u8 },
            mesh: struct {},
            material: struct {},
        },
        warnings: []const []const u8,
    };
    const gpa = std.testing.allocator;
    for ([_]bool{ false, true }) |is_bare| {
        var report = report_for_test;
        report.manifest = .{ .node = &.{.{ .number = 1, .name = "a" }} };
        if (is_bare) {
            report.tests = null;
            report.appearance = null;
            report.manifest = null;
            report.part = .{ .tile = .{ .number = 1, .count = 2 } };
            report.bvh.sah_cost = std.math.inf(f64);
            report.warnings = &.{};
        }
        var text: Writer.Allocating = .init(gpa);
        defer text.deinit();
        try writeJson(&report, &text.writer);
        const line = text.written();
        try std.testing.expectEqual(line.len - 1, std.mem.findScalar(u8, line, '\n'));

        const parsed = try std.json.parseFromSlice(Parsed, gpa, line, .{});
        defer parsed.deinit();
        const value = parsed.value;
        try std.testing.expectEqualStrings("a \"b\"\n\u{fffd}.glb", value.scene);
        try std.testing.expectEqualStrings("a.png", value.output);
        try std.testing.expectEqual(null, value.@"error");
        try std.testing.expectEqualStrings("0000000000000abc", value.image_hash);
        try std.testing.expectEqual(@as(?f32, if (is_bare) null else -9.31), value.exposure_ev);
        try std.testing.expectEqual(is_bare, value.tonemap == null);
        try std.testing.expectEqual(is_bare, value.part != null);
        if (value.part) |part| try std.testing.expectEqualStrings("tile 1/2", part);
        if (!is_bare) try std.testing.expectEqualStrings("a", value.manifest.?.node.@"1");
        if (value.tonemap) |name| try std.testing.expectEqualStrings("neutral", name);
        try std.testing.expectEqual(1.5, value.time_ms.parse);
        try std.testing.expectEqual(0.000001, value.time_ms.prepare);
        try std.testing.expectEqual(12_345.678901, value.time_ms.output);
        try std.testing.expectEqual(7 << 10, value.textures.bytes);
        try std.testing.expectEqual(786_432, value.rays.primary);
        try std.testing.expectEqual(5 << 20, value.memory_peak_bytes);
        try std.testing.expectEqualDeep(report.tests, value.tests);
        try std.testing.expectEqualDeep(report.warnings, value.warnings);
        try std.testing.expectEqual(@as(?f64, if (is_bare) null else 12.3456), value.bvh.sah_cost);
    }
}

test "the JSON of a failure says where, as far as that is known" {
    const Case = struct { place: []const u8, message: []const u8, json: []const u8 };
    for ([_]Case{
        .{ .place = "", .message = "no such file", .json =
        \\"message":"no such file","file":"s.glb","line":null,"column":null,"exit_code":3
        },
        .{ .place = "a:b.pbrt:12:7", .message = "no", .json =
        \\"message":"no","file":"a:b.pbrt","line":12,"column":7,"exit_code":3
        },
        .{ .place = "", .message = "line 31: odd", .json =
        \\"message":"line 31: odd","file":"s.glb","line":31,"column":null,"exit_code":3
        },
        .{ .place = "", .message = "JSON line 2, byte 9: odd", .json =
        \\"message":"JSON line 2, byte 9: odd","file":"s.glb","line":2,"column":null,"exit_code":3
        },
        .{ .place = "", .message = "line by line", .json =
        \\"message":"line by line","file":"s.glb","line":null,"column":null,"exit_code":3
        },
    }) |case| {
        var diagnostic: Diagnostic = .{};
        diagnostic.place.set("{s}", .{case.place});
        diagnostic.message.set("{s}", .{case.message});
        var text: Writer.Allocating = .init(std.testing.allocator);
        defer text.deinit();
        try writeFailure(&.{
            .id = .{ .string = "a" },
            .version = "1",
            .scene = "s.glb",
            .problem = .of(&diagnostic, "s.glb", 3),
            .warnings = &.{"one"},
        }, &text.writer);
        var buffer: [512]u8 = undefined;
        try std.testing.expectEqualStrings(try std.mem.print(
            &buffer,
            "{{\"id\":\"a\",\"version\":\"1\",\"error\":{{{s}}},\"scene\":\"s.glb\"," ++
                "\"output\":null,\"warnings\":[\"one\"]}}\n",
            .{case.json},
        ), text.written());
    }
}

test "nothing traced in no time is not a division by zero" {
    var report = report_for_test;
    report.times = .{};
    report.rays = .{};
    var text: Writer.Allocating = .init(std.testing.allocator);
    defer text.deinit();
    try writeText(&report, &text.writer);
    try std.testing.expect(std.mem.find(u8, text.written(), "nan") == null);
    try std.testing.expect(std.mem.find(u8, text.written(), "\nrays         0\n") != null);
}

test "the peak of memory is that of a program" {
    try std.testing.expect(memoryPeakBytes() > 64 << 10);
    const text = "Name:\tVmHWM: 1 kB\nVmHWM:\t    5124 kB\nVmRSS:\t       4 kB\n";
    try std.testing.expectEqual(5124, statusKibibytes(text, "VmHWM"));
    for ([_][]const u8{ "", "Name:\ta\n", "\nVmHWM:\tmany kB\n", "\nVmHWM:\t5" }) |other| {
        try std.testing.expectEqual(null, statusKibibytes(other, "VmHWM"));
    }
}
