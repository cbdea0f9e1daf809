//! The program that fuzzes: `fuzz TARGET [--time S] [--iterations N] [--seed N] [--keep FOLDER]
//! [FILE...]`.
//!
//! In: the name of a target; how long, by the processor's time or executions; or files to run once
//! each. Out: a line of figures now and then, and at the end; the input of a finding as a file,
//! and exit code 1. With --keep, the corpus is read from a folder and written there, so that
//! another run goes on where this one ended.

const std = @import("std");
const Allocator = std.mem.Allocator;
const Io = std.Io;
const campaign_file = @import("campaign.zig");
const Name = @import("names.zig").Name;
const targets = @import("targets.zig");
const watch = @import("watch.zig");
const Campaign = campaign_file.Campaign;

/// Where findings go; in the folder that `zig build` writes to.
const findings_folder = "zig-out/fuzz/";
/// Processor seconds that one execution may take, before it is a hang.
const execution_s_max = 20;
/// Processor seconds from one line of figures to the next.
const report_period_s = 60;

const usage = "usage: fuzz TARGET [--time SECONDS] [--iterations N] [--seed N] " ++
    "[--keep FOLDER] [FILE...]\n";

const Choices = struct {
    target: *const targets.Target,
    time_s: u64 = 60,
    iterations: u64 = std.math.maxInt(u64),
    seed: u64 = 0,
    keep: ?[]const u8 = null,
    files: []const []const u8 = &.{},
};

pub fn main(init: std.process.Init) !u8 {
    const arena = init.arena.allocator();
    const arguments = try init.minimal.args.toSlice(arena);
    const choices = try choicesOf(arena, arguments[1..]) orelse {
        std.debug.print(usage ++ "targets:", .{});
        for (targets.list) |target| std.debug.print(" {t}", .{target.name});
        std.debug.print("\n", .{});
        return 2;
    };
    const cwd: Io.Dir = .cwd();
    try cwd.createDirPath(init.io, findings_folder ++ "beside");
    // Inputs may name what is in it, and only that.
    var folder = try cwd.openDir(init.io, findings_folder ++ "beside", .{});
    defer folder.close(init.io);
    try campaign_file.fill(folder, init.io);
    watch.start(findings_folder, execution_s_max);
    // Not the one that looks for leaks: the campaign does, and what it allocates is its own.
    const gpa = std.heap.smp_allocator;
    var campaign: Campaign = try .init(
        choices.target,
        gpa,
        init.io,
        folder,
        counters(),
        choices.seed,
    );
    defer campaign.deinit();
    if (choices.files.len > 0) return runFiles(arena, &campaign, choices.files);
    fuzz(arena, &campaign, &choices) catch |err| switch (err) {
        error.Contradiction, error.Leaked => {
            tell(&campaign, &choices);
            return 1;
        },
        else => return err,
    };
    tell(&campaign, &choices);
    return 0;
}

fn choicesOf(arena: Allocator, arguments: []const [:0]const u8) !?Choices {
    if (arguments.len == 0) return null;
    const name = std.meta.stringToEnum(Name, arguments[0]) orelse return null;
    var choices: Choices = .{ .target = targets.named(name) orelse return null };
    var files: std.ArrayList([]const u8) = .empty;
    var index: usize = 1;
    while (index < arguments.len) : (index += 1) {
        const option = std.mem.cutPrefix(u8, arguments[index], "--") orelse {
            try files.append(arena, arguments[index]);
            continue;
        };
        index += 1;
        if (index == arguments.len) return null;
        const value = arguments[index];
        if (std.mem.eql(u8, option, "keep")) {
            choices.keep = value;
            continue;
        }
        const number = std.fmt.parseInt(u64, value, 10) catch return null;
        if (std.mem.eql(u8, option, "time")) {
            choices.time_s = number;
        } else if (std.mem.eql(u8, option, "iterations")) {
            choices.iterations = number;
        } else if (std.mem.eql(u8, option, "seed")) {
            choices.seed = number;
        } else return null;
    }
    choices.files = files.items;
    return choices;
}

/// Those that LLVM has put into the code of the library, C and C++ among it.
fn counters() []u8 {
    const start = @extern([*]u8, .{
        .name = "__start___sancov_cntrs",
        .linkage = .weak,
    }) orelse return &.{};
    const end = @extern([*]u8, .{
        .name = "__stop___sancov_cntrs",
        .linkage = .weak,
    }) orelse return &.{};
    return start[0 .. end - start];
}

fn fuzz(arena: Allocator, campaign: *Campaign, choices: *const Choices) !void {
    const io = campaign.io;
    for (try campaign_file.seedsOf(arena, io, choices.target)) |seed| try campaign.addSeed(seed);
    if (choices.keep) |path| {
        var kept: std.ArrayList([]const u8) = .empty;
        try campaign_file.addFolder(arena, io, &kept, path, "");
        for (kept.items) |input| try campaign.addSeed(input);
        campaign.kept_in = try Io.Dir.cwd().createDirPathOpen(io, path, .{});
    }
    defer if (campaign.kept_in) |folder| folder.close(io);
    const first = campaign.execution_count;
    var told_s: u64 = 0;
    while (campaign.execution_count - first < choices.iterations) {
        try campaign.step();
        if (campaign.execution_count % 64 != 0) continue;
        const spent_s = secondsOf(io);
        if (spent_s >= choices.time_s) return;
        if (spent_s < told_s + report_period_s) continue;
        told_s = spent_s;
        tell(campaign, choices);
    }
}

/// The processor's, of this process.
fn secondsOf(io: Io) u64 {
    const now = Io.Clock.cpu_process.now(io);
    return @intCast(@divTrunc(now.nanoseconds, std.time.ns_per_s));
}

fn tell(campaign: *const Campaign, choices: *const Choices) void {
    std.debug.print(
        "{t}: {d} executions in {d} s, {d} read, {d} refused, {d} out of memory, corpus {d}, " ++
            "{d} of {d} edges, the latest at {d}, the latest new count of one at {d}, seed {d}\n",
        .{
            choices.target.name,
            campaign.execution_count,
            secondsOf(campaign.io),
            campaign.outcomes.get(.read),
            campaign.outcomes.get(.refused),
            campaign.outcomes.get(.out_of_memory),
            campaign.corpus.items.len,
            campaign.coverage.edge_count,
            campaign.coverage.counters.len,
            campaign.edge_at,
            campaign.news_at,
            choices.seed,
        },
    );
}

fn runFiles(arena: Allocator, campaign: *Campaign, files: []const []const u8) !u8 {
    const cwd: Io.Dir = .cwd();
    for (files) |path| {
        const input = try cwd.readFileAlloc(campaign.io, path, arena, .limited(1 << 30));
        for ([_]bool{ false, true }) |guarded| {
            const before = campaign.outcomes;
            _ = campaign.execute(input, .{ .guarded = guarded, .draws = true }) catch |err|
                switch (err) {
                    error.Contradiction, error.Leaked => {
                        std.debug.print("{s}: {t}\n", .{ path, err });
                        return 1;
                    },
                    else => return err,
                };
            if (guarded) continue;
            for (std.enums.values(targets.Outcome)) |outcome| {
                if (campaign.outcomes.get(outcome) != before.get(outcome))
                    std.debug.print("{s}: {t}\n", .{ path, outcome });
            }
        }
    }
    return 0;
}
