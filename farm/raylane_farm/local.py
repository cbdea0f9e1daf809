"""`python -m raylane_farm.local N`: a cluster of processes on this machine.

It prints its scheduler's address and ends when standard input does, so with whoever started it. In
a session of its own, a terminal's Ctrl-C does not reach it: that is the client's to handle.
"""

from __future__ import annotations

import logging
import sys

import dask
from distributed import LocalCluster


def main(worker_count: int) -> None:
    """Runs the cluster until standard input ends."""
    # It samples what Python does a hundred times a second, beside programs that need the CPUs.
    dask.config.set({"distributed.worker.profile.enabled": False})
    with LocalCluster(
        n_workers=worker_count,
        threads_per_worker=1,
        processes=True,
        dashboard_address=None,
        # The programs' memory is not the workers'.
        memory_limit=0,
        silence_logs=logging.CRITICAL,
    ) as cluster:
        print(cluster.scheduler_address, flush=True)
        sys.stdin.read()


if __name__ == "__main__":
    main(int(sys.argv[1]))
