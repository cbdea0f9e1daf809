//! The directives of a PBRT text, one after the other, and the state that they change.
//!
//! In: texts. Out: an `SceneBuilder` of everything they show, and what they ask of the picture.
//! Nothing recurses: attributes, objects and included files lie on stacks with limits.

const std = @import("std");
const diagnostic_file = @import("../../diagnostic.zig");
const lights = @import("lights.zig");
const choices = @import("../../settings.zig");
const limits = @import("limits.zig");
const materials = @import("materials.zig");
const number = @import("../number.zig");
const scene_data = @import("../../scene.zig");
const shapes = @import("shapes.zig");
const spectra = @import("spectra.zig");
const SceneBuilder = @import("scene_builder.zig");
const Colors = @import("colors.zig");
const Defaults = @import("defaults.zig");
const Input = @import("input.zig");
const Tessellator = @import("shapes/tessellator.zig");
const Textures = @import("textures.zig");
const Parameters = @import("parameters.zig");
const math = @import("../../math.zig");
const transforms = @import("transform.zig");
const Transform = math.AffineD;
const View = @import("view.zig");
const Allocator = std.mem.Allocator;
const Error = Input.Error;
const Vec3 = math.Vec3;
const assert = std.debug.assert;
const quote = diagnostic_file.quote;

const Reader = @This();

/// Everything that AttributeBegin keeps and AttributeEnd brings back.
const Graphics = struct {
    transform: Transform = .identity,
    /// Null: the default one.
    material: ?Material = null,
    area_light: ?AreaLight = null,
    reverse: bool = false,
    /// Whether transformations are those of the time when the shutter opens.
    at_start: bool = true,
    space: spectra.Space = .srgb,
    defaults: Defaults = .{},
};

/// What AreaLightSource says of the shapes after it.
const AreaLight = struct {
    emission: lights.Emission,
    two_sided: bool,
    /// What each shape emits in all; 0: as its emission says.
    power: f32 = 0,
    /// Mean luminance of the picture.
    luminance: f64 = 1,
    picture: ?scene_data.TextureView = null,
};

/// Transformations that a block has begun with.
const Kept = struct {
    const Kind = enum { Attribute, Transform, Object };

    kind: Kind,
    transform: Transform,
    at_start: bool,
};

/// What an imported text leaves as it was.
const Outside = struct { graphics: Graphics, kept_count: usize, stack_count: usize };

const Material = struct {
    /// In the scene.
    index: u32,
    /// Surfaces only bound a medium and are not shown.
    is_boundary: bool,
};

const Undefined = struct { index: u32, place: []const u8 };

const Awaited = struct { name: []const u8, place: Transform };

const Phase = enum { options, world, done };

input: *Input,
/// Lives as long as the scene is read.
arena: Allocator,
builder: *SceneBuilder,
colors: Colors,
tessellator: Tessellator,
parameters: Parameters = .{},
graphics: Graphics = .{},
/// Of blocks that are begun and not ended, but for those of transformations.
stack: std.ArrayList(Graphics) = .empty,
/// Of all of them.
kept: std.ArrayList(Kept) = .empty,
imports: std.ArrayList(Outside) = .empty,
phase: Phase = .options,
/// A world has ended that is kept only if no other follows: its renderer makes no picture.
is_preparation: bool = false,
view: View = .{},
sample_count: ?u32 = null,
depth: ?u32 = null,
/// The object that is being defined.
object: ?struct { name: []const u8, first: usize } = null,
objects: std.StringHashMapUnmanaged(SceneBuilder.Object) = .empty,
/// Instances of objects that are not yet defined.
awaited: std.ArrayList(Awaited) = .empty,
/// Where their names stand first.
undefined_objects: std.StringHashMapUnmanaged([]const u8) = .empty,
spaces: std.StringHashMapUnmanaged(Transform) = .empty,
named: std.StringHashMapUnmanaged(Material) = .empty,
/// Materials that are named and not yet defined, and where that was.
undefined_materials: std.StringHashMapUnmanaged(Undefined) = .empty,
/// Meshes of curved shapes by all that they depend on.
known_meshes: std.AutoHashMapUnmanaged(u64, u32) = .empty,
default_material: u32 = scene_data.none,
/// Materials of shapes with an alpha of their own.
with_holes: std.AutoHashMapUnmanaged(Holes, u32) = .empty,

/// Frees what is not the arena's.
pub fn deinit(reader: *Reader) void {
    const gpa = reader.input.gpa;
    reader.parameters.deinit(gpa);
    reader.colors.textures.deinit();
    reader.stack.deinit(gpa);
    reader.kept.deinit(gpa);
    reader.imports.deinit(gpa);
    reader.* = undefined;
}

const Directive = enum {
    // Before the world.
    Accelerator,
    Camera,
    Film,
    Integrator,
    PixelFilter,
    Renderer,
    Sampler,
    SurfaceIntegrator,
    TransformTimes,
    VolumeIntegrator,
    WorldBegin,
    // In it.
    AreaLightSource,
    LightSource,
    Material,
    NamedMaterial,
    ObjectBegin,
    ObjectEnd,
    ObjectInstance,
    Shape,
    Volume,
    WorldEnd,
    // Everywhere.
    ActiveTransform,
    Attribute,
    AttributeBegin,
    AttributeEnd,
    ColorSpace,
    ConcatTransform,
    CoordSysTransform,
    CoordinateSystem,
    Identity,
    Import,
    Include,
    LookAt,
    MakeNamedMaterial,
    MakeNamedMedium,
    MediumInterface,
    Option,
    ReverseOrientation,
    Rotate,
    Scale,
    Texture,
    Transform,
    TransformBegin,
    TransformEnd,
    Translate,

    /// Whether its parameters have to do with what is seen, beside how.
    fn isSeen(directive: Directive) bool {
        return switch (directive) {
            .Camera, .Film, .Shape => true,
            .AreaLightSource, .LightSource, .MakeNamedMaterial, .Material => true,
            else => false,
        };
    }

    /// Whose defaults its parameters have.
    fn target(directive: Directive) ?Defaults.Target {
        return switch (directive) {
            .Shape => .shape,
            .LightSource, .AreaLightSource => .light,
            .Material, .MakeNamedMaterial => .material,
            .MakeNamedMedium => .medium,
            .Texture => .texture,
            else => null,
        };
    }

    fn allowedIn(directive: Directive, phase: Phase) bool {
        const place = @backingInt(directive);
        if (place <= @backingInt(Directive.WorldBegin)) return phase == .options;
        return place > @backingInt(Directive.WorldEnd) or phase == .world;
    }
};

/// Reads the text on top of the input, and all that it includes.
pub fn run(reader: *Reader) Error!void {
    const input = reader.input;
    while (true) {
        const is_end = input.atEnd();
        input.beginDirective();
        if (is_end) {
            if (input.texts.items.len == 1) break;
            try reader.endImport();
            continue;
        }
        const word = input.word();
        if (word.len == 0) return input.failHere("a directive is expected", .{});
        const directive = std.meta.stringToEnum(Directive, word) orelse
            return input.failHere("{f} is no directive", .{quote(word)});
        if (reader.phase == .done) {
            if (!reader.is_preparation) {
                try input.warnHere("more", "only the first picture is made", .{});
                break;
            }
            reader.startAgain();
        }
        if (!directive.allowedIn(reader.phase)) return input.failHere(
            "{t} may not stand {s} WorldBegin",
            .{ directive, if (reader.phase == .options) "before" else "after" },
        );
        try reader.perform(directive);
    }
    if (reader.phase == .options)
        return input.fail(input.offset(), "there is no WorldBegin", .{});
    try reader.endBlocks(0, 0);
}

/// Ends all blocks but so many, which a text should have done.
fn endBlocks(reader: *Reader, kept_count: usize, stack_count: usize) Error!void {
    const count = reader.kept.items.len -| kept_count;
    if (count > 0) try reader.input.forgive(
        reader.input.offset(),
        "end",
        "{d} blocks are begun and not ended",
        .{count},
    );
    reader.kept.shrinkRetainingCapacity(@min(kept_count, reader.kept.items.len));
    reader.stack.shrinkRetainingCapacity(@min(stack_count, reader.stack.items.len));
}

/// Reads a text that changes nothing of what it stands in but the world and what has names.
fn beginImport(reader: *Reader) Error!void {
    try reader.imports.append(reader.input.gpa, .{
        .graphics = reader.graphics,
        .kept_count = reader.kept.items.len,
        .stack_count = reader.stack.items.len,
    });
    try reader.input.includeNext(true);
}

fn endImport(reader: *Reader) Error!void {
    const outside = reader.imports.pop().?;
    try reader.endBlocks(outside.kept_count, outside.stack_count);
    reader.graphics = outside.graphics;
    reader.input.pop();
}

fn perform(reader: *Reader, directive: Directive) Error!void {
    const graphics = &reader.graphics;
    switch (directive) {
        .Identity => try reader.setTransform(.identity),
        .Translate => try reader.transform(.translate(try reader.numbers(3))),
        .Scale => try reader.transform(.scale(try reader.numbers(3))),
        .Rotate => {
            const n = try reader.numbers(4);
            try reader.transform(transforms.rotation(n[0], n[1..4].*) orelse
                return reader.input.failHere("the axis has no direction", .{}));
        },
        .LookAt => {
            const n = try reader.numbers(9);
            try reader.transform(transforms.lookAt(n[0..3].*, n[3..6].*, n[6..9].*) orelse
                return reader.input.failHere("the three points leave no direction", .{}));
        },
        .Transform => try reader.setTransform(try reader.matrix()),
        .ConcatTransform => try reader.transform(try reader.matrix()),
        .CoordinateSystem => {
            const name = try reader.text();
            try reader.keep(Transform, &reader.spaces, name, graphics.transform);
        },
        .CoordSysTransform => {
            const name = try reader.text();
            if (reader.spaces.get(name)) |space| try reader.setTransform(space) else try reader
                .forgive("space", "no coordinate system {f}: nothing changes", .{quote(name)});
        },
        .ActiveTransform => try reader.activeTransform(),
        .TransformTimes => _ = try reader.numbers(2),
        .ReverseOrientation => graphics.reverse = !graphics.reverse,
        .AttributeBegin => try reader.begin(.Attribute),
        .TransformBegin => try reader.begin(.Transform),
        .AttributeEnd => try reader.end(.Attribute),
        .TransformEnd => try reader.end(.Transform),
        .ObjectBegin => try reader.objectBegin(),
        .ObjectEnd => try reader.objectEnd(),
        .ObjectInstance => try reader.objectInstance(),
        .WorldBegin => try reader.worldBegin(),
        .WorldEnd => try reader.worldEnd(),
        .Include => try reader.input.includeNext(false),
        .Import => try reader.beginImport(),
        .ColorSpace => {
            const name = try reader.text();
            if (spectra.Space.named(name)) |space| graphics.space = space else try reader
                .forgive("color space", "no color space {f}: nothing changes", .{quote(name)});
        },
        .MediumInterface => {
            _ = try reader.text();
            if (reader.input.peek() == '"') _ = try reader.input.string();
            try reader.note(directive, "participating media are not supported");
        },
        .NamedMaterial => try reader.namedMaterial(),
        .Option => try reader.option(),
        .Texture => try reader.texture(),
        else => {
            const name = try reader.text();
            try reader.readParameters(directive);
            try reader.performNamed(directive, name);
            if (directive.isSeen())
                try reader.parameters.warnOfUnread(reader.input, @tagName(directive));
        },
    }
}

fn readParameters(reader: *Reader, directive: Directive) Error!void {
    const input = reader.input;
    try reader.parameters.read(input);
    reader.colors.space = reader.graphics.space;
    const target = directive.target() orelse return;
    try reader.graphics.defaults.complete(input.gpa, target, &reader.parameters, input.directive);
}

/// Forgives what is wrong with the directive.
fn forgive(
    reader: *Reader,
    kind: []const u8,
    comptime format: []const u8,
    arguments: anytype,
) Error!void {
    return reader.input.forgive(reader.input.directive, kind, format, arguments);
}

/// `Texture "name" "type" "class" parameters`.
fn texture(reader: *Reader) Error!void {
    const name = try reader.text();
    // All of them are colours here.
    const is_color = !std.mem.eql(u8, try reader.text(), "float");
    const class = try reader.text();
    const parameters = &reader.parameters;
    try reader.readParameters(.Texture);
    const textures = &reader.colors.textures;
    const made = try textures.make(&reader.colors, class, is_color, parameters);
    try parameters.warnOfUnread(reader.input, "Texture");
    try reader.keep(Textures.Texture, &textures.named, name, made);
}

/// Directives of the form `Directive "name" parameters`.
fn performNamed(reader: *Reader, directive: Directive, name: []const u8) Error!void {
    const parameters = &reader.parameters;
    switch (directive) {
        .Camera => {
            const to_camera = &reader.graphics.transform;
            try reader.view.setCamera(reader.input, name, parameters, to_camera);
            try reader.keep(Transform, &reader.spaces, "camera", reader.view.place.?);
        },
        .Film => {
            try reader.view.setFilm(reader.input, parameters, name);
            reader.colors.is_version_4 = reader.view.is_version_4;
        },
        .Sampler => try reader.sampler(),
        .Integrator, .SurfaceIntegrator => try reader.integrator(name),
        .Renderer => {
            // These prepare what another rendering uses.
            reader.is_preparation = std.mem.eql(u8, name, "surfacepoints") or
                std.mem.eql(u8, name, "createprobes");
        },
        .Material => reader.graphics.material = try reader.makeMaterial(name),
        .MakeNamedMaterial => try reader.makeNamedMaterial(name),
        .LightSource => try lights.add(&.{
            .colors = &reader.colors,
            .builder = reader.builder,
            .parameters = parameters,
            .place = &reader.graphics.transform,
        }, name),
        .AreaLightSource => try reader.areaLightSource(),
        .Shape => try reader.shape(name),
        .Volume, .MakeNamedMedium => {
            try reader.note(directive, "participating media are not supported");
        },
        .Attribute => if (std.meta.stringToEnum(Defaults.Target, name)) |target|
            try reader.graphics.defaults.add(reader.arena, target, parameters)
        else
            try reader.forgive("attribute", "Attribute of {f}, which is nothing", .{quote(name)}),
        else => {}, // What remains changes how PBRT computes the picture.
    }
}

/// A warning about a directive, once.
fn note(reader: *Reader, directive: Directive, comptime rest: []const u8) Error!void {
    try reader.input.warnHere(@tagName(directive), "{t}: " ++ rest, .{directive});
}

/// Numbers, in brackets or not.
fn numbers(reader: *Reader, comptime count: usize) Error![count]f64 {
    const input = reader.input;
    const bracketed = input.peek() == '[';
    if (bracketed) input.top().cursor += 1;
    var result: [count]f64 = undefined;
    for (&result) |*to| {
        _ = try input.peekInList();
        const top = input.top();
        to.* = number.float(top.bytes, &top.cursor) catch |err|
            return Parameters.failNumber(input, err, "number");
    }
    if (!bracketed) return result;
    if (input.peek() != ']') return input.fail(input.offset(), "']' is expected", .{});
    input.top().cursor += 1;
    return result;
}

fn matrix(reader: *Reader) Error!Transform {
    const sixteen = try reader.numbers(16);
    return transforms.fromMatrix(&sixteen) orelse
        reader.input.failHere("the matrix is not affine", .{});
}

/// A string.
fn text(reader: *Reader) Error![]const u8 {
    _, const string = try reader.input.expectString();
    return string;
}

/// Puts a value under a name that the text gives, which is copied.
fn keep(
    reader: *Reader,
    comptime Value: type,
    map: *std.StringHashMapUnmanaged(Value),
    name: []const u8,
    value: Value,
) Allocator.Error!void {
    const entry = try map.getOrPut(reader.arena, name);
    if (!entry.found_existing) entry.key_ptr.* = try reader.arena.dupe(u8, name);
    entry.value_ptr.* = value;
}

fn transform(reader: *Reader, inner: Transform) Error!void {
    try reader.setTransform(reader.graphics.transform.compose(inner));
}

fn setTransform(reader: *Reader, to: Transform) Error!void {
    if (!reader.graphics.at_start) return;
    if (!transforms.fitsSingle(&to))
        return reader.input.failHere("the transformation is out of range", .{});
    reader.graphics.transform = to;
}

/// Things that move are shown as they are when the shutter opens.
fn activeTransform(reader: *Reader) Error!void {
    const at = reader.input.offset();
    const word = if (reader.input.peek() == '"') try reader.input.string() else reader.input.word();
    const Which = enum { StartTime, EndTime, All };
    const which = std.meta.stringToEnum(Which, word) orelse
        return reader.input.fail(at, "{f} is no time of transformations", .{quote(word)});
    reader.graphics.at_start = which != .EndTime;
    if (which != .All)
        try reader.note(.ActiveTransform, "what moves is shown at the start");
}

fn begin(reader: *Reader, kind: Kept.Kind) Error!void {
    if (reader.kept.items.len == limits.attribute_depth_max) return reader.input.failHere(
        "over {d} blocks within each other",
        .{limits.attribute_depth_max},
    );
    const gpa = reader.input.gpa;
    const graphics = &reader.graphics;
    try reader.kept.append(gpa, .{
        .kind = kind,
        .transform = graphics.transform,
        .at_start = graphics.at_start,
    });
    if (kind != .Transform) try reader.stack.append(gpa, graphics.*);
}

/// Ends the block that was begun last. Of what kind it is does not matter but to PBRT's version 4:
/// version 3 has one stack of transformations, one of all else, and looks at neither's kind.
fn end(reader: *Reader, kind: Kept.Kind) Error!void {
    const outside: Outside = reader.imports.getLastOrNull() orelse
        .{ .graphics = undefined, .kept_count = 0, .stack_count = 0 };
    const stack = &reader.stack;
    if (reader.kept.items.len <= outside.kept_count or
        (kind != .Transform and stack.items.len <= outside.stack_count))
        return reader.input.failHere("{t}End without {0t}Begin", .{kind});
    const kept = reader.kept.pop().?;
    if (kept.kind != kind) try reader.input.forgive(
        reader.input.directive,
        "misnested",
        "{t}End, but {t}Begin came last: the order does not count",
        .{ kind, kept.kind },
    );
    if (kind != .Transform) reader.graphics = stack.pop().?;
    reader.graphics.transform = kept.transform;
    reader.graphics.at_start = kept.at_start;
}

fn objectBegin(reader: *Reader) Error!void {
    const name = try reader.text();
    if (reader.object != null)
        return reader.input.failHere("an object within an object", .{});
    try reader.begin(.Object);
    reader.object = .{
        .name = try reader.arena.dupe(u8, name),
        .first = reader.builder.parts.items.len,
    };
}

fn objectEnd(reader: *Reader) Error!void {
    const object = reader.object orelse
        return reader.input.failHere("no object has begun", .{});
    try reader.end(.Object);
    reader.object = null;
    try reader.keep(SceneBuilder.Object, &reader.objects, object.name, .{
        .first = object.first,
        .count = reader.builder.parts.items.len - object.first,
    });
}

fn objectInstance(reader: *Reader) Error!void {
    const name = try reader.text();
    if (reader.object != null)
        return reader.input.failHere("an instance within an object", .{});
    const place = &reader.graphics.transform;
    if (reader.objects.get(name)) |object|
        return reader.builder.instantiateObject(object, place);
    const entry = try reader.undefined_objects.getOrPut(reader.arena, name);
    if (!entry.found_existing) {
        entry.key_ptr.* = try reader.arena.dupe(u8, name);
        entry.value_ptr.* = try reader.input.nameOf(reader.arena, reader.input.directive);
    }
    try reader.awaited.append(reader.arena, .{ .name = entry.key_ptr.*, .place = place.* });
}

/// Version 4 allows that an object is instanced before it is defined; version 3 leaves out what
/// never is.
fn placeAwaited(reader: *Reader) Error!void {
    var is_said = false;
    for (reader.awaited.items) |*one| {
        if (reader.objects.get(one.name)) |object| {
            try reader.builder.instantiateObject(object, &one.place);
        } else if (!is_said) {
            is_said = true;
            try reader.input.forgiveFile("{s}: no object {f}: it is left out", .{
                reader.undefined_objects.get(one.name).?, quote(one.name),
            });
        }
    }
}

/// Forgets a world that has only prepared the one that follows.
fn startAgain(reader: *Reader) void {
    reader.builder.clear();
    reader.objects.clearRetainingCapacity();
    reader.awaited.clearRetainingCapacity();
    reader.known_meshes.clearRetainingCapacity();
    reader.is_preparation = false;
    reader.phase = .options;
}

fn worldBegin(reader: *Reader) Error!void {
    reader.phase = .world;
    reader.graphics.transform = .identity;
    reader.graphics.at_start = true;
    try reader.keep(Transform, &reader.spaces, "world", .identity);
}

/// The state is that of a new text; the view stays, for it is this world's.
fn worldEnd(reader: *Reader) Error!void {
    try reader.endBlocks(0, 0);
    reader.object = null;
    reader.phase = .done;
    reader.graphics = .{};
}

fn sampler(reader: *Reader) Error!void {
    const parameters = &reader.parameters;
    const across = parameters.integer("xsamples");
    const down = parameters.integer("ysamples");
    const asked: i64 = if (across != null and down != null)
        @as(i64, across.?) * down.?
    else
        parameters.integer("pixelsamples") orelse return;
    const range = choices.sample_count;
    const count = std.math.clamp(asked, range.min, range.max);
    if (count != asked) try reader.input.warnHere(
        "samples",
        "Sampler: {d} samples a pixel are taken as {d}",
        .{ asked, count },
    );
    reader.sample_count = @intCast(count);
}

/// `Option "name" value`, the name with a type before it or without: none of them has to do with
/// what is seen, but for one.
fn option(reader: *Reader) Error!void {
    const input = reader.input;
    const declaration = try reader.text();
    const bracketed = input.peek() == '[';
    if (bracketed) input.top().cursor += 1;
    const value = if (input.peek() == '"') try input.string() else input.word();
    if (value.len == 0) return input.fail(input.offset(), "a value is expected", .{});
    if (bracketed) {
        if (input.peek() != ']') return input.fail(input.offset(), "']' is expected", .{});
        input.top().cursor += 1;
    }
    const start = if (std.mem.findScalarLast(u8, declaration, ' ')) |space| space + 1 else 0;
    const name = declaration[start..];
    const known = [_][]const u8{
        "disablepixeljitter",    "disabletexturefiltering", "disablewavelengthjitter",
        "displacementedgescale", "msereferenceimage",       "msereferenceout",
        "rendercoordsys",        "seed",                    "pixelstats",
        "wavefront",
    };
    for (known) |other| if (std.ascii.eqlIgnoreCase(name, other)) return;
    try input.warnHere(name, "Option {f} is not read", .{quote(name)});
}

/// All integrators are Whitted's here; "maxdepth" counts rays in his and in direct lighting,
/// bounces in the others.
fn integrator(reader: *Reader, name: []const u8) Error!void {
    if (std.mem.eql(u8, name, "ambientocclusion") or std.mem.eql(u8, name, "ao")) {
        try reader.input.warnHere(
            name,
            "integrator {f} is not supported: the picture shows lights and materials",
            .{quote(name)},
        );
    }
    const asked = reader.parameters.integer("maxdepth") orelse return;
    const counts_rays = std.mem.eql(u8, name, "whitted") or std.mem.eql(u8, name, "directlighting");
    const bounces = @as(i64, asked) - @intFromBool(counts_rays);
    const depth = std.math.clamp(bounces, choices.depth.min, choices.depth.max);
    if (depth != bounces) try reader.input.warnHere(
        "depth",
        "{f}: maxdepth {d} is taken as {d}",
        .{ quote(name), asked, depth + @intFromBool(counts_rays) },
    );
    reader.depth = @intCast(depth);
}

/// A material that has been named before becomes what is defined now.
fn makeNamedMaterial(reader: *Reader, name: []const u8) Error!void {
    const type_name = reader.parameters.string("type") orelse missing: {
        try reader.forgive("material type", "the material has no type: it is matte", .{});
        break :missing "matte";
    };
    var made = try reader.makeMaterial(type_name);
    if (reader.undefined_materials.fetchRemove(name)) |used| {
        const all = reader.builder.scene.materials.items;
        all[used.value.index] = all[made.index];
        if (made.is_boundary) {
            all[used.value.index].alpha_mode = .mask;
            all[used.value.index].base_color[3] = 0;
        }
        made.index = used.value.index;
    }
    try reader.keep(Material, &reader.named, name, made);
}

fn makeMaterial(reader: *Reader, name: []const u8) Error!Material {
    const made: materials.Material = if (std.mem.eql(u8, name, "mix"))
        try reader.mixture()
    else
        try materials.convert(&reader.colors, name, &reader.parameters);
    return .{
        .index = try reader.builder.scene.addMaterial(made.surface),
        .is_boundary = made.is_boundary,
    };
}

fn mixture(reader: *Reader) Error!materials.Material {
    const parameters = &reader.parameters;
    var names = [_][]const u8{
        parameters.string("namedmaterial1") orelse "",
        parameters.string("namedmaterial2") orelse "",
    };
    var second_share = try reader.colors.float(parameters, "amount", 0.5);
    if (parameters.find("materials")) |parameter| {
        const list = parameters.stringsOf(parameter);
        if (list.len != 2) return reader.input.failHere("two materials are mixed", .{});
        names = list[0..2].*;
    } else second_share = 1 - second_share; // The older dialects tell the first one's share.
    var parts: [2]scene_data.Material = undefined;
    second_share = std.math.clamp(second_share, 0, 1);
    var shares: [2]f32 = .{ 1 - second_share, second_share };
    var has_boundary = false;
    for (names, &parts, &shares) |name, *part, *share| {
        const made = try reader.materialNamed(name);
        part.* = reader.builder.scene.materials.items[made.index];
        if (!made.is_boundary) continue;
        has_boundary = true;
        share.* = 0;
    }
    if (!has_boundary) return .{ .surface = materials.mix(parts[0], parts[1], second_share) };
    // The rest of it is seen, if any.
    var rest = parts[@intFromBool(shares[1] > 0)];
    const opacity = shares[0] + shares[1];
    if (opacity < 1) rest.alpha_mode = .blend;
    rest.base_color[3] *= opacity;
    return .{ .surface = rest, .is_boundary = opacity == 0 };
}

fn namedMaterial(reader: *Reader) Error!void {
    reader.graphics.material = try reader.materialNamed(try reader.text());
}

/// One that is not defined is matte until it is.
fn materialNamed(reader: *Reader, name: []const u8) Error!Material {
    if (reader.named.get(name)) |known| return known;
    if (reader.undefined_materials.get(name)) |known|
        return .{ .index = known.index, .is_boundary = false };
    const index = try reader.builder.scene.addMaterial(materials.matte_default);
    const place = try reader.input.nameOf(reader.arena, reader.input.directive);
    try reader.keep(Undefined, &reader.undefined_materials, name, .{
        .index = index,
        .place = place,
    });
    return .{ .index = index, .is_boundary = false };
}

/// Version 4 allows that a material is named before it is defined, but not that it never is.
fn forgiveUndefined(reader: *Reader) Error!void {
    var names = reader.undefined_materials.iterator();
    var first: ?[]const u8 = null;
    while (names.next()) |entry| {
        const name = entry.key_ptr.*;
        if (first == null or std.mem.lessThan(u8, name, first.?)) first = name;
    }
    const name = first orelse return;
    try reader.input.forgiveFile("{s}: material {f} is not defined: grey matte stands for it", .{
        reader.undefined_materials.get(name).?.place, quote(name),
    });
}

fn areaLightSource(reader: *Reader) Error!void {
    const parameters = &reader.parameters;
    var area_light: AreaLight = .{
        .emission = try .read(&reader.colors, parameters, "L", 1e30),
        .two_sided = parameters.boolean("twosided", false),
        .power = parameters.float("power", 0),
    };
    if (parameters.string("filename")) |path| {
        const shown = try reader.colors.textures.show(&.{ .path = path });
        area_light.picture = if (shown) |picture| picture.view else null;
        if (shown != null and area_light.power > 0) {
            const textures = &reader.colors.textures;
            const image = (try textures.imageOf(path)).?;
            area_light.luminance = try textures.luminanceOf(image) orelse 1;
        }
    }
    reader.graphics.area_light = area_light;
}

fn materialIndex(reader: *Reader) Allocator.Error!u32 {
    if (reader.graphics.material) |material| return material.index;
    if (reader.default_material == scene_data.none)
        reader.default_material = try reader.builder.scene.addMaterial(materials.matte_default);
    return reader.default_material;
}

fn shape(reader: *Reader, name: []const u8) Error!void {
    const graphics = &reader.graphics;
    const input = reader.input;
    reader.tessellator.parameters = &reader.parameters;
    reader.tessellator.name = name;
    const kind = shapes.kinds.get(name) orelse {
        reader.parameters.pass();
        return input.warnHere(name, "Shape {f} is not supported and left out", .{quote(name)});
    };
    const is_boundary = if (graphics.material) |material| material.is_boundary else false;
    const seen = if (is_boundary) null else try reader.shapeMaterial();
    const has_picture = if (graphics.area_light) |light| light.picture != null else false;
    reader.tessellator.wants_texcoords = has_picture;
    if (seen) |seen_index| {
        const surface = &reader.builder.scene.materials.items[seen_index];
        if (surface.hasTextures() or surface.anisotropy > 0)
            reader.tessellator.wants_texcoords = true;
    }
    if (graphics.area_light) |area_light| {
        if (reader.object != null) {
            try input.warnHere("area light", "Shape: objects do not shine", .{});
        } else if (!is_boundary) {
            return reader.addAreaLight(kind, seen, area_light);
        } else if (!reader.colors.is_version_4) {
            const black = try reader.builder.scene.addMaterial(materials.black);
            return reader.addAreaLight(kind, black, area_light);
        } else try input.warnHere("boundary", "Shape: what bounds a medium does not shine", .{});
    }
    const material = seen orelse return reader.parameters.pass();
    const mesh = try reader.meshOf(kind, material);
    if (reader.object == null)
        try reader.builder.instantiate(mesh, &graphics.transform)
    else
        try reader.builder.addPart(mesh, &graphics.transform);
}

/// The material of the shape that the parameters tell, whose alpha is the shape's; null: there is
/// nothing to see.
fn shapeMaterial(reader: *Reader) Error!?u32 {
    const plain = try reader.materialIndex();
    const alpha = try reader.colors.texture(&reader.parameters, "alpha") orelse return plain;
    const shown = if (alpha.picture) |*picture|
        try reader.colors.textures.show(picture)
    else
        null;
    const factor = if (shown) |picture| picture.factor[0] else alpha.mean[0];
    if (alpha.picture != null and shown == null) return plain; // A warning has been said.
    if (shown == null and factor >= 1) return plain;
    if (!(factor > 0)) return null;
    const key: Holes = .{
        .material = plain,
        .factor = @bitCast(factor),
        .view = if (shown) |picture| viewKey(&picture.view) else @splat(0),
    };
    const entry = try reader.with_holes.getOrPut(reader.arena, key);
    if (!entry.found_existing) {
        errdefer _ = reader.with_holes.remove(key);
        var surface = reader.builder.scene.materials.items[plain];
        surface.alpha_mode = if (shown == null) .blend else .mask;
        surface.base_color[3] *= @min(factor, 1);
        if (shown) |picture| surface.alpha_texture = picture.view;
        entry.value_ptr.* = try reader.builder.scene.addMaterial(surface);
    }
    return entry.value_ptr.*;
}

/// A material with a shape's alpha.
const Holes = struct { material: u32, factor: u32, view: [7]u32 };

fn viewKey(view: *const scene_data.TextureView) [7]u32 {
    const rows: [6]u32 = @bitCast(view.transform);
    return rows ++ [1]u32{view.texture + 1};
}

/// The mesh of the shape that the parameters tell; curved ones are made once.
fn meshOf(reader: *Reader, kind: shapes.Kind, material: u32) Error!u32 {
    if (!kind.is_curved) {
        const geometry = try shapes.make(&reader.tessellator, kind, reader.graphics.reverse);
        return reader.builder.addMesh(geometry, material);
    }
    const key = shapes.hash(&reader.tessellator, reader.graphics.reverse) ^
        (@as(u64, material) *% 0x9e3779b97f4a7c15);
    if (reader.known_meshes.get(key)) |mesh| {
        reader.parameters.pass();
        return mesh;
    }
    const geometry = try shapes.make(&reader.tessellator, kind, reader.graphics.reverse);
    const mesh = try reader.builder.addMesh(geometry, material);
    try reader.known_meshes.put(reader.arena, key, mesh);
    return mesh;
}

/// A shape that is an area light: bright from its front, plain from behind; null: it is not seen.
fn addAreaLight(
    reader: *Reader,
    kind: shapes.Kind,
    material: ?u32,
    area_light: AreaLight,
) Error!void {
    const builder = reader.builder;
    const place = &reader.graphics.transform;
    const geometry = try shapes.make(&reader.tessellator, kind, reader.graphics.reverse);
    var bright = if (material) |seen|
        builder.scene.materials.items[seen]
    else
        materials.hidden_lamp;
    const sides: f64 = if (area_light.two_sided) 2 else 1;
    const area = lights.areaOf(&geometry, place);
    const of_unit = sides * std.math.pi * area * area_light.luminance;
    bright.emissive = area_light.emission.by(area_light.power, of_unit);
    bright.emissive_texture = area_light.picture;
    bright.double_sided = area_light.two_sided;
    const front = try builder.addMesh(geometry, try builder.scene.addMaterial(bright));
    try builder.instantiate(front, place);
    builder.scene.scene.has_area_lights = true;
    const seen = material orelse return;
    if (!area_light.two_sided) {
        var plain = builder.scene.materials.items[seen];
        plain.double_sided = false;
        const back = try shapes.turned(&reader.tessellator, &geometry);
        const mesh = try builder.addMesh(back, try builder.scene.addMaterial(plain));
        try builder.instantiate(mesh, place);
    }
}

/// Completes the scene with what is known at the end of the text.
pub fn finish(reader: *Reader) Error!void {
    const builder = reader.builder;
    const scene = &builder.scene.scene;
    const view = &reader.view;
    try reader.forgiveUndefined();
    try reader.placeAwaited();
    if (view.place == null) {
        view.place = .identity;
        try reader.input.warn(
            reader.input.offset(),
            "camera",
            "no Camera: PBRT's own at the origin looks along z with fov 90",
            .{},
        );
    }
    const projection = try view.projection(reader.input);
    if (!transforms.fitsSingle(&view.place.?))
        return reader.input.fail(0, "the camera's screen is too far away", .{});
    scene.resolution = view.size;
    scene.sample_count = reader.sample_count;
    scene.depth = reader.depth;
    const has_lights = builder.scene.lights.items.len > 0 or scene.has_area_lights;
    if (builder.has_unknown_sky and builder.sky == null and has_lights)
        builder.sky = @splat(lights.unknown_sky);
    builder.brighten(view.exposure());
    if (builder.sky) |sky| {
        if (scene.environment == null) scene.background = sky;
        scene.ambient = spectra.luminance(sky);
    } else if (has_lights) {
        // The file says all the light that there is.
        scene.ambient = 0;
    }
    try builder.finish(view.place.?, projection);
}
