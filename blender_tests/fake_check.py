# SPDX-License-Identifier: GPL-3.0-or-later
"""What a check says of a recording, made without one."""

from matterfit.io import check


def parameter(path, start, error, unit="", known=True):
    return {"path": path, "unit": unit, "start": start, "error": error, "keep": 0.5, "known": known}


def enough(what, enough=True, ratio=1.0, parameter=""):
    return {"what": what, "enough": enough, "ratio": ratio, "parameter": parameter,
            "sentence": f"in the library's words: {parameter}"}


def result(body="Cube", **other):
    """What the library says of a recording that identifies most of it."""
    found = {
        "schema": check.SCHEMA, "status": "done", "task": "check",
        "noise": {"sigma": 5e-4, "autocorrelation": 0.1},
        "parameters": [parameter(f"bodies.{body}.material.E", 1e5, 442.5, "Pa"),
                       parameter(f"bodies.{body}.material.nu", 0.2, None, known=False),
                       *[parameter(f"bodies.{body}.velocity[{i}]", 1.0, e, "m/s")
                         for i, e in enumerate((3e-4, 5e-4, 4e-4))],
                       parameter(f"bodies.{body}.spin[0]", 1.0, 2e-3, "rad/s"),
                       parameter(f"bodies.{body}.spin[1]", 1.0, 12.0, "rad/s", known=False),
                       parameter(f"bodies.{body}.spin[2]", 1.0, 2e-3, "rad/s")],
        "ties": [{"parameters": [f"bodies.{body}.material.E", f"bodies.{body}.material.nu"], "keep": 0.0}],
        "enough": [enough("frame rate", False, 3.29, f"bodies.{body}.material.nu"),
                   enough("duration", False, 89072.7, f"bodies.{body}.material.E"),
                   enough("noise", False, 4.0, f"bodies.{body}.spin[1]")],
        "assumptions": [], "record_instead": "Throw it fast and sideways.", "notes": []}
    return {**found, **other}
