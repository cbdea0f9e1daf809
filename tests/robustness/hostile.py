#!/usr/bin/env python3
"""Files that are broken, and files that ask for too much, through a program of Raylane's.

In: a program, perhaps with an emulator; the folders `malformed` and `reports/hostile` of ../shared,
or scenes of which random mutations are made. Out: a table of what was expected and what came, with
seconds and the peak of memory; exit code 1 if a line of it is bad.

    tests/robustness/hostile.py zig-out/bin/raylane
    tests/robustness/hostile.py raylane-aarch64 --emulator 'qemu-aarch64 -cpu cortex-a53'
    tests/robustness/hostile.py zig-out/bin/raylane --mutations 10000 --seed 1 --keep found/
"""

import argparse
import collections
import concurrent.futures
import os
import pathlib
import random
import re
import shlex
import shutil
import sys
import tempfile

import mutations
import runs

MB = 1_000_000
QUICK = ["-r", "128x128", "--spp", "1"]
SCENES = {".gltf", ".glb", ".pbrt", ".obj", ".stl", ".ply"}
# Warnings that say what the picture is like, not what is wrong with the file.
PICTURE = re.compile(r"% of what the picture shows is|nothing to render of")
# Files of reports/hostile: options in place of the quick ones, and what must come of them.
HOSTILE = {
    "plane_1.glb": (QUICK, "ok"),
    "plane_10000.glb": (QUICK, "as fast as plane_1.glb"),
    "amp900M.glb": (QUICK, "error"),
    "bl256.glb": (QUICK, "not black, or a warning"),
    "spheres.pbrt": (QUICK, "any"),
    "spp2.pbrt": ([], "error"),
    "subdiv8.pbrt": (QUICK, "any"),
    "nurbs.pbrt": (QUICK + ["--tessellation", "1024"], "any"),
    "mat_2p32.gltf": (QUICK, "error 3"),
    "ind_2p32.gltf": (QUICK, "error 3"),
}


def arguments():
    """What the user wants."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("program")
    parser.add_argument("--emulator", default="", help="what runs the program, with its options")
    parser.add_argument("--shared", default="../shared", help="where the corpora are")
    parser.add_argument("--limit-s", type=float, help="seconds a file (2, with an emulator 30)")
    parser.add_argument("--limit-mb", type=float, default=300, help="peak of memory (300)")
    parser.add_argument("--options", default="", help="options of the program for all files")
    parser.add_argument("--mutations", type=int, default=0, help="how many, instead of the corpora")
    parser.add_argument("--sources", nargs="*", help="files and folders of which they are made")
    parser.add_argument("--source-kb", type=int, default=600, help="larger files are left out")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--first", type=int, default=0, help="number of the first mutation")
    parser.add_argument("--jobs", type=int, default=1, help="programs side by side")
    parser.add_argument("--keep", help="a folder for mutations that turn out badly")
    return parser.parse_args()


class Tool:
    """The program and its limits."""

    def __init__(self, options):
        program = shutil.which(options.program) or options.program
        self.command = shlex.split(options.emulator) + [str(pathlib.Path(program).resolve())]
        self.limit_s = options.limit_s or (30 if options.emulator else 2)
        self.limit_bytes = options.limit_mb * MB
        self.options = shlex.split(options.options)

    def run(self, scene, chosen, output):
        """Renders a scene."""
        command = self.command + [str(scene), "-o", str(output)] + chosen + self.options
        return runs.run(command, timeout_s=5 * self.limit_s + 5)

    def beyond(self, run):
        """What of the limits a run did not keep to, or None."""
        if run.crash:
            return run.crash
        if run.seconds > self.limit_s:
            return f"took more than {self.limit_s:g} s"
        if run.peak_bytes > self.limit_bytes:
            return f"took more than {self.limit_bytes / MB:g} MB"
        return None


def complaint(expected, run, picture=None, other=None):
    """Why a run is not what was expected, or None."""
    kind = "ok" if run.exit_code == 0 else "error"
    if kind == "ok" and any(not PICTURE.search(line) for line in run.warnings):
        kind = "warn"
    if expected == "any":
        return None
    if expected == "error 3":
        return None if run.exit_code == 3 else f"exit code {run.exit_code}"
    if expected == "ok or warn":
        return None if kind != "error" else "refused"
    if expected.startswith("as fast as"):
        slow = run.seconds > 1.2 * other.seconds + 0.02
        return f"{run.seconds / other.seconds:.1f} times as long" if slow else None
    if expected.startswith("not black"):
        return "black, without a word" if kind == "ok" and is_black(picture) else None
    return None if kind == expected else f"{kind} instead of {expected}"


def is_black(picture):
    """Whether the middle of a PPM is."""
    head, size, _, pixels = picture.read_bytes().split(b"\n", 3)
    assert head == b"P6"
    width, height = map(int, size.split())
    middle = 3 * (height // 2 * width + width // 2)
    return pixels[middle:middle + 3] == bytes(3)


def corpora(shared):
    """(path, options, expected) of every file that is expected to be something."""
    malformed = shared / "malformed"
    for line in (malformed / "manifest.tsv").read_text(encoding="utf-8").splitlines():
        name, expected, about = (line.split("\t") + ["", ""])[:3]
        if expected not in ("ok", "warn", "error"):
            continue
        if "{policy:nothing-to-render}" in about and expected != "error":
            expected = "ok or warn"
        yield malformed / name, QUICK, expected
    hostile = shared / "reports/hostile"
    for path in sorted(hostile.iterdir()):
        if path.suffix in SCENES:
            options, expected = HOSTILE.get(path.name, (QUICK, "any"))
            yield path, options, expected


def check_corpora(tool, shared):
    """Prints the table; the number of files that are not what they should be."""
    rows = []
    bad = 0
    times = {}
    with tempfile.TemporaryDirectory() as folder:
        picture = pathlib.Path(folder) / "a.ppm"
        for path, options, expected in corpora(shared):
            picture.unlink(missing_ok=True)
            run = tool.run(path, options, picture)
            if "plane_1" in path.name:  # A time to be compared.
                for _ in range(4):
                    again = tool.run(path, options, picture)
                    run = min(run, again, key=lambda one: one.seconds)
            times[path.name] = run
            # What makes them comparable is a little apart.
            other = times.get("plane_1.glb", run)
            why = tool.beyond(run) or complaint(expected, run, picture, other)
            bad += why is not None
            said = (run.errors + run.warnings + [""])[0]
            said = said.removeprefix("raylane: ").removeprefix(f"{path}: ")
            rows.append([path.name, expected, str(run.exit_code), f"{run.seconds:.2f}",
                         f"{run.peak_bytes / MB:.0f}", why or "good", said[:120]])
    head = ["file", "expected", "exit", "s", "MB", "verdict", "what it said first"]
    print(runs.table(head, rows))
    print(f"\n{len(rows)} files, {bad} of them not as they should be; at most "
          f"{max(float(row[3]) for row in rows):.2f} s and "
          f"{max(int(row[4]) for row in rows)} MB.")
    return bad


def sources(options):
    """Scenes to be changed, as (folder of all that it needs, name)."""
    shared = pathlib.Path(options.shared)
    chosen = options.sources or [shared / "scenes/khronos", "scenes", "tests/meshes",
                                 "tests/pictures"]
    for place in map(pathlib.Path, chosen):
        for path in sorted(place.rglob("*")) if place.is_dir() else [place]:
            if path.is_file() and path.suffix in SCENES and \
                    path.stat().st_size < options.source_kb << 10:
                yield path.parent, path.name


class Workshop:
    """A folder with copies of scenes in it, in which one file at a time is changed."""

    def __init__(self, tool, options, scenes):
        self.tool = tool
        self.options = options
        self.scenes = scenes
        self.folder = tempfile.TemporaryDirectory()  # pylint: disable=consider-using-with
        self.copies = {}

    def copy_of(self, source):
        """A copy of a scene's folder, without files in folders below it."""
        if source not in self.copies:
            place = pathlib.Path(self.folder.name) / str(len(self.copies))
            place.mkdir()
            for path in source.iterdir():
                if path.is_file() and path.stat().st_size < self.options.source_kb << 10:
                    shutil.copyfile(path, place / path.name)
            self.copies[source] = place
        return self.copies[source]

    def try_one(self, index):
        """(kind of outcome, run, why it is bad, files) of a mutation by its number."""
        rng = random.Random(f"{self.options.seed}/{index}")
        source, name = rng.choice(self.scenes)
        place = self.copy_of(source)
        others = sorted(path.name for path in place.iterdir() if path.suffix not in SCENES)
        changed = rng.choice(others) if others and rng.random() < 0.3 else name
        path = place / changed
        before = path.read_bytes()
        path.write_bytes(mutations.mutate(before, rng))
        try:
            run = self.tool.run(place / name, ["-r", "32x32", "--spp", "1"],
                                pathlib.Path(self.folder.name) / "a.ppm")
            why = self.tool.beyond(run)
            if why and self.options.keep:
                kept = pathlib.Path(self.options.keep) / str(index)
                shutil.copytree(place, kept, dirs_exist_ok=True)
                (kept / "what").write_text(f"{name}, changed: {changed}\n{why}\n{run.stderr}",
                                           encoding="utf-8")
        finally:
            path.write_bytes(before)
        return run, why, f"{source.name}/{name}, {changed}"


def check_mutations(tool, options):
    """Prints what became of them; the number that turned out badly."""
    scenes = list(sources(options))
    shops = [Workshop(tool, options, scenes) for _ in range(options.jobs)]
    outcomes = collections.Counter()
    bad = []
    seconds = peak = 0

    def work(number):
        shop = shops[number]
        first = options.first + number
        last = options.first + options.mutations
        return [(index, *shop.try_one(index)) for index in range(first, last, options.jobs)]

    with concurrent.futures.ThreadPoolExecutor(options.jobs) as pool:
        for results in pool.map(work, range(options.jobs)):
            for index, run, why, what in results:
                kind = "ok" if run.exit_code == 0 else f"exit code {run.exit_code}"
                if kind == "ok" and run.warnings:
                    kind = "ok, with warnings"
                outcomes[kind] += 1
                seconds = max(seconds, run.seconds)
                peak = max(peak, run.peak_bytes)
                if why:
                    bad.append([str(index), what, f"{run.seconds:.2f}",
                                f"{run.peak_bytes / MB:.0f}", why])
    rows = [[kind, str(count)] for kind, count in sorted(outcomes.items())]
    rows += [["signals, hangs, over a limit", str(len(bad))],
             ["longest, s", f"{seconds:.2f}"], ["most memory, MB", f"{peak / MB:.0f}"]]
    print(f"{options.mutations} mutations of {len(scenes)} scenes, seed {options.seed}:\n")
    print(runs.table(["outcome", "mutations"], rows))
    if bad:
        print("\n" + runs.table(["number", "file", "s", "MB", "why"], sorted(bad)))
    return len(bad)


def main():
    """Runs what is asked for."""
    options = arguments()
    tool = Tool(options)
    if options.keep:
        os.makedirs(options.keep, exist_ok=True)
    if options.mutations:
        return check_mutations(tool, options) > 0
    return check_corpora(tool, pathlib.Path(options.shared)) > 0


if __name__ == "__main__":
    sys.exit(main())
