//! The options of rendering: the table that the command line is read by, and that its help,
//! completions and manual are made of. Limits and defaults come from `settings`.

const std = @import("std");
const arguments_file = @import("arguments.zig");
const settings = @import("../settings.zig");
const variant_file = @import("../variant.zig");
const comptimePrint = std.fmt.comptimePrint;
const namesOf = arguments_file.namesOf;
const wordsOf = arguments_file.wordsOf;

/// What a resolution is, for messages.
pub const expected_resolution = std.fmt.comptimePrint("WxH, each {s}, 2^{d} pixels at most", .{
    settings.side.text(), std.math.log2_int(u32, settings.pixel_count_max),
});

/// The same, or what the long side alone is.
pub const expected_size = std.fmt.comptimePrint("{s}, or {s} for the long side", .{
    expected_resolution, settings.long_side.text(),
});

/// How to render scenes.
/// Form of the report.
pub const Stats = enum { text, json, none };

/// By title, in the order of the help.
pub const sections: []const arguments_file.Section = &.{
    .{ .title = "Image", .options = &.{
        .{
            .usage = "-o, --output FILE",
            .help = "name ending in a format, or a template of names; - is\nstandard output",
            .also = &.{ "--outfile", "--output-file" },
        },
        .{
            .usage = "--format FORMAT",
            .words = wordsOf(settings.Format),
            .help = "png, jpg, webp, tga, bmp or ppm, linear: hdr, pfm or\n" ++
                "exr, or a film: y4m",
        },
        .{ .usage = "--jpeg-quality N", .help = settings.jpeg_quality.textWithDefault() },
        .{
            .usage = "--webp-quality N",
            .help = settings.webp_quality.text() ++ ", with loss (default: without)",
        },
        .{
            .usage = "--exr KIND",
            .words = wordsOf(settings.ExrKind),
            .help = "half or float: colours of an EXR file (default: half)",
        },
        .{
            .usage = "-r, --resolution WxH|N",
            .help = comptimePrint("size in pixels, or of the long side in the camera's\n" ++
                "aspect (default: the scene's own, or {d})", .{settings.long_side.default}),
            .also = &.{"--size"},
            .meant = &.{ "--geometry", "--res" },
        },
        .{ .usage = "--width N", .help = "with --height N: -r in two numbers" },
        .{ .usage = "--height N", .help = "with --width N" },
        .{
            .usage = "--pixel-ratio N",
            .help = "multiply both sides of that size, " ++ settings.pixel_ratio.textWithDefault(),
            .also = &.{"--device-pixel-ratio"},
        },
        .{
            .usage = "--crop X0,Y0,X1,Y1",
            .help = "a part alone: pixels, or fractions where a dot is in\n" ++
                "them; exr files of parts can be merged",
        },
        .{
            .usage = "--tile I/N",
            .help = "1/N of the picture in tiles all over it, an exr file;\n" ++
                "'raylane merge' makes the picture of all I",
        },
        .{
            .usage = "--exposure EV|auto",
            .words = &.{"auto"},
            .help = "brighten by EV stops, or by what is seen (default:\n" ++
                "auto for scenes with lights of their own, else 0)",
        },
        .{
            .usage = "--tonemap CURVE",
            .words = wordsOf(settings.ToneMapping),
            .help = namesOf(settings.ToneMapping) ++ " (default: neutral)",
            .also = &.{ "--tone-mapping", "--tonemapping" },
        },
        .{
            .usage = "--background WHAT",
            .words = &.{ "env", "studio", "transparent" },
            .help = "env, studio, transparent, a CSS colour (red, #rrggbb)\n" ++
                "or radiance R,G,B (default: a grey gradient)",
            .meant = &.{ "--bg", "--background-color" },
        },
        .{
            .usage = "--layers LIST",
            .words = wordsOf(settings.Layer),
            .help = "depth,normal,albedo,uv,node,material,primitive,alpha,\n" ++
                "position,cost,variance: channels of an EXR file, or\n" ++
                "files of their own by {layer} in the output's name",
        },
        .{
            .usage = "--shade LOOK",
            .words = wordsOf(settings.Shade),
            .help = "a quick look, not lit: ao, normal, uv or cost",
        },
    } },
    .{ .title = "Several pictures (see docs/batch.md)", .options = &.{
        .{
            .usage = "--frames RANGE",
            .help = "of the animation, 1-10,12,20-40:2, at frame / fps\nseconds",
        },
        .{ .usage = "--fps F", .help = "24 (default), 23.976 or 30000/1001, say" },
        .{
            .usage = "--reference-frame F",
            .help = "whose exposure, framing and studio all frames have,\n" ++
                "a range's first (default: the first of --frames)",
        },
        .{
            .usage = "--turntable N",
            .help = "views all around, from --orbit on (default: " ++
                comptimePrint("{d},{d})", .{
                    settings.orbit_turntable.theta_degrees, settings.orbit_turntable.phi_degrees,
                }),
        },
        .{ .usage = "--views RANGE", .help = "only these of them, from 0 on" },
        .{ .usage = "--skip-existing", .help = "leave pictures as they are that are there" },
        .{
            .usage = "--jobs N",
            .help = "scenes side by side, " ++ settings.job_count.text() ++
                "\n(default: by their number and the pictures' size)",
        },
    } },
    .{ .title = "Camera", .options = &.{
        .{
            .usage = "--camera WHICH",
            .words = &.{"auto"},
            .help = "name or index of a camera, or auto: all in view",
            .also = &.{"--camera-index"},
        },
        .{
            .usage = "--eye X,Y,Z",
            .help = "where the camera stands, in place of the file's",
            .also = &.{"--camera-position"},
        },
        .{
            .usage = "--target X,Y,Z",
            .help = "what it looks at (default: the middle of the scene)",
            .also = &.{"--camera-focal-point"},
            .meant = &.{ "--look-at", "--camera-target" },
        },
        .{
            .usage = "--up X,Y,Z",
            .help = "what is upwards in the picture (default: 0,1,0)",
            .also = &.{"--camera-view-up"},
        },
        .{
            .usage = "--orbit THETA,PHI,R",
            .help = "stand about the target, degrees from +z and from\n" ++
                "above, R metres or percent (default: 100%, all seen)",
            .meant = &.{"--camera-orbit"},
        },
        .{
            .usage = "--fov DEG",
            .help = "vertical angle of view, in place of the camera's",
            .also = &.{"--camera-view-angle"},
            .meant = &.{"--field-of-view"},
        },
        .{
            .usage = "--ortho",
            .help = "no perspective",
            .also = &.{ "--orthographic", "--camera-orthographic" },
        },
        .{
            .usage = "--frame-all",
            .help = "frame all that the animation shows at any time",
        },
    } },
    .{ .title = "Scene", .options = &.{
        .{ .usage = "--scene WHICH", .help = "name or index of a scene of a glTF file" },
        .{
            .usage = "--material-variant N",
            .help = "name or index of one of its variants of materials",
            .also = &.{"--variant-name"},
        },
        .{
            .usage = "--animation WHICH",
            .words = &.{"all"},
            .help = "name or index of an animation, or all (default: none)",
            .also = &.{ "--animation-index", "--animation-name" },
        },
        .{
            .usage = "--animation-time S",
            .help = "seconds since its start (default: 0)",
        },
        .{
            .usage = "--up-axis AXIS",
            .words = wordsOf(settings.UpAxis),
            .help = "y or z: which axis of the file points up (STL: z)",
        },
        .{
            .usage = "--format-in FORMAT",
            .words = wordsOf(settings.SceneFormat),
            .help = namesOf(settings.SceneFormat) ++ ", whatever it holds",
        },
        .{
            .usage = "--env FILE",
            .words = &.{ "studio", "none" },
            .help = "light from all around: an equirectangular image of\n" ++
                "radiance (exr, hdr, png), studio or none (default:\n" ++
                "the scene's, or studio, dim around its own lights)",
            .also = &.{ "--hdri", "--hdri-file", "--environment" },
            .meant = &.{ "--ibl", "--environment-image" },
        },
        .{ .usage = "--env-intensity X", .help = "multiplies its radiance (default: 1)" },
        .{
            .usage = "--env-rotation DEG",
            .help = "turn it about y, counter-clockwise from above (the\n" ++
                "studio otherwise turns with the camera)",
        },
        .{
            .usage = "--env-shadows N",
            .help = "directional lights a sample that stand for it, to\n" ++
                "find how much of it arrives, " ++ settings.environment_shadow_count.text() ++
                comptimePrint("\n(default: {d}, with a floor {d}; 0: all of it)", .{
                    settings.environment_shadow_count.default, settings.floor_shadow_count,
                }),
        },
        .{
            .usage = "--floor WHAT",
            .words = wordsOf(settings.Floor),
            .help = "shadow: a floor that shows it, or none (default)",
        },
        .{
            .usage = "--ambient L",
            .help = comptimePrint("radiance from all sides (default: {d} for scenes\n" ++
                "without lights, otherwise 0)", .{settings.ambient_default}),
        },
        .{
            .usage = "--point-size PIXELS",
            .help = comptimePrint("width of points and lines in the automatic view,\n" ++
                "{d} to {d} (default: {d})", .{
                settings.point_size.min,     settings.point_size.max,
                settings.point_size.default,
            }),
        },
        .{
            .usage = "--tessellation N",
            .help = "straight pieces of a circle in curved PBRT shapes,\n" ++
                settings.tessellation.textWithDefault(),
        },
        .{
            .usage = "--max-texture-size N",
            .help = comptimePrint("halve larger images on loading until no side is\n" ++
                "longer, {s}", .{settings.texture_side.text()}),
        },
        .{
            .usage = "--allow-outside",
            .help = "let the scene name files outside of its own folder",
        },
        .{
            .usage = "--sandbox WHEN",
            .words = wordsOf(settings.Sandbox),
            .help = "keep the program from files elsewhere, the network\n" ++
                "and other programs: auto (default), where Linux can;\n" ++
                "on, or it is an error; off",
        },
        .{
            .usage = "--strict",
            .help = "refuse files that break the rules of their format in\n" ++
                "ways that are otherwise forgiven with a warning",
        },
        .{
            .usage = "--force",
            .help = "render what requires extensions that are not known,\nas far as it goes",
        },
    } },
    .{ .title = "Rendering (PBRT scenes bring their own spp and depth)", .options = &.{
        .{
            .usage = "--spp N",
            .help = comptimePrint("samples a pixel, {s} (default: {d}, or {d} where\n" ++
                "the long side is below {d}; path: {d})", .{
                settings.sample_count.text(), settings.sample_count.default,
                settings.sample_count_small,  settings.side_small,
                settings.sample_count_path,
            }),
            .also = &.{ "--samples", "--samples-per-pixel" },
        },
        .{
            .usage = "--noise E",
            .help = comptimePrint("path: no more samples where pixels have a standard\n" ++
                "error below E, white being 1; --spp is then the\n" ++
                "most (default: {d})", .{settings.noise_sample_count}),
        },
        .{
            .usage = "--time-budget S",
            .help = "as many samples, --spp at most, as fit into S seconds\n" ++
                "of tracing; says the --spp with the same picture",
        },
        .{
            .usage = "--progress-image OUT",
            .help = "the picture so far, every two seconds, as a whole,\nencoded as the output is",
        },
        .{
            .usage = "--partial",
            .help = "INT (Ctrl-C) or TERM during tracing ends it, and the\n" ++
                "picture so far is written; once more ends all",
        },
        .{
            .usage = "--depth N",
            .help = comptimePrint("reflections and refractions in a row, {s}\n" ++
                "(default: {d}; path, all bounces of light: {d})", .{
                settings.depth.text(), settings.depth.default, settings.depth_path,
            }),
            .also = &.{ "--max-depth", "--maxdepth", "--bounces", "--max-bounces" },
        },
        .{
            .usage = "--thesis",
            .help = comptimePrint("{d}x{d}, {d} sample, depth {d}, linear, all CPUs; what\n" ++
                "follows it still counts", .{
                settings.thesis.resolution[0], settings.thesis.resolution[1],
                settings.thesis.sample_count,  settings.thesis.depth,
            }),
        },
        .{
            .usage = "-t, --threads N",
            .help = settings.thread_count.text() ++ " (default: as many as CPUs)",
            .also = &.{ "--nthreads", "--num-threads" },
        },
        .{
            .usage = "--tile-size N",
            .help = comptimePrint("pixels on the side of a piece of work, {s} in\n" ++
                "steps of {d} (default: {d})", .{
                settings.tile_size.text(),  settings.tile_size_step,
                settings.tile_size.default,
            }),
        },
        .{
            .usage = "--bvh QUALITY",
            .words = wordsOf(settings.TreeQuality),
            .help = namesOf(settings.TreeQuality) ++ ": time to build the scene's tree\n" ++
                "against time to trace; the image is always the same",
        },
        .{
            .usage = "--instances HOW",
            .words = wordsOf(settings.Instances),
            .help = namesOf(settings.Instances) ++ ": whether a mesh is\n" ++
                "held once for all its instances: less memory, more\n" ++
                "time; the image is always the same",
        },
        .{
            .usage = "--integrator NAME",
            .words = wordsOf(settings.Integrator),
            .help = namesOf(settings.Integrator) ++ " (default: whitted)",
        },
        .{
            .usage = "--virtual-lights N",
            .help = "of '--integrator lights' a sample, " ++
                settings.virtual_light_count.text() ++ "\n" ++
                comptimePrint("(default: {d})", .{settings.virtual_light_count.default}),
        },
        .{
            .usage = "--sky-lights N",
            .help = "the same that stand for the environment, " ++
                settings.sky_light_count.text() ++ "\n" ++
                comptimePrint("(default: {d})", .{settings.sky_light_count.default}),
        },
        .{
            .usage = "--all-lights",
            .help = "every pixel has all of a sample's lights, not a\n" ++
                "ninth of them and its neighbours' by a filter",
        },
        .{ .usage = "--denoise", .help = "filter the noise out" },
        .{
            .usage = "--variant NAME",
            .words = variant_file.names,
            .help = "how rays are traced; the image is always the same",
        },
        .{
            .usage = "--list-variants",
            .help = "print the names of the variants, the default first",
        },
    } },
    .{ .title = "Limits (see docs/limits.md)", .options = &.{
        .{
            .usage = "--max-memory SIZE",
            .help = "512M or 2G, say (default: three quarters of what the\n" ++
                "machine or the process's cgroup has left)",
        },
        .{
            .usage = "--max-time S",
            .help = "seconds for a scene, from reading to writing\n(default: no limit)",
            .meant = &.{ "--timeout", "--time-limit" },
        },
        .{
            .usage = "--max-triangles N",
            .help = comptimePrint("with all instances, 5M, say (default: {d},\n" ++
                "or as many as bytes are read)", .{settings.triangle_count_max}),
        },
        .{
            .usage = "--max-pixels N",
            .help = comptimePrint("of a picture (default: {d}, of what the scene\n" ++
                "asks for {d})", .{
                settings.pixel_count_max, settings.scene_pixel_count_max,
            }),
        },
        .{
            .usage = "--max-texture-pixels N",
            .help = comptimePrint("of all images of a scene (default: {d})", .{
                settings.texture_pixel_count_max,
            }),
        },
    } },
    .{ .title = "Messages", .options = &.{
        .{
            .usage = "--stats FORM",
            .words = wordsOf(Stats),
            .help = "report as " ++ namesOf(Stats) ++ " (default: text, or none\n" ++
                "when the image goes to standard output); when it is\n" ++
                "given, a report that cannot be printed is an error",
            .meant = &.{"--json"},
        },
        .{
            .usage = "--scenario FILE|JSON",
            .help = "options as JSON (docs/json.md), or scenarios of\n" ++
                "Khronos's render fidelity comparison; what else the\n" ++
                "command line says counts more",
        },
        .{
            .usage = "--progress HOW",
            .words = wordsOf(settings.ProgressForm),
            .help = "auto: a line on a terminal; json: lines for programs,\n" ++
                "see docs/progress.md; or none",
        },
        .{ .usage = "--progress-fd N", .help = "json to that descriptor, not to stderr" },
        .{
            .usage = "--count-tests",
            .help = "count intersection tests, in a second, untimed pass",
        },
        .{ .usage = "-q, --quiet", .help = "no warnings, no progress, no report but by --stats" },
        .{ .usage = "-v, --verbose", .help = "say what was chosen by default" },
        .{ .usage = "-h, --help", .help = "print this" },
        .{ .usage = "-V, --version", .help = "print the version" },
        .{
            .usage = "--licenses",
            .help = "print the licence, and those of the libraries used",
            .also = &.{ "--license", "--licence" },
        },
    } },
};
