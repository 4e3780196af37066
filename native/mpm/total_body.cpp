// SPDX-License-Identifier: GPL-3.0-or-later
#include "mpm/total_body.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "base/cancel_check.hpp"
#include "base/error.hpp"
#include "mpm/law_kernels.hpp"
#include "mpm/total_block_field.hpp"
#include "mpm/total_node_term.hpp"

namespace matterfit::mpm {
namespace {

/// Amplitude of the noise in the probe for the fastest mode, whose own is 1.
constexpr double kProbeNoise = 0.3;
/// The share of a full node's mass below which nodes move next to nothing of the body. After an
/// impact they run at many times its speed (docs/dev/solids.md).
constexpr double kSeenShare = 0.1;

}  // namespace

template <class S>
TotalBody<S>::TotalBody(const Body& body, const Scene& scene, const Kernels<S>& kernels,
                        const Interrupter* interrupter)
    : name_(body.name),
      density_(body.density),
      law_(material::law_constants<S>(body.material)),
      energy_law_(material::law_constants<double>(body.material)),
      kernels_(&kernels),
      grid_(body, scene, interrupter),
      node_terms_(std::make_unique<TotalNodeTerms>(body, grid_)) {
  displacement_.assign(grid_.node_blocks() * kNodeBlock, 0.0);
  velocity_.assign(grid_.node_blocks() * kNodeBlock, 0.0);
  force_.assign(grid_.blocks() * 3 * kHaloNodes, S(0));
  extremes_.assign(grid_.blocks(), {S(1), S(1)});
  loads_.resize(grid_.blocks());
  block_loads_.resize(grid_.blocks());
  geometry_.assign(grid_.chunks() * 4 * kLanes, S(0));
  for (std::size_t i = 0; i < geometry_.size(); ++i) {
    if (i / kLanes % 4 < 3) geometry_[i] = S(1);  // absent particles sit in the middle of the cell
  }
  full_volume_.assign(grid_.blocks() * kSlabs * kLanes, S(0));
  piece_volume_.assign(grid_.chunks() * kLanes, S(0));
  has_pieces_.assign(grid_.chunks(), 0);
  std::vector<std::size_t> slab_of(grid_.chunks());
  for (std::size_t slab = 0; slab < grid_.blocks() * kSlabs; ++slab) {
    std::fill(slab_of.begin() + grid_.slab_chunks()[slab],
              slab_of.begin() + grid_.slab_chunks()[slab + 1], slab);
  }
  const std::vector<QuadraturePoint>& points = grid_.quadrature();
  for (std::size_t q = 0; q < points.size(); ++q) {
    const std::size_t place = grid_.place(q);
    S* g = geometry_.data() + place / kLanes * (4 * kLanes) + place % kLanes;
    for (std::size_t axis = 0; axis < 3; ++axis)
      g[axis * kLanes] = static_cast<S>(points[q].f[static_cast<int>(axis)]);
    g[3 * kLanes] = static_cast<S>(points[q].volume);
    if (points[q].kind == PointKind::kGauss) {
      full_volume_[slab_of[place / kLanes] * kLanes + place % kLanes] +=
          static_cast<S>(points[q].volume);
    } else if (points[q].kind == PointKind::kPiece) {
      piece_volume_[place] = static_cast<S>(points[q].volume);
      has_pieces_[place / kLanes] = 1;
    }
  }
  if (law_.plastic) plastic_.assign(grid_.chunks() * 10 * kLanes, S(0));
  maxwell_.assign(grid_.chunks() * 12 * kLanes * law_.maxwell_count, S(0));
  acceleration_.assign(displacement_.size(), 0.0);
  free_.assign(displacement_.size(), 0.0);
  check_cancel(interrupter);
  share_masses();
  check_cancel(interrupter);
  if (!law_.plastic) ties_ = std::make_unique<SkinTies>(grid_, density_, node_terms_->deferred());

  check_cancel(interrupter);
  const Vec3d velocity = grid_.axes().transpose() * body.velocity;
  const Vec3d spin = grid_.axes().transpose() * body.spin;
  std::vector<Vec3d> extra(grid_.mass().size(), Vec3d::Zero());
  if (!body.particle_velocities.empty()) {
    NodesOfCell nodes_of(grid_);
    for (const QuadraturePoint& q : points) {
      const std::array<std::uint32_t, 27>& nodes = nodes_of(q.cell);
      const PointStencil s(q.f, grid_.dx());
      const Vec3d momentum =
          density_ * q.volume * (grid_.axes().transpose() * body.particle_velocities[q.particle]);
      for (std::size_t i = 0; i < 27; ++i) {
        extra[nodes[i]] += s.weight(i / 9, i / 3 % 3, i % 3) * momentum;
      }
    }
  }
  for (std::uint32_t n = 0; n < grid_.mass().size(); ++n) {
    Vec3d v = velocity + spin.cross(grid_.node_position(n) - grid_.center_of_mass());
    if (grid_.lumped_mass()[n] > 0.0) v += extra[n] / grid_.lumped_mass()[n];
    set_field_value(velocity_, n, v);
  }
}

template <class S>
TotalBody<S>::~TotalBody() = default;

template <class S>
TotalView<S> TotalBody<S>::view(double dt, bool commit) const {
  TotalView<S> v;
  v.displacement = displacement_.data();
  v.velocity = velocity_.data();
  v.block_nodes = grid_.block_nodes();
  v.slab_chunks = grid_.slab_chunks().data();
  v.geometry = geometry_.data();
  v.full_volume = full_volume_.data();
  v.piece_volume = piece_volume_.data();
  v.has_pieces = has_pieces_.data();
  // History is written by commit alone, and then through a non-const member function.
  v.plastic = plastic_.empty() ? nullptr : const_cast<S*>(plastic_.data());
  v.maxwell = maxwell_.empty() ? nullptr : const_cast<S*>(maxwell_.data());
  v.force = force_.data();
  v.extremes = extremes_.data();
  v.law = law_;
  v.density = static_cast<S>(density_);
  v.dx = static_cast<S>(grid_.dx());
  v.dt = static_cast<S>(dt);
  v.mean_dilatation = !law_.own_volume;
  v.commit = commit;
  return v;
}

template <class S>
void TotalBody<S>::compute_forces(Arena& arena, double dt, bool commit) {
  const TotalView<S> v = view(dt, commit);
  // The stability estimate is of the unforced body, whatever touched it last.
  if (commit) sort_loads();
  const auto forces = total_forces_of(*kernels_, law_.law);
  arena.parallel_for(0, grid_.blocks(), 1, [&](std::size_t b) {
    forces(v, b);
    if (!commit) return;
    apply_loads(b);
    if (node_forces_ != nullptr) {
      node_forces_[b].add_to_halo(force_.data() + b * 3 * kHaloNodes);
    }
  });
}

template <class S>
void TotalBody<S>::sort_loads() {
  for (std::vector<Load>& loads : block_loads_) loads.clear();
  for (const std::vector<Load>& loads : loads_) {
    for (const Load& load : loads) block_loads_[load.point.block].push_back(load);
  }
}

template <class S>
void TotalBody<S>::apply_loads(std::size_t block) {
  S* halo = force_.data() + block * 3 * kHaloNodes;
  for (const Load& load : block_loads_[block]) {
    const PointStencil s(load.point.f, grid_.dx());
    for (std::size_t i = 0; i < 3; ++i)
      for (std::size_t j = 0; j < 3; ++j)
        for (std::size_t k = 0; k < 3; ++k) {
          const double w = s.weight(i, j, k);
          const std::size_t node = halo_index(load.point.x + i, load.point.y + j, load.point.z + k);
          for (std::size_t c = 0; c < 3; ++c) {
            halo[c * kHaloNodes + node] += static_cast<S>(w * load.force[static_cast<int>(c)]);
          }
        }
  }
}

template <class S>
void TotalBody<S>::sum_forces(std::size_t node_block, double* out) const {
  sum_halos(grid_, force_.data(), node_block, out);
}

template <class S>
void TotalBody<S>::sum_internal_forces(std::size_t node_block, double* out) const {
  sum_forces(node_block, out);
  if (ties_) {
    ties_->add_forces(node_block, static_cast<double>(law_.mu), displacement_.data(), out);
  }
}

template <class S>
void TotalBody<S>::step_nodes(Arena& arena, double kick, double dt, const Vec3d& gravity,
                              double time) {
  const Vec3d g = grid_.axes().transpose() * gravity;
  const std::vector<double>& inverse = grid_.inverse_mass();
  const std::vector<std::uint8_t>& deferred = node_terms_->deferred();
  const std::vector<std::uint32_t>& deferred_nodes = node_terms_->deferred_nodes();
  std::vector<Vec3d> deferred_acceleration(deferred_nodes.size());
  arena.parallel_for(0, grid_.node_blocks(), 4, [&](std::size_t b) {
    double* a = acceleration_.data() + b * kNodeBlock;
    sum_internal_forces(b, a);
    const double* inv = inverse.data() + b * kBlockNodes;
    for (std::size_t i = 0; i < kNodeBlock; ++i) a[i] *= inv[i % kBlockNodes];
  });
  for (std::size_t i = 0; i < deferred_nodes.size(); ++i) {
    deferred_acceleration[i] = field_value(acceleration_, deferred_nodes[i]) + g;
  }
  if (kick > 0.0) correct_lumping(arena, acceleration_);
  arena.parallel_for(0, grid_.node_blocks(), 4, [&](std::size_t b) {
    const std::uint8_t* skip = deferred.data() + b * kBlockNodes;
    for (std::size_t c = 0; c < 3; ++c) {
      const std::size_t first = b * kNodeBlock + c * kBlockNodes;
      double* u = displacement_.data() + first;
      double* v = velocity_.data() + first;
      const double* a = acceleration_.data() + first;
      const double gc = g[static_cast<int>(c)];
      for (std::size_t n = 0; n < kBlockNodes; ++n) {
        if (skip[n] != 0) continue;
        // Empty nodes fall with the body: their weight is zero, their value harmless.
        v[n] += kick * (a[n] + gc);
        u[n] += dt * v[n];
      }
    }
  });
  if (node_terms_->any()) {
    node_terms_->step({kick, dt, time, g}, std::move(deferred_acceleration), displacement_,
                      velocity_);
  }
}

template <class S>
void TotalBody<S>::smooth_velocities(Arena& arena, double share) {
  const TotalView<S> v = view(0.0, false);
  arena.parallel_for(0, grid_.blocks(), 1, [&](std::size_t b) { kernels_->total_smooth(v, b); });
  arena.parallel_for(0, grid_.node_blocks(), 4, [&](std::size_t b) {
    double momentum[kNodeBlock];
    sum_forces(b, momentum);
    const double* inverse = grid_.inverse_mass().data() + b * kBlockNodes;
    const double* lumped = grid_.lumped_mass().data() + b * kBlockNodes;
    const std::uint8_t* skip = node_terms_->deferred().data() + b * kBlockNodes;
    for (std::size_t c = 0; c < 3; ++c) {
      for (std::size_t n = 0; n < kBlockNodes; ++n) {
        if (!(inverse[n] > 0.0) || skip[n] != 0) continue;
        double& velocity = velocity_[b * kNodeBlock + c * kBlockNodes + n];
        velocity += share * inverse[n] * (momentum[c * kBlockNodes + n] - lumped[n] * velocity);
      }
    }
  });
}

template <class S>
void TotalBody<S>::share_masses() {
  Arena arena(1);
  multiply_by_mass(arena, std::vector<double>(displacement_.size(), 1.0));
  mass_share_.assign(grid_.mass().size(), 0.0);
  for (std::size_t b = 0; b < grid_.node_blocks(); ++b) {
    double momentum[kNodeBlock];
    sum_forces(b, momentum);
    for (std::size_t n = 0; n < kBlockNodes; ++n) {
      const std::size_t node = b * kBlockNodes + n;
      if (node_terms_->deferred()[node] != 0) continue;
      mass_share_[node] = grid_.inverse_mass()[node] * momentum[n];
    }
  }
}

template <class S>
void TotalBody<S>::multiply_by_mass(Arena& arena, const std::vector<double>& field) {
  const std::vector<double>& inverse = grid_.inverse_mass();
  const std::vector<std::uint8_t>& skip = node_terms_->deferred();
  arena.parallel_for(0, grid_.node_blocks(), 4, [&](std::size_t b) {
    for (std::size_t i = b * kNodeBlock; i < (b + 1) * kNodeBlock; ++i) {
      const std::size_t n = node_of(i);
      free_[i] = inverse[n] > 0.0 && skip[n] == 0 ? field[i] : 0.0;
    }
  });
  TotalView<S> v = view(0.0, false);
  v.velocity = free_.data();
  arena.parallel_for(0, grid_.blocks(), 1, [&](std::size_t b) { kernels_->total_mass(v, b); });
}

template <class S>
void TotalBody<S>::correct_lumping(Arena& arena, std::vector<double>& acceleration) {
  multiply_by_mass(arena, acceleration);
  arena.parallel_for(0, grid_.node_blocks(), 4, [&](std::size_t b) {
    double momentum[kNodeBlock];
    sum_forces(b, momentum);
    const double* inverse = grid_.inverse_mass().data() + b * kBlockNodes;
    const double* share = mass_share_.data() + b * kBlockNodes;
    double* a = acceleration.data() + b * kNodeBlock;
    for (std::size_t i = 0; i < kNodeBlock; ++i) {
      const std::size_t n = i % kBlockNodes;
      if (share[n] > 0.0) a[i] += share[n] * a[i] - inverse[n] * momentum[i];
    }
  });
}

template <class S>
bool TotalBody<S>::held(double time) const {
  return node_terms_->held(time);
}

template <class S>
bool TotalBody<S>::releases_between(double from, double to) const {
  return node_terms_->releases_between(from, to);
}

template <class S>
double TotalBody<S>::stable_time_step(Arena& arena, int iterations,
                                      const Interrupter& interrupter) {
  // Power iteration on M⁻¹K with corrected masses, K w ≈ (f(u) − f(u + εw))/ε. ε keeps the strain
  // of the fastest mode small against one and large against float rounding.
  const std::size_t size = displacement_.size();
  // Noise goes into the last call's mode, so that a mode that has become the fastest since, in
  // another place, is found as well.
  std::vector<double>& mode = mode_;
  mode.resize(size, 0.0);
  double largest = 0.0;
  for (const double m : mode) largest = std::max(largest, std::abs(m));
  const double scale_of_last = largest > 0.0 ? 1.0 / largest : 0.0;
  std::uint64_t random = 0x9e3779b97f4a7c15ULL;
  for (double& m : mode) {
    random = random * 6364136223846793005ULL + 1442695040888963407ULL;
    const double noise = static_cast<double>(random >> 11U) * 0x1p-53 - 0.5;
    m = scale_of_last * m + kProbeNoise * noise;
  }
  const std::vector<double> saved = displacement_;
  const std::vector<double> saved_velocity = velocity_;
  const std::vector<BlockExtremes<S>> saved_extremes = extremes_;
  std::fill(velocity_.begin(), velocity_.end(), 0.0);
  const auto forces = [&] {
    compute_forces(arena, 1.0, false);
    std::vector<double> f(size);
    arena.parallel_for(0, grid_.node_blocks(), 4,
                       [&](std::size_t b) { sum_internal_forces(b, f.data() + b * kNodeBlock); });
    return f;
  };
  const std::vector<double> base = forces();
  const std::vector<double>& inverse = grid_.inverse_mass();
  const std::vector<double>& mass = grid_.mass();
  const auto weight = [&](const std::vector<double>& per_node, std::size_t i) {
    return per_node[node_of(i)];
  };
  double omega_squared = 0.0;
  for (int k = 0; k < iterations; ++k) {
    interrupter.check();
    double peak = 0.0;
    double norm = 0.0;
    for (std::size_t i = 0; i < size; ++i) {
      if (!(weight(mass, i) > 0.0)) mode[i] = 0.0;
      peak = std::max(peak, std::abs(mode[i]));
      norm += mode[i] * mode[i] * weight(mass, i);
    }
    if (!(peak > 0.0)) break;
    const double epsilon = 2e-3 * grid_.dx() / peak;
    for (std::size_t i = 0; i < size; ++i) displacement_[i] = saved[i] + epsilon * mode[i];
    const std::vector<double> f = forces();
    double rayleigh = 0.0;
    double image = 0.0;
    for (std::size_t i = 0; i < size; ++i) {
      const double kw = (base[i] - f[i]) / epsilon;
      rayleigh += mode[i] * kw;
      mode[i] = kw * weight(inverse, i);
    }
    correct_lumping(arena, mode);
    for (std::size_t i = 0; i < size; ++i) image += mode[i] * mode[i] * weight(mass, i);
    // Both converge to the highest frequency; the second, of the corrected masses, is the larger.
    omega_squared = std::max(std::abs(rayleigh) / norm, std::sqrt(std::abs(image) / norm));
    const double scale = 1.0 / std::sqrt(std::max(image, 1e-300));
    for (double& m : mode) m *= scale;
  }
  displacement_ = saved;
  velocity_ = saved_velocity;
  extremes_ = saved_extremes;
  return omega_squared > 0.0 ? 2.0 / std::sqrt(omega_squared) : 1e30;
}

template <class S>
void TotalBody<S>::clear_loads() {
  for (std::vector<Load>& loads : loads_) loads.clear();
  node_forces_ = nullptr;
}

template <class S>
void TotalBody<S>::add_load(std::uint32_t particle, const Place& place, const Vec3d& force) {
  loads_[grid_.block(particle)].push_back({place.cell, grid_.axes().transpose() * force});
}

template <class S>
typename TotalBody<S>::Place TotalBody<S>::place(std::uint32_t particle) const {
  return {grid_.rest(particle), grid_.point_of(particle)};
}

template <class S>
typename TotalBody<S>::Place TotalBody<S>::place(std::uint32_t particle,
                                                 const Vec3d& offset) const {
  const Vec3d rest = grid_.rest(particle) + grid_.axes().transpose() * offset;
  return {rest, grid_.point_in(particle, rest)};
}

template <class S>
void TotalBody<S>::sample(Arena& arena, BodyState& out) const {
  const std::size_t count = grid_.particles();
  out.positions.resize(count);
  out.velocities.resize(count);
  out.deformation_gradients.resize(count);
  out.plastic_strain.resize(plastic_.empty() ? 0 : count);
  arena.parallel_for(0, grid_.blocks(), 1, [&](std::size_t b) {
    for (const std::uint32_t p : grid_.block_particles(b)) {
      const Point at = point(p);
      const PointState now = state(at);
      out.positions[p] = now.position.template cast<float>();
      out.velocities[p] = now.velocity.template cast<float>();
      out.deformation_gradients[p] = deformation_gradient(at).template cast<float>();
      if (!plastic_.empty()) {
        const std::size_t place = grid_.place(grid_.nearest_point(p));
        out.plastic_strain[p] = static_cast<float>(
            plastic_[place / kLanes * (10 * kLanes) + 9 * kLanes + place % kLanes]);
      }
    }
  });
}

template <class S>
BlockExtremes<S> TotalBody<S>::extremes() const {
  BlockExtremes<S> all{S(1), S(1)};
  for (const BlockExtremes<S>& e : extremes_) {
    all.min_volume_ratio = std::min(all.min_volume_ratio, e.min_volume_ratio);
    all.max_volume_ratio = std::max(all.max_volume_ratio, e.max_volume_ratio);
  }
  return all;
}

template <class S>
double TotalBody<S>::max_speed() const {
  const double least = kSeenShare * density_ * grid_.dx() * grid_.dx() * grid_.dx();
  double fastest = 0.0;
  for (std::size_t n = 0; n < grid_.mass().size(); ++n) {
    if (!(grid_.mass()[n] >= least)) continue;
    double sum = 0.0;
    for (std::size_t c = 0; c < 3; ++c) {
      const double v = velocity_[component_of(n, c)];
      sum += v * v;
    }
    if (!(sum <= fastest)) fastest = sum;  // a NaN stays
  }
  return std::sqrt(fastest);
}

template <class S>
double TotalBody<S>::kinetic_energy() const {
  double energy = 0.0;
  for (std::size_t i = 0; i < velocity_.size(); ++i) {
    energy += 0.5 * grid_.mass()[node_of(i)] * velocity_[i] * velocity_[i];
  }
  return energy;
}

template <class S>
void TotalBody<S>::save(ByteWriter& out) const {
  out.put(displacement_);
  out.put(velocity_);
  out.put(plastic_);
  out.put(maxwell_);
  out.put(mode_);
}

template <class S>
void TotalBody<S>::load(ByteReader& in) {
  in.get_same_size(displacement_);
  in.get_same_size(velocity_);
  in.get_same_size(plastic_);
  in.get_same_size(maxwell_);
  in.get(mode_);
}

template <class S>
TotalState<S> TotalBody<S>::record() const {
  return {displacement_, velocity_, plastic_, maxwell_};
}

template <class S>
void TotalBody<S>::restore(const TotalState<S>& state) {
  displacement_ = state.displacement;
  velocity_ = state.velocity;
  plastic_ = state.plastic;
  maxwell_ = state.maxwell;
}

template class TotalBody<float>;
template class TotalBody<double>;

}  // namespace matterfit::mpm
