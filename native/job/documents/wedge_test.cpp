// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/documents/wedge.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <set>

#include "base/error.hpp"
#include "base/file.hpp"
#include "base/folder_for_test.hpp"

namespace matterfit::job {
namespace {

namespace fs = std::filesystem;
using testing::ElementsAre;
using testing::HasSubstr;

constexpr const char* kDocument = R"({ "schema": "matterfit.job/1", "task": "bake", "scene": {
    "frames": [1, 5], "particle_separation": 0.05, "bodies": [ { "name": "cube", "density": 1000,
      "source": { "box": { "low": [0,0,1], "high": [0.4,0.4,1.4] } }, "velocity": [0,0,0],
      "material": { "law": "fixed_corotated", "E": 1e4, "nu": 0.3 } } ] } })";

template <class Call>
std::string message_of(const Call& call) {
  try {
    call();
  } catch (const Error& error) {
    return error.what();
  }
  return "";
}

TEST(Wedge, IsTheProductOfItsAxes) {
  const Wedge wedge = read_wedge({"velocity[2]=-1,-2", "scene.gravity=[0,0,-9.81], [0,0,-1.62]"});
  ASSERT_EQ(wedge.members.size(), 4U);
  EXPECT_EQ(wedge.members[1].label, "velocity[2] = -1, gravity = [0,0,-1.62]");
  EXPECT_THAT(wedge.members[2].overrides,
              ElementsAre("velocity[2]=-2", "scene.gravity=[0,0,-9.81]"));
  EXPECT_EQ(wedge.members[0].name, "velocity.2=-1_gravity=0_0_-9.81");
}

TEST(Wedge, MembersHaveFoldersOfTheirOwn) {
  // Letters outside ASCII leave nothing in a name, and long ones are cut.
  const std::string long_value = "\"" + std::string(300, 'x');
  const Wedge wedge = read_wedge({"note=ä,ö," + long_value + "1\"," + long_value + "2\""});
  std::set<std::string> names;
  for (const WedgeMember& member : wedge.members) {
    EXPECT_LE(member.name.size(), 130U);
    names.insert(member.name);
  }
  EXPECT_EQ(names.size(), 4U);
}

TEST(Wedge, RefusesWhatIsNoWedge) {
  const auto said = [](const std::vector<std::string>& sets) {
    return message_of([&] { (void)read_wedge(sets); });
  };
  EXPECT_THAT(said({}), HasSubstr("at least one --set"));
  EXPECT_THAT(said({"velocity[2]"}), HasSubstr("expected PATH=VALUE,VALUE"));
  EXPECT_THAT(said({"velocity[2]=1,,2"}), HasSubstr("a value is missing"));
  EXPECT_THAT(said({"velocity[2]=1,2,1"}), HasSubstr("the value 1 is there twice"));
  EXPECT_THAT(said({"density=1,2", "density=3"}), HasSubstr("density: is there twice"));
  std::string many = "density=1";
  for (int i = 2; i <= 101; ++i) many += "," + std::to_string(i);
  EXPECT_THAT(said({many, "material." + many}), HasSubstr("more than 10000 members"));
}

TEST(Wedge, AllMembersAreCheckedBeforeAnyIsWritten) {
  const Folder folder;
  const fs::path out = folder.path / "wedge";
  EXPECT_THAT(message_of([&] { (void)write_wedge(kDocument, {}, {"material.nu=0.3,0.7"}, out); }),
              testing::AllOf(HasSubstr("material.nu = 0.7: "), HasSubstr("nu")));
  EXPECT_THAT(message_of([&] {
                (void)write_wedge(kDocument, {}, {R"(bodies[0].source={"mesh":"gone.ply"})"}, out);
              }),
              HasSubstr("gone.ply does not exist"));
  EXPECT_FALSE(fs::exists(out));
}

TEST(Wedge, WritesADocumentForEachMember) {
  const Folder folder;
  const WedgeFolder made = write_wedge(kDocument, {folder.path, "job", {"density=900"}, {}},
                                       {"velocity[2]=-1,-2"}, folder.path / "wedge");
  ASSERT_EQ(made.jobs.size(), 2U);
  EXPECT_EQ(made.task, Task::kBake);
  EXPECT_EQ(made.jobs[1].scene.bodies[0].velocity.z(), -2.0);
  EXPECT_EQ(made.jobs[1].scene.bodies[0].density, 900.0);
  EXPECT_EQ(fs::weakly_canonical(made.jobs[1].output.folder),
            fs::weakly_canonical(folder.path / "wedge" / "velocity.2=-2"));
  EXPECT_THAT(made.same, ElementsAre(false, false));
  const WedgeFolder again = write_wedge(kDocument, {folder.path, "job", {"density=900"}, {}},
                                        {"velocity[2]=-2,-3"}, folder.path / "wedge");
  EXPECT_THAT(again.same, ElementsAre(true, false));
}

}  // namespace
}  // namespace matterfit::job
