"""The cluster: that of a scheduler which is running, or one of processes on this machine."""

from __future__ import annotations

import contextlib
import logging
import os
import socket
import subprocess
import sys
import tempfile
from typing import Iterator, Optional
from urllib.parse import urlsplit

from distributed import Client

from .errors import USAGE, FarmError

CONNECT_S = 15
CLOSE_S = 10


@contextlib.contextmanager
def connect(scheduler: Optional[str], workers: Optional[int]) -> Iterator[Client]:
    """A client; a local cluster ends with it."""
    # Dask reports each lost worker at length; what matters of it is said here.
    for name in ("distributed", "distributed.client", "tornado.application"):
        logging.getLogger(name).setLevel(logging.CRITICAL)
    with contextlib.ExitStack() as stack:
        address = scheduler or stack.enter_context(_local(workers or 1))
        _knock(address)
        try:
            client = Client(address, timeout=CONNECT_S, set_as_default=False)
        except (OSError, ValueError) as error:
            raise FarmError(f"{address}: does not answer as a scheduler: {error}") from None
        yield stack.enter_context(client)


@contextlib.contextmanager
def _local(workers: int) -> Iterator[str]:
    """The address of a cluster in a process of its own; see local.py."""
    package = os.path.dirname(os.path.abspath(__file__))
    with tempfile.TemporaryFile() as said, subprocess.Popen(
        [sys.executable, "-m", "raylane_farm.local", str(workers)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=said,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(
            [os.path.dirname(package), *filter(None, [os.environ.get("PYTHONPATH")])]
        )},
        start_new_session=True,
    ) as process:
        assert process.stdin is not None and process.stdout is not None
        try:
            address = process.stdout.readline().decode().strip()
            if not address:
                said.seek(0)
                lines = said.read().decode("utf-8", "replace").splitlines() or ["no reason given"]
                raise FarmError(f"no local cluster: {lines[-1]}")
            yield address
        finally:
            process.stdin.close()
            try:
                process.wait(CLOSE_S)
            except subprocess.TimeoutExpired:
                process.kill()


def _knock(scheduler: str) -> None:
    """Says at once that nobody is there, where Dask tries for long."""
    try:
        url = urlsplit(scheduler)
        host, port = url.hostname, url.port
    except ValueError:
        host = port = None
    if not host or not port:
        raise FarmError(f"--scheduler: '{scheduler}' is not like tcp://10.0.0.5:8786", USAGE)
    try:
        socket.create_connection((host, port), CONNECT_S).close()
    except OSError as error:
        why = error.strerror or str(error)
        raise FarmError(f"--scheduler {scheduler}: cannot be reached: {why}") from None
