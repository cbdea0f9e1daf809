//! Many pictures at once: which files, frames and views, and what each picture is called.
//!
//! In: inputs and a template as on the command line. Out: a plan for somebody to carry out.

/// Ranges of numbers.
pub const frames = @import("batch/frames.zig");
/// Names of pictures.
pub const template = @import("batch/template.zig");
/// Scene files.
pub const File = inputs.File;
/// Finds scene files.
pub const gather = inputs.gather;
/// See `gather`.
pub const Found = inputs.Found;
/// What is to be made.
pub const Plan = plan.Plan;
/// See `Plan`.
pub const Wanted = plan.Wanted;
/// Makes a plan.
pub const makePlan = plan.make;
/// See `makePlan`.
pub const PlanError = plan.Error;

const inputs = @import("batch/inputs.zig");
const plan = @import("batch/plan.zig");

test {
    _ = frames;
    _ = template;
    _ = inputs;
    _ = plan;
}
