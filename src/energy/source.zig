//! Where energy readings come from, and how one is read.
//!
//! In: files of the kernel or the output of a command. Out: for each rail (a supply that is metered
//! by itself) either a counter of microjoules or the power of this moment in watts. What the files
//! hold is not trusted: anything but a plausible number is an error that names the file.

const std = @import("std");
const Diagnostic = @import("../diagnostic.zig").Diagnostic;
const printable = @import("../diagnostic.zig").printable;
const Allocator = std.mem.Allocator;
const Io = std.Io;

/// Supplies of one source at most.
pub const rail_count_max = 32;
/// No machine that this is for draws more, in watts: a reading above it is garbage.
pub const power_w_max = 1e6;
/// Longest that a command may take for one reading, in seconds.
const command_s_max = 5;
/// Bytes of a command's output at most.
const command_bytes_max = 16 << 10;

pub const Error = error{Unreadable};

/// What one rail says at one moment.
pub const Reading = union(enum) {
    /// Energy since some moment in the past, in microjoules.
    counter_uj: u64,
    /// In watts, at least 0.
    power_w: f64,
};

/// One supply that is metered by itself.
pub const Rail = struct {
    /// For reports: a file or a command.
    name: []const u8,
    access: Access,

    pub const Access = union(enum) {
        /// A file that counts microjoules and starts again at 0 after `range_uj`; 0: unknown.
        counter: struct { path: []const u8, range_uj: u64 },
        /// A file with microwatts.
        power: []const u8,
        /// Two files whose product times `watts_per_unit` is the power; the sign of a current
        /// that flows out of a battery is a matter of the driver.
        product: struct { voltage: []const u8, current: []const u8, watts_per_unit: f64 },
        /// A shell command that prints one number and its unit: see `parseCommand`.
        command: []const u8,
        /// `vcgencmd pmic_read_adc` of the Raspberry Pi 5.
        pmic,
    };

    /// Where a counter starts again, in microjoules; 0 where that is not known.
    pub fn rangeUj(rail: *const Rail) u64 {
        return switch (rail.access) {
            .counter => |counter| counter.range_uj,
            else => 0,
        };
    }

    /// Reads the rail now. On an error the diagnostic says what is wrong with which file.
    pub fn read(
        rail: *const Rail,
        gpa: Allocator,
        io: Io,
        diagnostic: *Diagnostic,
    ) Error!Reading {
        switch (rail.access) {
            .counter => |counter| {
                const value = try readInteger(io, counter.path, diagnostic);
                if (value < 0 or (counter.range_uj > 0 and value > counter.range_uj))
                    return unreadable(diagnostic, counter.path, "a counter beyond its range");
                return .{ .counter_uj = @intCast(value) };
            },
            .power => |path| {
                const value = try readInteger(io, path, diagnostic);
                return plausible(float(value) * 1e-6, path, diagnostic);
            },
            .product => |files| {
                const voltage = try readInteger(io, files.voltage, diagnostic);
                const current = try readInteger(io, files.current, diagnostic);
                const product = @abs(float(voltage) * float(current)) * files.watts_per_unit;
                return plausible(product, files.current, diagnostic);
            },
            .command => |command| {
                const output = try outputOf(gpa, io, &.{ "/bin/sh", "-c", command }, diagnostic);
                defer gpa.free(output);
                const reading = parseCommand(output) orelse
                    return unreadable(diagnostic, command, "not a number of W or J");
                if (reading == .power_w) return plausible(reading.power_w, command, diagnostic);
                return reading;
            },
            .pmic => {
                const words = [_][]const u8{ "vcgencmd", "pmic_read_adc" };
                const output = try outputOf(gpa, io, &words, diagnostic);
                defer gpa.free(output);
                const power_w = parsePmic(output) orelse
                    return unreadable(diagnostic, "vcgencmd pmic_read_adc", "no rails");
                return plausible(power_w, "vcgencmd pmic_read_adc", diagnostic);
            },
        }
    }
};

/// A way of measuring that was found to work.
pub const Source = struct {
    /// As in `--json`: powercap, hwmon, pmic, power_supply or command.
    name: []const u8,
    /// What is metered, for people.
    scope: []const u8,
    /// 1..`rail_count_max`; their sum is what counts.
    rails: []const Rail,
    /// Between two readings, in milliseconds.
    period_ms: u32,
    /// Shortest stretch of work whose energy means something, in milliseconds: sensors of power
    /// are averages over a while.
    window_ms: u32,
};

fn plausible(power_w: f64, name: []const u8, diagnostic: *Diagnostic) Error!Reading {
    if (power_w >= 0 and power_w <= power_w_max) return .{ .power_w = power_w };
    return unreadable(diagnostic, name, "not a plausible power");
}

fn unreadable(diagnostic: *Diagnostic, name: []const u8, what: []const u8) Error {
    return diagnostic.fail(error.Unreadable, "{f}: {s}", .{ printable(name), what });
}

/// A file that holds one integer and nothing else.
pub fn readInteger(io: Io, path: []const u8, diagnostic: *Diagnostic) Error!i64 {
    var buffer: [64]u8 = undefined;
    const text = try readText(io, path, &buffer, diagnostic);
    const digits = if (text.len > 0 and text[0] == '-') text[1..] else text;
    for (digits) |byte| if (!std.ascii.isDigit(byte))
        return unreadable(diagnostic, path, "not a number");
    return std.fmt.parseInt(i64, text, 10) catch
        unreadable(diagnostic, path, if (digits.len == 0) "empty" else "not a plausible number");
}

/// The first bytes of a file such as those of the kernel, whose length is not known before. By
/// positions: the standard library's `readFile` asks for ever at the end of them on 32-bit ARM.
pub fn readSystemFile(
    io: Io,
    path: []const u8,
    buffer: []u8,
) (Io.File.OpenError || Io.File.ReadPositionalError)![]u8 {
    const file = try Io.Dir.cwd().openFile(io, path, .{});
    defer file.close(io);
    return buffer[0..try file.readPositionalAll(io, buffer, 0)];
}

/// The words of a small file, without white space around them.
pub fn readText(
    io: Io,
    path: []const u8,
    buffer: []u8,
    diagnostic: *Diagnostic,
) Error![]const u8 {
    const bytes = readSystemFile(io, path, buffer) catch |err| {
        return unreadable(diagnostic, path, switch (err) {
            error.FileNotFound, error.NotDir => "is not there",
            error.AccessDenied, error.PermissionDenied => "may be read by root only",
            else => "cannot be read",
        });
    };
    if (bytes.len == buffer.len) return unreadable(diagnostic, path, "too long");
    return std.mem.trim(u8, bytes, " \t\r\n\x00");
}

/// What a command prints, for the caller to free.
fn outputOf(
    gpa: Allocator,
    io: Io,
    words: []const []const u8,
    diagnostic: *Diagnostic,
) Error![]u8 {
    const name = words[words.len - 1];
    const result = std.process.run(gpa, io, .{
        .argv = words,
        .stdout_limit = .limited(command_bytes_max),
        .stderr_limit = .limited(command_bytes_max),
        .timeout = .{ .duration = .{ .raw = .fromSeconds(command_s_max), .clock = .awake } },
    }) catch |err| return unreadable(diagnostic, name, switch (err) {
        error.Timeout => "takes too long",
        error.StreamTooLong => "says too much",
        else => "cannot be run",
    });
    gpa.free(result.stderr);
    if (result.term == .exited and result.term.exited == 0) return result.stdout;
    gpa.free(result.stdout);
    return unreadable(diagnostic, name, "fails");
}

/// The first line of a command: a number and W, mW or uW for the power of this moment, or J, mJ or
/// uJ for a counter that never falls. A number alone is watts.
pub fn parseCommand(output: []const u8) ?Reading {
    const line = std.mem.trim(u8, output[0 .. std.mem.findScalar(u8, output, '\n') orelse
        output.len], " \t\r");
    var end: usize = 0;
    while (end < line.len and (std.ascii.isDigit(line[end]) or line[end] == '.')) end += 1;
    const value = std.fmt.parseFloat(f64, line[0..end]) catch return null;
    const unit = std.mem.trimStart(u8, line[end..], " \t");
    const Unit = enum { W, mW, uW, J, mJ, uJ };
    switch (if (unit.len == 0) .W else std.meta.stringToEnum(Unit, unit) orelse return null) {
        .W => return .{ .power_w = value },
        .mW => return .{ .power_w = value * 1e-3 },
        .uW => return .{ .power_w = value * 1e-6 },
        .J => return counterOf(value * 1e6),
        .mJ => return counterOf(value * 1e3),
        .uJ => return counterOf(value),
    }
}

fn counterOf(value_uj: f64) ?Reading {
    if (!(value_uj < 1 << 62)) return null;
    return .{ .counter_uj = @trunc(value_uj) };
}

/// The sum over the rails of a Raspberry Pi 5, in watts: lines `NAME_A current(0)=0.1A` and
/// `NAME_V volt(8)=3.7V`, paired by name. Null where there is no pair.
pub fn parsePmic(output: []const u8) ?f64 {
    var sum_w: f64 = 0;
    var is_pair_found = false;
    var lines = std.mem.splitScalar(u8, output, '\n');
    while (lines.next()) |line| {
        const current = pmicValue(line, "_A", 'A') orelse continue;
        var others = std.mem.splitScalar(u8, output, '\n');
        while (others.next()) |other| {
            const voltage = pmicValue(other, "_V", 'V') orelse continue;
            if (!std.mem.eql(u8, current.name, voltage.name)) continue;
            sum_w += current.value * voltage.value;
            is_pair_found = true;
            break;
        }
    }
    return if (is_pair_found) sum_w else null;
}

fn pmicValue(
    line: []const u8,
    suffix: []const u8,
    unit: u8,
) ?struct { name: []const u8, value: f64 } {
    const trimmed = std.mem.trim(u8, line, " \t\r");
    const space = std.mem.findScalar(u8, trimmed, ' ') orelse return null;
    const name = std.mem.cutSuffix(u8, trimmed[0..space], suffix) orelse return null;
    const equals = std.mem.findScalar(u8, trimmed, '=') orelse return null;
    if (trimmed[trimmed.len - 1] != unit or equals + 1 >= trimmed.len - 1) return null;
    const value = std.fmt.parseFloat(f64, trimmed[equals + 1 .. trimmed.len - 1]) catch return null;
    return if (std.math.isFinite(value)) .{ .name = name, .value = value } else null;
}

fn float(value: i64) f64 {
    return @floatFromInt(value);
}

test "a command says watts or joules in its first line" {
    const Case = struct { []const u8, ?Reading };
    for ([_]Case{
        .{ "5\n", .{ .power_w = 5 } },
        .{ " 5.25 W\nmore\n", .{ .power_w = 5.25 } },
        .{ "250mW", .{ .power_w = 0.25 } },
        .{ "12.5 J", .{ .counter_uj = 12_500_000 } },
        .{ "7 uJ", .{ .counter_uj = 7 } },
        .{ "", null },
        .{ "W", null },
        .{ "nan", null },
        .{ "-5 W", null },
        .{ "1e3 W", null },
        .{ "5 V", null },
        .{ "99999999999999999999999 J", null },
    }) |case| try std.testing.expectEqual(case[1], parseCommand(case[0]));
}

test "the rails of a Raspberry Pi 5 are paired by name and added" {
    const text =
        \\ 3V7_WL_SW_A current(0)=0.10000000A
        \\   VDD_CORE_A current(7)=2.00000000A
        \\ 3V7_WL_SW_V volt(8)=3.70000000V
        \\   VDD_CORE_V volt(15)=0.90000000V
        \\     EXT5V_V volt(24)=5.10000000V
    ;
    try std.testing.expectApproxEqRel(0.1 * 3.7 + 2.0 * 0.9, parsePmic(text).?, 1e-12);
    try std.testing.expectEqual(null, parsePmic("VDD_CORE_A current(7)=2.0A"));
    const garbage = "VDD_A current(7)=A\nVDD_V volt(1)=nanV\n= _A A\n";
    try std.testing.expectEqual(null, parsePmic(garbage));
    try std.testing.expectEqual(null, parsePmic(""));
}

test "files that hold no plausible number are named" {
    var folder = std.testing.tmpDir(.{});
    defer folder.cleanup();
    const io = std.testing.io;
    const gpa = std.testing.allocator;
    const path = try gpa.print(".zig-cache/tmp/{s}/value", .{folder.sub_path});
    defer gpa.free(path);
    const rail: Rail = .{ .name = path, .access = .{ .power = path } };
    const Case = struct { []const u8, []const u8 };
    for ([_]Case{
        .{ "", "empty" },
        .{ "garbage\n", "not a number" },
        .{ "1 2", "not a number" },
        .{ "0x10", "not a number" },
        .{ "-5\n", "not a plausible power" },
        .{ "9223372036854775807", "not a plausible power" },
        .{ "99999999999999999999999999", "not a plausible number" },
        .{ &@as([64]u8, @splat('1')), "too long" },
    }) |case| {
        try folder.dir.writeFile(io, .{ .sub_path = "value", .data = case[0] });
        var diagnostic: Diagnostic = .{};
        try std.testing.expectError(error.Unreadable, rail.read(gpa, io, &diagnostic));
        errdefer std.debug.print("{s}\n", .{diagnostic.message.text()});
        try std.testing.expectStringEndsWith(diagnostic.message.text(), case[1]);
        try std.testing.expectStringStartsWith(diagnostic.message.text(), path);
    }
    try folder.dir.writeFile(io, .{ .sub_path = "value", .data = "5250000\n" });
    var diagnostic: Diagnostic = .{};
    try std.testing.expectEqual(5.25, (try rail.read(gpa, io, &diagnostic)).power_w);
    try folder.dir.deleteFile(io, "value");
    try std.testing.expectError(error.Unreadable, rail.read(gpa, io, &diagnostic));
    try std.testing.expectStringEndsWith(diagnostic.message.text(), "is not there");
}

test "commands that fail, hang on to nothing or say too much are errors" {
    const io = std.testing.io;
    const gpa = std.testing.allocator;
    for ([_][2][]const u8{
        .{ "exit 3", "fails" },
        .{ "kill -9 $$", "fails" },
        .{ "yes", "says too much" },
        .{ "echo ten watts", "not a number of W or J" },
        .{ "echo 9999999999 W", "not a plausible power" },
    }) |case| {
        const rail: Rail = .{ .name = case[0], .access = .{ .command = case[0] } };
        var diagnostic: Diagnostic = .{};
        try std.testing.expectError(error.Unreadable, rail.read(gpa, io, &diagnostic));
        errdefer std.debug.print("{s}\n", .{diagnostic.message.text()});
        try std.testing.expectStringEndsWith(diagnostic.message.text(), case[1]);
    }
    const rail: Rail = .{ .name = "", .access = .{ .command = "echo 1.5 W" } };
    var diagnostic: Diagnostic = .{};
    try std.testing.expectEqual(1.5, (try rail.read(gpa, io, &diagnostic)).power_w);
}
