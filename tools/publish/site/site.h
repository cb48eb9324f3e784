#pragma once

#include "format/documents/annotations.h"
#include "pipeline/io/new_folder.h"
#include "pipeline/io/record.h"
#include "stages/base/run_context.h"

namespace texmesh {

struct SiteOptions {
  std::string title = "Scans";
  std::string packages_url;  // where the packages stand already, ends with a slash; "" = they are copied
  std::string viewer;        // folder with the built viewer
  std::string url;           // where the site will stand, ends with a slash; "" = not said
  std::string style;         // CSS of the publisher's own, behind the site's
  std::string words;         // JSON of words in another language (site_words.h); "" = English
  std::string words_file;    // what errors call it
  double downloads_px = 0;   // GLB and USDZ of each object for this displayed height; 0 = none
};

/// A file for other programs that a site has beside a package.
struct SiteDownload {
  const char* name;  // for people: "GLB"
  const char* media_type;
  std::string address;  // from a page in the site's folder
  std::uint64_t bytes = 0;
};

/// A package of a site.
struct SiteObject {
  std::string path;     // relative to the folder of packages; of an unpacked one with a slash behind
  std::string name;     // object_name()
  std::string digest;   // of what it holds: 16 digits of the package's id
  std::string address;  // of the package, from a page in the site's folder
  std::string source;   // file or folder on this machine
  std::string title;
  bool names_itself = false;  // the title is the package's, not its file's name
  std::string size;           // sides_in_words(); "" where the unit is not known
  About about;
  Annotations annotations;
  std::vector<std::uint8_t> poster;  // JPEG; empty = none
  std::string poster_address;        // from a page in the site's folder
  std::uint32_t poster_width_px = 0, poster_height_px = 0;
  std::vector<SiteDownload> downloads;  // write_site() makes them
  std::uint64_t bytes = 0;              // of the whole package
  std::uint64_t start_bytes = 0;        // until there is a picture
  std::uint64_t triangles = 0;
  std::uint32_t texture_px = 0;  // longest side of its textures; 0 = it has none
  static void fields(auto& s, auto&& v) {
    v("package", s.path, FieldRule{.pattern = "."},
      "Relative to the folder of packages; an unpacked one ends with a slash.");
    v("page", "objects/" + s.name + ".html", FieldRule{.pattern = "^objects(/[^/.][^/]*)+\\.html$"},
      "Relative to DIR; an address has it percent-encoded.");
    v("title", s.title, "");
    v("bytes", s.bytes, "Of the whole package.");
  }
};

/// A package that could not be read, and why.
struct SiteFault {
  std::string path, message;
  static void fields(auto& s, auto&& v) {
    v("package", s.path, "");
    v("error", s.message, FieldRule{.pattern = "."}, "");
  }
};

struct Site {
  SiteOptions options;
  std::vector<SiteObject> objects;  // by title
  std::vector<SiteFault> faults;
  std::vector<std::string> stale;  // paths of packages that no model makes any more
  std::string links;               // what is said of symbolic links, see links_left_out()
};

/// What a folder of packages (or one package) holds: every package beneath it, hidden ones and symbolic links
/// left out. A package that cannot be read is a fault, the others go on; one that no model makes any more is
/// left out. InputError when there is none at
/// all.
Site read_site(const std::string& packages, const SiteOptions& options);

/// What a publisher must know of the lengths in downloads: a sentence, "" where there are none or all
/// packages know their unit.
std::string unknown_units(const Site& site);

/// Writes a static site: index.html with posters and search, objects/NAME.html, viewer/, posters/ and, unless
/// they stand elsewhere, packages/; with an address sitemap.xml, and where asked for downloads/ with GLBs and
/// USDZs (an object that no USDZ can say has none). Texts of packages stand in it as text only. It asks
/// nothing of other servers but packages that stand there. Same packages, same bytes. The folder appears
/// whole or not at all; an earlier site is replaced. InputError when it holds anything else or cannot be
/// made.
void write_site(const Site& site, const std::string& folder, const RunContext& context = {});
/// The folder that this is: new, empty, or an earlier one.
FolderRule site_folder_rule();

/// What site --json prints.
struct SiteReport {
  std::string page;
  std::vector<SiteObject> objects;
  std::vector<SiteFault> faults;
  std::vector<std::string> stale;
  static void fields(auto& s, auto&& v) {
    v("version", Constant{1}, "");
    v("page", s.page, FieldRule{.pattern = "."}, "Path of index.html.");
    v("objects", s.objects, "In the order of the page.");
    v("faults", s.faults, "Packages that could not be read and are not in the site.");
    v("stale", s.stale, "Packages that no model makes any more and that are not in the site.");
  }
};

/// What the pages and files of the package at `path` are called in the site: its path without the ending, in
/// name_key()'s letters, part by part as a file name that every system takes. It depends on the path alone;
/// paths with different keys have different names. UTF-8; addresses have it percent-encoded.
std::string object_name(const std::string& path);

}  // namespace texmesh
