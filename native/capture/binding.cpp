// SPDX-License-Identifier: GPL-3.0-or-later
#include "capture/binding.hpp"

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "base/cancel_check.hpp"
#include "base/error.hpp"
#include "capture/point_tree.hpp"

namespace matterfit::capture {
namespace {

using Tree = capture::PointTree<std::uint32_t>;

/// Beyond this the fit says more about noise than about the motion.
constexpr double kConditionLimit = 1e-2;  // smallest over largest moment
constexpr double kWeightLimit = 8.0;      // Σ |fitted_p|

struct PointBinding {
  std::vector<std::pair<std::uint32_t, double>> neighbours;  ///< ascending; squared distance
  std::vector<double> weights;
  std::vector<double> fitted;  ///< empty: no good fit
  double nearest = 0.0;
};

Mat3d moment(std::span<const Vec3d> rest, std::span<const std::uint32_t> particles,
             std::span<const double> weights, Vec3d& mean) {
  mean.setZero();
  for (std::size_t k = 0; k < particles.size(); ++k) mean += weights[k] * rest[particles[k]];
  Mat3d result = Mat3d::Zero();
  for (std::size_t k = 0; k < particles.size(); ++k) {
    const Vec3d d = rest[particles[k]] - mean;
    result += weights[k] * d * d.transpose();
  }
  return result;
}

PointBinding bind_point(const Vec3d& point, std::span<const Vec3d> rest, const Tree& tree,
                        double separation, const BindingOptions& options) {
  PointBinding result;
  std::uint32_t nearest_index = 0;
  double nearest_squared = 0.0;
  tree.knnSearch(point.data(), 1, &nearest_index, &nearest_squared);
  result.nearest = std::sqrt(nearest_squared);
  const double radius = std::max(options.radius * separation, result.nearest + 2.0 * separation);
  double radius_squared = radius * radius;
  tree.radiusSearch(point.data(), radius_squared, result.neighbours,
                    nanoflann::SearchParams(32, 0.0F, false));
  if (result.neighbours.size() > options.neighbours) {
    // The kernel ends at the first particle too many, so that weights stay continuous.
    auto cut = result.neighbours.begin() + static_cast<std::ptrdiff_t>(options.neighbours);
    std::nth_element(result.neighbours.begin(), cut, result.neighbours.end(),
                     [](const auto& a, const auto& b) { return a.second < b.second; });
    radius_squared = cut->second;
    std::erase_if(result.neighbours,
                  [&](const auto& pair) { return pair.second >= radius_squared; });
    if (result.neighbours.empty()) {
      // All equally far (a point at the centre of a shell): equal weights.
      tree.radiusSearch(point.data(), radius_squared * (1.0 + 1e-9) + 1e-300, result.neighbours,
                        nanoflann::SearchParams(32, 0.0F, false));
      radius_squared *= 2.0;
    }
  }
  std::sort(result.neighbours.begin(), result.neighbours.end());
  double sum = 0.0;
  for (const auto& [particle, squared] : result.neighbours) {
    const double t = 1.0 - squared / radius_squared;
    result.weights.push_back(t * t * t);
    sum += result.weights.back();
  }
  for (double& weight : result.weights) weight /= sum;

  std::vector<std::uint32_t> particles;
  for (const auto& pair : result.neighbours) particles.push_back(pair.first);
  Vec3d mean;
  const Mat3d moments = moment(rest, particles, result.weights, mean);
  const Eigen::SelfAdjointEigenSolver<Mat3d> eigen(moments, Eigen::EigenvaluesOnly);
  if (eigen.eigenvalues()[0] < kConditionLimit * eigen.eigenvalues()[2] ||
      eigen.eigenvalues()[2] <= 0.0) {
    return result;
  }
  const Vec3d slope = moments.inverse() * (point - mean);
  double magnitude = 0.0;
  for (std::size_t k = 0; k < particles.size(); ++k) {
    result.fitted.push_back(result.weights[k] * (1.0 + slope.dot(rest[particles[k]] - mean)));
    magnitude += std::abs(result.fitted.back());
  }
  if (magnitude > kWeightLimit) result.fitted.clear();
  return result;
}

}  // namespace

MeshBinding::MeshBinding(std::span<const Vec3d> points, std::span<const Vec3d> rest,
                         double separation, const BindingOptions& options, Arena& arena)
    : gradient_(options.gradient),
      points_(points.begin(), points.end()),
      rest_(rest.begin(), rest.end()) {
  if (rest.empty()) throw_input("there are no particles to bind to. Fill the body first.");
  if (rest.size() > std::numeric_limits<std::uint32_t>::max()) {
    throw_input("a body of more than 4294967295 particles cannot be bound to.");
  }
  if (!(separation > 0.0) || !(options.radius > 0.0) || options.neighbours < 4) {
    throw_input(
        "a binding needs a positive particle separation and radius and at least four "
        "neighbours.");
  }
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (!points[i].allFinite()) {
      throw_input("point " + std::to_string(i) + " of the mesh is not a finite position.");
    }
  }
  const capture::PointCloud cloud{rest_};
  const Tree tree(3, cloud, nanoflann::KDTreeSingleIndexAdaptorParams(16));
  std::vector<PointBinding> bindings(points.size());
  arena.parallel_for(0, points.size(), 64, [&](std::size_t i) {
    if (options.interrupter != nullptr && options.interrupter->cancelled()) return;
    bindings[i] = bind_point(points_[i], rest_, tree, separation, options);
  });
  check_cancel(options.interrupter);
  first_.assign(1, 0);
  for (std::size_t i = 0; i < bindings.size(); ++i) {
    const PointBinding& binding = bindings[i];
    has_fit_.push_back(binding.fitted.empty() ? 0 : 1);
    for (std::size_t k = 0; k < binding.weights.size(); ++k) {
      neighbours_.push_back(binding.neighbours[k].first);
      weights_.push_back(static_cast<float>(binding.weights[k]));
      const double fitted = binding.fitted.empty() ? binding.weights[k] : binding.fitted[k];
      fitted_.push_back(static_cast<float>(fitted));
    }
    first_.push_back(neighbours_.size());
    nearest_.push_back(static_cast<float>(binding.nearest));
    if (i == 0 || binding.nearest > farthest_.distance) farthest_ = {i, binding.nearest};
  }
}

std::size_t MeshBinding::count_beyond(double distance) const {
  return static_cast<std::size_t>(
      std::count_if(nearest_.begin(), nearest_.end(),
                    [&](float nearest) { return static_cast<double>(nearest) > distance; }));
}

MeshBinding::Stencil MeshBinding::stencil(std::size_t point) const {
  const std::size_t first = first_[point];
  const std::size_t count = first_[point + 1] - first;
  Stencil result{{neighbours_.data() + first, count}, {weights_.data() + first, count}, {}};
  if (has_fit_[point] != 0) result.fitted = {fitted_.data() + first, count};
  return result;
}

BindingGradient binding_gradient(const mpm::Body& body) {
  return body.material.traits().elastic() ? BindingGradient::kParticle : BindingGradient::kFitted;
}

void MeshBinding::check_size(std::size_t particles, const std::string& name) const {
  if (particles != rest_.size()) {
    throw_input("body '" + name + "' has " + std::to_string(particles) +
                " particles, the mesh was bound to " + std::to_string(rest_.size()) + ".");
  }
}

std::vector<Vec3d> MeshBinding::positions(const ParticleView& state, Arena& arena) const {
  check_size(state.size(), state.name);
  return moved(state.positions, state.deformation_gradients, arena);
}

std::vector<Vec3d> MeshBinding::positions(std::span<const Vec3d> particles,
                                          std::span<const Mat3d> deformation_gradients,
                                          Arena& arena) const {
  check_size(particles.size(), "");
  return moved(particles, deformation_gradients, arena);
}

void MeshBinding::check_bars(std::size_t of_points, std::size_t of_particles,
                             std::size_t of_gradients) const {
  if (of_points != points() || of_particles != particles() || of_gradients != particles()) {
    throw_input("the cotangents of " + std::to_string(of_points) + " points and " +
                std::to_string(of_particles) + " particles are not of a binding of " +
                std::to_string(points()) + " points to " + std::to_string(particles()) +
                " particles.");
  }
}

template <class Vector, class Matrix>
std::vector<Vec3d> MeshBinding::moved(std::span<const Vector> positions,
                                      std::span<const Matrix> deformation_gradients,
                                      Arena& arena) const {
  std::vector<Vec3d> result(points());
  arena.parallel_for(0, points(), 256, [&](std::size_t i) {
    const Stencil s = stencil(i);
    // Sums relative to one particle: weights rounded to float then cost nothing far from the
    // origin.
    const Vec3d origin = positions[s.particles[0]].template cast<double>();
    Vec3d sum = Vec3d::Zero();
    if (gradient_ == BindingGradient::kFitted && !s.fitted.empty()) {
      for (std::size_t k = 0; k < s.particles.size(); ++k) {
        sum += static_cast<double>(s.fitted[k]) *
               (positions[s.particles[k]].template cast<double>() - origin);
      }
    } else {
      for (std::size_t k = 0; k < s.particles.size(); ++k) {
        const std::uint32_t p = s.particles[k];
        Vec3d offset = points_[i] - rest_[p];
        if (!deformation_gradients.empty()) {
          offset = deformation_gradients[p].template cast<double>() * offset;
        }
        sum += static_cast<double>(s.weights[k]) *
               (positions[p].template cast<double>() - origin + offset);
      }
    }
    result[i] = origin + sum;
  });
  return result;
}

void MeshBinding::spread(std::span<const Vec3d> position_bar, std::span<Vec3d> particle_bar,
                         std::span<Mat3d> deformation_gradient_bar) const {
  const bool gradients = !deformation_gradient_bar.empty();
  check_bars(position_bar.size(), particle_bar.size(),
             gradients ? deformation_gradient_bar.size() : particles());
  for (std::size_t i = 0; i < points(); ++i) {
    const Stencil s = stencil(i);
    const bool fitted = gradient_ == BindingGradient::kFitted && !s.fitted.empty();
    const std::span<const float> weights = fitted ? s.fitted : s.weights;
    // Weights are rounded to float; what they miss of 1 hangs on the first particle.
    Vec3d rest = position_bar[i];
    for (std::size_t k = 0; k < s.particles.size(); ++k) {
      const std::uint32_t p = s.particles[k];
      const Vec3d share = static_cast<double>(weights[k]) * position_bar[i];
      particle_bar[p] += share;
      rest -= share;
      if (gradients && !fitted) {
        deformation_gradient_bar[p] += share * (points_[i] - rest_[p]).transpose();
      }
    }
    particle_bar[s.particles[0]] += rest;
  }
}

std::vector<Vec3d> MeshBinding::velocities(const ParticleView& state, Arena& arena) const {
  check_size(state.size(), state.name);
  if (state.velocities.empty()) return std::vector<Vec3d>(points(), Vec3d::Zero());
  return speeds(state.velocities, arena);
}

std::vector<Vec3d> MeshBinding::velocities(std::span<const Vec3d> particles, Arena& arena) const {
  check_size(particles.size(), "");
  return speeds(particles, arena);
}

template <class Vector>
std::vector<Vec3d> MeshBinding::speeds(std::span<const Vector> velocities, Arena& arena) const {
  std::vector<Vec3d> result(points(), Vec3d::Zero());
  arena.parallel_for(0, points(), 256, [&](std::size_t i) {
    const Stencil s = stencil(i);
    const std::span<const float> weights = s.fitted.empty() ? s.weights : s.fitted;
    for (std::size_t k = 0; k < s.particles.size(); ++k) {
      result[i] +=
          static_cast<double>(weights[k]) * velocities[s.particles[k]].template cast<double>();
    }
  });
  return result;
}

std::vector<Vec3d> MeshBinding::gradient_weights(std::size_t point) const {
  const Stencil s = stencil(point);
  const std::vector<double> weights(s.weights.begin(), s.weights.end());
  Vec3d mean;
  const Mat3d inverse = moment(rest_, s.particles, weights, mean).inverse();
  std::vector<Vec3d> result;
  result.reserve(weights.size());
  for (std::size_t k = 0; k < weights.size(); ++k) {
    result.emplace_back(weights[k] * (inverse * (rest_[s.particles[k]] - mean)));
  }
  return result;
}

Mat3d MeshBinding::fitted_gradient(std::size_t point, const ParticleView& state) const {
  const Stencil s = stencil(point);
  const std::vector<Vec3d> weights = gradient_weights(point);
  const Vec3d origin = state.positions[s.particles[0]].cast<double>();
  Mat3d result = Mat3d::Zero();
  for (std::size_t k = 0; k < weights.size(); ++k) {
    result += (state.positions[s.particles[k]].cast<double>() - origin) * weights[k].transpose();
  }
  return result;
}

void MeshBinding::spread_gradients(std::span<const Mat3d> gradient_bar,
                                   std::span<Vec3d> particle_bar,
                                   std::span<Mat3d> deformation_gradient_bar) const {
  check_bars(gradient_bar.size(), particle_bar.size(), deformation_gradient_bar.size());
  for (std::size_t i = 0; i < points(); ++i) {
    const Stencil s = stencil(i);
    if (gradient_ == BindingGradient::kFitted && !s.fitted.empty()) {
      const std::vector<Vec3d> weights = gradient_weights(i);
      for (std::size_t k = 0; k < weights.size(); ++k) {
        const Vec3d share = gradient_bar[i] * weights[k];
        particle_bar[s.particles[k]] += share;
        particle_bar[s.particles[0]] -= share;
      }
    } else {
      for (std::size_t k = 0; k < s.particles.size(); ++k) {
        deformation_gradient_bar[s.particles[k]] +=
            static_cast<double>(s.weights[k]) * gradient_bar[i];
      }
    }
  }
}

std::vector<Mat3d> MeshBinding::deformation_gradients(const ParticleView& state,
                                                      Arena& arena) const {
  check_size(state.size(), state.name);
  std::vector<Mat3d> result(points(), Mat3d::Identity());
  arena.parallel_for(0, points(), 256, [&](std::size_t i) {
    const Stencil s = stencil(i);
    if (gradient_ == BindingGradient::kFitted && !s.fitted.empty()) {
      result[i] = fitted_gradient(i, state);
    } else if (!state.deformation_gradients.empty()) {
      result[i].setZero();
      for (std::size_t k = 0; k < s.particles.size(); ++k) {
        result[i] += static_cast<double>(s.weights[k]) *
                     state.deformation_gradients[s.particles[k]].cast<double>();
      }
    }
  });
  return result;
}

std::vector<Vec3f> to_local(std::span<const Vec3d> world, const Eigen::Affine3d& object_to_world) {
  const Eigen::Affine3d inverse = object_to_world.inverse();
  std::vector<Vec3f> result(world.size());
  for (std::size_t i = 0; i < world.size(); ++i) result[i] = (inverse * world[i]).cast<float>();
  return result;
}

}  // namespace matterfit::capture
