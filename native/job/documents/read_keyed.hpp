// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>

#include "job/documents/document.hpp"
#include "job/documents/json_reader.hpp"

/// Not for use outside the job room.
namespace matterfit::job {

/// A value, or {frames, values, interpolation}; `read` reads one value.
template <class Value, class Read>
[[nodiscard]] ByFrame<Value> read_keyed(const JsonValue& value, const Read& read) {
  if (!value.json().is_object() || !value.json().contains("frames")) {
    return ByFrame<Value>(read(value));
  }
  JsonObject object(value);
  ByFrame<Value> keyed;
  const JsonValue frames = object.require("frames");
  for (const JsonValue& frame : frames.items()) keyed.frames.push_back(frame.number());
  for (const JsonValue& item : object.require("values").items()) keyed.values.push_back(read(item));
  if (const auto how = object.find("interpolation")) {
    keyed.step = how->choice({"linear", "step"}) == 1;
  }
  object.finish();
  if (keyed.frames.empty()) frames.fail("at least one frame");
  if (keyed.frames.size() != keyed.values.size()) {
    value.refuse(std::to_string(keyed.frames.size()) + " frames but " +
                 std::to_string(keyed.values.size()) + " values; give one value a frame.");
  }
  for (std::size_t i = 1; i < keyed.frames.size(); ++i) {
    if (keyed.frames[i] <= keyed.frames[i - 1]) {
      frames.refuse("frame " + std::to_string(keyed.frames[i]) + " does not come after " +
                    std::to_string(keyed.frames[i - 1]) + "; sort the keys.");
    }
  }
  return keyed;
}

}  // namespace matterfit::job
