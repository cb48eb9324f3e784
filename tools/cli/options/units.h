#pragma once
#include <cstdint>
#include <vector>

#include "pipeline/io/resolver.h"

namespace texmesh {

/// What was asked for on the command line makes no sense: exit code 2. The file is the flag.
struct UsageError : InputError {
  using InputError::InputError;
};

/// Runs what reads what was asked for: an InputError of it becomes a UsageError, but for rights.
template <class Run>
auto as_usage(const Run& run) {
  try {
    return run();
  } catch (const PermissionError&) {
    throw;
  } catch (const InputError& e) {
    throw UsageError(e.file(), e.place(), e.expected(), e.found());
  }
}

/// "" for the text of a number from `least` to `most`, which NaN is not (CLI::Range lets it pass); else what
/// is wrong.
std::string number_fault(const std::string& text, double least, double most);

/// Gives a word the spelling of the list, which has it in any case; "", or what is wrong.
std::string choice_fault(std::string& word, const std::vector<std::string>& words);

/// "500MB", "8GiB", "1234". UsageError that names the flag.
std::uint64_t parse_bytes(const std::string& text, const std::string& flag);

/// The same, above 0.
std::uint64_t parse_some_bytes(const std::string& text, const std::string& flag);

/// "90d", "12h", "30min", "45s", "45". UsageError that names the flag.
std::int64_t parse_seconds(const std::string& text, const std::string& flag);

/// "4", "1.5s", "250ms", in seconds, at most 1e6. UsageError that names the flag.
double parse_duration(const std::string& text, const std::string& flag);

/// "2Mbit/s", "41.68kB/s", in bytes per second, at most 1e12. UsageError that names the flag.
double parse_bandwidth(const std::string& text, const std::string& flag);

}  // namespace texmesh
