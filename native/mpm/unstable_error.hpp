// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "base/error.hpp"

namespace matterfit::mpm {

/// A run that has become unstable, which a smaller time step may mend. For everybody else an Error
/// of kCompute.
class UnstableError : public Error {
 public:
  explicit UnstableError(const std::string& message) : Error(ErrorKind::kCompute, message) {}
};

}  // namespace matterfit::mpm
