# SPDX-License-Identifier: GPL-3.0-or-later
"""From the scene to a running job: the document, the estimate, the start."""

import contextlib
import os

import bpy

from .. import jobs, machine, native
from ..compat import translate
from ..io import cache, files, fit_results, job_boxes, job_document, plain
from ..jobs import EXIT_DONE, JobError, State
from .base import session

# `restart` of a job: what becomes of results that the folder holds (native/capi/matterfit.h).
GO_ON, AFRESH, AFRESH_WHERE_CHANGED = 0, 1, 2
OVER = 1.25  # times Most Particles: how far the count of a shape that was measured may be off
COUNTED = ("particles", "bytes")  # of an estimate, what is known without its outputs


def memory_limit(document):
    """Memory Limit of the scene [bytes]."""
    return document["scene"]["solver"]["memory_limit_gb"] * 1e9


def judge_estimate(context, document, estimate):
    """Shows an estimate of native.estimate(); JobError with the numbers where the run will not
    fit, or has more particles than the quality may ask for."""
    state = session(context)
    state.estimate = estimate_text(estimate)
    _check_most_particles(context.scene.matterfit, estimate.get("particles", 0))
    needed = estimate.get("bytes", 0)
    limit = memory_limit(document)
    free = machine.free_memory()
    state.estimate_fits = needed <= limit and (not free or needed <= free)
    if needed > limit:
        raise JobError(translate(
            "This needs about {needed} of memory, the limit is {limit}. Raise Particle Separation, "
            "or Memory Limit in Solver.").format(needed=jobs.size_text(needed),
                                                 limit=jobs.size_text(limit)))
    if free and needed > free:
        raise JobError(translate(
            "This needs about {needed} of memory, and {free} are free. Raise Particle Separation, "
            "or close other programs.").format(needed=jobs.size_text(needed),
                                               free=jobs.size_text(free)))


def _check_most_particles(settings, particles):
    """The separation is that of the shapes when they were measured, which may have grown since.
    Imported points are as many as they are, and what is typed is meant."""
    solver = settings.solver
    points = any(body.enabled and body.role == "BODY" and body.source != "OBJECT"
                 for body in settings.bodies)
    if solver.quality != "CUSTOM" and not points and particles > OVER * solver.most_particles:
        raise JobError(translate(
            "This makes {particles}, more than Most Particles in Solver: shapes have changed. Press Set from "
            "Quality there; Quality: Custom keeps the separation.").format(
                particles=plain.counted(particles, "particle")))


def estimate_text(estimate):
    """A line for each number that is known."""
    parts = []
    particles = estimate.get("particles")
    if particles:
        parts.append(plain.counted(particles, "particle"))
    memory = estimate.get("bytes")
    if memory:
        parts.append(translate("{size} of memory").format(size=jobs.size_text(memory)))
    disk = estimate.get("disk_bytes")
    if disk:
        parts.append(translate("{size} on disk").format(size=jobs.size_text(disk)))
    seconds = estimate.get("seconds")
    if seconds:
        parts.append(translate("about {time}").format(time=jobs.duration_text(max(seconds, 1.0))))
    return "\n".join(parts)


def prepare(context, take, folder, task, **options):
    """preparing() at once."""
    return jobs.drained(preparing(context, take, folder, task, **options))


def preparing(context, take, folder, task, **options):
    """(document, Replaced) of a run; `options` are those of job_document.building(), and a generator as
    that is this. The folder stays as it was where it raises or is left."""
    replaced = job_document.Replaced(folder, task)
    try:
        document = yield from job_document.building(context.scene, take, folder, task, **options)
    except BaseException:
        replaced.put_back()
        raise
    return document, replaced


def counted(document, folder, threads, run):
    """A backend that counts the particles, in a thread as that may take seconds, and goes on with
    the one that `run()` returns; it ends with the numbers where that would not fit into memory, and
    where bodies lie in each other, which is looked at where their boxes meet."""
    # Without the outputs it is soon known: what they take, and how long, is Estimate's to tell.
    simulated = {**document, "task": "simulate"}

    def count():
        return {**native.estimate(simulated, folder, threads),
                "meet": job_boxes.may_overlap(document, folder)}

    def go_on(found):
        if found.status != EXIT_DONE:
            return None
        judge_estimate(bpy.context, document,
                       {key: found.result[key] for key in COUNTED if key in found.result})
        # All bodies are filled at once for it: only now is it known that this fits into memory.
        return _apart(simulated, folder, threads, run) if found.result["meet"] else run()

    return jobs.ThenRun(jobs.ThreadRun(count, "Filling"), go_on)


def apart(document, folder, threads, run):
    """A backend that goes on with the one that `run()` returns, unless bodies lie in each other."""
    simulated = {**document, "task": "simulate"}

    def go_on(found):
        if found.status != EXIT_DONE:
            return None
        return _apart(simulated, folder, threads, run) if found.result["meet"] else run()

    return jobs.ThenRun(
        jobs.ThreadRun(lambda: {"meet": job_boxes.may_overlap(document, folder)}, "Filling"), go_on)


def _apart(document, folder, threads, run):
    """The same where their boxes meet: the library fills all of them to see."""
    return jobs.ThenRun(
        jobs.ThreadRun(lambda: native.validate(document, folder, threads), "Filling"),
        lambda checked: run() if checked.status == EXIT_DONE else None)


def start_job(context, label, prepared, folder, restart, begun=None, **options):
    """A job that counts the particles (counted()) and then runs <folder>/job.json, which is written
    in between: the file is what is run. `begun()` is called where it comes to that.

    GO_ON continues what the folder holds, which the library refuses where the inputs have changed.
    What was prepared (prepare()) is taken back where the run leaves the old results. `options` are
    a Job's.
    """
    threads = context.scene.matterfit.solver.threads
    document, replaced = prepared

    def run():
        path = job_document.write(document, folder)
        backend = native.start(path, task=document["task"], threads=threads, restart=restart)
        job.begun = True
        if begun is not None:
            begun()
        return backend

    def ended(job):
        if job.state is State.DONE:
            replaced.end()
            return
        job.untouched = replaced.untouched()
        ours = not job.untouched or replaced.is_of(document)
        if document["task"] in cache.FIT_TASKS:
            job.resumable = ours and fit_results.is_unfinished(folder)
        elif not job.begun:
            job.resumable = job.resumable and ours
        # What is reported is why the job ended.
        with contextlib.suppress(JobError):
            replaced.put_back()

    job = jobs.Job(label, lambda: counted(document, folder, threads, run), folder=folder,
                   on_end=ended, **options)
    return job


def written_document(folder):
    """The job document of a cache, or JobError."""
    path = os.path.join(folder, job_document.JOB_FILE)
    if not os.path.isfile(path):
        raise JobError(translate("{path} does not exist: this take was not baked yet. Press Bake.")
                       .format(path=path))
    return files.read_json(path)
