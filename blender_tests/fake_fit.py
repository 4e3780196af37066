# SPDX-License-Identifier: GPL-3.0-or-later
"""What a fit leaves in its folder, made without one, for the body of the first capture."""

import copy
import json
import os

from matterfit.io import files

E, ERROR = 234567.0, 1234.0


def measure(mean):
    return {"mean_mm": mean, "p95_mm": 2.0 * mean, "rms_mm": 1.2 * mean, "mean_percent": mean / 2.0,
            "samples": 128}


def estimate(path, unit, start, value, error, **other):
    entry = {"path": path, "unit": unit, "start": start, "value": value, "standard_error": error,
             "grid_error": None, "interval": None, "bounds": [0.0, 1e10], "at_bound": False, "observable": True,
             "statement": ""}
    if error is not None:
        entry["interval"] = [value - 1.96 * error, value + 1.96 * error]
    return {**entry, **other}


def agreement(iou):
    """Of images whose outlines overlap so much; None: there are none, or none shows anything ("empty")."""
    if iou == "empty":
        return {"images": 0, "empty": 2}
    return None if iou is None else {"images": 2, "iou": iou, "contour_px": 1.5}


def outlines(before, after, cameras=()):
    """What a fit to images alone has in place of errors in mm: pairs (fitted, held out) of overlaps before and
    after, and [(capture, number, fitted, held out)] of cameras."""
    def parts(pair):
        return dict(zip(("fitted", "held_out"), map(agreement, pair), strict=True))

    none = {"fitted": None, "held_out": None}
    return {"silhouettes": {"before": parts(before), "after": parts(after)}, "before": none, "after": none,
            "cameras": [{"capture": capture, "camera": number, "particle_size": 1.0, **parts(pair)}
                        for capture, number, *pair in cameras]}


def write_history(folder, entries=None):
    """A curve of two stages."""
    if entries is None:
        entries = [{"stage": stage, "law": "fixed_corotated", "iteration": i, "cost": 10.0 / (i + 1),
                    "rms_mm": 20.0 / (i + 1 + 8 * n), "accepted": i != 3}
                   for n, stage in enumerate(("frames 1-8", "frames 1-20")) for i in range(8)]
    text = "".join(json.dumps(entry) + "\n" for entry in entries)
    return files.write_bytes(os.path.join(folder, "fit", "history.jsonl"), text.encode())


def write(folder, status="done", law=None, change=None, extra=(), held_out=True,
          warning="", poses=(), images=None):
    """result.json, scene.json, material.json and the history of a fit of the job.json in `folder`.

    The first body gets E, velocity (1, 2, 3) m/s, and what `change(scene)` does; `extra` are more
    entries of the result's parameters, `poses` those of the first capture's cameras, `images` the outlines() of
    a fit to images.
    """
    document = files.read_json(os.path.join(folder, "job.json"))
    scene = copy.deepcopy(document["scene"])
    body = scene["bodies"][0]
    name = body["name"]
    body["material"]["E"] = E
    body["velocity"] = [1.0, 2.0, 3.0]
    if law is not None:
        body["material"] = law
    if change is not None:
        change(scene)
    parameters = [
        estimate(f"bodies.{name}.material.E", "Pa", 1e5, E, ERROR),
        estimate(f"bodies.{name}.material.nu", "", 0.2, 0.2, None, observable=False,
                 statement="Nothing in the capture squeezes the body; record a fall onto a flat "
                           "floor."),
        *(estimate(f"bodies.{name}.velocity[{axis}]", "m/s", 0.0, axis + 1.0, 0.01)
          for axis in range(3)), *extra]
    if status == "cancelled":  # no errors of the values are known yet
        for entry in parameters:
            entry.update(standard_error=None, interval=None, observable=None, statement="")
    fit = {
        "law": body["material"]["law"], "converged": status == "done", "reason": "cancelled",
        "iterations": 12, "evaluations": 61, "seconds": 34.2, "parameters": parameters,
        "correlation": None if status == "cancelled" else [],
        "noise_scale": None if status == "cancelled" else 1.3,
        "statements": [parameters[1]["statement"],
                       f"bodies.{name}.material.E and bodies.{name}.velocity[2] are hard to distinguish "
                       "(correlation 0.962): raise both, and little changes. Fix one of them or give "
                       "it a prior."],
        "before": {"fitted": measure(8.0), "held_out": measure(16.0) if held_out else None},
        "after": {"fitted": measure(0.5), "held_out": measure(0.75) if held_out else None},
        "history": [], "models": [], "warning": warning, **(images or {})}
    if "laws" in document.get("fit", {}):
        fit["models"] = [
            {"law": "fixed_corotated", "held_out_mm": 0.75, "fitted_mm": 0.5, "probability": 0.97,
             "parameters": {}, "failed": ""},
            {"law": "newtonian", "held_out_mm": None, "fitted_mm": None, "probability": 0.0,
             "parameters": {}, "failed": "unstable at frame 4"}]
    files.write_json(os.path.join(folder, "result.json"), {"status": status, "fit": fit})
    captures = copy.deepcopy(document["captures"])
    if poses:
        captures[0]["poses"] = list(poses)
    files.write_json(os.path.join(folder, "scene.json"), {
        "schema": "matterfit.job/1", "task": "simulate", "scene": scene, "captures": captures})
    files.write_json(os.path.join(folder, "material.json"), {
        "schema": "matterfit.material/1", "name": name, "density": body["density"],
        "material": body["material"], "source": "Fitted to 'clip', held-out error 0.75 mm.",
        "provenance": {"captures": [{"name": "clip"}], "held_out": measure(0.75),
                       "version": "0.1.0", "warning": warning}})
    write_history(folder)


def write_checkpoint(folder):
    """What an unfinished fit has."""
    files.write_json(os.path.join(folder, "fit", "checkpoint.json"), {})


def write_cancelled(folder):
    """The best so far of a fit that was cancelled."""
    write(folder, status="cancelled")
    write_checkpoint(folder)
