# SPDX-License-Identifier: GPL-3.0-or-later
"""Fits clips of other simulators and scores the fits (docs/validation.md).

    other_simulators.py [FOLDER] [--only NAME …] [--coarser F] [--threads N] [--again]

FOLDER (../shared/data/other_simulators) holds NAME.npz (`rest`, `positions` without noise, `times`)
and NAME.json (`law`, `density`, `gravity`, `ground`, `contact`, `fps`; of a simulator with a grid
`simulator_grid_spacing`; if known `simulator_substeps_per_frame`, and the truth: `parameters`,
`velocity`, `spin`). A fit knows these but no parameter of the law and not how the body was thrown; it
sees the tracks of the first seven tenths with .5 mm of noise and starts from poor guesses. --coarser:
particles F times as far apart, and the solver's own substep: what nobody tells a user.
Fits that are done for the same document are kept in build/other_simulators. Progress on standard error; the
table as Markdown on standard output and in table.md.
"""

import json
import pathlib
import subprocess
import sys

import clip_fit
import numpy as np
from parts import BUILD, ROOT, require_in_tree

DONE = BUILD / "other_simulators"
# Up to twenty times off, whatever the clip.
STARTS = {
    "neo_hookean": {"E": 5e4, "nu": 0.35},
    "fixed_corotated": {"E": 5e4, "nu": 0.4},
    "stvk_hencky": {"E": 5e4, "nu": 0.35},
    "newtonian": {"bulk_modulus": 1e5, "viscosity": 100.0},
    "herschel_bulkley": {"E": 1e5, "nu": 0.3, "yield_stress": 2e3, "viscosity": 50.0},
    "von_mises": {"E": 1e5, "nu": 0.4, "yield_stress": 1e3},
    "drucker_prager": {"E": 1e5, "nu": 0.4, "friction_angle": 45.0},
}
ITERATIONS = 8
# Across a body of a simulator without a grid.
PARTICLES_ACROSS = 14


def contact_of(clip):
    """As `sticky` or `friction 0.4`; where the simulator has a grid, its nodes meet the ground."""
    words = str(clip["contact"]).split()
    # What these simulators call sticky holds nodes that are inside, which we call glue.
    contact = {"kind": {"sticky": "glue"}.get(words[0], words[0])}
    if "simulator_grid_spacing" in clip:
        contact["method"] = "node"
    if len(words) > 1:
        contact["mu"] = float(words[1])
    return contact


def job_document(name, clip, rest, frames):
    """The clip's grid and substep, as far as they are known: both are part of how its material flows.
    Without a grid (finite elements) the formulation is the material's own."""
    scene = {
        "fps": clip["fps"],
        "frames": [0, frames],
        "gravity": clip["gravity"],
        "bodies": [
            {
                "name": "body",
                "source": {"points": "rest.npz"},
                "density": clip["density"],
                "material": {"law": clip["law"], **STARTS[clip["law"]]},
            }
        ],
        "colliders": [{"name": "ground", "shape": "ground", "height": clip["ground"], "contact": contact_of(clip)}],
    }
    if "simulator_grid_spacing" in clip:
        scene["particle_separation"] = clip["simulator_grid_spacing"] / 2
        scene["bodies"][0]["formulation"] = "updated"
    else:
        scene["particle_separation"] = float(np.cbrt(np.ptp(rest, axis=0).prod()) / PARTICLES_ACROSS)
    if "simulator_substeps_per_frame" in clip:
        scene["solver"] = {"dt": 1.0 / (clip["fps"] * clip["simulator_substeps_per_frame"])}
    parameters = [f"material.{key}" for key in STARTS[clip["law"]]]
    return {
        "schema": "matterfit.job/1",
        "task": "fit",
        "scene": scene,
        "captures": [
            {
                "name": name,
                "tracks": "tracks.npz",
                "noise": clip_fit.NOISE,
                "holdout": {"frames": [round(0.7 * frames), frames]},
            }
        ],
        "fit": {"parameters": [*parameters, "velocity", "spin"], "iterations": ITERATIONS},
        "output": {"folder": "out"},
    }


def fit_one(path, options):
    name = path.stem
    clip = json.loads(path.read_text(encoding="utf-8"))
    arrays = np.load(path.with_suffix(".npz"))
    positions = arrays["positions"].astype(float)
    folder = DONE / (name if options.coarser == 1.0 else f"{name}_{options.coarser:g}")
    document = job_document(name, clip, arrays["rest"], len(positions))
    rest = clip_fit.coarsened(document, arrays["rest"], options.coarser)

    def write_inputs():
        np.savez(folder / "tracks.npz", positions=clip_fit.with_noise(name, positions), times=arrays["times"])
        np.savez(folder / "rest.npz", positions=rest)

    return clip_fit.fit_clip(name, clip, arrays, folder, document, write_inputs,
                             lambda: (positions[:, ::2], positions[:, 1::2], arrays["times"]), options)


def markdown(rows):
    lines = [
        "| clip | observable: score − floor; tracks, mm | future: score − floor; tracks, mm "
        "| held-out, mm: before → after | found ± error (true) | runs, time, s |",
        "|---|---|---|---|---|---|",
    ]
    for row in rows:
        if "failed" in row:
            lines.append(f"| {row['name']} | failed: {clip_fit.last_words(row)} | | | | {row['seconds']:.0f} |")
            continue
        parts = [f"{row[part] - row[part + '_floor']:.3f}; {row[part + '_track_mm']:.1f}"
                 for part in ("observable", "future")]
        before, after = (clip_fit.held_out_mm(row, when) for when in ("before", "after"))
        found = ", ".join(
            f"{key.removeprefix('material.')} {p['value']:.4g} ± {p['standard_error'] or float('nan'):.2g}"
            + (f" ({p['truth']:.4g})" if "truth" in p else "")
            for key, p in row["parameters"].items() if key.startswith("material."))
        lines.append(f"| {row['name']} | {parts[0]} | {parts[1]} | {before:.0f} → {after:.2f} | {found} "
                     f"| {row['fit']['evaluations']}, {row['seconds']:.0f} |")
    return "\n".join(lines)


def main():
    require_in_tree()
    parser = clip_fit.arguments(__doc__)
    clip_fit.add_coarser(parser)
    parser.add_argument("folder", type=pathlib.Path, nargs="?",
                        default=ROOT / ".." / "shared" / "data" / "other_simulators")
    options = parser.parse_args()
    paths = sorted(path for path in options.folder.glob("*.json")
                   if not options.only or any(path.stem.startswith(only) for only in options.only))
    if not paths:
        sys.exit(f"other_simulators.py: there is no such NAME.json in {options.folder}")
    build = ["bash", ROOT / "scripts" / "build.sh", "matterfit_tool"]
    if options.tool is None and subprocess.run(build, check=False, stdout=sys.stderr).returncode != 0:
        return 1
    rows = []
    for path in paths:
        rows.append(fit_one(path, options))
        print(clip_fit.line_of(rows[-1]), file=sys.stderr, flush=True)
    table = markdown(rows)
    print(table)
    (DONE / "table.md").write_text(table + "\n", encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
