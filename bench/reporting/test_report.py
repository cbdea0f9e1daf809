"""Tests of the report: numbers beside known ones, the page's text, figures where matplotlib is.

Run: python3 -m unittest discover -s bench/reporting -t bench
"""

import contextlib
import copy
import importlib.util
import io
import json
import pathlib
import sys
import tempfile
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent))

import report  # noqa: E402
from reporting import page, samples, thesis  # noqa: E402

HAS_MATPLOTLIB = importlib.util.find_spec("matplotlib") is not None


def variant(name, trace_ms, whole_j=None):
    """As in a file of the benchmark."""
    energy = None if whole_j is None else {
        "whole_j": whole_j, "whole_gross_j": whole_j, "whole_s": [1.0] * len(whole_j),
        "trace_j": whole_j, "trace_gross_j": whole_j, "trace_s": [1.0] * len(whole_j)}
    return {"name": name, "parse_ms": [1.0, 1.0], "prepare_ms": [1.0, 1.0],
            "bvh_build_ms": [2.0, 2.0], "trace_ms": trace_ms, "energy": energy,
            "tests": {"box_issued": 4000, "box_useful": 3000, "triangle_issued": 1000,
                      "triangle_useful": 900}}


def run_of(with_energy):
    """A run of two variants in two scenes."""
    joules = ([8.0, 8.0], [2.0, 2.0]) if with_energy else (None, None)
    scenes = [{"scene": name, "triangles": 12, "image_hash": "00ff", "rounds": 2,
               "ended_by": "time", "rays": {"primary": 1000, "shadow": 2000, "secondary": 0},
               "variants": [variant("scalar-single-4", [10.0, 20.0], joules[0]),
                            variant("vector-packet2x2-4", [5.0, 10.0], joules[1])]}
              for name in ("builtin:handles", "<b>odd.glb")]
    return {"format": samples.FORMAT, "version": "0.1.0", "started_unix_s": 0, "duration_s": 1.0,
            "machine": {"processor": "A & B", "processor_count": 2, "system": "Linux"},
            "build": {"zig": "0.17.1", "optimize": "fast", "architecture": "aarch64",
                      "cpu": "cortex_a72", "cpu_features": ["neon"]},
            "settings": {"width": 8, "height": 8, "samples": 1, "depth": 3, "threads": 2,
                         "bvh": "default", "time_limit_s": 1, "rounds": 2, "precision": 0.02},
            "reference": "scalar-single-4",
            "energy": {"source": "hwmon" if with_energy else None, "scope": "board",
                       "reason": None if with_energy else "hwmon: no sensor", "rails": [],
                       "period_ms": 20, "window_ms": 1000, "idle_w": 2.5 if with_energy else None,
                       "idle_s": 5.0, "readings": 9, "reading_s": 0.1, "processor_s": 0.05},
            "scenes": scenes,
            "scaling": [{"scene": "builtin:handles", "variant": "scalar-single-4",
                         "threads": threads, "trace_ms": times}
                        for threads, times in ((1, [20.0, 20.0]), (2, [10.0, 11.0]))]}


class Numbers(unittest.TestCase):
    def test_interval(self):
        mean, half = samples.estimate([3, 4, 5, 6, 7])
        self.assertAlmostEqual(mean, 5)
        self.assertAlmostEqual(half, 2.7764 * (2.5 / 5) ** 0.5)
        self.assertEqual(samples.estimate([4]), (4, None))
        self.assertIsNone(samples.estimate([]))
        self.assertAlmostEqual(samples.quantile(100), 1.9840, places=4)

    def test_ratios_are_of_pairs(self):
        scene = run_of(False)["scenes"][0]
        self.assertEqual(samples.render_ratio(scene, scene["variants"][1]), (2.0, 0.0))
        self.assertIsNone(samples.ratio([1], [0]))

    def test_rates(self):
        scene = run_of(True)["scenes"][0]
        quick = scene["variants"][1]
        mean, _ = samples.rays_rate("primary")(scene, quick)
        self.assertAlmostEqual(mean, (1 / 5 + 1 / 10) / 2)
        self.assertEqual(samples.boxes_per_triangle(scene, quick), (4.0, None))
        self.assertEqual(samples.energy_ratio("whole_j")(scene, quick), (4.0, 0.0))
        self.assertEqual(samples.rays_per_joule("trace_j")(scene, quick)[0], 1.5)

    def test_thesis_ratios_follow_from_its_joules(self):
        for board, scenes in thesis.ENERGY_J.items():
            for scene, values in scenes.items():
                printed = thesis.ENERGY_RATIO[board][scene]
                for (mean, _), ratio in zip(values, printed):
                    # Its joules are printed rounded: 7 J may be 6.5.
                    self.assertAlmostEqual(values[0][0] / mean, ratio, delta=0.08 * ratio)


class Files(unittest.TestCase):
    def test_unusable_files_are_one_line(self):
        with tempfile.TemporaryDirectory() as folder:
            path = pathlib.Path(folder) / "a.json"
            for content in ("", "[]", "{}", '{"format":"other"}',
                            json.dumps({"format": samples.FORMAT, "scenes": []})):
                path.write_text(content, encoding="utf-8")
                with self.assertRaises(samples.Unusable):
                    samples.load(path)
            with self.assertRaises(samples.Unusable):
                samples.load(pathlib.Path(folder) / "absent.json")


class Page(unittest.TestCase):
    def test_published_numbers_stand_beside_measured_ones(self):
        text = page.write([run_of(True)], [("render-time", "5.1", "Time")], "figures", "svg")
        for needle in ("266 ± 32.05", "32.6 s", "2.8224 ± 0.083", "handles here: energy",
                       "8.000 ± 0.000", "4.000 ± 0.000", "figures/render-time.svg",
                       "A &amp; B", "&lt;b&gt;odd.glb"):
            self.assertIn(needle, text)
        self.assertNotIn("<b>odd", text)

    def test_energy_that_was_not_measured_is_said(self):
        text = page.write([run_of(False)], [], "figures", "svg")
        self.assertIn("not measurable here: hwmon: no sensor", text)
        self.assertNotIn("here: energy", text)


@unittest.skipUnless(HAS_MATPLOTLIB, "matplotlib is not installed")
class Figures(unittest.TestCase):
    def test_report_of_two_machines(self):
        with tempfile.TemporaryDirectory() as folder:
            place = pathlib.Path(folder)
            other = copy.deepcopy(run_of(False))
            other["scenes"] = other["scenes"][:1]
            for name, run in (("a.json", run_of(True)), ("b.json", other)):
                (place / name).write_text(json.dumps(run), encoding="utf-8")
            arguments = ["-o", str(place / "out"), str(place / "a.json"), str(place / "b.json")]
            with contextlib.redirect_stdout(io.StringIO()):
                self.assertEqual(report.main(arguments), 0)
            text = (place / "out" / "index.html").read_text(encoding="utf-8")
            for name in ("render-ratio", "energy", "scaling", "rays-per-joule"):
                self.assertIn(f"figures/{name}.svg", text)
                svg = (place / "out" / "figures" / f"{name}.svg").read_text(encoding="utf-8")
                self.assertTrue(svg.startswith("<?xml") and " \n" not in svg)
                png = (place / "out" / "figures" / f"{name}.png").read_bytes()
                self.assertTrue(png.startswith(b"\x89PNG"))


if __name__ == "__main__":
    unittest.main()
