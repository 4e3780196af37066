// SPDX-License-Identifier: GPL-3.0-or-later
#include "mpm/total_node_term.hpp"

#include <algorithm>
#include <utility>

#include "mpm/total_masses.hpp"
#include "mpm/total_pins.hpp"
#include "mpm/total_stencil.hpp"

namespace matterfit::mpm {
namespace {

bool in_force(const TotalNodeTerm& term, double time) { return time < term.release() - 1e-12; }

}  // namespace

void NodeList::add(std::vector<std::uint32_t> nodes) {
  nodes_.insert(nodes_.end(), nodes.begin(), nodes.end());
  std::sort(nodes_.begin(), nodes_.end());
  nodes_.erase(std::unique(nodes_.begin(), nodes_.end()), nodes_.end());
  if (nodes_.empty()) return;
  places_.assign(nodes_.back() - nodes_.front() + 1, 0);
  for (std::size_t i = 0; i < nodes_.size(); ++i) {
    places_[nodes_[i] - nodes_.front()] = static_cast<std::uint32_t>(i);
  }
}

TotalNodeTerms::TotalNodeTerms(const Body& body, const TotalGrid& grid) {
  for (std::size_t i = 0; i < body.pins.size(); ++i) {
    terms_.push_back(make_total_pin(body, i, grid));
    list_.add(terms_.back()->nodes());
  }
  if (!body.masses.empty()) {
    terms_.push_back(std::make_unique<TotalMasses>(body, grid));
    list_.add(terms_.back()->nodes());
  }
  deferred_.assign(grid.mass().size(), 0);
  for (const std::uint32_t n : list_.nodes()) deferred_[n] = 1;
}

bool TotalNodeTerms::pushes() const {
  return std::any_of(terms_.begin(), terms_.end(), [](const auto& term) { return term->pushes(); });
}

bool TotalNodeTerms::held(double time) const {
  return std::any_of(terms_.begin(), terms_.end(),
                     [&](const auto& term) { return term->holds_all() && in_force(*term, time); });
}

bool TotalNodeTerms::releases_between(double from, double to) const {
  return std::any_of(terms_.begin(), terms_.end(), [&](const auto& term) {
    return term->release() - 1e-12 > from && term->release() - 1e-12 <= to;
  });
}

void TotalNodeTerms::step(const NodeMoment& moment, std::vector<Vec3d> acceleration,
                          std::vector<double>& displacement, std::vector<double>& velocity) const {
  const std::vector<std::uint32_t>& nodes = list_.nodes();
  NodeMotion motion{list_, std::move(acceleration), std::vector<Vec3d>(nodes.size()), displacement,
                    velocity};
  for (const auto& term : terms_) term->push(moment, motion);
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    motion.velocity[i] = field_value(velocity, nodes[i]) + moment.kick * motion.acceleration[i];
  }
  for (const auto& term : terms_) {
    if (in_force(*term, moment.time)) term->move(moment, motion);
  }
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    set_field_value(velocity, nodes[i], motion.velocity[i]);
    set_field_value(displacement, nodes[i],
                    field_value(displacement, nodes[i]) + moment.dt * motion.velocity[i]);
  }
}

NodeMotionBar TotalNodeTerms::step_adjoint(const NodeMoment& moment,
                                           const std::vector<Vec3d>& acceleration,
                                           std::vector<double>& displacement_bar,
                                           std::vector<double>& velocity_bar) const {
  const std::vector<std::uint32_t>& nodes = list_.nodes();
  const std::size_t count = nodes.size();
  const std::vector<Vec3d> zero(count, Vec3d::Zero());
  NodeMotionBar bar{.list = list_,
                    .acceleration = zero,
                    .velocity = std::vector<Vec3d>(count),
                    .displacement_was = std::vector<Vec3d>(count),
                    .velocity_was = zero};
  for (std::size_t i = 0; i < count; ++i) {
    bar.displacement_was[i] = field_value(displacement_bar, nodes[i]);
    bar.velocity[i] = field_value(velocity_bar, nodes[i]) + moment.dt * bar.displacement_was[i];
  }
  for (auto term = terms_.rbegin(); term != terms_.rend(); ++term) {
    if (in_force(**term, moment.time)) (*term)->move_adjoint(moment, bar);
  }
  for (std::size_t i = 0; i < count; ++i) {
    bar.velocity_was[i] += bar.velocity[i];
    bar.acceleration[i] += moment.kick * bar.velocity[i];
  }
  for (auto term = terms_.rbegin(); term != terms_.rend(); ++term) {
    (*term)->push_adjoint(moment, acceleration, bar);
  }
  for (std::size_t i = 0; i < count; ++i) {
    set_field_value(displacement_bar, nodes[i], bar.displacement_was[i]);
    set_field_value(velocity_bar, nodes[i], bar.velocity_was[i]);
  }
  return bar;
}

}  // namespace matterfit::mpm
