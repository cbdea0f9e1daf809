//! Triangles and rays in one file, so that another tracer traces just the same.
//!
//! In: a world and a setup. Out: a little-endian file:
//!
//!     8 bytes         "RAYLANE1"
//!     u32             triangles n
//!     u32             pixels along a side
//!     f32 [5][3]      eye, corner, across, down, light (`workload.Setup`)
//!     f32             offset
//!     f32 [n][3][3]   corners of the triangles, by primitive number
//!     f32 [n][4]      their unit normals, and 0

const std = @import("std");
const raylane = @import("raylane");
const Setup = @import("workload.zig").Setup;

/// Replaces the file at `path`.
pub fn write(
    gpa: std.mem.Allocator,
    io: std.Io,
    path: []const u8,
    world: *const raylane.world.World,
    setup: *const Setup,
) !void {
    var file: std.Io.Writer.Allocating = .init(gpa);
    defer file.deinit();
    const writer = &file.writer;
    try writer.writeAll("RAYLANE1");
    try writer.writeInt(u32, @intCast(world.geometry.triangles.len), .little);
    try writer.writeInt(u32, setup.size, .little);
    const vectors = [_]raylane.math.Vec3{
        setup.eye, setup.corner, setup.across, setup.down, setup.light,
    };
    for (vectors) |vector| try writeFloats(writer, &vector);
    try writeFloats(writer, &.{setup.offset});
    for (world.geometry.triangles) |triangle| for (triangle.corner) |vertex| {
        try writeFloats(writer, &world.geometry.positions[vertex]);
    };
    for (setup.normals[1..]) |normal| try writeFloats(writer, &normal);
    try std.Io.Dir.cwd().writeFile(io, .{ .sub_path = path, .data = file.written() });
}

fn writeFloats(writer: *std.Io.Writer, floats: []const f32) std.Io.Writer.Error!void {
    for (floats) |float| try writer.writeInt(u32, @bitCast(float), .little);
}
