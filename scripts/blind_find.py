# SPDX-License-Identifier: GPL-3.0-or-later
"""Diagnoses the cases that blind_hide.py wrote: the second of the three programs of the blind benchmark.

    blind_find.py SET [--only CASE …] [--jobs N] [--threads N] [--tool FILE] [--again] [--limit SECONDS]
                  [--particles N]

It sees of each case of build/blind/SET/cases the recording and what the scene is said to be (facts.json, or
a document job.json), as a stranger would: `matterfit new-job` writes the document, `matterfit diagnose` the
report. Never opens `sealed`. Writes build/blind/SET/found/CASE/found.json when a case is done; what is done
by the same tool is not done again, what was broken off goes on. With --particles the scene is taken that
coarse or fine, whatever the facts say, and found_N is written: one recording at several resolutions.
"""

import argparse
import concurrent.futures
import hashlib
import json
import os
import pathlib
import resource
import signal
import subprocess
import sys
import time

from parts import BUILD, require_in_tree, say


def write_whole(path, value):
    """A file that is there is whole."""
    part = path.with_suffix(".part")
    part.write_text(json.dumps(value, indent=1), encoding="utf-8")
    os.replace(part, path)


class Finder:
    def __init__(self, options):
        self.options = options
        self.folder = BUILD / "blind" / options.set
        self.version = hashlib.sha256(options.tool.read_bytes()).hexdigest()

    def run_tool(self, log, *arguments):
        """Exit status (negative: the signal), seconds of CPU, and the last words of what it said."""
        limit = self.options.limit

        def limited():
            if limit:
                resource.setrlimit(resource.RLIMIT_CPU, (limit, limit + 10))

        with open(log, "ab") as file:
            process = subprocess.Popen([str(a) for a in (self.options.tool, *arguments)], stdout=file, stderr=file,
                                       stdin=subprocess.DEVNULL, preexec_fn=limited)
            _, status, usage = os.wait4(process.pid, 0)
            process.returncode = os.waitstatus_to_exitcode(status)
        words = log.read_text(encoding="utf-8", errors="replace").strip()[-600:]
        return process.returncode, usage.ru_utime + usage.ru_stime, words

    def find(self, case):
        """What found.json says of a case; done before: that."""
        particles = self.options.particles
        work = self.folder / (f"found_{particles}" if particles else "found") / case.name
        work.mkdir(parents=True, exist_ok=True)
        done = work / "found.json"
        if done.exists() and not self.options.again:
            found = json.loads(done.read_text(encoding="utf-8"))
            if found["tool"] == self.version and "report" in found:
                return found
        done.unlink(missing_ok=True)
        log = work / "log.txt"
        log.write_text("", encoding="utf-8")
        job, report = case / "job.json", work / "report.json"
        report.unlink(missing_ok=True)
        started, status, cpu, words = time.monotonic(), 0, 0.0, ""
        if not job.exists():
            job = work / "job.json"
            facts = json.loads((case / "facts.json").read_text(encoding="utf-8"))
            if particles:
                facts["particles"] = particles
            given = [part for key, value in sorted(facts.items()) for part in (f"--{key}", value)]
            status, cpu, words = self.run_tool(log, "new-job", case / "capture.npz", "--output", job, *given)
        if status == 0:
            output = ["--set", f"output.folder={json.dumps(str(work / 'out'))}", "--report", report]
            arguments = ["diagnose", job, "--threads", self.options.threads, *output]
            fresh = self.options.again or not self.same_tool(work)
            status, cpu, words = self.run_tool(log, *arguments, *(["--restart"] if fresh else []))
        found = {
            "case": case.name,
            "tool": self.version,
            "status": status,
            "seconds": time.monotonic() - started,
            "cpu_seconds": cpu,
            "threads": self.options.threads,
        }
        if status == 0:
            found["report"] = json.loads(report.read_text(encoding="utf-8"))
        else:
            found["failed"] = "out of time" if status == -signal.SIGXCPU else words
        write_whole(done, found)
        return found

    def same_tool(self, work):
        """Whether what lies in the output folder was begun by this build; from now on it is."""
        mark = work / "tool"
        same = mark.exists() and mark.read_text(encoding="utf-8") == self.version
        mark.write_text(self.version, encoding="utf-8")
        return same

    def run(self):
        cases = sorted(path for path in (self.folder / "cases").glob("*")
                       if path.name.isdecimal()
                       and (not self.options.only or int(path.name) in self.options.only))
        if not cases:
            sys.exit(f"blind_find.py: {self.folder}/cases holds none; run blind_hide.py first")
        with concurrent.futures.ThreadPoolExecutor(self.options.jobs) as pool:
            for found in pool.map(self.find, cases):
                say(line_of(found))


def line_of(found):
    if "failed" in found:
        return f"{found['case']}: FAILED after {found['seconds']:.0f} s: {found['failed'].splitlines()[-1:]}"
    report = found["report"]
    return f"{found['case']}: {report['verdict']} {', '.join(report['class'])} (CPU {found['cpu_seconds']:.0f} s)"


def main():
    require_in_tree()
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("set", choices=["small", "full"])
    parser.add_argument("--only", nargs="*", type=int, default=[], help="numbers of cases")
    parser.add_argument("--jobs", type=int, default=1, help="cases at a time")
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--limit", type=int, help="seconds of CPU that a case may take")
    parser.add_argument("--particles", type=int, help="of the claimed scene, about, in place of the facts'")
    parser.add_argument("--again", action="store_true", help="diagnose again what is done")
    parser.add_argument("--tool", type=pathlib.Path, default=BUILD / "bin" / "matterfit")
    Finder(parser.parse_args()).run()
    return 0


if __name__ == "__main__":
    sys.exit(main())
