// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/documents/file_keys.hpp"

#include <map>

#include "job/documents/neural_starts.hpp"

namespace matterfit::job {

FileKey file_key(const std::string& key, const Json& value) {
  static const std::map<std::string, FileKey> keys = {
      {"points", FileKey::kSimulated},  {"mesh", FileKey::kSimulated},
      {"cage", FileKey::kSimulated},    {"gaussians", FileKey::kSimulated},
      {"file", FileKey::kSimulated},    {"meshes", FileKey::kSimulated},
      {"weights", FileKey::kSimulated}, {"tracks", FileKey::kOther},
      {"pattern", FileKey::kOther},     {"folder", FileKey::kOther},
      {"cameras", FileKey::kOther},     {"images", FileKey::kOther}};
  const auto found = keys.find(key);
  if (found == keys.end() || !value.is_string()) return FileKey::kNone;
  if (key == "weights" && !is_weights_file(value.get_ref<const std::string&>())) {
    return FileKey::kNone;
  }
  return found->second;
}

}  // namespace matterfit::job
