#include "tools/publish/view/view_server.h"

#include <httplib.h>

#include <algorithm>
#include <charconv>
#include <nlohmann/json.hpp>

#include "format/container/container.h"
#include "format/documents/manifest.h"

namespace texmesh {
namespace {

constexpr std::size_t kThreads = 64;  // each open connection holds one, and browsers keep six per page
constexpr std::size_t kChunkBytes = 64 << 10;
constexpr std::string_view kPosters = "/posters/";

constexpr std::uint64_t kManifestOffset = 64;  // of the data in a container (SPEC.md, section 2)

std::vector<std::uint8_t> read_part(const ServedFile& file, std::uint64_t offset, std::uint64_t bytes) {
  std::vector<std::uint8_t> out(static_cast<std::size_t>(bytes));
  std::size_t at = 0;
  while (at < out.size()) {
    const std::size_t n = file.read(offset + at, reinterpret_cast<char*>(out.data()) + at, out.size() - at);
    if (n == 0) break;
    at += n;
  }
  out.resize(at);
  return out;
}

/// Of the container's first bytes, or of a tree's file.
std::optional<Manifest> manifest_of(const ServedFiles& files, const std::string& path) {
  const bool tree = path.ends_with("/");
  const auto file = files.open(tree ? path + kManifestPath : path);
  if (!file) return std::nullopt;
  std::vector<std::uint8_t> bytes = read_part(*file, 0, std::min(file->bytes(), kBootstrapBytes));
  if (!tree) {
    if (bytes.size() < kManifestOffset) return std::nullopt;
    std::uint64_t length = 0;
    for (int i = 3; i >= 0; --i) length = length << 8 | bytes[static_cast<std::size_t>(22 + i)];
    bytes.erase(bytes.begin(), bytes.begin() + kManifestOffset);
    if (length > bytes.size()) return std::nullopt;
    bytes.resize(static_cast<std::size_t>(length));
  }
  try {
    return read_manifest(bytes);
  } catch (const FormatError&) {
    return std::nullopt;
  }
}

std::string decoded(const std::string& url) {
  const auto digit = [](char c) { return c <= '9' ? c - '0' : c - 'A' + 10; };
  std::string out;
  for (std::size_t i = 0; i < url.size(); ++i)
    if (url[i] == '%' && i + 2 < url.size()) {
      out += static_cast<char>(16 * digit(url[i + 1]) + digit(url[i + 2]));
      i += 2;
    } else {
      out += url[i];
    }
  return out;
}

/// The package's poster, a JPEG, its digest checked; nothing where there is none.
std::optional<std::vector<std::uint8_t>> package_poster(const ServedFiles& files, const std::string& path) {
  const std::optional<Manifest> m = manifest_of(files, path);
  if (!m || !m->poster) return std::nullopt;
  const bool tree = path.ends_with("/");
  const auto file = files.open(tree ? path + kPosterPath : path);
  if (!file) return std::nullopt;
  std::vector<std::uint8_t> bytes = read_part(*file, tree ? 0 : m->poster->offset, m->poster->bytes);
  if (bytes.size() != m->poster->bytes || sha256(bytes) != m->poster->digest) return std::nullopt;
  return bytes;
}

/// By the names of the files. Of a package that cannot be read the viewer shows the name.
std::string package_list(const ServedFiles& files) {
  constexpr std::string_view kPackages = "packages/";
  PackageList list;
  for (const std::string& url : files.packages()) {
    const std::optional<Manifest> m = manifest_of(files, "/" + decoded(url));
    const bool poster = m && m->poster;
    list.packages.push_back(
        {url, m ? m->title : "", poster ? "posters/" + url.substr(kPackages.size()) : ""});
  }
  return to_json_line(list);
}

bool parse_number(std::string_view text, std::uint64_t& value) {
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  return error == std::errc() && end == text.data() + text.size();
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
  response.set_header("ETag", file->etag());
  response.set_header("Accept-Ranges", "bytes");
  if (lists_tag(request.get_header_value("If-None-Match"), file->etag())) {
    response.status = 304;
    return;
  }
  const std::string if_range = request.get_header_value("If-Range");
  const bool ranged = if_range.empty() || if_range == file->etag();
  const RequestedRange range =
      ranged ? requested_range(request.get_header_value("Range"), file->bytes()) : RequestedRange{};
  if (range.kind == RequestedRange::kUnsatisfiable) {
    response.set_header("Content-Range", "bytes */" + std::to_string(file->bytes()));
    return plain_answer(response, 416, "the file has " + std::to_string(file->bytes()) + " bytes\n");
  }
  const bool part = range.kind == RequestedRange::kPart;
  const std::uint64_t first = part ? range.first : 0, bytes = part ? range.bytes : file->bytes();
  response.status = part ? 206 : 200;
  if (part)
    response.set_header("Content-Range", "bytes " + std::to_string(first) + "-" +
                                             std::to_string(first + bytes - 1) + "/" +
                                             std::to_string(file->bytes()));
  if (bytes == 0) return response.set_content("", file->type());
  response.set_content_provider(
      static_cast<std::size_t>(bytes), file->type(),
      [file, first](std::size_t offset, std::size_t length, httplib::DataSink& sink) {
        char buffer[kChunkBytes];
        const std::size_t n = file->read(first + offset, buffer, std::min(length, kChunkBytes));
        return n > 0 && sink.write(buffer, n);  // a file that became shorter ends the connection
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

}  // namespace

RequestedRange requested_range(const std::string& header, std::uint64_t size) {
  constexpr std::string_view kUnit = "bytes=";
  std::string_view text = header;
  if (!text.starts_with(kUnit)) return {};
  text.remove_prefix(kUnit.size());
  const std::size_t dash = text.find('-');
  if (dash == std::string_view::npos) return {};
  const std::string_view from = text.substr(0, dash), to = text.substr(dash + 1);
  std::uint64_t first = 0, last = 0;
  if (from.empty()) {
    if (!parse_number(to, last)) return {};
    if (last == 0 || size == 0) return {RequestedRange::kUnsatisfiable, 0, 0};
    const std::uint64_t bytes = std::min(last, size);
    return {RequestedRange::kPart, size - bytes, bytes};
  }
  if (!parse_number(from, first) || (!to.empty() && (!parse_number(to, last) || last < first))) return {};
  if (first >= size) return {RequestedRange::kUnsatisfiable, 0, 0};
  const std::uint64_t end = to.empty() ? size : std::min(last, size - 1) + 1;
  return {RequestedRange::kPart, first, end - first};
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
  const int bound = port == 0 ? server.bind_to_any_port(host) : server.bind_to_port(host, port) ? port : -1;
  if (bound < 0)
    throw InputError(host + ":" + std::to_string(port), "", "",
                     "cannot be listened on: the port is in use, or the address is not this machine's");
  return bound;
}

void ViewServer::serve() { impl_->server.listen_after_bind(); }

}  // namespace texmesh
