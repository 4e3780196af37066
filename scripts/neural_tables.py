# SPDX-License-Identifier: GPL-3.0-or-later
"""Fits laws without a class to clips of the five-material set (docs/validation.md), as Tables 4 and 6 of
the MASIV paper: how much the start matters, and how much the loss.

    neural_tables.py starts|losses [--only CLIP …] [--threads N] [--again]

`starts`: the published law (all of its weights) and the isotropic one, each from jelly, plasticine and
sand; the score of the start law, thrown as the clip was, and that of the fitted one. `losses`: the
latent law fitted to the same points followed (`tracks`), to a cloud without correspondence (`chamfer`)
and to its surface (`surface`, of bodies whose surface stays theirs), beside the law it begins as.
Score − floor of the later frames, in the units of five_materials.py. A fit knows the throw no more
than the class. One clip of each material where --only names none.
Fits that are done for the same document are kept in build/neural_tables.
Progress on standard error; the table as Markdown on standard output and in starts.md or losses.md.
"""

import json
import sys

import clip_fit
import five_materials
import numpy as np
from neural_sequences import law_of
from parts import BUILD, require_in_tree

DONE = BUILD / "neural_tables"
CLIPS = ["elastic_sphere", "newtonian_tee", "nonnewtonian_cross", "plasticine_torus", "sand_box"]
STARTS = ["jelly", "plasticine", "sand"]
LOSSES = ["tracks", "chamfer", "surface"]
NO_SURFACE = ("newtonian", "sand")  # their surface does not stay the same points
TRACKS = 400
OFF_CENTRE = 0.65  # of a spacing: how far off a particle of the surface the centre of its neighbours lies


def clip_of(name):
    return json.loads((five_materials.CLIPS / f"{name}.json").read_text(encoding="utf-8"))


def of_the_surface(rest, volume):
    """A mask of the body's particles that lie at its outside: their neighbours are on one side of them."""
    spacing = np.cbrt(volume / len(rest))
    reach = 2.5 * spacing
    outside = np.zeros(len(rest), bool)
    for begin in range(0, len(rest), 512):
        block = rest[begin:begin + 512]
        away = rest[None] - block[:, None]
        near = (away ** 2).sum(axis=2) < reach ** 2
        centre = (away * near[..., None]).sum(axis=1) / near.sum(axis=1)[:, None]
        outside[begin:begin + 512] = np.linalg.norm(centre, axis=1) > OFF_CENTRE * spacing
    return outside


def write_inputs(name, loss, folder):
    five_materials.write_body(name, folder)
    arrays = np.load(five_materials.CLIPS / f"{name}.npz")
    positions = clip_fit.with_noise(name, arrays["positions"].astype(float))
    if loss == "surface":
        chosen = of_the_surface(positions[0], clip_of(name)["volume"])
        positions = positions[:, chosen]
    every = max(1, positions.shape[1] // TRACKS)
    np.savez(folder / "capture.npz", positions=positions[:, ::every], times=arrays["times"])


def fit_document(name, law, start, loss):
    document = five_materials.job_document(name.split("_")[0], clip_of(name))
    material, numbers, extra = law_of(law, start)
    document["scene"]["bodies"][0]["material"] = material
    document["fit"].update(extra)
    document["fit"]["parameters"] = [*(f"material.{number}" for number in numbers), "velocity", "spin"]
    if loss != "tracks":
        document["fit"]["loss"] = loss
    return document


def truth_of(name):
    truth = np.load(five_materials.CLIPS / f"{name}_truth.npz")
    return truth["truth"], truth["own"], truth["times"]


def before(name, law, start, options):
    """The score of a law as it begins, in the throw that the clip has."""
    folder = DONE / f"{name}_{law}_{start}_before"
    clip = clip_of(name)
    document = fit_document(name, law, start, "tracks")
    document["scene"]["bodies"][0].update(velocity=clip["velocity"], spin=clip["spin"])
    kept = None if options.again else clip_fit.kept_row(folder / "row.json", document)
    if kept is not None:
        return kept
    (folder / "out").mkdir(parents=True, exist_ok=True)
    five_materials.write_body(name, folder)
    for path in (folder / "job.json", folder / "out" / "scene.json"):
        path.write_text(json.dumps(document, indent=1), encoding="utf-8")
    row = {"document": document, **clip_fit.score(folder, *truth_of(name), clip["fitted_frames"], options)}
    (folder / "row.json").write_text(json.dumps(row, indent=1), encoding="utf-8")
    return row


def after(name, law, start, loss, options):
    folder = DONE / f"{name}_{law}_{start}_{loss}"
    truth = truth_of(name)
    arrays = {**np.load(five_materials.CLIPS / f"{name}.npz"), "truth": truth[0], "own": truth[1]}
    row = clip_fit.fit_clip(name, clip_of(name), arrays, folder, fit_document(name, law, start, loss),
                            lambda: write_inputs(name, loss, folder), lambda: truth, options)
    cost = f", {row['cpu_seconds']:.0f} s of CPU, {row['fit']['evaluations']} runs" if "fit" in row else ""
    print(f"{name}, {law}, {start}, {loss}: {cell(row)}{cost}", file=sys.stderr, flush=True)
    return row


def cell(row):
    if "future" not in row:
        return "failed: " + clip_fit.last_words(row)
    return f"{row['future'] - row['future_floor']:.3f}"


def mean_of(cells):
    """The mean of a column's texts; empty where one of them failed."""
    texts = [text for text in cells if text]
    if not texts or any(text.startswith("failed") for text in texts):
        return ""
    return f"{np.mean([float(text) for text in texts]):.3f}"


def markdown(heads, rows):
    lines = ["| " + " | ".join(heads) + " |", "|---" * len(heads) + "|"]
    lines += ["| " + " | ".join(row) + " |" for row in rows]
    lines.append("| **mean** | " + " | ".join(mean_of(column) for column in list(zip(*rows, strict=True))[1:]) + " |")
    return "\n".join(lines)


def starts_table(names, options):
    columns = [(law, start) for law in ("published", "isotropic") for start in STARTS]
    heads = ["clip", *(f"{law}, {start}: {when}" for law, start in columns for when in ("before", "after"))]
    rows = []
    for name in names:
        row = [name]
        for law, start in columns:
            row += [cell(before(name, law, start, options)), cell(after(name, law, start, "tracks", options))]
        rows.append(row)
    return markdown(heads, rows)


def losses_table(names, options):
    rows = []
    for name in names:
        row = [name, cell(before(name, "latent", "jelly", options))]
        for loss in LOSSES:
            without = loss == "surface" and name.startswith(NO_SURFACE)
            row.append("" if without else cell(after(name, "latent", "jelly", loss, options)))
        rows.append(row)
    return markdown(["clip", "as it begins", *LOSSES], rows)


def main():
    require_in_tree()
    parser = clip_fit.arguments(__doc__)
    parser.add_argument("table", choices=["starts", "losses"])
    options = parser.parse_args()
    names = five_materials.make_clips(options.only or CLIPS, options.threads, options.tool is None)
    DONE.mkdir(parents=True, exist_ok=True)
    table = starts_table(names, options) if options.table == "starts" else losses_table(names, options)
    print(table)
    (DONE / f"{options.table}.md").write_text(table + "\n", encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
