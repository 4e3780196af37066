// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/run/bake_cost.hpp"

#include <cstdlib>
#include <filesystem>
#include <string>

#include "base/clock.hpp"
#include "base/error.hpp"
#include "job/run/bake_outputs.hpp"

namespace matterfit::job {
namespace {

namespace fs = std::filesystem;

/// A folder that is gone afterwards.
class TemporaryFolder {
 public:
  TemporaryFolder() {
    std::string name = (fs::temp_directory_path() / "matterfit_estimate_XXXXXX").string();
    if (::mkdtemp(name.data()) == nullptr) {
      throw_output(name + ": cannot create the folder. Is the disk full, or TMPDIR wrong?");
    }
    path_ = name;
  }
  ~TemporaryFolder() {
    std::error_code code;
    fs::remove_all(path_, code);
  }
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;
  [[nodiscard]] const fs::path& path() const { return path_; }

 private:
  fs::path path_;
};

/// Folder by folder: std::filesystem's recursive iterator frees what is not its own where the
/// process (bpy 4.5 and 5.0) brings another libstdc++'s.
std::uint64_t bytes_below(const fs::path& folder) {
  std::uint64_t bytes = 0;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder)) {
    bytes += entry.is_directory() ? bytes_below(entry.path()) : entry.file_size();
  }
  return bytes;
}

}  // namespace

BakeCost measure_bake(const Job& job, const mpm::Scene& scene, const mpm::FrameState& state,
                      Arena& arena, const Interrupter& interrupter) {
  const TemporaryFolder folder;
  Job copy = job;
  copy.output.folder = folder.path();
  BakeCost cost;
  const auto begin = Clock::now();
  BakeOutputs outputs(copy, scene, arena, interrupter);
  outputs.start(0);
  cost.begin = seconds_since(begin);
  const auto frame = Clock::now();
  outputs.bake(state, 0, true);
  outputs.finish();
  cost.seconds = seconds_since(frame);
  cost.bytes = bytes_below(folder.path());
  return cost;
}

}  // namespace matterfit::job
