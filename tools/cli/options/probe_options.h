#pragma once
#include <string>

#include "delivery/cpp/decide/bandwidth_monitor.h"

namespace texmesh {

class Command;

/// What fetch and simulate ask about test packets.
struct ProbeArguments {
  std::string mode = "off", packet = "8kB", interval = "500ms", threshold = "1Mbit/s";
};
void add_probe_options(Command& command, ProbeArguments& args);
/// UsageError names the flag.
ProbeOptions probe_options(const ProbeArguments& args);

}  // namespace texmesh
