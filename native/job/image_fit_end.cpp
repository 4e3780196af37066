// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/image_fit_end.hpp"

#include <string>
#include <utility>

#include "job/documents/inputs.hpp"
#include "job/fit_files.hpp"
#include "job/fit_values.hpp"
#include "job/fit_weights.hpp"
#include "job/run/run_scene.hpp"

namespace matterfit::job {

Json FittedImages::document(const ImageExperiment& scene, const fit::Parameters& parameters,
                            const std::vector<double>& values) const {
  Json document = document_to_simulate(job_, job_.output.folder);
  add_lists(parameters, document);
  write_values(parameters, values, scene.loaded().sources, job_, document);
  return document;
}

Json FittedImages::simulate(const Json& document, const Json& fit, Interrupter& interrupter) const {
  const Job scene = job_of(document);
  Job fitted = scene;
  if (!fitted.captures.empty()) fitted.task = Task::kCompare;
  RunExtras extras;
  extras.task = task_name(Task::kFit);
  extras.images = false;  // the fit has, at the same values
  extras.begin = kImageFitShare;
  extras.clouds = doc_.loss != FitDoc::Loss::kTracks;
  extras.kept = {kFittedPath, kFitHistoryPath};
  if (fit.contains("weights") && fit.at("weights").at("taken") == true) {
    extras.kept.push_back(weights_file_name(fit.at("weights").at("body").get<std::string>()));
  }
  extras.finish = [&](Json& result) {
    result["fit"] = fit;
    std::vector<std::string> files =
        write_materials(job_.output.folder, scene, bodies_of(scene), fit);
    files.insert(files.end(), extras.kept.begin(), extras.kept.end());
    return files;
  };
  RunOptions options = options_;
  if (options.restart == Restart::kNever) options.restart = Restart::kWhereChanged;
  return run_or_unfinished(unrun(scene), fit,
                           [&] { return run_scenes(fitted, options, interrupter, extras); });
}

Json FittedImages::unfinished(const Json& document, Json fit, const Error& why) const {
  const Job scene = job_of(document);
  return write_unfinished(unrun(scene), std::move(fit), why);
}

Unfinished FittedImages::unrun(const Job& scene) const {
  return {job_.output.folder, scene, bodies_of(scene), resolve_target(options_.target)};
}

Job FittedImages::job_of(const Json& document) const {
  ReadOptions read;
  read.base_folder = job_.base_folder;
  return read_job(document.dump(), read);
}

std::vector<std::string> FittedImages::bodies_of(const Job& scene) const {
  return fitted_bodies(doc_, scene.scene.bodies.front().name);
}

}  // namespace matterfit::job
