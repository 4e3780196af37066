// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/fit_correction.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string_view>
#include <utility>

#include "base/error.hpp"
#include "fit/data/follow.hpp"
#include "job/fit_like.hpp"
#include "material/classical/point_law.hpp"
#include "material/correction.hpp"

namespace matterfit::job {
namespace {

/// A mean error on what is held out that is less by no more than this part of itself may be so by
/// chance.
constexpr double kLeastGain = 0.02;
/// Bounds of the number that tells pull from pressure, which softens the one as it stiffens the
/// other.
constexpr std::size_t kAsymmetry = 3;
constexpr std::array<double, 2> kAsymmetryBounds = {-0.3, 0.3};

constexpr std::string_view kDamping = "material.damping_shear";

[[nodiscard]] bool is_damping(const fit::ParameterSpec& spec) {
  return spec.path.quantity->path == kDamping;
}

/// The body's numbers that a correction moves and the document does not: those of its energy, and a
/// damping as the part that depends on the rate.
std::vector<fit::ParameterSpec> all_numbers(const fit::SearchSetup& setup,
                                            const std::string& body) {
  std::vector<fit::ParameterSpec> specs;
  const auto add = [&](std::string_view path, std::size_t index) {
    fit::ParameterSpec spec;
    spec.where = "fit.correction";
    spec.path.quantity = &fit::row_named(fit::Owner::kBody, path);
    spec.path.owner = body;
    spec.path.index = index;
    if (is_damping(spec)) {
      spec.from_zero = true;
    } else if (index == kAsymmetry) {
      spec.bounds = kAsymmetryBounds;
    }
    const bool listed = std::any_of(
        setup.parameters.begin(), setup.parameters.end(),
        [&](const fit::ParameterSpec& other) { return other.path.same_number(spec.path); });
    if (!listed) specs.push_back(std::move(spec));
  };
  for (std::size_t i = 0; i < material::kCorrectionSize; ++i) add("material.correction[#]", i);
  add(kDamping, 0);
  return specs;
}

/// Those of `specs` that the capture excites where the fit before ended.
std::vector<fit::ParameterSpec> excited_numbers(const FurtherStart& from,
                                                const std::vector<fit::ParameterSpec>& specs,
                                                const Interrupter& interrupter,
                                                std::vector<std::string>& statements) {
  fit::SearchSetup setup = from.setup;
  setup.parameters.insert(setup.parameters.end(), specs.begin(), specs.end());
  fit::LawFit probe(std::move(setup), interrupter, statements);
  probe.report = from.tell;
  std::vector<double> values = probe.start().values;
  const std::size_t first = from.before.values.size();
  std::copy(from.before.values.begin(), from.before.values.end(), values.begin());
  std::vector<fit::ParameterSpec> kept;
  for (const std::size_t k : probe.excited(probe.at_last_stage(std::move(values)), first)) {
    kept.push_back(specs[k - first]);
  }
  return kept;
}

/// The material of the body in the scene of the first run that has it, at a state's values.
material::Material material_at(const fit::LawFit& fit, const std::vector<double>& values,
                               const std::string& body) {
  for (std::size_t r = 0; r < fit.scenes().size(); ++r) {
    mpm::Scene scene = fit.scenes()[r];
    const auto is_it = [&](const mpm::Body& one) { return one.name == body; };
    if (std::none_of(scene.bodies.begin(), scene.bodies.end(), is_it)) continue;
    fit.parameters().apply(values, r, scene);
    return scene.bodies[fit::body_index(scene, body)].material;
  }
  throw_compute("no scene has the body '" + body + "'.");
}

/// What the correction adds to the law's stress where F goes from 1 to `f` in a second: of the
/// difference of the first two principal stresses, or of the pressure.
double stress_share(const material::Material& material, const Mat3d& f, bool volume) {
  material::Material law = material;
  law.damping_shear = law.damping_bulk = 0.0;
  law.maxwell.clear();
  material::PointState state;
  const Mat3d own = material::PointLaw(law, 1.0).advance(f, state);
  const Mat3d more = material::Correction(material).stress(state.elastic);
  const auto measure = [&](const Mat3d& tau) {
    return volume ? tau.trace() : tau(0, 0) - tau(1, 1);
  };
  const double of_law = measure(own);
  return of_law == 0.0 ? 0.0 : measure(more) / of_law;
}

/// Over the excited strains: pulled and pressed freely along one axis without a change of volume,
/// and pressed from all sides.
Json stress_shares(const material::Material& material, const material::Excitation& over) {
  Json shares = Json::array();
  const auto add = [&](const char* way, double by, const Mat3d& f, bool volume) {
    shares.push_back({{"way", way}, {"by", by}, {"share", stress_share(material, f, volume)}});
  };
  if (!material.traits().fluid) {
    // |dev ε| = √(3/2) ln λ.
    const double stretch = std::exp(over.strain * std::sqrt(2.0 / 3.0));
    for (const double by : {1.0 / stretch, std::sqrt(1.0 / stretch), std::sqrt(stretch), stretch}) {
      const double across = 1.0 / std::sqrt(by);
      add("stretch", by, Vec3d(by, across, across).asDiagonal(), false);
    }
  }
  const double pressed = std::exp(-over.compression);
  add("volume", pressed, std::cbrt(pressed) * Mat3d::Identity(), true);
  return shares;
}

std::string share_sentence(const Json& shares, bool known) {
  std::string text;
  for (const Json& share : shares) {
    const bool volume = share.at("way") == "volume";
    text += fmt::format("{}{:+.0f} % at {} {:.3g}", text.empty() ? "" : ", ",
                        100.0 * share.at("share").get<double>(),
                        volume ? "the volume ratio" : "the stretch", share.at("by").get<double>());
  }
  return fmt::format("To the law's stress it adds {}, {}.", text,
                     known ? "as far as the clip goes"
                           : "which are usual strains, as those of the clip are not known");
}

}  // namespace

void require_hold_out(const fit::Experiment& experiment) {
  for (const fit::Run& run : experiment.runs) {
    for (const fit::Capture& capture : run.captures) {
      const auto& held = capture.predicted;
      if (std::find(held.begin(), held.end(), 1) != held.end()) return;
    }
  }
  throw_input(
      "fit.correction: nothing is held out, and only that shows whether a correction predicts "
      "better. Give a capture a 'holdout': its last frames, or another throw as a whole.");
}

FurtherFit fit_correction(FurtherStart from, const std::vector<std::string>& bodies,
                          const Interrupter& interrupter, std::vector<std::string>& statements,
                          std::vector<Json>& history) {
  const std::string first = from.body;
  const int threads = from.setup.threads;
  const std::vector<fit::Run>& runs = from.setup.experiment->runs;
  FurtherFit result;
  Json each = Json::object();
  for (const std::string& body : bodies) {
    each[body] = {{"freed", Json::array()}, {"damping_freed", false}};
  }
  std::string refusal;
  try {
    std::vector<fit::ParameterSpec> numbers;
    for (const std::string& body : bodies) {
      for (fit::ParameterSpec& spec : all_numbers(from.setup, body)) {
        numbers.push_back(std::move(spec));
      }
    }
    std::vector<fit::ParameterSpec> freed = excited_numbers(from, numbers, interrupter, statements);
    for (const fit::ParameterSpec& spec : freed) {
      Json& own = each[spec.path.owner];
      if (is_damping(spec)) {
        own["damping_freed"] = true;
      } else {
        own["freed"].push_back(spec.path.index);
      }
    }
    if (freed.empty()) {
      refusal = "the capture excites no number of a correction, as its strains are too small";
    } else {
      result =
          go_on(std::move(from), std::move(freed), kLeastGain, interrupter, statements, history);
      if (!result.taken) {
        refusal =
            "a correction does not predict what was held out better, by more than may be chance";
      }
    }
  } catch (const Error& error) {
    if (error.kind() != ErrorKind::kCompute) throw;
    refusal = std::string("a correction could not be fitted (") + error.what() + ")";
  }
  result.key = "correction";
  if (!refusal.empty()) {
    statements.push_back(
        fmt::format("{}: {}; the law stays as it is.", fmt::join(bodies, ", "), refusal));
    if (result.report.is_null()) result.report = {{"body", first}, {"taken", false}};
  } else {
    Arena arena(threads);
    for (const std::string& body : bodies) {
      Json& own = each[body];
      const bool damped = own.at("damping_freed").get<bool>();
      if (own.at("freed").empty() && !damped) {
        statements.push_back(
            body + ": the captures excite no number of a correction; its law stays as it is.");
        continue;
      }
      const material::Material material = material_at(*result.fit, result.state.values, body);
      const auto over =
          excitation_of(runs, result.fit->scenes(), body, !material.traits().elastic(), arena);
      const Json shares = stress_shares(material, over.value_or(material::Excitation{}));
      const Json& held = result.report.at("held_out_mm");
      own["numbers"] = material.correction;
      own["stress_share"] = shares;
      std::string damping;
      if (damped) {
        own["damping_shear"] = material.damping_shear;
        damping = fmt::format(" It damps change of shape by {:.3g} Pa s.", material.damping_shear);
      }
      own["sentence"] = fmt::format(
          "{}: with a correction beside the law {} what was held out, which has chosen it, is "
          "missed by {:.3g} mm in the mean, without by {:.3g}. {}{}",
          body, material.traits().name, held.at("with").get<double>(),
          held.at("without").get<double>(), share_sentence(shares, over.has_value()), damping);
      statements.push_back(own.at("sentence").get<std::string>());
    }
  }
  result.report.update(each.at(first));
  result.report["bodies"] = std::move(each);
  return result;
}

}  // namespace matterfit::job
