// SPDX-License-Identifier: GPL-3.0-or-later
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>

#include "base/error.hpp"
#include "job/documents/document.hpp"
#include "job/documents/fit_document.hpp"
#include "material/law_table.hpp"

namespace matterfit::job {
namespace {

using testing::HasSubstr;

Json fit_document() {
  return Json::parse(R"({ "schema": "matterfit.job/1", "task": "fit",
    "scene": { "fps": 24, "frames": [0, 10], "particle_separation": 0.05,
      "bodies": [ { "name": "dough", "source": { "sphere": { "radius": 0.2 } }, "density": 1000,
        "material": { "law": "von_mises", "E": 1e5, "nu": 0.3, "yield_stress": 1e3,
                      "maxwell": [ { "modulus": 1e3, "time": 0.1 } ] } } ],
      "colliders": [ { "name": "ground", "shape": "ground" },
                     { "name": "ball", "shape": "sphere", "radius": 1,
                       "contact": { "kind": "sticky" } } ] },
    "captures": [ { "tracks": "a.npz" },
                  { "tracks": "b.npz", "scene": { "bodies": [ { "name": "dough",
                                                                "velocity": [1, 0, 0] } ] } } ],
    "fit": { "parameters": [ "material.E" ] } })");
}

Job read_fit(const Json& json) {
  ReadOptions options;
  options.base_folder = "/base";
  return read_job(json.dump(), options);
}

std::vector<std::string> paths(const Json& parameters) {
  Json json = fit_document();
  json["fit"]["parameters"] = parameters;
  std::vector<std::string> result;
  const Job job = read_fit(json);
  for (const fit::ParameterSpec& parameter : job.fit->parameters) {
    result.push_back(parameter.path.text());
  }
  return result;
}

std::string fit_refusal(const std::function<void(Json&)>& change) {
  Json json = fit_document();
  change(json);
  try {
    (void)read_fit(json);
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), ErrorKind::kInput);
    return error.what();
  }
  return "nothing was refused";
}

std::string path_refusal(const std::string& path) {
  return fit_refusal([&](Json& d) { d["fit"]["parameters"] = {path}; });
}

TEST(FitDocument, ShortAndLongPathsAreTheSame) {
  EXPECT_THAT(paths({"material.E", "scene.bodies.dough.velocity[2]", "bodies[0].spin", "density",
                     "placement.rotation", "gravity", "colliders.ground.contact.mu",
                     "scene.colliders[0].height", "material.maxwell[0].time",
                     "bodies.\"dough\".material.nu", "captures.b.bodies.dough.velocity",
                     "captures[1].scene.spin", "captures[0].start_frame"}),
              testing::ElementsAre("bodies.dough.material.E", "bodies.dough.velocity[2]",
                                   "bodies.dough.spin", "bodies.dough.density",
                                   "bodies.dough.placement.rotation", "gravity",
                                   "colliders.ground.contact.mu", "colliders.ground.height",
                                   "bodies.dough.material.maxwell[0].time",
                                   "bodies.dough.material.nu", "captures.b.bodies.dough.velocity",
                                   "captures.b.bodies.dough.spin", "captures.a.start_frame"));
}

TEST(FitDocument, LawsAloneAreEnough) {
  const auto listed = [](const Json& laws) {
    Json json = fit_document();
    json["fit"] = {{"laws", laws}};
    std::vector<std::string> result;
    const Job job = read_fit(json);
    for (const fit::ParameterSpec& parameter : job.fit->parameters) {
      result.push_back(parameter.path.text());
    }
    return result;
  };
  EXPECT_THAT(listed({"latent"}), testing::ElementsAre("bodies.dough.velocity", "bodies.dough.spin",
                                                       "bodies.dough.material.E"));
  // The fluid's own come with it.
  EXPECT_THAT(listed({"neo_hookean", "newtonian"}),
              testing::ElementsAre("bodies.dough.velocity", "bodies.dough.spin",
                                   "bodies.dough.material.E", "bodies.dough.material.nu"));
  EXPECT_THAT(fit_refusal([](Json& d) { d["fit"] = Json::object(); }), HasSubstr("'parameters'"));
  EXPECT_THAT(fit_refusal([](Json& d) {
                Json other = d["scene"]["bodies"][0];
                other["name"] = "other";
                d["scene"]["bodies"].push_back(other);
                for (Json& capture : d["captures"]) capture["body"] = "dough";
                d["fit"] = {{"laws", {"latent"}}};
              }),
              HasSubstr("list what is to be fitted"));
}

TEST(FitDocument, NamesWithQuotesReadBack) {
  for (const std::string name : {"my.dough", "my \"dough\"", "baker's"}) {
    Json json = fit_document();
    json["captures"].erase(1);
    json["scene"]["bodies"][0]["name"] = name;
    const std::string text = read_fit(json).fit->parameters[0].path.text();
    json["fit"]["parameters"] = {text};
    EXPECT_EQ(read_fit(json).fit->parameters[0].path.owner, name) << text;
  }
}

TEST(FitDocument, DefaultsAndValues) {
  Json json = fit_document();
  json["fit"]["parameters"] = {{{"path", "velocity"},
                                {"start", {1, 2, 3}},
                                {"bounds", {-4, 4}},
                                {"prior", {{"mean", 0}, {"sigma", 2}}}},
                               "material.nu"};
  json["fit"]["levels"] = {2, 1};
  const FitDoc fit = *read_fit(json).fit;
  EXPECT_EQ(fit.parameters[0].start, (std::vector<double>{1, 2, 3}));
  EXPECT_EQ((*fit.parameters[0].bounds)[0], -4.0);
  EXPECT_EQ(fit.parameters[0].prior->mean, (std::vector<double>{0, 0, 0}));
  EXPECT_TRUE(fit.parameters[1].start.empty());
  EXPECT_EQ(fit.levels, (std::vector<double>{2, 1}));
  EXPECT_EQ(fit.iterations, 30);
  EXPECT_TRUE(fit.windows);
  EXPECT_TRUE(fit.laws.empty());
  json["fit"]["laws"] = "all";
  // All but the published one.
  EXPECT_EQ(read_fit(json).fit->laws.size(), material::all_laws().size() - 1);
  EXPECT_EQ(read_fit(json).fit->body, "dough");
}

TEST(FitDocument, ErrorsNameThePath) {
  EXPECT_THAT(fit_refusal([](Json& d) { d["fit"].erase("parameters"); }),
              HasSubstr("fit: 'parameters' is missing"));
  EXPECT_THAT(fit_refusal([](Json& d) { d["fit"]["parameters"] = Json::array(); }),
              HasSubstr("fit.parameters is [], expected at least one parameter"));
  EXPECT_THAT(fit_refusal([](Json& d) { d["fit"]["parametres"] = 1; }),
              HasSubstr("fit: unknown key 'parametres'. Did you mean 'parameters'?"));
  EXPECT_THAT(path_refusal("material.Y"), HasSubstr("fit.parameters[0]: 'material.Y'"));
  EXPECT_THAT(path_refusal("material.yeild_stress"),
              HasSubstr("Did you mean 'material.yield_stress'?"));
  EXPECT_THAT(path_refusal("bodies.dugh.material.E"), HasSubstr("Did you mean 'dough'?"));
  EXPECT_THAT(path_refusal("material.friction_angle"),
              HasSubstr("the law von_mises does not use 'friction_angle'; it takes E nu"));
  EXPECT_THAT(path_refusal("material.maxwell[1].time"), HasSubstr("has 1 Maxwell branches"));
  EXPECT_THAT(path_refusal("velocity[3]"), HasSubstr("components [0], [1] and [2]"));
  EXPECT_THAT(fit_refusal([](Json& d) {
                d["scene"]["colliders"][1]["name"] = "ground";
                d["fit"]["parameters"] = {"colliders[0].height"};
              }),
              HasSubstr("several colliders are called 'ground'"));
  EXPECT_THAT(fit_refusal([](Json& d) { d["scene"]["colliders"][1]["name"] = "ground"; }),
              HasSubstr("nothing was refused"));
  EXPECT_THAT(path_refusal("colliders.ball.height"), HasSubstr("only the shape 'ground'"));
  EXPECT_THAT(path_refusal("colliders.ball.contact.mu"), HasSubstr("not of the kind 'friction'"));
  EXPECT_THAT(path_refusal("colliders.wall.contact.mu"), HasSubstr("there is no collider 'wall'"));
  EXPECT_THAT(path_refusal("captures.a.velocity"), HasSubstr("has no scene of its own"));
  EXPECT_THAT(path_refusal("captures.c.velocity"), HasSubstr("there is no capture 'c'"));
  EXPECT_THAT(path_refusal("captures.c.start_frame"), HasSubstr("there is no capture 'c'"));
  EXPECT_THAT(fit_refusal([](Json& d) {
                d["fit"]["parameters"] = {"velocity", "velocity[0]"};
              }),
              HasSubstr("fit.parameters[1]: 'bodies.dough.velocity[0]' is there already"));
  EXPECT_THAT(fit_refusal([](Json& d) {
                d["fit"]["parameters"] = {{{"path", "material.E"}, {"bounds", {5, 5}}}};
              }),
              HasSubstr("fit.parameters[0].bounds is [5,5]"));
  EXPECT_THAT(
      fit_refusal([](Json& d) {
        d["fit"]["parameters"] = {{{"path", "material.E"}, {"start", 1}, {"bounds", {2, 5}}}};
      }),
      HasSubstr("starts at 1.0, outside its bounds [2.0,5.0]"));
  EXPECT_THAT(
      fit_refusal([](Json& d) {
        d["fit"]["parameters"] = {{{"path", "material.E"}, {"prior", {{"mean", 1}, {"sigma", 0}}}}};
      }),
      HasSubstr("fit.parameters[0].prior.sigma is 0, expected a number > 0"));
  EXPECT_THAT(fit_refusal([](Json& d) { d["fit"]["laws"] = {"rubbery"}; }),
              HasSubstr("fit.laws[0]: 'rubbery' is not a law"));
  EXPECT_THAT(fit_refusal([](Json& d) { d["fit"]["laws"] = {"newtonian"}; }),
              HasSubstr("none of the candidate laws uses 'E'"));
  EXPECT_THAT(fit_refusal([](Json& d) { d["fit"]["loss"] = "l2"; }),
              HasSubstr("fit.loss is \"l2\""));
  EXPECT_THAT(fit_refusal([](Json& d) {
                d["fit"]["levels"] = {1, 2};
              }),
              HasSubstr("fit.levels[1]: levels go from coarse to fine"));
  EXPECT_THAT(fit_refusal([](Json& d) {
                d["fit"]["levels"] = {4, 2};
              }),
              HasSubstr("fit.levels is [4,2], expected a list that ends with 1"));
  EXPECT_THAT(fit_refusal([](Json& d) {
                d["scene"]["gravity"] = {{"frames", {0, 5}}, {"values", {{0, 0, -9}, {0, 0, 0}}}};
                d["fit"]["parameters"] = {"gravity"};
              }),
              HasSubstr("gravity is keyed"));
}

}  // namespace
}  // namespace matterfit::job
