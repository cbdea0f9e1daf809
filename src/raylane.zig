//! Raylane as a library: `@import("raylane")`.
//!
//! The way of the data, parse -> Scene -> prepare -> World -> trace -> Film -> output, with one
//! declaration for each top-level file. Programs, tests and tools import this root and nothing
//! below it; its test block pulls in the tests of every file.

const std = @import("std");

pub const batch = @import("batch.zig");
pub const bench = @import("bench.zig");
pub const builtin = @import("builtin.zig");
pub const call_stack = @import("call_stack.zig");
pub const cli = @import("cli.zig");
pub const compare = @import("compare.zig");
pub const decode = @import("decode.zig");
pub const denoise = @import("denoise.zig");
pub const diagnostic = @import("diagnostic.zig");
pub const display = @import("display.zig");
pub const energy = @import("energy.zig");
pub const film = @import("film.zig");
pub const huge_pages = @import("huge_pages.zig");
pub const identity = @import("identity.zig");
pub const image = @import("image.zig");
/// The project's licence and those of what a program is made of.
pub const licenses = @import("licenses").text;
pub const info = @import("info.zig");
pub const json_text = @import("json_text.zig");
pub const manifest = @import("manifest.zig");
pub const math = @import("math.zig");
pub const memory_account = @import("memory_account.zig");
pub const memory_functions = @import("memory_functions.zig");
pub const output = @import("output.zig");
pub const merge = @import("merge.zig");
pub const parallel = @import("parallel.zig");
pub const parse = @import("parse.zig");
pub const part = @import("part.zig");
pub const prepare = @import("prepare.zig");
pub const processor = @import("processor.zig");
pub const progress = @import("progress.zig");
pub const report = @import("report.zig");
pub const scene = @import("scene.zig");
pub const session = @import("session.zig");
pub const settings = @import("settings.zig");
pub const simd = @import("simd.zig");
pub const statistics = @import("statistics.zig");
pub const trace = @import("trace.zig");
pub const variant = @import("variant.zig");
pub const world = @import("world.zig");

comptime {
    @export(&trace.link.panicOfKernel, .{ .name = trace.link.panic_symbol });
    // One for all levels of a program, which share libwebp.
    if (variant.level.len == 0) output.exportWebpFunctions();
}

test {
    std.testing.refAllDecls(@This());
}
