# SPDX-License-Identifier: GPL-3.0-or-later
"""Speed of other MPM codes, and of the published neural law in PyTorch, on this machine's CPU, where
they are installed.

    bench_others.py            those that build/venv-bench-NAME holds; says which are absent
    bench_others.py --install  installs them there by pip first (Taichi 0.2 GB, PyTorch 3 GB, Genesis with another)

Each runs in a process of its own and prints one JSON object in the form of forward_bench. The
scenes are ours, in the form of Taichi's own mpm3d example and of Genesis' MPM entity.
"""

import argparse
import os
import subprocess
import sys

from parts import BUILD, ROOT, require_in_tree, run

OTHERS = {
    "taichi": ["taichi==1.7.4", "numpy<2.3"],
    "torch": ["torch==2.15.0", "numpy<2.3"],
    "genesis": ["torch==2.15.0", "genesis-world==1.4.5"],
}


def environment(name):
    return BUILD / f"venv-bench-{name}"


def install(name):
    folder = environment(name)
    if (folder / "installed").exists():
        return ""
    print(f"installing {', '.join(OTHERS[name])} into {folder.name}", file=sys.stderr)
    run(f"bench-venv-{name}", [sys.executable, "-m", "venv", folder])
    done = run(f"bench-pip-{name}", [folder / "bin" / "pip", "install", "-q", *OTHERS[name]], limit=1800)
    if done.status != 0:
        return done.tail(3)
    (folder / "installed").touch()
    return ""


def main():
    require_in_tree()
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--install", action="store_true")
    parser.add_argument("--only", nargs="*", choices=sorted(OTHERS), help="of them")
    parser.add_argument("--threads", type=int, default=min(2, os.cpu_count() or 1))
    options = parser.parse_args()
    for name in options.only or OTHERS:
        problem = install(name) if options.install else ""
        python = environment(name) / "bin" / "python"
        if not (environment(name) / "installed").exists():
            hint = problem or "make bench OTHERS=1 installs it"
            print(f"{name}: not installed, left out ({hint})", file=sys.stderr)
            continue
        script = ROOT / "scripts" / f"bench_{name}.py"
        done = subprocess.run(
            [python, script, str(options.threads)], stdout=subprocess.PIPE, text=True, check=False
        )
        # Both print banners on standard output; ours are the lines that are JSON objects.
        lines = [line for line in done.stdout.splitlines() if line.startswith('{"name"')]
        for line in lines:
            print(line, flush=True)
        if done.returncode != 0:
            print(f"{name}: ended with status {done.returncode}", file=sys.stderr)
    return 0


if __name__ == "__main__":
    sys.exit(main())
