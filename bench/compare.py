#!/usr/bin/env python3
"""Compares a program with all variants with programs that hold one each, on the same scene.

Usage: bench/compare.py ALL NAME=PROGRAM... -- SCENE [--rounds N] [RENDER OPTIONS...]

ALL renders by `--variant NAME`, each PROGRAM by the one variant that it holds, all in turn, round
after round. For each variant this prints both render times and their ratio with its 95 % interval:
1.00 says that holding all variants in one program costs nothing. All images must have the same
hash (exit code 4 if not). `zig build compare -- SCENE` builds the programs and runs this.
"""

import json
import os
import pathlib
import subprocess
import sys
import tempfile

from reporting import samples


class Failed(Exception):
    """What went wrong, in one line."""


def parse(arguments):
    """(ALL, {name: program}, scene, rounds, render options)"""
    try:
        split = arguments.index("--")
        everything, *single = arguments[:split]
        scene, *options = arguments[split + 1:]
        programs = dict(one.split("=", maxsplit=1) for one in single)
    except ValueError as error:
        raise Failed("usage: compare.py ALL NAME=PROGRAM... -- SCENE [--rounds N] [OPTIONS]") \
            from error
    rounds = 10
    if "--rounds" in options:
        at = options.index("--rounds")
        if at + 1 == len(options) or not options[at + 1].isdigit() or int(options[at + 1]) < 2:
            raise Failed("--rounds: a number from 2 on")
        rounds = int(options[at + 1])
        del options[at:at + 2]
    return everything, programs, scene, rounds, options


def render(program, scene, options, folder):
    """Renders once: trace time in milliseconds, and the image's hash."""
    command = [program, "render", scene, "-o", os.path.join(folder, "image.pfm"), "-q",
               "--stats=json", "--thesis", *options]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise Failed(done.stderr.strip() or f"{program}: ended with {done.returncode}")
    stats = json.loads(done.stdout)
    return stats["time_ms"]["trace"], stats["image_hash"]


def measure(everything, programs, scene, rounds, options):
    """{name: (times of ALL, times of the single program)}, and the hashes that came out."""
    times = {name: ([], []) for name in programs}
    hashes = {}
    with tempfile.TemporaryDirectory() as folder:
        for round_index in range(rounds + 1):
            for name, program in programs.items():
                pair = (render(everything, scene, [*options, "--variant", name], folder),
                        render(program, scene, options, folder))
                for (time_ms, image_hash), kept in zip(pair, times[name]):
                    hashes.setdefault(image_hash, name)
                    if round_index > 0:  # The first warms up.
                        kept.append(time_ms)
            if len(hashes) > 1:
                break
    return times, hashes


def print_table(times, everything, programs):
    """One row a variant, sizes of the programs below."""
    print(f"{'variant':24}{'all in one, ms':>20}{'by itself, ms':>20}{'all / itself':>20}")
    ratios = []
    for name, (together, alone) in times.items():
        cells = [samples.estimate(together), samples.estimate(alone),
                 samples.ratio(together, alone)]
        ratios.append(cells[2][0])
        texts = [f"{mean:.3f} ±{half:.3f}" for mean, half in cells]
        print(f"{name:24}" + "".join(f"{text:>20}" for text in texts))
    print(f"\nmean of the ratios {sum(ratios) / len(ratios):.3f}")
    sizes = [pathlib.Path(program).stat().st_size for program in programs.values()]
    print(f"program with all {pathlib.Path(everything).stat().st_size / 1024:.0f} KiB, with one "
          f"{min(sizes) / 1024:.0f} to {max(sizes) / 1024:.0f} KiB")


def main(arguments):
    try:
        everything, programs, scene, rounds, options = parse(arguments)
        times, hashes = measure(everything, programs, scene, rounds, options)
    except (Failed, OSError) as error:
        print(f"compare: {error}", file=sys.stderr)
        return 1
    if len(hashes) > 1:
        found = ", ".join(f"{image_hash} by {name}" for image_hash, name in hashes.items())
        print(f"compare: the images differ: {found}", file=sys.stderr)
        return 4
    print_table(times, everything, programs)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
