#include "pipeline/io/program.h"

#include <CGAL/version.h>
#include <OpenImageIO/oiioversion.h>
#include <draco/core/draco_version.h>
#include <elf.h>
#include <fmt/format.h>
#include <jconfig.h>
#include <link.h>
#include <meshoptimizer.h>
#include <png.h>
#include <webp/encode.h>
#include <zlib.h>
#include <zstd.h>

#include <filesystem>

#include "pipeline/io/file_stamp.h"
#include "stages/image/avif.h"

namespace texmesh {
namespace {

bool serves_workers = false;

std::filesystem::path this_program() {
  std::error_code ec;
  const std::filesystem::path self = std::filesystem::read_symlink("/proc/self/exe", ec);
  if (ec) throw InputError("/proc/self/exe", "", "a link to this program (is /proc mounted?)", ec.message());
  return self;
}

std::size_t padded(std::size_t bytes) { return (bytes + 3) / 4 * 4; }

/// The build id among the notes of a program that is loaded.
int find_build_id(dl_phdr_info* program, std::size_t, void* out) {
  for (std::size_t i = 0; i < program->dlpi_phnum; ++i) {
    const ElfW(Phdr)& part = program->dlpi_phdr[i];
    if (part.p_type != PT_NOTE) continue;
    const auto* notes = reinterpret_cast<const std::uint8_t*>(program->dlpi_addr + part.p_vaddr);
    ElfW(Nhdr) head;
    for (std::size_t at = 0; at + sizeof head <= part.p_memsz;
         at += sizeof head + padded(head.n_namesz) + padded(head.n_descsz)) {
      std::memcpy(&head, notes + at, sizeof head);
      const std::uint8_t* name = notes + at + sizeof head;
      if (head.n_type == NT_GNU_BUILD_ID && head.n_namesz == 4 && std::memcmp(name, "GNU", 4) == 0)
        *static_cast<std::string*>(out) =
            fmt::format("{:02x}", fmt::join(name + 4, name + 4 + head.n_descsz, ""));
    }
  }
  return 1;  // the first is the program; the others are its libraries
}

std::string webp_version() {  // its headers carry the version of the interface only
  const int v = WebPGetEncoderVersion();
  return std::to_string(v >> 16) + "." + std::to_string(v >> 8 & 255) + "." + std::to_string(v & 255);
}

}  // namespace

void serve_workers() { serves_workers = true; }

std::string worker_executable() {
  const std::filesystem::path self = this_program(), beside = self.parent_path() / "texmesh";
  if (serves_workers) return self.string();
  if (::access(beside.c_str(), X_OK) == 0) return beside.string();
  throw InputError("texmesh", "", "an executable beside " + self.string(), "nothing there");
}

std::string program_build() {
  std::string id;
  ::dl_iterate_phdr(find_build_id, &id);
  if (!id.empty()) return id;
  const auto stamp = stamp_of(this_program().string());
  return stamp ? std::to_string(stamp->bytes) + " " + std::to_string(stamp->modified_ns) : "";
}

#define TEXMESH_TEXT_(x) #x
#define TEXMESH_TEXT(x) TEXMESH_TEXT_(x)

const std::map<std::string, std::string>& library_versions() {
  static const std::map<std::string, std::string> versions{
      {"cgal", CGAL_VERSION_STR},
      {"draco", draco::kDracoVersion},
      {"libavif", avif_version()},
      {"libjpeg-turbo", TEXMESH_TEXT(LIBJPEG_TURBO_VERSION)},
      {"libpng", PNG_LIBPNG_VER_STRING},
      {"libwebp", webp_version()},
      {"libzstd", ZSTD_VERSION_STRING},
      {"meshoptimizer", std::to_string(MESHOPTIMIZER_VERSION)},
      {"openimageio", OIIO_VERSION_STRING},
      {"tinygltf", "2.7"},  // its headers carry no version
      {"zlib", ZLIB_VERSION},
  };
  return versions;
}

std::string compiler_version() {
#ifdef __clang__
  return "clang " __clang_version__;
#else
  return "g++ " __VERSION__;
#endif
}

std::string tool_version() { return TEXMESH_VERSION; }

}  // namespace texmesh
