// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/run/compare.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "capture/npz.hpp"
#include "fit/data/metrics.hpp"

namespace matterfit::job {
namespace {

constexpr double kMillimetres = 1e3;

/// Frames that look at whole sets: all of few points, some of many.
std::vector<std::size_t> spaced(std::size_t frames, std::size_t most) {
  std::vector<std::size_t> chosen;
  const std::size_t count = std::min(frames, most);
  for (std::size_t k = 0; k < count; ++k) {
    chosen.push_back(count == 1 ? frames - 1 : k * (frames - 1) / (count - 1));
  }
  return chosen;
}

}  // namespace

std::vector<double> capture_error_mm(const fit::CaptureInput& capture,
                                     const fit::SimulatedCapture& simulated) {
  const std::size_t points = capture.tracks.points;
  const std::size_t frames = capture.tracks.frames();
  std::vector<double> error(frames * points, std::numeric_limits<double>::quiet_NaN());
  for (std::size_t t = 0; t < frames; ++t) {
    for (std::size_t i = 0; i < points; ++i) {
      if (!capture.tracks.is_visible(t, i)) continue;
      const std::size_t at = t * points + i;
      error[at] = kMillimetres * (simulated.positions[at] - capture.tracks.position(t, i)).norm();
    }
  }
  return error;
}

Json error_statistics(const std::vector<double>& values) {
  double sum = 0.0;
  double squares = 0.0;
  double largest = 0.0;
  std::size_t count = 0;
  for (const double value : values) {
    if (!std::isfinite(value)) continue;
    sum += value;
    squares += value * value;
    largest = std::max(largest, value);
    ++count;
  }
  Json json = {{"samples", count}};
  if (count == 0) return json;
  json["mean_mm"] = sum / double(count);
  json["rms_mm"] = std::sqrt(squares / double(count));
  json["p95_mm"] = fit::quantile(values, 0.95);
  json["max_mm"] = largest;
  return json;
}

CaptureError compare_capture(const fit::CaptureInput& capture,
                             const fit::SimulatedCapture& simulated, double body_size, double fps,
                             int first_frame, Arena& arena, const Interrupter& interrupter) {
  const std::size_t points = capture.tracks.points;
  const std::size_t frames = capture.tracks.frames();
  CaptureError result;
  result.error_mm = capture_error_mm(capture, simulated);

  Json summary = error_statistics(result.error_mm);
  summary["name"] = capture.name;
  summary["body"] = capture.body;
  summary["body_size_m"] = body_size;
  if (summary.contains("mean_mm") && body_size > 0.0) {
    const double percent = 100.0 / (kMillimetres * body_size);
    summary["mean_percent"] = summary["mean_mm"].get<double>() * percent;
    summary["p95_percent"] = summary["p95_mm"].get<double>() * percent;
  }
  Json by_point = Json::array();
  for (std::size_t i = 0; i < points; ++i) {
    std::vector<double> values;
    for (std::size_t t = 0; t < frames; ++t) values.push_back(result.error_mm[t * points + i]);
    Json point = error_statistics(values);
    point["label"] = capture.label(i);
    if (capture.held_out_points[i] != 0) point["held_out"] = true;
    by_point.push_back(std::move(point));
  }
  summary["points"] = std::move(by_point);

  std::vector<double> seen;
  std::vector<double> held;
  for (std::size_t t = 0; t < frames; ++t) {
    for (std::size_t i = 0; i < points; ++i) {
      const bool out = capture.held_out_points[i] != 0 || capture.held_out_frames[t] != 0;
      (out ? held : seen).push_back(result.error_mm[t * points + i]);
    }
  }
  if (!held.empty()) {
    summary["held_out"] = error_statistics(held);
    summary["not_held_out"] = error_statistics(seen);
  }

  std::vector<double> frame_means(frames);
  for (std::size_t t = 0; t < frames; ++t) {
    const auto begin = result.error_mm.begin() + static_cast<std::ptrdiff_t>(t * points);
    const Json one = error_statistics({begin, begin + static_cast<std::ptrdiff_t>(points)});
    frame_means[t] = one.contains("mean_mm") ? one["mean_mm"].get<double>()
                                             : std::numeric_limits<double>::quiet_NaN();
  }
  std::vector<std::size_t> order(frames);
  std::iota(order.begin(), order.end(), 0U);
  order.erase(std::remove_if(order.begin(), order.end(),
                             [&](std::size_t t) { return !std::isfinite(frame_means[t]); }),
              order.end());
  std::stable_sort(order.begin(), order.end(),
                   [&](std::size_t a, std::size_t b) { return frame_means[a] > frame_means[b]; });
  constexpr std::size_t kWorst = 5;
  Json worst = Json::array();
  for (std::size_t k = 0; k < std::min(kWorst, order.size()); ++k) {
    const double frame = first_frame + capture.tracks.times[order[k]] * fps;
    worst.push_back({{"frame", std::round(1e6 * frame) / 1e6}, {"mean_mm", frame_means[order[k]]}});
  }
  summary["worst_frames"] = std::move(worst);

  // Conventions of the papers: Chamfer in m² (published ×1e3), earth mover's in m.
  constexpr std::size_t kFewPoints = 128;
  constexpr std::size_t kFewFrames = 8;
  const auto sets = [&](std::size_t t, Points& ours, Points& theirs) {
    for (std::size_t i = 0; i < points; ++i) {
      const Vec3d& x = simulated.positions[t * points + i];
      if (!x.allFinite() || !capture.tracks.is_visible(t, i)) continue;
      ours.push_back(x);
      theirs.push_back(capture.tracks.position(t, i));
    }
  };
  double chamfer_sum = 0.0;
  std::size_t chamfer_count = 0;
  for (std::size_t t = 0; t < frames; ++t) {
    interrupter.check();
    Points ours;
    Points theirs;
    sets(t, ours, theirs);
    if (ours.empty()) continue;
    chamfer_sum += fit::chamfer(ours, theirs, arena);
    ++chamfer_count;
  }
  if (chamfer_count > 0) {
    summary["chamfer_m2"] = chamfer_sum / double(chamfer_count);
    summary["chamfer_1e3_m2"] = 1e3 * chamfer_sum / double(chamfer_count);
  }
  double emd_sum = 0.0;
  std::size_t emd_count = 0;
  for (const std::size_t t : spaced(frames, points <= kFewPoints ? frames : kFewFrames)) {
    Points ours;
    Points theirs;
    sets(t, ours, theirs);
    if (ours.empty()) continue;
    emd_sum += fit::earth_mover(ours, theirs, interrupter);
    ++emd_count;
  }
  if (emd_count > 0) {
    summary["emd_m"] = emd_sum / double(emd_count);
    summary["emd_frames"] = emd_count;
  }
  result.summary = std::move(summary);
  return result;
}

std::string write_compare(const std::filesystem::path& folder, const fit::CaptureInput& capture,
                          const CaptureError& error, bool only_one) {
  const std::size_t frames = capture.tracks.frames();
  const std::size_t points = capture.tracks.points;
  std::vector<double> times = capture.tracks.times;
  for (double& time : times) time -= capture.start;
  std::vector<std::string> labels;
  for (std::size_t i = 0; i < points; ++i) labels.push_back(capture.label(i));
  capture::Arrays arrays;
  arrays["error_mm"] = capture::Array({frames, points}, error.error_mm);
  arrays["times"] = capture::Array({frames}, std::move(times));
  // Where the heat-map's points are: in the world, after unit, up axis and alignment.
  std::vector<double> captured;
  captured.reserve(3 * frames * points);
  for (std::size_t t = 0; t < frames; ++t) {
    for (std::size_t i = 0; i < points; ++i) {
      const bool seen = capture.tracks.is_visible(t, i);
      for (int axis = 0; axis < 3; ++axis) {
        captured.push_back(seen ? capture.tracks.position(t, i)[axis]
                                : std::numeric_limits<double>::quiet_NaN());
      }
    }
  }
  arrays["captured"] = capture::Array({frames, points, 3}, std::move(captured));
  arrays["labels"] = capture::Array({points}, std::move(labels));
  const std::string name = only_one ? "compare.npz" : "compare_" + capture.name + ".npz";
  capture::write_npz(folder / name, arrays);
  return name;
}

}  // namespace matterfit::job
