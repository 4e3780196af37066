// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>
#include <vector>

#include "fit/data/capture.hpp"

/// Which samples of a recording a fit may look at.
namespace matterfit::fit {

/// A time between samples that rounding makes [frames].
inline constexpr double kFrameSlack = 1e-9;

/// The samples that a fit may look at, as tracks of their own.
[[nodiscard]] capture::Tracks visible_to_fit(const Capture& capture);

/// The first frame in which any of the points is seen.
[[nodiscard]] std::size_t first_frame(const capture::Tracks& tracks);

/// "3 of its 64 points (a, b, c)".
[[nodiscard]] std::string named_points(const CaptureInput& input,
                                       const std::vector<std::size_t>& points);

/// Takes their rest from points that were first seen when the body was elsewhere already. `slack`
/// [s]. Says so in `statements`.
void leave_out_late(Capture& capture, double slack, std::vector<std::string>& statements);

/// Where the points are at rest comes from frames that the fit must then be allowed to see: points
/// of which it sees none of them are held out; Error(kInput) for a capture that has no others.
void hold_out_unknown(Capture& capture, double slack, std::vector<std::string>& statements);

/// Fills in `used`, `predicted`, `begin`, `end` and `used_count`.
void mark_used(Capture& capture, const Clock& clock);

}  // namespace matterfit::fit
