// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/diagnosis/diagnose_tests.hpp"

#include <string>

#include "diagnose/diagnose.hpp"
#include "job/diagnosis/effect_entry.hpp"
#include "job/diagnosis/report_json.hpp"
#include "job/diagnosis/run_diagnose.hpp"
#include "job/diagnosis/tests_model.hpp"
#include "job/documents/tests_document.hpp"
#include "job/fit_laws.hpp"
#include "job/run/stage.hpp"

namespace matterfit::job {

Json diagnose_tests(const std::filesystem::path& file, int threads, Interrupter& interrupter) {
  const TestsModel model(read_tests_file(file), threads, interrupter);
  diagnose::DiagnoseOptions options;
  options.members = 0;
  options.progress = [&](double part, const std::string& what) {
    enter_stage(interrupter, "Diagnosing: " + what, part);
  };
  const diagnose::Report report = diagnose::diagnose(model, options);
  Json json = report_json(report, model.captures());
  json["status"] = "done";
  json["task"] = "diagnose";
  json["version"] = MATTERFIT_VERSION;
  json["statements"] = Json::array(
      {"Errors are shares of a stress: of the one measured and half of the test's mean together."});
  diagnose::Point point;
  point.theta = report.extended.theta;
  for (const diagnose::Active& active : report.extended.causes) {
    point.causes.push_back({active.effect, active.variant, active.values});
  }
  const Specimen specimen = model.specimen(point);
  json["model"] = {{"material", material_json(specimen.material)}, {"effects", Json::array()}};
  for (const effects::Effect& effect : specimen.effects) {
    json["model"]["effects"].push_back(effect_entry(effect));
  }
  return json;
}

}  // namespace matterfit::job
