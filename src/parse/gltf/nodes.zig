//! The node hierarchy of the shown scene, in an order where parents come before their children.
//!
//! In: glTF's nodes and scenes (glTF 2.0, section 3.5). Out: the scene's nodes, and for each the
//! glTF node it comes from. Explicit stacks: a chain may be as deep as the file is long. Every node
//! that is shown hangs below a root.

const std = @import("std");
const json = @import("../json.zig");
const math = @import("../../math.zig");
const scene = @import("../../scene.zig");
const choice = @import("choice.zig");
const extension_text = @import("extension_text.zig");
const Choice = @import("../../settings.zig").Choice;
const c = @import("../cgltf.zig");
const Source = @import("source.zig");
const schema = @import("schema.zig");
const AffineD = math.AffineD;
const Vec3d = math.Vec3d;
const Error = Source.Error;
const Vec3 = math.Vec3;
const assert = std.debug.assert;

/// A node that waits for its turn.
const Pending = struct { origin: u32, parent: u32 };

/// Adds the nodes of a scene, or every root where there is none. Returns the index of the glTF node
/// of each, which the caller frees with the source's `gpa`; the source knows which are hidden.
pub fn collect(source: *Source, shown: ?*const c.cgltf_scene) Error![]const u32 {
    const gpa = source.gpa;
    const node_count = source.data.nodes_count;
    var in_tree = try findTrees(source);
    defer in_tree.deinit(gpa);
    var stack: std.ArrayList(Pending) = .empty;
    defer stack.deinit(gpa);
    var listed = try std.DynamicBitSetUnmanaged.initEmpty(gpa, node_count);
    defer listed.deinit(gpa);
    try pushRoots(source, shown, &in_tree, &stack, &listed);

    var origins: std.ArrayList(u32) = .empty;
    errdefer origins.deinit(gpa);
    while (stack.pop()) |pending| {
        const local = try localTransform(source, pending.origin);
        const index = try source.builder.addNode(pending.parent, local);
        source.builder.nodes.items[index].origin = pending.origin;
        try origins.append(gpa, pending.origin);
        try hide(source, pending, index);
        const node = Source.item(source.data.nodes, pending.origin);
        const children = Source.slice(node.children, node.children_count);
        try stack.ensureUnusedCapacity(gpa, children.len);
        for (0..children.len) |position| stack.appendAssumeCapacity(.{
            .origin = Source.indexOf(source.data.nodes, children[children.len - 1 - position]),
            .parent = index,
        });
    }
    assert(origins.items.len <= node_count);
    return origins.toOwnedSlice(gpa);
}

/// KHR_node_visibility: a node that is not visible hides all below it, whatever these say.
fn hide(source: *Source, pending: Pending, index: u32) Error!void {
    const is_below = pending.parent != scene.none and source.isHidden(pending.parent);
    if (!is_below) {
        const node = Source.item(source.data.nodes, pending.origin);
        const list = Source.slice(node.extensions, node.extensions_count);
        const text = extension_text.find(list, "KHR_node_visibility") orelse return;
        var arena_state: std.heap.ArenaAllocator = .init(source.gpa);
        defer arena_state.deinit();
        const Visibility = struct { visible: bool = true };
        const known = try extension_text.parse(Visibility, arena_state.allocator(), text) orelse
            return;
        if (known.visible) return;
    }
    const hidden = &source.hidden;
    if (hidden.bit_length == 0) try hidden.resize(source.gpa, source.data.nodes_count, false);
    hidden.set(index);
}

/// The scene's node of a glTF node. It is added, with those that it hangs below, where `places`
/// (by glTF node: the scene's, or `scene.none`) knows of none.
pub fn reach(source: *const Source, places: []u32, origin: u32) Error!u32 {
    const gpa = source.gpa;
    var missing: std.ArrayList(u32) = .empty;
    defer missing.deinit(gpa);
    var parent: u32 = scene.none;
    var next: ?u32 = origin;
    while (next) |index| {
        if (places[index] != scene.none) {
            parent = places[index];
            break;
        }
        if (missing.items.len == places.len) return source.fail(
            "node {d}: is its own ancestor, or hangs below a node that is",
            .{origin},
        );
        try missing.append(gpa, index);
        const above = Source.item(source.data.nodes, index).parent orelse break;
        next = Source.indexOf(source.data.nodes, above);
    }
    while (missing.pop()) |index| {
        parent = try source.builder.addNode(parent, try localTransform(source, index));
        places[index] = parent;
    }
    return parent;
}

/// The scene that is asked for, by default the one that the file shows: `scene`, else the first
/// one; null: the file has none, and none is asked for.
pub fn choose(
    source: *const Source,
    wanted: Choice,
) error{ OutOfMemory, SceneUnknown }!?*const c.cgltf_scene {
    const data = source.data;
    const list = Source.slice(data.scenes, data.scenes_count);
    if (try choice.find(source, list, wanted, "scene", error.SceneUnknown)) |index|
        return &list[index];
    if (data.scene != null) return Source.item(data.scene, 0);
    return if (list.len > 0) &list[0] else null;
}

/// The roots of the shown scene, the first on top.
fn pushRoots(
    source: *const Source,
    chosen: ?*const c.cgltf_scene,
    in_tree: *const std.DynamicBitSetUnmanaged,
    stack: *std.ArrayList(Pending),
    listed: *std.DynamicBitSetUnmanaged,
) Error!void {
    const gpa = source.gpa;
    const data = source.data;
    const shown = chosen orelse {
        for (0..data.nodes_count) |reversed| {
            const index = data.nodes_count - 1 - reversed;
            if (data.nodes[index].parent != null) continue;
            try stack.append(gpa, .{ .origin = @intCast(index), .parent = scene.none });
        }
        return;
    };
    const roots = Source.slice(shown.nodes, shown.nodes_count);
    for (0..roots.len) |reversed| {
        const index = Source.indexOf(data.nodes, roots[roots.len - 1 - reversed]);
        if (listed.isSet(index)) {
            source.forgive("scene {d}: lists node {d} twice, counted once", .{
                Source.indexOf(data.scenes, shown), index,
            });
            continue;
        }
        if (!in_tree.isSet(index)) return source.fail(
            "node {d}: is its own ancestor, or hangs below a node that is",
            .{index},
        );
        listed.set(index);
        try stack.append(gpa, .{ .origin = index, .parent = scene.none });
    }
}

/// The nodes that hang below a root, the caller's to free; a warning where others do not. cgltf has
/// refused nodes with two parents, so what no root reaches lies on a cycle or below one.
fn findTrees(source: *const Source) Error!std.DynamicBitSetUnmanaged {
    const gpa = source.gpa;
    const data = source.data;
    var reached = try std.DynamicBitSetUnmanaged.initEmpty(gpa, data.nodes_count);
    errdefer reached.deinit(gpa);
    var stack: std.ArrayList(u32) = .empty;
    defer stack.deinit(gpa);
    for (Source.slice(data.nodes, data.nodes_count), 0..) |*node, index| {
        if (node.parent == null) try stack.append(gpa, @intCast(index));
    }
    while (stack.pop()) |index| {
        reached.set(index);
        const node = Source.item(data.nodes, index);
        for (Source.slice(node.children, node.children_count)) |child| {
            try stack.append(gpa, Source.indexOf(data.nodes, child));
        }
    }
    var missing = reached.iterator(.{ .kind = .unset });
    if (missing.next()) |index| source.forgive(
        "node {d}: is its own ancestor, or hangs below a node that is; not shown",
        .{index},
    );
    return reached;
}

/// A node's map into its parent's space: its matrix, or translation, rotation and scale.
fn localTransform(source: *const Source, index: u32) Error!AffineD {
    try source.need(.nodes, index);
    const node = Source.item(source.data.nodes, index);
    const numbers: Numbers = .of(source, index);
    var local: AffineD = undefined;
    if (node.has_matrix != 0) {
        const also = node.has_translation != 0 or node.has_rotation != 0 or node.has_scale != 0;
        if (also) source.forgive(
            "node {d}: has a matrix, so its other transforms are ignored",
            .{index},
        );
        const m = numbers.matrix;
        var is_affine = true;
        for ([4]f64{ m[3], m[7], m[11], m[15] }, [4]f64{ 0, 0, 0, 1 }) |value, wanted| {
            if (!(@abs(value - wanted) <= 1e-5)) is_affine = false;
        }
        if (!is_affine) source.forgive(
            "node {d}: matrix is not affine, its last row is {d} {d} {d} {d}, ignored",
            .{ index, m[3], m[7], m[11], m[15] },
        );
        local = .{
            .x = m[0..3].*,
            .y = m[4..7].*,
            .z = m[8..11].*,
            .translation = m[12..15].*,
        };
    } else {
        const rotation = try unitQuaternion(source, index, numbers.rotation);
        local = .fromTrs(numbers.translation, rotation, numbers.scale);
    }
    if (!local.isFinite()) return source.fail("node {d}: transform is not finite", .{index});
    return local;
}

/// Translation, rotation and scale of a node that animations move, whose number in the scene is the
/// caller's to fill in. Such a node has no matrix (glTF 2.0, section 3.5.3), or else it is taken
/// apart.
pub fn partsOf(source: *const Source, index: u32) Error!scene.MovingNode {
    const numbers: Numbers = .of(source, index);
    if (Source.item(source.data.nodes, index).has_matrix == 0) return .{
        .node = scene.none,
        .translation = numbers.translation,
        .rotation = try unitQuaternion(source, index, numbers.rotation),
        .scale = numbers.scale,
    };
    source.forgive("node {d}: is moved by animations, so its matrix is taken apart", .{index});
    return takeApart(try localTransform(source, index));
}

/// Without the shear, if there is any.
fn takeApart(map: AffineD) scene.MovingNode {
    var axes = [3]Vec3d{ map.x, map.y, map.z };
    var scale: Vec3d = undefined;
    const unit = [3]Vec3d{ .{ 1, 0, 0 }, .{ 0, 1, 0 }, .{ 0, 0, 1 } };
    for (&axes, &scale, unit) |*axis, *length, other| {
        length.* = math.vec3d.length(axis.*);
        axis.* = math.vec3d.normalize(axis.*) orelse other;
    }
    if (map.determinant() < 0) {
        axes[0] = math.vec3d.neg(axes[0]);
        scale[0] = -scale[0];
    }
    return .{
        .node = scene.none,
        .translation = map.translation,
        .rotation = quaternionOf(axes),
        .scale = scale,
    };
}

/// The unit quaternion of a rotation by the images of the axes (Shepperd 1978, Quaternion from
/// Rotation Matrix): the largest of its numbers by a root, the others by that one.
fn quaternionOf(axes: [3]Vec3d) [4]f64 {
    const x, const y, const z = axes;
    // Four times the squares of x, y, z, w.
    const squares = [4]f64{
        1 + x[0] - y[1] - z[2], 1 - x[0] + y[1] - z[2],
        1 - x[0] - y[1] + z[2], 1 + x[0] + y[1] + z[2],
    };
    var largest: usize = 0;
    for (squares, 0..) |square, index| if (square > squares[largest]) {
        largest = index;
    };
    const q: [4]f64 = switch (largest) {
        0 => .{ squares[0], x[1] + y[0], z[0] + x[2], y[2] - z[1] },
        1 => .{ x[1] + y[0], squares[1], y[2] + z[1], z[0] - x[2] },
        2 => .{ z[0] + x[2], y[2] + z[1], squares[2], x[1] - y[0] },
        else => .{ y[2] - z[1], z[0] - x[2], x[1] - y[0], squares[3] },
    };
    const length = quaternionLength(q);
    return .{ q[0] / length, q[1] / length, q[2] / length, q[3] / length };
}

/// A node's numbers in double precision, as the file has them, each at its slot.
const Numbers = extern struct {
    matrix: [16]f64,
    translation: Vec3d,
    rotation: [4]f64,
    scale: Vec3d,

    comptime {
        assert(@offsetOf(Numbers, "translation") == 8 * schema.translation_slot);
        assert(@offsetOf(Numbers, "rotation") == 8 * schema.rotation_slot);
        assert(@offsetOf(Numbers, "scale") == 8 * schema.scale_slot);
    }

    /// cgltf's in single precision, but for those that are not exact there.
    fn of(source: *const Source, index: u32) Numbers {
        const node = Source.item(source.data.nodes, index);
        var numbers: Numbers = undefined;
        inline for (.{ "matrix", "translation", "rotation", "scale" }) |name| {
            for (&@field(numbers, name), @field(node, name)) |*to, from| to.* = from;
        }
        const slots: *[@sizeOf(Numbers) / 8]f64 = @ptrCast(&numbers);
        const doubles = source.doubles;
        var at = std.sort.lowerBound(json.Double, doubles, index, orderByElement);
        while (at < doubles.len and doubles[at].element == index) : (at += 1) {
            slots[doubles[at].slot] = doubles[at].value;
        }
        return numbers;
    }

    fn orderByElement(index: u32, double: json.Double) std.math.Order {
        return std.math.order(index, double.element);
    }
};

fn unitQuaternion(source: *const Source, index: u32, rotation: [4]f64) Error![4]f64 {
    const x, const y, const z, const w = rotation;
    const length = quaternionLength(rotation);
    if (!std.math.isFinite(length)) {
        return source.fail("node {d}: rotation is not finite", .{index});
    }
    if (length < std.math.floatMin(f32)) {
        source.forgive("node {d}: rotation is zero, taken as none", .{index});
        return .{ 0, 0, 0, 1 };
    }
    if (@abs(length - 1) > 1e-3) {
        source.forgive("node {d}: rotation is not a unit quaternion, made one", .{index});
    }
    return .{ x / length, y / length, z / length, w / length };
}

/// Of a quaternion.
pub fn quaternionLength(rotation: [4]f64) f64 {
    const x, const y, const z, const w = rotation;
    return @sqrt(((x * x + y * y) + z * z) + w * w);
}

test "maps are taken apart into what they were made of" {
    const rotations = [_][4]f64{
        .{ 0, 0, 0, 1 },     .{ 1, 0, 0, 0 },          .{ 0, 0.6, 0, 0.8 },
        .{ 0, 0.8, 0.6, 0 }, .{ 0.5, -0.5, 0.5, 0.5 }, .{ 0.1, 0.7, -0.7, 0.1 },
        .{ 0.6, 0, 0.8, 0 }, .{ -0.5, 0.5, 0.5, 0.5 },
    };
    for (rotations) |rotation| for ([_]f64{ 2, -2 }) |first| {
        const scale: Vec3d = .{ first, 3, 0.5 };
        const map: AffineD = .fromTrs(.{ 1, 2, 3 }, rotation, scale);
        const parts = takeApart(map);
        for (scale, parts.scale) |wanted, number| {
            try std.testing.expectApproxEqAbs(wanted, number, 1e-12);
        }
        const again = parts.local();
        inline for (.{ "x", "y", "z", "translation" }) |name| {
            for (@field(map, name), @field(again, name)) |wanted, number| {
                try std.testing.expectApproxEqAbs(wanted, number, 1e-12);
            }
        }
    };
    // A scale of 0 leaves a rotation.
    const flat = takeApart(.scale(.{ 1, 0, 1 }));
    try std.testing.expectEqual([4]f64{ 0, 0, 0, 1 }, flat.rotation);
    try std.testing.expectEqual(Vec3d{ 1, 0, 1 }, flat.scale);
}
