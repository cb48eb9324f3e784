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

}  // namespace texmesh
