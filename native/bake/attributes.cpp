// SPDX-License-Identifier: GPL-3.0-or-later
#include "bake/attributes.hpp"

#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfIO.h>
#include <ImfIntAttribute.h>
#include <ImfOutputFile.h>
#include <half.h>

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <exception>
#include <limits>
#include <utility>

#include "base/error.hpp"
#include "base/file.hpp"

namespace matterfit::bake {
namespace {

constexpr std::array<std::pair<Attribute, std::string_view>, 6> kNames{{
    {Attribute::kVelocity, "velocity"},
    {Attribute::kPlasticStrain, "plastic_strain"},
    {Attribute::kVolumeRatio, "volume_ratio"},
    {Attribute::kStretch, "stretch"},
    {Attribute::kRotation, "rotation"},
    {Attribute::kScale, "scale"},
}};

/// OpenEXR writes its offset table last, at the front; a growing buffer takes both.
class MemoryStream : public Imf::OStream {
 public:
  MemoryStream() : Imf::OStream("memory") {}
  void write(const char bytes[], int count) override {
    const auto end = position_ + static_cast<std::size_t>(count);
    if (end > buffer_.size()) buffer_.resize(end);
    std::memcpy(buffer_.data() + position_, bytes, static_cast<std::size_t>(count));
    position_ = end;
  }
  std::uint64_t tellp() override { return position_; }
  void seekp(std::uint64_t position) override { position_ = position; }
  [[nodiscard]] std::string_view bytes() const { return {buffer_.data(), buffer_.size()}; }

 private:
  std::vector<char> buffer_;
  std::size_t position_ = 0;
};

/// Angles of the rotation Rz(c) Ry(b) Rx(a), Blender's Euler XYZ.
Vec3d euler_xyz(const Mat3d& r) {
  const double cosine = std::hypot(r(0, 0), r(1, 0));
  if (cosine > 1e-9) {
    return {std::atan2(r(2, 1), r(2, 2)), std::atan2(-r(2, 0), cosine),
            std::atan2(r(1, 0), r(0, 0))};
  }
  return {std::atan2(-r(1, 2), r(1, 1)), std::atan2(-r(2, 0), cosine), 0.0};
}

Mat3d deformation(const capture::ParticleView& state, std::size_t i) {
  return state.deformation_gradients.empty() ? Mat3d(Mat3d::Identity())
                                             : Mat3d(state.deformation_gradients[i].cast<double>());
}

Vec3d value_of(const capture::ParticleView& state, std::span<const float> plastic_strain,
               Attribute attribute, std::size_t i) {
  switch (attribute) {
    case Attribute::kVelocity:
      return state.velocities.empty() ? Vec3d(Vec3d::Zero())
                                      : Vec3d(state.velocities[i].cast<double>());
    case Attribute::kPlasticStrain:
      return Vec3d::Constant(plastic_strain.empty() ? 0.0 : static_cast<double>(plastic_strain[i]));
    case Attribute::kVolumeRatio:
      return Vec3d::Constant(deformation(state, i).determinant());
    case Attribute::kStretch:
      return Vec3d::Constant(capture::principal_stretches(deformation(state, i)).stretches[0]);
    case Attribute::kRotation:
      return euler_xyz(capture::principal_stretches(deformation(state, i)).axes);
    case Attribute::kScale:
      return capture::principal_stretches(deformation(state, i)).stretches.cwiseAbs() *
             state.separation;
  }
  return Vec3d::Zero();
}

}  // namespace

std::string_view name_of(Attribute attribute) {
  for (const auto& [value, name] : kNames) {
    if (value == attribute) return name;
  }
  return "";
}

Attribute attribute_from_name(std::string_view name) {
  std::string known;
  for (const auto& [value, text] : kNames) {
    if (text == name) return value;
    known += (known.empty() ? "" : ", ") + std::string(text);
  }
  throw_input("'" + std::string(name) + "' is not an attribute that can be baked. Known are " +
              known + ".");
}

TextureLayout texture_layout(std::size_t points) {
  TextureLayout layout;
  layout.points = points;
  if (points == 0) return layout;
  const auto root = static_cast<std::size_t>(std::ceil(std::sqrt(static_cast<double>(points))));
  const std::size_t width = std::min<std::size_t>(4096, std::bit_ceil(root));
  const std::size_t height = (points + width - 1) / width;
  if (height > 1'000'000) {
    throw_input(std::to_string(points) + " points are more than an attribute texture can hold.");
  }
  layout.width = static_cast<int>(width);
  layout.height = static_cast<int>(height);
  return layout;
}

std::vector<float> attribute_values(const capture::ParticleView& state,
                                    std::span<const float> plastic_strain, Attribute attribute,
                                    Arena& arena) {
  check(state);
  if (!plastic_strain.empty() && plastic_strain.size() != state.size()) {
    throw_input("body '" + state.name + "': " + std::to_string(plastic_strain.size()) +
                " plastic strains for " + std::to_string(state.size()) + " particles.");
  }
  std::vector<float> values(3 * state.size());
  arena.parallel_for(0, state.size(), 512, [&](std::size_t i) {
    const Vec3d value = value_of(state, plastic_strain, attribute, i);
    for (int k = 0; k < 3; ++k) {
      values[3 * i + static_cast<std::size_t>(k)] = static_cast<float>(value[k]);
    }
  });
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (!std::isfinite(values[i])) {
      throw_compute("body '" + state.name + "', particle " + std::to_string(i / 3) + ": its " +
                    std::string(name_of(attribute)) + " is not a finite number.");
    }
  }
  return values;
}

std::uint64_t write_attribute_texture(const std::filesystem::path& path,
                                      const TextureLayout& layout, std::span<const float> values,
                                      const TextureOptions& options) {
  if (values.size() != 3 * layout.points || layout.width < 1 || layout.height < 1 ||
      static_cast<std::size_t>(layout.width) * static_cast<std::size_t>(layout.height) <
          layout.points) {
    throw_input(path.string() + ": " + std::to_string(values.size()) +
                " values do not fit a texture of " + std::to_string(layout.points) + " points.");
  }
  const std::size_t pixels =
      static_cast<std::size_t>(layout.width) * static_cast<std::size_t>(layout.height);
  const Imf::PixelType type = options.half_float ? Imf::HALF : Imf::FLOAT;
  std::vector<float> full;
  std::vector<half> halves;
  char* base = nullptr;
  std::size_t size = 0;
  if (options.half_float) {
    halves.assign(3 * pixels, half(0.0F));
    for (std::size_t i = 0; i < values.size(); ++i) {
      halves[i] = half(std::clamp(values[i], -65504.0F, 65504.0F));
    }
    base = reinterpret_cast<char*>(halves.data());
    size = sizeof(half);
  } else {
    full.assign(3 * pixels, 0.0F);
    std::copy(values.begin(), values.end(), full.begin());
    base = reinterpret_cast<char*>(full.data());
    size = sizeof(float);
  }
  MemoryStream memory;
  try {
    Imf::Header header(layout.width, layout.height);
    header.compression() = Imf::ZIP_COMPRESSION;
    header.insert(kTexturePoints, Imf::IntAttribute(static_cast<int>(layout.points)));
    Imf::FrameBuffer frame;
    const std::array<const char*, 3> channels{"R", "G", "B"};
    for (std::size_t k = 0; k < 3; ++k) {
      header.channels().insert(channels[k], Imf::Channel(type));
      frame.insert(channels[k], Imf::Slice(type, base + k * size, 3 * size,
                                           3 * size * static_cast<std::size_t>(layout.width)));
    }
    Imf::OutputFile output(memory, header, /*numThreads=*/0);
    output.setFrameBuffer(frame);
    output.writePixels(layout.height);
  } catch (const std::exception& error) {
    throw_output(path.string() + ": OpenEXR could not write it: " + error.what() + ".");
  }
  AtomicFile file(path);
  file.write(memory.bytes());
  const std::uint64_t bytes = file.size();
  file.commit();
  return bytes;
}

}  // namespace matterfit::bake
