// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/documents/neural_starts.hpp"

#include <map>
#include <span>

#include "base/error.hpp"
#include "base/file.hpp"
#include "job/documents/safetensors.hpp"
#include "job/neural_start_files.hpp"
#include "material/neural/published_file.hpp"

namespace matterfit::job {
namespace {

constexpr std::string_view kSuffix = ".safetensors";
constexpr std::string_view kPublishedSuffix = ".pt";
constexpr std::uint64_t kLargestFile = std::uint64_t{1} << 20U;

using Starts = std::map<std::string, std::shared_ptr<const material::IsotropicStart>>;

Starts shipped() {
  Starts starts;
  for (const NeuralStartFile& file : kNeuralStartFiles) {
    const std::string name(file.name);
    if (name == kLatentName || name.starts_with(kPublishedPrefix)) continue;
    starts[name] = material::isotropic_start(
        parse_safetensors(std::as_bytes(std::span(file.bytes, file.size)), name), name);
  }
  return starts;
}

const Starts& starts() {
  static const Starts all = shipped();
  return all;
}

using PublishedStarts = std::map<std::string, std::shared_ptr<const material::PublishedLaw>>;

PublishedStarts shipped_published() {
  PublishedStarts starts;
  for (const NeuralStartFile& file : kNeuralStartFiles) {
    if (!file.name.starts_with(kPublishedPrefix)) continue;
    const std::string name(file.name.substr(kPublishedPrefix.size()));
    const Tensors tensors =
        parse_safetensors(std::as_bytes(std::span(file.bytes, file.size)), name);
    starts[name] = material::make_published_law(material::published_weights(tensors, name), name);
  }
  return starts;
}

const PublishedStarts& published_starts() {
  static const PublishedStarts all = shipped_published();
  return all;
}

/// A start law of either map, by its name. Throws Error(kInput) that lists the names.
template <class Map>
typename Map::mapped_type start_named(const Map& starts, const std::string& name,
                                      const char* file) {
  const auto found = starts.find(name);
  if (found != starts.end()) return found->second;
  std::string known;
  for (const auto& [other, start] : starts) known += (known.empty() ? "" : ", ") + other;
  throw_input("there are no weights '" + name + "'. Use " + known + ", or a file " + file);
}

}  // namespace

std::shared_ptr<const material::IsotropicStart> neural_start(const std::string& name) {
  return start_named(starts(), name, "*.safetensors.");
}

std::shared_ptr<const material::PublishedLaw> published_start(const std::string& name) {
  return start_named(published_starts(), name, "*.safetensors, or *.pt as PyTorch saves it.");
}

std::shared_ptr<const material::LatentDecoder> latent_preset() {
  static const auto preset = [] {
    std::shared_ptr<const material::LatentDecoder> decoder;
    for (const NeuralStartFile& file : kNeuralStartFiles) {
      if (file.name != kLatentName) continue;
      decoder = material::latent_decoder(
          parse_safetensors(std::as_bytes(std::span(file.bytes, file.size)), kLatentName),
          kLatentName);
    }
    return decoder;
  }();
  if (!preset) throw_compute("the library was built without presets/neural/latent.safetensors.");
  return preset;
}

std::shared_ptr<const material::LatentDecoder> read_latent_file(const std::filesystem::path& path) {
  const auto bytes = read_file(path, kLargestFile);
  const Tensors tensors = parse_safetensors(bytes, path.filename().string());
  return material::latent_decoder(tensors, path.generic_string());
}

bool is_weights_file(std::string_view text) {
  return text.ends_with(kSuffix) || text.ends_with(kPublishedSuffix);
}

std::shared_ptr<const material::IsotropicStart> read_weights_file(
    const std::filesystem::path& path) {
  const auto bytes = read_file(path, kLargestFile);
  const Tensors tensors = parse_safetensors(bytes, path.filename().string());
  // The name is what a fitted document writes.
  return material::isotropic_start(tensors, path.generic_string());
}

std::shared_ptr<const material::PublishedLaw> read_published_file(
    const std::filesystem::path& path) {
  const std::string name = path.generic_string();
  if (name.ends_with(kPublishedSuffix)) {
    return material::make_published_law(material::read_published_pt(path), name);
  }
  const auto bytes = read_file(path, kLargestFile);
  const Tensors tensors = parse_safetensors(bytes, path.filename().string());
  return material::make_published_law(material::published_weights(tensors, name), name);
}

}  // namespace matterfit::job
