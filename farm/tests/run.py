"""Runs the tests as part of the build's suite: makes their environment, and logs each test.

    python3 farm/tests/run.py FOLDER

FOLDER keeps a virtual environment with requirements.txt from one run to the next. Where it cannot
be made, for want of a network say, the tests that need it are skipped. What is printed is what
tests/summary.zig counts.
"""

from __future__ import annotations

import fcntl
import hashlib
import os
import subprocess
import sys
import traceback
import unittest
import venv

TESTS = os.path.dirname(os.path.abspath(__file__))
REQUIREMENTS = os.path.join(TESTS, "requirements.txt")
INSTALL_S = 180


class Log(unittest.TestResult):
    """Prints a record when a test begins, and one when it has ended."""

    def startTest(self, test):
        """One of them begins."""
        super().startTest(test)
        self._failure = None
        self._is_skipped = False
        print(f"::start {test.id()}", flush=True)

    def stopTest(self, test):
        """It has ended."""
        super().stopTest(test)
        end = f"::fail {self._failure}" if self._failure else "::pass"
        print(f"\n{'::skip' if self._is_skipped and not self._failure else end}", flush=True)

    def addSkip(self, test, reason):
        """It does not run here."""
        super().addSkip(test, reason)
        self._is_skipped = True
        print(reason)

    def addFailure(self, test, err):
        """It found something wrong."""
        super().addFailure(test, err)
        self._fail(test, err)

    def addError(self, test, err):
        """It, or what a class of tests needs, could not run."""
        super().addError(test, err)
        self._fail(test, err)

    def addSubTest(self, test, subtest, err):
        """A part of it has ended."""
        super().addSubTest(test, subtest, err)
        if err is not None:
            print(subtest)
            self._fail(test, err)

    def _fail(self, test, err):
        # What is no test has neither a beginning nor an end of its own.
        is_test = isinstance(test, unittest.TestCase)
        if not is_test:
            print(f"::start {test.id()}")
        traceback.print_exception(*err, file=sys.stdout)
        self._failure = err[0].__name__
        if not is_test:
            print(f"\n::fail {self._failure}", flush=True)


def make(folder: str) -> str:
    """Its Python, with what is required; that of this process where it cannot be had."""
    python = os.path.join(folder, "bin", "python")
    with open(REQUIREMENTS, "rb") as file:
        wanted = hashlib.sha256(file.read() + sys.version.encode()).hexdigest()
    stamp = os.path.join(folder, "stamp")
    os.makedirs(folder, exist_ok=True)
    with open(os.path.join(folder, ".lock"), "w", encoding="ascii") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if os.path.exists(stamp):
            with open(stamp, encoding="ascii") as file:
                if file.read() == wanted:
                    return python
        try:
            venv.create(folder, clear=False, with_pip=True, symlinks=True)
            subprocess.run(
                [
                    *(python, "-m", "pip", "install", "-q", "--disable-pip-version-check"),
                    *("--no-input", "--retries", "1", "--timeout", "15", "--only-binary", ":all:"),
                    *("--require-hashes", "-r", REQUIREMENTS),
                ],
                check=True,
                timeout=INSTALL_S,
                stdout=sys.stdout,
                stderr=sys.stdout,
            )
        except (OSError, subprocess.SubprocessError) as error:
            print(f"no environment for the tests of farm/: {error}")
            return sys.executable
        with open(stamp, "w", encoding="ascii") as file:
            file.write(wanted)
    return python


def main() -> None:
    """Runs itself in the environment, and there the tests."""
    if sys.argv[1] != "--here":
        python = make(os.path.abspath(sys.argv[1]))
        sys.stdout.flush()
        os.execv(python, [python, os.path.abspath(__file__), "--here"])
    sys.path.insert(0, os.path.dirname(TESTS))
    unittest.defaultTestLoader.discover(TESTS, top_level_dir=TESTS).run(Log())
    print("::end", flush=True)


if __name__ == "__main__":
    main()
