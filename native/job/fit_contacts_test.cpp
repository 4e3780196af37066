// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/fit_contacts.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "job/build_scene.hpp"
#include "job/fit_fixture_for_test.hpp"

namespace matterfit::job {
namespace {

using namespace fit_test;
using testing::HasSubstr;

mpm::BodyContact pair(const char* first, const char* second, double stiffness = 0.0) {
  mpm::BodyContact contact{first, second, {}};
  contact.contact.stiffness = stiffness;
  return contact;
}

TEST(FitContacts, PairsAreInheritedByTheirNames) {
  mpm::Scene base_scene;
  base_scene.contacts = {pair("a", "b"), pair("c", "d")};
  FrozenContacts base;
  base.contacts = {1.0, 2.0};
  base.added = {pair("a", "c", 3.0)};
  mpm::Scene scene;
  scene.contacts = {pair("d", "c"), pair("c", "a"), pair("b", "d")};
  FrozenContacts frozen;
  frozen.contacts = {10.0, 20.0, 30.0};
  frozen.added = {pair("b", "a", 40.0), pair("b", "c", 50.0)};
  inherit(base, base_scene, scene, frozen);
  EXPECT_EQ(frozen.contacts, (std::vector<double>{2.0, 3.0, 30.0}));
  EXPECT_EQ(frozen.added[0].contact.stiffness, 1.0);
  EXPECT_EQ(frozen.added[1].contact.stiffness, 50.0);
}

TEST(FitContacts, SaysWhoseContactIsHeldToo) {
  Json document = thrown_cube();
  document["scene"]["colliders"][0]["contact"].erase("stiffness");
  Json other = document["scene"]["bodies"][0];
  other["name"] = "stone";
  other["source"] = {{"box", {{"low", {1, 0, 0.1}}, {"high", {1.4, 0.4, 0.5}}}}};
  other["material"]["E"] = 3e6;
  document["scene"]["bodies"].push_back(other);
  const Folder folder;
  Arena arena(1);
  const mpm::Scene scene = build_scene(job_of(document, folder.path), arena, Interrupter()).scene;
  const FrozenContacts frozen = resolve_contacts(scene, {"cube"});
  EXPECT_THAT(shared_contacts(frozen, scene, {"cube"}),
              testing::ElementsAre(HasSubstr("alone, body 'stone' would have")));
  EXPECT_TRUE(shared_contacts(frozen, scene, {"cube", "stone"}).empty());
  EXPECT_TRUE(shared_contacts({{0.0}, {}, {}, 0.0}, scene, {"cube"}).empty());
}

}  // namespace
}  // namespace matterfit::job
