// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/run/stage.hpp"

namespace matterfit::job {

void enter_stage(Interrupter& interrupter, const std::string& label, double fraction) {
  Progress progress;
  progress.label = label;
  progress.fraction = fraction;
  interrupter.report(progress);
  interrupter.check();
}

}  // namespace matterfit::job
