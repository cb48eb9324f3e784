#pragma once
#include <tuple>
#include <type_traits>

#include "format/base/archive.h"
#include "pipeline/graph/stage.h"

namespace texmesh {

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
  double time_share = 0;
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
  stage.time_share = title.time_share;
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
