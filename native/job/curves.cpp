// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/curves.hpp"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "base/error.hpp"
#include "base/file.hpp"
#include "job/documents/excitation_document.hpp"
#include "job/documents/neural_starts.hpp"
#include "job/documents/safetensors.hpp"
#include "job/material_file.hpp"
#include "material/neural/isotropic_material.hpp"
#include "material/neural/likeness.hpp"
#include "material/neural/published_file.hpp"
#include "material/stress_curves.hpp"

namespace matterfit::job {
namespace {

constexpr double kUsualStrain = 0.5;
constexpr double kUsualRate = 1.0;
/// At it one substep of the published law takes a hundredth of strain.
constexpr double kUsualPublishedRate = 20.0;
/// A picture shows so much more than what was seen.
constexpr double kBeyondSeen = 1.5;
constexpr double kMostStrain = 3.0;
constexpr std::size_t kPointsEachWay = 24;
constexpr std::uint64_t kLargestWeights = std::uint64_t{64} << 20U;

struct CurveExtent {
  double strain;
  double rate;
};

CurveExtent curve_extent(const CurveOptions& options,
                         const std::optional<material::Excitation>& excited, double usual_rate) {
  CurveExtent extent{options.strain.value_or(kUsualStrain), options.rate.value_or(usual_rate)};
  if (!excited) return extent;
  if (!options.strain) extent.strain = std::min(kBeyondSeen * excited->strain, kMostStrain);
  if (!options.rate) extent.rate = std::sqrt(excited->slowest * excited->fastest);
  return extent;
}

template <class Law>
Json curve_json(const Law& law, const char* what, std::string_view name, std::string_view label,
                const CurveExtent& extent, Json& faults) {
  Json curve = {{"what", what}, {"law", name}, {"label", label}};
  for (const material::Pull pull : material::kPulls) {
    const std::string key(pull_name(pull));
    curve[key] = nullptr;
    try {
      Json by = Json::array();
      Json nominal = Json::array();
      Json cauchy = Json::array();
      Json across = Json::array();
      for (const material::CurvePoint& point :
           curve_about_rest(law, pull, extent.strain, kPointsEachWay, extent.rate)) {
        by.push_back(point.by);
        nominal.push_back(point.nominal);
        cauchy.push_back(point.cauchy);
        across.push_back(point.across);
      }
      curve[key] = {{pull == material::Pull::kShear ? "shear" : "stretch", by},
                    {"nominal", nominal},
                    {"true", cauchy},
                    {"across", across}};
    } catch (const Error& error) {
      if (error.kind() != ErrorKind::kCompute) throw;
      faults.push_back(std::string(label) + ": " + error.what());
    }
  }
  return curve;
}

Json curve_entry(const CurveExtent& extent, const std::optional<material::Excitation>& excited) {
  return {{"strain", extent.strain},
          {"rate", extent.rate},
          {"excited", excited ? excitation_json(*excited) : Json()},
          {"faults", Json::array()},
          {"curves", Json::array()}};
}

Json curves_of(const NamedMaterial& one, const CurveOptions& options) {
  const CurveExtent extent =
      curve_extent(options, one.excited, one.material.published ? kUsualPublishedRate : kUsualRate);
  Json json = curve_entry(extent, one.excited);
  Json& faults = json["faults"];
  const auto add = [&](const material::Material& material, const char* what,
                       const std::string& label) {
    const auto& traits = material::traits(material.law);
    json["curves"].push_back(curve_json(material, what, traits.name, label, extent, faults));
  };
  const std::string label(material::traits(one.material.law).label);
  const bool corrected = std::any_of(one.material.correction.begin(), one.material.correction.end(),
                                     [](double number) { return number != 0.0; });
  add(one.material, "material", corrected ? label + " + correction" : label);
  if (!options.beside) return json;
  if (corrected) {
    material::Material alone = one.material;
    alone.correction.clear();
    add(alone, "alone", label);
  }
  if (material::is_isotropic(one.material.law)) {
    const material::Excitation over = one.excited.value_or(material::Excitation{});
    material::Material law = one.material;
    law.correction.clear();
    const material::Likeness nearest = likenesses(law, over).front();
    json["sentence"] = likeness_sentence(nearest, over);
    json["distance"] = nearest.stress;
    add(nearest.material, "nearest", std::string(material::traits(nearest.material.law).label));
  }
  return json;
}

Json curves_of_all(const std::vector<NamedMaterial>& materials, const CurveOptions& options) {
  Json all = Json::object();
  for (const NamedMaterial& one : materials) all[one.name] = curves_of(one, options);
  return all;
}

Json curves_of_published(const material::PublishedWeights& weights, const CurveOptions& options) {
  const CurveExtent extent = curve_extent(options, std::nullopt, kUsualPublishedRate);
  Json json = curve_entry(extent, std::nullopt);
  json["curves"].push_back(
      curve_json(weights, "material", "neural", "Neural (published)", extent, json["faults"]));
  return json;
}

}  // namespace

CurveOptions curve_options(const Json& json) {
  JsonObject object(JsonValue(json, "options"));
  CurveOptions options;
  const Range strains{0.0, kMostStrain, true, {}};
  if (const auto strain = object.find("strain")) options.strain = strain->number(strains);
  if (const auto rate = object.find("rate")) options.rate = rate->number(positive("1/s"));
  options.beside = object.boolean("beside", options.beside);
  object.finish();
  return options;
}

Json curves_of_file(const std::filesystem::path& file, const CurveOptions& options) {
  const std::string name = file.stem().string();
  if (file.extension() == ".pt") {
    return {{name, curves_of_published(material::read_published_pt(file), options)}};
  }
  if (is_weights_file(file.generic_string())) {
    const Tensors tensors =
        parse_safetensors(read_file(file, kLargestWeights), file.generic_string());
    if (tensors.tensors.count("elastic.0") > 0) {
      const auto weights = material::published_weights(tensors, file.generic_string());
      return {{name, curves_of_published(weights, options)}};
    }
    return curves_of_all({{name, material::isotropic_material(read_weights_file(file)), {}}},
                         options);
  }
  return curves_of_all(materials_of_file(file), options);
}

Json curves_of_text(std::string_view text, const std::filesystem::path& folder,
                    const CurveOptions& options) {
  return curves_of_all(materials_of_text(text, folder, "document", "material"), options);
}

}  // namespace matterfit::job
