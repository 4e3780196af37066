// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/diagnosis/ground_slope.hpp"

namespace matterfit::job {

shape::ColliderPtr sloped(const shape::ColliderPtr& ground, const Vec3d& foot,
                          const Vec3d& normal) {
  const Vec3d on = foot - Vec3d(0.0, 0.0, ground->closest(foot, 0.0).distance);
  return shape::make_plane(ground->name(), ground->contact(), on, normal);
}

void write_slope(const Vec3d& foot, const Vec3d& normal, Json& collider) {
  collider["shape"] = "plane";
  collider.erase("height");
  collider["point"] = {foot.x(), foot.y(), foot.z()};
  collider["normal"] = {normal.x(), normal.y(), normal.z()};
}

}  // namespace matterfit::job
