// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/fit_values.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "job/documents/capture_scene.hpp"
#include "job/documents/fit_path.hpp"
#include "job/documents/images_document.hpp"
#include "material/neural/isotropic_weights.hpp"
#include "material/neural/latent.hpp"

namespace matterfit::job {
namespace {

/// Writes the numbers of one fit.
class Writer {
 public:
  Writer(const fit::Parameters& parameters, std::span<const double> values,
         const std::vector<RunSource>& sources)
      : parameters_(parameters), values_(values), sources_(sources) {}

  /// Into a scene, or overrides of one.
  void put(Json& scene, std::size_t number) const {
    const fit::Address& path = parameters_.path(number);
    if (!is_quaternion(*path.quantity)) {
      set_quantity(scene, path, values_[number]);
      return;
    }
    const std::size_t run = first_run(number);
    mpm::Body body;
    body.name = path.owner;
    body.lattice.axes = body_named(sources_[run].job.scene, path.owner).placement.rotation;
    const Quatd turned = parameters_.placed(values_, run, std::move(body)).lattice.axes;
    set_quantity(scene, path, {turned.w(), turned.x(), turned.y(), turned.z()});
  }

  /// The first run that the number acts on.
  [[nodiscard]] std::size_t first_run(std::size_t number) const {
    std::size_t run = 0;
    while (!parameters_.acts_on(number, run)) ++run;
    return run;
  }

 private:
  const fit::Parameters& parameters_;
  std::span<const double> values_;
  const std::vector<RunSource>& sources_;
};

/// Quantities that are entries of a list of as many numbers.
constexpr std::pair<std::string_view, std::size_t> kLists[] = {
    {"weight_moves", material::kIsotropicElastic},
    {"latent", material::kLatentSize},
    {"correction", material::kCorrectionSize}};

}  // namespace

void add_lists(const fit::Parameters& parameters, Json& document) {
  for (std::size_t k = 0; k < parameters.size(); ++k) {
    const fit::Address& path = parameters.path(k);
    for (const auto& [key, size] : kLists) {
      if (path.quantity->path != fmt::format("material.{}[#]", key)) continue;
      Json& material = (*find_named(document.at("scene"), "bodies", path.owner))["material"];
      const std::string name(key);
      if (!material.contains(name)) material[name] = std::vector<double>(size, 0.0);
    }
  }
}

void write_values(const fit::Parameters& parameters, std::span<const double> values,
                  const std::vector<RunSource>& sources, const Job& job, Json& document) {
  const Writer writer(parameters, values, sources);
  // Those of all scenes first: what a capture's own scene takes over from the document is then
  // fitted already.
  std::vector<std::size_t> order;
  for (const bool own : {false, true}) {
    for (std::size_t i = 0; i < parameters.size(); ++i) {
      if (parameters.path(i).capture.empty() != own) order.push_back(i);
    }
  }
  for (const std::size_t i : order) {
    const fit::Address& path = parameters.path(i);
    if (path.quantity->owner == fit::Owner::kCapture) {
      Json& captures = document.at("captures");
      for (const CaptureDoc& capture : job.captures) {
        if (capture.name != path.owner) continue;
        set_capture_quantity(captures.at(capture.place), path, values[i]);
      }
      for (const ImagesDoc& images : images_of(job)) {
        if (images.name != path.owner) continue;
        set_capture_quantity(captures.at(images.place), path, values[i]);
      }
      continue;
    }
    if (path.capture.empty()) {
      writer.put(document.at("scene"), i);
      continue;
    }
    // Captures of one scene of their own keep one.
    for (const std::size_t c : sources[writer.first_run(i)].group.captures) {
      Json& capture = document.at("captures").at(job.captures[c].place);
      const Json merged = merged_scene(document.at("scene"), capture.at("scene"), "scene");
      Json& overrides = capture.at("scene");
      if (find_quantity(overrides, path) == nullptr) copy_quantity(merged, path, overrides);
      writer.put(overrides, i);
    }
  }
}

}  // namespace matterfit::job
