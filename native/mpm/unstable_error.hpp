// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <optional>
#include <string>

#include "base/error.hpp"

namespace matterfit::mpm {

/// A run that has become unstable, which a smaller time step may mend. For everybody else an Error
/// of kCompute.
class UnstableError : public Error {
 public:
  explicit UnstableError(const std::string& message) : Error(ErrorKind::kCompute, message) {}
  /// `body`: the total Lagrangian body that became unstable, into Scene::bodies.
  UnstableError(const std::string& message, std::size_t body)
      : Error(ErrorKind::kCompute, message), body_(body) {}

  [[nodiscard]] std::optional<std::size_t> body() const { return body_; }

 private:
  std::optional<std::size_t> body_;
};

}  // namespace matterfit::mpm
