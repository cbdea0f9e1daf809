//! The command line of `raylane bench`: arguments -> `Bench`, or one line that says what is wrong.

const std = @import("std");
const options = @import("../options.zig");
const variant = @import("../variant.zig");
const Arguments = @import("arguments.zig").Arguments;
const Diagnostic = @import("../diagnostic.zig").Diagnostic;
const Flag = @import("arguments.zig").Flag;

/// Scenes of one run at most.
pub const scene_count_max = 32;
/// Rounds at most.
pub const round_count_max = 1000;
/// Longest that may be asked for, in seconds.
pub const time_s_max = 1_000_000;

/// What to measure.
pub const Bench = struct {
    /// As given; empty: the four built-in ones.
    scenes: [scene_count_max][]const u8 = undefined,
    scene_count: usize = 0,
    resolution: [2]u32 = .{ 1024, 1024 },
    /// Null: as many as the system has CPUs.
    thread_count: ?u16 = null,
    sample_count: u32 = 1,
    depth: u32 = 3,
    bvh: options.Bvh = .default,
    /// Parts of names with commas between them: a variant is measured whose name has one of them.
    /// Null: all.
    variants: ?[]const u8 = null,
    /// Null: until intervals are narrow.
    round_count: ?u32 = null,
    time_s: u32 = 240,
    /// Null: none; "-": standard output, in place of the tables.
    json: ?[]const u8 = null,
    energy: bool = true,
    energy_root: []const u8 = "/sys",
    energy_command: ?[]const u8 = null,
    allow_outside: bool = false,
    quiet: bool = false,

    /// Whether a variant is to be measured.
    pub fn wants(bench: *const Bench, name: []const u8) bool {
        var parts = std.mem.splitScalar(u8, bench.variants orelse return true, ',');
        while (parts.next()) |part| if (variant.isPartlyNamed(name, part)) return true;
        return false;
    }
};

const Id = enum {
    allow_outside,
    bvh,
    depth,
    energy_command,
    energy_root,
    json,
    no_energy,
    quiet,
    resolution,
    rounds,
    spp,
    threads,
    time_limit,
    variants,
};

const flags: []const Flag(Id) = &.{
    .{ .id = .resolution, .long = "--resolution", .short = 'r' },
    .{ .id = .threads, .long = "--threads", .short = 't' },
    .{ .id = .spp, .long = "--spp" },
    .{ .id = .depth, .long = "--depth" },
    .{ .id = .bvh, .long = "--bvh" },
    .{ .id = .variants, .long = "--variants" },
    .{ .id = .rounds, .long = "--rounds" },
    .{ .id = .time_limit, .long = "--time-limit" },
    .{ .id = .json, .long = "--json" },
    .{ .id = .energy_root, .long = "--energy-root" },
    .{ .id = .energy_command, .long = "--energy-command" },
    .{ .id = .no_energy, .long = "--no-energy", .has_value = false },
    .{ .id = .allow_outside, .long = "--allow-outside", .has_value = false },
    .{ .id = .quiet, .long = "--quiet", .short = 'q', .has_value = false },
};

/// What `raylane bench --help` prints.
pub const help: []const u8 = "raylane " ++ options.version ++
    \\: measures what SIMD and packets buy, in time and in joules
    \\
    \\usage: raylane bench [SCENE...] [options]
    \\
    \\Renders each scene by every variant in turn, again and again, until the 95 %
    \\confidence intervals of all render times are within 2 % of their means or the
    \\time is over; prints the tables. No image is written. SCENE is as for rendering;
    \\without one: the built-in scenes cornell, atrium, nave and handles.
    \\
    \\Settings: those of the thesis unless changed
    \\  -r, --resolution WxH     size in pixels (default: 1024x1024)
    \\      --spp N              samples a pixel (default: 1)
    \\      --depth N            reflections and refractions in a row (default: 3)
    \\  -t, --threads N          threads (default: as many as CPUs)
    \\      --bvh QUALITY        fast, default or high
    \\      --variants PARTS     only variants whose names contain one of these, for
    \\                           example scalar-single,vector-beam (default: all)
    \\
    \\Measurement
    \\      --rounds N           so many rounds, no less and no more, unless the time
    \\                           is over; two are the least
    \\      --time-limit S       seconds for all scenes together (default: 240)
    \\      --energy-command CMD a shell command that prints, each time it is run, the
    \\                           power of this moment (5.2 W, 5200 mW) or a counter of
    \\                           energy (17.5 J, 17500 mJ)
    \\      --energy-root DIR    look for sensors there in place of /sys
    \\      --no-energy          do not measure energy
    \\
    \\Output
    \\      --json FILE          all samples, for bench/report.py; - is stdout
    \\      --allow-outside      let scenes name files outside of their own folders
    \\  -q, --quiet              no warnings, no progress
    \\  -h, --help               print this
    \\
    \\Exit status: as of raylane, and 4 where a variant renders another image than
    \\the others.
    \\
;

/// Reads the arguments after `bench`.
pub fn parse(arguments: []const [:0]const u8, diagnostic: *Diagnostic) options.Error!Bench {
    var reader: Arguments(Id, flags) = .{
        .arguments = arguments,
        .diagnostic = diagnostic,
        .help = "raylane bench --help",
    };
    var bench: Bench = .{};
    while (try reader.next()) |argument| switch (argument) {
        .word => |scene| {
            if (scene.len == 0) return reader.fail("the scene's name is empty", .{});
            if (bench.scene_count == scene_count_max)
                return reader.fail("more than {d} scenes", .{scene_count_max});
            bench.scenes[bench.scene_count] = scene;
            bench.scene_count += 1;
        },
        .flag => |flag| try set(&reader, &bench, flag.flag, flag.value),
    };
    if (!bench.energy and bench.energy_command != null)
        return reader.fail("'--no-energy' contradicts '--energy-command'", .{});
    return bench;
}

fn set(
    reader: *const Arguments(Id, flags),
    bench: *Bench,
    flag: Flag(Id),
    value: []const u8,
) options.Error!void {
    const integer = options.integer;
    switch (flag.id) {
        .resolution => bench.resolution = options.resolutionOf(value) orelse
            return reader.bad(flag, value, options.expected_resolution),
        .threads => bench.thread_count = integer(u16, value, 1, options.thread_count_max) orelse
            return reader.bad(flag, value, "1 to 256"),
        .spp => bench.sample_count = integer(u32, value, 1, options.sample_count_max) orelse
            return reader.bad(flag, value, "1 to 4096"),
        .depth => bench.depth = integer(u32, value, 0, options.depth_max) orelse
            return reader.bad(flag, value, "0 to 32"),
        .bvh => bench.bvh = std.meta.stringToEnum(options.Bvh, value) orelse
            return reader.bad(flag, value, "fast, default or high"),
        .variants => {
            if (!isList(value)) return reader.bad(flag, value, "parts of names, with commas");
            bench.variants = value;
        },
        .rounds => bench.round_count = integer(u32, value, 2, round_count_max) orelse
            return reader.bad(flag, value, "2 to 1000"),
        .time_limit => bench.time_s = integer(u32, value, 1, time_s_max) orelse
            return reader.bad(flag, value, "1 to 1000000 seconds"),
        .json => bench.json = try notEmpty(reader, flag, value),
        .energy_root => bench.energy_root = try notEmpty(reader, flag, value),
        .energy_command => bench.energy_command = try notEmpty(reader, flag, value),
        .no_energy => bench.energy = false,
        .allow_outside => bench.allow_outside = true,
        .quiet => bench.quiet = true,
    }
}

fn notEmpty(
    reader: *const Arguments(Id, flags),
    flag: Flag(Id),
    value: []const u8,
) options.Error![]const u8 {
    return if (value.len > 0) value else reader.bad(flag, value, "a name");
}

/// Whether all of the parts between commas are something.
fn isList(value: []const u8) bool {
    var parts = std.mem.splitScalar(u8, value, ',');
    while (parts.next()) |part| if (part.len == 0) return false;
    return true;
}

const testing = std.testing;

fn expectUsage(needle: []const u8, arguments: []const [:0]const u8) !void {
    var diagnostic: Diagnostic = .{};
    try testing.expectError(error.UsageInvalid, parse(arguments, &diagnostic));
    errdefer std.debug.print("{s}\n", .{diagnostic.message.text()});
    try testing.expect(std.mem.find(u8, diagnostic.message.text(), needle) != null);
    try testing.expectStringEndsWith(diagnostic.message.text(), "(see raylane bench --help)");
}

test "what is not said is as in the thesis" {
    var diagnostic: Diagnostic = .{};
    const bench = try parse(&.{}, &diagnostic);
    try testing.expectEqual(0, bench.scene_count);
    try testing.expectEqual([2]u32{ 1024, 1024 }, bench.resolution);
    try testing.expectEqual(3, bench.depth);
    try testing.expectEqual(1, bench.sample_count);
    try testing.expect(bench.energy and bench.wants("anything"));
}

test "scenes, flags and filters" {
    var diagnostic: Diagnostic = .{};
    const bench = try parse(&.{
        "a.glb",      "-r8x4",  "--variants=scalar-single,packet-8",
        "-t2",        "b.glb",  "--energy-command=echo 1W",
        "--rounds=5", "--json", "-",
    }, &diagnostic);
    try testing.expectEqualStrings("b.glb", bench.scenes[1]);
    try testing.expectEqual(2, bench.scene_count);
    try testing.expectEqual([2]u32{ 8, 4 }, bench.resolution);
    try testing.expectEqual(5, bench.round_count.?);
    try testing.expectEqualStrings("-", bench.json.?);
    try testing.expect(bench.wants("scalar-single-4") and bench.wants("vector-beam-8"));
    try testing.expect(!bench.wants("vector-beam-4"));
}

test "mistakes name the option" {
    try expectUsage("'--rounds'", &.{"--rounds=1"});
    try expectUsage("'--time-limit'", &.{"--time-limit=0"});
    try expectUsage("'--variants'", &.{"--variants=a,,b"});
    try expectUsage("did you mean '--energy-root'", &.{ "--energy-rot", "x" });
    try expectUsage("needs a value", &.{"--json"});
    try expectUsage("contradicts", &.{ "--no-energy", "--energy-command=x" });
    try expectUsage("empty", &.{""});
}

test "the help names every option" {
    inline for (flags) |flag| try testing.expect(std.mem.find(u8, help, flag.long ++ " ") != null);
    var lines = std.mem.splitScalar(u8, help, '\n');
    while (lines.next()) |line| try testing.expect(line.len <= 80);
}
