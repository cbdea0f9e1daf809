"""Jobs on a cluster of three workers on this machine, against what one run of the program writes.

RAYLANE_PROGRAM is the program. Workers have it behind a script that logs runs, and is slow, broken
or another version when a file says so.
"""

from __future__ import annotations

import base64
import contextlib
import io
import json
import os
import shutil
import signal
import struct
import subprocess
import sys
import tempfile
import threading
import time
import unittest

try:
    from distributed import Client

    from raylane_farm import cluster
except ImportError:
    Client = None

from raylane_farm import __main__ as farm_main
from raylane_farm.remote import program

PROGRAM = os.environ.get("RAYLANE_PROGRAM")
OPENJD = os.path.join(os.path.dirname(sys.executable), "openjd")
TEMPLATES = os.path.join(os.path.dirname(os.path.dirname(os.path.abspath(__file__))), "openjd")
SMALL = ["-r", "16x16", "--spp", "1", "--env", "none"]
# Of several tiles.
LARGER = ["-r", "64x48", "--spp", "1", "--env", "none"]
WAIT_S = 60

SCRIPT = """#!/bin/sh
folder={folder}
case "$*" in
--version) [ "$(cat $folder/other 2>/dev/null)" = $PPID ] && exec echo raylane 9.9 ;;
*{probe}*) exec cat $folder/probe.ppm ;;
info*|merge*) ;;
*)
    echo "$PPID $$ $*" >> $folder/log
    rm $folder/fail 2>/dev/null && echo "raylane: disk full" >&2 && exit 1
    sleep "$(cat $folder/slow 2>/dev/null || echo 0)" ;;
esac
exec {program} "$@"
"""


def scene() -> str:
    """A triangle that turns, with its buffer in a file of its own."""
    return json.dumps({
        "asset": {"version": "2.0"},
        "scenes": [{"nodes": [0]}],
        "scene": 0,
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
        "buffers": [{"byteLength": 76, "uri": "parts/a%20b.bin"}],
        "bufferViews": [{"buffer": 0, "byteLength": 76}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "type": "VEC3", "count": 3,
             "min": [0, 0, 0], "max": [1, 1, 0]},
            {"bufferView": 0, "byteOffset": 36, "componentType": 5126, "type": "SCALAR",
             "count": 2, "min": [0], "max": [1]},
            {"bufferView": 0, "byteOffset": 44, "componentType": 5126, "type": "VEC4", "count": 2},
        ],
        "animations": [{
            "channels": [{"sampler": 0, "target": {"node": 0, "path": "rotation"}}],
            "samplers": [{"input": 1, "output": 2}],
        }],
    })


BUFFER = struct.pack("<19f", 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0.6, 0.8)


@unittest.skipUnless(Client and PROGRAM, "needs Dask, and the program by RAYLANE_PROGRAM")
class ClusterTest(unittest.TestCase):
    """One cluster for all of them; each leaves it with three workers."""

    @classmethod
    def setUpClass(cls):
        cls.folder = os.path.realpath(cls.enter(tempfile.TemporaryDirectory()))
        cls.script = cls.path("raylane")
        probe = subprocess.run(
            [PROGRAM, *program.PROBE, *program.PROBE_OUTPUT], check=True, capture_output=True
        )
        cls.write("probe.ppm", probe.stdout)
        text = SCRIPT.format(folder=cls.folder, probe=program.PROBE[0], program=PROGRAM)
        cls.write("raylane", text.encode())
        os.chmod(cls.script, 0o755)
        os.environ.update(RAYLANE=cls.script, RAYLANE_FARM_CACHE=cls.path("cache"))
        os.makedirs(cls.path("scene/parts"))
        cls.write("scene/turn.gltf", scene().encode())
        cls.write("scene/parts/a b.bin", BUFFER)
        cls.scene = cls.path("scene/turn.gltf")
        cls.address = cls.enter(cluster._local(3))
        cls.client = cls.enter(Client(cls.address, set_as_default=False))

    @classmethod
    def enter(cls, context):
        stack = contextlib.ExitStack()
        cls.addClassCleanup(stack.close)
        return stack.enter_context(context)

    @classmethod
    def path(cls, name):
        return os.path.join(cls.folder, name)

    @classmethod
    def write(cls, name, contents):
        with open(cls.path(name), "wb") as file:
            file.write(contents)

    def setUp(self):
        for name in ("log", "slow", "other", "fail"):
            with contextlib.suppress(FileNotFoundError):
                os.unlink(self.path(name))
        shutil.rmtree(self.path("out"), ignore_errors=True)
        self.client.wait_for_workers(3, timeout=WAIT_S)

    def runs(self):
        """What was started by workers: their process, its own, and its arguments."""
        try:
            with open(self.path("log"), encoding="utf-8") as file:
                return [line.split(" ", 2) for line in file.read().splitlines()]
        except FileNotFoundError:
            return []

    def farm(self, *arguments):
        """Exit code, and what is said."""
        numbers = (signal.SIGINT, signal.SIGTERM)
        handlers = [(number, signal.getsignal(number)) for number in numbers]
        said = io.StringIO()
        try:
            with contextlib.redirect_stderr(said):
                own = ["--scheduler", self.address, "--worker-timeout", str(WAIT_S)]
                code = farm_main.main([arguments[0], *own, *arguments[1:]])
        finally:
            for number, handler in handlers:
                signal.signal(number, handler)
        return code, said.getvalue()

    def when_running(self, count, act):
        """Calls `act` with the process of the worker that starts the run of this number."""
        def watch():
            end = time.monotonic() + WAIT_S
            while len(self.runs()) < count and time.monotonic() < end:
                time.sleep(0.01)
            act(int(self.runs()[count - 1][0]))
        thread = threading.Thread(target=watch)
        thread.start()
        self.addCleanup(thread.join)

    def alone(self, *arguments):
        """What one run of the program writes, by name."""
        with tempfile.TemporaryDirectory() as folder:
            command = [PROGRAM, self.scene, *arguments, "-q", "--stats", "none"]
            subprocess.run(command, check=True, cwd=folder)
            return contents(folder)

    def test_frames_are_those_of_one_run_though_a_worker_is_killed(self):
        self.write("slow", b"0.3")
        killed = []

        def kill(worker):
            killed.append(worker)
            os.kill(worker, signal.SIGKILL)

        self.when_running(4, kill)
        name = self.path("out/{model}_{frame:3}.png")
        code, said = self.farm(self.scene, "--frames", "3-14", "-o", name, "--", *SMALL)
        self.assertEqual((0, 12), (code, len(os.listdir(self.path("out")))), said)
        self.assertEqual(
            self.alone("--frames", "3-14", "-o", "{model}_{frame:3}.png", *SMALL),
            contents(self.path("out")),
        )
        lost = [run[2] for run in self.runs() if int(run[0]) in killed][-1]
        self.assertEqual(2, [run[2] for run in self.runs()].count(lost))
        os.unlink(self.path("out/turn_007.png"))
        count = len(self.runs())
        code, said = self.farm(
            self.scene, "--frames", "3-14", "-o", name, "--skip-existing", "--", *SMALL
        )
        self.assertEqual((0, 12), (code, len(os.listdir(self.path("out")))), said)
        self.assertIn("--reference-frame 3 --frames 7 ", self.runs()[count][2])
        self.assertEqual(count + 1, len(self.runs()))

    def test_tiles_are_merged_to_the_picture_of_one_run_though_a_worker_is_killed(self):
        self.write("slow", b"0.3")
        self.when_running(2, lambda worker: os.kill(worker, signal.SIGKILL))
        name = self.path("out/turn.png")
        code, said = self.farm(self.scene, "--tiles", "4", "-o", name, "--", *LARGER)
        self.assertEqual(0, code, said)
        self.assertEqual(self.alone("-o", "turn.png", *LARGER), contents(self.path("out")))
        self.assertEqual(5, len(self.runs()))

    def test_views_around_the_scene(self):
        own = ["--turntable", "3", "-o", self.path("out/")]
        code, said = self.farm(self.scene, *own, "--", *SMALL)
        self.assertEqual(0, code, said)
        expected = self.alone("--turntable", "3", "-o", "{model}_{view:3}.png", *SMALL)
        self.assertEqual(expected, contents(self.path("out")))

    def test_another_version_is_refused_by_name(self):
        other = self.client.run(os.getpid)
        worker, process = sorted(other.items())[0]
        self.write("other", str(process).encode())
        os.utime(self.script)
        name = self.path("out/{frame}.png")
        code, said = self.farm(self.scene, "--frames", "1-4", "-o", name, "--", *SMALL)
        os.unlink(self.path("other"))
        os.utime(self.script)
        self.assertEqual(0, code, said)
        self.assertRegex(said, rf"left out: worker '.*' on .* \({worker}\): has raylane 9\.9, not ")
        self.assertEqual(4, len(os.listdir(self.path("out"))))
        self.assertNotIn(str(process), [run[0] for run in self.runs()])

    def test_what_fails_on_one_machine_is_tried_on_another(self):
        self.write("fail", b"")
        name = self.path("out/{frame}.png")
        code, said = self.farm(self.scene, "--frames", "1-2", "-o", name, "--", *SMALL)
        self.assertEqual((0, 3), (code, len(self.runs())), said)

    def test_errors_are_one_line_and_end_the_job(self):
        code, said = self.farm(self.scene, "--frames", "1-90", "--", *SMALL, "--camera", "7")
        self.assertEqual(2, code)
        self.assertRegex(said, r"\Araylane: .*turn\.gltf: .*camera.*\n\Z")
        self.assertLessEqual(len(self.runs()), 3)
        self.write("broken.gltf", b"{")
        code, said = self.farm(self.path("broken.gltf"), "--frames", "1-90")
        self.assertEqual(3, code)
        self.assertRegex(said, r"\Araylane: .*broken\.gltf: .*\n\Z")

    def test_an_interrupt_ends_what_runs(self):
        self.write("slow", b"300")
        self.when_running(2, lambda _: os.kill(os.getpid(), signal.SIGINT))
        code, said = self.farm(self.scene, "--frames", "1-9", "-o", self.path("out/"), "--", *SMALL)
        self.assertEqual(130, code)
        self.assertEqual("raylane_farm: ended by SIGINT: 0 of 9 frames are done\n", said)
        for _, process, _ in self.runs():
            self.assertFalse(os.path.exists(f"/proc/{process}/exe"), process)

    @unittest.skipUnless(os.path.exists(OPENJD), "needs openjd-cli")
    def test_templates_of_open_job_description(self):
        for name, given in (
            ("frames", ["Frames=1-3,6", "ChunkSize=3", "Name={frame}.png"]),
            ("tiles", ["Tiles=3", "Name=turn.png"]),
        ):
            out = self.path(f"out/{name} here")
            template = os.path.join(TEMPLATES, f"{name}.yaml")
            subprocess.run([OPENJD, "check", template], check=True, capture_output=True)
            own = [f"Scene={self.scene}", f"Output={out}", f"Program={self.script}"]
            own += given + ["Options=-r '64x48' --spp 1 --env none"]
            pairs = [word for parameter in own for word in ("-p", parameter)]
            run = subprocess.run([OPENJD, "run", template, *pairs], capture_output=True, text=True)
            self.assertEqual(0, run.returncode, run.stdout + run.stderr)
            self.assertGreaterEqual(len(self.runs()), 2)
            words = ["-o", "turn.png"]
            if name == "frames":
                words = ["--frames", "1-3,6", "-o", "{frame}.png"]
            self.assertEqual(self.alone(*words, *LARGER), contents(out))


def contents(folder):
    """Files by name, as text that a difference can be shown of."""
    found = {}
    for name in sorted(os.listdir(folder)):
        with open(os.path.join(folder, name), "rb") as file:
            found[name] = base64.b64encode(file.read())[:20_000]
    return found


if __name__ == "__main__":
    unittest.main()
