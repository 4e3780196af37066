# SPDX-License-Identifier: GPL-3.0-or-later
"""The native library. The only file that knows its C interface (native/capi/matterfit.h)."""

import ctypes
import json
import os
import platform
import sys

from .jobs import EXIT_COMPUTE, EXIT_DONE, JobError, Outcome, Snapshot

ABI_VERSION = 1
MF_RUNNING = 1

# The one system that packages are built for, as blender_manifest.toml names it.
PLATFORM = "linux-x64"
_FILE_NAMES = {"win32": "matterfit.dll", "darwin": "libmatterfit.dylib"}
_library = None
_load_error = ""


class _Options(ctypes.Structure):
    _fields_ = [
        ("size", ctypes.c_uint32), ("threads", ctypes.c_int32), ("target", ctypes.c_char_p),
        ("task", ctypes.c_char_p), ("restart", ctypes.c_int32),
        ("override_count", ctypes.c_uint32), ("overrides", ctypes.POINTER(ctypes.c_char_p)),
    ]


class _Progress(ctypes.Structure):
    _fields_ = [
        ("size", ctypes.c_uint32), ("status", ctypes.c_int32), ("frame", ctypes.c_int32),
        ("last_frame", ctypes.c_int32), ("fraction", ctypes.c_double),
        ("seconds", ctypes.c_double), ("seconds_left", ctypes.c_double),
        ("memory_bytes", ctypes.c_uint64), ("label", ctypes.c_char * 64),
    ]


# -- loading -----------------------------------------------------------------------------------

def candidates():
    """Where the library may be: the environment's word, the package, the source tree."""
    name = _FILE_NAMES.get(sys.platform, "libmatterfit.so")
    given = os.environ.get("MATTERFIT_LIBRARY")
    if given:
        return [given]
    package = os.path.dirname(os.path.realpath(__file__))
    tree = os.path.dirname(os.path.dirname(package))
    return [os.path.join(package, "lib", name), os.path.join(tree, "build", "lib", name)]


def load():
    """Loads the library once; True where it is there. load_error() says why not."""
    global _library, _load_error
    if _library is not None:
        return True
    paths = [path for path in candidates() if os.path.isfile(path)]
    if not paths and other_system():
        _load_error = other_system()
        return False
    if not paths:
        _load_error = ("The native library was not found at " + " or ".join(candidates())
                       + ". Install the packaged add-on, or run `make build` in the source tree.")
        return False
    try:
        # RTLD_LOCAL: Blender has its own OpenVDB and TBB, whose symbols must not mix with ours.
        library = ctypes.CDLL(paths[0], mode=getattr(os, "RTLD_LOCAL", 0)
                              | getattr(os, "RTLD_NOW", 0))
        _declare(library)
    except (OSError, AttributeError) as error:
        _load_error = (f"{paths[0]}: could not be loaded: {error}. "
                       + (other_system() or "Install the package again, or run `make build` in "
                                            "the source tree."))
        return False
    found = library.mf_abi_version()
    if found != ABI_VERSION:
        _load_error = (f"{paths[0]}: has interface version {found}, this add-on needs "
                       f"{ABI_VERSION}. Install add-on and library from one package.")
        return False
    _library, _load_error = library, ""
    return True


def other_system():
    """What to say where Matterfit does not run; "" on the system that it is built for."""
    machine = platform.machine() or "an unknown processor"
    if sys.platform == "linux" and machine.lower() in ("x86_64", "amd64"):
        return ""
    return (f"Matterfit runs on 64-bit Linux with an x86 processor ({PLATFORM}) only; this is "
            f"{platform.system() or sys.platform} on {machine}. Use it on such a machine.")


def unload():
    """Forgets the library; jobs must have ended. The file stays mapped: thread-local destructors."""
    global _library
    _library = None


def load_error():
    return _load_error


def require():
    """JobError where the library is not there."""
    if not load():
        raise JobError(_load_error)


def version():
    """"0.1.0", or "" without a library."""
    return _text(_library.mf_version()) if load() else ""


def _declare(library):
    pointer, text = ctypes.c_void_p, ctypes.c_char_p
    options, out = ctypes.POINTER(_Options), ctypes.POINTER(ctypes.c_void_p)
    signatures = {
        "mf_abi_version": (ctypes.c_uint32, []), "mf_version": (text, []), "mf_last_error": (text, []),
        "mf_job_start": (ctypes.c_int, [text, text, options, out]),
        "mf_job_poll": (ctypes.c_int, [pointer, ctypes.POINTER(_Progress)]),
        "mf_job_cancel": (ctypes.c_int, [pointer]), "mf_job_free": (None, [pointer]),
        "mf_job_wait": (ctypes.c_int, [pointer, ctypes.c_double]), "mf_job_result": (text, [pointer]),
        "mf_wedge_start": (ctypes.c_int, [text, text, options, text, ctypes.c_int32, out]),
        "mf_wedge_write": (ctypes.c_int, [text, text, options, text, text, text, out]),
        "mf_estimate": (ctypes.c_int, [text, text, options, out]),
        "mf_validate": (ctypes.c_int, [text, text, options, out]), "mf_text_free": (None, [pointer]),
        "mf_capture_summary": (ctypes.c_int, [text, text, out]),
        "mf_splats": (ctypes.c_int, [text, text, text, out]), "mf_inspect": (ctypes.c_int, [text, out]),
        "mf_curves": (ctypes.c_int, [text, text, text, out]),
    }
    for name, (result, arguments) in signatures.items():
        function = getattr(library, name)
        function.restype = result
        function.argtypes = arguments


def _text(value):
    return (value or b"").decode("utf-8", "replace")


def _error(status):
    status = int(status)
    return JobError(_text(_library.mf_last_error()),
                    status if status in (2, 3, 130) else EXIT_COMPUTE)


def _options(threads=0, task=None, restart=0, target=None, overrides=()):
    values = (ctypes.c_char_p * len(overrides))(*[item.encode() for item in overrides])
    options = _Options(ctypes.sizeof(_Options), threads, target.encode() if target else None,
                       task.encode() if task else None, int(restart), len(overrides),
                       ctypes.cast(values, ctypes.POINTER(ctypes.c_char_p)))
    return options, values  # `values` must live as long as `options`


def _json_call(function, *arguments):
    """Calls a function whose last argument takes a JSON text; returns it parsed."""
    text = ctypes.c_void_p()
    library = _library  # it may be forgotten before a call in a thread returns
    status = function(*arguments, ctypes.byref(text))
    if status != 0:
        raise _error(status)
    try:
        return json.loads(_text(ctypes.string_at(text)))
    finally:
        library.mf_text_free(text)


# -- jobs --------------------------------------------------------------------------------------

class NativeRun:
    """A running job, as jobs.Job drives it."""

    def __init__(self, handle):
        self._handle = handle

    def poll(self):
        progress = _Progress(size=ctypes.sizeof(_Progress))
        status = _library.mf_job_poll(self._handle, ctypes.byref(progress))
        if status != 0:
            raise _error(status)
        return Snapshot(finished=progress.status != MF_RUNNING, fraction=progress.fraction,
                        stage=_text(progress.label), frame=progress.frame,
                        last_frame=progress.last_frame, memory=progress.memory_bytes)

    def cancel(self):
        _library.mf_job_cancel(self._handle)

    def wait(self):
        _library.mf_job_wait(self._handle, -1.0)

    def outcome(self):
        """Call it after the job has ended."""
        status = _library.mf_job_wait(self._handle, -1.0)
        error = "" if status == EXIT_DONE else _text(_library.mf_last_error())
        text = _library.mf_job_result(self._handle)
        return Outcome(int(status), json.loads(_text(text)) if text else {}, error)

    def free(self):
        handle, self._handle = self._handle, None
        if handle is not None:
            _library.mf_job_free(handle)

    def __del__(self):
        if self._handle is not None and _library is not None:
            self.free()


def start(path, task=None, threads=0, restart=0, target=None, overrides=()):
    """Starts the job in the file `path`. Raises JobError where the document is wrong. `restart`: 0
    goes on from what the output folder holds, 1 begins afresh, 2 where the inputs have changed."""
    require()
    text = _read(path)
    options, _values = _options(threads, task, restart, target, overrides)
    handle = ctypes.c_void_p()
    status = _library.mf_job_start(text, _folder(path), ctypes.byref(options),
                                   ctypes.byref(handle))
    if status != 0:
        raise _error(status)
    return NativeRun(handle)


def wedge_start(path, axes, folder, at_once, threads=0):
    """Starts the document in the file `path` once for each combination of values of `axes`
    ("path=value,value"), in folders of their own below `folder`, `at_once` side by side. Raises
    JobError where one of them is wrong."""
    require()
    options, _values = _options(threads, overrides=axes)
    handle = ctypes.c_void_p()
    status = _library.mf_wedge_start(_read(path), _folder(path), ctypes.byref(options),
                                     folder.encode(), at_once, ctypes.byref(handle))
    if status != 0:
        raise _error(status)
    return NativeRun(handle)


def wedge_write(path, axes, folder, farm="", program="matterfit"):
    """Writes the same documents without running them: {"members": […], "files": […]}. `farm`:
    "slurm" or "flamenco" writes that farm's files too; `program` is the matterfit tool there."""
    require()
    options, _values = _options(overrides=axes)
    return _json_call(_library.mf_wedge_write, _read(path), _folder(path), ctypes.byref(options),
                      folder.encode(), farm.encode(), program.encode())


def _folder(path):
    return os.path.dirname(os.path.abspath(path)).encode()


def _read(path):
    try:
        with open(path, "rb") as stream:
            return stream.read()
    except OSError as error:
        raise JobError(f"{path}: could not be read: {error.strerror or error}.") from error


# -- questions that are answered at once ---------------------------------------------------------

def estimate(text, folder, threads=0, overrides=(), target=None):
    """{"particles", "bytes", "seconds", "fits", …} of a document (or its JSON) with files in `folder`."""
    require()
    options, _values = _options(threads, overrides=overrides, target=target)
    return _json_call(_library.mf_estimate, _json(text), folder.encode(), ctypes.byref(options))


def validate(text, folder, threads=0, overrides=(), target=None):
    """The document as it was understood; JobError with the JSON path of what is wrong."""
    require()
    options, _values = _options(threads, overrides=overrides, target=target)
    return _json_call(_library.mf_validate, _json(text), folder.encode(), ctypes.byref(options))


def _json(document):
    return document.encode() if isinstance(document, str) else json.dumps(document).encode()


def capture_summary(path, options):
    """What a capture file is like. `options`: keys of a job's capture."""
    require()
    return _json_call(_library.mf_capture_summary, path.encode(), json.dumps(options).encode())


def splats(path, npz, options):
    """Writes what a viewport shows of a file of splats as a .npz. `options`: "most", "opacity_threshold"."""
    require()
    return _json_call(_library.mf_splats, path.encode(), _json(options), npz.encode())


def inspect(folder):
    """What a cache folder holds, its result hash, and every file that is missing or damaged."""
    require()
    return _json_call(_library.mf_inspect, folder.encode())


def curves(document, folder="", **options):
    """Stress against stretch of the materials of a document, or of a material as a fit writes it: an
    entry each. `options`: "strain", "rate", "beside"."""
    require()
    return _json_call(_library.mf_curves, _json(document), folder.encode(), _json(options))
