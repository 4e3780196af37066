# SPDX-License-Identifier: GPL-3.0-or-later
"""The two native builds that the tests run: build/release and build/sanitize."""

import concurrent.futures
import json
import os
import pathlib
import subprocess

from parts import BUILD, ROOT, Finished, Tally, run

# What a sanitized program needs to hear. Blender's own libraries leak at exit; ours must not.
SANITIZER_ENVIRONMENT = {
    "ASAN_OPTIONS": "detect_leaks=1:strict_string_checks=1:allocator_may_return_null=1",
    "UBSAN_OPTIONS": "print_stacktrace=1",
    # Accuracy is the optimised build's business; instrumented, these take many minutes.
    "GTEST_FILTER": "-KnownAnswers*:*Validation*:Pins*:*MatchesDifferences*:Gradient.OfALong*:"
    "EquationError.Finds*:SimulationLimits.MasslessNodes*:Quantities.HaveTheirSlopeOrNone:"
    "RenewedGroup.MovesAlikeAtAQuarterOfTheSubstep",
    "LSAN_OPTIONS": f"suppressions='{ROOT}/scripts/leaks.supp':print_suppressions=0",
}

# Fits of a minute that tell again what a shorter one tells.
LONG_TESTS = ["FitLatent.FindsPlasticine", "FitNeural.FindsAFluidWithoutBeingToldThatItFlows",
              "FitCorrection.OfTwoBodies*"]

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


def _configure_and_build(name, settings, targets, limit):
    folder = BUILD / name
    configure = ["cmake", "-S", ROOT, "-B", folder, "-G", "Ninja", *settings]
    done = run(f"configure-{name}", configure)
    if done.status != 0:
        return done
    return run(f"build-{name}", ["ninja", "-C", folder, *targets], limit=limit)


def build_release() -> Finished:
    """Everything with g++, optimised, warnings as errors, and the tool and library put in place."""
    return run("build-release", ["bash", ROOT / "scripts" / "build.sh", "all"], limit=2400)


def build_sanitized(fuzzers_only=False) -> Finished:
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
    return _configure_and_build("sanitize", settings, targets, limit=2400)


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


def run_gtests(programs, prefix, *, limit, env=None) -> Tally:
    """Runs the programs side by side, as many as there are processors; most have one thread's work."""
    tally = Tally()
    with concurrent.futures.ThreadPoolExecutor(os.cpu_count()) as pool:
        for part in pool.map(lambda program: run_gtest(program, prefix, limit=limit, env=env), programs):
            tally.add(part)
    return tally


def run_gtest(program, prefix, *, limit, env=None) -> Tally:
    """Runs one GoogleTest program and counts its tests; a crash counts the program as failed."""
    tally = Tally()
    name = f"{prefix}: {program.name}"
    report = BUILD / "logs" / f"{prefix}-{program.name}.json"
    report.unlink(missing_ok=True)
    if not program.exists():
        tally.failed.append((name, "was not built"))
        return tally
    done = run(f"{prefix}-{program.name}", [program, f"--gtest_output=json:{report}"], limit=limit, env=env)
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
