// SPDX-License-Identifier: GPL-3.0-or-later
#include "bake/verify.hpp"

#include <gtest/gtest.h>
#include <openvdb/io/File.h>
#include <openvdb/tools/LevelSetSphere.h>
#include <unistd.h>

#include <cstdlib>
#include <random>
#include <vector>

#include "bake/attributes.hpp"
#include "bake/guarded_read.hpp"
#include "bake/pc2.hpp"
#include "bake/test_support.hpp"
#include "bake/vdb_file.hpp"
#include "bake/volume.hpp"
#include "base/file.hpp"
#include "capture/splats.hpp"

namespace matterfit::bake {
namespace {

namespace fs = std::filesystem;

bool says(const std::optional<std::string>& problem, const std::string& word) {
  return problem && problem->find(word) != std::string::npos;
}

class VerifyTest : public FolderTest {
 protected:
  fs::path our_vdb() {
    const Specimen body = ball(0.05, 0.3);
    const capture::ParticleView view = body.view();
    Arena arena(2);
    const Interrupter interrupter;
    VolumeOptions options;
    options.surface = true;
    write_volume(folder_ / "ours.vdb", {&view, 1}, options, arena, interrupter);
    return folder_ / "ours.vdb";
  }
  fs::path foreign_vdb() {
    initialize_openvdb();
    auto grid =
        openvdb::tools::createLevelSetSphere<openvdb::FloatGrid>(1.0F, openvdb::Vec3f(0.0F), 0.05F);
    grid->setName("surface");
    openvdb::io::File file((folder_ / "foreign.vdb").string());
    file.write({grid});
    file.close();
    return folder_ / "foreign.vdb";
  }
};

TEST_F(VerifyTest, RecordsCatchMissingTruncatedAndChangedFiles) {
  write_file(folder_ / "sub" / "a.bin", "0123456789");
  const FileRecord record = record_file(folder_, fs::path("sub") / "a.bin");
  EXPECT_EQ(record.path, "sub/a.bin");
  EXPECT_EQ(record.size, 10U);
  EXPECT_EQ(record.hash.size(), 32U);
  EXPECT_FALSE(verify_file(folder_, record));
  spill(folder_ / "sub" / "a.bin", "01234567");
  EXPECT_TRUE(says(verify_file(folder_, record), "truncated: 8 bytes of 10"));
  spill(folder_ / "sub" / "a.bin", "01234x6789");
  EXPECT_TRUE(says(verify_file(folder_, record), "changed"));
  fs::remove(folder_ / "sub" / "a.bin");
  EXPECT_TRUE(says(verify_file(folder_, record), "sub/a.bin: missing"));
  EXPECT_THROW((void)record_file(folder_, "none"), Error);
}

// Every flipped byte and every truncation of our own VDB is seen, without OpenVDB opening it.
TEST_F(VerifyTest, OurVdbChecksItself) {
  const fs::path path = our_vdb();
  EXPECT_FALSE(verify_vdb(path));
  EXPECT_FALSE(verify_vdb(path, {"density", "surface"}));
  EXPECT_TRUE(says(verify_vdb(path, {"velocity"}), "no grid 'velocity'"));
  const std::string bytes = slurp(path);
  std::mt19937 random(4);
  for (int trial = 0; trial < 60; ++trial) {
    std::string broken = bytes;
    const std::size_t at = 8 + random() % (bytes.size() - 8);
    if (trial % 2 == 0) {
      broken[at] = static_cast<char>(broken[at] ^ static_cast<char>(1U << (random() % 8U)));
    } else {
      broken.resize(at);
    }
    spill(path, broken);
    const auto problem = verify_vdb(path);
    EXPECT_TRUE(problem) << "byte " << at;
  }
  spill(path, "not a vdb at all");
  EXPECT_TRUE(says(verify_vdb(path), "not a VDB"));
  fs::remove(path);
  EXPECT_TRUE(says(verify_vdb(path), "missing"));
}

// A foreign file is read in a child: this process outlives whatever OpenVDB does with it.
TEST_F(VerifyTest, ForeignVdbIsReadInAChild) {
  const fs::path path = foreign_vdb();
  const std::string bytes = slurp(path);
  EXPECT_EQ(verify_vdb(path, {"surface"}), std::nullopt);
  EXPECT_TRUE(says(verify_vdb(path, {"density"}), "no grid 'density'"));
  spill(path, bytes.substr(0, bytes.size() / 2));
  EXPECT_TRUE(verify_vdb(path));
  GuardLimits limits;
  limits.seconds = 2.0;
  limits.memory = std::uint64_t{1} << 30U;
  std::mt19937 random(8);
  int refused = 0;
  for (int trial = 0; trial < 25; ++trial) {
    std::string broken = bytes;
    // In the header and the topology, where it hurts.
    for (int k = 0; k < 4; ++k) {
      broken[60 + random() % 2000] = static_cast<char>(random() % 256U);
    }
    spill(path, broken);
    refused += verify_vdb(path, {}, limits) ? 1 : 0;
  }
  EXPECT_GT(refused, 5);
}

TEST_F(VerifyTest, GuardSurvivesAbortHangAndMemory) {
  EXPECT_FALSE(run_guarded([] { return std::string(); }));
  EXPECT_EQ(run_guarded([] { return std::string("is odd"); }), "is odd");
  EXPECT_EQ(run_guarded([]() -> std::string { throw std::runtime_error("is broken"); }),
            "is broken");
  EXPECT_TRUE(says(run_guarded([]() -> std::string { std::abort(); }), "Abort"));
  GuardLimits limits;
  limits.seconds = 0.3;
  EXPECT_TRUE(says(run_guarded(
                       []() -> std::string {
                         for (;;) ::pause();
                       },
                       limits),
                   "within 0.3 s"));
  limits.seconds = 20.0;
  limits.memory = std::uint64_t{256} << 20U;
#if !defined(__SANITIZE_ADDRESS__)
  const auto greedy = run_guarded(
      [] {
        std::vector<char> memory(std::size_t{1} << 30U, 'x');
        return std::string(memory.back() == 'x' ? "" : "?");
      },
      limits);
  EXPECT_TRUE(says(greedy, "memory"));
#endif
}

TEST_F(VerifyTest, Pc2) {
  const fs::path path = folder_ / "a.pc2";
  {
    Pc2Writer writer(path, {3, 1.0F, 1.0F});
    for (int i = 0; i < 4; ++i) writer.append(std::vector<Vec3f>(3, Vec3f::Zero()));
    writer.finish();
  }
  EXPECT_FALSE(verify_pc2(path, 3, 4));
  EXPECT_TRUE(says(verify_pc2(path, 4, 4), "4 frames of 3 points, expected 4 of 4"));
  EXPECT_TRUE(says(verify_pc2(path, 3, 5), "expected 5 of 3"));
  const std::string bytes = slurp(path);
  spill(path, bytes.substr(0, bytes.size() - 1));
  EXPECT_TRUE(says(verify_pc2(path, 3, 4), "truncated"));
  spill(path, bytes + "x");
  EXPECT_TRUE(says(verify_pc2(path, 3, 4), "too long"));
  spill(path, bytes.substr(0, 20));
  EXPECT_TRUE(says(verify_pc2(path, 3, 4), "truncated"));
  spill(path, std::string(100, 'x'));
  EXPECT_TRUE(says(verify_pc2(path, 3, 4), "not a point cache"));
  EXPECT_TRUE(says(verify_pc2(folder_ / "none.pc2", 3, 4), "missing"));
  EXPECT_TRUE(says(verify_pc2(folder_, 3, 4), "not a regular file"));
}

TEST_F(VerifyTest, Exr) {
  const fs::path path = folder_ / "a.exr";
  const std::size_t n = 5000;
  std::vector<float> values(3 * n);
  for (std::size_t i = 0; i < values.size(); ++i) values[i] = static_cast<float>(i % 977);
  write_attribute_texture(path, texture_layout(n), values);
  EXPECT_EQ(verify_exr(path, n), std::nullopt);
  EXPECT_EQ(verify_exr(path), std::nullopt);
  EXPECT_TRUE(says(verify_exr(path, n + 1), "not of 5001 points"));
  const std::string bytes = slurp(path);
  for (const std::size_t size : {std::size_t{0}, std::size_t{100}, bytes.size() / 2}) {
    spill(path, bytes.substr(0, size));
    EXPECT_TRUE(verify_exr(path, n)) << size;
  }
  EXPECT_TRUE(says(verify_exr(folder_ / "none.exr"), "missing"));
}

TEST_F(VerifyTest, SplatPly) {
  capture::Splats splats;
  splats.means.assign(10, Vec3f::Zero());
  splats.rotations.assign(10, Eigen::Quaternionf::Identity());
  splats.scales.assign(10, Vec3f::Constant(0.1F));
  splats.opacities.assign(10, 0.5F);
  splats.sh.assign(30, 0.0F);
  const fs::path path = folder_ / "a.ply";
  capture::write_splats(path, splats);
  EXPECT_EQ(verify_splat_ply(path, 10), std::nullopt);
  EXPECT_TRUE(says(verify_splat_ply(path, 11), "10 splats, expected 11"));
  const std::string bytes = slurp(path);
  spill(path, bytes.substr(0, bytes.size() - 7));
  EXPECT_TRUE(says(verify_splat_ply(path), "a.ply"));
  EXPECT_TRUE(says(verify_splat_ply(folder_ / "none.ply"), "missing"));
}

// Root writes anywhere, so this runs in a child under another user.
TEST_F(VerifyTest, ReadOnlyFolderIsANamedError) {
  const bool root = ::geteuid() == 0;
  fs::permissions(folder_, fs::perms::owner_read | fs::perms::owner_exec | fs::perms::others_read |
                               fs::perms::others_exec);
  const auto problem = run_guarded([&]() -> std::string {
    if (root && (::setgid(65534) != 0 || ::setuid(65534) != 0)) return "cannot become another user";
    std::string text;
    try {
      write_vdb(folder_ / "a.vdb", {}, VdbCompression::kBlosc);
      return "a VDB was written";
    } catch (const Error& error) {
      text += error.what();
    }
    try {
      const Pc2Writer writer(folder_ / "a.pc2", {1, 1.0F, 1.0F});
      return "a PC2 was written";
    } catch (const Error& error) {
      text += error.what();
    }
    return text;
  });
  fs::permissions(folder_, fs::perms::owner_all);
  if (problem == "cannot become another user") GTEST_SKIP() << *problem;
  EXPECT_TRUE(says(problem, "a.vdb") && says(problem, "a.pc2") &&
              says(problem, "Choose an output folder that can be written to"))
      << problem.value_or("nothing");
}

}  // namespace
}  // namespace matterfit::bake
