# SPDX-License-Identifier: GPL-3.0-or-later
"""Installs the package as a user does, in the Blender this runs in, and runs a job with it.

    blender -b --factory-startup --python-exit-code 1 -P scripts/check_package.py -- ARCHIVE
    python scripts/check_package.py ARCHIVE         where `import bpy` works

Needs a bare BLENDER_USER_RESOURCES. Ends with "package works", or with status 1 and the reason.
"""

import importlib
import json
import os
import sys
import tempfile
import traceback

import bpy

JOB = {
    "schema": "matterfit.job/1",
    "scene": {
        "fps": 24,
        "frames": [1, 4],
        "particle_separation": 0.02,
        "bodies": [
            {
                "name": "ball",
                "source": {"sphere": {"center": [0, 0, 0.2], "radius": 0.1}},
                "density": 1000,
                "material": {"law": "fixed_corotated", "E": 1e5, "nu": 0.3},
            }
        ],
        "colliders": [{"name": "ground", "shape": "ground", "height": 0}],
    },
    "output": {"folder": "out", "volume": ["density"], "points": True, "attributes": ["velocity"]},
}


def install(archive):
    """Through Blender's own operators; returns the add-on's module."""
    if bpy.app.version < (4, 2, 0):
        bpy.ops.preferences.addon_install(filepath=archive, overwrite=True)
        bpy.ops.preferences.addon_enable(module="matterfit")
        name = "matterfit"
    else:
        bpy.ops.preferences.addon_enable(module="bl_pkg")
        bpy.ops.extensions.package_install_files(
            filepath=archive, repo="user_default", enable_on_install=True
        )
        name = "bl_ext.user_default.matterfit"
    if name not in bpy.context.preferences.addons:
        raise AssertionError(f"{name} is not enabled after its installation")
    return importlib.import_module(name)


def mapped_files():
    """What this process has mapped, by path."""
    with open("/proc/self/maps", encoding="utf-8") as maps:
        return {line.split(maxsplit=5)[5].strip() for line in maps if line.count("/")}


def check_own_libraries(folder, before):
    """Loading the library may add nothing but the package's own copies and the system's runtimes."""
    own = {os.path.join(folder, name) for name in os.listdir(folder)}
    mapped = {os.path.realpath(path) for path in mapped_files() if ".so" in path}
    missing = {os.path.realpath(path) for path in own} - mapped
    if missing:
        raise AssertionError(f"not loaded from the package: {sorted(missing)}")
    for kind in ("libtbb-", "libopenvdb-"):
        if not any(os.path.basename(path).startswith(kind) for path in own):
            raise AssertionError(f"the package has no copy of its own of {kind[:-1]}")
    added = mapped - {os.path.realpath(p) for p in before} - {os.path.realpath(p) for p in own}
    foreign = ("openvdb", "libtbb.so", "osd", "OpenEXR", "Imath")
    for path in added:
        if any(word in os.path.basename(path) for word in foreign):
            raise AssertionError(f"loading the library brought in {path}")
    return len(own)


def run_job(native, folder):
    path = os.path.join(folder, "job.json")
    with open(path, "w", encoding="utf-8") as file:
        json.dump(JOB, file)
    run = native.start(path, task="bake", threads=2)
    outcome = run.outcome()
    run.free()
    if outcome.status != 0:
        raise AssertionError(f"the job ended with {outcome.status}: {outcome.error}")
    volumes = [name for _, _, names in os.walk(os.path.join(folder, "out")) for name in names]
    volumes = [name for name in volumes if name.endswith(".vdb")]
    if len(volumes) != 3:
        raise AssertionError(f"expected 3 VDB files, found {volumes}")


def main():
    start = sys.argv.index("--") + 1 if "--" in sys.argv else 1
    archive = os.path.abspath(sys.argv[start])
    before = mapped_files()
    module = install(archive)
    package = os.path.dirname(os.path.realpath(module.__file__))
    user = os.path.realpath(os.environ["BLENDER_USER_RESOURCES"])
    if not package.startswith(user + os.sep):
        raise AssertionError(f"{package} is not below the user folder {user}")
    native = importlib.import_module(module.__name__ + ".native")
    if not native.load():
        raise AssertionError(native.load_error())
    count = check_own_libraries(os.path.join(package, "lib"), before)
    presets = os.listdir(os.path.join(package, "presets", "materials"))
    with tempfile.TemporaryDirectory() as folder:
        run_job(native, folder)
    print(
        f"Blender {bpy.app.version_string}: {module.__name__} {native.version()}, "
        f"{count} libraries of its own, {len(presets)} presets: package works",
        flush=True,
    )


try:
    main()
except BaseException:
    traceback.print_exc()
    sys.stderr.flush()
    # sys.exit() would leave Blender with status 0.
    os._exit(1)
os._exit(0)
