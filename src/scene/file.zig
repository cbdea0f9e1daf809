//! What a file says of itself, beside what is drawn: names, numbers, and what it is made for.
//!
//! Nothing here reaches the picture.

const none = @import("../scene.zig").none;

/// The file that a scene comes from.
pub const File = struct {
    format: Format = .builtin,
    /// Of the format, as the file spells it; empty: it does not say.
    version: []const u8 = "",
    /// What wrote it; empty: it does not say.
    generator: []const u8 = "",
    /// Of the file and of all that was read because it names it.
    byte_count: u64 = 0,
    /// What was read, each file once, that of the scene first; empty: built in.
    files: []const Source = &.{},
    /// Names of its scenes, empty ones where it gives none.
    scenes: []const []const u8 = &.{},
    /// Index of the one that is shown; `none`: there are none, and all is shown.
    scene_shown: u32 = none,
    /// In the order of the file, each once.
    extensions: []const Extension = &.{},
    /// It requires extensions that are not known, and is drawn all the same.
    needs_force: bool = false,
    /// Null: all that is in the file is in the scene.
    counts: ?Counts = null,

    pub const Format = enum { builtin, gltf, glb, pbrt, obj, stl, ply };

    /// A file, as it lies on the disk. The path begins at the folder of the scene.
    pub const Source = struct { path: []const u8, byte_count: u64 };

    /// An extension of glTF that the file uses.
    pub const Extension = struct { name: []const u8, required: bool };

    /// How much there is in the file, drawn or not.
    pub const Counts = struct {
        nodes: u64,
        meshes: u64,
        materials: u64,
        textures: u64,
        images: u64,
        skins: u64,
        animations: u64,
        cameras: u64,
        lights: u64,
    };
};
