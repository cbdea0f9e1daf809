//! What `raylane serve` says of itself; its options are those of rendering.

const cli = @import("../cli.zig");

/// What `raylane serve --help` prints.
pub const help: []const u8 = "raylane " ++ cli.version ++
    \\: renders what standard input asks for
    \\
    \\usage: raylane serve [options]
    \\
    \\Each line of standard input is a job, a JSON object whose keys are the long
    \\options of rendering without their dashes, and input:
    \\
    \\  {"id": 1, "input": "a.glb", "output": "a.png", "resolution": [256, 256]}
    \\
    \\Each gets one line on standard output when it is done: its id with the report of
    \\--stats json, or with the error. Jobs are done in turn, each by all threads. A
    \\scene that the job before had, too, is not read again while its files are as
    \\they were. The end of input ends the program with 0.
    \\
    \\Options here are for all jobs that say nothing else; raylane --help has them,
    \\docs/json.md the keys of jobs and answers.
    \\
;

test "the help fits a screen" {
    _ = try @import("testing.zig").expectFits(help);
}
