"""Tests of bench/compare.py, cores.py and instructions: what they conclude from what programs say.

Run: python3 -m unittest discover -s bench/reporting -t bench
"""

import contextlib
import importlib.machinery
import importlib.util
import io
import json
import pathlib
import tempfile
import unittest

import compare
import cores

BENCH = pathlib.Path(__file__).resolve().parent.parent


def load(name):
    """A script without an extension, as a module."""
    loader = importlib.machinery.SourceFileLoader(name, str(BENCH / name))
    module = importlib.util.module_from_spec(importlib.util.spec_from_loader(name, loader))
    loader.exec_module(module)
    return module


class Compare(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        self.addCleanup(self.folder.cleanup)

    def program(self, name, time_ms, image_hash, exit_code=0):
        """A stand-in that says what it is told to."""
        path = pathlib.Path(self.folder.name) / name
        stats = json.dumps({"time_ms": {"trace": time_ms}, "image_hash": image_hash})
        path.write_text(f"#!/bin/sh\necho '{stats}'\necho 'raylane: bad' >&2\nexit {exit_code}\n")
        path.chmod(0o755)
        return str(path)

    def run_with(self, *arguments):
        out, err = io.StringIO(), io.StringIO()
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
            code = compare.main(list(arguments))
        return code, out.getvalue(), err.getvalue()

    def test_ratios(self):
        single = self.program("single", 10.0, "aa")
        together = self.program("all", 11.0, "aa")
        code, out, _ = self.run_with(together, f"v-single-4={single}", "--", "s", "--rounds", "3")
        self.assertEqual(code, 0)
        self.assertIn("1.100 ±0.000", out)

    def test_another_image_is_an_error(self):
        single = self.program("single", 10.0, "bb")
        together = self.program("all", 11.0, "aa")
        code, _, err = self.run_with(together, f"v-single-4={single}", "--", "s")
        self.assertEqual(code, 4)
        self.assertIn("the images differ", err)

    def test_failures_are_one_line(self):
        bad = self.program("bad", 1.0, "aa", exit_code=3)
        for arguments in ([bad, f"v={bad}", "--", "s"], [bad], [bad, "--"],
                          [bad, f"v={bad}", "--", "s", "--rounds", "1"]):
            code, out, err = self.run_with(*arguments)
            self.assertEqual((code, out, err.count("\n")), (1, "", 1))


class Cores(unittest.TestCase):
    def test_equal_tiles_on_equal_cores_scale_by_their_number(self):
        self.assertEqual(cores.predict([2, 1, 1]), [1, 1.5, 2])
        self.assertEqual(cores.simulate([1.0, 1.0], [1.0] * 10), 5)
        # The slow core begins its second tile when the quick one begins its last.
        self.assertEqual(cores.simulate([1.0, 0.5], [1.0] * 5), 4)

    def test_the_picture_is_the_same_whatever_the_tiles(self):
        whole = [sum(cores.works(tile, cores.random.Random(3))) for tile in (16, 32, 256)]
        self.assertAlmostEqual(whole[0], whole[1])
        self.assertAlmostEqual(whole[0], whole[2])

    def test_classes_of_this_machine_and_their_speeds(self):
        with tempfile.TemporaryDirectory() as name:
            for core, capacity in enumerate([446, 1024, 446, 1024]):
                folder = pathlib.Path(name, f"devices/system/cpu/cpu{core}")
                folder.mkdir(parents=True)
                (folder / "cpu_capacity").write_text(f"{capacity}\n")
            found = cores.classes(name)
            self.assertEqual(found, [(1024, [1, 3]), (446, [0, 2])])
        # A stand-in for tracing: core 1 and 3 are twice as quick as 0 and 2.
        original = cores.trace_ms
        self.addCleanup(setattr, cores, "trace_ms", original)
        cores.trace_ms = lambda program, scene, chosen, folder: 100 / sum(
            2 if core in (1, 3) else 1 for core in chosen)
        speeds, measured = cores.measure("raylane", "scene", found, 2)
        self.assertEqual(speeds, [1, 1, 0.5, 0.5])
        self.assertEqual([mean for mean, _ in measured], [1, 2, 2.5, 3])


class Instructions(unittest.TestCase):
    def setUp(self):
        self.tool = load("instructions")

    def test_rays_by_kind(self):
        totals = {"primary": 1000, "shadow": 300, "bounce_shadow": 100, "bounce": 500}
        run = {"primary": {"rays": 10}, "shadow": {"rays": 3}, "bounce_shadow": {"rays": 1},
               "bounce": {"rays": 0}}
        self.assertEqual(self.tool.by_kind(run, totals),
                         {"primary": 100, "shadow": 100, "secondary": None})

    def test_differences_count_each_tag_but_the_rest(self):
        self.assertEqual(self.tool.largest_difference({0: 5, 1: 1000}, {0: 9, 1: 1000}), 0)
        self.assertAlmostEqual(self.tool.largest_difference({1: 1000}, {1: 1002}), 0.002)
        self.assertEqual(self.tool.largest_difference({1: 10}, {1: 10, 2: 1}), 1)

    def test_page(self):
        kinds = {"primary": 100, "shadow": 50, "secondary": None}
        scene = {"scene": "builtin:cornell", "triangles": 9, "hash": "0",
                 "build_per_triangle": {"4": 1234.4},
                 "variants": {"vector-beam-4": {**kinds, "pixel": 50},
                              "scalar-single-4": {**kinds, "pixel": 200}}}
        page = self.tool.markdown([{"machine": "aarch64", "repeat_difference": 0,
                                    "scenes": [scene]}], 256)
        self.assertIn("| `vector-beam-4` | 4.00 | 4.00 |", page)
        self.assertIn("| `scalar-single-4` | 100 | 50 | - |", page)
        self.assertLess(page.index("`scalar-single-4`"), page.index("`vector-beam-4`"))
        self.assertIn("| 4 | 1234 |", page)
        self.assertIn("the same to the last digit", page)


if __name__ == "__main__":
    unittest.main()
