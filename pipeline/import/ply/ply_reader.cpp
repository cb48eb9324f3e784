#include "pipeline/import/ply/ply_reader.h"

#include <bit>
#include <cmath>
#include <cstring>
#include <optional>

#include "format/base/errors.h"
#include "format/base/json_fields.h"

namespace texmesh {
namespace {

constexpr std::size_t kMaxPlyHeaderBytes = 1 << 20;
constexpr std::size_t kMaxElements = 256, kMaxProperties = 1024;

std::optional<PlyType> type_of(std::string_view word) {
  static constexpr std::pair<std::string_view, PlyType> kTypes[] = {
      {"char", PlyType::kInt8},     {"int8", PlyType::kInt8},     {"uchar", PlyType::kUint8},
      {"uint8", PlyType::kUint8},   {"short", PlyType::kInt16},   {"int16", PlyType::kInt16},
      {"ushort", PlyType::kUint16}, {"uint16", PlyType::kUint16}, {"int", PlyType::kInt32},
      {"int32", PlyType::kInt32},   {"uint", PlyType::kUint32},   {"uint32", PlyType::kUint32},
      {"float", PlyType::kFloat},   {"float32", PlyType::kFloat}, {"double", PlyType::kDouble},
      {"float64", PlyType::kDouble}};
  for (const auto& [name, type] : kTypes)
    if (name == word) return type;
  return std::nullopt;
}

// The header's lines, read as the statements of one document.
class PlyHeaderReader {
 public:
  PlyHeaderReader(const std::string& file, std::string_view text) : file_(file), text_(text), lines_(text) {}

  PlyHeader read() {
    std::string_view line;
    if (!lines_.next(line) || trim(line) != "ply") fail("\"ply\"", quote(line.substr(0, 20)));
    bool has_format = false;
    while (lines_.next(line)) {
      std::string_view rest = line;
      const std::string_view word = next_token(rest);
      if (word == "end_header") {
        if (!has_format) fail("a format line before", "none");
        header_.data_offset = text_.size() - lines_.rest().size();
        // Where lines end in a lone CR, an LF that follows is the first byte of the data.
        if (text_.size() > 4 && text_[3] == '\r' && text_[4] != '\n')
          header_.data_offset =
              std::min(static_cast<std::size_t>(line.data() - text_.data()) + line.size() + 1, text_.size());
        header_.lines = lines_.number();
        return std::move(header_);
      }
      if (word == "format")
        has_format = read_format(rest);
      else if (word == "element")
        read_element(rest);
      else if (word == "property")
        read_property(rest);
      else if (word == "comment" || word == "obj_info")
        header_.comments.emplace_back(trim(rest));
      else if (!word.empty())
        fail("format, element, property, comment or end_header", quote(word));
    }
    fail("end_header",
         text_.size() >= kMaxPlyHeaderBytes ? "a header of more than 1 MiB" : "the end of the file");
  }

 private:
  [[noreturn]] void fail(std::string expected, std::string found) const {
    throw InputError(file_, lines_.place(), std::move(expected), std::move(found));
  }

  bool read_format(std::string_view rest) {
    const std::string_view word = next_token(rest), version = next_token(rest);
    if (word == "ascii")
      header_.encoding = PlyEncoding::kAscii;
    else if (word == "binary_little_endian")
      header_.encoding = PlyEncoding::kLittleEndian;
    else if (word == "binary_big_endian")
      header_.encoding = PlyEncoding::kBigEndian;
    else
      fail("ascii, binary_little_endian or binary_big_endian", quote(word));
    if (version != "1.0") fail("format version 1.0", quote(version));
    return true;
  }

  void read_element(std::string_view rest) {
    PlyElement element;
    element.name = next_token(rest);
    std::int64_t count = 0;
    const std::string_view token = next_token(rest);
    if (element.name.empty() || !parse_integer(token, count) || count < 0)
      fail("element NAME COUNT", quote(element.name + " " + std::string(token)));
    if (header_.elements.size() >= kMaxElements)
      fail("at most " + std::to_string(kMaxElements) + " elements", "more");
    element.count = static_cast<std::uint64_t>(count);
    header_.elements.push_back(std::move(element));
  }

  void read_property(std::string_view rest) {
    if (header_.elements.empty()) fail("an element before its properties", "a property");
    PlyProperty property;
    std::string_view word = next_token(rest);
    if (word == "list") {
      property.is_list = true;
      property.count_type = type_or_fail(next_token(rest));
      word = next_token(rest);
    }
    property.type = type_or_fail(word);
    property.name = next_token(rest);
    if (property.name.empty()) fail("a property name", "none");
    auto& properties = header_.elements.back().properties;
    if (properties.size() >= kMaxProperties)
      fail("at most " + std::to_string(kMaxProperties) + " properties", "more");
    properties.push_back(std::move(property));
  }

  PlyType type_or_fail(std::string_view word) const {
    const std::optional<PlyType> type = type_of(word);
    if (!type) fail("a type such as float or uchar", quote(word));
    return *type;
  }

  const std::string& file_;
  std::string_view text_;
  LineReader lines_;
  PlyHeader header_;
};

template <class T>
double load_number(const std::uint8_t* p, bool swap) {
  std::uint8_t raw[sizeof(T)];
  for (std::size_t i = 0; i < sizeof(T); ++i) raw[i] = p[swap ? sizeof(T) - 1 - i : i];
  T value;
  std::memcpy(&value, raw, sizeof(T));
  return static_cast<double>(value);
}

}  // namespace

std::size_t ply_type_bytes(PlyType type) {
  switch (type) {
    case PlyType::kInt8:
    case PlyType::kUint8:
      return 1;
    case PlyType::kInt16:
    case PlyType::kUint16:
      return 2;
    case PlyType::kInt32:
    case PlyType::kUint32:
    case PlyType::kFloat:
      return 4;
    case PlyType::kDouble:
      break;
  }
  return 8;
}

int PlyElement::find_property(std::initializer_list<std::string_view> names) const {
  for (std::string_view wanted : names)
    for (std::size_t i = 0; i < properties.size(); ++i)
      if (same_word(properties[i].name, wanted)) return static_cast<int>(i);
  return -1;
}

PlyHeader read_ply_header(const std::string& file, std::span<const std::uint8_t> bytes) {
  return PlyHeaderReader(file, text_of(bytes).substr(0, kMaxPlyHeaderBytes)).read();
}

PlyRows::PlyRows(const std::string& file, std::span<const std::uint8_t> bytes, const PlyHeader& header)
    : file_(file),
      bytes_(bytes),
      encoding_(header.encoding),
      at_(header.data_offset),
      lines_(text_of(bytes.subspan(header.data_offset)), header.lines + 1) {}

std::size_t PlyRows::left() const { return bytes_.size() - at_ + tokens_.size(); }

std::string PlyRows::place() const {
  return (element_ ? element_->name + " " + std::to_string(row_) + " " : std::string()) +
         (encoding_ == PlyEncoding::kAscii ? "(" + lines_.place() + ")"
                                           : "(byte " + std::to_string(at_) + ")");
}

void PlyRows::begin(const PlyElement& element) {
  element_ = &element;
  row_ = 0;
  tokens_ = {};
  std::uint64_t least = 0;  // bytes of a row: two characters per number but for the last line's end
  for (const PlyProperty& p : element.properties)
    least += encoding_ == PlyEncoding::kAscii ? 2 : ply_type_bytes(p.is_list ? p.count_type : p.type);
  const std::uint64_t available = left() + (encoding_ == PlyEncoding::kAscii ? 1 : 0);
  if (least > 0 && element.count > available / least)
    throw InputError(file_, "element " + element.name,
                     std::to_string(element.count) + " rows of at least " + std::to_string(least) + " bytes",
                     std::to_string(left()) + " bytes left in the file, which is cut off");
}

void PlyRows::next(PlyRow& row) {
  const std::size_t n = element_->properties.size();
  row.values.assign(n, 0);
  row.lists.resize(n);
  row.extra.clear();
  if (n == 0) return;
  if (encoding_ == PlyEncoding::kAscii)
    next_ascii(row);
  else
    next_binary(row);
  ++row_;
}

// Counts come as doubles: any type may hold one. `least_bytes_each` bounds what the rest of the
// file can hold.
std::size_t PlyRows::list_count(double count, std::size_t least_bytes_each) const {
  if (!(count >= 0) || count != std::floor(count))
    throw InputError(file_, place(), "a list length, 0 or more", shortest_text(count));
  if (count > static_cast<double>(left() / least_bytes_each + 1))
    throw InputError(file_, place(), "a list of " + shortest_text(count) + " numbers",
                     std::to_string(left()) + " bytes left in the file, which is cut off or damaged");
  return static_cast<std::size_t>(count);
}

double PlyRows::ascii_number() {
  std::string_view token = next_token(tokens_);
  while (token.empty()) {
    if (!lines_.next(tokens_)) throw InputError(file_, place(), "more numbers", "the end of the file");
    at_ = bytes_.size() - lines_.rest().size();
    token = next_token(tokens_);
  }
  double value = 0;
  if (!parse_number(token, value)) throw InputError(file_, place(), "a number", quote(token));
  return value;
}

void PlyRows::next_ascii(PlyRow& row) {
  for (std::size_t i = 0; i < row.values.size(); ++i) {
    const PlyProperty& p = element_->properties[i];
    if (!p.is_list) {
      row.values[i] = ascii_number();
      continue;
    }
    const std::size_t n = list_count(ascii_number(), 2);
    row.lists[i].clear();
    for (std::size_t k = 0; k < n; ++k) row.lists[i].push_back(ascii_number());
  }
  while (!trim(tokens_).empty()) row.extra.push_back(ascii_number());
}

double PlyRows::binary_number(PlyType type) {
  const std::size_t size = ply_type_bytes(type);
  if (size > left())
    throw InputError(file_, place(), std::to_string(size) + " more bytes",
                     std::to_string(left()) + " (the end of the file)");
  const std::uint8_t* p = bytes_.data() + at_;
  at_ += size;
  const bool swap = (encoding_ == PlyEncoding::kBigEndian) == (std::endian::native == std::endian::little);
  switch (type) {
    case PlyType::kInt8:
      return load_number<std::int8_t>(p, swap);
    case PlyType::kUint8:
      return load_number<std::uint8_t>(p, swap);
    case PlyType::kInt16:
      return load_number<std::int16_t>(p, swap);
    case PlyType::kUint16:
      return load_number<std::uint16_t>(p, swap);
    case PlyType::kInt32:
      return load_number<std::int32_t>(p, swap);
    case PlyType::kUint32:
      return load_number<std::uint32_t>(p, swap);
    case PlyType::kFloat:
      return load_number<float>(p, swap);
    case PlyType::kDouble:
      break;
  }
  return load_number<double>(p, swap);
}

void PlyRows::next_binary(PlyRow& row) {
  for (std::size_t i = 0; i < row.values.size(); ++i) {
    const PlyProperty& p = element_->properties[i];
    if (!p.is_list) {
      row.values[i] = binary_number(p.type);
      continue;
    }
    const std::size_t n = list_count(binary_number(p.count_type), ply_type_bytes(p.type));
    row.lists[i].clear();
    for (std::size_t k = 0; k < n; ++k) row.lists[i].push_back(binary_number(p.type));
  }
}

}  // namespace texmesh
