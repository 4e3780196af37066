# SPDX-License-Identifier: GPL-3.0-or-later
"""How the blind benchmark scores verdicts against labels: numbers alone, no files (tested by test_blind.py).

A label is what blind_hide.py sealed, a found what blind_find.py wrote of one case. Names that one recording
cannot tell apart count as one class: TIES, and what the label calls `ties`. What it calls `also` true is
neither right nor false.
"""

import math

import numpy as np

# Exact or near ties of one recording (signatures of cosine > .99 after a refit).
TIES = [
    {"gravity_size", "scale", "frame_rate"},
    {"drag_linear", "drag_quadratic"},
    {"gravity_direction", "camera_roll", "ground_tilt"},
    {"damping_shear", "damping_bulk", "relaxation"},
    {"velocity", "time_offset"},
    {"attached_mass", "density_gradient", "density_inclusion"},
    {"stiffness_inclusion", "stiffness_gradient"},
    {"hidden_collider", "moving_collider"},
]
# What the two columns of the specification ask, by the keys of `figures`.
VECTORS = {  # effects whose numbers are a vector: their names in reports, and of the label's direction
    "wind": ("velocity[0]", "velocity[1]", "velocity[2]"),
    "gravity_direction": ("first", "second"),
    "ground_tilt": ("x", "y"),
    "camera_roll": ("x", "y"),
    "camera_drift": ("x", "y", "z"),
}
WITHIN_90 = {1: 2.706, 2: 4.605, 3: 6.251}  # of χ² with so many degrees of freedom
TRUSTED = ("velocity", "spin", "E", "nu")  # fitted numbers that an extension should set right
NAMES_SOMETHING = ("cause", "class", "several", "measurement")
STRONG = 2.0  # strength in standard deviations from which a class must come first
BINS = 5  # of the calibration


def class_of(effect):
    """The names that count as this one."""
    return next((group for group in TIES if effect in group), {effect})


def wilson(successes, count, z=1.96):
    """The 95 % interval of a share."""
    if count == 0:
        return (0.0, 1.0)
    p, n = successes / count, count
    middle = (p + z * z / (2 * n)) / (1 + z * z / n)
    reach = z / (1 + z * z / n) * math.sqrt(p * (1 - p) / n + z * z / (4 * n * n))
    return (max(0.0, middle - reach), min(1.0, middle + reach))


def share(rows, right):
    """{"value", "interval", "count"} of the rows for which `right` holds."""
    rows = list(rows)
    hits = sum(bool(right(row)) for row in rows)
    return {"value": hits / len(rows) if rows else None, "interval": wilson(hits, len(rows)), "count": len(rows)}


def judged(label, found):
    """One row: what was hidden, what was said, and whether that is right."""
    report = found.get("report") or {}
    verdict = report.get("verdict", "failed")
    names = list(report.get("class", [])) if verdict in NAMES_SOMETHING else []
    truth, also = label["effects"] if label["kind"] not in ("nothing", "outside") else [], set(label.get("also", []))
    tied = [class_of(t) for t in truth]
    first = [group.union(label.get("ties", [])) for group in tied]
    allowed = also.union(*first)
    hit = [any(name in group for name in names) for group in tied]
    accepted = [c for c in report.get("causes", []) if c.get("accepted")]
    top = max(report.get("causes", []), key=lambda c: c.get("probability") or 0.0, default=None)
    row = {
        "case": found.get("case"), "tier": label["tier"], "kind": label["kind"], "hidden": label["effects"],
        "strength": label.get("strength", 0.0), "lambda": label.get("lambda", 0.0), "keep": label.get("keep", 1.0),
        "verdict": verdict, "named": names, "cpu": found.get("cpu_seconds"), "failed": found.get("failed", ""),
        # A cause was named where there is none to be named.
        "false_alarm": bool(names) and not truth and not also.intersection(names),
        "first": bool(truth) and bool(names) and any(names[0] in group for group in first),
        "all": bool(truth) and all(hit),
        "single": len(names) == 1 and verdict in ("cause", "measurement"),
        "false_names": [name for name in names if name not in allowed],
        "not_observable": report.get("not_observable", []),
        "gain": accepted[0].get("gain") if accepted else None,
        "beats_field": None,
        "probability": top.get("probability") if top else None,
        "several": verdict == "several",
        "listed_unobservable": bool(truth) and any(
            name in group for group in tied for name in report.get("not_observable", [])),
        "localisation": localisation(label.get("places"), report),
        "particles": None,
        "top_right": bool(top) and bool(truth) and any(top["effect"] in group for group in first),
        "top": top["effect"] if top else None,
        "unknown": verdict == "unknown",
        "rms_mm": None, "noise_mm": None,
    }
    row["parameter"] = parameter_error(label, accepted)
    row["biases"] = biases_left(label, report)
    row["bias"] = row["biases"].get("velocity")
    row["single_right"] = row["single"] and row["named"][0] in truth
    row["single_class_right"] = row["single"] and (row["named"][0] in allowed)
    if accepted and accepted[0].get("free_field") is not None and accepted[0].get("holdout_after") is not None:
        row["beats_field"] = accepted[0]["holdout_after"] <= accepted[0]["free_field"]
    if report:
        row["rms_mm"] = 1e3 * report["residual"]["train"]["rms"]
        row["noise_mm"] = 1e3 * report["noise"]["sigma"]
        row["nothing_probability"] = report.get("probability", {}).get("nothing")
        row["unknown_probability"] = report.get("probability", {}).get("unknown")
    return row


def body_regions(rest):
    """The region of each point (points, 3), as a report numbers them (native/diagnose/gain.hpp, body_regions):
    halves by the medians along the longest axes. Points that are not finite are in none, -1."""
    known = np.isfinite(rest).all(axis=1)
    points = rest[known]
    region = np.zeros(len(points), dtype=int)
    wide = points.max(axis=0) - points.min(axis=0)
    regions = 1
    for axis in sorted(range(3), key=lambda a: -wide[a]):
        if wide[axis] < 0.25 * wide.max() or regions * 8 > len(points):
            continue
        middle = np.sort(points[:, axis])[len(points) // 2]
        region += regions * (points[:, axis] >= middle)
        regions *= 2
    result = np.full(len(rest), -1)
    result[known] = region
    return result


def localisation(places, report):
    """{"left": F1, "raw": F1} of the frames × body regions that a report calls wrong, against those in which
    the recording is another for what is hidden: after what a fit leaves of it, and as it is. None where
    nothing was hidden or nothing is known."""
    if not places or "residual" not in report or not places.get("raw"):
        return None
    said = {(w["frame"], w["region"]) for w in report["residual"].get("wrong", ())}
    found = {}
    for name in ("left", "raw"):
        true = {tuple(cell) for cell in places[name]}
        both = len(said & true)
        found[name] = 2.0 * both / (len(said) + len(true)) if said or true else None
    return found


def vector_of(effect, size):
    """The numbers that a report has of a label's size with a direction; None where it has no such."""
    if effect not in VECTORS or "direction" not in size:
        return None
    direction = size["direction"]
    if effect == "gravity_direction":
        # Across (0, 0, -1): Eigen's unitOrthogonal of it, and the cross product with it.
        across = np.array([0.0, 1.0, 0.0])
        axes = (across, np.cross([0.0, 0.0, -1.0], across))
        return [size["expected"] * float(np.dot(direction, axis)) for axis in axes]
    return [size["expected"] * part for part in direction[: len(VECTORS[effect])]]


def vector_error(effect, size, parameters):
    """As parameter_error(), of all numbers of a vector together: the length of the error over the truth's, the
    angle between them [°], and whether the 90 % ellipse of the stated errors holds the truth."""
    truth = vector_of(effect, size)
    found = [parameters.get(name) for name in VECTORS.get(effect, ())]
    if truth is None or any(p is None or p["value"] is None or p["stderr"] is None for p in found):
        return None
    off = [p["value"] - t for p, t in zip(found, truth, strict=True)]
    chi = sum((o / p["stderr"]) ** 2 if p["stderr"] > 0.0 else math.inf for o, p in zip(off, found, strict=True))
    value, length = [p["value"] for p in found], math.hypot(*truth)
    cosine = sum(v * t for v, t in zip(value, truth, strict=True)) / max(math.hypot(*value) * length, 1e-300)
    return {"relative": math.hypot(*off) / length, "covered": chi <= WITHIN_90[len(off)],
            "angle": math.degrees(math.acos(max(-1.0, min(1.0, cosine))))}


def parameter_error(label, accepted):
    """Relative error of the size of a single effect that was named, and whether its 90 % interval holds the
    truth; of a vector vector_error(). None where there is none."""
    for cause in accepted:
        size = label.get("sizes", {}).get(cause["effect"], {})
        if label["kind"] == "single" and "direction" in size:
            return vector_error(cause["effect"], size, cause.get("parameters", {}))
        number = cause.get("parameters", {}).get(size.get("number"))
        if label["kind"] == "single" and number and number["value"] is not None and number["stderr"] is not None:
            off = abs(number["value"] - size["expected"])
            return {"relative": off / abs(size["expected"]), "covered": off <= 1.645 * number["stderr"]}
    return None


def biases_left(label, report):
    """By TRUSTED: the share of a fitted number's error that the extended model still has, where that error was
    beyond three of its standard errors; only what can be said."""
    if "model" not in report or "truth" not in label:
        return {}
    found = {}
    body = report["model"]["bodies"][0]
    for name in TRUSTED:
        truth = label["truth"].get(name)
        after = body.get(name) if name in ("velocity", "spin") else body.get("material", {}).get(name)
        if truth is None or after is None:
            continue
        several = isinstance(truth, list)
        ends = [f".{name}[{axis}]" for axis in range(3)] if several else [f".material.{name}"]
        fitted = [next((p for p in report["fit"]["parameters"] if p["path"].endswith(end)), None) for end in ends]
        if any(p is None or p["standard_error"] is None for p in fitted):
            continue
        truths, afters = (truth, after) if several else ([truth], [after])
        before = math.hypot(*(p["value"] - t for p, t in zip(fitted, truths, strict=True)))
        if before >= 3.0 * math.hypot(*(p["standard_error"] for p in fitted)) and before > 0.0:
            found[name] = math.hypot(*(v - t for v, t in zip(afters, truths, strict=True))) / before
    return found


def calibration(rows):
    """Reliability of the largest probability, that of the first cause, of `nothing` or of `unknown`: bins of
    stated and true shares, the expected calibration error and Brier's score."""
    pairs = []
    for row in rows:
        if row["probability"] is None:
            continue
        pairs.append(max([(row["probability"], row["top_right"]),
                          (row.get("nothing_probability") or 0.0, row["kind"] == "nothing"),
                          (row.get("unknown_probability") or 0.0, row["kind"] == "outside")],
                         key=lambda pair: pair[0]))
    bins = []
    for b in range(BINS):
        inside = [p for p in pairs if min(BINS - 1, int(p[0] * BINS)) == b]
        if inside:
            bins.append({"stated": sum(p[0] for p in inside) / len(inside),
                         "true": sum(p[1] for p in inside) / len(inside), "count": len(inside)})
    count = sum(b["count"] for b in bins)
    return {
        "bins": bins, "count": count,
        "expected_error": sum(b["count"] * abs(b["stated"] - b["true"]) for b in bins) / count if count else None,
        "brier": sum((p - right) ** 2 for p, right in pairs) / count if count else None,
    }


def confusion(rows):
    """Counts of what was said, by what was hidden; the first name of a verdict, or the verdict."""
    table = {}
    for row in rows:
        hidden = " + ".join(row["hidden"]) if row["hidden"] else "nothing"
        said = row["named"][0] if row["named"] else row["verdict"]
        if len(row["named"]) > 1:
            said += " or others" if row["verdict"] == "class" else " and others"
        table.setdefault(hidden, {})[said] = table.setdefault(hidden, {}).get(said, 0) + 1
    return table


def power(rows):
    """Share of single effects whose class comes first, by strength [σ]."""
    edges = [0.0, 1.0, 2.0, 4.0, 8.0, 16.0, math.inf]
    single = [r for r in rows if r["kind"] == "single" and r["strength"] is not None]
    curve = []
    for low, high in zip(edges, edges[1:], strict=False):
        inside = [r for r in single if low <= r["strength"] < high]
        if inside:
            curve.append({"from": low, "to": high if math.isfinite(high) else None,
                          **share(inside, lambda r: r["first"])})
    return curve


def power_by_lambda(rows):
    """By tier: the share of single effects whose class comes first, by the signal λ = N s²."""
    edges = [0.0, *(10.0**k for k in range(1, 8)), math.inf]
    curves = {}
    for row in rows:
        if row["kind"] == "single" and row["lambda"] is not None:
            curves.setdefault(row["tier"], []).append(row)
    result = {}
    for tier, single in sorted(curves.items()):
        result[tier] = []
        for low, high in zip(edges, edges[1:], strict=False):
            inside = [r for r in single if low <= r["lambda"] < high]
            if inside:
                result[tier].append({"from": low, "to": high if math.isfinite(high) else None,
                                     **share(inside, lambda r: r["first"])})
    return result


def quantile(values, part):
    """Of what is not None; the value below which that part of them lies (linear between neighbours)."""
    values = [v for v in values if v is not None]
    return float(np.quantile(values, part)) if values else None


def is_strong(row):
    """Whether a class must come first: at λ ≥ 100 where the solver is our own, else from STRONG on."""
    if row["tier"] == "T0":
        return row["lambda"] is None or row["lambda"] >= 100.0
    return row["strength"] is None or row["strength"] >= STRONG


def median(values):
    values = sorted(v for v in values if v is not None)
    if not values:
        return None
    middle = len(values) // 2
    return values[middle] if len(values) % 2 else 0.5 * (values[middle - 1] + values[middle])


def figures(rows):
    """The figures of one tier, or of all: shares with intervals, medians."""
    of = {kind: [r for r in rows if r["kind"] == kind] for kind in
          ("nothing", "single", "pair", "outside", "unobservable")}
    strong = [r for r in of["single"] if is_strong(r)]
    places = [r["localisation"] for r in rows if r["localisation"]]
    ratios = [r.get("gain_ratio") for r in of["single"] if r["first"]]
    near_30 = [r for r in of["single"] if r["lambda"] is not None and 20.0 <= r["lambda"] < 45.0]
    named = [r for r in rows if r["named"]]
    return {
        "cases": len(rows),
        "failed": sum(r["verdict"] == "failed" for r in rows),
        "false_alarms": share(of["nothing"], lambda r: r["false_alarm"]),
        "first": share(strong, lambda r: r["first"]),
        "in_class": share(strong, lambda r: r["all"]),
        "precision": share((r for r in rows if r["single"]), lambda r: r["single_right"]),
        "precision_of_class": share((r for r in rows if r["single"]), lambda r: r["single_class_right"]),
        "pairs": share(of["pair"], lambda r: r["all"]),
        "unknown_found": share(of["outside"], lambda r: r["unknown"]),
        "unknown_said": share((r for r in rows if r["kind"] != "outside"), lambda r: r["unknown"]),
        "outside_named": share(of["outside"], lambda r: r["false_alarm"]),
        "not_observable": share(of["unobservable"], lambda r: not r["named"]),
        "listed": share(of["unobservable"], lambda r: r["listed_unobservable"]),
        "listed_wrongly": share(strong, lambda r: r["listed_unobservable"]),
        "false_discoveries": share([x in r["false_names"] for r in rows if r["several"] for x in r["named"]], bool),
        "power_30": share(near_30, lambda r: r["first"]),
        "places": median(p["left"] for p in places),
        "places_raw": median(p["raw"] for p in places),
        "gain_ratio": median(ratios),
        "gain_ratio_worst": quantile(ratios, 0.1),
        "false_names": share([n for r in named for n in [(x in r["false_names"]) for x in r["named"]]], bool),
        "beats_field": share((r for r in rows if r["beats_field"] is not None), lambda r: r["beats_field"]),
        "parameter_error": median(r["parameter"]["relative"] for r in strong if r["parameter"]),
        "covered": share((r for r in strong if r["parameter"]), lambda r: r["parameter"]["covered"]),
        "angle": median(r["parameter"].get("angle") for r in strong if r["parameter"]),
        "bias": median(value for r in rows for value in r["biases"].values()),
        **{f"bias_{name}": median(r["biases"].get(name) for r in rows) for name in TRUSTED},
        "gain": median(r["gain"] for r in of["single"] if r["first"]),
        "again": median(r.get("again_gain") for r in of["single"] if r["first"]),
        "ece": calibration(rows)["expected_error"],
        "minutes": median(r["cpu"] / 120.0 for r in rows if r["cpu"] and not r["failed"]),
        "minutes_most": max((r["cpu"] / 120.0 for r in rows if r["cpu"]), default=None),
        "particles": median(r["particles"] for r in rows),
        "excess_mm": median(math.sqrt(max(0.0, r["rms_mm"] ** 2 - r["noise_mm"] ** 2))
                            for r in of["nothing"] if r["rms_mm"] is not None),
    }
