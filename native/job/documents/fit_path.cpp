// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/documents/fit_path.hpp"

#include <algorithm>
#include <optional>
#include <string_view>
#include <utility>

#include "base/error.hpp"
#include "job/documents/override.hpp"

namespace matterfit::job {
namespace {

using fit::Address;
using fit::Owner;
using fit::Quantity;

/// A step of Quantity::path: a key, and whether an index in brackets follows it.
struct Key {
  std::string key;
  bool indexed = false;
};

std::vector<Key> keys_of(const Quantity& quantity) {
  constexpr std::string_view kIndex = "[#]";
  std::vector<Key> keys;
  std::string_view rest = quantity.path;
  while (!rest.empty()) {
    const std::size_t dot = std::min(rest.find('.'), rest.size());
    std::string_view step = rest.substr(0, dot);
    Key key;
    key.indexed = step.ends_with(kIndex);
    if (key.indexed) step.remove_suffix(kIndex.size());
    key.key = step;
    keys.push_back(std::move(key));
    rest.remove_prefix(std::min(dot + 1, rest.size()));
  }
  return keys;
}

/// With 0 as the index.
std::string example(const Quantity& quantity) {
  std::string text;
  for (const Key& key : keys_of(quantity)) {
    text += (text.empty() ? "" : ".") + key.key + (key.indexed ? "[0]" : "");
  }
  return text;
}

/// "bodies.NAME.material.…, .density, .velocity; gravity; colliders.NAME.contact.mu, .height".
std::string all_paths() {
  std::string text;
  for (const Owner owner :
       {Owner::kBody, Owner::kScene, Owner::kCollider, Owner::kEffect, Owner::kCapture}) {
    const std::string_view list = fit::list_of(owner);
    std::vector<std::string> paths;
    for (const Quantity& row : fit::quantities()) {
      if (row.owner != owner) continue;
      std::string path = row.is_material() ? "material.…" : row.path;
      if (std::find(paths.begin(), paths.end(), path) == paths.end()) {
        paths.push_back(std::move(path));
      }
    }
    for (std::size_t i = 0; i < paths.size(); ++i) {
      if (i == 0) text += (text.empty() ? "" : "; ") + std::string(list);
      if (!list.empty()) text += i == 0 ? ".NAME." : ", .";
      if (list.empty() && i > 0) text += ", ";
      text += paths[i];
    }
  }
  return text;
}

/// How many steps from `at` on are a quantity's, and the index among them; nothing where they are
/// not.
struct Match {
  std::size_t steps = 0;
  std::size_t index = 0;
};
std::optional<Match> match(const Quantity& quantity, const std::vector<PathStep>& steps,
                           std::size_t at) {
  Match found;
  std::size_t i = at;
  for (const Key& key : keys_of(quantity)) {
    if (i == steps.size() || steps[i].is_index || steps[i].key != key.key) return std::nullopt;
    ++i;
    if (!key.indexed) continue;
    if (i == steps.size() || !steps[i].is_index) return std::nullopt;
    found.index = steps[i++].index;
  }
  found.steps = i - at;
  return found;
}

class Reader {
 public:
  Reader(const std::string& text, std::string where, const SceneDoc& scene,
         const std::vector<CaptureDoc>& captures, const std::vector<std::string>& films)
      : text_(text),
        where_(std::move(where)),
        scene_(&scene),
        captures_(captures),
        films_(films),
        steps_(parse_path(text, where_)) {}

  Address read() {
    Address address;
    if (is("captures") && read_capture(address)) return address;
    if (is("scene")) ++at_;
    if (at_ == steps_.size()) unknown();
    if (begins(Owner::kScene)) {
      find(address, Owner::kScene);
      if (scene_->gravity.values.size() != 1) {
        refuse("gravity is keyed in this scene; only a constant one can be fitted.");
      }
    } else if (is(fit::list_of(Owner::kCollider))) {
      ++at_;
      address.owner = name_in(scene_->colliders, "collider");
      find(address, Owner::kCollider);
      check(collider_obstacle(address));
    } else {
      address.owner = body();
      find(address, Owner::kBody);
      // What a law does not use is told with the fit's candidate laws at hand (document_fit.cpp).
      if (!address.quantity->of_law) {
        fit::Bearer bearer;
        bearer.material = &body_named(*scene_, address.owner).material;
        check(fit::obstacle(address, bearer));
      }
    }
    read_component(address);
    return address;
  }

 private:
  [[noreturn]] void refuse(const std::string& message) const {
    throw_input(where_ + ": '" + text_ + "': " + message);
  }

  [[noreturn]] void unknown() const {
    std::vector<std::string> known;
    known.reserve(fit::quantities().size());
    for (const Quantity& row : fit::quantities()) known.push_back(example(row));
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
           " Those are " + all_paths() + ".");
  }

  [[nodiscard]] bool is(std::string_view key) const {
    return at_ < steps_.size() && !steps_[at_].is_index && steps_[at_].key == key;
  }

  /// Whether a quantity of such an owner begins with the next step.
  [[nodiscard]] bool begins(Owner owner) const {
    const auto& rows = fit::quantities();
    return std::any_of(rows.begin(), rows.end(), [&](const Quantity& row) {
      return row.owner == owner && is(keys_of(row).front().key);
    });
  }

  /// What is of the capture of that name itself.
  void read_viewing(Address& address, const std::string& name) {
    address.owner = name;
    find(address, Owner::kCapture);
    read_component(address);
  }

  /// True where the path is about the capture itself.
  bool read_capture(Address& address) {
    ++at_;
    if (at_ == steps_.size()) refuse("the name of a capture is missing.");
    const PathStep& step = steps_[at_++];
    if (std::find(films_.begin(), films_.end(), step.key) != films_.end()) {
      if (!begins(Owner::kCapture)) {
        refuse("a capture by images has no scene of its own; write the path without 'captures." +
               step.key + ".'.");
      }
      read_viewing(address, step.key);
      return true;
    }
    for (std::size_t i = 0; i < captures_.size(); ++i) {
      const CaptureDoc& capture = captures_[i];
      if (step.is_index ? step.index != capture.place : capture.name != step.key) continue;
      if (begins(Owner::kCapture)) {
        read_viewing(address, capture.name);
        if (address.quantity->is_pose()) {
          refuse("'" + step.key + "' is a capture by tracks, which has no cameras.");
        }
        return true;
      }
      if (!captures_[i].scene) {
        refuse("the capture has no scene of its own; write the path without 'captures." + step.key +
               ".'.");
      }
      address.capture = captures_[i].name;
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
    if (!is(fit::list_of(Owner::kBody))) {
      if (!begins(Owner::kBody)) unknown();
      if (list.size() == 1) return list.front().name;
      refuse("with several bodies write bodies.NAME." + text_ + ".");
    }
    ++at_;
    return name_in(list, "body");
  }

  void find(Address& address, Owner owner) {
    for (const Quantity& row : fit::quantities()) {
      if (row.owner != owner) continue;
      const auto found = match(row, steps_, at_);
      if (!found) continue;
      address.quantity = &row;
      address.index = found->index;
      at_ += found->steps;
      return;
    }
    unknown();
  }

  [[nodiscard]] std::string collider_obstacle(const Address& address) const {
    const auto has_name = [&](const ColliderDoc& collider) {
      return collider.name == address.owner;
    };
    const auto& all = scene_->colliders;
    if (std::count_if(all.begin(), all.end(), has_name) > 1) {
      return "several colliders are called '" + address.owner + "'; give them different names.";
    }
    const ColliderDoc& collider = *std::find_if(all.begin(), all.end(), has_name);
    fit::Bearer bearer;
    bearer.contact = &collider.contact;
    bearer.has_height = collider.shape == ColliderDoc::Shape::kGround;
    return fit::obstacle(address, bearer);
  }

  void check(const std::string& obstacle) const {
    if (!obstacle.empty()) refuse(obstacle);
  }

  void read_component(Address& address) {
    if (at_ == steps_.size()) return;
    if (!address.quantity->is_vector() || !steps_[at_].is_index || at_ + 1 != steps_.size()) {
      unknown();
    }
    if (steps_[at_].index > 2) refuse("a vector has the components [0], [1] and [2].");
    address.component = static_cast<int>(steps_[at_].index);
  }

  const std::string& text_;
  std::string where_;
  const SceneDoc* scene_;
  const std::vector<CaptureDoc>& captures_;
  const std::vector<std::string>& films_;
  std::vector<PathStep> steps_;
  std::size_t at_ = 0;
};

/// The object that holds the quantity, and its key there; null where `create` is off and it does
/// not stand there, and where a list is too short. A quantity of a capture stands in no scene.
std::pair<Json*, std::string> holder(Json& scene, const Address& address, bool create) {
  const std::vector<Key> keys = keys_of(*address.quantity);
  const std::string& last = keys.back().key;
  Json* at = &scene;
  if (address.quantity->owner == Owner::kCapture) return {nullptr, last};
  const std::string_view list = fit::list_of(address.quantity->owner);
  if (!list.empty()) at = find_named(scene, list, address.owner);
  if (at == nullptr) return {nullptr, last};
  for (std::size_t k = 0; k + 1 < keys.size(); ++k) {
    const std::string& key = keys[k].key;
    if (keys[k].indexed) {
      const auto found = at->find(key);
      if (found == at->end() || !found->is_array() || found->size() <= address.index) {
        return {nullptr, last};
      }
      at = &(*found)[address.index];
      continue;
    }
    if (!create && !(at->contains(key) && (*at)[key].is_object())) return {nullptr, last};
    at = &(*at)[key];
    if (!at->is_object()) *at = Json::object();
  }
  return {at, last};
}

/// The quantity is an entry of a list of numbers.
bool ends_in_list(const Quantity& quantity) { return keys_of(quantity).back().indexed; }

/// Null where the list is too short, or none.
Json* entry_of(Json& list, std::size_t index) {
  return list.is_array() && index < list.size() ? &list[index] : nullptr;
}

}  // namespace

bool is_quaternion(const Quantity& quantity) { return quantity.path == "placement.rotation"; }

fit::Address read_fit_path(const std::string& text, const std::string& where, const SceneDoc& scene,
                           const std::vector<CaptureDoc>& captures,
                           const std::vector<std::string>& films) {
  return Reader(text, where, scene, captures, films).read();
}

Json* find_named(Json& scene, std::string_view list, const std::string& name) {
  const auto found = scene.find(std::string(list));
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

const Json* find_quantity(const Json& scene, const Address& address) {
  // Only looked at: holder() changes nothing unless it is told to create.
  const auto [at, key] = holder(const_cast<Json&>(scene), address, false);
  if (at == nullptr || !at->is_object()) return nullptr;
  const auto found = at->find(key);
  if (found == at->end() || found->is_null()) return nullptr;
  return ends_in_list(*address.quantity) ? entry_of(*found, address.index) : &*found;
}

void set_quantity(Json& scene, const Address& address, const Json& value) {
  const auto [at, key] = holder(scene, address, true);
  if (at == nullptr) throw_input("'" + address.text() + "' does not stand in the scene.");
  const Quantity& quantity = *address.quantity;
  if (ends_in_list(quantity)) {
    Json* entry = entry_of((*at)[key], address.index);
    if (entry == nullptr) throw_input("'" + address.text() + "' does not stand in the scene.");
    *entry = value;
    return;
  }
  if (!quantity.is_vector() || is_quaternion(quantity) || !address.component) {
    (*at)[key] = value;
    return;
  }
  Json& vector = (*at)[key];
  if (!vector.is_array()) {
    const bool gravity = quantity.owner == Owner::kScene;
    vector = gravity ? Json{0.0, 0.0, -9.81} : Json{0.0, 0.0, 0.0};
  }
  vector[static_cast<std::size_t>(*address.component)] = value;
}

void set_capture_quantity(Json& capture, const Address& address, double value) {
  const std::vector<Key> keys = keys_of(*address.quantity);
  Json* at = &capture;
  for (const Key& key : keys) {
    at = &(*at)[key.key];
    if (!key.indexed) continue;
    while (at->size() <= address.index) at->push_back(Json::object());
    at = &(*at)[address.index];
  }
  if (!address.component) {
    *at = value;
    return;
  }
  if (!at->is_array()) *at = {0.0, 0.0, 0.0};
  (*at)[static_cast<std::size_t>(*address.component)] = value;
}

void copy_quantity(const Json& scene, const Address& address, Json& overrides) {
  const Quantity& quantity = *address.quantity;
  const std::string_view list = fit::list_of(quantity.owner);
  Json* into = &overrides;
  Json copy = scene;
  const Json* from = &copy;
  if (!list.empty()) {
    into = find_named(overrides, list, address.owner);
    if (into == nullptr) {
      Json& entries = overrides[std::string(list)];
      entries.push_back({{"name", address.owner}});
      into = &entries.back();
    }
    from = find_named(copy, list, address.owner);
  }
  for (const Key& key : keys_of(quantity)) {
    const bool whole = key.indexed || (quantity.is_vector() && key.key == quantity.key());
    if (from == nullptr || !from->is_object() || !from->contains(key.key)) return;
    from = &from->at(key.key);
    if (whole) {
      (*into)[key.key] = *from;
      return;
    }
    if (!from->is_object()) return;  // the number itself
    Json& next = (*into)[key.key];
    if (!next.is_object()) next = Json::object();
    into = &next;
  }
}

}  // namespace matterfit::job
