# SPDX-License-Identifier: GPL-3.0-or-later
"""Baked caches as Blender's own objects: Volume, Mesh Cache, Geometry Nodes.

Each take has one collection. Objects carry the custom properties `matterfit`, what they show, and
`matterfit_cache`, the folder it lies in; by these they are found again wherever in the scene the
artist has put them. Nothing of ours has to be loaded for them to play.
"""

import os

import bpy
import numpy
from mathutils import Quaternion, Vector

from .. import compat
from ..jobs import JobError
from . import cache, files, meshes, nodes, transforms

TAG = "matterfit"
CACHE_TAG = "matterfit_cache"
HIDDEN_TAG = "matterfit_hidden"
CHOSEN_TAG = "matterfit_shown"
COLORS = ((0.80, 0.36, 0.22), (0.24, 0.50, 0.72), (0.45, 0.62, 0.28), (0.74, 0.60, 0.25),
          (0.52, 0.36, 0.62), (0.35, 0.62, 0.60))


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

    def update(self, final=False):
        """Everything that the cache holds by now. Returns how many frames play.

        `final`: objects of outputs that this bake no longer writes are removed.
        """
        self._collection()
        self.items = objects_of(self.scene, self.take)
        done = 0
        wanted = self.document.get("output", {})
        grids = wanted.get("volume", [])
        if grids:
            for name, sequence in cache.sequences(self.folder, "volume").items():
                done = max(done, self._volume(name, sequence, grids))
        attributes = cache.sequences(self.folder, "attributes")
        for name, points in cache.point_caches(self.folder, "points").items():
            self._particles(name, points, attributes)
            done = max(done, points.samples)
        for name, points in cache.partial_points(self.folder, "points").items():
            self._live_particles(name, points)
            done = max(done, points.samples)
        for entry in wanted.get("mesh", []):
            path = os.path.join(self.folder, "mesh", entry["name"] + ".pc2")
            if os.path.isfile(path):
                points = cache.read_pc2(path)
                self._render_mesh(entry, points)
                done = max(done, points.samples)
        if final:
            _remove([item for item in self.items if item[TAG] not in self.kept])
            self.items = objects_of(self.scene, self.take)
        self._evaluate_once()
        self._visibility(final)
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

    def _object(self, tag, name, make):
        """The take's object of that tag, made where it is missing."""
        self.kept.add(tag)
        folder = cache.name_of(self.take)
        for item in self.items:
            if item[TAG] == tag:
                mark([item], folder)  # an older version did not
                return item
        item = make(f"{self.take.name} {name}")
        item[TAG] = tag
        mark([item], folder)
        self.collection.objects.link(item)
        self.items.append(item)
        self.made = True
        return item

    def _body(self, name):
        for index, body in enumerate(self.scene.matterfit.bodies):
            if files.safe_name(body.name) == name or body.name == name:
                return index, body
        return 0, None

    def _material(self, name):
        """The artist's own material where the body has one."""
        index, body = self._body(name)
        item = body.object if body is not None and body.source == "OBJECT" else None
        if item is not None and item.active_material is not None:
            return item.active_material
        return nodes.surface_material(f"Matterfit {name}", COLORS[index % len(COLORS)])

    # -- the three kinds of cache --------------------------------------------------------------

    def _volume(self, name, sequence, grids):
        count = sequence.last - sequence.first + 1
        item = self._object(
            f"volume:{name}", f"{name} volume",
            lambda label: bpy.data.objects.new(label, bpy.data.volumes.new(label)))
        item.scale = (self.unit,) * 3
        volume = item.data
        volume.filepath = nodes.relative_path(sequence.path(sequence.first))
        volume.is_sequence = True
        volume.frame_start = sequence.first
        volume.frame_offset = sequence.first - 1
        volume.frame_duration = count
        volume.sequence_mode = "EXTEND"
        if hasattr(volume, "velocity_unit"):
            volume.velocity_unit = "SECOND"
        if not volume.materials:
            index, _body = self._body(name)
            volume.materials.append(nodes.volume_material(f"Matterfit {name} Volume",
                                                          COLORS[index % len(COLORS)]))
        if "density" not in grids:
            # Only a source for the surface: there is nothing to see in it.
            item.hide_render = True
            volume.display.wireframe_type = "NONE"
        if "surface" in grids:
            self._surface(name, item)
        return count

    def _surface(self, name, volume_object):
        def make(label):
            mesh = bpy.data.meshes.new(label)
            mesh.materials.append(self._material(name))
            return bpy.data.objects.new(label, mesh)

        item = self._object(f"surface:{name}", f"{name} surface", make)
        modifier = item.modifiers.get("Matterfit Surface")
        if modifier is None:
            modifier = item.modifiers.new("Matterfit Surface", "VOLUME_TO_MESH")
        modifier.object = volume_object
        modifier.grid_name = "surface"
        modifier.threshold = 0.0
        modifier.resolution_mode = "GRID"
        modifier.use_smooth_shade = True
        item.active_material = item.active_material or self._material(name)

    def _cloud(self, name, points, sample):
        """The vertex-only mesh of a body's particles, at one sample of the cache."""
        item = self._object(
            f"points:{name}", f"{name} particles",
            lambda label: bpy.data.objects.new(label, bpy.data.meshes.new(label)))
        item.scale = (self.unit,) * 3
        mesh = item.data
        if len(mesh.vertices) != points.points:
            # A cloud of another size would show undeformed without a word.
            mesh.clear_geometry()
            mesh.vertices.add(points.points)
        if points.samples:
            places = cache.read_pc2_frame(points, sample)
            mesh.vertices.foreach_set("co", numpy.ascontiguousarray(places).ravel())
            mesh.update()
        return item

    def _live_particles(self, name, points):
        """The newest baked frame: a PC2 plays only once it is finished."""
        item = self._cloud(name, points, points.samples - 1)
        modifier = item.modifiers.get("Matterfit Cache")
        if modifier is not None:
            item.modifiers.remove(modifier)
        if "Matterfit Particles" not in item.modifiers:
            self._points_nodes(item, name, [])

    def _particles(self, name, points, attributes):
        item = self._cloud(name, points, 0)
        self._mesh_cache(item, points)
        textures = []
        for attribute in self.document.get("output", {}).get("attributes", []):
            sequence = attributes.get(f"{name}_{attribute}")
            if sequence is not None:
                path = sequence.path(sequence.first)
                textures.append((attribute, nodes.sequence_image(path), cache.exr_size(path),
                                 sequence.first, sequence.last))
        self._points_nodes(item, name, textures)

    def _points_nodes(self, item, name, textures):
        tree = nodes.particles_tree(f"Matterfit Particles {item.name}", 0.5 * self.separation,
                                    self._material(name), textures)
        modifier = item.modifiers.get("Matterfit Particles")
        if modifier is None:
            modifier = item.modifiers.new("Matterfit Particles", "NODES")
        modifier.node_group = tree

    def _render_mesh(self, entry, points):
        """A linked copy of the artist's object, without its animation: the cache holds it all."""
        _index, body = self._body(entry["body"])
        if body is None or body.object is None:
            return
        source = body.object

        def make(label):
            copy = source.copy()
            copy.name = label
            copy.animation_data_clear()
            copy.constraints.clear()
            copy.parent = None
            for modifier in [other for other in copy.modifiers
                             if meshes.is_own(other) or other.type == "PARTICLE_SYSTEM"]:
                copy.modifiers.remove(modifier)
            copy.hide_render = False
            copy.hide_viewport = False
            for tag in (HIDDEN_TAG, CHOSEN_TAG):
                if tag in copy:
                    del copy[tag]
            return copy

        item = self._object(f"mesh:{entry['name']}", f"{body.name} mesh", make)
        place = entry["transform"]
        item.rotation_mode = "QUATERNION"
        item.location = Vector(place["position"]) * self.unit
        item.rotation_quaternion = Quaternion(place["rotation"])
        item.scale = (1.0, 1.0, 1.0)
        for name in ("delta_location",):
            setattr(item, name, (0.0, 0.0, 0.0))
        item.delta_rotation_quaternion = (1.0, 0.0, 0.0, 0.0)
        item.delta_scale = (1.0, 1.0, 1.0)
        if item.data is not source.data:
            item.data = source.data
        count = len(source.data.vertices)
        if count != points.points:
            raise JobError(f"{points.path}: holds {points.points} points, but the mesh of "
                           f"'{source.name}' has {count} vertices. It was changed after the bake: "
                           "bake again.")
        # No material of ours: a slot would be made in the artist's mesh, which is shown here.
        self._mesh_cache(item, points)

    def _mesh_cache(self, item, points):
        name = "Matterfit Cache"
        modifier = item.modifiers.get(name)
        if modifier is None:
            stop = meshes.first_topology_modifier(item, own=True)
            modifier = item.modifiers.new(name, "MESH_CACHE")
            compat.move_modifier(item, name, stop)
            modifier = item.modifiers[name]
        modifier.cache_format = "PC2"
        modifier.filepath = nodes.relative_path(points.path)
        modifier.interpolation = "LINEAR"
        modifier.deform_mode = "OVERWRITE"
        modifier.play_mode = "SCENE"
        modifier.time_mode = "FRAME"
        modifier.frame_start = float(self.first)
        modifier.frame_scale = 1.0
        modifier.forward_axis = "POS_Y"
        modifier.up_axis = "POS_Z"

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

    def _visibility(self, final):
        """Once, when all is there: a mesh hides surface and particles, a surface the particles.

        Afterwards what is seen is the artist's choice.
        """
        if final:
            tags = {item[TAG] for item in self.items}
            has_mesh = any(tag.startswith("mesh:") for tag in tags)
            has_surface = any(tag.startswith("surface:") for tag in tags)
            for item in self.items:
                kind = item[TAG].split(":")[0]
                hide = (kind == "surface" and has_mesh) or (
                    kind == "points" and (has_mesh or has_surface))
                if hide and CHOSEN_TAG not in item:
                    item.hide_render = True
                    item.hide_viewport = True
                item[CHOSEN_TAG] = 1
        for body in self.scene.matterfit.bodies:
            if body.enabled and body.role == "BODY" and body.source == "OBJECT" and body.object:
                hide_original(body.object)


def objects_of(scene, take):
    """Our objects that show the take, wherever the artist has put them; those in its collection
    first, where an older version left them without the folder's name."""
    name = cache.name_of(take)
    inside = take.collection.all_objects if take.collection is not None else ()
    found = {item: True for item in inside if item.get(CACHE_TAG, name) == name}
    if name:
        found.update((item, True) for item in scene.objects if item.get(CACHE_TAG) == name)
    return [item for item in found if item.get(TAG)]


def mark(items, folder):
    """They show what lies in the cache folder of that name."""
    for item in items:
        item[CACHE_TAG] = folder


def hide_original(item):
    """The artist's object gives way to the result; what it was is remembered on it."""
    if HIDDEN_TAG not in item:
        item[HIDDEN_TAG] = int(item.hide_render) + 2 * int(item.hide_viewport)
    item.hide_render = True
    item.hide_viewport = True


def show_original(item):
    if HIDDEN_TAG in item:
        state = int(item[HIDDEN_TAG])
        item.hide_render = bool(state & 1)
        item.hide_viewport = bool(state & 2)
        del item[HIDDEN_TAG]


def show_take(settings):
    """The active take's collection is seen, the others' are not."""
    shown = False
    for index, take in enumerate(settings.takes):
        if take.collection is not None:
            active = index == settings.take_index
            take.collection.hide_render = not active
            take.collection.hide_viewport = not active
            shown = shown or active
    preview = settings.preview.collection
    if preview is not None and shown:
        preview.hide_render = preview.hide_viewport = True
    for body in settings.bodies:
        if body.role == "BODY" and body.object is not None:
            if shown and body.enabled:
                hide_original(body.object)
            else:
                show_original(body.object)


def show_only(settings, take):
    """The collection of `take` is seen (a preview's as well), no other."""
    for other in (*settings.takes, settings.preview):
        if other.collection is not None:
            hidden = other.collection != take.collection
            other.collection.hide_render = hidden
            other.collection.hide_viewport = hidden


# Which objects show the files of a folder of the cache.
KIND_TAGS = {"volume": ("volume:", "surface:"), "mesh": ("mesh:",), "points": ("points:",)}


def detach_kind(take, kind):
    """Removes the objects that show one kind of files."""
    _remove([item for item in objects_of(take.id_data, take)
             if item[TAG].startswith(KIND_TAGS.get(kind, ()))])


def detach(scene, take):
    """Removes the take's objects; the artist's own come back where no other take is shown.

    A take that shares its cache with one of another scene lets go of both, and of what only this
    scene shows of it.
    """
    items = objects_of(scene, take)
    collection = take.collection
    take.collection = None
    if cache.is_shared(take):
        take.folder = ""
        items = [item for item in items if set(item.users_scene) <= {scene}]
        if collection is not None and collection in list(scene.collection.children):
            scene.collection.children.unlink(collection)
    _remove(items)
    if collection is not None and not _is_in_use(collection):
        bpy.data.collections.remove(collection)
    for image in [image for image in bpy.data.images
                  if image.source == "SEQUENCE" and image.users == 0]:
        if take.folder and image.filepath.startswith(take.folder):
            bpy.data.images.remove(image)
    show_take(scene.matterfit)


def _is_in_use(collection):
    """It holds something, or shows a take."""
    return bool(collection.all_objects or collection.children) or any(
        take.collection == collection for _scene, take in cache.every_take())


def _remove(items):
    """Removes our objects with the data only they use."""
    for item in items:
        shared = item[TAG].startswith("mesh:")
        data = item.data
        trees = [modifier.node_group for modifier in item.modifiers
                 if modifier.type == "NODES" and modifier.node_group is not None
                 and meshes.is_own(modifier)]
        bpy.data.objects.remove(item)
        if not shared and data is not None and data.users == 0:
            bpy.data.batch_remove([data])
        for tree in trees:
            if tree.users == 0:
                bpy.data.node_groups.remove(tree)
