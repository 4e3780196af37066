# SPDX-License-Identifier: GPL-3.0-or-later
"""What a fit can move: the list in the Fit panel, kept in step with bodies, colliders, ground and
captures.

All values here are SI, as in the job document.
"""

import math
import re
from dataclasses import dataclass

from ..props import choices
from ..props import scene as scene_props
from ..props.body import MatterfitBody, MatterfitContact
from ..props.material import MatterfitMaterial, MatterfitMaxwell
from . import frames, transforms

# In which scale steps are equal: x, ln x, ln(x / (½ - x)).
LINEAR, LOG, LOGIT = "linear", "log", "logit"

GROUND = "ground"  # its name in the job document
RANGE = 1e4  # a LOG parameter without bounds of its own is looked for this factor either side

_BRANCH = re.compile(r"^material\.maxwell\[(\d+)\]\.(modulus|time)$")
_KEPT = ("enabled", "axes", "use_start", "start", "start_vector", "use_bounds", "low", "high",
         "reach", "use_prior", "mean", "mean_vector", "sigma")
_restoring = []  # not empty while rows are filled in: nothing follows from their switches then


@dataclass(frozen=True)
class Quantity:
    """`key` in the job document's words below its owner; `label` in English with the unit.

    `low` and `high` are the bounds that it has by itself (0, 0: a factor either side of the start;
    `around`: about the start), `reach` that of vectors; `sigma` is the deviation that a prior
    begins with.
    """

    key: str
    label: str
    scale: str = LOG
    low: float = 0.0
    high: float = 0.0
    size: int = 1
    reach: float = 1.0
    around: bool = False
    sigma: float = 0.2


_MATERIAL = {
    "E": {"low": 1e2, "high": 1e10},
    "nu": {"scale": LOGIT, "low": 0.01, "high": 0.495},
    "exponent": {"low": 0.1, "high": 4.0},
    "friction_angle": {"scale": LINEAR, "low": 5.0, "high": 65.0, "sigma": 5.0},
}
_MOTION = (
    Quantity("velocity", "Velocity [m/s]", LINEAR, size=3, reach=50.0, sigma=1.0),
    Quantity("spin", "Spin [rad/s]", LINEAR, size=3, reach=200.0, sigma=5.0),
    Quantity("placement.position", "Position [m]", LINEAR, size=3, reach=1.0, sigma=0.02),
    Quantity("placement.rotation", "Rotation [rad]", LINEAR, size=3, reach=math.pi, sigma=0.1),
)
_GRAVITY = Quantity("gravity", "Gravity [m/s²]", LINEAR, size=3, reach=100.0, sigma=0.1)
_HEIGHT = Quantity("height", "Height [m]", LINEAR, -1.0, 1.0, around=True, sigma=0.01)
_START_FRAME = Quantity("start_frame", "Start Frame", LINEAR, -2.0, 2.0, around=True, sigma=0.5)


def _label(group, name):
    return group.bl_rna.properties[name].name


def material_quantity(name):
    """One of the parameters of a material: 'E', 'damping_shear', 'maxwell[0].time'."""
    branch = _BRANCH.match("material." + name)
    if branch is not None:
        label = _label(MatterfitMaxwell, branch.group(2))
        return Quantity("material." + name, f"{int(branch.group(1)) + 1}: {label}")
    return Quantity("material." + name, _label(MatterfitMaterial, name), **_MATERIAL.get(name, {}))


def label_of(key):
    """The label of a key, also of one that this scene does not have; the key itself where it is
    not known."""
    for quantity in (*_MOTION, _GRAVITY, _HEIGHT, _START_FRAME):
        if quantity.key == key:
            return quantity.label
    group, _dot, name = key.rpartition(".")
    if group.startswith("material"):
        known = _BRANCH.match(key) or name in MatterfitMaterial.bl_rna.properties
        return material_quantity(key[len("material."):]).label if known else key
    if group == "contact" and name in MatterfitContact.bl_rna.properties:
        return _label(MatterfitContact, name)
    return _label(MatterfitBody, "density") if key == "density" else key


def law_keys():
    """Keys of the parameters that belong to a law, which another law may not have."""
    return {"material." + name for names in choices.LAW_PARAMETERS.values() for name in names}


def _of_body(body):
    material = body.material
    names = [*choices.LAW_PARAMETERS[material.law], *choices.DAMPING_PARAMETERS]
    for index in range(len(material.maxwell)):
        names += [f"maxwell[{index}].modulus", f"maxwell[{index}].time"]
    found = [material_quantity(name) for name in names]
    found.append(Quantity("density", _label(MatterfitBody, "density")))
    return [*found, *_MOTION]


def _of_contact(contact):
    found = []
    if contact.kind == "FRICTION":
        found.append(Quantity("contact.mu", _label(MatterfitContact, "mu"), LOG, 1e-3, 3.0))
    found.append(Quantity("contact.stiffness", _label(MatterfitContact, "stiffness")))
    return found


def candidates(settings):
    """[(owner, Quantity)] of all that a fit of this scene could move, in the list's order."""
    bodies = [body for body in settings.bodies if body.role == "BODY"]
    found = [(body.name, quantity) for body in bodies for quantity in _of_body(body)]
    if not bodies:
        return found
    found.append(("", _GRAVITY))
    if settings.solver.use_ground:
        found += [(GROUND, quantity)
                  for quantity in (*_of_contact(settings.solver.ground), _HEIGHT)]
    for body in settings.bodies:
        if body.role == "COLLIDER":
            found += [(body.name, quantity) for quantity in _of_contact(body.contact)]
    # Those that are switched off too: their settings stay until they are on again.
    found += [(capture.name, _START_FRAME) for capture in settings.captures]
    seen = set()
    return [(owner, quantity) for owner, quantity in found
            if (owner, quantity.key) not in seen and not seen.add((owner, quantity.key))]


def quantity_of(settings, row):
    """The Quantity of a row of the list, or None where the scene does not have it any more."""
    for owner, quantity in candidates(settings):
        if (owner, quantity.key) == (row.owner, row.key):
            return quantity
    return None


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
    branch = _BRANCH.match(key)
    if branch is not None:
        index = int(branch.group(1))
        branches = body.material.maxwell
        return getattr(branches[index], branch.group(2)) if index < len(branches) else 0.0
    if key.startswith("material."):
        return getattr(body.material, key[len("material."):])
    if key == "density":
        return body.density
    throw = None if take is None else next(
        (throw for throw in take.throws if throw.name == owner), None)
    if key in ("velocity", "spin"):
        if throw is not None and throw.velocity_from == "ANIMATION":
            return None
        thrown = throw if throw is not None and throw.velocity_from == "VALUE" else body
        return tuple(thrown.spin) if key == "spin" else _times(thrown.velocity, scale)
    if key == "placement.position":
        if throw is not None and throw.use_placement:
            return _times(throw.location, scale)
        if body.object is not None:
            there = scene.frame_current == frames.frame_range(scene)[0]
            return (_times(body.object.matrix_world.translation, scale)
                    if there or not _moves(body.object) else None)
    return (0.0, 0.0, 0.0)


def _times(vector, scale):
    return tuple(component * scale for component in vector)


def _moves(item):
    """Whether the object may be somewhere else at another frame."""
    while item is not None:
        if item.animation_data is not None or item.constraints or item.rigid_body is not None:
            return True
        item = item.parent
    return False


def _played(settings, row):
    """value(), with the scene set to its first frame where only that tells; None for the velocity
    of an animation."""
    found = value(settings, row.owner, row.key)
    if found is None and row.key == "placement.position":
        scene = settings.id_data
        with frames.frame_kept(scene):
            scene.frame_set(frames.frame_range(scene)[0])
            found = value(settings, row.owner, row.key)
    return found


def refresh(settings):
    """Brings the list up to date; what was set in rows that stay is kept."""
    rows = settings.fit.parameters
    wanted = candidates(settings)
    if [(row.owner, row.key) for row in rows] == [(owner, item.key) for owner, item in wanted]:
        return
    kept = {(row.owner, row.key): _contents(row) for row in rows}
    renamed = _renamed(rows, wanted)
    observed = observed_bodies(settings)
    rows.clear()
    _restoring.append(settings)
    try:
        for owner, quantity in wanted:
            row = rows.add()
            row.owner, row.key = owner, quantity.key
            row.name = f"{owner} {quantity.label}".strip()
            before = renamed.get((quantity is _START_FRAME, owner))
            old = kept.get((owner, quantity.key)) or kept.get((before, quantity.key))
            if old is not None:
                for name, content in old.items():
                    setattr(row, name, content)
            else:
                _begin(settings, row, quantity, owner in observed)
    finally:
        _restoring.pop()
    settings.fit.parameter_index = min(settings.fit.parameter_index, max(len(rows) - 1, 0))


def _contents(row):
    found = {}
    for name in _KEPT:
        content = getattr(row, name)
        found[name] = tuple(content) if hasattr(content, "__len__") else content
    return found


def _renamed(rows, wanted):
    """{(of a capture, new name): old name} where exactly one body or collider, or exactly one
    capture, has gone and one has come."""
    found = {}
    for of_capture in (False, True):
        before = {row.owner for row in rows if (row.key == _START_FRAME.key) is of_capture}
        after = {owner for owner, quantity in wanted if (quantity is _START_FRAME) is of_capture}
        gone, come = before - after, after - before
        if len(gone) == len(come) == 1:
            found[of_capture, come.pop()] = gone.pop()
    return found


def branch_removed(settings, owner, index):
    """A Maxwell branch is gone: the rows of those after it go on with it, by their new numbers."""
    rows = settings.fit.parameters
    for place in reversed(range(len(rows))):
        row = rows[place]
        branch = _BRANCH.match(row.key)
        if row.owner != owner or branch is None or int(branch.group(1)) < index:
            continue
        if int(branch.group(1)) == index:
            rows.remove(place)
            continue
        quantity = material_quantity(f"maxwell[{int(branch.group(1)) - 1}].{branch.group(2)}")
        row.key, row.name = quantity.key, f"{owner} {quantity.label}".strip()
    refresh(settings)


def observed_bodies(settings):
    """Names of the bodies that captures are recordings of; without captures the first body."""
    bodies = [body.name for body in settings.bodies if body.role == "BODY"]
    names = {capture.body or (bodies[0] if bodies else "") for capture in settings.captures}
    return names or set(bodies[:1])


def _begin(settings, row, quantity, observed):
    """The values of a new row: what the scene has, and bounds about it."""
    row.reach, row.sigma = quantity.reach, quantity.sigma
    if quantity.size == 1 and quantity.scale != LINEAR:
        # The logarithm of 0 is no start, nor is a stiffness that the solver derives.
        row.use_start = value(settings, row.owner, row.key) <= 0.0 or (
            row.key == "contact.stiffness"
            and not contact_of(settings, row.owner).use_stiffness)
    _set_start(settings, row, quantity, value(settings, row.owner, row.key))
    reset_bounds(settings, row, quantity)
    row.mean, row.mean_vector = row.start, row.start_vector
    row.enabled = observed and _on(settings, row)


def reset_start(settings, row, quantity):
    """Sets the row's start to what the scene has; where that is no start, to something near."""
    _set_start(settings, row, quantity, _played(settings, row))


def _set_start(settings, row, quantity, now):
    if now is None:
        return
    if quantity.size == 3:
        row.start_vector = now
    elif quantity.scale != LINEAR and now <= 0.0:
        row.start = _guess(settings, row)
    else:
        row.start = now


def reset_mean(settings, row, quantity):
    """Sets what a prior expects to where the search begins."""
    now = _played(settings, row)
    if quantity.size == 3:
        row.mean_vector = row.start_vector if row.use_start or now is None else now
    elif row.use_start:
        row.mean = row.start
    else:
        row.mean = now if quantity.scale == LINEAR or now > 0.0 else _guess(settings, row)


def is_restoring():
    """Whether rows are being filled in, so that nothing follows from what is switched."""
    return bool(_restoring)


def reset_bounds(settings, row, quantity):
    """Sets the row's bounds to those of its kind, about what it starts from."""
    if quantity.size == 3:
        row.reach = quantity.reach
        return
    start = row.start if row.use_start else value(settings, row.owner, row.key)
    if quantity.low == quantity.high:
        row.low, row.high = start / RANGE, start * RANGE
    elif quantity.around:
        row.low, row.high = start + quantity.low, start + quantity.high
    else:
        row.low, row.high = min(quantity.low, start), max(quantity.high, start)


def _guess(settings, row):
    """A first value of something that is 0 now: of the size that matters beside the stiffness."""
    body = find_body(settings, row.owner)
    stiffness = 1e5
    if body is not None:
        material = body.material
        stiffness = material.bulk_modulus if material.law == "NEWTONIAN" else material.E
    name = row.key.rsplit(".", 1)[-1]
    parts = {"yield_stress": 1e-2, "hardening": 1e-2, "cohesion": 1e-3, "viscosity": 1e-4,
             "damping_shear": 1e-4, "damping_bulk": 1e-4}
    return parts[name] * stiffness if name in parts else 0.1


def _on(settings, row):
    """Whether a new row of an observed body is looked for without being asked."""
    body = find_body(settings, row.owner)
    if body is None or body.role != "BODY":
        return False
    if row.key in ("velocity", "spin"):
        return not body.pins
    # What is 0 in the scene, as hardening and cohesion often are, is added on purpose only.
    return row.key in law_keys() and row.key != "material.exponent" and not row.use_start


def hold(settings, owner):
    """A body that is held somewhere has no velocity to look for."""
    for row in settings.fit.parameters:
        if row.owner == owner and row.key in ("velocity", "spin"):
            row.enabled = False
