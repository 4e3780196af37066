// SPDX-License-Identifier: GPL-3.0-or-later
#include "diagnose/gain.hpp"

#include <Eigen/QR>
#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <tuple>

#include "diagnose/random.hpp"

namespace matterfit::diagnose {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

int axes_of(const Capture& capture) { return int(std::ranges::count(capture.axes, true)); }

/// Sums of one block.
struct Block {
  double before = 0.0;
  double after = 0.0;
  double samples = 0.0;
};

double relative_gain(double before, double after, double floor) {
  const double excess = before - floor;
  if (!(excess > 0.0)) return 0.0;
  return std::clamp((before - after) / excess, -1.0, 1.0);
}

/// The tracks of which a sample is used or held out; all where no sample has a use.
std::vector<std::size_t> tracks_looked_at(const Capture& capture) {
  const std::size_t count = capture.rest.size();
  std::vector<bool> seen(count, capture.use.empty());
  for (std::size_t i = 0; i < capture.use.size(); ++i) {
    if (capture.use[i] != Use::kIgnored) seen[i % count] = true;
  }
  std::vector<std::size_t> tracks;
  for (std::size_t i = 0; i < count; ++i) {
    if (seen[i]) tracks.push_back(i);
  }
  return tracks;
}

/// Regions of tracks, and the axis along which each bit of their numbers divides the body.
struct BodySplit {
  std::vector<int> region;
  std::vector<std::size_t> axes;
};

BodySplit split_body(const Capture& capture) {
  BodySplit split;
  std::vector<int>& region = split.region;
  region.assign(capture.rest.size(), 0);
  // The place on the body of a track that is never looked at need not be known.
  const std::vector<std::size_t> tracks = tracks_looked_at(capture);
  const std::size_t count = tracks.size();
  std::array<double, 3> low{1e300, 1e300, 1e300};
  std::array<double, 3> high{-1e300, -1e300, -1e300};
  for (const std::size_t track : tracks) {
    const Vec3d& x = capture.rest[track];
    for (std::size_t a = 0; a < 3; ++a) {
      low[a] = std::min(low[a], x[Index(a)]);
      high[a] = std::max(high[a], x[Index(a)]);
    }
  }
  const double longest = std::max({high[0] - low[0], high[1] - low[1], high[2] - low[2]});
  std::vector<std::size_t> axes{0, 1, 2};
  std::ranges::stable_sort(
      axes, [&](std::size_t a, std::size_t b) { return high[a] - low[a] > high[b] - low[b]; });
  int regions = 1;
  for (const std::size_t axis : axes) {
    if (high[axis] - low[axis] < 0.25 * longest || std::size_t(regions) * 8 > count) continue;
    std::vector<double> values;
    values.reserve(count);
    for (const std::size_t track : tracks) values.push_back(capture.rest[track][Index(axis)]);
    const auto middle = values.begin() + std::ptrdiff_t(count / 2);
    std::nth_element(values.begin(), middle, values.end());
    for (const std::size_t i : tracks) {
      if (capture.rest[i][Index(axis)] >= *middle) region[i] += regions;
    }
    regions *= 2;
    split.axes.push_back(axis);
  }
  return split;
}

}  // namespace

std::vector<int> body_regions(const Capture& capture) { return split_body(capture).region; }

std::vector<std::string> region_names(const Capture& capture) {
  const std::vector<std::size_t> axes = split_body(capture).axes;
  if (axes.empty()) return {"all"};
  std::vector<std::string> names(std::size_t(1) << axes.size());
  for (std::size_t n = 0; n < names.size(); ++n) {
    for (std::size_t a = 0; a < 3; ++a) {
      const auto place = std::ranges::find(axes, a);
      if (place == axes.end()) continue;
      const bool beyond = (n >> std::size_t(place - axes.begin())) & 1U;
      names[n] += std::string(names[n].empty() ? "" : " ") + (beyond ? "+" : "−") + "xyz"[a];
    }
  }
  return names;
}

double root_mean_square(const Rows& rows, const VectorXd& residual) {
  // A sample has a row an axis; distances are over samples.
  std::map<std::tuple<int, Index>, int> axes;
  for (const Series& series : rows.series()) ++axes[{series.capture, series.track}];
  double samples = 0.0;
  for (const Series& series : rows.series()) {
    samples += double(series.end - series.begin) / axes[{series.capture, series.track}];
  }
  return samples > 0.0 ? std::sqrt(residual.squaredNorm() / samples) : 0.0;
}

VectorXd noise_sizes(const Rows& rows, const Noise& noise, const MatrixXd& solver) {
  VectorXd size(rows.size());
  for (const Series& series : rows.series()) {
    const TrackNoise& track = noise.captures[std::size_t(series.capture)];
    const double own = track.sigma * track.sigma + track.common_sigma * track.common_sigma +
                       track.place_sigma * track.place_sigma;
    for (Index i = series.begin; i < series.end; ++i) {
      size[i] = std::sqrt(own + solver.row(i).squaredNorm());
    }
  }
  return size;
}

double noise_floor(const Rows& rows, const Noise& noise, const MatrixXd& solver) {
  return root_mean_square(rows, noise_sizes(rows, noise, solver));
}

Gain gain(const Rows& rows, const std::vector<Capture>& captures, const HeldOut& residuals,
          double floor, const GainOptions& options) {
  Gain result;
  result.floor = floor;
  if (rows.size() == 0) return result;
  result.before = root_mean_square(rows, residuals.before);
  result.after = root_mean_square(rows, residuals.after);
  result.last_residual = root_mean_square(rows, residuals.last_residual);
  result.free_field = root_mean_square(rows, residuals.free_field);
  result.value = relative_gain(result.before, result.after, floor);

  std::vector<std::vector<int>> regions;
  regions.reserve(captures.size());
  for (const Capture& capture : captures) regions.push_back(body_regions(capture));
  std::vector<std::pair<double, double>> span(captures.size(), {1e300, -1e300});
  for (const Series& series : rows.series()) {
    auto& [first, last] = span[std::size_t(series.capture)];
    first = std::min(first, rows.time(series.begin));
    last = std::max(last, rows.time(series.end - 1));
  }
  std::map<std::tuple<int, int, int>, Block> blocks;
  for (const Series& series : rows.series()) {
    const std::size_t c = std::size_t(series.capture);
    const auto [first, last] = span[c];
    for (Index i = series.begin; i < series.end; ++i) {
      const double u = last > first ? (rows.time(i) - first) / (last - first) : 0.0;
      const int time = std::min(int(u * options.time_blocks), options.time_blocks - 1);
      Block& block = blocks[{series.capture, time, regions[c][std::size_t(series.track)]}];
      block.before += residuals.before[i] * residuals.before[i];
      block.after += residuals.after[i] * residuals.after[i];
      block.samples += 1.0 / axes_of(captures[c]);
    }
  }
  std::vector<Block> list;
  list.reserve(blocks.size());
  for (const auto& [key, block] : blocks) list.push_back(block);
  std::vector<double> gains;
  std::vector<double> excess;
  for (int draw = 0; draw < options.draws; ++draw) {
    Random random(options.seed, std::uint64_t(draw));
    Block sum;
    for (std::size_t k = 0; k < list.size(); ++k) {
      const Block& block = list[random.below(list.size())];
      sum.before += block.before;
      sum.after += block.after;
      sum.samples += block.samples;
    }
    const double before = std::sqrt(sum.before / sum.samples);
    gains.push_back(relative_gain(before, std::sqrt(sum.after / sum.samples), floor));
    excess.push_back(before);
  }
  std::ranges::sort(gains);
  std::ranges::sort(excess);
  result.low = gains[std::size_t(0.025 * double(gains.size() - 1))];
  result.high = gains[std::size_t(0.975 * double(gains.size() - 1))];
  // The floor is itself an estimate: an excess of less than a tenth of it is none.
  result.measurable =
      list.size() >= 2 && excess[std::size_t(0.025 * double(excess.size() - 1))] > 1.1 * floor;
  return result;
}

void add_by_block(const Rows& rows, const std::vector<Capture>& captures, const VectorXd& white,
                  std::map<BlockKey, double>& sums) {
  constexpr int kTimes = 4;
  const bool whole = captures.size() >= 5;
  std::vector<std::vector<int>> regions;
  regions.reserve(captures.size());
  for (const Capture& capture : captures) regions.push_back(body_regions(capture));
  for (const Series& series : rows.series()) {
    const std::size_t c = std::size_t(series.capture);
    const Index frames = Index(captures[c].times.size());
    for (Index i = series.begin; i < series.end; ++i) {
      const int time = whole ? 0 : int(kTimes * rows.frame(i) / frames);
      const int region = whole ? 0 : regions[c][std::size_t(series.track)];
      sums[{series.capture, time, region}] += white[i] * white[i];
    }
  }
}

VectorXd keep_last_residual(const Study& study, const VectorXd& stacked) {
  const Rows& used = study.used();
  const Rows& held = study.held();
  std::map<std::tuple<int, Index, int>, double> own;
  std::map<int, std::pair<double, double>> mean;
  for (const Series& series : used.series()) {
    const double last = stacked[series.end - 1];
    own[{series.capture, series.track, series.axis}] = last;
    mean[series.axis].first += last;
    mean[series.axis].second += 1.0;
  }
  VectorXd result = stacked.tail(held.size());
  for (const Series& series : held.series()) {
    const auto found = own.find({series.capture, series.track, series.axis});
    const auto& [sum, count] = mean[series.axis];
    const double last = found != own.end() ? found->second : (count > 0.0 ? sum / count : 0.0);
    result.segment(series.begin, series.end - series.begin).array() -= last;
  }
  return result;
}

VectorXd free_field_residual(const Study& study, const VectorXd& stacked, const MatrixXd& theta,
                             const VectorXd& precision,
                             const std::function<MatrixXd(const MatrixXd&)>& white, int numbers) {
  const std::vector<Capture>& captures = study.model().captures();
  const Index used = study.used().size();
  MatrixXd field = MatrixXd::Zero(study.size(), 12);
  const auto add = [&](const Rows& rows, Index offset) {
    for (const Series& series : rows.series()) {
      const Capture& capture = captures[std::size_t(series.capture)];
      Vec3d centre = Vec3d::Zero();
      for (const Vec3d& x : capture.rest) centre += x / double(capture.tracks());
      const Vec3d x = capture.rest[std::size_t(series.track)] - centre;
      for (Index i = series.begin; i < series.end; ++i) {
        const double t = rows.time(i) - capture.times.front();
        for (int shape = 0; shape < 4; ++shape) {
          field(offset + i, 4 * series.axis + shape) =
              0.5 * t * t * (shape == 0 ? 1.0 : x[shape - 1]);
        }
      }
    }
  };
  add(study.used(), 0);
  add(study.held(), used);

  // Below the samples the priors of θ, so that what is held by one alone stays near.
  const Index priors = precision.size();
  const auto weighted = [&](const MatrixXd& columns) {
    MatrixXd result = MatrixXd::Zero(used + priors, columns.cols());
    result.topRows(used) = white(columns.topRows(used));
    result.block(used, 0, priors, priors).diagonal() = precision.cwiseSqrt();
    return result;
  };
  MatrixXd chosen = theta;
  VectorXd solution;
  std::vector<bool> taken(12, false);
  VectorXd target = VectorXd::Zero(used + priors);
  target.head(used) = white(stacked.head(used));
  MatrixXd candidates = MatrixXd::Zero(used + priors, field.cols());
  candidates.topRows(used) = white(field.topRows(used));
  for (int n = 0; n <= numbers; ++n) {
    const MatrixXd basis = weighted(chosen);
    const Eigen::ColPivHouseholderQR<MatrixXd> qr(basis);
    solution = qr.solve(target);
    if (n == numbers) break;
    const VectorXd rest = target - basis * solution;
    int best = -1;
    double most = 0.0;
    for (int k = 0; k < 12; ++k) {
      const double whole = candidates.col(k).squaredNorm();
      if (taken[std::size_t(k)] || !(whole > 0.0)) continue;
      const VectorXd left = candidates.col(k) - basis * qr.solve(candidates.col(k));
      if (left.squaredNorm() < 1e-8 * whole) continue;
      const double part = rest.dot(left);
      const double value = part * part / left.squaredNorm();
      if (value > most) {
        most = value;
        best = k;
      }
    }
    if (best < 0) break;
    taken[std::size_t(best)] = true;
    chosen.conservativeResize(Eigen::NoChange, chosen.cols() + 1);
    chosen.rightCols(1) = field.col(best);
  }
  return stacked.tail(study.held().size()) - chosen.bottomRows(study.held().size()) * solution;
}

}  // namespace matterfit::diagnose
