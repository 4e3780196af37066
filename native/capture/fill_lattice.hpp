// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <optional>
#include <string>

#include "capture/fill.hpp"

namespace matterfit::capture {

/// A closed shape as the lattice sees it. Queries come from several threads.
class FillShape {
 public:
  struct Surface {
    double distance = 0.0;  ///< signed, negative inside [m]
    Vec3d normal = Vec3d::UnitZ();
  };
  FillShape() = default;
  virtual ~FillShape() = default;
  FillShape(const FillShape&) = delete;
  FillShape& operator=(const FillShape&) = delete;

  [[nodiscard]] virtual Surface at(const Vec3d& x) const = 0;
  /// The last word on what is inside, where it may differ from the distance's sign.
  [[nodiscard]] virtual bool inside(const Vec3d& x, const Surface& surface) const {
    (void)x;
    return surface.distance < 0.0;
  }
  /// Box of the shape in the frame of `axes`: of axesᵀ x.
  [[nodiscard]] virtual Eigen::AlignedBox3d box(const Quatd& axes) const = 0;
  /// Volume [m³] where known exactly.
  [[nodiscard]] virtual std::optional<double> volume() const = 0;
};

/// Throws Error(kCancelled) if that was asked for.
inline void look_at_cancel(const FillOptions& options) {
  if (options.interrupter != nullptr) options.interrupter->check();
}

/// The rule described in fill.hpp. `notes` ends the report.
[[nodiscard]] FilledBody fill_lattice(const FillShape& shape, const FillOptions& options,
                                      const std::string& notes);

/// Part of a unit cube (sides along the axes) below a plane: {y : n·y < −distance} for y from its
/// centre, `n` unit. Scardovelli and Zaleski 2000.
[[nodiscard]] double cube_fraction(double distance, const Vec3d& n);

}  // namespace matterfit::capture
