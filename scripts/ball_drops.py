# SPDX-License-Identifier: GPL-3.0-or-later
"""Diagnoses real balls that were dropped from a bridge.

    ball_drops.py FOLDER [--only NAME …] [--hold-out NAME …] [--report FILE]

FOLDER holds NAME_1.csv (time_s, height_m) as ../shared/data/balls does. Writes the tracks and a job
below build/ball_drops and runs `matterfit diagnose` on it: free fall without air, the height and speed
of each release to be fitted; what is missing is to be named. One ball alone cannot tell drag from a
wrong scale, frame rate or gravity; several of known mass and size can.
"""

import argparse
import csv
import json
import math
import pathlib
import subprocess
import sys

import numpy as np
from parts import BUILD, require_in_tree

OUNCE = 28.3495e-3  # [kg]
# Weight [oz] and circumference [cm] (de Silva, Higdon, Brunton, Kutz 2020).
BALLS = {
    "baseball_1": (5, 22.25),
    "blue_basketball_1": (18, 75.0),
    "green_basketball_1": (16, 73.25),
    "bowling_ball_1": (81, 67.0),
    "golf_ball_1": (1.62, 13.8),
    "tennis_ball_1": (2, 20.75),
    "whiffle_ball_1_1": (1, 22.8),
}
FPS = 15
ACROSS = 8  # particles along a diameter; in free fall a ball does not deform
YOUNGS_MODULUS = 1e4  # [Pa]: of no effect on the fall, soft for long substeps


def read(path):
    with open(path, newline="", encoding="utf-8") as file:
        rows = [(float(row["time_s"]), float(row["height_m"])) for row in csv.DictReader(file)]
    return np.array(rows)


def body_of(name, height):
    ounces, centimetres = BALLS[name]
    radius = centimetres / 100.0 / (2.0 * math.pi)
    return {
        "name": "ball",
        "source": {"sphere": {"center": [0, 0, 0], "radius": radius}},
        "placement": {"position": [0, 0, height]},
        "density": ounces * OUNCE / (4.0 / 3.0 * math.pi * radius**3),
    }, 2.0 * radius / ACROSS


def document(folder, out, names, held_out):
    first, captures, parameters = None, [], []
    for name in names:
        drop = read(folder / f"{name}.csv")
        frames = len(drop)
        positions = np.zeros((frames, 1, 3))
        positions[:, 0, 2] = drop[:, 1]
        np.savez(out / f"{name}.npz", positions=positions, times=drop[:, 0])
        body, separation = body_of(name, float(drop[0, 1]))
        end = int(math.ceil(drop[-1, 0] * FPS)) + 2
        capture = {
            "name": name,
            "tracks": f"{name}.npz",
            "body": "ball",
            "positions": [[0, 0, float(drop[0, 1])]],
        }
        if first is None:
            material = {"law": "fixed_corotated", "E": YOUNGS_MODULUS, "nu": 0.3}
            first = {
                "fps": FPS,
                "frames": [0, end],
                "gravity": [0, 0, -9.81],
                "particle_separation": separation,
                "bodies": [{**body, "material": material}],
            }
        else:
            capture["scene"] = {"frames": [0, end], "particle_separation": separation, "bodies": [body]}
        if name in held_out:
            capture["holdout"] = {"capture": True}
        prefix = f"captures.{name}." if "scene" in capture else ""
        parameters += [f"{prefix}bodies.ball.placement.position[2]", f"{prefix}bodies.ball.velocity[2]"]
        captures.append(capture)
    return {
        "schema": "matterfit.job/1",
        "task": "diagnose",
        "scene": first,
        "captures": captures,
        "fit": {"parameters": parameters, "levels": [1], "windows": False},
        "output": {"folder": "out"},
    }


def main():
    require_in_tree()
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("folder", type=pathlib.Path)
    parser.add_argument("--only", nargs="*", default=list(BALLS))
    parser.add_argument("--hold-out", nargs="*", default=[])
    parser.add_argument("--report", type=pathlib.Path)
    options = parser.parse_args()
    unknown = [name for name in [*options.only, *options.hold_out] if name not in BALLS]
    if unknown:
        print(f"not among the balls: {', '.join(unknown)}. There are: {', '.join(BALLS)}", file=sys.stderr)
        return 2
    out = BUILD / "ball_drops"
    out.mkdir(parents=True, exist_ok=True)
    job = out / "job.json"
    text = json.dumps(document(options.folder, out, options.only, options.hold_out), indent=2)
    job.write_text(text, encoding="utf-8")
    command = [BUILD / "bin" / "matterfit", "diagnose", job, "--restart"]
    if options.report:
        command += ["--report", options.report]
    return subprocess.run(command, check=False).returncode


if __name__ == "__main__":
    sys.exit(main())
