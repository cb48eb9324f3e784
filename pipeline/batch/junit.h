#pragma once
#include <cstddef>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace texmesh {

/// A test case of a report; texts may hold anything.
struct JunitCase {
  std::string class_name, name;
  std::optional<double> seconds;
  std::vector<std::pair<std::string, std::string>> properties;
  std::string failure, failure_type;  // the case failed where there is a text
  std::string skipped;                // it was not reached where there is one
};

struct JunitSuite {
  std::string name;
  std::size_t tests = 0, failures = 0, skipped = 0;
  std::optional<double> seconds;
};

/// Results for CI systems that read JUnit's XML.
class JunitReport {
 public:
  explicit JunitReport(const JunitSuite& suite);
  void add(const JunitCase& one);
  /// The report, which is empty afterwards.
  std::string finish();

 private:
  std::string text_;
};

}  // namespace texmesh
