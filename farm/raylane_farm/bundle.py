"""Sends the code that runs on workers: the folder `remote`, zipped, for Dask's UploadFile.

The package in it is named by its contents, so that workers that serve several versions of this
package, at the same time or one after the other, have each of them.
"""

from __future__ import annotations

import contextlib
import hashlib
import importlib
import os
import sys
import zipfile
from types import ModuleType
from typing import Iterator, List, Tuple

from distributed import Client
from distributed.diagnostics.plugin import SchedulerUploadFile, UploadFile

from .errors import FarmError

FOLDER = os.path.join(os.path.dirname(os.path.abspath(__file__)), "remote")
# Zip files begin here; the same sources are the same bytes.
EPOCH = (1980, 1, 1, 0, 0, 0)


def write(folder: str) -> Tuple[str, str]:
    """Makes the zip in `folder`; its path, and the name of the package."""
    sources: List[Tuple[str, bytes]] = []
    state = hashlib.sha256()
    for name in sorted(os.listdir(FOLDER)):
        if not name.endswith(".py"):
            continue
        with open(os.path.join(FOLDER, name), "rb") as file:
            sources.append((name, file.read()))
        state.update(repr(sources[-1]).encode())
    package = f"raylane_farm_remote_{state.hexdigest()[:16]}"
    path = os.path.join(folder, package + ".zip")
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as bundle:
        for name, contents in sources:
            bundle.writestr(zipfile.ZipInfo(f"{package}/{name}", EPOCH), contents)
    return path, package


@contextlib.contextmanager
def on_workers(client: Client, folder: str, name: str) -> Iterator[ModuleType]:
    """The package's `task_runner`, on the scheduler, which looks into tasks, and on all workers
    that are there or come; `name` is the job's."""
    path, package = write(folder)
    plugin = f"raylane-farm-{name}"
    try:
        client.register_plugin(SchedulerUploadFile(path), name=plugin)
        client.register_plugin(UploadFile(path), name=plugin)
    except Exception as error:  # pylint: disable=broad-except
        raise FarmError(f"the cluster does not take the code: {error}") from None
    sys.path.insert(0, path)
    importlib.invalidate_caches()
    try:
        yield importlib.import_module(package + ".task_runner")
    finally:
        sys.path.remove(path)
        # Where the cluster is lost there is nothing to tidy up.
        with contextlib.suppress(Exception):
            client.unregister_worker_plugin(plugin)
            client.unregister_scheduler_plugin(plugin)
