"""What there is to do, cut into tasks: batches of frames, or tiles of pictures.

Both kinds of work hand out tasks until none is left, take their results in any order, and write
the pictures under the names that one machine would give them.
"""

from __future__ import annotations

import dataclasses
import os
from typing import Any, Dict, List, Optional, Protocol, Sequence, Tuple

from . import output, ranges, template
from .errors import FarmError
from .plan import Pace
from .remote import program
from .scene import Scene

@dataclasses.dataclass(frozen=True)
class Task:
    """One run of the program."""

    arguments: Tuple[str, ...]
    # What is in it: frames, or one tile.
    units: Tuple[Any, ...]


class Work(Protocol):
    """Tasks, and what becomes of their results."""

    # What is counted, and how many there are.
    unit: str
    total: int

    def next(self, slots: int) -> Optional[Task]:
        """A task, where `slots` run at the same time; None: none for now."""

    def is_done(self) -> bool:
        """Whether there is nothing left to hand out or to wait for."""

    def take(self, task: Task, result: Any) -> None:
        """Writes what a task gives."""

    def give_back(self, task: Task) -> None:
        """A task has to be done again."""


@dataclasses.dataclass(frozen=True)
class Pictures:
    """What is to be rendered of a scene, and how it is called."""

    # Ascending; None: one moment.
    frames: Optional[Sequence[int]]
    # Around the scene, from 0 on; None: one view.
    view_count: Optional[int]
    pattern: str
    skip_existing: bool

    def name(self, scene: Scene, frame: Optional[int], view: Optional[int]) -> str:
        """Of one picture."""
        return template.expand(self.pattern, scene.model, frame, view)

    def is_there(self, scene: Scene, frames: Sequence[Any], views: Sequence[Any]) -> bool:
        """Whether all of these are to be skipped."""
        return self.skip_existing and all(
            os.path.exists(self.name(scene, frame, view)) for frame in frames for view in views
        )

    def arguments(self) -> List[str]:
        """What the program has to know whichever part it renders."""
        words = []
        if self.frames is not None:
            words += ["--reference-frame", str(self.frames[0])]
        if self.view_count is not None:
            words += ["--turntable", str(self.view_count)]
        return words

    def moments(self) -> Sequence[Any]:
        """The frames, or None alone."""
        return [None] if self.frames is None else self.frames

    def views(self) -> Sequence[Any]:
        """The views, or None alone."""
        return [None] if self.view_count is None else range(self.view_count)


class BatchWork:
    """Frames, or views of one moment, in batches, each of which is one run of the program."""

    def __init__(self, scene: Scene, pictures: Pictures) -> None:
        self._scene = scene
        self._pictures = pictures
        self._folder, self._rest = template.split(pictures.pattern)
        moments, views = pictures.moments(), pictures.views()
        if pictures.frames is not None:
            self.unit, self._option = "frames", "--frames"
            left = [n for n in moments if not pictures.is_there(scene, [n], views)]
        else:
            self.unit, self._option = "views", "--views"
            left = [n for n in views if not pictures.is_there(scene, moments, [n])]
        self._left: List[int] = left
        self.total = len(left)
        self._out_count = 0
        self._pace = Pace()

    def next(self, slots: int) -> Optional[Task]:
        """The next batch. Until the first is done, each is of one."""
        if not self._left or (not self._pace.is_known() and self._out_count >= slots):
            return None
        count = self._pace.batch(len(self._left), slots)
        batch, self._left = self._left[:count], self._left[count:]
        self._out_count += 1
        return Task(
            (
                self._scene.argument,
                *self._scene.options,
                *self._pictures.arguments(),
                self._option,
                ranges.write(batch),
                *("--stats", "none", "-o", self._rest),
            ),
            tuple(batch),
        )

    def is_done(self) -> bool:
        """Whether all pictures are written."""
        return not self._left and self._out_count == 0

    def take(self, task: Task, result: Any) -> None:
        """Writes a batch."""
        self._out_count -= 1
        self._pace.add(result.worker, len(task.units), result.seconds)
        if not result.files:
            raise FarmError(f"{self._scene.name}: the program gave no pictures")
        for path, contents in result.files:
            output.write(os.path.join(self._folder, path), contents)

    def give_back(self, task: Task) -> None:
        """Puts what a task has in front again."""
        self._out_count -= 1
        self._left = sorted([*task.units, *self._left])


class TileWork:
    """Interleaved tiles of each picture, which `raylane merge` joins. Parts wait in `folder`."""

    unit = "tiles"

    def __init__(
        self, scene: Scene, pictures: Pictures, count: int, runner: program.Runner, folder: str
    ) -> None:
        self._scene = scene
        self._pictures = pictures
        self._count = count
        self._runner = runner
        wanted = [
            (frame, view)
            for frame in pictures.moments()
            for view in pictures.views()
            if not pictures.is_there(scene, [frame], [view])
        ]
        self._left = [(picture, tile) for picture in wanted for tile in range(1, count + 1)]
        self.total = len(self._left)
        self._out_count = 0
        self._folder = folder
        self._parts: Dict[Any, Dict[int, str]] = {picture: {} for picture in wanted}

    def next(self, slots: int) -> Optional[Task]:
        """The next tile."""
        if not self._left:
            return None
        (frame, view), tile = unit = self._left.pop(0)
        self._out_count += 1
        arguments = [self._scene.argument, *self._scene.options, *self._pictures.arguments()]
        if frame is not None:
            arguments += ["--frames", str(frame)]
        if view is not None:
            arguments += ["--views", str(view)]
        arguments += ["--tile", f"{tile}/{self._count}", "--stats", "none", "-o", "part.exr"]
        return Task(tuple(arguments), (unit,))

    def is_done(self) -> bool:
        """Whether all pictures are written."""
        return not self._left and self._out_count == 0

    def take(self, task: Task, result: Any) -> None:
        """Keeps a part, and merges the picture whose last one it is."""
        self._out_count -= 1
        picture, tile = task.units[0]
        if len(result.files) != 1:
            raise FarmError(f"{self._scene.name}: the program gave no part {tile}/{self._count}")
        parts = self._parts[picture]
        path = os.path.join(self._folder, f"{picture[0]}-{picture[1]}-{tile}.exr")
        output.write(path, result.files[0][1])
        parts[tile] = path
        if len(parts) < self._count:
            return
        self._merge(self._pictures.name(self._scene, *picture), [parts[n] for n in sorted(parts)])
        for part in self._parts.pop(picture).values():
            os.unlink(part)

    def _merge(self, name: str, parts: List[str]) -> None:
        folder = os.path.dirname(name)
        try:
            os.makedirs(folder or ".", exist_ok=True)
        except OSError as error:
            raise FarmError(f"{folder}: cannot be made: {error.strerror}") from None
        run = self._runner.run(["merge", "-o", name, *parts])
        if run.code != 0:
            raise FarmError(program.reason(run), run.code)

    def give_back(self, task: Task) -> None:
        """Puts a tile in front again."""
        self._out_count -= 1
        self._left[:0] = task.units
