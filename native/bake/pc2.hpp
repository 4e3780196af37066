// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <filesystem>
#include <span>

#include "base/vec.hpp"

namespace matterfit::bake {

/// Writes a point cache (PC2) frame by frame: header of 32 bytes ("POINTCACHE2\0", int32 version 1,
/// int32 points, float32 start, float32 sample rate, int32 samples), then samples × points × 3
/// float32, little endian. May pass 4 GB.
///
/// Frames gather in `PATH.partial`, whose header counts no samples until finish(), which writes the
/// count, flushes and renames. The partial file stays when the writer is destroyed before finish()
/// (a cancelled or killed bake), so that resume() can go on; the bytes are then those of an
/// unbroken run. Errors are Error(kOutput) and name path and reason.
class Pc2Writer {
 public:
  struct Options {
    std::size_t points = 0;
    float start_frame = 1.0F;  ///< scene frame of the first sample
    float sample_rate = 1.0F;  ///< frames from one sample to the next
  };

  /// Starts anew; a partial file of the same name is replaced.
  Pc2Writer(std::filesystem::path path, const Options& options);

  /// Goes on after `frames` samples of the partial file; later ones are cut off. Throws
  /// Error(kInput) if there is no partial file, if its header differs from `options`, or if it
  /// holds fewer complete samples.
  [[nodiscard]] static Pc2Writer resume(std::filesystem::path path, const Options& options,
                                        std::size_t frames);

  Pc2Writer(Pc2Writer&& other) noexcept;
  Pc2Writer& operator=(Pc2Writer&&) = delete;
  Pc2Writer(const Pc2Writer&) = delete;
  Pc2Writer& operator=(const Pc2Writer&) = delete;
  ~Pc2Writer();

  /// One sample, [m]; Error(kInput) if there are not `points` positions.
  void append(std::span<const Vec3f> positions);
  /// fsync: what was appended survives a crash of the machine. Call before a checkpoint that counts
  /// on it.
  void flush();
  [[nodiscard]] std::size_t frames() const noexcept { return frames_; }
  void finish();

  [[nodiscard]] static std::filesystem::path partial_path(const std::filesystem::path& path);

 private:
  Pc2Writer(std::filesystem::path path, const Options& options, int descriptor, std::size_t frames);
  void write(std::uint64_t offset, const void* data, std::size_t bytes);
  void write_header(std::int32_t samples);

  std::filesystem::path path_;
  Options options_;
  int descriptor_ = -1;
  std::size_t frames_ = 0;
};

}  // namespace matterfit::bake
