// SPDX-License-Identifier: GPL-3.0-or-later
#include "fit/numerics/advice.hpp"

#include <array>
#include <string_view>

namespace matterfit::fit {
namespace {

struct Row {
  std::string_view ending;
  std::string_view quantity;
  std::string_view record;
};

// The first row whose ending the path has, at the start of a segment.
constexpr std::array kRows{
    Row{"E", "the stiffness",
        "the body as it is squeezed, bent or hits something, so that it deforms by more than the "
        "noise"},
    Row{"nu", "Poisson's ratio",
        "the body's sides as it is squeezed or pulled: how much it bulges or thins"},
    Row{"bulk_modulus", "the resistance to a change of volume",
        "a harder impact or a load on a body that cannot give way sideways"},
    Row{"yield_stress", "the stress at which it yields",
        "a harder impact or a heavier load that leaves a dent, and the body at rest after it"},
    Row{"hardening", "the hardening",
        "loads of several strengths, each of which leaves a larger dent than the last"},
    Row{"viscosity", "the viscosity", "the body as it flows: spreading, pouring or slowly sagging"},
    Row{"exponent", "the exponent of the flow",
        "flow at speeds that differ by a factor ten or more"},
    Row{"friction_angle", "the friction angle",
        "a column or a heap that collapses, until it lies still"},
    Row{"cohesion", "the cohesion", "a steep face that holds, and one that breaks off"},
    Row{"damping_shear", "the damping", "the body as it rings freely after an impact"},
    Row{"damping_bulk", "the damping of changes of volume",
        "the body as it rings freely after a hard impact, at a higher frame rate"},
    Row{"modulus", "the stiffness of the relaxing part",
        "a fast load and a slow one, or a load that is held and let go"},
    Row{"time", "the time of relaxation",
        "a load that is held, from well before that time has passed until well after it"},
    Row{"velocity", "the initial velocity", "more frames before the body touches anything"},
    Row{"spin", "the initial spin",
        "points on all sides of the body, in more frames before it touches anything"},
    Row{"density", "the density",
        "contact with a body of known mass, or weigh it: free flight does not depend on it"},
    Row{"placement.position", "the starting place", "the body at rest, or its first frames"},
    Row{"placement.rotation", "the starting orientation",
        "points on all sides of the body in the first frames"},
    Row{"gravity", "gravity", "a longer free flight, or a pendulum beside it"},
    Row{"contact.mu", "the friction",
        "the body as it slides along the collider, at an angle or with a sideways throw"},
    Row{"contact.stiffness", "the stiffness of the contact",
        "a hard contact with the collider at a higher frame rate"},
    Row{"start_frame", "the time at which the recording begins",
        "the body as it is let go, at a higher frame rate"},
    Row{"height", "the collider's height", "the body as it rests on the collider"},
};

bool ends_in(std::string_view path, std::string_view ending) {
  if (!path.ends_with(ending)) return false;
  return path.size() == ending.size() || path[path.size() - ending.size() - 1] == '.';
}

}  // namespace

Advice advice(const std::string& path) {
  std::string_view whole = path;
  if (whole.ends_with(']')) whole = whole.substr(0, whole.find_last_of('['));
  for (const Row& row : kRows) {
    if (ends_in(whole, row.ending)) return {std::string(row.quantity), std::string(row.record)};
  }
  return {"it", "a motion that changes with it"};
}

}  // namespace matterfit::fit
