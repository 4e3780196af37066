// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/documents/capture_scene.hpp"
#include "job/run/run_scene.hpp"

namespace matterfit::job {
namespace {

void append(Json& into, const Json& from, const char* key) {
  if (!from.contains(key)) return;
  for (const Json& item : from[key]) into[key].push_back(item);
}

/// What a scene of its own found, into the result of the document's.
void join(Json& result, const Json& own, const SceneGroup& group) {
  append(result, own, "captures");
  append(result, own, "notes");
  if (own.contains("compare")) {
    append(result["compare"], own["compare"], "captures");
    // Figures of one capture alone stand beside the list; of several they would mislead.
    Json& list = result["compare"]["captures"];
    for (const char* key : {"mean_mm", "p95_mm", "max_mm", "rms_mm", "mean_percent"}) {
      result["compare"].erase(key);
      if (list.size() == 1 && list[0].contains(key)) result["compare"][key] = list[0][key];
    }
  }
  Json names = Json::array();
  for (const Json& capture : own.value("captures", Json::array())) names.push_back(capture["name"]);
  result["runs"].push_back({{"captures", names},
                            {"folder", "runs/" + group.name},
                            {"input_hash", own.at("input_hash")},
                            {"result_hash", own.at("result_hash")}});
}

}  // namespace

Json run_scenes(const Job& job, const RunOptions& options, Interrupter& interrupter,
                const RunExtras& extras) {
  const std::vector<SceneGroup> groups = scene_groups(job);
  if (groups.size() == 1) return run_scene(job, options, interrupter, extras);
  std::vector<Job> jobs;
  jobs.reserve(groups.size());
  for (const SceneGroup& group : groups) jobs.push_back(group_job(job, group));
  RunExtras base = extras;
  base.finish = [&](Json& result) {
    for (std::size_t g = 1; g < groups.size(); ++g) {
      Job& own = jobs[g];
      if (own.task == Task::kBake) own.task = Task::kSimulate;
      own.output.bake = false;
      RunExtras inner;
      inner.begin = extras.begin + (1.0 - extras.begin) * double(g) / double(groups.size());
      inner.compared = extras.compared;
      inner.clouds = extras.clouds;
      inner.images = false;
      inner.strained = extras.strained;
      join(result, run_scene(own, options, interrupter, inner), groups[g]);
    }
    return extras.finish ? extras.finish(result) : std::vector<std::string>();
  };
  return run_scene(jobs.front(), options, interrupter, base);
}

}  // namespace matterfit::job
