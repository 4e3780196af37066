// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <utility>
#include <vector>

#include "base/parallel.hpp"
#include "mpm/contact_law.hpp"
#include "mpm/total_load.hpp"

namespace matterfit::mpm {

/// Memories of the particles that touch a surface, ascending; the others remember nothing.
using ContactMemories = std::vector<std::pair<std::uint32_t, ContactMemory>>;

/// What the contact of a body carries from one substep to the next.
struct ContactState {
  ContactMemories memory;
  std::vector<double> wake_time;  ///< per block: nothing is in reach before [s]
  double frame_seconds = 0.0;
  double acceleration = 0.0;
};

/// Contact of one total Lagrangian body with the scene's colliders: forces on the particles of its
/// surface. Blocks that cannot reach a
/// surface sleep until they could.
template <class S>
class TotalContact final : public TotalLoad<S> {
 public:
  TotalContact(const Body& body, const Scene& scene, const TotalBody<S>& total);

  void apply(Arena& arena, TotalBody<S>& body, const TotalSubstep& substep) override;
  /// At the start of a frame: every block looks again.
  void wake(double frame_seconds, double acceleration);
  [[nodiscard]] bool any() const { return !colliders_.empty(); }
  /// Highest ω² of the body's skin on its contact springs under this pressure [Pa], [1/s²].
  [[nodiscard]] double frequency_squared(double pressure) const;
  [[nodiscard]] double max_penetration() const;
  /// What the forces have given the body since wake() [J].
  [[nodiscard]] double work() const;
  /// Its surfaces move: they may give any work.
  [[nodiscard]] bool animated() const { return animated_; }
  [[nodiscard]] ContactState record() const;
  void restore(const ContactState& state);

  void save(ByteWriter& out) const;
  void load(ByteReader& in);

 private:
  struct Surface {
    shape::ColliderPtr collider;
    ContactLaw law;
  };
  std::vector<Surface> colliders_;
  double density_;
  double response_ = 0.0;  ///< TotalGrid::contact_response()
  double frame_seconds_ = 0.0;
  double acceleration_ = 0.0;
  bool animated_ = false;                         ///< any collider
  std::vector<double> wake_time_;                 ///< per block
  std::vector<double> penetration_;               ///< per block, deepest of the frame [m]
  std::vector<double> work_;                      ///< per block, of the frame [J]
  std::vector<ContactMemory> memory_;             ///< per particle
  std::vector<std::vector<std::uint32_t>> skin_;  ///< surface particles of each block
  std::vector<std::uint32_t> all_skin_;           ///< ascending
};

extern template class TotalContact<float>;
extern template class TotalContact<double>;

}  // namespace matterfit::mpm
