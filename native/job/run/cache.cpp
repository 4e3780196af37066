// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/run/cache.hpp"

#include <algorithm>
#include <fstream>

#include "base/error.hpp"
#include "job/run/state_file.hpp"

namespace matterfit::job {

Cache::Cache(const Job& job, const Inputs& inputs, Restart restart)
    : folder_(job.output.folder), lock_(folder_) {
  std::optional<Manifest> found;
  try {
    found = read_manifest(folder_);
  } catch (const Error& error) {
    if (restart == Restart::kNever) {
      throw_input(std::string(error.what()) +
                  " Run with --restart to replace it, or choose another output folder.");
    }
  }
  if (!found) {
    afresh_ = true;
    return;
  }
  manifest_ = std::move(*found);
  const bool changed = manifest_.frames_done > 0 && manifest_.input_hash != hash_inputs(inputs);
  if (changed && restart == Restart::kNever) {
    std::string message = folder_.string() + " holds the results of other inputs. What changed:";
    for (const std::string& line : changes(manifest_.inputs, inputs)) message += "\n  " + line;
    throw_input(message +
                "\nRun with --restart to replace them, or choose another output folder "
                "(--set output.folder=…).");
  }
  afresh_ = changed || restart == Restart::kAlways || manifest_.frames_done == 0;
  std::ifstream result(folder_ / "result.json");
  if (afresh_ || !result) return;
  const Json old = Json::parse(result, nullptr, false);
  if (old.is_object() && old.contains("fit")) fit_ = old.at("fit");
}

void Cache::begin(const Job& job, const Inputs& inputs, const std::vector<std::string>& kept) {
  if (!afresh_) return;
  const auto files = manifest_.files;
  for (const auto& [path, file] : files) {
    if (std::find(kept.begin(), kept.end(), path) == kept.end()) remove(path);
  }
  afresh_ = false;
  manifest_ = Manifest{};
  manifest_.version = MATTERFIT_VERSION;
  manifest_.inputs = inputs;
  manifest_.input_hash = hash_inputs(inputs);
  manifest_.fps = job.scene.fps;
  const auto& ratio = job.scene.fps_ratio;
  if (ratio[0] == 0) {
    manifest_.fps_given = job.scene.fps;
  } else if (ratio[1] == 1) {
    manifest_.fps_given = ratio[0];
  } else {
    manifest_.fps_given = ratio;
  }
  manifest_.first_frame = job.scene.first_frame;
  manifest_.end_frame = job.scene.end_frame;
  for (const BodyDoc& body : job.scene.bodies) manifest_.bodies.push_back(body.name);
}

bool Cache::is_sound(const std::string& path) const {
  const auto file = manifest_.files.find(path);
  return file != manifest_.files.end() && fault_of(folder_, path, file->second).empty();
}

void Cache::record(const std::string& path, bool is_result) {
  record_file(manifest_, folder_, path, is_result);
}

void Cache::record_volatile(const std::string& path) {
  manifest_.files[path] = Manifest::File{0, "", false};
}

std::string Cache::begin_comparison(const Job& job) {
  std::string recordings = hash_inputs(capture_inputs(job));
  if (manifest_.compared_hash != recordings) {
    manifest_.compared_hash.clear();
    if (!job.output.report.empty()) remove(job.output.report);
    save();
  }
  return recordings;
}

std::size_t Cache::sound_states() const {
  if (afresh_) return 0;
  std::size_t count = 0;
  while (count < static_cast<std::size_t>(manifest_.frames_done) &&
         is_sound(state_path(manifest_.first_frame + static_cast<int>(count)))) {
    ++count;
  }
  return count;
}

}  // namespace matterfit::job
