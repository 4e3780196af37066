// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/run/checkpoint.hpp"

#include <algorithm>

#include "base/error.hpp"
#include "base/file.hpp"
#include "base/hash.hpp"
#include "job/documents/json_reader.hpp"

namespace matterfit::job {

std::string format_checkpoint(const Checkpoint& checkpoint) {
  const Json header = {{"schema", "matterfit.checkpoint/1"},
                       {"input_hash", checkpoint.input_hash},
                       {"frame", checkpoint.frame},
                       {"size", checkpoint.bytes.size()},
                       {"hash", hash_hex(checkpoint.bytes)}};
  return header.dump() + "\n" + checkpoint.bytes;
}

std::optional<Checkpoint> read_checkpoint(const std::filesystem::path& folder,
                                          const std::string& input_hash) {
  if (!std::filesystem::exists(folder / kCheckpointPath)) return std::nullopt;
  const auto file = read_file(folder / kCheckpointPath);
  const std::string_view text(reinterpret_cast<const char*>(file.data()), file.size());
  const std::size_t line = text.find('\n');
  if (line == std::string_view::npos) return std::nullopt;
  const Json header = Json::parse(text.substr(0, line), nullptr, false);
  if (!header.is_object() || header.value("schema", "") != "matterfit.checkpoint/1" ||
      header.value("input_hash", "") != input_hash) {
    return std::nullopt;
  }
  const std::string_view bytes = text.substr(line + 1);
  if (header.value("size", std::size_t{0}) != bytes.size() ||
      header.value("hash", "") != hash_hex(bytes)) {
    return std::nullopt;
  }
  return Checkpoint{input_hash, header.value("frame", 0), std::string(bytes)};
}

}  // namespace matterfit::job
