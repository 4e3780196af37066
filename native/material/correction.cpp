// SPDX-License-Identifier: GPL-3.0-or-later
#include "material/correction.hpp"

#include <fmt/format.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

#include "base/error.hpp"
#include "material/neural/isotropic_weights.hpp"
#include "material/neural/latent.hpp"

namespace matterfit::material {
namespace {

/// Strains from which the terms of the shape act.
constexpr std::array<double, 3> kShapeScales = {0.15, 0.4, 1.0};
constexpr std::size_t kAsymmetry = 3;
constexpr double kAsymmetryScale = 0.4;
constexpr std::size_t kVolume = 4;
constexpr double kVolumeScale = 0.15;
/// The largest curvature of φ(|x|²) and of k/√(s + a²), either way, by that of |x|² and of s. The
/// first is 5/4, at |x| = a; the second was found on a grid of strains.
constexpr double kRampCurvature = 1.25;
constexpr double kAsymmetryCurvature = 1.43;
/// The largest share of a stiffness that may be taken away.
constexpr double kMostSoftening = 0.9;
constexpr double kLargestNumber = 50.0;
/// Below this a squared stretch counts as this, so that a crushed point has a finite stress.
constexpr double kLeastSquare = 1e-12;

/// φ(x) = x²/(x + a²) and its derivatives.
struct Ramp {
  double value;
  double first;
  double second;

  Ramp(double x, double a) {
    const double square = a * a;
    const double over = x / (x + square);
    const double left = square / (x + square);
    value = x * over;
    first = over * (1.0 + left);
    second = 2.0 * left * left / (x + square);
  }
};

/// H of F, with what its adjoint needs.
struct Hencky {
  Vec3d squares;  ///< of the stretches
  Mat3d axes;
  Vec3d logs;  ///< principal strains
  double t;
  Vec3d dev;
  double s;
  double k;
  double root;     ///< √(s + a²) of the asymmetry
  Vec3d dev_cube;  ///< ∂k/∂H = 3 dev (dev H)²

  explicit Hencky(const Mat3d& f) {
    const Eigen::SelfAdjointEigenSolver<Mat3d> solver(f * f.transpose());
    squares = solver.eigenvalues().cwiseMax(kLeastSquare);
    axes = solver.eigenvectors();
    logs = 0.5 * squares.array().log();
    t = logs.sum();
    dev = logs.array() - t / 3.0;
    s = dev.squaredNorm();
    k = dev.array().cube().sum();
    root = std::sqrt(s + kAsymmetryScale * kAsymmetryScale);
    dev_cube = 3.0 * (dev.array().square() - s / 3.0);
  }
};

/// Principal stresses of each number where it is 1, in units of its modulus.
std::array<Vec3d, kCorrectionSize> principal_stresses(const Hencky& at) {
  std::array<Vec3d, kCorrectionSize> tau;
  for (std::size_t i = 0; i < kShapeScales.size(); ++i) {
    tau[i] = 2.0 * Ramp(at.s, kShapeScales[i]).first * at.dev;
  }
  tau[kAsymmetry] = at.dev_cube / at.root - at.k / (at.root * at.root * at.root) * at.dev;
  tau[kVolume] = Vec3d::Constant(Ramp(at.t * at.t, kVolumeScale).first * at.t);
  return tau;
}

/// log1p(x)/x.
double log1p_over(double x) { return x == 0.0 ? 1.0 : std::log1p(x) / x; }

/// The cotangent of b = F Fᵀ from that of H in principal axes, by the divided differences of ½ ln.
Mat3d of_square(const Hencky& at, const Mat3d& strain_bar) {
  Mat3d bar = strain_bar;
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) {
      const double low = std::min(at.squares[i], at.squares[j]);
      bar(i, j) *= 0.5 / low * log1p_over(std::abs(at.squares[i] - at.squares[j]) / low);
    }
  }
  return bar;
}

}  // namespace

Correction::Correction(const Material& material) {
  if (material.traits().fluid) {
    bulk_ = material.bulk_modulus;
  } else {
    shear_ = material.youngs_modulus / (2.0 * (1.0 + material.poisson_ratio));
    bulk_ = material.youngs_modulus / (3.0 * (1.0 - 2.0 * material.poisson_ratio));
  }
  std::copy_n(material.correction.begin(), std::min(kCorrectionSize, material.correction.size()),
              numbers_.begin());
}

bool Correction::neutral() const {
  return std::all_of(numbers_.begin(), numbers_.end(), [](double c) { return c == 0.0; });
}

double Correction::energy(const Mat3d& f) const {
  const Hencky at(f);
  double shape = numbers_[kAsymmetry] * at.k / at.root;
  for (std::size_t i = 0; i < kShapeScales.size(); ++i) {
    shape += numbers_[i] * Ramp(at.s, kShapeScales[i]).value;
  }
  return shear_ * shape + 0.5 * bulk_ * numbers_[kVolume] * Ramp(at.t * at.t, kVolumeScale).value;
}

Mat3d Correction::stress(const Mat3d& f) const {
  const Hencky at(f);
  const std::array<Vec3d, kCorrectionSize> each = principal_stresses(at);
  Vec3d tau = bulk_ * numbers_[kVolume] * each[kVolume];
  for (std::size_t i = 0; i < kVolume; ++i) tau += shear_ * numbers_[i] * each[i];
  return at.axes * tau.asDiagonal() * at.axes.transpose();
}

void Correction::stress_adjoint(const Mat3d& f, const Mat3d& stress_bar, Mat3d& f_bar,
                                double* numbers) const {
  const Hencky at(f);
  const std::array<Vec3d, kCorrectionSize> each = principal_stresses(at);
  const Mat3d bar = at.axes.transpose() * (0.5 * (stress_bar + stress_bar.transpose())) * at.axes;
  const Vec3d along = bar.diagonal();
  for (std::size_t i = 0; i < kVolume; ++i) numbers[i] += shear_ * each[i].dot(along);
  numbers[kVolume] += bulk_ * each[kVolume].dot(along);

  // τ = W_t 1 + 2 W_s dev H + W_k ∂k/∂H, and its derivative along the cotangent.
  double w_s = 0.0;
  double w_ss = 0.0;
  for (std::size_t i = 0; i < kShapeScales.size(); ++i) {
    const Ramp ramp(at.s, kShapeScales[i]);
    w_s += shear_ * numbers_[i] * ramp.first;
    w_ss += shear_ * numbers_[i] * ramp.second;
  }
  const double asymmetry = shear_ * numbers_[kAsymmetry] / at.root;
  const double square = at.root * at.root;
  const double w_k = asymmetry;
  const double w_sk = -0.5 * asymmetry / square;
  w_s -= 0.5 * asymmetry * at.k / square;
  w_ss += 0.75 * asymmetry * at.k / (square * square);
  const Ramp volume(at.t * at.t, kVolumeScale);
  const double w_tt =
      bulk_ * numbers_[kVolume] * (volume.first + 2.0 * at.t * at.t * volume.second);

  const double trace = along.sum();
  const Mat3d shape = bar - trace / 3.0 * Mat3d::Identity();
  const double of_dev = at.dev.dot(along);
  const double of_cube = at.dev_cube.dot(along);
  Mat3d strain_bar = 2.0 * w_s * shape;
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j)
      strain_bar(i, j) += 3.0 * w_k * (at.dev[i] + at.dev[j]) * shape(i, j);
  }
  strain_bar.diagonal().array() -= 2.0 * w_k * of_dev;
  strain_bar.diagonal() +=
      (4.0 * w_ss * of_dev + 2.0 * w_sk * of_cube) * at.dev + 2.0 * w_sk * of_dev * at.dev_cube;
  strain_bar.diagonal().array() += w_tt * trace;
  f_bar += 2.0 * at.axes * of_square(at, strain_bar) * at.axes.transpose() * f;
}

double Correction::modulus_bound() const {
  constexpr double kCompression = 0.7;
  double shape = kAsymmetryCurvature * std::abs(numbers_[kAsymmetry]);
  for (std::size_t i = 0; i < kShapeScales.size(); ++i) {
    shape += kRampCurvature * std::max(0.0, numbers_[i]);
  }
  const double volume = kRampCurvature * std::max(0.0, numbers_[kVolume]);
  return (4.0 / 3.0 * shear_ * shape + bulk_ * volume) / (kCompression * kCompression);
}

void add_correction_gradient(const Material& material, std::span<const double> numbers,
                             MaterialGradient& gradient) {
  gradient.correction.assign(numbers.begin(), numbers.end());
  // The stress is a multiple of each number and of its modulus.
  double of_shear = 0.0;
  double of_bulk = 0.0;
  for (std::size_t i = 0; i < std::min(numbers.size(), material.correction.size()); ++i) {
    (i == kVolume ? of_bulk : of_shear) += material.correction[i] * numbers[i];
  }
  if (material.traits().fluid) {
    gradient.bulk_modulus += of_bulk / material.bulk_modulus;
    return;
  }
  const double nu = material.poisson_ratio;
  MaterialGradient more;
  more.youngs_modulus = (of_shear + of_bulk) / material.youngs_modulus;
  more.poisson_ratio = 2.0 * of_bulk / (1.0 - 2.0 * nu) - of_shear / (1.0 + nu);
  gradient.youngs_modulus += more.youngs_modulus;
  gradient.poisson_ratio += more.poisson_ratio;
  if (material.law != Law::kLatent) return;
  more.weight_moves.assign(kIsotropicElastic, 0.0);
  const std::vector<double> of_code = latent_gradient(material, more);
  for (std::size_t i = 0; i < of_code.size(); ++i) gradient.latent[i] += of_code[i];
}

void check_correction(std::span<const double> numbers, const std::string& where) {
  if (numbers.empty()) return;
  if (numbers.size() != kCorrectionSize) {
    throw_input(
        fmt::format("{} has {} numbers; a correction has {}. Give one each, 0 for those "
                    "that do nothing.",
                    where, numbers.size(), kCorrectionSize));
  }
  double shape = kAsymmetryCurvature * std::abs(numbers[kAsymmetry]);
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    if (!(std::abs(numbers[i]) <= kLargestNumber)) {
      throw_input(fmt::format("{}[{}] = {} is outside [-{}, {}].", where, i, numbers[i],
                              kLargestNumber, kLargestNumber));
    }
    if (i < kAsymmetry) shape += kRampCurvature * std::max(0.0, -numbers[i]);
  }
  const double volume = kRampCurvature * std::max(0.0, -numbers[kVolume]);
  if (std::max(shape, volume) > kMostSoftening) {
    throw_input(fmt::format(
        "{} takes {:.3g} of a stiffness away at some strain; at most {:.3g} may go, as nothing "
        "would hold the body together. Raise the negative numbers, or bring the fourth nearer to "
        "0.",
        where, std::max(shape, volume), kMostSoftening));
  }
}

}  // namespace matterfit::material
