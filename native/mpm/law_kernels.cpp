// SPDX-License-Identifier: GPL-3.0-or-later
#include "mpm/law_kernels.hpp"

#include <algorithm>
#include <string>
#include <vector>

#include "base/error.hpp"

namespace matterfit::mpm {
namespace {

using material::Law;

std::vector<const AddedLaw*>& added_laws() {
  static std::vector<const AddedLaw*> laws;
  return laws;
}

/// An added law's own kernel, else `usual`.
template <class S, class Kernel>
Kernel kernel_of(Law law, Kernel usual, Kernel LawKernels<S>::*own) {
  const material::LawTraits& row = material::traits(law);
  if (!material::is_added(row.family)) return usual;
  for (const AddedLaw* added : added_laws()) {
    if (added->law() != law) continue;
    if (const Kernel kernel = added->kernels<S>().*own) return kernel;
  }
  throw_compute("the law " + std::string(row.name) +
                " has no kernels for this formulation and precision.");
}

}  // namespace

AddedLaw::AddedLaw(const material::LawTraits& row, const LawKernels<float>& in_float,
                   const LawKernels<double>& in_double)
    : row_(row), in_float_(in_float), in_double_(in_double) {
  added_laws().push_back(this);
}

AddedLaw::~AddedLaw() { std::erase(added_laws(), this); }

template <>
const LawKernels<float>& AddedLaw::kernels<float>() const {
  return in_float_;
}
template <>
const LawKernels<double>& AddedLaw::kernels<double>() const {
  return in_double_;
}

template <class S>
auto total_forces_of(const Kernels<S>& table, Law law) -> decltype(table.total_forces) {
  return kernel_of<S>(law, table.total_forces, &LawKernels<S>::total_forces);
}
template <class S>
auto total_forces_of(const AdjointKernels<S>& table, Law law) -> decltype(table.total_forces) {
  return kernel_of<S>(law, table.total_forces, &LawKernels<S>::total_forces_adjoint);
}
template <class S>
auto updated_block_of(const Kernels<S>& table, Law law) -> decltype(table.updated_block) {
  const auto usual = law == Law::kPublished ? table.updated_published_block : table.updated_block;
  return kernel_of<S>(law, usual, &LawKernels<S>::updated_block);
}
template <class S>
auto updated_block_of(const UpdatedAdjointKernels<S>& table, Law law)
    -> decltype(table.updated_block) {
  const auto usual = law == Law::kPublished ? table.updated_published_block : table.updated_block;
  return kernel_of<S>(law, usual, &LawKernels<S>::updated_block_adjoint);
}

template auto total_forces_of(const Kernels<float>&, Law) -> decltype(Kernels<float>::total_forces);
template auto total_forces_of(const Kernels<double>&, Law)
    -> decltype(Kernels<double>::total_forces);
template auto total_forces_of(const AdjointKernels<float>&, Law)
    -> decltype(AdjointKernels<float>::total_forces);
template auto total_forces_of(const AdjointKernels<double>&, Law)
    -> decltype(AdjointKernels<double>::total_forces);
template auto updated_block_of(const Kernels<float>&, Law)
    -> decltype(Kernels<float>::updated_block);
template auto updated_block_of(const Kernels<double>&, Law)
    -> decltype(Kernels<double>::updated_block);
template auto updated_block_of(const UpdatedAdjointKernels<float>&, Law)
    -> decltype(UpdatedAdjointKernels<float>::updated_block);
template auto updated_block_of(const UpdatedAdjointKernels<double>&, Law)
    -> decltype(UpdatedAdjointKernels<double>::updated_block);

}  // namespace matterfit::mpm
