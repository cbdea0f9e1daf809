"""Tests of vendor/fetch on packages and registries made here; nothing is asked of the network."""
import contextlib
import http.server
import importlib.machinery
import importlib.util
import io
import json
import os
import pathlib
import shutil
import sys
import tarfile
import tempfile
import threading
import unittest
from unittest import mock

sys.dont_write_bytecode = True  # Beside a script without an extension.
LOADER = importlib.machinery.SourceFileLoader(
    "fetch", str(pathlib.Path(__file__).with_name("fetch")))
fetch = importlib.util.module_from_spec(importlib.util.spec_from_loader("fetch", LOADER))
LOADER.exec_module(fetch)

FILES = {"lib/a.h": b"int a;\n", "lib/deep/b.c": b"int b;\n", "other.c": b"int other;\n",
         "COPYING": b"/* head\n * Copyright me\n *\n * No warranty.\n */\n"}


def tar(folder):
    """A package of FILES, as registries have them."""
    data = io.BytesIO()
    with tarfile.open(fileobj=data, mode="w:gz") as archive:
        for name, contents in FILES.items():
            member = tarfile.TarInfo(f"{folder}/{name}")
            member.size = len(contents)
            archive.addfile(member, io.BytesIO(contents))
    return data.getvalue()


PACKAGE = tar("pack-1.0.0")


class FetchTest(unittest.TestCase):
    def setUp(self):
        self.top = pathlib.Path(self.enter(tempfile.TemporaryDirectory()))
        self.vendor = self.top / "vendor"
        self.vendor.mkdir()
        self.write_table("sdist")
        # Another way to the same package, which counts how often it is taken.
        self.loads = 0
        self.enter(mock.patch.dict(fetch.KINDS, {"sdist": self.load}))

    def enter(self, context):
        value = context.__enter__()
        self.addCleanup(context.__exit__, None, None, None)
        return value

    def load(self, _name, _version, _staging):
        self.loads += 1
        return fetch.archive(PACKAGE)

    def write_table(self, kind, checksum=None):
        notices = [["x/COPYING", "Copyright me", "warranty."]]
        library = {"version": "2", "licence": "MIT", "into": "x", "notices": notices}
        table = {"packages": [{
            "package": "pack", "kind": kind, "version": "1.0.0", "folder": "",
            "sha256": checksum or fetch.sha256(PACKAGE), "libraries": [
                {**library, "name": "a", "optional": False, "files": ["lib/*", "COPYING"]},
                {**library, "name": "b", "optional": True, "files": ["other.c", "COPYING"]}]}]}
        (self.vendor / "libraries.json").write_text(json.dumps(table))
        (self.vendor / "SHA256SUMS").write_text("".join(
            f"{fetch.sha256(data)}  x/{name}\n" for name, data in FILES.items()))

    def run_fetch(self, *arguments):
        """What it says where it fails; None where it does not."""
        with contextlib.redirect_stderr(io.StringIO()):
            try:
                fetch.main(self.vendor, list(arguments))
            except SystemExit as end:
                return end.code
        return None

    def names(self):
        include = self.vendor / "include"
        return sorted(path.relative_to(include).as_posix() for path in include.rglob("*")
                      if path.is_file())

    def test_what_is_needed_is_fetched_once_and_what_is_optional_when_named(self):
        needed = ["a.notice", "x/COPYING", "x/lib/a.h", "x/lib/deep/b.c"]
        for _ in range(2):
            self.assertIsNone(self.run_fetch())
            self.assertEqual(needed, self.names())
            self.assertEqual(1, self.loads)
        self.assertIsNone(self.run_fetch("b"))
        self.assertEqual(sorted(needed + ["b.notice", "x/other.c"]), self.names())
        self.assertEqual("a 2 (MIT), from the sdist pack 1.0.0\n\nCopyright me\n\nNo warranty.\n",
                         (self.vendor / "include/a.notice").read_text())
        self.assertEqual([], list(self.vendor.glob(".fetch*")))
        self.assertIn("no library 'c'", self.run_fetch("c"))

    def test_files_put_there_by_hand_are_taken_where_they_are_right(self):
        for name in ["lib/a.h", "lib/deep/b.c", "COPYING"]:
            path = self.vendor / "include/x" / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(FILES[name])
        self.assertIsNone(self.run_fetch())
        self.assertEqual(0, self.loads)
        (self.vendor / "include/x/lib/a.h").write_bytes(b"int c;\n")
        self.assertIn("lib/a.h is not the pinned version", self.run_fetch())

    def test_a_package_that_is_not_the_pinned_one_leaves_nothing(self):
        self.write_table("sdist", "0" * 64)
        message = self.run_fetch()
        self.assertIn("the sdist pack 1.0.0 is not the pinned one", message)
        self.assertIn("by hand: x/lib/a.h x/lib/deep/b.c x/COPYING", message)
        self.write_table("sdist")
        sums = self.vendor / "SHA256SUMS"
        sums.write_text(sums.read_text().replace(fetch.sha256(FILES["lib/a.h"]), "1" * 64))
        self.assertIn("x/lib/a.h of the sdist pack 1.0.0 has the wrong SHA-256", self.run_fetch())
        self.assertFalse((self.vendor / "include").exists())

    def test_pinning_writes_the_sums(self):
        before = sorted((self.vendor / "SHA256SUMS").read_text().splitlines())
        (self.vendor / "SHA256SUMS").write_text("")
        self.assertIsNone(self.run_fetch("--pin"))
        after = (self.vendor / "SHA256SUMS").read_text().splitlines()
        self.assertEqual(before, sorted(after))

    def test_builds_side_by_side(self):
        messages = []
        with mock.patch("signal.signal"):
            threads = [threading.Thread(target=lambda: messages.append(self.run_fetch()))
                       for _ in range(8)]
            for thread in threads:
                thread.start()
            for thread in threads:
                thread.join()
        self.assertEqual([None] * 8, messages)
        self.assertEqual(4, len(self.names()))

    def test_a_tool_that_is_not_there_is_named(self):
        self.write_table("crate")
        with mock.patch.dict(os.environ, {"PATH": ""}):
            self.assertIn("cannot fetch the crate pack 1.0.0: there is no cargo", self.run_fetch())

    @unittest.skipUnless(importlib.util.find_spec("pip"), "needs pip")
    def test_an_sdist_from_the_index_that_pip_is_configured_for(self):
        page = self.top / "index/pack"
        page.mkdir(parents=True)
        (page / "pack-1.0.0.tar.gz").write_bytes(PACKAGE)
        (page / "index.html").write_text("<!DOCTYPE html><html><body>"
                                         '<a href="pack-0.9.tar.gz">pack-0.9.tar.gz</a>'
                                         '<a href="pack-1.0.0.tar.gz">pack-1.0.0.tar.gz</a>'
                                         "</body></html>")
        index = {"PIP_INDEX_URL": (self.top / "index").as_uri(), "PIP_CONFIG_FILE": os.devnull}
        with mock.patch.dict(os.environ, index):
            checksum, files = fetch.sdist("pack", "1.0.0", None)
            self.assertEqual((fetch.sha256(PACKAGE), FILES), (checksum, files))
            with self.assertRaises(fetch.Failure):
                fetch.sdist("pack", "2.0.0", None)

    @unittest.skipUnless(shutil.which("npm"), "needs npm")
    def test_an_npm_package_from_the_registry_that_npm_is_configured_for(self):
        package = tar("package")

        class Registry(http.server.BaseHTTPRequestHandler):
            def do_GET(self):
                url = f"http://127.0.0.1:{self.server.server_port}"
                version = {"name": "pack", "version": "1.0.0",
                           "dist": {"tarball": f"{url}/pack.tgz"}}
                listing = {"name": "pack", "dist-tags": {"latest": "1.0.0"},
                           "versions": {"1.0.0": version}}
                self.send_response(200)
                self.end_headers()
                is_file = self.path.endswith(".tgz")
                self.wfile.write(package if is_file else json.dumps(listing).encode())

            def log_message(self, *_):
                pass

        server = self.enter(http.server.ThreadingHTTPServer(("127.0.0.1", 0), Registry))
        threading.Thread(target=server.serve_forever, daemon=True).start()
        self.addCleanup(server.shutdown)
        staging = self.top / "staging"
        staging.mkdir()
        settings = {"npm_config_registry": f"http://127.0.0.1:{server.server_port}",
                    "npm_config_cache": str(self.top / "cache")}
        with mock.patch.dict(os.environ, settings):
            checksum, files = fetch.npm("pack", "1.0.0", staging)
        self.assertEqual((fetch.sha256(package), FILES), (checksum, files))


if __name__ == "__main__":
    unittest.main()
