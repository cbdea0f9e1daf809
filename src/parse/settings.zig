//! What the user decides about the reading of a scene, whatever its format.

const Identity = @import("../identity.zig").Identity;

/// Full turn of a curved surface in steps, where a format has such surfaces.
pub const tessellation_default = 32;
/// Fewest and most of them.
pub const tessellation_min = 4;
pub const tessellation_max = 1024;

/// See parse.zig.
pub const Settings = struct {
    /// Whether a scene may name files outside its own folder.
    allow_outside: bool = false,
    /// Straight pieces that a full circle becomes, `tessellation_min` to `tessellation_max`.
    tessellation: u32 = tessellation_default,
    /// A file that is about to be replaced: a scene that is read from it is refused.
    output: ?Identity = null,
};
