#pragma once
#include <functional>
#include <string>

namespace CLI {
class App;
}

namespace texmesh {

// Each adds one subcommand to `app`; when the user chose it, its callback runs and stores the exit code.
void add_compile_command(CLI::App& app, int& exit_code);
void add_cache_command(CLI::App& app, int& exit_code);     // command_cache.cpp
void add_dump_command(CLI::App& app, int& exit_code);      // command_dump.cpp
void add_diff_command(CLI::App& app, int& exit_code);      // command_diff.cpp
void add_verify_command(CLI::App& app, int& exit_code);    // command_verify.cpp
void add_unpack_command(CLI::App& app, int& exit_code);    // command_pack.cpp
void add_pack_command(CLI::App& app, int& exit_code);      // command_pack.cpp
void add_debug_command(CLI::App& app, int& exit_code);     // command_debug.cpp
void add_study_command(CLI::App& app, int& exit_code);     // command_study.cpp
void add_plan_command(CLI::App& app, int& exit_code);      // command_plan.cpp
void add_check_command(CLI::App& app, int& exit_code);     // command_plan.cpp
void add_simulate_command(CLI::App& app, int& exit_code);  // command_simulate.cpp
void add_fetch_command(CLI::App& app, int& exit_code);     // command_fetch.cpp
void add_view_command(CLI::App& app, int& exit_code);      // command_view.cpp
void add_extract_command(CLI::App& app, int& exit_code);   // command_extract.cpp
void add_stages_command(CLI::App& app, int& exit_code);

}  // namespace texmesh
