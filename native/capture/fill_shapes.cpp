// SPDX-License-Identifier: GPL-3.0-or-later
#include <fmt/format.h>

#include <cmath>
#include <numbers>

#include "base/error.hpp"
#include "capture/fill_lattice.hpp"

namespace matterfit::capture {
namespace {

/// Signed distance and normal of a box around the origin in any number of dimensions.
template <int Dimensions>
double box_distance(const Eigen::Matrix<double, Dimensions, 1>& x,
                    const Eigen::Matrix<double, Dimensions, 1>& half,
                    Eigen::Matrix<double, Dimensions, 1>& normal) {
  const Eigen::Matrix<double, Dimensions, 1> beyond = x.cwiseAbs() - half;
  normal.setZero();
  Eigen::Index axis = 0;
  if (const double depth = beyond.maxCoeff(&axis); depth <= 0) {
    normal[axis] = std::copysign(1.0, x[axis]);
    return depth;
  }
  normal = x - x.cwiseMax(-half).cwiseMin(half);
  const double distance = normal.stableNorm();
  normal /= distance;
  return distance;
}

class BoxShape final : public FillShape {
 public:
  BoxShape(const Vec3d& low, const Vec3d& high)
      : centre_(0.5 * (low + high)), half_(0.5 * (high - low)) {}
  [[nodiscard]] Surface at(const Vec3d& x) const override {
    Surface surface;
    surface.distance = box_distance<3>(x - centre_, half_, surface.normal);
    return surface;
  }
  [[nodiscard]] Eigen::AlignedBox3d box(const Quatd& axes) const override {
    const Vec3d reach = axes.conjugate().toRotationMatrix().cwiseAbs() * half_;
    const Vec3d middle = axes.conjugate() * centre_;
    return {middle - reach, middle + reach};
  }
  [[nodiscard]] std::optional<double> volume() const override { return 8.0 * half_.prod(); }

 private:
  Vec3d centre_, half_;
};

class SphereShape final : public FillShape {
 public:
  SphereShape(const Vec3d& centre, double radius) : centre_(centre), radius_(radius) {}
  [[nodiscard]] Surface at(const Vec3d& x) const override {
    const Vec3d out = x - centre_;
    const double r = out.norm();
    return {r - radius_, r > 0 ? Vec3d(out / r) : Vec3d(Vec3d::UnitZ())};
  }
  [[nodiscard]] Eigen::AlignedBox3d box(const Quatd& axes) const override {
    const Vec3d middle = axes.conjugate() * centre_;
    return {middle - Vec3d::Constant(radius_), middle + Vec3d::Constant(radius_)};
  }
  [[nodiscard]] std::optional<double> volume() const override {
    return 4.0 / 3.0 * std::numbers::pi * radius_ * radius_ * radius_;
  }

 private:
  Vec3d centre_;
  double radius_;
};

class CylinderShape final : public FillShape {
 public:
  CylinderShape(const Vec3d& centre, double radius, double height, const Vec3d& axis)
      : centre_(centre), axis_(axis.stableNormalized()), half_(radius, 0.5 * height) {}
  [[nodiscard]] Surface at(const Vec3d& x) const override {
    const Vec3d out = x - centre_;
    const double along = out.dot(axis_);
    const Vec3d aside = out - along * axis_;
    const double r = aside.norm();
    const Vec3d radial = r > 0 ? Vec3d(aside / r) : Vec3d(axis_.unitOrthogonal());
    Eigen::Vector2d normal;
    Surface surface;
    surface.distance = box_distance<2>(Eigen::Vector2d(r, along), half_, normal);
    surface.normal = normal.x() * radial + normal.y() * axis_;
    return surface;
  }
  [[nodiscard]] Eigen::AlignedBox3d box(const Quatd& axes) const override {
    const Vec3d a = axes.conjugate() * axis_;
    const Vec3d middle = axes.conjugate() * centre_;
    const Vec3d reach = half_.y() * a.cwiseAbs() +
                        half_.x() * (Vec3d::Ones() - a.cwiseAbs2()).cwiseMax(0.0).cwiseSqrt();
    return {middle - reach, middle + reach};
  }
  [[nodiscard]] std::optional<double> volume() const override {
    return 2.0 * std::numbers::pi * half_.x() * half_.x() * half_.y();
  }

 private:
  Vec3d centre_, axis_;
  Eigen::Vector2d half_;
};

void require(bool condition, const std::string& message) {
  if (!condition) throw_input(message);
}

}  // namespace

FilledBody fill_box(const Vec3d& low, const Vec3d& high, const FillOptions& options) {
  require(low.allFinite() && high.allFinite() && (high - low).minCoeff() > 0,
          fmt::format(
              "box: low ({:g}, {:g}, {:g}) must lie below high ({:g}, {:g}, {:g}) on every axis.",
              low.x(), low.y(), low.z(), high.x(), high.y(), high.z()));
  return fill_lattice(BoxShape(low, high), options, "");
}

FilledBody fill_sphere(const Vec3d& centre, double radius, const FillOptions& options) {
  require(centre.allFinite() && std::isfinite(radius) && radius > 0,
          fmt::format("sphere: radius is {:g} m, expected a finite length above 0.", radius));
  return fill_lattice(SphereShape(centre, radius), options, "");
}

FilledBody fill_cylinder(const Vec3d& centre, double radius, double height, const Vec3d& axis,
                         const FillOptions& options) {
  require(centre.allFinite() && std::isfinite(radius) && radius > 0 && std::isfinite(height) &&
              height > 0,
          fmt::format("cylinder: radius {:g} m and height {:g} m must be finite and above 0.",
                      radius, height));
  require(axis.allFinite() && axis.norm() > 0, "cylinder: the axis must not be zero.");
  return fill_lattice(CylinderShape(centre, radius, height, axis), options, "");
}

}  // namespace matterfit::capture
