// SPDX-License-Identifier: GPL-3.0-or-later
#include "capi/job_thread.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>

#include "base/error.hpp"
#include "base/folder_for_test.hpp"
#include "capi/terminal.hpp"
#include "job/documents/document.hpp"
#include "job/run/inspect.hpp"
#include "job/run_job.hpp"

namespace matterfit::capi {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

job::Job cube(const fs::path& folder, std::vector<std::string> overrides = {}) {
  job::ReadOptions options;
  options.base_folder = folder;
  options.overrides = std::move(overrides);
  return job::read_job(R"({ "schema": "matterfit.job/1", "scene": { "frames": [1, 5],
    "particle_separation": 0.05, "bodies": [ { "name": "cube", "density": 1000,
      "source": { "box": { "low": [0,0,1], "high": [0.4,0.4,1.4] } },
      "material": { "law": "fixed_corotated", "E": 1e4, "nu": 0.3 } } ] } })",
                       options);
}

TEST(JobThread, RunsToItsEnd) {
  const Folder folder;
  JobThread thread(cube(folder.path), {});
  EXPECT_TRUE(thread.wait(-1.0));
  EXPECT_EQ(thread.outcome().exit_status, 0) << thread.outcome().error;
  const job::Json result = job::Json::parse(thread.outcome().result);
  EXPECT_EQ(result["status"], "done");
  EXPECT_EQ(result["particles"], 512);
  EXPECT_THAT(summary(result), HasSubstr(result["result_hash"].get<std::string>()));
  EXPECT_THAT(summary(job::inspect_folder(folder.path / "out")),
              HasSubstr("every file is as it was written"));
  EXPECT_EQ(thread.progress().fraction, 1.0);
  EXPECT_EQ(thread.seconds_left(), 0.0);
}

TEST(JobThread, CancelledBeforeItBegins) {
  const Folder folder;
  JobThread thread(cube(folder.path, {"frames=[1,100000]"}), {});
  thread.cancel();
  EXPECT_TRUE(thread.wait(-1.0));
  EXPECT_EQ(thread.outcome().exit_status, 130);
  EXPECT_EQ(job::Json::parse(thread.outcome().result)["status"], "cancelled");
}

TEST(JobThread, AnErrorBecomesAnOutcome) {
  const Folder folder;
  JobThread thread(cube(folder.path, {"bodies[0].source={\"mesh\":\"gone.ply\"}"}), {});
  EXPECT_TRUE(thread.wait(-1.0));
  EXPECT_EQ(thread.outcome().exit_status, 2);
  EXPECT_THAT(thread.outcome().error, HasSubstr("gone.ply"));
  const job::Json result = job::Json::parse(thread.outcome().result);
  EXPECT_EQ(result["status"], "error");
  EXPECT_EQ(result["exit_status"], 2);
}

TEST(JobThread, DestroyedWhileItRuns) {
  const Folder folder;
  { const JobThread thread(cube(folder.path, {"frames=[1,100000]"}), {}); }
  SUCCEED();
}

TEST(ResidentBytes, AreKnownHere) { EXPECT_GT(resident_bytes(), 1U << 20U); }

}  // namespace
}  // namespace matterfit::capi
