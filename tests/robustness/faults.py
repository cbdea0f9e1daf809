#!/usr/bin/env python3
"""What the system can do to a program while it renders, and what becomes of the picture.

In: a program of Raylane's. Out: a table of faults: kills at random moments, full disks, files that
shrink while they are read, connections that break, small stacks, few descriptors, little memory,
clocks that are far off. The target must be the old picture or the new one, whole, every time; what
is an error is one line. Exit code 1 if a line of the table is bad; what a machine cannot do (a file
system or a control group of its own, which only root can make) is said.

    tests/robustness/faults.py zig-out/bin/raylane --kills 200
"""

import argparse
import collections
import os
import pathlib
import random
import resource
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time

import runs

SCENE = "builtin:cornell"
LARGE_SCENE = "builtin:atrium"
OLD = b"old picture"
CGROUPS = pathlib.Path("/sys/fs/cgroup")


class Tool:
    """The program, a folder for its pictures, what one of them is like."""

    def __init__(self, options, folder):
        self.program = str(pathlib.Path(shutil.which(options.program) or options.program).resolve())
        self.rng = random.Random(options.seed)
        self.folder = folder
        self.options = ["-r", "96x96", "--spp", "4", "-q", "--env", "none"]

    def command(self, *arguments):
        """The program's, with options for a quick picture."""
        return [self.program, *map(str, arguments), *self.options]

    def run(self, *arguments, **how):
        """Runs it."""
        return runs.run(self.command(*arguments), timeout_s=60, **how)

    def place(self, name):
        """A folder with nothing in it but an old picture; the picture's path."""
        folder = self.folder / name
        folder.mkdir()
        target = folder / "a.png"
        target.write_bytes(OLD)
        return target


def expected(tool, *arguments):
    """(the new picture, seconds) of a run that nothing happens to."""
    target = tool.folder / "expected.png"
    run = tool.run(*arguments, "-o", target)
    if run.exit_code != 0:
        raise SystemExit(f"faults.py: {run.stderr}")
    return target.read_bytes(), run.seconds


def kills(tool, count):
    """SIGKILL at a random moment, from before the start to after the end."""
    new, seconds = expected(tool, SCENE)
    target = tool.place("kills")
    outcomes = collections.Counter()
    for _ in range(count):
        if target.read_bytes() != OLD:
            target.write_bytes(OLD)
        with subprocess.Popen(tool.command(SCENE, "-o", target), stderr=subprocess.DEVNULL) as one:
            time.sleep(tool.rng.uniform(0, 1.3 * seconds))
            one.kill()
        found = target.read_bytes()
        outcomes["old" if found == OLD else "new" if found == new else "torn"] += 1
        outcomes["left behind"] += len(os.listdir(target.parent)) > 1
    run = tool.run(SCENE, "-o", target)
    rest = len(os.listdir(target.parent)) - 1
    why = None
    if outcomes["torn"]:
        why = "a torn picture"
    elif run.exit_code != 0 or target.read_bytes() != new or rest:
        why = f"{rest} files left by the next run"
    return count, f"{outcomes['old']} old, {outcomes['new']} new, {outcomes['torn']} torn; " \
        f"{outcomes['left behind']} left a temporary file until the next run", why


def ends(tool, count):
    """SIGTERM and SIGINT at a random moment: the same, and nothing is left."""
    new, seconds = expected(tool, SCENE)
    target = tool.place("ends")
    outcomes = collections.Counter()
    for index in range(count):
        target.write_bytes(OLD)
        with subprocess.Popen(tool.command(SCENE, "-o", target), stderr=subprocess.DEVNULL) as one:
            # Before main they end the program, with nothing to be left.
            time.sleep(tool.rng.uniform(0, 1.3 * seconds))
            one.send_signal((signal.SIGTERM, signal.SIGINT)[index % 2])
        found = target.read_bytes()
        outcomes["old" if found == OLD else "new" if found == new else "torn"] += 1
        outcomes["left behind"] += len(os.listdir(target.parent)) > 1
    why = "torn or left" if outcomes["torn"] or outcomes["left behind"] else None
    return count, f"{outcomes['old']} old, {outcomes['new']} new, {outcomes['torn']} torn, " \
        f"{outcomes['left behind']} left something behind", why


def refused(tool, target, run):
    """Whether a run was an error in one line, or a whole picture; why not."""
    new = tool.folder.joinpath("expected.png").read_bytes()
    found = target.read_bytes()
    if run.crash:
        return run.crash
    if len(os.listdir(target.parent)) > 1:
        return "left a file behind"
    if found != (new if run.exit_code == 0 else OLD):
        return f"exit code {run.exit_code} and another picture than that"
    return None


def series(tool, name, runs_of):
    """Runs, one after the other, each of which must be refused or whole."""
    target = tool.place(name)
    codes = collections.Counter()
    why = None
    for run in runs_of(target):
        why = why or refused(tool, target, run)
        codes[run.exit_code] += 1
        target.write_bytes(OLD)
    text = ", ".join(f"{count} exit code {code}" for code, count in sorted(codes.items()))
    return sum(codes.values()), text, why


def full_disk(tool):
    """Files that may not grow: every kilobyte from none to enough."""
    expected(tool, SCENE)
    return series(tool, "limit", lambda target: (
        tool.run(SCENE, "-o", target, limits={resource.RLIMIT_FSIZE: size})
        for size in range(0, 24 << 10, 1 << 10)))


def full_file_system(tool):
    """A file system of 64 kB that others have filled up, less and less."""
    new, _ = expected(tool, SCENE)
    place = tool.folder / "small"
    place.mkdir()
    mounted = subprocess.run(["mount", "-t", "tmpfs", "-o", "size=64k", "tmpfs", place],
                             capture_output=True, check=False)
    if mounted.returncode != 0:
        return 0, "no file system could be made", None
    codes = collections.Counter()
    why = None
    try:
        target = place / "a.png"
        for filled in range(64, -4, -4):
            target.write_bytes(OLD)
            try:
                (place / "filler").write_bytes(bytes(filled << 10))
            except OSError:
                pass  # As much as there is.
            run = tool.run(SCENE, "-o", target)
            found = target.read_bytes()
            if run.crash or found != (new if run.exit_code == 0 else OLD):
                why = why or run.crash or "another picture"
            if sorted(os.listdir(place)) != ["a.png", "filler"]:
                why = why or "left a file behind"
            codes[run.exit_code] += 1
            (place / "filler").unlink()
    finally:
        subprocess.run(["umount", place], check=False)
    text = ", ".join(f"{count} exit code {code}" for code, count in sorted(codes.items()))
    return sum(codes.values()), text, why


def stacks(tool):
    """Stacks of 128 kB to 1 MB."""
    expected(tool, SCENE)
    return series(tool, "stacks", lambda target: (
        tool.run(SCENE, "-o", target, limits={resource.RLIMIT_STACK: size << 10})
        for size in (128, 192, 256, 512, 1024)))


def descriptors(tool):
    """Descriptors: none but the standard ones, one more, and so on."""
    expected(tool, SCENE)
    return series(tool, "descriptors", lambda target: (
        tool.run(SCENE, "-o", target, limits={resource.RLIMIT_NOFILE: count})
        for count in range(3, 13)))


def address_space(tool):
    """Address space from what the program itself takes to enough."""
    expected(tool, LARGE_SCENE)
    least = os.path.getsize(tool.program) + (8 << 20)
    return series(tool, "space", lambda target: (
        tool.run(LARGE_SCENE, "-o", target, limits={resource.RLIMIT_AS: least + (size << 20)})
        for size in range(0, 64, 4)))


def memory_groups():
    """(folder of control groups with memory, name of their limit), of either version, or None."""
    try:
        if "memory" in (CGROUPS / "cgroup.subtree_control").read_text(encoding="ascii").split():
            return CGROUPS, "memory.max"
    except OSError:
        pass
    first = CGROUPS / "memory"
    return (first, "memory.limit_in_bytes") if (first / "cgroup.procs").exists() else None


def control_group(tool):
    """A control group whose memory is too little for the picture: no kill, but a line."""
    groups = memory_groups()
    if groups is None:
        return 0, "no control group could be made", None
    group = groups[0] / f"raylane-faults-{os.getpid()}"
    try:
        group.mkdir()
        (group / groups[1]).write_text(str(64 << 20), encoding="ascii")
    except OSError:
        if group.exists():
            group.rmdir()
        return 0, "no control group could be made", None
    target = tool.place("group")
    codes = collections.Counter()
    why = None
    try:
        for size in ("64x64", "2048x2048", "8192x8192"):
            command = ["sh", "-c", 'echo $$ >"$0/cgroup.procs"; exec "$@"', str(group),
                       tool.program, SCENE, "-o", str(target), "-r", size, "--spp", "1", "-q",
                       "--env", "none"]
            run = runs.run(command, timeout_s=120)
            why = why or run.crash
            codes[run.exit_code] += 1
            target.write_bytes(OLD)
    finally:
        group.rmdir()
    text = ", ".join(f"{count} exit code {code}" for code, count in sorted(codes.items()))
    return sum(codes.values()), text, why


def shrinking(tool, count):
    """A file of 256 MB that is cut while it is read; it is no scene in any case."""
    target = tool.place("shrinking")
    scene = tool.folder / "large.glb"
    codes = collections.Counter()
    why = None
    for _ in range(count):
        with open(scene, "wb") as file:
            file.truncate(256 << 20)
        cut = threading.Timer(tool.rng.uniform(0, 0.15), os.truncate, (scene, 1 << 20))
        cut.start()
        run = tool.run(scene, "-o", target)
        cut.join()
        why = why or run.crash
        if run.exit_code not in (1, 3) or target.read_bytes() != OLD:
            why = why or "the old picture is lost"
        is_noticed = "changed while it was read" in run.stderr
        codes["noticed" if is_noticed else "cut too early or too late"] += 1
    scene.unlink()
    return count, ", ".join(f"{number} {what}" for what, number in sorted(codes.items())), why


def connections(tool):
    """A scene by a socket that breaks, by a pipe that ends early, from a folder."""
    scene = tool.folder / "s.pbrt"
    scene.write_bytes(b"WorldBegin\n" + b"# A comment.\n" * 20000 + b'Shape "sp')
    target = tool.place("connections")
    why = None
    said = []
    for how in ("socket", "pipe", "folder"):
        command = tool.command("-", "-o", target)
        if how == "folder":
            handle = os.open(tool.folder, os.O_RDONLY)
            run = runs.run(command, timeout_s=60, stdin=handle)
            os.close(handle)
        elif how == "pipe":
            read, write = os.pipe()
            threading.Thread(target=feed, args=(write, scene.read_bytes())).start()
            run = runs.run(command, timeout_s=60, stdin=read)
            os.close(read)
        else:
            ours, theirs = socket.socketpair()
            theirs.sendall(b"unread")  # What makes the end of it an error, not an end.
            ours.sendall(scene.read_bytes()[:1000])
            threading.Timer(0.3, ours.close).start()
            run = runs.run(command, timeout_s=60, stdin=theirs.fileno())
            theirs.close()
        why = why or run.crash or (None if run.exit_code in (1, 3) else f"exit {run.exit_code}")
        if target.read_bytes() != OLD:
            why = why or "the old picture is lost"
        said.append(f"{how}: {(run.errors + ['nothing'])[0].split(': ', 2)[-1]}")
    return len(said), "; ".join(said), why


def feed(handle, data):
    """Writes into a pipe and closes it."""
    with os.fdopen(handle, "wb") as file:
        file.write(data)


def clocks(tool):
    """Clocks of a name space of its own that have run for a hundred years."""
    new, _ = expected(tool, SCENE)
    target = tool.place("clocks")
    command = ["unshare", "--time", "--fork", "--monotonic=3155760000", "--boottime=3155760000",
               *tool.command(SCENE, "-o", target)]
    if shutil.which("unshare") is None:
        return 0, "no unshare", None
    run = runs.run(command, timeout_s=60)
    if not run.lines and run.exit_code == 0:
        return 1, "the same picture", None if target.read_bytes() == new else "another picture"
    if any("unshare" in line for line in run.lines):
        return 0, "no name space could be made", None
    return 1, run.stderr.strip(), run.crash or "an error"


def main():
    """Prints the table."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("program")
    parser.add_argument("--kills", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", default="", help="faults whose names contain this")
    options = parser.parse_args()
    faults = [
        ("killed at random", lambda tool: kills(tool, options.kills)),
        ("ended by SIGTERM, SIGINT", lambda tool: ends(tool, max(1, options.kills // 4))),
        ("files that may not grow", full_disk),
        ("a full file system", full_file_system),
        ("small stacks", stacks),
        ("few descriptors", descriptors),
        ("little address space", address_space),
        ("a control group", control_group),
        ("a file that shrinks", lambda tool: shrinking(tool, max(1, options.kills // 10))),
        ("connections that break", connections),
        ("clocks far ahead", clocks),
    ]
    rows = []
    bad = 0
    for name, fault in faults:
        if options.only not in name:
            continue
        with tempfile.TemporaryDirectory() as folder:
            count, text, why = fault(Tool(options, pathlib.Path(folder)))
        bad += why is not None
        rows.append([name, str(count), text, why or ("good" if count else "not tried")])
    print(runs.table(["fault", "runs", "what came", "verdict"], rows))
    return bad > 0


if __name__ == "__main__":
    sys.exit(main())
