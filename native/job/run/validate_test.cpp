// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/run/validate.hpp"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>

#include "base/error.hpp"

namespace matterfit::job {
namespace {

using testing::HasSubstr;

std::string two_cubes(double x) {
  return R"({ "schema": "matterfit.job/1", "scene": { "frames": [0, 2],
    "particle_separation": 0.05, "bodies": [
      { "name": "left", "density": 1000, "source": { "box": { "low": [0,0,0.1],
        "high": [0.4,0.4,0.5] } }, "material": { "law": "fixed_corotated", "E": 1e4, "nu": 0.3 } },
      { "name": "right", "density": 1000, "source": { "box": { "low": [)" +
         std::to_string(x) + R"(,0.01,0.1], "high": [)" + std::to_string(x + 0.4) +
         R"(,0.41,0.5] } }, "material": { "law": "fixed_corotated", "E": 1e4, "nu": 0.3 } } ],
    "colliders": [ { "name": "ground", "shape": "ground" } ] } })";
}

std::string said(const std::string& text, std::vector<std::string> overrides = {}) {
  try {
    (void)validate_job(read_job(text, {{}, "job", std::move(overrides), {}}), {}, Interrupter{});
  } catch (const Error& error) {
    return error.what();
  }
  return "";
}

TEST(Validate, BodiesThatTouchAreSound) {
  EXPECT_EQ(said(two_cubes(0.4)), "");
  EXPECT_EQ(said(two_cubes(0.7)), "");
}

TEST(Validate, RefusesWhatLiesInEachOther) {
  EXPECT_THAT(said(two_cubes(0.3)), HasSubstr("Bodies 'left' and 'right' lie in each other"));
  // The middle of what they share is told to a tenth of a separation.
  EXPECT_THAT(said(two_cubes(0.0)), HasSubstr("lie in each other, about (0.2, 0.185, 0.3) m."));
  EXPECT_THAT(said(two_cubes(0.7), {"bodies[0].source.box.low[2]=-0.2"}),
              HasSubstr("inside 'ground'"));
}

// Two lattices whose particles stand in the middle of each other's cells, .87 separations apart.
TEST(Validate, RefusesWhatLiesBetweenTheParticles) {
  EXPECT_THAT(said(two_cubes(0.225), {R"(bodies[1].source.box.low=[0.225,0.025,0.125])",
                                      R"(bodies[1].source.box.high=[0.625,0.425,0.525])"}),
              HasSubstr("lie in each other"));
}

TEST(Validate, ReadsTheCapturesOfAFit) {
  const auto folder = std::filesystem::temp_directory_path() / fmt::format("validate_{}", getpid());
  std::filesystem::create_directories(folder);
  std::ofstream(folder / "damaged.npz") << "no archive";
  const std::string file = (folder / "damaged.npz").string();
  const std::vector<std::string> fit = {"task=fit",
                                        R"(fit={"parameters":["bodies.left.material.E"]})",
                                        R"(captures=[{"tracks":")" + file + R"(","body":"left"}])"};
  EXPECT_THAT(said(two_cubes(0.7), fit), HasSubstr("captures[0]"));
  // A task that does not look at them does not read them.
  EXPECT_EQ(said(two_cubes(0.7), {"task=simulate", fit[2]}), "");
  const std::vector<std::string> film = {
      "task=fit", fit[1], R"(captures=[{"cameras":")" + (folder / "c.json").string() + R"("}])"};
  EXPECT_THAT(said(two_cubes(0.7), film), HasSubstr("captures[0]"));
  EXPECT_THAT(said(two_cubes(0.7), {"task=fit", fit[1]}), HasSubstr("at least one capture"));
  EXPECT_THAT(said(two_cubes(0.7), {"task=check", fit[1], film[2]}),
              HasSubstr("tracks are needed here"));
  std::filesystem::remove_all(folder);
}

TEST(Validate, BodiesMayFitIntoEachOther) {
  // A peg, one particle wide, on a cube.
  EXPECT_EQ(said(two_cubes(0.4), {R"(bodies[1].source.box.low=[0.2,0.2,0.5])",
                                  R"(bodies[1].source.box.high=[0.25,0.25,0.8])"}),
            "");
  // Turned by an eighth, the edge against a face.
  EXPECT_EQ(said(two_cubes(0.4), {R"(bodies[1].source.box.low=[-0.2,-0.2,-0.2])",
                                  R"(bodies[1].source.box.high=[0.2,0.2,0.2])",
                                  R"(bodies[1].placement={"position":[0.6829,0.2,0.3],)"
                                  R"("rotation":[0.92388,0,0,0.38268]})"}),
            "");
}

// Particles of .05 m: what is in the ground by a layer of them would be torn.
TEST(Validate, ABodyMayRestInAColliderByAFractionOfAParticle) {
  const auto sunk = [](const std::string& depth) {
    return said(two_cubes(0.7), {"colliders[0].height=" + depth});
  };
  EXPECT_EQ(sunk("0.13"), "");
  EXPECT_THAT(sunk("0.15"), HasSubstr("Body 'left' starts up to 0.05 m inside 'ground'"));
  EXPECT_THAT(sunk("0.2"), HasSubstr("starts up to 0.1 m inside 'ground'"));
}

TEST(Validate, RefusesAMeshThatIsFarFromItsOrigin) {
  const auto file = std::filesystem::temp_directory_path() /
                    fmt::format("matterfit_far_{}.obj", static_cast<long>(getpid()));
  std::ofstream(file) << "v 1e12 0 0\nv 1.1e12 0 0\nv 1e12 1e11 0\nv 1e12 0 1e11\n"
                         "f 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n";
  EXPECT_THAT(
      said(two_cubes(0.7), {R"(bodies[1].source={"mesh":")" + file.generic_string() + R"("})"}),
      HasSubstr("scene.bodies[1].source: its shape lies up to 1.1e+12 m from its origin"));
  std::filesystem::remove(file);
}

TEST(Validate, RefusesAFitWithoutItsSection) {
  const Job job = read_job(two_cubes(0.7), {{}, "job", {}, Task::kFit});
  EXPECT_THAT([&] { validate_job(job, {}, Interrupter{}); },
              testing::ThrowsMessage<Error>(HasSubstr("'fit' is missing")));
}

TEST(Validate, RefusesWhatIsMissing) {
  EXPECT_THAT(said(two_cubes(0.7), {R"(bodies[1].source={"mesh":"gone.ply"})"}),
              testing::AllOf(HasSubstr("scene.bodies[1].source.mesh"), HasSubstr("gone.ply"),
                             HasSubstr("does not exist")));
  EXPECT_THAT(said(two_cubes(0.7), {R"(bodies[1].source={"mesh":"."})"}),
              testing::AllOf(HasSubstr("scene.bodies[1].source.mesh"), HasSubstr("is a folder")));
  EXPECT_THAT(said(two_cubes(0.7), {R"(captures=[{"body":"left","tracks":"gone.npz"}])"}),
              testing::AllOf(HasSubstr("captures[0].tracks"), HasSubstr("gone.npz"),
                             HasSubstr("no such file")));
}

}  // namespace
}  // namespace matterfit::job
