# SPDX-License-Identifier: GPL-3.0-or-later
"""The two native builds that the tests run: build/release and build/sanitize."""

import json
import math
import os
import pathlib
import subprocess

from parts import BUILD, ROOT, Finished, Tally, run
from work_queue import QUEUE

# What a sanitized program needs to hear. Blender's own libraries leak at exit; ours must not.
SANITIZER_ENVIRONMENT = {
    "ASAN_OPTIONS": "detect_leaks=1:strict_string_checks=1:allocator_may_return_null=1",
    "UBSAN_OPTIONS": "print_stacktrace=1",
    # Accuracy is the optimised build's business; instrumented, these take many minutes.
    "GTEST_FILTER": "-KnownAnswers*:*Validation*:Pins*:*MatchesDifferences*:Gradient.OfALong*:"
    "EquationError.Finds*:SimulationLimits.MasslessNodes*:Quantities.HaveTheirSlopeOrNone:"
    "RenewedGroup.MovesAlikeAtAQuarterOfTheSubstep:RenewedGroup.IsRenewedWhenItsSchedule*:*Flight.InWind*:*Flight.Under*:"
    "*LawOfTests.HasItsDerivatives*:*CorrectedLaw.ThatStiffens*:*CorrectedGradient.AreThoseOf*:"
    "NeutralEffects.HaveDerivatives:UpdatedPublished.TurnsAFreeBody*:*WhatStiffensShortensTheSubstep*:"
    "*GradientOf.FloatsAgreeWithDouble/renewed:*GradientOf.TheForwardPassHas*/renewed:"
    # What the other formulations run, with nodes that are found another way.
    "*ContactKinds.*/renewed_particle:"
    # Each term runs instrumented in one formulation.
    "*EachTerm.*_total:*EachTerm.*_renewed:*AddedTerm.*total:"
    # No sanitizer looks for races.
    "*Flight.HasTheSameBits*:RenewedGroup.GivesTheSameBits*:RenewedGroup.GoesOnFromACheckpoint*",
    "LSAN_OPTIONS": f"suppressions='{ROOT}/scripts/leaks.supp':print_suppressions=0",
}

# Fits and diagnoses of a minute and more, most of which tell again what a shorter one tells.
LONG_TESTS = ["FitLatent.FindsPlasticine", "FitLatent.TheBalanceOf*",
              "FitNeural.FindsAFluidWithoutBeingToldThatItFlows", "FitCorrection.OfTwoBodies*",
              "ImageWeights.OfThePublishedLaw*", "Strangers.AKick*", "Strangers.AGust*",
              "Strangers.NothingIsFoundInABodyThatIsHeld", "Strangers.AnInclusion*",
              "Strangers.AirIsFound*"]

# How many tests run one after another in one process, so that a piece takes about half a minute.
TESTS_A_PIECE = {"test_job": 6, "test_mpm": 12, "test_fit": 20}

# What runs under the sanitizers: the solver, every parser, the fits' core and the job documents.
SANITIZED = ["test_mpm", "test_base", "test_math", "test_capture_readers", "test_fit",
             "test_job_documents"]
# What does not, because each takes minutes to compile so.
UNSANITIZED = {
    "test_bake": "mostly libraries that are not instrumented",
    "test_capture": "mostly libraries that are not instrumented",
    "test_job": "mostly libraries that are not instrumented",
    "test_capi": "mostly libraries that are not instrumented",
    "test_material": "arithmetic on numbers that it holds itself; laws run instrumented in test_mpm",
}


def _configure_and_build(name, settings, targets, limit, jobs):
    folder = BUILD / name
    configure = ["cmake", "-S", ROOT, "-B", folder, "-G", "Ninja", *settings]
    done = run(f"configure-{name}", configure)
    if done.status != 0:
        return done
    return run(f"build-{name}", ["ninja", f"-j{jobs}", "-C", folder, *targets], limit=limit)


def build_release() -> Finished:
    """Everything with g++, optimised, warnings as errors, and the tool and library put in place."""
    return run("build-release", ["bash", ROOT / "scripts" / "build.sh", "all"], limit=2400)


def build_sanitized(jobs, fuzzers_only=False) -> Finished:
    """Tests and fuzzers with clang, AddressSanitizer and UBSan; the second compiler's warnings too."""
    settings = [
        "-DCMAKE_C_COMPILER=clang-14",
        "-DCMAKE_CXX_COMPILER=clang++-14",
        "-DCMAKE_BUILD_TYPE=Release",
        "-DCMAKE_CXX_FLAGS_RELEASE=-O1",
        "-DMATTERFIT_TOGETHER=ON",
        "-DMATTERFIT_SANITIZE=ON",
        "-DMATTERFIT_FUZZ=ON",
        "-DMATTERFIT_WERROR=ON",
        "-DMATTERFIT_BENCH=OFF",
    ]
    targets = [f.stem for f in sorted((ROOT / "native").rglob("*_fuzz.cpp"))]
    if not fuzzers_only:
        targets += SANITIZED
    return _configure_and_build("sanitize", settings, targets, 3600, jobs)


def release_tests():
    """The test programs that build/release is configured to have, as CTest knows them: its bin/ keeps
    those of tests that are gone from the tree. Empty where it is not configured."""
    command = ["ctest", "--test-dir", BUILD / "release", "--show-only=json-v1"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        return []
    # CTest leaves the command out where the program is not there.
    folder = BUILD / "release" / "bin"
    return sorted(
        pathlib.Path(test.get("command", [folder / f"test_{test['name']}"])[0])
        for test in json.loads(done.stdout)["tests"]
    )


def run_gtests(programs, prefix, *, weight, limit, env=None) -> Tally:
    """Runs the programs' tests in pieces; most tests have one thread's work."""
    tally = Tally()
    running = []
    for program in programs:
        count = _count_tests(program, env)
        pieces = max(1, math.ceil(count / TESTS_A_PIECE.get(program.name, 40)))
        futures = [
            QUEUE.submit(weight, run_gtest, program, prefix, limit=limit, env=env, piece=(k, pieces))
            for k in range(pieces)
        ]
        running.append((program, count, futures))
    for program, count, futures in running:
        part = Tally()
        for future in futures:
            part.add(future.result())
        ran = len(part.passed) + len(part.failed) + len(part.skipped)
        if not part.failed and ran != count:
            part.failed.append((f"{prefix}: {program.name}", f"ran {ran} of its {count} tests"))
        tally.add(part)
    return tally


def _count_tests(program, env):
    """How many tests a program has that the filter lets through; 0 where it cannot be started."""
    if not program.exists():
        return 0
    command = [program, "--gtest_list_tests"]
    whole = {**os.environ, **(env or {})}
    done = subprocess.run(command, capture_output=True, text=True, check=False, env=whole)
    return sum(line.startswith("  ") for line in done.stdout.splitlines()) if done.returncode == 0 else 0


def run_gtest(program, prefix, *, limit, env=None, piece=(0, 1)) -> Tally:
    """Runs every n-th test of a GoogleTest program and counts them; a crash counts the program as failed."""
    tally = Tally()
    index, pieces = piece
    name = f"{prefix}: {program.name}"
    slug = f"{prefix}-{program.name}" + (f"-{index + 1}" if pieces > 1 else "")
    report = BUILD / "logs" / f"{slug}.json"
    report.unlink(missing_ok=True)
    if not program.exists():
        tally.failed.append((name, "was not built"))
        return tally
    env = {**(env or {}), "GTEST_TOTAL_SHARDS": str(pieces), "GTEST_SHARD_INDEX": str(index)}
    done = run(slug, [program, f"--gtest_output=json:{report}"], limit=limit, env=env)
    if report.exists():
        for suite in json.loads(report.read_text(encoding="utf-8"))["testsuites"]:
            for test in suite["testsuite"]:
                full = f"{prefix}: {suite['name']}.{test['name']}"
                if test.get("failures"):
                    detail = "\n".join(f["failure"] for f in test["failures"])
                    tally.failed.append((full, detail))
                elif test.get("result") == "SKIPPED":
                    reasons = [s.get("message", "") for s in test.get("skipped", [])]
                    tally.skipped.append((full, " ".join(reasons).strip()))
                elif test.get("status") == "NOTRUN":
                    tally.skipped.append((full, "switched off in the code"))
                else:
                    tally.passed.append(full)
    if done.status != 0 and not tally.failed:
        tally.failed.append((name, f"{done.reason()}\n{done.tail(60)}"))
    elif not report.exists():
        tally.failed.append((name, "left no report"))
    return tally
