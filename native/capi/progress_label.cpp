// SPDX-License-Identifier: GPL-3.0-or-later
#include "capi/progress_label.hpp"

namespace matterfit::capi {

std::string label_within(const Progress& progress, std::size_t most) {
  std::string label = progress.label;
  for (const std::string& shorter : progress.shorter) {
    if (label.size() <= most) break;
    label = shorter;
  }
  if (label.size() <= most) return label;
  while (most > 0 && (label[most] & 0xC0) == 0x80) --most;
  label.resize(most);
  return label;
}

}  // namespace matterfit::capi
