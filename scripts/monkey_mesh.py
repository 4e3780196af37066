# SPDX-License-Identifier: GPL-3.0-or-later
"""Writes Blender's monkey, remeshed into one closed shell of about two metres, as PLY.

    blender -b --factory-startup -P scripts/monkey_mesh.py -- FILE.ply [VOXEL_SIZE]

`make random-solids MESH=FILE.ply` throws it.
"""

import sys

import bpy


def remeshed_monkey(voxel_size):
    bpy.ops.mesh.primitive_monkey_add()
    monkey = bpy.context.object
    modifier = monkey.modifiers.new("Remesh", "REMESH")
    modifier.mode = "VOXEL"
    modifier.voxel_size = voxel_size
    return monkey.evaluated_get(bpy.context.evaluated_depsgraph_get()).to_mesh()


def write_ply(mesh, path):
    lines = ["ply", "format ascii 1.0", f"element vertex {len(mesh.vertices)}",
             "property float x", "property float y", "property float z",
             f"element face {len(mesh.polygons)}", "property list uchar int vertex_indices",
             "end_header"]
    lines += [" ".join(f"{x:.7g}" for x in vertex.co) for vertex in mesh.vertices]
    for polygon in mesh.polygons:
        lines.append(" ".join(str(i) for i in (len(polygon.vertices), *polygon.vertices)))
    with open(path, "w", encoding="ascii") as file:
        file.write("\n".join(lines) + "\n")


def main():
    arguments = sys.argv[sys.argv.index("--") + 1:]
    write_ply(remeshed_monkey(float(arguments[1]) if len(arguments) > 1 else 0.06), arguments[0])


main()
