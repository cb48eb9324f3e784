#pragma once
#include <stdexcept>
#include <string>

namespace texmesh {

/// What every texmesh error carries: the file (or document), the place in it, what was expected and what was
/// found. Any of them may be empty; what() joins those that are not into one line: `bunny.glb:
/// /accessors/3/count: expected <= 100000, found 2147483648`.
class Error : public std::runtime_error {
 public:
  Error(std::string file, std::string place, std::string expected, std::string found);

  const std::string& file() const { return file_; }
  const std::string& place() const { return place_; }
  const std::string& expected() const { return expected_; }
  const std::string& found() const { return found_; }

 private:
  std::string file_, place_, expected_, found_;
};

/// A model, an image, an options file or anything else a user hands in is not what it must be.
struct InputError : Error {
  using Error::Error;
};

/// A package, a table, an index or a cached artefact does not follow its format.
struct FormatError : Error {
  using Error::Error;
};

/// A stage could not do its work on data that import and condition had let through. `file` holds
/// the stage's name.
struct StageError : Error {
  using Error::Error;
};

/// Thrown by RunContext::check_cancelled; never an error of the model.
struct Cancelled : std::runtime_error {
  Cancelled() : std::runtime_error("cancelled") {}
};

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
[[noreturn]] void fail_by(const char* rule, const auto& reader, std::string expected, std::string found) {
  try {
    reader.fail(std::move(expected), std::move(found));
  } catch (const FormatError& e) {
    throw RuleError(rule, e);
  }
}

}  // namespace texmesh
