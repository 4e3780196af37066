# SPDX-License-Identifier: GPL-3.0-or-later
"""Builds and runs the benchmarks: JSON lines on standard output, all else on standard error.

    bench.py [--others] [--neural] [arguments of forward_bench and gradient_bench, or of neural_bench …]
"""

import argparse
import subprocess
import sys

from parts import BUILD, ROOT, require_in_tree


def main():
    require_in_tree()
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--others", action="store_true", help="other codes beside it, by pip")
    parser.add_argument("--neural", action="store_true", help="neural_bench alone, and PyTorch beside it")
    options, rest = parser.parse_known_args()
    benches = ["neural_bench"] if options.neural else ["forward_bench", "gradient_bench"]
    if subprocess.run(["bash", ROOT / "scripts" / "build.sh", *benches], check=False).returncode != 0:
        return 1
    status = 0
    for bench in benches:
        run = subprocess.run([BUILD / "release" / "bin" / bench, *rest], check=False)
        status = run.returncode or status
    others = [sys.executable, ROOT / "scripts" / "bench_others.py"]
    others += ["--only", *(["torch"] if options.neural else ["taichi", "genesis"])]
    if options.others:
        others.append("--install")
    return subprocess.run(others, check=False).returncode or status


if __name__ == "__main__":
    sys.exit(main())
