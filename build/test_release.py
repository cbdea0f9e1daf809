"""Tests of released programs, on old and new processors as qemu-user plays them.

In: the folder that `zig build release` fills, as the argument. Each processor has to choose its
level by itself, give the picture that all others give, and refuse in one line what it cannot run.
"""
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile
import unittest

FOLDER = pathlib.Path(sys.argv.pop(1))
SCENE = pathlib.Path(__file__).resolve().parent.parent / "scenes/cornell.gltf"

# By the architecture: processors of qemu-user, and the level of each; none: not told apart.
PROCESSORS = {
    "x86_64": {"qemu64": "x86-64", "core2duo": "x86-64", "Nehalem": "x86-64-v2",
               "Westmere": "x86-64-v2", "Haswell": "x86-64-v3", "max": "x86-64-v3"},
    "aarch64": {"cortex-a53": None, "cortex-a76": None, "max": None},
    "arm": {"cortex-a8": "armv7-neon", "cortex-a9": "armv7-neon",
            "cortex-a7": "armv7-neon-vfpv4", "cortex-a15": "armv7-neon-vfpv4"},
}
X86_LEVELS = ["x86-64", "x86-64-v2", "x86-64-v3", "x86-64-v4"]


def program_of(architecture):
    """The path of a program; skips where it was not built."""
    found = list(FOLDER.glob(f"raylane-*-linux-{architecture}"))
    if not found:
        raise unittest.SkipTest(f"there is no program for {architecture}")
    return found[0]


def emulated(architecture, processor):
    """How a command begins that a processor runs; skips where there is no emulator."""
    qemu = shutil.which(f"qemu-{architecture}")
    if qemu is None:
        raise unittest.SkipTest(f"qemu-{architecture} is not installed")
    return [qemu, "-cpu", processor, program_of(architecture)]


def run(command, level=None):
    """Output, errors and exit code, where RAYLANE_CPU is `level`."""
    environment = {key: value for key, value in os.environ.items() if key != "RAYLANE_CPU"}
    if level is not None:
        environment["RAYLANE_CPU"] = level
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    # qemu's own, of features that it does not play.
    errors = [line for line in done.stderr.splitlines(True) if not line.startswith("qemu-")]
    return done.stdout, "".join(errors), done.returncode


def level_of(command, level=None):
    """The level that a program says it is for."""
    out, err, code = run([*command, "--version"], level)
    if code != 0:
        raise AssertionError(f"{command}: {code}: {err}")
    return out.strip().partition(" for ")[2] or None


def pictures(command, level=None):
    """The bytes of a small picture by each integrator."""
    with tempfile.TemporaryDirectory() as folder:
        result = []
        for integrator in ("whitted", "lights", "path"):
            path = pathlib.Path(folder) / "picture.pfm"
            _, err, code = run([*command, SCENE, "-r", "32x32", "--spp", "2", "--integrator",
                                integrator, "-q", "-o", path], level)
            if code != 0:
                raise AssertionError(f"{command}: {code}: {err}")
            result.append(path.read_bytes())
        return result


class Released(unittest.TestCase):
    """Programs as they are."""
    seen = []

    def agree(self, told, command, level=None):
        """Compares the pictures with the first that were made, whatever made them."""
        self.seen.append(pictures(command, level))
        self.assertEqual(self.seen[0], self.seen[-1], told)

    def test_processors(self):
        for architecture, processors in PROCESSORS.items():
            for processor, level in processors.items():
                with self.subTest(architecture=architecture, processor=processor):
                    command = emulated(architecture, processor)
                    self.assertEqual(level_of(command), level)
                    self.agree(processor, command)

    def test_levels_here(self):
        command = [program_of("x86_64")]
        if os.uname().machine != "x86_64":
            self.skipTest("this is no x86-64")
        for level in X86_LEVELS[:X86_LEVELS.index(level_of(command)) + 1]:
            with self.subTest(level=level):
                self.assertEqual(level_of(command, level), level)
                self.agree(level, command, level)

    def test_too_high(self):
        command = emulated("x86_64", "Haswell") + ["--version"]
        self.assertEqual(run(command, "x86-64-v4"), (
            "", "raylane: RAYLANE_CPU is x86-64-v4, but this processor is x86-64-v3\n", 2))
        self.assertEqual(run(command, "486"), (
            "", f"raylane: RAYLANE_CPU is none of {', '.join(X86_LEVELS)}\n", 2))

    def test_without_neon(self):
        command = emulated("arm", "arm1176") + ["--version"]
        self.assertEqual(run(command), (
            "", "raylane: this processor lacks NEON, and Raylane needs it\n", 1))

    def test_sizes(self):
        for architecture in PROCESSORS:
            with self.subTest(architecture=architecture):
                self.assertLess(program_of(architecture).stat().st_size, 25 << 20)


if __name__ == "__main__":
    unittest.main()
