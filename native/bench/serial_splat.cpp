// SPDX-License-Identifier: GPL-3.0-or-later
#include "bench/serial_splat.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace matterfit::bench {
namespace {

constexpr float kBlur = 0.3F;
constexpr float kNear = 0.01F;
constexpr float kSmallestAlpha = 1.0F / 255.0F;
constexpr float kLargestAlpha = 0.99F;
constexpr float kStop = 1e-4F;
constexpr float kMargin = 0.15F;
constexpr float kSh0 = 0.28209479F;

struct Shape {
  float t[3];
  float ray[2];
  float clamped[2];
  float low[2];
  float high[2];
  float p[2][3];  // J W
  float r[3][3];
  float scale[3];
  float v[2][3];  // J W R S
};

void shape_of(const SerialSplat::Gaussian& g, const SerialSplat::Camera& camera, Shape& s) {
  const float* w = camera.rotation.data();
  for (int i = 0; i < 3; ++i) {
    s.t[i] = w[3 * i] * g.mean[0] + w[3 * i + 1] * g.mean[1] + w[3 * i + 2] * g.mean[2] +
             camera.translation[static_cast<std::size_t>(i)];
  }
  const float focal[2] = {camera.fx, camera.fy};
  const float centre[2] = {camera.cx, camera.cy};
  const float size[2] = {static_cast<float>(camera.width), static_cast<float>(camera.height)};
  for (int k = 0; k < 2; ++k) {
    s.ray[k] = s.t[k] / s.t[2];
    s.low[k] = (-kMargin * size[k] - centre[k]) / focal[k];
    s.high[k] = ((1.0F + kMargin) * size[k] - centre[k]) / focal[k];
    s.clamped[k] = std::clamp(s.ray[k], s.low[k], s.high[k]);
    for (int j = 0; j < 3; ++j) {
      s.p[k][j] = focal[k] / s.t[2] * (w[3 * k + j] - s.clamped[k] * w[6 + j]);
    }
  }
  const auto [qw, qx, qy, qz] = g.rotation;
  const float n = 2.0F / (qw * qw + qx * qx + qy * qy + qz * qz);
  const float r[3][3] = {
      {1 - n * (qy * qy + qz * qz), n * (qx * qy - qw * qz), n * (qx * qz + qw * qy)},
      {n * (qx * qy + qw * qz), 1 - n * (qx * qx + qz * qz), n * (qy * qz - qw * qx)},
      {n * (qx * qz - qw * qy), n * (qy * qz + qw * qx), 1 - n * (qx * qx + qy * qy)}};
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) s.r[i][j] = r[i][j];
    s.scale[i] = std::exp(g.log_scale[static_cast<std::size_t>(i)]);
  }
  for (int k = 0; k < 2; ++k) {
    for (int j = 0; j < 3; ++j) {
      s.v[k][j] =
          (s.p[k][0] * s.r[0][j] + s.p[k][1] * s.r[1][j] + s.p[k][2] * s.r[2][j]) * s.scale[j];
    }
  }
}

}  // namespace

SerialSplat::SerialSplat(std::vector<Gaussian> gaussians, const Camera& camera)
    : gaussians_(std::move(gaussians)), camera_(camera), footprints_(gaussians_.size()) {
  const std::size_t pixels =
      static_cast<std::size_t>(camera.width) * static_cast<std::size_t>(camera.height);
  for (auto& channel : channels_) channel.resize(pixels);
  transmittance_.resize(pixels);
  behind_.resize(pixels);
}

bool SerialSplat::project(const Gaussian& g, Footprint& f) const {
  Shape s;
  shape_of(g, camera_, s);
  f.depth = s.t[2];
  if (!(f.depth > kNear)) return false;
  f.mean[0] = camera_.fx * s.ray[0] + camera_.cx;
  f.mean[1] = camera_.fy * s.ray[1] + camera_.cy;
  float xx = kBlur;
  float xy = 0.0F;
  float yy = kBlur;
  for (int j = 0; j < 3; ++j) {
    xx += s.v[0][j] * s.v[0][j];
    xy += s.v[0][j] * s.v[1][j];
    yy += s.v[1][j] * s.v[1][j];
  }
  const float determinant = xx * yy - xy * xy;
  if (!(determinant > 0.0F)) return false;
  f.conic[0] = yy / determinant;
  f.conic[1] = -xy / determinant;
  f.conic[2] = xx / determinant;
  for (std::size_t c = 0; c < 3; ++c) f.colour[c] = std::max(0.5F + kSh0 * g.sh[c], 0.0F);
  const float room = 2.0F * std::log(g.opacity / kSmallestAlpha);
  if (!(room > 0.0F)) return false;
  const float half[2] = {std::sqrt(room * xx), std::sqrt(room * yy)};
  const int size[2] = {camera_.width, camera_.height};
  for (int k = 0; k < 2; ++k) {
    const float limit = static_cast<float>(size[k]);
    f.low[k] = static_cast<int>(std::clamp(std::floor(f.mean[k] - half[k]), 0.0F, limit));
    f.high[k] = static_cast<int>(std::clamp(std::ceil(f.mean[k] + half[k]), 0.0F, limit));
  }
  return f.low[0] < f.high[0] && f.low[1] < f.high[1];
}

float SerialSplat::alpha_of(const Footprint& f, float opacity, float dx, float dy, bool& clamped) {
  const float power = -0.5F * (f.conic[0] * dx * dx + f.conic[2] * dy * dy) - f.conic[1] * dx * dy;
  if (power < -5.6F) return 0.0F;  // below 1/255 whatever the opacity
  const float alpha = opacity * std::exp(power);
  if (alpha < kSmallestAlpha) return 0.0F;
  clamped = alpha >= kLargestAlpha;
  return std::min(alpha, kLargestAlpha);
}

const SerialSplat::Channels& SerialSplat::render() {
  order_.clear();
  for (std::size_t i = 0; i < gaussians_.size(); ++i) {
    if (project(gaussians_[i], footprints_[i])) order_.push_back(static_cast<std::uint32_t>(i));
  }
  std::stable_sort(order_.begin(), order_.end(), [&](std::uint32_t a, std::uint32_t b) {
    return footprints_[a].depth < footprints_[b].depth;
  });
  for (auto& channel : channels_) std::fill(channel.begin(), channel.end(), 0.0F);
  std::fill(transmittance_.begin(), transmittance_.end(), 1.0F);
  visible_pairs_ = 0;
  for (const std::uint32_t i : order_) {
    const Footprint& f = footprints_[i];
    const float opacity = gaussians_[i].opacity;
    for (int y = f.low[1]; y < f.high[1]; ++y) {
      for (int x = f.low[0]; x < f.high[0]; ++x) {
        const auto pixel = static_cast<std::size_t>(y * camera_.width + x);
        float& t = transmittance_[pixel];
        if (t < kStop) continue;
        bool clamped = false;
        const float alpha = alpha_of(f, opacity, static_cast<float>(x) + 0.5F - f.mean[0],
                                     static_cast<float>(y) + 0.5F - f.mean[1], clamped);
        if (alpha == 0.0F) continue;
        ++visible_pairs_;
        const float weight = t * alpha;
        for (std::size_t c = 0; c < 3; ++c) channels_[c][pixel] += weight * f.colour[c];
        channels_[3][pixel] += weight;
        channels_[4][pixel] += weight * f.depth;
        t -= weight;
      }
    }
  }
  return channels_;
}

const std::vector<SerialSplat::Gaussian>& SerialSplat::backward(const Channels& loss) {
  gradients_.assign(gaussians_.size(), Gaussian{});
  pose_.fill(0.0F);
  std::fill(transmittance_.begin(), transmittance_.end(), 1.0F);
  for (std::size_t pixel = 0; pixel < behind_.size(); ++pixel) {
    behind_[pixel] = 0.0F;
    for (std::size_t c = 0; c < 5; ++c) behind_[pixel] += loss[c][pixel] * channels_[c][pixel];
  }
  for (const std::uint32_t i : order_) {
    const Footprint& f = footprints_[i];
    const float opacity = gaussians_[i].opacity;
    Sums sums{};
    for (int y = f.low[1]; y < f.high[1]; ++y) {
      for (int x = f.low[0]; x < f.high[0]; ++x) {
        const auto pixel = static_cast<std::size_t>(y * camera_.width + x);
        float& t = transmittance_[pixel];
        if (t < kStop) continue;
        const float dx = static_cast<float>(x) + 0.5F - f.mean[0];
        const float dy = static_cast<float>(y) + 0.5F - f.mean[1];
        bool clamped = false;
        const float alpha = alpha_of(f, opacity, dx, dy, clamped);
        if (alpha == 0.0F) continue;
        const float weight = t * alpha;
        float g = loss[3][pixel] + loss[4][pixel] * f.depth;
        for (std::size_t c = 0; c < 3; ++c) {
          g += loss[c][pixel] * f.colour[c];
          sums.colour[c] += weight * loss[c][pixel];
        }
        sums.depth += weight * loss[4][pixel];
        behind_[pixel] -= weight * g;
        t -= weight;
        if (clamped) continue;
        const float v = weight * g - alpha * behind_[pixel] / (1.0F - alpha);
        sums.log_alpha += v;
        sums.mean[0] += v * (f.conic[0] * dx + f.conic[1] * dy);
        sums.mean[1] += v * (f.conic[1] * dx + f.conic[2] * dy);
        sums.conic[0] -= 0.5F * v * dx * dx;
        sums.conic[1] -= v * dx * dy;
        sums.conic[2] -= 0.5F * v * dy * dy;
      }
    }
    project_back(gaussians_[i], f, sums, gradients_[i]);
  }
  return gradients_;
}

void SerialSplat::project_back(const Gaussian& g, const Footprint& f, const Sums& sums,
                               Gaussian& bar) {
  Shape s;
  shape_of(g, camera_, s);
  const float* w = camera_.rotation.data();
  bar.opacity = sums.log_alpha / g.opacity;
  for (std::size_t c = 0; c < 3; ++c) bar.sh[c] = f.colour[c] > 0.0F ? kSh0 * sums.colour[c] : 0.0F;
  // dL/dΣ₂ = −K (dL/dK) K with K the conic, halves of xy in both corners.
  const float a = f.conic[0];
  const float b = f.conic[1];
  const float c = f.conic[2];
  const float half = 0.5F * sums.conic[1];
  const float m[2][2] = {{a * sums.conic[0] + b * half, a * half + b * sums.conic[2]},
                         {b * sums.conic[0] + c * half, b * half + c * sums.conic[2]}};
  const float gxx = -(m[0][0] * a + m[0][1] * b);
  const float gxy = -(m[0][0] * b + m[0][1] * c);
  const float gyy = -(m[1][0] * b + m[1][1] * c);
  float a_bar[2][3];
  for (int j = 0; j < 3; ++j) {
    const float d0 = 2.0F * (gxx * s.v[0][j] + gxy * s.v[1][j]);
    const float d1 = 2.0F * (gxy * s.v[0][j] + gyy * s.v[1][j]);
    bar.log_scale[static_cast<std::size_t>(j)] = d0 * s.v[0][j] + d1 * s.v[1][j];
    a_bar[0][j] = d0 * s.scale[j];
    a_bar[1][j] = d1 * s.scale[j];
  }
  float r_bar[3][3];
  float p_bar[2][3];
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) r_bar[i][j] = s.p[0][i] * a_bar[0][j] + s.p[1][i] * a_bar[1][j];
    for (int k = 0; k < 2; ++k) {
      p_bar[k][i] = a_bar[k][0] * s.r[i][0] + a_bar[k][1] * s.r[i][1] + a_bar[k][2] * s.r[i][2];
    }
  }
  const auto [qw, qx, qy, qz] = g.rotation;
  const float n = 2.0F / (qw * qw + qx * qx + qy * qy + qz * qz);
  float along = 0.0F;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) along += r_bar[i][j] * (s.r[i][j] - (i == j ? 1.0F : 0.0F));
  along *= n;
  const float yx = r_bar[0][1] + r_bar[1][0];
  const float zx = r_bar[0][2] + r_bar[2][0];
  const float zy = r_bar[1][2] + r_bar[2][1];
  const float turn[3] = {r_bar[2][1] - r_bar[1][2], r_bar[0][2] - r_bar[2][0],
                         r_bar[1][0] - r_bar[0][1]};
  bar.rotation = {
      n * (qx * turn[0] + qy * turn[1] + qz * turn[2]) - along * qw,
      n * (qy * yx + qz * zx + qw * turn[0] - 2 * qx * (r_bar[1][1] + r_bar[2][2])) - along * qx,
      n * (qx * yx + qz * zy + qw * turn[1] - 2 * qy * (r_bar[0][0] + r_bar[2][2])) - along * qy,
      n * (qx * zx + qy * zy + qw * turn[2] - 2 * qz * (r_bar[0][0] + r_bar[1][1])) - along * qz};
  const float focal[2] = {camera_.fx, camera_.fy};
  float t_bar[3] = {0.0F, 0.0F, sums.depth};
  float w_bar[3][3] = {};
  float inverse_bar = 0.0F;
  for (int k = 0; k < 2; ++k) {
    float along_k = 0.0F;
    float along_2 = 0.0F;
    for (int j = 0; j < 3; ++j) {
      along_k += p_bar[k][j] * w[3 * k + j];
      along_2 += p_bar[k][j] * w[6 + j];
      w_bar[k][j] = focal[k] / s.t[2] * p_bar[k][j];
      w_bar[2][j] -= focal[k] / s.t[2] * s.clamped[k] * p_bar[k][j];
    }
    inverse_bar += focal[k] * (along_k - s.clamped[k] * along_2);
    float ray_bar = focal[k] * sums.mean[k];
    if (s.ray[k] == s.clamped[k]) ray_bar -= focal[k] / s.t[2] * along_2;
    t_bar[k] = ray_bar / s.t[2];
    inverse_bar += ray_bar * s.t[k];
  }
  t_bar[2] -= inverse_bar / (s.t[2] * s.t[2]);
  for (int i = 0; i < 3; ++i) {
    bar.mean[static_cast<std::size_t>(i)] =
        t_bar[0] * w[i] + t_bar[1] * w[3 + i] + t_bar[2] * w[6 + i];
    const int j = (i + 1) % 3;
    const int k = (i + 2) % 3;
    float turned = 0.0F;
    for (int l = 0; l < 3; ++l) turned += w_bar[k][l] * w[3 * j + l] - w_bar[j][l] * w[3 * k + l];
    pose_[static_cast<std::size_t>(i)] += s.t[j] * t_bar[k] - s.t[k] * t_bar[j] + turned;
    pose_[static_cast<std::size_t>(3 + i)] += t_bar[i];
  }
}

}  // namespace matterfit::bench
