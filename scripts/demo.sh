#!/usr/bin/env bash
# SPDX-License-Identifier: GPL-3.0-or-later
# demo.sh: the demonstration, under `blender -b`. Run through in_tree.sh, after build.sh.
set -eu
root=$MATTERFIT_ROOT
log=$root/build/logs/demo.log
mkdir -p "$root/build/logs"
echo "Matterfit demo: everything it makes goes to $root/build/demo (Blender's own words: build/logs/demo.log)"
# Our lines begin with "matterfit:"; the rest is Blender's and the renderer's.
set -o pipefail
if ! bash "$root/scripts/blender.sh" -b --factory-startup --python-exit-code 1 \
    -P "$root/scripts/demo.py" 2>&1 | tee "$log" | sed -un 's/^matterfit: //p'; then
  tail -n 30 "$log" >&2
  echo "The demo failed; the whole log: $log" >&2
  exit 1
fi
