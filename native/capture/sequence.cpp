// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <map>
#include <system_error>

#include "base/error.hpp"
#include "capture/tracks.hpp"

namespace matterfit::capture {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kMaxDigits = 18;

bool is_digit(char c) { return c >= '0' && c <= '9'; }

/// A file name around its number: "cloud_" 0012 ".ply".
struct Split {
  std::string head;
  std::string digits;
  std::string tail;
};

/// At the last digits before the suffix; digits are empty if there are none.
Split split_name(const fs::path& path) {
  const std::string stem = path.stem().string();
  std::size_t begin = stem.size();
  while (begin > 0 && is_digit(stem[begin - 1])) --begin;
  return {stem.substr(0, begin), stem.substr(begin), path.extension().string()};
}

std::vector<fs::path> files_in(const fs::path& folder) {
  std::vector<fs::path> files;
  std::error_code code;
  fs::directory_iterator entry(folder, code);
  for (; !code && entry != fs::directory_iterator(); entry.increment(code)) {
    std::error_code ignored;
    if (entry->is_regular_file(ignored)) files.push_back(entry->path());
  }
  if (code) throw_input(folder.string() + ": cannot be listed: " + code.message() + ".");
  std::sort(files.begin(), files.end());
  return files;
}

/// Those of `files` named head, at least `width` digits, tail.
NumberedFiles matching(const std::vector<fs::path>& files, const std::string& head,
                       const std::string& tail, std::size_t width) {
  std::map<std::int64_t, fs::path> found;
  for (const fs::path& file : files) {
    const std::string name = file.filename().string();
    if (name.size() < head.size() + tail.size() + width || !name.starts_with(head) ||
        !name.ends_with(tail)) {
      continue;
    }
    const std::string digits = name.substr(head.size(), name.size() - head.size() - tail.size());
    if (digits.empty() || digits.size() > kMaxDigits ||
        !std::all_of(digits.begin(), digits.end(), is_digit)) {
      continue;
    }
    const auto [place, is_new] = found.emplace(std::stoll(digits), file);
    if (!is_new) {
      throw_input(name + " and " + place->second.filename().string() +
                  " have the same frame number. Which one belongs to the sequence?");
    }
  }
  NumberedFiles sequence;
  for (auto& [number, path] : found) {
    sequence.numbers.push_back(number);
    sequence.paths.push_back(std::move(path));
  }
  return sequence;
}

fs::path parent_of(const fs::path& path) {
  return path.has_parent_path() ? path.parent_path() : fs::path(".");
}

NumberedFiles by_pattern(const fs::path& pattern) {
  const std::string name = pattern.filename().string();
  const std::size_t begin = name.find('#');
  const std::size_t end = std::min(name.find_first_not_of('#', begin), name.size());
  if (begin == std::string::npos || name.find('#', end) != std::string::npos) {
    throw_input(pattern.string() +
                ": a pattern has one run of # in the file's name, as in cloud_####.ply.");
  }
  NumberedFiles sequence =
      matching(files_in(parent_of(pattern)), name.substr(0, begin), name.substr(end), end - begin);
  if (sequence.paths.empty()) throw_input(pattern.string() + ": no file matches this pattern.");
  return sequence;
}

NumberedFiles in_folder(const fs::path& folder) {
  const std::vector<fs::path> files = files_in(folder);
  std::map<std::string, Split> sequences;
  for (const fs::path& file : files) {
    const Split split = split_name(file);
    if (split.tail == ".ply" || split.tail == ".PLY") {
      sequences.emplace(split.head + "#" + split.tail, split);
    }
  }
  if (sequences.empty()) throw_input(folder.string() + ": holds no .ply files.");
  if (sequences.size() > 1) {
    std::string names;
    for (const auto& [name, split] : sequences) names += (names.empty() ? "" : ", ") + name;
    throw_input(folder.string() + ": holds more than one sequence of .ply files (" +
                names.substr(0, 200) + "). Name one of them by a pattern such as cloud_####.ply.");
  }
  const Split& only = sequences.begin()->second;
  if (only.digits.empty()) return {{0}, {folder / (only.head + only.tail)}};
  return matching(files, only.head, only.tail, 1);
}

}  // namespace

NumberedFiles find_sequence(const fs::path& pattern_or_first) {
  std::error_code code;
  if (fs::is_directory(pattern_or_first, code)) return in_folder(pattern_or_first);
  if (fs::exists(pattern_or_first, code)) {
    const Split split = split_name(pattern_or_first);
    if (split.digits.empty() || split.digits.size() > kMaxDigits) return {{0}, {pattern_or_first}};
    return matching(files_in(parent_of(pattern_or_first)), split.head, split.tail, 1);
  }
  if (pattern_or_first.filename().string().find('#') != std::string::npos) {
    return by_pattern(pattern_or_first);
  }
  throw_input(pattern_or_first.string() +
              ": there is no such file. Put it back, or name another one.");
}

}  // namespace matterfit::capture
