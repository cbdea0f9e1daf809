//! What the program can do, one file a command.
//!
//! In: what the command line asks for. Out: files, a report on standard output, messages on
//! standard error, an exit code. Nothing else prints.

/// Writes reports and messages.
pub const console = @import("commands/console.zig");
/// How a command went.
pub const ExitCode = @import("commands/exit_code.zig").ExitCode;

/// Measures all variants.
pub const bench = @import("commands/bench.zig");
/// Compares two images.
pub const compare = @import("commands/compare.zig");
/// Describes a scene.
pub const info = @import("commands/info.zig");
/// Makes a picture of its parts.
pub const merge = @import("commands/merge.zig");
/// Renders scenes.
pub const render = @import("commands/render.zig");
/// Renders what JSON describes.
pub const scenario = @import("commands/scenario.zig");
/// Renders what jobs on standard input ask for.
pub const serve = @import("commands/serve.zig");
