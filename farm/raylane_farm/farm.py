"""Leads a job: hands tasks to Dask, a few for each worker ahead, and takes their results.

Dask moves the tasks of a lost worker to another one. What is left to do here: tasks that may only
go to workers that are all lost, programs that fail on one machine (out of memory, disk full) and
may not on another, and the end, by success, by the first error or by a signal.
"""

from __future__ import annotations

import contextlib
import queue
import time
from concurrent.futures import ThreadPoolExecutor
from typing import Any, Dict, Set, Tuple

from distributed import Client, Future
from distributed.scheduler import KilledWorker

from .worker_pool import WorkerPool
from .errors import FarmError
from .progress import Progress
from .remote.program import Run, reason
from .scene import Scene
from .work import Task, Work

# Tasks for each slot: one that runs, one that waits.
AHEAD = 2
# How often to look who is there.
TICK_S = 1.0
# How long the result of a task that is done may take to arrive.
RESULT_TIMEOUT_S = 120
FETCHER_COUNT = 8
# How often a task may fail for what may be its machine's fault.
TRIES = 3
# Exit codes that say so: files or memory, or ended by a signal.
MACHINE_CODES = (1, *range(129, 256))
# How the program marks what is odd but harmless; what else it says is its progress.
WARNING = " warning: "


class Farm:
    """One job on one cluster."""

    def __init__(
        self,
        client: Client,
        task_runner: Any,
        job_name: str,
        worker_pool: WorkerPool,
        work: Work,
        scene: Scene,
        progress: Progress,
        is_quiet: bool,
    ) -> None:
        self._client = client
        self._task_runner = task_runner
        self._job_name = job_name
        self._worker_pool = worker_pool
        self._work = work
        self._scene = scene
        self._progress = progress
        self._is_quiet = is_quiet
        self._events: "queue.SimpleQueue[Tuple[Future, Any]]" = queue.SimpleQueue()
        # That a result's worker is lost takes long to find out, which others need not wait for.
        self._fetchers = ThreadPoolExecutor(FETCHER_COUNT, thread_name_prefix="fetch")
        # By key: the task, and who may do it.
        self._pending: Dict[str, Tuple[Task, Future, Set[str]]] = {}
        self._failures: Dict[Tuple[Any, ...], int] = {}
        self._said: Set[str] = set()
        self._number = 0
        self.run_count = 0
        self.workers: Set[str] = set()

    def run(self, patience_s: float) -> None:
        """Does all of the work, or gives up when no worker is there for so long."""
        idle_since = time.monotonic()
        self._worker_pool.update(wait=True)
        next_look = time.monotonic() + TICK_S
        while not self._work.is_done():
            self._submit()
            try:
                self._finish(*self._events.get(timeout=TICK_S))
            except queue.Empty:
                pass
            now = time.monotonic()
            if now < next_look:
                continue
            next_look = now + TICK_S
            self._worker_pool.update()
            members = self._worker_pool.members()
            if members:
                idle_since = now
                self._progress.step(0, len(members))
            elif now - idle_since > patience_s:
                raise FarmError("; ".join(self._worker_pool.refusals()) or "no worker is there")
            self._rescue({member.address for member in members})

    def _submit(self) -> None:
        members = self._worker_pool.members()
        slots = sum(member.slots for member in members)
        while len(self._pending) < AHEAD * slots:
            task = self._work.next(slots)
            if task is None:
                return
            self._number += 1
            key = f"raylane-{self._job_name}-{self._number}"
            addresses = [member.address for member in members]
            future = self._client.submit(
                self._task_runner.render,
                self._job_name,
                task.arguments,
                key=key,
                workers=addresses,
                pure=False,
            )
            self._pending[key] = (task, future, set(addresses))
            future.add_done_callback(self._fetch_later)

    def _fetch_later(self, future: Future) -> None:
        with contextlib.suppress(RuntimeError):  # The job has ended.
            self._fetchers.submit(self._fetch, future)

    def _fetch(self, future: Future) -> None:
        result: Any
        try:
            result = future.result(timeout=RESULT_TIMEOUT_S)
        except Exception as error:  # pylint: disable=broad-except
            result = error
        self._events.put((future, result))

    def _finish(self, future: Future, result: Any) -> None:
        key = str(future.key)
        entry = self._pending.get(key)
        if entry is None or entry[1] is not future:
            return
        del self._pending[key]
        task = entry[0]
        if isinstance(result, KilledWorker):
            raise FarmError(f"{self._scene.name}: every worker that tried was lost: {result}")
        if isinstance(result, BaseException):
            # A worker's disk is full, or its result was lost on the way.
            self._fail(task, f"{type(result).__name__}: {result}", 1)
            return
        if result.code != 0:
            self._fail(task, self._reason(result), result.code)
            return
        if not self._is_quiet:
            self._repeat(result.stderr)
        self._work.take(task, result)
        self.run_count += 1
        self.workers.add(result.worker)
        self._progress.step(len(task.units), len(self._worker_pool.members()))

    def _fail(self, task: Task, why: str, code: int) -> None:
        count = self._failures[task.units] = self._failures.get(task.units, 0) + 1
        if code not in MACHINE_CODES or count == TRIES:
            raise FarmError(why, code if code in (1, 2, 3) else 1)
        self._work.give_back(task)

    def _reason(self, result: Any) -> str:
        text = self._own_names(reason(Run(result.code, b"", result.stderr)))
        if result.code in MACHINE_CODES:
            return f"{text} (on worker '{result.worker}')"
        return text

    def _repeat(self, stderr: str) -> None:
        """Prints the program's warnings, each once."""
        for line in self._own_names(stderr).splitlines():
            if WARNING in line and line not in self._said:
                self._said.add(line)
                self._progress.say(line)

    def _own_names(self, text: str) -> str:
        return text.replace(self._scene.argument, self._scene.name)

    def _rescue(self, alive: Set[str]) -> None:
        """Takes tasks back that no worker is left for."""
        if not alive:
            return
        for key, (task, future, addresses) in list(self._pending.items()):
            if addresses.isdisjoint(alive) and not future.done():
                del self._pending[key]
                future.cancel()
                self._work.give_back(task)

    def stop(self) -> None:
        """Cancels what is out, and ends what runs."""
        self._fetchers.shutdown(wait=False)
        futures = [future for _, future, _ in self._pending.values()]
        self._pending.clear()
        # Where the cluster is lost nothing of it is left to end.
        with contextlib.suppress(Exception):
            if futures:
                self._client.cancel(futures, force=True)
            self._client.run(self._task_runner.leave, self._job_name, on_error="ignore")
