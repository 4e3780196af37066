// SPDX-License-Identifier: GPL-3.0-or-later
#include "capture/particles.hpp"

#include <Eigen/LU>
#include <Eigen/SVD>
#include <cmath>

#include "base/error.hpp"

namespace matterfit::capture {
namespace {

template <class Value>
void check_column(const ParticleView& view, std::span<const Value> values, const char* what,
                  bool optional) {
  if (optional && values.empty()) return;
  if (values.size() != view.size()) {
    throw_input("body '" + view.name + "': " + std::to_string(values.size()) + " " + what +
                " for " + std::to_string(view.size()) + " particles.");
  }
  for (std::size_t i = 0; i < values.size(); ++i) {
    bool finite = true;
    if constexpr (std::is_same_v<Value, double>) {
      finite = std::isfinite(values[i]);
    } else {
      finite = values[i].allFinite();
    }
    if (!finite) {
      throw_compute("body '" + view.name + "', particle " + std::to_string(i) + ": its " + what +
                    " are not finite numbers, so nothing can be baked from this frame. Simulate "
                    "again with a smaller time step (solver.dt_safety).");
    }
  }
}

}  // namespace

void check(const ParticleView& view) {
  if (view.size() > 0 && !(view.separation > 0.0)) {
    throw_input("body '" + view.name + "': the particle separation is " +
                std::to_string(view.separation) + " m, expected more than 0.");
  }
  check_column(view, view.positions, "positions", false);
  check_column(view, view.velocities, "velocities", true);
  check_column(view, view.deformation_gradients, "deformation gradients", true);
  check_column(view, view.volumes, "rest volumes", false);
}

ParticleView particle_view(const mpm::Body& body, const mpm::BodyState& state, double separation) {
  ParticleView view;
  view.name = body.name;
  view.positions = state.positions;
  view.velocities = state.velocities;
  view.deformation_gradients = state.deformation_gradients;
  view.volumes = body.volumes;
  view.separation = separation;
  view.axes = body.lattice.axes;
  check(view);
  return view;
}

bool carries_shape(const mpm::Body& body) { return !body.material.traits().fluid; }

Stretch principal_stretches(const Mat3d& deformation_gradient) {
  const Eigen::JacobiSVD<Mat3d> svd(deformation_gradient,
                                    Eigen::ComputeFullU | Eigen::ComputeFullV);
  Stretch result{svd.matrixU(), svd.singularValues(), svd.matrixV()};
  if (result.axes.determinant() < 0.0) {
    result.axes.col(2) = -result.axes.col(2);
    result.stretches[2] = -result.stretches[2];
  }
  if (result.rest_axes.determinant() < 0.0) {
    result.rest_axes.col(2) = -result.rest_axes.col(2);
    result.stretches[2] = -result.stretches[2];
  }
  return result;
}

Mat3d polar_rotation(const Mat3d& deformation_gradient) {
  const Stretch stretch = principal_stretches(deformation_gradient);
  return stretch.axes * stretch.rest_axes.transpose();
}

Mat3d polar_rotation_adjoint(const Mat3d& deformation_gradient, const Vec3d& rotation_bar) {
  constexpr double kNoRotation = 1e-6;
  const Stretch stretch = principal_stretches(deformation_gradient);
  const Mat3d rotation = stretch.axes * stretch.rest_axes.transpose();
  // In the principal axes tr S I − S is diagonal.
  const Vec3d& s = stretch.stretches;
  const Vec3d sums(s[1] + s[2], s[2] + s[0], s[0] + s[1]);
  if (!(sums.cwiseAbs().minCoeff() > kNoRotation * s.cwiseAbs().maxCoeff())) return Mat3d::Zero();
  const Vec3d turn =
      stretch.rest_axes * (stretch.axes.transpose() * rotation_bar).cwiseQuotient(sums);
  Mat3d skew;
  skew << 0.0, -turn.z(), turn.y(), turn.z(), 0.0, -turn.x(), -turn.y(), turn.x(), 0.0;
  return rotation * skew;
}

}  // namespace matterfit::capture
