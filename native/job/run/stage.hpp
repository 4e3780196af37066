// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>

#include "base/interrupter.hpp"

namespace matterfit::job {

/// Says what a job does now and how much of it is done, in [0, 1]; throws Error(kCancelled) if it
/// is to end.
void enter_stage(Interrupter& interrupter, const std::string& label, double fraction);

}  // namespace matterfit::job
