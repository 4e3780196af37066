// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/diagnosis/run_check.hpp"

#include <cmath>
#include <filesystem>
#include <string>
#include <vector>

#include "base/error.hpp"
#include "base/file.hpp"
#include "diagnose/identify.hpp"
#include "job/diagnosis/scene_model.hpp"
#include "job/documents/fit_document.hpp"

namespace matterfit::job {
namespace {

/// JSON has no infinity.
Json number(double value) { return std::isfinite(value) ? Json(value) : Json(); }

Json check_json(const diagnose::BeforeFit& before) {
  Json json = {
      {"schema", kCheckSchema},
      {"noise",
       {{"sigma", number(before.sigma)}, {"autocorrelation", number(before.autocorrelation)}}},
      {"parameters", Json::array()},
      {"ties", Json::array()},
      {"enough", Json::array()},
      {"assumptions", Json::array()},
      {"record_instead", before.record_instead}};
  for (const diagnose::Identifiable& p : before.parameters) {
    json["parameters"].push_back({{"path", p.name},
                                  {"unit", p.unit},
                                  {"start", number(p.value)},
                                  {"error", number(p.error)},
                                  {"keep", number(p.keep)},
                                  {"known", p.known}});
  }
  for (const diagnose::Tie& tie : before.ties) {
    json["ties"].push_back({{"parameters", tie.names}, {"keep", number(tie.keep)}});
  }
  for (const diagnose::Enough& enough : before.enough) {
    json["enough"].push_back({{"what", enough.what},
                              {"enough", enough.enough},
                              {"ratio", number(enough.ratio)},
                              {"parameter", enough.parameter},
                              {"sentence", enough.sentence}});
  }
  for (const diagnose::Assumption& a : before.assumptions) {
    json["assumptions"].push_back({{"effect", a.effect},
                                   {"size", a.size},
                                   {"parameter", a.parameter},
                                   {"shift", number(a.shift)},
                                   {"errors", number(a.errors)}});
  }
  return json;
}

}  // namespace

Json run_check(const Job& job, const RunOptions& options, Interrupter& interrupter) {
  if (!job.fit) {
    throw_input(
        "fit: a check says what a fit will tell; add a section 'fit' with the parameters that are "
        "to be found.");
  }
  if (job.fit->loss != FitDoc::Loss::kTracks) {
    throw_input("fit.loss: a check needs tracks; clouds without correspondence have none.");
  }
  std::vector<std::string> notes;
  const SceneModel model(job, SceneModel::From::kFirstFrames, options, interrupter, notes);
  diagnose::IdentifyOptions asked;
  asked.central = false;
  asked.progress = [&](double part, const std::string& what) {
    Progress progress;
    progress.label = "Checking: " + what;
    progress.fraction = part;
    interrupter.report(progress);
    interrupter.check();
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
