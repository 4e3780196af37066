// SPDX-License-Identifier: GPL-3.0-or-later
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "base/error.hpp"
#include "base/file.hpp"
#include "base/folder_for_test.hpp"
#include "job/documents/document.hpp"
#include "job/documents/images_document.hpp"

namespace matterfit::job {
namespace {

namespace fs = std::filesystem;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

Json document_with(const Json& capture) {
  return {{"schema", "matterfit.job/1"},
          {"scene",
           {{"frames", {0, 4}},
            {"particle_separation", 0.05},
            {"bodies",
             {{{"name", "ball"},
               {"source", {{"sphere", {{"center", {0, 0, 0}}, {"radius", 0.2}}}}},
               {"density", 1000},
               {"material", {{"law", "neo_hookean"}, {"E", 1e4}, {"nu", 0.3}}}}}}}},
          {"captures", {capture}}};
}

Job job_with(const Json& capture) {
  ReadOptions options;
  options.base_folder = "/work/clip";
  return read_job(document_with(capture).dump(), options);
}
ImagesDoc images_with(const Json& capture) { return images_of(job_with(capture)).at(0); }

std::string message_of(const Json& capture) {
  try {
    (void)job_with(capture);
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), ErrorKind::kInput);
    return error.what();
  }
  ADD_FAILURE() << "nothing was thrown";
  return "";
}

TEST(DocumentImages, PlatesAreFilesOrAName) {
  const ImagesDoc one =
      images_with({{"cameras", "transforms.json"}, {"plate", {{"images", "plates/p_##.png"}}}});
  EXPECT_THAT(one.options.plates->files, ElementsAre("/work/clip/plates/p_##.png"));
  EXPECT_EQ(one.options.plates->threshold, 6.0);
  const ImagesDoc list =
      images_with({{"cameras", "transforms.json"},
                   {"plate", {{"images", {"a.png", "/tmp/b.exr"}}, {"threshold", 8}}},
                   {"images", "takes"}});
  EXPECT_THAT(list.options.plates->files, ElementsAre("/work/clip/a.png", "/tmp/b.exr"));
  EXPECT_EQ(list.options.plates->threshold, 8.0);
  EXPECT_EQ(list.options.images, "/work/clip/takes");
}

TEST(DocumentImages, WhatIsBrokenIsNamed) {
  const auto with = [](const Json& plate) {
    return Json{{"cameras", "transforms.json"}, {"plate", plate}};
  };
  EXPECT_THAT(message_of(with(Json::object())), HasSubstr("captures[0].plate"));
  EXPECT_THAT(message_of(with({{"images", Json::array()}})),
              HasSubstr("captures[0].plate.images is []"));
  EXPECT_THAT(message_of(with({{"images", "a_#.png"}, {"threshold", 0}})),
              HasSubstr("captures[0].plate.threshold is 0"));
  EXPECT_THAT(message_of(with({{"images", "a_#.png"}, {"range", {2, 4}}})), HasSubstr("range"));
  Json both = with({{"images", "a_#.png"}});
  both["key"] = {{"colour", {1, 0, 0}}};
  EXPECT_THAT(message_of(both), HasSubstr("captures[0]: 'key' and 'plate' both say"));
}

TEST(DocumentImages, PosesAndWhatIsKnownOfThem) {
  const ImagesDoc plain = images_with({{"cameras", "transforms.json"}, {"refine", false}});
  EXPECT_TRUE(plain.poses.empty());
  EXPECT_FALSE(plain.refine);
  const ImagesDoc posed =
      images_with({{"cameras", "transforms.json"},
                   {"poses", {Json::object(), {{"shift", {0.01, 0, -0.02}}, {"focal", 0.03}}}},
                   {"refine", {{"shift", 0}, {"focal", 0.01}}}});
  ASSERT_EQ(posed.poses.size(), 2u);
  EXPECT_EQ(posed.poses[0].shift, Vec3d::Zero());
  EXPECT_EQ(posed.poses[1].shift, Vec3d(0.01, 0, -0.02));
  EXPECT_EQ(posed.poses[1].focal, 0.03);
  EXPECT_EQ(posed.refine->shift, 0.0);
  EXPECT_EQ(posed.refine->turn, 0.02);
  EXPECT_EQ(posed.refine->focal, 0.01);
  EXPECT_EQ(images_with({{"cameras", "t.json"}, {"refine", true}}).refine->focal, 0.0);
  const auto with = [](const char* key, const Json& value) {
    return message_of({{"cameras", "transforms.json"}, {key, value}});
  };
  EXPECT_THAT(with("poses", {{{"focal", -1}}}), HasSubstr("captures[0].poses[0].focal is -1"));
  EXPECT_THAT(with("poses", {{{"position", {0, 0, 0}}}}), HasSubstr("position"));
  EXPECT_THAT(with("refine", 3), HasSubstr("captures[0].refine is 3"));
  EXPECT_THAT(with("refine", {{"turn", -1}}), HasSubstr("captures[0].refine.turn is -1"));
}

TEST(DocumentImages, ColoursAreComparedWhereTheyAreAskedFor) {
  EXPECT_FALSE(images_with({{"cameras", "t.json"}}).options.colours);
  EXPECT_FALSE(images_with({{"cameras", "t.json"}, {"colours", false}}).colours);
  EXPECT_EQ(images_with({{"cameras", "t.json"}, {"colours", true}}).colours, 0.1);
  const ImagesDoc noisy = images_with({{"cameras", "t.json"}, {"colours", {{"noise", 0.3}}}});
  EXPECT_EQ(noisy.colours, 0.3);
  EXPECT_TRUE(noisy.options.colours);
  EXPECT_THAT(message_of({{"cameras", "t.json"}, {"colours", {{"noise", 0}}}}),
              HasSubstr("captures[0].colours.noise is 0"));
  EXPECT_THAT(message_of({{"cameras", "t.json"}, {"colours", 1}}),
              HasSubstr("captures[0].colours is 1"));
}

/// Written elsewhere, a document names the same files.
TEST(DocumentImages, PathsFollowTheDocument) {
  const Job job = job_with({{"cameras", "model"},
                            {"images", "takes"},
                            {"plate", {{"images", {"plates/a.png", "plates/b.png"}}}}});
  const Json capture = Json::parse(write_job(job, "/work/clip/jobs")).at("captures").at(0);
  EXPECT_EQ(capture.at("cameras"), "../model");
  EXPECT_EQ(capture.at("images"), "../takes");
  EXPECT_THAT(capture.at("plate").at("images"), ElementsAre("../plates/a.png", "../plates/b.png"));
}

TEST(DocumentImages, AClipIsCalledAfterItsProject) {
  const Folder folder;
  const fs::path project = folder.path / "jelly";
  for (const char* file : {"sparse/0/cameras.bin", "sparse/0/images.bin"}) {
    write_file(project / file, "x");
  }
  for (const fs::path& named : {project, project / "sparse/0", project / "sparse/0/images.bin"}) {
    EXPECT_EQ(images_with({{"cameras", named.string()}}).name, "jelly") << named;
  }
  EXPECT_EQ(images_with({{"cameras", (project / "transforms.json").string()}}).name, "jelly");
}

}  // namespace
}  // namespace matterfit::job
