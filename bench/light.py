#!/usr/bin/env python3
"""What packets buy when light bounces: writes the tables of docs/light.md.

Usage: bench/light.py [-o FILE.md] [--json FILE] [--scenes LIST] [--size N] [--stride N] [--depth N]
                      [--machines LIST] [--programs DIR] [--raylane PROGRAM] [--only PART...]

Builds bench/light.zig for AArch64 (Cortex-A72) and x86-64 (v3: AVX2), counts its instructions under
qemu, and takes the time on x86-64, which this machine has to be; and a raylane with all variants,
for `lights` and `path`. A table stands between `<!-- light.py: NAME -->` and `<!-- end -->`; what
is around them stays. --programs takes programs MACHINE/bin/light that were built before, of the
machines aarch64 and x86_64; --raylane a raylane. --only: of `rays` (how rays are best traced),
`frames` (what frames of the integrators cost by bounce) and `error` (time to equal error). --json
keeps what was measured, and what of it is not measured anew is read from there.

Needs what bench/count needs.
"""

import argparse
import importlib.machinery
import importlib.util
import json
import math
import os
import pathlib
import statistics
import subprocess
import sys
import tempfile

TOP = pathlib.Path(__file__).resolve().parent.parent
CACHE = TOP / ".zig-cache" / "bench" / "light"
SCENES = "builtin:cornell,builtin:atrium,builtin:nave,builtin:handles"
MACHINES = {
    "aarch64": ["-Dtarget=aarch64-linux", "-Dcpu=cortex_a72"],
    "x86_64": ["-Dtarget=x86_64-linux", "-Dcpu=x86_64_v3"],
}
# Besides those: the program for x86-64, timed.
TIMED = "timed"
# Columns: what they are called, and the methods by lanes.
COLUMNS = [("scalar single", "scalar-single-4"), ("vector single", "vector-single-{}"),
           ("packets 2x2", "vector-packet2x2-4"), ("streams", "vector-stream-{}"),
           ("interval packets, streams", "vector-interval-{}"), ("beams", "vector-beam-{}")]
SINGLE = 1
STREAMS = 3
# What `lights` traces: set, order, and how a row is called.
SHARED = [("sun", "pixels", "to the sun"), ("sun", "interleaved", "to the sun, every third pixel"),
          ("point", "pixels", "to a point light"),
          ("point", "interleaved", "to a point light, every third pixel")]
PARTS = ["rays", "frames", "error"]
# Of pictures whose error is measured: pixels along each side, and samples a pixel of the truth, of
# `lights` and of `path` at most.
ERROR_SIZE = 128
TRUTH_SAMPLES = 1024
LIGHTS_SAMPLES = [1, 4, 16]
PATH_SAMPLES_MAX = 256


def load_count():
    """bench/count as a module."""
    loader = importlib.machinery.SourceFileLoader("count", str(TOP / "bench" / "count"))
    module = importlib.util.module_from_spec(importlib.util.spec_from_loader("count", loader))
    loader.exec_module(module)
    return module


def build(options, machine):
    """The path of the benchmark for a machine."""
    if options.programs:
        return pathlib.Path(options.programs) / machine / "bin" / "light"
    prefix = CACHE / machine
    subprocess.run([TOP / "zigw", "build", "bench:light", "-Dvariants=one", "--prefix", prefix,
                    *MACHINES[machine], "--", "--help"], check=True, cwd=TOP,
                   stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    return prefix / "bin" / "light"


def build_raylane(options):
    """The path of a raylane with all variants."""
    if options.raylane:
        return pathlib.Path(options.raylane).resolve()
    subprocess.run([TOP / "zigw", "build", "-Dvariants=all", "--prefix", CACHE / "all"], check=True,
                   cwd=TOP)
    return CACHE / "all" / "bin" / "raylane"


def measure_rays(count, options, result):
    """Adds by machine and scene {"set depth order": {method: cost}} and {order: cost of sorting}
    to `result`."""
    for machine in options.machines.split(","):
        program = build(options, "x86_64" if machine == TIMED else machine)
        result[machine] = []
        for scene in options.scenes.split(","):
            print(f"light: {machine}, {scene}", file=sys.stderr)
            arguments = [scene, "--size", options.size, "--stride", options.stride, "--depth",
                         options.depth]
            if machine == TIMED:
                done = subprocess.run([program, *map(str, arguments), "--reps", "11", "--json"],
                                      check=True, text=True, stdout=subprocess.PIPE)
                report, tags = json.loads(done.stdout), None
            else:
                report, tags, _ = count.count(program, arguments)
            result[machine].append(summary(report, tags))
    hashes = [[found["hashes"] for found in scenes] for scenes in result.values()]
    if any(other != hashes[0] for other in hashes):
        raise count.Failed("the machines do not agree on the hits")


def summary(report, tags):
    """Instructions, or nanoseconds, a ray."""
    def cost(entry, rays):
        return tags.get(entry["tag"], 0) / rays if tags else entry["ns_per_ray"]["min"]
    sets = {}
    for one in report["sets"]:
        key = f"{one['name']} {one['depth']} {one['order']}"
        sets[key] = {"rays": one["rays"], "hits": one["hits"],
                     "costs": {entry["method"]: cost(entry, one["rays"]) for entry in one["costs"]
                               if one["rays"]}}
    return {"scene": report["scene"], "sets": sets,
            "hashes": [one["hash"] for one in report["sets"]],
            "sorts": {one["order"]: cost(one, one["rays"]) for one in report["sorts"]}}


def geometric_mean(values):
    """None where there is nothing."""
    return math.exp(sum(map(math.log, values)) / len(values)) if values else None


def mean(scenes, key, method):
    """Of all scenes that have such rays; None where none has."""
    values = [scene["sets"][key]["costs"][method] for scene in scenes
              if method in scene["sets"].get(key, {}).get("costs", {})]
    return geometric_mean(values)


def row(cells):
    return "| " + " | ".join(cells) + " |"


def methods_of(lanes):
    return [method.format(lanes) for _, method in COLUMNS]


def table_of(rows, head, lanes, scenes, form):
    """A row for each set, a column for each method."""
    lines = [row([head, *(name for name, _ in COLUMNS)]), "|---|" + "---:|" * len(COLUMNS)]
    for name, key in rows:
        values = [mean(scenes, key, method) for method in methods_of(lanes)]
        lines.append(row([name, *("" if value is None else form(value, values)
                                  for value in values)]))
    return lines


def sets_of(options):
    """Rows of the sets by bounce."""
    ordinals = ["1st", "2nd", "3rd"] + [f"{n}th" for n in range(4, 20)]
    rows = []
    for depth in range(int(options.depth) + 1):
        name = "primary" if depth == 0 else f"{ordinals[depth - 1]} bounce"
        rows.append((name, f"{'primary' if depth == 0 else 'bounce'} {depth} pixels"))
        rows += [("- shadow: lamp", f"lamp {depth} pixels"), (f"- shadow: sky",
                                                               f"sky {depth} pixels")]
    return rows


def instructions_table(scenes, options, lanes):
    """Instructions a ray, and how many times fewer than vector single rays."""
    def form(value, values):
        return f"{value:.0f} ({values[SINGLE] / value:.2f})"
    return table_of(sets_of(options), "AArch64" if lanes == 4 else "x86-64, 8 lanes", lanes,
                    scenes, form)


def rates_table(scenes, options):
    """Millions of rays a second."""
    return table_of(sets_of(options), "M rays/s", 8, scenes, lambda value, _: f"{1e3 / value:.2f}")


def shared_table(machines):
    """Rays of lights that all share."""
    rows = [(name, f"{one} 0 {order}") for one, order, name in SHARED]

    def form(value, values):
        return f"{value:.0f} ({values[SINGLE] / value:.2f})"
    lines = table_of(rows, "AArch64, instructions", 4, machines["aarch64"], form)
    lines += [""] + table_of(rows, "x86-64, 8 lanes, instructions", 8, machines["x86_64"], form)
    lines += [""] + table_of(rows, "x86-64, M rays/s", 8, machines[TIMED],
                             lambda value, _: f"{1e3 / value:.2f}")
    return lines


def sorting_table(machines, options):
    """What streams gain where rays are sorted, and what sorting takes."""
    heads = ["rays", "AArch64: 4096 at a time", "all", "x86-64: 4096 at a time", "all",
             "x86-64, time: 4096 at a time", "all"]
    lines = [row(heads), "|---|" + "---:|" * (len(heads) - 1)]
    orders = ["sorted_4096", "sorted_all"]
    places = [("aarch64", 4), ("x86_64", 8), (TIMED, 8)]
    for name, key in sets_of(options):
        if key.startswith("primary"):
            continue
        cells = []
        for machine, lanes in places:
            method = methods_of(lanes)[STREAMS]
            before = mean(machines[machine], key, method)
            for order in orders:
                after = mean(machines[machine], key.replace("pixels", order), method)
                cells.append("" if after is None else f"{before / after:.2f}")
        lines.append(row([name, *cells]))
    costs = [geometric_mean([scene["sorts"][order] for scene in machines[machine]])
             for machine, _ in places for order in orders]
    units = ["instructions"] * 4 + ["ns"] * 2
    lines.append(row(["sorting, a ray", *(f"{cost:.0f} {unit}"
                                          for cost, unit in zip(costs, units))]))
    return lines


def rays_tables(machines, options):
    return {"instructions-aarch64": instructions_table(machines["aarch64"], options, 4),
            "instructions-x86_64": instructions_table(machines["x86_64"], options, 8),
            "rates": rates_table(machines[TIMED], options),
            "shared": shared_table(machines), "sorting": sorting_table(machines, options)}


def measure_frames(program, options):
    """What frames of `path` cost by bounce and variant, of each scene."""
    with tempfile.TemporaryDirectory() as folder:
        out = pathlib.Path(folder) / "bench.json"
        print("light: frames", file=sys.stderr)
        subprocess.run([program, "bench", *options.scenes.split(","), "--integrator", "path",
                        "--depth", str(options.depth), "--spp", "1", "-r", "256x256", "-t", "1",
                        "--rounds", "3", "--time-limit", "600", "-q", "--json", out],
                       check=True, stdout=subprocess.DEVNULL)
        return json.loads(out.read_text())


def frames_table(results):
    """Nanoseconds a ray of `path` over all scenes, shading with it, and how many times less than
    the first variant."""
    def step(bounces, index):
        before = bounces[index - 1]["frame_ms"] if bounces[index]["depth"] else None
        after = bounces[index]["frame_ms"]
        return statistics.median(a - (before[at] if before else 0) for at, a in enumerate(after))
    names = list(dict.fromkeys(bounce["variant"] for bounce in results["scenes"][0]["bounces"]))
    depths = 1 + max(bounce["depth"] for bounce in results["scenes"][0]["bounces"])
    lines = [row(["bounce", "rays, shadow rays a pixel", *(f"`{name}`" for name in names)]),
             "|---|" + "---:|" * (1 + len(names))]
    pixels = results["settings"]["width"] * results["settings"]["height"]
    for depth in range(depths):
        counts, times = [], dict.fromkeys(names, 0)
        for scene in results["scenes"]:
            for index, bounce in enumerate(scene["bounces"]):
                if bounce["depth"] != depth:
                    continue
                if bounce["variant"] == names[0]:
                    counts.append((bounce["closest"] / pixels, bounce["shadow"] / pixels))
                times[bounce["variant"]] += step(scene["bounces"], index) * 1e6
        rays = sum(map(sum, counts)) * pixels
        first = times[names[0]]
        cells = [f"{times[name] / rays:.0f} ns ({first / times[name]:.2f})" for name in names]
        means = [statistics.mean(column) for column in zip(*counts)]
        lines.append(row([str(depth), f"{means[0]:.2f}, {means[1]:.2f}", *cells]))
    return lines


def render(program, arguments, out):
    """Processor time of one picture, from the file to the picture, in seconds."""
    command = [program, *arguments, "-o", out, "-q", "--stats", "none", "-r",
               f"{ERROR_SIZE}x{ERROR_SIZE}", "-t", "2"]
    process = subprocess.Popen([str(word) for word in command])
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode != 0:
        raise subprocess.CalledProcessError(process.returncode, command)
    return usage.ru_utime + usage.ru_stime


def measure_error(program, options):
    """By scene: of `lights`, `path` and `path --denoise` rows of samples, seconds and FLIP to what
    `path` converges to."""
    found = []
    with tempfile.TemporaryDirectory() as name:
        truth, picture = pathlib.Path(name) / "truth.png", pathlib.Path(name) / "picture.png"
        for scene in options.scenes.split(","):
            print(f"light: error, {scene}", file=sys.stderr)
            render(program, [scene, "--integrator", "path", "--spp", TRUTH_SAMPLES], truth)

            def point(samples, *flags):
                time_s = render(program, [scene, "--spp", samples, *flags], picture)
                done = subprocess.run([program, "compare", picture, truth, "--stats", "json"],
                                      check=True, text=True, stdout=subprocess.PIPE)
                return [samples, time_s, json.loads(done.stdout)["flip"]]
            rows = {"lights": [point(samples, "--integrator", "lights")
                               for samples in LIGHTS_SAMPLES]}
            for key, flags in [("path", []), ("path --denoise", ["--denoise"])]:
                rows[key], samples = [], 1
                while samples <= PATH_SAMPLES_MAX:
                    rows[key].append(point(samples, "--integrator", "path", *flags))
                    if rows[key][-1][2] <= min(row[2] for row in rows["lights"]):
                        break
                    samples *= 2
            found.append({"scene": scene, "rows": rows})
    return found


def error_table(found):
    """Of `lights` what it takes and how wrong it is, and what `path` takes to be as good."""
    lines = [row(["scene", "`lights`, samples", "s", "FLIP", "`path` of that FLIP: samples", "s",
                  "`path --denoise`: samples", "s"]), "|---|" + "---:|" * 7]
    for scene in found:
        name = scene["scene"].removeprefix("builtin:")
        for samples, time_s, flip in scene["rows"]["lights"]:
            cells = [name, str(samples), f"{time_s:.2f}", f"{flip:.3f}"]
            for key in ("path", "path --denoise"):
                fit = next((each for each in scene["rows"][key] if each[2] <= flip), None)
                cells += [str(fit[0]), f"{fit[1]:.2f}"] if fit else \
                    [f"above {scene['rows'][key][-1][0]}", f"above {scene['rows'][key][-1][1]:.2f}"]
            lines.append(row(cells))
    return lines


def replace(text, name, lines):
    """Puts a table where it belongs."""
    start = text.index(f"<!-- light.py: {name} -->")
    end = text.index("<!-- end -->", start)
    return text[:start] + f"<!-- light.py: {name} -->\n\n" + "\n".join(lines) + "\n\n" + text[end:]


def parse():
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("-o", "--output", type=pathlib.Path, default=TOP / "docs" / "light.md")
    parser.add_argument("--json", type=pathlib.Path)
    parser.add_argument("--scenes", default=SCENES)
    parser.add_argument("--size", default=960)
    parser.add_argument("--stride", default=7)
    parser.add_argument("--depth", default=3)
    parser.add_argument("--machines", default=",".join([*MACHINES, TIMED]))
    parser.add_argument("--programs")
    parser.add_argument("--raylane")
    parser.add_argument("--only", nargs="*", choices=PARTS, default=PARTS)
    return parser.parse_args()


def main():
    options = parse()
    sys.dont_write_bytecode = True
    count = load_count()
    found = {}
    if options.json and options.json.exists():
        found = json.loads(options.json.read_text())
    try:
        if "rays" in options.only:
            measure_rays(count, options, found.setdefault("rays", {}))
        if "frames" in options.only:
            found["frames"] = measure_frames(build_raylane(options), options)
        if "error" in options.only:
            found["error"] = measure_error(build_raylane(options), options)
    except (count.Failed, OSError, subprocess.CalledProcessError) as error:
        print(f"light: {error}", file=sys.stderr)
        return 1
    if options.json:
        options.json.write_text(json.dumps(found, indent=1) + "\n")
    tables = {}
    if set(found.get("rays", {})) == {*MACHINES, TIMED}:
        tables.update(rays_tables(found["rays"], options))
    if "frames" in found:
        tables["frames"] = frames_table(found["frames"])
    if "error" in found:
        tables["error"] = error_table(found["error"])
    text = options.output.read_text()
    for name, lines in tables.items():
        text = replace(text, name, lines)
    options.output.write_text(text)
    print(options.output)
    return 0


if __name__ == "__main__":
    sys.exit(main())
