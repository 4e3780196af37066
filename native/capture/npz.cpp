// SPDX-License-Identifier: GPL-3.0-or-later
#include "capture/npz.hpp"

#include <zip.h>

#include <memory>

#include "base/error.hpp"
#include "base/file.hpp"

namespace matterfit::capture {
namespace {

/// Deflate cannot pack better than this (zlib's technical notes: 1032 to 1).
constexpr std::uint64_t kDeflateRatio = 1032;
constexpr std::uint64_t kHarmless = std::uint64_t{256} << 20U;
constexpr std::uint64_t kSuspiciousRatio = 100;

struct ArchiveDeleter {
  void operator()(zip_t* archive) const { zip_discard(archive); }
};
struct EntryDeleter {
  void operator()(zip_file_t* entry) const { zip_fclose(entry); }
};
using Archive = std::unique_ptr<zip_t, ArchiveDeleter>;

std::string describe(zip_error_t& error) {
  std::string text = zip_error_strerror(&error);
  zip_error_fini(&error);
  return text;
}

Archive open_archive(std::span<const std::byte> bytes, const std::string& name) {
  zip_error_t error;
  zip_error_init(&error);
  zip_source_t* source = zip_source_buffer_create(bytes.data(), bytes.size(), 0, &error);
  if (source == nullptr) throw_input(name + ": cannot be read: " + describe(error) + ".");
  zip_t* archive = zip_open_from_source(source, ZIP_RDONLY, &error);
  if (archive == nullptr) {
    zip_source_free(source);
    throw_input(name + ": is not a readable .npz (zip) archive: " + describe(error) +
                ". Is it truncated?");
  }
  zip_error_fini(&error);
  return Archive(archive);
}

struct ZipEntry {
  zip_uint64_t index = 0;
  std::string key;
  std::uint64_t size = 0;
};

/// The directory, with every stated size tested before anything is unpacked.
std::vector<ZipEntry> list_entries(zip_t* archive, std::uint64_t packed, const std::string& name,
                                   const NpzLimits& limits) {
  const zip_int64_t count = zip_get_num_entries(archive, 0);
  if (count < 0 || static_cast<std::uint64_t>(count) > limits.entries) {
    throw_input(name + ": holds " + std::to_string(count) + " entries, more than the limit of " +
                std::to_string(limits.entries) + ".");
  }
  std::vector<ZipEntry> entries;
  std::uint64_t total = 0;
  for (zip_uint64_t i = 0; i < static_cast<zip_uint64_t>(count); ++i) {
    zip_stat_t stat;
    zip_stat_init(&stat);
    constexpr zip_uint64_t kNeeded = ZIP_STAT_NAME | ZIP_STAT_SIZE | ZIP_STAT_COMP_SIZE |
                                     ZIP_STAT_COMP_METHOD | ZIP_STAT_ENCRYPTION_METHOD;
    if (zip_stat_index(archive, i, 0, &stat) != 0 || (stat.valid & kNeeded) != kNeeded) {
      throw_input(name + ": entry " + std::to_string(i) + " of the archive is damaged.");
    }
    const std::string entry_name = stat.name;
    if (!entry_name.ends_with(".npy")) continue;
    const std::string key = entry_name.substr(0, entry_name.size() - 4);
    const std::string what = name + ": '" + key + "'";
    if (stat.encryption_method != ZIP_EM_NONE) throw_input(what + " is encrypted.");
    if (stat.comp_method != ZIP_CM_STORE && stat.comp_method != ZIP_CM_DEFLATE) {
      throw_input(what + " is packed by method " + std::to_string(stat.comp_method) +
                  ", expected stored or deflate (numpy.savez or savez_compressed).");
    }
    if (stat.comp_size > packed ||
        (stat.comp_method == ZIP_CM_STORE && stat.size != stat.comp_size) ||
        stat.size / kDeflateRatio > stat.comp_size) {
      throw_input(what + " states " + std::to_string(stat.size) + " bytes unpacked from " +
                  std::to_string(stat.comp_size) + ", which cannot be. Is it damaged?");
    }
    if (stat.size > limits.bytes || total > limits.bytes - stat.size) {
      throw_input(what + ": the archive unpacks to more than the limit of " +
                  std::to_string(limits.bytes) + " bytes.");
    }
    total += stat.size;
    if (total > kHarmless && total / kSuspiciousRatio > packed) {
      throw_input(what + ": the archive unpacks to more than " + std::to_string(kSuspiciousRatio) +
                  " times its size; it is refused as a zip bomb. If it is not one, save it with "
                  "numpy.savez (not packed).");
    }
    entries.push_back({i, key, stat.size});
  }
  return entries;
}

std::vector<std::byte> unpack(zip_t* archive, const ZipEntry& entry, const std::string& what) {
  const std::unique_ptr<zip_file_t, EntryDeleter> file(zip_fopen_index(archive, entry.index, 0));
  if (file == nullptr) throw_input(what + " cannot be unpacked: " + zip_strerror(archive) + ".");
  std::vector<std::byte> bytes(entry.size);
  std::uint64_t done = 0;
  // One byte more than is stated: libzip compares the checksum when it meets the end.
  std::byte extra{};
  for (;;) {
    const bool full = done == entry.size;
    const zip_int64_t got = full ? zip_fread(file.get(), &extra, 1)
                                 : zip_fread(file.get(), bytes.data() + done, entry.size - done);
    if (got < 0) {
      throw_input(what + " is damaged: " + zip_file_strerror(file.get()) + ".");
    }
    if (got == 0) break;
    if (full) throw_input(what + " unpacks to more bytes than the archive states.");
    done += static_cast<std::uint64_t>(got);
  }
  if (done != entry.size) throw_input(what + " unpacks to fewer bytes than the archive states.");
  return bytes;
}

}  // namespace

Arrays parse_npz(std::span<const std::byte> bytes, const std::string& name,
                 const NpzLimits& limits) {
  const Archive archive = open_archive(bytes, name);
  Arrays arrays;
  for (const ZipEntry& entry : list_entries(archive.get(), bytes.size(), name, limits)) {
    const std::string what = name + ": '" + entry.key + "'";
    if (arrays.contains(entry.key)) throw_input(what + " is in the archive twice.");
    arrays.emplace(entry.key, parse_npy(unpack(archive.get(), entry, what), what, limits));
  }
  if (arrays.empty()) throw_input(name + ": is empty: it holds no arrays.");
  return arrays;
}

Arrays read_npz(const std::filesystem::path& path, const NpzLimits& limits) {
  const std::vector<std::byte> bytes = read_file(path, limits.bytes);
  const std::string name = path.filename().string();
  if (!bytes.empty() && bytes[0] == std::byte{0x93}) {
    Arrays arrays;
    arrays.emplace(kNpyName, parse_npy(bytes, name, limits));
    return arrays;
  }
  return parse_npz(bytes, name, limits);
}

const Array& require(const Arrays& arrays, const std::string& name, const std::string& source) {
  const auto found = arrays.find(name);
  if (found != arrays.end()) return found->second;
  std::string keys;
  for (const auto& [key, array] : arrays) keys += (keys.empty() ? "'" : ", '") + key + "'";
  throw_input(source + ": has no array '" + name + "'; it holds " +
              (keys.empty() ? std::string("none") : keys) + ".");
}

}  // namespace matterfit::capture
