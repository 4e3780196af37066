// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "job/documents/document.hpp"
#include "shape/collider.hpp"

/// A level ground that slopes in truth.
namespace matterfit::job {

/// The ground turned about the point that lies on it at `foot` (its x and y), so that `normal`
/// (unit) is its own.
[[nodiscard]] shape::ColliderPtr sloped(const shape::ColliderPtr& ground, const Vec3d& foot,
                                        const Vec3d& normal);

/// The same in a collider of a document: a plane through `foot` in place of a height.
void write_slope(const Vec3d& foot, const Vec3d& normal, Json& collider);

}  // namespace matterfit::job
