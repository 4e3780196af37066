// SPDX-License-Identifier: GPL-3.0-or-later
// One NumPy array: numpy.lib.format (NEP 1), versions 1.0 to 3.0.
#include <bit>
#include <cmath>
#include <limits>
#include <type_traits>

#include "base/error.hpp"
#include "capture/byte_reader.hpp"
#include "capture/npz.hpp"

namespace matterfit::capture {
namespace {

constexpr std::size_t kMaxDimensions = 32;
constexpr std::size_t kMaxTextLength = 65536;

struct NpyHeader {
  std::string descr;
  bool fortran = false;
  std::vector<std::size_t> shape;
};

/// The Python dict literal of a header, as far as numpy writes it.
class HeaderParser {
 public:
  HeaderParser(std::string text, const std::string& name) : text_(std::move(text)), name_(name) {}

  NpyHeader parse() {
    NpyHeader header;
    bool has_descr = false;
    bool has_order = false;
    bool has_shape = false;
    expect('{');
    while (!accept('}')) {
      const std::string key = quoted();
      expect(':');
      if (key == "descr") {
        if (peek() == '[') fail("is a structured array. Save its fields as arrays of their own.");
        header.descr = quoted();
        has_descr = true;
      } else if (key == "fortran_order") {
        header.fortran = boolean();
        has_order = true;
      } else if (key == "shape") {
        header.shape = tuple();
        has_shape = true;
      } else {
        fail("has a header key '" + key + "' that is not known.");
      }
      if (!accept(',') && peek() != '}') fail("has a damaged header.");
    }
    if (!has_descr || !has_order || !has_shape) fail("has an incomplete header.");
    return header;
  }

 private:
  [[noreturn]] void fail(const std::string& reason) const { throw_input(name_ + ": " + reason); }
  char peek() {
    while (cursor_ < text_.size() && (text_[cursor_] == ' ' || text_[cursor_] == '\n')) ++cursor_;
    return cursor_ < text_.size() ? text_[cursor_] : '\0';
  }
  bool accept(char c) {
    if (peek() != c) return false;
    ++cursor_;
    return true;
  }
  void expect(char c) {
    if (!accept(c)) fail(std::string("has a damaged header: expected '") + c + "'.");
  }
  std::string quoted() {
    const char quote = peek();
    if (quote != '\'' && quote != '"') fail("has a damaged header: expected a string.");
    const std::size_t begin = ++cursor_;
    const std::size_t end = text_.find(quote, begin);
    if (end == std::string::npos) fail("has a damaged header: a string does not end.");
    cursor_ = end + 1;
    return text_.substr(begin, end - begin);
  }
  bool boolean() {
    peek();
    for (const auto& [word, value] : {std::pair{"True", true}, std::pair{"False", false}}) {
      if (text_.compare(cursor_, std::strlen(word), word) == 0) {
        cursor_ += std::strlen(word);
        return value;
      }
    }
    fail("has a damaged header: expected True or False.");
  }
  std::vector<std::size_t> tuple() {
    std::vector<std::size_t> shape;
    expect('(');
    while (!accept(')')) {
      std::size_t value = 0;
      bool digits = false;
      for (char c = peek(); c >= '0' && c <= '9';
           c = cursor_ < text_.size() ? text_[cursor_] : '\0') {
        const auto digit = static_cast<std::size_t>(c - '0');
        if (value > (std::numeric_limits<std::size_t>::max() - digit) / 10) {
          fail("has a dimension that is too large.");
        }
        value = value * 10 + digit;
        digits = true;
        ++cursor_;
      }
      if (!digits) fail("has a damaged header: the shape.");
      accept('L');  // Python 2 wrote long integers so.
      shape.push_back(value);
      if (shape.size() > kMaxDimensions) fail("has too many dimensions.");
      if (!accept(',') && peek() != ')') fail("has a damaged header: the shape.");
    }
    return shape;
  }

  std::string text_;
  const std::string& name_;
  std::size_t cursor_ = 0;
};

/// Product of the shape, or nothing on overflow.
bool count_values(const std::vector<std::size_t>& shape, std::size_t& count) {
  count = 1;
  bool overflow = false;
  for (const std::size_t n : shape) {
    if (n == 0) {
      count = 0;
      return true;
    }
    overflow = overflow || count > std::numeric_limits<std::size_t>::max() / n;
    if (!overflow) count *= n;
  }
  return !overflow;
}

template <class T>
void to_c_order(const std::vector<std::size_t>& shape, std::vector<T>& values) {
  if (shape.size() < 2 || values.empty()) return;
  std::vector<std::size_t> stride(shape.size(), 1);
  for (std::size_t d = 1; d < shape.size(); ++d) stride[d] = stride[d - 1] * shape[d - 1];
  std::vector<std::size_t> index(shape.size(), 0);
  std::vector<T> ordered(values.size());
  std::size_t source = 0;
  for (T& value : ordered) {
    value = std::move(values[source]);
    for (std::size_t d = shape.size(); d-- > 0;) {
      source += stride[d];
      if (++index[d] < shape[d]) break;
      source -= stride[d] * shape[d];
      index[d] = 0;
    }
  }
  values = std::move(ordered);
}

/// IEEE 754 binary16.
float half_to_float(std::uint16_t half) {
  const std::uint32_t sign = (half & 0x8000U) << 16U;
  const std::uint32_t exponent = (half >> 10U) & 31U;
  const std::uint32_t mantissa = half & 0x3FFU;
  if (exponent == 31) return std::bit_cast<float>(sign | 0x7F800000U | (mantissa << 13U));
  if (exponent == 0) {
    const float value = std::ldexp(static_cast<float>(mantissa), -24);
    return sign != 0 ? -value : value;
  }
  return std::bit_cast<float>(sign | ((exponent + 112U) << 23U) | (mantissa << 13U));
}

template <class Stored, class Kept, class Convert>
Array::Data convert(std::span<const std::byte> bytes, std::size_t count, const NpyHeader& header,
                    const Convert& to_kept) {
  std::vector<Kept> values(count);
  if constexpr (std::is_same_v<Stored, Kept>) {
    if (count > 0) std::memcpy(values.data(), bytes.data(), count * sizeof(Kept));
    if constexpr (std::is_same_v<Kept, std::uint8_t>) {
      for (auto& value : values) value = to_kept(value);
    }
  } else {
    for (std::size_t i = 0; i < count; ++i) {
      values[i] = to_kept(load<Stored>(bytes.data() + i * sizeof(Stored)));
    }
  }
  if (header.fortran) to_c_order(header.shape, values);
  return values;
}

void append_utf8(std::string& text, std::uint32_t c) {
  const auto put = [&](std::uint32_t byte) { text.push_back(static_cast<char>(byte)); };
  if (c < 0x80) {
    put(c);
  } else if (c < 0x800) {
    put(0xC0U | (c >> 6U));
    put(0x80U | (c & 63U));
  } else if (c < 0x10000) {
    put(0xE0U | (c >> 12U));
    put(0x80U | ((c >> 6U) & 63U));
    put(0x80U | (c & 63U));
  } else {
    put(0xF0U | (c >> 18U));
    put(0x80U | ((c >> 12U) & 63U));
    put(0x80U | ((c >> 6U) & 63U));
    put(0x80U | (c & 63U));
  }
}

Array::Data read_texts(std::span<const std::byte> bytes, std::size_t count, std::size_t length,
                       bool unicode, const NpyHeader& header, const std::string& name) {
  std::vector<std::string> texts(count);
  for (std::size_t i = 0; i < count; ++i) {
    std::size_t pending_nul = 0;
    for (std::size_t k = 0; k < length; ++k) {
      const std::size_t at = i * length + k;
      const std::uint32_t c = unicode ? load<std::uint32_t>(bytes.data() + at * 4)
                                      : std::to_integer<std::uint32_t>(bytes[at]);
      if (c == 0) {
        ++pending_nul;  // Padding, unless something follows.
        continue;
      }
      if (c > 0x10FFFF || (c >= 0xD800 && c < 0xE000)) {
        throw_input(name + ": text " + std::to_string(i) + " holds no valid character at " +
                    std::to_string(k) + ".");
      }
      for (; pending_nul > 0; --pending_nul) texts[i].push_back('\0');
      append_utf8(texts[i], c);
    }
  }
  if (header.fortran) to_c_order(header.shape, texts);
  return texts;
}

std::size_t item_size(const NpyHeader& header, const std::string& name) {
  const std::string& d = header.descr;
  const auto refuse = [&](const std::string& why) {
    throw_input(name + ": has element type '" + d + "'" + why);
  };
  if (d == "|O") refuse(" (Python objects). Save plain arrays of equal lengths.");
  if (d.size() < 3) refuse(", which is not known.");
  if (d[0] == '>') refuse(" (big-endian). Save it with .astype('<f8') or '<i8'.");
  if (d[0] != '<' && d[0] != '|') refuse(", which is not known.");
  std::size_t digits = 0;
  for (std::size_t i = 2; i < d.size(); ++i) {
    if (d[i] < '0' || d[i] > '9' || i > 8) refuse(", which is not known.");
    digits = digits * 10 + static_cast<std::size_t>(d[i] - '0');
  }
  if (d[1] == 'U' || d[1] == 'S') {
    if (digits > kMaxTextLength) refuse(": text of that length is refused.");
    return d[1] == 'U' ? digits * 4 : digits;
  }
  const std::string type = d.substr(1);
  for (const char* known :
       {"f2", "f4", "f8", "i1", "i2", "i4", "i8", "u1", "u2", "u4", "u8", "b1"}) {
    if (type == known) return digits;
  }
  refuse(", expected f4, f8, i4, i8, u1, bool or text.");
  return 0;
}

Array::Data read_values(std::span<const std::byte> bytes, std::size_t count,
                        const NpyHeader& header, const std::string& name) {
  const auto keep = [](auto value) { return value; };
  const char kind = header.descr[1];
  if (kind == 'U' || kind == 'S') {
    const std::size_t length = std::stoul(header.descr.substr(2));
    return read_texts(bytes, count, length, kind == 'U', header, name);
  }
  const std::string type = header.descr.substr(1);
  using F = float;
  using I4 = std::int32_t;
  using I8 = std::int64_t;
  using U1 = std::uint8_t;
  if (type == "f4") return convert<F, F>(bytes, count, header, keep);
  if (type == "f8") return convert<double, double>(bytes, count, header, keep);
  if (type == "f2") return convert<std::uint16_t, F>(bytes, count, header, half_to_float);
  if (type == "i4") return convert<I4, I4>(bytes, count, header, keep);
  if (type == "i8") return convert<I8, I8>(bytes, count, header, keep);
  if (type == "u1") return convert<U1, U1>(bytes, count, header, keep);
  if (type == "b1") {
    return convert<U1, U1>(bytes, count, header, [](U1 v) { return static_cast<U1>(v != 0); });
  }
  if (type == "i1")
    return convert<std::int8_t, I4>(bytes, count, header,
                                    [](std::int8_t value) { return static_cast<I4>(value); });
  if (type == "i2") return convert<std::int16_t, I4>(bytes, count, header, keep);
  if (type == "u2") return convert<std::uint16_t, I4>(bytes, count, header, keep);
  if (type == "u4") return convert<std::uint32_t, I8>(bytes, count, header, keep);
  return convert<std::uint64_t, I8>(bytes, count, header, [&](std::uint64_t v) {
    if (v > static_cast<std::uint64_t>(std::numeric_limits<I8>::max())) {
      throw_input(name + ": holds " + std::to_string(v) + ", too large for a signed integer.");
    }
    return static_cast<I8>(v);
  });
}

}  // namespace

std::size_t Array::size() const {
  return std::visit([](const auto& values) { return values.size(); }, data);
}

std::string Array::shape_text() const {
  std::string text = "(";
  for (std::size_t i = 0; i < shape.size(); ++i) {
    text += (i > 0 ? ", " : "") + std::to_string(shape[i]);
  }
  return text + (shape.size() == 1 ? ",)" : ")");
}

namespace {
template <class T>
std::vector<T> converted(const Array& array, const std::string& what) {
  return std::visit(
      [&](const auto& values) -> std::vector<T> {
        using Value = typename std::decay_t<decltype(values)>::value_type;
        if constexpr (std::is_same_v<Value, std::string>) {
          throw_input(what + " holds text, expected numbers.");
        } else {
          std::vector<T> out(values.size());
          for (std::size_t i = 0; i < values.size(); ++i) out[i] = static_cast<T>(values[i]);
          return out;
        }
      },
      array.data);
}
}  // namespace

std::vector<double> Array::doubles(const std::string& what) const {
  return converted<double>(*this, what);
}

std::vector<float> Array::floats(const std::string& what) const {
  return converted<float>(*this, what);
}

std::vector<std::int64_t> Array::integers(const std::string& what) const {
  const auto check = [&](const auto& values) {
    using Value = typename std::decay_t<decltype(values)>::value_type;
    if constexpr (std::is_floating_point_v<Value>) {
      for (const Value value : values) {
        if (!(std::abs(value) < Value(9.2e18)) || std::trunc(value) != value) {
          throw_input(what + " holds " + std::to_string(value) + ", expected whole numbers.");
        }
      }
    }
  };
  std::visit(check, data);
  return converted<std::int64_t>(*this, what);
}

const std::vector<std::string>& Array::texts(const std::string& what) const {
  if (!is_text()) throw_input(what + " holds numbers, expected text.");
  return std::get<std::vector<std::string>>(data);
}

Array parse_npy(std::span<const std::byte> bytes, const std::string& name,
                const NpzLimits& limits) {
  ByteReader reader(bytes, name);
  const auto magic = reader.take(6, "the NumPy magic");
  if (std::memcmp(magic.data(), "\x93NUMPY", 6) != 0) {
    throw_input(name + ": is not a NumPy array (it does not begin with \\x93NUMPY).");
  }
  const auto major = reader.read<std::uint8_t>("the version");
  (void)reader.read<std::uint8_t>("the version");
  if (major < 1 || major > 3) {
    throw_input(name + ": has NumPy format version " + std::to_string(major) +
                ", expected 1, 2 or 3.");
  }
  const std::size_t header_size = major == 1 ? reader.read<std::uint16_t>("the header's size")
                                             : reader.read<std::uint32_t>("the header's size");
  const auto raw = reader.take(header_size, "the header");
  const NpyHeader header =
      HeaderParser(std::string(reinterpret_cast<const char*>(raw.data()), raw.size()), name)
          .parse();

  Array array;
  array.shape = header.shape;
  const std::size_t item = item_size(header, name);
  std::size_t count = 0;
  if (!count_values(header.shape, count) ||
      (item > 0 && count > std::numeric_limits<std::size_t>::max() / item)) {
    throw_input(name + ": has shape " + array.shape_text() + ", which is too large.");
  }
  // Zero-length text takes no bytes in the file but memory here.
  if (item == 0 && count > limits.entries) {
    throw_input(name + ": has " + std::to_string(count) + " empty texts.");
  }
  if (count * item != reader.remaining()) {
    throw_input(name + ": has shape " + array.shape_text() + " of " + header.descr +
                ", which takes " + std::to_string(count * item) + " bytes, but " +
                std::to_string(reader.remaining()) + " follow its header at byte " +
                std::to_string(reader.offset()) +
                (count * item > reader.remaining() ? ". Is it truncated?" : "."));
  }
  if (count * item > limits.bytes) {
    throw_input(name + ": takes " + std::to_string(count * item) +
                " bytes, more than the limit of " + std::to_string(limits.bytes) + ".");
  }
  array.boolean = header.descr.substr(1) == "b1";
  array.data = read_values(reader.take(count * item, "the values"), count, header, name);
  return array;
}

}  // namespace matterfit::capture
