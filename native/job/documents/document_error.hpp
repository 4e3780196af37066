// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>

#include "base/error.hpp"

namespace matterfit::job {

/// An error whose message begins with its place in the document.
class DocumentError final : public Error {
 public:
  /// `rest` follows the place: ": why", or what of it is wrong.
  DocumentError(ErrorKind kind, const std::string& place, const std::string& rest)
      : Error(kind, place + rest) {}
};

/// What `work` returns. An error of a room below begins with a file or a sentence: the place in the
/// document goes before it.
template <class Work>
auto at_place(const std::string& place, const Work& work) {
  try {
    return work();
  } catch (const DocumentError&) {
    throw;
  } catch (const Error& error) {
    throw DocumentError(error.kind(), place, std::string(": ") + error.what());
  }
}

}  // namespace matterfit::job
