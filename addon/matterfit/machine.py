# SPDX-License-Identifier: GPL-3.0-or-later
"""What this machine has: free memory, and the matterfit program."""

import os


def free_memory():
    """Bytes that programs may still take, 0 where the system does not say."""
    try:
        with open("/proc/meminfo", encoding="ascii") as stream:
            for line in stream:
                if line.startswith("MemAvailable:"):
                    return int(line.split()[1]) * 1024
    except OSError:
        pass
    return 0


def tool():
    """The matterfit program: that of the source tree, else the one that the path finds."""
    package = os.path.dirname(os.path.realpath(__file__))
    path = os.path.join(os.path.dirname(os.path.dirname(package)), "build", "bin", "matterfit")
    return path if os.path.isfile(path) else "matterfit"
