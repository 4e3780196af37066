#!/usr/bin/env bash
# SPDX-License-Identifier: GPL-3.0-or-later
# in_tree.sh COMMAND …: runs COMMAND with every profile, cache and temporary folder below build/,
# so that Blender (which writes thumbnails when it saves), Xvfb, pip and ccache leave the user's own
# folders alone. `python` as the command is the system's interpreter, whatever pyenv or a virtual
# environment says: the packages that we name are installed for that one.
set -eu
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
build=$root/build
export MATTERFIT_ROOT=$root
export HOME=$build/home
export XDG_CONFIG_HOME=$HOME/.config XDG_CACHE_HOME=$HOME/.cache
export XDG_DATA_HOME=$HOME/.local/share XDG_STATE_HOME=$HOME/.local/state
export XDG_RUNTIME_DIR=$build/run
export BLENDER_USER_RESOURCES=$build/blender
export PIP_CACHE_DIR=$build/pip PIP_DISABLE_PIP_VERSION_CHECK=1
export CCACHE_DIR=$build/ccache CCACHE_BASEDIR=$root CCACHE_MAXSIZE=2G
export CCACHE_SLOPPINESS=pch_defines,time_macros  # without these it keeps nothing of precompiled headers
export TMPDIR=$build/tmp
export PYTHONDONTWRITEBYTECODE=1
unset PYTHONHOME PYTHONPATH VIRTUAL_ENV BLENDER_USER_SCRIPTS BLENDER_USER_CONFIG BLENDER_USER_DATAFILES
mkdir -p "$HOME" "$XDG_CONFIG_HOME" "$XDG_CACHE_HOME" "$XDG_DATA_HOME" "$XDG_STATE_HOME" \
  "$BLENDER_USER_RESOURCES" "$PIP_CACHE_DIR" "$CCACHE_DIR" "$TMPDIR"
mkdir -p -m 700 "$XDG_RUNTIME_DIR"
if [ "$1" = python ]; then
  shift
  if [ -x /usr/bin/python3 ]; then exec /usr/bin/python3 -B "$@"; fi
  exec python3 -B "$@"
fi
exec "$@"
