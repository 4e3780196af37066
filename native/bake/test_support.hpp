// SPDX-License-Identifier: GPL-3.0-or-later
// Shared by the tests of this room: a scratch folder, bodies of particles, and independent readers.
#pragma once

#include <gtest/gtest.h>
#include <sys/resource.h>
#include <unistd.h>

#include <array>
#include <csignal>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iterator>
#include <string>
#include <vector>

#include "bake/particles.hpp"
#include "base/error.hpp"

namespace matterfit::bake {

class FolderTest : public ::testing::Test {
 protected:
  void SetUp() override {
    const auto* info = ::testing::UnitTest::GetInstance()->current_test_info();
    folder_ = std::filesystem::temp_directory_path() /
              ("matterfit_bake_" + std::string(info->test_suite_name()) + "_" + info->name() + "_" +
               std::to_string(::getpid()));
    std::filesystem::create_directories(folder_);
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }
  std::filesystem::path folder_;
};

/// Particles with what a ParticleView borrows.
struct Specimen {
  std::vector<Vec3d> rest;
  std::vector<double> volumes;
  std::vector<Vec3f> positions;
  std::vector<Vec3f> velocities;
  std::vector<Mat3f> deformation;
  double separation = 0.0;

  /// x = A X + b, v = W x.
  void move(const Mat3d& a, const Vec3d& b, const Mat3d& w = Mat3d::Zero()) {
    for (std::size_t i = 0; i < rest.size(); ++i) {
      const Vec3d x = a * rest[i] + b;
      positions[i] = x.cast<float>();
      velocities[i] = (w * x).cast<float>();
      deformation[i] = a.cast<float>();
    }
  }
  [[nodiscard]] ParticleView view() const {
    return {"blob", positions, velocities, deformation, volumes, separation, Quatd::Identity()};
  }
};

/// Lattice points of spacing h (cell centres) where `inside` holds, in [-extent, extent]³.
inline Specimen lattice_body(double h, double extent,
                             const std::function<bool(const Vec3d&)>& inside) {
  Specimen body;
  body.separation = h;
  const int n = static_cast<int>(std::ceil(extent / h));
  for (int i = -n; i < n; ++i)
    for (int j = -n; j < n; ++j)
      for (int k = -n; k < n; ++k) {
        const Vec3d x = h * (Vec3d(i, j, k) + Vec3d::Constant(0.5));
        if (inside(x)) body.rest.push_back(x);
      }
  body.volumes.assign(body.rest.size(), h * h * h);
  body.positions.resize(body.rest.size());
  body.velocities.resize(body.rest.size());
  body.deformation.resize(body.rest.size());
  body.move(Mat3d::Identity(), Vec3d::Zero());
  return body;
}

inline Specimen ball(double h, double radius) {
  return lattice_body(h, radius, [=](const Vec3d& x) { return x.norm() < radius; });
}

inline Specimen cube(double h, double half) {
  return lattice_body(h, half, [](const Vec3d&) { return true; });
}

inline std::string slurp(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
}

inline void spill(const std::filesystem::path& path, const std::string& bytes) {
  std::ofstream(path, std::ios::binary)
      .write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
}

/// Standard output of a shell command; `status` its exit status.
inline std::string run(const std::string& command, int& status) {
  std::string text;
  FILE* pipe = ::popen((command + " 2>&1").c_str(), "r");
  if (pipe == nullptr) {
    status = -1;
    return text;
  }
  std::array<char, 4096> buffer{};
  std::size_t count = 0;
  while ((count = std::fread(buffer.data(), 1, buffer.size(), pipe)) > 0) {
    text.append(buffer.data(), count);
  }
  status = ::pclose(pipe);
  return text;
}

/// Runs a script under Debian's Python; `modules` are those it needs. Returns what it prints, or
/// the empty string with `skip` set to the reason.
inline std::string run_python(const std::filesystem::path& folder, const std::string& modules,
                              const std::string& script, std::string& skip) {
  int status = 0;
  run("/usr/bin/python3 -c 'import " + modules + "'", status);
  if (status != 0) {
    skip = "/usr/bin/python3 cannot import " + modules;
    return {};
  }
  spill(folder / "reader.py", script);
  std::string text = run("cd '" + folder.string() + "' && /usr/bin/python3 reader.py", status);
  EXPECT_EQ(status, 0) << text;
  return text;
}

/// Writes fail after `bytes` of a file, as on a full disk, while it lives.
class FullDisk {
 public:
  explicit FullDisk(rlim_t bytes) {
    ::getrlimit(RLIMIT_FSIZE, &saved_);
    handler_ = std::signal(SIGXFSZ, SIG_IGN);
    rlimit small = saved_;
    small.rlim_cur = bytes;
    ::setrlimit(RLIMIT_FSIZE, &small);
  }
  ~FullDisk() {
    ::setrlimit(RLIMIT_FSIZE, &saved_);
    std::signal(SIGXFSZ, handler_);
  }
  FullDisk(const FullDisk&) = delete;
  FullDisk& operator=(const FullDisk&) = delete;

 private:
  rlimit saved_{};
  void (*handler_)(int) = SIG_DFL;
};

/// The message of the Error(kind) that `work` throws; fails the test if it throws none.
inline std::string message_of(ErrorKind kind, const std::function<void()>& work) {
  try {
    work();
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), kind) << error.what();
    return error.what();
  }
  ADD_FAILURE() << "nothing was thrown";
  return {};
}

}  // namespace matterfit::bake
