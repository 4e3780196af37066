# SPDX-License-Identifier: GPL-3.0-or-later
"""Fits laws to one, two or three sequences of an object and predicts one that no fit saw (docs/validation.md).

    neural_sequences.py [--only OBJECT …] [--laws LAW …] [--sequences N …] [--threads N] [--again]

Objects: egg, bread, cream, pawn, and a rubber of a law that the solver does not have; four sequences
each, turned, thrown and spun at random by the reference simulator (five_materials --set objects).
Trained on the first one, two or three, tested on the fourth. Laws: `published` (all its weights
moved), `isotropic`, `latent`, `classical` (the best of five by its own hold-out) and `correction`
(beside that one). A fit sees 400 tracks with .5 mm of noise of the first twelve frames of each
sequence it is trained on; whatever is chosen is chosen by the four frames after them. It knows
neither the class (but for `correction`, which begins where `classical` ended) nor the throw of
these; of the fourth sequence it is told the throw.
Rows that are done for the same document are kept, each in its own folder of build/neural_sequences,
so that several of these programs may run beside each other.
Progress on standard error; the table as Markdown on standard output and in table.md.
"""

import json
import subprocess
import sys
import time

import clip_fit
import clip_metrics
import numpy as np
from parts import BUILD, ROOT, require_in_tree

DONE = BUILD / "neural_sequences"
CLIPS = DONE / "clips"
OBJECTS = ["egg", "bread", "cream", "pawn", "rubber"]
LAWS = ["published", "isotropic", "latent", "classical", "correction"]
CLASSICAL = ["neo_hookean", "von_mises", "herschel_bulkley", "drucker_prager", "newtonian"]
TEST = 4
SPACING = 0.02  # of the simulator's grid [m]
SEPARATION = 0.02  # of the fits' particles [m]
TRACKS = 400
ITERATIONS = 10
WEIGHTS = 8  # steps of all weights
CORRECTION = 8  # steps of a correction
START = {"E": 1e5, "nu": 0.3}
FLOW = ("yield_strain", "internal_friction", "tear_strain", "flow_rate")


def say(text):
    print(text, file=sys.stderr, flush=True)


def clip_of(name):
    return json.loads((CLIPS / f"{name}.json").read_text(encoding="utf-8"))


def make_clips(only, options):
    """Makes the sequences that are missing, and builds what it takes."""
    targets = ["five_materials", *([] if options.tool else ["matterfit_tool"])]
    build = ["bash", ROOT / "scripts" / "build.sh", *targets]
    if not options.built and subprocess.run(build, check=False, stdout=sys.stderr).returncode != 0:
        sys.exit(1)
    missing = [f"{name}_{k}" for name in only for k in range(1, TEST + 1) if not (CLIPS / f"{name}_{k}.json").exists()]
    if missing:
        say(f"Making {len(missing)} sequences in {CLIPS}")
        program = BUILD / "release" / "bin" / "five_materials"
        command = [program, "--set", "objects", "--dx", str(SPACING), "--folder", CLIPS,
                   "--threads", str(options.threads), "--only", ",".join(missing)]
        if subprocess.run(command, check=False).returncode != 0:
            sys.exit(1)


def body_of(name, material):
    clip = clip_of(name)
    return {"name": "body", "source": {"points": f"rest_{name}.npz"}, "density": clip["density"],
            "material": material, "formulation": "updated"}


def scene_of(name, material):
    clip = clip_of(name)
    contact = {"kind": "glue", "method": "node"}  # known: the simulator's floor holds whole nodes
    return {"fps": clip["fps"], "frames": [0, clip["frames"]], "gravity": clip["gravity"],
            "particle_separation": SEPARATION, "bodies": [body_of(name, material)],
            "colliders": [{"name": "ground", "shape": "ground", "height": clip["ground"], "contact": contact}]}


def write_inputs(name, folder):
    """The points of a sequence's body, and its tracks with noise."""
    arrays = np.load(CLIPS / f"{name}.npz")
    np.savez(folder / f"rest_{name}.npz", positions=arrays["rest"])
    every = max(1, arrays["positions"].shape[1] // TRACKS)
    tracks = clip_fit.with_noise(name, arrays["positions"].astype(float))[:, ::every][:, :TRACKS]
    np.savez(folder / f"tracks_{name}.npz", positions=tracks, times=arrays["times"])


def law_of(law, start="jelly"):
    """What of a document is the law's: its material, the numbers that are fitted, more of `fit`."""
    if law == "published":
        return {"law": "neural", "weights": start}, [], {"weights": WEIGHTS}
    if law == "isotropic":
        return {"law": "neural_isotropic", "weights": start}, ["E", "nu", "form_1", "form_2", *FLOW], {}
    material = {"law": "neo_hookean", **START}
    if law == "latent":
        return material, [], {"laws": ["latent"]}
    return material, ["E", "nu"], {"laws": CLASSICAL}


def fit_document(names, law, classical):
    """`classical`: the fitted material of the row `classical`, for `correction`."""
    if law == "correction":
        material, extra = classical, {"correction": CORRECTION}
        numbers = [key for key in classical if key in ("E", "nu", "yield_stress", "viscosity", "friction_angle",
                                                       "bulk_modulus")]
    else:
        material, numbers, extra = law_of(law)
    fit = {"iterations": ITERATIONS, **extra}
    paths = [f"material.{number}" for number in numbers]
    captures = []
    for k, name in enumerate(names):
        clip = clip_of(name)
        capture = {"name": name, "tracks": f"tracks_{name}.npz", "noise": clip_fit.NOISE,
                   "holdout": {"frames": [clip["fitted_frames"], clip["frames"]]}}
        if k > 0:
            capture["scene"] = {"bodies": [{"name": "body", "source": {"points": f"rest_{name}.npz"},
                                            "velocity": [0.0, 0.0, 0.0], "spin": [0.0, 0.0, 0.0]}]}
        paths += ["velocity", "spin"] if k == 0 else [f"captures.{name}.velocity", f"captures.{name}.spin"]
        captures.append(capture)
    return {"schema": "matterfit.job/1", "task": "fit", "scene": scene_of(names[0], material),
            "captures": captures, "fit": {"parameters": paths, **fit}, "output": {"folder": "out"}}


def predict(name, folder, material, options):
    """Scores of a sequence that is simulated with a material: frames after the first, which is given."""
    clip = clip_of(name)
    truth = np.load(CLIPS / f"{name}_truth.npz")
    write_inputs(name, folder)
    np.savez(folder / "own.npz", positions=truth["own"], times=truth["times"])
    scene = scene_of(name, material)
    scene["bodies"][0].update(velocity=clip["velocity"], spin=clip["spin"])
    document = {"schema": "matterfit.job/1", "task": "compare", "scene": scene,
                "captures": [{"name": "own", "tracks": "own.npz", "noise": clip_fit.NOISE}],
                "output": {"folder": "predicted"}}
    path = folder / "predict.json"
    path.write_text(json.dumps(document, indent=1), encoding="utf-8")
    result, error = clip_fit.run_tool(options, "compare", path, folder / "predict.log")
    if result is None:
        return {"failed": error}
    simulated = np.load(folder / "predicted" / "simulated.npz")["positions"]
    scores = clip_metrics.clip_scores(truth["truth"], truth["own"], simulated, 1)
    return {"score": scores["future"], "floor": scores["future_floor"], "mm": scores["future_track_mm"]}


def folder_of(thing, law, count):
    return DONE / f"{thing}_{law}_{count}"


def row_of(thing, law, count):
    """The row of the newest run, if there is one."""
    path = folder_of(thing, law, count) / "row.json"
    return json.loads(path.read_text(encoding="utf-8")) if path.exists() else None


def fit_one(thing, law, count, options):
    """A row: from an earlier run where the document is still the same."""
    names = [f"{thing}_{k}" for k in range(1, count + 1)]
    key = f"{thing} {law} {count}"
    classical = None
    if law == "correction":
        before = fit_one(thing, "classical", count, options)
        if "material" not in before:
            return {"failed": "the classical law failed"}
        classical = before["material"]
    document = fit_document(names, law, classical)
    folder = folder_of(thing, law, count)
    kept = None if options.again else clip_fit.kept_row(folder / "row.json", document)
    if kept is not None:
        return kept
    folder.mkdir(parents=True, exist_ok=True)
    for name in names:
        write_inputs(name, folder)
    job = folder / "job.json"
    job.write_text(json.dumps(document, indent=1), encoding="utf-8")
    started = time.monotonic()
    result, error = clip_fit.run_tool(options, "fit", job, folder / "fit.log")
    row = {"document": document, "seconds": time.monotonic() - started}
    if result is None:
        row["failed"] = error
    else:
        fit = result["fit"]
        fitted = json.loads((folder / "out" / "scene.json").read_text(encoding="utf-8"))
        row["material"] = fitted["scene"]["bodies"][0]["material"]
        row["fit"] = {name: fit[name] for name in ("law", "evaluations", "before", "after", "statements", "warning")}
        row["taken"] = all(fit[name]["taken"] for name in ("weights", "correction") if name in fit)
        row.update(predict(f"{thing}_{TEST}", folder, row["material"], options))
    say(f"{key}: " + (row["failed"][-300:] if "failed" in row else
                      f"{row['score'] - row['floor']:.3f}, {row['mm']:.1f} mm, {row['seconds']:.0f} s, "
                      f"{row['fit']['law']}, {row['fit']['evaluations']} runs"))
    (folder / "row.json").write_text(json.dumps(row, indent=1), encoding="utf-8")
    return row


def cell(row):
    if row is None:
        return ""
    if "failed" in row:
        return "failed"
    name = f" ({row['fit']['law']})" if len(row["document"]["fit"].get("laws", [])) > 1 else ""
    return f"{row['score'] - row['floor']:.3f}, {row['mm']:.0f} mm{name}" + ("" if row["taken"] else ", not taken")


def table_of(options):
    """A line for each object and number of sequences: score − floor of the unseen one, mean distance."""
    lines = ["| object, sequences | " + " | ".join(options.laws) + " |", "|---" * (len(options.laws) + 1) + "|"]
    for count in options.sequences:
        for thing in options.only:
            cells = [cell(row_of(thing, law, count)) for law in options.laws]
            if any(cells):
                lines.append(f"| {thing}, {count} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def main():
    require_in_tree()
    parser = clip_fit.arguments(__doc__)
    parser.add_argument("--laws", nargs="*", default=LAWS, choices=LAWS)
    parser.add_argument("--sequences", nargs="*", type=int, default=[1, 2, 3], choices=[1, 2, 3])
    parser.add_argument("--built", action="store_true", help="build nothing")
    options = parser.parse_args()
    options.only = options.only or OBJECTS
    if unknown := [name for name in options.only if name not in OBJECTS]:
        sys.exit("neural_sequences.py: no object is called " + ", ".join(unknown))
    DONE.mkdir(parents=True, exist_ok=True)
    make_clips(options.only, options)
    for count in options.sequences:
        for thing in options.only:
            for law in options.laws:
                fit_one(thing, law, count, options)
    table = table_of(options)
    print(table)
    (DONE / "table.md").write_text(table + "\n", encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
