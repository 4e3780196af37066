// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <functional>
#include <memory>
#include <vector>

#include "base/interrupter.hpp"
#include "base/parallel.hpp"
#include "base/vec.hpp"
#include "material/classical/law_gradient.hpp"
#include "mpm/observed_frame.hpp"
#include "mpm/scene.hpp"
#include "mpm/schedule.hpp"
#include "mpm/simulation.hpp"
#include "shape/collider_adjoint.hpp"

namespace matterfit::mpm {

/// What it says of it: its share of the loss, and the derivatives of that with respect to the
/// particles' positions, velocities and deformation gradients, per body one each or none at all.
/// Empty to begin with, one for each body of the scene.
struct FrameLoss {
  struct Body {
    std::vector<Vec3d> positions;
    std::vector<Vec3d> velocities;
    std::vector<Mat3d> deformation_gradients;
  };
  double loss = 0.0;
  std::vector<Body> bodies;
};

/// Called once for each frame, in order, the first one included.
using Observer = std::function<void(const ObservedFrame& frame, FrameLoss& loss)>;

struct BodyGradient {
  material::MaterialGradient material;
  double density = 0.0;
  /// By a shift of the whole body at the start, with its pins and masses, against colliders and the
  /// observer.
  Vec3d offset = Vec3d::Zero();
  /// By its turn about its centre of volume, with its pins, their motion and its masses; it is
  /// thrown as before [1/rad].
  Vec3d rotation = Vec3d::Zero();
  Vec3d velocity = Vec3d::Zero();  ///< by Body::velocity
  Vec3d spin = Vec3d::Zero();      ///< by Body::spin
  std::vector<Vec3d> particle_velocities;
};

/// By contact (the stiffness is the resolved one where the scene has 0) and place. Updated bodies
/// that the collider meets node by node do not feel where its surface is, only how it is inclined
/// and moves.
using ColliderGradient = shape::ColliderCotangents;

/// A loss and its derivatives by everything that the scene says, per unit of each.
struct Gradient {
  double loss = 0.0;
  std::vector<BodyGradient> bodies;
  std::vector<ColliderGradient> colliders;  ///< the scene's, then its walls
  Vec3d gravity = Vec3d::Zero();            ///< by something added to it at all times
  /// For each of the scene's effects, by Effect::values (by something added at all times to what is
  /// keyed); for neutral ones too.
  std::vector<std::vector<double>> effects;
  Schedule schedule;  ///< as the run was stepped
  std::size_t substeps = 0;
  std::size_t recomputed = 0;   ///< substeps that were run a second time
  std::size_t state_bytes = 0;  ///< of what is kept of one substep, about
  std::size_t peak_bytes = 0;   ///< of all that was recorded at once, as the budget counts it
};

struct GradientOptions {
  Simulation::Options simulation;
  /// For states and cotangents that are kept for the way back [bytes]. Where it holds what every
  /// substep goes back by nothing is run twice; else states are kept at the ends of segments, and
  /// each segment is run again, at most once. The result is the same to the last bit.
  std::size_t memory_budget = std::size_t{2} << 30U;
  /// Frames that it has are stepped by it; Scene::substeps and the solver's choice set the others.
  Schedule schedule;
  /// Derivatives by damping also where there is none, and by a fluid's viscosity where that is 0:
  /// takes the velocity gradients of materials that do not need them. Else those are given as 0.
  bool of_no_damping = true;
  /// Derivatives by the published law's weights (material::MaterialGradient::published), which take
  /// the way back of its bodies half as long again.
  bool published_weights = false;
  /// Observers see deformation gradients, as points bound beside particles follow them
  /// (capture/binding.hpp).
  bool deformation_gradients = false;
  /// Called from the calling thread with the share that is done, from 0 to 1.
  std::function<void(double)> progress;
};

/// The loss of a run and how it was stepped: what gradient() gives, without the way back, of the
/// same scenes.
struct RollOut {
  double loss = 0.0;
  Schedule schedule;
};
template <class S>
[[nodiscard]] RollOut roll_out(const Scene& scene, const std::shared_ptr<Arena>& arena,
                               const Observer& observer, const GradientOptions& options,
                               const Interrupter& interrupter);

/// Runs a scene over its frames, asks the observer for its loss in each, and goes back over all
/// substeps by hand-written adjoints (physics: hand-written adjoints, two-level checkpoints). The
/// forward pass has the bits of Simulation with the same substeps.
///
/// Exact for the discrete scheme, whose schedule is taken as given: differences between runs with
/// that schedule converge to it. Where the solver resolved a contact's stiffness from the material,
/// that stays as well. Where contact or yield sets in, the side of the forward pass counts.
///
/// S: the particles' scalar; double is for proofs. Throws Error(kInput) for scenes it has no
/// adjoint of (several bodies of which one is total Lagrangian, as they may touch) and for a budget
/// that cannot hold the run, with the one that would; Error(kCompute) for a run that fails.
template <class S>
[[nodiscard]] Gradient gradient(const Scene& scene, const std::shared_ptr<Arena>& arena,
                                const Observer& observer, const GradientOptions& options,
                                const Interrupter& interrupter);

extern template RollOut roll_out<float>(const Scene&, const std::shared_ptr<Arena>&,
                                        const Observer&, const GradientOptions&,
                                        const Interrupter&);
extern template RollOut roll_out<double>(const Scene&, const std::shared_ptr<Arena>&,
                                         const Observer&, const GradientOptions&,
                                         const Interrupter&);
extern template Gradient gradient<float>(const Scene&, const std::shared_ptr<Arena>&,
                                         const Observer&, const GradientOptions&,
                                         const Interrupter&);
extern template Gradient gradient<double>(const Scene&, const std::shared_ptr<Arena>&,
                                          const Observer&, const GradientOptions&,
                                          const Interrupter&);

}  // namespace matterfit::mpm
