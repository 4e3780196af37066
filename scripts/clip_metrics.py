# SPDX-License-Identifier: GPL-3.0-or-later
"""Scores of the five-material set, and its table."""

import numpy as np

MATERIALS = ["elastic", "newtonian", "nonnewtonian", "plasticine", "sand"]


def chamfer(a, b):
    """Mean squared distance to the nearest point of the other set, both ways summed [m²]."""
    centre = a.mean(axis=0)
    a = np.asarray(a, float) - centre
    b = np.asarray(b, float) - centre
    b_squared = (b * b).sum(axis=1)
    from_b = np.full(len(b), np.inf)
    from_a = 0.0
    for begin in range(0, len(a), 1024):
        block = a[begin : begin + 1024]
        squared = (block * block).sum(axis=1)[:, None] + b_squared - 2.0 * block @ b.T
        from_a += np.maximum(squared.min(axis=1), 0.0).sum()
        np.minimum(from_b, squared.min(axis=0), out=from_b)
    return from_a / len(a) + np.maximum(from_b, 0.0).mean()


def clip_scores(truth, own, simulated, fitted_frames):
    """Chamfer distances ×1e3 [m²] over the fitted and the later frames: of the simulated points
    against the truth, and, the floor, of the same points as they truly moved. Track errors [mm] of
    the simulated points. Each array (frames, points, 3); `truth` shares no particle with the others."""
    scores = np.array([[chamfer(t, s), chamfer(t, o)] for t, o, s in zip(truth, own, simulated, strict=True)]) * 1e3
    distance = np.linalg.norm(simulated - own, axis=2).mean(axis=1) * 1e3
    parts = {"observable": slice(0, fitted_frames), "future": slice(fitted_frames, None)}
    result = {"score_frames": scores[:, 0].tolist(), "floor_frames": scores[:, 1].tolist()}
    for name, part in parts.items():
        result[name] = float(scores[part, 0].mean())
        result[name + "_floor"] = float(scores[part, 1].mean())
        result[name + "_track_mm"] = float(distance[part].mean())
    return result


def _error_text(rows):
    """Median absolute errors of the law's parameters: of moduli, stresses and viscosities relative."""
    errors = {}
    for row in rows:
        for path, parameter in row["parameters"].items():
            if not path.startswith("material.") or "truth" not in parameter:
                continue
            key = path.removeprefix("material.")
            absolute = key in ("nu", "friction_angle")
            errors.setdefault(key, []).append(abs(parameter["error"]) / (1 if absolute else parameter["truth"]))
    texts = []
    for key, values in errors.items():
        median = np.median(values)
        texts.append({"nu": f"ν {median:.3f}", "friction_angle": f"φ {median:.1f}°"}.get(key, f"{key} {median:.0%}"))
    return ", ".join(texts)


def _row_text(label, rows, everything):
    done = [row for row in rows if "observable" in row]
    if not done:
        return f"| {label} | {len(rows)} | | | | | | | |"

    def mean(key):
        return float(np.mean([row[key] for row in done]))

    held = [np.mean([row["fit"][when]["held_out"]["mean_mm"] for row in done
                     if row["fit"][when]["held_out"] is not None] or [np.nan]) for when in ("before", "after")]
    failed = f" ({len(rows) - len(done)} failed)" if len(done) < len(rows) else ""
    observable = mean("observable") - mean("observable_floor")
    future = mean("future") - mean("future_floor")
    return (
        f"| {label} | {len(done)}{failed} | {mean('volume'):.4f} "
        f"| {mean('observable'):.3f} − {mean('observable_floor'):.3f} = {observable:.3f} "
        f"| {mean('future'):.3f} − {mean('future_floor'):.3f} = {future:.3f} "
        f"| {held[0]:.1f} → {held[1]:.2f} | {'' if everything else _error_text(done)} "
        f"| {np.median([row['seconds'] for row in done]):.0f} |"
    )


def markdown(rows):
    """The table: a line a material, their mean over clips, then a line a clip."""
    lines = [
        "| material | clips | volume, m³ | observable: score − floor | future: score − floor "
        "| held-out, mm: before → after | median errors | time, s (median) |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for material in MATERIALS:
        of_material = [row for row in rows if row["material"] == material]
        if of_material:
            lines.append(_row_text(material, of_material, False))
    lines.append(_row_text("all", rows, True))
    return "\n".join(lines)
