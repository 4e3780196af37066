// SPDX-License-Identifier: GPL-3.0-or-later
#include "fit/search/race.hpp"

#include <fmt/format.h>

#include <limits>
#include <utility>
#include <variant>

namespace matterfit::fit {
namespace {

/// Far more: a law that is right passes a wrong one within a few iterations of the whole clip, and
/// one that is nearly right is not so far off.
constexpr double kHopeless = 3.0;
/// Before that: what is more is more than a wrong valley.
constexpr double kLost = 15.0;
/// The factor beside a law whose search is done, which explains the clip as well as it ever will.
constexpr double kBehind = 4.0;

/// The distance [m] of a law's newest standing; 0: it has none.
double newest(const LawState& law) {
  if (law.standings.empty() || law.standings.back().empty()) return 0.0;
  return law.standings.back().back().rms;
}

bool is_done(const LawState& law) { return law.finished() && !law.left() && law.failed.empty(); }

/// How many times what another law had at the same standing is too much.
double most_beside(const LawState& other, const Standing& own) {
  if (own.firm) return kHopeless;
  if (is_done(other)) return kBehind;
  return own.early ? std::numeric_limits<double>::infinity() : kLost;
}

/// What [m] a law had at a place, or with what it left that stage before; nothing if it has not
/// come so far, or was never compared there.
std::optional<double> standing_at(const LawState& law, std::size_t stage, std::size_t count) {
  if (!law.failed.empty() || stage >= law.standings.size()) return std::nullopt;
  const std::vector<Standing>& there = law.standings[stage];
  if (there.size() >= count) return there[count - 1].rms;
  const bool passed = law.finished() || law.stage > stage;
  if (!passed || there.empty()) return std::nullopt;
  return there.back().rms;
}

}  // namespace

void add_standing(LawState& law, const Standing& standing) {
  if (law.standings.size() <= law.stage) law.standings.resize(law.stage + 1);
  law.standings[law.stage].push_back(standing);
}

std::optional<std::size_t> next_law(const std::vector<LawState>& laws) {
  std::optional<std::size_t> next;
  for (std::size_t k = 0; k < laws.size(); ++k) {
    if (laws[k].finished()) continue;
    if (!next || newest(laws[k]) < newest(laws[*next])) next = k;
  }
  return next;
}

std::vector<LeftLaw> hopeless_laws(const std::vector<LawState>& laws) {
  std::vector<LeftLaw> left;
  for (std::size_t k = 0; k < laws.size(); ++k) {
    if (laws[k].finished() || laws[k].spared || laws[k].standings.empty()) continue;
    const std::size_t stage = laws[k].standings.size() - 1;
    const std::size_t count = laws[k].standings.back().size();
    if (count == 0) continue;
    const Standing own = laws[k].standings.back().back();
    if (!own.far) continue;
    for (const LawState& other : laws) {
      const auto rms = standing_at(other, stage, count);
      if (!rms || own.rms <= most_beside(other, own) * *rms) continue;
      left.push_back({k, fmt::format("Left early: it missed the capture by {:.3g} mm where {} "
                                     "missed it by {:.3g} mm.",
                                     1e3 * own.rms, other.law, 1e3 * *rms)});
      break;
    }
  }
  return left;
}

void leave(LawState& law, std::string reason) {
  LeftEarly left{std::move(reason), InStage{}};
  if (std::holds_alternative<FarOff>(law.phase)) left.then = FarOff{};
  law.phase = std::move(left);
}

void spare(LawState& law) {
  const auto then = std::get<LeftEarly>(law.phase).then;
  std::visit([&](auto phase) { law.phase = phase; }, then);
  law.spared = true;
}

std::optional<std::size_t> leading_law(const std::vector<LawState>& laws) {
  std::optional<std::size_t> leader;
  Standing nearest;
  for (std::size_t k = 0; k < laws.size(); ++k) {
    const LawState& law = laws[k];
    if (!law.failed.empty() || law.left() || law.standings.empty() ||
        law.standings.back().empty()) {
      continue;
    }
    const Standing& newest = law.standings.back().back();
    const bool ahead = newest.firm != nearest.firm ? newest.firm : newest.rms < nearest.rms;
    if (leader && !ahead) continue;
    nearest = newest;
    leader = k;
  }
  return leader;
}

}  // namespace matterfit::fit
