# SPDX-License-Identifier: GPL-3.0-or-later
"""Builds build/matterfit-VERSION.zip: the add-on with the native library and all it needs inside.

Installs from Preferences on Blender 3.4 to 4.1 (bl_info) and as an extension from 4.2 on
(blender_manifest.toml). Equal inputs give equal bytes.
"""

import hashlib
import re
import sys
import zipfile

import bundle
from parts import BUILD, ROOT, require_in_tree, say

ADDON = ROOT / "addon" / "matterfit"
STAGE = BUILD / "package"
MOST_BYTES = 60e6  # of the archive
LEFT_OUT = {"__pycache__", ".DS_Store"}


class PackageError(Exception):
    """The package cannot be built; the message says why and what to do."""


def version():
    """The one version, from CMake's project()."""
    text = (ROOT / "CMakeLists.txt").read_text(encoding="utf-8")
    return re.search(r"project\(matterfit VERSION ([0-9.]+)", text).group(1)


def members():
    """(name in the archive, path) of all files, in order."""
    found = {}

    def take(folder, below):
        for path in folder.rglob("*"):
            parts = path.relative_to(folder).parts
            if path.is_file() and not LEFT_OUT & set(parts) and path.suffix != ".pyc":
                found["/".join(["matterfit", *below, *parts])] = path

    take(ADDON, [])
    take(ROOT / "presets", ["presets"])
    take(STAGE / "lib", ["lib"])
    found["matterfit/LICENSE"] = ROOT / "LICENSE"
    return sorted(found.items())


def check_versions_agree():
    manifest = (ADDON / "blender_manifest.toml").read_text(encoding="utf-8")
    told = re.search(r'^version = "([^"]+)"', manifest, re.M)
    if told is None or told.group(1) != version():
        raise PackageError(
            f"blender_manifest.toml has version {told and told.group(1)}, CMakeLists.txt {version()}: "
            "set both to the same"
        )


def write_zip(path):
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED, compresslevel=9) as archive:
        for name, source in members():
            info = zipfile.ZipInfo(name, date_time=(1980, 1, 1, 0, 0, 0))
            info.compress_type = zipfile.ZIP_DEFLATED
            info.external_attr = (0o100755 if ".so" in source.name else 0o100644) << 16
            archive.writestr(info, source.read_bytes())


def build_package():
    """Returns the path of the archive. Needs build/lib/libmatterfit.so (make build)."""
    library = BUILD / "lib" / "libmatterfit.so"
    if not library.exists():
        raise PackageError(f"{library.relative_to(ROOT)} is not there: run `make build` first")
    check_versions_agree()
    try:
        bundle.bundle(library, STAGE / "lib")
    except bundle.BundleError as error:
        raise PackageError(str(error)) from error
    archive = BUILD / f"matterfit-{version()}.zip"
    partial = archive.with_suffix(".zip.tmp")
    write_zip(partial)
    require_small(partial)
    partial.rename(archive)
    return archive


def require_small(path, most=MOST_BYTES):
    """PackageError, with the largest files in it, where an archive has more than `most` bytes."""
    size = path.stat().st_size
    if size <= most:
        return
    with zipfile.ZipFile(path) as content:
        largest = sorted(content.infolist(), key=lambda info: -info.compress_size)[:5]
    listed = ", ".join(f"{info.filename} {info.compress_size / 1e6:.1f} MB" for info in largest)
    raise PackageError(
        f"{path.name} has {size / 1e6:.1f} MB, and {most / 1e6:.0f} MB are the most. The largest: {listed}"
    )


def is_deterministic(archive):
    """Whether building once more gives the same bytes."""
    first = hashlib.sha256(archive.read_bytes()).hexdigest()
    return hashlib.sha256(build_package().read_bytes()).hexdigest() == first


def main():
    require_in_tree()
    try:
        archive = build_package()
    except PackageError as error:
        sys.exit(f"package: {error}")
    with zipfile.ZipFile(archive) as content:
        sizes = {i.filename: (i.file_size, i.compress_size) for i in content.infolist()}
    native = [(name, size) for name, size in sizes.items() if name.startswith("matterfit/lib/")]
    for name, (size, packed) in sorted(native, key=lambda n: -n[1][0]):
        say(f"  {size / 1e6:7.2f} MB ({packed / 1e6:5.2f} packed)  {name}")
    say(f"{archive.relative_to(ROOT)}: {archive.stat().st_size / 1e6:.1f} MB, {len(sizes)} files")
    say("Blender 3.4-4.1: Preferences > Add-ons > Install. From 4.2: Get Extensions > Install from Disk.")
    return 0


if __name__ == "__main__":
    sys.exit(main())
