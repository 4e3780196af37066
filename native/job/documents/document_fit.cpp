// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <set>
#include <string_view>

#include "base/error.hpp"
#include "job/documents/document_error.hpp"
#include "job/documents/document_reading.hpp"
#include "job/documents/fit_document.hpp"
#include "job/documents/fit_path.hpp"
#include "job/documents/usual_parameters.hpp"

namespace matterfit::job {
namespace {

constexpr double kCoarsest = 8.0;
constexpr std::string_view kLossNames[] = {"tracks", "chamfer", "surface"};

/// A fit can look for laws that have numbers.
bool has_numbers(const material::LawTraits& law) { return !law.parameters.empty(); }

std::vector<material::Law> all_laws() {
  std::vector<material::Law> laws;
  for (const material::LawTraits& row : material::all_laws()) {
    if (has_numbers(row)) laws.push_back(row.law);
  }
  return laws;
}

/// One number, or three for a whole vector.
std::vector<double> read_components(const JsonValue& value, const fit::Address& path) {
  if (!path.quantity->is_vector() || path.component) return {value.number()};
  if (value.json().is_number()) return std::vector<double>(3, value.number());
  const Vec3d vector = value.vec3();
  return {vector.x(), vector.y(), vector.z()};
}

fit::ParameterSpec read_parameter(const JsonValue& value, const SceneDoc& scene,
                                  const std::vector<CaptureDoc>& captures,
                                  const std::vector<std::string>& films) {
  fit::ParameterSpec parameter;
  parameter.where = value.path();
  if (value.json().is_string()) {
    parameter.path = read_fit_path(value.string(), value.path(), scene, captures, films);
    return parameter;
  }
  if (!value.json().is_object()) value.fail("a path in quotes, or { \"path\": … }");
  JsonObject object(value);
  const JsonValue path = object.require("path");
  parameter.path = read_fit_path(path.string(), path.path(), scene, captures, films);
  if (const auto start = object.find("start")) {
    parameter.start = read_components(*start, parameter.path);
  }
  if (const auto bounds = object.find("bounds")) {
    const auto items = bounds->items();
    if (items.size() != 2) bounds->fail("[low, high], two numbers");
    parameter.bounds = {items[0].number(), items[1].number()};
    if (!((*parameter.bounds)[0] < (*parameter.bounds)[1])) {
      bounds->fail("[low, high] with low below high");
    }
    for (const double start : parameter.start) {
      if (start >= (*parameter.bounds)[0] && start <= (*parameter.bounds)[1]) continue;
      value.refuse(parameter.path.text() + " starts at " + Json(start).dump() +
                   ", outside its bounds " + Json(*parameter.bounds).dump() +
                   ". Give a start inside them.");
    }
  }
  if (const auto prior = object.find("prior")) {
    JsonObject known(*prior);
    fit::ParameterSpec::Prior read;
    read.mean = read_components(known.require("mean"), parameter.path);
    read.sigma = known.require("sigma").number(positive());
    known.finish();
    parameter.prior = read;
  }
  object.finish();
  return parameter;
}

void check_twice(const JsonValue& item, const fit::Address& path,
                 const std::vector<fit::ParameterSpec>& before) {
  for (const fit::ParameterSpec& other : before) {
    fit::Address a = path;
    fit::Address b = other.path;
    const bool both = a.component && b.component && a.component != b.component;
    a.component.reset();
    b.component.reset();
    if (both || a.text() != b.text()) continue;
    item.refuse("'" + path.text() + "' is there already, as " + other.where + ".");
  }
}

/// A parameter of a law is one of the scene's own law, or of a candidate.
void check_law(const fit::ParameterSpec& parameter, const FitDoc& fit, const SceneDoc& scene) {
  const std::string_view key = parameter.path.quantity->law_parameter();
  if (key.empty()) return;
  const material::Law own = body_named(scene, parameter.path.owner).material.law;
  const bool sought = !fit.laws.empty() && parameter.path.owner == fit.body;
  const bool fits =
      sought ? std::any_of(fit.laws.begin(), fit.laws.end(),
                           [&](material::Law law) { return material::traits(law).uses(key); })
             : material::traits(own).uses(key);
  if (fits) return;
  std::string message = parameter.where + ": ";
  if (sought) {
    throw_input(message + "none of the candidate laws uses '" + std::string(key) + "'.");
  }
  message += "the law " + std::string(material::traits(own).name) + " does not use '" +
             std::string(key) + "'; it takes";
  for (const auto& used : material::traits(own).parameters) message += " " + std::string(used);
  throw_input(message + ".");
}

/// The body whose law is sought: the only one, or the only one whose material is fitted.
std::string sought_body(const JsonValue& laws, const FitDoc& fit, const SceneDoc& scene) {
  if (scene.bodies.size() == 1) return scene.bodies.front().name;
  std::set<std::string> names;
  for (const fit::ParameterSpec& parameter : fit.parameters) {
    if (parameter.path.quantity->is_material()) names.insert(parameter.path.owner);
  }
  if (names.size() == 1) return *names.begin();
  laws.refuse(
      "the law of one body can be sought at a time, and the parameters name the materials of " +
      std::to_string(names.size()) + ".");
}

std::vector<material::Law> read_laws(const JsonValue& value) {
  if (value.json().is_string()) {
    if (value.string() != "all") value.fail("\"all\", or a list of laws");
    return all_laws();
  }
  std::vector<material::Law> laws;
  for (const JsonValue& item : value.items()) {
    laws.push_back(at_place(item.path(), [&] { return material::law_from_name(item.string()); }));
    if (const material::LawTraits& law = material::traits(laws.back()); !has_numbers(law)) {
      item.refuse("the law " + std::string(law.name) +
                  " has no numbers that could be fitted; it is simulated as it is.");
    }
    if (std::count(laws.begin(), laws.end(), laws.back()) > 1) {
      item.refuse("this law is in the list already.");
    }
  }
  if (laws.empty()) value.fail("at least one law, or \"all\"");
  return laws;
}

/// What is fitted where `laws` alone is given: the throw of the only body where nothing holds it,
/// and those numbers of its own law that a candidate takes too; what a candidate has beside them
/// comes with it (parameters_of_law()).
std::vector<fit::ParameterSpec> usual_parameters(const JsonValue& where, const FitDoc& fit,
                                                 const SceneDoc& scene,
                                                 const std::vector<CaptureDoc>& captures) {
  if (scene.bodies.size() != 1) {
    where.refuse("without 'parameters' the law of the only body is sought, and the scene has " +
                 std::to_string(scene.bodies.size()) +
                 ": list what is to be fitted, with its body.");
  }
  std::vector<std::string> paths;
  if (scene.bodies.front().pins.empty()) paths = {"velocity", "spin"};
  const material::LawTraits& own = material::traits(scene.bodies.front().material.law);
  for (const std::string_view key : kUsualNumbers) {
    const bool used =
        own.uses(key) && std::any_of(fit.laws.begin(), fit.laws.end(), [&](material::Law law) {
          return material::traits(law).uses(key);
        });
    if (used) paths.push_back("material." + std::string(key));
  }
  std::vector<fit::ParameterSpec> result;
  for (const std::string& path : paths) {
    fit::ParameterSpec parameter;
    parameter.where = "fit.laws";
    parameter.path = read_fit_path(path, parameter.where, scene, captures);
    result.push_back(std::move(parameter));
  }
  return result;
}

}  // namespace

FitDoc read_fit(const JsonValue& value, const SceneDoc& scene,
                const std::vector<CaptureDoc>& captures, const std::vector<std::string>& films) {
  JsonObject object(value);
  FitDoc fit;
  const auto laws = object.find("laws");
  if (laws) fit.laws = read_laws(*laws);
  // Laws have numbers of their own, so that they are enough.
  const auto parameters = laws ? object.find("parameters") : object.require("parameters");
  if (parameters) {
    for (const JsonValue& item : parameters->items()) {
      fit::ParameterSpec parameter = read_parameter(item, scene, captures, films);
      check_twice(item, parameter.path, fit.parameters);
      fit.parameters.push_back(std::move(parameter));
    }
  } else {
    fit.parameters = usual_parameters(*laws, fit, scene, captures);
  }
  if (laws) fit.body = sought_body(*laws, fit, scene);
  for (const fit::ParameterSpec& parameter : fit.parameters) {
    if (parameter.path.capture.empty()) {
      check_law(parameter, fit, scene);
      continue;
    }
    const auto capture = std::find_if(
        captures.begin(), captures.end(),
        [&](const CaptureDoc& candidate) { return candidate.name == parameter.path.capture; });
    check_law(parameter, fit, *capture->scene);
  }
  if (const auto loss = object.find("loss")) {
    fit.loss =
        static_cast<FitDoc::Loss>(loss->choice({kLossNames[0], kLossNames[1], kLossNames[2]}));
  }
  fit.huber = object.number("huber", 0.0, not_negative("standard deviations"));
  fit.iterations = object.integer("iterations", fit.iterations, 1, 100'000);
  fit.windows = object.boolean("windows", fit.windows);
  fit.weights = object.integer("weights", fit.weights, 0, 1000);
  // Weights are enough.
  if (fit.parameters.empty() && fit.weights == 0) {
    if (parameters) parameters->fail("at least one parameter");
    value.refuse(
        "these laws share no number with the body's own that could be fitted; list what is "
        "to be fitted in 'parameters'.");
  }
  fit.draws = object.integer("draws", fit.draws, 0, 1000);
  fit.correction = object.integer("correction", fit.correction, 0, 1000);
  if (fit.weights > 0 && fit.correction > 0) {
    value.refuse("'weights' and 'correction' both go on from the fitted law; give one of them.");
  }
  if (const auto levels = object.find("levels")) {
    for (const JsonValue& item : levels->items()) {
      fit.levels.push_back(item.number({1.0, kCoarsest, false, "particle separations"}));
      const std::size_t count = fit.levels.size();
      if (count > 1 && !(fit.levels[count - 1] < fit.levels[count - 2])) {
        item.refuse("levels go from coarse to fine.");
      }
    }
    if (fit.levels.empty() || fit.levels.back() != 1.0) {
      levels->fail("a list that ends with 1, as in [2, 1]");
    }
  }
  object.finish();
  return fit;
}

std::string_view loss_name(FitDoc::Loss loss) { return kLossNames[static_cast<std::size_t>(loss)]; }

const FitDoc& fit_of(const Job& job) {
  if (!job.fit) {
    throw_input(
        "'fit' is missing: a fit needs \"fit\": { \"parameters\": [ … ] }, as in "
        "[\"velocity\", \"material.E\"].");
  }
  return *job.fit;
}

}  // namespace matterfit::job
