// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/run_job.hpp"

#include "job/diagnosis/run_check.hpp"
#include "job/diagnosis/run_diagnose.hpp"
#include "job/documents/images_document.hpp"
#include "job/documents/inputs.hpp"
#include "job/fit_run.hpp"
#include "job/image_fit.hpp"
#include "job/run/capture_input.hpp"
#include "job/run/render.hpp"
#include "job/run/run_scene.hpp"

namespace matterfit::job {

Json run_job(const Job& job, const RunOptions& options, Interrupter& interrupter) {
  check_captures(job);
  require_files(job);
  if (job.task == Task::kRender) return run_render(job, options, interrupter);
  if (job.task == Task::kFit && !images_of(job).empty()) {
    return run_image_fit(job, options, interrupter);
  }
  if (job.task == Task::kFit) return run_fit(job, options, interrupter);
  if (job.task == Task::kDiagnose) return run_diagnose(job, options, interrupter);
  if (job.task == Task::kCheck) return run_check(job, options, interrupter);
  return run_scenes(job, options, interrupter, {});
}

}  // namespace matterfit::job
