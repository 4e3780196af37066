// SPDX-License-Identifier: GPL-3.0-or-later
#include "diagnose/rows.hpp"

namespace matterfit::diagnose {

using Eigen::Index;
using Eigen::VectorXd;

Rows::Rows(const std::vector<Capture>& captures, const Select& select, Index limit) {
  add(captures, select, 1);
  if (limit <= 0 || size() <= limit) return;
  const Index stride = (size() + limit - 1) / limit;
  *this = Rows(captures, [](int, Index, Index) { return false; });
  add(captures, select, stride);
}

Rows::Rows(const std::vector<Capture>& captures, Use use, Index limit)
    : Rows(
          captures,
          [&](int c, Index frame, Index track) {
            const Capture& capture = captures[std::size_t(c)];
            return capture.use[std::size_t(frame * capture.tracks() + track)] == use;
          },
          limit) {}

void Rows::add(const std::vector<Capture>& captures, const Select& select, Index stride) {
  Index first = 0;
  for (std::size_t c = 0; c < captures.size(); ++c) {
    const Capture& capture = captures[c];
    for (Index i = 0; i < capture.tracks(); i += stride) {
      for (int axis = 0; axis < 3; ++axis) {
        if (!capture.axes[std::size_t(axis)]) continue;
        Series series{int(c), i, axis, size(), size()};
        for (Index f = 0; f < Index(capture.times.size()); ++f) {
          const Index sample = f * capture.tracks() + i;
          if (capture.use[std::size_t(sample)] == Use::kIgnored || !select(int(c), f, i)) continue;
          rows_.push_back(first + 3 * sample + axis);
          frames_.push_back(f);
          times_.push_back(capture.times[std::size_t(f)]);
        }
        series.end = size();
        if (series.end > series.begin) series_.push_back(series);
      }
    }
    first += 3 * capture.samples();
  }
}

VectorXd Rows::gather(const VectorXd& motion) const {
  VectorXd result(size());
  for (Index i = 0; i < size(); ++i) result[i] = motion[rows_[std::size_t(i)]];
  return result;
}

VectorXd measured(const std::vector<Capture>& captures) {
  Index size = 0;
  for (const Capture& capture : captures) size += capture.positions.size();
  VectorXd result(size);
  Index first = 0;
  for (const Capture& capture : captures) {
    result.segment(first, capture.positions.size()) = capture.positions;
    first += capture.positions.size();
  }
  return result;
}

}  // namespace matterfit::diagnose
