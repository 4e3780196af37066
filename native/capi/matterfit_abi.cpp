// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <cstdlib>
#include <cstring>
#include <exception>
#include <memory>
#include <string>

#include "base/error.hpp"
#include "capi/job_thread.hpp"
#include "capi/matterfit.h"
#include "capi/progress_label.hpp"
#include "capi/wedge_run.hpp"
#include "job/curves.hpp"
#include "job/documents/document.hpp"
#include "job/documents/farm_files.hpp"
#include "job/documents/inputs.hpp"
#include "job/documents/quantities_json.hpp"
#include "job/documents/wedge.hpp"
#include "job/run/estimate.hpp"
#include "job/run/inspect.hpp"
#include "job/run/splat_points.hpp"
#include "job/run/validate.hpp"
#include "job/run_job.hpp"

using matterfit::Error;
namespace job = matterfit::job;

struct mf_job {
  std::unique_ptr<matterfit::capi::JobThread> thread;
};

namespace {

std::string& last_error() noexcept {
  thread_local std::string text;
  return text;
}

mf_status fail(mf_status status, const char* message) noexcept {
  try {
    last_error() = message;
  } catch (...) {
    last_error().clear();
  }
  return status;
}

mf_status status_of(int exit_status) { return static_cast<mf_status>(exit_status); }

/// Nothing that `call` throws leaves this library.
template <class Call>
mf_status guarded(const Call& call) noexcept {
  try {
    return call();
  } catch (const Error& error) {
    return fail(status_of(matterfit::exit_status(error.kind())), error.what());
  } catch (const std::bad_alloc&) {
    return fail(MF_ERROR_COMPUTE, "out of memory.");
  } catch (const std::exception& error) {
    return fail(MF_ERROR_COMPUTE, error.what());
  } catch (...) {
    return fail(MF_ERROR_COMPUTE, "unknown error.");
  }
}

/// Fields beyond the caller's size field are taken as zero: it was compiled against an older
/// header.
bool copy_options(const mf_job_options* given, mf_job_options& options) {
  std::memset(&options, 0, sizeof options);
  if (given == nullptr) return true;
  if (given->size < sizeof given->size || given->size > 4096) return false;
  std::memcpy(&options, given, std::min<std::size_t>(given->size, sizeof options));
  return options.overrides != nullptr || options.override_count == 0;
}

job::Job read(const char* json, const char* base_folder, const mf_job_options& options) {
  job::ReadOptions read;
  read.base_folder = base_folder == nullptr ? "" : base_folder;
  if (options.task != nullptr && options.task[0] != '\0') {
    read.task = job::task_from_name(options.task);
  }
  for (std::uint32_t i = 0; i < options.override_count; ++i) {
    if (options.overrides[i] != nullptr) read.overrides.emplace_back(options.overrides[i]);
  }
  return job::read_job(json, read);
}

job::RunOptions run_options(const mf_job_options& options) {
  if (options.threads < 0) {
    matterfit::throw_input("mf_job_options.threads: " + std::to_string(options.threads) +
                           ", expected a number of threads, or 0.");
  }
  job::RunOptions run;
  run.threads = options.threads;
  run.target = job::target_from_name(options.target == nullptr ? "" : options.target);
  if (options.restart < 0 || options.restart > 2) {
    matterfit::throw_input("mf_job_options.restart: " + std::to_string(options.restart) +
                           " is none of 0, 1 and 2.");
  }
  run.restart = options.restart == 0   ? job::Restart::kNever
                : options.restart == 1 ? job::Restart::kAlways
                                       : job::Restart::kWhereChanged;
  return run;
}

/// The members of a wedge, written; the overrides are its axes.
job::WedgeFolder wedge(const char* json, const char* base_folder, const mf_job_options& options,
                       const char* folder) {
  job::ReadOptions read;
  read.base_folder = base_folder == nullptr ? "" : base_folder;
  if (options.task != nullptr && options.task[0] != '\0') {
    read.task = job::task_from_name(options.task);
  }
  std::vector<std::string> axes;
  axes.reserve(options.override_count);
  for (std::uint32_t i = 0; i < options.override_count; ++i) {
    if (options.overrides[i] != nullptr) axes.emplace_back(options.overrides[i]);
  }
  return job::write_wedge(json, read, axes, folder);
}

mf_status give(const std::string& text, char** out) {
  char* copy = static_cast<char*>(std::malloc(text.size() + 1));
  if (copy == nullptr) return fail(MF_ERROR_COMPUTE, "out of memory.");
  std::memcpy(copy, text.c_str(), text.size() + 1);
  *out = copy;
  return MF_OK;
}

std::string dump(const job::Json& json) {
  return json.dump(2, ' ', false, job::Json::error_handler_t::replace);
}

constexpr const char* kNull = "a pointer that must not be NULL is NULL.";
constexpr const char* kSize = "the size field of a struct is not set, or overrides are missing.";

}  // namespace

uint32_t mf_abi_version(void) { return MF_ABI_VERSION; }
const char* mf_version(void) { return MATTERFIT_VERSION; }
const char* mf_last_error(void) { return last_error().c_str(); }

mf_status mf_job_start(const char* json, const char* base_folder, const mf_job_options* options,
                       mf_job** out) {
  if (json == nullptr || out == nullptr) return fail(MF_ERROR_USAGE, kNull);
  *out = nullptr;
  mf_job_options given;
  if (!copy_options(options, given)) return fail(MF_ERROR_USAGE, kSize);
  return guarded([&] {
    auto handle = std::make_unique<mf_job>();
    handle->thread = std::make_unique<matterfit::capi::JobThread>(read(json, base_folder, given),
                                                                  run_options(given));
    *out = handle.release();
    return MF_OK;
  });
}

mf_status mf_job_poll(mf_job* handle, mf_progress* progress) {
  if (handle == nullptr || progress == nullptr) return fail(MF_ERROR_USAGE, kNull);
  const std::uint32_t size = progress->size;
  if (size < sizeof size || size > 4096) return fail(MF_ERROR_USAGE, kSize);
  return guarded([&] {
    mf_progress now;
    std::memset(&now, 0, sizeof now);
    const matterfit::Progress at = handle->thread->progress();
    const bool ended = handle->thread->ended();
    now.size = size;
    now.status = ended ? handle->thread->outcome().exit_status : static_cast<int>(MF_RUNNING);
    now.frame = at.frame;
    now.last_frame = at.last_frame;
    now.fraction = at.fraction;
    now.seconds = handle->thread->seconds();
    now.seconds_left = handle->thread->seconds_left();
    now.memory_bytes = matterfit::capi::resident_bytes();
    const std::string label = matterfit::capi::label_within(at, sizeof now.label - 1);
    std::memcpy(now.label, label.data(), label.size());
    std::memcpy(progress, &now, std::min<std::size_t>(size, sizeof now));
    return MF_OK;
  });
}

mf_status mf_job_cancel(mf_job* handle) {
  if (handle == nullptr) return fail(MF_ERROR_USAGE, kNull);
  handle->thread->cancel();
  return MF_OK;
}

mf_status mf_job_wait(mf_job* handle, double seconds) {
  if (handle == nullptr) return fail(MF_ERROR_USAGE, kNull);
  return guarded([&] {
    if (!handle->thread->wait(seconds)) return MF_RUNNING;
    const auto& outcome = handle->thread->outcome();
    if (outcome.exit_status == 0) return MF_OK;
    return fail(status_of(outcome.exit_status), outcome.error.c_str());
  });
}

const char* mf_job_result(mf_job* handle) {
  if (handle == nullptr) {
    fail(MF_ERROR_USAGE, kNull);
    return nullptr;
  }
  return handle->thread->ended() ? handle->thread->outcome().result.c_str() : nullptr;
}

void mf_job_free(mf_job* handle) { delete handle; }

mf_status mf_wedge_write(const char* json, const char* base_folder, const mf_job_options* options,
                         const char* folder, const char* farm, const char* tool, char** text) {
  if (json == nullptr || folder == nullptr || text == nullptr) return fail(MF_ERROR_USAGE, kNull);
  mf_job_options given;
  if (!copy_options(options, given)) return fail(MF_ERROR_USAGE, kSize);
  return guarded([&] {
    const job::WedgeFolder made = wedge(json, base_folder, given, folder);
    job::Json members = job::Json::array();
    for (const job::WedgeMember& member : made.wedge.members) {
      members.push_back(
          {{"folder", member.name}, {"label", member.label}, {"set", member.overrides}});
    }
    job::Json files = job::Json::array();
    if (farm != nullptr && farm[0] != '\0') {
      const std::string program = tool == nullptr || tool[0] == '\0' ? "matterfit" : tool;
      for (const auto& path : job::write_farm_files(made, job::farm_from_name(farm), program)) {
        files.push_back(path.string());
      }
    }
    return give(dump({{"members", members}, {"files", files}}), text);
  });
}

mf_status mf_wedge_start(const char* json, const char* base_folder, const mf_job_options* options,
                         const char* folder, int32_t at_once, mf_job** out) {
  if (json == nullptr || folder == nullptr || out == nullptr) return fail(MF_ERROR_USAGE, kNull);
  *out = nullptr;
  mf_job_options given;
  if (!copy_options(options, given)) return fail(MF_ERROR_USAGE, kSize);
  return guarded([&] {
    auto handle = std::make_unique<mf_job>();
    handle->thread = std::make_unique<matterfit::capi::JobThread>(
        [made = wedge(json, base_folder, given, folder), run = run_options(given),
         at_once](matterfit::Interrupter& interrupter) {
          return matterfit::capi::run_wedge(made, run, at_once, interrupter);
        });
    *out = handle.release();
    return MF_OK;
  });
}

mf_status mf_estimate(const char* json, const char* base_folder, const mf_job_options* options,
                      char** text) {
  if (json == nullptr || text == nullptr) return fail(MF_ERROR_USAGE, kNull);
  mf_job_options given;
  if (!copy_options(options, given)) return fail(MF_ERROR_USAGE, kSize);
  return guarded([&] {
    const job::Job made = read(json, base_folder, given);
    // Before a run only memory is asked for; who asks what baking takes wants to know the time.
    const bool closely = made.bakes();
    return give(dump(job::estimate_job(made, run_options(given), closely)), text);
  });
}

mf_status mf_validate(const char* json, const char* base_folder, const mf_job_options* options,
                      char** text) {
  if (json == nullptr || text == nullptr) return fail(MF_ERROR_USAGE, kNull);
  mf_job_options given;
  if (!copy_options(options, given)) return fail(MF_ERROR_USAGE, kSize);
  return guarded([&] {
    const job::Job read_job = read(json, base_folder, given);
    (void)job::validate_job(read_job, run_options(given), matterfit::Interrupter{});
    return give(job::write_job(read_job, base_folder == nullptr ? "" : base_folder), text);
  });
}

mf_status mf_capture_summary(const char* path, const char* options_json, char** text) {
  if (path == nullptr || text == nullptr) return fail(MF_ERROR_USAGE, kNull);
  return guarded([&] {
    const bool given = options_json != nullptr && options_json[0] != '\0';
    const job::Json options =
        given ? job::parse_json(options_json, "options") : job::Json::object();
    return give(dump(job::capture_summary(path, options)), text);
  });
}

mf_status mf_splats(const char* path, const char* options_json, const char* npz, char** text) {
  if (path == nullptr || npz == nullptr || text == nullptr) return fail(MF_ERROR_USAGE, kNull);
  return guarded([&] {
    const bool given = options_json != nullptr && options_json[0] != '\0';
    const job::Json options =
        given ? job::parse_json(options_json, "options") : job::Json::object();
    return give(dump(job::write_splat_points(path, options, npz)), text);
  });
}

mf_status mf_inspect(const char* folder, char** text) {
  if (folder == nullptr || text == nullptr) return fail(MF_ERROR_USAGE, kNull);
  return guarded([&] { return give(dump(job::inspect_folder(folder)), text); });
}

mf_status mf_quantities(char** text) {
  if (text == nullptr) return fail(MF_ERROR_USAGE, kNull);
  return guarded([&] { return give(dump(job::quantities_json()), text); });
}

mf_status mf_curves(const char* json, const char* base_folder, const char* options_json,
                    char** text) {
  if (json == nullptr || text == nullptr) return fail(MF_ERROR_USAGE, kNull);
  return guarded([&] {
    const bool given = options_json != nullptr && options_json[0] != '\0';
    const job::CurveOptions options =
        job::curve_options(given ? job::parse_json(options_json, "options") : job::Json::object());
    return give(dump(job::curves_of_text(json, base_folder == nullptr ? "" : base_folder, options)),
                text);
  });
}

void mf_text_free(char* text) { std::free(text); }
