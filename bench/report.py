#!/usr/bin/env python3
"""Makes a report of one or several files of `raylane bench --json`.

Usage: bench/report.py -o FOLDER [--formats svg,png] FILE.json...

Writes FOLDER/index.html, with the thesis's published numbers beside the measured ones, and
FOLDER/figures/NAME.svg and .png, the thesis's figures. Each file is a machine. Needs matplotlib:
pip install --require-hashes -r bench/reporting/requirements.txt
"""

import argparse
import pathlib
import sys

from reporting import page, samples


def main(arguments):
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("-o", "--output", required=True, metavar="FOLDER")
    parser.add_argument("--formats", default="svg,png", help="of the figures: svg, png or both")
    parser.add_argument("files", nargs="+", metavar="FILE.json")
    options = parser.parse_args(arguments)
    formats = options.formats.split(",")
    if not set(formats) <= {"svg", "png"}:
        parser.error("--formats: svg, png or both with a comma between them")
    try:
        from reporting import figures
    except ImportError:
        print("report: matplotlib is missing: "
              "pip install --require-hashes -r bench/reporting/requirements.txt", file=sys.stderr)
        return 1
    try:
        runs = [samples.load(path) for path in options.files]
        folder = pathlib.Path(options.output)
        (folder / "figures").mkdir(parents=True, exist_ok=True)
        drawn = figures.draw_all(runs, folder / "figures", formats)
        text = page.write(runs, drawn, "figures", formats[0])
        (folder / "index.html").write_text(text, encoding="utf-8")
    except (OSError, samples.Unusable) as error:
        print(f"report: {error}", file=sys.stderr)
        return 1
    print(folder / "index.html")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
