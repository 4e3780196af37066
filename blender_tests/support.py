# SPDX-License-Identifier: GPL-3.0-or-later
"""What the Blender tests share: a fresh scene in a folder of its own, objects, a second process."""

import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import unittest

import bpy
import matterfit
from matterfit import native

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
SCRATCH = os.path.join(ROOT, "build", "tmp")
CLI = os.path.join(ROOT, "addon", "matterfit", "cli.py")


def register_once():
    """The add-on stays registered for the whole run; test_register takes it off and on."""
    if not hasattr(bpy.types.Scene, "matterfit"):
        matterfit.register()


def needs_library(function):
    """Skips by name where the native library was not built; MATTERFIT_REQUIRE_LIBRARY forbids it."""
    if native.load() or os.environ.get("MATTERFIT_REQUIRE_LIBRARY"):
        return function
    return unittest.skip(f"the native library is not there: {native.load_error()}")(function)


class SceneCase(unittest.TestCase):
    """A saved, empty .blend in a folder that is removed afterwards."""

    def setUp(self):
        register_once()
        os.makedirs(SCRATCH, exist_ok=True)
        self.folder = tempfile.mkdtemp(prefix="blend_", dir=SCRATCH)
        self.addCleanup(shutil.rmtree, self.folder, True)
        bpy.ops.wm.read_factory_settings(use_empty=True)
        self.save("scene.blend")
        self.scene = bpy.context.scene
        self.scene.frame_start, self.scene.frame_end = 1, 6
        self.settings = self.scene.matterfit

    def tearDown(self):
        matterfit.jobs.registry.stop_all()

    def save(self, name):
        bpy.ops.wm.save_as_mainfile(filepath=os.path.join(self.folder, name), check_existing=False)

    def reopen(self, name="scene.blend"):
        bpy.ops.wm.open_mainfile(filepath=os.path.join(self.folder, name))
        self.scene = bpy.context.scene
        self.settings = self.scene.matterfit

    def cube(self, name="Cube", size=0.2, location=(0.0, 0.0, 0.5)):
        bpy.ops.mesh.primitive_cube_add(size=size, location=location)
        item = bpy.context.active_object
        item.name = name
        return item

    def body(self, item, role="BODY"):
        select(item)
        bpy.ops.matterfit.add_body(role=role)
        return self.settings.bodies[len(self.settings.bodies) - 1]

    def jelly(self, separation=0.02, **arguments):
        """A cube of the preset Jelly that is cheap to simulate."""
        item = self.cube(**arguments)
        body = self.body(item)
        self.settings.solver.particle_separation = separation
        return body

    def document(self, task="bake", **arguments):
        """The job document of the active take, as a dictionary, and its folder."""
        from matterfit.io import job_document, takes
        take = takes.ensure_active(self.settings)
        folder = takes.claim(take)
        return job_document.build(self.scene, take, folder, task, **arguments), folder

    def fails(self, operator, words, **arguments):
        """The operator must fail; its message must hold all `words`."""
        with self.assertRaises(RuntimeError) as caught:
            operator(**arguments)
        message = self.error()
        for word in words:
            self.assertIn(word, message)
        self.assertIn(message.split("\n")[0], str(caught.exception))
        return message

    def greyed(self, operator, reason):
        """The operator's button is greyed, and its tip says why."""
        self.assertFalse(operator.poll())
        with self.assertRaisesRegex(RuntimeError, reason):
            operator()

    def error(self):
        return bpy.context.window_manager.matterfit.last_error


def read(*path):
    """The bytes of a file."""
    with open(os.path.join(*path), "rb") as stream:
        return stream.read()


def tree(folder):
    """{relative path: bytes} of everything below a folder."""
    return {os.path.relpath(os.path.join(base, name), folder): read(base, name)
            for base, _folders, names in os.walk(folder) for name in names}


def select(*items):
    for other in bpy.context.view_layer.objects:
        other.select_set(False)
    for item in items:
        item.select_set(True)
    bpy.context.view_layer.objects.active = items[0]


def second_process(code, blend=None, addon=False, environment=None, timeout=60):
    """Runs Python in another Blender (or another Python with bpy) and returns its last line as JSON.

    Without `addon` nothing of ours is importable there.
    """
    head = ["import bpy, json, sys"]
    if addon:
        head.append(f"sys.path.insert(0, {os.path.join(ROOT, 'addon')!r})")
    if blend:
        head.append(f"bpy.ops.wm.open_mainfile(filepath={blend!r})")
    handle, script = tempfile.mkstemp(suffix=".py", dir=SCRATCH)
    with open(handle, "w", encoding="utf-8") as stream:
        stream.write("\n".join([*head, code]))
    try:
        done = subprocess.run([*program(), script], capture_output=True, text=True,
                              timeout=timeout, env={**os.environ, **(environment or {})},
                              check=False)
    finally:
        os.remove(script)
    if done.returncode != 0:
        raise AssertionError(f"second process: status {done.returncode}\n{done.stdout}\n"
                             f"{done.stderr}")
    lines = [line for line in done.stdout.splitlines() if line.startswith("{")]
    return json.loads(lines[-1])


def program():
    """How a script is run by the same Blender: the binary, or Python where bpy is a module."""
    if bpy.app.binary_path:
        return [bpy.app.binary_path, "-b", "--factory-startup", "--python-exit-code", "1", "-P"]
    return [sys.executable]


def _cli(arguments, blend=None):
    """cli.py as a user calls it."""
    if not bpy.app.binary_path:
        return [sys.executable, CLI, "--", *arguments]
    return [bpy.app.binary_path, "-b", "--factory-startup", *([blend] if blend else []),
            "--python-exit-code", "1", "-P", CLI, "--", *arguments]


def run_cli(*arguments, blend=None, timeout=60):
    """Runs cli.py. Returns the finished process."""
    return subprocess.run(_cli(arguments, blend), capture_output=True, text=True, timeout=timeout,
                          check=False)


def kill_cli(*arguments, when, blend=None, timeout=120, number=signal.SIGKILL):
    """Starts cli.py and kills it, with no chance to clean up or by another signal, as soon as
    `when()` is true. Returns its exit status."""
    process = subprocess.Popen(_cli([*arguments, "--quiet"], blend), stdout=subprocess.DEVNULL,
                               stderr=subprocess.DEVNULL)
    try:
        end = time.monotonic() + timeout
        while not when():
            if process.poll() is not None:
                raise AssertionError(f"{arguments[0]} ended before it could be killed")
            if time.monotonic() > end:
                raise AssertionError(f"{arguments[0]}: not so far in {timeout} s")
            time.sleep(0.01)
        process.send_signal(number)
        return process.wait(timeout)
    finally:
        process.kill()
        process.wait()


def printed_json(done):
    """The document among what a finished `run_cli` with --json printed; it must have succeeded."""
    if done.returncode != 0:
        raise AssertionError(f"status {done.returncode}\n{done.stderr}")
    return json.loads(done.stdout[done.stdout.index("{"):done.stdout.rindex("}") + 1])
