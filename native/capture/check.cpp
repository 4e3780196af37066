// SPDX-License-Identifier: GPL-3.0-or-later
#include "capture/check.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <optional>

#include "base/error.hpp"

namespace matterfit::capture {
namespace {

constexpr double kIrregular = 0.01;  // of the median step of time
constexpr double kGap = 1.5;         // medians
constexpr double kLargeBox = 50.0;   // [m]
constexpr double kSmallBox = 1e-4;   // [m]
constexpr std::size_t kJumpsListed = 20;
/// A step is a jump if it stands out from the noise of the whole capture and from how its own point
/// moves just before and after.
constexpr double kJumpOverNoise = 10.0;
constexpr double kJumpOverMotion = 3.0;
/// Steps of a body at rest are √6 of the noise, which the motion around makes seem larger.
constexpr double kStillOverNoise = 3.0;
/// Cosine between steps that go on, or (negative) that turn back.
constexpr double kStraight = 0.5;
constexpr double kLeastMotion = 1e-6;  // of the box: less is rounding
/// Values that a pooled median looks at, at most; more are thinned evenly by point.
constexpr std::size_t kPool = 2'000'000;
constexpr std::size_t kNoiseBlocks = 8;
constexpr std::size_t kNoiseSamples =
    32;  // of a block at least, so that its median means something
constexpr double kMadToSigma = 1.4826;
const double kThirdDifference = std::sqrt(20.0);  // 1² + 3² + 3² + 1²

double median(std::vector<double>& values) {
  if (values.empty()) return 0.0;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  if (values.size() % 2 == 1) return *middle;
  return 0.5 * (*middle + *std::max_element(values.begin(), middle));
}

template <class... Arguments>
std::string print(const char* format, Arguments... arguments) {
  std::array<char, 512> line{};
  std::snprintf(line.data(), line.size(), format, arguments...);
  return line.data();
}

/// "0.014 mm", "6.2 mm", "370 mm", "1.25 m".
std::string length_text(double metres) {
  if (metres >= 1.0) return print("%.3g m", metres);
  if (metres >= 9.95e-3) {  // two digits, as below
    const double step = metres >= 0.0995 ? 10.0 : 1.0;
    return print("%.0f mm", std::round(metres * 1e3 / step) * step);
  }
  if (metres < 9.5e-7) return "less than 0.001 mm";
  return print("%.2g mm", metres * 1e3);
}

std::string point_text(const Tracks& tracks, std::size_t point) {
  if (tracks.labels.empty()) return "point " + std::to_string(point);
  return "point " + std::to_string(point) + " (" + tracks.labels[point] + ")";
}

/// The median step of time; counts those that differ, and lists the gaps.
double look_at_steps(const std::vector<double>& t, std::size_t& irregular,
                     std::vector<TimeGap>& gaps) {
  std::vector<double> steps;
  for (std::size_t i = 1; i < t.size(); ++i) steps.push_back(t[i] - t[i - 1]);
  const double spacing = median(steps);
  for (std::size_t i = 1; i < t.size(); ++i) {
    const double step = t[i] - t[i - 1];
    if (std::abs(step - spacing) > kIrregular * spacing) ++irregular;
    if (step >= kGap * spacing) gaps.push_back({i, step});
  }
  return spacing;
}

std::string unit_warning(const Vec3d& low, const Vec3d& high, bool several_points) {
  const double width = (high - low).maxCoeff();
  if (width > kLargeBox) {
    return print("%.3g m wide: this looks like %s read as metres. Set the unit of the capture.",
                 width, width > 10.0 * kLargeBox ? "millimetres" : "millimetres or centimetres");
  }
  if (width < kSmallBox && several_points) {
    return print("only %.2g mm wide: is the unit of the capture right?", width * 1e3);
  }
  return {};
}

void warn_of_one_frame(std::size_t frames, std::vector<std::string>& text) {
  if (frames == 1)
    text.emplace_back("Warning: one frame shows no motion, so nothing can be fitted to it");
}

void write_times(double spacing, std::size_t irregular, const std::vector<TimeGap>& gaps,
                 std::vector<std::string>& text) {
  if (!(spacing > 0.0)) return;
  std::string line = print("A frame every %.4g ms (%.4g Hz)", spacing * 1e3, 1.0 / spacing);
  line += irregular == 0
              ? std::string(", regular")
              : print(", %zu step%s of time differ", irregular, irregular == 1 ? "" : "s");
  text.push_back(line);
  if (gaps.empty()) return;
  const auto longest =
      std::max_element(gaps.begin(), gaps.end(),
                       [](const TimeGap& a, const TimeGap& b) { return a.seconds < b.seconds; });
  text.push_back(print("%zu gap%s in time, the longest %.3g s before frame %zu", gaps.size(),
                       gaps.size() == 1 ? "" : "s", longest->seconds, longest->frame));
}

void write_box(const Vec3d& low, const Vec3d& high, const std::string& warning,
               std::vector<std::string>& text) {
  const Vec3d size = high - low;
  text.push_back(print("Box %.3g x %.3g x %.3g m", size.x(), size.y(), size.z()));
  if (!warning.empty()) text.push_back("Warning: " + warning);
}

class Summariser {
 public:
  explicit Summariser(const Tracks& tracks) : tracks_(tracks) {}

  CaptureSummary run() {
    check_tracks(tracks_);
    out_.frames = tracks_.frames();
    out_.points = tracks_.points;
    look_at_times();
    look_at_box();
    look_at_visibility();
    estimate_noise();
    find_jumps();
    find_exchanged();
    write_text();
    return std::move(out_);
  }

 private:
  void look_at_times() {
    out_.duration = tracks_.times.back() - tracks_.times.front();
    out_.spacing = look_at_steps(tracks_.times, out_.irregular, out_.gaps);
  }

  void look_at_box() {
    bool first = true;
    for (std::size_t i = 0; i < tracks_.positions.size(); ++i) {
      if (!tracks_.visible.empty() && tracks_.visible[i] == 0) continue;
      const Vec3d& x = tracks_.positions[i];
      out_.low = first ? x : Vec3d(out_.low.cwiseMin(x));
      out_.high = first ? x : Vec3d(out_.high.cwiseMax(x));
      first = false;
    }
    out_.unit_warning = unit_warning(out_.low, out_.high, tracks_.points > 1);
  }

  void look_at_visibility() {
    if (tracks_.visible.empty()) return;
    std::vector<std::size_t> seen(tracks_.points, 0);
    std::size_t missing = 0;
    for (std::size_t i = 0; i < tracks_.visible.size(); ++i) {
      if (tracks_.visible[i] != 0) {
        ++seen[i % tracks_.points];
      } else {
        ++missing;
      }
    }
    out_.missing = static_cast<double>(missing) / static_cast<double>(tracks_.visible.size());
    for (std::size_t point = 0; point < seen.size(); ++point) {
      if (seen[point] == 0) out_.never_visible.push_back(point);
    }
  }

  [[nodiscard]] std::size_t thinning() const {
    return std::max<std::size_t>(1, tracks_.positions.size() * 3 / kPool);
  }

  [[nodiscard]] bool step_is_regular(std::size_t frame) const {
    return std::abs(tracks_.times[frame] - tracks_.times[frame - 1] - out_.spacing) <=
           kIrregular * out_.spacing;
  }

  /// |third differences| of a point over windows of four frames that begin in [begin, end).
  void add_third_differences(std::size_t point, std::size_t begin, std::size_t end,
                             std::vector<double>& values) const {
    for (std::size_t f = begin; f < end && f + 3 < tracks_.frames(); ++f) {
      bool whole = tracks_.is_visible(f, point);
      for (std::size_t k = 1; k <= 3; ++k) {
        whole = whole && tracks_.is_visible(f + k, point) && step_is_regular(f + k);
      }
      if (!whole) continue;
      const Vec3d d = tracks_.position(f + 3, point) - tracks_.position(f, point) +
                      3.0 * (tracks_.position(f + 1, point) - tracks_.position(f + 2, point));
      for (int axis = 0; axis < 3; ++axis) values.push_back(std::abs(d[axis]));
    }
  }

  /// Third differences remove motion of constant acceleration. What is left of vibration is avoided
  /// by looking only at those of eight spans of time that are quietest.
  void estimate_noise() {
    out_.point_noise.assign(tracks_.points, 0.0);
    const std::size_t windows = tracks_.frames() > 3 ? tracks_.frames() - 3 : 0;
    if (windows == 0) return;
    const std::size_t blocks = std::clamp<std::size_t>(windows * tracks_.points / kNoiseSamples, 1,
                                                       std::min(kNoiseBlocks, windows));
    struct Block {
      double level;
      std::size_t begin;
      std::size_t end;
    };
    std::vector<Block> quiet;
    std::vector<double> values;
    for (std::size_t b = 0; b < blocks; ++b) {
      const Block block{0.0, windows * b / blocks, windows * (b + 1) / blocks};
      values.clear();
      for (std::size_t point = 0; point < tracks_.points; point += thinning()) {
        add_third_differences(point, block.begin, block.end, values);
      }
      if (!values.empty()) quiet.push_back({median(values), block.begin, block.end});
    }
    std::stable_sort(quiet.begin(), quiet.end(),
                     [](const Block& a, const Block& b) { return a.level < b.level; });
    quiet.resize((quiet.size() + 1) / 2);
    std::vector<double> pool;
    for (std::size_t point = 0; point < tracks_.points; ++point) {
      values.clear();
      for (const Block& block : quiet) {
        add_third_differences(point, block.begin, block.end, values);
      }
      if (point % thinning() == 0) pool.insert(pool.end(), values.begin(), values.end());
      out_.point_noise[point] = kMadToSigma * median(values) / kThirdDifference;
    }
    out_.noise = kMadToSigma * median(pool) / kThirdDifference;
  }

  [[nodiscard]] bool has_step(std::size_t frame, std::size_t point) const {
    return frame >= 1 && frame < tracks_.frames() && tracks_.is_visible(frame, point) &&
           tracks_.is_visible(frame - 1, point);
  }
  /// The step into `frame`, scaled to the median spacing of time.
  [[nodiscard]] Vec3d step(std::size_t frame, std::size_t point) const {
    const double time = tracks_.times[frame] - tracks_.times[frame - 1];
    return (tracks_.position(frame, point) - tracks_.position(frame - 1, point)) *
           (out_.spacing / time);
  }

  /// How far the step into `frame` is from the more alike of its two neighbours; negative if it has
  /// none. A bounce or a release resembles one side, a jump neither.
  [[nodiscard]] double deviation(std::size_t frame, std::size_t point) const {
    double least = -1.0;
    if (!has_step(frame, point)) return least;
    const Vec3d own = step(frame, point);
    for (const std::size_t other : {frame - 1, frame + 1}) {
      if (!has_step(other, point)) continue;
      const double distance = (own - step(other, point)).norm();
      least = least < 0.0 ? distance : std::min(least, distance);
    }
    return least;
  }

  /// Median length of the steps around: two before, two after; negative with fewer than two.
  [[nodiscard]] double ambient(std::size_t frame, std::size_t point) const {
    std::vector<double> around;
    for (const std::size_t other : {frame - 2, frame - 1, frame + 1, frame + 2}) {
      if (has_step(other, point)) around.push_back(step(other, point).norm());
    }
    return around.size() < 2 ? -1.0 : median(around);
  }

  void find_jumps() {
    std::vector<double> sample;
    for (std::size_t point = 0; point < tracks_.points; point += thinning()) {
      for (std::size_t frame = 1; frame < tracks_.frames(); ++frame) {
        const double d = deviation(frame, point);
        if (d >= 0.0) sample.push_back(d);
      }
    }
    const double floor = kLeastMotion * (out_.high - out_.low).norm();
    const double threshold = std::max(floor, kJumpOverNoise * kMadToSigma * median(sample));
    for (std::size_t point = 0; point < tracks_.points; ++point) {
      std::size_t last = 0;
      for (std::size_t frame = 1; frame < tracks_.frames(); ++frame) {
        const double d = deviation(frame, point);
        if (!(d > threshold)) continue;
        const double motion = ambient(frame, point);
        if (motion < 0.0 || !(d > kJumpOverMotion * motion)) continue;
        // The way back of a spike is no second jump.
        if (last == 0 || frame != last + 1) out_.jumps.push_back({point, frame, d});
        last = frame;
      }
    }
    out_.jump_count = out_.jumps.size();
    std::stable_sort(out_.jumps.begin(), out_.jumps.end(),
                     [](const Jump& a, const Jump& b) { return a.size > b.size; });
    if (out_.jumps.size() > kJumpsListed) out_.jumps.resize(kJumpsListed);
  }

  /// The cosine between the steps from frame a to b and from b to c, over all points that are seen
  /// in the three; nothing where they stand still or are not seen.
  [[nodiscard]] std::optional<double> straightness(std::size_t a, std::size_t b,
                                                   std::size_t c) const {
    double product = 0.0;
    double before = 0.0;
    double after = 0.0;
    double seen = 0.0;
    for (std::size_t point = 0; point < tracks_.points; point += thinning()) {
      if (!tracks_.is_visible(a, point) || !tracks_.is_visible(b, point) ||
          !tracks_.is_visible(c, point)) {
        continue;
      }
      const Vec3d first = tracks_.position(b, point) - tracks_.position(a, point);
      const Vec3d second = tracks_.position(c, point) - tracks_.position(b, point);
      product += first.dot(second);
      before += first.squaredNorm();
      after += second.squaredNorm();
      seen += 1.0;
    }
    const double still =
        std::max(kLeastMotion * (out_.high - out_.low).norm(), kStillOverNoise * out_.noise);
    const double least = still * still * seen;
    if (!(before > least && after > least)) return std::nullopt;
    return product / std::sqrt(before * after);
  }

  /// Whether the steps go on, where they can be told.
  [[nodiscard]] bool goes_on(std::size_t a, std::size_t b, std::size_t c) const {
    const auto cosine = straightness(a, b, c);
    return cosine && *cosine > kStraight;
  }
  [[nodiscard]] bool turns_back(std::size_t a, std::size_t b, std::size_t c) const {
    const auto cosine = straightness(a, b, c);
    return cosine && *cosine < -kStraight;
  }

  /// Frames f and f + 1: as they are the points turn back twice, exchanged they go on, and so do
  /// those before or after (vibration near the frame rate does not).
  void find_exchanged() {
    for (std::size_t f = 1; f + 2 < tracks_.frames(); ++f) {
      if (!turns_back(f - 1, f, f + 1) || !turns_back(f, f + 1, f + 2)) continue;
      if (!goes_on(f - 1, f + 1, f) || !goes_on(f + 1, f, f + 2)) continue;
      // A bounce may lie on one side.
      const bool before = f >= 2 && goes_on(f - 2, f - 1, f + 1);
      const bool after = f + 3 < tracks_.frames() && goes_on(f, f + 2, f + 3);
      if (!before && !after) continue;
      out_.exchanged.push_back(f);
    }
    if (out_.exchanged.empty()) return;
    const std::size_t frame = out_.exchanged.front();
    const std::size_t others = out_.exchanged.size() - 1;
    out_.exchanged_warning =
        print("frames %zu and %zu (counted from 0) look exchanged", frame, frame + 1);
    if (others > 0) {
      out_.exchanged_warning += print(", and %zu other pair%s", others, others > 1 ? "s" : "");
    }
    out_.exchanged_warning +=
        ": as they are the points turn back twice. They are taken as they are; look at the file.";
  }

  void write_text() {
    std::vector<std::string>& text = out_.text;
    text.push_back(print("%zu frame%s of %zu point%s over %.3g s", out_.frames,
                         out_.frames == 1 ? "" : "s", out_.points, out_.points == 1 ? "" : "s",
                         out_.duration));
    warn_of_one_frame(out_.frames, text);
    write_times(out_.spacing, out_.irregular, out_.gaps, text);
    write_box(out_.low, out_.high, out_.unit_warning, text);
    if (out_.jump_count == 0) {
      text.emplace_back("No jumps");
    } else {
      const Jump& jump = out_.jumps[0];
      text.push_back(print("Warning: %zu jump%s, the largest %s: ", out_.jump_count,
                           out_.jump_count == 1 ? "" : "s", length_text(jump.size).c_str()) +
                     point_text(tracks_, jump.point) + " at frame " + std::to_string(jump.frame));
    }
    if (!out_.exchanged_warning.empty()) text.push_back("Warning: " + out_.exchanged_warning);
    text.push_back(out_.missing == 0.0 ? std::string("No samples missing")
                                       : print("%.3g %% of the samples missing",
                                               std::max(out_.missing * 100.0, 1e-3)));
    if (!out_.never_visible.empty()) {
      text.push_back(print("Warning: %zu point%s never visible: ", out_.never_visible.size(),
                           out_.never_visible.size() == 1 ? " is" : "s are") +
                     point_text(tracks_, out_.never_visible[0]) +
                     (out_.never_visible.size() > 1 ? ", …" : ""));
    }
    text.push_back(out_.noise > 0.0 ? "Noise at most about " + length_text(out_.noise)
                                    : std::string("Noise not measurable"));
  }

  const Tracks& tracks_;
  CaptureSummary out_;
};

}  // namespace

CaptureSummary summarise(const Tracks& tracks) { return Summariser(tracks).run(); }

CloudSummary summarise(const PointCloudSequence& clouds) {
  CloudSummary out;
  out.frames = clouds.frames.size();
  if (out.frames == 0 || clouds.times.size() != out.frames) {
    throw_input(clouds.source + ": " + std::to_string(out.frames) + " point clouds have " +
                std::to_string(clouds.times.size()) + " times.");
  }
  out.duration = clouds.times.back() - clouds.times.front();
  out.spacing = look_at_steps(clouds.times, out.irregular, out.gaps);
  out.fewest = clouds.frames[0].size();
  for (std::size_t frame = 0; frame < out.frames; ++frame) {
    const Points& cloud = clouds.frames[frame];
    if (cloud.empty()) out.empty_frames.push_back(frame);
    for (const Vec3d& x : cloud) {
      const bool first = out.most == 0 && &x == cloud.data();
      out.low = first ? x : Vec3d(out.low.cwiseMin(x));
      out.high = first ? x : Vec3d(out.high.cwiseMax(x));
    }
    out.fewest = std::min(out.fewest, cloud.size());
    out.most = std::max(out.most, cloud.size());
  }
  if (out.most == 0) throw_input(clouds.source + ": no frame holds a point.");
  out.unit_warning = unit_warning(out.low, out.high, out.most > 1);
  out.text.push_back(print("%zu frame%s of %zu to %zu points over %.3g s", out.frames,
                           out.frames == 1 ? "" : "s", out.fewest, out.most, out.duration));
  warn_of_one_frame(out.frames, out.text);
  write_times(out.spacing, out.irregular, out.gaps, out.text);
  write_box(out.low, out.high, out.unit_warning, out.text);
  if (!out.empty_frames.empty()) {
    out.text.push_back(print("Warning: %zu frame%s hold%s no points, the first is frame %zu",
                             out.empty_frames.size(), out.empty_frames.size() == 1 ? "" : "s",
                             out.empty_frames.size() == 1 ? "s" : "", out.empty_frames[0]));
  }
  return out;
}

}  // namespace matterfit::capture
