#pragma once

namespace texmesh {

class Command;

// Each adds one command to the program, in command_NAME.cpp.
void add_compile_command(Command& app);
void add_cache_command(Command& app);
void add_list_command(Command& app);
void add_summary_command(Command& app);
void add_dump_command(Command& app);
void add_diff_command(Command& app);
void add_verify_command(Command& app);
void add_unpack_command(Command& app);  // command_pack.cpp
void add_pack_command(Command& app);
void add_debug_command(Command& app);
void add_doctor_command(Command& app);
void add_render_command(Command& app);
void add_report_command(Command& app);
void add_plan_command(Command& app);
void add_check_command(Command& app);  // command_plan.cpp
void add_simulate_command(Command& app);
void add_fetch_command(Command& app);
void add_view_command(Command& app);
void add_extract_command(Command& app);
void add_export_command(Command& app);
void add_site_command(Command& app);
void add_stages_command(Command& app);
void add_completion_command(Command& app);

}  // namespace texmesh
