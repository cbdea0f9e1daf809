"""The report as one HTML page: what was measured, beside what the thesis published.

In: runs, and the figures that were drawn. Out: text; whatever comes from a file is escaped.
"""

import html

from . import samples, thesis

STYLE = """
body { font: 15px/1.5 system-ui, sans-serif; max-width: 70em; margin: 2em auto; padding: 0 1em;
  color: #222; background: #fff; }
table { border-collapse: collapse; margin: 1em 0; font-size: 14px; }
th, td { padding: 0.2em 0.8em; text-align: right; border-bottom: 1px solid #ddd; }
th:first-child, td:first-child { text-align: left; }
caption { text-align: left; font-weight: 600; padding-bottom: 0.4em; }
img { max-width: 100%; height: auto; }
figure { margin: 2em 0; } figcaption { color: #555; }
.note { color: #555; }
"""


def text(value):
    """Escaped."""
    return html.escape(str(value))


def number(value):
    """An estimate, or a number, with as many digits as a reader can use."""
    if value is None:
        return "-"
    mean, half = value if isinstance(value, tuple) else (value, None)
    digits = 1 if abs(mean) >= 100 else 2 if abs(mean) >= 10 else 3
    half_text = "" if half is None else f" ± {half:.{digits}f}"
    return f"{mean:.{digits}f}{half_text}"


def table(caption, head, rows):
    """An HTML table; cells are escaped here."""
    lines = ["<table>", f"<caption>{text(caption)}</caption>", "<thead><tr>"]
    lines += [f"<th>{text(cell)}</th>" for cell in head]
    lines += ["</tr></thead>", "<tbody>"]
    for row in rows:
        lines.append("<tr>" + "".join(f"<td>{text(cell)}</td>" for cell in row) + "</tr>")
    lines += ["</tbody>", "</table>"]
    return "\n".join(lines)


def stand_in(run, name):
    """The scene that stands for one of the thesis's, or None."""
    return next((scene for scene in run["scenes"] if scene["scene"] == thesis.STAND_INS[name]),
                None)


def variant_of(scene, name):
    """A variant of a scene, or None."""
    return next((variant for variant in scene["variants"] if variant["name"] == name), None)


def best_packet(scene):
    """The quickest variant of all."""
    return min(scene["variants"], key=lambda variant: samples.estimate(variant["trace_ms"])[0])


def beside_thesis(run):
    """Ratios of time and energy in the thesis's four configurations, its numbers beside ours."""
    head = ["", *thesis.CONFIGURATIONS, "best here"]
    rows = []
    for name, own in thesis.STAND_INS.items():
        for board, ratios in thesis.ENERGY_RATIO.items():
            rows.append([f"{name}: energy, {board}", *(f"{x:.2f}" for x in ratios[name]), ""])
        scene = stand_in(run, name)
        if scene is None:
            continue
        for title, of in (("time", samples.render_ratio),
                          ("energy", samples.energy_ratio("whole_j"))):
            if title == "energy" and not samples.has_energy(run):
                continue
            best = best_packet(scene)
            variants = [variant_of(scene, variant) for variant in thesis.VARIANTS] + [best]
            cells = [number(of(scene, variant)) if variant else "-" for variant in variants]
            rows.append([f"{samples.short(own)} here: {title}", *cells[:-1],
                         f"{cells[-1]} ({best['name']})"])
    return table("Relative to the scalar single-ray tracer (tables 5.3, 5.5), higher is better",
                 head, rows)


def joules_beside_thesis(run):
    """Joules in the thesis's four configurations (tables 5.2, 5.4)."""
    rows = []
    for name, own in thesis.STAND_INS.items():
        for board, values in thesis.ENERGY_J.items():
            rows.append([f"{name}, {board}", *(f"{mean} ± {half}" for mean, half in values[name])])
        scene = stand_in(run, name)
        if scene is not None and samples.has_energy(run):
            variants = [variant_of(scene, variant) for variant in thesis.VARIANTS]
            rows.append([f"{samples.short(own)} here",
                         *(number(samples.energy("whole_j")(scene, variant)) if variant else "-"
                           for variant in variants)])
    return table("Energy of the whole application in joules (tables 5.2, 5.4)",
                 ["", *thesis.CONFIGURATIONS], rows)


def idle_beside_thesis(run):
    """Watts at rest (table 5.1)."""
    rows = [[board, f"{mean} ± {half}"] for board, (mean, half) in thesis.IDLE_W.items()]
    idle_w = run["energy"]["idle_w"]
    if idle_w is not None:
        rows.append([f"{run['machine']['processor']}, by {run['energy']['source']}",
                     number(idle_w)])
    return table("Power at rest in watts (table 5.1)", ["", "W"], rows)


def summary_beside_thesis(run):
    """The popular summary's two numbers."""
    time_s, energy_j = thesis.SUMMARY["time_s"], thesis.SUMMARY["energy_j"]
    rows = [["YeahRight, Chromebook: render time", f"{time_s[0]} s", f"{time_s[1]} s",
             f"{time_s[0] / time_s[1]:.2f}"],
            ["YeahRight, Chromebook: energy", f"{energy_j[0]} J", f"{energy_j[1]} J",
             f"{energy_j[0] / energy_j[1]:.2f}"]]
    scene = stand_in(run, "YeahRight")
    if scene is not None:
        reference = scene["variants"][0]
        packets = [variant_of(scene, "vector-packet2x2-4"), best_packet(scene)]
        if packets[0] is packets[1]:
            packets.pop()
        for variant in filter(None, packets):
            rows.append([f"handles here: render time, {variant['name']}",
                         number(samples.estimate(reference["trace_ms"])) + " ms",
                         number(samples.estimate(variant["trace_ms"])) + " ms",
                         number(samples.render_ratio(scene, variant))])
            joules = samples.energy("whole_j")
            if joules(scene, variant):
                rows.append([f"handles here: energy, {variant['name']}",
                             number(joules(scene, reference)) + " J",
                             number(joules(scene, variant)) + " J",
                             number(samples.energy_ratio("whole_j")(scene, variant))])
    return table("As in the popular summary", ["", "reference", "packet tracer", "ratio"], rows)


def times(run):
    """All variants, all scenes: render times and ratios."""
    head = ["variant"]
    for scene in run["scenes"]:
        head += [f"{samples.short(scene['scene'])}, ms", "ratio"]
    rows = []
    for index, variant in enumerate(run["scenes"][0]["variants"]):
        row = [variant["name"]]
        for scene in run["scenes"]:
            own = scene["variants"][index]
            row += [number(samples.estimate(own["trace_ms"])),
                    number(samples.render_ratio(scene, own))]
        rows.append(row)
    return table("Render time by variant", head, rows)


def about(run):
    """Machine, program, settings, how it ended."""
    settings, energy, build = run["settings"], run["energy"], run["build"]
    facts = [
        ["processor", f"{run['machine']['processor']}, {run['machine']['processor_count']} "
                      "processors"],
        ["system", run["machine"]["system"]],
        ["program", f"raylane {run['version']}, Zig {build['zig']}, {build['optimize']}, for "
                    f"{build['cpu']} ({build['architecture']})"],
        ["settings", f"{settings['width']}x{settings['height']}, {settings['samples']} a pixel, "
                     f"depth {settings['depth']}, {settings['threads']} threads, BVH "
                     f"{settings['bvh']}"],
        ["energy", f"{energy['source']}: {energy['scope']}" if energy["source"]
         else f"not measurable here: {energy['reason']}"],
    ]
    if energy["source"]:
        facts.append(["measuring took", f"{energy['readings']} readings, "
                                        f"{energy['reading_s']:.3f} s, of which "
                                        f"{energy['processor_s']:.3f} s computing"])
    ends = {"precision": "intervals narrow", "rounds": "as asked for", "time": "time over"}
    for scene in run["scenes"]:
        facts.append([samples.short(scene["scene"]),
                      f"{scene['triangles']} triangles, {scene['rounds']} rounds "
                      f"({ends[scene['ended_by']]}), image {scene['image_hash']} by all variants"])
    return table("What was measured", ["", ""], facts)


def write(runs, figures, folder_name, suffix):
    """The whole page."""
    parts = ["<!DOCTYPE html>", '<html lang="en">', "<head>", '<meta charset="utf-8">',
             '<meta name="viewport" content="width=device-width">',
             "<title>Raylane: what SIMD and packets buy</title>", f"<style>{STYLE}</style>",
             "</head>", "<body>", "<h1>What SIMD and packets buy</h1>",
             "<p>The measurements of G. Waldemarson, <cite>Packet Ray Tracing with the ARM NEON "
             "Architecture</cite> (Lund University, 2014), made anew by <code>raylane bench"
             "</code>. Numbers are means with half the width of their 95 % confidence intervals; "
             "numbers of figures and tables are the thesis's. Its scenes cannot be shipped: "
             "atrium stands for Sponza, nave for Sibenik, handles for YeahRight. Its packets are "
             "<code>packet2x2</code>; <code>beam</code> is the widest bundle here.</p>"]
    for run in runs:
        parts.append(f"<h2>{text(run['machine']['processor'])}</h2>")
        parts += [about(run), summary_beside_thesis(run), beside_thesis(run)]
        low, high = thesis.TIME_RATIO
        parts.append(f'<p class="note">Render time in the thesis: NEON packets {low} to {high} '
                     "times as fast as scalar single rays (section 6.1.1).</p>")
        parts += [joules_beside_thesis(run), idle_beside_thesis(run), times(run)]
    parts.append("<h2>Figures</h2>")
    for name, figure_number, title in figures:
        parts.append(f'<figure><img src="{folder_name}/{name}.{suffix}" alt="{text(title)}">'
                     f"<figcaption>{text(title)} (thesis: {text(figure_number)})</figcaption>"
                     "</figure>")
    parts.append('<p class="note">Rays a second relative to the reference (C.6) are as in 5.3: '
                 "all variants trace the same rays.</p>")
    parts += ["</body>", "</html>"]
    return "\n".join(parts) + "\n"
