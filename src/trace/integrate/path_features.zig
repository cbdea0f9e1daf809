//! What paths in lanes see first, for denoisers and compositing: as `features.zig` has it, by
//! chance where surfaces are smooth.
//!
//! In: vertices, escapes and bounces of paths that have only met smooth surfaces. Out: sums in
//! their records, and on the film.

const vec3 = @import("../../math.zig").vec3;
const features_file = @import("features.zig");
const records_file = @import("path_records.zig");
const Film = @import("../../film.zig").Film;
const PathStep = @import("path_step.zig").PathStep;

/// Directions of smooth lobes are denser than this per steradian, those of others are not.
const smooth_pdf_least = 4;

/// Of one path.
pub const Features = struct {
    albedo: [3]f32,
    normal: [3]f32,
    depth: f32,
    depth_share: f32,
    /// 1: what the path meets is what the primary ray sees, else 0.
    sees: f32,

    pub const start: Features = .{
        .albedo = .{ 0, 0, 0 },
        .normal = .{ 0, 0, 0 },
        .depth = 0,
        .depth_share = 0,
        .sees = 1,
    };
};

/// Lanes of those asked for whose paths still show what primary rays see.
fn seeing(
    comptime Kernel: type,
    step: *const PathStep(Kernel),
    asked: Kernel.Rays.Mask,
) Kernel.Rays.Mask {
    const sees =
        records_file.floats(Kernel.Rays, step.features, &step.numbers, "sees");
    return asked.bitAnd(sees.gt(.zero()));
}

/// Adds vertices.
pub noinline fn addVertices(
    comptime Kernel: type,
    step: *PathStep(Kernel),
    asked: Kernel.Rays.Mask,
) void {
    const Rays = Kernel.Rays;
    const F32 = Rays.F32;
    const Vec3 = Rays.Vec3;
    const none: Vec3 = .splat(.{ 0, 0, 0 });
    const lanes = seeing(Kernel, step, asked);
    if (lanes.none()) return;
    const point = &step.vertex.point;
    const mirror = &step.vertex.bsdf.mirror;
    const smooth = isSmooth(Kernel, step).andNot(point.material.unlit);
    const traced: Vec3 = .select(smooth, mirror.reflected.add(mirror.transmitted), none);
    const albedo = features_file.Features(Kernel).albedoOf(&step.vertex);
    const own = albedo.sub(traced).max(none).min(.splat(.{ 1, 1, 1 }));
    const third: Vec3 = .splat(@splat(1.0 / 3.0));
    const worth = step.throughput.dot(third);
    const facing = point.normal.scale(F32.splat(1).sub(traced.dot(third)).mul(worth));
    const features = step.features;
    const numbers = &step.numbers;
    const seen = step.throughput.mul(own);
    records_file.addVectors(Rays, features, numbers, "albedo", lanes, seen);
    records_file.addVectors(Rays, features, numbers, "normal", lanes, facing);
    const first = lanes.bitAnd(step.turns.eq(.zero()));
    const forward: Vec3 = .splat(vec3.normalize(step.frame.view.camera.forward).?);
    const depths = point.distance.mul(point.view.dot(forward).neg()).toArray();
    var bits = first.bits();
    while (bits != 0) : (bits &= bits - 1) {
        const lane = @ctz(bits);
        features[numbers[lane]].depth = depths[lane];
        features[numbers[lane]].depth_share = 1;
    }
}

fn isSmooth(comptime Kernel: type, step: *const PathStep(Kernel)) Kernel.Rays.Mask {
    const limit: Kernel.Rays.F32 = .splat(features_file.smooth_roughness_max);
    return step.vertex.point.material.roughness.le(limit);
}

/// Adds rays that left the scene.
pub noinline fn addEscaped(
    comptime Kernel: type,
    step: *PathStep(Kernel),
    gone: Kernel.Rays.Mask,
) void {
    const Rays = Kernel.Rays;
    const lanes = seeing(Kernel, step, gone);
    const numbers = &step.numbers;
    const seen = step.throughput.min(.splat(.{ 1, 1, 1 }));
    records_file.addVectors(Rays, step.features, numbers, "albedo", lanes, seen);
}

/// Notes which paths that have bounced still show what primary rays see: those of directions of
/// smooth lobes, which are directions alone or dense.
pub noinline fn bounce(
    comptime Kernel: type,
    step: *PathStep(Kernel),
    asked: Kernel.Rays.Mask,
    is_delta: Kernel.Rays.Mask,
    pdf: Kernel.Rays.F32,
) void {
    const narrow = is_delta.bitOr(pdf.gt(.splat(smooth_pdf_least)));
    scatter(Kernel, step, asked.andNot(isSmooth(Kernel, step).bitAnd(narrow)));
}

/// Notes that paths are scattered: what they meet is not what primary rays see.
pub noinline fn scatter(
    comptime Kernel: type,
    step: *PathStep(Kernel),
    asked: Kernel.Rays.Mask,
) void {
    var bits = asked.bits();
    while (bits != 0) : (bits &= bits - 1) step.features[step.numbers[@ctz(bits)]].sees = 0;
}

/// Adds a path's to the film's layers that are kept.
pub fn expose(features: *const Features, film: *Film, x: u32, y: u32, sample: u32) void {
    const layers = film.layers;
    if (layers.contains(.albedo))
        film.addApart(.albedo, x, y, sample, features.albedo ++ .{0});
    if (layers.contains(.normal))
        film.addApart(.normal, x, y, sample, features.normal ++ .{0});
    if (layers.contains(.depth))
        film.addApart(.depth, x, y, sample, .{ features.depth, 0, 0, features.depth_share });
}
