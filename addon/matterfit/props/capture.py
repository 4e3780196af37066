# SPDX-License-Identifier: GPL-3.0-or-later
"""Captures: recorded motion that simulations are compared with and fitted to."""

import bpy
from bpy.props import (
    BoolProperty,
    EnumProperty,
    FloatProperty,
    FloatVectorProperty,
    IntProperty,
    PointerProperty,
    StringProperty,
)

from ..compat import PATH_OPTIONS
from . import choices, reactions
from .compare import outdated
from .numbers import number


def _reread(self, context):
    """For settings of how the file is read."""
    if reactions.rewriting():
        return
    self.summary = ""
    outdated(self, context)


def _other_file(self, context):
    """Where cameras stand is found for one file."""
    if reactions.rewriting():
        return
    self.poses = ""
    _reread(self, context)


def _moved(self, context):
    outdated(self, context)
    reactions.capture_moved(self)


# How images are held out, with the numbers that `holdout` has for it.
_HELD_OUT_IMAGES = (("NONE", "Nothing", "Everything is used", 0),
                    ("FRAMES", "Last Frames", "The frames at the end are kept for testing", 1),
                    ("TRACKS", "Cameras", "The cameras below are kept for testing", 3),
                    ("BOTH", "Both", "The frames at the end, of all cameras, and all frames of the cameras "
                                     "below are kept for testing", 4))


def _held_out_number(self):
    return self.bl_rna.properties["holdout"].enum_items[self.holdout].value


def _hold_out_by_number(self, number):
    self.holdout = next(item[0] for item in _HELD_OUT_IMAGES if item[3] == number)


def _list_outdated(self, _context):
    reactions.fit_list_outdated(self.id_data.matterfit)


def _renamed(self, context):
    outdated(self, context)
    _list_outdated(self, context)
    reactions.capture_renamed(self)


class MatterfitCapture(bpy.types.PropertyGroup):
    """One row of the Captures list."""

    name: StringProperty(name="Name", default="Capture", update=_renamed,
                         description="A name for this capture")
    enabled: BoolProperty(
        name="Enabled", default=True, update=outdated,
        description="Compare with this capture, and fit to it")
    source: EnumProperty(
        name="Source", default="FILE", update=outdated,
        items=(("FILE", "File", "Tracks from .npz, .npy, .c3d, .pc2, or numbered .ply files"),
               ("IMAGES", "Images", "Mattes from the cameras of a transforms.json, an "
                                    "all_data.json or a COLMAP model"),
               ("OBJECT", "Object", "The evaluated mesh of an object, at every frame")),
        description="Where the recorded points come from")
    filepath: StringProperty(
        name="File", subtype="FILE_PATH", options=PATH_OPTIONS, update=_other_file,
        description="A .npz, .npy, .c3d or .pc2 file, the first of numbered .ply files, or the "
                    "cameras of images; of a COLMAP model its folder or one of its files")
    object: PointerProperty(
        name="Object", type=bpy.types.Object, update=outdated,
        description="An animated object; its evaluated mesh is sampled at every frame")
    body: StringProperty(
        name="Body", update=outdated,
        description="The body that this is a recording of; empty: the first one")

    use_fps: BoolProperty(
        name="Rate [1/s]", default=False, update=_reread,
        description="Use the rate below where the file gives none, or a wrong one")
    fps: FloatProperty(
        name="Rate [1/s]", default=24.0, min=1e-3, soft_min=1.0, max=1e6, soft_max=1000.0,
        precision=3, update=_reread, description="Recorded frames per second")
    unit: EnumProperty(
        name="Unit", items=choices.UNITS, default="AUTO", update=_reread,
        description="What one unit of the file's positions is")
    scale: FloatProperty(
        name="Scale", default=1.0, min=1e-9, soft_min=1e-3, max=1e9, soft_max=1e3, precision=6,
        update=_reread, description="Metres per unit of the file")
    up: EnumProperty(
        name="Up Axis", items=choices.UP_AXES, default="AUTO", update=_reread,
        description="Which axis of the file points up")
    location: FloatVectorProperty(
        name="Location", subtype="TRANSLATION", unit="LENGTH", size=3, update=_moved,
        min=-1e6, soft_min=-100.0, max=1e6, soft_max=100.0, precision=4,
        description="Moves the recorded points, or cameras, into the scene")
    rotation: FloatVectorProperty(
        name="Rotation", subtype="EULER", unit="ROTATION", size=3, update=_moved,
        min=-1e3, soft_min=-6.283185, max=1e3, soft_max=6.283185,
        description="Turns the recorded points, or cameras, into the scene, before Location")
    use_start_frame: BoolProperty(
        name="Start Frame", default=False, update=outdated,
        description="The capture's first sample falls on the frame below instead of the first")
    start_frame: number("start_frame", update=outdated)
    markers: StringProperty(
        name="Markers", update=outdated,
        description="Names or numbers of the points to use, separated by commas; empty: all")

    align: PointerProperty(
        name="Align To", type=bpy.types.Collection, update=outdated,
        description="Empties named like markers, placed where those are on the body at rest: the "
                    "capture is turned and moved onto them. Replaces Location and Rotation")
    use_release: BoolProperty(
        name="Quiet Start", default=False, update=outdated,
        description="The body stands still until the frame below; needed for aligning and for "
                    "ring-down")
    release: IntProperty(
        name="Release Frame", default=10, min=0, soft_min=0, max=1048574, soft_max=10000,
        update=outdated, description="Scene frame after which the motion starts")

    use_noise: BoolProperty(
        name="Noise", default=False,
        description="Use the noise below instead of the one estimated from the file")
    noise: FloatProperty(
        name="Noise", default=5e-4, min=0.0, soft_min=0.0, max=1e3, soft_max=0.01, precision=5,
        unit="LENGTH", description="Standard deviation of a recorded coordinate")
    noise_pixels: FloatProperty(
        name="Noise [pixels]", default=1.0, min=1e-3, soft_min=0.1, max=1e3, soft_max=10.0,
        precision=2, description="Standard deviation of where the outline of a matte lies")
    use_colours: BoolProperty(
        name="Colours", default=False,
        description="Compare the colours of the images too, beside the mattes: for bodies with a "
                    "pattern that moves with them")
    colour_noise: FloatProperty(
        name="Colour Noise", default=0.1, min=1e-3, soft_min=0.01, max=10.0, soft_max=1.0, precision=3,
        step=1, description="Standard deviation of a colour, where 1 is from black to white; light and "
                            "focus count more than the camera's own noise")
    refine_cameras: BoolProperty(
        name="Refine Cameras", default=False,
        description="A fit finds how each camera stands against what its file says")
    pose_shift: FloatProperty(
        name="Shift", default=0.02, min=0.0, soft_min=0.0, max=1e4, soft_max=1.0, precision=4, step=0.1,
        unit="LENGTH", description="How far from where the file says a camera may stand (standard "
                                   "deviation); 0: the file is right")
    pose_turn: FloatProperty(
        name="Turn", subtype="ANGLE", default=0.02, min=0.0, soft_min=0.0, max=3.0, soft_max=0.5,
        precision=2, step=10, description="How far from what the file says a camera may be turned "
                                          "(standard deviation); 0: the file is right")
    pose_focal: FloatProperty(
        name="Focal Length", default=0.0, min=0.0, soft_min=0.0, max=1.0, soft_max=0.1, precision=3,
        step=0.1, description="By which share a focal length may differ from what the file says "
                              "(standard deviation); 0: the file is right")
    poses: StringProperty(
        name="Camera Poses", update=outdated,
        description="How cameras stand against what their file says, as a fit has found it")
    tagged: StringProperty(
        name="Cameras Of", options={"HIDDEN"},
        description="The name by which the scene's cameras know this capture; empty: it has none")
    use_key: BoolProperty(
        name="Key", default=False, update=_reread,
        description="Make mattes by the body's colour below, in place of the images' own")
    key: FloatVectorProperty(
        name="Key", subtype="COLOR_GAMMA", size=3, default=(0.0, 0.4, 0.6), min=0.0, max=1.0,
        update=_reread, description="The body's colour, as the images show it")
    key_range: FloatVectorProperty(
        name="Key Range", size=2, default=(0.25, 0.75), min=0.0, soft_min=0.0, max=10.0, soft_max=1.0,
        precision=2, step=1, update=_reread,
        description="How much of the colour a pixel has that is not of the body at all, and that is all body")
    use_plate: BoolProperty(
        name="Clean Plate", default=False, update=_reread,
        description="Make mattes by what differs from the images below, which do not show the body")
    plate: StringProperty(
        name="Clean Plate", subtype="FILE_PATH", options=PATH_OPTIONS, update=_reread,
        description="An image without the body: one of a numbered file a camera, in their order, or "
                    "a name with # in place of a camera's number")
    plate_threshold: FloatProperty(
        name="Threshold", default=6.0, min=0.1, soft_min=1.0, max=1000.0, soft_max=20.0, precision=1,
        update=_reread, description="How far from its clean plate a pixel is of the body, in standard "
                                    "deviations of the images' noise")
    images: StringProperty(
        name="Image Folder", subtype="DIR_PATH", options=PATH_OPTIONS, update=_reread,
        description="Where the images lie; empty: beside the file, of a COLMAP model where it is "
                    "usual")
    holdout: EnumProperty(
        name="Hold-out", default="NONE", update=_list_outdated,
        items=(("NONE", "Nothing", "Everything is used", 0),
               ("FRAMES", "Last Frames", "The frames at the end are kept for testing", 1),
               ("TRACKS", "Points", "The points, or cameras of images, below are kept for testing", 3),
               ("BOTH", "Both", "The frames at the end, of all points, and all frames of the points below "
                                "are kept for testing", 4),
               ("CAPTURE", "Whole Capture", "This capture is only used for testing", 2)),
        description="What is kept back to test a fit with")
    holdout_of_images: EnumProperty(
        name="Hold-out", items=_HELD_OUT_IMAGES, get=_held_out_number, set=_hold_out_by_number,
        description="What is kept back of the images to test a fit with")
    holdout_start: IntProperty(
        name="From", default=30, min=0, soft_min=0, max=1048574, soft_max=10000,
        description="First scene frame that is held out")
    holdout_tracks: StringProperty(
        name="Points", description="Names or numbers of the points that are held out, or numbers of "
                                   "cameras, separated by commas")

    summary: StringProperty(
        name="Summary", description="What the file contains, one finding a line")

    @property
    def holds_out_frames(self):
        return self.holdout in ("FRAMES", "BOTH")

    @property
    def holds_out_tracks(self):
        """Points, or cameras of images."""
        return self.holdout in ("TRACKS", "BOTH")


CLASSES = (MatterfitCapture,)
