// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfOutputFile.h>
#include <ImfTiledOutputFile.h>

#include <filesystem>
#include <map>
#include <string>
#include <vector>

/// Writes OpenEXR files by OpenEXR.
namespace matterfit::capture {

struct ExrForTest {
  int width = 0;  ///< of the display window, which begins at (3, 5)
  int height = 0;
  int margin = 0;  ///< how much smaller the data window is at each edge
  bool tiled = false;
  Imf::Compression compression = Imf::ZIP_COMPRESSION;
  Imf::PixelType type = Imf::HALF;
};

/// `at(channel, x, y)`: the value of a pixel, counted from the display window's corner.
template <class Value>
void write_exr(const std::filesystem::path& path, const ExrForTest& exr,
               const std::vector<std::string>& channels, const Value& at) {
  const Imath::Box2i display({3, 5}, {2 + exr.width, 4 + exr.height});
  const Imath::Box2i data({3 + exr.margin, 5 + exr.margin},
                          {2 + exr.width - exr.margin, 4 + exr.height - exr.margin});
  Imf::Header header(display, data);
  header.compression() = exr.compression;
  const std::size_t width = std::size_t(data.max.x - data.min.x + 1);
  const std::size_t height = std::size_t(data.max.y - data.min.y + 1);
  std::map<std::string, std::vector<float>> values;
  std::map<std::string, std::vector<half>> halves;
  Imf::FrameBuffer buffer;
  for (const std::string& channel : channels) {
    header.channels().insert(channel, Imf::Channel(exr.type));
    for (std::size_t j = 0; j < height; ++j) {
      for (std::size_t i = 0; i < width; ++i) {
        const auto value =
            static_cast<float>(at(channel, int(i) + exr.margin, int(j) + exr.margin));
        values[channel].push_back(value);
        halves[channel].push_back(half(value));
      }
    }
    const bool is_half = exr.type == Imf::HALF;
    const std::size_t size = is_half ? sizeof(half) : sizeof(float);
    char* first = is_half ? reinterpret_cast<char*>(halves[channel].data())
                          : reinterpret_cast<char*>(values[channel].data());
    const auto back = std::ptrdiff_t(size) * (data.min.x + data.min.y * std::ptrdiff_t(width));
    buffer.insert(channel, Imf::Slice(exr.type, first - back, size, size * width));
  }
  if (exr.tiled) {
    header.setTileDescription(Imf::TileDescription(8, 8));
    Imf::TiledOutputFile file(path.c_str(), header);
    file.setFrameBuffer(buffer);
    file.writeTiles(0, file.numXTiles() - 1, 0, file.numYTiles() - 1);
  } else {
    Imf::OutputFile file(path.c_str(), header);
    file.setFrameBuffer(buffer);
    file.writePixels(int(height));
  }
}

}  // namespace matterfit::capture
