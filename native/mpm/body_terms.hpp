// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <memory>
#include <optional>
#include <vector>

#include "effects/term.hpp"
#include "material/correction.hpp"
#include "mpm/scene.hpp"

namespace matterfit::mpm {

/// What terms give back, summed over material points and substeps.
struct TermCotangents {
  std::vector<double> values;       ///< BodyTerms::values()
  double log_density = 0.0;         ///< ∂/∂ln ρ, through the points' masses
  Vec3d position = Vec3d::Zero();   ///< of the points' present positions, all together
  Vec3d rest = Vec3d::Zero();       ///< of their places at rest, all together
  Vec3d rest_turn = Vec3d::Zero();  ///< Σ X × X̄
  Vec3d turn = Vec3d::Zero();  ///< Σ x × x̄ + v × v̄ − f × f̄, world axes about the origin
  Vec3d gravity = Vec3d::Zero();
  double added_density = 0.0;  ///< by the inertia that effects add, through the points' masses

  TermCotangents& operator+=(const TermCotangents& other);
};

/// Adds to the bodies' densities what the scene's effects add to their inertia
/// (EffectType::added_density). Call once, before anything looks at a density.
void add_inertia(Scene& scene);

/// The scene's effects that act on one of its bodies as terms, and the correction beside the law of
/// its material, on plain material points: every formulation calls them here. Effects whose numbers
/// are neutral, and a correction of zeros, are not called on the way forward; they have derivatives
/// all the same.
class BodyTerms {
 public:
  /// `scene`, with the inertia that effects add, must outlive it and keep its effects.
  BodyTerms(const Scene& scene, const Body& body);

  /// No effect of the scene names this body, neutral ones included, and its material has no
  /// correction.
  [[nodiscard]] bool empty() const { return terms_.empty() && !correction_; }
  /// Some of it is not neutral.
  [[nodiscard]] bool act() const { return act_; }
  /// How many numbers all its effects and the correction have.
  [[nodiscard]] std::size_t values() const { return values_; }
  /// A material point of the body: a share `volume` [m³] of it.
  [[nodiscard]] effects::MaterialPoint point(std::uint32_t particle, double volume) const;

  /// Some effect has a stress: points need their deformation gradients.
  [[nodiscard]] bool stress() const { return stress_; }
  /// Σ of the forces [N].
  [[nodiscard]] Vec3d force(const effects::MaterialPoint& point,
                            const effects::Moment& moment) const;
  /// Σ of the Kirchhoff stresses [Pa].
  [[nodiscard]] Mat3d stress(const effects::MaterialPoint& point,
                             const effects::Moment& moment) const;
  /// Their adjoints, of neutral effects too. Adds to `bar`, and to the sums.
  void adjoint(const effects::MaterialPoint& point, const effects::Moment& moment,
               const Vec3d& force_bar, const Mat3d& stress_bar, effects::MaterialPointBar& bar,
               TermCotangents& sums) const;
  [[nodiscard]] TermCotangents zero() const;
  /// Adds to the derivatives by the scene's effects, per effect, Effect::values, and by the body's
  /// material. `density_bar`: of the run by the body's density, with the inertia that effects add.
  void add_to(const TermCotangents& sums, double density_bar,
              std::vector<std::vector<double>>& effects,
              material::MaterialGradient& material) const;

  /// The largest acceleration [m/s²] that they give to what moves at `speed` [m/s].
  [[nodiscard]] double acceleration_bound(double speed) const;
  /// At most how fast they take speed from what moves at `speed` [m/s] [1/s].
  [[nodiscard]] double rate_bound(double speed) const;
  /// Throws Error(kInput) where a substep that the scene gives is longer than 1 over rate_bound().
  void check_step(double speed) const;
  /// What they add to the body's modulus λ + 2μ at most [Pa].
  [[nodiscard]] double modulus_bound() const;

 private:
  struct Entry {
    std::size_t effect;  ///< into scene.effects
    std::size_t first;   ///< into TermCotangents::values
    bool neutral;
    std::unique_ptr<effects::Term> term;
  };
  const Scene& scene_;
  const Body& body_;
  double added_density_ = 0.0;  ///< of body_.density, what is none of the body's own [kg/m³]
  std::vector<Entry> terms_;
  std::optional<material::Correction> correction_;  ///< its numbers come last in `values`
  std::size_t values_ = 0;
  bool act_ = false;
  bool stress_ = false;
};

}  // namespace matterfit::mpm
