// SPDX-License-Identifier: GPL-3.0-or-later
#include "bake/flow_kernels.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

namespace matterfit::bake {
namespace {

constexpr double kReach = 3.0;      // of a neighbourhood, in separations
constexpr double kCentring = 0.9;   // λ
constexpr double kFewest = 6.0;     // neighbours that span a shape, itself among them
constexpr double kFlattest = 0.15;  // a variance, of the largest
// Half a separation is the voxel of a surface: what is thinner has holes.
constexpr double kThinnest = 0.6;
constexpr double kWidest = 2.0;

/// Particles sorted into cells as wide as a neighbourhood reaches.
class Neighbours {
 public:
  Neighbours(const capture::ParticleView& body, double reach)
      : positions_(body.positions), reach_(reach) {
    entries_.resize(body.size());
    for (std::size_t i = 0; i < body.size(); ++i) {
      entries_[i] = {cell(i), static_cast<std::uint32_t>(i)};
    }
    std::sort(entries_.begin(), entries_.end());
  }

  /// Calls `visit(j, weight)` for each particle within reach of particle i, itself among them.
  template <class Visit>
  void each(std::size_t i, const Visit& visit) const {
    const Cell middle = cell(i);
    const Vec3d place = positions_[i].cast<double>();
    for (std::int64_t x = middle[0] - 1; x <= middle[0] + 1; ++x) {
      for (std::int64_t y = middle[1] - 1; y <= middle[1] + 1; ++y) {
        const Entry first{{x, y, middle[2] - 1}, 0};
        for (auto entry = std::lower_bound(entries_.begin(), entries_.end(), first);
             entry != entries_.end() && entry->cell[0] == x && entry->cell[1] == y &&
             entry->cell[2] <= middle[2] + 1;
             ++entry) {
          const double away = (positions_[entry->particle].cast<double>() - place).norm() / reach_;
          if (away < 1.0) visit(entry->particle, 1.0 - away * away * away);
        }
      }
    }
  }

 private:
  using Cell = std::array<std::int64_t, 3>;
  struct Entry {
    Cell cell;
    std::uint32_t particle;
    bool operator<(const Entry& other) const {
      return cell != other.cell ? cell < other.cell : particle < other.particle;
    }
  };

  [[nodiscard]] Cell cell(std::size_t i) const {
    Cell result;
    for (int k = 0; k < 3; ++k) {
      constexpr double kFarthest = 1e15;  // beyond it all lie in one cell, and are refused later
      result[k] = std::llround(
          std::clamp(std::floor(double(positions_[i][k]) / reach_), -kFarthest, kFarthest));
    }
    return result;
  }

  std::span<const Vec3f> positions_;
  double reach_;
  std::vector<Entry> entries_;
};

Mat3d flow_shape(const Mat3d& covariance) {
  const Eigen::SelfAdjointEigenSolver<Mat3d> solver(covariance);
  const double largest = solver.eigenvalues()[2];
  if (!(largest > 0.0)) return Mat3d::Identity();
  const Vec3d variances = solver.eigenvalues().cwiseMax(kFlattest * largest);
  const Vec3d stretches =
      (variances / std::cbrt(variances.prod())).cwiseMax(kThinnest).cwiseMin(kWidest);
  return solver.eigenvectors() * stretches.asDiagonal() * solver.eigenvectors().transpose();
}

}  // namespace

FlowKernels flow_kernels(const capture::ParticleView& body, Arena& arena,
                         const Interrupter& interrupter) {
  const std::size_t count = body.size();
  const Neighbours neighbours(body, kReach * body.separation);
  FlowKernels result{std::vector<Vec3d>(count), std::vector<Mat3d>(count, Mat3d::Identity())};
  std::vector<Vec3d> towards(count, Vec3d::Zero());  // the mean of the neighbours
  arena.parallel_for(0, count, 256, [&](std::size_t i) {
    if (interrupter.cancelled()) return;
    const Vec3d place = body.positions[i].cast<double>();
    double weights = 0.0;
    double near = 0.0;
    Vec3d mean = Vec3d::Zero();
    Mat3d squares = Mat3d::Zero();
    neighbours.each(i, [&](std::size_t j, double weight) {
      const Vec3d away = body.positions[j].cast<double>() - place;
      weights += weight;
      near += 1.0;
      mean += weight * away;
      squares += weight * away * away.transpose();
    });
    if (near < kFewest) return;
    mean /= weights;
    towards[i] = mean;
    result.shapes[i] = flow_shape(squares / weights - mean * mean.transpose());
  });
  interrupter.check();
  arena.parallel_for(0, count, 256, [&](std::size_t i) {
    if (interrupter.cancelled()) return;
    double weights = 0.0;
    Vec3d mean = Vec3d::Zero();
    neighbours.each(i, [&](std::size_t j, double weight) {
      weights += weight;
      mean += weight * towards[j];
    });
    result.centres[i] = body.positions[i].cast<double>();
    if (weights > 0.0) result.centres[i] += kCentring * (towards[i] - mean / weights);
  });
  interrupter.check();
  return result;
}

}  // namespace matterfit::bake
