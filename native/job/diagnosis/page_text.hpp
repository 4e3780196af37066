// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string>

#include "job/documents/json_reader.hpp"
#include "job/documents/markup.hpp"

/// What the parts of a report's page share. Whatever number a page shows is written with the number
/// of the report it is of in `data-value`, to the last digit.
namespace matterfit::job::page {

[[nodiscard]] inline std::string text_at(const Json& json, const char* key) {
  const auto found = json.find(key);
  return found != json.end() && found->is_string() ? found->get<std::string>() : std::string();
}

/// NaN where there is none.
[[nodiscard]] inline double number_at(const Json& json, const char* key) {
  const auto found = json.find(key);
  return found != json.end() && found->is_number() ? found->get<double>() : std::nan("");
}

/// `tag` ("span", "text x=…") around `words` that show the number `value` of the report.
[[nodiscard]] inline std::string marked(double value, const std::string& words,
                                        const std::string& tag = "span") {
  return fmt::format("<{} data-value=\"{}\">{}</{}>", tag, Json(value).dump(), escaped(words),
                     tag.substr(0, tag.find(' ')));
}

/// To three digits; – where it is not finite.
[[nodiscard]] inline std::string shown(double value) {
  return std::isfinite(value) ? marked(value, fmt::format("{:.3g}", value)) : std::string("–");
}

[[nodiscard]] inline std::string whole(double value) {
  return std::isfinite(value) ? marked(value, fmt::format("{:.0f}", value)) : std::string("–");
}

/// Below 1 % and above 99 % without claiming all or nothing.
[[nodiscard]] inline std::string percent(double share) {
  if (!std::isfinite(share)) return "–";
  if (share > 0.0 && share < 0.01) return marked(share, "< 1 %");
  if (share > 0.99 && share < 1.0) return marked(share, "> 99 %");
  return marked(share, fmt::format("{:.0f} %", 100.0 * share));
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
  [[nodiscard]] std::string words(double size) const {
    return fmt::format("{:.3g} {}", factor * size, name);
  }
  [[nodiscard]] std::string operator()(double size) const {
    return std::isfinite(size) ? marked(size, words(size)) : std::string("–");
  }
};

/// drag_quadratic as "drag quadratic".
[[nodiscard]] inline std::string plain_name(std::string name) {
  std::ranges::replace(name, '_', ' ');
  return escaped(name);
}

/// Names, or the effects of entries, with commas between.
[[nodiscard]] inline std::string listed(const Json& names) {
  std::string text;
  for (const Json& name : names) {
    text += text.empty() ? "" : ", ";
    text += plain_name(name.is_string() ? name.get<std::string>() : text_at(name, "effect"));
  }
  return text;
}

}  // namespace matterfit::job::page
