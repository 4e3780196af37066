// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/run/stats_log.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <sstream>

#include "base/error.hpp"
#include "base/file.hpp"

namespace matterfit::job {

StatsLog::StatsLog(std::filesystem::path folder) : path_(std::move(folder) / "stats.jsonl") {
  if (!std::filesystem::exists(path_)) return;
  const auto bytes = read_file(path_, std::uint64_t{1} << 30U);
  std::istringstream text(std::string(reinterpret_cast<const char*>(bytes.data()), bytes.size()));
  for (std::string line; std::getline(text, line);) {
    Json json = Json::parse(line, nullptr, false);
    if (json.is_object() && json.contains("frame") && json["frame"].is_number_integer()) {
      lines_.push_back(std::move(json));
    }
  }
}

void StatsLog::keep_before(int frame) {
  lines_.erase(std::remove_if(lines_.begin(), lines_.end(),
                              [&](const Json& line) { return line["frame"].get<int>() >= frame; }),
               lines_.end());
  std::string text;
  for (const Json& line : lines_) text += line.dump() + "\n";
  write_file(path_, text);
}

void StatsLog::add(const mpm::FrameReport& report) {
  Json json = {{"frame", report.frame},
               {"substeps", report.substeps},
               {"dt", report.dt},
               {"dt_limit", report.dt_limit},
               {"max_speed", report.max_speed},
               {"min_volume_ratio", report.min_volume_ratio},
               {"max_volume_ratio", report.max_volume_ratio},
               {"max_penetration", report.max_penetration},
               {"kinetic_energy", report.kinetic_energy},
               {"seconds", report.seconds}};
  if (!report.note.empty()) json["note"] = report.note;
  lines_.push_back(json);
  const std::string line = json.dump(-1, ' ', false, Json::error_handler_t::replace) + "\n";
  const int descriptor = ::open(path_.c_str(), O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0666);
  const bool written = descriptor >= 0 && ::write(descriptor, line.data(), line.size()) ==
                                              static_cast<ssize_t>(line.size());
  const int reason = errno;
  if (descriptor >= 0) ::close(descriptor);
  if (!written) {
    throw_output(path_.string() + ": cannot write: " + std::strerror(reason) +
                 ". Free some space or choose another output folder.");
  }
}

}  // namespace matterfit::job
