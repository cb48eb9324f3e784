#pragma once
#include <initializer_list>

#include "pipeline/import/text_scan.h"

namespace texmesh {

// The PLY container: header, and the rows of its elements as numbers. What they mean is import_ply's affair.
// Written here because no bounded reader is in Debian: tinyply and happly are not packaged, rply aborts a
// file at the first over-long line, assimp and CGAL lose texture numbers or per-face coordinates.

enum class PlyType : std::uint8_t { kInt8, kUint8, kInt16, kUint16, kInt32, kUint32, kFloat, kDouble };
std::size_t ply_type_bytes(PlyType type);

struct PlyProperty {
  std::string name;
  PlyType type = PlyType::kFloat;
  bool is_list = false;
  PlyType count_type = PlyType::kUint8;
};

struct PlyElement {
  std::string name;
  std::uint64_t count = 0;
  std::vector<PlyProperty> properties;
  /// Index of the first property so named, -1 = none.
  int find_property(std::initializer_list<std::string_view> names) const;
};

enum class PlyEncoding : std::uint8_t { kAscii, kLittleEndian, kBigEndian };

struct PlyHeader {
  PlyEncoding encoding = PlyEncoding::kAscii;
  std::vector<PlyElement> elements;
  std::vector<std::string> comments;  // trimmed
  std::size_t data_offset = 0, lines = 0;
};

/// Throws InputError{file, "line N", ...}.
PlyHeader read_ply_header(const std::string& file, std::span<const std::uint8_t> bytes);

/// One row of an element. `values` holds one number per scalar property (0 for lists), `lists` the numbers of
/// each list property; `extra` are numbers an ASCII line has beyond what the header declares.
struct PlyRow {
  std::vector<double> values;
  std::vector<std::vector<double>> lists;
  std::vector<double> extra;
};

/// Walks the rows of all elements in file order. Memory is one row; every count is checked against the bytes
/// that are left before anything is taken.
class PlyRows {
 public:
  PlyRows(const std::string& file, std::span<const std::uint8_t> bytes, const PlyHeader& header);
  /// To be called for each element in order, before its rows: throws InputError when the rest of the file is
  /// shorter than the element must be.
  void begin(const PlyElement& element);
  /// Reads the next row. An ASCII row is a line; a line with too few numbers goes on in the next one,
  /// what a line has too many is `extra`. Throws InputError at the end of the data and for anything that
  /// is no number.
  void next(PlyRow& row);
  /// Where the last row that was read ends.
  std::size_t end() const { return bytes_.size() - left(); }
  /// "vertex 17 (line 29)" or "vertex 17 (byte 812)".
  std::string place() const;

 private:
  void next_ascii(PlyRow& row);
  void next_binary(PlyRow& row);
  double ascii_number();
  double binary_number(PlyType type);
  std::size_t list_count(double count, std::size_t least_bytes_each) const;
  std::size_t left() const;

  std::string file_;
  std::span<const std::uint8_t> bytes_;
  PlyEncoding encoding_;
  std::size_t at_ = 0;
  LineReader lines_;         // of an ASCII file
  std::string_view tokens_;  // what is left of the line at hand
  const PlyElement* element_ = nullptr;
  std::uint64_t row_ = 0;
};

}  // namespace texmesh
