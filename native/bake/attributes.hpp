// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/parallel.hpp"
#include "capture/particles.hpp"

namespace matterfit::bake {

/// Quantities of particles that textures carry. All are three channels R, G, B (Blender treats
/// alpha as coverage); scalars stand in all three.
enum class Attribute {
  kVelocity,       ///< "velocity" [m/s], world
  kPlasticStrain,  ///< "plastic_strain": equivalent plastic strain; 0 for elastic laws
  kVolumeRatio,    ///< "volume_ratio": J = det F
  kStretch,        ///< "stretch": largest principal stretch
  kRotation,       ///< "rotation": Euler angles XYZ [rad] of the axes of F (Blender's order)
  kScale,          ///< "scale": principal stretches times h [m], along those axes
};

[[nodiscard]] std::string_view name_of(Attribute attribute);  ///< in documents and files
/// Throws Error(kInput) listing the names.
[[nodiscard]] Attribute attribute_from_name(std::string_view name);

/// Where point i of N stands in a texture: pixel (i mod width, ⌊i / width⌋), the first row on top
/// as EXR stores it. Width is the smallest power of two with at least √N, at most 4096, so that it
/// is the same for all frames and attributes of a body. In Blender, whose v runs upward:
///   u = (i mod width + ½) / width,   v = 1 − (⌊i / width⌋ + ½) / height.
/// Pixels past N are zero. No points: one pixel.
struct TextureLayout {
  std::size_t points = 0;
  int width = 1;
  int height = 1;
};
[[nodiscard]] TextureLayout texture_layout(std::size_t points);

/// (N, 3). `plastic_strain` as in mpm::BodyState, may be empty. Throws Error(kInput) if lengths
/// differ and Error(kCompute) if a value is not finite.
[[nodiscard]] std::vector<float> attribute_values(const capture::ParticleView& state,
                                                  std::span<const float> plastic_strain,
                                                  Attribute attribute, Arena& arena);

struct TextureOptions {
  bool half_float = true;  ///< 16-bit floats; values beyond ±65504 are clamped
};

/// Header attribute with the number of points.
inline constexpr const char* kTexturePoints = "matterfitPoints";

/// Writes (N, 3) values as an EXR: channels R, G, B, ZIP compression, no time or machine in the
/// header; through AtomicFile. Equal values give equal bytes. Returns the size of the file. Throws
/// Error(kInput) if `values` are not 3·N, and Error(kOutput).
std::uint64_t write_attribute_texture(const std::filesystem::path& path,
                                      const TextureLayout& layout, std::span<const float> values,
                                      const TextureOptions& options = {});

}  // namespace matterfit::bake
