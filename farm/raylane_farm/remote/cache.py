"""Files by the SHA-256 of their contents, in a folder of bounded size.

Blobs are assembled under a name of their own, verified, and renamed to their digest, so that
several workers may share the folder. What is used least recently goes first; who needs a blob
takes a link to it, or a copy, which stays when the blob goes.
"""

from __future__ import annotations

import hashlib
import os
import secrets
import shutil
import time
from typing import List, Tuple

CHUNK = 1 << 20
# An unfinished blob that nobody has written to for so long is left behind.
STALE_S = 3600


class WrongContents(Exception):
    """What arrived is not what its digest says."""


def digest_of(path: str) -> str:
    """The SHA-256 of a file, in hexadecimal digits."""
    state = hashlib.sha256()
    with open(path, "rb") as file:
        while True:
            chunk = file.read(CHUNK)
            if not chunk:
                return state.hexdigest()
            state.update(chunk)


def default_folder() -> str:
    """RAYLANE_FARM_CACHE of the environment, or a folder in that of the user's caches."""
    named = os.environ.get("RAYLANE_FARM_CACHE")
    if named:
        return os.path.abspath(named)
    caches = os.environ.get("XDG_CACHE_HOME") or os.path.join(os.path.expanduser("~"), ".cache")
    return os.path.join(os.path.abspath(caches), "raylane-farm")


class Cache:
    """The folder, of `limit` bytes at most, what is being used besides."""

    def __init__(self, folder: str, limit: int) -> None:
        self.folder = folder
        self.limit = limit
        os.makedirs(folder, exist_ok=True)

    def place(self, digest: str) -> str:
        """Where a blob is, if it is there."""
        return os.path.join(self.folder, digest)

    def begin(self) -> str:
        """The path of a new blob, to be filled from its start and handed to `finish`."""
        return os.path.join(self.folder, f".{secrets.token_hex(8)}.part")

    def finish(self, part: str, digest: str) -> None:
        """Makes a filled file a blob. Raises `WrongContents`; then there is none."""
        try:
            if digest_of(part) != digest:
                raise WrongContents(digest)
            os.replace(part, self.place(digest))
        finally:
            remove(part)
        self._evict(digest)

    def take(self, digest: str, target: str) -> bool:
        """Puts a blob at `target`, verified; whether it was there."""
        place = self.place(digest)
        remove(target)
        try:
            try:
                os.link(place, target)
            except FileNotFoundError:
                return False
            except OSError:
                # Another file system, or one without links.
                shutil.copyfile(place, target)
            if digest_of(target) == digest:
                os.utime(place)
                return True
        except FileNotFoundError:
            pass  # Evicted meanwhile by another worker.
        else:
            remove(place)  # Damaged on the disk.
        remove(target)
        return False

    def _evict(self, newest: str) -> None:
        blobs: List[Tuple[float, int, str]] = []
        for entry in os.scandir(self.folder):
            try:
                stat = entry.stat()
            except FileNotFoundError:
                continue
            if not entry.name.startswith("."):
                blobs.append((stat.st_mtime, stat.st_size, entry.name))
            elif time.time() - stat.st_mtime > STALE_S:
                remove(entry.path)
        size = sum(blob[1] for blob in blobs)
        for _, blob_size, name in sorted(blobs):
            if size <= self.limit:
                return
            if name == newest:
                continue
            remove(self.place(name))
            size -= blob_size


def remove(path: str) -> None:
    """Removes a file, if it is there."""
    try:
        os.unlink(path)
    except FileNotFoundError:
        pass
