// SPDX-License-Identifier: GPL-3.0-or-later
#include "capi/terminal.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
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

std::string error_text(const Json& errors) {
  const auto one = [&](const char* key) -> std::string {
    const Json& part = errors.at(key);
    if (!part.is_object()) return "";
    return fmt::format("{:.3f} mm{}", part.at("mean_mm").get<double>(),
                       std::string(key) == "held_out" ? " held out" : " fitted");
  };
  const std::string fitted = one("fitted");
  const std::string held = one("held_out");
  if (fitted.empty() && held.empty()) return "not computed";
  return fitted + (fitted.empty() || held.empty() ? "" : ", ") + held;
}

std::string outline_text(const Json& silhouettes) {
  std::string text;
  for (const char* key : {"fitted", "held_out"}) {
    const Json& part = silhouettes.at(key);
    if (!part.contains("iou")) continue;
    text += text.empty() ? "" : "; ";
    text += std::string(key) == "held_out" ? "held out" : "fitted";
    text += fmt::format(" IoU {:.4f}", part.at("iou").get<double>());
    if (part.at("contour_px").is_number()) {
      text += fmt::format(", {:.2f} pixels apart", part.at("contour_px").get<double>());
    }
  }
  return text.empty() ? "not computed" : text;
}

/// What a fit found, a line a parameter.
std::string fit_text(const Json& fit) {
  std::string text = fmt::format("fit: law {}, {}\n", fit.at("law").get<std::string>(),
                                 fit.at("reason").get<std::string>());
  const auto warning = fit.value("warning", std::string());
  if (!warning.empty()) text += "  warning: " + warning + "\n";
  for (const Json& parameter : fit.at("parameters")) {
    const auto unit = parameter.at("unit").get<std::string>();
    text += fmt::format("  {} = {:.6g}", parameter.at("path").get<std::string>(),
                        parameter.at("value").get<double>());
    const bool known = parameter.at("standard_error").is_number();
    if (known) text += fmt::format(" ± {:.2g}", parameter.at("standard_error").get<double>());
    if (known && parameter.value("grid_error", Json()).is_number()) {
      text += fmt::format(" (grid ± {:.2g})", parameter["grid_error"].get<double>());
    }
    text += unit.empty() ? "" : " " + unit;
    if (parameter.at("at_bound") == true) text += ", at its bound";
    if (parameter.at("observable") == false) text += ", not observable";
    text += "\n";
  }
  if (fit.contains("silhouettes")) {
    const Json& silhouettes = fit.at("silhouettes");
    text += "  outlines before: " + outline_text(silhouettes.at("before")) + "\n";
    text += "  outlines after: " + outline_text(silhouettes.at("after")) + "\n";
  } else {
    text += "  mean error before: " + error_text(fit.at("before")) + "\n";
    text += "  mean error after: " + error_text(fit.at("after")) + "\n";
  }
  if (fit.contains("models")) {
    for (const Json& model : fit.at("models")) {
      const auto law = model.at("law").get<std::string>();
      if (!model.at("probability").is_number()) {
        const auto failed = model.at("failed").get<std::string>();
        text += "  " + law + (failed.empty() ? ": not finished\n" : ": failed: " + failed + "\n");
        continue;
      }
      const bool held = model.at("held_out_mm").is_number();
      text += fmt::format("  {}: {:.3f} mm {}, probability {:.2f}\n", law,
                          model.at(held ? "held_out_mm" : "fitted_mm").get<double>(),
                          held ? "held out" : "fitted", model.at("probability").get<double>());
    }
  }
  for (const Json& statement : fit.at("statements")) {
    text += "  note: " + statement.get<std::string>() + "\n";
  }
  return text;
}

/// How well a simulation's outlines agree with one capture by images.
std::string images_text(const Json& images) {
  const auto name = images.at("name").get<std::string>();
  if (!images.contains("iou")) {
    const bool empty = images.contains("empty");
    return name + (empty ? ": no image shows the body, in the recording or the simulation"
                         : ": no image lies in the scene's frames");
  }
  std::string text = fmt::format("{}: IoU {:.3f} in {} images", name, images["iou"].get<double>(),
                                 images["images"].dump());
  if (images["contour_px"].is_number()) {
    text += fmt::format(", outlines {:.2f} pixels apart", images["contour_px"].get<double>());
  }
  if (images.contains("psnr_db") && images["psnr_db"].is_number()) {
    text += fmt::format(", colours {:.1f} dB, SSIM {:.3f}", images["psnr_db"].get<double>(),
                        images["ssim"].get<double>());
  }
  const Json& worst = images["worst"];
  return text +
         fmt::format("; worst at frame {:g}, camera {}: {:.3f}, {} pixels outside, {} missing",
                     worst["frame"].get<double>(), worst["camera"].dump(),
                     worst["iou"].get<double>(), worst["outside_px"].dump(),
                     worst["missing_px"].dump());
}

/// The verdict of a diagnosis with its likeliest causes, or what a check says of each parameter.
std::string findings_text(const Json& result) {
  std::string text;
  if (result.contains("sentence")) text += result["sentence"].get<std::string>() + "\n";
  if (result.value("task", "") == "check") {
    for (const Json& p : result.at("parameters")) {
      text += fmt::format("  {} = {:.6g}, will be known to {} {}{}\n",
                          p.at("path").get<std::string>(), p.at("start").get<double>(),
                          p.at("error").is_number()
                              ? fmt::format("± {:.3g}", p.at("error").get<double>())
                              : std::string("nothing"),
                          p.at("unit").get<std::string>(),
                          p.at("known").get<bool>() ? "" : " (not identified by this recording)");
    }
    for (const Json& enough : result.at("enough")) {
      if (enough.at("enough").get<bool>()) {
        text += enough.at("sentence").get<std::string>() + "\n";
      }
    }
  }
  if (result.value("task", "") == "diagnose" && result.contains("causes")) {
    constexpr std::size_t kMostCauses = 4;
    const Json& causes = result.at("causes");
    for (std::size_t i = 0; i < std::min(kMostCauses, causes.size()); ++i) {
      text += fmt::format("  {:3.0f} %  {}\n", 100.0 * causes[i].at("probability").get<double>(),
                          causes[i].at("sentence").get<std::string>());
    }
  }
  if (!result.contains("statements")) return text;
  for (const Json& statement : result.at("statements")) {
    text += statement.get<std::string>() + "\n";
  }
  return text;
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
  line(fmt::format("{}:{}{}", field("task"),
                   result.contains("frames") ? " frames " + field("frames") : "",
                   result.contains("folder") ? " in " + field("folder") : ""));
  if (result.contains("particles")) {
    const bool known = result.contains("dt") && result["dt"].is_number();
    const std::string step = known ? fmt::format("{:.4g}", result["dt"].get<double>()) : "";
    line(fmt::format("particles {}, dt {} s, substeps {}", field("particles"), step,
                     field("substeps")));
  }
  if (result.contains("bodies")) {
    for (const Json& body : result["bodies"]) {
      if (!body.is_object()) continue;  // a folder's are names alone
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
    const bool clouds = result.contains("fit") && result["fit"].value("loss", "tracks") != "tracks";
    for (const Json& compare : result["compare"]["captures"]) {
      if (!compare.contains("mean_percent")) {
        line(compare.at("name").get<std::string>() + ": no sample could be compared");
        continue;
      }
      if (clouds) {
        // Point by point they are not the same points.
        line(fmt::format("{}: Chamfer distance {:.4g} ×1e3 m²",
                         compare.at("name").get<std::string>(),
                         compare.at("chamfer_1e3_m2").get<double>()));
        continue;
      }
      line(fmt::format("{}: mean error {:.3f} mm ({:.2f} % of the body), 95th percentile {:.3f} mm",
                       compare.at("name").get<std::string>(), compare.at("mean_mm").get<double>(),
                       compare.at("mean_percent").get<double>(),
                       compare.at("p95_mm").get<double>()));
      constexpr std::size_t kMostPoints = 24;
      if (compare.at("points").size() > kMostPoints) continue;
      for (const Json& point : compare.at("points")) {
        if (!point.contains("mean_mm")) continue;
        line(fmt::format("  {:12s} mean {:.3f} mm, 95th percentile {:.3f} mm, worst {:.3f} mm",
                         point.at("label").get<std::string>(), point.at("mean_mm").get<double>(),
                         point.at("p95_mm").get<double>(), point.at("max_mm").get<double>()));
      }
    }
  }
  if (result.contains("compare")) {
    for (const Json& images : result["compare"].value("images", Json::array())) {
      line(images_text(images));
    }
  }
  text += findings_text(result);
  if (result.contains("fit")) text += fit_text(result["fit"]);
  if (result.contains("render")) {
    const Json& render = result["render"];
    line(fmt::format("{} pictures through {} cameras in render/", render.at("pictures").dump(),
                     render.at("cameras").dump()));
    for (const Json& note : render.at("notes")) line("note: " + note.get<std::string>());
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
  if (result.contains("result_hash")) line("result hash " + field("result_hash"));
  return text;
}

std::string curves_table(const std::string& name, const job::Json& curves) {
  constexpr std::size_t kRows = 8;
  std::string text;
  for (const Json& curve : curves.at("curves")) {
    const std::string what = curve.at("what").get<std::string>();
    text += fmt::format("{}: {}{}, nominal stress at {:.3g} 1/s\n", name,
                        what == "nearest" ? "most like " : "", curve.at("label").get<std::string>(),
                        curves.at("rate").get<double>());
    for (const char* pull : {"uniaxial", "equibiaxial", "shear"}) {
      const Json& found = curve.at(pull);
      if (found.is_null()) continue;
      const Json& by = found.at(found.contains("shear") ? "shear" : "stretch");
      const Json& nominal = found.at("nominal");
      text += fmt::format("  {:12s}", pull);
      const std::size_t step = std::max<std::size_t>(1, (by.size() - 1) / kRows);
      for (std::size_t k = 0; k < by.size(); k += step) {
        text += fmt::format(" {:.3g}: {:.3g}{}", by[k].get<double>(), nominal[k].get<double>(),
                            k + step < by.size() ? "," : " Pa");
      }
      text += "\n";
    }
  }
  if (curves.contains("sentence")) text += curves.at("sentence").get<std::string>() + "\n";
  return text;
}

}  // namespace matterfit::capi
