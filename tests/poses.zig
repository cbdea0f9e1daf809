//! Posing again: the picture of a pose is the same whichever poses came before.

const std = @import("std");
const raylane = @import("raylane");
const scene = raylane.scene;
const AffineD = raylane.math.AffineD;
const Session = raylane.session.Session;
const Vec3 = raylane.math.Vec3;
const testing = std.testing;
const gpa = testing.allocator;

const side = 5;

/// A sheet that bends and swells, one that stands for itself, a block of glass, a lamp and points,
/// each at a node of its own.
const Stage = struct {
    nodes: [7]scene.Node = @splat(.{ .parent = scene.none, .local = .identity }),
    weights: [1]f32 = .{0},
    positions: [(side + 1) * (side + 1)]Vec3 = undefined,
    swelling: [(side + 1) * (side + 1)]Vec3 = undefined,
    colors: [(side + 1) * (side + 1)][4]f32 = undefined,
    brightening: [(side + 1) * (side + 1)][4]f32 = undefined,
    joints: [(side + 1) * (side + 1)][4]u16 = @splat(.{ 0, 1, 0, 0 }),
    shares: [(side + 1) * (side + 1)][4]f32 = undefined,
    triangles: [2 * side * side][3]u32 = undefined,
    targets: [1]scene.MorphTarget = undefined,
    joint_sets: [1]scene.JointSet = undefined,
    meshes: [4]scene.Mesh = undefined,
    skins: [1]scene.Skin = undefined,
    instances: [5]scene.Instance = undefined,

    const box_corners: [8]Vec3 = corners: {
        var corners: [8]Vec3 = undefined;
        for (&corners, 0..) |*corner, index| for (corner, 0..) |*to, axis| {
            to.* = if (index >> axis & 1 == 0) -0.4 else 0.4;
        };
        break :corners corners;
    };
    const box_triangles = [12][3]u32{
        .{ 0, 2, 1 }, .{ 1, 2, 3 }, .{ 4, 5, 6 }, .{ 5, 7, 6 }, .{ 0, 1, 4 }, .{ 1, 5, 4 },
        .{ 2, 6, 3 }, .{ 3, 6, 7 }, .{ 0, 4, 2 }, .{ 2, 4, 6 }, .{ 1, 3, 5 }, .{ 3, 7, 5 },
    };
    const materials = [_]scene.Material{
        .{ .metallic = 0, .double_sided = true },
        .{
            .metallic = 0,
            .roughness = 0,
            .transmission = 1,
            .volume = true,
            .attenuation_color = .{ 0.5, 0.9, 0.5 },
            .attenuation_distance = 1,
        },
        .{ .emissive = .{ 9, 8, 7 }, .double_sided = true },
        .{ .metallic = 0, .base_color = .{ 1, 0, 0, 1 } },
    };

    fn init(stage: *Stage) void {
        const grid: scene.Grid = .{ .columns = side, .rows = side };
        for (&stage.positions, 0..) |*position, index| {
            const x = @as(f32, @floatFromInt(index % (side + 1))) / side;
            const y = @as(f32, @floatFromInt(index / (side + 1))) / side;
            position.* = .{ 2 * x - 1, 2 * y - 1, -1 + 0.2 * x * y };
            stage.swelling[index] = .{ 0, 0, x * (1 - x) };
            stage.colors[index] = .{ x, y, 0.5, 1 };
            stage.brightening[index] = .{ 0.3, 0, 0, 0 };
            stage.shares[index] = .{ 1 - x, x, 0, 0 };
        }
        for (0..side * side) |cell| {
            const halves = scene.Grid.cut(grid.corners(cell / side, cell % side));
            stage.triangles[2 * cell ..][0..2].* = halves;
        }
        stage.targets = .{.{ .positions = &stage.swelling, .colors = &stage.brightening }};
        stage.joint_sets = .{.{ .joints = &stage.joints, .weights = &stage.shares }};
        stage.meshes = .{
            .{
                .positions = &stage.positions,
                .colors = &stage.colors,
                .morph_targets = &stage.targets,
                .joint_sets = &stage.joint_sets,
                .triangles = &stage.triangles,
                .material = 0,
            },
            .{ .positions = &box_corners, .triangles = &box_triangles, .material = 1 },
            .{ .positions = &box_corners, .triangles = box_triangles[0..2], .material = 2 },
            .{
                .positions = box_corners[0..3],
                .triangles = &.{},
                .points = &.{ 0, 1, 2 },
                .segments = &.{.{ 0, 1 }},
                .material = 3,
            },
        };
        stage.skins = .{.{ .joints = &.{ 1, 2 }, .inverse_bind_maps = &.{ .identity, .identity } }};
        stage.instances = .{
            .{ .mesh = 0, .node = 0, .skin = 0, .morph_weights = &stage.weights },
            .{ .mesh = 0, .node = 6 },
            .{ .mesh = 1, .node = 3 },
            .{ .mesh = 2, .node = 4 },
            .{ .mesh = 3, .node = 5 },
        };
    }

    fn put(stage: *Stage, pose: Pose) void {
        const unturned = [4]f64{ 0, 0, 0, 1 };
        for (&stage.nodes) |*node| node.local = .identity;
        stage.nodes[4].local = .translate(.{ 0, 1.5, 0.5 });
        stage.nodes[5].local = .translate(.{ 0.8, 0, 0.4 });
        stage.nodes[6].local = .fromTrs(.{ 0, -1, 0 }, .{ -0.6, 0, 0, 0.8 }, .{ 1, 1, 1 });
        stage.weights[0] = 0;
        switch (pose) {
            .rest => {},
            .bent => {
                stage.weights[0] = 0.7;
                stage.nodes[2].local = .fromTrs(.{ 0, 0, 0.3 }, .{ 0, 0.28, 0, 0.96 }, @splat(1));
                const turn = [4]f64{ 0, 0.6, 0, 0.8 };
                stage.nodes[3].local = .fromTrs(.{ 0.3, 0, 0 }, turn, .{ -1, 1.2, 1 });
                stage.nodes[4].local = .translate(.{ -1, 1.2, 0.5 });
            },
            // Glass and a sheet have no size, the points no place.
            .gone => {
                stage.nodes[3].local = .scale(@splat(0));
                stage.nodes[5].local = .translate(.{ 1e30, 0, 0 });
                stage.nodes[6].local = .scale(.{ 1, 0, 0 });
            },
            // All of it on the other side of the globe, and the lamp a million metres from there.
            .far => {
                stage.weights[0] = 0.2;
                const away: AffineD = .fromTrs(.{ 6e6, -5e6, 1e6 }, unturned, .{ 1, 0.9, 1 });
                for (&stage.nodes) |*node| node.local = .compose(away, node.local);
                stage.nodes[4].local.translation[0] += 1e6;
            },
        }
    }

    fn view(stage: *const Stage) scene.Scene {
        var shown: scene.Scene = .init(gpa);
        shown.nodes = &stage.nodes;
        shown.meshes = &stage.meshes;
        shown.materials = &materials;
        shown.skins = &stage.skins;
        shown.instances = &stage.instances;
        shown.check();
        return shown;
    }
};

const Pose = enum { rest, bent, gone, far };

const seen: raylane.settings.View = .{
    .resolution = .{ 9, 7 },
    .ambient = 0.2,
    .environment = .{ .source = .none },
    .display_referred = false,
};

/// The hash of the picture of a pose, in a session that has had others or none.
fn render(session: *Session, stage: *Stage, pose: Pose, variant: usize) !u64 {
    stage.put(pose);
    const lanes = raylane.variant.compiled[variant].lanes;
    try session.pose(.{ .lanes = lanes, .view = seen });
    try session.view(seen);
    try session.render(.{ .variant = variant, .sample_count = 1 });
    return session.film.?.image.hash();
}

/// Whether the tree has been fitted since it was built.
fn isRefitted(session: *const Session) bool {
    return switch (session.pose_cache.?.tree.?) {
        inline else => |*tree| tree.sums.len > 0,
    };
}

fn expectSamePictures(stage: *Stage, variant: usize) !void {
    var diagnostic: raylane.diagnostic.Diagnostic = .{};
    var expected: std.EnumArray(Pose, u64) = undefined;
    for (std.enums.values(Pose)) |pose| {
        var session: Session = .init(gpa, testing.io, 1, &diagnostic);
        defer session.deinit();
        session.adopt(stage.view(), .borrowed);
        expected.set(pose, try render(&session, stage, pose, variant));
    }
    for (std.enums.values(Pose)) |one| for (std.enums.values(Pose)) |other| {
        const is_same = expected.get(one) == expected.get(other);
        try testing.expectEqual(one == other, is_same);
    };
    const Step = struct { Pose, bool };
    // What the tree has never held is built into it; what it has held may go and come.
    for ([_][]const Step{
        &.{
            .{ .rest, false }, .{ .bent, true }, .{ .gone, true }, .{ .rest, true },
            .{ .far, true },
        },
        &.{ .{ .gone, false }, .{ .rest, false }, .{ .gone, true } },
    }) |steps| {
        var session: Session = .init(gpa, testing.io, 2, &diagnostic);
        defer session.deinit();
        session.adopt(stage.view(), .borrowed);
        for (steps, 0..) |step, index| {
            errdefer std.debug.print("step {d}: {t}\n", .{ index, step[0] });
            const hash = try render(&session, stage, step[0], variant);
            try testing.expectEqual(expected.get(step[0]), hash);
            try testing.expectEqual(step[1], isRefitted(&session));
        }
    }
}

test "the picture of a pose is the same whichever poses came before, by trees of all widths" {
    const stage = try gpa.create(Stage);
    defer gpa.destroy(stage);
    stage.* = .{};
    stage.init();
    var is_done: [17]bool = @splat(false);
    for (raylane.variant.compiled, 0..) |*variant, index| {
        if (is_done[variant.lanes]) continue;
        is_done[variant.lanes] = true;
        try expectSamePictures(stage, index);
    }
}
