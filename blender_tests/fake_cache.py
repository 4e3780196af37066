# SPDX-License-Identifier: GPL-3.0-or-later
"""Cache files made without the solver, so that attaching is tested by itself."""

import importlib
import os
import struct

import bpy
import numpy


def write_pc2(path, samples, first=1.0):
    """samples (T, N, 3)."""
    samples = numpy.asarray(samples, dtype="<f4")
    os.makedirs(os.path.dirname(path), exist_ok=True)
    with open(path, "wb") as stream:
        stream.write(struct.pack("<12siiffi", b"POINTCACHE2\0", 1, samples.shape[1], first, 1.0,
                                 samples.shape[0]))
        stream.write(samples.tobytes())


def write_exr(path, values, width):
    """values (N, 3), packed row-major from the top, in a float EXR."""
    height = -(-len(values) // width)
    pixels = numpy.zeros((height, width, 4), dtype=numpy.float32)
    pixels[..., 3] = 1.0
    flat = pixels.reshape(-1, 4)
    flat[:len(values), :3] = values
    os.makedirs(os.path.dirname(path), exist_ok=True)
    image = bpy.data.images.new("exr", width, height, float_buffer=True, alpha=True)
    image.colorspace_settings.name = "Non-Color"
    image.pixels.foreach_set(pixels[::-1].ravel())  # Blender begins at the bottom
    image.filepath_raw = path
    image.file_format = "OPEN_EXR"
    image.save()
    bpy.data.images.remove(image)


def write_vdb(path, radius):
    """A fog sphere 'density' and its level set 'surface', whose voxels are half as wide."""
    pyopenvdb = openvdb_module()
    os.makedirs(os.path.dirname(path), exist_ok=True)
    surface = pyopenvdb.createLevelSetSphere(radius=radius, center=(0, 0, 1), voxelSize=0.02)
    surface.name = "surface"
    density = pyopenvdb.FloatGrid()
    density.name = "density"
    density.transform = pyopenvdb.createLinearTransform(0.04)
    places = 0.04 * numpy.stack(numpy.meshgrid(*[numpy.arange(-15, 16)] * 3, indexing="ij"), axis=-1)
    density.copyFromArray(numpy.float32(numpy.linalg.norm(places, axis=-1) < radius), ijk=(-15, -15, 10))
    pyopenvdb.write(path, grids=[density, surface])


def openvdb_module():
    """OpenVDB's Python module: pyopenvdb with 3.4, openvdb in later Blenders; or None."""
    for name in ("pyopenvdb", "openvdb"):
        try:
            return importlib.import_module(name)
        except ImportError:
            continue
    return None
