# SPDX-License-Identifier: GPL-3.0-or-later
"""What of an error noise and the solver make, frame by frame, as the diagnosis of the fit has found it."""

from dataclasses import dataclass

import numpy

from . import diagnosis, fit_results, takes

SIGNIFICANT = 2.0  # of Bands.usual: what noise alone makes of less than 1 in 100 points


@dataclass
class Bands:
    """Of one capture, in mm: frames (F,) scene frames, ascending; before, after (NaN where nothing was
    named), noise, usual (noise and solver together), held_out (F,) booleans."""

    frames: numpy.ndarray
    before: numpy.ndarray
    after: numpy.ndarray
    noise: numpy.ndarray
    usual: numpy.ndarray
    held_out: numpy.ndarray

    @property
    def has_after(self):
        return bool(numpy.isfinite(self.after).any())

    def usual_at(self, frames):
        """The usual size at scene frames, those of the nearest frame that is known."""
        return numpy.interp(frames, self.frames, self.usual)

    def held_out_spans(self):
        """[(first, last)] of frames in a row that are held out."""
        spans = []
        for frame, held in zip(self.frames, self.held_out, strict=True):
            if held and spans and spans[-1][2]:
                spans[-1][1] = frame
            elif held:
                spans.append([frame, frame, True])
            if not held and spans:
                spans[-1][2] = False
        return [(first, last) for first, last, _open in spans]


def of_report(report, capture=""):
    """The Bands of a capture by its name, "": the first that has any; None where there are none."""
    rows = [row for row in report.frames if row.capture == capture]
    if not rows and not capture and report.frames:
        rows = [row for row in report.frames if row.capture == report.frames[0].capture]
    if not rows:
        return None
    rows.sort(key=lambda row: row.frame)

    def column(values):
        return 1e3 * numpy.array(list(values), dtype=float)

    noise = column(row.noise for row in rows)
    return Bands(numpy.array([row.frame for row in rows], dtype=float), column(row.before for row in rows),
                 column(numpy.nan if row.after is None else row.after for row in rows), noise,
                 numpy.hypot(noise, column(row.numerical for row in rows)),
                 numpy.array([row.held_out for row in rows]))


def of_fit(settings, capture=""):
    """The same of the diagnosis of the scene's fit, where it is of the fit as it is now."""
    run = settings.fit.run
    if not run.folder:
        return None
    folder = takes.locate(run).folder
    report = diagnosis.load_quietly(folder)
    if report is None or not diagnosis.is_of_fit(report, fit_results.load_quietly(folder)):
        return None
    return of_report(report, capture)
