"""Tests of the tools beside this file, on programs made here.

Run: python3 -m unittest discover -s tests/robustness
"""

import pathlib
import random
import struct
import tempfile
import unittest

import hostile
import mutations
import runs
import soak


def shell(script, timeout_s=20):
    """A run of a shell script."""
    return runs.run(["sh", "-c", script], timeout_s=timeout_s)


class Runs(unittest.TestCase):
    def test_outcomes(self):
        for script, crash in [
                ("exit 0", None),
                ("echo raylane: a: warning: b >&2; echo raylane: a: c >&2; exit 3", None),
                ("exit 1", "0 lines of errors"),
                ("echo raylane: a >&2; echo raylane: b >&2; exit 1", "2 lines of errors"),
                ("echo panic >&2; exit 0", "said what is no message"),
                ("exit 7", "exit code 7"),
                ("kill -SEGV $$", "died of SIGSEGV")]:
            self.assertEqual(shell(script).crash, crash, script)

    def test_what_hangs_is_killed_with_all_that_it_started(self):
        run = shell("sleep 60 & sleep 60", timeout_s=0.2)
        self.assertEqual(run.crash, "did not end")
        self.assertLess(run.seconds, 10)

    def test_the_peak_is_the_program_s(self):
        small = shell("exit 0")
        large = runs.run(["python3", "-c", "a = b'x' * 100_000_000"], timeout_s=20)
        self.assertGreater(large.peak_bytes, small.peak_bytes)
        self.assertGreater(large.peak_bytes, 100_000_000)


class Mutations(unittest.TestCase):
    def test_they_are_others_and_the_same_again(self):
        text = b'{"asset":{"version":"2.0"},\n"nodes":[{"mesh":0}],\n"scene":0}\n'
        chunk = text + b" " * (-len(text) % 4)
        glb = struct.pack("<4sIIII", b"glTF", 2, 20 + len(chunk), len(chunk), 0x4E4F534A) + chunk
        for data in (text, glb, bytes(range(256)), b"x"):
            made = [mutations.mutate(data, random.Random(seed)) for seed in range(200)]
            self.assertEqual(made, [mutations.mutate(data, random.Random(seed))
                                    for seed in range(200)])
            self.assertNotIn(data, made)
            if len(data) > 1:
                self.assertGreater(len(set(made)), 50)

    def test_most_of_a_glb_keeps_its_lengths(self):
        chunk = b'{"asset":{"version":"2.0"}}'.ljust(28)
        glb = struct.pack("<4sIIII", b"glTF", 2, 48, 28, 0x4E4F534A) + chunk
        made = [mutations.mutate(glb, random.Random(seed)) for seed in range(300)]
        right = sum(len(one) >= 20 and struct.unpack_from("<I", one, 8)[0] == len(one)
                    for one in made)
        self.assertGreater(right, 100)


class Verdicts(unittest.TestCase):
    def run_of(self, code, *lines, seconds=1.0):
        """A run that did not happen."""
        return runs.Run(code, 0, False, seconds, 0, "".join(line + "\n" for line in lines))

    def test_manifest(self):
        good = self.run_of(0)
        warned = self.run_of(0, "raylane: a: warning: b")
        refused = self.run_of(3, "raylane: a: b")
        for expected, run, is_bad in [
                ("ok", good, False), ("ok", warned, True), ("warn", good, True),
                ("warn", warned, False), ("error", refused, False), ("error", warned, True),
                ("ok", self.run_of(0, "raylane: a: warning: nothing to render of 2"), False),
                ("ok or warn", good, False), ("ok or warn", refused, True),
                ("error 3", refused, False), ("error 3", self.run_of(1, "raylane: a"), True)]:
            self.assertEqual(hostile.complaint(expected, run) is not None, is_bad, expected)

    def test_times_and_pictures(self):
        slow = self.run_of(0, seconds=2.0)
        fast = self.run_of(0, seconds=1.0)
        self.assertIn("2.0 times", hostile.complaint("as fast as a", slow, None, fast))
        self.assertIsNone(hostile.complaint("as fast as a", fast, None, fast))
        with tempfile.TemporaryDirectory() as folder:
            picture = pathlib.Path(folder) / "a.ppm"
            for level, is_bad in [(0, True), (9, False)]:
                picture.write_bytes(b"P6\n2 2\n255\n" + bytes([level] * 12))
                bad = hostile.complaint("not black, or a warning", fast, picture)
                self.assertEqual(bad is not None, is_bad)

    def test_soak(self):
        flat = [(i, 50_000_000 + i % 3 * 1000, 5 + i % 3, 1) for i in range(40)]
        self.assertIsNone(soak.verdict(flat, 3, 4_000_000))
        grown = [(i, 50_000_000 + i * 1_000_000, 5, 1) for i in range(40)]
        self.assertIn("memory grew", soak.verdict(grown, 3, 4_000_000))
        open_files = [(i, 50_000_000, 5 + i // 20 + i % 2, 1) for i in range(40)]
        self.assertIn("descriptors", soak.verdict(open_files, 3, 4_000_000))
        self.assertIn("ended", soak.verdict(flat, -11, 4_000_000))


if __name__ == "__main__":
    unittest.main()
