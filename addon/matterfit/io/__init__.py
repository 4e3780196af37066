# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender objects to job documents, and caches to Blender objects. No numerics."""
