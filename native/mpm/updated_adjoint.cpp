// SPDX-License-Identifier: GPL-3.0-or-later
#include "mpm/updated_adjoint.hpp"

#include <algorithm>
#include <map>
#include <optional>
#include <tuple>

#include "material/neural/published_weights.hpp"
#include "mpm/halo.hpp"
#include "mpm/initial_velocity.hpp"
#include "mpm/law_kernels.hpp"
#include "mpm/node_contact.hpp"
#include "mpm/node_contact_adjoint.hpp"
#include "mpm/updated_back.hpp"
#include "mpm/updated_contact.hpp"
#include "mpm/updated_loads.hpp"

namespace matterfit::mpm {
namespace {

constexpr std::size_t kNodes = 4 * kBlockNodes;     ///< of a block: momentum and mass
constexpr std::size_t kVelocity = 3 * kBlockNodes;  ///< of a block
constexpr std::size_t kPublished = 2 * material::kNetWeights;
/// Blocks are dealt into so many sums at most, whatever the number of threads.
constexpr std::size_t kWeightPartitions = 32;

/// Blocks by their coordinates.
class TopologyIndex {
 public:
  explicit TopologyIndex(const UpdatedTopology& topology) {
    for (std::size_t b = 0; b < topology.coordinates.size(); ++b) {
      index_.emplace(key(topology.coordinates[b]), static_cast<std::uint32_t>(b));
    }
  }
  [[nodiscard]] std::uint32_t find(const Vec3i& coordinates) const {
    const auto at = index_.find(key(coordinates));
    return at == index_.end() ? kNoBlock : at->second;
  }

 private:
  using Key = std::tuple<int, int, int>;
  static Key key(const Vec3i& c) { return {c[0], c[1], c[2]}; }
  std::map<Key, std::uint32_t> index_;
};

}  // namespace

template <class S>
struct UpdatedAdjoint<S>::Impl {
  const Scene* scene;
  const UpdatedAdjointKernels<S>* kernels;
  bool rates;
  double dx;
  std::vector<UpdatedMember<S>> members;
  std::vector<shape::ColliderPtr> node_colliders;
  std::vector<std::size_t> node_places;  ///< in scene.colliders
  std::optional<UpdatedLoads<S>> loads;  ///< of the members, when all are there
  // Kept between substeps for their memory alone.
  std::vector<S> velocity;            ///< per block [3][64], after node-wise contact
  std::vector<S> halos;               ///< per block [3][216]
  std::vector<LawCotangents> laws;    ///< per block and body
  std::vector<double> log_densities;  ///< as `laws`
  std::vector<double> load_velocity_bar;
  std::vector<S> published_sums;  ///< per partition and body [kPublished]

  Impl(const Scene& s, const std::vector<std::size_t>& bodies,
       const UpdatedAdjointKernels<S>& adjoint_kernels, bool rates_of_all)
      : scene(&s),
        kernels(&adjoint_kernels),
        rates(rates_of_all),
        dx(s.dx),
        node_colliders(colliders_met(s, true)),
        node_places(places_of_met(s, true)) {
    const std::vector<shape::ColliderPtr> met = colliders_met(s, false);
    for (const std::size_t index : bodies) {
      members.push_back(make_updated_member<S>(s.bodies[index], index, met, dx));
    }
    loads.emplace(s, bodies, members);
  }

  [[nodiscard]] Vec3d origin(const UpdatedTopology& topology, std::size_t block) const {
    return topology.coordinates[block].template cast<double>() * (4.0 * dx);
  }

  /// Brings the nodes' cotangents to the blocks of `topology`: a frame that began in between may
  /// have dropped and sorted some.
  static void move_nodes(UpdatedCotangents<S>& bar,
                         const std::shared_ptr<const UpdatedTopology>& topology) {
    if (bar.topology == topology) return;
    std::vector<S> moved(topology->coordinates.size() * kNodes, S(0));
    if (bar.topology) {
      const TopologyIndex index(*bar.topology);
      for (std::size_t b = 0; b < topology->coordinates.size(); ++b) {
        const std::uint32_t from = index.find(topology->coordinates[b]);
        if (from == kNoBlock) continue;
        std::copy_n(bar.nodes.data() + from * kNodes, kNodes, moved.data() + b * kNodes);
      }
    }
    bar.nodes = std::move(moved);
    bar.topology = topology;
  }

  /// The node velocities that particles met.
  const S* velocities(Arena& arena, const UpdatedRecord<S>& record) {
    if (node_colliders.empty()) return record.node_velocity.data();
    velocity = record.node_velocity;
    arena.parallel_for(0, record.before->coordinates.size(), 4, [&](std::size_t b) {
      for (const shape::ColliderPtr& collider : node_colliders) {
        apply_node_contact(*collider, origin(*record.before, b), dx, record.time,
                           record.node_mass.data() + b * kBlockNodes,
                           velocity.data() + b * kVelocity);
      }
    });
    return velocity.data();
  }

  void particles_of_block(std::size_t b, const UpdatedRecord<S>& record, const S* velocities_after,
                          UpdatedCotangents<S>& bar, S* published_sums) {
    S* halo = halos.data() + b * 3 * kHaloNodes;
    std::fill(halo, halo + 3 * kHaloNodes, S(0));
    UpdatedAdjointView<S> view{};
    view.dx = static_cast<S>(dx);
    view.dt = static_cast<S>(record.dt);
    view.velocity_bar = halo;
    for (std::size_t m = 0; m < members.size(); ++m) {
      const std::size_t at = b * members.size() + m;
      const std::uint32_t* first = record.slab_chunks.data() + at * kSlabs;
      laws[at] = {};
      log_densities[at] = 0.0;
      if (first[0] == first[kSlabs]) continue;
      for (std::size_t k = 0; k < 8; ++k) {
        const std::size_t there = 13 + 9 * (k / 4) + 3 * (k / 2 % 2) + k % 2;
        view.node_velocity[k] = velocities_after + record.before->neighbours[b][there] * kVelocity;
      }
      for (std::size_t k = 0; k < 27; ++k) {
        const std::uint32_t other = record.after->neighbours[b][k];
        view.node_bar[k] =
            other == kNoBlock ? nullptr : bar.nodes.data() + std::size_t{other} * kNodes;
      }
      for (std::size_t s = 0; s < kSlabs; ++s) {
        view.slab[s] = record.chunks.data() + first[s];
        view.chunks[s] = first[s + 1] - first[s];
      }
      UpdatedBodyCotangents<S>& body = bar.bodies[m];
      view.law = members[m].law;
      view.law.damped = view.law.damped || rates;
      view.density = static_cast<S>(members[m].density);
      view.maxwell = record.maxwell[m].empty() ? nullptr : record.maxwell[m].data();
      view.maxwell_bar = body.maxwell.data();
      view.particle_bar = body.particles.data();
      view.published_bar = body.published.empty() ? nullptr : published_sums + m * kPublished;
      view.published = members[m].published.empty() ? nullptr : members[m].published.data();
      updated_block_of(*kernels, view.law.law)(view);
      laws[at] = view.law_bar;
      log_densities[at] = view.log_density;
    }
  }

  /// v = momentum/mass + kick g, then node-wise contact. Returns the cotangent of gravity.
  Vec3d nodes_of_block(std::size_t b, const UpdatedRecord<S>& record, S* nodes_bar,
                       shape::ColliderCotangents* colliders) const {
    double v_bar[kVelocity] = {};
    for (std::size_t k = 0; k < 8; ++k) {
      const std::size_t other =
          record.before->neighbours[b][13 - (9 * (k / 4) + 3 * (k / 2 % 2) + k % 2)];
      if (other == kNoBlock || other >= record.before->coordinates.size()) continue;
      for (std::size_t c = 0; c < 3; ++c) {
        add_halo(k, halos.data() + (other * 3 + c) * kHaloNodes, v_bar + c * kBlockNodes);
      }
    }
    if (!load_velocity_bar.empty()) {
      for (std::size_t i = 0; i < kVelocity; ++i) v_bar[i] += load_velocity_bar[b * kVelocity + i];
    }
    const S* mass = record.node_mass.data() + b * kBlockNodes;
    const S* before_contact = record.node_velocity.data() + b * kVelocity;
    if (!node_colliders.empty()) {
      node_contact_adjoint(node_colliders, origin(*record.before, b), dx, record.time, mass,
                           before_contact, v_bar, colliders);
    }
    Vec3d gravity_bar = Vec3d::Zero();
    const Vec3d kick = record.kick * record.gravity;
    for (std::size_t n = 0; n < kBlockNodes; ++n) {
      double mass_bar = 0.0;
      const bool there = mass[n] > S(0);
      const double inverse = there ? 1.0 / static_cast<double>(mass[n]) : 0.0;
      for (std::size_t c = 0; c < 3; ++c) {
        const double momentum_bar = inverse * v_bar[c * kBlockNodes + n];
        const auto v = static_cast<double>(before_contact[c * kBlockNodes + n]);
        mass_bar -= momentum_bar * (v - kick[static_cast<int>(c)]);
        nodes_bar[c * kBlockNodes + n] = static_cast<S>(momentum_bar);
        if (there) gravity_bar[static_cast<int>(c)] += v_bar[c * kBlockNodes + n];
      }
      nodes_bar[3 * kBlockNodes + n] = static_cast<S>(mass_bar);
    }
    return record.kick * gravity_bar;
  }

  void substep(Arena& arena, const UpdatedRecord<S>& record, UpdatedCotangents<S>& bar) {
    const std::size_t blocks = record.before->coordinates.size();
    move_nodes(bar, record.after);
    const S* velocities_after = velocities(arena, record);
    load_velocity_bar.clear();
    loads->act_adjoint(arena, UpdatedBack<S>(record, bar.nodes, velocities_after, dx), record.acts,
                       bar, load_velocity_bar);

    halos.resize(blocks * 3 * kHaloNodes);
    laws.resize(blocks * members.size());
    log_densities.resize(laws.size());
    const bool by_weights =
        std::any_of(bar.bodies.begin(), bar.bodies.end(),
                    [](const UpdatedBodyCotangents<S>& body) { return !body.published.empty(); });
    const std::size_t parts = by_weights ? std::min(kWeightPartitions, blocks) : blocks;
    published_sums.assign(by_weights ? parts * members.size() * kPublished : 0, S(0));
    arena.parallel_for(0, parts, 1, [&](std::size_t part) {
      S* sums = published_sums.data() + (by_weights ? part * members.size() * kPublished : 0);
      for (std::size_t b = blocks * part / parts; b < blocks * (part + 1) / parts; ++b) {
        particles_of_block(b, record, velocities_after, bar, sums);
      }
    });
    for (std::size_t m = 0; m < members.size(); ++m) {
      LawCotangents all;
      UpdatedBodyCotangents<S>& body = bar.bodies[m];
      for (std::size_t b = 0; b < blocks; ++b) {
        all += laws[b * members.size() + m];
        body.log_density += log_densities[b * members.size() + m];
      }
      body.law += all;
      for (std::size_t part = 0; part < parts && !body.published.empty(); ++part) {
        const S* sums = published_sums.data() + (part * members.size() + m) * kPublished;
        for (std::size_t i = 0; i < kPublished; ++i) {
          body.published[i] += static_cast<double>(sums[i]);
        }
      }
      all.add_branches(members[m].material, record.dt, body.branches);
    }

    std::vector<S> nodes_bar(blocks * kNodes);
    std::vector<Vec3d> gravity(blocks);
    std::vector<shape::ColliderCotangents> met(blocks * node_colliders.size());
    arena.parallel_for(0, blocks, 4, [&](std::size_t b) {
      gravity[b] = nodes_of_block(b, record, nodes_bar.data() + b * kNodes,
                                  met.data() + b * node_colliders.size());
    });
    for (const Vec3d& g : gravity) bar.gravity += g;
    for (std::size_t i = 0; i < met.size(); ++i) {
      bar.colliders[node_places[i % node_colliders.size()]] += met[i];
    }
    for (auto load = loads->list().rbegin(); load != loads->list().rend(); ++load) {
      (*load)->push_adjoint(arena, record, nodes_bar, bar);
    }
    bar.nodes = std::move(nodes_bar);
    bar.topology = record.before;
  }
};

template <class S>
UpdatedAdjoint<S>::UpdatedAdjoint(const Scene& scene, const std::vector<std::size_t>& bodies,
                                  const UpdatedAdjointKernels<S>& kernels, bool rates)
    : impl_(std::make_unique<Impl>(scene, bodies, kernels, rates)) {}
template <class S>
UpdatedAdjoint<S>::~UpdatedAdjoint() = default;

template <class S>
UpdatedCotangents<S> UpdatedAdjoint<S>::zero(bool published) const {
  UpdatedCotangents<S> bar;
  for (const UpdatedMember<S>& member : impl_->members) {
    UpdatedBodyCotangents<S> body;
    body.terms = impl_->loads->terms().of(bar.bodies.size()).zero();
    body.particles.resize(member.particles);
    body.published.assign(published ? member.published.size() : 0, 0.0);
    body.maxwell.assign(member.maxwell.size(), S(0));
    body.stretch.assign(member.memory.size(), Vec3d::Zero());
    const bool pinned = !impl_->scene->bodies[member.index].pins.empty();
    body.rest.assign(pinned ? member.particles : 0, Vec3d::Zero());
    body.branches.assign(member.material.maxwell.size(), {0.0, 0.0});
    bar.bodies.push_back(std::move(body));
  }
  bar.colliders.resize(impl_->scene->colliders.size());
  return bar;
}

template <class S>
void UpdatedAdjoint<S>::substep(Arena& arena, const UpdatedRecord<S>& record,
                                UpdatedCotangents<S>& bar) {
  impl_->substep(arena, record, bar);
}

namespace {

template <class S>
Vec3d vector_of(const std::array<S, 3>& a) {
  return {static_cast<double>(a[0]), static_cast<double>(a[1]), static_cast<double>(a[2])};
}

template <class S>
void add_first_transfer(const Body& body, std::size_t p, double dx, const Vec3d& center,
                        const TopologyIndex& index, const UpdatedCotangents<S>& bar,
                        TransferCotangents& out) {
  const Vec3d v = start_velocity(body, p, center);
  const Mat3d spin = spin_matrix(body.spin);
  const double mass = body.density * body.volumes[p];
  const UpdatedStart<S> start = updated_start<S>(body, p, dx, center);
  const UpdatedPlace<S> place{index.find(start.block),
                              start.particle.cell,
                              {start.particle.f[0], start.particle.f[1], start.particle.f[2]}};
  const PointStencil stencil(place.fraction(), dx);
  for_each_cotangent(*bar.topology, bar.nodes, place,
                     [&](const Vec3d& n, double m, std::size_t i, std::size_t j, std::size_t k) {
                       out.add_node(stencil, place.fraction(), dx, i, j, k, mass, v, spin, n, m);
                     });
}

}  // namespace

template <class S>
StartCotangents UpdatedAdjoint<S>::start(Arena& arena, std::size_t body,
                                         const UpdatedCotangents<S>& bar) const {
  const Impl& s = *impl_;
  const Body& of = s.scene->bodies[s.members[body].index];
  const UpdatedBodyCotangents<S>& own = bar.bodies[body];
  const Vec3d center = center_of_volume(of);
  std::unique_ptr<TopologyIndex> index;
  if (bar.topology) index = std::make_unique<TopologyIndex>(*bar.topology);
  std::vector<TransferCotangents> particles(of.rest.size());
  arena.parallel_for(0, particles.size(), 256, [&](std::size_t p) {
    particles[p].x = vector_of(own.particles[p].position);
    if (!own.rest.empty()) particles[p].x += own.rest[p];
    particles[p].v = vector_of(own.particles[p].velocity);
    if (index) add_first_transfer(of, p, s.dx, center, *index, bar, particles[p]);
  });
  StartCotangents out;
  out.log_density = own.log_density;
  out.offset = own.pivots;
  out.rotation = own.turn - center.cross(own.pivots);
  add_first_transfers(of, particles, out);
  return out;
}

template <class S>
material::MaterialGradient UpdatedAdjoint<S>::material_gradient(
    std::size_t body, const UpdatedCotangents<S>& bar) const {
  material::MaterialGradient out =
      material::material_gradient(impl_->members[body].material, bar.bodies[body].law.constants);
  out.maxwell = bar.bodies[body].branches;
  out.published = bar.bodies[body].published;
  return out;
}

template <class S>
void UpdatedAdjoint<S>::add_terms(std::size_t body, const UpdatedCotangents<S>& bar,
                                  double density_bar, std::vector<std::vector<double>>& effects,
                                  material::MaterialGradient& material) const {
  impl_->loads->terms().of(body).add_to(bar.bodies[body].terms, density_bar, effects, material);
}

template class UpdatedAdjoint<float>;
template class UpdatedAdjoint<double>;

}  // namespace matterfit::mpm
