// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/run/cache.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstring>
#include <fstream>

#include "base/error.hpp"
#include "base/file.hpp"
#include "base/folder_for_test.hpp"
#include "base/message_for_test.hpp"
#include "job/documents/safetensors.hpp"
#include "job/run/checkpoint.hpp"
#include "job/run/state_file.hpp"
#include "job/run/stats_log.hpp"

namespace matterfit::job {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

Job job_in(const fs::path& folder, std::vector<std::string> overrides = {}) {
  ReadOptions options;
  options.base_folder = folder;
  options.overrides = std::move(overrides);
  return read_job(R"({ "schema": "matterfit.job/1", "scene": { "frames": [1, 4],
    "particle_separation": 0.05, "bodies": [ { "name": "b", "density": 1000,
      "source": { "box": { "low": [0,0,0], "high": [1,1,1] } },
      "material": { "law": "neo_hookean", "E": 1e5, "nu": 0.3 } } ] } })",
                  options);
}

std::span<const std::byte> bytes_of(const std::string& text) {
  return {reinterpret_cast<const std::byte*>(text.data()), text.size()};
}

TEST(Safetensors, RoundTripsAndIsLaidOutAsTheFormatSays) {
  Tensors tensors;
  tensors.tensors["a"] = {{2, 3}, {1, 2, 3, 4, 5, 6}};
  tensors.tensors["b"] = {{0}, {}};
  tensors.metadata["unit"] = "m";
  const std::string text = format_safetensors(tensors);
  std::uint64_t length = 0;
  std::memcpy(&length, text.data(), 8);
  EXPECT_EQ(length % 8, 0U);
  const Json header = Json::parse(text.substr(8, length));
  EXPECT_EQ(header["a"]["dtype"], "F32");
  EXPECT_EQ(header["a"]["data_offsets"], Json::parse("[0,24]"));
  EXPECT_EQ(text.size(), 8 + length + 24);
  const Tensors read = parse_safetensors(bytes_of(text), "x");
  EXPECT_EQ(read.tensors.at("a").values, tensors.tensors.at("a").values);
  EXPECT_EQ(read.tensors.at("a").shape, (std::vector<std::size_t>{2, 3}));
  EXPECT_EQ(read.metadata.at("unit"), "m");
}

TEST(Safetensors, EveryTruncationIsRefused) {
  Tensors tensors;
  tensors.tensors["a"] = {{2, 3}, {1, 2, 3, 4, 5, 6}};
  const std::string text = format_safetensors(tensors);
  for (std::size_t size = 0; size < text.size(); ++size) {
    EXPECT_THROW((void)parse_safetensors(bytes_of(text.substr(0, size)), "x"), Error) << size;
  }
  std::string huge = text;
  huge[7] = '\x7f';
  EXPECT_THROW((void)parse_safetensors(bytes_of(huge), "x"), Error);
}

TEST(StateFile, RoundTripsBitForBit) {
  mpm::Scene scene;
  scene.bodies.resize(1);
  scene.bodies[0].name = "b";
  scene.bodies[0].rest = {Vec3d(0, 0, 0), Vec3d(1, 0, 0)};
  mpm::FrameState state;
  state.frame = 7;
  state.time = 6.0 / 24.0;
  state.bodies.resize(1);
  state.bodies[0].positions = {Vec3f(0.1F, 0.2F, 0.3F), Vec3f(1, 2, 3)};
  state.bodies[0].velocities = {Vec3f(4, 5, 6), Vec3f(7, 8, 9)};
  Mat3f F;
  F << 1, 2, 3, 4, 5, 6, 7, 8, 9;
  state.bodies[0].deformation_gradients = {F, F.transpose()};
  state.bodies[0].plastic_strain = {0.5F, 0.25F};
  const Folder folder;
  const std::string text = format_state(scene, state);
  write_file(folder.path / "s.safetensors", text);
  const mpm::FrameState read = read_state(folder.path / "s.safetensors", scene);
  EXPECT_EQ(read.frame, 7);
  EXPECT_EQ(read.time, state.time);
  EXPECT_EQ(read.bodies[0].positions, state.bodies[0].positions);
  EXPECT_EQ(read.bodies[0].deformation_gradients, state.bodies[0].deformation_gradients);
  EXPECT_EQ(read.bodies[0].plastic_strain, state.bodies[0].plastic_strain);
  EXPECT_EQ(format_state(scene, read), text);
  // Row by row in the file, as NumPy reads it.
  const Tensors tensors = parse_safetensors(bytes_of(text), "x");
  EXPECT_EQ(tensors.tensors.at("b.deformation_gradients").values[1], 2.0F);
  scene.bodies[0].rest.emplace_back(2, 0, 0);
  EXPECT_THAT(message_of([&] { (void)read_state(folder.path / "s.safetensors", scene); }),
              HasSubstr("b.positions"));
}

TEST(Inputs, EqualNumbersAreEqualAndChangesAreNamed) {
  const Folder folder;
  const auto inputs = [&](std::vector<std::string> overrides) {
    return simulation_inputs(job_in(folder.path, std::move(overrides)), mpm::SimdTarget::kSse4);
  };
  const Inputs before = inputs({});
  EXPECT_EQ(hash_inputs(before), hash_inputs(inputs({"density=1000.0"})));
  EXPECT_EQ(hash_inputs(before), hash_inputs(inputs({"scene.quality=fine"})));
  EXPECT_EQ(hash_inputs(before), hash_inputs(inputs({"scene.solver={\"memory_limit_gb\":3}"})));
  EXPECT_EQ(hash_inputs(before), hash_inputs(inputs({"output.folder=x"})));
  const Inputs now = inputs({"material.E=2e5"});
  EXPECT_NE(hash_inputs(before), hash_inputs(now));
  const auto lines = changes(before, now);
  ASSERT_EQ(lines.size(), 1U);
  EXPECT_EQ(lines[0], "scene.bodies[0].material.E: 200000.0, was 100000.0");
}

TEST(Inputs, FilesCountByContentNotByName) {
  const Folder folder;
  write_file(folder.path / "a.ply", "one");
  write_file(folder.path / "b.ply", "one");
  const auto inputs = [&](const std::string& name) {
    return simulation_inputs(job_in(folder.path, {"bodies[0].source={\"mesh\":\"" + name + "\"}"}),
                             mpm::SimdTarget::kSse4);
  };
  const Inputs before = inputs("a.ply");
  EXPECT_EQ(hash_inputs(before), hash_inputs(inputs("b.ply")));
  write_file(folder.path / "b.ply", "two");
  EXPECT_THAT(changes(before, inputs("b.ply")),
              testing::ElementsAre("scene.bodies[0].source.mesh: its content"));
  EXPECT_THAT(message_of([&] { (void)inputs("c.ply"); }), HasSubstr("c.ply"));
}

TEST(Manifest, RoundTripsAndRefusesPathsThatLeaveTheFolder) {
  Manifest manifest;
  manifest.version = "1";
  manifest.input_hash = "x";
  manifest.inputs["a"] = "1";
  manifest.fps_given = 24;
  manifest.first_frame = 1;
  manifest.end_frame = 5;
  manifest.frames_done = 2;
  manifest.files["state/a"] = {3, "h", true};
  const Manifest read = parse_manifest(format_manifest(manifest), "m");
  EXPECT_EQ(format_manifest(read), format_manifest(manifest));
  for (const char* path : {"../a", "/etc/passwd", "a/../../b", "", "manifest.json", "./a"}) {
    Manifest evil = manifest;
    evil.files[path] = {3, "h", true};
    EXPECT_THROW((void)parse_manifest(format_manifest(evil), "m"), Error) << path;
  }
}

TEST(Manifest, NamesWhatIsMissingTruncatedOrChanged) {
  const Folder folder;
  Manifest manifest;
  for (const char* name : {"volume/a_0001.vdb", "mesh/b.pc2", "points/c.pc2", "state/d"}) {
    write_file(folder.path / name, "0123456789");
    record_file(manifest, folder.path, name);
  }
  EXPECT_TRUE(verify_files(manifest, folder.path).empty());
  const std::string before = result_hash(manifest);
  fs::remove(folder.path / "mesh/b.pc2");
  fs::resize_file(folder.path / "volume/a_0001.vdb", 4);
  write_file(folder.path / "state/d", "012345678X");
  const auto faults = verify_files(manifest, folder.path);
  ASSERT_EQ(faults.size(), 3U);
  EXPECT_EQ(faults[0].path + " " + faults[0].what, "mesh/b.pc2 is missing");
  EXPECT_EQ(faults[1].path, "state/d");
  EXPECT_THAT(faults[1].what, HasSubstr("another content"));
  EXPECT_THAT(faults[2].what, HasSubstr("has 4 bytes, 10 were written: truncated"));
  record_file(manifest, folder.path, "state/d");
  EXPECT_NE(result_hash(manifest), before);
}

TEST(Cache, RefusesChangedInputsAndNamesThem) {
  const Folder folder;
  const Job job = job_in(folder.path);
  const Inputs inputs = simulation_inputs(job, mpm::SimdTarget::kSse4);
  {
    Cache cache(job, inputs, Restart::kNever);
    cache.begin(job, inputs);
    write_file(cache.folder() / state_path(1), "state");
    cache.record(state_path(1));
    cache.manifest().frames_done = 1;
    cache.save();
    EXPECT_EQ(cache.sound_states(), 1U);
    write_file(cache.folder() / state_path(1), "STATE");
    EXPECT_EQ(cache.sound_states(), 0U) << "of the same size, but not what was written";
    write_file(cache.folder() / state_path(1), "state");
  }
  const Job changed = job_in(folder.path, {"gravity=[0,0,-1]"});
  const Inputs now = simulation_inputs(changed, mpm::SimdTarget::kSse4);
  EXPECT_THAT(message_of([&] { const Cache cache(changed, now, Restart::kNever); }),
              testing::AllOf(HasSubstr("holds the results of other inputs"),
                             HasSubstr("scene.gravity[2]: -1.0"), HasSubstr("--restart")));
  write_file(folder.path / "out/mine.txt", "the artist's own");
  {
    Cache cache(job, inputs, Restart::kWhereChanged);
    cache.begin(job, inputs);
    EXPECT_EQ(cache.manifest().frames_done, 1) << "of the same inputs";
  }
  {
    Cache cache(changed, now, Restart::kWhereChanged);
    EXPECT_TRUE(fs::exists(folder.path / "out" / state_path(1))) << "a fill may still fail";
    cache.begin(changed, now);
    EXPECT_EQ(cache.manifest().frames_done, 0);
  }
  EXPECT_FALSE(fs::exists(folder.path / "out" / state_path(1)));
  EXPECT_TRUE(fs::exists(folder.path / "out/mine.txt")) << "what we do not list stays";
}

TEST(Cache, ForgetsTheComparisonWithOtherRecordings) {
  const Folder folder;
  const Job job = job_in(folder.path);
  const Inputs inputs = simulation_inputs(job, mpm::SimdTarget::kSse4);
  Cache cache(job, inputs, Restart::kNever);
  cache.begin(job, inputs);
  const fs::path report = cache.folder() / job.output.report;
  for (const bool other : {false, true}) {
    cache.manifest().compared_hash = other ? "other" : hash_inputs(capture_inputs(job));
    write_file(report, "{}");
    cache.record_volatile(job.output.report);
    EXPECT_EQ(cache.begin_comparison(job), hash_inputs(capture_inputs(job)));
    EXPECT_EQ(fs::exists(report), !other);
    EXPECT_EQ(cache.manifest().compared_hash.empty(), other);
  }
}

TEST(Cache, TwoJobsCannotHaveOneFolder) {
  const Folder folder;
  const Job job = job_in(folder.path);
  const Inputs inputs = simulation_inputs(job, mpm::SimdTarget::kSse4);
  const Cache first(job, inputs, Restart::kNever);
  EXPECT_THAT(message_of([&] { const Cache second(job, inputs, Restart::kNever); }),
              HasSubstr("another job is writing into this folder"));
}

TEST(Checkpoint, OneDamagedByteMakesItUnusable) {
  const Folder folder;
  const std::string text = format_checkpoint({"inputs", 12, std::string(1000, 'x')});
  write_file(folder.path / kCheckpointPath, text);
  const auto read = read_checkpoint(folder.path, "inputs");
  ASSERT_TRUE(read);
  EXPECT_EQ(read->frame, 12);
  EXPECT_EQ(read->bytes, std::string(1000, 'x'));
  EXPECT_FALSE(read_checkpoint(folder.path, "other inputs"));
  std::string damaged = text;
  damaged[damaged.size() - 5] = 'y';
  write_file(folder.path / kCheckpointPath, damaged);
  EXPECT_FALSE(read_checkpoint(folder.path, "inputs"));
  write_file(folder.path / kCheckpointPath, text.substr(0, text.size() - 1));
  EXPECT_FALSE(read_checkpoint(folder.path, "inputs"));
}

TEST(StatsLog, DropsAnUnfinishedLineAndWhatIsSimulatedAgain) {
  const Folder folder;
  {
    StatsLog log(folder.path);
    for (int frame = 1; frame < 5; ++frame) {
      mpm::FrameReport report;
      report.frame = frame;
      report.substeps = 10 * frame;
      log.add(report);
    }
  }
  std::ofstream(folder.path / "stats.jsonl", std::ios::app) << "{\"frame\": 5, \"subst";
  StatsLog log(folder.path);
  ASSERT_EQ(log.lines().size(), 4U);
  log.keep_before(3);
  EXPECT_EQ(StatsLog(folder.path).lines().size(), 2U);
}

}  // namespace
}  // namespace matterfit::job
