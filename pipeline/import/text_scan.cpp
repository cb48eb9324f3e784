#include "pipeline/import/text_scan.h"

#include <algorithm>
#include <limits>

#include "pipeline/io/names/closest_word.h"
#include "pipeline/io/uri.h"

namespace texmesh {
namespace {

// from_chars leaves the value alone when it is out of range: a huge one is infinite, a tiny one is 0.
double out_of_range(std::string_view digits, bool negative) {
  const std::size_t e = digits.find_first_of("eE");
  const bool tiny = e == std::string_view::npos ? digits.substr(0, 2) == "0." || digits.front() == '.'
                                                : digits.substr(e + 1, 1) == "-";
  const double x = tiny ? 0 : std::numeric_limits<double>::infinity();
  return negative ? -x : x;
}

}  // namespace

std::string_view trim(std::string_view s) {
  while (!s.empty() && (is_blank(s.front()) || s.front() == '\n')) s.remove_prefix(1);
  while (!s.empty() && (is_blank(s.back()) || s.back() == '\n')) s.remove_suffix(1);
  return s;
}

bool same_word(std::string_view a, std::string_view b) {
  return std::ranges::equal(a, b, {}, lower_letter, lower_letter);
}

std::string lower(std::string_view s) { return in_lower_case(std::string(s)); }

std::string lower_extension(const std::string& file_name) {
  const std::size_t dot = file_name.find_last_of('.'), slash = file_name.find_last_of('/');
  if (dot == std::string::npos || (slash != std::string::npos && dot < slash)) return "";
  return lower(std::string_view(file_name).substr(dot + 1));
}

std::string_view next_token(std::string_view& rest) {
  std::size_t begin = 0;
  while (begin < rest.size() && is_blank(rest[begin])) ++begin;
  std::size_t end = begin;
  while (end < rest.size() && !is_blank(rest[end])) ++end;
  const std::string_view token = rest.substr(begin, end - begin);
  rest.remove_prefix(end);
  return token;
}

bool parse_number(std::string_view token, double& value) {
  std::string_view digits = token;
  bool negative = false;
  if (!digits.empty() && (digits.front() == '+' || digits.front() == '-')) {
    negative = digits.front() == '-';
    digits.remove_prefix(1);
  }
  if (digits.empty() || digits.front() == '-' || digits.front() == '+') return false;
  double x = 0;
  const char* end = digits.data() + digits.size();
  const auto result = std::from_chars(digits.data(), end, x);
  if (result.ec == std::errc::invalid_argument) return false;
  if (result.ptr != end) {
    if (*result.ptr != '#') return false;
    const std::string_view special(result.ptr, static_cast<std::size_t>(end - result.ptr));
    if (special.substr(0, 4) == "#INF")
      x = std::numeric_limits<double>::infinity();
    else if (special.substr(0, 4) == "#IND" || special.substr(0, 3) == "#QN" || special.substr(0, 3) == "#SN")
      x = std::numeric_limits<double>::quiet_NaN();
    else
      return false;
  }
  value = result.ec == std::errc::result_out_of_range ? out_of_range(digits, negative) : negative ? -x : x;
  return true;
}

bool parse_integer(std::string_view token, std::int64_t& value) {
  if (!token.empty() && token.front() == '+') token.remove_prefix(1);
  const auto result = std::from_chars(token.data(), token.data() + token.size(), value);
  return result.ec == std::errc() && result.ptr == token.data() + token.size();
}

bool LineReader::next(std::string_view& line) {
  if (rest_.empty()) return false;
  ++number_;
  // The next LF is remembered: in a file whose lines end in CR, looking for it at every line would
  // take quadratic time.
  const char* begin = rest_.data();
  if (!line_feed_ || line_feed_ < begin) {
    line_feed_ = static_cast<const char*>(std::memchr(begin, '\n', rest_.size()));
    if (!line_feed_) line_feed_ = begin + rest_.size();
  }
  std::size_t end = static_cast<std::size_t>(line_feed_ - begin), skip = std::min(end + 1, rest_.size());
  if (const void* cr = std::memchr(begin, '\r', end)) {
    const auto at = static_cast<std::size_t>(static_cast<const char*>(cr) - begin);
    if (at + 1 != end) skip = at + 1;  // a lone CR; otherwise CR LF
    end = at;
  }
  line = rest_.substr(0, end);
  rest_.remove_prefix(skip);
  return true;
}

namespace {

std::string from_utf16(std::string_view bytes, bool big) {
  std::string text;
  text.reserve(bytes.size() / 2);
  char32_t high = 0;
  for (std::size_t i = 2; i + 1 < bytes.size(); i += 2) {
    const auto byte = [&](bool first) { return static_cast<unsigned char>(bytes[first == big ? i : i + 1]); };
    const char32_t unit = static_cast<char32_t>(byte(true)) << 8 | byte(false);
    const bool low = unit >= 0xdc00 && unit < 0xe000;
    if (high != 0 && low)
      append_utf8(text, 0x10000 + ((high - 0xd800) << 10) + (unit - 0xdc00));
    else if (unit < 0xd800 || unit >= 0xe000)
      append_utf8(text, unit);
    high = unit >= 0xd800 && unit < 0xdc00 ? unit : 0;
  }
  return text;
}

}  // namespace

SourceText::SourceText(std::string_view bytes, const std::string& file, Notes& notes) : text_(bytes) {
  const bool little = bytes.starts_with("\xff\xfe"), big = bytes.starts_with("\xfe\xff");
  if (little || big) {
    own_ = from_utf16(bytes, big);
    text_ = own_;
    add_info(notes, "utf-16-text", file, "the file is UTF-16 and is read as such");
    return;
  }
  if (text_.starts_with("\xef\xbb\xbf")) text_.remove_prefix(3);
  if (is_utf8(text_)) return;
  own_ = source_text(text_, file, notes);
  text_ = own_;
}

std::string source_text(std::string_view bytes, const std::string& file, Notes& notes) {
  constexpr const char* kCode = "text-encoding";
  const auto told = [](const Note& n) { return n.code == kCode; };
  if (!is_utf8(bytes) && std::none_of(notes.begin(), notes.end(), told))
    add_warning(notes, kCode, file, "the file is not UTF-8; its text is read as Windows-1252");
  return utf8_of(bytes);
}

std::string quote(std::string_view s) {
  std::string out = "\"";
  for (char c : s.substr(0, 60)) out += static_cast<unsigned char>(c) < 32 || c == 127 ? '?' : c;
  return out + (s.size() > 60 ? "...\"" : "\"");
}

void add_once(Notes& notes, Severity severity, const char* code, const std::string& place,
              const std::string& text) {
  std::size_t of_code = 0;
  for (const Note& n : notes) {
    if (n.code != code) continue;
    if (n.text == text || ++of_code > kMostNotesOfCode) return;
  }
  const bool is_last = of_code == kMostNotesOfCode;
  notes.push_back({severity, code, place, is_last ? "there are more of these, which are left out" : text});
}

}  // namespace texmesh
