// SPDX-License-Identifier: GPL-3.0-or-later
// PLY 1.0 (G. Turk, The PLY Polygon File Format, 1994).
#include "capture/ply.hpp"

#include <charconv>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <optional>
#include <type_traits>

#include "base/error.hpp"
#include "base/file.hpp"
#include "capture/byte_reader.hpp"

namespace matterfit::capture {
namespace {

constexpr std::size_t kMaxElements = 256;
constexpr std::size_t kMaxProperties = 4096;
constexpr std::size_t kMaxLine = 65536;

using Values = PlyProperty::Values;

enum class PlyFormat { kAscii, kLittle, kBig };

struct ListCount {
  std::size_t bytes = 1;
  bool is_signed = false;
};

/// A property as declared; `count` for lists.
struct Declared {
  PlyProperty property;
  ListCount count;
};

struct PlyHeader {
  PlyFormat format = PlyFormat::kAscii;
  std::vector<std::string> comments;
  struct Element {
    std::string name;
    std::size_t count = 0;
    std::vector<Declared> properties;
  };
  std::vector<Element> elements;
};

std::optional<Values> column_of(std::string_view type) {
  if (type == "char" || type == "int8") return std::vector<std::int8_t>{};
  if (type == "uchar" || type == "uint8") return std::vector<std::uint8_t>{};
  if (type == "short" || type == "int16") return std::vector<std::int16_t>{};
  if (type == "ushort" || type == "uint16") return std::vector<std::uint16_t>{};
  if (type == "int" || type == "int32") return std::vector<std::int32_t>{};
  if (type == "uint" || type == "uint32") return std::vector<std::uint32_t>{};
  if (type == "float" || type == "float32") return std::vector<float>{};
  if (type == "double" || type == "float64") return std::vector<double>{};
  return std::nullopt;
}

template <class Vector>
using Value = typename std::decay_t<Vector>::value_type;

std::size_t value_size(const Values& values) {
  return std::visit([](const auto& v) { return sizeof(Value<decltype(v)>); }, values);
}

bool is_space(char c) { return c == ' ' || c == '\t' || c == '\r' || c == '\n'; }

/// Lines of the header and tokens of an ASCII body.
class TextCursor {
 public:
  TextCursor(std::span<const std::byte> bytes, const std::string& name)
      : text_(reinterpret_cast<const char*>(bytes.data()), bytes.size()), name_(name) {}

  [[nodiscard]] std::size_t offset() const { return offset_; }
  [[nodiscard]] std::size_t remaining() const { return text_.size() - offset_; }
  [[noreturn]] void fail(const std::string& reason) const {
    throw_input(name_ + ": line " + std::to_string(line_) + ": " + reason);
  }
  std::string_view line() {
    const std::size_t end = text_.find('\n', offset_);
    if (end == std::string_view::npos || end - offset_ > kMaxLine) {
      fail("the header does not end. Is it a PLY file, or truncated?");
    }
    std::string_view found = text_.substr(offset_, end - offset_);
    offset_ = end + 1;
    ++line_;
    if (!found.empty() && found.back() == '\r') found.remove_suffix(1);
    return found;
  }
  std::string_view token(const char* what) {
    while (offset_ < text_.size() && is_space(text_[offset_])) {
      if (text_[offset_++] == '\n') ++line_;
    }
    const std::size_t begin = offset_;
    while (offset_ < text_.size() && !is_space(text_[offset_])) ++offset_;
    if (begin == offset_) fail(std::string("the file ends before ") + what + ". Is it truncated?");
    return text_.substr(begin, offset_ - begin);
  }

 private:
  std::string_view text_;
  std::string name_;
  std::size_t offset_ = 0;
  std::size_t line_ = 1;
};

std::vector<std::string_view> words(std::string_view line) {
  std::vector<std::string_view> found;
  std::size_t i = 0;
  while (i < line.size()) {
    while (i < line.size() && is_space(line[i])) ++i;
    const std::size_t begin = i;
    while (i < line.size() && !is_space(line[i])) ++i;
    if (i > begin) found.push_back(line.substr(begin, i - begin));
  }
  return found;
}

Declared parse_property(const std::vector<std::string_view>& word, const TextCursor& cursor) {
  Declared declared;
  const bool list = word.size() == 5 && word[1] == "list";
  if (!list && word.size() != 3) cursor.fail("a property needs a type and a name.");
  const std::string_view type = word[word.size() - 2];
  const auto column = column_of(type);
  if (!column) cursor.fail("unknown type '" + std::string(type) + "'.");
  declared.property.values = *column;
  declared.property.name = std::string(word.back());
  declared.property.is_list = list;
  if (list) {
    const auto counts = column_of(word[2]);
    if (!counts || word[2].starts_with("float") || word[2] == "double") {
      cursor.fail("unknown type '" + std::string(word[2]) + "' of a list's count.");
    }
    declared.count.bytes = value_size(*counts);
    declared.count.is_signed = word[2][0] != 'u';
  }
  return declared;
}

PlyHeader parse_header(TextCursor& cursor) {
  PlyHeader header;
  if (cursor.line() != "ply") cursor.fail("is not a PLY file (its first line is not 'ply').");
  bool has_format = false;
  std::size_t properties = 0;
  for (;;) {
    const std::string_view line = cursor.line();
    const auto word = words(line);
    if (word.empty()) continue;
    if (word[0] == "end_header") break;
    if (word[0] == "comment") {
      header.comments.emplace_back(line.size() > 8 ? line.substr(8) : "");
    } else if (word[0] == "obj_info") {
      continue;
    } else if (word[0] == "format") {
      if (word.size() < 3 || word[2] != "1.0") cursor.fail("expected PLY format version 1.0.");
      if (word[1] == "ascii") {
        header.format = PlyFormat::kAscii;
      } else if (word[1] == "binary_little_endian") {
        header.format = PlyFormat::kLittle;
      } else if (word[1] == "binary_big_endian") {
        header.format = PlyFormat::kBig;
      } else {
        cursor.fail("unknown format '" + std::string(word[1]) + "'.");
      }
      has_format = true;
    } else if (word[0] == "element") {
      std::uint64_t count = 0;
      if (word.size() != 3) cursor.fail("an element needs a name and a count.");
      const char* end = word[2].data() + word[2].size();
      const auto done = std::from_chars(word[2].data(), end, count);
      if (done.ec != std::errc() || done.ptr != end) {
        cursor.fail("'" + std::string(word[2]) + "' is no count.");
      }
      if (header.elements.size() == kMaxElements) cursor.fail("too many elements.");
      header.elements.push_back({std::string(word[1]), count, {}});
    } else if (word[0] == "property") {
      if (header.elements.empty()) cursor.fail("a property stands before the first element.");
      if (++properties > kMaxProperties) cursor.fail("too many properties.");
      header.elements.back().properties.push_back(parse_property(word, cursor));
    } else {
      cursor.fail("unknown keyword '" + std::string(word[0]) + "'.");
    }
  }
  if (!has_format) cursor.fail("the header has no format line.");
  return header;
}

template <class T>
T parse_number(std::string_view text, const TextCursor& cursor) {
  if (!text.empty() && text[0] == '+') text.remove_prefix(1);
  const char* end = text.data() + text.size();
  using Wide = std::conditional_t<std::is_floating_point_v<T>, double, std::int64_t>;
  Wide value{};
  auto done = std::from_chars(text.data(), end, value);
  if constexpr (std::is_floating_point_v<T>) {
    if (done.ec == std::errc::result_out_of_range && done.ptr == end) {
      // Too small is 0 and too large is infinite, as the C library has it.
      value = std::strtod(std::string(text).c_str(), nullptr);
      done.ec = std::errc();
    }
  }
  if (done.ec != std::errc() || done.ptr != end) {
    cursor.fail("'" + std::string(text.substr(0, 40)) + "' is not " +
                (std::is_floating_point_v<T> ? "a number." : "a whole number."));
  }
  if constexpr (!std::is_floating_point_v<T>) {
    if (value < static_cast<std::int64_t>(std::numeric_limits<T>::min()) ||
        value > static_cast<std::int64_t>(std::numeric_limits<T>::max())) {
      cursor.fail("'" + std::string(text) + "' does not fit the property's type.");
    }
  }
  return static_cast<T>(value);
}

void check_count(const PlyHeader::Element& element, std::size_t row, std::size_t available,
                 std::size_t offset, const std::string& name) {
  if (row > 0 && element.count > available / row) {
    throw_input(name + ": element '" + element.name + "' states " + std::to_string(element.count) +
                " rows of at least " + std::to_string(row) + " bytes, but only " +
                std::to_string(available) + " bytes follow at byte " + std::to_string(offset) +
                ". Is it truncated?");
  }
  if (element.count > std::numeric_limits<std::uint32_t>::max()) {
    throw_input(name + ": element '" + element.name + "' states " + std::to_string(element.count) +
                " rows, too many.");
  }
}

void read_ascii(PlyHeader::Element& element, TextCursor& cursor, const std::string& name) {
  // A value takes a digit and a separator; the last may lack the latter.
  check_count(element, 2 * element.properties.size(), cursor.remaining() + 1, cursor.offset(),
              name);
  if (element.properties.empty()) return;
  for (std::size_t row = 0; row < element.count; ++row) {
    for (Declared& declared : element.properties) {
      PlyProperty& property = declared.property;
      std::size_t count = 1;
      if (property.is_list) {
        count = parse_number<std::uint32_t>(cursor.token("a list's count"), cursor);
        if (count > cursor.remaining()) cursor.fail("a list is longer than the file.");
        property.sizes.push_back(static_cast<std::uint32_t>(count));
      }
      std::visit(
          [&](auto& values) {
            for (std::size_t i = 0; i < count; ++i) {
              values.push_back(
                  parse_number<Value<decltype(values)>>(cursor.token("its last value"), cursor));
            }
          },
          property.values);
    }
  }
}

std::size_t read_list_count(ByteReader& reader, const ListCount& count) {
  std::int64_t value = 0;
  if (count.bytes == 1) {
    value =
        count.is_signed ? reader.read<std::int8_t>("a list") : reader.read<std::uint8_t>("a list");
  } else if (count.bytes == 2) {
    value = count.is_signed ? reader.read<std::int16_t>("a list")
                            : reader.read<std::uint16_t>("a list");
  } else if (count.is_signed) {
    value = reader.read<std::int32_t>("a list");
  } else {
    value = reader.read<std::uint32_t>("a list");
  }
  if (value < 0) reader.fail("a list has the length " + std::to_string(value) + ".");
  return static_cast<std::size_t>(value);
}

void read_lists(PlyHeader::Element& element, ByteReader& reader, bool big) {
  for (std::size_t row = 0; row < element.count; ++row) {
    for (Declared& declared : element.properties) {
      PlyProperty& property = declared.property;
      std::size_t count = 1;
      if (property.is_list) {
        count = read_list_count(reader, declared.count);
        property.sizes.push_back(static_cast<std::uint32_t>(count));
      }
      std::visit(
          [&](auto& values) {
            using T = Value<decltype(values)>;
            const auto piece = reader.take(count * sizeof(T), "a row");
            for (std::size_t i = 0; i < count; ++i) {
              values.push_back(load<T>(piece.data() + i * sizeof(T), big));
            }
          },
          property.values);
    }
  }
}

void read_binary(PlyHeader::Element& element, ByteReader& reader, bool big,
                 const std::string& name) {
  std::size_t row = 0;
  bool lists = false;
  for (const Declared& declared : element.properties) {
    row += declared.property.is_list ? declared.count.bytes : value_size(declared.property.values);
    lists = lists || declared.property.is_list;
  }
  check_count(element, row, reader.remaining(), reader.offset(), name);
  if (lists) {
    read_lists(element, reader, big);
    return;
  }
  const auto body = reader.take(element.count * row, "the rows");
  std::size_t offset = 0;
  for (Declared& declared : element.properties) {
    std::visit(
        [&](auto& values) {
          using T = Value<decltype(values)>;
          values.resize(element.count);
          for (std::size_t i = 0; i < element.count; ++i) {
            values[i] = load<T>(body.data() + i * row + offset, big);
          }
          offset += sizeof(T);
        },
        declared.property.values);
  }
}

template <class T>
std::vector<T> converted(const Values& values) {
  return std::visit(
      [](const auto& v) {
        std::vector<T> out(v.size());
        for (std::size_t i = 0; i < v.size(); ++i) out[i] = static_cast<T>(v[i]);
        return out;
      },
      values);
}

}  // namespace

std::vector<float> PlyProperty::floats() const { return converted<float>(values); }

std::vector<double> PlyProperty::doubles() const { return converted<double>(values); }

std::vector<std::int64_t> PlyProperty::integers() const {
  return std::visit(
      [](const auto& v) {
        std::vector<std::int64_t> out(v.size());
        for (std::size_t i = 0; i < v.size(); ++i) {
          if constexpr (std::is_floating_point_v<Value<decltype(v)>>) {
            const auto value = static_cast<double>(v[i]);
            out[i] = std::abs(value) < 9.2e18 ? static_cast<std::int64_t>(value) : 0;
          } else {
            out[i] = static_cast<std::int64_t>(v[i]);
          }
        }
        return out;
      },
      values);
}

const PlyProperty* PlyElement::find(std::string_view property) const {
  for (const PlyProperty& candidate : properties) {
    if (candidate.name == property) return &candidate;
  }
  return nullptr;
}

const PlyElement* Ply::find(std::string_view element) const {
  for (const PlyElement& candidate : elements) {
    if (candidate.name == element) return &candidate;
  }
  return nullptr;
}

Ply parse_ply(std::span<const std::byte> bytes, const std::string& name) {
  TextCursor cursor(bytes, name);
  PlyHeader header = parse_header(cursor);
  ByteReader reader(bytes, name, header.format == PlyFormat::kBig);
  reader.seek(cursor.offset(), "the rows");
  Ply ply;
  ply.comments = std::move(header.comments);
  for (PlyHeader::Element& element : header.elements) {
    if (header.format == PlyFormat::kAscii) {
      read_ascii(element, cursor, name);
    } else {
      read_binary(element, reader, header.format == PlyFormat::kBig, name);
    }
    PlyElement read{std::move(element.name), element.count, {}};
    for (Declared& declared : element.properties) {
      read.properties.push_back(std::move(declared.property));
    }
    ply.elements.push_back(std::move(read));
  }
  return ply;
}

Ply read_ply(const std::filesystem::path& path) {
  return parse_ply(read_file(path), path.filename().string());
}

std::vector<double> ply_positions(const Ply& ply, const std::string& name) {
  const PlyElement* vertex = ply.find("vertex");
  if (vertex == nullptr) throw_input(name + ": has no element 'vertex'.");
  std::vector<double> positions(3 * vertex->count);
  std::size_t axis = 0;
  for (const char* key : {"x", "y", "z"}) {
    const PlyProperty* property = vertex->find(key);
    if (property == nullptr || property->is_list) {
      throw_input(name + ": the element 'vertex' has no property '" + key + "'.");
    }
    const std::vector<double> column = property->doubles();
    for (std::size_t i = 0; i < column.size(); ++i) positions[3 * i + axis] = column[i];
    ++axis;
  }
  return positions;
}

}  // namespace matterfit::capture
