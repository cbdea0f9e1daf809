#!/usr/bin/env python3
"""Writes the images beside it, for tests/decode.zig, which knows the same colours.

    tests/images/make.py

PNG and HDR are written here, byte by byte; JPEG and WebP need Pillow, OpenEXR its Python package,
KTX 2 the encoder `basisu` beside it. All show the same picture of 29 by 17 pixels, of integers
alone.
"""
import pathlib
import struct
import subprocess
import zlib

FOLDER = pathlib.Path(__file__).parent
WIDTH, HEIGHT = 29, 17


def value(x, y, channel):
    """Red, green, blue and alpha; gray is red."""
    return (x * 9, y * 15, 255 - x * 4 - y * 7, 255 - x * 5 - y * 3)[channel]


def index(x, y):
    return (x + y * 2) % 14


def chunk(name, data):
    return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))


def png(name, depth, colour, sample, channels, extra=b"", interlaced=False):
    """`sample` is a function of x, y and the channel, of `depth` bits."""
    def image(xs, ys):
        data = b""
        for row, y in enumerate(ys):
            bits = "".join(format(sample(x, y, channel), f"0{depth}b")
                           for x in xs for channel in range(channels))
            bits += "0" * (-len(bits) % 8)
            line = bytes(int(bits[at:at + 8], 2) for at in range(0, len(bits), 8))
            # Filters by turns: none and the difference to the pixel before.
            step = max(1, depth * channels // 8)
            if row % 2:
                line = bytes((line[at] - (line[at - step] if at >= step else 0)) % 256
                             for at in range(len(line)))
            data += bytes([row % 2]) + line
        return data

    passes = [(0, 0, 8, 8), (4, 0, 8, 8), (0, 4, 4, 8), (2, 0, 4, 4), (0, 2, 2, 4), (1, 0, 2, 2),
              (0, 1, 1, 2)] if interlaced else [(0, 0, 1, 1)]
    data = b"".join(image(range(x, WIDTH, dx), range(y, HEIGHT, dy)) for x, y, dx, dy in passes)
    header = struct.pack(">IIBBBBB", WIDTH, HEIGHT, depth, colour, 0, 0, int(interlaced))
    (FOLDER / name).write_bytes(
        b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + extra +
        chunk(b"IDAT", zlib.compress(data, 9)) + chunk(b"IEND", b""))


def hdr(name, width, compressed):
    """Values of red, green and blue as mantissas, each row with an exponent of its own."""
    data = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y %d +X %d\n" % (HEIGHT, width)
    for y in range(HEIGHT):
        row = [[value(x, y, channel) for channel in range(3)] + [120 + y] for x in range(width)]
        if compressed:
            data += struct.pack(">BBH", 2, 2, width)
            for channel in range(3):
                data += bytes([width]) + bytes(pixel[channel] for pixel in row)
            data += bytes([128 + width, 120 + y])
        else:
            data += b"".join(map(bytes, row))
    (FOLDER / name).write_bytes(data)


def pngs():
    palette = chunk(b"PLTE", b"".join(bytes([i * 17, 255 - i * 17, i * 9]) for i in range(14)))
    clear = chunk(b"tRNS", bytes(i * 50 for i in range(5)))
    png("gray.png", 8, 0, lambda x, y, c: value(x, y, 0), 1)
    png("gray-1.png", 1, 0, lambda x, y, c: value(x, y, 0) >> 7, 1)
    png("gray-4.png", 4, 0, lambda x, y, c: value(x, y, 0) >> 4, 1)
    png("gray-alpha.png", 8, 4, lambda x, y, c: value(x, y, 3 * c), 2)
    png("gray-16.png", 16, 0, lambda x, y, c: value(x, y, 0) * 257, 1)
    png("rgb.png", 8, 2, value, 3)
    png("rgb-16.png", 16, 2, lambda x, y, c: value(x, y, c) * 257, 3)
    png("rgb-interlaced.png", 8, 2, value, 3, interlaced=True)
    # Red 0 and green 0 and blue 255 are transparent: one pixel.
    png("rgb-key.png", 8, 2, value, 3, chunk(b"tRNS", struct.pack(">HHH", 0, 0, 255)))
    png("rgba.png", 8, 6, value, 4)
    png("palette.png", 4, 3, lambda x, y, c: index(x, y), 1, palette)
    png("palette-alpha.png", 4, 3, lambda x, y, c: index(x, y), 1, palette + clear)
    png("palette-short.png", 8, 3, lambda x, y, c: index(x, y) + 200 * (x % 2), 1, palette)


def jpegs():
    from PIL import Image
    rgb = Image.new("RGB", (WIDTH, HEIGHT))
    rgb.putdata([tuple(value(x, y, c) for c in range(3))
                 for y in range(HEIGHT) for x in range(WIDTH)])
    gray = Image.new("L", (WIDTH, HEIGHT))
    gray.putdata([value(x, y, 0) for y in range(HEIGHT) for x in range(WIDTH)])
    gray.save(FOLDER / "gray.jpg", quality=95)
    rgb.save(FOLDER / "rgb.jpg", quality=95, subsampling="4:2:0")
    rgb.save(FOLDER / "rgb-444.jpg", quality=95, subsampling="4:4:4")
    rgb.save(FOLDER / "rgb-progressive.jpg", quality=95, progressive=True, subsampling="4:2:2")
    rgb.save(FOLDER / "rgb-restart.jpg", quality=95, restart_marker_blocks=1)


def webps():
    from PIL import Image
    rgb = Image.new("RGB", (WIDTH, HEIGHT))
    rgb.putdata([tuple(value(x, y, c) for c in range(3))
                 for y in range(HEIGHT) for x in range(WIDTH)])
    rgba = Image.new("RGBA", (WIDTH, HEIGHT))
    rgba.putdata([tuple(value(x, y, c) for c in range(4))
                  for y in range(HEIGHT) for x in range(WIDTH)])
    rgb.save(FOLDER / "rgb-lossless.webp", lossless=True)
    rgba.save(FOLDER / "rgba-lossless.webp", lossless=True, exact=True)
    rgb.save(FOLDER / "rgb.webp", quality=95)
    rgba.save(FOLDER / "rgba.webp", quality=95, exact=True)


def ktx2s():
    for name, source, options in [
            ("etc1s-rgb", "rgb", "-q 255 -comp_level 4"),
            ("etc1s-rgba", "rgba", "-q 255 -comp_level 4"),
            ("uastc-rgb", "rgb", "-uastc"),
            ("uastc-rgba", "rgba", "-uastc"),
            ("uastc-mips", "rgb", "-uastc -ktx2_no_zstandard -mipmap")]:
        subprocess.run(["basisu", "-ktx2", "-linear", *options.split(),
                        "-file", FOLDER / f"{source}.png",
                        "-output_file", FOLDER / f"{name}.ktx2"], check=True)


def exrs():
    import numpy
    import OpenEXR

    def write(name, channels, kind, compression):
        header = {"compression": compression, "type": OpenEXR.scanlineimage}
        data = {channel: numpy.array([[sample(x, y) for x in range(WIDTH)] for y in range(HEIGHT)],
                                     kind) for channel, sample in channels.items()}
        OpenEXR.File(header, data).write(str(FOLDER / name))

    def colour(channel):
        return lambda x, y: value(x, y, channel)

    rgb = {"R": colour(0), "G": colour(1), "B": colour(2)}
    rgba = {**rgb, "A": colour(3)}
    write("rgb.exr", rgb, "float16", OpenEXR.ZIP_COMPRESSION)
    write("rgba.exr", {**rgba, "Z": colour(0)}, "float32", OpenEXR.ZIPS_COMPRESSION)
    write("rgba-piz.exr", rgba, "float16", OpenEXR.PIZ_COMPRESSION)
    write("rgb-piz.exr", rgb, "float32", OpenEXR.PIZ_COMPRESSION)
    write("gray.exr", {"Y": colour(0)}, "float16", OpenEXR.RLE_COMPRESSION)
    write("gray-alpha.exr", {"Y": colour(0), "A": colour(3)}, "float32", OpenEXR.PXR24_COMPRESSION)
    wild = [float("nan"), float("inf"), -1, 1]
    write("wild.exr", {"Y": lambda x, y: wild[x % 4]}, "float32", OpenEXR.NO_COMPRESSION)


pngs()
webps()
jpegs()
ktx2s()
exrs()
hdr("rle.hdr", WIDTH, True)
hdr("flat.hdr", WIDTH, False)
hdr("narrow.hdr", 5, False)
