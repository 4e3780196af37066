# SPDX-License-Identifier: GPL-3.0-or-later
"""How long runs take beside what `matterfit estimate` said of them, as a table.

    estimates.py [--threads N] [--repeat N] [--only NAME …]

Documents of docs/examples, and the throw of jelly_throw with other presets, baked with what the panel
writes by default. Each is estimated and then run, `--repeat` times in turns; the table has medians, and
the smallest and the largest ratio. What else the machine does is in them. Nothing fails by it.
"""

import argparse
import copy
import json
import shutil
import statistics
import sys
import time

from example_hashes import EXAMPLES, json_of
from parts import BUILD, ROOT, require_in_tree

TOOL = BUILD / "bin" / "matterfit"
FOLDER = BUILD / "estimates"
SIMULATED = ("ball_drop", "dam_break", "sand_column")
THROWN = ("jelly", "water", "sand", "honey", "plasticine")
OUTPUT = {"volume": ["surface"], "points": True, "attributes": ["velocity"]}


def documents():
    """[(name, task, job document)]"""
    found = [(name, "simulate", json.loads((EXAMPLES / f"{name}.json").read_text())) for name in SIMULATED]
    throw = json.loads((EXAMPLES / "jelly_throw.json").read_text())
    for name in THROWN:
        preset = json.loads((ROOT / "presets" / "materials" / f"{name}.json").read_text())
        document = copy.deepcopy(throw)
        document["scene"]["bodies"][0].update(material=preset["material"], density=preset["density"])
        document["output"] = dict(OUTPUT)
        found.append((f"jelly_throw of {name}", "bake", document))
    return found


def measured(name, task, document, threads):
    """(the estimate, what asking for it took [s], the run, what that took [s])"""
    folder = FOLDER / name.replace(" ", "_")
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    document.setdefault("output", {})["folder"] = "run"
    path = folder / "job.json"
    path.write_text(json.dumps(document, indent=2))
    options = ["--json", "--quiet", "--threads", threads]
    began = time.monotonic()
    foreseen = json_of([TOOL, "estimate", path, *options])
    asked = time.monotonic() - began
    began = time.monotonic()
    done = json_of([TOOL, task, path, *options])
    took = time.monotonic() - began
    shutil.rmtree(folder)
    return foreseen, asked, done, took


def row(name, tries):
    """A line of the table."""
    foreseen, _asked, done, _took = tries[0]
    ratios = [one["seconds"] / took for one, _asked, _done, took in tries]
    asked, seconds, took, ratio = (statistics.median(values) for values in (
        [one[1] for one in tries], [one[0]["seconds"] for one in tries], [one[3] for one in tries], ratios))
    return (f"| {name} | {foreseen['particles']} | {foreseen['substeps']:.0f} ({done['substeps']}) | "
            f"{asked:.1f} | {seconds:.1f} | {took:.1f} | {ratio:.2f} ({min(ratios):.2f} to "
            f"{max(ratios):.2f}) |")


def main():
    require_in_tree()
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--threads", type=int, default=0, help="0: as many as the machine has")
    parser.add_argument("--repeat", type=int, default=1)
    parser.add_argument("--only", nargs="+", help="names that contain one of these")
    options = parser.parse_args()
    print("| run | particles | substeps estimated (done) | asking, s | estimated, s | took, s | ratio |")
    print("|---|---|---|---|---|---|---|", flush=True)
    for name, task, document in documents():
        if not options.only or any(word in name for word in options.only):
            tries = [measured(name, task, document, options.threads) for _ in range(options.repeat)]
            print(row(name, tries), flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
