// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/fit_like.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "base/error.hpp"
#include "capture/thin.hpp"
#include "fit/data/excitation.hpp"
#include "fit/data/follow.hpp"
#include "fit/search/equation_start.hpp"
#include "job/documents/excitation_document.hpp"
#include "job/fit_laws.hpp"
#include "job/material_file.hpp"

namespace matterfit::job {
namespace {

constexpr double kPlaces = 300;  // about, at which strains are looked at

}  // namespace

Json like_json(const material::Material& neural, const material::Excitation& over) {
  const std::vector<material::Likeness> found = likenesses(neural, over);
  const material::Likeness& nearest = found.front();
  Json parameters = material_json(nearest.material);
  parameters.erase("law");
  Json others = Json::array();
  for (std::size_t k = 1; k < found.size(); ++k) {
    others.push_back({{"law", material::traits(found[k].material.law).name},
                      {"distance", found[k].stress},
                      {"flow_distance", found[k].flow}});
  }
  return {{"law", material::traits(nearest.material.law).name},
          {"parameters", parameters},
          {"distance", nearest.stress},
          {"flow_distance", nearest.flowing > 0.0 ? Json(nearest.flow) : Json()},
          {"sentence", likeness_sentence(nearest, over)},
          {"over", excitation_json(over)},
          {"others", others}};
}

void widen(material::Excitation& all, const material::Excitation& by) {
  all.strain = std::max(all.strain, by.strain);
  all.compression = std::max(all.compression, by.compression);
  all.expansion = std::max(all.expansion, by.expansion);
  all.slowest = std::min(all.slowest, by.slowest);
  all.fastest = std::max(all.fastest, by.fastest);
}

std::optional<material::Excitation> excitation_of(const std::vector<fit::Run>& runs,
                                                  const std::vector<mpm::Scene>& scenes,
                                                  const std::string& body, bool flows,
                                                  Arena& arena) {
  std::optional<material::Excitation> all;
  for (std::size_t r = 0; r < runs.size(); ++r) {
    for (const fit::Capture& capture : runs[r].captures) {
      if (capture.used_count == 0 || capture.clouds || capture.input.body != body) continue;
      const mpm::Body& of = scenes[r].bodies[fit::body_index(scenes[r], body)];
      double volume = 0.0;
      for (const double part : of.volumes) volume += part;
      const fit::InteriorTracks tracks = fit::interior_tracks(capture, volume);
      if (tracks.frames() < 2) continue;
      Points places = of.rest;
      std::vector<double> volumes = of.volumes;
      if (double(places.size()) > kPlaces) {
        capture::thin(places, volumes, std::cbrt(volume / kPlaces));
      }
      const auto one = fit::excitation(tracks, places, flows, arena);
      if (!one) continue;
      if (!all) {
        all = one;
        continue;
      }
      widen(*all, *one);
    }
  }
  return all;
}

void add_likes(const Job& fitted, const std::vector<std::string>& bodies,
               const std::vector<fit::Run>& runs, const std::vector<mpm::Scene>& scenes,
               int threads, Json& fit) {
  Arena arena(threads);
  for (const std::string& name : bodies) {
    const material::Material& material = body_named(fitted.scene, name).material;
    if (!material::is_isotropic(material.law)) continue;
    try {
      const auto over = excitation_of(runs, scenes, name, !material.traits().elastic(), arena);
      Json like = like_json(material, over.value_or(material::Excitation{}));
      std::string sentence = like.at("sentence").get<std::string>();
      if (!over) {
        sentence +=
            " What the recording excites is not known, as it has no tracks all through the body: "
            "these are usual strains and rates.";
      }
      fit["statements"].push_back(fmt::format("{}: {}", name, sentence));
      fit["like"][name] = std::move(like);
    } catch (const Error& error) {
      if (error.kind() == ErrorKind::kCancelled) throw;
      fit["statements"].push_back(
          fmt::format("{}: what it is like could not be found: {}", name, error.what()));
    }
  }
}

Json likes_of_file(const std::filesystem::path& file, const material::Excitation& over) {
  Json likes = Json::object();
  for (const NamedMaterial& one : materials_of_file(file)) {
    if (!material::is_isotropic(one.material.law)) continue;
    likes[one.name] = like_json(one.material, over);
  }
  if (likes.empty()) {
    throw_input(file.generic_string() +
                ": no body is of the law neural_isotropic or latent, of which alone it can be said "
                "what they "
                "are like.");
  }
  return likes;
}

}  // namespace matterfit::job
