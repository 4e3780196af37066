# SPDX-License-Identifier: GPL-3.0-or-later
"""The scene as a job document (docs/formats.md). The file this writes is all the native code gets:
the tool on that file gives the same results as the panel."""

import contextlib
import os
import shutil

from ..jobs import EXIT_COMPUTE, JobError, drained
from . import (
    animation,
    cache,
    files,
    fit_results,
    job_bodies,
    job_captures,
    job_checks,
    job_colliders,
    job_effects,
    job_fit,
    job_images,
    job_render,
    job_writer,
    throws,
    transforms,
)
from .files import number, numbers

SCHEMA = "matterfit.job/1"
JOB_FILE = "job.json"
MANIFEST_FILE = "manifest.json"


def build(scene, take, folder, task, **options):
    """building() at once."""
    return drained(building(scene, take, folder, task, **options))


def building(scene, take, folder, task, quality=None, separation=None, outputs=True):
    """Samples the scene, writes <folder>/input/, returns the document; a generator that yields Snapshots
    while it walks through the frames.

    `separation` [m] overrides the solver's (Preview); without `outputs` nothing but the particles
    is baked; a fit and a diagnosis bake nothing. Raises JobError with what to change, and leaves no
    new file then.
    """
    writer = job_writer.JobWriter(scene, take, folder)
    if separation is not None:
        writer.separation = separation
    if not outputs or task in cache.FIT_TASKS:
        writer.bakes_meshes = False
    try:
        return (yield from _building(writer, task, quality, outputs))
    except BaseException:  # a generator that is left, too
        writer.discard()
        raise


def _building(writer, task, quality, outputs):
    take, settings = writer.take, writer.settings
    job_checks.scene(writer)
    job_checks.separation(writer.separation, settings.solver.quality == "CUSTOM")
    bodies, colliders = [], []
    for body in settings.bodies:
        if not body.enabled:
            continue
        if body.role == "BODY":
            bodies.append(job_bodies.BodyPart(writer, body, throws.of(take, body.name)))
        elif _collider_on(take, body.name):
            colliders.append(job_colliders.ColliderPart(writer, body))
    captures = [_capture_part(writer, capture)
                for capture in settings.captures if capture.enabled]
    gravity = _gravity(writer)
    effects = job_effects.parts(writer)
    yield from writer.walking()

    solver = settings.solver
    document = {"schema": SCHEMA, "task": task}
    scene_document = {
        "fps": writer.fps_document,
        "frames": [writer.first, writer.end],
        "gravity": gravity(),
        "particle_separation": number(writer.separation),
        "quality": quality or solver.quality.lower(),
        "bodies": [part.document() for part in bodies],
        "colliders": [part.document() for part in colliders],
        "solver": {"cfl": number(solver.cfl), "memory_limit_gb": number(solver.memory_limit)},
    }
    if solver.use_ground:
        scene_document["colliders"].insert(
            0, job_colliders.ground_document(solver, writer.scale))
    contacts = job_colliders.pair_documents(settings)
    if contacts:
        scene_document["contacts"] = contacts
    if solver.use_walls:
        scene_document["walls"] = job_colliders.walls_document(solver, writer.scale)
    if effects:
        scene_document["effects"] = [part.document() for part in effects]
    document["scene"] = scene_document
    if captures:
        document["captures"] = [part.document() for part in captures]
    if task in cache.FIT_TASKS:
        document["fit"] = job_fit.document(settings, scene_document,
                                           document.get("captures", []))
        diagnosis = _diagnosis(settings.diagnosis)
        if diagnosis:
            document["diagnose"] = diagnosis
        document["output"] = {"folder": "."}
    else:
        document["output"] = _output(writer, bodies, outputs)
        if task == "render":
            document["render"] = job_render.document(writer, document.get("captures", []))
        if task == "compare" and any("cameras" in capture
                                     for capture in document.get("captures", [])):
            document["output"]["overlays"] = True
    job_checks.finite(document)
    writer.finish_inputs()
    return document


def _diagnosis(settings):
    document = {}
    ignored = [row.name for row in settings.ignored]
    if ignored:
        document["ignored"] = ignored
    if settings.use_limit:
        document["runs"] = settings.limit
    return document


def _capture_part(writer, capture):
    kind = job_images.ImagePart if capture.source == "IMAGES" else job_captures.CapturePart
    return kind(writer, capture)


def write(document, folder):
    """Writes job.json; returns its path."""
    return files.write_json(os.path.join(folder, JOB_FILE), document)


class Replaced:
    """The job.json and the inputs that a run replaces, made before the new ones are written.

    A run that is refused, or stopped before its first frame, leaves the folder's results as they
    were: they still are those of the old document and of the old inputs. What tells is the
    manifest, and of a fit its result and its checkpoint too.
    """

    def __init__(self, folder, task):
        self._folder = folder
        self._path = os.path.join(folder, JOB_FILE)
        names = [MANIFEST_FILE]
        if task in cache.FIT_TASKS:
            names += [fit_results.RESULT_FILE, fit_results.CHECKPOINT_FILE]
        self._results = [os.path.join(folder, name) for name in names]
        self._stamps = self._stamp()
        self._content = None
        if any(stamp is not None for stamp in self._stamps):
            with contextlib.suppress(OSError), open(self._path, "rb") as stream:
                self._content = stream.read()
        self._forget_inputs()
        if self._content is not None:
            self._keep_inputs()

    def untouched(self):
        """Whether the results are those from before the run."""
        return self._stamp() == self._stamps

    def is_of(self, document):
        """Whether what was there is of this very document; a fit's result is a diagnosis's too."""
        tasks = cache.FIT_TASKS if document["task"] in cache.FIT_TASKS else (document["task"],)
        return any(self._content == files.json_bytes({**document, "task": task}) for task in tasks)

    def put_back(self):
        """Writes the old document and inputs again unless the run has written results."""
        if self._content is not None and self.untouched():
            files.write_bytes(self._path, self._content)
            self._put_inputs_back()
        self._forget_inputs()

    def end(self):
        """The run is done: nothing of what it replaced is wanted again."""
        self._forget_inputs()

    def _stamp(self):
        return [files.stamp(path) for path in self._results]

    def _keep_inputs(self):
        """Written files get another inode (files.write_bytes), so that a link keeps the old one."""
        for relative in job_writer.listed_inputs(self._folder):
            kept = job_writer.kept_input(self._folder, relative)
            path = os.path.join(self._folder, relative)
            try:
                os.makedirs(os.path.dirname(kept), exist_ok=True)
                try:
                    os.link(path, kept)
                except OSError:  # a file system without links
                    shutil.copy2(path, kept)
            except FileNotFoundError:
                continue
            except OSError as error:
                raise JobError(f"{kept}: could not be written: {error.strerror or error}. "
                               "Is the disk full, or the folder read-only?",
                               EXIT_COMPUTE) from error

    def _put_inputs_back(self):
        for relative in job_writer.listed_inputs(self._folder):
            with contextlib.suppress(OSError):
                os.remove(os.path.join(self._folder, relative))
        for relative in job_writer.kept_inputs(self._folder):
            with contextlib.suppress(OSError):
                os.replace(job_writer.kept_input(self._folder, relative),
                           os.path.join(self._folder, relative))

    def _forget_inputs(self):
        for relative in job_writer.kept_inputs(self._folder):
            with contextlib.suppress(OSError):
                os.remove(job_writer.kept_input(self._folder, relative))
        with contextlib.suppress(OSError):
            os.rmdir(os.path.join(self._folder, job_writer.KEPT_FOLDER))


def _collider_on(take, name):
    if take is not None:
        for switch in take.colliders:
            if switch.name == name:
                return switch.enabled
    return True


def _gravity(writer):
    """A function that gives the gravity after the walk: a value, or keyed where it is animated."""
    take, scene = writer.take, writer.scene
    if take is not None and take.use_gravity:
        return lambda: numbers(take.gravity)
    if not animation.animated(scene, "matterfit.solver.gravity"):
        return lambda: numbers(writer.settings.solver.gravity)
    values = []
    writer.at_every(lambda _frame, _depsgraph: values.append(
        numbers(scene.matterfit.solver.gravity)))
    return lambda: transforms.keyed(writer.frames, values)


def _output(writer, bodies, outputs):
    output = writer.settings.output
    document = {"folder": "."}
    if not outputs:
        document["points"] = True
        return document
    volume = [name for name in ("density", "velocity", "surface") if getattr(output, name)]
    if volume:
        document["volume"] = volume
        if output.use_voxel_size:
            document["voxel_size"] = number(output.voxel_size * writer.scale)
    if output.points:
        document["points"] = True
        attributes = [name for name, wanted in (
            ("velocity", output.velocity_attribute), ("plastic_strain", output.plastic_strain),
            ("volume_ratio", output.volume_ratio), ("stretch", output.stretch)) if wanted]
        if attributes:
            document["attributes"] = attributes
    if output.mesh:
        entries = [entry for entry in (part.mesh_output() for part in bodies) if entry]
        if entries:
            document["mesh"] = entries
    if output.splats:
        entries = [entry for entry in (part.splat_output() for part in bodies) if entry]
        if entries:
            document["splats"] = entries
    return document
