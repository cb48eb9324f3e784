#include "pipeline/about/licence.h"

#include <algorithm>
#include <optional>
#include <span>
#include <string_view>

#include "format/documents/about.h"
#include "pipeline/about/code_tables.h"

namespace texmesh {
namespace {

constexpr int kMaxBrackets = 16;
constexpr const char* kListedLicences = "https://spdx.org/licenses/";

char lower_letter(char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c; }

bool letters_before(std::string_view a, std::string_view b) {
  return std::ranges::lexicographical_compare(a, b, {}, lower_letter, lower_letter);
}

/// The list's own spelling.
std::optional<std::string_view> find_name(std::span<const std::string_view> names, std::string_view name) {
  const auto it = std::ranges::lower_bound(names, name, letters_before);
  if (it == names.end() || letters_before(name, *it)) return std::nullopt;
  return *it;
}

bool is_word(std::string_view text) {
  return !text.empty() && std::ranges::all_of(text, [](char c) {
    return (lower_letter(c) >= 'a' && lower_letter(c) <= 'z') || (c >= '0' && c <= '9') || c == '-' ||
           c == '.';
  });
}

/// A recursive descent over one expression; writes it anew with the list's spellings.
class SpdxExpression {
 public:
  explicit SpdxExpression(std::string_view text) : rest_(text) { advance(); }

  bool read() { return read_or(0) && token_.empty(); }
  const std::string& spelled() const { return out_; }
  bool is_single() const { return words_ == 1; }
  /// Where reading has stopped.
  std::string wrong() const { return std::string(token_); }

 private:
  void advance() {
    while (!rest_.empty() && rest_.front() == ' ') rest_.remove_prefix(1);
    std::size_t n = 0;
    while (n < rest_.size() && rest_[n] != ' ' && rest_[n] != '(' && rest_[n] != ')') ++n;
    token_ = rest_.substr(0, n == 0 && !rest_.empty() ? 1 : n);
    rest_.remove_prefix(token_.size());
  }
  /// AND, OR and WITH are spelled in capitals or in small letters.
  bool take(std::string_view word) {
    if (!std::ranges::equal(token_, word, {}, lower_letter, lower_letter)) return false;
    advance();
    return true;
  }
  bool read_or(int depth) {
    if (!read_and(depth)) return false;
    while (take("or")) {
      out_ += " OR ";
      if (!read_and(depth)) return false;
    }
    return true;
  }
  bool read_and(int depth) {
    if (!read_term(depth)) return false;
    while (take("and")) {
      out_ += " AND ";
      if (!read_term(depth)) return false;
    }
    return true;
  }
  bool read_term(int depth) {
    if (token_ == "(") {
      if (depth == kMaxBrackets) return false;
      advance();
      out_ += '(';
      if (!read_or(depth + 1) || token_ != ")") return false;
      out_ += ')';
      advance();
      return true;
    }
    return read_licence_name() && read_exception();
  }
  bool read_licence_name() {
    ++words_;
    std::string_view name = token_;
    if (const auto colon = name.find(':');
        name.starts_with("DocumentRef-") && colon != std::string_view::npos) {
      if (!is_word(name.substr(12, colon - 12)) || !name.substr(colon + 1).starts_with("LicenseRef-"))
        return false;
      name.remove_prefix(colon + 1);
    }
    if (name.starts_with("LicenseRef-")) {
      if (!is_word(name.substr(11))) return false;
      words_ += 2;  // such a licence is in no list: it has no page there
      out_ += token_;
    } else {
      const bool or_later = name.ends_with("+");
      auto listed = find_name({kSpdxLicences, kSpdxLicenceCount}, name);
      if (!listed && or_later)
        listed = find_name({kSpdxLicences, kSpdxLicenceCount}, name.substr(0, name.size() - 1));
      if (!listed) return false;
      out_ += *listed;
      if (or_later && !listed->ends_with("+")) out_ += '+', ++words_;
    }
    advance();
    return true;
  }
  bool read_exception() {
    if (!take("with")) return true;
    ++words_;
    const auto listed = find_name({kSpdxExceptions, kSpdxExceptionCount}, token_);
    if (!listed) return false;
    out_ += " WITH ";
    out_ += *listed;
    advance();
    return true;
  }

  std::string_view rest_, token_;
  std::string out_;
  int words_ = 0;
};

std::string_view without_blanks(std::string_view text) {
  while (!text.empty() && text.front() == ' ') text.remove_prefix(1);
  while (!text.empty() && text.back() == ' ') text.remove_suffix(1);
  return text;
}

}  // namespace

Licence read_licence(const std::string& given) {
  const std::string text(without_blanks(given));
  Licence licence{Licence::Kind::kOther, text, "", ""};
  if (is_web_url(text)) return {Licence::Kind::kUrl, text, text, ""};
  if (const auto bracket = text.find(" (http"); bracket != std::string::npos && text.ends_with(")")) {
    const std::string url = text.substr(bracket + 2, text.size() - bracket - 3);
    Licence named = read_licence(text.substr(0, bracket));
    if (named.kind == Licence::Kind::kSpdx && is_web_url(url)) {
      named.url = url;
      return named;
    }
  }
  SpdxExpression expression(text);
  if (!expression.read()) {
    licence.wrong = expression.wrong();
    return licence;
  }
  licence.kind = Licence::Kind::kSpdx;
  licence.text = expression.spelled();
  if (expression.is_single()) licence.url = kListedLicences + licence.text + ".html";
  return licence;
}

bool is_epsg_code(std::uint64_t code) {
  const std::span<const EpsgRun> runs(kEpsgRuns, kEpsgRunCount);
  const auto after = std::ranges::upper_bound(runs, code, {}, &EpsgRun::first);
  return after != runs.begin() && code <= std::prev(after)->last;
}

}  // namespace texmesh
