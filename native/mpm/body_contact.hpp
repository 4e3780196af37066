// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "base/parallel.hpp"
#include "mpm/contact_law.hpp"
#include "mpm/particle_bodies.hpp"
#include "mpm/scene.hpp"
#include "mpm/state_bytes.hpp"
#include "mpm/total_body.hpp"

namespace matterfit::mpm {

/// Contact between bodies of which at least one is total Lagrangian, by particle distances. A
/// particle sees the other body's skin as a smooth surface,
///   d(x) = Σ w_b [(x − x_b)·n_b − r_b] / Σ w_b,  n = Σ w_b n_b / |Σ w_b n_b|,
/// with the skin's present normals n_b = F⁻ᵀN and a compact weight w of the distance; force and
/// reaction are equal and opposite, the reaction shared by the same weights. Between two total
/// Lagrangian bodies both look at each other, each with half the stiffness.
/// Limits: skins thinner than two particles, and particles deeper than a cell, are not resolved.
class BodyContacts {
 public:
  struct Member {
    std::size_t index;  ///< into scene.bodies
    TotalBody<float>* body;
  };
  /// `particles`: the bodies, of the indices `without_skin`, that are none of `total`; or null.
  BodyContacts(const Scene& scene, const std::vector<Member>& total,
               ParticleBodies<float>* particles, const std::vector<std::size_t>& without_skin);

  [[nodiscard]] bool any() const { return !pairs_.empty(); }
  void wake();
  /// Adds forces to all of them, at `time` over `dt`. `acceleration`:
  /// of gravity; `frame_seconds`: the longest a pair may sleep.
  void apply(Arena& arena, double time, double dt, double acceleration, double frame_seconds);
  /// Highest k/(ρ h) of any particle on its contact spring [1/s²].
  [[nodiscard]] double frequency_squared() const { return frequency_squared_; }

  void save(ByteWriter& out) const;
  void load(ByteReader& in);

 private:
  /// Skin of a total body: the outer faces of its outermost particles.
  struct Skin {
    std::size_t index;
    TotalBody<float>* body;
    double density;
    double edge;      ///< typical particle edge at rest [m]
    double response;  ///< TotalGrid::contact_response [m²/kg]
    std::vector<std::uint32_t> particles;
    std::vector<Vec3d> rest_normals;
    std::vector<Vec3d> offsets;  ///< of the face from its particle at rest, world axes [m]
    std::vector<Vec3d> positions, velocities, normals;  ///< of the faces, now
    Vec3d low = Vec3d::Zero();
    Vec3d high = Vec3d::Zero();
    double speed = 0.0;
    double at = -1e300;  ///< time of the state above
  };
  struct Pair {
    std::size_t surface;  ///< skin that is seen as a surface
    std::size_t skin;     ///< skin whose particles look, or kWithoutSkin
    std::size_t looking;  ///< body index of the one that looks
    ContactLaw law;
    double wake = -1e300;
    std::vector<ContactMemory> memory;  ///< per looking particle
  };
  struct Surface;
  static constexpr std::size_t kWithoutSkin = static_cast<std::size_t>(-1);

  void refresh(Arena& arena, Skin& skin, double time, bool with_normals);
  /// On the face of its particle i.
  static void add_load(const Skin& skin, std::size_t i, const Vec3d& force);

  ParticleBodies<float>* particles_;
  std::vector<Skin> skins_;
  std::vector<Pair> pairs_;
  double frequency_squared_ = 0.0;
};

}  // namespace matterfit::mpm
