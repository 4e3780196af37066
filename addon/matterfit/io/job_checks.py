# SPDX-License-Identifier: GPL-3.0-or-later
"""What can be said against a scene before anything of it is sampled."""

import math

from ..compat import translate
from ..jobs import JobError
from ..names import for_file
from . import files, plain

MAX_FRAME = 9_999_999
LEAST_SEPARATION = 3e-5  # [m]; OpenVDB takes no voxel below 14 µm, and distances have half of it
MOST_SEPARATION = 1e3  # [m], as the library has it


def scene(writer):
    """JobError where names, frames or takes do not fit."""
    settings = writer.settings
    bodies = [body for body in settings.bodies if body.enabled and body.role == "BODY"]
    if not bodies:
        raise JobError("Bodies: there is no body to simulate. Select an object and press Add "
                       "Body.")
    seen = {}
    for body in settings.bodies:
        if not body.enabled:
            continue
        name = files.safe_name(body.name)
        if not body.name:
            raise JobError("Bodies: a row has no name. Give it one.")
        if body.role == "BODY" and body.name != for_file(body.name):
            raise JobError(translate("Bodies: files are called after '{name}', and cannot have / or \\ in their "
                                     "names. Rename the row.").format(name=body.name))
        if name in seen:
            raise JobError(f"Bodies: '{body.name}' and '{seen[name]}' have the same name, or "
                           "names that would give the same file. Rename one.")
        seen[name] = body.name
    names = set()
    for capture in settings.captures:
        if capture.enabled:
            name = files.safe_name(capture.name)
            if name in names:
                raise JobError(f"Capture: two captures are named '{capture.name}'. Rename one.")
            names.add(name)
            if capture.body and capture.body not in {body.name for body in bodies}:
                raise JobError(f"capture '{capture.name}': there is no body '{capture.body}'. "
                               "Choose one of the Bodies.")
    if writer.take is not None:
        _take(settings, writer.take)
    _time(writer.scene.render)
    if writer.first < 0:
        raise JobError(f"Frame range: the first frame is {writer.first}. Cache files carry the "
                       "frame's number, so it must not be negative.")
    if writer.end > MAX_FRAME:
        raise JobError(f"Frame range: the last frame is {writer.end - 1}, above {MAX_FRAME}.")
    if writer.end - writer.first < 1:
        raise JobError(f"Frame range: it ends at {writer.end - 1}, before it starts at "
                       f"{writer.first}. Set another End.")


def _time(render):
    """Keys and caches are played at stretched times, and simulated frame by frame."""
    if render.frame_map_old != render.frame_map_new:
        raise JobError(translate(
            "Time Stretching is {old} to {new}: the result would play at another speed than it is "
            "simulated at. Set Old and New to the same number under Output > Frame Range.").format(
                old=render.frame_map_old, new=render.frame_map_new))


def separation(metres, typed=False):
    """JobError where particles this far apart [m] cannot be simulated."""
    finite(metres, "scene.particle_separation")
    if metres > MOST_SEPARATION:
        raise JobError(translate(
            "Particle Separation is {now}, and nothing can be simulated above {most}. Use a smaller one, or "
            "lower Unit Scale under Scene > Units.").format(now=_length(metres), most=_length(MOST_SEPARATION)))
    if metres < LEAST_SEPARATION and typed:
        raise JobError(translate(
            "Particle Separation is {now}, and nothing can be simulated below {least}. Type a larger one, or "
            "choose a Quality.").format(now=_length(metres), least=_length(LEAST_SEPARATION)))
    if metres < LEAST_SEPARATION:
        raise JobError(translate(
            "Particle Separation is {now}, and nothing can be simulated below {least}: what is simulated "
            "is very small. Scale it up, or raise Unit Scale under Scene > Units.").format(
                now=_length(metres), least=_length(LEAST_SEPARATION)))


def finite(part, path=""):
    """JobError where a number of the document is none that JSON has: a field takes one from a driver or
    a script."""
    if isinstance(part, float) and not math.isfinite(part):
        raise JobError(translate(
            "{path} is not a number. Type one; where a driver or an expression sets it, mend that.").format(
                path=path))
    if isinstance(part, dict):
        for key, value in part.items():
            finite(value, f"{path}.{key}" if path else key)
    elif isinstance(part, list):
        for index, value in enumerate(part):
            finite(value, f"{path}[{index}]")


def _length(metres):
    return plain.length_text(metres) if metres >= 1e-5 else f"{1e6 * metres:.2g} µm"


def _take(settings, take):
    """Throws and switches are found by name: one that names nothing would be left out silently."""
    known = {role: {body.name for body in settings.bodies if body.role == role}
             for role in ("BODY", "COLLIDER")}
    for throw in take.throws:
        if throw.name not in known["BODY"]:
            raise JobError(f"take '{take.name}': throws '{throw.name}', which is not among the "
                           "Bodies. Name the body so again, or remove the throw.")
    for switch in take.colliders:
        if switch.name not in known["COLLIDER"]:
            raise JobError(f"take '{take.name}': switches the collider '{switch.name}', which is "
                           "not among the Bodies. Press List Colliders beside the switches.")
