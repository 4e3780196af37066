// SPDX-License-Identifier: GPL-3.0-or-later
#include "capture/mesh.hpp"

#include <charconv>
#include <cmath>
#include <limits>
#include <string_view>

#include "base/error.hpp"
#include "base/file.hpp"
#include "capture/npz.hpp"
#include "capture/ply.hpp"

namespace matterfit::capture {
namespace {

constexpr std::size_t kMaxVertices = std::numeric_limits<std::int32_t>::max();

std::string lower_extension(const std::filesystem::path& path) {
  std::string extension = path.extension().string();
  for (char& c : extension) {
    if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
  }
  return extension;
}

std::vector<std::int32_t> to_int32(const std::vector<std::int64_t>& values,
                                   const std::string& what) {
  std::vector<std::int32_t> out;
  out.reserve(values.size());
  for (const std::int64_t value : values) {
    if (value < std::numeric_limits<std::int32_t>::min() ||
        value > std::numeric_limits<std::int32_t>::max()) {
      throw_input(what + " holds " + std::to_string(value) + ", which is out of range.");
    }
    out.push_back(static_cast<std::int32_t>(value));
  }
  return out;
}

/// One line of an OBJ file, word by word.
class Words {
 public:
  explicit Words(std::string_view line) : line_(line) {}
  std::string_view next() {
    const auto begin = std::min(line_.find_first_not_of(" \t\r"), line_.size());
    const auto end = std::min(line_.find_first_of(" \t\r", begin), line_.size());
    const std::string_view word = line_.substr(begin, end - begin);
    line_.remove_prefix(end);
    return word;
  }

 private:
  std::string_view line_;
};

class ObjParser {
 public:
  ObjParser(std::string_view text, const std::string& name) : text_(text), name_(name) {}

  Mesh parse() {
    std::size_t begin = 0;
    while (begin < text_.size()) {
      ++line_;
      const std::size_t end = std::min(text_.find('\n', begin), text_.size());
      Words words(text_.substr(begin, end - begin));
      const std::string_view kind = words.next();
      if (kind == "v") vertex(words);
      if (kind == "f") face(words);
      begin = end + 1;
    }
    return std::move(mesh_);
  }

 private:
  [[noreturn]] void fail(const std::string& reason) const {
    throw_input(name_ + ": line " + std::to_string(line_) + ": " + reason);
  }
  void vertex(Words& words) {
    Vec3f position;
    for (int axis = 0; axis < 3; ++axis) {
      std::string_view word = words.next();
      if (word.starts_with('+')) word.remove_prefix(1);
      double value = 0.0;
      const auto done = std::from_chars(word.data(), word.data() + word.size(), value);
      if (done.ptr != word.data() + word.size() || word.empty() ||
          (done.ec != std::errc() && done.ec != std::errc::result_out_of_range)) {
        fail("a vertex needs three numbers.");
      }
      position[axis] = static_cast<float>(value);
    }
    if (mesh_.vertices.size() == kMaxVertices) fail("too many vertices.");
    mesh_.vertices.push_back(position);
  }
  void face(Words& words) {
    std::int32_t size = 0;
    for (std::string_view word = words.next(); !word.empty(); word = words.next()) {
      if (word.starts_with('#')) break;
      const std::string_view index = word.substr(0, word.find('/'));
      std::int64_t value = 0;
      const auto done = std::from_chars(index.data(), index.data() + index.size(), value);
      if (done.ec != std::errc() || done.ptr != index.data() + index.size()) {
        fail(std::string(word.substr(0, 40)) + " is no vertex of a face.");
      }
      // 1 is the first vertex of the file, −1 the latest.
      const auto count = static_cast<std::int64_t>(mesh_.vertices.size());
      const std::int64_t vertex = value < 0 ? count + value : value - 1;
      if (value == 0 || vertex < 0 || vertex > std::numeric_limits<std::int32_t>::max()) {
        fail("a face names vertex " + std::to_string(value) + " of " + std::to_string(count) + ".");
      }
      mesh_.face_vertices.push_back(static_cast<std::int32_t>(vertex));
      ++size;
    }
    if (size < 3) fail("a face needs at least three vertices.");
    mesh_.face_sizes.push_back(size);
  }

  std::string_view text_;
  std::string name_;
  std::size_t line_ = 0;
  Mesh mesh_;
};

std::vector<Vec3f> rows_of_three(const std::vector<float>& values) {
  std::vector<Vec3f> rows(values.size() / 3);
  for (std::size_t i = 0; i < rows.size(); ++i) {
    rows[i] = Vec3f(values[3 * i], values[3 * i + 1], values[3 * i + 2]);
  }
  return rows;
}

void require_columns(const Array& array, std::size_t columns, const std::string& what,
                     const char* expected) {
  if (array.shape.size() != 2 || array.shape[1] != columns) {
    throw_input(what + " has shape " + array.shape_text() + ", expected " + expected + ".");
  }
}

}  // namespace

void check_mesh(const Mesh& mesh, const std::string& name) {
  if (mesh.vertices.empty()) throw_input(name + ": the mesh has no vertices.");
  if (mesh.face_sizes.empty()) {
    throw_input(name + ": the mesh has no faces. A point cloud is given as `points`.");
  }
  for (std::size_t i = 0; i < mesh.vertices.size(); ++i) {
    if (!mesh.vertices[i].allFinite()) {
      throw_input(name + ": vertex " + std::to_string(i) + " is not finite.");
    }
  }
  std::size_t used = 0;
  for (std::size_t face = 0; face < mesh.face_sizes.size(); ++face) {
    const std::int32_t size = mesh.face_sizes[face];
    if (size < 3 || static_cast<std::size_t>(size) > mesh.face_vertices.size() - used) {
      throw_input(name + ": face " + std::to_string(face) + " states " + std::to_string(size) +
                  " vertices, but " + std::to_string(mesh.face_vertices.size() - used) +
                  " indices are left for it.");
    }
    for (std::int32_t k = 0; k < size; ++k) {
      const std::int32_t vertex = mesh.face_vertices[used++];
      if (vertex < 0 || static_cast<std::size_t>(vertex) >= mesh.vertices.size()) {
        throw_input(name + ": face " + std::to_string(face) + " names vertex " +
                    std::to_string(vertex) + " of " + std::to_string(mesh.vertices.size()) + ".");
      }
    }
  }
  if (used != mesh.face_vertices.size()) {
    throw_input(name + ": the faces use " + std::to_string(used) + " of " +
                std::to_string(mesh.face_vertices.size()) + " vertex indices.");
  }
  if (mesh.crease_edges.size() != 2 * mesh.crease_sharpness.size()) {
    throw_input(name + ": " + std::to_string(mesh.crease_edges.size() / 2) +
                " creased edges have " + std::to_string(mesh.crease_sharpness.size()) +
                " values of sharpness.");
  }
  for (std::size_t i = 0; i < mesh.crease_edges.size(); ++i) {
    const std::int32_t vertex = mesh.crease_edges[i];
    if (vertex < 0 || static_cast<std::size_t>(vertex) >= mesh.vertices.size() ||
        !(mesh.crease_sharpness[i / 2] >= 0.0F)) {
      throw_input(name + ": crease " + std::to_string(i / 2) +
                  " names a vertex that is not there, or its sharpness is negative.");
    }
  }
}

Mesh parse_mesh_ply(std::span<const std::byte> bytes, const std::string& name) {
  const Ply ply = parse_ply(bytes, name);
  Mesh mesh;
  const std::vector<double> positions = ply_positions(ply, name);
  mesh.vertices = rows_of_three(std::vector<float>(positions.begin(), positions.end()));
  const PlyElement* face = ply.find("face");
  const PlyProperty* indices = nullptr;
  if (face != nullptr) {
    indices = face->find("vertex_indices");
    if (indices == nullptr) indices = face->find("vertex_index");
  }
  if (indices == nullptr || !indices->is_list) {
    throw_input(name + ": has no faces (element 'face' with a list 'vertex_indices').");
  }
  mesh.face_vertices = to_int32(indices->integers(), name + ": 'vertex_indices'");
  mesh.face_sizes =
      to_int32(std::vector<std::int64_t>(indices->sizes.begin(), indices->sizes.end()),
               name + ": the faces");
  check_mesh(mesh, name);
  return mesh;
}

Mesh parse_mesh_obj(std::span<const std::byte> bytes, const std::string& name) {
  Mesh mesh =
      ObjParser(std::string_view(reinterpret_cast<const char*>(bytes.data()), bytes.size()), name)
          .parse();
  check_mesh(mesh, name);
  return mesh;
}

Mesh parse_mesh_npz(std::span<const std::byte> bytes, const std::string& name) {
  const Arrays arrays = parse_npz(bytes, name);
  const auto what = [&](const char* key) { return name + ": '" + key + "'"; };
  Mesh mesh;
  const Array& vertices = require(arrays, "vertices", name);
  require_columns(vertices, 3, what("vertices"), "(vertices, 3)");
  mesh.vertices = rows_of_three(vertices.floats(what("vertices")));
  mesh.face_sizes = to_int32(require(arrays, "face_sizes", name).integers(what("face_sizes")),
                             what("face_sizes"));
  mesh.face_vertices =
      to_int32(require(arrays, "face_vertices", name).integers(what("face_vertices")),
               what("face_vertices"));
  if (arrays.contains("crease_edges")) {
    const Array& edges = arrays.at("crease_edges");
    require_columns(edges, 2, what("crease_edges"), "(creases, 2)");
    mesh.crease_edges = to_int32(edges.integers(what("crease_edges")), what("crease_edges"));
    mesh.crease_sharpness =
        require(arrays, "crease_sharpness", name).floats(what("crease_sharpness"));
  }
  check_mesh(mesh, name);
  return mesh;
}

Mesh read_mesh(const std::filesystem::path& path) {
  const std::string extension = lower_extension(path);
  const std::string name = path.filename().string();
  if (extension == ".ply") return parse_mesh_ply(read_file(path), name);
  if (extension == ".obj") return parse_mesh_obj(read_file(path), name);
  if (extension == ".npz") return parse_mesh_npz(read_file(path), name);
  throw_input(name + ": a mesh is read from .ply, .obj or .npz, not from '" + extension + "'.");
}

void write_mesh_ply(const std::filesystem::path& path, const Mesh& mesh) {
  AtomicFile file(path);
  file.write("ply\nformat binary_little_endian 1.0\nelement vertex " +
             std::to_string(mesh.vertices.size()) +
             "\nproperty float x\nproperty float y\nproperty float z\nelement face " +
             std::to_string(mesh.face_sizes.size()) +
             "\nproperty list int int vertex_indices\nend_header\n");
  static_assert(sizeof(Vec3f) == 3 * sizeof(float));
  file.write(mesh.vertices.data(), mesh.vertices.size() * sizeof(Vec3f));
  std::vector<std::int32_t> rows;
  rows.reserve(mesh.face_sizes.size() + mesh.face_vertices.size());
  std::size_t used = 0;
  for (const std::int32_t size : mesh.face_sizes) {
    rows.push_back(size);
    for (std::int32_t k = 0; k < size; ++k) rows.push_back(mesh.face_vertices[used++]);
  }
  file.write(rows.data(), rows.size() * sizeof(std::int32_t));
  file.commit();
}

}  // namespace matterfit::capture
