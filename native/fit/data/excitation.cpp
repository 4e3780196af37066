// SPDX-License-Identifier: GPL-3.0-or-later
#include "fit/data/excitation.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <vector>

#include "base/error.hpp"

namespace matterfit::fit {
namespace {

constexpr double kMost = 0.95;
constexpr double kLargestStrain = 1.0;
constexpr double kLargestVolumeStrain = 0.5;
/// Below, a comparison of laws has nothing to see.
constexpr double kLeastStrain = 0.01;
constexpr double kLeastRate = 1e-3;  // [1/s]

}  // namespace

double within(std::vector<double>& values, double share) {
  if (values.empty()) return 0.0;
  const auto at = static_cast<std::ptrdiff_t>(share * double(values.size() - 1));
  std::nth_element(values.begin(), values.begin() + at, values.end());
  return values[static_cast<std::size_t>(at)];
}

std::optional<material::Excitation> excitation(const InteriorTracks& tracks, const Points& places,
                                               bool flows, Arena& arena) {
  if (tracks.frames() < 2) {
    throw_input("strains cannot be estimated from fewer than two frames.");
  }
  const TrackMotion motion = track_motion(tracks, places, {}, flows, arena);
  std::vector<double> shapes;
  std::vector<double> volumes;
  std::vector<double> rates;
  const std::size_t count = places.size();
  for (std::size_t t = 0; t < tracks.frames(); ++t) {
    for (std::size_t q = 0; q < count; ++q) {
      const std::size_t at = t * count + q;
      const Mat3d& f = motion.gradients[at];
      if (motion.known[at] == 0 || !(f.determinant() > 0.0)) continue;
      const Eigen::SelfAdjointEigenSolver<Mat3d> stretch(f.transpose() * f, Eigen::EigenvaluesOnly);
      const Vec3d strain = 0.5 * stretch.eigenvalues().array().log();
      shapes.push_back((strain.array() - strain.mean()).matrix().norm());
      volumes.push_back(strain.sum());
      if (t == 0 || motion.known[at - count] == 0) continue;
      const Mat3d& before = motion.gradients[at - count];
      if (!(before.determinant() > 0.0)) continue;
      Mat3d rate = f * before.inverse() - Mat3d::Identity();
      rate = Mat3d(0.5 * (rate + rate.transpose()));
      rate -= rate.trace() / 3.0 * Mat3d::Identity();
      rates.push_back(rate.norm() / (tracks.times[t] - tracks.times[t - 1]));
    }
  }
  if (shapes.empty() || rates.empty()) return std::nullopt;
  material::Excitation over;
  over.strain = std::clamp(within(shapes, kMost), kLeastStrain, kLargestStrain);
  over.compression = std::clamp(-within(volumes, 1.0 - kMost), 0.0, kLargestVolumeStrain);
  over.expansion = std::clamp(within(volumes, kMost), 0.0, kLargestVolumeStrain);
  over.slowest = std::max(within(rates, 0.5), kLeastRate);
  over.fastest = std::max(within(rates, kMost), over.slowest);
  return over;
}

}  // namespace matterfit::fit
