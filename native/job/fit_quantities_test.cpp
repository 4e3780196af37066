// SPDX-License-Identifier: GPL-3.0-or-later
// Every row of the table of quantities, through a document and the scene that is built of it.
#include <gtest/gtest.h>

#include <cmath>
#include <optional>
#include <string>

#include "base/parallel.hpp"
#include "fit/model/quantity.hpp"
#include "job/documents/fit_path.hpp"
#include "job/documents/neural_starts.hpp"
#include "job/documents/quantities_json.hpp"
#include "job/fit_fixture_for_test.hpp"
#include "job/run/build_scene.hpp"
#include "material/neural/isotropic_material.hpp"
#include "material/neural/isotropic_weights.hpp"
#include "material/neural/latent.hpp"
#include "material/neural/start_laws.hpp"

namespace matterfit::job {
namespace {

using namespace fit_test;
using fit::Address;
using fit::Owner;
using fit::Quantity;

/// A scene whose material has the quantity.
Json document_with(const Quantity& row) {
  Json document = thrown_cube();
  Json& material = document["scene"]["bodies"][0]["material"];
  const bool weight = row.path == "material.weight_moves[#]";
  const bool code = row.path == "material.latent[#]";
  for (const material::LawTraits& law : material::all_laws()) {
    if (code != (law.law == material::Law::kLatent)) continue;
    if (weight && law.law != material::Law::kNeuralIsotropic) continue;
    if (row.of_law && !law.uses(row.key())) continue;
    material = {{"law", law.name}};
    for (const Quantity& other : fit::quantities()) {
      if (other.of_law && law.uses(other.key())) {
        material[std::string(other.key())] = fit::usual_start(other, material::Material{});
      }
    }
    break;
  }
  if (code) material["latent"] = std::vector<double>(material::kLatentSize, 0.1);
  if (weight) material["weight_moves"] = std::vector<double>(material::kIsotropicElastic, 0.0);
  if (row.path == "material.correction[#]") material["correction"] = {0.1, 0.2, 0.3, 0.1, 0.0};
  material["maxwell"] = {{{"modulus", 1e3}, {"time", 0.1}}, {{"modulus", 2e3}, {"time", 0.5}}};
  document["captures"] = {{{"tracks", "a.npz"}}};
  return document;
}

TEST(FitQuantities, GoThroughADocumentAndAScene) {
  const Folder folder;
  Arena arena(1);
  const Interrupter interrupter;
  for (const Quantity& row : fit::quantities()) {
    Json document = document_with(row);
    const Job job = job_of(document, folder.path);
    std::string path = row.path;
    if (const std::size_t at = path.find("[#]"); at != std::string::npos)
      path.replace(at, 3, "[1]");
    if (row.owner == Owner::kCollider) path.insert(0, "colliders.ground.");
    const bool of_camera = row.path.starts_with("poses");
    if (row.owner == Owner::kCapture) path.insert(0, of_camera ? "captures.film." : "captures.a.");
    if (row.is_vector()) path += "[1]";
    const auto read = [&](const std::string& text) {
      return read_fit_path(text, "here", job.scene, job.captures, {"film"});
    };
    const Address at = read(path);
    ASSERT_EQ(at.quantity, &row) << path;
    EXPECT_EQ(read(at.text()).text(), at.text());
    if (row.owner == Owner::kCapture) {
      EXPECT_EQ(find_quantity(document["scene"], at), nullptr);
      Json capture = {{"poses", {{{"focal", 0.5}}}}};
      set_capture_quantity(capture, at, 0.25);
      const Json* found = of_camera ? &capture["poses"].at(1) : &capture;
      found = &found->at(std::string(row.key()));
      EXPECT_EQ((row.is_vector() ? found->at(1) : *found).get<double>(), 0.25) << path;
      EXPECT_EQ(capture["poses"][0]["focal"], 0.5) << path;
      continue;
    }
    const auto component = static_cast<std::size_t>(at.component.value_or(0));
    mpm::Scene scene = build_scene(job, arena, interrupter).scene;
    fit::Origins origins;
    origins["cube"] = job.scene.bodies[0].placement.position;
    const double value = 1.25 * fit::read(scene, at, origins)[component] + 0.0625;
    if (is_quaternion(row)) {
      const Quatd turn(Eigen::AngleAxisd(value, Vec3d::UnitY()));
      set_quantity(document["scene"], at, {turn.w(), turn.x(), turn.y(), turn.z()});
    } else {
      set_quantity(document["scene"], at, value);
      const Json* found = find_quantity(document["scene"], at);
      ASSERT_NE(found, nullptr) << path;
      EXPECT_EQ((row.is_vector() ? found->at(component) : *found).get<double>(), value) << path;
    }
    fit::write(value, at, scene, origins);
    const mpm::Scene built = build_scene(job_of(document, folder.path), arena, interrupter).scene;
    const Vec3d moved = scene.bodies[0].rest[17] - built.bodies[0].rest[17];
    EXPECT_LT(moved.norm(), 1e-12) << path;
    if (!row.places()) {
      EXPECT_EQ(fit::read(built, at), fit::read(scene, at)) << path;
    }
  }
}

TEST(FitQuantities, OverridesTakeWhatIsReplacedAsAWhole) {
  const Json scene = document_with(fit::row_named(Owner::kBody, "density"))["scene"];
  const Job job = job_of(document_with(fit::row_named(Owner::kBody, "density")), {});
  const auto copied = [&](const char* path) {
    Json overrides = Json::object();
    copy_quantity(scene, read_fit_path(path, "here", job.scene, job.captures), overrides);
    return overrides;
  };
  EXPECT_EQ(copied("velocity[2]")["bodies"][0]["velocity"], scene["bodies"][0]["velocity"]);
  EXPECT_EQ(copied("material.maxwell[1].time")["bodies"][0]["material"]["maxwell"],
            scene["bodies"][0]["material"]["maxwell"]);
  EXPECT_FALSE(copied("material.E")["bodies"][0]["material"].contains("E"));
  EXPECT_EQ(copied("density")["bodies"][0], (Json{{"name", "cube"}}));
  EXPECT_EQ(copied("gravity"), Json::object());
}

TEST(FitQuantities, AreHandedOutWhole) {
  const Json table = quantities_json();
  ASSERT_EQ(table["quantities"].size(), fit::quantities().size());
  EXPECT_EQ(table["laws"].size(), material::all_laws().size());
  ASSERT_EQ(table["starts"].size(), material::kStartLaws.size());
  EXPECT_EQ(table["starts"][0]["name"], "jelly");
  EXPECT_EQ(table["starts"][0]["numbers"]["E"], 1e5);
  // The weights themselves, but for what the regression leaves of a liquid's shear.
  for (const Json& start : table["starts"]) {
    const material::Material of_weights =
        material::isotropic_material(neural_start(start["name"].get<std::string>()));
    EXPECT_NEAR(start["numbers"]["E"].get<double>() / of_weights.youngs_modulus, 1.0, 0.1) << start;
    EXPECT_NEAR(start["numbers"]["nu"].get<double>(), of_weights.poisson_ratio, 1e-3) << start;
    EXPECT_NEAR(start["numbers"]["yield_strain"].get<double>(), of_weights.yield_strain,
                1e-3 * of_weights.yield_strain)
        << start;
  }
  for (const Json& effect : table["effects"]) EXPECT_FALSE(effect["parameters"].empty()) << effect;
  EXPECT_EQ(
      table["effects"][0]["parameters"][0],
      (Json{
          {"key", "rate"}, {"unit", "1/s"}, {"size", 1}, {"bounds", {0.0, 1e3}}, {"keyed", true}}));
  const Json& first = table["quantities"][0];
  EXPECT_EQ(first["path"], "material.E");
  EXPECT_EQ(first["list"], "bodies");
  EXPECT_EQ(first["coordinate"], "log");
  EXPECT_EQ(first["bounds"], (Json{1e2, 1e10}));
  for (const Json& row : table["quantities"]) {
    const std::size_t fields = first.size();
    EXPECT_EQ(row.size(), fields) << row;
  }
}

}  // namespace
}  // namespace matterfit::job
