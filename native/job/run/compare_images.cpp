// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/run/compare_images.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <utility>

#include "bake/overlay.hpp"
#include "base/error.hpp"
#include "fit/model/particle_colours.hpp"
#include "job/run/own_splats.hpp"
#include "job/run/state_file.hpp"

namespace matterfit::job {
namespace {

/// Coverage from which on a pixel is all body, and how well its colour must be known.
constexpr float kAllBody = 0.95F;
constexpr float kWellKnown = 0.5F;

mpm::ObservedFrame observed(const mpm::FrameState& state) {
  mpm::ObservedFrame frame;
  frame.frame = state.frame;
  frame.time = state.time;
  for (const mpm::BodyState& body : state.bodies) {
    mpm::ObservedFrame::Body& of = frame.bodies.emplace_back();
    for (const Vec3f& x : body.positions) of.positions.push_back(x.cast<double>());
    for (const Mat3f& f : body.deformation_gradients) {
      of.deformation_gradients.push_back(f.cast<double>());
    }
  }
  return frame;
}

/// The agreement of the colours that both show and that are known.
fit::ColourAgreement agreement_of_colours(const fit::Coverage& matte,
                                          const std::array<fit::Coverage, 3>& recorded,
                                          const fit::Drawn& drawn) {
  const std::size_t pixels = drawn.mask.size();
  fit::Coverage compared = matte;
  std::array<fit::Coverage, 3> colours = {compared, compared, compared};
  for (std::size_t i = 0; i < pixels; ++i) {
    const bool shown =
        drawn.mask[i] > kAllBody && matte.values[i] > kAllBody && drawn.known[i] > kWellKnown;
    compared.values[i] = shown ? 1.0F : 0.0F;
    for (std::size_t c = 0; c < 3; ++c) {
      colours[c].values[i] = shown ? drawn.colour[c * pixels + i] / drawn.known[i] : 0.0F;
    }
  }
  return fit::colour_agreement(colours, recorded, compared);
}

/// Of an image that is held out in its own size, of others in that which a fit sees.
fit::ColourAgreement agreement_of_colours(const ImageSighting& sighting, const fit::Drawn& drawn) {
  const fit::Sighting& reduced = sighting.reduced;
  if (sighting.planes[0].empty()) {
    return agreement_of_colours(reduced.matte, reduced.colours, drawn);
  }
  const auto whole = [&](std::size_t plane) {
    return fit::reduced(sighting.planes[plane], sighting.camera.width, sighting.camera.height, 1);
  };
  return agreement_of_colours(whole(0), {whole(1), whole(2), whole(3)}, drawn);
}

Json number(double value) { return std::isfinite(value) ? Json(value) : Json(); }

/// The mean of what is finite; null without any.
Json mean(const std::vector<double>& values) {
  double sum = 0.0;
  double count = 0.0;
  for (const double value : values) {
    if (!std::isfinite(value)) continue;
    sum += value;
    count += 1.0;
  }
  return count > 0.0 ? Json(sum / count) : Json();
}

/// Adds the means `psnr_db` and `ssim` of those images that `takes` takes; nothing where none of
/// them has colours. Of images that are not held out those of the first frame are left out, from
/// which the colours are taken.
void add_colours(Json& into, const std::vector<ImageSighting>& sightings,
                 const std::vector<fit::ColourAgreement>& coloured,
                 const std::function<bool(const fit::Sighting&)>& takes) {
  std::vector<double> ratios;
  std::vector<double> similarities;
  for (std::size_t k = 0; k < sightings.size(); ++k) {
    const fit::Sighting& sighting = sightings[k].reduced;
    if (!sighting.has_colours() || !takes(sighting)) continue;
    const bool taught = !(sighting.view.time > 0.0) && !sighting.view.by_splats;
    if (taught && !sighting.held_out) continue;  // colours are from there
    ratios.push_back(coloured[k].psnr_db);
    similarities.push_back(coloured[k].ssim);
  }
  if (ratios.empty()) return;
  into["psnr_db"] = mean(ratios);
  into["ssim"] = mean(similarities);
}

std::string text_of(double frame) {
  return frame == std::round(frame) ? fmt::format("{:.0f}", frame) : fmt::format("{:.2f}", frame);
}

}  // namespace

ImageComparison::ImageComparison(const Job& job, const mpm::Scene& scene,
                                 std::vector<std::string>& notes, const Interrupter& interrupter)
    : job_(job),
      scene_(scene),
      interrupter_(interrupter),
      notes_(notes),
      films_(load_films(job, scene, FilmUse::kCompared, notes, interrupter)) {
  for (ImageSighting& sighting : films_.sightings) {
    fit::View& view = sighting.reduced.view;
    const fit::CameraPose& pose = films_.films[view.film].viewing.poses[view.number];
    view.camera = fit::posed(view.camera, pose);
    sighting.camera = fit::posed(sighting.camera, pose);
  }
}

void ImageComparison::film(const Stage& stage, const fit::Filming& filming) const {
  fit::Filmer::Given given;
  given.views = filming.views;
  given.colours = filming.colours;
  given.own = own_;
  given.see = [&](std::size_t v, const fit::Drawn& drawn) { filming.see(0, v, drawn); };
  fit::Filmer filmer(scene_, std::move(given), stage.arena, stage.target);
  // One more than the last view lies before, for what is between frames.
  const double last = std::ceil(filming.until() * scene_.fps) + 1.0;
  const int end = std::min(scene_.end_frame, scene_.first_frame + static_cast<int>(last) + 1);
  for (int frame = scene_.first_frame; frame < end; ++frame) {
    interrupter_.check();
    filmer.record(observed(read_state(stage.folder / state_path(frame), scene_)));
  }
  filmer.finish();
}

void ImageComparison::settle_sizes(const Stage& stage) {
  films_.settle_sizes([&](const fit::Filming& filming) { film(stage, filming); }, {}, &notes_);
}

void ImageComparison::write_overlay(const Stage& stage, std::size_t k,
                                    const std::vector<float>& mask) {
  const ImageSighting& sighting = films_.sightings[k];
  const fit::View& view = sighting.reduced.view;
  const std::string frame = text_of(sighting.frame);
  const bool whole = frame.find('.') == std::string::npos;
  const std::string file = fmt::format(
      "overlay/{}/camera_{}/{}.png", films_.films[view.film].name, view.number,
      whole ? frame_digits(static_cast<int>(sighting.frame)) : fmt::format("{:0>7}", frame));
  capture::write_png(stage.folder / file,
                     bake::overlay(mask, sighting.matte.covered(), sighting.camera.width,
                                   sighting.camera.height, frame));
  files_.push_back(file);
}

std::vector<fit::Agreement> ImageComparison::agreements(const Stage& stage) {
  fit::Filming filming;
  for (const ImageSighting& sighting : films_.sightings) {
    filming.views.push_back(sighting.whole());
  }
  std::vector<fit::Agreement> result(filming.views.size());
  filming.see = [&](std::size_t, std::size_t v, const fit::Drawn& drawn) {
    result[v] = films_.agreement(v, drawn.mask);
    if (job_.output.overlays) write_overlay(stage, v, drawn.mask);
  };
  film(stage, filming);
  return result;
}

std::vector<fit::ColourAgreement> ImageComparison::colour_agreements(const Stage& stage) {
  const std::vector<ImageSighting>& all = films_.sightings;
  std::vector<fit::ColourAgreement> result(all.size());
  std::vector<fit::Sighting> first;
  fit::Filming filming;
  std::vector<std::size_t> of;
  for (std::size_t k = 0; k < all.size(); ++k) {
    const fit::Sighting& sighting = all[k].reduced;
    if (!sighting.has_colours()) continue;
    const bool tells = !sighting.held_out && !sighting.view.by_splats;
    if (sighting.view.time == 0.0 && tells) first.push_back(sighting);
    filming.views.push_back(all[k].planes[0].empty() ? sighting.view : all[k].whole());
    of.push_back(k);
  }
  const auto by_splats = [&](std::size_t k) { return all[k].reduced.view.by_splats; };
  if (first.empty() && !std::ranges::all_of(of, by_splats)) {
    notes_.emplace_back(
        "captures: no image shows the colours of the body at the scene's first frame, from which "
        "they are taken; they are not compared.");
    return result;
  }
  if (of.empty()) return result;
  const fit::ParticleColours colours =
      fit::learn_colours(scene_, own_, first, stage.arena, stage.target, interrupter_);
  filming.colours = &colours;
  filming.see = [&](std::size_t, std::size_t v, const fit::Drawn& drawn) {
    result[of[v]] = agreement_of_colours(all[of[v]], drawn);
  };
  film(stage, filming);
  return result;
}

Json ImageComparison::run(const std::filesystem::path& folder, const std::shared_ptr<Arena>& arena,
                          SimdTarget target) {
  const Stage stage{folder, arena, target};
  own_ = fit::carried(own_splats(job_), scene_, *arena, &interrupter_);
  films_.mark_splats(own_, scene_);
  settle_sizes(stage);
  const std::vector<fit::Agreement> agreed = agreements(stage);
  const std::vector<fit::ColourAgreement> coloured = colour_agreements(stage);
  const std::vector<ImageSighting>& all = films_.sightings;
  Json cameras = cameras_json(films_, agreed);
  state_apart(cameras, notes_);
  Json list = Json::array();
  for (std::size_t f = 0; f < films_.films.size(); ++f) {
    // Means of colours are of images of one size each: what is held out stands apart.
    const auto summary = [&](bool colours, const std::function<bool(const fit::Sighting&)>& takes) {
      const auto of_film = [&](const fit::Sighting& sighting) {
        return sighting.view.film == f && takes(sighting);
      };
      Json found = agreement_json(all, agreed, of_film);
      if (colours && !found.is_null()) add_colours(found, all, coloured, of_film);
      return found;
    };
    const auto held_out = [](const fit::Sighting& sighting) { return sighting.held_out; };
    const Json held = summary(true, held_out);
    Json one = summary(held.is_null(), [](const fit::Sighting&) { return true; });
    if (one.is_null()) one = {{"images", 0}};
    one["name"] = films_.films[f].name;
    if (!held.is_null()) {
      one["held_out"] = held;
      one["not_held_out"] = summary(true, std::not_fn(held_out));
    }
    one["cameras"] = Json::array();
    for (const Json& camera : cameras) {
      if (camera.at("capture") != films_.films[f].name) continue;
      const std::size_t number = camera.at("camera");
      Json of = summary(false, [&](const fit::Sighting& s) { return s.view.number == number; });
      if (of.is_null()) of = {{"images", 0}};
      of["camera"] = number;
      of["particle_size"] = camera.at("particle_size");
      one["cameras"].push_back(std::move(of));
    }
    one["frames"] = Json::array();
    for (std::size_t k = 0; k < all.size(); ++k) {
      const fit::Sighting& sighting = all[k].reduced;
      if (sighting.view.film != f) continue;
      Json frame = {{"frame", all[k].frame},
                    {"camera", sighting.view.number},
                    {"image", all[k].image},
                    {"iou", number(agreed[k].iou)},
                    {"contour_px", number(agreed[k].contour_px)},
                    {"outside_px", agreed[k].outside},
                    {"missing_px", agreed[k].missing}};
      if (sighting.held_out) frame["held_out"] = true;
      if (sighting.has_colours()) {
        frame["psnr_db"] = number(coloured[k].psnr_db);
        frame["ssim"] = number(coloured[k].ssim);
      }
      one["frames"].push_back(std::move(frame));
    }
    list.push_back(std::move(one));
  }
  return list;
}

}  // namespace matterfit::job
