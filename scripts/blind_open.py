# SPDX-License-Identifier: GPL-3.0-or-later
"""Opens the labels and scores what was found: the last of the three programs of the blind benchmark.

    blind_open.py SET [--throws] [--tool FILE]

Refuses labels or cases whose hashes are not those of seal.json, and verdicts of different builds of the
tool. --throws also simulates the fitted and the extended model for another throw of the same body, which
nobody has fitted, and compares. Writes build/blind/SET/table.md and scores.json; the table on standard
output.
"""

import argparse
import hashlib
import json
import pathlib
import subprocess
import sys

import blind_scoring as scoring
import numpy as np
from parts import BUILD, require_in_tree, say

# What is asked of each figure at least (or at most), by the tier where it differs.
ASKED = {
    "false_alarms": "≤ 5 % (T0), ≤ 10 %",
    "first": "≥ 98 % (T0), 90 % (T1), 80 % (T2)",
    "precision": "≥ 95 %",
    "pairs": "≥ 70 %",
    "unknown_found": "≥ 80 %",
    "unknown_said": "≤ 5 %",
    "not_observable": "≥ 95 %",
    "false_names": "≤ 10 %",
    "beats_field": "≥ 80 %",
    "parameter_error": "≤ .15",
    "covered": "80–97 %",
    "bias": "≤ .2",
    "gain": "≥ .9",
    "minutes": "≤ 10",
}
WORDS = {
    "cases": "cases", "failed": "not diagnosed", "false_alarms": "false alarms, nothing hidden",
    "first": "class first, strength ≥ 2 σ", "in_class": "true name's class among those named, strength ≥ 2 σ",
    "precision": "right where a single cause is named", "precision_of_class": "the same, ties count as right",
    "pairs": "two at once, both classes named", "unknown_found": "outside the catalogue, said so",
    "outside_named": "outside the catalogue, a wrong name", "unknown_said": "`unknown` where the catalogue has it",
    "not_observable": "not observable, and not named", "false_names": "false among the names that were said",
    "parameter_error": "relative error of its size, median", "covered": "its 90 % interval holds the truth",
    "bias": "error of the fitted throw after the extension ÷ before, median",
    "beats_field": "better than a free force field on held-out frames", "gain": "median held-out gain where right",
    "again": "median gain on another throw where right", "minutes": "median CPU time a case [min]",
    "excess_mm": "misfit beyond the noise with nothing hidden, median [mm]",
}


def check_seal(folder):
    """Leaves where a sealed file is not the one that was sealed."""
    seal = json.loads((folder / "seal.json").read_text(encoding="utf-8"))
    for name, expected in seal.items():
        path = folder / name
        if not path.exists() or hashlib.sha256(path.read_bytes()).hexdigest() != expected:
            sys.exit(f"blind_open.py: {path} is not what was sealed; hide and find again")
    return seal["sealed/labels.json"]


def one_version(found):
    versions = {f["tool"] for f in found.values()}
    if len(versions) > 1:
        sys.exit(f"blind_open.py: the verdicts are of {len(versions)} builds of the tool; find again with one")
    return versions.pop()


class Thrower:
    """How far models are from a throw that nobody has fitted."""

    def __init__(self, folder, tool):
        self.folder, self.tool = folder, tool

    def error(self, case, model, again, which):
        """Root mean square [m] over frames and points, or None where the model does not run."""
        work = self.folder / "found" / case / "again"
        work.mkdir(exist_ok=True)
        document = json.loads(model.read_text(encoding="utf-8"))
        document.pop("fit", None)
        document["task"] = "compare"
        body = document["scene"]["bodies"][0]
        for source in ("mesh", "points"):
            if source in body["source"]:
                body["source"][source] = str(self.folder / "found" / case / pathlib.Path(body["source"][source]).name)
        body["velocity"], body["spin"] = again["velocity"], again["spin"]
        rest = np.load(self.folder / "cases" / case / "capture.npz")["positions"][0]
        tracks = np.load(self.folder / "sealed" / f"{case}_again.npz")
        known = np.isfinite(rest).all(axis=1)
        np.savez(work / "tracks.npz", positions=tracks["positions"][:, known], times=tracks["times"])
        document["scene"]["fps"] = 1.0 / float(tracks["times"][1] - tracks["times"][0])
        document["scene"]["frames"] = [0, len(tracks["times"])]
        document["captures"] = [{"name": "again", "tracks": "tracks.npz", "noise": 1e-4}]
        document["output"] = {"folder": which}
        path = work / f"{which}.json"
        path.write_text(json.dumps(document), encoding="utf-8")
        done = subprocess.run([self.tool, "compare", path, "--quiet", "--restart"], check=False,
                              stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        if done.returncode != 0:
            return None
        simulated = np.load(work / which / "simulated.npz")["positions"]
        return float(np.sqrt(np.nanmean(np.square(simulated - tracks["positions"][:, known]))))

    def gain(self, case, label):
        """1 − (error after / error before)², of models with and without what was found."""
        out = self.folder / "found" / case / "out"
        if label["tier"] == "T4" or not label["again"]["acts"] or not (out / "extended.json").exists():
            return None
        before = self.error(case, out / "scene.json", label["again"], "before")
        after = self.error(case, out / "extended.json", label["again"], "after")
        return 1.0 - (after / before) ** 2 if before and after else None


def text_of(figure):
    if figure is None:
        return "–"
    if isinstance(figure, dict):
        if figure["value"] is None:
            return "–"
        low, high = figure["interval"]
        return f"{100 * figure['value']:.0f} % ({100 * low:.0f}–{100 * high:.0f}; {figure['count']})"
    return f"{figure:.3g}"


def size_of(row):
    return "" if row["strength"] is None else f"{row['strength']:.1f}"


def tables(rows):
    tiers = [t for t in ("T0", "T1", "T2", "T4") if any(r["tier"] == t for r in rows)]
    columns = {t: scoring.figures([r for r in rows if r["tier"] == t]) for t in tiers}
    columns["all"] = scoring.figures(rows)
    lines = ["| figure | must | " + " | ".join(columns) + " |", "|---|---|" + "---|" * len(columns)]
    for key, words in WORDS.items():
        cells = " | ".join(text_of(columns[c][key]) for c in columns)
        lines.append(f"| {words} | {ASKED.get(key, '')} | {cells} |")
    lines += ["", "| hidden | said (cases) |", "|---|---|"]
    for hidden, said in sorted(scoring.confusion(rows).items()):
        lines.append(f"| {hidden} | {', '.join(f'{k} ({n})' for k, n in sorted(said.items(), key=lambda x: -x[1]))} |")
    calibration, power = scoring.calibration(rows), scoring.power(rows)
    lines += ["", "| stated probability | true share | cases |", "|---|---|---|"]
    lines += [f"| {b['stated']:.2f} | {b['true']:.2f} | {b['count']} |" for b in calibration["bins"]]
    if calibration["count"]:
        lines.append(f"\nExpected calibration error {calibration['expected_error']:.2f}, "
                     f"Brier score {calibration['brier']:.2f}.")
    lines += ["", "| strength [σ] | class first |", "|---|---|"]
    lines += [f"| {p['from']:g} to {p['to'] or '∞'} | {text_of(p)} |" for p in power]
    lines += ["", "| case | tier | hidden | strength | verdict | named | misfit, noise [mm] | CPU [s] |",
              "|---|---|---|---|---|---|---|---|"]
    for r in rows:
        size = "" if r["rms_mm"] is None else f"{r['rms_mm']:.2f}, {r['noise_mm']:.2f}"
        lines.append(f"| {r['case']} | {r['tier']} | {' + '.join(r['hidden']) or 'nothing'} | {size_of(r)} "
                     f"| {r['verdict']} | {', '.join(r['named'])} | {size} | {r['cpu'] or 0:.0f} |")
    return "\n".join(lines), {"figures": columns, "calibration": calibration, "power": power,
                              "confusion": scoring.confusion(rows), "cases": rows}


def main():
    require_in_tree()
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("set", choices=["small", "full"])
    parser.add_argument("--throws", action="store_true", help="also predict another throw of each body")
    parser.add_argument("--tool", type=pathlib.Path, default=BUILD / "bin" / "matterfit")
    options = parser.parse_args()
    folder = BUILD / "blind" / options.set
    if not (folder / "seal.json").exists():
        sys.exit(f"blind_open.py: {folder} has no seal.json; run blind_hide.py first")
    seal = check_seal(folder)
    labels = json.loads((folder / "sealed" / "labels.json").read_text(encoding="utf-8"))
    found = {path.parent.name: json.loads(path.read_text(encoding="utf-8"))
             for path in sorted((folder / "found").glob("*/found.json"))}
    found = {case: f for case, f in found.items() if case in labels and labels[case]["kind"] != "not made"}
    if not found:
        sys.exit(f"blind_open.py: nothing is found in {folder}; run blind_find.py first")
    version = one_version(found)
    thrower, rows = Thrower(folder, options.tool), []
    for case, verdict in found.items():
        row = scoring.judged(labels[case], verdict)
        if options.throws:
            row["again_gain"] = thrower.gain(case, labels[case])
        rows.append(row)
    table, scores = tables(rows)
    missing = sorted(set(labels) - set(found))
    head = f"{len(rows)} of {len(labels)} cases; labels {seal[:16]}…, tool {version[:16]}…"
    scores |= {"labels": seal, "tool": version, "not_diagnosed": missing}
    (folder / "table.md").write_text(f"{head}\n\n{table}\n", encoding="utf-8")
    (folder / "scores.json").write_text(json.dumps(scores, indent=1), encoding="utf-8")
    say(f"{head}\n\n{table}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
