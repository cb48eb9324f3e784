#include "pipeline/io/core_path.h"

#include <elf.h>
#include <fcntl.h>
#include <link.h>
#include <unistd.h>

#include <cstring>
#include <filesystem>
#include <string_view>
#include <vector>

#include "format/base/errors.h"
#include "pipeline/io/descriptor.h"
#include "pipeline/io/file_stamp.h"

namespace texmesh {
namespace {

bool read_exactly(int fd, std::uint64_t at, void* to, std::size_t bytes) {
  return ::pread(fd, to, bytes, static_cast<off_t>(at)) == static_cast<ssize_t>(bytes);
}

/// The build id among notes: (size of name, size of text, type, name, text), each padded to 4 bytes.
std::string build_id_of_notes(const std::vector<char>& notes) {
  for (std::size_t at = 0; at + sizeof(ElfW(Nhdr)) <= notes.size();) {
    ElfW(Nhdr) head;
    std::memcpy(&head, notes.data() + at, sizeof head);
    const std::size_t name = at + sizeof head, text = name + (std::size_t{head.n_namesz} + 3) / 4 * 4;
    const std::size_t end = text + (std::size_t{head.n_descsz} + 3) / 4 * 4;
    if (end > notes.size()) return "";
    if (head.n_type == NT_GNU_BUILD_ID &&
        std::string_view(notes.data() + name, head.n_namesz) == std::string_view("GNU", 4)) {
      std::string hex;
      for (std::size_t i = 0; i < head.n_descsz; ++i) {
        const auto byte = static_cast<unsigned char>(notes[text + i]);
        hex += "0123456789abcdef"[byte >> 4];
        hex += "0123456789abcdef"[byte & 15];
      }
      return hex;
    }
    at = end;
  }
  return "";
}

std::string build_id_of(const std::string& path) {
  const Descriptor file{::open(path.c_str(), O_RDONLY | O_CLOEXEC)};
  ElfW(Ehdr) head;
  if (file.get() < 0 || !read_exactly(file.get(), 0, &head, sizeof head) ||
      std::memcmp(head.e_ident, ELFMAG, SELFMAG) != 0)
    return "";
  constexpr std::size_t kMostNotes = 1 << 16;
  for (std::size_t i = 0; i < head.e_phnum; ++i) {
    ElfW(Phdr) part;
    if (!read_exactly(file.get(), head.e_phoff + i * head.e_phentsize, &part, sizeof part)) return "";
    if (part.p_type != PT_NOTE || part.p_filesz > kMostNotes) continue;
    std::vector<char> notes(part.p_filesz);
    if (!read_exactly(file.get(), part.p_offset, notes.data(), notes.size())) return "";
    if (std::string id = build_id_of_notes(notes); !id.empty()) return id;
  }
  return "";
}

}  // namespace

std::string core_executable() {
  namespace fs = std::filesystem;
  std::error_code ec;
  const fs::path self = fs::read_symlink("/proc/self/exe", ec);
  if (ec) throw InputError("/proc/self/exe", "", "a link to this program (is /proc mounted?)", ec.message());
  const fs::path folder = self.parent_path();
  for (const fs::path& candidate : {folder / "texmesh-core", folder / "../libexec/texmesh/texmesh-core"})
    if (::access(candidate.c_str(), X_OK) == 0) return candidate.lexically_normal().string();
  throw InputError("texmesh-core", "", "an executable beside " + self.string() + " or in ../libexec/texmesh",
                   "nothing there");
}

std::string core_build() {
  const std::string core = core_executable();
  if (std::string id = build_id_of(core); !id.empty()) return id;
  const auto stamp = stamp_of(core);
  return stamp ? std::to_string(stamp->bytes) + " " + std::to_string(stamp->modified_ns) : "";
}

}  // namespace texmesh
