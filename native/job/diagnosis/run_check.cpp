// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/diagnosis/run_check.hpp"

#include <cmath>
#include <filesystem>
#include <string>
#include <vector>

#include "base/error.hpp"
#include "base/file.hpp"
#include "diagnose/identify.hpp"
#include "job/diagnosis/report_json.hpp"
#include "job/diagnosis/scene_model.hpp"
#include "job/documents/fit_document.hpp"
#include "job/run/stage.hpp"

namespace matterfit::job {
namespace {

Json check_json(const diagnose::BeforeFit& before) {
  Json json = {{"schema", kCheckSchema},
               {"noise",
                {{"sigma", number_json(before.sigma)},
                 {"autocorrelation", number_json(before.autocorrelation)}}},
               {"parameters", Json::array()},
               {"ties", Json::array()},
               {"enough", Json::array()},
               {"assumptions", Json::array()},
               {"record_instead", before.record_instead}};
  for (const diagnose::Identifiable& p : before.parameters) {
    json["parameters"].push_back({{"path", p.name},
                                  {"unit", p.unit},
                                  {"start", number_json(p.value)},
                                  {"error", number_json(p.error)},
                                  {"keep", number_json(p.keep)},
                                  {"known", p.known}});
  }
  for (const diagnose::Tie& tie : before.ties) {
    json["ties"].push_back({{"parameters", tie.names}, {"keep", number_json(tie.keep)}});
  }
  for (const diagnose::Enough& enough : before.enough) {
    json["enough"].push_back({{"what", enough.what},
                              {"enough", enough.enough},
                              {"ratio", number_json(enough.ratio)},
                              {"parameter", enough.parameter},
                              {"sentence", enough.sentence}});
  }
  for (const diagnose::Assumption& a : before.assumptions) {
    json["assumptions"].push_back({{"effect", a.effect},
                                   {"size", a.size},
                                   {"parameter", a.parameter},
                                   {"shift", number_json(a.shift)},
                                   {"errors", number_json(a.errors)}});
  }
  return json;
}

}  // namespace

Json run_check(const Job& job, const RunOptions& options, Interrupter& interrupter) {
  if (!job.fit) {
    throw_input(
        "fit: a check reports which parameters a fit will identify; add a section 'fit' with the "
        "parameters that are to be found.");
  }
  if (job.fit->loss != FitDoc::Loss::kTracks) {
    throw_input("fit.loss: a check needs tracks; clouds without correspondence have none.");
  }
  std::vector<std::string> notes;
  const SceneModel model(job, SceneModel::From::kFirstFrames, options, interrupter, notes);
  diagnose::IdentifyOptions asked;
  asked.central = false;
  asked.progress = [&](double part, const std::string& what) {
    enter_stage(interrupter, "Checking: " + what, part);
  };
  const diagnose::BeforeFit before = diagnose::identify(model, asked);
  Json json = check_json(before);
  json["statements"] = before.statements;
  json["notes"] = notes;
  json["status"] = "done";
  json["task"] = "check";
  json["version"] = MATTERFIT_VERSION;
  json["folder"] = job.output.folder.generic_string();
  std::filesystem::create_directories(job.output.folder);
  write_file(job.output.folder / "check.json", json.dump(2) + "\n");
  return json;
}

}  // namespace matterfit::job
