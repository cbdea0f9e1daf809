#!/usr/bin/env python3
"""What each operation of the SIMD library becomes, counted in the compiler's assembly.

Usage: python3 bench/lowering.py ZIG OUT

ZIG is the compiler, OUT the Markdown file to write (docs/lowering.md). bench/lowering.zig is
compiled in fast mode for every target, backend and lane count below; the C intrinsics are linked
into its bitcode before code generation, as full link-time optimization does it.
"""

import pathlib
import re
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parent.parent

# Title, target, CPU, and the columns: backend and lanes.
TARGETS = [
    ("AArch64 (Cortex-A72)", "aarch64-linux-musl", "cortex_a72",
     [("scalar", 1), ("vector", 4), ("intrinsics", 4)]),
    ("ARMv7 (Cortex-A15)", "arm-linux-musleabihf", "cortex_a15",
     [("scalar", 1), ("vector", 4), ("intrinsics", 4)]),
    ("x86-64-v2 (SSE4.2)", "x86_64-linux-musl", "x86_64_v2",
     [("scalar", 1), ("vector", 4), ("intrinsics", 4)]),
    ("x86-64-v3 (AVX2)", "x86_64-linux-musl", "x86_64_v3",
     [("scalar", 1), ("vector", 4), ("intrinsics", 4), ("vector", 8)]),
    ("x86-64-v4 (AVX-512)", "x86_64-linux-musl", "x86_64_v4",
     [("scalar", 1), ("vector", 4), ("vector", 8), ("vector", 16)]),
]

INTRODUCTION = """# What the SIMD library becomes

Written by `python3 bench/lowering.py ZIG docs/lowering.md` (`zig build lowering`) with Zig
ZIG_VERSION; not to be edited. It is today's answer to the thesis's appendix B, and the reason for
most of the forms in `src/simd/vector.zig`.

A cell holds the number of instructions of one operation in fast mode and the first three kinds of
them. Returns, stack frames and moves between two registers are not counted: inlined code has none.
Operands come in registers, so constants (`adrp`, `ldr`) are counted, which a loop loads once.
`scalar x 1` is one value; four lanes of it cost four times as much. A truth value alone is a
general register there, and ends in `cset` or `setae` where a branch would follow.

The kernels are whole functions: `slabExact` and `slabFast` are one ray against as many boxes as
there are lanes, with the exact and the quick minimum, down to a bit for each box hit;
`nearestHit` is a loop over planes against as many rays as there are lanes, with masks carried from
one plane to the next. Their loops are counted as the compiler unrolled them, once.

What to read from it:

- The vector backend is as short as the intrinsics, give or take an instruction a kernel, but for
  ARMv7, where NEON's `vmin` and `vmax` have no Zig builtin. `@min` of floats is a library call a
  lane there, and the library does not use it.
- The exact minimum (`a < b ? a : b`) is x86's `minps` to the letter. ARM needs a comparison and a
  bitwise select, so that box tests, which only cull, use `minFast`.
- `minOrNegative` and its kin are one instruction as well, of integers: a cycle on x86-64, where
  `minps` and `cmpps` take four. Who only culls what lies behind uses these.
- ARMv7 divides and takes roots one lane at a time, in VFP: NEON has estimates only, and an
  estimate must not reach a pixel.
- Masks are words of all ones or all zeros: on ARM they feed `bsl`, `bif` or `bit` and on x86
  `blendvps` and `movmskps` as they are. Vectors of `bool` are packed and unpacked wherever a mask
  lives across a loop: a pass of `a = select(m, a + x, a); m = m ^ (x < a)` is 7 instructions on
  AArch64 with words, 21 with `bool`. With AVX-512 and at least 8 lanes it is the other way round:
  a vector of `bool` is a mask register (`kmovd` in a cell is the calling convention's).
"""

CONFIG = """
pub const variants: []const []const u8 = &.{"vector-single-4"};
pub const counting: []const []const u8 = &.{"vector-single-4"};
pub const are_all = false;
pub const shows_searches = false;
"""

# What a call costs and inlined code does not: returns, frames, and moves between two registers.
FRAME = re.compile(r"(ret|retq|bx|push|pop|vpush|vpop|vzeroupper)$")
MOVES = [
    re.compile(r"v?mov(aps|apd|dqa|dqa32|dqa64)\s+[xyz]mm\d+, [xyz]mm\d+$"),
    re.compile(r"mov\s+[er]?[a-z]+\d*d?, [er]?[a-z]+\d*d?$"),
    re.compile(r"mov\s+v\d+\.16b, v\d+\.16b$"),
    re.compile(r"mov\s+[wx]\d+, [wx]\d+$"),
    re.compile(r"fmov\s+[sd]\d+, [sd]\d+$"),
    re.compile(r"vorr\s+([qd]\d+), ([qd]\d+), \2$"),
    re.compile(r"vmov(\.f\d+)?\s+[qds]\d+, [qds]\d+$"),
]
CALL = re.compile(r"(bl|blx|call|callq)\s+(\S+)")


def run(*command):
    """Runs a compiler; its complaints go to stderr, and end the program."""
    result = subprocess.run([str(part) for part in command], cwd=ROOT, text=True,
                            stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
    if result.returncode != 0:
        sys.exit(f"lowering: {command[0]} failed\n{result.stdout}")


def compile_column(zig, target, cpu, backend, lanes, folder):
    """The assembly of bench/lowering.zig for one column."""
    (folder / "choice.zig").write_text(
        f"pub const backend = .{backend};\npub const lanes = {lanes};\n")
    (folder / "config.zig").write_text(CONFIG)
    machine = ["-target", target, f"-mcpu={cpu}"]
    run(zig, "build-obj", "-OReleaseFast", "-fstrip", "-fomit-frame-pointer", *machine,
        "-fno-emit-bin", f"-femit-llvm-bc={folder / 'zig.bc'}", "--cache-dir", folder / "cache",
        "--dep", "simd", "--dep", "choice", "-Mroot=bench/lowering.zig",
        f"-Mchoice={folder / 'choice.zig'}",
        "--dep", "config", "-Msimd=src/simd.zig", f"-Mconfig={folder / 'config.zig'}")
    flags = [*machine, "-O3", "-fomit-frame-pointer", "-ffp-contract=off", "-w"]
    run(zig, "cc", *flags, "-std=c11", "-emit-llvm", "-c", "-o", folder / "c.bc",
        "src/simd/intrinsics.c")
    if target.startswith("x86"):
        flags += ["-masm=intel"]
    run(zig, "cc", *flags, "-S", "-o", folder / "all.s", folder / "zig.bc",
        "-Xclang", "-mlink-bitcode-file", "-Xclang", folder / "c.bc")
    return (folder / "all.s").read_text()


def functions(assembly):
    """Name of each exported function -> its instructions, each with blanks made single."""
    bodies, aliases, body = {}, {}, []
    for line in assembly.splitlines():
        line = re.sub(r"\s+(//|@|#).*", "", line).rstrip()
        alias = (re.match(r'\s*\.set\s+"?([\w.]+)"?,\s*"?([\w.$]+)"?$', line)
                 or re.match(r'"?(\w+\.\w+)"? = "?([\w.$]+)"?$', line))
        label = re.match(r'"?([\w.$]+)"?:', line)
        if alias:
            aliases[alias[1]] = alias[2]
        elif label and not re.match(r"\.L(BB|tmp|func|CPI)", label[1]):
            body = bodies.setdefault(label[1], [])
        elif re.match(r"\s+[a-z]", line):
            body.append(re.sub(r"\s+", " ", line.strip()))
    return {name: bodies[place] for name, place in aliases.items() if place in bodies}


def is_counted(instruction):
    if FRAME.match(instruction.split()[0]):
        return False
    return not any(move.match(instruction) for move in MOVES)


def cell(instructions):
    """Number of instructions, calls if any, and what they are."""
    counted = [instruction for instruction in instructions if is_counted(instruction)]
    if not counted:
        return "0"
    calls = [match[2] for match in map(CALL.match, counted) if match]
    names = list(dict.fromkeys(instruction.split()[0] for instruction in counted))
    shown = " ".join(names[:3]) + (" ..." if len(names) > 3 else "")
    if calls:
        return f"{len(counted)}, **{len(calls)} calls** of `{calls[0]}`"
    return f"{len(counted)} `{shown}`"


def table(title, columns, lowered):
    """One target's table in Markdown."""
    heads = [f"{backend} x {lanes}" for backend, lanes in columns]
    lines = [f"## {title}", "", "| operation | " + " | ".join(heads) + " |",
             "|---" * (len(heads) + 1) + "|"]
    names = list(dict.fromkeys(name for column in lowered for name in column))
    kinds = {"F32": 0, "I32": 1, "Mask": 2, "Kernel": 3}
    for name in sorted(names, key=lambda name: (kinds[name.split(".")[0]], name)):
        cells = [cell(column[name]) if name in column else "" for column in lowered]
        lines.append(f"| {name} | " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"


def main():
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    zig, out = sys.argv[1], pathlib.Path(sys.argv[2]).resolve()
    version = subprocess.check_output([zig, "version"], text=True).strip()
    parts = [INTRODUCTION.replace("ZIG_VERSION", version)]
    with tempfile.TemporaryDirectory() as name:
        for title, target, cpu, columns in TARGETS:
            lowered = [functions(compile_column(zig, target, cpu, *column, pathlib.Path(name)))
                       for column in columns]
            parts.append(table(title, columns, lowered))
            print(f"lowering: {title}", file=sys.stderr)
    out.write_text("\n".join(parts))


if __name__ == "__main__":
    main()
