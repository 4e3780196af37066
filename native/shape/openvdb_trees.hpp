// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once
#include <openvdb/openvdb.h>

/// Trees and grids whose virtual functions are in libopenvdb. Without this each file that makes a
/// grid compiles all of them again, half of its time.
extern template class openvdb::tree::Tree<openvdb::FloatTree::RootNodeType>;
extern template class openvdb::tree::Tree<openvdb::Vec3STree::RootNodeType>;
extern template class openvdb::tree::Tree<openvdb::BoolTree::RootNodeType>;
extern template class openvdb::tree::Tree<openvdb::MaskTree::RootNodeType>;
extern template class openvdb::Grid<openvdb::FloatTree>;
extern template class openvdb::Grid<openvdb::Vec3STree>;
