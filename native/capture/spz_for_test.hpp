// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <gtest/gtest.h>
#include <zlib.h>

#include <cstddef>
#include <cstdint>
#include <vector>

/// SPZ files as bytes.
namespace matterfit::capture::spz_test {

using Bytes = std::vector<std::uint8_t>;

inline std::vector<std::byte> gzip(const Bytes& plain) {
  z_stream stream{};
  EXPECT_EQ(deflateInit2(&stream, 9, Z_DEFLATED, 16 + MAX_WBITS, 8, Z_DEFAULT_STRATEGY), Z_OK);
  std::vector<std::byte> packed(plain.size() + 256);
  Bytes input = plain;
  stream.next_in = input.data();
  stream.avail_in = static_cast<uInt>(input.size());
  stream.next_out = reinterpret_cast<Bytef*>(packed.data());
  stream.avail_out = static_cast<uInt>(packed.size());
  EXPECT_EQ(deflate(&stream, Z_FINISH), Z_STREAM_END);
  packed.resize(stream.total_out);
  deflateEnd(&stream);
  return packed;
}

inline Bytes spz_header(std::uint8_t version, std::uint8_t count, std::uint8_t degree,
                        std::uint8_t flags) {
  return {0x4e, 0x47, 0x53, 0x50, version, 0, 0, 0, count, 0, 0, 0, degree, 12, flags, 0};
}

}  // namespace matterfit::capture::spz_test
