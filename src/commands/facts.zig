//! What `--verbose` says: what was chosen where the user did not.

const console = @import("console.zig");
const raylane = @import("raylane");
const Io = @import("std").Io;
const Options = raylane.cli.Options;
const Session = raylane.session.Session;
const quote = raylane.diagnostic.quote;

/// Of a scene that is posed and viewed. Asserts that the session still has it.
pub fn say(io: Io, options: *const Options, session: *const Session) void {
    if (!options.verbose) return;
    const name = options.scene;
    sayVariants(io, options, session);
    sayAnimations(io, options, session);
    const world = &session.world.?;
    if (world.facts.camera_is_default)
        console.sayOf(io, name, "view: framed on all there is", .{});
    if (world.facts.environment_is_default) {
        const dimmed = if (world.facts.own_light_count > 0) ", dimmed" else "";
        console.sayOf(io, name, "environment: the studio{s}", .{dimmed});
    }
    if (world.facts.lights_are_default) {
        console.sayOf(io, name, "lights: three directional ones fixed to the camera", .{});
    } else {
        console.sayOf(io, name, "lights: {d}", .{world.lights.len});
    }
    console.sayOf(io, name, "ambient radiance: {d}", .{world.environment.ambient});
    console.sayOf(io, name, "tracer: {s}, {d} threads", .{
        raylane.variant.names[options.render.variant], session.pool.thread_count,
    });
    if (world.facts.degenerate_count > 0) {
        const count = world.facts.degenerate_count;
        console.sayOf(io, name, "{d} triangles without area left out", .{count});
    }
}

/// The same of what the file offers besides.
fn sayVariants(io: Io, options: *const Options, session: *const Session) void {
    if (options.load.material_variant != .default) return;
    for (session.scene.?.material_variants, 0..) |name, index| console.sayOf(
        io,
        options.scene,
        "material variant {d}: {f}, not chosen",
        .{ index, quote(name) },
    );
}

/// And of its animations; which one is shown where nobody asked for it.
fn sayAnimations(io: Io, options: *const Options, session: *const Session) void {
    if (options.animation.which != .default) return;
    const moment = session.posed.?.moment;
    for (session.scene.?.animations, 0..) |*animation, index| {
        const name = quote(animation.name);
        const span = animation.span() orelse continue;
        if (moment.running == .one and moment.running.one == index) {
            const format = "animation {d}: {f} at {d} s, for at rest not all is seen";
            console.sayOf(io, options.scene, format, .{ index, name, moment.time_s });
        } else {
            const format = "animation {d}: {f}, {d} to {d} s, not chosen";
            console.sayOf(io, options.scene, format, .{ index, name, span[0], span[1] });
        }
    }
}
