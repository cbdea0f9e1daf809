//! Seccomp, from Linux 3.17: a filter of system calls, as a program of classic BPF that the kernel
//! runs before each.
//!
//! It is a list of what is denied, not of what is allowed. What a libc calls changes with its
//! version and with what the kernel answers (clone3 before clone, statx before fstat, 64-bit times
//! on 32-bit machines), and a picture that fails after hours because of a harmless call that nobody
//! has met is worse than a harmless call. The list is complete all the same, for it ends: calls
//! newer than those that it was made of get ENOSYS, as on an older kernel, and so does every call
//! of another architecture (i386 and x32 on x86-64, ARM on AArch64). Denied is what reaches out of
//! the process or makes another, changes files in ways that Landlock does not know, changes the
//! machine, or has a record of holes in the kernel and no use here. Nothing ends the process: a
//! call that is denied returns EPERM, one that has an older sibling ENOSYS, for libc to take that.
//!
//! Source: Linux, userspace-api/seccomp_filter.rst; numbers of calls by std.

const std = @import("std");
const builtin = @import("builtin");
const linux = std.os.linux;
const SYS = linux.SYS;

/// What AUDIT_ARCH_* calls the machine: its number in ELF files, and flags for 64 bits and the
/// order of bytes. Null: there is no filter for it.
const architecture: ?u32 = switch (builtin.cpu.arch) {
    .x86_64 => 62 | 0xc000_0000,
    .aarch64 => 183 | 0xc000_0000,
    .arm => 40 | 0x4000_0000,
    else => null,
};

/// Whether the kernel has it. Not under qemu-user, which keeps filters from programs, for a filter
/// would be of its own calls: it answers as a kernel without.
pub fn isAvailable() bool {
    if (architecture == null) return false;
    const answer = linux.prctl(@backingInt(linux.PR.GET_SECCOMP), 0, 0, 0, 0);
    return linux.errno(answer) == .SUCCESS;
}

/// Puts the filter before all threads of the process, for good; false: the system does not. The
/// thread must have given up new privileges.
pub fn install() bool {
    var builder: Builder = .{};
    builder.build(@intCast(linux.getpid()));
    const program: Program = .{ .count = builder.count, .instructions = &builder.instructions };
    const flags = linux.SECCOMP.FILTER_FLAG.TSYNC;
    // With the flag, a thread that could not follow is the answer.
    return linux.seccomp(linux.SECCOMP.SET_MODE_FILTER, flags, &program) == 0;
}

/// Calls that are denied whatever is asked for.
const denied = network ++ processes ++ files ++ identity ++ machine ++ holes;

/// Network. Standard files that are sockets are read and written as files are.
const network = [_][]const u8{
    "socket",     "socketpair", "connect",  "bind",
    "listen",     "accept",     "accept4",  "send",
    "sendto",     "sendmsg",    "sendmmsg", "recv",
    "recvfrom",   "recvmsg",    "recvmmsg", "recvmmsg_time64",
    "setsockopt", "shutdown",
};

/// Other processes, and what is shared with them; `clone` is among the conditions.
const processes = [_][]const u8{
    "execve",            "execveat",          "fork",              "vfork",
    "kill",              "rt_sigqueueinfo",   "rt_tgsigqueueinfo", "pidfd_open",
    "pidfd_getfd",       "pidfd_send_signal", "ptrace",            "process_vm_readv",
    "process_vm_writev", "process_madvise",   "process_mrelease",  "kcmp",
    "migrate_pages",     "move_pages",        "setpriority",       "ioprio_set",
    "sched_setaffinity", "sched_setattr",     "sched_setparam",    "sched_setscheduler",
    "shmget",            "shmat",             "shmctl",            "shmdt",
    "semget",            "semop",             "semctl",            "semtimedop",
    "semtimedop_time64", "msgget",            "msgsnd",            "msgrcv",
    "msgctl",            "mq_open",           "mq_unlink",
};

/// Files, where Landlock does not look, and ways around names. `fchmod` stays.
const files = [_][]const u8{
    "chmod",             "fchmodat",          "fchmodat2",     "chown",
    "chown32",           "fchown",            "fchown32",      "lchown",
    "lchown32",          "fchownat",          "setxattr",      "lsetxattr",
    "fsetxattr",         "setxattrat",        "removexattr",   "lremovexattr",
    "fremovexattr",      "removexattrat",     "file_setattr",  "utime",
    "utimes",            "futimesat",         "utimensat",     "utimensat_time64",
    "truncate",          "truncate64",        "link",          "linkat",
    "symlink",           "symlinkat",         "mknod",         "mknodat",
    "name_to_handle_at", "open_by_handle_at", "fanotify_init", "fanotify_mark",
};

/// Who the process is, and where.
const identity = [_][]const u8{
    "setuid",            "setuid32",    "setgid",     "setgid32",
    "setreuid",          "setreuid32",  "setregid",   "setregid32",
    "setresuid",         "setresuid32", "setresgid",  "setresgid32",
    "setgroups",         "setgroups32", "setfsuid",   "setfsuid32",
    "setfsgid",          "setfsgid32",  "capset",     "setns",
    "unshare",           "chroot",      "pivot_root", "personality",
    "lsm_set_self_attr",
};

/// The machine.
const machine = [_][]const u8{
    "mount",           "umount2",        "move_mount",      "mount_setattr",
    "open_tree",       "open_tree_attr", "fsopen",          "fsconfig",
    "fsmount",         "fspick",         "swapon",          "swapoff",
    "quotactl",        "quotactl_fd",    "reboot",          "kexec_load",
    "kexec_file_load", "init_module",    "finit_module",    "delete_module",
    "acct",            "syslog",         "vhangup",         "sethostname",
    "setdomainname",   "settimeofday",   "clock_settime",   "clock_settime64",
    "adjtimex",        "clock_adjtime",  "clock_adjtime64", "iopl",
    "ioperm",          "modify_ldt",
};

/// Parts of the kernel that have often been a way into it.
const holes = [_][]const u8{
    "keyctl",          "add_key",     "request_key", "bpf",
    "perf_event_open", "userfaultfd", "vmsplice",    "memfd_secret",
    "io_setup",        "io_submit",   "io_cancel",   "io_destroy",
};

/// Calls that there are not, so that what has a way without them takes it.
const missing = [_][]const u8{
    // Its flags are in memory, where no filter looks; libc falls back on `clone`.
    "clone3",
    "io_uring_setup",
    "io_uring_enter",
    "io_uring_register",
};

/// Calls that are denied by one of their arguments, of which the low 32 bits count, as they do for
/// the kernel.
const Condition = struct {
    calls: []const []const u8,
    argument: u8,
    denied_if: enum { equal, other, with_bits, without_bits },
    value: Value,

    const Value = union(enum) { number: u32, process_id };
};

const protection_exec = 4;
const tiocsti = 0x5412;
const tioclinux = 0x541c;

const conditions = [_]Condition{
    .{
        .calls = &.{"clone"},
        .argument = 0,
        .denied_if = .without_bits,
        .value = .{ .number = linux.CLONE.THREAD },
    },
    // No machine code but the program's.
    .{
        .calls = &.{ "mmap", "mmap2", "mprotect", "pkey_mprotect" },
        .argument = 2,
        .denied_if = .with_bits,
        .value = .{ .number = protection_exec },
    },
    // Typing in the name of whoever sits at the terminal.
    .{
        .calls = &.{"ioctl"},
        .argument = 1,
        .denied_if = .equal,
        .value = .{ .number = tiocsti },
    },
    .{
        .calls = &.{"ioctl"},
        .argument = 1,
        .denied_if = .equal,
        .value = .{ .number = tioclinux },
    },
    // Threads of others, and limits of others.
    .{ .calls = &.{"tgkill"}, .argument = 0, .denied_if = .other, .value = .process_id },
    .{
        .calls = &.{"prlimit64"},
        .argument = 0,
        .denied_if = .other,
        .value = .{ .number = 0 },
    },
};

/// The number of a call; null: the architecture has none of this name.
fn numberOf(comptime name: []const u8) ?u32 {
    return if (@hasField(SYS, name)) @intCast(@backingInt(@field(SYS, name))) else null;
}

fn numbersOf(comptime names: []const []const u8) []const u32 {
    comptime {
        @setEvalBranchQuota(100_000);
        var numbers: []const u32 = &.{};
        for (names) |name| if (numberOf(name)) |number| {
            numbers = numbers ++ .{number};
        };
        return numbers;
    }
}

/// Where ARM's own calls begin: of its caches and the thread's pointer.
const private_first = 0xf0000;

/// The newest call that is known here.
const number_last: u32 = last: {
    @setEvalBranchQuota(100_000);
    var last: u32 = 0;
    for (std.enums.values(SYS)) |call| {
        if (@backingInt(call) < private_first) last = @max(last, @backingInt(call));
    }
    break :last last;
};

const instruction_count_max = 512;

/// struct sock_filter.
const Instruction = extern struct {
    code: Code,
    skipped_if_true: u8 = 0,
    skipped_if_false: u8 = 0,
    operand: u32,

    const Code = enum(u16) {
        load_word = 0x20,
        jump_equal = 0x15,
        jump_greater = 0x25,
        jump_greater_equal = 0x35,
        jump_bits = 0x45,
        answer = 0x06,
    };
};

/// struct sock_fprog.
const Program = extern struct { count: u16, instructions: [*]const Instruction };

const Builder = struct {
    instructions: [instruction_count_max]Instruction = undefined,
    count: u16 = 0,

    const allow = linux.SECCOMP.RET.ALLOW;

    fn deny(err: linux.E) u32 {
        return linux.SECCOMP.RET.ERRNO | @as(u32, @backingInt(err));
    }

    fn add(builder: *Builder, instruction: Instruction) void {
        builder.instructions[builder.count] = instruction;
        builder.count += 1;
    }

    fn answer(builder: *Builder, value: u32) void {
        builder.add(.{ .code = .answer, .operand = value });
    }

    /// Goes on to the next instruction where the test holds, else jumps over it.
    fn when(builder: *Builder, code: Instruction.Code, operand: u32) void {
        builder.add(.{ .code = code, .skipped_if_false = 1, .operand = operand });
    }

    /// The other way round.
    fn unless(builder: *Builder, code: Instruction.Code, operand: u32) void {
        builder.add(.{ .code = code, .skipped_if_true = 1, .operand = operand });
    }

    fn load(builder: *Builder, offset: u32) void {
        builder.add(.{ .code = .load_word, .operand = offset });
    }

    fn build(builder: *Builder, process: u32) void {
        builder.load(@offsetOf(linux.SECCOMP.data, "arch"));
        builder.unless(.jump_equal, architecture.?);
        builder.answer(deny(.NOSYS));
        builder.load(@offsetOf(linux.SECCOMP.data, "nr"));
        if (builtin.cpu.arch == .arm) {
            builder.when(.jump_greater_equal, private_first);
            builder.answer(allow);
        }
        builder.when(.jump_greater, number_last);
        builder.answer(deny(.NOSYS));
        inline for (.{ .{ denied, .PERM }, .{ missing, .NOSYS } }) |list| {
            for (comptime numbersOf(&list[0])) |number| {
                builder.when(.jump_equal, number);
                builder.answer(deny(list[1]));
            }
        }
        inline for (conditions) |condition| {
            const value = switch (condition.value) {
                .number => |number| number,
                .process_id => process,
            };
            const index = condition.argument;
            for (comptime numbersOf(condition.calls)) |number|
                builder.addCondition(number, index, condition.denied_if, value);
        }
        builder.answer(allow);
    }

    /// What is not denied goes on with the number.
    fn addCondition(
        builder: *Builder,
        number: u32,
        argument: u32,
        denied_if: @FieldType(Condition, "denied_if"),
        value: u32,
    ) void {
        comptime std.debug.assert(builtin.cpu.arch.endian() == .little);
        builder.add(.{ .code = .jump_equal, .skipped_if_false = 4, .operand = number });
        builder.load(@offsetOf(linux.SECCOMP.data, "arg0") + @sizeOf(u64) * argument);
        switch (denied_if) {
            .equal => builder.when(.jump_equal, value),
            .other => builder.unless(.jump_equal, value),
            .with_bits => builder.when(.jump_bits, value),
            .without_bits => builder.unless(.jump_bits, value),
        }
        builder.answer(deny(.PERM));
        builder.load(@offsetOf(linux.SECCOMP.data, "nr"));
    }

    /// What the kernel would answer, by the program.
    fn judge(builder: *const Builder, data: *const linux.SECCOMP.data) u32 {
        const bytes: *const [@sizeOf(linux.SECCOMP.data)]u8 = @ptrCast(data);
        var place: usize = 0;
        var word: u32 = 0;
        while (true) : (place += 1) {
            const each = &builder.instructions[place];
            const holds = switch (each.code) {
                .load_word => {
                    word = std.mem.readInt(u32, bytes[each.operand..][0..4], .little);
                    continue;
                },
                .answer => return each.operand,
                .jump_equal => word == each.operand,
                .jump_greater => word > each.operand,
                .jump_greater_equal => word >= each.operand,
                .jump_bits => word & each.operand != 0,
            };
            place += if (holds) each.skipped_if_true else each.skipped_if_false;
        }
    }
};

test "each name is that of a call somewhere" {
    @setEvalBranchQuota(1_000_000);
    const calls = linux.syscalls;
    inline for (denied ++ missing) |name| {
        const is_there = @hasField(calls.X64, name) or @hasField(calls.Arm, name) or
            @hasField(calls.Arm64, name);
        if (!is_there) @compileError(name);
    }
}

test "the program answers by number, architecture and argument" {
    if (architecture == null) return error.SkipZigTest;
    var builder: Builder = .{};
    builder.build(77);
    const no = Builder.deny(.PERM);
    const none = Builder.deny(.NOSYS);
    const yes = Builder.allow;
    const high = 1 << 32;
    const Case = struct { u32, SYS, u64, u64, u64 };
    for ([_]Case{
        .{ yes, .read, 0, 0, 0 },
        .{ yes, .futex, 0, 0, 0 },
        .{ no, .socket, 1, 0, 0 },
        .{ no, .execve, 0, 0, 0 },
        .{ no, .io_destroy, 0, 0, 0 },
        .{ none, .clone3, 0, 0, 0 },
        .{ no, .clone, 17, 0, 0 },
        .{ yes, .clone, linux.CLONE.THREAD | linux.CLONE.VM, 0, 0 },
        .{ yes, .mprotect, 0, 0, 3 },
        .{ no, .mprotect, 0, 0, 5 },
        .{ yes, .ioctl, 0, 0x5413, 0 },
        .{ no, .ioctl, 0, 0x5412, 0 },
        .{ no, .ioctl, 0, 0x541c | high, 0 },
        .{ yes, .tgkill, 77, 0, 0 },
        .{ no, .tgkill, 78, 0, 0 },
        .{ yes, .prlimit64, 0, 0, 0 },
        .{ no, .prlimit64, 1, 0, 0 },
    }) |case| {
        var data: linux.SECCOMP.data = .{
            .nr = @intCast(@backingInt(case[1])),
            .arch = architecture.?,
            .instruction_pointer = 0,
            .arg0 = case[2],
            .arg1 = case[3],
            .arg2 = case[4],
            .arg3 = 0,
            .arg4 = 0,
            .arg5 = 0,
        };
        errdefer std.debug.print("{t}\n", .{case[1]});
        try std.testing.expectEqual(case[0], builder.judge(&data));
        data.arch ^= 1;
        try std.testing.expectEqual(none, builder.judge(&data));
    }
    var newer = std.mem.zeroInit(linux.SECCOMP.data, .{
        .nr = number_last + 1,
        .arch = architecture.?,
    });
    try std.testing.expectEqual(none, builder.judge(&newer));
    newer.nr = private_first + 5;
    const is_arm = builtin.cpu.arch == .arm;
    try std.testing.expectEqual(if (is_arm) yes else none, builder.judge(&newer));
}
