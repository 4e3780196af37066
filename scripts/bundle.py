# SPDX-License-Identifier: GPL-3.0-or-later
"""Makes a shared library independent of the process that loads it.

Blender brings its own OpenVDB and oneTBB, of other versions, and its executable puts them into the
global scope, where the loader finds them before ours. So every library that ours needs is copied
under a name with the hash of its content (as auditwheel does for wheels), with $ORIGIN as the run
path, and every symbol that these copies define gets a suffix, in them and in whoever uses them:
nothing in the process can stand in for them, nor they for anything else. RTLD_DEEPBIND would not
do: Blender's jemalloc would then free what our libc allocated.
"""

import hashlib
import re
import shutil
import subprocess

from elf import ElfError, SharedLibrary
from parts import ROOT

# What every Linux that can run Blender has, and what must be one in a process: the C and C++ runtimes.
SYSTEM = re.compile(
    r"^(libc|libm|libdl|librt|libpthread|libutil|libresolv|libgcc_s|libstdc\+\+|ld-linux-x86-64)\.so"
)
# Ours to the outside: the C ABI. And what the linker gives every file for itself.
KEPT = re.compile(r"^(mf_.*|_init|_fini|_end|_edata|__bss_start)$")


class BundleError(Exception):
    """The library cannot be made independent; the message says why."""


def call(*command):
    done = subprocess.run([str(c) for c in command], capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise BundleError(f"{' '.join(map(str, command))}: {done.stderr.strip() or done.returncode}")
    return done.stdout


def loaded_with(library):
    """{soname: path} of all that the loader takes for `library`, the system's runtimes included."""
    found = {}
    for line in call("ldd", library).splitlines():
        name, arrow, rest = line.strip().partition(" => ")
        if arrow:
            found[name] = rest.split(" (")[0]
            if found[name] == "not found":
                raise BundleError(f"{library} needs {name}, which is not installed")
    return found


def new_name(soname, path):
    with open(path, "rb") as file:
        digest = hashlib.file_digest(file, "sha256").hexdigest()[:8]
    return f"{soname.partition('.so')[0]}-mf{digest}.so"


def bundle(library, folder):
    """Writes `library` and what it needs into `folder`, independent. Returns the names written."""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    loaded = loaded_with(library)
    sources = {name: path for name, path in loaded.items() if not SYSTEM.match(name)}
    new_names = {soname: new_name(soname, path) for soname, path in sources.items()}
    try:
        copies = {new_names[soname]: SharedLibrary(path) for soname, path in sources.items()}
        main = SharedLibrary(library)
        runtime = set()
        for name, path in loaded.items():
            if SYSTEM.match(name):
                runtime |= SharedLibrary(path).defined()
        names = set().union(main.defined(), *(c.defined() for c in copies.values())) - runtime
        suffix = "_mf" + hashlib.sha256(" ".join(sorted(copies)).encode()).hexdigest()[:6]
        symbols = {name: name + suffix for name in names if not KEPT.match(name)}
        for name, file in {library.name: main, **copies}.items():
            soname = name if name in copies else None
            file.rewrite(symbols=symbols, libraries=new_names, soname=soname, run_path="$ORIGIN")
            file.save(folder / name)
            (folder / name).chmod(0o755)
    except ElfError as error:
        raise BundleError(str(error)) from error
    check(folder, set(copies))
    return sorted([library.name, *copies])


def check(folder, own):
    """Every file in the bundle needs only the bundle and the system, and all symbols are found."""
    for file in sorted(folder.iterdir()):
        for name in SharedLibrary(file).needed():
            if name not in own and not SYSTEM.match(name):
                raise BundleError(f"{file.name} still needs {name}")
        for line in call("ldd", "-r", file).splitlines():
            if "undefined symbol" in line or "not found" in line:
                raise BundleError(f"{file.relative_to(ROOT)}: {line.strip()}")
