# SPDX-License-Identifier: GPL-3.0-or-later
"""What the library says of its numbers, laws and effects: library.json, which scripts/addon_tables.py
writes and a test compares with the library. Properties are registered without the library, so they
cannot ask it."""

import json
import os

with open(os.path.join(os.path.dirname(__file__), "library.json"), encoding="utf-8") as _stream:
    _TABLES = json.load(_stream)

# A quantity that has no bounds is looked for this factor either side of its start.
USUAL_FACTOR = _TABLES["usual_factor"]
# {"material.maxwell.time": row}: a key without the number in its brackets.
QUANTITIES = {row["path"].replace("[#]", ""): row for row in _TABLES["quantities"]}
# A yield or tear strain from here up is never met; below this one, with as little friction, nothing
# holds a body together.
NEVER_STRAIN = _TABLES["never_strain"]
LIQUID_STRAIN = _TABLES["liquid_strain"]
# Maxwell branches that a material takes.
MOST_BRANCHES = _TABLES["most_branches"]
# Laws of what pours.
FLOWING = frozenset(law["name"] for law in _TABLES["laws"] if law["flows"])
# {"von_mises": ("E", "nu", "yield_stress", "hardening")}, in the library's order.
PARAMETERS = {law["name"]: tuple(law["parameters"]) for law in _TABLES["laws"]}
# {"jelly": {"E": 1e5, …}}: numbers of the isotropic neural law that its start weights stand for.
STARTS = {start["name"]: start["numbers"] for start in _TABLES["starts"]}
# {"vortex": {"center": row, …}}, in the library's order.
EFFECTS = {effect["name"]: {row["key"]: row for row in effect["parameters"]}
           for effect in _TABLES["effects"]}
