// SPDX-License-Identifier: GPL-3.0-or-later
// What a RenewedGroup holds, for its own files.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <memory>
#include <optional>
#include <sstream>
#include <utility>
#include <vector>

#include "base/error.hpp"
#include "mpm/halo.hpp"
#include "mpm/node_contact.hpp"
#include "mpm/renewed_body.hpp"
#include "mpm/renewed_contact.hpp"
#include "mpm/renewed_grid.hpp"
#include "mpm/renewed_group.hpp"
#include "mpm/renewed_sample.hpp"
#include "mpm/renewed_terms.hpp"
#include "mpm/total_stencil.hpp"
#include "mpm/updated_contact.hpp"

namespace matterfit::mpm {

template <class S>
struct RenewedGroup<S>::Impl {
  /// |½(FᵀF − I)| since the reference that asks for another.
  static constexpr double kMostStrain = 1.0 / 3.0;
  /// Way relative to the common motion that does [cells].
  static constexpr double kMostWay = 1.0 / 3.0;
  /// How many times as far motion goes before it asks for a renewal that is not planned.
  static constexpr double kBeyondPlan = 2.0;
  /// Way of the fastest particle between two looks [cells], and how many looks a frame has at most.
  static constexpr double kLookWay = 0.5;
  static constexpr int kMostLooks = 1 << 20;
  /// Nodes with less than this share of the largest mass do not tell how fast a body is.
  static constexpr double kLightNode = 1e-3;

  const Scene* scene;
  const RenewedKernels<S>* kernels;
  std::size_t memory_limit;
  double dx;
  std::vector<RenewedBody<S>> bodies;
  std::vector<RenewedContact<S>> contacts;
  RenewedNodeContact node_contact;
  RenewedTerms<S> terms;
  RenewedGrid grid;
  std::vector<double> displacement;  ///< node blocks × [3][64] [m]
  std::vector<double> velocity;      ///< [m/s]
  std::vector<double> mass;          ///< node blocks × [64] [kg]
  /// Blocks of all bodies, one after the other: body, block.
  std::vector<std::pair<std::uint32_t, std::uint32_t>> work;
  std::vector<std::size_t> first_work;             ///< of each body, and the end
  std::vector<std::vector<RenewedLoad<S>>> loads;  ///< by `work`
  std::vector<std::vector<RenewedTouch>> touches;  ///< by `work`, of a substep that is followed
  /// By `work`, of the next substep: what total Lagrangian bodies do.
  std::vector<std::vector<RenewedLoad<S>>> pushes;
  RenewedSubstep* followed = nullptr;
  std::vector<double>* pushed = nullptr;
  /// What record() shares; null where it is of another reference.
  std::shared_ptr<const RenewedReference<S>> reference;
  double total_mass = 0.0;
  double last_dt = 0.0;
  double min_j = 1.0;
  std::uint64_t renewals = 0;
  bool moves_apart = true;    ///< particles' ways matter, not their strain alone
  double acceleration = 0.0;  ///< that contact was told of at the frame's start [m/s²]
  int looks = 1;              ///< of this frame
  int substeps = 1;
  int substep = 0;
  std::optional<std::vector<double>> planned;  ///< renewals of this frame
  std::vector<double> renewed_at;              ///< in this frame so far

  Impl(const Scene& s, const std::vector<std::size_t>& indices, const RenewedKernels<S>& k,
       std::size_t limit)
      : scene(&s),
        kernels(&k),
        memory_limit(limit),
        dx(s.dx),
        node_contact(colliders_met(s, true)),
        terms(s, indices) {
    const Vec3d common = s.bodies[indices.front()].velocity;
    bodies.reserve(indices.size());
    contacts.reserve(indices.size());
    for (const std::size_t index : indices) {
      const Body& body = s.bodies[index];
      bodies.emplace_back(body, index, dx, common);
      contacts.emplace_back(body, s, colliders_met(s, false));
      for (const double volume : body.volumes) total_mass += body.density * volume;
    }
    // A node that a collider holds would hold an elastic body that rebounds for ever.
    moves_apart = s.bodies.size() > 1 || node_contact.any() ||
                  !s.bodies[indices.front()].material.traits().elastic();
    Arena arena(1);
    link();
    enter(arena, common);
  }

  [[nodiscard]] RenewedView<S> view(std::size_t body, double dt) {
    RenewedView<S> v = bodies[body].view(displacement, velocity, grid.nodes_of(body));
    v.dx = static_cast<S>(dx);
    v.dt = static_cast<S>(dt);
    return v;
  }

  [[nodiscard]] std::vector<RenewedView<S>> views(double dt, const Vec3d& common) {
    std::vector<RenewedView<S>> out;
    out.reserve(bodies.size());
    for (std::size_t m = 0; m < bodies.size(); ++m) {
      out.push_back(view(m, dt));
      for (int c = 0; c < 3; ++c) out.back().common[c] = common[c];
    }
    return out;
  }

  /// Every block of every body, in any order.
  template <class Use>
  void for_blocks(Arena& arena, const Use& use) {
    arena.parallel_for(0, work.size(), 1,
                       [&](std::size_t i) { use(i, work[i].first, work[i].second); });
  }

  /// for_each_renewed() of a member.
  template <class Visit>
  void for_each(Arena& arena, std::size_t m, const Visit& visit) const {
    for_each_renewed(arena, bodies[m], grid.nodes_of(m), displacement, velocity, dx, visit);
  }

  /// Σ m field / Σ m.
  [[nodiscard]] Vec3d mean(const std::vector<double>& field) const {
    Vec3d sum = Vec3d::Zero();
    for (std::size_t n = 0; n < mass.size(); ++n) {
      if (mass[n] > 0.0) sum += mass[n] * field_value(field, n);
    }
    return sum / total_mass;
  }

  /// The largest speed of any node that is not light [m/s].
  [[nodiscard]] double fastest() const {
    const double heavy = kLightNode * *std::max_element(mass.begin(), mass.end());
    double fastest = 0.0;
    for (std::size_t n = 0; n < mass.size(); ++n) {
      if (mass[n] > heavy) fastest = std::max(fastest, field_value(velocity, n).squaredNorm());
    }
    return std::sqrt(fastest);
  }

  [[nodiscard]] double term_acceleration() const { return terms.acceleration_bound(fastest()); }

  [[nodiscard]] double pull(double time) const {
    return std::max(scene->gravity.at(time).norm(),
                    scene->gravity.at(time + 1.0 / scene->fps).norm()) +
           term_acceleration();
  }

  [[nodiscard]] int looks_of_frame(double time) const {
    const double seconds = 1.0 / scene->fps;
    const double way = (fastest() + pull(time) * seconds) * seconds;
    int count = 1;
    while (count < kMostLooks && count * kLookWay * dx < way) count *= 2;
    return count;
  }

  void begin_contact(double pull) {
    acceleration = pull;
    for (RenewedContact<S>& contact : contacts) contact.begin_frame(1.0 / scene->fps, pull);
    node_contact.begin_frame(1.0 / scene->fps, pull);
    node_contact.wake(grid.size());
  }

  // --- renewal ----------------------------------------------------------------------------------

  /// Nodes around the bodies' blocks.
  void link() {
    RenewedGrid::Cells cells;
    cells.reserve(bodies.size());
    for (const RenewedBody<S>& body : bodies) cells.push_back(&body.coordinates());
    grid.link(cells);
    work.clear();
    for (std::size_t m = 0; m < bodies.size(); ++m) {
      for (std::size_t b = 0; b < bodies[m].blocks(); ++b) {
        work.emplace_back(static_cast<std::uint32_t>(m), static_cast<std::uint32_t>(b));
      }
      contacts[m].wake(bodies[m].blocks());
    }
    node_contact.wake(grid.size());
    reference.reset();
    loads.resize(work.size());
    touches.resize(work.size());
    pushes.assign(work.size(), {});
    first_work.assign(1, 0);
    for (const RenewedBody<S>& body : bodies)
      first_work.push_back(first_work.back() + body.blocks());
    const std::size_t bytes = work.size() * 4 * kHaloNodes * sizeof(S) +
                              grid.size() * (3 * kNodeBlock + kBlockNodes) * sizeof(double);
    if (bytes <= memory_limit) return;
    std::ostringstream text;
    text << "The grid has grown to " << work.size() << " blocks, more than the memory limit of "
         << (memory_limit >> 20U)
         << " MB holds: particles fly apart. Add walls or a ground, shorten the frame range, or "
            "raise the limit.";
    throw_compute(text.str());
  }

  /// What particles carry becomes the nodes': velocities are relative to `common`.
  void enter(Arena& arena, const Vec3d& common) {
    displacement.assign(grid.size() * kNodeBlock, 0.0);
    velocity.assign(grid.size() * kNodeBlock, 0.0);
    mass.assign(grid.size() * kBlockNodes, 0.0);
    const std::vector<RenewedView<S>> all = views(0.0, common);
    for_blocks(arena,
               [&](std::size_t, std::uint32_t m, std::uint32_t b) { kernels->enter(all[m], b); });
    arena.parallel_for(0, grid.size(), 4, [&](std::size_t n) {
      double* m = mass.data() + n * kBlockNodes;
      sum_halos(n, 3, m);
      for (std::size_t c = 0; c < 3; ++c) {
        double* v = velocity.data() + n * kNodeBlock + c * kBlockNodes;
        sum_halos(n, c, v);
        for (std::size_t i = 0; i < kBlockNodes; ++i) {
          v[i] = common[static_cast<int>(c)] + (m[i] > 0.0 ? v[i] / m[i] : 0.0);
        }
      }
    });
  }

  /// Adds component c of all halos at node block n to `out` [64].
  void sum_halos(std::size_t n, std::size_t c, double* out) const {
    for (std::size_t m = 0; m < bodies.size(); ++m) {
      const auto& sources = grid.sources(m, n);
      for (std::size_t k = 0; k < 8; ++k) {
        if (sources[k] == kNoBlock) continue;
        add_halo(k, bodies[m].halo(sources[k]) + c * kHaloNodes, out);
      }
    }
  }

  void renew(Arena& arena) {
    const Vec3d common = mean(velocity);
    const std::vector<RenewedView<S>> all = views(0.0, common);
    for_blocks(arena,
               [&](std::size_t, std::uint32_t m, std::uint32_t b) { kernels->leave(all[m], b); });
    for (RenewedBody<S>& body : bodies) body.arrange(arena, dx);
    link();
    enter(arena, common);
    ++renewals;
  }

  /// At the end of a substep. Where renewals are planned motion asks for one at `kBeyondPlan` times
  /// the limits.
  [[nodiscard]] bool is_due(Arena& arena) {
    if (planned) {
      for (const double at : *planned) {
        if (std::max(std::lround(at * substeps), 1L) == substep) return true;
      }
    }
    const auto look = [&](int k) { return static_cast<std::int64_t>(k) * looks / substeps; };
    return look(substep) != look(substep - 1) &&
           asks_for_renewal(arena, planned ? kBeyondPlan : 1.0);
  }

  [[nodiscard]] bool asks_for_renewal(Arena& arena, double times) {
    const std::vector<RenewedView<S>> all = views(0.0, mean(displacement));
    for_blocks(arena, [&](std::size_t, std::uint32_t m, std::uint32_t b) {
      kernels->departure(all[m], b);
    });
    double strain = 0.0;
    double way = 0.0;
    for (const RenewedBody<S>& body : bodies) {
      for (const RenewedDeparture<S>& d : body.departure()) {
        strain = std::max(strain, static_cast<double>(d.strain));
        way = std::max(way, static_cast<double>(d.way));
      }
    }
    const double most_strain = times * kMostStrain;
    const double most_way = times * kMostWay * dx;
    return strain > most_strain * most_strain || (moves_apart && way > most_way * most_way);
  }

  // --- substep ----------------------------------------------------------------------------------

  void add_loads(std::size_t i, std::size_t m, std::size_t b) {
    S* halo = bodies[m].halo(b);
    for (const RenewedLoad<S>& load : loads[i]) {
      S offset[3];
      for (std::size_t a = 0; a < 3; ++a)
        offset[a] = static_cast<S>(load.offset[static_cast<int>(a)]);
      const OffsetPlace<S> at(load.place, offset);
      S w[3][3];
      for (std::size_t axis = 0; axis < 3; ++axis) quadratic_weights(at.f[axis], w[axis]);
      load.place.for_each_node([&](std::size_t x, std::size_t y, std::size_t z, std::size_t p,
                                   std::size_t q, std::size_t r) {
        const double weight = static_cast<double>(w[0][p] * w[1][q] * w[2][r]);
        for (std::size_t c = 0; c < 3; ++c) {
          halo[c * kHaloNodes + halo_index(x, y, z)] +=
              static_cast<S>(weight * load.force[static_cast<int>(c)]);
        }
      });
    }
  }

  /// Fills `followed`.
  void note(double time, double dt, double kick, const Vec3d& gravity) {
    *followed = {time, dt, kick, gravity, false, {}};
    for (std::size_t i = 0; i < work.size(); ++i) {
      for (RenewedTouch& touch : touches[i]) {
        touch.member = work[i].first;
        followed->touches.push_back(touch);
      }
      touches[i].clear();
    }
  }

  void move_nodes(Arena& arena, double kick, double time, double dt, const Vec3d& gravity) {
    arena.parallel_for(0, grid.size(), 4, [&](std::size_t n) {
      const double* m = mass.data() + n * kBlockNodes;
      double* u = displacement.data() + n * kNodeBlock;
      double* v = velocity.data() + n * kNodeBlock;
      for (std::size_t c = 0; c < 3; ++c) {
        double force[kBlockNodes] = {};
        sum_halos(n, c, force);
        const double g = gravity[static_cast<int>(c)];
        for (std::size_t i = 0; i < kBlockNodes; ++i) {
          const double a = m[i] > 0.0 ? force[i] / m[i] : 0.0;
          // Empty nodes fall with the body: their weight is zero, their value harmless.
          v[c * kBlockNodes + i] += kick * (a + g);
        }
      }
      if (pushed != nullptr) std::copy_n(v, kNodeBlock, pushed->data() + n * kNodeBlock);
      node_contact.apply(n, grid.coordinates(n), dx, time, m, u, v);
      for (std::size_t i = 0; i < kNodeBlock; ++i) u[i] += dt * v[i];
    });
  }
};

}  // namespace matterfit::mpm
