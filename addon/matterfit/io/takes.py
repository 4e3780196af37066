# SPDX-License-Identifier: GPL-3.0-or-later
"""Takes and their cache folders. A folder belongs to one take of one .blend file for good."""

import contextlib
import os
import secrets

import bpy

from ..compat import translate
from ..jobs import JobError
from ..names import unique
from ..props import scene as scene_props
from . import attached, cache, take_pictures, visibility

PREFIX = "cache_matterfit_"
CACHE_VALUES = ("folder", "owner", "baked", "compared", "frames_done")  # what a take says of its cache
MOST_FRAMES = 1048574  # Blender's


class Location:
    """Where a take's cache is, and whether it is another file's (linked: read-only), or that of
    another take of this file too (shared: linked as well)."""

    def __init__(self, folder, linked, shared=False):
        self.folder = folder
        self.linked = linked or shared
        self.shared = shared

    @property
    def exists(self):
        return bool(self.folder) and os.path.isdir(self.folder)


def require_saved():
    """The folder of the .blend file; JobError where there is none."""
    if not bpy.data.filepath:
        raise JobError(translate("The .blend file is not saved, so there is no folder for the "
                                 "cache. Save the file first (File > Save)."))
    return os.path.dirname(os.path.abspath(bpy.data.filepath))


def locate(take):
    """The take's cache. A take that Save As copied stays linked to where it was baked; those of a
    copied scene share theirs until one of them bakes or frees."""
    if not take.folder:
        return Location("", False)
    # A batch's own documents say what its members are: a bake of the scene goes elsewhere.
    return _located(take, cache.is_shared(take), cache.in_batch(take))


def _located(take, shared, linked):
    name = cache.name_of(take)
    here = os.path.abspath(bpy.data.filepath) if bpy.data.filepath else ""
    beside = os.path.join(os.path.dirname(here), name) if here else ""
    owner = take.owner
    if not owner or owner == here:
        return Location(beside, linked, shared)
    at_owner = os.path.join(os.path.dirname(owner), name)
    if os.path.dirname(owner) != os.path.dirname(here) and os.path.isdir(beside):
        # The whole folder was copied or moved: this file has a cache to itself.
        return Location(beside, linked, shared)
    if os.path.isfile(owner):
        # The other file is still there: this one was saved under another name.
        return Location(at_owner if os.path.isdir(at_owner) else beside, True, shared)
    # The other file is gone: it was renamed or moved together with its cache.
    return Location(beside, linked, shared)


def claim(take):
    """The take's own folder for writing; a linked, shared or new take gets a new one."""
    base = require_saved()
    location = locate(take)
    scene = take.id_data
    if location.shared:
        attached.detach(scene, take)
    if not take.folder or location.linked:
        take_pictures.remove(scene, take)  # they are of what the folder before holds
        shown = attached.objects_of(scene, take)
        while True:
            name = PREFIX + secrets.token_hex(4)
            if not os.path.exists(os.path.join(base, name)):
                break
        take.folder = f"//{name}/"
        take.baked = take.compared = False
        take.frames_done = 0
        attached.mark(shown, name)
    take.owner = os.path.abspath(bpy.data.filepath)
    return os.path.join(base, cache.name_of(take))


def require_own(take):
    """JobError where another cache would take the place of one that is kept elsewhere."""
    location = locate(take)
    if cache.in_batch(take):
        raise JobError(translate("This take is one of a batch. Compare it or write its job in Batch, or "
                                 "choose another take in Rerun."))
    if location.linked and take.frames_done:
        raise JobError(linked_text(location))


def linked_text(location):
    """Whose the cache is that a take only shows."""
    if location.shared:
        return translate("This take is that of the scene that was copied, and is linked, read-only. "
                         "Press Bake to make one of its own.")
    return translate("This take belongs to another .blend file and is linked, read-only. Press Bake to "
                     "make one of its own.")


def add(settings, name, source=None):
    """A new take, with the throws of `source` where given. It has no cache yet."""
    take = settings.takes.add()
    take.name = unique(name, settings.takes)
    if source is not None:
        copy_settings(source, take)
    return take


def copy_settings(source, target):
    """Throws, gravity and collider switches; never the cache."""
    target.use_gravity = source.use_gravity
    target.gravity = source.gravity
    for collection in ("throws", "colliders"):
        _fill(getattr(target, collection), map(_contents, getattr(source, collection)))


def ensure_active(settings):
    """The active take; the first one is made where there is none."""
    take = scene_props.active_take(settings)
    if take is None:
        if not settings.takes:
            add(settings, translate("Take 1"))
        settings.take_index = 0
        take = settings.takes[0]
    return take


def finished_frames(take):
    """How many frames the take's own whole bake holds, which another one would replace; 0 where there
    is none. The disk says so: undo takes back what the take says of it, and no file."""
    location = locate(take)
    if not location.exists or (location.linked and not cache.in_batch(take)):
        return 0
    with contextlib.suppress(JobError):
        found = cache.manifest(location.folder)
        return found.get("frames_baked", 0) if _is_whole(found) else 0
    return 0


def _is_whole(manifest):
    """Whether all frames of a cache were baked: a comparison or a rendering that goes on from a bake that was
    broken off simulates them alone."""
    baked = manifest.get("frames_baked", 0)
    first, end = manifest.get("frames", (0, baked))
    return bool(manifest.get("complete")) and baked > 0 and baked >= end - first


def frames_on_disk(take):
    """How many frames are whole in the take's cache."""
    location = locate(take)
    return cache.manifest(location.folder).get("frames_baked", 0) if location.exists else 0


def for_bake(settings, replace):
    """The take that a bake goes to: the active one, or a new one like it where that is finished and
    nobody has said that it may be replaced."""
    take = ensure_active(settings)
    if replace or not finished_frames(take):
        return take
    index = settings.take_index
    added = add(settings, f"{translate('Take')} {len(settings.takes) + 1}")
    copy_settings(settings.takes[index], added)  # the collection may have moved in memory
    settings.take_index = len(settings.takes) - 1
    return scene_props.active_take(settings)


def look_at_disk(settings):
    """Sets what the takes say of their caches to what lies there: a bake may have gone on, or been
    deleted, since the file was saved."""
    lost = False
    for take in settings.takes:
        location = locate(take)
        document, before = {}, take.frames_done
        # One that an older version left without frames still hides the artist's objects.
        lost = lost or take.collection is not None and not before
        with contextlib.suppress(JobError):
            document = cache.manifest(location.folder) if location.exists else {}
        take.frames_done = min(document.get("frames_baked", 0), MOST_FRAMES)
        take.baked = _is_whole(document)
        lost = lost or before > 0 and not take.frames_done
    if lost:
        visibility.show_take(settings)


def for_fit(settings):
    """The fit's own cache, set up to fit what the active take does."""
    source, run = ensure_active(settings), settings.fit.run
    run.name = source.name
    copy_settings(source, run)
    return run


class Kept:
    """A take as it is before a run that changes it; put back where nothing comes of the run."""

    def __init__(self, take):
        self._values = {name: getattr(take, name)
                        for name in ("name", *CACHE_VALUES, "use_gravity")}
        self._gravity = tuple(take.gravity)
        self._rows = {name: [_contents(row) for row in getattr(take, name)]
                      for name in ("throws", "colliders")}
        self._pictures = take_pictures.kept(take.id_data, take)

    def is_in(self, take):
        """Whether the take has the folder that it had."""
        return take.folder == self._values["folder"]

    def put_back_cache(self, take):
        """The take shows the cache again that it had; a folder that was claimed since is deleted."""
        if self.is_in(take):
            return
        shown = attached.objects_of(take.id_data, take)
        # The reason why nothing came of it is reported.
        with contextlib.suppress(JobError):
            cache.free(locate(take).folder)
        for name in CACHE_VALUES:
            setattr(take, name, self._values[name])
        attached.mark(shown, cache.name_of(take))
        take_pictures.put_back(take.id_data.matterfit, self._pictures)

    def put_back(self, take):
        """All of it."""
        self.put_back_cache(take)
        for name, value in self._values.items():
            setattr(take, name, value)
        take.gravity = self._gravity
        for name, rows in self._rows.items():
            _fill(getattr(take, name), rows)


@contextlib.contextmanager
def claiming(scene, take, like=None):
    """The folder that is claimed for a take, which gets the settings of `like`. Where what follows
    raises, or is left, the take is as it was."""
    before, folder = Kept(take), ""
    try:
        if like is not None:
            take.name = like.name
            copy_settings(like, take)
        folder = claim(take)
        yield folder
    except BaseException:  # a generator that is left, too
        _scene, take = still(scene, take, folder)
        if take is not None:
            (before.put_back_cache if like is None else before.put_back)(take)
        raise


def _fill(rows, contents):
    """Puts rows of these _contents() in place of what is there."""
    rows.clear()
    for row in contents:
        added = rows.add()
        for key, value in row.items():
            setattr(added, key, value)


def _contents(row):
    found = {}
    for item in row.bl_rna.properties:
        if item.identifier != "rna_type":
            value = getattr(row, item.identifier)
            found[item.identifier] = (tuple(value) if getattr(item, "is_array", False)
                                      else value)
    return found


def still(scene, take, folder):
    """find() of the folder that was claimed for a take, after which much may have happened; (scene, take)
    as they are where none was yet, ""."""
    return find(folder) if folder else (scene, take)


def find(folder):
    """(scene, take) whose cache is `folder`, looked up anew at every tick of a job: the artist may
    have switched scenes, undone, or removed the take. (None, None) where it is gone."""
    folder = os.path.normpath(folder)
    for scene, take in cache.every_take():
        if take.folder and folder.endswith(os.sep + os.path.normpath(cache.name_of(take))):
            return scene, take
    return None, None
