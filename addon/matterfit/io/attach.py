# SPDX-License-Identifier: GPL-3.0-or-later
"""Baked caches as Blender's own objects: Volume, Mesh Cache, Geometry Nodes.

Each take has one collection. Nothing of ours has to be loaded for its objects to play.
"""

import os

import bpy

from . import (
    attach_mesh,
    attach_particles,
    attach_volume,
    attached,
    cache,
    files,
    nodes,
    result_objects,
    transforms,
    visibility,
)


class Attachment:
    """Attaches one take's cache. Made anew for every update: it keeps no data-block."""

    def __init__(self, scene, take, folder, document):
        self.scene = scene
        self.take = take
        self.folder = folder
        self.document = document
        self.first = document["scene"]["frames"][0]
        self.separation = document["scene"]["particle_separation"]
        self.unit = 1.0 / transforms.metres(scene)
        self.items = []
        self.kept = set()
        self.made = False
        self.notes = []  # what is to be said of what is shown

    def update(self, final=False, live=False):
        """Everything that the cache holds by now. Returns how many frames play.

        `final`: objects of outputs that this bake no longer writes are removed. `live`: the bake
        runs, and only the newest frame's particles are seen.
        """
        self._collection()
        self.items = attached.objects_of(self.scene, self.take)
        done = 0
        wanted = self.document.get("output", {})
        grids = wanted.get("volume", [])
        if grids:
            for name, sequence in cache.sequences(self.folder, "volume").items():
                done = max(done, attach_volume.volume(self, name, sequence, grids))
        attributes = cache.sequences(self.folder, "attributes")
        for name, points in cache.point_caches(self.folder, "points").items():
            attach_particles.particles(self, name, points, attributes)
            done = max(done, points.samples)
        for name, points in cache.partial_points(self.folder, "points").items():
            attach_particles.live_particles(self, name, points)
            done = max(done, points.samples)
        for entry in wanted.get("mesh", []):
            path = os.path.join(self.folder, "mesh", entry["name"] + ".pc2")
            if os.path.isfile(path):
                points = cache.read_pc2(path)
                attach_mesh.render_mesh(self, entry, points)
                done = max(done, points.samples)
        if final:
            attached.remove([item for item in self.items if item[attached.TAG] not in self.kept])
            self.items = attached.objects_of(self.scene, self.take)
        attach_volume.blur(self)
        self._evaluate_once()
        self._visibility(live)
        return done

    # -- collections and objects ---------------------------------------------------------------

    def _collection(self):
        collection = self.take.collection
        if collection is None:
            collection = bpy.data.collections.new(f"Matterfit {self.take.name}")
            self.take.collection = collection
        if collection not in self.scene.collection.children_recursive:
            self.scene.collection.children.link(collection)
        self.collection = collection

    def object(self, tag, name, make):
        """The take's object of that tag, made where it is missing."""
        self.kept.add(tag)
        folder = cache.name_of(self.take)
        for item in self.items:
            if item[attached.TAG] == tag:
                attached.mark([item], folder)  # an older version did not
                return item
        item = make(f"{self.take.name} {name}")
        item[attached.TAG] = tag
        attached.mark([item], folder)
        self.collection.objects.link(item)
        self.items.append(item)
        self.made = True
        return item

    def body(self, name):
        for index, body in enumerate(self.scene.matterfit.bodies):
            if files.safe_name(body.name) == files.safe_name(name):
                return index, body
        return 0, None

    def law(self, name):
        """The law of a body of the bake; "" where it has none of that name."""
        return next((body["material"]["law"] for body in self.document["scene"]["bodies"]
                     if files.safe_name(body["name"]) == files.safe_name(name)), "")

    def material(self, name):
        """The artist's own material where the body has one."""
        index, body = self.body(name)
        item = body.object if body is not None and body.source == "OBJECT" else None
        if item is not None and item.active_material is not None:
            return item.active_material
        law = body.material.law if body is not None else ""
        place = nodes.COLOR_OF_LAW.get(law, index % len(nodes.COLORS))
        return nodes.surface_material(f"Matterfit {name}", nodes.COLORS[place])

    # -- what is seen --------------------------------------------------------------------------

    def _evaluate_once(self):
        """New objects have no inverse matrix until they are evaluated, and hidden ones are not:
        Volume to Mesh on such an object ends Blender 3.4 (OpenVDB refuses a singular matrix)."""
        if not self.made:
            return
        self.collection.hide_render = False
        self.collection.hide_viewport = False
        for layer in self.scene.view_layers:
            layer.update()

    def _visibility(self, live):
        """One picture of each body; what an earlier bake has left is none."""
        kinds = {}
        for item in self.items:
            kind, name = result_objects.kind_and_body(item)
            kinds.setdefault(name, {})[kind] = item
        for name, items in kinds.items():
            usable = {kind for kind, item in items.items() if item[attached.TAG] in self.kept}
            if "density" not in self.document.get("output", {}).get("volume", []):
                usable.discard("volume")  # only a source for the surface
            seen = visibility.picture(usable, self.law(name))
            if live and "points" in usable:
                seen = "points"
            for kind, item in items.items():
                visibility.decide(item, kind == seen)
        for body in self.scene.matterfit.bodies:
            if body.enabled and body.role == "BODY" and body.source == "OBJECT" and body.object:
                visibility.hide_original(body.object)
