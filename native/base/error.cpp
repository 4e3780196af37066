// SPDX-License-Identifier: GPL-3.0-or-later
#include "base/error.hpp"

namespace matterfit {

int exit_status(ErrorKind kind) noexcept {
  switch (kind) {
    case ErrorKind::kInput:
      return 2;
    case ErrorKind::kCompute:
    case ErrorKind::kOutput:
      return 3;
    case ErrorKind::kCancelled:
      return 130;
  }
  return 3;
}

void throw_input(const std::string& message) { throw Error(ErrorKind::kInput, message); }
void throw_compute(const std::string& message) { throw Error(ErrorKind::kCompute, message); }
void throw_output(const std::string& message) { throw Error(ErrorKind::kOutput, message); }

}  // namespace matterfit
