#!/usr/bin/env bash
# SPDX-License-Identifier: GPL-3.0-or-later
# dependencies.sh build|fits|demo|package|test: sees that the packages for a task are there and that the
# disk has room. On Debian 12 it installs what is missing: as root by apt, else by `sudo -n`, else it
# prints the exact command and ends with status 2. Elsewhere it prints the list, status 2.
# With nothing missing apt is never called. MATTERFIT_DEPENDENCIES=skip goes on without looking.
set -eu
task=${1:-build}
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)

build_packages="
  cmake g++ make ninja-build ccache pkg-config
  libopenvdb-dev libboost-dev libboost-iostreams-dev libblosc-dev zlib1g-dev libtbb-dev
  libosd-dev libopenexr-dev libimath-dev libpng-dev libjpeg62-turbo-dev
  libeigen3-dev libhwy-dev libxxhash-dev libzip-dev libnanoflann-dev
  nlohmann-json3-dev libcli11-dev libfmt-dev
  libgtest-dev libgmock-dev"
demo_packages="blender python3-numpy"
package_packages="patchelf python3"
test_packages="
  python3-openvdb python3-venv xvfb xauth libgl1-mesa-dri slurm-wlm chromium
  clang-14 libclang-rt-14-dev clang-format-14 clang-tidy-14"

# Gigabytes on the disk of this tree: compiled files, and with `test` the three bpy environments.
case $task in
  build)   packages="$build_packages"; room=3 ;;
  fits)    packages="$build_packages python3-numpy"; room=4 ;;
  package) packages="$build_packages $package_packages"; room=3 ;;
  demo)    packages="$build_packages $demo_packages"; room=4 ;;
  test)    packages="$build_packages $demo_packages $package_packages $test_packages"; room=9 ;;
  *) echo "dependencies.sh: '$task' is none of build, fits, demo, package, test" >&2; exit 2 ;;
esac
packages=$(echo $packages)

if [ "${MATTERFIT_DEPENDENCIES:-}" = skip ]; then exit 0; fi

# What an earlier run left below build/ counts: it is not needed a second time.
used=0
if [ -d "$root/build" ]; then
  used=$(du -s --block-size=1M "$root/build" 2>/dev/null | cut -f1)
fi
free=$(df -P --block-size=1M "$root" | awk 'NR == 2 { print $4 }')
if [ $((free + used)) -lt $((room * 1024)) ] || [ "$free" -lt 512 ]; then
  echo "Not enough disk for \`make $task\`: $free MB are free at $root, about $room GB are needed in all." >&2
  echo "Make room (\`make clean\` removes $used MB), or move the tree to a larger disk." >&2
  exit 2
fi

if ! command -v dpkg-query >/dev/null; then
  echo "This is not Debian. \`make $task\` needs what these Debian 12 packages hold:" >&2
  printf '  %s\n' $packages >&2
  echo "Install them by your system's names, then run: MATTERFIT_DEPENDENCIES=skip make $task" >&2
  exit 2
fi

installed=" $(dpkg-query -W -f='${Package}=${db:Status-Status} ' 2>/dev/null) "
missing=""
for package in $packages; do
  case $installed in
    *" $package=installed "*) ;;
    *) missing="$missing $package" ;;
  esac
done
if [ -z "$missing" ]; then exit 0; fi

system=$(. /etc/os-release 2>/dev/null; echo "${ID:-unknown} ${VERSION_ID:-}")
if [ "$system" != "debian 12" ]; then
  echo "This is $system; packages are installed by this script on Debian 12 only." >&2
  echo "Missing for \`make $task\` (Debian 12's names):$missing" >&2
  echo "Install them, then run: MATTERFIT_DEPENDENCIES=skip make $task" >&2
  exit 2
fi

flags="-y --no-install-recommends"
echo "Installing for \`make $task\`:$missing"
if [ "$(id -u)" = 0 ]; then
  as_root=""
elif command -v sudo >/dev/null && sudo -n true 2>/dev/null; then
  as_root="sudo -n"
else
  echo "This needs root. Run, then try again:" >&2
  echo "  sudo apt-get update && sudo apt-get install $flags$missing" >&2
  exit 2
fi
# 2 GB is what blender and the -dev packages unpack to on a bare system.
system_free=$(df -P --block-size=1M /usr | awk 'NR == 2 { print $4 }')
if [ "$system_free" -lt 2560 ]; then
  echo "Not enough disk for packages: $system_free MB are free at /usr, about 2.5 GB are needed." >&2
  exit 2
fi
$as_root env DEBIAN_FRONTEND=noninteractive apt-get -q update
$as_root env DEBIAN_FRONTEND=noninteractive apt-get -q install $flags $missing
