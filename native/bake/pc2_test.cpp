// SPDX-License-Identifier: GPL-3.0-or-later
#include "bake/pc2.hpp"

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "bake/test_support.hpp"

namespace matterfit::bake {
namespace {

namespace fs = std::filesystem;

class Pc2Test : public FolderTest {
 protected:
  static std::vector<Vec3f> frame(std::size_t index) {
    std::vector<Vec3f> positions(5);
    for (std::size_t i = 0; i < positions.size(); ++i) {
      positions[i] = Vec3f(static_cast<float>(index), 0.1F * static_cast<float>(i), -3.0F);
    }
    return positions;
  }
  fs::path unbroken() {
    const fs::path path = folder_ / "unbroken.pc2";
    Pc2Writer writer(path, options_);
    for (std::size_t i = 0; i < 6; ++i) writer.append(frame(i));
    writer.finish();
    return path;
  }
  Pc2Writer::Options options_{5, 1001.0F, 1.0F};
};

TEST_F(Pc2Test, NumpyReadsHeaderAndSamples) {
  unbroken();
  std::string skip;
  const std::string text = run_python(folder_, "numpy", R"(
import numpy as np, struct
raw = open('unbroken.pc2', 'rb').read()
assert raw[:12] == b'POINTCACHE2\0'
assert struct.unpack('<iiffi', raw[12:32]) == (1, 5, 1001.0, 1.0, 6)
a = np.frombuffer(raw[32:], '<f4').reshape(6, 5, 3)
assert (a[:, :, 0] == np.arange(6)[:, None]).all()
assert np.allclose(a[3, :, 1], .1 * np.arange(5)) and (a[:, :, 2] == -3).all()
print('read')
)",
                                      skip);
  if (!skip.empty()) GTEST_SKIP() << skip;
  EXPECT_EQ(text, "read\n");
}

TEST_F(Pc2Test, ResumedBytesAreThoseOfAnUnbrokenRun) {
  const std::string expected = slurp(unbroken());
  const fs::path path = folder_ / "resumed.pc2";
  {
    Pc2Writer writer(path, options_);
    for (std::size_t i = 0; i < 4; ++i) writer.append(frame(i + 100 * (i == 3)));
  }
  EXPECT_FALSE(fs::exists(path)) << "the final name appears with finish() only";
  // Killed in the middle of a frame, after the checkpoint of three.
  spill(Pc2Writer::partial_path(path), slurp(Pc2Writer::partial_path(path)) + "half a frame");
  Pc2Writer writer = Pc2Writer::resume(path, options_, 3);
  EXPECT_EQ(writer.frames(), 3U);
  for (std::size_t i = 3; i < 6; ++i) writer.append(frame(i));
  writer.finish();
  EXPECT_EQ(slurp(path), expected);
  EXPECT_FALSE(fs::exists(Pc2Writer::partial_path(path)));
}

TEST_F(Pc2Test, ResumeRefusesWhatDoesNotFit) {
  const fs::path path = folder_ / "a.pc2";
  const auto refused = [&](const Pc2Writer::Options& options, std::size_t frames) {
    return message_of(ErrorKind::kInput, [&] { (void)Pc2Writer::resume(path, options, frames); });
  };
  EXPECT_NE(refused(options_, 0).find("a.pc2.partial"), std::string::npos);
  {
    Pc2Writer writer(path, options_);
    writer.append(frame(0));
  }
  EXPECT_NE(refused({6, 1001.0F, 1.0F}, 1).find("another number of points"), std::string::npos);
  EXPECT_NE(refused(options_, 2).find("2 frames need"), std::string::npos);
  spill(Pc2Writer::partial_path(path), "short");
  EXPECT_NE(refused(options_, 0).find("not a point cache"), std::string::npos);
}

TEST_F(Pc2Test, NoFramesAndNoPointsAreValid) {
  Pc2Writer writer(folder_ / "a.pc2", {0, 1.0F, 1.0F});
  writer.append({});
  EXPECT_NE(message_of(ErrorKind::kInput, [&] { writer.append(frame(0)); }).find("5 positions"),
            std::string::npos);
  writer.finish();
  EXPECT_EQ(fs::file_size(folder_ / "a.pc2"), 32U);
}

TEST_F(Pc2Test, FullDiskIsAnErrorAndNoFinalName) {
  const FullDisk full(100);
  const fs::path path = folder_ / "full.pc2";
  const std::string message = message_of(ErrorKind::kOutput, [&] {
    Pc2Writer writer(path, options_);
    for (std::size_t i = 0; i < 6; ++i) writer.append(frame(i));
    writer.finish();
  });
  EXPECT_NE(message.find("full.pc2"), std::string::npos) << message;
  EXPECT_FALSE(fs::exists(path));
}

TEST_F(Pc2Test, BeyondFourGigabytes) {
  // Sparse: only the last frame is written, so the disk holds a few pages.
  const fs::path path = folder_ / "large.pc2";
  const Pc2Writer::Options options{1000, 1.0F, 1.0F};
  const std::size_t frames = 400'000;  // 4.8 GB
  { Pc2Writer writer(path, options); }
  std::error_code code;
  fs::resize_file(Pc2Writer::partial_path(path), 32 + std::uint64_t{12000} * frames, code);
  if (code) GTEST_SKIP() << "no sparse files here: " << code.message();
  Pc2Writer writer = Pc2Writer::resume(path, options, frames);
  writer.append(std::vector<Vec3f>(1000, Vec3f(1.0F, 2.0F, 3.0F)));
  writer.finish();
  EXPECT_EQ(fs::file_size(path), 32 + std::uint64_t{12000} * (frames + 1));
  std::ifstream file(path, std::ios::binary);
  file.seekg(static_cast<std::streamoff>(32 + std::uint64_t{12000} * frames));
  float x = 0.0F;
  file.read(reinterpret_cast<char*>(&x), 4);
  EXPECT_EQ(x, 1.0F);
}

}  // namespace
}  // namespace matterfit::bake
