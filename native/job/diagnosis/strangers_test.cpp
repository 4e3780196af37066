// SPDX-License-Identifier: GPL-3.0-or-later
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <string>
#include <vector>

#include "job/diagnosis/report_for_test.hpp"
#include "job/fit_fixture_for_test.hpp"
#include "job/new_job.hpp"

/// Recordings that another discretisation made, masses and springs, with an effect hidden in them,
/// as a stranger would send them: tracks of a mesh's vertices with its faces, noise in every frame,
/// points that are lost now and then. `new-job` and `diagnose` know the file alone.
namespace matterfit::job {
namespace {

using namespace fit_test;

constexpr int kAcross = 5;  // masses along an edge
constexpr double kEdge = 0.4;
constexpr double kFps = 30.0;
constexpr int kStrangerFrames = 20;
constexpr double kSigma = 4e-4;  // of a coordinate [m]
constexpr double kLost = 0.05;

/// What the truth has and the scene does not.
struct Hidden {
  double gravity = 9.81;
  double drag = 0.0;             // of |v| v, a mass [1/m]
  double delay = 0.0;            // of all frames but the first [frames]
  std::size_t swapped_from = 0;  // frame from which two vertices go on as each other; 0: none
};

/// A cube of masses on a lattice, springs between neighbours along edges and diagonals.
class Springs {
 public:
  Springs() {
    for (int i = 0; i < kAcross * kAcross * kAcross; ++i) {
      const Vec3d at(i % kAcross, i / kAcross % kAcross, i / kAcross / kAcross);
      x_.push_back(kEdge / (kAcross - 1) * at + Vec3d(0.0, 0.0, 3.0));
      const Vec3d arm = x_.back() - Vec3d(0.5 * kEdge, 0.5 * kEdge, 3.0 + 0.5 * kEdge);
      v_.push_back(Vec3d(5.0, 2.0, 1.5) + Vec3d(0.6, -1.0, 0.8).cross(arm));
    }
    for (std::size_t a = 0; a < x_.size(); ++a) {
      for (std::size_t b = a + 1; b < x_.size(); ++b) {
        const double length = (x_[b] - x_[a]).norm();
        if (length < 1.8 * kEdge / (kAcross - 1)) springs_.push_back({a, b, length});
      }
    }
  }

  [[nodiscard]] const Points& positions() const { return x_; }

  void step(double dt, const Hidden& hidden) {
    constexpr double kStiffness = 2000.0;  // a mass [1/s²]
    std::vector<Vec3d> a(x_.size(), Vec3d(0.0, 0.0, -hidden.gravity));
    for (const Spring& s : springs_) {
      const Vec3d d = x_[s.b] - x_[s.a];
      const Vec3d pull = kStiffness * (1.0 - s.length / d.norm()) * d;
      a[s.a] += pull;
      a[s.b] -= pull;
    }
    for (std::size_t i = 0; i < x_.size(); ++i) {
      a[i] -= hidden.drag * v_[i].norm() * v_[i];
      v_[i] += dt * a[i];
      x_[i] += dt * v_[i];
    }
  }

 private:
  struct Spring {
    std::size_t a;
    std::size_t b;
    double length;
  };
  Points x_;
  std::vector<Vec3d> v_;
  std::vector<Spring> springs_;
};

/// Vertices of the surface, by their masses, and its faces over them.
struct Skin {
  std::vector<std::size_t> masses;
  std::vector<std::int32_t> faces;

  Skin() {
    std::vector<std::int32_t> vertex(kAcross * kAcross * kAcross, -1);
    const auto index = [&](std::array<int, 3> at) {
      const std::size_t mass = std::size_t(at[0] + kAcross * (at[1] + kAcross * at[2]));
      if (vertex[mass] < 0) {
        vertex[mass] = std::int32_t(masses.size());
        masses.push_back(mass);
      }
      return vertex[mass];
    };
    for (std::size_t axis = 0; axis < 3; ++axis) {
      for (const int side : {0, kAcross - 1}) {
        for (int i = 0; i + 1 < kAcross; ++i) {
          for (int j = 0; j + 1 < kAcross; ++j) {
            std::array<std::array<int, 2>, 4> ring{
                {{i, j}, {i + 1, j}, {i + 1, j + 1}, {i, j + 1}}};
            if (side == 0) std::reverse(ring.begin(), ring.end());
            for (const auto& corner : ring) {
              std::array<int, 3> at{};
              at[axis] = side;
              at[(axis + 1) % 3] = corner[0];
              at[(axis + 2) % 3] = corner[1];
              faces.push_back(index(at));
            }
          }
        }
      }
    }
  }
};

void record_stranger(const fs::path& file, const Hidden& hidden, unsigned seed) {
  const Skin skin;
  Springs body;
  std::mt19937_64 generator(seed);
  std::normal_distribution<double> normal(0.0, kSigma);
  std::uniform_real_distribution<double> unit(0.0, 1.0);
  constexpr int kSubsteps = 200;
  const int late = int(std::lround(hidden.delay * kSubsteps));
  std::vector<double> positions;
  std::vector<double> times;
  std::vector<std::uint8_t> visible;
  for (int frame = 0; frame < kStrangerFrames; ++frame) {
    const int steps = frame == 0 ? 0 : kSubsteps + (frame == 1 ? late : 0);
    for (int s = 0; s < steps; ++s) body.step(1.0 / kFps / kSubsteps, hidden);
    times.push_back(frame / kFps);
    for (const std::size_t mass : skin.masses) {
      const bool seen = frame == 0 || unit(generator) > kLost;
      visible.push_back(seen ? 1 : 0);
      for (int axis = 0; axis < 3; ++axis) {
        const double noise = normal(generator);
        positions.push_back(seen ? body.positions()[mass][axis] + noise
                                 : std::numeric_limits<double>::quiet_NaN());
      }
    }
  }
  const std::size_t frames = times.size();
  const std::size_t points = skin.masses.size();
  if (hidden.swapped_from > 0) {
    for (std::size_t f = hidden.swapped_from; f < frames; ++f) {
      for (std::size_t axis = 0; axis < 3; ++axis) {
        std::swap(positions[3 * (points * f + 7) + axis], positions[3 * (points * f + 30) + axis]);
      }
      std::swap(visible[points * f + 7], visible[points * f + 30]);
    }
  }
  capture::Arrays arrays;
  arrays["positions"] = capture::Array({frames, points, 3}, positions);
  arrays["times"] = capture::Array({frames}, times);
  arrays["visible"] = capture::Array({frames, points}, visible);
  arrays["faces"] = capture::Array({skin.faces.size() / 4, 4}, skin.faces);
  capture::write_npz(file, arrays);
}

Json diagnosed(const Folder& folder, const Hidden& hidden, unsigned seed) {
  record_stranger(folder.path / "cube.npz", hidden, seed);
  NewJobOptions fresh;
  fresh.capture = folder.path / "cube.npz";
  fresh.output = folder.path / "job.json";
  fresh.density = 20.0;
  fresh.noise = kSigma;
  write_new_job(fresh);
  Json document = read_json(fresh.output);
  document["task"] = "diagnose";
  document["scene"]["particle_separation"] = 0.1;  // no grid is too coarse for a flight
  document["diagnose"] = {{"members", 12}};
  return run(document, folder.path);
}

TEST(Strangers, NothingHiddenIsNothingFound) {
  const Folder folder;
  const Json report = diagnosed(folder, {}, 1);
  EXPECT_EQ(report.at("verdict"), "nothing") << report.at("sentence");
}

TEST(Strangers, AirIsFoundAndPaysOnWhatWasHeldOut) {
  const Folder folder;
  Hidden hidden;
  hidden.drag = 0.05;
  const Json report = diagnosed(folder, hidden, 2);
  EXPECT_TRUE(names(report, "drag_quadratic") || names(report, "drag_linear"))
      << report.at("sentence");
  ASSERT_TRUE(report.contains("model")) << report.at("sentence");
  const Json& cause = cause_of(report, report.at("class").at(0).get<std::string>());
  EXPECT_GT(cause.at("gain").get<double>(), 0.5) << report.at("sentence");
}

/// They are put right before anything is fitted, and said.
TEST(Strangers, SwappedTracksAreFoundAndExchanged) {
  const Folder folder;
  Hidden hidden;
  hidden.swapped_from = 9;
  const Json report = diagnosed(folder, hidden, 1);
  EXPECT_EQ(report.at("verdict"), "measurement") << report.at("sentence");
  EXPECT_EQ(report.at("class"), Json({"swapped_tracks"}));
  EXPECT_LT(report.at("residual").at("train").at("rms").get<double>(), 3.0 * kSigma);
  const Json extended = read_json(folder.path / "job_out/extended.json");
  const Json& swaps = extended.at("captures").at(0).at("swaps");
  ASSERT_EQ(swaps.size(), 1U);
  EXPECT_NEAR(swaps[0].at("sample").get<double>(), 9.0, 2.0);  // where both are seen
  EXPECT_EQ(swaps[0].at("tracks"), Json({7, 30}));
}

/// What a camera did becomes a key of the capture.
TEST(Strangers, ALateClockIsFoundAndWrittenIntoTheCapture) {
  const Folder folder;
  Hidden hidden;
  hidden.delay = 0.3;
  const Json report = diagnosed(folder, hidden, 3);
  EXPECT_TRUE(names(report, "time_offset")) << report.at("sentence");
  const Json extended = read_json(folder.path / "job_out/extended.json");
  EXPECT_NEAR(extended.at("captures").at(0).at("start_frame").get<double>(), hidden.delay, 0.05);
}

}  // namespace
}  // namespace matterfit::job
