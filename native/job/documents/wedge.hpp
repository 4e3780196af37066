// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "job/documents/document.hpp"

namespace matterfit::job {

inline constexpr std::string_view kWedgeSchema = "matterfit.wedge/1";

/// One number or value of a document that is varied.
struct WedgeAxis {
  std::string path;                 ///< as of `--set` (job/documents/override.hpp)
  std::vector<std::string> values;  ///< as they were written, in their order
};

/// One document of a wedge: the base document with one value of each axis.
struct WedgeMember {
  std::string name;                    ///< its folder's name: "velocity.2=-1_material.E=1e5"
  std::string label;                   ///< for people: "velocity[2] = -1, material.E = 1e5"
  std::vector<std::string> overrides;  ///< "path=value", one an axis
};

/// The Cartesian product of the axes; the last axis varies fastest.
struct Wedge {
  std::vector<WedgeAxis> axes;
  std::vector<WedgeMember> members;
};

/// At most so many members: a slip of the hand in one list multiplies with the others.
inline constexpr std::size_t kMostMembers = 10'000;

/// Takes apart assignments "path=value,value,…". Commas within brackets, braces and quotes belong
/// to a value: `gravity=[0,0,-9.81],[0,0,-1.62]`. Throws Error(kInput): no assignment, no value, a
/// value or path twice, too many members.
[[nodiscard]] Wedge read_wedge(const std::vector<std::string>& assignments);

/// A wedge's folder: `wedge.json`, and `NAME/job.json` for each member, which bakes into `NAME`.
struct WedgeFolder {
  std::filesystem::path folder;
  Task task = Task::kSimulate;
  Wedge wedge;
  std::vector<Job> jobs;   ///< in the members' order
  std::vector<bool> same;  ///< job.json was there with the same bytes
};

/// Reads the base document `text` once for each member, as read_job does, with `options.overrides`
/// first; only when all of them are sound and every file that they name is there, anything is
/// written into `folder`. Throws Error(kInput) that begins with the label of the member that is
/// wrong.
[[nodiscard]] WedgeFolder write_wedge(std::string_view text, const ReadOptions& options,
                                      const std::vector<std::string>& assignments,
                                      const std::filesystem::path& folder);

}  // namespace matterfit::job
