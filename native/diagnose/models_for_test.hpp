// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/Core>
#include <Eigen/LU>
#include <cmath>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "diagnose/model.hpp"
#include "diagnose/observe.hpp"
#include "diagnose/random.hpp"

/// Cheap simulators of which everything is known, for the tests of this room.
namespace matterfit::diagnose {

/// Noise of the recordings that tests make.
struct TestNoise {
  double sigma = 5e-4;              ///< [m]
  double correlation = 0.0;         ///< of each coordinate from frame to frame
  double common = 0.0;              ///< shared by all tracks [m]
  double common_correlation = 0.0;  ///< of that
  double outliers = 0.0;            ///< share of samples that are 20 sigma off
  std::uint64_t seed = 1;
};

/// A model of which captures are made by itself with something hidden in them.
class HiddenModel : public Model {
 public:
  const std::vector<Capture>& captures() const override { return captures_; }
  const std::vector<fit::Parameter>& parameters() const override { return parameters_; }
  const std::vector<Effect>& effects() const override { return effects_; }
  bool has_numerics() const override { return false; }
  std::vector<std::optional<Motion>> simulate(const std::vector<Point>& points) const override {
    std::vector<std::optional<Motion>> result;
    result.reserve(points.size());
    for (const Point& point : points) {
      result.emplace_back(motion(point));
      result.back()->work = work_of_each;
      spoil(point, result.back()->positions);
    }
    return result;
  }
  int effect_index(const std::string& name) const {
    for (std::size_t e = 0; e < effects_.size(); ++e) {
      if (effects_[e].name == name) return int(e);
    }
    return -1;
  }

  /// Records the motion at the parameters' present values with causes hidden in it.
  void record(const std::vector<Point::Cause>& hidden, const TestNoise& noise) {
    Point point;
    point.theta.resize(Eigen::Index(parameters_.size()));
    for (std::size_t p = 0; p < parameters_.size(); ++p) {
      point.theta[Eigen::Index(p)] =
          fit::to_natural(parameters_[p].coordinate, parameters_[p].start);
    }
    std::vector<Observed> observed;
    for (const Point::Cause& cause : hidden) {
      const Effect& effect = effects_[std::size_t(cause.effect)];
      if (effect.observation == Observation::kNone) {
        point.causes.push_back(cause);
      } else {
        observed.push_back({&effect, cause.values});
      }
    }
    const Eigen::VectorXd x = observe(truth(point), captures_, observed);
    Eigen::Index first = 0;
    for (std::size_t c = 0; c < captures_.size(); ++c) {
      captures_[c].positions = x.segment(first, 3 * captures_[c].samples());
      add_noise(captures_[c], noise, c);
      first += 3 * captures_[c].samples();
    }
  }
  double work_of_each = 1.0;  ///< Motion::work
  /// The fitted values before the truth was known: the same start from which the engine refits.
  std::vector<fit::Parameter> parameters_;
  std::vector<Effect> effects_;
  std::vector<Capture> captures_;

 private:
  /// Overwrites the samples that nobody is to look at.
  void spoil(const Point& point, Eigen::VectorXd& positions) const {
    if (point.until.empty()) return;
    Eigen::Index first = 0;
    for (std::size_t c = 0; c < captures_.size(); ++c) {
      const Capture& capture = captures_[c];
      for (std::size_t f = 0; f < capture.times.size(); ++f) {
        if (capture.times[f] <= point.until[c] + 1e-9) continue;
        positions.segment(first + Eigen::Index(3 * f) * capture.tracks(), 3 * capture.tracks())
            .setConstant(1e3);
      }
      first += 3 * capture.samples();
    }
  }

 protected:
  virtual Motion motion(const Point& point) const = 0;
  /// What the world does: the same unless the simulator has an error of its own.
  virtual Motion truth(const Point& point) const { return motion(point); }

  static void add_noise(Capture& capture, const TestNoise& noise, std::size_t c) {
    const double rest = std::sqrt(1.0 - noise.correlation * noise.correlation);
    const double memory = noise.common_correlation;
    for (Eigen::Index i = 0; i < capture.tracks(); ++i) {
      for (int axis = 0; axis < 3; ++axis) {
        Random random(noise.seed, 1000000 * (c + 1) + std::uint64_t(3 * i + axis));
        double e = random.normal();
        double shared = 0.0;
        for (std::size_t f = 0; f < capture.times.size(); ++f) {
          Random common(noise.seed, 77000000 + 1000 * c + 3 * f + std::uint64_t(axis));
          const double fresh = common.normal();
          shared = f == 0 ? fresh : memory * shared + std::sqrt(1.0 - memory * memory) * fresh;
          double value = noise.sigma * e + noise.common * shared;
          if (noise.outliers > 0.0 && random.uniform() < noise.outliers) {
            value += 20.0 * noise.sigma * random.normal();
          }
          capture.positions[3 * (Eigen::Index(f) * capture.tracks() + i) + axis] += value;
          e = noise.correlation * e + rest * random.normal();
        }
      }
    }
  }
};

inline Number number(const std::string& name, const std::string& unit, double scale,
                     bool one_sided = false, double high = 1e300) {
  Number result;
  result.name = name;
  result.unit = unit;
  result.scale = scale;
  result.first_step = 1e-2 * scale;
  result.one_sided = one_sided;
  result.low = one_sided ? 0.0 : -high;
  result.high = high;
  return result;
}

inline Effect effect(const std::string& name, const std::string& group, std::vector<Number> numbers,
                     Observation observation = Observation::kNone) {
  Effect result;
  result.name = name;
  result.scope = "shared";
  result.group = group;
  result.numbers = std::move(numbers);
  result.observation = observation;
  return result;
}

inline fit::Parameter parameter(const std::string& name, double start, double scale, double low,
                                double high,
                                fit::Coordinate coordinate = fit::Coordinate::kLinear) {
  fit::Parameter result;
  result.name = name;
  result.start = start;
  result.scale = scale;
  result.low = low;
  result.high = high;
  result.coordinate = coordinate;
  return result;
}

/// Rigid bodies thrown without spin; each throw is a capture with a velocity of its own to be
/// fitted. RK4, eight steps a frame.
class ThrownModel : public HiddenModel {
 public:
  explicit ThrownModel(const std::vector<Vec3d>& throws, int frames = 24, int side = 4) {
    for (std::size_t c = 0; c < throws.size(); ++c) {
      Capture capture;
      capture.name = "throw " + std::to_string(c + 1);
      for (int f = 0; f < frames; ++f) capture.times.push_back(f / 30.0);
      for (int i = 0; i < side * side; ++i) {
        const int row = i / side;
        capture.rest.emplace_back(0.05 * (i % side), 0.04 * row, 1.0 + 0.01 * (i % 3));
      }
      capture.use.assign(std::size_t(capture.samples()), Use::kUsed);
      for (int f = frames * 3 / 4; f < frames; ++f) {
        for (Eigen::Index i = 0; i < capture.tracks(); ++i) {
          capture.use[std::size_t(f * capture.tracks() + i)] = Use::kHeldOut;
        }
      }
      captures_.push_back(std::move(capture));
      const char* axes[] = {"x", "y", "z"};
      for (int a = 0; a < 3; ++a) {
        parameters_.push_back(parameter("velocity." + std::to_string(c) + "." + axes[a],
                                        throws[c][a], 0.1, -50.0, 50.0));
        own_.push_back(int(c));
      }
    }
    effects_ = {
        effect("gravity_size", "outside", {number("excess", "", 0.05)}),
        effect("gravity_direction", "outside",
               {number("x", "rad", 0.02), number("y", "rad", 0.02)}),
        effect("drag_linear", "outside", {number("rate", "1/s", 0.1, true)}),
        effect("drag_quadratic", "outside", {number("rate", "1/m", 0.05, true)}),
        effect("force_field", "outside", {number("slope", "1/s²", 0.5)}),
        effect("spin", "state", {number("spin", "rad/s", 0.2)}),
        effect("time_offset", "measurement", {number("offset", "s", 5e-3)},
               Observation::kTimeOffset),
        effect("frame_rate", "measurement", {number("excess", "", 0.02)}, Observation::kFrameRate),
        effect("scale", "measurement", {number("excess", "", 0.02)}, Observation::kScale),
        effect("camera_drift", "measurement",
               {number("x", "m/s", 0.02), number("y", "m/s", 0.02), number("z", "m/s", 0.02)},
               Observation::kDrift),
        effect("tracker_lag", "measurement", {number("time", "s", 5e-3, true)}, Observation::kLag),
    };
  }
  std::vector<int> own_capture() const override { return own_; }
  std::vector<Experiment> experiments() const override { return experiments_; }
  std::vector<std::optional<Motion>> simulate_experiment(
      int, const std::vector<Point>& points) const override {
    // Ten times as fast, and sideways.
    std::vector<std::optional<Motion>> result;
    for (Point point : points) {
      point.theta.head<3>() = Vec3d(point.theta[0] + 15.0, point.theta[1], point.theta[2]);
      const Motion all = motion(point);
      Motion first;
      const Eigen::Index rows = 3 * captures_[0].samples();
      first.positions = all.positions.head(rows);
      first.velocities = all.velocities.head(rows);
      result.emplace_back(std::move(first));
    }
    return result;
  }
  std::vector<Experiment> experiments_;
  /// Adds a wind, which takes the rate of drag_quadratic.
  void add_wind() {
    effects_.push_back(
        effect("wind", "outside",
               {number("x", "m/s", 1.0), number("y", "m/s", 1.0), number("z", "m/s", 1.0)}));
    effects_.back().beside = "drag_quadratic";
  }
  /// Adds what the body's law might be instead: it turns about y as time goes on.
  void add_law() {
    effects_.push_back(effect("law", "material", {number("bend", "m", 0.01)}));
    effects_.back().last = true;
  }
  /// A push that no effect knows: sideways, by a bump in time, growing along the body [m/s²].
  double unknown_push = 0.0;
  /// A kick that no effect knows, in the middle of the recording [m/s].
  Vec3d unknown_kick = Vec3d::Zero();

 protected:
  Motion truth(const Point& point) const override { return fly(point, unknown_push, unknown_kick); }
  Motion motion(const Point& point) const override { return fly(point, 0.0, Vec3d::Zero()); }

 private:
  Motion fly(const Point& point, double push, const Vec3d& kick) const {
    double gravity = 9.81;
    Vec3d down = -Vec3d::UnitZ();
    double linear = 0.0;
    double quadratic = 0.0;
    bool has_drag = false;
    double field = 0.0;
    double spin = 0.0;
    double bend = 0.0;
    Vec3d shaking = Vec3d::Zero();
    Vec3d wind = Vec3d::Zero();
    for (const Point::Cause& cause : point.causes) {
      const std::string& name = effects_[std::size_t(cause.effect)].name;
      if (name == "shaking") shaking = cause.values.head<3>();
      if (name == "wind") wind = cause.values.head<3>();
      if (name == "gravity_size") gravity *= 1.0 + cause.values[0];
      if (name == "gravity_direction") {
        down = Vec3d(cause.values[0], cause.values[1], -1.0).normalized();
      }
      if (name == "drag_linear") linear = cause.values[0];
      has_drag = has_drag || name == "drag_quadratic";
      if (name == "drag_quadratic" || name == "drag_twin") quadratic += cause.values[0];
      if (name == "force_field") field = cause.values[0];
      if (name == "spin") spin = cause.values[0];
      if (name == "law" || name == "like_law") bend += cause.values[0];
    }
    Eigen::Index size = 0;
    for (const Capture& capture : captures_) size += 3 * capture.samples();
    Motion result{Eigen::VectorXd(size), Eigen::VectorXd(size)};
    Eigen::Index row = 0;
    for (std::size_t c = 0; c < captures_.size(); ++c) {
      const Capture& capture = captures_[c];
      Vec3d x = Vec3d::Zero();
      Vec3d v = point.theta.segment<3>(Eigen::Index(3 * c));
      const auto acceleration = [&](const Vec3d& at, const Vec3d& u) -> Vec3d {
        const Vec3d in_air = u - wind;
        const double moved = has_drag ? quadratic : 0.05;
        return gravity * down + shaking - linear * u - quadratic * u.norm() * u -
               moved * (in_air.norm() * in_air - u.norm() * u) + field * at[0] * Vec3d::UnitY();
      };
      for (std::size_t f = 0; f < capture.times.size(); ++f) {
        if (f > 0) {
          constexpr int kSteps = 4;
          const double h = (capture.times[f] - capture.times[f - 1]) / kSteps;
          for (int s = 0; s < kSteps; ++s) {
            const Vec3d a1 = acceleration(x, v);
            const Vec3d v2 = v + 0.5 * h * a1;
            const Vec3d a2 = acceleration(x + 0.5 * h * v, v2);
            const Vec3d v3 = v + 0.5 * h * a2;
            const Vec3d a3 = acceleration(x + 0.5 * h * v2, v3);
            const Vec3d v4 = v + h * a3;
            const Vec3d a4 = acceleration(x + h * v3, v4);
            x += h / 6.0 * (v + 2.0 * v2 + 2.0 * v3 + v4);
            v += h / 6.0 * (a1 + 2.0 * a2 + 2.0 * a3 + a4);
          }
          if (f == capture.times.size() / 2) v += kick;
        }
        const double t = capture.times[f];
        const Eigen::AngleAxisd turn(spin * t, Vec3d::UnitZ());
        const double u = t / capture.times.back();
        const double bump = std::exp(-40.0 * (u - 0.45) * (u - 0.45));
        for (const Vec3d& rest : capture.rest) {
          const Vec3d arm = rest - Vec3d(0.075, 0.06, 1.0);
          const Vec3d turned = turn * arm;
          result.positions.segment<3>(row) =
              x + Vec3d(0.075, 0.06, 1.0) + turned +
              Vec3d(0.0, 0.0,
                    push * bump * arm[0] * arm[0] / 0.0056 + bend * u * u * arm[0] / 0.075);
          result.velocities.segment<3>(row) = v + spin * Vec3d::UnitZ().cross(turned);
          row += 3;
        }
      }
    }
    return result;
  }
  std::vector<int> own_;
};

/// A clamped chain of masses and springs that is let go and swings across itself: what a beam is,
/// in one dimension. The world moves exactly; the simulator may take implicit Euler steps, which
/// damp in proportion to their length.
class ChainModel : public HiddenModel {
 public:
  static constexpr Eigen::Index kNodes = 10;
  /// `steps`: implicit steps a frame; 0: exact.
  explicit ChainModel(int steps = 0, int frames = 60) : steps_(steps) {
    Capture capture;
    capture.name = "release";
    capture.axes = {false, false, true};
    for (int f = 0; f < frames; ++f) capture.times.push_back(f / 60.0);
    for (Eigen::Index i = 0; i < kNodes; ++i)
      capture.rest.emplace_back(0.02 * double(i + 1), 0.0, 0.0);
    capture.use.assign(std::size_t(capture.samples()), Use::kUsed);
    for (int f = frames * 3 / 4; f < frames; ++f) {
      for (Eigen::Index i = 0; i < kNodes; ++i) {
        capture.use[std::size_t(f * kNodes + i)] = Use::kHeldOut;
      }
    }
    captures_ = {std::move(capture)};
    parameters_ = {parameter("stiffness", 3e4, 0.1, 1e3, 1e6, fit::Coordinate::kLog)};
    Effect mass = effect("attached_mass", "state", {number("mass", "node masses", 0.3, true)});
    mass.variants = {"near the clamp", "at a third", "at two thirds", "at the free end"};
    Effect inclusion = effect("stiffness_inclusion", "material", {number("factor", "", 0.2)});
    inclusion.variants = {"near the clamp", "in the middle", "near the free end"};
    effects_ = {effect("damping_shear", "material", {number("time", "s", 1e-3, true)}),
                effect("drag_linear", "outside", {number("rate", "1/s", 0.2, true)}),
                effect("gravity_size", "outside", {number("excess", "", 0.05)}),
                mass,
                inclusion,
                effect("time_offset", "measurement", {number("offset", "s", 5e-3)},
                       Observation::kTimeOffset),
                effect("scale", "measurement", {number("excess", "", 0.02)}, Observation::kScale)};
  }
  bool has_numerics() const override { return steps_ > 0; }

 protected:
  Motion truth(const Point& point) const override { return swing(point, 0); }
  Motion motion(const Point& point) const override { return swing(point, steps_); }

 private:
  Motion swing(const Point& point, int steps) const {
    const double k = std::exp(point.theta[0]);
    Eigen::VectorXd masses = Eigen::VectorXd::Ones(kNodes);
    Eigen::VectorXd springs = Eigen::VectorXd::Constant(kNodes, k);
    double viscous = 0.0;
    double drag = 0.0;
    double gravity = 9.81;
    for (const Point::Cause& cause : point.causes) {
      const std::string& name = effects_[std::size_t(cause.effect)].name;
      const double a = cause.values[0];
      if (name == "damping_shear") viscous = a;
      if (name == "drag_linear") drag = a;
      if (name == "gravity_size") gravity *= 1.0 + a;
      if (name == "attached_mass") masses[Eigen::Index{3} * cause.variant] += a;
      if (name == "stiffness_inclusion") {
        springs.segment(Eigen::Index{3} * cause.variant + 1, 2) *= std::exp(a);
      }
    }
    Eigen::MatrixXd stiffness = Eigen::MatrixXd::Zero(kNodes, kNodes);
    for (Eigen::Index i = 0; i < kNodes; ++i) {
      stiffness(i, i) += springs[i];
      if (i == 0) continue;
      stiffness(i - 1, i - 1) += springs[i];
      stiffness(i, i - 1) -= springs[i];
      stiffness(i - 1, i) -= springs[i];
    }
    // y = [x, v, 1]
    const Eigen::Index n = 2 * kNodes + 1;
    Eigen::MatrixXd rate = Eigen::MatrixXd::Zero(n, n);
    const Eigen::VectorXd light = masses.cwiseInverse();
    rate.block(0, kNodes, kNodes, kNodes).setIdentity();
    rate.block(kNodes, 0, kNodes, kNodes) = -(light.asDiagonal() * stiffness);
    rate.block(kNodes, kNodes, kNodes, kNodes) = -(light.asDiagonal() * (viscous * stiffness));
    rate.block(kNodes, kNodes, kNodes, kNodes).diagonal() -= drag * light;
    rate.block(kNodes, n - 1, kNodes, 1).setConstant(-gravity);
    const Capture& capture = captures_[0];
    const double h = capture.times[1];
    Eigen::MatrixXd frame = Eigen::MatrixXd::Identity(n, n);
    if (steps > 0) {
      const double dt = h / steps * point.numerics.spacing;
      // Steps of any length: the implicit operator to a power that need not be whole is taken from
      // its logarithm's series, −ln(1 − dt A)/dt ≈ A + dt A²/2 + dt² A³/3.
      const Eigen::MatrixXd slowed =
          rate + 0.5 * dt * rate * rate + dt * dt / 3.0 * rate * rate * rate;
      frame = exponential(h * slowed);
    } else {
      frame = exponential(h * rate);
    }
    Eigen::VectorXd y = Eigen::VectorXd::Zero(n);
    y[n - 1] = 1.0;
    Motion result{Eigen::VectorXd(3 * capture.samples()), Eigen::VectorXd(3 * capture.samples())};
    for (std::size_t f = 0; f < capture.times.size(); ++f) {
      if (f > 0) y = (frame * y).eval();
      for (Eigen::Index i = 0; i < kNodes; ++i) {
        const Eigen::Index row = 3 * (Eigen::Index(f) * kNodes + i);
        result.positions.segment<3>(row) = capture.rest[std::size_t(i)] + Vec3d(0.0, 0.0, y[i]);
        result.velocities.segment<3>(row) = Vec3d(0.0, 0.0, y[kNodes + i]);
      }
    }
    return result;
  }

  /// By scaling, Taylor's series and squaring.
  static Eigen::MatrixXd exponential(const Eigen::MatrixXd& a) {
    int halvings = 0;
    double size = a.cwiseAbs().rowwise().sum().maxCoeff();
    while (size > 0.25) {
      size *= 0.5;
      ++halvings;
    }
    const Eigen::MatrixXd b = a / std::pow(2.0, halvings);
    Eigen::MatrixXd sum = Eigen::MatrixXd::Identity(a.rows(), a.cols());
    Eigen::MatrixXd term = sum;
    for (int k = 1; k <= 12; ++k) {
      term = (term * b / k).eval();
      sum += term;
    }
    for (int i = 0; i < halvings; ++i) sum = (sum * sum).eval();
    return sum;
  }
  int steps_;
};

}  // namespace matterfit::diagnose
