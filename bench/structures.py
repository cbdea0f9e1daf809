#!/usr/bin/env python3
"""Which tree suits NEON best, in executed AArch64 instructions.

Usage: bench/structures.py [-o FILE.md] [--size N] [--scenes LIST] [--program PROGRAM]

Builds bench/structures.zig for Cortex-A72 and counts its instructions under qemu on the built-in
scenes: a binary BVH, a BVH of four children, a kd-tree, by single rays and by packets of 2x2.
Writes docs/structures.md. Needs what bench/count needs.
"""

import argparse
import importlib.machinery
import importlib.util
import math
import pathlib
import subprocess
import sys

TOP = pathlib.Path(__file__).resolve().parent.parent
PREFIX = TOP / ".zig-cache" / "bench" / "structures"
SCENES = "builtin:cornell,builtin:atrium,builtin:nave,builtin:handles"
PHASES = {"primary": "primary", "shadow": "shadow", "bounce": "mirror"}

INTRODUCTION = """# Which tree suits NEON best?

Written by `bench/structures.py` (`--size {size}`); not to be edited. The thesis built a binary BVH,
and its chapter 7 leaves open whether a kd-tree (which Wald recommends) or Embree's kind of wide BVH
would gain more from NEON.

Executed AArch64 instructions (Cortex-A72) a ray, four lanes, Zig's vectors: a primary ray a pixel,
a shadow ray from a point light and a mirror ray a hit. All trees hold the same triangles in blocks
of four, ask the same exact triangle test, and come to the same hits, bit for bit. All are built by
the binned surface area heuristic: `bvh4` is the renderer's own; `bvh2` is a binary one in the same
nodes with half the lanes idle; `kd` cuts boxes, not triangles, at its planes. `single` is one ray
against the boxes of a node, then against four triangles; `packet` is four rays against one box,
plane or triangle at a time. Beams, the renderer's best, are left out here.
"""

TEXT = """\
- For single rays the wide BVH gains most: its node fills the lanes. A binary node leaves half
  of them idle, and a plane of a kd-tree has nothing to fill them with.
- For packets of coherent rays the kd-tree needs the fewest instructions in buildings (atrium,
  nave): a plane is one subtraction and one multiplication for four rays, where a box is three
  slabs. So Wald's advice holds on NEON. It does not in handles: small triangles lie in several
  leaves, and after a mirror the rays of a packet go different ways.
- The kd-tree takes 15 to 20 times the instructions of the wide BVH to build, and 3 to 5 times
  the memory. At 1024x1024, one primary and one shadow ray a pixel, its packets save some 1.0
  billion instructions in atrium, and its tree costs 1.6 billion more: for a still it does not
  pay.
- Raylane has wide BVHs for that reason, and for another: beams (`docs/performance.md`) take six
  to nine times fewer instructions a primary ray at 1024x1024 than the best of these, which no
  choice among trees comes near."""

CONCLUSION = """## What to read from it

Instructions of all rays, the geometric mean over the scenes, `bvh2-single` being 1:

{table}

{text}
"""


def load_count():
    """bench/count as a module."""
    loader = importlib.machinery.SourceFileLoader("count", str(TOP / "bench" / "count"))
    module = importlib.util.module_from_spec(importlib.util.spec_from_loader("count", loader))
    loader.exec_module(module)
    return module


def build():
    """The program's path."""
    command = [TOP / "zigw", "build", "bench:structures", "-Dvariants=one", "--prefix", PREFIX,
               "-Dtarget=aarch64-linux", "-Dcpu=cortex_a72", "--", "builtin:cornell", "--size",
               "16"]
    subprocess.run(command, check=True, cwd=TOP, stdout=subprocess.DEVNULL)
    return PREFIX / "bin" / "structures"


def row(cells):
    return "| " + " | ".join(map(str, cells)) + " |"


def rays_of(summary, name):
    """Instructions of traversal: without the making of rays."""
    return sum(summary["runs"][name]["total"][phase] for phase in PHASES)


def scene_table(report, summary):
    """Instructions a ray of each kind, and of building."""
    lines = [f"## {report['scene'].removeprefix('builtin:')}: {report['triangles']} triangles", "",
             row(["", *(f"{name} ray" for name in PHASES.values()), "all rays, ratio"]),
             "|---|---:|---:|---:|---:|"]
    first = rays_of(summary, report["runs"][0]["name"])
    for run in report["runs"]:
        per_ray = summary["runs"][run["name"]]["per_ray"]
        lines.append(row([f"`{run['name']}`", *(f"{per_ray[phase]:.0f}" for phase in PHASES),
                          f"{first / rays_of(summary, run['name']):.2f}"]))
    lines += ["", row(["tree", "instructions a triangle to build", "nodes", "blocks", "bytes"]),
              "|---|---:|---:|---:|---:|"]
    for tree in report["builds"]:
        built = summary["builds"][tree["lanes"]]["per_triangle"]
        lines.append(row([f"`{tree['lanes']}`", f"{built:.0f}", tree["nodes"], tree["blocks"],
                          tree["bytes"]]))
    return [*lines, ""]


def conclude(counted):
    """{run: geometric mean of the first run's instructions over its own}"""
    names = [run["name"] for run in counted[0][0]["runs"]]
    return {name: math.exp(sum(math.log(rays_of(summary, names[0]) / rays_of(summary, name))
                               for _, summary in counted) / len(counted)) for name in names}


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("-o", "--output", default=str(TOP / "docs" / "structures.md"))
    parser.add_argument("--size", type=int, default=512)
    parser.add_argument("--scenes", default=SCENES)
    parser.add_argument("--program")
    options = parser.parse_args()
    count = load_count()
    try:
        program = options.program or build()
        counted = []
        for scene in options.scenes.split(","):
            print(f"structures: {scene}", file=sys.stderr)
            report, tags, _ = count.count(program, [scene, "--size", str(options.size)])
            counted.append((report, count.summarize(report, tags)))
        lines = [INTRODUCTION.format(size=options.size)]
        for report, summary in counted:
            lines += scene_table(report, summary)
        means = conclude(counted)
        table = [row(["", "times fewer instructions"]), "|---|---:|"]
        table += [row([f"`{name}`", f"{value:.2f}"]) for name, value in means.items()]
        lines.append(CONCLUSION.format(table="\n".join(table), text=TEXT))
        pathlib.Path(options.output).write_text("\n".join(lines).rstrip() + "\n")
    except (count.Failed, OSError, subprocess.CalledProcessError) as error:
        print(f"structures: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
