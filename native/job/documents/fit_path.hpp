// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "job/documents/document.hpp"

namespace matterfit::job {

/// What a fit can move.
enum class FitQuantity {
  kYoungsModulus,
  kPoissonRatio,
  kYieldStress,
  kHardening,
  kViscosity,
  kExponent,
  kFrictionAngle,
  kCohesion,
  kBulkModulus,
  kDampingShear,
  kDampingBulk,
  kMaxwellModulus,
  kMaxwellTime,
  kDensity,
  kVelocity,
  kSpin,
  kPosition,  ///< of the body's placement
  kRotation,  ///< of the body's placement: a rotation vector on top of the document's [rad]
  kGravity,
  kFriction,          ///< Coulomb's coefficient of a collider
  kContactStiffness,  ///< of a collider [Pa/m]
  kHeight,            ///< of a ground
  kStartFrame,        ///< of a capture: the scene frame of its time 0
};

/// One quantity of a scene, as `fit.parameters` names it.
struct FitPath {
  FitQuantity quantity = FitQuantity::kYoungsModulus;
  std::string capture;           ///< of this capture's own scene only; empty: of every scene
  std::string owner;             ///< body or collider; of a start frame the capture
  std::size_t branch = 0;        ///< Maxwell branch
  std::optional<int> component;  ///< of a vector; none: all three

  /// The full form: `bodies.dough.material.E`, `bodies.dough.velocity[2]`,
  /// `captures.b.bodies.dough.velocity`.
  [[nodiscard]] std::string text() const;
  [[nodiscard]] bool is_vector() const;
  [[nodiscard]] bool is_material() const;
  /// The parameter's name in a `material`, without damping and Maxwell branches; else empty.
  [[nodiscard]] std::string_view law_parameter() const;
};

/// Reads a path, short forms too, against the scene it is about. Throws Error(kInput) beginning
/// with `where`.
[[nodiscard]] FitPath read_fit_path(const std::string& text, const std::string& where,
                                    const SceneDoc& scene, const std::vector<CaptureDoc>& captures);

/// Why a collider's quantity cannot be set in a scene that has a collider of that name, and a
/// Maxwell branch's in one that has the body, a sentence; empty: it can.
[[nodiscard]] std::string collider_obstacle(const SceneDoc& scene, const FitPath& path);
[[nodiscard]] std::string branch_obstacle(const SceneDoc& scene, const FitPath& path);

/// The quantity in a document's `scene` (or in overrides of one): the number, the vector, for a
/// rotation the quaternion. Null where it does not stand there.
[[nodiscard]] const Json* find_quantity(const Json& scene, const FitPath& path);

/// Sets it, making what is missing on the way; of a vector the component. `value` of a rotation is
/// the quaternion [w, x, y, z].
void set_quantity(Json& scene, const FitPath& path, const Json& value);

/// Makes room for set_quantity() in overrides of a scene: the owner's entry, and what would be
/// replaced as a whole (a vector, the list of Maxwell branches), as `scene` has it.
void copy_quantity(const Json& scene, const FitPath& path, Json& overrides);

/// The list entry called `name` (a collider without a name is called `collider` and its index);
/// null if there is none.
[[nodiscard]] Json* find_named(Json& scene, const char* list, const std::string& name);

}  // namespace matterfit::job
