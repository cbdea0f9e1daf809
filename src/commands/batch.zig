//! `raylane` with several pictures: a queue of scene files, some of them side by side.
//!
//! In: inputs, frames and views, a template of names. Out: pictures, a line for each, a summary,
//! and the worst exit code. A file that fails stops no other. The largest files come first, so that
//! none of them keeps the others waiting at the end. All share one account of memory: a file for
//! which there was none beside others is tried once more by itself.

const std = @import("std");
const confine = @import("confine.zig");
const console = @import("console.zig");
const pictures_file = @import("pictures.zig");
const raylane = @import("raylane");
const signals = @import("../signals.zig");
const Account = raylane.memory_account.Account;
const Allocator = std.mem.Allocator;
const Diagnostic = raylane.diagnostic.Diagnostic;
const Display = raylane.display.Display;
const ExitCode = @import("exit_code.zig").ExitCode;
const Io = std.Io;
const Options = raylane.cli.Options;
const Pictures = pictures_file.Pictures;
const Plan = raylane.batch.Plan;
const Session = raylane.session.Session;
const TimeLimit = @import("time_limit.zig").TimeLimit;
const cli = raylane.cli;
const printable = raylane.diagnostic.printable;
const settings = raylane.settings;

/// Renders all that is asked for.
pub fn run(gpa: Allocator, io: Io, options: *const Options, diagnostic: *Diagnostic) ExitCode {
    var arena: std.heap.ArenaAllocator = .init(gpa);
    defer arena.deinit();
    var account: Account = .initFor(gpa, io, options.memory_max);
    var batch: Batch = .{
        .gpa = gpa,
        .account = &account,
        .io = io,
        .options = options,
        .thread_count = options.thread_count orelse raylane.session.processorCount(),
    };
    defer batch.deinit();
    batch.prepare(arena.allocator(), diagnostic) catch |err| switch (err) {
        error.OutOfMemory => return console.outOfMemory(io),
        error.UsageInvalid => {
            console.say(io, "raylane: {s} (see --help)\n", .{diagnostic.message.text()});
            batch.printFailure(&.{
                .version = cli.version,
                .problem = .of(diagnostic, "", @backingInt(ExitCode.usage)),
            });
            return .usage;
        },
    };
    if (confine.aroundPictures(gpa, io, options[0..1], diagnostic)) |code| return code;
    batch.runAll();
    return batch.finish();
}

/// The batch under way. Must stay where it is.
pub const Batch = struct {
    gpa: Allocator,
    account: *Account,
    io: Io,
    options: *const Options,
    /// Of all files that are rendered at a time.
    thread_count: usize,
    plan: Plan = .{ .files = &.{}, .frames = &.{}, .views = &.{}, .template = null },
    start: Io.Timestamp = .{ .nanoseconds = 0 },
    display: Display = undefined,
    /// What the display shows: the files under way.
    slots: []Display.Slot = &.{},
    /// Indices of the files, as they are begun.
    order: []const u32 = &.{},
    next: std.atomic.Value(usize) = .init(0),
    /// Files that are under way, at most, and now.
    job_count: usize = 1,
    busy_count: std.atomic.Value(usize) = .init(0),

    /// For what follows.
    mutex: Io.Mutex = .init,
    /// Names of pictures, as hashes, and whose they are.
    names: std.AutoHashMapUnmanaged(u64, Owner) = .empty,
    /// Files that found no memory beside others.
    postponed: std.ArrayList(u32) = .empty,
    written_count: usize = 0,
    skipped_count: usize = 0,
    failed_count: usize = 0,
    exit_code: ExitCode = .ok,

    /// A picture: the file's index, and its number among the file's.
    pub const Owner = struct { file: u32, number: u32 };

    fn deinit(batch: *Batch) void {
        batch.names.deinit(batch.gpa);
        batch.postponed.deinit(batch.gpa);
    }

    /// Finds the files and makes the plan.
    fn prepare(
        batch: *Batch,
        arena: Allocator,
        diagnostic: *Diagnostic,
    ) raylane.batch.PlanError!void {
        const options = batch.options;
        const chosen = &options.batch;
        const format = options.write.format;
        batch.start = Io.Clock.awake.now(batch.io);
        var files: std.ArrayList(raylane.batch.File) = .empty;
        var inputs = options.inputs(diagnostic);
        while (inputs.next()) |input|
            batch.sayFound(input, try raylane.batch.gather(arena, batch.io, input, &files));
        batch.plan = try raylane.batch.makePlan(arena, files.items, &.{
            .frames = chosen.frames,
            .view_count = chosen.view_count,
            .views = chosen.views,
            .template = if (options.toStdout())
                null
            else
                try cli.templateOf(arena, chosen, options.output, format),
            .is_film = format == .y4m,
        }, &diagnostic.message);
        try batch.checkStdout(diagnostic);
        batch.job_count = batch.jobCount();
        batch.slots = try arena.alloc(Display.Slot, batch.job_count);
        const order = try arena.alloc(u32, files.items.len);
        for (order, 0..) |*index, place| index.* = @intCast(place);
        if (batch.job_count > 1) std.mem.sort(u32, order, files.items, isLarger);
        batch.order = order;
    }

    fn isLarger(files: []const raylane.batch.File, one: u32, other: u32) bool {
        return (files[one].byte_count orelse 0) > (files[other].byte_count orelse 0);
    }

    /// Says what of an input is not rendered.
    fn sayFound(batch: *Batch, input: []const u8, found: raylane.batch.Found) void {
        const name = printable(input);
        switch (found) {
            .file => {},
            .unreadable => |reason| batch.refuse(input, reason),
            .folder => |folder| if (folder.file_count == 0) {
                var reason: raylane.diagnostic.Message = .{};
                const count = folder.folder_count;
                if (count == 0) reason.set("no scenes in it", .{}) else reason.set(
                    "no scenes in it, and {d} folder{s} that are not looked into",
                    .{ count, plural(count) },
                );
                batch.refuse(input, reason.text());
            } else if (folder.folder_count > 0 and !batch.options.quiet) {
                const count = folder.folder_count;
                console.say(batch.io, "raylane: {f}: warning: not looked into {d} folder{s} in " ++
                    "it\n", .{ name, count, plural(count) });
            },
        }
    }

    fn refuse(batch: *Batch, input: []const u8, reason: []const u8) void {
        console.say(batch.io, "raylane: {f}: {s}\n", .{ printable(input), reason });
        batch.note(.failed);
        batch.printFailure(&.{
            .version = cli.version,
            .scene = input,
            .problem = .{
                .message = reason,
                .file = input,
                .exit_code = @backingInt(ExitCode.failed),
            },
        });
    }

    /// Pictures that follow each other in a stream are told apart by some formats only.
    fn checkStdout(batch: *const Batch, diagnostic: *Diagnostic) error{UsageInvalid}!void {
        if (!batch.options.toStdout()) return;
        const format = batch.options.write.format;
        const file_count = batch.plan.files.len;
        if (file_count * batch.plan.pictureCount() <= 1) return;
        switch (format) {
            .png, .jpg, .ppm => {},
            .y4m => if (file_count > 1) return diagnostic.fail(
                error.UsageInvalid,
                "a y4m film on standard output is one of a single scene, not of {d}",
                .{file_count},
            ),
            .tga, .bmp, .hdr, .pfm, .webp, .exr => return diagnostic.fail(
                error.UsageInvalid,
                "several {t} pictures in one stream cannot be told apart; " ++
                    "ppm, png, jpg and y4m can",
                .{format},
            ),
        }
    }

    /// Many small pictures take less time side by side, by a thread each.
    fn jobCount(batch: *const Batch) usize {
        const file_count = batch.plan.files.len;
        // Their order is that of the inputs.
        if (batch.options.toStdout() or file_count <= 1) return 1;
        if (batch.options.batch.job_count) |count| return @min(count, file_count);
        const view = &batch.options.view;
        const side = view.long_side orelse settings.long_side.default;
        const size = view.resolution orelse .{ side, side };
        const pixel_count = @as(u64, size[0]) * size[1];
        if (pixel_count > pixel_count_small) return 1;
        var file_bytes: u64 = 0;
        for (batch.plan.files) |file| file_bytes = @max(file_bytes, file.byte_count orelse 0);
        const job_bytes = job_bytes_least + pixel_count * pixel_bytes + file_bytes * unpacked_ratio;
        const room = batch.account.limit;
        // Nobody knows how much there is.
        if (room == std.math.maxInt(usize) and !batch.account.is_default) return 1;
        const wanted = @min(file_count / 2, batch.thread_count, settings.job_count.max);
        return @intCast(@max(1, @min(wanted, room / job_bytes)));
    }

    /// Takes the files one after the other, by several threads.
    fn runAll(batch: *Batch) void {
        const options = batch.options;
        batch.display = .init(batch.io, options.progress, &signals.progress_line, batch.slots);
        batch.display.start();
        defer batch.display.stop();
        defer signals.outcome.clear();
        batch.setOutcome();
        signals.stop.is_awaited.store(options.partial, .release);
        defer signals.stop.is_awaited.store(false, .release);
        var threads: [settings.job_count.max]std.Thread = undefined;
        var started: usize = 0;
        batch.busy_count.store(batch.job_count, .monotonic);
        while (started + 1 < batch.job_count) : (started += 1) {
            threads[started] = std.Thread.spawn(.{}, work, .{batch}) catch break;
        }
        _ = batch.busy_count.fetchSub(batch.job_count - 1 - started, .monotonic);
        work(batch);
        for (threads[0..started]) |thread| thread.join();
        batch.job_count = 1;
        batch.busy_count.store(1, .monotonic);
        for (batch.postponed.items) |index| {
            if (batch.isStopped()) break;
            var worker: Worker = .{ .batch = batch };
            worker.init();
            defer worker.session.deinit();
            worker.runFile(index, batch.order.len);
        }
    }

    fn work(batch: *Batch) void {
        _ = raylane.simd.setFlushToZero();
        var worker: Worker = .{ .batch = batch };
        worker.init();
        defer worker.session.deinit();
        while (!batch.isStopped()) {
            const place = batch.next.fetchAdd(1, .monotonic);
            if (place >= batch.order.len) break;
            worker.runFile(batch.order[place], place + 1);
        }
        _ = batch.busy_count.fetchSub(1, .monotonic);
    }

    /// Whether a signal has asked for the pictures under way, and no others.
    pub fn isStopped(batch: *const Batch) bool {
        return batch.options.partial and signals.stop.is_asked.load(.monotonic);
    }

    /// How many threads a file may have now: more where no others are left to be begun.
    pub fn threadCount(batch: *const Batch) usize {
        const begun = @min(batch.next.load(.monotonic), batch.order.len);
        const waiting = batch.order.len - begun;
        const busy = @max(1, batch.busy_count.load(.monotonic));
        const files = if (waiting > 0) batch.job_count else @min(busy, batch.job_count);
        return @divCeil(batch.thread_count, files);
    }

    /// Takes a name for a picture; false: another one has it.
    pub fn claim(batch: *Batch, name: []const u8, owner: Owner) error{OutOfMemory}!bool {
        batch.mutex.lockUncancelable(batch.io);
        defer batch.mutex.unlock(batch.io);
        const entry = try batch.names.getOrPut(batch.gpa, std.hash.Wyhash.hash(0, name));
        if (!entry.found_existing) entry.value_ptr.* = owner;
        return std.meta.eql(entry.value_ptr.*, owner);
    }

    /// Counts pictures that are written, or were there.
    pub fn add(batch: *Batch, comptime what: enum { written, skipped }, number: usize) void {
        batch.mutex.lockUncancelable(batch.io);
        defer batch.mutex.unlock(batch.io);
        @field(batch, @tagName(what) ++ "_count") += number;
        batch.setOutcome();
    }

    /// What a signal says that ends the program.
    fn setOutcome(batch: *const Batch) void {
        if (batch.options.quiet) return;
        const count = batch.written_count;
        const format = "{d} picture{s} written, those under way are not";
        signals.outcome.set(format, .{ count, plural(count) });
    }

    /// Prints the report of a picture, one at a time.
    pub fn print(batch: *Batch, text: []const u8) void {
        batch.mutex.lockUncancelable(batch.io);
        const code = console.print(batch.io, text);
        batch.mutex.unlock(batch.io);
        if (code != .ok) batch.note(code);
    }

    /// The same in place of the report of a picture that there is not.
    fn printFailure(batch: *Batch, failure: *const raylane.report.Failure) void {
        if (batch.options.stats != .json) return;
        batch.mutex.lockUncancelable(batch.io);
        defer batch.mutex.unlock(batch.io);
        console.printFailure(batch.gpa, batch.io, failure, batch.options.toStdout());
    }

    /// Counts a failure.
    fn note(batch: *Batch, code: ExitCode) void {
        batch.mutex.lockUncancelable(batch.io);
        defer batch.mutex.unlock(batch.io);
        batch.failed_count += 1;
        if (@backingInt(code) > @backingInt(batch.exit_code)) batch.exit_code = code;
    }

    /// Puts a file off until others have given their memory back; false: there are no others.
    fn postpone(batch: *Batch, index: u32) bool {
        if (batch.job_count == 1) return false;
        batch.mutex.lockUncancelable(batch.io);
        defer batch.mutex.unlock(batch.io);
        batch.postponed.append(batch.gpa, index) catch return false;
        return true;
    }

    /// Says how it went.
    fn finish(batch: *const Batch) ExitCode {
        const duration = batch.start.untilNow(batch.io, .awake);
        const seconds = @as(f64, @floatFromInt(duration.toMilliseconds())) / 1000;
        var line: raylane.diagnostic.Message = .{};
        const written_count = batch.written_count;
        line.set("{d} picture{s} in {d:.1} s", .{ written_count, plural(written_count), seconds });
        if (batch.skipped_count > 0) line.append(", {d} kept", .{batch.skipped_count});
        const failed_count = batch.failed_count;
        if (failed_count > 0)
            line.append(", {d} failure{s}", .{ failed_count, plural(failed_count) });
        if (!batch.options.quiet) console.say(batch.io, "raylane: {s}\n", .{line.text()});
        if (!batch.isStopped()) return batch.exit_code;
        return @fromBackingInt(@intCast(128 + signals.stop.signal.load(.monotonic)));
    }
};

fn plural(count: usize) []const u8 {
    return if (count == 1) "" else "s";
}

/// One of those that take files: a session, whose threads, film and studio serve all of them.
const Worker = struct {
    batch: *Batch,
    diagnostic: Diagnostic = .{},
    /// Its part of the batch's, which can be ended by itself.
    account: Account = undefined,
    session: Session = undefined,

    fn init(worker: *Worker) void {
        const batch = worker.batch;
        worker.account = .init(batch.account.allocator(), null);
        const gpa = worker.account.allocator();
        worker.session = .init(gpa, batch.io, batch.threadCount(), &worker.diagnostic);
        if (batch.options.partial) worker.session.stop = &signals.stop.is_asked;
    }

    /// `number`: of those that have been begun.
    fn runFile(worker: *Worker, index: u32, number: usize) void {
        const batch = worker.batch;
        const path = batch.plan.files[index].path;
        worker.diagnostic = .{};
        const display = &batch.display;
        const progress = display.beginFile(.{
            .index = number,
            .count = batch.order.len,
            .name = path,
        });
        worker.session.pool.progress = progress;
        defer worker.session.pool.progress = null;
        defer worker.session.drop();
        var pictures: Pictures = .init(batch, &worker.session, index);
        defer pictures.deinit();
        var limit: TimeLimit = .{
            .io = batch.io,
            .seconds = batch.options.time_max_s,
            .title = path,
        };
        const outcome = limit.finish(worker.runWithin(&limit, &pictures), &worker.diagnostic);
        outcome catch |err| if (err == error.OutOfMemory and batch.postpone(index))
            return display.endFile(progress, .postponed);
        const is_skipped = pictures.begun_count == 0;
        display.endFile(progress, if (outcome) |_|
            if (is_skipped) .skipped else .done
        else |_|
            .failed);
        pictures.sayWarnings();
        if (!batch.options.quiet) console.sayDropped(batch.io, path, &worker.diagnostic);
        outcome catch |err| {
            const place = if (err == error.OutputFailed)
                pictures.place()
            else
                console.placeOf(&worker.diagnostic, path);
            const code = console.fail(batch.account, batch.io, place, err, &worker.diagnostic);
            batch.note(code);
            const output = pictures.place();
            var warnings: [raylane.diagnostic.warning_count_max][]const u8 = undefined;
            batch.printFailure(&.{
                .version = cli.version,
                .scene = path,
                .output = if (output.len > 0) output else null,
                .problem = .of(&worker.diagnostic, place, @backingInt(code)),
                .warnings = worker.diagnostic.warningTexts(&warnings),
            });
        };
    }

    fn runWithin(worker: *Worker, limit: *TimeLimit, pictures: *Pictures) Pictures.Error!void {
        try limit.start(&worker.account, &worker.session.pool, &worker.diagnostic);
        return pictures.run();
    }
};

/// Pictures of so many pixels are small.
const pixel_count_small = 1 << 20;

/// What a job takes, about: at least, for a pixel, and for a byte of the scene's file.
const job_bytes_least = 128 << 20;
const pixel_bytes = 64;
const unpacked_ratio = 12;
