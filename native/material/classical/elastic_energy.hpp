// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "base/vec.hpp"
#include "material/classical/law_constants.hpp"

namespace matterfit::material {

/// Energy densities at rest volume [J/m³] of the elastic laws, of whose sum the kernels' Kirchhoff
/// stress is the derivative, τ = (dΨ/dF) Fᵀ (laws-inl.hpp); Maxwell branches left out. `f` is the
/// elastic deformation gradient, det F > 0.
/// Energy of the shape; of laws whose energy is not split all that is no function of J alone.
[[nodiscard]] double shape_energy(const LawConstants<double>& law, const Mat3d& f);
/// Energy of the volume ratio: of the mean one where the solver takes a cell's mean dilatation.
[[nodiscard]] double volume_energy(const LawConstants<double>& law, double j);
/// Energy of the pressure that keeps a crushed cell from turning inside out; 0 from half the volume
/// up.
[[nodiscard]] double crush_energy(const LawConstants<double>& law, double j);

}  // namespace matterfit::material
