// SPDX-License-Identifier: GPL-3.0-or-later
// The momentum balance along motion that the solver itself made, in free flight: a cube thrown so
// that it shears, stretches and turns.
#include "fit/data/equation_error.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <random>

#include "base/error.hpp"
#include "fit/numerics/least_squares.hpp"
#include "mpm/simulation.hpp"

namespace matterfit::fit {
namespace {

using material::Law;
using material::Material;

constexpr int kAcross = 10;
constexpr double kSeparation = 0.02;
constexpr int kFrames = 10;
constexpr double kFps = 100.0;

Material truth_of(Law law) {
  Material m;
  m.law = law;
  m.youngs_modulus = 2e4;
  m.poisson_ratio = 0.3;
  m.yield_stress = 400.0;
  m.viscosity = law == Law::kNewtonian ? 20.0 : 5.0;
  m.bulk_modulus = 2e4;
  m.friction_angle = 30.0;
  m.cohesion = 200.0;
  return m;
}

/// The solver's motion of all particles, with noise; made once a law.
Balance flight(Law law, double noise = 2e-5) {
  mpm::Scene scene;
  scene.fps = kFps;
  scene.end_frame = kFrames;
  scene.dx = 2.0 * kSeparation;
  mpm::Body body;
  body.name = "cube";
  body.material = truth_of(law);
  body.lattice = {Vec3d::Zero(), Quatd::Identity(), kSeparation, true};
  for (int i = 0; i < kAcross * kAcross * kAcross; ++i) {
    const Vec3d cell =
        Vec3i(i % kAcross, i / kAcross % kAcross, i / (kAcross * kAcross)).cast<double>();
    body.rest.push_back(kSeparation * (cell + Vec3d::Constant(0.5)));
    body.volumes.push_back(kSeparation * kSeparation * kSeparation);
    const Vec3d x = (body.rest.back() - Vec3d::Constant(0.1)) / 0.1;
    const double press = law == Law::kDruckerPrager ? -1.0 : 0.0;
    body.particle_velocities.emplace_back(0.8 * x.y() + press * x.x(),
                                          0.3 * std::sin(2.0 * x.x()) + press * x.y(),
                                          0.4 * x.z() * x.x() + press * x.z());
  }
  body.spin = Vec3d(1, 2, -1);
  scene.bodies.push_back(body);
  static std::map<Law, Balance> known;
  Balance& balance = known[law];
  if (balance.places.empty()) {
    balance.places = body.rest;
    balance.volumes = body.volumes;
    balance.density = body.density;
    balance.flows = !body.material.traits().elastic();
    balance.tracks.rest = body.rest;
    balance.tracks.spacing = kSeparation;
    mpm::Simulation simulation(scene, std::make_shared<Arena>(2));
    const Interrupter interrupter;
    for (int frame = 0; frame < kFrames; ++frame) {
      if (frame > 0) simulation.advance(interrupter);
      balance.tracks.times.push_back(frame / kFps);
      const mpm::FrameState state = simulation.state();
      for (const Vec3f& x : state.bodies[0].positions) {
        balance.tracks.positions.push_back(x.cast<double>());
      }
      balance.gravity.emplace_back(0, 0, -9.81);
    }
  }
  Balance noisy = balance;
  noisy.tracks.sigma = noise;
  std::mt19937 random(3);
  std::normal_distribution<double> normal(0.0, noise);
  for (Vec3d& x : noisy.tracks.positions) {
    for (int axis = 0; axis < 3; ++axis) x[axis] += normal(random);
  }
  return noisy;
}

struct Sought {
  double Material::*member;
  double start;
};

/// What Levenberg–Marquardt makes of these parameters, over the truth.
std::vector<double> ratios(Law law, const std::vector<Sought>& sought, double noise = 2e-5) {
  class Residuals final : public Problem {
   public:
    Residuals(Balance balance, const Material& material, const std::vector<Sought>& sought)
        : arena_(2), error_(std::move(balance), arena_), material_(material), sought_(sought) {}
    std::vector<std::optional<Eigen::VectorXd>> evaluate(
        const std::vector<Eigen::VectorXd>& points) override {
      std::vector<std::optional<Eigen::VectorXd>> results;
      for (const Eigen::VectorXd& point : points) {
        for (std::size_t k = 0; k < sought_.size(); ++k) {
          material_.*sought_[k].member = std::exp(point[Eigen::Index(k)]);
        }
        results.emplace_back(error_.evaluate(material_, arena_));
      }
      return results;
    }

   private:
    Arena arena_;
    EquationError error_;
    Material material_;
    const std::vector<Sought>& sought_;
  } problem(flight(law, noise), truth_of(law), sought);
  std::vector<Parameter> parameters;
  for (const Sought& one : sought) {
    Parameter parameter;
    parameter.name = "x";
    parameter.coordinate = Coordinate::kLog;
    parameter.start = one.start;
    parameter.low = 1e-3 * one.start;
    parameter.high = 1e3 * one.start;
    parameters.push_back(parameter);
  }
  LeastSquaresOptions options;
  options.iterations = 8;
  options.step_tolerance = 3e-2;
  options.cost_tolerance = 1e-3;
  const LeastSquares search(parameters, options);
  LeastSquaresState state = search.start();
  while (!state.finished) search.iterate(problem, state);
  std::vector<double> result;
  for (std::size_t k = 0; k < sought.size(); ++k) {
    result.push_back(std::exp(state.point[Eigen::Index(k)]) / (truth_of(law).*sought[k].member));
  }
  return result;
}

TEST(EquationError, FindsTheStiffnessOfElasticBodies) {
  for (const Law law : {Law::kFixedCorotated, Law::kNeoHookean, Law::kStvkHencky}) {
    const double ratio = ratios(law, {{&Material::youngs_modulus, 2e3}}).front();
    EXPECT_NEAR(ratio, 1.0, 0.25) << material::traits(law).name;
  }
}

TEST(EquationError, NoiseIsNotTakenForSoftness) {
  const double ratio = ratios(Law::kNeoHookean, {{&Material::youngs_modulus, 1e5}}, 3e-4).front();
  EXPECT_NEAR(ratio, 1.0, 0.35);
}

TEST(EquationError, FindsWhatMakesBodiesFlow) {
  EXPECT_NEAR(ratios(Law::kVonMises, {{&Material::yield_stress, 2e3}}).front(), 1.0, 0.5);
  EXPECT_NEAR(ratios(Law::kHerschelBulkley, {{&Material::yield_stress, 2e3}}).front(), 1.0, 0.5);
  EXPECT_NEAR(ratios(Law::kNewtonian, {{&Material::viscosity, 100.0}}).front(), 1.0, 0.5);
}

TEST(EquationError, SameBitsForAnyNumberOfThreads) {
  Arena one(1);
  Arena three(3);
  const Material m = truth_of(Law::kVonMises);
  const Eigen::VectorXd a = EquationError(flight(m.law), one).evaluate(m, one);
  const Eigen::VectorXd b = EquationError(flight(m.law), three).evaluate(m, three);
  EXPECT_EQ(a, b);
}

TEST(EquationError, LeavesOutWhatIsNearAContact) {
  Arena arena(2);
  const Material m = truth_of(Law::kNeoHookean);
  Balance balance = flight(m.law);
  const Eigen::VectorXd free = EquationError(balance, arena).evaluate(m, arena);
  // The lower half is struck: accelerations there are not those of the stress.
  const std::size_t points = balance.tracks.points();
  for (std::size_t t = 5; t < balance.tracks.frames(); ++t) {
    for (std::size_t i = 0; i < points; ++i) {
      if (balance.tracks.rest[i].z() < 0.04) balance.tracks.positions[t * points + i].z() += 0.01;
    }
  }
  const Eigen::VectorXd struck = EquationError(balance, arena).evaluate(m, arena);
  EXPECT_GT(struck.squaredNorm() / double(struck.size()),
            1.4 * free.squaredNorm() / double(free.size()));
  balance.contact_reach = 0.09;
  balance.clearance = [](const Vec3d& rest, const Vec3d&, double) {
    return Clearance{rest.z(), Vec3d::UnitZ(), true};
  };
  const EquationError clear(balance, arena);
  const Eigen::VectorXd apart = clear.evaluate(m, arena);
  EXPECT_LT(apart.squaredNorm() / double(apart.size()),
            1.3 * free.squaredNorm() / double(free.size()));
}

std::string refusal(const Balance& balance) {
  Arena arena(1);
  try {
    const EquationError error(balance, arena);
  } catch (const Error& error) {
    return error.what();
  }
  return "";
}

TEST(EquationError, RefusesWhatTellsTooLittle) {
  Balance few = flight(Law::kNeoHookean);
  few.tracks.times.resize(2);
  few.tracks.positions.resize(2 * few.tracks.points());
  EXPECT_THAT(refusal(few), testing::HasSubstr("fewer than three frames"));

  Balance blocked = flight(Law::kNeoHookean);
  blocked.clearance = [](const Vec3d&, const Vec3d&, double) { return Clearance{-1.0}; };
  EXPECT_THAT(refusal(blocked), testing::HasSubstr("clear of contacts"));

  const Balance full = flight(Law::kNeoHookean);
  Balance surface = full;
  surface.tracks.rest.clear();
  surface.tracks.positions.clear();
  std::vector<std::size_t> kept;
  for (std::size_t i = 0; i < full.tracks.points(); ++i) {
    if ((full.tracks.rest[i].array() - 0.1).abs().maxCoeff() > 0.085) kept.push_back(i);
  }
  for (const std::size_t i : kept) surface.tracks.rest.push_back(full.tracks.rest[i]);
  for (std::size_t t = 0; t < full.tracks.frames(); ++t) {
    for (const std::size_t i : kept) {
      surface.tracks.positions.push_back(full.tracks.positions[t * full.tracks.points() + i]);
    }
  }
  EXPECT_THAT(refusal(surface), testing::HasSubstr("all through its inside"));

  Balance sparse = full;
  sparse.tracks.rest.resize(100);
  EXPECT_THAT(refusal(sparse), testing::HasSubstr("all through the body, and there are 100"));
}

}  // namespace
}  // namespace matterfit::fit
