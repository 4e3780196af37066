#!/usr/bin/env bash
# SPDX-License-Identifier: GPL-3.0-or-later
# blender.sh [ARGUMENT …]: Blender with the tree's add-on switched on, and a user folder of its own
# below build/. Run through in_tree.sh. MATTERFIT_BLENDER names another Blender.
set -eu
root=$MATTERFIT_ROOT
export BLENDER_USER_SCRIPTS=$root/build/scripts
mkdir -p "$BLENDER_USER_SCRIPTS/addons"
ln -sfn "$root/addon/matterfit" "$BLENDER_USER_SCRIPTS/addons/matterfit"
exec "${MATTERFIT_BLENDER:-blender}" --addons matterfit "$@"
