# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender properties of the quantities in quantities.py."""

from bpy.props import FloatProperty, FloatVectorProperty

from .. import quantities


def number(key, **options):
    """A FloatProperty of the quantity; `options` come in place of what the table says."""
    row = quantities.find(key)
    return FloatProperty(**{**_common(row), "default": row.default, **options})


def vector(key, **options):
    """A FloatVectorProperty of the quantity; the components of three are named X, Y, Z."""
    row = quantities.find(key)
    subtype = "XYZ" if row.is_vector else "NONE"
    return FloatVectorProperty(**{**_common(row), "size": row.size, "subtype": subtype, **options})


def _common(row):
    return {"name": row.label, "description": row.about, "min": row.least, "max": row.most,
            "soft_min": row.soft[0], "soft_max": row.soft[1], "precision": row.precision,
            "step": row.step}
