// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstddef>
#include <functional>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "fit/data/capture.hpp"
#include "fit/numerics/parameter.hpp"
#include "mpm/gradient.hpp"
#include "mpm/scene.hpp"

/// The numbers of a scene that can be fitted, overridden or shown: one table, a row each.
/// Documents, fits, gradients, advice and panels read it; nothing else lists them. To add a number
/// append a row (quantity_rows_material.cpp, quantity_rows_scene.cpp).
namespace matterfit::fit {

/// Whose number it is. An owner is found by its name; the scene has none.
enum class Owner { kBody, kCollider, kScene, kCapture, kEffect };

struct Quantity;

/// One number, or one vector, of one owner.
struct Address {
  const Quantity* quantity = nullptr;
  std::string capture;           ///< in the scene of this capture alone; empty: in every scene
  std::string owner;             ///< the owner's name; empty for the scene
  std::size_t index = 0;         ///< the number in the brackets of Quantity::path
  std::optional<int> component;  ///< of a vector; none: all of it

  /// The full form: `bodies.dough.material.E`, `bodies.dough.velocity[2]`,
  /// `captures.b.bodies.dough.velocity`.
  [[nodiscard]] std::string text() const;
  /// Whether both are the same number of a scene, whichever captures they are written for.
  [[nodiscard]] bool same_number(const Address& other) const;
};

/// The components of a quantity; of a number the first.
using Components = std::array<double, 3>;

/// Where the own frames of bodies lie, by their names, as a document's placement says (world [m]);
/// a body that is not there: at zero. The solver has no use for it.
using Origins = std::map<std::string, Vec3d>;

/// What of an owner decides whether a quantity can be set there.
struct Bearer {
  const material::Material* material = nullptr;  ///< of a body
  const shape::Contact* contact = nullptr;       ///< of a collider
  bool has_height = false;                       ///< the collider is a level ground
};

/// Where a quantity lies: in a scene (`read`, `write`), in how a body is placed (`placed`, `place`)
/// or in how a capture is looked at (`look`, `set_view`); the others are empty. Owners are given by
/// name: the scene has them, and body_index() throws where it has not.
struct Access {
  std::function<Components(const mpm::Scene&, const Address&)> read;
  /// All components at once.
  std::function<void(const Components&, const Address&, mpm::Scene&)> write;
  /// One component's derivative out of a gradient of that scene; empty: the adjoint does not know
  /// it.
  std::function<double(const mpm::Gradient&, const mpm::Scene&, const Address&)> slope;
  Components (*placed)(const Vec3d& origin) = nullptr;  ///< of a body as it was built
  /// Moves a body as it was built.
  void (*place)(const Components&, const Vec3d& origin, mpm::Body&) = nullptr;
  /// One component. Poses of cameras that the viewing lacks are those of their file, and are made
  /// where one is set.
  double (*look)(const Viewing&, const Address&) = nullptr;
  void (*set_view)(double, const Address&, Viewing&) = nullptr;
  /// Why it cannot be set at a bearer, of its kind of owner, a sentence; empty: it can. Null: it
  /// can, of a law's parameter where the law takes it.
  std::string (*obstacle)(const Address&, const Bearer&) = nullptr;
};

/// The start of a logarithmic search where the scene has 0: a share of the stiffness (Young's
/// modulus, of a fluid the bulk modulus), or a value.
struct UsualStart {
  double of_modulus = 0.0;
  double value = 0.1;  ///< used where `of_modulus` is 0
};

/// A row of the table.
struct Quantity {
  /// Keys below the owner, as in a document; `[#]` stands for Address::index.
  std::string path = {};
  Owner owner = Owner::kBody;
  int size = 1;                ///< components: 1 or 3
  std::string_view unit = {};  ///< SI; empty: a ratio
  Coordinate coordinate = Coordinate::kLog;
  double scale = 1.0;                ///< natural coordinate: a change that matters
  bool scale_is_separation = false;  ///< … is the scene's particle separation instead
  double low = 0.0;  ///< usual bounds; both 0: a factor of kUsualFactor either side of the start
  double high = 0.0;
  bool around = false;   ///< the usual bounds are about the start
  double largest = 0.0;  ///< that usual bounds may reach, as documents hold no more; 0: any
  UsualStart usual = {};
  double never = 0.0;  ///< values from here up mean that it does not happen, where a search that
                       ///< begins there would see nothing: it takes the usual start; 0: none do
  double prior_sigma = 0.2;   ///< of a prior to begin with: physical; of logarithms and logits a
                              ///< share of the value
  bool always_prior = false;  ///< fitted with a prior about its default even where none is given
  bool scanned = false;       ///< starts are looked for along it
  bool stiffness = false;     ///< what raises it makes substeps shorter
  /// Moves a camera, whose derivative drawing knows (Model::pull_back()).
  bool camera_slope = false;
  bool slope_of_updated = true;  ///< updated Lagrangian bodies feel it, if there is a slope at all
  std::string_view label = {};   ///< for a panel, without the unit
  std::string_view sentence = {};  ///< what it is, for a tooltip
  std::string_view words = {};     ///< in a sentence: "the stiffness"
  std::string_view record = {};    ///< completes "To see it, record …"
  /// A parameter of constitutive laws: where it stands in a material. Some laws take it
  /// (LawTraits::uses()), damping all.
  double material::Material::*member = nullptr;
  bool of_law = false;    ///< a law takes it or does not; else all do
  bool required = false;  ///< a material whose law takes it must say it
  Access access = {};

  [[nodiscard]] bool is_vector() const { return size > 1; }
  /// Moves the body itself, so that points must be bound to it anew.
  [[nodiscard]] bool places() const { return access.place != nullptr; }
  /// The last key: its name in a material.
  [[nodiscard]] std::string_view key() const;
  /// Part of a body's material.
  [[nodiscard]] bool is_material() const { return path.starts_with("material."); }
  [[nodiscard]] bool is_pose() const { return path.starts_with("poses"); }  ///< of a camera
  /// The name that LawTraits::uses() knows, of a parameter of laws; else empty.
  [[nodiscard]] std::string_view law_parameter() const {
    return of_law ? key() : std::string_view();
  }
  /// Its place in the table.
  [[nodiscard]] std::size_t row() const;
};

/// A bound is this factor off the start where a row has none.
inline constexpr double kUsualFactor = 1e4;

/// The table; rows stay where they are.
[[nodiscard]] const std::vector<Quantity>& quantities();

/// The row with that path and owner. Throws Error(kCompute) if there is none.
[[nodiscard]] const Quantity& row_named(Owner owner, std::string_view path);

/// Whether one of `addresses` is of that row and, unless `owner` is empty, of the owner of that
/// name.
[[nodiscard]] bool is_among(const Quantity& row, std::span<const Address> addresses,
                            std::string_view owner = {});

/// The list of a document in which owners of that kind stand: "bodies"; empty: the scene itself.
[[nodiscard]] std::string_view list_of(Owner owner);

/// Where a search begins whose material has nothing there.
[[nodiscard]] double usual_start(const Quantity& quantity, const material::Material& material);

/// Why a quantity cannot be set, a sentence; empty: it can.
[[nodiscard]] std::string obstacle(const Address& address, const Bearer& bearer);

/// The scene's owner of a quantity, or nothing where it has none (a gravity that changes with time
/// counts as none). Captures are no part of a scene.
[[nodiscard]] std::optional<Bearer> bearer(const mpm::Scene& scene, const Address& address);

/// Reads, and writes one component or all, of a scene. A body is placed from where it was built:
/// once, its rotation before its position. Throws Error(kInput) where the scene has no such owner.
[[nodiscard]] Components read(const mpm::Scene& scene, const Address& address,
                              const Origins& origins = {});
void write(double value, const Address& address, mpm::Scene& scene, const Origins& origins = {});
void write(const Components& values, const Address& address, mpm::Scene& scene,
           const Origins& origins = {});

/// Whether the derivative is known in that scene: not where the row has none, nor where no body is
/// of the formulation that feels it.
[[nodiscard]] bool has_slope(const Address& address, const mpm::Scene& scene);
/// The derivative by the address's component; has_slope().
[[nodiscard]] double slope(const mpm::Gradient& gradient, const mpm::Scene& scene,
                           const Address& address);

/// Turns a body about `pivot`, and then shifts it, with its lattice.
void place(mpm::Body& body, const Vec3d& pivot, const Vec3d& shift, const Quatd& turn);

/// Where the surface of a level ground lies, a plane at rest whose free side is above [m]; nothing
/// of any other shape.
[[nodiscard]] std::optional<double> ground_height(const shape::Collider& collider);

}  // namespace matterfit::fit
