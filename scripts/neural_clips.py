# SPDX-License-Identifier: GPL-3.0-or-later
"""Fits clips of other simulators without saying the class: the neural law beside the true classical one.

    neural_clips.py [FOLDER] [--only NAME …] [--separation M] [--weights N] [--threads N] [--again]

FOLDER (../shared/data/other_simulators) as in other_simulators.py. Each clip has 400 tracks with .5 mm
of noise, the first seven tenths of the frames to fit; the throw is fitted too. The neural law begins
as jelly, with its moduli, two form numbers and its flow; beside it the law that the clip was made
with, from the poor guesses of other_simulators.py. Both at the same particle separation.
Fits that are done for the same document are kept in build/neural_clips.
Progress on standard error; the table as Markdown on standard output and in table.md.
"""

import json
import pathlib
import sys
import time

import clip_fit
import numpy as np
from other_simulators import STARTS, contact_of
from parts import BUILD, ROOT, require_in_tree

DONE = BUILD / "neural_clips"
FLOW = ("yield_strain", "internal_friction", "tear_strain", "flow_rate")
ITERATIONS = 12
EVERY = 5  # tracks


def job_document(clip, frames, kind, options):
    neural = kind == "neural"
    material = ({"law": "neural_isotropic", "weights": "jelly"} if neural
                else {"law": clip["law"], **STARTS[clip["law"]]})
    numbers = ["E", "nu", "form_1", "form_2", *FLOW] if neural else STARTS[clip["law"]]
    fit = {"parameters": [*(f"material.{number}" for number in numbers), "velocity", "spin"],
           "iterations": ITERATIONS}
    if neural and options.weights:
        fit["weights"] = options.weights
    return {
        "schema": "matterfit.job/1",
        "task": "fit",
        "scene": {
            "fps": clip["fps"],
            "frames": [0, frames],
            "gravity": clip["gravity"],
            "particle_separation": options.separation,
            "bodies": [{"name": "body", "source": {"points": "rest.npz"}, "density": clip["density"],
                        "material": material, "formulation": "updated"}],
            "colliders": [{"name": "ground", "shape": "ground", "height": clip["ground"],
                           "contact": contact_of(clip)}],
        },
        "captures": [{"name": "clip", "tracks": "tracks.npz", "noise": clip_fit.NOISE,
                      "holdout": {"frames": [round(0.7 * frames), frames]}}],
        "fit": fit,
        "output": {"folder": "out"},
    }


def fit_one(path, kind, options):
    """One fit, from an earlier run where the document is still the same."""
    clip = json.loads(path.read_text(encoding="utf-8"))
    arrays = np.load(path.with_suffix(".npz"))
    positions = arrays["positions"].astype(float)
    document = job_document(clip, len(positions), kind, options)
    folder = DONE / f"{path.stem}_{kind}"
    kept = folder / "row.json"
    if kept.exists() and not options.again:
        row = json.loads(kept.read_text(encoding="utf-8"))
        if row["document"] == document:
            return row
    folder.mkdir(parents=True, exist_ok=True)
    tracks = clip_fit.with_noise(path.stem, positions)[:, ::EVERY]
    np.savez(folder / "tracks.npz", positions=tracks, times=arrays["times"])
    np.savez(folder / "rest.npz", positions=arrays["rest"])
    job = folder / "job.json"
    job.write_text(json.dumps(document, indent=1), encoding="utf-8")
    started = time.monotonic()
    result, error = clip_fit.run_tool(options, "fit", job, folder / "fit.log")
    row = {"name": path.stem, "kind": kind, "document": document, "seconds": time.monotonic() - started}
    if result is None:
        row["failed"] = error
    else:
        row["fit"] = {key: value for key, value in result["fit"].items() if key != "history"}
        row["particles"] = result["particles"]
        kept.write_text(json.dumps(row, indent=1), encoding="utf-8")
    return row


def held_out(row, when="after"):
    errors = row["fit"][when]["held_out"]
    return f"{errors['mean_mm']:.2f}" if errors else "—"


def line_of(neural, classical):
    if "failed" in neural:
        return f"| {neural['name']} | failed: {clip_fit.last_words(neural)} | | | | |"
    fit = neural["fit"]
    like = fit["like"]["body"]
    numbers = ", ".join(f"{key} {value:.4g}" for key, value in like["parameters"].items()
                        if isinstance(value, float) and value != 0.0)
    beside = "failed" if "failed" in classical else f"{classical['fit']['law']} {held_out(classical)}"
    return (f"| {neural['name']}, {neural['particles']} | {held_out(neural, 'before')} | {held_out(neural)} | {beside} "
            f"| {like['law']}: {numbers}; {100 * like['distance']:.2g} % "
            f"| {fit['evaluations']}, {neural['seconds']:.0f}; {classical['seconds']:.0f} |")


def main():
    require_in_tree()
    parser = clip_fit.arguments(__doc__)
    parser.add_argument("folder", type=pathlib.Path, nargs="?",
                        default=ROOT / ".." / "shared" / "data" / "other_simulators")
    parser.add_argument("--separation", type=float, default=0.02, help="of particles [m]")
    parser.add_argument("--weights", type=int, default=0, help="steps with all weights at the end")
    options = parser.parse_args()
    paths = sorted(path for path in options.folder.glob("*.json")
                   if not options.only or any(path.stem.startswith(only) for only in options.only))
    if not paths:
        sys.exit(f"neural_clips.py: there is no such NAME.json in {options.folder}")
    lines = ["| clip, particles | held-out, mm: start | neural | the true law "
             "| what it is like; distance of the stress "
             "| runs, s; of the true law |", "|---|---|---|---|---|---|"]
    for path in paths:
        lines.append(line_of(*(fit_one(path, kind, options) for kind in ("neural", "classical"))))
        print(lines[-1], file=sys.stderr, flush=True)
    table = "\n".join(lines)
    print(table)
    (DONE / "table.md").write_text(table + "\n", encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
