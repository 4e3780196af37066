// SPDX-License-Identifier: GPL-3.0-or-later
// What a problem says of its residuals without a simulation: how many count as independent, and
// which block of the data each belongs to.
#include "fit/model/capture_problem.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <random>
#include <set>

#include "fit/data/capture_marks.hpp"
#include "fit/model/predictor.hpp"

namespace matterfit::fit {
namespace {

constexpr std::size_t kProblemFrames = 40;
constexpr double kProblemFps = 50.0;

/// A recording of a cube at rest: so many points a side, over kProblemFrames frames.
class ProblemOfTracks {
 public:
  explicit ProblemOfTracks(std::size_t side, std::size_t frames = kProblemFrames)
      : experiment_(of(side, frames)),
        predictor_(experiment_, {}, {}, interrupter_),
        window_(first_window(predictor_.runs(), frames)),
        problem(predictor_.model(), predictor_.runs(), {}, Loss::kTracks, window_,
                used_samples(predictor_.runs())),
        points(side * side * side) {}

  /// Residuals of all samples but the first frame's, which says where the points are.
  template <class At>
  [[nodiscard]] Eigen::VectorXd residuals(const At& at) const {
    const std::size_t count = problem.blocks().size() / 3;
    Eigen::VectorXd all(Eigen::Index(3 * count));
    for (std::size_t i = 0; i < count; ++i) {
      all.segment<3>(Eigen::Index(3 * i)) = at(i / points, i % points);
    }
    return all;
  }

 private:
  static Experiment of(std::size_t side, std::size_t frames) {
    Run run;
    run.build = [](double, Arena&, const Interrupter&) {
      mpm::Scene scene;
      scene.fps = kProblemFps;
      scene.end_frame = 100;
      scene.dx = 0.1;
      mpm::Body body;
      body.name = "cube";
      body.lattice.spacing = 0.05;
      body.rest = {Vec3d::Zero(), Vec3d(0.05, 0.0, 0.0)};
      body.volumes.assign(2, 1.25e-4);
      scene.bodies.push_back(std::move(body));
      return scene;
    };
    run.clock = {kProblemFps, 0, 100};
    run.fitted = true;
    Capture capture;
    CaptureInput& input = capture.input;
    input.name = "a";
    input.body = "cube";
    for (std::size_t i = 0; i < side; ++i) {
      for (std::size_t j = 0; j < side; ++j) {
        for (std::size_t k = 0; k < side; ++k) {
          input.rest.emplace_back(0.05 * double(i), 0.05 * double(j), 0.05 * double(k));
        }
      }
    }
    input.tracks.points = input.rest.size();
    input.rest_samples.assign(input.rest.size(), 1);
    input.held_out_points.assign(input.rest.size(), 0);
    input.held_out_frames.assign(frames, 0);
    for (std::size_t t = 0; t < frames; ++t) {
      input.tracks.times.push_back(double(t) / kProblemFps);
      input.tracks.positions.insert(input.tracks.positions.end(), input.rest.begin(),
                                    input.rest.end());
    }
    capture.sigma.assign(input.rest.size(), 1e-3);
    mark_used(capture, run.clock);
    run.captures.push_back(std::move(capture));
    Experiment all;
    all.runs.push_back(std::move(run));
    return all;
  }

  Interrupter interrupter_;
  Experiment experiment_;
  Predictor predictor_;
  Window window_;

 public:
  CaptureProblem problem;
  std::size_t points;
};

/// Independent components of variance 1.
class NormalVectors {
 public:
  explicit NormalVectors(unsigned seed) : random_(seed) {}
  Vec3d operator()() {
    const double x = normal_(random_);
    const double y = normal_(random_);
    return {x, y, normal_(random_)};
  }

 private:
  std::mt19937 random_;
  std::normal_distribution<double> normal_;
};

TEST(CaptureProblem, IndependentResidualsAllCount) {
  const ProblemOfTracks of(4);
  NormalVectors random(1);
  const Eigen::VectorXd noise = of.residuals([&](std::size_t, std::size_t) { return random(); });
  EXPECT_GT(of.problem.effective(noise), 0.8 * double(noise.size()));
  EXPECT_LE(of.problem.effective(noise), double(noise.size()));
}

TEST(CaptureProblem, ResidualsThatAreTheSameEverywhereCountAsOneVector) {
  const ProblemOfTracks of(3);
  const Eigen::VectorXd same =
      of.residuals([](std::size_t, std::size_t) { return Vec3d(1.0, 2.0, 3.0); });
  EXPECT_DOUBLE_EQ(of.problem.effective(same), 3.0);
  EXPECT_EQ(of.problem.effective(Eigen::VectorXd::Zero(same.size())), 0.0);
}

TEST(CaptureProblem, WhatMovesAllPointsOfAFrameAlikeCountsOnceAFrame) {
  const ProblemOfTracks of(4);
  NormalVectors random(2);
  std::vector<Vec3d> shift(kProblemFrames);
  for (Vec3d& one : shift) one = random();
  const Eigen::VectorXd moved =
      of.residuals([&](std::size_t frame, std::size_t) { return shift[frame]; });
  const double frames = double(moved.size()) / double(3 * of.points);
  EXPECT_LT(of.problem.effective(moved), 3.0 * frames + 1e-9);
  EXPECT_GT(of.problem.effective(moved), 1.5 * frames);
}

TEST(CaptureProblem, WhatLastsFromFrameToFrameCountsByItsCorrelation) {
  const ProblemOfTracks of(6);
  constexpr double kCorrelation = 0.6;
  NormalVectors random(3);
  std::vector<Vec3d> state(of.points);
  for (Vec3d& one : state) one = random();
  const Eigen::VectorXd slow = of.residuals([&](std::size_t, std::size_t point) {
    state[point] =
        kCorrelation * state[point] + std::sqrt(1.0 - kCorrelation * kCorrelation) * random();
    return state[point];
  });
  const double share = (1.0 - kCorrelation) / (1.0 + kCorrelation);
  EXPECT_NEAR(of.problem.effective(slow) / double(slow.size()), share, 0.1 * share);
}

TEST(CaptureProblem, BlocksAreStretchesOfTimeByPartsOfTheBody) {
  const ProblemOfTracks of(4);
  const std::vector<std::uint32_t> blocks = of.problem.blocks();
  EXPECT_EQ(blocks.size() % (3 * of.points), 0U);
  EXPECT_EQ(std::set<std::uint32_t>(blocks.begin(), blocks.end()).size(), 64U);
  // The three components of a sample lie in one block; opposite corners of the cube do not.
  EXPECT_TRUE(blocks[0] == blocks[1] && blocks[1] == blocks[2]);
  EXPECT_NE(blocks.front(), blocks[3 * (of.points - 1)]);
  // A part of the body is 8 of its 64 points, all near each other.
  EXPECT_EQ(std::count(blocks.begin(), blocks.begin() + std::ptrdiff_t(3 * of.points), blocks[0]),
            3 * 8);
  EXPECT_NE(blocks.front(), blocks[blocks.size() - 3 * of.points]) << "the last stretch of time";
}

TEST(CaptureProblem, FewPointsAreOnePartOfTheBody) {
  const ProblemOfTracks of(2);
  const std::vector<std::uint32_t> blocks = of.problem.blocks();
  EXPECT_EQ(std::set<std::uint32_t>(blocks.begin(), blocks.end()).size(), 8U);
}

}  // namespace
}  // namespace matterfit::fit
