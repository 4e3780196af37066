# SPDX-License-Identifier: GPL-3.0-or-later
"""Names of rows in lists."""


def unique(base, others):
    """`base`, with a number behind it where one of the other rows has that name."""
    taken = {other.name for other in others}
    name, number = base, 2
    while name in taken:
        name = f"{base} {number}"
        number += 1
    return name
