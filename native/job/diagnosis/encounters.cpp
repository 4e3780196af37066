// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/diagnosis/encounters.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <optional>
#include <utility>

#include "job/diagnosis/seen_tracks.hpp"

namespace matterfit::job {
namespace {

using Eigen::Index;

/// How far above the median of all frames an encounter's missing acceleration is.
constexpr double kFarAbove = 6.0;
/// What counts as a usual one at least, in the largest.
constexpr double kOfLargest = 0.02;
constexpr std::size_t kMost = 2;
/// Frames beside an encounter that belong to it.
constexpr int kNeighbours = 2;
constexpr std::size_t kFewestFrames = 5;
/// Something that lasts: so many frames at least, of which no more than this share of a recording;
/// what the simulation's own contacts do there, in what is missing, at most.
constexpr std::size_t kFewestLasting = 3;
constexpr double kMostLasting = 0.5;
constexpr double kOwnShare = 0.25;

struct Samples : SeenTracks {
  const Eigen::VectorXd& simulated;
  Index first;  ///< of the capture's rows

  [[nodiscard]] Vec3d simulated_at(Index f, Index i) const {
    return simulated.segment<3>(first + 3 * (f * capture.tracks() + i));
  }
};

/// At a frame.
struct Missing {
  Index frame = 0;
  Vec3d acceleration = Vec3d::Zero();  ///< measured − simulated, mean of the tracks [m/s²]
  double own = 0.0;                    ///< size of the simulated one beyond gravity
};

std::vector<Missing> missing_accelerations(const Samples& samples, const Vec3d& gravity) {
  const std::vector<double>& times = samples.capture.times;
  std::vector<Missing> result;
  for (Index f = 1; f + 1 < static_cast<Index>(times.size()); ++f) {
    const auto at = static_cast<std::size_t>(f);
    const double before = times[at] - times[at - 1];
    const double after = times[at + 1] - times[at];
    const auto second = [&](const Vec3d& a, const Vec3d& b, const Vec3d& c) -> Vec3d {
      return 2.0 / (before + after) * ((c - b) / after - (b - a) / before);
    };
    Missing missing;
    missing.frame = f;
    Vec3d own = Vec3d::Zero();
    double count = 0.0;
    for (Index i = 0; i < samples.capture.tracks(); ++i) {
      if (!samples.used(f - 1, i) || !samples.used(f, i) || !samples.used(f + 1, i)) continue;
      const Vec3d simulated = second(samples.simulated_at(f - 1, i), samples.simulated_at(f, i),
                                     samples.simulated_at(f + 1, i));
      missing.acceleration +=
          second(samples.at(f - 1, i), samples.at(f, i), samples.at(f + 1, i)) - simulated;
      own += simulated - gravity;
      count += 1.0;
    }
    if (!(count > 0.0)) continue;
    missing.acceleration /= count;
    missing.own = own.norm() / count;
    result.push_back(missing);
  }
  return result;
}

Encounter encounter_at(const Samples& samples, const Missing& missing) {
  Encounter found;
  found.normal = missing.acceleration.normalized();
  // The frame before may have seen the beginning.
  found.time = samples.capture.times[static_cast<std::size_t>(missing.frame - 1)];
  double nearest = 1e300;
  double passed = 1e300;
  for (Index f = 0; f < static_cast<Index>(samples.capture.times.size()); ++f) {
    for (Index i = 0; i < samples.capture.tracks(); ++i) {
      if (!samples.used(f, i)) continue;
      passed = std::min(passed, samples.simulated_at(f, i).dot(found.normal));
      if (std::abs(f - missing.frame) > 1) continue;
      const double along = samples.at(f, i).dot(found.normal);
      if (along < nearest) {
        nearest = along;
        found.point = samples.at(f, i);
      }
    }
  }
  // One that was fitted to before and after together may turn earlier.
  found.reach = std::max(0.0, nearest - passed);
  return found;
}

/// The run of frames about the most that is missing that are pushed half as much that way, where it
/// lasts.
std::optional<Encounter> lasting_at(const Samples& samples, const std::vector<Missing>& missing,
                                    double usual) {
  const auto most =
      std::ranges::max_element(missing, {}, [](const Missing& m) { return m.acceleration.norm(); });
  const double size = most->acceleration.norm();
  if (size < kFarAbove * usual) return std::nullopt;
  const Vec3d way = most->acceleration / size;
  const auto along = [&](std::size_t k) { return missing[k].acceleration.dot(way) / size; };
  std::size_t first = std::size_t(most - missing.begin());
  std::size_t last = first;
  const auto next = [&](std::size_t k) { return missing[k + 1].frame == missing[k].frame + 1; };
  while (first > 0 && next(first - 1) && along(first - 1) > 0.5) --first;
  while (last + 1 < missing.size() && next(last) && along(last + 1) > 0.5) ++last;
  const std::size_t count = last - first + 1;
  if (count < kFewestLasting || double(count) > kMostLasting * double(missing.size())) {
    return std::nullopt;
  }
  for (std::size_t k = first > 0 ? first - 1 : 0; k <= std::min(last + 1, missing.size() - 1);
       ++k) {
    if (missing[k].own > kOwnShare * size) return std::nullopt;
  }
  const std::vector<double>& times = samples.capture.times;
  const auto time = [&](std::size_t k) { return times[std::size_t(missing[k].frame)]; };
  // Where it is half, between a frame that is pushed and one that is not.
  const auto halfway = [&](std::size_t in, std::size_t out) {
    const double share = (along(in) - 0.5) / std::max(along(in) - along(out), 1e-9);
    return time(in) + share * (time(out) - time(in));
  };
  Encounter found;
  found.normal = way;
  found.time = first > 0 ? halfway(first, first - 1) : times[std::size_t(missing[first].frame) - 1];
  const double end = last + 1 < missing.size() ? halfway(last, last + 1)
                                               : times[std::size_t(missing[last].frame) + 1];
  found.lasts = end - found.time;
  const auto place = [&](std::size_t k) {
    Vec3d sum = Vec3d::Zero();
    double seen = 0.0;
    for (Index i = 0; i < samples.capture.tracks(); ++i) {
      if (!samples.used(missing[k].frame, i)) continue;
      sum += samples.at(missing[k].frame, i);
      seen += 1.0;
    }
    return Vec3d(sum / std::max(seen, 1.0));
  };
  found.point = place(first + count / 2);
  found.reach = (place(last) - place(first)).norm() * double(count) / double(count - 1);
  return found;
}

}  // namespace

std::vector<Encounter> encounters(const std::vector<diagnose::Capture>& captures,
                                  const Eigen::VectorXd& simulated, const Vec3d& gravity) {
  std::vector<std::pair<double, Encounter>> found;
  std::optional<Encounter> lasting;
  Index first = 0;
  for (const diagnose::Capture& capture : captures) {
    const Samples samples{{capture}, simulated, first};
    first += 3 * capture.samples();
    std::vector<Missing> missing = missing_accelerations(samples, gravity);
    if (missing.size() < kFewestFrames) continue;
    const std::vector<Missing> in_order = missing;
    std::ranges::stable_sort(missing, std::greater<>(),
                             [](const Missing& m) { return m.acceleration.norm(); });
    const double usual = std::max(missing[missing.size() / 2].acceleration.norm(),
                                  kOfLargest * missing.front().acceleration.norm());
    if (!lasting) lasting = lasting_at(samples, in_order, usual);
    std::vector<Index> taken;
    for (const Missing& m : missing) {
      const double size = m.acceleration.norm();
      if (size < kFarAbove * usual || taken.size() >= kMost) break;
      if (size < m.own) continue;
      if (std::ranges::any_of(taken, [&](Index f) { return std::abs(f - m.frame) <= kNeighbours; }))
        continue;
      taken.push_back(m.frame);
      found.emplace_back(size / std::max(usual, 1e-12), encounter_at(samples, m));
    }
  }
  std::ranges::stable_sort(found, std::greater<>(), [](const auto& f) { return f.first; });
  if (found.size() > kMost) found.resize(kMost);
  std::vector<Encounter> result;
  result.reserve(found.size());
  for (const auto& [clear, encounter] : found) result.push_back(encounter);
  if (lasting) result.push_back(*lasting);
  return result;
}

}  // namespace matterfit::job
