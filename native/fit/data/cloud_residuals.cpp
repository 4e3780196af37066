// SPDX-License-Identifier: GPL-3.0-or-later
#include "fit/data/cloud_residuals.hpp"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numbers>
#include <string>
#include <vector>

#include "base/error.hpp"
#include "capture/point_tree.hpp"

namespace matterfit::fit {
namespace {

using Eigen::Index;

/// A ball of so many points, somewhat enlarged: three spacings of points that fill a body. Few
/// points are not smoothed over the whole body.
constexpr std::size_t kNeighbours = 64;
constexpr std::size_t kLeastParts = 8;
constexpr double kEnlarged = 1.2;

/// The finite points of a set, their places in it, and a tree of them.
struct Kept {
  explicit Kept(std::span<const Vec3d> points) : tree(3, cloud, {16}) {
    for (std::size_t i = 0; i < points.size(); ++i) {
      if (!points[i].allFinite()) continue;
      positions.push_back(points[i]);
      indices.push_back(i);
    }
    cloud.points = positions;
    if (!positions.empty()) tree.buildIndex();
  }
  ~Kept() = default;
  Kept(const Kept&) = delete;  // the tree looks at its members
  Kept& operator=(const Kept&) = delete;

  Points positions;
  std::vector<std::size_t> indices;
  capture::PointCloud cloud;
  capture::PointTree<> tree;
};

/// Sums over the points around one: what nanoflann tells of each.
class Around {
 public:
  /// Marks in `met`, if it is not empty, the points within half the reach.
  Around(const Vec3d& centre, const Points& points, double reach, std::span<std::uint8_t> met)
      : centre_(centre), points_(points), squared_reach_(reach * reach), met_(met) {}
  // nanoflann's names
  [[nodiscard]] std::size_t size() const { return count_; }
  [[nodiscard]] bool full() const { return true; }
  [[nodiscard]] double worstDist() const { return squared_reach_; }
  bool addPoint(double squared, std::size_t index) {
    if (squared >= squared_reach_) return true;
    const double root = 1.0 - squared / squared_reach_;
    const double weight = root * root;
    const Vec3d off = points_[index] - centre_;
    ++count_;
    weight_ += weight;
    weight_squares_ += weight * weight;
    sum_ += weight * off;
    spread_ += weight * weight * squared;
    if (squared < nearest_squared_) {
      nearest_squared_ = squared;
      nearest_ = off;
    }
    if (!met_.empty() && squared <= 0.25 * squared_reach_) {
      // Several threads at once set it, all to the same.
      std::atomic_ref(met_[index]).store(1, std::memory_order_relaxed);
    }
    return true;
  }
  [[nodiscard]] bool empty() const { return !(weight_ > 0.0); }
  /// The weighted mean, from the centre.
  [[nodiscard]] Vec3d mean() const { return sum_ / weight_; }
  [[nodiscard]] const Vec3d& nearest() const { return nearest_; }
  /// Variance of a coordinate of mean() where the points are drawn at random.
  [[nodiscard]] double variance() const { return spread_ / (3.0 * weight_ * weight_); }
  /// How many points of equal weight would do as well.
  [[nodiscard]] double effective() const { return weight_ * weight_ / weight_squares_; }

 private:
  const Vec3d& centre_;
  const Points& points_;
  double squared_reach_;
  std::span<std::uint8_t> met_;
  std::size_t count_ = 0;
  double weight_ = 0.0;
  double weight_squares_ = 0.0;
  double spread_ = 0.0;
  double nearest_squared_ = std::numeric_limits<double>::infinity();
  Vec3d sum_ = Vec3d::Zero();
  Vec3d nearest_ = Vec3d::Zero();
};

Around around(const Vec3d& centre, const Kept& set, double reach,
              std::span<std::uint8_t> met = {}) {
  Around result(centre, set.positions, reach, met);
  (void)set.tree.findNeighbors(result, centre.data(), nanoflann::SearchParams());
  return result;
}

struct Neighbour {
  std::size_t index = 0;
  Vec3d off = Vec3d::Zero();  ///< from x to it
};

Neighbour to_nearest(const Vec3d& x, const Kept& set) {
  Neighbour found;
  double squared = 0.0;
  nanoflann::KNNResultSet<double> result(1);
  result.init(&found.index, &squared);
  set.tree.findNeighbors(result, x.data(), nanoflann::SearchParams());
  found.off = set.positions[found.index] - x;
  return found;
}

/// 1 for what is nearer than half the reach, 0 beyond it.
double near_part(double distance, double reach) {
  const double part = std::clamp(2.0 - 2.0 * distance / reach, 0.0, 1.0);
  return part * part * (3.0 - 2.0 * part);
}

double mean_of(const std::vector<double>& values) {
  double sum = 0.0;
  for (const double value : values) sum += value;
  return sum / double(values.size());
}

}  // namespace

CloudScale cloud_scale(std::span<const Vec3d> captured, double noise, Arena& arena) {
  const Kept cloud(captured);
  const std::size_t count = cloud.positions.size();
  if (count == 0) throw_input("a loss between clouds: no captured point is finite.");
  if (!(noise > 0.0) || !std::isfinite(noise)) {
    throw_input("a loss between clouds: the noise is " + std::to_string(noise) +
                " m; expected a length above 0.");
  }
  const std::size_t neighbours =
      std::min(count, std::clamp<std::size_t>(count / kLeastParts, 2, kNeighbours) + 1);
  std::vector<double> radii(count);
  arena.parallel_for(0, count, 64, [&](std::size_t i) {
    std::vector<std::size_t> indices(neighbours);
    std::vector<double> squared(neighbours);
    nanoflann::KNNResultSet<double> result(neighbours);
    result.init(indices.data(), squared.data());
    cloud.tree.findNeighbors(result, cloud.positions[i].data(), nanoflann::SearchParams());
    radii[i] = std::sqrt(squared.back());
  });
  const auto middle = radii.begin() + static_cast<std::ptrdiff_t>(count / 2);
  std::nth_element(radii.begin(), middle, radii.end());
  CloudScale scale;
  scale.reach = std::max(kEnlarged * *middle, noise);
  std::vector<double> variances(count);
  std::vector<double> shares(count);
  arena.parallel_for(0, count, 64, [&](std::size_t i) {
    const Around near = around(cloud.positions[i], cloud, scale.reach);
    variances[i] = near.variance();
    shares[i] = near.effective();
  });
  scale.alike = mean_of(shares);
  scale.sigma = std::sqrt(mean_of(variances) + noise * noise / scale.alike);
  return scale;
}

double mean_length(double sigma) { return std::sqrt(8.0 / std::numbers::pi) * sigma; }

Points cloud_means(std::span<const Vec3d> captured, const CloudScale& scale, Arena& arena) {
  const Kept cloud(captured);
  Points means(captured.size(), Vec3d::Zero());
  arena.parallel_for(0, cloud.positions.size(), 64, [&](std::size_t j) {
    // The point itself is one of them.
    means[cloud.indices[j]] = around(cloud.positions[j], cloud, scale.reach).mean();
  });
  return means;
}

Eigen::VectorXd cloud_residuals(std::span<const Vec3d> simulated, std::span<const Vec3d> captured,
                                std::span<const Vec3d> means, const CloudScale& scale,
                                Arena& arena) {
  const Kept a(simulated);
  const Kept b(captured);
  if (b.positions.empty()) throw_input("a loss between clouds: no captured point is finite.");
  if (simulated.empty()) throw_input("a loss between clouds: there is no simulated point.");
  const auto size = Index(6 * captured.size());
  if (a.positions.size() != simulated.size()) {
    return Eigen::VectorXd::Constant(size, std::numeric_limits<double>::quiet_NaN());
  }
  Eigen::VectorXd residual = Eigen::VectorXd::Zero(size);
  std::vector<std::uint8_t> met(a.positions.size(), 0);
  arena.parallel_for(0, b.positions.size(), 64, [&](std::size_t j) {
    const Vec3d& x = b.positions[j];
    const Around ours = around(x, a, scale.reach, met);
    const Vec3d nearest = ours.empty() ? to_nearest(x, a).off : ours.nearest();
    const double near = near_part(nearest.norm(), scale.reach);
    Vec3d off = (1.0 - near) * nearest;
    if (near > 0.0) off += near * (ours.mean() - means[b.indices[j]]);
    residual.segment<3>(Index(3 * b.indices[j])) = off / scale.sigma;
  });
  std::vector<Neighbour> stray(a.positions.size());
  arena.parallel_for(0, a.positions.size(), 64, [&](std::size_t i) {
    if (met[i] == 0) stray[i] = to_nearest(a.positions[i], b);
  });
  std::vector<double> counts(captured.size(), 0.0);
  for (std::size_t i = 0; i < stray.size(); ++i) {
    if (met[i] != 0) continue;
    const std::size_t place = b.indices[stray[i].index];
    const double far = 1.0 - near_part(stray[i].off.norm(), scale.reach);
    residual.segment<3>(Index(3 * (captured.size() + place))) -= far * stray[i].off;
    counts[place] += 1.0;
  }
  const double each = double(b.positions.size()) / double(a.positions.size());
  for (std::size_t place = 0; place < captured.size(); ++place) {
    if (counts[place] == 0.0) continue;
    residual.segment<3>(Index(3 * (captured.size() + place))) *=
        std::sqrt(each / counts[place]) / scale.sigma;
  }
  return residual;
}

}  // namespace matterfit::fit
