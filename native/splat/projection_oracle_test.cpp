// SPDX-License-Identifier: GPL-3.0-or-later
// Projection and colours against numbers of another implementation: those that the PyTorch
// reference of gsplat 1.5.3 (PyPI; Apache-2.0; gsplat/cuda/_torch_impl.py) printed in float64 for
// the inputs below. Pinhole, pixel centres and the Jacobian's bounds are the same in both.
#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>

#include "splat/projection-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace matterfit::HWY_NAMESPACE {
namespace {

using OracleLanes = Lanes<hn::ScalableTag<double>>;

/// Mean, log scales, quaternion (w x y z). The last two lie so far aside, of one camera each, that
/// the Jacobian's directions are clamped: between them on all four sides.
constexpr double kOracleShapes[6][10] = {
    {0, 0, 0, -3, -2.5, -2, 1, 0, 0, 0},
    {-0.375, 0.25, -0.25, -4, -2, -3, -2, 1, 1, -3},
    {0.5, 0.375, -0.5, -1.5, -2.75, -1.75, 0.5, 0.75, -0.25, 0.125},
    {0.125, 0.625, 0.75, -3.5, -1.25, -2.5, -0.25, 0.5, 1.5, 1},
    {2.5, -1.5, -0.5, -1, -1.5, -2, 2, -3, 1, 4},
    {-1.75, 2.25, 0.5, -1.25, -0.75, -2.25, 4, 1, -3, -2}};

/// Coefficients times 64, as in Gaussians::sh.
constexpr int kOracleHarmonics[6][48] = {
    {-38, -56, -7, -21, 3,   20,  0,  2,  13,  -4, 22, -15, -22, 3,   -27, 25,
     -4,  -1,  10, 20,  21,  -28, 16, 0,  -11, 18, 23, -14, 9,   -22, -8,  -27,
     -27, -27, 13, 6,   -28, 28,  -4, 15, -15, -1, 18, -27, 5,   -14, 20,  0},
    {34,  -28, 21,  7,   28, 16,  21,  15,  19,  -5,  -23, 0,  14,  4,  -22, 21,
     -18, 5,   25,  -3,  -5, 3,   18,  -27, 2,   -26, -9,  17, 26,  11, 9,   9,
     -3,  13,  -18, -18, 4,  -14, -28, 21,  -16, 6,   27,  7,  -14, -3, 4,   -6},
    {18,  45, -4, 14, 7,   10, 18,  -28, -4, 22, 26, 24, 28,  19,  4,  23,
     -20, 5,  21, 7,  -15, -1, -25, 2,   27, -5, 8,  7,  -16, 4,   -2, 3,
     24,  -6, -2, -6, -28, 6,  6,   11,  22, 11, -7, 1,  10,  -27, 23, -14},
    {-66, 7,   26,  -7, -2,  22,  -16, -12, -22, -12, 18, 4,  -15, 10, -1, 24,
     -27, -14, -27, -3, -19, -26, 18,  -18, 0,   17,  4,  15, -1,  6,  25, -14,
     12,  23,  16,  5,  0,   -14, 5,   13,  -27, -3,  15, 8,  23,  -8, 14, 12},
    {37, -57, 4,   -20, -15, 28,  -25, -9,  -24, 26,  -24, -9, -9, 19,  -18, -2,
     8,  -12, -20, -28, 7,   28,  26,  -26, 9,   24,  -15, 8,  1,  -18, 24,  27,
     27, 21,  17,  11,  4,   -26, -4,  -16, -6,  -22, -15, 8,  15, -1,  9,   -16},
    {54, -46, 27, -10, 4,   3,  -27, -8,  11,  27,  -3,  -10, -27, -18, -16, 26,
     -8, 23,  8,  22,  -20, -7, -1,  -15, -11, 15,  -22, 25,  -4,  7,   -6,  28,
     25, 15,  6,  3,   21,  6,  -13, -24, 18,  -26, -23, -20, -18, -18, 6,   -15}};

/// Width, height, fx, fy, cx, cy, rotation, translation.
constexpr double kOracleCameras[2][18] = {
    {80, 60, 104, 96, 41.75, 27.75, 0.3456, -0.576, 0.7408, 0.5392, 0.768, 0.3456, -0.768, 0.28,
     0.576, 0.125, -0.25, 3},
    {64, 96, 90, 85, 30.5, 50, 0.96, 0, -0.28, 0.168, 0.8, 0.576, 0.224, -0.6, 0.768, -0.5, 0.25,
     4}};

/// Expected values, of each Gaussian in the first camera, then in the second: mean, depth; Σ₂ (xx,
/// xy, yy) without blur; Σ₂⁻¹ and √(det (Σ₂ − blur I) / det Σ₂) with a blur of 0.3; colour before
/// it is cut at 0.
constexpr double kOracleExpected[2][6][13] = {
    {{46.083333333333336, 19.75, 3, 14.530701548679655, 2.7498115157294274, 7.7993729952014927,
      0.071957379606193708, -0.02443019122592005, 0.13176062169216818, 0.96937309016966933,
      0.44362895791303297, 0.35769115201608881, 0.82071208101849136},
     {30.948755444928434, 17.397293092719355, 3.214, 6.1399655578490435, 7.6288170897117622,
      11.702925922173014, 0.62843928162156026, -0.39942330416488891, 0.33717839759103918,
      0.84559259806407883, 0.59963946438279236, 0.18955538541635103, 0.46513398962904512},
     {29.413625154130706, 33.068865598027131, 2.4329999999999998, 56.847959337438354,
      19.026140049983024, 48.725698631788454, 0.020094767292714394, -0.0077984785011324812,
      0.02342393838717716, 0.99346931392227511, 0.66039745717287301, 0.60517351694518773,
      0.44287569305197899},
     {52.52618911990885, 42.968911990885793, 3.5110000000000001, 28.348521454728662,
      27.811757572178578, 39.50949048853284, 0.10847592332637758, -0.075783589414199298,
      0.078063667195951633, 0.97174243587437059, -0.36092383689541796, 0.74643679540613528,
      0.31292017071443456},
     {456.24032258064472, -30.779032258064476, 0.37200000000000033, 7140.1243235622824,
      1708.7517297715754, 3438.290361283804, 0.00015894996747014824, -7.8987609259844149e-05,
      0.00033006845675259114, 0.99992664662614761, 0.51434194555856927, 0.023720963863876454,
      0.5301805120375227},
     {13.973185100722171, 40.652166476624856, 5.2620000000000005, 39.337762713400124,
      13.828697570970133, 60.131205717655313, 0.027417323434426488, -0.0062740080969356958,
      0.017983446592276717, 0.99318709291022145, 0.60877620560205514, 0.084871663995034319,
      0.36110797081937052}},
    {{19.25, 55.3125, 4, 1.5580422327059895, -0.87280817198179872, 4.4663736633075448,
      0.58885342978918898, 0.10782958322719151, 0.22954862935837095, 0.87498472977368247,
      0.16878695189306325, 0.68966610518071292, 0.83858844949666378},
     {10.60632344711807, 55.779238947957474, 3.5739999999999998, 4.4755800458905606,
      4.2091467204771504, 5.6646592145648391, 0.55393524882092948, -0.39090158415721232,
      0.44350599520003758, 0.84209612679992663, 1.0659537864581654, 0.2043966570528436,
      0.62614630127902238},
     {33.583071652868966, 58.395660862118184, 3.5030000000000001, 14.661354790514784,
      1.628289914887717, 18.097533281518444, 0.067488944975957116, -0.0059731686193581464,
      0.054883773534855469, 0.98164063571011007, 0.70408535884429069, 0.36569592565629944,
      0.10328331041372307},
     {17.943840151336008, 74.179475053204058, 4.2290000000000001, 6.2578252313968807,
      8.7276085175705873, 14.487072800885592, 0.71092076650487734, -0.41959880908236175,
      0.31528174662334008, 0.83454550043525844, 0.14216367929333668, 0.32169011862685093,
      0.33726810408061758},
     {66.670212765957444, 36.302206461780926, 5.0760000000000005, 21.531565484458625,
      -3.5209937252608552, 16.264993058959931, 0.047431228837116458, 0.010081806766986027,
      0.062511223197027177, 0.98350138032804824, 0.15152592355693251, 0.012080037278191735,
      0.46142308982527114},
     {-48.53103709311128, 115.76078728236186, 2.6419999999999999, 38.801822015377162,
      12.568396219190756, 229.0383756230222, 0.026032827638042488, -0.0014266731050656867,
      0.0044385549958414518, 0.9954239304721012, 0.55094051217534168, 0.57070827068632679,
      0.045160241576887361}}};

splat::Camera oracle_camera(const double (&row)[18]) {
  splat::Camera camera;
  camera.width = static_cast<int>(row[0]);
  camera.height = static_cast<int>(row[1]);
  camera.fx = row[2];
  camera.fy = row[3];
  camera.cx = row[4];
  camera.cy = row[5];
  for (int k = 0; k < 9; ++k) camera.rotation(k / 3, k % 3) = row[6 + k];
  for (int k = 0; k < 3; ++k) camera.translation[k] = row[15 + k];
  return camera;
}

template <class T>
GaussianShape<T> oracle_shape(const double (&row)[10]) {
  GaussianShape<T> shape{};
  for (int k = 0; k < 3; ++k) {
    shape.mean[k] = scalar<T>(row[k]);
    shape.log_scale[k] = scalar<T>(row[3 + k]);
  }
  for (int k = 0; k < 4; ++k) shape.rotation[k] = scalar<T>(row[6 + k]);
  return shape;
}

/// `got` is `expected` in every lane.
template <class T>
void oracle_near(T got, double expected) {
  double lanes[LaneTraits<T>::kCount];
  LaneTraits<T>::store(got, lanes);
  for (const double lane : lanes) {
    EXPECT_NEAR(lane, expected, 1e-12 * std::abs(expected));
  }
}

template <class T>
void oracle_footprints() {
  for (std::size_t c = 0; c < 2; ++c) {
    const splat::Camera camera = oracle_camera(kOracleCameras[c]);
    for (std::size_t i = 0; i < 6; ++i) {
      SCOPED_TRACE(testing::Message() << "camera " << c << ", Gaussian " << i);
      const double(&expected)[13] = kOracleExpected[c][i];
      const auto shape = oracle_shape<T>(kOracleShapes[i]);
      Projection<T> at;
      project(shape, false, splat::View(camera, {.blur = 0.0}), at);
      oracle_near(at.mean[0], expected[0]);
      oracle_near(at.mean[1], expected[1]);
      oracle_near(at.depth, expected[2]);
      for (int k = 0; k < 3; ++k) oracle_near(at.covariance[k], expected[3 + k]);
      project(shape, false, splat::View(camera, {.blur = 0.3}), at);
      oracle_near(at.covariance[2] / at.determinant, expected[6]);
      oracle_near(-(at.covariance[1] / at.determinant), expected[7]);
      oracle_near(at.covariance[0] / at.determinant, expected[8]);
      oracle_near(sqrt(at.sharp / at.determinant), expected[9]);
    }
  }
}

template <class T>
void oracle_colours() {
  for (std::size_t c = 0; c < 2; ++c) {
    const splat::View view(oracle_camera(kOracleCameras[c]), {});
    for (std::size_t i = 0; i < 6; ++i) {
      SCOPED_TRACE(testing::Message() << "camera " << c << ", Gaussian " << i);
      T direction[3];
      direction_of(oracle_shape<T>(kOracleShapes[i]).mean, view, direction);
      T y[16];
      sh_basis(3, direction, y);
      for (std::size_t channel = 0; channel < 3; ++channel) {
        T colour = scalar<T>(0.5);
        for (std::size_t band = 0; band < 16; ++band) {
          const double coefficient = kOracleHarmonics[i][3 * band + channel] / 64.0;
          colour = fma(scalar<T>(coefficient), y[band], colour);
        }
        oracle_near(colour, kOracleExpected[c][i][10 + channel]);
      }
    }
  }
}

TEST(ProjectionOracle, MeansAndCovariances) {
  oracle_footprints<double>();
  oracle_footprints<OracleLanes>();
}

TEST(ProjectionOracle, Harmonics) {
  oracle_colours<double>();
  oracle_colours<OracleLanes>();
}

}  // namespace
}  // namespace matterfit::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
