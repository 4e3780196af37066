// SPDX-License-Identifier: GPL-3.0-or-later
#include "fit/model/quantity_access.hpp"

#include <numeric>

#include "base/error.hpp"
#include "fit/data/follow.hpp"
#include "material/neural/isotropic_weights.hpp"
#include "material/neural/latent.hpp"
#include "material/neural/published_material.hpp"
#include "mpm/contact_law.hpp"
#include "mpm/default_stiffness.hpp"

namespace matterfit::fit {
namespace {

using material::Material;
using material::MaterialGradient;
using material::MaxwellBranch;

const mpm::Body& body_of(const mpm::Scene& scene, const Address& address) {
  return scene.bodies[body_index(scene, address.owner)];
}
mpm::Body& body_of(mpm::Scene& scene, const Address& address) {
  return scene.bodies[body_index(scene, address.owner)];
}
const mpm::BodyGradient& body_of(const mpm::Gradient& gradient, const mpm::Scene& scene,
                                 const Address& address) {
  return gradient.bodies[body_index(scene, address.owner)];
}
std::size_t component_of(const Address& address) {
  return static_cast<std::size_t>(address.component.value_or(0));
}

/// An entry of a list that may be shorter, or empty: 0 beyond its end.
double entry(const std::vector<double>& list, std::size_t index) {
  return index < list.size() ? list[index] : 0.0;
}

Components components(const Vec3d& vector) { return {vector.x(), vector.y(), vector.z()}; }
Vec3d vector(const Components& values) { return {values[0], values[1], values[2]}; }

/// Derivatives by every collider of that name, as all of them are written.
template <class Slope>
auto sum_over_colliders(const Slope& slope) {
  return [slope](const mpm::Gradient& gradient, const mpm::Scene& scene, const Address& at) {
    double sum = 0.0;
    for (std::size_t c = 0; c < scene.colliders.size(); ++c) {
      if (scene.colliders[c]->name() == at.owner) sum += slope(gradient.colliders[c]);
    }
    return sum;
  };
}

const shape::Collider& collider_of(const mpm::Scene& scene, const Address& address) {
  for (const shape::ColliderPtr& collider : scene.colliders) {
    if (collider->name() == address.owner) return *collider;
  }
  throw_input("there is no collider '" + address.owner + "' in the scene.");
}

template <class Change>
void change_colliders(mpm::Scene& scene, const Address& address, const Change& change) {
  for (shape::ColliderPtr& collider : scene.colliders) {
    if (collider->name() == address.owner) collider = change(collider);
  }
}

CameraPose pose_of(const Viewing& viewing, const Address& address) {
  return address.index < viewing.poses.size() ? viewing.poses[address.index] : CameraPose{};
}
CameraPose& pose_in(Viewing& viewing, const Address& address) {
  if (viewing.poses.size() <= address.index) viewing.poses.resize(address.index + 1);
  return viewing.poses[address.index];
}

template <Vec3d CameraPose::*kMember>
Access pose_access() {
  Access access;
  access.look = [](const Viewing& viewing, const Address& at) {
    return (pose_of(viewing, at).*kMember)[at.component.value_or(0)];
  };
  access.set_view = [](double value, const Address& at, Viewing& viewing) {
    (pose_in(viewing, at).*kMember)[at.component.value_or(0)] = value;
  };
  return access;
}

}  // namespace

Access material_access(double Material::*member, double MaterialGradient::*slope) {
  Access access;
  access.read = [member](const mpm::Scene& scene, const Address& at) {
    return Components{body_of(scene, at).material.*member};
  };
  access.write = [member](const Components& values, const Address& at, mpm::Scene& scene) {
    body_of(scene, at).material.*member = values[0];
  };
  access.slope = [slope](const mpm::Gradient& gradient, const mpm::Scene& scene,
                         const Address& at) {
    return body_of(gradient, scene, at).material.*slope;
  };
  return access;
}

Access maxwell_access(double MaxwellBranch::*member) {
  Access access;
  access.read = [member](const mpm::Scene& scene, const Address& at) {
    return Components{body_of(scene, at).material.maxwell[at.index].*member};
  };
  access.write = [member](const Components& values, const Address& at, mpm::Scene& scene) {
    body_of(scene, at).material.maxwell[at.index].*member = values[0];
  };
  access.slope = [member](const mpm::Gradient& gradient, const mpm::Scene& scene,
                          const Address& at) {
    return body_of(gradient, scene, at).material.maxwell[at.index].*member;
  };
  access.obstacle = [](const Address& at, const Bearer& bearer) -> std::string {
    const std::size_t branches = bearer.material->maxwell.size();
    if (at.index < branches) return {};
    return "the material has " + std::to_string(branches) +
           " Maxwell branches; add one to 'maxwell' for the fit to start from.";
  };
  return access;
}

Access weight_move_access() {
  Access access;
  access.read = [](const mpm::Scene& scene, const Address& at) {
    return Components{entry(body_of(scene, at).material.weight_moves, at.index)};
  };
  access.write = [](const Components& values, const Address& at, mpm::Scene& scene) {
    std::vector<double>& moves = body_of(scene, at).material.weight_moves;
    if (moves.empty()) moves.resize(material::kIsotropicElastic, 0.0);
    moves.at(at.index) = values[0];
  };
  access.slope = [](const mpm::Gradient& gradient, const mpm::Scene& scene, const Address& at) {
    const Material& material = body_of(scene, at).material;
    const MaterialGradient& of = body_of(gradient, scene, at).material;
    if (!material.published) return entry(of.weight_moves, at.index);
    const std::vector<float>& along = material.published->directions.at(at.index);
    if (of.published.size() != along.size()) return 0.0;  // were not asked for
    return std::inner_product(along.begin(), along.end(), of.published.begin(), 0.0);
  };
  access.obstacle = [](const Address& at, const Bearer& bearer) -> std::string {
    const material::LawTraits& law = bearer.material->traits();
    const bool published = law.law == material::Law::kPublished;
    if (law.law != material::Law::kNeuralIsotropic && !published) {
      return "the law " + std::string(law.name) + " has no weights.";
    }
    const std::size_t moves = bearer.material->weight_moves.size();
    if (at.index < moves) return {};
    if (published) return "the weights of the law neural are fitted together: give fit.weights.";
    return "the material has " + std::to_string(moves) + " 'weight_moves'; give it " +
           std::to_string(material::kIsotropicElastic) + " zeros for the fit to start from.";
  };
  return access;
}

Access latent_access() {
  Access access;
  access.read = [](const mpm::Scene& scene, const Address& at) {
    return Components{entry(body_of(scene, at).material.latent, at.index)};
  };
  access.write = [](const Components& values, const Address& at, mpm::Scene& scene) {
    Material& material = body_of(scene, at).material;
    material.latent.at(at.index) = values[0];
    material::decode_latent(material);
  };
  access.slope = [](const mpm::Gradient& gradient, const mpm::Scene& scene, const Address& at) {
    return entry(body_of(gradient, scene, at).material.latent, at.index);
  };
  access.obstacle = [](const Address& at, const Bearer& bearer) -> std::string {
    const material::LawTraits& law = bearer.material->traits();
    if (law.law != material::Law::kLatent) {
      return "the law " + std::string(law.name) + " has no code; the law latent has one.";
    }
    const std::size_t numbers = bearer.material->latent.size();
    if (at.index < numbers) return {};
    return "a code has " + std::to_string(numbers) + " numbers, latent[0] the first.";
  };
  return access;
}

Access correction_access() {
  Access access;
  access.read = [](const mpm::Scene& scene, const Address& at) {
    return Components{entry(body_of(scene, at).material.correction, at.index)};
  };
  access.write = [](const Components& values, const Address& at, mpm::Scene& scene) {
    std::vector<double>& numbers = body_of(scene, at).material.correction;
    if (numbers.empty()) numbers.resize(material::kCorrectionSize, 0.0);
    numbers.at(at.index) = values[0];
  };
  access.slope = [](const mpm::Gradient& gradient, const mpm::Scene& scene, const Address& at) {
    return entry(body_of(gradient, scene, at).material.correction, at.index);
  };
  access.obstacle = [](const Address& at, const Bearer&) -> std::string {
    if (at.index < material::kCorrectionSize) return {};
    return "a correction has " + std::to_string(material::kCorrectionSize) +
           " numbers, correction[0] the first.";
  };
  return access;
}

Access density_access() {
  Access access;
  access.read = [](const mpm::Scene& scene, const Address& at) {
    return Components{body_of(scene, at).density};
  };
  access.write = [](const Components& values, const Address& at, mpm::Scene& scene) {
    body_of(scene, at).density = values[0];
  };
  access.slope = [](const mpm::Gradient& gradient, const mpm::Scene& scene, const Address& at) {
    return body_of(gradient, scene, at).density;
  };
  return access;
}

Access motion_access(Vec3d mpm::Body::*member, Vec3d mpm::BodyGradient::*slope) {
  Access access;
  access.read = [member](const mpm::Scene& scene, const Address& at) {
    return components(body_of(scene, at).*member);
  };
  access.write = [member](const Components& values, const Address& at, mpm::Scene& scene) {
    body_of(scene, at).*member = vector(values);
  };
  access.slope = [slope](const mpm::Gradient& gradient, const mpm::Scene& scene,
                         const Address& at) {
    return (body_of(gradient, scene, at).*slope)[static_cast<int>(component_of(at))];
  };
  return access;
}

// Points that are looked at are bound anew to a body that is placed anew, which the adjoint does
// not see: neither has a slope.
Access position_access() {
  Access access;
  access.placed = [](const Vec3d& origin) { return components(origin); };
  access.place = [](const Components& values, const Vec3d& origin, mpm::Body& body) {
    place(body, origin, vector(values) - origin, Quatd::Identity());
  };
  return access;
}

Access rotation_access() {
  Access access;
  access.placed = [](const Vec3d&) { return Components{}; };
  access.place = [](const Components& values, const Vec3d& origin, mpm::Body& body) {
    const Vec3d turn = vector(values);
    const double angle = turn.norm();
    if (!(angle > 0.0)) return;
    place(body, origin, Vec3d::Zero(), Quatd(Eigen::AngleAxisd(angle, turn / angle)));
  };
  return access;
}

Access gravity_access() {
  Access access;
  access.read = [](const mpm::Scene& scene, const Address&) {
    return components(scene.gravity.values.front());
  };
  access.write = [](const Components& values, const Address&, mpm::Scene& scene) {
    scene.gravity.values.front() = vector(values);
  };
  access.slope = [](const mpm::Gradient& gradient, const mpm::Scene&, const Address& at) {
    return gradient.gravity[static_cast<int>(component_of(at))];
  };
  return access;
}

Access friction_access() {
  Access access;
  access.read = [](const mpm::Scene& scene, const Address& at) {
    return Components{collider_of(scene, at).contact().mu};
  };
  access.write = [](const Components& values, const Address& at, mpm::Scene& scene) {
    change_colliders(scene, at, [&](const shape::ColliderPtr& collider) {
      shape::Contact contact = collider->contact();
      contact.mu = values[0];
      return mpm::with_contact(collider, contact);
    });
  };
  access.slope = sum_over_colliders([](const mpm::ColliderGradient& of) { return of.mu; });
  access.obstacle = [](const Address&, const Bearer& bearer) -> std::string {
    if (bearer.contact->kind == shape::ContactKind::kFriction) return {};
    return "the collider's contact is not of the kind 'friction', so mu has no effect.";
  };
  return access;
}

Access contact_stiffness_access() {
  Access access;
  // The stiffness that the solver takes where the scene has none.
  access.read = [](const mpm::Scene& scene, const Address& at) {
    const shape::Contact& contact = collider_of(scene, at).contact();
    return Components{mpm::resolve_contact(contact, scene.bodies.front(), scene.dx).stiffness};
  };
  access.write = [](const Components& values, const Address& at, mpm::Scene& scene) {
    change_colliders(scene, at, [&](const shape::ColliderPtr& collider) {
      shape::Contact contact = collider->contact();
      contact.stiffness = values[0];
      return mpm::with_contact(collider, contact);
    });
  };
  access.slope = sum_over_colliders([](const mpm::ColliderGradient& of) { return of.stiffness; });
  return access;
}

Access height_access() {
  Access access;
  access.read = [](const mpm::Scene& scene, const Address& at) {
    return Components{ground_height(collider_of(scene, at)).value_or(0.0)};
  };
  access.write = [](const Components& values, const Address& at, mpm::Scene& scene) {
    change_colliders(scene, at, [&](const shape::ColliderPtr& collider) {
      return shape::make_plane(collider->name(), collider->contact(), Vec3d(0, 0, values[0]),
                               Vec3d::UnitZ());
    });
  };
  access.slope =
      sum_over_colliders([](const mpm::ColliderGradient& of) { return of.translation.z(); });
  access.obstacle = [](const Address&, const Bearer& bearer) -> std::string {
    return bearer.has_height ? "" : "only the shape 'ground' has a height.";
  };
  return access;
}

Access start_frame_access() {
  Access access;
  access.look = [](const Viewing& viewing, const Address& /*at*/) { return viewing.start_frame; };
  access.set_view = [](double value, const Address& /*at*/, Viewing& viewing) {
    viewing.start_frame = value;
  };
  return access;
}

Access camera_shift_access() { return pose_access<&CameraPose::shift>(); }
Access camera_turn_access() { return pose_access<&CameraPose::turn>(); }

Access camera_focal_access() {
  Access access;
  access.look = [](const Viewing& viewing, const Address& at) {
    return pose_of(viewing, at).focal;
  };
  access.set_view = [](double value, const Address& at, Viewing& viewing) {
    pose_in(viewing, at).focal = value;
  };
  return access;
}

}  // namespace matterfit::fit
