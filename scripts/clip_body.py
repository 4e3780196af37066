# SPDX-License-Identifier: GPL-3.0-or-later
"""A surface around points that fill a body."""

import numpy as np


def _smoothed(field, sigma):
    """Gaussian of `sigma` voxels along each axis, cut at three of them."""
    reach = int(np.ceil(3 * sigma))
    kernel = np.exp(-0.5 * (np.arange(-reach, reach + 1) / sigma) ** 2)
    kernel /= kernel.sum()
    for axis in range(3):
        field = np.apply_along_axis(np.convolve, axis, field, kernel, mode="same")
    return field


def surface_of_points(points):
    """Vertices (V, 3) [m] and quads (F, 4), turned outward, around the voxels where the points'
    smoothed density is highest: as many as the points need at the density they have deep inside, so
    that the volume is right. Sharp edges are rounded by about half the points' spacing."""
    points = np.asarray(points, float)
    voxel = 0.5 * _spacing(points)
    margin = 8
    low = points.min(axis=0) - margin * voxel
    size = np.ceil((points.max(axis=0) - low) / voxel).astype(int) + margin
    count = np.zeros(size)
    np.add.at(count, tuple(np.floor((points - low) / voxel).astype(int).T), 1.0)
    inside = _occupied(count, 2.0)
    faces = []
    for axis in range(3):
        u, v = (axis + 1) % 3, (axis + 2) % 3
        for side, turn in ((0, ((0, 0), (0, 1), (1, 1), (1, 0))), (1, ((0, 0), (1, 0), (1, 1), (0, 1)))):
            at = np.argwhere(inside & ~np.roll(inside, -1 if side else 1, axis=axis))
            corners = np.repeat(at[:, None, :], 4, axis=1)
            corners[:, :, axis] += side
            corners[:, :, u] += [du for du, _ in turn]
            corners[:, :, v] += [dv for _, dv in turn]
            faces.append(corners)
    quads = np.concatenate(faces)
    flat = np.ravel_multi_index(tuple(quads.reshape(-1, 3).T), tuple(size + 1))
    unique, index = np.unique(flat, return_inverse=True)
    vertices = low + voxel * np.stack(np.unravel_index(unique, tuple(size + 1)), axis=1)
    return vertices, index.reshape(-1, 4)


def _occupied(count, spacing):
    """The voxels of the body; `spacing` of the points in voxels."""
    density = _smoothed(count, 0.8 * spacing)
    typical = (density * count).sum() / count.sum()
    filled = (density > 0.4 * typical).astype(float)
    deep = _smoothed(filled, spacing) > 0.999
    wanted = int(round(count.sum() / count[deep].mean()))
    threshold = np.partition(density.ravel(), -wanted)[-wanted]
    return density >= threshold


def _spacing(points):
    """Cube root of the volume that a point has inside: from the fullest cells of a coarse lattice."""
    extent = points.max(axis=0) - points.min(axis=0)
    coarse = 4 * np.cbrt(extent.prod() / len(points))
    cells = np.floor((points - points.min(axis=0)) / coarse).astype(int)
    counts = np.unique(cells, axis=0, return_counts=True)[1]
    return coarse / np.cbrt(np.percentile(counts, 90))
