// SPDX-License-Identifier: GPL-3.0-or-later
#include "capi/wedge_run.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <memory>
#include <thread>
#include <vector>

#include "base/error.hpp"
#include "job/documents/inputs.hpp"
#include "job/documents/manifest.hpp"

namespace matterfit::capi {
namespace {

using job::Json;

constexpr double kWait = 0.05;  // between two looks at those that run [s]

struct Member {
  std::unique_ptr<JobThread> thread;
  std::string status = "waiting";
  double seconds = 0.0;
  double fraction = 0.0;
  Outcome outcome;
};

/// Whether the folder holds all that this very document gives.
bool is_finished(const job::WedgeFolder& wedge, std::size_t m, mpm::SimdTarget target) {
  const job::Job& job = wedge.jobs[m];
  // A fit and a diagnosis find their own results.
  if (job.task == job::Task::kFit || job.task == job::Task::kDiagnose) return false;
  if (!wedge.same[m]) return false;
  try {
    const auto manifest = job::read_manifest(job.output.folder);
    return manifest && manifest->complete && manifest->task == job::task_name(job.task) &&
           manifest->input_hash == job::hash_inputs(job::simulation_inputs(job, target)) &&
           (job.task != job::Task::kCompare ||
            manifest->compared_hash == job::hash_inputs(job::capture_inputs(job))) &&
           std::all_of(manifest->files.begin(), manifest->files.end(), [&](const auto& file) {
             std::error_code code;
             return file.second.hash.empty() ||
                    std::filesystem::file_size(job.output.folder / file.first, code) ==
                        file.second.size;
           });
  } catch (const Error&) {
    return false;  // the run itself says what is wrong with it
  }
}

void collect(Member& member) {
  member.outcome = member.thread->outcome();
  member.seconds = member.thread->seconds();
  member.thread.reset();
  const int status = member.outcome.exit_status;
  member.status = status == 0 ? "done" : status == 130 ? "cancelled" : "failed";
  member.fraction = 1.0;
}

Json describe(const job::WedgeFolder& wedge, const std::vector<Member>& members) {
  Json list = Json::array();
  for (std::size_t m = 0; m < members.size(); ++m) {
    Json entry = {{"folder", wedge.wedge.members[m].name},
                  {"label", wedge.wedge.members[m].label},
                  {"status", members[m].status},
                  {"seconds", members[m].seconds}};
    if (!members[m].outcome.error.empty()) entry["error"] = members[m].outcome.error;
    const Json result = Json::parse(members[m].outcome.result, nullptr, false);
    for (const char* key : {"particles", "result_hash"}) {
      if (result.is_object() && result.contains(key)) entry[key] = result[key];
    }
    if (result.is_object() && result.contains("compare") && result["compare"].contains("mean_mm")) {
      entry["mean_mm"] = result["compare"]["mean_mm"];
    }
    list.push_back(std::move(entry));
  }
  return list;
}

}  // namespace

Outcome run_wedge(const job::WedgeFolder& wedge, const job::RunOptions& options, int at_once,
                  Interrupter& interrupter) {
  std::vector<Member> members(wedge.jobs.size());
  const int machine = static_cast<int>(std::max(1U, std::thread::hardware_concurrency()));
  const int threads = options.threads > 0 ? options.threads : machine;
  const int most =
      std::clamp(at_once, 1, static_cast<int>(std::max<std::size_t>(1, members.size())));
  job::RunOptions own = options;
  own.threads = std::max(1, threads / most);
  std::size_t next = 0;
  std::vector<std::size_t> running;
  while (next < members.size() || !running.empty()) {
    const bool stop = interrupter.cancelled();
    while (!stop && next < members.size() && running.size() < static_cast<std::size_t>(most)) {
      Member& member = members[next];
      if (options.restart == job::Restart::kNever && is_finished(wedge, next, options.target)) {
        member.status = "done before";
        member.fraction = 1.0;
      } else {
        member.thread = std::make_unique<JobThread>(wedge.jobs[next], own);
        running.push_back(next);
      }
      ++next;
    }
    if (stop) next = members.size();
    for (const std::size_t m : running) {
      if (stop) members[m].thread->cancel();
      members[m].fraction = members[m].thread->progress().fraction;
    }
    if (!running.empty()) (void)members[running.front()].thread->wait(kWait);
    std::erase_if(running, [&](std::size_t m) {
      if (!members[m].thread->ended()) return false;
      collect(members[m]);
      return true;
    });
    double done = 0.0;
    int whole = 0;
    for (const Member& member : members) {
      done += member.fraction;
      whole += member.fraction >= 1.0 && member.thread == nullptr ? 1 : 0;
    }
    interrupter.report({done / double(members.size()), 0, 0,
                        fmt::format("Wedge, {} of {} done", whole, members.size())});
  }
  Outcome outcome;
  for (const Member& member : members) {
    if (member.status != "failed") continue;
    if (outcome.exit_status == 0) outcome.exit_status = member.outcome.exit_status;
    const auto m = static_cast<std::size_t>(&member - members.data());
    outcome.error += (outcome.error.empty() ? "" : "\n") + wedge.wedge.members[m].label + ": " +
                     member.outcome.error;
  }
  if (interrupter.cancelled()) outcome.exit_status = exit_status(ErrorKind::kCancelled);
  const char* status = outcome.exit_status == 0     ? "done"
                       : outcome.exit_status == 130 ? "cancelled"
                                                    : "error";
  const Json result = {{"status", status},
                       {"task", job::task_name(wedge.task)},
                       {"folder", wedge.folder.string()},
                       {"members", describe(wedge, members)}};
  outcome.result = result.dump(2, ' ', false, Json::error_handler_t::replace);
  return outcome;
}

std::string wedge_table(const Json& result) {
  std::size_t wide = 6;
  for (const Json& member : result.at("members")) {
    wide = std::max(wide, member.at("label").get<std::string>().size());
  }
  std::string text = fmt::format("{:{}}  {:9}  {:>8}  {:>9}  {:>9}\n", "member", wide, "status",
                                 "time", "particles", "error");
  for (const Json& member : result.at("members")) {
    text += fmt::format(
        "{:{}}  {:9}  {:>8}  {:>9}  {:>9}\n", member.at("label").get<std::string>(), wide,
        member.at("status").get<std::string>(),
        member.at("seconds") > 0.0 ? fmt::format("{:.1f} s", member["seconds"].get<double>()) : "",
        member.contains("particles") ? member["particles"].dump() : "",
        member.contains("mean_mm") ? fmt::format("{:.3f} mm", member["mean_mm"].get<double>())
                                   : "");
  }
  return text;
}

}  // namespace matterfit::capi
