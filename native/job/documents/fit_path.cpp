// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/documents/fit_path.hpp"

#include <algorithm>
#include <array>

#include "base/error.hpp"
#include "job/documents/override.hpp"

namespace matterfit::job {
namespace {

enum class Owner { kBody, kCollider, kScene, kCapture };

struct Entry {
  FitQuantity quantity;
  Owner owner;
  /// Keys below the owner; of a Maxwell branch `maxwell` and the key in it.
  std::string_view group;
  std::string_view key;
  bool vector = false;
};

constexpr std::array<Entry, 23> kEntries = {{
    {FitQuantity::kYoungsModulus, Owner::kBody, "material", "E"},
    {FitQuantity::kPoissonRatio, Owner::kBody, "material", "nu"},
    {FitQuantity::kYieldStress, Owner::kBody, "material", "yield_stress"},
    {FitQuantity::kHardening, Owner::kBody, "material", "hardening"},
    {FitQuantity::kViscosity, Owner::kBody, "material", "viscosity"},
    {FitQuantity::kExponent, Owner::kBody, "material", "exponent"},
    {FitQuantity::kFrictionAngle, Owner::kBody, "material", "friction_angle"},
    {FitQuantity::kCohesion, Owner::kBody, "material", "cohesion"},
    {FitQuantity::kBulkModulus, Owner::kBody, "material", "bulk_modulus"},
    {FitQuantity::kDampingShear, Owner::kBody, "material", "damping_shear"},
    {FitQuantity::kDampingBulk, Owner::kBody, "material", "damping_bulk"},
    {FitQuantity::kMaxwellModulus, Owner::kBody, "maxwell", "modulus"},
    {FitQuantity::kMaxwellTime, Owner::kBody, "maxwell", "time"},
    {FitQuantity::kDensity, Owner::kBody, "", "density"},
    {FitQuantity::kVelocity, Owner::kBody, "", "velocity", true},
    {FitQuantity::kSpin, Owner::kBody, "", "spin", true},
    {FitQuantity::kPosition, Owner::kBody, "placement", "position", true},
    {FitQuantity::kRotation, Owner::kBody, "placement", "rotation", true},
    {FitQuantity::kGravity, Owner::kScene, "", "gravity", true},
    {FitQuantity::kFriction, Owner::kCollider, "contact", "mu"},
    {FitQuantity::kContactStiffness, Owner::kCollider, "contact", "stiffness"},
    {FitQuantity::kHeight, Owner::kCollider, "", "height"},
    {FitQuantity::kStartFrame, Owner::kCapture, "", "start_frame"},
}};

const Entry& entry_of(FitQuantity quantity) {
  return *std::find_if(kEntries.begin(), kEntries.end(),
                       [&](const Entry& entry) { return entry.quantity == quantity; });
}

/// As a step of a path: in quotes where it would be read as something else.
std::string quoted(const std::string& name) {
  if (!name.empty() && name.find_first_of(".[]\"'") == std::string::npos) return name;
  const char* quote = name.find('"') == std::string::npos ? "\"" : "'";
  return quote + name + quote;
}

std::string below(const Entry& entry, std::size_t branch) {
  if (entry.group == "maxwell") {
    return "material.maxwell[" + std::to_string(branch) + "]." + std::string(entry.key);
  }
  return (entry.group.empty() ? "" : std::string(entry.group) + ".") + std::string(entry.key);
}

class Reader {
 public:
  Reader(const std::string& text, std::string where, const SceneDoc& scene,
         const std::vector<CaptureDoc>& captures)
      : text_(text),
        where_(std::move(where)),
        scene_(&scene),
        captures_(captures),
        steps_(parse_path(text, where_)) {}

  FitPath read() {
    FitPath path;
    if (is("captures") && read_capture(path)) return path;
    if (is("scene")) ++at_;
    if (at_ == steps_.size()) unknown();
    if (is("gravity")) {
      path.quantity = FitQuantity::kGravity;
      ++at_;
      if (scene_->gravity.values.size() != 1) {
        refuse("gravity is keyed in this scene; only a constant one can be fitted.");
      }
    } else if (is("colliders")) {
      ++at_;
      path.owner = name_in(scene_->colliders, "collider");
      find(path, Owner::kCollider);
      check(collider_obstacle(*scene_, path));
    } else {
      path.owner = body();
      find(path, Owner::kBody);
    }
    read_component(path);
    return path;
  }

 private:
  [[noreturn]] void refuse(const std::string& message) const {
    throw_input(where_ + ": '" + text_ + "': " + message);
  }

  [[noreturn]] void unknown() const {
    std::vector<std::string> known;
    known.reserve(kEntries.size());
    for (const Entry& entry : kEntries) known.push_back(below(entry, 0));
    std::string rest;
    for (std::size_t i = at_; i < steps_.size(); ++i) {
      const PathStep& step = steps_[i];
      if (step.is_index) {
        rest += "[" + step.key + "]";
      } else {
        rest += (rest.empty() ? "" : ".") + step.key;
      }
    }
    const auto near = nearest(rest, known);
    refuse((near ? "there is no such parameter. Did you mean '" + *near + "'?"
                 : std::string("no parameter that can be fitted.")) +
           " Those are bodies.NAME.material.…, .density, .velocity, .spin, .placement.position, "
           ".placement.rotation; gravity; colliders.NAME.contact.mu, .contact.stiffness, .height; "
           "captures.NAME.start_frame.");
  }

  [[nodiscard]] bool is(std::string_view key) const {
    return at_ < steps_.size() && !steps_[at_].is_index && steps_[at_].key == key;
  }

  /// True where the path is about the capture itself.
  bool read_capture(FitPath& path) {
    ++at_;
    if (at_ == steps_.size()) refuse("the name of a capture is missing.");
    const PathStep& step = steps_[at_++];
    for (std::size_t i = 0; i < captures_.size(); ++i) {
      if (step.is_index ? step.index != i : captures_[i].name != step.key) continue;
      if (is("start_frame") && at_ + 1 == steps_.size()) {
        path.quantity = FitQuantity::kStartFrame;
        path.owner = captures_[i].name;
        return true;
      }
      if (!captures_[i].scene) {
        refuse("the capture has no scene of its own; write the path without 'captures." + step.key +
               ".'.");
      }
      path.capture = captures_[i].name;
      scene_ = captures_[i].scene.get();
      return false;
    }
    refuse("there is no capture '" + step.key + "'.");
  }

  /// Name of the entry of `list` that the next step names or numbers; each is a `what`.
  template <class Doc>
  std::string name_in(const std::vector<Doc>& list, const std::string& what) {
    if (at_ == steps_.size()) refuse("the name of a " + what + " is missing.");
    const PathStep& step = steps_[at_++];
    if (step.is_index && step.index < list.size()) return list[step.index].name;
    std::vector<std::string> names;
    for (const Doc& entry : list) {
      if (!step.is_index && entry.name == step.key) return entry.name;
      names.push_back(entry.name);
    }
    const auto near = nearest(step.key, names);
    refuse("there is no " + what + " '" + step.key + "'." +
           (near ? " Did you mean '" + *near + "'?" : std::string()));
  }

  std::string body() {
    const auto& list = scene_->bodies;
    if (!is("bodies")) {
      const std::string& first = steps_[at_].key;
      const bool known = std::any_of(kEntries.begin(), kEntries.end(), [&](const Entry& entry) {
        return entry.owner == Owner::kBody &&
               (first == (entry.group.empty() ? entry.key : entry.group) ||
                (first == "material" && entry.group == "maxwell"));
      });
      if (!known) unknown();
      if (list.size() == 1) return list.front().name;
      refuse("with several bodies write bodies.NAME." + text_ + ".");
    }
    ++at_;
    return name_in(list, "body");
  }

  void find(FitPath& path, Owner owner) {
    const std::size_t left = steps_.size() - at_;
    for (const Entry& entry : kEntries) {
      if (entry.owner != owner) continue;
      if (entry.group == "maxwell") {
        if (left < 4 || !is("material") || steps_[at_ + 1].key != "maxwell" ||
            !steps_[at_ + 2].is_index || steps_[at_ + 3].key != entry.key) {
          continue;
        }
        path.quantity = entry.quantity;
        path.branch = steps_[at_ + 2].index;
        at_ += 4;
        check(branch_obstacle(*scene_, path));
        return;
      }
      const std::size_t length = entry.group.empty() ? 1 : 2;
      if (left < length || (length == 2 && steps_[at_].key != entry.group)) continue;
      if (steps_[at_ + length - 1].key != entry.key) continue;
      path.quantity = entry.quantity;
      at_ += length;
      return;
    }
    unknown();
  }

  void check(const std::string& obstacle) const {
    if (!obstacle.empty()) refuse(obstacle);
  }

  void read_component(FitPath& path) {
    if (at_ == steps_.size()) return;
    if (!path.is_vector() || !steps_[at_].is_index || at_ + 1 != steps_.size()) unknown();
    if (steps_[at_].index > 2) refuse("a vector has the components [0], [1] and [2].");
    path.component = static_cast<int>(steps_[at_].index);
  }

  const std::string& text_;
  std::string where_;
  const SceneDoc* scene_;
  const std::vector<CaptureDoc>& captures_;
  std::vector<PathStep> steps_;
  std::size_t at_ = 0;
};

/// The object that holds the quantity, and its key there; null where `create` is off and it does
/// not stand there.
std::pair<Json*, std::string> holder(Json& scene, const FitPath& path, bool create) {
  const Entry& entry = entry_of(path.quantity);
  const std::string key(entry.key);
  if (entry.owner == Owner::kCapture) return {nullptr, key};
  Json* at = &scene;
  if (entry.owner != Owner::kScene) {
    at = find_named(scene, entry.owner == Owner::kBody ? "bodies" : "colliders", path.owner);
    if (at == nullptr) return {nullptr, key};
  }
  if (entry.group.empty()) return {at, key};
  const std::string group(entry.group == "maxwell" ? "material" : entry.group);
  const bool there = at->contains(group) && (*at)[group].is_object();
  if (!there && !create) return {nullptr, key};
  at = &(*at)[group];
  if (!at->is_object()) *at = Json::object();
  if (entry.group != "maxwell") return {at, key};
  const auto list = at->find("maxwell");
  if (list == at->end() || !list->is_array() || list->size() <= path.branch) return {nullptr, key};
  return {&(*list)[path.branch], key};
}

}  // namespace

std::string FitPath::text() const {
  const Entry& entry = entry_of(quantity);
  std::string result = capture.empty() ? "" : "captures." + quoted(capture) + ".";
  if (entry.owner == Owner::kBody) result += "bodies." + quoted(owner) + ".";
  if (entry.owner == Owner::kCollider) result += "colliders." + quoted(owner) + ".";
  if (entry.owner == Owner::kCapture) result += "captures." + quoted(owner) + ".";
  result += below(entry, branch);
  if (component) result += "[" + std::to_string(*component) + "]";
  return result;
}

bool FitPath::is_vector() const { return entry_of(quantity).vector; }

bool FitPath::is_material() const {
  const std::string_view group = entry_of(quantity).group;
  return group == "material" || group == "maxwell";
}

std::string_view FitPath::law_parameter() const {
  const Entry& entry = entry_of(quantity);
  const bool any_law =
      quantity == FitQuantity::kDampingShear || quantity == FitQuantity::kDampingBulk;
  return entry.group == "material" && !any_law ? entry.key : std::string_view();
}

std::string collider_obstacle(const SceneDoc& scene, const FitPath& path) {
  const auto has_name = [&](const ColliderDoc& collider) { return collider.name == path.owner; };
  const auto& all = scene.colliders;
  if (std::count_if(all.begin(), all.end(), has_name) > 1) {
    return "several colliders are called '" + path.owner + "'; give them different names.";
  }
  const ColliderDoc& collider = *std::find_if(all.begin(), all.end(), has_name);
  if (path.quantity == FitQuantity::kHeight && collider.shape != ColliderDoc::Shape::kGround) {
    return "only the shape 'ground' has a height.";
  }
  if (path.quantity == FitQuantity::kFriction &&
      collider.contact.kind != shape::ContactKind::kFriction) {
    return "the collider's contact is not of the kind 'friction', so mu has no effect.";
  }
  return {};
}

std::string branch_obstacle(const SceneDoc& scene, const FitPath& path) {
  const std::size_t branches = body_named(scene, path.owner).material.maxwell.size();
  if (path.branch < branches) return {};
  return "the material has " + std::to_string(branches) +
         " Maxwell branches; add one to 'maxwell' for the fit to start from.";
}

FitPath read_fit_path(const std::string& text, const std::string& where, const SceneDoc& scene,
                      const std::vector<CaptureDoc>& captures) {
  return Reader(text, where, scene, captures).read();
}

Json* find_named(Json& scene, const char* list, const std::string& name) {
  const auto found = scene.find(list);
  if (found == scene.end() || !found->is_array()) return nullptr;
  for (std::size_t i = 0; i < found->size(); ++i) {
    Json& entry = (*found)[i];
    if (!entry.is_object()) continue;
    const auto called = entry.find("name");
    const bool has_name = called != entry.end() && called->is_string();
    const std::string its_name =
        has_name ? called->get<std::string>() : std::string("collider") + std::to_string(i);
    if (its_name == name) return &entry;
  }
  return nullptr;
}

const Json* find_quantity(const Json& scene, const FitPath& path) {
  // Only looked at: holder() changes nothing unless it is told to create.
  const auto [at, key] = holder(const_cast<Json&>(scene), path, false);
  if (at == nullptr || !at->is_object()) return nullptr;
  const auto found = at->find(key);
  return found == at->end() || found->is_null() ? nullptr : &*found;
}

void set_quantity(Json& scene, const FitPath& path, const Json& value) {
  const auto [at, key] = holder(scene, path, true);
  if (at == nullptr) throw_input("'" + path.text() + "' does not stand in the scene.");
  if (!path.is_vector() || path.quantity == FitQuantity::kRotation || !path.component) {
    (*at)[key] = value;
    return;
  }
  Json& vector = (*at)[key];
  if (!vector.is_array()) {
    const bool gravity = path.quantity == FitQuantity::kGravity;
    vector = gravity ? Json{0.0, 0.0, -9.81} : Json{0.0, 0.0, 0.0};
  }
  vector[static_cast<std::size_t>(*path.component)] = value;
}

void copy_quantity(const Json& scene, const FitPath& path, Json& overrides) {
  const Entry& entry = entry_of(path.quantity);
  Json* into = &overrides;
  if (entry.owner != Owner::kScene) {
    const char* list = entry.owner == Owner::kBody ? "bodies" : "colliders";
    into = find_named(overrides, list, path.owner);
    if (into == nullptr) {
      overrides[list].push_back({{"name", path.owner}});
      into = &overrides[list].back();
    }
  }
  if (entry.group == "maxwell") {
    Json copy = scene;
    (*into)["material"]["maxwell"] =
        find_named(copy, "bodies", path.owner)->at("material").at("maxwell");
  } else if (const Json* vector = path.is_vector() ? find_quantity(scene, path) : nullptr) {
    (*holder(overrides, path, true).first)[std::string(entry.key)] = *vector;
  }
}

}  // namespace matterfit::job
