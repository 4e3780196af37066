// SPDX-License-Identifier: GPL-3.0-or-later
#include "mpm/renewed_body.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "base/error.hpp"
#include "mpm/initial_velocity.hpp"
#include "mpm/total_quadrature.hpp"

namespace matterfit::mpm {
namespace {

constexpr std::size_t kGrain = 8;  ///< chunks of a task

/// The block of the cell with base node `base` and the cell's place in it.
std::pair<Vec3i, std::uint32_t> split(const Vec3i& base) {
  const Vec3i block(base[0] >> 2, base[1] >> 2, base[2] >> 2);
  const auto cell =
      static_cast<std::uint32_t>((base[0] & 3) * 16 + (base[1] & 3) * 4 + (base[2] & 3));
  return {block, cell};
}

}  // namespace

template <class S>
RenewedBody<S>::RenewedBody(const Body& body, std::size_t index, double dx, const Vec3d& common)
    : index_(index),
      name_(body.name),
      material_(body.material),
      law_(material::law_constants<S>(body.material)),
      density_(body.density),
      particles_(body.rest.size()) {
  if (!body.pins.empty() || !body.masses.empty()) {
    throw_input("Body '" + name_ +
                "': pins and attached masses are not in formulation 'renewed'. Use 'total' for a "
                "body that stays solid, or 'updated'.");
  }
  start(body, dx, common);
}

template <class S>
void RenewedBody<S>::start(const Body& body, double dx, const Vec3d& common) {
  const Vec3d center = center_of_volume(body);
  const Mat3d spin = spin_matrix(body.spin);
  const std::size_t slots = (particles_ + kLanes - 1) / kLanes * kLanes;
  store_.first_chunk = {0, static_cast<std::uint32_t>(slots / kLanes)};
  make_room();
  std::vector<Arrival> arrivals(slots);
  for (std::size_t p = 0; p < particles_; ++p) {
    store_.id[p] = static_cast<std::uint32_t>(p);
    store_.geometry[p / kLanes * (4 * kLanes) + 3 * kLanes + p % kLanes] =
        static_cast<S>(body.volumes[p]);
    Vec3i base;
    for (int axis = 0; axis < 3; ++axis) {
      const double x = body.rest[p][axis] / dx;
      const double floor = std::floor(x - 0.5);
      if (!(std::abs(floor) < 1e8)) {
        throw_input("Body '" + body.name + "': particle " + std::to_string(p) +
                    " is too far from the origin for this particle separation.");
      }
      base[axis] = static_cast<int>(floor);
      arrivals[p].f[axis] = static_cast<S>(x - floor);
    }
    std::tie(arrivals[p].block, arrivals[p].cell) = split(base);
    S* carried = carried_.data() + p / kLanes * (RenewedCarried::kAttributes * kLanes) + p % kLanes;
    const Vec3d v = start_velocity(body, p, center) - common;
    for (std::size_t i = 0; i < 3; ++i) {
      const auto row = static_cast<int>(i);
      carried[(RenewedCarried::kVelocity + i) * kLanes] = static_cast<S>(v[row]);
      for (std::size_t j = 0; j < 3; ++j) {
        carried[(RenewedCarried::kAffine + 3 * i + j) * kLanes] =
            static_cast<S>(spin(row, static_cast<int>(j)));
      }
    }
  }
  Arena arena(1);
  settle(arena, arrivals);
}

template <class S>
void RenewedBody<S>::make_room() {
  const std::size_t chunks = store_.chunks();
  store_.id.assign(chunks * kLanes, RenewedStore<S>::kNobody);
  store_.geometry.assign(chunks * 4 * kLanes, S(0));
  for (std::size_t c = 0; c < chunks; ++c) {  // absent particles sit in the middle of the cell
    std::fill_n(store_.geometry.begin() + static_cast<std::ptrdiff_t>(c * 4 * kLanes), 3 * kLanes,
                S(1));
  }
  store_.history.assign(chunks * renewed_history(law_.law) * kLanes, S(0));
  store_.maxwell.assign(chunks * 12 * law_.maxwell_count * kLanes, S(0));
  carried_.assign(chunks * RenewedCarried::kAttributes * kLanes, S(0));
}

template <class S>
RenewedView<S> RenewedBody<S>::view(const std::vector<double>& displacement,
                                    const std::vector<double>& velocity,
                                    const std::vector<std::uint32_t>& nodes) {
  RenewedView<S> v{};
  v.displacement = displacement.data();
  v.velocity = velocity.data();
  v.block_nodes = nodes.data();
  v.slab_chunks = store_.first_chunk.data();
  v.geometry = store_.geometry.data();
  v.history = store_.history.data();
  v.maxwell = store_.maxwell.empty() ? nullptr : store_.maxwell.data();
  v.halo = halo_.data();
  v.extremes = extremes_.data();
  v.departure = departure_.data();
  v.carried = carried_.data();
  v.moved = moved_.data();
  v.law = law_;
  v.density = static_cast<S>(density_);
  return v;
}

template <class S>
double RenewedBody<S>::plastic_strain(std::size_t slot) const {
  return static_cast<double>(
      store_.history[slot / kLanes * (10 * kLanes) + 9 * kLanes + slot % kLanes]);
}

template <class S>
void RenewedBody<S>::arrange(Arena& arena, double dx) {
  std::vector<Arrival> arrivals(store_.id.size());
  arena.parallel_for(0, blocks(), 1, [&](std::size_t b) {
    const Vec3i corner = 4 * store_.coordinates[b];
    for_each(b, [&](std::size_t slot, const UpdatedPlace<S>& at) {
      const S* carried =
          carried_.data() + slot / kLanes * (RenewedCarried::kAttributes * kLanes) + slot % kLanes;
      const std::array<std::uint32_t, 3> cell{at.cell / 16, at.cell / 4 % 4, at.cell % 4};
      Vec3i base;
      for (std::size_t axis = 0; axis < 3; ++axis) {
        const double x = static_cast<double>(cell[axis]) + moved_[3 * b + axis] / dx +
                         static_cast<double>(carried[(RenewedCarried::kPlace + axis) * kLanes]);
        // Far off the grid, or not a number: the group's check has told before.
        const double floor = std::floor(x - 0.5);
        base[static_cast<int>(axis)] = corner[static_cast<int>(axis)] + static_cast<int>(floor);
        arrivals[slot].f[axis] = static_cast<S>(x - floor);
      }
      std::tie(arrivals[slot].block, arrivals[slot].cell) = split(base);
    });
  });
  settle(arena, arrivals);
}

template <class S>
void RenewedBody<S>::settle(Arena& arena, const std::vector<Arrival>& arrivals) {
  constexpr std::uint32_t kNobody = RenewedStore<S>::kNobody;
  const std::vector<std::uint32_t>& id = store_.id;
  const std::size_t slots = id.size();
  // Blocks that anyone comes to. Neighbours in memory mostly go the same way.
  std::vector<Vec3i> blocks;
  for (std::size_t s = 0; s < slots; ++s) {
    if (id[s] == kNobody) continue;
    if (blocks.empty() || (blocks.back() != arrivals[s].block &&
                           (blocks.size() < 2 || blocks[blocks.size() - 2] != arrivals[s].block))) {
      blocks.push_back(arrivals[s].block);
    }
  }
  std::sort(blocks.begin(), blocks.end(), before);
  blocks.erase(std::unique(blocks.begin(), blocks.end()), blocks.end());
  std::vector<std::uint32_t> block_of(slots);
  arena.parallel_for(0, slots / kLanes, kGrain, [&](std::size_t chunk) {
    std::size_t last = 0;
    for (std::size_t s = chunk * kLanes; s < (chunk + 1) * kLanes; ++s) {
      if (id[s] == kNobody) continue;
      if (blocks[last] != arrivals[s].block) {
        last = static_cast<std::size_t>(
            std::lower_bound(blocks.begin(), blocks.end(), arrivals[s].block, before) -
            blocks.begin());
      }
      block_of[s] = static_cast<std::uint32_t>(last);
    }
  });
  // Slots of a cell are taken in the order of the reference before.
  std::vector<std::uint32_t> filled(blocks.size() * kSlabs * kLanes, 0);
  std::vector<std::uint32_t> slot_in_cell(slots);
  for (std::size_t s = 0; s < slots; ++s) {
    if (id[s] == kNobody) continue;
    slot_in_cell[s] = filled[block_of[s] * (kSlabs * kLanes) + arrivals[s].cell]++;
  }
  std::swap(store_, next_);
  std::swap(carried_, next_carried_);
  store_.coordinates = std::move(blocks);
  store_.first_chunk.assign(1, 0);
  store_.first_chunk.reserve(store_.coordinates.size() * kSlabs + 1);
  for (std::size_t slab = 0; slab < store_.coordinates.size() * kSlabs; ++slab) {
    const auto cells = filled.begin() + static_cast<std::ptrdiff_t>(slab * kLanes);
    store_.first_chunk.push_back(store_.first_chunk.back() +
                                 *std::max_element(cells, cells + kLanes));
  }
  make_room();
  const std::size_t kept = renewed_history(law_.law);
  const std::size_t branches = 12 * law_.maxwell_count;
  arena.parallel_for(0, slots / kLanes, kGrain, [&](std::size_t chunk) {
    for (std::size_t s = chunk * kLanes; s < (chunk + 1) * kLanes; ++s) {
      if (next_.id[s] == kNobody) continue;
      const std::uint32_t cell = arrivals[s].cell;
      const std::size_t to_chunk =
          store_.first_chunk[block_of[s] * kSlabs + cell / kLanes] + slot_in_cell[s];
      const std::size_t lane = cell % kLanes;
      const std::size_t from_lane = s % kLanes;
      const auto take = [&](const std::vector<S>& from, std::vector<S>& to, std::size_t count,
                            std::size_t begin) {
        const S* read = from.data() + chunk * count * kLanes + from_lane;
        S* write = to.data() + to_chunk * count * kLanes + lane;
        for (std::size_t i = begin; i < count; ++i) write[i * kLanes] = read[i * kLanes];
      };
      store_.id[to_chunk * kLanes + lane] = next_.id[s];
      for (std::size_t axis = 0; axis < 3; ++axis) {
        store_.geometry[to_chunk * (4 * kLanes) + axis * kLanes + lane] = arrivals[s].f[axis];
      }
      take(next_.geometry, store_.geometry, 4, 3);
      take(next_.history, store_.history, kept, 0);
      if (branches > 0) take(next_.maxwell, store_.maxwell, branches, 0);
      take(next_carried_, carried_, RenewedCarried::kAttributes, RenewedCarried::kVelocity);
    }
  });
  make_blocks();
}

template <class S>
void RenewedBody<S>::make_blocks() {
  const std::size_t count = store_.blocks();
  halo_.resize(count * 4 * kHaloNodes);
  moved_.resize(count * 3);
  extremes_.assign(count, {S(1), S(1)});
  departure_.assign(count, {S(0), S(0)});
}

template <class S>
void RenewedBody<S>::restore(const RenewedStore<S>& reference, const std::vector<S>& history,
                             const std::vector<S>& maxwell) {
  store_ = reference;
  store_.history = history;
  store_.maxwell = maxwell;
  carried_.assign(store_.chunks() * RenewedCarried::kAttributes * kLanes, S(0));
  make_blocks();
}

template <class S>
void RenewedBody<S>::save(ByteWriter& out) const {
  std::vector<std::array<int, 3>> coordinates;
  coordinates.reserve(store_.coordinates.size());
  for (const Vec3i& c : store_.coordinates) coordinates.push_back({c[0], c[1], c[2]});
  out.put(coordinates);
  out.put(store_.first_chunk);
  out.put(store_.id);
  out.put(store_.geometry);
  out.put(store_.history);
  out.put(store_.maxwell);
}

template <class S>
void RenewedBody<S>::load(ByteReader& in) {
  std::vector<std::array<int, 3>> coordinates;
  in.get(coordinates);
  store_.coordinates.clear();
  store_.coordinates.reserve(coordinates.size());
  for (const auto& c : coordinates) store_.coordinates.emplace_back(c[0], c[1], c[2]);
  in.get(store_.first_chunk);
  if (store_.first_chunk.size() != coordinates.size() * kSlabs + 1 ||
      !std::is_sorted(store_.first_chunk.begin(), store_.first_chunk.end()) ||
      store_.first_chunk.front() != 0 || store_.first_chunk.back() > 1U << 28U) {
    ByteReader::fail();
  }
  make_room();
  in.get_same_size(store_.id);
  in.get_same_size(store_.geometry);
  in.get_same_size(store_.history);
  in.get_same_size(store_.maxwell);
  for (const std::uint32_t id : store_.id) {
    if (id != RenewedStore<S>::kNobody && id >= particles_) ByteReader::fail();
  }
  make_blocks();
}

template class RenewedBody<float>;
template class RenewedBody<double>;

}  // namespace matterfit::mpm
