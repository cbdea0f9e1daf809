//! PBRT's plymesh: the mesh of a PLY file.
//!
//! In: the name of a file. Out: its mesh, with coordinates of textures where the shape needs them.

const std = @import("std");
const Input = @import("../input.zig");
const Message = @import("../../../diagnostic.zig").Message;
const Tessellator = @import("tessellator.zig");
const ply = @import("../../ply.zig");
const quote = @import("../../../diagnostic.zig").quote;
const Error = Input.Error;
const Geometry = Tessellator.Geometry;

/// The mesh of `bytes`, which the scene calls `name`.
pub fn read(tessellator: *Tessellator, name: []const u8, bytes: [:0]const u8) Error!Geometry {
    var reason: Message = .{};
    const from = ply.read(tessellator.input.gpa, tessellator.arena, bytes, .{
        .texcoords = tessellator.wants_texcoords,
        .extras = false,
    }, &reason) catch |err| switch (err) {
        error.OutOfMemory => |failure| return failure,
        error.InvalidPly => return tessellator.fail("{f}: {s}", .{ quote(name), reason.text() }),
    };
    if (from.not_finite_count > 0)
        return tessellator.fail("{f}: a number is not finite", .{quote(name)});
    if (from.dropped_count > 0) try tessellator.input.forgive(
        tessellator.input.directive,
        name,
        "{f}: {d} normals or coordinates that are not finite are dropped",
        .{ quote(name), from.dropped_count },
    );
    try tessellator.reserve(from.bytes(), 1);
    if (from.texcoords) |texcoords| for (texcoords) |*texcoord| {
        texcoord.* = Tessellator.texcoordOf(texcoord[0], texcoord[1]);
    };
    var result: Geometry = .{
        .positions = from.positions,
        .normals = from.normals,
        .texcoords = from.texcoords,
        .triangles = from.triangles,
    };
    if (tessellator.wants_texcoords and result.texcoords == null)
        try tessellator.unshare(&result, Tessellator.triangle_corners);
    Tessellator.orient(&result);
    return result;
}

/// `filename`, relative to the scene's folder.
pub fn mesh(tessellator: *Tessellator) Error!Geometry {
    const parameter = tessellator.parameters.find("filename") orelse
        return tessellator.fail("has no filename", .{});
    const name = tessellator.parameters.string("filename") orelse
        return tessellator.fail("has no filename", .{});
    const input = tessellator.input;
    const file = try input.readFile(parameter.offset, name);
    defer input.gpa.free(file.bytes);
    return read(tessellator, name, try input.withoutMark(parameter.offset, name, file.bytes));
}
