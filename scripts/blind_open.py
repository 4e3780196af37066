# SPDX-License-Identifier: GPL-3.0-or-later
"""Opens the labels and scores what was found: the last of the three programs of the blind benchmark.

    blind_open.py SET [--throws] [--tool FILE]

Refuses labels or cases whose hashes are not those of seal.json, and verdicts of different builds of the
tool. --throws also simulates the fitted and the extended model for another throw of the same body, which
nobody has fitted, and compares; where our own solver made the recording, with the true model as well. Writes
build/blind/SET/table.md and scores.json; the table on standard output.
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

# What is asked of each figure at least (or at most), by the tier where it differs: must, goal.
ASKED = {
    "false_alarms": ("≤ 5 % (T0), ≤ 10 %", "≤ 3 %"),
    "first": ("≥ 98 % (T0), 90 % (T1), 80 % (T2)", "100 % (T0), 97 % (T1), 93 % (T2)"),
    "precision": ("≥ 95 %", "≥ 99 %"),
    "power_30": ("≥ 90 % (T0)", "≥ 95 %"),
    "pairs": ("≥ 70 %", "≥ 90 %"),
    "unknown_found": ("≥ 80 %", "≥ 95 %"),
    "unknown_said": ("≤ 5 %", "≤ 2 %"),
    "not_observable": ("≥ 95 %", "100 %"),
    "false_discoveries": ("≤ 10 %", "≤ 5 %"),
    "beats_field": ("≥ 80 %", "≥ 95 %"),
    "parameter_error": ("≤ .15 (T1)", "≤ .06"),
    "covered": ("80–97 %", "87–93 %"),
    "bias": ("≤ .2", "≤ .05"),
    "gain_ratio": ("≥ .9", "≥ .97"),
    "gain_ratio_worst": ("≥ .5", "≥ .85"),
    "ece": ("≤ .1", "≤ .03"),
    "places": ("≥ .6", "≥ .8"),
    "minutes": ("≤ 10", "≤ 2"),
}
WORDS = {
    "cases": "cases", "failed": "not diagnosed", "false_alarms": "false alarms, nothing hidden",
    "first": "class first, λ ≥ 100 (T0), else strength ≥ 2 σ",
    "in_class": "true name's class among those named, the same",
    "power_30": "class first at λ of 20 to 45",
    "precision": "right where a single cause is named", "precision_of_class": "the same, ties count as right",
    "pairs": "two at once, both classes named", "unknown_found": "outside the catalogue, said so",
    "outside_named": "outside the catalogue, a wrong name", "unknown_said": "`unknown` where the catalogue has it",
    "not_observable": "not observable, and not named", "listed": "not observable, and said to be so",
    "listed_wrongly": "said to be not observable where it is strong",
    "false_discoveries": "false among the names of verdicts that name several",
    "false_names": "false among all names that were said",
    "parameter_error": "relative error of its size, vectors as a whole, median",
    "angle": "angle to a vector's truth, median [°]", "covered": "its 90 % interval holds the truth",
    "bias": "error of fitted numbers after the extension ÷ before, median",
    "bias_velocity": "of it the velocity", "bias_spin": "of it the spin", "bias_E": "of it E",
    "bias_nu": "of it ν",
    "beats_field": "better than a free force field on held-out frames", "gain": "median held-out gain where right",
    "again": "median gain on another throw where right",
    "gain_ratio": "the same ÷ that of the true model (T0, T1), median",
    "gain_ratio_worst": "the same, its worst tenth",
    "places": "frames × regions that are wrong after a fit: F1, median",
    "places_raw": "the same of all that differs from the recording without it",
    "ece": "expected calibration error, `unknown` included",
    "minutes": "time a case, CPU over two cores, as it is, median [min]",
    "minutes_most": "the longest", "particles": "particles of the claimed scene, median",
    "excess_mm": "misfit beyond the noise with nothing hidden, median [mm]",
}


def check_seal(folder):
    """Leaves where a sealed file is not the one that was sealed."""
    seal = json.loads((folder / "seal.json").read_text(encoding="utf-8"))
    beside = folder / "seal_places.json"
    places = json.loads(beside.read_text(encoding="utf-8")) if beside.exists() else {}
    for name, expected in (seal | places).items():
        path = folder / name
        if not path.exists() or hashlib.sha256(path.read_bytes()).hexdigest() != expected:
            sys.exit(f"blind_open.py: {path} is not what was sealed; hide and find again")
    return seal["sealed/labels.json"]


def with_places(folder, case, label):
    """The label with where and when the recording is another, where blind_hide.py has said so."""
    path = folder / "sealed" / f"{case}_places.json"
    return label | {"places": json.loads(path.read_text(encoding="utf-8"))} if path.exists() else label


def one_version(found):
    versions = {f["tool"] for f in found.values()}
    if len(versions) > 1:
        sys.exit(f"blind_open.py: the verdicts are of {len(versions)} builds of the tool; find again with one")
    return versions.pop()


class Thrower:
    """How far models are from a throw that nobody has fitted."""

    def __init__(self, folder, tool):
        self.folder, self.tool = folder, tool

    def error(self, case, model, again, which, inputs=None):
        """Root mean square [m] over frames and points, or None where the model does not run; `inputs`: where its
        body's file lies, if not with what was found."""
        inputs = inputs or self.folder / "found" / case
        work = self.folder / "found" / case / "again"
        work.mkdir(exist_ok=True)
        document = json.loads(model.read_text(encoding="utf-8"))
        document.pop("fit", None)
        document["task"] = "compare"
        body = document["scene"]["bodies"][0]
        for source in ("mesh", "points"):
            if source in body["source"]:
                body["source"][source] = str(inputs / pathlib.Path(body["source"][source]).name)
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

    def gains(self, case, label):
        """1 − (error after / error before)² of models with and without what was found, and its share of that of
        the true model, which there is where our own solver made the recording; None what cannot be said."""
        out = self.folder / "found" / case / "out"
        if label["tier"] == "T4" or not label["again"]["acts"] or not (out / "extended.json").exists():
            return None, None
        before = self.error(case, out / "scene.json", label["again"], "before")
        after = self.error(case, out / "extended.json", label["again"], "after")
        if not before or not after:
            return None, None
        gain, truth = 1.0 - (after / before) ** 2, self.folder / "sealed" / "work" / case
        if label["tier"] not in ("T0", "T1") or not (truth / "truth.json").exists():
            return gain, None
        best = self.error(case, truth / "truth.json", label["again"], "truth", truth)
        # Nothing to be gained says nothing of a share of it.
        return gain, gain / (1.0 - (best / before) ** 2) if best and best < 0.9 * before else None


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
    lines = ["| figure | must | goal | " + " | ".join(columns) + " |", "|---|---|---|" + "---|" * len(columns)]
    for key, words in WORDS.items():
        cells = " | ".join(text_of(columns[c][key]) for c in columns)
        must, goal = ASKED.get(key, ("", ""))
        lines.append(f"| {words} | {must} | {goal} | {cells} |")
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
    by_lambda = scoring.power_by_lambda(rows)
    lines += ["", "| λ | tier | class first |", "|---|---|---|"]
    lines += [f"| {p['from']:g} to {'∞' if p['to'] is None else format(p['to'], 'g')} | {tier} | {text_of(p)} |"
              for tier, curve in by_lambda.items() for p in curve]
    lines += ["", "| case | tier | hidden | strength | verdict | named | misfit, noise [mm] | CPU [s] |",
              "|---|---|---|---|---|---|---|---|"]
    for r in rows:
        size = "" if r["rms_mm"] is None else f"{r['rms_mm']:.2f}, {r['noise_mm']:.2f}"
        lines.append(f"| {r['case']} | {r['tier']} | {' + '.join(r['hidden']) or 'nothing'} | {size_of(r)} "
                     f"| {r['verdict']} | {', '.join(r['named'])} | {size} | {r['cpu'] or 0:.0f} |")
    return "\n".join(lines), {
        "figures": columns, "calibration": calibration, "power": power, "power_by_lambda": by_lambda,
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
        row = scoring.judged(with_places(folder, case, labels[case]), verdict)
        facts = folder / "cases" / case / "facts.json"
        if facts.exists():
            row["particles"] = json.loads(facts.read_text(encoding="utf-8")).get("particles")
        if options.throws:
            row["again_gain"], row["gain_ratio"] = thrower.gains(case, labels[case])
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
