//! The fuzzers: a step for each target of fuzz/names.zig.
//!
//! In: a package whose code counts what of it has run. Out: `zig build fuzz:NAME`; options of the
//! program (see docs/fuzzing.md) follow `--`.

const std = @import("std");
const Name = @import("../fuzz/names.zig").Name;
const Package = @import("package.zig");

/// Declares the steps, which share one program for this machine.
pub fn add(package: Package) void {
    const b = package.owner;
    const program = package.renderer("fuzz", "fuzz/main.zig");
    for (std.enums.values(Name)) |name| {
        const run = b.addRunArtifact(program);
        run.setCwd(b.path("."));
        run.has_side_effects = true;
        run.addArg(@tagName(name));
        run.addPassthruArgs();
        const step = b.step(b.fmt("fuzz:{t}", .{name}), b.fmt("Fuzz {s}", .{name.about()}));
        step.dependOn(&run.step);
    }
}
