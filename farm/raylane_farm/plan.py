"""How many frames make a batch: enough to be worth starting the program for.

A batch of n frames takes about `start + n * frame` seconds: the program starts, reads the scene
and builds its tree once, then renders. Both figures come from the batches that are done. No
batch is less than `BATCH_S` of rendering on the quickest worker, where there is so much; it is
more, so that starting is a small part, up to an equal share of what is left.
"""

from __future__ import annotations

import math
from typing import Dict, List, Tuple

# Work of a batch at least.
BATCH_S = 2.0
# Part of a batch that starting may be.
START_SHARE = 0.05
# What is kept of each worker.
KEPT = 32


class Pace:
    """What is known of the time that frames take."""

    def __init__(self) -> None:
        self._runs: Dict[str, List[Tuple[int, float]]] = {}

    def add(self, worker: str, count: int, seconds: float) -> None:
        """A batch is done."""
        runs = self._runs.setdefault(worker, [])
        runs.append((count, seconds))
        del runs[:-KEPT]

    def is_known(self) -> bool:
        """Whether any batch is done."""
        return bool(self._runs)

    def batch(self, left: int, slots: int) -> int:
        """Frames of the next batch, of `left`, where `slots` run at the same time."""
        if not self._runs:
            return min(1, left)
        start, frame = min((fit(runs) for runs in self._runs.values()), key=lambda pair: pair[1])
        seconds = max(BATCH_S, start / START_SHARE - start)
        worth = math.ceil(seconds / frame)
        least = math.ceil(BATCH_S / frame)
        count = max(least, min(worth, math.ceil(left / max(slots, 1))))
        # Nor is what is left behind less.
        return left if left - count < least else count


def fit(runs: List[Tuple[int, float]]) -> Tuple[float, float]:
    """Seconds to start and for a frame, by least squares; neither is negative, a frame takes time.

    Of batches that are all of one size it is not known how much is the start: none, so that
    batches become larger, and it shows.
    """
    count = len(runs)
    mean_n = sum(n for n, _ in runs) / count
    mean_s = sum(s for _, s in runs) / count
    spread = sum((n - mean_n) ** 2 for n, _ in runs)
    frame = sum((n - mean_n) * (s - mean_s) for n, s in runs) / spread if spread > 0 else 0.0
    if frame <= 0 or frame * mean_n > mean_s:
        return 0.0, max(mean_s / mean_n, 1e-6)
    return mean_s - frame * mean_n, max(frame, 1e-6)
