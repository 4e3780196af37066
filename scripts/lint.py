# SPDX-License-Identifier: GPL-3.0-or-later
"""Form and static checks: clang-format, ruff, clang-tidy on changed files, licence line and length, the
panel's messages in docs/errors.md, make in a folder whose path has a space.

    lint.py            check; --all: clang-tidy on the whole tree, not only on what changed
    lint.py --fix      rewrite files into form instead
"""

import argparse
import shutil
import subprocess
import sys

import messages
from parts import BUILD, ROOT, Tally, require_in_tree, run, say
from work_queue import QUEUE

RUFF = "ruff==0.12.12"
CLANG_FORMAT = "clang-format-14"
CLANG_TIDY = "clang-tidy-14"
PYTHON_FOLDERS = ["addon", "scripts", "blender_tests"]
# clang-tidy parses OpenVDB and Eigen anew for every file, 10 to 40 s each.
TIDY_AT_MOST = 8
MOST_LINES = 500


def native_sources():
    kinds = {".cpp", ".hpp", ".h"}
    return sorted(f for f in (ROOT / "native").rglob("*") if f.suffix in kinds)


def ruff():
    """The pinned ruff in its own environment below build/, or None where pip cannot fetch it."""
    folder = BUILD / "venv-ruff"
    program = folder / "bin" / "ruff"
    if not program.exists():
        run("lint-venv", [sys.executable, "-m", "venv", folder])
        run("lint-pip", [folder / "bin" / "pip", "install", "-q", RUFF], limit=300)
    return program if program.exists() else None


def changed_sources():
    """C++ files that differ from where this work began: the published main, or the last commit."""

    def git(*arguments):
        done = subprocess.run(["git", *arguments], cwd=ROOT, capture_output=True, text=True, check=False)
        return done.stdout.split() if done.returncode == 0 else []

    head = git("rev-parse", "HEAD")
    base = git("merge-base", "HEAD", "origin/main") or git("rev-parse", "HEAD~1")
    if base == head:
        base = git("rev-parse", "HEAD~1")
    names = git("diff", "--name-only", base[0]) if base else []
    return sorted(ROOT / n for n in names if n.endswith(".cpp") and (ROOT / n).exists())


def check_form(tally):
    files = native_sources()
    done = run("lint-clang-format", [CLANG_FORMAT, "--dry-run", "-Werror", *files])
    tally.check("lint: clang-format", done.status == 0, "run `make format`\n" + done.tail(10))


def sources():
    python = (f for folder in PYTHON_FOLDERS for f in (ROOT / folder).rglob("*.py"))
    return [*native_sources(), *python]


def check_lengths(tally):
    """A file has one subject; those of the add-on have a shorter limit (blender_tests/test_house.py)."""
    long = []
    for file in sources():
        with open(file, encoding="utf-8") as text:
            lines = sum(1 for _line in text)
        if lines > MOST_LINES:
            long.append(f"{file.relative_to(ROOT)} has {lines}")
    tally.check("lint: lines of a file", not long, f"more than {MOST_LINES}: " + ", ".join(long))


def check_licence(tally):
    bare = []
    for file in sources():
        with open(file, encoding="utf-8") as text:
            head = text.readline() + text.readline()
        if "SPDX-License-Identifier: GPL-3.0-or-later" not in head:
            bare.append(str(file.relative_to(ROOT)))
    tally.check("lint: licence line", not bare, "no SPDX line at the top of: " + ", ".join(bare))


def check_python(tally):
    program = ruff()
    if program is None:
        tally.skipped.append(("lint: ruff", f"pip could not install {RUFF}"))
        return
    folders = [f for f in PYTHON_FOLDERS if (ROOT / f).exists()]
    done = run("lint-ruff", [program, "check", "--no-cache", *folders])
    tally.check("lint: ruff", done.status == 0, done.tail(40))


def check_messages(tally):
    missing = [f"{file}:{line}: {messages.opening(text)}" for file, line, text in messages.unlisted()]
    if not messages.messages():
        missing.append("no message was found in addon/ at all")
    detail = "not in docs/errors.md, Panel:\n" + "\n".join(missing)
    tally.check("lint: messages in docs/errors.md", not missing, detail)


def check_makefile(tally):
    """`make clean` must remove its own build/ wherever the tree lies."""
    tree = BUILD / "tmp" / "a tree's $copy"
    shutil.rmtree(tree, ignore_errors=True)
    tree.mkdir(parents=True)
    shutil.copy(ROOT / "Makefile", tree)
    (tree / "build").mkdir()
    command = ["make", "--no-print-directory", "-C", tree, "clean"]
    done = run("lint-makefile", command)
    ok = done.status == 0 and not (tree / "build").exists() and (tree / "Makefile").exists()
    tally.check("lint: make clean in a path with a space", ok, done.tail(10))
    shutil.rmtree(tree)


def tidy_database():
    """A folder with a database of single files, without g++'s precompiled headers, and with the
    headers that the build wrote; None where it cannot be configured."""
    folder = BUILD / "lint"
    settings = ["-DMATTERFIT_TOGETHER=OFF", "-DCMAKE_DISABLE_PRECOMPILE_HEADERS=ON"]
    done = run("lint-configure", ["cmake", "-S", ROOT, "-B", folder, "-G", "Ninja", *settings])
    if done.status != 0:
        return None
    shutil.copytree(BUILD / "release" / "generated", folder / "generated", dirs_exist_ok=True)
    return folder


def check_tidy(tally, everything):
    files = native_sources() if everything else changed_sources()
    if not files:
        tally.skipped.append(("lint: clang-tidy", "no C++ file changed"))
        return
    if not (BUILD / "release" / "generated").exists():
        tally.skipped.append(("lint: clang-tidy", "needs `make build` first"))
        return
    folder = tidy_database()
    if not tally.check("lint: configure", folder is not None, "build/logs/lint-configure.log says why"):
        return
    known = (folder / "compile_commands.json").read_text(encoding="utf-8")
    files = [f for f in files if str(f) in known]
    if not everything and len(files) > TIDY_AT_MOST:
        rest = len(files) - TIDY_AT_MOST
        files = files[:TIDY_AT_MOST]
        what = f"lint: clang-tidy on {rest} more changed files"
        tally.skipped.append((what, "`make lint ALL=1` takes all"))

    def tidy(file):
        # The database is g++'s: clang does not know each of its warnings.
        command = [CLANG_TIDY, "-p", folder, "--quiet", "--warnings-as-errors=*",
                   "--extra-arg=-Wno-unknown-warning-option", file]
        return run(f"lint-tidy-{file.parent.name}-{file.stem}", command)

    for file, done in zip(files, QUEUE.map(30, tidy, files), strict=True):
        tally.check(f"lint: clang-tidy {file.relative_to(ROOT)}", done.status == 0, done.tail(30))


def lint(everything=False):
    tally = Tally()
    check_form(tally)
    check_licence(tally)
    check_lengths(tally)
    check_python(tally)
    check_messages(tally)
    check_makefile(tally)
    check_tidy(tally, everything)
    return tally


def fix():
    files = native_sources()
    if files:
        subprocess.run([CLANG_FORMAT, "-i", *files], cwd=ROOT, check=True)
    program = ruff()
    folders = [f for f in PYTHON_FOLDERS if (ROOT / f).exists()]
    if program is None:
        say(f"Python files left as they are: pip could not install {RUFF}")
        return 0
    command = [program, "check", "--fix", "--no-cache", *folders]
    return subprocess.run(command, cwd=ROOT, check=False).returncode


def main():
    require_in_tree()
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--fix", action="store_true")
    parser.add_argument("--all", action="store_true")
    options = parser.parse_args()
    if options.fix:
        return fix()
    tally = lint(options.all)
    for name, detail in tally.failed:
        say(f"FAILED {name}\n{detail}")
    for name, reason in tally.skipped:
        say(f"skipped {name}: {reason}")
    say(str(tally))
    return 1 if tally.failed else 0


if __name__ == "__main__":
    sys.exit(main())
