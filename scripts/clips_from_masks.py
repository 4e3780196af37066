# SPDX-License-Identifier: GPL-3.0-or-later
"""Films clips of other simulators and fits them from masks alone (docs/validation.md).

    clips_from_masks.py [FOLDER] [--only NAME …] [--views N] [--size W] [--coarser F] [--seed N]
                        [--threads N] [--colours] [--again]

FOLDER holds clips as other_simulators.py takes them. A surface around all particles of the first frame
is carried along by moving least squares over the tracks and filmed by Cycles (film_mattes.py, which
needs `blender`): N cameras that are fitted (10) and camera 0, which is kept out, W² pixels (400). The
fit knows the first frame's shape, the law and the cameras; it sees the mattes of the first seven tenths
and starts from other_simulators.py's guesses and at rest, without the spin where the clip says none.
--coarser: particles F times as far apart as the simulator's (1), with the solver's own substep.
--colours: the bodies are painted with cells, which the fit sees too, and the table has PSNR and SSIM of the
camera that is kept out.
Results are kept in build/clips_from_masks. Progress on standard error; the table as Markdown on standard
output.
"""

import json
import pathlib
import struct
import subprocess
import sys

import clip_body
import clip_fit
import numpy as np
from other_simulators import job_document
from parts import BUILD, ROOT, require_in_tree

DONE = BUILD / "clips_from_masks"
NEIGHBOURS = 20
NOISE_PIXELS = 0.5


def weights_of(points, tracks):
    """(P, K) indices and weights by which tracks carry points: moving least squares of first order."""
    indices, weights = [], []
    for begin in range(0, len(points), 512):
        block = points[begin:begin + 512]
        squared = ((block[:, None, :] - tracks[None, :, :]) ** 2).sum(axis=2)
        near = np.argpartition(squared, NEIGHBOURS, axis=1)[:, :NEIGHBOURS]
        away = tracks[near] - block[:, None, :]
        distance = np.sqrt(np.take_along_axis(squared, near, axis=1))
        kernel = np.maximum(1.0 - (distance / (1.05 * distance.max(axis=1, keepdims=True))) ** 2, 0.0) ** 2
        scale = distance.mean(axis=1)[:, None, None]
        rows = np.concatenate([np.ones((*near.shape, 1)), away / scale], axis=2)
        moments = np.einsum("pk,pki,pkj->pij", kernel, rows, rows) + 1e-6 * np.eye(4)
        first = np.linalg.solve(moments, np.tile(np.eye(4)[:, :1], (len(block), 1, 1)))[:, :, 0]
        indices.append(near)
        weights.append(kernel * np.einsum("pki,pi->pk", rows, first))
    return np.concatenate(indices), np.concatenate(weights)


def write_motion(folder, rest, positions):
    """The body's surface and its motion, as film_mattes.py reads them."""
    vertices, quads = clip_body.surface_of_points(rest)
    near, weight = weights_of(vertices, positions[0])
    folder.mkdir(parents=True, exist_ok=True)
    lines = [f"v {x:.6f} {y:.6f} {z:.6f}" for x, y, z in vertices]
    lines += ["f " + " ".join(str(corner + 1) for corner in quad) for quad in quads]
    (folder / "body.obj").write_text("\n".join(lines) + "\n", encoding="utf-8")
    with open(folder / "body.pc2", "wb") as stream:
        stream.write(struct.pack("<12siiffi", b"POINTCACHE2\0", 1, len(vertices), 0.0, 1.0, len(positions)))
        for frame in positions:
            moved = np.einsum("pk,pki->pi", weight, frame[near])
            stream.write(moved.astype("<f4").tobytes())


def film_name(options):
    return f"film_{options.views}_{options.size}_{options.seed}" + ("_coloured" if options.colours else "")


def film(folder, rest, positions, options):
    """The folder of the images, made where they are not there."""
    images = folder / film_name(options)
    if (images / "transforms.json").exists():
        return images
    write_motion(folder, rest, positions)
    command = ["blender", "-b", "--factory-startup", "--python-exit-code", "1", "-t", str(options.threads), "-P",
               ROOT / "scripts" / "film_mattes.py", "--", folder / "body.obj", folder / "body.pc2", images,
               "--cameras", str(options.views + 1), "--size", str(options.size), str(options.size),
               "--seed", str(options.seed), "--samples", "16", *(["--colours"] if options.colours else [])]
    with open(folder / "film.log", "w", encoding="utf-8") as log:
        subprocess.run(command, check=True, stdout=log, stderr=subprocess.STDOUT)
    return images


def document_of(name, clip, rest, frames, options):
    document = job_document(name, clip, rest, frames)
    document["captures"] = [{
        "name": name,
        "cameras": film_name(options) + "/transforms.json",
        "noise": NOISE_PIXELS,
        "fps": clip["fps"],
        "holdout": {"frames": document["captures"][0]["holdout"]["frames"], "cameras": [0]},
    }]
    if options.colours:
        document["captures"][0]["colours"] = True
    if not any(clip.get("spin", [0])):
        document["fit"]["parameters"].remove("spin")
    return document


def fit_one(path, options):
    name = path.stem
    clip = json.loads(path.read_text(encoding="utf-8"))
    arrays = np.load(path.with_suffix(".npz"))
    positions = arrays["positions"].astype(float)
    rest = arrays["rest"].astype(float)
    folder = DONE / (f"{name}_{options.views}" + ("_coloured" if options.colours else ""))
    film(folder, rest, positions, options)
    document = document_of(name, clip, rest, len(positions), options)
    kept = clip_fit.coarsened(document, rest, options.coarser, options.seed)

    def write_inputs():
        np.savez(folder / "rest.npz", positions=kept)

    row = clip_fit.fit_clip(name, clip, arrays, folder, document, write_inputs,
                            lambda: (positions[:, ::2], positions[:, 1::2], arrays["times"]), options)
    if "failed" not in row:
        result = json.loads((folder / "out" / "result.json").read_text(encoding="utf-8"))
        row["silhouettes"] = result["fit"]["silhouettes"]["after"]
    if options.colours and "failed" not in row:
        row["colours"] = colours_of(folder, document, options)
    return row


def colours_of(folder, document, options):
    """PSNR [dB] and SSIM of the images that the fit has not seen, at their full size."""
    result, error = clip_fit.compared(folder, "views", document["captures"], options)
    if result is None:
        sys.exit(f"clips_from_masks.py: {folder / 'views.json'}: {error}")
    held = result["compare"]["images"][0]["held_out"]
    return held["psnr_db"], held["ssim"]


def markdown(rows, options):
    lines = [
        f"| clip, {options.views} views | observable: score − floor; tracks, mm | future: the same "
        f"| held out: IoU, outlines apart{', PSNR, SSIM' if options.colours else ''} | found ± error (true) "
        "| runs, time, s |",
        "|---|---|---|---|---|---|",
    ]
    for row in rows:
        if "failed" in row:
            lines.append(f"| {row['name']} | failed: {clip_fit.last_words(row)} | | | | {row['seconds']:.0f} |")
            continue
        parts = [f"{row[part] - row[part + '_floor']:.3f}; {row[part + '_track_mm']:.1f}"
                 for part in ("observable", "future")]
        held = row["silhouettes"]["held_out"]
        found = ", ".join(
            f"{key.removeprefix('material.')} {p['value']:.4g} ± {p['standard_error'] or float('nan'):.2g}"
            + (f" ({p['truth']:.4g})" if "truth" in p else "")
            for key, p in row["parameters"].items() if key.startswith("material."))
        colours = ", {:.1f} dB, {:.3f}".format(*row["colours"]) if "colours" in row else ""
        lines.append(f"| {row['name']} | {parts[0]} | {parts[1]} | {held['iou']:.3f}, {held['contour_px']:.2f} px"
                     f"{colours} | {found} | {row['fit']['evaluations']}, {row['seconds']:.0f} |")
    return "\n".join(lines)


def main():
    require_in_tree()
    parser = clip_fit.arguments(__doc__)
    clip_fit.add_coarser(parser)
    parser.add_argument("folder", type=pathlib.Path, nargs="?",
                        default=ROOT / ".." / "shared" / "data" / "other_simulators")
    parser.add_argument("--views", type=int, default=10)
    parser.add_argument("--size", type=int, default=400)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--colours", action="store_true")
    options = parser.parse_args()
    paths = sorted(path for path in options.folder.glob("*.json")
                   if not options.only or any(path.stem.startswith(only) for only in options.only))
    if not paths:
        sys.exit(f"clips_from_masks.py: there is no such NAME.json in {options.folder}")
    rows = []
    for path in paths:
        rows.append(fit_one(path, options))
        print(clip_fit.line_of(rows[-1]), file=sys.stderr, flush=True)
    table = markdown(rows, options)
    print(table)
    name = f"table_{options.views}{'_coloured' if options.colours else ''}.md"
    DONE.joinpath(name).write_text(table + "\n", encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
