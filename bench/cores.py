#!/usr/bin/env python3
"""How rendering scales over cores of different speeds: predicted, simulated, measured.

Usage: bench/cores.py [--raylane PROGRAM] [--scene SCENE] [--rounds N] [--root DIR] [-o FILE.md]

The prediction is piecewise linear: threads on the quickest cores first, the speed of all is the sum
of their own. The simulation hands tiles to whichever core is free, as src/trace/tiles.zig does, on
made-up machines. With --raylane, and where this machine has cores of several classes (by
/sys/devices/system/cpu: cpu_capacity, else the highest frequency), it also measures: each class
alone by one pinned thread, then 1, 2, ... cores, quickest first, against the prediction. --root is
in the place of /sys.
"""

import argparse
import heapq
import json
import os
import pathlib
import random
import subprocess
import sys
import tempfile

from reporting import samples

SIDE = 1024  # Pixels of the picture, as in the thesis.
TILE = 32  # Pixels of a tile, as by default.
# Made-up machines: (name, speeds of the cores, quickest first).
MACHINES = [
    ("4 big, 4 little", [1.0] * 4 + [0.35] * 4),
    ("2 big, 6 little", [1.0] * 2 + [0.35] * 6),
    ("1 prime, 3 big, 4 little", [1.0] + [0.75] * 3 + [0.3] * 4),
]
TILE_SIZES = [16, 32, 64, 128, 256]
# How much work tiles of 32 pixels are: mean 1, lognormal; the deviation of its logarithm.
SPREAD = 0.6


class Failed(Exception):
    """What went wrong, in one line."""


def predict(speeds):
    """Speed of the first 1, 2, ... cores over that of the first."""
    total, result = 0.0, []
    for speed in speeds:
        total += speed
        result.append(total / speeds[0])
    return result


def works(tile, generator):
    """The work in each tile of a picture, in the unit of a mean tile of 32 pixels; larger tiles
    are sums of smaller ones, so that the picture is the same."""
    small = 16
    count = SIDE // small
    # Neighbours are alike: each block of 128 pixels has a level of its own.
    levels = [[generator.lognormvariate(0, SPREAD) for _ in range(SIDE // 128)]
              for _ in range(SIDE // 128)]
    cells = [[levels[y // 8][x // 8] * generator.lognormvariate(0, SPREAD / 2) / 4
              for x in range(count)] for y in range(count)]
    step = tile // small
    return [sum(cells[y + dy][x + dx] for dy in range(step) for dx in range(step))
            for y in range(0, count, step) for x in range(0, count, step)]


def simulate(speeds, tiles):
    """The time that cores of these speeds take for tiles in their order."""
    free = [(0.0, core) for core in range(len(speeds))]
    end = 0.0
    for work in tiles:
        time, core = heapq.heappop(free)
        time += work / speeds[core]
        end = max(end, time)
        heapq.heappush(free, (time, core))
    return end


def simulated_speeds(speeds, tile, pictures=20):
    """Speed of the first 1, 2, ... cores over that of the first, over several pictures."""
    sums = [0.0] * len(speeds)
    for seed in range(pictures):
        tiles = works(tile, random.Random(seed))
        alone = sum(tiles) / speeds[0]
        for count in range(1, len(speeds) + 1):
            sums[count - 1] += alone / simulate(speeds[:count], tiles) / pictures
    return sums


def read_number(path):
    """An integer in a file, or None."""
    try:
        return int(path.read_text(encoding="ascii"))
    except (OSError, ValueError):
        return None


def classes(root):
    """[(capacity, [cores])] of this machine, quickest first."""
    found = {}
    for folder in pathlib.Path(root, "devices/system/cpu").glob("cpu[0-9]*"):
        capacity = read_number(folder / "cpu_capacity")
        if capacity is None:
            capacity = read_number(folder / "cpufreq/cpuinfo_max_freq")
        if read_number(folder / "online") != 0:
            found.setdefault(capacity or 0, []).append(int(folder.name[3:]))
    return [(capacity, sorted(found[capacity])) for capacity in sorted(found, reverse=True)]


def trace_ms(program, scene, cores, folder):
    """Time to trace by one thread on each of these cores."""
    command = ["taskset", "-c", ",".join(map(str, cores)), program, scene, "--thesis", "-q",
               "-t", str(len(cores)), "--stats=json", "-o", os.path.join(folder, "image.pfm")]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise Failed(done.stderr.strip() or f"{program}: ended with {done.returncode}")
    return json.loads(done.stdout)["time_ms"]["trace"]


def measure(program, scene, found, rounds):
    """(relative speed of each core, quickest first; [(count, measured ratio)])"""
    order = [core for _, cores in found for core in cores]
    sets = [[cores[0]] for _, cores in found] + [order[:n] for n in range(1, len(order) + 1)]
    times = [[] for _ in sets]
    with tempfile.TemporaryDirectory() as folder:
        for round_index in range(rounds + 1):
            for cores, kept in zip(sets, times):
                time_ms = trace_ms(program, scene, cores, folder)
                if round_index > 0:  # The first warms up.
                    kept.append(time_ms)
    speeds = []
    for kept, (_, cores) in zip(times, found):
        speeds += [samples.ratio(times[0], kept)[0]] * len(cores)
    return speeds, [samples.ratio(times[len(found)], kept) for kept in times[len(found):]]


def row(cells):
    return "| " + " | ".join(map(str, cells)) + " |"


def simulation_tables():
    """Markdown: by cores, and by the size of tiles."""
    lines = []
    for name, speeds in MACHINES:
        simulated = simulated_speeds(speeds, TILE)
        lines += [f"## {name}", "", f"Speeds of the cores: {', '.join(map(str, speeds))}.", "",
                  row(["cores", *range(1, len(speeds) + 1)]), "|---|" + "---:|" * len(speeds),
                  row(["predicted", *(f"{value:.2f}" for value in predict(speeds))]),
                  row(["simulated", *(f"{value:.2f}" for value in simulated)]), "",
                  "All cores, simulated over predicted, by the side of a tile:", "",
                  row(["pixels", *TILE_SIZES]), "|---|" + "---:|" * len(TILE_SIZES),
                  row(["", *(f"{simulated_speeds(speeds, tile)[-1] / predict(speeds)[-1]:.3f}"
                             for tile in TILE_SIZES)]), ""]
    return lines


def measurement_table(program, options):
    """Markdown: this machine, or why it says nothing."""
    found = classes(options.root)
    if len(found) < 2:
        return ["This machine has cores of one class: nothing to measure.", ""]
    speeds, measured = measure(program, options.scene, found, options.rounds)
    return [row(["cores", *range(1, len(speeds) + 1)]), "|---|" + "---:|" * len(speeds),
            row(["predicted", *(f"{value:.2f}" for value in predict(speeds))]),
            row(["measured", *(f"{mean:.2f} ± {half or 0:.2f}" for mean, half in measured)]), ""]


INTRODUCTION = f"""# Cores of different speeds

Written by `bench/cores.py -o docs/cores.md`; not to be edited. The thesis's chapter 7 asks how a
machine with big and little cores scales from one core to all, and expects: piecewise linearly.

The prediction is just that: cores are added quickest first, and the speed of all is the sum of
their own. The simulation lets cores take tiles of a {SIDE}x{SIDE} picture one after the other, as
Raylane does; tiles differ in work (lognormal, deviation {SPREAD} of the logarithm, neighbours
alike). It leaves out what cores share: memory, caches, heat.

What to read from it: tiles of {TILE} pixels, the default, come within 2 % of the prediction on all
cores. What is lost is the wait for the last tile, which a slow core may have begun at the last
moment; it grows with the size of the tile. No scheduler by core classes is needed: cores that are
quick simply take more tiles.

`bench/cores.py --raylane zig-out/bin/raylane` measures on a machine that has cores of several
classes, with threads pinned; this has not been done yet for want of one.
"""


def main(arguments):
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("--raylane")
    parser.add_argument("--scene", default="builtin:handles")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--root", default="/sys")
    parser.add_argument("-o", "--output")
    options = parser.parse_args(arguments)
    try:
        if options.raylane:
            lines = measurement_table(options.raylane, options)
        else:
            lines = [INTRODUCTION, *simulation_tables()]
        text = "\n".join(lines).rstrip() + "\n"
        if options.output:
            pathlib.Path(options.output).write_text(text, encoding="utf-8")
        else:
            print(text, end="")
    except (Failed, OSError) as error:
        print(f"cores: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
