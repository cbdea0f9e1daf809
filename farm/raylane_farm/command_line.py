"""The command line: what is to be rendered, where, and what is handed on to the program."""

from __future__ import annotations

import argparse
import dataclasses
import re
from typing import List, Optional, Sequence

from . import __version__, options, ranges, template
from .errors import USAGE, FarmError

DESCRIPTION = """\
Spreads frames, or tiles of a picture, over the workers of a Dask cluster, and writes the same bytes
as one machine. Workers need `raylane` and `distributed`; the scene and all files that it names are
sent to them.
"""
EPILOG = """\
examples:
  python -m raylane_farm fox.glb --frames 1-240 --workers 2 -o 'out/{frame:4}.png' -- --fps 30
  python -m raylane_farm fox.glb --frames 1-240 --scheduler tcp://10.0.0.5:8786 -- -r 1280x720
  python -m raylane_farm hall.glb --tiles 16 --scheduler tcp://10.0.0.5:8786 -o hall.png -- -r 8192

exit status: 0 done, 1 files, memory or cluster, 2 usage, 3 scene invalid or not supported,
128 + N ended by signal N (pictures that are finished are there)
"""
_SIZE = re.compile(r"([0-9]+)([KMGT]?)")


@dataclasses.dataclass(frozen=True)
class CommandLine:
    """What the user wants."""

    scene: str
    frames: Optional[List[int]]
    turntable: Optional[int]
    tiles: Optional[int]
    # What pictures are called.
    pattern: str
    scheduler: Optional[str]
    workers: Optional[int]
    skip_existing: bool
    progress: str
    quiet: bool
    cache_bytes: int
    patience_s: float
    # For the program.
    options: options.Options


class _Parser(argparse.ArgumentParser):
    def error(self, message: str):
        raise FarmError(message, USAGE)


def read(arguments: Sequence[str]) -> CommandLine:
    """Reads arguments; what follows -- is the program's. Raises `FarmError`."""
    own = list(arguments)
    handed: List[str] = []
    if "--" in own:
        place = own.index("--")
        own, handed = own[:place], own[place + 1 :]
    found = _parser().parse_args(own)
    if found.frames is None and found.turntable is None and found.tiles is None:
        raise FarmError(
            "what to spread? --frames 1-240, --turntable 120, or --tiles 16 of a big picture", USAGE
        )
    frames = None if found.frames is None else ranges.parse(found.frames)
    for_program = options.read(handed)
    extension = for_program.format or "png"
    has_views = found.turntable is not None
    pattern = template.of(found.output, extension, frames is not None, has_views)
    for name, count in (("frame", len(frames or ())), ("view", found.turntable or 0)):
        if count > 1 and name not in template.fields(pattern):
            raise FarmError(f"-o {pattern}: {count} {name}s need {{{name}}} in the name", USAGE)
    if found.scheduler is not None and found.workers is not None:
        raise FarmError("--workers is for a local cluster; that of --scheduler has its own", USAGE)
    return CommandLine(
        scene=found.scene,
        frames=frames,
        turntable=found.turntable,
        tiles=found.tiles,
        pattern=pattern,
        scheduler=found.scheduler,
        workers=found.workers,
        skip_existing=found.skip_existing,
        progress=found.progress or ("none" if found.quiet else "auto"),
        quiet=found.quiet,
        cache_bytes=found.cache_size,
        patience_s=found.worker_timeout,
        options=for_program,
    )


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(
        prog="python -m raylane_farm",
        usage="python -m raylane_farm SCENE (--frames RANGE | --turntable N | --tiles N)\n"
        "                              [options] [-- raylane options]",
        description=DESCRIPTION,
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    add = parser.add_argument
    add("scene", metavar="SCENE", help="a file that raylane reads, or builtin:NAME")
    add("--frames", metavar="RANGE", help="frames, such as 1-10,12,20-40:2")
    add("--turntable", metavar="N", type=_count, help="views all around, as raylane's")
    add("--tiles", metavar="N", type=_count, help="interleaved parts of each picture")
    add(
        "-o",
        "--output",
        metavar="TEMPLATE",
        help="as raylane -o: {model}, {frame:4}, ...; a file with --tiles alone, or a folder/",
    )
    add("--scheduler", metavar="ADDRESS", help="tcp://HOST:PORT of Dask (default: a local cluster)")
    add("--workers", metavar="N", type=_count, help="of the local cluster (default: 1)")
    add("--skip-existing", action="store_true", help="leave pictures that are there: goes on")
    add(
        "--progress",
        choices=("auto", "json", "none"),
        help="a line on a terminal, lines of JSON on stderr, or nothing",
    )
    add("-q", "--quiet", action="store_true", help="no progress, no summary; errors and refusals")
    add(
        "--cache-size",
        metavar="SIZE",
        type=_size,
        default=4 << 30,
        help="of what workers keep of scenes, 500M or 4G (default: 4G)",
    )
    add(
        "--worker-timeout",
        metavar="S",
        type=_seconds,
        default=60.0,
        help="seconds without any worker before giving up (default: 60)",
    )
    add("--version", action="version", version=f"raylane_farm {__version__}")
    return parser


def _count(text: str) -> int:
    if not text.isdigit() or not 1 <= int(text) <= 4096:
        raise argparse.ArgumentTypeError(f"'{text}' is no number from 1 to 4096")
    return int(text)


def _size(text: str) -> int:
    match = _SIZE.fullmatch(text)
    if match is None:
        raise argparse.ArgumentTypeError(f"'{text}' is no size such as 500M or 4G")
    return int(match[1]) << {"": 0, "K": 10, "M": 20, "G": 30, "T": 40}[match[2]]


def _seconds(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = -1.0
    if not 0 < value < 1e9:
        raise argparse.ArgumentTypeError(f"'{text}' is no number of seconds")
    return value
