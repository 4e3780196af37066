// SPDX-License-Identifier: GPL-3.0-or-later
#include "diagnose/places.hpp"

#include <Eigen/Geometry>
#include <map>

namespace matterfit::diagnose {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr std::size_t kFewestTracks = 3;

}  // namespace

Turns body_turns(const Rows& rows, const std::vector<Capture>& captures,
                 const VectorXd& positions) {
  Turns turns;
  turns.reserve(captures.size());
  for (const Capture& capture : captures) {
    turns.emplace_back(capture.times.size(), Mat3d::Identity());
  }
  // Axes of one sample are in three series: by capture, frame and track.
  std::map<std::pair<int, Index>, std::map<Index, Vec3d>> seen;
  for (const Series& series : rows.series()) {
    const Capture& capture = captures[std::size_t(series.capture)];
    if (!capture.axes[0] || !capture.axes[1] || !capture.axes[2]) continue;
    for (Index i = series.begin; i < series.end; ++i) {
      seen[{series.capture, rows.frame(i)}][series.track][series.axis] = positions[i];
    }
  }
  for (const auto& [key, tracks] : seen) {
    if (tracks.size() < kFewestTracks) continue;
    Eigen::Matrix3Xd from(3, Index(tracks.size()));
    Eigen::Matrix3Xd to(3, Index(tracks.size()));
    Index at = 0;
    for (const auto& [track, x] : tracks) {
      from.col(at) = captures[std::size_t(key.first)].rest[std::size_t(track)];
      to.col(at++) = x;
    }
    turns[std::size_t(key.first)][std::size_t(key.second)] =
        Eigen::umeyama(from, to, false).topLeftCorner<3, 3>();
  }
  return turns;
}

MatrixXd TrackRows::gather(const MatrixXd& columns) const {
  MatrixXd result(shift.rows(), columns.cols());
  Index at = 0;
  for (const auto& [begin, end] : segments) {
    result.middleRows(at, end - begin) = columns.middleRows(begin, end - begin);
    at += end - begin;
  }
  return result;
}

void TrackRows::scatter(const MatrixXd& values, MatrixXd& columns) const {
  Index at = 0;
  for (const auto& [begin, end] : segments) {
    columns.middleRows(begin, end - begin) = values.middleRows(at, end - begin);
    at += end - begin;
  }
}

std::vector<TrackRows> track_rows(const Rows& rows, const Turns& turns) {
  std::map<std::pair<int, Index>, std::vector<const Series*>> tracks;
  for (const Series& series : rows.series()) {
    tracks[{series.capture, series.track}].push_back(&series);
  }
  std::vector<TrackRows> result;
  result.reserve(tracks.size());
  for (const auto& [key, parts] : tracks) {
    TrackRows& track = result.emplace_back();
    track.capture = key.first;
    Index count = 0;
    for (const Series* series : parts) {
      track.segments.emplace_back(series->begin, series->end);
      count += series->end - series->begin;
    }
    track.shift.resize(count, 3);
    Index at = 0;
    for (const Series* series : parts) {
      for (Index i = series->begin; i < series->end; ++i) {
        track.shift.row(at++) =
            turns[std::size_t(key.first)][std::size_t(rows.frame(i))].row(series->axis);
      }
    }
  }
  return result;
}

}  // namespace matterfit::diagnose
