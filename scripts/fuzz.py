# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs every libFuzzer program (NAME_fuzz.cpp anywhere below native/) for some seconds with ASan and UBSan.

Saved inputs lie in seeds/NAME/ beside it; what a run adds to the corpus stays below build/.
"""

import argparse
import os
import shutil
import sys

from native_build import build_sanitized
from parts import BUILD, ROOT, Tally, require_in_tree, run, say
from work_queue import QUEUE


def fuzzers():
    return sorted((ROOT / "native").rglob("*_fuzz.cpp"))


def fuzz(seconds, weight=0):
    tally = Tally()
    for part in QUEUE.map(weight, lambda source: fuzz_one(source, seconds), fuzzers()):
        tally.add(part)
    return tally


def fuzz_one(source, seconds):
    tally = Tally()
    program = BUILD / "sanitize" / "bin" / source.stem
    name = f"fuzz: {source.stem}"
    if not program.exists():
        tally.failed.append((name, "was not built"))
        return tally
    corpus = BUILD / "fuzz" / source.stem
    corpus.mkdir(parents=True, exist_ok=True)
    finding = BUILD / "fuzz" / f"{source.stem}-finding-"
    seeds = source.parent / "seeds" / source.stem.removesuffix("_fuzz")
    command = [program, f"-max_total_time={seconds}", "-timeout=10", "-rss_limit_mb=2560"]
    command += ["-print_final_stats=1", f"-artifact_prefix={finding}", corpus]
    if seeds.is_dir():
        command.append(seeds)
    done = run(f"fuzz-{source.stem}", command, limit=seconds + 120)
    if tally.check(name, done.status == 0, done.reason() + "\n" + done.tail(30)):
        runs = [line for line in done.tail().splitlines() if "number_of_executed_units" in line]
        say(f"  {source.stem}: {runs[0].split()[-1] if runs else '?'} inputs in {done.seconds:.0f} s")
    return tally


def main():
    require_in_tree()
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=int, default=60)
    parser.add_argument("--clean", action="store_true", help="forget the corpus of earlier runs")
    options = parser.parse_args()
    if options.clean:
        shutil.rmtree(BUILD / "fuzz", ignore_errors=True)
    say("Building the fuzzers (clang, ASan, UBSan; log: build/logs/build-sanitize.log)")
    built = build_sanitized(os.cpu_count() or 1, fuzzers_only=True)
    if built.status != 0:
        say(built.tail())
        return 1
    say(f"{len(fuzzers())} parsers, {options.seconds} s each")
    tally = fuzz(options.seconds)
    for name, detail in tally.failed:
        say(f"FAILED {name}\n{detail}")
    say(str(tally))
    return 1 if tally.failed else 0


if __name__ == "__main__":
    sys.exit(main())
