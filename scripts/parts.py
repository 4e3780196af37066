# SPDX-License-Identifier: GPL-3.0-or-later
"""What every script here needs: the tree's folders, a logged command, and a tally of tests."""

import contextlib
import dataclasses
import os
import pathlib
import signal
import subprocess
import sys
import time

ROOT = pathlib.Path(__file__).resolve().parent.parent
BUILD = ROOT / "build"
LOGS = BUILD / "logs"
SPENT = []  # (processor seconds, seconds, name) of each command that was run
_running = set()  # process groups of the commands that run now


def say(text):
    """One line of progress, at once."""
    print(text, flush=True)


@dataclasses.dataclass
class Tally:
    """Tests of one part: names that passed, (name, detail) that failed, (name, reason) skipped."""

    passed: list = dataclasses.field(default_factory=list)
    failed: list = dataclasses.field(default_factory=list)
    skipped: list = dataclasses.field(default_factory=list)

    def add(self, other):
        self.passed += other.passed
        self.failed += other.failed
        self.skipped += other.skipped

    def check(self, name, ok, detail=""):
        """Counts one test that passed or failed."""
        if ok:
            self.passed.append(name)
        else:
            self.failed.append((name, detail))
        return ok

    def __str__(self):
        return f"{len(self.passed)} passed, {len(self.failed)} failed, {len(self.skipped)} skipped"


@dataclasses.dataclass
class Finished:
    """A command that has ended: exit status (negative: the signal; 124: out of time) and its log."""

    status: int
    log: pathlib.Path
    seconds: float
    processor_seconds: float = 0.0  # of it and of all that it waited for

    def tail(self, lines=40):
        text = self.log.read_text(encoding="utf-8", errors="replace").splitlines()
        return "\n".join(text[-lines:])

    def reason(self):
        if self.status == 124:
            return f"ran longer than its limit ({self.seconds:.0f} s)"
        if self.status < 0:
            return f"was ended by signal {-self.status}"
        return f"ended with status {self.status}"


def run(name, command, *, limit=600, env=None, cwd=ROOT):
    """Runs `command` with its output in build/logs/NAME.log; never raises for a failing command."""
    LOGS.mkdir(parents=True, exist_ok=True)
    log = LOGS / f"{name}.log"
    started = time.monotonic()
    with open(log, "wb") as file:
        file.write(("$ " + " ".join(map(str, command)) + "\n").encode())
        file.flush()
        process = subprocess.Popen(
            [str(c) for c in command],
            stdout=file,
            stderr=subprocess.STDOUT,
            stdin=subprocess.DEVNULL,
            cwd=cwd,
            env={**os.environ, **(env or {})},
            start_new_session=True,
        )
        _running.add(process.pid)
        # Not Popen.wait(), which does not say what processor time the command took.
        ended, status, usage = os.wait4(process.pid, os.WNOHANG)
        out_of_time = False
        while not ended:
            time.sleep(0.05)
            if not out_of_time and time.monotonic() - started > limit:
                os.killpg(process.pid, 9)
                out_of_time = True
            ended, status, usage = os.wait4(process.pid, os.WNOHANG)
        _running.discard(process.pid)
        process.returncode = os.waitstatus_to_exitcode(status)
    status = 124 if out_of_time else process.returncode
    done = Finished(status, log, time.monotonic() - started, usage.ru_utime + usage.ru_stime)
    SPENT.append((done.processor_seconds, done.seconds, name))
    return done


def end_all():
    """Ends what run() has started, each in a session of its own that hears of no Ctrl-C."""
    for group in list(_running):
        with contextlib.suppress(ProcessLookupError):
            os.killpg(group, signal.SIGTERM)


def require_in_tree():
    """Leaves unless scripts/in_tree.sh set the folders: nothing may be written outside build/."""
    if os.environ.get("MATTERFIT_ROOT") != str(ROOT):
        sys.exit("Run this through the Makefile, or: scripts/in_tree.sh python " + sys.argv[0])
