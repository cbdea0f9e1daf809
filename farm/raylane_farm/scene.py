"""Finds all files of a scene, and where their copies go.

Which they are, the program says: `raylane info --json` lists what it read. Their places to each
other are kept, so that the scene's own names lead to the copies; where names lead out of the
scene's folder (`--allow-outside`), the scene lies as deep below the job's folder.
"""

from __future__ import annotations

import dataclasses
import json
import os
import posixpath
from typing import Dict, List, Sequence, Tuple

from . import template
from .errors import FAILED, FarmError
from .options import Options
from .remote import program
from .remote.cache import digest_of
from .remote.task_runner import ROOT, File

BUILTIN = "builtin:"


@dataclasses.dataclass(frozen=True)
class Scene:
    """A scene with all that its pictures are made from."""

    # As the user names it.
    name: str
    # What `{model}` stands for.
    model: str
    # As workers name it: below ROOT, or builtin.
    argument: str
    # The program's options, with files below ROOT.
    options: Tuple[str, ...]
    files: Tuple[File, ...]
    folders: Tuple[str, ...]
    # By digest, where the client has it.
    sources: Dict[str, str]
    byte_count: int


def find(path: str, options: Options, pattern: str, runner: program.Runner) -> Scene:
    """Asks the program what the scene is made of, for pictures by the names of `pattern`.

    Raises `FarmError` as the program does.
    """
    if path == "-":
        raise FarmError("standard input cannot be sent to workers: name a file", 2)
    found = _ask(path, options.load, runner)
    listed = dict.fromkeys(found.files)
    if "material_variant" in template.fields(pattern):
        for index in range(found.variant_count):
            own = [*options.load, "--material-variant", str(index)]
            listed.update(dict.fromkeys(_ask(path, own, runner).files))
    depth = max((_ups(name) for name in listed), default=0)
    base = posixpath.join("scene", *["folder"] * depth)
    collected = _Collection()
    for name in listed:
        if posixpath.isabs(name):
            raise FarmError(f"{path}: names {name} by an absolute path, which workers may not have")
        collected.add(os.path.join(os.path.dirname(path), name), base, name)
    words = list(options.words)
    for number, (index, before, source) in enumerate(options.files):
        folder = f"options/{number}"
        name = os.path.basename(source)
        collected.add(source, folder, name)
        words[index] = f"{before}{ROOT}/{folder}/{name}"
    is_builtin = path.startswith(BUILTIN)
    file_name = path[len(BUILTIN):] if is_builtin else os.path.basename(path)
    return Scene(
        name=path,
        model=file_name if is_builtin else _stem(file_name),
        argument=path if is_builtin else f"{ROOT}/{base}/{file_name}",
        options=tuple(words),
        files=tuple(collected.files),
        folders=tuple(collected.folders),
        sources=collected.sources,
        byte_count=collected.byte_count,
    )


def _stem(name: str) -> str:
    stem = name[:-3] if name.lower().endswith(".gz") else name
    return os.path.splitext(stem)[0] or stem


@dataclasses.dataclass(frozen=True)
class _Answer:
    """What the program says of a scene."""

    files: Sequence[str]
    variant_count: int


def _ask(path: str, words: Sequence[str], runner: program.Runner) -> _Answer:
    run = runner.run(["info", "--json", "-q", *words, "--", path])
    if run.code != 0:
        raise FarmError(program.reason(run), run.code)
    found = json.loads(run.stdout)
    if "files" not in found:
        raise FarmError(f"raylane {found.get('version')} is too old: its info has no list of files")
    files = [entry["path"] for entry in found["files"]]
    return _Answer(files, len(found.get("material_variants", ())))


def _ups(path: str) -> int:
    """How many folders above its start a path reaches."""
    depth = least = 0
    for part in path.split("/"):
        if part == "..":
            depth -= 1
        elif part not in ("", "."):
            depth += 1
        least = min(least, depth)
    return -least


class _Collection:
    """Files with their digests, each place once."""

    def __init__(self) -> None:
        self.files: List[File] = []
        self.folders: Dict[str, None] = {}
        self.sources: Dict[str, str] = {}
        self.byte_count = 0
        self._places: Dict[str, str] = {}

    def add(self, source: str, base: str, name: str) -> None:
        """Takes the file at `source`, which is called `name` from `base`."""
        # A name such as a/../b needs the folder a.
        parts: Sequence[str] = name.split("/")[:-1]
        for count in range(len(parts) + 1):
            self.folders[posixpath.normpath(posixpath.join(base, *parts[:count]))] = None
        place = posixpath.normpath(posixpath.join(base, name))
        if place in self._places:
            return
        try:
            digest = digest_of(source)
            self.byte_count += os.path.getsize(source)
        except OSError as error:
            raise FarmError(f"{source}: cannot be read: {error.strerror}", FAILED) from None
        self._places[place] = digest
        self.sources.setdefault(digest, source)
        self.files.append(File(place, digest))
