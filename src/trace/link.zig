//! Linkage of kernels: how a program and those that it is linked to find each other.
//!
//! Kernels are compiled by themselves, and what they share with the program are Zig's structures,
//! whose layout is the compiler's choice. So the name of a kernel's symbol ends with a hash of all
//! layouts that its functions lead to: where the two sides do not agree, linking fails. Where one
//! program holds code for several levels of processors, names tell these apart as well.

const std = @import("std");
const variant_file = @import("../variant.zig");
const Variant = variant_file.Variant;

/// Name of the symbol of a variant's `Face`, through which it is called; `what` tells those of one
/// variant apart.
pub fn symbolOf(
    comptime Face: type,
    comptime variant: Variant,
    comptime what: []const u8,
) [:0]const u8 {
    const layout = LayoutOf(Face).hash;
    return std.fmt.comptimePrint("rl_{s}_{s}_{x:0>16}{s}", .{
        variant.name(), what, layout, suffixOf(if (isShared(variant)) "" else variant_file.level),
    });
}

/// Whether the levels of a program have one kernel of a variant: single rays are the reference.
fn isShared(comptime variant: Variant) bool {
    return variant.traversal == .single;
}

/// A program for a level: numbers and lists of arguments and of variables, as C has them, to an
/// exit code.
pub const Program = fn (
    argument_count: usize,
    arguments: [*]const [*:0]const u8,
    variable_count: usize,
    variables: [*:null]const ?[*:0]const u8,
) callconv(.c) u8;

/// Name of its symbol.
pub fn programOf(comptime level: []const u8) [:0]const u8 {
    return "rl_program" ++ suffixOf(level);
}

fn suffixOf(comptime level: []const u8) []const u8 {
    return if (level.len == 0) "" else "_" ++ level;
}

/// Name of the symbol by which kernels of this level end the program with a message.
pub const panic_symbol = "rl_kernel_panic" ++ suffixOf(variant_file.level);

/// Ends the program with a message; exported by the program, for its kernels.
pub const kernelPanic = @extern(*const @TypeOf(panicOfKernel), .{ .name = panic_symbol });

/// `kernelPanic` as programs export it.
pub fn panicOfKernel(message: [*]const u8, byte_count: usize, _: usize) callconv(.c) noreturn {
    @panic(message[0..byte_count]);
}

/// Hash of the sizes, alignments and offsets of everything that can be reached from a type. A type
/// of its own, so that it is found once.
fn LayoutOf(comptime T: type) type {
    return struct {
        const hash: u64 = found: {
            @setEvalBranchQuota(1_000_000);
            var layout: Layout = .{};
            layout.add(T);
            break :found layout.hash;
        };
    };
}

const Layout = struct {
    hash: u64 = 0xcbf29ce484222325,
    seen: []const type = &.{},

    fn add(comptime layout: *Layout, comptime T: type) void {
        for (layout.seen) |other| if (other == T) return;
        layout.seen = layout.seen ++ .{T};
        const info = @typeInfo(T);
        layout.mixText(@tagName(info));
        switch (info) {
            .@"opaque" => return,
            .@"fn" => |function| {
                for (function.param_types) |Parameter| if (Parameter) |Known| layout.add(Known);
                if (function.return_type) |Result| layout.add(Result);
                return;
            },
            .pointer => |pointer| layout.add(pointer.child),
            .optional => |optional| layout.add(optional.child),
            .array => |array| layout.add(array.child),
            .@"struct" => |fields| for (fields.field_names, fields.field_types) |name, Field| {
                layout.mixText(name);
                if (fields.layout != .@"packed") layout.mix(@offsetOf(T, name));
                layout.add(Field);
            },
            .@"union" => |fields| for (fields.field_names, fields.field_types) |name, Field| {
                layout.mixText(name);
                layout.add(Field);
            },
            .@"enum" => |values| for (values.field_names) |name| layout.mixText(name),
            else => {},
        }
        layout.mix(@sizeOf(T));
        layout.mix(@alignOf(T));
    }

    fn mixText(comptime layout: *Layout, comptime text: []const u8) void {
        for (text) |byte| layout.mix(byte);
    }

    /// FNV-1a, a number at a time.
    fn mix(comptime layout: *Layout, comptime number: u64) void {
        layout.hash = (layout.hash ^ number) *% 0x100000001b3;
    }
};

test "the hash sees offsets, order and what pointers lead to" {
    const A = struct { x: u32, next: ?*const @This() };
    const B = extern struct { y: u8, a: *const A, list: [*]const u16 };
    const C = extern struct { a: *const A, y: u8, list: [*]const u16 };
    const D = extern struct { y: u8, a: *const A, list: [*]const u32 };
    const E = extern struct { y: u8, a: *const A, list: [*]const u16 };
    try std.testing.expect(LayoutOf(B).hash != LayoutOf(C).hash);
    try std.testing.expect(LayoutOf(B).hash != LayoutOf(D).hash);
    try std.testing.expect(LayoutOf(B).hash == LayoutOf(E).hash);
}
