// SPDX-License-Identifier: GPL-3.0-or-later
#include "bake/verify.hpp"

#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfInputFile.h>
#include <ImfIntAttribute.h>
#include <fcntl.h>
#include <openvdb/io/File.h>
#include <openvdb/openvdb.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <span>
#include <string_view>

#include "bake/attributes.hpp"
#include "bake/vdb_file.hpp"
#include "base/error.hpp"
#include "base/file.hpp"
#include "base/hash.hpp"
#include "capture/splats.hpp"

namespace matterfit::bake {
namespace {

/// A file opened for reading, with its size; descriptor < 0 and `problem` set if that failed.
struct OpenFile {
  int descriptor = -1;
  std::uint64_t size = 0;
  std::string problem;

  explicit OpenFile(const std::filesystem::path& path)
      : descriptor(::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK)) {
    if (descriptor < 0) {
      problem =
          errno == ENOENT ? "missing" : std::string("cannot be opened: ") + std::strerror(errno);
      return;
    }
    struct stat info {};
    if (::fstat(descriptor, &info) != 0 || !S_ISREG(info.st_mode)) {
      ::close(descriptor);
      descriptor = -1;
      problem = "not a regular file";
      return;
    }
    size = static_cast<std::uint64_t>(info.st_size);
  }
  ~OpenFile() {
    if (descriptor >= 0) ::close(descriptor);
  }
  OpenFile(const OpenFile&) = delete;
  OpenFile& operator=(const OpenFile&) = delete;

  /// Bytes read; fewer at the end of the file or on an error.
  [[nodiscard]] std::size_t read(void* data, std::size_t bytes) const {
    std::size_t done = 0;
    while (done < bytes) {
      const ssize_t count = ::read(descriptor, static_cast<char*>(data) + done, bytes - done);
      if (count < 0 && errno == EINTR) continue;
      if (count <= 0) break;
      done += static_cast<std::size_t>(count);
    }
    return done;
  }
};

std::string say(const std::filesystem::path& path, const std::string& what) {
  return path.string() + ": " + what + ". Bake it again.";
}

std::string truncated(std::uint64_t size, std::uint64_t expected) {
  return (size < expected ? "truncated: " : "too long: ") + std::to_string(size) + " bytes of " +
         std::to_string(expected);
}

bool hash_of(const OpenFile& file, std::string& hash) {
  Hasher hasher;
  std::vector<char> block(std::size_t{1} << 20U);
  std::uint64_t done = 0;
  while (done < file.size) {
    const std::size_t wanted =
        static_cast<std::size_t>(std::min<std::uint64_t>(block.size(), file.size - done));
    if (file.read(block.data(), wanted) != wanted) return false;
    hasher.add(block.data(), wanted);
    done += wanted;
  }
  hash = hasher.hex();
  return true;
}

std::string missing_grids(const std::vector<std::string>& present,
                          const std::vector<std::string>& wanted) {
  for (const std::string& name : wanted) {
    if (std::find(present.begin(), present.end(), name) == present.end()) {
      return "has no grid '" + name + "'";
    }
  }
  return {};
}

/// Reads every grid of a VDB; runs in the guarded child.
std::string read_all_grids(const std::filesystem::path& path,
                           const std::vector<std::string>& wanted) {
  openvdb::io::File file(path.string());
  file.setCopyMaxBytes(0);
  file.open(/*delayLoad=*/false);
  std::vector<std::string> present;
  const auto grids = file.getGrids();
  for (const auto& grid : *grids) {
    if (!grid) return "holds a grid that cannot be read";
    present.push_back(grid->getName());
  }
  return missing_grids(present, wanted);
}

std::string read_all_pixels(const std::filesystem::path& path, std::size_t points) {
  Imf::InputFile file(path.c_str(), /*numThreads=*/0);
  const Imf::Header& header = file.header();
  const auto window = header.dataWindow();
  const std::int64_t width = std::int64_t{window.max.x} - window.min.x + 1;
  const std::int64_t height = std::int64_t{window.max.y} - window.min.y + 1;
  if (width < 1 || height < 1 || width > 65536 || height > 1'000'000) {
    return "is " + std::to_string(width) + " by " + std::to_string(height) + " pixels";
  }
  if (points > 0) {
    const auto* count = header.findTypedAttribute<Imf::IntAttribute>(kTexturePoints);
    const TextureLayout layout = texture_layout(points);
    if (count == nullptr || count->value() != static_cast<int>(points) || width != layout.width ||
        height != layout.height) {
      return "is not of " + std::to_string(points) + " points";
    }
  }
  // One scan line after another into one buffer.
  std::vector<float> line(static_cast<std::size_t>(width));
  for (int y = window.min.y; y <= window.max.y; ++y) {
    Imf::FrameBuffer frame;
    for (auto channel = header.channels().begin(); channel != header.channels().end(); ++channel) {
      frame.insert(channel.name(),
                   Imf::Slice(Imf::FLOAT,
                              reinterpret_cast<char*>(line.data()) -
                                  static_cast<std::ptrdiff_t>(sizeof(float)) * window.min.x,
                              sizeof(float), 0));
    }
    file.setFrameBuffer(frame);
    file.readPixels(y, y);
  }
  return {};
}

}  // namespace

FileRecord record_file(const std::filesystem::path& folder, const std::filesystem::path& relative) {
  FileRecord record;
  record.path = relative.generic_string();
  const OpenFile file(folder / relative);
  if (file.descriptor < 0) throw_input((folder / relative).string() + ": " + file.problem + ".");
  record.size = file.size;
  if (!hash_of(file, record.hash)) {
    throw_input((folder / relative).string() + ": cannot be read to its end.");
  }
  return record;
}

std::optional<std::string> verify_file(const std::filesystem::path& folder,
                                       const FileRecord& record) {
  const OpenFile file(folder / record.path);
  if (file.descriptor < 0) return say(record.path, file.problem);
  if (file.size != record.size) return say(record.path, truncated(file.size, record.size));
  std::string hash;
  if (!hash_of(file, hash)) return say(record.path, "cannot be read to its end");
  if (hash != record.hash) return say(record.path, "its contents have changed since it was baked");
  return std::nullopt;
}

std::optional<std::string> verify_vdb(const std::filesystem::path& path,
                                      const std::vector<std::string>& grids,
                                      const GuardLimits& limits) {
  std::vector<std::byte> bytes;
  {
    const OpenFile file(path);
    if (file.descriptor < 0) return say(path, file.problem);
    constexpr std::string_view kMagic("\x20\x42\x44\x56\0\0\0\0", 8);
    constexpr std::size_t kSmallest = kVdbUuidOffset + kVdbUuidSize;
    std::array<char, 8> magic{};
    if (file.read(magic.data(), magic.size()) != magic.size() ||
        std::string_view(magic.data(), magic.size()) != kMagic) {
      return say(path, "not a VDB file");
    }
    if (file.size < kSmallest)
      return say(path, "truncated: " + std::to_string(file.size) + " bytes");
  }
  try {
    bytes = read_file(path);
  } catch (const Error& error) {
    return std::string(error.what());
  }
  const std::string_view uuid(reinterpret_cast<const char*>(bytes.data()) + kVdbUuidOffset,
                              kVdbUuidSize);
  const bool whole = uuid == content_uuid(bytes);
  if (!whole) {
    // Ours says so in the file's metadata, which follows the UUID.
    const std::string_view head(reinterpret_cast<const char*>(bytes.data()),
                                std::min<std::size_t>(bytes.size(), 512));
    if (head.find(std::string(kVdbCreator) + " ") != std::string_view::npos) {
      return say(path, "truncated or damaged: its contents do not match its own hash");
    }
  }
  bytes = {};
  if (whole && grids.empty()) return std::nullopt;
  initialize_openvdb();  // before the fork: it takes locks
  const auto problem = run_guarded([&] { return read_all_grids(path, grids); }, limits);
  if (!problem) return std::nullopt;
  return say(path, *problem);
}

std::optional<std::string> verify_pc2(const std::filesystem::path& path, std::size_t points,
                                      std::size_t frames) {
  const OpenFile file(path);
  if (file.descriptor < 0) return say(path, file.problem);
  std::array<char, 32> header{};
  if (file.read(header.data(), header.size()) != header.size()) {
    return say(path, truncated(file.size, header.size()));
  }
  std::int32_t version = 0;
  std::int32_t point_count = 0;
  std::int32_t samples = 0;
  std::memcpy(&version, header.data() + 12, 4);
  std::memcpy(&point_count, header.data() + 16, 4);
  std::memcpy(&samples, header.data() + 28, 4);
  if (std::memcmp(header.data(), "POINTCACHE2", 12) != 0 || version != 1 || point_count < 0 ||
      samples < 0) {
    return say(path, "not a point cache (PC2)");
  }
  if (static_cast<std::size_t>(point_count) != points ||
      static_cast<std::size_t>(samples) != frames) {
    return say(path, "holds " + std::to_string(samples) + " frames of " +
                         std::to_string(point_count) + " points, expected " +
                         std::to_string(frames) + " of " + std::to_string(points));
  }
  const std::uint64_t expected = 32 + std::uint64_t{12} * points * frames;
  if (file.size != expected) return say(path, truncated(file.size, expected));
  return std::nullopt;
}

std::optional<std::string> verify_exr(const std::filesystem::path& path, std::size_t points,
                                      const GuardLimits& limits) {
  {
    const OpenFile file(path);
    if (file.descriptor < 0) return say(path, file.problem);
  }
  const auto problem = run_guarded([&] { return read_all_pixels(path, points); }, limits);
  if (!problem) return std::nullopt;
  return say(path, *problem);
}

std::optional<std::string> verify_splat_ply(const std::filesystem::path& path, std::size_t count) {
  {
    const OpenFile file(path);
    if (file.descriptor < 0) return say(path, file.problem);
  }
  try {
    const capture::Splats splats = capture::read_splats(path);
    if (count > 0 && splats.size() != count) {
      return say(path, "holds " + std::to_string(splats.size()) + " splats, expected " +
                           std::to_string(count));
    }
  } catch (const Error& error) {
    return std::string(error.what());
  }
  return std::nullopt;
}

}  // namespace matterfit::bake
