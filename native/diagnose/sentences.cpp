// SPDX-License-Identifier: GPL-3.0-or-later
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "diagnose/report.hpp"

namespace matterfit::diagnose {
namespace {

std::string plain(const std::string& effect) {
  std::string text = effect;
  std::ranges::replace(text, '_', ' ');
  return text;
}

/// "a, b or c"
std::string list(const std::vector<std::string>& names, const char* last) {
  std::string text;
  for (std::size_t i = 0; i < names.size(); ++i) {
    if (i > 0) text += i + 1 == names.size() ? fmt::format(" {} ", last) : ", ";
    text += plain(names[i]);
  }
  return text;
}

std::string shown(const Report& report, double size) {
  return fmt::format("{:.3g} {}", report.shown.factor * size, report.shown.unit);
}

const Cause* best(const Report& report) {
  const auto found = std::ranges::find_if(report.causes, &Cause::accepted);
  if (found != report.causes.end()) return &*found;
  return report.causes.empty() ? nullptr : &report.causes.front();
}

std::string gain_of(const Report& report, const Cause& cause) {
  if (!cause.gain_measurable) {
    return "Nothing that was held out is wrong enough to test it by.";
  }
  return fmt::format(
      "On samples kept back the error falls from {} to {} ({:.0f} % of what noise "
      "does not explain; between {:.0f} and {:.0f} %).",
      shown(report, cause.holdout_before), shown(report, cause.holdout_after), 100.0 * cause.gain,
      100.0 * cause.gain_low, 100.0 * cause.gain_high);
}

/// The next in probability, which a named cause is compared with.
std::string next_best(const Report& report, const Cause& named) {
  const Cause* next = nullptr;
  for (const Cause& other : report.causes) {
    if (&other == &named || std::ranges::count(report.classes, other.effect) > 0) continue;
    if (next == nullptr || other.probability > next->probability) next = &other;
  }
  if (next != nullptr) {
    const double ratio = next->probability / std::max(named.probability, 1e-12);
    if (ratio < 1e-4) {
      return fmt::format(
          "It is the best of {} causes tested; no other is a ten-thousandth as "
          "likely.",
          report.tested);
    }
    return fmt::format("It is the best of {} causes tested; the next, {}, is {:.2g} % as likely.",
                       report.tested, plain(next->effect), 100.0 * ratio);
  }
  return fmt::format("It is the best of {} causes tested.", report.tested);
}

std::string nothing(const Report& report) {
  const std::string solver =
      report.numerical > 0.0
          ? fmt::format(" and the solver's own error ({})", shown(report, report.numerical))
          : "";
  return fmt::format(
      "The simulation agrees with the recording to within noise ({}){}. What would have been seen "
      "is listed with each cause.",
      shown(report, report.noise.sigma), solver);
}

std::string cause(const Report& report) {
  const Cause* named = best(report);
  if (!named) return "";
  return fmt::format("{} {} {}", named->sentence, gain_of(report, *named),
                     next_best(report, *named));
}

std::string one_of(const Report& report) {
  std::string text =
      fmt::format("One of these is missing, and this recording does not distinguish them: {}.",
                  list(report.classes, "or"));
  if (const Cause* named = best(report)) text += " " + gain_of(report, *named);
  if (!report.next_recording.empty()) text += " To distinguish them: " + report.next_recording;
  return text;
}

std::string several(const Report& report) {
  std::string text = fmt::format("{} things are missing together: {}.", report.classes.size(),
                                 list(report.classes, "and"));
  for (const Cause& each : report.causes) {
    if (each.accepted) text += " " + each.sentence;
  }
  if (const Cause* named = best(report)) text += " " + gain_of(report, *named);
  return text;
}

std::string unknown(const Report& report) {
  std::string text =
      "Something is wrong that none of the known causes explains, alone or in pairs.";
  if (!report.wrong.empty()) {
    const auto worst = std::ranges::max_element(report.wrong, {}, &WrongPlace::sigmas);
    text += fmt::format(" It is strongest in frame {}, {:.0f} times the noise.", worst->frame,
                        worst->sigmas);
  }
  if (report.causes.empty()) return text;
  const Cause& nearest = report.causes.front();
  const bool worse = nearest.gain_measurable && nearest.gain_high < 0.0;
  if (report.explained > 0.8 && worse) {
    text += fmt::format(
        " The best known cause, {}, explains {:.0f} % of what is wrong in the samples fitted to, "
        "but what was kept back gets worse with it, from {} to {}.",
        plain(nearest.effect), 100.0 * report.explained, shown(report, nearest.holdout_before),
        shown(report, nearest.holdout_after));
  } else if (report.explained > 0.05) {
    text += fmt::format(" The best known cause, {}, explains {:.0f} % of it.",
                        plain(nearest.effect), 100.0 * report.explained);
  }
  return text;
}

std::string numerical(const Report& report) {
  return fmt::format(
      "The simulation is wrong by what another grid changes ({}), not by physics: "
      "make it finer before looking for causes.",
      shown(report, report.numerical));
}

std::string measurement(const Report& report) {
  const std::string text = report.classes.size() > 1 ? one_of(report) : cause(report);
  return "It is the recording, not the material. " + text;
}

}  // namespace

const char* name(Verdict verdict) {
  switch (verdict) {
    case Verdict::kCause:
      return "cause";
    case Verdict::kClass:
      return "class";
    case Verdict::kSeveral:
      return "several";
    case Verdict::kUnknown:
      return "unknown";
    case Verdict::kNumerical:
      return "numerical";
    case Verdict::kMeasurement:
      return "measurement";
    case Verdict::kNothing:
      break;
  }
  return "nothing";
}

std::string headline(const Report& report) {
  const bool exact = !(report.numerical > 0.0);
  const std::string rest =
      report.remains ? fmt::format(
                           " What is left is still more than noise{} make{}: something else "
                           "is missing too.",
                           exact ? "" : " and the grid", exact ? "s" : "")
                     : "";
  const bool told = report.law && !report.law->sentence.empty();
  const std::string law = told ? " " + report.law->sentence : "";
  switch (report.verdict) {
    case Verdict::kCause:
      return cause(report) + rest + law;
    case Verdict::kClass:
      return one_of(report) + rest + law;
    case Verdict::kSeveral:
      return several(report) + rest + law;
    case Verdict::kUnknown:
      return unknown(report) + law;
    case Verdict::kNumerical:
      return numerical(report);
    case Verdict::kMeasurement:
      return measurement(report) + rest + law;
    case Verdict::kNothing:
      break;
  }
  return nothing(report);
}

std::string law_sentence(const LawRow& law, bool named) {
  const std::string text = fmt::format("A law of another form explains {:.0f} % of what is {}",
                                       100.0 * law.explained, named ? "left" : "wrong");
  switch (law.end) {
    case LawTrial::End::kUnlikely:
      return text + ", no more than so many numbers may by chance.";
    case LawTrial::End::kAtBound:
      return text + ", at the bounds of what a law may be.";
    case LawTrial::End::kNoTest:
      return text + "; nothing was kept back that could test it.";
    case LawTrial::End::kNoForecast:
      return text + ", but does not predict what was kept back.";
    case LawTrial::End::kImproves:
      break;
  }
  const std::string gain =
      law.gain_measurable
          ? fmt::format(" and {:.0f} % of it in what was kept back", 100.0 * law.gain)
          : "";
  return text + gain +
         ": the extended model corrects its law. That it is the material, another motion has to "
         "confirm.";
}

std::string with_error(const Value& value) {
  if (!std::isfinite(value.error)) {
    return fmt::format("{:.3g}{}{} (not identified)", value.value, value.unit.empty() ? "" : " ",
                       value.unit);
  }
  return fmt::format("{:.3g} ± {:.2g}{}{}", value.value, value.error, value.unit.empty() ? "" : " ",
                     value.unit);
}

std::string fill_sentence(const Effect& effect, const Cause& cause) {
  std::string values;
  for (const Value& value : cause.parameters) {
    if (!values.empty()) values += ", ";
    if (cause.parameters.size() > 1) values += plain(value.name) + " ";
    values += with_error(value);
  }
  std::string text = effect.sentence.empty()
                         ? fmt::format("{}: {{value}} {{variant}}", plain(effect.name))
                         : effect.sentence;
  const auto put = [&](const std::string& mark, const std::string& value) {
    for (std::size_t at = text.find(mark); at != std::string::npos;
         at = text.find(mark, at + value.size())) {
      text.replace(at, mark.size(), value);
    }
  };
  put("{value}", values);
  put("{variant}", cause.where);
  while (!text.empty() && text.back() == ' ') text.pop_back();
  if (!text.empty() && text.back() != '.') text += '.';
  return text;
}

}  // namespace matterfit::diagnose
