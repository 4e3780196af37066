// SPDX-License-Identifier: GPL-3.0-or-later
// Which kernels take a body's particles through its law: those of the tables of an instruction set
// (kernels.hpp, adjoint_kernels.hpp, updated_adjoint_kernels.hpp), which know the library's laws,
// or those that a law brings along that was added to the table of laws.
#pragma once

#include "mpm/updated_adjoint_kernels.hpp"

namespace matterfit::mpm {

/// Functions like those of the same names in the tables. A formulation that the law is not for has
/// none.
template <class S>
struct LawKernels {
  void (*total_forces)(const TotalView<S>& view, std::size_t block) = nullptr;
  void (*total_forces_adjoint)(const TotalAdjointView<S>& view, std::size_t block) = nullptr;
  void (*updated_block)(UpdatedView<S>& view) = nullptr;
  void (*updated_block_adjoint)(UpdatedAdjointView<S>& view) = nullptr;
};

/// A law that is in the table, with its kernels, for as long as this lives (material::AddedLaw).
/// Its file specialises AddedStress (material/classical/laws-inl.hpp) for its family and
/// instantiates the kernels of the `-inl` headers with it: total_forces_law, TotalForcesAdjoint,
/// updated_block_law and UpdatedBlockAdjoint.
class AddedLaw {
 public:
  /// Throws as material::AddedLaw.
  AddedLaw(const material::LawTraits& row, const LawKernels<float>& in_float,
           const LawKernels<double>& in_double);
  ~AddedLaw();
  AddedLaw(const AddedLaw&) = delete;
  AddedLaw& operator=(const AddedLaw&) = delete;
  [[nodiscard]] material::Law law() const { return row_.law(); }

  template <class S>
  [[nodiscard]] const LawKernels<S>& kernels() const;

 private:
  material::AddedLaw row_;
  LawKernels<float> in_float_;
  LawKernels<double> in_double_;
};

/// The kernel of `law`, of the table's or of its own. Throws Error(kCompute) if it has none there.
template <class S>
[[nodiscard]] auto total_forces_of(const Kernels<S>& table, material::Law law)
    -> decltype(table.total_forces);
template <class S>
[[nodiscard]] auto total_forces_of(const AdjointKernels<S>& table, material::Law law)
    -> decltype(table.total_forces);
template <class S>
[[nodiscard]] auto updated_block_of(const Kernels<S>& table, material::Law law)
    -> decltype(table.updated_block);
template <class S>
[[nodiscard]] auto updated_block_of(const UpdatedAdjointKernels<S>& table, material::Law law)
    -> decltype(table.updated_block);

}  // namespace matterfit::mpm
