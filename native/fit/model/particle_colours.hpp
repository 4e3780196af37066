// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "base/interrupter.hpp"
#include "base/parallel.hpp"
#include "fit/model/image_problem.hpp"
#include "math/simd_target.hpp"
#include "mpm/scene.hpp"

namespace matterfit::fit {

/// The colours of the particles that the sightings at the scene's first frame show, of bodies that
/// start as `start` has them and cameras as they stand: those with which the drawn images are
/// nearest to the seen ones where both are all body, in least squares, by the simultaneous
/// algebraic reconstruction technique (SIRT: Gilbert, Journal of Theoretical Biology 36, 1972) on
/// the rasteriser and its adjoint. Sightings that are held out or have no colours are left out.
/// `known` is s / (s + ½) for a particle that s pixels see. Bodies that are drawn by splats (`own`)
/// keep theirs, and nothing is learnt where the sightings show such alone. Equal bits for any
/// number of threads. Throws Error(kInput) where no sighting with colours shows the first frame.
[[nodiscard]] ParticleColours learn_colours(const mpm::Scene& start, std::span<const OwnSplats> own,
                                            const std::vector<Sighting>& sightings,
                                            const std::shared_ptr<Arena>& arena, SimdTarget target,
                                            const Interrupter& interrupter);

}  // namespace matterfit::fit
