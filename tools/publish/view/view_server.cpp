#include "tools/publish/view/view_server.h"

#include <httplib.h>

#include <fcntl.h>
#include <sys/stat.h>
#include <algorithm>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "delivery/cpp/package/package_reader.h"
#include "format/base/text_bytes.h"
#include "format/container/layout.h"
#include "pipeline/io/new_folder.h"
#include "pipeline/io/uri.h"

namespace texmesh {

namespace {

constexpr std::size_t kThreads = 64;  // each open connection holds one, and browsers keep six per page
constexpr std::size_t kChunkBytes = 64 << 10;
constexpr std::string_view kPosters = "/posters/";

namespace fs = std::filesystem;

/// A package of `files`; nothing where none can be read.
std::unique_ptr<PackageReader> package_at(const ServedFiles& files, const std::string& path) try {
  const bool tree = path.ends_with("/");
  const auto file = files.open(tree ? path + kManifestPath : path);
  if (!file) return nullptr;
  const std::string opened = "/proc/self/fd/" + std::to_string(file->fd.get());
  std::error_code error;
  return std::make_unique<PackageReader>(
      tree ? open_folder(fs::read_symlink(opened, error).parent_path().string())
           : open_container(open_file_source(opened)));
} catch (const Error&) {
  return nullptr;
}

/// The package's poster, a JPEG, its digest checked; nothing where there is none.
std::optional<Bytes> package_poster(const ServedFiles& files, const std::string& path) try {
  const auto package = package_at(files, path);
  if (!package || !package->manifest().poster) return std::nullopt;
  return package->entry(*package->manifest().poster);
} catch (const Error&) {
  return std::nullopt;
}

/// By the names of the files. Of a package that cannot be read the viewer shows the name.
std::string package_list(const ServedFiles& files) {
  constexpr std::string_view kPackages = "packages/";
  PackageList list;
  for (const std::string& url : files.packages()) {
    const auto package = package_at(files, "/" + percent_decoded(url));
    const Manifest none, &m = package ? package->manifest() : none;
    list.packages.push_back({url, m.title, m.poster ? "posters/" + url.substr(kPackages.size()) : ""});
  }
  return to_json_line(list);
}

void plain_answer(httplib::Response& response, int status, const std::string& text) {
  response.status = status;
  response.set_content(text, "text/plain; charset=utf-8");
}

void common_headers(httplib::Response& response) {
  response.set_header("Access-Control-Allow-Origin", "*");
  response.set_header("Access-Control-Expose-Headers", "Content-Range, Content-Length, ETag, Accept-Ranges");
  response.set_header("X-Content-Type-Options", "nosniff");
  response.set_header("Cache-Control", "no-cache");  // packages are compiled anew while somebody looks
}

bool lists_tag(const std::string& header, const std::string& etag) {
  return header == "*" || header.find(etag) != std::string::npos;
}

void send_file(ServedFile opened, const httplib::Request& request, httplib::Response& response) {
  const auto file = std::make_shared<ServedFile>(std::move(opened));
  response.set_header("ETag", file->etag);
  response.set_header("Accept-Ranges", "bytes");
  if (lists_tag(request.get_header_value("If-None-Match"), file->etag)) {
    response.status = 304;
    return;
  }
  const std::string if_range = request.get_header_value("If-Range");
  const bool ranged = if_range.empty() || if_range == file->etag;
  const RequestedRange range =
      ranged ? requested_range(request.get_header_value("Range"), file->bytes) : RequestedRange{};
  if (range.kind == RequestedRange::kUnsatisfiable) {
    response.set_header("Content-Range", "bytes */" + std::to_string(file->bytes));
    return plain_answer(response, 416, "the file has " + std::to_string(file->bytes) + " bytes\n");
  }
  const bool part = range.kind == RequestedRange::kPart;
  const std::uint64_t first = part ? range.first : 0, bytes = part ? range.bytes : file->bytes;
  response.status = part ? 206 : 200;
  if (part)
    response.set_header("Content-Range", "bytes " + std::to_string(first) + "-" +
                                             std::to_string(first + bytes - 1) + "/" +
                                             std::to_string(file->bytes));
  if (bytes == 0) return response.set_content("", file->type);
  response.set_content_provider(
      static_cast<std::size_t>(bytes), file->type,
      [file, first](std::size_t offset, std::size_t length, httplib::DataSink& sink) {
        std::uint8_t buffer[kChunkBytes];
        const auto part = std::span(buffer).first(std::min(length, kChunkBytes));
        // A file that became shorter ends the connection.
        return read_at(file->fd.get(), first + offset, part) &&
               sink.write(reinterpret_cast<const char*>(part.data()), part.size());
      });
}

void respond(const ServedFiles& files, const httplib::Request& request, httplib::Response& response) {
  common_headers(response);
  if (request.method == "OPTIONS") {
    response.status = 204;
    response.set_header("Access-Control-Allow-Methods", "GET, HEAD");
    response.set_header("Access-Control-Allow-Headers", "Range, If-Range, If-None-Match");
    response.set_header("Access-Control-Max-Age", "86400");
    return;
  }
  if (request.method != "GET" && request.method != "HEAD") {
    response.set_header("Allow", "GET, HEAD, OPTIONS");
    return plain_answer(response, 405, "GET and HEAD only\n");
  }
  if (request.path == "/packages.json") {
    response.status = 200;
    return response.set_content(package_list(files), "application/json");
  }
  if (request.path.starts_with(kPosters)) {
    const auto poster = package_poster(files, "/packages/" + request.path.substr(kPosters.size()));
    if (!poster) return plain_answer(response, 404, "not found\n");
    response.status = 200;
    return response.set_content(reinterpret_cast<const char*>(poster->data()), poster->size(), "image/jpeg");
  }
  auto file = files.open(request.path);
  if (!file) return plain_answer(response, 404, "not found\n");
  send_file(std::move(*file), request, response);
}

constexpr std::string_view kPrefix = "/packages/";
constexpr std::string_view kEnding = ".texmesh";
constexpr std::size_t kMaxListed = 10000;
constexpr int kMaxDepth = 8;

/// Media types that browsers insist on (scripts, WebAssembly), and those of SPEC.md.
std::string media_type(const std::string& path) {
  static constexpr std::array<std::pair<std::string_view, std::string_view>, 16> kTypes{{
      {".html", "text/html; charset=utf-8"},
      {".js", "text/javascript; charset=utf-8"},
      {".mjs", "text/javascript; charset=utf-8"},
      {".css", "text/css; charset=utf-8"},
      {".json", "application/json"},
      {".map", "application/json"},
      {".svg", "image/svg+xml"},
      {".png", "image/png"},
      {".jpg", "image/jpeg"},
      {".webp", "image/webp"},
      {".ico", "image/x-icon"},
      {".wasm", "application/wasm"},
      {".woff2", "font/woff2"},
      {".txt", "text/plain; charset=utf-8"},
      {".glb", "model/gltf-binary"},
      {".texmesh", kContainerMediaType},
  }};
  for (const auto& [ending, type] : kTypes)
    if (path.ends_with(ending)) return std::string(type);
  return "application/octet-stream";
}

std::string etag_of(const struct stat& st) {
  char text[80];
  std::snprintf(text, sizeof text, "\"%llx-%llx-%llx%09lx\"", static_cast<unsigned long long>(st.st_ino),
                static_cast<unsigned long long>(st.st_size),
                static_cast<unsigned long long>(st.st_mtim.tv_sec),
                static_cast<unsigned long>(st.st_mtim.tv_nsec));
  return text;
}

/// The parts of a relative path; nothing where one of them is empty, hidden or leads upwards.
std::optional<std::vector<std::string>> parts_of(const std::string& path) {
  std::vector<std::string> parts;
  for (const std::string_view part : pieces_of(path, '/')) {
    if (part.empty() || part[0] == '.' || part.find('\0') != part.npos) return std::nullopt;
    parts.emplace_back(part);
  }
  return parts;
}

Descriptor open_part(const Descriptor& folder, const std::string& part, int flags) {
  return Descriptor(
      ::openat(folder.get(), part.c_str(), O_RDONLY | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC | flags));
}

bool has_manifest(const Descriptor& folder) {
  struct stat st {};
  return ::fstatat(folder.get(), kManifestPath, &st, AT_SYMLINK_NOFOLLOW) == 0 && S_ISREG(st.st_mode);
}

std::optional<ServedFile> regular_file(Descriptor fd, const std::string& path) {
  struct stat st {};
  if (fd.get() < 0 || ::fstat(fd.get(), &st) != 0 || !S_ISREG(st.st_mode)) return std::nullopt;
  return ServedFile{std::move(fd), static_cast<std::uint64_t>(st.st_size), media_type(path), etag_of(st)};
}

/// The file at the end of `parts`. With `packages_only`, one named .texmesh or beneath a folder
/// with a manifest.
std::optional<ServedFile> open_beneath(const Descriptor& root, const std::vector<std::string>& parts,
                                       bool packages_only) {
  bool in_package = !packages_only;
  Descriptor folder(::dup(root.get()));
  for (std::size_t i = 0; i + 1 < parts.size(); ++i) {
    folder = open_part(folder, parts[i], O_DIRECTORY);
    if (!in_package) in_package = has_manifest(folder);
  }
  if (!in_package && !parts.back().ends_with(kEnding)) return std::nullopt;
  return regular_file(open_part(folder, parts.back(), 0), parts.back());
}

Descriptor open_folder_or_throw(const std::string& path) {
  Descriptor fd(::open(path.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (fd.get() < 0) throw InputError(path, "", "", std::string("cannot be read: ") + std::strerror(errno));
  return fd;
}

void list_packages(const fs::path& folder, const std::string& prefix, int depth, PackageFolder& out) {
  std::vector<std::string>& found = out.packages;
  std::error_code error;
  std::vector<fs::directory_entry> entries;
  for (fs::directory_iterator it(folder, error), end; !error && it != end; it.increment(error))
    entries.push_back(*it);
  std::ranges::sort(entries, {}, [](const fs::directory_entry& e) { return e.path(); });
  for (const fs::directory_entry& e : entries) {
    if (found.size() >= kMaxListed) return;
    const std::string name = e.path().filename().string();
    const fs::file_status status = e.symlink_status(error);
    if (name.starts_with(".")) continue;
    if (fs::is_symlink(status) && (name.ends_with(kEnding) || e.is_directory(error)))
      out.links.push_back(prefix + name);
    if (fs::is_regular_file(status) && name.ends_with(kEnding)) found.push_back(prefix + name);
    if (!fs::is_directory(status)) continue;
    if (fs::is_regular_file(fs::symlink_status(e.path() / kManifestPath, error)))
      found.push_back(prefix + name + "/");
    else if (depth < kMaxDepth && !is_made_folder(e.path()))
      list_packages(e.path(), prefix + name + "/", depth + 1, out);
  }
}

/// viewer/ or model-viewer/, in which `file` stands.
std::string built_folder(const std::string& name, const char* file, const std::string& wanted) {
  std::error_code error;
  const fs::path folder = fs::read_symlink("/proc/self/exe", error).parent_path();
  std::vector<fs::path> candidates{folder / ".." / name, folder / "../share/texmesh" / name};
  if (!wanted.empty()) candidates = {wanted};
  for (const fs::path& c : candidates)
    if (fs::is_regular_file(c / file, error)) return c.lexically_normal().string();
  fs::path build = (folder / "..").lexically_normal().parent_path();
  if (!fs::is_regular_file(build / "CMakeCache.txt", error)) build = "build/release";
  throw InputError(wanted.empty() ? "the " + name : wanted, "",
                   "the built " + name + "; to build it, run: cmake --build " + build.string() +
                       " --target viewer (it needs node and npm)",
                   std::string("no ") + file);
}

}  // namespace

RequestedRange requested_range(const std::string& header, std::uint64_t size) {
  constexpr std::string_view kUnit = "bytes=";
  std::string_view text = header;
  if (!text.starts_with(kUnit)) return {};
  text.remove_prefix(kUnit.size());
  const std::size_t dash = text.find('-');
  if (dash == std::string_view::npos) return {};
  const std::string_view from = text.substr(0, dash), to = text.substr(dash + 1);
  const auto first = whole_number<std::uint64_t>(from), last = whole_number<std::uint64_t>(to);
  if (from.empty()) {
    if (!last) return {};
    if (*last == 0 || size == 0) return {RequestedRange::kUnsatisfiable, 0, 0};
    const std::uint64_t bytes = std::min(*last, size);
    return {RequestedRange::kPart, size - bytes, bytes};
  }
  if (!first || (!to.empty() && (!last || *last < *first))) return {};
  if (*first >= size) return {RequestedRange::kUnsatisfiable, 0, 0};
  const std::uint64_t end = to.empty() ? size : std::min(*last, size - 1) + 1;
  return {RequestedRange::kPart, *first, end - *first};
}

struct ViewServer::Impl {
  httplib::Server server;
};

ViewServer::ViewServer(const ServedFiles& files) : impl_(std::make_unique<Impl>()) {
  httplib::Server& server = impl_->server;
  server.new_task_queue = [] { return new httplib::ThreadPool(kThreads); };
  server.set_tcp_nodelay(true);
  server.set_payload_max_length(1 << 20);
  server.set_keep_alive_max_count(100000);
  server.set_pre_routing_handler([&files](const httplib::Request& request, httplib::Response& response) {
    // Ranges are ours: the library's own know neither If-Range nor ranges that lie behind the end.
    const_cast<httplib::Request&>(request).ranges.clear();
    respond(files, request, response);
    return httplib::Server::HandlerResponse::Handled;
  });
  server.set_exception_handler(
      [](const httplib::Request&, httplib::Response& response, const std::exception_ptr&) {
        plain_answer(response, 500, "internal error\n");
      });
}
ViewServer::~ViewServer() = default;

int ViewServer::bind(const std::string& host, int port) {
  httplib::Server& server = impl_->server;
  // Two servers on one port would share its connections, which is what the library's default asks for.
  server.set_socket_options([](socket_t socket) {
    const int yes = 1;
    ::setsockopt(socket, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes);
  });
  errno = 0;
  const int bound = port == 0 ? server.bind_to_any_port(host) : server.bind_to_port(host, port) ? port : -1;
  if (bound < 0)
    throw InputError(host + ":" + std::to_string(port), "", "",
                     "cannot be listened on: " + (errno == 0 ? "the address is not this machine's"
                                                             : std::string(std::strerror(errno))));
  return bound;
}

void ViewServer::serve() { impl_->server.listen_after_bind(); }

PackageFolder find_packages(const std::string& package) {
  std::error_code error;
  const fs::path path = fs::canonical(package, error);
  if (error) throw InputError(package, "", "", "cannot be read: " + error.message());
  const bool folder = fs::is_directory(path);
  const bool tree = folder && fs::is_regular_file(path / kManifestPath);
  if (!folder && !fs::is_regular_file(path))
    throw InputError(package, "", "a regular file", "something else");
  if (!folder || tree)
    return {path.parent_path().string(), {path.filename().string() + (tree ? "/" : "")}, true, {}};
  PackageFolder found{path.string(), {}, false, {}};
  list_packages(path, "", 0, found);
  if (found.packages.empty())
    throw InputError(package, "", "a package, or a folder of packages",
                     found.links.empty() ? "no package in it" : links_left_out(found));
  return found;
}

std::string links_left_out(const PackageFolder& folder) {
  if (folder.links.empty()) return "";
  const std::size_t count = folder.links.size();
  return (count == 1 ? "1 symbolic link is" : std::to_string(count) + " symbolic links are") +
         " left out, since links may lead to what is not to be published: " + folder.links.front() +
         (count > 1 ? " among them" : "");
}

ServedFiles::ServedFiles(const std::string& package, const std::string& viewer) {
  const PackageFolder found = find_packages(package);
  viewer_ = open_folder_or_throw(viewer);
  root_ = open_folder_or_throw(found.path);
  if (found.alone) only_ = found.packages.front();
}

std::optional<ServedFile> ServedFiles::open(const std::string& path) const {
  if (!path.starts_with("/")) return std::nullopt;
  if (path.starts_with(kPrefix)) {
    const std::string rest = path.substr(kPrefix.size());
    const bool tree = only_.ends_with("/");
    // The one package may have any name, hidden ones and names without .texmesh included: the user gave it.
    if (!only_.empty() && !tree)
      return rest == only_ ? regular_file(open_part(root_, rest, 0), rest) : std::nullopt;
    if (tree && !rest.starts_with(only_)) return std::nullopt;
    const auto parts = parts_of(tree ? rest.substr(only_.size()) : rest);
    if (!parts) return std::nullopt;
    if (!tree) return open_beneath(root_, *parts, true);
    return open_beneath(open_part(root_, only_.substr(0, only_.size() - 1), O_DIRECTORY), *parts, false);
  }
  const auto parts = parts_of(path == "/" ? "index.html" : path.substr(1));
  return parts ? open_beneath(viewer_, *parts, false) : std::nullopt;
}

std::vector<std::string> ServedFiles::packages() const {
  PackageFolder found;
  if (!only_.empty())
    found.packages.push_back(only_);
  else
    list_packages("/proc/self/fd/" + std::to_string(root_.get()), "", 0, found);
  for (std::string& p : found.packages) p = std::string(kPrefix.substr(1)) + percent_encoded(p);
  return found.packages;
}

std::string viewer_folder(const std::string& wanted) { return built_folder("viewer", "index.html", wanted); }
std::string model_viewer_folder(const std::string& wanted) {
  return built_folder("model-viewer", kModelViewerScript, wanted);
}

}  // namespace texmesh
