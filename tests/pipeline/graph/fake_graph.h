#pragma once
// A graph of four stages that put texts together.
#include <mutex>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "pipeline/graph/graph_run.h"
#include "pipeline/graph/stage.h"

namespace texmesh::testing {

using Text = std::string;

inline constexpr Artefact<Text> kSource{"source"}, kLeft{"left"}, kRight{"right"}, kMiddle{"middle"},
    kJoin{"join"};

/// Options as a stage declares them; the graph knows their texts alone.
struct ZimFake {
  int difference = 20;
  double share = 0.5;
  template <class S, class V>
  static void fields(S& s, V&& v) {
    v("difference", s.difference, Range{0, 100}, "");
    v("share", s.share, Range{0, 1}, "");
  }
};
struct FakeOptions {
  int scales = 20;
  int unread = 0;
  ZimFake zim;
};

inline std::vector<StageLibrary> fake_libraries() { return {{"draco", "1"}}; }

/// A graph of text stages: left and right read the source, middle is derived, join reads all.
struct Fake {
  std::mutex mutex;
  std::multiset<std::string> ran;
  std::string left_suffix;  // changes what "left" computes without changing its key: a silent change of code
  std::string fail;

  Results<Text> text(const std::string& name, Text value) {
    {
      const std::lock_guard lock(mutex);
      ran.insert(name);
    }
    if (fail == name) throw StageError(name, "", "success", "failure");
    Notes notes;
    if (name == "left") add_warning(notes, "left-note", "", value);
    return {std::move(value), notes};
  }

  std::vector<Stage> table(const FakeOptions& o = {}) {
    const auto left = [this](const Text& source, int, const RunContext&) {
      return text("left", source.substr(0, 1) + left_suffix);
    };
    const auto right = [this](const Text& source, const ZimFake&, const RunContext&) {
      return text("right", source + "R");
    };
    const auto middle = [this](const Text& a, const Text& b, const RunContext&) {
      return text("middle", a + b);
    };
    const auto join = [this](const Text& a, const Text& b, const RunContext&) {
      return text("join", a + "+" + b);
    };
    return {
        make_stage({"left", 1, ""}, inputs(kSource), outputs(kLeft),
                   options(OptionValue("ssf.scales", o.scales)), {}, left),
        make_stage({"right", 1, ""}, inputs(kSource), outputs(kRight), options(OptionValue("zim", o.zim)),
                   fake_libraries(), right),
        make_stage({"middle", 1, ""}, inputs(kLeft, kRight), derived(kMiddle), options(), {}, middle),
        make_stage({"join", 1, ""}, inputs(kMiddle, kLeft), outputs(kJoin), options(), {}, join),
    };
  }

  Text run(Store& store, const Text& source, const FakeOptions& o = {}, int threads = 2,
           Notes* notes = nullptr) {
    ran.clear();
    RunContext context;
    context.threads = threads;
    const std::vector<Stage> stages = table(o);
    GraphRun graph(stages, store, context);
    const Bytes bytes(source.begin(), source.end());
    graph.give(kSource, source, sha256(bytes), bytes.size());
    const auto result = graph.run(kJoin);
    if (notes) *notes = graph.notes();
    return *result;
  }
};

using Ran = std::multiset<std::string>;

}  // namespace texmesh::testing
