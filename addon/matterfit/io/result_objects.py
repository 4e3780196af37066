# SPDX-License-Identifier: GPL-3.0-or-later
"""Which objects show a baked cache.

They carry the custom properties `matterfit`, what they show, and `matterfit_cache`, the folder it
lies in; by these they are found again wherever in the scene the artist has put them.
"""

from . import cache, files

TAG = "matterfit"
CACHE_TAG = "matterfit_cache"


def kind_and_body(item):
    """(what the object shows, of which body): 'mesh', 'surface', … and the name that files of that
    body have, whichever of a body's two names the output is called by."""
    kind, _colon, name = item[TAG].partition(":")
    return kind, files.safe_name(name)


def objects_of(scene, take):
    """Our objects that show the take, wherever the artist has put them; those in its collection
    first, where an older version left them without the folder's name."""
    name = cache.name_of(take)
    inside = take.collection.all_objects if take.collection is not None else ()
    found = {item: True for item in inside if item.get(CACHE_TAG, name) == name}
    if name:
        found.update((item, True) for item in scene.objects if item.get(CACHE_TAG) == name)
    return [item for item in found if item.get(TAG)]


def strays_of(scene, take):
    """Those that the artist has put elsewhere than into the take's collection."""
    inside = set(take.collection.all_objects) if take.collection is not None else set()
    return [item for item in objects_of(scene, take) if item not in inside]
