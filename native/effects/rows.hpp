// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "effects/effect_type.hpp"

namespace matterfit::effects {

// The catalogue's rows: each is defined in the file of its name, and listed in catalogue.cpp.
[[nodiscard]] const EffectType& drag_linear();
[[nodiscard]] const EffectType& drag_quadratic();
[[nodiscard]] const EffectType& wind();
[[nodiscard]] const EffectType& buoyancy();
[[nodiscard]] const EffectType& force_field();
[[nodiscard]] const EffectType& vortex();
[[nodiscard]] const EffectType& frame_acceleration();
[[nodiscard]] const EffectType& stiffness_inclusion();
[[nodiscard]] const EffectType& stiffness_gradient();
[[nodiscard]] const EffectType& fibres();
[[nodiscard]] const EffectType& strain_stiffening();
[[nodiscard]] const EffectType& second_invariant();

}  // namespace matterfit::effects
