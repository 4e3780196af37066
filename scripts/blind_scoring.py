# SPDX-License-Identifier: GPL-3.0-or-later
"""How the blind benchmark scores verdicts against labels: numbers alone, no files (tested by test_blind.py).

A label is what blind_hide.py sealed, a found what blind_find.py wrote of one case. Names that one recording
cannot tell apart count as one class: TIES, and what the label calls `ties`. What it calls `also` true is
neither right nor false.
"""

import math

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
        "top_right": bool(top) and bool(truth) and any(top["effect"] in group for group in first),
        "top": top["effect"] if top else None,
        "unknown": verdict == "unknown",
        "rms_mm": None, "noise_mm": None,
    }
    row["parameter"] = parameter_error(label, accepted)
    row["bias"] = bias_left(label, report)
    row["single_right"] = row["single"] and row["named"][0] in truth
    row["single_class_right"] = row["single"] and (row["named"][0] in allowed)
    if accepted and accepted[0].get("free_field") is not None and accepted[0].get("holdout_after") is not None:
        row["beats_field"] = accepted[0]["holdout_after"] <= accepted[0]["free_field"]
    if report:
        row["rms_mm"] = 1e3 * report["residual"]["train"]["rms"]
        row["noise_mm"] = 1e3 * report["noise"]["sigma"]
        row["nothing_probability"] = report.get("probability", {}).get("nothing")
    return row


def parameter_error(label, accepted):
    """Relative error of the size of a single effect that was named, and whether its 90 % interval holds the
    truth; None where there is none."""
    for cause in accepted:
        size = label.get("sizes", {}).get(cause["effect"], {})
        number = cause.get("parameters", {}).get(size.get("number"))
        if label["kind"] == "single" and number and number["value"] is not None and number["stderr"] is not None:
            off = abs(number["value"] - size["expected"])
            return {"relative": off / abs(size["expected"]), "covered": off <= 1.645 * number["stderr"]}
    return None


def bias_left(label, report):
    """The share of the error of the fitted start velocity that the extended model still has, where that
    error was beyond three of its standard errors; None where it cannot be said."""
    if "model" not in report or "truth" not in label:
        return None
    truth, before, noise = label["truth"]["velocity"], [], []
    for axis in range(3):
        found = [p for p in report["fit"]["parameters"] if p["path"].endswith(f"velocity[{axis}]")]
        if not found or found[0]["standard_error"] is None:
            return None
        before.append(found[0]["value"] - truth[axis])
        noise.append(found[0]["standard_error"])
    if math.hypot(*before) < 3.0 * math.hypot(*noise):
        return None
    after = [v - t for v, t in zip(report["model"]["bodies"][0]["velocity"], truth, strict=True)]
    return math.hypot(*after) / math.hypot(*before)


def calibration(rows):
    """Reliability of the probability of the first cause (of `nothing`, where that is larger): bins of
    stated and true shares, the expected calibration error and Brier's score."""
    pairs = []
    for row in rows:
        if row["probability"] is None:
            continue
        nothing = row.get("nothing_probability") or 0.0
        if nothing > row["probability"]:
            pairs.append((nothing, row["kind"] == "nothing"))
        else:
            pairs.append((row["probability"], row["top_right"]))
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
    strong = [r for r in of["single"] if r["strength"] is None or r["strength"] >= STRONG]
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
        "false_names": share([n for r in named for n in [(x in r["false_names"]) for x in r["named"]]], bool),
        "beats_field": share((r for r in rows if r["beats_field"] is not None), lambda r: r["beats_field"]),
        "parameter_error": median(r["parameter"]["relative"] for r in strong if r["parameter"]),
        "covered": share((r for r in strong if r["parameter"]), lambda r: r["parameter"]["covered"]),
        "bias": median(r["bias"] for r in rows),
        "gain": median(r["gain"] for r in of["single"] if r["first"]),
        "again": median(r.get("again_gain") for r in of["single"] if r["first"]),
        "minutes": median(r["cpu"] / 60.0 for r in rows if r["cpu"] and not r["failed"]),
        "excess_mm": median(math.sqrt(max(0.0, r["rms_mm"] ** 2 - r["noise_mm"] ** 2))
                            for r in of["nothing"] if r["rms_mm"] is not None),
    }
