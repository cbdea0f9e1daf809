//! A glTF accessor becomes an `Accessor` that can be decoded, or one line that says why not.
//!
//! In: what the JSON says of accessors, buffer views and buffers, none of it trusted. Out: slices
//! that hold every element. All products and sums are 64 bits wide and cannot wrap: counts are
//! below 2^31, strides below 2^8, offsets below 2^53 (glTF 2.0, sections 3.6.2.4 and 3.6.2.3).

const std = @import("std");
const c = @import("../cgltf.zig");
const limits = @import("limits.zig");
const accessors = @import("../accessor.zig");
const buffer_views = @import("buffer_views.zig");
const Source = @import("source.zig");
const Accessor = accessors.Accessor;
const Component = accessors.Component;
const Error = Source.Error;
const assert = std.debug.assert;

/// Checks the accessors and views of the file that nothing drawn has needed: what is wrong with
/// them is no reason to give up.
pub fn checkRest(source: *Source) Error!void {
    try buffer_views.checkRest(source);
    for (0..source.data.accessors_count) |index| {
        if (source.isResolved(index) or source.findBroken(.accessors, index) != null) continue;
        _ = resolve(source, index) catch |err| try source.excuse(err);
    }
    for (source.buffers, 0..) |buffer, index| if (buffer) |bytes| {
        const byte_length = source.data.buffers[index].size;
        if (bytes.len < byte_length) source.forgive(
            "buffer {d}: has {d} bytes, its byteLength is {d}; nothing drawn needs more",
            .{ index, bytes.len, byte_length },
        );
    };
}

/// The accessor with this index; null where its buffer has no data, which is no error as long as
/// nobody needs it.
pub fn resolve(source: *Source, index: usize) Error!?Accessor {
    return resolveAs(source, index, .vertices);
}

/// The same, of indices: these are not interleaved, but there are writers that give their view a
/// byteStride. It counts where the view is long enough for it.
pub fn resolveIndices(source: *Source, index: usize) Error!?Accessor {
    return resolveAs(source, index, .indices);
}

const Purpose = enum { vertices, indices };

fn resolveAs(source: *Source, index: usize, purpose: Purpose) Error!?Accessor {
    assert(index < source.data.accessors_count);
    if (source.draco.get(@intCast(index))) |decoded| return decoded.accessor;
    var accessor = try describe(source, index);
    const raw = Source.item(source.data.accessors, index);
    const component = accessor.component;
    const element_bytes = paddedBytes(raw.type, component, accessor.component_count);
    if (raw.buffer_view) |view| {
        const stride = try strideOf(source, index, raw, view, accessor, element_bytes, purpose);
        const base = try resolveBase(source, index, raw, view, component, stride, element_bytes);
        accessor.base = base orelse return null;
    } else if (raw.count > limits.zero_count_max) return source.fail(
        "accessor {d}: {d} elements without data are over the limit of {d}",
        .{ index, raw.count, limits.zero_count_max },
    );
    if (raw.is_sparse != 0 and raw.sparse.count == 0) {
        if (!source.isResolved(index))
            source.forgive("accessor {d}: no sparse values", .{index});
    } else if (raw.is_sparse != 0) {
        accessor.sparse = (try resolveSparse(source, index, accessor, element_bytes)) orelse
            return null;
    }
    try source.noteResolved(index);
    return accessor;
}

/// From one element to the next, in bytes.
fn strideOf(
    source: *const Source,
    index: usize,
    raw: *const c.cgltf_accessor,
    view: *const c.cgltf_buffer_view,
    accessor: Accessor,
    element_bytes: u32,
    purpose: Purpose,
) Error!u64 {
    const view_index = viewIndex(source, view);
    if (view.stride == 0) return element_bytes;
    if (purpose == .indices) {
        source.forgive(
            "buffer view {d}: has a byteStride, which views of indices have not",
            .{view_index},
        );
        const length = @as(u64, view.stride) *| (accessor.count - 1) +| element_bytes;
        const fits = length +| raw.offset <= view.size and view.stride <= 252;
        const is_aligned = view.stride % accessor.component.bytes() == 0;
        if (!fits or !is_aligned or view.stride < element_bytes) return element_bytes;
        return view.stride;
    }
    const range_line = "buffer view {d}: byteStride {d} is not in 4..252";
    if (view.stride > 252) return source.fail(range_line, .{ view_index, view.stride });
    if (view.stride < 4) source.forgive(range_line, .{ view_index, view.stride });
    if (view.stride < element_bytes) return source.fail(
        "accessor {d}: elements of {d} bytes do not fit the byteStride {d} of buffer view {d}",
        .{ index, element_bytes, view.stride, view_index },
    );
    return view.stride;
}

/// The accessor without its data.
pub fn describe(source: *const Source, index: usize) Error!Accessor {
    try source.need(.accessors, index);
    const raw = Source.item(source.data.accessors, index);
    const component = componentOf(raw.component_type) orelse
        return source.fail("accessor {d}: unknown componentType", .{index});
    const component_count = componentCount(raw.type) orelse
        return source.fail("accessor {d}: unknown type", .{index});
    if (raw.count == 0) return source.fail("accessor {d}: count is 0", .{index});
    if (raw.count > limits.accessor_count_max) return source.fail(
        "accessor {d}: count {d} is over the limit of {d}",
        .{ index, raw.count, limits.accessor_count_max },
    );
    return .{
        .component = component,
        .component_count = component_count,
        .normalized = raw.normalized != 0,
        .count = @intCast(raw.count),
        .base = null,
        .sparse = null,
    };
}

fn resolveBase(
    source: *Source,
    index: usize,
    raw: *const c.cgltf_accessor,
    view: *const c.cgltf_buffer_view,
    component: Component,
    stride: u64,
    element_bytes: u32,
) Error!?accessors.Strided {
    const length = stride * (@as(u64, raw.count) - 1) + element_bytes;
    const bytes = try range(source, index, "", view, raw.offset, length, component.bytes());
    return .{ .bytes = bytes orelse return null, .stride = @intCast(stride) };
}

fn resolveSparse(
    source: *Source,
    index: usize,
    accessor: Accessor,
    element_bytes: u32,
) Error!?accessors.Sparse {
    const raw = &Source.item(source.data.accessors, index).sparse;
    if (raw.count > accessor.count) return source.fail(
        "accessor {d}: {d} sparse values for {d} elements",
        .{ index, raw.count, accessor.count },
    );
    const index_component = switch (raw.indices_component_type) {
        .r_8u => Component.u8,
        .r_16u => Component.u16,
        .r_32u => Component.u32,
        else => return source.fail("accessor {d}: bad componentType of sparse indices", .{index}),
    };
    const count: u64 = raw.count;
    const indices = try range(
        source,
        index,
        "sparse indices: ",
        raw.indices_buffer_view,
        raw.indices_byte_offset,
        count * index_component.bytes(),
        index_component.bytes(),
    );
    const values = try range(
        source,
        index,
        "sparse values: ",
        raw.values_buffer_view,
        raw.values_byte_offset,
        count * element_bytes,
        accessor.component.bytes(),
    );
    const sparse: accessors.Sparse = .{
        .count = @intCast(count),
        .indices = indices orelse return null,
        .index_component = index_component,
        .values = values orelse return null,
    };
    if (!source.isResolved(index)) try checkSparse(source, index, accessor.count, sparse);
    return sparse;
}

fn checkSparse(source: *Source, index: usize, count: u32, sparse: accessors.Sparse) Error!void {
    try source.charge(sparse.indices.len);
    var next: u64 = 0;
    var increases = true;
    for (0..sparse.count) |position| {
        const target = sparse.index(position);
        if (target < next) increases = false;
        if (target >= count) return source.fail(
            "accessor {d}: sparse index {d} of {d} elements",
            .{ index, target, count },
        );
        next = @as(u64, target) + 1;
    }
    if (!increases) source.forgive(
        "accessor {d}: sparse indices do not increase; of those for one element the last counts",
        .{index},
    );
}

/// `length` bytes of a view from `offset`; null where its buffer has no data.
fn range(
    source: *Source,
    index: usize,
    part: []const u8,
    view: *const c.cgltf_buffer_view,
    offset: u64,
    length: u64,
    alignment: u32,
) Error!?[]const u8 {
    const bytes = try buffer_views.contents(source, view);
    const view_bytes: u64 = view.size;
    const excess = (offset +| length) -| view_bytes;
    if (excess > 0) return source.fail(
        "accessor {d}: {s}{d} bytes past its buffer view {d}",
        .{ index, part, excess, viewIndex(source, view) },
    );
    const start = @as(u64, view.offset) +| offset;
    // Bytes are read one by one.
    if (start % alignment != 0 and !source.isResolved(index)) source.forgive(
        "accessor {d}: {s}byte {d} of buffer {d} is not aligned to {d} bytes",
        .{ index, part, start, bufferIndex(source, view), alignment },
    );
    const all = bytes orelse return null;
    return all[@intCast(offset)..][0..@intCast(length)];
}

fn viewIndex(source: *const Source, view: *const c.cgltf_buffer_view) u32 {
    return Source.indexOf(source.data.buffer_views, view);
}

fn bufferIndex(source: *const Source, view: *const c.cgltf_buffer_view) u32 {
    return Source.indexOf(source.data.buffers, view.buffer);
}

fn componentOf(raw: c.cgltf_component_type) ?Component {
    return switch (raw) {
        .r_8 => .i8,
        .r_8u => .u8,
        .r_16 => .i16,
        .r_16u => .u16,
        .r_32u => .u32,
        .r_32f => .f32,
        else => null,
    };
}

fn componentCount(raw: c.cgltf_type) ?u8 {
    return switch (raw) {
        .scalar => 1,
        .vec2 => 2,
        .vec3 => 3,
        .vec4 => 4,
        .mat2 => 4,
        .mat3 => 9,
        .mat4 => 16,
        else => null,
    };
}

/// Bytes of an element; columns of matrices start at multiples of 4 bytes.
fn paddedBytes(raw: c.cgltf_type, component: Component, component_count: u8) u32 {
    const column_count: u32 = switch (raw) {
        .mat2 => 2,
        .mat3 => 3,
        else => return @as(u32, component.bytes()) * component_count,
    };
    return column_count * std.mem.alignForward(u32, component.bytes() * column_count, 4);
}
