# SPDX-License-Identifier: GPL-3.0-or-later
"""Fits the five-material set and scores the fits (docs/validation.md).

    five_materials.py [--only NAME …] [--threads N] [--again]

The clips come from a simulator that shares nothing with ours (native/bench/five_materials.cpp). A
fit knows the law, the points of the body in the first frame and the tracks of the fitted frames,
with noise; it starts from the initial guesses of PAC-NeRF and does not know how the body was
thrown. Fits that are done for the same document are kept in build/five_materials/fits.
Progress on standard error; the table as Markdown on standard output and in table.md, everything in
table.json.
"""

import json
import subprocess
import sys

import clip_fit
import clip_metrics
import numpy as np
from clip_body import surface_of_points
from parts import BUILD, ROOT, require_in_tree

SET = BUILD / "five_materials"
CLIPS = SET / "clips"
FITS = SET / "fits"

# Initial guesses of PAC-NeRF for its 45 clips (github.com/xuan-li/PAC-NeRF, configs/elastic/*.py,
# newtonian/default.py, non_newtonian/default.py, plasticine/default.py, sand/default.py), in our
# units: its fluid's kappa 1e4 and mu 10 are K = 7 kappa and eta = mu/2; its kappa 1e5 and mu 100 of
# the non-Newtonian solid are E = 9 kappa mu/(3 kappa + mu) = 300 and nu .4995, of which we take .49
# (a fit's nu ends at .495); its plastic viscosity 1 is twice ours. For sand it knows E and nu,
# and seeks the angle.
MATERIALS = {
    "elastic": {"law": "neo_hookean", "E": 316228, "nu": 0.25},
    "newtonian": {"law": "newtonian", "bulk_modulus": 7e4, "viscosity": 5},
    "nonnewtonian": {"law": "herschel_bulkley", "E": 300, "nu": 0.49, "yield_stress": 10, "viscosity": 0.5},
    "plasticine": {"law": "von_mises", "E": 1e4, "nu": 0.25, "yield_stress": 1000},
    "sand": {"law": "drucker_prager", "E": 1e6, "nu": 0.3, "friction_angle": 10},
}
KNOWN = {"sand": {"E", "nu"}}
# Particle separation [m]: cells twice as wide as the generator's, 7 to 14 across a body.
SEPARATION = 0.015
# The generator's floor holds whole grid nodes, and so does the fit's: known, as in PAC-NeRF.
CONTACT = {"kind": "glue", "method": "node"}
# The first steps of a stage gain nearly all of what it can gain (docs/validation.md).
ITERATIONS = 8


def say(text):
    print(text, file=sys.stderr, flush=True)


def make_clips(only, threads, with_tool):
    """Names of the clips, made where they are missing; builds what it takes."""
    targets = ["five_materials", "matterfit_tool", "matterfit"] if with_tool else ["five_materials"]
    build = ["bash", ROOT / "scripts" / "build.sh", *targets]
    if subprocess.run(build, check=False, stdout=sys.stderr).returncode != 0:
        sys.exit(1)
    program = BUILD / "release" / "bin" / "five_materials"
    chosen = ["--only", ",".join(only)] if only else []
    names = subprocess.run([program, "--list", *chosen], check=True, capture_output=True, text=True).stdout.split()
    if not names:
        sys.exit("five_materials.py: no clip's name begins with any of: " + ", ".join(only))
    missing = [name for name in names if not (CLIPS / f"{name}.json").exists()]
    if missing:
        say(f"Making {len(missing)} clips in {CLIPS}")
        command = [program, "--folder", CLIPS, "--threads", str(threads), "--only", ",".join(missing)]
        if subprocess.run(command, check=False).returncode != 0:
            sys.exit(1)
    return names


def parameter_paths(material):
    """What is fitted: all of the law that is not known, and the throw."""
    paths = []
    for key, start in MATERIALS[material].items():
        if key == "law" or key in KNOWN.get(material, set()):
            continue
        paths.append({"path": f"material.{key}", "start": start})
    return [*paths, "velocity", "spin"]


def write_body(name, folder):
    """The surface around the first frame's points."""
    vertices, faces = surface_of_points(np.load(CLIPS / f"{name}.npz")["rest"])
    np.savez(
        folder / "body.npz",
        vertices=vertices.astype(np.float32),
        face_sizes=np.full(len(faces), 4, np.int32),
        face_vertices=faces.astype(np.int32).ravel(),
    )


def write_inputs(name, folder):
    """What the fit is given: the tracks with noise, and the body."""
    arrays = np.load(CLIPS / f"{name}.npz")
    positions = clip_fit.with_noise(name, arrays["positions"])
    np.savez(folder / "capture.npz", positions=positions, times=arrays["times"])
    write_body(name, folder)


def job_document(material, clip):
    return {
        "schema": "matterfit.job/1",
        "task": "fit",
        "scene": {
            "fps": clip["fps"],
            "frames": [0, clip["frames"]],
            "gravity": clip["gravity"],
            "particle_separation": SEPARATION,
            "bodies": [
                {
                    "name": "body",
                    "source": {"mesh": "body.npz"},
                    "density": clip["density"],
                    "material": MATERIALS[material],
                    "formulation": "updated",
                }
            ],
            "colliders": [
                {"name": "ground", "shape": "ground", "height": clip["ground"], "contact": CONTACT}
            ],
        },
        "captures": [
            {
                "name": "tracks",
                "tracks": "capture.npz",
                "noise": clip_fit.NOISE,
                "holdout": {"frames": [clip["fitted_frames"], clip["frames"]]},
            }
        ],
        "fit": {"parameters": parameter_paths(material), "iterations": ITERATIONS},
        "output": {"folder": "out"},
    }


def fit_clip(name, options):
    """One row of the table."""
    material = name.split("_")[0]
    clip = json.loads((CLIPS / f"{name}.json").read_text(encoding="utf-8"))
    folder = FITS / name
    truth = np.load(CLIPS / f"{name}_truth.npz")
    arrays = {**np.load(CLIPS / f"{name}.npz"), **{f"truth {key}": truth[key] for key in truth}}
    row = clip_fit.fit_clip(name, clip, arrays, folder, job_document(material, clip),
                            lambda: write_inputs(name, folder),
                            lambda: (truth["truth"], truth["own"], truth["times"]), options)
    return {**row, "material": material, "volume": clip["volume"]}


def main():
    require_in_tree()
    options = clip_fit.arguments(__doc__).parse_args()
    names = make_clips(options.only, options.threads, options.tool is None)
    rows = []
    for name in names:
        rows.append(fit_clip(name, options))
        say(clip_fit.line_of(rows[-1]))
    table = clip_metrics.markdown(rows)
    print(table)
    (SET / "table.md").write_text(table + "\n", encoding="utf-8")
    (SET / "table.json").write_text(json.dumps(rows, indent=1), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
