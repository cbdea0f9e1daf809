//! Options as JSON: objects -> the arguments that say the same, for the one parser.
//!
//! In: the text of `--scenario`, or a job of `raylane serve`. Out: `--option=value` for each key,
//! then the inputs; docs/json.md has the keys. What the generator of Khronos's glTF Render Fidelity
//! comparison hands to a renderer, and the list of scenarios that it reads, are such objects in
//! other words, with its defaults for what is left out.

const std = @import("std");
const Allocator = std.mem.Allocator;
const Diagnostic = @import("../diagnostic.zig").Diagnostic;
const Flag = @import("arguments.zig").Flag;
const Io = std.Io;
const ObjectMap = std.json.ObjectMap;
const Value = std.json.Value;
const builtin_prefix = @import("../settings.zig").builtin_prefix;
const nearest = @import("nearest.zig").nearest;
const quote = @import("../diagnostic.zig").quote;

/// Longest text of scenarios that is read.
pub const bytes_max = 16 << 20;
/// What the generator calls us where it leaves out renderers.
const own_name = "raylane";

pub const Error = error{ OutOfMemory, UsageInvalid };

/// What to render, and how.
pub const Scenario = struct {
    /// Options, each with its value in one; then `--` and the inputs.
    arguments: []const [:0]const u8,
    /// As its author calls it; empty: not at all.
    name: []const u8 = "",
    /// What a job's answer is known by: a text, a number or nothing.
    id: Value = .null,
};

/// Where the text is from: what it names may be near.
pub const Source = struct {
    text: []const u8,
    /// Empty: no file.
    path: []const u8 = "",
};

/// Reads one scenario, a list of them, or a configuration of Khronos's generator. All memory is
/// from `arena`. `UsageInvalid`: the diagnostic says what is wrong.
pub fn read(
    arena: Allocator,
    io: Io,
    flags: []const Flag,
    source: Source,
    diagnostic: *Diagnostic,
) Error![]const Scenario {
    const root = try valueOf(arena, source.text, diagnostic);
    const folder = std.fs.path.dirname(source.path) orelse ".";
    var builder: Builder = .{
        .arena = arena,
        .io = io,
        .flags = flags,
        .folders = &.{folder},
        .diagnostic = diagnostic,
    };
    switch (root) {
        .array => |list| return builder.all(list.items),
        .object => |*object| {
            const list = object.get("scenarios") orelse {
                const one = try arena.alloc(Scenario, 1);
                one[0] = try builder.build(object);
                return one;
            };
            // Models are named from the folder of a renderer, beside the configuration.
            const of_renderer = try std.fs.path.join(arena, &.{ folder, "renderers", own_name });
            builder.folders = &.{ of_renderer, folder };
            if (list != .array) return builder.fail("'scenarios' is not a list", .{});
            return builder.all(list.array.items);
        },
        else => return builder.fail("neither an object nor a list of objects", .{}),
    }
}

/// Reads one object.
pub fn readOne(
    arena: Allocator,
    io: Io,
    flags: []const Flag,
    text: []const u8,
    diagnostic: *Diagnostic,
) Error!Scenario {
    var builder: Builder = .{ .arena = arena, .io = io, .flags = flags, .diagnostic = diagnostic };
    const root = try valueOf(arena, text, diagnostic);
    if (root != .object) return builder.fail("not an object", .{});
    return builder.build(&root.object);
}

/// The `id` of a job that is wrong otherwise, if it has one.
pub fn idOf(arena: Allocator, text: []const u8) Value {
    var diagnostic: Diagnostic = .{};
    const root = valueOf(arena, text, &diagnostic) catch return .null;
    if (root != .object) return .null;
    const id = root.object.get("id") orelse return .null;
    return if (id == .string or id == .number_string) id else .null;
}

fn valueOf(arena: Allocator, text: []const u8, diagnostic: *Diagnostic) Error!Value {
    var scanner: std.json.Scanner = .initCompleteInput(arena, text);
    var place: std.json.Diagnostics = .{};
    scanner.enableDiagnostics(&place);
    return std.json.parseFromTokenSourceLeaky(Value, arena, &scanner, .{
        .parse_numbers = false,
    }) catch |err| switch (err) {
        error.OutOfMemory => error.OutOfMemory,
        error.DuplicateField => diagnostic.fail(
            error.UsageInvalid,
            "line {d}: a key is there twice",
            .{place.getLine()},
        ),
        else => diagnostic.fail(error.UsageInvalid, "line {d}, column {d}: not JSON", .{
            place.getLine(), place.getColumn(),
        }),
    };
}

/// Words of Khronos's scenarios that are no options of ours, or have another form there.
const Khronos = enum { model, lighting, dimensions, verticalFoV, renderSkybox, outputFile };
/// What is left out of such a scenario.
const default_lighting = "../../../environments/lightroom_14b.hdr";
const default_fov_degrees = "45";
const Axes = [3][]const u8;
const default_dimensions: [2][]const u8 = .{ "768", "768" };
const default_target: Axes = .{ "0", "0", "0" };
const default_orbit: Axes = .{ "0", "90", "1" };

/// Keys that say nothing of the picture.
const remarks = [_][]const u8{ "id", "name", "exclude", "pt", "scenario" };
/// Options that do something else than a picture.
const questions = [_][]const u8{ "help", "version", "licenses", "list-variants", "scenario" };

const Builder = struct {
    arena: Allocator,
    io: Io,
    flags: []const Flag,
    /// From which Khronos's scenarios may name files.
    folders: []const []const u8 = &.{},
    diagnostic: *Diagnostic,
    /// What is read: the outer of two objects first, which wins.
    objects: [2]*const ObjectMap = undefined,
    object_count: usize = 0,
    arguments: std.ArrayList([:0]const u8) = .empty,
    inputs: std.ArrayList([:0]const u8) = .empty,

    fn fail(
        builder: *const Builder,
        comptime format: []const u8,
        arguments: anytype,
    ) error{UsageInvalid} {
        return builder.diagnostic.fail(error.UsageInvalid, format, arguments);
    }

    fn all(builder: *Builder, list: []const Value) Error![]const Scenario {
        var scenarios: std.ArrayList(Scenario) = .empty;
        for (list, 0..) |*value, index| {
            if (value.* != .object) return builder.fail("scenario {d} is not an object", .{index});
            if (isExcluded(&value.object)) continue;
            try scenarios.append(builder.arena, try builder.build(&value.object));
        }
        if (scenarios.items.len == 0) return builder.fail("there is no scenario in it", .{});
        return scenarios.items;
    }

    /// Whether Khronos's scenario is not for us.
    fn isExcluded(object: *const ObjectMap) bool {
        const list = object.get("exclude") orelse return false;
        if (list != .array) return false;
        for (list.array.items) |name| {
            if (name == .string and std.mem.eql(u8, name.string, own_name)) return true;
        }
        return false;
    }

    fn build(builder: *Builder, object: *const ObjectMap) Error!Scenario {
        builder.arguments = .empty;
        builder.inputs = .empty;
        builder.objects[0] = object;
        builder.object_count = 1;
        if (object.getPtr("scenario")) |inner| {
            if (inner.* != .object) return builder.fail("'scenario' is not an object", .{});
            builder.objects[1] = &inner.object;
            builder.object_count = 2;
        }
        const name = try builder.textOf("name") orelse "";
        const is_khronos = builder.find("model") != null;
        if (is_khronos) try builder.setKhronos(name);
        var index = builder.object_count;
        while (index > 0) {
            index -= 1;
            var entries = builder.objects[index].iterator();
            while (entries.next()) |entry| {
                if (is_khronos and isKhronos(entry.key_ptr.*, entry.value_ptr)) continue;
                try builder.set(entry.key_ptr.*, entry.value_ptr);
            }
        }
        try builder.arguments.append(builder.arena, "--");
        try builder.arguments.appendSlice(builder.arena, builder.inputs.items);
        const id = builder.find("id");
        if (id) |value| switch (value.*) {
            .null, .string, .number_string => {},
            else => return builder.fail("'id' is neither text nor a number", .{}),
        };
        return .{
            .arguments = builder.arguments.items,
            .name = name,
            .id = if (id) |value| value.* else .null,
        };
    }

    fn find(builder: *const Builder, key: []const u8) ?*const Value {
        for (builder.objects[0..builder.object_count]) |object| {
            const value = object.getPtr(key) orelse continue;
            if (value.* != .null) return value;
        }
        return null;
    }

    fn textOf(builder: *const Builder, key: []const u8) Error!?[]const u8 {
        const value = builder.find(key) orelse return null;
        if (value.* != .string) return builder.fail("{f} is not text", .{quote(key)});
        return value.string;
    }

    fn isKhronos(key: []const u8, value: *const Value) bool {
        if (std.meta.stringToEnum(Khronos, key) != null) return true;
        const has_parts = std.mem.eql(u8, key, "target") or std.mem.eql(u8, key, "orbit");
        return has_parts and value.* == .object;
    }

    /// Says in our words what a scenario of Khronos's says, or leaves out.
    fn setKhronos(builder: *Builder, name: []const u8) Error!void {
        const output = try builder.outputOf(name);
        const beside = if (output) |path| std.fs.path.dirname(path) else null;
        const model = (try builder.textOf("model")).?;
        const path = try builder.place(model, beside) orelse model;
        try builder.inputs.append(builder.arena, try builder.terminated(path));
        const lighting = try builder.textOf("lighting");
        if (try builder.place(lighting orelse default_lighting, beside) orelse lighting) |found|
            try builder.append("--env={s}", .{found});
        const size = try builder.partsOf("dimensions", .{ "width", "height" }, default_dimensions);
        const sides = size orelse default_dimensions;
        try builder.append("--resolution={s}x{s}", .{ sides[0], sides[1] });
        try builder.setView();
        const skybox = builder.find("renderSkybox");
        const is_seen = if (skybox) |value| value.* == .bool and value.bool else false;
        try builder.append("--background={s}", .{if (is_seen) "env" else "transparent"});
        // Its engines do not meter.
        try builder.append("--exposure=0", .{});
        if (output) |name_of| try builder.append("--output={s}", .{name_of});
    }

    fn setView(builder: *Builder) Error!void {
        const fov = if (builder.find("verticalFoV")) |value|
            scalarOf(value) orelse return builder.fail("'verticalFoV' is not a number", .{})
        else
            default_fov_degrees;
        try builder.append("--fov={s}", .{fov});
        const axes = .{ "x", "y", "z" };
        const target = try builder.partsOf("target", axes, default_target) orelse default_target;
        const polar = .{ "theta", "phi", "radius" };
        const orbit = try builder.partsOf("orbit", polar, default_orbit) orelse default_orbit;
        const radius = std.fmt.parseFloat(f64, orbit[2]) catch 1;
        if (radius != 0) {
            try builder.append("--target={s},{s},{s}", .{ target[0], target[1], target[2] });
            return builder.append("--orbit={s},{s},{s}", .{ orbit[0], orbit[1], orbit[2] });
        }
        // The camera stands at the target and looks as it would from any distance.
        const theta = std.math.degreesToRadians(std.fmt.parseFloat(f64, orbit[0]) catch 0);
        const phi = std.math.degreesToRadians(std.fmt.parseFloat(f64, orbit[1]) catch 0);
        const back: [3]f64 = .{
            @sin(phi) * @sin(theta), @cos(phi), @sin(phi) * @cos(theta),
        };
        var ahead: [3]f64 = undefined;
        for (&ahead, target, back) |*ordinate, text, part| {
            ordinate.* = (std.fmt.parseFloat(f64, text) catch 0) - part;
        }
        try builder.append("--eye={s},{s},{s}", .{ target[0], target[1], target[2] });
        try builder.append("--target={d},{d},{d}", .{ ahead[0], ahead[1], ahead[2] });
    }

    /// Where Khronos's picture goes; null: as without a name.
    fn outputOf(builder: *const Builder, name: []const u8) Error!?[]const u8 {
        if (try builder.textOf("outputFile")) |path| return path;
        if (name.len == 0 or builder.find("output") != null) return null;
        if (std.mem.findScalar(u8, name, '/') != null)
            return builder.fail("the name {f} is no file name", .{quote(name)});
        return try builder.arena.print("{s}.png", .{name});
    }

    /// The first of the places that a path may mean where there is something; null: nowhere.
    fn place(builder: *const Builder, path: []const u8, beside: ?[]const u8) Error!?[]const u8 {
        if (std.mem.startsWith(u8, path, builtin_prefix)) return path;
        if (std.mem.findScalar(u8, path, 0) != null) return null;
        if (beside) |folder| if (try builder.placeIn(folder, path)) |found| return found;
        for (builder.folders) |folder| if (try builder.placeIn(folder, path)) |found| return found;
        return builder.placeIn(".", path);
    }

    /// By the names of folders alone: those on the way need not be there.
    fn placeIn(builder: *const Builder, folder: []const u8, path: []const u8) Error!?[]const u8 {
        const found = try std.fs.path.resolveAlloc(builder.arena, &.{ folder, path });
        Io.Dir.cwd().access(builder.io, found, .{}) catch return null;
        return found;
    }

    /// The named parts of an object as texts; null: the key is not there or has another form.
    fn partsOf(
        builder: *const Builder,
        key: []const u8,
        names: anytype,
        defaults: [names.len][]const u8,
    ) Error!?[names.len][]const u8 {
        const value = builder.find(key) orelse return null;
        if (value.* != .object) return null;
        var parts = defaults;
        inline for (names, &parts) |name, *part| if (value.object.getPtr(name)) |given| {
            part.* = scalarOf(given) orelse return builder.fail(
                "'{s}' of '{s}' is not a number",
                .{ name, key },
            );
        };
        return parts;
    }

    /// Says a key of ours.
    fn set(builder: *Builder, key: []const u8, value: *const Value) Error!void {
        for (remarks) |name| if (std.mem.eql(u8, name, key)) return;
        if (value.* == .null) return;
        if (std.mem.eql(u8, key, "input")) return builder.setInput(value);
        const flag = try builder.flagOf(key);
        if (value.* == .bool) {
            if (!value.bool) return;
            if (flag.takes_value)
                return builder.fail("{f} needs a value, not true", .{quote(key)});
            return builder.append("{s}", .{flag.long});
        }
        if (!flag.takes_value) return builder.fail("{f} is true or false", .{quote(key)});
        var text: std.ArrayList(u8) = .empty;
        const separator: u8 = if (std.mem.startsWith(u8, flag.value, "WxH")) 'x' else ',';
        if (value.* == .array) {
            for (value.array.items, 0..) |*item, index| {
                if (index > 0) try text.append(builder.arena, separator);
                const part = scalarOf(item) orelse
                    return builder.fail("{f} is a list of other things than text or numbers", .{
                        quote(key),
                    });
                try text.appendSlice(builder.arena, part);
            }
        } else try text.appendSlice(builder.arena, scalarOf(value) orelse
            return builder.fail("{f} is neither text, a number nor a list", .{quote(key)}));
        if (std.mem.findScalar(u8, text.items, 0) != null)
            return builder.fail("{f} holds a zero byte", .{quote(key)});
        try builder.append("{s}={s}", .{ flag.long, text.items });
    }

    fn setInput(builder: *Builder, value: *const Value) Error!void {
        const one: []const Value = &.{value.*};
        const list = if (value.* == .array) value.array.items else one;
        for (list) |*item| {
            if (item.* != .string) return builder.fail("'input' is not text", .{});
            const name = try builder.terminated(item.string);
            try builder.inputs.append(builder.arena, name);
        }
    }

    fn flagOf(builder: *const Builder, key: []const u8) Error!*const Flag {
        const name = try builder.arena.dupe(u8, key);
        std.mem.replaceScalar(u8, name, '_', '-');
        for (questions) |question| if (std.mem.eql(u8, question, name))
            return builder.fail("{f} asks for something else than a picture", .{quote(key)});
        for (builder.flags) |*flag| if (flag.isNamed(name)) return flag;
        const names = try builder.arena.alloc([]const u8, builder.flags.len + 1);
        for (names[1..], builder.flags) |*candidate, *flag| candidate.* = flag.long[2..];
        names[0] = "input";
        if (nearest(name, names)) |candidate|
            return builder.fail("unknown key {f}, did you mean '{s}'?", .{
                quote(key), candidate,
            });
        return builder.fail("unknown key {f}", .{quote(key)});
    }

    fn append(builder: *Builder, comptime format: []const u8, arguments: anytype) Error!void {
        const text = try builder.arena.printSentinel(format, arguments, 0);
        try builder.arguments.append(builder.arena, text);
    }

    fn terminated(builder: *const Builder, text: []const u8) Error![:0]const u8 {
        if (std.mem.findScalar(u8, text, 0) != null)
            return builder.fail("a file's name holds a zero byte", .{});
        return builder.arena.dupeSentinel(u8, text, 0);
    }
};

/// A text, or a number as it is spelt.
fn scalarOf(value: *const Value) ?[]const u8 {
    return switch (value.*) {
        .string, .number_string => |text| text,
        else => null,
    };
}

const testing = std.testing;

const flags_for_test: []const Flag = &.{
    .of(.{ .usage = "-o, --output FILE", .help = "" }),
    .of(.{ .usage = "-r, --resolution WxH|N", .help = "" }),
    .of(.{ .usage = "--spp N", .help = "", .also = &.{"--samples"} }),
    .of(.{ .usage = "--denoise", .help = "" }),
    .of(.{ .usage = "--material-variant N", .help = "" }),
    .of(.{ .usage = "--target X,Y,Z", .help = "" }),
    .of(.{ .usage = "--help", .help = "" }),
};

/// The arguments of all scenarios, one a line.
fn expectArguments(expected: []const u8, path: []const u8, text: []const u8) !void {
    var arena: std.heap.ArenaAllocator = .init(testing.allocator);
    defer arena.deinit();
    var diagnostic: Diagnostic = .{};
    const source: Source = .{ .text = text, .path = path };
    const scenarios =
        read(arena.allocator(), testing.io, flags_for_test, source, &diagnostic) catch |err| {
            std.debug.print("{s}\n", .{diagnostic.message.text()});
            return err;
        };
    var lines: Io.Writer.Allocating = .init(testing.allocator);
    defer lines.deinit();
    for (scenarios) |*scenario| for (scenario.arguments) |argument| {
        try lines.writer.print("{s}\n", .{argument});
    };
    try testing.expectEqualStrings(expected, lines.written());
}

fn expectError(needle: []const u8, text: []const u8) !void {
    var arena: std.heap.ArenaAllocator = .init(testing.allocator);
    defer arena.deinit();
    var diagnostic: Diagnostic = .{};
    const source: Source = .{ .text = text };
    const result = read(arena.allocator(), testing.io, flags_for_test, source, &diagnostic);
    try testing.expectError(error.UsageInvalid, result);
    const message = diagnostic.message.text();
    errdefer std.debug.print("{s}\n", .{message});
    try testing.expect(std.mem.find(u8, message, needle) != null);
}

test "keys are options, whatever JSON has for values" {
    try expectArguments(
        \\--spp=16
        \\--denoise
        \\--material-variant=Red "one"
        \\--resolution=8x4
        \\--target=0,1.50,-2e3
        \\--output=a.png
        \\--
        \\-a.glb
        \\b.glb
        \\
    , "",
        \\{"input": ["-a.glb", "b.glb"], "samples": 16, "denoise": true,
        \\ "material_variant": "Red \"one\"", "resolution": [8, 4], "target": [0, 1.50, -2e3],
        \\ "output": "a.png", "id": 7, "name": "x", "help": null}
    );
    try expectArguments("--\n", "", "{\"denoise\": false, \"spp\": null}");
    try expectArguments("--spp=1\n--\n--spp=2\n--\n", "", "[{\"spp\": 1}, {\"spp\": \"2\"}]");
}

test "what is wrong with a scenario is named" {
    try expectError("line 2, column", "{\"a\":\n}");
    try expectError("not JSON", "");
    try expectError("twice", "{\"spp\": 1, \"spp\": 2}");
    try expectError("neither an object", "3");
    try expectError("no scenario", "[]");
    try expectError("scenario 1 is not an object", "[{}, 2]");
    try expectError("unknown key 'sp', did you mean 'spp'?", "{\"sp\": 1}");
    try expectError("'spp' needs a value", "{\"spp\": true}");
    try expectError("'denoise' is true or false", "{\"denoise\": 1}");
    try expectError("'spp' is neither", "{\"spp\": {}}");
    try expectError("'spp' is a list of other things", "{\"spp\": [[]]}");
    try expectError("'input' is not text", "{\"input\": 1}");
    try expectError("zero byte", "{\"output\": \"a\\u0000b\"}");
    try expectError("zero byte", "{\"input\": \"a\\u0000b\"}");
    try expectError("something else than a picture", "{\"help\": true}");
    try expectError("'id' is neither", "{\"id\": []}");
    try expectError("'scenario' is not an object", "{\"scenario\": \"a.json\"}");
    try expectError("'x' of 'target' is not a number", "{\"model\": \"a\", \"target\":{\"x\":{}}}");
    try expectError("no file name", "{\"model\": \"a\", \"name\": \"../a\"}");
    var diagnostic: Diagnostic = .{};
    const nothing = readOne(testing.failing_allocator, testing.io, flags_for_test, "", &diagnostic);
    try testing.expectError(error.UsageInvalid, nothing);
}

test "Khronos's scenarios, with what is left out of them" {
    try expectArguments(
        \\--resolution=768x570
        \\--fov=45
        \\--target=0,0.11,0
        \\--orbit=-70,90,0.47
        \\--background=env
        \\--exposure=0
        \\--output=goldens/a/raylane-golden.png
        \\--spp=2
        \\--spp=4
        \\--
        \\../a.glb
        \\
    , "",
        \\{"scenario": {"name": "a", "model": "../a.glb", "orbit": {"radius": 0.47, "theta": -70},
        \\ "dimensions": {"height": 570}, "target": {"y": 0.11}, "renderSkybox": true, "spp": 2,
        \\ "exclude": ["vray"], "pt": {"numSamples": 9}},
        \\ "outputFile": "goldens/a/raylane-golden.png", "spp": 4}
    );
    try expectArguments(
        \\--env=b.hdr
        \\--resolution=768x768
        \\--fov=30
        \\--eye=0.003,0.003,0.01
        \\--target=0.003,0.002999999999999939,-0.99
        \\--background=transparent
        \\--exposure=0
        \\--output=inside.png
        \\--
        \\builtin:cornell
        \\
    , "",
        \\{"renderers": [], "scenarios": [{"name": "not ours", "exclude": ["raylane"]},
        \\ {"name": "inside", "model": "builtin:cornell", "orbit": {"radius": 0},
        \\ "target": {"y": 0.003, "x": 0.003, "z": 0.01}, "lighting": "b.hdr", "verticalFoV": 30}]}
    );
}

test "files of Khronos's scenarios are where its engines find them" {
    var folder = testing.tmpDir(.{});
    defer folder.cleanup();
    try folder.dir.createDirPath(testing.io, "environments");
    for ([_][]const u8{ "a.glb", "environments/lightroom_14b.hdr" }) |name|
        try folder.dir.writeFile(testing.io, .{ .sub_path = name, .data = "" });
    var buffer: [1024]u8 = undefined;
    const tail = "--resolution=768x768\n--fov=45\n--target=0,0,0\n--orbit=0,90,1\n" ++
        "--background=transparent\n--exposure=0\n";
    const root = ".zig-cache/tmp/" ++ folder.sub_path;
    const by_config = try std.mem.print(&buffer, "--env={0s}/environments/lightroom_14b.hdr\n" ++
        "{1s}--output=a.png\n--\n{0s}/a.glb\n", .{ root, tail });
    const text =
        \\{"scenarios": [{"name": "a", "model": "../../../a.glb"}]}
    ;
    try expectArguments(by_config, root ++ "/test/config.json", text);
}
