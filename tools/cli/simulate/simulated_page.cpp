#include "tools/cli/simulate/simulated_page.h"

#include <fmt/format.h>
#include <charconv>
#include <memory>
#include <nlohmann/json.hpp>

#include "pipeline/io/table.h"
#include "pipeline/io/wire_text.h"
#include "tools/cli/options/delivery_options.h"
#include "tools/cli/options/units.h"

namespace texmesh {
namespace {

using Json = nlohmann::ordered_json;

Json page_json(const PagePlan& plan, const std::vector<BesideObject>& objects, double limit_s) {
  Json list = Json::array();
  for (std::size_t i = 0; i < objects.size(); ++i) {
    const DeliveryPlan& p = plan.objects[i];
    list.push_back({{"package", readable_name(objects[i].package)},
                    {"display_px", objects[i].displayed_px},
                    {"scale", p.scale},
                    {"first_picture_only", static_cast<bool>(plan.first_picture_only[i])},
                    {"bytes", p.bytes()},
                    {"flip", p.flip},
                    {"alone_flip", plan.alone_flip[i]}});
    if (p.proxy) list.back()["proxy"] = *p.proxy;
  }
  return {{"version", 1},
          {"objects", list},
          {"first_pictures_s", plan.first_pictures_s},
          {"meshes_s", plan.meshes_s},
          {"complete_s", plan.complete_s},
          {"whole_limit_s", limit_s},
          {"whole_deviation_percent", 100 * (limit_s - plan.complete_s) / limit_s},
          {"flip", plan.flip},
          {"alone_flip", plan.alone_mean_flip}};
}

std::string page_text(const PagePlan& plan, const std::vector<BesideObject>& objects, double limit_s) {
  Table table;
  for (const char* h : {"object", "px", "shows", "bytes", "FLIP", "by itself"}) table.column(h);
  for (std::size_t i = 0; i < objects.size(); ++i) {
    const DeliveryPlan& p = plan.objects[i];
    table.row({readable_name(objects[i].package), fixed(objects[i].displayed_px, 0),
               plan.first_picture_only[i] ? "first picture"
               : p.proxy                  ? fmt::format("proxy {}", *p.proxy)
                                          : fmt::format("S_{}", p.scale),
               grouped(p.bytes()), fixed(p.flip, 4), fixed(plan.alone_flip[i], 4)});
  }
  return fmt::format(
      "{}all first pictures {}, all meshes {}, textures {}: deviation {:+.2f} % of {:.2f} s\n"
      "predicted FLIP over the pixels of all {:.4f}; with a part of the link to each by itself {:.4f}\n",
      table.text(), moment(plan.first_pictures_s), moment(plan.meshes_s), moment(plan.complete_s),
      100 * (limit_s - plan.complete_s) / limit_s, limit_s, plan.flip, plan.alone_mean_flip);
}

}  // namespace

BesideObject beside_object(const std::string& text) {
  const std::size_t comma = text.rfind(',');
  if (comma == std::string::npos) return {text, 0};
  double px = 0;
  const char* end = text.data() + text.size();
  const auto [stop, error] = std::from_chars(text.data() + comma + 1, end, px);
  if (error != std::errc() || stop != end) return {text, 0};  // a comma of the name
  if (!(px >= 1 && px <= 1e6)) throw UsageError("--beside", "", "a displayed height from 1 to 1e6 px", text);
  return {text.substr(0, comma), px};
}

std::string simulated_page(const std::string& first, const std::vector<std::string>& beside,
                           const DeliveryRequest& request, bool json) {
  std::vector<BesideObject> objects{{first, request.displayed_px}};
  for (const std::string& text : beside) {
    objects.push_back(beside_object(text));
    if (objects.back().displayed_px <= 0) objects.back().displayed_px = request.displayed_px;
  }
  std::vector<std::unique_ptr<PackageReader>> packages;
  std::vector<PageObject> page;
  for (const BesideObject& o : objects) {
    packages.push_back(std::make_unique<PackageReader>(open_store(o.package)));
    page.push_back({packages.back().get(), o.displayed_px, page.empty() ? request.scale : -1});
  }
  const PagePlan plan = plan_page(page, request);
  return json ? page_json(plan, objects, request.time_limit_s).dump() + '\n'
              : page_text(plan, objects, request.time_limit_s);
}

}  // namespace texmesh
