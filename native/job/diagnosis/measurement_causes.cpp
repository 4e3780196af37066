// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/diagnosis/measurement_causes.hpp"

#include <algorithm>
#include <utility>

#include "job/diagnosis/cause_row.hpp"
#include "job/diagnosis/extent.hpp"
#include "job/diagnosis/ground_slope.hpp"
#include "math/rotation_vector.hpp"

namespace matterfit::job {
namespace {

using diagnose::Observation;

constexpr const char* kScaleSentence = "Lengths of the recording are {value} larger than true.";
/// A body's height apart, in frames, at which one would care for a rolling shutter.
constexpr double kShutter = 0.2;

class MeasurementCauses {
 public:
  MeasurementCauses(const Job& job, const mpm::Scene& scene,
                    const std::vector<fit::Address>& fitted)
      : job_(job), scene_(scene), fitted_(fitted), body_(extent_of(scene.bodies.front())) {}

  std::vector<Cause> all() {
    if (scene_.gravity.values.size() == 1 && !fitted(fit::Owner::kScene, "gravity") &&
        scene_.gravity.values.front().norm() > 0.0) {
      if (free()) scale_of_fall();
      roll();
    }
    seen();
    return std::move(causes_);
  }

 private:
  [[nodiscard]] bool fitted(fit::Owner owner, std::string_view path) const {
    return fit::is_among(fit::row_named(owner, path), fitted_);
  }

  /// Thrown, not held and let go.
  [[nodiscard]] bool free() const { return scene_.bodies.front().pins.empty(); }

  Cause& add(const char* name, const char* sentence) {
    return add_cause(causes_, name, "measurement", sentence);
  }

  /// Points of a thrown body are tied to it where the first frame shows them, so in a recording
  /// whose lengths are too large the body is too large with it, and in those lengths gravity is
  /// stronger.
  void scale_of_fall() {
    Cause& cause = add("scale", kScaleSentence);
    cause.row.numbers = {number("factor", "", 0.01)};
    cause.row.confused_with = {"gravity_size", "frame_rate"};
    cause.apply = [](std::span<const double> v, int, mpm::Scene& scene) {
      for (Vec3d& gravity : scene.gravity.values) gravity *= 1.0 + v[0];
    };
    cause.write = [g = scene_.gravity.values.front()](std::span<const double> v, int, Json& scene) {
      put_gravity((1.0 + v[0]) * g, scene);
    };
  }

  /// The camera is not as level as the recording says. Points are tied to the body where the
  /// first frame shows them, so the body stands in the camera's axes, and what is turned against it
  /// is all else: gravity and level grounds.
  void roll() {
    using Shape = ColliderDoc::Shape;
    const auto& colliders = job_.scene.colliders;
    if (!std::ranges::all_of(colliders, [](const auto& c) { return c.shape == Shape::kGround; })) {
      return;
    }
    Cause& cause =
        add("camera_roll", "The camera is rolled: what the recording calls up leans by {value}.");
    cause.row.numbers = {number("x", "rad", 0.01), number("y", "rad", 0.01)};
    cause.row.confused_with = {"gravity_direction", "ground_tilt"};
    std::vector<Vec3d> feet;
    feet.reserve(colliders.size());
    for (const ColliderDoc& ground : colliders) {
      feet.emplace_back(body_.center.x(), body_.center.y(), ground.height);
    }
    const auto lean = [](std::span<const double> v) { return rotation_by(Vec3d(v[0], v[1], 0.0)); };
    cause.apply = [lean, feet](std::span<const double> v, int, mpm::Scene& scene) {
      const Mat3d turn = lean(v);
      for (Vec3d& gravity : scene.gravity.values) gravity = turn * gravity;
      const std::size_t grounds = std::min(feet.size(), scene.colliders.size());
      for (std::size_t c = 0; c < grounds; ++c) {
        scene.colliders[c] = sloped(scene.colliders[c], feet[c], turn * Vec3d::UnitZ());
      }
    };
    cause.write = [lean, feet, now = scene_.gravity.values.front()](std::span<const double> v, int,
                                                                    Json& scene) {
      const Mat3d turn = lean(v);
      put_gravity(turn * now, scene);
      for (std::size_t c = 0; c < feet.size(); ++c) {
        write_slope(feet[c], turn * Vec3d::UnitZ(), scene.at("colliders").at(c));
      }
    };
  }

  /// What the engine does to the simulated motion, in closed form.
  void seen() {
    const auto observation = [&](const char* name, Observation kind,
                                 std::vector<diagnose::Number> numbers, const char* sentence,
                                 std::vector<std::string> confused) {
      Cause& cause = add(name, sentence);
      cause.row.observation = kind;
      cause.row.numbers = std::move(numbers);
      cause.row.confused_with = std::move(confused);
      cause.row.pivot = body_.center;
    };
    const double frame = 1.0 / scene_.fps;
    if (!fitted(fit::Owner::kCapture, "start_frame")) {
      observation("time_offset", Observation::kTimeOffset, {number("offset", "s", 0.2 * frame)},
                  "The recording begins {value} later than stated.", {"velocity"});
    }
    observation("frame_rate", Observation::kFrameRate, {number("factor", "", 0.01)},
                "The recording runs {value} faster than stated.", {"gravity_size", "scale"});
    if (!free()) {
      observation("scale", Observation::kScale, {number("factor", "", 0.01)}, kScaleSentence,
                  {"gravity_size", "frame_rate"});
    }
    observation("camera_drift", Observation::kDrift,
                {number("x", "m/s", 0.01), number("y", "m/s", 0.01), number("z", "m/s", 0.01)},
                "The camera drifts by {value}.", {"velocity", "friction"});
    observation("rolling_shutter", Observation::kRollingShutter,
                {number("time", "s/m", kShutter * frame / body_.size)},
                "What is higher is seen later, by {value}: a rolling shutter.",
                {"time_offset", "spin"});
    observation("tracker_lag", Observation::kLag, {number("time", "s", 0.2 * frame, true)},
                "The tracker lags by {value}.", {"time_offset"});
  }

  const Job& job_;
  const mpm::Scene& scene_;
  const std::vector<fit::Address>& fitted_;
  Extent body_;
  std::vector<Cause> causes_;
};

}  // namespace

std::vector<Cause> measurement_causes(const Job& job, const mpm::Scene& scene,
                                      const std::vector<fit::Address>& fitted) {
  return MeasurementCauses(job, scene, fitted).all();
}

}  // namespace matterfit::job
