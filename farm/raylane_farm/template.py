"""Names of pictures by a template, as `raylane -o` has them: `out/{model}_{frame:4}.png`.

Workers get the part of a template that has placeholders and return files under the names that the
program gives; the folder in front is the client's. What is not yet rendered has to be known
beforehand with `--skip-existing` and `--tiles`, by the placeholders that `expand` knows.
"""

from __future__ import annotations

import os
import re
from typing import Optional, Set, Tuple

from .errors import USAGE, FarmError

_PIECE = re.compile(r"\{\{|\}\}|\{([a-z_]*)(?::([1-9]))?\}|[{}]|[^{}]+")


def split(template: str) -> Tuple[str, str]:
    """The folder before the first part with a brace, and the rest."""
    head, brace, _ = template.partition("{")
    folder = os.path.dirname(head if brace else template)
    rest = template[len(folder):]
    return folder or ".", rest.lstrip("/")


def fields(template: str) -> Set[str]:
    """Names of the placeholders."""
    return {match[1] for match in _PIECE.finditer(template) if match[1] is not None}


def of(chosen: Optional[str], extension: str, has_frames: bool, has_views: bool) -> str:
    """The template where a file, a folder or nothing is chosen; as the program does."""
    if chosen is not None and not chosen.endswith("/"):
        return chosen
    frame = "_{frame:4}" if has_frames else ""
    view = "_{view:3}" if has_views else ""
    return f"{chosen or ''}{{model}}{frame}{view}.{extension}"


def expand(template: str, model: str, frame: Optional[int], view: Optional[int]) -> str:
    """The name of one picture. Raises `FarmError` for what only the program can tell."""
    numbers = {"frame": frame, "view": view}
    known = {"model", *(name for name, number in numbers.items() if number is not None)}
    unknown = fields(template) - known
    if unknown:
        names = ", ".join(f"{{{name}}}" for name in sorted(unknown))
        raise FarmError(f"-o {template}: {names} cannot be told beforehand", USAGE)
    made = []
    for match in _PIECE.finditer(template):
        if match[1] in numbers:
            made.append(f"{numbers[match[1]]:0{match[2] or 1}d}")
        elif match[1] == "model":
            made.append(part(model))
        elif match[0] in ("{{", "}}"):
            made.append(match[0][0])
        elif match[0] in "{}":
            raise FarmError(f"-o {template}: a brace that opens or closes nothing", USAGE)
        else:
            made.append(match[0])
    return "".join(made)


def part(name: str) -> str:
    """A name as a part of a path: no slash, nothing that a terminal obeys, no dot in front."""
    made = re.sub(r"[/\\?\x00-\x1f\x7f-\x9f]", "_", name) or "_"
    return "_" + made[1:] if made[0] == "." else made
