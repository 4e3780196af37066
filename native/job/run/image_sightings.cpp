// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/run/image_sightings.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <set>
#include <utility>

#include "base/error.hpp"
#include "capture/image_clip.hpp"
#include "fit/data/follow.hpp"
#include "fit/model/particle_sizes.hpp"
#include "job/documents/images_document.hpp"
#include "splat/rasteriser.hpp"

namespace matterfit::job {
namespace {

constexpr double kSlack = 1e-3;  // frames: files give times with a few digits
constexpr double kPixelsASeparation = 2.0;
constexpr int kWidestReduced = 128;
constexpr double kMostOversampled = 8.0;

/// How large a particle separation is in a camera's image [pixels].
double pixels_a_separation(const splat::Camera& camera, const mpm::Scene& scene) {
  Vec3d centre = Vec3d::Zero();
  double count = 0.0;
  for (const mpm::Body& body : scene.bodies) {
    for (const Vec3d& x : body.rest) centre += x;
    count += double(body.rest.size());
  }
  centre /= std::max(1.0, count);
  const double distance = (camera.rotation * centre + camera.translation).norm();
  return camera.fx * 0.5 * scene.dx / std::max(distance, 1e-9);
}

/// How many times larger the pixels are that a fit compares; `pixels` to a separation.
int factor_of(const splat::Camera& camera, double pixels) {
  const int by_separation = static_cast<int>(std::floor(pixels / kPixelsASeparation));
  const int by_width = (camera.width + kWidestReduced - 1) / kWidestReduced;
  const int most = std::min(camera.width, camera.height) / 8;
  return std::clamp(std::max(by_separation, by_width), 1, std::max(1, most));
}

/// How many times finer an image is drawn of which `pixels` are a separation.
int oversample_of(double pixels) {
  return static_cast<int>(
      std::ceil(std::clamp(kPixelsASeparation / pixels, 1.0, kMostOversampled)));
}

/// ImageSighting::blur of an image of whose pixels `pixels` are a separation, reduced by `factor`.
double more_blur(double pixels, int factor) {
  const auto pixel = [](double of_a_separation) {  // that is drawn [separations]
    return 1.0 / (of_a_separation * oversample_of(of_a_separation));
  };
  const double reduced = pixel(pixels / factor);
  const double whole = pixel(pixels);
  return splat::RenderOptions().blur * (reduced * reduced - whole * whole);
}

bool is_held_out(const ImagesDoc& doc, double frame, std::size_t camera) {
  const auto& held = doc.holdout;
  const bool by_camera = std::find(held.cameras.begin(), held.cameras.end(),
                                   static_cast<int>(camera)) != held.cameras.end();
  return by_camera ||
         (held.frames && frame >= (*held.frames)[0] - kSlack && frame < (*held.frames)[1] - kSlack);
}

/// Takes out the images of cameras of which none shows the body, as where a key or a plate missed
/// it: they would say that it is elsewhere. `inside` and `shown`: how many images each camera has
/// within the scene's frames, and of these with the body.
void leave_out_blind(const ImagesDoc& doc, FilmUse use, const std::vector<std::size_t>& inside,
                     const std::vector<std::size_t>& shown, LoadedFilms& into,
                     std::vector<std::string>& statements) {
  const std::size_t film = into.films.size();
  const auto is_blind = [&](std::size_t camera) {
    return inside[camera] > 0 && shown[camera] == 0;
  };
  const auto is_fitted = [&](const ImageSighting& sighting) {
    return sighting.reduced.view.film == film && !sighting.reduced.held_out;
  };
  const bool fits = use != FilmUse::kCompared && std::ranges::any_of(into.sightings, is_fitted);
  std::erase_if(into.sightings, [&](const ImageSighting& sighting) {
    const fit::View& view = sighting.reduced.view;
    return view.film == film && is_blind(view.number);
  });
  if (fits && std::ranges::none_of(into.sightings, is_fitted)) {
    throw_input(
        "no matte shows the body in the scene's frames: all that are fitted are empty. Look at "
        "'key', 'plate' and the mattes' files.");
  }
  for (std::size_t camera = 0; camera < inside.size(); ++camera) {
    if (!is_blind(camera)) continue;
    const bool held_out = std::ranges::count(doc.holdout.cameras, static_cast<int>(camera)) > 0;
    const std::string said = fmt::format(
        "captures.{}: camera {}{} is left out: in none of its images within the scene's frames "
        "does its matte show the body. Look at 'key', 'plate' and the mattes' files.",
        doc.name, camera, held_out ? ", which is held out and judges nothing," : "");
    if (!held_out) into.warnings.push_back(said);
    statements.push_back(said);
  }
}

void add_capture(const ImagesDoc& doc, const mpm::Scene& scene, FilmUse use, LoadedFilms& into,
                 std::vector<std::string>& statements, const Interrupter& interrupter) {
  const double start = doc.start_frame.value_or(scene.first_frame);
  std::size_t outside = 0;
  std::vector<std::size_t> inside;  // images of each camera within the scene's frames
  std::set<double> frames;          // of these
  std::vector<double> separations;  // in the cameras' pixels
  std::vector<int> factors;
  std::vector<std::vector<float>> seen;  // reduced
  std::vector<std::size_t> shown;        // images of each camera that show the body
  const auto begin = [&](const capture::ImageClip& clip) {
    for (std::size_t k = 0; k < clip.cameras.size(); ++k) {
      const splat::Camera& camera = clip.cameras[k];
      separations.push_back(pixels_a_separation(camera, scene));
      factors.push_back(factor_of(camera, separations[k]));
      seen.emplace_back();
      shown.push_back(0);
      inside.push_back(0);
      if (clip.seen[k].empty()) continue;
      seen[k] = fit::reduced(clip.seen[k], camera.width, camera.height, factors[k]).values;
    }
  };
  const auto take = [&](const capture::ImageClip& clip, const capture::Sight& sight) {
    if (factors.empty()) begin(clip);
    double frame = start + clip.times[sight.frame] * scene.fps;
    if (std::abs(frame - std::round(frame)) < kSlack) frame = std::round(frame);
    if (frame < scene.first_frame - kSlack || frame > scene.end_frame - 1 + kSlack) {
      ++outside;
      return;
    }
    ++inside[sight.camera];
    frames.insert(frame);
    const splat::Camera& camera = clip.cameras[sight.camera];
    const int factor = factors[sight.camera];
    const auto small = [&](const std::vector<std::uint8_t>& plane) {
      return fit::reduced(plane, camera.width, camera.height, factor);
    };
    fit::Sighting reduced;
    reduced.held_out = is_held_out(doc, frame, sight.camera);
    reduced.matte = small(sight.matte);
    const std::vector<float>& matte = reduced.matte.values;
    reduced.seen = seen[sight.camera];
    reduced.noise = doc.noise / factor;
    if (doc.colours) {
      reduced.colour_noise = *doc.colours;
      for (std::size_t c = 0; c < 3; ++c) reduced.colours[c] = small(sight.colours[c]);
    }
    fit::View& view = reduced.view;
    view.camera = fit::reduced(camera, factor);
    view.film = into.films.size();
    view.number = sight.camera;
    view.time = std::clamp((frame - scene.first_frame) / scene.fps, 0.0,
                           (scene.end_frame - 1 - scene.first_frame) / scene.fps);
    view.oversample = oversample_of(separations[sight.camera] / factor);
    if (!doc.body.empty()) view.body = fit::body_index(scene, doc.body);
    // More than a pixel that a fit sees, be it thin or translucent.
    const double covered = std::accumulate(matte.begin(), matte.end(), 0.0);
    if (covered > 1.0) ++shown[sight.camera];
    const bool whole = use == FilmUse::kCompared && reduced.held_out && doc.colours;
    ImageSighting& added = into.sightings.emplace_back(
        ImageSighting{std::move(reduced),
                      camera,
                      oversample_of(separations[sight.camera]),
                      more_blur(separations[sight.camera], factor),
                      fit::Silhouette(sight.matte, camera.width, camera.height),
                      frame,
                      sight.image,
                      {}});
    if (!whole) return;
    added.planes[0] = sight.matte;
    for (std::size_t c = 0; c < 3; ++c) added.planes[c + 1] = sight.colours[c];
  };
  capture::ImageClip clip =
      capture::read_image_clip(doc.cameras, doc.options, statements, take, &interrupter);
  const std::size_t cameras = clip.cameras.size();
  for (const int number : doc.holdout.cameras) {
    if (static_cast<std::size_t>(number) < cameras) continue;
    throw_input("there is no camera " + std::to_string(number) + " to hold out; there are " +
                std::to_string(cameras) + ", from 0.");
  }
  leave_out_blind(doc, use, inside, shown, into, statements);
  fit::check_poses(doc.poses, cameras);
  fit::Film film{doc.name, {start, doc.poses}};
  film.viewing.poses.resize(cameras);
  into.seen.push_back(std::move(clip.seen));
  into.films.push_back(std::move(film));
  into.paths.push_back(doc.path);
  if (outside > 0) {
    statements.push_back("captures." + doc.name + ": " + std::to_string(outside) +
                         " images lie outside of the scene's frames.");
  }
  if (outside > 0 && frames.size() == 1 && clip.times.size() > 2) {
    into.warnings.push_back(fmt::format(
        "captures.{}: of its {} times, which go on for {:.4g} s, a single one lies in the scene's "
        "frames. Are they in seconds? 'fps' says how they follow each other.",
        doc.name, clip.times.size(), clip.times.back() - clip.times.front()));
    statements.push_back(into.warnings.back());
  }
  for (std::size_t k = 0; k < inside.size() && outside > 0; ++k) {
    if (inside[k] > 0) continue;
    statements.push_back("captures." + doc.name + ": camera " + std::to_string(k) +
                         " has no image within the scene's frames; it is left out.");
  }
}

/// Those of a film's `refine` for one camera; what the document's own parameters fit is left out.
void add_refined(const ImagesDoc& doc, std::size_t camera, std::vector<fit::ParameterSpec>& specs) {
  const std::pair<const char*, double> rows[] = {{"poses[#].shift", doc.refine->shift},
                                                 {"poses[#].turn", doc.refine->turn},
                                                 {"poses[#].focal", doc.refine->focal}};
  for (const auto& [path, sigma] : rows) {
    fit::ParameterSpec spec;
    spec.where = doc.path + ".refine";
    spec.path.quantity = &fit::row_named(fit::Owner::kCapture, path);
    spec.path.owner = doc.name;
    spec.path.index = camera;
    const bool there = std::any_of(specs.begin(), specs.end(), [&](const fit::ParameterSpec& one) {
      fit::Address whole = one.path;
      whole.component.reset();
      return whole.same_number(spec.path);
    });
    if (there || !(sigma > 0.0)) continue;
    const fit::CameraPose known = camera < doc.poses.size() ? doc.poses[camera] : fit::CameraPose{};
    fit::Viewing viewing;
    viewing.poses.assign(camera + 1, known);
    fit::ParameterSpec::Prior prior;
    prior.sigma = sigma;
    for (int c = 0; c < spec.path.quantity->size; ++c) {
      fit::Address at = spec.path;
      at.component = c;
      prior.mean.push_back(spec.path.quantity->access.look(viewing, at));
    }
    spec.prior = std::move(prior);
    specs.push_back(std::move(spec));
  }
}

}  // namespace

void LoadedFilms::mark_splats(std::span<const fit::OwnSplats> own, const mpm::Scene& scene) {
  for (ImageSighting& sighting : sightings) {
    fit::View& view = sighting.reduced.view;
    view.by_splats = fit::drawn_by_splats(own, scene.bodies.size(), view.body);
    if (!view.by_splats) continue;
    const double factor = std::round(sighting.camera.fx / view.camera.fx);
    view.oversample = static_cast<int>(std::min(factor, kMostOversampled));
    const double finer = double(view.oversample) / factor;
    view.blur = splat::RenderOptions().blur * finer * finer;
    sighting.oversample = 1;
  }
}

void LoadedFilms::settle_sizes(const std::function<void(const fit::Filming&)>& film,
                               const std::vector<std::vector<std::uint8_t>>& moved,
                               std::vector<std::string>* faults) {
  std::vector<fit::Sighting> reduced;
  reduced.reserve(sightings.size());
  for (const ImageSighting& sighting : sightings) reduced.push_back(sighting.reduced);
  fit::settle_sizes(film, paths, moved, reduced, faults);
  for (std::size_t k = 0; k < reduced.size(); ++k) {
    sightings[k].reduced.view.size = reduced[k].view.size;
  }
}

bool LoadedFilms::is_fitted(std::size_t film, std::size_t camera) const {
  return std::any_of(sightings.begin(), sightings.end(), [&](const ImageSighting& sighting) {
    const fit::View& view = sighting.reduced.view;
    return view.film == film && view.number == camera && !sighting.reduced.held_out;
  });
}

fit::View ImageSighting::whole() const {
  fit::View view = reduced.view;
  view.camera = camera;
  view.oversample = oversample;
  view.blur = splat::RenderOptions().blur;
  // The same particles by finer pixels: smaller ones would be seen as dots.
  constexpr double kSmallest = 0.05;
  view.size = std::sqrt(std::max(view.size * view.size + blur, kSmallest * kSmallest));
  return view;
}

fit::Agreement LoadedFilms::agreement(std::size_t sighting, std::vector<float> mask) const {
  const ImageSighting& of = sightings[sighting];
  const fit::View& view = of.reduced.view;
  const std::vector<std::uint8_t>& lens = seen[view.film][view.number];
  for (std::size_t i = 0; i < lens.size(); ++i) {
    if (lens[i] == 0) mask[i] = 0.0F;
  }
  return fit::agreement(mask, of.matte);
}

LoadedFilms load_films(const Job& job, const mpm::Scene& scene, FilmUse use,
                       std::vector<std::string>& statements, const Interrupter& interrupter) {
  LoadedFilms loaded;
  for (const ImagesDoc& doc : images_of(job)) {
    try {
      add_capture(doc, scene, use, loaded, statements, interrupter);
    } catch (const Error& error) {
      throw Error(error.kind(), doc.path + ": " + error.what());
    }
  }
  std::vector<ImageSighting>& all = loaded.sightings;
  std::stable_sort(all.begin(), all.end(), [](const ImageSighting& a, const ImageSighting& b) {
    return a.reduced.view.time < b.reduced.view.time;
  });
  if (use == FilmUse::kFitted && std::all_of(all.begin(), all.end(), [](const ImageSighting& s) {
        return s.reduced.held_out;
      })) {
    throw_input(
        "captures: every image is held out or outside of the scene's frames; nothing is left to "
        "fit to. Shorten a 'holdout', or look at start_frame, fps and scene.frames.");
  }
  return loaded;
}

std::vector<fit::ParameterSpec> with_poses(const Job& job, const LoadedFilms& films,
                                           std::vector<fit::ParameterSpec> specs) {
  const std::vector<ImagesDoc> docs = images_of(job);
  for (const fit::ParameterSpec& spec : specs) {
    if (!spec.path.quantity->is_pose()) continue;
    for (std::size_t f = 0; f < docs.size(); ++f) {
      if (docs[f].name != spec.path.owner) continue;
      const std::string what = spec.where + ": '" + spec.path.text() + "': ";
      const std::size_t cameras = films.films[f].viewing.poses.size();
      if (spec.path.index >= cameras) {
        throw_input(what + "there is no camera " + std::to_string(spec.path.index) + "; '" +
                    docs[f].name + "' has " + std::to_string(cameras) + ", from 0.");
      }
      if (films.is_fitted(f, spec.path.index)) continue;
      throw_input(
          what +
          "no image of this camera is fitted (held out, outside of the scene's frames, or "
          "without the body), so nothing shows how it stands. Leave the parameter out, or shorten "
          "the hold-out.");
    }
  }
  for (std::size_t f = 0; f < docs.size(); ++f) {
    if (!docs[f].refine) continue;
    for (std::size_t k = 0; k < films.films[f].viewing.poses.size(); ++k) {
      if (films.is_fitted(f, k)) add_refined(docs[f], k, specs);
    }
  }
  return specs;
}

Json agreement_json(const std::vector<ImageSighting>& sightings,
                    const std::vector<fit::Agreement>& agreements,
                    const std::function<bool(const fit::Sighting&)>& takes) {
  double iou = 0.0;
  double contour = 0.0;
  int images = 0;
  int empty = 0;
  int contours = 0;
  std::size_t worst = 0;
  for (std::size_t k = 0; k < sightings.size(); ++k) {
    if (!takes(sightings[k].reduced)) continue;
    if (std::isnan(agreements[k].iou)) {
      ++empty;
      continue;
    }
    if (images == 0 || agreements[k].iou < agreements[worst].iou) worst = k;
    ++images;
    iou += agreements[k].iou;
    if (!std::isfinite(agreements[k].contour_px)) continue;
    contour += agreements[k].contour_px;
    ++contours;
  }
  if (images + empty == 0) return {};
  Json result = {{"images", images}};
  if (empty > 0) result["empty"] = empty;
  if (images == 0) return result;
  result["iou"] = iou / images;
  result["contour_px"] = contours > 0 ? Json(contour / contours) : Json();
  result["worst"] = {{"image", sightings[worst].image},
                     {"frame", sightings[worst].frame},
                     {"camera", sightings[worst].reduced.view.number},
                     {"iou", agreements[worst].iou},
                     {"outside_px", agreements[worst].outside},
                     {"missing_px", agreements[worst].missing}};
  return result;
}

Json silhouettes_json(const std::vector<ImageSighting>& sightings,
                      const std::vector<fit::Agreement>& agreements) {
  Json result;
  for (const bool held_out : {false, true}) {
    result[held_out ? "held_out" : "fitted"] = agreement_json(
        sightings, agreements, [&](const fit::Sighting& one) { return one.held_out == held_out; });
  }
  return result;
}

Json cameras_json(const LoadedFilms& films, const std::vector<fit::Agreement>& agreements) {
  Json list = Json::array();
  for (std::size_t f = 0; f < films.films.size(); ++f) {
    for (std::size_t k = 0; k < films.films[f].viewing.poses.size(); ++k) {
      const auto of_camera = [&](const fit::Sighting& one) {
        return one.view.film == f && one.view.number == k;
      };
      Json one = {{"capture", films.films[f].name}, {"camera", k}, {"particle_size", nullptr}};
      for (const ImageSighting& sighting : films.sightings) {
        const fit::View& view = sighting.reduced.view;
        if (of_camera(sighting.reduced) && !view.by_splats) one["particle_size"] = view.size;
      }
      for (const bool held_out : {false, true}) {
        one[held_out ? "held_out" : "fitted"] =
            agreement_json(films.sightings, agreements, [&](const fit::Sighting& sighting) {
              return of_camera(sighting) && sighting.held_out == held_out;
            });
      }
      list.push_back(std::move(one));
    }
  }
  return list;
}

namespace {

/// Says of a camera whose fitted images agree much less than the others of its capture do.
void state_odd_one(const Json& cameras, std::vector<std::string>& statements) {
  constexpr double kMuchLess = 0.75;
  const auto agreement = [](const Json& camera) -> std::optional<double> {
    const Json& part = camera.at("fitted");
    return part.contains("iou") ? std::optional(part.at("iou").get<double>()) : std::nullopt;
  };
  for (const Json& camera : cameras) {
    const std::optional<double> own = agreement(camera);
    std::vector<double> others;
    for (const Json& other : cameras) {
      const bool beside = other.at("capture") == camera.at("capture") && other != camera;
      if (beside && agreement(other)) others.push_back(*agreement(other));
    }
    if (!own || !(*own > 0.0) || others.size() < 2) continue;
    const double least = *std::min_element(others.begin(), others.end());
    if (*own > kMuchLess * least) continue;
    statements.push_back(fmt::format(
        "captures.{}: camera {} agrees much less than the others: IoU {:.2f}, theirs {:.2f} and "
        "more. Does it stand where its file says? With 'refine' a fit finds how it stands.",
        camera.at("capture").get<std::string>(), camera.at("camera").dump(), *own, least));
  }
}

}  // namespace

void state_apart(const Json& cameras, std::vector<std::string>& statements) {
  for (const Json& camera : cameras) {
    bool shown = false;
    bool meets = false;
    for (const char* which : {"fitted", "held_out"}) {
      const Json& part = camera.at(which);
      if (!part.is_object() || !part.contains("iou")) continue;
      shown = true;
      meets = meets || part.at("iou").get<double>() > 0.0;
    }
    if (!shown || meets) continue;
    statements.push_back("captures." + camera.at("capture").get<std::string>() + ": camera " +
                         camera.at("camera").dump() +
                         ": in none of its images does the simulation meet the matte. Are 'up', "
                         "'unit', 'transform' and the body's place right, and is it the body's "
                         "matte ('key', 'plate')?");
  }
  state_odd_one(cameras, statements);
}

}  // namespace matterfit::job
