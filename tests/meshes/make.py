#!/usr/bin/env python3
"""Writes the streams beside it, for tests/meshes.zig, which knows the same numbers.

    tests/meshes/make.py

It needs the Python packages meshoptimizer, DracoPy and NumPy. All streams are of one grid of 9 by 7
vertices.
"""
import pathlib

import DracoPy
import meshoptimizer
import numpy

FOLDER = pathlib.Path(__file__).parent
COLUMNS, ROWS = 9, 7
GRID = [(x, y) for y in range(ROWS) for x in range(COLUMNS)]


def triangles():
    for y in range(ROWS - 1):
        for x in range(COLUMNS - 1):
            corner = y * COLUMNS + x
            yield corner, corner + 1, corner + COLUMNS
            yield corner + 1, corner + COLUMNS + 1, corner + COLUMNS


def attributes(name, version, kind, elements):
    meshoptimizer.encode_vertex_version(version)
    data = numpy.array(elements, kind)
    width = data.itemsize * data.shape[1]
    (FOLDER / name).write_bytes(meshoptimizer.encode_vertex_buffer(
        data.view("u1").reshape(-1, width), len(data), width))


def main():
    attributes("positions.bin", 1, "<u2", [(100 * x, 100 * y, 10 * x * y, 0) for x, y in GRID])
    # Of an octahedron, in seven bits and a sign.
    attributes("normals.bin", 0, "i1", [(9 * x - 36, 9 * y - 27, 127, 0) for x, y in GRID])
    # Exponents of -3 above mantissas.
    attributes("texcoords.bin", 1, "<i4", [(x - (3 << 24), y - (3 << 24)) for x, y in GRID])
    # Luma, two differences, alpha.
    attributes("colors.bin", 1, "u1", [(128, 4 * x, (4 * y - 12) % 256, 255) for x, y in GRID])
    indices = numpy.array(list(triangles()), "<u4")
    (FOLDER / "triangles.bin").write_bytes(
        meshoptimizer.encode_index_buffer(indices.reshape(-1), indices.size, len(GRID)))
    snake = [y * COLUMNS + (x if y % 2 == 0 else COLUMNS - 1 - x) for x, y in GRID]
    (FOLDER / "indices.bin").write_bytes(meshoptimizer.encode_index_sequence(
        numpy.array(snake, "<u4"), len(snake), len(GRID)))

    for name, is_sequential in (("edgebreaker.drc", False), ("sequential.drc", True)):
        (FOLDER / name).write_bytes(DracoPy.encode(
            numpy.array([(x, y, x * y / 16) for x, y in GRID], "f8"), indices,
            quantization_bits=11, compression_level=0 if is_sequential else 7,
            preserve_order=is_sequential,
            tex_coord=numpy.array([(x / 8, y / 6) for x, y in GRID], "f8"),
            tex_coord_quantization_bits=10,
            normals=numpy.array([(0, 0.6, 0.8)] * len(GRID), "f8"), normal_quantization_bits=8,
            colors=numpy.array([(20 * x, 30 * y, 5, 255) for x, y in GRID], "u1")))


if __name__ == "__main__":
    main()
