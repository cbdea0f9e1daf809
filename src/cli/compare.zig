//! The command line of `raylane compare`: arguments -> `Compare`, or one line that says what is
//! wrong.

const std = @import("std");
const arguments_file = @import("arguments.zig");
const cli = @import("../cli.zig");
const values = @import("values.zig");
const settings = @import("../settings.zig");
const Diagnostic = @import("../diagnostic.zig").Diagnostic;
const Metric = settings.Metric;
const Section = arguments_file.Section;
const comptimePrint = std.fmt.comptimePrint;

/// What to compare.
pub const Compare = struct {
    /// As given.
    images: [2][]const u8 = undefined,
    /// Null: no picture of the differences; "-": standard output.
    output: ?[]const u8 = null,
    /// Of images of radiance, in stops.
    exposure_ev: f32 = 0,
    /// Null: text, but nothing where the picture goes to standard output.
    stats: ?cli.Stats = null,
    /// Worst values that count as the same.
    thresholds: std.EnumArray(Metric, ?f32) = .initFill(null),
    sandbox: settings.Sandbox = .auto,
};

/// What it understands.
pub const sections: []const Section = &.{
    .{ .title = "Options", .options = &.{
        .{
            .usage = "--threshold METRIC=X",
            .help = "exit with 4 where max, rmse or flip is above, psnr or\n" ++
                "ssim below X; may be repeated",
        },
        .{
            .usage = "-o, --output FILE.png",
            .help = "write FLIP's map, black where nothing differs; - is\n" ++
                "stdout",
        },
        .{
            .usage = "--exposure EV",
            .help = "brighten images of radiance by EV stops (default: 0)",
        },
        .{
            .usage = "--stats FORM",
            .words = arguments_file.wordsOf(cli.Stats),
            .help = "text (default), json or none",
        },
        .{
            .usage = "--sandbox WHEN",
            .words = arguments_file.wordsOf(settings.Sandbox),
            .help = "auto (default), on or off, as for rendering",
        },
        .{ .usage = "-h, --help", .help = "print this" },
    } },
};

const Reader = arguments_file.Arguments(sections);

/// What `raylane compare --help` prints.
pub const help: []const u8 = "raylane " ++ cli.version ++
    \\: measures how far two images are from each other
    \\
    \\usage: raylane compare IMAGE IMAGE [options]
    \\
    \\The images are of one size, in any format that textures and environments may
    \\have, .ppm or .pfm. They are compared as sRGB values in 0..1, as a display
    \\shows them: radiance is exposed and clipped, what is transparent lies over
    \\middle grey.
    \\
    \\max   largest difference of a channel
    \\RMSE  root of the mean squared difference
    \\PSNR  peak signal-to-noise ratio
    \\SSIM  structural similarity of luma, 1 for the same (Wang et al. 2004)
    \\FLIP  mean difference that an eye sees at 67 pixels a degree (Andersson et al.
    \\      2020)
    \\
++ arguments_file.helpOf(sections) ++
    \\
    \\Exit status: 0 done, 1 files or memory, 2 usage, 3 images that cannot be
    \\compared, 4 a threshold is passed.
    \\
;

/// Reads the arguments after `compare`.
pub fn parse(arguments: []const [:0]const u8, diagnostic: *Diagnostic) cli.Error!Compare {
    var reader: Reader = .{
        .arguments = arguments,
        .diagnostic = diagnostic,
        .help = "raylane compare --help",
    };
    var compare: Compare = .{};
    var image_count: usize = 0;
    while (try reader.next()) |argument| switch (argument) {
        .word => |image| {
            if (image.len == 0) return reader.fail("an image's name is empty", .{});
            if (image_count == 2) return reader.fail("more than two images", .{});
            compare.images[image_count] = image;
            image_count += 1;
        },
        .flag => |flag| try set(&reader, &compare, flag),
    };
    if (image_count < 2) return reader.fail("it takes two images", .{});
    return compare;
}

fn set(reader: *const Reader, compare: *Compare, given: Reader.Given) cli.Error!void {
    switch (given.id) {
        .threshold => {
            const expected = "METRIC=X, METRIC being " ++ comptime arguments_file.namesOf(Metric);
            const equals = std.mem.findScalar(u8, given.value, '=') orelse
                return reader.bad(given, expected);
            const metric = std.meta.stringToEnum(Metric, given.value[0..equals]) orelse
                return reader.bad(given, expected);
            compare.thresholds.set(metric, values.numberOf(given.value[equals + 1 ..]) orelse
                return reader.bad(given, expected));
        },
        .output => {
            const expected = "a file name ending in .png, or -";
            const name = try reader.text(given, expected);
            const is_png = std.ascii.eqlIgnoreCase(std.fs.path.extension(name), ".png");
            if (!is_png and !cli.isStdout(name)) return reader.bad(given, expected);
            compare.output = name;
        },
        .exposure => {
            const ev = values.numberOf(given.value) orelse settings.exposure_ev_max + 1;
            if (@abs(ev) > settings.exposure_ev_max) return reader.bad(given, comptimePrint(
                "-{d} to {d}",
                .{ settings.exposure_ev_max, settings.exposure_ev_max },
            ));
            compare.exposure_ev = ev;
        },
        .stats => compare.stats = try reader.choice(given, cli.Stats),
        .sandbox => compare.sandbox = try reader.choice(given, settings.Sandbox),
        // By itself it is found before the rest is read.
        .help => return reader.fail("'-h' stands alone", .{}),
    }
}

const common = @import("testing.zig");
const testing = std.testing;

test "images, thresholds and the rest" {
    var diagnostic: Diagnostic = .{};
    const compare = try parse(&.{
        "a.png",           "--threshold",  "flip=0.05", "b.pfm", "--threshold=psnr=30", "-od.PNG",
        "--exposure=-1.5", "--stats=json",
    }, &diagnostic);
    try testing.expectEqualStrings("a.png", compare.images[0]);
    try testing.expectEqualStrings("b.pfm", compare.images[1]);
    try testing.expectEqualStrings("d.PNG", compare.output.?);
    try testing.expectApproxEqAbs(0.05, compare.thresholds.get(.flip).?, 1e-6);
    try testing.expectEqual(30, compare.thresholds.get(.psnr).?);
    try testing.expectEqual(null, compare.thresholds.get(.max));
    try testing.expectEqual(-1.5, compare.exposure_ev);
    try testing.expectEqual(.json, compare.stats.?);
}

test "mistakes name the option" {
    for ([_]struct { []const u8, []const [:0]const u8 }{
        .{ "two images", &.{"a"} },
        .{ "more than two", &.{ "a", "b", "c" } },
        .{ "empty", &.{ "", "b" } },
        .{ "'--threshold'", &.{ "a", "b", "--threshold=flip" } },
        .{ "'--threshold'", &.{ "a", "b", "--threshold=flop=1" } },
        .{ "'--threshold'", &.{ "a", "b", "--threshold=flip=x" } },
        .{ "'--output'", &.{ "a", "b", "-o", "d.jpg" } },
        .{ "'--exposure'", &.{ "a", "b", "--exposure=auto" } },
    }) |case| try common.expectUsage("compare", parse, case[0], case[1]);
}

test "the help fits a screen" {
    _ = try common.expectFits(help);
}
