/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef MATTERFIT_H
#define MATTERFIT_H

#include <stddef.h>
#include <stdint.h>

/*
 * The C interface of Matterfit. Plain structs with a size field (set it to sizeof the struct),
 * status codes, opaque handles. No C++ type and no exception crosses it. Texts are UTF-8.
 *
 * A job reads its inputs only from the files that its document names. It runs on a thread of its
 * own: no call below waits for it but mf_job_wait and mf_job_free. Several jobs may run at once.
 * All functions may be called from any thread; one handle from one thread at a time, except
 * mf_job_poll and mf_job_cancel, which may be called while another thread waits on the handle.
 *
 * The order of the document and its meaning: docs/formats.md. A program that uses this interface:
 * tutorial.c.
 */

#if defined(__GNUC__)
#define MF_API __attribute__((visibility("default")))
#else
#define MF_API
#endif

#ifdef __cplusplus
extern "C" {
#endif

/* Grows by one with each change that breaks callers. Fields are added at the ends of structs only.
 */
#define MF_ABI_VERSION 1u

/* The values are the exit statuses of the command line tool. */
typedef enum mf_status {
  MF_OK = 0,
  MF_RUNNING = 1,       /* the job has not ended */
  MF_ERROR_INPUT = 2,   /* the input is wrong; the error says what, where and what to do */
  MF_ERROR_COMPUTE = 3, /* could not be completed or written; the error says what to change */
  MF_ERROR_USAGE = 64,  /* this interface was called wrongly (null pointer, wrong size field) */
  MF_CANCELLED = 130
} mf_status;

typedef struct mf_job mf_job;

typedef struct mf_job_options {
  uint32_t size;                /* sizeof(mf_job_options) */
  int32_t threads;              /* 0: as many as the machine has */
  const char* target;           /* NULL or "auto", "sse4", "avx2", "avx512" */
  const char* task;             /* NULL: the document's; else "simulate", "compare", "bake" */
  int32_t restart;              /* 0: go on; 1: begin afresh; 2: afresh where the inputs changed */
  uint32_t override_count;      /* of `overrides` */
  const char* const* overrides; /* "scene.gravity=[0,0,-3.7]", … as --set of the tool */
} mf_job_options;

typedef struct mf_progress {
  uint32_t size;  /* sizeof(mf_progress) */
  int32_t status; /* mf_status: MF_RUNNING, or how the job ended */
  int32_t frame;  /* scene frame it stands at */
  int32_t last_frame;
  double fraction;       /* of the whole job, 0 to 1 */
  double seconds;        /* since the start */
  double seconds_left;   /* a guess; negative: not known yet */
  uint64_t memory_bytes; /* of this process, resident */
  char label[64];        /* what is being done, in words of the panel; ends with 0 */
} mf_progress;

MF_API uint32_t mf_abi_version(void);
MF_API const char* mf_version(void);
/* What went wrong in the last call of this thread that failed. Never NULL; valid until the next
 * call of this thread that fails. */
MF_API const char* mf_last_error(void);

/* Reads and checks the document (without opening the files it names) and starts the job.
 * `base_folder`: where relative paths start. `options` may be NULL. */
MF_API mf_status mf_job_start(const char* json, const char* base_folder,
                              const mf_job_options* options, mf_job** job);
MF_API mf_status mf_job_poll(mf_job* job, mf_progress* progress);
/* Asks the job to stop; it does within a fraction of a second, what is finished stays. */
MF_API mf_status mf_job_cancel(mf_job* job);
/* Waits until the job has ended or `seconds` have passed (negative: for ever). Returns how it ended
 * or MF_RUNNING; mf_last_error is then the job's. */
MF_API mf_status mf_job_wait(mf_job* job, double seconds);
/* The result as JSON, NULL while it runs. A failed job has {"status": "error" | "cancelled",
 * "error": …, "exit_status": …}. Owned by the handle. */
MF_API const char* mf_job_result(mf_job* job);
/* Cancels, waits and frees. NULL is allowed. */
MF_API void mf_job_free(mf_job* job);

/* Writes a document once for each combination of values below `folder`, and gives in `*text` what
 * was written: {"members": [{"folder", "label", "set"}], "files": […]}. Each of `options`'
 * overrides is "path=value,value,…"; nothing is written unless all members are sound. `farm`: NULL
 * or "", "slurm", "flamenco" also write that farm's files; `tool` is the matterfit program there.
 */
MF_API mf_status mf_wedge_write(const char* json, const char* base_folder,
                                const mf_job_options* options, const char* folder, const char* farm,
                                const char* tool, char** text);
/* The same, and runs them, `at_once` side by side, as one job: members that are finished are
 * skipped, and its result lists them all. */
MF_API mf_status mf_wedge_start(const char* json, const char* base_folder,
                                const mf_job_options* options, const char* folder, int32_t at_once,
                                mf_job** job);

/* The functions below give a JSON text in `*text`, to be freed with mf_text_free. */

/* {"particles", "bytes", "seconds", "fits", …} of a job, without running it. Fills its bodies. */
MF_API mf_status mf_estimate(const char* json, const char* base_folder,
                             const mf_job_options* options, char** text);
/* Checks a document, the scene that it makes and the captures that its task looks at; the text is
   the document as it was understood. */
MF_API mf_status mf_validate(const char* json, const char* base_folder,
                             const mf_job_options* options, char** text);
/* What a capture is like: frames, points, spacing, noise, jumps, labels, …
 * `options`: NULL or keys of a job's capture (`unit`, `up`, `fps`, `markers`, …); of images also
 * `scene_fps`, the rate of those that have no times. */
MF_API mf_status mf_capture_summary(const char* path, const char* options_json, char** text);
/* Writes what a viewport shows of a file of Gaussian splats to the file `npz`: places, turns,
 * sizes, colours (job/run/splat_points.hpp says which arrays). `options`: NULL or {"most",
 * "opacity_threshold"}. {"gaussians", "kept", "written", "low", "high"}. */
MF_API mf_status mf_splats(const char* path, const char* options_json, const char* npz,
                           char** text);
/* What a cache folder holds, its result hash, and each file that is missing or damaged. */
MF_API mf_status mf_inspect(const char* folder, char** text);
/* The numbers of a scene that can be fitted or shown, with unit, bounds, label and a sentence each,
 * the constitutive laws and the effects with theirs (job/documents/quantities_json.hpp). */
MF_API mf_status mf_quantities(char** text);
/* Stress against stretch of the materials of a document, or of a material as a fit writes it
 * (`matterfit.material/1`), whose files lie in `base_folder`: job/curves.hpp says what the text
 * holds. `options`: NULL or {"strain", "rate", "beside"}. To find the law nearest to a neural one,
 * which is beside it, takes some seconds; without it the call takes some milliseconds. */
MF_API mf_status mf_curves(const char* json, const char* base_folder, const char* options_json,
                           char** text);
MF_API void mf_text_free(char* text);

#ifdef __cplusplus
}
#endif

#endif
