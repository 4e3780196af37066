# SPDX-License-Identifier: GPL-3.0-or-later
"""Builds and runs the benchmarks: JSON lines on standard output, all else on standard error.

    bench.py [--others] [arguments of forward_bench …]
"""

import argparse
import subprocess
import sys

from parts import BUILD, ROOT, require_in_tree


def main():
    require_in_tree()
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--others", action="store_true", help="Taichi and Genesis beside it, by pip")
    options, rest = parser.parse_known_args()
    build = ["bash", ROOT / "scripts" / "build.sh", "forward_bench"]
    if subprocess.run(build, check=False).returncode != 0:
        return 1
    status = subprocess.run([BUILD / "release" / "bin" / "forward_bench", *rest], check=False).returncode
    others = [sys.executable, ROOT / "scripts" / "bench_others.py"]
    if options.others:
        others.append("--install")
    return subprocess.run(others, check=False).returncode or status


if __name__ == "__main__":
    sys.exit(main())
