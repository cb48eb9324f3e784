#include "delivery/cpp/package/http_tree.h"

#include <optional>

#include "format/base/errors.h"
#include "format/container/container.h"

namespace texmesh {

void HttpTree::fetch(std::vector<Wanted> wanted) {
  std::erase_if(wanted, [&](const Wanted& w) { return files_.contains(w.path); });
  std::vector<HttpRetries> retries(wanted.size(), HttpRetries(link_->options));
  try {
    for (std::size_t i = 0; i < wanted.size(); ++i) {
      if (!is_valid_entry_path(wanted[i].path))
        throw FormatError(name(), wanted[i].path, "a path within the package", "another");
      start(i, wanted[i]);
    }
    while (auto ended = link_->pool.wait(kRequestWait_s)) {
      const auto i = static_cast<std::size_t>(ended->number);
      HttpAnswer& a = ended->answer;
      if (accept(wanted[i], a)) {
        store(wanted[i].path, std::move(wanted[i].got));
        continue;
      }
      if (a.too_long)
        throw FormatError(name(), wanted[i].path, "at most " + std::to_string(wanted[i].max_bytes) + " bytes",
                          "more");
      if (a.body.size() >= kProgressBytes && ranges_) retries[i] = HttpRetries(link_->options);
      if (!may_retry(a) || !retries[i].wait(a))
        throw InputError(name() + wanted[i].path, "", "a file", describe_answer(a));
      start(i, wanted[i]);
    }
  } catch (...) {
    for (std::size_t i = 0; i < wanted.size(); ++i) link_->pool.cancel(i);
    throw;
  }
}

void HttpTree::start(std::size_t number, const Wanted& w) {
  const std::uint64_t have = w.got.size();
  const HttpRange rest{have, w.max_bytes - have, true};  // all of it where it was replaced
  link_->pool.start(number, root_ + w.path, have > 0 ? std::optional(rest) : std::nullopt, w.max_bytes);
}

bool HttpTree::accept(Wanted& w, HttpAnswer& a) const {
  if (a.status == 206 && !is_same_file(a, w.etag, 0)) {  // replaced meanwhile: all of it anew
    w.got.clear();
    w.etag.clear();
    a.complete = a.too_long = false;  // worth another try
    return false;
  }
  if (a.status == 200) w.got.clear();
  if (a.status != 200 && (a.status != 206 || !a.first || *a.first != w.got.size())) return false;
  w.got.insert(w.got.end(), a.body.begin(), a.body.end());
  if (a.complete) return true;
  w.etag = a.etag;
  if (!ranges_ || w.got.size() >= w.max_bytes) w.got.clear();
  return false;
}

}  // namespace texmesh
