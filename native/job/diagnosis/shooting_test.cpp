// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/diagnosis/shooting.hpp"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <cmath>
#include <cstdint>
#include <random>

namespace matterfit::job {
namespace {

using Eigen::Index;

constexpr double kRate = 60.0;  // frames a second
constexpr int kFramesOfFlight = 9;
const Vec3d kPull(0.3, 0.0, -9.81);

/// A block of 20 × 10 × 6 cm, not about the origin.
mpm::Body tumbling_block() {
  mpm::Body body;
  for (int k = 0; k < 6; ++k) {
    for (int j = 0; j < 10; ++j) {
      for (int i = 0; i < 20; ++i) {
        body.rest.push_back(0.01 * Vec3d(i + 0.5, j + 0.5, k + 0.5) + Vec3d(0.1, 0.0, 0.3));
        body.volumes.push_back(1e-6);
      }
    }
  }
  return body;
}

/// Where a free body is and how it moves at a time: Euler's equations in its own axes by fourth
/// order Runge–Kutta in small steps.
RigidState flown(const Inertia& inertia, const RigidState& start, double time) {
  RigidState state = start;
  const Mat3d inverse = inertia.moment.inverse();
  const int steps = std::max(1, int(std::ceil(std::abs(time) / 1e-4)));
  const double h = time / steps;
  Eigen::Quaterniond q(start.rotation);
  Vec3d w = start.rotation.transpose() * start.spin;  // in its own axes
  const auto turn = [&](const Eigen::Quaterniond& at, const Vec3d& rate) {
    return Eigen::Vector4d(0.5 *
                           (at * Eigen::Quaterniond(0.0, rate.x(), rate.y(), rate.z())).coeffs());
  };
  const auto gain = [&](const Vec3d& rate) -> Vec3d {
    return inverse * (inertia.moment * rate).cross(rate);
  };
  const auto after = [](const Eigen::Quaterniond& at, const Eigen::Vector4d& by) {
    return Eigen::Quaterniond(Eigen::Vector4d(at.coeffs() + by));
  };
  for (int s = 0; s < steps; ++s) {
    const Eigen::Vector4d q1 = turn(q, w);
    const Vec3d w1 = gain(w);
    const Eigen::Vector4d q2 = turn(after(q, 0.5 * h * q1), w + 0.5 * h * w1);
    const Vec3d w2 = gain(w + 0.5 * h * w1);
    const Eigen::Vector4d q3 = turn(after(q, 0.5 * h * q2), w + 0.5 * h * w2);
    const Vec3d w3 = gain(w + 0.5 * h * w2);
    const Eigen::Vector4d q4 = turn(after(q, h * q3), w + h * w3);
    const Vec3d w4 = gain(w + h * w3);
    q = after(q, h / 6.0 * (q1 + 2.0 * q2 + 2.0 * q3 + q4)).normalized();
    w += h / 6.0 * (w1 + 2.0 * w2 + 2.0 * w3 + w4);
  }
  state.rotation = q.toRotationMatrix();
  state.spin = state.rotation * w;
  state.place = start.place + time * start.velocity + 0.5 * time * time * kPull;
  state.velocity = start.velocity + time * kPull;
  return state;
}

RigidState thrown() {
  RigidState state;
  state.place = Vec3d(0.4, 0.1, 1.0);
  state.rotation = Eigen::AngleAxisd(0.8, Vec3d(1.0, -1.0, 2.0).normalized()).toRotationMatrix();
  state.velocity = Vec3d(1.0, -0.5, 2.0);
  state.spin = Vec3d(9.0, 8.0, -6.0);
  return state;
}

/// Tracks of such a flight, as a camera that the observation stands for has seen it.
diagnose::Capture filmed(const Inertia& inertia, const mpm::Body& body, double noise, double late,
                         std::uint64_t seed = 3) {
  diagnose::Capture capture;
  for (std::size_t p = 0; p < body.rest.size(); p += 17) capture.rest.push_back(body.rest[p]);
  const Index tracks = capture.tracks();
  capture.positions.resize(3 * Index(kFramesOfFlight) * tracks);
  capture.use.assign(std::size_t(Index(kFramesOfFlight) * tracks), diagnose::Use::kUsed);
  std::mt19937_64 generator(seed);
  std::normal_distribution<double> normal(0.0, noise > 0.0 ? noise : 1.0);
  for (Index f = 0; f < kFramesOfFlight; ++f) {
    capture.times.push_back(double(f) / kRate);
    const RigidState state = flown(inertia, thrown(), double(f) / kRate + late);
    for (Index i = 0; i < tracks; ++i) {
      Vec3d x = state.place + state.rotation * (capture.rest[std::size_t(i)] - inertia.center);
      for (int a = 0; a < 3 && noise > 0.0; ++a) x[a] += normal(generator);
      capture.positions.segment<3>(3 * (f * tracks + i)) = x;
    }
  }
  return capture;
}

ShootingNode whole_flight(const diagnose::Capture& capture) {
  ShootingNode node;
  node.capture = &capture;
  node.frame = kFramesOfFlight - 1;
  node.last = kFramesOfFlight - 1;
  return node;
}

void expect_near(const RigidState& a, const RigidState& b, double place, double turn, double speed,
                 double spin) {
  EXPECT_LT((a.place - b.place).norm(), place);
  EXPECT_LT((a.rotation - b.rotation).norm(), turn);
  EXPECT_LT((a.velocity - b.velocity).norm(), speed);
  EXPECT_LT((a.spin - b.spin).norm(), spin);
}

/// A block of three different moments tumbles: its spin turns by several radians a second within
/// the flight.
TEST(ShootingNodes, AFlightTellsPlaceTurnVelocityAndSpin) {
  const mpm::Body body = tumbling_block();
  const Inertia inertia = inertia_of(body.rest, body.volumes);
  const double end = (kFramesOfFlight - 1) / kRate;
  const RigidState truth = flown(inertia, thrown(), end);
  EXPECT_GT((truth.spin - thrown().spin).norm(), 2.0);
  const diagnose::Capture exact = filmed(inertia, body, 0.0, 0.0);
  const auto state = flight_state(whole_flight(exact), inertia, end, {});
  ASSERT_TRUE(state);
  expect_near(*state, truth, 1e-9, 1e-4, 1e-7, 2e-3);
  const diagnose::Capture noisy = filmed(inertia, body, 1e-3, 0.0);
  const auto told = flight_state(whole_flight(noisy), inertia, end, {});
  ASSERT_TRUE(told);
  expect_near(*told, truth, 5e-4, 1e-2, 2e-2, 0.1);
}

/// What a state says of its errors is twice their deviation over draws of white noise, because a
/// tracker's errors last.
TEST(ShootingNodes, AStateKnowsItsNoise) {
  const mpm::Body body = tumbling_block();
  const Inertia inertia = inertia_of(body.rest, body.volumes);
  const double end = (kFramesOfFlight - 1) / kRate;
  const RigidState truth = flown(inertia, thrown(), end);
  constexpr double kSigma = 1e-3;
  constexpr int kDraws = 40;
  StateNoise seen;
  StateNoise said;
  for (std::uint64_t draw = 0; draw < kDraws; ++draw) {
    diagnose::Capture noisy = filmed(inertia, body, kSigma, 0.0, draw);
    noisy.noise = kSigma;
    const auto state = flight_state(whole_flight(noisy), inertia, end, {});
    ASSERT_TRUE(state);
    const Eigen::AngleAxisd turn(state->rotation * truth.rotation.transpose());
    seen.place += (state->place - truth.place).squaredNorm() / (3.0 * kDraws);
    seen.turn += turn.angle() * turn.angle() / (3.0 * kDraws);
    seen.velocity += (state->velocity - truth.velocity).squaredNorm() / (3.0 * kDraws);
    seen.spin += (state->spin - truth.spin).squaredNorm() / (3.0 * kDraws);
    said = state->noise;
  }
  EXPECT_NEAR(said.place / std::sqrt(seen.place), 2.0, 0.4);
  EXPECT_NEAR(said.velocity / std::sqrt(seen.velocity), 2.0, 0.4);
  // Turns are taken to err alike about all axes, which those of a block do not.
  EXPECT_NEAR(said.turn / std::sqrt(seen.turn), 2.0, 0.6);
  EXPECT_NEAR(said.spin / std::sqrt(seen.spin), 2.0, 1.0);
}

TEST(ShootingNodes, ErrorsAreAddedToAState) {
  RigidState state = thrown();
  const RigidState other =
      with_errors(state, {0.1, 0.0, 0.0, 0.0, 0.0, 0.2, 0.0, 0.3, 0.0, 0.0, 0.0, 0.4});
  EXPECT_LT((other.place - state.place - Vec3d(0.1, 0.0, 0.0)).norm(), 1e-12);
  const Mat3d turn = Eigen::AngleAxisd(0.2, Vec3d::UnitZ()).toRotationMatrix();
  EXPECT_LT((other.rotation - turn * state.rotation).norm(), 1e-12);
  EXPECT_LT((other.velocity - state.velocity - Vec3d(0.0, 0.3, 0.0)).norm(), 1e-12);
  EXPECT_LT((other.spin - state.spin - Vec3d(0.0, 0.0, 0.4)).norm(), 1e-12);
}

TEST(ShootingNodes, WhatACameraDidIsUndone) {
  const mpm::Body body = tumbling_block();
  const Inertia inertia = inertia_of(body.rest, body.volumes);
  const double end = (kFramesOfFlight - 1) / kRate;
  const RigidState truth = flown(inertia, thrown(), end);
  diagnose::Effect offset;
  offset.observation = diagnose::Observation::kTimeOffset;
  diagnose::Effect scale;
  scale.observation = diagnose::Observation::kScale;
  scale.pivot = Vec3d(1.0, 0.0, 0.0);
  constexpr double kLate = 0.01;
  diagnose::Capture seen = filmed(inertia, body, 0.0, kLate);
  for (Index s = 0; s < seen.samples(); ++s) {
    auto x = seen.positions.segment<3>(3 * s);
    x = Vec3d(scale.pivot + 1.05 * (x - scale.pivot));
  }
  const std::vector<diagnose::Observed> observations{{&offset, Eigen::VectorXd::Constant(1, kLate)},
                                                     {&scale, Eigen::VectorXd::Constant(1, 0.05)}};
  const auto state = flight_state(whole_flight(seen), inertia, end, observations);
  ASSERT_TRUE(state);
  expect_near(*state, truth, 1e-9, 1e-4, 1e-6, 3e-3);
}

TEST(ShootingNodes, ABodyIsTakenToTheState) {
  const mpm::Body body = tumbling_block();
  const Inertia inertia = inertia_of(body.rest, body.volumes);
  const diagnose::Capture capture = filmed(inertia, body, 0.0, 0.0);
  const ShootingNode node = whole_flight(capture);
  const auto state = flight_state(node, inertia, node.frame / kRate, {});
  ASSERT_TRUE(state);
  // Simulated: elsewhere, at rest.
  mpm::ObservedFrame::Body there;
  const Mat3d turn = Eigen::AngleAxisd(0.3, Vec3d::UnitY()).toRotationMatrix();
  Points seen;
  for (const Vec3d& x : body.rest) there.positions.push_back(turn * x);
  for (const Vec3d& x : capture.rest) seen.push_back(turn * x);
  there.velocities.assign(body.rest.size(), Vec3d(0.1, 0.0, 0.0));
  const mpm::RigidChange change = change_to(*state, node, inertia, seen, body.volumes, there);
  for (std::size_t p = 0; p < body.rest.size(); p += 101) {
    const Vec3d x =
        change.center + change.shift + change.rotation * (there.positions[p] - change.center);
    const Vec3d arm = state->rotation * (body.rest[p] - inertia.center);
    EXPECT_LT((x - state->place - arm).norm(), 1e-9);
    const Vec3d v = change.rotation * there.velocities[p] + change.velocity +
                    change.spin.cross(x - change.center - change.shift);
    EXPECT_LT((v - state->velocity - state->spin.cross(arm)).norm(), 1e-9);
  }
}

TEST(ShootingNodes, StandBetweenImpactsThatAFlightParts) {
  const mpm::Body body = tumbling_block();
  diagnose::Capture capture = filmed(inertia_of(body.rest, body.volumes), body, 0.0, 0.0);
  for (int f = kFramesOfFlight; f < 60; ++f) capture.times.push_back(f / kRate);
  const auto impact = [&](Index begin, Index end) {
    Impact result;
    result.capture = &capture;
    result.begin = begin;
    result.end = end;
    result.frame = int(end - 1);
    return result;
  };
  mpm::Scene scene;
  scene.fps = kRate;
  scene.end_frame = 60;
  // Two frames between the second and the third are no flight.
  const auto found =
      shooting_nodes({impact(10, 13), impact(20, 23), impact(25, 27), impact(50, 53)}, scene);
  ASSERT_EQ(found.size(), 2U);
  EXPECT_EQ(found[0].frame, 19);
  EXPECT_EQ(found[0].first, 13);
  EXPECT_EQ(found[1].frame, 49);
  EXPECT_EQ(found[1].first, 40);
}

}  // namespace
}  // namespace matterfit::job
