#pragma once

#include <memory>

#include "format/base/descriptor.h"
#include "pipeline/io/record.h"

namespace texmesh {

/// A part of a file: `bytes` from `first`.
struct RequestedRange {
  enum Kind { kNone, kPart, kUnsatisfiable } kind = kNone;
  std::uint64_t first = 0, bytes = 0;
};

/// The one range of a Range header (RFC 9110, section 14) over a file of `size` bytes: a-b, a-, -n. kNone
/// for what a server may answer with the whole file: no header, other units, several ranges, nonsense.
/// What httplib's own parser does not take (5-2, numbers beyond 64 bits) it answers with 416 before a
/// handler is asked.
RequestedRange requested_range(const std::string& header, std::uint64_t size);

class ServedFiles;

/// Serves a ServedFiles over HTTP: GET and HEAD (OPTIONS for browsers that ask before a request from
/// elsewhere), one range, ETag with If-None-Match and If-Range, CORS. Everything else is 404 or 405.
class ViewServer {
 public:
  explicit ViewServer(const ServedFiles& files);
  ~ViewServer();
  /// Port 0 = any free one; returns the port. InputError where it cannot be had.
  int bind(const std::string& host, int port);
  void serve();  // until the process ends

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// An open regular file.
struct ServedFile {
  Descriptor fd;
  std::uint64_t bytes = 0;
  std::string type;  // media type by the path's ending (SPEC.md, section 3)
  std::string etag;  // strong: another file or another time is another tag
};

/// Packages on this machine.
struct PackageFolder {
  std::string path;  // absolute
  std::vector<std::string>
      packages;                    // relative to it, sorted, at most 10,000; unpacked ones end with a slash
  bool alone = false;              // one package was named, not a folder of them
  std::vector<std::string> links;  // symbolic links to packages or folders, which are left out
};
/// "3 symbolic links are left out, such as a.texmesh: ..."; "" without any.
std::string links_left_out(const PackageFolder& folder);
/// `package` is a .texmesh file, an unpacked package, or a folder of such. Hidden names and symbolic links
/// beneath it are left out. InputError when it is not there or holds no package.
PackageFolder find_packages(const std::string& package);

/// The files that `texmesh view` serves: the viewer's beneath `/`, packages beneath `/packages/`. Nothing
/// else can be reached: paths go down part by part, follow no symbolic link, and in a folder of packages lead
/// to `.texmesh` files and into unpacked packages only, whatever stands beside them.
class ServedFiles {
 public:
  /// `package` as of find_packages(); `viewer` a folder with index.html. InputError when one of them is not
  /// there or the folder holds no package.
  ServedFiles(const std::string& package, const std::string& viewer);

  /// The file of a decoded URL path ("/", "/assets/x.js", "/packages/bust.texmesh"); nothing where there
  /// is none. Thread-safe.
  std::optional<ServedFile> open(const std::string& path) const;
  /// Paths of the packages relative to `/`, percent-encoded, sorted, at most 10,000; trees end with a slash.
  std::vector<std::string> packages() const;

 private:
  Descriptor viewer_, root_;  // folders
  std::string only_;          // the one entry of root_ that is served, "" = every package beneath
};

/// What the viewer offers to choose from, packages.json: texts are left out where there are none.
struct PackageList {
  struct Package {
    std::string url, title, poster;
    static void fields(auto& s, auto&& v) {
      v("url", s.url, "");
      v("title", s.title, kMayMiss, "");
      v("poster", s.poster, kMayMiss, "");
    }
  };
  std::vector<Package> packages;
  static void fields(auto& s, auto&& v) { v("packages", s.packages, ""); }
};

/// The folder with the built viewer: `wanted` where it is not empty, otherwise viewer/ beside the
/// executable's folder (a build tree) or share/texmesh/viewer of an installation. InputError, which says how
/// to build it, where there is none.
std::string viewer_folder(const std::string& wanted);
/// The same for the folder with the script of <model-viewer> and its licence, model-viewer/.
inline constexpr const char* kModelViewerScript = "model-viewer.min.js";
std::string model_viewer_folder(const std::string& wanted);

}  // namespace texmesh
