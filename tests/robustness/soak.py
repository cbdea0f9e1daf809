#!/usr/bin/env python3
"""Thousands of files through one process: what it keeps of each would show in the end.

In: a program of Raylane's, scenes of which copies and random mutations are made, beside PBRT scenes
that are made up. Out: a table of memory, descriptors and threads by how many files are done; exit
code 1 if memory grows, a descriptor stays open or the process ends in another way than it should.

    tests/robustness/soak.py zig-out/bin/raylane --files 10000
"""

import argparse
import os
import pathlib
import random
import shutil
import subprocess
import sys
import tempfile
import threading
import time

import hostile
import mutations
import runs

MB = 1_000_000
SHAPES = ['Shape "sphere" "float radius" {0:.3f}', 'Shape "disk" "float radius" {0:.3f}',
          'Shape "cylinder" "float radius" {0:.3f}', 'Shape "cone" "float radius" {0:.3f}',
          'Shape "trianglemesh" "point3 P" [0 0 0 {0:.3f} 0 0 0 {1:.3f} 0] '
          '"integer indices" [0 1 2]']
MATERIALS = ['"matte" "rgb Kd" [{0:.3f} {1:.3f} {2:.3f}]', '"glass" "float eta" {0:.3f}',
             '"mirror"', '"metal" "float roughness" {0:.3f}', '"plastic" "rgb Ks" [{0:.3f} 0 0]']


def pbrt(rng):
    """A scene of a few shapes, materials and lights."""
    def numbers():
        return [rng.uniform(0.01, 2) for _ in range(3)]
    lines = ["LookAt 0 0 8  0 0 0  0 1 0", 'Camera "perspective" "float fov" 50', "WorldBegin",
             'LightSource "point" "point3 from" [{:.3f} {:.3f} 5]'.format(*numbers())]
    for _ in range(rng.randrange(1, 30)):
        lines += ["AttributeBegin", "Translate {:.3f} {:.3f} {:.3f}".format(*numbers()),
                  "Material " + rng.choice(MATERIALS).format(*numbers()),
                  rng.choice(SHAPES).format(*numbers()), "AttributeEnd"]
    return "\n".join(lines + [""]).encode()


class Files:
    """A folder for each scene's files, and in it the scene again and again."""

    def __init__(self, folder, scenes, seed):
        self.folder = folder
        self.scenes = scenes
        self.rng = random.Random(seed)
        self.places = {}

    def place_of(self, source):
        """A folder with what the scenes of another one need."""
        if source not in self.places:
            place = self.folder / str(len(self.places))
            place.mkdir()
            for path in source.iterdir():
                if path.is_file() and path.suffix not in hostile.SCENES:
                    shutil.copyfile(path, place / path.name)
            self.places[source] = place
        return self.places[source]

    def write(self, index):
        """Writes one of them; its path."""
        kind = index % 3
        if kind == 2:
            place = self.folder / "pbrt"
            place.mkdir(exist_ok=True)
            path = place / f"{index}.pbrt"
            path.write_bytes(pbrt(self.rng))
            return path
        source, name = self.rng.choice(self.scenes)
        data = (source / name).read_bytes()
        path = self.place_of(source) / f"{index}{pathlib.Path(name).suffix}"
        path.write_bytes(mutations.mutate(data, self.rng) if kind == 1 else data)
        return path


def sample(pid, number):
    """(files done, resident bytes, descriptors, threads) of a process."""
    status = pathlib.Path(f"/proc/{pid}/status").read_text(encoding="ascii")
    values = dict(line.split(":", 1) for line in status.splitlines() if ":" in line)
    resident = int(values["VmRSS"].split()[0]) << 10
    return number, resident, len(os.listdir(f"/proc/{pid}/fd")), int(values["Threads"])


def soak(command, paths, every, folder):
    """(samples, counts of pictures and failures, exit code, seconds)."""
    start = time.monotonic()
    process = subprocess.Popen(  # pylint: disable=consider-using-with
        command + [str(path) for path in paths] + ["-o", str(folder / "out/{model}.ppm")],
        stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
    samples = []
    pictures = failures = 0
    watchdog = threading.Timer(3600, process.kill)
    watchdog.start()
    for line in process.stderr:
        # Warnings come between the lines of files, the sum behind them.
        if b": warning: " in line or b" pictures in " in line:
            continue
        if b".ppm, " in line:
            pictures += 1
        else:
            failures += 1
        if (pictures + failures) % every == 0:
            try:
                samples.append(sample(process.pid, pictures + failures))
            except (OSError, KeyError):
                pass  # It has just ended.
    code = process.wait()
    watchdog.cancel()
    return samples, pictures, failures, code, time.monotonic() - start


def verdict(samples, code, allowed_bytes):
    """Why it is not as it should be, or None. The first tenth warms up."""
    if code not in (0, 1, 3):
        return f"ended with {code}"
    steady = samples[len(samples) // 10:]
    if len(steady) < 4:
        return "too few samples"
    half = len(steady) // 2
    early = sorted(one[1] for one in steady[:half])[half // 2]
    late = sorted(one[1] for one in steady[half:])[half // 2]
    if late > early + allowed_bytes:
        return f"memory grew from {early / MB:.1f} to {late / MB:.1f} MB (medians of halves)"
    # Some are open while a file is read: the fewest are those that stay so.
    first, last = (min(one[2] for one in part) for part in (steady[:half], steady[half:]))
    if last > first:
        return f"{last - first} descriptors stayed open"
    return None


def main():
    """Makes the files, renders them, prints the table."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("program")
    parser.add_argument("--files", type=int, default=10000)
    parser.add_argument("--shared", default="../shared", help="where the samples are")
    parser.add_argument("--sources", nargs="*", help="files and folders of which they are made")
    parser.add_argument("--source-kb", type=int, default=300, help="larger files are left out")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--options", nargs="*", default=[], help="options of the program, "
                        "without dashes: jobs=2")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        files = Files(folder, list(hostile.sources(options)), options.seed)
        paths = [files.write(index) for index in range(options.files)]
        command = [shutil.which(options.program) or options.program, "-r", "16x16", "--spp", "1",
                   "--jobs", "1", "--env", "none"] + ["--" + one for one in options.options]
        every = max(1, options.files // 40)
        samples, pictures, failures, code, seconds = soak(command, paths, every, folder)
    rows = [[str(done), f"{resident / MB:.1f}", str(descriptors), str(threads)]
            for done, resident, descriptors, threads in samples[::2]]
    print(runs.table(["files done", "resident, MB", "descriptors", "threads"], rows))
    why = verdict(samples, code, 4 * MB)
    print(f"\n{options.files} files, seed {options.seed}: {pictures} pictures, {failures} refused, "
          f"in {seconds:.0f} s, exit code {code}: {why or 'good'}")
    return why is not None


if __name__ == "__main__":
    sys.exit(main())
