// SPDX-License-Identifier: GPL-3.0-or-later
#include "fit/search/law_state.hpp"

namespace matterfit::fit {

bool LawState::converged() const {
  const auto* end = std::get_if<Finished>(&phase);
  return end != nullptr && end->converged;
}

std::string LawState::reason() const {
  if (const auto* end = std::get_if<Finished>(&phase)) return end->reason;
  if (const auto* early = std::get_if<LeftEarly>(&phase)) return early->reason;
  return {};
}

}  // namespace matterfit::fit
