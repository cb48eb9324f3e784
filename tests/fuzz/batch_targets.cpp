// What runs of the compiler leave to each other and what users write for them: memos, records of the cache,
// collections, profiles, a worker's words, summaries.
#include <unistd.h>

#include <algorithm>
#include <cstring>
#include <filesystem>
#include <fstream>

#include "format/base/archive.h"
#include "format/base/errors.h"
#include "pipeline/about/source_annotations.h"
#include "pipeline/batch/fleet/run_summary.h"
#include "pipeline/batch/memo/memo_segment.h"
#include "pipeline/batch/plan.h"
#include "pipeline/cache/cache_files.h"
#include "pipeline/compile/options.h"
#include "pipeline/compile/workers/worker.h"
#include "tests/fuzz/fuzz_target.h"

namespace texmesh::fuzz {
namespace {

std::string text_of(ByteSpan bytes) { return {bytes.begin(), bytes.end()}; }

/// In memory, where there is /dev/shm. Removed at the end.
class OneFile {
 public:
  explicit OneFile(const char* ending)
      : path_(std::string(::access("/dev/shm", W_OK) == 0 ? "/dev/shm" : "/tmp") + "/texmesh-fuzz-" +
              std::to_string(::getpid()) + ending) {}
  ~OneFile() { ::unlink(path_.c_str()); }
  OneFile(const OneFile&) = delete;
  OneFile& operator=(const OneFile&) = delete;
  const std::string& write(ByteSpan bytes) const {
    std::ofstream(path_, std::ios::binary)
        .write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
    return path_;
  }

 private:
  std::string path_;
};

/// The first byte chooses between a finished segment and one that grows.
bool read_memo(ByteSpan input) {
  static const OneFile finished(".seg"), open(".open");
  if (input.empty()) return false;
  std::vector<MemoEntry> entries;
  const auto segment = MemoSegment::read((input[0] & 1 ? finished : open).write(input.subspan(1)),
                                         [&](const MemoEntry& e) { entries.push_back(e); });
  require(segment != nullptr, "a segment that cannot be opened");
  for (const MemoEntry& e : entries) {
    try {
      segment->memo(e);
      segment->keys(e);
    } catch (const FormatError&) {
    }
  }
  return !entries.empty() && !segment->is_damaged();
}

/// Packed records alone, without the file around them.
bool read_memo_record(ByteSpan input) {
  try {
    const Bytes once = encode_artefact(decode_artefact<PackageMemo>(input, "memo"));
    require(encode_artefact(decode_artefact<PackageMemo>(once, "memo")) == once,
            "a memo's record changed by being packed");
    return true;
  } catch (const FormatError& e) {
    return refused(e);
  }
}

bool read_cache_record(ByteSpan input) {
  const auto record = read_entry(input);
  if (!record) return false;
  const std::string again = write_entry(*record);
  const auto twice = read_entry({reinterpret_cast<const std::uint8_t*>(again.data()), again.size()});
  require(twice && twice->outputs == record->outputs, "a record changed by being written");
  return true;
}

template <class Read>
bool unless_refused(const Read& read) {
  try {
    read();
    return true;
  } catch (const Error& e) {
    return refused(e);
  }
}

bool read_as_profile(ByteSpan input) {
  CompileOptions options;
  return unless_refused([&] { read_profile(options, text_of(input), "fuzz"); });
}

bool read_as_collection(ByteSpan input) {
  static const CompileOptions base;
  return unless_refused([&] {
    read_collection(text_of(input), "fuzz", base, [](const std::string&) {
      return std::vector<std::string>{"a.obj", "b/c.glb"};
    });
  });
}

bool read_as_notes(ByteSpan input) {
  return unless_refused([&] {
    Notes notes;
    write_annotations(read_source_annotations(input, "fuzz", notes));
  });
}

bool read_as_summary(ByteSpan input) {
  return unless_refused([&] {
    const RunSummary summary = read_summary(input, "fuzz");
    write_junit(summary);
    recorded_costs_s(summary);
    const std::string once = write_summary(summary);
    read_summary({reinterpret_cast<const std::uint8_t*>(once.data()), once.size()}, "fuzz");
  });
}

/// Every line an event of a child, which may be somebody else's by then.
bool read_events(ByteSpan input) {
  WorkerReport report;
  const std::string text = text_of(input);
  bool any = false;
  for (std::size_t at = 0; at < text.size();) {
    const std::size_t end = std::min(text.find('\n', at), text.size());
    const auto event = read_event(text.substr(at, end - at));
    if (event) apply_event(*event, 1, report);
    any = any || event;
    at = end + 1;
  }
  return any;
}

// ---- seeds

PackageMemo a_record() {
  PackageMemo r;
  r.seconds = 1.5;
  r.looked_at_ns = 7;
  r.files = {{"", true, {}, 5, {0, 1, 5, 2, 3}}, {"a.png", false, {}, 0, {}}};
  r.keys["import"] = {};
  r.keys["ladder"] = {};
  return r;
}

std::vector<Bytes> memo_seeds() {
  const std::string folder =
      std::filesystem::temp_directory_path() / ("texmesh-fuzz-memo-" + std::to_string(::getpid()));
  MemoSegmentWriter writer(folder);
  for (const char* name : {"a", "b"}) {
    writer.add(memo_name(name), a_record());
    writer.flush();
  }
  writer.finish();
  Bytes seed = read_whole(writer.path()).value();
  std::filesystem::remove_all(folder);
  Bytes open = seed;
  seed.insert(seed.begin(), 1);
  open.insert(open.begin(), 0);
  return {seed, open};
}

/// A digest in front of every block: 8 bytes of length, 32 of digest, behind 1 + 8 bytes.
Bytes with_block_digests(ByteSpan input) {
  Bytes bytes(input.begin(), input.end());
  for (std::size_t at = 9; at + 40 <= bytes.size();) {
    std::uint64_t length = 0;
    std::memcpy(&length, bytes.data() + at, 8);
    if (length > bytes.size() - at - 40) {
      length = bytes.size() - at - 40;
      std::memcpy(bytes.data() + at, &length, 8);
    }
    const Sha256 digest = sha256(ByteSpan(bytes).subspan(at + 40, static_cast<std::size_t>(length)));
    std::memcpy(bytes.data() + at + 8, digest.data(), digest.size());
    at += 40 + static_cast<std::size_t>(length);
    std::uint64_t body = 0;  // its size ends the payload
    if (length >= 8) std::memcpy(&body, bytes.data() + at - 8, 8);
    at += static_cast<std::size_t>(std::min<std::uint64_t>(body, bytes.size()));
  }
  return bytes;
}

std::vector<Bytes> cache_seeds() {
  Key key("ladder", 3);
  key.add("option ladder.rungs", "4").add_input("mesh", {}, 17);
  return {to_bytes(write_entry({key.preimage(), {{"ladder", {}, 12}, {"ladder.tables", {}, 0}}}))};
}

/// The digest behind the text: the last 66 bytes (cache_files.h).
Bytes sealed_again(ByteSpan input) {
  constexpr std::size_t kSealBytes = 66;
  if (input.size() < kSealBytes) return {input.begin(), input.end()};
  return to_bytes(seal(text_of(input.first(input.size() - kSealBytes))));
}

std::vector<Bytes> notes_seeds() {
  return {
      to_bytes(R"x([{"name":"A","content":{"raw":"![a](https://a.b/c)"},"position":[1,2,3],
            "eye":[0,0,1],"target":[0,0,0]}])x"),
      to_bytes(R"({"models":[{"annotations":[{"titles":{"EN":"A"},"leads":{"EN":"<i>t"},"position":[0,1,2],
            "direction":[0,0,2]}]}]})"),
      to_bytes(R"x({"items":[{"type":"Annotation","label":{"en":["A"]},
            "body":{"value":"<p>t","format":"text/html","language":["de"]},
            "target":{"selector":[{"value":"POINT Z (1 2 3)"},{"x":1,"y":2,"z":3}]}}]})x")};
}

std::vector<Bytes> collection_seeds() {
  return {
      to_bytes(R"({"version":1,"options":{"ladder":{"rungs":[30,60]}},"about":{"licence":"CC-BY-4.0"},
    "patterns":[{"match":"*.obj","options":{"import":{"up":"z"}}}],
    "models":[{"input":"a/b.obj","output":"b.texmesh","about":{"title":"B"}},{"input":"c.glb"}]})"),
      to_bytes(
          R"({"version":1,"folders":["x"],"patterns":[{"match":"*a*b*c?[d-e]","about":{"title":"D"}}]})")};
}

std::vector<Bytes> summary_seeds() {
  RunSummary summary;
  ModelSummary m;
  m.model = "a.obj", m.output = "out/a.texmesh", m.package = "a.texmesh";
  m.result = ModelResult::kOk, m.ran = true, m.bytes = 5, m.seconds = 1;
  summary.models = {m, m};
  summary.models[1].package = "b.texmesh", summary.models[1].result = ModelResult::kFailed,
  summary.models[1].error.kind = "input";
  summary.shard = Shard{1, 4};
  summary.collection = "0123";
  return {to_bytes(write_summary(summary))};
}

std::vector<Bytes> event_seeds() {
  return {to_bytes(to_json_line(ErrorTold{"", {"input", "a.obj", "", "", "", "bad"}}) + "\n" +
                   to_json_line(StageStarted{"", "import"}) + "\n" +
                   to_json_line(StageFinished{"", "import", "hit", 0}) + "\n" +
                   to_json_line(PackageMade{"", false, 5}) + "\n" +
                   to_json_line(InputsTold{"", a_record().files, Sha256{}, {{"ssf", Sha256{}}}}))};
}

}  // namespace

void add_batch_targets(std::vector<Target>& list) {
  list.insert(list.end(),
              {{"memo", true, read_memo, memo_seeds, Shape::kBytes, with_block_digests},
               {"memo_record", true, read_memo_record,
                [] { return std::vector<Bytes>{encode_artefact(a_record())}; }},
               {"cache_record",
                true,
                read_cache_record,
                cache_seeds,
                Shape::kBytes,
                sealed_again,
                {"\"version\": 2", "\"key\": {", "\"outputs\": [", "\"name\":", "\"sha256\":", "\"bytes\":"}},
               {"profile", false, read_as_profile,
                [] { return std::vector<Bytes>{to_bytes(write_profile(CompileOptions{}))}; }, Shape::kJson},
               {"collection", false, read_as_collection, collection_seeds, Shape::kJson},
               {"notes", false, read_as_notes, notes_seeds, Shape::kJson},
               {"summary", false, read_as_summary, summary_seeds, Shape::kJson},
               {"events", false, read_events, event_seeds}});
}

}  // namespace texmesh::fuzz
