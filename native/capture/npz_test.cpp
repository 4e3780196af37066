// SPDX-License-Identifier: GPL-3.0-or-later
#include "capture/npz.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <cstdlib>
#include <fstream>

#include "base/error.hpp"
#include "base/file.hpp"
#include "base/message_for_test.hpp"
#include "capture/bytes_for_test.hpp"

namespace matterfit::capture {
namespace {

namespace fs = std::filesystem;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

std::string npy(const std::string& dict, const std::string& body) {
  std::string out("\x93NUMPY\1\0", 8);
  out.push_back(static_cast<char>(dict.size()));
  out.push_back('\0');
  return out + dict + body;
}

class NpzTest : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::temp_directory_path() / ("matterfit_npz_test_" + std::to_string(::getpid()));
    fs::create_directories(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }
  fs::path folder_;
};

Arrays sample() {
  Arrays arrays;
  arrays.emplace("positions", Array({2, 1, 3}, std::vector<double>{1, 2, 3, -4, 5.5, 1e-300}));
  arrays.emplace("single", Array({2}, std::vector<float>{0.5F, -0.25F}));
  arrays.emplace("small", Array({3}, std::vector<std::int32_t>{1, -2, 3}));
  arrays.emplace("large", Array({}, std::vector<std::int64_t>{std::int64_t{1} << 60}));
  arrays.emplace("byte", Array({2, 2}, std::vector<std::uint8_t>{0, 1, 2, 255}));
  Array visible({2}, std::vector<std::uint8_t>{0, 1});
  visible.boolean = true;
  arrays.emplace("visible", visible);
  arrays.emplace("labels", Array({2}, std::vector<std::string>{"Tip-1", "Knöchel €"}));
  arrays.emplace("none", Array({0, 3}, std::vector<double>{}));
  return arrays;
}

// What is written is read back, stored and deflated alike.
TEST_F(NpzTest, RoundTrip) {
  for (const bool deflate : {false, true}) {
    const fs::path path = folder_ / "a.npz";
    write_npz(path, sample(), {.deflate = deflate});
    const Arrays back = read_npz(path);
    const Arrays expected = sample();
    ASSERT_EQ(back.size(), expected.size());
    for (const auto& [key, array] : expected) {
      SCOPED_TRACE(key);
      EXPECT_EQ(back.at(key).shape, array.shape);
      EXPECT_EQ(back.at(key).data, array.data);
      EXPECT_EQ(back.at(key).boolean, array.boolean);
    }
  }
}

TEST_F(NpzTest, BytesDependOnContentOnly) {
  const std::string first = format_npz(sample(), {.deflate = true});
  ::setenv("TZ", "Asia/Tokyo", 1);
  ::tzset();
  const std::string second = format_npz(sample(), {.deflate = true});
  ::unsetenv("TZ");
  ::tzset();
  EXPECT_EQ(first, second);
}

// An independent reader and writer: numpy itself, where it is installed.
TEST_F(NpzTest, NumpyAgrees) {
  if (std::system("/usr/bin/python3 -c 'import numpy' 2>/dev/null") != 0) {
    GTEST_SKIP() << "python3-numpy is not installed";
  }
  write_npz(folder_ / "ours.npz", sample(), {.deflate = true});
  std::ofstream(folder_ / "check.py") << R"(
import numpy as np, sys
a = np.load('ours.npz')
assert a['positions'].dtype == '<f8' and a['positions'].shape == (2, 1, 3)
assert a['positions'][1, 0, 1] == 5.5
assert a['large'].shape == () and int(a['large']) == 1 << 60
assert a['visible'].dtype == bool and list(a['visible']) == [False, True]
assert list(a['labels']) == ['Tip-1', 'Knöchel €']
assert a['none'].shape == (0, 3)
c = np.arange(24, dtype='<f4').reshape(2, 3, 4)
np.savez_compressed('theirs.npz', fortran=np.asfortranarray(c), half=np.float16([1.5, -6e-8, np.inf]),
  u2=np.uint16([65535]), u8=np.uint64([7]), s=np.array([b'ab', b'c']), f=np.asfortranarray([['a','b'],['c','dd']]))
np.save('one.npy', np.arange(6, dtype='<i8').reshape(1, 2, 3))
np.save('big.npy', np.arange(3, dtype='>f8'))
np.save('object.npy', np.array([None, 1], dtype=object))
)";
  const std::string command = "cd '" + folder_.string() + "' && /usr/bin/python3 check.py";
  ASSERT_EQ(std::system(command.c_str()), 0);
  const Arrays theirs = read_npz(folder_ / "theirs.npz");
  const Array& fortran = theirs.at("fortran");
  EXPECT_THAT(fortran.shape, ElementsAre(2, 3, 4));
  const auto values = fortran.doubles("fortran");
  for (std::size_t i = 0; i < 24; ++i) EXPECT_EQ(values[i], static_cast<double>(i));
  const auto half = theirs.at("half").floats("half");
  EXPECT_EQ(half[0], 1.5F);
  EXPECT_EQ(half[1], -std::ldexp(1.0F, -24));
  EXPECT_TRUE(std::isinf(half[2]));
  EXPECT_THAT(theirs.at("u2").integers("u2"), ElementsAre(65535));
  EXPECT_THAT(theirs.at("u8").integers("u8"), ElementsAre(7));
  EXPECT_THAT(theirs.at("s").texts("s"), ElementsAre("ab", "c"));
  EXPECT_THAT(theirs.at("f").texts("f"), ElementsAre("a", "b", "c", "dd"));
  EXPECT_THAT(read_npz(folder_ / "one.npy").at(kNpyName).integers("one"),
              ElementsAre(0, 1, 2, 3, 4, 5));
  EXPECT_THAT(message_of([&] { (void)read_npz(folder_ / "big.npy"); }), HasSubstr("big-endian"));
  EXPECT_THAT(message_of([&] { (void)read_npz(folder_ / "object.npy"); }),
              HasSubstr("Python objects"));
}

TEST_F(NpzTest, EveryTruncationIsAnError) {
  const std::string whole = format_npz(sample());
  for (std::size_t n = 0; n < whole.size(); n += 7) {
    EXPECT_THROW((void)parse_npz(bytes_of(whole).first(n), "cut.npz"), Error) << n;
  }
  const std::string one = format_npy(sample().at("positions"));
  for (std::size_t n = 0; n < one.size(); ++n) {
    EXPECT_THROW((void)parse_npy(bytes_of(one).first(n), "cut.npy"), Error) << n;
  }
}

TEST_F(NpzTest, ChangedBytesFailTheChecksum) {
  Arrays arrays;
  arrays.emplace("a", Array({100}, std::vector<double>(100, 1.0)));
  std::string bytes = format_npz(arrays);
  bytes[300] = static_cast<char>(bytes[300] + 1);
  EXPECT_THAT(message_of([&] { (void)parse_npz(bytes_of(bytes), "a.npz"); }), HasSubstr("'a'"));
}

TEST_F(NpzTest, HostileHeaders) {
  const auto refuse = [](const std::string& dict, const char* words) {
    const std::string bytes = npy(dict, std::string(16, '\0'));
    EXPECT_THAT(message_of([&] { (void)parse_npy(bytes_of(bytes), "x.npy"); }), HasSubstr(words))
        << dict;
  };
  refuse("{'descr': '<f8', 'fortran_order': False, 'shape': (4294967296, 4294967296), }",
         "too large");
  refuse("{'descr': '<f8', 'fortran_order': False, 'shape': (99999999999999999999,), }",
         "too large");
  refuse("{'descr': '<f8', 'fortran_order': False, 'shape': (1000000000000,), }", "truncated");
  refuse("{'descr': '<f8', 'fortran_order': False, 'shape': (1,), }", "takes 8 bytes");
  refuse("{'descr': '<c8', 'fortran_order': False, 'shape': (2,), }", "'<c8'");
  refuse("{'descr': [('x', '<f8')], 'fortran_order': False, 'shape': (2,), }", "structured");
  refuse("{'descr': '<f8', 'shape': (2,), }", "incomplete");
  refuse("{'descr': '<U0', 'fortran_order': False, 'shape': (1000000000,), }", "empty texts");
  refuse("{'descr': '<f8", "does not end");
}

// 300 MB of zeros deflate a thousandfold: refused from the directory alone.
TEST_F(NpzTest, ZipBombIsRefusedBeforeUnpacking) {
  Arrays arrays;
  arrays.emplace("zeros", Array({300U << 20U}, std::vector<std::uint8_t>(300U << 20U, 0)));
  const std::string bomb = format_npz(arrays, {.deflate = true});
  ASSERT_LT(bomb.size(), 1U << 20U);
  arrays.clear();
  EXPECT_THAT(message_of([&] { (void)parse_npz(bytes_of(bomb), "bomb.npz"); }),
              HasSubstr("zip bomb"));
  EXPECT_THAT(message_of([&] { (void)parse_npz(bytes_of(bomb), "bomb.npz", {.bytes = 1000}); }),
              HasSubstr("more than the limit"));
}

TEST_F(NpzTest, MissingArrayNamesThoseThatAreThere) {
  EXPECT_THAT(message_of([&] { (void)require(sample(), "position", "a.npz"); }),
              HasSubstr("no array 'position'; it holds 'byte', 'labels'"));
  EXPECT_THAT(message_of([&] { (void)sample().at("labels").doubles("'labels'"); }),
              HasSubstr("holds text"));
  EXPECT_THAT(message_of([&] { (void)sample().at("single").integers("'single'"); }),
              HasSubstr("whole numbers"));
}

}  // namespace
}  // namespace matterfit::capture
