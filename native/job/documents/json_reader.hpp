// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <limits>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/vec.hpp"

namespace matterfit::job {

using Json = nlohmann::json;

/// Bounds of a number; the message of a value outside names them. `unit` is shown in brackets.
struct Range {
  double low = -std::numeric_limits<double>::infinity();
  double high = std::numeric_limits<double>::infinity();
  bool low_open = false;  ///< the low bound itself is refused
  std::string_view unit;
};
inline constexpr Range kAny{};
[[nodiscard]] constexpr Range positive(std::string_view unit = {}) {
  return {0.0, std::numeric_limits<double>::infinity(), true, unit};
}
[[nodiscard]] constexpr Range not_negative(std::string_view unit = {}) {
  return {0.0, std::numeric_limits<double>::infinity(), false, unit};
}

/// One value of a job document and where it lies. Every accessor throws Error(kInput) that names
/// the JSON path, what is there and what is expected.
class JsonValue {
 public:
  JsonValue(const Json& json, std::string path) : json_(&json), path_(std::move(path)) {}

  [[nodiscard]] const Json& json() const { return *json_; }
  [[nodiscard]] const std::string& path() const { return path_; }
  [[noreturn]] void fail(const std::string& expected) const;
  /// Throws `path: message`.
  [[noreturn]] void refuse(const std::string& message) const;

  [[nodiscard]] double number(const Range& range = kAny) const;
  [[nodiscard]] int integer(int low, int high) const;
  [[nodiscard]] bool boolean() const;
  [[nodiscard]] std::string string() const;
  /// A string out of `choices`; returns its index.
  [[nodiscard]] std::size_t choice(std::initializer_list<std::string_view> choices) const;
  /// `range` is that of each component.
  [[nodiscard]] Vec3d vec3(const Range& range = kAny) const;
  [[nodiscard]] Vec3d unit_vec3() const;
  /// [w, x, y, z], normalised; a length off 1 by more than 1 % is refused.
  [[nodiscard]] Quatd quaternion() const;
  /// Elements of an array, with their paths.
  [[nodiscard]] std::vector<JsonValue> items() const;
  [[nodiscard]] Points points() const;

 private:
  const Json* json_;
  std::string path_;
};

/// The members of an object. Each key that is asked for is known; finish() refuses the others by
/// name, with the nearest known key.
class JsonObject {
 public:
  explicit JsonObject(const JsonValue& value);

  /// The value of `key`, nothing if it is absent or null.
  [[nodiscard]] std::optional<JsonValue> find(const char* key);
  /// Throws if `key` is absent.
  [[nodiscard]] JsonValue require(const char* key);
  [[nodiscard]] bool has(const char* key) const;
  [[nodiscard]] const JsonValue& value() const { return value_; }

  [[nodiscard]] double number(const char* key, double fallback, const Range& range = kAny);
  [[nodiscard]] int integer(const char* key, int fallback, int low, int high);
  [[nodiscard]] bool boolean(const char* key, bool fallback);
  [[nodiscard]] std::string string(const char* key, const std::string& fallback);
  [[nodiscard]] Vec3d vec3(const char* key, const Vec3d& fallback, const Range& range = kAny);
  /// Throws if exactly one of `keys` is not present; returns its index.
  [[nodiscard]] std::size_t one_of(std::initializer_list<const char*> keys);

  void finish();

 private:
  JsonValue value_;
  std::vector<std::string> known_;
};

/// The candidate nearest to `word` by edit distance, if near enough to be a slip of the hand.
[[nodiscard]] std::optional<std::string> nearest(const std::string& word,
                                                 const std::vector<std::string>& candidates);

/// Parses text of at most 64 MiB, nested at most 64 deep. `name` stands in the error.
[[nodiscard]] Json parse_json(std::string_view text, const std::string& name);

}  // namespace matterfit::job
