// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/diagnosis/material_causes.hpp"

#include <fmt/format.h>

#include <array>
#include <cctype>
#include <cmath>
#include <string>

#include "base/error.hpp"
#include "fit/model/quantity.hpp"
#include "job/diagnosis/cause_row.hpp"
#include "material/correction.hpp"
#include "mpm/scene_check.hpp"

namespace matterfit::job {
namespace {

/// Times of a Maxwell branch that are scanned, as shares of the recording's
/// duration.
constexpr std::array<double, 5> kRelaxationShares = {0.003, 0.01, 0.03, 0.1, 0.3};
/// Branches of a spectrum, from the shortest of those times to the longest.
constexpr std::size_t kOfSpectrum = 4;
/// In Young's modulus: a yield stress that no body reaches, and those at which searches begin.
constexpr double kNeverYields = 1.0;
constexpr std::array<double, 2> kTriedYields = {0.1, 0.03};
constexpr double kLeastYield = 1e-4;
/// For a number that a fit does not move: a change at which one would care for it, and the farthest
/// that a search goes, as factors of its value.
constexpr double kShareOfValue = 0.1;
constexpr double kFarthest = 10.0;
/// Where such a number is searched for because its slope says little of values that are far off.
constexpr std::array<double, 2> kTriedFactors = {0.6, 1.5};

/// A size of a correction's numbers at which one would care for it, and the standard deviation of
/// their prior, as a fit of them has it (`fit.correction`).
constexpr double kShareOfLaw = 0.5;
/// The most by which each stiffens, and by which it softens by itself; of several together
/// material::check_correction says more.
constexpr std::array<double, material::kCorrectionSize> kStiffest = {5.0, 5.0, 5.0, 0.6, 5.0};
constexpr std::array<double, material::kCorrectionSize> kSoftest = {0.7, 0.7, 0.7, 0.6, 0.7};

bool holds_together(std::span<const double> correction) {
  try {
    material::check_correction(correction, "correction");
    return true;
  } catch (const Error&) {
    return false;
  }
}

class MaterialCauses {
 public:
  MaterialCauses(const mpm::Scene& scene, const CauseOptions& options)
      : scene_(scene), options_(options), material_(scene.bodies.front().material) {}

  std::vector<Cause> all() {
    damping("damping_shear", &material::Material::damping_shear,
            "The material damps: {value} of viscosity against shear.");
    damping("damping_bulk", &material::Material::damping_bulk,
            "The material damps: {value} of viscosity against compression.");
    if (!fitted("material.maxwell[#].modulus") && !fitted("material.maxwell[#].time") &&
        material_.maxwell.size() < material::kMostMaxwellBranches) {
      relaxation();
    }
    yield();
    law();
    for (const fit::Quantity& row : fit::quantities()) {
      if (row.owner == fit::Owner::kBody && row.of_law && row.member) stated(row);
    }
    return std::move(causes_);
  }

 private:
  [[nodiscard]] bool fitted(std::string_view path) const {
    return fit::is_among(fit::row_named(fit::Owner::kBody, path), options_.fitted,
                         scene_.bodies.front().name);
  }

  [[nodiscard]] double modulus() const {
    return material_.traits().fluid ? material_.bulk_modulus : material_.youngs_modulus;
  }

  void damping(const char* name, double material::Material::*member, const char* sentence) {
    if (fitted(std::string("material.") + name)) return;
    const double now = material_.*member;
    Cause& cause = add_cause(causes_, name, "material", sentence);
    cause.row.numbers = {number("added", "Pa s", 1e-3 * modulus(), true)};
    cause.row.confused_with = {"drag_linear", "drag_quadratic", "relaxation", "friction"};
    cause.apply = [member](std::span<const double> v, int, mpm::Scene& scene) {
      scene.bodies.front().material.*member += v[0];
    };
    cause.write = [name, now](std::span<const double> v, int, Json& scene) {
      first_body(scene)["material"][name] = now + v[0];
    };
  }

  /// A single branch at one of several times, or a spectrum: branches of equal modulus whose times
  /// are as far apart, so that what is lost in a cycle hardly depends on how long it takes.
  void relaxation() {
    Cause& cause =
        add_cause(causes_, "relaxation", "material", "The material relaxes: {value} {variant}.");
    cause.row.numbers = {number("modulus", "Pa", 0.1 * modulus(), true)};
    cause.row.confused_with = {"damping_shear", "drag_linear", "drag_quadratic"};
    std::vector<std::vector<double>> times;
    for (const double share : kRelaxationShares) {
      times.push_back({share * options_.duration});
      cause.row.variants.push_back(fmt::format("with a time of {:.3g} s", times.back().front()));
    }
    if (material_.maxwell.size() + kOfSpectrum <= material::kMostMaxwellBranches) {
      std::vector<double>& spectrum = times.emplace_back();
      const double shortest = kRelaxationShares.front() * options_.duration;
      const double longest = kRelaxationShares.back() * options_.duration;
      for (std::size_t k = 0; k < kOfSpectrum; ++k) {
        spectrum.push_back(shortest *
                           std::pow(longest / shortest, double(k) / double(kOfSpectrum - 1)));
      }
      cause.row.variants.push_back(
          fmt::format("in each of {} branches with times from {:.3g} to {:.3g} s, which lose about "
                      "as much at every frequency",
                      kOfSpectrum, shortest, longest));
    }
    cause.apply = [times](std::span<const double> v, int variant, mpm::Scene& scene) {
      for (const double time : times[static_cast<std::size_t>(variant)]) {
        scene.bodies.front().material.maxwell.push_back({v[0], time});
      }
    };
    cause.write = [times](std::span<const double> v, int variant, Json& scene) {
      for (const double time : times[static_cast<std::size_t>(variant)]) {
        first_body(scene)["material"]["maxwell"].push_back({{"modulus", v[0]}, {"time", time}});
      }
    };
  }

  /// An elastic body that keeps a dent is one of von Mises, in the same formulation.
  void yield() {
    const mpm::Body& body = scene_.bodies.front();
    if (!material_.traits().elastic() || material::is_isotropic(material_.law)) return;
    const double never = kNeverYields * material_.youngs_modulus;
    Cause& cause = add_cause(causes_, "yield", "material",
                             "The material yields at {value} and keeps its new shape.");
    diagnose::Number stress = number("yield_stress", "Pa", 0.02 * material_.youngs_modulus);
    stress.neutral = never;
    stress.high = never;
    stress.low = kLeastYield * material_.youngs_modulus;
    cause.row.numbers = {stress};
    cause.row.confused_with = {"damping_shear", "restitution", "relaxation"};
    for (const double share : kTriedYields) {
      cause.row.tries.push_back(share * material_.youngs_modulus);
    }
    const bool total = mpm::is_total(body);
    cause.apply = [never, total](std::span<const double> v, int, mpm::Scene& scene) {
      if (!(v[0] < never)) return;
      mpm::Body& first = scene.bodies.front();
      if (total) first.formulation = mpm::Formulation::kTotal;
      first.material.law = material::Law::kVonMises;
      first.material.yield_stress = v[0];
      first.material.hardening = 0.0;
    };
    cause.write = [never, total](std::span<const double> v, int, Json& scene) {
      if (!(v[0] < never)) return;
      if (total) first_body(scene)["formulation"] = "total";
      Json& material = first_body(scene)["material"];
      material["law"] = "von_mises";
      material["yield_stress"] = v[0];
    };
  }

  /// The law's form itself, by the correction that any law takes: looked at when all is done.
  void law() {
    if (!material_.correction.empty() || fitted("material.correction[#]")) return;
    Cause& cause = add_cause(causes_, "law_correction", "material",
                             "The material's law is another: a correction of {value}.");
    cause.row.last = true;
    for (std::size_t k = 0; k < material::kCorrectionSize; ++k) {
      diagnose::Number share = number(fmt::format("correction[{}]", k).c_str(), "", kShareOfLaw);
      share.first_step = kShareOfLaw / 10.0;
      share.deviation = kShareOfLaw;
      share.low = -kSoftest[k];
      share.high = kStiffest[k];
      cause.row.numbers.push_back(share);
    }
    cause.allowed = holds_together;
    cause.apply = [](std::span<const double> v, int, mpm::Scene& scene) {
      scene.bodies.front().material.correction.assign(v.begin(), v.end());
    };
    cause.write = [](std::span<const double> v, int, Json& scene) {
      first_body(scene)["material"]["correction"] = std::vector<double>(v.begin(), v.end());
    };
  }

  /// A parameter of the law that the scene states.
  void stated(const fit::Quantity& row) {
    const std::string key(row.key());
    if (!material_.traits().uses(key) || fitted(row.path)) return;
    const double value = material_.*row.member;
    const double usual = fit::usual_start(row, material_);
    const double of = value > 0.0 ? value : usual;
    if (!(of > 0.0) || (row.never > 0.0 && value >= row.never)) return;
    std::string words(row.words);
    if (words.empty()) return;
    words.front() = static_cast<char>(std::toupper(static_cast<unsigned char>(words.front())));
    const bool bounded = row.high > row.low && !row.around;
    Cause& cause = add_cause(causes_, row.path, "material",
                             words + " differs from what the scene says by {value}.");
    diagnose::Number added = number("added", "", kShareOfValue * of, !(value > 0.0));
    added.unit = row.unit;
    added.low = std::min(0.0, std::max(bounded ? row.low - value : -1e300,
                                       value > 0.0 ? value / kFarthest - value : 0.0));
    added.high =
        std::max(0.0, std::min(bounded ? row.high - value : 1e300, kFarthest * of - value));
    if (!(added.high > 0.0)) added.one_sided = false;
    cause.row.numbers = {added};
    if (row.scanned && value > 0.0) {
      for (const double factor : kTriedFactors) {
        const double there = (factor - 1.0) * value;
        if (there > added.low && there < added.high) cause.row.tries.push_back(there);
      }
    }
    cause.row.confused_with = {"attached_mass", "gravity_size"};
    cause.apply = [member = row.member](std::span<const double> v, int, mpm::Scene& scene) {
      scene.bodies.front().material.*member += v[0];
    };
    cause.write = [key, value](std::span<const double> v, int, Json& scene) {
      first_body(scene)["material"][key] = value + v[0];
    };
  }

  const mpm::Scene& scene_;
  const CauseOptions& options_;
  const material::Material& material_;
  std::vector<Cause> causes_;
};

}  // namespace

std::vector<Cause> material_causes(const mpm::Scene& scene, const CauseOptions& options) {
  return MaterialCauses(scene, options).all();
}

}  // namespace matterfit::job
