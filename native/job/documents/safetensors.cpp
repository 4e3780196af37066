// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/documents/safetensors.hpp"

#include <bit>
#include <cstring>

#include "base/error.hpp"
#include "job/documents/json_reader.hpp"

namespace matterfit::job {
namespace {

static_assert(std::endian::native == std::endian::little);
constexpr std::size_t kAlignment = 8;
constexpr std::size_t kLargestHeader = std::size_t{16} << 20U;

}  // namespace

std::string format_safetensors(const Tensors& tensors) {
  Json header = Json::object();
  if (!tensors.metadata.empty()) header["__metadata__"] = tensors.metadata;
  std::size_t offset = 0;
  for (const auto& [name, tensor] : tensors.tensors) {
    std::size_t count = 1;
    for (const std::size_t extent : tensor.shape) count *= extent;
    if (count != tensor.values.size()) {
      throw_input("tensor '" + name + "' has " + std::to_string(tensor.values.size()) +
                  " values, its shape says " + std::to_string(count) + ".");
    }
    const std::size_t bytes = 4 * count;
    header[name] = {
        {"dtype", "F32"}, {"shape", tensor.shape}, {"data_offsets", {offset, offset + bytes}}};
    offset += bytes;
  }
  std::string text = header.dump();
  text.resize((text.size() + kAlignment - 1) / kAlignment * kAlignment, ' ');
  const std::uint64_t length = text.size();
  std::string out(reinterpret_cast<const char*>(&length), sizeof length);
  out.reserve(sizeof length + text.size() + offset);
  out += text;
  for (const auto& [name, tensor] : tensors.tensors) {
    if (tensor.values.empty()) continue;
    out.append(reinterpret_cast<const char*>(tensor.values.data()), 4 * tensor.values.size());
  }
  return out;
}

Tensors parse_safetensors(std::span<const std::byte> bytes, const std::string& name) {
  std::uint64_t length = 0;
  if (bytes.size() < sizeof length) {
    throw_input(name + ": " + std::to_string(bytes.size()) +
                " bytes is too short for a safetensors file.");
  }
  std::memcpy(&length, bytes.data(), sizeof length);
  if (length > kLargestHeader || length > bytes.size() - sizeof length) {
    throw_input(name + ": offset 0: a header of " + std::to_string(length) +
                " bytes does not fit in a file of " + std::to_string(bytes.size()) +
                ". It is truncated, or no safetensors file.");
  }
  const auto* text = reinterpret_cast<const char*>(bytes.data()) + sizeof length;
  const Json header = parse_json({text, length}, name + ": offset 8");
  if (!header.is_object()) throw_input(name + ": offset 8: the header is no JSON object.");
  const std::span<const std::byte> data = bytes.subspan(sizeof length + length);
  Tensors result;
  for (const auto& [key, entry] : header.items()) {
    if (key == "__metadata__") {
      if (!entry.is_object()) throw_input(name + ": '__metadata__' is no JSON object.");
      for (const auto& [field, value] : entry.items()) {
        if (!value.is_string()) throw_input(name + ": metadata '" + field + "' is no text.");
        result.metadata[field] = value.get<std::string>();
      }
      continue;
    }
    JsonObject object(JsonValue(entry, name + ": '" + key + "'"));
    const JsonValue type = object.require("dtype");
    if (type.string() != "F32") type.fail("\"F32\"");
    Tensor tensor;
    const JsonValue shape = object.require("shape");
    std::uint64_t count = 1;
    for (const JsonValue& extent : shape.items()) {
      if (!extent.json().is_number_unsigned()) extent.fail("a whole number ≥ 0");
      const auto value = extent.json().get<std::uint64_t>();
      if (value > 0 && count > (std::uint64_t{1} << 48U) / value) shape.fail("a smaller shape");
      count *= value;
      tensor.shape.push_back(value);
    }
    const JsonValue offsets = object.require("data_offsets");
    const auto pair = offsets.items();
    if (pair.size() != 2 || !pair[0].json().is_number_unsigned() ||
        !pair[1].json().is_number_unsigned()) {
      offsets.fail("[begin, end)");
    }
    const auto begin = pair[0].json().get<std::uint64_t>();
    const auto end = pair[1].json().get<std::uint64_t>();
    if (begin > end || end > data.size() || end - begin != 4 * count) {
      offsets.refuse("bytes " + std::to_string(begin) + " to " + std::to_string(end) +
                     " do not fit the shape or the file's " + std::to_string(data.size()) +
                     " bytes of data. The file is truncated or damaged.");
    }
    tensor.values.resize(count);
    if (count > 0) std::memcpy(tensor.values.data(), data.data() + begin, end - begin);
    result.tensors.emplace(key, std::move(tensor));
  }
  return result;
}

}  // namespace matterfit::job
