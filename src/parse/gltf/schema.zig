//! The schema of glTF 2.0: what stands where, as far as this reader and cgltf look at it.
//!
//! A table for json.zig: the types of the properties, which of them have to be there, and which
//! whole numbers name elements of which list. cgltf takes a string for "no index" and loses its
//! place in a list of the wrong kind; with this table it never sees either. Only what something
//! depends on is required, so that files that are slightly wrong are still read.

const json = @import("../json.zig");
const Field = json.Field;
const Rule = json.Rule;

/// The counted lists.
pub const List = enum(u8) {
    accessors,
    animations,
    buffers,
    buffer_views,
    cameras,
    image_based_lights,
    images,
    lights,
    materials,
    meshes,
    nodes,
    samplers,
    scenes,
    skins,
    textures,
    variants,
};

/// The whole document.
pub const document: Rule = object(&.{
    required("asset", object(&.{
        required("version", .string),
        optional("minVersion", .string),
        spare("generator", .string),
        spare("copyright", .string),
        optional("extensions", extensions(&.{})),
    })),
    optional("accessors", list(.accessors, &accessor)),
    optional("animations", list(.animations, &animation)),
    optional("buffers", list(.buffers, &buffer)),
    optional("bufferViews", .{
        .array = .{
            .item = &buffer_view,
            .list = @backingInt(List.buffer_views),
            // cgltf does not take one without a buffer.
            .substitute = "{\"buffer\":0}",
        },
    }),
    optional("cameras", list(.cameras, &camera)),
    optional("images", list(.images, &image)),
    optional("materials", list(.materials, &material)),
    optional("meshes", list(.meshes, &mesh)),
    optional("nodes", list(.nodes, &node)),
    optional("samplers", list(.samplers, &sampler)),
    spare("scene", reference(.scenes)),
    optional("scenes", list(.scenes, &scene)),
    optional("skins", list(.skins, &skin)),
    optional("textures", list(.textures, &texture)),
    optional("extensionsUsed", many(&.string)),
    optional("extensionsRequired", many(&.string)),
    optional("extensions", extensions(&.{
        optional("EXT_lights_image_based", object(&.{
            required("lights", list(.image_based_lights, &image_based_light)),
        })),
        optional("KHR_lights_punctual", object(&.{
            required("lights", list(.lights, &light)),
        })),
        optional("KHR_materials_variants", object(&.{
            optional("variants", list(.variants, &object(&.{spare("name", .string)}))),
        })),
    })),
    optional("extras", .any),
});

const accessor: Rule = named(&.{
    optional("bufferView", reference(.buffer_views)),
    optional("byteOffset", .whole),
    required("componentType", .whole),
    optional("normalized", .boolean),
    required("count", .whole),
    required("type", .string),
    spare("max", many(&.number)),
    spare("min", many(&.number)),
    optional("sparse", object(&.{
        required("count", .whole),
        required("indices", object(&.{
            required("bufferView", reference(.buffer_views)),
            optional("byteOffset", .whole),
            required("componentType", .whole),
        })),
        required("values", object(&.{
            required("bufferView", reference(.buffer_views)),
            optional("byteOffset", .whole),
        })),
    })),
});

const animation: Rule = named(&.{
    // One without a target moves nothing.
    optional("channels", manyOr("{\"sampler\":0}", &object(&.{
        required("sampler", .whole),
        optional("target", object(&.{
            optional("node", reference(.nodes)),
            optional("path", .string),
            optional("extensions", extensions(&.{
                optional("KHR_animation_pointer", object(&.{optional("pointer", .string)})),
            })),
        })),
        optional("extensions", extensions(&.{})),
    }))),
    // What animations.zig takes for one that is left out.
    optional("samplers", manyOr("{\"input\":0,\"output\":0,\"left_out\":true}", &object(&.{
        required("input", reference(.accessors)),
        required("output", reference(.accessors)),
        optional("interpolation", .string),
        optional("extensions", extensions(&.{})),
        optional("left_out", .boolean),
    }))),
});

const buffer: Rule = named(&.{
    optional("uri", .string),
    required("byteLength", .whole),
});

const buffer_view: Rule = namedWith(&.{
    required("buffer", reference(.buffers)),
    optional("byteOffset", .whole),
    required("byteLength", .whole),
    optional("byteStride", .whole),
    spare("target", .whole),
}, &.{
    optional("EXT_meshopt_compression", meshopt),
    optional("KHR_meshopt_compression", meshopt),
});

const meshopt: Rule = object(&.{
    required("buffer", reference(.buffers)),
    optional("byteOffset", .whole),
    required("byteLength", .whole),
    required("byteStride", .whole),
    required("count", .whole),
    required("mode", .string),
    optional("filter", .{ .word = &.{
        "NONE", "OCTAHEDRAL", "QUATERNION", "EXPONENTIAL", "COLOR",
    } }),
});

const camera: Rule = named(&.{
    optional("type", .string),
    alternative("perspective", object(&.{
        optional("aspectRatio", .number),
        required("yfov", .number),
        spare("zfar", .number),
        spare("znear", .number),
    })),
    alternative("orthographic", object(&.{
        required("xmag", .number),
        required("ymag", .number),
        spare("zfar", .number),
        spare("znear", .number),
    })),
});

const image: Rule = named(&.{
    optional("uri", .string),
    spare("mimeType", .string),
    optional("bufferView", reference(.buffer_views)),
});

const image_based_light: Rule = named(&.{
    optional("rotation", .{ .vector = 4 }),
    optional("intensity", .number),
    optional("irradianceCoefficients", many(&.{ .vector = 3 })),
    required("specularImages", many(&many(&reference(.images)))),
    optional("specularImageSize", .whole),
});

const light: Rule = named(&.{
    optional("type", .string),
    optional("color", .{ .vector = 3 }),
    optional("intensity", .number),
    optional("range", .positive),
    optional("spot", object(&.{
        optional("innerConeAngle", .number),
        optional("outerConeAngle", .number),
    })),
});

const mesh: Rule = named(&.{
    optional("primitives", many(&primitive)),
    optional("weights", many(&.number)),
});

const primitive: Rule = namedWith(&.{
    optional("attributes", attributes),
    optional("indices", reference(.accessors)),
    optional("material", reference(.materials)),
    optional("mode", .whole),
    optional("targets", many(&attributes)),
}, &.{
    optional("KHR_draco_mesh_compression", object(&.{
        required("bufferView", reference(.buffer_views)),
        // Numbers of Draco's own, which cgltf takes for accessors.
        required("attributes", map(&.whole)),
    })),
    optional("KHR_materials_variants", object(&.{
        optional("mappings", many(&object(&.{
            required("material", reference(.materials)),
            required("variants", many(&.whole)),
        }))),
    })),
});

const attributes: Rule = map(&reference(.accessors));

/// Slots of a node's numbers that are kept in double precision.
pub const matrix_slot = 0;
pub const translation_slot = 16;
pub const rotation_slot = 19;
pub const scale_slot = 23;

const node: Rule = namedWith(&.{
    optional("camera", reference(.cameras)),
    optional("children", many(&.{ .reference = .{
        .list = @backingInt(List.nodes),
        .role = .child,
    } })),
    optional("skin", reference(.skins)),
    optional("matrix", .{ .doubles = .{ .length = 16, .slot = matrix_slot } }),
    optional("mesh", reference(.meshes)),
    optional("rotation", .{ .doubles = .{ .length = 4, .slot = rotation_slot } }),
    optional("scale", .{ .doubles = .{ .length = 3, .slot = scale_slot } }),
    optional("translation", .{ .doubles = .{ .length = 3, .slot = translation_slot } }),
    optional("weights", many(&.number)),
}, &.{
    optional("KHR_lights_punctual", object(&.{optional("light", reference(.lights))})),
    optional("KHR_node_visibility", object(&.{optional("visible", .boolean)})),
    optional("EXT_mesh_gpu_instancing", object(&.{optional("attributes", attributes)})),
});

const sampler: Rule = named(&.{
    optional("magFilter", .whole),
    optional("minFilter", .whole),
    optional("wrapS", .whole),
    optional("wrapT", .whole),
});

const scene: Rule = namedWith(&.{
    optional("nodes", many(&.{ .reference = .{
        .list = @backingInt(List.nodes),
        .role = .root,
    } })),
}, &.{
    optional("EXT_lights_image_based", object(&.{
        required("light", reference(.image_based_lights)),
    })),
});

const skin: Rule = named(&.{
    optional("inverseBindMatrices", reference(.accessors)),
    optional("skeleton", reference(.nodes)),
    required("joints", many(&reference(.nodes))),
});

const texture: Rule = namedWith(&.{
    optional("sampler", reference(.samplers)),
    optional("source", reference(.images)),
}, &.{
    optional("KHR_texture_basisu", object(&.{optional("source", reference(.images))})),
    optional("EXT_texture_webp", object(&.{optional("source", reference(.images))})),
});

/// A texture as a material refers to it.
const texture_use: Rule = namedWith(&.{
    required("index", reference(.textures)),
    optional("texCoord", .whole),
    optional("scale", .number),
    optional("strength", .number),
}, &.{
    optional("KHR_texture_transform", object(&.{
        optional("offset", .{ .vector = 2 }),
        optional("rotation", .number),
        optional("scale", .{ .vector = 2 }),
        optional("texCoord", .whole),
    })),
});

const material: Rule = namedWith(&.{
    optional("pbrMetallicRoughness", object(&.{
        optional("baseColorFactor", .{ .vector = 4 }),
        optional("baseColorTexture", texture_use),
        optional("metallicFactor", .number),
        optional("roughnessFactor", .number),
        optional("metallicRoughnessTexture", texture_use),
    })),
    optional("normalTexture", texture_use),
    optional("occlusionTexture", texture_use),
    optional("emissiveTexture", texture_use),
    optional("emissiveFactor", .{ .vector = 3 }),
    optional("alphaMode", .{ .word = &.{ "OPAQUE", "MASK", "BLEND" } }),
    optional("alphaCutoff", .number),
    optional("doubleSided", .boolean),
}, &material_extensions);

const material_extensions = [_]Field{
    optional("KHR_materials_ior", object(&.{optional("ior", .number)})),
    optional("KHR_materials_emissive_strength", object(&.{
        optional("emissiveStrength", .number),
    })),
    optional("KHR_materials_dispersion", object(&.{optional("dispersion", .number)})),
    optional("KHR_materials_unlit", object(&.{})),
    optional("KHR_materials_transmission", object(&.{
        optional("transmissionFactor", .number),
        optional("transmissionTexture", texture_use),
    })),
    optional("KHR_materials_volume", object(&.{
        optional("thicknessFactor", .number),
        optional("thicknessTexture", texture_use),
        optional("attenuationDistance", .number),
        optional("attenuationColor", .{ .vector = 3 }),
    })),
    optional("KHR_materials_pbrSpecularGlossiness", object(&.{
        optional("diffuseFactor", .{ .vector = 4 }),
        optional("diffuseTexture", texture_use),
        optional("specularFactor", .{ .vector = 3 }),
        optional("glossinessFactor", .number),
        optional("specularGlossinessTexture", texture_use),
    })),
    optional("KHR_materials_clearcoat", object(&.{
        optional("clearcoatFactor", .number),
        optional("clearcoatTexture", texture_use),
        optional("clearcoatRoughnessFactor", .number),
        optional("clearcoatRoughnessTexture", texture_use),
        optional("clearcoatNormalTexture", texture_use),
    })),
    optional("KHR_materials_specular", object(&.{
        optional("specularFactor", .number),
        optional("specularTexture", texture_use),
        optional("specularColorFactor", .{ .vector = 3 }),
        optional("specularColorTexture", texture_use),
    })),
    optional("KHR_materials_sheen", object(&.{
        optional("sheenColorFactor", .{ .vector = 3 }),
        optional("sheenColorTexture", texture_use),
        optional("sheenRoughnessFactor", .number),
        optional("sheenRoughnessTexture", texture_use),
    })),
    optional("KHR_materials_iridescence", object(&.{
        optional("iridescenceFactor", .number),
        optional("iridescenceTexture", texture_use),
        optional("iridescenceIor", .number),
        optional("iridescenceThicknessMinimum", .number),
        optional("iridescenceThicknessMaximum", .number),
        optional("iridescenceThicknessTexture", texture_use),
    })),
    optional("KHR_materials_diffuse_transmission", object(&.{
        optional("diffuseTransmissionFactor", .number),
        optional("diffuseTransmissionTexture", texture_use),
        optional("diffuseTransmissionColorFactor", .{ .vector = 3 }),
        optional("diffuseTransmissionColorTexture", texture_use),
    })),
    optional("KHR_materials_volume_scatter", object(&.{
        optional("multiscatterColorFactor", .{ .vector = 3 }),
        optional("multiscatterColor", .{ .vector = 3 }),
        optional("multiscatterColorTexture", texture_use),
        optional("scatterAnisotropy", .number),
    })),
    optional("KHR_materials_anisotropy", object(&.{
        optional("anisotropyStrength", .number),
        optional("anisotropyRotation", .number),
        optional("anisotropyTexture", texture_use),
    })),
};

fn optional(comptime name: []const u8, comptime rule: Rule) Field {
    return .{ .name = name, .rule = rule };
}

/// What nobody looks at.
fn spare(comptime name: []const u8, comptime rule: Rule) Field {
    return .{ .name = name, .rule = rule, .is_spare = true };
}

/// One of those that exclude each other.
fn alternative(comptime name: []const u8, comptime rule: Rule) Field {
    return .{ .name = name, .rule = rule, .is_alternative = true };
}

fn required(comptime name: []const u8, comptime rule: Rule) Field {
    return .{ .name = name, .rule = rule, .required = true };
}

fn object(comptime fields: []const Field) Rule {
    return .{ .object = &.{ .fields = fields } };
}

/// An object with a name, extensions and extras, as most are.
fn named(comptime fields: []const Field) Rule {
    return namedWith(fields, &.{});
}

fn namedWith(comptime fields: []const Field, comptime known: []const Field) Rule {
    return object(fields ++ [_]Field{
        spare("name", .string),
        optional("extensions", extensions(known)),
        optional("extras", .any),
    });
}

/// Extensions have names of their own choice, but are objects.
fn extensions(comptime known: []const Field) Rule {
    return .{ .object = &.{ .fields = known, .rest = &object(&.{}) } };
}

fn map(comptime item: *const Rule) Rule {
    return .{ .object = &.{ .rest = item } };
}

fn many(comptime item: *const Rule) Rule {
    return .{ .array = .{ .item = item } };
}

/// The same, but what breaks its rule is replaced by a text.
fn manyOr(comptime substitute: []const u8, comptime item: *const Rule) Rule {
    return .{ .array = .{ .item = item, .substitute = substitute } };
}

fn list(comptime counted: List, comptime item: *const Rule) Rule {
    return .{ .array = .{ .item = item, .list = @backingInt(counted), .substitute = "{}" } };
}

fn reference(comptime counted: List) Rule {
    return .{ .reference = .{ .list = @backingInt(counted) } };
}
