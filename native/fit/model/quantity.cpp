// SPDX-License-Identifier: GPL-3.0-or-later
#include "fit/model/quantity.hpp"

#include <algorithm>

#include "base/error.hpp"
#include "fit/data/follow.hpp"
#include "mpm/scene_check.hpp"

namespace matterfit::fit {
namespace {

constexpr std::string_view kIndex = "[#]";

/// A step of a path: in quotes where it would be read as something else.
std::string quoted(const std::string& name) {
  if (!name.empty() && name.find_first_of(".[]\"'") == std::string::npos) return name;
  const char* quote = name.find('"') == std::string::npos ? "\"" : "'";
  return quote + name + quote;
}

const shape::Collider* collider_named(const mpm::Scene& scene, const std::string& name) {
  for (const shape::ColliderPtr& collider : scene.colliders) {
    if (collider->name() == name) return collider.get();
  }
  return nullptr;
}

Vec3d origin_of(const Address& address, const Origins& origins) {
  const auto found = origins.find(address.owner);
  return found == origins.end() ? Vec3d(Vec3d::Zero()) : found->second;
}

std::size_t first_component(const Address& address) {
  return static_cast<std::size_t>(address.component.value_or(0));
}

}  // namespace

std::string Address::text() const {
  std::string result = capture.empty() ? "" : "captures." + quoted(capture) + ".";
  const std::string_view list = list_of(quantity->owner);
  if (!list.empty()) result += std::string(list) + "." + quoted(owner) + ".";
  std::string below = quantity->path;
  if (const std::size_t at = below.find(kIndex); at != std::string::npos) {
    below.replace(at, kIndex.size(), "[" + std::to_string(index) + "]");
  }
  result += below;
  if (component) result += "[" + std::to_string(*component) + "]";
  return result;
}

bool Address::same_number(const Address& other) const {
  return quantity == other.quantity && owner == other.owner && index == other.index &&
         component == other.component;
}

std::string_view Quantity::key() const {
  const std::string_view all = path;
  return all.substr(all.find_last_of('.') + 1);  // npos + 1 is 0
}

std::size_t Quantity::row() const { return static_cast<std::size_t>(this - quantities().data()); }

const Quantity& row_named(Owner owner, std::string_view path) {
  for (const Quantity& row : quantities()) {
    if (row.owner == owner && row.path == path) return row;
  }
  throw_compute("there is no quantity '" + std::string(path) + "'.");
}

bool is_among(const Quantity& row, std::span<const Address> addresses, std::string_view owner) {
  return std::ranges::any_of(addresses, [&](const Address& at) {
    return at.quantity == &row && (owner.empty() || at.owner == owner);
  });
}

std::string_view list_of(Owner owner) {
  switch (owner) {
    case Owner::kBody:
      return "bodies";
    case Owner::kCollider:
      return "colliders";
    case Owner::kCapture:
      return "captures";
    case Owner::kEffect:
      return "effects";
    case Owner::kScene:
      return {};
  }
  return {};
}

double usual_start(const Quantity& quantity, const material::Material& material) {
  if (!(quantity.usual.of_modulus > 0.0)) return quantity.usual.value;
  return quantity.usual.of_modulus *
         (material.traits().fluid ? material.bulk_modulus : material.youngs_modulus);
}

std::string obstacle(const Address& address, const Bearer& bearer) {
  const Quantity& row = *address.quantity;
  if (row.access.obstacle != nullptr) return row.access.obstacle(address, bearer);
  if (!row.of_law || bearer.material == nullptr) return {};
  const material::LawTraits& law = bearer.material->traits();
  if (law.uses(row.key())) return {};
  return "the law " + std::string(law.name) + " does not use it.";
}

std::optional<Bearer> bearer(const mpm::Scene& scene, const Address& address) {
  Bearer found;
  switch (address.quantity->owner) {
    case Owner::kBody:
      for (const mpm::Body& body : scene.bodies) {
        if (body.name != address.owner) continue;
        found.material = &body.material;
        return found;
      }
      return std::nullopt;
    case Owner::kCollider: {
      const shape::Collider* collider = collider_named(scene, address.owner);
      if (collider == nullptr) return std::nullopt;
      found.contact = &collider->contact();
      found.has_height = ground_height(*collider).has_value();
      return found;
    }
    case Owner::kScene:
      if (scene.gravity.values.size() != 1) return std::nullopt;
      return found;
    case Owner::kCapture:
    case Owner::kEffect:
      return std::nullopt;
  }
  return std::nullopt;
}

Components read(const mpm::Scene& scene, const Address& address, const Origins& origins) {
  const Access& access = address.quantity->access;
  return access.placed != nullptr ? access.placed(origin_of(address, origins))
                                  : access.read(scene, address);
}

void write(const Components& values, const Address& address, mpm::Scene& scene,
           const Origins& origins) {
  const Access& access = address.quantity->access;
  if (access.place != nullptr) {
    access.place(values, origin_of(address, origins),
                 scene.bodies[body_index(scene, address.owner)]);
  } else {
    access.write(values, address, scene);
  }
}

void write(double value, const Address& address, mpm::Scene& scene, const Origins& origins) {
  Components values{};
  if (address.quantity->is_vector()) values = read(scene, address, origins);
  values[first_component(address)] = value;
  write(values, address, scene, origins);
}

bool has_slope(const Address& address, const mpm::Scene& scene) {
  const Quantity& row = *address.quantity;
  if (!row.access.slope) return false;
  return row.slope_of_updated ||
         std::any_of(scene.bodies.begin(), scene.bodies.end(), mpm::is_total);
}

double slope(const mpm::Gradient& gradient, const mpm::Scene& scene, const Address& address) {
  if (!address.quantity->access.slope) throw_compute(address.text() + " has no derivative.");
  return address.quantity->access.slope(gradient, scene, address);
}

void place(mpm::Body& body, const Vec3d& pivot, const Vec3d& shift, const Quatd& turn) {
  const auto moved = [&](const Vec3d& x) -> Vec3d { return turn * (x - pivot) + pivot + shift; };
  for (Vec3d& x : body.rest) x = moved(x);
  body.lattice.origin = moved(body.lattice.origin);
  body.lattice.axes = turn * body.lattice.axes;
  for (mpm::SkinPlane& plane : body.skin) plane.normal = turn * plane.normal;
}

std::optional<double> ground_height(const shape::Collider& collider) {
  constexpr double kFar = 1e7;  // [m] that nothing but a plane reaches
  if (collider.animated()) return std::nullopt;
  const double height = 0.0 - collider.closest(Vec3d::Zero(), 0.0).distance;
  for (const Vec3d& x : {Vec3d(kFar, kFar, 0.0), Vec3d(-kFar, 0.0, 0.0), Vec3d(0.0, -kFar, 0.0)}) {
    const shape::SurfacePoint surface = collider.closest(x, 0.0);
    if (surface.normal != Vec3d::UnitZ() || 0.0 - surface.distance != height) return std::nullopt;
  }
  return height;
}

}  // namespace matterfit::fit
