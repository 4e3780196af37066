// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <algorithm>
#include <filesystem>
#include <string>

#include "base/error.hpp"
#include "base/file.hpp"
#include "job/documents/json_reader.hpp"

namespace matterfit::job::fit_test {

/// Whether a report's class holds the effect.
inline bool names(const Json& report, const std::string& effect) {
  const Json& list = report.at("class");
  return std::find(list.begin(), list.end(), effect) != list.end();
}

inline const Json& cause_of(const Json& report, const std::string& effect) {
  for (const Json& cause : report.at("causes")) {
    if (cause.at("effect") == effect) return cause;
  }
  throw_input("no cause " + effect);
}

inline Json read_json(const std::filesystem::path& path) {
  const auto bytes = read_file(path);
  const char* text = reinterpret_cast<const char*>(bytes.data());
  return Json::parse(text, text + bytes.size());
}

}  // namespace matterfit::job::fit_test
