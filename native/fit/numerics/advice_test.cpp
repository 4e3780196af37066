// SPDX-License-Identifier: GPL-3.0-or-later
#include "fit/numerics/advice.hpp"

#include <gtest/gtest.h>

namespace matterfit::fit {
namespace {

TEST(Advice, KnowsTheParametersOfAScene) {
  EXPECT_EQ(advice("bodies.dough.material.E").quantity, "the stiffness");
  EXPECT_EQ(advice("bodies.dough.material.nu").quantity, "Poisson's ratio");
  EXPECT_EQ(advice("bodies.dough.material.maxwell[0].modulus").quantity,
            "the stiffness of the relaxing part");
  EXPECT_EQ(advice("bodies.a.material.bulk_modulus").quantity,
            "the resistance to a change of volume");
  EXPECT_EQ(advice("bodies.dough.velocity[2]").quantity, "the initial velocity");
  EXPECT_EQ(advice("bodies.dough.placement.position[0]").quantity, "the starting place");
  EXPECT_EQ(advice("colliders.floor.contact.mu").quantity, "the friction");
  EXPECT_EQ(advice("colliders.floor.contact.stiffness").quantity, "the stiffness of the contact");
  EXPECT_EQ(advice("captures.drop.start_frame").quantity, "the time at which the recording begins");
  EXPECT_EQ(advice("gravity").quantity, "gravity");
  EXPECT_EQ(advice("gravity[1]").quantity, "gravity");
}

TEST(Advice, DoesNotTakeOneNameForAnother) {
  EXPECT_EQ(advice("bodies.a.angular_velocity").quantity, "it");
  EXPECT_EQ(advice("bodies.a.FE").quantity, "it");
  EXPECT_EQ(advice("").quantity, "it");
}

}  // namespace
}  // namespace matterfit::fit
