// SPDX-License-Identifier: GPL-3.0-or-later
#include "capture/camera_shots.hpp"

#include <cctype>
#include <cmath>
#include <filesystem>
#include <utility>

#include "base/error.hpp"

namespace matterfit::capture {
namespace {

constexpr double kSameCamera = 1e-9;
constexpr int kMostDigits = 9;

bool near(double x, double y) { return std::abs(x - y) <= kSameCamera; }

bool same(const splat::Camera& a, const splat::Camera& b) {
  return near(a.fx, b.fx) && near(a.fy, b.fy) && near(a.cx, b.cx) && near(a.cy, b.cy) &&
         (a.rotation - b.rotation).norm() <= kSameCamera &&
         (a.translation - b.translation).norm() <= kSameCamera;
}

bool same(const Distortion& a, const Distortion& b) {
  return near(a.k1, b.k1) && near(a.k2, b.k2) && near(a.k3, b.k3) && near(a.p1, b.p1) &&
         near(a.p2, b.p2);
}

std::string size_of(const splat::Camera& camera) {
  return std::to_string(camera.width) + " × " + std::to_string(camera.height);
}

}  // namespace

void add_shot(CameraSet& set, Shot shot, const splat::Camera& camera, const Distortion& lens,
              const std::string& where) {
  for (const double focal : {camera.fx, camera.fy}) {
    if (!(focal > 0.0) || !std::isfinite(focal)) {
      throw_input(where + " has a focal length of " + std::to_string(focal) + " pixels.");
    }
  }
  constexpr double kFarOff = 10.0;  // images away; one that is cut out of a larger one is nearer
  if (!(std::abs(camera.cx) <= kFarOff * camera.width) ||
      !(std::abs(camera.cy) <= kFarOff * camera.height)) {
    throw_input(where + " has its principal point ('cx', 'cy') at " + std::to_string(camera.cx) +
                ", " + std::to_string(camera.cy) + " pixels, far off its " + size_of(camera) + ".");
  }
  std::size_t k = 0;
  while (k < set.cameras.size() && !(same(set.cameras[k], camera) && same(set.lenses[k], lens))) {
    ++k;
  }
  if (k == set.cameras.size()) {
    check_distortion(lens, camera, where);
    set.cameras.push_back(camera);
    set.lenses.push_back(lens);
  } else if (set.cameras[k].width != camera.width || set.cameras[k].height != camera.height) {
    throw_input(where + " is " + size_of(camera) +
                " pixels, but an earlier image of the same camera is " + size_of(set.cameras[k]) +
                ". Scale them alike.");
  }
  shot.camera = k;
  set.shots.push_back(std::move(shot));
}

std::optional<int> last_digits(const std::string& image) {
  const auto is_digit = [](char c) { return std::isdigit(static_cast<unsigned char>(c)) != 0; };
  const std::string stem = std::filesystem::path(image).stem().string();
  std::size_t end = stem.size();
  while (end > 0 && !is_digit(stem[end - 1])) --end;
  std::size_t begin = end;
  while (begin > 0 && is_digit(stem[begin - 1])) --begin;
  if (begin == end || end - begin > kMostDigits) return std::nullopt;
  return std::stoi(stem.substr(begin, end - begin));
}

}  // namespace matterfit::capture
