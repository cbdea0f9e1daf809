"""What a job has to know of the options that it hands on to `raylane`.

Most are the program's business alone. A few say which files are read, and those are sent along; a
few are for one program on one machine, or are this package's own, and are refused with a word on
what to do instead.
"""

from __future__ import annotations

import dataclasses
from typing import Iterator, List, Optional, Sequence, Tuple

from .errors import USAGE, FarmError

# Options that decide what is read; `raylane info` has the same.
LOAD_VALUES = {"--scene", "--material-variant", "--up-axis", "--format-in"}
LOAD_FLAGS = {"--allow-outside"}
# Options whose value is a file, unless it is one of these words.
FILE_VALUES = {"--env": ("studio", "none")}
# Names of other programs that the program understands, of the options here.
ALSO = {
    "--hdri": "--env",
    "--hdri-file": "--env",
    "--environment": "--env",
    "--variant-name": "--material-variant",
    "--outfile": "--output",
    "--output-file": "--output",
    "--license": "--licenses",
    "--licence": "--licenses",
}
SHORTS_WITH_VALUE = {"o": "--output", "r": "--resolution", "t": "--threads"}
SHORTS = {"V": "--version", "q": "--quiet", "v": "--verbose", "h": "--help"}

_OWN = "stands before -- with raylane_farm"
_ALONE = "is for one program on one machine"
REFUSED = {
    "--output": _OWN,
    "--frames": _OWN,
    "--reference-frame": "is the first of --frames",
    "--turntable": _OWN,
    "--views": "are those of --turntable before -- with raylane_farm",
    "--tile": "is --tiles N before -- with raylane_farm",
    "--skip-existing": _OWN,
    "--progress": _OWN,
    "--progress-fd": _ALONE,
    "--progress-image": _ALONE,
    "--partial": _ALONE,
    "--jobs": _ALONE,
    "--stats": _ALONE,
    "--scenario": _ALONE,
    "--time-budget": "gives each machine another picture; --spp or --noise give the same",
    "--help": "has no picture",
    "--version": "has no picture",
    "--licenses": "has no picture",
    "--list-variants": "has no picture",
}


@dataclasses.dataclass
class Options:
    """Options for the program, and what follows from them."""

    words: List[str]
    # Those that `raylane info` has, too.
    load: List[str] = dataclasses.field(default_factory=list)
    # Index of the word, text before the path in it, and the path.
    files: List[Tuple[int, str, str]] = dataclasses.field(default_factory=list)
    is_quiet: bool = False
    # Of the files; None: as their names say.
    format: Optional[str] = None


def read(words: Sequence[str]) -> Options:
    """Looks through the options after `--`. Raises `FarmError` for those that cannot be."""
    options = Options(list(words))
    for name, index, value in _flags(options.words):
        if name in REFUSED:
            raise FarmError(f"{name} {REFUSED[name]}", USAGE)
        if name == "--quiet":
            options.is_quiet = True
        elif name == "--format":
            options.format = value
        elif name in LOAD_FLAGS:
            options.load.append(name)
        elif name in LOAD_VALUES and value is not None:
            options.load += [name, value]
        elif name in FILE_VALUES and value is not None and value not in FILE_VALUES[name]:
            word = options.words[index]
            options.files.append((index, word[: len(word) - len(value)], value))
    if options.format == "y4m":
        raise FarmError("y4m is one stream: render pictures, and join them where they are", USAGE)
    return options


def _flags(words: Sequence[str]) -> Iterator[Tuple[str, int, Optional[str]]]:
    """Each flag by its long name, the index of the word that has its value, and the value."""
    index = 0
    while index < len(words):
        word = words[index]
        following = words[index + 1] if index + 1 < len(words) else None
        if word.startswith("--"):
            name, equals, value = word.partition("=")
            name = ALSO.get(name, name)
            if equals:
                yield name, index, value
            else:
                yield name, index + 1, following
                index += name in LOAD_VALUES or name in FILE_VALUES
        elif word.startswith("-"):
            for place, letter in enumerate(word[1:], 2):
                if letter in SHORTS:
                    yield SHORTS[letter], index, None
                    continue
                if letter in SHORTS_WITH_VALUE:
                    yield SHORTS_WITH_VALUE[letter], index, word[place:] or following
                break
        index += 1
