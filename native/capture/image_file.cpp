// SPDX-License-Identifier: GPL-3.0-or-later
#include "capture/image_file.hpp"

#include <algorithm>
#include <cstdint>
#include <initializer_list>

#include "base/error.hpp"
#include "base/file.hpp"
#include "capture/exr.hpp"
#include "capture/jpeg.hpp"

namespace matterfit::capture {
namespace {

constexpr std::uint64_t kMostImageBytes = std::uint64_t{1} << 30U;

enum class ImageFormat { kPng, kJpeg, kExr };

ImageFormat format_of(std::span<const std::byte> bytes, const std::string& name) {
  const auto begins = [&](std::initializer_list<int> magic) {
    return bytes.size() >= magic.size() &&
           std::equal(magic.begin(), magic.end(), bytes.begin(),
                      [](int a, std::byte b) { return std::byte(a) == b; });
  };
  if (begins({0x89, 'P', 'N', 'G'})) return ImageFormat::kPng;
  if (begins({0xff, 0xd8, 0xff})) return ImageFormat::kJpeg;
  if (begins({0x76, 0x2f, 0x31, 0x01})) return ImageFormat::kExr;
  throw_input(name + ": is no image that is read: PNG, JPEG or OpenEXR. Save it as one of these.");
}

}  // namespace

Bitmap parse_image(std::span<const std::byte> bytes, const std::string& name) {
  switch (format_of(bytes, name)) {
    case ImageFormat::kJpeg:
      return parse_jpeg(bytes, name);
    case ImageFormat::kExr:
      return parse_exr(bytes, name);
    default:
      return parse_png(bytes, name);
  }
}

Bitmap read_image(const std::filesystem::path& path) {
  return parse_image(read_file(path, kMostImageBytes), path.string());
}

std::array<int, 2> image_size(const std::filesystem::path& path) {
  const auto bytes = read_file(path, kMostImageBytes);
  const std::string name = path.string();
  switch (format_of(bytes, name)) {
    case ImageFormat::kJpeg:
      return jpeg_size(bytes, name);
    case ImageFormat::kExr:
      return exr_size(bytes, name);
    default:
      return png_size(bytes, name);
  }
}

}  // namespace matterfit::capture
