# SPDX-License-Identifier: GPL-3.0-or-later
"""The Blender versions, as pinned bpy wheels, that the tests run on beside the system's Blender."""

import functools
import shutil
import subprocess
import sys
import threading

from parts import BUILD, run, say

# The last releases with cp311 wheels when this was written; they need Python 3.11.
VERSIONS = {"4.2": "bpy==4.2.23", "4.5": "bpy==4.5.15", "5.0": "bpy==5.0.1"}
GIGABYTES_EACH = 1.4

_one_at_a_time = threading.Lock()


def bpy_python(version):
    """(interpreter, "") of an environment that has this bpy, made on first use; or (None, reason)."""
    with _one_at_a_time:
        return _bpy_python(version)


@functools.cache
def _bpy_python(version):
    folder = BUILD / f"venv-bpy-{version}"
    python = folder / "bin" / "python"
    pin = VERSIONS[version]
    if _imports(python):
        return python, ""
    base = _python_311()
    if base is None:
        return None, "there is no Python 3.11 here, which its wheel needs"
    free = shutil.disk_usage(BUILD).free / 1e9
    if free < GIGABYTES_EACH:
        return None, f"{free:.1f} GB are free below build/, it needs {GIGABYTES_EACH} GB"
    say(f"  fetching {pin} into {folder.name} (about 350 MB)")
    shutil.rmtree(folder, ignore_errors=True)
    run(f"venv-{version}", [base, "-m", "venv", folder])
    install = [folder / "bin" / "pip", "install", "--no-cache-dir", "-q", pin]
    done = run(f"pip-{version}", install, limit=900)
    if done.status != 0 or not _imports(python):
        last = (done.tail(3).splitlines() or [""])[-1]
        return None, f"pip could not install {pin}: {last}"
    return python, ""


def _imports(python):
    if not python.exists():
        return False
    done = subprocess.run([python, "-c", "import bpy"], capture_output=True, check=False, timeout=120)
    return done.returncode == 0


def _python_311():
    for candidate in (sys.executable, "/usr/bin/python3.11", shutil.which("python3.11")):
        if not candidate:
            continue
        ask = [candidate, "-c", "import sys, ensurepip; print(*sys.version_info[:2])"]
        done = subprocess.run(ask, capture_output=True, text=True, check=False)
        if done.stdout.strip() == "3 11":
            return candidate
    return None
