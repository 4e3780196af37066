// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/fit_checkpoint.hpp"

#include "base/file.hpp"
#include "base/hash.hpp"

namespace matterfit::job {
namespace {

/// The shortest text that reads back as the same number: equal values give equal texts.
std::string exact_text(const Json& json) {
  return json.dump(-1, ' ', false, Json::error_handler_t::replace);
}

}  // namespace

std::string format_checkpoint(const char* schema, const std::string& input_hash,
                              const Json& state) {
  const Json file = {{"schema", schema},
                     {"input_hash", input_hash},
                     {"hash", hash_hex(exact_text(state))},
                     {"state", state}};
  return exact_text(file) + "\n";
}

Json read_checkpoint(const std::filesystem::path& folder) {
  const std::filesystem::path path = folder / kFitCheckpointPath;
  if (!std::filesystem::exists(path)) return {};
  const auto bytes = read_file(path);
  const auto* text = reinterpret_cast<const char*>(bytes.data());
  return Json::parse(text, text + bytes.size(), nullptr, false);
}

bool is_checkpoint_of(const Json& file, const char* schema) {
  return file.at("schema") == schema && file.at("hash") == hash_hex(exact_text(file.at("state")));
}

}  // namespace matterfit::job
