# SPDX-License-Identifier: GPL-3.0-or-later
"""Writes addon/matterfit/library.json: what the library says of its numbers and its laws, a row a
line. To be run after `make build` where a row of these tables changed; until then a Blender test
fails."""

import ctypes
import json

from parts import BUILD, ROOT

TARGET = ROOT / "addon" / "matterfit" / "library.json"


def tables():
    """What mf_quantities gives."""
    library = ctypes.CDLL(str(BUILD / "lib" / "libmatterfit.so"))
    library.mf_text_free.argtypes = [ctypes.c_void_p]
    text = ctypes.c_void_p()
    if library.mf_quantities(ctypes.byref(text)) != 0:
        raise SystemExit("mf_quantities failed")
    try:
        return json.loads(ctypes.string_at(text))
    finally:
        library.mf_text_free(text)


def text_of(found):
    """The tables as the file has them."""
    parts = []
    for name, value in found.items():
        text = json.dumps(value)
        if isinstance(value, list):
            text = "[\n" + ",\n".join("    " + json.dumps(row, ensure_ascii=False) for row in value) + "\n  ]"
        parts.append(f"  {json.dumps(name)}: {text}")
    return "{\n" + ",\n".join(parts) + "\n}\n"


if __name__ == "__main__":
    TARGET.write_text(text_of(tables()), encoding="utf-8")
