// SPDX-License-Identifier: GPL-3.0-or-later
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include "job/curves.hpp"
#include "job/documents/excitation_document.hpp"
#include "job/documents/markup.hpp"
#include "material/stress_curves.hpp"

namespace matterfit::job {
namespace {

constexpr double kGraphWidth = 260.0;
constexpr double kGraphHeight = 200.0;
constexpr double kGraphLeft = 62.0;
constexpr double kGraphTop = 52.0;
constexpr double kGraphGap = 72.0;
constexpr double kPictureWidth = kGraphLeft + 3.0 * kGraphWidth + 2.0 * kGraphGap + 20.0;
constexpr double kLegendLine = 18.0;
/// Inks of the curves, the material's own first. Distinct in grey too.
constexpr std::array kInks = {"#1f5fa8", "#d1741b", "#4d8f3a"};
constexpr std::array kDashes = {"", " stroke-dasharray='7 4'", " stroke-dasharray='2 3'"};

/// From low to high, widened so that it is no point.
struct Span {
  double low = std::numeric_limits<double>::infinity();
  double high = -std::numeric_limits<double>::infinity();
  void take(double value) {
    low = std::min(low, value);
    high = std::max(high, value);
  }
  [[nodiscard]] double part(double value) const { return (value - low) / (high - low); }
};

/// 1, 2 or 5 times a power of ten, so that about four lie in the span.
double tick_step(const Span& span) {
  const double rough = (span.high - span.low) / 4.0;
  const double power = std::pow(10.0, std::floor(std::log10(rough)));
  const double part = rough / power;
  return power * (part < 1.5 ? 1.0 : part < 3.5 ? 2.0 : part < 7.5 ? 5.0 : 10.0);
}

std::vector<double> ticks(const Span& span) {
  const double step = tick_step(span);
  std::vector<double> all;
  for (double k = std::ceil(span.low / step - 1e-9); k * step <= span.high + 1e-9 * step;
       k += 1.0) {
    all.push_back(k * step + 0.0);
  }
  return all;
}

/// Pa, kPa or MPa by the largest stress.
struct StressUnit {
  double by;
  const char* name;
};
StressUnit unit_of(double largest) {
  if (largest >= 1e6) return {1e-6, "MPa"};
  if (largest >= 1e3) return {1e-3, "kPa"};
  return {1.0, "Pa"};
}

const char* along_name(material::Pull pull) {
  return pull == material::Pull::kShear ? "shear" : "stretch";
}

std::string graph(material::Pull pull, const Json& curves, double left) {
  const std::string key(pull_name(pull));
  Span x;
  Span y;
  y.take(0.0);
  for (const Json& curve : curves.at("curves")) {
    if (curve.at(key).is_null()) continue;
    for (const Json& value : curve.at(key).at(along_name(pull))) x.take(value.get<double>());
    for (const Json& value : curve.at(key).at("nominal")) y.take(value.get<double>());
  }
  std::string svg = fmt::format("<text x='{:.1f}' y='{:.1f}' font-weight='bold'>{}</text>\n", left,
                                kGraphTop - 12.0, key);
  if (!(x.high > x.low)) {
    return svg + fmt::format("<text x='{:.1f}' y='{:.1f}'>could not be followed</text>\n", left,
                             kGraphTop + 0.5 * kGraphHeight);
  }
  if (!(y.high > y.low)) y.high = y.low + 1.0;
  const StressUnit unit = unit_of(std::max(std::abs(y.low), std::abs(y.high)));
  const auto across = [&](double value) { return left + kGraphWidth * x.part(value); };
  const auto up = [&](double value) { return kGraphTop + kGraphHeight * (1.0 - y.part(value)); };
  const double bottom = kGraphTop + kGraphHeight;
  if (const Json& seen = curves.at("excited"); seen.is_object()) {
    const double strain = seen.at("strain").get<double>();
    const double from =
        std::max(x.low, pull == material::Pull::kShear ? 0.0 : pull_at(pull, -strain));
    const double to = std::min(x.high, pull_at(pull, strain));
    svg += fmt::format(
        "<rect x='{:.1f}' y='{:.1f}' width='{:.1f}' height='{:.1f}' fill='#1f5fa8' "
        "fill-opacity='.12'/>\n",
        across(from), kGraphTop, across(to) - across(from), kGraphHeight);
  }
  for (const double value : ticks(x)) {
    svg += fmt::format(
        "<path d='M{0:.1f} {1:.1f}V{2:.1f}' stroke='#999'/><text x='{0:.1f}' y='{3:.1f}' "
        "text-anchor='middle'>{4:.4g}</text>\n",
        across(value), bottom, bottom + 4.0, bottom + 17.0, value);
  }
  Span shown = y;
  shown.low *= unit.by;
  shown.high *= unit.by;
  for (const double value : ticks(shown)) {
    const double at = up(value / unit.by);
    svg += fmt::format(
        "<path d='M{0:.1f} {1:.1f}H{2:.1f}' stroke='#ddd'/><text x='{3:.1f}' y='{4:.1f}' "
        "text-anchor='end'>{5:.4g}</text>\n",
        left, at, left + kGraphWidth, left - 5.0, at + 4.0, value);
  }
  svg += fmt::format(
      "<path d='M{0:.1f} {1:.1f}V{2:.1f}H{3:.1f}' fill='none' stroke='#555'/>\n"
      "<text x='{4:.1f}' y='{5:.1f}' text-anchor='middle'>{6}</text>\n"
      "<text x='{7:.1f}' y='{8:.1f}' text-anchor='end'>nominal stress [{9}]</text>\n",
      left, kGraphTop, bottom, left + kGraphWidth, left + 0.5 * kGraphWidth, bottom + 32.0,
      along_name(pull), left + kGraphWidth, kGraphTop - 12.0, unit.name);
  std::size_t place = 0;
  for (const Json& curve : curves.at("curves")) {
    const std::size_t ink = std::min(place++, kInks.size() - 1);
    if (curve.at(key).is_null()) continue;
    const auto xs = curve.at(key).at(along_name(pull)).get<std::vector<double>>();
    const auto ys = curve.at(key).at("nominal").get<std::vector<double>>();
    std::string path;
    for (std::size_t k = 0; k < xs.size(); ++k) {
      path += fmt::format("{}{:.1f} {:.1f}", k == 0 ? "M" : "L", across(xs[k]), up(ys[k]));
    }
    svg += fmt::format("<path d='{}' fill='none' stroke='{}' stroke-width='1.8'{}/>\n", path,
                       kInks[ink], kDashes[ink]);
  }
  return svg;
}

/// At spaces, so that no line is longer where a word is not.
std::vector<std::string> wrapped(const std::string& text) {
  constexpr std::size_t kMostBytes = 150;
  std::vector<std::string> lines;
  std::string rest = text;
  while (rest.size() > kMostBytes) {
    const std::size_t at = rest.rfind(' ', kMostBytes);
    if (at == std::string::npos || at == 0) break;
    lines.push_back(rest.substr(0, at));
    rest.erase(0, at + 1);
  }
  if (!rest.empty()) lines.push_back(rest);
  return lines;
}

}  // namespace

std::string curves_picture(const std::string& name, const Json& curves) {
  const Json& list = curves.at("curves");
  const bool seen = curves.at("excited").is_object();
  const double legend = kGraphTop + kGraphHeight + 56.0;
  const std::vector<std::string> sentence = wrapped(curves.value("sentence", ""));
  const double height =
      legend + kLegendLine * double(list.size() + (seen ? 1 : 0) + sentence.size());
  std::string svg = fmt::format(
      "<?xml version='1.0' encoding='UTF-8'?>\n"
      "<svg xmlns='http://www.w3.org/2000/svg' viewBox='0 0 {0:.0f} {1:.0f}' width='{0:.0f}' "
      "height='{1:.0f}' font-family='system-ui, sans-serif' font-size='12'>\n"
      "<rect width='100%' height='100%' fill='white'/>\n"
      "<text x='{2:.0f}' y='20' font-size='15' font-weight='bold'>{3}: stress against stretch at "
      "{4:.3g} 1/s</text>\n",
      kPictureWidth, height, kGraphLeft, escaped(name), curves.at("rate").get<double>());
  double left = kGraphLeft;
  for (const material::Pull pull : material::kPulls) {
    svg += graph(pull, curves, left);
    left += kGraphWidth + kGraphGap;
  }
  double line = legend;
  for (std::size_t k = 0; k < list.size(); ++k, line += kLegendLine) {
    const std::size_t ink = std::min(k, kInks.size() - 1);
    const std::string what = list[k].at("what").get<std::string>();
    const char* before = what == "nearest" ? "nearest known law: "
                         : what == "alone" ? "without the correction: "
                                           : "";
    svg += fmt::format(
        "<path d='M{:.0f} {:.1f}h32' stroke='{}' stroke-width='1.8'{}/><text x='{:.0f}' "
        "y='{:.1f}'>{}{}</text>\n",
        kGraphLeft, line - 4.0, kInks[ink], kDashes[ink], kGraphLeft + 42.0, line, before,
        escaped(list[k].at("label").get<std::string>()));
  }
  if (seen) {
    const material::Excitation over = read_excitation(JsonValue(curves.at("excited"), "excited"));
    svg += fmt::format(
        "<rect x='{:.0f}' y='{:.1f}' width='32' height='12' fill='#1f5fa8' fill-opacity='.12'/>"
        "<text x='{:.0f}' y='{:.1f}'>seen when it was fitted: strains up to {:.2g}, ln J from "
        "{:.2g} to {:.2g}, {:.2g} to {:.2g} 1/s</text>\n",
        kGraphLeft, line - 11.0, kGraphLeft + 42.0, line, over.strain, -over.compression,
        over.expansion, over.slowest, over.fastest);
    line += kLegendLine;
  }
  for (const std::string& words : sentence) {
    svg += fmt::format("<text x='{:.0f}' y='{:.1f}'>{}</text>\n", kGraphLeft, line, escaped(words));
    line += kLegendLine;
  }
  return svg + "</svg>\n";
}

}  // namespace matterfit::job
