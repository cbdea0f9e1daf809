//! The view: a camera and the size of its picture.

const math = @import("../math.zig");
const Vec3 = math.Vec3;

/// A camera. The ray of the image point (x, y), both in -1..1 with y up, has
///
///     perspective:  origin,                  direction forward + x right + y up
///     orthographic: origin + x right + y up, direction forward
///
/// `right` and `up` carry the half extents of the picture; directions are not normalised.
pub const Camera = struct {
    orthographic: bool,
    origin: Vec3,
    right: Vec3,
    up: Vec3,
    forward: Vec3,
};

/// A camera and its picture.
pub const View = struct {
    camera: Camera,
    /// Picture size in pixels.
    width: u32,
    height: u32,

    /// One pixel, from the origin along -z.
    pub const nowhere: View = .{
        .camera = .{
            .orthographic = false,
            .origin = .{ 0, 0, 0 },
            .right = .{ 1, 0, 0 },
            .up = .{ 0, 1, 0 },
            .forward = .{ 0, 0, -1 },
        },
        .width = 1,
        .height = 1,
    };
};
