// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <iomanip>
#include <limits>
#include <sstream>
#include <string>

#include "capture/cameras.hpp"

/// Writes COLMAP models by their documentation, apart from the code that reads them.
namespace matterfit::capture {

struct ColmapFiles {
  std::string cameras;
  std::string images;
};

/// Cameras of the models PINHOLE and OPENCV, a camera's number its place and 7 more.
inline ColmapFiles colmap_text(const CameraSet& set) {
  std::ostringstream cameras;
  std::ostringstream images;
  cameras << std::setprecision(std::numeric_limits<double>::max_digits10);
  images << std::setprecision(std::numeric_limits<double>::max_digits10);
  cameras << "# Camera list with one line of data per camera:\n";
  for (std::size_t k = 0; k < set.cameras.size(); ++k) {
    const splat::Camera& c = set.cameras[k];
    const Distortion lens = k < set.lenses.size() ? set.lenses[k] : Distortion{};
    cameras << k + 7 << (lens.none() ? " PINHOLE " : " OPENCV ") << c.width << ' ' << c.height
            << ' ' << c.fx << ' ' << c.fy << ' ' << c.cx << ' ' << c.cy;
    if (!lens.none())
      cameras << ' ' << lens.k1 << ' ' << lens.k2 << ' ' << lens.p1 << ' ' << lens.p2;
    cameras << '\n';
  }
  images << "# IMAGE_ID, QW, QX, QY, QZ, TX, TY, TZ, CAMERA_ID, NAME\n#   POINTS2D[]\n";
  for (std::size_t i = 0; i < set.shots.size(); ++i) {
    const splat::Camera& c = set.cameras[set.shots[i].camera];
    const Quatd q(c.rotation);
    images << i + 1 << ' ' << q.w() << ' ' << q.x() << ' ' << q.y() << ' ' << q.z() << ' '
           << c.translation.x() << ' ' << c.translation.y() << ' ' << c.translation.z() << ' '
           << set.shots[i].camera + 7 << ' ' << set.shots[i].image << '\n';
    images << (i % 2 == 0 ? "1.5 2.5 -1 3.5 4.5 12\n" : "\n");
  }
  return {cameras.str(), images.str()};
}

inline ColmapFiles colmap_binary(const CameraSet& set) {
  ColmapFiles files;
  const auto put = [](std::string& into, auto value) {
    into.append(reinterpret_cast<const char*>(&value), sizeof(value));
  };
  put(files.cameras, std::uint64_t(set.cameras.size()));
  for (std::size_t k = 0; k < set.cameras.size(); ++k) {
    const splat::Camera& c = set.cameras[k];
    const Distortion lens = k < set.lenses.size() ? set.lenses[k] : Distortion{};
    put(files.cameras, std::uint32_t(k + 7));
    put(files.cameras, std::int32_t(lens.none() ? 1 : 4));
    put(files.cameras, std::uint64_t(c.width));
    put(files.cameras, std::uint64_t(c.height));
    for (const double value : {c.fx, c.fy, c.cx, c.cy}) put(files.cameras, value);
    if (lens.none()) continue;
    for (const double value : {lens.k1, lens.k2, lens.p1, lens.p2}) put(files.cameras, value);
  }
  put(files.images, std::uint64_t(set.shots.size()));
  for (std::size_t i = 0; i < set.shots.size(); ++i) {
    const splat::Camera& c = set.cameras[set.shots[i].camera];
    const Quatd q(c.rotation);
    put(files.images, std::uint32_t(i + 1));
    for (const double value :
         {q.w(), q.x(), q.y(), q.z(), c.translation.x(), c.translation.y(), c.translation.z()}) {
      put(files.images, value);
    }
    put(files.images, std::uint32_t(set.shots[i].camera + 7));
    files.images += set.shots[i].image + '\0';
    put(files.images, std::uint64_t(i % 3));
    files.images.append(24 * (i % 3), 'p');
  }
  return files;
}

}  // namespace matterfit::capture
