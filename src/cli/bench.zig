//! The command line of `raylane bench`: arguments -> `Bench`, or one line that says what is wrong.

const std = @import("std");
const arguments_file = @import("arguments.zig");
const cli = @import("../cli.zig");
const values = @import("values.zig");
const settings = @import("../settings.zig");
const variant = @import("../variant.zig");
const Diagnostic = @import("../diagnostic.zig").Diagnostic;
const Range = settings.Range;
const Section = arguments_file.Section;
const comptimePrint = std.fmt.comptimePrint;

/// Scenes of one run at most.
const scene_count_max = 32;
const rounds: Range = .{ .min = 2, .max = 1000 };
const time_s: Range = .{ .min = 1, .max = 1_000_000, .default = 240 };

/// What to measure.
pub const Bench = struct {
    /// As given; empty: the four built-in ones.
    scenes: [scene_count_max][]const u8 = undefined,
    scene_count: usize = 0,
    resolution: [2]u32 = settings.thesis.resolution,
    /// Null: as many as the system has CPUs.
    thread_count: ?u32 = null,
    sample_count: u32 = settings.thesis.sample_count,
    depth: u32 = settings.thesis.depth,
    tree_quality: settings.TreeQuality = .default,
    /// Null: as in the thesis.
    integrator: ?settings.Integrator = null,
    /// Parts of names with commas between them: a variant is measured whose name has one of them.
    /// Null: all.
    variants: ?[]const u8 = null,
    /// Null: until intervals are narrow.
    round_count: ?u32 = null,
    time_s: u32 = time_s.default,
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

/// What it understands.
pub const sections: []const Section = &.{
    .{ .title = "Settings: those of the thesis unless changed", .options = &.{
        .{
            .usage = "-r, --resolution WxH",
            .help = comptimePrint("size in pixels (default: {d}x{d})", .{
                settings.thesis.resolution[0], settings.thesis.resolution[1],
            }),
        },
        .{
            .usage = "--spp N",
            .help = comptimePrint("samples a pixel (default: {d})", .{
                settings.thesis.sample_count,
            }),
        },
        .{
            .usage = "--depth N",
            .help = comptimePrint("reflections and refractions in a row (default: {d})", .{
                settings.thesis.depth,
            }),
        },
        .{ .usage = "-t, --threads N", .help = "threads (default: as many as CPUs)" },
        .{
            .usage = "--bvh QUALITY",
            .words = arguments_file.wordsOf(settings.TreeQuality),
            .help = arguments_file.namesOf(settings.TreeQuality),
        },
        .{
            .usage = "--integrator NAME",
            .words = arguments_file.wordsOf(settings.Integrator),
            .help = arguments_file.namesOf(settings.Integrator) ++ ", and what each\n" ++
                "bounce costs; with all the light of a scene, not that\n" ++
                "of its lamps alone (default: whitted, without these)",
        },
        .{
            .usage = "--variants PARTS",
            .help = "only variants whose names contain one of these, for\n" ++
                "example scalar-single,vector-beam (default: all)",
        },
    } },
    .{ .title = "Measurement", .options = &.{
        .{
            .usage = "--rounds N",
            .help = "so many rounds, no less and no more, unless the time\n" ++
                "is over; two are the least",
        },
        .{
            .usage = "--time-limit S",
            .help = comptimePrint("seconds for all scenes together (default: {d})", .{
                time_s.default,
            }),
        },
        .{
            .usage = "--energy-command CMD",
            .help = "a shell command that prints, each time it is run, the\n" ++
                "power of this moment (5.2 W, 5200 mW) or a counter of\n" ++
                "energy (17.5 J, 17500 mJ)",
        },
        .{ .usage = "--energy-root DIR", .help = "look for sensors there in place of /sys" },
        .{ .usage = "--no-energy", .help = "do not measure energy" },
    } },
    .{ .title = "Output", .options = &.{
        .{ .usage = "--json FILE", .help = "all samples, for bench/report.py; - is stdout" },
        .{
            .usage = "--allow-outside",
            .help = "let scenes name files outside of their own folders",
        },
        .{ .usage = "-q, --quiet", .help = "no warnings, no progress" },
        .{ .usage = "-h, --help", .help = "print this" },
    } },
};

const Reader = arguments_file.Arguments(sections);

/// What `raylane bench --help` prints.
pub const help: []const u8 = "raylane " ++ cli.version ++
    \\: measures what SIMD and packets buy, in time and in joules
    \\
    \\usage: raylane bench [SCENE...] [options]
    \\
    \\Renders each scene by every variant in turn, again and again, until the 95 %
    \\confidence intervals of all render times are within 2 % of their means or the
    \\time is over; prints the tables. No image is written. SCENE is as for rendering;
    \\without one: the built-in scenes cornell, atrium, nave and handles.
    \\
++ arguments_file.helpOf(sections) ++
    \\
    \\Exit status: as of raylane, and 4 where a variant renders another image than
    \\the others.
    \\
;

/// Reads the arguments after `bench`.
pub fn parse(arguments: []const [:0]const u8, diagnostic: *Diagnostic) cli.Error!Bench {
    var reader: Reader = .{
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
        .flag => |flag| try set(&reader, &bench, flag),
    };
    if (!bench.energy and bench.energy_command != null)
        return reader.fail("'--no-energy' contradicts '--energy-command'", .{});
    return bench;
}

fn set(reader: *const Reader, bench: *Bench, given: Reader.Given) cli.Error!void {
    switch (given.id) {
        .resolution => bench.resolution = values.resolutionOf(given.value) orelse
            return reader.bad(given, cli.expected_resolution),
        .threads => bench.thread_count = try reader.number(given, settings.thread_count),
        .spp => bench.sample_count = try reader.number(given, settings.sample_count),
        .depth => bench.depth = try reader.number(given, settings.depth),
        .integrator => bench.integrator = try reader.choice(given, settings.Integrator),
        .bvh => bench.tree_quality = try reader.choice(given, settings.TreeQuality),
        .variants => {
            if (!isList(given.value)) return reader.bad(given, "parts of names, with commas");
            bench.variants = given.value;
        },
        .rounds => bench.round_count = try reader.number(given, rounds),
        .time_limit => bench.time_s = try reader.number(given, time_s),
        .json => bench.json = try reader.text(given, "a name"),
        .energy_root => bench.energy_root = try reader.text(given, "a name"),
        .energy_command => bench.energy_command = try reader.text(given, "a name"),
        .no_energy => bench.energy = false,
        .allow_outside => bench.allow_outside = true,
        .quiet => bench.quiet = true,
        // By itself it is found before the rest is read.
        .help => return reader.fail("'-h' stands alone", .{}),
    }
}

/// Whether all of the parts between commas are something.
fn isList(value: []const u8) bool {
    var parts = std.mem.splitScalar(u8, value, ',');
    while (parts.next()) |part| if (part.len == 0) return false;
    return true;
}

const common = @import("testing.zig");
const testing = std.testing;

fn expectUsage(needle: []const u8, arguments: []const [:0]const u8) !void {
    return common.expectUsage("bench", parse, needle, arguments);
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
        "a.glb",             "-r8x4",  "--variants=scalar-single,packet-8",
        "-t2",               "b.glb",  "--energy-command=echo 1W",
        "--rounds=5",        "--json", "-",
        "--integrator=path",
    }, &diagnostic);
    try testing.expectEqual(.path, bench.integrator.?);
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
    try expectUsage("'--integrator'", &.{"--integrator=bdpt"});
    try expectUsage("'--variants'", &.{"--variants=a,,b"});
    try expectUsage("did you mean '--energy-root'", &.{ "--energy-rot", "x" });
    try expectUsage("needs a value", &.{"--json"});
    try expectUsage("contradicts", &.{ "--no-energy", "--energy-command=x" });
    try expectUsage("empty", &.{""});
}

test "the help fits a screen" {
    _ = try common.expectFits(help);
}
