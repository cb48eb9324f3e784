#pragma once
#include <memory>
#include <tuple>
#include <typeindex>

#include "format/base/archive.h"
#include "pipeline/io/record.h"
#include "stages/base/run_context.h"

namespace texmesh {

/// The value of an option as JSON: what keys hold and --explain compares. Doubles have the fewest digits that
/// give the same double back.
template <class T>
requires(!std::is_class_v<T> || std::is_same_v<T, std::string> || IsList<T>::value) std::string
    option_text(const T& value) {
  return to_json_line(value);
}

/// Labels and texts, in order.
using OptionTexts = std::vector<std::pair<std::string, std::string>>;

/// Adds the texts of every field of an options struct, labelled "section.field".
template <class T>
void append_field_texts(const std::string& section, const T& value, OptionTexts& texts) {
  T::fields(value, [&](const char* field, const auto& v, auto...) {
    texts.emplace_back(section + "." + field, option_text(v));
  });
}

/// The value of an artefact whose type the graph does not know.
using Object = std::shared_ptr<const void>;

/// The handle of an artefact: its name, and its type for the compiler. Whoever makes or reads the artefact
/// goes by the one handle, so both mean the same type:
///   inline constexpr Artefact<ConditionedMesh> kConditioned{"condition"};
template <class T>
struct Artefact {
  const char* name;  // "condition", or "stage.part" where a stage has several results
};

/// The same for the graph, which compares types where stages are joined.
struct ArtefactName {
  template <class T>
  explicit ArtefactName(Artefact<T> artefact) : name(artefact.name), type(typeid(T)) {}
  std::string name;
  std::type_index type;
};

template <class T>
Object make_object(T value) {
  return std::make_shared<const T>(std::move(value));
}

/// One result of a stage, and how it gets into and out of the store; the functions are empty for derived
/// data.
struct StageOutput : ArtefactName {
  std::function<Bytes(const void*)> encode;
  std::function<ArtefactDigest(const void*)> digest;  // of these bytes, where nobody keeps them
  std::function<Object(ByteSpan)> decode;             // throws FormatError
};

/// Options that a stage reads: a whole section ("ssf") or a single field ("ladder.mode").
struct StageOption {
  std::string name;
  OptionTexts fields;  // "ssf.scales": "20", for the key
};

/// A library whose version changes the stage's bytes.
struct StageLibrary {
  std::string name, version;
};

/// What a stage's function gives.
struct StageResult {
  std::vector<Object> objects;  // in the order of Stage::outputs
  Notes notes;
};

/// One node of the graph, as make_stage() makes it. Its key consists of name, version, options, libraries and
/// the digests of its inputs; `run` has the options inside and gets nothing but its inputs.
struct Stage {
  std::string name;
  int version = 1;
  std::string summary;  // one line for `texmesh compile --stages`
  std::vector<ArtefactName> inputs;
  std::vector<StageOutput> outputs;
  std::vector<StageOption> options;
  std::vector<StageLibrary> libraries;
  bool stored = true;  // false: derived data, computed when somebody needs it, never kept
  std::function<StageResult(std::span<const Object> inputs, const RunContext& context)> run;
};

enum class StageEvent : std::uint8_t { kStarted, kProgress, kHit, kRan };

/// Told from any thread, one call at a time. `fraction` is 0..1 for kProgress; `seconds` is wall time of
/// kRan.
using StageObserver =
    std::function<void(const Stage& stage, StageEvent event, double fraction, double seconds)>;

// How a stage is declared. One declaration names the inputs and options of the stage's function, the parts of
// the stage's key, and the results. The compiler refuses a function whose parameters are not the declared
// inputs, then the declared options, then the context, each of exactly its type: a conversion would hand the
// function another value than the key holds.
//
//   make_stage({"ssf", kSsfVersion, "mesh -> scale map"}, inputs(kConditioned), outputs(kScaleMap),
//              options(OptionValue("ssf", ssf_options)), {}, filter_scale_space);

/// Options with the name they have in profiles: a struct that has `fields` (format/base/fields.h), or one
/// field's value. The key's texts come from the value that the stage's function gets.
template <class T>
class OptionValue {
 public:
  OptionValue(std::string name, T value) : name_(std::move(name)), value_(std::move(value)) {}
  const T& value() const { return value_; }
  StageOption for_key() const {
    StageOption option{name_, {}};
    if constexpr (requires { option_text(value_); })
      option.fields.emplace_back(name_, option_text(value_));
    else
      append_field_texts(name_, value_, option.fields);
    return option;
  }

 private:
  std::string name_;
  T value_;
};

template <class... T>
struct Inputs {
  std::tuple<Artefact<T>...> artefacts;
};
template <class... T>
Inputs<T...> inputs(Artefact<T>... artefacts) {
  return {{artefacts...}};
}

template <class... T>
struct Outputs {
  std::tuple<Artefact<T>...> artefacts;
};
/// Results that the store keeps.
template <class... T>
Outputs<T...> outputs(Artefact<T>... artefacts) {
  return {{artefacts...}};
}
/// Results that are computed when somebody needs them and never kept. Their types need no archive.
template <class T>
struct DerivedOutput {
  Artefact<T> artefact;
};
template <class T>
DerivedOutput<T> derived(Artefact<T> artefact) {
  return {artefact};
}

template <class... T>
struct Options {
  std::tuple<OptionValue<T>...> values;
};
template <class... T>
Options<T...> options(OptionValue<T>... values) {
  return {{std::move(values)...}};
}

/// What a stage's function returns: the results in the order of the outputs, and notes. A function with one
/// result may return the result alone; the notes are then the result's own, where it has a member `notes`.
template <class... T>
struct Results {
  Results(std::tuple<T...> all, Notes more) : values(std::move(all)), notes(std::move(more)) {}
  std::tuple<T...> values;
  Notes notes;
};
template <class T>
struct Results<T> {
  Results(T value) {
    if constexpr (requires { Notes(value.notes); }) notes = value.notes;
    values = std::tuple<T>(std::move(value));
  }
  Results(T value, Notes more) : values(std::move(value)), notes(std::move(more)) {}
  std::tuple<T> values;
  Notes notes;
};

struct StageTitle {
  std::string name;
  int version = 1;
  std::string summary;
};

template <class T>
StageOutput stored_output(Artefact<T> artefact) {
  StageOutput output{ArtefactName(artefact), {}, {}, {}};
  output.encode = [](const void* object) { return encode_artefact(*static_cast<const T*>(object)); };
  output.digest = [](const void* object) { return digest_artefact(*static_cast<const T*>(object)); };
  output.decode = [name = output.name](ByteSpan bytes) {
    return make_object(decode_artefact<T>(bytes, name));
  };
  return output;
}

/// Whether a plain function has exactly these parameters, references and const apart. Others (lambdas of
/// tests) are held by is_invocable_r alone.
template <class F, class... Expected>
struct TakesExactly : std::true_type {};
template <class R, class... A, class... Expected>
struct TakesExactly<R (*)(A...), Expected...>
    : std::is_same<std::tuple<std::remove_cvref_t<A>...>, std::tuple<Expected...>> {};

/// The function that the graph calls: inputs get their types back, options stand behind them.
template <class... I, class... O, class... P, class F>
auto bind_function(Inputs<I...>, const std::tuple<O...>*, Options<P...> options, F function) {
  static_assert(std::is_invocable_r_v<Results<O...>, F, const I&..., const P&..., const RunContext&>,
                "a stage's function takes its inputs, its options and the context, and gives its outputs");
  static_assert(TakesExactly<F, I..., P..., RunContext>::value,
                "a stage's function has parameters of exactly the types of its inputs and options");
  return [options = std::move(options), function = std::move(function)](std::span<const Object> objects,
                                                                        const RunContext& context) {
    const auto call = [&]<std::size_t... K>(std::index_sequence<K...>)->Results<O...> {
      return std::apply(
          [&](const OptionValue<P>&... option) -> Results<O...> {
            return function(*static_cast<const I*>(objects[K].get())..., option.value()..., context);
          },
          options.values);
    };
    Results<O...> results = call(std::index_sequence_for<I...>{});
    StageResult made;
    std::apply([&](O&... value) { (made.objects.push_back(make_object(std::move(value))), ...); },
               results.values);
    made.notes = std::move(results.notes);
    return made;
  };
}

template <class... I, class... P>
Stage describe_stage(StageTitle title, const Inputs<I...>& read, const Options<P...>& options,
                     std::vector<StageLibrary> libraries) {
  Stage stage;
  stage.name = std::move(title.name);
  stage.version = title.version;
  stage.summary = std::move(title.summary);
  stage.libraries = std::move(libraries);
  std::apply([&](auto... artefact) { (stage.inputs.emplace_back(artefact), ...); }, read.artefacts);
  std::apply([&](const auto&... option) { (stage.options.push_back(option.for_key()), ...); },
             options.values);
  return stage;
}

template <class... I, class... O, class... P, class F>
Stage make_stage(StageTitle title, Inputs<I...> read, Outputs<O...> made, Options<P...> options,
                 std::vector<StageLibrary> libraries, F function) {
  Stage stage = describe_stage(std::move(title), read, options, std::move(libraries));
  std::apply([&](auto... artefact) { (stage.outputs.push_back(stored_output(artefact)), ...); },
             made.artefacts);
  stage.run = bind_function(read, static_cast<const std::tuple<O...>*>(nullptr), std::move(options),
                            std::move(function));
  return stage;
}

template <class... I, class O, class... P, class F>
Stage make_stage(StageTitle title, Inputs<I...> read, DerivedOutput<O> made, Options<P...> options,
                 std::vector<StageLibrary> libraries, F function) {
  Stage stage = describe_stage(std::move(title), read, options, std::move(libraries));
  stage.outputs.push_back({ArtefactName(made.artefact), {}, {}, {}});
  stage.stored = false;
  stage.run = bind_function(read, static_cast<const std::tuple<O>*>(nullptr), std::move(options),
                            std::move(function));
  return stage;
}

}  // namespace texmesh
