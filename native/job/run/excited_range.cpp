// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/run/excited_range.hpp"

#include <fmt/format.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

namespace matterfit::job {
namespace {

constexpr double kMostParticles = 0.95;
/// A recording's strains are known about as well as this.
constexpr double kBeyond = 1.25;
constexpr double kBeyondVolume = 0.01;
/// fit::excitation() looks no farther: what is there may have been more.
constexpr double kLargestKnownStrain = 1.0;
constexpr double kLargestKnownVolume = 0.5;

double within(std::vector<double>& values) {
  if (values.empty()) return 0.0;
  const auto at = static_cast<std::ptrdiff_t>(kMostParticles * double(values.size() - 1));
  std::nth_element(values.begin(), values.begin() + at, values.end());
  return values[static_cast<std::size_t>(at)];
}

}  // namespace

ExcitedRange::ExcitedRange(const SceneDoc& scene) : frame_seconds_(1.0 / scene.fps) {
  for (std::size_t b = 0; b < scene.bodies.size(); ++b) {
    const BodyDoc& body = scene.bodies[b];
    if (!body.excited) continue;
    Watched one;
    one.body = b;
    one.name = body.name;
    one.excited = *body.excited;
    one.fluid = body.material.traits().fluid;
    watched_.push_back(std::move(one));
  }
}

bool ExcitedRange::any() const { return !watched_.empty(); }

void ExcitedRange::record(const mpm::FrameState& state) {
  const double of_plastic = std::sqrt(1.5);
  for (Watched& one : watched_) {
    const mpm::BodyState& body = state.bodies[one.body];
    const std::vector<Mat3f>& now = body.deformation_gradients;
    const bool plastic = body.plastic_strain.size() == now.size();
    std::vector<double> shapes;
    std::vector<double> losses;
    std::vector<double> gains;
    std::vector<double> rates;
    for (std::size_t p = 0; p < now.size(); ++p) {
      const Mat3d f = now[p].cast<double>();
      const double volume = f.determinant();
      if (!(volume > 0.0)) continue;
      losses.push_back(-std::log(volume));
      gains.push_back(std::log(volume));
      if (one.fluid) continue;
      const Eigen::SelfAdjointEigenSolver<Mat3d> stretch(f.transpose() * f, Eigen::EigenvaluesOnly);
      const Vec3d strain = 0.5 * stretch.eigenvalues().array().log();
      const double kept = plastic ? of_plastic * double(body.plastic_strain[p]) : 0.0;
      shapes.push_back((strain.array() - strain.mean()).matrix().norm() + kept);
      if (one.gradients.size() != now.size()) continue;
      const Mat3d before = one.gradients[p].cast<double>();
      if (!(before.determinant() > 0.0)) continue;
      Mat3d rate = f * before.inverse() - Mat3d::Identity();
      rate = Mat3d(0.5 * (rate + rate.transpose()));
      rate -= rate.trace() / 3.0 * Mat3d::Identity();
      const double flowed =
          plastic ? of_plastic * double(body.plastic_strain[p] - one.plastic[p]) : 0.0;
      rates.push_back((rate.norm() + flowed) / frame_seconds_);
    }
    const auto raise = [&](Most& most, std::vector<double>& values) {
      const double value = within(values);
      if (value > most.value) most = {value, state.frame};
    };
    raise(one.strain, shapes);
    raise(one.compression, losses);
    raise(one.expansion, gains);
    raise(one.rate, rates);
    one.gradients = now;
    one.plastic = body.plastic_strain;
  }
}

std::vector<std::string> ExcitedRange::notes() const {
  std::vector<std::string> all;
  for (const Watched& one : watched_) {
    std::string what;
    const auto add = [&](const char* name, const Most& most, double seen, const char* unit) {
      what += fmt::format("{}{} of {:.2g}{} at frame {} (seen: {:.2g})", what.empty() ? "" : ", ",
                          name, most.value, unit, most.frame, seen);
    };
    const material::Excitation& seen = one.excited;
    if (one.strain.value > kBeyond * seen.strain && seen.strain < kLargestKnownStrain) {
      add("a strain", one.strain, seen.strain, "");
    }
    const auto leaves = [&](const Most& most, double of) {
      return most.value > kBeyond * of + kBeyondVolume && of < kLargestKnownVolume;
    };
    if (leaves(one.compression, seen.compression)) {
      add("a loss of volume", one.compression, seen.compression, "");
    }
    if (leaves(one.expansion, seen.expansion)) {
      add("a gain of volume", one.expansion, seen.expansion, "");
    }
    if (one.rate.value > kBeyond * seen.fastest) add("a rate", one.rate, seen.fastest, " 1/s");
    if (what.empty()) continue;
    all.push_back(fmt::format(
        "'{}' leaves what its material was seen at when it was fitted: {}. There its law is "
        "extrapolated; fit a recording that goes as far.",
        one.name, what));
  }
  return all;
}

}  // namespace matterfit::job
