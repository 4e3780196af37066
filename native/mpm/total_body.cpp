// SPDX-License-Identifier: GPL-3.0-or-later
#include "mpm/total_body.hpp"

#include <algorithm>
#include <cmath>

#include "base/error.hpp"
#include "mpm/halo.hpp"
#include "mpm/spline_weights.hpp"
#include "mpm/total_pins.hpp"

namespace matterfit::mpm {
namespace {

constexpr std::size_t kNodeBlock = 3 * kBlockNodes;

bool takes_mean_dilatation(material::Law law) { return law != material::Law::kDruckerPrager; }

}  // namespace

template <class S>
TotalBody<S>::TotalBody(const Body& body, const Scene& scene, const Kernels<S>& kernels)
    : name_(body.name),
      density_(body.density),
      law_(material::law_constants<S>(body.material)),
      kernels_(&kernels),
      grid_(body, scene),
      pins_(std::make_unique<TotalPins>(body, grid_)) {
  displacement_.assign(grid_.node_blocks() * kNodeBlock, 0.0);
  velocity_.assign(grid_.node_blocks() * kNodeBlock, 0.0);
  force_.assign(grid_.blocks() * 3 * kHaloNodes, S(0));
  extremes_.assign(grid_.blocks(), {S(1), S(1)});
  block_has_force_.assign(grid_.blocks(), 0);
  geometry_.assign(grid_.chunks() * 4 * kLanes, S(0));
  for (std::size_t i = 0; i < geometry_.size(); ++i) {
    if (i / kLanes % 4 < 3) geometry_[i] = S(1);  // absent particles sit in the middle of the cell
  }
  for (std::uint32_t p = 0; p < grid_.particles(); ++p) {
    const Vec3d f = grid_.quadrature_point(p);
    S* g = geometry_.data() + grid_.chunk(p) * (4 * kLanes) + grid_.lane(p);
    for (std::size_t axis = 0; axis < 3; ++axis)
      g[axis * kLanes] = static_cast<S>(f[static_cast<int>(axis)]);
    g[3 * kLanes] = static_cast<S>(grid_.volume(p));
  }
  if (law_.plastic) plastic_.assign(grid_.chunks() * 10 * kLanes, S(0));

  const Vec3d velocity = grid_.axes().transpose() * body.velocity;
  const Vec3d spin = grid_.axes().transpose() * body.spin;
  std::vector<Vec3d> extra(grid_.mass().size(), Vec3d::Zero());
  if (!body.particle_velocities.empty()) {
    for (std::uint32_t p = 0; p < grid_.particles(); ++p) {
      const Vec3i base = grid_.particle_cell(p).first;
      const Vec3d f = grid_.quadrature_point(p);
      const double m = density_ * grid_.volume(p);
      double w[3][3];
      for (int axis = 0; axis < 3; ++axis) quadratic_weights(f[axis], w[axis]);
      for (int i = 0; i < 27; ++i) {
        const Vec3i step(i / 9, i / 3 % 3, i % 3);
        extra[grid_.find_node(base + step)] +=
            w[0][step[0]] * w[1][step[1]] * w[2][step[2]] * m *
            (grid_.axes().transpose() * body.particle_velocities[p]);
      }
    }
  }
  for (std::uint32_t n = 0; n < grid_.mass().size(); ++n) {
    const Vec3d v = velocity + spin.cross(grid_.node_position(n) - grid_.center_of_mass()) +
                    extra[n] * grid_.inverse_mass()[n];
    for (std::size_t c = 0; c < 3; ++c) {
      velocity_[(n / kBlockNodes * 3 + c) * kBlockNodes + n % kBlockNodes] = v[static_cast<int>(c)];
    }
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
  v.block_merges = grid_.merges().empty() ? nullptr : grid_.block_merges().data();
  v.merges = grid_.merges().data();
  v.slab_chunks = grid_.slab_chunks().data();
  v.geometry = geometry_.data();
  // History is written by commit alone, and then through a non-const member function.
  v.plastic = plastic_.empty() ? nullptr : const_cast<S*>(plastic_.data());
  // The stability estimate is of the unforced body, whatever touched it last.
  v.point_force = point_force_.empty() || !commit ? nullptr : point_force_.data();
  v.block_has_force = block_has_force_.data();
  v.force = force_.data();
  v.extremes = extremes_.data();
  v.law = law_;
  v.density = static_cast<S>(density_);
  v.dx = static_cast<S>(grid_.dx());
  v.dt = static_cast<S>(dt);
  v.mean_dilatation = takes_mean_dilatation(law_.law);
  v.commit = commit;
  return v;
}

template <class S>
void TotalBody<S>::compute_forces(Arena& arena, double dt, bool commit) {
  const TotalView<S> v = view(dt, commit);
  arena.parallel_for(0, grid_.blocks(), 1, [&](std::size_t b) { kernels_->total_forces(v, b); });
}

template <class S>
void TotalBody<S>::sum_forces(std::size_t node_block, double* out) const {
  std::fill(out, out + kNodeBlock, 0.0);
  const auto& sources = grid_.node_sources(node_block);
  for (std::size_t k = 0; k < 8; ++k) {
    if (sources[k] == kNoBlock) continue;
    for (std::size_t c = 0; c < 3; ++c) {
      add_halo(k, force_.data() + (sources[k] * 3 + c) * kHaloNodes, out + c * kBlockNodes);
    }
  }
}

template <class S>
void TotalBody<S>::step_nodes(Arena& arena, double kick, double dt, const Vec3d& gravity,
                              double time) {
  const Vec3d g = grid_.axes().transpose() * gravity;
  const std::vector<double>& inverse = grid_.inverse_mass();
  const std::vector<std::uint8_t>& deferred = pins_->deferred();
  const std::vector<std::uint32_t>& deferred_nodes = pins_->deferred_nodes();
  std::vector<Vec3d> deferred_acceleration(deferred_nodes.size());
  arena.parallel_for(0, grid_.node_blocks(), 4, [&](std::size_t b) {
    double force[kNodeBlock];
    sum_forces(b, force);
    const double* inv = inverse.data() + b * kBlockNodes;
    const std::uint8_t* skip = deferred.data() + b * kBlockNodes;
    bool any = false;
    for (std::size_t n = 0; n < kBlockNodes; ++n) any = any || skip[n] != 0;
    if (!any) {
      for (std::size_t c = 0; c < 3; ++c) {
        double* u = displacement_.data() + b * kNodeBlock + c * kBlockNodes;
        double* v = velocity_.data() + b * kNodeBlock + c * kBlockNodes;
        const double* f = force + c * kBlockNodes;
        const double gc = g[static_cast<int>(c)];
        for (std::size_t n = 0; n < kBlockNodes; ++n) {
          // Empty nodes fall with the body: their weight is zero, their value harmless.
          v[n] += kick * (f[n] * inv[n] + gc);
          u[n] += dt * v[n];
        }
      }
      return;
    }
    for (std::size_t n = 0; n < kBlockNodes; ++n) {
      if (skip[n] != 0) {
        const auto node = static_cast<std::uint32_t>(b * kBlockNodes + n);
        const auto i = std::lower_bound(deferred_nodes.begin(), deferred_nodes.end(), node) -
                       deferred_nodes.begin();
        for (std::size_t c = 0; c < 3; ++c) {
          deferred_acceleration[static_cast<std::size_t>(i)][static_cast<int>(c)] =
              force[c * kBlockNodes + n] * inv[n] + g[static_cast<int>(c)];
        }
        continue;
      }
      for (std::size_t c = 0; c < 3; ++c) {
        double& u = displacement_[b * kNodeBlock + c * kBlockNodes + n];
        double& v = velocity_[b * kNodeBlock + c * kBlockNodes + n];
        v += kick * (force[c * kBlockNodes + n] * inv[n] + g[static_cast<int>(c)]);
        u += dt * v;
      }
    }
  });
  if (pins_->any()) {
    pins_->step(kick, dt, time, g, deferred_acceleration, displacement_, velocity_);
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
    const std::uint8_t* skip = pins_->deferred().data() + b * kBlockNodes;
    for (std::size_t c = 0; c < 3; ++c) {
      for (std::size_t n = 0; n < kBlockNodes; ++n) {
        if (!(inverse[n] > 0.0) || skip[n] != 0) continue;
        double& velocity = velocity_[b * kNodeBlock + c * kBlockNodes + n];
        velocity += share * (momentum[c * kBlockNodes + n] * inverse[n] - velocity);
      }
    }
  });
}

template <class S>
bool TotalBody<S>::held(double time) const {
  return pins_->held(time);
}

template <class S>
bool TotalBody<S>::releases_between(double from, double to) const {
  return pins_->releases_between(from, to);
}

template <class S>
double TotalBody<S>::stable_time_step(Arena& arena, int iterations) {
  // Power iteration on M⁻¹K, K w ≈ (f(u) − f(u + εw))/ε. ε keeps the strain of the fastest mode
  // small against one and large against float rounding.
  const std::size_t size = displacement_.size();
  std::vector<double>& mode = mode_;
  if (mode.size() != size) {
    mode.resize(size);
    std::uint64_t state = 0x9e3779b97f4a7c15ULL;
    for (double& m : mode) {
      state = state * 6364136223846793005ULL + 1442695040888963407ULL;
      m = static_cast<double>(state >> 11U) * 0x1p-53 - 0.5;
    }
  }
  const std::vector<double> saved = displacement_;
  const std::vector<double> saved_velocity = velocity_;
  const std::vector<BlockExtremes<S>> saved_extremes = extremes_;
  std::fill(velocity_.begin(), velocity_.end(), 0.0);
  const auto forces = [&] {
    compute_forces(arena, 1.0, false);
    std::vector<double> f(size);
    arena.parallel_for(0, grid_.node_blocks(), 4,
                       [&](std::size_t b) { sum_forces(b, f.data() + b * kNodeBlock); });
    return f;
  };
  const std::vector<double> base = forces();
  const std::vector<double>& inverse = grid_.inverse_mass();
  const std::vector<double>& mass = grid_.mass();
  const auto weight = [&](const std::vector<double>& per_node, std::size_t i) {
    return per_node[i / kNodeBlock * kBlockNodes + i % kBlockNodes];
  };
  double omega_squared = 0.0;
  for (int k = 0; k < iterations; ++k) {
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
      image += mode[i] * kw;
    }
    // |M⁻¹K w|_M/|w|_M bounds the Rayleigh quotient from above and converges to the same.
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
void TotalBody<S>::clear_point_forces(std::size_t block) {
  if (block_has_force_[block] == 0) return;
  const std::size_t begin = grid_.slab_chunks()[block * kSlabs];
  const std::size_t end = grid_.slab_chunks()[(block + 1) * kSlabs];
  std::fill(point_force_.begin() + static_cast<std::ptrdiff_t>(begin * 3 * kLanes),
            point_force_.begin() + static_cast<std::ptrdiff_t>(end * 3 * kLanes), S(0));
  block_has_force_[block] = 0;
}

template <class S>
void TotalBody<S>::allocate_point_forces() {
  if (point_force_.empty()) point_force_.assign(grid_.chunks() * 3 * kLanes, S(0));
}

template <class S>
void TotalBody<S>::add_point_force(std::uint32_t particle, const Vec3d& world_force) {
  const Vec3d f = grid_.axes().transpose() * world_force;
  S* place = point_force_.data() + grid_.chunk(particle) * (3 * kLanes) + grid_.lane(particle);
  for (std::size_t c = 0; c < 3; ++c) place[c * kLanes] += static_cast<S>(f[static_cast<int>(c)]);
  block_has_force_[grid_.block(particle)] = 1;
}

namespace {

/// Weights and gradients of the 27 nodes at f, and where they are in the node arrays.
struct PointStencil {
  double w[3][3];
  double g[3][3];
};

PointStencil point_stencil(const Vec3d& f, double dx) {
  PointStencil s;
  for (int axis = 0; axis < 3; ++axis) {
    quadratic_weights(f[axis], s.w[axis]);
    s.g[axis][0] = -(1.5 - f[axis]) / dx;
    s.g[axis][1] = -2.0 * (f[axis] - 1.0) / dx;
    s.g[axis][2] = (f[axis] - 0.5) / dx;
  }
  return s;
}

/// Calls visit(component-0 index of node, i, j, k) for the 27 nodes of a particle.
template <class Visit>
void visit_nodes(const TotalGrid& grid, std::uint32_t particle, const Visit& visit) {
  const std::uint32_t block = grid.block(particle);
  const std::uint32_t* corners = grid.block_nodes() + block * std::size_t{8};
  const std::uint32_t chunk = grid.chunk(particle);
  const auto& slabs = grid.slab_chunks();
  std::size_t x = 0;
  while (slabs[block * kSlabs + x + 1] <= chunk) ++x;
  const std::size_t y = grid.lane(particle) / 4;
  const std::size_t z = grid.lane(particle) % 4;
  for (std::size_t i = 0; i < 3; ++i)
    for (std::size_t j = 0; j < 3; ++j)
      for (std::size_t k = 0; k < 3; ++k) {
        const std::size_t a = x + i;
        const std::size_t b = y + j;
        const std::size_t c = z + k;
        const std::uint32_t nodes = corners[a / 4 * 4 + b / 4 * 2 + c / 4];
        visit(nodes * kNodeBlock + node_index(a % 4, b % 4, c % 4), i, j, k);
      }
}

}  // namespace

template <class S>
typename TotalBody<S>::PointState TotalBody<S>::state_at(std::uint32_t particle, const Vec3d& f,
                                                         const Vec3d& rest) const {
  const PointStencil s = point_stencil(f, grid_.dx());
  Vec3d u = Vec3d::Zero();
  Vec3d v = Vec3d::Zero();
  visit_nodes(grid_, particle, [&](std::size_t node, std::size_t i, std::size_t j, std::size_t k) {
    const double w = s.w[0][i] * s.w[1][j] * s.w[2][k];
    for (std::size_t c = 0; c < 3; ++c) {
      u[static_cast<int>(c)] += w * displacement_[node + c * kBlockNodes];
      v[static_cast<int>(c)] += w * velocity_[node + c * kBlockNodes];
    }
  });
  return {grid_.to_world(rest + u), grid_.axes() * v};
}

template <class S>
typename TotalBody<S>::PointState TotalBody<S>::point_state(std::uint32_t particle) const {
  const Vec3d& rest = grid_.rest(particle);
  return state_at(particle, grid_.particle_cell(particle).second, rest);
}

template <class S>
typename TotalBody<S>::PointState TotalBody<S>::quadrature_state(std::uint32_t particle) const {
  const Vec3d f = grid_.quadrature_point(particle);
  const Vec3d& rest = grid_.rest(particle);
  return state_at(particle, f, rest + (f - grid_.particle_cell(particle).second) * grid_.dx());
}

template <class S>
double TotalBody<S>::half_size(std::uint32_t particle) const {
  return grid_.in_full_cell(particle) ? (0.5 - 0.5 / std::sqrt(3.0)) * grid_.dx()
                                      : 0.5 * std::cbrt(grid_.volume(particle));
}

template <class S>
Mat3d TotalBody<S>::deformation_gradient(std::uint32_t particle) const {
  const PointStencil s = point_stencil(grid_.particle_cell(particle).second, grid_.dx());
  Mat3d h = Mat3d::Zero();
  visit_nodes(grid_, particle, [&](std::size_t node, std::size_t i, std::size_t j, std::size_t k) {
    const Vec3d g(s.g[0][i] * s.w[1][j] * s.w[2][k], s.w[0][i] * s.g[1][j] * s.w[2][k],
                  s.w[0][i] * s.w[1][j] * s.g[2][k]);
    for (std::size_t c = 0; c < 3; ++c) {
      h.row(static_cast<int>(c)) += displacement_[node + c * kBlockNodes] * g.transpose();
    }
  });
  return grid_.axes() * (Mat3d::Identity() + h) * grid_.axes().transpose();
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
      const PointState state = point_state(p);
      out.positions[p] = state.position.template cast<float>();
      out.velocities[p] = state.velocity.template cast<float>();
      out.deformation_gradients[p] = deformation_gradient(p).template cast<float>();
      if (!plastic_.empty()) {
        out.plastic_strain[p] = static_cast<float>(
            plastic_[grid_.chunk(p) * (10 * kLanes) + 9 * kLanes + grid_.lane(p)]);
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
  double fastest = 0.0;
  for (std::size_t n = 0; n < grid_.mass().size(); ++n) {
    if (!(grid_.mass()[n] > 0.0)) continue;
    double sum = 0.0;
    for (std::size_t c = 0; c < 3; ++c) {
      const double v = velocity_[(n / kBlockNodes * 3 + c) * kBlockNodes + n % kBlockNodes];
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
    energy += 0.5 * grid_.mass()[i / kNodeBlock * kBlockNodes + i % kBlockNodes] * velocity_[i] *
              velocity_[i];
  }
  return energy;
}

template <class S>
Vec3d TotalBody<S>::momentum() const {
  Vec3d sum = Vec3d::Zero();
  for (std::size_t i = 0; i < velocity_.size(); ++i) {
    sum[static_cast<int>(i / kBlockNodes % 3)] +=
        grid_.mass()[i / kNodeBlock * kBlockNodes + i % kBlockNodes] * velocity_[i];
  }
  return grid_.axes() * sum;
}

template <class S>
void TotalBody<S>::save(ByteWriter& out) const {
  out.put(displacement_);
  out.put(velocity_);
  out.put(plastic_);
  out.put(mode_);
}

template <class S>
void TotalBody<S>::load(ByteReader& in) {
  in.get_same_size(displacement_);
  in.get_same_size(velocity_);
  in.get_same_size(plastic_);
  in.get(mode_);
}

template class TotalBody<float>;
template class TotalBody<double>;

}  // namespace matterfit::mpm
