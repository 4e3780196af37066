// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/run_job.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <thread>

#include "base/error.hpp"
#include "base/file.hpp"
#include "base/folder_for_test.hpp"
#include "base/message_for_test.hpp"
#include "capture/npz.hpp"
#include "job/documents/inputs.hpp"
#include "job/documents/manifest.hpp"
#include "job/run/build_scene.hpp"
#include "job/run/checkpoint.hpp"
#include "job/run/inspect.hpp"
#include "job/run/observe.hpp"
#include "job/run/scene_at_level.hpp"
#include "job/run/state_file.hpp"

namespace matterfit::job {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

/// A cube of 512 particles in free fall: known exactly, x = v t + ½ g t².
Json falling_cube() {
  return Json::parse(R"({ "schema": "matterfit.job/1", "task": "simulate",
    "scene": { "fps": 24, "frames": [1, 9], "particle_separation": 0.05, "gravity": [0, 0, -10],
      "bodies": [ { "name": "cube", "density": 1000, "velocity": [1, 0, 0],
        "source": { "box": { "low": [0,0,1], "high": [0.4,0.4,1.4] } },
        "material": { "law": "fixed_corotated", "E": 1e4, "nu": 0.3 } } ] },
    "output": { "checkpoint": { "frames": 3 } } })");
}

Job job_of(const Json& document, const fs::path& folder) {
  ReadOptions options;
  options.base_folder = folder;
  return read_job(document.dump(), options);
}

Json run(const Json& document, const fs::path& folder, int threads = 1,
         Restart restart = Restart::kNever) {
  RunOptions options;
  options.threads = threads;
  options.restart = restart;
  Interrupter interrupter;
  return run_job(job_of(document, folder), options, interrupter);
}

/// Cancels when the run reports a frame.
class CancelAt {
 public:
  static std::string run(const Json& document, const fs::path& folder, int frame) {
    Interrupter interrupter;
    const Job job = job_of(document, folder);
    std::string message;
    std::thread watcher([&] {
      while (interrupter.progress().frame < frame && !interrupter.cancelled()) {
        std::this_thread::yield();
      }
      interrupter.cancel();
    });
    try {
      (void)run_job(job, RunOptions{}, interrupter);
    } catch (const Error& error) {
      message = error.kind() == ErrorKind::kCancelled ? "cancelled" : error.what();
    }
    interrupter.cancel();
    watcher.join();
    return message;
  }
};

TEST(Run, SimulatesAndSaysWhatItDid) {
  const Folder folder;
  const Json result = run(falling_cube(), folder.path);
  EXPECT_EQ(result["status"], "done");
  EXPECT_EQ(result["particles"], 512);
  EXPECT_NEAR(result["bodies"][0]["mass_kg"].get<double>(), 64.0, 1e-9);
  const BuiltScene built = [&] {
    Arena arena(1);
    return build_scene(job_of(falling_cube(), folder.path), arena, Interrupter());
  }();
  const mpm::FrameState last = read_state(folder.path / "out" / state_path(8), built.scene);
  const double t = 7.0 / 24.0;
  EXPECT_DOUBLE_EQ(last.time, t);
  Vec3d mean = Vec3d::Zero();
  for (const Vec3f& x : last.bodies[0].positions) mean += x.cast<double>() / 512.0;
  EXPECT_NEAR(mean.x(), 0.2 + t, 1e-5);
  EXPECT_NEAR(mean.z(), 1.2 - 5.0 * t * t, 1e-4);
  const Json inspected = inspect_folder(folder.path / "out");
  EXPECT_EQ(inspected["status"], "sound");
  EXPECT_EQ(inspected["result_hash"], result["result_hash"]);
  EXPECT_EQ(inspected["frames_done"], 8);
  EXPECT_FALSE(fs::exists(folder.path / "out" / kCheckpointPath));
}

TEST(Run, SameHashForAnyThreads) {
  const Folder one;
  const Folder two;
  EXPECT_EQ(run(falling_cube(), one.path, 1)["result_hash"],
            run(falling_cube(), two.path, 2)["result_hash"]);
}

TEST(Run, ASecondRunUsesTheFirst) {
  const Folder folder;
  const Json first = run(falling_cube(), folder.path);
  const Json second = run(falling_cube(), folder.path);
  EXPECT_EQ(second["frames_reused"], 8);
  EXPECT_EQ(second["result_hash"], first["result_hash"]);
  EXPECT_EQ(second["substeps"], first["substeps"]);
}

TEST(Run, GoesOnFromACheckpointWithTheSameBytes) {
  Json document = falling_cube();
  document["task"] = "bake";
  document["output"]["points"] = true;
  document["output"]["volume"] = {"density"};
  document["output"]["attributes"] = {"velocity"};
  document["output"]["checkpoint"] = {{"frames", 2}};
  const Folder whole;
  const Json unbroken = run(document, whole.path);
  for (const int stop : {3, 6}) {
    const Folder folder;
    ASSERT_EQ(CancelAt::run(document, folder.path, stop), "cancelled");
    // As a kill leaves it: a state that no manifest lists, half a temporary file.
    std::ofstream(folder.path / "out/state/state_0099.safetensors.tmp") << "half";
    const Json resumed = run(document, folder.path);
    EXPECT_EQ(resumed["result_hash"], unbroken["result_hash"]) << "stopped at frame " << stop;
    EXPECT_GT(resumed["frames_reused"], 0) << "from the checkpoint, not from the first frame";
    EXPECT_TRUE(inspect_folder(folder.path / "out")["faults"].empty());
  }
}

TEST(Run, LostAndTruncatedFilesAreMadeAgain) {
  Json document = falling_cube();
  document["task"] = "bake";
  document["output"]["points"] = true;
  document["output"]["volume"] = {"density"};
  const Folder folder;
  const Json first = run(document, folder.path);
  fs::resize_file(folder.path / "out/volume/cube_0004.vdb", 100);
  fs::remove(folder.path / "out/points/cube.pc2");
  const Json found = inspect_folder(folder.path / "out");
  EXPECT_EQ(found["status"], "damaged");
  EXPECT_EQ(found["faults"].size(), 2U);
  EXPECT_NE(found["result_hash"], first["result_hash"]);
  EXPECT_EQ(run(document, folder.path)["result_hash"], first["result_hash"]);
  fs::remove(folder.path / "out" / state_path(5));
  EXPECT_EQ(run(document, folder.path)["result_hash"], first["result_hash"]);
}

TEST(Run, BakesFromStatesThatAreThere) {
  const Folder folder;
  Json document = falling_cube();
  (void)run(document, folder.path);
  document["task"] = "bake";
  document["output"]["points"] = true;
  const Json baked = run(document, folder.path);
  EXPECT_EQ(baked["frames_reused"], 8);
  const Folder fresh;
  EXPECT_EQ(run(document, fresh.path)["result_hash"], baked["result_hash"]);
}

TEST(Run, ChangedInputsAreRefusedUntilRestart) {
  const Folder folder;
  (void)run(falling_cube(), folder.path);
  Json document = falling_cube();
  document["scene"]["gravity"] = {0, 0, -3.7};
  EXPECT_THAT(message_of([&] { (void)run(document, folder.path); }),
              HasSubstr("scene.gravity[2]: -3.7, was -10.0"));
  EXPECT_EQ(run(document, folder.path, 1, Restart::kAlways)["frames_reused"], 0);
}

/// A capture of the fall itself, moved aside by 2 mm from frame to frame.
void write_fall(const fs::path& path, double fps, std::size_t frames, double offset) {
  std::vector<double> positions;
  std::vector<double> times;
  for (std::size_t k = 0; k < frames; ++k) {
    const double t = double(k) / fps;
    times.push_back(t);
    for (const double z : {1.1, 1.3}) {
      positions.insert(positions.end(), {0.2 + t, 0.2 + (k > 0 ? offset : 0.0), z - 5.0 * t * t});
    }
  }
  capture::Arrays arrays;
  arrays["positions"] = capture::Array({frames, 2, 3}, positions);
  arrays["times"] = capture::Array({frames}, times);
  capture::write_npz(path, arrays);
}

TEST(Run, ComparesAtTheCapturesOwnPoints) {
  const Folder folder;
  write_fall(folder.path / "fall.npz", 24, 8, 2e-3);
  Json document = falling_cube();
  document["task"] = "compare";
  document["captures"] = {{{"tracks", "fall.npz"}, {"holdout", {{"frames", {7, 9}}}}}};
  const Json result = run(document, folder.path);
  const Json& capture = result["compare"]["captures"][0];
  EXPECT_EQ(capture["samples"], 16);
  EXPECT_NEAR(capture["max_mm"].get<double>(), 2.0, 0.05);
  EXPECT_NEAR(capture["mean_mm"].get<double>(), 2.0 * 7 / 8, 0.05);
  EXPECT_EQ(capture["held_out"]["samples"], 4);
  EXPECT_NEAR(capture["body_size_m"].get<double>(), 0.4, 1e-9);
  const capture::Arrays simulated = capture::read_npz(folder.path / "out/simulated.npz");
  EXPECT_EQ(simulated.at("positions").shape, (std::vector<std::size_t>{8, 2, 3}));
  const capture::Arrays errors = capture::read_npz(folder.path / "out/compare.npz");
  EXPECT_NEAR(errors.at("error_mm").doubles("e")[3], 2.0, 0.05);
  // Comparing does not change what is compared.
  document["task"] = "simulate";
  EXPECT_EQ(run(document, folder.path)["result_hash"], result["result_hash"]);
}

TEST(Run, AComparisonBakesWhereItIsAsked) {
  const Folder folder;
  write_fall(folder.path / "fall.npz", 24, 8, 2e-3);
  Json document = falling_cube();
  document["task"] = "compare";
  document["captures"] = {{{"tracks", "fall.npz"}}};
  document["output"]["points"] = true;
  const Json compared = run(document, folder.path);
  EXPECT_FALSE(fs::exists(folder.path / "out/points"));
  document["output"]["bake"] = true;
  const Json both = run(document, folder.path);
  EXPECT_EQ(both["compare"], compared["compare"]);
  EXPECT_EQ(both["frames_reused"], 8);
  EXPECT_TRUE(fs::exists(folder.path / "out/points/cube.pc2"));
  const auto manifest = read_manifest(folder.path / "out");
  EXPECT_EQ(manifest->frames_baked, 8);
  // A bake finds what the comparison has baked.
  document["task"] = "bake";
  const auto written = fs::last_write_time(folder.path / "out/points/cube.pc2");
  EXPECT_EQ(run(document, folder.path)["result_hash"], both["result_hash"]);
  EXPECT_EQ(fs::last_write_time(folder.path / "out/points/cube.pc2"), written);
}

TEST(Run, CapturesAtAnotherRateAreInterpolatedAndSaidSo) {
  const Folder folder;
  write_fall(folder.path / "fall.npz", 60, 30, 0.0);
  Json document = falling_cube();
  document["captures"] = {{{"tracks", "fall.npz"}}};
  const Json result = run(document, folder.path);
  const std::string notes = result["notes"].dump();
  EXPECT_THAT(notes, HasSubstr("interpolated"));
  EXPECT_THAT(notes, HasSubstr("12 of 30 samples lie outside the simulated time"));
  const auto positions =
      capture::read_npz(folder.path / "out/simulated.npz").at("positions").doubles("p");
  EXPECT_NEAR(positions[std::size_t{6} * 17], 0.2 + 17.0 / 60.0, 1e-4);
  EXPECT_TRUE(std::isnan(positions[std::size_t{6} * 18]));
}

TEST(Run, WallsThinnerThanASeparationAreNoted) {
  const Folder folder;
  // A plate of 10 mm as a closed mesh, separation 50 mm; and one of 100 mm.
  const auto plate = [&](const char* name, double half) {
    std::ofstream file(folder.path / name);
    for (int i = 0; i < 8; ++i) {
      file << "v " << ((i & 1) != 0 ? 1 : -1) << ' ' << ((i & 2) != 0 ? 1 : -1) << ' '
           << ((i & 4) != 0 ? half : -half) << '\n';
    }
    file << "f 1 3 4 2\nf 5 6 8 7\nf 1 2 6 5\nf 3 7 8 4\nf 1 5 7 3\nf 2 4 8 6\n";
  };
  plate("thin.obj", 0.005);
  plate("thick.obj", 0.05);
  Json document = falling_cube();
  document["scene"]["frames"] = {1, 2};
  document["scene"]["colliders"] = {{{"name", "thin plate"}, {"mesh", "thin.obj"}},
                                    {{"name", "thick plate"}, {"mesh", "thick.obj"}}};
  const std::string notes = run(document, folder.path)["notes"].dump();
  EXPECT_THAT(notes, HasSubstr("'thin plate': thinner than a particle separation"));
  EXPECT_THAT(notes, testing::Not(HasSubstr("thick plate")));
}

TEST(Run, ARefusedJobLeavesNoFolder) {
  const Folder folder;
  Json document = falling_cube();
  document["output"]["folder"] = "refused";
  document["scene"]["bodies"][0]["source"] = {{"mesh", "absent.obj"}};
  EXPECT_THROW((void)run(document, folder.path), Error);
  EXPECT_FALSE(fs::exists(folder.path / "refused"));
  fs::create_directory(folder.path / "refused");
  EXPECT_THROW((void)run(document, folder.path), Error);
  EXPECT_TRUE(fs::exists(folder.path / "refused"));
}

TEST(Run, RefusesTasksThatLackTheirSection) {
  const Folder folder;
  Json document = falling_cube();
  document["task"] = "diagnose";
  EXPECT_THAT(message_of([&] { (void)run(document, folder.path); }),
              HasSubstr("add a section 'fit'"));
  document["task"] = "compare";
  EXPECT_THAT(message_of([&] { (void)run(document, folder.path); }),
              HasSubstr("compare needs at least one capture"));
}

TEST(Run, RefusesWhatDoesNotFitTheMemory) {
  const Folder folder;
  Json document = falling_cube();
  document["scene"]["solver"] = {{"memory_limit_gb", 1e-5}};
  EXPECT_THAT(message_of([&] { (void)run(document, folder.path); }),
              HasSubstr("512 particles need about"));
}

TEST(Probe, OnAFaceIsTheFace) {
  mpm::Body body;
  body.name = "b";
  for (int i = 0; i < 4; ++i) {
    for (int j = 0; j < 4; ++j) body.rest.emplace_back(0.1 * (i + 0.5), 0.1 * (j + 0.5), 0.0);
  }
  ProbeDoc probe;
  probe.name = "face";
  probe.region.shape = Region::Shape::kPlane;
  probe.region.point = Vec3d(0.4, 0, 0);
  probe.region.normal = Vec3d(-1, 0, 0);  // what lies on the plane or beyond it
  const Points face = probe_points(probe, "probes[0]", body, 0.1);
  ASSERT_EQ(face.size(), 4U);
  for (const Vec3d& x : face) EXPECT_DOUBLE_EQ(x.x(), 0.4);
  probe.region.point = Vec3d(0.3, 0, 0);
  EXPECT_EQ(probe_points(probe, "probes[0]", body, 0.1)[0].x(), body.rest[12].x());
  // A body that is no whole number of separations long.
  probe.region.point = Vec3d(0.43, 0, 0);
  ASSERT_EQ(probe_points(probe, "probes[0]", body, 0.1).size(), 4U);
  probe.region.point = Vec3d(0.63, 0, 0);
  EXPECT_THAT(message_of([&] { (void)probe_points(probe, "probes[0]", body, 0.1); }),
              HasSubstr("touches no particle of 'b'"));
}

/// Before anything is simulated or searched.
TEST(BuildScene, RefusesAProbeThatTouchesNothing) {
  Json document = falling_cube();
  document["probes"] = {
      {{"name", "far"},
       {"body", document["scene"]["bodies"][0]["name"]},
       {"region", {{"shape", "plane"}, {"point", {50, 0, 0}}, {"normal", {-1, 0, 0}}}}}};
  Arena arena(1);
  EXPECT_THAT(message_of([&] { (void)build_scene(job_of(document, {}), arena, Interrupter{}); }),
              HasSubstr("probes[0].region: touches no particle"));
  // A coarse level of a fit need not have what the job's own scene has.
  EXPECT_NO_THROW((void)scene_at_level(job_of(document, {}), 2.0, arena, Interrupter{}));
}

TEST(BuildScene, ThePinnedPlaneIsAFaceOfTheLattice) {
  const Folder folder;
  Json document = falling_cube();
  Json& body = document["scene"]["bodies"][0];
  body["source"] = {{"sphere", {{"radius", 0.2}}}};
  body["placement"] = {{"position", {0, 0, 1}}, {"rotation", {0.9238795325, 0, 0.3826834324, 0}}};
  const Vec3d normal = Quatd(0.9238795325, 0, 0.3826834324, 0).normalized() * Vec3d::UnitX();
  const Vec3d point = Vec3d(0, 0, 1) - 0.137 * normal;
  body["pins"] = {{{"region",
                    {{"shape", "plane"},
                     {"point", {point.x(), point.y(), point.z()}},
                     {"normal", {normal.x(), normal.y(), normal.z()}}}}}};
  Arena arena(1);
  const BuiltScene built = build_scene(job_of(document, folder.path), arena, Interrupter());
  const mpm::Lattice& lattice = built.scene.bodies[0].lattice;
  ASSERT_TRUE(lattice.regular);
  const double cells = (lattice.axes * Vec3d::UnitX()).dot(point - lattice.origin) / 0.05;
  EXPECT_NEAR(cells, std::round(cells), 1e-5);
}

TEST(Targets, ThatNobodyKnowsAreRefusedByName) {
  EXPECT_EQ(target_from_name("auto"), mpm::SimdTarget::kAuto);
  EXPECT_EQ(target_from_name(""), mpm::SimdTarget::kAuto);
  for (const char* bad : {"avx9", "AVX2", "sse"}) {
    try {
      (void)target_from_name(bad);
      FAIL() << bad;
    } catch (const Error& error) {
      EXPECT_THAT(error.what(), HasSubstr(bad));
      EXPECT_THAT(error.what(), HasSubstr("expected auto, sse4, avx2 or avx512"));
    }
  }
}

}  // namespace
}  // namespace matterfit::job
