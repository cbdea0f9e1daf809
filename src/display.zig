//! Display: the progress of files as users and programs are told of it.
//!
//! In: files that are begun and ended, and the counters of their `Progress`, which a thread of its
//! own reads. Out: on a terminal one line, redrawn ten times a second and erased before anything
//! else is said; for programs one JSON object a line, five a second and one for each stage that
//! begins. What takes half a second shows nothing on a terminal.

const std = @import("std");
const json = @import("display/json.zig");
const line_file = @import("display/line.zig");
const progress_file = @import("progress.zig");
const settings = @import("settings.zig");
const standing_file = @import("display/standing.zig");
const Io = std.Io;
const Place = standing_file.Place;
const Progress = progress_file.Progress;
const Standing = standing_file.Standing;
const Work = progress_file.Work;
const assert = std.debug.assert;

/// The line on the terminal.
pub const Line = line_file.Line;

const draw_ms = 100;
const tell_ms = 200;
const quiet_ms = 500;

/// How a file ended. What went wrong is said elsewhere; one that is postponed is begun once more.
pub const Outcome = enum { done, skipped, postponed, failed };

/// Of all files of a run. Must stay where it is from `start` to `stop`.
pub const Display = struct {
    io: Io,
    form: Form,
    /// Where JSON goes; null: to standard error, beside messages.
    file: ?Io.File = null,
    line: *Line,
    begin: Io.Timestamp,
    thread: ?std.Thread = null,
    ended: Io.Event = .unset,
    /// Guards all below, but for the counters.
    mutex: Io.Mutex = .init,
    slots: []Slot,
    /// Of the slot that is told of next.
    turn: usize = 0,
    /// Nobody reads what is told.
    has_failed: bool = false,

    const Form = enum { none, line, json };

    /// Room for a file that is under way.
    pub const Slot = struct {
        display: *Display = undefined,
        /// Null: nobody has the slot.
        place: ?Place = null,
        progress: Progress = undefined,
        /// Null: nothing was begun yet.
        work: ?Work = null,
        /// Since the display's begin.
        begin_s: f64 = 0,
        work_begin_s: f64 = 0,
        /// What was done when it was last looked at, and when there was first so much.
        seen_done: usize = 0,
        seen_s: f64 = 0,
        /// The same of the picture that is made, and of the first one.
        seen_picture: usize = 0,
        seen_picture_s: f64 = 0,
        first_picture: usize = 0,
        first_picture_s: f64 = 0,

        fn begun(context: *anyopaque, work: *const Work) void {
            const slot: *Slot = @ptrCast(@alignCast(context));
            const display = slot.display;
            display.mutex.lockUncancelable(display.io);
            defer display.mutex.unlock(display.io);
            slot.progress.restart(work);
            slot.work = work.*;
            slot.work_begin_s = display.now();
            slot.seen_done = 0;
            slot.seen_s = slot.work_begin_s;
            if (display.form == .json) display.tell(@tagName(work.stage), slot);
        }

        fn standing(slot: *Slot, now_s: f64) Standing {
            const done = slot.progress.done.load(.monotonic);
            if (done != slot.seen_done) {
                slot.seen_done = done;
                slot.seen_s = now_s;
            }
            slot.seePicture(now_s);
            return .of(slot.place.?, &(slot.work orelse .{ .stage = .reading }), &slot.progress, .{
                .file_s = now_s - slot.begin_s,
                .work_s = slot.seen_s - slot.work_begin_s,
                .idle_s = now_s - slot.seen_s,
                .picture_count = slot.seen_picture - slot.first_picture,
                .pictures_s = slot.seen_picture_s - slot.first_picture_s,
                .picture_idle_s = now_s - slot.seen_picture_s,
            });
        }

        fn seePicture(slot: *Slot, now_s: f64) void {
            const picture = slot.progress.picture.load(.monotonic);
            if (picture == slot.seen_picture) return;
            // By the next camera they begin anew.
            if (picture < slot.seen_picture or slot.first_picture == 0) {
                slot.first_picture = picture;
                slot.first_picture_s = now_s;
            }
            slot.seen_picture = picture;
            slot.seen_picture_s = now_s;
        }
    };

    /// `line` is where others learn whether there is one on the terminal. `slots` is room for the
    /// files that are shown at a time; others are under way unseen. Says nothing yet.
    pub fn init(io: Io, chosen: settings.Progress, line: *Line, slots: []Slot) Display {
        @memset(slots, .{});
        return .{
            .io = io,
            .form = switch (chosen.form) {
                .none => .none,
                .json => .json,
                .auto => if (isTerminal(io)) .line else .none,
            },
            .file = fileOf(chosen.file),
            .line = line,
            .begin = Io.Clock.awake.now(io),
            .slots = slots,
        };
    }

    fn fileOf(descriptor: ?u32) ?Io.File {
        const handle: std.posix.fd_t = @intCast(descriptor orelse return null);
        if (handle == std.posix.STDERR_FILENO) return null;
        return .{ .handle = handle, .flags = .{ .nonblocking = false } };
    }

    /// Begins to show. Where the system has no thread to spare, only what begins and ends is told.
    pub fn start(display: *Display) void {
        if (display.form == .none) return;
        display.thread = std.Thread.spawn(.{ .stack_size = 1 << 20 }, run, .{display}) catch null;
    }

    /// Ends the thread and erases the line.
    pub fn stop(display: *Display) void {
        const thread = display.thread orelse return;
        display.ended.set(display.io);
        thread.join();
        display.thread = null;
        if (display.form != .line) return;
        var buffer: [16]u8 = undefined;
        const stderr = display.io.lockStderr(&buffer, null) catch return;
        defer display.io.unlockStderr();
        display.line.erase(&stderr.file_writer.interface) catch return;
        stderr.file_writer.interface.flush() catch return;
    }

    /// A file is begun. `place` must live until `endFile` is called with the result; null: nobody
    /// is to be told of it.
    pub fn beginFile(display: *Display, place: Place) ?*Progress {
        if (display.form == .none) return null;
        display.mutex.lockUncancelable(display.io);
        defer display.mutex.unlock(display.io);
        const slot = for (display.slots) |*slot| {
            if (slot.place == null) break slot;
        } else return null;
        slot.* = .{
            .display = display,
            .place = place,
            .progress = .{ .context = slot, .begun = Slot.begun },
            .begin_s = display.now(),
        };
        return &slot.progress;
    }

    /// A file has ended.
    pub fn endFile(display: *Display, progress: ?*Progress, outcome: Outcome) void {
        const slot: *Slot = @alignCast(@fieldParentPtr("progress", progress orelse return));
        display.mutex.lockUncancelable(display.io);
        defer display.mutex.unlock(display.io);
        switch (display.form) {
            .none => unreachable, // It has no progress.
            .json => {
                slot.work = null;
                slot.progress.restart(&.{ .stage = .writing });
                display.tell(@tagName(outcome), slot);
            },
            .line => {},
        }
        slot.place = null;
    }

    fn now(display: *const Display) f64 {
        const ns = display.begin.untilNow(display.io, .awake).toNanoseconds();
        return @as(f64, @floatFromInt(ns)) / std.time.ns_per_s;
    }

    fn run(display: *Display) void {
        const io = display.io;
        const ms: i64 = if (display.form == .line) draw_ms else tell_ms;
        while (true) {
            display.ended.waitTimeout(io, .{
                .duration = .{ .raw = .fromMilliseconds(ms), .clock = .awake },
            }) catch |err| switch (err) {
                error.Canceled => return,
                error.Timeout => {
                    display.tick();
                    continue;
                },
            };
            return;
        }
    }

    fn tick(display: *Display) void {
        display.mutex.lockUncancelable(display.io);
        defer display.mutex.unlock(display.io);
        if (display.form == .line) return display.draw();
        // One at a time, so that many files are not told of more often than one.
        for (0..display.slots.len) |step| {
            const index = (display.turn + step) % display.slots.len;
            const slot = &display.slots[index];
            if (slot.place == null) continue;
            const work = slot.work orelse continue;
            display.tell(@tagName(work.stage), slot);
            display.turn = index + 1;
            return;
        }
    }

    fn draw(display: *Display) void {
        const now_s = display.now();
        if (now_s * std.time.ms_per_s < quiet_ms) return;
        var first: ?*Slot = null;
        var count: usize = 0;
        for (display.slots) |*slot| {
            const place = slot.place orelse continue;
            count += 1;
            if (first == null or place.index < first.?.place.?.index) first = slot;
        }
        const standing = (first orelse return).standing(now_s);
        var text: [line_file.text_bytes_max]u8 = undefined;
        var buffer: [line_file.text_bytes_max + 16]u8 = undefined;
        const stderr = display.io.lockStderr(&buffer, null) catch return;
        defer display.io.unlockStderr();
        const shown = line_file.write(&text, &standing, count, terminalWidth());
        display.line.draw(&stderr.file_writer.interface, shown) catch return;
    }

    fn tell(display: *Display, stage: []const u8, slot: *Slot) void {
        if (display.has_failed) return;
        const standing = slot.standing(display.now());
        // Room for all but the longest names, so that a line is written in one piece.
        var buffer: [2048]u8 = undefined;
        display.tryTell(&buffer, stage, &standing) catch {
            display.has_failed = true;
        };
    }

    fn tryTell(
        display: *Display,
        buffer: []u8,
        stage: []const u8,
        standing: *const Standing,
    ) !void {
        if (display.file) |file| {
            var writer: Io.File.Writer = .initStreaming(file, display.io, buffer);
            try json.write(&writer.interface, stage, standing);
            return writer.interface.flush();
        }
        const stderr = try display.io.lockStderr(buffer, null);
        defer display.io.unlockStderr();
        try json.write(&stderr.file_writer.interface, stage, standing);
        try stderr.file_writer.interface.flush();
    }
};

/// Whether standard error is a terminal that knows how to erase a line.
fn isTerminal(io: Io) bool {
    if (!(Io.File.stderr().isTty(io) catch false)) return false;
    const kind = std.mem.span(std.c.getenv("TERM") orelse return false);
    return kind.len > 0 and !std.mem.eql(u8, kind, "dumb");
}

fn terminalWidth() usize {
    var size: std.posix.winsize = .{ .row = 0, .col = 0, .xpixel = 0, .ypixel = 0 };
    const result = std.posix.system.ioctl(
        std.posix.STDERR_FILENO,
        std.posix.T.IOCGWINSZ,
        @intFromPtr(&size),
    );
    if (std.posix.errno(result) != .SUCCESS or size.col == 0) return line_file.width_default;
    return size.col;
}

test {
    _ = json;
    _ = line_file;
    _ = standing_file;
}

const testing = std.testing;

/// What a display of that form writes about two files, of which one fails.
fn tellForTest(buffer: []u8) ![]const u8 {
    var ends: [2]std.posix.fd_t = undefined;
    try testing.expectEqual(0, std.c.pipe(&ends));
    defer _ = std.c.close(ends[0]);
    {
        defer _ = std.c.close(ends[1]);
        var line: Line = .{};
        var slots: [1]Display.Slot = undefined;
        var display: Display =
            .init(testing.io, .{ .form = .json, .file = @intCast(ends[1]) }, &line, &slots);
        display.start();
        defer display.stop();
        for ([_]Outcome{ .done, .failed }, 1..) |outcome, index| {
            const progress = display.beginFile(.{ .index = index, .count = 2, .name = "a" });
            Progress.begin(progress, .{ .stage = .tree, .total = 4 });
            Progress.add(progress, 3);
            Progress.begin(progress, .{ .stage = .tracing, .total = 8 });
            display.endFile(progress, outcome);
        }
    }
    const count = std.c.read(ends[0], buffer.ptr, buffer.len);
    return buffer[0..@intCast(count)];
}

test "every stage that begins is told in a line, and how a file ends" {
    var buffer: [4096]u8 = undefined;
    const text = try tellForTest(&buffer);
    var lines = std.mem.tokenizeScalar(u8, text, '\n');
    for ([_][]const u8{ "1", "2" }, [_][]const u8{ "done", "failed" }) |index, outcome| {
        for ([_][]const u8{ "tree", "tracing", outcome }) |stage| {
            // Others come where the machine is slow.
            const line = while (lines.next()) |line| {
                if (std.mem.find(u8, line, stage) != null) break line;
            } else return error.NotTold;
            try testing.expect(std.mem.startsWith(u8, line, "{\"stage\":\""));
            try testing.expect(std.mem.endsWith(u8, line, ",\"count\":2}"));
            const needle = try testing.allocator.print("\"index\":{s},", .{index});
            defer testing.allocator.free(needle);
            try testing.expect(std.mem.find(u8, line, needle) != null);
        }
    }
}

test "nobody is told of files without a display for them, or beyond its slots" {
    var line: Line = .{};
    var slots: [3]Display.Slot = undefined;
    var none: Display = .init(testing.io, .{ .form = .none }, &line, &slots);
    none.start();
    defer none.stop();
    try testing.expectEqual(null, none.beginFile(.{ .index = 1, .count = 1, .name = "a" }));
    none.endFile(null, .done);

    var display: Display = .init(testing.io, .{ .form = .json, .file = null }, &line, &slots);
    display.has_failed = true;
    var first: ?*Progress = null;
    for (0..slots.len) |index| {
        const progress = display.beginFile(.{ .index = index, .count = 99, .name = "a" });
        try testing.expect(progress != null);
        if (index == 0) first = progress;
    }
    try testing.expectEqual(null, display.beginFile(.{ .index = 98, .count = 99, .name = "b" }));
    display.endFile(first, .failed);
    try testing.expectEqual(first, display.beginFile(.{ .index = 98, .count = 99, .name = "b" }));
}
