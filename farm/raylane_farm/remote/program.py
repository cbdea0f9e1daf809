"""Runs the `raylane` of this machine, and says which one it is."""

from __future__ import annotations

import contextlib
import ctypes
import dataclasses
import functools
import hashlib
import os
import re
import shutil
import signal
import subprocess
import sys
import threading
from typing import Dict, List, Optional, Sequence

# A lit scene of many surfaces that needs no file, in a few milliseconds.
PROBE = ("builtin:atrium", "-r", "48x32", "--spp", "1", "--depth", "4", "-q", "--stats", "none")
PROBE_OUTPUT = ("--format", "ppm", "-o", "-")
# Bytes of what a program may say that are kept.
STDERR_BYTES_MAX = 1 << 16
# What it says at the end of several pictures.
SUMMARY = re.compile(r"raylane: [0-9]+ pictures? in ")


class ProgramMissing(Exception):
    """There is no `raylane` on this machine; the text says where it was looked for."""


@dataclasses.dataclass(frozen=True)
class Identity:
    """What must be the same on all machines for them to give the same picture."""

    version: str
    # SHA-256 of the file of the probe's picture.
    picture: str


@dataclasses.dataclass(frozen=True)
class Run:
    """How a program ended: its exit code, 128 + N where signal N ended it."""

    code: int
    stdout: bytes
    stderr: str


def find() -> str:
    """The path of the program: the environment's RAYLANE, or `raylane` of the PATH."""
    named = os.environ.get("RAYLANE")
    found = shutil.which(named or "raylane")
    if found is None:
        where = f"RAYLANE names {named}, which is no program" if named else "no raylane on the PATH"
        raise ProgramMissing(where)
    return os.path.abspath(found)


class Runner:
    """Starts programs, and can end all of them."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._running: Dict[int, "subprocess.Popen[bytes]"] = {}
        self._is_stopped = False

    def run(self, arguments: Sequence[str], folder: Optional[str] = None) -> Run:
        """Runs the program to its end."""
        command = [find(), *arguments]
        with self._lock:
            if self._is_stopped:
                return Run(128 + signal.SIGTERM, b"", "stopped")
            process = subprocess.Popen(
                command,
                cwd=folder,
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                # The terminal's Ctrl-C is the client's to handle.
                start_new_session=True,
                preexec_fn=_end_with_parent(),
            )
            self._running[process.pid] = process
        try:
            stdout, stderr = process.communicate()
        finally:
            with self._lock:
                del self._running[process.pid]
            if process.poll() is None:
                _end(process, signal.SIGKILL)
                process.wait()
        code = process.returncode if process.returncode >= 0 else 128 - process.returncode
        return Run(code, stdout, stderr[-STDERR_BYTES_MAX:].decode("utf-8", "replace"))

    def stop(self) -> None:
        """Ends what runs, and starts nothing more."""
        with self._lock:
            self._is_stopped = True
            for process in self._running.values():
                _end(process, signal.SIGTERM)


def _end(process: "subprocess.Popen[bytes]", number: int) -> None:
    """With what it has started: the program may be a script that starts it."""
    with contextlib.suppress(ProcessLookupError):
        os.killpg(process.pid, number)


def _end_with_parent():
    """What makes the kernel end a child whose parent is killed; None where it cannot."""
    if not sys.platform.startswith("linux"):
        return None
    try:
        # Looked up here: between fork and exec nothing may be loaded.
        prctl = ctypes.CDLL(None).prctl
    except (OSError, AttributeError):
        return None
    set_parent_death_signal = 1
    return lambda: prctl(set_parent_death_signal, signal.SIGKILL, 0, 0, 0)


@functools.lru_cache(maxsize=1)
def _identity_of(path: str, modified_ns: int, size: int) -> Identity:
    runner = Runner()
    version = runner.run(["--version"])
    if version.code != 0:
        raise ProgramMissing(f"{path} --version: {reason(version)}")
    picture = runner.run([*PROBE, *PROBE_OUTPUT])
    if picture.code != 0:
        raise ProgramMissing(f"{path}: {reason(picture)}")
    name = version.stdout.decode("utf-8", "replace").strip()
    return Identity(name, hashlib.sha256(picture.stdout).hexdigest())


def identity() -> Identity:
    """Which program this machine has; asked of it once as long as its file stays the same."""
    path = find()
    stat = os.stat(path)
    return _identity_of(path, stat.st_mtime_ns, stat.st_size)


def difference(own: Identity, wanted: Identity) -> Optional[str]:
    """Why a machine with `own` may not take part in a job of `wanted`; None: it may."""
    if own.version != wanted.version:
        return f"has {own.version}, not {wanted.version}"
    if own.picture != wanted.picture:
        return f"its {own.version} gives another picture of {PROBE[0]}"
    return None


def reason(run: Run) -> str:
    """Why a program failed: the last line that it said, but for a summary."""
    lines: List[str] = [
        line for line in run.stderr.splitlines() if line.strip() and not SUMMARY.match(line)
    ]
    if lines:
        return lines[-1]
    if run.code > 128:
        return f"ended by signal {run.code - 128}"
    return f"exit code {run.code}"
