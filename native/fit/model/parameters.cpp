// SPDX-License-Identifier: GPL-3.0-or-later
#include "fit/model/parameters.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/error.hpp"

namespace matterfit::fit {
namespace {

/// Whether one of the run's recordings by tracks is called so.
bool has_capture(const Run& run, const std::string& name) {
  return std::any_of(run.captures.begin(), run.captures.end(),
                     [&](const Capture& capture) { return capture.input.name == name; });
}

/// How a recording of that name is looked at, as the document says; null: the run has none.
const Viewing* viewing_of(const Run& run, const std::string& name) {
  for (const Capture& capture : run.captures) {
    if (capture.input.name == name) return &capture.viewing;
  }
  for (const Film& film : run.films) {
    if (film.name == name) return &film.viewing;
  }
  return nullptr;
}

bool has_owner(const Run& run, const mpm::Scene& scene, const Address& path) {
  if (path.quantity->owner == Owner::kCapture) return viewing_of(run, path.owner) != nullptr;
  return bearer(scene, path).has_value();
}

/// Why a quantity whose owner the scene has cannot be set there; empty: it can.
std::string obstacle_in(const mpm::Scene& scene, const Address& path) {
  const auto owner = bearer(scene, path);
  return owner ? obstacle(path, *owner) : std::string();
}

/// The names of the captures whose own scene it is.
std::string listed(const Run& run) {
  std::string text;
  for (const Capture& capture : run.captures) {
    if (run.own) text += (text.empty() ? "'" : ", '") + capture.input.name + "'";
  }
  return text;
}

double value_in(const Run& run, const mpm::Scene& scene, const Address& path) {
  const Access& access = path.quantity->access;
  if (access.look != nullptr) return access.look(*viewing_of(run, path.owner), path);
  return read(scene, path, run.origins)[static_cast<std::size_t>(path.component.value_or(0))];
}

std::string number_text(double value) { return fmt::format("{:.6g}", value); }

void set_bounds(const ParameterSpec& spec, const Quantity& row, Parameter& parameter) {
  if (spec.bounds) {
    parameter.low = (*spec.bounds)[0];
    parameter.high = (*spec.bounds)[1];
    return;
  }
  const double start = parameter.start;
  if (spec.from_zero) {
    parameter.low = start;
    parameter.high = start + kUsualFactor * parameter.scale;
    return;
  }
  if (row.low == 0.0 && row.high == 0.0) {
    parameter.low = start / kUsualFactor;
    parameter.high = start * kUsualFactor;
    if (row.largest > 0.0) parameter.high = std::min(parameter.high, std::max(start, row.largest));
    return;
  }
  parameter.low = row.low + (row.around ? start : 0.0);
  parameter.high = row.high + (row.around ? start : 0.0);
  // A start of the document's own may lie beyond: half way to what the coordinate allows.
  if (start >= parameter.high) {
    parameter.high = row.coordinate == Coordinate::kLogit ? 0.5 - 0.1 * (0.5 - start)
                                                          : start + 0.5 * std::abs(start);
  }
  if (start <= parameter.low) {
    parameter.low =
        row.coordinate == Coordinate::kLinear ? start - 0.5 * std::abs(start) : 0.1 * start;
  }
}

}  // namespace

Parameters::Parameters(const std::vector<ParameterSpec>& specs, const std::vector<Run>& runs,
                       const std::vector<mpm::Scene>& scenes)
    : runs_(runs) {
  for (const ParameterSpec& spec : specs) {
    const std::size_t components = spec.path.quantity->is_vector() && !spec.path.component ? 3 : 1;
    for (std::size_t c = 0; c < components; ++c) add(spec, c, scenes);
  }
  settle_overlaps();
  gather_writes();
}

void Parameters::settle_overlaps() {
  for (std::size_t i = 0; i < numbers_.size(); ++i) {
    for (std::size_t k = 0; k < i; ++k) {
      Number& later = numbers_[i];
      Number& earlier = numbers_[k];
      if (!earlier.path.same_number(later.path)) continue;
      for (std::size_t r = 0; r < runs_.size(); ++r) {
        if (earlier.runs[r] == 0 || later.runs[r] == 0) continue;
        if (!earlier.path.capture.empty() && !later.path.capture.empty()) {
          throw_input(later.where + ": '" + later.path.text() + "' is there already, as '" +
                      earlier.path.text() + "': the captures " + listed(runs_[r]) +
                      " share one scene. Keep one of them, or give the captures different scenes.");
        }
        // A capture's own number comes before that of all scenes.
        (later.path.capture.empty() ? later : earlier).runs[r] = 0;
      }
    }
  }
}

void Parameters::add(const ParameterSpec& spec, std::size_t component,
                     const std::vector<mpm::Scene>& scenes) {
  Number number;
  number.path = spec.path;
  number.where = spec.where;
  const bool given = !spec.start.empty();
  if (spec.path.quantity->is_vector() && !spec.path.component) {
    number.path.component = static_cast<int>(component);
  }
  std::optional<std::size_t> first;
  for (std::size_t r = 0; r < runs_.size(); ++r) {
    const Run& run = runs_[r];
    bool acts = has_owner(run, scenes[r], number.path);
    if (number.path.capture.empty()) {
      // What a scene of its own sets stays as it sets it.
      acts = acts && !(run.sets && run.sets(number.path));
    } else {
      acts = acts && run.own && has_capture(run, number.path.capture);
    }
    if (const std::string why = acts ? obstacle_in(scenes[r], number.path) : ""; !why.empty()) {
      throw_input(spec.where + ": '" + spec.path.text() + "' acts on the scene of the capture " +
                  listed(run) + " too, and there " + why);
    }
    number.runs.push_back(acts ? 1 : 0);
    if (acts && !first) first = r;
  }
  if (!first) {
    throw_input(spec.where + ": '" + spec.path.text() +
                "' is set by every capture's own scene, so there is nothing to fit. Name it as "
                "captures.NAME." +
                spec.path.text() + ".");
  }
  const Quantity& row = *number.path.quantity;
  Parameter parameter;
  parameter.name = number.path.text();
  parameter.unit = row.unit;
  parameter.words = row.words;
  parameter.record = row.record;
  const auto owner = bearer(scenes[*first], number.path);
  const bool of_material = owner && owner->material != nullptr;
  const double usual = usual_start(row, of_material ? *owner->material : material::Material{});
  parameter.coordinate = spec.from_zero ? Coordinate::kLinear : row.coordinate;
  parameter.scale = row.scale_is_separation ? 0.5 * scenes[*first].dx : row.scale;
  if (spec.from_zero) parameter.scale = usual;
  parameter.start =
      given ? spec.start[component] : value_in(runs_[*first], scenes[*first], number.path);
  const bool unset = parameter.coordinate != Coordinate::kLinear && !(parameter.start > 0.0);
  const bool never = row.never > 0.0 && parameter.start >= row.never;
  if (!given && (unset || never)) parameter.start = usual;
  const bool too_low = parameter.coordinate != Coordinate::kLinear && !(parameter.start > 0.0);
  const bool too_high = parameter.coordinate == Coordinate::kLogit && !(parameter.start < 0.5);
  if (too_low || too_high) {
    throw_input(spec.where + ": " + parameter.name + " starts at " + number_text(parameter.start) +
                (parameter.coordinate == Coordinate::kLogit
                     ? ", expected a start between 0 and 0.5."
                     : ", expected a start above 0."));
  }
  set_bounds(spec, row, parameter);
  if (parameter.start < parameter.low || parameter.start > parameter.high) {
    throw_input(spec.where + ": " + parameter.name + " starts at " + number_text(parameter.start) +
                ", outside its bounds [" + number_text(parameter.low) + ", " +
                number_text(parameter.high) + "]. Give a start inside them.");
  }
  if (spec.prior) {
    const double mean = spec.prior->mean[component];
    const bool outside = (parameter.coordinate != Coordinate::kLinear && !(mean > 0.0)) ||
                         (parameter.coordinate == Coordinate::kLogit && !(mean < 0.5));
    if (outside) {
      throw_input(spec.where + ".prior.mean is " + number_text(mean) +
                  (parameter.coordinate == Coordinate::kLogit
                       ? ", expected a number between 0 and 0.5."
                       : ", expected a number above 0."));
    }
    Prior prior;
    prior.mean = to_natural(parameter.coordinate, mean);
    prior.sigma = spec.prior->sigma;
    if (parameter.coordinate != Coordinate::kLinear) {
      prior.sigma *= mean / derivative(parameter.coordinate, prior.mean);
    }
    parameter.prior = prior;
  }
  if (spec.from_zero) parameter.prior = Prior{parameter.start, usual};
  if (!parameter.prior && row.always_prior) {
    double about = row.member != nullptr ? material::Material{}.*row.member : 0.0;
    if (row.access.look != nullptr) about = value_in(runs_[*first], scenes[*first], number.path);
    parameter.prior = Prior{to_natural(parameter.coordinate, about), row.prior_sigma};
  }
  try {
    check(parameter);
  } catch (const Error& error) {
    throw_input(spec.where + ": " + error.what());
  }
  numbers_.push_back(std::move(number));
  parameters_.push_back(std::move(parameter));
}

std::vector<double> Parameters::starts() const {
  std::vector<double> values;
  for (const Parameter& parameter : parameters_) values.push_back(parameter.start);
  return values;
}

std::vector<std::string> Parameters::moved_materials(std::size_t run) const {
  std::vector<std::string> names;
  for (const Number& number : numbers_) {
    if (number.runs[run] == 0 || !number.path.quantity->is_material()) continue;
    if (std::find(names.begin(), names.end(), number.path.owner) == names.end()) {
      names.push_back(number.path.owner);
    }
  }
  return names;
}

bool Parameters::places(std::size_t run, const std::string& body) const {
  return std::any_of(numbers_.begin(), numbers_.end(), [&](const Number& number) {
    return number.runs[run] != 0 && number.path.owner == body && number.path.quantity->places();
  });
}

void Parameters::gather_writes() {
  writes_.resize(runs_.size());
  for (std::size_t r = 0; r < runs_.size(); ++r) {
    std::vector<Write>& writes = writes_[r];
    for (std::size_t i = 0; i < numbers_.size(); ++i) {
      if (numbers_[i].runs[r] == 0 || numbers_[i].path.quantity->owner == Owner::kCapture) continue;
      Address whole = numbers_[i].path;
      const auto component = static_cast<std::size_t>(whole.component.value_or(0));
      whole.component.reset();
      auto same = std::find_if(writes.begin(), writes.end(),
                               [&](const Write& one) { return one.at.same_number(whole); });
      if (same == writes.end()) same = writes.insert(writes.end(), {std::move(whole), {}});
      same->parts.emplace_back(i, component);
    }
    // A body is turned about its origin where it was, and then shifted: later rows first.
    std::stable_sort(writes.begin(), writes.end(), [](const Write& one, const Write& other) {
      return one.at.quantity->row() > other.at.quantity->row();
    });
  }
}

void Parameters::apply(const Write& write, std::span<const double> values, const Origins& origins,
                       mpm::Scene& into) {
  Components all{};
  if (write.at.quantity->is_vector()) all = fit::read(into, write.at, origins);
  for (const auto& [number, component] : write.parts) all[component] = values[number];
  fit::write(all, write.at, into, origins);
}

void Parameters::apply(std::span<const double> values, std::size_t run, mpm::Scene& into) const {
  for (const Write& write : writes_[run]) apply(write, values, runs_[run].origins, into);
}

mpm::Body Parameters::placed(std::span<const double> values, std::size_t run,
                             mpm::Body body) const {
  mpm::Scene alone;
  alone.bodies.push_back(std::move(body));
  for (const Write& write : writes_[run]) {
    const bool places = write.at.quantity->places() && write.at.owner == alone.bodies.front().name;
    if (places) apply(write, values, runs_[run].origins, alone);
  }
  return std::move(alone.bodies.front());
}

Viewing Parameters::viewing(std::span<const double> values, std::size_t run,
                            std::size_t capture) const {
  const Capture& of = runs_[run].captures[capture];
  return viewing(values, run, of.input.name, of.viewing);
}

Viewing Parameters::film_viewing(std::span<const double> values, std::size_t run,
                                 std::size_t film) const {
  const Film& of = runs_[run].films[film];
  return viewing(values, run, of.name, of.viewing);
}

Viewing Parameters::viewing(std::span<const double> values, std::size_t run,
                            const std::string& name, Viewing viewing) const {
  for (std::size_t i = 0; i < numbers_.size(); ++i) {
    const Number& number = numbers_[i];
    const Access& access = number.path.quantity->access;
    if (number.runs[run] == 0 || access.set_view == nullptr) continue;
    if (number.path.owner == name) access.set_view(values[i], number.path, viewing);
  }
  return viewing;
}

}  // namespace matterfit::fit
