# SPDX-License-Identifier: GPL-3.0-or-later
"""Names of rows in lists."""

import re

_NO_FILE = re.compile(r"[/\\\x00-\x1f]")


def unique(base, others):
    """`base`, with a number behind it where one of the other rows has that name."""
    taken = {other.name for other in others}
    name, number = base, 2
    while name in taken:
        name = f"{base} {number}"
        number += 1
    return name


def for_file(name):
    """`name` as files can be called after it: without / and \\, and not of dots alone."""
    found = _NO_FILE.sub("_", name)
    return found if found.strip(".") else "_"
