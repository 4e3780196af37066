// SPDX-License-Identifier: GPL-3.0-or-later
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>

#include "base/error.hpp"
#include "effects/catalogue.hpp"
#include "job/documents/document.hpp"

namespace matterfit::job {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

Json effects_document(const Json& effects) {
  Json all = Json::parse(R"({
    "schema": "matterfit.job/1",
    "scene": {
      "fps": 20, "frames": [10, 30], "particle_separation": 0.05,
      "bodies": [ { "name": "a", "source": { "sphere": { "radius": 0.2 } }, "density": 1000,
                    "material": { "law": "neo_hookean", "E": 1e5, "nu": 0.3 } },
                  { "name": "b", "source": { "sphere": { "radius": 0.2 } }, "density": 1000,
                    "material": { "law": "neo_hookean", "E": 1e5, "nu": 0.3 } } ] } })");
  all["scene"]["effects"] = effects;
  return all;
}

Job read_effects(const Json& effects, std::vector<std::string> overrides = {}) {
  ReadOptions options;
  options.base_folder = "/base";
  options.overrides = std::move(overrides);
  return read_job(effects_document(effects).dump(), options);
}

std::string effects_refusal(const Json& effects) {
  try {
    (void)read_effects(effects);
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), ErrorKind::kInput);
    return error.what();
  }
  return "nothing was refused";
}

TEST(EffectDocuments, AreReadWithTheirStandardValues) {
  const Job job = read_effects({{{"effect", "wind"}, {"velocity", {1, 2, 3}}, {"body", "b"}},
                                {{"effect", "wind"}, {"name", "gust"}}});
  ASSERT_EQ(job.scene.effects.size(), 2U);
  const EffectDoc& wind = job.scene.effects[0];
  EXPECT_EQ(wind.type, effects::find_effect_type("wind"));
  EXPECT_EQ(wind.name, "wind");
  EXPECT_EQ(wind.body, "b");
  EXPECT_THAT(wind.values[0].values, ElementsAre(ElementsAre(1.0, 2.0, 3.0)));
  EXPECT_THAT(wind.values[1].values, ElementsAre(ElementsAre(0.5)));
  EXPECT_EQ(job.scene.effects[1].name, "gust");
  EXPECT_EQ(job.scene.effects[1].body, "");
}

TEST(EffectDocuments, EveryTermCanBeWritten) {
  for (const effects::EffectType* row : effects::catalogue()) {
    if (row->make == nullptr) continue;
    Json effect = {{"effect", row->name}};
    for (const effects::EffectParameter& parameter : row->parameters) {
      const double value = 0.5 * (std::max(parameter.low, -2.0) + std::min(parameter.high, 3.0));
      if (parameter.size == 1) {
        effect[parameter.key] = value;
      } else {
        effect[parameter.key] = std::vector<double>(parameter.size, value);
      }
    }
    EXPECT_EQ(read_effects(Json::array({effect})).scene.effects[0].type, row) << row->name;
  }
}

TEST(EffectDocuments, AreKeyedAndOverridden) {
  const Json gust = {{"effect", "wind"},
                     {"velocity", {{"frames", {10, 20}}, {"values", {{0, 0, 0}, {4, 0, 0}}}}}};
  const Job job = read_effects(Json::array({gust}));
  EXPECT_THAT(job.scene.effects[0].values[0].frames, ElementsAre(10.0, 20.0));
  EXPECT_THAT(job.scene.effects[0].values[0].values[1], ElementsAre(4.0, 0.0, 0.0));
  EXPECT_THAT(read_effects({{{"effect", "drag_linear"}, {"rate", 1}}}, {"scene.effects[0].rate=3"})
                  .scene.effects[0]
                  .values[0]
                  .values[0],
              ElementsAre(3.0));
  EXPECT_THAT(read_effects({{{"effect", "drag_linear"}, {"name", "air"}, {"rate", 1}}},
                           {"effects.air.rate=3"})
                  .scene.effects[0]
                  .values[0]
                  .values[0],
              ElementsAre(3.0));
}

TEST(EffectDocuments, ErrorsNameThePathAndTheRemedy) {
  EXPECT_THAT(effects_refusal({{{"effect", "drag_quadratc"}}}),
              HasSubstr("scene.effects[0].effect: there is no effect 'drag_quadratc'. Did you mean "
                        "'drag_quadratic'?"));
  EXPECT_THAT(effects_refusal({{{"name", "wind"}}}), HasSubstr("scene.effects[0]"));
  EXPECT_THAT(effects_refusal({{{"effect", "drag_linear"}, {"rat", 1}}}),
              HasSubstr("scene.effects[0]: unknown key 'rat'. Did you mean 'rate'?"));
  EXPECT_THAT(effects_refusal({{{"effect", "drag_linear"}, {"rate", -1}}}),
              HasSubstr("scene.effects[0].rate is -1, expected a number from 0 to 1000 [1/s]"));
  EXPECT_THAT(effects_refusal({{{"effect", "wind"}, {"velocity", 3}}}),
              HasSubstr("scene.effects[0].velocity is 3, expected three numbers"));
  EXPECT_THAT(effects_refusal({{{"effect", "wind"}, {"body", "c"}}}),
              HasSubstr("there is no body 'c'"));
  EXPECT_THAT(effects_refusal({{{"effect", "wind"}}, {{"effect", "wind"}}}),
              HasSubstr("scene.effects[1]: another effect is called 'wind' too"));
  EXPECT_THAT(effects_refusal({{{"effect", "drag_quadratic"},
                                {"area", {{"frames", {10}}, {"values", {0.1}}}}}}),
              HasSubstr("scene.effects[0].area: this number cannot be keyed"));
}

}  // namespace
}  // namespace matterfit::job
