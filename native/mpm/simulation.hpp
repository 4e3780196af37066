// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "base/interrupter.hpp"
#include "base/parallel.hpp"
#include "base/vec.hpp"
#include "math/simd_target.hpp"
#include "mpm/observed_frame.hpp"
#include "mpm/rigid_change.hpp"
#include "mpm/scene.hpp"

namespace matterfit::mpm {

using matterfit::SimdTarget;

/// What the particles of one body do at one frame. Order: that of Body::rest. World space.
struct BodyState {
  std::vector<Vec3f> positions;              ///< [m]
  std::vector<Vec3f> velocities;             ///< [m/s]
  std::vector<Mat3f> deformation_gradients;  ///< F, column-major 3×3
  std::vector<float> plastic_strain;         ///< equivalent plastic strain; empty for elastic laws
};

struct FrameState {
  int frame = 0;
  double time = 0.0;  ///< seconds after the scene's first frame
  std::vector<BodyState> bodies;
};

/// What one frame took and did; becomes a line of stats.jsonl.
struct FrameReport {
  int frame = 0;
  int substeps = 0;
  double dt = 0.0;                ///< [s]
  std::string dt_limit;           ///< what set dt: "elastic wave of BODY", "CFL", "contact", …
  double max_speed = 0.0;         ///< [m/s]
  double min_volume_ratio = 1.0;  ///< smallest J = det F
  double max_volume_ratio = 1.0;
  double max_penetration = 0.0;  ///< deepest a particle's surface is inside a collider [m]
  double kinetic_energy = 0.0;   ///< [J]
  std::string note;              ///< what the solver did to go on, a sentence; mostly empty
  double seconds = 0.0;          ///< wall clock
  std::vector<double> renewals;  ///< FrameSchedule::renewals; empty without renewed bodies
};

struct MemoryEstimate {
  std::size_t particles = 0;
  std::size_t bytes = 0;
};

/// What a substep takes at the start of a run.
struct SubstepCost {
  double dt = 0.0;       ///< [s], as the first frame takes it
  double seconds = 0.0;  ///< wall clock of one substep
};

/// The forward solver: both formulations, all bodies, one clock.
/// Throws Error(kInput) for a scene that cannot be simulated and Error(kCompute) for a run that
/// fails (NaN, inverted element, energy from nowhere, particle outside the walls), naming body,
/// particle, frame, cause and what to change.
class Simulation {
 public:
  struct Options {
    SimdTarget target = SimdTarget::kAuto;
    std::size_t memory_limit = std::size_t{8} << 30U;  ///< of grids and particles [bytes]
    /// A body of formulation `auto` that the total Lagrangian one cannot follow goes on in the
    /// updated one, and the frame's note says so; else it is an error. Not in a fit, where every
    /// run must be of the same kind. For one body without pins, masses and branches, in a scene
    /// without updated bodies.
    bool hand_over = false;
    const Interrupter* interrupter = nullptr;  ///< asked while the simulation is prepared, if given
  };

  Simulation(Scene scene, std::shared_ptr<Arena> arena, Options options);
  Simulation(Scene scene, std::shared_ptr<Arena> arena);
  ~Simulation();
  Simulation(const Simulation&) = delete;
  Simulation& operator=(const Simulation&) = delete;

  [[nodiscard]] const Scene& scene() const;
  /// The frame the state stands at; scene().first_frame at the start.
  [[nodiscard]] int frame() const;
  /// Advances by one frame. On cancellation throws; the state is then unusable but for destruction.
  FrameReport advance(const Interrupter& interrupter);
  /// Changes the rigid motion of a total Lagrangian body (into Scene::bodies) between two frames.
  /// Throws Error(kInput) for another.
  void change(std::size_t body, const RigidChange& change);
  [[nodiscard]] FrameState state() const;
  /// The same without rounding, for those who compare small differences.
  [[nodiscard]] ObservedFrame observe(bool deformation_gradients) const;

  /// Runs substeps for about `seconds` of wall clock (one at least, a frame's at most) from
  /// where the first body moves, to see what they take. The state is then good for nothing but
  /// destruction.
  [[nodiscard]] SubstepCost measure(double seconds, const Interrupter& interrupter);

  /// Everything needed to go on with the same bits, and back. load() throws Error(kInput) for bytes
  /// that were not saved by the same scene and version.
  [[nodiscard]] std::string save() const;
  void load(const std::string& bytes);

  /// Memory that a scene will need, without building it.
  [[nodiscard]] static MemoryEstimate estimate(const Scene& scene);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace matterfit::mpm
