// SPDX-License-Identifier: GPL-3.0-or-later
#include "diagnose/localise.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <tuple>

#include "diagnose/chi_square.hpp"
#include "diagnose/gain.hpp"

namespace matterfit::diagnose {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kFalseDiscoveries = 0.05;

/// Squared distance of each sample: capture, frame, track.
using Distances = std::map<std::tuple<int, Index, Index>, double>;

Distances distances_of(const Rows& rows, const VectorXd& residual, Index offset) {
  Distances result;
  for (const Series& series : rows.series()) {
    for (Index i = series.begin; i < series.end; ++i) {
      const double r = residual[offset + i];
      result[{series.capture, rows.frame(i), series.track}] += r * r;
    }
  }
  return result;
}

int frame_number(const Capture& capture, Index frame) {
  return capture.frames.empty() ? int(frame) : capture.frames[std::size_t(frame)];
}

}  // namespace

Sizes sizes_of(const Rows& rows, const VectorXd& residual) {
  Sizes result;
  const Distances distances = distances_of(rows, residual, 0);
  if (distances.empty()) return result;
  std::vector<double> squares;
  squares.reserve(distances.size());
  double sum = 0.0;
  for (const auto& [key, square] : distances) {
    squares.push_back(square);
    sum += square;
  }
  std::ranges::sort(squares);
  result.rms = std::sqrt(sum / double(squares.size()));
  result.p95 = std::sqrt(squares[std::size_t(0.95 * double(squares.size() - 1))]);
  return result;
}

std::vector<FrameError> errors_by_frame(const Study& study, const VectorXd& residual,
                                        const Noise& noise, const MatrixXd& solver) {
  struct Sum {
    double square = 0.0;
    double solver = 0.0;
    double samples = 0.0;
    double time = 0.0;
    bool held = false;
  };
  std::map<std::pair<int, Index>, Sum> frames;
  const auto& captures = study.model().captures();
  const auto add = [&](const Rows& rows, Index offset, bool held) {
    for (const Series& series : rows.series()) {
      const Capture& capture = captures[std::size_t(series.capture)];
      const double axes = double(std::ranges::count(capture.axes, true));
      for (Index i = series.begin; i < series.end; ++i) {
        Sum& sum = frames[{series.capture, rows.frame(i)}];
        sum.square += residual[offset + i] * residual[offset + i];
        sum.solver += solver.row(offset + i).squaredNorm();
        sum.samples += 1.0 / axes;
        sum.time = rows.time(i);
        sum.held = held;
      }
    }
  };
  add(study.used(), 0, false);
  add(study.held(), study.used().size(), true);
  std::vector<FrameError> result;
  result.reserve(frames.size());
  for (const auto& [key, sum] : frames) {
    const Capture& capture = captures[std::size_t(key.first)];
    const TrackNoise& track = noise.captures[std::size_t(key.first)];
    const double axes = double(std::ranges::count(capture.axes, true));
    FrameError error;
    error.capture = key.first;
    error.frame = frame_number(capture, key.second);
    error.time = sum.time;
    error.rms = std::sqrt(sum.square / sum.samples);
    error.noise = std::sqrt(axes) * std::hypot(track.sigma, track.common_sigma, track.place_sigma);
    error.numerical = std::sqrt(sum.solver / sum.samples);
    error.held_out = sum.held;
    result.push_back(error);
  }
  return result;
}

std::vector<WorstFrame> worst_frames(const Study& study, const VectorXd& residual,
                                     std::size_t count) {
  Distances distances = distances_of(study.used(), residual, 0);
  distances.merge(distances_of(study.held(), residual, study.used().size()));
  std::map<std::pair<int, Index>, std::pair<double, Index>> frames;
  for (const auto& [key, square] : distances) {
    const auto& [capture, frame, track] = key;
    auto& [most, where] = frames[{capture, frame}];
    if (square >= most) {
      most = square;
      where = track;
    }
  }
  std::vector<std::tuple<double, int, Index, Index>> order;
  order.reserve(frames.size());
  for (const auto& [key, value] : frames) {
    order.emplace_back(-value.first, key.first, key.second, value.second);
  }
  std::ranges::sort(order);
  std::vector<WorstFrame> result;
  std::vector<std::pair<int, Index>> taken;
  for (const auto& [square, c, frame, track] : order) {
    if (result.size() >= count) break;
    const int here = c;
    const Index f = frame;
    const bool near = std::ranges::any_of(taken, [&](const std::pair<int, Index>& other) {
      return other.first == here && std::abs(other.second - f) < 3;
    });
    if (near) continue;
    taken.emplace_back(c, frame);
    const Capture& capture = study.model().captures()[std::size_t(c)];
    WorstFrame worst;
    worst.capture = c;
    worst.frame = frame_number(capture, frame);
    worst.where = capture.positions.segment<3>(3 * (frame * capture.tracks() + track));
    worst.size = std::sqrt(-square);
    result.push_back(worst);
  }
  return result;
}

std::vector<WrongPlace> wrong_places(const Study& study, const VectorXd& residual,
                                     const Noise& noise, const MatrixXd& solver) {
  const auto& captures = study.model().captures();
  std::vector<std::vector<int>> regions;
  regions.reserve(captures.size());
  for (const Capture& capture : captures) regions.push_back(body_regions(capture));
  struct Cell {
    std::array<double, 3> sum{};
    std::array<double, 3> count{};
    std::array<VectorXd, 3> solver;
  };
  std::map<std::tuple<int, Index, int>, Cell> cells;
  for (const Series& series : study.used().series()) {
    const int region = regions[std::size_t(series.capture)][std::size_t(series.track)];
    const std::size_t axis = std::size_t(series.axis);
    for (Index i = series.begin; i < series.end; ++i) {
      Cell& cell = cells[{series.capture, study.used().frame(i), region}];
      cell.sum[axis] += residual[i];
      cell.count[axis] += 1.0;
      if (cell.solver[axis].size() == 0) cell.solver[axis] = VectorXd::Zero(solver.cols());
      cell.solver[axis] += solver.row(i).transpose();
    }
  }
  std::vector<std::pair<double, WrongPlace>> tested;
  tested.reserve(cells.size());
  for (const auto& [key, cell] : cells) {
    const auto& [c, frame, region] = key;
    const TrackNoise& track = noise.captures[std::size_t(c)];
    double statistic = 0.0;
    int freedom = 0;
    for (std::size_t a = 0; a < 3; ++a) {
      if (!(cell.count[a] > 0.0)) continue;
      const double n = cell.count[a];
      const double variance =
          (track.sigma * track.sigma + track.place_sigma * track.place_sigma) / n +
          track.common_sigma * track.common_sigma + cell.solver[a].squaredNorm() / (n * n);
      const double mean = cell.sum[a] / n;
      statistic += mean * mean / variance;
      ++freedom;
    }
    WrongPlace place;
    place.capture = c;
    place.frame = frame_number(captures[std::size_t(c)], frame);
    place.region = region;
    place.sigmas = std::sqrt(statistic);
    tested.emplace_back(log_chi_square_tail(statistic, freedom), place);
  }
  std::ranges::stable_sort(tested, {}, &std::pair<double, WrongPlace>::first);
  std::size_t found = 0;
  for (std::size_t i = 0; i < tested.size(); ++i) {
    const double limit = std::log(kFalseDiscoveries * double(i + 1) / double(tested.size()));
    if (tested[i].first <= limit) found = i + 1;
  }
  std::vector<WrongPlace> result;
  result.reserve(found);
  for (std::size_t i = 0; i < found; ++i) result.push_back(tested[i].second);
  return result;
}

}  // namespace matterfit::diagnose
