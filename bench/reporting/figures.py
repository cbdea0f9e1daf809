"""The thesis's figures, drawn from runs of the benchmark.

Each figure has a row of panels a machine and a panel a scene, in it a bar a variant with its 95 %
interval. Colours tell traversals apart (Okabe and Ito's palette, which the colour-blind can tell
apart as well), labels name the variant, so that nothing hangs on colour alone.
"""

import collections
import pathlib

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plot  # noqa: E402  (the backend comes first)
from PIL import Image  # noqa: E402

from . import samples  # noqa: E402

COLOURS = {"single": "#E69F00", "packet2x2": "#56B4E9", "beam": "#0072B2"}
NAMES = {"single": "single rays", "packet2x2": "2x2 packets", "beam": "beams"}
# Beams in older files.
COLOURS["packet"] = COLOURS["beam"]
NAMES["packet"] = NAMES["beam"]
LINES = ["#D55E00", "#0072B2", "#009E73", "#CC79A7"]

STYLE = {
    "font.size": 9,
    "axes.titlesize": 10,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.axisbelow": True,
    "figure.dpi": 110,
    "savefig.dpi": 110,
    "svg.fonttype": "none",
    "svg.hashsalt": "raylane",
    "figure.constrained_layout.use": True,
}

# name: of the file; number: in the thesis; of: (scene, variant) -> estimate; reference: draw 1.
Figure = collections.namedtuple("Figure", "name number title unit of reference energy")

FIGURES = [
    Figure("render-time", "5.1", "Time to render a frame", "ms",
           lambda scene, variant: samples.estimate(variant["trace_ms"]), False, False),
    Figure("render-ratio", "5.3", "Render time, relative to the scalar single-ray tracer",
           "times as fast", samples.render_ratio, True, False),
    Figure("build-time", "5.2", "Time to build the BVH", "ms",
           lambda scene, variant: samples.estimate(variant["bvh_build_ms"]), False, False),
    Figure("build-ratio", "5.4", "BVH build time, relative to the scalar single-ray tracer's",
           "times as fast", samples.build_ratio, True, False),
    Figure("energy", "tables 5.2, 5.4", "Energy of a whole frame", "J",
           samples.energy("whole_j"), False, True),
    Figure("energy-ratio", "tables 5.3, 5.5",
           "Energy of a whole frame, relative to the scalar single-ray tracer", "times less",
           samples.energy_ratio("whole_j"), True, True),
    Figure("triangle-tests", "C.1", "Triangle tests, idle lanes with them", "million a second",
           samples.tests_rate("triangle"), False, False),
    Figure("box-tests", "C.2", "Box tests, idle lanes with them", "million a second",
           samples.tests_rate("box"), False, False),
    Figure("triangle-tests-ratio", "C.3", "Triangle tests a second, relative", "times as many",
           samples.tests_ratio("triangle"), True, False),
    Figure("box-tests-ratio", "C.4", "Box tests a second, relative", "times as many",
           samples.tests_ratio("box"), True, False),
    Figure("primary-rays", "C.5", "Primary rays", "million a second",
           samples.rays_rate("primary"), False, False),
    Figure("shadow-rays", "C.5", "Shadow rays", "million a second",
           samples.rays_rate("shadow"), False, False),
    Figure("secondary-rays", "C.5", "Secondary rays", "million a second",
           samples.rays_rate("secondary"), False, False),
    Figure("rays-per-joule", "C.7", "Rays for each joule, whole frame", "thousand rays/J",
           samples.rays_per_joule("whole_j"), False, True),
    Figure("rays-per-joule-tracing", "C.7", "Rays for each joule, tracing alone",
           "thousand rays/J", samples.rays_per_joule("trace_j"), False, True),
    Figure("boxes-per-triangle", "C.8", "Box tests for each triangle test", "tests",
           samples.boxes_per_triangle, False, False),
]


def draw_all(runs, folder, formats):
    """Draws what the runs hold; returns [(figure's name, number, title)] of what was drawn."""
    drawn = []
    with plot.rc_context(STYLE):
        for figure in FIGURES:
            shown = [run for run in runs if not figure.energy or samples.has_energy(run)]
            if shown:
                save(draw(figure, shown), folder, figure.name, formats)
                drawn.append((figure.name, figure.number, figure.title))
        scaled = [run for run in runs if run["scaling"]]
        if scaled:
            save(draw_scaling(scaled), folder, "scaling", formats)
            drawn.append(("scaling", "5.5", "More threads"))
    return drawn


def draw(figure, runs):
    """One figure of bars."""
    column_count = max(len(run["scenes"]) for run in runs)
    variant_counts = [len(run["scenes"][0]["variants"]) for run in runs]
    height = 1.1 + sum(0.19 * count + 0.55 for count in variant_counts)
    width = 1.9 + 2.1 * column_count
    drawing, axes = plot.subplots(len(runs), column_count, figsize=(width, height), squeeze=False,
                                  height_ratios=variant_counts, sharey="row")
    for run, row in zip(runs, axes):
        for axis in row[len(run["scenes"]):]:
            axis.set_visible(False)
        for axis, scene in zip(row, run["scenes"]):
            draw_panel(axis, figure, scene)
        if len(runs) > 1:
            scene_title = row[0].get_title(loc="left")
            row[0].set_title(f"{run['machine']['processor']}\n{scene_title}", loc="left")
    for axis in axes[-1]:
        axis.set_xlabel(figure.unit)
    names = [variant["name"] for run in runs for variant in run["scenes"][0]["variants"]]
    add_legend(drawing, names)
    drawing.suptitle(figure.title)
    return drawing


def draw_panel(axis, figure, scene):
    """One scene's bars, the first variant on top."""
    names = [variant["name"] for variant in scene["variants"]]
    values = [figure.of(scene, variant) for variant in scene["variants"]]
    known = [(index, value) for index, value in enumerate(values) if value is not None]
    axis.barh([index for index, _ in known], [value[0] for _, value in known], height=0.78,
              color=[COLOURS[names[index].split("-")[1]] for index, _ in known])
    bars = [(index, value) for index, value in known if value[1] is not None]
    axis.errorbar([value[0] for _, value in bars], [index for index, _ in bars],
                  xerr=[value[1] for _, value in bars], fmt="none", ecolor="black",
                  elinewidth=0.9, capsize=1.8)
    if figure.reference:
        axis.axvline(1, color="black", linewidth=0.8, linestyle=(0, (3, 2)))
    axis.set_yticks(range(len(names)), names)
    axis.set_ylim(len(names) - 0.4, -0.6)
    axis.set_xlim(left=0)
    axis.tick_params(axis="y", length=0)
    axis.xaxis.set_major_locator(matplotlib.ticker.MaxNLocator(4, min_n_ticks=3))
    axis.grid(axis="x", color="#DDDDDD", linewidth=0.7)
    axis.set_title(samples.short(scene["scene"]), loc="left")


def add_legend(drawing, names):
    """Names of the colours that are there."""
    traversals = list(dict.fromkeys(name.split("-")[1] for name in names))
    handles = [matplotlib.patches.Patch(color=COLOURS[traversal]) for traversal in traversals]
    labels = [NAMES[traversal] for traversal in traversals]
    drawing.legend(handles, labels, loc="outside lower center", ncols=3, frameon=False)


def draw_scaling(runs):
    """Speed by threads, the interval as a band, and what would be ideal."""
    drawing, axes = plot.subplots(1, len(runs), figsize=(0.8 + 4.2 * len(runs), 3.6),
                                  squeeze=False)
    for run, axis in zip(runs, axes[0]):
        for colour, marker, name in zip(LINES, "os^D", variants_of(run)):
            rows = [row for row in run["scaling"] if row["variant"] == name]
            alone = next(row for row in rows if row["threads"] == 1)
            points = [(row["threads"], samples.ratio(alone["trace_ms"], row["trace_ms"]))
                      for row in rows]
            threads = [count for count, _ in points]
            means = [value[0] for _, value in points]
            halves = [value[1] or 0 for _, value in points]
            axis.plot(threads, means, color=colour, marker=marker, markersize=4, label=name)
            axis.fill_between(threads, [mean - half for mean, half in zip(means, halves)],
                              [mean + half for mean, half in zip(means, halves)],
                              color=colour, alpha=0.2, linewidth=0)
        most = max(row["threads"] for row in run["scaling"])
        axis.plot([1, most], [1, most], color="black", linewidth=0.8, linestyle=(0, (3, 2)),
                  label="ideal")
        axis.set_xlabel("threads")
        axis.set_ylabel("times as fast as one thread")
        axis.xaxis.set_major_locator(matplotlib.ticker.MaxNLocator(6, integer=True))
        axis.grid(color="#DDDDDD", linewidth=0.7)
        scene = samples.short(run["scaling"][0]["scene"])
        axis.set_title(f"{scene}, {run['machine']['processor']}", loc="left")
        axis.legend(frameon=False, loc="upper left")
    return drawing


def variants_of(run):
    """Those that were run by more and more threads."""
    return list(dict.fromkeys(row["variant"] for row in run["scaling"]))


def save(drawing, folder, name, formats):
    """Writes a figure in each format, the same bytes for the same data."""
    for suffix in formats:
        path = pathlib.Path(folder) / f"{name}.{suffix}"
        metadata = {"Date": None} if suffix == "svg" else {"Software": None}
        drawing.savefig(path, metadata=metadata)
        if suffix == "png":
            # As many colours as are needed make the file a third as large.
            with Image.open(path) as image:
                image.convert("RGB").quantize(64, dither=Image.Dither.NONE).save(path,
                                                                                 optimize=True)
        if suffix == "svg":
            lines = path.read_text(encoding="utf-8").splitlines()
            path.write_text("".join(line.rstrip() + "\n" for line in lines), encoding="utf-8")
    plot.close(drawing)
