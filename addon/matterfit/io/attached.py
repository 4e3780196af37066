# SPDX-License-Identifier: GPL-3.0-or-later
"""The objects that show baked caches (result_objects): how they are marked, refused, and removed."""

import bpy

from ..compat import translate
from ..jobs import JobError
from . import cache, shapes, take_pictures, visibility
from .result_objects import CACHE_TAG, TAG, objects_of


def refuse(item, where):
    """JobError where the object shows a cache: simulated again, or run into, it would stand in for the
    object that it was made from. A copy with its modifiers applied is an object as any other."""
    if item is not None and item.get(TAG) and (
            item.type == "VOLUME" or any(shapes.is_own(modifier) for modifier in item.modifiers)):
        raise JobError(translate(
            "{where}: '{name}' shows what was simulated. Choose the object that it was made from, or "
            "a copy with its modifiers applied.").format(where=where, name=item.name))


def mark(items, folder):
    """They show what lies in the cache folder of that name."""
    for item in items:
        item[CACHE_TAG] = folder


# Which objects show the files of a folder of the cache.
KIND_TAGS = {"volume": ("volume:", "level:", "surface:"), "mesh": ("mesh:",), "points": ("points:",)}


def detach_kind(take, kind):
    """Removes the objects that show one kind of files."""
    remove([item for item in objects_of(take.id_data, take)
             if item[TAG].startswith(KIND_TAGS.get(kind, ()))])


def detach(scene, take):
    """Removes the take's objects, and its pictures from the views of cameras; the artist's own objects come
    back where no other take is shown.

    A take that shares its cache with one of another scene lets go of both, and of what only this
    scene shows of it.
    """
    take_pictures.remove(scene, take)
    items = objects_of(scene, take)
    collection = take.collection
    take.collection = None
    if cache.is_shared(take):
        take.folder = ""
        items = [item for item in items if set(item.users_scene) <= {scene}]
        if collection is not None and collection in list(scene.collection.children):
            scene.collection.children.unlink(collection)
    remove(items)
    if collection is not None and not _is_in_use(collection):
        bpy.data.collections.remove(collection)
    for image in [image for image in bpy.data.images
                  if image.source == "SEQUENCE" and image.users == 0]:
        if take.folder and image.filepath.startswith(take.folder):
            bpy.data.images.remove(image)
    visibility.show_take(scene.matterfit)


def _is_in_use(collection):
    """It holds something, or shows a take."""
    return bool(collection.all_objects or collection.children) or any(
        take.collection == collection for _scene, take in cache.every_take())


def remove(items):
    """Removes our objects with the data only they use."""
    for item in items:
        # The artist's own mesh, which a result shows, stays whatever uses it.
        shared = item[TAG].startswith("mesh:") and not item.data.get(TAG)
        data = item.data
        trees = [modifier.node_group for modifier in item.modifiers
                 if modifier.type == "NODES" and modifier.node_group is not None
                 and shapes.is_own(modifier)]
        bpy.data.objects.remove(item)
        if not shared and data is not None and data.users == 0:
            bpy.data.batch_remove([data])
        for tree in trees:
            if tree.users == 0:
                bpy.data.node_groups.remove(tree)
