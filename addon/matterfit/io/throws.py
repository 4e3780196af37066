# SPDX-License-Identifier: GPL-3.0-or-later
"""A take's throw of a body, which takes the place of what the body says itself."""


def of(take, name):
    """The throw of that body, None where the take has none."""
    return next((throw for throw in take.throws if throw.name == name), None) if take is not None else None


def thrown(body, throw):
    """Whose velocity and spin count."""
    return body if throw is None or throw.velocity_from == "BODY" else throw


def velocity_from(body, throw):
    """VALUE or ANIMATION."""
    return thrown(body, throw).velocity_from
