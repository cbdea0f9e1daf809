//! Finds what this machine can measure energy by.
//!
//! In: the folder that stands for `/sys`, or the user's command. Out: the first source that
//! answers, in the order command, powercap, hwmon, PMIC, battery (nearest to the processor first),
//! or one line that says for each why it does not.

const std = @import("std");
const source_file = @import("source.zig");
const Diagnostic = @import("../diagnostic.zig").Diagnostic;
const Allocator = std.mem.Allocator;
const Io = std.Io;
const Rail = source_file.Rail;
const Source = source_file.Source;

/// What the user asks for.
pub const Wanted = struct {
    /// Instead of `/sys`.
    root: []const u8 = "/sys",
    /// A shell command that measures: see `source.parseCommand`. It is the only source then.
    command: ?[]const u8 = null,
};

pub const Error = error{ OutOfMemory, NotMeasurable };

/// Finds a source and reads it once. What it refers to lives in `arena`. With
/// `error.NotMeasurable` the diagnostic says why there is none.
pub fn find(
    arena: Allocator,
    gpa: Allocator,
    io: Io,
    wanted: Wanted,
    diagnostic: *Diagnostic,
) Error!Source {
    var finder: Finder = .{ .arena = arena, .gpa = gpa, .io = io, .root = wanted.root };
    if (wanted.command) |command| {
        const rails = try arena.dupe(Rail, &.{.{
            .name = command,
            .access = .{ .command = command },
        }});
        if (try finder.accept(.{
            .name = "command",
            .scope = "what the command measures",
            .rails = rails,
            .period_ms = 100,
            .window_ms = 1000,
        })) |source| return source;
    } else {
        if (try finder.powercap()) |source| return source;
        if (try finder.hwmon()) |source| return source;
        if (try finder.pmic()) |source| return source;
        if (try finder.battery()) |source| return source;
    }
    return diagnostic.fail(error.NotMeasurable, "{s}", .{finder.reasons.written()});
}

/// Monitoring chips that meter a board or a processor, by the start of their names; those of
/// graphics cards, disks and the like would mislead.
const hwmon_names = [_][]const u8{
    "ina", "isl28022", "ltc29", "amd_energy", "power_meter", "scmi_sensors", "macsmc",
};
/// Labels of channels that include what the others of the same chip meter (Jetson, AMD, Apple).
const total_labels = [_][]const u8{ "VDD_IN", "POM_5V_IN", "SYS_VIN", "Total", "Esocket" };
const channel_count_max = 32;

/// Why each kind of source does not serve, one after the other.
const Reasons = struct {
    buffer: [diagnosticBytes]u8 = undefined,
    length: usize = 0,

    const diagnosticBytes = @import("../diagnostic.zig").message_bytes_max;

    fn written(reasons: *const Reasons) []const u8 {
        return reasons.buffer[0..reasons.length];
    }

    fn add(reasons: *Reasons, name: []const u8, text: []const u8) void {
        var writer: Io.Writer = .fixed(reasons.buffer[reasons.length..]);
        const separator = if (reasons.length > 0) "; " else "";
        writer.print("{s}{s}: {s}", .{ separator, name, text }) catch |err| switch (err) {
            error.WriteFailed => {}, // Full: the beginning is what matters.
        };
        reasons.length += writer.buffered().len;
    }
};

const Finder = struct {
    arena: Allocator,
    gpa: Allocator,
    io: Io,
    root: []const u8,
    reasons: Reasons = .{},

    const Found = error{OutOfMemory}!?Source;

    /// Null, with a reason, where a rail does not answer.
    fn accept(finder: *Finder, source: Source) Found {
        var diagnostic: Diagnostic = .{};
        for (source.rails) |*rail| {
            _ = rail.read(finder.gpa, finder.io, &diagnostic) catch {
                finder.reasons.add(source.name, diagnostic.message.text());
                return null;
            };
        }
        return source;
    }

    fn none(finder: *Finder, name: []const u8, reason: []const u8) ?Source {
        finder.reasons.add(name, reason);
        return null;
    }

    fn join(finder: *Finder, parts: []const []const u8) error{OutOfMemory}![]const u8 {
        return std.fs.path.join(finder.arena, parts);
    }

    /// Names in a folder of the root, sorted; none where it is not there.
    fn list(finder: *Finder, folder: []const u8) error{OutOfMemory}![]const []const u8 {
        const io = finder.io;
        const path = try finder.join(&.{ finder.root, folder });
        var directory = Io.Dir.cwd().openDir(io, path, .{ .iterate = true }) catch return &.{};
        defer directory.close(io);
        var names: std.ArrayList([]const u8) = .empty;
        var iterator = directory.iterate();
        while (iterator.next(io) catch null) |entry| {
            try names.append(finder.arena, try finder.arena.dupe(u8, entry.name));
        }
        std.mem.sort([]const u8, names.items, {}, lessThan);
        return names.items;
    }

    fn lessThan(_: void, a: []const u8, b: []const u8) bool {
        return std.mem.order(u8, a, b) == .lt;
    }

    /// A small file's text, or null where it cannot be read.
    fn text(finder: *Finder, path: []const u8) error{OutOfMemory}!?[]const u8 {
        var buffer: [256]u8 = undefined;
        var ignored: Diagnostic = .{};
        const words = source_file.readText(finder.io, path, &buffer, &ignored) catch return null;
        return try finder.arena.dupe(u8, words);
    }

    fn exists(finder: *Finder, path: []const u8) bool {
        Io.Dir.cwd().access(finder.io, path, .{}) catch return false;
        return true;
    }

    /// RAPL and its like: packages, and the memory of each where it is counted by itself. Zones
    /// within a package, the whole platform, and second ways to the same counters are left out.
    fn powercap(finder: *Finder) Found {
        const folder = "class/powercap";
        var rails: std.ArrayList(Rail) = .empty;
        for (try finder.list(folder)) |zone| {
            const depth = std.mem.countScalar(u8, zone, ':');
            if (depth == 0 or depth > 2 or std.mem.find(u8, zone, "mmio") != null) continue;
            const path = try finder.join(&.{ finder.root, folder, zone });
            const name = try finder.text(try finder.join(&.{ path, "name" })) orelse "";
            if (std.mem.eql(u8, name, "psys")) continue;
            if (depth == 2 and !std.mem.eql(u8, name, "dram")) continue;
            const counter = try finder.join(&.{ path, "energy_uj" });
            if (!finder.exists(counter) or rails.items.len == source_file.rail_count_max) continue;
            var ignored: Diagnostic = .{};
            const range_path = try finder.join(&.{ path, "max_energy_range_uj" });
            const range = source_file.readInteger(finder.io, range_path, &ignored) catch 0;
            try rails.append(finder.arena, .{
                .name = counter,
                .access = .{ .counter = .{
                    .path = counter,
                    .range_uj = @intCast(@max(range, 0)),
                } },
            });
        }
        if (rails.items.len == 0) return finder.none("powercap", "no zone");
        return finder.accept(.{
            .name = "powercap",
            .scope = "processor packages, with their memory where it has a counter",
            .rails = rails.items,
            .period_ms = 100,
            .window_ms = 100,
        });
    }

    /// Monitoring chips: energy, else power, else voltage times current.
    fn hwmon(finder: *Finder) Found {
        const folder = "class/hwmon";
        var rails: std.ArrayList(Rail) = .empty;
        for (try finder.list(folder)) |device| {
            const path = try finder.join(&.{ finder.root, folder, device });
            const name = try finder.text(try finder.join(&.{ path, "name" })) orelse continue;
            const is_known = for (hwmon_names) |start| {
                if (std.mem.startsWith(u8, name, start)) break true;
            } else false;
            if (is_known) try finder.addChip(path, &rails);
        }
        if (rails.items.len == 0) return finder.none("hwmon", "no sensor of power or energy");
        return finder.accept(.{
            .name = "hwmon",
            .scope = "what the board's sensors meter",
            .rails = rails.items,
            .period_ms = 20,
            .window_ms = 1000,
        });
    }

    fn addChip(
        finder: *Finder,
        path: []const u8,
        rails: *std.ArrayList(Rail),
    ) error{OutOfMemory}!void {
        const arena = finder.arena;
        // Of an INA3221, `in4` and `curr4` are something else than the first three.
        for ([_]struct { []const u8, []const u8, usize }{
            .{ "energy", "input", channel_count_max },
            .{ "power", "input", channel_count_max },
            .{ "power", "average", channel_count_max },
            .{ "curr", "input", 3 },
        }) |kind| {
            const prefix, const suffix, const last = kind;
            const first_rail = rails.items.len;
            var has_total = false;
            for (1..last + 1) |channel| {
                const file = try arena.print("{s}/{s}{d}_{s}", .{ path, prefix, channel, suffix });
                if (!finder.exists(file) or rails.items.len == source_file.rail_count_max) continue;
                const is_current = std.mem.eql(u8, prefix, "curr");
                const voltage = try arena.print("{s}/in{d}_input", .{ path, channel });
                if (is_current and !finder.exists(voltage)) continue;
                const label_prefix = if (is_current) "in" else prefix;
                const is_total = try finder.isTotal(path, label_prefix, channel);
                if (has_total and !is_total) continue;
                if (is_total and !has_total) rails.shrinkRetainingCapacity(first_rail);
                has_total = has_total or is_total;
                try rails.append(arena, .{
                    .name = file,
                    .access = if (is_current) .{
                        .product = .{
                            .voltage = voltage, // Millivolts and milliamperes.
                            .current = file,
                            .watts_per_unit = 1e-6,
                        },
                    } else if (std.mem.eql(u8, prefix, "energy")) .{
                        .counter = .{ .path = file, .range_uj = 0 },
                    } else .{ .power = file },
                });
            }
            if (rails.items.len > first_rail) return;
        }
    }

    fn isTotal(
        finder: *Finder,
        path: []const u8,
        prefix: []const u8,
        channel: usize,
    ) error{OutOfMemory}!bool {
        const file = try finder.arena.print("{s}/{s}{d}_label", .{ path, prefix, channel });
        const label = try finder.text(file) orelse return false;
        for (total_labels) |total| if (std.mem.startsWith(u8, label, total)) return true;
        return false;
    }

    /// The power management chip of the Raspberry Pi 5, through the firmware's own program.
    fn pmic(finder: *Finder) Found {
        const path = try finder.join(&.{ finder.root, "firmware/devicetree/base/model" });
        const model = try finder.text(path) orelse return finder.none("PMIC", "no Raspberry Pi 5");
        const has_pmic = for ([_][]const u8{
            "Raspberry Pi 5", "Raspberry Pi Compute Module 5",
        }) |start| {
            if (std.mem.startsWith(u8, model, start)) break true;
        } else false;
        if (!has_pmic) return finder.none("PMIC", "no Raspberry Pi 5");
        return finder.accept(.{
            .name = "pmic",
            .scope = "rails of the power management chip, without what hangs on 5 V",
            .rails = &.{.{ .name = "vcgencmd pmic_read_adc", .access = .pmic }},
            .period_ms = 50,
            .window_ms = 1000,
        });
    }

    /// A battery that feeds the machine: the thesis's method.
    fn battery(finder: *Finder) Found {
        const folder = "class/power_supply";
        var rails: std.ArrayList(Rail) = .empty;
        for (try finder.list(folder)) |supply| {
            const path = try finder.join(&.{ finder.root, folder, supply });
            const kind = try finder.text(try finder.join(&.{ path, "type" })) orelse continue;
            if (!std.mem.eql(u8, kind, "Battery")) continue;
            const scope = try finder.text(try finder.join(&.{ path, "scope" })) orelse "";
            if (std.mem.eql(u8, scope, "Device")) continue; // Of a mouse, say.
            const status = try finder.text(try finder.join(&.{ path, "status" })) orelse "";
            if (!std.mem.eql(u8, status, "Discharging"))
                return finder.none("power_supply", "the battery does not feed the machine now");
            const power = try finder.join(&.{ path, "power_now" });
            const voltage = try finder.join(&.{ path, "voltage_now" });
            const current = try finder.join(&.{ path, "current_now" });
            if (rails.items.len == source_file.rail_count_max) break;
            try rails.append(finder.arena, if (finder.exists(current)) .{
                .name = current,
                .access = .{
                    .product = .{
                        .voltage = voltage, // Microvolts and microamperes.
                        .current = current,
                        .watts_per_unit = 1e-12,
                    },
                },
            } else .{ .name = power, .access = .{ .power = power } });
        }
        if (rails.items.len == 0) return finder.none("power_supply", "no battery");
        return finder.accept(.{
            .name = "power_supply",
            .scope = "the whole machine, by its battery",
            .rails = rails.items,
            .period_ms = 50,
            .window_ms = 4000,
        });
    }
};

const testing = std.testing;

/// A tree that stands for `/sys`.
const Tree = struct {
    folder: testing.TmpDir,
    arena: std.heap.ArenaAllocator,

    fn init() Tree {
        return .{ .folder = testing.tmpDir(.{}), .arena = .init(testing.allocator) };
    }

    fn deinit(tree: *Tree) void {
        tree.arena.deinit();
        tree.folder.cleanup();
    }

    fn write(tree: *Tree, files: []const [2][]const u8) !void {
        for (files) |file| {
            try tree.folder.dir.createDirPath(testing.io, std.fs.path.dirname(file[0]).?);
            try tree.folder.dir.writeFile(testing.io, .{ .sub_path = file[0], .data = file[1] });
        }
    }

    fn find(tree: *Tree, diagnostic: *Diagnostic) Error!Source {
        const arena = tree.arena.allocator();
        const root = try arena.print(".zig-cache/tmp/{s}", .{tree.folder.sub_path});
        return discoverFind(arena, testing.allocator, testing.io, .{ .root = root }, diagnostic);
    }

    /// The sum of what the rails say, in watts.
    fn power(_: *Tree, source: *const Source) !f64 {
        var diagnostic: Diagnostic = .{};
        var sum_w: f64 = 0;
        for (source.rails) |*rail| {
            sum_w += (try rail.read(testing.allocator, testing.io, &diagnostic)).power_w;
        }
        return sum_w;
    }

    fn expectNone(tree: *Tree, needle: []const u8) !void {
        var diagnostic: Diagnostic = .{};
        try testing.expectError(error.NotMeasurable, tree.find(&diagnostic));
        errdefer std.debug.print("{s}\n", .{diagnostic.message.text()});
        try testing.expect(std.mem.find(u8, diagnostic.message.text(), needle) != null);
    }
};

const discoverFind = find;

test "where there is nothing, every kind of source says so" {
    var tree: Tree = .init();
    defer tree.deinit();
    const reasons = [_][]const u8{
        "powercap: no zone", "hwmon: no sensor", "PMIC: no", "supply: no battery",
    };
    for (reasons) |reason| try tree.expectNone(reason);
}

test "of RAPL the packages count and their memory, nothing twice" {
    var tree: Tree = .init();
    defer tree.deinit();
    const folder = "class/powercap/";
    try tree.write(&.{
        .{ folder ++ "intel-rapl/enabled", "1\n" },
        .{ folder ++ "intel-rapl:0/name", "package-0\n" },
        .{ folder ++ "intel-rapl:0/energy_uj", "123\n" },
        .{ folder ++ "intel-rapl:0/max_energy_range_uj", "262143328850\n" },
        .{ folder ++ "intel-rapl:0:0/name", "core\n" },
        .{ folder ++ "intel-rapl:0:0/energy_uj", "50\n" },
        .{ folder ++ "intel-rapl:0:1/name", "dram\n" },
        .{ folder ++ "intel-rapl:0:1/energy_uj", "7\n" },
        .{ folder ++ "intel-rapl:1/name", "psys\n" },
        .{ folder ++ "intel-rapl:1/energy_uj", "900\n" },
        .{ folder ++ "intel-rapl-mmio:0/name", "package-0\n" },
        .{ folder ++ "intel-rapl-mmio:0/energy_uj", "123\n" },
    });
    var diagnostic: Diagnostic = .{};
    const source = try tree.find(&diagnostic);
    try testing.expectEqualStrings("powercap", source.name);
    try testing.expectEqual(2, source.rails.len);
    try testing.expectEqual(262_143_328_850, source.rails[0].rangeUj());
    try testing.expectStringEndsWith(source.rails[1].name, "intel-rapl:0:1/energy_uj");
    // A counter above its own range is no counter.
    try tree.write(&.{.{ folder ++ "intel-rapl:0/energy_uj", "999999999999\n" }});
    try tree.expectNone("beyond its range");
    try tree.write(&.{.{ folder ++ "intel-rapl:0/energy_uj", "what?\n" }});
    try tree.expectNone("not a number");
}

test "of a Jetson the input counts, not the rails behind it; a disk's sensor does not" {
    var tree: Tree = .init();
    defer tree.deinit();
    const chip = "class/hwmon/hwmon1/";
    try tree.write(&.{
        .{ "class/hwmon/hwmon0/name", "nvme\n" },
        .{ "class/hwmon/hwmon0/power1_input", "9000000\n" },
        .{ chip ++ "name", "ina3221\n" },
        .{ chip ++ "in1_label", "VDD_CPU\n" },
        .{ chip ++ "in1_input", "5000\n" },
        .{ chip ++ "curr1_input", "400\n" },
        .{ chip ++ "in2_label", "VDD_IN\n" },
        .{ chip ++ "in2_input", "19000\n" },
        .{ chip ++ "curr2_input", "500\n" },
        .{ chip ++ "in4_input", "1\n" },
        .{ chip ++ "curr4_input", "1\n" },
    });
    var diagnostic: Diagnostic = .{};
    const source = try tree.find(&diagnostic);
    try testing.expectEqualStrings("hwmon", source.name);
    try testing.expectEqual(1, source.rails.len);
    try testing.expectApproxEqRel(9.5, try tree.power(&source), 1e-9);
}

test "an INA226 has its power itself" {
    var tree: Tree = .init();
    defer tree.deinit();
    const chip = "class/hwmon/hwmon3/";
    try tree.write(&.{
        .{ chip ++ "name", "ina226\n" },
        .{ chip ++ "in1_input", "5000\n" },
        .{ chip ++ "curr1_input", "400\n" },
        .{ chip ++ "power1_input", "2100000\n" },
    });
    var diagnostic: Diagnostic = .{};
    const source = try tree.find(&diagnostic);
    try testing.expectApproxEqRel(2.1, try tree.power(&source), 1e-9);
}

test "a battery counts while it feeds the machine, whatever its sign" {
    var tree: Tree = .init();
    defer tree.deinit();
    const battery = "class/power_supply/sbs-4-000b/";
    try tree.write(&.{
        .{ "class/power_supply/AC/type", "Mains\n" },
        .{ "class/power_supply/mouse/type", "Battery\n" },
        .{ "class/power_supply/mouse/scope", "Device\n" },
        .{ battery ++ "type", "Battery\n" },
        .{ battery ++ "status", "Charging\n" },
        .{ battery ++ "voltage_now", "7500000\n" },
        .{ battery ++ "current_now", "-800000\n" },
    });
    try tree.expectNone("does not feed");
    try tree.write(&.{.{ battery ++ "status", "Discharging\n" }});
    var diagnostic: Diagnostic = .{};
    const source = try tree.find(&diagnostic);
    try testing.expectEqualStrings("power_supply", source.name);
    try testing.expectApproxEqRel(6.0, try tree.power(&source), 1e-9);
    try tree.folder.dir.deleteFile(testing.io, battery ++ "voltage_now");
    try tree.expectNone("voltage_now: is not there");
}

test "a command is the only source, and has to work" {
    var arena: std.heap.ArenaAllocator = .init(testing.allocator);
    defer arena.deinit();
    var diagnostic: Diagnostic = .{};
    const gpa = testing.allocator;
    const io = testing.io;
    const source = try find(arena.allocator(), gpa, io, .{ .command = "echo 3 W" }, &diagnostic);
    try testing.expectEqualStrings("command", source.name);
    const wanted: Wanted = .{ .command = "false" };
    const none = find(arena.allocator(), gpa, io, wanted, &diagnostic);
    try testing.expectError(error.NotMeasurable, none);
    try testing.expectEqualStrings("command: false: fails", diagnostic.message.text());
}
