//! A glTF document: cgltf's structures, and the memory behind them.
//!
//! In: JSON text that has passed our own check (json.zig). Out: `cgltf_data` with its references
//! resolved, in memory that is freed as a whole. cgltf gets a budget, because a byte of JSON can
//! ask for hundreds of bytes, and our conversion of numbers, which knows no locale.

const std = @import("std");
const c = @import("../cgltf.zig");
const numbers = @import("../json/numbers.zig");
const limits = @import("limits.zig");
const Allocator = std.mem.Allocator;
const assert = std.debug.assert;
const Document = @This();

data: *const c.cgltf_data,
heap: *Heap,

/// `Refused`: cgltf finds a reference or a value that it refuses, without saying which. `Legacy`:
/// it is glTF 1.0. `TooLarge`: it needs more memory than a document of this size may.
pub const Error = error{ OutOfMemory, Refused, Legacy, TooLarge };

/// Parses a checked JSON text, which has to outlive the document. Free with `deinit`.
pub fn parse(gpa: Allocator, text: []const u8) Error!Document {
    return parseWithin(gpa, text, limits.heapBytesMax(text.len));
}

fn parseWithin(gpa: Allocator, text: []const u8, bytes_max: u64) Error!Document {
    const heap = try gpa.create(Heap);
    heap.* = .{ .gpa = gpa, .arena = .init(gpa), .bytes_left = bytes_max };
    errdefer heap.destroy();
    const hooks: c.rl_cgltf_hooks = .{
        .user = heap,
        .allocate = Heap.allocate,
        .release = Heap.release,
        .to_integer = toInteger,
        .to_float = toFloat,
    };
    var data: [*c]c.cgltf_data = null;
    const result = c.rl_cgltf_parse(&hooks, text.ptr, text.len, &data);
    if (heap.out_of_memory) return error.OutOfMemory;
    if (heap.over_budget) return error.TooLarge;
    if (result == .legacy_gltf) return error.Legacy;
    if (result != .success) return error.Refused;
    return .{ .data = data, .heap = heap };
}

/// Frees everything that cgltf has allocated.
pub fn deinit(document: *Document) void {
    document.heap.destroy();
    document.* = undefined;
}

/// The memory that cgltf sees. Small pieces live until the end; large ones, the token list above
/// all, are given back when cgltf frees them.
const Heap = struct {
    gpa: Allocator,
    arena: std.heap.ArenaAllocator,
    large: std.ArrayList([]align(alignment_bytes) u8) = .empty,
    bytes_left: u64,
    over_budget: bool = false,
    out_of_memory: bool = false,

    const alignment_bytes = 16;
    const large_bytes_min = 1 << 20;

    fn destroy(heap: *Heap) void {
        for (heap.large.items) |memory| heap.gpa.free(memory);
        heap.large.deinit(heap.gpa);
        heap.arena.deinit();
        heap.gpa.destroy(heap);
    }

    fn allocate(user: ?*anyopaque, size: usize) callconv(.c) ?*anyopaque {
        const heap: *Heap = @ptrCast(@alignCast(user.?));
        if (size > heap.bytes_left) {
            heap.over_budget = true;
            return null;
        }
        heap.bytes_left -= size;
        const memory = heap.take(size) catch {
            heap.out_of_memory = true;
            return null;
        };
        return memory.ptr;
    }

    fn take(heap: *Heap, size: usize) error{OutOfMemory}![]align(alignment_bytes) u8 {
        // cgltf takes null for a failure, and asks for 0 bytes where a list is empty.
        const byte_count = @max(size, 1);
        if (size < large_bytes_min) {
            return heap.arena.allocator().alignedAlloc(u8, .@"16", byte_count);
        }
        try heap.large.ensureUnusedCapacity(heap.gpa, 1);
        const memory = try heap.gpa.alignedAlloc(u8, .@"16", byte_count);
        heap.large.appendAssumeCapacity(memory);
        return memory;
    }

    fn release(user: ?*anyopaque, memory: ?*anyopaque) callconv(.c) void {
        const heap: *Heap = @ptrCast(@alignCast(user.?));
        for (heap.large.items, 0..) |candidate, index| {
            if (@intFromPtr(candidate.ptr) != @intFromPtr(memory)) continue;
            heap.bytes_left += candidate.len;
            heap.gpa.free(candidate);
            _ = heap.large.swapRemove(index);
            return;
        }
    }
};

fn toInteger(text: [*c]const u8) callconv(.c) c_longlong {
    const value = numbers.parseInteger(std.mem.span(@as([*:0]const u8, text))) orelse return -1;
    assert(value <= numbers.integer_max);
    return @intCast(value);
}

fn toFloat(text: [*c]const u8) callconv(.c) f32 {
    return numbers.parseFloat(std.mem.span(@as([*:0]const u8, text))) orelse std.math.nan(f32);
}

test "any budget is enough or an error, and nothing leaks" {
    const gpa = std.testing.allocator;
    const text =
        \\{"asset":{"version":"2.0"},"accessors":[{"count":4.0,"componentType":5126,"type":"VEC3"}],
        \\"meshes":[{"primitives":[{"attributes":{"POSITION":0,"TEXCOORD_x":0}}]}],
        \\"materials":[{"pbrMetallicRoughness":{"roughnessFactor":1e-1}},{}]}
    ;
    var budget: u64 = 0;
    var document = while (true) : (budget += 8) {
        break parseWithin(gpa, text, budget) catch |err| {
            try std.testing.expectEqual(error.TooLarge, err);
            continue;
        };
    };
    defer document.deinit();
    try std.testing.expect(budget > 1000);
    try std.testing.expectEqual(4, document.data.accessors[0].count);
    const material = &document.data.materials[0];
    try std.testing.expectEqual(0.1, material.pbr_metallic_roughness.roughness_factor);
    const attributes = document.data.meshes[0].primitives[0].attributes;
    try std.testing.expect(attributes[0].type == .position);
    try std.testing.expect(attributes[1].type == .invalid);
}

test "what cgltf refuses is an error" {
    const gpa = std.testing.allocator;
    const refused = "{\"asset\":{\"version\":\"2.0\"},\"scene\":3}";
    try std.testing.expectError(error.Refused, parse(gpa, refused));
    try std.testing.expectError(error.Legacy, parse(gpa, "{\"asset\":{\"version\":\"1.0\"}}"));
    try std.testing.expectError(error.Refused, parse(gpa, "{}"));
}
