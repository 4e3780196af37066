// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/documents/excitation_document.hpp"

#include <vector>

namespace matterfit::job {

Json excitation_json(const material::Excitation& over) {
  return {{"strain", over.strain},
          {"compression", over.compression},
          {"expansion", over.expansion},
          {"rates", {over.slowest, over.fastest}}};
}

material::Excitation read_excitation(const JsonValue& value) {
  JsonObject object(value);
  material::Excitation over;
  over.strain = object.require("strain").number(positive());
  over.compression = object.require("compression").number(not_negative());
  over.expansion = object.require("expansion").number(not_negative());
  const JsonValue rates = object.require("rates");
  const std::vector<JsonValue> both = rates.items();
  if (both.size() != 2) rates.fail("two rates [1/s], the slower one first");
  over.slowest = both[0].number(positive("1/s"));
  over.fastest = both[1].number(positive("1/s"));
  if (over.fastest < over.slowest) rates.refuse("the first rate is the faster one.");
  object.finish();
  return over;
}

}  // namespace matterfit::job
