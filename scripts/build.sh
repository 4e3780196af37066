#!/usr/bin/env bash
# SPDX-License-Identifier: GPL-3.0-or-later
# build.sh [TARGET …]: configures and builds build/release; without targets the tool and the library,
# which it leaves at build/bin/matterfit and build/lib/libmatterfit.so. Run through in_tree.sh.
set -eu
root=$MATTERFIT_ROOT
folder=$root/build/release
targets=${*:-matterfit matterfit_tool}

# Warnings are errors with the compiler that we test with; another one may know new warnings.
werror=OFF
if [ "$(g++ -dumpversion 2>/dev/null | cut -d. -f1)" = 12 ]; then werror=ON; fi
echo "Building $targets in $folder (log: build/build.log)" >&2
if ! cmake -S "$root" -B "$folder" -G Ninja -DCMAKE_BUILD_TYPE=Release -DMATTERFIT_WERROR=$werror \
    -DMATTERFIT_TOGETHER=ON \
    > "$root/build/build.log" 2>&1; then
  tail -n 40 "$root/build/build.log" >&2
  exit 1
fi
# Ninja's own status line is the progress; it needs the terminal, so it is not sent to the log.
ninja -C "$folder" $targets >&2
mkdir -p "$root/build/bin" "$root/build/lib"
put() {  # a running Blender may have the old one mapped: never write into it
  if [ -f "$1" ] && ! cmp -s "$1" "$2"; then cp "$1" "$2.new" && mv -f "$2.new" "$2"; fi
}
put "$folder/bin/matterfit" "$root/build/bin/matterfit"
put "$folder/lib/libmatterfit.so" "$root/build/lib/libmatterfit.so"
