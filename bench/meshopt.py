"""Buffer views of EXT_meshopt_compression, by the text of the extension, for `poses.py`.

Slow and plain: bit streams of version 0 for attributes, 0 and 1 for triangles, and the filters.
"""

import numpy as np


def unpack(data, packed):
    """Bytes of a view that the extension's object describes; `data` are its compressed ones."""
    count, stride = packed["count"], packed["byteStride"]
    read = {"ATTRIBUTES": attributes, "TRIANGLES": triangles, "INDICES": indices}[packed["mode"]]
    return unfilter(read(data, count, stride), packed.get("filter", "NONE"), count, stride)


def attributes(data, count, stride):
    """Appendix A, mode 0."""
    assert data[0] == 0xA0
    tail = max(stride, 32)
    last = np.frombuffer(data, np.uint8)[len(data) - stride :].copy()
    rows = np.zeros((count, stride), np.uint8)
    block = min((8192 // stride) & ~15, 256)
    at = 1
    for first in range(0, count, block):
        size = min(block, count - first)
        groups = -(-size // 16)
        for byte in range(stride):
            header = data[at : at + -(-groups // 4)]
            at += len(header)
            deltas = []
            for group in range(groups):
                kind = header[group // 4] >> (group % 4 * 2) & 3
                values, at = group_of(data, at, kind)
                deltas += values
            deltas = np.array(deltas[:size], np.int64)
            deltas = (deltas >> 1) ^ -(deltas & 1)
            column = (int(last[byte]) + np.cumsum(deltas)) & 255
            rows[first : first + size, byte] = column
            last[byte] = column[-1]
    assert at == len(data) - tail
    return rows.tobytes()


def group_of(data, at, kind):
    """Sixteen deltas, and where the next bytes are."""
    if kind == 0:
        return [0] * 16, at
    if kind == 3:
        return list(data[at : at + 16]), at + 16
    bits = 2 * kind
    packed = data[at : at + 2 * bits]
    at += 2 * bits
    most = (1 << bits) - 1
    values = []
    for byte in packed:
        values += [byte >> shift & most for shift in range(8 - bits, -1, -bits)]
    for index, value in enumerate(values):
        if value == most:
            values[index] = data[at]
            at += 1
    return values, at


class Bytes:
    """Variable-length numbers."""

    def __init__(self, data, at):
        self.data, self.at = data, at

    def next(self):
        self.at += 1
        return self.data[self.at - 1]

    def number(self):
        value = shift = 0
        while True:
            byte = self.next()
            value |= (byte & 127) << shift
            shift += 7
            if byte < 128:
                return value

    def delta(self):
        value = self.number()
        return (value >> 1) ^ -(value & 1)


def triangles(data, count, stride):
    """Appendix A, mode 1."""
    assert data[0] & 0xF0 == 0xE0
    most = 13 if data[0] & 15 else 15
    table = data[len(data) - 16 :]
    stream = Bytes(data, 1 + count // 3)
    edges, vertices = [(0, 0)] * 16, [0] * 16  # The latest first.
    out = []
    after = last = 0

    def fresh(slot, offset):
        """A vertex that is new, or was met a while ago."""
        nonlocal after
        if slot == 0:
            after += 1
            return after - 1
        return vertices[slot - offset]

    for code in data[1 : 1 + count // 3]:
        met = []
        if code < 0xF0:
            a, b = edges[code >> 4]
            slot = code & 15
            if slot < most:
                c = fresh(slot, 0)
                met = [c] if slot == 0 else []
            else:
                last += stream.delta() if slot == 15 else slot - (slot ^ 3)
                c = last
                met = [c]
            sides = [(c, b), (a, c)]
        else:
            if code < 0xFE:
                slots = [0, table[code & 15] >> 4, table[code & 15] & 15]
            else:
                both = stream.next()
                slots = [0 if code == 0xFE else 15, both >> 4, both & 15]
                if both == 0:
                    after = 0
            corner = [None if code >= 0xFE and s == 15 else fresh(s, 1) for s in slots]
            for index, vertex in enumerate(corner):
                if vertex is None:
                    last += stream.delta()
                    corner[index] = last
            a, b, c = corner
            met = [
                vertex
                for vertex, slot in zip(corner, slots)
                if slot == 0 or (code >= 0xFE and slot == 15)
            ]
            sides = [(b, a), (c, b), (a, c)]
        out += [a, b, c]
        for vertex in met:
            vertices = [vertex] + vertices[:15]
        for side in sides:
            edges = [side] + edges[:15]
    return np.array(out).astype("<u2" if stride == 2 else "<u4").tobytes()


def indices(data, count, stride):
    """Appendix A, mode 2."""
    assert data[0] & 0xF0 == 0xD0
    stream = Bytes(data, 1)
    last = [0, 0]
    out = []
    for _ in range(count):
        value = stream.number()
        which, value = value & 1, value >> 1
        last[which] += (value >> 1) ^ -(value & 1)
        out.append(last[which])
    return np.array(out).astype("<u2" if stride == 2 else "<u4").tobytes()


def unfilter(data, name, count, stride):
    """Appendix B."""
    if name == "NONE":
        return data
    if name == "EXPONENTIAL":
        words = np.frombuffer(data, "<i4")
        return np.ldexp(((words << 8) >> 8).astype(float), words >> 24).astype("<f4").tobytes()
    kind = {4: "<i1", 8: "<i2"}[stride]
    rows = np.frombuffer(data, kind).reshape(count, 4).astype(np.float64)
    most = np.iinfo(kind).max
    if name == "QUATERNION":
        bits = rows[:, 3].astype(np.int64)
        parts = rows[:, :3] / ((bits | 3) * np.sqrt(2))[:, None]
        out = np.zeros((count, 4))
        lost = bits & 3
        for axis in range(3):
            out[np.arange(count), (lost + 1 + axis) % 4] = parts[:, axis]
        out[np.arange(count), lost] = np.sqrt(np.maximum(1 - (parts**2).sum(1), 0))
        return np.rint(out * most).astype(kind).tobytes()
    assert name == "OCTAHEDRAL"
    x, y = (rows[:, axis] / rows[:, 2] for axis in range(2))
    z = 1 - abs(x) - abs(y)
    t = np.maximum(-z, 0)
    out = np.stack([x - np.copysign(t, x), y - np.copysign(t, y), z], 1)
    out *= most / np.linalg.norm(out, axis=1)[:, None]
    return np.rint(np.concatenate([out, rows[:, 3:]], 1)).astype(kind).tobytes()
