// SPDX-License-Identifier: GPL-3.0-or-later
#include "capture/exr.hpp"

#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfIO.h>
#include <ImfInputFile.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <exception>
#include <limits>
#include <stdexcept>
#include <string_view>
#include <vector>

#include "base/error.hpp"
#include "capture/byte_reader.hpp"
#include "capture/srgb.hpp"

namespace matterfit::capture {
namespace {

constexpr std::uint32_t kExrMagic = 20000630;
constexpr std::uint32_t kDeep = 1U << 11U;
constexpr std::uint32_t kMultiPart = 1U << 12U;
constexpr std::int32_t kFarthest = 1 << 20;  // of a window's corner
constexpr std::uint32_t kMostTileEdge = 4096;

struct Window {
  std::int32_t x0 = 0;
  std::int32_t y0 = 0;
  std::int32_t x1 = -1;
  std::int32_t y1 = -1;

  [[nodiscard]] int width() const { return x1 - x0 + 1; }
  [[nodiscard]] int height() const { return y1 - y0 + 1; }
};

struct Head {
  Window display;
  Window data;
};

std::string read_name(ByteReader& reader) {
  std::string name;
  for (char c = reader.read<char>("the head"); c != '\0'; c = reader.read<char>("the head")) {
    name.push_back(c);
  }
  return name;
}

Window read_window(ByteReader& reader, const std::string& name, const char* what) {
  Window window;
  for (std::int32_t* value : {&window.x0, &window.y0, &window.x1, &window.y1}) {
    *value = reader.read<std::int32_t>(what);
    if (*value < -kFarthest || *value > kFarthest) {
      throw_input(name + ": its " + what + " reaches to " + std::to_string(*value) + " pixels.");
    }
  }
  if (window.width() < 1 || window.height() < 1 || window.width() > kMostImageEdge ||
      window.height() > kMostImageEdge) {
    throw_input(name + ": its " + what + " is " + std::to_string(window.width()) + " × " +
                std::to_string(window.height()) + " pixels, from 1 to " +
                std::to_string(kMostImageEdge) + " along an edge are read.");
  }
  return window;
}

/// The head is looked through before OpenEXR reads it: OpenEXR would believe sizes beyond the file
/// and make room for them.
Head read_head(std::span<const std::byte> bytes, const std::string& name) {
  ByteReader reader(bytes, name);
  if (reader.read<std::uint32_t>("the head") != kExrMagic) {
    throw_input(name + ": cannot be read as OpenEXR (it does not begin as one).");
  }
  const auto version = reader.read<std::uint32_t>("the head");
  if ((version & (kDeep | kMultiPart)) != 0) {
    throw_input(name +
                ": is an OpenEXR file of several parts or of deep pixels, which is not read. Save "
                "it as one flat image.");
  }
  Head head;
  bool has_display = false;
  bool has_data = false;
  for (std::string key = read_name(reader); !key.empty(); key = read_name(reader)) {
    const std::string type = read_name(reader);
    const auto size = reader.read<std::int32_t>("the size of an attribute");
    if (size < 0) reader.fail("the attribute '" + key.substr(0, 40) + "' has a size below 0.");
    ByteReader value(reader.take(std::size_t(size), "an attribute"), name);
    if (key == "displayWindow") {
      head.display = read_window(value, name, "display window");
      has_display = true;
    } else if (key == "dataWindow") {
      head.data = read_window(value, name, "data window");
      has_data = true;
    } else if (key == "tiles") {
      for (int axis = 0; axis < 2; ++axis) {
        const auto edge = value.read<std::uint32_t>("the size of a tile");
        if (edge < 1 || edge > kMostTileEdge) {
          throw_input(name + ": has tiles of " + std::to_string(edge) + " pixels, at most " +
                      std::to_string(kMostTileEdge) + " are read.");
        }
      }
    }
  }
  if (!has_display || !has_data) {
    throw_input(name + ": cannot be read as OpenEXR (its head has no data and display window).");
  }
  return head;
}

/// OpenEXR's view of bytes in memory.
class MemoryStream : public Imf::IStream {
 public:
  MemoryStream(std::span<const std::byte> bytes, const std::string& name)
      : Imf::IStream(name.c_str()), bytes_(bytes) {}
  bool read(char into[], int count) override {
    if (count < 0 || std::size_t(count) > bytes_.size() - at_) {
      throw std::runtime_error("the file ends too early");
    }
    std::memcpy(into, bytes_.data() + at_, std::size_t(count));
    at_ += std::size_t(count);
    return at_ < bytes_.size();
  }
  std::uint64_t tellg() override { return at_; }
  void seekg(std::uint64_t position) override {
    if (position > bytes_.size()) throw std::runtime_error("the file ends too early");
    at_ = std::size_t(position);
  }

 private:
  std::span<const std::byte> bytes_;
  std::size_t at_ = 0;
};

/// A row of the data window, channel by channel.
class Rows {
 public:
  Rows(Imf::InputFile& file, const Window& data, const std::string& name)
      : file_(file), data_(data) {
    const Imf::ChannelList& channels = file.header().channels();
    const bool colour = channels.findChannel("R") != nullptr &&
                        channels.findChannel("G") != nullptr &&
                        channels.findChannel("B") != nullptr;
    if (!colour && channels.findChannel("Y") == nullptr) {
      std::string list;
      for (auto at = channels.begin(); at != channels.end() && list.size() < 200; ++at) {
        list += std::string(list.empty() ? "" : ", ") + at.name();
      }
      throw_input(name + ": has neither the channels R, G and B nor Y; it has " + list +
                  ". Save it as OpenEXR of one layer.");
    }
    has_alpha_ = channels.findChannel("A") != nullptr;
    const char* names[] = {colour ? "R" : "Y", colour ? "G" : "Y", colour ? "B" : "Y", "A"};
    Imf::FrameBuffer buffer;
    for (std::size_t c = 0; c < 4; ++c) {
      values_[c].assign(std::size_t(data.width()), c == 3 ? 1.0F : 0.0F);
      source_[c] = c < 3 && !colour ? 0 : c;
      if (source_[c] != c || (c == 3 && !has_alpha_)) continue;
      const Imf::Channel& channel = *channels.findChannel(names[c]);
      if (channel.xSampling != 1 || channel.ySampling != 1) {
        throw_input(name + ": its channel " + names[c] +
                    " is coarser than the image, which is not read. Save it as RGB.");
      }
      char* first = reinterpret_cast<char*>(values_[c].data());
      buffer.insert(names[c],
                    Imf::Slice(Imf::FLOAT, first - std::ptrdiff_t(sizeof(float)) * data.x0,
                               sizeof(float), 0));
    }
    file_.setFrameBuffer(buffer);
  }

  [[nodiscard]] bool has_alpha() const { return has_alpha_; }
  void read(int y) { file_.readPixels(y); }
  [[nodiscard]] double value(std::size_t channel, int x) const {
    return values_[source_[channel]][std::size_t(x - data_.x0)];
  }

 private:
  Imf::InputFile& file_;
  Window data_;
  std::array<std::vector<float>, 4> values_;
  std::array<std::size_t, 4> source_{};
  bool has_alpha_ = false;
};

Bitmap decode(std::span<const std::byte> bytes, const Head& head, const std::string& name) {
  MemoryStream stream(bytes, name);
  Imf::InputFile file(stream, 0);
  const Imath::Box2i& window = file.header().dataWindow();
  if (window.min != Imath::V2i(head.data.x0, head.data.y0) ||
      window.max != Imath::V2i(head.data.x1, head.data.y1)) {
    throw std::runtime_error("its head says two things of the data window");
  }
  Rows rows(file, head.data, name);
  const Window& display = head.display;
  Bitmap bitmap(display.width(), display.height());
  bitmap.has_alpha = rows.has_alpha();
  bitmap.was_light = true;
  if (!bitmap.has_alpha) {
    for (std::size_t i = 0; i < bitmap.pixels(); ++i) bitmap.rgba[4 * i + 3] = 255;
  }
  const int x0 = std::max(display.x0, head.data.x0);
  const int x1 = std::min(display.x1, head.data.x1);
  for (int y = std::max(display.y0, head.data.y0); y <= std::min(display.y1, head.data.y1); ++y) {
    rows.read(y);
    for (int x = x0; x <= x1; ++x) {
      std::uint8_t* rgba =
          bitmap.rgba.data() + 4 * (std::size_t(y - display.y0) * std::size_t(bitmap.width) +
                                    std::size_t(x - display.x0));
      const double given = rows.value(3, x);
      const double alpha = std::isnan(given) ? 0.0 : std::clamp(given, 0.0, 1.0);
      const double scale = alpha > 0.0 ? 1.0 / alpha : 1.0;
      for (std::size_t c = 0; c < 3; ++c) rgba[c] = byte_of_linear(scale * rows.value(c, x));
      rgba[3] = static_cast<std::uint8_t>(std::lround(255.0 * alpha));
    }
  }
  return bitmap;
}

}  // namespace

Bitmap parse_exr(std::span<const std::byte> bytes, const std::string& name) {
  const Head head = read_head(bytes, name);
  try {
    return decode(bytes, head, name);
  } catch (const Error&) {
    throw;
  } catch (const std::exception& error) {
    throw_input(name + ": cannot be read as OpenEXR (" + error.what() +
                "). Is it truncated? Save it again, or as PNG.");
  }
}

std::array<int, 2> exr_size(std::span<const std::byte> bytes, const std::string& name) {
  const Head head = read_head(bytes, name);
  return {head.display.width(), head.display.height()};
}

}  // namespace matterfit::capture
