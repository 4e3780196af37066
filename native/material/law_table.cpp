// SPDX-License-Identifier: GPL-3.0-or-later
#include "material/law_table.hpp"

#include <algorithm>
#include <array>
#include <string>

#include "base/error.hpp"

namespace matterfit::material {
namespace {

using Key = std::string_view;

constexpr std::array<Key, 2> kElastic = {"E", "nu"};
constexpr std::array<Key, 4> kVonMises = {"E", "nu", "yield_stress", "hardening"};
constexpr std::array<Key, 5> kHerschelBulkley = {"E", "nu", "yield_stress", "viscosity",
                                                 "exponent"};
constexpr std::array<Key, 4> kDruckerPrager = {"E", "nu", "friction_angle", "cohesion"};
constexpr std::array<Key, 2> kNewtonian = {"bulk_modulus", "viscosity"};

constexpr std::array<Key, 12> kNeural = {"E",
                                         "nu",
                                         "form_1",
                                         "form_2",
                                         "form_3",
                                         "form_4",
                                         "yield_strain",
                                         "internal_friction",
                                         "strain_hardening",
                                         "tear_strain",
                                         "flow_rate",
                                         "flow_thinning"};

/// Beside its code.
constexpr std::array<Key, 1> kLatent = {"E"};

constexpr LawTraits neural(Law law, FlowClass flow) {
  const bool latent = law == Law::kLatent;
  return {.law = law,
          .name = latent ? Key("latent") : Key("neural_isotropic"),
          .label = latent ? Key("Neural (latent)") : Key("Neural (isotropic)"),
          .family = StressFamily::kHencky,
          .parameters = latent ? std::span<const Key>(kLatent) : std::span<const Key>(kNeural),
          .plastic = flow != FlowClass::kElastic,
          .flows = flow == FlowClass::kGranular || flow == FlowClass::kLiquid,
          .wets = flow == FlowClass::kLiquid,
          .mean_dilatation = flow != FlowClass::kGranular,
          .pressure_dependent = flow == FlowClass::kGranular};
}

constexpr std::array<LawTraits, 4> of_each_class(Law law) {
  return {neural(law, FlowClass::kElastic), neural(law, FlowClass::kPlastic),
          neural(law, FlowClass::kGranular), neural(law, FlowClass::kLiquid)};
}
constexpr std::array<LawTraits, 4> kNeuralLaws = of_each_class(Law::kNeuralIsotropic);
constexpr std::array<LawTraits, 4> kLatentLaws = of_each_class(Law::kLatent);

constexpr std::array<LawTraits, 10> kLaws = {{
    {.law = Law::kFixedCorotated,
     .name = "fixed_corotated",
     .label = "Fixed Corotated",
     .family = StressFamily::kFixedCorotated,
     .parameters = kElastic},
    {.law = Law::kNeoHookean,
     .name = "neo_hookean",
     .label = "Neo-Hookean",
     .family = StressFamily::kNeoHookean,
     .parameters = kElastic},
    {.law = Law::kStvkHencky,
     .name = "stvk_hencky",
     .label = "StVK–Hencky",
     .family = StressFamily::kHencky,
     .parameters = kElastic},
    {.law = Law::kVonMises,
     .name = "von_mises",
     .label = "von Mises",
     .family = StressFamily::kHencky,
     .parameters = kVonMises,
     .plastic = true},
    {.law = Law::kHerschelBulkley,
     .name = "herschel_bulkley",
     .label = "Herschel–Bulkley",
     .family = StressFamily::kHencky,
     .parameters = kHerschelBulkley,
     .plastic = true,
     .flows = true,
     .wets = true},
    {.law = Law::kDruckerPrager,
     .name = "drucker_prager",
     .label = "Drucker–Prager",
     .family = StressFamily::kHencky,
     .parameters = kDruckerPrager,
     .plastic = true,
     .flows = true,
     .mean_dilatation = false,
     .pressure_dependent = true},
    {.law = Law::kNewtonian,
     .name = "newtonian",
     .label = "Newtonian Fluid",
     .family = StressFamily::kNewtonian,
     .parameters = kNewtonian,
     .fluid = true,
     .flows = true,
     .wets = true},
    neural(Law::kNeuralIsotropic, FlowClass::kPlastic),
    neural(Law::kLatent, FlowClass::kPlastic),
    {.law = Law::kPublished,
     .name = "neural",
     .label = "Neural (published)",
     .family = StressFamily::kPublished,
     .parameters = {},
     .plastic = true,
     .mean_dilatation = false},
}};

constexpr bool in_order() {
  for (std::size_t i = 0; i < kLaws.size(); ++i) {
    if (kLaws[i].law != static_cast<Law>(i)) return false;
  }
  return true;
}
static_assert(in_order());

constexpr std::size_t kMostAdded = 4;

/// The laws of the library and those that were added.
struct Table {
  std::array<LawTraits, kLaws.size() + kMostAdded> rows;
  std::size_t size;
};

constexpr Table own_laws() {
  Table table{{}, kLaws.size()};
  std::copy(kLaws.begin(), kLaws.end(), table.rows.begin());
  return table;
}
constinit Table law_rows = own_laws();

}  // namespace

void refuse_family(StressFamily family) {
  throw_compute(
      is_added(family)
          ? "a law that was added to the table is simulated in the formulations 'total' and "
            "'updated' alone; here it has no stress."
          : "the law neural is simulated in the formulation 'updated' alone; here it has no "
            "stress.");
}

bool LawTraits::uses(std::string_view key) const {
  return std::find(parameters.begin(), parameters.end(), key) != parameters.end();
}

std::span<const LawTraits> all_laws() { return {law_rows.rows.data(), law_rows.size}; }

const LawTraits& traits(Law law) {
  const auto row = static_cast<std::size_t>(law);
  if (row >= law_rows.size) throw_compute("a law is used that is not in the table.");
  return law_rows.rows[row];
}

AddedLaw::AddedLaw(const LawTraits& row) : law_(static_cast<Law>(law_rows.size)) {
  const std::string name = "the law '" + std::string(row.name) + "'";
  for (const LawTraits& other : all_laws()) {
    if (other.name == row.name) throw_input(name + " is in the table already.");
  }
  if (!is_added(row.family)) throw_input(name + " is added with a family of the library's.");
  if (row.elastic() && (row.energy.shape == nullptr || row.energy.volume == nullptr)) {
    throw_input(name + " is elastic and does not say its energy.");
  }
  if (law_rows.size == law_rows.rows.size()) {
    throw_input(name + ": the table takes " + std::to_string(kMostAdded) + " added laws.");
  }
  law_rows.rows[law_rows.size] = row;
  law_rows.rows[law_rows.size++].law = law_;
}

AddedLaw::~AddedLaw() { --law_rows.size; }

const LawTraits& neural_traits(Law law, FlowClass flow) {
  return (law == Law::kLatent ? kLatentLaws : kNeuralLaws).at(static_cast<std::size_t>(flow));
}

}  // namespace matterfit::material
