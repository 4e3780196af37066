// SPDX-License-Identifier: GPL-3.0-or-later
#include "shape/collider.hpp"

#include <cmath>
#include <limits>

#include "base/error.hpp"
#include "shape/rigid_motion.hpp"

namespace matterfit::shape {
namespace {

void require_positive(const std::string& name, const char* what, double value) {
  if (!(value > 0.0) || !std::isfinite(value)) {
    throw_input("Collider '" + name + "': " + what + " is " + std::to_string(value) +
                " m, expected a finite length above 0.");
  }
}

/// Distance and outward normal in the shape's own frame.
struct LocalSurface {
  double distance;
  Vec3d normal;
};

struct PlaneShape {
  Vec3d point, normal;
  [[nodiscard]] LocalSurface at(const Vec3d& x) const { return {normal.dot(x - point), normal}; }
};

struct SphereShape {
  double radius;
  [[nodiscard]] LocalSurface at(const Vec3d& x) const {
    const double r = x.norm();
    // At the very centre every direction is as near; any unit vector is a valid normal.
    return {r - radius, r > 0.0 ? Vec3d(x / r) : Vec3d(Vec3d::UnitZ())};
  }
};

struct BoxShape {
  Vec3d half;
  [[nodiscard]] LocalSurface at(const Vec3d& x) const {
    const Vec3d beyond = x.cwiseAbs() - half;
    if (beyond.maxCoeff() <= 0.0) {
      Eigen::Index axis = 0;
      const double distance = beyond.maxCoeff(&axis);
      Vec3d normal = Vec3d::Zero();
      normal[axis] = std::copysign(1.0, x[axis]);
      return {distance, normal};
    }
    const Vec3d out = x - x.cwiseMax(-half).cwiseMin(half);
    const double distance = out.stableNorm();
    return {distance, out / distance};
  }
};

struct CapsuleShape {
  double radius, half_length;
  [[nodiscard]] LocalSurface at(const Vec3d& x) const {
    const Vec3d out = x - Vec3d(0, 0, std::fmax(-half_length, std::fmin(half_length, x.z())));
    const double r = out.norm();
    return {r - radius, r > 0.0 ? Vec3d(out / r) : Vec3d(Vec3d::UnitX())};
  }
};

template <class Shape>
class RigidCollider final : public Collider {
 public:
  RigidCollider(std::string name, Contact contact, Shape shape, Keyed<Pose> pose)
      : Collider(std::move(name), contact),
        shape_(shape),
        motion_("Collider '" + this->name() + "'", std::move(pose)) {}

  [[nodiscard]] SurfacePoint closest(const Vec3d& position, double time) const override {
    const RigidState state = motion_.at(time);
    const LocalSurface surface = shape_.at(state.to_local(position));
    SurfacePoint result;
    result.distance = surface.distance;
    result.normal = state.rotation * surface.normal;
    result.velocity = state.velocity_at(position - result.distance * result.normal);
    return result;
  }
  [[nodiscard]] double band() const override { return std::numeric_limits<double>::infinity(); }
  [[nodiscard]] bool animated() const override { return motion_.animated(); }

 private:
  Shape shape_;
  RigidMotion motion_;
};

template <class Shape>
ColliderPtr make_rigid(std::string name, Contact contact, Shape shape, Keyed<Pose> pose) {
  return std::make_shared<RigidCollider<Shape>>(std::move(name), contact, shape, std::move(pose));
}

}  // namespace

ColliderPtr make_plane(std::string name, Contact contact, const Vec3d& point, const Vec3d& normal,
                       Keyed<Pose> pose) {
  if (!point.allFinite() || !normal.allFinite() || !(normal.norm() > 0.0)) {
    throw_input("Collider '" + name +
                "': a plane needs a finite point and a normal that is not zero.");
  }
  return make_rigid(std::move(name), contact, PlaneShape{point, normal.stableNormalized()},
                    std::move(pose));
}

ColliderPtr make_sphere(std::string name, Contact contact, double radius, Keyed<Pose> pose) {
  require_positive(name, "radius", radius);
  return make_rigid(std::move(name), contact, SphereShape{radius}, std::move(pose));
}

ColliderPtr make_box(std::string name, Contact contact, const Vec3d& half_extents,
                     Keyed<Pose> pose) {
  for (int axis = 0; axis < 3; ++axis) require_positive(name, "half extent", half_extents[axis]);
  return make_rigid(std::move(name), contact, BoxShape{half_extents}, std::move(pose));
}

ColliderPtr make_capsule(std::string name, Contact contact, double radius, double half_length,
                         Keyed<Pose> pose) {
  require_positive(name, "radius", radius);
  require_positive(name, "half length", half_length);
  return make_rigid(std::move(name), contact, CapsuleShape{radius, half_length}, std::move(pose));
}

}  // namespace matterfit::shape
