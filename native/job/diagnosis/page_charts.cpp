// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/diagnosis/page_charts.hpp"

#include <map>
#include <set>
#include <vector>

#include "job/diagnosis/page_text.hpp"

namespace matterfit::job::page {
namespace {

/// Of the viewBox: so narrow that its words can be read on a phone.
constexpr double kWide = 440.0;
constexpr double kLeft = 8.0;
constexpr double kRight = kWide - 8.0;
constexpr double kTop = 24.0;
constexpr double kCurveHeight = 150.0;
constexpr double kStripRow = 13.0;

/// A graph over frames.
class Plot {
 public:
  Plot(double low, double high, double most, double height)
      : low_(low), high_(high), most_(most), height_(height) {}

  [[nodiscard]] double x(double frame) const {
    return kLeft + (kRight - kLeft) * (frame - low_) / (high_ - low_);
  }
  [[nodiscard]] double y(double value) const {
    return kTop + height_ * (1.0 - std::clamp(value / most_, 0.0, 1.0));
  }
  [[nodiscard]] double base() const { return kTop + height_; }
  /// Half of what lies between frames.
  [[nodiscard]] double half_frame() const { return 0.5 * (kRight - kLeft) / (high_ - low_); }

  /// "x,y …" of what is finite.
  [[nodiscard]] std::string points(const std::vector<double>& frames,
                                   const std::vector<double>& values) const {
    std::string text;
    for (std::size_t i = 0; i < frames.size(); ++i) {
      if (std::isfinite(values[i])) {
        text += fmt::format("{:.1f},{:.1f} ", x(frames[i]), y(values[i]));
      }
    }
    return text;
  }
  [[nodiscard]] std::string curve(const std::vector<double>& frames,
                                  const std::vector<double>& values, const char* kind) const {
    const std::string list = points(frames, values);
    return list.empty() ? list : fmt::format("<polyline class=\"{}\" points=\"{}\"/>", kind, list);
  }
  /// From the axis up to the values.
  [[nodiscard]] std::string shaded(const std::vector<double>& frames,
                                   const std::vector<double>& values, const char* kind) const {
    const std::string list = points(frames, values);
    if (list.empty()) return {};
    return fmt::format("<polygon class=\"{}\" points=\"{:.1f},{:.1f} {}{:.1f},{:.1f}\"/>", kind,
                       x(frames.front()), base(), list, x(frames.back()), base());
  }
  /// The axis with its first and last frame, below `under`.
  [[nodiscard]] std::string axis(double under) const {
    return fmt::format(
               "<line class=\"axis\" x1=\"{0}\" y1=\"{1:.1f}\" x2=\"{2}\" y2=\"{1:.1f}\"/>"
               "<text x=\"{0}\" y=\"{3:.1f}\">frame ",
               kLeft, base(), kRight, under) +
           marked(low_, fmt::format("{:.0f}", low_), "tspan") + "</text>" +
           marked(high_, fmt::format("{:.0f}", high_),
                  fmt::format("text x=\"{}\" y=\"{:.1f}\" text-anchor=\"end\"", kRight, under));
  }

 private:
  double low_;
  double high_;
  double most_;
  double height_;
};

std::string begin_svg(double height, const std::string& label) {
  return fmt::format("<svg viewBox=\"0 0 {:.0f} {:.0f}\" role=\"img\" aria-label=\"{}\">", kWide,
                     height, escaped(label));
}

/// What one recording has of `residual`.
struct Recording {
  std::vector<double> frames;
  std::vector<double> before;
  std::vector<double> after;
  std::vector<double> noise;
  std::vector<double> floor;  ///< of noise and solver together
  std::vector<bool> held_out;
  std::vector<const Json*> wrong;
};

std::map<std::string, Recording> recordings_of(const Json& residual) {
  std::map<std::string, Recording> found;
  for (const Json& row : residual.value("by_frame", Json::array())) {
    Recording& recording = found[text_at(row, "capture")];
    const double noise = number_at(row, "noise");
    const double numerical = number_at(row, "numerical");
    recording.frames.push_back(number_at(row, "frame"));
    recording.before.push_back(number_at(row, "before"));
    recording.after.push_back(number_at(row, "after"));
    recording.noise.push_back(noise);
    recording.floor.push_back(std::isfinite(numerical) ? std::hypot(noise, numerical) : noise);
    recording.held_out.push_back(row.value("held_out", false));
  }
  if (const auto wrong = residual.find("wrong"); wrong != residual.end()) {
    for (const Json& cell : *wrong) {
      const auto recording = found.find(text_at(cell, "capture"));
      if (recording != found.end()) recording->second.wrong.push_back(&cell);
    }
  }
  return found;
}

std::string held_out_bands(const Plot& plot, const Recording& recording, double bottom) {
  std::string svg;
  for (std::size_t i = 0; i < recording.frames.size(); ++i) {
    if (!recording.held_out[i]) continue;
    std::size_t last = i;
    while (last + 1 < recording.frames.size() && recording.held_out[last + 1]) ++last;
    const double left = std::max(kLeft, plot.x(recording.frames[i]) - plot.half_frame());
    const double right = std::min(kRight, plot.x(recording.frames[last]) + plot.half_frame());
    svg += fmt::format(
        "<rect class=\"held\" x=\"{:.1f}\" y=\"{:.1f}\" width=\"{:.1f}\" height=\"{:.1f}\"/>", left,
        kTop, right - left, bottom - kTop);
    i = last;
  }
  return svg;
}

/// Frames × parts of the body, the darker the more a part is off there.
std::string wrong_strip(const Plot& plot, const Recording& recording, const Json& names,
                        double top) {
  double most = 0.0;
  for (const Json* cell : recording.wrong) most = std::max(most, number_at(*cell, "sigmas"));
  std::string svg;
  for (const Json* cell : recording.wrong) {
    const double place = plot.x(number_at(*cell, "frame"));
    const double left = std::max(kLeft, place - plot.half_frame());
    const double right = std::min(kRight, place + plot.half_frame());
    svg += fmt::format(
        "<rect class=\"wrong\" x=\"{:.1f}\" y=\"{:.1f}\" width=\"{:.1f}\" height=\"{:.1f}\" "
        "fill-opacity=\"{:.2f}\"/>",
        left, top + kStripRow * number_at(*cell, "region"), right - left, kStripRow - 1.0,
        0.25 + 0.75 * number_at(*cell, "sigmas") / most);
  }
  for (std::size_t n = 0; n < names.size(); ++n) {
    svg += fmt::format("<text class=\"part\" x=\"{}\" y=\"{:.1f}\">{}</text>", kLeft + 2.0,
                       top + kStripRow * static_cast<double>(n + 1) - 3.5,
                       escaped(names[n].get<std::string>()));
  }
  return svg;
}

const Json* worst_cell(const Recording& recording) {
  const Json* worst = nullptr;
  for (const Json* cell : recording.wrong) {
    if (worst == nullptr || number_at(*cell, "sigmas") > number_at(*worst, "sigmas")) worst = cell;
  }
  return worst;
}

std::string chart(const std::string& name, const Recording& recording, const Json& regions,
                  const ShownUnit& unit) {
  double most = 0.0;
  for (const auto* values : {&recording.before, &recording.after, &recording.noise}) {
    for (const double value : *values) most = std::isfinite(value) ? std::max(most, value) : most;
  }
  const double low = recording.frames.front();
  const double high = recording.frames.back();
  if (!(high > low) || !(most > 0.0)) return {};
  const Plot plot(low, high, most, kCurveHeight);
  const Json names = recording.wrong.empty() ? Json::array() : regions.value(name, Json::array());
  const double strip = names.empty() ? 0.0 : kStripRow * static_cast<double>(names.size()) + 6.0;
  const double under = plot.base() + strip;
  std::string html = "<figure><figcaption>" + escaped(name) + "</figcaption>";
  html += begin_svg(under + 22.0, "root mean square residual of " + name + " over its frames");
  html += held_out_bands(plot, recording, under);
  html += plot.shaded(recording.frames, recording.floor, "solver");
  html += plot.shaded(recording.frames, recording.noise, "noise");
  html += plot.curve(recording.frames, recording.before, "before");
  html += plot.curve(recording.frames, recording.after, "after");
  if (strip > 0.0) html += wrong_strip(plot, recording, names, plot.base() + 5.0);
  html += plot.axis(under + 16.0);
  html += marked(most, unit.words(most), fmt::format("text x=\"{}\" y=\"{}\"", kLeft, kTop - 8.0));
  html += "</svg>";
  if (const Json* worst = worst_cell(recording)) {
    html += "<p class=\"dim\">Farthest from noise in frame " + whole(number_at(*worst, "frame"));
    const double region = number_at(*worst, "region");
    if (names.size() > 1 && region >= 0.0 && region < double(names.size())) {
      html += ", part " + escaped(names[static_cast<std::size_t>(region)].get<std::string>());
    }
    html += ": " + shown(number_at(*worst, "sigmas")) + " times its standard deviation.</p>";
  }
  return html + "</figure>";
}

std::string legend(bool after, bool solver, bool held, bool wrong) {
  std::string html = "<p class=\"legend\">";
  const auto entry = [&](bool there, const char* kind, const char* words) {
    if (there) html += std::string("<span><i class=\"") + kind + "\"></i>" + words + "</span>";
  };
  entry(true, "before", "fitted model");
  entry(after, "after", "with the extended model");
  entry(true, "noise", "noise of the recording");
  entry(solver, "solver", "with the solver’s own error");
  entry(held, "held", "held out");
  entry(wrong, "wrong", "parts of the body that are wrong");
  return html + "</p>";
}

bool any_finite(const std::vector<double>& values) {
  return std::ranges::any_of(values, [](double value) { return std::isfinite(value); });
}

}  // namespace

std::string residual_charts(const Json& report) {
  const Json residual = report.value("residual", Json::object());
  const auto recordings = recordings_of(residual);
  const ShownUnit unit(report);
  const Json regions = residual.value("regions", Json::object());
  std::string html;
  bool after = false;
  bool held = false;
  bool wrong = false;
  for (const auto& [name, recording] : recordings) {
    html += chart(name, recording, regions, unit);
    after = after || any_finite(recording.after);
    held = held || std::ranges::count(recording.held_out, true) > 0;
    wrong = wrong || !recording.wrong.empty();
  }
  if (html.empty()) return {};
  return "<h2>Residual over time</h2>" +
         legend(after, number_at(report, "numerical") > 0.0, held, wrong) +
         "<div class=\"charts\">" + html + "</div>";
}

std::string evidence_charts(const Json& cause) {
  std::string html;
  for (const Json& recording : cause.value("evidence_by_frame", Json::array())) {
    std::vector<double> frames;
    std::vector<double> scores;
    double most = 0.0;
    for (std::size_t i = 0; i < recording.at("frames").size(); ++i) {
      const Json& score = recording.at("score").at(i);
      if (!score.is_number()) continue;
      frames.push_back(recording.at("frames").at(i).get<double>());
      scores.push_back(score.get<double>());
      most = std::max(most, scores.back());
    }
    if (frames.size() < 2 || !(most > 0.0)) continue;
    constexpr double kLow = 44.0;
    const Plot plot(frames.front(), frames.back(), most, kLow);
    html += "<figure>" +
            begin_svg(kTop + kLow + 22.0, "score of this cause over a window about each frame") +
            plot.shaded(frames, scores, "score") + plot.axis(plot.base() + 16.0);
    html += fmt::format("<text x=\"{}\" y=\"{}\">When the evidence arrives, up to T = ", kLeft,
                        kTop - 8.0) +
            marked(most, fmt::format("{:.3g}", most), "tspan") + "</text>";
    html += fmt::format("<text x=\"{}\" y=\"{}\" text-anchor=\"end\">{}</text></svg></figure>",
                        kRight, kTop - 8.0, escaped(text_at(recording, "capture")));
  }
  return html.empty() ? html : "<div class=\"charts\">" + html + "</div>";
}

}  // namespace matterfit::job::page
