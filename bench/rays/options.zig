//! The benchmark's command line.
//!
//! In: arguments. Out: `Options`, or one line that says what is wrong with them.

const std = @import("std");
const raylane = @import("raylane");
const batch_file = @import("batch.zig");
const TreeQuality = raylane.settings.TreeQuality;
const assert = std.debug.assert;

pub const help =
    \\usage: rays SCENE [options]
    \\  --camera FILE      13 numbers: eye, target and up (x y z each), vertical angle in degrees,
    \\                     point light (x y z); default: the scene's own camera and first light
    \\  --variant NAME     measure this variant; may be repeated (default: all there are)
    \\  --depth N          mirror bounces on every hit (default 0)
    \\  --size N           pixels along each side, a multiple of 16 (default 1024)
    \\  --reps N           repetitions, of all variants in turns (default 7)
    \\  -t N               threads, each held on one processor (default 1)
    \\  --build-threads N  threads that build the tree (default 1)
    \\  --bvh QUALITY      fast, default or high; may be repeated, each takes its turns
    \\                     (default: default)
    \\  --build-only       measure the building of the tree alone
    \\  --subdivide N      first split every triangle in four, N times
    \\  --json             one JSON object in place of the table
    \\  --image FILE       write the picture as PFM
    \\  --dump FILE        write triangles and rays for another tracer (bench/rays/dump.zig)
    \\  --count            mark phases for bench/count and do not look at the clock; also where
    \\                     RAYLANE_COUNT is set
    \\
;

/// Values within their ranges; slices point into the arguments.
pub const Options = struct {
    scene: []const u8,
    camera: ?[]const u8 = null,
    /// Indices into `raylane.variant.compiled`, in order.
    variants: [variant_count]usize = undefined,
    variants_len: usize = 0,
    depth: u32 = 0,
    size: u32 = 1024,
    repetition_count: u32 = 7,
    thread_count: u32 = 1,
    build_thread_count: u32 = 1,
    build_only: bool = false,
    /// In the order of their first mention.
    qualities: [quality_count]TreeQuality = undefined,
    qualities_len: usize = 0,
    subdivide: u32 = 0,
    json: bool = false,
    image: ?[]const u8 = null,
    dump: ?[]const u8 = null,
    count: bool = false,

    const variant_count = raylane.variant.compiled.len;
    const quality_count = std.enums.values(TreeQuality).len;

    /// The qualities of trees that are to be measured.
    pub fn chosenQualities(options: *const Options) []const TreeQuality {
        return options.qualities[0..options.qualities_len];
    }

    /// The variants that are to be measured.
    pub fn chosen(options: *const Options) []const usize {
        return options.variants[0..options.variants_len];
    }
};

pub const Error = error{ Usage, Help };

/// Reads the arguments after the program's name.
pub fn parse(
    arguments: []const [:0]const u8,
    count_by_default: bool,
    diagnostic: *raylane.diagnostic.Diagnostic,
) Error!Options {
    var reader: Reader = .{ .arguments = arguments, .diagnostic = diagnostic };
    var options: Options = .{ .scene = "", .count = count_by_default };
    while (reader.next()) |argument| try reader.read(argument, &options);
    if (options.scene.len == 0) return reader.fail("no scene given; --help says more", .{});
    if (options.variants_len == 0) {
        for (&options.variants, 0..) |*variant, index| variant.* = index;
        options.variants_len = options.variants.len;
    }
    if (options.qualities_len == 0) {
        options.qualities[0] = .default;
        options.qualities_len = 1;
    }
    if (options.count) {
        if (options.thread_count > 1 or options.build_thread_count > 1)
            return reader.fail("--count is for one thread", .{});
        options.repetition_count = 1;
    }
    return options;
}

const Reader = struct {
    arguments: []const [:0]const u8,
    diagnostic: *raylane.diagnostic.Diagnostic,
    index: usize = 0,

    fn next(reader: *Reader) ?[]const u8 {
        if (reader.index == reader.arguments.len) return null;
        reader.index += 1;
        return reader.arguments[reader.index - 1];
    }

    fn fail(reader: *Reader, comptime format: []const u8, arguments: anytype) error{Usage} {
        return reader.diagnostic.fail(error.Usage, format, arguments);
    }

    fn read(reader: *Reader, argument: []const u8, options: *Options) Error!void {
        const Flag = enum {
            @"-h",
            @"--help",
            @"--camera",
            @"--variant",
            @"--depth",
            @"--size",
            @"--reps",
            @"-t",
            @"--build-threads",
            @"--bvh",
            @"--build-only",
            @"--subdivide",
            @"--json",
            @"--image",
            @"--dump",
            @"--count",
        };
        if (argument.len == 0 or argument[0] != '-') {
            if (options.scene.len > 0) return reader.fail("more than one scene given", .{});
            options.scene = argument;
            return;
        }
        const flag = std.meta.stringToEnum(Flag, argument) orelse
            return reader.fail("no option {s}; --help lists them", .{argument});
        const threads_max = raylane.parallel.thread_count_max;
        switch (flag) {
            .@"-h", .@"--help" => return error.Help,
            .@"--camera" => options.camera = try reader.value(argument),
            .@"--variant" => try reader.readVariant(try reader.value(argument), options),
            .@"--depth" => options.depth = try reader.number(argument, 0, 64),
            .@"--size" => {
                options.size = try reader.number(argument, batch_file.side, 16384);
                if (options.size % batch_file.side != 0)
                    return reader.fail("--size is a multiple of {d}", .{batch_file.side});
            },
            .@"--reps" => options.repetition_count =
                try reader.number(argument, 1, repetitions_max),
            .@"-t" => options.thread_count = try reader.number(argument, 1, threads_max),
            .@"--build-threads" => options.build_thread_count =
                try reader.number(argument, 1, threads_max),
            .@"--bvh" => try reader.readQuality(try reader.value(argument), options),
            .@"--build-only" => options.build_only = true,
            .@"--subdivide" => options.subdivide = try reader.number(argument, 0, 8),
            .@"--json" => options.json = true,
            .@"--image" => options.image = try reader.value(argument),
            .@"--dump" => options.dump = try reader.value(argument),
            .@"--count" => options.count = true,
        }
    }

    fn value(reader: *Reader, flag: []const u8) Error![]const u8 {
        return reader.next() orelse reader.fail("{s} needs a value", .{flag});
    }

    fn number(reader: *Reader, flag: []const u8, least: u32, most: u32) Error!u32 {
        const text = try reader.value(flag);
        const result = std.fmt.parseInt(u32, text, 10) catch least -% 1;
        if (result >= least and result <= most) return result;
        return reader.fail("{s} is a number from {d} to {d}", .{ flag, least, most });
    }

    fn readQuality(reader: *Reader, name: []const u8, options: *Options) Error!void {
        const quality = std.meta.stringToEnum(TreeQuality, name) orelse
            return reader.fail("--bvh is fast, default or high", .{});
        if (std.mem.findScalar(TreeQuality, options.chosenQualities(), quality) != null)
            return reader.fail("quality {s} given twice", .{name});
        assert(options.qualities_len < options.qualities.len);
        options.qualities[options.qualities_len] = quality;
        options.qualities_len += 1;
    }

    fn readVariant(reader: *Reader, name: []const u8, options: *Options) Error!void {
        const index = raylane.variant.indexOf(name) orelse
            return reader.fail("no variant {s} in this program", .{name});
        if (std.mem.findScalar(usize, options.chosen(), index) != null)
            return reader.fail("variant {s} given twice", .{name});
        assert(options.variants_len < options.variants.len);
        options.variants[options.variants_len] = index;
        options.variants_len += 1;
    }
};

/// Repetitions at most.
pub const repetitions_max = 1000;
