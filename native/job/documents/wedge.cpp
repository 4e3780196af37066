// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/documents/wedge.hpp"

#include <algorithm>
#include <set>

#include "base/error.hpp"
#include "base/file.hpp"
#include "job/documents/inputs.hpp"
#include "job/documents/json_reader.hpp"

namespace matterfit::job {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kLongestName = 120;  // of a folder; file systems take 255 bytes

std::string trimmed(const std::string& text) {
  const auto begin = text.find_first_not_of(" \t");
  if (begin == std::string::npos) return "";
  return text.substr(begin, text.find_last_not_of(" \t") - begin + 1);
}

/// The parts between commas that stand outside brackets, braces and quotes.
std::vector<std::string> split_values(const std::string& text) {
  std::vector<std::string> values(1);
  int depth = 0;
  char quote = 0;
  for (const char c : text) {
    if (quote != 0) {
      if (c == quote) quote = 0;
    } else if (c == '"') {
      quote = c;
    } else if (c == '[' || c == '{') {
      ++depth;
    } else if (c == ']' || c == '}') {
      --depth;
    } else if (c == ',' && depth == 0) {
      values.emplace_back();
      continue;
    }
    values.back().push_back(c);
  }
  for (std::string& value : values) value = trimmed(value);
  return values;
}

WedgeAxis read_axis(const std::string& assignment) {
  const std::size_t equals = assignment.find('=');
  if (equals == std::string::npos || equals == 0) {
    throw_input("--set " + assignment +
                ": expected PATH=VALUE,VALUE,…, as in velocity[2]=-1,-2,-3.");
  }
  WedgeAxis axis{assignment.substr(0, equals), split_values(assignment.substr(equals + 1))};
  for (std::size_t i = 0; i < axis.values.size(); ++i) {
    if (axis.values[i].empty()) {
      throw_input("--set " + assignment + ": a value is missing between two commas.");
    }
    const auto before = axis.values.begin() + static_cast<std::ptrdiff_t>(i);
    if (std::find(axis.values.begin(), before, axis.values[i]) != before) {
      throw_input("--set " + assignment + ": the value " + axis.values[i] + " is there twice.");
    }
  }
  return axis;
}

/// What a folder may be called everywhere: letters, digits and . - + of a path or value.
std::string plain(const std::string& text) {
  std::string name;
  for (const char c : text) {
    const bool letter = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9');
    if (letter || c == '.' || c == '-' || c == '+') {
      name.push_back(c);
    } else if (c == '[' && !name.empty() && name.back() != '.') {
      name.push_back('.');
    } else if (c == ',') {
      name.push_back('_');
    }
  }
  return name;
}

std::string shown(const std::string& path) {
  return path.rfind("scene.", 0) == 0 ? path.substr(6) : path;
}

void name_members(Wedge& wedge) {
  std::set<std::string> taken;
  for (WedgeMember& member : wedge.members) {
    std::string name = member.name.substr(0, kLongestName);
    for (int number = 2; !taken.insert(name).second; ++number) {
      name = member.name.substr(0, kLongestName) + "_" + std::to_string(number);
    }
    member.name = name;
  }
}

}  // namespace

Wedge read_wedge(const std::vector<std::string>& assignments) {
  if (assignments.empty()) {
    throw_input(
        "a wedge needs at least one --set PATH=VALUE,VALUE,…, as in "
        "--set velocity[2]=-1,-2,-3.");
  }
  Wedge wedge;
  std::size_t count = 1;
  for (const std::string& assignment : assignments) {
    WedgeAxis axis = read_axis(assignment);
    for (const WedgeAxis& other : wedge.axes) {
      if (other.path == axis.path) throw_input("--set " + axis.path + ": is there twice.");
    }
    count *= axis.values.size();
    if (count > kMostMembers) {
      throw_input("a wedge of more than " + std::to_string(kMostMembers) +
                  " members; give fewer values.");
    }
    wedge.axes.push_back(std::move(axis));
  }
  wedge.members.resize(count);
  for (std::size_t m = 0; m < count; ++m) {
    WedgeMember& member = wedge.members[m];
    std::size_t rest = m;
    std::size_t block = count;
    for (const WedgeAxis& axis : wedge.axes) {
      block /= axis.values.size();
      const std::string& value = axis.values[rest / block];
      rest %= block;
      member.overrides.push_back(axis.path + "=" + value);
      member.label += (member.label.empty() ? "" : ", ") + shown(axis.path) + " = " + value;
      member.name +=
          (member.name.empty() ? "" : "_") + plain(shown(axis.path)) + "=" + plain(value);
    }
  }
  name_members(wedge);
  return wedge;
}

WedgeFolder write_wedge(std::string_view text, const ReadOptions& options,
                        const std::vector<std::string>& assignments, const fs::path& folder) {
  WedgeFolder made;
  made.folder = fs::absolute(folder).lexically_normal();
  made.wedge = read_wedge(assignments);
  std::vector<std::string> documents;
  documents.reserve(made.wedge.members.size());
  for (const WedgeMember& member : made.wedge.members) {
    ReadOptions own = options;
    own.overrides.insert(own.overrides.end(), member.overrides.begin(), member.overrides.end());
    try {
      Job job = read_job(text, own);
      require_files(job);
      const fs::path home = made.folder / member.name;
      job.document["output"]["folder"] = home.string();
      job.document["task"] = task_name(job.task);
      made.task = job.task;
      documents.push_back(write_job(job, home));
    } catch (const Error& error) {
      throw Error(error.kind(), member.label + ": " + error.what());
    }
  }
  Json members = Json::array();
  for (std::size_t m = 0; m < documents.size(); ++m) {
    const WedgeMember& member = made.wedge.members[m];
    const fs::path path = made.folder / member.name / "job.json";
    bool same = false;
    if (fs::is_regular_file(path)) {
      const auto bytes = read_file(path);
      same = documents[m] ==
             std::string_view(reinterpret_cast<const char*>(bytes.data()), bytes.size());
    }
    if (!same) write_file(path, documents[m]);
    made.same.push_back(same);
    made.jobs.push_back(read_job_file(path));
    members.push_back(
        {{"folder", member.name}, {"label", member.label}, {"set", member.overrides}});
  }
  Json axes = Json::array();
  for (const WedgeAxis& axis : made.wedge.axes) {
    axes.push_back({{"path", axis.path}, {"values", axis.values}});
  }
  const Json json = {{"schema", kWedgeSchema},
                     {"task", task_name(made.task)},
                     {"axes", axes},
                     {"members", members}};
  write_file(made.folder / "wedge.json", json.dump(2) + "\n");
  return made;
}

}  // namespace matterfit::job
