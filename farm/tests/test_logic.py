"""What needs neither Dask nor the program: ranges, names, batches, options, scenes, the cache."""

from __future__ import annotations

import contextlib
import io
import json
import os
import stat
import tempfile
import threading
import time
import unittest
from unittest import mock

from raylane_farm import command_line, options, output, plan, ranges, scene, template, work
from raylane_farm.errors import FarmError
from raylane_farm.progress import Progress, duration
from raylane_farm.remote import cache, program, task_runner

try:
    from openjd.model import IntRangeExpr
except ImportError:
    IntRangeExpr = None

RANGES = (
    "1 - 5", "1 - -1", "-1 - 1", "1-5:2", "10-15:2,1-5", "1-10:4", "100,-1--2:-1,3-5,\t7 ",
    "10-1:-2", "2147483647,-2147483648",
)
NO_RANGES = (
    "", "a", "1-", "-", "1,,2", "1-5:0", "1:2", "1 2", "+1", "1-2-3", "1.5", "5,5", "9-2:-3,4",
)


def read(path):
    """What is in a file."""
    with open(path, "rb") as file:
        return file.read()


class RangeTest(unittest.TestCase):
    """Open Job Description's grammar."""

    def test_ranges_of_the_specification(self):
        self.assertEqual([1, 2, 3, 4, 5, 10, 12, 14], ranges.parse("10-15:2,1-5"))
        self.assertEqual([-2, -1, 3, 4, 5, 7, 100], ranges.parse("100,-1--2:-1,3-5,\t7 "))
        self.assertEqual([2, 4, 6, 8, 10], ranges.parse("10-1:-2"))
        self.assertEqual([1], ranges.parse("1 - -1"))

    def test_what_is_no_range(self):
        for text in (*NO_RANGES, "1-1000001"):
            with self.subTest(text), self.assertRaises(FarmError) as caught:
                ranges.parse(text)
            self.assertEqual(2, caught.exception.code)

    @unittest.skipIf(IntRangeExpr is None, "openjd-model is not installed")
    def test_the_reference_implementation_agrees(self):
        for text in RANGES:
            with self.subTest(text):
                try:
                    expected = sorted(IntRangeExpr.from_str(text))
                except Exception:  # It takes no range that goes the other way.
                    self.assertEqual("1 - -1", text)
                    continue
                self.assertEqual(expected, ranges.parse(text))
        for numbers in ([3], [1, 2], [1, 3], [1, 2, 3, 5, 7, 9, 20, 40, 41], [-4, -2, 0, 7]):
            text = ranges.write(numbers)
            self.assertEqual(numbers, sorted(IntRangeExpr.from_str(text)))

    def test_written_ranges_are_read_again(self):
        for numbers in ([], [3], [1, 3], [1, 2, 3, 5, 7, 9, 20, 40, 41], list(range(-5, 900, 7))):
            text = ranges.write(numbers)
            self.assertEqual(numbers, ranges.parse(text) if text else [])
        self.assertEqual("1-3,5-9:2,20,40-41", ranges.write([1, 2, 3, 5, 7, 9, 20, 40, 41]))


class TemplateTest(unittest.TestCase):
    """Names of pictures."""

    def test_the_folder_in_front_is_the_clients(self):
        text = "{model}/{frame:4}.png"
        self.assertEqual(("out", text), template.split(f"out/{text}"))
        self.assertEqual((".", "x{frame}.png"), template.split("x{frame}.png"))
        self.assertEqual(("/", "{frame}.png"), template.split("/{frame}.png"))
        self.assertEqual(("/a", "b.png"), template.split("/a/b.png"))

    def test_names_are_those_of_the_program(self):
        text = "o/{model}_{frame:4}-{view:3}{{}}.png"
        self.assertEqual("o/fox_-003-007{}.png", template.expand(text, "fox", -3, 7))
        self.assertEqual("_a_b.png", template.expand("{model}.png", ".a/b", None, None))
        self.assertEqual("a/{model}_{frame:4}.png", template.of("a/", "png", True, False))
        self.assertEqual("{model}_{view:3}.jpg", template.of(None, "jpg", False, True))
        for wrong in ("{camera}.png", "{frame}.png", "a}"):
            with self.assertRaises(FarmError):
                template.expand(wrong, "fox", None, None)


class PlanTest(unittest.TestCase):
    """Sizes of batches."""

    def test_start_and_frame_from_batches(self):
        start, frame = plan.fit([(1, 0.6), (11, 1.6), (21, 2.6)])
        self.assertAlmostEqual(0.5, start)
        self.assertAlmostEqual(0.1, frame)
        self.assertEqual((0.0, 0.5), plan.fit([(2, 1.0), (2, 1.0)]))
        self.assertEqual(0.0, plan.fit([(1, 2.0), (10, 1.0)])[0])

    def test_a_batch_is_worth_its_start_on_the_quickest_worker(self):
        pace = plan.Pace()
        self.assertEqual(1, pace.batch(100, 4))
        pace.add("slow", 1, 1.0)
        self.assertEqual(2, pace.batch(100, 4))
        pace.add("quick", 1, 0.1)
        self.assertEqual(20, pace.batch(100, 4))
        # Half a second to start: ten seconds of work, unless others would have none.
        for count in (1, 11, 21):
            pace.add("heavy", count, 0.5 + count / 64)
        self.assertEqual(608, pace.batch(10_000, 4))
        self.assertEqual(250, pace.batch(1000, 4))
        self.assertEqual(128, pace.batch(300, 4))
        # What is left behind would be less than is worth it.
        self.assertEqual(250, pace.batch(250, 4))
        self.assertEqual(7, pace.batch(7, 4))


class OptionsTest(unittest.TestCase):
    """What is handed on."""

    def test_files_and_options_of_reading_are_found(self):
        words = ["--scene=1", "-qt4", "--env", "sky.hdr", "--allow-outside", "-r", "64"]
        found = options.read([*words, "--eye", "-1,2,3"])
        self.assertEqual(["--scene", "1", "--allow-outside"], found.load)
        self.assertEqual([(3, "", "sky.hdr")], found.files)
        self.assertTrue(found.is_quiet)
        self.assertEqual([(0, "--env=", "a.exr")], options.read(["--env=a.exr"]).files)
        self.assertEqual([], options.read(["--env", "studio"]).files)

    def test_what_is_for_one_program_is_refused(self):
        for words in (
            ["-o", "a"], ["-qoa"], ["--frames=1"], ["--time-budget", "3"], ["--partial"],
            ["--outfile=a"], ["--format", "y4m"],
        ):
            with self.subTest(words), self.assertRaises(FarmError) as caught:
                options.read(words)
            self.assertEqual(2, caught.exception.code)

    def test_the_command_line(self):
        line = command_line.read(["a.glb", "--frames", "1-3", "--", "-r", "64", "--"])
        self.assertEqual([1, 2, 3], line.frames)
        self.assertEqual("{model}_{frame:4}.png", line.pattern)
        self.assertEqual(["-r", "64", "--"], line.options.words)
        line = command_line.read(["a", "--tiles=4", "--cache-size=500M"])
        self.assertEqual(500 << 20, line.cache_bytes)
        for words in (
            [], ["a"], ["a", "--frames=1", "--tiles=0"], ["a", "--frames=1-2", "-o", "b.png"],
            ["a", "--frames=1", "--workers=2", "--scheduler=tcp://b:1"], ["a", "--tile=4"],
            ["a", "--turntable=3", "-o{frame}"], ["a", "--frames=1", "--worker-timeout=x"],
        ):
            with self.subTest(words), self.assertRaises(FarmError) as caught:
                command_line.read(words)
            self.assertEqual(2, caught.exception.code)


class _Program:
    """Stands for the program: `info` lists these files, `merge` joins."""

    def __init__(self, files=(), code=0, stderr=""):
        self.files = files
        self.code = code
        self.stderr = stderr
        self.calls = []
        self.variant_count = 0

    def run(self, arguments, folder=None):
        self.calls.append(list(arguments))
        if arguments[0] == "merge":
            parts = [read(part) for part in arguments[3:]]
            with open(arguments[2], "wb") as file:
                file.write(b"".join(parts))
        found = {
            "files": [{"path": path, "bytes": 0} for path in self.files],
            "material_variants": ["name"] * self.variant_count,
        }
        return program.Run(self.code, json.dumps(found).encode(), self.stderr)


class FolderTest(unittest.TestCase):
    """Has a folder of its own to work in."""

    def setUp(self):
        self.folder = self.enterContextFor(tempfile.TemporaryDirectory())

    def enterContextFor(self, context):
        stack = contextlib.ExitStack()
        self.addCleanup(stack.close)
        return stack.enter_context(context)

    def put(self, name, contents=b""):
        path = os.path.join(self.folder, name)
        os.makedirs(os.path.dirname(path), exist_ok=True)
        with open(path, "wb") as file:
            file.write(contents)
        return path


class SceneTest(FolderTest):
    """Files of a scene, and their places."""

    def test_places_to_each_other_are_kept(self):
        path = self.put("a/b/s.gltf.gz", b"scene")
        self.put("a/b/c.bin", b"buffer")
        self.put("t.png", b"image")
        self.put("a/same.png", b"image")
        sky = self.put("sky.hdr", b"sky")
        os.makedirs(os.path.join(self.folder, "a/b/d"))
        listed = ["s.gltf.gz", "d/../c.bin", "../../t.png", "../same.png"]
        given = options.read(["--hdri", sky, "--scene=2"])
        found = scene.find(path, given, "{frame}.png", _Program(listed))
        self.assertEqual("s", found.model.removesuffix(".gltf"))
        self.assertEqual("../files/scene/folder/folder/s.gltf.gz", found.argument)
        self.assertEqual(
            [
                "scene/folder/folder/s.gltf.gz", "scene/folder/folder/c.bin", "scene/t.png",
                "scene/folder/same.png", "options/0/sky.hdr",
            ],
            [file.path for file in found.files],
        )
        self.assertIn("scene/folder/folder/d", found.folders)
        self.assertEqual(("--hdri", "../files/options/0/sky.hdr", "--scene=2"), found.options)
        self.assertEqual(4, len(found.sources))
        self.assertEqual(24, found.byte_count)

    def test_errors_are_the_programs(self):
        broken = _Program(code=3, stderr="raylane: warning\nraylane: a.glb: is broken\n")
        with self.assertRaises(FarmError) as caught:
            scene.find("a.glb", options.read([]), "", broken)
        self.assertEqual(3, caught.exception.code)
        self.assertEqual("raylane: a.glb: is broken", str(caught.exception))
        for path, files in (("-", []), ("a.glb", ["/etc/hostname"]), ("no/a.glb", ["a.glb"])):
            with self.subTest(path), self.assertRaises(FarmError):
                scene.find(path, options.read([]), "", _Program(files))

    def test_names_by_variants_need_the_files_of_all(self):
        path = self.put("s.glb")
        asked = _Program(["s.glb"])
        asked.variant_count = 2
        scene.find(path, options.read(["--allow-outside"]), "{material_variant}.png", asked)
        last = ["info", "--json", "-q", "--allow-outside", "--material-variant", "1", "--", path]
        self.assertEqual((3, last), (len(asked.calls), asked.calls[-1]))

    def test_a_scene_without_files(self):
        found = scene.find("builtin:nave", options.read([]), "", _Program())
        self.assertEqual(("builtin:nave", "nave", ()), (found.argument, found.model, found.files))


class CacheTest(FolderTest):
    """Blobs."""

    def blob(self, held, contents):
        part = held.begin()
        with open(part, "wb") as file:
            file.write(contents)
        digest = cache.digest_of(part)
        held.finish(part, digest)
        return digest

    def test_blobs_are_verified_coming_and_going(self):
        held = cache.Cache(self.folder, 1 << 20)
        target = os.path.join(self.folder, ".target")
        digest = self.blob(held, b"contents")
        self.assertTrue(held.take(digest, target))
        self.assertEqual(b"contents", read(target))
        part = held.begin()
        open(part, "wb").close()
        with self.assertRaises(cache.WrongContents):
            held.finish(part, digest.replace(digest[0], "0"))
        os.unlink(target)
        with open(held.place(digest), "r+b") as file:
            file.write(b"damage")
        self.assertFalse(held.take(digest, target))
        self.assertEqual([], os.listdir(self.folder))

    def test_the_least_recently_used_goes_first(self):
        held = cache.Cache(self.folder, 25)
        digests = [self.blob(held, b"%010d" % number) for number in range(2)]
        for age, digest in enumerate(digests):
            os.utime(held.place(digest), (1000 - age, 1000 - age))
        newest = self.blob(held, b"%010d" % 7)
        self.assertEqual({digests[0], newest}, set(os.listdir(self.folder)))
        large = self.blob(held, b"x" * 100)
        self.assertEqual([large], os.listdir(self.folder))

    def test_a_task_runner_takes_pieces_in_order(self):
        contents = b"abcdefgh"
        path = self.put("source", contents)
        digest = cache.digest_of(path)
        with mock.patch.dict(os.environ, RAYLANE_FARM_CACHE=os.path.join(self.folder, "cache")):
            with mock.patch.object(task_runner, "identity", lambda: program.Identity("v", "p")):
                job = task_runner.Job("j", program.Identity("v", "p"), (
                    task_runner.File("scene/x/a.bin", digest),
                    task_runner.File("scene/b.bin", digest),
                ), ("scene/d",), 1 << 20)
                one = task_runner.TaskRunner(job, "w", os.path.join(self.folder, "scratch"))
                self.assertEqual((digest,), one.greet().missing)
                self.assertFalse(one.receive(digest, 4, False, contents[4:]))
                self.assertTrue(one.receive(digest, 0, False, contents[:4]))
                self.assertFalse(one.receive(digest, 5, True, contents[5:]))
                self.assertFalse(one.receive(digest, 4, True, b"EFGH"))
                self.assertTrue(one.receive(digest, 0, False, contents[:4]))
                self.assertTrue(one.receive(digest, 4, True, contents[4:]))
                self.assertEqual((), one.greet().missing)
                for name in ("scene/x/a.bin", "scene/b.bin"):
                    self.assertEqual(contents, read(os.path.join(one.copies, name)))
                self.assertTrue(os.path.isdir(os.path.join(one.copies, "scene/d")))
                one.close()
                other = task_runner.Job("k", program.Identity("w", "p"), (), (), 1)
                refusal = task_runner.TaskRunner(other, "w", self.folder).greet().refusal
                self.assertEqual("has v, not w", refusal)


class WorkTest(FolderTest):
    """Tasks, and what becomes of results."""

    def scene(self):
        return scene.Scene("s.glb", "s", "../files/scene/s.glb", ("-r", "8"), (), (), {}, 0)

    def pictures(self, **given):
        pattern = os.path.join(self.folder, given.pop("pattern", "{model}_{frame:2}.png"))
        return work.Pictures(**{
            "frames": None, "view_count": None, "skip_existing": False, "pattern": pattern, **given,
        })

    def result(self, files, seconds=0.5):
        return task_runner.Result("w", 0, seconds, tuple(files), "")

    def test_frames_in_batches_and_what_is_left_of_them(self):
        self.put("s_03.png")
        pictures = self.pictures(frames=[2, 3, 4, 5, 6, 7, 8, 9], skip_existing=True)
        job = work.BatchWork(self.scene(), pictures)
        self.assertEqual(7, job.total)
        first = job.next(1)
        self.assertEqual(
            ("../files/scene/s.glb", "-r", "8", "--reference-frame", "2", "--frames", "2"),
            first.arguments[:7],
        )
        self.assertIsNone(job.next(1))
        job.take(first, self.result([("s_02.png", b"two")]))
        self.assertEqual(b"two", read(os.path.join(self.folder, "s_02.png")))
        second = job.next(1)
        self.assertEqual((4, 5, 6, 7, 8, 9), second.units)
        job.give_back(second)
        self.assertEqual(second, job.next(2))
        self.assertFalse(job.is_done())
        with self.assertRaises(FarmError):
            job.take(second, self.result([]))

    def test_views_of_one_moment(self):
        job = work.BatchWork(self.scene(), self.pictures(view_count=3, pattern="{view}.png"))
        task = job.next(1)
        self.assertEqual(("--turntable", "3", "--views", "0"), task.arguments[3:7])

    def test_tiles_are_merged_when_the_last_is_there(self):
        merger = _Program()
        parts = os.path.join(self.folder, "parts")
        pictures = self.pictures(frames=[1, 2], pattern="new/{frame}.exr")
        job = work.TileWork(self.scene(), pictures, 2, merger, parts)
        self.assertEqual(4, job.total)
        tasks = [job.next(9) for _ in range(4)]
        self.assertIsNone(job.next(9))
        self.assertIn("2/2", tasks[3].arguments)
        self.assertIn("--reference-frame", tasks[3].arguments)
        for index in (3, 1, 2):
            job.take(tasks[index], self.result([("part.exr", b"%d" % index)]))
        self.assertEqual(b"23", read(os.path.join(self.folder, "new/2.exr")))
        job.give_back(tasks[0])
        self.assertEqual(tasks[0], job.next(9))
        job.take(tasks[0], self.result([("part.exr", b"0")]))
        self.assertEqual(b"01", read(os.path.join(self.folder, "new/1.exr")))
        self.assertTrue(job.is_done())
        self.assertEqual([], os.listdir(parts))


class OutputTest(FolderTest):
    """Files of pictures, and what is said."""

    def test_as_a_whole_or_not_at_all(self):
        path = self.put("a.png", b"old")
        os.chmod(path, 0o640)
        link = os.path.join(self.folder, "link.png")
        os.symlink("a.png", link)
        output.write(link, b"new")
        self.assertEqual(b"new", read(path))
        self.assertEqual(0o640, stat.S_IMODE(os.stat(path).st_mode))
        self.assertTrue(os.path.islink(link))
        output.write(os.path.join(self.folder, "b/c.png"), b"")
        with self.assertRaises(FarmError):
            output.write(os.path.join(path, "d.png"), b"")
        self.assertEqual(["a.png", "b", "link.png"], sorted(os.listdir(self.folder)))

    def test_progress_for_programs(self):
        stream = io.StringIO()
        progress = Progress("json", "frames", 4, stream)
        progress.step(1, 2)
        progress.step(3, 1)
        first, last = [json.loads(line) for line in stream.getvalue().splitlines()]
        keys = ("done", "total", "unit", "workers")
        self.assertEqual([1, 4, "frames", 2], [first[key] for key in keys])
        self.assertEqual(0, last["seconds_left"])
        texts = [duration(seconds) for seconds in (12.3, 130, 7200)]
        self.assertEqual(["12.3 s", "2 min", "2 h 00 min"], texts)


class ProgramTest(FolderTest):
    """Runs of a program."""

    def program(self, text):
        path = self.put("raylane", f"#!/bin/sh\n{text}\n".encode())
        os.chmod(path, 0o755)
        self.enterContextFor(mock.patch.dict(os.environ, RAYLANE=path))
        return program.Runner()

    def test_how_it_ends(self):
        runner = self.program('echo "raylane: x: $1" >&2; printf out; [ "$1" = 0 ] || kill -9 $$')
        run = runner.run(["0"], self.folder)
        self.assertEqual((0, b"out", "raylane: x: 0\n"), (run.code, run.stdout, run.stderr))
        run = runner.run(["1"])
        self.assertEqual((137, "raylane: x: 1"), (run.code, program.reason(run)))
        said = "raylane: a: is broken\nraylane: 0 pictures in 2.5 s, 1 failure\n"
        self.assertEqual("raylane: a: is broken", program.reason(program.Run(3, b"", said)))
        self.assertEqual("ended by signal 9", program.reason(program.Run(137, b"", "")))
        # What a script starts holds the pipes as long as it runs.
        runner = self.program("sleep 60; true")
        threading.Timer(0.2, runner.stop).start()
        start = time.monotonic()
        self.assertEqual(143, runner.run([]).code)
        self.assertLess(time.monotonic() - start, 30)
        self.assertEqual(143, runner.run(["0"]).code)

    def test_which_it_is(self):
        self.program('[ "$1" = --version ] && echo raylane 7 || echo picture')
        own = program.identity()
        self.assertEqual("raylane 7", own.version)
        self.assertIsNone(program.difference(own, own))
        other = program.Identity("raylane 7", "0")
        self.assertIn("another picture", program.difference(own, other))
        with mock.patch.dict(os.environ, RAYLANE="/no/such"):
            with self.assertRaises(program.ProgramMissing):
                program.identity()


if __name__ == "__main__":
    unittest.main()
