# SPDX-License-Identifier: GPL-3.0-or-later
"""What a diagnosis leaves in a fit's folder, made without one, beside fake_fit's files."""

import copy
import os

from matterfit.io import files


def number(value, unit="", error=None):
    return {"value": value, "unit": unit, "stderr": error}


def cause(effect, parameters, probability=0.9, accepted=True, **other):
    words = effect.replace("_", " ")  # as the library's sentences have it
    entry = {
        "effect": effect, "scope": "shared", "group": "outside",
        "sentence": f"The recording shows {words}.", "evidence": f"Why {words} is believed.",
        "probability": probability, "score": 812.4, "p": 1e-4, "keep": 0.4, "observable": True,
        "refitted": True, "accepted": accepted, "explained": 0.9, "holdout_before": 0.0061,
        "holdout_after": 0.0011, "holdout_floor": 0.0005, "last_residual": 0.005,
        "free_field": 0.004, "parameters": parameters,
        "confused_with": [{"effect": "drag_linear", "scope": "shared", "cosine": 0.99}],
        "gain": 0.82, "gain_interval": [0.78, 0.85]}
    return {**entry, **other}


def write(folder, causes, change=None, **other):
    """diagnosis.json, diagnosis.html and extended.json of the fit in `folder`; `change(scene)` makes
    the extended model of the fitted scene."""
    fitted = files.read_json(os.path.join(folder, "scene.json"))
    model = copy.deepcopy(fitted["scene"])
    if change is not None:
        change(model)
    report = {
        "schema": "matterfit.report/1", "status": "done", "task": "diagnose", "verdict": "cause",
        "sentence": "This is missing: best of 24 causes tested; the next is 0.3 % as likely.",
        "class": [causes[0]["effect"]] if causes else [], "causes": causes,
        "residual": {
            "train": {"rms": 0.001, "p95": 0.002}, "holdout": {"rms": 0.006, "p95": 0.01},
            "by_frame": [], "wrong": [],
            "worst": [{"capture": "clip", "frame": 4, "where": [0.1, 0.0, 0.3], "size": 0.004},
                      {"capture": "clip", "frame": 2, "where": [0.1, 0.0, 0.3], "size": 0.002}]},
        "not_observable": ["time_offset", "drag_linear"], "detection_limits": {},
        "next_recording": "Throw it fast and sideways.", "statements": [], "model": model,
        "fit": files.read_json(os.path.join(folder, "result.json"))["fit"]}
    report.update(other)
    files.write_json(os.path.join(folder, "diagnosis.json"), report)
    files.write_bytes(os.path.join(folder, "diagnosis.html"), b"<!doctype html><title>r</title>")
    files.write_json(os.path.join(folder, "extended.json"),
                     {"schema": "matterfit.job/1", "task": "simulate", "scene": model})
