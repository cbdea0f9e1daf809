//! One account of all memory: what is allocated, by us and by C libraries, against a limit.
//!
//! In: an allocator, and how many bytes may be out at a time. Out: an allocator that keeps count
//! and refuses what would be more, and the hooks by which C libraries allocate from it. Stacks and
//! what the system's allocator takes for itself are not counted.

const std = @import("std");
const Alignment = std.mem.Alignment;
const Allocator = std.mem.Allocator;
const Message = @import("diagnostic.zig").Message;
const available = @import("memory_account/available.zig");
const huge_pages = @import("huge_pages.zig");
const assert = std.debug.assert;

/// Counts what is out. Threads may share it; it must not move once `allocator` was called.
pub const Account = struct {
    child: Allocator,
    limit: usize,
    /// Nobody has asked for that limit.
    is_default: bool = false,
    /// Nothing more is to be had.
    is_ended: std.atomic.Value(bool) = .init(false),
    used: std.atomic.Value(usize) = .init(0),
    /// Bytes of the last refused request, and how many were out by then.
    refused: std.atomic.Value(usize) = .init(0),
    refused_at: std.atomic.Value(usize) = .init(0),
    /// Bytes of the last request that the child did not have, and how many were out by then.
    missing: std.atomic.Value(usize) = .init(0),
    missing_at: std.atomic.Value(usize) = .init(0),

    /// Null: as much as the child has.
    pub fn init(child: Allocator, limit: ?u64) Account {
        const bytes_max = std.math.maxInt(usize);
        return .{ .child = child, .limit = std.math.cast(usize, limit orelse bytes_max) orelse
            bytes_max };
    }

    /// As the user asks: null is three quarters of what is left to the process, so that neither
    /// the kernel nor its neighbours have to end it.
    pub fn initFor(child: Allocator, io: std.Io, asked: ?u64) Account {
        if (asked) |bytes| return .init(child, bytes);
        const left = available.find(io) orelse return .init(child, null);
        var account: Account = .init(child, left / 4 * 3);
        account.is_default = true;
        return account;
    }

    /// Refuses all that is asked for from now on, so that whoever is at work comes to an end, in a
    /// C library as well. Any thread may call it.
    pub fn end(account: *Account) void {
        account.is_ended.store(true, .monotonic);
    }

    /// Takes that back.
    pub fn reopen(account: *Account) void {
        account.is_ended.store(false, .monotonic);
    }

    /// The allocator for everybody.
    pub fn allocator(account: *Account) Allocator {
        return .{ .ptr = account, .vtable = &.{
            .alloc = alloc,
            .resize = resize,
            .remap = remap,
            .free = free,
        } };
    }

    /// Says why there was no memory: this account's limit, or the system.
    pub fn explain(account: *const Account, message: *Message) void {
        const refused = account.refused.load(.acquire);
        if (refused == 0) return account.explainMissing(message);
        const used = account.refused_at.load(.monotonic);
        if (account.is_default) return message.set(
            "needs more than {f}, three quarters of the memory that is left " ++
                "({f} in use, {f} more asked for; see --max-memory)",
            .{ inUnits(account.limit), inUnits(used), inUnits(refused) },
        );
        message.set(
            "needs more than the {f} of --max-memory ({f} in use, {f} more asked for)",
            .{ inUnits(account.limit), inUnits(used), inUnits(refused) },
        );
    }

    fn explainMissing(account: *const Account, message: *Message) void {
        const missing = account.missing.load(.acquire);
        if (missing == 0) return message.set("out of memory", .{});
        const used = account.missing_at.load(.monotonic);
        message.set(
            "out of memory ({f} in use, {f} more asked for)",
            .{ inUnits(used), inUnits(missing) },
        );
    }

    fn take(account: *Account, bytes: usize) bool {
        if (account.is_ended.load(.monotonic)) return false;
        var used = account.used.load(.monotonic);
        while (true) {
            if (bytes > account.limit -| used) {
                account.refused_at.store(used, .monotonic);
                account.refused.store(bytes, .release);
                return false;
            }
            used = account.used.cmpxchgWeak(used, used + bytes, .monotonic, .monotonic) orelse
                return true;
        }
    }

    fn giveBack(account: *Account, bytes: usize) void {
        const before = account.used.fetchSub(bytes, .monotonic);
        assert(before >= bytes);
    }

    fn alloc(context: *anyopaque, len: usize, alignment: Alignment, address: usize) ?[*]u8 {
        const account: *Account = @ptrCast(@alignCast(context));
        if (!account.take(len)) return null;
        const memory = account.child.rawAlloc(len, alignment, address);
        if (memory == null) {
            account.giveBack(len);
            account.missing_at.store(account.used.load(.monotonic), .monotonic);
            account.missing.store(len, .release);
        }
        return memory;
    }

    fn resize(
        context: *anyopaque,
        memory: []u8,
        alignment: Alignment,
        len: usize,
        address: usize,
    ) bool {
        const account: *Account = @ptrCast(@alignCast(context));
        if (!account.take(len -| memory.len)) return false;
        const done = account.child.rawResize(memory, alignment, len, address);
        account.giveBack(if (done) memory.len -| len else len -| memory.len);
        return done;
    }

    fn remap(
        context: *anyopaque,
        memory: []u8,
        alignment: Alignment,
        len: usize,
        address: usize,
    ) ?[*]u8 {
        const account: *Account = @ptrCast(@alignCast(context));
        if (!account.take(len -| memory.len)) return null;
        const moved = account.child.rawRemap(memory, alignment, len, address);
        account.giveBack(if (moved != null) memory.len -| len else len -| memory.len);
        return moved;
    }

    fn free(context: *anyopaque, memory: []u8, alignment: Alignment, address: usize) void {
        const account: *Account = @ptrCast(@alignCast(context));
        account.child.rawFree(memory, alignment, address);
        account.giveBack(memory.len);
    }
};

/// A number of bytes for `{f}`, in the largest unit of which it has one.
fn inUnits(bytes: u64) std.fmt.Alt(u64, formatSize) {
    return .{ .data = bytes };
}

fn formatSize(bytes: u64, writer: *std.Io.Writer) std.Io.Writer.Error!void {
    if (bytes < 1 << 10) return writer.print("{d} bytes", .{bytes});
    const units = [_][]const u8{ "KiB", "MiB", "GiB", "TiB" };
    const unit: u6 = @intCast(@min(units.len, std.math.log2_int(u64, bytes) / 10));
    const unit_bytes: f64 = @floatFromInt(@as(u64, 1) << 10 * unit);
    const value = @as(f64, @floatFromInt(bytes)) / unit_bytes;
    if (value == @trunc(value)) return writer.print("{d} {s}", .{ value, units[unit - 1] });
    return writer.print("{d:.1} {s}", .{ value, units[unit - 1] });
}

/// `rl_memory` of memory_account.h.
pub const Hooks = extern struct {
    user: *anyopaque,
    allocate: *const fn (user: ?*anyopaque, size: usize) callconv(.c) ?*anyopaque,
    resize: *const fn (
        user: ?*anyopaque,
        memory: ?*anyopaque,
        size: usize,
    ) callconv(.c) ?*anyopaque,
    release: *const fn (user: ?*anyopaque, memory: ?*anyopaque) callconv(.c) void,
};

/// What a C library has allocated. C does not say again how long a block is, and a library that is
/// left by longjmp frees nothing: each block has its size in front, and a place in a list. For one
/// thread at a time; must not move.
pub const LibraryHeap = struct {
    gpa: Allocator,
    blocks: std.DoublyLinkedList = .{},

    const alignment: Alignment = .@"16";
    const head_bytes = alignment.forward(@sizeOf(Head));
    const Head = struct { node: std.DoublyLinkedList.Node = .{}, bytes: usize };

    /// Frees what the library has left.
    pub fn deinit(heap: *LibraryHeap) void {
        while (heap.blocks.popFirst()) |node| heap.free(@fieldParentPtr("node", node));
        heap.* = undefined;
    }

    /// For the library.
    pub fn hooks(heap: *LibraryHeap) Hooks {
        return .{ .user = heap, .allocate = allocate, .resize = resize, .release = release };
    }

    /// Takes a block out of the heap: all of its memory, for the caller to free by `huge_pages`.
    pub fn take(heap: *LibraryHeap, memory: *anyopaque) []align(64) u8 {
        const head = headOf(memory);
        heap.blocks.remove(&head.node);
        const block: [*]align(64) u8 = @ptrCast(@alignCast(head));
        return block[0..head.bytes];
    }

    fn free(heap: *LibraryHeap, head: *Head) void {
        const memory: [*]align(64) u8 = @ptrCast(@alignCast(head));
        huge_pages.free(heap.gpa, memory[0..head.bytes]);
    }

    fn headOf(memory: *anyopaque) *Head {
        return @ptrFromInt(@intFromPtr(memory) - head_bytes);
    }

    fn allocate(user: ?*anyopaque, size: usize) callconv(.c) ?*anyopaque {
        const heap: *LibraryHeap = @ptrCast(@alignCast(user.?));
        const bytes = std.math.add(usize, head_bytes, size) catch return null;
        // A picture's worth of page faults took as long as what is done to it.
        const memory = huge_pages.alloc(heap.gpa, u8, bytes) catch return null;
        const head: *Head = @ptrCast(memory.ptr);
        head.* = .{ .bytes = bytes };
        heap.blocks.append(&head.node);
        return memory.ptr + head_bytes;
    }

    fn resize(user: ?*anyopaque, memory: ?*anyopaque, size: usize) callconv(.c) ?*anyopaque {
        const old = memory orelse return allocate(user, size);
        const new = allocate(user, size) orelse return null;
        const kept = @min(size, headOf(old).bytes - head_bytes);
        @memcpy(@as([*]u8, @ptrCast(new))[0..kept], @as([*]const u8, @ptrCast(old)));
        release(user, old);
        return new;
    }

    fn release(user: ?*anyopaque, memory: ?*anyopaque) callconv(.c) void {
        const heap: *LibraryHeap = @ptrCast(@alignCast(user.?));
        const head = headOf(memory orelse return);
        heap.blocks.remove(&head.node);
        heap.free(head);
    }
};

test "an account counts, refuses and forgets nothing" {
    var account: Account = .init(std.testing.allocator, 1000);
    const gpa = account.allocator();
    const a = try gpa.alloc(u8, 600);
    try std.testing.expectError(error.OutOfMemory, gpa.alloc(u8, 401));
    var message: Message = .{};
    account.explain(&message);
    try std.testing.expectEqualStrings("needs more than the 1000 bytes of --max-memory " ++
        "(600 bytes in use, 401 bytes more asked for)", message.text());
    var list: std.ArrayList(u8) = .fromOwnedSlice(a);
    try list.ensureTotalCapacityPrecise(gpa, 700);
    try std.testing.expectError(error.OutOfMemory, list.ensureTotalCapacityPrecise(gpa, 1001));
    list.shrinkAndFree(gpa, 100);
    try std.testing.expectEqual(100, account.used.load(.monotonic));
    list.deinit(gpa);
    try std.testing.expectEqual(0, account.used.load(.monotonic));

    account.end();
    try std.testing.expectError(error.OutOfMemory, gpa.alloc(u8, 1));
    account.reopen();
    gpa.free(try gpa.alloc(u8, 1));

    // The child's own failure is not a refusal.
    var failing: std.testing.FailingAllocator = .init(std.testing.allocator, .{ .fail_index = 0 });
    var unlimited: Account = .init(failing.allocator(), null);
    try std.testing.expectError(error.OutOfMemory, unlimited.allocator().alloc(u8, 1));
    unlimited.explain(&message);
    try std.testing.expectEqualStrings(
        "out of memory (0 bytes in use, 1 bytes more asked for)",
        message.text(),
    );
    try std.testing.expectEqual(0, unlimited.used.load(.monotonic));
}

test "the limit that nobody asks for is below what is left, and said to be so" {
    const io = std.testing.io;
    const asked: Account = .initFor(std.testing.allocator, io, 7);
    try std.testing.expect(asked.limit == 7 and !asked.is_default);
    var account: Account = .initFor(std.testing.allocator, io, null);
    const left = available.find(io) orelse return error.SkipZigTest;
    try std.testing.expect(account.is_default and account.limit < left);
    account.limit = 1000;
    const gpa = account.allocator();
    try std.testing.expectError(error.OutOfMemory, gpa.alloc(u8, 1001));
    var message: Message = .{};
    account.explain(&message);
    try std.testing.expectEqualStrings(
        "needs more than 1000 bytes, three quarters of the memory that is left " ++
            "(0 bytes in use, 1001 bytes more asked for; see --max-memory)",
        message.text(),
    );
}

test inUnits {
    const gpa = std.testing.allocator;
    for ([_]struct { u64, []const u8 }{
        .{ 0, "0 bytes" },     .{ 1023, "1023 bytes" },   .{ 1024, "1 KiB" },
        .{ 1536, "1.5 KiB" },  .{ 512 << 20, "512 MiB" }, .{ (1 << 30) - 1, "1024.0 MiB" },
        .{ 3 << 30, "3 GiB" },
    }) |case| {
        const text = try gpa.print("{f}", .{inUnits(case[0])});
        defer gpa.free(text);
        try std.testing.expectEqualStrings(case[1], text);
    }
}

test "threads that share an account never have more out than it allows" {
    const Shared = struct {
        account: Account,
        fn work(shared: *@This(), seed: u64) void {
            var random = std.Random.DefaultPrng.init(seed);
            const gpa = shared.account.allocator();
            for (0..2000) |_| {
                const memory = gpa.alloc(u8, random.random().uintLessThan(usize, 1100)) catch
                    continue;
                assert(shared.account.used.load(.monotonic) <= 1000);
                gpa.free(memory);
            }
        }
    };
    var shared: Shared = .{ .account = .init(std.testing.allocator, 1000) };
    var threads: [4]std.Thread = undefined;
    for (&threads, 0..) |*thread, seed| {
        thread.* = try std.Thread.spawn(.{}, Shared.work, .{ &shared, seed });
    }
    for (threads) |thread| thread.join();
    try std.testing.expect(shared.account.refused.load(.monotonic) > 0);
    try std.testing.expectEqual(0, shared.account.used.load(.monotonic));
}

test LibraryHeap {
    var account: Account = .init(std.testing.allocator, 4000);
    var heap: LibraryHeap = .{ .gpa = account.allocator() };
    const hooks = heap.hooks();
    const bytes: [*]u8 = @ptrCast(hooks.resize(&heap, null, 100).?);
    try std.testing.expect(alignmentOf(bytes));
    for (bytes[0..100], 0..) |*byte, index| byte.* = @intCast(index);
    const larger: [*]u8 = @ptrCast(hooks.resize(&heap, bytes, 1000).?);
    for (larger[0..100], 0..) |byte, index| try std.testing.expectEqual(index, byte);
    try std.testing.expectEqual(null, hooks.resize(&heap, larger, 5000));
    try std.testing.expectEqual(99, larger[99]);
    try std.testing.expectEqual(null, hooks.allocate(&heap, std.math.maxInt(usize)));
    const empty = hooks.allocate(&heap, 0).?;
    hooks.release(&heap, larger);
    hooks.release(&heap, null);
    try std.testing.expect(alignmentOf(@ptrCast(empty)));
    const taken: [*]u8 = @ptrCast(hooks.allocate(&heap, 500).?);
    taken[499] = 7;
    const block = heap.take(taken);
    defer huge_pages.free(account.allocator(), block);
    try std.testing.expectEqual(7, block[block.len - 1]);
    // What is left is freed.
    heap.deinit();
    try std.testing.expectEqual(block.len, account.used.load(.monotonic));
}

fn alignmentOf(memory: [*]const u8) bool {
    return LibraryHeap.alignment.check(@intFromPtr(memory));
}

test {
    _ = available;
}
