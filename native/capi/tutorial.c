/* SPDX-License-Identifier: GPL-3.0-or-later */
/*
 * How a C program uses the library: check a document, ask what it will need, run it while another
 * thread could draw a progress bar, cancel one, and look at the results. Compiled as C99 and run by
 * the tests:  tutorial OUTPUT_FOLDER
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "capi/matterfit.h"

static const char* const kJob =
    "{ \"schema\": \"matterfit.job/1\", \"task\": \"simulate\","
    "  \"scene\": { \"fps\": 24, \"frames\": [1, 4], \"particle_separation\": 0.05,"
    "    \"gravity\": [0, 0, -9.81],"
    "    \"bodies\": [ { \"name\": \"cube\", \"density\": 1000,"
    "      \"source\": { \"box\": { \"low\": [0, 0, 1], \"high\": [0.4, 0.4, 1.4] } },"
    "      \"material\": { \"law\": \"fixed_corotated\", \"E\": 1e4, \"nu\": 0.3 } } ] },"
    "  \"output\": { \"folder\": \"falling_cube\" } }";

/* Ends the program with what the library says went wrong. */
static void check(mf_status status, const char* what) {
  if (status == MF_OK) return;
  fprintf(stderr, "%s: status %d: %s\n", what, (int)status, mf_last_error());
  exit(1);
}

static void expect(int condition, const char* what) {
  if (condition) return;
  fprintf(stderr, "expected: %s\n", what);
  exit(1);
}

int main(int argc, char** argv) {
  const char* folder = argc > 1 ? argv[1] : ".";
  mf_job_options options;
  mf_progress progress;
  mf_job* job = NULL;
  mf_job* second = NULL;
  char* text = NULL;
  const char* overrides[] = {"scene.gravity=[0,0,-3.7]", "output.folder=on_mars"};
  const char* axes[] = {"scene.gravity[2]=-9.81,-3.7"};
  char path[4096];

  /* 1. The header and the library must be of one interface. */
  expect(mf_abi_version() == MF_ABI_VERSION, "the library has the header's version");
  printf("matterfit %s\n", mf_version());

  /* 2. A mistake is named with its place in the document. */
  expect(mf_validate("{ \"schema\": \"matterfit.job/1\" }", folder, NULL, &text) == MF_ERROR_INPUT,
         "a document without a scene is refused");
  printf("refused: %s\n", mf_last_error());
  check(mf_validate(kJob, folder, NULL, &text), "mf_validate");
  mf_text_free(text);

  /* 3. What it will take. */
  check(mf_estimate(kJob, folder, NULL, &text), "mf_estimate");
  printf("estimate: %s\n", text);
  mf_text_free(text);

  /* 4. Run. Nothing here waits: poll from a timer. */
  memset(&options, 0, sizeof options);
  options.size = sizeof options;
  options.threads = 1;
  options.restart = 1;
  check(mf_job_start(kJob, folder, &options, &job), "mf_job_start");
  /* A second one beside it, with the document changed as the tool's --set does. */
  options.overrides = overrides;
  options.override_count = 2;
  check(mf_job_start(kJob, folder, &options, &second), "mf_job_start");
  do {
    memset(&progress, 0, sizeof progress);
    progress.size = sizeof progress;
    check(mf_job_poll(job, &progress), "mf_job_poll");
    printf("%3.0f %% %s, frame %d of %d\n", 100.0 * progress.fraction, progress.label,
           (int)progress.frame, (int)progress.last_frame);
  } while (mf_job_wait(job, 0.05) == MF_RUNNING);
  check(mf_job_wait(job, -1.0), "the job");
  printf("result: %s\n", mf_job_result(job));
  expect(strstr(mf_job_result(job), "\"result_hash\"") != NULL, "the result has a hash");
  mf_job_free(job);
  check(mf_job_wait(second, -1.0), "the second job");
  mf_job_free(second);

  /* 5. Look at what lies on disk. */
  snprintf(path, sizeof path, "%s/falling_cube", folder);
  check(mf_inspect(path, &text), "mf_inspect");
  expect(strstr(text, "\"sound\"") != NULL, "every file is as it was written");
  mf_text_free(text);

  /* 6. What a fit can look for, with units, bounds and labels. */
  check(mf_quantities(&text), "mf_quantities");
  expect(strstr(text, "\"material.E\"") != NULL, "the stiffness is among the quantities");
  expect(mf_quantities(NULL) == MF_ERROR_USAGE, "a missing pointer is told");
  mf_text_free(text);

  /* 7. Stress against stretch of the document's materials, for a picture. */
  check(mf_curves(kJob, folder, "{\"strain\": 0.2}", &text), "mf_curves");
  expect(strstr(text, "\"equibiaxial\"") != NULL, "the curves are there");
  mf_text_free(text);
  expect(mf_curves("{}", folder, NULL, &text) == MF_ERROR_INPUT, "no material is told");
  expect(mf_curves(NULL, folder, NULL, &text) == MF_ERROR_USAGE, "a missing pointer is told");

  /* 8. Points of a file of Gaussian splats, for a viewport. */
  expect(mf_splats("nothing.ply", NULL, path, &text) == MF_ERROR_INPUT, "a missing file is told");
  expect(mf_splats(NULL, NULL, path, &text) == MF_ERROR_USAGE, "a missing pointer is told");

  /* 9. Cancelling: the job ends soon, with its status. */
  options.overrides = NULL;
  options.override_count = 0;
  options.restart = 1;
  check(mf_job_start(kJob, folder, &options, &job), "mf_job_start");
  check(mf_job_cancel(job), "mf_job_cancel");
  expect(mf_job_wait(job, -1.0) == MF_CANCELLED, "a cancelled job says so");
  mf_job_free(job);

  /* 10. One document with several values: written for a farm, then run here side by side. */
  options.overrides = axes;
  options.override_count = 1;
  options.restart = 0;
  snprintf(path, sizeof path, "%s/gravities", folder);
  check(mf_wedge_write(kJob, folder, &options, path, "slurm", "matterfit", &text),
        "mf_wedge_write");
  expect(strstr(text, "slurm.sh") != NULL, "the farm's file is named");
  mf_text_free(text);
  check(mf_wedge_start(kJob, folder, &options, path, 2, &job), "mf_wedge_start");
  check(mf_job_wait(job, -1.0), "the wedge");
  expect(strstr(mf_job_result(job), "\"gravity[2] = -3.7\"") != NULL, "its members are listed");
  mf_job_free(job);

  /* 11. Wrong use is answered, not crashed on. */
  expect(mf_wedge_start(kJob, folder, NULL, NULL, 1, &job) == MF_ERROR_USAGE, "NULL is refused");
  expect(mf_job_start(NULL, folder, NULL, &job) == MF_ERROR_USAGE, "NULL is refused");
  options.size = 0;
  expect(mf_job_start(kJob, folder, &options, &job) == MF_ERROR_USAGE, "no size is refused");
  mf_job_free(NULL);
  puts("done");
  return 0;
}
