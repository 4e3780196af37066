// SPDX-License-Identifier: GPL-3.0-or-later
#include "material/neural/published_file.hpp"

#include <zip.h>

#include <array>
#include <bit>
#include <memory>
#include <string_view>
#include <vector>

#include "base/error.hpp"
#include "base/file.hpp"

namespace matterfit::material {
namespace {

static_assert(std::endian::native == std::endian::little);
/// The published files have 47 kB.
constexpr std::uint64_t kLargestArchive = std::uint64_t{1} << 20U;

struct Shape {
  std::size_t out;
  std::size_t in;
};
constexpr std::array<Shape, 3> kLayers{
    {{kNetHidden, kNetFeatures}, {kNetHidden, kNetHidden}, {kNetOutputs, kNetHidden}}};

struct ArchiveDeleter {
  void operator()(zip_t* archive) const { zip_discard(archive); }
};
struct EntryDeleter {
  void operator()(zip_file_t* entry) const { zip_fclose(entry); }
};
using Archive = std::unique_ptr<zip_t, ArchiveDeleter>;

Archive open_archive(std::span<const std::byte> bytes, const std::string& name) {
  zip_error_t error;
  zip_error_init(&error);
  zip_source_t* source = zip_source_buffer_create(bytes.data(), bytes.size(), 0, &error);
  zip_t* archive = source == nullptr ? nullptr : zip_open_from_source(source, ZIP_RDONLY, &error);
  if (archive == nullptr) {
    if (source != nullptr) zip_source_free(source);
    const std::string reason = zip_error_strerror(&error);
    zip_error_fini(&error);
    throw_input(name + ": is no PyTorch file (zip archive): " + reason + ". Is it truncated?");
  }
  zip_error_fini(&error);
  return Archive(archive);
}

/// Appends the float32 values of the entry that ends in /data/`index`.
void append_matrix(zip_t* archive, int index, const Shape& shape, const std::string& name,
                   std::vector<float>& to) {
  const std::string ending = "/data/" + std::to_string(index);
  const std::size_t bytes = 4 * shape.out * shape.in;
  const zip_int64_t count = zip_get_num_entries(archive, 0);
  for (zip_int64_t i = 0; i < count; ++i) {
    zip_stat_t stat;
    zip_stat_init(&stat);
    if (zip_stat_index(archive, static_cast<zip_uint64_t>(i), 0, &stat) != 0) continue;
    if ((stat.valid & ZIP_STAT_NAME) == 0 || (stat.valid & ZIP_STAT_SIZE) == 0) continue;
    if (!std::string_view(stat.name).ends_with(ending)) continue;
    if (stat.size != bytes) {
      throw_input(name + ": '" + stat.name + "' has " + std::to_string(stat.size) +
                  " bytes, expected " + std::to_string(bytes) + " (" + std::to_string(shape.out) +
                  " × " + std::to_string(shape.in) + " float32). These are other networks.");
    }
    const std::unique_ptr<zip_file_t, EntryDeleter> entry(
        zip_fopen_index(archive, static_cast<zip_uint64_t>(i), 0));
    const std::size_t begin = to.size();
    to.resize(begin + shape.out * shape.in);
    if (entry == nullptr ||
        zip_fread(entry.get(), to.data() + begin, bytes) != static_cast<zip_int64_t>(bytes)) {
      throw_input(name + ": '" + stat.name + "' cannot be read. The file is damaged.");
    }
    return;
  }
  throw_input(name + ": holds no '…" + ending +
              "'. Expected the six matrices of two bias-free nets 13-64-64-9.");
}

std::string layer_name(const char* net, std::size_t layer) {
  return std::string(net) + "." + std::to_string(layer);
}

}  // namespace

PublishedWeights parse_published_pt(std::span<const std::byte> bytes, const std::string& name) {
  const Archive archive = open_archive(bytes, name);
  PublishedWeights weights;
  int index = 0;
  for (std::vector<float>* net : {&weights.elastic, &weights.plastic}) {
    for (const Shape& shape : kLayers) append_matrix(archive.get(), index++, shape, name, *net);
  }
  check_published_weights(weights, name.c_str());
  return weights;
}

PublishedWeights read_published_pt(const std::filesystem::path& path) {
  return parse_published_pt(read_file(path, kLargestArchive), path.string());
}

Tensors published_tensors(const PublishedWeights& weights) {
  check_published_weights(weights, "published_tensors");
  Tensors out;
  const auto add = [&](const std::vector<float>& net, const char* net_name) {
    auto from = net.begin();
    for (std::size_t layer = 0; layer < kLayers.size(); ++layer) {
      const Shape& shape = kLayers[layer];
      const auto end = from + static_cast<std::ptrdiff_t>(shape.out * shape.in);
      out.tensors[layer_name(net_name, layer)] = {{shape.out, shape.in}, {from, end}};
      from = end;
    }
  };
  add(weights.elastic, "elastic");
  add(weights.plastic, "plastic");
  return out;
}

PublishedWeights published_weights(const Tensors& tensors, const std::string& name) {
  PublishedWeights out;
  const auto take = [&](std::vector<float>& net, const char* net_name) {
    net.reserve(kNetWeights);
    for (std::size_t layer = 0; layer < kLayers.size(); ++layer) {
      const std::string key = layer_name(net_name, layer);
      const auto found = tensors.tensors.find(key);
      const Shape& shape = kLayers[layer];
      if (found == tensors.tensors.end() ||
          found->second.shape != std::vector<std::size_t>{shape.out, shape.in}) {
        throw_input(name + ": tensor '" + key + "' is missing or not " + std::to_string(shape.out) +
                    " × " + std::to_string(shape.in) +
                    ". Is it a file of the published neural law?");
      }
      const std::vector<float>& values = found->second.values;
      net.insert(net.end(), values.begin(), values.end());
    }
  };
  take(out.elastic, "elastic");
  take(out.plastic, "plastic");
  check_published_weights(out, name.c_str());
  return out;
}

}  // namespace matterfit::material
