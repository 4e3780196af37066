// SPDX-License-Identifier: GPL-3.0-or-later
#include <fmt/format.h>

#include <algorithm>

#include "job/diagnosis/observation_document.hpp"
#include "job/diagnosis/scene_model.hpp"
#include "job/fit_values.hpp"

/// How a point of a diagnosis is written into a document.
namespace matterfit::job {

void SceneModel::write(const diagnose::Point& point, Json& document,
                       std::vector<std::string>& statements) const {
  write_values(*parameters_, fitted_values(point), loaded_.sources, job_, document);
  write_nuisances(point, document, statements);
  for (const diagnose::Point::Cause& cause : point.causes) {
    const Cause& known = causes_[static_cast<std::size_t>(cause.effect)];
    if (!known.write && !known.write_over) {
      write_observed(cause, document, statements);
      continue;
    }
    const std::span<const double> values{cause.values.data(),
                                         static_cast<std::size_t>(cause.values.size())};
    if (!known.run) {
      known.write(values, cause.variant, document.at("scene"));
      continue;
    }
    for (const std::size_t capture : loaded_.sources[*known.run].group.captures) {
      known.write_over(values, cause.variant, document.at("scene"),
                       document.at("captures").at(capture).at("scene"));
    }
  }
}

void SceneModel::write_observed(const diagnose::Point::Cause& cause, Json& document,
                                std::vector<std::string>& statements) const {
  const diagnose::Effect& effect = rows_[static_cast<std::size_t>(cause.effect)];
  for (std::size_t i = 0; i < job_.captures.size(); ++i) {
    const CaptureDoc& doc = job_.captures[i];
    for (std::size_t c = 0; c < captures_.size(); ++c) {
      const bool acts = diagnose::acts_in(effect, static_cast<int>(c));
      if (captures_[c].name != doc.name || !acts) continue;
      const SceneDoc& scene = doc.scene ? *doc.scene : job_.scene;
      const ObservedCapture about{scene.fps, scene.first_frame, inputs_[c]->rest, doc};
      if (!write_observation(effect,
                             {cause.values.data(), static_cast<std::size_t>(cause.values.size())},
                             about, document.at("captures").at(i))) {
        statements.push_back(fmt::format(
            "The {} of '{}' has no place in a document: the extended model leaves it out.",
            effect.name, doc.name));
      }
    }
  }
}

}  // namespace matterfit::job
