# SPDX-License-Identifier: GPL-3.0-or-later
"""The solver's settings, and what is written out."""

import bpy
from bpy.props import (
    BoolProperty,
    EnumProperty,
    FloatProperty,
    IntProperty,
    PointerProperty,
)

from . import choices, reactions
from .body import MatterfitContact, list_changed
from .numbers import number, vector


def _separation_changed(self, _context):
    reactions.separation_typed(self)


def _quality_changed(self, context):
    reactions.quality_chosen(self, context.scene)


class MatterfitSolver(bpy.types.PropertyGroup):
    """Resolution, range, container."""

    quality: EnumProperty(
        name="Quality", items=choices.QUALITIES, default="STANDARD", update=_quality_changed,
        description="How many cells lie across the thinnest part of the bodies")
    particle_separation: FloatProperty(
        name="Particle Separation", default=0.01, min=1e-6, soft_min=1e-3, max=1e3, soft_max=0.5,
        precision=4, step=0.1, unit="LENGTH", update=_separation_changed,
        description="Distance between particles: the one resolution knob. A grid cell is twice "
                    "as wide")
    for_flows: BoolProperty(
        name="For What Pours", default=False, options={"HIDDEN"},
        description="The separation was set for a scene in which something pours")
    most_particles: IntProperty(
        name="Most Particles", default=100000, min=1000, soft_min=10000, max=100000000,
        soft_max=5000000, update=_quality_changed,
        description="The quality asks for no more particles than this in all bodies together; a "
                    "particle separation that is typed may")
    use_range: BoolProperty(
        name="Own Frame Range", default=False,
        description="Simulate the frames below instead of the scene's")
    frame_start: IntProperty(
        name="Start", default=1, min=0, soft_min=0, max=1048573, soft_max=10000,
        description="First frame that is simulated")
    frame_end: IntProperty(
        name="End", default=48, min=1, soft_min=1, max=1048574, soft_max=10000,
        description="Last frame that is simulated (included)")
    gravity: vector(
        "gravity", default=(0.0, 0.0, -9.81),
        description="Acceleration of gravity in metres per second squared, whatever the scene's "
                    "scale; may be keyed")

    use_ground: BoolProperty(
        name="Ground", default=True, update=list_changed, description="A floor without end")
    ground_height: number("height", name="Height", unit="LENGTH")
    ground: PointerProperty(type=MatterfitContact)

    use_walls: BoolProperty(
        name="Container", default=False,
        description="Closed walls around the scene; a body cannot leave")
    container: PointerProperty(
        name="Container Object", type=bpy.types.Object,
        description="The walls are the sides of this object's world box")
    open_top: BoolProperty(
        name="Open Top", default=True, description="Leave the container's upper side open")
    walls: PointerProperty(type=MatterfitContact)

    cfl: FloatProperty(
        name="CFL", default=0.4, min=0.01, soft_min=0.1, max=1.0, soft_max=0.6, precision=2,
        description="Largest motion in one substep, in cells")
    memory_limit: FloatProperty(
        name="Memory Limit [GB]", default=8.0, min=0.1, soft_min=1.0, max=4096.0, soft_max=256.0,
        precision=1, description="Runs that need more gigabytes than this are refused")
    threads: IntProperty(
        name="Threads", default=0, min=0, soft_min=0, max=1024, soft_max=64,
        description="Processor threads; 0 uses all. The result does not depend on it")


def _restyled(self, _context):
    reactions.surface_restyled(self.id_data.matterfit)


def _regrained(self, _context):
    reactions.grains_restyled(self.id_data.matterfit)


class MatterfitOutput(bpy.types.PropertyGroup):
    """Which caches a bake writes."""

    density: BoolProperty(
        name="Density", default=False, description="OpenVDB grid 'density', a frame a file")
    velocity: BoolProperty(
        name="Velocity", default=False,
        description="OpenVDB grid 'velocity' in metres per second, for motion blur")
    surface: BoolProperty(
        name="Surface", default=True,
        description="OpenVDB level set 'surface', shown through Volume to Mesh")
    surface_smoothing: IntProperty(
        name="Smoothing", default=4, min=0, soft_min=0, max=200, soft_max=20, update=_restyled,
        description="How often the mesh of a surface is smoothed; each time takes bumps of a voxel "
                    "and a little of what is thin")
    surface_offset: FloatProperty(
        name="Offset", default=0.0, min=0.0, soft_min=0.0, max=2.0, soft_max=1.0, precision=2,
        update=_restyled,
        description="Moves surfaces outward by this many particle separations: drops grow together")
    use_voxel_size: BoolProperty(
        name="Voxel Size", default=False,
        description="Use the voxel size below instead of the particle separation")
    voxel_size: FloatProperty(
        name="Voxel Size", default=0.01, min=1e-6, soft_min=1e-3, max=1e4, soft_max=1.0,
        precision=4, unit="LENGTH", description="Width of a voxel of the volumes")
    points: BoolProperty(
        name="Particles", default=True, description="The particles as a PC2 point cache")
    grains: IntProperty(
        name="Grains", default=16, min=1, soft_min=1, max=1000, soft_max=64, update=_regrained,
        description="How many grains each particle of sand is shown as, in renders; the viewport shows a "
                    "quarter of them")
    mesh: BoolProperty(
        name="Meshes", default=True,
        description="The bodies' own meshes, moved with the material, as Mesh Cache")
    splats: BoolProperty(
        name="Splats", default=True,
        description="Bodies made from Gaussians as files of splats, one a frame, for exchange")
    splat_format: EnumProperty(
        name="Format", default="PLY", items=choices.SPLAT_FORMATS,
        description="The format of these files")
    velocity_attribute: BoolProperty(
        name="Velocity", default=True, description="Particle velocity [m/s] as point attribute")
    plastic_strain: BoolProperty(
        name="Plastic Strain", default=False,
        description="Equivalent plastic strain, without unit, as point attribute")
    volume_ratio: BoolProperty(
        name="Volume Ratio", default=False,
        description="Volume over rest volume, without unit, as point attribute")
    stretch: BoolProperty(
        name="Stretch", default=False,
        description="Largest principal stretch, without unit, as point attribute")


CLASSES = (MatterfitSolver, MatterfitOutput)
