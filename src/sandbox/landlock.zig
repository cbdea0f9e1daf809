//! Landlock, from Linux 5.13: what of the file system a process may still open, by folders.
//!
//! In: folders and files that are there, and what may be done beneath them. Out: a thread, and all
//! that it will start, for which nothing else can be opened, made, renamed or removed; from ABI 4
//! on (Linux 6.7) no TCP, from ABI 6 on (6.12) no signals to others and no abstract sockets.
//! Descriptors that are open stay what they are. Looking at what is there (stat, readlink, O_PATH)
//! is no right that Landlock knows, nor are modes, owners and times of files, which `seccomp.zig`
//! keeps.
//!
//! Source: Linux, userspace-api/landlock.rst and include/uapi/linux/landlock.h.

const std = @import("std");
const linux = std.os.linux;

/// What may be done beneath a folder, by the numbers of the kernel; to a file, the rights of
/// `of_files`.
pub const Rights = packed struct(u64) {
    execute: bool = false,
    write_file: bool = false,
    read_file: bool = false,
    read_dir: bool = false,
    remove_dir: bool = false,
    remove_file: bool = false,
    make_char: bool = false,
    make_dir: bool = false,
    make_reg: bool = false,
    make_sock: bool = false,
    make_fifo: bool = false,
    make_block: bool = false,
    make_sym: bool = false,
    /// From ABI 2 on: links and renaming from one folder to another.
    refer: bool = false,
    /// From ABI 3 on.
    truncate: bool = false,
    /// From ABI 5 on: of devices.
    ioctl_dev: bool = false,
    _: u48 = 0,

    /// Those that files have.
    const of_files: Rights = .{
        .execute = true,
        .write_file = true,
        .read_file = true,
        .truncate = true,
        .ioctl_dev = true,
    };
};

/// Rules that are not in force yet.
pub const Ruleset = struct {
    file: linux.fd_t,
    abi: u32,

    /// Of everything that the kernel can deny; null: it has no Landlock, or may not use it.
    pub fn create() ?Ruleset {
        const version_flag = 1;
        const answer = linux.syscall3(.landlock_create_ruleset, 0, 0, version_flag);
        if (linux.errno(answer) != .SUCCESS or answer == 0) return null;
        const abi: u32 = @intCast(answer);
        const attributes: Attributes = .{
            .files = handled(abi),
            .network = if (abi >= 4) Attributes.tcp else 0,
            .scopes = if (abi >= 6) Attributes.all_scopes else 0,
        };
        const file = linux.syscall3(
            .landlock_create_ruleset,
            @intFromPtr(&attributes),
            Attributes.byteCount(abi),
            0,
        );
        if (linux.errno(file) != .SUCCESS) return null;
        return .{ .file = @intCast(file), .abi = abi };
    }

    /// Frees the rules; what is in force stays.
    pub fn close(ruleset: *Ruleset) void {
        _ = linux.close(ruleset.file);
        ruleset.* = undefined;
    }

    /// Allows this beneath a folder, or of a file; links are followed. What is not there cannot be
    /// opened later either, and is no error.
    pub fn allow(ruleset: *const Ruleset, path: []const u8, rights: Rights) void {
        const flags: linux.O = .{ .PATH = true, .CLOEXEC = true };
        const parent = std.posix.openat(linux.AT.FDCWD, path, flags, 0) catch return;
        defer _ = linux.close(parent);
        var rule: PathBeneath = .{
            .allowed = @as(u64, @bitCast(rights)) & handled(ruleset.abi),
            .parent = parent,
        };
        if (linux.errno(ruleset.add(&rule)) != .INVAL) return;
        // It is no folder.
        rule.allowed &= @bitCast(Rights.of_files);
        _ = ruleset.add(&rule); // Of a pipe without a name, which needs no rule, there is none.
    }

    fn add(ruleset: *const Ruleset, rule: *const PathBeneath) usize {
        const path_beneath = 1;
        const file: usize = @intCast(ruleset.file);
        return linux.syscall4(.landlock_add_rule, file, path_beneath, @intFromPtr(rule), 0);
    }

    /// Puts the rules in force, for good, for this thread and those that it starts from now on;
    /// false: the system does not. Asserts nothing: the thread must have given up new privileges.
    pub fn enforce(ruleset: *const Ruleset) bool {
        const file: usize = @intCast(ruleset.file);
        return linux.errno(linux.syscall2(.landlock_restrict_self, file, 0)) == .SUCCESS;
    }
};

/// Rights of files that a kernel of this ABI denies where no rule allows them.
fn handled(abi: u32) u64 {
    const count: u6 = switch (abi) {
        0, 1 => 13,
        2 => 14,
        3, 4 => 15,
        else => 16,
    };
    return (@as(u64, 1) << count) - 1;
}

/// struct landlock_ruleset_attr.
const Attributes = extern struct {
    files: u64,
    network: u64,
    scopes: u64,

    /// Binding and connecting.
    const tcp = 0b11;
    /// Abstract sockets and signals.
    const all_scopes = 0b11;

    /// As many as the ABI knows.
    fn byteCount(abi: u32) usize {
        return if (abi >= 6) 24 else if (abi >= 4) 16 else 8;
    }
};

/// struct landlock_path_beneath_attr, of which the kernel reads 12 bytes.
const PathBeneath = extern struct { allowed: u64, parent: i32 };

test "rights are the kernel's bits" {
    const bits = struct {
        fn of(rights: Rights) u64 {
            return @bitCast(rights);
        }
    };
    try std.testing.expectEqual(1 << 2, bits.of(.{ .read_file = true }));
    try std.testing.expectEqual(1 << 8, bits.of(.{ .make_reg = true }));
    try std.testing.expectEqual(1 << 13, bits.of(.{ .refer = true }));
    try std.testing.expectEqual(1 << 15, bits.of(.{ .ioctl_dev = true }));
    for ([_][2]u64{ .{ 1, 0x1fff }, .{ 2, 0x3fff }, .{ 4, 0x7fff }, .{ 9, 0xffff } }) |case|
        try std.testing.expectEqual(case[1], handled(@intCast(case[0])));
    try std.testing.expectEqual(8, @offsetOf(PathBeneath, "parent"));
}
