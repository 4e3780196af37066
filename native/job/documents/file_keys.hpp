// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>

#include "job/documents/json_reader.hpp"

/// Which texts of a job document name files: the one list that moving a document and hashing its
/// inputs go by.
namespace matterfit::job {

/// What a text under a key names.
enum class FileKey {
  kNone,
  kSimulated,  ///< a file that a simulation reads: its content is one of the simulation's inputs
  kOther,      ///< a recording or a folder
};

/// `value`: the text, or one of those in a list under this key. `weights` name a file where the
/// text says so (is_weights_file()), else a law that the library carries.
[[nodiscard]] FileKey file_key(const std::string& key, const Json& value);

}  // namespace matterfit::job
