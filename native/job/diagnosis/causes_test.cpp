// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/diagnosis/causes.hpp"

#include <gtest/gtest.h>

#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <memory>
#include <stdexcept>
#include <tuple>

#include "job/fit_fixture_for_test.hpp"
#include "job/run/build_scene.hpp"
#include "mpm/simulation.hpp"

namespace matterfit::job {
namespace {

using namespace fit_test;

/// A cube of 64 particles that slides and turns on the ground; its document says nothing of
/// damping.
Json sliding_cube() {
  Json document = thrown_cube();
  Json& scene = document["scene"];
  scene["frames"] = {0, 8};
  scene["particle_separation"] = 0.1;
  scene["bodies"][0]["source"]["box"] = {{"low", {0.0, 0.0, 0.02}}, {"high", {0.4, 0.4, 0.42}}};
  return document;
}

mpm::Scene scene_of(const Json& document) {
  Arena arena(1);
  return build_scene(job_of(document, {}), arena, Interrupter{}).scene;
}

/// Positions of all particles in the last frame.
std::vector<Vec3d> moved(mpm::Scene scene, int substeps) {
  const int end = scene.end_frame;
  scene.substeps.assign(std::size_t(end - scene.first_frame), substeps);
  mpm::Simulation simulation(std::move(scene), std::make_shared<Arena>(1));
  while (simulation.frame() + 1 < end) (void)simulation.advance(Interrupter{});
  return simulation.observe(false).bodies.front().positions;
}

double apart(const std::vector<Vec3d>& a, const std::vector<Vec3d>& b) {
  double most = a.size() == b.size() ? 0.0 : 1e300;
  for (std::size_t i = 0; i < std::min(a.size(), b.size()); ++i) {
    most = std::max(most, (a[i] - b[i]).norm());
  }
  return most;
}

std::vector<Cause> causes_of(const Json& document) {
  return scene_causes(job_of(document, {}), scene_of(document), {});
}

int variants_of(const Cause& cause) { return std::max(1, int(cause.row.variants.size())); }

constexpr int kStepsAFrame = 60;

TEST(Causes, AtTheirNeutralValuesNothingChanges) {
  const Json document = sliding_cube();
  const mpm::Scene scene = scene_of(document);
  const std::vector<Vec3d> without = moved(scene, kStepsAFrame);
  for (const Cause& cause : causes_of(document)) {
    if (!cause.apply) continue;
    std::vector<double> neutral;
    for (const diagnose::Number& number : cause.row.numbers) neutral.push_back(number.neutral);
    for (int v = 0; v < variants_of(cause); ++v) {
      mpm::Scene there = scene;
      cause.apply(neutral, v, there);
      EXPECT_LT(apart(moved(there, kStepsAFrame), without), 1e-5 * kSize)
          << cause.row.name << " " << v;
    }
  }
}

/// The extended document is the model that was refitted.
TEST(Causes, AreWrittenAsTheyAct) {
  const Json document = sliding_cube();
  const mpm::Scene scene = scene_of(document);
  const std::vector<Vec3d> without = moved(scene, kStepsAFrame);
  int acting = 0;
  for (const Cause& cause : causes_of(document)) {
    if (!cause.apply) continue;
    std::vector<double> values;
    for (const diagnose::Number& n : cause.row.numbers) {
      values.push_back(std::min(n.neutral + n.scale, n.high));
    }
    mpm::Scene there = scene;
    cause.apply(values, 0, there);
    Json extended = document;
    cause.write(values, 0, extended["scene"]);
    const std::vector<Vec3d> applied = moved(there, kStepsAFrame);
    EXPECT_LT(apart(applied, moved(scene_of(extended), kStepsAFrame)), 1e-4 * kSize)
        << cause.row.name;
    acting += apart(applied, without) > 1e-4 * kSize ? 1 : 0;
  }
  EXPECT_GT(acting, 10);
}

/// A wind takes the numbers of the drag it stands beside, in the scene as in the document.
TEST(Causes, WindTakesTheNumbersOfTheDrag) {
  for (const Json& coefficient :
       {Json(), Json(2.0), Json{{"frames", {0, 4}}, {"values", {1.0, 3.0}}}, Json(0.0)}) {
    Json document = sliding_cube();
    if (!coefficient.is_null()) {
      document["scene"]["effects"] = {
          {{"effect", "drag_quadratic"}, {"drag_coefficient", coefficient}, {"air_density", 80.0}}};
    }
    const std::vector<Cause> causes = causes_of(document);
    const auto wind = std::ranges::find(causes, "wind", [](const Cause& c) { return c.row.name; });
    ASSERT_NE(wind, causes.end());
    EXPECT_EQ(wind->row.beside, coefficient.is_null() ? "drag_quadratic" : "");
    mpm::Scene there = scene_of(document);
    Json extended = document;
    if (coefficient.is_null()) {
      const auto drag =
          std::ranges::find(causes, "drag_quadratic", [](const Cause& c) { return c.row.name; });
      drag->apply(std::vector<double>{3.0}, 0, there);
      drag->write(std::vector<double>{3.0}, 0, extended["scene"]);
    }
    const std::vector<double> blows{6.0, 2.0, 0.0};
    const std::vector<Vec3d> calm = moved(there, kStepsAFrame);
    wind->apply(blows, 0, there);
    wind->write(blows, 0, extended["scene"]);
    const std::vector<Vec3d> applied = moved(there, kStepsAFrame);
    EXPECT_LT(apart(applied, moved(scene_of(extended), kStepsAFrame)), 1e-6 * kSize);
    EXPECT_EQ(there.effects.back().values[3], there.effects.front().values[0]);
    EXPECT_EQ(apart(applied, calm) > 1e-6 * kSize, coefficient != 0.0) << coefficient;
  }
}

const Cause& named(const std::vector<Cause>& causes, const std::string& name) {
  const auto found =
      std::ranges::find_if(causes, [&](const Cause& cause) { return cause.row.name == name; });
  if (found == causes.end()) throw std::runtime_error(name);
  return *found;
}

/// A floor that holds what touches it may let go, one that is free of friction may rub; both become
/// a contact with friction, in the scene and in the document.
TEST(Causes, AContactMayBeOfAnotherKind) {
  for (const auto& [kind, value, mu] :
       {std::tuple{"glue", 0.8, 0.25}, {"no_slip", 0.8, 0.25}, {"slip", 0.25, 0.25}}) {
    Json document = sliding_cube();
    document["scene"]["colliders"][0]["contact"] = {{"kind", kind}};
    const std::vector<Cause> causes = causes_of(document);
    const Cause& cause = named(causes, "contact_kind");
    for (const double start : cause.row.tries) {
      EXPECT_GT(start, 0.0);
      EXPECT_LE(start, cause.row.numbers[0].high);
    }
    mpm::Scene scene = scene_of(document);
    cause.apply(std::vector{value}, 0, scene);
    EXPECT_EQ(scene.colliders.front()->contact().kind, shape::ContactKind::kFriction);
    EXPECT_NEAR(scene.colliders.front()->contact().mu, mu, 1e-12);
    cause.write(std::vector{value}, 0, document["scene"]);
    const mpm::Scene written = scene_of(document);
    EXPECT_EQ(written.colliders.front()->contact().kind, shape::ContactKind::kFriction);
    EXPECT_NEAR(written.colliders.front()->contact().mu, mu, 1e-12);
  }
}

/// A steady acceleration of all that is seen is gravity's; the slowest shaking that is looked for
/// is none of it, nor a throw. What is written moves the body as it was moved.
TEST(Causes, ShakingIsNoGravity) {
  Json document = sliding_cube();
  document["scene"].erase("colliders");
  CauseOptions options;
  options.duration = 15.0 / 24.0;
  const mpm::Scene scene = scene_of(document);
  const std::vector<Cause> causes = scene_causes(job_of(document, {}), scene, options);
  const Cause& cause = named(causes, "frame_acceleration");
  ASSERT_EQ(cause.row.numbers.size(), 6U);
  ASSERT_EQ(cause.row.variants.size(), 4U);
  EXPECT_EQ(cause.row.variants.front(), "3.2 times a second");
  EXPECT_EQ(cause.row.variants.back(), "6 times a second");
  // The path of the centre by what is changed, frames × axes as one column.
  const auto path = [&](mpm::Scene there) {
    const int end = there.end_frame;
    there.substeps.assign(std::size_t(end - there.first_frame), kStepsAFrame);
    mpm::Simulation simulation(std::move(there), std::make_shared<Arena>(1));
    Eigen::VectorXd result(3 * end);
    for (int frame = 0; frame < end; ++frame) {
      if (frame > 0) (void)simulation.advance(Interrupter{});
      const auto seen = simulation.observe(false);
      Vec3d sum = Vec3d::Zero();
      for (const Vec3d& x : seen.bodies.front().positions) sum += x;
      result.segment<3>(3 * Eigen::Index(frame)) =
          sum / double(seen.bodies.front().positions.size());
    }
    return result;
  };
  const Eigen::VectorXd plain = path(scene);
  Eigen::MatrixXd imitation(plain.size(), 6);  // by gravity and the throw
  for (int axis = 0; axis < 3; ++axis) {
    mpm::Scene there = scene;
    there.gravity.values.front()[axis] += 1.0;
    imitation.col(axis) = path(there) - plain;
    there = scene;
    there.bodies.front().velocity[axis] += 1.0;
    imitation.col(3 + axis) = path(there) - plain;
  }
  for (std::size_t k = 0; k < 6; ++k) {
    std::vector<double> values(6, 0.0);
    values[k] = 1.0;
    mpm::Scene there = scene;
    cause.apply(values, 0, there);
    const Eigen::VectorXd column = path(there) - plain;
    const Eigen::VectorXd left = column - imitation * imitation.colPivHouseholderQr().solve(column);
    EXPECT_GT(left.norm(), 0.1 * column.norm()) << k;
    Json extended = document;
    cause.write(values, 0, extended["scene"]);
    EXPECT_LT((path(scene_of(extended)) - plain - column).norm(), 1e-3 * column.norm()) << k;
  }
  document["scene"]["effects"] = {{{"effect", "frame_acceleration"}, {"acceleration", {1, 0, 0}}}};
  EXPECT_THROW((void)named(causes_of(document), "frame_acceleration"), std::runtime_error);
}

/// Loss per cycle of a material's branches [Pa] at a number of cycles a second.
double loss(const material::Material& material, double frequency) {
  double sum = 0.0;
  for (const auto& branch : material.maxwell) {
    const double turn = 2.0 * 3.141592653589793 * frequency * branch.time;
    sum += branch.modulus * turn / (1.0 + turn * turn);
  }
  return sum;
}

/// A spectrum of branches loses about as much an octave higher, where a single one does not.
TEST(Causes, ASpectrumOfRelaxationLosesAlikeAtEveryFrequency) {
  const Json document = sliding_cube();
  CauseOptions options;
  options.duration = 2.0;
  const std::vector<Cause> causes = scene_causes(job_of(document, {}), scene_of(document), options);
  const Cause& cause = named(causes, "relaxation");
  const auto change = [&](int variant, double frequency) {
    mpm::Scene scene = scene_of(document);
    cause.apply(std::vector{1e3}, variant, scene);
    const material::Material& material = scene.bodies.front().material;
    return loss(material, 2.0 * frequency) / loss(material, frequency);
  };
  const int spectrum = variants_of(cause) - 1;
  for (const double frequency : {1.0, 2.0, 4.0}) {
    EXPECT_NEAR(change(spectrum, frequency), 1.0, 0.2) << frequency;
  }
  EXPECT_GT(std::abs(change(1, 1.0) - 1.0), 0.5);
  Json extended = document;
  cause.write(std::vector{1e3}, spectrum, extended["scene"]);
  const auto& written = scene_of(extended).bodies.front().material.maxwell;
  mpm::Scene scene = scene_of(document);
  cause.apply(std::vector{1e3}, spectrum, scene);
  const auto& applied = scene.bodies.front().material.maxwell;
  ASSERT_EQ(applied.size(), 4U);
  ASSERT_EQ(written.size(), applied.size());
  for (std::size_t k = 0; k < applied.size(); ++k) {
    EXPECT_EQ(written[k].modulus, applied[k].modulus);
    EXPECT_NEAR(written[k].time, applied[k].time, 1e-12 * applied[k].time);
  }
}

/// In the camera's axes, in which the body stands, gravity and ground lean together.
TEST(Causes, ARolledCameraLeansAllButTheBody) {
  Json document = sliding_cube();
  const std::vector<Cause> causes = causes_of(document);
  const Cause& cause = named(causes, "camera_roll");
  EXPECT_EQ(cause.row.group, "measurement");
  const double angle = 0.05;
  mpm::Scene scene = scene_of(document);
  const double g = scene.gravity.values.front().norm();
  cause.apply(std::vector{angle, 0.0}, 0, scene);
  const Vec3d up(0.0, -std::sin(angle), std::cos(angle));
  EXPECT_LT((scene.gravity.values.front() + g * up).norm(), 1e-12 * g);
  const Vec3d above(0.3, 0.1, 1.0);
  EXPECT_LT((scene.colliders.front()->closest(above, 0.0).normal - up).norm(), 1e-12);
  // The ground keeps its height below the body, where the camera's axes are laid.
  EXPECT_NEAR(scene.colliders.front()->closest(Vec3d(0.2, 0.2, 0.0), 0.0).distance, 0.0, 1e-12);
  // A wall is not turned along, so nothing is said of the camera there.
  document["scene"]["colliders"].push_back({{"name", "wall"},
                                            {"shape", "plane"},
                                            {"point", {3.0, 0.0, 0.0}},
                                            {"normal", {-1.0, 0.0, 0.0}}});
  const std::vector<Cause> beside = causes_of(document);
  EXPECT_FALSE(
      std::ranges::any_of(beside, [](const Cause& c) { return c.row.name == "camera_roll"; }));
}

/// A parameter of the law is a cause where no fit moves it, and none where one does.
TEST(Causes, WhatTheSceneStatesOfAMaterialMayBeWrong) {
  const Json document = sliding_cube();
  const mpm::Scene scene = scene_of(document);
  const Cause stiffness = named(causes_of(document), "material.E");
  mpm::Scene there = scene;
  stiffness.apply(std::vector{500.0}, 0, there);
  const double before = scene.bodies.front().material.youngs_modulus;
  EXPECT_NEAR(there.bodies.front().material.youngs_modulus, before + 500.0, 1e-9);
  CauseOptions options;
  options.fitted.resize(1);
  options.fitted[0].quantity = &fit::row_named(fit::Owner::kBody, "material.E");
  options.fitted[0].owner = "cube";
  const std::vector<Cause> others = scene_causes(job_of(document, {}), scene, options);
  EXPECT_THROW((void)named(others, "material.E"), std::runtime_error);
  EXPECT_NO_THROW((void)named(others, "material.nu"));
}

/// An elastic body that yields is one of von Mises in its own formulation: far above what the
/// motion reaches it moves as before but for the elastic law's own form, low it keeps a dent.
TEST(Causes, AYieldingBodyKeepsItsFormulation) {
  const Json document = sliding_cube();
  const mpm::Scene scene = scene_of(document);
  const Cause cause = named(causes_of(document), "yield");
  mpm::Scene there = scene;
  const double modulus = scene.bodies.front().material.youngs_modulus;
  cause.apply(std::vector{0.01 * modulus}, 0, there);
  EXPECT_EQ(there.bodies.front().formulation, mpm::Formulation::kTotal);
  EXPECT_EQ(there.bodies.front().material.law, material::Law::kVonMises);
  Json extended = document;
  cause.write(std::vector{0.01 * modulus}, 0, extended["scene"]);
  EXPECT_LT(apart(moved(there, kStepsAFrame), moved(scene_of(extended), kStepsAFrame)),
            1e-4 * kSize);
}

/// A load that only one recording has acts in its scene alone, and is written there.
TEST(Causes, AMassMayHangInOneRecordingAlone) {
  const Json document = sliding_cube();
  CauseOptions options;
  options.own_scenes = {{1, "second", Json::array({{{"position", {0, 0, 0}}, {"mass", 1.0}}})}};
  const std::vector<Cause> causes = scene_causes(job_of(document, {}), scene_of(document), options);
  const auto found = std::ranges::find_if(causes, [](const Cause& cause) {
    return cause.run.has_value() && cause.row.name == "attached_mass";
  });
  ASSERT_NE(found, causes.end());
  EXPECT_EQ(found->row.scope, "capture second");
  // Looked for at sizes about the body's own.
  const mpm::Scene scene = scene_of(document);
  const double own = std::pow(kSize, 3.0) * scene.bodies.front().density;
  ASSERT_FALSE(found->row.far_tries.empty());
  EXPECT_GT(found->row.far_tries.front(), 0.05 * own);
  EXPECT_LT(found->row.far_tries.back(), 3.0 * own);
  Json laid_over = {{"gravity", {0, 0, -3}}};
  found->write_over(std::vector{0.5}, 0, document["scene"], laid_over);
  ASSERT_EQ(laid_over["bodies"].size(), 1U);
  EXPECT_EQ(laid_over["bodies"][0]["name"], document["scene"]["bodies"][0]["name"]);
  ASSERT_EQ(laid_over["bodies"][0]["masses"].size(), 2U);
  EXPECT_EQ(laid_over["bodies"][0]["masses"][1]["mass"], 0.5);
}

/// Another specimen in one recording: its stiffness is the fitted one and a share of it.
TEST(Causes, AMaterialMayBeAnotherInOneRecording) {
  Json document = sliding_cube();
  CauseOptions options;
  options.own_scenes = {{1, "second", Json::array()}};
  const std::vector<Cause> causes = scene_causes(job_of(document, {}), scene_of(document), options);
  const Cause& cause = named(causes, "stiffness_change");
  EXPECT_EQ(cause.row.scope, "capture second");
  EXPECT_EQ(cause.run, 1U);
  mpm::Scene scene = scene_of(document);
  const double before = scene.bodies.front().material.youngs_modulus;
  cause.apply(std::vector{-0.1}, 0, scene);
  EXPECT_NEAR(scene.bodies.front().material.youngs_modulus, 0.9 * before, 1e-9 * before);
  // What is written goes with what the refit has left in the document.
  document["scene"]["bodies"][0]["material"]["E"] = 2.0 * before;
  Json over = Json::object();
  cause.write_over(std::vector{-0.1}, 0, document["scene"], over);
  EXPECT_NEAR(over["bodies"][0]["material"]["E"].get<double>(), 1.8 * before, 1e-9 * before);
}

/// A capture may have a scene of its own: what a cause adds is added to what that says.
TEST(Causes, AddToWhatAnotherSceneSays) {
  const Json document = sliding_cube();
  Json other = document;
  other["scene"]["gravity"] = {0.0, 0.0, -3.0};
  other["scene"]["bodies"][0]["velocity"] = {0.0, 0.0, 2.0};
  other["scene"]["colliders"][0]["contact"]["mu"] = 0.1;
  for (const Cause& cause : causes_of(document)) {
    mpm::Scene scene = scene_of(other);
    if (cause.row.name == "gravity_size") {
      cause.apply(std::vector{0.5}, 0, scene);
      EXPECT_NEAR(scene.gravity.values.front().z(), -3.5, 1e-12);
    } else if (cause.row.name == "velocity") {
      cause.apply(std::vector{1.0, 0.0, 0.0}, 0, scene);
      EXPECT_NEAR((scene.bodies.front().velocity - Vec3d(1.0, 0.0, 2.0)).norm(), 0.0, 1e-12);
    } else if (cause.row.name == "friction") {
      cause.apply(std::vector{0.2}, 0, scene);
      EXPECT_NEAR(scene.colliders.front()->contact().mu, 0.3, 1e-12);
    }
    if (cause.apply) {
      scene.colliders.clear();
      const std::vector<double> values(cause.row.numbers.size(), 0.01);
      cause.apply(values, 0, scene);  // nothing to act on is no error
    }
  }
}

/// An inclusion is looked for beside the centre, at faces, edges and corners; across a plate that
/// is thinner than an inclusion there is one place.
TEST(Causes, AnInclusionIsLookedForInEveryPartOfTheBody) {
  const auto places = [](const Json& document) {
    const std::vector<Cause> causes = causes_of(document);
    const auto found = std::ranges::find_if(
        causes, [](const Cause& cause) { return cause.row.name == "stiffness_inclusion"; });
    return found->row.variants;
  };
  Json document = sliding_cube();
  const std::vector<std::string> all = places(document);
  EXPECT_EQ(all.size(), 27U);
  EXPECT_EQ(std::ranges::count(all, "at the centre"), 1);
  EXPECT_EQ(std::ranges::count(all, "towards +x, -y and +z"), 1);
  document["scene"]["bodies"][0]["source"]["box"] = {{"low", {0.0, 0.0, 0.02}},
                                                     {"high", {1.2, 1.2, 0.22}}};
  EXPECT_EQ(places(document).size(), 9U);
}

}  // namespace
}  // namespace matterfit::job
