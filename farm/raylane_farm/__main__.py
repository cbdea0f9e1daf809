"""`python -m raylane_farm`: the steps of a job, and how they end."""

from __future__ import annotations

import contextlib
import secrets
import signal
import sys
import tempfile
from typing import Any, Dict, Sequence

from . import command_line, scene, work
from .errors import FarmError
from .progress import Progress, duration, plural
from .remote import program


class _Signalled(BaseException):
    def __init__(self, number: int) -> None:
        super().__init__()
        self.number = number


def main(arguments: Sequence[str]) -> int:
    """Does what the arguments say; the exit code."""
    signal.signal(signal.SIGINT, _raise_signal)
    signal.signal(signal.SIGTERM, _raise_signal)
    state: Dict[str, Any] = {}
    try:
        _run(command_line.read(arguments), state)
        return 0
    except FarmError as error:
        text = str(error)
        _say(state, text if text.startswith("raylane: ") else f"raylane_farm: {text}")
        return error.code
    except _Signalled as end:
        _say(state, f"raylane_farm: ended by {signal.Signals(end.number).name}{_kept(state)}")
        return 128 + end.number


def _run(line: command_line.CommandLine, state: Dict[str, Any]) -> None:
    try:
        identity = program.identity()
    except program.ProgramMissing as error:
        raise FarmError(f"{error}: raylane is needed here, too") from None
    runner = program.Runner()
    found = scene.find(line.scene, line.options, line.pattern, runner)
    pictures = work.Pictures(line.frames, line.turntable, line.pattern, line.skip_existing)
    with tempfile.TemporaryDirectory(prefix="raylane-farm-") as folder:
        job_work: work.Work
        if line.tiles is None:
            job_work = work.BatchWork(found, pictures)
        else:
            job_work = work.TileWork(found, pictures, line.tiles, runner, folder)
        progress = Progress(line.progress, job_work.unit, job_work.total)
        state["progress"] = progress
        if job_work.total > 0:
            is_quiet = line.quiet or line.options.is_quiet
            _run_on_cluster(line, found, identity, job_work, progress, is_quiet, folder)


def _run_on_cluster(
    line: command_line.CommandLine,
    found: scene.Scene,
    identity: program.Identity,
    job_work: work.Work,
    progress: Progress,
    is_quiet: bool,
    folder: str,
) -> None:
    # Here, for Dask takes a second to import, which errors above need not wait for.
    try:
        from . import bundle, cluster, worker_pool, farm
    except ImportError as error:
        raise FarmError(f"needs Dask, by pip install distributed: {error}") from None
    name = secrets.token_hex(6)
    with contextlib.ExitStack() as stack:
        client = stack.enter_context(cluster.connect(line.scheduler, line.workers))
        task_runner = stack.enter_context(bundle.on_workers(client, folder, name))
        job = task_runner.Job(
            name=name,
            identity=task_runner.Identity(identity.version, identity.picture),
            files=tuple(task_runner.File(file.path, file.digest) for file in found.files),
            folders=found.folders,
            cache_bytes=line.cache_bytes,
        )
        progress.begin()
        members = worker_pool.WorkerPool(client, task_runner, job, found.sources, progress.say)
        leader = farm.Farm(client, task_runner, name, members, job_work, found, progress, is_quiet)
        stack.callback(leader.stop)
        try:
            leader.run(line.patience_s)
        except FarmError:
            raise
        except Exception as error:  # pylint: disable=broad-except
            # Of Dask's many: the scheduler has gone, say.
            raise FarmError(f"the cluster is lost: {type(error).__name__}: {error}") from error
        if not line.quiet:
            progress.say(
                f"{progress.done} {progress.unit} in {duration(progress.seconds())}: "
                f"{plural(leader.run_count, 'run')} on {plural(len(leader.workers), 'worker')}"
            )


def _raise_signal(number: int, _frame: Any) -> None:
    # The second one ends at once.
    signal.signal(number, signal.SIG_DFL)
    raise _Signalled(number)


def _say(state: Dict[str, Any], text: str) -> None:
    if "progress" in state:
        state["progress"].say(text)
    else:
        print(text, file=sys.stderr)


def _kept(state: Dict[str, Any]) -> str:
    progress = state.get("progress")
    if progress is None:
        return ""
    return f": {progress.done} of {progress.total} {progress.unit} are done"


def console() -> None:
    """The command `raylane-farm`."""
    sys.exit(main(sys.argv[1:]))


if __name__ == "__main__":
    console()
