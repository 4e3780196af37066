// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <filesystem>
#include <vector>

#include "job/documents/json_reader.hpp"
#include "mpm/simulation.hpp"

namespace matterfit::job {

/// `stats.jsonl`: one line a frame, what it took and did. A log: appended to, no part of the
/// result, and a line that a killed run left unfinished is dropped on reading.
class StatsLog {
 public:
  explicit StatsLog(std::filesystem::path folder);
  /// Keeps the lines of frames before `frame`, in the file too.
  void keep_before(int frame);
  void add(const mpm::FrameReport& report);
  [[nodiscard]] const std::vector<Json>& lines() const { return lines_; }

 private:
  std::filesystem::path path_;
  std::vector<Json> lines_;
};

}  // namespace matterfit::job
