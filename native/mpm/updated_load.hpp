// SPDX-License-Identifier: GPL-3.0-or-later
// What acts on the bodies of an UpdatedGroup: one interface, one list, which the adjoint goes back
// over.
#pragma once

#include <memory>
#include <vector>

#include "base/parallel.hpp"
#include "effects/term.hpp"
#include "mpm/updated_grid.hpp"
#include "mpm/updated_record.hpp"

namespace matterfit::mpm {

template <class S>
struct UpdatedCotangents;
template <class S>
class UpdatedBack;

/// Where a substep begins and loads meet the particles.
struct UpdatedMoment {
  double time = 0.0;
  double dt = 0.0;         ///< of the substep before [s]
  double max_speed = 0.0;  ///< of any particle in it [m/s]
};

/// A load has the functions of each place where it acts, and their adjoints:
/// - push(): before a substep, for as long as gravity acts in it, on all particles;
/// - act(): as soon as a block has its particles after a substep, on those that it chooses, of
///   which it keeps what its adjoint needs.
/// A load that has nothing to act on is not in the list.
template <class S>
class UpdatedLoad {
 public:
  UpdatedLoad() = default;
  virtual ~UpdatedLoad() = default;
  UpdatedLoad(const UpdatedLoad&) = delete;
  UpdatedLoad& operator=(const UpdatedLoad&) = delete;

  /// At the start of a frame of so many seconds; `pull`: the largest acceleration by gravity and
  /// terms [m/s²].
  virtual void begin_frame(double /*frame_seconds*/, double /*pull*/) {}

  /// Adds impulses, forces times `kick` [s], to the blocks' halos.
  virtual void push(Arena& /*arena*/, UpdatedGrid<S>& /*grid*/, const effects::Moment& /*moment*/,
                    double /*kick*/) const {}
  /// push_adjoint() needs the particles' velocities in the record.
  [[nodiscard]] virtual bool pushes_by_velocity() const { return false; }
  /// `nodes`: cotangents of momentum and mass from which the substep of `record` started, per block
  /// of record.before [4][64].
  virtual void push_adjoint(Arena& /*arena*/, const UpdatedRecord<S>& /*record*/,
                            const std::vector<S>& /*nodes*/, UpdatedCotangents<S>& /*bar*/) const {}

  /// Adds momentum and mass to the halo of block `b`. `acts`, if not null, gets what was done.
  /// Called for several blocks at once.
  virtual void act(UpdatedGrid<S>& /*grid*/, std::size_t /*b*/, const UpdatedMoment& /*moment*/,
                   UpdatedActsPtr* /*acts*/) const {}
  /// Goes back over the acts of all blocks. Adds to `bar`, and to the cotangents of the substep's
  /// node velocities, per block of record.before [3][64], made where they are empty.
  virtual void act_adjoint(Arena& /*arena*/, const UpdatedBack<S>& /*at*/,
                           const UpdatedActs& /*acts*/, UpdatedCotangents<S>& /*bar*/,
                           std::vector<double>& /*velocity_bar*/) const {}
};

}  // namespace matterfit::mpm
