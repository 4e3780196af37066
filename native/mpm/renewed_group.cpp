// SPDX-License-Identifier: GPL-3.0-or-later
#include "mpm/renewed_group.hpp"

#include <algorithm>
#include <cmath>
#include <sstream>

#include "base/error.hpp"
#include "mpm/halo.hpp"
#include "mpm/node_contact.hpp"
#include "mpm/renewed_body.hpp"
#include "mpm/renewed_check.hpp"
#include "mpm/renewed_contact.hpp"
#include "mpm/renewed_grid.hpp"
#include "mpm/renewed_limit.hpp"
#include "mpm/renewed_terms.hpp"
#include "mpm/total_block_field.hpp"
#include "mpm/total_stencil.hpp"
#include "mpm/updated_contact.hpp"

namespace matterfit::mpm {
namespace {

/// |½(FᵀF − I)| since the reference that asks for another.
constexpr double kMostStrain = 1.0 / 3.0;
/// Way relative to the common motion that does [cells].
constexpr double kMostWay = 1.0 / 3.0;
/// Way of the fastest particle between two looks [cells], and how many looks a frame has at most.
constexpr double kLookWay = 0.5;
constexpr int kMostLooks = 1 << 20;
/// Nodes with less than this share of the largest mass do not tell how fast a body is.
constexpr double kLightNode = 1e-3;

}  // namespace

template <class S>
struct RenewedGroup<S>::Impl {
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
  std::vector<std::vector<RenewedLoad<S>>> loads;  ///< by `work`
  double total_mass = 0.0;
  double last_dt = 0.0;
  double min_j = 1.0;
  std::uint64_t renewals = 0;
  bool moves_apart = true;  ///< particles' ways matter, not their strain alone
  int looks = 1;            ///< of this frame
  int substeps = 1;
  int substep = 0;

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
    moves_apart = indices.size() > 1 || node_contact.any() ||
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

  [[nodiscard]] double pull(double time) const {
    return std::max(scene->gravity.at(time).norm(),
                    scene->gravity.at(time + 1.0 / scene->fps).norm()) +
           terms.acceleration_bound(fastest());
  }

  [[nodiscard]] int looks_of_frame(double time) const {
    const double seconds = 1.0 / scene->fps;
    const double way = (fastest() + pull(time) * seconds) * seconds;
    int count = 1;
    while (count < kMostLooks && count * kLookWay * dx < way) count *= 2;
    return count;
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
    loads.resize(work.size());
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

  [[nodiscard]] bool asks_for_renewal(Arena& arena) {
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
    return strain > kMostStrain * kMostStrain ||
           (moves_apart && way > kMostWay * dx * (kMostWay * dx));
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
      node_contact.apply(n, grid.coordinates(n), dx, time, m, u, v);
      for (std::size_t i = 0; i < kNodeBlock; ++i) u[i] += dt * v[i];
    });
  }
};

template <class S>
RenewedGroup<S>::RenewedGroup(const Scene& scene, const std::vector<std::size_t>& bodies,
                              const RenewedKernels<S>& kernels, std::size_t memory_limit)
    : impl_(std::make_unique<Impl>(scene, bodies, kernels, memory_limit)) {}
template <class S>
RenewedGroup<S>::~RenewedGroup() = default;

template <class S>
std::pair<double, std::string> RenewedGroup<S>::limit_step(double time) const {
  const Impl& s = *impl_;
  const double speed = s.fastest() + s.pull(time) / s.scene->fps;
  return renewed_limit(*s.scene, s.bodies, s.contacts, s.terms, s.min_j, speed);
}

template <class S>
double RenewedGroup<S>::whole_substeps(double time, double count) const {
  const double looks = impl_->looks_of_frame(time);
  return std::ceil(count / looks * (1.0 - 1e-12)) * looks;
}

template <class S>
void RenewedGroup<S>::begin_frame(double time, int substeps) {
  Impl& s = *impl_;
  s.looks = s.looks_of_frame(time);
  s.substeps = substeps;
  s.substep = 0;
  const double speed = s.fastest() + s.pull(time) / s.scene->fps;
  for (std::size_t m = 0; m < s.bodies.size(); ++m) s.terms.of(m).check_step(speed);
  for (RenewedContact<S>& contact : s.contacts) {
    contact.begin_frame(1.0 / s.scene->fps, s.pull(time));
  }
  s.node_contact.begin_frame(1.0 / s.scene->fps, s.pull(time));
  s.node_contact.wake(s.grid.size());
}

template <class S>
std::pair<double, double> RenewedGroup<S>::step(Arena& arena, double time, double dt,
                                                const Vec3d& gravity) {
  Impl& s = *impl_;
  const std::vector<RenewedView<S>> all = s.views(dt, Vec3d::Zero());
  s.for_blocks(arena, [&](std::size_t i, std::uint32_t m, std::uint32_t b) {
    s.contacts[m].apply(s.bodies[m], b, s.grid.nodes_of(m).data() + std::size_t{8} * b,
                        s.displacement, s.velocity, s.dx, time, dt, s.loads[i]);
    s.kernels->forces(all[m], b);
    s.add_loads(i, m, b);
    s.terms.add(s.bodies[m], m, b, s.grid.nodes_of(m).data() + std::size_t{8} * b, s.displacement,
                s.velocity, s.dx, {time, gravity});
  });
  double least = 1.0;
  double most = 1.0;
  for (const RenewedBody<S>& body : s.bodies) {
    for (const BlockExtremes<S>& e : body.extremes()) {
      least = std::min(least, static_cast<double>(e.min_volume_ratio));
      most = std::max(most, static_cast<double>(e.max_volume_ratio));
    }
  }
  if (!(least > 0.0)) fail_renewed(*s.scene, s.bodies, s.grid, s.displacement, time);
  s.min_j = least;
  s.move_nodes(arena, 0.5 * (s.last_dt + dt), time, dt, gravity);
  s.last_dt = dt;
  const auto look = [&](int k) { return static_cast<std::int64_t>(k) * s.looks / s.substeps; };
  ++s.substep;
  if (look(s.substep) != look(s.substep - 1) && s.asks_for_renewal(arena)) s.renew(arena);
  return {least, most};
}

template <class S>
void RenewedGroup<S>::sample(Arena& arena, std::vector<BodyState>& bodies) const {
  const Impl& s = *impl_;
  for (std::size_t m = 0; m < s.bodies.size(); ++m) {
    const RenewedBody<S>& body = s.bodies[m];
    BodyState& out = bodies[body.index()];
    out.positions.resize(body.particles());
    out.velocities.resize(body.particles());
    out.deformation_gradients.resize(body.particles());
    out.plastic_strain.resize(body.law().plastic ? body.particles() : 0);
    arena.parallel_for(0, body.blocks(), 1, [&](std::size_t b) {
      BlockField displacement;
      BlockField velocity;
      const std::uint32_t* nodes = s.grid.nodes_of(m).data() + 8 * b;
      displacement.gather(nodes, s.displacement.data());
      velocity.gather(nodes, s.velocity.data());
      const Vec3d corner = body.coordinates()[b].template cast<double>() * (4.0 * s.dx);
      body.for_each(b, [&](std::size_t slot, const UpdatedPlace<S>& place) {
        const BlockField::Stencil at({place.block, place.cell / kLanes, place.cell / 4 % 4,
                                      place.cell % 4, place.fraction()},
                                     s.dx);
        const std::uint32_t p = body.store().id[slot];
        const Mat3d moved = Mat3d::Identity() + displacement.gradient(at);
        out.positions[p] =
            (place.position(corner, s.dx) + displacement.at(at)).template cast<float>();
        out.velocities[p] = velocity.at(at).template cast<float>();
        const Mat3d elastic = body.is_fluid()
                                  ? Mat3d(std::cbrt(moved.determinant()) * body.elastic(slot))
                                  : Mat3d(moved * body.elastic(slot));
        out.deformation_gradients[p] = elastic.template cast<float>();
        if (body.law().plastic) {
          out.plastic_strain[p] = static_cast<float>(body.plastic_strain(slot));
        }
      });
    });
  }
}

template <class S>
void RenewedGroup<S>::report(FrameReport& report) const {
  const Impl& s = *impl_;
  report.max_speed = std::max(report.max_speed, s.fastest());
  for (const RenewedContact<S>& contact : s.contacts) {
    report.max_penetration = std::max(report.max_penetration, contact.max_penetration());
  }
  for (std::size_t n = 0; n < s.mass.size(); ++n) {
    if (!(s.mass[n] > 0.0)) continue;
    report.kinetic_energy += 0.5 * s.mass[n] * field_value(s.velocity, n).squaredNorm();
  }
}

template <class S>
std::uint64_t RenewedGroup<S>::renewals() const {
  return impl_->renewals;
}

template <class S>
std::pair<Vec3d, Vec3d> RenewedGroup<S>::momentum() const {
  const Impl& s = *impl_;
  Vec3d linear = Vec3d::Zero();
  Vec3d angular = Vec3d::Zero();
  for (std::size_t n = 0; n < s.mass.size(); ++n) {
    if (!(s.mass[n] > 0.0)) continue;
    const Vec3d origin = s.grid.coordinates(n / kBlockNodes).template cast<double>() * (4.0 * s.dx);
    const Vec3d x =
        position_of_node(origin, s.dx, n % kBlockNodes) + field_value(s.displacement, n);
    const Vec3d momentum = s.mass[n] * field_value(s.velocity, n);
    linear += momentum;
    angular += x.cross(momentum);
  }
  return {linear, angular};
}

template <class S>
void RenewedGroup<S>::renew(Arena& arena) {
  impl_->renew(arena);
}

template <class S>
void RenewedGroup<S>::save(ByteWriter& out) const {
  const Impl& s = *impl_;
  out.put(s.last_dt);
  out.put(s.min_j);
  out.put(s.renewals);
  for (std::size_t m = 0; m < s.bodies.size(); ++m) {
    s.bodies[m].save(out);
    s.contacts[m].save(out);
  }
  out.put(s.displacement);
  out.put(s.velocity);
  out.put(s.mass);
}

template <class S>
void RenewedGroup<S>::load(ByteReader& in) {
  Impl& s = *impl_;
  in.get(s.last_dt);
  in.get(s.min_j);
  in.get(s.renewals);
  for (std::size_t m = 0; m < s.bodies.size(); ++m) {
    s.bodies[m].load(in);
    s.contacts[m].load(in);
  }
  s.link();
  s.displacement.resize(s.grid.size() * kNodeBlock);
  s.velocity.resize(s.grid.size() * kNodeBlock);
  s.mass.resize(s.grid.size() * kBlockNodes);
  in.get_same_size(s.displacement);
  in.get_same_size(s.velocity);
  in.get_same_size(s.mass);
}

template class RenewedGroup<float>;
template class RenewedGroup<double>;

}  // namespace matterfit::mpm
