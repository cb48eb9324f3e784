#include "pipeline/batch/junit.h"

#include <fmt/format.h>

#include "pipeline/io/markup.h"

namespace texmesh {
namespace {

std::string time_attribute(const std::optional<double>& seconds) {
  return seconds ? fmt::format(" time=\"{:.3f}\"", *seconds) : "";
}

std::string attribute(const char* name, const std::string& value) {
  return value.empty() ? "" : fmt::format(" {}=\"{}\"", name, markup_escaped(value));
}

}  // namespace

JunitReport::JunitReport(const JunitSuite& s)
    : text_(fmt::format(
          "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<testsuites>\n<testsuite name=\"{}\" tests=\"{}\" "
          "failures=\"{}\" errors=\"0\" skipped=\"{}\"{}>\n",
          markup_escaped(s.name), s.tests, s.failures, s.skipped, time_attribute(s.seconds))) {}

void JunitReport::add(const JunitCase& c) {
  std::string body;
  if (!c.properties.empty()) {
    body += "\n<properties>";
    for (const auto& [name, value] : c.properties)
      body += fmt::format("<property name=\"{}\" value=\"{}\"/>", name, markup_escaped(value));
    body += "</properties>\n";
  }
  if (!c.skipped.empty())
    body += fmt::format("<skipped message=\"{}\"/>\n", markup_escaped(c.skipped));
  else if (!c.failure.empty() || !c.failure_type.empty())
    body += fmt::format("<failure{} message=\"{}\"/>\n", attribute("type", c.failure_type),
                        markup_escaped(c.failure));
  text_ += fmt::format("<testcase classname=\"{}\" name=\"{}\"{}", markup_escaped(c.class_name),
                       markup_escaped(c.name), time_attribute(c.seconds));
  text_ += body.empty() ? "/>\n" : ">" + body + "</testcase>\n";
}

std::string JunitReport::finish() { return std::exchange(text_, {}) + "</testsuite>\n</testsuites>\n"; }

}  // namespace texmesh
