#include "tools/publish/pages/page.h"

#include <fmt/format.h>
#include <filesystem>

#include "format/base/portable_math.h"
#include "pipeline/io/markup.h"
#include "pipeline/io/table.h"

namespace texmesh {

std::string_view built_in_text(std::span<const BuiltInFile> files, std::string_view name) {
  return std::ranges::find(files, name, &BuiltInFile::name)->text;
}

std::string page_style(std::string_view own) {
  return std::string(built_in_text(pages_page_files(), "base.css")) + std::string(own);
}

std::string filled(std::string_view text, const TemplateValues& values) {
  std::string out;
  for (;;) {
    const std::size_t begin = text.find("{{"), end = text.find("}}", begin);
    if (begin == std::string_view::npos || end == std::string_view::npos) break;
    const std::string_view name = text.substr(begin + 2, end - begin - 2);
    const auto value = values.find(name);
    if (value == values.end()) throw std::logic_error("a page asks for {{" + std::string(name) + "}}");
    out += text.substr(0, begin);
    out += value->second;
    text.remove_prefix(end + 2);
  }
  return out += text;
}

std::string html_page(const std::string& title, const std::string& body) {
  const std::span<const BuiltInFile> files = pages_page_files();
  return std::string(kReportFirstLine) +
         filled(built_in_text(files, "report.html"),
                {{"beginning",
                  page_beginning(
                      title, "default-src 'none'; img-src 'self' file: data:; style-src 'unsafe-inline'")},
                 {"style", page_style(built_in_text(files, "report.css"))},
                 {"body", body}});
}

std::string html_section(const std::string& id, const std::string& heading, const std::string& body) {
  return fmt::format("<section aria-labelledby=\"{0}\">\n<h2 id=\"{0}\">{1}</h2>\n{2}</section>\n", id,
                     heading, body);
}

std::string last_name(const std::string& path) {
  const std::filesystem::path p(path);
  return (p.has_filename() ? p : p.parent_path()).filename().string();
}

std::string readable_title(const std::string& path) {
  constexpr std::string_view kEnding = ".texmesh";
  std::string name = last_name(path);
  if (name.ends_with(kEnding)) name.resize(name.size() - kEnding.size());
  std::string title;
  const auto is_small = [](char c) { return c >= 'a' && c <= 'z'; };
  for (const char c : name) {
    if (c == '_' || c == '-' || c == ' ') {
      if (!title.empty() && !title.ends_with(' ')) title += ' ';
      continue;
    }
    if (c >= 'A' && c <= 'Z' && !title.empty() && is_small(title.back())) title += ' ';
    title += c;
  }
  if (title.ends_with(' ')) title.pop_back();
  if (title.empty()) return name;
  if (is_small(title[0])) title[0] = static_cast<char>(title[0] - 'a' + 'A');
  return title;
}

std::string sides_in_words(Vec3d sides_m) {
  const double most = std::max({sides_m.x, sides_m.y, sides_m.z});
  const auto& [per_metre, unit] = most >= 1      ? std::pair{1.0, "m"}
                                  : most >= 0.01 ? std::pair{100.0, "cm"}
                                                 : std::pair{1000.0, "mm"};
  const auto text = [factor = per_metre](double side_m) {
    const double side = side_m * factor;
    return side < 9.95 ? fmt::format("{:.2g}", side) : fmt::format("{:.0f}", side);
  };
  return text(sides_m.x) + " x " + text(sides_m.y) + " x " + text(sides_m.z) + " " + unit;
}

std::string package_title(PackageReader& package) {
  const std::string& title = package.manifest().title;
  return title.empty() ? readable_title(package.store().name()) : title;
}

std::string rights_line(const About& about) {
  std::string out = markup_escaped(about.attribution.empty() ? about.creator : about.attribution);
  if (const std::string page = creator_url(about); about.attribution.empty() && !page.empty())
    out = fmt::format("<a href=\"{}\">{}</a>", markup_escaped(page), out);
  if (!about.licence.empty()) {
    const std::string licence = markup_escaped(about.licence);
    if (!out.empty()) out += ", ";
    out += about.licence_url.empty() ? licence
                                     : fmt::format("<a rel=\"license\" href=\"{}\">{}</a>",
                                                   markup_escaped(about.licence_url), licence);
  }
  return out.empty() ? out : "<p class=\"quiet\">" + out + "</p>\n";
}

std::string notes_html(const Annotations& annotations) {
  std::string out;
  for (std::size_t i = 0; i < annotations.list.size(); ++i) {
    const Annotation& a = annotations.list[i];
    out += fmt::format("<li id=\"note-{}\">", i + 1);
    for (const AnnotationText& t : a.texts) {
      out += fmt::format("<div lang=\"{}\"><h3>{}</h3>", t.language, markup_escaped(t.title));
      if (!t.text.empty()) out += "<p>" + markup_escaped(t.text) + "</p>";
      out += "</div>";
    }
    for (const AnnotationImage& image : a.images)
      out += fmt::format("<p><a href=\"{0}\" rel=\"noopener\">{0}</a></p>", markup_escaped(image.url));
    out += "</li>\n";
  }
  return out.empty() ? "" : "<ol class=\"notes\">\n" + out + "</ol>\n";
}

namespace {

constexpr double kWidth = 760, kHeight = 356, kLeft = 58, kRight = 16, kTop = 30, kBottom = 46;
constexpr double kPlotWidth = kWidth - kLeft - kRight, kPlotHeight = kHeight - kTop - kBottom;
constexpr double kLegendLine = 18;

/// The step of 1, 2 or 5 times a power of ten that divides a span into about so many parts.
double round_step(double span, int parts) {
  const double least = span / parts;
  double power = 1;
  while (power > least) power /= 10;
  while (power * 10 <= least) power *= 10;
  for (const double digit : {1.0, 2.0, 5.0})
    if (digit * power >= least * (1 - 1e-9)) return digit * power;
  return 10 * power;
}

class Canvas {
 public:
  explicit Canvas(const Plot& plot) : plot_(plot) {
    const double high = plot.y_high > 0 ? plot.y_high : plot.y_low < 0 ? 0 : 1;
    step_ = round_step(high - plot.y_low, 5);
    top_value_ = step_ * std::ceil(high / step_ - 1e-9);
    low_value_ = step_ * std::floor(plot.y_low / step_ + 1e-9);
  }
  double x(double v) const {
    const double inside = std::clamp(v, plot_.x_low, plot_.x_high);
    if (plot_.linear_x) return kLeft + kPlotWidth * (inside - plot_.x_low) / (plot_.x_high - plot_.x_low);
    const double low = portable::log(plot_.x_low), high = portable::log(plot_.x_high);
    return kLeft + kPlotWidth * (portable::log(inside) - low) / (high - low);
  }
  double y(double v) const {
    const double at = (std::clamp(v, low_value_, top_value_) - low_value_) / (top_value_ - low_value_);
    return kTop + kPlotHeight * (1 - at);
  }
  std::string axes(bool bytes) const {
    std::string svg;
    const auto lowest = static_cast<int>(std::floor(low_value_ / step_ + 0.5));
    for (int i = lowest; i * step_ <= top_value_ + 1e-9 * step_; ++i)
      svg += fmt::format(
          "<path class=\"grid\" d=\"M{} {:.1f}h{}\"/><text class=\"quiet end\" x=\"{}\" "
          "y=\"{:.1f}\">{:.4g}</text>\n",
          kLeft, y(i * step_), kPlotWidth, kLeft - 7, y(i * step_) + 4, i * step_);
    for (const double v : ticks())
      svg += fmt::format(
          "<path class=\"grid\" d=\"M{0:.1f} {1}v{2}\"/><text class=\"quiet mid\" x=\"{0:.1f}\" "
          "y=\"{3}\">{4}</text>\n",
          x(v), kTop, kPlotHeight + 5, kTop + kPlotHeight + 20,
          bytes                     ? format_bytes(static_cast<std::uint64_t>(v))
          : plot_.linear_x || v < 1 ? fmt::format("{:.4g}", v)
                                    : fmt::format("{:.0f}", v));
    return svg + fmt::format("<text class=\"quiet end\" x=\"{}\" y=\"{}\">{}</text>\n", kLeft + kPlotWidth,
                             kHeight - 8, markup_escaped(plot_.x_name));
  }
  std::string path(const PlotSeries& s) const {
    std::string d;
    for (std::size_t i = 0; i < s.points.size(); ++i) {
      const double px = x(s.points[i].first), py = y(s.points[i].second);
      if (i == 0)
        d += fmt::format("M{:.1f} {:.1f}", px, py);
      else if (s.steps)
        d += fmt::format("H{:.1f}V{:.1f}", px, py);
      else
        d += fmt::format("L{:.1f} {:.1f}", px, py);
    }
    return d;
  }

 private:
  /// 1, 2 and 5 times powers of ten; powers alone where there are many.
  std::vector<double> ticks() const {
    if (plot_.linear_x) return even_ticks();
    const bool many = plot_.x_high / plot_.x_low > 3000;
    std::vector<double> out;
    for (int power = -3; power <= 12; ++power)
      for (const double digit : {1.0, 2.0, 5.0}) {
        double v = digit;
        for (int i = 0; i < power; ++i) v *= 10;
        for (int i = 0; i > power; --i) v /= 10;
        if (v >= plot_.x_low * (1 - 1e-9) && v <= plot_.x_high * (1 + 1e-9) && (!many || digit == 1))
          out.push_back(v);
      }
    return out;
  }
  std::vector<double> even_ticks() const {
    const double step = round_step(plot_.x_high - plot_.x_low, 10);
    std::vector<double> out;
    for (double i = std::ceil(plot_.x_low / step - 1e-9); i * step <= plot_.x_high + 1e-9 * step; ++i)
      out.push_back(i * step + 0.0);  // never -0
    return out;
  }
  const Plot& plot_;
  double step_ = 1, top_value_ = 1, low_value_ = 0;
};

std::string dot(const PlotSeries& s, double x, double y) {
  return fmt::format("<circle class=\"f{}\" cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"2.6\"/>", s.colour, x, y);
}

/// And the height of its lines.
std::pair<std::string, double> legend(const std::vector<PlotSeries>& series, double top) {
  std::string svg;
  double x = kLeft, y = top;
  for (const PlotSeries& s : series) {
    if (s.name.empty()) continue;
    const double width = 34 + 7.0 * static_cast<double>(s.name.size());
    if (x > kLeft && x + width > kWidth) x = kLeft, y += kLegendLine;
    svg += s.dots ? dot(s, x + 10, y - 4)
                  : fmt::format("<path class=\"line {} {} {}\" d=\"M{:.1f} {:.1f}h20\"/>", s.colour,
                                s.strong ? "strong" : "", s.dashed ? "dash" : "", x, y - 4);
    svg += fmt::format("<text x=\"{:.1f}\" y=\"{:.1f}\">{}</text>\n", x + 26, y, markup_escaped(s.name));
    x += width;
  }
  return {svg, svg.empty() ? 0 : y - top + kLegendLine};
}

}  // namespace

std::string Plot::svg() const {
  const Canvas canvas(*this);
  const auto [names, names_height] = legend(series, kHeight + kLegendLine);
  const double height = kHeight + names_height + 8;
  std::string out =
      fmt::format("<svg role=\"img\" aria-label=\"{}\" width=\"{}\" height=\"{}\" viewBox=\"0 0 {} {}\">\n",
                  markup_escaped(title), kWidth, height, kWidth, height);
  out += canvas.axes(x_name.find("bytes") != std::string::npos);
  out += fmt::format("<text class=\"quiet\" x=\"{}\" y=\"{}\">{}</text>\n", kLeft, kTop - 12,
                     markup_escaped(y_name));
  for (const PlotSeries& s : series) {
    if (!s.dots)
      out += fmt::format("<path class=\"line {} {} {}\" d=\"{}\"/>\n", s.colour, s.strong ? "strong" : "",
                         s.dashed ? "dash" : "", canvas.path(s));
    if (s.dots || s.strong)
      for (const auto& [px, py] : s.points) out += dot(s, canvas.x(px), canvas.y(py)) + "\n";
  }
  return out + names + "</svg>\n";
}

}  // namespace texmesh
