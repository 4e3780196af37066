// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/documents/json_reader.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "base/error.hpp"
#include "job/documents/document_error.hpp"

namespace matterfit::job {
namespace {

constexpr std::size_t kLongestShown = 60;

std::string shown(const Json& json) {
  std::string text = json.dump(-1, ' ', false, Json::error_handler_t::replace);
  if (text.size() > kLongestShown) text = text.substr(0, kLongestShown - 1) + "…";
  return text;
}

std::string number_text(double value) {
  char text[40];
  std::snprintf(text, sizeof text, "%.15g", value);
  return text;
}

std::string range_text(const Range& range) {
  std::string text = "a number";
  const bool low = std::isfinite(range.low);
  const bool high = std::isfinite(range.high);
  if (low && high) {
    text += " from " + number_text(range.low) + (range.low_open ? " (excluded)" : "") + " to " +
            number_text(range.high);
  } else if (low) {
    text += (range.low_open ? " > " : " ≥ ") + number_text(range.low);
  } else if (high) {
    text += " ≤ " + number_text(range.high);
  }
  if (!range.unit.empty()) text += " [" + std::string(range.unit) + "]";
  return text;
}

std::size_t edit_distance(const std::string& a, const std::string& b) {
  std::vector<std::size_t> row(b.size() + 1);
  for (std::size_t j = 0; j <= b.size(); ++j) row[j] = j;
  for (std::size_t i = 1; i <= a.size(); ++i) {
    std::size_t diagonal = row[0];
    row[0] = i;
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t above = row[j];
      row[j] = std::min({above + 1, row[j - 1] + 1, diagonal + (a[i - 1] == b[j - 1] ? 0U : 1U)});
      diagonal = above;
    }
  }
  return row.back();
}

}  // namespace

void JsonValue::fail(const std::string& expected) const {
  throw DocumentError(ErrorKind::kInput, path_,
                      " is " + shown(*json_) + ", expected " + expected + ".");
}

void JsonValue::refuse(const std::string& message) const {
  throw DocumentError(ErrorKind::kInput, path_, ": " + message);
}

double JsonValue::number(const Range& range) const {
  if (!json_->is_number()) fail(range_text(range));
  const double value = json_->get<double>();
  const bool below = range.low_open ? value <= range.low : value < range.low;
  if (!std::isfinite(value) || below || value > range.high) fail(range_text(range));
  return value;
}

int JsonValue::integer(int low, int high) const {
  const std::string expected =
      "a whole number from " + std::to_string(low) + " to " + std::to_string(high);
  if (!json_->is_number()) fail(expected);
  const double value = json_->get<double>();
  if (!(value >= low && value <= high) || value != std::floor(value)) fail(expected);
  return static_cast<int>(value);
}

bool JsonValue::boolean() const {
  if (!json_->is_boolean()) fail("true or false");
  return json_->get<bool>();
}

std::string JsonValue::string() const {
  if (!json_->is_string()) fail("a text in quotes");
  return json_->get<std::string>();
}

std::size_t JsonValue::choice(std::initializer_list<std::string_view> choices) const {
  std::string expected = "one of ";
  std::size_t index = 0;
  for (const std::string_view name : choices) {
    if (json_->is_string() && json_->get_ref<const std::string&>() == name) return index;
    expected += (index++ == 0 ? "\"" : ", \"") + std::string(name) + "\"";
  }
  fail(expected);
}

Vec3d JsonValue::vec3(const Range& range) const {
  if (!json_->is_array() || json_->size() != 3) fail("three numbers [x, y, z]");
  Vec3d result;
  const auto values = items();
  for (int i = 0; i < 3; ++i) result[i] = values[static_cast<std::size_t>(i)].number(range);
  return result;
}

Vec3d JsonValue::unit_vec3() const {
  const Vec3d value = vec3();
  if (value.norm() < 1e-12) fail("a direction other than [0, 0, 0]");
  return value.normalized();
}

Quatd JsonValue::quaternion() const {
  if (!json_->is_array() || json_->size() != 4) fail("a quaternion [w, x, y, z]");
  const auto v = items();
  const Quatd q(v[0].number(), v[1].number(), v[2].number(), v[3].number());
  if (std::abs(q.norm() - 1.0) > 0.01) fail("a unit quaternion [w, x, y, z]");
  return q.normalized();
}

std::vector<JsonValue> JsonValue::items() const {
  if (!json_->is_array()) fail("a list [ … ]");
  std::vector<JsonValue> result;
  result.reserve(json_->size());
  for (std::size_t i = 0; i < json_->size(); ++i) {
    result.emplace_back((*json_)[i], path_ + "[" + std::to_string(i) + "]");
  }
  return result;
}

Points JsonValue::points() const {
  Points result;
  for (const JsonValue& item : items()) result.push_back(item.vec3());
  return result;
}

JsonObject::JsonObject(const JsonValue& value) : value_(value) {
  if (!value.json().is_object()) value.fail("an object { … }");
}

std::optional<JsonValue> JsonObject::find(const char* key) {
  known_.emplace_back(key);
  const auto found = value_.json().find(key);
  if (found == value_.json().end() || found->is_null()) return std::nullopt;
  return JsonValue(*found, value_.path().empty() ? key : value_.path() + "." + key);
}

JsonValue JsonObject::require(const char* key) {
  if (auto found = find(key)) return *found;
  value_.refuse("'" + std::string(key) + "' is missing.");
}

bool JsonObject::has(const char* key) const {
  const auto found = value_.json().find(key);
  return found != value_.json().end() && !found->is_null();
}

double JsonObject::number(const char* key, double fallback, const Range& range) {
  const auto found = find(key);
  return found ? found->number(range) : fallback;
}

int JsonObject::integer(const char* key, int fallback, int low, int high) {
  const auto found = find(key);
  return found ? found->integer(low, high) : fallback;
}

bool JsonObject::boolean(const char* key, bool fallback) {
  const auto found = find(key);
  return found ? found->boolean() : fallback;
}

std::string JsonObject::string(const char* key, const std::string& fallback) {
  const auto found = find(key);
  return found ? found->string() : fallback;
}

Vec3d JsonObject::vec3(const char* key, const Vec3d& fallback, const Range& range) {
  const auto found = find(key);
  return found ? found->vec3(range) : fallback;
}

std::size_t JsonObject::one_of(std::initializer_list<const char*> keys) {
  std::optional<std::size_t> chosen;
  std::string names;
  std::size_t index = 0;
  for (const char* key : keys) {
    known_.emplace_back(key);
    names += (names.empty() ? "'" : ", '") + std::string(key) + "'";
    if (has(key)) {
      if (chosen) {
        value_.refuse("has both '" + std::string(*(keys.begin() + *chosen)) + "' and '" + key +
                      "'; keep one.");
      }
      chosen = index;
    }
    ++index;
  }
  if (!chosen) value_.refuse("one of " + names + " is missing.");
  return *chosen;
}

void JsonObject::finish() {
  for (const auto& [key, unused] : value_.json().items()) {
    if (std::find(known_.begin(), known_.end(), key) != known_.end()) continue;
    std::string message = "unknown key '" + key + "'.";
    if (const auto near = nearest(key, known_)) {
      message += " Did you mean '" + *near + "'?";
    } else {
      std::sort(known_.begin(), known_.end());
      known_.erase(std::unique(known_.begin(), known_.end()), known_.end());
      message += " Known keys here:";
      for (const std::string& name : known_) message += " " + name;
      message += ".";
    }
    JsonValue(value_.json(), value_.path().empty() ? "the document" : value_.path())
        .refuse(message);
  }
}

std::optional<std::string> nearest(const std::string& word,
                                   const std::vector<std::string>& candidates) {
  std::optional<std::string> best;
  std::size_t distance = std::max<std::size_t>(1, word.size() / 3) + 1;
  for (const std::string& candidate : candidates) {
    const std::size_t d = edit_distance(word, candidate);
    if (d < distance) {
      distance = d;
      best = candidate;
    }
  }
  return best;
}

namespace {

/// What the parser says, without the name of its exception, "[json.exception.…] ".
std::string reason(const Json::exception& error) {
  const std::string_view said = error.what();
  const std::size_t end = said.find("] ");
  // It quotes what was read last, which need not be text.
  std::string result;
  for (const char c : end == std::string_view::npos ? said : said.substr(end + 2)) {
    const auto byte = static_cast<unsigned char>(c);
    if (byte >= 0x20 && byte < 0x7f) {
      result += c;
    } else {
      result += fmt::format("\\x{:02x}", byte);
    }
  }
  return result;
}

}  // namespace

Json parse_json(std::string_view text, const std::string& name) {
  constexpr std::size_t kLargest = std::size_t{64} << 20U;
  constexpr int kDeepest = 64;
  if (text.size() > kLargest) {
    throw_input(name + ": " + std::to_string(text.size()) +
                " bytes is more than a job document may have (64 MiB). Put long keyed values and "
                "points into files.");
  }
  bool too_deep = false;
  const Json::parser_callback_t watch = [&](int depth, Json::parse_event_t, Json&) {
    too_deep = too_deep || depth > kDeepest;
    return !too_deep;
  };
  try {
    Json json = Json::parse(text, watch, true, true);
    if (too_deep) throw_input(name + ": nested more than 64 levels deep.");
    return json;
  } catch (const Json::parse_error& error) {
    const std::size_t at = std::min(error.byte, text.size());
    const auto line =
        1 + std::count(text.begin(), text.begin() + static_cast<std::ptrdiff_t>(at), '\n');
    throw_input(name + ": not valid JSON at line " + std::to_string(line) + ": " + reason(error));
  } catch (const Json::exception& error) {
    // A number beyond the range of a double, for one.
    throw_input(name + ": not valid JSON: " + reason(error));
  }
}

}  // namespace matterfit::job
