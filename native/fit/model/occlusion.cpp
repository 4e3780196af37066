// SPDX-License-Identifier: GPL-3.0-or-later
#include "fit/model/occlusion.hpp"

#include <algorithm>
#include <cstdint>

namespace matterfit::fit {
namespace {

/// Fainter pixels count as empty.
constexpr float kFaint = 1.0F / 255.0F;
/// How far before the body a collider hides it, and how near to it a ray has met it [separations].
constexpr double kBefore = 2.0;
constexpr double kMet = 0.02;
constexpr int kMostSteps = 256;

/// Colliders that stand before a camera, at one time.
class Obstacles {
 public:
  Obstacles(const mpm::Scene& scene, double time, const Vec3d& shift, const splat::Camera& camera)
      : time_(time),
        eye_(camera.centre() + shift),
        to_world_(camera.rotation.transpose()),
        separation_(0.5 * scene.dx) {
    for (const shape::ColliderPtr& collider : scene.colliders) {
      if (collider->closest(eye_, time).distance > 0.0) before_.push_back(collider.get());
    }
  }

  [[nodiscard]] bool any() const { return !before_.empty(); }

  /// Whether one is met along the direction (camera's axes, z = 1) before `depth` [m].
  [[nodiscard]] bool hide(const Vec3d& direction, double depth) const {
    const Vec3d ray = to_world_ * direction;
    const double length = ray.norm();
    const double end = length * (depth - kBefore * separation_);
    return std::any_of(before_.begin(), before_.end(), [&](const shape::Collider* collider) {
      // The soft rim of what lies on it.
      if (collider->closest(eye_ + depth * ray, time_).distance <= 0.0) return false;
      double along = 0.0;
      for (int step = 0; step < kMostSteps && along < end; ++step) {
        const double distance = collider->closest(eye_ + (along / length) * ray, time_).distance;
        if (distance < kMet * separation_) return true;
        along += distance;
      }
      return false;
    });
  }

 private:
  double time_;
  Vec3d eye_;
  Mat3d to_world_;
  double separation_;
  std::vector<const shape::Collider*> before_;
};

}  // namespace

std::vector<float> visible_share(const mpm::Scene& scene, double time, const Vec3d& shift,
                                 const splat::Camera& camera, const splat::Image& drawn,
                                 Arena& arena) {
  const Obstacles obstacles(scene, time, shift, camera);
  if (!obstacles.any()) return {};
  const int width = camera.width;
  const int height = camera.height;
  const auto index = [&](int x, int y) {
    return std::size_t(y) * std::size_t(width) + std::size_t(x);
  };
  const auto hidden_at = [&](std::size_t pixel, double x, double y) {
    const Vec3d direction((x - camera.cx) / camera.fx, (y - camera.cy) / camera.fy, 1.0);
    return obstacles.hide(direction, double(drawn.depth[pixel] / drawn.mask[pixel]));
  };
  std::vector<std::uint8_t> hidden(drawn.pixels(), 0);
  arena.parallel_for(0, std::size_t(height), 1, [&](std::size_t row) {
    const int y = static_cast<int>(row);
    for (int x = 0; x < width; ++x) {
      const std::size_t i = index(x, y);
      if (drawn.mask[i] > kFaint && hidden_at(i, x + 0.5, y + 0.5)) hidden[i] = 1;
    }
  });
  if (std::find(hidden.begin(), hidden.end(), std::uint8_t{1}) == hidden.end()) return {};
  std::vector<float> visible(drawn.pixels(), 1.0F);
  arena.parallel_for(0, std::size_t(height), 1, [&](std::size_t row) {
    const int y = static_cast<int>(row);
    for (int x = 0; x < width; ++x) {
      const std::size_t i = index(x, y);
      const auto differs = [&](int x2, int y2) {
        if (x2 < 0 || y2 < 0 || x2 >= width || y2 >= height) return false;
        const std::size_t j = index(x2, y2);
        return drawn.mask[j] > kFaint && hidden[j] != hidden[i];
      };
      if (!(drawn.mask[i] > kFaint)) continue;
      visible[i] = hidden[i] != 0 ? 0.0F : 1.0F;
      if (!differs(x - 1, y) && !differs(x + 1, y) && !differs(x, y - 1) && !differs(x, y + 1)) {
        continue;
      }
      int seen = 0;
      for (const double dy : {0.25, 0.75}) {
        for (const double dx : {0.25, 0.75}) seen += hidden_at(i, x + dx, y + dy) ? 0 : 1;
      }
      visible[i] = 0.25F * static_cast<float>(seen);
    }
  });
  return visible;
}

}  // namespace matterfit::fit
