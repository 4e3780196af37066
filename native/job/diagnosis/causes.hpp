// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "diagnose/model.hpp"
#include "fit/model/quantity.hpp"
#include "job/documents/document.hpp"
#include "mpm/scene.hpp"

namespace matterfit::job {

/// A candidate cause with how it comes into a scene and into a document.
struct Cause {
  diagnose::Effect row;
  /// Puts it into a scene that was built of the document; empty for
  /// observations, which act on what is seen. `values` are physical, one a
  /// number of the row.
  std::function<void(std::span<const double> values, int variant, mpm::Scene& scene)> apply;
  /// Whether such numbers make a scene; empty: all within their bounds do. Others count as what
  /// cannot be simulated.
  std::function<bool(std::span<const double> values)> allowed = {};
  /// Puts it into the scene of a document, so that the extended model runs with
  /// it; empty for observations and with `run`.
  std::function<void(std::span<const double> values, int variant, Json& scene)> write;
  /// The run whose scene alone it changes, as a load that only one recording has; empty: every
  /// scene.
  std::optional<std::size_t> run = {};
  /// With `run`: puts it into what the scene of its captures lays over the document's own.
  std::function<void(std::span<const double> values, int variant, const Json& scene, Json& over)>
      write_over = {};
};

/// A scene of its own that used captures have.
struct OwnScene {
  std::size_t run = 0;
  std::string capture;  ///< the first of them
  Json masses;          ///< that its body has there, a list
};

/// Where a recording shows that a body ran into something that the simulation passes through, or
/// was pushed for a while (`lasts` > 0).
struct Encounter {
  Vec3d point = Vec3d::Zero();    ///< of the body that went farthest then; its middle then [m]
  Vec3d normal = Vec3d::UnitZ();  ///< unit, in which the body was pushed
  /// How far the simulated body goes beyond `point`; how far the body went while it was pushed [m].
  double reach = 0.0;
  double time = 0.0;   ///< when it began, after the scene's first frame [s]
  double lasts = 0.0;  ///< [s]; 0: it was over at once
};

/// What the causes of a scene depend on beside the scene itself.
struct CauseOptions {
  std::vector<fit::Address> fitted;   ///< what a fit moves: no causes of their own
  double duration = 1.0;              ///< of the longest recording [s]
  double rows = 1e9;                  ///< coordinates that the recordings show
  std::vector<Encounter> encounters;  ///< where something is that nobody listed
  std::vector<OwnScene> own_scenes;   ///< beside the first run's
};

/// Every cause that makes sense of the first body of a scene: the catalogue's
/// terms (effects/), the scene's own numbers that are not fitted (gravity,
/// contact, damping, relaxation, attached masses), shaking, a collider or a push that it lacks, and
/// what a camera or a tracker may do to the recording. `document` and `scene` are of the same job.
[[nodiscard]] std::vector<Cause> scene_causes(const Job& job, const mpm::Scene& scene,
                                              const CauseOptions& options);

}  // namespace matterfit::job
