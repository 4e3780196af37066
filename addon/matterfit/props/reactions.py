# SPDX-License-Identifier: GPL-3.0-or-later
"""What follows from a changed property where that is not for the properties themselves to do: they
are read by io, and so cannot import it. The part of io that does it takes the reaction's place:

    @reactions.take_switched.done_by
    def show_take(settings): …
"""

import contextlib


class Reaction:
    """Called like a function; one function of io does what it stands for."""

    def __init__(self):
        self._function = None

    def done_by(self, function):
        if self._function is not None:
            raise RuntimeError(f"done by {self._function.__qualname__} already")
        self._function = function
        return function

    def __call__(self, *arguments):
        return self._function(*arguments)


fit_list_outdated = Reaction()  # (settings): what a fit can move is not what its list shows
fit_row_switched = Reaction()  # (row, what): 'start', 'bounds' or 'prior' of a row was switched on
preset_items = Reaction()  # (): items of the enumeration of material presets
preset_chosen = Reaction()  # (material)
splats_changed = Reaction()  # (body): file, axes, scale or crop of a body made from splats
flow_changed = Reaction()  # (scene): whether anything pours may be otherwise now
quality_chosen = Reaction()  # (solver, scene)
separation_typed = Reaction()  # (solver)
capture_renamed = Reaction()  # (capture)
capture_moved = Reaction()  # (capture): its location or rotation is another one
surface_restyled = Reaction()  # (settings): smoothing or offset of surfaces
grains_restyled = Reaction()  # (settings): how many grains a particle of sand is shown as
take_switched = Reaction()  # (settings): another take is the active one
pictures_switched = Reaction()  # (settings): the same, for what is shown of takes in the views of cameras
comparison_switched = Reaction()  # (settings): another take or capture is the active one
batch_result_chosen = Reaction()  # (settings): a row of a batch's results is the active one

_rewriting = []


@contextlib.contextmanager
def paths_rewritten():
    """Paths are written in another way inside, and name the same files: nothing follows from it."""
    _rewriting.append(True)
    try:
        yield
    finally:
        _rewriting.pop()


def rewriting():
    return bool(_rewriting)
