// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <span>
#include <string_view>

#include "base/vec.hpp"

namespace matterfit::material {

template <class S>
struct LawConstants;

enum class Law {
  kFixedCorotated,
  kNeoHookean,
  kStvkHencky,
  kVonMises,
  kHerschelBulkley,
  kDruckerPrager,
  kNewtonian,
  kNeuralIsotropic,
  kLatent,
  kPublished,
};

/// Whether the kernels simulate it as the isotropic neural law.
[[nodiscard]] constexpr bool is_isotropic(Law law) {
  return law == Law::kNeuralIsotropic || law == Law::kLatent;
}

/// The elasticity under a law: laws of one family share their stress, and differ by what they keep
/// of a trial strain. kHencky: energies of Hencky strains, a quadratic one or our net's, which the
/// kernels distinguish at run time. kPublished: the published neural law, which takes panels of
/// points (neural/published-inl.hpp) and has no part in dispatch(). Numbers beyond are families of
/// laws that are added to the table (AddedLaw), which come with kernels of their own.
enum class StressFamily {
  kFixedCorotated,
  kNeoHookean,
  kHencky,
  kNewtonian,
  kPublished,
};

[[nodiscard]] constexpr bool is_added(StressFamily family) {
  return family > StressFamily::kPublished;
}
/// Whether a flow comes with the family's stress. The laws of other families keep what of the
/// deformation is elastic.
[[nodiscard]] constexpr bool has_flow(StressFamily family) {
  return family == StressFamily::kHencky || is_added(family);
}

/// The energies of an added law per volume at rest [J/m³]: of shape at F, and of volume at J̄
/// (elastic_energy.hpp).
struct LawEnergy {
  double (*shape)(const LawConstants<double>& law, const Mat3d& f) = nullptr;
  double (*volume)(const LawConstants<double>& law, double j) = nullptr;
};

/// What the rest of the program asks of a law, in place of its name. A new law is a row of the
/// table in law_table.cpp, an enumerator, and its stress where it is of a new family.
struct LawTraits {
  Law law = Law::kFixedCorotated;
  std::string_view name;   ///< in documents
  std::string_view label;  ///< for people
  StressFamily family = StressFamily::kFixedCorotated;
  /// Keys of the job document that it uses, elastic ones first, without the damping and Maxwell
  /// ones that every law takes.
  std::span<const std::string_view> parameters;
  bool plastic = false;  ///< the return mapping changes the elastic deformation gradient
  bool fluid = false;    ///< no shear stiffness; of F only J is history
  /// Large flow without a shape to return to: particles are filled jittered.
  bool flows = false;
  /// Adheres to surfaces by its particles' faces: fluids and pastes.
  bool wets = false;
  /// The volume term may be taken of a cell's mean J (variational mean dilatation). Not where the
  /// return mapping changes the trace of the strain.
  bool mean_dilatation = true;
  /// Stress at a point depends on a pressure that noisy tracks cannot show.
  bool pressure_dependent = false;
  LawEnergy energy = {};  ///< of an added elastic law

  /// Without plastic flow and not a fluid: may be simulated total Lagrangian for ever.
  [[nodiscard]] constexpr bool elastic() const { return !plastic && !fluid; }
  [[nodiscard]] bool uses(std::string_view key) const;
};

/// All laws, in the order of the enumerators.
[[nodiscard]] std::span<const LawTraits> all_laws();
[[nodiscard]] const LawTraits& traits(Law law);

/// A law of a family of its own beside those of the library, in the table for as long as this
/// lives; its kernels come with it (mpm/law_kernels.hpp). Nothing else may use the table while a
/// law is added or taken away, and the last one that was added goes first.
class AddedLaw {
 public:
  /// Throws Error(kInput) if a law of that name is there, its family is one of the library's, an
  /// elastic one has no energy, or too many are added.
  explicit AddedLaw(const LawTraits& row);
  ~AddedLaw();
  AddedLaw(const AddedLaw&) = delete;
  AddedLaw& operator=(const AddedLaw&) = delete;
  [[nodiscard]] Law law() const { return law_; }

 private:
  Law law_;
};

/// What the flow of a law that spans the classes makes of it.
enum class FlowClass { kElastic, kPlastic, kGranular, kLiquid };
/// Those of the isotropic neural law, or of the latent one, whose flow is of that class; traits()
/// has those of kPlastic.
[[nodiscard]] const LawTraits& neural_traits(Law law, FlowClass flow);

/// Throws Error(kCompute): the stress of the family is not here.
[[noreturn]] void refuse_family(StressFamily family);

/// Calls f.operator()<family>() for the family of a law. Every switch over families is here, so
/// that a new one is a compiler's error where it is forgotten and not another law's stress. What
/// simulates the published law, or an added one, asks for it before; else refuse_family().
template <class F>
decltype(auto) dispatch(StressFamily family, F&& f) {
  switch (family) {
    case StressFamily::kFixedCorotated:
      return f.template operator()<StressFamily::kFixedCorotated>();
    case StressFamily::kNeoHookean:
      return f.template operator()<StressFamily::kNeoHookean>();
    case StressFamily::kHencky:
      return f.template operator()<StressFamily::kHencky>();
    case StressFamily::kNewtonian:
      return f.template operator()<StressFamily::kNewtonian>();
    case StressFamily::kPublished:
      break;
  }
  refuse_family(family);
}

}  // namespace matterfit::material
