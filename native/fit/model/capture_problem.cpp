// SPDX-License-Identifier: GPL-3.0-or-later
#include "fit/model/capture_problem.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>

#include "fit/data/losses.hpp"
#include "mpm/scene_check.hpp"

namespace matterfit::fit {
namespace {

constexpr double kSlack = 1e-9;  // [s]

constexpr std::uint32_t kMostParts = 8;
constexpr std::size_t kFewestInPart = 8;

/// Numbers below kMostParts, points that lie together alike: halved at the median across the
/// longest side, and again.
std::vector<std::uint32_t> parts_of(const Points& points) {
  std::vector<std::uint32_t> part(points.size(), 0);
  std::vector<std::vector<std::size_t>> groups(1);
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (points[i].allFinite()) groups[0].push_back(i);
  }
  while (groups.size() < kMostParts) {
    std::vector<std::vector<std::size_t>> halves;
    for (std::vector<std::size_t>& group : groups) {
      if (group.size() < 2 * kFewestInPart) return part;
      Eigen::AlignedBox3d box;
      for (const std::size_t i : group) box.extend(points[i]);
      int axis = 0;
      box.sizes().maxCoeff(&axis);
      const auto middle = group.begin() + static_cast<std::ptrdiff_t>(group.size() / 2);
      std::nth_element(group.begin(), middle, group.end(), [&](std::size_t a, std::size_t b) {
        return std::pair(points[a][axis], a) < std::pair(points[b][axis], b);
      });
      halves.emplace_back(group.begin(), middle);
      halves.emplace_back(middle, group.end());
    }
    groups = std::move(halves);
    for (std::size_t g = 0; g < groups.size(); ++g) {
      for (const std::size_t i : groups[g]) part[i] = std::uint32_t(g);
    }
  }
  return part;
}

}  // namespace

Mask used_samples(const std::vector<Run>& runs) {
  Mask mask(runs.size());
  for (std::size_t r = 0; r < runs.size(); ++r) {
    for (const Capture& capture : runs[r].captures) mask[r].push_back(&capture.used);
  }
  return mask;
}

Scope CaptureProblem::scope() const {
  Scope scope;
  scope.until = window_.until;
  if (!plan_.runs.empty()) scope.plan = &plan_;
  return scope;
}

CaptureProblem::CaptureProblem(const Model& model, const std::vector<Run>& runs,
                               std::vector<Parameter> parameters, Loss loss, Window window,
                               Mask mask)
    : model_(model),
      runs_(runs),
      parameters_(std::move(parameters)),
      loss_(loss),
      window_(std::move(window)) {
  for (std::size_t r = 0; r < runs.size(); ++r) {
    if (window_.until[r] < 0.0) continue;
    for (std::size_t c = 0; c < runs[r].captures.size(); ++c) {
      const Capture& capture = runs[r].captures[c];
      if (mask[r][c] == nullptr) continue;
      Part part;
      part.run = r;
      part.capture = c;
      part.mask = mask[r][c];
      for (const std::size_t t : capture.frames_in(*part.mask)) {
        if (capture.input.tracks.times[t] > window_.until[r] + kSlack) break;
        part.frames.push_back(t);
      }
      if (!part.frames.empty()) parts_.push_back(std::move(part));
    }
  }
  Arena arena(model_.threads());
  for (Part& part : parts_) {
    const Capture& capture = capture_of(part);
    for (std::size_t i = 0; i < capture.sigma.size(); ++i) {
      part.deviations.push_back(capture.deviation(i));
    }
    if (loss_ == Loss::kTracks) continue;
    const capture::Tracks& tracks = capture.input.tracks;
    part.scale = capture.cloud_scale(*part.mask);
    for (const std::size_t t : part.frames) {
      Cloud cloud;
      for (const std::size_t i : capture.compared(t, *part.mask)) {
        cloud.points.push_back(tracks.positions[t * tracks.points + i]);
      }
      cloud.means = cloud_means(cloud.points, part.scale, arena);
      part.clouds.push_back(std::move(cloud));
    }
  }
}

std::vector<double> CaptureProblem::physical(const Eigen::VectorXd& point) const {
  std::vector<double> values;
  for (std::size_t k = 0; k < parameters_.size(); ++k) {
    values.push_back(value_within_bounds(parameters_[k], point[Eigen::Index(k)]));
  }
  return values;
}

std::vector<std::optional<Eigen::VectorXd>> CaptureProblem::evaluate(
    const std::vector<Eigen::VectorXd>& points) {
  std::vector<std::vector<double>> values;
  values.reserve(points.size());
  for (const Eigen::VectorXd& point : points) values.push_back(physical(point));
  const auto outcomes = model_.evaluate(values, scope(), progress).outcomes;
  std::vector<std::optional<Eigen::VectorXd>> results(points.size());
  for (std::size_t p = 0; p < points.size(); ++p) {
    if (!outcomes[p]) continue;
    Eigen::VectorXd residual = residuals(*outcomes[p]);
    if (!residual.allFinite()) continue;
    seen_.emplace_back(points[p], rms(residual));
    results[p] = std::move(residual);
  }
  return results;
}

double CaptureProblem::transposed_cost() const {
  return model_.has_gradient() ? model_.gradient_cost() : 0.0;
}

std::vector<std::vector<Points>> CaptureProblem::seen_bars(const Eigen::VectorXd& weights) const {
  std::vector<std::vector<Points>> bars(runs_.size());
  for (std::size_t r = 0; r < runs_.size(); ++r) {
    for (const Capture& capture : runs_[r].captures) {
      bars[r].emplace_back(capture.input.tracks.positions.size(), Vec3d::Zero());
    }
  }
  Eigen::Index at = 0;
  for (const Part& part : parts_) {
    const Capture& capture = capture_of(part);
    const std::size_t points = capture.input.tracks.points;
    for (const std::size_t t : part.frames) {
      for (std::size_t i = 0; i < points; ++i, at += 3) {
        if ((*part.mask)[t * points + i] == 0) continue;
        bars[part.run][part.capture][t * points + i] =
            weights.segment<3>(at) / capture.deviation(i);
      }
    }
  }
  return bars;
}

std::optional<std::vector<double>> CaptureProblem::transposed_published(
    const Eigen::VectorXd& point, const Eigen::VectorXd& weights, const std::string& body) const {
  if (loss_ != Loss::kTracks) return std::nullopt;
  return model_.pull_back_published(physical(point), scope(), seen_bars(weights), body, progress);
}

std::optional<Eigen::VectorXd> CaptureProblem::transposed(const Eigen::VectorXd& point,
                                                          const Eigen::VectorXd& weights) {
  if (!model_.has_gradient()) return std::nullopt;
  const auto sum = model_.pull_back(physical(point), scope(), seen_bars(weights), progress);
  if (!sum) return std::nullopt;
  return natural_gradient(parameters_, point, *sum);
}

Eigen::VectorXd CaptureProblem::residuals(const Outcome& outcome) const {
  std::vector<Eigen::VectorXd> pieces;
  Arena arena(model_.threads());
  for (const Part& part : parts_) {
    const Capture& capture = capture_of(part);
    const capture::Tracks& tracks = capture.input.tracks;
    const SimulatedCapture& simulated = outcome[part.run].captures[part.capture];
    const std::size_t simulated_points = simulated.positions.size() / tracks.frames();
    for (std::size_t k = 0; k < part.frames.size(); ++k) {
      const std::size_t t = part.frames[k];
      const std::span ours(simulated.positions.data() + t * simulated_points, simulated_points);
      if (loss_ == Loss::kTracks) {
        const std::span theirs(tracks.positions.data() + t * tracks.points, tracks.points);
        const std::span used(part.mask->data() + t * tracks.points, tracks.points);
        pieces.push_back(track_residuals(ours, theirs, used, part.deviations, tracks.points));
        continue;
      }
      const Cloud& cloud = part.clouds[k];
      pieces.push_back(cloud_residuals(ours, cloud.points, cloud.means, part.scale, arena));
    }
  }
  Eigen::Index size = 0;
  for (const Eigen::VectorXd& piece : pieces) size += piece.size();
  Eigen::VectorXd residual(size);
  Eigen::Index at = 0;
  for (const Eigen::VectorXd& piece : pieces) {
    residual.segment(at, piece.size()) = piece;
    at += piece.size();
  }
  return residual;
}

std::vector<double> CaptureProblem::distances(const Eigen::VectorXd& residual) const {
  std::vector<double> result;
  Eigen::Index at = 0;
  for (const Part& part : parts_) {
    const Capture& capture = capture_of(part);
    const auto points = Eigen::Index(capture.input.tracks.points);
    for (const std::size_t t : part.frames) {
      const std::vector<std::size_t> seen = capture.compared(t, *part.mask);
      if (loss_ == Loss::kTracks) {
        for (const std::size_t i : seen) {
          const double size = residual.segment<3>(at + Eigen::Index(3 * i)).norm();
          result.push_back(capture.deviation(i) * size);
        }
        at += 3 * points;
        continue;
      }
      for (std::size_t k = 0; k < seen.size(); ++k, at += 3) {
        result.push_back(part.scale.sigma * residual.segment<3>(at).norm());
      }
      at += Eigen::Index(3 * seen.size());  // of what is far off
    }
  }
  return result;
}

double CaptureProblem::rms(const Eigen::VectorXd& residual) const {
  double sum = 0.0;
  const std::vector<double> all = distances(residual);
  for (const double distance : all) sum += distance * distance;
  return all.empty() ? 0.0 : std::sqrt(sum / double(all.size()));
}

double CaptureProblem::rms_seen(const Eigen::VectorXd& point) const {
  for (const auto& [seen, value] : seen_) {
    if (seen == point) return value;
  }
  return std::numeric_limits<double>::quiet_NaN();
}

double CaptureProblem::effective(const Eigen::VectorXd& residual) const {
  if (loss_ != Loss::kTracks) {
    double alone = 0.0;
    for (const Part& part : parts_) {
      for (const Cloud& cloud : part.clouds) {
        alone += 3.0 * double(cloud.points.size()) / part.scale.alike;
      }
    }
    return alone;
  }
  double squares = 0.0;  // of all residuals
  double lagged = 0.0;   // products of neighbours in time
  double means = 0.0;    // squares of a frame's mean, times its points
  double samples = 0.0;
  double pairs = 0.0;
  double frames = 0.0;
  double most_points = 1.0;
  double most_frames = 1.0;
  Eigen::Index at = 0;
  for (const Part& part : parts_) {
    const Capture& capture = capture_of(part);
    const std::size_t points = capture.input.tracks.points;
    most_frames = std::max(most_frames, double(part.frames.size()));
    for (std::size_t k = 0; k < part.frames.size(); ++k) {
      const std::size_t t = part.frames[k];
      Vec3d sum = Vec3d::Zero();
      double count = 0.0;
      for (std::size_t i = 0; i < points; ++i) {
        if ((*part.mask)[t * points + i] == 0) continue;
        const Vec3d r = residual.segment<3>(at + Eigen::Index(3 * i));
        squares += r.squaredNorm();
        sum += r;
        count += 1.0;
        const bool next = k + 1 < part.frames.size() && part.frames[k + 1] == t + 1 &&
                          (*part.mask)[(t + 1) * points + i] != 0;
        if (!next) continue;
        lagged += r.dot(residual.segment<3>(at + Eigen::Index(3 * (points + i))));
        pairs += 1.0;
      }
      at += Eigen::Index(3 * points);
      samples += count;
      means += sum.squaredNorm() / count;
      frames += 1.0;
      most_points = std::max(most_points, count);
    }
  }
  if (!(squares > 0.0)) return 0.0;
  const double variance = squares / samples;
  const double correlation = pairs > 0.0 ? std::clamp(lagged / pairs / variance, 0.0, 0.99) : 0.0;
  const double in_time = std::min(most_frames, (1.0 + correlation) / (1.0 - correlation));
  const double in_frame = std::clamp(means / frames / variance, 1.0, most_points);
  return std::max(3.0, 3.0 * samples / (in_time * in_frame));
}

std::vector<std::uint32_t> CaptureProblem::blocks() const {
  constexpr std::size_t kStretches = 8;
  std::vector<std::uint32_t> result;
  std::uint32_t first = 0;
  for (const Part& part : parts_) {
    const Capture& capture = capture_of(part);
    const bool tracks = loss_ == Loss::kTracks;
    const std::vector<std::uint32_t> octants =
        tracks ? parts_of(capture.input.rest) : std::vector<std::uint32_t>{};
    for (std::size_t k = 0; k < part.frames.size(); ++k) {
      const auto stretch = std::uint32_t(k * kStretches / part.frames.size());
      if (tracks) {
        for (const std::uint32_t octant : octants) {
          result.insert(result.end(), 3, first + kMostParts * stretch + octant);
        }
        continue;
      }
      const std::size_t entries = 6 * part.clouds[k].points.size();
      result.insert(result.end(), entries, first + kMostParts * stretch);
    }
    first += kMostParts * kStretches;
  }
  return result;
}

}  // namespace matterfit::fit
