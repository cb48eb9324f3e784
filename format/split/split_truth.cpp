#include "format/split/split_truth.h"

#include <algorithm>
#include <span>

namespace texmesh {

void SplitTruth::begin_chapter(const SplitSource::Chapter& chapter) {
  chapter_ = &chapter;
  waiting_.assign(chapter.splits.size(), 0);
  first_.assign(chapter.splits.size() + 1, 0);
  for (const auto& [a, b] : chapter.before) {
    if (a >= chapter.splits.size() || b >= chapter.splits.size())
      fail_split_source("order of splits", "splits of the chapter", std::to_string(std::max(a, b)));
    ++first_[a + 1];
    ++waiting_[b];
  }
  for (std::size_t i = 1; i < first_.size(); ++i) first_[i] += first_[i - 1];
  after_.resize(chapter.before.size());
  std::vector<std::uint32_t> at(first_.begin(), first_.end() - 1);
  for (const auto& [a, b] : chapter.before) after_[at[a]++] = b;
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
    ask_memory(&first_[number]);
    return;
  }
  if (step > SplitStep::kFollowing) return;
  const std::span moves(chapter_->moves.data() + split.move_begin, split.move_end - split.move_begin);
  const std::span born(chapter_->born.data() + split.born_begin, split.born_end - split.born_begin);
  const std::span after(after_.data() + first_[number], first_[number + 1] - first_[number]);
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
  for (std::uint32_t i = first_[number_]; i < first_[number_ + 1]; ++i)
    if (--waiting_[after_[i]] == 0) make_ready(after_[i]);
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

}  // namespace texmesh
