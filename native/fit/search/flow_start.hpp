// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "fit/model/parameters.hpp"
#include "fit/search/start.hpp"
#include "mpm/scene.hpp"

/// Where the search for a law that spans the classes begins: once as each class.
namespace matterfit::fit {

/// The isotropic neural law, or the latent one, as a material of one class: its flow's numbers, or
/// its code, say which, the rest of the values is left.
struct FlowStart {
  std::string_view name;  ///< elastic, plastic, paste, granular or liquid
  std::vector<double> values;
  std::vector<std::size_t> scanned;         ///< numbers that this class is looked for along
  std::vector<std::vector<double>> others;  ///< further values of the same class
  /// The values have their stiffnesses already: no decades of them are tried.
  bool own_stiffness = false;
};

/// The classes that the flow's numbers among the parameters can reach, for the first body of that
/// law that has its `yield_strain` among them; none: there is no such body, or the elastic class
/// alone is left. A number that is not among the parameters stays, and with it the classes that it
/// would determine: internal_friction granular, flow_rate paste and liquid. Numbers that a class
/// has no use for go to the bound where they do nothing: yield_strain and tear_strain to the upper,
/// internal_friction to the lower one. Plastic: from a strain of .02; paste: the same, flowing with
/// 10 Pa s; granular: a friction angle of 30° at Poisson's ratio, without cohesion; liquid: 10 Pa
/// s.
/// Where the first body whose code is among the parameters is of the latent law: the mean of each
/// class in its space, and places along the class's longest axis; liquid, whose stiffness says how
/// viscous it is: the places of fluids of 1 to 300 Pa s and two bulk moduli, with their stiffness.
[[nodiscard]] std::vector<FlowStart> flow_starts(const Parameters& parameters,
                                                 const std::vector<mpm::Scene>& scenes,
                                                 std::span<const double> values);

/// A class with its numbers looked for.
struct FlowFound {
  std::string_view name;
  Scanned at;  ///< cost infinite: nothing of it could be simulated
};

/// The best of each class, nearest first: of three stiffnesses a decade apart (where the start has
/// none of its own) times five of the class's numbers half a decade apart, or of its places; the
/// two nearest classes by scanned() along their own numbers too.
[[nodiscard]] std::vector<FlowFound> search_flows(const Parameters& parameters,
                                                  const std::vector<FlowStart>& starts,
                                                  const Costs& costs, bool finely);

/// A sentence: how near each class comes.
[[nodiscard]] std::string flow_statement(const std::vector<FlowFound>& found);

}  // namespace matterfit::fit
