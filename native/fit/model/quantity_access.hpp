// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "fit/model/quantity.hpp"

/// Where each kind of quantity lies (Access), for the rows of the table (quantity_rows.hpp).
namespace matterfit::fit {

[[nodiscard]] Access material_access(double material::Material::*member,
                                     double material::MaterialGradient::*slope);
[[nodiscard]] Access maxwell_access(double material::MaxwellBranch::*member);
/// A move of the isotropic neural law's weights; 0 where the material has none.
[[nodiscard]] Access weight_move_access();
/// A number of the latent law's code; 0 where the material has none.
[[nodiscard]] Access latent_access();
/// A number of the correction beside a law; 0 where the material has none.
[[nodiscard]] Access correction_access();
[[nodiscard]] Access density_access();
/// A vector of a body's initial motion.
[[nodiscard]] Access motion_access(Vec3d mpm::Body::*member, Vec3d mpm::BodyGradient::*slope);
[[nodiscard]] Access position_access();
[[nodiscard]] Access rotation_access();
[[nodiscard]] Access gravity_access();
[[nodiscard]] Access friction_access();
/// The stiffness that the solver takes, where the scene has none.
[[nodiscard]] Access contact_stiffness_access();
[[nodiscard]] Access height_access();
[[nodiscard]] Access start_frame_access();
[[nodiscard]] Access camera_shift_access();
[[nodiscard]] Access camera_turn_access();
[[nodiscard]] Access camera_focal_access();

}  // namespace matterfit::fit
