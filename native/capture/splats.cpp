// SPDX-License-Identifier: GPL-3.0-or-later
// Conventions of the PLY files of 3D Gaussian Splatting (Kerbl et al. 2023), and the choice of a
// format by a file's name.
#include "capture/splats.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <cstddef>
#include <fstream>
#include <string_view>
#include <utility>

#include "base/error.hpp"
#include "base/file.hpp"
#include "capture/dot_splat.hpp"
#include "capture/ply.hpp"
#include "capture/spz.hpp"

namespace matterfit::capture {
namespace {

/// f_rest properties of degree 0 to 3: 3 ((d + 1)² − 1).
constexpr std::array<std::size_t, 4> kRestCounts = {0, 9, 24, 45};
/// Opacities of 0 and 1 have no finite logit.
constexpr float kOpacityMargin = 1e-6F;

class SplatColumns {
 public:
  SplatColumns(const Ply& ply, const std::string& name) : vertex_(ply.find("vertex")), name_(name) {
    if (vertex_ == nullptr) throw_input(name_ + ": has no element 'vertex'.");
  }
  [[nodiscard]] std::size_t count() const { return vertex_->count; }
  [[nodiscard]] bool has(const std::string& property) const {
    const PlyProperty* found = vertex_->find(property);
    return found != nullptr && !found->is_list;
  }
  [[nodiscard]] std::vector<float> require(const std::string& property) const {
    if (!has(property)) {
      throw_input(name_ + ": has no property '" + property +
                  "'. Is it a 3D Gaussian Splatting PLY?");
    }
    std::vector<float> values = vertex_->find(property)->floats();
    for (std::size_t i = 0; i < values.size(); ++i) {
      if (std::isnan(values[i]) || (std::isinf(values[i]) && property != "opacity")) {
        throw_input(name_ + ": row " + std::to_string(i) + ": '" + property + "' is not finite.");
      }
    }
    return values;
  }
  [[nodiscard]] std::size_t count_rest() const {
    return static_cast<std::size_t>(
        std::count_if(vertex_->properties.begin(), vertex_->properties.end(),
                      [](const PlyProperty& p) { return p.name.starts_with("f_rest_"); }));
  }

 private:
  const PlyElement* vertex_;
  std::string name_;
};

std::vector<Vec3f> three(const SplatColumns& columns, const std::array<std::string, 3>& keys) {
  std::vector<Vec3f> rows(columns.count());
  for (int axis = 0; axis < 3; ++axis) {
    const std::vector<float> values = columns.require(keys[static_cast<std::size_t>(axis)]);
    for (std::size_t i = 0; i < rows.size(); ++i) rows[i][axis] = values[i];
  }
  return rows;
}

void read_rotations(const SplatColumns& columns, Splats& splats, const std::string& name) {
  splats.rotations.assign(columns.count(), Eigen::Quaternionf::Identity());
  if (splats.isotropic && !columns.has("rot_0")) return;
  const auto w = columns.require("rot_0");
  const auto x = columns.require("rot_1");
  const auto y = columns.require("rot_2");
  const auto z = columns.require("rot_3");
  for (std::size_t i = 0; i < w.size(); ++i) {
    const Eigen::Quaterniond rotation(w[i], x[i], y[i], z[i]);
    if (!(rotation.norm() > 0.0)) {
      throw_input(name + ": row " + std::to_string(i) + ": the rotation is zero.");
    }
    splats.rotations[i] = rotation.normalized().cast<float>();
  }
}

void read_scales(const SplatColumns& columns, Splats& splats, const std::string& name) {
  splats.isotropic = columns.has("scale_0") && !columns.has("scale_1") && !columns.has("scale_2");
  const std::string second = splats.isotropic ? "scale_0" : "scale_1";
  const std::string third = splats.isotropic ? "scale_0" : "scale_2";
  splats.scales = three(columns, {"scale_0", second, third});
  for (std::size_t i = 0; i < splats.size(); ++i) {
    splats.scales[i] = splats.scales[i].array().exp();
    if (!splats.scales[i].allFinite()) {
      throw_input(name + ": row " + std::to_string(i) +
                  ": a scale overflows. Scales are stored as natural logarithms.");
    }
  }
}

void read_harmonics(const SplatColumns& columns, Splats& splats, const std::string& name) {
  const std::size_t rest = columns.count_rest();
  const auto degree = std::find(kRestCounts.begin(), kRestCounts.end(), rest);
  if (degree == kRestCounts.end()) {
    throw_input(name + ": has " + std::to_string(rest) +
                " properties f_rest_*, expected 0, 9, 24 or 45 (degree 0 to 3).");
  }
  splats.sh_degree = static_cast<int>(degree - kRestCounts.begin());
  const std::size_t bands = splats.sh_bands();
  splats.sh.resize(splats.size() * bands * 3);
  for (std::size_t channel = 0; channel < 3; ++channel) {
    for (std::size_t band = 0; band < bands; ++band) {
      const std::string key = band == 0
                                  ? "f_dc_" + std::to_string(channel)
                                  : "f_rest_" + std::to_string(channel * (bands - 1) + band - 1);
      const std::vector<float> values = columns.require(key);
      for (std::size_t i = 0; i < values.size(); ++i) {
        splats.sh[(i * bands + band) * 3 + channel] = values[i];
      }
    }
  }
}

/// What follows the last dot, in lower case.
std::string ending_of(const std::filesystem::path& path) {
  std::string ending = path.extension().string();
  for (char& c : ending) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return ending;
}

/// The splats of which `keep(number)` says so, in their order.
template <class Keep>
Splats kept_of(const Splats& splats, const Keep& keep) {
  const std::size_t numbers = 3 * splats.sh_bands();
  Splats kept;
  kept.sh_degree = splats.sh_degree;
  kept.isotropic = splats.isotropic;
  kept.antialiased = splats.antialiased;
  for (std::size_t i = 0; i < splats.size(); ++i) {
    if (!keep(i)) continue;
    kept.means.push_back(splats.means[i]);
    kept.rotations.push_back(splats.rotations[i]);
    kept.scales.push_back(splats.scales[i]);
    kept.opacities.push_back(splats.opacities[i]);
    const auto first = splats.sh.begin() + static_cast<std::ptrdiff_t>(numbers * i);
    kept.sh.insert(kept.sh.end(), first, first + static_cast<std::ptrdiff_t>(numbers));
  }
  return kept;
}

[[noreturn]] void refuse_kind(const std::filesystem::path& path, const std::string& what) {
  const std::string name = path.filename().string();
  throw_input(name + ": " + what +
              " not read. Convert it to PLY, for instance with PlayCanvas' splat-transform: "
              "splat-transform " +
              name + " " + path.stem().string() +
              (ending_of(path) == ".ply" ? "_plain.ply" : ".ply"));
}

/// Whether a PLY holds a chunk's numbers in 32 bits each.
bool is_packed(std::span<const std::byte> bytes) {
  constexpr std::size_t kHeader = 4096;
  const std::string_view text(reinterpret_cast<const char*>(bytes.data()),
                              std::min(bytes.size(), kHeader));
  return text.starts_with("ply") && text.find("packed_position") != std::string_view::npos;
}

}  // namespace

Splats parse_splats(std::span<const std::byte> bytes, const std::string& name) {
  const Ply ply = parse_ply(bytes, name);
  const SplatColumns columns(ply, name);
  Splats splats;
  splats.means = three(columns, {"x", "y", "z"});
  if (splats.means.empty()) throw_input(name + ": holds no Gaussians.");
  read_scales(columns, splats, name);
  read_rotations(columns, splats, name);
  splats.opacities = columns.require("opacity");
  for (float& opacity : splats.opacities) opacity = 1.0F / (1.0F + std::exp(-opacity));
  read_harmonics(columns, splats, name);
  return splats;
}

Splats read_splats(const std::filesystem::path& path) {
  const std::string name = path.filename().string();
  const std::string ending = ending_of(path);
  if (ending == ".splat") return parse_dot_splat(read_file(path), name);
  if (ending == ".spz") return parse_spz(read_file(path), name);
  if (ending == ".ksplat" || ending == ".sog") refuse_kind(path, ending + " files are");
  if (name == "meta.json") refuse_kind(path, "SOG scenes are");
  const std::vector<std::byte> bytes = read_file(path);
  if (is_packed(bytes)) refuse_kind(path, "packed Gaussians (SuperSplat's compressed PLY) are");
  return parse_splats(bytes, name);
}

bool is_of_splats(const std::filesystem::path& path) {
  const std::string ending = ending_of(path);
  const auto named = {".splat", ".spz", ".ksplat", ".sog"};
  if (std::ranges::find(named, ending) != named.end()) return true;
  if (ending != ".ply") return false;
  constexpr std::size_t kHeader = 8192;
  std::string header(kHeader, ' ');
  std::ifstream file(path, std::ios::binary);
  file.read(header.data(), static_cast<std::streamsize>(kHeader));
  header.resize(std::min(header.size(), header.find("end_header")));
  return is_packed(std::as_bytes(std::span(header))) ||
         header.find(" opacity") != std::string::npos;
}

Splats cropped(const Splats& splats, const Eigen::AlignedBox3d& box) {
  Eigen::AlignedBox3d all;
  Splats kept = kept_of(splats, [&](std::size_t i) {
    const Vec3d centre = splats.means[i].cast<double>();
    all.extend(centre);
    return box.contains(centre);
  });
  if (kept.size() > 0) return kept;
  if (splats.size() == 0) throw_input("the file holds no splats.");
  const auto text = [](const Vec3d& x) {
    return fmt::format("({:.3g}, {:.3g}, {:.3g})", x.x(), x.y(), x.z());
  };
  throw_input("no splat lies in the crop box from " + text(box.min()) + " to " + text(box.max()) +
              ": in the file they lie from " + text(all.min()) + " to " + text(all.max()) + ".");
}

Splats opaque(Splats splats, double threshold) {
  if (!(threshold > 0.0)) return splats;
  Splats kept =
      kept_of(splats, [&](std::size_t i) { return double(splats.opacities[i]) >= threshold; });
  if (kept.size() > 0) return kept;
  if (splats.size() == 0) throw_input("the file holds no splats.");
  throw_input(
      fmt::format("no splat has an opacity of {:.3g} or more; the most opaque one has {:.3g}.",
                  threshold, *std::max_element(splats.opacities.begin(), splats.opacities.end())));
}

Splats chosen(Splats splats, const std::optional<Eigen::AlignedBox3d>& crop,
              double opacity_threshold) {
  if (crop) splats = cropped(splats, *crop);
  return opaque(std::move(splats), opacity_threshold);
}

void write_splats(const std::filesystem::path& path, const Splats& splats) {
  if (ending_of(path) == ".splat") {
    write_dot_splat(path, splats);
    return;
  }
  const std::size_t count = splats.size();
  const std::size_t bands = splats.sh_bands();
  std::vector<std::string> names = {"x", "y", "z"};
  std::vector<std::vector<float>> values;
  const auto add = [&](const auto& value_of) {
    std::vector<float>& column = values.emplace_back(count);
    for (std::size_t i = 0; i < count; ++i) column[i] = value_of(i);
  };
  for (int axis = 0; axis < 3; ++axis) add([&](std::size_t i) { return splats.means[i][axis]; });
  for (const bool rest : {false, true}) {
    for (std::size_t channel = 0; channel < 3; ++channel) {
      for (std::size_t band = rest ? 1 : 0; band < (rest ? bands : 1); ++band) {
        names.push_back(rest ? "f_rest_" + std::to_string(channel * (bands - 1) + band - 1)
                             : "f_dc_" + std::to_string(channel));
        add([&](std::size_t i) { return splats.sh[(i * bands + band) * 3 + channel]; });
      }
    }
  }
  names.emplace_back("opacity");
  add([&](std::size_t i) {
    const float opacity = std::clamp(splats.opacities[i], kOpacityMargin, 1.0F - kOpacityMargin);
    return std::log(opacity / (1.0F - opacity));
  });
  for (int axis = 0; axis < (splats.isotropic ? 1 : 3); ++axis) {
    names.push_back("scale_" + std::to_string(axis));
    add([&](std::size_t i) { return std::log(splats.scales[i][axis]); });
  }
  for (int k = 0; k < 4; ++k) {
    names.push_back("rot_" + std::to_string(k));
    add([&](std::size_t i) {
      const Eigen::Quaternionf& q = splats.rotations[i];
      return k == 0 ? q.w() : q.vec()[k - 1];
    });
  }
  std::vector<PlyColumn> columns;
  for (std::size_t i = 0; i < names.size(); ++i) columns.push_back({names[i], values[i]});
  write_ply_points(path, columns);
}

splat::Gaussians gaussians_of(const Splats& splats) {
  splat::Gaussians g;
  g.sh_degree = splats.sh_degree;
  g.means = splats.means;
  g.opacities = splats.opacities;
  g.sh = splats.sh;
  g.log_scales.reserve(splats.size());
  g.rotations.reserve(splats.size());
  for (std::size_t i = 0; i < splats.size(); ++i) {
    g.log_scales.emplace_back(splats.scales[i].array().log());
    const Eigen::Quaternionf& q = splats.rotations[i];
    g.rotations.emplace_back(q.w(), q.x(), q.y(), q.z());
  }
  return g;
}

}  // namespace matterfit::capture
