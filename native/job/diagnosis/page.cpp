// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/diagnosis/page.hpp"

#include <set>
#include <vector>

#include "job/diagnosis/page_charts.hpp"
#include "job/diagnosis/page_text.hpp"

namespace matterfit::job {
namespace page {
namespace {

constexpr const char* kStyle = R"(
:root { color-scheme: light dark; --line: #8885; --before: #c0392b; --after: #2a7fc8; --noise: #8a8a8a;
  --solver: #c9a227; --held: #2a7fc8; }
* { box-sizing: border-box; }
body { font: 16px/1.5 system-ui, sans-serif; margin: 0 auto; max-width: 62rem; padding: 1rem;
  overflow-wrap: break-word; }
h1 { font-size: 1.5rem; line-height: 1.25; } h2 { font-size: 1.2rem; margin: 2rem 0 .6rem; }
.verdict { border-left: .4rem solid var(--after); padding: .6rem 1rem; background: #2a7fc81a;
  border-radius: 0 .4rem .4rem 0; }
.dim, dt, summary .likely { opacity: .75; }
.scroll { overflow-x: auto; }
table { border-collapse: collapse; }
th, td { text-align: left; padding: .35rem .8rem .35rem 0; border-bottom: 1px solid var(--line);
  vertical-align: top; }
th { font-weight: 600; font-size: .85rem; }
td.number, th.number { text-align: right; }
td.number { font-variant-numeric: tabular-nums; white-space: nowrap; }
th { min-width: 4rem; } td:first-child { min-width: 5rem; }
details { border: 1px solid var(--line); border-radius: .5rem; padding: .6rem .9rem; margin: .6rem 0; }
details.named { border: 2px solid var(--after); }
summary { cursor: pointer; display: flex; flex-wrap: wrap; gap: .2rem .8rem; align-items: baseline; }
summary b { flex: 1 1 auto; } summary b::first-letter { text-transform: uppercase; }
details p { margin: .5rem 0 0; }
dl { display: grid; grid-template-columns: repeat(auto-fill, minmax(8.5rem, 1fr)); gap: .5rem 1rem;
  margin: .7rem 0 0; }
dt { font-size: .8rem; } dd { margin: 0; font-variant-numeric: tabular-nums; }
.charts { display: grid; grid-template-columns: repeat(auto-fit, minmax(min(100%, 22rem), 1fr)); gap: 1rem; }
figure { margin: .4rem 0; max-width: 40rem; } figcaption { font-weight: 600; font-size: .9rem; }
svg { width: 100%; height: auto; display: block; } svg text { font-size: 12px; fill: currentColor; }
svg .part { font-size: 9.5px; opacity: .8; }
polyline { fill: none; stroke-width: 2; stroke-linejoin: round; }
polyline.before { stroke: var(--before); } polyline.after { stroke: var(--after); }
polygon.noise { fill: var(--noise); fill-opacity: .45; }
polygon.solver { fill: var(--solver); fill-opacity: .45; }
polygon.score { fill: var(--after); fill-opacity: .55; }
rect.held { fill: var(--held); fill-opacity: .12; } rect.wrong { fill: var(--before); }
line.axis { stroke: currentColor; }
.legend { display: flex; flex-wrap: wrap; gap: .2rem 1.2rem; font-size: .85rem; margin: .3rem 0; }
.legend i { display: inline-block; width: 1rem; height: .7rem; margin-right: .4rem; border-radius: 2px; }
i.before { background: var(--before); height: .2rem !important; vertical-align: middle; }
i.after { background: var(--after); height: .2rem !important; vertical-align: middle; }
i.noise { background: var(--noise); opacity: .6; } i.solver { background: var(--solver); opacity: .6; }
i.held { background: var(--held); opacity: .25; } i.wrong { background: var(--before); opacity: .6; }
)";

void add_entry(std::string& html, const std::string& name, const std::string& value) {
  html += "<div><dt>" + name + "</dt><dd>" + value + "</dd></div>";
}

std::string value_of(const Json& parameter) {
  std::string text = shown(number_at(parameter, "value"));
  if (std::isfinite(number_at(parameter, "stderr"))) {
    text += " ± " + shown(number_at(parameter, "stderr"));
  }
  const std::string unit = text_at(parameter, "unit");
  return unit.empty() ? text : text + " " + escaped(unit);
}

/// The numbers of one cause.
std::string numbers_of(const Json& cause, const ShownUnit& size) {
  std::string html = "<dl>";
  const Json parameters = cause.value("parameters", Json::object());
  for (const auto& [name, parameter] : parameters.items()) {
    add_entry(html, plain_name(name), value_of(parameter));
  }
  if (cause.value("refitted", false)) {
    add_entry(html, "share of the excess explained", percent(number_at(cause, "explained")));
    if (const double gain = number_at(cause, "gain"); std::isfinite(gain)) {
      std::string text = percent(gain);
      const Json interval = cause.value("gain_interval", Json());
      if (interval.is_array() && interval.size() == 2 && interval[0].is_number() &&
          interval[1].is_number()) {
        text += " (" + percent(interval[0].get<double>()) + " to " +
                percent(interval[1].get<double>()) + ")";
      }
      add_entry(html, "gain on what was held out", text);
      add_entry(html, "held-out error",
                size(number_at(cause, "holdout_before")) + " → " +
                    size(number_at(cause, "holdout_after")));
      add_entry(html, "of which noise and solver", size(number_at(cause, "holdout_floor")));
      add_entry(html, "the last residual kept", size(number_at(cause, "last_residual")));
      add_entry(html, "a free force field", size(number_at(cause, "free_field")));
    }
  }
  add_entry(html, "score T", shown(number_at(cause, "score")));
  add_entry(html, "p where nothing is hidden", shown(number_at(cause, "p")));
  add_entry(html, "left when the fit adapts", percent(number_at(cause, "keep")));
  if (const double share = number_at(cause, "absorbed"); std::isfinite(share)) {
    add_entry(html, "of which another law could make", percent(share));
  }
  if (const Json rivals = cause.value("confused_with", Json::array()); !rivals.empty()) {
    add_entry(html, "looks like", listed(rivals));
  }
  if (const std::string scope = text_at(cause, "scope"); !scope.empty() && scope != "shared") {
    add_entry(html, "scope", escaped(scope));
  }
  return html + "</dl>";
}

std::string causes_of(const Json& report) {
  const Json causes = report.value("causes", Json::array());
  if (causes.empty()) return {};
  const ShownUnit size(report);
  const Json named = report.value("class", Json::array());
  std::string html = "<h2>Causes</h2>";
  if (std::isfinite(number_at(report, "tested"))) {
    html += "<p class=\"dim\">Of " + whole(number_at(report, "tested")) +
            " that were tested the most probable are listed. Nothing hidden: " +
            percent(number_at(report.value("probability", Json::object()), "nothing")) +
            ", something unknown: " +
            percent(number_at(report.value("probability", Json::object()), "unknown")) + ".</p>";
  }
  for (const Json& cause : causes) {
    const bool is_named = std::ranges::count(named, Json(text_at(cause, "effect"))) > 0;
    html += is_named ? "<details class=\"named\" open>" : "<details>";
    html += "<summary><b>" + plain_name(text_at(cause, "effect")) + "</b><span class=\"likely\">" +
            percent(number_at(cause, "probability")) + " likely</span></summary>";
    for (const char* key : {"sentence", "where", "evidence"}) {
      if (const std::string text = text_at(cause, key); !text.empty()) {
        html += "<p>" + escaped(text) + "</p>";
      }
    }
    html += numbers_of(cause, size);
    if (is_named) html += evidence_charts(cause);
    html += "</details>";
  }
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
      "<h2>How far the fitted model is off</h2><div class=\"scroll\"><table><tr><th></th>"
      "<th class=\"number\">root mean square</th><th class=\"number\">all but a twentieth "
      "below</th></tr>";
  html += line("train", "what the fit saw") + line("holdout", "what was held out");
  const Json noise = report.value("noise", Json::object());
  html += "</table></div><p class=\"dim\">Noise of the recording " +
          size(number_at(noise, "sigma")) + ", autocorrelation " +
          shown(number_at(noise, "autocorrelation")) +
          (number_at(report, "numerical") > 0.0
               ? "; the solver’s own error " + size(number_at(report, "numerical"))
               : "") +
          ".</p>";
  return html;
}

std::string worst_frames_of(const Json& report) {
  const Json worst = report.value("residual", Json::object()).value("worst", Json::array());
  if (worst.empty()) return {};
  const ShownUnit size(report);
  std::set<std::string> captures;
  bool placed = false;
  for (const Json& row : worst) {
    captures.insert(text_at(row, "capture"));
    // Tests of a machine have no places.
    for (const Json& part : row.value("where", Json::array())) {
      placed = placed || (part.is_number() && part.get<double>() != 0.0 && size.name == "mm");
    }
  }
  std::string html =
      "<h2>Worst frames</h2><div class=\"scroll\"><table><tr>"
      "<th class=\"number\">Frame</th><th class=\"number\">Farthest point</th>";
  if (placed) html += "<th class=\"number\">at x, y, z [m]</th>";
  if (captures.size() > 1) html += "<th>Recording</th>";
  html += "</tr>";
  for (const Json& row : worst) {
    html += "<tr><td class=\"number\">" + whole(number_at(row, "frame")) +
            "</td><td class=\"number\">" + size(number_at(row, "size")) + "</td>";
    if (placed) {
      std::string where;
      for (const Json& part : row.at("where")) {
        where += (where.empty() ? "" : ", ") + shown(part.get<double>());
      }
      html += "<td class=\"number\">" + where + "</td>";
    }
    if (captures.size() > 1) html += "<td>" + escaped(text_at(row, "capture")) + "</td>";
    html += "</tr>";
  }
  return html + "</table></div>";
}

std::string limits(const Json& report) {
  std::string html;
  if (const Json hidden = report.value("not_observable", Json::array()); !hidden.empty()) {
    html += "<h2>Not observable in this recording</h2><p>" + listed(hidden) + "</p>";
  }
  const Json limits = report.value("detection_limits", Json::object());
  if (!limits.empty()) {
    html +=
        "<h2>What would have been seen</h2><div class=\"scroll\"><table><tr><th>Cause</th>"
        "<th class=\"number\">from a size of</th></tr>";
    for (const auto& [name, limit] : limits.items()) {
      // Effect and number.
      const auto dot = name.rfind('.');
      html += "<tr><td>" + plain_name(name.substr(0, dot)) +
              (dot == std::string::npos ? "" : ": " + plain_name(name.substr(dot + 1))) +
              "</td><td class=\"number\">" + shown(number_at(limit, "value")) + " " +
              escaped(text_at(limit, "unit")) + "</td></tr>";
    }
    html += "</table></div>";
  }
  return html;
}

std::string notes_of(const Json& report) {
  const Json statements = report.value("statements", Json::array());
  if (statements.empty()) return {};
  std::string html = "<h2>Notes</h2><ul>";
  for (const Json& statement : statements) {
    if (statement.is_string()) html += "<li>" + escaped(statement.get<std::string>()) + "</li>";
  }
  return html + "</ul>";
}

}  // namespace
}  // namespace page

std::string report_page(const Json& report) {
  std::string html =
      "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">"
      "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">"
      "<link rel=\"icon\" href=\"data:,\"><title>Matterfit "
      "report</title><style>";
  html += page::kStyle;
  html +=
      "</style></head><body><h1>What the simulation gets wrong</h1><p "
      "class=\"verdict\">";
  html += escaped(page::text_at(report, "sentence")) + "</p>";
  if (const std::string next = page::text_at(report, "next_recording"); !next.empty()) {
    html += "<p><b>Record next:</b> " + escaped(next) + "</p>";
  }
  html += page::causes_of(report) + page::residual_lines(report) + page::residual_charts(report) +
          page::worst_frames_of(report) + page::limits(report) + page::notes_of(report);
  return html + "</body></html>\n";
}

}  // namespace matterfit::job
