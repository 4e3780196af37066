// SPDX-License-Identifier: GPL-3.0-or-later
#include "capi/terminal.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <cstdio>

namespace matterfit::capi {
namespace {

using job::Json;

std::string duration(double seconds) {
  if (seconds < 90.0) return fmt::format("{:.0f} s", seconds);
  if (seconds < 5400.0) return fmt::format("{:.0f} min", seconds / 60.0);
  return fmt::format("{:.1f} h", seconds / 3600.0);
}

std::string ringdown_text(const Json& ring) {
  return fmt::format("drop {:.2f} mm, {:.3f} Hz, damping ratio {:.4f}",
                     1e3 * ring.at("drop_m").get<double>(), ring.at("frequency_hz").get<double>(),
                     ring.at("damping_ratio").get<double>());
}

}  // namespace

ProgressLine::ProgressLine(bool wanted)
    : wanted_(wanted), terminal_(::isatty(STDERR_FILENO) == 1) {}

void ProgressLine::show(const Progress& progress, double seconds_left) {
  if (!wanted_ || progress.label.empty()) return;
  const auto now = std::chrono::steady_clock::now();
  if (now < next_) return;
  std::string text = fmt::format("{:3.0f} %  {}", 100.0 * progress.fraction, progress.label);
  if (progress.last_frame > 0) {
    text += fmt::format(", frame {} of {}", progress.frame, progress.last_frame);
  }
  if (seconds_left >= 0.0) text += ", " + duration(seconds_left) + " left";
  if (text == last_) return;
  last_ = text;
  next_ = now + std::chrono::milliseconds(terminal_ ? 100 : 2000);
  if (terminal_) {
    std::fprintf(stderr, "\r\033[K%s", text.c_str());
    open_ = true;
  } else {
    std::fprintf(stderr, "%s\n", text.c_str());
  }
  std::fflush(stderr);
}

void ProgressLine::finish() {
  if (open_) std::fputs("\r\033[K", stderr);
  open_ = false;
}

std::string summary(const Json& result) {
  std::string text;
  const auto line = [&](const std::string& what) { text += what + "\n"; };
  const auto field = [&](const char* key) -> std::string {
    if (!result.contains(key)) return "";
    return result[key].is_string() ? result[key].get<std::string>() : result[key].dump();
  };
  line(fmt::format("{}: frames {} in {}", field("task"), field("frames"), field("folder")));
  if (result.contains("particles")) {
    line(fmt::format("particles {}, dt {} s, substeps {}", field("particles"), field("dt"),
                     field("substeps")));
  }
  if (result.contains("bodies")) {
    for (const Json& body : result["bodies"]) {
      line(fmt::format("body {}: {}", body.at("name").get<std::string>(),
                       body.value("fill", std::string())));
    }
  }
  if (result.contains("ringdown")) line("ring-down: " + ringdown_text(result["ringdown"]));
  if (result.contains("captures")) {
    for (const Json& capture : result["captures"]) {
      const auto name = capture.at("name").get<std::string>();
      if (capture.contains("ringdown")) {
        line(name + " simulated: " + ringdown_text(capture["ringdown"]));
      }
      if (capture.contains("measured_ringdown")) {
        line(name + " measured: " + ringdown_text(capture["measured_ringdown"]));
      }
    }
  }
  if (result.contains("compare")) {
    for (const Json& compare : result["compare"]["captures"]) {
      if (!compare.contains("mean_percent")) {
        line(compare.at("name").get<std::string>() + ": no sample could be compared");
        continue;
      }
      line(fmt::format("{}: mean error {:.3f} mm ({:.2f} % of the body), 95th percentile {:.3f} mm",
                       compare.at("name").get<std::string>(), compare.at("mean_mm").get<double>(),
                       compare.at("mean_percent").get<double>(),
                       compare.at("p95_mm").get<double>()));
      for (const Json& point : compare.at("points")) {
        if (!point.contains("mean_mm")) continue;
        line(fmt::format("  {:12s} mean {:.3f} mm, 95th percentile {:.3f} mm, worst {:.3f} mm",
                         point.at("label").get<std::string>(), point.at("mean_mm").get<double>(),
                         point.at("p95_mm").get<double>(), point.at("max_mm").get<double>()));
      }
    }
  }
  if (result.contains("notes")) {
    for (const Json& note : result["notes"]) line("note: " + note.get<std::string>());
  }
  if (result.contains("complete") && !result["complete"].get<bool>()) {
    line(fmt::format("unfinished: {} frames are done; run the job again to go on",
                     result.at("frames_done").get<int>()));
  }
  if (result.contains("faults")) {
    line(result["faults"].empty()
             ? "every file is as it was written"
             : fmt::format("{} files are not as they were written", result["faults"].size()));
  }
  line("result hash " + field("result_hash"));
  return text;
}

}  // namespace matterfit::capi
