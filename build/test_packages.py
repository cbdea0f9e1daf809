"""Tests of what packages.py makes: of a program that is none, and of the one that the tests build.

In: RAYLANE_PROGRAM, a program of this machine. Each class is a run of its own, and one that needs
what is not installed here ends with exit code 77.
"""
import base64
import csv
import hashlib
import io
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile
import unittest
import xml.dom.minidom
import zipfile

import packages

ARCHITECTURE = {"x86_64": "x86_64", "aarch64": "aarch64", "armv7l": "arm", "armv8l": "arm"}.get(
    os.uname().machine)
SKIPPED = 77


class FakeTexts:
    """Of no program."""
    notices = b"MIT\n"
    manual = b".TH RAYLANE 1\n"
    completions = {shell: shell.encode() for shell in ("bash", "zsh", "fish")}


def members_of(data):
    """The members of an ar archive, {name: bytes}."""
    assert data[:8] == b"!<arch>\n"
    members, at = {}, 8
    while at < len(data):
        name, size = data[at:at + 16].decode().strip(), int(data[at + 48:at + 58])
        assert data[at + 58:at + 60] == b"`\n"
        members[name] = data[at + 60:at + 60 + size]
        at += 60 + size + size % 2
    return members


class Layout(unittest.TestCase):
    """Bytes, without any tool."""

    @classmethod
    def setUpClass(cls):
        cls.programs = {"arm": b"\x7fELF arm", "x86_64": b"\x7fELF"}
        cls.files = packages.packages("1.2.3", cls.programs, FakeTexts)

    def test_names(self):
        self.assertEqual(sorted(self.files), [
            "NOTICES", "SHA256SUMS", "raylane-1.2.3-linux-arm", "raylane-1.2.3-linux-x86_64",
            "raylane-1.2.3-py3-none-linux_armv7l.manylinux_2_17_armv7l.manylinux2014_armv7l."
            "musllinux_1_1_armv7l.whl",
            "raylane-1.2.3-py3-none-manylinux_2_12_x86_64.manylinux2010_x86_64."
            "musllinux_1_1_x86_64.whl",
            "raylane_1.2.3_amd64.deb", "raylane_1.2.3_armhf.deb",
        ])

    def test_same_bytes(self):
        self.assertEqual(self.files, packages.packages("1.2.3", self.programs, FakeTexts))

    def test_sums(self):
        lines = self.files["SHA256SUMS"].decode().splitlines()
        self.assertEqual(len(lines), len(self.files) - 1)
        for line in lines:
            digest, name = line.split("  ")
            self.assertEqual(digest, hashlib.sha256(self.files[name]).hexdigest())

    def test_record(self):
        for name in self.files:
            if not name.endswith(".whl"):
                continue
            with zipfile.ZipFile(io.BytesIO(self.files[name])) as file:
                names = file.namelist()
                record = file.read("raylane-1.2.3.dist-info/RECORD").decode()
                rows = list(csv.reader(io.StringIO(record)))
                self.assertEqual(sorted(row[0] for row in rows), sorted(names))
                for path, digest, size in rows:
                    if path.endswith("/RECORD"):
                        self.assertEqual((digest, size), ("", ""))
                        continue
                    data = file.read(path)
                    expected = base64.urlsafe_b64encode(hashlib.sha256(data).digest())
                    self.assertEqual(digest, "sha256=" + expected.decode().rstrip("="))
                    self.assertEqual(int(size), len(data))

    def test_deb(self):
        members = members_of(self.files["raylane_1.2.3_armhf.deb"])
        self.assertEqual(list(members), ["debian-binary", "control.tar.xz", "data.tar.xz"])
        self.assertEqual(members["debian-binary"], b"2.0\n")

    def test_types(self):
        types = xml.dom.minidom.parseString(packages.MIME).getElementsByTagName("mime-type")
        shown = packages.THUMBNAILER.rpartition("MimeType=")[2]
        for each in types:
            self.assertIn(each.getAttribute("type") + ";", shown)


class OfProgram(unittest.TestCase):
    """What needs the program: a folder, and the picture that it makes before it is installed."""

    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)
        self.program = os.environ["RAYLANE_PROGRAM"]
        self.texts = packages.Texts(self.program)
        self.data = pathlib.Path(self.program).read_bytes()
        self.picture = self.render(self.program)

    def render(self, program, arguments=()):
        """The bytes of a small picture, rendered with nothing else on the path."""
        out = self.folder / "out.png"
        command = [program, *(arguments or ["builtin:cornell", "-r", "16x16", "-o", out])]
        subprocess.run(command, check=True, cwd=self.folder, stdout=subprocess.DEVNULL,
                       env={"PATH": str(pathlib.Path(program).parent)})
        data = out.read_bytes()
        out.unlink()
        return data

    def package(self, make):
        name, data = make("1.2.3", ARCHITECTURE, self.data, self.texts, True)
        path = self.folder / name
        path.write_bytes(data)
        return path


class Deb(OfProgram):
    """Installed by dpkg below a folder, or unpacked by it where that takes root."""

    def test_install(self):
        root = self.folder / "root"
        for part in ("info", "updates", "triggers"):
            (root / "var/lib/dpkg" / part).mkdir(parents=True)
        (root / "var/lib/dpkg/status").touch()
        package = self.package(packages.deb)
        if os.geteuid() == 0:
            command = ["dpkg", f"--root={root}", "--log=/dev/null", "--install", package]
        else:
            command = ["dpkg-deb", "--extract", package, root]
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
        self.assertEqual(self.render(root / "usr/bin/raylane"), self.picture)
        self.thumbnail(root)
        fields = subprocess.run(["dpkg-deb", "--field", package, "Package", "Architecture"],
                                check=True, stdout=subprocess.PIPE, text=True).stdout
        self.assertIn("Package: raylane\n", fields)
        expected = packages.ARCHITECTURES[ARCHITECTURE][0]
        self.assertIn(f"Architecture: {expected}\n", fields)
        for path in ("man/man1/raylane.1.gz", "doc/raylane/copyright",
                     "bash-completion/completions/raylane", "mime/packages/raylane.xml"):
            self.assertGreater((root / "usr/share" / path).stat().st_size, 0)

    def thumbnail(self, root):
        """As a file manager makes one of a file."""
        text = (root / "usr/share/thumbnailers/raylane.thumbnailer").read_text()
        command = next(line for line in text.splitlines() if line.startswith("Exec="))
        scene = pathlib.Path("scenes/cornell.gltf").resolve()
        values = {"%s": "16", "%o": str(self.folder / "out.png"), "%i": str(scene)}
        words = [values.get(word, word) for word in command[len("Exec="):].split()]
        data = self.render(root / "usr/bin" / words[0], words[1:])
        self.assertEqual(data[:8], b"\x89PNG\r\n\x1a\n")
        self.assertEqual(data[16:24], (16).to_bytes(4, "big") * 2)


class Wheel(OfProgram):
    """Installed by pip into an environment that is new and has nothing else."""

    def test_install(self):
        environment = self.folder / "environment"
        subprocess.run([sys.executable, "-m", "venv", "--without-pip", environment], check=True)
        python = environment / "bin/python"
        pip = [sys.executable, "-m", "pip", "--disable-pip-version-check", "--python", python]
        subprocess.run([*pip, "install", "--quiet", "--no-index", self.package(packages.wheel)],
                       check=True, cwd=self.folder, env={**os.environ, "PIP_NO_CACHE_DIR": "1"})
        installed = environment / "bin/raylane"
        self.assertEqual(installed.read_bytes(), self.data)
        self.assertEqual(self.render(installed), self.picture)
        self.assertTrue((environment / "share/man/man1/raylane.1").is_file())
        query = ("import importlib.metadata as m; print(m.version('raylane'), "
                 "[f for f in m.files('raylane') if not f.locate().is_file()])")
        told = subprocess.run([python, "-c", query], check=True, stdout=subprocess.PIPE, text=True)
        self.assertEqual(told.stdout, "1.2.3 []\n")


def is_missing(name):
    """Whether what a class needs is not installed, or is too old."""
    if name == "Deb":
        return ARCHITECTURE is None or shutil.which("dpkg") is None
    if name == "Wheel":
        asked = [sys.executable, "-c", "import venv, pip; assert int(pip.__version__[:2]) >= 23"]
        return ARCHITECTURE is None or subprocess.run(asked, stderr=subprocess.DEVNULL,
                                                      check=False).returncode != 0
    return False


if __name__ == "__main__":
    if is_missing(sys.argv[1]):
        sys.exit(SKIPPED)
    unittest.main()
