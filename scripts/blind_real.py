# SPDX-License-Identifier: GPL-3.0-or-later
"""Cases of the blind benchmark from recordings of real bodies (tier T4): balls dropped from a bridge, whose
scene has no air, and a silicone beam, whose law is elastic or whose scene does not say what hangs on it.
Here nobody draws what is hidden: the label is what is known of the experiment. Cases are documents, since
balls come without a mesh and the beam is clamped."""

import copy
import json
import shutil

import ball_drops
import numpy as np
from parts import ROOT

DATA = ROOT / ".." / "shared" / "data"
EXAMPLES = ROOT / "docs" / "examples"
DRAG = ["drag_quadratic"]
# One drop cannot tell these apart.
OF_ONE_DROP = ["drag_linear", "frame_rate", "gravity_size", "scale", "wind", "buoyancy"]
SLOW = 0.9  # of the frames' true times
SLOWLY = "slow_clock"
CASES = [*([name] for name in ball_drops.BALLS), ["all_balls"], ["all_balls", SLOWLY], ["beam"], ["beam_loaded"]]


class Missing(Exception):
    """A recording is not there."""


def label(effects, also=(), ties=()):
    return {"tier": "T4", "kind": "pair" if len(effects) > 1 else "single", "effects": list(effects),
            "also": list(also), "ties": list(ties), "strength": None, "lambda": None, "keep": None}


def balls(names, folder):
    """Some drops, or all of them with two kept back, on a clock that may be wrong."""
    several = names[0] == "all_balls"
    drops = list(ball_drops.BALLS) if several else [names[0]]
    if not (DATA / "balls" / f"{drops[0]}.csv").exists():
        raise Missing(f"{DATA / 'balls'} holds no {drops[0]}.csv")
    held_out = drops[-2:] if several else []
    document = ball_drops.document(DATA / "balls", folder, drops, held_out)
    (folder / "job.json").write_text(json.dumps(document, indent=1), encoding="utf-8")
    if SLOWLY not in names:
        return label(DRAG, ties=[] if several else OF_ONE_DROP)
    for name in drops:
        arrays = dict(np.load(folder / f"{name}.npz"))
        np.savez(folder / f"{name}.npz", positions=arrays["positions"], times=SLOW * arrays["times"])
    return label(["frame_rate", *DRAG])


def beam(names, folder):
    document = json.loads((EXAMPLES / "beam_diagnose.json").read_text(encoding="utf-8"))
    document["output"] = {"folder": "out"}
    found = label(["damping_shear"], also=["drag_linear", "drag_quadratic"])
    if names == ["beam_loaded"]:
        fit = json.loads((EXAMPLES / "beam_fit.json").read_text(encoding="utf-8"))
        capture = copy.deepcopy(next(c for c in fit["captures"] if c["name"] == "beam_load52_V2_a"))
        capture.pop("scene")
        capture["holdout"] = {"frames": [143, 220]}
        document["captures"] = [capture]
        scene = document["scene"]
        scene["bodies"][0]["pins"][1]["release"] = capture["release"]
        # What own weight has told of the material.
        scene["bodies"][0]["material"]["maxwell"] = fit["scene"]["bodies"][0]["material"]["maxwell"]
        document["fit"]["parameters"] = ["gravity[1]", "captures.beam_load52_V2_a.start_frame"]
        document["note"] = "The silicone beam with something hung on it that the scene does not mention."
        found = label(["attached_mass"], also=["relaxation", "damping_shear"])
    for capture in document["captures"]:
        shutil.copy(EXAMPLES / capture["tracks"], folder / capture["tracks"])
    (folder / "job.json").write_text(json.dumps(document, indent=1), encoding="utf-8")
    return found


def write(names, folder):
    """Writes the case into `folder`; its label."""
    return (beam if names[0].startswith("beam") else balls)(names, folder)
