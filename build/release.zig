//! What is released: programs that run on every processor of their architecture, and packages.
//!
//! In: the checked third-party headers. Out: a static program for each architecture, its code
//! compiled for several levels of processors where newer ones have wider registers or more
//! instructions; src/release.zig chooses. packages.py wraps them up.

const std = @import("std");
const manifest = @import("../build.zig.zon");
const Package = @import("package.zig");
const libraries = @import("libraries.zig");
const LazyPath = std.Build.LazyPath;
const Model = std.Target.Cpu.Model;
const Compile = std.Build.Step.Compile;

/// A level of processors, by its name in src/processor.zig.
const Level = struct {
    name: []const u8,
    cpu: *const Model,
    /// What LLVM believes of it and is not so.
    without: std.Target.Cpu.Feature.Set = .empty,
    /// Small for those that hardly anybody has any more.
    optimize: std.lang.Optimize = .fast,
};

/// One that programs are released for.
const Architecture = struct {
    arch: std.Target.Cpu.Arch,
    /// What runs on all of its processors.
    lowest: *const Model,
    /// The lowest first; none: the code for `lowest` is that for all.
    levels: []const Level = &.{},
};

const architectures = [_]Architecture{
    .{
        .arch = .x86_64,
        .lowest = &std.Target.x86.cpu.x86_64,
        .levels = &.{
            .{ .name = "x86-64", .cpu = &std.Target.x86.cpu.x86_64, .optimize = .small },
            .{ .name = "x86-64-v2", .cpu = &std.Target.x86.cpu.x86_64_v2 },
            .{ .name = "x86-64-v3", .cpu = &std.Target.x86.cpu.x86_64_v3 },
            .{
                .name = "x86-64-v4",
                .cpu = &std.Target.x86.cpu.x86_64_v4,
                // Its model is the first of them; those of today are quickest with all lanes.
                .without = std.Target.x86.featureSet(&.{.prefer_256_bit}),
            },
        },
    },
    .{ .arch = .aarch64, .lowest = &std.Target.aarch64.cpu.generic },
    // The first with the calling convention of hard floats; it is told what is missing.
    .{ .arch = .arm, .lowest = &std.Target.arm.cpu.arm1176jzf_s, .levels = &.{
        .{ .name = "armv7-neon", .cpu = &std.Target.arm.cpu.cortex_a8 },
        .{ .name = "armv7-neon-vfpv4", .cpu = &std.Target.arm.cpu.cortex_a15 },
    } },
};

/// What released programs hold besides what every program does.
pub const optional: libraries.Optional = .{ .draco = true };

/// Makes `step` build what is released into zig-out/release, and `test_step` test it under qemu; a
/// step for each program alone.
pub fn add(
    step: *std.Build.Step,
    test_step: *std.Build.Step,
    headers: LazyPath,
) void {
    const b = step.owner;
    const options: Package.Options = .{
        .backend = .vector,
        .traversal = .beam,
        .lanes = null,
        .extent = .few,
        .is_stripped = true,
        .optional = optional,
    };
    const wrap = b.addSystemCommand(&.{ "python3", "-B" });
    wrap.setName("build/packages.py");
    wrap.addFileArg(b.path("build/packages.py"));
    wrap.addArgs(&.{ "--version", manifest.version, "--output" });
    const packages = wrap.addOutputDirectoryArg("release");
    var native: ?*Compile = null;
    for (&architectures) |*architecture| {
        const program = programOf(b, architecture, headers, options);
        if (architecture.arch == b.graph.host.result.cpu.arch) native = program;
        const name = b.fmt("{t}", .{architecture.arch});
        wrap.addArtifactArg2(program, .{ .prefix = b.fmt("{s}=", .{name}), .make_absolute = true });
        const single = b.step(
            b.fmt("release:{s}", .{name}),
            b.fmt("Build the program for all {s} processors", .{name}),
        );
        single.dependOn(&b.addInstallArtifact(program, .{
            .dest_dir = .{ .override = .{ .custom = "release" } },
            .dest_sub_path = b.fmt("raylane-{s}-linux-{s}", .{ manifest.version, name }),
        }).step);
    }
    wrap.addArg("--native");
    wrap.addArtifactArg(native.?); // Raylane is built where it runs.
    step.dependOn(&b.addInstallDirectory(.{
        .source_dir = packages,
        .install_dir = .{ .custom = "release" },
        .install_subdir = "",
    }).step);
    const tests = b.addSystemCommand(&.{ "python3", "-B" });
    tests.addFileArg(b.path("build/test_release.py"));
    tests.has_side_effects = true;
    tests.addDirectoryArg(packages);
    test_step.dependOn(&tests.step);
}

fn programOf(
    b: *std.Build,
    architecture: *const Architecture,
    headers: LazyPath,
    options: Package.Options,
) *Compile {
    const lowest = targetOf(b, architecture.arch, architecture.lowest, .empty);
    if (architecture.levels.len == 0)
        return Package.init(b, lowest, .fast, headers, options).program();
    const levels = b.allocator.alloc(Package, architecture.levels.len) catch @panic("OOM");
    for (levels, architecture.levels) |*package, level| {
        var own = options;
        own.part = .{ .level = level.name };
        const target = targetOf(b, architecture.arch, level.cpu, level.without);
        package.* = .init(b, target, level.optimize, headers, own);
    }
    var own = options;
    own.part = .shared;
    own.backend = .scalar;
    own.traversal = .single;
    own.lanes = 4;
    const shared: Package = .init(b, levels[0].target, .fast, headers, own);
    return shared.dispatcher(lowest, levels);
}

fn targetOf(
    b: *std.Build,
    arch: std.Target.Cpu.Arch,
    cpu: *const Model,
    without: std.Target.Cpu.Feature.Set,
) std.Build.ResolvedTarget {
    return b.resolveTargetQuery(.{
        .cpu_arch = arch,
        .cpu_model = .{ .explicit = cpu },
        .cpu_features_sub = without,
        .os_tag = .linux,
        .abi = if (arch == .arm) .musleabihf else .musl,
    });
}
