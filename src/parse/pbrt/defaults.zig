//! Parameters of what follows: `Attribute "shape" "float alpha" 0` of PBRT's version 4.
//!
//! In: the parameters of Attribute directives. Out: for shapes, lights, materials, media and
//! textures what a directive has beside its own parameters, the last Attribute's first. They are
//! lists in an arena that only grow in front, so that a copy of one is what AttributeBegin keeps.

const std = @import("std");
const Parameters = @import("parameters.zig");
const Allocator = std.mem.Allocator;
const Defaults = @This();

/// What the parameters are of, by the names that Attribute has for them.
pub const Target = enum { shape, light, material, medium, texture };

/// One Attribute's, and those before it.
const Link = struct { parameters: Parameters, before: ?*const Link };

lists: std.enums.EnumArray(Target, ?*const Link) = .initFill(null),

/// Adds the parameters of an Attribute, which are copied.
pub fn add(
    defaults: *Defaults,
    arena: Allocator,
    target: Target,
    parameters: *const Parameters,
) Allocator.Error!void {
    const link = try arena.create(Link);
    link.* = .{
        .parameters = try parameters.clone(arena),
        .before = defaults.lists.get(target),
    };
    defaults.lists.set(target, link);
}

/// Gives a directive what it does not say itself; `position` is the directive's.
pub fn complete(
    defaults: *const Defaults,
    gpa: Allocator,
    target: Target,
    parameters: *Parameters,
    position: u64,
) Allocator.Error!void {
    var next = defaults.lists.get(target);
    while (next) |link| : (next = link.before)
        try parameters.addMissing(gpa, &link.parameters, position);
}
