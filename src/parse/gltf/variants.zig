//! Material variants (KHR_materials_variants): which material a primitive has.
//!
//! In: the variants of a document, those that primitives are mapped by, and which one is asked for.
//! Out: one material a primitive, so that of the others nothing is read.

const c = @import("../cgltf.zig");
const choice = @import("choice.zig");
const Choice = @import("../../settings.zig").Choice;
const Source = @import("source.zig");
const Error = Source.Error;

/// Gives the scene the names of all variants. Returns the index of the one that is asked for; null:
/// the materials that primitives have without any.
pub fn choose(
    source: *Source,
    wanted: Choice,
) (Error || error{MaterialVariantUnknown})!?u32 {
    const list = Source.slice(source.data.variants, source.data.variants_count);
    const names = try source.arena.alloc([]const u8, list.len);
    for (names, list) |*name, *variant| {
        name.* = try choice.nameOf(source.arena, variant) orelse "";
    }
    source.builder.scene.material_variants = names;
    const unknown = error.MaterialVariantUnknown;
    return choice.find(source, list, wanted, "material variant", unknown);
}

/// The material of a primitive in a variant; null: it has none. A primitive that is not mapped by
/// the variant keeps its own.
pub fn materialOf(
    source: *const Source,
    primitive: *const c.cgltf_primitive,
    variant: ?u32,
) ?u32 {
    const materials = source.data.materials;
    if (variant) |number| {
        for (Source.slice(primitive.mappings, primitive.mappings_count)) |*mapping| {
            if (mapping.variant == number) return Source.indexOf(materials, mapping.material);
        }
    }
    if (primitive.material == null) return null;
    return Source.indexOf(materials, primitive.material);
}
