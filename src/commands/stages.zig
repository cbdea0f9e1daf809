//! Stages that all commands which render lead a session through in the same way.
//!
//! In: a session at its stage, the options. Out: the session at the next, a report; errors of
//! writing are told from those of reading.

const raylane = @import("raylane");
const Options = raylane.cli.Options;
const Report = raylane.report.Report;
const Session = raylane.session.Session;
const Target = raylane.output.Target;

/// Why there is no picture.
pub const Error = Session.Error || error{OutputFailed};

/// Places the scene as the options have it, unless that is too much to ask.
pub fn pose(session: *Session, options: *const Options) Error!void {
    try session.checkWishes(&options.view, &options.render);
    return session.pose(.{
        .lanes = raylane.variant.compiled[options.render.variant].lanes,
        .tree_quality = options.tree_quality,
        .sharing = .of(options.instances),
        .animation = options.animation,
        .view = options.view,
        .layers = options.render.layers,
    });
}

/// Between the view and tracing: notes what a part will say of itself, and refuses what a file
/// cannot hold. Asserts that the scene is still there where a part is asked for.
pub fn check(session: *Session, options: *const Options) Error!void {
    if (options.render.part != .whole) session.identify(raylane.cli.version);
    session.checkWrite(options.write, options.render.part) catch |err| return ofOutput(err);
}

/// Writes the picture, or one of its layers. Closes the target in any case.
pub fn write(
    session: *Session,
    target: *Target,
    options: *const Options,
    layer: ?raylane.settings.Layer,
) Error!void {
    const written = if (layer) |one|
        session.writeLayer(one, target, options.write)
    else
        session.write(target, options.write);
    written catch |err| return ofOutput(err);
}

/// What was done, for a picture of that name.
pub fn report(session: *Session, options: *const Options, output: []const u8) Error!Report {
    var made = session.report(options.render);
    made.version = raylane.cli.version;
    made.scene = options.scene;
    made.output = output;
    if (options.count_tests) made.tests = try session.countTests(options.render);
    return made;
}

fn ofOutput(err: anytype) Error {
    return switch (err) {
        error.InputOutput => error.OutputFailed,
        else => |other| other,
    };
}
