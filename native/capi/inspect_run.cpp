// SPDX-License-Identifier: GPL-3.0-or-later
#include "capi/inspect_run.hpp"

#include <cstdio>
#include <string>
#include <system_error>

#include "base/file.hpp"
#include "capi/terminal.hpp"
#include "capture/colmap.hpp"
#include "job/run/inspect.hpp"

namespace matterfit::capi {
namespace {

std::string lines_of(const job::Json& texts) {
  std::string lines;
  for (const auto& text : texts) lines += text.get<std::string>() + "\n";
  return lines;
}

}  // namespace

int inspect(const std::filesystem::path& path, const std::filesystem::path& report, bool json) {
  std::error_code code;
  const bool file = !std::filesystem::is_directory(path, code) || capture::find_colmap(path);
  const job::Json found = file ? job::file_summary(path) : job::inspect_folder(path);
  const std::string text = found.dump(2, ' ', false, job::Json::error_handler_t::replace) + "\n";
  if (!report.empty()) write_file(report, text);
  const std::string said = json ? text : file ? lines_of(found.at("text")) : summary(found);
  std::fputs(said.c_str(), stdout);
  if (file) return 0;
  for (const auto& fault : found.at("faults")) {
    std::fprintf(stderr, "matterfit: %s %s\n", fault.at("path").get<std::string>().c_str(),
                 fault.at("what").get<std::string>().c_str());
  }
  return found.at("faults").empty() ? 0 : 2;
}

}  // namespace matterfit::capi
