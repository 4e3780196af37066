// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <span>

#include "base/parallel.hpp"
#include "base/vec.hpp"

namespace matterfit::fit {

/// How two samplings of one body are compared, from one of them.
struct CloudScale {
  double reach = 0.0;  ///< of the weights below [m]: some three times the points' spacing
  double sigma = 0.0;  ///< what a coordinate of a residual is off where the bodies are alike [m]
  double alike = 1.0;  ///< points that share what they are off, so that they count as one
};

/// From a captured cloud of points drawn at random, with noise of `noise` [m]; the other sampling
/// is denser, or a lattice. Points that are not finite are left out. Throws Error(kInput) where no
/// captured point is finite, and for a noise that is not above 0.
[[nodiscard]] CloudScale cloud_scale(std::span<const Vec3d> captured, double noise, Arena& arena);

/// The mean length of a vector whose coordinates have the standard deviation `sigma` (Maxwell's
/// distribution).
[[nodiscard]] double mean_length(double sigma);

/// At each captured point the weighted mean of those around it (below), less it [m]; 0 where it is
/// not finite. For cloud_residuals(), that need not make them anew for each simulation.
[[nodiscard]] Points cloud_means(std::span<const Vec3d> captured, const CloudScale& scale,
                                 Arena& arena);

/// Residuals of a smoothed Chamfer distance between simulated points and a captured cloud [units of
/// `sigma`], 6 |b| entries, however many simulated points there are. First, at each captured point
/// x the weighted mean of the simulated points around it less that of the captured ones, w(r) = (1
/// − r²/reach²)²; where no simulated point is within half of the reach this goes over into the
/// vector to the nearest one, as in the Chamfer distance. Then, for each captured point, the sum of
/// such vectors from the simulated points that are so far off and nearest to it, over the root of
/// their number, weighed so that all simulated points count as much as all captured ones. Not a
/// number where a simulated point is not finite, 0 for a captured one that is not.
///
/// Inside a body two samplings carry no information: their nearest points are half a spacing apart
/// whatever the body does, and least squares over those vectors, as iterated closest points do it,
/// takes that for stiffness and creeps. The two means cancel there. They differ as the gradients of
/// the logarithms of the two densities do (mean shift: Comaniciu and Meer 2002); taking off a set's
/// own mean is what debiasing is to entropic transport (Feydy et al. 2019). Only the captured
/// points carry means: those around simulated points that move through a sparse cloud change as its
/// sampling does, which looks like stiffness too.
[[nodiscard]] Eigen::VectorXd cloud_residuals(std::span<const Vec3d> simulated,
                                              std::span<const Vec3d> captured,
                                              std::span<const Vec3d> means, const CloudScale& scale,
                                              Arena& arena);

}  // namespace matterfit::fit
