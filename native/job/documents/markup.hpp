// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>

namespace matterfit::job {

/// A text as HTML and XML have it, between tags or in double quotes.
[[nodiscard]] inline std::string escaped(const std::string& text) {
  std::string result;
  for (const char c : text) {
    switch (c) {
      case '&':
        result += "&amp;";
        break;
      case '<':
        result += "&lt;";
        break;
      case '>':
        result += "&gt;";
        break;
      case '"':
        result += "&quot;";
        break;
      default:
        result += c;
    }
  }
  return result;
}

}  // namespace matterfit::job
