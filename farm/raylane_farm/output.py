"""Writes pictures as a whole or not at all: under a name of their own, then in their place."""

from __future__ import annotations

import os
import secrets

from .errors import FarmError


def write(path: str, contents: bytes) -> None:
    """Puts `contents` at `path`, making its folders; a file there is replaced, a link followed."""
    place = os.path.realpath(path)
    folder, name = os.path.split(place)
    temporary = os.path.join(folder, f".{name[:200]}.raylane-farm-{secrets.token_hex(6)}.tmp")
    try:
        os.makedirs(folder, exist_ok=True)
        if os.path.exists(place) and not os.access(place, os.W_OK):
            raise FarmError(f"{path}: is write-protected")
        try:
            with open(temporary, "xb") as file:
                file.write(contents)
            if os.path.exists(place):
                os.chmod(temporary, os.stat(place).st_mode & 0o7777)
            os.replace(temporary, place)
        except BaseException:
            try:
                os.unlink(temporary)
            except FileNotFoundError:
                pass
            raise
    except OSError as error:
        raise FarmError(f"{path}: cannot be written: {error.strerror}") from None
