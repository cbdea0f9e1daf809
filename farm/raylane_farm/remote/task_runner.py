"""A worker's part in a job: its copy of the scene, and one run of the program a task.

The functions at the end are what the client calls, by `Client.run` and as tasks. Their arguments
and results are plain values, so that tasks may run anywhere, twice too.
"""

from __future__ import annotations

import asyncio
import dataclasses
import os
import posixpath
import shutil
import socket
import tempfile
import threading
import time
from typing import Dict, List, Optional, Sequence, Tuple

from .cache import Cache, WrongContents, default_folder
from .program import Identity, ProgramMissing, Runner, difference, identity

# Where the copies of the job's files are from the folder that a program runs in: the same words on
# all workers.
ROOT = "../files"


@dataclasses.dataclass(frozen=True)
class File:
    """A file of the job: where its copy goes below the job's folder, and what is in it."""

    path: str
    digest: str


@dataclasses.dataclass(frozen=True)
class Job:
    """What all tasks of one job have in common."""

    name: str
    identity: Identity
    files: Tuple[File, ...]
    # Folders that paths of the scene lead through.
    folders: Tuple[str, ...]
    cache_bytes: int


@dataclasses.dataclass(frozen=True)
class Greeting:
    """What a worker says when it is asked to take part."""

    worker: str
    host: str
    cpu_count: int
    # Which cache it has: workers with the same one need a blob but once.
    cache: str
    # Why it may not take part; None: it may, once nothing is missing.
    refusal: Optional[str]
    # Digests of the files that it lacks.
    missing: Tuple[str, ...]


@dataclasses.dataclass(frozen=True)
class Result:
    """What became of a task."""

    worker: str
    # Of the program; 0: all is done.
    code: int
    seconds: float
    # Path below the output folder, and contents.
    files: Tuple[Tuple[str, bytes], ...]
    stderr: str


class TaskRunner:
    """What one worker process holds of one job."""

    def __init__(self, job: Job, worker: str, scratch: str) -> None:
        self.job = job
        self.worker = worker
        self.runner = Runner()
        self.thread_count = 1
        os.makedirs(scratch, exist_ok=True)
        self.folder = tempfile.mkdtemp(prefix="raylane-farm-", dir=scratch)
        self.copies = os.path.join(self.folder, os.path.basename(ROOT))
        try:
            self.cache = Cache(default_folder(), job.cache_bytes)
        except OSError:
            self.cache = Cache(os.path.join(scratch, "raylane-farm-cache"), job.cache_bytes)
        self._lock = threading.Lock()
        self._copied: set = set()
        self._parts: Dict[str, str] = {}

    def greet(self) -> Greeting:
        """Takes what the cache has of the job's files, and says what is missing."""
        refusal = None
        try:
            refusal = difference(identity(), self.job.identity)
        except (ProgramMissing, OSError) as error:
            refusal = str(error)
        host = socket.gethostname()
        return Greeting(
            worker=self.worker,
            host=host,
            cpu_count=cpu_count(),
            cache=f"{host}:{os.path.realpath(self.cache.folder)}",
            refusal=refusal,
            missing=() if refusal else self._copy(),
        )

    def _copy(self) -> Tuple[str, ...]:
        missing: Dict[str, None] = {}
        with self._lock:
            for folder in self.job.folders:
                os.makedirs(os.path.join(self.copies, folder), exist_ok=True)
            for file in self.job.files:
                if file.path in self._copied:
                    continue
                target = os.path.join(self.copies, file.path)
                os.makedirs(os.path.dirname(target), exist_ok=True)
                if self.cache.take(file.digest, target):
                    self._copied.add(file.path)
                else:
                    missing[file.digest] = None
        return tuple(missing)

    def receive(self, digest: str, offset: int, is_last: bool, piece: bytes) -> bool:
        """Adds a piece to a blob; whether it is as it should be so far."""
        with self._lock:
            if offset == 0:
                self._parts[digest] = self.cache.begin()
            part = self._parts.get(digest)
            if part is None:
                return False
            with open(part, "ab") as file:
                if file.tell() != offset:
                    return False
                file.write(piece)
            if not is_last:
                return True
            try:
                self.cache.finish(self._parts.pop(digest), digest)
            except WrongContents:
                return False
            return True

    def render(self, arguments: Sequence[str]) -> Result:
        """Runs the program in an empty folder, and takes all that it leaves there."""
        output = tempfile.mkdtemp(prefix="output-", dir=self.folder)
        try:
            start = time.monotonic()
            # In front, so that the user's own number counts.
            run = self.runner.run(["-t", str(self.thread_count), *arguments], output)
            seconds = time.monotonic() - start
            files = tuple(_contents(output)) if run.code == 0 else ()
            return Result(self.worker, run.code, seconds, files, run.stderr)
        finally:
            shutil.rmtree(output, ignore_errors=True)

    def close(self) -> None:
        """Ends what runs, and removes what was copied."""
        self.runner.stop()
        shutil.rmtree(self.folder, ignore_errors=True)


def _contents(folder: str) -> List[Tuple[str, bytes]]:
    found = []
    for parent, _, names in os.walk(folder):
        for name in names:
            path = os.path.join(parent, name)
            with open(path, "rb") as file:
                found.append((posixpath.normpath(os.path.relpath(path, folder)), file.read()))
    return sorted(found)


def cpu_count() -> int:
    """How many CPUs this process may use; by Dask, which knows of containers' limits."""
    try:
        from dask.system import CPU_COUNT
    except ImportError:
        return os.cpu_count() or 1
    return CPU_COUNT


_task_runners: Dict[str, TaskRunner] = {}
_task_runners_lock = threading.Lock()


def _greet(job: Job, worker: str, scratch: str) -> Greeting:
    with _task_runners_lock:
        task_runner = _task_runners.get(job.name)
        if task_runner is None:
            task_runner = _task_runners[job.name] = TaskRunner(job, worker, scratch)
    return task_runner.greet()


async def greet(job: Job, dask_worker=None) -> Greeting:
    """Makes this worker's task_runner, unless it has one, and says how it stands."""
    scratch = os.path.join(dask_worker.local_directory, "raylane-farm")
    return await asyncio.get_running_loop().run_in_executor(
        None, _greet, job, str(dask_worker.name), scratch
    )


def use_threads(name: str, count: int) -> None:
    """Sets the threads of each program that this worker runs."""
    _task_runners[name].thread_count = count


def receive(name: str, digest: str, offset: int, is_last: bool, piece: bytes) -> bool:
    """Task: adds a piece to a blob of this worker's cache; see `TaskRunner.receive`."""
    return _task_runners[name].receive(digest, offset, is_last, piece)


def render(name: str, arguments: Sequence[str]) -> Result:
    """Task: runs the program; see `TaskRunner.render`."""
    return _task_runners[name].render(arguments)


def leave(name: str) -> None:
    """Ends this worker's part in a job, whatever of it runs."""
    task_runner = _task_runners.pop(name, None)
    if task_runner is not None:
        task_runner.close()
