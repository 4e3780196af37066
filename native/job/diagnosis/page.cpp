// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/diagnosis/page.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <vector>

#include "job/documents/markup.hpp"

namespace matterfit::job {
namespace {

constexpr double kWidth = 720.0;
constexpr double kHeight = 240.0;
constexpr double kMargin = 48.0;

constexpr const char* kStyle = R"(
:root { color-scheme: light dark; }
body { font: 16px/1.5 system-ui, sans-serif; margin: 0 auto; max-width: 62rem; padding: 1rem; }
h1 { font-size: 1.5rem; } h2 { font-size: 1.15rem; margin-top: 2rem; }
.verdict { border-left: .4rem solid #2a6fb0; padding: .5rem 1rem; background: #2a6fb01a; }
.scroll { overflow-x: auto; }
table { border-collapse: collapse; min-width: 36rem; }
th, td { text-align: left; padding: .35rem .7rem; border-bottom: 1px solid #8886; vertical-align: top; }
td.number { text-align: right; font-variant-numeric: tabular-nums; white-space: nowrap; }
svg { width: 100%; height: auto; } svg text { font-size: 12px; fill: currentColor; }
.dim { opacity: .75; }
)";

std::string text_at(const Json& json, const char* key) {
  const auto found = json.find(key);
  return found != json.end() && found->is_string() ? found->get<std::string>() : std::string();
}

/// NaN where there is none.
double number_at(const Json& json, const char* key) {
  const auto found = json.find(key);
  return found != json.end() && found->is_number() ? found->get<double>() : std::nan("");
}

std::string shown(double value) {
  return std::isfinite(value) ? fmt::format("{:.3g}", value) : std::string("–");
}

/// In which sizes of residuals are shown; of recordings of motion millimetres.
struct ShownUnit {
  std::string name = "mm";
  double factor = 1e3;
  explicit ShownUnit(const Json& report) {
    const Json given = report.value("shown", Json::object());
    if (!text_at(given, "unit").empty() && std::isfinite(number_at(given, "factor"))) {
      name = text_at(given, "unit");
      factor = number_at(given, "factor");
    }
  }
  [[nodiscard]] std::string operator()(double size) const {
    return std::isfinite(size) ? fmt::format("{:.3g} {}", factor * size, escaped(name))
                               : std::string("–");
  }
};

std::string percent(double share) {
  return std::isfinite(share) ? fmt::format("{:.0f} %", 100.0 * share) : std::string("–");
}

std::string listed(const Json& names) {
  std::string text;
  for (const Json& name : names) {
    text += text.empty() ? "" : ", ";
    text += escaped(name.is_string() ? name.get<std::string>() : text_at(name, "effect"));
  }
  return text;
}

std::string parameters_of(const Json& cause) {
  std::string text;
  const Json parameters = cause.value("parameters", Json::object());
  for (const auto& [name, parameter] : parameters.items()) {
    text += text.empty() ? "" : "<br>";
    text += escaped(name) + " = " + shown(number_at(parameter, "value"));
    if (std::isfinite(number_at(parameter, "stderr"))) {
      text += " ± " + shown(number_at(parameter, "stderr"));
    }
    text += " " + escaped(text_at(parameter, "unit"));
  }
  return text;
}

std::string causes_table(const Json& report) {
  const Json causes = report.value("causes", Json::array());
  if (causes.empty()) return {};
  const ShownUnit size(report);
  std::string html =
      "<h2>Causes</h2><div "
      "class=\"scroll\"><table><tr><th>Cause</th><th>Value</th>"
      "<th>Probability</th><th>Held-out "
      "error</th><th>Gain</th><th>Confused with</th></tr>";
  for (const Json& cause : causes) {
    html += "<tr><td><b>" + escaped(text_at(cause, "effect")) + "</b><br>" +
            escaped(text_at(cause, "evidence")) + "</td><td>" + parameters_of(cause) +
            "</td><td class=\"number\">" + percent(number_at(cause, "probability")) +
            "</td><td class=\"number\">" + size(number_at(cause, "holdout_before")) + " → " +
            size(number_at(cause, "holdout_after")) + "</td><td class=\"number\">" +
            percent(number_at(cause, "gain"));
    if (const Json interval = cause.value("gain_interval", Json()); interval.size() == 2) {
      html += "<br><span class=\"dim\">" + percent(interval[0].get<double>()) + " … " +
              percent(interval[1].get<double>()) + "</span>";
    }
    html += "</td><td>" + listed(cause.value("confused_with", Json::array())) + "</td></tr>";
  }
  return html + "</table></div>";
}

/// One curve over the frames of a capture.
struct Curve {
  const char* key;
  const char* label;
  const char* colour;
  bool shaded;
};

constexpr Curve kCurves[] = {{"noise", "noise of the recording", "#8a8a8a", true},
                             {"numerical", "error of the grid", "#c9a227", true},
                             {"before", "fitted model", "#c0392b", false},
                             {"after", "with the causes named", "#2a6fb0", false}};

std::string chart(const std::string& name, const std::vector<const Json*>& rows,
                  const ShownUnit& unit) {
  double low = 1e300;
  double high = -1e300;
  double top = 0.0;
  for (const Json* row : rows) {
    const double frame = number_at(*row, "frame");
    low = std::min(low, frame);
    high = std::max(high, frame);
    for (const Curve& curve : kCurves) {
      const double value = unit.factor * number_at(*row, curve.key);
      if (std::isfinite(value)) top = std::max(top, value);
    }
  }
  if (!(high > low) || !(top > 0.0)) return {};
  const auto x = [&](double frame) {
    return kMargin + (kWidth - 1.5 * kMargin) * (frame - low) / (high - low);
  };
  const auto y = [&](double value) {
    return kHeight - kMargin - (kHeight - 1.6 * kMargin) * value / top;
  };
  std::string svg = fmt::format(
      "<h2>Residual of {}</h2><svg viewBox=\"0 0 {} "
      "{}\" role=\"img\" aria-label=\"root mean "
      "square "
      "residual over frames\">",
      escaped(name), kWidth, kHeight);
  for (const Curve& curve : kCurves) {
    std::string points;
    double last = low;
    for (const Json* row : rows) {
      const double value = unit.factor * number_at(*row, curve.key);
      if (!std::isfinite(value)) continue;
      last = number_at(*row, "frame");
      points += fmt::format("{:.1f},{:.1f} ", x(last), y(value));
    }
    if (points.empty()) continue;
    if (curve.shaded) {
      svg += fmt::format(
          "<polygon points=\"{:.1f},{:.1f} {}{:.1f},{:.1f}\" "
          "fill=\"{}\" fill-opacity=\".25\"/>",
          x(low), y(0.0), points, x(last), y(0.0), curve.colour);
    } else {
      svg += fmt::format(
          "<polyline points=\"{}\" fill=\"none\" stroke=\"{}\" "
          "stroke-width=\"2\"/>",
          points, curve.colour);
    }
  }
  svg += fmt::format(
      "<line x1=\"{0}\" y1=\"{1}\" x2=\"{2}\" y2=\"{1}\" "
      "stroke=\"currentColor\"/>"
      "<text x=\"{0}\" y=\"{3}\">frame {4:.0f}</text>"
      "<text x=\"{2}\" y=\"{3}\" text-anchor=\"end\">{5:.0f}</text>"
      "<text x=\"{6}\" y=\"{7:.1f}\" text-anchor=\"end\">{8:.3g} {9}</text>",
      kMargin, y(0.0), x(high), y(0.0) + 18.0, low, high, kMargin - 4.0, y(top) + 4.0, top,
      escaped(unit.name));
  double legend = kMargin;
  for (const Curve& curve : kCurves) {
    svg += fmt::format(
        "<rect x=\"{0}\" y=\"{1}\" width=\"10\" height=\"10\" fill=\"{2}\"/>"
        "<text x=\"{3}\" y=\"{4}\">{5}</text>",
        legend, kHeight - 16.0, curve.colour, legend + 14.0, kHeight - 7.0, curve.label);
    legend += 165.0;
  }
  return svg + "</svg>";
}

std::string charts(const Json& report) {
  std::map<std::string, std::vector<const Json*>> captures;
  const Json& residual = report.contains("residual") ? report["residual"] : report;
  const auto rows = residual.find("by_frame");
  if (rows == residual.end()) return {};
  for (const Json& row : *rows) captures[text_at(row, "capture")].push_back(&row);
  std::string html;
  for (const auto& [name, list] : captures) html += chart(name, list, ShownUnit(report));
  return html;
}

std::string residual_lines(const Json& report) {
  if (!report.contains("residual")) return {};
  const Json& residual = report["residual"];
  const ShownUnit size(report);
  const auto line = [&](const char* key, const char* label) -> std::string {
    const Json part = residual.value(key, Json::object());
    if (!std::isfinite(number_at(part, "rms"))) return {};
    return std::string("<tr><td>") + label + "</td><td class=\"number\">" +
           size(number_at(part, "rms")) + "</td><td class=\"number\">" +
           size(number_at(part, "p95")) + "</td></tr>";
  };
  std::string html =
      "<h2>How far the fitted model is off</h2><div "
      "class=\"scroll\"><table><tr><th></th>"
      "<th>root mean square</th><th>95 %</th></tr>";
  html += line("train", "what the fit saw") + line("holdout", "what was held out");
  html += "</table></div><p class=\"dim\">Noise of the recording " +
          size(number_at(report.value("noise", Json::object()), "sigma")) + ", autocorrelation " +
          shown(number_at(report.value("noise", Json::object()), "autocorrelation")) +
          (number_at(report, "numerical") > 0.0
               ? "; the solver's own error " + size(number_at(report, "numerical"))
               : "") +
          ".</p>";
  return html;
}

std::string limits(const Json& report) {
  std::string html;
  if (const Json hidden = report.value("not_observable", Json::array()); !hidden.empty()) {
    html += "<h2>Not observable in this recording</h2><p>" + listed(hidden) + "</p>";
  }
  const Json limits = report.value("detection_limits", Json::object());
  if (!limits.empty()) {
    html +=
        "<h2>What would have been seen</h2><div "
        "class=\"scroll\"><table><tr><th>Cause</th>"
        "<th>from a size of</th></tr>";
    for (const auto& [name, limit] : limits.items()) {
      html += "<tr><td>" + escaped(name) + "</td><td class=\"number\">" +
              shown(number_at(limit, "value")) + " " + escaped(text_at(limit, "unit")) +
              "</td></tr>";
    }
    html += "</table></div>";
  }
  return html;
}

}  // namespace

std::string report_page(const Json& report) {
  std::string html =
      "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">"
      "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">"
      "<link rel=\"icon\" href=\"data:,\"><title>Matterfit "
      "report</title><style>";
  html += kStyle;
  html +=
      "</style></head><body><h1>What the simulation gets wrong</h1><p "
      "class=\"verdict\">";
  html += escaped(text_at(report, "sentence")) + "</p>";
  if (const std::string next = text_at(report, "next_recording"); !next.empty()) {
    html += "<p><b>Record next:</b> " + escaped(next) + "</p>";
  }
  html += causes_table(report) + residual_lines(report) + charts(report) + limits(report);
  if (const Json statements = report.value("statements", Json::array()); !statements.empty()) {
    html += "<h2>Notes</h2><ul>";
    for (const Json& statement : statements) {
      if (statement.is_string()) html += "<li>" + escaped(statement.get<std::string>()) + "</li>";
    }
    html += "</ul>";
  }
  return html + "</body></html>\n";
}

}  // namespace matterfit::job
