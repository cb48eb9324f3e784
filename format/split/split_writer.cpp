#include "format/split/split_writer.h"

#include <compare>

#include "format/base/buckets.h"
#include "format/base/sha256.h"
#include "format/split/split_codec.h"
#include "format/split/split_head.h"

namespace texmesh {

// The writer of mesh/stream.bin. A SplitSource says which splits lead from one scale to the next finer one.
// SplitTruth follows the stream's mesh beside the source, and answers what SplitCodec asks about the split or
// face under way. EncodingChannel codes these answers at once and keeps the values' symbols. When all blocks
// are known, SplitStreamWriter starts each part's models by the counts of the whole stream and codes the
// symbols.

void fail_split_source(const std::string& place, const std::string& expected, const std::string& found) {
  throw FormatError("split source", place, expected, found);
}

void check_split_source(const SplitSource& s) {
  const auto require = [](bool good, const std::string& what) {
    if (!good) fail_split_source(what, "in range", "another");
  };
  require(s.splits_per_block >= 1 && s.splits_per_block <= kMostSplits, "splits per block");
  require(!s.chapters.empty() && s.chapters.size() <= kMostScales && !s.chapters[0].patch.empty(),
          "chapters");
  require(s.position.bits >= 1 && s.position.bits <= 24, "position bits");
  require(s.values.size() == s.attributes.size() && !s.groups.empty() && s.groups.size() <= 65536,
          "attributes and groups");
  for (const SplitMesh::Point& p : s.points)
    for (std::int32_t x : p) require(x >= 0 && x < (1 << s.position.bits), "places");
  for (std::uint32_t p : s.wedge_point) require(p < s.points.size(), "points of wedges");
  for (std::size_t k = 0; k < s.values.size(); ++k) {
    const SplitAttribute& a = s.attributes[k];
    require(k == 0 || s.attributes[k - 1].kind < a.kind, "order of attribute kinds");
    require(a.grid.bits >= (a.kind == SplitKind::kNormal ? 2 : 1) && a.grid.bits <= 24, "attribute bits");
    require(s.values[k].size() == s.wedge_point.size() * static_cast<std::size_t>(split_components(a.kind)),
            "number of attributes");
    for (std::int32_t x : s.values[k]) require(x >= 0 && x < (1 << a.grid.bits), "attributes");
  }
  for (std::uint16_t g : s.face_group) require(g < s.groups.size(), "groups of faces");
  const auto check_face = [&](const SplitSource::Face& f) {
    require(f.face < s.face_group.size(), "faces");
    for (std::uint32_t w : f.wedges) require(w < s.wedge_point.size(), "wedges of faces");
  };
  for (const SplitSource::Chapter& c : s.chapters) {
    for (const SplitSource::Face& f : c.patch) {
      check_face(f);
      const std::uint32_t a = s.wedge_point[f.wedges[0]], b = s.wedge_point[f.wedges[1]],
                          d = s.wedge_point[f.wedges[2]];
      require(a != b && b != d && d != a, "corners of a face");
    }
    for (const SplitSource::Face& f : c.born) check_face(f);
    for (const SplitSource::Move& m : c.moves)
      require(m.face < s.face_group.size() && m.wedge < s.wedge_point.size(), "moves");
    for (const SplitSource::Split& x : c.splits)
      require(x.parent < s.points.size() && x.child < s.points.size() && x.move_begin <= x.move_end &&
                  x.move_end <= c.moves.size() && x.born_begin <= x.born_end && x.born_end <= c.born.size(),
              "splits");
  }
}

namespace {

/// What the writer knows and the reader must be told: the source, how its numbers stand to the stream's, and
/// the split or face under way.
class SplitTruth {
 public:
  SplitTruth(const SplitSource& source, const SplitMesh& mesh)
      : source_(source),
        mesh_(mesh),
        stream_point_(source.points.size(), kNoIndex),
        stream_face_(source.face_group.size(), kNoIndex),
        early_(source.points.size(), kNoIndex) {}

  // ---- chapters

  void begin_chapter(const SplitSource::Chapter& chapter);

  /// Asks memory for what a split of the point will read. `corner`: one at the point, which may be none.
  void look_ahead(std::uint32_t v, SplitStep step, std::uint32_t corner) const;
  bool is_ready(std::uint32_t v) const { return ready_[v] != kNoIndex; }
  void begin_split(std::uint32_t v, std::uint32_t u);
  void check_moves(std::size_t found) const;
  void end_split();

  // ---- corners that move

  bool moves(std::uint32_t face) const { return move_[face] != kNoIndex; }
  bool is_target(std::uint32_t face, std::uint32_t w) const { return source_wedge_[w] == move_[face]; }
  bool is_any_target(std::uint32_t face, const std::vector<std::uint32_t>& wedges) const;
  bool target_equals(std::uint32_t face, std::uint32_t w) const;
  void bind_target(std::uint32_t face, std::uint32_t w) { bind_wedge(w, move_[face]); }

  // ---- the face under way; roles are parent, child, third, or start, end, third of a patch's edge

  bool choose_born_face(std::uint32_t x);
  bool choose_any_born_face() { return !remaining_.empty() && set_born_face(0); }
  std::uint32_t third_point() const { return wanted_point(2); }
  bool is_forward(std::uint32_t) const { return forward_; }
  bool is_wanted(std::uint32_t role, std::uint32_t w) const { return source_wedge_[w] == wanted_[role]; }
  bool fits_better(std::uint32_t v, std::uint32_t x, std::uint32_t v2, std::uint32_t x2) const;
  std::uint32_t wanted_group() const { return source_.face_group[face_]; }
  std::uint32_t wanted_point(std::uint32_t role) const {
    return stream_point_[source_.wedge_point[wanted_[role]]];
  }
  void bind_wanted(std::uint32_t role, std::uint32_t w) { bind_wedge(w, wanted_[role]); }
  void bind_wanted_point(std::uint32_t role, std::uint32_t p) {
    bind_point(p, source_.wedge_point[wanted_[role]]);
  }
  void bind_face(std::uint32_t face);

  // ---- patches

  void choose_seed_face();
  bool choose_face_at_gate(std::uint32_t a, std::uint32_t b);

  // ---- values

  SplitMesh::Point place(std::uint32_t p) const { return source_.points[source_point_[p]]; }
  const std::int32_t* value(std::size_t k, std::uint32_t w) const {
    return source_value(k, source_wedge_[w]);
  }
  bool equal(std::size_t k, std::uint32_t a, std::uint32_t b) const {
    return equal_source(k, source_wedge_[a], source_wedge_[b]);
  }

 private:
  struct Edge {
    std::array<std::uint32_t, 2> points;
    std::uint32_t face, corner;
    friend auto operator<=>(const Edge&, const Edge&) = default;
  };
  void look_at_split(std::uint32_t number, SplitStep step) const;
  void make_ready(std::uint32_t split);
  void bind_point(std::uint32_t p, std::uint32_t source);
  void bind_wedge(std::uint32_t w, std::uint32_t source);
  std::uint32_t third_of(const SplitSource::Face& face) const;
  std::uint32_t moved_face(std::uint32_t move) const;
  bool set_born_face(std::size_t i);
  void sort_patch();
  void set_patch_face(std::uint32_t index, std::uint32_t corner);
  const std::int32_t* source_value(std::size_t k, std::uint32_t wedge) const {
    return source_.values[k].data() +
           wedge * static_cast<std::size_t>(split_components(source_.attributes[k].kind));
  }
  bool equal_source(std::size_t k, std::uint32_t a, std::uint32_t b) const;

  const SplitSource& source_;
  const SplitMesh& mesh_;
  std::vector<std::uint32_t> stream_point_, stream_face_;   // by source number
  std::vector<std::uint32_t> source_point_, source_wedge_;  // by stream number
  const SplitSource::Chapter* chapter_ = nullptr;
  /// Per point of the stream: the split it is parent of that may come now. `early_`: per source point that
  /// the stream does not have yet.
  std::vector<std::uint32_t> ready_, early_;
  std::vector<std::uint32_t> waiting_;
  Buckets<std::uint32_t> after_;
  std::vector<std::uint32_t> move_;  // per face of the stream: its wedge at the child of the split under way
  struct Born {
    std::uint32_t number, third;  // in Chapter::born; the source's point beside parent and child
  };
  std::vector<Born> remaining_;
  std::uint32_t number_ = 0, parent_ = kNoIndex, child_ = kNoIndex, face_ = 0;
  std::array<std::uint32_t, 3> wanted_{};
  bool forward_ = false;
  std::vector<Edge> edges_;
  std::vector<bool> patch_coded_;
  std::size_t next_seed_ = 0;
};

void SplitTruth::begin_chapter(const SplitSource::Chapter& chapter) {
  chapter_ = &chapter;
  waiting_.assign(chapter.splits.size(), 0);
  for (const auto& [a, b] : chapter.before) {
    if (a >= chapter.splits.size() || b >= chapter.splits.size())
      fail_split_source("order of splits", "splits of the chapter", std::to_string(std::max(a, b)));
    ++waiting_[b];
  }
  after_ = in_buckets(chapter.splits.size(), [&](auto&& put) {
    for (const auto& [a, b] : chapter.before) put(a, b);
  });
  for (std::uint32_t s = 0; s < chapter.splits.size(); ++s)
    if (waiting_[s] == 0) make_ready(s);
  sort_patch();
}

void SplitTruth::begin_split(std::uint32_t v, std::uint32_t u) {
  std::uint32_t& ready = ready_[v];
  number_ = ready;
  ready = kNoIndex;
  const SplitSource::Split& split = chapter_->splits[number_];
  parent_ = split.parent, child_ = split.child;
  bind_point(u, child_);
  for (std::uint32_t i = split.move_begin; i < split.move_end; ++i)
    move_[moved_face(i)] = chapter_->moves[i].wedge;
  remaining_.clear();
  for (std::uint32_t i = split.born_begin; i < split.born_end; ++i)
    remaining_.push_back({i, third_of(chapter_->born[i])});
}

void SplitTruth::look_ahead(std::uint32_t v, SplitStep step, std::uint32_t corner) const {
  if (step == SplitStep::kPoint) return ask_memory(&ready_[v]);
  if (corner != kNoIndex) ask_memory(&move_[corner / 3]);
  if (ready_[v] != kNoIndex) look_at_split(ready_[v], step);
}

void SplitTruth::look_at_split(std::uint32_t number, SplitStep step) const {
  const SplitSource::Split& split = chapter_->splits[number];
  if (step == SplitStep::kSplit) {
    ask_memory(&split);
    ask_memory(&after_.first[number]);
    return;
  }
  if (step > SplitStep::kFollowing) return;
  const std::span moves(chapter_->moves.data() + split.move_begin, split.move_end - split.move_begin);
  const std::span born(chapter_->born.data() + split.born_begin, split.born_end - split.born_begin);
  const std::span<const std::uint32_t> after = after_[number];
  if (step == SplitStep::kLists) {
    for (const std::uint32_t p : {split.child, split.parent}) {
      ask_memory(&source_.points[p]);
      ask_memory(&stream_point_[p]);
      ask_memory(&early_[p]);
    }
    ask_memory(moves.data());
    for (const SplitSource::Face& f : born) ask_memory(&f);
    ask_memory(after.data());
  } else if (step == SplitStep::kListed) {
    for (const SplitSource::Move& m : moves) ask_memory(&stream_face_[m.face]);
    for (const SplitSource::Face& f : born)
      for (const std::uint32_t w : f.wedges) ask_memory(&source_.wedge_point[w]);
    for (const std::uint32_t s : after) ask_memory(&waiting_[s]);
  } else {
    for (const SplitSource::Move& m : moves)
      if (stream_face_[m.face] != kNoIndex) ask_memory(&move_[stream_face_[m.face]]);
    for (const std::uint32_t s : after)
      if (waiting_[s] == 1) ask_memory(&chapter_->splits[s]);
  }
}

void SplitTruth::check_moves(std::size_t found) const {
  const SplitSource::Split& split = chapter_->splits[number_];
  if (found != split.move_end - split.move_begin)
    fail_split_source("split " + std::to_string(number_),
                      std::to_string(split.move_end - split.move_begin) + " faces at its parent",
                      std::to_string(found));
}

void SplitTruth::end_split() {
  const SplitSource::Split& split = chapter_->splits[number_];
  for (std::uint32_t i = split.move_begin; i < split.move_end; ++i) move_[moved_face(i)] = kNoIndex;
  for (const std::uint32_t s : after_[number_])
    if (--waiting_[s] == 0) make_ready(s);
}

bool SplitTruth::is_any_target(std::uint32_t face, const std::vector<std::uint32_t>& wedges) const {
  return std::ranges::any_of(wedges, [&](std::uint32_t w) { return is_target(face, w); });
}

bool SplitTruth::target_equals(std::uint32_t face, std::uint32_t w) const {
  for (std::size_t k = 0; k < source_.values.size(); ++k)
    if (!equal_source(k, move_[face], source_wedge_[w])) return false;
  return true;
}

bool SplitTruth::choose_born_face(std::uint32_t x) {
  for (std::size_t i = 0; i < remaining_.size(); ++i)
    if (remaining_[i].third == source_point_[x]) return set_born_face(i);
  return false;
}

bool SplitTruth::fits_better(std::uint32_t v, std::uint32_t x, std::uint32_t v2, std::uint32_t x2) const {
  return (is_wanted(0, v) ? 1 : 0) + (is_wanted(2, x) ? 1 : 0) >=
         (is_wanted(0, v2) ? 1 : 0) + (is_wanted(2, x2) ? 1 : 0);
}

void SplitTruth::bind_face(std::uint32_t face) {
  if (face != move_.size()) fail_split_source("faces", "in order", "another");
  move_.push_back(kNoIndex);
  stream_face_[face_] = face;
}

void SplitTruth::choose_seed_face() {
  while (patch_coded_[next_seed_]) ++next_seed_;
  set_patch_face(static_cast<std::uint32_t>(next_seed_), 0);
}

bool SplitTruth::choose_face_at_gate(std::uint32_t a, std::uint32_t b) {
  const std::array<std::uint32_t, 2> key{source_point_[b], source_point_[a]};
  auto at = std::lower_bound(edges_.begin(), edges_.end(), Edge{key, 0, 0});
  for (; at != edges_.end() && at->points == key; ++at) {
    if (patch_coded_[at->face]) continue;
    // The face is (b, a, third): its corner at `a` follows the one at b.
    set_patch_face(at->face, at->corner);
    std::swap(wanted_[0], wanted_[1]);
    return true;
  }
  return false;
}

void SplitTruth::make_ready(std::uint32_t split) {
  const std::uint32_t source = chapter_->splits[split].parent, p = stream_point_.at(source);
  std::uint32_t& ready = p == kNoIndex ? early_[source] : ready_[p];
  if (ready != kNoIndex) fail_split_source("splits of one point", "one after the other", "two at once");
  ready = split;
}

void SplitTruth::bind_point(std::uint32_t p, std::uint32_t source) {
  if (source >= stream_point_.size() || stream_point_[source] != kNoIndex)
    fail_split_source("point " + std::to_string(source), "a point that is made once", "another");
  stream_point_[source] = p;
  source_point_.push_back(source);
  ready_.push_back(early_[source]);
}

void SplitTruth::bind_wedge(std::uint32_t w, std::uint32_t source) {
  source_wedge_.resize(w + std::size_t{1}, kNoIndex);
  source_wedge_[w] = source;
}

std::uint32_t SplitTruth::third_of(const SplitSource::Face& face) const {
  for (std::uint32_t w : face.wedges)
    if (const std::uint32_t p = source_.wedge_point[w]; p != parent_ && p != child_) return p;
  return kNoIndex;
}

std::uint32_t SplitTruth::moved_face(std::uint32_t move) const {
  const std::uint32_t face = stream_face_[chapter_->moves[move].face];
  if (face == kNoIndex)
    fail_split_source("split " + std::to_string(number_), "faces at its parent", "one that is not there yet");
  return face;
}

bool SplitTruth::set_born_face(std::size_t i) {
  const SplitSource::Face& face = chapter_->born[remaining_[i].number];
  const std::uint32_t third = remaining_[i].third;
  remaining_.erase(remaining_.begin() + static_cast<std::ptrdiff_t>(i));
  face_ = face.face;
  std::size_t at = 3;
  for (std::size_t k = 0; k < 3; ++k)
    if (source_.wedge_point[face.wedges[k]] == parent_) at = k;
  if (at == 3 || third == kNoIndex)
    fail_split_source("face " + std::to_string(face_), "corners at its split", "others");
  const std::uint32_t next = face.wedges[(at + 1) % 3], last = face.wedges[(at + 2) % 3];
  forward_ = source_.wedge_point[last] == child_;
  if (!forward_ && source_.wedge_point[next] != child_)
    fail_split_source("face " + std::to_string(face_), "a corner at its split's child", "none");
  wanted_ = forward_ ? std::array{face.wedges[at], last, next} : std::array{face.wedges[at], next, last};
  return true;
}

void SplitTruth::sort_patch() {
  edges_.clear();
  next_seed_ = 0;
  patch_coded_.assign(chapter_->patch.size(), false);
  for (std::uint32_t f = 0; f < chapter_->patch.size(); ++f)
    for (std::uint32_t k = 0; k < 3; ++k) {
      const auto& w = chapter_->patch[f].wedges;
      edges_.push_back({{source_.wedge_point[w[k]], source_.wedge_point[w[(k + 1) % 3]]}, f, k});
    }
  std::sort(edges_.begin(), edges_.end());
}

void SplitTruth::set_patch_face(std::uint32_t index, std::uint32_t corner) {
  const SplitSource::Face& face = chapter_->patch[index];
  patch_coded_[index] = true;
  face_ = face.face;
  for (std::size_t k = 0; k < 3; ++k) wanted_[k] = face.wedges[(corner + k) % 3];
}

bool SplitTruth::equal_source(std::size_t k, std::uint32_t a, std::uint32_t b) const {
  return std::equal(source_value(k, a), source_value(k, a) + split_components(source_.attributes[k].kind),
                    source_value(k, b));
}

/// Symbols of one value part of one block: residuals, and kSame or kOther where the stream says whether a
/// value is that of another wedge.
inline constexpr std::int32_t kSame = std::numeric_limits<std::int32_t>::min(), kOther = kSame + 1;
using Symbols = std::vector<std::int32_t>;

/// Counts how often each model's bit is 1.
struct CountingBits {
  ResidualCodec& residuals;
  std::vector<std::array<std::uint32_t, 2>>& counts;
  bool bit(BitModel& model, bool value) {
    ++counts[static_cast<std::size_t>(&model - residuals.models.all.data())][value];
    return value;
  }
  std::uint32_t raw(std::uint32_t value, int) { return value; }
};

struct CodingBits {
  BitEncoder encoder;
  bool bit(BitModel& model, bool value) {
    encoder.encode(model, value, ValueModels::kValueLimit);
    return value;
  }
  std::uint32_t raw(std::uint32_t value, int count) {
    encoder.encode_raw(value, count);
    return value;
  }
};

/// Where the running mean of a block's residual lengths starts, in eighths of a bit.
std::uint8_t first_mean(const Symbols& symbols) {
  constexpr std::uint32_t kLooked = 30;
  std::uint32_t sum = 0, count = 0;
  for (std::int32_t s : symbols) {
    if (s == kSame || s == kOther) continue;
    sum += static_cast<std::uint32_t>(residual_length(s));
    if (++count == kLooked) break;
  }
  return static_cast<std::uint8_t>(count > 0 ? (8 * sum + count / 2) / count : 0);
}

void code_all(ResidualCodec& residuals, auto& bits, const Symbols& symbols, int components) {
  residuals.start(first_mean(symbols) * 2);
  int component = 0;
  for (std::int32_t s : symbols) {
    if (s == kSame || s == kOther) {
      residuals.same(bits, s == kSame);
    } else {
      residuals.residual(bits, component, s);
      component = component + 1 == components ? 0 : component + 1;
    }
  }
}

/// Where the probabilities of one value part start: in 256ths, by how often each was 1 in the whole stream.
/// `blocks`: per block the symbols of every part; `components`: numbers per value.
std::vector<std::uint8_t> start_models(const std::vector<std::vector<Symbols>>& blocks, std::size_t part,
                                       int components) {
  std::vector<std::array<std::uint32_t, 2>> counts(ValueModels::kCount);
  for (const auto& block : blocks) {
    ResidualCodec residuals;
    CountingBits bits{residuals, counts};
    code_all(residuals, bits, block[part], components);
  }
  std::vector<std::uint8_t> models;
  for (const auto& [zeros, ones] : counts) {
    const double share = (ones + 0.5) / (static_cast<double>(zeros) + ones + 1);
    models.push_back(static_cast<std::uint8_t>(std::clamp(static_cast<int>(share * 256 + 0.5), 1, 255)));
  }
  return models;
}

/// Bytes of one part of one block; none for no symbols.
std::vector<std::uint8_t> code_symbols(const Symbols& symbols, const std::vector<std::uint8_t>& models,
                                       int components) {
  if (symbols.empty()) return {};
  ResidualCodec residuals;
  for (std::size_t i = 0; i < models.size(); ++i)
    residuals.models.all[i] = {static_cast<std::uint16_t>(models[i] << 8), ValueModels::kPrior};
  CodingBits bits;
  code_all(residuals, bits, symbols, components);
  std::vector<std::uint8_t> out{first_mean(symbols)};
  const std::vector<std::uint8_t> coded = bits.encoder.finish();
  out.insert(out.end(), coded.begin(), coded.end());
  return out;
}

constexpr std::uint32_t kFacesPerBlock = 512;  // of patches but the first

/// The writer's side of SplitCodec: codes connectivity at once and keeps the values' residuals, which are
/// coded when the models of the whole stream are known.
class EncodingChannel {
 public:
  EncodingChannel(const SplitSource& source, const SplitMesh& mesh)
      : source_(source), truth_(source, mesh), symbols_(source.attributes.size() + 1) {}
  SplitTruth& truth() { return truth_; }
  std::vector<std::uint8_t> finish_connectivity() { return bits_.finish(); }
  std::vector<Symbols> finish_symbols() {
    std::vector<Symbols> out(symbols_.size());
    out.swap(symbols_);
    return out;
  }

  bool bit(BitModel& model, auto&& truth) {
    const bool value = truth(truth_);
    bits_.encode(model, value, SplitModels::kModelLimit);
    return value;
  }
  std::uint32_t raw(int count, auto&& truth) {
    const auto value = static_cast<std::uint32_t>(truth(truth_));
    bits_.encode_raw(value, count);
    return value;
  }
  void update_truth(auto&& note) { note(truth_); }
  void point(SplitMesh::Point& point, const SplitMesh::Point& guess, auto&& truth) {
    point = truth(truth_);
    put(0, point.data(), guess.data(), 3, source_.position.bits);
  }
  void finish_point(SplitMesh&, std::uint32_t) {}
  bool same(std::size_t k, auto&& truth) {
    const bool same = truth(truth_);
    symbols_[k + 1].push_back(same ? kSame : kOther);
    return same;
  }
  void value(std::size_t k, std::int32_t* value, const std::array<std::int32_t, 4>& guess, auto&& truth) {
    const SplitAttribute& a = source_.attributes[k];
    std::copy_n(truth(truth_), split_components(a.kind), value);
    put(k + 1, value, guess.data(), split_components(a.kind), a.grid.bits);
  }
  std::array<std::int32_t, 4> mean(std::size_t k, SplitMesh& mesh, const std::vector<std::uint32_t>& wedges) {
    return split_mean(source_.attributes[k], k, mesh, wedges);
  }

 private:
  void put(std::size_t part, const std::int32_t* value, const std::int32_t* guess, int components, int bits) {
    const std::int32_t largest = (1 << bits) - 1, half = 1 << (bits - 1);
    for (int i = 0; i < components; ++i) {
      const std::int32_t residual = value[i] - std::clamp(guess[i], 0, largest);
      symbols_[part].push_back(((residual + half) & largest) - half);
    }
  }
  const SplitSource& source_;
  SplitTruth truth_;
  BitEncoder bits_;
  std::vector<Symbols> symbols_;
};

/// Runs the codec over the source block by block.
class SplitStreamWriter {
 public:
  explicit SplitStreamWriter(const SplitSource& source)
      : source_(source),
        mesh_(components()),
        channel_(source, mesh_),
        codec_(mesh_, channel_, source.groups.size(), SplitLimits{}) {
    // Vectors that grow by doubling would take twice the memory for a while.
    mesh_.reserve(source.points.size(), source.wedge_point.size(), source.face_group.size());
  }

  std::vector<std::uint8_t> write() {
    head_.position = source_.position;
    head_.attributes = source_.attributes;
    head_.groups = source_.groups;
    for (const SplitSource::Chapter& chapter : source_.chapters) write_chapter(chapter);
    code_values();
    std::vector<std::uint8_t> stream = write_split_head(head_);
    for (const auto& block : bytes_) stream.insert(stream.end(), block.begin(), block.end());
    return stream;
  }

 private:
  std::vector<int> components() const {
    std::vector<int> n;
    for (const SplitAttribute& a : source_.attributes) n.push_back(split_components(a.kind));
    return n;
  }
  void write_chapter(const SplitSource::Chapter& chapter) {
    channel_.truth().begin_chapter(chapter);
    codec_.begin_chapter();
    const auto faces = static_cast<std::uint32_t>(chapter.patch.size());
    const std::uint32_t per_block = head_.scales.empty() ? faces : kFacesPerBlock;
    for (std::uint32_t at = 0; at < faces; at += per_block) {
      const std::uint32_t count = std::min(per_block, faces - at);
      codec_.code_patch(count);
      end_block(true, count);
    }
    const auto splits = static_cast<std::uint32_t>(chapter.splits.size());
    for (std::uint32_t at = 0; at < splits; at += source_.splits_per_block) {
      const std::uint32_t count = std::min(source_.splits_per_block, splits - at);
      codec_.code_splits(count);
      end_block(false, count);
    }
    head_.scales.push_back({chapter.scale, static_cast<std::uint32_t>(head_.blocks.size()),
                            static_cast<std::uint32_t>(mesh_.points().size()),
                            static_cast<std::uint32_t>(mesh_.wedge_point().size()),
                            static_cast<std::uint32_t>(mesh_.face_count()),
                            static_cast<std::uint32_t>(mesh_.visible_faces().size())});
  }
  void end_block(bool is_patch, std::uint32_t count) {
    SplitBlock block;
    block.is_patch = is_patch;
    block.count = count;
    head_.blocks.push_back(block);
    bytes_.push_back(channel_.finish_connectivity());
    symbols_.push_back(channel_.finish_symbols());
  }
  void code_values() {
    for (std::size_t part = 0; part <= source_.attributes.size(); ++part)
      head_.models.push_back(start_models(symbols_, part, part_components(part)));
    for (std::size_t i = 0; i < bytes_.size(); ++i) {
      std::vector<std::uint8_t>& bytes = bytes_[i];
      SplitBlock& block = head_.blocks[i];
      std::vector<std::vector<std::uint8_t>> parts;
      std::size_t size = bytes.size();
      for (std::size_t part = 0; part <= source_.attributes.size(); ++part) {
        parts.push_back(code_symbols(symbols_[i][part], head_.models[part], part_components(part)));
        size += parts.back().size();
      }
      // So few bytes only where a mesh repeats itself; the decoder reads zeros behind the end anyway.
      if (const std::size_t least = block.count / kMostPerByte; size < least)
        bytes.resize(bytes.size() + least - size, 0);
      block.parts.push_back(static_cast<std::uint32_t>(bytes.size()));
      for (const auto& part : parts) {
        block.parts.push_back(static_cast<std::uint32_t>(part.size()));
        bytes.insert(bytes.end(), part.begin(), part.end());
      }
      const Sha256 digest = sha256(bytes);
      std::copy_n(digest.begin(), block.digest.size(), block.digest.begin());
    }
  }
  int part_components(std::size_t part) const {
    return part == 0 ? 3 : split_components(source_.attributes[part - 1].kind);
  }

  const SplitSource& source_;
  SplitMesh mesh_;
  EncodingChannel channel_;
  SplitCodec<EncodingChannel> codec_;
  SplitStreamHead head_;
  std::vector<std::vector<std::uint8_t>> bytes_;
  std::vector<std::vector<Symbols>> symbols_;
};

}  // namespace

std::vector<std::uint8_t> write_split_stream(const SplitSource& source) {
  check_split_source(source);
  return SplitStreamWriter(source).write();
}

}  // namespace texmesh
