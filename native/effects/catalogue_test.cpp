// SPDX-License-Identifier: GPL-3.0-or-later
#include "effects/catalogue.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <set>

#include "base/error.hpp"

namespace matterfit::effects {
namespace {

using testing::HasSubstr;
using testing::MatchesRegex;

TEST(Catalogue, NamesAreUniqueAndRowsAreFilledIn) {
  std::set<std::string> names;
  for (const EffectType* row : catalogue()) {
    EXPECT_TRUE(names.insert(row->name).second) << row->name;
    EXPECT_THAT(row->name, MatchesRegex("[a-z][a-z_]*"));
    EXPECT_EQ(find_effect_type(row->name), row);
    EXPECT_FALSE(row->sentence.empty()) << row->name;
    EXPECT_FALSE(row->signature.empty()) << row->name;
    EXPECT_FALSE(row->confused_with.empty()) << row->name;
    // A term of its own, or numbers that the scene has.
    EXPECT_EQ(row->way == Way::kTerm, row->make != nullptr) << row->name;
    EXPECT_EQ(row->way == Way::kQuantity, !row->quantities.empty()) << row->name;
    EXPECT_EQ(row->way == Way::kTerm, !row->parameters.empty()) << row->name;
    EXPECT_TRUE(row->beside.empty() || find_effect_type(row->beside) != nullptr) << row->name;
  }
  EXPECT_EQ(find_effect_type("nothing"), nullptr);
}

TEST(Catalogue, ParametersHaveAScaleWithinTheirBounds) {
  for (const EffectType* row : catalogue()) {
    bool may_vanish = row->make == nullptr;
    for (const EffectParameter& parameter : row->parameters) {
      const std::string name = row->name + "." + parameter.key;
      may_vanish = may_vanish || parameter.neutral.has_value();
      EXPECT_LT(parameter.low, parameter.high) << name;
      EXPECT_GT(parameter.scale, 0.0) << name;
      EXPECT_LT(parameter.scale, parameter.high - parameter.low) << name;
      EXPECT_FALSE(parameter.label.empty() || parameter.sentence.empty()) << name;
      EXPECT_TRUE(parameter.size == 1 || parameter.size == 3) << name;
      EXPECT_TRUE(parameter.standard.empty() || parameter.standard.size() == parameter.size)
          << name;
      if (parameter.coordinate == Coordinate::kLog) {
        EXPECT_GT(parameter.low, 0.0) << name;
      }
      EXPECT_EQ(row->find(parameter.key), std::size_t(&parameter - row->parameters.data()));
    }
    EXPECT_TRUE(may_vanish) << row->name;
  }
}

TEST(Catalogue, NewEffectsAreCheckedAndCanBeNeutral) {
  for (const EffectType* row : catalogue()) {
    if (row->make == nullptr) continue;
    Effect effect = make_effect(row->name);
    EXPECT_EQ(effect.values.size(), row->size());
    EXPECT_NO_THROW(check_effect(effect, "here")) << row->name;
    for (std::size_t i = 0; i < row->parameters.size(); ++i) {
      if (!row->parameters[i].neutral) continue;
      Effect none = effect;
      for (std::size_t c = 0; c < row->parameters[i].size; ++c) {
        none.values[row->offset(i) + c] = *row->parameters[i].neutral;
      }
      EXPECT_TRUE(is_neutral(none)) << row->name << '.' << row->parameters[i].key;
    }
  }
  EXPECT_THROW((void)make_effect("nothing"), Error);
}

TEST(Catalogue, KeysCountForWhatIsNeutralAndWhatIsLargest) {
  Effect wind = make_effect("wind");
  EXPECT_TRUE(is_neutral(wind));
  wind.keys.resize(wind.values.size());
  wind.keys[0].times = {0.0, 1.0};
  wind.keys[0].values = {0.0, -3.0};
  EXPECT_FALSE(is_neutral(wind));
  EXPECT_DOUBLE_EQ(wind.at(0, 0.5), -1.5);
  EXPECT_DOUBLE_EQ(wind.largest_vector(0), 3.0);
  wind.keys[0].values[1] = 1e9;
  try {
    check_effect(wind, "scene.effects[2]");
    ADD_FAILURE() << "not refused";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("scene.effects[2].velocity = 1e+09 must lie between"));
  }
}

}  // namespace
}  // namespace matterfit::effects
