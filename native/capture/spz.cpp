// SPDX-License-Identifier: GPL-3.0-or-later
#include "capture/spz.hpp"

#include <zlib.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numbers>
#include <vector>

#include "base/error.hpp"
#include "capture/byte_reader.hpp"

namespace matterfit::capture {
namespace {

constexpr std::uint32_t kSpzMagic = 0x5053474e;
constexpr std::size_t kHeader = 16;
constexpr float kColourScale = 0.15F;
/// Deflate cannot pack better than this (zlib's technical notes: 1032 to 1).
constexpr std::size_t kBestRatio = 1032;
constexpr int kLargestDegree = 3;

/// A gzip stream that is unpacked piece by piece into memory that exists.
class Gunzip {
 public:
  Gunzip(std::span<const std::byte> bytes, const std::string& name) : name_(name) {
    if (bytes.size() > std::numeric_limits<uInt>::max()) throw_input(name_ + ": is above 4 GB.");
    // zlib reads and does not write there.
    stream_.next_in = reinterpret_cast<Bytef*>(const_cast<std::byte*>(bytes.data()));
    stream_.avail_in = static_cast<uInt>(bytes.size());
    constexpr int kGzip = 16;
    if (inflateInit2(&stream_, kGzip + MAX_WBITS) != Z_OK) throw_compute("zlib does not start.");
  }
  ~Gunzip() { inflateEnd(&stream_); }
  Gunzip(const Gunzip&) = delete;
  Gunzip& operator=(const Gunzip&) = delete;

  std::vector<std::byte> take(std::size_t count, const char* what) {
    std::vector<std::byte> piece(count);
    std::size_t done = 0;
    while (done < count) {
      const std::size_t room =
          std::min<std::size_t>(count - done, std::numeric_limits<uInt>::max());
      stream_.next_out = reinterpret_cast<Bytef*>(piece.data() + done);
      stream_.avail_out = static_cast<uInt>(room);
      const int status = inflate(&stream_, Z_NO_FLUSH);
      const std::size_t got = room - stream_.avail_out;
      done += got;
      if (done == count) break;
      if (status != Z_OK || got == 0) {
        throw_input(name_ + ": " + what + " cannot be unpacked: " +
                    (stream_.msg != nullptr ? stream_.msg : "the stream ends") +
                    ". Is it truncated, or no SPZ file of version 2 or 3?");
      }
    }
    return piece;
  }

 private:
  z_stream stream_{};
  const std::string& name_;
};

float byte_of(std::byte value) { return static_cast<float>(std::to_integer<std::uint8_t>(value)); }

float fixed_point(const std::byte* data, float unit) {
  const auto low = std::to_integer<std::uint32_t>(data[0]);
  const auto middle = std::to_integer<std::uint32_t>(data[1]);
  const auto high = std::to_integer<std::uint32_t>(data[2]);
  // In the upper bytes of a word, so that the shift back extends the sign.
  const auto value = static_cast<std::int32_t>(low << 8U | middle << 16U | high << 24U) >> 8;
  return static_cast<float>(value) * unit;
}

Eigen::Quaternionf first_three(const std::byte* data) {
  std::array<float, 3> q;
  float square = 0.0F;
  for (std::size_t k = 0; k < 3; ++k) {
    q[k] = byte_of(data[k]) / 127.5F - 1.0F;
    square += q[k] * q[k];
  }
  return {std::sqrt(std::max(0.0F, 1.0F - square)), q[0], q[1], q[2]};
}

Eigen::Quaternionf smallest_three(const std::byte* data) {
  auto packed = load<std::uint32_t>(data);
  const std::size_t largest = packed >> 30U;
  std::array<float, 4> q{};
  float square = 0.0F;
  for (std::size_t k = 4; k-- > 0;) {
    if (k == largest) continue;
    constexpr std::uint32_t kMagnitude = 511;
    const auto magnitude = static_cast<float>(packed & kMagnitude);
    q[k] =
        static_cast<float>(0.5 * std::numbers::sqrt2) * magnitude / static_cast<float>(kMagnitude);
    if ((packed & (kMagnitude + 1)) != 0) q[k] = -q[k];
    square += q[k] * q[k];
    packed >>= 10U;
  }
  q[largest] = std::sqrt(std::max(0.0F, 1.0F - square));
  return {q[3], q[0], q[1], q[2]};
}

}  // namespace

Splats parse_spz(std::span<const std::byte> bytes, const std::string& name) {
  Gunzip stream(bytes, name);
  const std::vector<std::byte> head = stream.take(kHeader, "the header");
  if (load<std::uint32_t>(head.data()) != kSpzMagic) {
    throw_input(name + ": does not begin as an SPZ file does.");
  }
  const auto version = load<std::uint32_t>(head.data() + 4);
  if (version != 2 && version != 3) {
    throw_input(name + ": is of SPZ version " + std::to_string(version) +
                ", expected 2 or 3. Save it as version 3, or convert it to PLY.");
  }
  const std::size_t count = load<std::uint32_t>(head.data() + 8);
  const int degree = std::to_integer<int>(head[12]);
  const int fraction = std::to_integer<int>(head[13]);
  if (count == 0) throw_input(name + ": holds no Gaussians.");
  if (degree > kLargestDegree) {
    throw_input(name + ": has spherical harmonics of degree " + std::to_string(degree) +
                ", expected 0 to 3. Convert it to PLY with fewer.");
  }
  if (fraction > 23) {
    throw_input(name + ": positions have " + std::to_string(fraction) +
                " bits after the point, expected 0 to 23.");
  }
  Splats splats;
  splats.sh_degree = degree;
  splats.antialiased = (std::to_integer<unsigned>(head[14]) & 1U) != 0;
  const std::size_t bands = splats.sh_bands();
  const std::size_t rotation_bytes = version == 2 ? 3 : 4;
  const std::size_t row = 9 + 1 + 3 + 3 + rotation_bytes + 3 * (bands - 1);
  if (count > kBestRatio * bytes.size() / row) {
    throw_input(name + ": claims " + std::to_string(count) + " Gaussians, more than its " +
                std::to_string(bytes.size()) + " bytes can hold.");
  }

  splats.means.resize(count);
  splats.scales.resize(count);
  splats.rotations.resize(count);
  splats.opacities.resize(count);
  splats.sh.resize(3 * bands * count);
  const float unit = std::ldexp(1.0F, -fraction);
  const std::vector<std::byte> positions = stream.take(9 * count, "the positions");
  const std::vector<std::byte> opacities = stream.take(count, "the opacities");
  const std::vector<std::byte> colours = stream.take(3 * count, "the colours");
  const std::vector<std::byte> scales = stream.take(3 * count, "the scales");
  const std::vector<std::byte> rotations = stream.take(rotation_bytes * count, "the rotations");
  const std::vector<std::byte> rest = stream.take(3 * (bands - 1) * count, "the harmonics");
  for (std::size_t i = 0; i < count; ++i) {
    for (std::size_t k = 0; k < 3; ++k) {
      const auto axis = static_cast<Eigen::Index>(k);
      splats.means[i][axis] = fixed_point(positions.data() + 9 * i + 3 * k, unit);
      splats.scales[i][axis] = std::exp(byte_of(scales[3 * i + k]) / 16.0F - 10.0F);
      splats.sh[3 * bands * i + k] = (byte_of(colours[3 * i + k]) / 255.0F - 0.5F) / kColourScale;
    }
    splats.opacities[i] = byte_of(opacities[i]) / 255.0F;
    const std::byte* rotation = rotations.data() + rotation_bytes * i;
    splats.rotations[i] =
        (version == 2 ? first_three(rotation) : smallest_three(rotation)).normalized();
    for (std::size_t k = 0; k < 3 * (bands - 1); ++k) {
      splats.sh[3 * bands * i + 3 + k] = (byte_of(rest[3 * (bands - 1) * i + k]) - 128.0F) / 128.0F;
    }
  }
  return splats;
}

}  // namespace matterfit::capture
