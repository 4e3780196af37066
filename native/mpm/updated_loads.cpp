// SPDX-License-Identifier: GPL-3.0-or-later
#include "mpm/updated_loads.hpp"

#include <algorithm>
#include <utility>

#include "mpm/updated_contact.hpp"
#include "mpm/updated_masses.hpp"
#include "mpm/updated_pins.hpp"

namespace matterfit::mpm {

template <class S>
UpdatedLoads<S>::UpdatedLoads(const Scene& scene, const std::vector<std::size_t>& bodies,
                              std::vector<UpdatedMember<S>>& members) {
  const auto add = [&](auto load) {
    if (load->any()) list_.push_back(load.get());
    loads_.push_back(std::move(load));
  };
  auto terms = std::make_unique<UpdatedTerms<S>>(scene, bodies);
  terms_ = terms.get();
  add(std::move(terms));
  add(std::make_unique<UpdatedContact<S>>(scene, members));
  add(std::make_unique<UpdatedPins<S>>(scene, members));
  add(std::make_unique<UpdatedMasses<S>>(scene, members));
}

template <class S>
bool UpdatedLoads<S>::push_by_velocity() const {
  return std::any_of(list_.begin(), list_.end(),
                     [](const UpdatedLoad<S>* load) { return load->pushes_by_velocity(); });
}

template <class S>
void UpdatedLoads<S>::begin_frame(double frame_seconds, double pull) const {
  for (UpdatedLoad<S>* load : list_) load->begin_frame(frame_seconds, pull);
}

template <class S>
void UpdatedLoads<S>::push(Arena& arena, UpdatedGrid<S>& grid, const effects::Moment& moment,
                           double kick) const {
  for (const UpdatedLoad<S>* load : list_) load->push(arena, grid, moment, kick);
}

template <class S>
void UpdatedLoads<S>::act(UpdatedGrid<S>& grid, std::size_t b, const UpdatedMoment& moment,
                          std::vector<UpdatedActsPtr>* acts) const {
  if (acts != nullptr) acts->resize(list_.size());
  for (std::size_t k = 0; k < list_.size(); ++k) {
    list_[k]->act(grid, b, moment, acts != nullptr ? &(*acts)[k] : nullptr);
  }
}

template <class S>
void UpdatedLoads<S>::act_adjoint(Arena& arena, const UpdatedBack<S>& at,
                                  const std::vector<UpdatedActsPtr>& acts,
                                  UpdatedCotangents<S>& bar,
                                  std::vector<double>& velocity_bar) const {
  for (std::size_t k = acts.size(); k-- > 0;) {
    if (acts[k]) list_[k]->act_adjoint(arena, at, *acts[k], bar, velocity_bar);
  }
}

template class UpdatedLoads<float>;
template class UpdatedLoads<double>;

}  // namespace matterfit::mpm
