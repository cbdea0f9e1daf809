//! The root of all tests that are compiled for a target, which are one program.
//!
//! In: the library, with the unit tests below its code, and the tests that see it from outside. A
//! program of its own for each of the two would compile the library twice. What is compiled of
//! them, filters say; which of the two a run is of, its argument (tests/runner.zig).

/// The library, for tests/raylane.zig to hand on.
pub const raylane = @import("src/raylane.zig");

test {
    _ = raylane;
    _ = @import("src/sandbox.zig"); // The program's own.
    _ = @import("tests/integration.zig");
}
