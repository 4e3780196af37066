// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <span>

#include "base/vec.hpp"
#include "diagnose/model.hpp"
#include "job/documents/document.hpp"

namespace matterfit::job {

/// What an observation is put into.
struct ObservedCapture {
  double fps = 24.0;    ///< of its scene
  int first_frame = 0;  ///< of its scene
  const Points& rest;   ///< where on the body its points are [m], as simulated; not finite: unknown
  const CaptureDoc& doc;  ///< as the document was read
};

/// Corrects a capture of a document by what a camera did to it, so that compared with the
/// simulation it is as if it had been seen right: `start_frame` for a time offset, `transform`
/// (with the points' places on the body as `positions`) for a scale. False where no key says so: a
/// frame rate, a drift, a lag, a rolling shutter, a lens; a scale of a capture that is placed by
/// `align`, or whose points are not all known.
[[nodiscard]] bool write_observation(const diagnose::Effect& effect, std::span<const double> values,
                                     const ObservedCapture& about, Json& capture);

}  // namespace matterfit::job
