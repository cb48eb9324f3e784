#pragma once
#include <new>
#include <string>

#include "format/base/errors.h"
#include "format/base/finding.h"

namespace texmesh {

/// Runs `body`; what it throws about the package becomes a finding, and the result is false.
template <class Body>
bool guarded(Findings& findings, const Check& check, const std::string& entry, Body&& body) {
  try {
    body();
    return true;
  } catch (const FormatError& e) {
    findings.add(check, entry, e);
  } catch (const std::bad_alloc&) {
    findings.add(check, entry, "", "data that fits the memory limit", "more");
  }
  return false;
}

}  // namespace texmesh
