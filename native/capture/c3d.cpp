// SPDX-License-Identifier: GPL-3.0-or-later
#include "capture/c3d.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include "base/error.hpp"
#include "base/file.hpp"
#include "capture/byte_reader.hpp"

namespace matterfit::capture {
namespace {

constexpr std::size_t kBlock = 512;
constexpr std::uint8_t kC3dMagic = 0x50;

enum class Processor : std::uint8_t { kIntel = 84, kDec = 85, kMips = 86 };

struct Parameter {
  int type = 0;  ///< −1 text, 1 byte, 2 int16, 4 float
  std::vector<std::size_t> dimensions;
  std::span<const std::byte> data;
};

/// VAX F_floating: 16-bit halves swapped, exponent biased by 128, hidden bit of weight ½.
float dec_float(const std::byte* data) {
  const std::uint32_t bits =
      (std::uint32_t{load<std::uint16_t>(data)} << 16U) | load<std::uint16_t>(data + 2);
  const auto exponent = static_cast<int>((bits >> 23U) & 0xFFU);
  if (exponent == 0) return 0.0F;
  const auto mantissa = static_cast<float>((bits & 0x7FFFFFU) | 0x800000U);
  const float value = std::ldexp(mantissa, exponent - 128 - 24);
  return (bits >> 31U) != 0 ? -value : value;
}

std::string upper(std::string text) {
  for (char& c : text) {
    if (c >= 'a' && c <= 'z') c = static_cast<char>(c - 'a' + 'A');
  }
  return text;
}

/// Text without padding; bytes above 127 are taken as Latin-1.
std::string clean(std::span<const std::byte> raw) {
  std::string text;
  for (const std::byte byte : raw) {
    const auto c = std::to_integer<unsigned>(byte);
    if (c == 0) break;
    if (c < 0x80) {
      text.push_back(c < 0x20 ? ' ' : static_cast<char>(c));
    } else {
      text.push_back(static_cast<char>(0xC0U | (c >> 6U)));
      text.push_back(static_cast<char>(0x80U | (c & 63U)));
    }
  }
  const std::size_t end = text.find_last_not_of(' ');
  text.resize(end == std::string::npos ? 0 : end + 1);
  text.erase(0, std::min(text.find_first_not_of(' '), text.size()));
  return text;
}

class Parser {
 public:
  Parser(std::span<const std::byte> bytes, const std::string& name)
      : bytes_(bytes), name_(name), reader_(bytes, name) {}

  C3d parse() {
    find_processor();
    read_header();
    read_parameters();
    C3d file;
    settle_layout(file);
    read_labels(file);
    read_points(file);
    return file;
  }

 private:
  [[noreturn]] void fail(const std::string& reason) const { throw_input(name_ + ": " + reason); }

  [[nodiscard]] float read_float(const std::byte* data) const {
    if (processor_ == Processor::kDec) return dec_float(data);
    return load<float>(data, processor_ == Processor::kMips);
  }
  [[nodiscard]] std::uint16_t word(std::size_t offset) const {
    return load<std::uint16_t>(bytes_.data() + offset, processor_ == Processor::kMips);
  }

  void find_processor() {
    if (bytes_.size() < kBlock) {
      fail("is only " + std::to_string(bytes_.size()) +
           " bytes long; a C3D file has a header of 512. Is it truncated?");
    }
    const auto block = std::to_integer<std::size_t>(bytes_[0]);
    if (std::to_integer<std::uint8_t>(bytes_[1]) != kC3dMagic || block < 2) {
      fail("is not a C3D file.");
    }
    parameters_ = (block - 1) * kBlock;
    reader_.seek(parameters_, "the parameter section");
    const auto head = reader_.take(4, "the parameter section");
    const auto code = std::to_integer<unsigned>(head[3]);
    if (code < 84 || code > 86) {
      fail("has processor type " + std::to_string(code) + " at byte " +
           std::to_string(parameters_ + 3) + ", expected 84 (Intel), 85 (DEC) or 86 (MIPS).");
    }
    processor_ = static_cast<Processor>(code);
    reader_.set_big_endian(processor_ == Processor::kMips);
  }

  void read_header() {
    points_ = word(2);
    analog_values_ = word(4);
    first_frame_ = word(6);
    last_frame_ = word(8);
    scale_ = read_float(bytes_.data() + 12);
    data_block_ = word(16);
    rate_ = read_float(bytes_.data() + 20);
  }

  void read_parameters() {
    std::map<int, std::string> groups;
    struct Record {
      int group;
      std::string name;
      Parameter parameter;
    };
    std::vector<Record> records;
    for (;;) {
      if (reader_.remaining() < 2) break;  // Some writers omit the end mark.
      const auto length = static_cast<int>(reader_.read<std::int8_t>("a parameter"));
      const auto group = static_cast<int>(reader_.read<std::int8_t>("a parameter"));
      if (length == 0 || group == 0) break;
      const auto name = reader_.take(static_cast<std::size_t>(std::abs(length)), "a parameter");
      const std::size_t base = reader_.offset();
      const std::size_t next = reader_.read<std::uint16_t>("a parameter");
      if (group < 0) {
        groups[-group] = upper(clean(name));
      } else {
        records.push_back({group, upper(clean(name)), read_parameter()});
      }
      if (next == 0) break;
      if (next < 2) reader_.fail("a parameter points back into itself.");
      reader_.seek(base + next, "the next parameter");
    }
    for (Record& record : records) {
      values_[groups[record.group] + ":" + record.name] = std::move(record.parameter);
    }
  }

  Parameter read_parameter() {
    Parameter parameter;
    parameter.type = static_cast<int>(reader_.read<std::int8_t>("a parameter's type"));
    const auto dimensions = reader_.read<std::uint8_t>("a parameter's dimensions");
    if (dimensions > 7) reader_.fail("a parameter has more than 7 dimensions.");
    std::size_t count = 1;
    for (int d = 0; d < dimensions; ++d) {
      parameter.dimensions.push_back(reader_.read<std::uint8_t>("a parameter's dimensions"));
      count *= parameter.dimensions.back();
    }
    const int size = std::abs(parameter.type);
    if (size != 1 && size != 2 && size != 4) {
      reader_.fail("a parameter has type " + std::to_string(parameter.type) +
                   ", expected -1, 1, 2 or 4.");
    }
    parameter.data = reader_.take(count * static_cast<std::size_t>(size), "a parameter's values");
    return parameter;
  }

  [[nodiscard]] const Parameter* find(const std::string& key) const {
    const auto found = values_.find(key);
    return found == values_.end() ? nullptr : &found->second;
  }

  /// First value as a number; unsigned for 16-bit integers, as counts beyond 32767 are written so.
  [[nodiscard]] double number(const std::string& key, double otherwise) const {
    const Parameter* parameter = find(key);
    if (parameter == nullptr || parameter->data.empty()) return otherwise;
    const std::byte* data = parameter->data.data();
    if (parameter->type == 4) return read_float(data);
    if (parameter->type == 2) return load<std::uint16_t>(data, processor_ == Processor::kMips);
    if (parameter->type == 1) return std::to_integer<std::uint8_t>(*data);
    return otherwise;
  }

  /// TRIAL:ACTUAL_…_FIELD: a 32-bit number as two 16-bit words, the low one first.
  [[nodiscard]] std::int64_t field(const std::string& key) const {
    const Parameter* parameter = find(key);
    if (parameter == nullptr || parameter->type != 2 || parameter->data.size() < 4) return 0;
    const bool big = processor_ == Processor::kMips;
    return std::int64_t{load<std::uint16_t>(parameter->data.data(), big)} +
           (std::int64_t{load<std::uint16_t>(parameter->data.data() + 2, big)} << 16);
  }

  std::size_t frame_count(C3d& file) const {
    file.first_frame = first_frame_;
    const std::int64_t first = field("TRIAL:ACTUAL_START_FIELD");
    const std::int64_t last = field("TRIAL:ACTUAL_END_FIELD");
    if (first > 0 && last >= first) {
      file.first_frame = first;
      return static_cast<std::size_t>(last - first + 1);
    }
    for (const char* key : {"POINT:LONG_FRAMES", "POINT:FRAMES"}) {
      const double frames = number(key, 0.0);
      if (frames >= 1.0 && frames < 4e9) return static_cast<std::size_t>(frames);
    }
    if (last_frame_ < first_frame_) {
      fail("states frames " + std::to_string(first_frame_) + " to " + std::to_string(last_frame_) +
           " in its header.");
    }
    return std::size_t{last_frame_} - first_frame_ + 1;
  }

  void settle_layout(C3d& file) {
    const auto points = number("POINT:USED", points_);
    if (!(points >= 1.0 && points <= 65535.0)) fail("holds no points (POINT:USED).");
    file.points = static_cast<std::size_t>(points);
    file.frames = frame_count(file);
    scale_ = static_cast<float>(number("POINT:SCALE", scale_));
    if (!std::isfinite(scale_) || scale_ == 0.0F) {
      fail("has POINT:SCALE " + std::to_string(scale_) +
           ", expected a positive (integer points) or negative (float points) number.");
    }
    file.rate = number("POINT:RATE", rate_);
    if (!std::isfinite(file.rate) || file.rate < 0.0) file.rate = 0.0;
    if (const Parameter* units = find("POINT:UNITS"); units != nullptr && units->type == -1) {
      file.units = clean(units->data);
    }
    const double block = number("POINT:DATA_START", data_block_);
    if (!(block >= 2.0 && block <= 65535.0)) {
      fail("has no data section (POINT:DATA_START is " + std::to_string(block) + ").");
    }
    data_ = (static_cast<std::size_t>(block) - 1) * kBlock;
  }

  void read_labels(C3d& file) const {
    for (int part = 1; file.labels.size() < file.points; ++part) {
      std::string key = "POINT:LABELS";
      if (part > 1) key += std::to_string(part);
      const Parameter* labels = find(key);
      if (labels == nullptr || labels->type != -1 || labels->dimensions.size() != 2) break;
      const std::size_t length = labels->dimensions[0];
      for (std::size_t i = 0; i < labels->dimensions[1] && file.labels.size() < file.points; ++i) {
        file.labels.push_back(clean(labels->data.subspan(i * length, length)));
      }
    }
    while (file.labels.size() < file.points) {
      file.labels.push_back("point " + std::to_string(file.labels.size()));
    }
  }

  void read_points(C3d& file) {
    const bool floating = scale_ < 0.0F;
    const bool big = processor_ == Processor::kMips;
    const std::size_t size = floating ? 4 : 2;
    const std::size_t frame_bytes = (4 * file.points + analog_values_) * size;
    reader_.seek(data_, "the data section");
    if (file.frames > reader_.remaining() / frame_bytes) {
      fail("states " + std::to_string(file.frames) + " frames of " + std::to_string(frame_bytes) +
           " bytes, but only " + std::to_string(reader_.remaining()) + " bytes follow at byte " +
           std::to_string(data_) + ". Is it truncated?");
    }
    const std::size_t samples = file.frames * file.points;
    file.positions.assign(samples, Vec3d::Constant(std::numeric_limits<double>::quiet_NaN()));
    file.visible.assign(samples, 0);
    file.residuals.assign(samples, -1.0F);
    const auto value = [&](const std::byte* at) -> double {
      if (floating) return read_float(at);
      return double{scale_} * load<std::int16_t>(at, big);
    };
    for (std::size_t frame = 0; frame < file.frames; ++frame) {
      const std::byte* row = reader_.take(frame_bytes, "a frame").data();
      for (std::size_t point = 0; point < file.points; ++point, row += 4 * size) {
        const Vec3d position(value(row), value(row + size), value(row + 2 * size));
        // The fourth word: camera bits in the high byte, residual in the low one; −1: not seen.
        const double raw = floating ? double{read_float(row + 3 * size)}
                                    : static_cast<double>(load<std::int16_t>(row + 3 * size, big));
        if (!(raw >= 0.0 && raw < 65536.0) || !position.allFinite()) continue;
        const std::size_t at = frame * file.points + point;
        file.positions[at] = position;
        file.visible[at] = 1;
        file.residuals[at] =
            static_cast<float>(static_cast<unsigned>(raw) & 0xFFU) * std::abs(scale_);
      }
    }
  }

  std::span<const std::byte> bytes_;
  std::string name_;
  ByteReader reader_;
  Processor processor_ = Processor::kIntel;
  std::map<std::string, Parameter> values_;
  std::size_t parameters_ = 0;
  std::size_t data_ = 0;
  std::uint16_t points_ = 0;
  std::uint16_t analog_values_ = 0;
  std::uint16_t first_frame_ = 0;
  std::uint16_t last_frame_ = 0;
  std::uint16_t data_block_ = 0;
  float scale_ = 0.0F;
  float rate_ = 0.0F;
};

}  // namespace

double C3d::metres_per_unit() const {
  const std::string unit = upper(units);
  if (unit == "M" || unit == "METER" || unit == "METERS" || unit == "METRE" || unit == "METRES") {
    return 1.0;
  }
  if (unit == "DM") return 0.1;
  if (unit == "CM") return 0.01;
  if (unit == "MM") return 0.001;
  if (unit == "IN" || unit == "INCH" || unit == "INCHES") return 0.0254;
  if (unit == "FT") return 0.3048;
  return 0.0;
}

C3d parse_c3d(std::span<const std::byte> bytes, const std::string& name) {
  return Parser(bytes, name).parse();
}

C3d read_c3d(const std::filesystem::path& path) {
  return parse_c3d(read_file(path), path.filename().string());
}

}  // namespace matterfit::capture
