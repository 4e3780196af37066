# SPDX-License-Identifier: GPL-3.0-or-later
"""The job of a take that shows the model which a diagnosis has extended, as it lies in the fit's cache."""

import os

from ..compat import translate
from ..jobs import JobError
from . import diagnosis, files, job_document, job_writer, material_values


def document(fit_folder, folder):
    """The document, whose inputs are copied from the fit's cache into `folder`, so that another fit
    changes nothing of the take. JobError where nothing was extended."""
    path = os.path.join(fit_folder, diagnosis.EXTENDED_FILE)
    if not os.path.isfile(path):
        raise JobError(translate("The diagnosis has accepted no cause, so there is no extended model to "
                                 "preview."))
    scene = files.read_json(path).get("scene")
    if not isinstance(scene, dict):
        raise JobError(translate("{path}: holds no scene. Diagnose again.").format(path=path))
    for body in scene.get("bodies", ()):
        material_values.resolve(body.get("material", {}), fit_folder)
    _copy_inputs(fit_folder, folder)
    return {"schema": job_document.SCHEMA, "task": "bake", "scene": scene,
            "output": {"folder": ".", "points": True}}


def _copy_inputs(source, folder):
    for relative in job_writer.listed_inputs(source):
        path = os.path.join(source, relative)
        if not os.path.isfile(path):
            raise JobError(translate("{path} does not exist: it is an input of the fit. Diagnose again.").format(
                path=path))
        files.copy(path, os.path.join(folder, relative))
