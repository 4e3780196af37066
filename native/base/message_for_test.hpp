// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <gtest/gtest.h>

#include <functional>
#include <string>

#include "base/error.hpp"

namespace matterfit {

/// The message of the Error of this kind that `work` throws; the test fails where it throws none.
inline std::string message_of(ErrorKind kind, const std::function<void()>& work) {
  try {
    work();
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), kind) << error.what();
    return error.what();
  }
  ADD_FAILURE() << "nothing was thrown";
  return {};
}

/// The same of what is wrong with an input.
inline std::string message_of(const std::function<void()>& work) {
  return message_of(ErrorKind::kInput, work);
}

}  // namespace matterfit
