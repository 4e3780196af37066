# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs every test of the tree and closes with one line: `N passed, N failed, N skipped`.

    test.py            all parts, in order
    test.py PART …     only these (test.py --list names them)
"""

import argparse
import concurrent.futures
import datetime
import json
import os
import shutil
import sys
import threading
import time
import traceback

import fuzz
import lint
import package
from blender_versions import VERSIONS, bpy_python
from native_build import (
    LONG_TESTS,
    SANITIZED,
    SANITIZER_ENVIRONMENT,
    UNSANITIZED,
    build_release,
    build_sanitized,
    release_tests,
    run_gtests,
)
from parts import BUILD, LOGS, ROOT, SPENT, Tally, end_all, require_in_tree, run, say
from work_queue import QUEUE

RUNNER = ROOT / "blender_tests" / "run.py"
# The last two: tests that need the library, or Slurm, fail without it, where a person's own run would
# skip them.
LIBRARY = {
    "MATTERFIT_LIBRARY": str(BUILD / "lib" / "libmatterfit.so"),
    "MATTERFIT_REQUIRE_LIBRARY": "1",
    "MATTERFIT_REQUIRE_SLURM": "1",
}
# What a piece of a part's work weighs in the queue: first the instrumented build, which two parts wait for,
# then what takes minutes in one process, then the tests that had to wait.
BUILD_WEIGHT, WINDOW_WEIGHT, BLENDER_WEIGHT, SANITIZED_WEIGHT, PIECE_WEIGHT = 5000, 600, 500, 200, 100
BUILDS = {}  # futures of what parts wait for


def part_build():
    """g++, warnings as errors"""
    tally = Tally()
    done = build_release()
    tally.check("build: release", done.status == 0, done.tail(60))
    return tally


def part_lint():
    """clang-format, licence lines, ruff, clang-tidy on changed files"""
    return lint.lint()


def part_native():
    """native tests, optimised; those that tell again what a shorter one tells only where LONG is set"""
    tally = Tally()
    programs = release_tests()
    tally.check("native: test programs", bool(programs), "CTest lists none in build/release")
    env = {} if os.environ.get("LONG") else {"GTEST_FILTER": "-" + ":".join(LONG_TESTS)}
    tally.add(run_gtests(programs, "native", weight=PIECE_WEIGHT, limit=900, env=env))
    if env:
        tally.skipped += [(f"native: {name}", "takes a minute (make test LONG=1)") for name in LONG_TESTS]
    return tally


def part_sanitize():
    """the same native tests under ASan and UBSan (clang)"""
    tally = Tally()
    done = BUILDS["sanitize"].result()
    if not tally.check("build: sanitize", done.status == 0, done.tail(60)):
        return tally
    programs = [BUILD / "sanitize" / "bin" / name for name in SANITIZED]
    tally.add(run_gtests(programs, "sanitize", weight=SANITIZED_WEIGHT, limit=1500,
                         env=SANITIZER_ENVIRONMENT))
    tally.skipped += [(f"sanitize: {name}", reason) for name, reason in UNSANITIZED.items()]
    return tally


def run_unittests(name, weight, limit):
    """The tally of scripts/test_NAME.py."""
    tally = Tally()
    command = [sys.executable, "-B", ROOT / "scripts" / f"test_{name}.py", "-v"]
    done = QUEUE.submit(weight, run, name, command, limit=limit).result()
    lines = done.log.read_text(encoding="utf-8", errors="replace").splitlines()
    tally.passed += [f"{name}: {line.split(' ')[0]}" for line in lines if line.endswith(" ... ok")]
    tally.skipped += [(f"{name}: {line.split(' ')[0]}", line.split(" ... skipped ")[1].strip("'"))
                      for line in lines if " ... skipped " in line]
    tally.check(f"{name}: all", done.status == 0, f"{done.reason()}\n{done.tail(40)}")
    return tally


def part_blind():
    """the blind benchmark's scorer, seal and finite elements"""
    return run_unittests("blind", PIECE_WEIGHT, 900)


def part_page():
    """the page of a diagnosis in headless Chromium, with screenshots"""
    return run_unittests("page", WINDOW_WEIGHT, 600)


def part_fuzz():
    """each parser five seconds of libFuzzer from its saved seeds"""
    BUILDS["sanitize"].result()
    return fuzz.fuzz(5, SANITIZED_WEIGHT)


def read_record(prefix, done, report):
    """The tally of a run of blender_tests/run.py; a run that left no report counts as one failure."""
    tally = Tally()
    if not report.exists():
        tally.failed.append((f"{prefix}: {RUNNER.name}", f"{done.reason()}, no report\n{done.tail(60)}"))
        return tally
    record = json.loads(report.read_text(encoding="utf-8"))
    tally.passed += [f"{prefix}: {name}" for name in record["passed"]]
    tally.failed += [(f"{prefix}: {f['name']}", f["detail"]) for f in record["failed"]]
    tally.skipped += [(f"{prefix}: {s['name']}", s["reason"]) for s in record["skipped"]]
    if done.status != 0 and not tally.failed:
        tally.failed.append((f"{prefix}: {RUNNER.name}", f"{done.reason()}\n{done.tail(60)}"))
    return tally


def user_folder(name):
    """A bare Blender user folder, so that no part sees what another left."""
    folder = BUILD / "users" / name
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    return {"BLENDER_USER_RESOURCES": str(folder), "HOME": str(folder)}


def run_blender_tests(name, program, *patterns):
    report = LOGS / f"{name}.json"
    report.unlink(missing_ok=True)
    env = {**LIBRARY, **user_folder(name)}
    done = run(name, [*program, "--json", report, *patterns], limit=1200, env=env)
    return read_record(name, done, report)


BLENDER = ["blender", "-b", "--factory-startup", "--python-exit-code", "1", "-P", RUNNER, "--"]


def part_blender():
    """blender_tests under `blender -b`"""
    return QUEUE.submit(BLENDER_WEIGHT, run_blender_tests, "blender", BLENDER).result()


def part_window():
    """the panel in a real window under Xvfb, with a screenshot; docs/start.md followed there"""
    return QUEUE.submit(WINDOW_WEIGHT, run_windows).result()


def run_windows():
    tally = Tally()
    script = ROOT / "blender_tests" / "window.py"
    picture = BUILD / "screenshots" / "panel.png"
    if not script.exists():
        tally.skipped.append(("window: panel", "blender_tests/window.py is not there"))
        return tally
    picture.parent.mkdir(parents=True, exist_ok=True)
    picture.unlink(missing_ok=True)
    env = {**LIBRARY, **user_folder("window"), "LIBGL_ALWAYS_SOFTWARE": "1"}
    screen = ["xvfb-run", "-a", "-s", "-screen 0 1400x900x24"]
    blender = ["blender", "--factory-startup", "--python-exit-code", "1", "-P", script, "--", picture]
    done = run("window", [*screen, *blender], limit=1600, env=env)
    ok = done.status == 0 and picture.exists() and picture.stat().st_size > 10_000
    tally.check("window: panel", ok, f"{done.reason()}\n{done.tail(40)}")
    if ok:
        say(f"  screenshot: {picture.relative_to(ROOT)}")
    script = ROOT / "blender_tests" / "follow_start.py"
    env = {**env, **user_folder("start")}
    blender = [*blender[:-3], script, "--", picture.parent]
    done = run("start", [*screen, *blender], limit=1600, env=env)
    tally.check("window: docs/start.md", done.status == 0, f"{done.reason()}\n{done.tail(40)}")
    return tally


def part_package():
    """the zip: built, carrying its own libraries, installed in a bare user folder, a job run with it"""
    tally = Tally()
    try:
        archive = QUEUE.submit(BLENDER_WEIGHT, package.build_package).result()
    except package.PackageError as error:
        tally.failed.append(("package: build", str(error)))
        return tally
    tally.passed.append("package: build")
    try:
        package.require_small(archive, most=1000)
        tally.failed.append(("package: size", "an archive above the most is not refused"))
    except package.PackageError:
        tally.passed.append("package: size")
    same = QUEUE.submit(BLENDER_WEIGHT, package.is_deterministic, archive).result()
    tally.check("package: same bytes again", same, "two builds of it differ")
    script = ROOT / "scripts" / "check_package.py"
    programs = {"3.4": ["blender", "-b", "--factory-startup", "--python-exit-code", "1", "-P", script, "--"]}
    for version in VERSIONS:
        python, reason = bpy_python(version)
        if python:
            programs[f"bpy {version}"] = [python, script]
        else:
            tally.skipped.append((f"package: bpy {version}", reason))

    def installed(name):
        slug = "package-" + name.replace(" ", "-")
        return run(slug, [*programs[name], archive], limit=300, env=user_folder(slug))

    for name, done in zip(programs, QUEUE.map(PIECE_WEIGHT, installed, programs), strict=True):
        ok = done.status == 0 and "package works" in done.tail(20)
        tally.check(f"package: installed and run in {name}", ok, f"{done.reason()}\n{done.tail(40)}")
    return tally


# Versions between the oldest and the newest, which run nearly all tests: what a version may change under
# the add-on. Bakes, a minute of the solver's work each time, are run by those two, and by the package's
# check in all.
BETWEEN = ["test_register", "test_panels", "test_document", "test_operators"]
WHOLE = list(VERSIONS)[-1]
# Minutes of the library's own work, which are the same in each version.
IN_ONE_VERSION = ["test_filling", "test_resolution", "test_estimate", "test_cancel", "test_fit_native"]


def part_bpy():
    """the Blender tests on the bpy wheels, side by side"""
    tally = Tally()
    programs = {}
    for version in VERSIONS:
        python, reason = bpy_python(version)
        if python:
            programs[f"bpy-{version}"] = [python, RUNNER]
            continue
        tally.skipped.append((f"bpy {version}", reason))
        if version == "4.5" and os.environ.get("CI"):
            tally.failed.append(("bpy 4.5", f"must run where CI is set, but: {reason}"))

    def tested(name):
        chosen = [f"--without={file}" for file in IN_ONE_VERSION] if name == f"bpy-{WHOLE}" else BETWEEN
        return run_blender_tests(name, programs[name], *chosen)

    # The newest, which runs all of them, first.
    for part in QUEUE.map(BLENDER_WEIGHT, tested, reversed(programs)):
        tally.add(part)
    return tally


PARTS = {
    "build": part_build,
    "lint": part_lint,
    "native": part_native,
    "sanitize": part_sanitize,
    "blind": part_blind,
    "page": part_page,
    "fuzz": part_fuzz,
    "blender": part_blender,
    "window": part_window,
    "package": part_package,
    "bpy": part_bpy,
}
# What a part runs with must be built in this run, not be what an earlier one left.
NEEDS_BUILD = {"native", "page", "blender", "window", "package", "bpy", "lint"}
NEEDS_SANITIZE = {"fuzz"}
ON_SANITIZED = {"sanitize", "fuzz"}
# The bpy wheels are fetched for these while the compiler is busy.
NEEDS_BPY = {"package", "bpy"}

LISTED = 20  # commands that took the most processor time


def chosen_parts(names):
    if not names:
        return list(PARTS)
    parts = [p for p in PARTS if p in names]
    if NEEDS_BUILD & set(parts) and "build" not in parts:
        parts.insert(0, "build")
    if NEEDS_SANITIZE & set(parts) and "sanitize" not in parts:
        parts.insert(parts.index("fuzz"), "sanitize")
    return parts


def fetch_bpy():
    for version in VERSIONS:
        bpy_python(version)


def run_part(name):
    """Runs one part and says what came of it."""
    say(f"[{name}] {PARTS[name].__doc__}")
    begun = time.monotonic()
    try:
        tally = PARTS[name]()
    except Exception:  # the other parts go on, and their tests count
        tally = Tally(failed=[(f"{name}: the part itself", traceback.format_exc())])
    lines = [f"  FAILED {test}\n    " + detail.strip().replace("\n", "\n    ") for test, detail in tally.failed]
    lines += [f"  skipped {test}: {reason}" for test, reason in tally.skipped]
    took = datetime.timedelta(seconds=round(time.monotonic() - begun))
    say("\n".join([*lines, f"  {name}: {tally} in {took}"]))
    return tally


def main():
    require_in_tree()
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("parts", nargs="*", metavar="PART")
    parser.add_argument("--list", action="store_true")
    options = parser.parse_args()
    unknown = set(options.parts) - set(PARTS)
    if options.list or unknown:
        for name, part in PARTS.items():
            say(f"  {name:9} {part.__doc__}")
        return 2 if unknown else 0

    started = time.monotonic()
    total = Tally()
    parts = chosen_parts(options.parts)
    say(f"Testing {ROOT} in {len(parts)} parts; logs in {LOGS.relative_to(ROOT)}/")
    if NEEDS_BPY & set(parts):
        threading.Thread(target=fetch_bpy, daemon=True).start()
    if "build" in parts:
        parts.remove("build")
        total.add(run_part("build"))
    if total.failed:
        say("Nothing else can run without the build.")
    elif parts:
        if ON_SANITIZED & set(parts):
            cores = os.cpu_count() or 1
            # Half of the processors, and one more, so that none waits should the others' work end first.
            jobs = cores if ON_SANITIZED >= set(parts) else cores // 2 + 1
            BUILDS["sanitize"] = QUEUE.submit(BUILD_WEIGHT, build_sanitized, jobs)
        # A thread a part hands its pieces to the queue, in which the processors are the parts' common.
        pool = concurrent.futures.ThreadPoolExecutor(len(parts))
        for tally in pool.map(run_part, parts):
            total.add(tally)
    took = datetime.timedelta(seconds=round(time.monotonic() - started))
    say(f"Took {took}; {sum(spent for spent, _, _ in SPENT) / 60:.0f} minutes of processor time, the most in:")
    for spent, seconds, name in sorted(SPENT, reverse=True)[:LISTED]:
        say(f"  {name:28} {spent:6.0f} s, {seconds:6.0f} s by the clock")
    if total.failed:
        say("Failed: " + ", ".join(test for test, _ in total.failed))
    say(str(total))
    return 1 if total.failed else 0


if __name__ == "__main__":
    try:
        sys.exit(main())
    except KeyboardInterrupt:
        end_all()
        say("Interrupted.")
        os._exit(130)  # not to wait for the parts' threads
