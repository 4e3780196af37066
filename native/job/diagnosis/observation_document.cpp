// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/diagnosis/observation_document.hpp"

#include <Eigen/Geometry>
#include <algorithm>

namespace matterfit::job {
namespace {

using Matrix4 = Eigen::Matrix<double, 4, 4, Eigen::RowMajor>;

/// Lays `correction` over the capture's transform and keeps its points where they are on the body.
bool correct_places(const Eigen::Affine3d& correction, const ObservedCapture& about,
                    Json& capture) {
  if (about.doc.align) return false;
  if (!std::all_of(about.rest.begin(), about.rest.end(),
                   [](const Vec3d& x) { return x.allFinite(); })) {
    return false;
  }
  const Eigen::Map<const Matrix4> now(about.doc.transform.data());
  const Matrix4 transform = correction.matrix() * now;
  Json rows = Json::array();
  for (int i = 0; i < 4; ++i) {
    rows.push_back(
        Json::array({transform(i, 0), transform(i, 1), transform(i, 2), transform(i, 3)}));
  }
  Json places = Json::array();
  for (const Vec3d& x : about.rest) places.push_back(Json::array({x.x(), x.y(), x.z()}));
  capture["transform"] = std::move(rows);
  capture["positions"] = std::move(places);
  return true;
}

}  // namespace

bool write_observation(const diagnose::Effect& effect, std::span<const double> values,
                       const ObservedCapture& about, Json& capture) {
  const double value = values.front();
  const Eigen::Translation3d there(effect.pivot);
  const Eigen::Translation3d back(-effect.pivot);
  switch (effect.observation) {
    case diagnose::Observation::kTimeOffset:
      capture["start_frame"] =
          about.doc.start_frame.value_or(about.first_frame) + value * about.fps;
      return true;
    case diagnose::Observation::kScale:
      return correct_places(there * Eigen::Scaling(1.0 / (1.0 + value)) * back, about, capture);
    default:
      return false;
  }
}

}  // namespace matterfit::job
