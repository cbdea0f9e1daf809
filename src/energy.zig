//! What work costs in joules.
//!
//! In: the place of the kernel's files (`/sys`, or a copy of it), or a command that measures. Out:
//! a source of energy readings that was found there, or why there is none; and a meter that reads
//! it from a thread of its own while others work, and says what lies between two moments.

const discover = @import("energy/discover.zig");
const meter = @import("energy/meter.zig");
const source = @import("energy/source.zig");

pub const Interval = meter.Interval;
pub const Mark = meter.Mark;
pub const Meter = meter.Meter;
pub const Source = source.Source;
pub const Wanted = discover.Wanted;
pub const find = discover.find;
/// Reads a file such as those of the kernel.
pub const readSystemFile = source.readSystemFile;

test {
    _ = discover;
    _ = meter;
    _ = source;
}
