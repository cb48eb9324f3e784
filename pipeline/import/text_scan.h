#pragma once
#include <cstddef>
#include <span>
#include <string_view>

#include "format/base/note.h"

namespace texmesh {

// Small pieces of the text formats' readers (OBJ, MTL, PLY, STL). Everything is bounded by the view it works
// on; nothing depends on the locale.

inline bool is_blank(char c) { return c == ' ' || c == '\t' || c == '\r' || c == '\v' || c == '\f'; }
std::string_view trim(std::string_view s);
/// Equal but for the case of ASCII letters.
bool same_word(std::string_view a, std::string_view b);
std::string lower(std::string_view s);
/// The file name's extension in lower case, without the dot.
std::string lower_extension(const std::string& file_name);

/// The next blank-separated token of `rest`, which moves past it; empty at the end.
std::string_view next_token(std::string_view& rest);

/// A whole token as a number, correctly rounded: "-1.5e3", "+2", "nan", "-inf", "1e999" (infinity), and
/// MSVC's "1.#QNAN" and
/// "-1.#IND" (NaN). False for anything else.
bool parse_number(std::string_view token, double& value);
/// A whole token as a decimal integer; false when it is none or does not fit.
bool parse_integer(std::string_view token, std::int64_t& value);

inline std::string_view text_of(std::span<const std::uint8_t> bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

/// What the bytes of a text file say, as UTF-8: without a byte order mark; UTF-16 with such a mark is
/// converted with a note, and what is neither counts as Windows-1252, with the warning "text-encoding" once a
/// model.
class SourceText {
 public:
  /// `bytes` must outlive the text.
  SourceText(std::string_view bytes, const std::string& file, Notes& notes);
  SourceText(const SourceText&) = delete;
  SourceText& operator=(const SourceText&) = delete;
  std::string_view text() const { return text_; }

 private:
  std::string own_;
  std::string_view text_;
};
/// The same for a part of a file that is no text as a whole.
std::string source_text(std::string_view bytes, const std::string& file, Notes& notes);

/// Lines of a text, one by one; "\n", "\r\n" and a lone "\r" end a line.
class LineReader {
 public:
  explicit LineReader(std::string_view text, std::size_t first_line = 1)
      : rest_(text), number_(first_line - 1) {}
  bool next(std::string_view& line);
  std::size_t number() const { return number_; }  // of the line that next() gave last, from 1
  std::string_view rest() const { return rest_; }
  std::string place() const { return "line " + std::to_string(number_); }

 private:
  std::string_view rest_;
  std::size_t number_;
  // The first "\n" at or after rest_, its end when there is none; nullptr = not looked for.
  const char* line_feed_ = nullptr;
};

/// A text shortened for a message, with control characters replaced.
std::string quote(std::string_view s);

/// Nobody reads more notes of one kind, and each is compared with all others.
inline constexpr std::size_t kMostNotesOfCode = 1000;
/// Adds a note, unless one of this code says the same already. Behind kMostNotesOfCode one says that there
/// are more.
void add_once(Notes& notes, Severity severity, const char* code, const std::string& place,
              const std::string& text);

}  // namespace texmesh
