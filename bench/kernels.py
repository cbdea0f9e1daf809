#!/usr/bin/env python3
"""What processors make of the innermost work, estimated by llvm-mca for each backend.

Usage: python3 bench/kernels.py ZIG OUT

ZIG is the compiler, OUT the Markdown file to write (docs/kernels.md). bench/kernels.zig is compiled
in fast mode for each processor below and each backend, as bench/lowering.py does it, and the code
of each kernel is given to llvm-mca (Debian's llvm-19 or later) as a loop of 100 passes.
"""

import pathlib
import re
import shutil
import subprocess
import sys
import tempfile

import lowering

# Title, target, CPU, triple, and whose scheduling model LLVM takes for it.
PROCESSORS = [
    ("Cortex-A53", "aarch64-linux-musl", "cortex_a53", "its own"),
    ("Cortex-A72", "aarch64-linux-musl", "cortex_a72", "the Cortex-A57's"),
    ("Cortex-A76", "aarch64-linux-musl", "cortex_a76", "the Cortex-A57's"),
    ("Neoverse V2", "aarch64-linux-musl", "neoverse_v2", "its own"),
]
BACKENDS = ["scalar", "vector", "intrinsics"]
KERNELS = ["boxTest", "triangleCull", "triangleHit"]
PASSES = 100

# What no assembly can do without, counted by hand; two registers are loaded or stored at once.
# boxTest: 6 loads of bounds at 6 addresses (3 loads), 4 of the ray and its limits, 1 spread over
# lanes, 6 fmla that overwrite 3 copies, 6 minima and maxima, 1 store. triangleCull: 7 loads, 9
# differences, 12 operations that shear, 9 of edge functions, 11 from their signs to the answer.
LEAST = {"boxTest": 30, "triangleCull": 48}

INTRODUCTION = """# Does care at the level of assembly pay?

Written by `python3 bench/kernels.py ZIG docs/kernels.md` with Zig ZIG_VERSION and MCA_VERSION; not
to be edited. The thesis's chapter 7 asks whether a packet tracer in assembly would be worth it.
This compares what the compiler makes of each backend, on the three pieces of straight code where
most instructions are executed (`bench/kernels.zig`): one ray against the four boxes of a node, the
four triangles of a block as far as most blocks come, and all the way to t.

Cycles are llvm-mca's, for each pass of a loop that is never interrupted: no cache misses, no
mispredicted branches. They compare code for one processor; they do not tell how fast it is. For
Cortex-A72 and A76 LLVM takes the model of the Cortex-A57.

What to read from it:

- C intrinsics and Zig's vectors come to the same code, within a few instructions either way:
  nothing is left that a choice of intrinsics could win.
- `least` is what assembly could not do without. The compiler is within two instructions of it, so a
  kernel by hand has 3 or 4 % of its own instructions to win, and kernels are not all of a frame.
- The scalar backend is loops over four floats, and LLVM turns the simple ones into vectors by
  itself: its box test is the same code. The triangle test resists, at 1.7 to 2.6 times the
  instructions. So the reference of the benchmark has some SIMD in it, as a compiler of today finds
  it in plain code.
- The out-of-order cores take far fewer cycles for the same code than the Cortex-A53: what a board
  owner gains by a better core is more than any of this.
- ARMv7 is another matter: minima, maxima, divisions and roots of vectors (`docs/lowering.md`) are
  shorter by intrinsics.

What pays is what is not computed at all: `docs/performance.md` lists what each technique of
beams saves, by factors.
"""


def analyser():
    """llvm-mca, the newest that is there; without one that knows Neoverse V2, the end."""
    for version in range(30, 18, -1):
        program = shutil.which(f"llvm-mca-{version}")
        if program:
            return program
    sys.exit("kernels: needs llvm-mca 19 or later (Debian: llvm-19)")


def compile_kernels(zig, target, cpu, backend, folder):
    """The assembly of bench/kernels.zig for one processor and backend."""
    (folder / "choice.zig").write_text(
        f"pub const backend = .{backend};\npub const lanes = 4;\n")
    (folder / "config.zig").write_text(lowering.CONFIG + 'pub const version = "";\n')
    machine = ["-target", target, f"-mcpu={cpu}"]
    lowering.run(zig, "build-obj", "-OReleaseFast", "-fstrip", "-fomit-frame-pointer", *machine,
                 "-fno-emit-bin", f"-femit-llvm-bc={folder / 'zig.bc'}",
                 "--cache-dir", folder / "cache", "--dep", "raylane", "--dep", "choice",
                 "-Mroot=bench/kernels.zig", f"-Mchoice={folder / 'choice.zig'}",
                 "--dep", "config", "-Mraylane=src/raylane.zig",
                 f"-Mconfig={folder / 'config.zig'}")
    flags = [*machine, "-O3", "-fomit-frame-pointer", "-ffp-contract=off", "-w"]
    lowering.run(zig, "cc", *flags, "-std=c11", "-emit-llvm", "-c", "-o", folder / "c.bc",
                 "src/simd/intrinsics.c")
    lowering.run(zig, "cc", *flags, "-S", "-o", folder / "all.s", folder / "zig.bc",
                 "-Xclang", "-mlink-bitcode-file", "-Xclang", folder / "c.bc")
    # AArch64's immediates need no mark, which lowering.py takes for a comment.
    return lowering.functions((folder / "all.s").read_text().replace("#", ""))


def estimate(program, cpu, instructions):
    """(instructions, cycles a pass) of straight code."""
    code = [line for line in instructions if line.split()[0] != "ret"]
    done = subprocess.run(
        [program, "-mtriple=aarch64-linux-gnu", f"-mcpu={cpu.replace('_', '-')}",
         f"-iterations={PASSES}"],
        input="\n".join(code) + "\n", text=True, capture_output=True, check=False)
    cycles = re.search(r"Total Cycles:\s+(\d+)", done.stdout)
    if done.returncode != 0 or not cycles:
        sys.exit(f"kernels: {program} failed\n{done.stderr}")
    if any(lowering.CALL.match(line) for line in code):
        sys.exit("kernels: a kernel calls something")
    return len(code), int(cycles[1]) / PASSES


def table(title, model, results):
    """One processor's table; results by backend and kernel."""
    lines = [f"## {title}", "", f"LLVM's scheduling model: {model}.", "",
             "| kernel | least | " + " | ".join(f"{backend}: instructions | cycles"
                                                for backend in BACKENDS) + " |",
             "|---|---:|" + "---:|---:|" * len(BACKENDS)]
    for kernel in KERNELS:
        cells = [f"{count} | {cycles:.1f}" for count, cycles in
                 (results[backend][kernel] for backend in BACKENDS)]
        lines.append(f"| {kernel} | {LEAST.get(kernel, '')} | " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"


def main():
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    zig, out = sys.argv[1], pathlib.Path(sys.argv[2]).resolve()
    program = analyser()
    version = subprocess.check_output([zig, "version"], text=True).strip()
    mca = re.search(r"LLVM version ([\d.]+)",
                    subprocess.check_output([program, "--version"], text=True))[1]
    parts = [INTRODUCTION.replace("ZIG_VERSION", version).replace("MCA_VERSION", f"LLVM {mca}")]
    with tempfile.TemporaryDirectory() as name:
        for title, target, cpu, model in PROCESSORS:
            results = {}
            for backend in BACKENDS:
                code = compile_kernels(zig, target, cpu, backend, pathlib.Path(name))
                results[backend] = {kernel: estimate(program, cpu, code[f"Kernel.{kernel}"])
                                    for kernel in KERNELS}
            parts.append(table(title, model, results))
            print(f"kernels: {title}", file=sys.stderr)
    out.write_text("\n".join(parts))


if __name__ == "__main__":
    main()
