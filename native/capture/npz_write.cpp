// SPDX-License-Identifier: GPL-3.0-or-later
#include <zip.h>

#include <algorithm>
#include <limits>

#include "base/error.hpp"
#include "base/file.hpp"
#include "capture/npz.hpp"

namespace matterfit::capture {
namespace {

/// 1980-01-01, 00:00:00: the first that a zip directory can hold.
constexpr zip_uint16_t kDosDate = (1U << 5U) | 1U;
constexpr std::uint32_t kReplacement = 0xFFFD;

/// Code points of UTF-8; what is not valid becomes U+FFFD.
std::vector<std::uint32_t> code_points(const std::string& text) {
  std::vector<std::uint32_t> points;
  for (std::size_t i = 0; i < text.size();) {
    const auto lead = static_cast<std::uint8_t>(text[i++]);
    std::size_t more = 0;
    std::uint32_t c = lead;
    if (lead >= 0xF0 && lead < 0xF8) {
      more = 3;
      c = lead & 7U;
    } else if (lead >= 0xE0) {
      more = 2;
      c = lead & 15U;
    } else if (lead >= 0xC0) {
      more = 1;
      c = lead & 31U;
    }
    bool valid = lead < 0x80 || (lead >= 0xC2 && lead < 0xF5);
    for (; more > 0 && valid; --more) {
      valid = i < text.size() && (static_cast<std::uint8_t>(text[i]) & 0xC0U) == 0x80U;
      if (valid) c = (c << 6U) | (static_cast<std::uint8_t>(text[i++]) & 63U);
    }
    if (c > 0x10FFFF || (c >= 0xD800 && c < 0xE000)) valid = false;
    points.push_back(valid ? c : kReplacement);
  }
  return points;
}

struct Body {
  std::string descr;
  std::string bytes;
};

Body values_of(const Array& array) {
  const auto numbers = [](const char* descr, const auto& values) {
    Body body{descr, {}};
    if (!values.empty()) {
      body.bytes.assign(reinterpret_cast<const char*>(values.data()),
                        values.size() * sizeof(values[0]));
    }
    return body;
  };
  struct Visitor {
    const Array& array;
    const decltype(numbers)& pack;
    Body operator()(const std::vector<float>& v) const { return pack("<f4", v); }
    Body operator()(const std::vector<double>& v) const { return pack("<f8", v); }
    Body operator()(const std::vector<std::int32_t>& v) const { return pack("<i4", v); }
    Body operator()(const std::vector<std::int64_t>& v) const { return pack("<i8", v); }
    Body operator()(const std::vector<std::uint8_t>& v) const {
      return pack(array.boolean ? "|b1" : "|u1", v);
    }
    Body operator()(const std::vector<std::string>& texts) const {
      std::vector<std::vector<std::uint32_t>> rows;
      std::size_t length = 1;
      for (const std::string& text : texts) {
        rows.push_back(code_points(text));
        length = std::max(length, rows.back().size());
      }
      Body body{"<U" + std::to_string(length), {}};
      for (auto& row : rows) {
        row.resize(length, 0);
        body.bytes.append(reinterpret_cast<const char*>(row.data()), length * 4);
      }
      return body;
    }
  };
  return std::visit(Visitor{array, numbers}, array.data);
}

[[noreturn]] void fail_zip(zip_error_t* error) {
  throw_output(std::string("cannot write .npz: ") + zip_error_strerror(error) + ".");
}

}  // namespace

std::string format_npy(const Array& array) {
  std::size_t count = 1;
  for (const std::size_t n : array.shape) count *= n;
  if (count != array.size()) {
    throw_output("cannot write an array of shape " + array.shape_text() + " with " +
                 std::to_string(array.size()) + " values.");
  }
  Body body = values_of(array);
  std::string header = "{'descr': '" + body.descr +
                       "', 'fortran_order': False, 'shape': " + array.shape_text() + ", }";
  // The whole preamble is a multiple of 64 bytes and ends with a newline.
  const bool large = header.size() + 1 + 10 + 63 > std::numeric_limits<std::uint16_t>::max();
  const std::size_t preamble = large ? 12 : 10;
  header.append((64 - (preamble + header.size() + 1) % 64) % 64, ' ');
  header.push_back('\n');
  std::string out("\x93NUMPY", 6);
  out.push_back(large ? '\2' : '\1');
  out.push_back('\0');
  for (std::size_t i = 0; i < (large ? 4U : 2U); ++i) {
    out.push_back(static_cast<char>((header.size() >> (8 * i)) & 0xFFU));
  }
  out += header;
  out += body.bytes;
  return out;
}

std::string format_npz(const Arrays& arrays, const NpzWriteOptions& options) {
  zip_error_t error;
  zip_error_init(&error);
  zip_source_t* target = zip_source_buffer_create(nullptr, 0, 0, &error);
  if (target == nullptr) fail_zip(&error);
  zip_source_keep(target);
  struct SourceGuard {
    zip_source_t* source;
    ~SourceGuard() { zip_source_free(source); }
  } const target_guard{target};
  zip_t* archive = zip_open_from_source(target, ZIP_TRUNCATE, &error);
  if (archive == nullptr) {
    zip_source_free(target);
    fail_zip(&error);
  }
  struct ArchiveGuard {
    zip_t* archive;
    ~ArchiveGuard() {
      if (archive != nullptr) zip_discard(archive);
    }
  } guard{archive};

  std::vector<std::string> bodies;  // libzip reads them at zip_close().
  bodies.reserve(arrays.size());
  for (const auto& [name, array] : arrays) {
    const std::string& bytes = bodies.emplace_back(format_npy(array));
    zip_source_t* source = zip_source_buffer(archive, bytes.data(), bytes.size(), 0);
    if (source == nullptr) fail_zip(zip_get_error(archive));
    const zip_int64_t index =
        zip_file_add(archive, (name + ".npy").c_str(), source, ZIP_FL_ENC_UTF_8);
    if (index < 0) {
      zip_source_free(source);
      fail_zip(zip_get_error(archive));
    }
    const auto entry = static_cast<zip_uint64_t>(index);
    const zip_int32_t method = options.deflate ? ZIP_CM_DEFLATE : ZIP_CM_STORE;
    if (zip_set_file_compression(archive, entry, method, options.deflate ? 6 : 0) != 0 ||
        zip_file_set_dostime(archive, entry, 0, kDosDate, 0) != 0 ||
        zip_file_set_external_attributes(archive, entry, 0, ZIP_OPSYS_UNIX, 0100644U << 16U) != 0) {
      fail_zip(zip_get_error(archive));
    }
  }
  if (arrays.empty()) throw_output("cannot write .npz: there are no arrays.");
  if (zip_close(archive) != 0) fail_zip(zip_get_error(archive));
  guard.archive = nullptr;

  if (zip_source_open(target) != 0) fail_zip(zip_source_error(target));
  zip_stat_t stat;
  zip_stat_init(&stat);
  if (zip_source_stat(target, &stat) != 0) fail_zip(zip_source_error(target));
  std::string out(stat.size, '\0');
  std::size_t done = 0;
  while (done < out.size()) {
    const zip_int64_t got = zip_source_read(target, out.data() + done, out.size() - done);
    if (got <= 0) fail_zip(zip_source_error(target));
    done += static_cast<std::size_t>(got);
  }
  zip_source_close(target);
  return out;
}

void write_npz(const std::filesystem::path& path, const Arrays& arrays,
               const NpzWriteOptions& options) {
  write_file(path, format_npz(arrays, options));
}

}  // namespace matterfit::capture
