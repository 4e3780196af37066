// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>
#include <vector>

#include "fit/model/quantity.hpp"
#include "job/documents/document.hpp"

/// Where the quantities of fit/model/quantity.hpp stand in a document. The place follows from a
/// row's path: nothing here knows a single quantity by name, but for what a scene's own words are.
namespace matterfit::job {

/// Reads a path, short forms too, against the scene it is about. `films`: the names of captures by
/// images. Throws Error(kInput) beginning with `where`.
[[nodiscard]] fit::Address read_fit_path(const std::string& text, const std::string& where,
                                         const SceneDoc& scene,
                                         const std::vector<CaptureDoc>& captures,
                                         const std::vector<std::string>& films = {});

/// The quantity in a document's `scene` (or in overrides of one): the number, the vector, for a
/// rotation the quaternion. Null where it does not stand there.
[[nodiscard]] const Json* find_quantity(const Json& scene, const fit::Address& address);

/// Sets it, making what is missing on the way; of a vector the component. `value` of a rotation is
/// the quaternion [w, x, y, z].
void set_quantity(Json& scene, const fit::Address& address, const Json& value);

/// Sets a quantity of a capture in the capture's entry, with entries of lists that are missing.
void set_capture_quantity(Json& capture, const fit::Address& address, double value);

/// Whether documents have a quaternion where fits move a rotation vector on top of it.
[[nodiscard]] bool is_quaternion(const fit::Quantity& quantity);

/// Makes room for set_quantity() in overrides of a scene: the owner's entry, and what would be
/// replaced as a whole (a vector, a list of Maxwell branches), as `scene` has it.
void copy_quantity(const Json& scene, const fit::Address& address, Json& overrides);

/// The list entry called `name` (a collider without a name is called `collider` and its index);
/// null if there is none.
[[nodiscard]] Json* find_named(Json& scene, std::string_view list, const std::string& name);

}  // namespace matterfit::job
