// SPDX-License-Identifier: GPL-3.0-or-later
#include "mpm/renewed_renewal_adjoint.hpp"

#include <Eigen/LU>
#include <cmath>
#include <utility>

#include "mpm/total_stencil.hpp"

namespace matterfit::mpm {
namespace {

template <class S>
Mat3d matrix_at(const std::vector<S>& all, std::size_t count, std::size_t slot) {
  const S* first = all.data() + slot / kLanes * (count * kLanes) + slot % kLanes;
  Mat3d m;
  for (std::size_t i = 0; i < 9; ++i) {
    m(static_cast<int>(i / 3), static_cast<int>(i % 3)) = static_cast<double>(first[i * kLanes]);
  }
  return m;
}

/// xx, yy, zz, yz, xz, xy.
template <class Get>
Mat3d symmetric_of(const Get& get) {
  Mat3d m;
  m << get(0), get(5), get(4), get(5), get(1), get(3), get(4), get(3), get(2);
  return m;
}

/// The adjoint of what `leave` does with one particle's history, H the motion that it takes and
/// `inverse` that of I + H. Returns the cotangent of H.
template <class S>
Mat3d history_adjoint(const std::vector<S>& history, const RenewedCargo& cargo,
                      const std::vector<S>& maxwell, std::size_t slot, const Mat3d& h,
                      const Mat3d& inverse, std::vector<S>& history_bar,
                      std::vector<S>& maxwell_bar) {
  const Mat3d moved = Mat3d::Identity() + h;
  const double volume = moved.determinant();
  const Mat3d cofactor = volume * inverse.transpose();
  Mat3d h_bar = Mat3d::Zero();
  const std::size_t kept = renewed_history(cargo.fluid);
  S* bar = history_bar.data() + slot / kLanes * (kept * kLanes) + slot % kLanes;
  if (cargo.fluid) {
    const double before = 1.0 + static_cast<double>(history[slot]);
    const auto after_bar = static_cast<double>(bar[0]);
    h_bar += after_bar * before * cofactor;
    bar[0] = static_cast<S>(volume * after_bar);
  } else {
    const Mat3d after_bar = matrix_at(history_bar, kept, slot);
    h_bar += after_bar * renewed_elastic(history, false, slot).transpose();
    const Mat3d before_bar = moved.transpose() * after_bar;
    for (std::size_t i = 0; i < 9; ++i) {
      bar[i * kLanes] =
          static_cast<S>(before_bar(static_cast<int>(i / 3), static_cast<int>(i % 3)));
    }
  }
  const double iso = std::pow(volume, -2.0 / 3.0);
  for (std::size_t branch = 0; branch < cargo.branches; ++branch) {
    // A' = det^(−2/3) (I+H)(I+A)(I+H)ᵀ − I.
    const S* from =
        maxwell.data() + (slot / kLanes * cargo.branches + branch) * (12 * kLanes) + slot % kLanes;
    const Mat3d whole = Mat3d::Identity() + symmetric_of([&](std::size_t i) {
                          return static_cast<double>(from[i * kLanes]);
                        });
    S* to = maxwell_bar.data() + (slot / kLanes * cargo.branches + branch) * (6 * kLanes) +
            slot % kLanes;
    const Mat3d after_bar =
        symmetric_of([&](std::size_t i) { return static_cast<double>(to[i * kLanes]); });
    const Mat3d carried = moved * whole * moved.transpose();
    h_bar += 2.0 * iso * after_bar * moved * whole;
    h_bar -= 2.0 / 3.0 * iso / volume * (after_bar.array() * carried.array()).sum() * cofactor;
    const Mat3d before_bar = iso * moved.transpose() * after_bar * moved;
    constexpr int kRow[6] = {0, 1, 2, 1, 0, 0};
    constexpr int kColumn[6] = {0, 1, 2, 2, 2, 1};
    for (std::size_t i = 0; i < 6; ++i) {
      to[i * kLanes] = static_cast<S>(before_bar(kRow[i], kColumn[i]));
    }
  }
  return h_bar;
}

/// Where the particles of a body lie at a reference.
template <class S>
struct Arrivals {
  std::vector<std::size_t> slots;       ///< by particle
  std::vector<UpdatedPlace<S>> places;  ///< by particle

  Arrivals(const RenewedStore<S>& store, std::size_t particles)
      : slots(particles), places(particles) {
    for (std::size_t b = 0; b < store.blocks(); ++b) {
      store.for_each(b, [&](std::size_t slot, const UpdatedPlace<S>& place) {
        slots[store.id[slot]] = slot;
        places[store.id[slot]] = place;
      });
    }
  }
};

/// Copies `count` numbers from one slot of an array to one of another.
template <class S>
void copy_slot(const std::vector<S>& from, std::size_t from_slot, std::vector<S>& to,
               std::size_t to_slot, std::size_t count) {
  const S* read = from.data() + from_slot / kLanes * (count * kLanes) + from_slot % kLanes;
  S* write = to.data() + to_slot / kLanes * (count * kLanes) + to_slot % kLanes;
  for (std::size_t i = 0; i < count; ++i) write[i * kLanes] = read[i * kLanes];
}

}  // namespace

template <class S>
RenewedMomentumBar renewed_momentum_adjoint(Arena& arena, const RenewedState<S>& entered,
                                            const RenewedCotangents<S>& bar) {
  // v = momentum/mass.
  RenewedMomentumBar out;
  out.momentum.assign(bar.velocity.size(), 0.0);
  out.mass = bar.mass;
  const std::vector<double>& mass = entered.reference->mass;
  arena.parallel_for(0, mass.size(), 256, [&](std::size_t n) {
    if (!(mass[n] > 0.0)) return;
    const Vec3d momentum_bar = field_value(bar.velocity, n) / mass[n];
    set_field_value(out.momentum, n, momentum_bar);
    out.mass[n] -= momentum_bar.dot(field_value(entered.velocity, n));
  });
  return out;
}

template <class S>
TransferCotangents renewed_enter_adjoint(const RenewedGrid& grid, std::size_t member,
                                         const UpdatedPlace<S>& place, double dx,
                                         const RenewedMomentumBar& nodes, double mass,
                                         const Vec3d& velocity, const Mat3d& affine) {
  TransferCotangents out;
  const Vec3d f = place.fraction();
  const PointStencil stencil(f, dx);
  const std::uint32_t* blocks = grid.nodes_of(member).data() + std::size_t{8} * place.block;
  place.for_each_node([&](std::size_t x, std::size_t y, std::size_t z, std::size_t i, std::size_t j,
                          std::size_t k) {
    const std::size_t n =
        blocks[x / 4 * 4 + y / 4 * 2 + z / 4] * kBlockNodes + node_index(x % 4, y % 4, z % 4);
    out.add_node(stencil, f, dx, i, j, k, mass, velocity, affine, field_value(nodes.momentum, n),
                 nodes.mass[n]);
  });
  return out;
}

template <class S>
void clear_state_bars(const RenewedState<S>& state, RenewedCotangents<S>& bar,
                      const std::vector<RenewedCargo>& cargo) {
  bar.displacement.assign(state.displacement.size(), 0.0);
  bar.velocity.assign(state.velocity.size(), 0.0);
  bar.mass.assign(state.reference->mass.size(), 0.0);
  for (std::size_t m = 0; m < cargo.size(); ++m) {
    const std::size_t slots = state.reference->bodies[m].id.size();
    bar.bodies[m].place.assign(slots * 3, S(0));
    bar.bodies[m].history.assign(slots * renewed_history(cargo[m].fluid), S(0));
    bar.bodies[m].maxwell.assign(slots * 6 * cargo[m].branches, S(0));
  }
}

template <class S>
void renewal_adjoint(Arena& arena, const RenewedState<S>& left, const RenewedState<S>& entered,
                     const std::vector<RenewedCargo>& cargo, double dx, RenewedCotangents<S>& bar) {
  const RenewedMomentumBar nodes = renewed_momentum_adjoint(arena, entered, bar);
  std::vector<RenewedBodyCotangents<S>> after(cargo.size());
  for (std::size_t m = 0; m < cargo.size(); ++m) {
    after[m].place.swap(bar.bodies[m].place);
    after[m].history.swap(bar.bodies[m].history);
    after[m].maxwell.swap(bar.bodies[m].maxwell);
  }
  clear_state_bars(left, bar, cargo);
  for (std::size_t m = 0; m < cargo.size(); ++m) {
    const RenewedStore<S>& store = left.reference->bodies[m];
    const Arrivals<S> arrivals(entered.reference->bodies[m], bar.bodies[m].stretch.size());
    RenewedBodyCotangents<S>& own = bar.bodies[m];
    const std::size_t kept = renewed_history(cargo[m].fluid);
    std::vector<RenewedFields> fields;
    fields.reserve(store.blocks());
    for (std::size_t b = 0; b < store.blocks(); ++b) {
      fields.emplace_back(left.reference->grid, store.coordinates[b], m, b, dx, left.displacement,
                          left.velocity);
    }
    std::vector<double> log_density(store.blocks(), 0.0);
    arena.parallel_for(0, store.blocks(), 1, [&](std::size_t b) {
      store.for_each(b, [&](std::size_t slot, const UpdatedPlace<S>& place) {
        const std::uint32_t p = store.id[slot];
        const std::size_t to = arrivals.slots[p];
        const BlockField::Stencil s = block_stencil(place, dx);
        const RenewedMotion motion = fields[b].at(place, s);
        const Mat3d inverse = (Mat3d::Identity() + motion.gradient).inverse();
        const Mat3d affine = motion.rate * inverse;
        const TransferCotangents enter =
            renewed_enter_adjoint(entered.reference->grid, m, arrivals.places[p], dx, nodes,
                                  cargo[m].density * store.volume(slot), motion.velocity, affine);
        log_density[b] += enter.log_density;
        RenewedMotion motion_bar;
        for (int a = 0; a < 3; ++a) {
          motion_bar.position[a] =
              enter.x[a] + static_cast<double>(
                               after[m].place[to / kLanes * (3 * kLanes) +
                                              static_cast<std::size_t>(a) * kLanes + to % kLanes]) /
                               dx;
        }
        motion_bar.velocity = enter.v;
        motion_bar.rate = enter.affine * inverse.transpose();
        copy_slot(after[m].history, to, own.history, slot, kept);
        for (std::size_t i = 0; i < cargo[m].branches; ++i) {
          const auto at = [&](std::size_t of) {
            return (of / kLanes * cargo[m].branches + i) * kLanes + of % kLanes;
          };
          copy_slot(after[m].maxwell, at(to), own.maxwell, at(slot), 6);
        }
        motion_bar.gradient =
            history_adjoint(left.history(m), cargo[m], left.bodies[m].maxwell, slot,
                            motion.gradient, inverse, own.history, own.maxwell) -
            affine.transpose() * motion_bar.rate;
        add_place_bar(slot, fields[b].back(s, motion, motion_bar), own.place);
      });
    });
    for (std::size_t b = 0; b < store.blocks(); ++b) {
      fields[b].add_to(bar.displacement, bar.velocity);
      own.log_density += log_density[b];
    }
  }
}

template RenewedMomentumBar renewed_momentum_adjoint<float>(Arena&, const RenewedState<float>&,
                                                            const RenewedCotangents<float>&);
template RenewedMomentumBar renewed_momentum_adjoint<double>(Arena&, const RenewedState<double>&,
                                                             const RenewedCotangents<double>&);
template TransferCotangents renewed_enter_adjoint<float>(const RenewedGrid&, std::size_t,
                                                         const UpdatedPlace<float>&, double,
                                                         const RenewedMomentumBar&, double,
                                                         const Vec3d&, const Mat3d&);
template TransferCotangents renewed_enter_adjoint<double>(const RenewedGrid&, std::size_t,
                                                          const UpdatedPlace<double>&, double,
                                                          const RenewedMomentumBar&, double,
                                                          const Vec3d&, const Mat3d&);
template void renewal_adjoint<float>(Arena&, const RenewedState<float>&, const RenewedState<float>&,
                                     const std::vector<RenewedCargo>&, double,
                                     RenewedCotangents<float>&);
template void renewal_adjoint<double>(Arena&, const RenewedState<double>&,
                                      const RenewedState<double>&, const std::vector<RenewedCargo>&,
                                      double, RenewedCotangents<double>&);
template void clear_state_bars<float>(const RenewedState<float>&, RenewedCotangents<float>&,
                                      const std::vector<RenewedCargo>&);
template void clear_state_bars<double>(const RenewedState<double>&, RenewedCotangents<double>&,
                                       const std::vector<RenewedCargo>&);

}  // namespace matterfit::mpm
