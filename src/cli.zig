//! The command line: flags -> `Command`, or one line that says what is wrong with them.
//!
//! In: the arguments as the system hands them over. Out: settings, each within its range, for
//! `main` to pass on; slices point into the arguments. Tables are the whole syntax and its
//! description (that of rendering: `cli/options.zig`); limits and defaults come from `settings`.

const std = @import("std");
const batch_plan = @import("batch.zig");
const batch = @import("cli/batch.zig");
const bench = @import("cli/bench.zig");
const compare = @import("cli/compare.zig");
const info = @import("cli/info.zig");
const merge = @import("cli/merge.zig");
const colors = @import("cli/colors.zig");
const options_file = @import("cli/options.zig");
const values = @import("cli/values.zig");
const config = @import("config");
const arguments_file = @import("cli/arguments.zig");
const completion = @import("cli/completion.zig");
const man = @import("cli/man.zig");
const scenario_file = @import("cli/scenario.zig");
const settings = @import("settings.zig");
const diagnostic_file = @import("diagnostic.zig");
const Diagnostic = diagnostic_file.Diagnostic;
const Page = @import("cli/page.zig").Page;
const comptimePrint = std.fmt.comptimePrint;
const integer = arguments_file.integer;
const namesOf = arguments_file.namesOf;
const wordsOf = arguments_file.wordsOf;
const nearest = @import("cli/nearest.zig").nearest;
const quote = diagnostic_file.quote;
const variant_file = @import("variant.zig");
const assert = std.debug.assert;

/// Of the program, as `--version` and the reports spell it.
pub const version: []const u8 = config.version;

/// What the user wants.
pub const Command = union(enum) {
    help,
    /// Nothing was asked for.
    beginning,
    version,
    licenses,
    list_variants,
    render: Options,
    scenario: ScenarioCall,
    serve: ServeCall,
    serve_help,
    bench: Bench,
    bench_help,
    compare: Compare,
    compare_help,
    info: Info,
    info_help,
    merge: Merge,
    merge_help,
    completion: Shell,
    completion_help,
    man,
    man_help,
};

/// What is asked for of several pictures.
pub const Batch = batch.Batch;
/// Names of their files, where nobody says them one by one.
pub const templateOf = batch.templateOf;
/// What `raylane bench` is to do.
pub const Bench = bench.Bench;
/// What `raylane bench --help` prints.
pub const bench_help = bench.help;
/// What `raylane compare` is to do.
pub const Compare = compare.Compare;
/// What `raylane compare --help` prints.
pub const compare_help = compare.help;
/// What `raylane info` is to do.
pub const Info = info.Info;
/// What `raylane info --help` prints.
pub const info_help = info.help;
/// What `raylane merge` is to do.
pub const Merge = merge.Merge;
/// What `raylane merge --help` prints.
pub const merge_help = merge.help;

/// What `raylane completion` is for.
pub const Shell = completion.Shell;
/// Writes what `raylane completion` prints.
pub const writeCompletion = completion.write;

/// All commands, that without a word first: what completions and the manual are made of.
pub const pages: []const Page = &.{
    .of("", help, sections, null),
    .of("bench", bench_help, bench.sections, null),
    .of("compare", compare_help, compare.sections, null),
    .of("info", info_help, info.sections, null),
    .of("merge", merge_help, merge.sections, null),
    .of("serve", serve_help, sections, &.{}),
    .of("completion", completion_help, &.{}, wordsOf(Shell)),
    .of("man", man_help, &.{}, &.{}),
};

/// What `raylane completion --help` prints.
pub const completion_help = completion.help;
/// What `raylane man --help` prints.
pub const man_help = man.help;

/// Writes what `raylane man` prints.
pub fn writeMan(writer: *std.Io.Writer) std.Io.Writer.Error!void {
    return man.write(writer, version, pages);
}

/// Scenarios on the command line.
pub const ScenarioCall = struct {
    /// JSON, or the name of a file of it.
    scenario: []const u8,
    /// All arguments of `render`, `--scenario` among them.
    arguments: []const [:0]const u8,
};

/// What `raylane serve` is to do.
pub const ServeCall = struct {
    /// Arguments of jobs that say nothing else.
    defaults: []const [:0]const u8,
    sandbox: settings.Sandbox,
    verbose: bool,
};

/// Words that stand before all others, but for `render`, which may stand among flags.
const Word = enum { bench, compare, info, merge, serve, completion, man, help };

/// Form of the report.
pub const Stats = options_file.Stats;

/// What a resolution is, for messages.
pub const expected_resolution = options_file.expected_resolution;
const expected_size = options_file.expected_size;

pub const Options = struct {
    /// The first that is named; of several, all are `inputs`.
    scene: []const u8,
    /// Null: the scene's name in the working directory. See `isStdout` and `templateOf`.
    output: ?[]const u8 = null,
    /// What the command line was, for `inputs`.
    arguments: []const [:0]const u8 = &.{},
    batch: Batch = .{},
    /// Bytes of memory that may be allocated at a time; null: by what is left.
    memory_max: ?u64 = null,
    /// Seconds that a scene may take, within `settings.time_max_s`.
    time_max_s: ?f32 = null,
    /// Null: as many as the system has CPUs.
    thread_count: ?u32 = null,
    tree_quality: settings.TreeQuality = .default,
    instances: settings.Instances = .auto,
    load: settings.Load = .{},
    sandbox: settings.Sandbox = .auto,
    animation: settings.Animation = .{},
    view: settings.View = .{},
    render: settings.Render = .{},
    write: settings.Write = .{},
    /// Name of a file for the picture while it is traced.
    progress_image: ?[]const u8 = null,
    /// A signal that ends tracing has what there is written.
    partial: bool = false,
    progress: settings.Progress = .{},
    /// Null: not asked for.
    stats: ?Stats = null,
    count_tests: bool = false,
    quiet: bool = false,
    verbose: bool = false,

    /// Whether the image goes to standard output.
    pub fn toStdout(options: *const Options) bool {
        return isStdout(options.output orelse return false);
    }

    /// Whether there may be more than one picture, or none: not `scene` alone becomes `output`.
    pub fn isBatch(options: *const Options) bool {
        const chosen = &options.batch;
        const is_made = if (options.output) |output| batch.isMade(output) else false;
        return is_made or chosen.input_count != 1 or chosen.skip_existing or chosen.hasMany();
    }

    /// Scenes and folders as they are named, in that order. The diagnostic is not written to.
    pub fn inputs(options: *const Options, diagnostic: *Diagnostic) Inputs {
        return .{ .reader = .{
            .arguments = options.arguments,
            .diagnostic = diagnostic,
            .help = "--help",
        } };
    }
};

/// The words of a command line that has been read.
pub const Inputs = struct {
    reader: Reader,
    command: RenderWord = .{},

    /// Null after the last.
    pub fn next(inputs: *Inputs) ?[]const u8 {
        while (inputs.reader.next() catch unreachable) |argument| switch (argument) {
            .flag => {},
            .word => |word| if (!inputs.command.isCommand(&inputs.reader, word)) return word,
        };
        return null;
    }
};

/// Finds the word `render`, which is no scene: the first of all that stands before `--`.
const RenderWord = struct {
    is_first: bool = true,

    fn isCommand(command: *RenderWord, reader: *const Reader, word: []const u8) bool {
        defer command.is_first = false;
        return command.is_first and !reader.flags_ended and std.mem.eql(u8, word, "render");
    }
};

/// Whether a name for a file to write stands for standard output.
pub fn isStdout(name: []const u8) bool {
    for ([_][]const u8{ "-", "/dev/stdout", "/dev/fd/1", "/proc/self/fd/1" }) |other| {
        if (std.mem.eql(u8, name, other)) return true;
    }
    return false;
}

/// Where the image goes: as given, else the scene's file name in the working directory with the
/// format's extension instead of its own. The caller frees it.
pub fn outputName(gpa: std.mem.Allocator, options: *const Options) error{OutOfMemory}![]u8 {
    if (options.output) |output| return gpa.dupe(u8, output);
    const path = std.mem.cutPrefix(u8, options.scene, settings.builtin_prefix) orelse
        options.scene;
    return gpa.print("{s}.{t}", .{ std.fs.path.stem(path), options.write.format });
}

const sections = options_file.sections;
const Reader = arguments_file.Arguments(sections);

/// One of `--scenario`'s, or a job.
pub const Scenario = scenario_file.Scenario;
/// Where the text of scenarios is from.
pub const ScenarioSource = scenario_file.Source;
/// Longest text of scenarios.
pub const scenario_bytes_max = scenario_file.bytes_max;
/// The `id` of a job that is wrong otherwise.
pub const idOf = scenario_file.idOf;
/// Why scenarios cannot be read.
pub const ScenarioError = scenario_file.Error;

/// Reads scenarios; all memory is from `arena`. See `parseParts` for what becomes of them.
pub fn readScenarios(
    arena: std.mem.Allocator,
    io: std.Io,
    source: ScenarioSource,
    diagnostic: *Diagnostic,
) ScenarioError![]const Scenario {
    return scenario_file.read(arena, io, Reader.flags, source, diagnostic);
}

/// Reads a job.
pub fn readJob(
    arena: std.mem.Allocator,
    io: std.Io,
    text: []const u8,
    diagnostic: *Diagnostic,
) ScenarioError!Scenario {
    return scenario_file.readOne(arena, io, Reader.flags, text, diagnostic);
}

/// What `--help` prints.
pub const help: []const u8 = "raylane " ++ version ++
    \\: renders glTF, PBRT, OBJ, STL or PLY to an image on the CPU
    \\
    \\usage: raylane [render] SCENE... [options]
    \\       raylane bench [SCENE...] [options]    (see raylane bench --help)
    \\       raylane compare IMAGE IMAGE [options] (see raylane compare --help)
    \\       raylane info SCENE [options]          (see raylane info --help)
    \\       raylane merge -o FILE PART...         (see raylane merge --help)
    \\       raylane serve [options]               (see raylane serve --help)
    \\       raylane completion bash|zsh|fish      (a script for that shell)
    \\       raylane man                           (the manual's page)
    \\       raylane help [COMMAND]
    \\
    \\SCENE is a file in glTF 2.0, PBRT, OBJ, STL or PLY, a folder of such, - for
    \\standard input, or builtin:cornell, atrium, nave or handles. The image goes to
    \\the working directory under the scene's name, as a whole or not at all, a report
    \\to stdout. Names of several come from a template: -o DIR/, or such as
    \\-o 'DIR/{model}_{frame:4}.png', of {model}, {camera}, {material_variant},
    \\{frame}, {view} and {layer}.
    \\
++ arguments_file.helpOf(sections) ++
    \\
    \\Examples
    \\  raylane model.glb
    \\      model.png: all of it in view, in the light of a studio
    \\  raylane model.glb -o a.png -r 800x600 --orbit 30,70 --env sky.hdr
    \\      from the right and a little above, in the light of an image
    \\  raylane room.pbrt -o room.exr --integrator path --spp 256 --denoise
    \\      with all the light that bounces, as radiance
    \\
    \\Exit status: 0 done, 1 files or memory, 2 usage, 3 scene invalid or not
    \\supported, 4 images differ (bench, compare), 124 over --max-time, 128 + N ended
    \\by signal N (with --partial, the picture may be there).
    \\
;

/// What `raylane` alone prints.
pub const beginning: []const u8 =
    \\usage: raylane SCENE [options]
    \\
    \\  raylane model.glb                        writes model.png
    \\  raylane builtin:cornell -o box.png       a scene that needs no file
    \\  raylane --help                           all options, and examples
    \\
;
/// What `raylane serve --help` prints.
pub const serve_help: []const u8 = @import("cli/serve.zig").help;

pub const Error = error{UsageInvalid};

/// Reads the arguments that follow the program's name. `variant_names` is what `--variant` accepts.
/// On an error the diagnostic holds the line to print.
pub fn parse(
    arguments: []const [:0]const u8,
    variant_names: []const []const u8,
    diagnostic: *Diagnostic,
) Error!Command {
    assert(variant_names.len >= 1);
    if (arguments.len == 0) return .beginning;
    const first = if (arguments.len > 0) std.meta.stringToEnum(Word, arguments[0]) else null;
    // Help wins over everything, for it is what somebody asks for who got the rest wrong.
    for (arguments) |argument| {
        if (std.mem.eql(u8, argument, "--")) break;
        if (std.mem.eql(u8, argument, "-h") or std.mem.eql(u8, argument, "--help"))
            return if (first) |word| switch (word) {
                .bench => .bench_help,
                .compare => .compare_help,
                .info => .info_help,
                .merge => .merge_help,
                .completion => .completion_help,
                .man => .man_help,
                .serve => .serve_help,
                .help => .help,
            } else .help;
    }
    if (first) |word| return switch (word) {
        .help => helpWith(arguments[1..], diagnostic),
        .serve => .{ .serve = try checkedDefaults(arguments[1..], variant_names, diagnostic) },
        .bench => .{ .bench = try bench.parse(arguments[1..], diagnostic) },
        .compare => .{ .compare = try compare.parse(arguments[1..], diagnostic) },
        .info => .{ .info = try info.parse(arguments[1..], diagnostic) },
        .merge => .{ .merge = try merge.parse(arguments[1..], diagnostic) },
        .completion => .{ .completion = try shellOf(arguments[1..], diagnostic) },
        .man => if (arguments.len == 1) .man else diagnostic.fail(
            error.UsageInvalid,
            "'man' takes no arguments (see raylane man --help)",
            .{},
        ),
    };
    var parser: Parser = .init(arguments, variant_names, diagnostic);
    return parser.run();
}

fn shellOf(words: []const [:0]const u8, diagnostic: *Diagnostic) Error!Shell {
    const name = if (words.len == 1) words[0] else "";
    return std.meta.stringToEnum(Shell, name) orelse diagnostic.fail(
        error.UsageInvalid,
        "'completion' takes a shell, " ++ comptime namesOf(Shell) ++
            " (see raylane completion --help)",
        .{},
    );
}

/// What `--stats=json` is for, wherever it stands among arguments that may be wrong.
pub fn wantsJson(arguments: []const [:0]const u8) bool {
    for (arguments, 0..) |argument, index| {
        if (std.mem.eql(u8, argument, "--stats=json")) return true;
        if (!std.mem.eql(u8, argument, "--stats") or index + 1 == arguments.len) continue;
        if (std.mem.eql(u8, arguments[index + 1], "json")) return true;
    }
    return false;
}

/// Reads arguments of `render` in two parts, of which the second counts where both say the same:
/// a scenario and the command line, or the defaults of `serve` and a job.
pub fn parseParts(
    parts: [2][]const [:0]const u8,
    variant_names: []const []const u8,
    diagnostic: *Diagnostic,
) Error!Options {
    var parser: Parser = .init(parts[0], variant_names, diagnostic);
    try parser.read();
    const before = parser;
    parser.scene = null;
    parser.input_count = 0;
    parser.command = .{};
    parser.reader = .{ .arguments = parts[1], .diagnostic = diagnostic, .help = "--help" };
    try parser.read();
    if (parser.scene != null) {
        parser.named_in = parts[1];
    } else {
        parser.scene = before.scene;
        parser.input_count = before.input_count;
    }
    return parser.finish();
}

/// Refuses defaults of `serve` that no job could do with.
fn checkedDefaults(
    arguments: []const [:0]const u8,
    variant_names: []const []const u8,
    diagnostic: *Diagnostic,
) Error!ServeCall {
    var parser: Parser = .init(arguments, variant_names, diagnostic);
    parser.reader.help = "raylane serve --help";
    try parser.read();
    if (parser.scene) |scene| return parser.reader.fail("{f}: scenes come by standard input", .{
        quote(scene),
    });
    if (parser.other != null or parser.scenario != null)
        return parser.reader.fail("one of the options is no default of pictures", .{});
    return .{
        .defaults = arguments,
        .sandbox = parser.options.sandbox,
        .verbose = parser.options.verbose,
    };
}

/// `help`, `help WORD`.
fn helpWith(words: []const [:0]const u8, diagnostic: *Diagnostic) Error!Command {
    if (words.len == 0 or std.mem.eql(u8, words[0], "render")) return .help;
    return switch (std.meta.stringToEnum(Word, words[0]) orelse {
        const candidates = comptime std.meta.fieldNames(Word);
        const name = nearest(words[0], candidates) orelse "--help";
        return diagnostic.fail(error.UsageInvalid, "no command {f}, did you mean '{s}'?", .{
            quote(words[0]), name,
        });
    }) {
        .bench => .bench_help,
        .compare => .compare_help,
        .info => .info_help,
        .merge => .merge_help,
        .serve => .serve_help,
        .completion => .completion_help,
        .man => .man_help,
        .help => .help,
    };
}

const Parser = struct {
    reader: Reader,
    variant_names: []const []const u8,
    options: Options = .{ .scene = "" },
    scene: ?[]const u8 = null,
    input_count: usize = 0,
    command: RenderWord = .{},
    /// A time is asked for.
    has_time: bool = false,
    has_variant: bool = false,
    /// The explicit `--format`.
    format: ?settings.Format = null,
    /// The explicit `--progress`.
    progress: ?settings.ProgressForm = null,
    /// Set by the flags that print something and end.
    other: ?Command = null,
    /// Arguments that name the inputs.
    named_in: []const [:0]const u8,
    /// The explicit `--scenario`.
    scenario: ?[]const u8 = null,
    /// The explicit `--width` and `--height`.
    sides: [2]?u32 = .{ null, null },
    pixel_ratio: u32 = settings.pixel_ratio.default,

    fn init(
        arguments: []const [:0]const u8,
        variant_names: []const []const u8,
        diagnostic: *Diagnostic,
    ) Parser {
        return .{
            .reader = .{ .arguments = arguments, .diagnostic = diagnostic, .help = "--help" },
            .variant_names = variant_names,
            .named_in = arguments,
        };
    }

    fn run(parser: *Parser) Error!Command {
        try parser.read();
        if (parser.other) |command| return command;
        if (parser.scenario) |scenario| return .{ .scenario = .{
            .scenario = scenario,
            .arguments = parser.reader.arguments,
        } };
        return .{ .render = try parser.finish() };
    }

    /// Reads all arguments.
    fn read(parser: *Parser) Error!void {
        const reader = &parser.reader;
        while (try reader.next()) |argument| switch (argument) {
            .flag => |flag| try parser.set(flag),
            .word => |word| if (!parser.command.isCommand(reader, word))
                try parser.positional(word),
        };
    }

    /// Checks them together.
    fn finish(parser: *Parser) Error!Options {
        const reader = &parser.reader;
        parser.options.scene = parser.scene orelse return reader.fail("no scene given", .{});
        try parser.resolveSize();
        const animation = &parser.options.animation;
        parser.options.arguments = parser.named_in;
        parser.options.batch.input_count = parser.input_count;
        const is_timed = parser.has_time or parser.options.batch.frames != null;
        if (is_timed and animation.which == .default) animation.which = .{ .index = 0 };
        try parser.checkBatch();
        try parser.checkViewpoint();
        try parser.resolveFormat();
        try parser.checkSampling();
        try parser.checkShade();
        try parser.checkPart();
        try parser.resolveProgress();
        if (parser.options.count_tests and parser.options.render.integrator != .whitted)
            return reader.fail("'--count-tests' counts those of '--integrator whitted'", .{});
        return parser.options;
    }

    fn positional(parser: *Parser, argument: []const u8) Error!void {
        if (argument.len == 0) return parser.reader.fail("the scene's name is empty", .{});
        parser.input_count += 1;
        const scene = parser.scene orelse {
            parser.scene = argument;
            return;
        };
        // No command is shorter; folders often are.
        if (parser.input_count > 2 or scene.len < 4) return;
        if (nearest(scene, comptime std.meta.fieldNames(Word))) |word|
            return parser.reader.fail("no command {f}, did you mean '{s}'?", .{
                quote(scene), word,
            });
    }

    fn set(parser: *Parser, given: Reader.Given) Error!void {
        const options = &parser.options;
        const reader = &parser.reader;
        switch (given.id) {
            .output => options.output = try reader.text(given, "a file name or -"),
            .frames, .fps, .reference_frame, .turntable => try parser.setBatch(given),
            .views, .skip_existing, .jobs => try parser.setBatch(given),
            .format => parser.format = values.formatOf(given.value) orelse
                return reader.bad(given, comptime namesOf(settings.Format)),
            .denoise => options.render.denoise = true,
            .shade => options.view.shade = try reader.choice(given, settings.Shade),
            .layers, .jpeg_quality, .webp_quality, .exr => try parser.setWriting(given),
            .exposure, .tonemap => try parser.setWriting(given),
            .max_memory, .max_time, .max_triangles => try parser.setLimit(given),
            .max_pixels, .max_texture_pixels => try parser.setLimit(given),
            .crop, .tile => try parser.setPart(given),
            .resolution, .width, .height, .pixel_ratio => try parser.setSize(given),
            .threads => options.thread_count = try reader.number(given, settings.thread_count),
            .spp => options.render.sample_count = try reader.number(given, settings.sample_count),
            .noise, .time_budget, .progress_image, .partial => try parser.setSampling(given),
            .depth => options.render.depth = try reader.number(given, settings.depth),
            .tile_size => options.render.tile_size = values.tileSizeOf(given.value) orelse
                return reader.bad(given, comptimePrint("{s}, a multiple of {d}", .{
                    settings.tile_size.text(), settings.tile_size_step,
                })),
            .camera, .frame_all => try parser.setCamera(given),
            .eye, .target, .up, .orbit, .fov, .ortho => try parser.setCamera(given),
            .scene, .material_variant, .up_axis, .format_in => try parser.setLoad(given),
            .tessellation, .max_texture_size => try parser.setLoad(given),
            .allow_outside, .strict, .force => try parser.setLoad(given),
            .sandbox => options.sandbox = try reader.choice(given, settings.Sandbox),
            .animation, .animation_time => try parser.setAnimation(given),
            .background => options.view.background = values.backgroundOf(given.value) orelse
                return parser.noBackground(given),
            .env, .env_intensity, .env_rotation, .env_shadows => try parser.setEnvironment(given),
            .floor => options.view.floor = try reader.choice(given, settings.Floor),
            .ambient => options.view.ambient = values.radiance(given.value) orelse
                return reader.bad(given, "a number of 0 or more"),
            .stats, .count_tests, .quiet, .verbose => try parser.setMessages(given),
            .progress, .progress_fd => try parser.setMessages(given),
            .scenario => try parser.setScenario(given),
            .thesis => parser.setThesis(),
            .bvh => options.tree_quality = try reader.choice(given, settings.TreeQuality),
            .instances => options.instances = try reader.choice(given, settings.Instances),
            .variant => {
                options.render.variant = try parser.variantOf(given.value);
                parser.has_variant = true;
            },
            .integrator => options.render.integrator =
                try reader.choice(given, settings.Integrator),
            .virtual_lights, .sky_lights, .all_lights => try parser.setLights(given),
            .point_size => options.view.point_size =
                values.numberWithin(given.value, settings.point_size) orelse
                return reader.bad(given, comptimePrint("{d} to {d} pixels", .{
                    settings.point_size.min, settings.point_size.max,
                })),
            .help => parser.other = .help,
            .version => parser.other = parser.other orelse .version,
            .licenses => parser.other = parser.other orelse .licenses,
            .list_variants => parser.other = parser.other orelse .list_variants,
        }
    }

    fn setLimit(parser: *Parser, given: Reader.Given) Error!void {
        const options = &parser.options;
        const reader = &parser.reader;
        switch (given.id) {
            .max_memory => options.memory_max = try values.memoryMaxOf(reader, given),
            .max_time => options.time_max_s = try values.timeMaxOf(reader, given),
            .max_triangles => options.load.triangle_count_max =
                try values.countMaxOf(reader, given),
            .max_pixels => options.view.pixel_count_max = try values.countMaxOf(reader, given),
            .max_texture_pixels => options.load.texture_pixel_count_max =
                try values.countMaxOf(reader, given),
            else => unreachable, // `set` hands over the above.
        }
    }

    fn setScenario(parser: *Parser, given: Reader.Given) Error!void {
        if (parser.scenario != null)
            return parser.reader.fail("'--scenario' is there twice", .{});
        parser.scenario = try parser.reader.text(given, "a file name or JSON");
    }

    fn setPart(parser: *Parser, given: Reader.Given) Error!void {
        const part = &parser.options.render.part;
        switch (given.id) {
            .crop => part.* = .{ .crop = values.cropOf(given.value) orelse
                return parser.reader.bad(given, "four pixels, or fractions from 0.0 to 1.0, of " ++
                    "a rectangle's left, upper, right and lower edge") },
            .tile => part.* = .{ .tile = values.tileOf(given.value) orelse
                return parser.reader.bad(given, comptimePrint("I/N, N {s}, I 1 to N", .{
                    settings.part_count.text(),
                })) },
            else => unreachable,
        }
    }

    fn setSize(parser: *Parser, given: Reader.Given) Error!void {
        const view = &parser.options.view;
        const reader = &parser.reader;
        switch (given.id) {
            .resolution => {
                parser.sides = .{ null, null };
                view.long_side = integer(given.value, settings.long_side);
                view.resolution = values.resolutionOf(given.value);
                if (view.long_side == null and view.resolution == null)
                    return reader.bad(given, expected_size);
            },
            .width => parser.sides[0] = try reader.number(given, settings.side),
            .height => parser.sides[1] = try reader.number(given, settings.side),
            .pixel_ratio => parser.pixel_ratio = try reader.number(given, settings.pixel_ratio),
            else => unreachable, // `set` hands over the above.
        }
    }

    /// Makes one size of what may be said in several options.
    fn resolveSize(parser: *Parser) Error!void {
        const view = &parser.options.view;
        const reader = &parser.reader;
        if (parser.sides[0] != null or parser.sides[1] != null) {
            view.long_side = null;
            view.resolution = .{
                parser.sides[0] orelse return reader.fail("'--height' without '--width'; " ++
                    "-r N is the long side alone", .{}),
                parser.sides[1] orelse return reader.fail("'--width' without '--height'; " ++
                    "-r N is the long side alone", .{}),
            };
        }
        const ratio = parser.pixel_ratio;
        if (view.resolution) |*sides| {
            for (sides) |*length| length.* *= ratio;
            const is_large = for (sides) |length| {
                if (!settings.side.holds(length)) break true;
            } else @as(u64, sides[0]) * sides[1] > settings.pixel_count_max;
            if (is_large) return reader.fail("a picture of {d}x{d} is not " ++
                expected_resolution, .{ sides[0], sides[1] });
        } else if (view.long_side) |*length| {
            length.* *= ratio;
            if (!settings.long_side.holds(length.*))
                return reader.fail("a long side of {d} is not {s}", .{
                    length.*, comptime settings.long_side.text(),
                });
        } else if (ratio != 1) return reader.fail("'--pixel-ratio' multiplies a size: say it " ++
            "by '--resolution'", .{});
    }

    fn setBatch(parser: *Parser, given: Reader.Given) Error!void {
        const chosen = &parser.options.batch;
        const reader = &parser.reader;
        switch (given.id) {
            .frames => chosen.frames = try parser.rangeOf(given),
            .views => chosen.views = try parser.rangeOf(given),
            .fps => parser.options.write.frame_rate = batch.frameRateOf(given.value) orelse
                return reader.bad(given, "a number above 0, up to 1000, or a fraction"),
            .reference_frame => chosen.reference_frame =
                batch_plan.frames.first(try parser.rangeOf(given)),
            .turntable => chosen.view_count = try reader.number(given, settings.view_count),
            .skip_existing => chosen.skip_existing = true,
            .jobs => chosen.job_count = try reader.number(given, settings.job_count),
            else => unreachable, // `set` hands over the above.
        }
    }

    fn rangeOf(parser: *Parser, given: Reader.Given) Error![]const u8 {
        const fault = batch_plan.frames.check(given.value) orelse return given.value;
        return parser.reader.fail("option '{s}': {f} {s}", .{
            given.long, quote(given.value), fault.text(),
        });
    }

    /// What belongs to several pictures goes together.
    fn checkBatch(parser: *Parser) Error!void {
        const reader = &parser.reader;
        const options = &parser.options;
        const chosen = &options.batch;
        if (chosen.frames != null and parser.has_time)
            return reader.fail("'--frames' and '--animation-time' both choose the time", .{});
        if (chosen.reference_frame != null and chosen.frames == null)
            return reader.fail("'--reference-frame' needs '--frames'", .{});
        if (chosen.views != null and chosen.view_count == null)
            return reader.fail("'--views' are those of '--turntable'", .{});
        const viewpoint = &options.view.viewpoint;
        if (chosen.view_count != null) {
            if (viewpoint.eye != null)
                return reader.fail("'--eye' and '--turntable' both place the camera", .{});
            if (viewpoint.orbit == null) viewpoint.orbit = settings.orbit_turntable;
        }
        if (options.progress_image != null and options.isBatch())
            return reader.fail("'--progress-image' is for one picture", .{});
        const output = options.output orelse return;
        var message: diagnostic_file.Message = .{};
        if (batch.contradiction(chosen, output, &message))
            return reader.fail("{s}", .{message.text()});
        if (batch_plan.template.holds(output, .camera) and viewpoint.replacesCamera()) return reader
            .fail("'{{camera}}' stands for the file's, in whose place the options put one", .{});
    }

    fn setWriting(parser: *Parser, given: Reader.Given) Error!void {
        const write = &parser.options.write;
        const reader = &parser.reader;
        switch (given.id) {
            .layers => parser.options.render.layers = values.layersOf(given.value) orelse
                return reader.bad(given, comptime namesOf(settings.Layer)),
            .jpeg_quality => write.jpeg_quality =
                try reader.number(given, settings.jpeg_quality),
            .webp_quality => write.webp_quality =
                try reader.number(given, settings.webp_quality),
            .exr => write.exr_kind = try reader.choice(given, settings.ExrKind),
            .exposure => write.exposure = values.exposureOf(given.value) orelse
                return reader.bad(given, comptimePrint("-{d} to {d}, or auto", .{
                    settings.exposure_ev_max, settings.exposure_ev_max,
                })),
            .tonemap => write.tone_mapping = try reader.choice(given, settings.ToneMapping),
            else => unreachable, // `set` hands over the above.
        }
    }

    fn setLights(parser: *Parser, given: Reader.Given) Error!void {
        const lights = &parser.options.render.lights;
        const reader = &parser.reader;
        switch (given.id) {
            .virtual_lights => lights.virtual_count =
                try reader.number(given, settings.virtual_light_count),
            .sky_lights => lights.sky_count = try reader.number(given, settings.sky_light_count),
            .all_lights => lights.is_interleaved = false,
            else => unreachable, // `set` hands over the above.
        }
    }

    fn setThesis(parser: *Parser) void {
        const options = &parser.options;
        options.view.resolution = settings.thesis.resolution;
        options.view.long_side = null;
        options.render.sample_count = settings.thesis.sample_count;
        options.render.depth = settings.thesis.depth;
        options.thread_count = null;
        options.view.environment.source = .none;
        options.view.background = .default;
        options.view.display_referred = false;
        options.view.emitters = false;
        options.write.exposure = settings.thesis.exposure;
        options.write.tone_mapping = settings.thesis.tone_mapping;
    }

    fn setSampling(parser: *Parser, given: Reader.Given) Error!void {
        const options = &parser.options;
        const reader = &parser.reader;
        switch (given.id) {
            .noise => {
                const error_max = values.numberWithin(given.value, settings.noise_error) orelse
                    return reader.bad(given, comptimePrint("{d} to {d}", .{
                        settings.noise_error.min, settings.noise_error.max,
                    }));
                options.render.noise = .{ .error_max = error_max };
            },
            .time_budget => options.render.time_budget_s =
                values.numberWithin(given.value, settings.time_budget_s) orelse
                return reader.bad(given, comptimePrint("{d} to {d} seconds", .{
                    settings.time_budget_s.min, settings.time_budget_s.max,
                })),
            .progress_image => {
                if (isStdout(given.value)) return reader.bad(given, "a file name");
                options.progress_image = try reader.text(given, "a file name");
            },
            .partial => options.partial = true,
            else => unreachable, // `set` hands over the above.
        }
    }

    fn checkSampling(parser: *Parser) Error!void {
        const render = &parser.options.render;
        const noise = if (render.noise) |*noise| noise else return;
        noise.exposure = parser.options.write.exposure;
        if (!render.integrator.isOpen())
            return parser.reader.fail("'--noise' is for '--integrator path'", .{});
    }

    fn setMessages(parser: *Parser, given: Reader.Given) Error!void {
        const options = &parser.options;
        const reader = &parser.reader;
        switch (given.id) {
            .stats => options.stats = try reader.choice(given, Stats),
            .count_tests => options.count_tests = true,
            .quiet => options.quiet = true,
            .verbose => options.verbose = true,
            .progress => parser.progress = try reader.choice(given, settings.ProgressForm),
            .progress_fd => {
                options.progress.file = try reader.number(given, settings.progress_file);
            },
            else => unreachable, // `set` hands over the above.
        }
    }

    fn resolveProgress(parser: *Parser) Error!void {
        const progress = &parser.options.progress;
        const quiet: settings.ProgressForm = if (parser.options.quiet) .none else .auto;
        progress.form = parser.progress orelse if (progress.file != null) .json else quiet;
        const file = progress.file orelse return;
        if (progress.form != .json)
            return parser.reader.fail("'--progress-fd' is for '--progress json'", .{});
        if (file == std.posix.STDOUT_FILENO and parser.options.toStdout())
            return parser.reader.fail("'--progress-fd 1' is where the image goes", .{});
        if (std.c.fcntl(@intCast(file), std.c.F.GETFD) < 0)
            return parser.reader.fail("'--progress-fd {d}' is not open", .{file});
    }

    fn setLoad(parser: *Parser, given: Reader.Given) Error!void {
        const load = &parser.options.load;
        const reader = &parser.reader;
        switch (given.id) {
            .scene => load.scene = values.choiceOf(given.value) orelse
                return reader.bad(given, "a scene's name or its index"),
            .material_variant => load.material_variant = values.choiceOf(given.value) orelse
                return reader.bad(given, "a material variant's name or its index"),
            .up_axis => load.up_axis = try reader.choice(given, settings.UpAxis),
            .format_in => load.format = try reader.choice(given, settings.SceneFormat),
            .tessellation => load.tessellation = try reader.number(given, settings.tessellation),
            .max_texture_size => {
                load.texture_side_max = try reader.number(given, settings.texture_side);
            },
            .allow_outside => load.allow_outside = true,
            .strict => load.strict = true,
            .force => load.force = true,
            else => unreachable, // `set` hands over the above.
        }
    }

    fn setAnimation(parser: *Parser, given: Reader.Given) Error!void {
        const animation = &parser.options.animation;
        const reader = &parser.reader;
        switch (given.id) {
            .animation => animation.which = values.animationOf(given.value) orelse
                return reader.bad(given, "an animation's name, its index, or all"),
            .animation_time => {
                animation.time_s = values.numberOf(given.value) orelse
                    return reader.bad(given, "a number of seconds");
                parser.has_time = true;
            },
            else => unreachable, // `set` hands over the above.
        }
    }

    fn setCamera(parser: *Parser, given: Reader.Given) Error!void {
        const view = &parser.options.view;
        const viewpoint = &view.viewpoint;
        const reader = &parser.reader;
        switch (given.id) {
            .camera => view.camera = values.cameraOf(given.value) orelse
                return reader.bad(given, "a camera's name, its index, or auto"),
            .frame_all => view.frames_all = true,
            .eye => viewpoint.eye = values.vectorOf(given.value) orelse
                return reader.bad(given, "X,Y,Z in metres"),
            .target => viewpoint.target = values.vectorOf(given.value) orelse
                return reader.bad(given, "X,Y,Z in metres"),
            .up => viewpoint.up = values.directionOf(given.value) orelse
                return reader.bad(given, "X,Y,Z other than 0,0,0"),
            .orbit => viewpoint.orbit = values.orbitOf(given.value) orelse
                return reader.bad(given, "THETA,PHI[,RADIUS], PHI 0 to 180, RADIUS above 0"),
            .fov => {
                const range = settings.fov_degrees;
                viewpoint.fov_degrees = values.numberWithin(given.value, range) orelse
                    return reader.bad(given, comptimePrint("{d} to {d} degrees", .{
                        range.min, range.max,
                    }));
            },
            .ortho => viewpoint.orthographic = true,
            else => unreachable, // `set` hands over the above.
        }
    }

    fn setEnvironment(parser: *Parser, given: Reader.Given) Error!void {
        const reader = &parser.reader;
        const environment = &parser.options.view.environment;
        switch (given.id) {
            .env => environment.source = values.environmentOf(given.value) orelse
                return reader.bad(given, "a file name, studio or none"),
            .env_intensity => environment.intensity = values.radiance(given.value) orelse
                return reader.bad(given, "a number of 0 or more"),
            .env_rotation => environment.rotation_deg = values.rotationOf(given.value) orelse
                return reader.bad(given, "degrees, -3600 to 3600"),
            .env_shadows => environment.shadow_count =
                try reader.number(given, settings.environment_shadow_count),
            else => unreachable, // Those that `set` hands on.
        }
    }

    fn noBackground(parser: *Parser, given: Reader.Given) Error {
        const names = [_][]const u8{ "env", "studio", "transparent" } ++ colors.names;
        if (nearest(given.value, &names)) |name| {
            return parser.reader.fail("option '{s}': no colour {f}, did you mean '{s}'?", .{
                given.long, quote(given.value), name,
            });
        }
        return parser.reader.bad(given, "env, studio, transparent, a colour or R,G,B");
    }

    fn variantOf(parser: *Parser, name: []const u8) Error!usize {
        for (parser.variant_names, 0..) |candidate, index| {
            if (variant_file.isNamed(candidate, name)) return index;
        }
        if (nearest(name, parser.variant_names)) |candidate| {
            return parser.reader.fail("no variant {f}, did you mean '{s}'?", .{
                quote(name), candidate,
            });
        }
        return parser.reader.fail("no variant {f}; --list-variants names them", .{quote(name)});
    }

    /// Options that say where to look from may not contradict each other.
    fn checkViewpoint(parser: *Parser) Error!void {
        const reader = &parser.reader;
        const view = &parser.options.view;
        const viewpoint = &view.viewpoint;
        if (viewpoint.eye != null and viewpoint.orbit != null)
            return reader.fail("'--eye' and '--orbit' both place the camera", .{});
        if (viewpoint.orthographic and viewpoint.fov_degrees != null)
            return reader.fail("'--fov' contradicts '--ortho'", .{});
        if (viewpoint.eye) |eye| if (viewpoint.target) |target| {
            if (std.mem.eql(f32, &eye, &target))
                return reader.fail("'--eye' and '--target' are the same place", .{});
        };
        if (view.camera != .index and view.camera != .name) return;
        if (viewpoint.replacesCamera()) return reader.fail(
            "'--camera' contradicts '--eye', '--target', '--up', '--orbit' and '--ortho'",
            .{},
        );
    }

    /// The format comes from `--format` or the output's extension, which may not disagree.
    fn resolveFormat(parser: *Parser) Error!void {
        try parser.findFormat();
        const options = &parser.options;
        const format = options.write.format;
        if (options.output) |output| options.write.layers_apart =
            batch_plan.template.isTemplate(output) and
            batch_plan.template.holds(output, .layer);
        if (options.render.layers.count() == 0 or format == .exr) return;
        if (options.write.layers_apart and format != .y4m) return;
        return parser.reader.fail("'--layers' has a place in an exr file, not in a {t} file, or " ++
            "in files of their own, by {{layer}} in the output's name", .{format});
    }

    /// What some integrators alone can tell, or is told in place of them. Where rays are traced one
    /// by one, each pixel has tests of its own: nothing else is as good for these.
    fn checkShade(parser: *Parser) Error!void {
        const options = &parser.options;
        const reader = &parser.reader;
        const is_whitted = options.render.integrator == .whitted;
        if (options.render.layers.contains(.cost) and !is_whitted)
            return reader.fail("'--layers cost' counts tests of '--integrator whitted'", .{});
        const has_cost = options.render.layers.contains(.cost) or options.view.shade == .cost;
        if (has_cost and !parser.has_variant) for (parser.variant_names, 0..) |name, index| {
            if (std.mem.find(u8, name, "-single-") == null) continue;
            options.render.variant = index;
            break;
        };
        const part = options.render.part;
        if (options.write.layers_apart and part == .tile) return reader.fail(
            "'--tile' puts layers into one file: no {{layer}} in the output's name",
            .{},
        );
        if (options.view.shade == null) return;
        if (options.view.shade == .cost and part != .whole) return reader
            .fail("'--shade cost' has colours by the whole picture: no '--crop' or '--tile'", .{});
        if (!is_whitted) return reader.fail("'--shade' contradicts '--integrator'", .{});
        if (options.render.denoise) return reader.fail("'--shade' contradicts '--denoise'", .{});
        if (options.count_tests) return reader.fail("'--shade' contradicts '--count-tests'", .{});
    }

    fn findFormat(parser: *Parser) Error!void {
        const options = &parser.options;
        options.write.format = parser.format orelse .png;
        const output = options.output orelse {
            if (!std.mem.eql(u8, options.scene, settings.standard_input)) return;
            return parser.reader.fail("a scene from standard input has no name for the image: " ++
                "say one by -o", .{});
        };
        if (options.toStdout() or std.mem.endsWith(u8, output, "/")) return;
        options.write.format = try formatFor(&parser.reader, parser.format, output);
    }

    /// Refuses what is of whole pictures.
    fn checkPart(parser: *Parser) Error!void {
        const reader = &parser.reader;
        const options = &parser.options;
        const part = options.render.part;
        if (part == .whole) return;
        if (options.render.time_budget_s != null) return reader.fail(
            "'--time-budget' does not go with '--{t}': parts have as many samples as the whole",
            .{part},
        );
        if (options.render.layers.contains(.cost)) return reader.fail(
            "'--layers cost' does not go with '--{t}': it is of pixels that are traced together",
            .{part},
        );
        if (options.write.format == .exr) {
            options.render.is_merged = true;
            if (options.progress_image == null) return;
            return reader.fail("'--progress-image' does not go with parts that are merged", .{});
        }
        if (part == .tile) return reader.fail(
            "'--tile' makes an exr file, not a {t} file: 'raylane merge' makes that of all parts",
            .{options.write.format},
        );
    }
};

/// The format of a file called `name`: the one chosen, or by its extension; png on standard output.
/// An error of the reader where they contradict each other, or there is neither.
pub fn formatFor(
    reader: anytype,
    chosen: ?settings.Format,
    name: []const u8,
) Error!settings.Format {
    if (isStdout(name)) return chosen orelse .png;
    const extension = std.fs.path.extension(name);
    const implied = if (extension.len == 0) null else values.formatOf(extension[1..]);
    if (chosen) |format| {
        if (implied == null or implied == format) return format;
        return reader.fail("'--format {t}' contradicts the name {f}", .{ format, quote(name) });
    }
    return implied orelse reader.fail(
        "the name {f} ends in no image format's extension, no --format says which, and a " ++
            "folder's ends in /",
        .{quote(name)},
    );
}

const test_names: []const []const u8 = &.{ "vector-beam-8", "scalar-single-4" };

fn parseForTest(arguments: []const [:0]const u8) Error!Command {
    var diagnostic: Diagnostic = .{};
    return parse(arguments, test_names, &diagnostic);
}

/// The options of a valid command line that renders "s.glb".
fn optionsForTest(arguments: []const [:0]const u8) !Options {
    var all: [8][:0]const u8 = undefined;
    @memcpy(all[0..arguments.len], arguments);
    all[arguments.len] = "s.glb";
    const command = try parseForTest(all[0 .. arguments.len + 1]);
    try std.testing.expectEqualStrings("s.glb", command.render.scene);
    return command.render;
}

/// Expects a usage error that says `needle`, in one line that points to the help.
fn expectUsage(needle: []const u8, arguments: []const [:0]const u8) !void {
    var diagnostic: Diagnostic = .{};
    try std.testing.expectError(error.UsageInvalid, parse(arguments, test_names, &diagnostic));
    const text = diagnostic.message.text();
    errdefer std.debug.print("{s}\n", .{text});
    try std.testing.expect(std.mem.find(u8, text, needle) != null);
    try std.testing.expect(std.mem.endsWith(u8, text, " (see --help)"));
}

test "a scene alone is rendered by the defaults" {
    const options = try optionsForTest(&.{});
    try std.testing.expectEqual(1, options.arguments.len);
    try std.testing.expect(!options.isBatch());
    var compared = options;
    compared.arguments = &.{};
    try std.testing.expectEqualDeep(Options{ .scene = "s.glb" }, compared);
    const named = try parseForTest(&.{ "render", "render" });
    try std.testing.expectEqualStrings("render", named.render.scene);
    try expectUsage("no scene", &.{"render"});
    try std.testing.expectEqual(.beginning, try parseForTest(&.{}));
    try expectUsage("no scene", &.{ "-q", "--" });
    try expectUsage("empty", &.{""});
}

test "several scenes are a batch, in their order" {
    for ([_][]const [:0]const u8{
        &.{ "a", "-q", "b", "--spp", "2", "render" },
        &.{ "render", "-r", "2x2", "a", "b", "--", "render" },
        &.{ "--", "a", "b", "render" },
    }) |arguments| {
        const options = (try parseForTest(arguments)).render;
        try std.testing.expect(options.isBatch());
        try std.testing.expectEqual(3, options.batch.input_count);
        var diagnostic: Diagnostic = .{};
        var inputs = options.inputs(&diagnostic);
        for ([_][]const u8{ "a", "b", "render" }) |input|
            try std.testing.expectEqualStrings(input, inputs.next().?);
        try std.testing.expectEqual(null, inputs.next());
    }
}

test "frames, views and names of pictures" {
    const options = try optionsForTest(&.{
        "--frames=1-3,7", "--fps=12.5", "--reference-frame", "-1", "-o{model}_{frame:4}.jpg",
    });
    try std.testing.expectEqualStrings("1-3,7", options.batch.frames.?);
    try std.testing.expectEqual(-1, options.batch.reference_frame.?);
    try std.testing.expectEqual(0.08, options.write.frame_rate.timeOf(1));
    try std.testing.expectEqual(0, options.animation.which.index);
    try std.testing.expectEqual(.jpg, options.write.format);
    try std.testing.expect(options.isBatch());
    const part = try optionsForTest(&.{ "--frames=8", "--reference-frame=5-9,4-2:-1" });
    try std.testing.expectEqual(2, part.batch.reference_frame.?);
    const turned = try optionsForTest(&.{ "--turntable=8", "--views=0-3", "-oa/", "--jobs=2" });
    try std.testing.expectEqual(30, turned.view.viewpoint.orbit.?.theta_degrees);
    try std.testing.expectEqual(8, turned.batch.view_count.?);
    try std.testing.expectEqual(.png, turned.write.format);
    try std.testing.expect((try optionsForTest(&.{"--skip-existing"})).isBatch());
    try std.testing.expect((try optionsForTest(&.{"-oa/"})).isBatch());
    inline for ([_]struct { []const u8, []const [:0]const u8 }{
        .{ "'1-' is not a range such as", &.{"--frames=1-"} },
        .{ "has more than 1000000", &.{"--frames=0-1000000"} },
        .{ "both choose the time", &.{ "--frames=1", "--animation-time=2" } },
        .{ "needs '--frames'", &.{"--reference-frame=2"} },
        .{ "'x' is not a range", &.{ "--frames=1", "--reference-frame=x" } },
        .{ "those of '--turntable'", &.{"--views=2"} },
        .{ "both place the camera", &.{ "--turntable=2", "--eye=1,2,3" } },
        .{ "'--camera' contradicts", &.{ "--turntable=2", "--camera=0" } },
        .{ "'--fps': '0' is not", &.{"--fps=0"} },
        .{ "for one picture", &.{ "--frames=1", "--progress-image=a.png" } },
        .{ "no placeholder {modle} in 'a{modle}.png'; there are {model}, ", &.{"-oa{modle}.png"} },
        .{ "1 to 9, of a number", &.{"-oa{model:3}.png"} },
        .{ "{{ is a brace", &.{"-oa{model.png"} },
        .{ "'{frame}' in '{frame}.png' needs '--frames'", &.{"-o{frame}.png"} },
        .{ "needs '--turntable'", &.{"-o{view}.png"} },
        .{ "'{camera}' stands for", &.{ "-o{camera}.png", "--eye=1,2,3" } },
        .{ "a folder's ends in /", &.{"-oa"} },
    }) |case| try expectUsage(case[0], case[1] ++ &[_][:0]const u8{"s.glb"});
}

test "after -- everything is a scene, and a lone dash always" {
    for ([_][:0]const u8{ "-q", "--help", "render", "--", "-" }) |name| {
        const command = try parseForTest(&.{ "-oa.png", "--", name });
        try std.testing.expectEqualStrings(name, command.render.scene);
        try std.testing.expect(!command.render.quiet);
    }
    const piped = try parseForTest(&.{ "-", "-o", "-", "--format-in=stl" });
    try std.testing.expectEqualStrings("-", piped.render.scene);
    try std.testing.expectEqual(.stl, piped.render.load.format.?);
    try expectUsage("say one by -o", &.{"-"});
}

test "help wins over mistakes, the other questions do not" {
    try std.testing.expectEqual(.help, try parseForTest(&.{"--help"}));
    try std.testing.expectEqual(.help, try parseForTest(&.{ "--no-such", "-h" }));
    try std.testing.expectEqual(.help, try parseForTest(&.{"-qh"}));
    try std.testing.expectEqual(.version, try parseForTest(&.{"--version"}));
    try std.testing.expectEqual(.version, try parseForTest(&.{ "--version", "s.glb" }));
    try std.testing.expectEqual(.list_variants, try parseForTest(&.{"--list-variants"}));
    try std.testing.expectEqual(.licenses, try parseForTest(&.{"--licenses"}));
    try expectUsage("--no-such", &.{ "--version", "--no-such" });
}

test "a long option takes its value joined or apart, a short one also attached" {
    const spellings = [_][]const [:0]const u8{
        &.{ "--resolution", "3x4" }, &.{"--resolution=3x4"},
        &.{ "-r", "3x4" },           &.{"-r3x4"},
        &.{"-qr3x4"},                &.{ "-vqr", "3X4" },
    };
    for (spellings) |spelling| {
        const options = try optionsForTest(spelling);
        try std.testing.expectEqual([2]u32{ 3, 4 }, options.view.resolution.?);
    }
    inline for (Reader.flags) |flag| {
        const argument = flag.long ++ if (flag.takes_value) "" else "=1";
        const needle = "'" ++ flag.long ++ if (flag.takes_value) "' needs a" else "' takes no";
        if (flag.short != 'h') try expectUsage(needle ++ " value", &.{ "s", argument });
    }
    try expectUsage("'-t' needs a value", &.{ "s", "-t" });
    try expectUsage("'--threads': '' is not 1 to 256", &.{ "s", "--threads=" });
}

test "names of other programs are understood or answered with ours" {
    const options = try optionsForTest(&.{
        "--samples=3", "--hdri=none", "--nthreads", "2", "--camera-position=1,2,3", "--max-depth=4",
    });
    try std.testing.expectEqual(3, options.render.sample_count);
    try std.testing.expectEqual(.none, options.view.environment.source);
    try std.testing.expectEqual(2, options.thread_count.?);
    try std.testing.expectEqual([3]f32{ 1, 2, 3 }, options.view.viewpoint.eye.?);
    try std.testing.expectEqual(4, options.render.depth);
    try expectUsage("option '--camera-orbit' is '--orbit' here", &.{"--camera-orbit=1deg 2deg 3m"});
    try expectUsage("'--background-color' is '--background'", &.{"--background-color=0,0,0"});
    try std.testing.expectEqual(.version, try parseForTest(&.{"-V"}));
    // No name may be that of two options.
    for (Reader.flags, 0..) |*flag, index| for ([_][]const []const u8{
        flag.also, flag.meant, &.{flag.long},
    }) |names| for (names) |name| {
        for (Reader.flags[index + 1 ..]) |*other|
            try std.testing.expect(!other.isNamed(name[2..]) and !other.isMeant(name[2..]));
    };
}

test "help for a command by a word" {
    try std.testing.expectEqual(.help, try parseForTest(&.{"help"}));
    try std.testing.expectEqual(.help, try parseForTest(&.{ "help", "render" }));
    try std.testing.expectEqual(.bench_help, try parseForTest(&.{ "help", "bench" }));
    try std.testing.expectEqual(.serve_help, try parseForTest(&.{ "help", "serve" }));
    try std.testing.expectEqual(.serve_help, try parseForTest(&.{ "serve", "-h" }));
    var diagnostic: Diagnostic = .{};
    const result = parse(&.{ "help", "benhc" }, test_names, &diagnostic);
    try std.testing.expectError(error.UsageInvalid, result);
    const expected = "no command 'benhc', did you mean 'bench'?";
    try std.testing.expectEqualStrings(expected, diagnostic.message.text());
}

test "a size in two options, and pixels of pixels" {
    const view = (try optionsForTest(&.{ "-r512", "--width=8", "--height=4" })).view;
    try std.testing.expectEqual([2]u32{ 8, 4 }, view.resolution.?);
    try std.testing.expectEqual(null, view.long_side);
    const later = (try optionsForTest(&.{ "--width=8", "--height=4", "-r3x2" })).view;
    try std.testing.expectEqual([2]u32{ 3, 2 }, later.resolution.?);
    const doubled = (try optionsForTest(&.{ "--pixel-ratio=2", "-r8x4" })).view;
    try std.testing.expectEqual([2]u32{ 16, 8 }, doubled.resolution.?);
    const long = (try optionsForTest(&.{ "-r100", "--pixel-ratio=3" })).view;
    try std.testing.expectEqual(300, long.long_side.?);
    try expectUsage("'--width' without '--height'", &.{ "s", "--width=8" });
    try expectUsage("'--height' without '--width'", &.{ "s", "--height=8" });
    try expectUsage("multiplies a size", &.{ "s", "--pixel-ratio=2" });
    try expectUsage("is not 1 to 8", &.{ "s", "--pixel-ratio=9" });
    try expectUsage("32768x32768 is not WxH", &.{ "s", "--pixel-ratio=2", "-r16384x16384" });
    try expectUsage("131072x2 is not WxH", &.{ "s", "--pixel-ratio=2", "-r65536x1" });
    try expectUsage("side of 32768 is not 1 to", &.{ "s", "--pixel-ratio=2", "-r16384" });
    try expectUsage("65536x65536 is not WxH", &.{ "s", "--width=65536", "--height=65536" });
}

test "scenarios are kept for whoever reads them, and what comes after counts" {
    const call = (try parseForTest(&.{ "--scenario={}", "-q", "a.glb" })).scenario;
    try std.testing.expectEqualStrings("{}", call.scenario);
    try std.testing.expectEqual(3, call.arguments.len);
    try expectUsage("twice", &.{ "--scenario=a", "--scenario=b" });
    try expectUsage("'--scenario'", &.{"--scenario="});
    var diagnostic: Diagnostic = .{};
    const scenario: []const [:0]const u8 = &.{ "--spp=2", "--depth=3", "--", "-a", "b" };
    const own = try parseParts(.{ scenario, &.{ "--spp=4", "-q" } }, test_names, &diagnostic);
    try std.testing.expectEqual(4, own.render.sample_count);
    try std.testing.expectEqual(3, own.render.depth);
    try std.testing.expectEqualStrings("-a", own.scene);
    try std.testing.expectEqual(2, own.batch.input_count);
    var inputs = own.inputs(&diagnostic);
    for ([_][]const u8{ "-a", "b" }) |name|
        try std.testing.expectEqualStrings(name, inputs.next().?);
    const other = try parseParts(.{ scenario, &.{"c"} }, test_names, &diagnostic);
    try std.testing.expectEqualStrings("c", other.scene);
    try std.testing.expectEqual(1, other.batch.input_count);
    inputs = other.inputs(&diagnostic);
    try std.testing.expectEqualStrings("c", inputs.next().?);
    const served = (try parseForTest(&.{ "serve", "-q", "--sandbox=off" })).serve;
    try std.testing.expectEqual(2, served.defaults.len);
    try std.testing.expectEqual(.off, served.sandbox);
    const bad = parse(&.{ "serve", "--spp=0" }, test_names, &diagnostic);
    try std.testing.expectError(error.UsageInvalid, bad);
    const named = parse(&.{ "serve", "a.glb" }, test_names, &diagnostic);
    try std.testing.expectError(error.UsageInvalid, named);
    const text = diagnostic.message.text();
    try std.testing.expectStringEndsWith(text, "(see raylane serve --help)");
}

test wantsJson {
    try std.testing.expect(wantsJson(&.{ "a", "--stats=json" }));
    try std.testing.expect(wantsJson(&.{ "--stats", "json", "--spp=0" }));
    try std.testing.expect(!wantsJson(&.{ "--stats=text", "json", "--stats" }));
}

test "unknown options are named, misspelt ones are recognised" {
    try expectUsage("unknown option '--quux' (", &.{"--quux"});
    try expectUsage("unknown option '--quux' (", &.{"--quux=bar"});
    try expectUsage("unknown option '-x' (", &.{"-x"});
    try expectUsage("unknown option '-qx' (", &.{"-qx"});
    try expectUsage("did you mean '--resolution'?", &.{"--resolutoin=1x1"});
    try expectUsage("did you mean '--depth'?", &.{"--dept"});
    try expectUsage("did you mean '--spp'?", &.{"--ssp"});
    const long: [500:0]u8 = @splat('-');
    try expectUsage("unknown option '--", &.{&long});
    try expectUsage("unknown option '--\xc3\xa4?'", &.{"--\xc3\xa4\x1b"});
}

test "numbers keep to their ranges" {
    const Case = struct { flag: []const u8, good: []const []const u8, bad: []const []const u8 };
    const cases = [_]Case{
        .{
            .flag = "--threads",
            .good = &.{ "1", "256", "007" },
            .bad = &.{ "0", "257", "-1", "+1", "1.0", "1_0", "x", " 1", "99999999999999999999" },
        },
        .{ .flag = "--spp", .good = &.{ "1", "4096" }, .bad = &.{ "0", "4097", "" } },
        .{ .flag = "--time-budget", .good = &.{ "0.5", "3600" }, .bad = &.{ "0", "-1", "1s", "" } },
        .{ .flag = "--sandbox", .good = &.{ "auto", "on", "off" }, .bad = &.{ "", "yes" } },
        .{ .flag = "--progress-image", .good = &.{"p.png"}, .bad = &.{ "", "-", "/dev/stdout" } },
        .{ .flag = "--depth", .good = &.{ "0", "32" }, .bad = &.{ "33", "-1" } },
        .{ .flag = "--tile-size", .good = &.{ "4", "36", "512" }, .bad = &.{ "0", "2", "516" } },
        .{
            .flag = "--resolution",
            .good = &.{ "1x1", "65536x1", "1x65536", "16384x16384", "1", "16384" },
            .bad = &.{ "0x1", "1x0", "65537x1", "16384x16385", "x", "1x", "1x1x1", "1*1", "16385" },
        },
        .{
            .flag = "--ambient",
            .good = &.{ "0", "-0", "1e-45", "0.35", ".5", "3e38" },
            .bad = &.{ "-1", "nan", "inf", "1e39", "0x1", "", "1_0", "1,0" },
        },
        .{
            .flag = "--exposure",
            .good = &.{ "auto", "0", "-2.5", "+1", "64", "-64" },
            .bad = &.{ "Auto", "64.1", "-65", "nan", "" },
        },
        .{
            .flag = "--background",
            .good = &.{
                "transparent", "env", "studio", "#000000", "#FFaa01", "#fA1", "red", "0,0,0",
                "1,0.5,1e3",
            },
            .bad = &.{
                "#ffff", "#gggggg", "#0000000", "rod", "1,2", "1,2,3,4", "1,2,-1", ",,", "", "#",
            },
        },
        .{
            .flag = "--tonemap",
            .good = &.{ "neutral", "aces", "agx", "linear" },
            .bad = &.{ "ACES", "reinhard", "" },
        },
        .{ .flag = "--stats", .good = &.{ "text", "json", "none" }, .bad = &.{ "JSON", "" } },
        .{ .flag = "--bvh", .good = &.{ "fast", "default", "high" }, .bad = &.{ "High", "" } },
        .{ .flag = "--instances", .good = &.{ "auto", "share", "flatten" }, .bad = &.{"all"} },
        .{ .flag = "--virtual-lights", .good = &.{ "0", "64", "1024" }, .bad = &.{ "-1", "1025" } },
        .{ .flag = "--sky-lights", .good = &.{ "1", "32", "1024" }, .bad = &.{ "0", "1025" } },
        .{ .flag = "--integrator", .good = &.{ "whitted", "lights", "path" }, .bad = &.{"bdpt"} },
        .{
            .flag = "--format",
            .good = &.{
                "png", "ppm", "pfm", "jpg", "jpeg", "JPEG", "tga", "bmp", "hdr", "exr", "webp",
            },
            .bad = &.{ "tiff", "" },
        },
        .{ .flag = "--shade", .good = &.{ "ao", "normal", "uv", "cost" }, .bad = &.{ "", "AO" } },
        .{ .flag = "--webp-quality", .good = &.{ "1", "100" }, .bad = &.{ "0", "101", "" } },
        .{ .flag = "--exr", .good = &.{ "half", "float" }, .bad = &.{ "Half", "double", "" } },
        .{ .flag = "--jpeg-quality", .good = &.{ "1", "100" }, .bad = &.{ "0", "101", "", "x" } },
        .{
            .flag = "--max-memory",
            .good = &.{ "1", "64K", "512M", "512m", "2G", "16777215T" },
            .bad = &.{ "", "0", "M", "0M", "-1G", "1.5G", "1P", "2GB", "16777216T" },
        },
        .{
            .flag = "--max-time",
            .good = &.{ "0.01", "2", "1e6" },
            .bad = &.{ "", "0", "-1", "nan", "2s", "1e7" },
        },
        .{
            .flag = "--max-triangles",
            .good = &.{ "1", "5M", "2g", "18446744073G" },
            .bad = &.{ "", "0", "K", "0K", "-1", "1.5M", "1T", "18446744074G" },
        },
        .{ .flag = "--max-pixels", .good = &.{ "1", "4K" }, .bad = &.{ "0", "64x64" } },
        .{ .flag = "--max-texture-pixels", .good = &.{ "1", "1G" }, .bad = &.{ "0", "all" } },
        .{ .flag = "--variant", .good = test_names, .bad = &.{ "vector", "", "vector-beam-16" } },
        .{ .flag = "--camera", .good = &.{ "auto", "0", "4294967296", "b c" }, .bad = &.{""} },
        .{
            .flag = "--eye",
            .good = &.{ "0,0,0", "-1,+2.5,3e8" },
            .bad = &.{ "", "1,2", "1,2,3,4", "1,,3", "nan,0,0", "0,inf,0", "1e39,0,0", "a,b,c" },
        },
        .{ .flag = "--target", .good = &.{"0,0,0"}, .bad = &.{ "1", "1 2 3", "1,2,3 " } },
        .{ .flag = "--up", .good = &.{ "0,0,-1", "1e-9,0,0" }, .bad = &.{ "0,0,0", "0,-0,1e-45" } },
        .{
            .flag = "--orbit",
            .good = &.{ "0,0", "-720,180,3", "30,60,105%", "1e30,90,1e-9" },
            .bad = &.{
                "30",      "30,60,0",   "30,60,-1", "30,60,%", "30,60,0%", "30,60,5,5", "0,-1",
                "0,180.1", "30,60,1%%", "nan,60",   "30,",     ",",        "",          "1,2,1e-40",
            },
        },
        .{
            .flag = "--fov",
            .good = &.{ "45", "0.01", "179" },
            .bad = &.{ "0", "180", "-45", "nan", "inf", "", "45deg" },
        },
        .{ .flag = "--scene", .good = &.{ "0", "4294967296", "b c", "auto" }, .bad = &.{""} },
        .{ .flag = "--material-variant", .good = &.{ "0", "b c" }, .bad = &.{""} },
        .{ .flag = "--up-axis", .good = &.{ "y", "z" }, .bad = &.{ "", "x", "Z", "-y" } },
        .{
            .flag = "--format-in",
            .good = &.{ "gltf", "glb", "pbrt", "obj", "stl", "ply" },
            .bad = &.{ "", "GLB", "fbx" },
        },
        .{ .flag = "--output", .good = &.{ "-", "a.png", "b/A.PPM" }, .bad = &.{ "", "png" } },
    };
    for (cases) |case| {
        var buffer: [128]u8 = undefined;
        for (case.good) |value| {
            const parts = .{ case.flag, value };
            errdefer std.debug.print("{s} {s}\n", parts);
            const argument = try std.mem.printSentinel(&buffer, "{s}={s}", parts, 0);
            _ = try optionsForTest(&.{argument});
        }
        for (case.bad) |value| {
            const parts = .{ case.flag, value };
            errdefer std.debug.print("{s} {s}\n", parts);
            const argument = try std.mem.printSentinel(&buffer, "{s}={s}", parts, 0);
            try expectUsage("", &.{ argument, "s.glb" });
        }
    }
}

test "values arrive as they were meant" {
    try std.testing.expectEqual(7, (try optionsForTest(&.{"--camera=7"})).view.camera.index);
    try std.testing.expectEqual(.auto, (try optionsForTest(&.{"--camera=auto"})).view.camera);
    const named = (try optionsForTest(&.{"--camera=7a"})).view.camera;
    try std.testing.expectEqualStrings("7a", named.name);
    try std.testing.expectEqual(7, (try optionsForTest(&.{"--scene=7"})).load.scene.index);
    const painted = (try optionsForTest(&.{"--material-variant=red"})).load.material_variant;
    try std.testing.expectEqualStrings("red", painted.name);
    const named_scene = (try optionsForTest(&.{"--scene=auto"})).load.scene;
    try std.testing.expectEqualStrings("auto", named_scene.name);
    try std.testing.expectEqual(.z, (try optionsForTest(&.{"--up-axis=z"})).load.up_axis.?);
    const background = (try optionsForTest(&.{"--background=#FF8001"})).view.background;
    try std.testing.expectEqual([3]u8{ 255, 128, 1 }, background.srgb);
    try expectUsage("no colour 'rod', did you mean 'red'?", &.{ "--background=rod", "s" });
    try expectUsage("did you mean 'transparent'?", &.{ "--background=trasparent", "s" });
    const name = (try optionsForTest(&.{"--background=Tan"})).view.background;
    try std.testing.expectEqual([3]u8{ 0xd2, 0xb4, 0x8c }, name.srgb);
    const linear = (try optionsForTest(&.{"--background=0,0.5,2"})).view.background;
    try std.testing.expectEqual([3]f32{ 0, 0.5, 2 }, linear.linear);
    const denormal = (try optionsForTest(&.{"--ambient=1e-40"})).view.ambient;
    try std.testing.expectEqual(0, denormal);
    const exposure = (try optionsForTest(&.{ "--exposure", "-1.5" })).write.exposure;
    try std.testing.expectEqual(-1.5, exposure.ev);
    try std.testing.expectEqual(.high, (try optionsForTest(&.{ "--bvh", "high" })).tree_quality);
    const variant = try optionsForTest(&.{"--variant=scalar-single-4"});
    try std.testing.expectEqual(1, variant.render.variant);
    const older = try optionsForTest(&.{"--variant=vector-packet-8"});
    try std.testing.expectEqual(0, older.render.variant);
    try expectUsage("did you mean 'vector-beam-8'?", &.{ "--variant=vector-baem-8", "s" });
    const written = try optionsForTest(&.{ "--jpeg-quality=7", "--max-memory=3M" });
    try std.testing.expectEqual(7, written.write.jpeg_quality);
    try std.testing.expectEqual(3 << 20, written.memory_max);
    const switches = try optionsForTest(&.{
        "-qv", "--count-tests", "--allow-outside", "--strict", "--force",
    });
    try std.testing.expect(switches.quiet and switches.verbose);
    try std.testing.expect(switches.count_tests and switches.load.allow_outside);
    try std.testing.expect(switches.load.strict and switches.load.force);
}

test "viewpoints arrive as they were meant, and may not contradict each other" {
    const given = (try optionsForTest(&.{
        "--orbit=-30,60,4.75", "--target", "1,2,3", "--fov=45", "--up=0,0,1",
    })).view.viewpoint;
    try std.testing.expectEqualDeep(settings.Viewpoint{
        .orbit = .{ .theta_degrees = -30, .phi_degrees = 60, .radius = .{ .metres = 4.75 } },
        .target = .{ 1, 2, 3 },
        .fov_degrees = 45,
        .up = .{ 0, 0, 1 },
    }, given);
    const share = (try optionsForTest(&.{ "--orbit=0,90,150%", "--ortho" })).view.viewpoint;
    try std.testing.expectEqual(1.5, share.orbit.?.radius.share);
    try std.testing.expect(share.orthographic);
    const eye = (try optionsForTest(&.{ "--eye=1,2,3", "--camera=auto" })).view.viewpoint;
    try std.testing.expectEqual([3]f32{ 1, 2, 3 }, eye.eye.?);
    const angle = (try optionsForTest(&.{ "--fov=45", "--camera=1" })).view;
    try std.testing.expect(!angle.viewpoint.replacesCamera() and angle.camera == .index);
    try expectUsage("both place", &.{ "--eye=1,2,3", "--orbit=1,2", "s" });
    try expectUsage("same place", &.{ "--eye=1,2,3", "--target=1,2,3", "s" });
    try expectUsage("'--fov' contradicts '--ortho'", &.{ "--ortho", "--fov=45", "s" });
    for ([_][:0]const u8{
        "--eye=1,2,3", "--target=1,2,3", "--up=1,2,3", "--orbit=1,2", "--ortho",
    }) |option| {
        try expectUsage("'--camera' contradicts", &.{ option, "--camera=name", "s" });
    }
}

test "an animation by name, index or all, and a time of the first without" {
    const Which = settings.Animation.Which;
    const Case = struct { []const [:0]const u8, Which, f32 };
    for ([_]Case{
        .{ &.{"s.glb"}, .default, 0 },
        .{ &.{ "s.glb", "--animation", "run" }, .{ .name = "run" }, 0 },
        .{ &.{ "s.glb", "--animation=3", "--animation-time", "1.5" }, .{ .index = 3 }, 1.5 },
        .{ &.{ "s.glb", "--animation-time=2", "--animation", "all" }, .all, 2 },
        .{ &.{ "s.glb", "--animation-time", "-0.5" }, .{ .index = 0 }, -0.5 },
    }) |case| {
        const animation = (try parseForTest(case[0])).render.animation;
        try std.testing.expectEqualDeep(case[1], animation.which);
        try std.testing.expectEqual(case[2], animation.time_s);
    }
    const bad = [_][:0]const u8{ "s.glb", "--animation-time", "soon" };
    try std.testing.expectError(error.UsageInvalid, parseForTest(&bad));
    try std.testing.expect((try parseForTest(&.{ "s.glb", "--frame-all" })).render.view.frames_all);
}

test "one number is the long side" {
    const side = (try optionsForTest(&.{ "--thesis", "-r512" })).view;
    try std.testing.expectEqual(512, side.long_side.?);
    try std.testing.expectEqual(null, side.resolution);
    const both = (try optionsForTest(&.{ "-r512", "-r3x4" })).view;
    try std.testing.expectEqual(null, both.long_side);
    try std.testing.expectEqual([2]u32{ 3, 4 }, both.resolution.?);
    const thesis = (try optionsForTest(&.{ "-r512", "--thesis" })).view;
    try std.testing.expectEqual(null, thesis.long_side);
}

test "the last of several options counts, around --thesis too" {
    const twice = try optionsForTest(&.{ "--spp=1", "--spp=2" });
    try std.testing.expectEqual(2, twice.render.sample_count);
    const thesis = try optionsForTest(&.{ "--depth=9", "-t7", "--thesis" });
    try std.testing.expectEqual([2]u32{ 1024, 1024 }, thesis.view.resolution.?);
    try std.testing.expectEqual(3, thesis.render.depth);
    try std.testing.expectEqual(1, thesis.render.sample_count);
    try std.testing.expectEqual(null, thesis.thread_count);
    try std.testing.expectEqual(0, thesis.write.exposure.ev);
    try std.testing.expectEqual(.linear, thesis.write.tone_mapping);
    try std.testing.expect(!thesis.view.display_referred and !thesis.view.emitters);
    const changed = try optionsForTest(&.{ "--thesis", "--depth=9", "-t7" });
    try std.testing.expectEqual(9, changed.render.depth);
    try std.testing.expectEqual(7, changed.thread_count);
    try std.testing.expectEqual([2]u32{ 1024, 1024 }, changed.view.resolution.?);
}

test "the format follows the name, unless said otherwise" {
    const Case = struct { settings.Format, []const [:0]const u8 };
    for ([_]Case{
        .{ .pfm, &.{"-oa.pfm"} },
        .{ .ppm, &.{"-oA.PPM"} },
        .{ .png, &.{ "-o", "-" } },
        .{ .ppm, &.{ "-o", "-", "--format=ppm" } },
        .{ .pfm, &.{ "--format=pfm", "-oa.dat" } },
        .{ .pfm, &.{ "--format=pfm", "-oa" } },
        .{ .jpg, &.{"-oa.JPEG"} },
        .{ .jpg, &.{ "-oa.jpeg", "--format=jpg" } },
        .{ .hdr, &.{"-oa.b.hdr"} },
        .{ .exr, &.{"-oa.exr"} },
    }) |case| {
        try std.testing.expectEqual(case[0], (try optionsForTest(case[1])).write.format);
    }
    try expectUsage("contradicts", &.{ "--format=pfm", "-oa.png", "s" });
    try expectUsage("not in a png file", &.{ "--layers=depth", "s" });
    for ([_][:0]const u8{ "--layers=", "--layers=depht", "--layers=depth,", "--layers=a b" }) |bad|
        try expectUsage("depth, normal, albedo", &.{ bad, "-oa.exr", "s" });
    const layered = try optionsForTest(&.{ "--layers=depth,albedo,depth", "-oa.exr" });
    try std.testing.expectEqual(2, layered.render.layers.count());
    const each = try optionsForTest(&.{
        "--layers=depth,normal,albedo,uv,node,material,primitive,alpha,position,cost,variance",
        "-oa-{layer}.png",
    });
    try std.testing.expectEqual(11, each.render.layers.count());
    try expectUsage("counts", &.{ "--layers=cost", "--integrator=path", "-oa.exr", "s" });
    const alone = try optionsForTest(&.{"--shade=cost"});
    try std.testing.expectEqualStrings("scalar-single-4", test_names[alone.render.variant]);
    const chosen = try optionsForTest(&.{ "--variant=vector-beam-8", "--layers=cost", "-oa.exr" });
    try std.testing.expectEqual(0, chosen.render.variant);
    for ([_][:0]const u8{ "--denoise", "--count-tests", "--integrator=lights" }) |other|
        try expectUsage("'--shade' contradicts", &.{ "--shade=ao", other, "s" });
    try expectUsage("'a.tiff' ends in no image format", &.{ "-oa.tiff", "s" });
}

test outputName {
    const gpa = std.testing.allocator;
    const cases = [_][2][]const u8{
        .{ "a.glb", "a.png" },                   .{ "/x/y.z/a.b.gltf", "a.b.png" },
        .{ "a", "a.png" },                       .{ "builtin:cornell", "cornell.png" },
        .{ "builtin:x/cornell", "cornell.png" }, .{ ".glb", ".glb.png" },
        .{ "", ".png" },                         .{ "/", ".png" },
    };
    for (cases) |case| {
        const name = try outputName(gpa, &.{ .scene = case[0] });
        defer gpa.free(name);
        try std.testing.expectEqualStrings(case[1], name);
    }
    const given = try outputName(gpa, &.{
        .scene = "a.glb",
        .output = "b/c.ppm",
        .write = .{ .format = .ppm },
    });
    defer gpa.free(given);
    try std.testing.expectEqualStrings("b/c.ppm", given);
    const pfm = try outputName(gpa, &.{ .scene = "a.glb", .write = .{ .format = .pfm } });
    defer gpa.free(pfm);
    try std.testing.expectEqualStrings("a.pfm", pfm);
}

test "noise is told of path tracing alone, as the picture is exposed" {
    const options = try optionsForTest(&.{
        "--noise=0.01", "--exposure=2", "--integrator=path", "--partial",
    });
    try std.testing.expectEqual(0.01, options.render.noise.?.error_max);
    try std.testing.expectEqual(2, options.render.noise.?.exposure.ev);
    try std.testing.expect(options.partial and options.progress_image == null);
    try expectUsage("'--integrator path'", &.{ "--noise=0.01", "s" });
    for ([_][:0]const u8{ "0", "-1", "2", "nan", "" }) |text| {
        try std.testing.expectEqual(null, values.numberWithin(text, settings.noise_error));
    }
}

test "parts are rectangles or shares of tiles" {
    const Crop = settings.Part.Crop;
    const pixels = (try optionsForTest(&.{"--crop=0,8,16,24"})).render.part;
    try std.testing.expectEqual(Crop{ .pixels = .{ 0, 8, 16, 24 } }, pixels.crop);
    const shares = (try optionsForTest(&.{"--crop=0,0.25,1,1"})).render.part;
    try std.testing.expectEqual(Crop{ .shares = .{ 0, 0.25, 1, 1 } }, shares.crop);
    const tile = (try optionsForTest(&.{ "--tile=3/4", "-oa.exr" })).render.part.tile;
    try std.testing.expectEqual(settings.Part.Tile{ .number = 3, .count = 4 }, tile);
    for ([_][:0]const u8{
        "--crop=",        "--crop=1,2,3",    "--crop=1,2,1,3",    "--crop=1,2,3,4,5",
        "--crop=0,0,1.5", "--crop=-1,0,1,1", "--crop=0,0,1.01,1", "--crop=0.5,0,0.5,1",
        "--tile=0/1",     "--tile=2/1",      "--tile=1",          "--tile=1/0",
        "--tile=/",       "--tile=1/70000",  "--crop=nan.,0,1,1",
    }) |bad| try expectUsage(bad[0..6], &.{ bad, "-oa.exr", "s" });
    try expectUsage("makes an exr file", &.{ "--tile=1/2", "s" });
    try expectUsage("'--time-budget'", &.{ "--crop=0,0,1,1", "--time-budget=1", "s" });
    const merged = try optionsForTest(&.{ "--crop=0,0,1,1", "-oa.exr" });
    const alone = try optionsForTest(&.{"--crop=0,0,1,1"});
    try std.testing.expect(merged.render.is_merged and !alone.render.is_merged);
}

test "points and lines are as wide as they may be" {
    try std.testing.expectEqual(1.5, (try optionsForTest(&.{})).view.point_size);
    const wide = try optionsForTest(&.{"--point-size=4.25"});
    try std.testing.expectEqual(4.25, wide.view.point_size);
    for ([_][:0]const u8{ "0", "-1", "101", "nan", "" }) |text| {
        try std.testing.expectEqual(null, values.numberWithin(text, settings.point_size));
    }
}

test "the help fits a screen and says what flags take and may be" {
    try std.testing.expect(try @import("cli/testing.zig").expectFits(help) <= 190);
    for ([_][]const u8{
        "\n  -o, --output FILE        name ending in",
        "\n                           4 to 1024 (default: 32)\n",
        "\n  -t, --threads N          1 to 256 (default: as many as CPUs)\n",
        "\n      --thesis             1024x1024, 1 sample, depth 3,",
    }) |text| try std.testing.expect(std.mem.find(u8, help, text) != null);
}

test "completions and the manual have every option of every command, and its words" {
    for (std.enums.values(Shell)) |shell| {
        var script: std.Io.Writer.Allocating = .init(std.testing.allocator);
        defer script.deinit();
        try writeCompletion(&script.writer, shell, pages);
        var manual: std.Io.Writer.Allocating = .init(std.testing.allocator);
        defer manual.deinit();
        try writeMan(&manual.writer);
        for (std.meta.fieldNames(Word)) |word| for (pages) |*page| {
            if (std.mem.eql(u8, page.word, word)) break;
        } else try std.testing.expectEqualStrings("help", word);
        for (pages) |*page| {
            try expectFinds(script.written(), "{s}", page.name());
            try expectFinds(manual.written(), "raylane {s}", page.word);
            var options = page.iterate();
            while (options.next()) |entry| {
                const long = entry.flag.long;
                if (shell == .fish)
                    try expectFinds(script.written(), " -l {s} ", long[2..])
                else
                    try expectFinds(script.written(), "{s}", long);
                for (entry.option.words) |word| try expectFinds(script.written(), "{s}", word);
                var escaped: std.Io.Writer.Allocating = .init(std.testing.allocator);
                defer escaped.deinit();
                for (long) |byte| try escaped.writer.print("{s}", .{
                    if (byte == '-') "\\-" else &[_]u8{byte},
                });
                try expectFinds(manual.written(), "\\fB{s}\\fR", escaped.written());
            }
        }
    }
}

fn expectFinds(text: []const u8, comptime format: []const u8, part: []const u8) !void {
    const needle = try std.testing.allocator.print(format, .{part});
    defer std.testing.allocator.free(needle);
    errdefer std.debug.print("not found: {s}\n", .{needle});
    try std.testing.expect(std.mem.find(u8, text, needle) != null);
}

test "completion takes a shell, the manual nothing" {
    try std.testing.expectEqual(.zsh, (try parseForTest(&.{ "completion", "zsh" })).completion);
    try std.testing.expectEqual(.man, try parseForTest(&.{"man"}));
    try std.testing.expectEqual(.man_help, try parseForTest(&.{ "man", "-h" }));
    try std.testing.expectEqual(.completion_help, try parseForTest(&.{ "completion", "--help" }));
    const common = @import("cli/testing.zig");
    for ([_][]const [:0]const u8{ &.{}, &.{"tcsh"}, &.{ "bash", "zsh" } }) |words|
        try common.expectUsage("completion", shellOf, "bash, zsh or fish", words);
    try std.testing.expectError(error.UsageInvalid, parseForTest(&.{ "man", "1" }));
}

test {
    _ = batch;
    _ = bench;
    _ = compare;
    _ = info;
    _ = merge;
    _ = @import("cli/arguments.zig");
    _ = colors;
    _ = @import("cli/nearest.zig");
    _ = @import("cli/page.zig");
    _ = scenario_file;
    _ = @import("cli/serve.zig");
}

test "progress: its form, its descriptor, and what contradicts it" {
    const none: settings.Progress = .{ .form = .none };
    try std.testing.expectEqual(none, (try parseForTest(&.{ "a", "-q" })).render.progress);
    try std.testing.expectEqual(.auto, (try parseForTest(&.{"a"})).render.progress.form);
    const json: settings.Progress = .{ .form = .json, .file = 2 };
    for ([_][]const [:0]const u8{
        &.{ "a", "--progress-fd=2" }, &.{ "a", "-q", "--progress=json", "--progress-fd", "2" },
    }) |arguments| {
        try std.testing.expectEqual(json, (try parseForTest(arguments)).render.progress);
    }
    try expectUsage("'--progress'", &.{ "a", "--progress=bar" });
    try expectUsage("'--progress-fd'", &.{ "a", "--progress-fd=0" });
    try expectUsage("for '--progress json'", &.{ "a", "--progress=none", "--progress-fd=2" });
    try expectUsage("where the image goes", &.{ "a", "-o-", "--progress-fd=1" });
    try expectUsage("'--progress-fd 65536' is not open", &.{ "a", "--progress-fd=65536" });
}

test "info is a command where it comes first, and where it is misspelt" {
    try std.testing.expectEqual(.info_help, try parseForTest(&.{ "info", "a", "--help" }));
    const command = try parseForTest(&.{ "info", "info", "--json" });
    try std.testing.expectEqualStrings("info", command.info.scene);
    try expectUsage("no command 'inof', did you mean 'info'?", &.{ "inof", "a.glb" });
    try expectUsage("no command 'benhc', did you mean 'bench'?", &.{ "benhc", "a.glb" });
    const both = try parseForTest(&.{ "in", "a.glb" });
    try std.testing.expectEqual(2, both.render.batch.input_count);
}

test "bench is a command where it comes first" {
    try std.testing.expectEqual(.bench_help, try parseForTest(&.{ "bench", "--wrong", "-h" }));
    const command = try parseForTest(&.{ "bench", "bench", "-t2" });
    try std.testing.expectEqualStrings("bench", command.bench.scenes[0]);
    try std.testing.expectEqualStrings("bench", (try optionsOf("bench", &.{"render"})).scene);
}

fn optionsOf(scene: [:0]const u8, arguments: []const [:0]const u8) !Options {
    var all: [8][:0]const u8 = undefined;
    @memcpy(all[0..arguments.len], arguments);
    all[arguments.len] = scene;
    return (try parseForTest(all[0 .. arguments.len + 1])).render;
}
