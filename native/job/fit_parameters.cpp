// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/fit_parameters.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "base/error.hpp"
#include "fit/data/follow.hpp"
#include "job/documents/capture_scene.hpp"
#include "mpm/contact_law.hpp"
#include "mpm/default_stiffness.hpp"

namespace matterfit::job {
namespace {

using fit::Coordinate;
using material::Material;

struct Kind {
  FitQuantity quantity;
  Coordinate coordinate;
  const char* unit;
  double scale;  ///< natural coordinate: a change that matters
  double low;    ///< default bounds; both 0: a factor either side of the start
  double high;
  double Material::*member = nullptr;
  bool around = false;  ///< default bounds are about the start
};

constexpr double kWide = 1e4;     // factor either side of a start
constexpr double kLargest = 9e8;  // that a document may hold of viscosities and times

const Kind& kind_of(FitQuantity quantity) {
  using Q = FitQuantity;
  constexpr auto kLin = Coordinate::kLinear;
  constexpr auto kLog = Coordinate::kLog;
  static const Kind kinds[] = {
      {Q::kYoungsModulus, kLog, "Pa", 1.0, 1e2, 1e10, &Material::youngs_modulus},
      {Q::kPoissonRatio, Coordinate::kLogit, "", 1.0, 0.01, 0.495, &Material::poisson_ratio},
      {Q::kYieldStress, kLog, "Pa", 1.0, 0.0, 0.0, &Material::yield_stress},
      {Q::kHardening, kLog, "Pa", 1.0, 0.0, 0.0, &Material::hardening},
      {Q::kViscosity, kLog, "Pa s", 1.0, 0.0, 0.0, &Material::viscosity},
      {Q::kExponent, kLog, "", 1.0, 0.1, 4.0, &Material::exponent},
      {Q::kFrictionAngle, kLin, "degrees", 5.0, 5.0, 65.0, &Material::friction_angle},
      {Q::kCohesion, kLog, "Pa", 1.0, 0.0, 0.0, &Material::cohesion},
      {Q::kBulkModulus, kLog, "Pa", 1.0, 0.0, 0.0, &Material::bulk_modulus},
      {Q::kDampingShear, kLog, "Pa s", 1.0, 0.0, 0.0, &Material::damping_shear},
      {Q::kDampingBulk, kLog, "Pa s", 1.0, 0.0, 0.0, &Material::damping_bulk},
      {Q::kMaxwellModulus, kLog, "Pa", 1.0, 0.0, 0.0},
      {Q::kMaxwellTime, kLog, "s", 1.0, 0.0, 0.0},
      {Q::kDensity, kLog, "kg/m³", 1.0, 0.0, 0.0},
      {Q::kVelocity, kLin, "m/s", 0.1, -50.0, 50.0},
      {Q::kSpin, kLin, "rad/s", 1.0, -200.0, 200.0},
      {Q::kPosition, kLin, "m", 0.01, -1.0, 1.0, nullptr, true},
      {Q::kRotation, kLin, "rad", 0.1, -std::numbers::pi, std::numbers::pi},
      {Q::kGravity, kLin, "m/s²", 1.0, -100.0, 100.0},
      {Q::kFriction, kLog, "", 1.0, 1e-3, 3.0},
      {Q::kContactStiffness, kLog, "Pa/m", 1.0, 0.0, 0.0},
      {Q::kHeight, kLin, "m", 0.01, -1.0, 1.0, nullptr, true},
      {Q::kStartFrame, kLin, "frames", 0.2, -2.0, 2.0, nullptr, true},
  };
  return *std::find_if(std::begin(kinds), std::end(kinds),
                       [&](const Kind& kind) { return kind.quantity == quantity; });
}

/// Null where none of `all` has the name.
template <class Doc>
const Doc* named(const std::vector<Doc>& all, const std::string& name) {
  for (const Doc& one : all) {
    if (one.name == name) return &one;
  }
  return nullptr;
}

bool has_owner(const Job& job, const FitPath& path) {
  const SceneDoc& scene = job.scene;
  switch (path.quantity) {
    case FitQuantity::kStartFrame:
      return named(job.captures, path.owner) != nullptr;
    case FitQuantity::kGravity:
      return scene.gravity.values.size() == 1;
    case FitQuantity::kFriction:
    case FitQuantity::kContactStiffness:
    case FitQuantity::kHeight:
      return named(scene.colliders, path.owner) != nullptr;
    default:
      return std::any_of(scene.bodies.begin(), scene.bodies.end(),
                         [&](const BodyDoc& body) { return body.name == path.owner; });
  }
}

/// Why a quantity whose owner the scene has cannot be set there; empty: it can.
std::string obstacle(const SceneDoc& scene, const FitPath& path) {
  switch (path.quantity) {
    case FitQuantity::kFriction:
    case FitQuantity::kContactStiffness:
    case FitQuantity::kHeight:
      return collider_obstacle(scene, path);
    case FitQuantity::kMaxwellModulus:
    case FitQuantity::kMaxwellTime:
      return branch_obstacle(scene, path);
    default:
      break;
  }
  const std::string_view key = path.law_parameter();
  if (key.empty()) return {};
  const material::Law law = body_named(scene, path.owner).material.law;
  if (material::traits(law).uses(key)) return {};
  return "the law " + std::string(material::traits(law).name) + " does not use it.";
}

/// The names of the captures whose own scene it is.
std::string listed(const std::vector<std::string>& captures) {
  std::string text;
  for (const std::string& name : captures) text += (text.empty() ? "'" : ", '") + name + "'";
  return text;
}

Vec3d vector_in(const SceneDoc& scene, const FitPath& path) {
  if (path.quantity == FitQuantity::kGravity) return scene.gravity.values.front();
  const BodyDoc& body = body_named(scene, path.owner);
  if (path.quantity == FitQuantity::kVelocity) return body.velocity;
  if (path.quantity == FitQuantity::kSpin) return body.spin;
  if (path.quantity == FitQuantity::kPosition) return body.placement.position;
  return Vec3d::Zero();
}

/// The stiffness that the solver takes where the document has none.
double default_stiffness(const mpm::Scene& scene, const std::string& name) {
  for (const shape::ColliderPtr& collider : scene.colliders) {
    if (collider->name() != name) continue;
    return mpm::resolve_contact(collider->contact(), scene.bodies.front(), scene.dx).stiffness;
  }
  return 0.0;
}

double scalar_in(const FitScene& scene, const FitPath& path) {
  const SceneDoc& doc = scene.job->scene;
  if (path.component) return vector_in(doc, path)[*path.component];
  switch (path.quantity) {
    case FitQuantity::kStartFrame:
      return named(scene.job->captures, path.owner)->start_frame.value_or(doc.first_frame);
    case FitQuantity::kFriction:
      return named(doc.colliders, path.owner)->contact.mu;
    case FitQuantity::kHeight:
      return named(doc.colliders, path.owner)->height;
    case FitQuantity::kContactStiffness: {
      const double given = named(doc.colliders, path.owner)->contact.stiffness;
      return given > 0.0 ? given : default_stiffness(*scene.scene, path.owner);
    }
    default:
      break;
  }
  const BodyDoc& body = body_named(doc, path.owner);
  switch (path.quantity) {
    case FitQuantity::kDensity:
      return body.density;
    case FitQuantity::kMaxwellModulus:
      return body.material.maxwell[path.branch].modulus;
    case FitQuantity::kMaxwellTime:
      return body.material.maxwell[path.branch].time;
    default:
      return body.material.*kind_of(path.quantity).member;
  }
}

/// Where a logarithm cannot begin, because the document has 0.
double usual_start(const FitPath& path, const Material& material) {
  const double modulus = material.traits().fluid ? material.bulk_modulus : material.youngs_modulus;
  switch (path.quantity) {
    case FitQuantity::kDampingShear:
    case FitQuantity::kDampingBulk:
      return 1e-3 * modulus;
    case FitQuantity::kYieldStress:
      return 0.02 * modulus;
    case FitQuantity::kHardening:
    case FitQuantity::kMaxwellModulus:
      return 0.1 * modulus;
    case FitQuantity::kCohesion:
      return 1e-3 * modulus;
    case FitQuantity::kViscosity:
      return 10.0;
    default:
      return 0.1;
  }
}

void set_scalar(const FitPath& path, double value, mpm::Scene& scene) {
  switch (path.quantity) {
    case FitQuantity::kStartFrame:
      return;
    case FitQuantity::kFriction:
    case FitQuantity::kContactStiffness:
      for (shape::ColliderPtr& collider : scene.colliders) {
        if (collider->name() != path.owner) continue;
        shape::Contact contact = collider->contact();
        (path.quantity == FitQuantity::kFriction ? contact.mu : contact.stiffness) = value;
        collider = mpm::with_contact(collider, contact);
      }
      return;
    case FitQuantity::kHeight:
      for (shape::ColliderPtr& collider : scene.colliders) {
        if (collider->name() != path.owner) continue;
        collider = shape::make_plane(collider->name(), collider->contact(), Vec3d(0, 0, value),
                                     Vec3d::UnitZ());
      }
      return;
    default:
      break;
  }
  mpm::Body& body = scene.bodies[fit::body_index(scene, path.owner)];
  switch (path.quantity) {
    case FitQuantity::kDensity:
      body.density = value;
      return;
    case FitQuantity::kMaxwellModulus:
      body.material.maxwell[path.branch].modulus = value;
      return;
    case FitQuantity::kMaxwellTime:
      body.material.maxwell[path.branch].time = value;
      return;
    default:
      body.material.*kind_of(path.quantity).member = value;
  }
}

std::string number_text(double value) { return fmt::format("{:.6g}", value); }

void set_bounds(const FitParameterDoc& doc, const Kind& kind, fit::Parameter& parameter) {
  if (doc.bounds) {
    parameter.low = (*doc.bounds)[0];
    parameter.high = (*doc.bounds)[1];
    return;
  }
  const double start = parameter.start;
  if (kind.low == 0.0 && kind.high == 0.0) {
    parameter.low = start / kWide;
    parameter.high = start * kWide;
    if (kind.unit == std::string_view("Pa s")) parameter.high = std::min(parameter.high, kLargest);
    return;
  }
  parameter.low = kind.low + (kind.around ? start : 0.0);
  parameter.high = kind.high + (kind.around ? start : 0.0);
  // A start of the document's own may lie beyond: half way to what the coordinate allows.
  if (start >= parameter.high) {
    parameter.high = kind.coordinate == Coordinate::kLogit ? 0.5 - 0.1 * (0.5 - start)
                                                           : start + 0.5 * std::abs(start);
  }
  if (start <= parameter.low) {
    parameter.low =
        kind.coordinate == Coordinate::kLinear ? start - 0.5 * std::abs(start) : 0.1 * start;
  }
}

}  // namespace

FitParameters::FitParameters(const std::vector<FitParameterDoc>& docs,
                             const std::vector<FitScene>& scenes)
    : scenes_(scenes) {
  for (const FitParameterDoc& doc : docs) {
    const std::size_t components = doc.path.is_vector() && !doc.path.component ? 3 : 1;
    for (std::size_t c = 0; c < components; ++c) add(doc, c, scenes);
  }
  settle_overlaps();
}

void FitParameters::settle_overlaps() {
  const auto same = [](const FitPath& a, const FitPath& b) {
    return a.quantity == b.quantity && a.owner == b.owner && a.branch == b.branch &&
           a.component == b.component;
  };
  for (std::size_t i = 0; i < numbers_.size(); ++i) {
    for (std::size_t k = 0; k < i; ++k) {
      Number& later = numbers_[i];
      Number& earlier = numbers_[k];
      if (!same(earlier.path, later.path)) continue;
      for (std::size_t s = 0; s < scenes_.size(); ++s) {
        if (earlier.scenes[s] == 0 || later.scenes[s] == 0) continue;
        if (!earlier.path.capture.empty() && !later.path.capture.empty()) {
          throw_input(later.where + ": '" + later.path.text() + "' is there already, as '" +
                      earlier.path.text() + "': the captures " + listed(scenes_[s].captures) +
                      " share one scene. Keep one of them, or give the captures different scenes.");
        }
        // A capture's own number comes before that of all scenes.
        (later.path.capture.empty() ? later : earlier).scenes[s] = 0;
      }
    }
  }
}

void FitParameters::add(const FitParameterDoc& doc, std::size_t component,
                        const std::vector<FitScene>& scenes) {
  Number number;
  number.path = doc.path;
  number.where = doc.where;
  const bool given = !doc.start.empty();
  if (doc.path.is_vector() && !doc.path.component) {
    number.path.component = static_cast<int>(component);
  }
  const FitScene* first = nullptr;
  for (const FitScene& scene : scenes) {
    bool acts = has_owner(*scene.job, number.path);
    if (number.path.capture.empty()) {
      // What a scene of its own sets stays as it sets it.
      acts = acts && (!scene.overrides.is_object() ||
                      find_quantity(scene.overrides, number.path) == nullptr);
    } else {
      acts = acts && std::find(scene.captures.begin(), scene.captures.end(), number.path.capture) !=
                         scene.captures.end();
    }
    if (const std::string why = acts ? obstacle(scene.job->scene, number.path) : ""; !why.empty()) {
      throw_input(doc.where + ": '" + doc.path.text() + "' acts on the scene of the capture " +
                  listed(scene.captures) + " too, and there " + why);
    }
    number.scenes.push_back(acts ? 1 : 0);
    if (acts && first == nullptr) first = &scene;
  }
  if (first == nullptr) {
    throw_input(doc.where + ": '" + doc.path.text() +
                "' is set by every capture's own scene, so there is nothing to fit. Name it as "
                "captures.NAME." +
                doc.path.text() + ".");
  }
  const Kind& kind = kind_of(number.path.quantity);
  fit::Parameter parameter;
  parameter.name = number.path.text();
  parameter.unit = kind.unit;
  parameter.coordinate = kind.coordinate;
  parameter.scale = kind.scale;
  if (kind.quantity == FitQuantity::kPosition || kind.quantity == FitQuantity::kHeight) {
    parameter.scale = first->job->scene.particle_separation;
  }
  parameter.start = given ? doc.start[component] : scalar_in(*first, number.path);
  if (!given && kind.coordinate != Coordinate::kLinear && !(parameter.start > 0.0)) {
    parameter.start =
        kind.coordinate == Coordinate::kLogit ? 0.3
        : number.path.is_material()
            ? usual_start(number.path, body_named(first->job->scene, number.path.owner).material)
            : 0.1;
  }
  const bool too_low = kind.coordinate != Coordinate::kLinear && !(parameter.start > 0.0);
  const bool too_high = kind.coordinate == Coordinate::kLogit && !(parameter.start < 0.5);
  if (too_low || too_high) {
    throw_input(doc.where + ": " + parameter.name + " starts at " + number_text(parameter.start) +
                (kind.coordinate == Coordinate::kLogit ? ", expected a start between 0 and 0.5."
                                                       : ", expected a start above 0."));
  }
  set_bounds(doc, kind, parameter);
  if (parameter.start < parameter.low || parameter.start > parameter.high) {
    throw_input(doc.where + ": " + parameter.name + " starts at " + number_text(parameter.start) +
                ", outside its bounds [" + number_text(parameter.low) + ", " +
                number_text(parameter.high) + "]. Give a start inside them.");
  }
  if (doc.prior) {
    const double mean = doc.prior->mean[component];
    const bool outside = (kind.coordinate != Coordinate::kLinear && !(mean > 0.0)) ||
                         (kind.coordinate == Coordinate::kLogit && !(mean < 0.5));
    if (outside) {
      throw_input(doc.where + ".prior.mean is " + number_text(mean) +
                  (kind.coordinate == Coordinate::kLogit ? ", expected a number between 0 and 0.5."
                                                         : ", expected a number above 0."));
    }
    fit::Prior prior;
    prior.mean = fit::to_natural(kind.coordinate, mean);
    prior.sigma = doc.prior->sigma;
    if (kind.coordinate != Coordinate::kLinear) {
      prior.sigma *= mean / fit::derivative(kind.coordinate, prior.mean);
    }
    parameter.prior = prior;
  }
  try {
    fit::check(parameter);
  } catch (const Error& error) {
    throw_input(doc.where + ": " + error.what());
  }
  numbers_.push_back(std::move(number));
  parameters_.push_back(std::move(parameter));
}

std::vector<double> FitParameters::starts() const {
  std::vector<double> values;
  for (const fit::Parameter& parameter : parameters_) values.push_back(parameter.start);
  return values;
}

std::vector<std::string> FitParameters::moved_materials(std::size_t scene) const {
  std::vector<std::string> names;
  for (const Number& number : numbers_) {
    if (number.scenes[scene] == 0 || !number.path.is_material()) continue;
    if (std::find(names.begin(), names.end(), number.path.owner) == names.end()) {
      names.push_back(number.path.owner);
    }
  }
  return names;
}

bool FitParameters::places(std::size_t scene, const std::string& body) const {
  return std::any_of(numbers_.begin(), numbers_.end(), [&](const Number& number) {
    return number.scenes[scene] != 0 && number.path.owner == body &&
           (number.path.quantity == FitQuantity::kPosition ||
            number.path.quantity == FitQuantity::kRotation);
  });
}

Vec3d FitParameters::vector_of(std::span<const double> values, std::size_t scene,
                               const FitPath& path) const {
  Vec3d vector = vector_in(scenes_[scene].job->scene, path);
  for (std::size_t i = 0; i < numbers_.size(); ++i) {
    const FitPath& other = numbers_[i].path;
    if (numbers_[i].scenes[scene] == 0 || other.quantity != path.quantity ||
        other.owner != path.owner) {
      continue;
    }
    vector[*other.component] = values[i];
  }
  return vector;
}

FitParameters::Placing FitParameters::placing(std::span<const double> values, std::size_t scene,
                                              const std::string& body) const {
  Placing placing;
  if (!places(scene, body)) return placing;
  placing.moves = true;
  placing.pivot = body_named(scenes_[scene].job->scene, body).placement.position;
  FitPath path;
  path.owner = body;
  path.quantity = FitQuantity::kPosition;
  placing.shift = vector_of(values, scene, path) - placing.pivot;
  path.quantity = FitQuantity::kRotation;
  const Vec3d turn = vector_of(values, scene, path);
  const double angle = turn.norm();
  if (angle > 0.0) placing.turn = Quatd(Eigen::AngleAxisd(angle, turn / angle));
  return placing;
}

void FitParameters::apply(std::span<const double> values, std::size_t scene,
                          mpm::Scene& into) const {
  for (std::size_t i = 0; i < numbers_.size(); ++i) {
    const Number& number = numbers_[i];
    if (number.scenes[scene] == 0) continue;
    if (!number.path.component) {
      set_scalar(number.path, values[i], into);
    } else if (number.path.quantity == FitQuantity::kGravity) {
      into.gravity.values.front()[*number.path.component] = values[i];
    } else if (number.path.quantity == FitQuantity::kVelocity) {
      into.bodies[fit::body_index(into, number.path.owner)].velocity[*number.path.component] =
          values[i];
    } else if (number.path.quantity == FitQuantity::kSpin) {
      into.bodies[fit::body_index(into, number.path.owner)].spin[*number.path.component] =
          values[i];
    }
  }
  for (mpm::Body& body : into.bodies) {
    const Placing place = placing(values, scene, body.name);
    if (!place.moves) continue;
    for (Vec3d& x : body.rest) x = place(x);
    body.lattice.origin = place(body.lattice.origin);
    body.lattice.axes = place.turn * body.lattice.axes;
  }
}

Vec3d FitParameters::placed(std::span<const double> values, std::size_t scene,
                            const std::string& body, const Vec3d& point) const {
  const Placing place = placing(values, scene, body);
  return place.moves ? place(point) : point;
}

double FitParameters::delay(std::span<const double> values, std::size_t scene,
                            const std::string& capture) const {
  for (std::size_t i = 0; i < numbers_.size(); ++i) {
    const Number& number = numbers_[i];
    if (number.scenes[scene] == 0 || number.path.quantity != FitQuantity::kStartFrame ||
        number.path.owner != capture) {
      continue;
    }
    return (values[i] - scalar_in(scenes_[scene], number.path)) / scenes_[scene].job->scene.fps;
  }
  return 0.0;
}

void FitParameters::write(std::span<const double> values, const Job& job, Json& document) const {
  const auto put = [&](Json& scene, std::size_t i, std::size_t of) {
    const FitPath& path = numbers_[i].path;
    if (path.quantity != FitQuantity::kRotation) {
      set_quantity(scene, path, values[i]);
      return;
    }
    const Quatd given = body_named(scenes_[of].job->scene, path.owner).placement.rotation;
    const Quatd turned = placing(values, of, path.owner).turn * given;
    set_quantity(scene, path, {turned.w(), turned.x(), turned.y(), turned.z()});
  };
  // Those of all scenes first: what a capture's own scene takes over from the document is then
  // fitted already.
  std::vector<std::size_t> order;
  for (const bool own : {false, true}) {
    for (std::size_t i = 0; i < numbers_.size(); ++i) {
      if (numbers_[i].path.capture.empty() != own) order.push_back(i);
    }
  }
  for (const std::size_t i : order) {
    const Number& number = numbers_[i];
    const auto acting = std::find(number.scenes.begin(), number.scenes.end(), 1);
    const auto scene = static_cast<std::size_t>(acting - number.scenes.begin());
    if (number.path.quantity == FitQuantity::kStartFrame) {
      for (std::size_t c = 0; c < job.captures.size(); ++c) {
        if (job.captures[c].name != number.path.owner) continue;
        document.at("captures").at(c)["start_frame"] = values[i];
      }
      continue;
    }
    if (number.path.capture.empty()) {
      put(document.at("scene"), i, scene);
      continue;
    }
    // Captures of one scene of their own keep one.
    for (std::size_t c = 0; c < job.captures.size(); ++c) {
      const auto& names = scenes_[scene].captures;
      if (std::find(names.begin(), names.end(), job.captures[c].name) == names.end()) continue;
      Json& capture = document.at("captures").at(c);
      const Json merged = merged_scene(document.at("scene"), capture.at("scene"), "scene");
      Json& overrides = capture.at("scene");
      if (find_quantity(overrides, number.path) == nullptr) {
        copy_quantity(merged, number.path, overrides);
      }
      put(overrides, i, scene);
    }
  }
}

}  // namespace matterfit::job
