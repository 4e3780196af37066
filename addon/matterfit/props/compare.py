# SPDX-License-Identifier: GPL-3.0-or-later
"""What Compare found, and how it is shown."""

import bpy
from bpy.props import (
    BoolProperty,
    CollectionProperty,
    EnumProperty,
    FloatProperty,
    IntProperty,
    StringProperty,
)


def _jump(self, context):
    if 0 <= self.worst_index < len(self.worst):
        context.scene.frame_set(self.worst[self.worst_index].frame)


def redraw(_self, context):
    for area in context.screen.areas if context.screen else ():
        if area.type == "VIEW_3D":
            area.tag_redraw()


def forget(settings):
    """What was compared is of other captures or values than there are now, whichever take it is of."""
    settings.compare.done = settings.compare.images_done = False
    for take in settings.takes:
        take.compared = False


def outdated(owner, context):
    """For every setting that changes what Compare would find."""
    forget(owner.id_data.matterfit)
    redraw(owner, context)


def _jump_to_image(self, context):
    if 0 <= self.worst_image < len(self.worst_images):
        context.scene.frame_set(self.worst_images[self.worst_image].frame)


def store(compare, found, images=None):
    """Fills in what the panel shows of an io.comparison.Comparison and of an
    io.image_comparison.ImageComparison; None: there is none."""
    _store_images(compare, images)
    compare.done = found is not None
    compare.worst.clear()
    if found is None:
        return
    compare.mean_mm = found.mean
    compare.p95_mm = found.percentile95
    for frame, mean, largest in found.worst():
        row = compare.worst.add()
        row.name = str(frame)
        row.frame = frame
        row.mean = mean
        row.largest = largest


NONE = (-1000.0, -2.0)  # of colours that were not compared


def _store_images(compare, images):
    compare.images_done = images is not None
    compare.worst_images.clear()
    if images is None:
        return
    compare.capture = images.name
    compare.images_held_out = images.held_out is not None
    for prefix, found in (("", images.seen), ("held_out_", images.held_out)):
        if found is not None:
            setattr(compare, prefix + "iou", -1.0 if found.iou is None else found.iou)
            setattr(compare, prefix + "contour_px", -1.0 if found.contour is None else found.contour)
            ratio, likeness = found.colours or NONE
            setattr(compare, prefix + "psnr_db", ratio)
            setattr(compare, prefix + "ssim", likeness)
    for image in images.worst():
        row = compare.worst_images.add()
        row.name = image["image"]
        row.frame = int(round(image["frame"]))
        row.camera = image["camera"]
        row.iou = image["iou"]
        row.outside = image["outside_px"]
        row.missing = image["missing_px"]


class MatterfitWorstImage(bpy.types.PropertyGroup):
    """One of the images that agree least with the simulation."""

    name: StringProperty(name="Image", description="The image's file")
    frame: IntProperty(name="Frame", default=0, min=-1048574, max=1048574, soft_max=10000,
                       description="Scene frame")
    camera: IntProperty(name="Camera", default=0, min=0, max=1000000, soft_max=100,
                        description="The camera's number in its file")
    iou: FloatProperty(name="Overlap", default=0.0, min=0.0, max=1.0,
                       description="Area of both outlines over that of either")
    outside: IntProperty(name="Outside [px]", default=0, min=0, soft_max=10000,
                         description="Pixels that only the simulation covers")
    missing: IntProperty(name="Missing [px]", default=0, min=0, soft_max=10000,
                         description="Pixels that only the recording covers")


class MatterfitWorstFrame(bpy.types.PropertyGroup):
    """One of the frames with the largest error."""

    name: StringProperty(name="Frame", description="The scene frame as text")
    frame: IntProperty(name="Frame", default=0, min=0, max=1048574, soft_max=10000,
                       description="Scene frame")
    mean: FloatProperty(name="Mean [mm]", default=0.0, min=0.0, max=1e12, soft_max=100.0,
                        description="Mean error of the points in this frame, in millimetres")
    largest: FloatProperty(name="Largest [mm]", default=0.0, min=0.0, max=1e12, soft_max=100.0,
                           description="Largest error of a point in this frame, in millimetres")


class MatterfitCompare(bpy.types.PropertyGroup):
    """Shown in the Compare panel and the viewport: the active take against the active capture. The
    errors themselves lie in the cache."""

    done: BoolProperty(name="Compared", default=False, description="A comparison is loaded")
    mean_mm: FloatProperty(name="Mean [mm]", default=0.0, min=0.0, max=1e12, soft_max=100.0,
                           precision=3, description="Mean error over points and frames, in mm")
    p95_mm: FloatProperty(name="95 % [mm]", default=0.0, min=0.0, max=1e12, soft_max=100.0,
                          precision=3, description="95 % of the errors are smaller, in mm")
    worst: CollectionProperty(type=MatterfitWorstFrame)
    worst_index: IntProperty(name="Worst Frame", default=0, min=0, soft_max=100, max=100000,
                             update=_jump, description="Jumps to this frame")
    images_done: BoolProperty(name="Images Compared", default=False,
                              description="A comparison with images is loaded")
    capture: StringProperty(name="Capture", description="Whose images were compared")
    iou: FloatProperty(name="Overlap", default=0.0, min=-1.0, max=1.0, precision=3,
                       description="Mean of the area of both outlines over that of either, images that are not "
                                   "held out; negative: none shows anything")
    contour_px: FloatProperty(name="Outlines Off [px]", default=0.0, min=-1.0, max=1e6,
                              soft_max=100.0, precision=2,
                              description="Mean distance between the outlines, in pixels, the same images; "
                                          "negative: none was seen")
    psnr_db: FloatProperty(name="PSNR [dB]", default=NONE[0], min=-1000.0, max=1000.0, precision=1,
                           description="Mean signal-to-noise ratio of the colours, images that are not held "
                                       "out, at the size that a fit sees; -1000: none were compared")
    ssim: FloatProperty(name="SSIM", default=NONE[1], min=-2.0, max=1.0, precision=3,
                        description="Mean structural similarity of the colours, the same images; -2: none")
    images_held_out: BoolProperty(name="Held Out", default=False,
                                  description="Some of the compared images are held out")
    held_out_iou: FloatProperty(
        name="Held-Out Overlap", default=0.0, min=-1.0, max=1.0, precision=3,
        description="Mean of the area of both outlines over that of either, images that are held out; negative: "
                    "none shows anything")
    held_out_contour_px: FloatProperty(
        name="Held-Out Outlines Off [px]", default=0.0, min=-1.0, max=1e6, soft_max=100.0, precision=2,
        description="Mean distance between the outlines, in pixels, the same images; negative: none was seen")
    held_out_psnr_db: FloatProperty(
        name="Held-Out PSNR [dB]", default=NONE[0], min=-1000.0, max=1000.0, precision=1,
        description="Mean signal-to-noise ratio of the colours, images that are held out, at their full size; "
                    "-1000: none were compared")
    held_out_ssim: FloatProperty(
        name="Held-Out SSIM", default=NONE[1], min=-2.0, max=1.0, precision=3,
        description="Mean structural similarity of the colours, the same images; -2: none")
    worst_images: CollectionProperty(type=MatterfitWorstImage)
    worst_image: IntProperty(name="Worst Image", default=0, min=0, soft_max=100, max=100000,
                             update=_jump_to_image, description="Jumps to this image's frame")
    show_heatmap: BoolProperty(
        name="Heat-Map", default=True, update=redraw,
        description="Draw the captured points in the viewport, coloured by their error")
    show_simulation: BoolProperty(
        name="Simulated Points", default=True, update=redraw,
        description="Draw where the simulation has the same points, in grey")
    show_graph: BoolProperty(
        name="Error over Time", default=True, update=redraw,
        description="Draw the mean error of every frame in the viewport")
    show_links: BoolProperty(
        name="Lines to Simulation", default=False, update=redraw,
        description="Draw a line from each captured point to its simulated place")
    heat_unit: EnumProperty(
        name="Heat-Map In", default="MM", update=redraw,
        items=(("MM", "Millimetres", "How far a point is off"),
               ("SIGMA", "Sigma", "How far it is off over what noise and the solver make in that frame, "
                                  "as the diagnosis of the fit has found it")),
        description="What colours mean")
    significant_only: BoolProperty(
        name="Significant Only", default=False, update=redraw,
        description="Draw only points that are farther off than noise and the solver make, as the "
                    "diagnosis of the fit has found it")
    range_sigma: FloatProperty(
        name="Red At [σ]", default=10.0, min=1e-3, soft_min=1.0, max=1e6, soft_max=100.0,
        precision=2, update=redraw, description="From how many times the usual size on errors are red")
    range_mode: EnumProperty(
        name="Range", default="AUTO", update=redraw,
        items=(("AUTO", "Automatic", "Red is the 95th percentile of all errors"),
               ("FIXED", "Fixed", "Red is the value below")),
        description="Which error is drawn red")
    range_mm: FloatProperty(
        name="Red At [mm]", default=10.0, min=1e-6, soft_min=0.01, max=1e9, soft_max=1000.0,
        precision=3, update=redraw, description="Errors from this on are red, in millimetres")
    point_size: FloatProperty(
        name="Point Size [px]", default=6.0, min=1.0, soft_min=1.0, max=64.0, soft_max=20.0,
        precision=1, update=redraw, description="Size of a drawn point, in pixels")


CLASSES = (MatterfitWorstImage, MatterfitWorstFrame, MatterfitCompare)
