// For precompiled headers: the library of JSON but for the body of its literal `"{}"_json`, which nobody here
// writes. The literal is an inline function that parses, so every source that saw it compiled a parser: .4 s
// of each. The macro makes its body that of a template that nobody calls.
#pragma once
#define _json(text, size) \
  _json(text, size);      \
  template <class Nobody> \
  nlohmann::json literal_of(text, size)
#include <nlohmann/json.hpp>
#undef _json
