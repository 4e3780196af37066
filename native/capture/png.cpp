// SPDX-License-Identifier: GPL-3.0-or-later
#include "capture/png.hpp"

#include <png.h>

#include <cstring>
#include <string_view>

#include "base/error.hpp"
#include "base/file.hpp"

namespace matterfit::capture {
namespace {

/// libpng's simplified interface, freed whatever happens.
class Reader {
 public:
  Reader(std::span<const std::byte> bytes, const std::string& name) : name_(name) {
    image_.version = PNG_IMAGE_VERSION;
    check(png_image_begin_read_from_memory(&image_, bytes.data(), bytes.size()));
    // A file of 16 bits that names no curve is coded by sRGB, as one of 8 bits is.
    image_.flags |= PNG_IMAGE_FLAG_16BIT_sRGB;
    const png_uint_32 most = kMostImageEdge;
    if (image_.width > most || image_.height > most) {
      png_image_free(&image_);  // no destructor follows what is thrown here
      throw_input(name + ": is " + std::to_string(image_.width) + " × " +
                  std::to_string(image_.height) + " pixels, at most " +
                  std::to_string(kMostImageEdge) + " along an edge are read.");
    }
  }
  ~Reader() { png_image_free(&image_); }
  Reader(const Reader&) = delete;
  Reader& operator=(const Reader&) = delete;

  [[nodiscard]] int width() const { return static_cast<int>(image_.width); }
  [[nodiscard]] int height() const { return static_cast<int>(image_.height); }
  [[nodiscard]] bool has_alpha() const { return (image_.format & PNG_FORMAT_FLAG_ALPHA) != 0; }
  void read(std::vector<std::uint8_t>& rgba) {
    image_.format = PNG_FORMAT_RGBA;
    check(png_image_finish_read(&image_, nullptr, rgba.data(), 0, nullptr));
  }

 private:
  void check(int done) const {
    if (done != 0) return;
    throw_input(name_ + ": cannot be read as PNG (" + image_.message +
                "). Is it truncated, or another format? Save it as PNG.");
  }

  png_image image_{};
  const std::string& name_;
};

}  // namespace

Bitmap::Bitmap(int image_width, int image_height) : width(image_width), height(image_height) {
  rgba.resize(4 * pixels());
}

Bitmap parse_png(std::span<const std::byte> bytes, const std::string& name) {
  Reader reader(bytes, name);
  Bitmap bitmap(reader.width(), reader.height());
  bitmap.has_alpha = reader.has_alpha();
  reader.read(bitmap.rgba);
  return bitmap;
}

Bitmap read_png(const std::filesystem::path& path) {
  return parse_png(read_file(path, std::uint64_t{1} << 30U), path.string());
}

std::array<int, 2> png_size(std::span<const std::byte> bytes, const std::string& name) {
  const Reader reader(bytes, name);
  return {reader.width(), reader.height()};
}

void write_png(const std::filesystem::path& path, const Bitmap& bitmap) {
  png_image image{};
  image.version = PNG_IMAGE_VERSION;
  image.width = static_cast<png_uint_32>(bitmap.width);
  image.height = static_cast<png_uint_32>(bitmap.height);
  image.format = bitmap.has_alpha ? PNG_FORMAT_RGBA : PNG_FORMAT_RGB;
  std::vector<std::uint8_t> rgb;
  const std::uint8_t* pixels = bitmap.rgba.data();
  if (!bitmap.has_alpha) {
    rgb.resize(3 * bitmap.pixels());
    for (std::size_t i = 0; i < bitmap.pixels(); ++i) {
      std::memcpy(rgb.data() + 3 * i, pixels + 4 * i, 3);
    }
    pixels = rgb.data();
  }
  png_alloc_size_t size = 0;
  const auto fail = [&] {
    const std::string message = image.message;
    png_image_free(&image);
    throw_output(path.string() + ": the image could not be made: " + message + ".");
  };
  if (png_image_write_to_memory(&image, nullptr, &size, 0, pixels, 0, nullptr) == 0) fail();
  std::string bytes(size, '\0');
  if (png_image_write_to_memory(&image, bytes.data(), &size, 0, pixels, 0, nullptr) == 0) fail();
  write_file(path, std::string_view(bytes).substr(0, size));
}

}  // namespace matterfit::capture
