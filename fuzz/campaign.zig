//! Coverage-guided fuzzing of one target, in this process.
//!
//! In: a target, inputs to begin with, a seed. Out: executions. Each changes an input of the
//! corpus and runs it under an account of memory; what reaches new code joins the corpus. What is
//! left of the account afterwards is a leak. Same seed, same inputs, where nothing looks at time.

const std = @import("std");
const raylane = @import("raylane");
const Account = raylane.memory_account.Account;
const Allocator = std.mem.Allocator;
const Coverage = @import("coverage.zig").Coverage;
const Io = std.Io;
const Mutator = @import("mutate.zig").Mutator;
const guard = @import("guard.zig");
const targets = @import("targets.zig");
const watch = @import("watch.zig");

/// Memory of an execution.
pub const memory_bytes_max = 64 << 20;
/// One execution in so many has its blocks end at pages that nobody may touch.
const guarded_period = 8;
/// One in so many draws what it has read.
const drawn_period = 4;
/// Inputs of the corpus; more take the places of others.
const corpus_count_max = 1 << 14;

/// `Contradiction`, `Leaked`: the latest input is a finding.
pub const Error = targets.Contradiction || error{ OutOfMemory, Leaked };

/// How an input is executed.
pub const Manner = struct { guarded: bool, draws: bool };

pub const Campaign = struct {
    target: *const targets.Target,
    gpa: Allocator,
    io: Io,
    folder: Io.Dir,
    coverage: Coverage,
    random: std.Random.DefaultPrng,
    corpus: std.ArrayList([]const u8) = .empty,
    /// Where inputs are written that reach new code.
    kept_in: ?Io.Dir = null,
    /// For the input under way.
    scratch: std.heap.ArenaAllocator,
    execution_count: u64 = 0,
    /// The execution that was the latest to do something new, and to reach an edge that none had.
    news_at: u64 = 0,
    edge_at: u64 = 0,
    outcomes: std.EnumArray(targets.Outcome, u64) = .initFill(0),

    /// `counters` as `Coverage` has them; none, and what is new is not known.
    pub fn init(
        target: *const targets.Target,
        gpa: Allocator,
        io: Io,
        folder: Io.Dir,
        counters: []u8,
        seed: u64,
    ) Allocator.Error!Campaign {
        return .{
            .target = target,
            .gpa = gpa,
            .io = io,
            .folder = folder,
            .coverage = try .init(gpa, counters),
            .random = .init(seed),
            .scratch = .init(gpa),
        };
    }

    pub fn deinit(campaign: *Campaign) void {
        for (campaign.corpus.items) |input| campaign.gpa.free(input);
        campaign.corpus.deinit(campaign.gpa);
        campaign.coverage.deinit(campaign.gpa);
        campaign.scratch.deinit();
        campaign.* = undefined;
    }

    /// Executes an input that others are made of.
    pub fn addSeed(campaign: *Campaign, input: []const u8) Error!void {
        if (input.len > campaign.target.bytes_max) return;
        try campaign.keep(input);
        _ = try campaign.execute(input, .{ .guarded = true, .draws = true });
    }

    /// Executes one input more.
    pub fn step(campaign: *Campaign) Error!void {
        _ = campaign.scratch.reset(.retain_capacity);
        const random = campaign.random.random();
        const mutator: Mutator = .{
            .arena = campaign.scratch.allocator(),
            .random = random,
            .others = campaign.corpus.items,
        };
        const changed = try mutator.mutate(campaign.target.structure, campaign.choose(random));
        const input = changed[0..@min(changed.len, campaign.target.bytes_max)];
        const manner: Manner = .{
            .guarded = random.uintLessThan(u8, guarded_period) == 0,
            .draws = random.uintLessThan(u8, drawn_period) == 0,
        };
        const edge_count = campaign.coverage.edge_count;
        if (try campaign.execute(input, manner)) {
            campaign.news_at = campaign.execution_count;
            if (campaign.coverage.edge_count > edge_count) campaign.edge_at = campaign.news_at;
            try campaign.keep(input);
            campaign.write(input);
        }
    }

    /// Mostly one of the latest.
    fn choose(campaign: *const Campaign, random: std.Random) []const u8 {
        const inputs = campaign.corpus.items;
        if (inputs.len == 0) return "";
        const index = random.uintLessThan(usize, inputs.len);
        if (random.boolean()) return inputs[index];
        return inputs[@max(index, random.uintLessThan(usize, inputs.len))];
    }

    fn keep(campaign: *Campaign, input: []const u8) Allocator.Error!void {
        const copy = try campaign.gpa.dupe(u8, input);
        errdefer campaign.gpa.free(copy);
        const inputs = &campaign.corpus;
        if (inputs.items.len < corpus_count_max) return inputs.append(campaign.gpa, copy);
        const place = campaign.random.random().uintLessThan(usize, corpus_count_max);
        campaign.gpa.free(inputs.items[place]);
        inputs.items[place] = copy;
    }

    /// For another campaign; a disk that is full is no reason to end this one.
    fn write(campaign: *Campaign, input: []const u8) void {
        const folder = campaign.kept_in orelse return;
        var buffer: [watch.name_bytes_max]u8 = undefined;
        const name = watch.nameOf(&buffer, "input", input);
        folder.writeFile(campaign.io, .{ .sub_path = name, .data = input }) catch |err|
            std.debug.print("fuzz: {s} is not written: {t}\n", .{ name, err });
    }

    /// Whether it reaches new code.
    pub fn execute(campaign: *Campaign, input: []const u8, manner: Manner) Error!bool {
        const child = if (manner.guarded) guard.allocator else std.heap.smp_allocator;
        var account: Account = .init(child, memory_bytes_max);
        const own = if (manner.guarded) try guard.allocator.dupe(u8, input) else input;
        defer if (manner.guarded) guard.allocator.free(own);
        const run: targets.Run = .{
            .gpa = account.allocator(),
            .io = campaign.io,
            .folder = campaign.folder,
            .draws = manner.draws,
        };
        campaign.coverage.clear();
        watch.begin(own);
        defer watch.end();
        // While the input is there.
        errdefer watch.save("wrong");
        const outcome = try campaign.target.execute(&run, own);
        campaign.execution_count += 1;
        campaign.outcomes.getPtr(outcome).* += 1;
        const left = account.used.load(.monotonic);
        if (left > 0) {
            std.debug.print("fuzz: {d} bytes leaked\n", .{left});
            return error.Leaked;
        }
        return campaign.coverage.collect();
    }
};

/// The inputs that a target begins with, sorted by name; the caller frees all.
pub fn seedsOf(
    arena: Allocator,
    io: Io,
    target: *const targets.Target,
) ![]const []const u8 {
    var seeds: std.ArrayList([]const u8) = .empty;
    const own = try std.fs.path.join(arena, &.{ "fuzz/corpus", @tagName(target.name) });
    try addFolder(arena, io, &seeds, own, "");
    for (target.seeds) |place| try addFolder(arena, io, &seeds, place[0], place[1]);
    return seeds.items;
}

/// Reads the files of a folder whose names end so; a folder that is not there has none.
pub fn addFolder(
    arena: Allocator,
    io: Io,
    files: *std.ArrayList([]const u8),
    path: []const u8,
    ending: []const u8,
) !void {
    var folder = Io.Dir.cwd().openDir(io, path, .{ .iterate = true }) catch |err| switch (err) {
        error.FileNotFound => return,
        else => return err,
    };
    defer folder.close(io);
    var names: std.ArrayList([]const u8) = .empty;
    var entries = folder.iterate();
    while (try entries.next(io)) |entry| {
        if (entry.kind != .file or !std.mem.endsWith(u8, entry.name, ending)) continue;
        try names.append(arena, try arena.dupe(u8, entry.name));
    }
    std.mem.sortUnstable([]const u8, names.items, {}, isBefore);
    for (names.items) |name| {
        try files.append(arena, try folder.readFileAlloc(io, name, arena, .limited(1 << 20)));
    }
}

fn isBefore(_: void, a: []const u8, b: []const u8) bool {
    return std.mem.lessThan(u8, a, b);
}

/// Puts copies of what inputs may name into a folder.
pub fn fill(folder: Io.Dir, io: Io) !void {
    var from = try Io.Dir.cwd().openDir(io, "fuzz/corpus/beside", .{ .iterate = true });
    defer from.close(io);
    var entries = from.iterate();
    while (try entries.next(io)) |entry| if (entry.kind == .file) {
        try from.copyFile(entry.name, folder, entry.name, io, .{});
    };
}
