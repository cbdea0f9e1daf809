"""Says how far a job is: a line on a terminal, lines of JSON for programs, the count at the end."""

from __future__ import annotations

import json
import sys
import time
from typing import Optional, TextIO

INTERVAL_S = 0.2


class Progress:
    """Counts pictures or tiles; `form` is auto, json or none."""

    def __init__(self, form: str, unit: str, total: int, stream: Optional[TextIO] = None) -> None:
        self._stream = sys.stderr if stream is None else stream
        self._is_json = form == "json"
        self._is_line = form == "auto" and self._stream.isatty()
        self.unit = unit
        self.total = total
        self._start = time.monotonic()
        self._shown = 0.0
        self._width = 0
        self.done = 0

    def begin(self) -> None:
        """Time counts from here."""
        self._start = time.monotonic()

    def seconds(self) -> float:
        """Since the beginning."""
        return time.monotonic() - self._start

    def step(self, count: int, workers: int) -> None:
        """`count` more are done; `workers` take part."""
        self.done += count
        now = time.monotonic()
        if count == 0 and (now - self._shown < INTERVAL_S or self.done == self.total):
            return
        self._shown = now
        elapsed = self.seconds()
        left = elapsed * (self.total - self.done) / self.done if self.done else None
        if self._is_json:
            self._say(json.dumps({
                "done": self.done,
                "total": self.total,
                "unit": self.unit,
                "workers": workers,
                "seconds": round(elapsed, 3),
                "seconds_left": None if left is None else round(left, 3),
            }))
        elif self._is_line:
            rest = "" if left is None else f", {duration(left)} left"
            text = (
                f"{self.done} of {self.total} {self.unit}, "
                f"{100 * self.done // self.total} %, {plural(workers, 'worker')}{rest}"
            )
            self._stream.write("\r" + text.ljust(self._width))
            self._stream.flush()
            self._width = len(text)

    def say(self, text: str) -> None:
        """Prints a line of its own."""
        self.clear()
        self._say(text)

    def clear(self) -> None:
        """Removes the line of a terminal."""
        if self._width:
            self._stream.write("\r" + " " * self._width + "\r")
            self._stream.flush()
            self._width = 0

    def _say(self, text: str) -> None:
        self._stream.write(text + "\n")
        self._stream.flush()


def duration(seconds: float) -> str:
    """Seconds as people say them."""
    if seconds < 100:
        return f"{seconds:.1f} s"
    minutes = round(seconds / 60)
    return f"{minutes} min" if minutes < 100 else f"{minutes // 60} h {minutes % 60:02d} min"


def plural(count: int, noun: str) -> str:
    """`1 worker`, `2 workers`."""
    return f"{count} {noun}" if count == 1 else f"{count} {noun}s"
