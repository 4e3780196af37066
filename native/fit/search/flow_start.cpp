// SPDX-License-Identifier: GPL-3.0-or-later
#include "fit/search/flow_start.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <initializer_list>
#include <numbers>
#include <numeric>
#include <optional>
#include <string>
#include <utility>

#include "fit/data/follow.hpp"
#include "material/neural/latent.hpp"
#include "material/neural/start_laws.hpp"

namespace matterfit::fit {
namespace {

constexpr double kYieldStrain = 0.02;
constexpr double kViscosity = 10.0;  // [Pa s]
/// Steps of the scan of the two nearest classes, either way.
constexpr int kFarthest = 4;
constexpr double kFrictionAngle = std::numbers::pi / 6;  // [rad]

/// The flow's numbers of one body, where they are among the parameters.
class FlowNumbers {
 public:
  FlowNumbers(const Parameters& parameters, const std::string& body)
      : parameters_(parameters), body_(body) {}

  [[nodiscard]] std::optional<std::size_t> number(std::string_view key) const {
    for (std::size_t i = 0; i < parameters_.size(); ++i) {
      const Address& path = parameters_.path(i);
      if (path.owner == body_ && path.capture.empty() && path.quantity->law_parameter() == key) {
        return i;
      }
    }
    return std::nullopt;
  }
  [[nodiscard]] bool has(std::string_view key) const { return number(key).has_value(); }

  /// Within the bounds; nothing where it is no parameter.
  void set(std::string_view key, double value, FlowStart& start) const {
    const auto at = number(key);
    if (!at) return;
    const Parameter& parameter = parameters_.parameters()[*at];
    start.values[*at] = std::clamp(value, parameter.low, parameter.high);
  }

 private:
  const Parameters& parameters_;
  const std::string& body_;
};

/// A body's material at the values.
material::Material material_at(const Parameters& parameters, const mpm::Body& body,
                               std::span<const double> values) {
  material::Material material = body.material;
  for (std::size_t i = 0; i < parameters.size(); ++i) {
    const Address& path = parameters.path(i);
    if (path.owner != body.name || path.quantity->member == nullptr) continue;
    material.*path.quantity->member = values[i];
  }
  return material;
}

/// Growth of the yield strain per volume strain of Drucker–Prager's cone: K/G times √(2/3)
/// 3·2 sin φ/(2 (3 − sin φ)), as |dev τ| = 2G |dev ε| and tr τ = 3K tr ε.
double cone(const material::Material& m) {
  const double sine = std::sin(kFrictionAngle);
  const double alpha = std::sqrt(2.0 / 3.0) * 2.0 * sine / (3.0 - sine);
  return alpha * (1.0 + m.poisson_ratio) / (1.0 - 2.0 * m.poisson_ratio);
}

/// Places of a class along its longest axis, in standard deviations.
constexpr std::array<double, 4> kAlongClass{-1.5, -0.75, 0.75, 1.5};

/// The numbers of a body's code among the parameters; empty where they are not all there.
std::vector<std::size_t> code_of(const Parameters& parameters, const std::string& body) {
  const Quantity& row = row_named(Owner::kBody, "material.latent[#]");
  std::vector<std::size_t> numbers;
  for (std::size_t k = 0; k < material::kLatentSize; ++k) {
    for (std::size_t i = 0; i < parameters.size(); ++i) {
      const Address& path = parameters.path(i);
      if (path.quantity == &row && path.owner == body && path.index == k && path.capture.empty()) {
        numbers.push_back(i);
      }
    }
  }
  return numbers.size() == material::kLatentSize ? numbers : std::vector<std::size_t>{};
}

/// Places of fluids in the space of the latent law with their stiffness: Young's modulus says
/// there how viscous a liquid is and the code how stiff against a change of volume, so that neither
/// can be looked for without the other. None where E is no parameter.
std::vector<std::vector<double>> liquid_places(const Parameters& parameters, const mpm::Body& body,
                                               const std::vector<std::size_t>& code,
                                               std::span<const double> values) {
  constexpr std::array kViscosities = {1.0, 3.0, 10.0, 30.0, 100.0, 300.0};  // [Pa s]
  constexpr std::array kBulks = {0.3, 3.0};  ///< of the material's that is searched from
  /// The η/K [s] beyond which the space has no liquids.
  constexpr double kSoftest = 2e-4;
  const auto youngs = FlowNumbers(parameters, body.name).number("E");
  if (!youngs) return {};
  constexpr double kUsualRatio = 0.3;
  const double bulk = values[*youngs] / (3.0 * (1.0 - 2.0 * kUsualRatio));
  const auto within = [&](std::size_t number, double value) {
    const Parameter& parameter = parameters.parameters()[number];
    return std::clamp(value, parameter.low, parameter.high);
  };
  std::vector<std::vector<double>> places;
  for (const double viscosity : kViscosities) {
    for (const double factor : kBulks) {
      material::Material fluid;
      fluid.law = material::Law::kNewtonian;
      fluid.viscosity = viscosity;
      fluid.bulk_modulus = std::max(factor * bulk, viscosity / kSoftest);
      const material::RestModuli moduli = rest_moduli(fluid);
      const material::LatentCode found = latent_code(*body.material.decoder, fluid);
      std::vector<double> point(values.begin(), values.end());
      point[*youngs] =
          within(*youngs, 9.0 * moduli.bulk * moduli.shear / (3.0 * moduli.bulk + moduli.shear));
      for (std::size_t k = 0; k < material::kLatentSize; ++k) {
        point[code[k]] = within(code[k], found[static_cast<Eigen::Index>(k)]);
      }
      places.push_back(std::move(point));
    }
  }
  return places;
}

std::vector<FlowStart> latent_starts(const Parameters& parameters,
                                     const std::vector<mpm::Scene>& scenes,
                                     std::span<const double> values) {
  for (const mpm::Scene& scene : scenes) {
    for (const mpm::Body& body : scene.bodies) {
      if (body.material.law != material::Law::kLatent) continue;
      const std::vector<std::size_t> numbers = code_of(parameters, body.name);
      if (numbers.empty()) continue;
      const material::LatentDecoder& decoder = *body.material.decoder;
      std::vector<FlowStart> starts;
      for (std::size_t c = 0; c < material::kLatentClasses.size(); ++c) {
        const auto row = static_cast<Eigen::Index>(c);
        const auto at = [&](double along) {
          std::vector<double> point(values.begin(), values.end());
          for (std::size_t k = 0; k < material::kLatentSize; ++k) {
            const auto column = static_cast<Eigen::Index>(k);
            const Parameter& parameter = parameters.parameters()[numbers[k]];
            point[numbers[k]] =
                std::clamp(decoder.classes(row, column) + along * decoder.spreads(row, column),
                           parameter.low, parameter.high);
          }
          return point;
        };
        FlowStart start{material::kLatentClasses[c], at(0.0), {}, {}};
        if (start.name == "liquid") {
          start.others = liquid_places(parameters, body, numbers, values);
        }
        start.own_stiffness = !start.others.empty();
        if (!start.own_stiffness) {
          for (const double along : kAlongClass) start.others.push_back(at(along));
        }
        starts.push_back(std::move(start));
      }
      return starts;
    }
  }
  return {};
}

}  // namespace

std::vector<FlowStart> flow_starts(const Parameters& parameters,
                                   const std::vector<mpm::Scene>& scenes,
                                   std::span<const double> values) {
  const mpm::Body* body = nullptr;
  for (const mpm::Scene& scene : scenes) {
    for (const mpm::Body& one : scene.bodies) {
      const bool neural = one.material.law == material::Law::kNeuralIsotropic;
      if (neural && body == nullptr && FlowNumbers(parameters, one.name).has("yield_strain")) {
        body = &one;
      }
    }
  }
  if (body == nullptr) return latent_starts(parameters, scenes, values);
  const FlowNumbers numbers(parameters, body->name);
  const material::Material material = material_at(parameters, *body, values);
  // The relaxation rate of the deviatoric strain: η = G/ρ of a Maxwell fluid.
  const double rate = material.youngs_modulus / (2.0 * (1.0 + material.poisson_ratio)) / kViscosity;
  constexpr double kNever = 1e3;
  constexpr double kAtOnce = 1e9;
  const auto start = [&](std::string_view name) {
    FlowStart made{name, {values.begin(), values.end()}, {}, {}};
    numbers.set("yield_strain", kNever, made);
    numbers.set("internal_friction", 0.0, made);
    numbers.set("tear_strain", kNever, made);
    numbers.set("flow_rate", kAtOnce, made);
    return made;
  };
  std::vector<FlowStart> starts{start("elastic")};
  FlowStart plastic = start("plastic");
  numbers.set("yield_strain", kYieldStrain, plastic);
  plastic.scanned = {*numbers.number("yield_strain")};
  starts.push_back(plastic);
  if (const auto friction = numbers.number("internal_friction")) {
    FlowStart granular = start("granular");
    numbers.set("yield_strain", 0.0, granular);
    numbers.set("tear_strain", 0.0, granular);
    numbers.set("internal_friction", cone(material), granular);
    granular.scanned = {*friction};
    starts.push_back(std::move(granular));
  }
  if (const auto flowing = numbers.number("flow_rate")) {
    FlowStart paste = plastic;
    paste.name = "paste";
    numbers.set("flow_rate", rate, paste);
    paste.scanned.push_back(*flowing);
    starts.push_back(std::move(paste));
    FlowStart liquid = start("liquid");
    numbers.set("yield_strain", 0.0, liquid);
    numbers.set("flow_rate", rate, liquid);
    liquid.scanned = {*flowing};
    starts.push_back(std::move(liquid));
  }
  return starts;
}

std::vector<FlowFound> search_flows(const Parameters& parameters,
                                    const std::vector<FlowStart>& starts, const Costs& costs,
                                    bool finely) {
  const Quantity& youngs = row_named(Owner::kBody, "material.E");
  const auto moved = [&](std::vector<double> values, std::size_t number, double factor) {
    const Parameter& parameter = parameters.parameters()[number];
    values[number] = std::clamp(factor * values[number], parameter.low, parameter.high);
    return values;
  };
  std::vector<std::vector<double>> points;
  std::vector<std::size_t> of;
  for (std::size_t s = 0; s < starts.size(); ++s) {
    std::vector<std::vector<double>> some{starts[s].values};
    some.insert(some.end(), starts[s].others.begin(), starts[s].others.end());
    const auto multiply = [&](std::size_t number, std::initializer_list<double> factors) {
      const std::vector<std::vector<double>> from = some;
      for (const double factor : factors) {
        for (const std::vector<double>& point : from) some.push_back(moved(point, number, factor));
      }
    };
    for (std::size_t i = 0; i < parameters.size(); ++i) {
      const bool stiffness = parameters.path(i).quantity == &youngs;
      if (stiffness && !starts[s].own_stiffness) multiply(i, {0.1, 10.0});
    }
    if (!starts[s].scanned.empty()) multiply(starts[s].scanned.front(), {0.1, 0.3, 3.0, 10.0});
    of.insert(of.end(), some.size(), s);
    points.insert(points.end(), some.begin(), some.end());
  }
  const std::vector<double> found = costs(points);
  std::vector<FlowFound> best;
  std::vector<std::size_t> start_of;
  for (std::size_t k = 0; k < points.size(); ++k) {
    if (best.empty() || start_of.back() != of[k]) {
      best.push_back({starts[of[k]].name, {points[k], found[k]}});
      start_of.push_back(of[k]);
    } else if (found[k] < best.back().at.cost) {
      best.back().at = {points[k], found[k]};
    }
  }
  std::vector<std::size_t> order(best.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  const auto nearer = [&](std::size_t a, std::size_t b) {
    return best[a].at.cost < best[b].at.cost;
  };
  std::stable_sort(order.begin(), order.end(), nearer);
  for (std::size_t k = 0; k < std::min<std::size_t>(2, order.size()); ++k) {
    Scanned& at = best[order[k]].at;
    at = scanned(parameters, at.values, at.cost, costs, kFarthest, finely,
                 starts[start_of[order[k]]].scanned);
  }
  std::stable_sort(order.begin(), order.end(), nearer);
  std::vector<FlowFound> sorted;
  sorted.reserve(order.size());
  for (const std::size_t k : order) sorted.push_back(std::move(best[k]));
  return sorted;
}

std::string flow_statement(const std::vector<FlowFound>& found) {
  std::string list;
  for (const FlowFound& flow : found) {
    if (!std::isfinite(flow.at.cost)) continue;
    list +=
        fmt::format("{}{} by {:.3g} mm", list.empty() ? "" : ", ", flow.name, 1e3 * flow.at.cost);
  }
  return "Looked for as each class of flow, it misses the capture: " + list + ".";
}

}  // namespace matterfit::fit
