//! The names of the fuzz targets, for the build and for the program.

/// What of Raylane reads what strangers hand in.
pub const Name = enum {
    gltf,
    glb,
    accessors,
    png,
    jpeg,
    webp,
    hdr,
    exr,
    ktx2,
    meshopt,
    pbrt,
    ply,
    obj,
    mtl,
    stl,
    gzip,
    any,
    cli,
    scenario,
    /// Where the build holds its decoder.
    draco,

    /// What is fuzzed, in a few words.
    pub fn about(name: Name) []const u8 {
        return switch (name) {
            .gltf => "glTF as JSON",
            .glb => "binary glTF",
            .accessors => "accessors and sparse data of glTF",
            .png => "PNG",
            .jpeg => "JPEG",
            .webp => "WebP",
            .hdr => "Radiance HDR",
            .exr => "OpenEXR",
            .ktx2 => "KTX 2 of Basis Universal",
            .meshopt => "streams of meshoptimizer",
            .pbrt => "PBRT text",
            .ply => "PLY, text and binary",
            .obj => "OBJ",
            .mtl => "MTL, named by an OBJ",
            .stl => "STL, text and binary",
            .gzip => "gzip around a scene",
            .any => "scenes of any format, told by their contents",
            .cli => "the command line, an argument a line",
            .scenario => "the JSON of --scenario and of jobs",
            .draco => "meshes of Draco (with -Ddraco)",
        };
    }
};
