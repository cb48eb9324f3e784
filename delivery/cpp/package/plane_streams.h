#pragma once

#include "format/base/bytes.h"
#include "format/documents/tables.h"
#include "format/model/codec.h"

namespace texmesh {

/// The streams of one plane while its packs are gone through. Keeps lower packs only where the codec's upper
/// rungs need them. Sizes are checked; contents are not.
class PlaneStreams {
 public:
  /// `table_pack`: the table streams of all rungs. FormatError when it has another size than the tables say.
  PlaneStreams(Codec codec, const PlaneTables& tables, Bytes table_pack);
  /// A rung's pack; with an incremental codec from the lowest rung upwards. FormatError when it has another
  /// size than the tables say or is not the next one.
  void add_pack(std::size_t rung, Bytes pack);
  /// Of the rung added last: the rung's own stream of a fragment (empty: not stored), and the complete file.
  ByteSpan stream(std::size_t fragment) const;
  Bytes file(std::size_t fragment) const;
  ByteSpan table_stream(std::size_t rung) const;

 private:
  ByteSpan stream(std::size_t rung, std::size_t fragment) const;
  Codec codec_;
  const PlaneTables& tables_;
  Bytes table_pack_;
  std::size_t rung_ = 0;                             // the one added last
  std::vector<Bytes> packs_;                         // [rung]; empty where not needed
  std::vector<std::vector<std::uint64_t>> offsets_;  // [rung][fragment]
};

}  // namespace texmesh
