// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <filesystem>

#include "job/documents/document.hpp"

/// The pieces that read_job() is made of; not for use outside the job room.
namespace matterfit::job {

struct ImagesDoc;  // job/documents/images_document.hpp
struct RenderDoc;

/// Limits of each component. The panel's fields end there too.
inline constexpr Range kPlaceRange{-1e6, 1e6, false, "m"};
inline constexpr Range kSpeedRange{-1e5, 1e5, false, "m/s"};
inline constexpr Range kSpinRange{-1e5, 1e5, false, "rad/s"};
inline constexpr Range kAccelerationRange{-1e5, 1e5, false, "m/s²"};

/// What every piece needs to know.
struct ReadContext {
  std::filesystem::path base_folder;
  /// The file that a value names: relative to the base folder, lexically normal.
  [[nodiscard]] std::filesystem::path file(const JsonValue& value) const;
};

[[nodiscard]] SceneDoc read_scene(const JsonValue& value, const ReadContext& context);
[[nodiscard]] material::Material read_material(const JsonValue& value, const ReadContext& context);
[[nodiscard]] Source read_source(const JsonValue& value, const ReadContext& context);
/// {`low`, `high`}.
[[nodiscard]] Eigen::AlignedBox3d read_box(const JsonValue& value);
[[nodiscard]] Region read_region(const JsonValue& value, const ReadContext& context);
[[nodiscard]] BodyDoc read_body(const JsonValue& value, const ReadContext& context);
[[nodiscard]] ColliderDoc read_collider(const JsonValue& value, const ReadContext& context,
                                        std::size_t index);
[[nodiscard]] EffectDoc read_effect(const JsonValue& value, const SceneDoc& scene);
[[nodiscard]] shape::Contact read_contact(const JsonValue& value);
[[nodiscard]] Placement read_placement(const JsonValue& value);
[[nodiscard]] ByFrame<shape::Pose> read_motion(const JsonValue& value);
/// `scene_value` is the document's scene, over which the capture's own is laid.
[[nodiscard]] CaptureDoc read_capture(const JsonValue& value, const ReadContext& context,
                                      const JsonValue& scene_value, const SceneDoc& scene);
/// Whether a capture is one by images.
[[nodiscard]] bool is_by_images(const JsonValue& value);
[[nodiscard]] ImagesDoc read_images(const JsonValue& value, const ReadContext& context,
                                    const SceneDoc& scene);
[[nodiscard]] RenderDoc read_render(const JsonValue& value, const ReadContext& context);
/// Metres per unit: a number, or "m", "cm", "mm".
[[nodiscard]] double read_unit(const JsonValue& value);
/// The axis that points up, as capture::TracksOptions has it.
[[nodiscard]] char read_up(const JsonValue& value);
/// Row by row: four rows, or {position, rotation, scale}.
[[nodiscard]] std::array<double, 16> read_matrix(const JsonValue& value);
/// [first, end).
[[nodiscard]] std::array<int, 2> read_range(const JsonValue& value);
[[nodiscard]] ProbeDoc read_probe(const JsonValue& value, const ReadContext& context,
                                  const SceneDoc& scene);
[[nodiscard]] FitDoc read_fit(const JsonValue& value, const SceneDoc& scene,
                              const std::vector<CaptureDoc>& captures,
                              const std::vector<std::string>& films);
[[nodiscard]] OutputDoc read_output(const JsonValue& value, const ReadContext& context,
                                    const SceneDoc& scene);
/// Throws if `name` is no body of the scene; an empty name stands for the only body.
[[nodiscard]] std::string resolve_body(const std::optional<JsonValue>& value,
                                       const JsonValue& owner, const SceneDoc& scene);

}  // namespace matterfit::job
