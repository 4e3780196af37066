// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "job/documents/fit_document.hpp"
#include "job/documents/json_reader.hpp"

/// Candidate laws of a fit: what carries over from the document's law, and what is new.
namespace matterfit::job {

/// The material with another law. Values that both laws use stay; those that are new begin at
/// round figures that follow the stiffness: bulk modulus E/(3(1−2ν)) and back with ν = .3, a yield
/// stress of 2 % of E, a friction angle of 30°, a viscosity of 10 Pa s. The isotropic neural law
/// begins as the document's law: its moduli and flow, the form that its class was pre-trained to.
[[nodiscard]] material::Material with_law(const material::Material& material, material::Law law);

/// The parameters that are fitted with this law: those of the list that it uses, and those of its
/// own that the document's law does not have; of the latent law its stiffness and all of its code.
/// `own` is the document's.
[[nodiscard]] std::vector<fit::ParameterSpec> parameters_of_law(const FitDoc& doc,
                                                                material::Law own,
                                                                material::Law law);

/// A job document's `material`: the law's parameters, damping and branches where there are any.
[[nodiscard]] Json material_json(const material::Material& material);

}  // namespace matterfit::job
