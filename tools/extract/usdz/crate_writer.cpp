#include "tools/extract/usdz/crate_writer.h"

#include <array>

namespace texmesh {
namespace {

using Value = CrateWriter::Value;
using Node = CrateWriter::Node;

// Types of values, crateDataTypes.h.
constexpr std::uint64_t kBool = 1, kInt = 3, kFloat = 8, kDouble = 9, kString = 10, kToken = 11, kAsset = 12,
                        kMatrix4d = 15, kVec2f = 20, kVec3f = 24, kVec4f = 28, kDictionary = 31,
                        kTokenListOp = 32, kPathListOp = 34, kTokenVector = 41, kSpecifier = 42,
                        kVariability = 44;
constexpr std::uint64_t kArrayBit = std::uint64_t{1} << 63, kInlinedBit = std::uint64_t{1} << 62,
                        kCompressedBit = std::uint64_t{1} << 61;
constexpr int kTypeShift = 48;
constexpr std::size_t kHeadBytes = 88;
/// Shorter arrays of integers are never packed.
constexpr std::size_t kLeastPacked = 16;
constexpr std::uint32_t kEndOfSet = 0xffffffff;

constexpr Value inlined(std::uint64_t type, std::uint64_t payload) {
  return kInlinedBit | (type << kTypeShift) | payload;
}

std::uint64_t vector_type(std::size_t components) {
  return components == 2 ? kVec2f : components == 3 ? kVec3f : kVec4f;
}

/// What TfFastCompression reads: one chunk, an LZ4 block of a single run of literals.
Bytes lz4_literals(ByteSpan bytes) {
  constexpr std::size_t kInToken = 15, kInByte = 255;
  BytesOut out;
  out.u8(0);
  out.u8(std::min(bytes.size(), kInToken) << 4);
  if (bytes.size() >= kInToken) {
    std::size_t rest = bytes.size() - kInToken;
    for (; rest >= kInByte; rest -= kInByte) out.u8(kInByte);
    out.u8(rest);
  }
  out.raw(bytes);
  return out.finish();
}

/// The differences of neighbours: the commonest one, 2 bits for each that say its width, then those that are
/// not the commonest.
Bytes coded_integers(std::span<const std::uint32_t> v) {
  std::vector<std::int32_t> steps;
  std::map<std::int32_t, std::size_t> counts;
  std::uint32_t last = 0;
  for (const std::uint32_t x : v) {
    steps.push_back(static_cast<std::int32_t>(x - last));
    ++counts[steps.back()];
    last = x;
  }
  std::int32_t common = 0;
  std::size_t most = 0;
  for (const auto& [step, count] : counts)
    if (count >= most) common = step, most = count;
  BytesOut rest;
  Bytes codes((v.size() * 2 + 7) / 8);
  for (std::size_t i = 0; i < steps.size(); ++i) {
    const std::int32_t s = steps[i];
    if (s == common) continue;
    const int code = s == static_cast<std::int8_t>(s) ? 1 : s == static_cast<std::int16_t>(s) ? 2 : 3;
    codes[i / 4] = static_cast<std::uint8_t>(codes[i / 4] | code << (2 * (i % 4)));
    rest.number(static_cast<std::uint32_t>(s), 1 << (code - 1));
  }
  BytesOut out;
  out.u32(static_cast<std::uint32_t>(common));
  out.raw(codes);
  out.raw(rest.finish());
  return out.finish();
}

/// Bytes behind their number.
void add_sized(BytesOut& out, ByteSpan bytes) {
  out.u64(bytes.size());
  out.raw(bytes);
}

void add_integers(BytesOut& out, std::span<const std::uint32_t> v) {
  add_sized(out, lz4_literals(coded_integers(v)));
}

}  // namespace

CrateWriter::CrateWriter() {
  for (std::size_t i = 0; i < kHeadBytes; ++i) out_.u8(0);
  token_index("specifier");  // token 0, whose number says nothing of its sign, is no property
  entries_.push_back({Kind::kLayer, 0, {}, {}, {}});
}

std::uint32_t CrateWriter::token_index(std::string_view text) {
  const auto found = token_indices_.find(text);
  if (found != token_indices_.end()) return found->second;
  const auto index = static_cast<std::uint32_t>(tokens_.size());
  tokens_.emplace_back(text);
  token_indices_.emplace(text, index);
  return index;
}

std::uint32_t CrateWriter::string_index(std::string_view text) {
  strings_.push_back(token_index(text));
  return static_cast<std::uint32_t>(strings_.size() - 1);
}

Value CrateWriter::token(std::string_view text) { return inlined(kToken, token_index(text)); }
Value CrateWriter::text(std::string_view text) { return inlined(kString, string_index(text)); }
Value CrateWriter::asset(std::string_view path) { return inlined(kAsset, token_index(path)); }
Value CrateWriter::number(float x) { return inlined(kFloat, std::bit_cast<std::uint32_t>(x)); }
Value CrateWriter::integer(std::int32_t x) { return inlined(kInt, static_cast<std::uint32_t>(x)); }
Value CrateWriter::flag(bool x) { return inlined(kBool, x ? 1 : 0); }
Value CrateWriter::uniform() { return inlined(kVariability, 1); }

Value CrateWriter::place(std::uint64_t type) {
  while (out_.size() % 8 != 0) out_.u8(0);
  return (type << kTypeShift) | out_.size();
}

Value CrateWriter::number(double x) {
  const Value value = place(kDouble);
  out_.u64(std::bit_cast<std::uint64_t>(x));
  return value;
}

Value CrateWriter::vector(std::span<const float> v) {
  const Value value = place(vector_type(v.size()));
  for (const float x : v) out_.f32(x);
  return value;
}

Value CrateWriter::matrix(const std::array<double, 16>& rows) {
  const Value value = place(kMatrix4d);
  for (const double x : rows) out_.u64(std::bit_cast<std::uint64_t>(x));
  return value;
}

Value CrateWriter::array(std::span<const float> v, std::size_t components) {
  const Value value = place(vector_type(components)) | kArrayBit;
  out_.u64(v.size() / components);
  for (const float x : v) out_.f32(x);
  return value;
}

Value CrateWriter::array(std::span<const std::int32_t> v) {
  const Value value = place(kInt) | kArrayBit;
  out_.u64(v.size());
  std::vector<std::uint32_t> numbers(v.begin(), v.end());
  if (v.size() >= kLeastPacked) {
    add_integers(out_, numbers);
    return value | kCompressedBit;
  }
  for (const std::uint32_t x : numbers) out_.u32(x);
  return value;
}

Value CrateWriter::token_array(const std::vector<std::string>& v) {
  const Value value = place(kToken) | kArrayBit;
  out_.u64(v.size());
  for (const std::string& t : v) out_.u32(token_index(t));
  return value;
}

Value CrateWriter::prepended(const std::vector<std::string>& tokens) {
  constexpr std::uint64_t kPrepended = 32;
  const Value value = place(kTokenListOp);
  out_.u8(kPrepended);
  out_.u64(tokens.size());
  for (const std::string& t : tokens) out_.u32(token_index(t));
  return value;
}

Value CrateWriter::targets(const std::vector<Node>& nodes) {
  constexpr std::uint64_t kExplicit = 1, kExplicitItems = 2;
  const Value value = place(kPathListOp);
  out_.u8(kExplicit | kExplicitItems);
  out_.u64(nodes.size());
  for (const Node n : nodes) out_.u32(n);
  return value;
}

Value CrateWriter::dictionary(const std::vector<NamedText>& texts) {
  const Value value = place(kDictionary);
  out_.u64(texts.size());
  for (const NamedText& t : texts) {
    out_.u32(string_index(t.name));
    out_.u64(8);  // the value's place, from here
    out_.u64(text(t.text));
  }
  return value;
}

Node CrateWriter::add(Node parent, Kind kind, std::string_view name) {
  const auto node = static_cast<Node>(entries_.size());
  entries_.push_back({kind, token_index(name), {}, {}, {}});
  (kind == Kind::kPrim ? entries_[parent].prims : entries_[parent].properties).push_back(node);
  return node;
}

Node CrateWriter::prim(Node parent, std::string_view name, std::string_view type) {
  const Node node = add(parent, Kind::kPrim, name);
  set(node, "specifier", inlined(kSpecifier, 0));
  set(node, "typeName", token(type));
  return node;
}

Node CrateWriter::attribute(Node prim, std::string_view name, std::string_view type) {
  const Node node = add(prim, Kind::kAttribute, name);
  set(node, "typeName", token(type));
  return node;
}

Node CrateWriter::attribute(Node prim, std::string_view name, std::string_view type, Value value) {
  const Node node = attribute(prim, name, type);
  set(node, "default", value);
  return node;
}

Node CrateWriter::connection(Node prim, std::string_view name, std::string_view type, Node source) {
  const Node node = attribute(prim, name, type);
  set(node, "connectionPaths", targets({source}));
  return node;
}

Node CrateWriter::relationship(Node prim, std::string_view name, Node target) {
  const Node node = add(prim, Kind::kRelationship, name);
  set(node, "variability", uniform());
  set(node, "targetPaths", targets({target}));
  return node;
}

void CrateWriter::set(Node node, std::string_view field, Value value) {
  entries_[node].fields.push_back({token_index(field), value});
}

Value CrateWriter::token_vector(const std::vector<Node>& nodes) {
  const Value value = place(kTokenVector);
  out_.u64(nodes.size());
  for (const Node n : nodes) out_.u32(entries_[n].name);
  return value;
}

void CrateWriter::list_children() {
  for (Node n = 0; n < entries_.size(); ++n) {
    if (!entries_[n].properties.empty()) set(n, "properties", token_vector(entries_[n].properties));
    if (!entries_[n].prims.empty()) set(n, "primChildren", token_vector(entries_[n].prims));
  }
}

Bytes CrateWriter::tokens_section() const {
  BytesOut text, out;
  for (const std::string& t : tokens_) {
    text.text(t);
    text.u8(0);
  }
  const Bytes bytes = text.finish();
  out.u64(tokens_.size());
  out.u64(bytes.size());
  add_sized(out, lz4_literals(bytes));
  return out.finish();
}

/// Fills the sets of fields, each behind the other, and where each entry's set begins.
Bytes CrateWriter::fields_section(std::vector<std::uint32_t>& sets,
                                  std::vector<std::uint32_t>& set_of) const {
  std::map<std::pair<std::uint32_t, Value>, std::uint32_t> known;
  std::vector<std::uint32_t> names;
  BytesOut values;
  for (const Entry& e : entries_) {
    set_of.push_back(static_cast<std::uint32_t>(sets.size()));
    for (const Field& f : e.fields) {
      const auto [at, is_new] =
          known.try_emplace({f.name, f.value}, static_cast<std::uint32_t>(names.size()));
      if (is_new) {
        names.push_back(f.name);
        values.u64(f.value);
      }
      sets.push_back(at->second);
    }
    sets.push_back(kEndOfSet);
  }
  BytesOut out;
  out.u64(names.size());
  add_integers(out, names);
  add_sized(out, lz4_literals(values.finish()));
  return out.finish();
}

/// The tree of paths, parents before children. A jump tells what follows a path: its child, its sibling, or
/// both, and then how far away the sibling is.
Bytes CrateWriter::paths_section() const {
  constexpr std::int32_t kLeaf = -2, kChildAlone = -1, kSiblingAlone = 0;
  std::vector<std::uint32_t> nodes, elements, jumps;
  struct Visit {
    Node node;
    bool last;                      // of its parent's children
    std::size_t first_of_both = 0;  // of a later sibling: 1 + the place whose jump leads here
  };
  std::vector<Visit> open{{0, true, 0}};
  while (!open.empty()) {
    const Visit v = open.back();
    open.pop_back();
    const Entry& e = entries_[v.node];
    const std::size_t at = nodes.size();
    if (v.first_of_both > 0)
      jumps[v.first_of_both - 1] = static_cast<std::uint32_t>(at - (v.first_of_both - 1));
    const bool property = e.kind == Kind::kAttribute || e.kind == Kind::kRelationship;
    nodes.push_back(v.node);
    elements.push_back(property ? 0 - e.name : e.name);
    std::vector<Node> children = e.prims;
    children.insert(children.end(), e.properties.begin(), e.properties.end());
    const bool both = !children.empty() && !v.last;
    jumps.push_back(static_cast<std::uint32_t>(!children.empty() ? kChildAlone
                                               : v.last          ? kLeaf
                                                                 : kSiblingAlone));
    if (both) open.back().first_of_both = at + 1;
    for (std::size_t k = children.size(); k-- > 0;)
      open.push_back({children[k], k + 1 == children.size(), 0});
  }
  BytesOut out;
  out.u64(nodes.size());
  out.u64(nodes.size());
  add_integers(out, nodes);
  add_integers(out, elements);
  add_integers(out, jumps);
  return out.finish();
}

Bytes CrateWriter::specs_section(const std::vector<std::uint32_t>& set_of) const {
  std::vector<std::uint32_t> nodes, kinds;
  for (Node n = 0; n < entries_.size(); ++n) {
    nodes.push_back(n);
    kinds.push_back(static_cast<std::uint32_t>(entries_[n].kind));
  }
  BytesOut out;
  out.u64(nodes.size());
  add_integers(out, nodes);
  add_integers(out, set_of);
  add_integers(out, kinds);
  return out.finish();
}

Bytes CrateWriter::finish() {
  list_children();
  std::vector<std::uint32_t> sets, set_of;
  const Bytes fields = fields_section(sets, set_of);
  BytesOut strings, field_sets;
  strings.u64(strings_.size());
  for (const std::uint32_t s : strings_) strings.u32(s);
  field_sets.u64(sets.size());
  add_integers(field_sets, sets);
  const std::pair<std::string_view, Bytes> sections[] = {
      {"TOKENS", tokens_section()},       {"STRINGS", strings.finish()}, {"FIELDS", fields},
      {"FIELDSETS", field_sets.finish()}, {"PATHS", paths_section()},    {"SPECS", specs_section(set_of)}};
  constexpr std::size_t kNameBytes = 16;
  BytesOut contents;
  contents.u64(std::size(sections));
  for (const auto& [name, bytes] : sections) {
    place(0);
    contents.text(name);
    for (std::size_t i = name.size(); i < kNameBytes; ++i) contents.u8(0);
    contents.u64(out_.size());
    contents.u64(bytes.size());
    out_.raw(bytes);
  }
  place(0);
  const std::size_t contents_at = out_.size();
  out_.raw(contents.finish());
  BytesOut head;
  head.text("PXR-USDC");
  for (const int part : {0, 7, 0, 0, 0, 0, 0, 0}) head.u8(static_cast<std::uint64_t>(part));
  head.u64(contents_at);
  const Bytes start = head.finish();
  Bytes file = out_.finish();
  std::copy(start.begin(), start.end(), file.begin());
  return file;
}

}  // namespace texmesh
