// SPDX-License-Identifier: GPL-3.0-or-later
// The image formation of rasteriser.hpp as one writes it down: in double, every Gaussian at every
// pixel. Gradients in the image's plane by the textbook's way, back to front; from there to the
// Gaussians by differences of the projection. Nothing of it is shared with the rasteriser.
#pragma once

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <numeric>
#include <vector>

#include "splat/rasteriser.hpp"

namespace matterfit::splat {

/// The parameters of one Gaussian: mean 3, log scales 3, quaternion 4, opacity 1, F 9 (row-major),
/// then its coefficients; and (ω, τ) of the camera.
inline constexpr int kShapeParameters = 20;
inline constexpr int kPoseParameters = 6;
/// Mean 2, Σ₂ (xx, xy, yy), opacity, colour 3 before it is cut off at 0, depth.
inline constexpr int kPlaneParameters = 10;
using PlaneVector = Eigen::Matrix<double, kPlaneParameters, 1>;

inline Eigen::VectorXd parameters_of(const Gaussians& g, std::size_t i) {
  const std::size_t coefficients = 3 * sh_bands(g.sh_degree);
  Eigen::VectorXd p(kShapeParameters + static_cast<Eigen::Index>(coefficients));
  p.segment<3>(0) = g.means[i].cast<double>();
  p.segment<3>(3) = g.log_scales[i].cast<double>();
  p.segment<4>(6) = g.rotations[i].cast<double>();
  p[10] = static_cast<double>(g.opacities[i]);
  Mat3d f = Mat3d::Identity();
  if (!g.deformation_gradients.empty()) f = g.deformation_gradients[i].cast<double>();
  for (int k = 0; k < 9; ++k) p[11 + k] = f(k / 3, k % 3);
  for (std::size_t k = 0; k < coefficients; ++k) {
    p[kShapeParameters + static_cast<Eigen::Index>(k)] =
        static_cast<double>(g.sh[i * coefficients + k]);
  }
  return p;
}

/// The sixteen harmonics by the definition: associated Legendre functions with their phase.
inline std::array<double, 16> reference_harmonics(const Vec3d& d) {
  std::array<double, 16> y{};
  const double r = std::hypot(d.x(), d.y());
  const double phi = std::atan2(d.y(), d.x());
  // P_l^m(z) with the Condon–Shortley phase; s = sin θ.
  const auto legendre = [&](int l, int m) {
    const double z = d.z();
    const double s = r;
    const std::array<std::array<double, 4>, 4> table = {
        {{1.0, 0.0, 0.0, 0.0},
         {z, -s, 0.0, 0.0},
         {0.5 * (3 * z * z - 1), -3 * z * s, 3 * s * s, 0.0},
         {0.5 * (5 * z * z * z - 3 * z), -1.5 * (5 * z * z - 1) * s, 15 * z * s * s,
          -15 * s * s * s}}};
    return table[static_cast<std::size_t>(l)][static_cast<std::size_t>(m)];
  };
  for (int l = 0; l <= 3; ++l) {
    for (int m = -l; m <= l; ++m) {
      const int n = std::abs(m);
      double ratio = 1.0;  // (l − n)!/(l + n)!
      for (int k = l - n + 1; k <= l + n; ++k) ratio /= k;
      double value =
          std::sqrt((2 * l + 1) / (4.0 * 3.14159265358979323846) * ratio) * legendre(l, n);
      if (m > 0) value *= std::sqrt(2.0) * std::cos(n * phi);
      if (m < 0) value *= std::sqrt(2.0) * std::sin(n * phi);
      y[static_cast<std::size_t>(l * l + l + m)] = value;
    }
  }
  return y;
}

inline Mat3d cross_matrix(const Vec3d& v) {
  Mat3d m;
  m << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
  return m;
}

/// The colour comes uncut: a difference across the kink at 0 would mean neither side's derivative.
inline PlaneVector reference_projection(const Eigen::VectorXd& p, int sh_degree,
                                        const Eigen::Matrix<double, 6, 1>& pose,
                                        const Camera& camera, const RenderOptions& options) {
  const Vec3d omega = pose.head<3>();
  const double angle = omega.norm();
  const Mat3d turn = angle > 0.0 ? Eigen::AngleAxisd(angle, omega / angle).toRotationMatrix()
                                 : Mat3d(Mat3d::Identity() + cross_matrix(omega));
  const Mat3d w = turn * camera.rotation;
  const Vec3d translation = turn * camera.translation + pose.tail<3>();
  const Vec3d mean = p.segment<3>(0);
  const Vec3d t = w * mean + translation;
  const Mat3d r = Eigen::Quaterniond(p[6], p[7], p[8], p[9]).normalized().toRotationMatrix();
  Mat3d f;
  for (int k = 0; k < 9; ++k) f(k / 3, k % 3) = p[11 + k];
  const Vec3d variances = (2.0 * p.segment<3>(3)).array().exp();
  const Mat3d covariance = f * r * variances.asDiagonal() * r.transpose() * f.transpose();
  const auto clamp = [](double ray, double focal, double centre, double size) {
    return std::clamp(ray, (-kClampMargin * size - centre) / focal,
                      ((1.0 + kClampMargin) * size - centre) / focal);
  };
  Eigen::Matrix<double, 2, 3> j;
  j << camera.fx / t.z(), 0.0,
      -camera.fx / t.z() * clamp(t.x() / t.z(), camera.fx, camera.cx, camera.width), 0.0,
      camera.fy / t.z(),
      -camera.fy / t.z() * clamp(t.y() / t.z(), camera.fy, camera.cy, camera.height);
  const Eigen::Matrix2d plane = j * w * covariance * w.transpose() * j.transpose() +
                                options.blur * Eigen::Matrix2d::Identity();
  const double sharpness =
      options.antialiased
          ? std::sqrt((plane - options.blur * Eigen::Matrix2d::Identity()).determinant() /
                      plane.determinant())
          : 1.0;
  const Vec3d centre = -(w.transpose() * translation);
  const auto y = reference_harmonics((mean - centre).normalized());
  PlaneVector out;
  out << camera.fx * t.x() / t.z() + camera.cx, camera.fy * t.y() / t.z() + camera.cy, plane(0, 0),
      plane(0, 1), plane(1, 1), p[10] * sharpness, 0.5, 0.5, 0.5, t.z();
  for (std::size_t band = 0; band < sh_bands(sh_degree); ++band) {
    for (int c = 0; c < 3; ++c) {
      out[6 + c] += p[kShapeParameters + static_cast<Eigen::Index>(3 * band) + c] * y[band];
    }
  }
  return out;
}

struct DenseImage {
  std::vector<double> colour;  ///< (3, pixels)
  std::vector<double> mask;
  std::vector<double> depth;
  /// How near a pixel comes to a decision (α ≥ 1/255, α < 0.99, T ≥ 1e-4), relative.
  std::vector<double> margin;
};

/// A scene, rendered in double.
class DenseReference {
 public:
  DenseReference(const Gaussians& g, const Camera& camera, const RenderOptions& options = {})
      : gaussians_(g), camera_(camera), options_(options) {
    for (std::size_t i = 0; i < g.size(); ++i) {
      plane_.push_back(reference_projection(parameters_of(g, i), g.sh_degree,
                                            Eigen::Matrix<double, 6, 1>::Zero(), camera, options));
      Eigen::Matrix2d covariance;
      covariance << plane_[i][2], plane_[i][3], plane_[i][3], plane_[i][4];
      conics_.emplace_back(covariance.inverse());
      if (plane_[i][9] > options.near_plane) order_.push_back(i);
    }
    std::stable_sort(order_.begin(), order_.end(), [&](std::size_t a, std::size_t b) {
      return static_cast<float>(plane_[a][9]) < static_cast<float>(plane_[b][9]);
    });
  }

  [[nodiscard]] DenseImage render() const {
    const std::size_t pixels = pixel_count();
    DenseImage image{std::vector<double>(3 * pixels), std::vector<double>(pixels),
                     std::vector<double>(pixels), std::vector<double>(pixels, 1.0)};
    for (std::size_t pixel = 0; pixel < pixels; ++pixel) {
      for (const Taken& taken : blend(pixel, image.margin[pixel])) {
        const PlaneVector& s = plane_[taken.index];
        const double weight = taken.transmittance * taken.alpha;
        for (std::size_t c = 0; c < 3; ++c) {
          image.colour[c * pixels + pixel] += weight * std::max(s[6 + static_cast<int>(c)], 0.0);
        }
        image.mask[pixel] += weight;
        image.depth[pixel] += weight * s[9];
      }
    }
    return image;
  }

  /// Derivatives in each Gaussian's parameters and, summed, in the pose.
  [[nodiscard]] std::vector<Eigen::VectorXd> gradients(const Image& loss,
                                                       Eigen::Matrix<double, 6, 1>& pose) const {
    std::vector<PlaneVector> plane(gaussians_.size(), PlaneVector::Zero());
    for (std::size_t pixel = 0; pixel < pixel_count(); ++pixel) backward(pixel, loss, plane);
    std::vector<Eigen::VectorXd> result;
    pose.setZero();
    for (std::size_t i = 0; i < gaussians_.size(); ++i) {
      Eigen::VectorXd all(parameters_of(gaussians_, i).size() + kPoseParameters);
      all << parameters_of(gaussians_, i), Eigen::Matrix<double, 6, 1>::Zero();
      Eigen::VectorXd slope = Eigen::VectorXd::Zero(all.size());
      if (!plane[i].isZero(0.0)) {
        for (Eigen::Index k = 0; k < all.size(); ++k) slope[k] = difference(all, k, plane[i]);
      }
      result.emplace_back(slope.head(slope.size() - kPoseParameters));
      pose += slope.tail<kPoseParameters>();
    }
    return result;
  }

 private:
  struct Taken {
    std::size_t index;
    double alpha;
    double transmittance;  ///< before it
    bool clamped;
    Eigen::Vector2d d;
    Eigen::Matrix2d conic;
  };

  [[nodiscard]] std::size_t pixel_count() const {
    return static_cast<std::size_t>(camera_.width) * static_cast<std::size_t>(camera_.height);
  }

  [[nodiscard]] std::vector<Taken> blend(std::size_t pixel, double& margin) const {
    std::vector<Taken> taken;
    const auto width = static_cast<std::size_t>(camera_.width);
    const Eigen::Vector2d centre(static_cast<double>(pixel % width) + 0.5,
                                 static_cast<double>(pixel / width) + 0.5);
    double transmittance = 1.0;
    for (const std::size_t i : order_) {
      const PlaneVector& s = plane_[i];
      const Eigen::Matrix2d& conic = conics_[i];
      const Eigen::Vector2d d = centre - s.head<2>();
      const double alpha = s[5] * std::exp(-0.5 * d.dot(conic * d));
      const auto near = [&](double value, double limit) {
        margin = std::min(margin, std::abs(value / limit - 1.0));
      };
      near(alpha, kSmallestAlpha);
      if (!(alpha >= kSmallestAlpha)) continue;
      near(transmittance, kSmallestTransmittance);
      if (!(transmittance >= kSmallestTransmittance)) break;
      near(alpha, kLargestAlpha);
      const double clamped = std::min(alpha, kLargestAlpha);
      taken.push_back({i, clamped, transmittance, alpha >= kLargestAlpha, d, conic});
      transmittance *= 1.0 - clamped;
    }
    return taken;
  }

  void backward(std::size_t pixel, const Image& loss, std::vector<PlaneVector>& plane) const {
    double ignored = 1.0;
    const std::vector<Taken> all = blend(pixel, ignored);
    const std::size_t pixels = pixel_count();
    double behind = 0.0;  // what lies behind, as if nothing stood before it, times dL
    for (auto it = all.rbegin(); it != all.rend(); ++it) {
      const PlaneVector& s = plane_[it->index];
      PlaneVector& bar = plane[it->index];
      const double weight = it->transmittance * it->alpha;
      double own =
          static_cast<double>(loss.mask[pixel]) + static_cast<double>(loss.depth[pixel]) * s[9];
      for (std::size_t c = 0; c < 3; ++c) {
        const auto slope = static_cast<double>(loss.colour[c * pixels + pixel]);
        const double uncut = s[6 + static_cast<int>(c)];
        if (uncut < 0.0) continue;
        own += slope * uncut;
        bar[6 + static_cast<int>(c)] += weight * slope;
      }
      bar[9] += weight * static_cast<double>(loss.depth[pixel]);
      const double alpha_bar = it->transmittance * (own - behind);
      behind = it->alpha * own + (1.0 - it->alpha) * behind;
      if (it->clamped) continue;
      bar[5] += alpha_bar * it->alpha / s[5];
      const Eigen::Vector2d pull = it->conic * it->d;
      bar.head<2>() += alpha_bar * it->alpha * pull;
      // α's derivative in the matrix Σ₂ is α/2 Σ₂⁻¹d (Σ₂⁻¹d)ᵀ; both corners move with xy.
      bar[2] += 0.5 * alpha_bar * it->alpha * pull.x() * pull.x();
      bar[3] += alpha_bar * it->alpha * pull.x() * pull.y();
      bar[4] += 0.5 * alpha_bar * it->alpha * pull.y() * pull.y();
    }
  }

  /// Fourth-order central difference of bar · projection in parameter k.
  [[nodiscard]] double difference(const Eigen::VectorXd& at, Eigen::Index k,
                                  const PlaneVector& bar) const {
    constexpr double kStep = 1e-3;
    const auto value = [&](double step) {
      Eigen::VectorXd moved = at;
      moved[k] += step;
      const Eigen::Matrix<double, 6, 1> pose = moved.tail<6>();
      return bar.dot(reference_projection(moved.head(at.size() - kPoseParameters),
                                          gaussians_.sh_degree, pose, camera_, options_));
    };
    return (8.0 * (value(kStep) - value(-kStep)) - (value(2 * kStep) - value(-2 * kStep))) /
           (12.0 * kStep);
  }

  const Gaussians& gaussians_;
  Camera camera_;
  RenderOptions options_;
  std::vector<PlaneVector> plane_;
  std::vector<Eigen::Matrix2d> conics_;
  std::vector<std::size_t> order_;
};

}  // namespace matterfit::splat
