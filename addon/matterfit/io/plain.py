# SPDX-License-Identifier: GPL-3.0-or-later
"""Sentences of the library with coordinates, counts of cells and names of the document, said as an
artist needs them. The tool prints them as they are."""

import re

from ..compat import translate, translate_label
from . import number_text

_NUMBER = r"[\d.]+(?:e[+-]?\d+)?"


def length_text(metres):
    """Two digits of a length in metres: 3 mm, 92 cm, 1.5 m."""
    units = (("m", 1.0), ("cm", 0.01), ("mm", 0.001))
    unit, size = next((pair for pair in units if metres >= pair[1]), units[-1])
    return f"{float(f'{metres / size:.2g}'):g} {unit}"


def _deep(match):
    return translate("{body} starts up to {depth} inside {other}.").format(
        body=match["body"], depth=length_text(float(match["depth"])), other=match["other"])


def _far(match):
    return translate(
        "Parts of the mesh of '{name}' lie up to {distance} outside the shape that is simulated, and "
        "may not follow it well. Apply the modifiers if it does not.").format(
            name=match["name"], distance=length_text(float(match["distance"])))


def _few_layers(match):
    return translate("The thinnest side holds only {layers} of particles: lower Particle Separation."
                     ).format(layers=counted(int(match["n"]), "layer"))


def _holes(match):
    if match["n"] == "1":
        return translate("The mesh had a hole, which was closed straight across.")
    return translate("The mesh had {n} holes, which were closed straight across.").format(n=match["n"])


def _too_many(match):
    return translate("A Particle Separation of {now} makes too many particles. Use at least {least}."
                     ).format(now=length_text(float(match["now"])),
                              least=length_text(float(match["least"])))


def _nothing(match):
    return translate(
        "A Particle Separation of {now} is too large for this shape. Use a smaller one, or check that "
        "the shape is closed and its size is right.").format(now=length_text(float(match["now"])))


def _too_thin(match):
    return translate(
        "A Particle Separation of {now} is too large for the wires and walls of this shape: particles would "
        "hold {share} % of it. Use a smaller one, raise Most Particles, or make them thicker.").format(
            now=length_text(float(match["now"])), share=match["share"])


def _sank(match):
    where = translate("the ground") if match["other"] == "ground" else f"'{match['other']}'"
    panel = (translate_label("Solver"), translate_label("Ground"))
    if match["other"] != "ground":
        panel = (translate_label("Bodies"), match["other"])
    field = " > ".join((*panel, translate_label("Stiffness")))
    now = ""
    if match["now"]:
        now = translate(" (now {stiffness} Pa/m)").format(
            stiffness=f"{float(match['now']):.1e}".replace("e+0", "e").replace("e+", "e"))
    return translate("{body} sank {depth} into {other}. Raise {field}{now} if it should not.").format(
        body=match["body"], depth=match["depth"], other=where, field=field, now=now)


def _starting_guess(match):
    return _PASCALS.sub(lambda found: number_text.with_prefix(float(found["value"]), found["unit"]),
                        match[0])


def _outside(match):
    return translate("{n} of {total} samples lie outside the simulated frames, and are not compared."
                     ).format(n=match["n"], total=match["total"])


def _far_off(match):
    return translate(
        "points lie up to {distance} off {body} at rest. Are the capture's Unit, Location, Rotation and "
        "Start Frame right?").format(distance=length_text(float(match["distance"])), body=match["body"])


def _too_many_substeps(match):
    return translate(
        "Frame {n} would need too many steps in time ({why}). Soften the material or what it touches, slow it "
        "down, or use a larger Particle Separation.").format(n=match["n"], why=match["why"])


def _nothing_left(match):
    return translate(
        "Every sample is held out, not seen, before the end of Quiet Start, or outside the frame range; "
        "nothing is left to fit to ({covered}). Hold out less, or look at Quiet Start, Start Frame, the frame "
        "range and the file's times, which are in seconds.").format(covered=match["covered"])


def _damaged(match):
    return translate("{path} is damaged: it is no whole JSON file.").format(path=match["path"])


def _resumed(match):
    return translate("Went on after frame {n}.").format(n=match["n"])


def _lost(match):
    if match["inside_out"]:
        return translate("a part of it is turned inside out")
    if match["fast"]:
        return translate("a part of it moves too fast")
    return translate("a part of it is torn away")


_SMALLER = "Use a smaller Particle Separation, or gentler motion."
_SMALLER_OR_FLOWS = ("Use a smaller Particle Separation, gentler motion, or the Formulation Updated "
                     "Lagrangian if the body flows or tears.")


def counted(count, noun):
    """How many of "layer", "cell", "frame", "file" or "particle": 1 frame, 2 frames."""
    one, many = {"layer": ("{n} layer", "{n} layers"), "cell": ("{n} cell", "{n} cells"),
                 "frame": ("{n} frame", "{n} frames"), "file": ("{n} file", "{n} files"),
                 "particle": ("{n} particle", "{n} particles")}[noun]
    return translate(one if count == 1 else many).format(n=f"{count:,}".replace(",", " "))


def _fixed(text):
    return lambda _match: translate(text)


_PASCALS = re.compile(rf"(?<= )(?P<value>-?{_NUMBER}) (?P<unit>Pa\b)")

# Each pattern with what is said in its place.
_SENTENCES = [(re.compile(pattern), said) for pattern, said in (
    (rf"(?<= frame )(?P<n>\d+) \({_NUMBER} s\)(?=: )", lambda match: match["n"]),
    (r"\bparticle \d+(?: at \([^)\n]*\) m)? (?:(?P<inside_out>is turned inside out(?: \(volume ratio "
     r"[^)\n]*\))?)|(?P<fast>moves more than a cell in one substep, at [-+.\w]+ m/s)|is not a number)", _lost),
    (r"\bparticle \d+ at \([^)\n]*\) m (?=is more than a cell beyond the walls)", _fixed("a part of it ")),
    # The panel has no margin of the time step.
    (r"Use a smaller scene\.solver\.dt_safety or particle separation, or gentler motion\.", _fixed(_SMALLER)),
    (r"The deformation is larger than this grid can follow: use a smaller particle separation, a smaller "
     r"scene\.solver\.dt_safety, gentler motion, or formulation 'updated' if the body flows or tears\.|"
     r"Use a smaller scene\.solver\.dt_safety, a smaller particle separation, or formulation 'updated'\.",
     _fixed(_SMALLER_OR_FLOWS)),
    (r",? or a (?:smaller|lower) (?:scene\.)?solver\.dt_safety| \((?:scene\.)?solver\.dt_safety\)",
     lambda _match: ""),
    (r"\bmf_job_options\.threads\b", lambda _match: translate_label("Threads")),
    (rf"(?P<body>Body '[^'\n]+') starts up to (?P<depth>{_NUMBER}) m inside (?P<other>'[^'\n]+'|\w+), "
     r"at \([^)\n]*\) m\.", _deep),
    (r"(?<= lie in each other), about \([^)\n]*\) m(?=\.)", lambda _match: ""),
    (rf"(?:'[^'\n]+', )?[\w.\"\[\] ]*: \d+ or more points lie farther than two particle separations "
     rf"\(up to (?P<distance>{_NUMBER}) m\) from '(?P<name>[^'\n]+)'; do they belong together\?", _far),
    (r"The surface crosses or doubles itself near \d+ cells?; the winding number decided there\.",
     _fixed("The surface crosses itself in places.")),
    (rf"Only (?P<n>\d+) layers? across the thinnest side \({_NUMBER} m\); a separation of {_NUMBER} m "
     r"gives 12\.", _few_layers),
    (r"The mesh is not closed: \d+ boundary edges? around (?P<n>\d+) holes?, filled as if each were "
     r"covered straight across\.", _holes),
    (r"\d+ edges? with more than two faces\.",
     _fixed("In places more than two faces share an edge.")),
    (r"\d+ of \d+ shells? faced inward and was turned\.",
     _fixed("Faces looked inward and were turned outward.")),
    (r"\d+ triangles faced the other way than their neighbours and were turned\.",
     _fixed("Some faces looked the other way than their neighbours and were turned.")),
    (r" ?Limit surface of the cage at level \d+\.", lambda _match: ""),
    (r"\d+ corners that coincide were joined\.", _fixed("Vertices at the same place were joined.")),
    (rf"Filling at a particle_separation of (?P<now>{_NUMBER}) m makes [^\n]*? particles, more than the "
     rf"limit of \d+\. Use a separation of at least (?P<least>{_NUMBER}) m\.", _too_many),
    (rf"Nothing to fill at a particle_separation of (?P<now>{_NUMBER}) m: .*?Use a smaller separation, "
     r"or check that the shape is closed and its unit\.", _nothing),
    (rf"At a particle_separation of (?P<now>{_NUMBER}) m particles hold only (?P<share>\d+) % of the shape: "
     r"the rest is wires and walls that are far thinner\. Use a smaller separation, or make them thicker\.",
     _too_thin),
    (r"(?P<body>'[^'\n]+') sank (?P<depth>[^\n]+?) into '(?P<other>[^'\n]+)'\. Raise [^\n]+?\.contact\."
     rf"stiffness(?: \(now (?P<now>{_NUMBER}) Pa/m\))? if it should not\.", _sank),
    (r"Starting guess estimated from the recording: [^\n]+", _starting_guess),
    (r"(?m)^captures\.(?P<name>[^\n:\"'\[]+)(?=: )", lambda match: f"'{match['name']}'"),
    (r"(?P<n>\d+) of (?P<total>\d+) samples lie outside the simulated time; they are NaN in "
     r"simulated\.npz", _outside),
    (rf"points lie up to (?P<distance>{_NUMBER}) m off (?P<body>'[^'\n]+') at rest; are unit, transform "
     r"and start_frame right\?", _far_off),
    # Their number may be beyond all counting, and the panel has no time step.
    (r"Frame (?P<n>\d+) would need (?:more than )?-?\d+ substeps \((?P<why>[^)\n]*)\)\. Soften the material, "
     r"use a larger particle separation, or override scene\.solver\.dt\.", _too_many_substeps),
    (r"no point is visible in any frame\.",
     _fixed("no point is seen in any frame: every place is missing. Export the recording again, or choose "
            "another file.")),
    # After a fit of the start frame that is so at the recording's own rate too.
    (r"samples lie between frames and are interpolated; simulate at the capture's rate to avoid it",
     _fixed("samples lie between frames and are interpolated: Start Frame lies between two, or the "
            "recording's rate is not the scene's Frame Rate.")),
    (r"captures: every sample is held out, not seen, or outside the scene's frames; nothing is left to fit "
     r"to \((?P<covered>[^\n]+)\)\. Shorten a 'holdout', [^\n]*?in seconds\.", _nothing_left),
    (r"captures: every image is held out or outside of the scene's frames; nothing is left to fit to\. "
     r"Shorten a 'holdout', or look at start_frame, fps and scene\.frames\.",
     _fixed("Every image is held out, or lies outside the frame range; nothing is left to fit to. Hold out "
            "less, or look at Start Frame, Rate and the frame range.")),
    (r"(?P<path>[^\n]+\.json): not valid JSON[^\n]*", _damaged),
    (r"no usable checkpoint: simulated from the first frame",
     _fixed("No checkpoint was found: simulated from the first frame.")),
    (r"resumed after frame (?P<n>\d+)", _resumed),
)]


def said(text):
    """`text` with these sentences in their place."""
    for pattern, words in _SENTENCES:
        text = pattern.sub(words, text)
    return re.sub(r"(?<![\w.\"/])particle_separation\b", lambda _match: translate_label("Particle Separation"),
                  text)


def without_fraction(text):
    """Whole numbers without .0: 100000.0 as 100000."""
    return re.sub(r"(?<![\d.])(-?\d+)\.0(?![\d.])", r"\1", text)
