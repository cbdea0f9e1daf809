//! What is fuzzed: a row for each reader of files, with what it begins with and what must hold.
//!
//! In: bytes, as a stranger would hand them in. Out: whether they were read or refused; an error
//! where the reader contradicts itself. That nothing crashes, hangs, leaks or takes more memory
//! than there may be, the campaign sees to.

const std = @import("std");
const raylane = @import("raylane");
const Allocator = std.mem.Allocator;
const Diagnostic = raylane.diagnostic.Diagnostic;
const Io = std.Io;
const Message = raylane.diagnostic.Message;
const Name = @import("names.zig").Name;
const Scene = raylane.scene.Scene;
const Structure = @import("mutate.zig").Structure;
const cli = raylane.cli;
const decode = raylane.decode;
const draco = decode.draco;
const meshopt = decode.meshopt;

/// Something that must never happen; standard error says what.
pub const Contradiction = error{Contradiction};

/// One execution's means.
pub const Run = struct {
    /// Over its limit, it is out of memory.
    gpa: Allocator,
    io: Io,
    /// Where files are that inputs may name.
    folder: Io.Dir,
    /// Whether scenes that can be read become pictures.
    draws: bool,
};

/// What became of an input.
pub const Outcome = enum { read, refused, out_of_memory };

pub const Target = struct {
    name: Name,
    structure: Structure,
    /// Files to begin with, besides the folder of the corpus that is named as the target: folders
    /// of the repository, and how names end there.
    seeds: []const [2][]const u8 = &.{},
    /// Longest input, in bytes.
    bytes_max: usize = 1 << 14,
    execute: *const fn (run: *const Run, input: []const u8) Contradiction!Outcome,
};

/// More would take time and reach nothing new.
const triangle_count_max = 1 << 13;
const draco_bytes_max = 8 << 20;

const images = "tests/images";
const meshes = "tests/meshes";

comptime {
    std.debug.assert(list.len + @intFromBool(!draco.is_held) == std.enums.values(Name).len);
}

/// All that this build has.
pub const list: []const Target = &(always ++ if (draco.is_held) optional else [_]Target{});

const always = [_]Target{
    .{
        .name = .gltf,
        .structure = .json,
        .seeds = &.{.{ meshes, "meshopt.gltf" }},
        .execute = sceneOf(.gltf, "a.gltf"),
    },
    .{
        .name = .glb,
        .structure = .glb,
        .execute = sceneOf(.glb, "a.glb"),
    },
    .{
        .name = .accessors,
        .structure = .glb_numbers,
        .seeds = &.{.{ "fuzz/corpus/glb", ".glb" }},
        .execute = sceneOf(.glb, "a.glb"),
    },
    imageTarget(.png, .png, ".png"),
    imageTarget(.jpeg, .jpeg, ".jpg"),
    imageTarget(.webp, .riff, ".webp"),
    imageTarget(.hdr, .mixed, ".hdr"),
    imageTarget(.exr, .exr, ".exr"),
    imageTarget(.ktx2, .bytes, ".ktx2"),
    .{
        .name = .meshopt,
        .structure = .bytes,
        .execute = meshoptStream,
    },
    .{
        .name = .pbrt,
        .structure = .text,
        .seeds = &.{.{ "tests/pictures", ".pbrt" }},
        .execute = sceneOf(.pbrt, "a.pbrt"),
    },
    .{
        .name = .ply,
        .structure = .mixed,
        .seeds = &.{.{ "tests/pictures", ".ply" }},
        .execute = sceneOf(.ply, "a.ply"),
    },
    .{
        .name = .obj,
        .structure = .text,
        .execute = sceneOf(.obj, "a.obj"),
    },
    .{
        .name = .mtl,
        .structure = .text,
        .execute = materialLibrary,
    },
    .{
        .name = .stl,
        .structure = .mixed,
        .execute = sceneOf(.stl, "a.stl"),
    },
    .{
        .name = .gzip,
        .structure = .bytes,
        .execute = sceneOf(null, "a.ply.gz"),
    },
    .{
        .name = .any,
        .structure = .mixed,
        .seeds = &.{ .{ "fuzz/corpus/ply", "" }, .{ "fuzz/corpus/glb", "" }, .{ images, ".png" } },
        .execute = sceneOf(null, "a"),
    },
    .{
        .name = .cli,
        .structure = .text,
        .execute = commandLine,
    },
    .{
        .name = .scenario,
        .structure = .json,
        .execute = scenarios,
    },
};

const optional = [_]Target{.{
    .name = .draco,
    .structure = .bytes,
    .seeds = &.{.{ meshes, ".drc" }},
    .bytes_max = 1 << 12,
    .execute = dracoMesh,
}};

/// The one of a name; null: this build does not hold what it is of.
pub fn named(name: Name) ?*const Target {
    for (list) |*target| if (target.name == name) return target;
    return null;
}

fn imageTarget(name: Name, structure: Structure, comptime extension: []const u8) Target {
    return .{
        .name = name,
        .structure = structure,
        .seeds = &.{.{ images, extension }},
        .execute = image,
    };
}

fn contradiction(comptime format: []const u8, arguments: anytype) Contradiction {
    std.debug.print("fuzz: " ++ format ++ "\n", arguments);
    return error.Contradiction;
}

/// A refusal says why, in one line.
fn refused(message: *const Message) Contradiction!Outcome {
    const line = message.text();
    if (line.len == 0) return contradiction("refused without a word", .{});
    for (line) |byte| if (byte < ' ' or byte == 0x7f)
        return contradiction("a message with control characters", .{});
    return .refused;
}

fn sceneOf(
    comptime format: ?raylane.settings.SceneFormat,
    comptime name: []const u8,
) *const fn (run: *const Run, input: []const u8) Contradiction!Outcome {
    return struct {
        fn execute(run: *const Run, input: []const u8) Contradiction!Outcome {
            return readScene(run, format, name, input);
        }
    }.execute;
}

fn readScene(
    run: *const Run,
    format: ?raylane.settings.SceneFormat,
    name: []const u8,
    input: []const u8,
) Contradiction!Outcome {
    var said: Diagnostic = .{};
    const settings: raylane.settings.Load = .{
        .format = format,
        .tessellation = 4,
        .triangle_count_max = triangle_count_max,
    };
    const parseNamed = raylane.parse.parseNamed;
    var scene = parseNamed(run.gpa, run.io, name, input, run.folder, settings, &said) catch |err|
        return switch (err) {
            error.OutOfMemory => .out_of_memory,
            error.InvalidInput, error.InputOutput => refused(&said.message),
            error.SceneUnknown, error.MaterialVariantUnknown => contradiction("{t}", .{err}),
        };
    scene.check();
    if (run.draws) return draw(run, scene, &said);
    scene.deinit();
    return .read;
}

/// A picture of 8 by 8 pixels, all of which must be finite.
fn draw(run: *const Run, scene: Scene, said: *Diagnostic) Contradiction!Outcome {
    const mode = raylane.simd.setFlushToZero();
    defer raylane.simd.setFloatControl(mode);
    var session: raylane.session.Session = .init(run.gpa, run.io, 1, said);
    defer session.deinit();
    session.adopt(scene, .owned);
    drawIn(&session) catch |err| return switch (err) {
        error.OutOfMemory => .out_of_memory,
        error.InvalidInput, error.InputOutput => refused(&said.message),
        else => contradiction("{t} from a picture", .{err}),
    };
    for (session.film.?.image.pixels) |pixel| for (pixel) |value| {
        if (!std.math.isFinite(value)) return contradiction("a pixel is {d}", .{value});
    };
    return .read;
}

fn drawIn(session: *raylane.session.Session) raylane.session.Session.Error!void {
    // To make the studio takes longer than the picture.
    const has_environment = session.scene.?.environment != null;
    const seen: raylane.settings.View = .{
        .resolution = .{ 8, 8 },
        .environment = .{ .source = if (has_environment) .default else .none },
    };
    const lanes = raylane.variant.compiled[0].lanes;
    try session.pose(.{ .lanes = lanes, .view = seen });
    try session.view(seen);
    try session.render(.{ .sample_count = 1, .depth = 2 });
}

/// A file that can be decoded has the size that its header says.
fn image(run: *const Run, input: []const u8) Contradiction!Outcome {
    var reason: decode.Reason = .{};
    const info = decode.info(input, &reason) catch return refused(&reason);
    if (info.width == 0 or info.height == 0) return contradiction("no pixels", .{});
    var texels = decode.decode(run.gpa, input, &reason) catch |err| return switch (err) {
        error.OutOfMemory => .out_of_memory,
        error.InvalidImage => refused(&reason),
    };
    defer texels.deinit(run.gpa);
    const said = [_]u32{ info.width, info.height, info.channel_count };
    const made = [_]u32{ texels.width, texels.height, texels.channel_count };
    if (!std.mem.eql(u32, &said, &made))
        return contradiction("the header says {any}, the texels {any}", .{ said, made });
    const count = @as(usize, made[0]) * made[1] * made[2];
    switch (texels.data) {
        .bytes => |bytes| if (info.is_float or bytes.len != count)
            return contradiction("{d} bytes", .{bytes.len}),
        .floats => |floats| {
            if (!info.is_float or floats.len != count)
                return contradiction("{d} floats", .{floats.len});
            for (floats) |value| if (!(value >= 0 and value < std.math.inf(f32)))
                return contradiction("a texel is {d}", .{value});
        },
    }
    return .read;
}

/// Of what begins with mode, filter, stride and the low and high byte of the count.
fn meshoptStream(run: *const Run, input: []const u8) Contradiction!Outcome {
    const head_bytes = 5;
    if (input.len < head_bytes) return .refused;
    const modes = std.enums.values(meshopt.Mode);
    const filters = std.enums.values(meshopt.Filter);
    const layout: meshopt.Layout = .{
        .mode = modes[input[0] % modes.len],
        .filter = filters[input[1] % filters.len],
        .stride = input[2],
        .count = std.mem.readInt(u16, input[3..5], .little),
    };
    const stream = input[head_bytes..];
    var reason: Message = .{};
    meshopt.check(layout, stream, &reason) catch return refused(&reason);
    const bytes: usize = @intCast(layout.bytes());
    const out = run.gpa.alignedAlloc(u8, meshopt.alignment, bytes) catch return .out_of_memory;
    defer run.gpa.free(out);
    meshopt.decode(layout, stream, out, &reason) catch return refused(&reason);
    return .read;
}

/// Every attribute of it as bytes and as floats.
fn dracoMesh(run: *const Run, input: []const u8) Contradiction!Outcome {
    var mesh: draco.Mesh = undefined;
    var reason: Message = .{};
    mesh.init(run.gpa, input, draco_bytes_max, &reason) catch |err| return switch (err) {
        error.OutOfMemory => .out_of_memory,
        error.InvalidStream => refused(&reason),
    };
    defer mesh.deinit();
    const triangles = run.gpa.alloc([3]u32, mesh.triangleCount()) catch return .out_of_memory;
    defer run.gpa.free(triangles);
    mesh.triangles(triangles);
    for ([_]u8{ 1, 2, 3, 4 }, 0..) |width, id| {
        for ([_]draco.Component{ .u8, .i16, .f32 }) |component| {
            const component_bytes: usize = switch (component) {
                .u8 => 1,
                .i16 => 2,
                else => 4,
            };
            const bytes = @as(usize, mesh.vertexCount()) * width * component_bytes;
            const out = run.gpa.alignedAlloc(u8, .@"4", bytes) catch return .out_of_memory;
            defer run.gpa.free(out);
            _ = mesh.attribute(@intCast(id), component, width, out);
        }
    }
    return .read;
}

/// The materials of a scene whose library is the input, in a folder that has nothing else.
fn materialLibrary(run: *const Run, input: []const u8) Contradiction!Outcome {
    const name = "input.mtl";
    run.folder.writeFile(run.io, .{ .sub_path = name, .data = input }) catch |err|
        return contradiction("{s} cannot be written: {t}", .{ name, err });
    return readScene(run, .obj, "a.obj", "mtllib " ++ name ++
        "\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nusemtl a\nf 1/1 2/2 3/1\n" ++
        "usemtl b\nf 1/1 2/2 3/1\nusemtl\nf 3 2 1\n");
}

fn commandLine(run: *const Run, input: []const u8) Contradiction!Outcome {
    var arena: std.heap.ArenaAllocator = .init(run.gpa);
    defer arena.deinit();
    const arguments = argumentsOf(arena.allocator(), input) catch return .out_of_memory;
    var said: Diagnostic = .{};
    _ = cli.wantsJson(arguments);
    const command = cli.parse(arguments, raylane.variant.names, &said) catch |err| switch (err) {
        error.UsageInvalid => return refused(&said.message),
    };
    switch (command) {
        .render => |*options| return checkOptions(run.gpa, options),
        else => return .read,
    }
}

/// One for each line; none has a zero byte.
fn argumentsOf(arena: Allocator, input: []const u8) Allocator.Error![]const [:0]const u8 {
    var arguments: std.ArrayList([:0]const u8) = .empty;
    var lines = std.mem.splitScalar(u8, input, '\n');
    while (lines.next()) |line| {
        const end = std.mem.findScalar(u8, line, 0) orelse line.len;
        try arguments.append(arena, try arena.dupeSentinel(u8, line[0..end], 0));
    }
    return arguments.items;
}

/// What is asked of options that are read.
fn checkOptions(gpa: Allocator, options: *const cli.Options) Contradiction!Outcome {
    var said: Diagnostic = .{};
    const name = cli.outputName(gpa, options) catch return .out_of_memory;
    defer gpa.free(name);
    var count: usize = 0;
    var inputs = options.inputs(&said);
    while (inputs.next()) |_| count += 1;
    if (count != options.batch.input_count) return contradiction(
        "{d} inputs, {d} of them named",
        .{ options.batch.input_count, count },
    );
    _ = options.isBatch();
    return .read;
}

fn scenarios(run: *const Run, input: []const u8) Contradiction!Outcome {
    var arena_state: std.heap.ArenaAllocator = .init(run.gpa);
    defer arena_state.deinit();
    const arena = arena_state.allocator();
    _ = cli.idOf(arena, input);
    var of_job: Diagnostic = .{};
    if (cli.readJob(arena, run.io, input, &of_job)) |job| {
        _ = try optionsOf(run, &job);
    } else |err| switch (err) {
        error.OutOfMemory => return .out_of_memory,
        error.UsageInvalid => _ = try refused(&of_job.message),
    }
    var said: Diagnostic = .{};
    const found = cli.readScenarios(arena, run.io, .{ .text = input }, &said) catch |err|
        return switch (err) {
            error.OutOfMemory => .out_of_memory,
            error.UsageInvalid => refused(&said.message),
        };
    for (found) |*scenario| _ = try optionsOf(run, scenario);
    return .read;
}

fn optionsOf(run: *const Run, scenario: *const cli.Scenario) Contradiction!Outcome {
    var said: Diagnostic = .{};
    const parts = .{ scenario.arguments, &.{} };
    const options = cli.parseParts(parts, raylane.variant.names, &said) catch |err| switch (err) {
        error.UsageInvalid => return refused(&said.message),
    };
    return checkOptions(run.gpa, &options);
}
