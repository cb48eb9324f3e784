#include "tools/cli/options/probe_options.h"

#include "tools/cli/options/command_line.h"
#include "tools/cli/options/units.h"

namespace texmesh {

void add_probe_options(Command& c, ProbeArguments& a) {
  c.option(
       "--probe", a.mode,
       "Test packets beside the textures, which measure the link and cost a part of it: fixed = of one size "
       "at regular intervals; adaptive = half as large and as frequent below a threshold, twice from it on")
      .one_of_explained({"off", "fixed", "adaptive"})
      .value_name("NAME")
      .shows_default()
      .rare();
  c.option("--probe-size", a.packet, "A test packet, of adaptive ones the first: 64 B to 16 MiB")
      .value_name("BYTES")
      .shows_default()
      .rare();
  c.option("--probe-interval", a.interval, "From one test packet to the next: 10 ms to an hour")
      .value_name("TIME")
      .shows_default()
      .rare();
  c.option("--probe-threshold", a.threshold, "The threshold of adaptive test packets")
      .value_name("RATE")
      .shows_default()
      .rare();
}

ProbeOptions probe_options(const ProbeArguments& a) {
  ProbeOptions o;
  o.mode = a.mode == "fixed"      ? ProbeMode::kFixed
           : a.mode == "adaptive" ? ProbeMode::kAdaptive
                                  : ProbeMode::kOff;
  o.packet_bytes = static_cast<double>(parse_bytes(a.packet, "--probe-size"));
  o.interval_s = parse_duration(a.interval, "--probe-interval");
  o.threshold_bytes_s = parse_bandwidth(a.threshold, "--probe-threshold");
  if (!(o.packet_bytes >= 64 && o.packet_bytes <= 1 << 24))
    throw UsageError("--probe-size", "", "64 B to 16 MiB", a.packet);
  if (!(o.interval_s >= 0.01 && o.interval_s <= 3600))
    throw UsageError("--probe-interval", "", "10 ms to an hour", a.interval);
  if (!(o.threshold_bytes_s > 0)) throw UsageError("--probe-threshold", "", "a rate above 0", a.threshold);
  return o;
}

}  // namespace texmesh
