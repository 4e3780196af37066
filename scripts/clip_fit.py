# SPDX-License-Identifier: GPL-3.0-or-later
"""A fit of one clip of another simulator by the tool, kept on disk, and its score."""

import argparse
import hashlib
import json
import pathlib
import resource
import subprocess
import time
import zlib

import clip_metrics
import numpy as np
from parts import BUILD

NOISE = 0.0005  # [m]


def arguments(description):
    """What the scripts that fit clips take from the command line, to be added to."""
    parser = argparse.ArgumentParser(description=description, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--only", nargs="*", default=[], help="names of clips, or their beginnings")
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--again", action="store_true", help="fit again what is done")
    parser.add_argument("--tool", type=pathlib.Path, help="another build of matterfit")
    return parser


def with_noise(name, positions):
    """The tracks of a clip as a fit sees them: the same noise each time."""
    random = np.random.default_rng(zlib.crc32(name.encode()))
    return positions + random.normal(0.0, NOISE, positions.shape)


def add_coarser(parser):
    parser.add_argument("--coarser", type=float, default=1.0,
                        help="particles so many times as far apart, with the solver's own substep")


def coarsened(document, rest, factor, seed=1):
    """Particles of a document `factor` times as far apart, with the solver's own substep; so many fewer of
    `rest`, chosen by the seed."""
    if factor == 1.0:
        return rest
    scene = document["scene"]
    scene["particle_separation"] *= factor
    scene.pop("solver", None)
    return rest[np.random.default_rng(seed).permutation(len(rest))[:int(len(rest) / factor ** 3)]]


def tool_of(options):
    return options.tool or BUILD / "release" / "bin" / "matterfit"


def run_tool(options, verb, document, log, restart=True):
    """The tool's result, or None and its last words."""
    command = [tool_of(options), verb, document, "--json", "--quiet", "--threads", str(options.threads)]
    if restart:
        command.append("--restart")
    with open(log, "w", encoding="utf-8") as errors:
        done = subprocess.run(command, stdout=subprocess.PIPE, stderr=errors, text=True, check=False)
    if done.returncode == 0:
        return json.loads(done.stdout), ""
    return None, log.read_text(encoding="utf-8", errors="replace").strip()[-600:]


def compared(folder, name, captures, options):
    """The tool's comparison of the fitted scene with `captures`, into folder/name; None and its last words
    where it fails."""
    document = json.loads((folder / "out" / "scene.json").read_text(encoding="utf-8"))
    document.pop("fit", None)
    document.update(task="compare", captures=captures, output={"folder": name})
    sources = json.loads((folder / "job.json").read_text(encoding="utf-8"))["scene"]["bodies"]
    for body, given in zip(document["scene"]["bodies"], sources, strict=True):
        body["source"] = given["source"]
    path = folder / f"{name}.json"
    path.write_text(json.dumps(document, indent=1), encoding="utf-8")
    return run_tool(options, "compare", path, folder / f"{name}.log")


def score(folder, truth, own, times, fitted_frames, options):
    """Runs the fitted scene with the points `own` (frames, points, 3) and compares them with `truth`,
    which shares none with them."""
    np.savez(folder / "own.npz", positions=own, times=times)
    captures = [{"name": "own", "tracks": "own.npz", "noise": NOISE}]
    result, error = compared(folder, "score", captures, options)
    if result is None:
        return {"failed": error}
    simulated = np.load(folder / "score" / "simulated.npz")["positions"]
    metrics = clip_metrics.clip_scores(truth, own, simulated, fitted_frames)
    metrics["particles"] = result["particles"]
    metrics["body_volume"] = result["bodies"][0]["volume_m3"]
    return metrics


def _parameter_errors(fit, clip):
    """Values, standard errors and, where the clip says the truth, the differences from it."""
    rows = {}
    for parameter in fit["parameters"]:
        path = parameter["path"]
        row = {key: parameter.get(key) for key in ("value", "standard_error", "grid_error", "interval")}
        key = path.split("material.")[-1]
        kind, _, component = path.split(".")[-1].partition("[")
        if key in clip.get("parameters", {}):
            row["truth"] = clip["parameters"][key]
        elif kind in ("velocity", "spin") and kind in clip:
            row["truth"] = clip[kind][int(component.rstrip("]"))]
        if "truth" in row:
            row["error"] = row["value"] - row["truth"]
        rows[path.replace("bodies.body.", "")] = row
    return rows


def fingerprint(clip, arrays):
    """A hash of a clip: its JSON, and its arrays by name."""
    found = hashlib.sha256(json.dumps(clip, sort_keys=True).encode())
    for key in sorted(arrays):
        array = np.ascontiguousarray(arrays[key])
        found.update(f"{key} {array.dtype.str} {array.shape}".encode())
        found.update(array.tobytes())
    return found.hexdigest()


def kept_row(path, document, clip_hash=None):
    """The row of an earlier run of the same document and clip, or None. Older rows have no hash of
    their clip and are taken as they are; one that failed is not taken."""
    if not path.exists():
        return None
    row = json.loads(path.read_text(encoding="utf-8"))
    same = row["document"] == document and row.get("clip_hash", clip_hash) == clip_hash
    return row if same and "failed" not in row else None


def fit_clip(name, clip, arrays, folder, document, write_inputs, truth_and_own, options):
    """One row of a table, from an earlier run where the document and the clip, with all of its
    `arrays`, are still the same. `write_inputs()` puts what the document names into `folder`;
    `truth_and_own()` gives the arrays of `score`."""
    row_path = folder / "row.json"
    clip_hash = fingerprint(clip, arrays)
    row = None if options.again else kept_row(row_path, document, clip_hash)
    if row is not None:
        return row
    row_path.unlink(missing_ok=True)
    folder.mkdir(parents=True, exist_ok=True)
    write_inputs()
    job = folder / "job.json"
    text = json.dumps(document, indent=1)
    # What was broken off goes on: a fit at another simulator's substep may take half an hour.
    broken_off = (folder / "out" / "fit" / "checkpoint.json").exists() and job.read_text(encoding="utf-8") == text
    job.write_text(text, encoding="utf-8")
    started = time.monotonic()
    cpu = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
    log = folder / "fit.log"
    result, error = run_tool(options, "fit", job, log, restart=options.again or not broken_off)
    if result is None and broken_off and "--restart" in error:  # it was broken off by another version
        result, error = run_tool(options, "fit", job, log)
    row = {
        "name": name,
        "seconds": max(time.monotonic() - started, result["fit"]["seconds"] if result else 0.0),
        "cpu_seconds": resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - cpu,
        "threads": options.threads,
        "document": document,
        "clip_hash": clip_hash,
    }
    if result is None:
        row["failed"] = error
    else:
        fit = result["fit"]
        row["parameters"] = _parameter_errors(fit, clip)
        row["fit"] = {key: fit[key] for key in ("converged", "reason", "iterations", "evaluations", "before", "after",
                                                "noise_scale", "statements")}
        fitted_frames = document["captures"][0]["holdout"]["frames"][0]
        row.update(score(folder, *truth_and_own(), fitted_frames, options))
    if "failed" not in row:
        row_path.write_text(json.dumps(row, indent=1), encoding="utf-8")
    return row


def last_words(row):
    return (row["failed"].splitlines() or ["it said nothing"])[-1]


def held_out_mm(row, when):
    """Mean error of what was held out `before` or `after`; NaN: not simulated."""
    held = row["fit"][when]["held_out"]
    return held["mean_mm"] if held else float("nan")


def line_of(row):
    if "failed" in row:
        return f"{row['name']}: FAILED after {row['seconds']:.0f} s: {last_words(row)}"
    values = ", ".join(
        f"{key.removeprefix('material.')} {p['value']:.4g}" + (f" ({p['truth']:.4g})" if "truth" in p else "")
        for key, p in row["parameters"].items()
    )
    return (
        f"{row['name']}: observable {row['observable']:.3f} (floor {row['observable_floor']:.3f}), "
        f"future {row['future']:.3f} ({row['future_floor']:.3f}), held-out {held_out_mm(row, 'after'):.2f} mm, "
        f"{row['seconds']:.0f} s, CPU {row['cpu_seconds']:.0f} s, {row['fit']['evaluations']} runs; {values}"
    )
