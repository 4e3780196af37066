# SPDX-License-Identifier: GPL-3.0-or-later
"""Times and sizes as people read them."""


def duration_text(seconds):
    """< 1 s, 3 s, 2 min 5 s, 1 h 4 min."""
    if seconds is None:
        return ""
    seconds = int(round(max(seconds, 0.0)))
    if seconds == 0:
        return "< 1 s"
    if seconds < 60:
        return f"{seconds} s"
    if seconds < 3600:
        return f"{seconds // 60} min {seconds % 60} s"
    return f"{seconds // 3600} h {seconds % 3600 // 60} min"


def size_text(size):
    """Bytes as 512 B, 3.2 kB, 1.5 MB, 2.0 GB (powers of 1000, as Memory Limit has them)."""
    if size < 1000:
        return f"{int(size)} B"
    for unit in ("kB", "MB", "GB"):
        size /= 1000.0
        if size < 1000.0 or unit == "GB":
            return f"{size:.1f} {unit}"
    raise AssertionError("unreachable")
