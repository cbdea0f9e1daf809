"""Files that are damaged at random, in ways that their format makes likely to matter.

In: the bytes of a file, a random number generator. Out: other bytes. Of text, numbers become
others, lines and pieces in brackets are lost, doubled or exchanged; of a GLB, its JSON, with
lengths that fit; of everything else, bits, bytes, words and blocks, and the length. The same
generator gives the same bytes.
"""

import re
import struct

NUMBERS = [b"0", b"-1", b"1", b"2", b"255", b"256", b"65535", b"65536", b"2147483647",
           b"2147483648", b"4294967295", b"4294967296", b"9007199254740993",
           b"18446744073709551615", b"1e38", b"1e39", b"-1e38", b"1e-45", b"1e999", b"0.1", b"-0",
           b"nan", b"null", b"\"1\"", b"[]", b"{}", b"true"]
WORDS = [0, 1, 0x7F, 0x80, 0xFF, 0x7FFF, 0x8000, 0xFFFF, 0x10000, 0x7FFFFFFF, 0x80000000,
         0xFFFFFFFE, 0xFFFFFFFF, 0x7F800000, 0xFF800000, 0x7FC00000, 0x7F7FFFFF, 0x00000001]
NUMBER = re.compile(rb"-?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?")
PIECE = re.compile(rb"\{[^{}\[\]]*\}|\[[^\[\]{}]*\]|\"[^\"]{0,80}\"")


def mutate(data, rng):
    """Other bytes than these, by one to four changes."""
    changed = data
    for _ in range(rng.choice([1, 1, 1, 2, 2, 3, 4])):
        changed = _change(changed, rng)
    return changed if changed != data else data[:-1]


def _change(data, rng):
    if not data:
        return bytes([rng.randrange(256)])
    if data[:4] == b"glTF" and len(data) > 20 and rng.random() < 0.6:
        return _change_glb(data, rng)
    if _is_text(data) and rng.random() < 0.9:
        return _change_text(data, rng)
    return _change_bytes(data, rng)


def _is_text(data):
    head = data[:512]
    return sum(byte >= 32 or byte in b"\t\n\r" for byte in head) > 0.97 * len(head)


def _change_glb(data, rng):
    length = min(struct.unpack_from("<I", data, 12)[0], len(data) - 20)
    text = _change_text(data[20:20 + length], rng)
    text += b" " * (-len(text) % 4)
    rest = data[20 + length:]
    return struct.pack("<4sIIII", b"glTF", 2, 20 + len(text) + len(rest), len(text),
                       0x4E4F534A) + text + rest


def _change_text(data, rng):
    kind = rng.randrange(6)
    if kind < 3:
        return _replaced(data, NUMBER, rng, lambda old: _number(old, rng))
    if kind == 3:
        return _replaced(data, PIECE, rng, lambda old: rng.choice([b"", old + b"," + old, b"{}"]))
    if kind == 4:
        lines = data.split(b"\n")
        if len(lines) > 3:
            index = rng.randrange(len(lines))
            other = rng.randrange(len(lines))
            which = rng.randrange(3)
            if which == 0:
                del lines[index]
            elif which == 1:
                lines.insert(other, lines[index])
            else:
                lines[index], lines[other] = lines[other], lines[index]
            return b"\n".join(lines)
    return _change_bytes(data, rng)


def _replaced(data, pattern, rng, other):
    # The first that follows a random place, or else the first of all.
    found = pattern.search(data, rng.randrange(len(data))) or pattern.search(data)
    if found is None:
        return _change_bytes(data, rng)
    return data[:found.start()] + other(found[0]) + data[found.end():]


def _number(old, rng):
    kind = rng.randrange(4)
    if kind == 0 and old.isdigit():
        return str(int(old[:18]) + rng.choice([-1, 1, 2, 1000])).encode()
    if kind == 1:
        return b"-" + old if not old.startswith(b"-") else old[1:]
    return rng.choice(NUMBERS)


def _change_bytes(data, rng):
    kind = rng.randrange(7)
    place = rng.randrange(len(data))
    changed = bytearray(data)
    if kind == 0:
        changed[place] ^= 1 << rng.randrange(8)
    elif kind == 1:
        changed[place] = rng.randrange(256)
    elif kind == 2 and len(data) >= 4:
        place = rng.randrange(len(data) - 3) & ~3
        struct.pack_into(rng.choice("<>") + "I", changed, place, rng.choice(WORDS))
    elif kind == 3:
        length = rng.randrange(1, 33)
        source = rng.randrange(len(data))
        changed[place:place + length] = data[source:source + length]
    elif kind == 4:
        del changed[place:place + rng.choice([1, 4, rng.randrange(1, len(data) + 1)])]
    elif kind == 5:
        changed[place:place] = data[place:place + rng.randrange(1, 65)]
    else:
        del changed[place:]
    return bytes(changed)
