// SPDX-License-Identifier: GPL-3.0-or-later
#include "fit/data/track_motion.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

#include "capture/point_tree.hpp"

namespace matterfit::fit {
namespace {

constexpr std::size_t kMotionNeighbours = 20;
constexpr std::size_t kCandidates = 40;  // some may not be seen
constexpr std::size_t kFewest = 8;
/// Farthest neighbour in spacings: at a corner the neighbours of a whole ball fill an eighth.
constexpr double kOutlierReach = 3.5;
constexpr double kReachOfFlow = 2.6;
/// The least share of a direction in the spread of the neighbours: they must not lie in a plane.
constexpr double kLeastSpread = 0.02;

/// Points among which neighbours are looked for: some of the tracks.
struct Neighbourhood {
  Points points;
  std::vector<std::size_t> number;  ///< of the track
  capture::PointCloud cloud{points};
  capture::PointTree<> tree{3, cloud, nanoflann::KDTreeSingleIndexAdaptorParams(16)};

  Neighbourhood(Points chosen, std::vector<std::size_t> numbers)
      : points(std::move(chosen)), number(std::move(numbers)) {
    if (!points.empty()) tree.buildIndex();
  }
  Neighbourhood(const Neighbourhood&) = delete;
  Neighbourhood& operator=(const Neighbourhood&) = delete;
  ~Neighbourhood() = default;
};

/// f(x) = Σ value f_i and ∇f = Σ f_i gradientᵀ of what the tracks `number` have.
struct Stencil {
  std::size_t count = 0;
  std::array<std::size_t, kMotionNeighbours> number{};
  std::array<double, kMotionNeighbours> value{};
  std::array<Vec3d, kMotionNeighbours> gradient;
};

/// The stencil of the nearest tracks that are `seen(track)`; count 0: too few, or all near one
/// plane.
template <class Seen>
Stencil stencil_at(const Neighbourhood& near, const Vec3d& x, double reach, const Seen& seen) {
  Stencil stencil;
  std::array<std::size_t, kCandidates> found{};
  std::array<double, kCandidates> squared{};
  if (near.points.size() < kFewest) return stencil;
  nanoflann::KNNResultSet<double> result(kCandidates);
  result.init(found.data(), squared.data());
  near.tree.findNeighbors(result, x.data(), nanoflann::SearchParams());
  std::array<Vec3d, kMotionNeighbours> offset;
  std::size_t count = 0;
  double farthest = 0.0;
  for (std::size_t k = 0; k < result.size() && count < kMotionNeighbours; ++k) {
    if (squared[k] > reach * reach) break;
    const std::size_t track = near.number[found[k]];
    if (!seen(track)) continue;
    stencil.number[count] = track;
    offset[count] = near.points[found[k]] - x;
    farthest = std::sqrt(squared[k]);
    ++count;
  }
  if (count < kFewest || !(farthest > 0.0)) return stencil;
  const double radius = 1.1 * farthest;
  Eigen::Matrix4d moments = Eigen::Matrix4d::Zero();
  std::array<Eigen::Vector4d, kMotionNeighbours> rows;
  for (std::size_t k = 0; k < count; ++k) {
    const Vec3d d = offset[k] / radius;
    const double fall = 1.0 - d.squaredNorm();
    const Eigen::Vector4d basis(1.0, d.x(), d.y(), d.z());
    rows[k] = fall * fall * basis;
    moments += rows[k] * basis.transpose();
  }
  const Vec3d mean = moments.block<3, 1>(1, 0) / moments(0, 0);
  const Mat3d spread = moments.block<3, 3>(1, 1) / moments(0, 0) - mean * mean.transpose();
  const Vec3d axes =
      Eigen::SelfAdjointEigenSolver<Mat3d>(spread, Eigen::EigenvaluesOnly).eigenvalues();
  if (!(axes[0] > kLeastSpread * axes[2])) return stencil;
  const Eigen::Matrix4d inverse = moments.inverse();
  for (std::size_t k = 0; k < count; ++k) {
    const Eigen::Vector4d share = inverse * rows[k];
    stencil.value[k] = share[0];
    stencil.gradient[k] = share.tail<3>() / radius;
  }
  stencil.count = count;
  return stencil;
}

class Follower {
 public:
  Follower(const InteriorTracks& tracks, const Points& places, const std::vector<Hat>& hats,
           bool flows, Arena& arena)
      : tracks_(tracks),
        places_(places),
        hats_(hats),
        arena_(arena),
        reach_((flows ? kReachOfFlow : kOutlierReach) * tracks.spacing) {
    const std::size_t q = places.size();
    motion_.positions.resize(tracks.frames() * q);
    motion_.gradients.assign(tracks.frames() * q, Mat3d::Identity());
    motion_.known.assign(tracks.frames() * q, 0);
    motion_.accelerations.assign(hats.size() * q, Vec3d::Zero());
    motion_.known_accelerations.assign(hats.size() * q, 0);
    std::vector<std::size_t> all(tracks.points());
    std::iota(all.begin(), all.end(), std::size_t{0});
    const Neighbourhood rest(tracks.rest, all);
    if (flows) {
      flow(rest);
    } else {
      deform(rest);
    }
  }
  TrackMotion take() { return std::move(motion_); }

 private:
  [[nodiscard]] const Vec3d& track(std::size_t frame, std::size_t i) const {
    return tracks_.positions[frame * tracks_.points() + i];
  }
  [[nodiscard]] bool seen(std::size_t frame, std::size_t i) const {
    return track(frame, i).allFinite();
  }

  void deform(const Neighbourhood& rest) {
    arena_.parallel_for(0, places_.size(), 16, [&](std::size_t q) {
      for (std::size_t t = 0; t < tracks_.frames(); ++t) place_from_rest(rest, t, q);
      for (std::size_t h = 0; h < hats_.size(); ++h) accelerate(rest, places_[q], h, q);
    });
  }

  void flow(const Neighbourhood& rest) {
    for (std::size_t t = 0; t < tracks_.frames(); ++t) {
      Points points;
      std::vector<std::size_t> numbers;
      for (std::size_t i = 0; i < tracks_.points(); ++i) {
        if (!seen(t, i)) continue;
        points.push_back(track(t, i));
        numbers.push_back(i);
      }
      const Neighbourhood now(std::move(points), std::move(numbers));
      arena_.parallel_for(0, places_.size(), 16, [&](std::size_t q) {
        const std::size_t at = t * places_.size() + q;
        if (t == 0) place_from_rest(rest, t, q);
        if (motion_.known[at] == 0) return;
        const Vec3d x = motion_.positions[at];
        for (std::size_t h = 0; h < hats_.size(); ++h) {
          if (hats_[h].centre == t) accelerate(now, x, h, q);
        }
        if (t + 1 < tracks_.frames()) carry(now, t, q);
      });
    }
  }

  void place_from_rest(const Neighbourhood& rest, std::size_t t, std::size_t q) {
    const Stencil s =
        stencil_at(rest, places_[q], reach_, [&](std::size_t i) { return seen(t, i); });
    if (s.count == 0) return;
    // Displacements, so that small strains keep their digits.
    Vec3d shift = Vec3d::Zero();
    Mat3d gradient = Mat3d::Identity();
    for (std::size_t k = 0; k < s.count; ++k) {
      const Vec3d u = track(t, s.number[k]) - tracks_.rest[s.number[k]];
      shift += s.value[k] * u;
      gradient += u * s.gradient[k].transpose();
    }
    set(t, q, places_[q] + shift, gradient);
  }

  void carry(const Neighbourhood& now, std::size_t t, std::size_t q) {
    const std::size_t at = t * places_.size() + q;
    const Vec3d& x = motion_.positions[at];
    const Stencil s = stencil_at(now, x, reach_, [&](std::size_t i) { return seen(t + 1, i); });
    if (s.count == 0) return;
    Vec3d shift = Vec3d::Zero();
    Mat3d step = Mat3d::Identity();
    for (std::size_t k = 0; k < s.count; ++k) {
      const Vec3d u = track(t + 1, s.number[k]) - track(t, s.number[k]);
      shift += s.value[k] * u;
      step += u * s.gradient[k].transpose();
    }
    set(t + 1, q, x + shift, step * motion_.gradients[at]);
  }

  void set(std::size_t t, std::size_t q, const Vec3d& x, const Mat3d& gradient) {
    const std::size_t at = t * places_.size() + q;
    motion_.positions[at] = x;
    motion_.gradients[at] = gradient;
    motion_.known[at] = x.allFinite() && gradient.determinant() > 0.0 ? 1 : 0;
  }

  void accelerate(const Neighbourhood& near, const Vec3d& x, std::size_t h, std::size_t q) {
    const std::size_t now = hats_[h].centre;
    const std::size_t before = now - hats_[h].half;
    const std::size_t after = now + hats_[h].half;
    const Stencil s = stencil_at(near, x, reach_, [&](std::size_t i) {
      return seen(before, i) && seen(now, i) && seen(after, i);
    });
    if (s.count == 0) return;
    Vec3d sum = Vec3d::Zero();
    for (std::size_t k = 0; k < s.count; ++k) {
      const std::size_t i = s.number[k];
      sum += s.value[k] * (track(after, i) - 2.0 * track(now, i) + track(before, i));
    }
    const double dt = 0.5 * (tracks_.times[after] - tracks_.times[before]);
    motion_.accelerations[h * places_.size() + q] = sum / (dt * dt);
    motion_.known_accelerations[h * places_.size() + q] = 1;
  }

  const InteriorTracks& tracks_;
  const Points& places_;
  const std::vector<Hat>& hats_;
  Arena& arena_;
  double reach_;
  TrackMotion motion_;
};

}  // namespace

TrackMotion track_motion(const InteriorTracks& tracks, const Points& places,
                         const std::vector<Hat>& hats, bool flows, Arena& arena) {
  return Follower(tracks, places, hats, flows, arena).take();
}

}  // namespace matterfit::fit
