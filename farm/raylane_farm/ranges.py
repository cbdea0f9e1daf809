"""Ranges of numbers in the grammar of Open Job Description: `1-10,12,20-40:2`.

Its template schemas of 2023-09 have it as `IntRangeExpr` (section 3.4.1.1.1): values and ranges
START-END or START-END:STEP, in any order, none of which begins before another has ended.
"""

from __future__ import annotations

import re
from typing import List, Sequence, Tuple

from .errors import USAGE, FarmError

COUNT_MAX = 1_000_000
_NUMBER = r"[ \t]*(-?[0-9]+)[ \t]*"
_ELEMENT = re.compile(f"{_NUMBER}(?:-{_NUMBER}(?::{_NUMBER})?)?")


def parse(text: str) -> List[int]:
    """The frames of a range expression, ascending. Raises `FarmError`."""
    ranges: List[Tuple[int, int, range]] = []
    for element in text.split(","):
        match = _ELEMENT.fullmatch(element)
        if match is None or (match[3] is not None and int(match[3]) == 0):
            raise _error(text, "is not a range such as 1-10,12,20-40:2")
        first = int(match[1])
        last = first if match[2] is None else int(match[2])
        step = 1 if match[3] is None else int(match[3])
        # One that goes the other way is its first frame alone.
        values = range(first, last + (1 if step > 0 else -1), step) or range(first, first + 1)
        low, high = sorted((first, max(first, last) if step > 0 else min(first, last)))
        ranges.append((low, high, values))
    if sum(len(values) for _, _, values in ranges) > COUNT_MAX:
        raise _error(text, f"has more than {COUNT_MAX} numbers")
    ranges.sort(key=lambda entry: entry[0])
    if any(after[0] <= before[1] for before, after in zip(ranges, ranges[1:])):
        raise _error(text, "has ranges that overlap")
    return [frame for _, _, values in ranges for frame in sorted(values)]


def _error(text: str, reason: str) -> FarmError:
    return FarmError(f"--frames: '{text}' {reason}", USAGE)


def write(frames: Sequence[int]) -> str:
    """An expression for ascending frames, without ranges that overlap."""
    parts: List[str] = []
    start = 0
    while start < len(frames):
        end = start + 1
        step = frames[end] - frames[start] if end < len(frames) else 1
        while end < len(frames) and frames[end] - frames[end - 1] == step:
            end += 1
        if end - start == 2 and step > 1:
            end -= 1
        first, last = frames[start], frames[end - 1]
        if first == last:
            parts.append(str(first))
        else:
            parts.append(f"{first}-{last}" + (f":{step}" if step > 1 else ""))
        start = end
    return ",".join(parts)
