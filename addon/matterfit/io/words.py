# SPDX-License-Identifier: GPL-3.0-or-later
"""Messages of the library in the panel's words: objects and fields in place of paths of the job
document, and what changed as a sentence."""

import re

from .. import quantities
from ..compat import translate, translate_label
from . import job_fit, plain

# bodies[0].material.E, scene.colliders.ground.contact.mu, captures."my clip", scene.gravity[2]
_STEP = r"""(?:\.[A-Za-z_]\w*|\[\d+\])"""
_OWNED = re.compile(
    r"""(?<![\w/."'])(?:scene\.)?(?P<list>bodies|colliders|captures)"""
    r"""(?:\[(?P<index>\d+)\]|\.(?P<name>[\w-]+)|\.(?P<quote>["'])(?P<quoted>.+?)(?P=quote))"""
    rf"""(?P<key>{_STEP}*)""")
_SCENE = re.compile(rf"""(?<![\w/."'])scene(?P<key>{_STEP}+)""")
# Paths and values in the name of a batch's member: gravity[2] = -3, particle_separation = 0.02: …
_VARIED = re.compile(r"(?:(?<=, )|^)(?P<key>[a-z]\w*(?:\[[012]\])?)(?= = )", re.MULTILINE)
_CHANGE = re.compile(r"^(?P<what>.+): (?P<now>[^:]+), was (?P<before>.+)$")
_CHANGES = re.compile(
    r"^.* holds (?P<what>the results|a fit|an unfinished fit) of other inputs\. What changed:\n",
    re.MULTILINE)

_GROUND_FIRST = re.compile(r"(^|[.?] )'ground'", re.MULTILINE)

# What the panel calls parts of the document that are no quantity; the longest key that fits counts.
_FIELDS = {
    "gravity": "Gravity", "particle_separation": "Particle Separation", "quality": "Quality",
    "frames": "Frame Range", "fps": "Frame Rate", "walls": "Container", "solver.cfl": "CFL",
    "solver.memory_limit_gb": "Memory Limit", "source": "Shape", "mesh": "Shape", "meshes": "Shape",
    "material.law": "Law", "material": "Material", "material.maxwell": "Relaxation",
    "formulation": "Formulation", "pins": "Pins", "masses": "Masses", "seed": "Seed",
    "placement": "Position", "contact.kind": "Contact", "contact": "Contact",
    "transform": "Motion", "shape": "Shape", "tracks": "File", "noise": "Noise", "unit": "Unit",
    "up": "Up Axis", "fps_of_file": "Rate", "holdout": "Hold-out", "release": "Quiet Start",
    "align": "Align To", "markers": "Markers", "body": "Body", "solver": "Solver",
    "plate": "Clean Plate", "images": "Image Folder", "colours": "Colours",
    "refine": "Refine Cameras", "poses": "Camera Poses",
}


_FILL = re.compile(r"(?P<count>\d+) particles [^;]*?; the surface cuts \d+ cells; volume [^,]*, "
                   r"particles hold (?P<share>[\d.]+) % of it\.")
_MATCHED = 0.5  # per cent by which particles may miss the volume


def fill(text):
    """What the library says of a fill, in short; what is unusual stays."""
    return _FILL.sub(_short_fill, text)


def _short_fill(match):
    count, share = match.group("count"), float(match.group("share"))
    if abs(share - 100.0) <= _MATCHED:
        return translate("{particles}; volume matched.").format(
            particles=plain.counted(int(count), "particle"))
    return translate("{particles}, which hold {share} % of the volume.").format(
        particles=plain.counted(int(count), "particle"), share=f"{share:.1f}")


def short_label(label):
    """A label without its unit, in the user's language."""
    return translate_label(label).split(" [")[0]


def _title(key):
    """The title of a quantity, in the user's language; "" where it is not known."""
    camera = quantities.camera_of(key)
    if camera is not None:
        number, row = camera
        return translate_label(row.title).format(n=number)
    row = quantities.find(key)
    return "" if row is None else translate_label(row.title)


def split(settings, path):
    """job_fit.split_path() of a path in a result of this scene's."""
    document = {"bodies": [{"name": body.name} for body in settings.bodies
                           if body.role == "BODY"]}
    return job_fit.split_path(path, document)


def owner_and_label(settings, path):
    """(owner, label without the unit) of a path in a result of a fit: ('Cube', 'Velocity Z')."""
    owner, key, axis = split(settings, path)
    of_camera = quantities.camera_of(key) is not None
    text = _title(key) if of_camera else short_label(quantities.label_of(key))
    row = quantities.find(key)
    if axis is None or row is not None and row.is_code:
        return owner, text
    return owner, f"{text} {'XYZ'[axis]}"


def folded(settings, estimates):
    """[(owner, label, estimates)] as a result shows them: the numbers of a code are one row."""
    found = []
    for estimate in estimates:
        owner, label = owner_and_label(settings, estimate.path)
        row = quantities.find(split(settings, estimate.path)[1])
        if row is not None and row.is_code and found and found[-1][:2] == (owner, label):
            found[-1][2].append(estimate)
        else:
            found.append((owner, label, [estimate]))
    return found


def is_about_code(statement):
    """Whether a sentence of a result names numbers of codes alone: which of these are alike says
    nothing to people."""
    rows = []
    for match in _OWNED.finditer(statement):
        rows.append(quantities.find(re.sub(r"\[\d+\]$", "", match.group("key").lstrip("."))))
    return bool(rows) and all(row is not None and row.is_code for row in rows)


def named(settings, path):
    """The same in one text, with the owner where the scene has several: Velocity Z, or Cube: Velocity
    Z."""
    owner, label = owner_and_label(settings, path)
    if not owner or [body.name for body in settings.bodies if body.role == "BODY"] == [owner]:
        return label
    return f"{translate_label('Ground') if owner == 'ground' else owner}: {label}"


# Steps of a job: the library's name, and what an artist would call it.
_STEPS = {"Differentiating": "Trying each value",
          "Measuring the solver's own error": "Trying other grids"}
_COUNT = re.compile(r"Wedge, (?P<n>\d+) of (?P<total>\d+) done")


def stage(text):
    """What a running job does now, in the panel's words."""
    parts = [translate(_STEPS.get(part, part)) for part in text.split(": ")]
    return ": ".join(_COUNT.sub(lambda match: translate("{n} of {total} done").format(
        **match.groupdict()), part) for part in parts)


def in_panel(text, settings):
    """`text` without paths of the document; `settings` are those of the scene that it is about."""
    text = plain.said(text)
    text = _OWNED.sub(lambda match: _owned(match, settings), text)
    text = _SCENE.sub(lambda match: _field(match.group("key"), match.group(0)), text)
    text = _VARIED.sub(lambda match: _field(match.group("key"), match.group(0)), text)
    text = _GROUND_FIRST.sub(lambda match: match[1] + _capital(translate("the ground")), text)
    text = text.replace("'ground'", translate("the ground"))
    # A message that begins with a path may name the owner once more.
    text = re.sub(r"('[^'\n]+') \1", r"\1", text)
    changed = _changed(text)
    return _without_only_body(changed, settings) if changed != text else text


def _capital(text):
    return text[:1].upper() + text[1:]


def of_result(text, settings):
    """in_panel() of what a result says of its values: the only body of a scene goes without saying."""
    return _without_only_body(in_panel(text, settings), settings)


def _without_only_body(text, settings):
    bodies = [body.name for body in settings.bodies if body.role == "BODY"]
    return text.replace(f"'{bodies[0]}', ", "") if len(bodies) == 1 else text


def _names(settings, kind):
    """Names in the document's order."""
    if kind == "captures":
        return [capture.name for capture in settings.captures if capture.enabled]
    role = "BODY" if kind == "bodies" else "COLLIDER"
    names = [body.name for body in settings.bodies if body.enabled and body.role == role]
    return ["ground", *names] if kind == "colliders" and settings.solver.use_ground else names


def _owned(match, settings):
    name = match.group("name") or match.group("quoted")
    if match.group("index") is not None:
        names, index = _names(settings, match.group("list")), int(match.group("index"))
        if index >= len(names):
            return match.group(0)
        name = names[index]
    owner = translate_label("Ground") if name == "ground" else f"'{name}'"
    if not match.group("key"):
        return owner
    return f"{owner}, {_field(match.group('key'), match.group('key').lstrip('.'))}"


def _field(key, otherwise):
    """The label of what stands at the end of a path; `otherwise` where it is not known."""
    key = key.lstrip(".")
    axis = re.match(r"^(.*)\[(\d+)\]$", key)
    title = _title(key)
    if title:
        return title
    whole = None if axis is None else quantities.find(axis.group(1))
    if whole is not None and int(axis.group(2)) < whole.size:
        title, index = _title(axis.group(1)), int(axis.group(2))
        return f"{title} {index + 1 if whole.is_code else 'XYZ'[index]}"
    parts = re.sub(r"\[\d+\]", "", key).split(".")
    for end in range(len(parts), 0, -1):
        label = _FIELDS.get(".".join(parts[:end]))
        if label is not None:
            return translate_label(label)
    return otherwise


def _changed(text):
    """The list of what changed as a sentence, where the text is one."""
    found = _CHANGES.search(text)
    if found is None:
        return text
    changes, rest = [], []
    for line in text[found.end():].split("\n"):
        (changes if line.startswith("  ") else rest).append(line.strip())
    said = dict.fromkeys(_change(line) for line in changes)
    words = (translate("The scene changed since this bake: {changes}.")
             if found.group("what") == "the results" else
             translate("The scene changed since this fit: {changes}."))
    return "\n".join([words.format(changes="; ".join(said)), *rest])


def _change(line):
    line = re.sub("^version:", "Matterfit:", line)
    match = _CHANGE.match(line)
    if match is not None and match.group("now") != "gone" and match.group(
            "before") != "not there":
        return translate("{what} was {before}, now {now}").format(
            what=match.group("what"), before=plain.without_fraction(match.group("before")),
            now=plain.without_fraction(match.group("now")))
    what, _colon, how = line.partition(": ")
    if how == "its content":
        return translate("{what} is another one").format(what=what)
    if how.startswith("gone"):
        return translate("{what} is gone").format(what=what)
    if how.endswith(", was not there"):
        return translate("{what} is new").format(what=what)
    return line
