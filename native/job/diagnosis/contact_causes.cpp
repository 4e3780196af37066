// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/diagnosis/contact_causes.hpp"

#include <algorithm>
#include <array>

#include "job/diagnosis/cause_row.hpp"
#include "job/diagnosis/extent.hpp"
#include "job/diagnosis/ground_slope.hpp"
#include "mpm/contact_law.hpp"
#include "mpm/default_stiffness.hpp"
#include "shape/collider.hpp"

namespace matterfit::job {
namespace {

/// Coulomb coefficients at which the search for another kind of contact begins.
constexpr std::array<double, 3> kTriedFrictions = {0.1, 0.3, 1.0};

class ContactCauses {
 public:
  ContactCauses(const Job& job, const mpm::Scene& scene, const std::vector<fit::Address>& fitted)
      : job_(job), scene_(scene), fitted_(fitted), body_(extent_of(scene.bodies.front())) {}

  std::vector<Cause> all() {
    for (std::size_t c = 0; c < job_.scene.colliders.size(); ++c) {
      const ColliderDoc& doc = job_.scene.colliders[c];
      switch (scene_.colliders[c]->contact().kind) {
        case shape::ContactKind::kFriction:
        case shape::ContactKind::kSeparating:
          friction(c, doc);
          break;
        case shape::ContactKind::kGlue:
        case shape::ContactKind::kNoSlip:
          lets_go(c, doc);
          break;
        case shape::ContactKind::kSlip:
          rubs(c, doc);
          break;
      }
      restitution(c, doc);
      if (doc.shape == ColliderDoc::Shape::kGround) tilt(c, doc);
    }
    return std::move(causes_);
  }

 private:
  Cause& add(const char* name, std::string sentence) {
    return add_cause(causes_, name, "contact", std::move(sentence));
  }

  /// A change of one collider's contact by the first number.
  template <class Change>
  static auto changed(std::size_t c, Change change) {
    return [c, change](std::span<const double> v, int, mpm::Scene& scene) {
      if (c >= scene.colliders.size()) return;  // not in this capture's own scene
      shape::Contact moved = scene.colliders[c]->contact();
      change(moved, v[0]);
      scene.colliders[c] = mpm::with_contact(scene.colliders[c], moved);
    };
  }

  static void rub(double mu, std::size_t c, Json& scene) {
    Json& contact = scene.at("colliders").at(c)["contact"];
    contact["kind"] = "friction";
    contact["mu"] = mu;
  }

  void friction(std::size_t c, const ColliderDoc& doc) {
    const fit::Quantity& friction = fit::row_named(fit::Owner::kCollider, "contact.mu");
    if (fit::is_among(friction, fitted_, doc.name)) return;
    const shape::Contact contact = scene_.colliders[c]->contact();
    const bool rubs = contact.kind == shape::ContactKind::kFriction;
    const double mu = rubs ? contact.mu : 0.0;
    Cause& cause =
        add("friction", "The friction coefficient of '" + doc.name + "' differs by {value}.");
    cause.row.numbers = {number("added", "", 0.05, !(mu > 0.0))};
    cause.row.numbers[0].low = -mu;
    if (mu > 0.0) cause.row.tries = {-0.6 * mu, -0.3 * mu, 0.3 * mu};
    cause.apply = changed(c, [](shape::Contact& moved, double v) {
      const double before = moved.kind == shape::ContactKind::kFriction ? moved.mu : 0.0;
      moved.kind = shape::ContactKind::kFriction;
      moved.mu = std::max(0.0, before + v);
    });
    cause.write = [c, mu](std::span<const double> v, int, Json& scene) {
      rub(mu + v[0], c, scene);
    };
  }

  /// The number is 1/(1 + μ): 0 holds for good, 1 is free of friction.
  void lets_go(std::size_t c, const ColliderDoc& doc) {
    const bool glued = scene_.colliders[c]->contact().kind == shape::ContactKind::kGlue;
    Cause& cause = add("contact_kind", "'" + doc.name + "' does not hold what " +
                                           (glued ? "touches it: it lets go and slips"
                                                  : "presses on it: that slips") +
                                           " (share {value}; 1 is free of friction).");
    diagnose::Number slip = number("slip", "", 0.1, true);
    slip.first_step = 0.5;
    slip.high = 1.0;
    cause.row.numbers = {slip};
    cause.row.confused_with = {"friction", "adhesion"};
    for (const double mu : kTriedFrictions) cause.row.tries.push_back(1.0 / (1.0 + mu));
    const auto friction_of = [](double share) { return 1.0 / std::min(share, 1.0) - 1.0; };
    cause.apply = changed(c, [friction_of](shape::Contact& moved, double v) {
      if (!(v > 0.0)) return;
      moved.kind = shape::ContactKind::kFriction;
      moved.mu = friction_of(v);
    });
    cause.write = [c, friction_of](std::span<const double> v, int, Json& scene) {
      if (v[0] > 0.0) rub(friction_of(v[0]), c, scene);
    };
  }

  void rubs(std::size_t c, const ColliderDoc& doc) {
    Cause& cause = add("contact_kind", "'" + doc.name +
                                           "' lets go of what touches it, and rubs with a "
                                           "coefficient of {value}.");
    diagnose::Number mu = number("friction", "", 0.05, true);
    mu.first_step = kTriedFrictions[1];
    cause.row.numbers = {mu};
    cause.row.confused_with = {"friction", "adhesion"};
    cause.row.tries.assign(kTriedFrictions.begin(), kTriedFrictions.end());
    cause.apply = changed(c, [](shape::Contact& moved, double v) {
      if (!(v > 0.0)) return;
      moved.kind = shape::ContactKind::kFriction;
      moved.mu = v;
    });
    cause.write = [c](std::span<const double> v, int, Json& scene) {
      if (v[0] > 0.0) rub(v[0], c, scene);
    };
  }

  void restitution(std::size_t c, const ColliderDoc& doc) {
    const double damping = mpm::contact_damping(scene_.colliders[c]->contact());
    Cause& cause = add("restitution",
                       "Contact with '" + doc.name + "' loses {value} of critical damping more.");
    cause.row.numbers = {number("damping", "", 0.05)};
    cause.row.numbers[0].low = -damping;
    cause.row.confused_with = {"damping_shear", "damping_bulk"};
    cause.apply = changed(c, [](shape::Contact& moved, double v) {
      moved.damping = std::max(0.0, mpm::contact_damping(moved) + v);
    });
    cause.write = [c, damping](std::span<const double> v, int, Json& scene) {
      scene.at("colliders").at(c)["contact"]["damping"] = damping + v[0];
    };
  }

  void tilt(std::size_t c, const ColliderDoc& doc) {
    Cause& cause = add("ground_tilt", "'" + doc.name + "' slopes by {value}.");
    cause.row.numbers = {number("x", "", 0.02), number("y", "", 0.02)};
    cause.row.confused_with = {"gravity_direction", "camera_roll"};
    const Vec3d foot(body_.center.x(), body_.center.y(), doc.height);
    cause.apply = [c, foot](std::span<const double> v, int, mpm::Scene& scene) {
      if (c >= scene.colliders.size()) return;
      scene.colliders[c] = sloped(scene.colliders[c], foot, Vec3d(-v[0], -v[1], 1.0).normalized());
    };
    cause.write = [c, foot](std::span<const double> v, int, Json& scene) {
      write_slope(foot, Vec3d(-v[0], -v[1], 1.0).normalized(), scene.at("colliders").at(c));
    };
  }

  const Job& job_;
  const mpm::Scene& scene_;
  const std::vector<fit::Address>& fitted_;
  Extent body_;
  std::vector<Cause> causes_;
};

}  // namespace

std::vector<Cause> contact_causes(const Job& job, const mpm::Scene& scene,
                                  const std::vector<fit::Address>& fitted) {
  return ContactCauses(job, scene, fitted).all();
}

}  // namespace matterfit::job
