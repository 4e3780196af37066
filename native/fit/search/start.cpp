// SPDX-License-Identifier: GPL-3.0-or-later
#include "fit/search/start.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <optional>
#include <utility>

#include "base/error.hpp"
#include "fit/data/follow.hpp"
#include "fit/data/initial_motion.hpp"
#include "fit/data/metrics.hpp"
#include "mpm/initial_velocity.hpp"

namespace matterfit::fit {
namespace {

constexpr std::size_t kFewestStartFrames = 3;
constexpr std::size_t kMostStartFrames = 12;
/// How much more than noise leaves over, or than the fewest frames did, a flight may leave over.
constexpr double kStillBallistic = 2.0;
/// A motion from the fewest frames may be off by this part of the body's size too.
constexpr double kRigid = 0.005;
constexpr double kHalfDecade = 3.1622776601683795;
constexpr double kAngleStep = 8.0;  // [degrees]
/// Steps that a scan takes first: between a body that bounces too early and one that is right lie
/// worse ones. What is softer is quicker to simulate.
const std::vector<int> kFirstSteps = {-4, -3, -2, -1, 1, 2};
/// Between half decades there may be a valley of a body's vibrations, which clouds show as such.
constexpr int kFineParts = 4;
const std::vector<int> kFineSteps{-3, -2, -1, 1, 2, 3};

/// The mean of the points of one frame that the fit may see; NaN without any.
Vec3d mean_seen(const Capture& capture, std::size_t frame) {
  Vec3d sum = Vec3d::Zero();
  double count = 0.0;
  for (std::size_t i = 0; i < capture.input.tracks.points; ++i) {
    if (!capture.input.tracks.is_visible(frame, i) || capture.held_out(frame, i)) continue;
    sum += capture.input.tracks.position(frame, i);
    count += 1.0;
  }
  return sum / count;
}

struct FirstFrames {
  InitialMotion motion;
  bool flight = true;  ///< false: that of two frames, as no flight explains a third
};

/// What noise alone leaves over of a flight [m]: root mean square distance over `frames` frames, of
/// which the first says where the points are at rest unless that is given.
double left_by_noise(const Capture& capture, std::size_t frames) {
  double sigma = 0.0;
  for (const double s : capture.sigma) sigma += s / double(capture.sigma.size());
  const double first = capture.places_given ? 1.0 : 2.0 * (1.0 - 1.0 / double(frames));
  return sigma * std::sqrt(3.0 * first);
}

std::optional<FirstFrames> motion_of(const Capture& capture, const mpm::Body& body,
                                     const Vec3d& gravity) {
  const Vec3d centre = mpm::center_of_volume(body);
  const capture::Tracks& tracks = capture.input.tracks;
  const Vec3d unseen = Vec3d::Constant(std::numeric_limits<double>::quiet_NaN());
  Points rest = capture.input.rest;
  // Nothing of a cloud but its mean goes on from frame to frame.
  if (capture.clouds) rest = {centre};
  for (std::size_t i = 0; i < tracks.points; ++i) {
    if (!capture.clouds && capture.input.held_out_points[i] != 0) rest[i] = unseen;
  }
  std::vector<double> times;
  std::vector<Vec3d> positions;
  std::optional<FirstFrames> best;
  std::optional<double> shortest;  // left over of the fewest frames that tell
  const double rigid = kRigid * body_size(body.rest);
  for (std::size_t t = 0; t < tracks.frames() && times.size() < kMostStartFrames; ++t) {
    if (tracks.times[t] < -1e-9 || capture.input.held_out_frames[t] != 0) continue;
    times.push_back(tracks.times[t]);
    if (capture.clouds) {
      positions.push_back(mean_seen(capture, t));
    } else {
      for (std::size_t i = 0; i < tracks.points; ++i) {
        const bool seen = tracks.is_visible(t, i) && rest[i].allFinite();
        positions.push_back(seen ? tracks.position(t, i) : unseen);
      }
    }
    if (times.size() < 2) continue;
    try {
      const auto motion = initial_motion(rest, centre, times, positions, gravity);
      if (times.size() >= kFewestStartFrames) {
        const double noise = left_by_noise(capture, times.size());
        const double limit = shortest ? kStillBallistic * std::max(noise, *shortest)
                                      : std::max(kStillBallistic * noise, rigid);
        if (motion.residual > limit) {
          if (best && !shortest) best->flight = false;
          break;
        }
        if (!shortest) shortest = motion.residual;
      }
      best = {motion, true};
    } catch (const Error&) {
      // Too few points are seen in these frames; later ones may show them.
    }
  }
  return best;
}

/// One way to go from a set of values: a parameter alone or, with `poisson` (that parameter's
/// number; `number` is E's), the bulk modulus at a fixed shear modulus.
struct Direction {
  std::size_t number = 0;
  std::optional<std::size_t> poisson;
  int parts = 1;  ///< of half a decade (of a step of an angle)
};

bool inside(const Parameter& parameter, double value) {
  return value >= parameter.low && value <= parameter.high;
}

/// The values `step` steps along; nothing where that is out of bounds.
std::optional<std::vector<double>> stepped(const Parameters& parameters, const Direction& direction,
                                           std::vector<double> values, int step) {
  const auto& all = parameters.parameters();
  double& value = values[direction.number];
  const double steps = double(step) / double(direction.parts);
  const double factor = std::pow(kHalfDecade, steps);
  if (direction.poisson) {
    double& nu = values[*direction.poisson];
    const double shear = value / (2.0 * (1.0 + nu));
    const double bulk = factor * value / (3.0 * (1.0 - 2.0 * nu));
    value = 9.0 * bulk * shear / (3.0 * bulk + shear);
    nu = (3.0 * bulk - 2.0 * shear) / (2.0 * (3.0 * bulk + shear));
    if (!inside(all[*direction.poisson], nu)) return std::nullopt;
  } else if (all[direction.number].coordinate == Coordinate::kLinear) {
    value += kAngleStep * steps;
  } else {
    value *= factor;
  }
  if (!inside(all[direction.number], value)) return std::nullopt;
  return values;
}

/// Along one direction; true if other values than the present ones are the best.
bool scan(const Parameters& parameters, const Direction& direction, const std::vector<int>& first,
          const Costs& costs, int farthest, std::vector<double>& values, double& cost) {
  std::map<int, double> known{{0, cost}};
  const auto try_steps = [&](const std::vector<int>& steps) {
    std::vector<int> tried;
    std::vector<std::vector<double>> points;
    for (const int step : steps) {
      if (known.count(step) > 0) continue;
      auto point = stepped(parameters, direction, values, step);
      if (!point) continue;
      tried.push_back(step);
      points.push_back(std::move(*point));
    }
    if (points.empty()) return false;
    const std::vector<double> found = costs(points);
    for (std::size_t k = 0; k < tried.size(); ++k) known[tried[k]] = found[k];
    return true;
  };
  const auto best = [&] {
    return std::min_element(known.begin(), known.end(),
                            [](const auto& a, const auto& b) { return a.second < b.second; });
  };
  (void)try_steps(first);
  for (;;) {
    // Where nothing could be simulated so far, either way may lead out of that.
    const bool nowhere = !std::isfinite(best()->second);
    const int low = known.begin()->first;
    const int high = known.rbegin()->first;
    std::vector<int> next;
    const auto beyond = [&](int end, int way) {
      for (int step = 1; step <= 2 && std::abs(end + step * way) <= farthest; ++step) {
        next.push_back(end + step * way);
      }
    };
    if (nowhere || best()->first == low) beyond(low, -1);
    if (nowhere || best()->first == high) beyond(high, 1);
    if (!try_steps(next)) break;
  }
  const bool moved = best()->first != 0 && best()->second < cost;
  if (moved) {
    cost = best()->second;
    values = *stepped(parameters, direction, values, best()->first);
  }
  return moved;
}

/// Poisson's ratio of the same body, if it too is fitted.
std::optional<std::size_t> poisson_beside(const Parameters& parameters, std::size_t number) {
  const Address& own = parameters.path(number);
  const Quantity& poisson = row_named(Owner::kBody, "material.nu");
  for (std::size_t i = 0; i < parameters.size(); ++i) {
    const Address& path = parameters.path(i);
    if (path.quantity == &poisson && path.owner == own.owner && path.capture == own.capture) {
      return i;
    }
  }
  return std::nullopt;
}

}  // namespace

MotionStart with_initial_motion(const std::vector<Run>& runs, const std::vector<mpm::Scene>& scenes,
                                const Parameters& parameters, std::span<const double> values) {
  const Quantity& velocity = row_named(Owner::kBody, "velocity");
  const Quantity& spin_row = row_named(Owner::kBody, "spin");
  MotionStart start;
  start.flights.assign(values.begin(), values.end());
  std::vector<std::uint8_t> done(values.size(), 0);
  struct Guess {
    std::string capture;
    std::vector<std::pair<std::size_t, double>> values;
  };
  std::vector<Guess> guesses;
  for (std::size_t r = 0; r < runs.size(); ++r) {
    for (const Capture& capture : runs[r].captures) {
      const mpm::Body& body = scenes[r].bodies[body_index(scenes[r], capture.input.body)];
      if (capture.used_count == 0 || !body.pins.empty() || capture.input.front) continue;
      std::vector<std::size_t> wanted;
      for (std::size_t i = 0; i < values.size(); ++i) {
        const Address& path = parameters.path(i);
        const bool motion = path.quantity == &velocity || path.quantity == &spin_row;
        if (motion && path.owner == body.name && done[i] == 0 && parameters.acts_on(i, r)) {
          wanted.push_back(i);
        }
      }
      if (wanted.empty()) continue;
      const auto first = motion_of(capture, body, scenes[r].gravity.at(0.0));
      if (!first) continue;
      Guess found{capture.input.name, {}};
      for (const std::size_t i : wanted) {
        const Address& path = parameters.path(i);
        const bool spin = path.quantity == &spin_row;
        if (spin && !first->motion.spin_observable) continue;
        const Parameter& parameter = parameters.parameters()[i];
        found.values.emplace_back(
            i, std::clamp((spin ? first->motion.spin : first->motion.velocity)[*path.component],
                          parameter.low, parameter.high));
      }
      if (!first->flight) {
        guesses.push_back(std::move(found));
        continue;
      }
      for (const auto& [i, value] : found.values) {
        start.flights[i] = value;
        done[i] = 1;
      }
    }
  }
  start.guesses = start.flights;
  for (const Guess& guess : guesses) {
    bool moved = false;
    for (const auto& [i, value] : guess.values) {
      if (done[i] != 0) continue;
      done[i] = 1;
      moved = moved || start.guesses[i] != value;
      start.guesses[i] = value;
    }
    if (moved) start.contradicted.push_back(guess.capture);
  }
  return start;
}

Scanned scanned(const Parameters& parameters, std::vector<double> values, double cost,
                const Costs& costs, int farthest, bool finely, std::span<const std::size_t> also) {
  std::vector<Direction> directions;
  const Quantity& youngs = row_named(Owner::kBody, "material.E");
  for (std::size_t i = 0; i < parameters.size(); ++i) {
    const Quantity* quantity = parameters.path(i).quantity;
    if (!quantity->scanned && std::find(also.begin(), also.end(), i) == also.end()) continue;
    directions.push_back({i, std::nullopt});
    if (quantity != &youngs) continue;
    if (const auto poisson = poisson_beside(parameters, i)) directions.push_back({i, poisson});
  }
  std::stable_sort(directions.begin(), directions.end(),
                   [&](const Direction& a, const Direction& b) {
                     return parameters.path(a.number).quantity->row() <
                            parameters.path(b.number).quantity->row();
                   });
  bool moved = false;
  for (const Direction& direction : directions) {
    moved = scan(parameters, direction, kFirstSteps, costs, farthest, values, cost) || moved;
  }
  if (directions.size() > 1 && moved) {
    for (const Direction& direction : directions) {
      (void)scan(parameters, direction, {-1, 1}, costs, farthest, values, cost);
    }
  }
  if (!finely) return {values, cost};
  for (Direction& direction : directions) {
    direction.parts = kFineParts;
    (void)scan(parameters, direction, kFineSteps, costs, kFineParts, values, cost);
  }
  return {values, cost};
}

}  // namespace matterfit::fit
