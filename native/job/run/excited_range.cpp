// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/run/excited_range.hpp"

#include <fmt/format.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>

#include "fit/data/excitation.hpp"

namespace matterfit::job {
namespace {

constexpr double kMostParticles = 0.95;
/// A recording's strains are known about as well as this.
constexpr double kBeyond = 1.25;
constexpr double kBeyondVolume = 0.01;
/// seen() goes no farther: there may have been more.
constexpr double kLargestKnownStrain = 2.5;
constexpr double kLargestKnownVolume = 1.5;
constexpr double kLeastKnownStrain = 0.01;
constexpr double kLeastKnownRate = 1e-3;  // [1/s]

}  // namespace

ExcitedRange::ExcitedRange(const SceneDoc& scene, bool all) : frame_seconds_(1.0 / scene.fps) {
  for (std::size_t b = 0; b < scene.bodies.size(); ++b) {
    const BodyDoc& body = scene.bodies[b];
    if (!all && !body.excited) continue;
    Watched one;
    one.body = b;
    one.name = body.name;
    one.excited = body.excited;
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
    one.frames.push_back({state.frame, fit::within(shapes, kMostParticles),
                          fit::within(losses, kMostParticles), fit::within(gains, kMostParticles),
                          fit::within(rates, kMostParticles), fit::within(rates, 0.5)});
    one.gradients = now;
    one.plastic = body.plastic_strain;
  }
}

std::optional<material::Excitation> ExcitedRange::seen(const std::string& body,
                                                       double last_frame) const {
  const auto one = std::find_if(watched_.begin(), watched_.end(),
                                [&](const Watched& watched) { return watched.name == body; });
  if (one == watched_.end() || one->fluid) return std::nullopt;
  material::Excitation most;
  most.strain = most.compression = most.expansion = most.fastest = 0.0;
  std::vector<double> middle;
  for (const Frame& frame : one->frames) {
    if (frame.number > last_frame) continue;
    most.strain = std::max(most.strain, frame.strain);
    most.compression = std::max(most.compression, frame.compression);
    most.expansion = std::max(most.expansion, frame.expansion);
    most.fastest = std::max(most.fastest, frame.rate);
    middle.push_back(frame.middle_rate);
  }
  if (middle.empty()) return std::nullopt;
  most.strain = std::clamp(most.strain, kLeastKnownStrain, kLargestKnownStrain);
  most.compression = std::min(most.compression, kLargestKnownVolume);
  most.expansion = std::min(most.expansion, kLargestKnownVolume);
  most.slowest = std::max(fit::within(middle, 0.5), kLeastKnownRate);
  most.fastest = std::max(most.fastest, most.slowest);
  return most;
}

std::vector<std::string> ExcitedRange::notes() const {
  std::vector<std::string> all;
  for (const Watched& one : watched_) {
    if (!one.excited || one.frames.empty()) continue;
    std::string what;
    const auto check = [&](const char* name, double Frame::*member, double seen, double more,
                           double known, const char* unit) {
      const Frame& most =
          *std::max_element(one.frames.begin(), one.frames.end(),
                            [&](const Frame& a, const Frame& b) { return a.*member < b.*member; });
      if (!(most.*member > kBeyond * seen + more) || seen >= known) return;
      what += fmt::format("{}{} of {:.2g}{} at frame {} (seen: {:.2g})", what.empty() ? "" : ", ",
                          name, most.*member, unit, most.number, seen);
    };
    const material::Excitation& seen = *one.excited;
    constexpr double kAny = std::numeric_limits<double>::infinity();
    check("a strain", &Frame::strain, seen.strain, 0.0, kLargestKnownStrain, "");
    check("a loss of volume", &Frame::compression, seen.compression, kBeyondVolume,
          kLargestKnownVolume, "");
    check("a gain of volume", &Frame::expansion, seen.expansion, kBeyondVolume, kLargestKnownVolume,
          "");
    check("a rate", &Frame::rate, seen.fastest, 0.0, kAny, " 1/s");
    if (what.empty()) continue;
    all.push_back(fmt::format(
        "'{}' leaves what its material was seen at when it was fitted: {}. There its law is "
        "extrapolated; fit a recording that goes as far.",
        one.name, what));
  }
  return all;
}

}  // namespace matterfit::job
