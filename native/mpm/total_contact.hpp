// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <utility>
#include <vector>

#include "base/parallel.hpp"
#include "mpm/contact_law.hpp"
#include "mpm/total_body.hpp"

namespace matterfit::mpm {

/// Contact of one total Lagrangian body with the scene's colliders. Blocks that cannot reach a
/// surface sleep until they could.
template <class S>
class TotalContact {
 public:
  TotalContact(const Body& body, const Scene& scene, const TotalBody<S>& total);

  /// Contact forces on the body's surface particles, at `time`, as the body's loads.
  void apply(Arena& arena, TotalBody<S>& body, double time, double dt);
  /// At the start of a frame: every block looks again.
  void wake(double frame_seconds, double acceleration);
  [[nodiscard]] bool any() const { return !colliders_.empty(); }
  /// Highest ω² of the body's skin on its contact springs [1/s²].
  [[nodiscard]] double frequency_squared() const { return frequency_squared_; }
  [[nodiscard]] double max_penetration() const;
  /// What particles remember of the surfaces that they touch; the others remember nothing.
  [[nodiscard]] std::vector<std::pair<std::uint32_t, ContactMemory>> record() const;

  void save(ByteWriter& out) const;
  void load(ByteReader& in);

 private:
  struct Surface {
    ColliderPtr collider;
    ContactLaw law;
  };
  std::vector<Surface> colliders_;
  double density_;
  double frequency_squared_ = 0.0;
  double frame_seconds_ = 0.0;
  double acceleration_ = 0.0;
  bool animated_ = false;                         ///< any collider
  std::vector<double> wake_time_;                 ///< per block
  std::vector<double> penetration_;               ///< per block, deepest of the frame [m]
  std::vector<ContactMemory> memory_;             ///< per particle
  std::vector<std::vector<std::uint32_t>> skin_;  ///< surface particles of each block
};

extern template class TotalContact<float>;
extern template class TotalContact<double>;

}  // namespace matterfit::mpm
