// SPDX-License-Identifier: GPL-3.0-or-later
#include "capture/lens.hpp"

#include <fmt/format.h>

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "base/error.hpp"

namespace matterfit::capture {
namespace {

using Eigen::Matrix2d;
using Eigen::Vector2d;

constexpr int kMostSteps = 60;
constexpr int kMostHalvings = 30;
constexpr double kExact = 1e-14;
constexpr double kConverged = 1e-10;
/// How finely a fold is looked for.
constexpr int kAlongRay = 64;
constexpr int kAround = 64;
constexpr int kAlongEdge = 256;

/// Whether the model does not fold over between the axis and a place.
bool unfolded(const Distortion& lens, const Vector2d& ideal) {
  for (int i = 1; i <= kAlongRay; ++i) {
    const Vector2d at = (double(i) / kAlongRay) * ideal;
    if (!(distortion_slope(lens, at).determinant() > 0.0)) return false;
  }
  return true;
}

Vector2d direction_of(const splat::Camera& camera, double u, double v) {
  return {(u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy};
}

/// The distance from the axis of the image's farthest corner, on the plane z = 1.
double farthest_corner(const splat::Camera& camera) {
  double radius = 0.0;
  for (const double u : {0.0, double(camera.width)}) {
    for (const double v : {0.0, double(camera.height)}) {
      radius = std::max(radius, direction_of(camera, u, v).norm());
    }
  }
  return radius;
}

}  // namespace

Vector2d distorted(const Distortion& lens, const Vector2d& ideal) {
  const double x = ideal.x();
  const double y = ideal.y();
  const double r2 = x * x + y * y;
  const double c = 1.0 + r2 * (lens.k1 + r2 * (lens.k2 + r2 * lens.k3));
  return {c * x + 2.0 * lens.p1 * x * y + lens.p2 * (r2 + 2.0 * x * x),
          c * y + lens.p1 * (r2 + 2.0 * y * y) + 2.0 * lens.p2 * x * y};
}

Matrix2d distortion_slope(const Distortion& lens, const Vector2d& ideal) {
  const double x = ideal.x();
  const double y = ideal.y();
  const double r2 = x * x + y * y;
  const double c = 1.0 + r2 * (lens.k1 + r2 * (lens.k2 + r2 * lens.k3));
  const double dc = 2.0 * (lens.k1 + r2 * (2.0 * lens.k2 + r2 * 3.0 * lens.k3));  // ∂c/∂x = x dc
  const double mixed = x * y * dc + 2.0 * lens.p1 * x + 2.0 * lens.p2 * y;
  Matrix2d slope;
  slope << c + x * x * dc + 2.0 * lens.p1 * y + 6.0 * lens.p2 * x, mixed, mixed,
      c + y * y * dc + 6.0 * lens.p1 * y + 2.0 * lens.p2 * x;
  return slope;
}

std::optional<Vector2d> undistorted(const Distortion& lens, const Vector2d& seen) {
  Vector2d at = Vector2d::Zero();
  Vector2d missing = seen;
  const double size = std::max(1.0, seen.norm());
  for (int step = 0; step < kMostSteps && missing.norm() > kExact * size; ++step) {
    const Matrix2d slope = distortion_slope(lens, at);
    if (!(slope.determinant() > 0.0)) return std::nullopt;
    const Vector2d whole = slope.inverse() * missing;
    // A step that overshoots is halved until it leads nearer.
    double share = 1.0;
    int halvings = 0;
    for (; halvings < kMostHalvings; ++halvings, share *= 0.5) {
      const Vector2d next = at + share * whole;
      const Vector2d left = seen - distorted(lens, next);
      if (!(left.norm() < missing.norm())) continue;
      at = next;
      missing = left;
      break;
    }
    if (halvings == kMostHalvings) break;  // as near as doubles come, or at a fold
  }
  if (!(missing.norm() <= kConverged * size) || !unfolded(lens, at)) return std::nullopt;
  return at;
}

void check_distortion(const Distortion& lens, const splat::Camera& camera,
                      const std::string& where) {
  if (lens.none()) return;
  for (const double k : {lens.k1, lens.k2, lens.k3, lens.p1, lens.p2}) {
    if (!std::isfinite(k)) throw_input(where + " has a lens distortion that is not finite.");
  }
  for (int i = 0; i < kAlongEdge; ++i) {
    const double s = double(i) / kAlongEdge;
    const double w = camera.width;
    const double h = camera.height;
    for (const Vector2d& pixel : {Vector2d(s * w, 0.0), Vector2d(w, s * h),
                                  Vector2d((1.0 - s) * w, h), Vector2d(0.0, (1.0 - s) * h)}) {
      if (undistorted(lens, direction_of(camera, pixel.x(), pixel.y()))) continue;
      throw_input(fmt::format(
          "{} has a lens distortion (k1 = {:g}, k2 = {:g}, k3 = {:g}, p1 = {:g}, p2 = {:g}) that "
          "folds over inside the image: nothing is seen at pixel ({:.0f}, {:.0f}). Are these "
          "numbers those of this lens and image size? Calibrate again, with fewer coefficients.",
          where, lens.k1, lens.k2, lens.k3, lens.p1, lens.p2, pixel.x(), pixel.y()));
    }
  }
}

Undistortion::Undistortion(const splat::Camera& camera, const Distortion& lens)
    : camera_(camera), lens_(lens) {
  const double radius = farthest_corner(camera_);
  for (int i = 0; i < kAround && !folds_; ++i) {
    const double angle = 2.0 * std::numbers::pi * i / kAround;
    folds_ = !unfolded(lens_, radius * Vector2d(std::cos(angle), std::sin(angle)));
  }
}

std::optional<Vector2d> Undistortion::source(int column, int row) const {
  const Vector2d ideal = direction_of(camera_, column + 0.5, row + 0.5);
  if (folds_ && !unfolded(lens_, ideal)) return std::nullopt;
  const Vector2d seen = distorted(lens_, ideal);
  const Vector2d pixel(camera_.fx * seen.x() + camera_.cx, camera_.fy * seen.y() + camera_.cy);
  if (!(pixel.x() >= 0.0 && pixel.y() >= 0.0 && pixel.x() <= camera_.width &&
        pixel.y() <= camera_.height)) {
    return std::nullopt;
  }
  return pixel;
}

std::vector<std::uint8_t> Undistortion::seen() const {
  std::vector<std::uint8_t> result;
  result.reserve(std::size_t(camera_.width) * std::size_t(camera_.height));
  for (int row = 0; row < camera_.height; ++row) {
    for (int column = 0; column < camera_.width; ++column) {
      result.push_back(source(column, row) ? 255 : 0);
    }
  }
  return result;
}

std::vector<std::uint8_t> Undistortion::resampled(std::span<const std::uint8_t> image) const {
  std::vector<std::uint8_t> result;
  result.reserve(image.size());
  const auto at = [&](int x, int y) {
    return double(image[std::size_t(y) * std::size_t(camera_.width) + std::size_t(x)]);
  };
  for (int row = 0; row < camera_.height; ++row) {
    for (int column = 0; column < camera_.width; ++column) {
      const std::optional<Vector2d> pixel = source(column, row);
      if (!pixel) {
        result.push_back(0);
        continue;
      }
      // Values stand at the centres of pixels; beyond the outermost ones theirs hold.
      const double x = std::clamp(pixel->x() - 0.5, 0.0, camera_.width - 1.0);
      const double y = std::clamp(pixel->y() - 0.5, 0.0, camera_.height - 1.0);
      const int x0 = static_cast<int>(x);
      const int y0 = static_cast<int>(y);
      const int x1 = std::min(x0 + 1, camera_.width - 1);
      const int y1 = std::min(y0 + 1, camera_.height - 1);
      const double s = x - x0;
      const double t = y - y0;
      const double value = (1.0 - t) * ((1.0 - s) * at(x0, y0) + s * at(x1, y0)) +
                           t * ((1.0 - s) * at(x0, y1) + s * at(x1, y1));
      result.push_back(static_cast<std::uint8_t>(std::lround(value)));
    }
  }
  return result;
}

double Undistortion::farthest() const {
  double most = 0.0;
  for (int i = 0; i <= kAlongEdge; ++i) {
    const double s = double(i) / kAlongEdge;
    for (const Vector2d& pixel :
         {Vector2d(s * camera_.width, 0.0), Vector2d(s * camera_.width, camera_.height),
          Vector2d(0.0, s * camera_.height), Vector2d(camera_.width, s * camera_.height)}) {
      const Vector2d seen = direction_of(camera_, pixel.x(), pixel.y());
      const std::optional<Vector2d> ideal = undistorted(lens_, seen);
      if (!ideal) continue;
      const Vector2d by = *ideal - seen;
      most = std::max(most, std::hypot(camera_.fx * by.x(), camera_.fy * by.y()));
    }
  }
  return most;
}

}  // namespace matterfit::capture
