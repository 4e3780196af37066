// SPDX-License-Identifier: GPL-3.0-or-later
#include "fit/data/equation_error.hpp"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

#include "base/error.hpp"
#include "material/classical/point_law.hpp"
#include "math/catmull_rom.hpp"
#include "mpm/spline_weights.hpp"

namespace matterfit::fit {
namespace {

constexpr double kCell = 1.5;  ///< of the grid in track spacings: about 90 tracks to a support
constexpr std::size_t kRepeats = 2;
constexpr std::size_t kFewestTracks = 300;
constexpr std::size_t kFewestTests = 40;
constexpr std::size_t kMostHats = 48;
constexpr double kLeastCover = 0.8;      ///< of the places with enough tracks around them
constexpr double kLeastMass = 0.15;      ///< of a full cell, for a test function
constexpr double kMostUnknown = 0.02;    ///< of its mass
constexpr double kSubstep = 1.0 / 72.0;  ///< [s], about
constexpr std::size_t kMostSubsteps = 3;
/// Hats are so wide that noise is below this acceleration [m/s²].
constexpr double kQuiet = 5.0;
/// Errors of the scheme: of quadrature as a share of the inertia, of what frames do not resolve as
/// a share of the stress (chosen on six clips, docs/validation.md).
constexpr double kOfInertia = 0.05;
constexpr double kOfStress = 0.3;
constexpr double kInverted = 0.02;  ///< least det F that a path may go through

/// Quadratic B-splines of the 27 nodes from `base` on.
struct Spline {
  Vec3i base;
  mpm::PointStencil stencil;
  double cell;

  Spline(const Vec3d& x, double cell_size)
      : base((x.array() / cell_size - 0.5).floor().cast<int>()),
        stencil(x / cell_size - base.cast<double>(), cell_size),
        cell(cell_size) {}

  /// Visits each node: where it is, and its weight there.
  template <class Visit>
  void each(const Visit& visit) const {
    for (std::size_t k = 0; k < 3; ++k) {
      for (std::size_t j = 0; j < 3; ++j) {
        for (std::size_t i = 0; i < 3; ++i) {
          visit(base + Vec3i(static_cast<int>(i), static_cast<int>(j), static_cast<int>(k)),
                At{*this, i, j, k});
        }
      }
    }
  }
  /// The weight of one node.
  struct At {
    const Spline& of;
    std::size_t i, j, k;
    [[nodiscard]] double value() const { return of.stencil.weight(i, j, k); }
    [[nodiscard]] Vec3d slope() const { return of.stencil.gradient(i, j, k); }
    [[nodiscard]] Mat3d curvature() const { return of.stencil.curvature(i, j, k, of.cell); }
  };
};

}  // namespace

/// The box of nodes of one hat and which of them are used.
struct EquationError::HatNodes {
  Vec3i low = Vec3i::Zero();
  Vec3i size = Vec3i::Zero();
  std::vector<std::int64_t> test;  ///< of each node; −1: not used
  std::size_t first = 0;           ///< of its tests
  std::size_t count = 0;

  [[nodiscard]] bool has(const Vec3i& node) const {
    const Vec3i at = node - low;
    return (at.array() >= 0).all() && (at.array() < size.array()).all();
  }
  [[nodiscard]] std::size_t index(const Vec3i& node) const {
    const Vec3i at = node - low;
    const auto row = static_cast<std::size_t>(at.z()) * static_cast<std::size_t>(size.y()) +
                     static_cast<std::size_t>(at.y());
    return row * static_cast<std::size_t>(size.x()) + static_cast<std::size_t>(at.x());
  }
};

/// The weight of a place in a hat, and its derivative in space at the hat's centre.
struct EquationError::Ramp {
  double value = 0.0;
  Vec3d slope = Vec3d::Zero();
};

/// Means over a hat at a place: first Piola–Kirchhoff, and of the deviator alone [Pa].
struct EquationError::MeanStress {
  Mat3d all = Mat3d::Zero();
  Mat3d deviator = Mat3d::Zero();
};

EquationError::~EquationError() = default;
EquationError::EquationError(EquationError&&) noexcept = default;

EquationError::EquationError(Balance balance, Arena& arena) : balance_(std::move(balance)) {
  const InteriorTracks& tracks = balance_.tracks;
  if (tracks.frames() < 3) throw_input("its tracks have fewer than three frames in a row.");
  if (tracks.points() < kFewestTracks) {
    throw_input(fmt::format("it takes {} tracks or more all through the body, and there are {}.",
                            kFewestTracks, tracks.points()));
  }
  dt_ = (tracks.times.back() - tracks.times.front()) / double(tracks.frames() - 1);
  cell_ = kCell * tracks.spacing;
  substeps_ = std::clamp<std::size_t>(static_cast<std::size_t>(std::lround(dt_ / kSubstep)), 1,
                                      kMostSubsteps);
  choose_hats();
  InteriorTracks repeat = tracks;
  std::mt19937_64 random(20211);
  std::normal_distribution<double> normal(0.0, tracks.sigma);
  for (std::size_t k = 0; k <= kRepeats; ++k) {
    if (k > 0) {
      for (std::size_t i = 0; i < tracks.positions.size(); ++i) {
        for (int axis = 0; axis < 3; ++axis) {
          repeat.positions[i][axis] = tracks.positions[i][axis] + normal(random);
        }
      }
    }
    motions_.push_back(track_motion(repeat, balance_.places, hats_, balance_.flows, arena));
    if (k == 0) check_cover();
    find_ramps(motions_.back(), arena);
  }
  choose_tests();
  if (tests_ < kFewestTests) {
    throw_input(
        fmt::format("only {} test functions have enough tracks and are clear of contacts "
                    "and pins; it takes {}.",
                    tests_, kFewestTests));
  }
  inertia_ = balance_of(nullptr, 0, arena);
}

void EquationError::choose_hats() {
  const InteriorTracks& tracks = balance_.tracks;
  std::size_t half = 1;
  while (tracks.sigma > kQuiet * std::pow(double(half) * dt_, 2.0)) ++half;
  half = std::min(half, (tracks.frames() - 1) / 2);
  const std::size_t stride = std::max(half / 2, tracks.frames() / kMostHats) + (half == 1 ? 1 : 0);
  for (std::size_t k = half; k + half < tracks.frames(); k += std::max<std::size_t>(1, stride)) {
    hats_.push_back({k, half});
  }
}

void EquationError::check_cover() const {
  const auto first = motions_.front().known.begin();
  const auto places = static_cast<std::ptrdiff_t>(balance_.places.size());
  const double cover = double(std::count(first, first + places, 1)) / double(places);
  if (cover < kLeastCover) {
    throw_input(
        fmt::format("only {:.0f} % of the body has enough tracks around it; they must lie "
                    "all through its inside.",
                    100.0 * cover));
  }
}

bool EquationError::known(const TrackMotion& motion, std::size_t hat, std::size_t place) const {
  const std::size_t places = balance_.places.size();
  for (std::size_t t = hats_[hat].centre - hats_[hat].half;
       t <= hats_[hat].centre + hats_[hat].half; ++t) {
    if (motion.known[t * places + place] == 0) return false;
  }
  return motion.known_accelerations[hat * places + place] != 0;
}

void EquationError::find_ramps(const TrackMotion& motion, Arena& arena) {
  const std::size_t places = balance_.places.size();
  std::vector<Ramp> ramps(hats_.size() * places);
  arena.parallel_for(0, places, 16, [&](std::size_t q) {
    for (std::size_t h = 0; h < hats_.size(); ++h) {
      if (!known(motion, h, q)) continue;
      const Hat& hat = hats_[h];
      Clearance least;
      std::size_t when = hat.centre;
      for (std::size_t t = hat.centre - hat.half; t <= hat.centre + hat.half; ++t) {
        if (!balance_.clearance) break;
        const Clearance now = balance_.clearance(
            balance_.places[q], motion.positions[t * places + q], balance_.tracks.times[t]);
        if (now.distance >= least.distance) continue;
        least = now;
        when = t;
      }
      const double s = (least.distance - balance_.contact_reach) / cell_;
      Ramp& ramp = ramps[h * places + q];
      ramp.value = std::clamp(s, 0.0, 1.0);
      if (s <= 0.0 || s >= 1.0) continue;
      const Mat3d& then = motion.gradients[when * places + q];
      const Mat3d& centre = motion.gradients[hat.centre * places + q];
      const Vec3d at_rest = least.at_rest ? least.normal : Vec3d(then.transpose() * least.normal);
      ramp.slope = centre.transpose().inverse() * at_rest / cell_;
    }
  });
  ramps_.push_back(std::move(ramps));
}

void EquationError::choose_tests() {
  const std::size_t places = balance_.places.size();
  const TrackMotion& motion = motions_.front();
  const double full = balance_.density * cell_ * cell_ * cell_;
  std::vector<double> inertia;
  nodes_.resize(hats_.size());
  for (std::size_t h = 0; h < hats_.size(); ++h) {
    const std::size_t first = hats_[h].centre * places;
    HatNodes& nodes = nodes_[h];
    nodes.first = tests_;
    Vec3i low = Vec3i::Constant(std::numeric_limits<int>::max());
    Vec3i high = Vec3i::Constant(std::numeric_limits<int>::min());
    for (std::size_t q = 0; q < places; ++q) {
      if (motion.known[first + q] == 0) continue;
      const Vec3i base = Spline(motion.positions[first + q], cell_).base;
      low = low.cwiseMin(base);
      high = high.cwiseMax((base.array() + 3).matrix());
    }
    if ((low.array() >= high.array()).any()) continue;
    nodes.low = low;
    nodes.size = high - low;
    const auto count = static_cast<std::size_t>(nodes.size.cast<std::int64_t>().prod());
    nodes.test.assign(count, -1);
    std::vector<double> mass(count, 0.0);
    std::vector<double> unknown(count, 0.0);
    std::vector<double> force(count, 0.0);
    for (std::size_t q = 0; q < places; ++q) {
      if (motion.known[first + q] == 0) continue;
      const bool is_known = known(motion, h, q);
      const double s = is_known ? ramps_.front()[h * places + q].value : 1.0;
      const double m = s * balance_.density * balance_.volumes[q];
      const Vec3d lack = motion.accelerations[h * places + q] - balance_.gravity[hats_[h].centre];
      const Spline spline(motion.positions[first + q], cell_);
      spline.each([&](const Vec3i& node, const Spline::At& weight) {
        const std::size_t at = nodes.index(node);
        const double share = m * weight.value();
        (is_known ? mass : unknown)[at] += share;
        if (is_known) force[at] += share * lack.norm();
      });
    }
    for (std::size_t n = 0; n < count; ++n) {
      if (mass[n] < kLeastMass * full || unknown[n] > kMostUnknown * mass[n]) continue;
      nodes.test[n] = static_cast<std::int64_t>(tests_++);
      ++nodes.count;
      inertia.push_back(force[n]);
    }
  }
  floor_.resize(Eigen::Index(rows()));
  for (std::size_t n = 0; n < tests_; ++n) {
    floor_.segment<6>(Eigen::Index(6 * n)).setConstant(kOfInertia * inertia[n]);
  }
}

void EquationError::follow(const material::Material& material, const TrackMotion& motion,
                           std::size_t place, std::vector<MeanStress>& stress) const {
  const std::size_t places = balance_.places.size();
  const std::size_t frames = balance_.tracks.frames();
  const material::PointLaw law(material, dt_ / double(substeps_));
  const auto at_frame = [&](std::size_t t) -> const Mat3d& {
    return motion.gradients[std::min(t, frames - 1) * places + place];
  };
  material::PointState state;
  Mat3d last = Mat3d::Identity();
  for (std::size_t t = 0; t + 1 < frames; ++t) {
    if (motion.known[t * places + place] == 0 || motion.known[(t + 1) * places + place] == 0) {
      return;
    }
    for (std::size_t j = 0; j < substeps_; ++j) {
      const double part = double(j) / double(substeps_);
      const Mat3d now = catmull_rom(at_frame(t > 0 ? t - 1 : 0), at_frame(t), at_frame(t + 1),
                                    at_frame(t + 2), part);
      if (!(now.determinant() > kInverted)) return;
      const Mat3d tau = law.advance(now * last.inverse(), state);
      const Mat3d inverse = now.inverse().transpose();
      const Mat3d deviator = tau - tau.trace() / 3.0 * Mat3d::Identity();
      last = now;
      for (std::size_t h = 0; h < hats_.size(); ++h) {
        const double off =
            std::abs(double(t) + part - double(hats_[h].centre)) / double(hats_[h].half);
        if (off >= 1.0) continue;
        const double share = (1.0 - off) / double(hats_[h].half * substeps_);
        MeanStress& mean = stress[h * places + place];
        mean.all += share * tau * inverse;
        mean.deviator += share * deviator * inverse;
      }
    }
  }
}

void EquationError::add_hat(std::size_t h, std::size_t number,
                            const std::vector<MeanStress>& stress, Eigen::VectorXd& sums) const {
  const TrackMotion& motion = motions_[number];
  const HatNodes& nodes = nodes_[h];
  const std::size_t places = balance_.places.size();
  if (nodes.count == 0) return;
  for (std::size_t q = 0; q < places; ++q) {
    const double s = ramps_[number][h * places + q].value;
    const Vec3d ramp = ramps_[number][h * places + q].slope;
    if (s == 0.0) continue;
    const std::size_t first = hats_[h].centre * places + q;
    const Spline spline(motion.positions[first], cell_);
    const double v = balance_.volumes[q];
    const Vec3d inertia =
        balance_.density * v *
        (motion.accelerations[h * places + q] - balance_.gravity[hats_[h].centre]);
    // ⟨P⟩ : ∂w/∂X = ⟨P⟩ Fᵀ : ∂w/∂x with the centre's F.
    Mat3d all = Mat3d::Zero();
    Mat3d deviator = Mat3d::Zero();
    if (!stress.empty()) {
      const Mat3d turned = v * motion.gradients[first].transpose();
      all = stress[h * places + q].all * turned;
      deviator = stress[h * places + q].deviator * turned;
    }
    spline.each([&](const Vec3i& node, const Spline::At& weight) {
      if (!nodes.has(node) || nodes.test[nodes.index(node)] < 0) return;
      const double w = weight.value();
      const Vec3d g = weight.slope();
      auto row = sums.segment<6>(Eigen::Index(6 * nodes.test[nodes.index(node)]));
      row.head<3>() += s * w * inertia + all * (s * g + w * ramp);
      // ψ = s² N: (∇ψ × eᵢ) · b = eᵢ · (b × ∇ψ), and so for the rows of its gradient. A collider's
      // curvature is left out; what there is is symmetric, so it has no divergence either.
      Vec3d slope = s * s * g;
      Mat3d hessian = s * s * weight.curvature();
      if (s < 1.0) {
        slope += 2.0 * s * w * ramp;
        const Mat3d mixed = g * ramp.transpose();
        hessian += 2.0 * s * (mixed + mixed.transpose()) + 2.0 * w * ramp * ramp.transpose();
      }
      const Mat3d turn = deviator * hessian;
      row.tail<3>() +=
          cell_ * (inertia.cross(slope) + Vec3d(turn(1, 2) - turn(2, 1), turn(2, 0) - turn(0, 2),
                                                turn(0, 1) - turn(1, 0)));
    });
  }
}

Eigen::VectorXd EquationError::balance_of(const material::Material* material, std::size_t motion,
                                          Arena& arena) const {
  const std::size_t places = balance_.places.size();
  std::vector<MeanStress> stress(material != nullptr ? hats_.size() * places : 0);
  if (material != nullptr) {
    arena.parallel_for(0, places, 8,
                       [&](std::size_t q) { follow(*material, motions_[motion], q, stress); });
  }
  Eigen::VectorXd sums = Eigen::VectorXd::Zero(Eigen::Index(rows()));
  arena.parallel_for(0, hats_.size(), 1, [&](std::size_t h) { add_hat(h, motion, stress, sums); });
  return sums;
}

EquationError::Weighed EquationError::weighed(const material::Material& material,
                                              Arena& arena) const {
  Eigen::VectorXd residual = balance_of(&material, 0, arena);
  Eigen::VectorXd variance = floor_.cwiseAbs2();
  for (std::size_t k = 1; k <= kRepeats; ++k) {
    const Eigen::VectorXd change = balance_of(&material, k, arena) - residual;
    for (Eigen::Index at = 0; at < change.size(); at += 3) {
      variance.segment<3>(at).array() +=
          change.segment<3>(at).squaredNorm() / (3.0 * double(kRepeats));
    }
  }
  const Eigen::VectorXd force = residual - inertia_;
  for (const HatNodes& nodes : nodes_) {
    if (nodes.count == 0) continue;
    const auto tests = Eigen::Index(nodes.count);
    const Eigen::Map<const Eigen::Matrix<double, 6, Eigen::Dynamic>> of(
        force.data() + 6 * nodes.first, 6, tests);
    Eigen::Map<Eigen::Matrix<double, 6, Eigen::Dynamic>> to(variance.data() + 6 * nodes.first, 6,
                                                            tests);
    const double share = kOfStress * kOfStress / (3.0 * double(nodes.count));
    to.topRows<3>().array() += share * of.topRows<3>().squaredNorm();
    to.bottomRows<3>().array() += share * of.bottomRows<3>().squaredNorm();
  }
  return {std::move(residual), variance.array().max(1e-300)};
}

Eigen::VectorXd EquationError::evaluate(const material::Material& material, Arena& arena) const {
  const Weighed found = weighed(material, arena);
  return found.residual.array() / found.variance.array().sqrt();
}

double EquationError::deviance(const material::Material& material, Arena& arena) const {
  const Weighed found = weighed(material, arena);
  return (found.residual.array().square() / found.variance.array() + found.variance.array().log())
      .mean();
}

}  // namespace matterfit::fit
