# SPDX-License-Identifier: GPL-3.0-or-later
"""A take with a cache that was made without the solver."""

import bpy
import numpy
from matterfit.io import attach, takes
from support import SceneCase

FRAMES = range(3, 8)


def evaluated_points(item, frame):
    """(N, 3) world positions of the evaluated mesh."""
    bpy.context.scene.frame_set(frame)
    evaluated = item.evaluated_get(bpy.context.evaluated_depsgraph_get())
    mesh = evaluated.to_mesh()
    points = numpy.empty(len(mesh.vertices) * 3, dtype=numpy.float32)
    mesh.vertices.foreach_get("co", points)
    evaluated.to_mesh_clear()
    matrix = numpy.array(evaluated.matrix_world)
    return points.reshape(-1, 3) @ matrix[:3, :3].T + matrix[:3, 3]


class AttachCase(SceneCase):
    def setUp(self):
        super().setUp()
        self.item = self.cube(location=(0.0, 0.0, 1.0))
        self.body_row = self.body(self.item)
        self.settings.solver.particle_separation = 0.2  # its faces are short enough
        self.scene.frame_start, self.scene.frame_end = FRAMES[0], FRAMES[-1]
        self.take = takes.ensure_active(self.settings)

    def attach(self, **output):
        """Attaches the fake cache of the active take."""
        document, self.folder_of_cache = self.document()
        document["output"].update(output)
        self.write_files(document)
        shown = attach.Attachment(self.scene, self.take, self.folder_of_cache, document)
        self.frames_done = shown.update()
        return {item["matterfit"]: item for item in self.take.collection.objects}

    def write_files(self, document):
        raise NotImplementedError
