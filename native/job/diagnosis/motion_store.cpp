// SPDX-License-Identifier: GPL-3.0-or-later
#include "job/diagnosis/motion_store.hpp"

#include <cstring>
#include <string_view>
#include <system_error>
#include <utility>
#include <vector>

#include "base/file.hpp"
#include "base/hash.hpp"

namespace matterfit::job {
namespace {

namespace fs = std::filesystem;

/// The content of a file: files of another layout have other names.
constexpr std::string_view kLayout = "positions, work";

void add(const Eigen::VectorXd& values, Hasher& hasher) {
  const auto count = values.size();
  hasher.add(&count, sizeof(count));
  hasher.add(values.data(), static_cast<std::size_t>(count) * sizeof(double));
}

template <class T>
void add(const T& value, Hasher& hasher) {
  hasher.add(&value, sizeof(value));
}

}  // namespace

MotionStore::MotionStore(fs::path folder, std::string inputs)
    : folder_(std::move(folder)), inputs_(std::move(inputs)) {}

fs::path MotionStore::path_of(const diagnose::Point& point) const {
  Hasher hasher;
  hasher.add(std::string(kLayout));
  hasher.add(inputs_);
  add(point.theta, hasher);
  for (const diagnose::Point::Cause& cause : point.causes) {
    add(cause.effect, hasher);
    add(cause.variant, hasher);
    add(cause.values, hasher);
  }
  const diagnose::Numerics& n = point.numerics;
  for (const double value : {n.spacing, n.step, n.offset.x(), n.offset.y(), n.offset.z(),
                             n.particles, n.contact_stiffness, n.contact_damping, n.loss}) {
    add(value, hasher);
  }
  for (const double slope : n.lumping_slope) add(slope, hasher);
  for (const double bend : n.lumping_bend) add(bend, hasher);
  add(n.transfer, hasher);
  add(n.seed, hasher);
  for (const double time : point.until) add(time, hasher);
  return folder_ / (hasher.hex() + ".motion");
}

/// A file is the doubles of the positions and of the work, then the hash of their bytes.
std::optional<diagnose::Motion> MotionStore::find(const diagnose::Point& point) const {
  const fs::path path = path_of(point);
  std::error_code code;
  if (!fs::is_regular_file(path, code)) return std::nullopt;
  const std::vector<std::byte> bytes = read_file(path);
  constexpr std::size_t kHash = 32;
  if (bytes.size() < kHash + sizeof(double)) return std::nullopt;
  if ((bytes.size() - kHash) % sizeof(double) != 0) return std::nullopt;
  const std::size_t size = bytes.size() - kHash;
  const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  if (hash_hex(text.substr(0, size)) != text.substr(size)) return std::nullopt;
  diagnose::Motion motion;
  const std::size_t count = size / sizeof(double) - 1;
  motion.positions.resize(static_cast<Eigen::Index>(count));
  std::memcpy(motion.positions.data(), bytes.data(), count * sizeof(double));
  std::memcpy(&motion.work, bytes.data() + count * sizeof(double), sizeof(double));
  return motion;
}

void MotionStore::keep(const diagnose::Point& point, const diagnose::Motion& motion) const {
  std::vector<double> numbers(motion.positions.begin(), motion.positions.end());
  numbers.push_back(motion.work);
  const std::string_view values(reinterpret_cast<const char*>(numbers.data()),
                                numbers.size() * sizeof(double));
  AtomicFile file(path_of(point));
  file.write(values);
  file.write(hash_hex(values));
  file.commit();
}

void MotionStore::clear() const {
  std::error_code code;
  fs::remove_all(folder_, code);
}

}  // namespace matterfit::job
