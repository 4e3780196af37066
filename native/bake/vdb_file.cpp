// SPDX-License-Identifier: GPL-3.0-or-later
#include "bake/vdb_file.hpp"

#include <openvdb/io/Archive.h>
#include <openvdb/io/Compression.h>

#include <exception>
#include <mutex>
#include <sstream>
#include <string_view>

#include "base/error.hpp"
#include "base/file.hpp"
#include "base/hash.hpp"

namespace matterfit::bake {
namespace {

/// io::Stream writes without grid offsets and io::File only to a path; what both are made of takes
/// a seekable stream.
class SeekableArchive : public openvdb::io::Archive {
 public:
  void write_grids(std::ostream& out, const openvdb::GridCPtrVec& grids,
                   const openvdb::MetaMap& metadata) const {
    Archive::write(out, grids, /*seekable=*/true, metadata);
  }
};

std::uint32_t flags(VdbCompression compression) {
  std::uint32_t result = openvdb::io::COMPRESS_ACTIVE_MASK;
  if (compression == VdbCompression::kBlosc && openvdb::io::Archive::hasBloscCompression()) {
    return result | openvdb::io::COMPRESS_BLOSC;
  }
  if (compression != VdbCompression::kNone && openvdb::io::Archive::hasZLibCompression()) {
    return result | openvdb::io::COMPRESS_ZIP;
  }
  return result;
}

}  // namespace

void initialize_openvdb() {
  static std::once_flag once;
  std::call_once(once, [] { openvdb::initialize(); });
}

std::string content_uuid(std::span<const std::byte> file) {
  Hasher hasher;
  const std::size_t before = std::min(file.size(), kVdbUuidOffset);
  hasher.add(file.data(), before);
  if (file.size() > kVdbUuidOffset + kVdbUuidSize) {
    const auto rest = file.subspan(kVdbUuidOffset + kVdbUuidSize);
    hasher.add(rest.data(), rest.size());
  }
  std::string uuid = hasher.hex();
  for (const std::size_t place : {8, 13, 18, 23}) uuid.insert(place, 1, '-');
  return uuid;
}

std::uint64_t write_vdb(const std::filesystem::path& path, const openvdb::GridCPtrVec& grids,
                        VdbCompression compression) {
  initialize_openvdb();
  std::ostringstream memory(std::ios_base::binary);
  openvdb::MetaMap metadata;
  metadata.insertMeta("creator",
                      openvdb::StringMetadata(std::string(kVdbCreator) + " " + MATTERFIT_VERSION));
  SeekableArchive archive;
  archive.setCompression(flags(compression));
  try {
    archive.write_grids(memory, grids, metadata);
  } catch (const std::exception& error) {
    throw_output(path.string() + ": OpenVDB could not write the grids: " + error.what() + ".");
  }
  if (!memory) throw_output(path.string() + ": not enough memory to assemble the file.");
  const std::string_view bytes = memory.view();
  const std::string uuid =
      content_uuid({reinterpret_cast<const std::byte*>(bytes.data()), bytes.size()});
  AtomicFile file(path);
  file.write(bytes.substr(0, kVdbUuidOffset));
  file.write(uuid);
  file.write(bytes.substr(kVdbUuidOffset + kVdbUuidSize));
  const std::uint64_t size = file.size();
  file.commit();
  return size;
}

}  // namespace matterfit::bake
