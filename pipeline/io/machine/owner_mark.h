#pragma once
#include <cstdint>
#include <string>
#include <string_view>

namespace texmesh {

/// Who makes a file in a folder that several machines share: "HOST-MACHINE-PID". HOST is for readers. MACHINE
/// is a digest of the kernel's boot and of the namespace of process numbers, equal only where PID means the
/// same process; zeros where the system does not tell, and nobody can then say whether the process lives.
std::string owner_mark();

/// Whether the process that made a file may still be at work. Of this machine: while it lives. Of another
/// machine, or where `mark` is no owner_mark(): until the file has not been changed for a day, which no
/// writer takes. Locks are not asked: Lustre and NFS may grant them to everybody.
bool owner_may_live(std::string_view mark, std::int64_t modified_ns);

/// Whether a text has the form of an owner_mark().
bool is_owner_mark(std::string_view text);

}  // namespace texmesh
