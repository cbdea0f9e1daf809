//! How a command went: an error of any stage -> the code that the program ends with.

const raylane = @import("raylane");

/// What ends a command. `OutputFailed`: the picture, or what goes with it, cannot be written.
pub const Error = raylane.session.Session.Error || raylane.bench.Error || error{OutputFailed};

/// Says how it went.
pub const ExitCode = enum(u8) {
    ok = 0,
    /// Files or memory.
    failed = 1,
    usage = 2,
    /// The scene is invalid or asks for what is not supported.
    invalid = 3,
    /// Images that must be the same are not.
    differ = 4,
    /// The scene has taken longer than it may.
    timed_out = 124,
    /// 128 and the number of the signal that asked for a picture before it was finished.
    _,

    /// Of what ended a command.
    pub fn of(err: Error) ExitCode {
        return switch (err) {
            error.OutOfMemory, error.InputOutput, error.OutputFailed, error.TimeOver => .failed,
            error.CameraUnknown, error.SceneUnknown => .usage,
            error.MaterialVariantUnknown, error.AnimationUnknown, error.PartUnknown => .usage,
            error.InvalidInput, error.SceneTooLarge => .invalid,
            error.ImagesDiffer => .differ,
            error.Canceled => .timed_out, // Nothing else cancels here.
        };
    }
};
