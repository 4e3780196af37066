# SPDX-License-Identifier: GPL-3.0-or-later
"""The rows of the Fit panel's list, one for each quantity that a fit can move, kept in step with
bodies, colliders, ground and captures."""

from .. import laws, library, quantities
from ..props import reactions
from ..quantities import LINEAR
from . import fit_values

_KEPT = ("enabled", "axes", "use_start", "start", "start_vector", "use_bounds", "low", "high",
         "reach", "use_prior", "mean", "mean_vector", "sigma")
# A fit's rows that the neural law begins with; its other numbers are added by hand.
_NEURAL_FITTED = frozenset({"material.E", "material.nu", "material.form_1", "material.form_2"})
_restoring = []  # not empty while rows are filled in: nothing follows from their switches then


def law_keys():
    """Keys of the parameters that belong to a law, which another law may not have."""
    return {"material." + name for names in laws.PARAMETERS.values() for name in names}


def _of_body(body):
    material = body.material
    names = [*laws.PARAMETERS[material.law], *laws.DAMPING]
    for index in range(len(material.maxwell)):
        names += [f"maxwell[{index}].modulus", f"maxwell[{index}].time"]
    return [*map(quantities.material, names), quantities.DENSITY, *quantities.MOTION]


def _of_contact(contact):
    friction = [quantities.FRICTION] if contact.kind == "FRICTION" else []
    return [*friction, quantities.STIFFNESS]


def candidates(settings):
    """[(owner, Quantity)] of all that a fit of this scene could move, in the list's order."""
    bodies = [body for body in settings.bodies if body.role == "BODY"]
    found = [(body.name, quantity) for body in bodies for quantity in _of_body(body)]
    if not bodies:
        return found
    found.append(("", quantities.GRAVITY))
    if settings.solver.use_ground:
        found += [(fit_values.GROUND, quantity)
                  for quantity in (*_of_contact(settings.solver.ground), quantities.HEIGHT)]
    for body in settings.bodies:
        if body.role == "COLLIDER":
            found += [(body.name, quantity) for quantity in _of_contact(body.contact)]
    # Rows of captures that are switched off are kept: their settings stay until they are on again. One that
    # is held out as a whole tells nothing of its own start.
    found += [(capture.name, quantities.START_FRAME) for capture in settings.captures
              if capture.holdout != "CAPTURE"]
    seen = set()
    return [(owner, quantity) for owner, quantity in found
            if (owner, quantity.key) not in seen and not seen.add((owner, quantity.key))]


def quantity_of(settings, row):
    """The Quantity of a row of the list, or None where the scene does not have it any more."""
    for owner, quantity in candidates(settings):
        if (owner, quantity.key) == (row.owner, row.key):
            return quantity
    return None


@reactions.fit_list_outdated.done_by
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
            before = renamed.get((quantity is quantities.START_FRAME, owner))
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
        before = {row.owner for row in rows if (row.key == quantities.START_FRAME.key) is of_capture}
        after = {owner for owner, quantity in wanted if (quantity is quantities.START_FRAME) is of_capture}
        gone, come = before - after, after - before
        if len(gone) == len(come) == 1:
            found[of_capture, come.pop()] = gone.pop()
    return found


def branch_removed(settings, owner, index):
    """A Maxwell branch is gone: the rows of those after it go on with it, by their new numbers."""
    rows = settings.fit.parameters
    for place in reversed(range(len(rows))):
        row = rows[place]
        branch = quantities.branch_of(row.key)
        if row.owner != owner or branch is None or branch[0] < index:
            continue
        if branch[0] == index:
            rows.remove(place)
            continue
        quantity = quantities.material(f"maxwell[{branch[0] - 1}].{branch[1]}")
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
        row.use_start = fit_values.value(settings, row.owner, row.key) <= 0.0 or (
            row.key == "contact.stiffness"
            and not fit_values.contact_of(settings, row.owner).use_stiffness)
    if not quantity.is_code:  # which has no values of its own here
        _set_start(settings, row, quantity, fit_values.value(settings, row.owner, row.key))
        reset_bounds(settings, row, quantity)
        row.mean, row.mean_vector = row.start, row.start_vector
    row.enabled = observed and _on(settings, row)


def reset_start(settings, row, quantity):
    """Sets the row's start to what the scene has; where that is no start, to something near."""
    _set_start(settings, row, quantity, fit_values.played(settings, row))


def _set_start(settings, row, quantity, now):
    if now is None:
        return
    if quantity.is_vector:
        row.start_vector = now
    elif quantity.scale != LINEAR and now <= 0.0:
        row.start = _guess(settings, row)
    else:
        row.start = now


def reset_mean(settings, row, quantity):
    """Sets what a prior expects to where the search begins."""
    now = fit_values.played(settings, row)
    if quantity.is_vector:
        row.mean_vector = row.start_vector if row.use_start or now is None else now
    elif row.use_start:
        row.mean = row.start
    else:
        row.mean = now if quantity.scale == LINEAR or now > 0.0 else _guess(settings, row)


@reactions.fit_row_switched.done_by
def switched_on(row, what):
    """Fills in the values of what was switched on by hand: 'start', 'bounds' or 'prior'."""
    if _restoring:
        return
    settings = row.id_data.matterfit
    quantity = quantity_of(settings, row)
    if quantity is not None and not quantity.is_code:
        {"start": reset_start, "bounds": reset_bounds, "prior": reset_mean}[what](
            settings, row, quantity)


def reset_bounds(settings, row, quantity):
    """Sets the row's bounds to those of its kind, about what it starts from."""
    if quantity.is_vector:
        row.reach = quantity.reach
        return
    start = row.start if row.use_start else fit_values.value(settings, row.owner, row.key)
    if quantity.low == quantity.high:
        row.low, row.high = start / quantities.RANGE, start * quantities.RANGE
    elif quantity.around:
        row.low, row.high = start + quantity.low, start + quantity.high
    else:
        row.low, row.high = min(quantity.low, start), max(quantity.high, start)


def _guess(settings, row):
    """A first value of something that is 0 now, the usual start of the library."""
    body = fit_values.find_body(settings, row.owner)
    stiffness = 1e5
    if body is not None:
        material = body.material
        stiffness = material.bulk_modulus if material.law == "NEWTONIAN" else material.E
    share, value = library.QUANTITIES[row.key]["usual"]
    return share * stiffness if share else value or 0.1


def _on(settings, row):
    """Whether a new row of an observed body is looked for without being asked."""
    body = fit_values.find_body(settings, row.owner)
    if body is None or body.role != "BODY":
        return False
    if row.key in ("velocity", "spin"):
        return not body.pins
    if row.key in law_keys() and body.material.law == "NEURAL_ISOTROPIC":
        yields = body.material.yield_strain < library.NEVER_STRAIN
        return row.key in _NEURAL_FITTED or yields and row.key == "material.yield_strain"
    # What is 0 in the scene, as hardening and cohesion often are, is added on purpose only.
    return row.key in law_keys() and row.key != "material.exponent" and not row.use_start


def hold(settings, owner):
    """A body that is held somewhere has no velocity to look for."""
    for row in settings.fit.parameters:
        if row.owner == owner and row.key in ("velocity", "spin"):
            row.enabled = False
