//! A thread's view of a frame: the frame, and the clusters of instances that the thread has mapped.
//!
//! In: the frame that all threads share. Out: the same, or one with room of its own where instances
//! share meshes. What is found in it does not depend on what has been mapped before.

const std = @import("std");
const world_file = @import("../../world.zig");
const Allocator = std.mem.Allocator;
const Frame = world_file.Frame;
const Geometry = world_file.Geometry;

/// Bytes that all threads have for mapped clusters, each an equal part. With 6 MB a thread mapping
/// was half of a forest's time: neighbouring tiles see much the same clusters.
const bytes_max = 128 << 20;
/// Clusters that a thread keeps at least and at most.
const slot_count_min = 256;
const slot_count_max = 4096;

/// Must stay where it is.
pub fn OwnFrame(comptime Kernel: type) type {
    const Cache = world_file.instances.ClusterCache(Kernel.width);
    const Slot = world_file.instances.MappedCluster(Kernel.width);
    return struct {
        frame: Frame,
        geometry: Geometry,
        cache: Cache,

        const Self = @This();

        /// The frame to trace, one of so many threads', which lives as long as both. In place;
        /// `deinit` frees what it takes.
        pub fn init(
            own: *Self,
            gpa: Allocator,
            frame: *const Frame,
            thread_count: usize,
        ) error{OutOfMemory}!*const Frame {
            own.cache.slots = &.{};
            if (frame.geometry.shared.runs.len == 0) return frame;
            const share = bytes_max / thread_count / @sizeOf(Slot);
            const slot_count = std.math.clamp(share, slot_count_min, slot_count_max);
            own.cache = .init(try gpa.alloc(Slot, std.math.floorPowerOfTwo(usize, slot_count)));
            own.geometry = frame.geometry.*;
            own.geometry.cluster_cache = &own.cache;
            own.frame = frame.*;
            own.frame.geometry = &own.geometry;
            return &own.frame;
        }

        /// Frees the room.
        pub fn deinit(own: *Self, gpa: Allocator) void {
            gpa.free(own.cache.slots);
        }
    };
}
