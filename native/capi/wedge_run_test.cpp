// SPDX-License-Identifier: GPL-3.0-or-later
#include "capi/wedge_run.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>

#include "base/folder_for_test.hpp"
#include "capture/npz.hpp"

namespace matterfit::capi {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

constexpr const char* kDocument = R"({ "schema": "matterfit.job/1", "scene": { "frames": [1, 4],
    "particle_separation": 0.05, "bodies": [ { "name": "cube", "density": 1000,
      "source": { "box": { "low": [0,0,1], "high": [0.4,0.4,1.4] } }, "velocity": [0,0,0],
      "material": { "law": "fixed_corotated", "E": 1e4, "nu": 0.3 } } ] } })";

job::WedgeFolder wedge(const Folder& folder, const std::vector<std::string>& axes) {
  return job::write_wedge(kDocument, {folder.path, "job", {}, {}}, axes, folder.path / "wedge");
}

TEST(RunWedge, MembersAreThoseOfASingleRunAndAreSkippedAfterwards) {
  const Folder folder;
  const std::vector<std::string> axes = {"velocity[2]=-1,-2,-3"};
  Interrupter interrupter;
  const Outcome first = run_wedge(wedge(folder, axes), {}, 2, interrupter);
  ASSERT_EQ(first.exit_status, 0) << first.error;
  const job::Json result = job::Json::parse(first.result);
  ASSERT_EQ(result["members"].size(), 3U);
  EXPECT_EQ(interrupter.progress().fraction, 1.0);

  const Folder alone;
  job::ReadOptions options{alone.path, "job", {"velocity[2]=-2"}, {}};
  Interrupter other;
  const Outcome single = run_to_end(job::read_job(kDocument, options), {}, other);
  EXPECT_EQ(job::Json::parse(single.result)["result_hash"], result["members"][1]["result_hash"]);

  const Outcome again = run_wedge(wedge(folder, {"velocity[2]=-1,-4"}), {}, 1, interrupter);
  const job::Json later = job::Json::parse(again.result);
  EXPECT_EQ(later["members"][0]["status"], "done before");
  EXPECT_EQ(later["members"][1]["status"], "done");
  EXPECT_THAT(wedge_table(later), HasSubstr("velocity[2] = -4  done"));
}

TEST(RunWedge, AMemberWhoseFilesAreLostIsComputedAgain) {
  const Folder folder;
  Interrupter interrupter;
  const job::WedgeFolder made = wedge(folder, {"density=900"});
  ASSERT_EQ(run_wedge(made, {}, 1, interrupter).exit_status, 0);
  for (const auto& file : fs::directory_iterator(folder.path / "wedge" / "density=900" / "state")) {
    fs::resize_file(file.path(), 1);
  }
  const Outcome again = run_wedge(wedge(folder, {"density=900"}), {}, 1, interrupter);
  EXPECT_EQ(job::Json::parse(again.result)["members"][0]["status"], "done");
}

TEST(RunWedge, AComparedMemberIsSkippedUntilItsRecordingChanges) {
  const Folder folder;
  const auto record = [&](double x) {
    capture::Arrays arrays;
    arrays["positions"] =
        capture::Array({3, 1, 3}, std::vector<double>{x, 0.2, 1.2, x, 0.2, 1.2, x, 0.2, 1.2});
    arrays["times"] = capture::Array({3}, std::vector<double>{0.0, 1.0 / 24.0, 2.0 / 24.0});
    capture::write_npz(folder.path / "clip.npz", arrays);
  };
  const auto status = [&] {
    job::Json document = job::Json::parse(kDocument);
    document["task"] = "compare";
    document["captures"] = {{{"tracks", "clip.npz"}}};
    Interrupter interrupter;
    const Outcome outcome =
        run_wedge(job::write_wedge(document.dump(), {folder.path, "job", {}, {}}, {"density=900"},
                                   folder.path / "wedge"),
                  {}, 1, interrupter);
    EXPECT_EQ(outcome.exit_status, 0) << outcome.error;
    return job::Json::parse(outcome.result)["members"][0]["status"].get<std::string>();
  };
  record(0.2);
  EXPECT_EQ(status(), "done");
  EXPECT_EQ(status(), "done before");
  record(0.25);
  EXPECT_EQ(status(), "done");
}

TEST(RunWedge, OneThatFailsDoesNotStopTheOthers) {
  const Folder folder;
  Interrupter interrupter;
  const Outcome outcome =
      run_wedge(wedge(folder, {"solver.memory_limit_gb=0.00001,4"}), {}, 1, interrupter);
  EXPECT_EQ(outcome.exit_status, 2);
  EXPECT_THAT(outcome.error, HasSubstr("solver.memory_limit_gb = 0.00001: "));
  const job::Json result = job::Json::parse(outcome.result);
  EXPECT_EQ(result["members"][0]["status"], "failed");
  EXPECT_EQ(result["members"][1]["status"], "done");
}

TEST(RunWedge, CancelStopsThoseThatRunAndStartsNoOther) {
  const Folder folder;
  const job::WedgeFolder made = wedge(folder, {"density=900,1000", "frames=[1,100000]"});
  JobThread thread([&](Interrupter& interrupter) { return run_wedge(made, {}, 1, interrupter); });
  while (thread.progress().fraction <= 0.0 && !thread.wait(0.02)) {
  }
  thread.cancel();
  EXPECT_TRUE(thread.wait(30.0));
  EXPECT_EQ(thread.outcome().exit_status, 130);
  const job::Json result = job::Json::parse(thread.outcome().result);
  EXPECT_EQ(result["status"], "cancelled");
  EXPECT_EQ(result["members"][0]["status"], "cancelled");
  EXPECT_EQ(result["members"][1]["status"], "waiting");
}

}  // namespace
}  // namespace matterfit::capi
