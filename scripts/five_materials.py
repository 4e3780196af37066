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

import argparse
import json
import pathlib
import resource
import subprocess
import sys
import time
import zlib

import clip_metrics
import numpy as np
from clip_body import surface_of_points
from parts import BUILD, ROOT, require_in_tree

SET = BUILD / "five_materials"
CLIPS = SET / "clips"
FITS = SET / "fits"
NOISE = 0.0005  # [m]

# Initial guesses of PAC-NeRF for its 45 clips (github.com/xuan-li/PAC-NeRF, configs/elastic/*.py,
# newtonian/default.py, non_newtonian/default.py, plasticine/default.py, sand/default.py), in our
# units: its fluid's kappa 1e4 and mu 10 are K = 7 kappa and eta = mu/2; its kappa 1e5 and mu 100 of
# the non-Newtonian solid are E = 9 kappa mu/(3 kappa + mu) = 300 and nu .4995, of which we take .49
# (a fit's nu ends at .495); its plastic viscosity 1 is twice ours. Of sand it knows E and nu, and
# seeks the angle.
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
CONTACT = {"kind": "sticky", "method": "node"}
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


def write_inputs(name, folder):
    """What the fit is given: the tracks with noise, and the surface around the first frame's points."""
    folder.mkdir(parents=True, exist_ok=True)
    random = np.random.default_rng(zlib.crc32(name.encode()))
    arrays = np.load(CLIPS / f"{name}.npz")
    noise = random.normal(0.0, NOISE, arrays["positions"].shape)
    np.savez(folder / "capture.npz", positions=arrays["positions"] + noise, times=arrays["times"])
    vertices, faces = surface_of_points(arrays["rest"])
    np.savez(
        folder / "body.npz",
        vertices=vertices.astype(np.float32),
        face_sizes=np.full(len(faces), 4, np.int32),
        face_vertices=faces.astype(np.int32).ravel(),
    )


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
                "noise": NOISE,
                "holdout": {"frames": [clip["fitted_frames"], clip["frames"]]},
            }
        ],
        "fit": {"parameters": parameter_paths(material), "iterations": ITERATIONS},
        "output": {"folder": "out"},
    }


def run_tool(tool, verb, document, threads, log):
    """The tool's result, or None and its last words."""
    command = [tool, verb, document, "--json", "--quiet", "--restart", "--threads", str(threads)]
    with open(log, "w", encoding="utf-8") as errors:
        done = subprocess.run(command, stdout=subprocess.PIPE, stderr=errors, text=True, check=False)
    if done.returncode == 0:
        return json.loads(done.stdout), ""
    return None, log.read_text(encoding="utf-8", errors="replace").strip()[-600:]


def score(name, clip, folder, options):
    """Runs the fitted scene with points that are no particle of the truth's sample, and compares."""
    document = json.loads((folder / "out" / "scene.json").read_text(encoding="utf-8"))
    arrays = np.load(CLIPS / f"{name}_truth.npz")
    np.savez(folder / "own.npz", positions=arrays["own"], times=arrays["times"])
    document.pop("fit", None)
    document["task"] = "compare"
    document["captures"] = [{"name": "own", "tracks": "own.npz", "noise": NOISE}]
    document["output"] = {"folder": "score"}
    for body in document["scene"]["bodies"]:
        body["source"]["mesh"] = "body.npz"
    path = folder / "score.json"
    path.write_text(json.dumps(document, indent=1), encoding="utf-8")
    result, error = run_tool(options.tool, "compare", path, options.threads, folder / "score.log")
    if result is None:
        return {"failed": error}
    simulated = np.load(folder / "score" / "simulated.npz")["positions"]
    metrics = clip_metrics.clip_scores(arrays["truth"], arrays["own"], simulated, clip["fitted_frames"])
    metrics["particles"] = result["particles"]
    metrics["body_volume"] = result["bodies"][0]["volume_m3"]
    return metrics


def parameter_errors(fit, clip):
    """Relative errors of the law's parameters; nu and angles absolute."""
    rows = {}
    for parameter in fit["parameters"]:
        path = parameter["path"]
        row = {"value": parameter["value"], "standard_error": parameter["standard_error"]}
        key = path.split("material.")[-1]
        if key in clip["parameters"]:
            row["truth"] = clip["parameters"][key]
        elif path.endswith("]") and path.split(".")[-1].split("[")[0] in ("velocity", "spin"):
            kind, component = path.split(".")[-1][:-1].split("[")
            row["truth"] = clip[kind][int(component)]
        if "truth" in row:
            row["error"] = row["value"] - row["truth"]
        rows[path.replace("bodies.body.", "")] = row
    return rows


def fit_clip(name, options):
    """One row of the table, from an earlier run where the document is still the same."""
    material = name.split("_")[0]
    clip = json.loads((CLIPS / f"{name}.json").read_text(encoding="utf-8"))
    folder = FITS / name
    document = job_document(material, clip)
    row_path = folder / "row.json"
    if row_path.exists():
        row = json.loads(row_path.read_text(encoding="utf-8"))
        if row["document"] == document:
            return row
    write_inputs(name, folder)
    job = folder / "job.json"
    job.write_text(json.dumps(document, indent=1), encoding="utf-8")
    started = time.monotonic()
    cpu = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
    result, error = run_tool(options.tool, "fit", job, options.threads, folder / "fit.log")
    row = {
        "name": name,
        "material": material,
        "volume": clip["volume"],
        "seconds": time.monotonic() - started,
        "cpu_seconds": resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - cpu,
        "threads": options.threads,
        "document": document,
    }
    if result is None:
        row["failed"] = error
    else:
        fit = result["fit"]
        row.update(score(name, clip, folder, options))
        row["parameters"] = parameter_errors(fit, clip)
        row["fit"] = {key: fit[key] for key in ("converged", "reason", "iterations", "evaluations", "before", "after",
                                                "noise_scale", "statements")}
    row_path.write_text(json.dumps(row, indent=1), encoding="utf-8")
    return row


def line_of(row):
    if "failed" in row:
        return f"{row['name']}: FAILED after {row['seconds']:.0f} s: {row['failed'].splitlines()[-1:]}"
    held = row["fit"]["after"]["held_out"]
    values = ", ".join(
        f"{key.removeprefix('material.')} {p['value']:.4g}" + (f" ({p['truth']:.4g})" if "truth" in p else "")
        for key, p in row["parameters"].items()
    )
    return (
        f"{row['name']}: observable {row['observable']:.3f} (floor {row['observable_floor']:.3f}), "
        f"future {row['future']:.3f} ({row['future_floor']:.3f}), held-out {held['mean_mm']:.2f} mm, "
        f"{row['seconds']:.0f} s, CPU {row['cpu_seconds']:.0f} s, {row['fit']['evaluations']} runs; {values}"
    )


def main():
    require_in_tree()
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--only", nargs="*", default=[], help="names of clips, or their beginnings")
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--again", action="store_true", help="fit again what is done")
    parser.add_argument("--tool", type=pathlib.Path, help="another build of matterfit")
    options = parser.parse_args()
    names = make_clips(options.only, options.threads, options.tool is None)
    options.tool = options.tool or BUILD / "release" / "bin" / "matterfit"
    rows = []
    for name in names:
        if options.again:
            pathlib.Path(FITS / name / "row.json").unlink(missing_ok=True)
        rows.append(fit_clip(name, options))
        say(line_of(rows[-1]))
    table = clip_metrics.markdown(rows)
    print(table)
    (SET / "table.md").write_text(table + "\n", encoding="utf-8")
    (SET / "table.json").write_text(json.dumps(rows, indent=1), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
