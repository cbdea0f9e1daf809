//! Whitted's ray tracing (1980): light that comes straight from lights, mirrors and glass, and the
//! environment's smooth light less what is in its way.
//!
//! In: the frame, a bundle's place in the picture. Out: samples on the film, see `ray_tree.zig`.

const world_file = @import("../../world.zig");
const dispatch = @import("../traverse/dispatch.zig");
const environment_light = @import("environment.zig");
const tiles = @import("tiles.zig");
const RayTree = @import("ray_tree.zig").RayTree;
const Rectangle = @import("../../film.zig").Rectangle;

/// One thread's integrator.
pub fn Whitted(comptime Kernel: type) type {
    return RayTree(Kernel, Lighting(Kernel));
}

/// All lights of a sample at every vertex.
fn Lighting(comptime Kernel: type) type {
    return struct {
        const Self = @This();

        pub const Shared = void;
        pub const has_ambient = true;
        pub const stride = 1;

        pub inline fn init(_: *Self, _: *const world_file.Frame, _: *const tiles.Settings) void {}

        pub inline fn partOf(_: *const Self, rectangle: Rectangle, _: usize) ?Rectangle {
            return rectangle;
        }

        pub inline fn start(_: *Self, _: Rectangle) void {}

        pub fn addLights(_: *Self, tree: *Whitted(Kernel), coherence: dispatch.Coherence) void {
            tree.countShadow(environment_light.addLight(
                Kernel,
                &tree.visibility,
                &tree.environment_lights,
                tree.sample.number,
                &tree.receivers(),
                coherence,
                &tree.sample.radiance,
            ));
            tree.addDirect(tree.frame.lights, coherence);
        }

        pub inline fn expose(_: *Self, _: Rectangle, _: u32) void {}
    };
}
