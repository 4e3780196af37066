// SPDX-License-Identifier: GPL-3.0-or-later
#include "capture/particle_volumes.hpp"

#include <cmath>
#include <cstdlib>

#include "capture/fill_lattice.hpp"

namespace matterfit::capture {
namespace {

using openvdb::Coord;
using openvdb::FloatTree;

constexpr float kKeep = 0.3F;       // part inside from which a cell gets a particle
constexpr float kCrumb = 0.05F;     // … if none of its neighbours has one
constexpr double kLeastLeft = 0.5;  // of a whole cell, where it makes up for one farther out

/// Shares out the volume of cut cells.
class Sharing {
 public:
  Sharing(const FloatTree& parts, FloatTree& volumes) : part_(parts), volume_(volumes) {}

  /// Keeps a cell of which little is inside where no neighbour gets a particle.
  void keep_crumb(const CutCell& cut) {
    if (cut.fraction < kCrumb || cut.fraction >= kKeep) return;
    for (int n = 0; n < 27; ++n) {
      if (part_.getValue(neighbour(cut.cell, n)) >= kKeep) return;
    }
    crumb_.setValue(cut.cell, true);
  }

  void clear(const CutCell& cut) {
    if (has_particle(cut.cell)) {
      volume_.setValueOn(cut.cell, 0.0F);
    } else {
      volume_.setValueOff(cut.cell, 0.0F);
    }
  }

  /// To the eight cells about the centroid, by their distances.
  void share(const CutCell& cut) {
    const std::vector<Coord> heirs = heirs_of(cut.cell);
    for (int n = 0; n < 8; ++n) {
      Coord other = cut.cell;
      double share = cut.fraction;
      for (int axis = 0; axis < 3; ++axis) {
        const double away = cut.centroid[axis];
        const bool next = (n >> axis & 1) != 0;
        share *= next ? std::abs(away) : 1.0 - std::abs(away);
        if (next) other[axis] += away < 0.0 ? -1 : 1;
      }
      if (n > 0 && has_particle(other)) {
        give(other, share);
        continue;
      }
      for (const Coord& heir : heirs) inherit(cut.cell, heir, share / double(heirs.size()));
    }
  }

 private:
  static Coord neighbour(const Coord& cell, int n) {
    return cell.offsetBy(n / 9 - 1, n / 3 % 3 - 1, n % 3 - 1);
  }
  [[nodiscard]] bool has_particle(const Coord& cell) {
    return part_.getValue(cell) >= kKeep || crumb_.getValue(cell);
  }

  /// The cell itself if it has a particle, else its neighbours that have one: over a face, else an
  /// edge, else a corner.
  std::vector<Coord> heirs_of(const Coord& cell) {
    std::vector<Coord> heirs;
    for (int distance = 0; distance <= 3 && heirs.empty(); ++distance) {
      for (int n = 0; n < 27; ++n) {
        const Coord other = neighbour(cell, n);
        const Coord step = other - cell;
        if (std::abs(step.x()) + std::abs(step.y()) + std::abs(step.z()) != distance) continue;
        if (has_particle(other)) heirs.push_back(other);
      }
    }
    return heirs;
  }

  void give(const Coord& cell, double volume) {
    volume_.setValueOn(cell, volume_.getValue(cell) + static_cast<float>(volume));
  }

  /// A volume that lies a cell farther out than its heir counts twice there and is taken once from
  /// the cell behind, so that the first moment is right.
  void inherit(const Coord& cell, const Coord& heir, double volume) {
    const Coord behind = heir + (heir - cell);
    const bool moves = heir != cell && part_.getValue(behind) == 1.0F &&
                       double(volume_.getValue(behind)) - volume > kLeastLeft;
    give(heir, moves ? 2.0 * volume : volume);
    if (moves) give(behind, -volume);
  }

  openvdb::tree::ValueAccessor<const FloatTree> part_;
  openvdb::tree::ValueAccessor<FloatTree> volume_;
  openvdb::BoolTree crumbs_{false};
  openvdb::tree::ValueAccessor<openvdb::BoolTree> crumb_{crumbs_};
};

}  // namespace

std::unique_ptr<FloatTree> particle_volumes(const FloatTree& parts,
                                            const std::vector<CutCell>& cuts,
                                            const FillOptions& options) {
  auto volumes = std::make_unique<FloatTree>(parts);
  Sharing sharing(parts, *volumes);
  for (const CutCell& cut : cuts) {
    look_at_cancel(options);
    sharing.keep_crumb(cut);
  }
  for (const CutCell& cut : cuts) sharing.clear(cut);
  for (const CutCell& cut : cuts) {
    look_at_cancel(options);
    sharing.share(cut);
  }
  return volumes;
}

}  // namespace matterfit::capture
