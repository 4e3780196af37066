# SPDX-License-Identifier: GPL-3.0-or-later
"""Prints what the documents of docs/examples come to, one JSON object a line, so that a change which is
to leave the results as they are can be held against the tool from before it.

    example_hashes.py                        the result hash of `simulate` of every example
    example_hashes.py --fits                 and the fitted values of those of task "fit", to the last bit
    example_hashes.py --against OTHER_TOOL   both by another build of the tool too; fails where they differ

A hash depends on the compiler and on the SIMD target (--target, the same for both), so none is committed.
"""

import argparse
import json
import pathlib
import shutil
import subprocess
import sys

from parts import BUILD, ROOT, require_in_tree

EXAMPLES = ROOT / "docs" / "examples"


def json_of(command):
    """The tool's result; leaves with its message where it failed."""
    done = subprocess.run([str(c) for c in command], capture_output=True, text=True, check=False)
    if done.returncode != 0:
        sys.exit(f"{' '.join(map(str, command))}: exit status {done.returncode}\n{done.stderr}")
    return json.loads(done.stdout)


def outcome(tool, document, verb, folder, options):
    """What `verb` makes of a document: the hash of its results, and the values of a fit."""
    shutil.rmtree(folder, ignore_errors=True)
    result = json_of([tool, verb, document, "--set", f"output.folder={json.dumps(str(folder))}", "--json",
                      "--quiet", "--threads", options.threads, "--target", options.target])
    found = {"name": document.stem, "task": verb,
             "hash": json_of([tool, "inspect", folder, "--json"])["result_hash"]}
    if verb == "fit":
        found["values"] = {one["path"]: one["value"].hex() if isinstance(one["value"], float) else one["value"]
                           for one in result["fit"]["parameters"]}
        found["evaluations"] = result["fit"]["evaluations"]
    shutil.rmtree(folder)
    return found


def main():
    require_in_tree()
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--tool", type=pathlib.Path, default=BUILD / "bin" / "matterfit")
    parser.add_argument("--against", type=pathlib.Path, help="another build of the tool")
    parser.add_argument("--fits", action="store_true", help="fit as well: some minutes more")
    parser.add_argument("--only", nargs="+", help="names of examples")
    parser.add_argument("--threads", default="0")
    parser.add_argument("--target", default="auto")
    options = parser.parse_args()
    different = []
    for document in sorted(EXAMPLES.glob("*.json")):
        if options.only and document.stem not in options.only:
            continue
        task = json.loads(document.read_text(encoding="utf-8"))["task"]
        for verb in ["simulate", "fit"] if options.fits and task == "fit" else ["simulate"]:
            folder = BUILD / "example_hashes" / document.stem
            found = outcome(options.tool, document, verb, folder, options)
            if options.against:
                found["same"] = found == outcome(options.against, document, verb, folder, options)
                if not found["same"]:
                    different.append(f"{document.stem} ({verb})")
            print(json.dumps(found), flush=True)
    if different:
        sys.exit("other results: " + ", ".join(different))
    return 0


if __name__ == "__main__":
    sys.exit(main())
