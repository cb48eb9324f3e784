#pragma once
#include <cstdint>
#include <span>
#include <string>

#include "format/base/note.h"
#include "pipeline/io/resolver.h"

namespace texmesh {

/// The name of a file as it stands in a model or in a file that the model names.
struct NameInModel {
  std::string text;     // as written: quotes, blanks, backslashes
  std::string said_in;  // the file that says it, relative to the model's folder; "" = the model itself
  bool is_uri = false;  // glTF: percent-encoded
};

struct NamedFile {
  std::optional<Bytes> bytes;
  std::string name;        // relative to the model's folder
  std::string looked_for;  // without bytes: the names that were tried, and why some were refused
};

/// Finds the file that a name means. The same rules hold for every format and every kind of name:
/// - Blanks around the name and one pair of quotes are no part of it. Backslashes are slashes. In a URI %41
///   is A; a URI is also tried as it is written and without a query, another name also as if it were one.
///   What follows a blank and # is a comment where the whole is no file.
/// - The name counts from the folder of the file that says it, then from the model's.
/// - An absolute name, a drive, a scheme, a server, and what leaves the model's folder once ".." is resolved
///   are never followed. A file of the name's last part, in the same two folders, is taken with the warning
///   "outside-name".
/// - Where all of this finds nothing, the only file whose name differs in case or composition alone is taken
///   with the warning "similar-name"; where there is none, the only picture whose ending differs, too, with
///   "other-ending".
/// - Last, the file of the name's last part in the same two folders, or in their folder textures, is taken
///   with the warning "moved-file". Each further folder would cost a hostile model with many names a look for
///   each. Of a model in a folder source, the folder textures beside that is such a folder, too, where the
///   resolver may read it.
/// What must not be read counts as missing. InputError when the file is longer than max_bytes.
NamedFile find_file(const NameInModel& name, Resolver& resolver, std::uint64_t max_bytes, Notes& notes,
                    const std::string& place);

/// How the file of a finer scale names a picture of its package: "../preview/PPP.jpg". The one name that
/// leaves the model's folder: resolvers of packages know it, FileResolver refuses it as any other.
bool is_preview_uri(const std::string& uri);

/// What a file is by its first bytes, where it is neither a model nor a picture that texmesh reads, and what
/// to do about it: "a Git LFS pointer (git lfs pull fetches the file)". "" for anything else.
std::string foreign_file(std::span<const std::uint8_t> bytes);

}  // namespace texmesh
