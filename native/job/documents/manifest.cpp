// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/documents/manifest.hpp"

#include <fstream>
#include <vector>

#include "base/error.hpp"
#include "base/file.hpp"
#include "base/hash.hpp"

namespace matterfit::job {
namespace {

namespace fs = std::filesystem;

constexpr const char* kFileName = "manifest.json";

std::string content_hash(const fs::path& path, std::uint64_t& size) {
  std::ifstream file(path, std::ios::binary);
  if (!file) throw_input(path.string() + ": cannot be read.");
  Hasher hasher;
  std::vector<char> part(std::size_t{1} << 20U);
  size = 0;
  while (file) {
    file.read(part.data(), static_cast<std::streamsize>(part.size()));
    const auto count = static_cast<std::size_t>(file.gcount());
    hasher.add(part.data(), count);
    size += count;
  }
  if (file.bad())
    throw_input(path.string() + ": reading fails after " + std::to_string(size) + " bytes.");
  return hasher.hex();
}

}  // namespace

/// A manifest from elsewhere must not make us touch files outside its folder.
bool stays_inside(const std::string& path) {
  const fs::path relative(path);
  if (path.empty() || relative.is_absolute() || relative.lexically_normal() != relative) {
    return false;
  }
  return *relative.begin() != ".." && path != kFileName && path != ".";
}

std::string format_manifest(const Manifest& manifest) {
  Json files = Json::object();
  for (const auto& [path, file] : manifest.files) {
    files[path] = {{"size", file.size}, {"hash", file.hash}, {"result", file.is_result}};
  }
  const Json json = {{"schema", kCacheSchema},
                     {"version", manifest.version},
                     {"task", manifest.task},
                     {"input_hash", manifest.input_hash},
                     {"inputs", manifest.inputs},
                     {"output_hash", manifest.output_hash},
                     {"compared_hash", manifest.compared_hash},
                     {"units", {{"length", "m"}, {"mass", "kg"}, {"time", "s"}}},
                     {"up", "z"},
                     {"fps", manifest.fps_given},
                     {"frames", {manifest.first_frame, manifest.end_frame}},
                     {"frames_done", manifest.frames_done},
                     {"frames_baked", manifest.frames_baked},
                     {"complete", manifest.complete},
                     {"grids", manifest.grids},
                     {"bodies", manifest.bodies},
                     {"files", files}};
  return json.dump(1, ' ', false, Json::error_handler_t::replace) + "\n";
}

Manifest parse_manifest(std::string_view text, const std::string& name) {
  const Json json = parse_json(text, name);
  JsonObject object(JsonValue(json, name));
  const JsonValue schema = object.require("schema");
  if (schema.string() != kCacheSchema) {
    schema.fail("\"" + std::string(kCacheSchema) + "\" (a newer version may have written it)");
  }
  Manifest manifest;
  manifest.version = object.require("version").string();
  manifest.task = object.string("task", "");
  manifest.input_hash = object.require("input_hash").string();
  manifest.output_hash = object.string("output_hash", "");
  manifest.compared_hash = object.string("compared_hash", "");
  const JsonValue inputs = object.require("inputs");
  if (!inputs.json().is_object()) inputs.fail("an object { … }");
  for (const auto& [path, value] : inputs.json().items()) {
    if (!value.is_string()) inputs.fail("texts");
    manifest.inputs[path] = value.get<std::string>();
  }
  manifest.fps_given = object.require("fps").json();
  const JsonValue range = object.require("frames");
  const auto frames = range.items();
  if (frames.size() != 2) range.fail("[first, end)");
  manifest.first_frame = frames[0].integer(0, 10'000'000);
  manifest.end_frame = frames[1].integer(manifest.first_frame, 10'000'000);
  const int count = manifest.end_frame - manifest.first_frame;
  manifest.frames_done = object.require("frames_done").integer(0, count);
  manifest.frames_baked = object.integer("frames_baked", 0, 0, count);
  manifest.complete = object.boolean("complete", false);
  if (const auto grids = object.find("grids")) {
    for (const JsonValue& grid : grids->items()) manifest.grids.push_back(grid.string());
  }
  if (const auto bodies = object.find("bodies")) {
    for (const JsonValue& body : bodies->items()) manifest.bodies.push_back(body.string());
  }
  const JsonValue files = object.require("files");
  if (!files.json().is_object()) files.fail("an object { … }");
  for (const auto& [path, entry] : files.json().items()) {
    if (!stays_inside(path)) {
      files.refuse("'" + path + "' leaves the cache folder; the manifest is damaged.");
    }
    JsonObject file(JsonValue(entry, name + ": files['" + path + "']"));
    Manifest::File read;
    const JsonValue size = file.require("size");
    if (!size.json().is_number_unsigned()) size.fail("a number of bytes");
    read.size = size.json().get<std::uint64_t>();
    read.hash = file.require("hash").string();
    read.is_result = file.boolean("result", true);
    manifest.files[path] = read;
  }
  return manifest;
}

std::optional<Manifest> read_manifest(const fs::path& folder) {
  const fs::path path = folder / kFileName;
  if (!fs::exists(path)) return std::nullopt;
  const auto bytes = read_file(path, std::uint64_t{64} << 20U);
  return parse_manifest({reinterpret_cast<const char*>(bytes.data()), bytes.size()}, path.string());
}

void write_manifest(const fs::path& folder, const Manifest& manifest) {
  write_file(folder / kFileName, format_manifest(manifest));
}

void record_file(Manifest& manifest, const fs::path& folder, const std::string& path,
                 bool is_result) {
  Manifest::File file;
  file.is_result = is_result;
  file.hash = content_hash(folder / path, file.size);
  manifest.files[path] = file;
}

void remove_file(Manifest& manifest, const fs::path& folder, const std::string& path) {
  if (manifest.files.erase(path) == 0 || !stays_inside(path)) return;
  std::error_code code;
  fs::remove(folder / path, code);
  if (code) throw_output((folder / path).string() + ": cannot remove: " + code.message() + ".");
}

std::string result_hash(const Manifest& manifest) {
  Hasher hasher;
  for (const auto& [path, file] : manifest.files) {
    if (file.is_result) hasher.add(path).add("\n").add(file.hash).add("\n");
  }
  return hasher.hex();
}

std::string fault_of(const fs::path& folder, const std::string& path, const Manifest::File& file) {
  std::error_code code;
  const std::uint64_t size = fs::file_size(folder / path, code);
  if (code) return "is missing";
  if (size != file.size) {
    return "has " + std::to_string(size) + " bytes, " + std::to_string(file.size) +
           " were written" + (size < file.size ? ": truncated" : "");
  }
  std::uint64_t unused = 0;
  return content_hash(folder / path, unused) == file.hash ? ""
                                                          : "has another content than was written";
}

std::vector<FileFault> verify_files(const Manifest& manifest, const fs::path& folder) {
  std::vector<FileFault> faults;
  for (const auto& [path, file] : manifest.files) {
    if (file.hash.empty()) continue;  // logs and checkpoints change behind the manifest's back
    const std::string what = fault_of(folder, path, file);
    if (!what.empty()) faults.push_back({path, what});
  }
  return faults;
}

}  // namespace matterfit::job
