//! Which file an open one is, whatever its names and links to it: device and inode number.
//!
//! A leaf that every stage may import: what is read must not be what is about to be replaced.

const std = @import("std");
const linux = std.os.linux;

/// Compared with `eql`; numbers are used again once a file is deleted and closed.
pub const Identity = struct {
    device: [2]u32,
    inode: u64,

    /// Of an open file or folder; null where the system does not tell.
    pub fn of(handle: std.posix.fd_t) ?Identity {
        var status: linux.Statx = undefined;
        const result = linux.statx(handle, "", linux.AT.EMPTY_PATH, .{ .INO = true }, &status);
        if (linux.errno(result) != .SUCCESS) return null;
        return .{ .device = .{ status.dev_major, status.dev_minor }, .inode = status.ino };
    }

    /// Whether both are known to be the same file.
    pub fn eql(left: ?Identity, right: ?Identity) bool {
        return std.meta.eql(left orelse return false, right orelse return false);
    }
};

test Identity {
    const io = std.testing.io;
    var folder = std.testing.tmpDir(.{});
    defer folder.cleanup();
    try folder.dir.writeFile(io, .{ .sub_path = "a", .data = "" });
    try folder.dir.writeFile(io, .{ .sub_path = "b", .data = "" });
    try folder.dir.hardLink("a", folder.dir, "hard", io, .{});
    try folder.dir.symLink(io, "a", "soft", .{});
    var identities: [4]?Identity = undefined;
    for (&identities, [_][]const u8{ "a", "b", "hard", "soft" }) |*identity, name| {
        const file = try folder.dir.openFile(io, name, .{});
        defer file.close(io);
        identity.* = .of(file.handle);
    }
    try std.testing.expect(Identity.eql(identities[0], identities[2]));
    try std.testing.expect(Identity.eql(identities[0], identities[3]));
    try std.testing.expect(!Identity.eql(identities[0], identities[1]));
    try std.testing.expect(!Identity.eql(null, null));
    try std.testing.expectEqual(null, Identity.of(-1));
}
