#include "pipeline/import/range/range_scan_document.h"

#include <nlohmann/json.hpp>

#include "format/base/bounded_json.h"
#include "pipeline/import/text_scan.h"

namespace texmesh {
namespace {

constexpr std::size_t kMaxJsonBytes = 1 << 20, kMaxGridHeaderBytes = 1 << 16;

/// Reads the fields of an object one by one. Fields that were not read are unknown ones:
/// finish() refuses them.
class Members {
 public:
  Members(const std::string& file, const nlohmann::ordered_json& object) : file_(file) {
    if (!object.is_object()) throw InputError(file_, "/", "an object", object.type_name());
    for (const auto& [name, value] : object.items()) values_.emplace(name, &value);
  }
  std::optional<std::string> text(const char* name) {
    const auto* value = remove_field(name);
    if (!value) return std::nullopt;
    if (!value->is_string() || value->template get_ref<const std::string&>().empty())
      fail(name, "a text that is not empty", *value);
    return value->template get<std::string>();
  }
  std::optional<double> number(const char* name, double lo, double hi, bool above_lo = false) {
    const auto* value = remove_field(name);
    if (!value) return std::nullopt;
    const double x = value->is_number() ? value->template get<double>() : NAN;
    if (!(x >= lo && x <= hi) || (above_lo && x == lo))
      fail(name,
           "a number from " + nlohmann::json(lo).dump() + (above_lo ? " (excluded)" : "") + " to " +
               nlohmann::json(hi).dump(),
           *value);
    return x;
  }
  template <class T>
  static T need(const std::string& file, const char* name, std::optional<T> value) {
    if (!value) throw InputError(file, std::string("/") + name, "a value", "none");
    return *value;
  }
  void finish() const {
    if (!values_.empty())
      throw InputError(file_, "/" + values_.begin()->first, "only known fields", "another one");
  }
  [[noreturn]] void fail(const char* name, const std::string& expected,
                         const nlohmann::ordered_json& found) const {
    throw InputError(file_, std::string("/") + name, expected, found.dump().substr(0, 60));
  }

 private:
  const nlohmann::ordered_json* remove_field(const char* name) {
    const auto it = values_.find(name);
    if (it == values_.end()) return nullptr;
    const auto* value = it->second;
    values_.erase(it);
    return value;
  }
  const std::string& file_;
  std::map<std::string, const nlohmann::ordered_json*> values_;
};

nlohmann::ordered_json parse(const std::string& file, std::span<const std::uint8_t> json) {
  if (json.size() > kMaxJsonBytes)
    throw InputError(file, "", "at most " + std::to_string(kMaxJsonBytes) + " bytes of JSON",
                     std::to_string(json.size()));
  try {
    return parse_bounded_json(json, file, 16);
  } catch (const FormatError& e) {
    throw InputError(file, e.place(), e.expected(), e.found());
  }
}

// The KEY=VALUE lines of a Cyberware file.
struct CyberwareHeader {
  std::map<std::string, std::string> values;
  std::size_t data_offset = 0;
};

CyberwareHeader read_cyberware_header(const std::string& file, std::span<const std::uint8_t> bytes) {
  CyberwareHeader header;
  const std::string_view text = text_of(bytes).substr(0, kMaxGridHeaderBytes);
  std::size_t at = 0, line = 0;
  for (;;) {
    const std::size_t end = text.find('\n', at);
    if (end == std::string_view::npos)
      throw InputError(file, "line " + std::to_string(line + 1), "DATA=", "the end of the header");
    const std::string_view words = trim(text.substr(at, end - at));
    at = end + 1;
    ++line;
    if (line == 1) {
      if (words != "Cyberware Digitizer Data")
        throw InputError(file, "line 1", "\"Cyberware Digitizer Data\"", quote(words));
      continue;
    }
    if (words == "DATA=") break;
    const std::size_t equals = words.find('=');
    if (equals != std::string_view::npos)
      header.values.try_emplace(std::string(words.substr(0, equals)), trim(words.substr(equals + 1)));
  }
  header.data_offset = at;
  return header;
}

std::int64_t integer(const std::string& file, const CyberwareHeader& header, const char* key, std::int64_t lo,
                     std::int64_t hi) {
  const auto it = header.values.find(key);
  std::int64_t value = 0;
  if (it == header.values.end() || !parse_integer(it->second, value) || value < lo || value > hi)
    throw InputError(file, key, "a whole number from " + std::to_string(lo) + " to " + std::to_string(hi),
                     it == header.values.end() ? "none" : quote(it->second));
  return value;
}

}  // namespace

RangeScanDescription read_range_scan_description(const std::string& file,
                                                 std::span<const std::uint8_t> json) {
  const nlohmann::ordered_json document = parse(file, json);
  Members members(file, document);
  RangeScanDescription d;
  if (Members::need(file, "version", members.number("version", 1, 1)) != 1)
    throw InputError(file, "/version", "1", "another");
  if (Members::need(file, "type", members.text("type")) != "cylindrical-range-scan")
    throw InputError(file, "/type", "\"cylindrical-range-scan\"", "another type");
  d.grid = Members::need(file, "grid", members.text("grid"));
  d.texture = members.text("texture");
  d.alpha_step_deg = members.number("alpha_step_deg", 0, 120, true);
  d.alpha_start_deg = members.number("alpha_start_deg", -360, 360).value_or(0);
  if (const auto direction = members.text("direction")) {
    if (*direction != "clockwise" && *direction != "counter-clockwise")
      members.fail("direction", "\"clockwise\" or \"counter-clockwise\"", document["direction"]);
    d.clockwise = *direction == "clockwise";
  }
  d.y_step = Members::need(file, "y_step", members.number("y_step", 0, 1e12, true));
  d.y_top = members.number("y_top", -1e15, 1e15);
  d.radius_scale = members.number("radius_scale", 0, 1e15, true).value_or(1);
  d.radius_offset = members.number("radius_offset", -1e15, 1e15).value_or(0);
  d.valid_min = members.number("valid_min", -1e300, 1e300);
  d.valid_max = members.number("valid_max", -1e300, 1e300);
  d.max_radius_step = members.number("max_radius_step", 0, 1e15, true);
  members.text("$schema");
  members.finish();
  return d;
}

RangeScan read_cyberware(const std::string& file, std::span<const std::uint8_t> bytes,
                         const ImportOptions& options, Notes& notes) {
  const CyberwareHeader header = read_cyberware_header(file, bytes);
  if (const auto space = header.values.find("SPACE");
      space != header.values.end() && space->second != "CYLINDRICAL")
    throw InputError(file, "SPACE", "CYLINDRICAL", quote(space->second));
  RangeScan scan;
  scan.columns = static_cast<std::uint32_t>(integer(file, header, "NLG", 2, 65535));
  scan.rows = static_cast<std::uint32_t>(integer(file, header, "NLT", 2, 65535));
  scan.alpha_step_rad = static_cast<double>(integer(file, header, "LGINCR", 1, 3'000'000)) * 1e-6;
  scan.y_step = static_cast<double>(integer(file, header, "LTINCR", 1, 1'000'000'000)) * 1e-3;
  const auto shift = integer(file, header, "RSHIFT", 0, 15);
  scan.y_top = scan.y_step * (scan.rows - 1);
  const auto right = header.values.find("THETA_RIGHTHAND");
  scan.clockwise = right == header.values.end() || !same_word(right->second, "TRUE");
  if (header.values.count("COLOR"))
    add_info(notes, "colour-not-read", "COLOR",
             "the colours of a Cyberware scan stand in another file, which is not read");
  const std::uint64_t samples = std::uint64_t{scan.columns} * scan.rows;
  if (samples > static_cast<std::uint64_t>(options.max_vertices))
    throw InputError(file, "NLG x NLT", "at most " + std::to_string(options.max_vertices),
                     std::to_string(samples));
  if (bytes.size() - header.data_offset < samples * 2)
    throw InputError(file, "DATA", std::to_string(samples * 2) + " bytes",
                     std::to_string(bytes.size() - header.data_offset));
  scan.radius.resize(samples);
  const std::uint8_t* data = bytes.data() + header.data_offset;
  for (std::uint32_t i = 0; i < scan.columns; ++i)
    for (std::uint32_t j = 0; j < scan.rows; ++j, data += 2) {
      const auto value = static_cast<std::int16_t>(data[0] << 8 | data[1]);
      // Latitude 0 is at the bottom.
      scan.radius[std::size_t{scan.rows - 1 - j} * scan.columns + i] =
          value > 0 ? static_cast<float>(static_cast<double>(std::int32_t{value} << shift) * 1e-3) : 0.0f;
    }
  return scan;
}

}  // namespace texmesh
