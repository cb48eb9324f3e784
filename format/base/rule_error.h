#pragma once

#include "format/base/errors.h"

namespace texmesh {

/// A package breaks a rule of format/SPEC.md. what() ends with the rule's name: `... expected 1, found 2
/// [K03]`.
class RuleError : public FormatError {
 public:
  RuleError(std::string rule, const FormatError& error)
      : FormatError(error),
        rule_(std::move(rule)),
        message_(std::string(error.FormatError::what()) + " [" + rule_ + "]") {}
  RuleError(std::string rule, std::string file, std::string place, std::string expected, std::string found)
      : RuleError(std::move(rule),
                  FormatError(std::move(file), std::move(place), std::move(expected), std::move(found))) {}
  const std::string& rule() const { return rule_; }
  const char* what() const noexcept override { return message_.c_str(); }

 private:
  std::string rule_, message_;
};

/// The rule that an error names; "" where the error names none.
inline std::string rule_of(const Error& error) {
  const auto* breach = dynamic_cast<const RuleError*>(&error);
  return breach ? breach->rule() : "";
}

/// Runs `body`. A FormatError that names no rule leaves as a breach of `rule`.
template <class Body>
decltype(auto) under_rule(const char* rule, Body&& body) {
  try {
    return body();
  } catch (const RuleError&) {
    throw;
  } catch (const FormatError& e) {
    throw RuleError(rule, e);
  }
}

/// Calls fail(expected, found) of a reader of bytes (BytesIn), which says where it stands; the error is a
/// breach of `rule`.
template <class Reader>
[[noreturn]] void fail_by(const char* rule, const Reader& reader, std::string expected, std::string found) {
  try {
    reader.fail(std::move(expected), std::move(found));
  } catch (const FormatError& e) {
    throw RuleError(rule, e);
  }
}

}  // namespace texmesh
