"""Runs of a program, with what they cost and what they said.

In: a command, limits of time and of what the system gives. Out: its exit code or signal, seconds,
the peak of its memory. The peak is never below that of this process, whose memory the new one has
for a moment before it is the program (some 15 MB).
"""

import dataclasses
import os
import resource
import signal
import subprocess
import threading
import time


@dataclasses.dataclass
class Run:
    """How a run went."""
    exit_code: int  # Of a program that died of a signal: 128 and the signal's number.
    signal: int  # 0: none.
    timed_out: bool
    seconds: float
    peak_bytes: int
    stderr: str

    @property
    def lines(self):
        """What it said on standard error, line by line."""
        return self.stderr.splitlines()

    @property
    def warnings(self):
        """Lines that are warnings."""
        return [line for line in self.lines if ": warning: " in line]

    @property
    def errors(self):
        """Lines that are not."""
        return [line for line in self.lines if line not in self.warnings]

    @property
    def crash(self):
        """Why it did not end as a program should; None: it did."""
        if self.timed_out:
            return "did not end"
        if self.signal:
            return f"died of {signal.Signals(self.signal).name}"
        if self.exit_code not in (0, 1, 2, 3, 124):
            return f"exit code {self.exit_code}"
        if any(not line.startswith("raylane: ") for line in self.lines):
            return "said what is no message"
        if self.exit_code != 0 and len(self.errors) != 1:
            return f"{len(self.errors)} lines of errors"
        return None


def limited(limits):
    """What a new process does before it is the program: {resource.RLIMIT_...: value}."""
    def limit():
        for what, value in limits.items():
            resource.setrlimit(what, (value, value))
    return limit if limits else None


def run(command, timeout_s, cwd=None, stdin=subprocess.DEVNULL, limits=None):
    """Runs a command to its end, or kills it and all that it started."""
    start = time.monotonic()
    with subprocess.Popen(command, cwd=cwd, stdin=stdin, stdout=subprocess.DEVNULL,
                          stderr=subprocess.PIPE, start_new_session=True,
                          preexec_fn=limited(limits or {})) as process:
        killed = threading.Event()

        def kill():
            killed.set()
            os.killpg(process.pid, signal.SIGKILL)

        timer = threading.Timer(timeout_s, kill)
        timer.start()
        text = process.stderr.read().decode("utf-8", "replace")
        _, status, usage = os.wait4(process.pid, 0)
        timer.cancel()
        timer.join()
        seconds = time.monotonic() - start
        code = process.returncode = os.waitstatus_to_exitcode(status)
    return Run(exit_code=code if code >= 0 else 128 - code, signal=max(0, -code),
               timed_out=killed.is_set(), seconds=seconds,
               peak_bytes=usage.ru_maxrss << 10, stderr=text)


def table(head, rows):
    """Rows of strings as a table of Markdown."""
    lines = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    lines += ["| " + " | ".join(cell.replace("|", "\\|") for cell in row) + " |" for row in rows]
    return "\n".join(lines)
