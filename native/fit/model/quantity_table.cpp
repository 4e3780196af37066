// SPDX-License-Identifier: GPL-3.0-or-later
#include <utility>

#include "fit/model/quantity.hpp"
#include "fit/model/quantity_rows.hpp"

namespace matterfit::fit {
namespace {

std::vector<Quantity> all_rows() {
  std::vector<Quantity> rows;
  for (auto* of : {material_rows, body_rows, scene_rows, collider_rows, capture_rows}) {
    for (Quantity& row : of()) rows.push_back(std::move(row));
  }
  return rows;
}

}  // namespace

const std::vector<Quantity>& quantities() {
  static const std::vector<Quantity> rows = all_rows();
  return rows;
}

}  // namespace matterfit::fit
