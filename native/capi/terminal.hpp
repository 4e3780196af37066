// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <chrono>
#include <string>

#include "base/interrupter.hpp"
#include "job/documents/json_reader.hpp"

namespace matterfit::capi {

/// Progress on standard error: one line that changes in a terminal, else a new line now and then.
class ProgressLine {
 public:
  explicit ProgressLine(bool wanted);
  void show(const Progress& progress, double seconds_left);
  /// Ends the line.
  void finish();

 private:
  bool wanted_;
  bool terminal_;
  bool open_ = false;
  std::string last_;
  std::chrono::steady_clock::time_point next_{};
};

/// A result in a few lines for people.
[[nodiscard]] std::string summary(const job::Json& result);

/// The curves of one material (job/curves.hpp) as a table for people: of each pull a few places.
[[nodiscard]] std::string curves_table(const std::string& name, const job::Json& curves);

}  // namespace matterfit::capi
