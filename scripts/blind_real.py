# SPDX-License-Identifier: GPL-3.0-or-later
"""Cases of the blind benchmark from recordings of real bodies (tier T4)."""
CASES = []
def write(names, folder):
    return {}
