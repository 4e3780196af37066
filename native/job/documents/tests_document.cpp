// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/documents/tests_document.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstdint>
#include <tuple>
#include <utility>
#include <vector>

#include "base/error.hpp"
#include "base/file.hpp"
#include "job/documents/json_reader.hpp"

namespace matterfit::job {
namespace {

constexpr std::uint64_t kLargestTests = std::uint64_t{16} << 20U;
constexpr std::size_t kMostReadings = 2000;  // of a test
constexpr const char* kTestsSchema = "matterfit.tests/1";

std::vector<double> numbers_of(const JsonValue& value) {
  std::vector<double> all;
  for (const JsonValue& item : value.items()) all.push_back(item.number());
  return all;
}

void check_readings(const JsonValue& item, const material::MachineTest& test) {
  if (test.by.size() != test.nominal.size() || test.by.empty()) {
    item.refuse("'by' and 'nominal' are not as long as each other, or empty.");
  }
  if (test.by.size() > kMostReadings) {
    item.refuse(fmt::format("{} readings, {} at most are read: take every n-th.", test.by.size(),
                            kMostReadings));
  }
  if (test.pull != material::Pull::kShear && !(std::ranges::min(test.by) > 0.0)) {
    item.refuse("'by' has a stretch that is not above 0; without load it is 1.");
  }
  if (std::ranges::all_of(test.nominal, [](double stress) { return stress == 0.0; })) {
    item.refuse("all of 'nominal' are 0.");
  }
}

/// Sorts by stretches, so that no sum over them depends on the order in which they were written.
void sort_readings(material::MachineTest& test) {
  std::vector<std::pair<double, double>> readings;
  for (std::size_t k = 0; k < test.by.size(); ++k) {
    readings.emplace_back(test.by[k], test.nominal[k]);
  }
  std::ranges::stable_sort(readings, {}, &std::pair<double, double>::first);
  for (std::size_t k = 0; k < readings.size(); ++k) {
    std::tie(test.by[k], test.nominal[k]) = readings[k];
  }
}

}  // namespace

bool is_tests_file(const std::filesystem::path& file) {
  try {
    const auto bytes = read_file(file, kLargestTests);
    const Json json = Json::parse(bytes.begin(), bytes.end(), nullptr, false);
    return json.is_object() && json.value("schema", Json()) == kTestsSchema;
  } catch (const Error&) {
    return false;
  }
}

TestsDoc read_tests_file(const std::filesystem::path& file) {
  const auto bytes = read_file(file, kLargestTests);
  const std::string name = file.generic_string();
  const Json json = parse_json({reinterpret_cast<const char*>(bytes.data()), bytes.size()}, name);
  JsonObject object(JsonValue(json, name));
  const JsonValue schema = object.require("schema");
  if (schema.string() != kTestsSchema) schema.fail(kTestsSchema);
  TestsDoc doc;
  const JsonValue called = object.require("name");
  doc.name = called.string();
  if (doc.name.empty() || doc.name.find('/') != std::string::npos) {
    called.fail("a name that a file can have");
  }
  doc.source = object.string("source", "");
  doc.poisson_ratio =
      object.number("poisson_ratio", doc.poisson_ratio, Range{0.0, 0.4999, true, {}});
  doc.noise = object.number("noise", doc.noise, Range{0.0, 0.2, true, {}});
  if (const auto law = object.find("law")) {
    constexpr material::Law kLaws[] = {material::Law::kNeoHookean, material::Law::kFixedCorotated,
                                       material::Law::kStvkHencky};
    doc.law = kLaws[law->choice({"neo_hookean", "fixed_corotated", "stvk_hencky"})];
  }
  for (const JsonValue& item : object.require("tests").items()) {
    JsonObject one(item);
    material::MachineTest test;
    test.pull = static_cast<material::Pull>(
        one.require("pull").choice({"uniaxial", "equibiaxial", "shear"}));
    test.by = numbers_of(one.require("by"));
    test.nominal = numbers_of(one.require("nominal"));
    check_readings(item, test);
    sort_readings(test);
    (one.boolean("held_out", false) ? doc.held_out : doc.fitted).push_back(std::move(test));
    one.finish();
  }
  object.finish();
  if (doc.fitted.empty()) throw_input(name + ".tests: each test is held out, or there is none.");
  return doc;
}

}  // namespace matterfit::job
