# SPDX-License-Identifier: GPL-3.0-or-later
"""What the scene holds of the quantities that a fit can move. All values here are SI, as in the job
document."""

from .. import quantities
from ..props import scene as scene_props
from . import frames, motion, transforms

GROUND = "ground"  # its name in the job document


def find_body(settings, name):
    return next((body for body in settings.bodies if body.name == name), None)


def find_capture(settings, name):
    return next((capture for capture in settings.captures if capture.name == name), None)


def contact_of(settings, owner):
    """The contact of a collider or of the ground; None where there is no such collider."""
    body = find_body(settings, owner)
    if body is not None and body.role == "COLLIDER":
        return body.contact
    return settings.solver.ground if owner == GROUND else None


def value(settings, owner, key):
    """What a fit of the active take starts from: a number, or three. None where it is animated, so
    that it is not known at this frame."""
    scene = settings.id_data
    scale = transforms.metres(scene)
    take = scene_props.active_take(settings)
    if key == "gravity":
        return tuple(take.gravity if take is not None and take.use_gravity
                     else settings.solver.gravity)
    if key == "height":
        return settings.solver.ground_height * scale
    if key == "start_frame":
        capture = find_capture(settings, owner)
        own = capture is not None and capture.use_start_frame
        return capture.start_frame if own else float(frames.frame_range(scene)[0])
    if key.startswith("contact."):
        contact = contact_of(settings, owner)
        return 0.0 if contact is None else getattr(contact, key[len("contact."):])
    body = find_body(settings, owner)
    if body is None:
        return 0.0
    branch = quantities.branch_of(key)
    if branch is not None:
        index, name = branch
        branches = body.material.maxwell
        return getattr(branches[index], name) if index < len(branches) else 0.0
    if key.startswith("material."):
        return getattr(body.material, key[len("material."):])
    if key == "density":
        return body.density
    throw = None if take is None else next(
        (throw for throw in take.throws if throw.name == owner), None)
    if key in ("velocity", "spin"):
        source = throw.velocity_from if throw is not None else "BODY"
        if (body.velocity_from if source == "BODY" else source) == "ANIMATION":
            return None
        thrown = throw if throw is not None and throw.velocity_from == "VALUE" else body
        return tuple(thrown.spin) if key == "spin" else _times(thrown.velocity, scale)
    if key == "placement.position":
        if throw is not None and throw.use_placement:
            return _times(throw.location, scale)
        if body.object is not None:
            there = scene.frame_current == frames.frame_range(scene)[0]
            return (_times(body.object.matrix_world.translation, scale)
                    if there or not motion.moves(body.object) else None)
    return (0.0, 0.0, 0.0)


def _times(vector, scale):
    return tuple(component * scale for component in vector)


def played(settings, row):
    """value(), with the scene set to its first frame where only that tells; None for the velocity
    of an animation."""
    found = value(settings, row.owner, row.key)
    if found is None and row.key == "placement.position":
        scene = settings.id_data
        with frames.frame_kept(scene):
            scene.frame_set(frames.frame_range(scene)[0])
            found = value(settings, row.owner, row.key)
    return found
