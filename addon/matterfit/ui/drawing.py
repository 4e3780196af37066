# SPDX-License-Identifier: GPL-3.0-or-later
"""Text, boxes and graphs over the viewport, in pixels."""

import numpy

from .. import compat

BACKGROUND = (0.1, 0.1, 0.1, 0.7)
WHITE = (0.95, 0.95, 0.95, 1.0)
RED = (0.9, 0.35, 0.25, 1.0)
BLUE = (0.3, 0.6, 1.0, 1.0)
GREY = (0.95, 0.95, 0.95, 0.25)
HELD_OUT = (0.3, 0.6, 1.0, 0.2)
NOISE = (0.6, 0.6, 0.6, 0.4)
SOLVER = (0.85, 0.65, 0.15, 0.4)


def text(words, x, y, scale, color=WHITE):
    import blf
    compat.font_size(0, 11 * scale)
    blf.color(0, *color)
    blf.position(0, x, y, 0)
    blf.draw(0, words)


def text_width(words, scale):
    import blf
    compat.font_size(0, 11 * scale)
    return blf.dimensions(0, words)[0]


def polygons(points, color, kind="TRIS", indices=None):
    import gpu
    from gpu_extras.batch import batch_for_shader
    shader = compat.uniform_shader()
    gpu.state.blend_set("ALPHA")
    shader.bind()
    shader.uniform_float("color", color)
    batch_for_shader(shader, kind, {"pos": points}, indices=indices).draw(shader)
    gpu.state.blend_set("NONE")


def box(left, bottom, width, height, color):
    polygons(((left, bottom, 0), (left + width, bottom, 0), (left + width, bottom + height, 0),
              (left, bottom + height, 0)), color, indices=((0, 1, 2), (0, 2, 3)))


class Graph:
    """Curves in a rectangle (left, bottom, width, height), pixels before the interface's scale.

    x goes from `first` to `last`, y from `low` to `high`; with `logarithmic` its logarithm does.
    """

    def __init__(self, rectangle, scale, x_range, y_range, logarithmic=False):
        self.scale = scale
        self.left, self.bottom, self.width, self.height = (value * scale for value in rectangle)
        self.first, self.last = x_range
        self.low, self.high = y_range
        self.logarithmic = logarithmic
        box(self.left - 8 * scale, self.bottom - 24 * scale, self.width + 16 * scale,
            self.height + 48 * scale, BACKGROUND)

    def x(self, values):
        part = (numpy.asarray(values, dtype=float) - self.first) / max(self.last - self.first, 1e-9)
        return self.left + self.width * numpy.clip(part, 0.0, 1.0)

    def y(self, values):
        values, low, high = numpy.asarray(values, dtype=float), self.low, self.high
        if self.logarithmic:
            values, low, high = numpy.log(values), numpy.log(low), numpy.log(high)
        part = (values - low) / max(high - low, 1e-12)
        return self.bottom + self.height * numpy.clip(part, 0.0, 1.0)

    def curve(self, places, values, color):
        """A line through what is finite; a single point is a short dash."""
        places, values = numpy.asarray(places, dtype=float), numpy.asarray(values, dtype=float)
        seen = numpy.isfinite(values)
        if not seen.any():
            return
        x, y = self.x(places[seen]), self.y(values[seen])
        if len(x) == 1:
            x, y = numpy.array((x[0] - 2 * self.scale, x[0] + 2 * self.scale)), y.repeat(2)
        points = numpy.stack((x, y, numpy.zeros_like(x)), axis=1).astype(numpy.float32)
        polygons(points, color, kind="LINE_STRIP")

    def band(self, places, low, high, color):
        """What lies between two curves of finite values; a single place has no width."""
        if len(places) < 2:
            return
        x, below, above = self.x(places), self.y(low), self.y(high)
        points = numpy.zeros((2 * len(x), 3), dtype=numpy.float32)
        points[0::2, 0], points[0::2, 1] = x, below
        points[1::2, 0], points[1::2, 1] = x, above
        polygons(points, color, kind="TRI_STRIP")

    def floor(self, bands):
        """What noise, and above it the solver, make of an io.error_bands.Bands."""
        inside = (bands.frames >= self.first) & (bands.frames <= self.last)
        places, noise, usual = bands.frames[inside], bands.noise[inside], bands.usual[inside]
        self.band(places, noise, usual, SOLVER)
        self.band(places, numpy.zeros_like(noise), noise, NOISE)

    def upright(self, place, color):
        x = float(self.x(place))
        polygons(((x, self.bottom, 0), (x, self.bottom + self.height, 0)), color, kind="LINES")

    def shade(self, begin, end, color):
        left, right = float(self.x(begin)), float(self.x(end))
        box(left, self.bottom, right - left, self.height, color)

    def labels(self, title, top, left, right):
        """`top` above the axis of y and the title beside it, `left` and `right` below that of x."""
        above = self.bottom + self.height + 8 * self.scale
        text(top, self.left, above, self.scale)
        text(title, self.left + max(70 * self.scale, text_width(top, self.scale) + 12 * self.scale),
             above, self.scale)
        below = self.bottom - 16 * self.scale
        text(left, self.left, below, self.scale)
        text(right, self.left + self.width - text_width(right, self.scale), below, self.scale)


    def legend(self, entries):
        """(words, colour) of each curve, right of the graph, the first at the top."""
        wide = max(text_width(words, self.scale) for words, _color in entries)
        line = 16 * self.scale
        left = self.left + self.width + 20 * self.scale
        top = self.bottom + self.height
        box(left - 8 * self.scale, top - len(entries) * line - 4 * self.scale,
            wide + 16 * self.scale, len(entries) * line + 12 * self.scale, BACKGROUND)
        for place, (words, color) in enumerate(entries):
            text(words, left, top - place * line - 10 * self.scale, self.scale, color)


def frame_text(frame):
    """A frame's number; a capture's first may be a hair below 0, which is no -0."""
    return str(round(float(frame)))


def largest_of(found):
    """The largest error [mm] of an io.comparison.Comparison; 0 where no point was seen."""
    return float(numpy.nanmax(found.largest)) if found.is_seen else 0.0


def frames_compared(found):
    """(first, last) frame of an io.comparison.Comparison that has an error: a recording may be much longer
    than what was simulated."""
    seen = found.frames[numpy.isfinite(found.means)] if found.is_seen else found.frames
    return float(seen[0]), float(seen[-1])


def error_over_time(rectangle, scale, found, frame, title, held_out=None, bands=None):
    """Mean and largest error of an io.comparison.Comparison, the present frame as an upright;
    `held_out` [a, b) is shaded, and with an io.error_bands.Bands what noise and the solver make."""
    frames = found.frames
    first, last = frames_compared(found)
    largest = max(largest_of(found), 1e-9)
    graph = Graph(rectangle, scale, (first, last), (0.0, largest))
    if held_out is not None:
        graph.shade(held_out[0], held_out[1] - 1, HELD_OUT)
    if bands is not None:
        graph.floor(bands)
    graph.curve(frames, found.largest, RED)
    graph.curve(frames, found.means, WHITE)
    graph.upright(frame, BLUE)
    graph.labels(title, f"{largest:.3g} mm" if found.is_seen else "–", frame_text(first), frame_text(last))
