#pragma once
#include <cstdint>
#include <memory>
#include <nlohmann/json_fwd.hpp>
#include <span>

#include "format/base/finding.h"

namespace texmesh {

/// A GLB file whose chunks, buffer views and accessors have been checked and whose data can be read. Elements
/// that are broken have given a finding and are marked `ok == false`; nothing that is ok reaches outside the
/// file's bytes. check_glb.h is the interface; this header is shared with its implementation only.
class GlbDocument {
 public:
  using Json = nlohmann::ordered_json;

  /// Thrown after a finding was added: the element that is being looked at is beyond use.
  struct Broken {};

  struct View {
    std::span<const std::uint8_t> data;  // decoded where the view is compressed
    std::size_t stride = 0;              // 0 = tightly packed
    bool ok = false;
  };
  struct Accessor {
    std::int64_t view = -1;  // -1: zeros, or the data comes from Draco
    std::size_t offset = 0, count = 0, components = 0, component_bytes = 0, stride = 0;
    int component_type = 0;
    bool normalized = false, ok = false;
  };

  /// `standalone`: GlbRules::kStandalone.
  GlbDocument(std::span<const std::uint8_t> bytes, std::string entry, Findings& findings,
              bool standalone = false);
  ~GlbDocument();
  GlbDocument(const GlbDocument&) = delete;
  GlbDocument& operator=(const GlbDocument&) = delete;

  /// Reads everything; false when the file is too broken to look at its elements.
  bool load();

  bool standalone() const { return standalone_; }
  const Json& root() const { return *root_; }
  const std::vector<View>& views() const { return views_; }
  const std::vector<Accessor>& accessors() const { return accessors_; }
  bool uses_extension(const std::string& name) const;

  /// Component `c` of element `i` as a number; normalised integers are mapped to 0..1 or -1..1.
  double value(const Accessor& a, std::size_t i, std::size_t c) const;

  [[noreturn]] void fail(const Check& check, const std::string& field, const std::string& expected,
                         const std::string& found);
  /// The JSON pointer of an element of a top-level array.
  static std::string element(const char* array, std::size_t i) {
    return std::string("/") + array + "/" + std::to_string(i);
  }
  /// The array under `key`, an empty one when absent.
  const Json& array(const Json& object, const char* key, const std::string& place);
  /// A non-negative integer under `key`, or `fallback` when absent.
  std::uint64_t number(const Json& object, const char* key, std::uint64_t fallback, const std::string& place);
  /// A required index below `size`.
  std::size_t index(const Json& object, const char* key, std::size_t size, const std::string& place);
  /// Runs `body`; a Broken ends it, other exceptions become findings of `check`.
  bool guarded(const char* check, const std::string& place, auto&& body) {
    try {
      body();
      return true;
    } catch (const Broken&) {
    } catch (const Error& e) {
      findings_.add(check, entry_, place, e.expected(), e.found());
    } catch (const std::bad_alloc&) {
      findings_.add(check, entry_, place, "data that fits the memory limit", "more");
    } catch (const std::exception& e) {
      findings_.add(check, entry_, place, "", e.what());
    }
    return false;
  }
  Findings& findings() { return findings_; }
  const std::string& entry() const { return entry_; }

 private:
  bool load_chunks();
  bool load_json();
  void load_buffers();
  void load_view(std::size_t i);
  void decode_meshopt(View& view, const Json& extension, const std::string& place);
  void load_accessor(std::size_t i);

  std::span<const std::uint8_t> bytes_, json_, binary_;
  std::string entry_;
  Findings& findings_;
  bool standalone_ = false;
  std::unique_ptr<Json> root_;               // never null
  std::vector<std::uint64_t> buffer_bytes_;  // declared; 0 bytes readable for all but buffer 0
  std::vector<View> views_;
  std::vector<std::vector<std::uint8_t>> decoded_;
  std::uint64_t decoded_bytes_ = 0;
  std::vector<Accessor> accessors_;
};

}  // namespace texmesh
