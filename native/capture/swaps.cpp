// SPDX-License-Identifier: GPL-3.0-or-later
#include "capture/swaps.hpp"

#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include "base/error.hpp"

namespace matterfit::capture {
namespace {

/// Tracks that an affine map (12 numbers) needs to be told from three coordinates each.
constexpr std::size_t kLeastTracks = 15;
/// Left out of the map's second fit.
constexpr double kLeftOut = 0.2;
/// An exchange brings the distances from the map to this share at most …
constexpr double kShare = 1.0 / 3.0;
/// … and these are beyond so many times the median of all tracks.
constexpr double kFarOut = 6.0;

/// The step from one sample to the next: of each track that is seen in both, where the others' map
/// takes it and where it is.
class Step {
 public:
  Step(const Tracks& tracks, std::size_t frame) {
    for (std::size_t i = 0; i < tracks.points; ++i) {
      if (!tracks.is_visible(frame - 1, i) || !tracks.is_visible(frame, i)) continue;
      of_.push_back(i);
      before_.push_back(tracks.position(frame - 1, i));
      after_.push_back(tracks.position(frame, i));
    }
    if (of_.size() < kLeastTracks) return;
    std::vector<std::size_t> all(of_.size());
    for (std::size_t k = 0; k < all.size(); ++k) all[k] = k;
    fit(all);
    std::ranges::sort(all, [&](std::size_t a, std::size_t b) { return miss(a, a) < miss(b, b); });
    all.resize(std::max(kLeastTracks, std::size_t((1.0 - kLeftOut) * double(all.size()))));
    fit(all);
    std::vector<double> misses;
    for (std::size_t k = 0; k < of_.size(); ++k) misses.push_back(miss(k, k));
    const auto middle = misses.begin() + std::ptrdiff_t(misses.size() / 2);
    std::nth_element(misses.begin(), middle, misses.end());
    usual_ = *middle;
    known_ = true;
  }

  /// The tracks that change places, the clearest first, each in one pair at most.
  [[nodiscard]] std::vector<std::pair<std::size_t, std::size_t>> exchanged() const {
    std::vector<std::pair<std::size_t, std::size_t>> pairs;
    if (!known_) return pairs;
    std::vector<std::size_t> far;
    for (std::size_t k = 0; k < of_.size(); ++k) {
      if (miss(k, k) > kFarOut * usual_) far.push_back(k);
    }
    struct Pair {
      double left;  ///< share of the distances
      std::size_t a, b;
    };
    std::vector<Pair> found;
    for (std::size_t m = 0; m < far.size(); ++m) {
      for (std::size_t n = m + 1; n < far.size(); ++n) {
        const std::size_t a = far[m];
        const std::size_t b = far[n];
        const double now = std::hypot(miss(a, a), miss(b, b));
        const double then = std::hypot(miss(a, b), miss(b, a));
        if (then < kShare * now) found.push_back({then / now, a, b});
      }
    }
    std::ranges::stable_sort(found, {}, &Pair::left);
    std::vector<bool> taken(of_.size(), false);
    for (const auto& [left, a, b] : found) {
      if (taken[a] || taken[b]) continue;
      taken[a] = taken[b] = true;
      pairs.emplace_back(of_[a], of_[b]);
    }
    return pairs;
  }

 private:
  void fit(const std::vector<std::size_t>& chosen) {
    const auto rows = Eigen::Index(chosen.size());
    Eigen::MatrixXd from(rows, 4);
    Eigen::MatrixXd to(rows, 3);
    for (Eigen::Index r = 0; r < rows; ++r) {
      from.row(r) << before_[chosen[std::size_t(r)]].transpose(), 1.0;
      to.row(r) = after_[chosen[std::size_t(r)]].transpose();
    }
    map_ = from.colPivHouseholderQr().solve(to);
  }

  /// How far track `b` of the later sample is from where track `a` is taken [m].
  [[nodiscard]] double miss(std::size_t a, std::size_t b) const {
    const Eigen::RowVector4d from(before_[a].x(), before_[a].y(), before_[a].z(), 1.0);
    return (from * map_ - after_[b].transpose()).norm();
  }

  std::vector<std::size_t> of_;  ///< tracks
  std::vector<Vec3d> before_;
  std::vector<Vec3d> after_;
  Eigen::Matrix<double, 4, 3> map_ = Eigen::Matrix<double, 4, 3>::Zero();
  double usual_ = 0.0;
  bool known_ = false;
};

}  // namespace

std::vector<Swap> find_swaps(const Tracks& tracks) {
  std::vector<Swap> swaps;
  Tracks right = tracks;
  for (std::size_t frame = 1; frame < tracks.frames(); ++frame) {
    std::vector<Swap> here;
    for (const auto& [a, b] : Step(right, frame).exchanged()) here.push_back({frame, a, b});
    apply_swaps(here, right);
    swaps.insert(swaps.end(), here.begin(), here.end());
  }
  return swaps;
}

void apply_swaps(const std::vector<Swap>& swaps, Tracks& tracks) {
  for (const Swap& swap : swaps) {
    if (swap.frame >= tracks.frames() || swap.first >= tracks.points ||
        swap.second >= tracks.points) {
      throw_input("swaps: sample " + std::to_string(swap.frame) + ", tracks " +
                  std::to_string(swap.first) + " and " + std::to_string(swap.second) +
                  ": the capture has " + std::to_string(tracks.frames()) + " samples of " +
                  std::to_string(tracks.points) + " tracks, counted from 0.");
    }
    for (std::size_t f = swap.frame; f < tracks.frames(); ++f) {
      const std::size_t a = f * tracks.points + swap.first;
      const std::size_t b = f * tracks.points + swap.second;
      std::swap(tracks.positions[a], tracks.positions[b]);
      if (!tracks.visible.empty()) std::swap(tracks.visible[a], tracks.visible[b]);
    }
  }
}

}  // namespace matterfit::capture
