// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/documents/override.hpp"

#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>
#include <cmath>
#include <optional>
#include <system_error>

#include "base/error.hpp"

namespace matterfit::job {
namespace {

[[noreturn]] void bad_path(const std::string& path, const std::string& why) {
  throw_input("--set " + path + ": " + why);
}

/// Writes out what the short forms leave out.
void expand(std::vector<PathStep>& steps, const Json& document, const std::string& path) {
  static constexpr std::array<std::string_view, 13> kSceneKeys = {
      "bodies",  "colliders", "gravity", "fps",     "frames",   "particle_separation",
      "solver",  "contacts",  "walls",   "effects", "material", "density",
      "velocity"};
  static constexpr std::array<std::string_view, 10> kDocumentKeys = {
      "schema", "task",   "note", "scene",    "captures",
      "probes", "output", "fit",  "diagnose", "render"};
  const std::string first = steps.front().key;
  if (std::find(kSceneKeys.begin(), kSceneKeys.end(), first) == kSceneKeys.end()) {
    if (std::find(kDocumentKeys.begin(), kDocumentKeys.end(), first) != kDocumentKeys.end()) return;
    std::vector<std::string> known(kSceneKeys.begin(), kSceneKeys.end());
    known.insert(known.end(), kDocumentKeys.begin(), kDocumentKeys.end());
    if (const auto near = nearest(first, known)) bad_path(path, "did you mean '" + *near + "'?");
    return;
  }
  if (first == "material" || first == "density" || first == "velocity") {
    const Json* bodies = nullptr;
    if (document.contains("scene") && document["scene"].contains("bodies")) {
      bodies = &document["scene"]["bodies"];
    }
    if (bodies == nullptr || !bodies->is_array() || bodies->size() != 1) {
      bad_path(path, "with several bodies write bodies.NAME." + path + ".");
    }
    steps.insert(steps.begin(), {PathStep{"bodies"}, PathStep{"0", true, 0}});
  }
  steps.insert(steps.begin(), PathStep{"scene"});
}

std::size_t named_index(const Json& list, const PathStep& step, const std::string& path) {
  std::vector<std::string> names;
  for (std::size_t i = 0; i < list.size(); ++i) {
    if (!list[i].is_object() || !list[i].contains("name") || !list[i]["name"].is_string()) continue;
    names.push_back(list[i]["name"].get<std::string>());
    if (names.back() == step.key) return i;
  }
  std::string message = "no entry of that list is called '" + step.key + "'.";
  if (names.empty()) {
    message += " Its entries have no names; use an index, as in [0].";
  } else {
    message += " There are:";
    for (const std::string& name : names) message += " " + name;
    message += ".";
  }
  bad_path(path, message);
}

/// A number as people type it and JSON does not have it: .3, -.5, +2, 3.
std::optional<double> plain_number(const std::string& text) {
  if (Json::accept(text) || text.starts_with("+-")) return std::nullopt;
  const bool positive = text.starts_with('+');
  const char* const end = text.data() + text.size();
  double value = 0.0;
  const auto [read, error] = std::from_chars(text.data() + (positive ? 1 : 0), end, value);
  if (error != std::errc() || read != end || !std::isfinite(value)) return std::nullopt;
  return value;
}

Json& descend(Json& json, const PathStep& step, const std::string& path) {
  if (json.is_array()) {
    const std::size_t index = step.is_index ? step.index : named_index(json, step, path);
    if (index >= json.size()) {
      bad_path(path, "index " + std::to_string(index) + " is outside a list of " +
                         std::to_string(json.size()) + ".");
    }
    return json[index];
  }
  if (step.is_index) bad_path(path, "[" + step.key + "] stands after something that is no list.");
  if (json.is_null()) json = Json::object();
  if (!json.is_object()) {
    bad_path(path, "'" + step.key + "' stands after a value that has no members.");
  }
  return json[step.key];
}

}  // namespace

std::vector<PathStep> parse_path(const std::string& path, const std::string& where) {
  std::vector<PathStep> steps;
  std::size_t i = 0;
  const auto refuse = [&](const std::string& why) { throw_input(where + ": " + why); };
  const auto quoted = [&] {
    const char quote = path[i++];
    const std::size_t end = path.find(quote, i);
    if (end == std::string::npos) refuse("a quote is not closed.");
    std::string key = path.substr(i, end - i);
    i = end + 1;
    return key;
  };
  while (i < path.size()) {
    if (path[i] == '[') {
      ++i;
      if (i < path.size() && (path[i] == '"' || path[i] == '\'')) {
        steps.push_back({quoted()});
      } else {
        const std::size_t begin = i;
        while (i < path.size() && std::isdigit(static_cast<unsigned char>(path[i])) != 0) ++i;
        if (i == begin || i - begin > 9) refuse("[ ] needs an index, as in bodies[0].");
        PathStep step{path.substr(begin, i - begin), true, 0};
        step.index = std::stoul(step.key);
        steps.push_back(step);
      }
      if (i >= path.size() || path[i] != ']') refuse("a ] is missing.");
      ++i;
    } else if (path[i] == '"' || path[i] == '\'') {
      steps.push_back({quoted()});
    } else {
      const std::size_t end = std::min(path.find_first_of(".[", i), path.size());
      if (end == i) refuse("a key is missing between two dots.");
      steps.push_back({path.substr(i, end - i)});
      i = end;
    }
    if (i < path.size() && path[i] == '.') {
      ++i;
      if (i == path.size()) refuse("ends with a dot.");
    } else if (i < path.size() && path[i] != '[') {
      refuse("expected a dot after '" + steps.back().key + "'.");
    }
  }
  if (steps.empty()) refuse("the path is empty.");
  return steps;
}

void apply_override(Json& document, const std::string& assignment) {
  const std::size_t equals = assignment.find('=');
  if (equals == std::string::npos) {
    bad_path(assignment, "expected PATH=VALUE, as in scene.gravity=[0,0,-3.7].");
  }
  const std::string path = assignment.substr(0, equals);
  const std::string text = assignment.substr(equals + 1);
  auto steps = parse_path(path, "--set " + path);
  expand(steps, document, path);
  Json value;
  if (const std::optional<double> plain = plain_number(text)) {
    value = *plain;
  } else {
    try {
      value = parse_json(text, "--set " + path);
    } catch (const Error&) {
      value = text;  // a word without quotation marks; what is no value is refused where it is read
    }
  }
  Json* target = &document;
  for (const PathStep& step : steps) target = &descend(*target, step, path);
  *target = std::move(value);
}

}  // namespace matterfit::job
