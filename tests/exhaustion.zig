//! Memory that runs out at any allocation on the way from a file to an encoded picture.
//!
//! In: small files of every kind of scene, integrators, formats, an environment. Out: an error that
//! says so, nothing that leaks, no crash; C libraries allocate from the same memory. Some of the
//! allocations spread over the way, each with RAYLANE_EVERY_ALLOCATION in the environment.

const std = @import("std");
const raylane = @import("raylane");
const fixture = @import("fixture.zig");
const malformed = @import("malformed.zig");
const texts = @import("gltf_text.zig");
const Allocator = std.mem.Allocator;
const Diagnostic = raylane.diagnostic.Diagnostic;
const FailingAllocator = testing.FailingAllocator;
const Session = raylane.session.Session;
const settings = raylane.settings;
const testing = std.testing;
const io = testing.io;

/// Allocations of a case that fail, about.
const spread = 16;

/// A way to a picture.
const Case = struct {
    scene: []const u8,
    integrator: settings.Integrator = .whitted,
    denoise: bool = false,
    environment: settings.Environment.Source = .none,
    format: settings.Format = .png,
};

const textured_pbrt =
    \\LookAt 0 0 5  0 0 0  0 1 0
    \\Camera "perspective"
    \\WorldBegin
    \\LightSource "point" "point3 from" [0 3 3]
    \\Texture "t" "spectrum" "imagemap" "string filename" "picture.png"
    \\Material "matte" "texture Kd" "t"
    \\Shape "sphere"
    \\Material "glass"
    \\Translate 1 0 0
    \\Shape "sphere" "float radius" 0.5
    \\
;

const cases = [_]Case{
    .{ .scene = "s.gltf" },
    .{ .scene = "s.glb", .format = .exr },
    .{ .scene = "s.pbrt", .format = .webp },
    .{ .scene = "s.pbrt", .integrator = .path, .denoise = true, .format = .hdr },
    .{ .scene = "s.pbrt", .integrator = .lights, .format = .jpg },
    .{ .scene = "s.ply", .environment = .{ .file = "tests/images/rgb-piz.exr" }, .format = .pfm },
    .{ .scene = "s.stl", .environment = .{ .file = "tests/images/rle.hdr" }, .format = .bmp },
};

const ply =
    \\ply
    \\format ascii 1.0
    \\element vertex 3
    \\property float x
    \\property float y
    \\property float z
    \\element face 1
    \\property list uchar int vertex_indices
    \\end_header
    \\0 0 0
    \\1 0 0
    \\0 1 0
    \\3 0 1 2
    \\
;

const stl =
    \\solid s
    \\facet normal 0 0 1
    \\outer loop
    \\vertex 0 0 0
    \\vertex 1 0 0
    \\vertex 0 1 0
    \\endloop
    \\endfacet
    \\endsolid
    \\
;

/// Reads, renders and encodes with this memory, and gives it all back.
fn makePicture(gpa: Allocator, folder: []const u8, case: *const Case) !void {
    const mode = raylane.simd.setFlushToZero();
    defer raylane.simd.setFloatControl(mode);
    var path_buffer: [std.fs.max_path_bytes]u8 = undefined;
    const path = try std.mem.print(&path_buffer, "{s}/{s}", .{ folder, case.scene });
    var said: Diagnostic = .{};
    var session: Session = .init(gpa, io, 1, &said);
    defer session.deinit();
    try session.load(path, .{ .tessellation = 4 });
    try session.pose(.{ .lanes = raylane.variant.compiled[0].lanes });
    const environment: settings.Environment = .{ .source = case.environment };
    try session.view(.{ .resolution = .{ 4, 4 }, .environment = environment });
    const sample_count: u32 = if (case.denoise) 2 else 1;
    try session.render(.{
        .integrator = case.integrator,
        .denoise = case.denoise,
        .sample_count = sample_count,
        .depth = 3,
        .tile_size = 16,
        .lights = .{ .virtual_count = 8 },
    });
    var temporaries: raylane.output.TemporaryFiles = .{};
    var target = try raylane.output.Target.openFile(io, &temporaries, "/dev/null", &said);
    try session.write(&target, .{ .format = case.format });
}

/// Has allocations `first`, `first` + `step` and so on fail, with all that follow them.
fn expectSurvived(folder: []const u8, case: *const Case, order: usize) !void {
    var counting: FailingAllocator = .init(testing.allocator, .{});
    try makePicture(counting.allocator(), folder, case);
    const count = counting.alloc_index;
    try testing.expect(count > spread);
    const is_complete = testing.environ.getPosix("RAYLANE_EVERY_ALLOCATION") != null;
    const step = if (is_complete) 1 else count / fixture.enough(spread);
    var fail_index = order % step;
    while (fail_index < count) : (fail_index += step) {
        errdefer std.debug.print("{s}, {t}: allocation {d} of {d}\n", .{
            case.scene, case.integrator, fail_index, count,
        });
        var failing: FailingAllocator = .init(testing.allocator, .{
            .fail_index = fail_index,
            .resize_fail_index = 0,
        });
        const result = makePicture(failing.allocator(), folder, case);
        try testing.expectError(error.OutOfMemory, result);
        try testing.expect(failing.has_induced_failure);
        try testing.expectEqual(failing.allocated_bytes, failing.freed_bytes);
    }
}

test "whenever memory runs out on the way to a picture, that is the error" {
    var folder = testing.tmpDir(.{});
    defer folder.cleanup();
    const buffer = malformed.makeBuffer();
    const gltf = try texts.make(malformed.document, &buffer, &.{});
    defer testing.allocator.free(gltf);
    const glb = try malformed.makeBinary(&buffer);
    defer testing.allocator.free(glb);
    for ([_][2][]const u8{
        .{ "s.gltf", gltf },          .{ "s.glb", glb }, .{ "s.ply", ply }, .{ "s.stl", stl },
        .{ "s.pbrt", textured_pbrt },
    }) |file| try folder.dir.writeFile(io, .{ .sub_path = file[0], .data = file[1] });
    const cwd: std.Io.Dir = .cwd();
    try cwd.copyFile("tests/images/rgb.png", folder.dir, "picture.png", io, .{});
    var path_buffer: [std.fs.max_path_bytes]u8 = undefined;
    const path = path_buffer[0..try folder.dir.realPath(io, &path_buffer)];
    for (&cases, 0..) |*case, order| try expectSurvived(path, case, order);
}
