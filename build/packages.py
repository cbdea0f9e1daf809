#!/usr/bin/env python3
"""Wraps released programs up: a .deb and a wheel for each, their notices, and checksums of all.

    build/packages.py --version VERSION --output FOLDER --native PROGRAM [--fast] ARCH=PROGRAM...

ARCH is x86_64, aarch64 or arm; `--native` is the one of these programs that runs here: it writes
the manual's page, the completions and the notices. The same programs make the same bytes, for
nothing that is written tells when, by whom or where. `--fast` does without compression.

Formats: deb(5), ar and ustar; wheels by the "Binary distribution format" of Python's packaging
specifications; .thumbnailer files as gnome-desktop reads them; the shared MIME-info specification.
"""
import argparse
import base64
import gzip
import hashlib
import io
import lzma
import pathlib
import stat
import subprocess
import sys
import tarfile
import zipfile

# The oldest that a zip file can tell; nothing newer is known of the same bytes.
TIMESTAMP_S = 315532800
ZIP_DATE = (1980, 1, 1, 0, 0, 0)

# By the architecture: Debian's name, and the platforms of the wheel. A static program asks nothing
# of the system's C library, so the oldest that pip knows will do.
ARCHITECTURES = {
    "x86_64": ("amd64", ["manylinux_2_12_x86_64", "manylinux2010_x86_64", "musllinux_1_1_x86_64"]),
    "aarch64": ("arm64", ["manylinux_2_17_aarch64", "manylinux2014_aarch64",
                          "musllinux_1_1_aarch64"]),
    "arm": ("armhf", ["linux_armv7l", "manylinux_2_17_armv7l", "manylinux2014_armv7l",
                      "musllinux_1_1_armv7l"]),
}

SUMMARY = "Renders glTF, PBRT, OBJ, STL and PLY scenes to images on the CPU"

DESCRIPTION = """\
A ray tracer that needs neither a GPU nor a display: packets of rays in SIMD registers, on x86-64,
AArch64 and ARMv7 with NEON. The same scene gives the same picture, bit for bit, on all of them.

    raylane scene.glb -o picture.png

`raylane --help` lists what there is, `raylane --licenses` the licences of what it is made of.
"""

# Without the scene's own folder, for a file manager may hand over a file and nothing beside it.
THUMBNAILER = """\
[Thumbnailer Entry]
TryExec=raylane
Exec=raylane render --quiet --max-memory 2G --max-texture-size 1024 --background transparent \
--sandbox auto --format png --resolution %s --output %o -- %i
MimeType=model/gltf-binary;model/gltf+json;model/obj;model/stl;model/x.stl-ascii;\
model/x.stl-binary;model/x-ply;
"""

# What newer databases have as well is merged with theirs.
MIME = """\
<?xml version="1.0" encoding="UTF-8"?>
<mime-info xmlns="http://www.freedesktop.org/standards/shared-mime-info">
  <mime-type type="model/gltf-binary">
    <comment>glTF model</comment>
    <magic><match type="string" value="glTF" offset="0"/></magic>
    <glob pattern="*.glb"/>
  </mime-type>
  <mime-type type="model/gltf+json">
    <comment>glTF model</comment>
    <sub-class-of type="application/json"/>
    <glob pattern="*.gltf"/>
  </mime-type>
  <mime-type type="model/obj">
    <comment>OBJ 3D model</comment>
    <sub-class-of type="text/plain"/>
    <glob pattern="*.obj"/>
  </mime-type>
  <mime-type type="model/stl">
    <comment>STL 3D model</comment>
    <glob pattern="*.stl"/>
  </mime-type>
  <mime-type type="model/x-ply">
    <comment>PLY 3D model</comment>
    <magic><match type="string" value="ply\\n" offset="0"/>\
<match type="string" value="ply\\r" offset="0"/></magic>
    <glob pattern="*.ply"/>
  </mime-type>
</mime-info>
"""


class Texts:
    """What a program says of itself."""

    def __init__(self, program):
        def run(*arguments):
            return subprocess.run([program, *arguments], check=True, stdin=subprocess.DEVNULL,
                                  stdout=subprocess.PIPE).stdout
        self.notices = run("--licenses")
        self.manual = run("man")
        self.completions = {shell: run("completion", shell) for shell in ("bash", "zsh", "fish")}


def compressed(data):
    """By gzip, without a name or a time."""
    out = io.BytesIO()
    with gzip.GzipFile(filename="", mode="wb", fileobj=out, compresslevel=9, mtime=0) as file:
        file.write(data)
    return out.getvalue()


def tarball(name, files, fast=False):
    """Name and bytes of files {path: (data, mode)} as .tar.xz, with the folders they are in."""
    names = {"."}
    for path in files:
        names.update(f"./{parent}" for parent in pathlib.PurePosixPath(path).parents
                     if str(parent) != ".")
    names.update(f"./{path}" for path in files)
    out = io.BytesIO()
    with tarfile.open(fileobj=out, mode="w", format=tarfile.USTAR_FORMAT) as tar:
        for path in sorted(names):
            info = tarfile.TarInfo(path)
            info.mtime = TIMESTAMP_S
            info.uname = info.gname = "root"
            data, info.mode = files.get(path[2:], (b"", 0o755))
            if path[2:] in files:
                info.size = len(data)
            else:
                info.type = tarfile.DIRTYPE
            tar.addfile(info, io.BytesIO(data))
    if fast:
        return f"{name}.tar", out.getvalue()
    return f"{name}.tar.xz", lzma.compress(out.getvalue(), preset=6)


def archive(members):
    """Members [(name, data)] as ar(5) has them in a .deb."""
    out = [b"!<arch>\n"]
    for name, data in members:
        header = f"{name:<16}{TIMESTAMP_S:<12}{0:<6}{0:<6}{'100644':<8}{len(data):<10}`\n"
        out += [header.encode(), data, b"\n" * (len(data) % 2)]
    return b"".join(out)


def shared_files(texts):
    """What stands below share/ whatever installs it, {path: data}."""
    return {
        "share/bash-completion/completions/raylane": texts.completions["bash"],
        "share/fish/vendor_completions.d/raylane.fish": texts.completions["fish"],
    }


def deb(version, architecture, program, texts, fast):
    """Name and bytes of a package for Debian and its kin."""
    plain = {
        **shared_files(texts),
        "share/zsh/vendor-completions/_raylane": texts.completions["zsh"],
        "share/man/man1/raylane.1.gz": compressed(texts.manual),
        "share/thumbnailers/raylane.thumbnailer": THUMBNAILER.encode(),
        "share/mime/packages/raylane.xml": MIME.encode(),
        "share/doc/raylane/copyright": texts.notices,
    }
    files = {f"usr/{path}": (data, 0o644) for path, data in plain.items()}
    files["usr/bin/raylane"] = (program, 0o755)
    sums = "".join(f"{hashlib.md5(files[path][0]).hexdigest()}  {path}\n" for path in sorted(files))
    size_kib = sum(-(-len(data) // 1024) for data, _ in files.values())
    name = ARCHITECTURES[architecture][0]
    control = (f"Package: raylane\nVersion: {version}\nArchitecture: {name}\n"
               "Maintainer: The Raylane authors\nSection: graphics\nPriority: optional\n"
               f"Installed-Size: {size_kib}\nDescription: {SUMMARY}\n")
    control += "".join(f" {line or '.'}\n" for line in DESCRIPTION.splitlines())
    about = {"control": (control.encode(), 0o644), "md5sums": (sums.encode(), 0o644)}
    return f"raylane_{version}_{name}.deb", archive([
        ("debian-binary", b"2.0\n"),
        tarball("control", about),
        tarball("data", files, fast),
    ])


def wheel(version, architecture, program, texts, fast):
    """Name and bytes of a package for pip: what its command runs is the program itself."""
    platforms = ARCHITECTURES[architecture][1]
    info = f"raylane-{version}.dist-info"
    data = f"raylane-{version}.data"
    metadata = (f"Metadata-Version: 2.1\nName: raylane\nVersion: {version}\nSummary: {SUMMARY}\n"
                "Author: The Raylane authors\nLicense: MIT, and those in licenses/NOTICES\n"
                "License-File: licenses/NOTICES\nKeywords: gltf,pbrt,rendering,ray tracing\n"
                "Classifier: Environment :: Console\n"
                "Classifier: Operating System :: POSIX :: Linux\n"
                "Classifier: Topic :: Multimedia :: Graphics :: 3D Rendering\n"
                f"Description-Content-Type: text/markdown\n\n{DESCRIPTION}")
    tags = "".join(f"Tag: py3-none-{platform}\n" for platform in platforms)
    about = f"Wheel-Version: 1.0\nGenerator: raylane {version}\nRoot-Is-Purelib: false\n{tags}"
    files = {f"{data}/data/{path}": text for path, text in shared_files(texts).items()}
    files.update({
        f"{data}/data/share/zsh/site-functions/_raylane": texts.completions["zsh"],
        f"{data}/data/share/man/man1/raylane.1": texts.manual,
        f"{data}/scripts/raylane": program,
        f"{info}/METADATA": metadata.encode(),
        f"{info}/WHEEL": about.encode(),
        f"{info}/licenses/NOTICES": texts.notices,
    })
    record = ""
    for path in sorted(files):
        digest = base64.urlsafe_b64encode(hashlib.sha256(files[path]).digest()).decode().rstrip("=")
        record += f"{path},sha256={digest},{len(files[path])}\n"
    files[f"{info}/RECORD"] = f"{record}{info}/RECORD,,\n".encode()
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w") as file:
        # What describes the wheel stands last, so that it is found without the rest.
        for path in sorted(files, key=lambda path: (path.startswith(info), path)):
            entry = zipfile.ZipInfo(path, ZIP_DATE)
            entry.create_system = 3  # Unix: the mode counts.
            mode = 0o755 if "/scripts/" in path else 0o644
            entry.external_attr = (stat.S_IFREG | mode) << 16
            method = zipfile.ZIP_STORED if fast else zipfile.ZIP_DEFLATED
            file.writestr(entry, files[path], method, 9)
    return f"raylane-{version}-py3-none-{'.'.join(platforms)}.whl", out.getvalue()


def packages(version, programs, texts, fast=False):
    """Everything that is released, {name: bytes}; `programs` is {architecture: bytes}."""
    files = {"NOTICES": texts.notices}
    for architecture, program in programs.items():
        files[f"raylane-{version}-linux-{architecture}"] = program
        for make in (deb, wheel):
            name, data = make(version, architecture, program, texts, fast)
            files[name] = data
    sums = "".join(f"{hashlib.sha256(files[name]).hexdigest()}  {name}\n" for name in sorted(files))
    files["SHA256SUMS"] = sums.encode()
    return files


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--version", required=True)
    parser.add_argument("--output", required=True, type=pathlib.Path)
    parser.add_argument("--native", required=True)
    parser.add_argument("--fast", action="store_true")
    parser.add_argument("program", nargs="+", metavar="ARCH=PROGRAM")
    options = parser.parse_args()
    programs = {}
    for word in options.program:
        architecture, separator, path = word.partition("=")
        if not separator or architecture not in ARCHITECTURES:
            parser.error(f"{word} is not ARCH=PROGRAM, ARCH {', '.join(ARCHITECTURES)}")
        programs[architecture] = pathlib.Path(path).read_bytes()
    files = packages(options.version, programs, Texts(options.native), options.fast)
    options.output.mkdir(parents=True, exist_ok=True)
    for name, data in files.items():
        path = options.output / name
        path.write_bytes(data)
        path.chmod(0o755 if data.startswith(b"\x7fELF") else 0o644)
    return 0


if __name__ == "__main__":
    sys.exit(main())
