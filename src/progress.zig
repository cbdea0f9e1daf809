//! Progress: which stage the work on one picture is in, and how much of it is done.
//!
//! A leaf that every stage may import. Stages say what they begin and bump counters; they know
//! nothing of who reads them, and where nobody does there is no `Progress` at all: every function
//! takes null and does nothing then. Counters are atomic and as wide as an address, for a 32-bit
//! processor has no wider ones; they are touched once a tile, an image or a task, never once a ray.

const std = @import("std");

/// Parts of the work, in their usual order.
pub const Stage = enum {
    /// Files, in bytes.
    reading,
    /// The text of a PBRT scene, in bytes of those known so far.
    parsing,
    /// Images.
    textures,
    /// Placing meshes, drawing strokes.
    geometry,
    /// Triangles in the tree.
    tree,
    /// The environment, and what frames the view.
    view,
    /// What virtual lights need besides the tiles, in pieces.
    lights,
    /// Samples a pixel.
    tracing,
    /// Tiles.
    denoising,
    /// Encoding the picture, and moving it to its place.
    writing,
    /// Renderings of a benchmark.
    measuring,
};

/// What a stage begins.
pub const Work = struct {
    stage: Stage,
    /// Pieces; 0: not known.
    total: u64 = 0,
    /// How many of them make one of what users are told.
    pieces_per_unit: u64 = 1,
    /// Time after which the work ends, done or not; null: there is no such time.
    budget_ns: ?u64 = null,
};

/// An atomic counter that wraps where addresses do.
const Counter = std.atomic.Value(usize);

/// Of one file, whose pictures are made one after the other.
pub const Progress = struct {
    /// Pieces.
    done: Counter align(std.atomic.cache_line) = .init(0),
    total: Counter = .init(0),
    /// Traced since the work began.
    rays: Counter = .init(0),
    /// Which picture is made, from 1 on, and of how many; 0: it is not known yet.
    picture: Counter = .init(0),
    picture_count: Counter = .init(0),
    context: *anyopaque,
    /// Told of what begins, by the thread that begins it.
    begun: *const fn (context: *anyopaque, work: *const Work) void,

    /// Begins some work, and ends what was under way.
    pub fn begin(optional: ?*Progress, work: Work) void {
        const progress = optional orelse return;
        progress.begun(progress.context, &work);
    }

    /// So many more pieces are done. Any thread may call it.
    pub fn add(optional: ?*Progress, count: usize) void {
        const progress = optional orelse return;
        _ = progress.done.fetchAdd(count, .monotonic);
    }

    /// So many are done in all, of so many.
    pub fn reach(optional: ?*Progress, done: u64, total: u64) void {
        const progress = optional orelse return;
        progress.done.store(countOf(done), .monotonic);
        progress.total.store(countOf(total), .monotonic);
    }

    /// So many more rays are traced. Any thread may call it.
    pub fn addRays(optional: ?*Progress, count: u64) void {
        const progress = optional orelse return;
        _ = progress.rays.fetchAdd(@truncate(count), .monotonic);
    }

    /// Begins a picture, from 1 on, of so many.
    pub fn beginPicture(optional: ?*Progress, number: usize, count: usize) void {
        const progress = optional orelse return;
        progress.picture_count.store(count, .monotonic);
        progress.picture.store(number, .monotonic);
    }

    /// Sets the counters to those of work that begins.
    pub fn restart(progress: *Progress, work: *const Work) void {
        progress.done.store(0, .monotonic);
        progress.rays.store(0, .monotonic);
        progress.total.store(countOf(work.total), .monotonic);
    }
};

/// A number of pieces, or 0 where there are more than can be counted.
fn countOf(pieces: u64) usize {
    return std.math.cast(usize, pieces) orelse 0;
}

test "stages tell what they begin, and nobody who does not listen" {
    const Listener = struct {
        progress: Progress,
        stage: ?Stage = null,

        fn begun(context: *anyopaque, work: *const Work) void {
            const listener: *@This() = @ptrCast(@alignCast(context));
            listener.stage = work.stage;
            listener.progress.restart(work);
        }
    };
    var listener: Listener = .{ .progress = undefined };
    listener.progress = .{ .context = &listener, .begun = Listener.begun };
    const progress: ?*Progress = &listener.progress;
    Progress.begin(progress, .{ .stage = .tree, .total = 7 });
    Progress.add(progress, 3);
    Progress.addRays(progress, 5);
    try std.testing.expectEqual(.tree, listener.stage.?);
    try std.testing.expectEqual(3, listener.progress.done.load(.monotonic));
    try std.testing.expectEqual(7, listener.progress.total.load(.monotonic));
    Progress.begin(progress, .{ .stage = .writing });
    Progress.reach(progress, 2, 9);
    try std.testing.expectEqual(2, listener.progress.done.load(.monotonic));
    try std.testing.expectEqual(9, listener.progress.total.load(.monotonic));
    try std.testing.expectEqual(0, listener.progress.rays.load(.monotonic));
    Progress.beginPicture(progress, 2, 3);
    try std.testing.expectEqual(2, listener.progress.picture.load(.monotonic));
    try std.testing.expectEqual(3, listener.progress.picture_count.load(.monotonic));
    Progress.beginPicture(null, 2, 3);
    Progress.begin(null, .{ .stage = .tree });
    Progress.add(null, 1);
    Progress.addRays(null, 1);
    Progress.reach(null, 1, 2);
}
