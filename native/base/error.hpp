// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <stdexcept>
#include <string>

namespace matterfit {

/// What went wrong decides the exit status of the tool (docs/errors.md).
enum class ErrorKind {
  kInput,      ///< The input is wrong: exit status 2. The message says what, where and what to do.
  kCompute,    ///< The computation could not be completed: exit status 3, with what to change.
  kOutput,     ///< A result could not be written (disk full, read-only folder): exit status 3.
  kCancelled,  ///< Cancelled by the user: exit status 130.
};

/// The one exception type that crosses rooms. Never crosses the C ABI.
class Error : public std::runtime_error {
 public:
  Error(ErrorKind kind, const std::string& message) : std::runtime_error(message), kind_(kind) {}
  [[nodiscard]] ErrorKind kind() const noexcept { return kind_; }

 private:
  ErrorKind kind_;
};

/// Exit status of the `matterfit` tool for an error of this kind.
[[nodiscard]] int exit_status(ErrorKind kind) noexcept;

[[noreturn]] void throw_input(const std::string& message);
[[noreturn]] void throw_compute(const std::string& message);
[[noreturn]] void throw_output(const std::string& message);

}  // namespace matterfit
