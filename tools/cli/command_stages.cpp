#include <fmt/format.h>

#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>

#include "pipeline/compile/profile.h"
#include "pipeline/compile/stage_table.h"
#include "pipeline/io/exit_codes.h"
#include "tools/cli/commands.h"
#include "tools/cli/options/command_line.h"

namespace texmesh {
namespace {

using Json = nlohmann::ordered_json;

std::string joined(const std::vector<std::string>& names) {
  std::string s;
  for (const std::string& n : names) s += (s.empty() ? "" : ", ") + n;
  return s;
}

template <class T>
std::vector<std::string> names_of(const std::vector<T>& named) {
  std::vector<std::string> names;
  for (const T& n : named) names.push_back(n.name);
  return names;
}

void print_table() {
  for (const Stage& s : default_stage_table())
    std::cout << fmt::format("{:<18} v{:<4} {}\n{:<25}from {}\n", s.name, s.version, s.summary, "",
                             joined(names_of(s.inputs)));
}

void print_stages_json() {
  Json list = Json::array();
  for (const Stage& s : default_stage_table())
    list.push_back({{"stage", s.name},
                    {"version", s.version},
                    {"summary", s.summary},
                    {"inputs", names_of(s.inputs)},
                    {"outputs", names_of(s.outputs)},
                    {"options", names_of(s.options)},
                    {"libraries", names_of(s.libraries)},
                    {"stored", s.stored}});
  std::cout << Json{{"stages", list}}.dump(2) << '\n';
}

void print_dot() {
  std::cout << "digraph texmesh {\n  rankdir=LR;\n";
  for (const Stage& s : default_stage_table())
    for (const std::string& input : names_of(s.inputs))
      std::cout << fmt::format("  \"{}\" -> \"{}\";\n", input.substr(0, input.find('.')), s.name);
  std::cout << "}\n";
}

}  // namespace

void add_stages_command(Command& app) {
  struct Arguments {
    bool json = false, dot = false, schema = false;
  };
  auto args = std::make_shared<Arguments>();
  Command c = app.add("stages");
  c.flag("--json", args->json, "Print JSON");
  c.flag("--dot", args->dot, "Print a Graphviz graph");
  c.flag("--profile-schema", args->schema, "Print the JSON schema of profiles, which are files of options");
  c.examples("  texmesh stages\n  texmesh stages --dot | dot -Tsvg > stages.svg");
  c.on_run([args] {
    if (args->schema)
      std::cout << profile_schema().text;
    else if (args->json)
      print_stages_json();
    else if (args->dot)
      print_dot();
    else
      print_table();
    return kExitOk;
  });
}

}  // namespace texmesh
