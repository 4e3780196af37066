// SPDX-License-Identifier: GPL-3.0-or-later
#include "capture/jpeg.hpp"

#include <jpeglib.h>  // NOLINT: after <cstdio>

#include <csetjmp>
#include <cstdio>  // jpeglib.h needs it
#include <vector>

#include "base/error.hpp"

namespace matterfit::capture {
namespace {

/// Small files of very many scans only cost time.
constexpr int kMostScans = 500;

/// libjpeg's way out of an error.
struct Failure {
  jpeg_error_mgr manager;
  std::jmp_buf back;
  char message[JMSG_LENGTH_MAX];
};

void leave(j_common_ptr info) {
  auto* failure = reinterpret_cast<Failure*>(info->err);
  (*info->err->format_message)(info, failure->message);
  std::longjmp(failure->back, 1);
}

/// A warning, a level below 0, says that data are damaged or missing.
void warned(j_common_ptr info, int level) {
  if (level < 0) leave(info);
}

void look_at_scans(j_common_ptr info) {
  if (reinterpret_cast<j_decompress_ptr>(info)->input_scan_number <= kMostScans) return;
  auto* failure = reinterpret_cast<Failure*>(info->err);
  std::snprintf(failure->message, sizeof(failure->message), "more than %d scans", kMostScans);
  std::longjmp(failure->back, 1);
}

/// No object with a destructor lives in a function that calls setjmp().
class Decoder {
 public:
  Decoder(std::span<const std::byte> bytes, const std::string& name) : name_(name) {
    info_.err = jpeg_std_error(&failure_.manager);
    failure_.manager.error_exit = leave;
    failure_.manager.emit_message = warned;
    if (!begin(reinterpret_cast<const unsigned char*>(bytes.data()), bytes.size())) {
      jpeg_destroy_decompress(&info_);
      refuse();
    }
    if (info_.image_width > kMostImageEdge || info_.image_height > kMostImageEdge) {
      const std::string size =
          std::to_string(info_.image_width) + " × " + std::to_string(info_.image_height);
      jpeg_destroy_decompress(&info_);
      throw_input(name + ": is " + size + " pixels, at most " + std::to_string(kMostImageEdge) +
                  " along an edge are read.");
    }
  }
  ~Decoder() { jpeg_destroy_decompress(&info_); }
  Decoder(const Decoder&) = delete;
  Decoder& operator=(const Decoder&) = delete;

  [[nodiscard]] std::array<int, 2> size() const {
    return {static_cast<int>(info_.image_width), static_cast<int>(info_.image_height)};
  }
  /// Rows of three bytes a pixel.
  void read(std::vector<std::uint8_t>& rgb) {
    if (!read_rows(rgb.data())) refuse();
  }

 private:
  bool begin(const unsigned char* bytes, std::size_t count) {
    if (setjmp(failure_.back) != 0) return false;
    jpeg_create_decompress(&info_);
    info_.progress = &progress_;
    progress_.progress_monitor = look_at_scans;
    jpeg_mem_src(&info_, bytes, static_cast<unsigned long>(count));
    jpeg_read_header(&info_, TRUE);
    return true;
  }
  bool read_rows(std::uint8_t* rgb) {
    if (setjmp(failure_.back) != 0) return false;
    info_.out_color_space = JCS_RGB;
    jpeg_start_decompress(&info_);
    while (info_.output_scanline < info_.output_height) {
      JSAMPROW row = rgb + std::size_t(3) * info_.output_width * info_.output_scanline;
      jpeg_read_scanlines(&info_, &row, 1);
    }
    jpeg_finish_decompress(&info_);
    return true;
  }
  [[noreturn]] void refuse() const {
    throw_input(name_ + ": cannot be read as JPEG (" + failure_.message +
                "). Is it truncated, or of four colours (CMYK)? Save it again as RGB, or as PNG.");
  }

  jpeg_decompress_struct info_{};
  jpeg_progress_mgr progress_{};
  Failure failure_{};
  const std::string& name_;
};

}  // namespace

Bitmap parse_jpeg(std::span<const std::byte> bytes, const std::string& name) {
  Decoder decoder(bytes, name);
  const auto [width, height] = decoder.size();
  Bitmap bitmap(width, height);
  std::vector<std::uint8_t> rgb(3 * bitmap.pixels());
  decoder.read(rgb);
  for (std::size_t i = 0; i < bitmap.pixels(); ++i) {
    for (std::size_t c = 0; c < 3; ++c) bitmap.rgba[4 * i + c] = rgb[3 * i + c];
    bitmap.rgba[4 * i + 3] = 255;
  }
  return bitmap;
}

std::array<int, 2> jpeg_size(std::span<const std::byte> bytes, const std::string& name) {
  return Decoder(bytes, name).size();
}

}  // namespace matterfit::capture
